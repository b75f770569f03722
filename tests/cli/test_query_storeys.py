"""`terratool query` over other ground: columns worked out by hand, in files beside their terrains.

Each line of these has a point, and the intervals of its column from below with the surface of each.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import terratool
from tests.commands import ROOT, YARD, Ran, call

STOREYS = ROOT / "tests" / "example-files" / "columns"
NAMES = sorted(path.stem for path in STOREYS.glob("*.json"))
HEADER = ["x", "y", "bottom", "z", "clear", "surface", "element", "under", "nx", "ny", "nz", "note"]
BRIDGE = STOREYS / "bridge.json"

Interval = tuple[float, float, str]


def worked(name: str) -> dict[tuple[float, float], list[Interval]]:
    """Columns of a file: bottom, top and surface of each interval, by the point."""
    found = {}
    for line in (STOREYS / f"{name}.txt").read_text("utf-8").splitlines():
        point, _, column = line.partition(":")
        x, y = map(float, point.split())
        intervals = re.findall(r"[([](\S+), (\S+)\] (\S+)", column)
        found[x, y] = [(float(low), float(high), worn) for low, high, worn in intervals]
    return found


def rows(ran: Ran) -> list[dict[str, str]]:
    assert (ran.code, ran.err) == (0, "")
    return list(csv.DictReader(io.StringIO(ran.out, newline="")))


def close(value: float) -> Any:
    return pytest.approx(value, abs=5e-7)


@pytest.mark.parametrize("name", NAMES)
def test_columns_worked_out_by_hand(name: str) -> None:
    """A line for each interval, from below, with the gap above it; one of no ground stays."""
    expected = worked(name)
    points = "".join(f"{x},{y}\n" for x, y in expected)
    ran = call("query", STOREYS / f"{name}.json", "--points", "-", "--columns", stdin=points)
    assert ran.out.splitlines()[0].split(",") == HEADER
    left = rows(ran)
    for (x, y), intervals in expected.items():
        own, left = left[: max(1, len(intervals))], left[max(1, len(intervals)) :]
        assert {(float(row["x"]), float(row["y"])) for row in own} == {(x, y)}
        if not intervals:
            assert [*own[0].values()][2:] == [""] * 9 + ["outside"]
            continue
        bottoms = [float(row["bottom"]) for row in own]
        assert bottoms == [close(low) for low, _, _ in intervals]
        assert [float(row["z"]) for row in own] == [close(high) for _, high, _ in intervals]
        assert [row["surface"] for row in own] == [worn for _, _, worn in intervals]
        above = [*(low for low, _, _ in intervals[1:]), math.inf]
        clear = [low - high for low, (_, high, _) in zip(above, intervals, strict=True)]
        assert [float(row["clear"]) for row in own] == [close(gap) for gap in clear]
        assert [row["under"] == "" for row in own] == [math.isinf(low) for low in bottoms]
        assert all(row["note"] == "" for row in own)
    assert not left


@pytest.mark.parametrize("name", NAMES)
def test_the_highest_top_and_the_number_of_tops(name: str) -> None:
    """A plain query is of the highest top, and says how many there are."""
    expected = worked(name)
    numbers = [number for point in expected for number in point]
    found = rows(call("query", STOREYS / f"{name}.json", *numbers))
    for row, intervals in zip(found, expected.values(), strict=True):
        if not intervals:
            assert (row["z"], row["storeys"], row["note"]) == ("", "", "outside")
            continue
        assert float(row["z"]) == close(intervals[-1][1])
        assert row["surface"] == intervals[-1][2]
        assert row["storeys"] == str(len(intervals))


@pytest.mark.parametrize(
    ("point", "below", "z", "element", "note"),
    [
        ((20, 10), "4", "4.0", "/elemTree/children/0", ""),
        ((20, 10), "3.9", "0.0", "/elemTree", ""),
        ((20, 10), "-1", "", "", "above"),
        ((20, 10), "inf", "4.0", "/elemTree/children/0", ""),
        ((8, 10), "3.999", "", "", "above"),
        ((41, 10), "9", "", "", "outside"),
    ],
)
def test_below_a_height(
    point: tuple[float, float], below: str, z: str, element: str, note: str
) -> None:
    """One line a point, of the highest top that is not above; why there is none, if so."""
    (_, row) = rows(call("query", BRIDGE, 1, 1, *point, "--below", below))
    assert (row["z"], row["element"], row["note"]) == (z, element, note)


def test_an_element_of_a_storey_is_named(tmp_path: Path) -> None:
    """Each end of an interval has the element that decides it."""
    found = rows(call("query", BRIDGE, 20, 8.2, 8, 10, "--columns"))
    kerb, slab = "/elemTree/children/0/children/0", "/elemTree/children/0"
    assert [(row["element"], row["under"]) for row in found] == [
        ("/elemTree", ""), (kerb, slab), (slab, ""),
    ]  # fmt: skip


def test_normals_lie_on_each_top() -> None:
    """The ramp of a car park leans to the west above level ground: 3 m over 10 m."""
    low, high = rows(call("query", STOREYS / "car-park.json", 5, 10, "--columns"))
    assert [float(low[f"n{axis}"]) for axis in "xyz"] == [0, 0, 1]
    length = math.hypot(0.3, 1)
    assert [float(high[f"n{axis}"]) for axis in "xyz"] == [
        close(-0.3 / length), 0, close(1 / length),
    ]  # fmt: skip


@pytest.mark.parametrize("options", [(), ("--columns",), ("--below", "2")])
def test_json_is_as_the_schema_says(options: tuple[str, ...]) -> None:
    """JSON has no infinite number: null is solid ground below, and the sky above."""
    ran = call("query", BRIDGE, 20, 10, 41, 3, *options, "--json")
    document = json.loads(ran.out)
    jsonschema.validate(document, terratool.schema("query"))
    if options == ("--columns",):
        ground, slab, nothing = document["intervals"]
        assert (ground["bottom"], ground["z"], ground["clear"]) == (None, 0.0, 3.5)
        assert (slab["bottom"], slab["z"], slab["clear"]) == (3.5, 4.0, None)
        assert (nothing["z"], nothing["note"]) == (None, "outside")
    else:
        tops = [point["storeys"] for point in document["points"]]
        assert tops == [2, None]


def test_columns_of_a_terrain_without_storeys(tmp_path: Path) -> None:
    """Each point has the one interval of its ground; a void has none, but its surface."""
    path = tmp_path / "yard.json"
    path.write_text(json.dumps(YARD), "utf-8")
    ramp, void = rows(call("query", path, 2, -1, -1, 3, "--columns"))
    assert [*ramp.values()][2:8] == ["-inf", "4.0", "inf", "sand", "/elemTree/children/0", ""]
    assert [*void.values()][2:8] == ["", "", "", "hole", "/elemTree/children/1", ""]
    assert (ramp["note"], void["note"]) == ("", "void")
    assert "storeys" not in rows(call("query", path, 2, -1))[0]
    below, gone = rows(call("query", path, 2, -1, -1, 3, "--below", 5))
    assert (below["z"], gone["note"]) == ("4.0", "void")


def test_points_count_from_the_corner(tmp_path: Path) -> None:
    """With --local the columns are those of the points that are meant."""
    moved = json.loads(BRIDGE.read_text("utf-8")) | {"origin": [500, -300]}
    path = tmp_path / "moved.json"
    path.write_text(json.dumps(moved), "utf-8")
    here = rows(call("query", BRIDGE, 12.5, 10, "--columns"))
    assert rows(call("query", path, 12.5, 10, "--columns", "--local")) == here


def test_what_makes_no_sense_is_refused() -> None:
    both = call("query", BRIDGE, 1, 1, "--columns", "--below", 3)
    assert both.code == 2 and "--columns has all tops, and --below one." in both.err
    nan = call("query", BRIDGE, 1, 1, "--below", "nan")
    assert nan.code == 2 and "nan is no height." in nan.err
