"""Maps of robots, and their comparisons with terrains, in lines for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Literal, get_args

from terratool.report.numbers import coordinates, located, tenths
from terratool.report.tables import align
from terratool.report.wording import count_of, join_words
from terratool.text.display import quote

if TYPE_CHECKING:
    from terratool.sensing.comparison import Errors, MapComparison
    from terratool.sensing.robot_map import RobotMap

Face = Literal["top", "ground", "nearest"]
"""Face of a terrain that heights of a map are held against; the nearest may be an underside."""
FaceKind = Literal["ground", "top", "underside"]
"""Kind of a face: the top of what is solid from below, another top, or an underside."""
FACE_KINDS: tuple[FaceKind, ...] = get_args(FaceKind)
_FACES: dict[Face, tuple[str, str]] = {
    "top": ("the highest tops", ""),
    "ground": ("the ground below all", ""),
    "nearest": ("all tops", " in cells"),
}
"""Words for what a map is held against, and behind the count of that."""
_KINDS = ("ground", "tops of storeys", "undersides")
"""Words for kinds of faces, by their numbers."""
_MOST_NAMES = 20
"""Most names of surfaces that are listed."""


def map_lines(robot_map: RobotMap, name: str, others: Sequence[str] = ()) -> Iterator[str]:
    """Summary of a map, in lines for people.

    Args:
        robot_map: the map.
        name: name of its file.
        others: names of the files of its other levels and of its bag.
    """
    grid, cells = robot_map.grid, robot_map.grid.width * robot_map.grid.height
    yield (
        f"{name}: {count_of(robot_map.points, 'reading')} in {robot_map.seen:,} of {cells:,} "
        f"cells of {grid.resolution:g} m"
    )
    if (patches := robot_map.patches) is not None:
        yield from _patch_lines(patches.tolist(), robot_map.options.heights)
    if others:
        yield f"  With it: {join_words(others)}."
    names = [quote(name) for name in robot_map.surfaces[:_MOST_NAMES]]
    if names:
        more = len(robot_map.surfaces) - len(names)
        yield f"  Surfaces: {join_words([*names, *([f'{more:,} more'] if more else [])])}."
    if robot_map.outside:
        yield f"  Out of the bounds: {count_of(robot_map.outside, 'reading')}."


def _patch_lines(patches: Sequence[int], most: int) -> Iterator[str]:
    """Numbers of cells by how many patches they have, and what is left out."""
    counts = [f"{cells:,} with {number}" for number, cells in enumerate(patches, 1) if cells]
    yield f"  Patches of cells: {join_words(counts)}."
    if beyond := sum((number - most) * cells for number, cells in enumerate(patches, 1)
                     if number > most):  # fmt: skip
        yield f"  Left out, as more than {most} of a cell: {beyond:,}."


def comparison_lines(comparison: MapComparison) -> Iterator[str]:
    """Comparison of a map with its terrain, in lines for people."""
    errors, worst = comparison.errors, comparison.worst
    side = f"{comparison.map.level.grid.resolution:g} m"
    what, counted = _FACES[comparison.face]
    of = "the ground" if not comparison.storeys else what
    share = f"{tenths(comparison.coverage)} of {of}" if comparison.ground else "no ground"
    yield (
        f"{comparison.map.name}: {share}, {comparison.known:,} of "
        f"{count_of(comparison.ground, comparison.unit)}{counted} of {side}"
    )
    if comparison.beyond:
        cells = "cell" if comparison.map.gap is None else "patch"
        yield f"  Without ground in the terrain: {count_of(comparison.beyond, cells)}."
    if worst is None:
        yield "  No cell is known in both, so nothing is said of heights."
        return
    yield f"  RMSE {shown_metres(errors.rmse)}, bias {signed_metres(errors.bias)}."
    surface = "" if worst.surface is None else f", on {quote(worst.surface)}"
    # to a tenth of the error, so that the heights show it
    step = 10.0 * abs(worst.mapped - worst.true) or 1.0
    mapped, true = (located([height], step, 4) for height in (worst.mapped, worst.true))
    yield (
        f"  Worst at {coordinates((worst.x, worst.y))}: {mapped} m in place of {true} m{surface}."
    )
    if math.isfinite(comparison.within):
        yield f"  Within two standard deviations: {tenths(comparison.within)}."
    if comparison.faces:
        yield from _table(
            ("nearest face", "patches", "RMSE", "bias"),
            [
                (_KINDS[one.kind], f"{one.errors.cells:,}", *_pair(one.errors))
                for one in comparison.faces
            ],
        )
    yield from _table(
        (
            "surface",
            "ground" if comparison.unit == "cell" else "tops",
            "known",
            "RMSE",
            "bias",
            "right surface",
        ),
        [
            (
                quote(one.name) if one.name else "none",
                f"{one.ground:,}",
                tenths(one.known / one.ground) if one.ground else "",
                *_pair(one.errors),
                tenths(one.right / one.named) if one.named else "",
            )
            for one in comparison.surfaces
        ],
    )
    if not comparison.distances:
        yield "  The map does not say from how far it was seen."
        return
    yield from _table(
        ("distance", "cells" if comparison.map.gap is None else "patches", "RMSE", "bias"),
        [
            (
                f"{one.low:g} to {one.high:g} m"
                if math.isfinite(one.high)
                else f"{one.low:g} m on",
                f"{one.errors.cells:,}",
                *_pair(one.errors),
            )
            for one in comparison.distances
        ],
    )


def _pair(errors: Errors) -> tuple[str, str]:
    return (shown_metres(errors.rmse), signed_metres(errors.bias)) if errors.cells else ("", "")


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> Iterator[str]:
    # the last cell is empty, as a last column would be flush left
    return (f"  {line}" for line in align([[*row, ""] for row in (head, *rows)]))


def shown_metres(metres: float) -> str:
    """Length in words."""
    return f"{metres:.4f} m"


def signed_metres(metres: float) -> str:
    """Difference of heights in words, with its sign."""
    return f"{round(metres, 4) + 0.0:+.4f} m"  # -0.0 + 0.0 is 0.0
