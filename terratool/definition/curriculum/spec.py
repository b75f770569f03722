"""The spec of a grid of training tiles: read, checked, and as frozen values."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec

from terratool.definition.curriculum.parameters import KINDS, Parameter, Value
from terratool.definition.findings import Finding
from terratool.definition.keys import CURRICULUM_KEYS, document_kind
from terratool.definition.reader import Checked, CheckOptions, check, refusal
from terratool.definition.rules import RULES
from terratool.errors import DefinitionError, RequestError
from terratool.report.wording import listed
from terratool.text.display import escape, shown
from terratool.text.locate import Address, locate
from terratool.text.source import Source, read_source
from terratool.text.syntax import JsonSyntaxError
from terratool.text.values import read_values, repeated_keys

MOST_TILES = 10_000
"""Tiles of a spec."""
MOST_PIECES = 1_000_000
"""Elements and random heights that all tiles may come to."""
LONGEST = 65.0
"""m: sides of a tile, whose millimetres are cells of a grid."""
_MOST_BYTES = 1 << 24
_LAST_SEED = 2**53

RESERVED = ("ground", "level", "pyramid", "column", "floor", "hole")
"""Primitives and surfaces that every definition may have."""
FLOOR: Mapping[str, Any] = {
    "descr": "The generators' friction coefficient of 1",
    "cohesion": 0,
    "fricAngle": 45,
    "sinkage": 0,
    "color": [150, 150, 144],
}
"""The surface where none is given."""

_name = re.compile(r"\w(?:[\w .-]{0,58}\w)?").fullmatch


@dataclass(frozen=True, slots=True)
class KindSpec:
    """A kind of tile with what it is told.

    Attributes:
        name: what the spec calls it.
        kind: a key of `KINDS`.
        proportion: its share of the columns, or of the tiles.
        values: by the keys of the kind, all of them.
    """

    name: str
    kind: str
    proportion: float
    values: Mapping[str, Value]

    def number(self, key: str) -> float:
        """A number, or a whole one."""
        value = self.values[key]
        assert isinstance(value, (int, float))
        return value

    def flag(self, key: str) -> bool:
        """True or false."""
        return bool(self.values[key])

    def range(self, key: str) -> tuple[float, float]:
        """The two ends of a range."""
        value = self.values[key]
        assert isinstance(value, tuple)
        return value

    def at(self, key: str, difficulty: float) -> float:
        """The value of a range at a difficulty: its first end at 0, its second at 1."""
        first, second = self.range(key)
        return first + difficulty * (second - first)


@dataclass(frozen=True, slots=True)
class PatchSpec:
    """Level places to look for in each tile.

    Attributes:
        name: what the spec calls them.
        count: how many are wanted in each tile.
        radius: of the discs that have to be level, m; the largest counts.
        height_difference: between the highest and the lowest height of a disc, m.
        slope: of the plane that fits the disc best, degrees; 90 for any.
        x: where their middles may be, m from the tile's middle.
        y: the same.
        z: heights they may have, m from the tile's origin.
    """

    name: str
    count: int
    radius: float
    height_difference: float
    slope: float = 90.0
    x: tuple[float, float] = (-1e6, 1e6)
    y: tuple[float, float] = (-1e6, 1e6)
    z: tuple[float, float] = (-1e6, 1e6)


@dataclass(frozen=True, slots=True)
class Spec:
    """A grid of tiles: rows along x, columns along y.

    Attributes:
        rows: how many rows; difficulty grows with them.
        columns: how many columns.
        tile: sides of a tile along x and y, m.
        kinds: at least one.
        seed: number that all random choices follow from.
        curriculum: whether difficulty follows the row and kind the column; else both are random.
        difficulty: the least and the greatest.
        jitter: the share of a row's part of the difficulty that is random: 1 is Isaac Lab's, 0 is
            legged_gym's.
        border: width of the level ground around all tiles, m.
        origin: world position of the south-west corner of the first tile.
        surface: what the ground is, as in `surfTypes` of a definition.
        patches: level places to look for.
        descr: of the definition.
    """

    rows: int
    columns: int
    kinds: tuple[KindSpec, ...]
    tile: tuple[float, float] = (8.0, 8.0)
    seed: int = 0
    curriculum: bool = True
    difficulty: tuple[float, float] = (0.0, 1.0)
    jitter: float = 1.0
    border: float = 0.0
    origin: tuple[float, float] = (0.0, 0.0)
    surface: Mapping[str, Any] = field(default_factory=lambda: FLOOR)
    patches: tuple[PatchSpec, ...] = ()
    descr: str = ""


def load_spec(path: str | Path, seed: int | None = None) -> Spec:
    """Read a spec; ``-`` is standard input.

    Args:
        path: the file.
        seed: instead of the spec's own.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: it is no JSON, or no spec; `findings` has all that is wrong.
        RequestError: the seed is out of its range.
    """
    if seed is not None and not 0 <= seed <= _LAST_SEED:
        raise RequestError(f"The seed is {seed}.", f"Give one from 0 to {_LAST_SEED:,}.")
    source = read_source(path, _MOST_BYTES, "A spec is a short text; check the path.")
    spec = spec_of(source)
    return spec if seed is None else replace(spec, seed=seed)


def spec_of(source: Source | Mapping[str, Any]) -> Spec:
    """The spec that a text, or a dictionary, holds.

    Raises:
        DefinitionError: it holds none; `findings` has all that is wrong.
    """
    if not isinstance(source, Source):
        try:
            source = Source("the spec", msgspec.json.encode(source))
        except (TypeError, ValueError, RecursionError) as error:
            raise DefinitionError(
                f"The spec cannot be written as JSON ({error}).",
                "Give a dictionary of JSON values.",
            ) from error
    try:
        reading = _Reading.of(source)
    except JsonSyntaxError as error:
        raise refusal(check(source)) from error
    errors = [one for one in _findings(source, reading.faults) if one.severity == "error"]
    if errors:
        kind = document_kind(source.data)
        if kind not in ("curriculum", None):
            raise DefinitionError(
                f"{source.name}: is a {kind}, where the spec of a curriculum is wanted.",
                "Name a spec here, such as samples/curricula/rough.json.",
            )
        raise refusal(Checked(tuple(errors), Counter(one.code for one in errors)))
    assert reading.spec is not None
    return reading.spec


def check_spec(source: Source, options: CheckOptions) -> Checked:
    """All that is wrong with a text that is read as a spec."""
    try:
        faults = _Reading.of(source).faults
    except JsonSyntaxError:
        return check(source, options)  # which says that alone
    shows = options.of(source.name).shows
    wanted = [fault for fault in faults if shows(fault.code)]
    return Checked(
        tuple(_findings(source, wanted)[: options.limit]),
        Counter(fault.code for fault in faults),
        name=source.name,
    )


@dataclass(frozen=True, slots=True)
class _Fault:
    code: str
    address: Address
    message: str
    hint: str


def _findings(source: Source, faults: list[_Fault]) -> list[Finding]:
    """Faults by where they stand in the text."""
    if not faults:
        return []
    positions = locate(source.data, [fault.address for fault in faults], repeated=True)
    return sorted(
        (
            Finding(
                file=source.name,
                code=fault.code,
                severity=RULES[fault.code].severity,
                pointer=fault.address.pointer,
                line=position.line,
                column=position.column,
                message=fault.message,
                hint=fault.hint,
                excerpt=position.excerpt,
            )
            for fault, position in zip(faults, positions, strict=True)
        ),
        key=lambda finding: (finding.line, finding.column, finding.pointer),
    )


class _Reading:
    """Reads values, and keeps what is wrong with them."""

    def __init__(self) -> None:
        self.faults: list[_Fault] = []
        self.spec: Spec | None = None

    @classmethod
    def of(cls, source: Source) -> _Reading:
        """Read a text.

        Raises:
            JsonSyntaxError: it is no JSON.
        """
        value, reading = read_values(source.data), cls()
        for pointer, occurrence in repeated_keys(source.data, 100)[0]:
            reading.wrong(
                pointer, "this key stands twice in its object.", "Keep one of them.", "TT102",
                occurrence,
            )  # fmt: skip
        reading.spec = reading._spec(value)
        return reading

    def wrong(
        self, pointer: str, message: str, hint: str, code: str = "TT801", occurrence: int = 1
    ) -> None:
        """Keep a fault; it is in a key where that is one too many."""
        on_key = occurrence > 1 or message.startswith("the key")
        self.faults.append(_Fault(code, Address(pointer, on_key, occurrence), message, hint))

    @property
    def _errors(self) -> int:
        return sum(RULES[fault.code].severity == "error" for fault in self.faults)

    def _spec(self, value: Any) -> Spec | None:
        """The spec; None if something is wrong that leaves none."""
        before = self._errors
        if not isinstance(value, dict):
            self.wrong("", "a spec is an object.", 'Write {"rows": 10, "columns": 20, …}.', "TT105")
            return None
        self._keys("", value, CURRICULUM_KEYS, ("rows", "columns", "kinds"))
        for key in ("$schema", "descr"):
            if not isinstance(value.get(key, ""), str):
                self.wrong(f"/{key}", f'"{key}" is no text.', "Write a text in quotes.", "TT105")
        tile = self._tile(value.get("tile", 8))
        spec = Spec(
            rows=int(self._number(value, "rows", Parameter("whole", 1, "", 1, MOST_TILES))),
            columns=int(self._number(value, "columns", Parameter("whole", 1, "", 1, MOST_TILES))),
            kinds=tuple(self._kinds(value["kinds"], tile)) if "kinds" in value else (),
            tile=tile or (1.0, 1.0),
            seed=int(self._number(value, "seed", Parameter("whole", 0, "", 0, _LAST_SEED))),
            curriculum=self._flag(value, "curriculum", True),
            difficulty=self._range(value, "difficulty", Parameter("range", (0.0, 1.0), "", 0, 1)),
            jitter=self._number(value, "jitter", Parameter("number", 1.0, "", 0, 1)),
            border=round(self._number(value, "border", Parameter("number", 0.0, "", 0, 1000)), 3),
            origin=self._pair("/origin", value.get("origin", [0, 0]), -1e9, 1e9) or (0.0, 0.0),
            surface=self._surface(value["surface"]) if "surface" in value else FLOOR,
            patches=tuple(self._patches(value.get("patches", {}), tile)),
            descr=str(value.get("descr", "")),
        )
        if self._errors > before:
            return None
        if spec.rows * spec.columns > MOST_TILES:
            self.wrong(
                "/columns",
                f"{spec.rows:,} rows of {spec.columns:,} are {spec.rows * spec.columns:,} tiles, "
                f"more than {MOST_TILES:,}.",
                "Make several grids of fewer tiles.",
            )
        return spec

    def _keys(
        self, pointer: str, value: dict[str, Any], known: tuple[str, ...], needed: tuple[str, ...]
    ) -> None:
        from difflib import get_close_matches

        for key in value:
            if key not in known and not key.startswith("x-"):
                close = get_close_matches(key, known, 1)
                hint = f'Did you mean "{close[0]}"?' if close else f"Known are {listed(known)}."
                self.wrong(
                    f"{pointer}/{escape(key)}", f"the key {shown(key)} is unknown.", hint, "TT103"
                )
        for key in needed:
            if key not in value:
                self.wrong(pointer, f'"{key}" is missing.', "Add it.", "TT104")

    def _tile(self, value: Any) -> tuple[float, float] | None:
        """Sides of a tile; None if they are wrong."""
        before = len(self.faults)
        sides: tuple[float, float] | None
        if not isinstance(value, (list, tuple)):
            side = self._one("/tile", '"tile"', value, Parameter("number", 8.0, "", 0.5, LONGEST))
            sides = side, side
        else:
            sides = self._pair("/tile", value, 0.5, LONGEST)
        if sides is not None and any(side != round(side, 3) for side in sides):
            self.wrong(
                "/tile",
                "a side of a tile is no whole number of millimetres.",
                "Round it to three digits behind the point.",
            )
        return sides if len(self.faults) == before else None

    def _kinds(self, value: Any, tile: tuple[float, float] | None) -> Iterator[KindSpec]:
        if not isinstance(value, dict) or not value:
            self.wrong(
                "/kinds",
                '"kinds" is no object with kinds of tiles.',
                'Write {"stairs": {"kind": "pyramidStairs"}} or more.',
                "TT105",
            )
            return
        names: dict[str, str] = {}
        total = 0.0
        for name, members in value.items():
            pointer = f"/kinds/{escape(name)}"
            self._named(pointer, name, names)
            if not isinstance(members, dict):
                self.wrong(pointer, "it is no object.", 'Write {"kind": "pyramidStairs"}.', "TT105")
                continue
            kind = members.get("kind")
            if not isinstance(kind, str) or kind not in KINDS:
                self._unknown_kind(pointer, members)
                continue
            self._keys(pointer, members, ("kind", "proportion", *KINDS[kind]), ())
            share = self._number(members, "proportion", Parameter("number", 1.0, ""), pointer)
            total += share
            before = len(self.faults)
            values = {
                key: self._value(members, key, parameter, pointer)
                for key, parameter in KINDS[kind].items()
            }
            read = KindSpec(name, kind, share, values)
            if tile and len(self.faults) == before:
                for key, message, hint in misfits(read, tile):
                    self.wrong(f"{pointer}/{key}", message, hint)
            yield read
        if not total > 0.0 and not self.faults:
            self.wrong("/kinds", "all proportions are 0.", "Give one of them more.")

    def _unknown_kind(self, pointer: str, members: dict[str, Any]) -> None:
        from difflib import get_close_matches

        if "kind" not in members:
            self.wrong(pointer, '"kind" is missing.', f"Known are {listed(list(KINDS))}.", "TT104")
            return
        kind = members["kind"]
        close = get_close_matches(kind, KINDS, 1) if isinstance(kind, str) else []
        hint = f'Did you mean "{close[0]}"?' if close else f"Known are {listed(list(KINDS))}."
        what = shown(kind) if isinstance(kind, (str, int, float)) else "this"
        self.wrong(f"{pointer}/kind", f"there is no kind {what}.", hint)

    def _named(self, pointer: str, name: str, names: dict[str, str]) -> None:
        if not _name(name):
            self.wrong(
                pointer,
                f"the key {shown(name)} is no name for tiles.",
                "Use up to 60 letters, digits, spaces, dots, _ and -, and none of the last three "
                "at its ends.",
            )
        elif name.lower() in RESERVED:
            self.wrong(
                pointer,
                f"the key {shown(name)} is a name that definitions need themselves.",
                "Choose another one.",
            )
        other = names.setdefault(name.lower(), name)
        if other != name:
            self.wrong(
                pointer,
                f"the key {shown(name)} differs from {shown(other)} only by case.",
                "Choose another one.",
            )

    def _surface(self, value: Any) -> Mapping[str, Any]:
        if not isinstance(value, dict):
            self.wrong(
                "/surface", '"surface" is no object.', 'Write {"preset": "concrete"}.', "TT105"
            )
            return FLOOR
        text = {
            "size": 1,
            "surfTypes": {"floor": value},
            "elemTypes": {"level": {"x": [1]}},
            "elemTree": {"type": "level", "surface": "floor", "vScale": 1},
        }
        for finding in check(Source("the spec", msgspec.json.encode(text))).findings:
            rest = finding.pointer.removeprefix("/surfTypes/floor")
            self.wrong(f"/surface{rest}", finding.message, finding.hint, finding.code)
        if value.get("void") is True:
            self.wrong(
                "/surface/void",
                '"surface" is void, so no tile would have ground.',
                'Leave out "void", or all of "surface".',
            )
        surface: Mapping[str, Any] = value
        return surface

    def _patches(self, value: Any, tile: tuple[float, float] | None) -> Iterator[PatchSpec]:
        if not isinstance(value, dict):
            self.wrong(
                "/patches", '"patches" is no object.', 'Write {"spawn": {"radius": 0.5}}.', "TT105"
            )
            return
        names: dict[str, str] = {}
        known = ("count", "radius", "heightDifference", "slope", "x", "y", "z")
        wide = Parameter("range", (-1e6, 1e6), "", -1e6, 1e6)
        for name, members in value.items():
            pointer = f"/patches/{escape(name)}"
            self._named(pointer, name, names)
            if not isinstance(members, dict):
                self.wrong(pointer, "it is no object.", 'Write {"radius": 0.5}.', "TT105")
                continue
            self._keys(pointer, members, known, ("radius",))
            most = min(tile or (LONGEST,)) / 2
            yield PatchSpec(
                name,
                int(self._number(members, "count", Parameter("whole", 10, "", 1, 1000), pointer)),
                self._number(members, "radius", Parameter("number", 0.5, "", 0, most), pointer),
                self._number(members, "heightDifference", Parameter("number", 0.05, ""), pointer),
                self._number(members, "slope", Parameter("number", 90.0, "", 0, 90), pointer),
                self._range(members, "x", wide, pointer),
                self._range(members, "y", wide, pointer),
                self._range(members, "z", wide, pointer),
            )

    # --- single values ---------------------------------------------------------------------------

    def _value(
        self, members: dict[str, Any], key: str, parameter: Parameter, pointer: str
    ) -> Value:
        match parameter.form:
            case "flag":
                return self._flag(members, key, bool(parameter.default), pointer)
            case "choice":
                value = members.get(key, parameter.default)
                if value not in parameter.choices:
                    words = " or ".join(f'"{word}"' for word in parameter.choices)
                    self.wrong(f"{pointer}/{key}", f'"{key}" is not {words}.', "Write one of them.")
                return str(value)
            case "range" | "wholes":
                return self._range(members, key, parameter, pointer)
            case _:
                return self._number(members, key, parameter, pointer)

    def _flag(self, members: dict[str, Any], key: str, default: bool, pointer: str = "") -> bool:
        value = members.get(key, default)
        if not isinstance(value, bool):
            self.wrong(
                f"{pointer}/{key}", f'"{key}" is not true or false.', "Write one of them.", "TT105"
            )
        return bool(value)

    def _number(
        self, members: dict[str, Any], key: str, parameter: Parameter, pointer: str = ""
    ) -> float:
        value = members.get(key, parameter.default)
        return self._one(f"{pointer}/{key}", f'"{key}"', value, parameter)

    def _one(self, pointer: str, what: str, value: Any, parameter: Parameter) -> float:
        """A number within limits; the least allowed where it is none."""
        low, high = parameter.low, parameter.high
        whole = parameter.form in ("whole", "wholes")
        if not _is_number(value) or (whole and value != int(value)):
            kind = "whole number" if whole else "number"
            self.wrong(
                pointer,
                f"{what} is no {kind}.",
                f"Write one from {_limit(low)} to {_limit(high)}.",
                "TT105",
            )
            return low
        if not low <= value <= high:
            self.wrong(
                pointer,
                f"{what} is {shown(value)}.",
                f"Write a number from {_limit(low)} to {_limit(high)}.",
                "TT106",
            )
            return low
        return int(value) if whole else float(value)

    def _range(
        self, members: dict[str, Any], key: str, parameter: Parameter, pointer: str = ""
    ) -> tuple[float, float]:
        value = members.get(key, parameter.default)
        pointer = f"{pointer}/{key}"
        if not isinstance(value, (list, tuple)) or len(value) != 2:
            self.wrong(
                pointer, f'"{key}" is no pair of numbers.', "Write [least, greatest].", "TT105"
            )
            return parameter.low, parameter.low
        before = len(self.faults)
        first, second = (
            self._one(f"{pointer}/{index}", f'"{key}"', one, parameter)
            for index, one in enumerate(value)
        )
        if first > second and len(self.faults) == before:
            self.wrong(pointer, f'"{key}" begins above its end.', "Write the smaller number first.")
        return first, second

    def _pair(
        self, pointer: str, value: Any, low: float, high: float
    ) -> tuple[float, float] | None:
        what = f'"{pointer[1:]}"'
        if not isinstance(value, (list, tuple)) or len(value) != 2:
            self.wrong(pointer, f"{what} is no pair of numbers.", "Write [x, y].", "TT105")
            return None
        parameter = Parameter("number", 0.0, "", low, high)
        x, y = (
            self._one(f"{pointer}/{index}", what, one, parameter) for index, one in enumerate(value)
        )
        return x, y


_HUGE = 1 << 1000
"""Whole numbers may be any; beyond this they are no doubles."""


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return math.isfinite(value) if isinstance(value, float) else abs(value) < _HUGE


def _limit(number: float) -> str:
    """The least or the greatest number allowed, in full."""
    return f"{number:,}" if isinstance(number, int) else f"{number:,.12g}"


def misfits(kind: KindSpec, tile: tuple[float, float]) -> Iterator[tuple[str, str, str]]:
    """What of a kind does not fit into its tile: key, what is wrong, what to do."""
    side = min(tile)
    has = kind.values
    lengths = {key: kind.number(key) for key in ("platform", "border") if key in has}
    around = {"gap": "gapWidth", "rails": "thickness", "star": "width"}.get(kind.kind)
    if around:
        lengths[around] = kind.range(around)[1]
    platform = lengths.get("platform", 0.0)
    taken = 2.0 * sum(long for key, long in lengths.items() if key != "platform")
    if taken + platform >= side:
        parts = [_part(kind, key, long) for key, long in lengths.items() if long]
        leave, which = ("leave", "one of them") if parts[1:] else ("leaves", "it")
        yield (
            next(iter(lengths)),
            f"{listed(parts)} {leave} nothing of the tile's {side:g} m.",
            f"Make {which} smaller, or the tile larger.",
        )
    for key in ("stepWidth", "gridWidth", "spacing"):
        if key in has and side > taken and kind.number(key) > (side - taken) / 2:
            yield (
                key,
                f'"{key}" is more than half of the {side - taken:g} m that the tile has for it.',
                "Make it smaller, or the tile larger.",
            )
    if kind.kind == "rails" and 0.0 < side - platform < 5.0 * kind.range("thickness")[1]:
        yield (
            "thickness",
            f'"thickness" is more than {(side - platform) / 5:g} m, a fifth of the way across.',
            "Make it smaller, or the platform.",
        )
    if kind.kind == "discreteObstacles" and kind.range("width")[1] > side:
        yield "width", f'"width" is more than the tile\'s {side:g} m.', "Make it smaller."
    if "noiseStep" in has:
        low, high = kind.range("noise")
        if high > low and kind.number("noiseStep") > high - low + 1e-9:
            yield (
                "noiseStep",
                f'"noiseStep" is more than the {high - low:g} m between the ends of "noise".',
                "Make it smaller.",
            )


def _part(kind: KindSpec, key: str, long: float) -> str:
    """What takes a length of a tile, on both sides but for the platform."""
    default = KINDS[kind.kind][key].default == kind.values[key]
    twice = "" if key == "platform" else "twice "
    return f'{twice}"{key}" ({long:g} m{", the default" if default else ""})'
