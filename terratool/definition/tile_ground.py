"""Ground of training tiles, as a terrain for rules about surfaces."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from msgspec import UNSET, structs

from terratool.definition.decode import Decoded
from terratool.definition.findings import Owner, Remark, RemarkBatch, RemarkLog
from terratool.definition.libraries import SourceDocument
from terratool.definition.model import Definition, Element, Primitive
from terratool.definition.rules.base import CurriculumSubject, Subject
from terratool.definition.tree import flatten
from terratool.text.source import Source

_FLOOR = "/surfTypes/floor"
"""Pointer of the surface in that terrain."""


def ground_subject(subject: CurriculumSubject) -> Subject | None:
    """Level terrain with the spec's surface, for rules about surfaces; None without a surface."""
    surface = subject.curriculum.surface
    if surface is UNSET:
        return None
    terrain = Definition(
        size=1.0,
        surf_types={"floor": surface},
        elem_types={"level": Primitive(x=(1.0,))},
        elem_tree=Element(type="level", surface="floor", v_scale=1.0),
    )
    tree = flatten(terrain)
    document = SourceDocument(
        Source("the spec", b""), Decoded(terrain, tree=tree), RemarkLog(0), kind="terrain"
    )
    unfit: dict[str, Collection[Owner]] = {
        key: {
            _FLOOR + owner.removeprefix("/surface")
            for owner in owners
            if isinstance(owner, str) and owner.startswith("/surface")
        }
        for key, owners in subject.unfit.items()
    }
    return Subject(definition=terrain, tree=tree, document=document, unfit=unfit)


def on_ground(remarks: Iterator[Remark | RemarkBatch]) -> Iterator[Remark]:
    """Remarks on the surface of that terrain, moved to the surface of the spec."""
    for remark in remarks:
        if isinstance(remark, RemarkBatch):  # on elements alone
            continue
        if remark.element < 0 and remark.pointer.startswith(_FLOOR):
            yield structs.replace(remark, pointer="/surface" + remark.pointer.removeprefix(_FLOOR))
