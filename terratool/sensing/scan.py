"""A scan: frame after frame of what a sensor reads from its poses."""

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
from terratool.sensing.poses import Poses, check_poses, grounded
from terratool.sensing.readings import Frame, Status, disturbed, read
from terratool.sensing.sensor import Camera, Lidar, Sensor
from terratool.sensing.sonar import ping

MOST_RAYS = 1_000_000_000
"""Of all frames of a scan."""
_SLACK = 1e-6
"""Of a period: so much later the last frame may begin than the last pose is."""
_BATCH = 1 << 16
"""Poses that are looked at together."""


@dataclass(frozen=True, slots=True)
class ScanOptions:
    """How a scan is made.

    Attributes:
        on_ground: m above the ground, in place of the z of poses; None to take that.
        follow_slope: whether the sensor tilts with the ground, with `on_ground`.
        seed: of the noise; None for none.
    """

    on_ground: float | None = None
    follow_slope: bool = False
    seed: int | None = None


@dataclass(frozen=True, slots=True)
class Scan:
    """A scan that is to be made.

    Attributes:
        sensor: what reads.
        poses: where it is. Where they are timed it moves between them, and reads as often as it
            does from the first time to the last one, at which no turn begins any more; else there
            is a frame of each.
        options: how it is made.
    """

    sensor: Sensor
    poses: Poses
    options: ScanOptions = field(default_factory=ScanOptions)

    def __post_init__(self) -> None:
        """Refuse what cannot be scanned, whatever the terrain.

        Raises:
            RequestError: there are too many rays, or the options do not go together.
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
        """How many turns, pictures or pings there are."""
        if not self.poses.timed:
            return len(self.poses)
        periods = float(self.poses.times[-1] - self.poses.times[0]) * self.sensor.rate
        if self.moves:  # a turn takes time: what begins at the last one would be read at rest
            return max(math.ceil(periods - _SLACK), 1)
        return int(periods + _SLACK) + 1

    @property
    def rays(self) -> int:
        """How many rays there are in all."""
        return self.frames * self.sensor.rays

    @property
    def moves(self) -> bool:
        """Whether columns of one turn are read from different poses."""
        return self.poses.timed and len(self.poses) > 1 and isinstance(self.sensor.head, Lidar)

    def placed(self, terrain: Terrain) -> Scan:
        """The same, its poses looked at, and those between from which anything is read.

        Raises:
            RequestError: a pose is outside of the terrain, or below the ground, or has none.
        """
        self._standing(self.poses, terrain)
        if self.poses.timed:
            frames, step = self.frames, max(_BATCH // len(self._within), 1)
            for first in range(0, frames, step):
                numbers = np.arange(first, min(first + step, frames))
                self._standing(self._between(numbers), terrain)
        return self

    def read(self, terrain: Terrain, progress: Callable[[int], None] | None = None
             ) -> Iterator[Frame]:  # fmt: skip
        """Frame after frame; one at a time is in memory.

        Args:
            terrain: what is read.
            progress: is told how many rays more are done.

        Raises:
            RequestError: the sensor is outside or below the ground between two poses, or the parts
                of the terrain come to too many elements.
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
                # its own stream for each frame, so that none depends on the others
                seeds = np.random.SeedSequence([self.options.seed, number])
                generator = np.random.Generator(np.random.PCG64(seeds))
                frame = disturbed(frame, self.sensor, generator)
            yield frame
            if progress is not None:
                progress(self.sensor.rays)

    @property
    def _within(self) -> NDArray[np.float64]:
        """Times of a frame's poses from its beginning, s: one, or one for each column."""
        if self.moves:
            assert isinstance(self.sensor.head, Lidar)
            return self.sensor.head.times
        return np.zeros(1)

    def _poses(self, number: int, terrain: Terrain) -> Poses:
        """Those of a frame: one, or of a lidar that moves one for each column."""
        if self.poses.timed:
            return self._standing(self._between(np.array([number])), terrain)
        poses = self._standing(self.poses.only(number), terrain)
        return replace(poses, times=np.array([number / self.sensor.rate]))

    def _between(self, numbers: NDArray[np.int64]) -> Poses:
        """Those of frames that move, one frame after the other, z as it is given."""
        begins = self.poses.times[0] + numbers / self.sensor.rate
        times = (begins[:, None] + self._within).ravel()
        return replace(self.poses.at(times), times=times)

    def _standing(self, poses: Poses, terrain: Terrain) -> Poses:
        """The same on the ground, if that is asked for, and looked at."""
        if self.options.on_ground is not None:
            return grounded(poses, terrain, self.options.on_ground, self.options.follow_slope)
        check_poses(poses, terrain)
        return poses


@dataclass(slots=True)
class Tally:
    """What was read so far.

    Attributes:
        frames, rays: how many.
        statuses: how many rays have each `Status`.
        surfaces: how many returns each surface has, by index; the last one is none.
        walls: how many returns are of walls.
        nearest, farthest: of the readings, m.
        lacking: surfaces without `sonarRefl` that a sonar met.
    """

    surfaces: NDArray[np.int64]
    frames: int = 0
    rays: int = 0
    statuses: NDArray[np.int64] = field(default_factory=lambda: np.zeros(len(Status), np.int64))
    walls: int = 0
    nearest: float = math.inf
    farthest: float = 0.0
    lacking: frozenset[int] = frozenset()

    @classmethod
    def of(cls, terrain: Terrain) -> Tally:
        """Of nothing yet."""
        return cls(np.zeros(len(terrain.surfaces) + 1, np.int64))

    def counting(self, frames: Iterator[Frame]) -> Iterator[Frame]:
        """The same frames, counted as they pass."""
        for frame in frames:
            returns = frame.returns
            self.frames += 1
            self.rays += len(frame.status)
            self.statuses += frame.counts
            count = len(self.surfaces)
            self.surfaces += np.bincount(frame.surface[returns] % count, minlength=count)
            self.walls += int(frame.wall[returns].sum())
            if returns.any():
                self.nearest = min(self.nearest, float(frame.range[returns].min()))
                self.farthest = max(self.farthest, float(frame.range[returns].max()))
            self.lacking |= frame.lacking
            yield frame
