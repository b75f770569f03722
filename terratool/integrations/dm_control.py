"""An arena of dm_control's composer that is a terrain."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

from dm_control import composer, mjcf

from terratool.api.terrain import UserTerrain

_NAMES = ("name", "class", "mesh", "hfield", "material")
"""Attributes of MJCF that hold names of the terrain's own."""


class TerrainArena(composer.Arena):  # type: ignore[misc]
    """Arena of dm_control's composer that is a terrain; entities are attached to it as to others.

    Its geoms are those of `Terrain.to_mjspec`, in a body `terrain`, with ":" in place of "/" in
    their names, as composer keeps that for itself: `terrain/course:timber:block:0`.

    Attributes:
        terrain: the terrain.
    """

    def _build(self, terrain: UserTerrain, name: str = "arena", **options: Any) -> None:
        """Make the arena.

        Args:
            terrain: a terrain.
            name: name of the arena's model.
            **options: options of `Terrain.to_mjspec`.

        Raises:
            RequestError: an option makes no sense, or there is no ground.
        """
        super()._build(name=name)
        self.terrain = terrain
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
        self.mjcf_model.attach(mjcf.from_xml_string(text, assets=dict(spec.assets)))
