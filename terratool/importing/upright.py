"""The axis of a mesh that points up: turning it, and telling where another one looks like it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.importing.types import Triangles

TURNED = {
    "x": "The file has x up: its y points west, and its z south.",
    "y": "The file has y up: x stays east, and its z points south.",
}
"""Sentences about files in which another axis than z is up, by that axis."""

_PIECE = 1 << 20
"""Faces whose normals are computed at once."""

_SIDEWAYS = 2.0
"""Ratio of the ground seen along the other axis and from above beyond which the note is due."""

_ONE_WAY = 0.5
"""Least share of ground that faces one way: its area up minus its area down, by the sum of both."""

_SURELY_ONE_WAY = 0.95
"""Share that makes ground of a mesh seen from above, so that it is right as it is."""

_STEEP = 0.3
"""Cosine of the slope, 72.5°, beyond which what is seen from above is no ground."""

_FLAT = 0.5
"""Share of a solid's other side in one plane from which on it is a wall, or a strip of ground."""

_SAME = 1e-6
"""Distance from a plane, as a share of the mesh's extent, within which a face lies in it."""


def turn_up(vertices: NDArray[np.float64], up: str) -> NDArray[np.float64]:
    """Return vertices, (n, 3), with z up, whose axis "x", "y" or "z" was up before."""
    x, y, z = vertices.T
    if up == "y":
        return np.stack([x, -z, y], 1)
    return np.stack([-y, -z, x], 1) if up == "x" else vertices


class _AxisView(NamedTuple):
    """Areas of a mesh as seen along an axis, those in its lowest plane apart.

    Attributes:
        sides: areas that face up and down.
        base: area in the lowest plane.
        top: area in the highest plane.
        level: mean cosine of the slope of what is not in the lowest plane.
    """

    sides: tuple[float, float]
    base: float
    top: float
    level: float

    @property
    def ground(self) -> float:
        """Area that is seen from one side more than from the other."""
        return abs(self.sides[0] - self.sides[1])

    @property
    def one_way(self) -> float:
        """Share, 0 to 1, of the faces above the lowest plane that are ground."""
        return self.ground / sum(self.sides) if any(self.sides) else 0.0

    @property
    def is_solid(self) -> bool:
        """Whether a flat underside is about as large as what stands on it."""
        return self.base > 0.5 * self.ground


def up_note(triangles: Triangles, up: str) -> tuple[str, ...]:
    """Return a sentence where the axis that is taken to be up, "y" or "z", looks wrong.

    Ground faces up nearly everywhere, on slopes that are seldom steep, while walls face all ways.
    The note is for a mesh of which that holds along the other one of the two axes alone: seen along
    that, it has more than twice as much ground, but for a flat underside. A plain slab is a wall as
    well, and gets none.

    Args:
        triangles: the mesh in the axes of its file.
        up: axis that is taken to be up.
    """
    other = "y" if up == "z" else "z"
    above, aside = _views(triangles, ("xyz".index(up), "xyz".index(other)))
    if aside.ground <= _SIDEWAYS * above.ground or aside.one_way < _ONE_WAY:
        return ()
    if aside.is_solid:
        if aside.top >= _FLAT * sum(aside.sides):
            return ()
    elif above.one_way >= _SURELY_ONE_WAY and above.level >= _STEEP:
        return ()
    return (
        f"With {up} up the mesh stands like a wall; it looks as if {other} were up in the file. If "
        f"so, say --up {other}.",
    )


def _views(triangles: Triangles, axes: tuple[int, int]) -> list[_AxisView]:
    """Look at a mesh along two axes."""
    vertices, faces = triangles.vertices, triangles.faces
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    near = _SAME * float((high - low).max())
    # up, down, base, top, squares
    sums = np.zeros((len(axes), 5))
    with np.errstate(all="ignore"):
        for begin in range(0, len(faces), _PIECE):
            corners = vertices[faces[begin : begin + _PIECE]]
            first = corners[:, 0]
            normals = np.cross(corners[:, 1] - first, corners[:, 2] - first) / 2
            areas = np.sqrt((normals**2).sum(axis=1))
            for row, axis in enumerate(axes):
                along, places = normals[:, axis], corners[:, :, axis]
                size = np.abs(along)
                base = (places <= low[axis] + near).all(axis=1) & (high[axis] > low[axis] + near)
                top = (places >= high[axis] - near).all(axis=1) & ~base
                cosines = np.divide(size, areas, out=np.zeros_like(size), where=areas > 0)
                sums[row] += (
                    along[(along > 0) & ~base].sum(),
                    -along[(along < 0) & ~base].sum(),
                    size[base].sum(),
                    size[top].sum(),
                    (size * cosines)[~base].sum(),
                )
    return [
        _AxisView((up, down), base, top, squares / (up + down) if up + down else 0.0)
        for up, down, base, top, squares in sums.tolist()
    ]
