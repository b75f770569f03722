"""Rules on names that no dictionary has."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import cached_property

from msgspec import UNSET

from terratool.definition.findings import Remark, RemarkBatch
from terratool.definition.rules.base import Subject, faces_of, rule
from terratool.text.display import escape, only_answer, quote
from terratool.text.meaning import spelled_like

_MANY = 500
_LONG = 60


@rule("TT201", "unknown-primitive")
def unknown_primitive(subject: Subject) -> Iterator[Remark | RemarkBatch]:
    """The type of an element is a name that elemTypes does not have, here or in a library.

    Names are case-sensitive. A surface is no primitive, though the paper behind the format prints
    the surface pebble as a type. The under of a deck and the roof of a bore are primitives, too.
    While a library is missing, nothing is said.

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
    primitives, surfaces = subject.primitives, subject.surfaces
    if subject.lacks_library or subject.left_out("", "elemTypes"):
        return
    lacks = subject.definition.elem_types is UNSET and subject.definition.use is UNSET
    if lacks and not subject.is_library:  # TT104 reports a missing dictionary
        return
    missing = subject.tree.distinct("type") - primitives.keys() - {UNSET}
    hints = NameHints(primitives, "elemTypes")

    def remark_on(index: int, pointer: str, name: str) -> Remark:
        is_type = pointer == "/type"
        if name in surfaces:
            message = f"{quote(name)} is a surface, where a primitive belongs."
            hint, fix = f'Write the primitive as "type" and "surface": {quote(name)}.', ""
        elif name in subject.uses.names.parts:
            message = f"{quote(name)} is a part, where a primitive belongs."
            hint, fix = f'Write "part": {quote(name)} in place of "type".', ""
        else:
            message, (hint, fix) = f"no primitive is called {quote(name)}.", hints[name]
            return Remark(pointer, message, hint, element=index, fix=fix)
        hint = hint if is_type else "Write the name of a primitive."
        return Remark(pointer, message, hint, element=index, fix=fix)

    def remark(index: int) -> Remark:
        return remark_on(index, "/type", subject.tree.value("type", index))

    yield RemarkBatch([index for index, _ in subject.tree.elements_with("type", missing)], remark)
    for index, pointer, name in faces_of(subject.tree):
        if name not in primitives:
            yield remark_on(index, pointer, name)


@rule("TT202", "unknown-surface")
def unknown_surface(subject: Subject) -> Iterator[Remark | RemarkBatch]:
    """The surface of an element or a track is a name that no surfTypes has, here or in a library.

    Names are case-sensitive. The depths of a track may be given by the names of surfaces, too, and
    the names of a surfaceGrid are those of surfaces. While a library is missing, nothing is said.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {
            "type": "box", "surface": "sand",
            "children": [{"cellX": 0, "cellY": 0, "type": "box", "surface": "Sand"}]
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
    primitives, surfaces = subject.primitives, subject.surfaces
    if subject.lacks_library or subject.left_out("", "surfTypes"):
        return
    missing = subject.tree.distinct("surface") - surfaces.keys() - {UNSET}
    hints = NameHints(surfaces, "surfTypes")

    def remark(index: int) -> Remark:
        name = subject.tree.value("surface", index)
        if name in primitives:
            message = f"{quote(name)} is a primitive, where a surface belongs."
            hint, fix = f'Write "type": {quote(name)} and the surface as "surface".', ""
        else:
            message, (hint, fix) = f"no surface is called {quote(name)}.", hints[name]
        return Remark("/surface", message, hint, element=index, fix=fix)

    found = [index for index, _ in subject.tree.elements_with("surface", missing)]
    yield RemarkBatch(found, remark)
    lacking = {
        grid
        for grid in subject.tree.distinct("surface_grid") - {UNSET}
        if not surfaces.keys() >= set(grid.names.values())
    }
    for index, grid in subject.tree.elements_with("surface_grid", lacking):
        for key, name in grid.names.items():
            if name not in surfaces:
                hint, fix = hints[name]
                yield Remark(
                    f"/surfaceGrid/names/{escape(key)}",
                    f"no surface is called {quote(name)}.", hint, element=index, fix=fix,
                )  # fmt: skip
    for index, track in enumerate(subject.definition.ruts):
        here = f"/tracks/{index}"
        if track.surface is not UNSET and track.surface not in surfaces:
            message = f"no surface is called {quote(track.surface)}."
            hint, fix = hints[track.surface]
            yield Remark(f"{here}/surface", message, hint, fix=fix)
        for name in track.depth if isinstance(track.depth, dict) else ():
            if name not in surfaces:
                message = f"no surface is called {quote(name)}."
                hint, fix = hints[name]
                pointer = f"{here}/depth/{escape(name)}"
                yield Remark(pointer, message, hint, on_key=True, fix=fix)


class NameHints(dict[str, tuple[str, str]]):
    """Hints and fixes for names that a dictionary does not have, by the unknown name.

    A fix is JSON text, and empty unless one known name alone is similar.
    """

    def __init__(self, known: Collection[str], dictionary: str) -> None:
        self._known = known
        self._dictionary = dictionary

    @cached_property
    def _alike(self) -> dict[str, list[str]]:
        """Known names by their lower-case forms."""
        alike: dict[str, list[str]] = {}
        for name in self._known:
            alike.setdefault(name.lower(), []).append(name)
        return alike

    @cached_property
    def _close(self) -> list[str]:
        """Known names that unknown ones are compared with; empty where there are too many."""
        known = self._known
        return [name for name in known if len(name) <= _LONG] if len(known) <= _MANY else []

    def __missing__(self, name: str) -> tuple[str, str]:
        close = self._alike.get(name.lower(), [])
        # comparing more, or with more, takes longer than it helps
        if not close and len(self) < _MANY and len(name) <= _LONG:
            close = spelled_like(name, self._close)
        hint = (
            f'Add {quote(name)} to "{self._dictionary}", or its library to "use", '
            "or write a name that is there."
        )
        if close:
            hint = f"Did you mean {quote(close[0])}?"
        self[name] = hint, only_answer(name, close)
        return self[name]
