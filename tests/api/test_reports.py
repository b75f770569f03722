"""Results as they show themselves: in a terminal as the command does, in a notebook as tables."""

from __future__ import annotations

import json
import pickle
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

import terratool
from terratool.traversability.verdicts import GroundClass, Reason, Verdict
from tests.commands import ROOT, call

HUSKY = ROOT / "samples/vehicles/husky-a200.json"
WARTHOG = ROOT / "samples/vehicles/warthog.json"
LIDAR = ROOT / "samples/sensors/velodyne-vlp-16.json"
# Oblong; a gentle slab, a steep quarter of rock in the south-east.
SITE: dict[str, Any] = {
    "descr": "Slab <and> rock",
    "size": [16, 12],
    "surfTypes": {"slab": {"preset": "concrete"}, "rock": {"preset": "concrete"}},
    "elemTypes": {"slope": {"x": [0, 1]}},
    "elemTree": {
        "type": "slope", "vScale": 0.2, "surface": "slab", "cells": [2, 2],
        "children": [{"cellX": 1, "cellY": 0, "type": "slope", "vScale": 8, "surface": "rock"}],
    },
}  # fmt: skip
SAND = {"preset": "dry-sand"}
COARSE = {"resolution": 0.5, "headings": 4}
LINE = (2.0, 3.0, 5.0, 9.0)


class TextOf(HTMLParser):
    """Tags that are open, rows of tables, and the text of a piece of HTML."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.text = ""
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag: str, _attrs: object) -> None:
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data
        if self.open[-1] in ("td", "th"):
            self.rows[-1].append(data)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "site.json"
    path.write_text(json.dumps(SITE), "utf-8")
    return path


@pytest.mark.parametrize("vehicles", [[HUSKY], [HUSKY, WARTHOG]])
@pytest.mark.parametrize("routed", [False, True])
def test_a_report_prints_what_the_command_prints(
    file: Path, vehicles: list[Path], routed: bool
) -> None:
    words = [word for vehicle in vehicles for word in ("--vehicle", str(vehicle))]
    words += ["--route", *map(str, LINE)] if routed else []
    done = call("traversability", str(file), *words, "--resolution", "0.5", "--headings", "4")
    report = terratool.load(file).traversability(
        vehicles if len(vehicles) > 1 else HUSKY, routes=LINE if routed else (),
        mapped=not routed, **COARSE,
    )  # fmt: skip
    assert str(report) + "\n" == done.out
    assert str(pickle.loads(pickle.dumps(report))) == str(report)


def test_a_report_in_a_notebook_has_its_verdict_and_its_tables(file: Path) -> None:
    terrain = terratool.load(file)
    report = terrain.traversability(HUSKY, routes=LINE, **COARSE)
    html = report._repr_html_()
    shown = TextOf(html)
    assert html.startswith("<div><p><b>go</b>: ") and len(html) < 5000
    # the steep quarter is no-go; without the rim that is not far from a quarter of the ground
    [no_go] = [row for row in shown.rows if row[0] == "no-go"]
    assert 15 < float(no_go[1].removesuffix(" %")) < 35
    assert {"slab", "rock"} <= {row[0] for row in shown.rows}
    both = terrain.traversability([HUSKY, WARTHOG], **COARSE)
    rows = TextOf(both._repr_html_()).rows
    assert any({"husky-a200", "warthog"} <= set(row) for row in rows)
    assert [one._repr_html_()[:5] for one in both.reports] == ["<div>"] * 2  # type: ignore[attr-defined]


def test_results_have_a_short_text_of_their_own(file: Path) -> None:
    terrain = terratool.load(file)
    report = terrain.traversability(HUSKY, routes=[LINE, LINE], mapped=False, **COARSE)
    assert repr(report) == "<TraversabilityReport of husky-a200 on site.json: go, 2 ways>"
    both = terrain.traversability([HUSKY, WARTHOG], routes=LINE, mapped=False, **COARSE)
    assert repr(both) == "<VehicleComparison: husky-a200 go, warthog go>"
    assert repr(terratool.load_vehicle(HUSKY)) == "<Vehicle husky-a200: 4 wheels, 50 kg>"
    [frame] = terrain.scan(LIDAR, (4, 6, 0, 0, 0, 0), on_ground=1.0)
    assert repr(frame) == f"<Frame 0: {int(frame.returns.sum()):,} readings of 28,800 rays>"
    assert repr(terratool.check(file)) == f"<Checked {file}: nothing found>"
    wrong = {**SITE, "siez": 3, "elemTree": {"type": "slop"}}
    assert repr(terratool.check(wrong)) == "<Checked the definition: 2 errors, 2 warnings>"


def test_a_difference_prints_what_the_command_prints(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(file.parent)
    limit = "; --max-changes 0 lists all"
    wear = [{"cellX": n % 8, "cellY": n // 8, "type": "slope", "vScale": n / 99} for n in range(32)]
    wear[0]["descr"] = f"x{limit}"
    tree = {**SITE["elemTree"], "cells": [8, 4], "children": wear}
    Path("new.json").write_text(json.dumps({**SITE, "elemTree": tree}), "utf-8")
    found = terratool.load("site.json").diff("new.json", vehicles=HUSKY, resolution=0.5)
    words = ("--vehicle", str(HUSKY), "--resolution", "0.5")
    printed = call("diff", "site.json", "new.json", *words).out
    # of what the command says only the end of a list is another, no description
    assert f"{limit}\n" in printed and f'"x{limit}"' in printed
    assert str(found) + "\n" == printed.replace(f"{limit}\n", "; its attributes have all\n")
    assert repr(found) == "<Difference from site.json to new.json: different>"
    shown_text = TextOf(found._repr_html_()).text
    assert shown_text == str(found) and pickle.loads(pickle.dumps(found)) == found


def test_two_sides_of_one_file_have_names_of_their_own(file: Path) -> None:
    file.write_text(json.dumps({**SITE, "surfTypes": {"slab": SAND, "rock": SAND}}), "utf-8")
    terrain = terratool.load(file)
    driven = terrain.deform(HUSKY, [(2, 3), (6, 3)])
    found = terrain.diff(driven, resolution=0.5)
    assert (found.old, found.new) == (str(file), "the other terrain")
    assert repr(found) == f"<Difference from {file} to the other terrain: different>"
    assert str(found).startswith("the other terrain: different\n")
    assert str(terrain.diff(terrain)) == "the other terrain: same terrain"
    assert repr(terrain.diff(terrain)).endswith(": same>")


def test_maps_print_what_the_commands_print(tmp_path: Path, file: Path) -> None:
    points = [f"{0.5 * n},{0.25 * n},{0.1 + 0.01 * n},slab" for n in range(30)]
    cloud = tmp_path / "cloud.csv"
    cloud.write_text("x,y,z,surface\n" + "\n".join(points) + "\n99,99,1,<b>\n", "utf-8")
    out, bounds = tmp_path / "map.tif", (0, 0, 16, 12)
    words = ("--resolution", "1", "--bounds", *map(str, bounds))
    printed = call("map", str(cloud), str(out), "--levels", "1", *words).out
    made = terratool.map_scans(cloud, resolution=1, bounds=bounds, levels=1)
    assert str(made) + "\n" == printed.replace(str(out), "the map")
    assert repr(made) == "<RobotMap of 16 × 12 cells of 1 m: 30 readings>"
    assert TextOf(made._repr_html_()).text == str(made)
    terrain = terratool.load(file)
    printed = call("compare", str(out), str(file)).out
    found = terrain.compare(out)
    assert str(found) + "\n" == printed
    assert str(terrain.compare(made)) + "\n" == printed.replace(str(out), "the map")
    known = f"{found.known} of 192 cells, RMSE {found.errors.rmse:.4f} m"
    assert repr(found) == f"<MapComparison of {out}: {known}>"
    assert TextOf(found._repr_html_()).text == str(found)


def test_verdicts_are_words_and_still_numbers() -> None:
    assert [str(one) for one in Verdict] == ["unknown", "go", "caution", "no-go"]
    assert f"{Verdict.NO_GO} {Reason.TIP_OVER:>9}" == "no-go  tip-over"
    assert str(GroundClass.CUT_OFF) == "cut-off"
    assert Verdict.CAUTION == 2 and json.dumps({"v": Verdict.CAUTION}) == '{"v": 2}'
