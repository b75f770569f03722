"""Frames of readings, ray by ray: a lidar's turn, a camera's picture or a sonar's ping."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.field.rays import RayHits
from terratool.field.terrain import Terrain
from terratool.report.wording import count_of
from terratool.sensing.poses import Poses
from terratool.sensing.sensor import Sensor

Floats = NDArray[np.float64]

UNCOLORED = 0.5
"""Reflectance of surfaces without a colour, 0 to 1."""
_INSIDE = 1e-9
"""Distance before the rim at which a leaving ray is tested, as a share of its length."""


class ReadingStatus(IntEnum):
    """Outcome of a ray."""

    RETURN = 0
    """Reading within the sensor's range."""
    NEAR = 1
    """Hit nearer than the least range."""
    FAR = 2
    """Hit beyond the largest range."""
    VOID = 3
    """No hit: the ray enters the void, where there is no ground."""
    OUTSIDE = 4
    """No hit: the ray leaves the terrain over its rim, or into the sky."""
    DROPPED = 5
    """Reading lost at random, by the sensor's dropout."""
    FAINT = 6
    """Hit with an echo below the threshold."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One turn, picture or ping of n rays, in order of reading.

    Attributes:
        number: number of the frame, from 0.
        poses: pose of the sensor: one, or one per column of a moving lidar.
        shape: shape of the rays, as `Sensor.shape`; (n,) after `keep`.
        range: (n,) float64, range along the ray, or along the axis of a camera, m; NaN for none.
        local: (n, 3) float64, points in sensor axes at the time of the ray, m; NaN for none.
        points: (n, 3) float64, points in world axes, m; NaN for none.
        intensity: (n,) float32, share of light returned, 0 to 1; for a sonar the amplitude.
        ring: (n,) uint16, beam of a lidar or row of a picture.
        offset: (n,) float64, time from the first pose, s.
        surface: (n,) int32, index into `Terrain.surfaces`; -1 for none.
        element: (n,) int64, index of the element, as in `PointSamples`; those of storeys follow
            those of tracks; -1 for none.
        wall: (n,) bool, whether the hit is on a wall.
        status: (n,) uint8, `ReadingStatus`.
        lacking: indices of surfaces without `sonarRefl` that a sonar met.
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

    def __repr__(self) -> str:
        found, rays = int(self.returns.sum()), count_of(len(self.range), "ray")
        return f"<Frame {self.number}: {count_of(found, 'reading')} of {rays}>"

    @property
    def time(self) -> float:
        """Time of the first pose, s."""
        return float(self.poses.times[0])

    @property
    def returns(self) -> NDArray[np.bool_]:
        """Mask of the rays with a reading, (n,) bool."""
        returns: NDArray[np.bool_] = self.status == ReadingStatus.RETURN
        return returns

    @property
    def origins(self) -> Floats:
        """World positions of the sensor at each ray, (n, 3) float64, m."""
        count, poses = len(self.range), len(self.poses)
        return np.repeat(self.poses.positions, count // poses, axis=0)

    @property
    def counts(self) -> NDArray[np.int64]:
        """Number of rays by status, (statuses,) int64."""
        return np.bincount(self.status, minlength=len(ReadingStatus))

    def keep(self, which: NDArray[np.bool_]) -> Frame:
        """Frame of the rays that a mask, (n,) bool, selects."""
        names = ("range", "local", "points", "intensity", "ring", "offset", "surface", "element",
                 "wall", "status")  # fmt: skip
        some: dict[str, Any] = {name: getattr(self, name)[which] for name in names}
        return replace(self, shape=(int(which.sum()),), **some)


@dataclass(frozen=True, slots=True)
class Rays:
    """Rays of a frame in sensor axes.

    Attributes:
        directions: (n, 3) float64, unit directions.
        columns: (n,) index of each ray's pose, in frames with several poses.
        ring: (n,) uint16, beam of a lidar or row of a picture.
        offset: (n,) time from the start of the frame, s.
        along: (n,) range per length of the ray, 0 to 1.
    """

    directions: Floats
    columns: NDArray[np.int64]
    ring: NDArray[np.uint16]
    offset: Floats
    along: Floats


def read(terrain: Terrain, sensor: Sensor, rays: Rays, poses: Poses, number: int) -> Frame:
    """Simulate a frame of a lidar or a camera, without noise.

    Args:
        terrain: terrain around the sensor.
        sensor: lidar or camera.
        rays: rays of a frame.
        poses: one pose, or one per column.
        number: number of the frame, from 0.
    """
    which = rays.columns if len(poses) > 1 else np.zeros(len(rays.columns), np.int64)
    ways = np.einsum("nij,nj->ni", poses.matrices[which], rays.directions)
    origins = poses.positions[which]
    hits = terrain.cast(origins, ways, sensor.most / rays.along)
    range_ = hits.distance * rays.along
    status = np.zeros(len(ways), np.uint8)
    status[range_ < sensor.least] = ReadingStatus.NEAR
    missed = ~np.isfinite(hits.distance)
    if missed.any():
        status[missed] = miss_status(terrain, origins[missed], ways[missed])
    none = status != ReadingStatus.RETURN
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
        intensity=_intensities(terrain, hits, ways, none),
        ring=rays.ring,
        offset=rays.offset,
        surface=np.where(none, np.int32(-1), hits.surface),
        element=terrain.short_numbers(np.where(none, np.int64(-1), np.maximum(hits.element, -1))),
        wall=hits.wall & ~none,
        status=status,
    )


def miss_status(terrain: Terrain, origins: Floats, ways: Floats) -> NDArray[np.uint8]:
    """Statuses of rays without a hit within their range, (n,) uint8: FAR, VOID or OUTSIDE.

    A ray without any hit is in the void if it is below the ground where it leaves the terrain, or
    if it descends where there is no ground.

    Args:
        terrain: terrain below the rays.
        origins: (n, 3) origins over the terrain, m.
        ways: (n, 3) directions.
    """
    status = np.full(len(ways), ReadingStatus.OUTSIDE, np.uint8)
    status[np.isfinite(terrain.cast(origins, ways).distance)] = ReadingStatus.FAR
    west, south, east, north = terrain.bounds
    rim = np.where(ways[:, :2] > 0.0, [east, north], [west, south])
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(ways[:, :2] == 0.0, np.inf, (rim - origins[:, :2]) / ways[:, :2])
    leaves = far.min(axis=1) * (1.0 - _INSIDE)
    upright = np.isinf(leaves)
    last = origins + np.where(upright, 0.0, leaves)[:, None] * ways
    ground = terrain.ground(last[:, 0], last[:, 1])
    under = np.where(np.isnan(ground) | upright, ways[:, 2] < 0.0, last[:, 2] < ground)
    status[under & (status == ReadingStatus.OUTSIDE)] = ReadingStatus.VOID
    return status


def _intensities(
    terrain: Terrain, hits: RayHits, ways: Floats, none: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Intensities of light, (n,) float32: reflectance times cosine of incidence; 0 for misses."""
    cosine = np.abs((hits.normal * ways).sum(axis=-1))
    lit = reflectances(terrain)[hits.surface] * cosine
    return np.where(none, 0.0, lit).astype(np.float32)


def reflectances(terrain: Terrain) -> Floats:
    """Reflectances of the surfaces for light, (surfaces + 1,) float64; the last is for no surface.

    A reflectance is the relative luminance of the surface's colour: ITU-R BT.709 of sRGB by
    IEC 61966-2-1.
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


def with_noise(frame: Frame, sensor: Sensor, generator: np.random.Generator) -> Frame:
    """Frame with the sensor's noise: ranges shifted along their rays, and dropouts.

    A range shifted out of the sensor's limits is no reading; one beyond them before stays so. Two
    numbers are drawn per ray, with or without a reading, so that rays are independent.
    """
    count = len(frame.range)
    off, lot = generator.standard_normal(count), generator.random(count)
    off *= sensor.noise.deviation(frame.range)
    # a reading at range 0 has no direction, and stays
    factor = np.ones(count)
    np.divide(off, frame.range, out=factor, where=frame.range > 0.0)
    factor[frame.range > 0.0] += 1.0
    origins = frame.origins
    points = origins + (frame.points - origins) * factor[:, None]
    local, range_ = frame.local * factor[:, None], frame.range * factor
    returns, status = frame.returns, frame.status.copy()
    status[returns & (range_ < sensor.least)] = ReadingStatus.NEAR
    status[returns & (range_ > sensor.most)] = ReadingStatus.FAR
    status[returns & (lot < sensor.noise.dropout)] = ReadingStatus.DROPPED
    lost = returns & (status != ReadingStatus.RETURN)
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
