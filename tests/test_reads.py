"""A stranger's file has nothing read but itself, and the files beside it that the docs name.

Three watchers: inotify sees whether a file elsewhere is opened, by GDAL and PROJ, too; an audit
hook sees all that Python opens; strace sees every name that is looked for. In the folder of a
stranger, where one works, nothing is read but what was named: no settings of libraries, no modules.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rasterio
import rasterio.shutil

from tests.commands import ENVIRONMENT, ROOT, call
from tests.io.test_opening import dem
from tests.programs import needs

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="inotify is of Linux")

TERRAIN = {"size": [3, 2], "elemTypes": {"a": {"x": [0, 1]}}, "elemTree": {"type": "a"}}
_OPENED, _READ = 0x20, 0x01

Watch = Callable[[], list[str]]


@pytest.fixture
def elsewhere(tmp_path: Path) -> Iterator[tuple[Path, Watch]]:
    """A folder with files of every kind that may be named, and what of them was opened lately."""
    folder = tmp_path / "elsewhere"
    dem(folder / "secret.tif")
    for ending in ("prj", "json", "mtl", "bin", "gsb", "img", "wrl", "x3d", "png", "txt", "csv"):
        (folder / f"secret.{ending}").write_bytes(b"0 0 0 0\n" * 9)
    c = ctypes.CDLL(None, use_errno=True)
    number = c.inotify_init1(os.O_NONBLOCK)
    assert number >= 0
    assert c.inotify_add_watch(number, os.fsencode(folder), _OPENED | _READ) >= 0

    def opened() -> list[str]:
        try:
            events = os.read(number, 1 << 16)
        except BlockingIOError:
            return []
        return sorted({name.decode() for name in events.split(b"\0") if b"secret" in name})

    (folder / "secret.txt").read_bytes()
    assert opened() == ["secret.txt"]  # it does see
    yield folder, opened
    os.close(number)


def hostile(here: Path, path: str) -> Iterator[Path]:
    """Files that name another one, wherever a format lets them."""

    def put(name: str, text: str) -> Path:
        (here / name).write_text(text)
        return here / name

    crses = [path, f"@{path}", f"+init={path}:1", f"+proj=longlat +nadgrids={path}", f"file://{path}",
             f"+proj=pipeline +step +proj=gridshift +grids={path}"]  # fmt: skip
    for number, crs in enumerate(crses):
        yield put(f"crs{number}.json", json.dumps({**TERRAIN, "crs": crs, "$schema": path}))
    source = """<VRTDataset rasterXSize="6" rasterYSize="4"><VRTRasterBand dataType="Float32" band="1">
<SimpleSource><SourceFilename relativeToVRT="0">{}</SourceFilename><SourceBand>1</SourceBand>
</SimpleSource></VRTRasterBand></VRTDataset>"""  # fmt: skip
    yield put("plain.vrt", source.format(path))
    yield put(
        "relative.vrt", source.replace('VRT="0"', 'VRT="1"').format("../elsewhere/secret.tif")
    )
    entity = f'<!DOCTYPE a [<!ENTITY b SYSTEM "file://{path}">]>'
    yield put("entity.vrt", entity + source.format("&b;"))
    yield put("vrt.tif", source.format(path))
    yield put("pds4.xml", _PDS4.format(path))
    label = f"""PDS_VERSION_ID = PDS3\nRECORD_TYPE = FIXED_LENGTH\nRECORD_BYTES = 24\n^IMAGE = ("{path}", 1)
OBJECT = IMAGE\nLINES = 4\nLINE_SAMPLES = 6\nSAMPLE_TYPE = PC_REAL\nSAMPLE_BITS = 32\nEND_OBJECT\nEND\n"""
    yield put("label.lbl", label)
    core = f"Object = IsisCube\n Object = Core\n  StartByte = 1\n  ^Core = {path}\n  Format = BandSequential\n"
    yield put("cube.cub", core + "  Group = Dimensions\n   Samples = 6\n   Lines = 4\n   Bands = 1\n"
              "  End_Group\n  Group = Pixels\n   Type = Real\n  End_Group\n End_Object\nEnd_Object\nEnd\n")  # fmt: skip
    dem(here / "mask.tif")
    put("mask.tif.msk", source.format(path))
    yield here / "mask.tif"
    dem(here / "system.tif")
    put("system.prj", f'PROJCS["x",EXTENSION["PROJ4","+proj=longlat +nadgrids={path}"]]')
    put("system.tif.aux.xml", f"<PAMDataset><SRS>+proj=longlat +nadgrids={path}</SRS></PAMDataset>")
    yield here / "system.tif"
    for within in (True, False):  # the tags of a TIFF, and those beside it
        name = f"overviews-{within}.tif"
        dem(here / name)
        if within:
            with rasterio.open(here / name, "r+") as file:
                file.update_tags(ns="OVERVIEWS", OVERVIEW_FILE=path)
        else:
            item = f'<Metadata domain="OVERVIEWS"><MDI key="OVERVIEW_FILE">{path}</MDI></Metadata>'
            put(f"{name}.aux.xml", f"<PAMDataset>{item}</PAMDataset>")
        yield here / name
    yield put("mesh.obj", f"mtllib {path}\nv 0 0 0\nv 1 0 1\nv 0 1 0\nusemtl a\nf 1 2 3\n")
    yield put("scene.wrl", f'#VRML V2.0 utf8\nInline {{ url "{path}" }}\n'
              f'Shape {{ appearance Appearance {{ texture ImageTexture {{ url "{path}" }} }} }}\n')  # fmt: skip
    yield put("scene.x3d", f"{entity}<X3D><Scene><Inline url='\"{path}\"'/>&b;</Scene></X3D>")
    gltf = {
        "asset": {"version": "2.0"}, "buffers": [{"uri": path, "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}], "images": [{"uri": path}],
    }  # fmt: skip
    yield put("scene.gltf", json.dumps(gltf))


_PDS4 = """<?xml version="1.0" encoding="UTF-8"?>
<Product_Observational xmlns="http://pds.nasa.gov/pds4/pds/v1"><File_Area_Observational>
<File><file_name>{}</file_name></File><Array_2D_Image><offset unit="byte">0</offset>
<axes>2</axes><axis_index_order>Last Index Fastest</axis_index_order><Element_Array>
<data_type>IEEE754LSBSingle</data_type></Element_Array><Axis_Array><axis_name>Line</axis_name>
<elements>4</elements><sequence_number>1</sequence_number></Axis_Array><Axis_Array>
<axis_name>Sample</axis_name><elements>6</elements><sequence_number>2</sequence_number></Axis_Array>
</Array_2D_Image></File_Area_Observational></Product_Observational>"""

KINDS = ("tif", "prj", "gsb", "mtl", "bin", "img", "txt", "json")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("relative", [False, True])
def test_nothing_elsewhere_is_opened(
    kind: str, relative: bool, elsewhere: tuple[Path, Watch], tmp_path: Path
) -> None:
    folder, opened = elsewhere
    (here := tmp_path / "here").mkdir()
    path = f"../elsewhere/secret.{kind}" if relative else str(folder / f"secret.{kind}")
    found = {}
    for file in hostile(here, path):
        opened()
        if file.suffix == ".json":
            call("validate", file)
            call("export-dem", file, here / "out.tif", "--resolution", 1, "--overwrite")
            call("export-mesh", file, here / "out.obj", "--overwrite")
        else:
            call("import-terrain", file, here / "out.json", "--max-error", 1, "--overwrite")
            call("import-primitive", file, "--name", "x")
        if seen := opened():
            found[file.name] = seen
    assert found == {}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["laz", "nc", "img"])
def test_no_module_of_a_strange_folder_is_run(kind: str, tmp_path: Path) -> None:
    """By the process of its own that reads, or writes, what may crash a library."""
    (here := tmp_path / "here").mkdir()
    for name in ("terratool", "laspy", "numpy", "rasterio", "struct", "sitecustomize"):
        (here / f"{name}.py").write_text("open('ran', 'w').close()\n")
    if kind == "nc":
        dem(tmp_path / "a.tif")
        rasterio.shutil.copy(str(tmp_path / "a.tif"), str(here / "a.nc"), driver="netCDF")
        words = ["import-terrain", "a.nc", "a.json", "--max-error", "1"]
    elif kind == "img":
        (here / "a.json").write_text(json.dumps(TERRAIN))
        words = ["export-dem", "a.json", "a.img", "--resolution", "1"]
    else:
        laspy = pytest.importorskip("laspy")
        header = laspy.LasHeader(version="1.4", point_format=6)
        with laspy.open(here / "a.laz", "w", header=header) as file:
            file.write_points(laspy.ScaleAwarePointRecord.zeros(3, header=header))
        words = ["map", "a.laz", "--resolution", "1", "--output", "a.tif"]
    done = subprocess.run(
        [sys.executable, "-P", "-m", "terratool", *words],
        cwd=here, env=ENVIRONMENT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert not (here / "ran").exists()


WATCHED = """
import json, os, sys
paths = set()
def hook(event, arguments):
    if event == "open" and isinstance(arguments[0], (str, bytes)):
        paths.add(os.path.abspath(os.fsdecode(arguments[0])))
sys.addaudithook(hook)
from tests.commands import call
codes = [call(*words).code for words in json.loads(sys.argv[1])]
print(json.dumps([codes, sorted(paths)]))
"""


def test_what_python_opens(tmp_path: Path) -> None:
    """The named file, settings on the way to it, outputs, and what Python and the system need."""
    (here := tmp_path / "here").mkdir()
    for name in ("site.json", "other.json", "rover.json", "site.csv"):
        (here / name).write_text(json.dumps(TERRAIN))
    dem(here / "dem.tif")
    dem(here / "dem2.tif")
    words = [
        ["validate", "site.json", "--config", "none.toml"],
        ["validate", "site.json"],
        ["info", "site.json"],
        ["query", "site.json", "1", "1"],
        ["export-dem", "site.json", "out.asc", "--resolution", "1"],
        ["export-mesh", "site.json", "out.obj"],
        ["import-terrain", "dem.tif", "out.json", "--max-error", "1"],
    ]
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, json.dumps(words)],
        cwd=here, env={**ENVIRONMENT, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    codes, paths = json.loads(done.stdout)
    assert codes[1:] == [0] * 6
    system = {sys.prefix, sys.base_prefix, "/proc", "/sys", "/dev", "/usr"}
    system |= {str(ROOT / name) for name in ("terratool", "tests", "build", "schemas")}
    others = [path for path in paths if not any(path.startswith(f"{one}/") for one in system)]
    inside = {path for path in others if path.startswith(f"{here}/")}
    # of outputs only what is in their temporary folder
    names = {os.path.relpath(path, here) for path in inside if "/.terratool-" not in path}
    assert names <= {"site.json", "dem.tif", ".", "none.toml", ".terratool.toml", "pyproject.toml"}
    assert {"site.json"} <= names
    others = [path for path in others if path not in inside and not path.endswith(".toml")]
    assert set(others) <= {str(here)}  # folders are synced


# --- the current folder --------------------------------------------------------------------------

SCRIPT = "import sys; del sys.path[0]; from terratool.cli.main import main; main()"
"""As the installed command begins: the folder of a program is first on its path, not this one."""
HUSKY, LIDAR, CAMERA = (
    str(ROOT / "samples" / name)
    for name in ("vehicles/husky-a200.json", "sensors/velodyne-vlp-16.json",
                 "sensors/realsense-d435.json")
)  # fmt: skip
POSE = ["--pose", "10", "8", "2", "0", "40", "0"]
DXF = """0\nSECTION\n2\nENTITIES\n0\n3DFACE\n8\n0\n10\n0\n20\n0\n30\n0\n11\n4\n21\n0\n31\n0\n12\n4
22\n4\n32\n1\n13\n0\n23\n4\n33\n1\n0\nENDSEC\n0\nEOF\n"""
USDA = """#usda 1.0
def Mesh "M" {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (400, 0, 0), (400, 99, -400), (0, 0, -400)]
    asset inputs:file = @dem.tif@
}
"""
DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><library_images>
<image id="i"><init_from>dem.tif</init_from></image></library_images><library_geometries>
<geometry id="g"><mesh><source id="p"><float_array id="a" count="9">0 0 0 4 0 0 4 1 -4</float_array>
<technique_common><accessor source="#a" count="3" stride="3"><param name="X"/><param name="Y"/>
<param name="Z"/></accessor></technique_common></source><vertices id="v">
<input semantic="POSITION" source="#p"/></vertices><triangles count="1">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry>
</library_geometries></COLLADA>"""
COMMANDS = {
    "validate": "validate s.json",
    "tif": "export-dem s.json o.tif --resolution 1",
    "cog": "export-dem s.json c.tif --resolution 1 --cog",
    "another process": "export-dem s.json o.img --resolution 1",
    "netcdf": "export-dem s.json o.nc --resolution 1",
    "tiles": "export-dem s.json --tiles t --resolution 1",
    "dask": "export-dem s.json --tiles d --resolution 1 --dask local",
    "import tif": "import-terrain dem.tif i.json --max-error 1",
    "import netcdf": "import-terrain in.nc n.json --max-error 1",
    "import dxf": "import-terrain in.dxf x.json --max-error 1 --resolution 1",
    "import dae": "import-terrain in.dae a.json --max-error 1 --resolution 1",
    "import usd": "import-terrain in.usda b.json --max-error 1 --resolution 1",
    "import obj": "import-terrain in.obj y.json --max-error 1 --resolution 1",
    "glb": "export-mesh s.json m.glb --max-error 1",
    "usd": "export-mesh s.json m.usda --max-error 1",
    "simulators": "export-sim s.json sim --target all",
    "png": "render s.json r.png --pixels 500",
    "pdf": "render s.json r.pdf --pixels 500",
    "page": "view s.json --no-open --output v.html",
    "scan": f"scan s.json c.npz --sensor {LIDAR} {' '.join(POSE)}",
    "laz": f"scan s.json c.laz --sensor {LIDAR} {' '.join(POSE)}",
    "bag": f"scan s.json c.rosbag2 --sensor {LIDAR} {' '.join(POSE)}",
    "image": f"scan s.json e.tif --sensor {CAMERA} {' '.join(POSE)}",
    "map": "map in.npz --resolution 1 --output k.tif --bag kbag",
    "compare": "compare in.map.tif s.json --picture p.png",
    "verdicts": f"traversability s.json --vehicle {HUSKY} --headings 4 --resolution 1 --map w.tif "
    "--report w.html",
    "diff": "diff s.json u.json --picture q.png --map q.tif",
}
SETTINGS = [
    "matplotlibrc", "ezdxf.ini", ".ncrc", ".daprc", ".dodsrc", "NZTM2000", "MapML_APSTILE",
    "MapML_CBMTILE", "LINZAntarticaMapTileGrid", "GoogleMapsCompatible", "proj.ini", "proj.db",
    "gdalrc", "gdal.ini", "epsg.wkt", "cubewerx_extra.wkt", "pcs.override.csv", "dask.yaml",
    "distributed.yaml", ".numba_config.yaml", ".netrc", "pyvenv.cfg", "setup.cfg", "plugInfo.json",
    "fonts.conf", "fontlist.json", "stylelib", ".pdbrc", "trimesh.json", ".env", "site.cfg",
]  # fmt: skip
MODULES = [
    "numpy", "rasterio", "json", "os", "multiprocessing", "signal", "struct", "terratool", "click",
    "trimesh", "matplotlib", "distributed", "dask", "tornado", "cloudpickle", "sitecustomize",
    "usercustomize", "encodings", "site", "runpy", "warnings", "resource", "msgspec", "psutil",
    "yaml", "logging", "types", "re", "io", "pickle", "importlib", "threading",
]  # fmt: skip


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the commands read."""
    here = tmp_path_factory.mktemp("inputs")
    ground = {"cohesion": 1, "fricAngle": 30, "sinkage": 0.01, "shearModulus": 0.01}
    site = {"size": [20, 16], "surfTypes": {"a": ground}, "elemTypes": {"k": {"x": [0, 0.1]}},
            "elemTree": {"type": "k", "surface": "a"}}  # fmt: skip
    (here / "s.json").write_text(json.dumps(site))
    (here / "u.json").write_text(json.dumps({**site, "elemTypes": {"k": {"x": [0, 0.2]}}}))
    dem(here / "dem.tif")
    (here / "in.dxf").write_text(DXF)
    (here / "in.dae").write_text(DAE)
    (here / "in.usda").write_text(USDA)
    (here / "in.obj").write_text("v 0 0 0\nv 4 0 1\nv 0 4 1\nv 4 4 1\nf 1 2 4 3\n")
    for words in (
        "export-dem s.json in.nc --resolution 1",
        f"scan s.json in.npz --sensor {LIDAR} {' '.join(POSE)}",
        "map in.npz --resolution 1 --output in.map.tif",
    ):
        done = command(here, words)
        assert done.returncode == 0, done.stderr
    return here


def command(
    here: Path, words: str, *before: str, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run the command as it is installed."""
    return subprocess.run(
        [*before, sys.executable, "-c", SCRIPT, *words.split()],
        cwd=here, env={**ENVIRONMENT, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True, text=True, check=False, timeout=120, stdin=subprocess.DEVNULL,
    )  # fmt: skip


@pytest.fixture
def stranger(inputs: Path, tmp_path: Path) -> Path:
    """The folder of a stranger with the inputs, settings of everything, and modules that tell."""
    here = tmp_path / "here"
    shutil.copytree(inputs, here)
    for name in SETTINGS:
        (here / name).write_text("no settings at all {[(\n")
    for name in MODULES:
        (here / f"{name}.py").write_text(f"open({str(tmp_path / 'hit')!r}, 'a').write('{name} ')\n")
    return here


@contextlib.contextmanager
def opened_in(folder: Path) -> Iterator[set[str]]:
    """The names of files in a folder that are opened in the block."""
    c = ctypes.CDLL(None, use_errno=True)
    number = c.inotify_init1(os.O_NONBLOCK)
    assert c.inotify_add_watch(number, os.fsencode(folder), _OPENED | _READ) >= 0
    found: set[str] = set()
    yield found
    with contextlib.suppress(BlockingIOError):
        while events := os.read(number, 1 << 16):
            found |= {name.decode("utf-8", "replace") for name in events.split(b"\0") if name}
    os.close(number)


@pytest.mark.slow
@pytest.mark.parametrize("key", COMMANDS)
def test_nothing_of_the_current_folder_is_obeyed(key: str, stranger: Path, tmp_path: Path) -> None:
    """Neither opened, nor run, in the command and in processes that it starts."""
    with opened_in(stranger) as names:
        done = command(stranger, COMMANDS[key])
    assert done.returncode in (0, 1), done.stderr
    assert "s.json" in names or "import" in key or key == "map"
    assert names.isdisjoint({*SETTINGS, *(f"{name}.py" for name in MODULES)})
    assert not (tmp_path / "hit").exists()


@pytest.mark.nightly
def test_settings_of_the_user_count(stranger: Path, tmp_path: Path) -> None:
    """Where the user names them, also as seen from the current folder; and nothing waits."""
    (stranger / "mine").mkdir()
    (stranger / "mine/matplotlibrc").write_text("no settings at all\n")
    (stranger / "matplotlibrc").unlink()
    os.mkfifo(stranger / "matplotlibrc")
    assert command(stranger, COMMANDS["png"]).returncode == 0
    with opened_in(stranger / "mine") as names:
        assert command(stranger, COMMANDS["pdf"], MATPLOTLIBRC="mine").returncode == 0
    assert "matplotlibrc" in names
    assert command(stranger, COMMANDS["validate"]).returncode == 0


LOOKED = re.compile(r'\d+ +(\w+)\((?:AT_FDCWD, )?(?:"([^"]*)")?').match


def looked_for(log: str, here: Path) -> set[str]:
    """Names in a folder that processes looked for, as seen from it."""
    found, stands = set(), here
    for line in log.splitlines():
        call, name = ((match := LOOKED(line)) and match.groups()) or ("", None)
        if call == "fchdir":
            stands = here
        elif name is not None:
            path = os.path.relpath(stands / name, here)
            if call == "chdir":
                stands = stands / name
            elif not path.startswith(("..", ".terratool-")) and path != ".":
                found.add(path)
    return found


@pytest.mark.nightly
@needs("strace")
@pytest.mark.parametrize(
    "key",
    [
        "cog",
        "netcdf",
        "import netcdf",
        "import dxf",
        "import dae",
        "import usd",
        "png",
        "usd",
        "verdicts",
        "simulators",
    ],
)
def test_no_other_name_is_looked_for(key: str, inputs: Path, tmp_path: Path) -> None:
    """In the current folder: names that were given, what belongs to them, and settings of ours."""
    here = tmp_path / "here"
    shutil.copytree(inputs, here)
    log = tmp_path / "log"
    done = command(here, COMMANDS[key], "strace", "-f", "-o", str(log), "-e", "trace=file,fchdir")
    assert done.returncode in (0, 1), done.stderr
    words = COMMANDS[key].split()
    named = {re.split(r"[./]", word)[0] for word in words if not word.startswith("/")}
    found = looked_for(log.read_text(errors="replace"), here)
    others = {
        path
        for path in found
        if re.split(r"[./-]", path.lstrip("."))[0] not in named and path not in words
    }
    assert others == ({".terratool.toml", "pyproject.toml"} if key == "verdicts" else set())
    assert found
