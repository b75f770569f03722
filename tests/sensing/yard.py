"""A yard with nothing symmetric about it, and small sensors in it."""

from __future__ import annotations

from typing import Any

from terratool.definition.reader import check
from terratool.sensing.poses import one_pose
from terratool.sensing.readings import Frame
from terratool.sensing.scan import Scan, ScanOptions
from terratool.sensing.sensor import Sensor, sensor_of
from terratool.text.source import Source
from tests.conftest import terrain_of, text_of

# Ground at 0.5 from (100, 200) to (140, 224). A brick block, 3 high, whose west face is x = 128 for
# y from 205 to 211; one of steel, 2 high, whose south face is y = 219 for x from 107 to 113; a hole
# from (131, 218) to (137, 222).
YARD: dict[str, Any] = {
    "size": [40, 24],
    "origin": [100, 200],
    "surfTypes": {
        "snow": {"color": [255, 255, 255]},
        "brick": {"color": [255, 0, 0], "sonarRefl": 0.81},
        "steel": {"sonarRefl": 0.25},
        "hole": {"void": True},
    },
    "elemTypes": {"flat": {"x": [1]}},
    "elemTree": {
        "type": "flat", "vScale": 0.5, "surface": "snow",
        "children": [
            {"at": [30, 8], "extent": [4, 6], "type": "flat", "vScale": 3, "surface": "brick"},
            {"at": [10, 20], "extent": [6, 2], "type": "flat", "vScale": 2, "surface": "steel"},
            {"at": [34, 20], "extent": [6, 4], "type": "flat", "vScale": 1, "surface": "hole"},
        ],
    },
}  # fmt: skip
TERRAIN = terrain_of(YARD)
SNOW, BRICK, STEEL = 0, 1, 2
HERE = (110.0, 207.0, 1.7)
"""1.2 over the ground, 18 from the brick to the east and 12 from the steel to the north."""

LEVEL: dict[str, Any] = {"elevations": [0], "azimuthStep": 90}


def sensor(**keys: Any) -> Sensor:
    """A sensor of a valid text with these keys, that reads from 0.1 to 100 m if not said."""
    text = {"range": [0.1, 100], **keys}
    checked = check(Source("sensor.json", text_of(text).encode()), kind="sensor")
    assert checked.sensor is not None, checked.findings
    return sensor_of(checked.sensor)


def frames(what: Sensor, *poses: tuple[float, ...], **options: Any) -> list[Frame]:
    """What it reads of the yard from poses of rest."""
    from terratool.sensing.poses import Poses

    where = Poses.join(list(map(one_pose, poses)))
    return list(Scan(what, where, ScanOptions(**options)).check_poses(TERRAIN).read(TERRAIN))


def frame(what: Sensor, *angles: float, **options: Any) -> Frame:
    """What it reads from `HERE`, turned by yaw, pitch and roll."""
    (one,) = frames(what, (*HERE, *(*angles, 0.0, 0.0, 0.0)[:3]), **options)
    return one
