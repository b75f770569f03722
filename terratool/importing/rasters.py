"""Rasters that GDAL opens, read as heights or as classes by rows from the south."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple
from xml.parsers.expat import ExpatError

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.enums import Resampling
from rasterio.transform import Affine
from rasterio.vrt import WarpedVRT
from rasterio.windows import Window

from terratool.definition.crs import LOCAL, CrsValue, crs_problem
from terratool.errors import ReadError, RequestError
from terratool.importing.control import PlacedFile, control_of
from terratool.importing.meanings import (
    UNKNOWN_UNIT,
    UNSCALED,
    NumberScale,
    PixelBands,
    bands_of,
    height_unit,
    in_metres,
    is_metric,
    scale_of,
    system_of,
    unit_notes,
)
from terratool.importing.types import PixelGrid, SourceOptions, StatedPlace, sample_range
from terratool.io.crs import local_crs, read_crs, refuse_other_body, spell_crs
from terratool.io.expat import EntityError, tree_of
from terratool.io.guards import HARMLESS, is_placed, transform_of
from terratool.io.opening import gdal_errors, open_local
from terratool.raster.layers import LAYERS
from terratool.report.numbers import coordinates
from terratool.text.files import open_file

HIGHEST = 1e9
"""Limit of a definition's heights, without sign."""

SUSPECTS = (
    -999.0, -9999.0, -10000.0, -32767.0, -32768.0, -99999.0, 9999.0, 32767.0, 65535.0, 99999.0,
)  # fmt: skip
"""Heights that often stand for nodata in files that do not declare it."""

_CACHE_BYTES = 1 << 27
_MOST_WARPED = 16
"""Most pixels of a reprojected raster per pixel of its file."""
_ON_GRID = 1e-6
_FINE = 0.25
"""Largest side of a pixel in degrees of rasters whose x and y are looked at for that."""
_ANY = CRS.from_epsg(3857)
"""Reference system from and to which a raster without one is warped, which changes nothing."""
_TOLERANCE = 0.001
"""Largest error of a place in a warp, in pixels; that of GDAL is 0.125, always to one side."""
_MOST_CLASSES = 65536
_MOST_READ = 1 << 24
"""Pixels of a class raster that are read at a time; it may be much finer than the DEM."""

_SOILS = {
    "cohesion": "cohesion",
    "friction": "fricAngle",
    "sinkage": "sinkage",
    "sonar": "sonarRefl",
}
"""Keys of a surface by the names of DEM layers."""

SurfaceEntry = tuple[str, dict[str, Any]]
"""Name and members of a surface."""


def _refuse_turned(name: str, transform: Affine, tolerance: float, hint: str) -> None:
    if abs(transform.b) + abs(transform.d) > tolerance * (abs(transform.a) + abs(transform.e)):
        raise ReadError(f"{name}: its pixels are turned against its reference system.", hint)


# --- heights -------------------------------------------------------------------------------------


@dataclass(slots=True)
class RasterHeights:
    """Heights of an open raster; a `HeightSource`.

    Attributes:
        file: raster that rasterio opened, or a warp of it.
        bands: band of the heights, or bands of which an encoding makes them.
        encoding: way in which several bands have heights; None for one band.
        window: pixels that are read.
        south_up: whether the file's rows begin in the south.
        east_first: whether the file's columns begin in the east.
        nodata: number of the file that stands for no height, besides its own.
        scale: factor and offset of the file's numbers.
        stated: reference system and unit of the file.
        about: notes known before the reading.
        infinite: number of infinite pixels read so far.
        suspects: number of pixels that may be nodata, by their number in the file.
        others: least and greatest number of all other pixels.
    """

    name: str
    file: Any
    bands: PixelBands
    window: Window
    south_up: bool
    east_first: bool
    grid: PixelGrid
    nodata: float | None
    scale: NumberScale
    stated: StatedPlace
    about: list[str]
    infinite: int = 0
    suspects: dict[float, int] = field(default_factory=dict)
    others: tuple[float, float] = (math.inf, -math.inf)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the user about the source, complete after the reading."""
        found = list(self.about)
        if self.infinite:
            found.append(f"{_pixels(self.infinite)} infinite: taken as nodata.")
        low, high = self.others
        for height, count in self.suspects.items():
            if low < high and max(low - height, height - high) > high - low:
                found.append(
                    f"{_pixels(count)} {height:g}, far from all others: if that stands for nodata, "
                    f"add --nodata {height:g}."
                )
        relief = (high - low) * abs(self.scale.factor)
        if self.grid.crs is None and _is_like_degrees(self.grid, relief):
            found.append(
                "x and y look like degrees, though no reference system is named: if they are, add "
                "--source-crs with its name, as EPSG:4326, and --crs to reproject."
            )
        return tuple(found)

    def _count_suspects(self, heights: NDArray[np.float64], low: float, high: float) -> None:
        """Count pixels of the lowest and the highest height where these may stand for nodata."""
        for height in (low, high):
            if height in SUSPECTS:
                at = heights == height
                self.suspects[height] = self.suspects.get(height, 0) + int(at.sum())
                heights = np.where(at, math.nan, heights)
                low, high, *_ = sample_range(heights)
        self.others = min(self.others[0], low), max(self.others[1], high)

    def read(self, first: int, count: int) -> NDArray[np.float64]:
        """Read `count` rows from row `first`, (count, columns) float64; NaN for none.

        Raises:
            ReadError: the file is broken there, or holds numbers that are no heights.
        """
        row = first if self.south_up else self.grid.rows - first - count
        window = Window(self.window.col_off, self.window.row_off + row, self.window.width, count)
        raw = self.bands.read(self.name, self.file, window, self.nodata)
        low, high, _, infinite = sample_range(raw)
        self.infinite += infinite
        self._count_suspects(raw, low, high)
        heights = raw
        if self.scale != UNSCALED:
            with np.errstate(over="ignore"):  # infinite heights are counted below
                heights = raw * self.scale.factor + self.scale.offset
            low, high, _, infinite = sample_range(heights)
            self.infinite += infinite
        if max(-low, high) >= HIGHEST:
            at = np.nanargmax(np.abs(heights))
            raise ReadError(
                f"{self.name}: holds a height of {heights.flat[at]:g}, more than a definition "
                "takes.",
                f"If it stands for nodata, add --nodata {float(raw.flat[at])!r}.",
            )
        heights = heights[:: 1 if self.south_up else -1, :: -1 if self.east_first else 1]
        return np.ascontiguousarray(heights)


def _pixels(count: int) -> str:
    return "1 pixel is" if count == 1 else f"{count:,} pixels are"


def _is_like_degrees(grid: PixelGrid, relief: float) -> bool:
    """Whether pixels without a reference system lie as those in degrees do.

    Their sides are small, and heights differ by more than the longer side of them all.
    """
    west, south, east, north = grid.bounds
    return (
        -180 - grid.dx <= west < east <= 360 + grid.dx
        and -90 - grid.dy <= south < north <= 90 + grid.dy
        and max(grid.dx, grid.dy) <= _FINE
        and relief > max(grid.size)
    )


@contextlib.contextmanager
def open_raster(name: str, options: SourceOptions) -> Iterator[RasterHeights]:
    """Open a raster as heights.

    Args:
        name: a path, or another name that GDAL opens.
        options: part and band to read; within bounds, pixels count whose centres lie inside.

    Raises:
        ReadError: the file cannot be read, or is no raster of heights.
        RequestError: the band, bounds or window are not in the raster, or what an option states
            the raster says otherwise.
    """
    cache: dict[str, Any] = {"GDAL_CACHEMAX": _CACHE_BYTES, "AAIGRID_DATATYPE": "Float64"}
    with contextlib.ExitStack() as stack:
        opened = open_local(
            name, allow_remote=options.allow_remote, allow_vrt=options.allow_vrt, **cache
        )
        file = stack.enter_context(opened)
        about: list[str] = []
        with gdal_errors(name):
            bands = bands_of(name, file, options.band, options.encoding)
            control, placed = control_of(file), file
            if control is not None:
                about.append(control.sentence)
                placed = PlacedFile(file, control.fitted, control.crs)
            crs = system_of(name, placed, options.source_crs)
            transform = transform_of(placed)
            if options.size is not None:
                transform = _sized(name, placed, options.size)
            elif not is_placed(placed):
                about.append(
                    "The raster does not say where it lies: a pixel is taken as 1 × 1, and "
                    "--size X Y gives it another size."
                )
            scale = scale_of(name, placed, bands, options, about)
            unit = height_unit(name, file, bands, crs, options.source_units)
            stated = StatedPlace(spell_crs(crs, []), unit)
            if options.crs is not None:
                source_crs, target = crs, _target(name, placed, crs, options.crs)
                file = stack.enter_context(_warped(name, file, crs, target, options.nodata))
                crs, transform = file.crs, transform_of(file)
                about.append(f"Reprojected to {_shown(options.crs, crs)}, bilinearly.")
                if not unit and not is_metric(source_crs) and is_metric(crs):
                    about.append(UNKNOWN_UNIT)
            elif control is not None and not control.upright:
                file = stack.enter_context(_warped(name, file, crs, crs, options.nodata))
                transform = file.transform
                about.append("They turn or bend its pixels: resampled north up, bilinearly.")
            place = RasterPlace(transform, crs, unit, scale)
            heights = _heights(name, file, bands, place, stated, options, about)
        yield heights


def _shown(wanted: CrsValue | CRS, crs: CRS) -> str:
    """Reference system as it was asked for; a local one by its name."""
    return str(crs.to_wkt()).split('"')[1] if wanted == LOCAL else str(wanted)


def _sized(name: str, file: Any, size: tuple[float, float]) -> Affine:
    """Transform of a raster without a place whose sides are given, its south-west corner at 0, 0.

    Raises:
        RequestError: the raster has a place.
    """
    if is_placed(file):
        sides = f"{abs(file.transform.a):g} × {abs(file.transform.e):g}"
        raise RequestError(
            f"{name}: has a place of its own, with pixels of {sides}.", "Leave out --size."
        )
    return Affine(size[0] / file.width, 0.0, 0.0, 0.0, -size[1] / file.height, size[1])


def _target(name: str, file: Any, crs: CRS | None, wanted: CrsValue | CRS) -> CRS:
    """Return the reference system that a raster of the system `crs` is reprojected to.

    Raises:
        RequestError: the raster's is not known or reads a file, the raster has no place, or the
            wanted one is of another celestial body.
    """
    if crs is not None and crs_problem(crs.to_wkt()):
        raise RequestError(
            f"{name}: has a reference system that reads a file, so that it is not reprojected.",
            "Leave out --crs, or give the file another one with gdal_edit.py -a_srs.",
        )
    if crs is None:
        raise RequestError(
            f"{name}: does not say its reference system, so that it cannot be reprojected.",
            "Leave out --crs, or name the one that it has with --source-crs.",
        )
    if not is_placed(file):
        raise RequestError(
            f"{name}: does not say where it lies, so that it cannot be reprojected.",
            "Leave out --crs, or give the file a place with gdal_edit.py -a_ullr.",
        )
    if wanted == LOCAL:
        a, b, c, d, e, f = transform_of(file)[:6]
        column, row = file.width / 2, file.height / 2
        target = local_crs(crs, a * column + b * row + c, d * column + e * row + f)
    else:
        target = read_crs(wanted)
    refuse_other_body(name, crs, target, "--crs")
    return target


def _warped(
    name: str, file: Any, system: CRS | None, target: CRS | None, nodata: float | None
) -> WarpedVRT:
    """Return a warp of a raster that is placed, or has control points, bilinearly.

    Raises:
        RequestError: two numbers stand for nodata.
        ReadError: the warp has far more pixels than the raster.
    """
    if nodata not in (None, file.nodata) and not math.isnan(file.nodata or math.nan):
        raise RequestError(
            f"{name}: its nodata is {file.nodata:g}, and only one number can be left out where "
            "pixels are resampled.",
            "Leave out --nodata or --crs, or change the file's with gdal_edit.py -a_nodata.",
        )
    # a warp wants to know systems, also where it stays within an unknown one
    system, target = (_ANY if one is None else one for one in (system, target))
    with gdal_errors(name):
        warped = WarpedVRT(
            file,
            src_crs=system,
            crs=target,
            resampling=Resampling.bilinear,
            dtype="float64",
            src_nodata=file.nodata if nodata is None else nodata,
            nodata=math.nan,
            tolerance=_TOLERANCE,
            UNIFIED_SRC_NODATA="YES",  # one channel of terrain-RGB may well be that number
        )
    pixels = warped.width * warped.height
    if pixels > max(HARMLESS, _MOST_WARPED * file.width * file.height):
        size = f"{warped.width:,} × {warped.height:,}"
        warped.close()
        raise ReadError(
            f"{name}: its {file.width:,} × {file.height:,} pixels would become {size}.",
            "Check its place and its reference system with gdalinfo.",
        )
    return warped


class RasterPlace(NamedTuple):
    """Where the pixels of a raster lie, and what their numbers are.

    Attributes:
        transform: transform from column and row to x and y.
        crs: reference system of these; None for none.
        unit: unit of the heights; "" where it is not known.
        scale: scale of the heights.
    """

    transform: Affine
    crs: CRS | None
    unit: str
    scale: NumberScale


def _heights(
    name: str,
    file: Any,
    bands: PixelBands,
    placed: RasterPlace,
    stated: StatedPlace,
    options: SourceOptions,
    about: list[str],
) -> RasterHeights:
    """Return the requested pixels of a raster as heights."""
    transform = placed.transform
    hint = "Add --crs with a reference system, to have it resampled north up."
    _refuse_turned(name, transform, 1e-9, hint)
    south_up, east_first = transform.e > 0, transform.a < 0
    dx, dy = abs(transform.a), abs(transform.e)
    west, east = sorted((transform.c, transform.c + transform.a * file.width))
    south, north = sorted((transform.f + transform.e * file.height, transform.f))
    # columns from the west and rows from the north
    columns, rows = (0, file.width), (0, file.height)
    if options.window is not None:
        column, row, width, height = options.window
        columns, rows = (column, column + width), (row, row + height)
        if not (0 <= column < columns[1] <= file.width and 0 <= row < rows[1] <= file.height):
            raise RequestError(
                f"{name}: the window {column} {row} {width} {height} is not within its "
                f"{file.width} × {file.height} pixels.",
                "Give column, row, width and height; columns and rows count from 0.",
            )
        if east_first:
            columns = file.width - columns[1], file.width - columns[0]
        if south_up:
            rows = file.height - rows[1], file.height - rows[0]
    if options.bounds is not None:
        low_x, low_y, high_x, high_y = options.bounds
        columns = _within(columns, low_x - west, high_x - west, dx)
        rows = _within(rows, north - high_y, north - low_y, dy)
        if columns[0] >= columns[1] or rows[0] >= rows[1]:
            raise RequestError(
                f"{name}: no pixel has its centre in the bounds {coordinates(options.bounds)}.",
                f"Give bounds that overlap {coordinates((west, south, east, north))}, where the "
                "raster lies.",
            )
    count_x, count_y = columns[1] - columns[0], rows[1] - rows[0]
    factor, crs, unit, scale = 1.0, placed.crs, placed.unit, placed.scale
    if options.units is None:
        middle = (west + east) / 2, (south + north) / 2
        about += unit_notes(crs, unit, middle)
    else:
        factor, crs, unit, scale = in_metres(name, crs, unit, scale)
    grid = PixelGrid(
        factor * (west + columns[0] * dx), factor * (north - rows[1] * dy), factor * dx,
        factor * dy, count_x, count_y, spell_crs(crs, about), unit,
    )  # fmt: skip
    first_column = file.width - columns[1] if east_first else columns[0]
    first_row = file.height - rows[1] if south_up else rows[0]
    window = Window(first_column, first_row, count_x, count_y)
    return RasterHeights(
        name, file, bands, window, south_up, east_first, grid, options.nodata, scale,
        stated, about,
    )  # fmt: skip


def _within(pixels: tuple[int, int], low: float, high: float, side: float) -> tuple[int, int]:
    """Return the range of pixels whose centres lie from `low` to `high`, tolerant of rounding."""
    first = math.ceil(low / side - 0.5 - _ON_GRID)
    last = math.floor(high / side - 0.5 + _ON_GRID)
    return max(pixels[0], first), min(pixels[1], last + 1)


# --- classes -------------------------------------------------------------------------------------


@dataclass(slots=True)
class ClassRaster:
    """An open raster of classes, sampled at the pixel centres of a grid.

    Attributes:
        surfaces: surfaces of the classes that the file describes.
        used: numbers of the classes read so far.
        lacking: number of the grid's pixels without a class.
    """

    name: str
    file: Any
    grid: PixelGrid
    surfaces: dict[int, SurfaceEntry]
    used: set[int] = field(default_factory=set)
    lacking: int = 0

    def read(self, first: int, count: int) -> NDArray[np.int64]:
        """Read classes of `count` rows from row `first`, (count, columns) int64; -1 for none."""
        at = self.grid
        x = at.west + (np.arange(at.columns) + 0.5) * at.dx
        y = at.south + (np.arange(first, first + count) + 0.5) * at.dy
        inverse = ~transform_of(self.file)
        columns = _indices(inverse.a, inverse.c, x, self.file.width)
        rows = _indices(inverse.e, inverse.f, y, self.file.height)
        in_x, in_y = columns >= 0, rows >= 0
        classes = np.full((count, at.columns), -1, np.int64)
        if not in_x.any() or not in_y.any():
            self.lacking += classes.size
            return classes
        columns, rows = columns[in_x], rows[in_y]
        west, north = int(columns.min()), int(rows.min())
        window = Window(west, north, int(columns.max()) - west + 1, int(rows.max()) - north + 1)
        if window.width * window.height > _MOST_READ and count > 1:
            half = count // 2
            return np.vstack([self.read(first, half), self.read(first + half, count - half)])
        with gdal_errors(self.name):
            pixels = self.file.read(1, window=window, masked=True)
        pixels = pixels[np.ix_(rows - north, columns - west)]
        values = np.ma.filled(pixels.astype(np.int64), -1)
        values[(values < 0) | (values == np.iinfo(np.int64).max)] = -1
        classes[np.ix_(in_y, in_x)] = values
        self.lacking += int((classes < 0).sum())
        self.used.update(np.unique(classes[classes >= 0]).tolist())
        if len(self.used) > _MOST_CLASSES:
            raise ReadError(
                f"{self.name}: has more than {_MOST_CLASSES:,} classes.",
                "Name a raster of classes, not of heights or other measures.",
            )
        return classes

    def surface(self, number: int) -> SurfaceEntry:
        """Return the surface of a class."""
        return self.surfaces.get(number, (f"class-{number}", {}))


def _indices(
    factor: float, offset: float, places: NDArray[np.floating[Any]], count: int
) -> NDArray[np.int64]:
    """Columns, or rows, of places in a raster with `count` of them, int64; -1 outside."""
    with np.errstate(over="ignore", invalid="ignore"):
        found = np.floor(factor * places + offset)
    return np.where((found >= 0) & (found < count), found, -1.0).astype(np.int64)


@contextlib.contextmanager
def open_classes(
    name: str, grid: PixelGrid, allow_remote: bool = False, allow_vrt: bool = False
) -> Iterator[ClassRaster]:
    """Open a raster of classes for the pixels of a grid, reprojected if necessary.

    Raises:
        ReadError: the file cannot be read, or holds no whole numbers.
    """
    with contextlib.ExitStack() as stack:
        file = stack.enter_context(open_local(name, allow_remote=allow_remote, allow_vrt=allow_vrt))
        with gdal_errors(name):
            if file.count != 1 or np.dtype(file.dtypes[0]).kind not in "iu":
                raise ReadError(
                    f"{name}: is no raster of classes, which has one band of whole numbers.",
                    "Name one, as export-dem --layer surface writes.",
                )
            surfaces = _surfaces(name, file)
            odd = file.crs is not None and crs_problem(file.crs.to_wkt()) is not None
            if grid.crs is not None and file.crs is not None and not odd and file.crs != grid.crs:
                refuse_other_body(name, file.crs, read_crs(grid.crs), "the DEM")
                west, _, _, north = grid.bounds
                # the class nearest to each pixel centre
                warped = WarpedVRT(
                    file,
                    crs=grid.crs,
                    transform=Affine(grid.dx, 0, west, 0, -grid.dy, north),
                    width=grid.columns,
                    height=grid.rows,
                    resampling=Resampling.nearest,
                    tolerance=_TOLERANCE,
                    add_alpha=file.nodata is None,
                )
                file = stack.enter_context(warped)
        _refuse_turned(name, transform_of(file), 0.0, "Resample it north up, as with gdalwarp.")
        yield ClassRaster(name, file, grid, surfaces)


def _surfaces(name: str, file: Any) -> dict[int, SurfaceEntry]:
    """Names, colours and soils of classes, from the raster and the .aux.xml file beside it."""
    found: dict[int, SurfaceEntry] = {}
    table = _table(Path(name + ".aux.xml"))
    try:
        colors = file.colormap(1)
    except ValueError:
        colors = {}
    names: set[str] = {"void"}
    for number in sorted(table.keys() | colors.keys()):
        title, members = table.get(number, ("", {}))
        title = title or f"class-{number}"
        while title in names:
            title += f"-{number}"
        names.add(title)
        color = {"color": list(colors[number][:3])} if number in colors else {}
        found[number] = (title, {**members, **color})
    return found


def _table(path: Path) -> dict[int, SurfaceEntry]:
    """Names and soils by class, from the .aux.xml file in which GDAL keeps them."""
    if not path.is_file():
        return {}
    try:
        with open_file(path) as file:
            band = tree_of(file.read()).find("PAMRasterBand")
    except (ExpatError, EntityError) as error:
        raise ReadError(
            f"{path}: cannot be read as XML ({error}).",
            "Correct the file, or move it elsewhere; then the classes have no names.",
        ) from error
    except OSError as error:
        raise ReadError.of(path, error) from error
    if band is None:
        return {}
    names = [(item.text or "").strip() for item in band.findall("CategoryNames/Category")]
    found: dict[int, SurfaceEntry] = {i: (text, {}) for i, text in enumerate(names)}
    titles = [
        column.findtext("Name") or ""
        for column in band.findall("GDALRasterAttributeTable/FieldDefn")
    ]
    keys = {layer.title: _SOILS[layer.name] for layer in LAYERS.values() if layer.name in _SOILS}
    for row in band.findall("GDALRasterAttributeTable/Row"):
        cells = dict(zip(titles, (cell.text or "" for cell in row.findall("F")), strict=False))
        try:
            number = int(cells.get("Value", ""))
        except ValueError:
            continue
        known = {keys[title]: _number(cell) for title, cell in cells.items() if title in keys}
        members = {key: value for key, value in known.items() if value is not None}
        found[number] = (cells.get("Class") or found.get(number, ("", {}))[0], members)
    return found


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and 0 <= value < 1e6 else None
