"""Whether the values of fields are what their types say."""

from __future__ import annotations

import numpy as np

from terratool.importing.vrml.nodes import WIDTHS, FieldValue, Proto
from terratool.importing.vrml.text import VrmlText

_INT32 = 2**31
_MEANING = {
    **dict.fromkeys(WIDTHS, "numbers"),
    "Bool": "TRUE or FALSE",
    "Image": "numbers",
    "Node": "a node, or NULL",
    "String": "a text in quotation marks",
}


def check(text: VrmlText, value: FieldValue, kind: str, name: str, proto: Proto | None) -> None:
    """Refuse the value of a field that is not of its type.

    Args:
        text: where it stands.
        value: what was read; a name behind IS counts as what it was declared.
        kind: the type, as MFVec3f.
        name: what the field is called.
        proto: in whose body it stands; None outside of all.

    Raises:
        ReadError: it is of another type, has too few or too many numbers, or broken integers.
    """
    plain, single = kind[2:], kind.startswith("S")
    if value.kind == "field":
        fits = proto is not None and proto.types[value.name] == kind
    elif plain == "Node":
        fits = value.kind == "empty" or (
            value.kind == "nodes" and not (single and len(value.nodes) > 1)
        )
    elif plain == "Bool":
        fits = value.kind == "flag"
    else:
        wanted = "strings" if plain == "String" else "numbers"
        fits = value.kind == wanted or (value.kind == "empty" and not single)
    if not fits:
        raise text.error(value.at, f'"{name}" is no {kind}.', f"Write {_MEANING[plain]}.")
    if value.kind != "numbers" or plain not in WIDTHS:
        return
    width, count = WIDTHS[plain], len(value.numbers)
    if count % width or (single and count != width):
        many = f"{width}" if single else f"a multiple of {width}"
        raise text.error(
            value.at,
            f'"{name}" has {count:,} numbers, and not {many}.',
            "A number is missing, or there is one too many.",
        )
    if plain == "Int32":
        numbers = value.numbers
        wrong = (numbers != np.floor(numbers)) | (numbers < -_INT32) | (numbers >= _INT32)
        if wrong.any():
            text.at = text.place_of(value.at, int(np.argmax(wrong)))
            raise text.error(
                text.at, f"{text.shown()} is no integer of 32 bits.", "Write a whole number."
            )
