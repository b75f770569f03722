"""Points in lines of text, each x, y and z, and the grid that they may form.

GDAL's driver for such text gives a missing point the height 0 where the heights are whole numbers
from 0 to 255, reads single precision, and wants its rows in order; so these are read here.
"""

from __future__ import annotations

import contextlib
import math
import re
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray
from rasterio.windows import Window

from terratool.errors import DAMAGED, ReadError
from terratool.io.axis_names import axis_columns
from terratool.io.text_points import TextLayout, numbers_in, table_of
from terratool.text.files import open_file

Points = NDArray[np.float64]
"""Points, (n, 3) float64: x, y and z; NaN in z for no height."""

FILLED = 0.25
"""Least share of a grid's cells that have a point; points that fill less are a cloud."""

_HEAD = 1 << 14
_SEEN = 20
"""Lines of which each has to be numbers, for a text to be one of points."""
_MOST_COLUMNS = 64
_FOLDER = "terratool-points-"
"""Begin of the names of temporary folders, which no other module uses."""
_DESCRIPTION = ".aux.xml"
_COMMENTS = (b"#", b"//", b"%")
_JITTER = 0.05
"""Largest distance of a coordinate from its grid, in spacings, for want of digits."""
_MOST_STEPS = 1 << 31
_MOST_PLACES = 1 << 20
"""Most different coordinates along an axis of a grid."""
_IN_MEMORY = 1 << 22
"""Most points that are kept in memory between the two passes; more are parsed twice."""
_PIECE = 1 << 22
"""Bytes that are parsed at a time, up to the end of the line."""
_MOST_LINE = 1 << 20
_CELLS = 1 << 20
"""Cells that are written at a time."""
_SNAPPED = 12
"""Digits to which a spacing is rounded where that moves no coordinate beyond its rounding."""

_number = re.compile(rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|nan", re.IGNORECASE).fullmatch
_comma_number = re.compile(rb"[+-]?\d+(?:,\d+)?(?:e[+-]?\d+)?", re.IGNORECASE).fullmatch
_word = re.compile(rb"[\"']?[a-z_][^,;<>{}=@]*", re.IGNORECASE).fullmatch


class XyzLayout(NamedTuple):
    """Layout of a text of points.

    Attributes:
        begin: number of bytes before the first point: comments and a header.
        separator: byte between two numbers; None for blanks and tabs.
        decimal_comma: whether numbers have a comma in place of the point.
        places: indices of the columns of x, y and z.
        columns: number of columns.
    """

    begin: int
    separator: bytes | None
    decimal_comma: bool
    places: tuple[int, int, int]
    columns: int

    def cells(self, line: bytes) -> list[bytes]:
        """Cells of a line, without blanks around them."""
        cells = [cell.strip() for cell in line.strip().split(self.separator)]
        return cells[:-1] if len(cells) == self.columns + 1 and not cells[-1] else cells


@dataclass(frozen=True, slots=True)
class PointGrid:
    """A grid of cells of equal size, with points at their centres.

    Attributes:
        west: x of the westernmost centres.
        south: y of the southernmost centres.
        dx: spacing along x.
        dy: spacing along y.
        columns: number of columns.
        rows: number of rows.
        whole: whether all heights are whole numbers of 32 bits, and none is NaN.
    """

    west: float
    south: float
    dx: float
    dy: float
    columns: int
    rows: int
    whole: bool

    def cells(self, points: Points) -> NDArray[np.int64]:
        """Index of each point's cell, (n,) int64, counted by rows from the north-west."""
        column = np.rint((points[:, 0] - self.west) / self.dx).astype(np.int64)
        row = np.rint((points[:, 1] - self.south) / self.dy).astype(np.int64)
        return (self.rows - 1 - row) * self.columns + column


def layout_of(path: Path) -> XyzLayout | None:
    """Return the layout of a text of points; None for a file of another kind.

    Raises:
        OSError: the file cannot be opened.
    """
    with open_file(path) as file:
        head = file.read(_HEAD)
    lines = head.splitlines(keepends=True)
    if len(head) == _HEAD:
        lines = lines[:-1]  # which may be cut
    begin, header = len(head) - len(head.removeprefix(b"\xef\xbb\xbf")), None
    lines[:1] = [line[begin:] for line in lines[:1]]
    while lines and (_is_comment(lines[0]) or (header is None and _is_header(lines[0]))):
        line = lines.pop(0)
        begin += len(line)
        # GDAL and others write the names of columns behind the sign of a comment
        header = line.strip() if not _is_comment(line) or _names_axes(line) else header
    some = [line for line in lines if not _is_comment(line)][:_SEEN]
    if len(some) < 2 or b"\0" in head:
        return None
    layout = _layout_by(some, begin, header)
    if layout is None or not all(_is_point(line, layout) for line in some):
        return None
    return layout


def _is_comment(line: bytes) -> bool:
    text = line.strip()
    return not text or text.startswith(_COMMENTS)


def _split(line: bytes) -> tuple[bytes | None, list[bytes]]:
    """Separator of a line, None for blanks, and its cells."""
    text = line.strip()
    separator = next((sign for sign in (b";", b",") if sign in text), None)
    if separator == b"," and len(text.split()) > 2 and all(map(_comma_number, text.split())):
        separator = None  # numbers with a decimal comma, between blanks
    cells = [cell.strip() for cell in text.split(separator)]
    if separator is not None and len(cells) > 3 and not cells[-1]:
        cells.pop()  # behind a separator at the end of the line
    return separator, cells


def _is_header(line: bytes) -> bool:
    _, cells = _split(line)
    return (
        3 <= len(cells) <= _MOST_COLUMNS and all(map(_word, cells)) and not any(map(_number, cells))
    )


def _names_axes(line: bytes) -> bool:
    """Return whether a comment names the three axes."""
    return _places(line.strip().lstrip(b"#/% ")) is not None


def _places(header: bytes) -> tuple[int, int, int] | None:
    """Columns of x, y and z by the names in a header; None where one is not named."""
    return axis_columns([cell.decode("utf-8", "replace") for cell in _split(header)[1]])


def _layout_by(lines: list[bytes], begin: int, header: bytes | None) -> XyzLayout | None:
    """Layout of a text by its first points and the names of its columns."""
    separator, cells = _split(lines[0])
    if not 3 <= len(cells) <= _MOST_COLUMNS:
        return None
    comma = separator != b"," and any(b"," in line for line in lines)
    places = None if header is None else _places(header.lstrip(b"#/% "))
    if places is None or max(places) >= len(cells):
        places = (0, 1, 2)
    return XyzLayout(begin, separator, comma, places, len(cells))


def _is_point(line: bytes, layout: XyzLayout) -> bool:
    cells = layout.cells(line)
    if len(cells) != layout.columns:
        return False
    wanted = [cells[place] for place in layout.places]
    if layout.decimal_comma:
        wanted = [cell.replace(b",", b".") for cell in wanted]
    return all(map(_number, wanted))


def read_points(path: Path, layout: XyzLayout) -> Iterator[Points]:
    """Yield the points of a text, some 100,000 at a time.

    Raises:
        ReadError: a line is no point or very long, or a coordinate is no finite number.
    """
    with open_file(path) as file:
        file.seek(layout.begin)
        while text := file.read(_PIECE):
            text += file.readline(_MOST_LINE)
            if text[-1:] != b"\n" and file.read(1):
                raise ReadError(f"{path}: has a line of more than {_MOST_LINE >> 20} MiB.", DAMAGED)
            points = _parse(path, text, layout)
            if not np.isfinite(points[:, :2]).all():
                raise ReadError(f"{path}: has a point that lies nowhere.", DAMAGED)
            yield points


def _parse(path: Path, text: bytes, layout: XyzLayout) -> Points:
    """Points of whole lines, (n, 3) float64; each line is one of the layout's columns."""
    if any(sign in text for sign in _COMMENTS):
        text = b"\n".join(line for line in text.split(b"\n") if not _is_comment(line))
    separator = "" if layout.separator is None else layout.separator.decode()
    table = table_of(separator, layout.decimal_comma)
    try:
        points = numbers_in(path, text, TextLayout(layout.places, 0, table))
        wrong = None if _is_even(text, len(points), layout) else _wrong_line(text, layout)
    except ReadError:
        wrong = _wrong_line(text, layout)
        if wrong is None:
            raise
    if wrong is not None:
        raise ReadError(
            f"{path}: has a line that is no point ({wrong}).",
            "Write x, y and z in each line, as numbers with a point.",
        )
    return points


def _is_even(text: bytes, rows: int, layout: XyzLayout) -> bool:
    """Whether so many rows have as many cells as the layout, by their separators."""
    if layout.separator is not None:
        return text.count(layout.separator) == rows * (layout.columns - 1)
    return len(text.split()) == rows * layout.columns and (layout.decimal_comma or b"," not in text)


def _wrong_line(text: bytes, layout: XyzLayout) -> str | None:
    """Begin of the first line that is no point; None if all are."""
    lines = (line for line in text.split(b"\n") if line.strip() and not _is_point(line, layout))
    found = next(lines, None)
    return None if found is None else found.strip()[:40].decode("utf-8", "replace")


def find_grid(batches: Iterable[Points]) -> PointGrid | None:
    """Return the grid of regular spacings that points form, if they fill a quarter of its cells.

    Args:
        batches: all points, (n, 3) float64 each.
    """
    axes = [np.empty(0), np.empty(0)]
    count, whole = 0, True
    for points in batches:
        count += len(points)
        z = points[:, 2]
        whole = whole and bool((np.abs(z) < 2**31).all() and (z == np.rint(z)).all())
        axes = [np.union1d(known, points[:, at]) for at, known in enumerate(axes)]
        if max(map(len, axes)) > _MOST_PLACES:
            return None
    if count < 2:
        return None
    for x, y in product(_spacings(axes[0]), _spacings(axes[1])):
        dx, dy = x.step or y.step, y.step or x.step
        if dx and x.places * y.places * FILLED <= count:
            return PointGrid(x.first, y.first, dx, dy, x.places, y.places, whole)
    return None


class _Spacing(NamedTuple):
    """Equal steps along an axis.

    Attributes:
        first: lowest coordinate.
        step: distance of neighbours; 0 for a single coordinate.
        places: number of coordinates with those that are missing between.
    """

    first: float
    step: float
    places: int


def _spacings(places: NDArray[np.float64]) -> Iterator[_Spacing]:
    """Yield equal steps that hold all coordinates, which are sorted, the finest first.

    Where digits were cut off, coordinates of one column may differ by the last one, so that steps
    of that hold them, too.
    """
    if len(places) == 1:
        yield _Spacing(float(places[0]), 0.0, 1)
    groups = places
    while len(groups) > 1:
        with np.errstate(all="ignore"):  # of coordinates of any size
            gaps = np.diff(groups)
            least = float(gaps.min())
            # rounded coordinates differ in their gaps, so that each gap is counted by itself
            usual = float(np.median(gaps[gaps < 1.5 * least]))
            count = float(np.rint(gaps / usual).sum())
            step = _snapped((groups[-1] - groups[0]) / count, count, groups)
            off = places - groups[0]
            worst = float(np.abs(off - np.rint(off / step) * step).max())
        if count < _MOST_STEPS and 0.0 < step < math.inf and worst <= _JITTER * step:
            yield _Spacing(float(groups[0]), step, int(count) + 1)
        # the least gaps may be noise of one coordinate
        apart = np.flatnonzero(gaps > 4.0 * least) + 1
        groups = groups[np.concatenate([[0], apart])]


def _snapped(step: float, count: float, places: NDArray[np.float64]) -> float:
    """Return a step of few digits within the rounding of the coordinates, or the step as it is."""
    step = float(step)
    short = float(f"{step:.{_SNAPPED}g}")
    rounding = 4.0 * np.spacing(max(abs(float(places[0])), abs(float(places[-1]))))
    return short if abs(short - step) * count <= rounding else step


@contextlib.contextmanager
def as_raster(path: Path, layout: XyzLayout) -> Iterator[Path]:
    """Make a GeoTIFF of a text of points, for the block.

    A description that GDAL keeps beside the text is taken over.

    Raises:
        ReadError: a line is no point, the points form no grid, or two of one place differ.
        OSError: a file cannot be opened or written.
    """
    points = PointText(path, layout)
    grid = find_grid(points)
    if grid is None:
        raise cloud(path)
    empty = float(np.iinfo(np.int32).min) if grid.whole else math.nan
    with tempfile.TemporaryDirectory(prefix=_FOLDER) as folder:
        raster = Path(folder, "grid.tif")
        with tempfile.TemporaryFile(dir=folder) as file:
            heights = _heights_of(path, grid, points, file, empty)
            _write(raster, grid, heights, empty)
        beside = path.with_name(f"{path.name}{_DESCRIPTION}")
        if beside.is_file():
            with open_file(beside) as description:
                raster.with_name(f"{raster.name}{_DESCRIPTION}").write_bytes(description.read())
        yield raster


def made_of_points(file: Any) -> bool:
    """Return whether an open rasterio dataset is one that `as_raster` made."""
    return Path(file.name).parent.name.startswith(_FOLDER)


def _write(raster: Path, grid: PointGrid, heights: NDArray[Any], empty: float) -> None:
    """Write heights by rows from the north as a GeoTIFF."""
    corner = grid.west - grid.dx / 2, grid.south + (grid.rows - 0.5) * grid.dy
    place = Affine(grid.dx, 0.0, corner[0], 0.0, -grid.dy, corner[1])
    with rasterio.open(
        raster, "w", driver="GTiff", width=grid.columns, height=grid.rows, count=1,
        dtype=heights.dtype, nodata=empty, transform=place, BIGTIFF="IF_SAFER",
    ) as file:  # fmt: skip
        some = max(1, _CELLS // grid.columns)
        for row in range(0, grid.rows, some):
            part = heights[row : row + some]
            file.write(part, 1, window=Window(0, row, grid.columns, len(part)))


def _heights_of(
    path: Path, grid: PointGrid, batches: Iterable[Points], file: BinaryIO, empty: float
) -> NDArray[Any]:
    """Heights of a grid by rows from the north, (rows, columns) int32 or float64, kept in a file.

    Args:
        path: path of the text, for messages.
        grid: grid of the points.
        batches: all points.
        file: empty file, open for reading and writing.
        empty: number that stands for a missing point.

    Raises:
        ReadError: two points of one place have different heights, or too few cells are filled.
        OSError: the disk is full.
    """
    kind, cells = np.dtype(np.int32 if grid.whole else np.float64), grid.rows * grid.columns
    for first in range(0, cells, _CELLS):  # a write fails on a full disk, and a map would crash
        file.write(np.full(min(_CELLS, cells - first), empty, kind).tobytes())
    file.flush()
    heights = np.memmap(file, kind, "r+", shape=(cells,))
    seen = np.zeros(cells, np.bool_)
    for points in batches:
        at, z = grid.cells(points), points[:, 2]
        known = ~np.isnan(z)
        at, z = at[known], z[known]
        before = seen[at]
        differs = before & (heights[at] != z)
        heights[at], seen[at] = z, True
        differs |= heights[at] != z  # two in this batch
        if differs.any():
            where = at[differs][0]
            x = grid.west + grid.dx * (where % grid.columns)
            y = grid.south + grid.dy * (grid.rows - 1 - where // grid.columns)
            raise ReadError(
                f"{path}: has two heights at {x:.12g} {y:.12g}.",
                "Keep one of them, or add --resolution to take all for a cloud.",
            )
    if np.count_nonzero(seen) < FILLED * cells:
        raise cloud(path)
    return heights.reshape(grid.rows, grid.columns)


def cloud(path: Path) -> ReadError:
    """Error for a text of points that form no grid."""
    return ReadError(
        f"{path}: is no grid, but a cloud of points.",
        "Add --resolution with the side of a cell, and it is read as a cloud.",
    )


class PointText:
    """A text of points that is read more than once; a small one is parsed once only.

    Args:
        path: path of the text.
        layout: its layout.
    """

    def __init__(self, path: Path, layout: XyzLayout) -> None:
        self._path, self._layout = path, layout
        self._kept: list[Points] | None = None

    def __iter__(self) -> Iterator[Points]:
        if self._kept is not None:
            yield from self._kept
            return
        kept, count = [], 0
        for points in read_points(self._path, self._layout):
            count += len(points)
            if count <= _IN_MEMORY:
                kept.append(points)
            yield points
        self._kept = kept if count <= _IN_MEMORY else None
