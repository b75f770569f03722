"""Rasters and meshes of every format that is read: written small, broken a little, and read."""

from __future__ import annotations

import contextlib
import gzip
import io
import json
import random
import subprocess
import sys
import tempfile
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import rasterio.control
import rasterio.shutil
from rasterio.drivers import raster_driver_extensions
from rasterio.errors import RasterioError

from terratool.importing import sources
from terratool.importing.meshes import read_triangles
from terratool.importing.rasters import open_classes
from terratool.importing.sampling import sample
from terratool.importing.sources import is_mesh, open_source
from terratool.importing.terrain.build import import_terrain
from terratool.importing.terrain.request import ImportOptions
from terratool.importing.types import SourceOptions
from terratool.io.opening import DRIVERS
from tests.commands import YARD
from tests.conftest import terrain_of
from tests.fuzz.harness import Case, Target
from tests.fuzz.mutation import mutate_bytes, mutate_text, mutate_tree
from tests.importing.test_meshes import PUT
from tests.meshes import exported
from tests.rasters import geotiff

FILES = ".files.zip"
"""How a case ends that is several files: the first is the one that is read."""
LARGEST = 100_000
"""Pixels that are all read; of more, the first and the last rows are."""
_FEW = 400
"""Pixels that become a terrain."""

Files = tuple[tuple[str, bytes], ...]
"""The files of a raster or mesh, that which is named first."""

_TIFFS: list[tuple[str, dict[str, Any]]] = [
    ("float32", {"crs": "EPSG:32633"}),
    ("float64", {"compress": "deflate", "predictor": 3, "nodata": -9999}),
    ("int16", {"compress": "lzw", "predictor": 2, "ENDIANNESS": "BIG", "crs": "EPSG:4326"}),
    ("uint8", {"nbits": 1, "compress": "ccittfax4"}),
    ("uint8", {"compress": "jpeg", "tiled": True, "blockxsize": 16, "blockysize": 16}),
    ("float32", {"compress": "zstd", "bigtiff": "YES", "tiled": True, "blockxsize": 16,
                 "blockysize": 16, "crs": "EPSG:2056", "tags": {"AREA_OR_POINT": "Point"}}),
    ("uint16", {"compress": "packbits", "band": {"scales": (0.1,), "offsets": (5.0,)}}),
    ("float32", {"compress": "lerc", "nodata": float("nan")}),
    ("uint8", {"photometric": "palette", "compress": "lzma", "sparse_ok": True}),
    ("float32", {"driver": "COG", "crs": "EPSG:32633"}),
    ("int32", {"nbits": 12, "dtype": "uint16", "crs": 'LOCAL_CS["here",UNIT["metre",1]]'}),
]  # fmt: skip
_BANDS = {"WEBP": 3, "LCP": 8}
_ENDINGS = {"PNM": "pgm", "SAGA": "sdat", "ROI_PAC": "dem", "Terragen": "ter", "NWT_GRD": "grd"}


def heights(rows: int = 9, columns: int = 12) -> Any:
    """Oblong heights that are neither level nor alike."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    return (7 * x + 13 * y) % 37 + 0.25 * x


@cache
def rasters() -> list[Files]:
    """A raster of every format that GDAL writes, of those that are read."""
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        folder = Path(name)
        found = [_files(folder, _tiff(folder, *variant)) for variant in _TIFFS]
        for driver in DRIVERS:
            found += _written(folder, driver)
        points = [
            rasterio.control.GroundControlPoint(row, column, 10 * column + row, 50 - 9 * row)
            for row, column in ((0, 0), (0, 12), (9, 0), (8, 12), (4, 5), (3, 8))
        ]
        placed = geotiff(folder / "case.tif", heights(), gcps=points, crs="EPSG:32633")
        found.append(_files(folder, Path(placed)))
        found += _mosaics(folder)
    return found


def _mosaics(folder: Path) -> Iterator[Files]:
    """A VRT of each of some formats that are no TIFF."""
    for driver, ending in (("AAIGrid", "asc"), ("ENVI", "img"), ("netCDF", "nc"), ("XYZ", "xyz")):
        geotiff(folder / "from.tif", heights().astype("float32"))
        rasterio.shutil.copy(str(folder / "from.tif"), str(folder / f"a.{ending}"), driver=driver)
        (folder / "from.tif").unlink()
        source = f'<SourceFilename relativeToVRT="1">a.{ending}</SourceFilename>'
        (folder / "case.vrt").write_text(
            '<VRTDataset rasterXSize="12" rasterYSize="9"><GeoTransform>0, 2, 0, 9, 0, -2'
            '</GeoTransform><VRTRasterBand dataType="Float32" band="1"><SimpleSource>'
            f"{source}<SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
        )
        yield _files(folder, folder / "case.vrt")


@cache
def grids() -> list[Files]:
    """Texts of gridded points, with separators, headers, comments and gaps of all kinds."""
    x, y = np.meshgrid(np.arange(12), np.arange(9))
    points = np.stack([500000 + 10 * x, 4500000 - 5 * y, heights()], axis=-1)
    found = []
    for separator, header, end, form in (
        (" ", "", "\n", "%.12g"), (",", "x,y,z\n", "\n", "%.2f"), (";", "# X;Y;Z\n", ";\r\n", "%r"),
        ("\t", "//a comment\n\n", "\n", "%.8e"), ("  ", "lat lon height id\n", " 7\n", "%.3f"),
    ):  # fmt: skip
        for some in (points.reshape(-1, 3), points.transpose(1, 0, 2).reshape(-1, 3)[:-5]):
            rows = (separator.join(form % one for one in row) for row in some.tolist())
            found.append((("case.xyz", (header + end.join(rows) + end).encode()),))
    found.append((("case.txt", found[0][0][1].replace(b".", b",")),))
    return found


def _tiff(folder: Path, dtype: str, options: dict[str, Any]) -> Path:
    path = folder / "case.tif"
    geotiff(path, heights().astype(options.pop("dtype", dtype)), **options)
    return path


def _written(folder: Path, driver: str) -> Iterator[Files]:
    """The smallest of the types that a driver takes, if it writes at all."""
    known = {name: ending for ending, name in raster_driver_extensions().items()}
    ending = _ENDINGS.get(driver) or known.get(driver) or "dat"
    shape, crs = ((121, 121), "EPSG:4326") if driver == "DTED" else ((9, 12), "EPSG:32633")
    for dtype in ("float32", "int16", "uint8"):
        path = folder / f"case.{ending}"
        bands = np.stack([heights(*shape).astype(dtype)] * _BANDS.get(driver, 1))
        degree = {"side": 1 / 120, "corner": (9 - 1 / 240, 46 + 1 / 240)} if shape[0] > 9 else {}
        geotiff(folder / "from.tif", bands, crs=crs, **degree)
        try:
            rasterio.shutil.copy(str(folder / "from.tif"), str(path), driver=driver)
            with rasterio.open(path) as file:
                file.read(1)
        except (RasterioError, OSError, ValueError, rasterio._err.CPLE_BaseError):
            _clear(folder)
            continue
        (folder / "from.tif").unlink()
        yield _files(folder, path)
        return


def _files(folder: Path, first: Path) -> Files:
    """The files in a folder, which is empty then."""
    paths = sorted(folder.iterdir(), key=lambda path: (path != first, path.name))
    found = tuple((path.name, path.read_bytes()) for path in paths)
    _clear(folder)
    return found


def _clear(folder: Path) -> None:
    for path in folder.iterdir():
        path.unlink()


_SCENE = """#VRML V2.0 utf8
# z is up
DEF HILL Transform { translation 1 2 3 rotation 0 1 0 0.5 scale 2 1 1 children [
  Shape { geometry ElevationGrid { xDimension 3 zDimension 2 xSpacing 2 zSpacing 1.5
          height [ 0 1 0.5, 2 1e-1 -3 ] } }
  Shape { geometry Extrusion { crossSection [ 1 1, 1 -1, -1 -1, 1 1 ] spine [ 0 0 0, 0 2 0, 1 3 0 ]
          scale [ 1 1, 0.5 0.5, 1 1 ] orientation [ 0 0 1 0 ] } } ] }
Switch { whichChoice 0 choice [
  Shape { geometry Box { size 2 3 4 } } Group { children USE HILL } ] }
Shape { geometry IndexedFaceSet { coord DEF C Coordinate { point [ 0 0 0, 4 0 1, 4 3 2, 0 3 0.5 ] }
        coordIndex [ 0 1 2 3 -1 0 2 3 ] solid FALSE } }
LOD { range [ 10 ] level [ Shape { geometry Sphere { radius 2 } } Shape { geometry Cone { } } ] }
Anchor { url "x" children Shape { geometry Cylinder { height 3 } } } ROUTE HILL.scale TO HILL.scale
"""


USDA = """#usda 1.0
(
    upAxis = "Z"
    metersPerUnit = 0.3048
)
over "Part" {
    def Mesh "M" {
        int[] faceVertexCounts = [3, 4]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3, 4]
        int[] holeIndices = [7]
        point3f[] points = [(0, 0, 1), (4, 0, 2), (4, 3, 0.5), (0, 3, 1), (-1, 2, 0)]
        uniform token orientation = "leftHanded"
    }
}
def Xform "A" (instanceable = true; references = </Part>) {
    double3 xformOp:translate.timeSamples = { 5: (0, 0, 7), 9: (0, 0, 99) }
    float3 xformOp:rotateXYZ = (10, 20, 30)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def PointInstancer "I" {
    rel prototypes = [</I/P/C>]
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (0, 20, 0)]
    quath[] orientations = [(1, 0, 0, 0), (0, 0, 0, 1)]
    def Scope "P" {
        def Cylinder "C" {
            double radius = 2
            uniform token axis = "X"
        }
        def Plane "S" {
            double width = 2
            token visibility = "invisible"
        }
    }
}
"""


@cache
def meshes() -> list[Files]:
    """Meshes of every format that is read."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = []
        for suffix, put in PUT:
            put(folder / f"case{suffix}")
            found.append(_files(folder, folder / f"case{suffix}"))
        for suffix in (".obj", ".stl", ".ply", ".glb", ".wrl", ".x3d"):
            exported(terrain_of(YARD), folder / f"case{suffix}", 0.5)
            found.append(_files(folder, folder / f"case{suffix}"))
            if suffix == ".x3d":
                text = found[-1][0][1]
                found.append((("case.x3dz", gzip.compress(text, mtime=0)),))
                wide = text.decode().replace("UTF-8", "UTF-16").encode("utf-16")
                found.append((("case.x3d", wide),))
        packed = gzip.compress(_SCENE.encode(), mtime=0)
        found += [(("case.wrl", _SCENE.encode()),), (("case.wrz", packed),)]
        found.append((("case.x3dv", _SCENE.replace("VRML V2.0", "X3D V3.0").encode()),))
    # those of the formats that this version reads
    return [files for files in found if is_mesh(files[0][0])]


@cache
def stages() -> list[Files]:
    """USD of every form that is read; the library starts threads, so workers do without it."""
    pack = "from pxr import Sdf; Sdf.Layer.FindOrOpen('from.usda').Export('case.usdc')"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "from.usda").write_text(USDA)
        subprocess.run([sys.executable, "-c", pack], cwd=folder, check=True)
        found: list[Files] = [
            (("case.usda", USDA.encode()),),
            (("case.usdc", (folder / "case.usdc").read_bytes()),),
        ]
    found.append((("case.usdz", _packed([("case.usda", USDA.encode())])),))
    return found


# --- mistakes ------------------------------------------------------------------------------------


def make_raster(rng: random.Random) -> Case:
    """A raster with one to a few mistakes."""
    return _broken(rng, rasters())


def make_grid(rng: random.Random) -> Case:
    """A text of gridded points with one to a few mistakes."""
    return _broken(rng, grids())


def make_mesh(rng: random.Random) -> Case:
    """A mesh with one to a few mistakes."""
    return _broken(rng, meshes())


def make_stage(rng: random.Random) -> Case:
    """A USD file with one to a few mistakes."""
    return _broken(rng, stages())


def _broken(rng: random.Random, seeds: list[Files]) -> Case:
    files = list(rng.choice(seeds))
    at = 0 if rng.random() < 0.7 else rng.randrange(len(files))
    name, data = files[at]
    other = rng.choice(rng.choice(seeds))[1]
    for _ in range(rng.choice([1, 1, 1, 2, 4, 12])):
        data = _mutated(rng, name, data, other)
    files[at] = name, data
    suffix = "".join(Path(files[0][0]).suffixes)
    return Case(suffix, data) if len(files) == 1 else Case(f"{suffix}{FILES}", _packed(files))


def _packed(files: list[tuple[str, bytes]]) -> bytes:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as archive:
        for name, data in files:
            archive.writestr(zipfile.ZipInfo(name), data)
    return whole.getvalue()


def _mutated(rng: random.Random, name: str, data: bytes, other: bytes) -> bytes:
    """A file with a mistake: within what it packs, in its header, its text or its bytes."""
    broken = (ValueError, OSError, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError)
    with contextlib.suppress(*broken):  # by a mistake before
        if name.endswith((".wrz", ".x3dz")) and rng.random() < 0.8:
            return gzip.compress(mutate_text(rng, gzip.decompress(data), other), mtime=0)
        if name.endswith((".3mf", ".usdz")) and rng.random() < 0.8:
            return _mutated_archive(rng, data, other)
        if name.endswith(".gltf") and rng.random() < 0.6:
            return _mutated_json(rng, data)
        if name.endswith(".glb") and rng.random() < 0.6:
            length = int.from_bytes(data[12:16], "little")
            text = _mutated_json(rng, data[20 : 20 + length])
            text += b" " * (-len(text) % 4)
            rest = len(text).to_bytes(4, "little") + data[16:20] + text + data[20 + length :]
            return data[:8] + (12 + len(rest)).to_bytes(4, "little") + rest
    is_text = data[:400].isascii() and b"\0" not in data[:400]
    return (mutate_text if is_text else mutate_bytes)(rng, data, other)


def _mutated_json(rng: random.Random, data: bytes) -> bytes:
    tree = json.loads(data)
    keys = ["mode", "sparse", "byteStride", "normalized", "count", "matrix", "children", "uri"]
    return json.dumps(mutate_tree(rng, tree, keys, json.loads(data))).encode("utf-8", "replace")


def _mutated_archive(rng: random.Random, data: bytes, other: bytes) -> bytes:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    at = rng.randrange(len(members))
    name, text = members[at]
    members[at] = name, mutate_text(rng, text, other)
    return _packed(members)


# --- what is done with them ----------------------------------------------------------------------


@contextlib.contextmanager
def _put(case: Case, folder: Path) -> Iterator[Path]:
    """The files of a case, for as long as they are needed."""
    if case.suffix.endswith(FILES):
        with zipfile.ZipFile(io.BytesIO(case.data)) as archive:
            names = archive.namelist()
            archive.extractall(folder)
        first = folder / names[0]
    else:
        first = folder / f"case{case.suffix}"
        first.write_bytes(case.data)
    try:
        yield first
    finally:
        _clear(folder)


def try_raster(case: Case, folder: Path) -> str:
    """Read its heights; some become a terrain, some are read as classes."""
    draw = zlib.crc32(case.data)
    with _put(case, folder) as path:
        name = _archived(path, draw) if draw % 8 == 3 else str(path)
        with open_source(name, SourceOptions(crs="EPSG:3857" if draw % 16 == 1 else None)) as found:
            _read(found, folder, draw)
            grid = found.grid
        if draw % 16 == 2 and grid.rows * grid.columns <= LARGEST:
            with open_classes(name, grid) as classes:
                classes.read(0, 1)
    return "read"


def _archived(path: Path, draw: int) -> str:
    """The name of a file within an archive of all that are beside it, whose bytes may be broken."""
    archive = path.with_name("case.zip")
    members = [(each.name, each.read_bytes()) for each in sorted(path.parent.iterdir())]
    data = _packed(members)
    if draw % 16 == 3:
        data = mutate_bytes(random.Random(draw), data, data)
    archive.write_bytes(data)
    return f"zip://{archive}!{path.name}"


def _read(found: sources.HeightSource, folder: Path, draw: int) -> None:
    grid = found.grid
    pixels = grid.rows * grid.columns
    rows = min(grid.rows, max(1, LARGEST // max(1, grid.columns)))
    for first in range(0, rows, 64):
        found.read(first, min(64, rows - first))
    found.read(grid.rows - 1, 1)
    if draw % 4 == 0 and pixels <= _FEW:
        import_terrain(found, folder / "terrain.json", ImportOptions(0.5))
    "".join(found.notes).encode()


def try_mesh(case: Case, folder: Path) -> str:
    """Read its triangles, and see it from above."""
    with _put(case, folder) as path:
        triangles = read_triangles(path)
        low, high = triangles.vertices.min(axis=0), triangles.vertices.max(axis=0)
        side = float((high - low)[:2].max())
        if side > 0:
            _read(sample(triangles, side / 16, None, path.name), folder, zlib.crc32(case.data))
    return "read"


TARGETS = (
    Target("rasters", 100_000, make_raster, try_raster),
    Target("grids", 100_000, make_grid, try_raster),
    Target("meshes", 100_000, make_mesh, try_mesh),
    Target("stages", 3_000, make_stage, try_mesh),  # each in a process of its own
)
