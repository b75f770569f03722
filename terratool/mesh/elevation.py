"""Export of a terrain without void as a grid of heights in a VRML file."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from msgspec import UNSET, structs
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.summary import spread_points
from terratool.field.terrain import Terrain, check_bounds, clip_bounds
from terratool.mesh.build import build
from terratool.mesh.export import ExportReport, check_request
from terratool.mesh.formats.vrml import write_elevation_grid
from terratool.mesh.loss import POINTS, GridLoss, Peak, WallSummary, wall_summary
from terratool.mesh.types import HeightGrid
from terratool.output import whole_file

SUFFIX = ".wrl"
STEPS_PER_CELL = 10
"""Steps of a grid in the smallest cell, if no resolution is given."""
STEPS = 128, 512
"""Least and most steps of a grid along its longer side, if no resolution is given."""
_MOST_NODES = 1 << 26
"""Most nodes of a grid."""

Floats = NDArray[np.float64]


class ElevationGridReport(
    ExportReport,
    frozen=True,
    kw_only=True,
    rename={"chosen": "resolution_chosen", "statement": "losses"},
):
    """Report on an exported grid of heights. Lengths are in units of the terrain.

    Attributes:
        files: file that was written.
        bounds: west, south, east, north of the outermost nodes, in the world.
        origin: world position of the file's zero.
        columns, rows: number of nodes from west to east and from south to north.
        spacing: distance of one node from the next along x and along y.
        chosen: reason for the resolution, in words.
        statement: loss of the grid.
    """

    format_version: int = 1
    geometry: str = "elevation grid"
    files: tuple[Path]
    bounds: Bounds
    origin: tuple[float, float, float]
    columns: int
    rows: int
    spacing: tuple[float, float]
    chosen: str
    statement: GridLoss


def export_elevation_grid(
    terrain: Terrain,
    path: str | Path,
    resolution: float | None = None,
    bounds: Bounds | None = None,
    *,
    overwrite: bool = False,
) -> ElevationGridReport:
    """Write the heights of a terrain, or of a part of it, as the ElevationGrid of a VRML97 file.

    Its nodes are evenly spaced from edge to edge, both included. Walls become ramps from one node
    to the next.

    Args:
        terrain: terrain to write.
        path: file to write, a .wrl.
        resolution: longest distance between two neighbouring nodes, in units of the terrain; if
            None, a tenth of the smallest cell, within 128 to 512 steps along the longer side.
        bounds: world rectangle west, south, east, north; the whole terrain if None.
        overwrite: whether the file may exist.

    Raises:
        WriteError: the file exists, or cannot be written.
        RequestError: the file is no .wrl, the part has void, or the resolution or bounds make no
            sense.
    """
    path = Path(path)
    terrain = terrain.written_out
    if path.suffix.lower() != SUFFIX:
        raise RequestError(
            f"{path.name}: only VRML has an elevation grid.",
            f"Ask for a {SUFFIX}, or leave out --elevation-grid.",
        )
    check_request(path, overwrite)
    if bounds is not None:
        check_bounds(bounds, terrain)
    part = clip_bounds(terrain, bounds)
    chosen = "as asked"
    if resolution is None:
        resolution, chosen = _default_resolution(terrain, part)
    x, y = _nodes(part, resolution)
    sample = terrain.sample(*np.meshgrid(x, y[::-1]))
    heights = sample.height
    points = spread_points(part, POINTS)
    ground = terrain.height(*points)
    if np.isnan(heights).any() or np.isnan(ground).any():
        raise RequestError(
            f"{path.name}: an elevation grid can have no holes, and there is void in the terrain.",
            "Leave out --elevation-grid, or give --bounds without void.",
        )
    with np.errstate(over="ignore"):
        stored = heights.astype(np.float32)
    if not np.isfinite(stored).all():
        raise RequestError(f"{path.name}: some heights are beyond float32.")
    # a mesh has all walls, whatever its error
    coarse = build(terrain, max(float(np.ptp(heights)), 1.0), bounds).mesh
    grid = HeightGrid(
        heights=stored,
        spacing=((part[2] - part[0]) / (len(x) - 1), (part[3] - part[1]) / (len(y) - 1)),
        surfaces=sample.surface,
        origin=np.array([part[0], part[1], 0.0]),
        names=coarse.names,
        colors=coarse.colors,
    )
    statement = structs.replace(
        _statement(grid, wall_summary(coarse), *points, ground),
        storeys=next(iter(terrain.hidden), UNSET),
    )
    with whole_file(path, overwrite) as file:
        write_elevation_grid(grid, file, terrain.descr)
    return ElevationGridReport(
        files=(path,),
        bounds=part,
        origin=(part[0], part[1], 0.0),
        columns=len(x),
        rows=len(y),
        spacing=grid.spacing,
        chosen=chosen,
        statement=statement,
    )


def _default_resolution(terrain: Terrain, part: Bounds) -> tuple[float, str]:
    """Return the default distance between nodes, and its reason in words."""
    side = max(part[2] - part[0], part[3] - part[1])
    wanted = side / (terrain.smallest_cell / STEPS_PER_CELL)
    steps = min(max(wanted, STEPS[0]), STEPS[1])
    if steps == wanted:
        return side / steps, "a tenth of the smallest cell"
    return side / steps, f"{steps} steps on the longer side"


def _nodes(part: Bounds, resolution: float) -> tuple[Floats, Floats]:
    """Return x and y of the nodes, ascending."""
    if not (math.isfinite(resolution) and resolution > 0):
        raise RequestError(
            f"The resolution is {resolution:g}.",
            "Give the distance between two nodes, a number above 0.",
        )
    sides = part[2] - part[0], part[3] - part[1]
    # a side that the resolution divides has no step more for a rounded quotient
    steps = [max(1.0, math.ceil(side / resolution * (1 - 1e-12))) for side in sides]
    if (steps[0] + 1) * (steps[1] + 1) > _MOST_NODES:
        raise RequestError(
            f"A resolution of {resolution:g} makes {steps[0] + 1:.4g} × {steps[1] + 1:.4g} nodes, "
            "more than a viewer can read.",
            f"Give a coarser one, such as {max(sides) / STEPS[1]:.3g}.",
        )
    return (
        np.linspace(part[0], part[2], int(steps[0]) + 1),
        np.linspace(part[1], part[3], int(steps[1]) + 1),
    )


def _statement(
    grid: HeightGrid, walls: WallSummary, x: Floats, y: Floats, ground: Floats
) -> GridLoss:
    """Return the loss of a grid, compared with heights of the ground at points."""
    off = _misses_at(grid, x, y, ground)
    worst = int(off.argmax())
    largest = float(off[worst])
    scaled = off / largest if largest else off
    return GridLoss(
        walls=walls,
        points=len(off),
        miss=Peak(largest, float(x[worst]), float(y[worst])),
        rms=largest * float(np.sqrt(np.mean(scaled**2))),
    )


def _misses_at(grid: HeightGrid, x: Floats, y: Floats, ground: Floats) -> Floats:
    """Return the distances of a grid from ground at world x and y, by `grid_misses`."""
    heights = grid.heights[::-1].astype(np.float64)
    return grid_misses(heights, (x - grid.origin[0], y - grid.origin[1]), grid.spacing, ground)


def grid_misses(
    heights: Floats, points: tuple[Floats, Floats], spacing: tuple[float, float], ground: Floats
) -> Floats:
    """Return the distances of a grid from ground, (k,), whichever way its squares are halved.

    Args:
        heights: (n, m) heights of the nodes, rows from the south.
        points: x and y of points from the node in the south-west, (k,) each.
        spacing: distance of one node from the next along x and along y.
        ground: (k,) heights of the ground at the points.
    """
    rows, columns = heights.shape
    east, north = points[0] / spacing[0], points[1] / spacing[1]
    i = np.clip(east.astype(np.int64), 0, columns - 2)
    j = np.clip(north.astype(np.int64), 0, rows - 2)
    u, v = east - i, north - j
    a, b, c, d = heights[j, i], heights[j, i + 1], heights[j + 1, i + 1], heights[j + 1, i]
    rising = np.where(u >= v, a + u * (b - a) + v * (c - b), a + u * (c - d) + v * (d - a))
    falling = np.where(
        u + v <= 1, a + u * (b - a) + v * (d - a), c + (1 - u) * (d - c) + (1 - v) * (b - c)
    )
    return np.asarray(np.maximum(np.abs(rising - ground), np.abs(falling - ground)), np.float64)
