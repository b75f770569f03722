"""Ground at points that count from an origin, in float32, by a terrain's own kernels on a CPU."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.types import TerrainField


class HostSample(NamedTuple):
    """Ground at points; arrays in the points' shape.

    Attributes:
        height: (…) float32, above the origin's height; NaN outside and in the void.
        normal: (…, 3) float32, upward unit normals; NaN where the height is NaN.
        surface: (…) int32, index into `Terrain.surfaces`; -1 for none.
        friction: (…) float32, coefficient of friction; NaN where the height is NaN.
    """

    height: NDArray[np.float32]
    normal: NDArray[np.float32]
    surface: NDArray[np.int32]
    friction: NDArray[np.float32]


class HostField(NamedTuple):
    """A terrain on a CPU, for points of fields on a device: float32 or float64, (…, 2) or (…, 3).

    Of points in space, (…, 3), the highest tops that are not above them count.

    Attributes:
        terrain: terrain that is asked.
        origin: world position of the zero of points and heights.
        friction: (surfaces + 1,) float32, as `frictions_of` has it.
    """

    terrain: TerrainField
    origin: tuple[float, float, float]
    friction: NDArray[np.float32]

    def height(self, points: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
        """Heights at points, above the origin's."""
        return self._from_origin(self.terrain.height(*self._world(points)))

    def sample(self, points: NDArray[np.floating[Any]]) -> HostSample:
        """Height, normal, surface and friction at points."""
        at = self.terrain.sample(*self._world(points))
        friction = np.where(np.isnan(at.height), np.float32(np.nan), self.friction[at.surface + 1])
        normal = at.normal.astype(np.float32)
        surface = np.asarray(at.surface)
        return HostSample(self._from_origin(at.height), normal, surface, friction)

    def slopes(self, points: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
        """Slopes of the ground along x and y at points, (…, 2); NaN without ground."""
        normal = self.terrain.sample(*self._world(points)).normal
        with np.errstate(divide="ignore", invalid="ignore"):  # a vertical tangent
            return np.asarray(-normal[..., :2] / normal[..., 2:])

    def _world(self, points: NDArray[np.floating[Any]]) -> list[NDArray[np.float64]]:
        """World coordinates of points, each by itself."""
        along = np.moveaxis(points, -1, 0)
        return [
            np.add(x, zero, dtype=np.float64) for x, zero in zip(along, self.origin, strict=False)
        ]

    def _from_origin(self, height: Any) -> NDArray[np.float32]:
        """Heights above the origin's height."""
        found = np.empty(np.shape(height), np.float32)
        np.subtract(height, self.origin[2], out=found, casting="same_kind")
        return found
