"""Waypoints as files hold them, and what is said of files that do not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from terratool.errors import ReadError
from terratool.traversability.route.waypoints import read_waypoints

LINE: dict[str, Any] = {"type": "LineString", "coordinates": [[1, 2], [3.5, -4, 9]]}
FEATURE = {"type": "Feature", "properties": None, "geometry": LINE}


@pytest.mark.parametrize(
    "text",
    [
        "1,2\n3.5,-4\n",
        "\ufeff# by hand\n\nx,y\n1,2\n3.5,-4",
        "name; Y ; X\na;2;1\nb;-4;3.5\n",
        "1\t2\r\n3.5\t-4\r\n",
        "  1 2\n 3.5   -4e0",
        'y,note,x\n2,"a, b",1\n-4,,3.5',
        json.dumps(LINE),
        "\n " + json.dumps(FEATURE),
        json.dumps({"type": "FeatureCollection", "features": [FEATURE]}),
        json.dumps({"type": "GeometryCollection", "geometries": [LINE]}),
        json.dumps(
            {
                "type": "FeatureCollection",
                "features": [{"type": "Feature", "geometry": {"type": "Point"}}, FEATURE],
            }
        ),
    ],
)
def test_waypoints_are_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "way"
    path.write_bytes(text.encode())
    assert read_waypoints(path).tolist() == [[1, 2], [3.5, -4]]


RISING: dict[str, Any] = {"type": "LineString", "coordinates": [[1, 2, 0], [3.5, -4, 9, 1]]}
REPORT = {
    "features": [
        {"type": "Feature", "geometry": LINE, "properties": {"kind": "stretch"}},
        {"type": "Feature", "geometry": RISING, "properties": {"kind": "route"}},
        {"type": "Feature", "geometry": LINE, "properties": None},
    ]
}


@pytest.mark.parametrize(
    "text",
    [
        "1,2,0\n3.5,-4,9\n",
        "1 2 0\n3.5 -4 9",
        "Z;note;Y;X\n0;a;2;1\n9;b;-4;3.5\n",
        json.dumps(RISING),
        json.dumps(REPORT),
    ],
)
def test_waypoints_may_have_heights(tmp_path: Path, text: str) -> None:
    """All of them; of the lines of a report its route is meant."""
    path = tmp_path / "way"
    path.write_text(text)
    assert read_waypoints(path).tolist() == [[1, 2, 0], [3.5, -4, 9]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no waypoints"),
        ("x,y\n", "holds no waypoints"),
        ("1,2\n", "holds one waypoint"),
        ("1,2\n3\n", ':2: "3" holds no two numbers'),
        ("1,2,3\n4,5\n", ':2: "4,5" holds no three numbers x, y and z'),
        ("x,y,z\n1,2,\n", ':2: "1,2," holds no three numbers x, y and z'),
        ("lon,lat\n1,2\n3,4\n", ':1: "lon,lat" has no columns x and y'),
        ("1,2\n\n# c\nx,y\n", ":4: "),
        ("1,2\n3,nan\n", ':2: "3,nan" holds no two numbers'),
        ("1,2\n3,1_0\n", ":2: "),
        ("1,2\n3,1e999\n", ":2: "),
        ('1,2\n"3,4\n', ":2: "),
        ("1,2\n" + "3" * 200_000 + ",4\n", ":2: is no CSV line"),
        ("{", ":1: is no JSON"),
        ('{"type":\n"LineString",,}', ":2: is no JSON"),
        ("{}", "holds no LineStrings"),
        ('{"type": "FeatureCollection", "features": {"a": 1}}', "holds no LineStrings"),
        ('{"type": "FeatureCollection", "features": 5}', "holds no LineStrings"),
        (json.dumps({"features": [FEATURE, FEATURE]}), "holds 2 LineStrings"),
        (json.dumps({"features": REPORT["features"] * 2}), "holds 2 LineStrings"),
        ('{"type": "LineString"}', "has no coordinates"),
        ('{"type": "LineString", "coordinates": []}', "holds no waypoints"),
        ('{"type": "LineString", "coordinates": [[1, 2], 3]}', "the LineString has a position 1, "),
        ('{"type": "LineString", "coordinates": [[1, true]]}', "the LineString has a position 0, "),
        ('{"type": "LineString", "coordinates": [[1, "2"]]}', "the LineString has a position 0, "),
        ('{"type": "LineString", "coordinates": [[1, NaN]]}', "the LineString has a position 0, "),
        ('{"type": "LineString", "coordinates": [[1' + "0" * 400 + ", 2]]}", "a position 0, "),
        ('{"features": ' + "[" * 100_000, "is no "),
        ('{"features": [' * 200 + "]}" * 200, "holds no LineStrings"),
    ],
)
def test_what_are_no_waypoints_is_said(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "way.csv"
    path.write_text(text)
    with pytest.raises(ReadError) as error:
        read_waypoints(path)
    assert message in error.value.message and error.value.message.startswith(str(path))
    assert error.value.hint


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="cannot be read"):
        read_waypoints(tmp_path / "none.csv")
    (tmp_path / "latin").write_bytes(b"1,2\n\xe4")
    with pytest.raises(ReadError, match="is no UTF-8 text"):
        read_waypoints(tmp_path / "latin")
