"""Names that no dictionary has."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark, shown
from terratool.definition.rules import Subject, rule

_MANY = 500
_LONG = 60


@rule("TT201", "unknown-primitive")
def unknown_primitive(subject: Subject) -> Iterator[Remark]:
    """The type of an element is a name that elemTypes does not have.

    A surface is no primitive: the printed example of the paper behind the format has the surface
    pebble as a type.

    Fails:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "bxo"}}

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: write a name that is there, in its own case, or add the primitive.
    """
    primitives, surfaces = subject.definition.primitives, subject.definition.surfaces
    if subject.definition.elem_types is UNSET:
        return
    told = {}
    for name in subject.tree.distinct("type") - primitives.keys() - {UNSET}:
        told[name] = f"no primitive is called {shown(name)}.", _hint(name, primitives, "elemTypes")
        if name in surfaces:
            told[name] = (
                f"{shown(name)} is a surface, where a primitive belongs.",
                f'Write the primitive as "type" and "surface": {shown(name)}.',
            )
    for index, name in subject.tree.having("type", told):
        yield Remark("/type", *told[name], element=index)


@rule("TT202", "unknown-surface")
def unknown_surface(subject: Subject) -> Iterator[Remark]:
    """The surface of an element is a name that surfTypes does not have.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {
            "type": "box", "surface": "sand",
            "children": [{"type": "box", "surface": "Sand", "cellX": 0, "cellY": 0}]
          }
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "surface": "sand"}
        }

    To mend: write a name that is there, in its own case, or add the surface.
    """
    primitives, surfaces = subject.definition.primitives, subject.definition.surfaces
    if subject.left_out("", "surfTypes"):
        return
    told = {}
    for name in subject.tree.distinct("surface") - surfaces.keys() - {UNSET}:
        told[name] = f"no surface is called {shown(name)}.", _hint(name, surfaces, "surfTypes")
        if name in primitives:
            told[name] = (
                f"{shown(name)} is a primitive, where a surface belongs.",
                f'Write "type": {shown(name)} and the surface as "surface".',
            )
    for index, name in subject.tree.having("surface", told):
        yield Remark("/surface", *told[name], element=index)


def _hint(name: str, known: Collection[str], dictionary: str) -> str:
    from difflib import get_close_matches

    close = [k for k in known if k.lower() == name.lower()]
    # comparing with more takes longer than it helps
    if not close and len(known) <= _MANY and len(name) <= _LONG:
        close = get_close_matches(name, [k for k in known if len(k) <= _LONG], 1)
    if close:
        return f"Did you mean {shown(close[0])}?"
    return f'Add {shown(name)} to "{dictionary}", or use a name that is there.'
