"""Level decks as exact boxes, for simulators that collide with a mesh elsewhere."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.mesh.types import Mesh
from terratool.report.wording import count_of
from terratool.simulators.collision.solids import PlanRectangle
from terratool.simulators.scene import Scene

CONTACTS = "collision"
"""Folder of meshes that collide, where these are not those that are seen."""

BOXES = (
    "A level deck collides as an exact box in place of its faces, with the friction of its surface."
    f" What is left of a mesh then is in the folder `{CONTACTS}`; what is seen is the whole of it."
)
_ON = 0.02
"""Distance of a corner from a side of a box that counts as none, in errors: levels of a mesh that
are hardly apart are one."""


def depth_of(box: PlanRectangle) -> float:
    """Return the distance between top and underside of a box."""
    assert box.under is not None
    return box.top - box.under


def with_boxes(count: int) -> str:
    """Return words that follow what else collides; none for no boxes."""
    return f", and {count_of(count, 'box')} for level decks" if count else ""


def box_place(scene: Scene, box: PlanRectangle) -> tuple[float, float, float]:
    """Return the place of the middle of a box in the files."""
    x, y, z = np.add(scene.offset, middle_of(box)).tolist()
    return x, y, z


def middle_of(box: PlanRectangle) -> tuple[float, float, float]:
    """Return the place of the middle of a box."""
    return *box.middle, box.top - 0.5 * depth_of(box)


def size_of(box: PlanRectangle) -> tuple[float, float, float]:
    """Return the side lengths of a box."""
    return 2.0 * box.half[0], 2.0 * box.half[1], depth_of(box)


def faces_on(mesh: Mesh, boxes: list[PlanRectangle], error: float) -> NDArray[np.bool_]:
    """Whether faces lie in a side of one of some boxes, which stands for them, (m,)."""
    found = np.zeros(len(mesh.faces), np.bool_)
    if not boxes:
        return found
    near = _ON * error
    corners = mesh.vertices[mesh.faces]
    middles = corners.mean(axis=1)
    places = shapely.STRtree(shapely.points(middles[:, :2]))
    for box in boxes:
        cos, sin = math.cos(box.turn), math.sin(box.turn)
        along, across = np.array([cos, sin]), np.array([-sin, cos])
        a, b = (half + near for half in box.half)
        signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        plan = box.middle + signs[:, :1] * a * along + signs[:, 1:] * b * across
        here = places.query(shapely.polygons(plan), predicate="intersects")
        away = corners[here] - middle_of(box)
        local = np.stack([away[..., :2] @ along, away[..., :2] @ across, away[..., 2]], axis=-1)
        half = 0.5 * np.array(size_of(box))
        within = (np.abs(local) <= half + near).all(axis=(1, 2))
        sides = [(np.abs(local - end) <= near).all(axis=1) for end in (-half, half)]
        found[here[within & np.any(sides, axis=(0, 2))]] = True
    return found
