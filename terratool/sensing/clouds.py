"""Clouds of points: what scans in files have of each point, in batches."""

from __future__ import annotations

import contextlib
import csv
import json
import math
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError, RequestError
from terratool.extras import install_command
from terratool.sensing.formats.common import SENSOR_AXES
from terratool.sensing.poses import Poses
from terratool.text.display import listed, shown

Floats = NDArray[np.float64]

BATCH = 1 << 20
"""So many points are in memory at a time."""
_LINES = 1 << 17
"""Lines of a text that are read at a time."""
_MOST_HEADER = 1 << 20
_MOST = 1e30
"""What is larger is taken for no number: squares of it and float32 have to hold it."""
_DAMAGED = "It may be cut short: write it again, or fetch it again."


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
        surface = surface[kept]
        known = (surface >= 0) & (surface < len(surfaces))
        surface = np.where(known, surface, -1).astype(np.int32)
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
    values = column.astype(np.float64)
    return np.where(np.abs(values) < _MOST, values, np.nan)


# --- NumPy ---------------------------------------------------------------------------------------


def _read_npz(path: Path) -> Iterator[Batch]:
    """Arrays of an archive, each read on from where it was left."""
    try:
        with contextlib.ExitStack() as stack:
            archive = stack.enter_context(zipfile.ZipFile(path))
            names = {name.removesuffix(".npy") for name in archive.namelist()}
            surfaces: tuple[str, ...] = ()
            if "surfaces" in names:
                with archive.open("surfaces.npy") as file:
                    values = np.lib.format.read_array(file, allow_pickle=False)
                    surfaces = tuple(map(str, values.ravel().tolist()))
            members = {
                name: _Member(path, stack.enter_context(archive.open(f"{name}.npy")))
                for name in _WANTED
                if name in names
            }
            if any(
                member.shape[1:] != ((3,) if name == "origin" else ())
                for name, member in members.items()
            ):
                raise ReadError(
                    f"{path}: has an array that is no column of numbers.",
                    "Save one of a dimension for each column; origin has three numbers a row.",
                )
            counts = {member.shape[0] for member in members.values()}
            if len(counts) > 1:
                raise ReadError(f"{path}: its arrays are not of one length.", _DAMAGED)
            total = max(counts, default=0)
            for begin in range(0, total, BATCH):
                count = min(BATCH, total - begin)
                yield {name: member.read(count) for name, member in members.items()}, surfaces
            if not counts:
                yield {}, surfaces
    except (zipfile.BadZipFile, ValueError, EOFError, NotImplementedError) as error:
        raise ReadError(f"{path}: is no archive of NumPy ({error}).", _DAMAGED) from error


class _Member:
    """An array in an archive, of which rows are read one after the other."""

    def __init__(self, path: Path, file: Any) -> None:
        self._path, self._file = path, file
        version = np.lib.format.read_magic(file)
        read = {(1, 0): np.lib.format.read_array_header_1_0}.get(
            version, np.lib.format.read_array_header_2_0
        )
        self.shape, fortran, self._type = read(file)
        if not self.shape or self._type.kind not in "fiub" or (fortran and len(self.shape) > 1):
            raise ReadError(f"{path}: has an array that is no column of numbers.", _DAMAGED)

    def read(self, count: int) -> NDArray[Any]:
        """So many rows."""
        shape = (count, *self.shape[1:])
        size = math.prod(shape) * self._type.itemsize
        data = self._file.read(size)
        if len(data) < size:
            raise ReadError(f"{self._path}: ends before its arrays do.", _DAMAGED)
        return np.frombuffer(data, self._type).reshape(shape)


# --- CSV -----------------------------------------------------------------------------------------


def _read_csv(path: Path) -> Iterator[Batch]:
    """Lines behind a header; empty cells are no numbers, surfaces have names."""
    known: dict[str, int] = {}
    with open(path, encoding="utf-8-sig", newline="") as file:
        rows = csv.reader(file)
        try:
            header = [cell.strip().lower() for cell in next(rows, [])]
            places = {name: header.index(name) for name in _WANTED if name in header}
            places.pop("origin", None)
            filled = filter(None, rows)
            while lines := [line for _, line in zip(range(_LINES), filled, strict=False)]:
                yield (
                    {
                        name: _names(lines, place, known)
                        if name == "surface"
                        else _numbers(path, lines, place, name)
                        for name, place in places.items()
                    },
                    tuple(known),
                )
        except UnicodeDecodeError as error:
            raise ReadError(f"{path}: is no UTF-8 text.", "Save it as UTF-8 CSV.") from error
        except csv.Error as error:
            raise ReadError(f"{path}:{rows.line_num}: is no CSV ({error}).", _DAMAGED) from error


def _numbers(path: Path, lines: list[list[str]], place: int, name: str) -> Floats:
    try:
        return np.array([float(line[place] or "nan") for line in lines])
    except (ValueError, IndexError):
        for line in lines:
            cell = line[place] if place < len(line) else ""
            with contextlib.suppress(ValueError):
                float(cell or "nan")
                continue
            break
        raise ReadError(
            f"{path}: {shown(cell)} is no number, in the column {name}.",
            "Write numbers with a point, and nothing where there is none.",
        ) from None


def _names(lines: list[list[str]], place: int, known: dict[str, int]) -> NDArray[np.int32]:
    cells = [line[place] if place < len(line) else "" for line in lines]
    return np.array([known.setdefault(cell, len(known)) if cell else -1 for cell in cells])


# --- PLY -----------------------------------------------------------------------------------------

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip


def _read_ply(path: Path) -> Iterator[Batch]:
    """The element vertex, which stands first."""
    with open(path, "rb") as file:
        if file.readline(8).strip() != b"ply":
            raise ReadError(f"{path}: is no PLY.", "Check the file; a PLY begins with ply.")
        form, count, surfaces, fields = "", -1, list[str](), list[tuple[str, str]]()
        element = ""
        while (words := _header_line(path, file)) != ["end_header"]:
            match words:
                case ["format", form, *_]:
                    pass
                case ["comment", *rest] if rest == SENSOR_AXES.split():
                    raise _in_sensor_axes(path)
                case ["comment", "surface", _, *name]:
                    with contextlib.suppress(ValueError):
                        surfaces.append(str(json.loads(" ".join(name))))
                case ["element", element, number]:
                    if element == "vertex" and fields == [] and count < 0:
                        count = int(number) if number.isdigit() else -1
                    elif count < 0:
                        raise ReadError(
                            f"{path}: other elements stand before its vertices.",
                            "Write the vertices first.",
                        )
                case ["property", kind, name] if element == "vertex" and kind in _PLY_TYPES:
                    fields.append((name, _PLY_TYPES[kind]))
                case ["property", *_] if element == "vertex":
                    raise ReadError(
                        f"{path}: its vertices have a property {shown(' '.join(words[1:]))}.",
                        "A cloud has numbers alone.",
                    )
        order = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}.get(form)
        if order is None or count < 0:
            raise ReadError(f"{path}: its header says no format, or no vertices.", _DAMAGED)
        yield from _rows(path, file, fields, count, order, tuple(surfaces))


def _header_line(path: Path, file: BinaryIO) -> list[str]:
    line = file.readline(4096)
    if not line or file.tell() > _MOST_HEADER:
        raise ReadError(f"{path}: its header does not end.", _DAMAGED)
    return line.decode("utf-8", "replace").split()


def _rows(
    path: Path, file: BinaryIO, fields: list[tuple[str, str]], count: int, order: str,
    surfaces: tuple[str, ...] = (),
) -> Iterator[Batch]:  # fmt: skip
    """Rows of numbers: binary in an order of bytes, or text where that is empty."""
    names = [name for name, _ in fields]
    if len(set(names)) < len(names):
        raise ReadError(f"{path}: has two columns of one name.", "Keep one of each.")
    if not fields:
        yield {}, surfaces
        return
    kind = np.dtype([(name, f"{order or '<'}{form}") for name, form in fields])
    for begin in range(0, max(count, 1), BATCH):
        some = min(BATCH, count - begin)
        if order:
            data = file.read(some * kind.itemsize)
            if len(data) < some * kind.itemsize:
                raise ReadError(f"{path}: ends before its points do.", _DAMAGED)
            rows: Any = np.frombuffer(data, kind)
        else:
            rows = _text_rows(path, file, names, some)
        yield {name: rows[name] for name in names if name in _WANTED and name != "origin"}, surfaces


def _text_rows(path: Path, file: BinaryIO, names: list[str], count: int) -> dict[str, Floats]:
    lines = [line.split() for _, line in zip(range(count), file, strict=False)]
    try:
        if len(lines) < count or any(len(line) < len(names) for line in lines):
            raise ReadError(f"{path}: ends before its points do.", _DAMAGED)
        columns = [np.array([float(line[k]) for line in lines]) for k in range(len(names))]
    except ValueError as error:
        raise ReadError(f"{path}: holds what is no number ({error}).", _DAMAGED) from error
    return dict(zip(names, columns, strict=True))


# --- PCD -----------------------------------------------------------------------------------------


_NO_VIEWPOINT = ("0", "0", "0", "1", "0", "0", "0")


def _read_pcd(path: Path) -> Iterator[Batch]:
    """Rows as PCL writes them, plain or binary; points are taken from the viewpoint's axes."""
    with open(path, "rb") as file:
        said: dict[str, list[str]] = {}
        while "DATA" not in said:
            words = _header_line(path, file)
            if words[:1] == ["#"] and words[1:] == SENSOR_AXES.split():
                raise _in_sensor_axes(path)
            if words and not words[0].startswith("#"):
                said[words[0].upper()] = words[1:]
        try:
            names = said["FIELDS"]
            counts = list(map(int, said.get("COUNT", ["1"] * len(names))))
            forms = [
                f"{letter.lower()}{int(size)}"
                for letter, size in zip(said["TYPE"], said["SIZE"], strict=True)
            ]
            count = int(said["POINTS"][0])
            pose = np.array(list(map(float, said.get("VIEWPOINT", _NO_VIEWPOINT))))
            fields = []
            for name, form, several in zip(names, forms, counts, strict=True):
                many = range(several)
                fields += [(name if several == 1 else f"{name} {k}", form) for k in many]
            # PCL calls padding _, as often as it likes
            fields = [(f"_{k}" if n == "_" else n, form) for k, (n, form) in enumerate(fields)]
            np.dtype([(name, form) for name, form in fields])
            if pose.shape != (7,) or not np.isfinite(pose).all() or not pose[3:].any():
                raise ValueError("no viewpoint")
        except (KeyError, ValueError, IndexError, TypeError) as error:
            raise ReadError(f"{path}: its header is no PCD's ({error}).", _DAMAGED) from error
        data = said["DATA"][:1]
        if data not in (["ascii"], ["binary"]):
            raise ReadError(
                f"{path}: is packed.",
                "Unpack it: pcl_convert_pcd_ascii_binary IN.pcd OUT.pcd 1",
            )
        order = "<" if data == ["binary"] else ""
        for columns, surfaces in _rows(path, file, fields, count, order):
            # PCD has no place for the names of surfaces
            columns.pop("surface", None)
            yield (_placed(columns, pose) if set("xyz") <= {*columns} else columns), surfaces


def _placed(columns: Columns, pose: Floats) -> Columns:
    if np.array_equal(pose, list(map(float, _NO_VIEWPOINT))):
        return columns
    turn = pose[[4, 5, 6, 3]] / np.linalg.norm(pose[3:])
    local = np.stack([columns[name].astype(np.float64) for name in "xyz"], axis=-1)
    matrix = Poses(np.zeros(1), pose[None, :3], turn[None]).matrices[0]
    points = local @ matrix.T + pose[:3]
    origin = np.broadcast_to(pose[:3], points.shape)
    return {**columns, **dict(zip("xyz", points.T, strict=True)), "origin": origin}


# --- LAS -----------------------------------------------------------------------------------------


def _read_las(path: Path) -> Iterator[Batch]:
    """Points of LAS and LAZ, and what terratool adds to them."""
    import laspy

    try:
        with laspy.open(path) as file:
            surfaces: tuple[str, ...] = ()
            for record in file.header.vlrs:
                if record.user_id == "terratool" and record.record_id == 1:
                    text = record.record_data_bytes().decode("utf-8", "replace")
                    surfaces = tuple(text.split("\n"))
            names = {*file.header.point_format.dimension_names}
            for points in file.chunk_iterator(BATCH):
                columns: Columns = {name: np.asarray(getattr(points, name)) for name in "xyz"}
                for name, of in (("time", "gps_time"), ("range", "range"), ("surface", "surface")):
                    if of in names:
                        columns[name] = np.asarray(points[of])
                yield columns, surfaces
    except (laspy.errors.LaspyException, ValueError, RuntimeError) as error:
        raise ReadError(f"{path}: is no LAS ({error}).", _DAMAGED) from error


_READERS: dict[str, Callable[[Path], Iterator[Batch]]] = {
    ".npz": _read_npz, ".csv": _read_csv, ".ply": _read_ply, ".pcd": _read_pcd,
    ".las": _read_las, ".laz": _read_las,
}  # fmt: skip
