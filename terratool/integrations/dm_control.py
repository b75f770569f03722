"""Arenas of dm_control's composer that are terrains."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING, Any

import terratool

if TYPE_CHECKING:
    from dm_control import composer

_NAMES = ("name", "class", "mesh", "hfield", "material")
"""Attributes of MJCF that hold names of the terrain's own."""


def terrain_arena(
    terrain: terratool.Terrain, name: str = "arena", **options: Any
) -> composer.Arena:
    """Arena of dm_control's composer that is a terrain; entities are attached to it as to others.

    Its geoms are those of `Terrain.to_mjspec`, in a body `terrain`, with ":" in place of "/" in
    their names, as composer keeps that for itself: `terrain/course:timber:block:0`.

    Args:
        terrain: a terrain.
        name: name of the arena's model.
        **options: options of `Terrain.to_mjspec`.

    Raises:
        RequestError: an option makes no sense, or there is no ground.
        ImportError: there is no dm_control.
    """
    from dm_control import composer, mjcf

    spec = terrain.to_mjspec(**options)
    root = ET.fromstring(spec.to_xml())
    root.set("model", "terrain")
    for element in root.iter():
        for key in _NAMES:
            if key in element.attrib:
                element.set(key, element.attrib[key].replace("/", ":"))
    for geom in root.iter("geom"):
        geom.set("mass", "0")  # MuJoCo does not write that of a class
    text = ET.tostring(root, encoding="unicode")
    arena = composer.Arena(name=name)
    arena.mjcf_model.attach(mjcf.from_xml_string(text, assets=dict(spec.assets)))
    return arena
