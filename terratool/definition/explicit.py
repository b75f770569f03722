"""Heights by default, written out: texts whose elements say what their cells make of them."""

from __future__ import annotations

from terratool.definition.cell_kinds import cell_kinds, default_scales
from terratool.definition.reader import Checked
from terratool.definition.rules.base import Subject
from terratool.definition.rules.scales import default_elements
from terratool.text.edit import Edit, apply_edits
from terratool.text.locate import Address, offsets


def with_default_scales(checked: Checked, data: bytes) -> bytes:
    """Text in which each element of TT214 has the vScale that it has by default.

    Heights stay the same to the bit. Texts other than terrains, and those with errors, stay as
    they are.

    Args:
        checked: result of checking the text.
        data: the text, UTF-8 without a byte order mark.
    """
    terrain, tree, document = checked.terrain, checked.tree, checked.document
    if terrain is None or tree is None or document is None:
        return data
    elements = list(default_elements(Subject(definition=terrain, tree=tree, document=document)))
    kinds = cell_kinds(tree)
    scales = list(default_scales(kinds, terrain.extent))
    begins = offsets(data, [Address(tree.pointer(index)) for index in elements])
    return apply_edits(
        data,
        (
            Edit(begin + 1, begin + 1, f'"vScale": {scales[kinds.of[index]]!r},'.encode())
            for index, begin in zip(elements, begins, strict=True)
        ),
    )
