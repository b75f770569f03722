"""Definitions that are written in Python: the keys of the text as names in snake case."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from terratool.api.options import NamedOption, public, refuse_unknown, takes, takes_options
from terratool.api.sources import UNNAMED, checked_source, json_of
from terratool.api.terrain import UserTerrain
from terratool.api.values import fitted, shown, unpacked
from terratool.definition.findings import Finding
from terratool.definition.key import Key
from terratool.definition.keys import KEYS
from terratool.definition.layout import canonical
from terratool.definition.model import (
    STOREYS,
    Definition,
    Element,
    Primitive,
    Repeat,
    Roughness,
    Scatter,
    Surface,
    Track,
    names_of,
)
from terratool.definition.reader import CheckOptions, check
from terratool.errors import RequestError
from terratool.field.unseen import unseen_storeys
from terratool.report.wording import count_of
from terratool.text.source import Source, refuse_name, write_source

_INNER: dict[str, type] = {
    "roughness": Roughness, "repeat": Repeat, "scatter": Scatter, **STOREYS
}  # fmt: skip
"""Classes of the objects that stand in others, by their keys."""
_BUILT = ("$schema", "surfTypes", "elemTypes", "parts", "elemTree", "tracks", "children")
"""Keys that methods build, or that say nothing of a terrain."""
_TYPES = {
    "text": "str", "flag": "bool", "object": "Mapping[str, Any]", "members": "Mapping[str, Any]",
    "curve": "str | Sequence[Any]", "path": "Sequence[Sequence[float]]",
    "paths": "str | Sequence[str]",
    "depth": "float | Mapping[str, float]", "numbers": "Sequence[float]", "any": "Any",
    "list": "Sequence[Any]", "grid": "Sequence[Sequence[float | None]] | Mapping[str, Any]",
}  # fmt: skip
"""Types of values in Python, by the kind of their key."""
_NUMBERS = {"number": "float", "whole": "int"}


_FREE = "x_"
"""Beginning of the names of keys that the format leaves to users: x_why is x-why."""
_NOTES = {
    "x_ignore": NamedOption(
        "x_ignore", "str | Sequence[str] | None", None,
        "Codes of warnings that are not given here: x-ignore.", __name__,
    ),
    "x_why": NamedOption("x_why", "str | None", None, "Reason for that: x-why.", __name__),
}  # fmt: skip


def _annotation(key: Key) -> str:
    """Type of a key's value in Python; None leaves the key out."""
    one = _NUMBERS.get(key.kind)
    if one is None:
        return f"{_TYPES[key.kind]} | None"
    return " | ".join([one] * key.alone + [f"Sequence[{one}]"] * bool(key.length) + ["None"])


def key_options(kind: type) -> dict[str, NamedOption]:
    """Keys of a class of the model as options, by their names in Python."""
    keys = KEYS[kind]
    return {
        name: NamedOption(name, _annotation(keys[key]), None, keys[key].descr, __name__)
        for name, key in names_of(kind)
        if key not in _BUILT
    } | _NOTES


_CELL = NamedOption(
    "cell", "Sequence[int] | None", None,
    "Column and row of its cell in the parent's grid: cell_x and cell_y in one.", __name__,
)  # fmt: skip
ELEMENT = {"cell": _CELL, **key_options(Element)}
"""Keys of an element, and its cell in one word."""


def _without(options: Mapping[str, NamedOption], *names: str) -> dict[str, NamedOption]:
    """Options without those that a method has by itself."""
    return {name: one for name, one in options.items() if name not in names}


_takes_keys = partial(takes_options, free=_FREE)


def members_of(kind: type, what: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Members of an object of the text; what is None is left out.

    Args:
        kind: class of the model of the object.
        what: name of the object in messages.
        given: values by names in snake case; x_why is x-why.

    Raises:
        RequestError: a name is no key, or a value cannot be copied.
    """
    keys = dict(names_of(kind))
    refuse_unknown(what, (name for name in given if not name.startswith(_FREE)), keys)
    found = {}
    for name, value in given.items():
        if value is None:
            continue
        key = keys.get(name) or name.replace("_", "-")
        if key in _INNER and isinstance(value, Mapping):
            value = members_of(_INNER[key], f"{what}'s {key}", value)
        if key in KEYS[kind] and KEYS[kind][key].kind == "grid":
            value = _grid_rows(value)
        if isinstance(value, str | Path) and (key == "x-ignore" or _is_paths(kind, key)):
            value = [value]
        try:
            found[key] = copy.deepcopy(value)
        except TypeError as error:  # a generator
            raise RequestError(
                f"{what}'s {key} is {shown(value)}.", "Give texts, numbers, lists or dictionaries."
            ) from error
    return found


def _grid_rows(value: Any) -> Any:
    """Rows of a grid as the text has them, of lists or an array; NaN is void."""
    rows = unpacked(value)
    return [_grid_row(unpacked(row)) for row in rows] if isinstance(rows, list | tuple) else rows


def _grid_row(row: Any) -> Any:
    if not isinstance(row, list | tuple):
        return row  # refused by whoever reads the text
    items = map(unpacked, row)
    return [None if isinstance(one, float) and math.isnan(one) else one for one in items]


def _is_paths(kind: type, key: str) -> bool:
    """Whether the value of a key of a class of the model is a list of paths."""
    return key in KEYS[kind] and KEYS[kind][key].kind == "paths"


def _element(what: str, given: dict[str, Any]) -> dict[str, Any]:
    """Members of an element, whose cell may be given by one word.

    Raises:
        RequestError: a name is no key, or the cell is given twice or is no pair.
    """
    cell = given.pop("cell", None)
    if cell is not None:
        if given.get("cell_x") is not None or given.get("cell_y") is not None:
            raise RequestError("The cell is given twice.", "Leave out cell_x and cell_y.")
        try:
            given["cell_x"], given["cell_y"] = fitted("cell", cell, "tuple[int, int]", __name__)
        except RequestError as error:
            raise RequestError(error.message, "Give column and row, as in cell=(3, 2).") from None
    return members_of(Element, what, given)


@public("Element")
class ElementBuilder:
    """An element of a definition; `add` puts another one into its cell, `remove` takes it out."""

    def __init__(
        self, members: dict[str, Any], holder: dict[str, Any], key: str, around: Any = None
    ) -> None:
        """Wrap the members of an element, which stay those of the definition.

        Args:
            members: members of the element.
            holder: object of the text that has the element, or the list with it.
            key: key of the element, or of that list.
            around: element in whose cell it stands; None for a root.
        """
        self._members, self._holder, self._key = members, holder, key
        self._around: ElementBuilder | None = around
        self._is_out = False

    def __repr__(self) -> str:
        what = self._members.get("type") or self._members.get("part") or "nothing yet"
        return f"<Element of {what} with {len(self._members.get('children', ()))} inside>"

    @_takes_keys(_without(ELEMENT, "type"))
    def add(self, type: str | None = None, **keys: Any) -> ElementBuilder:  # noqa: A002
        """Add an element to the cell of this one, and return it.

        Its place is a cell of this one's grid, `cell` with `span`, or a free place, `at` with
        `extent`. `repeat` and `scatter` make copies of it.

        Args:
            type: name of a primitive; None for a `part`.
            **keys: keys of an element, in snake case.

        Raises:
            RequestError: a name is no key, the cell is given twice or is no pair, or the element
                has been taken out.
        """
        self._refuse_out("Add to another one.")
        members = _element("add", {"type": type, **keys})
        self._members.setdefault("children", []).append(members)
        return ElementBuilder(members, self._members, "children", self)

    @takes()
    def remove(self) -> None:
        """Take the element out of the definition, with all that stands in its cells.

        Raises:
            RequestError: the element has been taken out already.
        """
        self._refuse_out("Add it again.")
        self._is_out = True
        found = self._holder[self._key]
        if found is not self._members:
            found[:] = [one for one in found if one is not self._members]
        if found is self._members or not found:
            del self._holder[self._key]

    def _refuse_out(self, hint: str) -> None:
        """Refuse an element that was taken out, by itself or with one around it."""
        one = self
        while not one._is_out and one._around is not None:
            one = one._around
        # another element may be the root now
        if one._is_out or (one._around is None and one._holder.get(one._key) is not one._members):
            raise RequestError("The element has been taken out already.", hint)


_TERRAIN = key_options(Definition)


@public("Definition")
class DefinitionBuilder:
    """A definition that is written in Python, and says what a text says and nothing else.

    Arguments are the keys of the text in snake case: v_scale is vScale. What is None is left out.
    Numbers and arrays of NumPy are taken, too.
    """

    @_takes_keys(_without(_TERRAIN, "size"), called="Definition")
    def __init__(self, size: Any = None, **keys: Any) -> None:
        """Begin a definition of a terrain.

        Args:
            size: side length in units of the terrain, or one along x and one along y.
            **keys: keys of a terrain, in snake case.

        Raises:
            RequestError: a name is no key.
        """
        self._document = members_of(Definition, "Definition", {"size": size, **keys})

    def __repr__(self) -> str:
        size = self._document.get("size")
        return f"<Definition of size {size}, {count_of(self._count(), 'element')}>"

    def __str__(self) -> str:
        return self.text

    def _count(self) -> int:
        """Number of elements that the text has in its tree."""
        count, left = 0, [self._document["elemTree"]] if "elemTree" in self._document else []
        while left:
            count += 1
            left += left.pop().get("children", ())
        return count

    @property
    def document(self) -> dict[str, Any]:
        """Members of the definition as the text has them, a copy.

        Raises:
            RequestError: a value cannot be written as JSON.
        """
        found: dict[str, Any] = json.loads(json_of(self._written()))
        return found

    @property
    def text(self) -> str:
        """Text of the definition in the canonical layout, as `terratool format` has it.

        Raises:
            RequestError: a value cannot be written as JSON.
        """
        return canonical(json_of(self._written()))

    def _written(self) -> dict[str, Any]:
        """Members that are written: parts only where one is left."""
        return {key: one for key, one in self._document.items() if key != "parts" or one}

    # --- entries ----------------------------------------------------------------------------------

    @_takes_keys(key_options(Surface))
    def surface(self, name: str, **keys: Any) -> str:
        """Add a surface, and return its name.

        Args:
            name: name of the surface.
            **keys: keys of a surface, in snake case.

        Raises:
            RequestError: a name is no key, or there is such a surface already.
        """
        return self._enter("surfTypes", "surface", name, members_of(Surface, "surface", keys))

    @_takes_keys(key_options(Primitive))
    def primitive(self, name: str, **keys: Any) -> str:
        """Add a primitive, and return its name.

        Args:
            name: name of the primitive.
            **keys: keys of a primitive, in snake case.

        Raises:
            RequestError: a name is no key, or there is such a primitive already.
        """
        return self._enter("elemTypes", "primitive", name, members_of(Primitive, "primitive", keys))

    @_takes_keys(_without(ELEMENT, "type"))
    def part(self, name: str, type: str | None = None, **keys: Any) -> ElementBuilder:  # noqa: A002
        """Add a part, an element with all that is added to it, for elements to stand for.

        Args:
            name: name of the part.
            type: name of its root's primitive.
            **keys: keys of an element, in snake case.

        Raises:
            RequestError: a name is no key, or there is such a part already.
        """
        members = _element("part", {"type": type, **keys})
        self._enter("parts", "part", name, members)
        return ElementBuilder(members, self._document["parts"], name)

    @_takes_keys(key_options(Track))
    def track(self, **keys: Any) -> None:
        """Add the rut of a wheel.

        Args:
            **keys: keys of a track, in snake case.

        Raises:
            RequestError: a name is no key.
        """
        self._document.setdefault("tracks", []).append(members_of(Track, "track", keys))

    def _enter(self, dictionary: str, what: str, name: str, members: dict[str, Any]) -> str:
        """Put an entry into one of the dictionaries, and return its name."""
        entries = self._document.setdefault(dictionary, {})
        if name in entries:
            raise RequestError(f"There is a {what} {name!r} already.", "Choose another name.")
        entries[name] = members
        return name

    # --- elements ---------------------------------------------------------------------------------

    @_takes_keys(_without(ELEMENT, "type", "cell", "cell_x", "cell_y", "span", "at", "extent"))
    def root(self, type: str | None = None, **keys: Any) -> ElementBuilder:  # noqa: A002
        """Say what covers the whole terrain, and return it; `add` puts elements onto it.

        Args:
            type: name of a primitive.
            **keys: keys of an element, in snake case.

        Raises:
            RequestError: a name is no key.
        """
        root = self._root()
        root.update(_element("root", {"type": type, **keys}))
        return ElementBuilder(root, self._document, "elemTree")

    def _root(self) -> dict[str, Any]:
        """Members of the root, which begins empty."""
        found: dict[str, Any] = self._document.setdefault("elemTree", {})
        return found

    @_takes_keys(_without(ELEMENT, "type"))
    def add(self, type: str | None = None, **keys: Any) -> ElementBuilder:  # noqa: A002
        """Add an element to the root, and return it, so that others can be added to it.

        Its place is a cell of the root's grid, `cell` with `span`, or a free place, `at` with
        `extent`. `repeat` and `scatter` make copies of it.

        Args:
            type: name of a primitive; None for a `part`.
            **keys: keys of an element, in snake case.

        Raises:
            RequestError: a name is no key, or the cell is given twice or is no pair.
        """
        return ElementBuilder(self._root(), self._document, "elemTree").add(type, **keys)

    # --- results ----------------------------------------------------------------------------------

    def validate(self) -> tuple[Finding, ...]:
        """Findings of the reader on the text, errors and warnings; empty if it is clean.

        Libraries are looked for from the current folder on.

        Raises:
            RequestError: a value cannot be written as JSON.
        """
        return check(self._source(UNNAMED), CheckOptions(look=unseen_storeys)).findings

    @takes()
    def compile(self, *, roughness: bool = True) -> UserTerrain:
        """Compile the terrain.

        Args:
            roughness: whether rough surfaces have their relief.

        Raises:
            RequestError: a value cannot be written as JSON.
            DefinitionError: the definition has errors; `findings` has them all.
        """
        return UserTerrain(checked_source(self._source(UNNAMED)), roughness=roughness)

    @takes()
    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write the text into a file in the canonical layout, and return its path.

        Paths of libraries count from the folder of the file.

        Args:
            path: file to write, a .json, or a .json.gz, which is compressed.
            overwrite: whether the file may exist.

        Raises:
            RequestError: a value cannot be written as JSON, or the name is that of no definition.
            DefinitionError: the definition has errors; nothing is written.
            WriteError: the file exists, or cannot be written.
        """
        name = str(path)
        refuse_name(name)
        source = self._source(name)
        checked_source(source)
        write_source(Source("", source.data, name.endswith(".gz")), path, overwrite)
        return Path(path)

    def _source(self, name: str) -> Source:
        """Text by the name of its file."""
        return Source(name, self.text.encode("utf-8", "surrogatepass"), seen=False)
