"""Whether a text is a terrain or a vehicle."""

from __future__ import annotations

import re
from typing import Literal

import msgspec

from terratool.definition.keys import KEYS
from terratool.definition.model import Definition
from terratool.definition.vehicles.keys import VEHICLE_KEYS
from terratool.definition.vehicles.model import VehicleText

Kind = Literal["terrain", "vehicle"]

_LONGEST = 1 << 20
"""Bytes from which on nothing is a vehicle, so that large terrains are not read twice."""

_named = re.compile(r"(?:^|.*[/:])(terrain|vehicle)(?:\.schema\.json)?").fullmatch
_terrain = KEYS[Definition].keys() - VEHICLE_KEYS[VehicleText].keys()
_vehicle = VEHICLE_KEYS[VehicleText].keys() - KEYS[Definition].keys()


def document_kind(data: bytes) -> Kind | None:
    """What a text is by its `$schema`, else by most of its keys; None if neither tells.

    Args:
        data: a text in UTF-8; one that is no JSON object is neither.
    """
    if len(data) > _LONGEST:
        return "terrain"
    try:
        members = msgspec.json.decode(data, type=dict[str, msgspec.Raw])
        schema = msgspec.json.decode(members.get("$schema", b"null"))
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return None
    if isinstance(schema, str) and (match := _named(schema)):
        return "vehicle" if match[1] == "vehicle" else "terrain"
    terrain, vehicle = len(_terrain & members.keys()), len(_vehicle & members.keys())
    if terrain == vehicle:
        return None
    return "vehicle" if vehicle > terrain else "terrain"
