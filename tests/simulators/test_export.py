"""What all targets have in common: folders, manifests, and what is refused."""

from __future__ import annotations

import hashlib
import json
import math
import signal
import sys
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

import terratool
from terratool.simulators import nav2, targets
from terratool.simulators.export import export_simulators
from terratool.simulators.options import SceneOptions
from terratool.simulators.targets import TARGETS
from tests.commands import ROOT, SAMPLE, YARD
from tests.commands import call as run
from tests.commands import run as run_apart


def write(folder: Path, definition: dict) -> str:
    path = folder / "yard.json"
    path.write_text(json.dumps(definition), "utf-8")
    return str(path)


HUSKY = ROOT / "samples" / "vehicles" / "husky-a200.json"
SURFACES = {
    "sand": {"fricAngle": [20, 30]},
    "hole": {"void": True},
    "wet, grey": {"preset": "concrete"},
}


@pytest.fixture
def yard(tmp_path: Path) -> str:
    return write(tmp_path, {**YARD, "surfTypes": SURFACES})


def manifest_of(folder: Path) -> dict:
    return json.loads((folder / "manifest.json").read_text("utf-8"))


def test_manifest(yard: str, tmp_path: Path) -> None:
    """It has the friction of each surface and why, where zero is, and hashes of all files."""
    ran = run("export-sim", yard, str(tmp_path / "o"), "--target", "mujoco", "--target", "pybullet",
              "--origin", "center")  # fmt: skip
    assert ran.code == 0, ran.err
    for target in ("mujoco", "pybullet"):
        folder = tmp_path / "o" / target
        manifest = manifest_of(folder)
        assert manifest["target"] == target
        assert manifest["origin"] == [0, 0, 0]
        assert manifest["bounds"] == [-5, -5, 5, 5]
        assert manifest["max_error"] == 0.002
        frictions = {name: one["friction"] for name, one in manifest["surfaces"].items()}
        assert frictions == {
            "sand": pytest.approx(math.tan(math.radians(25))),
            "wet, grey": pytest.approx(0.75, abs=0.01),
        }
        assert "the middle of fricAngle 20° to 30°" in manifest["surfaces"]["sand"]["derived"]
        assert "preset concrete" in manifest["surfaces"]["wet, grey"]["derived"]
        assert manifest["source"]["sha256"] == hashlib.sha256(Path(yard).read_bytes()).hexdigest()
        files = {
            path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in folder.rglob("*")
            if path.is_file() and path.name not in ("README.md", "manifest.json")
        }
        assert manifest["files"] == files
        for line in manifest["losses"]:
            assert line in (folder / "README.md").read_text("utf-8")
            assert line in ran.out


def test_manifest_has_hashes_of_libraries(tmp_path: Path) -> None:
    """Of each by its place beside the definition, as a terrain changes with them."""
    (tmp_path / "kit").mkdir()
    library = tmp_path / "kit" / "soils.json"
    library.write_text(json.dumps({"surfTypes": SURFACES}), "utf-8")
    own = {key: value for key, value in YARD.items() if key != "surfTypes"}
    file = write(tmp_path, {**own, "use": ["kit/soils.json"]})
    ran = run("export-sim", file, str(tmp_path / "o"), "--target", "nav2")
    assert ran.code == 0, ran.err
    hashes = manifest_of(tmp_path / "o" / "nav2")["source"]["libraries"]
    assert hashes == {"kit/soils.json": hashlib.sha256(library.read_bytes()).hexdigest()}


def test_assumed_friction_is_said(tmp_path: Path) -> None:
    file = write(tmp_path, YARD)
    ran = run("export-sim", file, str(tmp_path / "o"), "--target", "mujoco", "--friction", "0.4")
    assert "Friction 0.4 is assumed, as there is no fricAngle: sand, wet, grey." in ran.out


def test_what_is_lost_of_what_is_seen_is_not_what_collides(tmp_path: Path) -> None:
    """The mesh of the yard is exact; what collides is not, and is named right after it."""
    ran = run("export-sim", write(tmp_path, YARD), str(tmp_path / "o"), "--target", "mujoco",
              "--target", "pybullet")  # fmt: skip
    assert ran.code == 0, ran.err
    losses = [manifest_of(tmp_path / "o" / name)["losses"] for name in ("mujoco", "pybullet")]
    assert losses[0][1] == "Lost of the mesh, which is only seen: nothing."
    assert losses[0][2].startswith("What collides: solids are up to 0.002 m off the terrain")
    assert losses[1][1] == "Lost: nothing."


BARE = {key: value for key, value in YARD["elemTree"].items() if key != "surface"}
ROUND = {**YARD["elemTree"], "type": "dome", "children": []}
TYPES = {**YARD["elemTypes"], "dome": {"x": "dome", "combine": "radial"}}
RUT = {"path": [[-4, -4], [4, -4]], "width": 0.3, "depth": 0.1, "surface": "sand"}


@pytest.mark.parametrize(
    ("more", "names"),
    [
        ({}, ["sand", "wet, grey"]),
        ({"elemTree": BARE}, ["wet, grey", "none"]),
        ({"elemTree": BARE, "tracks": [RUT]}, ["sand", "wet, grey", "none"]),
        ({"elemTree": ROUND, "elemTypes": TYPES}, ["sand", "none"]),
        ({"elemTree": {**ROUND, "type": "flat", "turnDeg": 20}}, ["sand", "none"]),
        ({"elemTree": {**ROUND, "type": "flat", "turnDeg": 90}}, ["sand"]),
    ],
)
def test_all_targets_state_the_same_surfaces(more: dict, names: list[str], tmp_path: Path) -> None:
    """With a mesh or without one: those of elements and tracks, and ground that has none."""
    file = write(tmp_path, {**YARD, "surfTypes": SURFACES, **more})
    targets = ("pybullet", "nav2", "grid-map")
    chosen = [word for target in targets for word in ("--target", target)]
    ran = run("export-sim", file, str(tmp_path / "o"), *chosen, "--friction", "0.4")
    assert ran.code == 0, ran.err
    for target in targets:
        manifest = manifest_of(tmp_path / "o" / target)
        assert list(manifest["surfaces"]) == names, target
        assert ("none" in names) == (manifest["surfaces"].get("none", {}).get("friction") == 0.4)
        assumed = [line for line in manifest["losses"] if "is assumed" in line]
        wanted = "Friction 0.4 is assumed, as there is no fricAngle: none."
        # the map for Nav2 has nothing of friction
        assert assumed == [wanted] * ("none" in names and target != "nav2")
        readme = (tmp_path / "o" / target / "README.md").read_text("utf-8")
        rows = [line.split(" | ")[0][2:] for line in readme.splitlines() if line[:2] == "| "]
        assert rows == ([] if target == "nav2" else ["surface", *names])
        # nor is there a mesh within an error in those of cells
        assert manifest["max_error"] == (0.002 if target == "pybullet" else None)


@pytest.mark.parametrize(
    ("origin", "zero"),
    [
        ("--origin local", [-5, -5, 0]), ("--origin world", [0, 0, 0]),
        ("--origin-at 1 -2.5 3", [1, -2.5, 3]),
    ],
)  # fmt: skip
def test_origins(origin: str, zero: list[float], yard: str, tmp_path: Path) -> None:
    ran = run("export-sim", yard, str(tmp_path / "o"), "--target", "nav2", *origin.split())
    assert ran.code == 0, ran.err
    assert manifest_of(tmp_path / "o" / "nav2")["origin"] == zero


@pytest.mark.nightly
def test_the_same_bytes_in_another_process(tmp_path: Path) -> None:
    """Whatever the order of sets, the zone of the clock, and the folders; for all targets."""
    for needed in ("pxr", "rosbags"):
        pytest.importorskip(needed, reason=f"{needed} is not installed")
    soil = {"fricAngle": 30, "cohesion": 1, "sinkage": 0}
    definition = {**YARD, "surfTypes": {**SURFACES, "sand": soil}}
    found = []
    for seed, zone in (("0", "UTC"), ("1", "Asia/Tokyo")):
        place = tmp_path / seed
        place.mkdir()
        file = write(place, definition)
        ran = run_apart("export-sim", file, place / "o", "--target", "all", "--vehicle", HUSKY,
                        PYTHONHASHSEED=seed, TZ=zone)  # fmt: skip
        assert ran.code == 0, ran.err
        found.append(contents(place / "o"))
    assert set(TARGETS) <= set(found[0])
    assert found[0] == found[1]


def test_overwriting(yard: str, tmp_path: Path) -> None:
    """What an earlier run has written goes; what others have put beside it stays."""
    arguments = ["export-sim", yard, str(tmp_path / "o"), "--target", "mujoco"]
    folder = tmp_path / "o" / "mujoco"
    assert run(*arguments).code == 0
    (folder / "robot.xml").write_text("mine", "utf-8")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    again = run(*arguments)
    assert again.code == 3
    assert "exists already" in again.err
    assert run(*arguments, "--overwrite").code == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert run(*arguments, "--overwrite", "--flex").code == 0
    assert "robot.xml" in {path.name for path in folder.iterdir()}
    assert set(manifest_of(folder)["files"]) == {
        path.name for path in folder.iterdir()
    } - {"robot.xml", "README.md", "manifest.json"}  # fmt: skip


def test_folders_of_others_are_kept(yard: str, tmp_path: Path) -> None:
    place = tmp_path / "o" / "mujoco"
    place.mkdir(parents=True)
    (place / "precious.txt").write_text("mine", "utf-8")
    for more in ([], ["--overwrite"]):
        ran = run("export-sim", yard, str(tmp_path / "o"), "--target", "mujoco", *more)
        assert ran.code == 3
        assert "was not written by terratool" in ran.err
        assert "--overwrite" not in ran.err
    assert [path.name for path in place.iterdir()] == ["precious.txt"]


def test_an_empty_folder_name_is_refused(yard: str) -> None:
    """As of a variable that is not set: nothing is written where one stands."""
    ran = run("export-sim", yard, "", "--target", "pybullet")
    assert ran.code == 2
    assert "OUT is empty" in ran.err
    assert not (ROOT / "pybullet").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ([], 2, "with --target: mujoco, gazebo, pybullet, usd, chrono, nav2, grid-map, or all."),
        (["--target", "unity"], 2, 'There is no target "unity"'),
        (["--target", "unity"], 2, "Choose from mujoco, gazebo,"),
        (["--target", "mujco"], 2, "Did you mean mujoco?"),
        (["--target", "MuJoCo"], 2, "Did you mean mujoco?"),
        (["--target", "grid_map"], 2, "Did you mean grid-map?"),
        (["--target", "mujoco", "--target", "al"], 2, "Did you mean all?"),
        (["--target", "usd,nav2"], 2, "Name each by itself: --target usd --target nav2."),
        (["--target", "usd, gazbo"], 2, "Name each by itself: --target usd --target gazebo."),
        (["--target", "usd,unity"], 2, "Choose from mujoco, gazebo,"),
        (["--target", ","], 2, "Choose from mujoco, gazebo,"),
        (["--target", "mujoco", "--max-error", "0"], 2, "The largest error is 0"),
        (["--target", "mujoco", "--max-error", "nan"], 2, "The largest error is nan"),
        (["--target", "mujoco", "--max-error", "inf"], 2, "Give a finite height above 0"),
        (["--target", "nav2", "--max-slope", "90"], 2, "Give degrees above 0 and below 90."),
        (["--target", "mujoco", "--origin", "here"], 2, "'here' is not one of"),
        (["--target", "mujoco", "--origin-at", "1", "2"], 2, "takes 3 numbers, X Y Z, not 2."),
        (["--target", "mujoco", "--origin-at", "1", "2", "inf"], 2, "inf is no finite number"),
        (
            ["--target", "usd", "--origin", "world", "--origin-at", "1", "2", "3"],
            2,
            "--origin and --origin-at exclude each other.",
        ),
        (["--target", "mujoco", "--friction", "-1"], 2, "The assumed friction is -1"),
        (["--target", "mujoco", "--max-geoms", "0"], 2, "At most 0 geoms are allowed"),
        (["--target", "nav2", "--max-step", "-1"], 2, "step"),
        (["--target", "all", "--vehicle", "not-there.json"], 3, "not-there.json"),
        (["--target", "all", "--vehicle", SAMPLE], 1, "is a terrain, where a vehicle is wanted"),
    ],
)
def test_nonsense_is_refused(arguments: list[str], code: int, words: str, tmp_path: Path) -> None:
    """In a sentence, before the definition is read, which is not there; nothing is written."""
    ran = run("export-sim", str(tmp_path / "yard.json"), str(tmp_path / "o"), *arguments)
    assert (ran.code, ran.out) == (code, "")
    assert words in ran.err
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("wanted", "missing", "what", "hint"),
    [
        (
            "all", ("rosbags",), "rosbags for grid-map",
            "Choose the others (--target mujoco --target gazebo --target pybullet --target usd "
            '--target chrono --target nav2), or run PYTHON -m pip install "terratool[ros]"',
        ),
        (
            "all", ("rosbags", "pxr"), "usd-core for usd and rosbags for grid-map",
            "Choose the others (--target mujoco --target gazebo --target pybullet --target chrono "
            '--target nav2), or run PYTHON -m pip install "terratool[usd,ros]"',
        ),
        (
            "usd", ("pxr",), "usd-core for usd", 'Run PYTHON -m pip install "terratool[usd]"',
        ),
    ],
)  # fmt: skip
def test_what_is_not_installed(
    wanted: str, missing: tuple[str, ...], what: str, hint: str, tmp_path: Path
) -> None:
    """It is named before the definition is read, which is none, but after one that is missing."""
    (tmp_path / "yard.json").write_text("no JSON")
    with (
        patch.object(targets, "find_spec", lambda name: None if name in missing else name),
        patch.object(sys, "executable", "PYTHON"),
    ):
        ran = run("export-sim", tmp_path / "yard.json", tmp_path / "o", "--target", wanted)
        lost = run("export-sim", tmp_path / "lost.json", tmp_path / "o", "--target", wanted)
    assert (ran.code, ran.err) == (2, f"terratool: Not installed: {what}.\n  {hint}\n")
    assert lost.code == 3
    assert f"{tmp_path / 'lost.json'}: cannot be read (no such file" in lost.err
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("arguments", "wrong", "hint"),
    [
        (
            "gazebo --max-geoms 2000",
            "--max-geoms is about mujoco, but the target is gazebo.",
            "Leave it out, or add --target mujoco.",
        ),
        (
            "gazebo --target nav2 --flex",
            "--flex is about mujoco, but the targets are gazebo and nav2.",
            "Leave it out, or add --target mujoco.",
        ),
        (
            "mujoco --heightmap",
            "--heightmap is about gazebo, but the target is mujoco.",
            "Leave it out, or add --target gazebo.",
        ),
        (
            "mujoco --vehicle not-there.json",
            "--vehicle is about nav2 and grid-map, but the target is mujoco.",
            "Leave it out, or add --target nav2 or --target grid-map.",
        ),
        (
            "chrono --resolution 0.1",
            "--resolution is about nav2 and grid-map, but the target is chrono.",
            "Leave it out, or add --target nav2 or --target grid-map.",
        ),
        (
            "usd --max-slope 20",
            "--max-slope is about nav2, but the target is usd.",
            "Leave it out, or add --target nav2.",
        ),
        (
            "pybullet --max-step 0.1",
            "--max-step is about nav2, but the target is pybullet.",
            "Leave it out, or add --target nav2.",
        ),
        (
            f"nav2 --vehicle {HUSKY} --max-slope 20",
            "--max-slope has no effect with --vehicle.",
            "Leave out --max-slope or --vehicle.",
        ),
        (
            f"all --max-step 0.1 --vehicle {HUSKY}",
            "--max-step has no effect with --vehicle.",
            "Leave out --max-step or --vehicle.",
        ),
        (
            "mujoco --flex --max-geoms 2000",
            "--max-geoms has no effect with --flex.",
            "Leave out --max-geoms or --flex.",
        ),
    ],
)
def test_options_without_effect_are_refused(
    arguments: str, wrong: str, hint: str, yard: str, tmp_path: Path
) -> None:
    """Also where they say what is the default anyway."""
    ran = run("export-sim", yard, tmp_path / "o", "--target", *arguments.split())
    assert (ran.code, ran.out, ran.err) == (2, "", f"terratool: {wrong}\n  {hint}\n")
    assert not (tmp_path / "o").exists()


def test_all_targets_take_all_options(yard: str, tmp_path: Path) -> None:
    """A --target further on counts; so does "all", which gets as far as what is missing."""
    more = ["--max-geoms", "9", "--heightmap", "--max-slope", "9", "--resolution", "1"]
    several = ["--target", "nav2", "--target", "gazebo", "--target", "mujoco"]
    for chosen in (several, ["--target", "all"]):
        ran = run("export-sim", yard, tmp_path / "no" / "o", *more, *chosen)
        assert ran.code == 3
        assert "does not exist" in ran.err


def test_as_json(yard: str, tmp_path: Path) -> None:
    """It has the folder of each target, and from its manifest what it is and what is lost."""
    chosen = ("--target", "pybullet", "--target", "nav2")
    ran = run("export-sim", yard, tmp_path / "o", *chosen, "--json")
    assert ran.code == 0, ran.err
    told = json.loads(ran.out)
    assert list(told["targets"]) == ["pybullet", "nav2"]
    for target, one in told["targets"].items():
        manifest = manifest_of(tmp_path / "o" / target)
        assert one == {
            "folder": str(tmp_path / "o" / target),
            "summary": manifest["summary"],
            "losses": manifest["losses"],
        }
        assert one["losses"]


def test_one_of_a_kind_is_said_so(tmp_path: Path) -> None:
    """A box that is a level yard, of one surface."""
    yard = {
        "size": [4, 3],
        "surfTypes": {"sand": {"fricAngle": 30}},
        "elemTypes": {"flat": {"x": [1]}},
        "elemTree": {"type": "flat", "surface": "sand", "vScale": 1},
    }
    targets = ("--target", "mujoco", "--target", "pybullet")
    ran = run("export-sim", write(tmp_path, yard), tmp_path / "o", *targets)
    assert "1 geom to collide with: 1 box, 0 convex meshes, 0 height fields\n" in ran.out
    assert "1 link, seen as 2 faces; 1 box to collide with\n" in ran.out
    flexes = run("export-sim", write(tmp_path, yard), tmp_path / "f", *targets[:2], "--flex")
    assert "2 faces to collide with, in 1 rigid flex\n" in flexes.out


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else b""
        for path in folder.rglob("*")
    }


def code_of(*arguments: object) -> object:
    """What a command ends with that a signal may stop."""
    try:
        return run(*arguments).code
    except SystemExit as stop:
        return stop.code


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_nothing_half_written(
    number: signal.Signals, yard: str, tmp_path: Path
) -> None:
    """Neither a target nor a temporary folder; what was there is as it was."""
    out = tmp_path / "o"
    arguments = ["export-sim", yard, out, "--target", "nav2"]

    def interrupted(_scene: object, folder: Path) -> None:
        (folder / "map.pgm").write_text("half")
        signal.raise_signal(number)

    with patch.object(nav2, "write", interrupted):
        assert code_of(*arguments) == 128 + number
        assert not out.exists()
        assert code_of(*arguments, "--target", "pybullet") == 128 + number
    assert [path.name for path in out.iterdir()] == ["pybullet"]
    assert run(*arguments).code == 0
    before = contents(out)
    with patch.object(nav2, "write", interrupted):
        assert code_of(*arguments, "--overwrite") == 128 + number
    assert contents(out) == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_files_of_a_target_change_together(
    number: signal.Signals, yard: str, tmp_path: Path
) -> None:
    """A signal while files take the places of earlier ones waits for the last."""
    arguments = ["export-sim", yard, "--target", "mujoco", "--overwrite", "--max-error"]
    for name, error in (("o", 0.5), ("new", 0.01)):
        assert run(*arguments, error, tmp_path / name).code == 0

    def replace(one: Path, other: Path) -> None:
        one.rename(other)
        signal.raise_signal(number)

    with patch.object(Path, "replace", replace):
        assert code_of(*arguments, 0.01, tmp_path / "o") == 128 + number
    assert contents(tmp_path / "o") == contents(tmp_path / "new")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nav2", "--resolution", "1e-5"], "makes more than 268,435,456 cells"),
        (["grid-map", "--resolution", "1e-3"], "a message of"),
        (["nav2", "--resolution", "9", "--vehicle", HUSKY], "is too coarse for wheels"),
        (["grid-map", "--resolution", "9", "--vehicle", HUSKY], "is too coarse for wheels"),
        (["nav2", "--resolution", "10.1"], "are larger than the terrain, of 10 × 10"),
        (["grid-map", "--resolution", "10.1"], "are larger than the terrain, of 10 × 10"),
    ],
)
def test_impossible_maps_are_refused_before_other_targets_are_written(
    arguments: list[str], words: str, yard: str, tmp_path: Path
) -> None:
    ran = run("export-sim", yard, tmp_path / "o", "--target", "pybullet", "--target", *arguments)
    assert ran.code == 2
    assert words in ran.err
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("wanted", ["nav2", ["nav2"], (name for name in ["nav2"])])
def test_targets_are_a_name_or_names(wanted: Any, yard: str, tmp_path: Path) -> None:
    [report] = export_simulators(terratool.load(yard), str(tmp_path / "o"), wanted)
    assert report.folder == tmp_path / "o" / "nav2"


def test_no_folder_for_the_folder(yard: str, tmp_path: Path) -> None:
    parent = tmp_path / "a b"
    ran = run("export-sim", yard, parent / "c", "--target", "mujoco")
    wrong = f"{parent / 'c'}: the folder {parent} does not exist."
    hint = f"Create it first: mkdir -p '{parent}'"
    assert (ran.code, ran.err) == (3, f"terratool: {wrong}\n  {hint}\n")


def test_a_manifest_of_others_removes_nothing_outside(tmp_path: Path) -> None:
    """Names that lead out of the folder, or to it by a link, are not files of an earlier run."""
    terrain = terratool.load("samples/sandy-cove.json")
    options = SceneOptions(max_error=0.1)
    export_simulators(terrain, tmp_path / "out", "mujoco", options)
    victims = [tmp_path / "victim.txt", tmp_path / "out" / "near.txt", tmp_path / "far.txt"]
    for victim in victims:
        victim.write_text("keep me")
    place = tmp_path / "out" / "mujoco"
    (place / "link").symlink_to(tmp_path)
    path = place / "manifest.json"
    manifest = json.loads(path.read_text("utf-8"))
    names = ["../../victim.txt", "../near.txt", str(victims[2]), "link/far.txt"]
    manifest["files"].update(dict.fromkeys(names, "0"))
    path.write_text(json.dumps(manifest), "utf-8")
    export_simulators(terrain, tmp_path / "out", "mujoco", options, overwrite=True)
    assert all(victim.read_text() == "keep me" for victim in victims)
