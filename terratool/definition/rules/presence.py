"""Keys that must be there, and keys that must not."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.rules import Subject, rule


@rule("TT104", "missing-key")
def missing_key(subject: Subject) -> Iterator[Remark]:
    """A required key is absent.

    A terrain needs ``size``, ``elemTypes`` and ``elemTree``; an element ``type``, and ``cellX`` and
    ``cellY`` unless it is the root.

    Fails: ``{"type": "box", "cellX": 1}`` as a child.
    Passes: ``{"type": "box", "cellX": 1, "cellY": 4}``.
    """
    definition = subject.definition
    for key, value in (
        ("size", definition.size),
        ("elemTypes", definition.elem_types),
        ("elemTree", definition.elem_tree),
    ):
        if value is UNSET:
            yield _missing("", "the terrain", key)
    for index, element in enumerate(subject.tree.elements):
        if element.type is UNSET:
            yield _missing(subject.tree.pointer(index), "the element", "type")
        if index and element.cell_x is UNSET:
            yield _missing(subject.tree.pointer(index), "the element", "cellX")
        if index and element.cell_y is UNSET:
            yield _missing(subject.tree.pointer(index), "the element", "cellY")


def _missing(pointer: str, what: str, key: str) -> Remark:
    return Remark(pointer, f'{what} has no "{key}".', f'Add "{key}".', missing=key)


@rule("TT110", "root-placed")
def root_placed(subject: Subject) -> Iterator[Remark]:
    """The root covers the whole terrain, so it has no cell and no span.

    Fails: ``"elemTree": {"type": "slope", "cellX": 0, "cellY": 0}``.
    Passes: ``"elemTree": {"type": "slope"}``.
    """
    for root in subject.tree.elements[:1]:
        for key, value in (("cellX", root.cell_x), ("cellY", root.cell_y), ("span", root.span)):
            if value is not UNSET:
                yield Remark(
                    f"/elemTree/{key}",
                    f'the root has a "{key}", though its cell is the whole terrain.',
                    f'Remove "{key}".',
                    on_key=True,
                )
