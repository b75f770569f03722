"""Parser of VRML97 texts (ISO/IEC 14772-1), and of X3D in the classic encoding (ISO/IEC 19776-2).

It turns a text into nodes whose fields have values of their types.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError
from terratool.importing.vrml.nodes import WIDTHS, Language
from terratool.importing.vrml.text import NUMERIC, PlacedText, VrmlText

_INT32 = 2**31
_MEANING = {
    **dict.fromkeys(WIDTHS, "numbers"),
    "Bool": "TRUE or FALSE",
    "Image": "numbers",
    "Node": "a node, or NULL",
    "String": "a text in quotation marks",
}
T = TypeVar("T")
Step = Generator[Any, Any, T]
"""A step of parsing, which yields inner steps and is sent what they return."""

_WITH_VALUE = ("field", "exposedField", "initializeOnly", "inputOutput")
_FLAGS = {"TRUE": True, "FALSE": False}
_SPELLING = 0.85
_MANY = 10_000
"""Most names among which a similar one is looked for."""


class FieldValue(NamedTuple):
    """Value of a field.

    Attributes:
        kind: kind of value; "empty" for [] and NULL.
        at: offset of the value in bytes.
        numbers: (n,) float64, the value of kind "numbers".
        nodes: the value of kind "nodes".
        flag: the value of kind "flag".
    """

    kind: Literal["numbers", "strings", "flag", "nodes", "empty"]
    at: int
    numbers: NDArray[np.float64] = np.empty(0)
    nodes: tuple[Node, ...] = ()
    flag: bool = False


@dataclass(slots=True, eq=False)
class Node:
    """A node of a text; DEF and USE place one node in several parents.

    Attributes:
        kind: type of the node, such as Transform.
        at: offset of the type's name in bytes.
        fields: values by the names of fields.
    """

    kind: str
    at: int
    fields: dict[str, FieldValue] = field(default_factory=dict)


def check(text: PlacedText, value: FieldValue, kind: str, name: str) -> None:
    """Refuse the value of a field that is not of its type.

    Args:
        text: text with the value.
        value: value that was read.
        kind: type of the field, such as MFVec3f.
        name: name of the field.

    Raises:
        ReadError: the value is of another type, has too few or too many numbers, or broken
            integers.
    """
    plain, single = kind[2:], kind.startswith("S")
    if plain == "Node":
        fits = value.kind == "empty" or (
            value.kind == "nodes" and not (single and len(value.nodes) > 1)
        )
    elif plain == "Bool":
        fits = value.kind == "flag"
    else:
        wanted = "strings" if plain == "String" else "numbers"
        fits = value.kind == wanted or (value.kind == "empty" and not single)
    if not fits:
        raise text.error(value.at, f'"{name}" is no {kind}.', f"Write {_MEANING[plain]}.")
    if value.kind != "numbers" or plain not in WIDTHS:
        return
    width, count = WIDTHS[plain], len(value.numbers)
    if count % width or (single and count != width):
        many = f"{width}" if single else f"a multiple of {width}"
        raise text.error(
            value.at,
            f'"{name}" has {count:,} numbers, and not {many}.',
            "A number is missing, or there is one too many.",
        )
    if plain == "Int32":
        numbers = value.numbers
        wrong = (numbers != np.floor(numbers)) | (numbers < -_INT32) | (numbers >= _INT32)
        if wrong.any():
            index = int(np.argmax(wrong))
            raise text.error(
                text.place_of(value.at, index),
                f'"{numbers[index]:.15g}" is no integer of 32 bits.',
                "Write a whole number.",
            )


class Unit(NamedTuple):
    """A UNIT of X3D: its category, its name, and its size in metres or radians."""

    category: str
    name: str
    factor: float


class VrmlScene(NamedTuple):
    """Contents of a text.

    Attributes:
        language: language of the text.
        nodes: nodes outside of all others.
        units: units that the text states.
    """

    language: Language
    nodes: tuple[Node, ...]
    units: tuple[Unit, ...] = ()


def parse(text: VrmlText, language: Language) -> VrmlScene:
    """Parse a text behind its first line.

    Raises:
        ReadError: the text is not of that language; the message says where.
    """
    parser = _VrmlParser(text, language)
    if language.is_open:
        parser.head()
    nodes = _finish(parser.statements(-1))
    return VrmlScene(language, nodes, tuple(parser.units))


def _finish(step: Step[T]) -> T:
    """Run a step with all steps inside it, without recursion, and return its result."""
    steps: list[Step[Any]] = [step]
    result: Any = None
    while steps:
        try:
            inner = steps[-1].send(result)
        except StopIteration as end:
            steps.pop()
            result = end.value
        else:
            steps.append(inner)
            result = None
    return result  # type: ignore[no-any-return]


class _VrmlParser:
    """State of parsing a text.

    Attributes:
        text: the text.
        language: language of the text.
        units: units that the head of an X3D text states.
        names: nodes by the names that DEF gives them.
        open: number of unfinished nodes by name.
        scripts: number of open Scripts, whose fields may refer to nodes around them.
    """

    def __init__(self, text: VrmlText, language: Language) -> None:
        self.text = text
        self.language = language
        self.units: list[Unit] = []
        self.names: dict[str, Node] = {}
        self.open: dict[str, int] = {}
        self.scripts = 0

    # --- statements -----------------------------------------------------------------------------

    def head(self) -> None:
        """Parse the statements with which an X3D text begins (ISO/IEC 19776-2, 4.3)."""
        text = self.text
        while text.peek() >= 0:
            at = text.at
            word = text.word("a statement")
            if word in ("PROFILE", "COMPONENT"):
                text.word(f"the name behind {word}")
            elif word == "META":
                for _ in range(2):
                    text.peek()
                    text.string()
            elif word == "UNIT":
                category, name = text.word("what is measured"), text.word("a unit")
                self.units.append(Unit(category, name, self._factor()))
            else:
                text.at = at
                return

    def _factor(self) -> float:
        text = self.text
        text.peek()
        at = text.at
        numbers = text.run()
        if len(numbers) != 1:
            raise text.error(at, "a UNIT has no number.", "Write UNIT length foot 0.3048.")
        return float(numbers[0])

    def statements(self, opened: int) -> Step[tuple[Node, ...]]:
        """Parse nodes and statements up to the closing brace, or up to the end of the text.

        Args:
            opened: offset of the opening brace; -1 for the whole file.
        """
        text = self.text
        nodes: list[Node] = []
        while True:
            byte = text.peek()
            if byte < 0:
                if opened >= 0:
                    raise self._unclosed_error(opened)
                return tuple(nodes)
            if opened >= 0 and text.take(b"}"):
                return tuple(nodes)
            at = text.at
            word = text.word("a node")
            if word in self.language.statements:
                self._statement(word, at)
            else:
                nodes.append((yield self.node(word, at)))

    def _statement(self, word: str, at: int) -> None:
        """Skip a ROUTE, or an IMPORT or EXPORT of X3D, whose first word was read.

        Raises:
            ReadError: the statement is a PROTO or an EXTERNPROTO, or broken.
        """
        text = self.text
        if word in ("IMPORT", "EXPORT"):
            text.word(f"the name behind {word}")
            text.peek()
            if text.data.startswith(b"AS", text.at):
                text.word("AS")
                text.word("the name behind AS")
            return
        if word != "ROUTE":
            raise unread_prototype(text, at, f"a {word}" if word == "PROTO" else f"an {word}")
        text.word("the event of the ROUTE")
        if text.word('"TO"') != "TO":
            raise text.error(at, 'the ROUTE has no "TO".', "Write ROUTE a.b TO c.d.")
        text.word("the event behind TO")

    # --- nodes ----------------------------------------------------------------------------------

    def node(self, word: str, at: int) -> Step[Node]:
        """Parse a node, or a USE, whose first word was read."""
        text = self.text
        if word == "USE":
            return self._use(text.word("the name behind USE"), at)
        name = ""
        if word == "DEF":
            name = text.word("the name behind DEF")
            text.peek()
            at = text.at
            word = text.word("a node")
        language = self.language
        if not (language.is_open or word in language.fields or word in language.others):
            raise self._unknown(word, at)
        opened = text.need(b"{", f"behind {word}")
        node = Node(word, at)
        script = word == "Script"
        self.scripts += script
        if name:
            self.open[name] = self.open.get(name, 0) + 1
        while not text.take(b"}"):
            if text.peek() < 0:
                raise self._unclosed_error(opened)
            yield self.member(node)
        self.scripts -= script
        if name:
            self.open[name] -= 1
            self.names[name] = node
        return node

    def member(self, node: Node) -> Step[None]:
        """Parse a field of a node, or another statement within it."""
        text = self.text
        at = text.at
        word = text.word("a field")
        if node.kind in ("Script", "ComposedShader") and word in self.language.interface:
            yield self._script_field(word)
            return
        if word in self.language.statements:
            self._statement(word, at)
            return
        value = yield self.value()
        types = self.language.fields.get(node.kind)
        if types is None:
            return
        if word in types:
            check(self.text, value, types[word], word)
            node.fields[word] = value
        elif not self.language.is_open or nearly(word, types):
            raise text.error(
                at, f'{node.kind} has no field "{word}".', did_you_mean(word, types, "Remove it.")
            )

    def _script_field(self, what: str) -> Step[None]:
        """Skip a field or an event of a Script, whose first word was read."""
        text = self.text
        text.word("a type")
        text.word("a name")
        if what in _WITH_VALUE:
            yield self.value()

    def _use(self, name: str, at: int) -> Node:
        if self.open.get(name) and name not in self.names:
            if self.scripts:
                return Node("Script", at)
            raise self.text.error(
                at,
                f'USE of "{name}" within the node of that name.',
                "Give one of the two another name.",
            )
        if name not in self.names:
            raise self.text.error(
                at,
                f'no node before this USE is called "{name}".',
                did_you_mean(name, self.names, "Name one by DEF before it is used."),
            )
        return self.names[name]

    # --- values ---------------------------------------------------------------------------------

    def value(self) -> Step[FieldValue]:
        """Parse the value of a field."""
        text = self.text
        byte = text.peek()
        at = text.at
        if byte == b"["[0]:
            text.at += 1
            value: FieldValue = yield self._list(at)
            return value
        if byte in NUMERIC:
            return FieldValue("numbers", at, text.run())
        if byte == b'"'[0]:
            text.string()
            return FieldValue("strings", at)
        word = text.word("a value")
        if word in _FLAGS:
            return FieldValue("flag", at, flag=_FLAGS[word])
        if word == "NULL":
            return FieldValue("empty", at)
        self._no_infinity(word, at)
        return FieldValue("nodes", at, nodes=((yield self.node(word, at)),))

    def _list(self, opened: int) -> Step[FieldValue]:
        text = self.text
        byte = text.peek()
        if byte in NUMERIC:
            value = FieldValue("numbers", opened, text.run())
        elif byte == b'"'[0]:
            while text.peek() == b'"'[0]:
                text.string()
            value = FieldValue("strings", opened)
        else:
            nodes = []
            while (byte := text.peek()) >= 0 and byte != b"]"[0]:
                at = text.at
                word = text.word("a value")
                self._no_infinity(word, at)
                if word in _FLAGS or word == "NULL":
                    continue
                if word in self.language.statements:
                    self._statement(word, at)
                else:
                    nodes.append((yield self.node(word, at)))
            value = FieldValue("nodes" if nodes else "empty", opened, nodes=tuple(nodes))
        if text.peek() < 0:
            raise self._unclosed_error(opened)
        if not text.take(b"]"):
            if value.kind == "numbers":
                raise text.error(
                    text.at, f"{text.quote_next()} is no number.", "Write it as 12 or 1.5e-3."
                )
            raise text.missing_error('"]"')
        return value

    def _no_infinity(self, word: str, at: int) -> None:
        if word.lower() in ("nan", "inf", "infinity"):
            raise self.text.error(
                at, f'"{word}" is no number.', "Leave out what has no place, or write 0."
            )

    # --- what is wrong --------------------------------------------------------------------------

    def _unclosed_error(self, opened: int) -> Exception:
        byte = chr(self.text.data[opened])
        return self.text.error(
            opened,
            f'the "{byte}" here is never closed.',
            "The file may be cut off; write or fetch it again.",
        )

    def _unknown(self, word: str, at: int) -> Exception:
        self.text.at = at
        return self.text.error(
            at,
            f"VRML97 has no node {self.text.quote_next()}.",
            did_you_mean(
                word, [*self.language.fields, *self.language.others], "Write the file without it."
            ),
        )


def nearly(word: str, known: Iterable[str]) -> bool:
    """Tell whether a word is a misspelling of a known one, rather than of a newer version."""
    small = word.lower()
    return bool(get_close_matches(small[:80], [name.lower() for name in known], 1, _SPELLING))


def unread_prototype(text: PlacedText, at: int, what: str) -> ReadError:
    """Return the error about a prototype, as none is read."""
    return text.error(
        at,
        f"{what} stands here, and prototypes are not read.",
        "Export the file with its prototypes expanded.",
    )


def did_you_mean(word: str, known: Iterable[str], otherwise: str = "Correct it.") -> str:
    """Return the hint for a misspelt word."""
    names = sorted(known)
    near = get_close_matches(word[:80], names, 1) if len(names) <= _MANY else []
    return f'Did you mean "{near[0]}"?' if near else otherwise
