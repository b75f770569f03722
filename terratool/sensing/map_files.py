"""Files of a robot's map: a GeoTIFF per level, and a bag with a grid_map per level."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS

from terratool.definition.crs import is_geographic
from terratool.errors import ReadError, RequestError
from terratool.extras import install_command
from terratool.io.bands import Bands
from terratool.io.clouds import MOST
from terratool.io.crs import read_crs
from terratool.io.geotiff import (
    TILE,
    Compression,
    TiffProfile,
    geotiff,
    software_tags,
    tile_options,
)
from terratool.io.guards import is_placed, size_on_disk
from terratool.io.opening import gdal_errors, open_local
from terratool.output import (
    refuse_existing,
    refuse_folder,
    refuse_missing_folder,
    whole_file,
    whole_folder,
)
from terratool.raster.geotiff import transform_of
from terratool.raster.grid import Grid
from terratool.raster.grid_map_bag import MOST_BYTES, TOPIC, GridMap, files_of_bag, write_grid_maps
from terratool.sensing.lines import Face
from terratool.sensing.robot_map import (
    FREE_CELLS,
    MOST_CELLS,
    MOST_LEVELS,
    MOST_STOREYS,
    MapLevel,
    MapOptions,
    RobotMap,
)
from terratool.text.numbers import parse_whole
from terratool.text.packing import TIMES, most_unpacked

BANDS = Bands(
    (
        "elevation", "variance", "lowest", "highest", "count", "surface", "time", "distance",
        "seen",
    ),
    ("m", "m2", "m", "m", "", "", "s", "m", "1"),
    np.dtype(np.float64),
)  # fmt: skip
"""Bands of each GeoTIFF; NaN in cells without readings."""
PATCH = Bands((*BANDS.names, "depth"), (*BANDS.units, "m"), BANDS.dtype)
"""Bands of a patch of a cell."""
LEVEL, LEVELS, SURFACES = "TERRATOOL_MAP_LEVEL", "TERRATOOL_MAP_LEVELS", "TERRATOOL_MAP_SURFACES"
"""Tags of the level, the number of levels, and the names of surfaces as JSON."""
STOREYS, GAP_TAG = "TERRATOOL_MAP_STOREYS", "TERRATOOL_MAP_GAP"
"""Tags of the most patches of a cell, and of their gap, m; a map of one height a cell has none."""
FIRST, LAST = "TERRATOOL_MAP_FIRST_TIME", "TERRATOOL_MAP_LAST_TIME"
"""Tags of the least and largest time of a reading, s."""
_COMPANIONS = (
    *(f".level-{level}{suffix}" for level in range(1, MOST_LEVELS) for suffix in (".tif", ".tiff")),
    *("*.aux.xml", "*.msk", "*.ovr"),
)
"""Suffixes of the further files of a map; old ones would be taken for parts of a new map."""
_MOST_READ = 1 << 26
"""Most pixels of a raster to be read."""
_FREE_BANDS = 4 * PATCH.count
"""Most bands of FREE_CELLS that a file may hold, whatever its size."""
_SQUARE = 1e-9
"""Tolerated deviation of pixels from squares, as a share of their side."""
_MOST_COUNT = 2.0**53
"""Largest number of readings of a cell that float64 holds exactly."""
_BLOCK = 16
"""Divisor of the sides of a TIFF's blocks, pixels."""


@dataclass(frozen=True, slots=True)
class MapOutput:
    """Destination of a map.

    Attributes:
        path: .tif of the finest level; those of other levels are beside it.
        levels: number of levels.
        bag: folder of a bag; None for no bag. Readers such as rosbags take a name that ends in .bag
            for a bag of ROS 1.
        crs: reference system of the map; None for none.
        overwrite: whether to replace existing files.
    """

    path: Path
    levels: int
    bag: Path | None = None
    crs: str | None = None
    overwrite: bool = False

    @property
    def files(self) -> list[Path]:
        """Paths of the GeoTIFFs, level by level."""
        return [self.path, *(_beside(self.path, level) for level in range(1, self.levels))]

    def check(self) -> None:
        """Check that the files can be written.

        Raises:
            RequestError: a suffix is wrong, the reference system is unknown or in degrees, or
                rosbags is not installed.
            WriteError: a file exists, or a folder is missing.
        """
        if self.path.suffix.lower() not in (".tif", ".tiff"):
            raise RequestError(
                f"{self.path}: a map is a GeoTIFF.", "Give a name that ends in .tif."
            )
        if self.crs is not None:
            read_crs(self.crs)
            if is_geographic(self.crs):
                raise RequestError(
                    f"A map of a robot has cells in metres, and {self.crs} has degrees.",
                    "Give --crs a system in metres, such as EPSG:32633.",
                )
        refuse_existing(self.path, self.overwrite, _COMPANIONS)
        refuse_missing_folder(self.path)
        if self.bag is None:
            return
        if find_spec("rosbags") is None:
            raise RequestError(
                "A bag needs rosbags, which is not installed.",
                f"Install it: {install_command('ros')}",
            )
        if os.path.realpath(self.bag) in map(os.path.realpath, self.files):
            raise RequestError(f"{self.bag}: is to be the map, too.", "Choose another name.")
        refuse_folder(self.bag, self.overwrite, files_of_bag(self.bag))
        refuse_missing_folder(self.bag)


def _beside(path: Path, level: int) -> Path:
    return path.with_suffix(f".level-{level}{path.suffix}")


def write_map(
    robot_map: RobotMap, output: MapOutput, progress: Callable[[str], object] = lambda _: None
) -> list[Path]:
    """Write a map; equal maps give equal bytes.

    Args:
        robot_map: map to be written.
        output: destination.
        progress: called with a description of each step.

    Returns:
        Paths of the GeoTIFFs and of the bag.

    Raises:
        RequestError: as for `MapOutput.check`, or the map is too large for a message.
        WriteError: as for `MapOutput.check`, or a file cannot be written.
    """
    output.check()
    if output.bag is not None:
        _refuse_large(robot_map.grid, _bands_of(robot_map).count)
    levels = [robot_map.storeys(level) for level in range(output.levels)]
    with whole_file(output.path, output.overwrite, _COMPANIONS) as part:
        for number, storeys in enumerate(levels):
            name = part if not number else _beside(part, number)
            progress(f"writing {name.name}")
            _write_level(name, storeys, robot_map.options, output)
    if output.bag is not None:
        progress(f"writing {output.bag.name}")
        _write_bag(output, levels, _bands_of(robot_map))
    return [*output.files, *([output.bag] if output.bag is not None else [])]


def storey_bands(storeys: int) -> Bands:
    """Bands of a GeoTIFF of a map with so many patches a cell."""
    numbers = range(1, storeys + 1)
    names = tuple(f"{name}-{number}" for number in numbers for name in PATCH.names)
    return Bands(names, PATCH.units * storeys, PATCH.dtype)


def _bands_of(robot_map: RobotMap) -> Bands:
    """Bands of a cell, or of a patch of it."""
    return BANDS if robot_map.options.storeys is None else PATCH


def pixels_of(level: MapLevel, bands: Bands = BANDS) -> NDArray[np.float64]:
    """Bands of a level, (bands, height, width) float64."""
    never = np.isnan(level.elevation)
    return np.stack(
        [np.where(never, np.nan, getattr(level, name)) for name in bands.names], dtype=np.float64
    )


def _write_level(
    path: Path, storeys: Sequence[MapLevel], options: MapOptions, output: MapOutput
) -> None:
    level = storeys[0]
    grid, crs = level.grid, None if output.crs is None else read_crs(output.crs)
    times = np.concatenate([one.time[np.isfinite(one.time)] for one in storeys])
    # a small map gets smaller blocks
    width, height = (min(TILE, -(-n // _BLOCK) * _BLOCK) for n in (grid.width, grid.height))
    bands, patch, patches = BANDS, BANDS, {}
    if options.storeys is not None:
        bands, patch = storey_bands(options.storeys), PATCH
        patches = {STOREYS: str(options.storeys), GAP_TAG: repr(float(options.gap))}
    tags = {
        **software_tags("A robot's map"),
        LEVEL: str(level.level), LEVELS: str(output.levels),
        SURFACES: json.dumps(level.surfaces, ensure_ascii=True), **patches,
        **({FIRST: repr(float(times.min())), LAST: repr(float(times.max()))} if times.size else {}),
    }  # fmt: skip
    tiling = tile_options(bands.dtype, Compression(), size=(width, height))
    profile = TiffProfile(grid.width, grid.height, transform_of(grid), crs, tags, tiling)
    with geotiff(path, bands, profile) as file:
        file.write(np.concatenate([pixels_of(one, patch) for one in storeys]))


def _refuse_large(grid: Grid, bands: int) -> None:
    size = 4 * bands * grid.width * grid.height
    if size > MOST_BYTES:
        raise RequestError(
            f"{grid.width} × {grid.height} cells make a message of {size / 1e9:.1f} GB.",
            f"Give larger cells; a message may have {MOST_BYTES / 1e9:.1f} GB.",
        )


def _write_bag(output: MapOutput, levels: Sequence[Sequence[MapLevel]], bands: Bands) -> None:
    """Write a bag with a topic for each level and patch; ages replace times.

    Topics of levels are /grid_map and /grid_map/level_1, those of patches /grid_map/storey_1.
    """
    assert output.bag is not None
    every = [one for storeys in levels for one in storeys]
    last = max(float(one.time[np.isfinite(one.time)].max(initial=-math.inf)) for one in every)
    maps = []
    for storeys in levels:
        for number, level in enumerate(storeys, 1):
            west, south, east, north = level.grid.bounds
            pixels = dict(zip(bands.names, pixels_of(level, bands), strict=True))
            # float32 is too coarse for seconds since 1970
            pixels["age"] = last - pixels.pop("time")
            layers = {name: values.astype(np.float32) for name, values in pixels.items()}
            topic = TOPIC if not level.level else f"{TOPIC}/level_{level.level}"
            if bands is PATCH:
                topic += f"/storey_{number}"
            middle = 0.5 * (west + east), 0.5 * (south + north)
            maps.append(GridMap(level.grid, middle, layers, topic))
    with whole_folder(output.bag, output.overwrite, files_of_bag(output.bag)) as part:
        write_grid_maps(part, maps)


@dataclass(frozen=True, slots=True)
class MapFile:
    """A level of a map, or another raster of heights, from a file.

    Attributes:
        name: name of the file.
        storeys: cells of the map, once for each patch of them, from below; bands that the file
            lacks are NaN, surfaces -1.
        is_map: whether the file is a map of terratool.
        crs: reference system; None without one.
        gap: gap of the patches, m; None if cells have one height.
        face: what its heights are of, as far as the file tells.
    """

    name: str
    storeys: tuple[MapLevel, ...]
    is_map: bool
    crs: CRS | None
    gap: float | None = None
    face: Face = "top"

    @property
    def level(self) -> MapLevel:
        """Cells of the map, of their lowest patches."""
        return self.storeys[0]


def map_of(robot_map: RobotMap, level: int = 0) -> MapFile:
    """A level of a map in memory, to be compared as one from a file.

    Raises:
        RequestError: the map has no such level.
    """
    options = robot_map.options
    if not 0 <= level < options.levels:
        raise RequestError(
            f"The map has no level {level}.", f"Give one from 0 to {options.levels - 1}."
        )
    storeys = robot_map.storeys(level)
    if options.storeys is None:
        return MapFile("the map", storeys, is_map=True, crs=None)
    return MapFile("the map", storeys, True, None, options.gap, "nearest")


def heights_map(heights: NDArray[np.float64], grid: Grid, crs: CRS | None = None) -> MapFile:
    """Heights in memory as a map, (rows, columns) float64, row 0 in the north, NaN for none."""
    return MapFile("the array", (_level_of(heights[None], grid, 0, ()),), is_map=False, crs=crs)


def read_map(path: str | Path) -> MapFile:
    """Read a level of a map, or the first band of another raster as heights.

    A first band that is called `ground`, as that of an exported DEM, has heights of the ground.

    Raises:
        ReadError: the file cannot be read; its pixels are not real, not square, rotated or without
            a georeference; or they are far more than its bytes should hold.
        RequestError: the raster has too many pixels.
    """
    name = str(path)
    with open_local(name, allow_remote=False) as file:
        grid = _grid_of(name, file)
        if grid.width * grid.height > _MOST_READ:
            raise RequestError(
                f"{name}: has {grid.width:,} × {grid.height:,} pixels.",
                f"Compare a part of it, or a coarser one, of up to {_MOST_READ:,}.",
            )
        with gdal_errors(name):
            tags = file.tags()
            storeys, gap = _parse_storeys(name, tags)
            bands = BANDS if gap is None else storey_bands(storeys)
            is_map = LEVEL in tags and file.descriptions == bands.names
            count = bands.count if is_map else 1
            _refuse_claims(name, file, count)
            read = file.read(list(range(1, count + 1)), masked=True)
            scale, offset = file.scales[0], file.offsets[0]
            crs, first = file.crs, file.descriptions[0]
    with np.errstate(invalid="ignore", over="ignore"):  # values beyond MOST become NaN
        pixels = read.astype(np.float64).filled(np.nan)
        if (scale, offset) != (1.0, 0.0):
            pixels[0] = pixels[0] * scale + offset
    pixels[~(np.abs(pixels) < MOST)] = np.nan
    if not is_map:
        face: Face = "ground" if first == "ground" else "top"
        return MapFile(name, (_level_of(pixels, grid, 0, ()),), False, crs, face=face)
    level, surfaces = _parse_tags(name, tags, grid, storeys)
    size = len(pixels) // storeys
    of = tuple(
        _level_of(pixels[k : k + size], grid, level, surfaces) for k in range(0, len(pixels), size)
    )
    if gap is None:
        return MapFile(name, of, True, crs)
    return MapFile(name, of, True, crs, gap, "nearest")


def _parse_storeys(name: str, tags: dict[str, str]) -> tuple[int, float | None]:
    """Most patches of a cell, and their gap, m; 1 and None for a raster of one height a cell.

    Raises:
        ReadError: the tags are invalid.
    """
    if STOREYS not in tags:
        return 1, None
    storeys = parse_whole(tags[STOREYS])
    try:
        gap = float(tags.get(GAP_TAG, ""))
    except ValueError:
        gap = math.nan
    if storeys is None or not 1 <= storeys <= MOST_STOREYS or not 0.0 <= gap < math.inf:
        raise _no_map(name)
    return storeys, gap


def _no_map(name: str) -> ReadError:
    return ReadError(f"{name}: its tags are not those of a map.", "Make it anew: terratool map")


def _refuse_claims(name: str, file: Any, count: int) -> None:
    """Refuse bands that are not real numbers, or far larger than the file.

    Raises:
        ReadError: the first `count` bands are.
    """
    if any(np.dtype(kind).kind not in "iuf" for kind in file.dtypes[:count]):
        raise ReadError(f"{name}: holds no real numbers.", "Name a raster of heights.")
    size = 8 * min(max(count, BANDS.count), _FREE_BANDS) * FREE_CELLS
    if 8 * count * file.width * file.height > max(size, most_unpacked(size_on_disk(file) or 0)):
        raise ReadError(
            f"{name}: comes to more than {TIMES} times its size.",
            "Save it without compression: gdal_translate -co COMPRESS=NONE OLD.tif NEW.tif",
        )


def _parse_tags(
    name: str, tags: dict[str, str], grid: Grid, storeys: int
) -> tuple[int, tuple[str, ...]]:
    """Parse the number of the level and the names of surfaces from the tags of a map.

    Raises:
        ReadError: a tag is missing or invalid.
    """
    level = parse_whole(tags[LEVEL])
    try:
        surfaces = msgspec.json.decode(tags.get(SURFACES, ""), type=tuple[str, ...])
    except (msgspec.MsgspecError, UnicodeError):
        level = None
    cells = grid.width * grid.height * storeys
    if level is None or level >= MOST_LEVELS or cells << 2 * level > MOST_CELLS:
        raise _no_map(name)
    return level, surfaces


def _level_of(
    pixels: NDArray[np.float64], grid: Grid, number: int, surfaces: tuple[str, ...]
) -> MapLevel:
    blank = np.full((grid.height, grid.width), np.nan)
    bands = dict(zip(BANDS.names, pixels, strict=False))
    if len(pixels) == 1:
        bands["seen"] = np.where(np.isnan(bands["elevation"]), np.nan, 1.0)
    surface = np.nan_to_num(bands.get("surface", blank), nan=-1.0)
    surface = np.where((surface >= 0) & (surface < len(surfaces)), surface, -1)
    count = np.nan_to_num(bands.get("count", blank), nan=0.0)
    given: dict[str, Any] = {
        field.name: bands.get(field.name, blank)
        for field in fields(MapLevel)
        if field.name in BANDS.names
    }
    given["surface"] = surface.astype(np.int32)
    given["count"] = np.clip(count, 0, _MOST_COUNT).astype(np.int64)
    return MapLevel(level=number, grid=grid, surfaces=surfaces, **given)


def _grid_of(name: str, file: Any) -> Grid:
    """Grid of the pixels of an open raster.

    Raises:
        ReadError: the pixels are not square, rotated, or without a georeference.
    """
    if not file.count or not is_placed(file):
        raise ReadError(
            f"{name}: does not say where its pixels lie.", "Give a GeoTIFF, such as a map."
        )
    transform = file.transform
    side = abs(transform.a)
    turned = abs(transform.b) + abs(transform.d) > _SQUARE * side
    if turned or transform.a < 0 or abs(-transform.e - side) > _SQUARE * side:
        raise ReadError(
            f"{name}: its pixels are no squares with the north up.",
            "Warp it first: gdalwarp -tr R R IN.tif OUT.tif",
        )
    south = transform.f - file.height * side
    return Grid(transform.c, south, side, file.height, file.width)
