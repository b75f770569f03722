"""Sensors: lidar, depth camera or sonar, and their reading from files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from msgspec import UNSET, UnsetType
from numpy.typing import NDArray

from terratool.definition.keys import default_of, document_kind
from terratool.definition.reader import CheckOptions, check, refusal
from terratool.definition.sensor import RATE, CameraText, LidarText, SensorText, SonarText
from terratool.errors import DefinitionError
from terratool.text.source import read_source

Floats = NDArray[np.float64]

_DECIBEL = math.log(10.0) / 20.0
"""Nepers per decibel."""
_HALF_POWER = 1.61633995
"""Least x > 0 with 2 J1(x) / x = √½."""
_FIRST_ZERO = 3.83170597
"""Least x > 0 with J1(x) = 0 (Abramowitz and Stegun, table 9.5)."""
_MOST_BYTES = 1 << 20
"""Most bytes of a sensor's file."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise of ranges r, independent between rays.

    The standard deviation is sigma + per_metre · r + per_square_metre · r².

    Attributes:
        sigma: standard deviation at range r = 0, m.
        per_metre: linear growth of the deviation with range, m per m.
        per_square_metre: quadratic growth of the deviation with range, m per m².
        dropout: share of readings lost, 0 to 1.
    """

    sigma: float = 0.0
    per_metre: float = 0.0
    per_square_metre: float = 0.0
    dropout: float = 0.0

    def deviation(self, ranges: Floats) -> Floats:
        """Standard deviations at ranges (n,), m."""
        return self.sigma + ranges * (self.per_metre + ranges * self.per_square_metre)


@dataclass(frozen=True, slots=True)
class Lidar:
    """Rotating lidar: a column of beams that turns about z.

    Attributes:
        elevations: elevation of each beam, rad.
        columns: number of columns in a turn.
        first: azimuth of the first column, degrees, anticlockwise from x.
        step: azimuth from column to column, degrees; negative for clockwise.
        rate: turns per second.
        firing_interval: time between the beams of a column, s.
    """

    elevations: tuple[float, ...]
    columns: int
    first: float
    step: float
    rate: float
    firing_interval: float = 0.0

    @property
    def azimuths(self) -> Floats:
        """Azimuths of the columns in order of reading, (columns,), rad, anticlockwise from x."""
        azimuths: Floats = np.radians(self.first + np.arange(self.columns) * self.step)
        return azimuths

    @property
    def times(self) -> Floats:
        """Times of the columns from the start of the turn, (columns,), s."""
        times: Floats = np.arange(self.columns) * abs(self.step) / np.float64(360.0 * self.rate)
        return times


@dataclass(frozen=True, slots=True)
class Camera:
    """Depth camera, a pinhole that looks along x.

    Pixel (u, v), u to the right and v down, whole numbers at pixel centres, sees the point
    x = Z, y = −Z (u − cx) / fx, z = −Z (v − cy) / fy at depth Z.

    Attributes:
        width, height: size of the image, pixels.
        focal: focal lengths fx and fy, pixels.
        principal: principal point cx and cy, pixels.
    """

    width: int
    height: int
    focal: tuple[float, float]
    principal: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Sonar:
    """Sonar with one beam about x; `terratool.sensing.sonar` has the formulas.

    Attributes:
        half_power: angle from the axis at which half of the power is sent, rad.
        uniform: whether the beam is uniform within the cone; else that of a round piston.
        cone: half angle of the fan, rad.
        rays: number of rays of the fan.
        threshold: least amplitude of an echo, relative to a perfect mirror at 1 m.
        pulse_length: length of a pulse in range, m.
        absorption: absorption α, Np/m.
        diffuse: share δ of the echo by Lambert's law, 0 to 1.
        lobe: standard deviation s of the mirrored lobe, rad.
        bounces: number of surfaces on which sound is followed.
        reflection: reflection μ of surfaces without `sonarRefl`, 0 to 1.
    """

    half_power: float
    uniform: bool
    cone: float
    rays: int
    threshold: float
    pulse_length: float
    absorption: float
    diffuse: float
    lobe: float
    bounces: int
    reflection: float

    @property
    def wave_radius(self) -> float:
        """Product k a of the piston with this beam: circumference divided by wavelength."""
        return _HALF_POWER / math.sin(self.half_power)


@dataclass(frozen=True, slots=True)
class Sensor:
    """A sensor with its limits and noise.

    Attributes:
        head: lidar, camera or sonar.
        least, most: least and largest range, m.
        rate: turns, pictures or pings per second.
        noise: noise of the readings.
        descr: description in the file; empty without one.
    """

    head: Lidar | Camera | Sonar
    least: float
    most: float
    rate: float = RATE
    noise: Noise = Noise()
    descr: str = ""

    @property
    def kind(self) -> str:
        """Kind of sensor: "lidar", "camera" or "sonar"."""
        return type(self.head).__name__.lower()

    @property
    def is_planar(self) -> bool:
        """Whether the sensor is a lidar with one beam, of elevation 0."""
        return isinstance(self.head, Lidar) and self.head.elevations == (0.0,)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of a frame: (columns, beams), (height, width), or (1,) for a sonar."""
        if isinstance(self.head, Lidar):
            return self.head.columns, len(self.head.elevations)
        if isinstance(self.head, Camera):
            return self.head.height, self.head.width
        return (1,)

    @property
    def rays(self) -> int:
        """Number of rays of a turn, a picture or a ping."""
        return self.head.rays if isinstance(self.head, Sonar) else math.prod(self.shape)


def load_sensor(path: str | Path) -> Sensor:
    """Load a sensor from a file; ``-`` is standard input.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the file has errors, or is no sensor.
    """
    source = read_source(path, _MOST_BYTES, "A sensor is a short text; check the path.")
    kind = document_kind(source.data)
    if kind not in ("sensor", None):
        raise DefinitionError(
            f"{source.name}: is a {kind}, where a sensor is wanted.",
            "Name a sensor, such as samples/sensors/velodyne-vlp-16.json.",
        )
    checked = check(source, CheckOptions(warnings=False), kind="sensor")
    if checked.sensor is None:
        raise refusal(checked)
    return sensor_of(checked.sensor)


def sensor_of(text: SensorText) -> Sensor:
    """Build the sensor of a text without errors."""
    rate = RATE if text.rate is UNSET else text.rate
    head: Lidar | Camera | Sonar
    if text.lidar is not UNSET:
        head = _lidar(text.lidar, rate)
    elif text.camera is not UNSET:
        head = _camera(text.camera)
    else:
        assert text.sonar is not UNSET
        head = _sonar(text.sonar)
    assert text.range is not UNSET
    noise = Noise()
    if text.noise is not UNSET:
        given = {name: getattr(text.noise, name) for name in text.noise.__struct_fields__}
        noise = Noise(**{name: value for name, value in given.items() if value is not UNSET})
    descr = "" if text.descr is UNSET else text.descr
    return Sensor(head, *text.range, rate, noise, descr)


def _lidar(text: LidarText, rate: float) -> Lidar:
    assert text.elevations is not UNSET and text.azimuth_step is not UNSET
    elevations = np.array(text.elevations)
    if text.beams is not UNSET:
        elevations = np.linspace(elevations[0], elevations[1], text.beams)
    first, last = text.span
    clockwise = text.clockwise is True
    return Lidar(
        elevations=tuple(np.radians(elevations).tolist()),
        columns=text.columns,
        first=last if clockwise else first,
        step=-text.azimuth_step if clockwise else text.azimuth_step,
        rate=rate,
        firing_interval=0.0 if text.firing_interval is UNSET else text.firing_interval,
    )


def _camera(text: CameraText) -> Camera:
    assert text.width is not UNSET and text.height is not UNSET
    if text.fov is not UNSET:
        focal: float | tuple[float, float] = 0.5 * text.width / math.tan(math.radians(text.fov) / 2)
    else:
        assert text.focal is not UNSET
        focal = text.focal
    middle = 0.5 * (text.width - 1), 0.5 * (text.height - 1)
    return Camera(
        text.width,
        text.height,
        focal if isinstance(focal, tuple) else (focal, focal),
        middle if text.principal is UNSET else text.principal,
    )


def _sonar(text: SonarText) -> Sonar:
    assert text.beam_width is not UNSET and text.threshold is not UNSET

    def given(value: float | UnsetType, key: str) -> float:
        """Value of a key, or its default."""
        return float(default_of(SonarText, key) if isinstance(value, UnsetType) else value)

    half_power, uniform = math.radians(text.beam_width) / 2.0, text.pattern == "uniform"
    if uniform:
        cone = half_power
    else:  # as far as the first zero
        sine = math.sin(half_power) * _FIRST_ZERO / _HALF_POWER
        cone = math.asin(sine) if sine < 1.0 else math.pi / 2.0
    return Sonar(
        half_power=half_power,
        uniform=uniform,
        cone=cone if text.cone is UNSET else math.radians(text.cone) / 2.0,
        rays=int(given(text.rays, "rays")),
        threshold=text.threshold,
        pulse_length=given(text.pulse_length, "pulseLength"),
        absorption=given(text.absorption, "absorption") * _DECIBEL,
        diffuse=given(text.diffuse, "diffuse"),
        lobe=math.radians(given(text.lobe, "lobe")),
        bounces=int(given(text.bounces, "bounces")),
        reflection=given(text.sonar_refl, "sonarRefl"),
    )
