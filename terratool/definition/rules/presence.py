"""Rules on keys that must be there, and on keys that must not."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.rules.base import Subject, rule
from terratool.definition.tree import ROOT

PLACEMENT = {
    "cellX": "cell_x", "cellY": "cell_y", "span": "span", "at": "at", "extent": "extent",
    "repeat": "repeat", "scatter": "scatter",
}  # fmt: skip
"""Attributes of the keys that place an element, by key."""


@rule("TT104", "missing-key")
def missing_key(subject: Subject) -> Iterator[Remark]:
    """A required key is absent.

    A terrain needs size, elemTree, and elemTypes unless it uses libraries; an element needs type or
    part, and cellX and cellY, or at and extent, unless it is the root or a part; a track needs path
    and width; a roughness needs rms and correlation. A vehicle needs mass, wheels with radius and
    width, axles (each with x) or wheelbase, track, cog with height, and clearance, and a battery
    capacity. A sensor needs range, a lidar elevations and azimuthStep, a camera width, height and
    fov or focal, a sonar beamWidth and threshold. Everything else has a default.

    Fails:

        {"elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"cellX": 1, "type": "box"}]}
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"cellX": 1, "cellY": 4, "type": "box"}]}
        }

    To mend: add the key to the object at that place.
    """
    definition = subject.definition
    uses = definition.use is not UNSET or subject.left_out("", "use")
    for key, value in (
        ("size", definition.size),
        ("elemTypes", "" if uses else definition.elem_types),
        ("elemTree", "" if ROOT in subject.tree.root_at else UNSET),
    ):
        if subject.is_library:
            continue
        if value is UNSET and not subject.left_out("", key):
            yield Remark("", f'the terrain has no "{key}".', f'Add "{key}".')
    tree = subject.tree
    for key, name, others in (
        ("type", "type", ("part",)),
        ("cellX", "cell_x", ("at", "extent")),
        ("cellY", "cell_y", ("at", "extent")),
    ):
        first = 0 if key == "type" else len(tree.roots)  # a root has no cell
        if tree.count_lacking(name) > first:
            column = tree.column(name)
            free = [tree.column(other) for other in others if tree.distinct(other) != {UNSET}]
            message = f'the element has no "{key}".'
            hint = f'Add "{key}".' if key == "type" else f'Add "{key}", or "at" and "extent".'
            for index, value in enumerate(column):
                if (
                    value is UNSET
                    and index >= first
                    and all(values[index] is UNSET for values in free)
                    and not subject.left_out(index, key, *others)
                ):
                    yield Remark("", message, hint, element=index)
    for index, track in enumerate(definition.ruts):
        here = f"/tracks/{index}"
        for key, absent in (("path", track.path is UNSET), ("width", track.width is UNSET)):
            if absent and not subject.left_out(here, key):
                yield Remark(here, f'the track has no "{key}".', f'Add "{key}".')


@rule("TT110", "root-placed")
def root_placed(subject: Subject) -> Iterator[Remark]:
    """The root, or a part, has a place: a cell, a span, at, extent, repeat or scatter.

    The root covers the whole terrain, and a part stands where the elements that name it stand, so
    the numbers could mean nothing.

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"cellX": 0, "type": "box"}
        }

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: remove cellX, cellY, span, at, extent, repeat and scatter there.
    """
    tree = subject.tree
    for index, pointer in enumerate(tree.roots[: len(tree)]):
        what, why = "the root", "its cell is the whole terrain"
        if pointer != ROOT:
            what, why = "the part", "its place is that of the elements that stand for it"
        for key, name in PLACEMENT.items():
            if tree.value(name, index) is not UNSET:
                message = f'{what} has "{key}", though {why}.'
                yield Remark(f"/{key}", message, f'Remove "{key}".', on_key=True, element=index)
