"""Rules on sensors that are none, or whose figures contradict each other."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.rules.base import SensorSubject, rule
from terratool.definition.sensor import MAX_FRAME, RATE, SENSORS, TURN
from terratool.report.wording import join_words
from terratool.text.display import quote

_SLACK = 1.0 + 1e-9
"""Slack for rounding, where the last beam of a column fires with the next column."""


@rule("TT901", "no-single-sensor", kind="sensor")
def no_single_sensor(subject: SensorSubject) -> Iterator[Remark]:
    """A sensor is none of lidar, camera and sonar, or more than one of them.

    Fails:

        {"$schema": "sensor.schema.json", "range": [0.1, 30], "rate": 40}

    Fails:

        {
          "range": [0.1, 30],
          "lidar": {"elevations": [0], "azimuthStep": 0.25},
          "camera": {"width": 640, "height": 480, "fov": 70}
        }

    Passes:

        {"range": [0.1, 30], "lidar": {"elevations": [0], "azimuthStep": 0.25}}

    To mend: give one of the three; write a file for each sensor of a robot.
    """
    if subject.left_out("", *SENSORS):
        return
    kinds = subject.sensor.kinds
    if not kinds:
        yield Remark(
            "", "the sensor is no lidar, camera or sonar.", 'Add "lidar", "camera" or "sonar".'
        )
    for kind in kinds[1:]:
        yield Remark(
            f"/{kind}",
            f"the sensor is a {kinds[0]}, and a {kind}, too.",
            "Write a file for each of them.",
            on_key=True,
        )


@rule("TT902", "reversed-sensor-range", kind="sensor")
def reversed_sensor_range(subject: SensorSubject) -> Iterator[Remark]:
    """A range of a sensor does not end above where it begins, or is more than a turn.

    Looked at are its range and, of a lidar, its azimuths, which span 360 degrees at most.

    Fails:

        {"range": [30, 0.1], "lidar": {"elevations": [0], "azimuthStep": 0.25}}

    Fails:

        {
          "range": [0.1, 30],
          "lidar": {"elevations": [0], "azimuths": [-135, 300], "azimuthStep": 0.25}
        }

    Passes:

        {
          "range": [0.1, 30],
          "lidar": {"elevations": [0], "azimuths": [-135, 135], "azimuthStep": 0.25}
        }

    To mend: write the smaller number first.
    """
    sensor, lidar = subject.sensor, subject.sensor.lidar
    pairs = [("/range", "range", sensor.range)]
    if lidar is not UNSET:
        pairs.append(("/lidar/azimuths", "azimuths", lidar.azimuths))
    for pointer, key, pair in pairs:
        if pair is UNSET:
            continue
        least, most = pair
        if least >= most:
            yield Remark(
                pointer,
                f'"{key}" goes from {quote(least)} to {quote(most)}, which is not above it.',
                "Write the smaller number first.",
            )
        elif key == "azimuths" and most - least > TURN:
            yield Remark(
                pointer,
                f'"{key}" spans {quote(most - least)} degrees, more than a turn.',
                "Let it span 360 at most; without the key a lidar looks all around.",
            )


@rule("TT903", "beams-of-a-list", kind="sensor")
def beams_of_a_list(subject: SensorSubject) -> Iterator[Remark]:
    """A lidar says how many beams it has beside elevations that are not two.

    beams spreads so many evenly between two elevations. A list of other elevations has a beam for
    each, and needs no number.

    Fails:

        {"range": [0.1, 30], "lidar": {"elevations": [-15, 0, 15], "beams": 3, "azimuthStep": 1}}

    Passes:

        {"range": [0.1, 30], "lidar": {"elevations": [-15, 15], "beams": 16, "azimuthStep": 1}}

    Passes:

        {"range": [0.1, 30], "lidar": {"elevations": [-15, 0, 15], "azimuthStep": 1}}

    To mend: remove beams, or give the lowest and the highest elevation alone.
    """
    lidar = subject.sensor.lidar
    if lidar is UNSET or lidar.beams is UNSET or lidar.elevations is UNSET:
        return
    count = len(lidar.elevations)
    if count != 2:
        are = "is one elevation" if count == 1 else f"are {count} elevations"
        yield Remark(
            "/lidar/beams",
            f'"beams" spreads beams between two elevations, but there {are}.',
            'Remove "beams", or give the lowest and the highest elevation alone.',
        )


@rule("TT904", "too-many-rays", kind="sensor")
def too_many_rays(subject: SensorSubject) -> Iterator[Remark]:
    """A turn or a picture has more than 10,000,000 rays.

    What they meet would not fit into the memory of most machines.

    Fails:

        {
          "range": [0.1, 30],
          "lidar": {"elevations": [-15, 15], "beams": 128, "azimuthStep": 0.001}
        }

    Passes:

        {
          "range": [0.1, 30],
          "lidar": {"elevations": [-15, 15], "beams": 128, "azimuthStep": 0.1}
        }

    To mend: give a coarser azimuthStep, fewer beams or fewer pixels.
    """
    count = subject.sensor.rays
    if count > MAX_FRAME:
        kind = "camera" if subject.sensor.lidar is UNSET else "lidar"
        what = "a picture" if kind == "camera" else "a turn"
        yield Remark(
            f"/{kind}",
            f"{what} has {count:,} rays, more than {MAX_FRAME:,}.",
            "Give fewer pixels."
            if kind == "camera"
            else 'Give a coarser "azimuthStep" or fewer beams.',
        )


@rule("TT905", "two-lenses", kind="sensor")
def two_lenses(subject: SensorSubject) -> Iterator[Remark]:
    """A camera has both an angle of view and a focal length.

    One follows from the other: fx = width / (2 tan(fov / 2)).

    Fails:

        {"range": [0.3, 3], "camera": {"width": 640, "height": 480, "fov": 70, "focal": 457}}

    Passes:

        {"range": [0.3, 3], "camera": {"width": 640, "height": 480, "focal": [457, 457]}}

    To mend: remove one of them.
    """
    camera = subject.sensor.camera
    if camera is not UNSET and camera.fov is not UNSET and camera.focal is not UNSET:
        yield Remark(
            "/camera/fov",
            f"{join_words(['fov', 'focal'])} both say how wide the camera looks.",
            "Remove one of them.",
            on_key=True,
        )


@rule("TT906", "slow-firing", kind="sensor")
def slow_firing(subject: SensorSubject) -> Iterator[Remark]:
    """The beams of a lidar's column fire so slowly that the next column comes before the last one.

    A column begins azimuthStep / (360 · rate) seconds after the one before it. Its last beam fires
    (beams − 1) · firingInterval after its first one. All of a column is read from one pose, which
    would be that of another column.

    Fails:

        {
          "range": [0.1, 30],
          "rate": 10,
          "lidar": {
            "elevations": [-15, 15], "beams": 16, "azimuthStep": 0.2, "firingInterval": 4e-6
          }
        }

    Passes:

        {
          "range": [0.1, 30],
          "rate": 10,
          "lidar": {
            "elevations": [-15, 15], "beams": 16, "azimuthStep": 0.2, "firingInterval": 2.304e-6
          }
        }

    To mend: give a shorter firingInterval, a coarser azimuthStep or a lower rate.
    """
    sensor, lidar = subject.sensor, subject.sensor.lidar
    if lidar is UNSET or subject.left_out("", "rate"):
        return
    column = lidar.column_time(RATE if sensor.rate is UNSET else sensor.rate)
    if lidar.column_duration > column * _SLACK:
        yield Remark(
            "/lidar/firingInterval",
            f"the last beam of a column fires {lidar.column_duration:.4g} s after the first, but "
            f"the next column comes after {column:.4g} s.",
            'Give a shorter "firingInterval", a coarser "azimuthStep" or a lower "rate".',
        )
