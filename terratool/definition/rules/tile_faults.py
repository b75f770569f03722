"""Faults of specs of training tiles, beyond the faults of single values."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from msgspec import UNSET

from terratool.definition.curriculum import (
    CURRICULUM_KEYS,
    MAX_TILES,
    TILE_OF_A_FILE,
    CurriculumText,
    TileText,
)
from terratool.definition.findings import Remark
from terratool.definition.keys import KEYS
from terratool.definition.model import Pair, pair_of
from terratool.definition.rules.base import CurriculumSubject
from terratool.definition.tile_files import formula_problem
from terratool.definition.tile_kinds import KINDS
from terratool.definition.tile_spec import KindSpec
from terratool.report.wording import join_words
from terratool.text.display import escape, quote
from terratool.text.meaning import spelled_like

RESERVED = ("ground", "level", "pyramid", "column", "floor", "hole")
"""Names of primitives and surfaces that definitions of tiles have themselves."""
NAME = r"\w(?:[\w .-]{0,58}\w)?"
"""Pattern of the names of kinds of tiles and of level places."""
_AROUND = {
    "gap": "gapWidth", "rails": "thickness", "star": "width", "floatingRing": "ringWidth",
}  # fmt: skip
"""Range of a width that kinds of tiles have on each side of their platform."""
_DIGITS = 3
"""Decimals of a side of a tile in m."""


def faults(subject: CurriculumSubject) -> Iterator[Remark]:
    """Yield remarks on all faults beyond those of single values."""
    text = subject.curriculum
    sides = _sides(subject)
    yield from _grid(text, sides)
    yield from _names("/kinds", text.kinds)
    yield from _names("/patches", text.patches)
    yield from _reversed_ranges("", [("difficulty", text.difficulty)])
    yield from _kinds(subject, sides)
    yield from _patches(text, sides)
    if text.surface is not UNSET and text.surface.void is True:
        yield Remark(
            "/surface/void",
            '"surface" is void, so no tile would have ground.',
            'Leave out "void", or all of "surface".',
        )


def _sides(subject: CurriculumSubject) -> Pair | None:
    """Sides of a tile along x and y, m; None where they did not fit."""
    keys = CURRICULUM_KEYS[CurriculumText]
    if subject.left_out("", "tile"):
        return None
    return pair_of(subject.curriculum.tile, keys["tile"].default)


def _is_whole(sides: Pair) -> bool:
    """Whether sides are whole numbers of millimetres."""
    return all(side == round(side, _DIGITS) for side in sides)


def _grid(text: CurriculumText, sides: Pair | None) -> Iterator[Remark]:
    if sides is not None and not _is_whole(sides):
        yield Remark(
            "/tile",
            "a side of a tile is no whole number of millimetres.",
            "Round it to three digits behind the point.",
        )
    rows, columns = text.rows, text.columns
    if rows is not UNSET and columns is not UNSET and rows * columns > MAX_TILES:
        yield Remark(
            "/columns",
            f"{rows:,} rows of {columns:,} are {rows * columns:,} tiles, more than {MAX_TILES:,}.",
            "Make several grids of fewer tiles.",
        )


def _names(pointer: str, names: Iterable[str]) -> Iterator[Remark]:
    """Yield remarks on names that a definition cannot have."""
    is_name = re.compile(NAME).fullmatch
    known: dict[str, str] = {}
    for name in names:
        here, message = f"{pointer}/{escape(name)}", f"the key {quote(name)}"
        if not is_name(name):
            yield Remark(
                here,
                f"{message} is no name for tiles.",
                "Use up to 60 letters, digits, spaces, dots, _ and -, and none of the last three "
                "at its ends.",
                on_key=True,
            )
        elif name.lower() in RESERVED:
            message += " is a name that definitions need themselves."
            yield Remark(here, message, "Choose another one.", on_key=True)
        other = known.setdefault(name.lower(), name)
        if other != name:
            message = f"the key {quote(name)} differs from {quote(other)} only by case."
            yield Remark(here, message, "Choose another one.", on_key=True)


def _reversed_ranges(pointer: str, values: Iterable[tuple[str, object]]) -> Iterator[Remark]:
    """Yield remarks on ranges that end before they begin."""
    for key, value in values:
        if isinstance(value, tuple) and value[0] > value[1]:
            message = f'"{key}" begins above its end.'
            yield Remark(f"{pointer}/{key}", message, "Write the smaller number first.")


def _kinds(subject: CurriculumSubject, sides: Pair | None) -> Iterator[Remark]:
    """Yield remarks on kinds of tiles that are unknown, or have values too large for a tile."""
    total, known = 0.0, not subject.left_out("", "kinds")
    for name, tile in subject.curriculum.kinds.items():
        pointer = f"/kinds/{escape(name)}"
        if tile.kind not in KINDS:
            known = False
            if tile.kind is not UNSET:
                yield Remark(f"{pointer}/kind", *_unknown_kind(tile.kind))
            continue
        keys = KEYS[tile.kind]
        ranges = [(key, one) for key, one in tile.values.items() if not keys[key].alone]
        ends = list(_reversed_ranges(pointer, ranges))
        yield from ends
        yield from _of_a_file(subject, name, tile, pointer)
        kind = KindSpec.of(name, tile)
        total += kind.proportion
        known = known and not subject.left_out(pointer, "proportion")
        fits = not subject.left_out(pointer, *kind.values)
        if fits and sides is not None and _is_whole(sides) and not ends:
            for key, message, hint in misfits(kind, sides):
                yield Remark(f"{pointer}/{key}", message, hint)
    if known and subject.curriculum.kinds and not total > 0.0:
        yield Remark("/kinds", "all proportions are 0.", "Give one of them more.")


def _of_a_file(
    subject: CurriculumSubject, name: str, tile: TileText, pointer: str
) -> Iterator[Remark]:
    """Yield remarks on a kind of tiles that is made of a file."""
    if tile.kind != TILE_OF_A_FILE:
        return
    factor = tile.values.get("vScale", 1.0)
    assert isinstance(factor, float | str)
    if wrong := formula_problem(factor):
        yield Remark(f"{pointer}/vScale", *wrong)
    found = subject.tiles.get(name, ())
    for rest, message, hint in found if isinstance(found, list) else ():
        yield Remark(pointer + rest, message, hint)


def _unknown_kind(kind: str) -> tuple[str, str]:
    """Message and hint for an unknown kind of tile."""
    close = spelled_like(kind, KINDS, 1)
    hint = f'Did you mean "{close[0]}"?' if close else f"Known are {join_words(list(KINDS))}."
    return f"there is no kind {quote(kind)}.", hint


def _patches(text: CurriculumText, sides: Pair | None) -> Iterator[Remark]:
    for name, patch in text.patches.items():
        pointer = f"/patches/{escape(name)}"
        yield from _reversed_ranges(pointer, [("x", patch.x), ("y", patch.y), ("z", patch.z)])
        if sides is not None and patch.radius is not UNSET and patch.radius > min(sides) / 2:
            yield Remark(
                f"{pointer}/radius",
                f'"radius" is {patch.radius:g}, more than half of the tile\'s {min(sides):g} m.',
                "Make it smaller, or the tile larger.",
            )


def misfits(kind: KindSpec, tile: Pair) -> Iterator[tuple[str, str, str]]:
    """Values of a kind that do not fit into its tile: key, message and hint of each."""
    side = min(tile)
    has = kind.values
    lengths = {key: kind.number(key) for key in ("platform", "border") if key in has}
    around = _AROUND.get(kind.kind)
    if around:
        lengths[around] = kind.range(around)[1]
    platform = lengths.get("platform", 0.0)
    taken = 2.0 * sum(long for key, long in lengths.items() if key != "platform")
    if taken + platform >= side:
        parts = [_part(kind, key, long) for key, long in lengths.items() if long]
        leave, which = ("leave", "one of them") if parts[1:] else ("leaves", "it")
        yield (
            next(iter(lengths)),
            f"{join_words(parts)} {leave} nothing of the tile's {side:g} m.",
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
    """Length that a tile loses to a key, in words; all but the platform count on both sides."""
    default = KINDS[kind.kind].keys[key].default == kind.values[key]
    twice = "" if key == "platform" else "twice "
    return f'{twice}"{key}" ({long:g} m{", the default" if default else ""})'
