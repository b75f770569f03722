"""Names that no dictionary has."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from functools import lru_cache

from msgspec import UNSET

from terratool.definition.findings import Remark, shown
from terratool.definition.rules import Subject, rule

_MANY = 500


@rule("TT201", "unknown-primitive")
def unknown_primitive(subject: Subject) -> Iterator[Remark]:
    """The ``type`` of an element is a name that ``elemTypes`` does not have.

    Fails: ``"type": "hil"`` where ``elemTypes`` has ``hill``.
    Passes: ``"type": "hill"``.
    """
    primitives, surfaces = subject.definition.primitives, subject.definition.surfaces
    if subject.definition.elem_types is UNSET:
        return
    for index, element in enumerate(subject.tree.elements):
        name = element.type
        if name not in primitives and name is not UNSET:
            message = f"no primitive is called {shown(name)}."
            hint = _hint(str(name), tuple(primitives), "elemTypes")
            if name in surfaces:
                message = f"{shown(name)} is a surface, where a primitive belongs."
                hint = f'Write the primitive as "type" and "surface": {shown(name)}.'
            yield Remark(f"{subject.tree.pointer(index)}/type", message, hint)


@rule("TT202", "unknown-surface")
def unknown_surface(subject: Subject) -> Iterator[Remark]:
    """The ``surface`` of an element is a name that ``surfTypes`` does not have.

    Fails: ``"surface": "Sand"`` where ``surfTypes`` has ``sand``.
    Passes: ``"surface": "sand"``.
    """
    primitives, surfaces = subject.definition.primitives, subject.definition.surfaces
    for index, element in enumerate(subject.tree.elements):
        name = element.surface
        if name is not UNSET and name not in surfaces:
            message = f"no surface is called {shown(name)}."
            hint = _hint(str(name), tuple(surfaces), "surfTypes")
            if name in primitives:
                message = f"{shown(name)} is a primitive, where a surface belongs."
            yield Remark(f"{subject.tree.pointer(index)}/surface", message, hint)


@lru_cache(maxsize=256)
def _hint(name: str, known: tuple[str, ...], dictionary: str) -> str:
    close = [k for k in known if k.lower() == name.lower()]
    if not close and len(known) <= _MANY:  # comparing with more takes longer than it helps
        close = get_close_matches(name, known, 1)
    if close:
        return f"Did you mean {shown(close[0])}?"
    return f'Add {shown(name)} to "{dictionary}", or use a name that is there.'
