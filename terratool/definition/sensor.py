"""Sensors as they are written: frozen typed values, absent keys `UNSET`.

The classes mirror the text key by key, in its units. `terratool.sensing` builds the sensors that
are computed with.
"""

from __future__ import annotations

import math

import msgspec
from msgspec import UNSET, Struct, UnsetType

from terratool.definition.key import (
    FLAG,
    LEAST,
    MOST,
    SCHEMA,
    TEXT,
    Key,
    Shape,
    choice,
    measure,
    reserve,
)

SENSORS = ("lidar", "camera", "sonar")
"""Kinds of sensors, each a key of the text."""
PATTERNS = ("piston", "uniform")
"""Beam patterns of a sonar beside its axis: that of a round piston, or constant."""
TURN = 360.0
"""Full turn, degrees."""

RATE = 10.0
RAYS = 4096
_SLACK = 1e-9


class NoiseText(Struct, frozen=True, rename="camel", kw_only=True):
    """Noise of a sensor: standard deviation of readings, and the share that is lacking."""

    sigma: float | UnsetType = UNSET
    per_metre: float | UnsetType = UNSET
    per_square_metre: float | UnsetType = UNSET
    dropout: float | UnsetType = UNSET


class LidarText(Struct, frozen=True, rename="camel", kw_only=True):
    """Lidar: beams one above the other, which turn."""

    elevations: tuple[float, ...] | UnsetType = UNSET
    beams: int | UnsetType = UNSET
    azimuths: tuple[float, float] | UnsetType = UNSET
    azimuth_step: float | UnsetType = UNSET
    clockwise: bool | UnsetType = UNSET
    firing_interval: float | UnsetType = UNSET

    @property
    def rings(self) -> int:
        """Number of beams."""
        if self.beams is not UNSET:
            return self.beams
        return 0 if self.elevations is UNSET else len(self.elevations)

    @property
    def span(self) -> tuple[float, float]:
        """First and last azimuth, degrees, anticlockwise from ahead."""
        return (-180.0, 180.0) if self.azimuths is UNSET else self.azimuths

    @property
    def is_full(self) -> bool:
        """Whether azimuths cover a full turn, so that the last column is not the first again."""
        return self.span[1] - self.span[0] >= TURN - _SLACK

    @property
    def columns(self) -> int:
        """Number of columns of beams in a turn; 0 where it is not known."""
        if self.azimuth_step is UNSET:
            return 0
        steps = int((self.span[1] - self.span[0]) / self.azimuth_step + _SLACK)
        return max(steps, 1) if self.is_full else steps + 1

    @property
    def column_duration(self) -> float:
        """Time from the first beam of a column to its last one, s."""
        interval = 0.0 if self.firing_interval is UNSET else self.firing_interval
        return interval * max(self.rings - 1, 0)

    def column_time(self, rate: float) -> float:
        """Time from a column to the next one, s, at a rate of turns per second."""
        return math.inf if self.azimuth_step is UNSET else self.azimuth_step / (TURN * rate)


class CameraText(Struct, frozen=True, rename="camel", kw_only=True):
    """Camera: a pinhole and the pixels behind it."""

    width: int | UnsetType = UNSET
    height: int | UnsetType = UNSET
    fov: float | UnsetType = UNSET
    focal: float | tuple[float, float] | UnsetType = UNSET
    principal: tuple[float, float] | UnsetType = UNSET


class SonarText(Struct, frozen=True, rename="camel", kw_only=True):
    """Sonar: a cone of sound, and the reception of its echo."""

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
    """Sensor as it is written: a lidar, a camera or a sonar."""

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
        """Kinds of `SENSORS` that the text has; exactly one in a valid text."""
        return [kind for kind in SENSORS if getattr(self, kind) is not UNSET]

    @property
    def rays(self) -> int:
        """Number of rays of a turn, a picture or a ping; 0 where it is not known."""
        count = 0
        if self.lidar is not UNSET:
            count = max(count, self.lidar.rings * self.lidar.columns)
        if self.camera is not UNSET:
            width, height = self.camera.width, self.camera.height
            count = max(count, 0 if width is UNSET or height is UNSET else width * height)
        if self.sonar is not UNSET:
            count = max(count, RAYS if self.sonar.rays is UNSET else self.sonar.rays)
        return count


# --- keys -----------------------------------------------------------------------------------------

MAX_BEAMS = 1024
"""Most beams of a lidar, one above the other."""
MAX_PIXELS = 16384
"""Most pixels along a side of a camera's picture."""
MAX_FRAME = 10_000_000
"""Most rays of a turn, a picture or a ping: some 3 GB of memory."""
MAX_BOUNCES = 4
"""Most bounces of a sonar's rays."""
SENSOR_KEYS: dict[Shape, dict[str, Key]] = {
    SensorText: {
        "$schema": SCHEMA.describe(
            "Address of this schema, for editors; it also tells that this is a sensor.",
            "../../schemas/sensor.schema.json", default="",
        ),
        "descr": TEXT.describe(
            "What the sensor is, in a line.", "Lidar of 16 beams that turns ten times a second",
            default="",
        ),
        "range": Key(
            f"the least and the largest range [least, most] in metres, from 0 to {MOST:g}",
            "number", 0, MOST, alone=False, length=2,
        ).describe(
            "Least and largest range that it reads, m: along the beam of a lidar or a sonar, "
            "along the axis of a camera.", [0.5, 100],
        ),
        "rate": measure("turns, pictures or pings in a second", "Hz").describe(
            "Turns, pictures or pings in a second.", 20, default=RATE,
        ),
        "noise": Key("what readings are off by, an object", "object").describe(
            "What readings are off by, and how many are lacking; counts with --seed only.",
            {"sigma": 0.01, "dropout": 0.02},
        ),
        "lidar": Key("a lidar, an object", "object").describe(
            "Beams one above the other, which turn about the sensor's upright axis.",
            {"elevations": [-15, 15], "beams": 16, "azimuthStep": 0.2},
        ),
        "camera": Key("a camera, an object", "object").describe(
            "A pinhole that looks ahead, and its picture of depths.",
            {"width": 640, "height": 480, "fov": 69.4},
        ),
        "sonar": Key("a sonar, an object", "object").describe(
            "A cone of sound about the sensor's x axis, and what of its echo is heard.",
            {"beamWidth": 15, "threshold": 0.0002},
        ),
    },
    NoiseText: {
        "sigma": reserve("a standard deviation", "metres").describe(
            "Standard deviation of a reading, m.", 0.01, default=0,
        ),
        "perMetre": reserve("what a metre of range adds to the deviation", "metres").describe(
            "What each metre of range adds to the deviation, m.", 0.001, default=0,
        ),
        "perSquareMetre": reserve("what the square of the range adds to it", "metres").describe(
            "What the square of the range adds to the deviation, m; depth of stereo cameras is "
            "off by so much.", 0.002, default=0,
        ),
        "dropout": Key("a share of readings, from 0 to 1", "number", 0, 1).describe(
            "Share of readings that are lacking.", 0.02, default=0,
        ),
    },
    LidarText: {
        "elevations": Key(
            f"a list of 1 to {MAX_BEAMS} elevations in degrees, from -90 to 90", "numbers", -90,
            90, alone=False, length=MAX_BEAMS,
        ).describe(
            "Elevations of the beams over the sensor's own level, degrees, one for each, or the "
            "two between which `beams` stand; ring 0 is the first.", [-15, 15], [0],
        ),
        "beams": Key(f"a whole number from 2 to {MAX_BEAMS}", "whole", 2, MAX_BEAMS).describe(
            "How many beams stand evenly between two elevations, both included.", 16,
        ),
        "azimuths": Key(
            "two angles [from, to] in degrees, from -360 to 360", "number", -TURN, TURN,
            alone=False, length=2,
        ).describe(
            "From where to where it looks, degrees, anticlockwise seen from above, 0 ahead; all "
            "around if it is left out.", [-135, 135], default=[-180, 180],
        ),
        "azimuthStep": Key(
            "an angle in degrees, from 1e-06 to 360", "number", LEAST, TURN,
        ).describe(
            "Angle between two columns of beams, degrees.", 0.2,
        ),
        "clockwise": FLAG.describe(
            "Whether it turns clockwise, seen from above; that decides which column comes first.",
            True, default=False,
        ),
        "firingInterval": Key("a time in seconds, from 0 to 1", "number", 0, 1).describe(
            "Time between two beams of a column, s.", 2.304e-06, default=0,
        ),
    },
    CameraText: {
        "width": Key(
            f"a number of pixels, a whole number from 1 to {MAX_PIXELS}", "whole", 1, MAX_PIXELS,
        ).describe(
            "Pixels along a row.", 640,
        ),
        "height": Key(
            f"a number of pixels, a whole number from 1 to {MAX_PIXELS}", "whole", 1, MAX_PIXELS,
        ).describe(
            "Pixels along a column.", 480,
        ),
        "fov": Key(
            "the angle of view along the width in degrees, from 1e-06 to below 180", "number",
            LEAST, 180, open_high=True,
        ).describe(
            "Angle of view along the width, degrees; fx = width / (2 tan(fov / 2)), and fy is "
            "the same.", 69.4,
        ),
        "focal": Key(
            "a focal length in pixels, from 1e-06 to 1e+06, or a pair [fx, fy]", "number", LEAST,
            MOST, length=2,
        ).describe(
            "Focal length in pixels, or one along the rows and one along the columns.",
            [421.6, 421.6], 600,
        ),
        "principal": Key(
            "the place [cx, cy] of the axis in pixels, two numbers up to 1e6 in size", "number",
            -MOST, MOST, alone=False, length=2,
        ).describe(
            "Where the axis meets the picture, pixels; whole numbers are the middles of pixels. "
            "The middle of the picture if it is left out.", [319.5, 239.5],
        ),
    },
    SonarText: {
        "beamWidth": Key(
            "an angle in degrees, from 0.01 to below 180", "number", 0.01, 180, open_high=True,
        ).describe(
            "Full angle between the directions in which half of the power is sent, degrees.", 15,
        ),
        "pattern": choice("beam pattern", PATTERNS).describe(
            "How the beam falls off beside its axis: as that of a round piston, or not at all "
            "within the cone.", "uniform", default="piston",
        ),
        "cone": Key("an angle in degrees, from 0.01 to 180", "number", 0.01, 180).describe(
            "Full angle of the fan of rays, degrees; as far as the first zero of the pattern if "
            "it is left out, or 180 where that has none; of a uniform one the beam's width.", 40,
        ),
        "rays": Key("a whole number from 16 to 1,000,000", "whole", 16, 1_000_000).describe(
            "How many rays the fan has.", 1000, default=RAYS,
        ),
        "threshold": Key("an amplitude, from 1e-12 to 1e+06", "number", 1e-12, MOST).describe(
            "Amplitude that counts as an echo; 1 is that of a perfect mirror, square to the "
            "axis, in a metre.", 0.0002,
        ),
        "pulseLength": measure("a length", "metres").describe(
            "Length of the pulse in range, m: echoes within it are summed. It is half of the way "
            "that sound goes meanwhile.", 0.17, default=0.05,
        ),
        "absorption": reserve("an absorption", "dB/m").describe(
            "What the air or the water takes, dB for each metre of way.", 1.3, default=0,
        ),
        "diffuse": Key("a share, from 0 to 1", "number", 0, 1).describe(
            "Share of the echo that goes everywhere, by Lambert's law; the rest is mirrored.", 0.5,
            default=0.1,
        ),
        "lobe": Key("an angle in degrees, from 0.1 to 45", "number", 0.1, 45).describe(
            "Standard deviation of the mirrored sound about the mirrored direction, degrees.", 2,
            default=3,
        ),
        "bounces": Key(
            f"a whole number from 1 to {MAX_BOUNCES}", "whole", 1, MAX_BOUNCES,
        ).describe(
            "How often sound is followed from surface to surface.", 3, default=2,
        ),
        "sonarRefl": Key("a reflection from 0 to 1", "number", 0, 1).describe(
            "Reflection of surfaces that do not have `sonarRefl`, and of the ground without a "
            "surface.", 1, default=0.5,
        ),
    },
}  # fmt: skip
