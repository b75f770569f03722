"""Pipes and devices hold no command up: what is met is refused, what a user names is waited for."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rasterio

from terratool.definition import watch
from terratool.errors import TerratoolError
from terratool.raster.journal import NAME as JOURNAL
from terratool.simulators.export import MANIFEST
from terratool.viewing.live import FollowedFile, LiveState, follow
from terratool.viewing.scene import scene_of
from tests.commands import Ran, call, not_for_ever, run
from tests.io.test_opening import dem

pytestmark = pytest.mark.skipif(os.name == "nt", reason="there are no pipes with names")

GOOD = '{"size":10,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b"}}\n'
YARD = "samples/stairs-and-kerbs.json"


@pytest.fixture(autouse=True)
def awake() -> Iterator[None]:
    """What waits for a pipe would wait for ever, and the tests with it."""
    with not_for_ever(100):
        yield


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A terrain, a pipe, a link to it and one to a device."""
    place = tmp_path / "site"
    place.mkdir()
    (place / "a.json").write_text(GOOD)
    os.mkfifo(place / "b.json")
    (place / "c.json").symlink_to("b.json")
    (place / "z.json").symlink_to("/dev/zero")
    return place


@pytest.mark.parametrize(
    "words",
    [
        ("validate", "@"),
        ("validate", "--fix", "@"),
        ("format", "--check", "@"),
        ("format", "@"),
        ("diff", "@", "@"),
    ],
)
def test_those_of_a_folder_are_refused_one_by_one(folder: Path, words: tuple[str, ...]) -> None:
    """The others are read, and the exit code is that of what cannot be read."""
    ran = run(*(str(folder) if word == "@" else word for word in words))
    assert ran.code == 3
    said = ran.out + ran.err
    for name in "bc":
        assert f"{folder / name}.json: cannot be read (it is a pipe, and no regular file)" in said
    assert f"{folder / 'z'}.json: is a link out of " in said
    assert "a.json: cannot" not in said


def test_those_that_settings_name_are_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stranger may have put them there, and the settings."""
    (folder / ".terratool.toml").write_text('paths = ["b.json"]\n')
    monkeypatch.chdir(folder)
    ran = call("validate")
    assert (ran.code, "it is a pipe" in ran.err) == (3, True)
    (folder / ".terratool.toml").write_text('paths = ["a.json"]\nbaseline = "b.json"\n')
    ran = call("validate")
    assert (ran.code, "it is a pipe" in ran.err) == (3, True)


def there_and_back(path: Path) -> list[Callable[[], None]]:
    """A file becomes a pipe, and then another file."""

    def piped() -> None:
        path.unlink()
        os.mkfifo(path)

    def back() -> None:
        path.unlink()
        path.write_text(GOOD.replace("10", "20"))

    return [piped, back]


def test_a_watched_file_becomes_a_pipe_and_comes_back(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = folder / "a.json"

    ran = _watched(monkeypatch, there_and_back(path), lambda: call("validate", "--watch", path))
    assert ran.err.count("it is a pipe") == 1
    assert ran.out.count("no errors") == 3  # before, meanwhile and after


def test_a_shown_file_becomes_a_pipe_and_comes_back(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, state = folder / "a.json", LiveState()
    told: list[str] = []

    def heard(problem: TerratoolError | None) -> None:
        told.append(problem.message if problem else "drawn")

    def followed() -> None:
        with pytest.raises(KeyboardInterrupt):
            follow(state, FollowedFile(str(path)), scene_of, heard)

    _watched(monkeypatch, there_and_back(path), followed)
    assert [one.startswith(str(path)) for one in told] == [False, True, False]
    assert "it is a pipe" in told[1] and state.picture == 2


def _watched(
    monkeypatch: pytest.MonkeyPatch, steps: list[Callable[[], None]], command: Callable[[], Ran]
) -> Ran:
    """Follow while these are done, one in each second pause; then Ctrl-C is pressed."""
    pending, pauses = iter(steps), iter(range(100))

    def pause(_: float) -> None:
        if next(pauses) % 2:  # a change counts when it has lasted for one pause
            return
        step = next(pending, None)
        if step is None:
            raise KeyboardInterrupt
        step()

    monkeypatch.setattr(watch, "pause", pause)
    return command()


def test_a_pipe_is_not_followed(folder: Path) -> None:
    ran = run("view", "--watch", folder / "b.json", "--no-open")
    assert (ran.code, "it is a pipe" in ran.err) == (3, True)


# --- what a user names ---------------------------------------------------------------------------


@pytest.mark.nightly
def test_a_pipe_that_is_named_is_read(folder: Path) -> None:
    """As `terratool validate <(…)` has one, and as `/dev/stdin` is one."""
    writer = threading.Thread(target=lambda: (folder / "b.json").write_text(GOOD))
    writer.start()
    assert run("validate", folder / "b.json").code == 0
    writer.join()
    assert run("validate", "/dev/stdin", stdin=GOOD).code == 0
    assert run("info", "/dev/stdin", stdin=GOOD).code == 0
    points = run("query", folder / "a.json", "--points", "/dev/stdin", stdin="5,5\n")
    assert (points.code, points.out.count("5.0,5.0,1.0")) == (0, 1)
    route = ("--waypoints", "/dev/stdin")
    vehicle = ("--vehicle", "samples/vehicles/husky-a200.json", "--headings", 4, "--resolution", 1)
    ran = run("traversability", YARD, *vehicle, *route, stdin="3,3\n4,3\n")
    assert ran.code in (0, 1) and "No way" not in ran.err


def test_a_simulator_has_no_sum_of_a_pipe(folder: Path) -> None:
    """What was read once cannot be read again for it."""
    ran = run("export-sim", "/dev/stdin", folder / "sim", "--target", "pybullet", stdin=GOOD)
    assert ran.code == 0
    manifest = json.loads(next((folder / "sim" / "pybullet").glob("*.json")).read_text())
    assert manifest["source"] is None


def test_a_scan_that_is_a_pipe_is_read_once(folder: Path, tmp_path: Path) -> None:
    pipe = tmp_path / "a.csv"
    os.mkfifo(pipe)
    told = ("map", pipe, "--resolution", 1, "--output", tmp_path / "m.tif", "--overwrite")
    ran = run(*told)
    assert (ran.code, "is a pipe, and is read twice" in ran.err) == (2, True)
    writer = threading.Thread(target=lambda: pipe.write_text("x,y,z\n1,1,0\n2,3,1\n"))
    writer.start()
    assert run(*told, "--bounds", 0, 0, 4, 4).out.startswith(f"{tmp_path / 'm.tif'}: 2 readings")
    writer.join()


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".npz", ".ply", ".pcd", ".las", ".laz"])
def test_scans_that_are_looked_at_out_of_order_are_files(suffix: str, tmp_path: Path) -> None:
    pipe = tmp_path / f"a{suffix}"
    os.mkfifo(pipe)
    told = ("--resolution", 1, "--output", tmp_path / "m.tif", "--bounds", 0, 0, 4, 4)
    ran = run("map", pipe, *told)
    assert (ran.code, "it is a pipe, and no regular file" in ran.err) == (3, True)


# --- sources, and what lies beside them ----------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "suffix",
    [".tif", ".asc", ".nc", ".vrt", ".obj", ".glb", ".gltf", ".3mf", ".dxf", ".x3d", ".wrz"],
)
def test_sources_are_files(suffix: str, tmp_path: Path) -> None:
    pipe = tmp_path / f"a{suffix}"
    os.mkfifo(pipe)
    for more in ((), ("--allow-remote",)):
        ran = run("import-terrain", pipe, tmp_path / "a.json", "--max-error", 1, *more)
        assert (ran.code, "no regular file" in ran.err) == (3, True)
    archive = run("import-terrain", f"zip://{pipe}!a.tif", tmp_path / "a.json", "--max-error", 1)
    assert (archive.code, "no regular file" in archive.err) == (3, True)


@pytest.mark.slow
@pytest.mark.parametrize(
    "beside", ["a.tif.aux.xml", "a.tif.msk", "a.tif.ovr", "a.tfw", "a.prj", "DIM_a.XML", "A.TXT"]
)
def test_what_lies_beside_a_raster_is_a_file(beside: str, tmp_path: Path) -> None:
    """GDAL would open it, and wait."""
    dem(tmp_path / "a.tif")
    os.mkfifo(tmp_path / beside)
    told = ("--max-error", 1, "--overwrite")
    ran = run("import-terrain", tmp_path / "a.tif", tmp_path / "a.json", *told)
    assert (ran.code, f"{beside}: is no" in ran.err) == (3, True)
    (tmp_path / beside).unlink()
    os.mkfifo(tmp_path / "debugger-pipe-12")  # of which there are many in temporary folders
    (tmp_path / "a.gone").symlink_to("nothing")
    assert run("import-terrain", tmp_path / "a.tif", tmp_path / "a.json", *told).code == 0


@pytest.mark.slow
def test_what_a_raster_names_is_a_file(tmp_path: Path) -> None:
    """In its tags, or as a label does; in whatever case."""
    told = ("--max-error", 1, "--overwrite")
    os.mkfifo(tmp_path / "wide.dat")
    dem(tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif", "r+") as file:
        file.update_tags(ns="OVERVIEWS", OVERVIEW_FILE=str(tmp_path / "wide.dat"))
    ran = run("import-terrain", tmp_path / "a.tif", tmp_path / "a.json", *told)
    assert (ran.code, "wide.dat: is no regular file" in ran.err) == (3, True)
    label = """PDS_VERSION_ID = PDS3\nRECORD_TYPE = FIXED_LENGTH\nRECORD_BYTES = 24
^IMAGE = ("WIDE.DAT", 1)\nOBJECT = IMAGE\nLINES = 4\nLINE_SAMPLES = 6\nSAMPLE_TYPE = PC_REAL
SAMPLE_BITS = 32\nEND_OBJECT\nEND\n"""
    (tmp_path / "b.lbl").write_text(label)
    ran = run("import-terrain", tmp_path / "b.lbl", tmp_path / "a.json", *told)
    assert (ran.code, "wide.dat: is no regular file" in ran.err) == (3, True)
    (other := tmp_path / "other").mkdir()
    (tmp_path / "a.tif").rename(other / "a.tif")
    ran = run("import-terrain", other / "a.tif", tmp_path / "a.json", *told)
    assert (ran.code, "its overviews are another file" in ran.err) == (3, True)


def test_what_lies_beside_the_parts_of_a_mosaic_is_a_file(tmp_path: Path) -> None:
    parts = tmp_path / "parts"
    parts.mkdir()
    dem(parts / "b.tif")
    source = (
        '<VRTDataset rasterXSize="6" rasterYSize="4"><VRTRasterBand dataType="Float32" band="1">'
        '<SimpleSource><SourceFilename relativeToVRT="1">parts/b.tif</SourceFilename>'
        "<SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
    )
    (tmp_path / "a.vrt").write_text(source)
    told = ("import-terrain", tmp_path / "a.vrt", tmp_path / "a.json", "--max-error", 1)
    assert run(*told).code == 0
    os.mkfifo(parts / "b.tif.aux.xml")
    ran = run(*told, "--overwrite")
    assert (ran.code, "b.tif.aux.xml: is no regular file" in ran.err) == (3, True)


@pytest.mark.nightly
def test_buffers_of_a_gltf_are_files(tmp_path: Path) -> None:
    numbers = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 1]], "<f4").tobytes()
    scene = {
        "asset": {"version": "2.0"}, "buffers": [{"uri": "b.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }  # fmt: skip
    (tmp_path / "a.gltf").write_text(json.dumps(scene))
    told = ("import-terrain", tmp_path / "a.gltf", tmp_path / "a.json", "--max-error", 1)
    (tmp_path / "b.bin").write_bytes(numbers)
    assert run(*told).code == 0
    (tmp_path / "b.bin").unlink()
    os.mkfifo(tmp_path / "b.bin")
    ran = run(*told, "--overwrite")
    assert (ran.code, "it is a pipe" in ran.err) == (3, True)
    (tmp_path / "b.bin").unlink()
    (tmp_path / "b.bin").symlink_to("/dev/zero")
    assert run(*told, "--overwrite").code == 3


@pytest.mark.slow
def test_what_an_earlier_run_left_is_a_file(tmp_path: Path) -> None:
    """A folder that is written into may be a stranger's."""
    (tmp_path / "pybullet").mkdir()
    os.mkfifo(tmp_path / "pybullet" / MANIFEST)
    ran = run("export-sim", YARD, tmp_path, "--target", "pybullet", "--overwrite")
    assert ran.code == 3 and "was not written by terratool" in ran.err
    (tmp_path / "tiles").mkdir()
    os.mkfifo(tmp_path / "tiles" / JOURNAL)
    told = ("--tiles", tmp_path / "tiles", "--tile-size", 512, "--resolution", 1, "--overwrite")
    assert run("export-dem", YARD, *told).code == 3
