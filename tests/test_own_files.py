"""What is written again replaces its own files alone, and nothing that a link leads to."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from terratool.output import whole_folder
from terratool.raster.journal import NAME as JOURNAL
from tests.commands import ROOT, Ran, call
from tests.test_inert import site

pytestmark = pytest.mark.skipif(os.name == "nt", reason="links are for administrators there")

SAMPLES = ROOT / "samples"
HUSKY, WARTHOG = (str(SAMPLES / f"vehicles/{name}.json") for name in ("husky-a200", "warthog"))
CAMERA, LIDAR = (
    str(SAMPLES / f"sensors/{name}.json") for name in ("realsense-d435", "velodyne-vlp-16")
)
POSES = ["--pose", 1, 1, 1, 0, 80, 0, "--pose", 2, 1, 1, 0, 80, 0]
LAYERS = ["--layer", "height", "--layer", "surface", "--layer", "color", "--resolution", 0.05]

TILES = ["--tiles", "out", "--tile-size", 512]

COMMANDS: dict[str, tuple[str, list[Any]]] = {
    "raster tiles": ("out", ["export-dem", "s.json", *TILES, *LAYERS]),
    "layers": ("a.tif", ["export-dem", "s.json", "out/a.tif", *LAYERS]),
    "image": ("a.png", ["export-dem", "s.json", "out/a.png", "--layer", "surface"]),
    "mesh tiles": ("out", ["export-mesh", "s.json", "out.obj", "--tile-faces", 6]),
    "mesh": ("a.obj", ["export-mesh", "s.json", "out/a.obj", "--max-error", 0.5]),
    "images": ("a.png", ["scan", "s.json", "out/a.png", "--sensor", CAMERA, *POSES]),
    "bag": ("out", ["scan", "s.json", "out.rosbag2", "--sensor", LIDAR, *POSES]),
    "curriculum": ("a.json", ["curriculum", SAMPLES / "curricula/rough.json", "out/a.json"]),
    "verdicts": ("a.tif", ["traversability", "s.json", "--vehicle", HUSKY, "--headings", 4,
                           "--resolution", 0.5, "--map", "out/a.tif"]),
    "several": ("", ["traversability", "s.json", "--vehicle", HUSKY, "--vehicle", WARTHOG,
                     "--headings", 4, "--resolution", 0.5, "--map", "out/a.tif"]),
    "map": ("a.tif", ["map", "c.npz", "out/a.tif", "--resolution", 0.5]),
    "map bag": ("out", ["map", "c.npz", "--resolution", 0.5, "--output", "m.tif", "--bag", "out"]),
    **{
        target: ("", ["export-sim", "s.json", "out", "--target", target])
        for target in ("mujoco", "gazebo", "pybullet", "usd", "chrono", "nav2", "grid-map")
    },
}  # fmt: skip
"""Words of a command that writes several files, and which of them it is told by name."""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder that one works in; beside it is one with what stays as it is."""
    (tmp_path / "here/out").mkdir(parents=True)
    (tmp_path / "victim").mkdir()
    (tmp_path / "victim/v").write_text("mine")
    monkeypatch.chdir(tmp_path / "here")
    Path("s.json").write_text(json.dumps(site("rock")))
    yield tmp_path / "here"
    assert {path.name: path.read_text() for path in (tmp_path / "victim").iterdir()} == {
        "v": "mine"
    }


def run(key: str, *more: object) -> Ran:
    words = COMMANDS[key][1]
    if words[0] == "map" and not Path("c.npz").exists():
        scan = ("scan", "s.json", "c.npz", "--sensor", LIDAR, *POSES[:7])
        assert call(*scan).code == 0
    return call(*words, *more)


def folder(key: str) -> Path:
    """The folder that a command writes into, or makes; away with it first."""
    out = Path("out.rosbag2" if key == "bag" else "out")
    makes = COMMANDS[key][0] == "out" or COMMANDS[key][1][0] == "export-sim"
    for one in (Path("out"), out):
        shutil.rmtree(one, ignore_errors=True)
    for file in Path().glob("m*.tif"):
        file.unlink()
    if not makes:
        out.mkdir()
    return out


def names(out: Path) -> list[str]:
    return sorted(path.relative_to(out).as_posix() for path in out.rglob("*"))


@pytest.mark.slow
@pytest.mark.parametrize("key", COMMANDS)
def test_no_link_is_written_through(key: str, here: Path) -> None:
    """In place of each file and folder: it is replaced itself, or refused; the rest is whole."""
    out = folder(key)
    ran = run(key)
    assert ran.code in (0, 1), ran.err
    before = names(out)
    assert len(before) > 1
    for name in before:
        if name == COMMANDS[key][0]:
            continue  # behind a link that the user names stands what is meant
        for target in ("v", "none"):
            out = folder(key)
            assert run(key).code in (0, 1)
            was_folder = (out / name).is_dir()
            shutil.rmtree(out / name) if was_folder else (out / name).unlink()
            up = "../" * (len(Path(name).parts) + len(out.parts))
            (out / name).symlink_to(f"{up}victim{'' if was_folder else f'/{target}'}")
            ran = run(key, "--overwrite")
            assert ran.code in (0, 1, 3), ran.err
            if ran.code == 3:
                assert "Traceback" not in ran.err and str(out) in ran.err
                assert (out / name).is_symlink()
                kept = [one for one in before if not one.startswith(f"{name}/")]
                assert names(out) == kept
            else:
                assert not (out / name).is_symlink()
                assert names(out) == before
    # a link to nothing is in the way, too
    for name in before:
        if name == COMMANDS[key][0] or "/" in name or out.name == name:
            continue
        out = folder(key)
        out.mkdir(exist_ok=True)
        (out / name).symlink_to("../../victim/none")
        ran = run(key)
        assert ran.code == 3, (name, ran)
        assert (out / name).is_symlink()


@pytest.mark.parametrize("strange", ["file", "folder", "link", "hidden", "its own name", "data"])
@pytest.mark.parametrize("key", ["bag", "map bag"])
def test_a_folder_with_files_of_others_is_no_bag(key: str, strange: str, here: Path) -> None:
    """--overwrite replaces a bag whose files are all its own, and says what else is there."""
    out = folder(key)
    assert run(key).code == 0
    assert run(key).code == 3
    before = names(out)
    assert before == ["metadata.yaml", f"{out.name}.mcap"]
    assert run(key, "--overwrite").code == 0
    name = {"hidden": ".notes", "data": "field.mcap"}.get(strange, "notes.txt")
    if strange == "its own name":
        name = before[1]
        (out / name).unlink()
    if strange in ("folder", "its own name"):
        (out / name).mkdir()
        (out / name / "mine").write_text("mine")
    elif strange == "link":
        (out / name).symlink_to("../../victim")
    else:
        (out / name).write_text("mine")
    before = names(out)
    data = (out / "metadata.yaml").read_bytes()
    ran = run(key, "--overwrite")
    assert ran.code == 3
    assert f"{out}: holds {name}, which terratool did not write." in ran.err
    assert names(out) == before and (out / "metadata.yaml").read_bytes() == data
    assert not [path for path in here.iterdir() if path.name.startswith(".terratool-")]


def test_what_comes_into_a_bag_meanwhile_is_kept(here: Path) -> None:
    """It is looked at once more, in the moment in which it is replaced."""
    own = ("a", "b")
    for name in own:
        (here / "out" / name).write_text("old")
    with pytest.raises(Exception, match="holds c, which terratool did not write"):  # noqa: SIM117
        with whole_folder(here / "out", overwrite=True, own=own) as part:
            part.mkdir()
            for name in own:
                (part / name).write_text("new")
            (here / "out/c").write_text("mine")
    assert {path.name: path.read_text() for path in (here / "out").iterdir()} == {
        "a": "old", "b": "old", "c": "mine",
    }  # fmt: skip


@pytest.mark.parametrize("target", ["pybullet", "nav2", "grid-map"])
def test_files_of_others_in_a_folder_of_a_simulator(target: str, here: Path) -> None:
    """They stay; where one has a name that is to be written, nothing is."""
    folder(target)
    assert run(target).code == 0
    out = here / "out" / target
    (out / "notes.txt").write_text("mine")
    assert run(target, "--overwrite").code == 0
    assert (out / "notes.txt").read_text() == "mine"
    manifest = json.loads((out / "manifest.json").read_text())
    for claim in ("0" * 64, None, hashlib.sha256(b"theirs").hexdigest()):
        claimed = {**manifest, "files": {**manifest["files"], "notes.txt": claim}}
        (out / "manifest.json").write_text(json.dumps(claimed))
        assert run(target, "--overwrite").code == 0
        assert (out / "notes.txt").read_text() == "mine"
    earlier = {**manifest["files"], "notes.txt": hashlib.sha256(b"mine").hexdigest()}
    (out / "manifest.json").write_text(json.dumps({**manifest, "files": earlier}))
    assert run(target, "--overwrite").code == 0
    assert not (out / "notes.txt").exists()  # as if an earlier version had written it
    name = next(iter(manifest["files"]))
    del manifest["files"][name]  # as if an earlier version had not written it
    (out / "manifest.json").write_text(json.dumps(manifest))
    (out / name).write_text("mine")
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    ran = run(target, "--overwrite")
    assert ran.code == 3
    assert f"{name}: is in the way, and was not written by terratool." in ran.err
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_a_journal_of_others_has_nothing_removed(here: Path) -> None:
    """An index elsewhere goes only if it is one of these tiles, whatever the journal says."""
    from hashlib import blake2b

    from terratool.raster.journal import _line_of

    words = ("export-dem", "s.json", "--tiles", "out", "--resolution", 1)
    call("export-dem", "s.json", "--tiles", "other", "--resolution", 1)
    assert call(*words).code == 0
    names = ["../../victim/v", "../s.json", "notes", "../other/mosaic.vrt", "../link.vrt"]
    (here / "out/notes").write_text("mine")
    (here / "link.vrt").symlink_to("out/mosaic.vrt")
    before = {}
    with (here / "out" / JOURNAL).open("ab") as file:
        for name in names:
            before[name] = (here / "out" / name).read_bytes()
            known = blake2b(before[name], digest_size=16).hexdigest()
            file.write(_line_of({"index": name, "checksum": known}))
    assert call(*words, "--overwrite").code == 0
    assert {name: (here / "out" / name).read_bytes() for name in names} == before
    # one that is of these tiles goes with them
    assert call("export-dem", "s.json", "i.vrt", *words[2:], "--overwrite").code == 0
    assert call(*words, "--overwrite").code == 0
    assert not (here / "i.vrt").exists()
