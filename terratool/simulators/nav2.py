"""A map for Nav2: a picture of cells that are free, occupied or unknown, and its metadata.

The conventions are those of nav2_map_server (github.com/ros-navigation/navigation2,
`nav2_map_server/src/map_io.cpp`: `loadMapFromFile`), which are those of map_server in ROS 1
(wiki.ros.org/map_server): the first row of pixels is the north; `origin` is where the lower left
pixel has its lower left corner; a pixel of brightness b is occupied to p = (255 − b)/255. Above
`occupied_thresh` that is occupied, below `free_thresh` free, and between them unknown. 205 is
p = 0.19608: unknown at a `free_thresh` of 0.196, but free at 0.25.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.report.numbers import metres, never_quite
from terratool.simulators.obstacles import FREE, OCCUPIED, UNKNOWN, DrivingLimits, occupancy
from terratool.simulators.scene import Scene
from terratool.simulators.targets import WrittenFiles
from terratool.traversability.verdicts import GroundClass

BRIGHTNESS = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}
"""Brightness of pixels by occupancy, as map_saver writes them."""

_NAMES = {FREE: "free", OCCUPIED: "occupied", UNKNOWN: "unknown"}

_UNKNOWN_NOTE = (
    "Void, and what lies outside, is unknown (205), not free. Planners of Nav2 may plan through "
    "unknown cells: say `allow_unknown: false` to the planner and `track_unknown_space: true` to "
    "the costmap. Keep free_thresh at 0.196: with 0.25 unknown cells are read as free."
)
_LIMITS_NOTE = (
    "A cell is {side} wide (--resolution). It is occupied where a slope in it is steeper than "
    "{slope:g}° (--max-slope) or a wall higher than {step} (--max-step) stands in it; a wall on "
    "the line between two cells is in the upper one. The relief of rough surfaces counts; "
    "--no-roughness leaves it out."
)
_VEHICLE_NOTE = (
    "A cell is {side} wide (--resolution). It says whether the middle of the vehicle, {vehicle}, "
    "may stand there, with one heading at least; its length and width are in that already, so the "
    "costmap needs no inflation for them. Occupied is what "
    "it cannot be driven on, what it cannot get to from the largest part of the ground, or cannot "
    "come back from, and where it would stand over the edge. Unknown is what has no ground, or "
    "soil that is not known."
)


def check(scene: Scene) -> None:
    """Refuse cells that no map can have.

    Raises:
        RequestError: the cells are too many or too large, or do not go with the vehicle.
    """
    scene.cells()


def write(scene: Scene, folder: Path) -> WrittenFiles:
    """Write map.yaml and map.pgm.

    Raises:
        RequestError: `check` refuses the cells.
    """
    options, terrain = scene.options, scene.terrain
    grid, verdict = scene.cells(), scene.verdict
    side = metres(grid.resolution)
    if verdict is None:
        scene.say("looking for slopes and walls")
        driven = DrivingLimits.of(options.max_slope, options.max_step)
        cells = occupancy(terrain, grid, driven, scene.crew)
        by: dict[str, Any] = {"max_slope": options.max_slope, "max_step": options.max_step}
        limits = f"slopes of {options.max_slope:g}° and steps of {metres(options.max_step)}"
        notes = _LIMITS_NOTE.format(
            side=side, slope=options.max_slope, step=metres(options.max_step)
        )
        losses = _limits_losses(grid.resolution)
    else:
        cells = np.where(verdict.drivable, np.int8(FREE), np.int8(OCCUPIED))
        cells[verdict.classes == GroundClass.UNKNOWN] = UNKNOWN
        by, limits = {**verdict.facts}, verdict.vehicle
        notes = _VEHICLE_NOTE.format(side=side, vehicle=verdict.vehicle)
        losses = _VEHICLE_LOSS, *filter(None, [verdict.lacking])
    _write_pgm(folder / "map.pgm", cells)
    x, y, _ = scene.zero
    origin = [grid.west - x, grid.south - y, 0.0]
    (folder / "map.yaml").write_text(_yaml(grid.resolution, origin), "utf-8", newline="\n")
    shares = {name: float((cells == value).mean()) for value, name in _NAMES.items()}
    said = ", ".join(f"{never_quite(share)} {name}" for name, share in shares.items())
    return WrittenFiles(
        summary=f"{grid.width} × {grid.height} cells of {side} for {limits}: {said}",
        load=(
            "ros2 run nav2_map_server map_server --ros-args -p yaml_filename:=map.yaml",
            "# in another terminal",
            "ros2 run nav2_util lifecycle_bringup map_server",
        ),
        language="sh",
        notes=(notes, _UNKNOWN_NOTE),
        losses=losses,
        facts={
            "map": {
                "width": grid.width,
                "height": grid.height,
                "resolution": grid.resolution,
                "origin": origin,
                "shares": shares,
                **by,
            }
        },
        meshed=False,
        frictions=(),
    )


_VEHICLE_LOSS = (
    "A cell has one verdict for all headings, that of the best; what lies between the middles of "
    "cells, and between headings, is not looked at."
)


def _limits_losses(resolution: float) -> tuple[str, ...]:
    return (
        "Heights, slopes and surfaces are not in the map.",
        "The level top of something high is free, with occupied cells around it.",
        f"Slopes are looked at every {metres(0.5 * resolution)}, and at crests; pits narrower than "
        "that, and corners that reach into a cell by less, may be missed.",
    )


def _write_pgm(path: Path, cells: NDArray[np.int8]) -> None:
    """Write a picture of cells, (height, width) from the north."""
    height, width = cells.shape
    pixels = np.full(cells.shape, BRIGHTNESS[UNKNOWN], np.uint8)
    for value, brightness in BRIGHTNESS.items():
        pixels[cells == value] = brightness
    with open(path, "wb") as file:
        file.write(b"P5\n%d %d\n255\n" % (width, height))
        file.write(pixels.tobytes())


def _yaml(resolution: float, origin: list[float]) -> str:
    return (
        "image: map.pgm\n"
        "mode: trinary\n"
        f"resolution: {json.dumps(resolution)}\n"
        f"origin: {json.dumps(origin)}\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n"
    )
