"""Canonical layout of terrains, libraries, vehicles, sensors and curricula: order and lines."""

from __future__ import annotations

import json
from typing import Any

from msgspec import structs

from terratool.definition.curriculum import CurriculumText
from terratool.definition.keys import KEYS, NESTED, document_kind
from terratool.definition.model import (
    STOREYS,
    Definition,
    Element,
    GridFile,
    Library,
    Primitive,
    Repeat,
    Surface,
    SurfaceGrid,
    Track,
)
from terratool.definition.sensor import SensorText
from terratool.definition.vehicle import VehicleText
from terratool.text import format as text_format
from terratool.text.format import Layout

_BROKEN = (Definition, Library, VehicleText, SensorText)
_ROWS = (Surface, Primitive, Element, Track)
_LAST = ("surfTypes", "elemTypes", "parts", "elemTree", "children")
"""Keys before which keys that the format does not have are put."""


def _layouts() -> dict[type, Layout]:
    """Layout of each class of the model, without specs of training tiles."""
    layouts = {}
    for kind, keys in KEYS.items():
        if isinstance(kind, str):
            continue
        order = {key: place for place, key in enumerate(keys)}
        others = min((order[key] for key in _LAST if key in order), default=len(order)) - 0.5
        layouts[kind] = Layout(order, others, broken=kind in _BROKEN, rows=kind in _ROWS)
    for kind, members in NESTED.items():
        for key, nested in members.items() if kind is not CurriculumText else ():
            layout = layouts[nested.kind]
            if nested.form in ("list", "dictionary") or key == "parts":
                layout = Layout(items=layout, broken=key != "axles")
            layouts[kind].members[key] = layout
    layouts[Element].members["repeat"] = layouts[Repeat]
    layouts[Element].members["surfaceGrid"] = structs.replace(layouts[SurfaceGrid], lined=True)
    for key, kind in STOREYS.items():
        layouts[Element].members[key] = layouts[kind]
    layouts[Primitive].members["grid"] = structs.replace(layouts[GridFile], lined=True)
    return layouts


_LAYOUTS = _layouts()
TERRAIN, VEHICLE, SENSOR = (_LAYOUTS[kind] for kind in (Definition, VehicleText, SensorText))
"""Layouts of texts; libraries have that of terrains, as their keys are some of a terrain's."""
_TILE_KIND = Layout({"kind": 0, "proportion": 1}, others=2, rows=True)
CURRICULUM = Layout(
    {key: place for place, key in enumerate(KEYS[CurriculumText])},
    others=list(KEYS[CurriculumText]).index("surface") - 0.5,
    members={
        "surface": _LAYOUTS[Surface],
        "kinds": Layout(items=_TILE_KIND, broken=True),
        "patches": Layout(broken=True),
    },
    broken=True,
    rows=True,
)


def canonical(text: str) -> str:
    """JSON text in its canonical layout, ending with a line end; the text must be valid JSON."""
    kind = document_kind(text.encode())
    others = {"vehicle": VEHICLE, "curriculum": CURRICULUM, "sensor": SENSOR}
    layout = others.get(kind or "", TERRAIN)
    return text_format.canonical(text, layout)


def primitives_text(primitives: dict[str, Any]) -> str:
    """Primitives by name as a JSON text of their own, laid out as in `elemTypes`."""
    text = json.dumps(primitives, ensure_ascii=False)
    lines = text_format.member_lines('"elemTypes"', text, TERRAIN, 1)
    lines = [line.removeprefix("  ") for line in lines]
    return "\n".join([lines[0].removeprefix('"elemTypes": '), *lines[1:], ""])
