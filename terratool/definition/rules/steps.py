"""Rules on elements that add nothing, and on elements that add too tall a step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from msgspec import UNSET

from terratool.definition.cell_kinds import cell_kinds, shares_of
from terratool.definition.findings import Remark
from terratool.definition.grid_files import LinkedGrid
from terratool.definition.rules.base import Subject, rule, storeys_of
from terratool.definition.rules.grids import raster_place
from terratool.definition.summaries import (
    Range,
    ShapeSummary,
    edge_range,
    tallest_step,
    value_range,
)
from terratool.text.display import quote

_CLOSE = 1e-9


@rule("TT210", "zero-scale", "warning")
def zero_scale(subject: Subject) -> Iterator[Remark]:
    """The vScale of an element is 0, so that its primitive or its part has no height.

    Fails:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "vScale": 0}}

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "vScale": 0.2}}

    To mend: give the height that is meant. Where only the surface or vOffset is meant to count,
    silence TT210 by x-ignore.
    """
    scales = subject.tree.column("v_scale")
    for index, scale in enumerate(scales) if 0.0 in scales else ():
        if scale == 0.0:
            is_part = subject.tree.value("part", index) is not UNSET
            what = "all of the part is flat" if is_part else "the primitive has no effect"
            yield Remark(
                "/vScale",
                f'"vScale" is 0, so {what}.',
                'Give a height, or say with "x-ignore": ["TT210"] that only the rest is meant.',
                element=index,
            )


@rule("TT211", "tall-step", "warning")
def tall_step(subject: Subject) -> Iterator[Remark]:
    """An element makes a vertical step taller than the limit given by --max-step.

    A step is a jump inside its curves, or the height that the element adds where its footprint
    ends. Each element is looked at by itself: what stands beside it may make up for the step. The
    edge of the terrain is no step. Where a turned element is cut off by its cell, the step is taken
    to be as tall as the shape has it anywhere, which can be too much. What stands in a part is
    looked at as if the part covered the terrain, unturned and with the factor 1: TT213 says what is
    cut off where a part is turned. Of a deck or bore with datum, whose heights count from 0, the
    steps inside its curves are looked at alone. The heights of rasters are read. Without --max-step
    nothing is looked at.

    Fails with --max-step 0.15:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {
            "type": "box",
            "children": [{"cellX": 0, "cellY": 0, "type": "box", "vScale": 0.2}]
          }
        }

    Passes with --max-step 0.15:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}, "mound": {"x": "cosbell", "y": []}},
          "elemTree": {
            "type": "box",
            "children": [{"cellX": 0, "cellY": 0, "type": "mound", "vScale": 0.2}]
          }
        }

    To mend: lower vScale or vOffset, or let the curves end at 0 or without a step.
    """
    limit = subject.max_step
    if limit is None:
        return
    walls = {name: _walls(summary) for name, summary in subject.summaries.items()}
    for name, error in subject.unread.items():
        pointer, element = raster_place(subject, name)
        grid = subject.primitives[name].grid
        assert isinstance(grid, LinkedGrid)
        why = error.message.removeprefix(f"{grid.source.path}: ")
        yield Remark(
            pointer,
            f"no step of {quote(name)} is known: the raster {quote(grid.file)} {why}",
            error.hint,
            element=element,
        )
    tree = subject.tree
    columns = (tree.column(key) for key in ("type", "v_scale", "v_offset", "turn_deg"))
    width, height = subject.definition.extent
    level = {element for element, _, storey in storeys_of(tree) if storey.datum is True}
    kinds = cell_kinds(tree)
    shares = shares_of(kinds, (width, height))
    for index, (name, scale, offset, turn, kind) in enumerate(zip(*columns, kinds.of, strict=True)):
        if name not in walls:
            continue
        step, edge, anywhere, radial = walls[name]
        w, h = shares[kind]
        scale = min(w, h) if scale is UNSET else scale
        offset = 0.0 if offset is UNSET else offset
        w, h = w * width, h * height
        # a shape that is turned out of its cell may end anywhere: it is cut off, or leaves gaps
        moved = turn is not UNSET and turn % 180 != 0
        if moved and abs(w - h) <= _CLOSE * w:
            moved = turn % 90 != 0 and not radial
        ends: tuple[float, ...] = anywhere if moved else edge
        if index == 0 and (radial or not moved):  # the edge of the terrain makes no step
            ends = edge if radial else ()
        if index in level:
            ends = ()
        tallest = abs(scale) * step
        for value in ends:
            tallest = max(tallest, abs(scale * value + offset))
        rounding = _CLOSE * (abs(offset) + abs(scale) * max(-anywhere[0], anywhere[1]))
        if tallest > limit + rounding:
            yield Remark(
                "",
                f"the element makes a step of up to {tallest:.4g}, more than {quote(limit)}.",
                "Lower it, or let its curves end at 0 or without a step.",
                element=index,
            )


class _Walls(NamedTuple):
    """Tallest step within a shape, ranges at its edges and anywhere, and whether x is turned."""

    step: float
    edge: Range
    anywhere: Range
    radial: bool


def _walls(summary: ShapeSummary) -> _Walls:
    return _Walls(
        tallest_step(summary), edge_range(summary), value_range(summary), summary.y is None
    )
