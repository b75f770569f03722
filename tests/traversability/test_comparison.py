"""Several vehicles in one run of `terratool traversability`: side by side, none for another."""

from __future__ import annotations

import gzip
import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest
import rasterio
from referencing import Registry, Resource

import terratool
from terratool.cli.terminal import StatusLine
from terratool.raster.grid import Window
from terratool.report.tables import columns_of
from terratool.traversability.compare import prepare
from terratool.traversability.fineness import finest_resolution
from terratool.traversability.report.comparison import conclusion, together
from terratool.traversability.report.lines import as_lines
from terratool.traversability.report.page import as_page
from terratool.traversability.request import Request
from terratool.traversability.results import VehicleComparison
from terratool.traversability.survey import Surveyor
from terratool.traversability.vehicle import Axle, Vehicle, Wheel
from terratool.traversability.verdicts import GroundClass, Verdict
from tests import reports
from tests.commands import call
from tests.conftest import terrain_of
from tests.strategies import Json

drive = partial(call, "traversability")
Saved = Callable[..., Path]
GROUND = {"go", "caution"}

# Oblong, away from 0: a wall with a gate at the north that only a narrow vehicle gets through, soft
# ground in the south-east, no ground in a corner of it.
SITE: Json = {
    "descr": "a gate & <mud>",
    "size": [12, 8],
    "origin": [100, 50],
    "surfTypes": {
        "floor": {"cohesion": 0, "fricAngle": 35, "sinkage": 0, "shearModulus": 0.01},
        "brick": {"cohesion": 0, "fricAngle": 35, "sinkage": 0},
        "mud": {"cohesion": 1, "fricAngle": 24, "sinkage": 0.03, "shearModulus": 0.02},
        "hole": {"void": True},
    },
    "elemTypes": {"flat": {"x": [0]}, "box": {"x": [1]}},
    "elemTree": {
        "type": "flat", "surface": "floor", "cells": [12, 8],
        "children": [
            {"type": "box", "surface": "brick", "cellX": 6, "cellY": 0, "span": [1, 7],
             "vScale": 1},
            {"type": "flat", "surface": "mud", "cellX": 8, "cellY": 0, "span": [4, 4]},
            {"type": "flat", "surface": "hole", "cellX": 11, "cellY": 0},
        ],
    },
}  # fmt: skip
NARROW: Json = {
    "mass": 20, "wheels": {"radius": 0.12, "width": 0.08}, "wheelbase": 0.4, "track": 0.4,
    "cog": {"height": 0.15}, "clearance": 0.1, "speed": 0.5,
}  # fmt: skip
WIDE: Json = {
    "mass": 300, "wheels": {"radius": 0.3, "width": 0.1, "maxSlip": 0.5}, "wheelbase": 1.1,
    "track": 1.3, "cog": {"height": 0.4}, "clearance": 0.25, "overhang": {"front": 0.5},
    "classes": {"slip": 0.1},
}  # fmt: skip
WAY = ("--route", 102, 51, 110.5, 55.5)
EAST = ("--route", 110, 55, 108.5, 52)


@pytest.fixture
def site(saved: Saved) -> tuple[str, str, str]:
    """A terrain and two vehicles."""
    return str(saved(SITE)), str(saved(NARROW, "narrow.json")), str(saved(WIDE, "wide.json"))


def registry() -> Registry[Any]:
    found = [terratool.schema(name) for name in ("report", "comparison")]
    return Registry().with_resources(
        (one["$id"], Resource.from_contents(one)) for one in found
    )  # fmt: skip


def check(document: Any) -> None:
    schema = jsonschema.Draft202012Validator(terratool.schema("comparison"), registry=registry())
    assert [error.json_path for error in schema.iter_errors(document)] == []


def bytes_in(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


class TestSideBySide:
    @pytest.mark.nightly
    @pytest.mark.parametrize("turned", [False, True])
    def test_equals_the_single_runs(
        self, site: tuple[str, str, str], tmp_path: Path, turned: bool
    ) -> None:
        """Field by field and map by map, whichever is named first."""
        terrain, *vehicles = site
        if turned:
            vehicles.reverse()
        asked = ("--resolution", 0.1, *WAY, *EAST, "--return", "--from", 102, 51, "--json")
        single, both = tmp_path / "single", tmp_path / "both"
        single.mkdir()
        both.mkdir()
        alone = []
        for path in vehicles:
            map_ = single / f"m-{Path(path).stem}.tif"
            alone.append(json.loads(drive(terrain, "--vehicle", path, *asked, "--map", map_).out))
        named = [part for path in vehicles for part in ("--vehicle", path)]
        ran = drive(terrain, *named, *asked, "--map", both / "m.tif")
        document = json.loads(ran.out)
        check(document)
        assert document["reports"] == alone
        assert bytes_in(both) == bytes_in(single)
        names = [Path(path).stem for path in vehicles]
        self.agrees(document, alone, names)
        assert ran.code == 1
        assert document["verdict"] == "no-go"
        able = {one["vehicle"]: one["drives"] for one in document["vehicles"]}
        assert able == {"narrow": True, "wide": False}
        assert re.fullmatch(
            r"1 of 2 vehicles can drive there: narrow \((go|caution)\); wide cannot\.",
            document["sentence"],
        )

    def agrees(self, document: Json, alone: list[Json], names: list[str]) -> None:
        """What is picked out of the reports is theirs, each at its vehicle."""
        surfaces, routes = ([one[key] for one in alone] for key in ("surfaces", "routes"))
        for row, *ones in zip(document["surfaces"], *surfaces, strict=True):
            assert [cell.pop("vehicle") for cell in row["vehicles"]] == names
            for cell, one in zip(row["vehicles"], ones, strict=True):
                assert one["surface"] == row["surface"]
                assert cell.items() <= one.items() and len(cell) == 4
        for row, *ones in zip(document["routes"], *routes, strict=True):
            assert [cell.pop("vehicle") for cell in row["vehicles"]] == names
            for cell, one in zip(row["vehicles"], ones, strict=True):
                assert (one["start"], one["goal"]) == (row["start"], row["goal"])
                assert cell.items() <= one.items() and len(cell) == 7
        for cell, one in zip(document["map"]["vehicles"], alone, strict=True):
            assert cell["fractions"] == one["map"]["fractions"]
        first, second = document["routes"][0]["vehicles"]
        assert first["found"] != second["found"]

    def test_shares_of_both_are_those_of_the_maps(
        self, site: tuple[str, str, str], tmp_path: Path
    ) -> None:
        """Counted in the files where neither has the edge, by pixels: all, one alone, none."""
        terrain, narrow, wide = site
        vehicles = ("--vehicle", narrow, "--vehicle", wide)
        ran = drive(terrain, *vehicles, "--map", tmp_path / "m.tif", "--json")
        document = json.loads(ran.out)
        able, edge = [], np.False_
        for name in ("narrow", "wide"):
            with rasterio.open(tmp_path / f"m-{name}.tif") as file:
                pixels, grid = file.read(1), file.transform
                able.append(np.isin(pixels, [GroundClass.GO, GroundClass.CAUTION]))
                edge |= pixels == GroundClass.EDGE
        assert document["map"]["one_grid"]
        assert grid.a == pytest.approx(document["map"]["vehicles"][0]["resolution_m"])
        ground = document["reports"][0]["map"]["pixels"] - int(edge.sum())
        shares = {tuple(one["vehicles"]): one["share"] for one in document["map"]["together"]}
        for names, where in (
            (("narrow", "wide"), able[0] & able[1]), (("narrow",), able[0] & ~able[1]),
            (("wide",), able[1] & ~able[0]),
        ):  # fmt: skip
            counted = (where & ~edge).sum()
            assert shares.get(names, 0.0) * ground == pytest.approx(counted, abs=1e-6)
        assert sum(shares.values()) == pytest.approx(1.0)
        assert shares[("narrow",)] > 0.05 and shares[()] > 0.05

    @pytest.mark.nightly
    def test_one_grid_is_the_finest(self, site: tuple[str, str, str]) -> None:
        """That of the small vehicle, and the same as if it had been asked for."""
        terrain, narrow, wide = site
        both = ("--vehicle", narrow, "--vehicle", wide, "--json")
        for asked in ((), WAY, (*WAY, "--from", 102, 51)):
            small = json.loads(drive(terrain, "--vehicle", narrow, *asked, "--json").out)
            found = json.loads(drive(terrain, *both, *asked).out)
            (said,) = found["notes"]
            side = float(re.findall(r"pixels of ([\d.]+) m, as narrow would have", said)[0])
            if asked != WAY:
                assert side == pytest.approx(small["map"]["resolution_m"], rel=1e-3)
                sizes = [one["map"]["width"] for one in found["reports"]]
                assert sizes == [small["map"]["width"]] * 2
            assert "(one grid for all vehicles)" in found["reports"][1]["notes"][1] or asked == WAY
            for key in ("surfaces", "routes", "reach", "verdict", "sentence"):
                assert found["reports"][0][key] == small[key]
            exact = small["map"]["resolution_m"] if asked != WAY else 0.48 / 6
            alike = drive(terrain, *both, *asked, "--resolution", repr(exact)).out
            again = json.loads(alike)
            for one, other in zip(found["reports"], again["reports"], strict=True):
                assert {**one, "notes": []} == {**other, "notes": []}


class TestGrids:
    def vehicle(self, name: str, radius: float, length: float) -> Vehicle:
        half = 0.5 * length - radius
        return Vehicle(
            Wheel(radius, 0.5 * radius), (Axle(half), Axle(-half)), 10.0, track_width=3 * radius,
            cog_height=radius, name=name,
        )  # fmt: skip

    def test_what_one_does_not_allow_is_not_taken(self) -> None:
        """The long one would cover more than 512 pixels: the finest that it allows is taken."""
        short, long = self.vehicle("short", 0.02, 0.2), self.vehicle("long", 0.4, 6.0)
        terrain = terrain_of({**SITE, "size": [1.2, 0.8]})
        planned, (said,) = prepare(terrain, [short, long], Request())
        assert [one.grid for one in planned] == [planned[0].grid] * 2
        assert planned[0].grid.resolution == pytest.approx(finest_resolution(long))
        assert finest_resolution(long) > 0.02 / 4  # which the short one would have
        assert "the finest that long allows" in said

    def test_where_there_is_none_each_has_its_own(self) -> None:
        """What is too fine for the long one is too coarse for the tiny one; and that is said."""
        tiny, long = self.vehicle("tiny", 0.0005, 0.004), self.vehicle("long", 0.4, 12.0)
        terrain = terrain_of({**SITE, "size": [1.2, 0.8]})
        planned, (said,) = prepare(terrain, [tiny, long], Request())
        first, second = (one.grid.resolution for one in planned)
        assert first < second
        assert said.startswith("Each vehicle has a grid of its own")
        assert "long: A resolution of 0.00117188 is too fine" in said  # 1.2 m / 1024

    def test_of_grids_that_differ_nothing_is_added_up(self) -> None:
        one = reports.report()
        other = reports.report(preview=reports.preview(reports.Grid(0.0, 0.0, 1.0, 30, 80)))
        assert together(VehicleComparison((one, one)))
        assert together(VehicleComparison((one, other))) == []

    @pytest.mark.parametrize(
        "more", [(), ("--height-error", 0.1, 2), ("--headings", 64)], ids=["", "chances", "masks"]
    )
    def test_maps_must_fit_on_the_disk_together(
        self, site: tuple[str, str, str], more: tuple[Any, ...], tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:  # fmt: skip
        monkeypatch.setattr(Surveyor, "measure", never)
        terrain, narrow, wide = site
        asked = (
            terrain,
            "--vehicle",
            narrow,
            "--resolution",
            0.2,
            "--map",
            tmp_path / "m.tif",
            *more,
        )
        free = {"bytes": 1}
        monkeypatch.setattr("terratool.raster.export.free_bytes", lambda _: free["bytes"])
        needed = re.search(r"may take ([\d,]+)", drive(*asked).err)
        assert needed
        free["bytes"] = 2 * int(needed[1].replace(",", "")) - 2
        ran = drive(*asked, "--vehicle", wide)
        assert ran.code == 3 and "are free" in ran.err
        with pytest.raises(AssertionError, match="has begun"):
            drive(*asked)  # one alone would fit


def never(*_: object) -> None:
    raise AssertionError("The survey has begun.")


class TestNames:
    def test_the_same_file_twice_is_refused(self, site: tuple[str, str, str]) -> None:
        terrain, narrow, _ = site
        same = str(Path(narrow).parent / "." / ".." / Path(narrow).parent.name / "narrow.json")
        for other in (narrow, same):
            ran = drive(terrain, "--vehicle", narrow, "--vehicle", other)
            assert ran.code == 2 and "is given twice" in ran.err
            assert "Name each vehicle once." in ran.err

    def test_equal_names_are_told_apart_by_their_folders(
        self, site: tuple[str, str, str], tmp_path: Path
    ) -> None:
        """In the reports and in the names of maps; the rest of the path is in neither."""
        paths = []
        for folder, value in (("old", NARROW), ("new", WIDE)):
            (tmp_path / folder).mkdir()
            paths.append(tmp_path / folder / "rover.json")
            paths[-1].write_text(json.dumps(value))
        vehicles = [part for path in paths for part in ("--vehicle", path)]
        map_ = tmp_path / "m.tif"
        ran = drive(site[0], *vehicles, "--resolution", 0.2, "--map", map_, "--json")
        document = json.loads(ran.out)
        assert [one["vehicle"] for one in document["vehicles"]] == ["old/rover", "new/rover"]
        assert str(tmp_path) not in ran.out
        assert (tmp_path / "m-old-rover.tif").is_file() and (tmp_path / "m-new-rover.tif").is_file()
        assert document["reports"][1]["vehicle"]["mass_kg"] == 300

    def test_names_that_cannot_be_told_apart_are_refused(
        self, site: tuple[str, str, str], tmp_path: Path
    ) -> None:
        packed = tmp_path / "narrow.json.gz"
        packed.write_bytes(gzip.compress(json.dumps(WIDE).encode()))
        ran = drive(site[0], "--vehicle", site[1], "--vehicle", packed)
        assert ran.code == 2 and "would both be called" in ran.err

    @pytest.mark.parametrize(
        ("more", "code", "part"),
        [
            (("--load", 3), 2, "a vehicle or a wheel, not both"),
            (("--map", "x.png"), 2, "a map is a GeoTIFF"),
            (("--report", "m-narrow.tif"), 2, "there are no reports as"),
            (("--report", "slip.svg", "--model", "paper"), 2, "no slip in the model paper"),
            (("--vehicle", "gone.json"), 3, "gone.json"),
            (("--map", "there.tif"), 3, "there-wide-numbers.tif: exists already"),
            (("--report", "way.geojson"), 2, "way.geojson needs a route"),
        ],
    )
    def test_refuses_before_any_work(
        self, site: tuple[str, str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        more: tuple[object, ...], code: int, part: str,
    ) -> None:  # fmt: skip
        monkeypatch.setattr(Surveyor, "measure", never)
        terrain, narrow, wide = site
        (tmp_path / "there-wide-numbers.tif").write_text("mine")
        before = bytes_in(tmp_path)
        local = [tmp_path / text if re.search(r"\.\w+$", str(text)) else text for text in more]
        ran = drive(terrain, "--vehicle", narrow, "--vehicle", wide, *local)
        assert (ran.code, ran.out) == (code, "")
        assert part in ran.err
        assert bytes_in(tmp_path) == before

    def test_maps_that_would_be_one_file_are_refused(
        self, site: tuple[str, str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The classes of one, and the verdicts of another that is called so."""
        monkeypatch.setattr(Surveyor, "measure", never)
        other = tmp_path / "narrow-classes.json"
        other.write_text(json.dumps(WIDE))
        vehicles = ("--vehicle", site[1], "--vehicle", other)
        ran = drive(site[0], *vehicles, "--map", tmp_path / "m.tif")
        assert ran.code == 2 and "m-narrow-classes.tif: is to be written twice" in ran.err


class TestAnswers:
    @pytest.mark.parametrize(
        ("asked", "code", "verdict"),
        [(EAST, 0, "go"), (WAY, 1, "no-go"), ((), 0, "caution")],
    )
    def test_all_must_be_able(
        self, site: tuple[str, str, str], asked: tuple[object, ...], code: int, verdict: str
    ) -> None:
        """0 only where each by itself ends with 0; the verdict is that of the worst."""
        terrain, *vehicles = site
        alone = [
            drive(terrain, "--vehicle", path, "--resolution", 0.1, *asked, "--json")
            for path in vehicles
        ]
        named = [part for path in vehicles for part in ("--vehicle", path)]
        ran = drive(terrain, *named, "--resolution", 0.1, *asked)
        assert ran.code == max(one.code for one in alone) == code
        ranks = ["go", "caution", "unknown", "no-go"]
        worst = max((json.loads(one.out)["verdict"] for one in alone), key=ranks.index)
        assert ran.out.startswith(f"{worst}: ") and worst == verdict

    def test_conditions_name_the_vehicle(self, site: tuple[str, str, str]) -> None:
        terrain, narrow, wide = site
        ran = drive(
            terrain, "--vehicle", narrow, "--vehicle", wide, "--resolution", 0.1, *WAY,
            "--fail-on", "no-route", "--fail-on", "route-time>1",
        )  # fmt: skip
        assert ran.code == 1
        first, *rest = (line for line in ran.err.splitlines() if "--fail-on" in line)
        assert re.fullmatch(
            r"terratool: --fail-on route-time>1: narrow: route-time is [\d.]+ s on the way from .*",
            first,
        )
        assert rest == [
            "terratool: --fail-on no-route: wide: 1 of 1 routes cannot be driven.",
        ]

    def test_a_start_that_cannot_be_stood_on_is_said_of_whom(
        self, site: tuple[str, str, str]
    ) -> None:
        """Between the wall and the rim there is room for the narrow one only."""
        terrain, narrow, wide = site
        gate = ("--route", 106.5, 57.5, 102, 52, "--resolution", 0.1)
        ran = drive(terrain, "--vehicle", narrow, "--vehicle", wide, *gate)
        assert ran.code == 1
        (line,) = ran.err.splitlines()
        assert line.startswith("terratool: wide: There is no such route. The vehicle cannot stand")

    def test_progress_says_which_vehicle(
        self, site: tuple[str, str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        said: list[str] = []
        say = StatusLine.say

        def noted(self: StatusLine, what: str, total: int | None = None) -> None:
            say(self, what, total)
            said.append(self._what)

        monkeypatch.setattr(StatusLine, "say", noted)
        terrain, narrow, wide = site
        map_ = ("--map", tmp_path / "m.tif", "--resolution", 0.2)
        assert drive(terrain, "--vehicle", narrow, "--vehicle", wide, *map_).code == 0
        steps = ["judging", "finding what can be reached", "writing the map"]
        each = [f"{name}: {step}" for name in ("narrow", "wide") for step in steps]
        assert said == [*each, "writing files"]


class TestForms:
    @pytest.mark.slow
    def test_all_are_there_and_the_same_again(
        self, site: tuple[str, str, str], tmp_path: Path
    ) -> None:
        """A page that is well formed, with a map for each and a picture for each surface."""
        terrain, narrow, wide = site
        names = [f"r.{suffix}" for suffix in ("json", "md", "html", "geojson", "svg")]
        arguments = (terrain, "--vehicle", narrow, "--vehicle", wide, "--resolution", 0.1, *WAY)
        found = []
        for folder in ("a", "b"):
            (tmp_path / folder).mkdir()
            files = [part for name in names for part in ("--report", tmp_path / folder / name)]
            assert drive(*arguments, *files).code == 1
            found.append(bytes_in(tmp_path / folder))
        assert found[0] == found[1] and set(found[0]) == set(names)
        text = {name: found[0][name].decode() for name in names}
        check(json.loads(text["r.json"]))
        assert str(tmp_path) not in "".join(text.values())

        page = ElementTree.fromstring(text["r.html"].removeprefix("<!DOCTYPE html>\n"))
        pictures = [one.get("alt", "") for one in page.iter("{http://www.w3.org/1999/xhtml}img")]
        shown = [re.findall("by the (best|worst) heading", alt)[0] for alt in pictures]
        assert shown == ["best", "worst"] * 2
        # floor and mud have a shear modulus, brick has none: each on a desktop and on a phone
        assert text["r.html"].count('<svg class="slip"') == 4
        assert "Slip counts as none on &quot;brick&quot;, which does not yield." in text["r.html"]
        sheet = ElementTree.fromstring(text["r.svg"])
        panels = sheet.findall("{http://www.w3.org/2000/svg}g")
        assert len(panels) == 2
        for panel in panels:
            words = ["".join(one.itertext()) for one in panel]
            for name in ("narrow", "wide"):
                assert any(word.startswith(f"{name} ") for word in words)
            assert "10 %: go ends (wide)" in words and "20 %: go ends (narrow)" in words
            assert "50 %: caution ends (wide)" in words

        features = json.loads(text["r.geojson"])["features"]
        ways = [one["properties"] for one in features if one["properties"]["kind"] == "route"]
        assert [(one["vehicle"], one["found"]) for one in ways] == [
            ("narrow", True),
            ("wide", False),
        ]
        assert {one["properties"]["vehicle"] for one in features} == {"narrow", "wide"}

        width = None
        for line in text["r.md"].split("\n"):
            if not line.startswith("|"):
                width = None
                continue
            cells = len(re.findall(r"(?<!\\)\|", line)) - 1
            width = width or cells
            assert cells == width > 1, line
        (row,) = re.findall(r"^\| wide \|.*", text["r.md"], re.MULTILINE)
        assert "✘ no-go" in row
        said = text["r.md"].partition("### wide\n")[2].partition("\n## ")[0]
        assert re.search(r"^- cut off by: .*surface \"brick\"", said, re.MULTILINE)

    def test_all_that_a_report_says_of_a_vehicle_is_said_of_each(
        self, site: tuple[str, str, str], tmp_path: Path
    ) -> None:
        """Rows of a vehicle's own tables are there, with its name; what is the same stands once."""
        terrain, *vehicles = site
        asked = ("--resolution", 0.1, *WAY)
        both = tmp_path / "both.md"
        named_ = [part for path in vehicles for part in ("--vehicle", path)]
        drive(terrain, *named_, *asked, "--report", both)
        found = both.read_text("utf-8").split("\n")
        for path in vehicles:
            name, alone = Path(path).stem, tmp_path / f"{Path(path).stem}.md"
            drive(terrain, "--vehicle", path, *asked, "--report", alone)
            lines = alone.read_text("utf-8").split("\n")
            begin = lines.index("What the vehicle can do on each.") + 4
            assert len(lines[begin:]) > 3 and lines[begin].startswith("| floor |")
            for line in lines[begin : lines.index("", begin)]:
                surface = line.split(" | ")[0]
                assert line.replace(surface, f"{surface}, {name}", 1) in found
            soils = lines.index("What each was taken for.") + 2
            assert found.count(lines[soils]) == 1 and lines[soils + 2] in found
            assert sum(line in found for line in lines if line.startswith("- from: ")) == 1

    def test_a_table_for_a_terminal_is_no_wider(self) -> None:
        """Of five vehicles: the columns of some are below those of others."""
        five = tuple(
            reports.report(vehicle=named(Vehicle.single(Wheel(0.2, 0.1), 100.0), f"wheel {n}"))
            for n in range(5)
        )
        lines = list(as_lines(VehicleComparison(five)))
        pointers = [line for line in lines if "/elemTree" in line]
        assert all(sum(map(columns_of, line)) <= 80 for line in lines if line not in pointers)
        assert sum(line.startswith("sand ") for line in lines) >= 2

    def test_what_each_can_reach_is_said(self, site: tuple[str, str, str], tmp_path: Path) -> None:
        """In all forms for people, as of each by itself."""
        terrain, *vehicles = site
        asked = ("--resolution", 0.1, "--from", 102, 51)
        lines = []
        for path in vehicles:
            reach = json.loads(drive(terrain, "--vehicle", path, *asked, "--json").out)["reach"]
            share = 100 * reach["share"]
            lines.append(f"{Path(path).stem}: From (102, 51) {share:.3g} % of the ground can be")
        named_ = [part for path in vehicles for part in ("--vehicle", path)]
        outs = [tmp_path / "r.md", tmp_path / "r.html"]
        ran = drive(terrain, *named_, *asked, *(w for out in outs for w in ("--report", out)))
        table, text, page = ran.out, *(out.read_text("utf-8") for out in outs)
        root = ElementTree.fromstring(page.removeprefix("<!DOCTYPE html>\n"))
        words = " ".join(" ".join(root.itertext()).split())
        for line in lines:
            assert line in " ".join(table.split())
            assert line in text
            assert line.partition(": ")[2] in words
        assert lines[0].partition(": ")[2] != lines[1].partition(": ")[2]

    def test_nothing_of_the_users_is_markup(self) -> None:
        vehicle = Vehicle.single(Wheel(0.2, 0.1), 100.0)
        nasty = (reports.report(vehicle=named(vehicle, name)) for name in (reports.NASTY, "b"))
        text = as_page(VehicleComparison(tuple(nasty)))
        ElementTree.fromstring(text.removeprefix("<!DOCTYPE html>\n"))
        assert "<b>" not in text and "&lt;b&gt;" in text

    @pytest.mark.parametrize(
        ("verdicts", "sentence"),
        [
            ("go caution", "All of 2 vehicles can drive there: v0 (go) and v1 (caution)."),
            ("no-go go no-go", "1 of 3 vehicles can drive there: v1 (go); v0 and v2 cannot."),
            ("unknown go", "1 of 2 vehicles can drive there: v1 (go); of v0 it is not known."),
            ("no-go no-go", "None of 2 vehicles can drive there; v0 and v1 cannot."),
            (
                "no-go unknown",
                "None of 2 vehicles is known to drive there; v0 cannot; of v1 it is not known.",
            ),
        ],
    )
    def test_the_sentence_names_who_can(self, verdicts: str, sentence: str) -> None:
        by_label = {verdict.label: verdict for verdict in Verdict}
        wheel = Vehicle.single(Wheel(0.2, 0.1), 100.0)
        several = (
            reports.report(verdict=by_label[label], vehicle=named(wheel, f"v{n}"))
            for n, label in enumerate(verdicts.split())
        )
        assert conclusion(VehicleComparison(tuple(several))) == sentence

    def test_the_worst_is_that_of_the_whole(self) -> None:
        order = [Verdict.GO, Verdict.CAUTION, Verdict.UNKNOWN, Verdict.NO_GO]
        for n, worst in enumerate(order):
            several = tuple(reports.report(verdict=one) for one in (worst, *order[: n + 1]))
            assert VehicleComparison(several).verdict == worst


def named(vehicle: Vehicle, name: str) -> Vehicle:
    return replace(vehicle, name=name)


def test_windows_are_judged_once_for_each(
    site: tuple[str, str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No vehicle is asked about where another is meant: each has its own pixels, all of them."""
    seen: dict[str, int] = {}
    measure = Surveyor.measure

    def noted(self: Surveyor, window: Window) -> Any:
        name = self.vehicle.name
        seen[name] = seen.get(name, 0) + window.width * window.height
        return measure(self, window)

    monkeypatch.setattr(Surveyor, "measure", noted)
    terrain, narrow, wide = site
    drive(terrain, "--vehicle", narrow, "--vehicle", wide, "--resolution", 0.1)
    assert seen == {"narrow": 120 * 80, "wide": 120 * 80}
