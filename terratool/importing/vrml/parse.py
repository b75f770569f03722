"""Parser of texts of VRML97 (ISO/IEC 14772-1), classic X3D (ISO/IEC 19776-2) and VRML 1.0.

It turns a text into nodes whose fields have values of their types, and prototypes into what they
stand for.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from terratool.importing.vrml.nodes import WIDTHS, X3D, Language
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

EXPANDED, _PER_BYTE = 1_000_000, 10
"""Bytes that instances of prototypes may be written out to, and further ones for each byte of the
text; a megabyte takes a second."""

_INSTANCE = 200
"""Bytes that an instance counts for, besides its prototype's own."""

_WITH_VALUE = ("field", "exposedField", "initializeOnly", "inputOutput")
_DECLARING = (*_WITH_VALUE, "eventIn", "eventOut", "inputOnly", "outputOnly")
"""Words before a field or an event that a node or a prototype declares."""

_FLAGS = {"TRUE": True, "FALSE": False}
_SPELLING = 0.85
_bracket = re.compile(rb'#[^\r\n]*+|"(?:[^"\\]++|\\.)*+"|[\[\]{}]', re.DOTALL).finditer
_number = re.compile(
    r"[-+]?(?:0[xX][0-9a-fA-F]+|(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"
).fullmatch
_plain_word = re.compile(rb"[A-Za-z_]+").findall
_MANY = 10_000
"""Most names among which a similar one is looked for."""


UNREAD = "ProtoInstance"
"""Kind of a node that is an instance of a prototype which is not read."""


class FieldValue(NamedTuple):
    """Value of a field.

    Attributes:
        kind: kind of value; "empty" for [] and NULL.
        at: offset of the value in bytes.
        numbers: (n,) float64, the value of kind "numbers".
        nodes: the value of kind "nodes".
        flag: the value of kind "flag".
        words: the value of kind "words", of VRML 1.0 alone.
    """

    kind: Literal["numbers", "strings", "flag", "nodes", "words", "empty"]
    at: int
    numbers: NDArray[np.float64] = np.empty(0)
    nodes: tuple[Node, ...] = ()
    flag: bool = False
    words: tuple[str, ...] = ()


@dataclass(slots=True, eq=False)
class Node:
    """A node of a text; DEF and USE place one node in several parents.

    Attributes:
        kind: type of the node, such as Transform.
        at: offset of the type's name in bytes.
        fields: values by the names of fields.
        children: nodes in it that belong to no field, as in VRML 1.0.
    """

    kind: str
    at: int
    fields: dict[str, FieldValue] = field(default_factory=dict)
    children: list[Node] = field(default_factory=list)


class _Prototype(NamedTuple):
    """A PROTO or an EXTERNPROTO.

    Attributes:
        scope: scope in which it is declared.
        number: number of prototypes that the scope had before.
        defaults: values of its fields.
        body: offset of the brace that opens its body; -1 for one in another file.
        end: offset behind its body.
    """

    scope: _Scope
    number: int
    defaults: dict[str, FieldValue]
    body: int
    end: int


@dataclass(slots=True, eq=False)
class _Scope:
    """Names that a text, or the body of an instance, gives.

    Attributes:
        made: prototype of the instance; None for the text.
        values: values of the instance's fields.
        names: nodes by the names that DEF gives them.
        open: number of unfinished nodes by name.
        prototypes: prototypes by name.
    """

    made: _Prototype | None = None
    values: dict[str, FieldValue] = field(default_factory=dict)
    names: dict[str, Node] = field(default_factory=dict)
    open: dict[str, int] = field(default_factory=dict)
    prototypes: dict[str, _Prototype] = field(default_factory=dict)

    def prototype(self, name: str) -> _Prototype | None:
        """Return the prototype of a name that is declared here, or before the scope's own one."""
        found = self.prototypes.get(name)
        made = self.made
        while found is None and made is not None:
            outer = made.scope.prototypes.get(name)
            found = outer if outer is not None and outer.number < made.number else None
            made = made.scope.made
        return found


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
        unknown: number of nodes by kind, of those whose kind is not known.
        units: units that the text states.
    """

    language: Language
    nodes: tuple[Node, ...]
    unknown: Counter[str]
    units: tuple[Unit, ...] = ()


def parse(text: VrmlText, language: Language) -> VrmlScene:
    """Parse a text behind its first line.

    Raises:
        ReadError: the text is not of that language; the message says where.
    """
    parser = _VrmlParser(text, language)
    if language is X3D:
        parser.head()
    nodes = _finish(parser.statements(-1))
    return VrmlScene(language, nodes, parser.unknown, tuple(parser.units))


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
        unknown: number of nodes by kind, of those whose kind is not known.
        scope: names given so far.
        left: bytes to which instances of prototypes may still be written out.
        others: number of open nodes without a surface, such as Scripts, whose fields may refer to
            nodes around them.
    """

    def __init__(self, text: VrmlText, language: Language) -> None:
        self.text = text
        self.language = language
        self.units: list[Unit] = []
        self.unknown: Counter[str] = Counter()
        self.scope = _Scope()
        self.left = EXPANDED + _PER_BYTE * len(text.data)
        self.others = 0

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
                yield self._statement(word, at)
            else:
                nodes.append((yield self.node(word, at)))

    def _statement(self, word: str, at: int) -> Step[None]:
        """Read a prototype, or skip a ROUTE, or an IMPORT or EXPORT of X3D, without its first word.

        Raises:
            ReadError: the statement is broken.
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
            yield self._declare(word)
            return
        text.word("the event of the ROUTE")
        if text.word('"TO"') != "TO":
            raise text.error(at, 'the ROUTE has no "TO".', "Write ROUTE a.b TO c.d.")
        text.word("the event behind TO")

    # --- prototypes -----------------------------------------------------------------------------

    def _declare(self, what: str) -> Step[None]:
        """Read a PROTO or an EXTERNPROTO, whose first word was read, without its body."""
        text, scope = self.text, self.scope
        name = text.word(f"the name behind {what}")
        opened = text.need(b"[", f"behind {what} {name}")
        defaults: dict[str, FieldValue] = {}
        if what == "EXTERNPROTO":
            text.at = self._end_of(opened)
            yield self.value()
            body = end = -1
        else:
            while not text.take(b"]"):
                if text.peek() < 0:
                    raise self._unclosed_error(opened)
                access = text.word("a field of the PROTO")
                text.word("a type")
                own = text.word("a name")
                if access in _WITH_VALUE:
                    value = yield self.value()
                    if value is not None:
                        defaults[own] = value
            body = text.need(b"{", f"behind the fields of {name}")
            text.at = end = self._end_of(body)
        scope.prototypes[name] = _Prototype(scope, len(scope.prototypes), defaults, body, end)

    def _end_of(self, opened: int) -> int:
        """Return the offset behind the bracket that closes the one at an offset."""
        depth = 0
        for match in _bracket(self.text.data, opened):
            byte = match.group()
            depth += (byte in (b"[", b"{")) - (byte in (b"]", b"}"))
            if not depth:
                return match.end()
        raise self._unclosed_error(opened)

    def _instance(self, made: _Prototype, at: int, opened: int) -> Step[Node]:
        """Parse an instance behind its brace: its fields, and the body with these."""
        text = self.text
        values = dict(made.defaults)
        while not text.take(b"}"):
            if text.peek() < 0:
                raise self._unclosed_error(opened)
            begin = text.at
            word = text.word("a field")
            if word in self.language.statements:
                yield self._statement(word, begin)
                continue
            value = yield self.value()
            if value is not None:
                values[word] = value
        if made.body < 0:
            return Node(UNREAD, at)
        self.left -= made.end - made.body + _INSTANCE
        if self.left < 0:
            raise text.error(
                at,
                "with this instance prototypes are written out to more than can be read.",
                "Write a file with fewer of them.",
            )
        end, outer = text.at, self.scope
        text.at, self.scope = made.body + 1, _Scope(made, values)
        nodes: tuple[Node, ...] = yield self.statements(made.body)
        text.at, self.scope = end, outer
        return nodes[0] if nodes else Node("Group", at)

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
        scope = self.scope
        made = scope.prototype(word)
        is_other = word not in self.language.fields
        if is_other and made is None and word not in self.language.others:
            if text.peek() != b"{"[0] or self._is_misspelt(word):
                raise self._unknown(word, at)
            self.unknown[word] += 1
        opened = text.need(b"{", f"behind {word}")
        if name:
            scope.open[name] = scope.open.get(name, 0) + 1
        self.others += is_other
        if made is not None:
            node: Node = yield self._instance(made, at, opened)
        else:
            node = Node(word, at)
            while not text.take(b"}"):
                if text.peek() < 0:
                    raise self._unclosed_error(opened)
                yield self.member(node)
        self.others -= is_other
        if name:
            scope.open[name] -= 1
            scope.names[name] = node
        return node

    def member(self, node: Node) -> Step[None]:
        """Parse a field of a node, or another statement within it."""
        text, language = self.text, self.language
        at = text.at
        word = text.word("a field")
        if word in language.statements:
            yield self._statement(word, at)
            return
        if language.is_nested:
            if word in ("DEF", "USE") or text.peek() == b"{"[0]:
                node.children.append((yield self.node(word, at)))
                return
            if word == "fields" and text.peek() == b"["[0]:
                text.at = self._end_of(text.at)
                return
        types = language.fields.get(node.kind)
        if types is None and word in _DECLARING:
            yield self._declared_field(word)
            return
        value = yield self.value()
        if value is None:
            return
        if language.is_nested and value.kind == "words":
            node.fields[word] = value
        if types is None:
            return
        if word in types:
            check(self.text, value, types[word], word)
            node.fields[word] = value
        elif nearly(word, types) and not language.is_nested:
            raise text.error(
                at, f'{node.kind} has no field "{word}".', did_you_mean(word, types, "Remove it.")
            )

    def _declared_field(self, what: str) -> Step[None]:
        """Skip a field or an event that a node declares, whose first word was read."""
        text = self.text
        text.word("a type")
        text.word("a name")
        if what in _WITH_VALUE:
            yield self.value()
            return
        text.peek()
        at = text.at
        if at < len(text.data) and text.data.startswith(b"IS", at) and text.word("IS") == "IS":
            text.word("the name behind IS")
        else:
            text.at = at

    def _use(self, name: str, at: int) -> Node:
        scope = self.scope
        if scope.open.get(name) and name not in scope.names:
            if self.others:
                return Node("Script", at)
            raise self.text.error(
                at,
                f'USE of "{name}" within the node of that name.',
                "Give one of the two another name.",
            )
        if name not in scope.names:
            raise self.text.error(
                at,
                f'no node before this USE is called "{name}".',
                did_you_mean(name, scope.names, "Name one by DEF before it is used."),
            )
        return scope.names[name]

    # --- values ---------------------------------------------------------------------------------

    def value(self) -> Step[FieldValue | None]:
        """Parse the value of a field; None for one that the prototype around it leaves open."""
        text = self.text
        byte = text.peek()
        at = text.at
        if byte == b"["[0]:
            text.at += 1
            value: FieldValue = yield self._list(at)
            return value
        if byte in NUMERIC and not (self.language.is_nested and self._is_text()):
            return FieldValue("numbers", at, text.run())
        if byte == b'"'[0]:
            text.string()
            return FieldValue("strings", at)
        word = text.word("a value")
        if word in _FLAGS:
            return FieldValue("flag", at, flag=_FLAGS[word])
        if word == "NULL":
            return FieldValue("empty", at)
        if word == "IS" and self.scope.made is not None:
            return self.scope.values.get(text.word("the name behind IS"))
        self._no_infinity(word, at)
        if self.language.is_nested and word not in ("DEF", "USE"):
            if word.startswith("("):
                end = text.data.find(b")", at)
                text.at = end + 1 if end >= 0 else len(text.data)
                words = _plain_word(text.data[at : text.at])
                return FieldValue("words", at, words=tuple(each.decode() for each in words))
            if text.peek() != b"{"[0]:
                return FieldValue("words", at, words=(word,))
        return FieldValue("nodes", at, nodes=((yield self.node(word, at)),))

    def _is_text(self) -> bool:
        """Tell whether a word that begins as a number is a text, which has no quotation marks."""
        text = self.text
        at, word = text.at, text.word("a value")
        text.at = at
        return _number(word) is None

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
                    yield self._statement(word, at)
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

    def _is_misspelt(self, word: str) -> bool:
        """Tell whether a node of VRML97, all of whose nodes are known, is one with a slip."""
        alike = [name for name in self.language.fields if abs(len(name) - len(word)) <= 1]
        return not self.language.is_open and nearly(word, alike)

    def _unknown(self, word: str, at: int) -> Exception:
        self.text.at = at
        return self.text.error(
            at,
            f"{self.language.name} has no node {self.text.quote_next()}.",
            did_you_mean(
                word, [*self.language.fields, *self.language.others], "Write the file without it."
            ),
        )


def nearly(word: str, known: Iterable[str]) -> bool:
    """Tell whether a word is a misspelling of a known one, rather than of a newer version."""
    small = word.lower()
    return bool(get_close_matches(small[:80], [name.lower() for name in known], 1, _SPELLING))


def did_you_mean(word: str, known: Iterable[str], otherwise: str = "Correct it.") -> str:
    """Return the hint for a misspelt word."""
    names = sorted(known)
    near = get_close_matches(word[:80], names, 1) if len(names) <= _MANY else []
    return f'Did you mean "{near[0]}"?' if near else otherwise
