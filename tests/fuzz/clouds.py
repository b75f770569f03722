"""Clouds of points of every format that is read, and robots' maps: broken a little, and fused."""

from __future__ import annotations

import io
import random
import tempfile
import warnings
import zipfile
import zlib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from rasterio.errors import RasterioError

from terratool.cli.map_ import LEVELS
from terratool.errors import TerratoolError
from terratool.importing.sources import open_source
from terratool.importing.types import SampledHeights, SourceOptions
from terratool.sensing.clouds import read_clouds
from terratool.sensing.comparison import cells_to_compare, check_map, compare
from terratool.sensing.export import ScanOutput, export_scan
from terratool.sensing.map_files import (
    BANDS,
    FIRST,
    LEVEL,
    SURFACES,
    MapOutput,
    read_map,
    write_map,
)
from terratool.sensing.poses import one_pose
from terratool.sensing.robot_map import MapOptions, map_scans
from terratool.sensing.scan import Scan, ScanOptions
from tests.fuzz.harness import Case, Target, WrongError, ask
from tests.fuzz.mutation import NUMBERS, TEXTS, mutate_bytes, mutate_text
from tests.sensing.yard import HERE, TERRAIN, sensor

_SENSOR = sensor(lidar={"elevations": [-8, -3, 0], "azimuthStep": 12})
_SCAN = Scan(_SENSOR, one_pose((*HERE, 20.0, 0.0, 0.0)), ScanOptions(seed=2))
_FEW_CELLS = 100_000
_TEXTS = (".xyz", ".txt")
"""Suffixes of the texts of points that imports read, and maps do not."""


def _scanned(suffix: str) -> bytes:
    """A scan of the yard in a format, as it is written."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name, f"scan{suffix}")
        export_scan(TERRAIN, _SCAN, ScanOutput(path))
        return path.read_bytes()


@cache
def clouds() -> list[tuple[str, bytes]]:
    """Clouds of all kinds but LAS, in their ways of writing numbers: suffix and bytes."""
    found = [(suffix, _scanned(suffix)) for suffix in (".npz", ".csv", ".ply", ".pcd")]
    rows = np.random.default_rng(3).normal(0.0, 5.0, (30, 3))
    lines = "".join(f"{x:.4f} {y:.4f} {z:.3e} 7\n" for x, y, z in rows)
    types = {"x": "float", "y": "double", "z": "float", "surface": "uchar"}
    fields = "".join(f"property {kind} {name}\n" for name, kind in types.items())
    head = f"element vertex 30\n{fields}element face 0\nproperty list uchar int vertex_indices\n"
    named = 'comment surface 0 "sand"\ncomment surface 7 "b\\u00e9"\n'
    found.append((".ply", f"ply\nformat ascii 1.0\n{named}{head}end_header\n{lines}".encode()))
    kind = np.dtype([("x", ">f4"), ("y", ">f8"), ("z", ">f4"), ("surface", "u1")])
    packed = np.array([(*row, 1) for row in rows], kind).tobytes()
    big = f"ply\nformat binary_big_endian 1.0\n{named}{head}end_header\n".encode()
    found.append((".ply", big + packed))
    pcd = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z _ range\nSIZE 4 4 4 1 8\nTYPE F F F U F\n"
        "COUNT 1 1 1 {} 1\nWIDTH 30\nHEIGHT 1\nVIEWPOINT 1 2 3 0.7 0 0.7 0\nPOINTS 30\nDATA {}\n"
    )
    ranged = lines.replace(" 7", " 0 1.5")
    found.append((".pcd", (pcd.format(1, "ascii") + ranged).encode()))
    padded = np.dtype([("p", "<f4", 3), ("_", "u1", 3), ("r", "<f8")])
    binary = np.array([(row, (0, 0, 0), 2.0) for row in rows], padded).tobytes()
    found.append((".pcd", pcd.format(3, "binary").encode() + binary))
    quoted = "\ufeffX, y,z ,surface,range\r\n" + "".join(
        f'{x:.3f},"{y:.3f}",{z:.3f},"a ""b"", {int(x) % 3}",{abs(x)}\r\n' for x, y, z in rows
    )
    found.append((".csv", quoted.encode()))
    arrays: dict[str, Any] = dict(zip("xyz", rows.T, strict=True))
    arrays |= {"origin": np.asfortranarray(rows), "surface": np.arange(30, dtype=">i2") % 2}
    for save in (np.savez, np.savez_compressed):
        whole = io.BytesIO()
        save(whole, surfaces=np.array(["sand", "wet, grey"]), **arrays)  # type: ignore[operator]
        found.append((".npz", whole.getvalue()))
    return found


@cache
def las() -> list[tuple[str, bytes]]:
    """LAS and LAZ of several versions and formats of points; LAZ is one of four."""
    import laspy

    found = [(".las", _scanned(".las")), (".laz", _scanned(".laz"))]
    rows = np.random.default_rng(4).normal(0.0, 5.0, (30, 3))
    kinds = [("1.1", 1), ("1.2", 0), ("1.2", 3), ("1.3", 4), ("1.4", 7), ("1.4", 10)]
    for version, form in kinds:
        packed = form == 3
        header = laspy.LasHeader(version=version, point_format=form)
        header.scales, header.offsets = np.full(3, 1e-3), np.array([1e5, -2e6, 0.0])
        whole = io.BytesIO()
        with laspy.open(whole, "w", header=header, do_compress=packed, closefd=False) as file:
            points = laspy.ScaleAwarePointRecord.zeros(len(rows), header=header)
            points.x, points.y, points.z = rows.T + header.offsets[:, None]
            file.write_points(points)
        found.append((".laz" if packed else ".las", whole.getvalue()))
    return found


# --- mistakes ------------------------------------------------------------------------------------


def make_cloud(rng: random.Random) -> Case:
    """A cloud with one to a few mistakes."""
    suffix, data = rng.choice(clouds())
    other = rng.choice(clouds())[1]
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        data = _mutated(rng, suffix, data, other)
    return Case(suffix, data)


def make_las(rng: random.Random) -> Case:
    """A LAS or LAZ with one to a few mistakes, most of them in its header."""
    # each LAZ is unpacked by a process of its own
    packed = rng.random() < 0.1
    suffix, data = rng.choice([one for one in las() if (one[0] == ".laz") == packed])
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        data = mutate_bytes(rng, data, rng.choice(las())[1])
    return Case(suffix, data)


def _mutated(rng: random.Random, suffix: str, data: bytes, other: bytes) -> bytes:
    """A mistake in the header, in what is behind it, or in an array of an archive."""
    if suffix == ".npz":
        try:
            return mutate_npz(rng, data, other)
        except Exception:  # of many kinds, by a mistake before
            return mutate_bytes(rng, data, other)
    if suffix == ".csv":
        return mutate_text(rng, data, other)
    end = max(data.find(b"end_header"), data.find(b"DATA "))
    if end > 0 and rng.random() < 0.7:
        return mutate_text(rng, data[:end], other) + data[end:]
    return mutate_bytes(rng, data, other)


def mutate_npz(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """A mistake in the header or the numbers of an array, or in the archive.

    Raises:
        Exception: whatever zipfile raises where it is broken already.
    """
    if rng.random() < 0.25:
        return mutate_bytes(rng, data, other)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    at = rng.randrange(len(members))
    name, array = members[at]
    end = array.find(b"\n", 10) + 1
    kind = rng.randrange(8)
    if kind < 4 and end > 10:
        header = _mutated_header(rng, array[10:end])
        array = array[:8] + (len(header) & 0xFFFF).to_bytes(2, "little") + header + array[end:]
    elif kind == 4:
        name = rng.choice(["x.npy", "surfaces.npy", "origin.npy", "range", "time.npy", "\0", name])
    elif kind == 5:
        members.append((rng.choice(members)[0], array))
    else:
        array = mutate_bytes(rng, array, other)
    members[at] = name, array
    method = rng.choice([0, 0, 8, 8, 8, 12, 14])
    whole = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(whole, "w", method) as archive:
        warnings.simplefilter("ignore")  # of names that stand twice
        for name, array in members:
            archive.writestr(zipfile.ZipInfo(name or "x"), array, method)
    return whole.getvalue()


_SHAPES = (
    "()", "(1,)", "(True,)", "(-3,)", "(30, 1)", "(30, 0)", "(0,)", "(1e3,)", f"({'9' * 40},)",
)  # fmt: skip
_WORDS = (
    "'|O'", "'<U9'", "'>f8'", "'<c16'", "'<M8[ns]'", "'|V8'", "'|S0'", "'<U0'", "'<f2'", "'<f16'",
    "'|b1'", "[('a', '<f8')]", "(" * 300, "[1]: 2, ", "'''", "{", "-" * 2000, "\\x", "None", "²",
    "'<U999999999'", "{'shape': 1}", "30L", "True", "lambda: 0", "(30,)", *_SHAPES,
)  # fmt: skip


def _mutated_header(rng: random.Random, header: bytes) -> bytes:
    """The Python of a header of NumPy with a mistake."""
    text = header.decode("latin-1")
    if rng.random() < 0.6:
        words = ["'<f8'", "'<i4'", "False", "(", ")", "descr", "shape", "30", ",", "}", ":"]
        word = rng.choice([word for word in words if word in text] or [""])
        return text.replace(word, rng.choice(_WORDS), 1).encode("latin-1", "replace")
    return mutate_text(rng, header, header)


# --- what is done with them ----------------------------------------------------------------------


def try_cloud(case: Case, folder: Path) -> str:
    """Read all points; some are fused into a map of few cells, or imported, by commands and not."""
    name, draw = folder / f"case{case.suffix}", zlib.crc32(case.data)
    name.write_bytes(case.data)
    try:
        if draw % 4 == 2 or case.suffix in _TEXTS:
            return import_cloud(name, draw)
        low, high, count = np.full(3, np.inf), np.full(3, -np.inf), 0
        for cloud in read_clouds(name):
            if not np.isfinite(cloud.points).all() or not all(
                isinstance(one, str) for one in cloud.surfaces
            ):
                raise WrongError("a point is no number")
            low = np.minimum(low, cloud.points.min(axis=0))
            high = np.maximum(high, cloud.points.max(axis=0))
            count += len(cloud.points)
        if draw % 32 == 0:
            told = ("--resolution", 1, "--output", folder / "map.tif", "--overwrite", "--json")
            ask("map", name, *told)
        side = max(float((high - low)[:2].max(initial=0.0)) / 30.0, 1e-3)
        if count and draw % 4 == 1 and side < 1e8:
            made = map_scans([name], MapOptions(side, 2))
            for level in (made.level(0), made.level(1)):
                if np.isinf(level.elevation).any() or np.isinf(level.variance).any():
                    raise WrongError("a map is infinite")
    finally:
        for path in folder.iterdir():
            path.unlink()
    return "read"


def import_cloud(name: Path, draw: int) -> str:
    """Gather all points in cells, with and without a resolution; some by the command."""
    options = SourceOptions(
        resolution=(None, 1.0, 0.1)[draw // 4 % 3],
        heights=(None, "highest", "lowest")[draw // 16 % 3],
        ground=draw // 64 % 4 == 0,
    )
    if draw % 32 == 2:
        ask("import-terrain", name, name.with_name("a.json"), "--max-error", 1, "--resolution", 2)
    with open_source(str(name), options) as found:
        grid = found.grid
        if not isinstance(found, SampledHeights):
            return "raster or mesh"
        if np.isinf(found.values).any() or found.values.shape != (grid.rows, grid.columns):
            raise WrongError("a height is infinite, or has no cell")
        if found.classes is not None and found.classes().shape != found.values.shape:
            raise WrongError("a class has no cell")
    return "imported"


def make_text(rng: random.Random) -> Case:
    """Lines of x, y and z with one to a few mistakes."""
    data = rng.choice(texts())
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        data = mutate_text(rng, data, rng.choice(texts()))
    return Case(rng.choice(_TEXTS), data)


@cache
def texts() -> list[bytes]:
    """Clouds and a grid as lines, with names, separators and decimals of several kinds."""
    rows = np.random.default_rng(6).normal(0.0, 5.0, (40, 3)).tolist()
    found = ["".join(f"{x:.3f} {y:.3e}\t{z}\n" for x, y, z in rows)]
    found.append("//Z Y X R\n" + "".join(f"{x:.3f},{y:.3f},{z:.3f},9\r\n" for x, y, z in rows))
    commas = "".join(f"{x:.3f};{y:.3f};;{z:.3f}\n" for x, y, z in rows).replace(".", ",")
    found.append("\ufeffx;y;name;z\n" + commas)
    found.append("# a grid\n" + "".join(f"{n % 8} {n // 8} {n}\n" for n in range(40)))
    found.append('"x","y","z"\n' + "".join(f'"{x:.2f}",{y:.2f},{z:.2f}\n' for x, y, z in rows))
    return [text.encode() for text in found]


# --- maps ----------------------------------------------------------------------------------------


@cache
def _map() -> tuple[np.ndarray[Any, Any], dict[str, Any], dict[str, str]]:
    """The bands, the profile and the tags of a map of the yard."""
    with tempfile.TemporaryDirectory() as name:
        scan, path = Path(name, "scan.npz"), Path(name, "map.tif")
        scan.write_bytes(clouds()[0][1])
        write_map(map_scans([scan], MapOptions(2.0, LEVELS)), MapOutput(path, LEVELS))
        with rasterio.open(path) as file:
            return file.read(), file.profile, file.tags()


def make_map(rng: random.Random) -> Case:
    """A robot's map with mistakes in its bands, in its tags, in its place or in its bytes."""
    bands, profile, tags = _map()
    bands, profile, tags = bands.copy(), dict(profile), dict(tags)
    kind = rng.randrange(6)
    if kind == 0:
        odd = [np.nan, np.inf, -np.inf, 1e300, -1e300, -1.0, 0.0, 1e10, 5e-324, 0.5]
        places = tuple(rng.randrange(side) for side in bands.shape)
        bands[places] = rng.choice(odd)
        bands[rng.randrange(len(bands))] = rng.choice(odd) if rng.random() < 0.3 else bands[0]
    elif kind == 1:
        texts = [*TEXTS[:30], *map(str, NUMBERS), "²", "[" * 9999, '["a", 1]', "9" * 5000, "[]"]
        tags[rng.choice([LEVEL, SURFACES, FIRST])] = rng.choice(texts).replace("\0", "").encode(
            "utf-8", "replace").decode()  # fmt: skip
    elif kind == 2:
        transform = list(profile["transform"][:6])
        transform[rng.randrange(6)] *= rng.choice([0, -1, 1e-9, 1e9, 1e200, 1 + 1e-10, 2])
        profile["transform"] = rasterio.Affine(*transform)
    elif kind == 3:
        profile |= {"dtype": rng.choice(["float32", "int16", "complex128", "uint8"])}
        profile["nodata"] = None
        bands = np.nan_to_num(bands, nan=0.0, posinf=9.0).clip(0, 200).astype(profile["dtype"])
    elif kind == 4:
        keep = rng.randint(1, len(bands))
        bands = bands[:keep]
    profile["count"] = len(bands)
    try:
        with rasterio.MemoryFile() as memory:
            with memory.open(**profile) as file:
                file.write(bands)
                file.descriptions = BANDS.names[: len(bands)]
                file.update_tags(**tags)
            data = bytes(memory.getbuffer())
    except (RasterioError, OSError, ValueError):
        return make_map(rng)
    if kind == 5 or rng.random() < 0.3:
        for _ in range(rng.choice([1, 1, 2])):
            data = mutate_bytes(rng, data, data)
    return Case(".tif", data)


def try_map(case: Case, folder: Path) -> str:
    """Read it as a map of the yard, and compare it if that is no long work."""
    name, draw = folder / "case.tif", zlib.crc32(case.data)
    name.write_bytes(case.data)
    try:
        found = read_map(name)
        "".join(found.level.surfaces).encode("utf-8", "surrogatepass")
        check_map(found, TERRAIN)
        if cells_to_compare(found, TERRAIN) << 2 * found.level.level > _FEW_CELLS:
            return "many cells"
        compare(found, TERRAIN)
        if draw % 32 == 0:
            ask("compare", name, "samples/stairs-and-kerbs.json", "--json")
            ask("compare", name, "samples/stairs-and-kerbs.json")
    except TerratoolError:
        return "refused"
    finally:
        for path in folder.iterdir():
            path.unlink()
    return "map" if found.is_map else "raster"


TARGETS = (
    Target("clouds", 100_000, make_cloud, try_cloud),
    Target("las", 100_000, make_las, try_cloud),
    Target("points", 100_000, make_text, try_cloud),
    Target("maps", 100_000, make_map, try_map),
)
