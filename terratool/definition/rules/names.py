"""Names that no dictionary has."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.rules.base import Subject, rule
from terratool.text.display import escape, shown

_MANY = 500
_LONG = 60


@rule("TT201", "unknown-primitive")
def unknown_primitive(subject: Subject) -> Iterator[Remark]:
    """The type of an element is a name that elemTypes does not have.

    Names are case-sensitive. A surface is no primitive, though the paper behind the format prints
    the surface pebble as a type.

    Fails:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "bxo"}}

    Fails:

        {
          "size": 10,
          "surfTypes": {"pebble": {"cohesion": 0.3, "fricAngle": 33, "sinkage": 0.05}},
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "pebble"}
        }

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: write a name that is there, in the same case, or add the primitive.
    """
    primitives, surfaces = subject.definition.primitives, subject.definition.surfaces
    if subject.definition.elem_types is UNSET:
        return
    missing = subject.tree.distinct("type") - primitives.keys() - {UNSET}
    hints = _Hints(primitives, "elemTypes")
    for index, name in subject.tree.having("type", missing):
        if name in surfaces:
            message = f"{shown(name)} is a surface, where a primitive belongs."
            hint = f'Write the primitive as "type" and "surface": {shown(name)}.'
        else:
            message, hint = f"no primitive is called {shown(name)}.", hints[name]
        yield Remark("/type", message, hint, element=index)


@rule("TT202", "unknown-surface")
def unknown_surface(subject: Subject) -> Iterator[Remark]:
    """The surface of an element or a track is a name that surfTypes does not have.

    Names are case-sensitive. The depths of a track may be given by the names of surfaces, too.

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

    To mend: write a name that is there, in the same case, or add the surface.
    """
    primitives, surfaces = subject.definition.primitives, subject.definition.surfaces
    if subject.left_out("", "surfTypes"):
        return
    missing = subject.tree.distinct("surface") - surfaces.keys() - {UNSET}
    hints = _Hints(surfaces, "surfTypes")
    for index, name in subject.tree.having("surface", missing):
        if name in primitives:
            message = f"{shown(name)} is a primitive, where a surface belongs."
            hint = f'Write "type": {shown(name)} and the surface as "surface".'
        else:
            message, hint = f"no surface is called {shown(name)}.", hints[name]
        yield Remark("/surface", message, hint, element=index)
    for index, track in enumerate(subject.definition.ruts):
        here = f"/tracks/{index}"
        if track.surface is not UNSET and track.surface not in surfaces:
            message = f"no surface is called {shown(track.surface)}."
            yield Remark(f"{here}/surface", message, hints[track.surface])
        for name in track.depth if isinstance(track.depth, dict) else ():
            if name not in surfaces:
                message = f"no surface is called {shown(name)}."
                yield Remark(f"{here}/depth/{escape(name)}", message, hints[name], on_key=True)


class _Hints(dict[str, str]):
    """What to write instead of names that a dictionary does not have."""

    def __init__(self, known: Collection[str], dictionary: str) -> None:
        self._dictionary = dictionary
        self._alike = {name.lower(): name for name in known}
        self._close = [name for name in known if len(name) <= _LONG] if len(known) <= _MANY else []

    def __missing__(self, name: str) -> str:
        close = self._alike.get(name.lower())
        # comparing more, or with more, takes longer than it helps
        if close is None and len(self) < _MANY and len(name) <= _LONG:
            from difflib import get_close_matches

            close = next(iter(get_close_matches(name, self._close, 1)), None)
        hint = f'Add {shown(name)} to "{self._dictionary}", or use a name that is there.'
        if close is not None:
            hint = f"Did you mean {shown(close)}?"
        self[name] = hint
        return hint
