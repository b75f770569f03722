"""Reader of X3D as XML (ISO/IEC 19776-1), with the nodes of the other encodings as result.

Expat reads it, without access to net or disk, and no tree of XML is built. Entities and other
content that could grow are refused.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from xml.parsers import expat

from terratool.errors import ReadError
from terratool.importing.vrml.nodes import X3D
from terratool.importing.vrml.parse import (
    UNREAD,
    FieldValue,
    Node,
    Unit,
    VrmlScene,
    check,
    did_you_mean,
    nearly,
)
from terratool.importing.vrml.text import PlacedText, VrmlText
from terratool.io.expat import EntityError, hardened_parser

_FIELD_OF = {
    "Appearance": "appearance",
    "Color": "color",
    "ColorRGBA": "color",
    "Coordinate": "coord",
    "CoordinateDouble": "coord",
    "Normal": "normal",
    "TextureCoordinate": "texCoord",
}
"""Field of the parent that a node belongs to, if the node does not name it and is no child."""

_FLAGS = {"true": True, "false": False}
_FRAMES = ("X3D", "head", "Scene")
"""Elements that enclose nodes."""

_STATEMENTS = ("ExternProtoDeclare", "EXPORT", "IMPORT", "IS", "ProtoDeclare", "ROUTE")
"""Elements that are no nodes, besides those in small letters."""


@dataclass(slots=True)
class _Open:
    """An XML element that is not yet read to its end.

    Attributes:
        node: node of the element; None for an element that is none.
        name: name that DEF gives the node.
        where: field of the parent that the node belongs to.
        nodes: nodes in it, by field.
    """

    node: Node | None
    name: str = ""
    where: str = ""
    nodes: dict[str, list[Node]] = field(default_factory=dict)


def parse_xml(text: PlacedText) -> VrmlScene:
    """Read an X3D scene.

    Raises:
        ReadError: the text is no X3D, or refers to other files; the message says where.
    """
    return _Reader(text).scene()


class _Reader:
    """State of reading an XML text.

    Attributes:
        open: open elements from the root on.
        skipped: number of the innermost open elements that are skipped with their content.
        names: nodes by the names that DEF gives them.
        unfinished: number of open nodes by name.
        top: nodes outside of all others.
        unknown: number of nodes by kind, of those whose kind is not known.
        units: units that the text states.
    """

    def __init__(self, text: PlacedText) -> None:
        self.text = text
        self.parser = hardened_parser()
        self.parser.StartElementHandler = self.begin
        self.parser.EndElementHandler = self.end
        self.open: list[_Open] = []
        self.skipped = 0
        self.names: dict[str, Node] = {}
        self.unfinished: dict[str, int] = {}
        self.top: list[Node] = []
        self.unknown: Counter[str] = Counter()
        self.units: list[Unit] = []

    def scene(self) -> VrmlScene:
        """Return the contents of the whole text."""
        try:
            self.parser.Parse(self.text.data, True)
        except expat.ExpatError as error:
            place = f"{self.text.name}:{error.lineno}:{error.offset + 1}"
            raise ReadError(
                f"{place}: this is no well-formed XML ({expat.ErrorString(error.code)}).",
                "The file may be cut off; write or fetch it again.",
            ) from error
        except EntityError as error:
            raise self.text.error(
                self.parser.CurrentByteIndex, f"{error}.", "Export it without them."
            ) from error
        return VrmlScene(X3D, tuple(self.top), self.unknown, tuple(self.units))

    # --- elements -------------------------------------------------------------------------------

    def begin(self, tag: str, words: dict[str, str]) -> None:
        """Handle the begin of an element."""
        at = self.parser.CurrentByteIndex
        if not self.open and tag != "X3D":
            raise self.text.error(
                at,
                f'the file begins with "{tag}", so it is no X3D.',
                "Choose another file.",
            )
        inside = bool(self.open) and self.open[-1].node is not None
        if self.skipped:
            self.skipped += 1
        elif tag in _FRAMES and not inside:
            self.open.append(_Open(None))
        elif tag[:1].islower() or tag in _STATEMENTS:
            self._statement(tag, words, at)
            self.skipped = 1
        elif "USE" in words:
            self._use(tag, words, at)
        else:
            self.open.append(self._node(tag, words, at))

    def end(self, _tag: str) -> None:
        """Handle the end of an element."""
        if self.skipped:
            self.skipped -= 1
            return
        done = self.open.pop()
        node = done.node
        if node is None:
            return
        types = X3D.fields.get(node.kind, {})
        for name, nodes in done.nodes.items():
            value = FieldValue("nodes", node.at, nodes=tuple(nodes))
            if name in types:
                check(self.text, value, types[name], name)
                node.fields[name] = value
        if done.name:
            self.unfinished[done.name] -= 1
            self.names[done.name] = node
        self._place(node, done.where)

    def _place(self, node: Node, where: str) -> None:
        """Put a node into the open node, or among the nodes outside of all others."""
        outer = self.open[-1] if self.open else None
        if outer is None or outer.node is None:
            self.top.append(node)
        else:
            outer.nodes.setdefault(where, []).append(node)

    def _statement(self, tag: str, words: dict[str, str], at: int) -> None:
        if tag == "unit":
            written = words.get("conversionFactor", "")
            factor = self._value("conversionFactor", "SFDouble", written, at).numbers[0]
            name = words.get("name", "")
            self.units.append(Unit(words.get("category", ""), name, float(factor)))

    def _use(self, tag: str, words: dict[str, str], at: int) -> None:
        """Place a node again that has a name; the element's own content is skipped."""
        name = words["USE"]
        if name in self.names:
            self._place(self.names[name], self._field_of(tag, words))
        elif not self.unfinished.get(name):
            raise self.text.error(
                at,
                f'no node before this USE is called "{name}".',
                did_you_mean(name, self.names, "Name one by DEF before it is used."),
            )
        elif all(one.node is None or one.node.kind in X3D.fields for one in self.open):
            raise self.text.error(
                at,
                f'USE of "{name}" within the node of that name.',
                "Give one of the two another name.",
            )
        self.skipped = 1

    def _node(self, tag: str, words: dict[str, str], at: int) -> _Open:
        node = Node(tag, at)
        types = X3D.fields.get(tag, {})
        if not (types or tag in X3D.others or tag == UNREAD):
            self.unknown[tag] += 1
        for name, written in words.items():
            kind = types.get(name, "")
            if kind and kind[2:] not in ("Node", "String"):
                node.fields[name] = self._value(name, kind, written, at)
            elif types and not kind and nearly(name, types):
                raise self.text.error(
                    at,
                    f'{tag} has no field "{name}".',
                    did_you_mean(name, types),
                )
        name = words.get("DEF", "")
        if name:
            self.unfinished[name] = self.unfinished.get(name, 0) + 1
        return _Open(node, name, self._field_of(tag, words))

    def _field_of(self, tag: str, words: dict[str, str]) -> str:
        """Return the field of the open node that a node belongs to."""
        outer = self.open[-1].node
        if "containerField" in words:
            return words["containerField"]
        if outer is not None and outer.kind == "Shape" and tag != "Appearance":
            return "metadata" if tag.startswith("Metadata") else "geometry"
        if outer is not None and outer.kind == "CADFace":
            return "shape"
        return _FIELD_OF.get(tag, "children")

    # --- values ---------------------------------------------------------------------------------

    def _value(self, name: str, kind: str, written: str, at: int) -> FieldValue:
        """Return an attribute as the value of a field of type `kind`.

        Raises:
            ReadError: the attribute is of another type.
        """
        if kind == "SFBool":
            flag = _FLAGS.get(written.strip().lower())
            if flag is None:
                raise self.text.error(at, f'"{name}" is no SFBool.', "Write true or false.")
            return FieldValue("flag", at, flag=flag)
        words = VrmlText("", written.encode("utf-8", "replace"))
        try:
            numbers = words.run()
        except ReadError as error:
            said = error.message.partition(": ")[2]
            raise self.text.error(at, f'in "{name}" {said}', error.hint) from error
        if words.peek() >= 0 or "#" in written:
            raise self.text.error(
                at, f'in "{name}" {words.quote_next()} is no number.', "Write it as 12 or 1.5e-3."
            )
        value = FieldValue("numbers", at, numbers) if len(numbers) else FieldValue("empty", at)
        check(self.text, value, kind, name)
        return value
