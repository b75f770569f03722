"""Export of contours as GeoJSON and GeoPackage."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from terratool.definition.crs import authority_code
from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.footprints import geojson_head
from terratool.field.terrain import Terrain, check_bounds, clip_bounds
from terratool.output import refuse_existing, whole_file
from terratool.raster.contours import Contour, ContourNodes, contour_heights
from terratool.raster.geotiff import crs_of
from terratool.raster.shading import contour_interval

SUFFIXES = (".geojson", ".json", ".gpkg")
"""Suffixes of files of contours."""
_MOST = 10_000
"""Most heights with contours."""
_DIGITS = 6
"""Decimals of a coordinate in text, beyond those of the distance of nodes."""


@dataclass(frozen=True, slots=True)
class ContourReport:
    """Report of written contours.

    Attributes:
        path: the file.
        interval: height from one contour to the next, world units; 0 on level ground.
        heights: heights that have contours, of the lowest and the highest; None where no contour
            is.
        lines: number of lines.
        points: number of points of all lines.
        columns: number of nodes from west to east.
        rows: number of nodes from south to north.
        resolution: distance of neighbouring nodes, world units.
    """

    path: Path
    interval: float
    heights: tuple[float, float] | None
    lines: int
    points: int
    columns: int
    rows: int
    resolution: float


@dataclass(frozen=True, slots=True)
class ContourRequest:
    """Contours that are wanted.

    Attributes:
        resolution: distance of the nodes between which contours pass, world units.
        bounds: west, south, east, north of the part of the terrain; None for all of it.
        interval: height from one contour to the next, world units; None for a round one that gives
            about eight.
        overwrite: whether the file may be replaced.
    """

    resolution: float
    bounds: Bounds | None = None
    interval: float | None = None
    overwrite: bool = False


def check_contours(path: Path, interval: float | None, overwrite: bool) -> None:
    """Refuse a file or an interval that contours cannot have, before anything is read.

    Raises:
        RequestError: the suffix is another one, or the interval is not above 0.
        WriteError: the file exists.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise RequestError(
            f"{path.name}: contours, which are lines, go into no such file.",
            f"Give a name that ends with {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}.",
        )
    if interval is not None and not (math.isfinite(interval) and interval > 0):
        raise RequestError(f"Contours are to be {interval:g} apart.", "Give an --interval above 0.")
    refuse_existing(path, overwrite)


def export_contours(
    terrain: Terrain,
    path: str | Path,
    request: ContourRequest,
    progress: Callable[[str], object] = lambda _: None,
) -> ContourReport:
    """Write the contours of a terrain as lines with their height `elev`.

    Each point of a line is where the ground itself passes the height on the way between two
    neighbouring nodes, at a wall upon the wall.

    Args:
        terrain: terrain to be exported.
        path: file to write, .geojson or .gpkg.
        request: contours that are wanted.
        progress: called with words on the step that begins.

    Raises:
        WriteError: the file exists, or cannot be written.
        RequestError: the suffix, the interval, the resolution or the bounds cannot be had.
        DefinitionError: the CRS of the terrain is unknown.
    """
    path = Path(path)
    check_contours(path, request.interval, request.overwrite)
    if request.bounds is not None:
        check_bounds(request.bounds, terrain)
    crs = crs_of(terrain)
    part = clip_bounds(terrain, request.bounds)
    progress("painting")
    nodes = ContourNodes.over(terrain, part, request.resolution)
    known = nodes.z[np.isfinite(nodes.z)]
    interval = contour_interval(nodes.z) if request.interval is None else request.interval
    heights: list[float] = []
    if interval and known.size:
        heights = contour_heights(float(known.min()), float(known.max()), interval, _MOST)
    count = _Count()
    progress("tracing")
    with whole_file(path, request.overwrite) as written:
        lines = count.of(nodes.contours(heights))
        if path.suffix.lower() == ".gpkg":
            from terratool.io.geopackage import write_contours

            named = None if terrain.crs is None else authority_code(terrain.crs)
            write_contours(written, lines, crs, named, terrain.descr)
        else:
            _write_geojson(written, lines, terrain, request.resolution)
    rows, columns = nodes.z.shape
    return ContourReport(
        path, interval, count.heights, count.lines, count.points, columns, rows, request.resolution
    )


class _Count:
    """Numbers of lines and points that have passed, and the range of their heights."""

    def __init__(self) -> None:
        self.lines = self.points = 0
        self.heights: tuple[float, float] | None = None

    def of(self, contours: Iterable[Contour]) -> Iterator[Contour]:
        """Yield contours unchanged, from the lowest to the highest."""
        for contour in contours:
            self.lines += 1
            self.points += len(contour.line)
            self.heights = (self.heights or (contour.height,))[0], contour.height
            yield contour


def _write_geojson(
    path: Path, contours: Iterable[Contour], terrain: Terrain, resolution: float
) -> None:
    """Write a feature a line, so that lines of any number take no memory."""
    digits = max(0, _DIGITS - math.floor(math.log10(resolution)))
    head = json.dumps(geojson_head(terrain), ensure_ascii=False)
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write(f'{head[:-1]}, "features": [')
        separator = "\n"
        for height, line in contours:
            feature = {
                "type": "Feature",
                "properties": {"elev": height},
                "geometry": {
                    "type": "LineString",
                    "coordinates": np.round(line, digits).tolist(),
                },
            }
            file.write(separator + json.dumps(feature))
            separator = ",\n"
        file.write("\n]}\n")
