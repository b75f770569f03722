"""`terratool scan`: what it says, and what it refuses, before anything is written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.commands import ROOT, Ran, call, run
from tests.sensing.yard import YARD

LIDAR: dict[str, Any] = {
    "range": [0.1, 100],
    "lidar": {"elevations": [-20, 0], "azimuths": [0, 90], "azimuthStep": 90},
}
POSE = ("--pose", 110, 207, 1.7, 0, 0, 0)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a terrain and three sensors."""
    (tmp_path / "yard.json").write_text(json.dumps(YARD))
    (tmp_path / "lidar.json").write_text(json.dumps(LIDAR))
    camera = {"width": 4, "height": 3, "fov": 60}
    (tmp_path / "camera.json").write_text(json.dumps({"range": [0.1, 9], "camera": camera}))
    sonar = {"beamWidth": 10, "threshold": 1e-4, "sonarRefl": 1}
    (tmp_path / "sonar.json").write_text(json.dumps({"range": [0.1, 30], "sonar": sonar}))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def scan(*words: object, sensor: str = "lidar.json", out: str = "a.csv") -> Ran:
    return call("scan", "yard.json", out, "--sensor", sensor, *words)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.usefixtures("folder")
def test_what_was_read_is_said() -> None:
    """Readings, ranges, walls and surfaces, and what became of the other rays."""
    ran = scan(*POSE)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == (
        "a.csv: 4 readings of 4 rays in 1 turn\n"
        "  Ranges are from 3.509 to 18 m.\n"
        '  On walls 2. By surface: "snow" 2, "brick" 1, "steel" 1.\n'
    )
    ran = scan("--pose", 110, 207, 1.7, 180, 0, 0, out="b.csv")
    assert ran.out.endswith("  Without a reading: 2 out of the terrain.\n")


@pytest.mark.usefixtures("folder")
def test_what_was_read_as_json() -> None:
    """The same for scripts; surfaces whose reflection was assumed are named."""
    told = json.loads(scan(*POSE, "--json").out)
    assert told["statuses"] == {
        "return": 4, "near": 0, "far": 0, "void": 0, "outside": 0, "dropped": 0, "faint": 0,
    }  # fmt: skip
    assert told["surfaces"] == {"snow": 2, "brick": 1, "steel": 1}
    assert (told["rays"], told["frames"], told["walls"], told["sensor"]) == (4, 1, 2, "lidar")
    down = ("--pose", 110, 207, 2.5, 0, 90, 0)
    told = json.loads(scan(*down, "--json", sensor="sonar.json", out="s.csv").out)
    assert told["assumed_sonar_refl"] == ["snow"]
    assert told["range"][0] == pytest.approx(2, rel=1e-2)
    ran = scan(*down, sensor="sonar.json", out="t.csv")
    assert ran.out.endswith('  No sonarRefl: "snow". The sensor\'s stands in.\n')


def test_the_suffix_says_the_format(folder: Path) -> None:
    """In upper case, too."""
    assert scan(*POSE, out="A.PLY").code == 0
    assert (folder / "A.PLY").read_bytes().startswith(b"ply\n")
    assert scan(*POSE, out="a.rosbag2").code == 0
    assert names(folder / "a.rosbag2") == ["a.rosbag2.mcap", "metadata.yaml"]


def test_on_the_ground(folder: Path) -> None:
    """In place of z, which may be anything."""
    ran = scan("--pose", 110, 207, -50, 0, 0, 0, "--on-ground", 1.2, "--json")
    assert json.loads(ran.out)["range"][1] == pytest.approx(18)


def test_noise_by_its_seed(folder: Path) -> None:
    """The same bytes from the same seed, others from another, exact ones without."""
    noisy = {**LIDAR, "noise": {"sigma": 0.1}}
    (folder / "lidar.json").write_text(json.dumps(noisy))
    for name, words in (
        ("a", ("--seed", 1)),
        ("b", ("--seed", 1)),
        ("c", ("--seed", 2)),
        ("d", ()),
    ):
        assert scan(*POSE, *words, out=f"{name}.ply").code == 0
    a, b, c, d = ((folder / f"{name}.ply").read_bytes() for name in "abcd")
    assert a == b
    assert len({a, c, d}) == 3


PATHS = {
    "unordered": "x,y,z,time\n110,207,1.7,1\n111,207,1.7,0\n",
    "same": "x,y,z,time\n110,207,1.7,1\n111,207,1.7,1\n",
    "nan": "x,y,z\n110,nan,1.7\n",
    "long": "x,y,z,time\n110,207,1.7,0\n111,207,1.7,1e9\n",
    "into": "x,y,z,time\n110,207,1.7,0\n135,207,1.7,1\n",
}


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ((), 2, "Nothing says where the sensor is."),
        ((*POSE, "--poses", "unordered.csv"), 2, "Both --pose and --poses"),
        (("--pose", "nan", 207, 1.7, 0, 0, 0), 2, "The pose has nan for x."),
        (("--pose", 110, 207, 1.7, "inf", 0, 0), 2, "The pose has inf for yaw."),
        (("--pose", 110, 207, 0.25, 0, 0, 0), 2, "is 0.25 m below the ground at x 110, y 207."),
        (("--pose", 130, 207, 1.7, 0, 0, 0), 2, "is 1.8 m below the ground at x 130, y 207."),
        (("--pose", 99, 207, 1.7, 0, 0, 0), 2, "is outside of the terrain at x 99, y 207."),
        (("--pose", 575054.25, 4429710.125, 1.7, 0, 0, 0), 2, "at x 575054.25, y 4429710.125."),
        (("--pose", 134, 220, 1, 0, 0, 0, "--on-ground", 1), 2, "There is no ground at x 134"),
        ((*POSE, "--on-ground", -1), 2, "The height above the ground is -1."),
        ((*POSE, "--on-ground", "nan"), 2, "The height above the ground is nan."),
        ((*POSE, "--follow-slope"), 2, "Add --on-ground."),
        (("--poses", "unordered.csv"), 2, ":3: the time 0 does not come after 1."),
        (("--poses", "same.csv"), 2, ":3: the time 1 does not come after 1."),
        (("--poses", "nan.csv"), 2, ':2: y is "nan", which is no number'),
        (("--poses", "long.csv"), 2, "10,000,000,000 frames of 4 rays are 40,000,000,000 rays"),
        (("--poses", "into.csv"), 2, "The sensor is 1.8 m below the ground at x 135"),
        (("--poses", "none.csv"), 3, "none.csv: cannot be read"),
    ],
)
def test_poses_that_cannot_be(
    words: tuple[object, ...], code: int, said: str, folder: Path
) -> None:
    """A sentence that says what is wrong, one that says what to do, and nothing written."""
    (folder / "yard.json").write_text(json.dumps({**YARD, "elemTree": {
        **YARD["elemTree"], "children": [
            *YARD["elemTree"]["children"],
            {"at": [35, 8], "extent": [2, 6], "type": "flat", "vScale": 3},
        ],
    }}))  # fmt: skip
    for name, text in PATHS.items():
        (folder / f"{name}.csv").write_text(text)
    before = names(folder)
    ran = scan(*words, out="out.ply")
    assert ran.code == code, ran
    assert said in ran.err, ran.err
    assert names(folder) == before


def test_a_sensor_that_dives_between_two_poses(folder: Path) -> None:
    """Its poses are in order, but on the way from one to the other it is in the brick."""
    (folder / "p.csv").write_text("x,y,z,time\n110,207,1.7,0\n139,207,1.7,1\n")
    before = names(folder)
    ran = scan("--poses", "p.csv", out="out.rosbag2")
    assert ran.code == 2
    assert "below the ground at x 1" in ran.err
    assert names(folder) == before


def test_all_of_a_path_is_looked_at_first(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not a ray is cast for a path that leads into a wall after a while, or off the ground."""
    from terratool.field.terrain import Terrain

    def cast(*_: object) -> None:
        raise AssertionError("a ray")

    monkeypatch.setattr(Terrain, "cast", cast)
    (folder / "p.csv").write_text("x,y,z,time\n110,207,1.7,0\n139,207,1.7,100\n")
    ran = scan("--poses", "p.csv", out="out.ply")
    assert ran.code == 2
    # columns of the lidar fire at 0 and 0.025 s of each turn; x = 128 is at 62.069 s
    assert "is 1.8 m below the ground at x 128.009, y 207 at 62.1 s." in ran.err
    (folder / "q.csv").write_text("x,y,time\n134,210,0\n134,223,13\n")
    ran = scan("--poses", "q.csv", "--on-ground", 1, out="out.ply")
    assert ran.code == 2
    assert "There is no ground at x 134, y 218 at 8 s, only void." in ran.err
    assert not (folder / "out.ply").exists()


@pytest.mark.parametrize(
    ("text", "code", "said"),
    [
        ('{"range": [0.1, 9], "lidar": {"elevations": [], "azimuthStep": 1}}', 1, "TT105"),
        ('{"range": [0.1, 9]}', 1, "TT901"),
        ('{"range": [9, 0.1], "sonar": {"beamWidth": 9, "threshold": 1}}', 1, "TT902"),
        ('{"range": [0.1, 9], "camera": {"width": 16000, "height": 16000, "fov": 9}}', 1, "TT904"),
        ('{"range": [0.1', 1, "TT101"),
        ('{"size": 3, "elemTree": {}}', 1, "is a terrain, where a sensor is wanted."),
    ],
)
def test_sensors_that_are_none(text: str, code: int, said: str, folder: Path) -> None:
    """Sensors without beams, with too many rays, or that are something else."""
    (folder / "lidar.json").write_text(text)
    before = names(folder)
    ran = scan(*POSE, out="out.ply")
    assert ran.code == code
    assert said in ran.err
    assert names(folder) == before


@pytest.mark.parametrize(
    ("out", "words", "code", "said"),
    [
        ("out", (), 2, "out: has no suffix, which says no format."),
        ("out.xyz", (), 2, "out.xyz: ends with .xyz, which says no format."),
        ("out.png", (), 2, "is an image, and a lidar takes none."),
        ("out.las", ("--misses",), 2, ".las cannot hold rays without a reading."),
        ("out.rosbag2", ("--frame", "sensor"), 2, "has the sensor's axes anyway."),
        ("there/out.ply", (), 3, "does not exist"),
        ("yard.json", (), 3, "yard.json: is read, too"),
        ("old.ply", (), 3, "old.ply: exists already."),
        ("old.rosbag2", (), 3, "old.rosbag2: exists already."),
    ],
)
def test_outputs_that_cannot_be(
    out: str, words: tuple[object, ...], code: int, said: str, folder: Path
) -> None:
    """Before anything is read of the terrain."""
    (folder / "old.ply").write_text("mine")
    (folder / "old.rosbag2").mkdir()
    before = names(folder)
    ran = scan(*POSE, *words, out=out)
    assert ran.code == code, ran
    assert said in ran.err
    assert names(folder) == before
    assert (folder / "old.ply").read_text() == "mine"


@pytest.mark.parametrize(
    ("out", "module", "extra"),
    [("a.las", "laspy", "las"), ("a.laz", "lazrs", "las"), ("a.rosbag2", "rosbags", "ros")],
)
def test_what_is_not_installed_is_named(
    out: str, module: str, extra: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the command that installs it."""
    from terratool.sensing.formats import table

    found = table.find_spec
    monkeypatch.setattr(table, "find_spec", lambda name: None if name == module else found(name))
    ran = scan(*POSE, out=out)
    assert ran.code == 2
    assert module in ran.err
    assert f'"terratool[{extra}]"' in ran.err


def test_a_sensor_from_standard_input(folder: Path) -> None:
    """A dash stands for it."""
    ran = call("scan", "yard.json", "a.csv", "--sensor", "-", *POSE, stdin=json.dumps(LIDAR))
    assert ran.code == 0, ran.err


def test_help_has_the_example_of_the_epilog(tmp_path: Path) -> None:
    """It runs."""
    words = run("scan", "--help").out.split("Example: terratool ")[1].split()
    assert words[:3] == ["scan", "samples/warehouse.json", "cloud.ply"]
    words[2] = str(tmp_path / "cloud.ply")
    words[words.index("--sensor") + 1] = str(ROOT / words[words.index("--sensor") + 1])
    ran = run(*words)
    assert ran.code == 0
    assert "readings of 28,800 rays" in ran.out
