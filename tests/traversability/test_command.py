"""`terratool traversability` as a user runs it: what it says, writes and refuses."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import rasterio
import shapely.geometry
import shapely.ops
from rio_cogeo.cogeo import cog_validate

import terratool
from terratool.cli.terminal import StatusLine
from terratool.cli.traversability import MODELS, PREFERENCES
from terratool.errors import WriteError
from terratool.field.terrain import Terrain, load
from terratool.raster.grid import Window
from terratool.traversability import preparing
from terratool.traversability import vehicle as vehicles
from terratool.traversability.assess import assess
from terratool.traversability.blocked import first_look
from terratool.traversability.conditions import FIGURES, WORDS
from terratool.traversability.map_results import cell_of
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.report import formats
from terratool.traversability.report.document import as_dict
from terratool.traversability.report.wording import conclusion
from terratool.traversability.request import Request
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route import graph
from terratool.traversability.route import routes as routing
from terratool.traversability.survey import Surveyor
from terratool.traversability.tiles import part_of
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.vehicle_files import load_vehicle
from terratool.traversability.verdicts import GroundClass, Verdict
from tests.commands import COMMAND, ENVIRONMENT, ROOT, call, run
from tests.conftest import terrain_of

# Hard ground, 12 × 8 around (100, 50): a wall 1 high from south to north at x = 106 leaves a gate
# at the north; a hole in the south-east.
WALLED: dict[str, Any] = {
    "descr": "a wall & a gate",
    "size": [12, 8],
    "origin": [100, 50],
    "surfTypes": {
        "floor": {"cohesion": 0, "fricAngle": 35, "sinkage": 0},
        "<brick>": {"cohesion": 0, "fricAngle": 35, "sinkage": 0},
        "hole": {"void": True},
    },
    "elemTypes": {"flat": {"x": [0]}, "box": {"x": [1]}},
    "elemTree": {
        "type": "flat", "surface": "floor", "vScale": 1, "cells": [12, 8],
        "children": [
            {"type": "box", "surface": "<brick>", "cellX": 6, "cellY": 0, "span": [1, 6],
             "vScale": 1},
            {"type": "flat", "surface": "hole", "cellX": 11, "cellY": 0, "vScale": 1},
        ],
    },
}  # fmt: skip
CLOSED = json.loads(json.dumps(WALLED).replace("[1, 6]", "[1, 8]"))
VEHICLE: dict[str, Any] = {
    "mass": 50,
    "wheels": {"radius": 0.16, "width": 0.1},
    "wheelbase": 0.5,
    "track": 0.5,
    "cog": {"height": 0.2},
    "clearance": 0.13,
}
WAY = (102, 51, 110, 52)
SCHEMA = jsonschema.Draft202012Validator(terratool.schema("report"))

Saved = Callable[..., Path]


drive = partial(call, "traversability")


@pytest.fixture
def site(saved: Saved) -> tuple[str, ...]:
    """A terrain with a way through, a vehicle, and pixels that are quickly made."""
    vehicle = saved(VEHICLE, "vehicle.json")
    return str(saved(WALLED)), "--vehicle", str(vehicle), "--resolution", "0.1"


@pytest.mark.nightly
def test_says_and_writes_all(site: tuple[str, ...], tmp_path: Path) -> None:
    """The table, three reports and a map from one run; the same bytes from the next."""
    names = [tmp_path / name for name in ("a.json", "a.md", "a.html", "a.tif")]
    outputs = [*(part for name in names[:3] for part in ("--report", name)), "--map", names[3]]
    arguments = (
        *site, *outputs, "--route", *WAY, "--from", 102, 51, "--fail-on", "no-route",
        "--fail-on", "reachable-fraction<0.3",
    )  # fmt: skip
    ran = drive(*arguments)
    assert (ran.code, ran.err) == (0, "")
    assert "There is a way from (102, 51) to (110, 52)" in ran.out
    maps = [f"a{kind}.tif" for kind in ("", "-worst", "-headings", "-classes", "-numbers")]
    made = [*maps, "a.json", "a.md", "a.html"]
    assert ran.out.splitlines()[-8:] == [f"{tmp_path / name}: written." for name in made]
    assert re.search(r"^floor +0 m +35\.0°", ran.out, re.MULTILINE)
    document = json.loads(names[0].read_text("utf-8"))
    assert not list(SCHEMA.iter_errors(document))
    assert document["terrain"]["file"] == "terrain.json"
    assert document["routes"][0]["found"]
    assert str(tmp_path) not in "".join(name.read_text("utf-8") for name in names[:3])
    with rasterio.open(names[3]) as file:
        assert file.shape == (80, 120)
        # the map has what the report counts: in the picture of the best heading
        pixels = file.read(1)
    best = document["map"]["best_heading"]
    assert [int((pixels == code).sum()) for code in (1, 2)] == [best["go"], best["caution"]]

    there = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(maps) <= set(there)
    again = drive(*arguments)
    assert again.code == 3
    assert "exists already" in again.err
    # a process of its own, now that the kernels are compiled
    again = run("traversability", *arguments, "--overwrite", "--threads", 1)
    assert again.code == 0
    assert again.out == ran.out
    for name in names[:3]:
        assert name.read_bytes() == there[name.name]


def test_a_wall_in_the_way_fails(saved: Saved, tmp_path: Path) -> None:
    """Exit 1: says which condition held and by which figure; the report is there and names it."""
    out = tmp_path / "why.json"
    ran = drive(
        saved(CLOSED), "--vehicle", saved(VEHICLE, "v.json"), "--resolution",
        0.1, "--route", *WAY, "--report", out, "--fail-on", "no-route",
        "--fail-on", "no-go-fraction > 0.99", "--fail-on", "route-length>100",
    )  # fmt: skip
    assert ran.code == 1
    assert ran.err.splitlines() == [
        "terratool: --fail-on no-route: v: 1 of 1 routes cannot be driven.",
    ]
    (route,) = json.loads(out.read_text("utf-8"))["routes"]
    assert not route["found"]
    assert "/elemTree/children/0" in route["barriers"][0]["bars"]
    assert ran.out.startswith("no-go: There is no way from (102, 51) to (110, 52): step at (10")


@pytest.mark.nightly
@pytest.mark.parametrize("condition", [(), ("--fail-on", "no-route")])
def test_who_reads_no_further_is_told(saved: Saved, condition: tuple[str, ...]) -> None:
    """A pipe that is closed early, as by `| head`, takes nothing from the exit code."""
    arguments = (
        saved(CLOSED), "--vehicle", saved(VEHICLE, "v.json"), "--resolution", 0.1, "--route", *WAY,
        *condition,
    )  # fmt: skip
    assert drive(*arguments).code == 1
    with subprocess.Popen(
        [*COMMAND, "traversability", *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT, env=ENVIRONMENT,
    ) as process:  # fmt: skip
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        said = process.stderr.read().decode()
    assert process.returncode == 1
    named = "terratool: --fail-on no-route: v: 1 of 1 routes cannot be driven.\n"
    assert said == (named if condition else "")


def test_a_wheel_by_itself(saved: Saved) -> None:
    """JSON on standard output, nothing else; a wheel knows no body."""
    ran = drive(
        saved(WALLED), "--wheel-radius", 0.2, "--wheel-width", 0.1, "--load",
        100, "--resolution", 0.2, "--json",
    )  # fmt: skip
    assert (ran.code, ran.err) == (0, "")
    document = json.loads(ran.out)
    assert not list(SCHEMA.iter_errors(document))
    assert document["vehicle"]["single_wheel"]
    assert document["vehicle"]["weight_N"] == 100
    assert document["surfaces"][0]["climb_deg"] == pytest.approx(35.0)  # rigid ground: φ


def test_waypoints(site: tuple[str, ...], tmp_path: Path) -> None:
    """A way through the wall is barred by it; one through the gate is not."""
    path = tmp_path / "way.csv"
    path.write_text("x,y\n102,51\n110,51\n")
    ran = drive(*site, "--waypoints", path, "--fail-on", "no-route", "--json")
    assert ran.code == 1
    (route,) = json.loads(ran.out)["routes"]
    assert not route["planned"]
    assert "/elemTree/children/0" in route["barriers"][0]["bars"]


@pytest.mark.parametrize(
    ("arguments", "code", "part"),
    [
        (("--report", "out.pdf"), 2, 'out.pdf: there are no reports as ".pdf".'),
        (("--report", "out"), 2, "out: has no suffix."),
        (("--map", "out.png"), 2, "a map is a GeoTIFF"),
        (("--report", "a.md", "--report", "./a.md"), 2, "is to be written twice"),
        (("--map", "a.tif", "--report", "none/a.md"), 3, "the folder none does not exist"),
        (("--fail-on", "no-route"), 2, "--fail-on no-route needs a route"),
        (("--fail-on", "route-time>3"), 2, "needs a route"),
        (("--fail-on", "reachable-fraction<1"), 2, "needs --from"),
        (("--return",), 2, "--return needs a route"),
        (("--report", "way.geojson"), 2, "way.geojson needs a route"),
        (("--fail-on", "nogo"), 2, "Did you mean no-go?"),
        (("--route", 99, 51, 110, 52), 2, "The route's start, 99 51, lies outside the terrain."),
        (("--route", 101, 51, 110, "nan"), 2, "The route's goal, 110 nan, lies outside"),
        (("--bounds", 100, 50, 104, 54, "--route", 101, 51, 110, 52), 2, "the bounds that were"),
        (("--bounds", 1, 2, 3, 4), 2, "miss the terrain"),
        (("--bounds", 3, 4, 1, 2), 2, "are empty"),
        (("--resolution", 0), 2, "The resolution is 0."),
        (("--resolution", 1e-9), 2, "pixels"),
        (("--headings", 6), 2, "headings"),
        (("--prefer", "beauty"), 2, "beauty"),
        (("--load", 3), 2, "a vehicle or a wheel, not both"),
        (("--waypoints", "missing.csv"), 3, "missing.csv: cannot be read"),
    ],
)
def test_refuses(
    site: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[object, ...],
    code: int,
    part: str,
) -> None:
    """One sentence what is wrong, one what to do; nothing is written, not even what could be.

    And no pixel is judged before.
    """
    monkeypatch.setattr(Surveyor, "measure", never)
    before = sorted(path.name for path in tmp_path.iterdir())
    local = [
        tmp_path / text if isinstance(text, str) and re.search(r"\.(md|tif|png|pdf|geojson)$", text)
        else text
        for text in arguments
    ]  # fmt: skip
    ran = drive(*site, "--report", tmp_path / "good.json", *local)
    assert (ran.code, ran.out) == (code, "")
    assert part in ran.err.replace(f"{tmp_path}/", "")
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def never(*_: object) -> None:
    raise AssertionError("The survey has begun.")


def test_what_the_disk_or_the_crs_forbids_is_said_first(
    saved: Saved, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a map that does not fit, one that exists, and one in an unknown reference system."""
    monkeypatch.setattr(Surveyor, "measure", never)
    vehicle = ("--vehicle", saved(VEHICLE, "v.json"), "--resolution", 0.1, "--route", *WAY)
    odd = drive(
        saved(WALLED | {"crs": "EPSG:999999"}, "odd.json"), *vehicle, "--map", tmp_path / "m.tif"
    )
    assert odd.code == 1 and "is unknown" in odd.err
    (tmp_path / "there-numbers.tif").write_text("mine")
    there = drive(saved(WALLED), *vehicle, "--map", tmp_path / "there.tif")
    assert there.code == 3 and "there-numbers.tif: exists already" in there.err
    monkeypatch.setattr("terratool.raster.export.free_bytes", lambda _: 1000)
    full = drive(saved(WALLED), *vehicle, "--map", tmp_path / "m.tif")
    assert full.code == 3 and "but 1,000 are free" in full.err


def test_a_start_that_cannot_be_stood_on_is_a_result(site: tuple[str, ...], tmp_path: Path) -> None:
    """On top of the wall: said at once; map and reports are there, the verdict no-go, exit 1."""
    outputs = [tmp_path / name for name in ("m.tif", "r.json", "r.html", "r.geojson")]
    reports_ = [part for name in outputs[1:] for part in ("--report", name)]
    ran = drive(*site, "--route", 105.95, 51, 110, 52, "--map", outputs[0], *reports_)
    assert ran.code == 1
    assert ran.err == (
        "terratool: There is no such route. The vehicle cannot stand at the route's start, 105.95 "
        '51, whatever its heading: roughness, by /elemTree/children/0 (surface "<brick>"). It '
        "can stand and move at 105.55 50.95, near there.\n"
    )
    assert ran.out.startswith("no-go: There is no way from (105.95, 51) to (110, 52)")
    assert all(path.is_file() for path in outputs)
    document = json.loads(outputs[1].read_text("utf-8"))
    assert not list(SCHEMA.iter_errors(document))
    (route,) = document["routes"]
    assert "cannot stand at the start" in route["note"] and route["verdict"] == "no-go"
    assert document["map"]["best_heading"]["go"] > 0


def test_tells_of_the_files_that_it_writes(
    site: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Until they have taken their places, which takes long where they are large."""
    map_, said, there = tmp_path / "m.tif", [], []
    leave = StatusLine.__exit__

    def noted(self: StatusLine, *error: Any) -> None:
        there.append(map_.is_file())
        leave(self, *error)

    monkeypatch.setattr(StatusLine, "say", lambda self, what, total=None: said.append(what))
    monkeypatch.setattr(StatusLine, "__exit__", noted)
    assert drive(*site, "--map", map_).code == 0
    assert said == ["finding what can be reached", "writing the map", "writing files"]
    assert there == [False, True]


MUDDY: dict[str, Any] = WALLED | {
    "surfTypes": {
        **WALLED["surfTypes"],
        "mud": {"cohesion": 0.1, "fricAngle": 12, "sinkage": 2},
        "untold": {},
        "scree": {"cohesion": 0, "fricAngle": 35, "sinkage": 0},
    },
    "elemTypes": {**WALLED["elemTypes"], "ramp": {"x": "t"}},
    "elemTree": {
        **WALLED["elemTree"],
        "children": [
            *WALLED["elemTree"]["children"],
            {"type": "flat", "surface": "mud", "cellX": 0, "cellY": 4, "span": [2, 4]},
            {"type": "flat", "surface": "untold", "cellX": 8, "cellY": 0, "span": [3, 3]},
            {"type": "ramp", "surface": "scree", "cellX": 8, "cellY": 4, "span": [3, 4],
             "vScale": 3},
        ],
    },
}  # fmt: skip


@pytest.mark.parametrize(
    ("x", "y", "why"),
    [
        (105.95, 51, r'(?:roughness|step), by /elemTree/children/0 \(surface "<brick>"\).*'),
        (111.5, 50.5, r'no ground, by /elemTree/children/1 \(surface "hole"\)'),
        (100.05, 52, "edge of the terrain"),
        (
            101,
            56,
            r'(?:traction|sinkage|slip|high-centred), by /elemTree/children/2 \(surface "mud"\)',
        ),
        (109.5, 51.5, r'soil unknown, by /elemTree/children/3 \(surface "untold"\)'),
        (109.5, 56, r'.*, by /elemTree/children/4 \(surface "scree"\), on a slope of 45°'),
    ],
)
def test_a_place_to_start_from_is_looked_at_first(
    saved: Saved, monkeypatch: pytest.MonkeyPatch, x: float, y: float, why: str
) -> None:
    """Why it cannot stand there is said before much is judged, and a place that will do."""
    seen: list[int] = []
    measure = Surveyor.measure

    def noted(self: Surveyor, window: Window, **options: Any) -> Any:
        seen.append(window.width * window.height)
        return measure(self, window, **options)

    monkeypatch.setattr(Surveyor, "measure", noted)
    terrain, vehicle = terrain_of(MUDDY), load_vehicle(saved(VEHICLE, "v.json"))
    planned = prepare_assessment(terrain, vehicle, Request(start=(x, y), resolution=0.05))
    (line,) = first_look(planned)
    assert sum(seen) <= 66 * 66 < 160 * 240
    near = re.fullmatch(
        rf"Nothing can be reached. The vehicle cannot stand at the place to start from, {x} {y}, "
        rf"whatever its heading: {why}. It can stand and move at (\S+) (\S+), near there\.",
        line,
    )
    assert near
    report = assess(planned)
    assert report.verdict == Verdict.NO_GO and report.reach is not None
    assert line == f"Nothing can be reached. {report.reach.note}"
    assert conclusion(report) == report.reach.note
    better = Request(start=(float(near[1]), float(near[2])), resolution=0.05)
    there = prepare_assessment(terrain, vehicle, better)
    assert not list(first_look(there))
    reached = assess(there).reach
    assert reached is not None and reached.share > 0.0


def test_where_it_cannot_start_is_a_result(site: tuple[str, ...], tmp_path: Path) -> None:
    """Exit 1, and the map and the report are there."""
    outputs = [tmp_path / name for name in ("m.tif", "r.json")]
    ran = drive(*site, "--from", 105.95, 51, "--map", outputs[0], "--report", outputs[1])
    assert ran.code == 1 and all(path.is_file() for path in outputs)
    assert ran.err.startswith("terratool: Nothing can be reached. The vehicle cannot stand at ")
    assert "cannot stand at the place to start from" in ran.out


MUD = {"cohesion": 1.0, "fricAngle": 22, "sinkage": 0.08, "shearModulus": 0.025}
SLOPE: dict[str, Any] = {
    "size": [12, 5],
    "surfTypes": {"mud": MUD},
    "elemTypes": {"slope": {"x": [[0, 0], [0.25, 0], [0.75, 1], [1, 1]]}},
    "elemTree": {"type": "slope", "vScale": 2.0, "surface": "mud"},
}


def test_a_way_down_says_that_there_is_none_back(saved: Saved, tmp_path: Path) -> None:
    """In the sentence, the report and JSON; with --return it fails."""
    common = (saved(SLOPE), "--vehicle", saved(VEHICLE, "v.json"), "--route", 11, 2.5, 1, 2.5)
    plain = drive(*common, "--resolution", 0.2, "--json")
    document = json.loads(plain.out)
    assert plain.code == 0 and document["map"] is None
    assert not list(SCHEMA.iter_errors(document))
    (route,) = document["routes"]
    assert route["one_way"] and route["against"] and route["back"] is None
    assert document["verdict"] == route["verdict"] == "caution"
    assert "It is one-way: it cannot be driven back the same way" in document["sentence"]
    report = tmp_path / "r.md"
    asked = drive(*common, "--resolution", 0.2, "--headings", 8, "--return", "--report", report)
    assert asked.code == 1 and asked.out.startswith("no-go: There is a way")
    assert "There is no way back:" in " ".join(asked.out.split())
    assert "There is no way back:" in report.read_text("utf-8")
    up = drive(*common[:-4], 1, 2.5, 11, 2.5, "--resolution", 0.2, "--headings", 8)
    assert up.code == 1


def test_ground_that_carries_downhill_only_is_no_go(saved: Saved) -> None:
    """It goes nowhere on the level; down the slope it would, with its nose downhill."""
    deep = {"cohesion": 0.1, "fricAngle": 13, "sinkage": 0.18, "shearModulus": 0.03}
    steep = {**SLOPE, "surfTypes": {"mud": deep}}
    ran = drive(
        saved(steep), "--vehicle", saved(VEHICLE, "v.json"), "--resolution", 0.2, "--json"
    )  # fmt: skip
    document = json.loads(ran.out)
    (mud,) = document["surfaces"]
    assert mud["verdict"] == "no-go" and mud["climb_deg"] is None
    best, worst = document["map"]["best_heading"], document["map"]["worst_heading"]
    assert best["one-way"] > 0.05 * document["map"]["pixels"]
    assert best["go"] == best["caution"] == worst["go"] == worst["caution"] == 0
    assert document["verdict"] == "no-go"
    assert "no place that the vehicle can drive to and back from" in document["sentence"]


def test_the_top_of_a_rack_is_cut_off(saved: Saved, tmp_path: Path) -> None:
    """7 m up, level and firm: it counts only for whom it is there. The rim is its own class."""
    rack = {
        "type": "box",
        "surface": "<brick>",
        "cellX": 5,
        "cellY": 1,
        "span": [4, 3],
        "vScale": 7,
    }
    tree = {**WALLED["elemTree"], "children": [rack]}
    file = saved({**WALLED, "elemTree": tree})
    common = (file, "--vehicle", saved(VEHICLE, "v.json"), "--resolution", 0.1)
    counts = {}
    found_in = drive(*common, "--json", "--report", tmp_path / "r.md")
    sentence, part = (json.loads(found_in.out)[key] for key in ("sentence", "map"))
    part = part["largest_part"]
    x, y = part["place"]
    counted = (
        f"What can be reached is counted from the largest connected part of the ground, "
        f"{100 * part['share']:.1f} % of it, as with --from {x:g} {y:g}."
    )
    assert counted in sentence and counted in (tmp_path / "r.md").read_text("utf-8")
    for start, place in (
        ("floor", ()), ("rack", ("--from", 107, 52.5)), ("there", ("--from", x, y))
    ):  # fmt: skip
        path = tmp_path / f"{start}.tif"
        ran = drive(*common, *place, "--map", path, "--json")
        assert ran.code == 0
        document = json.loads(ran.out)
        counts[start] = document["map"]["best_heading"]
        assert document["map"]["from"] == (list(place[1:]) or None)
        assert (document["map"]["largest_part"] is None) == bool(place)
        assert (counted in document["sentence"]) == (not place)
        if start == "there":
            assert counts["there"] == counts["floor"]
            assert document["reach"]["returnable"] == part["share"]
            continue
        with rasterio.open(path) as map_:
            top, floor, rim, foot = (
                GroundClass(int(next(map_.sample([at]))[0]))
                for at in ((107.05, 52.55), (102.05, 55.05), (100.05, 54.05), (105.05, 52.55))
            )
            values, found = np.unique(map_.read(1), return_counts=True)
        told = {GroundClass(int(v)).label: int(n) for v, n in zip(values, found, strict=True)}
        assert told == {name: n for name, n in counts[start].items() if n}
        away, here = (GroundClass.CUT_OFF, GroundClass.GO)
        assert (top, floor) == ((away, here) if start == "floor" else (here, away))
        assert (rim, foot) == (GroundClass.EDGE, GroundClass.NO_GO)
    # rims that it would have to enter sideways are cut off from either
    assert counts["floor"]["cut-off"] >= counts["rack"]["go"] > 500
    assert counts["rack"]["cut-off"] >= counts["floor"]["go"] > 6000


@pytest.mark.parametrize(
    "surfaces", [None, {"sand": {}}, {"sand": {"cohesion": 1}, "rock": {"fricAngle": 30}}]
)
def test_the_lines_that_mend_a_terrain_without_soil(
    saved: Saved, surfaces: dict[str, Any] | None
) -> None:
    """They name what is lacking, and written where they say they make the ground known."""
    tree = {"type": "flat", "vScale": 0, "cells": [2, 1], "children": []}
    bare: dict[str, Any] = {"size": [6, 4], "elemTypes": {"flat": {"x": [0]}}, "elemTree": tree}
    if surfaces:
        bare["surfTypes"] = surfaces
        tree["surface"] = "sand"
        tree["children"] = [
            {"type": "flat", "cellX": 1, "cellY": 0, "surface": name, "vScale": 0}
            for name in list(surfaces)[1:]
        ]
    common = ("--vehicle", saved(VEHICLE, "v.json"), "--resolution", 0.2)
    ran = drive(saved(bare), *common, "--json")
    document = json.loads(ran.out)
    assert document["verdict"] == "unknown"
    for name, keys in (surfaces or {}).items():
        lacks = " and ".join(
            ", ".join(k for k in ("cohesion", "fricAngle", "sinkage") if k not in keys).rsplit(
                ", ", 1
            )
        )
        assert f'urface "{name}" lacks {lacks}' in document["sentence"]
    if not surfaces:
        assert "The ground has no surface." in document["sentence"]
    text = drive(saved(bare), *common).out
    assert "\nsurface  sinkage" not in text
    for alternative in ("own", "preset") if surfaces else ("both",):
        mended = json.loads(json.dumps(bare))
        for mend in document["mending"]:
            assert f"  {mend['line']}\n    {mend['where']}\n" in text
            whole = "or all of it" in mend["where"]
            if surfaces and whole == (alternative == "own"):
                continue
            target = mended
            for name in re.findall(r'"(\w+)"', mend["where"]):
                target = target.setdefault(name, {})
            target.update(json.loads(f"{{{mend['line'].rstrip(',')}}}"))
        again = json.loads(drive(saved(mended, "mended.json"), *common, "--json").out)
        assert again["verdict"] in ("go", "caution") and not again["mending"], mended


def test_a_route_as_geojson_has_its_ground(saved: Saved, tmp_path: Path) -> None:
    """In the crs of the file; stretches join to the whole way, with the surface and the element."""
    mat = {"type": "flat", "surface": "mat", "cellX": 3, "cellY": 0, "span": [2, 8]}
    value = {
        **CLOSED, "crs": "EPSG:32633",
        "surfTypes": {**CLOSED["surfTypes"], "mat": CLOSED["surfTypes"]["floor"]},
        "elemTree": {**CLOSED["elemTree"], "children": [*CLOSED["elemTree"]["children"], mat]},
    }  # fmt: skip
    path = tmp_path / "way.geojson"
    ran = drive(
        saved(value), "--vehicle", saved(VEHICLE, "v.json"), "--resolution", 0.1, "--json",
        "--route", 101, 51.55, 104.6, 53, "--route", *WAY, "--report", path,
    )  # fmt: skip
    assert ran.code == 1  # the second one is barred
    document, found = json.loads(ran.out), json.loads(path.read_text("utf-8"))
    assert found["type"] == "FeatureCollection" and found["terratool"] == terratool.__version__
    assert found["crs"]["properties"]["name"] == "urn:ogc:def:crs:EPSG::32633"
    way, *more = [f for f in found["features"] if f["properties"]["route"] == 1]
    profile = document["routes"][0]["profile"]
    line = shapely.geometry.shape(way["geometry"])
    assert next(iter(line.coords))[:2] == (profile["x"][0], profile["y"][0])
    assert line.length == pytest.approx(profile["distance_m"][-1])
    stretches = [f for f in more if f["properties"]["kind"] == "stretch"]
    joined = shapely.ops.linemerge([shapely.geometry.shape(f["geometry"]) for f in stretches])
    assert joined.equals(line)
    own = [f["properties"] for f in stretches]
    assert {(p["surface"], p["pointer"]) for p in own} == {
        ("floor", "/elemTree"), ("mat", "/elemTree/children/2"),
    }  # fmt: skip
    for feature, place in zip(stretches, own, strict=True):
        west, _, east, _ = shapely.geometry.shape(feature["geometry"]).bounds
        on_mat = place["surface"] == "mat"
        assert (west >= 102.8 and east <= 105.2) == on_mat
        assert place["to_m"] > place["from_m"]
    kinds = [f["properties"]["kind"] for f in more]
    assert kinds[-2:] == ["start", "goal"]
    lost = [f for f in found["features"] if f["properties"]["route"] == 2]
    assert lost[0]["geometry"] is None and not lost[0]["properties"]["found"]
    bars = [f["properties"] for f in lost if f["properties"]["kind"] == "barrier"]
    assert "/elemTree/children/0" in bars[0]["bars"]


def test_maps_are_cloud_optimised(saved: Saved, tmp_path: Path) -> None:
    """With overviews that make no class of others, and names; written by two grids alike."""
    path = tmp_path / "m.tif"
    common = (saved(WALLED), "--vehicle", saved(VEHICLE, "v.json"), "--resolution", 0.02)
    assert drive(*common, "--map", path).code == 0
    for name in ("m", "m-worst", "m-headings", "m-classes", "m-numbers"):
        with rasterio.open(tmp_path / f"{name}.tif") as file:
            assert cog_validate(tmp_path / f"{name}.tif", strict=True) == (True, [], [])
            assert file.overviews(1) and file.shape == (400, 600)
        if name == "m":
            with rasterio.open(tmp_path / "m.tif", overview_level=0) as coarse:
                small = coarse.read(1)
    with rasterio.open(path) as file:
        assert set(np.unique(small)) <= set(np.unique(file.read(1)))
    names = (tmp_path / "m.tif.aux.xml").read_text("utf-8")
    assert names.index("caution") < names.index("cut-off") < names.index("one-way")
    assert sorted(p.name for p in tmp_path.glob("m*")) == sorted(
        [
            "m.tif",
            "m.tif.aux.xml",
            "m-worst.tif",
            "m-worst.tif.aux.xml",
            "m-headings.tif",
            "m-classes.tif",
            "m-classes.tif.aux.xml",
            "m-numbers.tif",
        ]
    )


@pytest.mark.parametrize("what", [0, 2])
def test_keeps_what_it_reads(site: tuple[str, ...], what: int) -> None:
    """The definition and the vehicle are no outputs, --overwrite or not."""
    before = Path(site[what]).read_bytes()
    ran = drive(*site, "--report", site[what], "--overwrite")
    assert ran.code == 3
    assert "is read, too" in ran.err
    assert Path(site[what]).read_bytes() == before


def test_a_failure_at_the_end_leaves_nothing(
    site: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The map is complete when the last report fails; nothing appears."""

    def fail(report: object) -> str:
        raise WriteError("The disk is full.", "Take another.")

    monkeypatch.setitem(formats.FORMATS, ".md", fail)
    before = sorted(path.name for path in tmp_path.iterdir())
    names = [tmp_path / name for name in ("a.tif", "a.json", "a.md")]
    ran = drive(*site, "--map", names[0], "--report", names[1], "--report", names[2])
    assert (ran.code, ran.out) == (3, "")
    assert "The disk is full." in ran.err
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_help_has_an_example_and_names_everything() -> None:
    ran = call("traversability", "--help")
    assert "Example: terratool traversability samples/" in " ".join(ran.out.split())
    assert PREFERENCES == graph.PREFERENCES
    assert vehicles.MODELS == MODELS
    told = " ".join(ran.out.split()).replace("- ", "-")  # lines break after hyphens
    for name in WORDS:
        assert name in told
    for name in FIGURES:
        assert name.removesuffix("fraction") in told, name
    assert "traversability" in call("--help").out


def test_the_example_of_the_help_runs() -> None:
    example = " ".join(drive("--help").out.split()).partition("Example: ")[2]
    words = example.split()
    assert (ROOT / words[2]).is_file()
    assert (ROOT / words[words.index("--vehicle") + 1]).is_file()
    at = words.index("--route")
    terrain = load(ROOT / words[2])
    vehicle = load_vehicle(ROOT / words[words.index("--vehicle") + 1])
    x0, y0, x1, y1 = map(float, words[at + 1 : at + 5])
    prepare_assessment(
        terrain, vehicle, Request(routes=((x0, y0, x1, y1),))
    )  # its places lie on the terrain


@pytest.fixture
def vehicle(saved: Saved) -> Vehicle:
    return load_vehicle(saved(VEHICLE, "v.json"))


class Told:
    """Counts what it is told of."""

    def __init__(self) -> None:
        self.pixels, self.said = 0.0, [""]
        self.shares: dict[str, list[float]] = {}

    def __call__(self, more: float) -> None:
        if self.said[-1] in self.shares:
            self.shares[self.said[-1]].append(more)
        else:
            self.pixels += more

    def say(self, what: str, total: int | None = None) -> None:
        self.said.append(what)
        if total is not None:
            self.shares[what] = [-total]


def assessed(terrain: Terrain, vehicle: Vehicle, request: Request) -> TraversabilityReport:
    return assess(prepare_assessment(terrain, vehicle, request))


class TestAssess:
    def test_without_a_map_it_is_coarser_and_says_so(
        self, vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(preparing, "MOST_PIXELS", 60)
        terrain = terrain_of(WALLED)
        grids = prepare_assessment(terrain, vehicle, Request())
        assert (grids.grid.width, grids.grid.height) == (60, 40)
        assert "60 on the longer side" in grids.notes[0]
        full = prepare_assessment(terrain, vehicle, Request(), map_path="map.tif")
        assert full.grid.resolution == 0.04
        assert "a quarter of the wheel's radius" in full.notes[0]

    def test_says_that_it_leaves_gaps(self, vehicle: Vehicle) -> None:
        """Where pixels are longer than the vehicle, what lies between them is not judged."""
        terrain = terrain_of(WALLED)
        length = sum(vehicle.rectangle[:2])
        for factor, gaps in ((0.9, False), (1.1, True)):
            request = Request(resolution=factor * length)
            notes = prepare_assessment(terrain, vehicle, request).notes
            assert any("is not looked at" in note for note in notes) == gaps

    def test_bounds_decide_the_resolution(self, vehicle: Vehicle) -> None:
        terrain = terrain_of(WALLED | {"size": [240000, 160000]})
        west, south, _, _ = terrain.bounds
        request = Request(bounds=(west, south, west + 10, south + 5))
        grids = prepare_assessment(terrain, vehicle, request)
        assert grids.grid.resolution == 0.04
        assert "a quarter of the wheel's radius" in grids.notes[0]

    def test_no_pixel_is_judged_twice(
        self, vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Map, two routes, one back, waypoints, reach and picture: one survey of each pixel.

        But for the pixel to start from: whether 8 headings do there is looked at before.
        """
        terrain = terrain_of(WALLED)
        seen = np.zeros((40, 60), np.int64)
        measure = Surveyor.measure

        def counted(self: Surveyor, window: Window, **options: Any) -> Any:
            seen[part_of(window)] += 1
            return measure(self, window, **options)

        monkeypatch.setattr(Surveyor, "measure", counted)
        request = Request(
            routes=(WAY, WAY[2:] + WAY[:2]), waypoints=(np.array([[102, 51], [104, 52]]),),
            start=(102, 51), returns=True, resolution=0.2, threads=2,
        )  # fmt: skip
        planned = prepare_assessment(terrain, vehicle, request)
        row, column = cell_of(planned.grid, 102, 51)
        assert seen.sum() == seen[row, column] == 1
        seen[:] = 0
        assert not list(first_look(planned))
        told = Told()
        report = assess(planned, progress=told)
        assert (seen == 1).all()
        assert report.preview is not None and report.preview.grid == planned.grid
        assert told.pixels <= planned.pixels == 40 * 60

    @pytest.mark.parametrize("start", [None, (102.0, 51.0)])
    def test_says_what_share_of_the_reach_is_found(
        self, vehicle: Vehicle, start: tuple[float, float] | None
    ) -> None:
        """Share by share up to all of the pixels, whatever is looked for."""
        told = Told()
        request = Request(start=start, resolution=0.2)
        assess(prepare_assessment(terrain_of(WALLED), vehicle, request), progress=told)
        total, *shares = told.shares["finding what can be reached"]
        assert total == -40 * 60
        assert len(shares) > 10
        assert min(shares) >= 0.0 and max(shares) < 0.5 * 40 * 60
        assert sum(shares) == pytest.approx(40 * 60)

    def test_pixels_too_fine_for_routes_are_for_the_map_alone(
        self, vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """And without a map for nothing: what is said of the pixels is so."""
        monkeypatch.setattr(preparing, "MOST_STATES", 100_000)
        monkeypatch.setattr(routing, "MOST_STATES", 100_000)
        terrain = terrain_of(WALLED)
        for mapped in (True, False):
            request = Request(routes=(WAY,), resolution=0.04, mapped=mapped)
            report = assess(prepare_assessment(terrain, vehicle, request))
            assert report.routes[0].found
            told = " ".join(report.notes)
            routes = re.search(r"Routes are looked for on (\d+) × (\d+) pixels", told)
            assert routes is not None and 8 * int(routes[1]) * int(routes[2]) <= 100_000
            assert ("The map has 300 × 200 pixels of 0.04 m (as asked)" in told) == mapped
            assert (report.summary is not None) == mapped

    def test_routes_alone_look_at_what_matters(
        self, vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Two places in the west of a long yard: its east is not judged; nor is there a map."""
        terrain = terrain_of(WALLED | {"size": [120, 8]})
        seen: list[Window] = []
        measure = Surveyor.measure

        def noted(self: Surveyor, window: Window, **options: Any) -> Any:
            seen.append(window)
            return measure(self, window, **options)

        monkeypatch.setattr(Surveyor, "measure", noted)
        request = Request(routes=((102, 51, 110, 52),), resolution=0.2, mapped=False)
        report = assess(prepare_assessment(terrain, vehicle, request))
        assert report.routes[0].found and report.summary is report.preview is None
        assert max(window.column + window.width for window in seen) <= 128
        assert "10 % of" in report.notes[-1]
        near = Request(routes=((102, 51, 110, 52),), resolution=0.2, mapped=False)
        all_of_it = assess(prepare_assessment(terrain_of(WALLED), vehicle, near))
        assert not any("Only the ground" in note for note in all_of_it.notes)
        full = assess(prepare_assessment(terrain, vehicle, replace(request, mapped=True)))
        assert as_dict(full)["routes"] == as_dict(report)["routes"]

    def test_verdict_and_sentence_follow(self, vehicle: Vehicle) -> None:
        """Go in the open, no-go where the wall stands across, unknown without a soil."""
        flat = {**WALLED, "elemTree": {"type": "flat", "surface": "floor"}}
        inner = Request(bounds=(104, 52, 108, 56), resolution=0.2)
        report = assessed(terrain_of(flat), vehicle, inner)
        assert report.verdict == Verdict.GO
        assert conclusion(report).startswith("All of the ground is go")
        barred = assessed(
            terrain_of(CLOSED),
            vehicle,
            Request(routes=(WAY,), resolution=0.1),  # type: ignore[arg-type]
        )
        assert barred.verdict == Verdict.NO_GO
        assert "/elemTree/children/0" in conclusion(barred)
        bare = {**flat, "surfTypes": {"floor": {}}}
        unknown = assessed(terrain_of(bare), vehicle, inner)
        assert unknown.verdict == Verdict.UNKNOWN
        assert unknown.surfaces[0].missing


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "way"),
    [("start", (107.235, 54.2, 102, 51)), ("goal", (102, 51, 107.235, 54.2))],
)
def test_a_route_may_end_in_the_last_half_of_a_pixel(
    what: str, way: tuple[float, ...], saved: Saved
) -> None:
    """Of sides that pixels do not divide: it is told once that the vehicle cannot stand there."""
    ground = {"type": "flat", "surface": "floor"}
    site = saved({**WALLED, "size": [7.24, 4.23], "elemTree": ground})
    vehicle = saved(VEHICLE, "vehicle.json")
    ran = drive(site, "--vehicle", vehicle, "--resolution", 0.1, "--route", *way)
    assert ran.code == 1
    assert ran.out.startswith("no-go: There is no way from")
    (line,) = [line for line in ran.err.splitlines() if line.startswith("terratool:")]
    assert f"cannot stand at the route's {what}" in line
