"""Elements that add nothing, and elements that add too tall a step."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark, shown
from terratool.definition.profiles import edge_ranges, outline_of, tallest_step, value_range
from terratool.definition.rules import Subject, rule


@rule("TT210", "zero-scale", "warning")
def zero_scale(subject: Subject) -> Iterator[Remark]:
    """The vScale of an element is 0, so that its primitive has no effect.

    Fails:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "vScale": 0}}

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "vScale": 0.2}}

    To mend: give the height that is meant; where only the surface or vOffset is, silence TT210 by
    x-ignore.
    """
    for index, _ in subject.tree.having("v_scale", (0,)):
        yield Remark(
            "/vScale",
            '"vScale" is 0, so the primitive has no effect.',
            'Give a height, or say with "x-ignore": ["TT210"] that only the rest is meant.',
            element=index,
        )


@rule("TT211", "tall-step", "warning")
def tall_step(subject: Subject) -> Iterator[Remark]:
    """An element makes a vertical step taller than the limit given by --max-step.

    A step is a jump inside of its curves, or its height above or below what is around where its
    footprint ends. Each element is looked at by itself: what stands beside it may make up for the
    step. The edge of the root is that of the terrain and no step. Without --max-step nothing is
    looked at.

    Fails with --max-step 0.15:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {
            "type": "box",
            "children": [{"type": "box", "cellX": 0, "cellY": 0, "vScale": 0.2}]
          }
        }

    Passes with --max-step 0.15:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}, "mound": {"x": "cosbell", "y": []}},
          "elemTree": {
            "type": "box",
            "children": [{"type": "mound", "cellX": 0, "cellY": 0, "vScale": 0.2}]
          }
        }

    To mend: lower vScale or vOffset, or let the curves end at 0 or without a step.
    """
    limit = subject.max_step
    if limit is None:
        return
    scales = _default_scales(subject)
    outlines = {name: outline_of(p) for name, p in subject.definition.primitives.items()}
    tree = subject.tree
    for index, name in enumerate(tree.column("type")):
        outline = outlines.get(name)
        if outline is None:
            continue
        scale, offset, turn = (
            tree.column(key)[index] for key in ("v_scale", "v_offset", "turn_deg")
        )
        scale = scales[index] if scale is UNSET else scale
        offset = 0.0 if offset is UNSET else offset
        turn = 0.0 if turn is UNSET else turn
        step = abs(scale) * tallest_step(outline)
        ranges = []
        if turn % 90 != 0 and outline.y is not None:
            ranges = [value_range(outline)]  # its cell cuts it somewhere
        elif index or outline.y is None:
            ranges = edge_ranges(outline)
        step = max([step, *(abs(scale * value + offset) for pair in ranges for value in pair)])
        if step > limit * (1 + 1e-9):
            yield Remark(
                "",
                f"the element makes a step of up to {step:.4g}, more than {shown(limit)}.",
                "Lower it, or let its curves end at 0 or without a step.",
                element=index,
            )


def _default_scales(subject: Subject) -> list[float]:
    """What vScale is where it is left out: side of the cell over side of the terrain."""
    tree = subject.tree
    sides = [(1.0, 1.0)] * len(tree)
    for parent, begin, end in tree.families:
        grid, (width, height) = tree.grid(parent), sides[parent]
        for index in range(begin, end):
            _, _, columns, rows = tree.block(index)
            sides[index] = width * columns / grid[0], height * rows / grid[1]
    return list(map(min, sides))
