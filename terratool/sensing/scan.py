"""Scans: frames that a sensor reads from its poses, and their tally."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.sensing.camera import camera_rays
from terratool.sensing.lidar import lidar_rays
from terratool.sensing.poses import Poses, check_poses, place_on_ground
from terratool.sensing.readings import Frame, ReadingStatus, read, with_noise
from terratool.sensing.sensor import Camera, Lidar, Sensor
from terratool.sensing.sonar import ping

MOST_RAYS = 1_000_000_000
"""Most rays of a scan, over all frames."""
_SLACK = 1e-6
"""Tolerated start of the last frame after the last pose, as a share of a period."""
_BATCH = 1 << 16
"""Most poses checked at a time."""


@dataclass(frozen=True, slots=True)
class ScanOptions:
    """Options of a scan.

    Attributes:
        on_ground: height of the sensor above the ground, m, instead of the z of poses; None to keep
            that.
        follow_slope: whether the sensor tilts with the ground; needs `on_ground`.
        seed: seed of the noise, from 0 on; None for no noise.
    """

    on_ground: float | None = None
    follow_slope: bool = False
    seed: int | None = None


@dataclass(frozen=True, slots=True)
class Scan:
    """A scan to be simulated.

    Attributes:
        sensor: sensor that scans.
        poses: poses of the sensor. Timed poses are a path, read at the sensor's rate from the first
            to the last time, at which no turn of a lidar begins; others have one frame each.
        options: placement and noise.
    """

    sensor: Sensor
    poses: Poses
    options: ScanOptions = field(default_factory=ScanOptions)

    def __post_init__(self) -> None:
        """Refuse a scan that no terrain permits.

        Raises:
            RequestError: there are too many rays, or an option is out of range or conflicts.
        """
        options = self.options
        if options.follow_slope and options.on_ground is None:
            raise RequestError(
                "--follow-slope tilts a sensor that stands on the ground.", "Add --on-ground."
            )
        height = options.on_ground
        if height is not None and not 0.0 <= height < math.inf:
            raise RequestError(
                f"The height above the ground is {height:g}.", "Give 0 or more, in metres."
            )
        if options.seed is not None and options.seed < 0:
            raise RequestError(f"The seed is {options.seed}.", "Give 0 or more.")
        if self.rays > MOST_RAYS:
            raise RequestError(
                f"{self.frames:,} frames of {self.sensor.rays:,} rays are {self.rays:,} rays, "
                f"more than {MOST_RAYS:,}.",
                "Give fewer poses, a shorter path, or a sensor with fewer rays or a lower rate.",
            )

    @property
    def frames(self) -> int:
        """Number of frames: turns, pictures or pings."""
        if not self.poses.timed:
            return len(self.poses)
        periods = float(self.poses.times[-1] - self.poses.times[0]) * self.sensor.rate
        if self.moves:  # a turn that begins at the last time would be read at rest
            return max(math.ceil(periods - _SLACK), 1)
        return int(periods + _SLACK) + 1

    @property
    def rays(self) -> int:
        """Number of rays over all frames."""
        return self.frames * self.sensor.rays

    @property
    def moves(self) -> bool:
        """Whether the columns of a turn have different poses."""
        return self.poses.timed and len(self.poses) > 1 and isinstance(self.sensor.head, Lidar)

    def check_poses(self, terrain: Terrain) -> Scan:
        """Check all poses of the scan, interpolated ones included, and return the scan itself.

        Raises:
            RequestError: a pose is outside the terrain, below the ground or above the void.
        """
        self._place(self.poses, terrain)
        if self.poses.timed:
            frames, step = self.frames, max(_BATCH // len(self._within), 1)
            for first in range(0, frames, step):
                numbers = np.arange(first, min(first + step, frames))
                self._place(self._between(numbers), terrain)
        return self

    def read(self, terrain: Terrain, progress: Callable[[int], None] | None = None
             ) -> Iterator[Frame]:  # fmt: skip
        """Yield the frames of the scan; only one is in memory at a time.

        Args:
            terrain: terrain to be scanned.
            progress: called with the number of rays done since its last call.

        Raises:
            RequestError: the sensor is outside the terrain or below the ground between two poses,
                or the terrain has too many elements.
        """
        head = self.sensor.head
        rays = None
        if isinstance(head, Lidar):
            rays = lidar_rays(head)
        elif isinstance(head, Camera):
            rays = camera_rays(head)
        for number in range(self.frames):
            poses = self._poses(number, terrain)
            if rays is None:
                frame = ping(terrain, self.sensor, poses, number)
            else:
                frame = read(terrain, self.sensor, rays, poses, number)
            if self.options.seed is not None:
                # a random stream per frame keeps frames independent
                seeds = np.random.SeedSequence([self.options.seed, number])
                generator = np.random.Generator(np.random.PCG64(seeds))
                frame = with_noise(frame, self.sensor, generator)
            yield frame
            if progress is not None:
                progress(self.sensor.rays)

    @property
    def _within(self) -> NDArray[np.float64]:
        """Times of a frame's poses from its start, s: (1,), or (columns,) for a moving lidar."""
        if self.moves:
            assert isinstance(self.sensor.head, Lidar)
            return self.sensor.head.times
        return np.zeros(1)

    def _poses(self, number: int, terrain: Terrain) -> Poses:
        """Poses of a frame: one, or one per column of a moving lidar."""
        if self.poses.timed:
            return self._place(self._between(np.array([number])), terrain)
        poses = self._place(self.poses.only(number), terrain)
        return replace(poses, times=np.array([number / self.sensor.rate]))

    def _between(self, numbers: NDArray[np.int64]) -> Poses:
        """Interpolated poses of frames of a path, frame by frame, not yet placed on the ground."""
        begins = self.poses.times[0] + numbers / self.sensor.rate
        times = (begins[:, None] + self._within).ravel()
        return replace(self.poses.at(times), times=times)

    def _place(self, poses: Poses, terrain: Terrain) -> Poses:
        """Place poses on the ground if `on_ground` is set, and check them."""
        if self.options.on_ground is not None:
            return place_on_ground(
                poses, terrain, self.options.on_ground, self.options.follow_slope
            )
        check_poses(poses, terrain)
        return poses


@dataclass(slots=True)
class ScanTally:
    """Counts over the frames read so far.

    Attributes:
        surfaces: (surfaces + 1,) number of returns by surface index; the last is for no surface.
        frames, rays: numbers of frames and rays.
        statuses: number of rays by `ReadingStatus`.
        walls: number of returns from walls.
        nearest, farthest: least and largest reading, m; inf and 0 without returns.
        lacking: indices of surfaces without `sonarRefl` that a sonar met.
    """

    surfaces: NDArray[np.int64]
    frames: int = 0
    rays: int = 0
    statuses: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros(len(ReadingStatus), np.int64)
    )
    walls: int = 0
    nearest: float = math.inf
    farthest: float = 0.0
    lacking: frozenset[int] = frozenset()

    @classmethod
    def of(cls, terrain: Terrain) -> ScanTally:
        """Empty tally for the surfaces of a terrain."""
        return cls(np.zeros(len(terrain.surfaces) + 1, np.int64))

    def count(self, frames: Iterator[Frame]) -> Iterator[Frame]:
        """Yield frames unchanged, and count each."""
        for frame in frames:
            returns = frame.returns
            self.frames += 1
            self.rays += len(frame.status)
            self.statuses += frame.counts
            ids = len(self.surfaces)
            self.surfaces += np.bincount(frame.surface[returns] % ids, minlength=ids)
            self.walls += int(frame.wall[returns].sum())
            if returns.any():
                self.nearest = min(self.nearest, float(frame.range[returns].min()))
                self.farthest = max(self.farthest, float(frame.range[returns].max()))
            self.lacking |= frame.lacking
            yield frame
