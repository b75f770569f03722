"""Decoding of plain JSON values into typed models, with a remark for each value that misfits."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import chain
from typing import Any, TypeVar

import msgspec
from msgspec import UNSET, Struct, UnsetType, field

from terratool.definition.curriculum import TILE_KEYS, CurriculumText, PatchText, TileText
from terratool.definition.findings import Owner, Remark, RemarkLog
from terratool.definition.key import FORMULA, Key, Shape
from terratool.definition.keys import (
    ALTERNATIVES,
    BIGGEST,
    JSON_TYPES,
    KEYS,
    MEMBERS,
    NESTED,
    NEVER,
    REQUIRED,
    SLOTS,
    UNNEEDED,
    Kind,
    Nested,
    QuickCheck,
    fits_double,
)
from terratool.definition.model import (
    LARGEST,
    POINT_LENGTHS,
    Bore,
    Deck,
    Definition,
    Element,
    GridFile,
    Library,
    Primitive,
    Repeat,
    Roughness,
    Scatter,
    Surface,
    SurfaceGrid,
    Track,
)
from terratool.definition.sensor import CameraText, LidarText, NoiseText, SensorText, SonarText
from terratool.definition.tree import PARTS, ROOT, Tree, part_pointer
from terratool.definition.vehicle import (
    AxleText,
    BatteryText,
    ClassesText,
    CogText,
    FeetText,
    MarginsText,
    OverhangText,
    TracksText,
    VehicleText,
    WheelsText,
)
from terratool.report.wording import count_of
from terratool.text.display import escape, only_answer, quote, unescape

_Model = TypeVar("_Model", bound=Struct)
_NUMBER = KEYS[Element]["vScale"]
_DEPTH = Key("a depth from 0 to 1e30", "number", 0, LARGEST)
_UNKNOWN = Element()
_LONG = 60  # characters of a key that may be a typo
_SUBJECTS: dict[type, str] = {
    Definition: "a terrain", Library: "a library", Repeat: "a repeat", Scatter: "a scatter",
    Surface: "a surface", Roughness: "a roughness", Primitive: "a primitive",
    GridFile: "a grid file", SurfaceGrid: "a surface grid", Element: "an element", Track: "a track",
    Deck: "a deck", Bore: "a bore",
    VehicleText: "a vehicle", WheelsText: "the wheels", AxleText: "an axle",
    TracksText: "the tracks", FeetText: "the feet",
    CogText: "the centre of gravity", OverhangText: "the overhang",
    BatteryText: "the battery", MarginsText: "the margins", ClassesText: "the classes",
    SensorText: "a sensor", NoiseText: "the noise", LidarText: "the lidar",
    CameraText: "the camera", SonarText: "the sonar",
    CurriculumText: "a spec of training tiles", PatchText: "a level place",
}  # fmt: skip
_ROOTS: dict[Kind, tuple[str, str]] = {
    "terrain": ("the definition", '{ "size": …, "elemTypes": {…}, "elemTree": {…} }'),
    "library": ("the library", '{ "surfTypes": {…}, "elemTypes": {…}, "parts": {…} }'),
    "vehicle": ("the vehicle", '{ "mass": …, "wheels": {…}, "wheelbase": …, … }'),
    "sensor": ("the sensor", '{ "range": [least, most], "lidar": {…} }'),
    "curriculum": ("the spec", '{ "rows": …, "columns": …, "kinds": {…} }'),
}
JSON_NAMES = {
    dict: "an object", list: "a list", str: "a text", bool: "true or false",
    int: "a number", float: "a number", type(None): "null",
}  # fmt: skip


def type_in_words(item: Any) -> str:
    """Description of a JSON value by its type, in words."""
    if isinstance(item, str):
        return f"the text {quote(item)}"
    if isinstance(item, bool):
        return "true" if item else "false"
    if isinstance(item, int | float):
        return f"the number {quote(item)}"
    if isinstance(item, list):
        return f"a list of {count_of(len(item), 'item')}" if item else "an empty list"
    return JSON_NAMES[type(item)]


@lru_cache(maxsize=256)
def unknown_key(kind: Shape, key: str, present: frozenset[str]) -> tuple[str, str, str]:
    """Message, hint and fix for a key that a kind of object does not have.

    Args:
        kind: kind of object.
        key: key that the object has and its kind does not.
        present: all keys of the object.
    """
    from difflib import get_close_matches

    known = list(SLOTS[kind])
    close = [name for name in known if name.lower() == key.lower()]
    if not close and len(key) <= _LONG:
        close = get_close_matches(key, known, 2, 0.6)
    hint = f'Did you mean "{close[0]}"?' if close else f"It has {', '.join(known)}."
    fix = "" if close and close[0] in present else only_answer(key, close)
    if kind in (Element, Track) and key in SLOTS[Surface]:
        close, fix = [], ""
        example = '{"void": true}' if key == "void" else f'{{"{key}": …}}'
        name = "hole" if key == "void" else "new"
        hint = (
            f'It is a key of surfaces: write "{name}": {example} in "surfTypes", and '
            f'"surface": "{name}" here.'
        )
    if close and close[0] in present:
        hint = f'Remove it if it means the same as "{close[0]}", which is there already.'
    hint += " A key of your own begins with x-."
    owner = f"{quote(kind)} tiles" if isinstance(kind, str) else _SUBJECTS[kind]
    return f"{quote(key)} is no key of {owner}.", hint, fix


class Decoded(Struct):
    """Model of a text, as far as its values fit.

    Attributes:
        definition: terrain, with or without its elements; None where the text is none.
        library: library; None where the text is none.
        vehicle: vehicle; None where the text is none.
        sensor: sensor; None where the text is none.
        curriculum: spec of training tiles; None where the text is none.
        tree: elements of the terrain and of its parts, or of the library's.
        unfit: by key, the owners whose value was left out; "" stands for the owner itself.
        ignores: owner and value of each `x-ignore`.
    """

    definition: Definition | None = None
    library: Library | None = None
    vehicle: VehicleText | None = None
    sensor: SensorText | None = None
    curriculum: CurriculumText | None = None
    tree: Tree = field(default_factory=lambda: Tree([], [], [0]))
    unfit: dict[str, set[Owner]] = field(default_factory=dict)
    ignores: list[tuple[Owner, Any]] = field(default_factory=list)


def decode(value: Any, kind: Kind, found: RemarkLog) -> Decoded:
    """Build the model of a parsed JSON value, without recursion over the elements.

    Args:
        value: value of the whole text.
        kind: kind that the text is read as.
        found: log that takes the remarks on values that misfit.
    """
    decoder = _Decoder(found)
    if not isinstance(value, dict):
        name, example = _ROOTS[kind]
        message = f"{name} is {JSON_NAMES[type(value)]} where an object is expected."
        decoder.add("TT105", "", message, f"Write {example}.")
    elif kind == "vehicle":
        decoder.decoded.vehicle = decoder.model(VehicleText, value, "", "the vehicle")
    elif kind == "sensor":
        decoder.decoded.sensor = decoder.model(SensorText, value, "", "the sensor")
    elif kind == "curriculum":
        decoder.decoded.curriculum = decoder.model(CurriculumText, value, "", "the spec")
    elif kind == "library":
        decoder.decoded.library = decoder.model(Library, value, "", "the library")
    else:
        decoder.decoded.definition = decoder.model(Definition, value, "", "the terrain")
    return decoder.decoded


class _Decoder:
    """Builder of models from JSON values.

    Remarks on values that misfit go to `found`; `decoded` notes these values as left out.
    """

    def __init__(self, found: RemarkLog) -> None:
        self._found = found
        self.decoded = Decoded()
        self._failed = False

    def model(self, kind: type[_Model], value: dict[str, Any], pointer: str, name: str) -> _Model:
        """Build the model of an object and of all objects in it."""
        fields = self._fields(kind, value, pointer)
        roots: dict[str, Any] = {}
        for key, nested in NESTED.get(kind, {}).items():
            attribute = SLOTS[kind][key].name
            if attribute in fields:
                inner, here = fields.pop(attribute), f"{pointer}/{key}"
                if nested.form == "tree" and key == "parts":
                    fields[attribute] = dict.fromkeys(inner, _UNKNOWN)  # `_tree` reads them
                    roots |= {part_pointer(name): part for name, part in inner.items()}
                elif nested.form == "tree":
                    roots = {ROOT: inner} | roots
                elif nested.form == "dictionary":
                    if len(inner) < nested.least:
                        hint = f"Write {KEYS[kind][key].words}."
                        self.add("TT105", here, f'"{key}" is empty.', hint)
                        self._leave_out(pointer, key)
                    fields[attribute] = {
                        entry: self._item(nested, item, f"{here}/{escape(entry)}", quote(entry))
                        for entry, item in inner.items()
                    }
                elif nested.form == "list":
                    if not nested.least <= len(inner) <= nested.most:
                        words = KEYS[kind][key].words
                        self._wrong_type(pointer, f"/{key}", f'"{key}"', words, inner)
                        self._leave_out(pointer, key)
                    fields[attribute] = tuple(
                        self._item(nested, item, f"{here}/{index}", index)
                        for index, item in enumerate(inner)
                    )
                else:
                    fields[attribute] = self.model(nested.kind, inner, here, f'"{key}"')
        if roots:
            self.decoded.tree = self._tree(roots)
        for key in REQUIRED.get(kind, ()):
            if key not in value:
                hint = f'Add "{key}", {KEYS[kind][key].words}.'
                self.add("TT104", pointer, f'{name} has no "{key}".', hint)
        for keys, hint in ALTERNATIVES.get(kind, {}).items():
            if not any(key in value for key in (*keys, *UNNEEDED.get(keys, ()))):
                message = f"{name} has neither {' nor '.join(map(quote, keys))}."
                self.add("TT104", pointer, message, hint)
        return kind(**fields)

    def _item(self, nested: Nested, item: Any, pointer: str, name: str | int) -> Struct:
        """Model of an item of a list or a dictionary; an empty model if the item is no object."""
        if isinstance(item, dict) and nested.chosen:
            return self._tile(item, pointer)
        if isinstance(item, dict):
            name = f"the {_SUBJECTS[nested.kind].partition(' ')[2]}"
            return self.model(nested.kind, item, pointer, name)
        self._wrong_type(pointer, "", nested.item.format(name), nested.words, item)
        return nested.kind()

    def _tile(self, members: dict[str, Any], pointer: str) -> TileText:
        """Model of a kind of tiles, whose member `kind` decides which other members it has."""
        from terratool.definition.tile_kinds import KINDS

        kind, wanted = members.get("kind"), TILE_KEYS["kind"].words
        if "kind" not in members:
            hint = f'Add "kind", {wanted}.'
            self.add("TT104", pointer, 'the kind of tiles has no "kind".', hint)
        elif not isinstance(kind, str):
            self._wrong_type(pointer, "/kind", '"kind"', wanted, kind)
        elif kind in KINDS:
            for key in REQUIRED.get(kind, ()):
                if key not in members:
                    hint = f'Add "{key}", {KEYS[kind][key].words}.'
                    self.add("TT104", pointer, f'the kind of tiles has no "{key}".', hint)
            return TileText(kind, self._fields(kind, members, pointer))
        else:
            return TileText(kind)
        self._leave_out(pointer, "kind")
        return TileText()

    def _leave_out(self, owner: Owner, key: str) -> None:
        self.decoded.unfit.setdefault(key, set()).add(owner)

    def _fields(self, kind: Shape, value: dict[str, Any], owner: Owner) -> dict[str, Any]:
        """Values of an object that fit, converted, by attribute; nested objects are left alone."""
        fields = {}
        slots = SLOTS[kind]
        for key, item in value.items():
            slot = slots.get(key)
            if slot is None:
                self._own_key(kind, key, value, owner)
                continue
            name, types, low, high, number = slot
            its = type(item)
            if its in types:  # fast path, as a million elements may pass here
                if its is int:
                    if low <= item <= high:
                        fields[name] = float(item) if number else item
                        continue
                elif its is not float or low <= item <= high:
                    fields[name] = item
                    continue
            self._failed = False
            fitting = self._fit(KEYS[kind][key], key, item, owner)
            if self._failed:
                self._leave_out(owner, key)
            else:
                fields[name] = fitting
        return fields

    def _own_key(self, kind: Shape, key: str, value: dict[str, Any], owner: Owner) -> None:
        if key == "x-ignore":
            self.decoded.ignores.append((owner, value[key]))
        elif not key.startswith("x-") and self._found.wants("TT103"):
            about = unknown_key(kind, key, frozenset(value))
            remark = remark_on(owner, "/" + escape(key), *about, on_key=True)
            self._found.keep("TT103", remark)

    def _fit(self, wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        """Convert the value of a key; one that misfits is remarked on and sets `_failed`."""
        rest, subject = f"/{key}", f'"{key}"'
        if wanted.kind == "curve":
            return self._curve(wanted, key, item, owner)
        if wanted.kind == "grid":
            return self._grid(wanted, key, item, owner)
        if wanted.kind == "path":
            return self._path(wanted, key, item, owner)
        if wanted.kind == "depth":
            return self._depth(wanted, key, item, owner)
        if wanted.kind == "members":
            return self._members(MEMBERS[key], wanted, key, item, owner)
        if wanted.kind == "paths":
            return self._paths(wanted, key, item, owner)
        if wanted.kind == "numbers":
            if not isinstance(item, list) or not 1 <= len(item) <= wanted.length:
                return self._wrong_type(owner, rest, subject, wanted.words, item)
            one = msgspec.structs.replace(wanted, kind="number")
            return tuple(
                self._single(one, part, owner, f"{rest}/{i}", f'item {i} of "{key}"', key)
                for i, part in enumerate(item)
            )
        if wanted.kind == "formula":
            return self._formula(wanted, item, owner, rest, subject, key)
        if wanted.kind == "formulas":
            if not isinstance(item, dict):
                return self._wrong_type(owner, rest, subject, wanted.words, item)
            return {
                name: self._formula(
                    FORMULA, part, owner, f"{rest}/{escape(name)}", quote(name), key
                )
                for name, part in item.items()
            }
        if wanted.kind == "any":
            if isinstance(item, float) and (item.is_integer() or not fits_double(item)):
                item = int(item) if fits_double(item) else 10**400  # as in JSON Schema
            if isinstance(item, bool) or not isinstance(item, str | int | dict):
                self._wrong_type(owner, rest, subject, wanted.words, item)
            for place in _nonfinite(item):
                self._not_finite(owner, rest + place)
            return item
        if wanted.length and isinstance(item, list) and len(item) == wanted.length:
            return tuple(
                self._single(wanted, part, owner, f"{rest}/{i}", f'item {i} of "{key}"', key)
                for i, part in enumerate(item)
            )
        if not wanted.alone and not (wanted.choices and isinstance(item, str)):
            return self._wrong_type(owner, rest, subject, wanted.words, item)
        return self._single(wanted, item, owner, rest, subject, key)

    def _formula(
        self, wanted: Key, item: Any, owner: Owner, rest: str, subject: str, key: str
    ) -> Any:
        if isinstance(item, str):
            return item
        if type(item) not in JSON_TYPES["number"]:
            return self._wrong_type(owner, rest, subject, wanted.words, item)
        number = msgspec.structs.replace(wanted, kind="number")
        return self._single(number, item, owner, rest, subject, key)

    def _single(
        self, wanted: Key, item: Any, owner: Owner, rest: str, subject: str, key: str
    ) -> Any:
        if wanted.kind == "whole" and isinstance(item, float) and item.is_integer():
            item = int(item)  # as in JSON Schema
        if (
            wanted.kind in ("whole", "number")
            and type(item) in (int, float)
            and not fits_double(item)
        ):
            return self._not_finite(owner, rest)
        if wanted.choices and isinstance(item, str):
            if item not in wanted.choices:
                self._failed = True
                message = f"{quote(item)} is no {wanted.noun}."
                self.add("TT106", rest, message, f"Write {wanted.words}.", owner)
            return item
        if type(item) not in JSON_TYPES[wanted.kind]:
            return self._wrong_type(owner, rest, subject, wanted.words, item)
        if isinstance(item, int | float) and not wanted.holds(item):
            self._failed = True
            if self._found.wants("TT106"):
                message = f'"{key}" is {quote(item)}, out of its range.'
                self._found.keep("TT106", remark_on(owner, rest, message, f"Write {wanted.words}."))
            return None
        return float(item) if wanted.kind == "number" else item

    def _curve(self, wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        if isinstance(item, str):
            return item
        if not isinstance(item, list):
            return self._wrong_type(owner, f"/{key}", f'"{key}"', wanted.words, item)
        fast = JSON_TYPES["number"].issuperset(map(type, item))
        if fast and all(-wanted.high <= number <= wanted.high for number in item):
            return tuple(map(float, item))
        points = []
        for index, part in enumerate(item):
            rest, subject = f"/{key}/{index}", f'item {index} of "{key}"'
            if isinstance(part, list) and len(part) == 2:
                points.append(self._numbers(part, owner, rest, subject, key))
            elif isinstance(part, list):
                self._wrong_type(owner, rest, subject, wanted.words, part)
            else:
                points.append(self._single(_NUMBER, part, owner, rest, subject, key))
        return tuple(points)

    def _grid(self, wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        if isinstance(item, dict):
            return self._members(GridFile, wanted, key, item, owner)
        if not isinstance(item, list):
            return self._wrong_type(owner, f"/{key}", f'"{key}"', wanted.words, item)
        rows = []
        for index, row in enumerate(item):
            rest = f"/{key}/{index}"
            if isinstance(row, list):
                rows.append(
                    tuple(
                        None
                        if number is None
                        else self._single(
                            _NUMBER, number, owner, f"{rest}/{i}", f"item {i} of row {index}", key
                        )
                        for i, number in enumerate(row)
                    )
                )
            else:
                self._wrong_type(owner, rest, f'row {index} of "{key}"', "a list of numbers", row)
        return tuple(rows)

    def _numbers(self, pair: list[Any], owner: Owner, rest: str, subject: str, key: str) -> Any:
        """Knot or point as a tuple of numbers."""
        return tuple(
            self._single(_NUMBER, value, owner, f"{rest}/{i}", subject, key)
            for i, value in enumerate(pair)
        )

    def _path(self, wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        if not isinstance(item, list):
            return self._wrong_type(owner, f"/{key}", f'"{key}"', wanted.words, item)
        points = []
        for index, part in enumerate(item):
            rest, subject = f"/{key}/{index}", f'item {index} of "{key}"'
            if isinstance(part, list) and len(part) in POINT_LENGTHS:
                points.append(self._numbers(part, owner, rest, subject, key))
            else:
                words = "a point [x, y] or [x, y, z], two or three numbers"
                self._wrong_type(owner, rest, subject, words, part)
        return tuple(points)

    def _members(self, kind: type[Struct], wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        """Model of an object that holds no other, as `repeat`."""
        if not isinstance(item, dict):
            return self._wrong_type(owner, f"/{key}", f'"{key}"', wanted.words, item)
        found: dict[str, Any] = {}
        for name, value in item.items():
            rest = f"/{key}/{escape(name)}"
            if name not in SLOTS[kind]:
                if not name.startswith("x-"):
                    self._failed = True
                    about = unknown_key(kind, name, frozenset(item))
                    if self._found.wants("TT103"):
                        self._found.keep("TT103", remark_on(owner, rest, *about, on_key=True))
                continue
            inner, attribute = KEYS[kind][name], SLOTS[kind][name].name
            if inner.kind == "names":
                found[attribute] = self._names(inner, value, owner, rest)
            elif not inner.length:
                found[attribute] = self._single(inner, value, owner, rest, f'"{name}"', name)
            elif isinstance(value, list) and len(value) == inner.length:
                found[attribute] = tuple(
                    self._single(inner, part, owner, f"{rest}/{i}", f'item {i} of "{name}"', name)
                    for i, part in enumerate(value)
                )
            else:
                self._wrong_type(owner, rest, f'"{name}"', inner.words, value)
        for field_ in msgspec.structs.fields(kind):
            name = field_.encode_name
            if field_.required and name not in item:
                self._failed = True
                message = f'"{key}" has no "{name}".'
                self.add(
                    "TT104", f"/{key}", message, f'Add "{name}", {KEYS[kind][name].words}.', owner
                )
        return None if self._failed else kind(**found)

    def _names(self, wanted: Key, item: Any, owner: Owner, rest: str) -> Any:
        if not isinstance(item, dict):
            return self._wrong_type(owner, rest, '"names"', wanted.words, item)
        for key, name in item.items():
            if not isinstance(name, str):
                words = "the name of a surface, a text"
                self._wrong_type(owner, f"{rest}/{escape(key)}", quote(key), words, name)
        return item

    def _paths(self, wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        if not isinstance(item, list):
            return self._wrong_type(owner, f"/{key}", f'"{key}"', wanted.words, item)
        paths = []
        for index, path in enumerate(item):
            if isinstance(path, str):
                paths.append(path)
            else:
                words = "the path of a library, a text"
                self._wrong_type(owner, f"/{key}/{index}", f'item {index} of "{key}"', words, path)
        return tuple(paths)

    def _depth(self, wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        if not isinstance(item, dict):
            if type(item) not in JSON_TYPES["number"]:
                return self._wrong_type(owner, f"/{key}", f'"{key}"', wanted.words, item)
            return self._single(_DEPTH, item, owner, f"/{key}", f'"{key}"', key)
        return {
            name: self._single(
                _DEPTH, value, owner, f"/{key}/{escape(name)}", f'"{key}" on {quote(name)}', key
            )
            for name, value in item.items()
        }

    def _wrong_type(self, owner: Owner, rest: str, subject: str, words: str, item: Any) -> None:
        self._failed = True
        if rest == "":
            self._leave_out(owner, "")
        if not self._found.wants("TT105"):
            return
        message = f"{subject} is {type_in_words(item)}, which does not fit."
        self._found.keep("TT105", remark_on(owner, rest, message, f"Write {words}."))

    def _not_finite(self, owner: Owner, rest: str) -> None:
        self._failed = True
        self.add(
            "TT107",
            rest,
            "the number is too large for a 64-bit float.",
            "Write a number below 1.8e308 in size.",
            owner,
        )

    def add(self, code: str, rest: str, message: str, hint: str, owner: Owner = "") -> None:
        if self._found.wants(code):
            self._found.keep(code, remark_on(owner, rest, message, hint))

    def _tree(self, roots: dict[str, Any]) -> Tree:
        values: list[dict[str, Any]] = []
        families = []
        levels = [0]
        level: list[Any] = list(roots.values())
        while level:
            start = len(values)
            if set(map(type, level)) != {dict}:
                names = list(map(_part_name, roots)) if start == 0 else ["an element"] * len(level)
                level = [
                    self._element(value, index, name)
                    for index, (value, name) in enumerate(zip(level, names, strict=True), start)
                ]
            values.extend(level)
            after = len(values)
            levels.append(after)
            broods = [value.get("children", UNSET) for value in level]
            level = []
            if broods.count(UNSET) < len(broods):  # most elements are in the last level
                for index, children in enumerate(broods, start):
                    if isinstance(children, list):
                        begin = after + len(level)
                        level.extend(children)
                        families.append((index, begin, after + len(level)))
                    elif children is not UNSET:
                        wanted = KEYS[Element]["children"].words
                        self._wrong_type(index, "/children", '"children"', wanted, children)
                        self._leave_out(index, "children")
        used = set(chain.from_iterable(values))
        columns = {}
        for key, slot in SLOTS[Element].items():
            if key in used and key != "children":
                columns[slot.name] = [value.get(key, UNSET) for value in values]
                self._convert_column(key, slot, columns[slot.name])
            else:
                columns[slot.name] = [UNSET] * len(values)
        if "part" in used:  # rules tell of children beside a part even where the list is empty
            columns["children"] = [() if "children" in value else UNSET for value in values]
        self._own_keys(used - SLOTS[Element].keys(), values)
        return Tree([], families, levels, columns, tuple(roots))

    def _own_keys(self, own: set[str], values: list[dict[str, Any]]) -> None:
        """Report keys of elements that the format does not have, and collect `x-ignore`."""
        if "x-ignore" in own:
            self.decoded.ignores += [
                (index, value["x-ignore"])
                for index, value in enumerate(values)
                if "x-ignore" in value
            ]
        own = {key for key in own if not key.startswith("x-")}
        if own:
            remarks = (
                remark_on(
                    index,
                    "/" + escape(key),
                    *unknown_key(Element, key, frozenset(value)),
                    on_key=True,
                )
                for index, value in enumerate(values)
                if not own.isdisjoint(value)
                for key in value
                if key in own
            )
            count = sum(map(own.__contains__, chain.from_iterable(values)))
            self._found.take("TT103", remarks, count)

    def _element(self, value: Any, index: int, name: str) -> dict[str, Any]:
        if isinstance(value, dict):
            return value
        self._wrong_type(index, "", name, "an object", value)
        return {}  # an empty element in its place, so that the others keep their pointers

    def _convert_column(self, key: str, slot: QuickCheck, column: list[Any]) -> None:
        """Convert values of a column in place, and set those that misfit to UNSET."""
        types = set(map(type, column)) - {UnsetType}
        if types <= slot.types:
            numbers = set(column) - {UNSET} if types - {str} else ()
            if not numbers or (slot.low <= min(numbers) and max(numbers) <= slot.high):
                if slot.number and int in types:
                    column[:] = [float(n) if type(n) is int else n for n in column]
                return
        wanted, out_of_range, wrong_types = KEYS[Element][key], 0, 0
        unfit: set[Owner] = set()
        full = self._found.full("TT106")
        for index, item in enumerate(column):
            its = type(item)
            if its is UnsetType:
                continue
            if its in slot.types:
                if its is str or slot.low <= item <= slot.high:
                    if slot.number:
                        column[index] = float(item)
                    continue
                if full and -BIGGEST <= item <= BIGGEST:  # counted without a remark
                    out_of_range += 1
                    column[index] = UNSET
                    unfit.add(index)
                    continue
            elif its in NEVER and wanted.kind != "members" and self._found.full("TT105"):
                wrong_types += 1
                column[index] = UNSET
                unfit.add(index)
                continue
            self._failed = False
            column[index] = self._fit(wanted, key, item, index)
            if self._failed:
                column[index] = UNSET
                unfit.add(index)
                full = self._found.full("TT106")
        self._found.take("TT106", iter(()), out_of_range)
        self._found.take("TT105", iter(()), wrong_types)
        if unfit:
            self.decoded.unfit.setdefault(key, set()).update(unfit)


def _part_name(part: str) -> str:
    """Name of a part in words, by its pointer."""
    return f"the part {quote(unescape(part[len(PARTS) + 1 :]))}"


def remark_on(
    owner: Owner, rest: str, message: str, hint: str, fix: str = "", *, on_key: bool = False
) -> Remark:
    """Remark on the value at `rest` in an owner."""
    if isinstance(owner, int):
        return Remark(rest, message, hint, on_key, owner, fix=fix)
    return Remark(owner + rest, message, hint, on_key, fix=fix)


def _nonfinite(item: Any) -> Iterator[str]:
    pending = [(item, "")]
    while pending:
        part, here = pending.pop()
        if isinstance(part, list):
            pending.extend((value, f"{here}/{i}") for i, value in enumerate(part))
        elif isinstance(part, dict):
            pending.extend((value, f"{here}/{escape(key)}") for key, value in part.items())
        elif isinstance(part, float | int) and not fits_double(part):
            yield here
