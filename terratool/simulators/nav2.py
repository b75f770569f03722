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
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.raster.grid import Grid
from terratool.report.markup import markdown_row
from terratool.report.numbers import metres, never_quite
from terratool.report.wording import count_of, decks_and_bores
from terratool.simulators.obstacles import FREE, OCCUPIED, UNKNOWN, DrivingLimits, occupancy
from terratool.simulators.scene import Scene
from terratool.simulators.storey_cells import height_ranges
from terratool.simulators.storey_obstacles import storey_occupancy
from terratool.simulators.targets import WrittenFiles
from terratool.traversability.judge import CellVerdict
from terratool.traversability.map_files import storey_paths
from terratool.traversability.notes import headroom_note
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
_STOREYS_NOTE = (
    "map.yaml has the lowest tops: the ground, below decks too, and the ground over a bore. The "
    "maps of storeys have the tops of decks and the floors of bores, in the same cells; where they "
    "have none is unknown. Those in one map do not lie over each other. A ramp ends where it meets "
    "the next floor, and the robot changes its map there: the service /map_server/load_map does so."
)


def check(scene: Scene) -> None:
    """Refuse cells that no map can have.

    Raises:
        RequestError: the cells are too many or too large, or do not go with the vehicle.
    """
    scene.cells()


def write(scene: Scene, folder: Path) -> WrittenFiles:
    """Write map.yaml and map.pgm, and those of each sheet of storeys.

    Raises:
        RequestError: `check` refuses the cells.
    """
    options, terrain = scene.options, scene.terrain
    grid, verdict = scene.cells(), scene.verdict
    side = metres(grid.resolution)
    if verdict is None:
        scene.say("looking for slopes and walls")
        driven = DrivingLimits.of(options.max_slope, options.max_step)
        if terrain.storeys is None:
            maps = [occupancy(terrain, grid, driven, scene.crew)]
        else:
            maps = [*storey_occupancy(terrain, grid, driven, scene.crew)]
        by: dict[str, Any] = {"max_slope": options.max_slope, "max_step": options.max_step}
        limits = f"slopes of {options.max_slope:g}° and steps of {metres(options.max_step)}"
        notes = _LIMITS_NOTE.format(
            side=side, slope=options.max_slope, step=metres(options.max_step)
        )
        losses = _limits_losses(grid.resolution)
    else:
        maps = [_cells_of(one) for one in (verdict, *verdict.storeys)]
        by, limits = {**verdict.facts}, verdict.vehicle
        notes = _VEHICLE_NOTE.format(side=side, vehicle=verdict.vehicle)
        losses = _VEHICLE_LOSS, *filter(None, [verdict.lacking])
    x, y, _ = scene.zero
    origin = [grid.west - x, grid.south - y, 0.0]
    for name, cells in zip(_names_of(len(maps)), maps, strict=True):
        _write_pgm(folder / f"{name}.pgm", cells)
        yaml = _yaml(name, grid.resolution, origin)
        (folder / f"{name}.yaml").write_text(yaml, "utf-8", newline="\n")
    shares = [_shares(cells) for cells in maps]
    summary = f"{grid.width} × {grid.height} cells of {side} for {limits}: {_said(shares[0])}"
    facts: dict[str, Any] = {
        "map": {
            "width": grid.width,
            "height": grid.height,
            "resolution": grid.resolution,
            "origin": origin,
            "shares": shares[0],
            **by,
        }
    }
    more: tuple[str, ...] = ()
    if terrain.storeys is not None:
        scene.say("taking the heights of decks and bores")
        facts["storeys"] = _storey_facts(scene, grid, shares)
        summary += f"; {count_of(len(maps) - 1, 'map')} of decks and bores"
        more = _STOREYS_NOTE, _table(facts["storeys"])
        losses = *losses, *_storey_losses(scene, grid.resolution)
    return WrittenFiles(
        summary=summary,
        load=(
            "ros2 run nav2_map_server map_server --ros-args -p yaml_filename:=map.yaml",
            "# in another terminal",
            "ros2 run nav2_util lifecycle_bringup map_server",
        ),
        language="sh",
        notes=(notes, _UNKNOWN_NOTE, *more),
        losses=losses,
        facts=facts,
        meshed=False,
        frictions=(),
    )


def _cells_of(verdict: CellVerdict) -> NDArray[np.int8]:
    """Cells as a vehicle judges them."""
    cells = np.where(verdict.drivable, np.int8(FREE), np.int8(OCCUPIED))
    cells[verdict.classes == GroundClass.UNKNOWN] = UNKNOWN
    return cells


def _names_of(maps: int) -> list[str]:
    """Names of maps without a suffix: that of the lowest tops, and one of each sheet."""
    return [Path(name).stem for name in storey_paths("map.yaml", maps)]


def _shares(cells: NDArray[np.int8]) -> dict[str, float]:
    return {name: float((cells == value).mean()) for value, name in _NAMES.items()}


def _said(shares: Mapping[str, float]) -> str:
    return ", ".join(f"{never_quite(share)} {name}" for name, share in shares.items())


def _storey_facts(
    scene: Scene, grid: Grid, shares: Sequence[Mapping[str, float]]
) -> list[dict[str, Any]]:
    """Facts on the map of each sheet: its file, decks or bores, heights of cells, and shares."""
    storeys = scene.terrain.storeys
    assert storeys is not None
    ranges = height_ranges(scene.terrain, grid, scene.crew)
    zero = scene.zero[2]
    return [
        {
            "file": f"{name}.yaml",
            "bores" if sheet.is_bore else "decks": len(
                np.unique(sheet.storeys[sheet.storeys >= 0])
            ),
            "heights": None if heights is None else [height - zero for height in heights],
            "shares": own,
        }
        for name, sheet, heights, own in zip(
            _names_of(len(shares))[1:], storeys.sheets, ranges, shares[1:], strict=True
        )
    ]


def _table(storeys: Sequence[Mapping[str, Any]]) -> str:
    """Markdown table of the maps of storeys."""
    lines = ["| map | has | heights of tops | cells |", "|---|---|---|---|"]
    for one in storeys:
        counts = decks_and_bores(one.get("decks", 0), one.get("bores", 0))
        heights = "none at a cell's middle"
        if one["heights"] is not None:
            low, high = one["heights"]
            heights = f"{low:.3g} to {metres(high)}" if high > low else metres(low)
        lines.append(markdown_row((one["file"], counts, heights, _said(one["shares"]))))
    return "\n".join(lines)


def _storey_losses(scene: Scene, resolution: float) -> Iterator[str]:
    """Yield sentences on what maps of decks and bores lose."""
    if scene.judge is not None:
        yield from headroom_note(scene.terrain, scene.judge.vehicle)
        return
    yield (
        "Headroom is not judged without a vehicle: what is below a deck is free, however low that "
        'is. Name a --vehicle that has a "height".'
    )
    yield (
        f"Decks and bores are looked at every {metres(0.5 * resolution)}; what is narrower may be "
        "missed."
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


def _yaml(name: str, resolution: float, origin: list[float]) -> str:
    return (
        f"image: {name}.pgm\n"
        "mode: trinary\n"
        f"resolution: {json.dumps(resolution)}\n"
        f"origin: {json.dumps(origin)}\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n"
    )
