"""A text of VRML97 (ISO/IEC 14772-1) becomes nodes, whose fields have values of their types.

So does X3D in the encoding that is like it (ISO/IEC 19776-2).
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

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
"""A step of reading, which yields the steps in it and is sent what they return."""

_WITH_VALUE = ("field", "exposedField", "initializeOnly", "inputOutput")
_FLAGS = {"TRUE": True, "FALSE": False}
_SPELLING = 0.85
_MANY = 10_000
"""Names among which a similar one is looked for."""


class FieldValue(NamedTuple):
    """What stands behind the name of a field.

    Attributes:
        kind: "empty" is what [] and NULL are, "field" a name behind IS.
        at: where it begins, in bytes.
    """

    kind: Literal["numbers", "strings", "flag", "nodes", "field", "empty"]
    at: int
    numbers: NDArray[np.float64] = np.empty(0)
    nodes: tuple[Node, ...] = ()
    flag: bool = False
    name: str = ""


@dataclass(slots=True, eq=False)
class Node:
    """A node as the text has it; DEF and USE make it one object in several places.

    Attributes:
        kind: its type, as Transform.
        at: where that stands, in bytes.
        proto: what declares the type, if VRML does not.
    """

    kind: str
    at: int
    proto: Proto | None = None
    fields: dict[str, FieldValue] = field(default_factory=dict)


@dataclass(slots=True, eq=False)
class Proto:
    """A PROTO or an EXTERNPROTO.

    Attributes:
        types: of its fields and events, by their names.
        defaults: values of those that have one.
        body: the first node of its body; None in an empty one.
        external: whether another file has the body.
    """

    name: str
    types: dict[str, str] = field(default_factory=dict)
    defaults: dict[str, FieldValue] = field(default_factory=dict)
    body: Node | None = None
    external: bool = False


def check(text: PlacedText, value: FieldValue, kind: str, name: str, proto: Proto | None) -> None:
    """Refuse the value of a field that is not of its type.

    Args:
        text: where it stands.
        value: what was read; a name behind IS counts as what it was declared.
        kind: the type, as MFVec3f.
        name: what the field is called.
        proto: in whose body it stands; None outside of all.

    Raises:
        ReadError: it is of another type, has too few or too many numbers, or broken integers.
    """
    plain, single = kind[2:], kind.startswith("S")
    if value.kind == "field":
        fits = proto is not None and proto.types[value.name] == kind
    elif plain == "Node":
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
    """A UNIT of X3D: what is measured in it, its name, and how many metres or radians it has."""

    category: str
    name: str
    factor: float


class Scene(NamedTuple):
    """What a text holds.

    Attributes:
        language: which nodes there are.
        nodes: those that lie in no other one.
        units: those that it states.
    """

    language: Language
    nodes: tuple[Node, ...]
    units: tuple[Unit, ...] = ()


def parse(text: VrmlText, language: Language) -> Scene:
    """Read what follows the first line.

    Raises:
        ReadError: it is not of that language; the message says where.
    """
    parser = _Parser(text, language)
    if language.is_open:
        parser.head()
    nodes = _finish(parser.statements(-1))
    return Scene(language, nodes, tuple(parser.units))


def _finish(step: Step[T]) -> T:
    """What a step returns, after the steps in it, and those in them."""
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


class _Parser:
    """Where reading has come to.

    Attributes:
        protos: those that may be used here.
        declared: their names in order, and what each of them meant before.
        names: nodes that DEF gave a name, in the body of this PROTO.
        open: names of the nodes that are not yet read to their end.
        units: what the head of an X3D text says of them.
        proto: the innermost PROTO whose body is read.
        scripts: how many Scripts are open; they may point at nodes that they lie in.
    """

    def __init__(self, text: VrmlText, language: Language) -> None:
        self.text = text
        self.language = language
        self.units: list[Unit] = []
        self.protos: dict[str, Proto] = {}
        self.declared: list[tuple[str, Proto | None]] = []
        self.names: dict[str, Node] = {}
        self.open: dict[str, int] = {}
        self.proto: Proto | None = None
        self.scripts = 0

    # --- statements -----------------------------------------------------------------------------

    def head(self) -> None:
        """The statements with which an X3D text begins (ISO/IEC 19776-2, 4.3)."""
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
        """Nodes, PROTOs and ROUTEs up to the brace that closes them, or up to the end.

        Args:
            opened: where the brace stands that opened them; -1 for the whole file.
        """
        text = self.text
        nodes: list[Node] = []
        while True:
            byte = text.peek()
            if byte < 0:
                if opened >= 0:
                    raise self._unclosed(opened)
                return tuple(nodes)
            if opened >= 0 and text.take(b"}"):
                return tuple(nodes)
            at = text.at
            word = text.word("a node")
            if word in self.language.statements:
                yield self.declaration(word, at)
            else:
                nodes.append((yield self.node(word, at)))

    def declaration(self, word: str, at: int) -> Step[None]:
        """A PROTO, an EXTERNPROTO or a ROUTE, whose first word was read; in X3D an EXPORT, too."""
        text = self.text
        if word in ("IMPORT", "EXPORT"):
            text.word(f"the name behind {word}")
            text.peek()
            if text.data.startswith(b"AS", text.at):
                text.word("AS")
                text.word("the name behind AS")
            return
        if word == "ROUTE":
            text.word("the event of the ROUTE")
            if text.word('"TO"') != "TO":
                raise text.error(at, 'the ROUTE has no "TO".', "Write ROUTE a.b TO c.d.")
            text.word("the event behind TO")
            return
        proto = Proto(text.word(f"the name behind {word}"), external=word == "EXTERNPROTO")
        opened = text.need(b"[", f"behind the name of the {word}")
        while not text.take(b"]"):
            if text.peek() < 0:
                raise self._unclosed(opened)
            yield self.interface(proto, given=not proto.external)
        if proto.external:
            self._declare(proto.name, proto)
            yield self.value()
            return
        opened = text.need(b"{", "before the body of the PROTO")
        outer = self.names, self.open, self.proto, self.scripts
        self.names, self.open, self.proto, self.scripts = {}, {}, proto, 0
        mark = len(self.declared)
        self._declare(proto.name, _ITSELF)
        nodes = yield self.statements(opened)
        while len(self.declared) > mark:  # what a body declares is unknown outside
            name, before = self.declared.pop()
            if before is None:
                del self.protos[name]
            else:
                self.protos[name] = before
        self.names, self.open, self.proto, self.scripts = outer
        proto.body = nodes[0] if nodes else None
        self._declare(proto.name, proto)

    def _declare(self, name: str, proto: Proto) -> None:
        self.declared.append((name, self.protos.get(name)))
        self.protos[name] = proto

    def interface(self, proto: Proto, given: bool) -> Step[None]:
        """A field or an event of a PROTO or a Script; a field has a value if so `given`."""
        text = self.text
        text.peek()
        at = text.at
        what = text.word("a field or an event")
        known = self.language.interface
        if what not in known:
            raise text.error(
                at,
                f'"{what}" is neither {", ".join(known[:3])} nor {known[3]}.',
                "Correct the declaration.",
            )
        text.peek()
        at = text.at
        kind = text.word("a type")
        types = self.language.types
        if kind not in types:
            raise text.error(at, f'"{kind}" is no type of a field.', did_you_mean(kind, types))
        name = text.word("a name")
        proto.types[name] = kind
        if given and what in _WITH_VALUE:
            value = yield self.value()
            check(self.text, value, kind, name, self.proto)
            proto.defaults[name] = value

    # --- nodes ----------------------------------------------------------------------------------

    def node(self, word: str, at: int) -> Step[Node]:
        """A node, or a USE, whose first word was read."""
        text = self.text
        if word == "USE":
            return self._used(text.word("the name behind USE"), at)
        name = ""
        if word == "DEF":
            name = text.word("the name behind DEF")
            text.peek()
            at = text.at
            word = text.word("a node")
        proto = self.protos.get(word)
        if proto is _ITSELF:
            raise text.error(at, f'the PROTO "{word}" contains itself.', "Give it another body.")
        language = self.language
        if proto is None and not (
            language.is_open or word in language.fields or word in language.others
        ):
            raise self._unknown(word, at)
        opened = text.need(b"{", f"behind {word}")
        node = Node(word, at, proto)
        script = word == "Script" and proto is None
        self.scripts += script
        if name:
            self.open[name] = self.open.get(name, 0) + 1
        while not text.take(b"}"):
            if text.peek() < 0:
                raise self._unclosed(opened)
            yield self.member(node)
        self.scripts -= script
        if name:
            self.open[name] -= 1
            self.names[name] = node
        return node

    def member(self, node: Node) -> Step[None]:
        """A field of a node, or another statement within it."""
        text = self.text
        at = text.at
        word = text.word("a field")
        if (
            node.kind in ("Script", "ComposedShader")
            and node.proto is None
            and word in self.language.interface
        ):
            yield self._script_field(word)
            return
        if word in self.language.statements:
            yield self.declaration(word, at)
            return
        value = yield self.value()
        types = node.proto.types if node.proto else self.language.fields.get(node.kind)
        if types is None:
            return
        if word not in types:
            if node.proto is None and self.language.is_open and not nearly(word, types):
                return
            # events are of no concern, and nodes of VRML97 have others than those of their fields
            event = (
                node.proto is None or word.removeprefix("set_").removesuffix("_changed") in types
            )
            if value.kind != "field" or not event:
                raise text.error(
                    at,
                    f'{node.kind} has no field "{word}".',
                    did_you_mean(word, types, "Remove it."),
                )
        else:
            check(self.text, value, types[word], word, self.proto)
            node.fields[word] = value

    def _script_field(self, what: str) -> Step[None]:
        """A field or an event of a Script, whose first word was read; IS may give its value."""
        text = self.text
        text.word("a type")
        text.word("a name")
        text.peek()
        if what in _WITH_VALUE or text.data.startswith(b"IS", text.at):
            yield self.value()

    def _used(self, name: str, at: int) -> Node:
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
        """What stands behind the name of a field."""
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
        if word == "IS":
            return self._reference(at)
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
                    yield self.declaration(word, at)
                else:
                    nodes.append((yield self.node(word, at)))
            value = FieldValue("nodes" if nodes else "empty", opened, nodes=tuple(nodes))
        if text.peek() < 0:
            raise self._unclosed(opened)
        if not text.take(b"]"):
            if value.kind == "numbers":
                raise text.error(
                    text.at, f"{text.shown()} is no number.", "Write it as 12 or 1.5e-3."
                )
            raise text.unexpected('"]"')
        return value

    def _no_infinity(self, word: str, at: int) -> None:
        if word.lower() in ("nan", "inf", "infinity"):
            raise self.text.error(
                at, f'"{word}" is no number.', "Leave out what has no place, or write 0."
            )

    def _reference(self, at: int) -> FieldValue:
        text = self.text
        name = text.word("the name behind IS")
        if self.proto is None:
            raise text.error(at, "IS stands outside of a PROTO.", "Write a value in its place.")
        if name not in self.proto.types:
            raise text.error(
                at,
                f'the PROTO "{self.proto.name}" has no field "{name}".',
                did_you_mean(name, self.proto.types, "Declare it."),
            )
        return FieldValue("field", at, name=name)

    # --- what is wrong --------------------------------------------------------------------------

    def _unclosed(self, opened: int) -> Exception:
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
            f"VRML97 has no node {self.text.shown()}, and no PROTO before it declares one.",
            did_you_mean(
                word,
                [*self.language.fields, *self.language.others, *self.protos],
                "Write the file without it.",
            ),
        )


def nearly(word: str, known: Iterable[str]) -> bool:
    """Whether a word is one of these but for its spelling; others are of a newer version."""
    small = word.lower()
    return bool(get_close_matches(small[:80], [name.lower() for name in known], 1, _SPELLING))


_ITSELF = Proto("")
"""What the name of a PROTO stands for in its own body."""


def did_you_mean(word: str, known: Iterable[str], otherwise: str = "Correct it.") -> str:
    """The hint for a misspelt word."""
    names = sorted(known)
    near = get_close_matches(word[:80], names, 1) if len(names) <= _MANY else []
    return f'Did you mean "{near[0]}"?' if near else otherwise
