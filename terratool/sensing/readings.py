"""What a sensor reads at once, ray by ray: a lidar's turn, a camera's picture, a sonar's ping."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.field.rays import RayHits
from terratool.field.terrain import Terrain
from terratool.sensing.poses import Poses
from terratool.sensing.sensor import Sensor

Floats = NDArray[np.float64]

UNCOLORED = 0.5
"""What the ground reflects of light where its surface has no colour."""
_INSIDE = 1e-9
"""How far before the rim a ray that leaves is looked at, in parts of its way."""


class Status(IntEnum):
    """What became of a ray."""

    RETURN = 0
    """It has a reading."""
    NEAR = 1
    """It met something nearer than the least range."""
    FAR = 2
    """It met something beyond the largest range."""
    VOID = 3
    """It went into the void, where there is no ground."""
    OUTSIDE = 4
    """It left the terrain over its rim, or into the sky."""
    DROPPED = 5
    """Its reading is lacking by chance."""
    FAINT = 6
    """It met something whose echo is too weak."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One turn, picture or ping of n rays, in the order in which they are read.

    Attributes:
        number: of the frame, from 0.
        poses: where the sensor was: one, or one for each column of a lidar that moves.
        shape: of the rays, as `Sensor.shape`.
        range: (n,) float64, m: along the ray, of a camera along its axis; NaN where none is.
        local: (n, 3) float64, points in the sensor's axes at the time of each; NaN where none is.
        points: (n, 3) float64, the same in the world.
        intensity: (n,) float32, from 0 to 1: what comes back of light; of a sonar its amplitude.
        ring: (n,) uint16, the beam of a lidar or the row of a picture.
        offset: (n,) float64, s from the first pose.
        surface: (n,) int32, index into `Terrain.surfaces`; -1 for none.
        element: (n,) int64, as `PointSamples` has it; -1 for none.
        wall: (n,) bool, whether it is a wall.
        status: (n,) uint8, a `Status`.
        lacking: surfaces without `sonarRefl` that a sonar met, by index.
    """

    number: int
    poses: Poses
    shape: tuple[int, ...]
    range: Floats
    local: Floats
    points: Floats
    intensity: NDArray[np.float32]
    ring: NDArray[np.uint16]
    offset: Floats
    surface: NDArray[np.int32]
    element: NDArray[np.int64]
    wall: NDArray[np.bool_]
    status: NDArray[np.uint8]
    lacking: frozenset[int] = frozenset()

    @property
    def time(self) -> float:
        """S."""
        return float(self.poses.times[0])

    @property
    def returns(self) -> NDArray[np.bool_]:
        """(n,) which rays have a reading."""
        returns: NDArray[np.bool_] = self.status == Status.RETURN
        return returns

    @property
    def origins(self) -> Floats:
        """(n, 3) where the sensor was at each ray."""
        count, poses = len(self.range), len(self.poses)
        return np.repeat(self.poses.positions, count // poses, axis=0)

    @property
    def counts(self) -> NDArray[np.int64]:
        """How many rays have each status."""
        return np.bincount(self.status, minlength=len(Status))

    def kept(self, which: NDArray[np.bool_]) -> Frame:
        """Some of the rays."""
        names = ("range", "local", "points", "intensity", "ring", "offset", "surface", "element",
                 "wall", "status")  # fmt: skip
        some: dict[str, Any] = {name: getattr(self, name)[which] for name in names}
        return replace(self, shape=(int(which.sum()),), **some)


@dataclass(frozen=True, slots=True)
class Rays:
    """Where the rays of a sensor go, in its own axes.

    Attributes:
        directions: (n, 3) float64, of length 1.
        columns: (n,) which pose of `Frame.poses` each has, where there are several.
        ring: (n,) uint16.
        offset: (n,) s from the beginning.
        along: (n,) what of a ray's length counts as its range.
    """

    directions: Floats
    columns: NDArray[np.int64]
    ring: NDArray[np.uint16]
    offset: Floats
    along: Floats


def read(terrain: Terrain, sensor: Sensor, rays: Rays, poses: Poses, number: int) -> Frame:
    """What a lidar or a camera reads, exactly.

    Args:
        terrain: what it sees.
        sensor: what sees.
        rays: its rays.
        poses: one, or one for each column.
        number: of the frame.
    """
    which = rays.columns if len(poses) > 1 else np.zeros(len(rays.columns), np.int64)
    ways = np.einsum("nij,nj->ni", poses.matrices[which], rays.directions)
    origins = poses.positions[which]
    hits = terrain.cast(origins, ways, sensor.most / rays.along)
    range_ = hits.distance * rays.along
    status = np.zeros(len(ways), np.uint8)
    status[range_ < sensor.least] = Status.NEAR
    missed = ~np.isfinite(hits.distance)
    if missed.any():
        status[missed] = passed(terrain, origins[missed], ways[missed])
    none = status != Status.RETURN
    range_[none] = np.nan
    local = rays.directions * (range_ / rays.along)[:, None]
    points = np.where(none[:, None], np.nan, hits.point)
    return Frame(
        number=number,
        poses=poses,
        shape=sensor.shape,
        range=range_,
        local=local,
        points=points,
        intensity=_lit(terrain, hits, ways, none),
        ring=rays.ring,
        offset=rays.offset,
        surface=np.where(none, np.int32(-1), hits.surface),
        element=np.where(none | (hits.element < 0), np.int64(-1), hits.element),
        wall=hits.wall & ~none,
        status=status,
    )


def passed(terrain: Terrain, origins: Floats, ways: Floats) -> NDArray[np.uint8]:
    """What became of rays that met nothing within their range: FAR, VOID or OUTSIDE.

    A ray that meets nothing at all has gone into the void if it is below the ground where it
    leaves the terrain, or if there is none and it leads down.

    Args:
        terrain: what they passed.
        origins: (n, 3) where they began, over the terrain.
        ways: (n, 3) where they went.
    """
    status = np.full(len(ways), Status.OUTSIDE, np.uint8)
    status[np.isfinite(terrain.cast(origins, ways).distance)] = Status.FAR
    west, south, east, north = terrain.bounds
    rim = np.where(ways[:, :2] > 0.0, [east, north], [west, south])
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(ways[:, :2] == 0.0, np.inf, (rim - origins[:, :2]) / ways[:, :2])
    leaves = far.min(axis=1) * (1.0 - _INSIDE)
    upright = np.isinf(leaves)
    last = origins + np.where(upright, 0.0, leaves)[:, None] * ways
    ground = terrain.height(last[:, 0], last[:, 1])
    under = np.where(np.isnan(ground) | upright, ways[:, 2] < 0.0, last[:, 2] < ground)
    status[under & (status == Status.OUTSIDE)] = Status.VOID
    return status


def _lit(
    terrain: Terrain, hits: RayHits, ways: Floats, none: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """What comes back of light: the surface's reflectance by the cosine of incidence."""
    cosine = np.abs((hits.normal * ways).sum(axis=-1))
    lit = reflectances(terrain)[hits.surface] * cosine
    return np.where(none, 0.0, lit).astype(np.float32)


def reflectances(terrain: Terrain) -> Floats:
    """(surfaces + 1,) what each surface reflects of light, the last one that of no surface.

    The relative luminance of its colour, of ITU-R BT.709 by IEC 61966-2-1.
    """
    found = []
    for name in terrain.surfaces:
        color = terrain.surface_types[name].color
        if color is UNSET:
            found.append(UNCOLORED)
            continue
        shares = np.array(color) / 255.0
        linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
        found.append(float(linear @ [0.2126, 0.7152, 0.0722]))
    return np.array([*found, UNCOLORED])


def disturbed(frame: Frame, sensor: Sensor, generator: np.random.Generator) -> Frame:
    """The same with the noise of the sensor: readings off along their rays, or lacking.

    What it moves out of the sensor's range is no reading. What is out of it without noise stays so.
    Two numbers are drawn for each ray, read or not, so that none depends on the others.
    """
    count = len(frame.range)
    off, lot = generator.standard_normal(count), generator.random(count)
    off *= sensor.noise.deviation(frame.range)
    # one that is where the sensor is stays there, as its ray has no direction any more
    factor = np.ones(count)
    np.divide(off, frame.range, out=factor, where=frame.range > 0.0)
    factor[frame.range > 0.0] += 1.0
    origins = frame.origins
    points = origins + (frame.points - origins) * factor[:, None]
    local, range_ = frame.local * factor[:, None], frame.range * factor
    returns, status = frame.returns, frame.status.copy()
    status[returns & (range_ < sensor.least)] = Status.NEAR
    status[returns & (range_ > sensor.most)] = Status.FAR
    status[returns & (lot < sensor.noise.dropout)] = Status.DROPPED
    lost = returns & (status != Status.RETURN)
    points[lost], local[lost], range_[lost] = np.nan, np.nan, np.nan
    return replace(
        frame,
        range=range_,
        local=local,
        points=points,
        status=status,
        intensity=np.where(lost, np.float32(0.0), frame.intensity),
        surface=np.where(lost, np.int32(-1), frame.surface),
        element=np.where(lost, np.int64(-1), frame.element),
        wall=frame.wall & ~lost,
    )
