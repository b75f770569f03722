"""Clouds of points: what scans in files have of each point, in batches.

What a header claims is held against the size of its file before anything is made of it.
"""

from __future__ import annotations

import csv
import io
import math
import os
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from importlib.util import find_spec
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import IO, Any, AnyStr, Generic

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.errors import DAMAGED, ReadError, RequestError
from terratool.extras import install_command
from terratool.report.wording import listed
from terratool.sensing.formats.common import SENSOR_AXES
from terratool.sensing.poses import Poses
from terratool.text.display import shown
from terratool.text.files import open_file
from terratool.text.numbers import parse_number, parse_whole
from terratool.text.packing import PackingError, refuse_members

Floats = NDArray[np.float64]

BATCH = 1 << 20
"""So many points are in memory at a time."""
MOST_SURFACES = 1 << 16
"""Scans may name so many surfaces."""
_LINES = 1 << 17
"""Most lines of a text that are read at a time."""
_FEW = 64
"""Lines between two looks at how long they are."""
_BATCH_BYTES = 1 << 26
"""Bytes of rows after which no more are read at a time."""
_MOST_LINE = 1 << 20
_MOST_HEADER = 1 << 20
_MOST_NAMES = 1 << 20
"""Characters of the names of all surfaces together."""
_MOST_ROW = (1 << 31) - 1
MOST = 1e30
"""What is larger is taken for no number: squares of it and float32 have to hold it."""


@dataclass(frozen=True, slots=True)
class Cloud:
    """Some points of a scan.

    Attributes:
        points: (n, 3) float64, m, in the world.
        origin: (n, 3) float64, where the sensor was at each; None where that is not known.
        range: (n,) float64, m; None where that is not known.
        time: (n,) float64, s; None where that is not known.
        surface: (n,) int32 index into `surfaces`, -1 for none; None where that is not known.
        surfaces: names.
        variance: (n,) float64, m², of the heights; None where that is not known.
    """

    points: Floats
    origin: Floats | None = None
    range: Floats | None = None
    time: Floats | None = None
    surface: NDArray[np.int32] | None = None
    surfaces: tuple[str, ...] = ()
    variance: Floats | None = None


def read_clouds(path: str | Path) -> Iterator[Cloud]:
    """The points of a scan, batch by batch, in the order of the file.

    It is what `terratool scan` writes, or another file that has x, y and z by these names: .npz,
    .csv, .ply, .pcd, .las or .laz. Range, time, surface and variance are taken where they are.
    Points that are no finite numbers are rays without a reading, and are left out.

    Raises:
        RequestError: the suffix says no format, or what it needs is not installed.
        ReadError: the file cannot be read, or has no x, y and z.
    """
    path = Path(path)
    reader = checked_reader(path)
    try:
        for columns, surfaces in reader(path):
            cloud = _cloud(path, columns, surfaces)
            if len(cloud.points):
                yield cloud
    except OSError as error:
        raise ReadError.of(path, error) from error


def checked_reader(path: Path) -> Callable[[Path], Iterator[Batch]]:
    """What reads a file, by its suffix.

    Raises:
        RequestError: the suffix says no format, or what it needs is not installed.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise RequestError(
            f"{path}: is no cloud of points by its name.",
            f"The suffixes are {listed([*_READERS])}; terratool scan writes them all.",
        )
    lacking = [
        name
        for name in {".las": ["laspy"], ".laz": ["laspy", "lazrs"]}.get(path.suffix.lower(), [])
        if find_spec(name) is None
    ]
    if lacking:
        raise RequestError(
            f"{path.suffix} needs {listed(lacking)}, which is not installed.",
            f"Install it: {install_command('las')}",
        )
    return reader


Columns = dict[str, NDArray[Any]]
Batch = tuple[Columns, tuple[str, ...]]
"""Columns by name, and the names of the surfaces."""
_WANTED = ("x", "y", "z", "range", "time", "surface", "variance", "origin")


def _cloud(path: Path, columns: Columns, surfaces: tuple[str, ...]) -> Cloud:
    lacking = [name for name in "xyz" if name not in columns]
    if lacking:
        raise ReadError(
            f"{path}: has no {listed(lacking)}.", "Name the coordinates of its points x, y and z."
        )
    points = np.stack([_numbers_of(columns[name]) for name in "xyz"], axis=-1)
    kept = np.isfinite(points).all(axis=1)

    def of(name: str) -> Floats | None:
        return _numbers_of(columns[name][kept]) if name in columns else None

    surface = columns.get("surface")
    if surface is not None:
        given = surface[kept]
        known = (given >= 0) & (given < len(surfaces))
        surface = np.full(len(given), -1, np.int32)
        surface[known] = given[known]
    return Cloud(
        points[kept],
        of("origin"),
        of("range"),
        of("time"),
        surface,
        surfaces,
        of("variance"),
    )


def _in_sensor_axes(path: Path) -> ReadError:
    return ReadError(
        f"{path}: its points are in the axes of the sensor.", "Scan with --frame world."
    )


def _numbers_of(column: NDArray[Any]) -> Floats:
    """A column as float64, NaN where it is no number or too large."""
    with np.errstate(invalid="ignore", over="ignore"):  # a signalling NaN is one all the same
        values = column.astype(np.float64)
    return np.where(np.abs(values) < MOST, values, np.nan)


def _checked_names(path: Path, names: Iterable[str]) -> tuple[str, ...]:
    """The names of surfaces, if they are not too many or too long.

    Raises:
        RequestError: they are.
    """
    checked, size = [], 0
    for name in names:
        checked.append(name)
        size += len(name)
        if len(checked) > MOST_SURFACES or size > _MOST_NAMES:
            raise RequestError(
                f"{path}: names more than {MOST_SURFACES:,} surfaces, or more than "
                f"{_MOST_NAMES >> 20} MiB of them.",
                "Rename the column surface, if it holds something else.",
            )
    return tuple(checked)


def _words(error: BaseException) -> str:
    """What an error of a library says, in short."""
    return " ".join(str(error).split())[:100] or type(error).__name__


def _size(file: io.BufferedReader) -> int:
    return os.fstat(file.fileno()).st_size


# --- NumPy ---------------------------------------------------------------------------------------

_NO_ARCHIVE = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, NotImplementedError, OverflowError,
    ValueError,
)  # fmt: skip
"""What zipfile and NumPy raise for a file that is broken."""


def _read_npz(path: Path) -> Iterator[Batch]:
    """Arrays of an archive, each read on from where it was left."""
    with ExitStack() as stack:
        file = stack.enter_context(open_file(path))
        try:
            archive = stack.enter_context(zipfile.ZipFile(file))
            stored = {name.removesuffix(".npy"): name for name in archive.namelist()}
            wanted = {
                name: archive.getinfo(stored[name])
                for name in (*_WANTED, "surfaces")
                if name in stored
            }
            refuse_members(archive, [one.filename for one in wanted.values()], _size(file))
            members = {
                name: _Member(path, stack.enter_context(archive.open(one)), one.file_size)
                for name, one in wanted.items()
            }
            named = members.pop("surfaces", None)
            surfaces = () if named is None else _checked_names(path, named.texts())
            if any(not member.has_rows(3 * (name == "origin")) for name, member in members.items()):
                raise ReadError(
                    f"{path}: has an array that is no column of numbers.",
                    "Save one of a dimension for each column; origin has three numbers a row.",
                )
            counts = {member.shape[0] for member in members.values()}
            if len(counts) > 1:
                raise ReadError(f"{path}: its arrays are not of one length.", DAMAGED)
            total = max(counts, default=0)
            for begin in range(0, total, BATCH):
                count = min(BATCH, total - begin)
                yield {name: member.read(count) for name, member in members.items()}, surfaces
            if not counts:
                yield {}, surfaces
        except PackingError as error:
            raise ReadError(f"{path}: {error.message}", error.hint) from error
        except _NO_ARCHIVE as error:
            raise ReadError(f"{path}: is no archive of NumPy, or damaged.", DAMAGED) from error


class _Member:
    """An array in an archive, of which rows are read one after the other.

    Args:
        path: of the archive.
        file: the member, open.
        size: its bytes, as the archive says.

    Attributes:
        shape: of the array.

    Raises:
        ReadError: it has no header, or one that claims more than there is.
    """

    def __init__(self, path: Path, file: Any, size: int) -> None:
        self._path, self._file = path, file
        try:
            with warnings.catch_warnings():  # of headers as Python 2 wrote them
                warnings.simplefilter("ignore")
                self.shape, self._by_columns, self._type = _array_header(file)
        except Exception as error:  # of many kinds, as a header is an expression of Python
            deep = isinstance(error, MemoryError)  # as its parser says, whatever memory there is
            raise ReadError(f"{path}: has an array whose header is none.", DAMAGED) from (
                None if deep else error
            )
        if any(type(side) is not int or side < 0 for side in self.shape):
            raise ReadError(f"{path}: has an array without a length.", DAMAGED)
        if math.prod(self.shape) * self._type.itemsize > size - file.tell():
            raise ReadError(f"{path}: ends before its arrays do.", DAMAGED)

    def has_rows(self, width: int) -> bool:
        """Whether it has rows of so many numbers, or is a column if that is 0."""
        plain = self._type.kind in "fiub" and not (self._by_columns and width)
        return plain and self.shape[1:] == (width,) * bool(width) and len(self.shape) > 0

    def read(self, count: int) -> NDArray[Any]:
        """So many rows."""
        shape = (count, *self.shape[1:])
        size = math.prod(shape) * self._type.itemsize
        data = self._file.read(size)
        if len(data) < size:
            raise ReadError(f"{self._path}: ends before its arrays do.", DAMAGED)
        return np.frombuffer(data, self._type).reshape(shape)

    def texts(self) -> list[str]:
        """All of it as texts, but no more than one more than there may be surfaces.

        Raises:
            ReadError: it holds none.
        """
        if self._type.kind != "U" or len(self.shape) != 1 or not self._type.itemsize:
            raise ReadError(f"{self._path}: its surfaces are no list of names.", DAMAGED)
        found: list[str] = self.read(min(self.shape[0], MOST_SURFACES + 1)).tolist()
        return found


def _array_header(file: Any) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether it lies column by column, and type of an array, as NumPy reads them."""
    version = np.lib.format.read_magic(file)
    read = {(1, 0): np.lib.format.read_array_header_1_0}.get(
        version, np.lib.format.read_array_header_2_0
    )
    found: tuple[tuple[int, ...], bool, np.dtype[Any]] = read(file)
    return found


# --- texts ---------------------------------------------------------------------------------------


@dataclass
class _Lines(Generic[AnyStr]):
    """The lines of a text, none of which is without end.

    Attributes:
        path: of the file.
        file: which is open.
        taken: bytes, or characters, of lines so far.
    """

    path: Path
    file: IO[AnyStr]
    taken: int = field(default=0, init=False)

    def __iter__(self) -> Iterator[AnyStr]:
        while line := self.file.readline(_MOST_LINE):
            if len(line) == _MOST_LINE:
                raise ReadError(
                    f"{self.path}: has a line of more than {_MOST_LINE >> 20} MiB.", DAMAGED
                )
            self.taken += len(line)
            yield line

    def some(self, rows: Iterator[Any], most: int) -> list[Any]:
        """So many of the rows that are made of these lines, or fewer if they are long."""
        until = self.taken + _BATCH_BYTES
        found: list[Any] = []
        while self.taken < until and (more := list(islice(rows, min(_FEW, most - len(found))))):
            found += more
        return found


def _read_csv(path: Path) -> Iterator[Batch]:
    """Lines behind a header; empty cells are no numbers, surfaces have names."""
    known: dict[str, int] = {}
    opened = open_file(path, named=True)
    with io.TextIOWrapper(opened, encoding="utf-8-sig", newline="") as file:
        lines = _Lines(path, file)
        rows = csv.reader(iter(lines))
        try:
            header = [cell.strip().lower() for cell in next(rows, [])]
            names = [name for name in _WANTED if name in header and name != "origin"]
            places = [header.index(name) for name in names]
            while some := lines.some(_picked(rows, places), _LINES):
                columns: Columns = {}
                for index, name in enumerate(names):
                    cells = [row[index] for row in some]
                    if name == "surface":
                        columns[name] = _indices(cells, known)
                    else:
                        columns[name] = _numbers(path, cells, name)
                yield columns, _checked_names(path, known)
        except UnicodeDecodeError as error:
            raise ReadError(f"{path}: is no UTF-8 text.", "Save it as UTF-8 CSV.") from error
        except csv.Error as error:
            raise ReadError(f"{path}:{rows.line_num}: is no CSV ({error}).", DAMAGED) from error


def _picked(rows: Iterator[list[str]], places: list[int]) -> Iterator[Sequence[str | None]]:
    """The cells at some places of each row; None where a row ends before."""
    pick = itemgetter(*places, -1)  # of one place alone it would give no tuple
    longest = max(places, default=0)
    for row in filter(None, rows):
        if len(row) > longest:
            yield pick(row)
        else:
            yield [row[place] if place < len(row) else None for place in places]


def _numbers(path: Path, cells: list[str | None], name: str) -> Floats:
    """A column of numbers; NaN where there is nothing.

    Raises:
        ReadError: a cell is no number, or lacks.
    """
    values = [parse_number(cell or "nan") if cell is not None else None for cell in cells]
    if None in values:
        cell = cells[values.index(None)] or ""
        raise ReadError(
            f"{path}: {shown(cell)} is no number, in the column {name}.",
            "Write numbers with a point, and nothing where there is none.",
        )
    return np.array(values, np.float64)


def _indices(cells: list[str | None], known: dict[str, int]) -> NDArray[np.int64]:
    """Indices of names, of which more become known."""
    return np.array([known.setdefault(cell, len(known)) if cell else -1 for cell in cells])


# --- PLY -----------------------------------------------------------------------------------------

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}

Fields = list[tuple[str, str, int]]
"""Columns of rows: name, type, and how many of that there are side by side."""


def _read_ply(path: Path) -> Iterator[Batch]:
    """The element vertex, which stands first."""
    with open_file(path) as file:
        if file.readline(8).strip() != b"ply":
            raise ReadError(f"{path}: is no PLY.", "Check the file; a PLY begins with ply.")
        form, element, count = "", "", -1
        names: list[str] = []
        fields: Fields = []
        while (words := (line := _header_line(path, file)).split()) != ["end_header"]:
            match words:
                case ["format", form, *_]:
                    pass
                case ["comment", *rest] if rest == SENSOR_AXES.split():
                    raise _in_sensor_axes(path)
                case ["comment", "surface", _, _, *_]:
                    names += _quoted(line.split(None, 3)[3])
                case ["element", element, claimed]:
                    if element == "vertex" and not fields and count < 0:
                        found = parse_whole(claimed)
                        count = -1 if found is None else found
                    elif count < 0:
                        raise ReadError(
                            f"{path}: other elements stand before its vertices.",
                            "Write the vertices first.",
                        )
                case ["property", kind, name] if element == "vertex" and kind in _PLY_TYPES:
                    fields.append((name, _PLY_TYPES[kind], 1))
                case ["property", *_] if element == "vertex":
                    raise ReadError(
                        f"{path}: its vertices have a property {shown(' '.join(words[1:]))}.",
                        "A cloud has numbers alone.",
                    )
        order = _ORDERS.get(form)
        if order is None or count < 0:
            raise ReadError(f"{path}: its header says no format, or no vertices.", DAMAGED)
        surfaces = _checked_names(path, names)
        for columns in _rows(path, file, fields, count, order):
            yield columns, surfaces


def _quoted(text: str) -> list[str]:
    """The name of a surface in a comment, or none if that is about something else."""
    try:
        return [msgspec.json.decode(text, type=str)]
    except (msgspec.MsgspecError, UnicodeError):
        return []


def _header_line(path: Path, file: io.BufferedReader) -> str:
    line = file.readline(4096)
    if not line or file.tell() > _MOST_HEADER:
        raise ReadError(f"{path}: its header does not end.", DAMAGED)
    return line.decode("utf-8", "replace")


def _rows(
    path: Path, file: io.BufferedReader, fields: Fields, count: int, order: str
) -> Iterator[Columns]:
    """Rows of numbers: binary in an order of bytes, or text where that is empty.

    Raises:
        ReadError: there are two columns of one name, or fewer rows than `count`.
    """
    if not fields:
        yield {}
        return
    names = [name for name, _, _ in fields if name in _WANTED and name != "origin"]
    if len(set(names)) < len(names):
        raise ReadError(f"{path}: has two columns of one name.", "Keep one of each.")
    size = sum(np.dtype(form).itemsize * many for _, form, many in fields)
    width = sum(many for _, _, many in fields)
    # a number of a text takes a digit and what separates it from the next one
    least = count * (size if order else 2 * width) - (not order)
    if least > _size(file) - file.tell() or (order and size > _MOST_ROW):
        raise ReadError(f"{path}: ends before its points do.", DAMAGED)
    places, forms, offsets, column, offset = [], [], [], 0, 0
    for name, form, many in fields:
        if name in names:
            places.append(column)
            forms.append(f"{order}{form}")
            offsets.append(offset)
        column += many
        offset += np.dtype(form).itemsize * many
    if not names or not count:
        yield {name: np.zeros(0) for name in names}
    elif order:
        kind = np.dtype({"names": names, "formats": forms, "offsets": offsets, "itemsize": size})
        yield from _binary_rows(path, file, kind, count)
    else:
        for rows in _text_rows(path, file, places, count):
            yield dict(zip(names, rows.T, strict=True))


def _binary_rows(
    path: Path, file: io.BufferedReader, kind: np.dtype[Any], count: int
) -> Iterator[Columns]:
    many = max(1, min(BATCH, _BATCH_BYTES // kind.itemsize))
    for begin in range(0, count, many):
        size = min(many, count - begin) * kind.itemsize
        data = file.read(size)
        if len(data) < size:
            raise ReadError(f"{path}: ends before its points do.", DAMAGED)
        rows = np.frombuffer(data, kind)
        yield {name: rows[name] for name in kind.names or ()}


def _text_rows(
    path: Path, file: io.BufferedReader, places: list[int], count: int
) -> Iterator[Floats]:
    """(n, len(places)) the numbers that stand at these places of the next `count` lines."""
    lines = _Lines(path, file)
    each = iter(lines)
    while count > 0:
        some = lines.some(each, min(_LINES, count))
        count -= len(some)
        try:
            if not all(map(bytes.strip, some)) or not some:
                raise ReadError(f"{path}: ends before its points do.", DAMAGED)
            text = [line.decode("ascii") for line in some]
            yield np.loadtxt(text, comments=None, usecols=places, ndmin=2)
        except ValueError as error:
            what = _words(error).partition(" at row ")[0]  # of those that are read at a time
            raise ReadError(
                f"{path}: has a line that is no row of numbers ({what}).", DAMAGED
            ) from error


# --- PCD -----------------------------------------------------------------------------------------

_NO_VIEWPOINT = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
_PCD_TYPES = {
    **{("I", str(size)): f"i{size}" for size in (1, 2, 4, 8)},
    **{("U", str(size)): f"u{size}" for size in (1, 2, 4, 8)},
    ("F", "4"): "f4", ("F", "8"): "f8",
}  # fmt: skip
_FLATTEST = 1e-100
"""A quaternion that is shorter than this has no direction."""


def _read_pcd(path: Path) -> Iterator[Batch]:
    """Rows as PCL writes them, plain or binary; points are taken from the viewpoint's axes."""
    with open_file(path) as file:
        said: dict[str, list[str]] = {}
        while "DATA" not in said:
            words = _header_line(path, file).split()
            if words[:1] == ["#"] and words[1:] == SENSOR_AXES.split():
                raise _in_sensor_axes(path)
            if words and not words[0].startswith("#"):
                said[words[0].upper()] = words[1:]
        try:
            fields, count, pose = _pcd_header(said)
        except (KeyError, ValueError) as error:
            raise ReadError(
                f"{path}: its header is no PCD's ({_words(error)}).",
                "Write it with PCL: numbers of type F, I or U, a count of points, a viewpoint.",
            ) from error
        data = said["DATA"][:1]
        if data not in (["ascii"], ["binary"]):
            raise ReadError(
                f"{path}: is packed.",
                "Unpack it: pcl_convert_pcd_ascii_binary IN.pcd OUT.pcd 1",
            )
        for columns in _rows(path, file, fields, count, "<" if data == ["binary"] else ""):
            # PCD has no place for the names of surfaces
            columns.pop("surface", None)
            yield (_placed(columns, pose) if set("xyz") <= {*columns} else columns), ()


def _pcd_header(said: dict[str, list[str]]) -> tuple[Fields, int, Floats]:
    """Columns, how many rows there are, and the viewpoint.

    Raises:
        KeyError, ValueError: the header does not say them.
    """
    names = said["FIELDS"]
    counts = [_whole(text) for text in said.get("COUNT", ["1"] * len(names))]
    fields: Fields = []
    for name, letter, size, many in zip(names, said["TYPE"], said["SIZE"], counts, strict=True):
        form = _PCD_TYPES.get((letter.upper(), size))
        if form is None:
            raise ValueError(f"{shown(name)} is of type {shown(letter)} and size {shown(size)}")
        fields.append((name if many == 1 else "", form, many))
    pose = np.array(
        [parse_number(text) for text in said.get("VIEWPOINT", ())] or _NO_VIEWPOINT, float
    )
    far = pose.shape != (7,) or not (np.abs(pose) < MOST).all()
    if far or np.abs(pose[3:]).max() < _FLATTEST:
        raise ValueError("no viewpoint")
    [count] = said["POINTS"][:1]
    return fields, _whole(count), pose


def _whole(text: str) -> int:
    found = parse_whole(text)
    if found is None:
        raise ValueError(f"{shown(text)} is no count")
    return found


def _placed(columns: Columns, pose: Floats) -> Columns:
    if np.array_equal(pose, _NO_VIEWPOINT):
        return columns
    turn = pose[[4, 5, 6, 3]] / np.linalg.norm(pose[3:])
    local = np.stack([_numbers_of(columns[name]) for name in "xyz"], axis=-1)
    matrix = Poses(np.zeros(1), pose[None, :3], turn[None]).matrices[0]
    points = local @ matrix.T + pose[:3]
    origin = np.broadcast_to(pose[:3], points.shape)
    return {**columns, **dict(zip("xyz", points.T, strict=True)), "origin": origin}


# --- LAS -----------------------------------------------------------------------------------------


def _read_las(path: Path) -> Iterator[Batch]:
    """Points of LAS and LAZ, and what terratool adds to them."""
    from terratool.sensing.las_points import open_las

    with open_las(path) as file:
        surfaces: tuple[str, ...] = ()
        for record in file.header.vlrs:
            if record.user_id == "terratool" and record.record_id == 1:
                text = record.record_data_bytes().decode("utf-8", "replace")
                surfaces = _checked_names(path, text.split("\n"))
        names = {*file.header.point_format.dimension_names}
        for points in file.batches(BATCH):
            with np.errstate(all="ignore"):  # what is no number is left out
                columns: Columns = {name: np.asarray(getattr(points, name)) for name in "xyz"}
                for name, of in (("time", "gps_time"), ("range", "range"), ("surface", "surface")):
                    if of in names:
                        columns[name] = np.asarray(points[of])
            if any(column.ndim != 1 for column in columns.values()):
                raise ReadError(f"{path}: has a column of several numbers a point.", DAMAGED)
            yield columns, surfaces


_READERS: dict[str, Callable[[Path], Iterator[Batch]]] = {
    ".npz": _read_npz, ".csv": _read_csv, ".ply": _read_ply, ".pcd": _read_pcd,
    ".las": _read_las, ".laz": _read_las,
}  # fmt: skip
