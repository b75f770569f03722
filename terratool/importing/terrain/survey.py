"""The first reading of a DEM: how high it is, where it is unknown, what covers it."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.enums import Resampling
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine
from rasterio.vrt import WarpedVRT
from rasterio.windows import Window

from terratool.errors import ReadError
from terratool.importing.rasters import complaints
from terratool.importing.samples import HeightSource, PixelLattice, extremes
from terratool.importing.terrain.writing import Elements, element
from terratool.kernels import importing as kernels
from terratool.raster.layers import LAYERS

Ints = NDArray[np.int64]
_MOST_CLASSES = 65536
_MOST_READ = 1 << 24
"""Classes may be much finer than the DEM; about so many pixels are read at a time."""
_SOILS = {
    "cohesion": "cohesion",
    "friction": "fricAngle",
    "sinkage": "sinkage",
    "sonar": "sonarRefl",
}
"""Layers of a DEM by name, and their keys in a surface."""


@dataclass(slots=True)
class ClassRaster:
    """A raster of classes, open, sampled at the pixel centres of a lattice.

    Attributes:
        surfaces: by class, a name and the members of its surface.
        used: the classes met so far, in the order of their numbers.
        lacking: pixels of the lattice without a class.
    """

    name: str
    file: Any
    lattice: PixelLattice
    surfaces: dict[int, tuple[str, dict[str, Any]]]
    used: set[int] = field(default_factory=set)
    lacking: int = 0

    def read(self, first: int, count: int) -> Ints:
        """Classes of some rows from the south, (count, columns) int64; -1 for none."""
        at = self.lattice
        x = at.west + (np.arange(at.columns) + 0.5) * at.dx
        y = at.south + (np.arange(first, first + count) + 0.5) * at.dy
        inverse = ~self.file.transform
        columns = np.floor(inverse.a * x + inverse.c).astype(np.int64)
        rows = np.floor(inverse.e * y + inverse.f).astype(np.int64)
        in_x = (columns >= 0) & (columns < self.file.width)
        in_y = (rows >= 0) & (rows < self.file.height)
        classes = np.full((count, at.columns), -1, np.int64)
        if not in_x.any() or not in_y.any():
            self.lacking += classes.size
            return classes
        west, north = columns[in_x].min(), rows[in_y].min()
        window = Window(
            int(west), int(north),
            int(columns[in_x].max() - west + 1), int(rows[in_y].max() - north + 1),
        )  # fmt: skip
        if window.width * window.height > _MOST_READ and count > 1:
            half = count // 2
            return np.vstack([self.read(first, half), self.read(first + half, count - half)])
        with complaints(self.name):
            pixels = self.file.read(1, window=window, masked=True)
        pixels = pixels[np.ix_(rows[in_y] - north, columns[in_x] - west)]
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

    def surface(self, number: int) -> tuple[str, dict[str, Any]]:
        """Name and members of the surface of a class."""
        return self.surfaces.get(number, (f"class-{number}", {}))


@contextlib.contextmanager
def open_classes(name: str, lattice: PixelLattice) -> Iterator[ClassRaster]:
    """Open a raster of classes for the pixels of a lattice, reprojected if need be.

    Raises:
        ReadError: it cannot be read, or holds no whole numbers.
    """
    with contextlib.ExitStack() as stack:
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with complaints(name):
            file = stack.enter_context(rasterio.open(name))
        if file.count != 1 or np.dtype(file.dtypes[0]).kind not in "iu":
            raise ReadError(
                f"{name}: is no raster of classes, which has one band of whole numbers.",
                "Name one, as export-dem --layer surface writes.",
            )
        surfaces = _surfaces(name, file)
        if lattice.crs is not None and file.crs is not None and file.crs != lattice.crs:
            with complaints(name):
                file = stack.enter_context(_warped(file, lattice))
        if abs(file.transform.b) + abs(file.transform.d) > 0:
            raise ReadError(
                f"{name}: its pixels are turned against its reference system.",
                "Resample it north up, as with gdalwarp.",
            )
        yield ClassRaster(name, file, lattice, surfaces)


def _warped(file: Any, lattice: PixelLattice) -> WarpedVRT:
    """The class that lies nearest to each pixel centre of a lattice."""
    west, _, _, north = lattice.bounds
    return WarpedVRT(
        file,
        crs=lattice.crs,
        transform=Affine(lattice.dx, 0.0, west, 0.0, -lattice.dy, north),
        width=lattice.columns,
        height=lattice.rows,
        resampling=Resampling.nearest,
        tolerance=0.01,
        add_alpha=file.nodata is None,
    )


def _surfaces(name: str, file: Any) -> dict[int, tuple[str, dict[str, Any]]]:
    """Names, colours and soils of classes, as far as the file or the one beside it has them."""
    found: dict[int, tuple[str, dict[str, Any]]] = {}
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


def _table(path: Path) -> dict[int, tuple[str, dict[str, Any]]]:
    """Names and soils by class from the file in which GDAL keeps them."""
    if not path.is_file():
        return {}
    try:
        band = ElementTree.parse(path).getroot().find("PAMRasterBand")
    except (ElementTree.ParseError, OSError) as error:
        raise ReadError(
            f"{path}: cannot be read as XML ({error}).", "Mend it, or move it away."
        ) from error
    if band is None:
        return {}
    names = [(item.text or "").strip() for item in band.findall("CategoryNames/Category")]
    found: dict[int, tuple[str, dict[str, Any]]] = {i: (text, {}) for i, text in enumerate(names)}
    titles = [
        column.findtext("Name") or ""
        for column in band.findall("GDALRasterAttributeTable/FieldDefn")
    ]
    keys = {
        f"{layer.bands[0]} ({layer.unit})" if layer.unit else layer.bands[0]: _SOILS[layer.name]
        for layer in LAYERS.values()
        if layer.name in _SOILS
    }
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


_ROWS = 256
_VOID = int(np.iinfo(np.int64).max)
"""A class of its own, for pixels without a height."""


@dataclass(slots=True)
class Survey:
    """What one reading of all rows shows.

    Attributes:
        low, high: of the heights.
        unknown: pixels without one.
        heights: (rows, columns) float64, row 0 the southernmost, if they fit into memory.
        cover: elements in a grid of pixels that carry surfaces, and the void.
        surface_types: the surfaces by name, as the definition has them.
        surfaces: pixels of each.
        notes: sentences about what was found.
    """

    low: float = math.inf
    high: float = -math.inf
    unknown: int = 0
    heights: NDArray[np.float64] | None = None
    cover: Elements = field(default_factory=Elements)
    surface_types: dict[str, Any] = field(default_factory=dict)
    surfaces: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def survey_of(
    source: HeightSource,
    classes: str | None,
    void: bool,
    most: int,
    progress: Callable[[int], object],
) -> Survey:
    """Read all rows once.

    Args:
        source: the DEM.
        classes: name of a raster of classes, or None.
        void: whether what is unknown is covered by the void.
        most: DEMs of up to this many pixels are kept in memory.
        progress: gets numbers of pixels.

    Raises:
        ReadError: a file is broken, or there is no height at all.
    """
    lattice = source.lattice
    survey = Survey()
    counts: dict[int, int] = {}
    with ExitStack() as stack:
        raster = None if classes is None else stack.enter_context(open_classes(classes, lattice))
        if lattice.rows * lattice.columns <= most:
            survey.heights = np.empty((lattice.rows, lattice.columns))
        # from the north, as files are read the quickest
        for first in reversed(range(0, lattice.rows, _ROWS)):
            heights = source.read(first, min(_ROWS, lattice.rows - first))
            if survey.heights is not None:
                survey.heights[first : first + len(heights)] = heights
            low, high, unknown, _ = extremes(heights)
            survey.low, survey.high = min(survey.low, low), max(survey.high, high)
            survey.unknown += unknown
            holes = np.isnan(heights) if void and unknown else None
            _cover(survey, raster, first, holes, len(heights), counts)
            progress(heights.size)
        _name(survey, raster, counts)
    if survey.unknown == lattice.rows * lattice.columns:
        raise ReadError(
            "Every pixel is nodata: there is no height.", "Take another part, band or file."
        )
    return survey


def _cover(
    survey: Survey,
    raster: ClassRaster | None,
    first: int,
    holes: NDArray[np.bool_] | None,
    count: int,
    counts: dict[int, int],
) -> None:
    """Cover some rows with rectangles, and count their pixels by class."""
    if raster is not None:
        classes = raster.read(first, count)
    elif holes is not None:
        classes = np.full(holes.shape, -1, np.int64)
    else:
        return
    if holes is not None:
        classes[holes] = _VOID
    for column, row, width, height, number in kernels.cut_rectangles(classes).tolist():
        name = "void" if number == _VOID else raster.surface(number)[0] if raster else ""
        counts[number] = counts.get(number, 0) + width * height
        cell, span = (column, first + row), (width, height)
        survey.cover.add(element("flat", cell, span, vScale=0, surface=name))


def _name(survey: Survey, raster: ClassRaster | None, counts: dict[int, int]) -> None:
    for number in sorted(counts):
        name, members = ("void", {"void": True}) if number == _VOID else ("", {})
        if raster is not None and number != _VOID:
            name, members = raster.surface(number)
        survey.surface_types[name] = members
        survey.surfaces[name] = counts[number]
    if raster is not None and raster.lacking:
        survey.notes = (f"{raster.name} has no class for {raster.lacking:,} pixels: no surface.",)
