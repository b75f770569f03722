"""Point clouds as sources of heights: which files are clouds, and what becomes of their points."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS

from terratool.definition.crs import LOCAL, metric_crs
from terratool.definition.findings import Bounds
from terratool.errors import ReadError, RequestError
from terratool.importing.cells import HEIGHTS, PointCells, Votes, cells_over
from terratool.importing.ground import CELL, FilteredGround, filter_ground
from terratool.importing.meanings import side_unit
from terratool.importing.rasters import HIGHEST
from terratool.importing.types import PixelGrid, SampledHeights, SourceOptions, StatedPlace
from terratool.io import csv_, las
from terratool.io.clouds import PointReader, numbers_of, reader_of, world_columns
from terratool.io.crs import read_crs, spell_crs
from terratool.io.text_points import layout_of, numbers_in, read_points
from terratool.io.units import METRE
from terratool.io.xyz import find_grid
from terratool.report.numbers import coordinates, round_up
from terratool.report.wording import count_of
from terratool.text.files import open_file

Floats = NDArray[np.float64]

EACH = 4
"""Points in a cell on average, where no resolution is given."""
MOST_CELLS = 1 << 28
"""Most cells; these take 4 GiB."""
FREE_CELLS = 1 << 20
"""Cells that a cloud may have, however few its points."""
CELLS_EACH = 100
"""Cells for each point that a larger cloud may have; points far off would make millions."""
MOST_FILTERED = 1 << 24
"""Most cells of the filter of ground."""
MOST_KEPT = 1 << 24
"""Most points that are kept in memory; the files of more are read again."""

_GROUND, _NOISE = 2, (7, 18)
"""Classes of LAS that are ground, and that are errors of measurement."""
_STEPS = 10
"""Least steps of the numbers of coordinates in a cell."""
_THIN = 1e-12
"""Share of the variance along a cloud that the variance across has to be more than."""
_COARSE = 4096
"""Most cells along the longer side of a cloud in which its points are looked for."""
_MANY = 16
"""Least points in a cell on average by which its area counts."""
_SAMPLE = 1 << 22
"""Bytes of a text that tell a grid from a cloud."""
_HEAD = 1 << 16

_ALWAYS = (".las", ".laz", ".pcd", ".npz")
TEXTS = (".xyz", ".txt", ".csv")
"""Suffixes of texts that may be clouds of points."""

_LAS = (".las", ".laz")
_WANTED = dict.fromkeys("xyz", 0)
_OF_LAS = {"class": 0, "withheld": 0}
_faces = re.compile(rb"^element\s+(?:face|tristrips)\s+0*[1-9]", re.MULTILINE).search
_vertices = re.compile(rb"^element\s+vertex\s", re.MULTILINE).search


# --- which files are clouds ----------------------------------------------------------------------


def is_cloud(name: str, asked: bool = False) -> bool:
    """Tell whether a file is read as a cloud of points: by its suffix, and by how it begins.

    A PLY without faces is one, and a text whose first points form no grid by `find_grid`.

    Args:
        name: path of the file.
        asked: whether an option about clouds is given; then any text of x, y and z is one.
    """
    suffix = Path(name).suffix.lower()
    if suffix in _ALWAYS:
        return True
    if suffix != ".ply" and suffix not in TEXTS:
        return False
    try:
        with open_file(name) as file:
            head = file.read(_HEAD if suffix == ".ply" else _SAMPLE)
    except (OSError, ValueError):
        return False  # what reads rasters or meshes says why
    if suffix == ".ply":
        head = head.partition(b"end_header")[0]
        return _vertices(head) is not None and _faces(head) is None
    layout = layout_of(head)
    if layout is None:
        return False
    if asked:
        return True
    try:
        lines = head[layout.skipped :] if len(head) < _SAMPLE else head[layout.skipped :
            head.rfind(b"\n") + 1]  # fmt: skip
        points = numbers_in(Path(name), lines, layout)
    except ReadError:
        return True  # the same error is raised again
    return find_grid([points[(np.abs(points[:, :2]) < HIGHEST).all(axis=1)]]) is None


# --- points --------------------------------------------------------------------------------------


class _Points(NamedTuple):
    """A batch of points.

    Attributes:
        x, y, z: (n,) float64, finite.
        classes: (n,) uint8, classes of LAS; None for other formats.
    """

    x: Floats
    y: Floats
    z: Floats
    classes: NDArray[np.uint8] | None = None

    def only(self, kept: NDArray[np.bool_]) -> _Points:
        """Return the points that a mask, (n,), marks."""
        return self if kept.all() else _Points(*(None if a is None else a[kept] for a in self))  # type: ignore[arg-type]


@dataclass(slots=True)
class _Survey:
    """Result of the first reading of a cloud.

    Attributes:
        count: number of usable points.
        broken: number of points with coordinates that are no numbers below `HIGHEST`.
        noise: number of points that the file marks as errors or withholds.
        low, high: least and largest coordinates, (3,) float64.
        moments: Σ of the squares and the product of x and y from the first point on, (3,), and Σ of
            x and y, (2,).
        single: largest size of an x or y that the file has in single precision.
        classes: (256,) number of points of each class.
    """

    count: int = 0
    broken: int = 0
    noise: int = 0
    low: Floats = field(default_factory=lambda: np.full(3, np.inf))
    high: Floats = field(default_factory=lambda: np.full(3, -np.inf))
    moments: Floats = field(default_factory=lambda: np.zeros(5))
    single: float = 0.0
    classes: NDArray[np.int64] = field(default_factory=lambda: np.zeros(256, np.int64))
    _at: tuple[float, float] = (0.0, 0.0)

    def add(self, points: _Points) -> None:
        """Add a batch."""
        if not len(points.x):
            return
        if not self.count:
            self._at = float(points.x[0]), float(points.y[0])
        self.count += len(points.x)
        for axis, values in enumerate(points[:3]):
            self.low[axis] = min(self.low[axis], values.min())
            self.high[axis] = max(self.high[axis], values.max())
        x, y = points.x - self._at[0], points.y - self._at[1]
        self.moments += x @ x, x @ y, y @ y, x.sum(), y.sum()
        if points.classes is not None:
            self.classes += np.bincount(points.classes, minlength=256)

    @property
    def extent(self) -> Bounds:
        """West, south, east and north of the points."""
        return float(self.low[0]), float(self.low[1]), float(self.high[0]), float(self.high[1])

    @property
    def is_thin(self) -> bool:
        """Whether all points lie on one line: their least variance is `_THIN` of the largest."""
        xx, xy, yy, x, y = self.moments / self.count
        spread = np.linalg.eigvalsh([[xx - x * x, xy - x * y], [xy - x * y, yy - y * y]])
        return bool(spread[0] <= _THIN * spread[1])

    @property
    def step(self) -> float:
        """Step of x and y in the numbers of the file, if these are of single precision; else 0."""
        return float(np.spacing(np.float32(self.single))) if self.single else 0.0


@dataclass(slots=True)
class _CloudFile:
    """File of a cloud, which is read once where its points fit into memory.

    Attributes:
        path: the file.
        options: options of reading.
        survey: result of the first reading.
    """

    path: Path
    options: SourceOptions
    survey: _Survey = field(default_factory=_Survey)
    _kept: list[_Points] | None = None
    _proposed: float = 0.0

    def batches(self) -> Iterator[_Points]:
        """Yield the usable points in file order.

        Raises:
            ReadError: the file cannot be read.
            RequestError: a package is missing.
        """
        yield from self._read() if self._kept is None else self._kept

    def look(self) -> None:
        """Read all points for the first time; fill in the survey."""
        kept: list[_Points] | None = []
        for points in self._read(self.survey):
            self.survey.add(points)
            if self.survey.count > MOST_KEPT:
                kept = None
            elif kept is not None:
                kept.append(points)
        self._kept = kept

    def proposed(self) -> float:
        """Side of cells with `EACH` points on average, and wider than the numbers are rounded.

        The area of the points is that of the coarse cells that have any, the smallest that hold
        `_MANY` points on average.
        """
        if self._proposed:
            return self._proposed
        survey = self.survey
        west, south, east, north = survey.extent
        side = max(east - west, north - south) / _COARSE
        shape = [int((high - low) // side) + 1 for low, high in ((south, north), (west, east))]
        seen = np.zeros(shape, bool)
        for points in self.batches():
            rows, columns = (points.y - south) // side, (points.x - west) // side
            seen[rows.astype(np.int64), columns.astype(np.int64)] = True
        while seen.size > 1 and survey.count < _MANY * np.count_nonzero(seen):
            seen = np.pad(seen, [(0, length % 2) for length in seen.shape])
            seen = seen[::2, ::2] | seen[1::2, ::2] | seen[::2, 1::2] | seen[1::2, 1::2]
            side *= 2
        least = side * math.sqrt(np.count_nonzero(seen) * EACH / survey.count)
        self._proposed = round_up(max(least, _STEPS * survey.step))
        return self._proposed

    def _reader(self) -> PointReader:
        """Reader of the file: texts of numbers are read the quick way if nothing is quoted."""
        if self.path.suffix.lower() not in TEXTS:
            return reader_of(self.path)
        with open_file(self.path) as file:
            lines = file.read(_HEAD).partition(b"\n")[2]  # names may be quoted
        quoted = b'"' in lines and self.path.suffix.lower() == ".csv"
        return csv_.read_points if quoted else read_points

    def _read(self, survey: _Survey | None = None) -> Iterator[_Points]:
        """Yield the usable points; count the others in a survey."""
        las_columns = _OF_LAS if self.path.suffix.lower() in _LAS else {}
        try:
            for batch in self._reader()(self.path, _WANTED | las_columns):
                columns = world_columns(self.path, batch)
                x, y, z = (numbers_of(columns[name]) for name in "xyz")
                if self.options.up == "y":
                    y, z = -z, y
                x, y, z = (self.options.scale * one for one in (x, y, z))
                finite = (np.abs(x) < HIGHEST) & (np.abs(y) < HIGHEST) & (np.abs(z) < HIGHEST)
                good, classes = finite, columns.get("class")
                if classes is not None:
                    classes = classes.astype(np.uint8)
                    good = finite & ~np.isin(classes, _NOISE) & (columns["withheld"] == 0)
                points = _Points(x, y, z, classes).only(good)
                if survey is not None:
                    survey.broken += int((~finite).sum())
                    survey.noise += int((finite & ~good).sum())
                    flat = ("x", "z") if self.options.up == "y" else ("x", "y")
                    if len(points.x) and any(columns[name].dtype == np.float32 for name in flat):
                        largest = max(np.abs(points.x).max(), np.abs(points.y).max())
                        survey.single = max(survey.single, float(largest))
                yield points
        except OSError as error:
            raise ReadError.of(self.path, error) from error


# --- heights -------------------------------------------------------------------------------------


def sample_cloud(name: str, options: SourceOptions) -> SampledHeights:
    """Gather the points of a cloud in square cells, whose edges are multiples of their side.

    Raises:
        ReadError: the file cannot be read, or its points cover no area.
        RequestError: an option makes no sense for this cloud.
    """
    kind = options.heights or "mean"
    if kind not in HEIGHTS:
        raise RequestError(f"A cell has no {kind} height.", f"Choose {', '.join(HEIGHTS)}.")
    if not 0 < options.scale < HIGHEST or options.up not in (None, "y", "z"):
        raise RequestError(
            f"The scale is {options.scale:g}, and {options.up or 'z'} points up.",
            "Give a factor above 0, and y or z.",
        )
    about: list[str] = []
    file = _CloudFile(Path(name), options)
    file.look()
    survey = file.survey
    _refuse(name, survey)
    crs, unit, metre = _system_of(file, about)
    with _enough_memory(name):
        x, y = cells_over(
            survey.extent, file.proposed() if options.resolution is None else options.resolution,
            options.bounds, min(MOST_CELLS, max(FREE_CELLS, CELLS_EACH * survey.count)),
            file.proposed,
        )  # fmt: skip
        ground = _ground_of(file, metre) if options.ground else None
        cells, many = PointCells(x, y, kind), 0
        for points in file.batches():
            if ground is not None:
                points = points.only(ground.holds(points))
                many += len(points.x)
            cells.add(*points[:3])
        heights = cells.heights
    counts = cells.counts
    if not counts.any():
        raise RequestError(
            f"{name}: no point lies in the cells.",
            f"Give other bounds; its points lie in {coordinates(survey.extent)}.",
        )
    if ground is not None:
        about.append(f"{many:,} of {survey.count:,} points are ground, {ground.why}.")
    about += _notes(survey, kind, cells, options.resolution is None)
    grid = PixelGrid(
        cells.grid.west, cells.grid.south, cells.grid.dx, cells.grid.dy,
        cells.grid.columns, cells.grid.rows, crs, unit,
    )  # fmt: skip

    def classes() -> NDArray[np.int16]:
        votes = Votes(x, y, np.flatnonzero(survey.classes))
        for points in file.batches():
            if ground is not None:
                points = points.only(ground.holds(points))
            assert points.classes is not None
            votes.add(points.x, points.y, points.classes)
        return votes.commonest

    stated = StatedPlace(crs, unit)
    own = classes if survey.classes.any() else None
    return SampledHeights(grid, heights, tuple(about), stated, own)


@contextlib.contextmanager
def _enough_memory(name: str) -> Iterator[None]:
    """Turn a lack of memory in the block into a sentence.

    Raises:
        RequestError: memory ran out.
    """
    try:
        yield
    except MemoryError as error:
        raise RequestError(
            f"{name}: its cells do not fit into memory.",
            "Give a coarser --resolution, or take a part by --bounds.",
        ) from error


def _refuse(name: str, survey: _Survey) -> None:
    """Refuse points that cover no area.

    Raises:
        ReadError: they do not.
    """
    others = survey.broken + survey.noise
    if not survey.count and others:
        raise ReadError(
            f"{name}: none of its {count_of(others, 'point')} has coordinates that are numbers.",
            "Export it again.",
        )
    if survey.count < 2:
        raise ReadError(
            f"{name}: has {'one point only' if survey.count else 'no points'}.",
            "Name a cloud that covers an area.",
        )
    if survey.is_thin:
        raise ReadError(
            f"{name}: all its points lie on one line.", "Name a cloud that covers an area."
        )


def _notes(survey: _Survey, kind: str, cells: PointCells, chosen: bool) -> Iterator[str]:
    """Yield sentences on how points became heights, and on those that did not."""
    side, seen = cells.grid.dx, int((cells.counts > 0).sum())
    each = int(cells.counts.sum()) / seen
    if chosen:
        yield f"No --resolution was given: cells of {side:g} have {EACH} points or more."
    why = ", which noise moves least" if kind == "mean" else ""
    yield (
        f"{survey.count:,} points, {each:.3g} in each cell that has any: their {kind} height "
        f"counts{why}."
    )
    if survey.broken:
        yield (
            f"{count_of(survey.broken, 'point')} with coordinates that are no numbers below "
            f"{HIGHEST:g} {'was' if survey.broken == 1 else 'were'} left out."
        )
    if survey.noise:
        yield (
            f"{count_of(survey.noise, 'point')} that the file marks as noise, or withholds, "
            f"{'was' if survey.noise == 1 else 'were'} left out."
        )
    if survey.step * _STEPS > side:
        yield (
            f"x and y are in single precision, in steps of {survey.step:g} so far from 0, for "
            f"cells of {side:g}: export the points with doubles, or nearer to 0."
        )


def _system_of(file: _CloudFile, about: list[str]) -> tuple[str | None, str, float]:
    """Reference system of a cloud as a definition spells it, its unit, and its units in a metre.

    Raises:
        RequestError: the file is scaled or turned, and has a reference system; or the ground of a
            file in degrees is to be filtered.
    """
    spelled = ""
    if file.path.suffix.lower() in _LAS:
        spelled = las.read_system(file.path)
    if not spelled:
        return None, "", 1.0
    if file.options.scale != 1.0 or file.options.up == "y":
        raise RequestError(
            f"{file.path}: says its reference system, so that it is neither scaled nor turned.",
            "Leave out --scale and --up.",
        )
    try:
        system: CRS = read_crs(spelled)
    except RequestError:
        about.append("The reference system of the file is not known, and was left out.")
        return None, "", 1.0
    if system.is_geographic and file.options.ground and not file.survey.classes[_GROUND]:
        raise RequestError(
            f"{file.path}: is in degrees, and the filter of ground is about metres.",
            "Reproject it by pdal translate, or leave out --ground.",
        )
    west, south, east, north = file.survey.extent
    sides = METRE
    if system.is_projected:
        sides = side_unit(system)  # LAS says no other unit of heights
        if sides != METRE:
            about.append(f"x, y and heights are in {sides.plural}; they are kept as they are.")
    elif system.is_geographic:
        metric = metric_crs(system.to_wkt(), (west + east) / 2, (south + north) / 2)
        named = "a projection in metres" if metric == LOCAL else metric
        about.append(
            f"x and y are degrees, so that no slope is right: reproject to {named} by pdal "
            "translate."
        )
    return spell_crs(system, about), sides.symbol, 1.0 / sides.metres


# --- ground --------------------------------------------------------------------------------------


class _GroundRule(NamedTuple):
    """Which points are ground: those of a class, or those near a filtered surface."""

    why: str
    surface: FilteredGround | None = None

    def holds(self, points: _Points) -> NDArray[np.bool_]:
        """Tell which points are ground."""
        if self.surface is not None:
            return self.surface.holds(*points[:3])
        assert points.classes is not None
        found: NDArray[np.bool_] = points.classes == _GROUND
        return found


def _ground_of(file: _CloudFile, metre: float) -> _GroundRule:
    """Find the ground of a cloud, by its classes or by a filter of cells with several points.

    Raises:
        RequestError: the filter would have too many cells.
    """
    if file.survey.classes[_GROUND]:
        return _GroundRule(f"by their class {_GROUND}")
    side = max(file.proposed(), CELL * metre)
    extent = file.survey.extent
    x, y = cells_over(extent, side, None, MOST_FILTERED, file.proposed)
    cells = PointCells(x, y, "lowest")
    for points in file.batches():
        cells.add(*points[:3])
    surface = filter_ground(cells.heights, cells.grid, metre)
    return _GroundRule(f"by a morphological filter of cells of {side:.4g}", surface)
