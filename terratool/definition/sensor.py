"""What the user wrote of a sensor, as frozen typed values; absent keys are `UNSET`.

The classes mirror the text key by key, in its units. `terratool.sensing` makes of them the sensor
that is computed with.
"""

from __future__ import annotations

import math

import msgspec
from msgspec import UNSET, Struct, UnsetType

SENSORS = ("lidar", "camera", "sonar")
"""What a sensor may be: a key of its text each."""
PATTERNS = ("piston", "uniform")
"""How a sonar's beam falls off beside its axis: as that of a round plate, or not at all."""
TURN = 360.0
"""Degrees."""

RATE = 10.0
RAYS = 4096
CONE = 90.0
"""Degrees: no fan is wider than this from its axis."""
_SLACK = 1e-9


class NoiseText(Struct, frozen=True, rename="camel", kw_only=True):
    """How far readings are off, and how many are lacking."""

    sigma: float | UnsetType = UNSET
    per_metre: float | UnsetType = UNSET
    per_square_metre: float | UnsetType = UNSET
    dropout: float | UnsetType = UNSET


class LidarText(Struct, frozen=True, rename="camel", kw_only=True):
    """Beams one above the other, which turn."""

    elevations: tuple[float, ...] | UnsetType = UNSET
    beams: int | UnsetType = UNSET
    azimuths: tuple[float, float] | UnsetType = UNSET
    azimuth_step: float | UnsetType = UNSET
    clockwise: bool | UnsetType = UNSET
    firing_interval: float | UnsetType = UNSET

    @property
    def rings(self) -> int:
        """How many beams there are."""
        if self.beams is not UNSET:
            return self.beams
        return 0 if self.elevations is UNSET else len(self.elevations)

    @property
    def span(self) -> tuple[float, float]:
        """From where to where it looks, degrees, anticlockwise from ahead."""
        return (-180.0, 180.0) if self.azimuths is UNSET else self.azimuths

    @property
    def is_full(self) -> bool:
        """Whether it looks all around, so that the last column is not the first one again."""
        return self.span[1] - self.span[0] >= TURN - _SLACK

    @property
    def columns(self) -> int:
        """How many columns of beams a turn has; 0 where that is not known."""
        if self.azimuth_step is UNSET:
            return 0
        steps = int((self.span[1] - self.span[0]) / self.azimuth_step + _SLACK)
        return max(steps, 1) if self.is_full else steps + 1

    @property
    def firing(self) -> float:
        """Time from the first beam of a column to its last one, s."""
        interval = 0.0 if self.firing_interval is UNSET else self.firing_interval
        return interval * max(self.rings - 1, 0)

    def column_time(self, rate: float) -> float:
        """Time from a column to the next one at so many turns in a second, s."""
        return math.inf if self.azimuth_step is UNSET else self.azimuth_step / (TURN * rate)


class CameraText(Struct, frozen=True, rename="camel", kw_only=True):
    """A pinhole and pixels behind it."""

    width: int | UnsetType = UNSET
    height: int | UnsetType = UNSET
    fov: float | UnsetType = UNSET
    focal: float | tuple[float, float] | UnsetType = UNSET
    principal: tuple[float, float] | UnsetType = UNSET


class SonarText(Struct, frozen=True, rename="camel", kw_only=True):
    """A cone of sound, and what of its echo is heard."""

    beam_width: float | UnsetType = UNSET
    pattern: str | UnsetType = UNSET
    cone: float | UnsetType = UNSET
    rays: int | UnsetType = UNSET
    threshold: float | UnsetType = UNSET
    pulse_length: float | UnsetType = UNSET
    absorption: float | UnsetType = UNSET
    diffuse: float | UnsetType = UNSET
    lobe: float | UnsetType = UNSET
    bounces: int | UnsetType = UNSET
    sonar_refl: float | UnsetType = UNSET


class SensorText(Struct, frozen=True, rename="camel", kw_only=True):
    """One sensor: a lidar, a camera or a sonar."""

    schema: str | UnsetType = msgspec.field(default=UNSET, name="$schema")
    descr: str | UnsetType = UNSET
    range: tuple[float, float] | UnsetType = UNSET
    rate: float | UnsetType = UNSET
    noise: NoiseText | UnsetType = UNSET
    lidar: LidarText | UnsetType = UNSET
    camera: CameraText | UnsetType = UNSET
    sonar: SonarText | UnsetType = UNSET

    @property
    def kinds(self) -> list[str]:
        """Which of `SENSORS` it has; one, if it is in order."""
        return [kind for kind in SENSORS if getattr(self, kind) is not UNSET]

    @property
    def rays(self) -> int:
        """How many rays a turn, a picture or a ping has; 0 where that is not known."""
        count = 0
        if self.lidar is not UNSET:
            count = max(count, self.lidar.rings * self.lidar.columns)
        if self.camera is not UNSET:
            width, height = self.camera.width, self.camera.height
            count = max(count, 0 if width is UNSET or height is UNSET else width * height)
        if self.sonar is not UNSET:
            count = max(count, RAYS if self.sonar.rays is UNSET else self.sonar.rays)
        return count
