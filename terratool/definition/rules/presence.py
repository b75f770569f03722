"""Keys that must be there, and keys that must not."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.rules.base import Subject, rule


@rule("TT104", "missing-key")
def missing_key(subject: Subject) -> Iterator[Remark]:
    """A required key is absent.

    A terrain needs size, elemTypes and elemTree; an element needs type, and cellX and cellY unless
    it is the root; a track needs path and width; a roughness needs rms and correlation. A vehicle
    needs mass, wheels with radius and width, axles (each with x) or wheelbase, track, cog with
    height, and clearance. Everything else has a default.

    Fails:

        {"elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"type": "box", "cellX": 1}]}
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"type": "box", "cellX": 1, "cellY": 4}]}
        }

    To mend: add the key to the object at that place.
    """
    definition = subject.definition
    for key, value in (
        ("size", definition.size),
        ("elemTypes", definition.elem_types),
        ("elemTree", UNSET if len(subject.tree) == 0 else ""),
    ):
        if value is UNSET and not subject.left_out("", key):
            yield Remark("", f'the terrain has no "{key}".', f'Add "{key}".')
    tree = subject.tree
    for key, name in (("type", "type"), ("cellX", "cell_x"), ("cellY", "cell_y")):
        first = key != "type"  # the root has no cell
        if UNSET in tree.distinct(name) and (column := tree.column(name)).count(UNSET) > first:
            message, hint = f'the element has no "{key}".', f'Add "{key}".'
            for index, value in enumerate(column):
                if value is UNSET and index >= first and not subject.left_out(index, key):
                    yield Remark("", message, hint, element=index)
    for index, track in enumerate(definition.ruts):
        here = f"/tracks/{index}"
        for key, absent in (("path", track.path is UNSET), ("width", track.width is UNSET)):
            if absent and not subject.left_out(here, key):
                yield Remark(here, f'the track has no "{key}".', f'Add "{key}".')


@rule("TT110", "root-placed")
def root_placed(subject: Subject) -> Iterator[Remark]:
    """The root has a cell or a span, though it covers the whole terrain.

    It stands in no grid, so the numbers could mean nothing.

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "cellX": 0}
        }

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: remove cellX, cellY and span from the root.
    """
    if len(subject.tree) == 0:
        return
    for key, name in (("cellX", "cell_x"), ("cellY", "cell_y"), ("span", "span")):
        if subject.tree.value(name, 0) is not UNSET:
            yield Remark(
                f"/{key}",
                f'the root has a "{key}", though its cell is the whole terrain.',
                f'Remove "{key}".',
                on_key=True,
                element=0,
            )
