"""Contours lie where the ground passes their height, and GDAL reads and finds the same ones."""

from __future__ import annotations

import json
import os
import re
import sqlite3
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from shapely.geometry import shape

from terratool.field.terrain import Terrain
from terratool.raster.contour_files import ContourRequest, export_contours
from terratool.raster.contours import contour_heights, trace_contours
from terratool.raster.grid import grid_over
from tests.commands import YARD, call
from tests.conftest import terrain_of
from tests.mosaics import SITE, export_dem
from tests.programs import needs

SIDE = 0.05
PLANE: dict[str, Any] = {
    "size": [12, 8], "origin": [4500, -320],
    "elemTypes": {"p": {"combine": "sum", "x": [0, 3], "y": [0, 1]}},
    "elemTree": {"type": "p", "vScale": 1},
}  # fmt: skip


def lines_of(path: Path) -> dict[float, list[np.ndarray]]:
    """The lines of a GeoJSON file by height."""
    found: dict[float, list[np.ndarray]] = {}
    for feature in json.loads(path.read_text("utf-8"))["features"]:
        line = np.array(feature["geometry"]["coordinates"])
        found.setdefault(feature["properties"]["elev"], []).append(line)
    return found


def exported(terrain: Terrain, path: Path, interval: float | None = 0.5, **more: Any) -> Any:
    """The report of contours, and their lines by height."""
    report = export_contours(terrain, path, ContourRequest(SIDE, interval=interval, **more))
    return report, lines_of(path)


def test_the_ground_has_the_height_on_each_point(tmp_path: Path) -> None:
    """Or passes it there: at a wall it is above on one side, and not on the other."""
    terrain = terrain_of(SITE)
    report, found = exported(terrain, tmp_path / "c.geojson")
    assert report.lines == sum(map(len, found.values()))
    at_walls = 0
    for height, lines in found.items():
        x, y = np.concatenate(lines).T
        off = np.abs(terrain.height(x, y) - height) > 1e-5
        around = [
            terrain.height(x[off] + 1e-5 * i, y[off] + 1e-5 * j) for i in (-1, 1) for j in (-1, 1)
        ]
        assert (np.nanmax(around, axis=0) > height).all()
        assert (np.nanmin(around, axis=0) <= height).all()
        at_walls += np.count_nonzero(off)
    assert at_walls > 100


def test_lines_reach_the_rim(tmp_path: Path) -> None:
    """On a leaning plane each is one straight way from rim to rim, at the place worked out."""
    _, found = exported(terrain_of(PLANE), tmp_path / "c.geojson", 0.5)
    assert [*found] == [0.5 * k for k in range(1, 8)]
    for height, (line,) in found.items():
        # z = 3 (x - 4500) / 12 + (y + 320) / 8
        x, y = line[:, 0] - 4500, line[:, 1] + 320
        assert np.allclose(x / 4 + y / 8, height, atol=1e-8)
        on_rim = np.isclose(x, 0) | np.isclose(x, 12) | np.isclose(y, 0) | np.isclose(y, 8)
        assert on_rim[[0, -1]].all()


def test_a_wall_is_where_it_stands(tmp_path: Path) -> None:
    """Contours of a box lie upon its sides, whatever the pixels are."""
    definition = {
        "size": [9, 6], "origin": [1000, 2000],
        "elemTypes": {"flat": {"x": [0, 0]}, "box": {"x": [1]}},
        "elemTree": {"type": "flat", "children": [
            {"at": [3.517, 2.231], "extent": [2.1, 1.3], "type": "box", "vScale": 2}]},
    }  # fmt: skip
    _, found = exported(terrain_of(definition), tmp_path / "c.geojson", 0.75)
    assert [*found] == [0.75, 1.5]
    for (line,) in found.values():
        ring = shapely.Polygon(line)
        box = shapely.box(1002.467, 2001.581, 1004.567, 2002.881)
        # a corner is cut between two nodes
        assert shapely.hausdorff_distance(ring.boundary, box.boundary) < SIDE
        west, south, east, north = ring.bounds
        assert (west, south, east, north) == pytest.approx(box.bounds, abs=1e-7)


def test_level_ground_at_the_height_leaves_walls_where_they_are(tmp_path: Path) -> None:
    """Of a box and a pit on ground at 0, the contour of 0 is that of the box, which rises above."""
    box = {"type": "box", "extent": [2.03, 1.3]}
    definition = {
        "size": [9, 6], "origin": [1000, 2000],
        "elemTypes": {"flat": {"x": [0]}, "box": {"x": [1]}},
        "elemTree": {"type": "flat", "children": [
            {**box, "at": [3.13, 2.231], "vScale": 1}, {**box, "at": [6.9, 4.4], "vScale": -1}]},
    }  # fmt: skip
    _, found = exported(terrain_of(definition), tmp_path / "c.geojson", 0.5)
    assert [*found] == [-0.5, 0, 0.5]
    for height, at in (
        (-0.5, (1006.9, 2004.4)),
        (0, (1003.13, 2002.231)),
        (0.5, (1003.13, 2002.231)),
    ):
        (line,) = found[height]
        sides = (at[0] - 1.015, at[1] - 0.65, at[0] + 1.015, at[1] + 0.65)
        assert shapely.Polygon(line).bounds == pytest.approx(sides, abs=1e-7)


@pytest.mark.slow
@needs("gdal_contour")
def test_gdal_finds_the_same(tmp_path: Path) -> None:
    """Within two pixels; not if one of the two is mirrored, or moved by three."""
    terrain = terrain_of(SITE)
    _, found = exported(terrain, tmp_path / "c.geojson")
    export_dem(terrain, grid_over(terrain, SIDE), tmp_path / "a.tif", dtype="float64")
    subprocess.run(
        ["gdal_contour", "-q", "-a", "elev", "-i", "0.5", tmp_path / "a.tif", tmp_path / "g.json",
         "-f", "GeoJSON"],
        check=True, capture_output=True,
    )  # fmt: skip
    theirs = lines_of(tmp_path / "g.json")
    # GDAL does not go on to the rim
    inside = shapely.box(*terrain.bounds).buffer(-SIDE)
    common = [height for height in found if height in theirs]
    assert len(common) >= len(found) - 1 and len(found) > 10

    def apart(moved: tuple[float, float, float]) -> float:
        """The largest distance of a contour from that of GDAL, with mine mirrored or moved."""
        turned, east, north = moved
        west, _, right, _ = terrain.bounds
        most = 0.0
        for height in common:
            mine = [
                np.column_stack(
                    [(west + right - x if turned else x) + east * SIDE, y + north * SIDE]
                )
                for x, y in (line.T for line in found[height])
            ]
            both = [
                shapely.MultiLineString([*lines]).intersection(inside)
                for lines in (mine, theirs[height])
            ]
            most = max(most, shapely.hausdorff_distance(*both))
        return most

    assert apart((0, 0, 0)) < 2 * SIDE
    assert apart((1, 0, 0)) > 20 * SIDE
    assert apart((0, 3, 0)) > 2 * SIDE and apart((0, 0, -3)) > 2 * SIDE


class TestFiles:
    """What the two formats hold."""

    @needs("ogr2ogr")
    def test_both_hold_the_same_for_gdal(self, tmp_path: Path) -> None:
        """Lines, heights and the reference system, and a package that it finds no fault with."""
        terrain = terrain_of(SITE)
        # other tests open strangers' rasters with drivers left out, which GDAL's tools remark on
        clean = {name: value for name, value in os.environ.items() if "GDAL" not in name}
        told = []
        for name in ("c.gpkg", "c.geojson"):
            export_contours(terrain, tmp_path / name, ContourRequest(SIDE, interval=0.5))
            done = subprocess.run(
                ["ogr2ogr", "-f", "GeoJSON", tmp_path / "out.json", tmp_path / name],
                capture_output=True, text=True, check=True, env=clean,
            )  # fmt: skip
            assert done.stdout == done.stderr == ""
            read = json.loads((tmp_path / "out.json").read_text("utf-8"))
            assert read["crs"]["properties"]["name"] == "urn:ogc:def:crs:EPSG::32633"
            told.append(read["features"])
            (tmp_path / "out.json").unlink()
        assert len(told[0]) == len(told[1]) > 20
        for one, other in zip(*told, strict=True):
            assert one["properties"] == other["properties"]
            lines = [shape(feature["geometry"]) for feature in (one, other)]
            assert lines[0].equals_exact(lines[1], 1e-6)

    @pytest.mark.parametrize(
        ("crs", "number", "maker"),
        [
            (None, -1, "NONE"),
            ("EPSG:4326", 4326, "EPSG"),
            ("EPSG:32633", 32633, "EPSG"),
            ("+proj=tmerc +lat_0=3 +lon_0=7 +k=1 +ellps=GRS80 +units=m", 100000, "NONE"),
            ("+proj=utm +zone=33 +ellps=GRS80 +units=m", 100000, "NONE"),  # not that of ETRS89
            ("ESRI:102003", 100000, "ESRI"),
        ],
    )
    def test_a_package_names_its_system(
        self, tmp_path: Path, crs: str | None, number: int, maker: str
    ) -> None:
        definition = {**PLANE, "origin": [3, 4], "descr": "a \x1b[31m plane"}
        definition |= {} if crs is None else {"crs": crs}
        path = tmp_path / "c.gpkg"
        export_contours(terrain_of(definition), path, ContourRequest(SIDE, interval=0.5))
        with sqlite3.connect(path) as base:
            assert base.execute("PRAGMA application_id").fetchone() == (0x47504B47,)
            assert base.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            assert not base.execute("PRAGMA foreign_key_check").fetchall()
            columns = base.execute("PRAGMA table_info(gpkg_contents)").fetchall()
            default = {column[1]: column[4] for column in columns}["last_change"]
            assert default == "strftime('%Y-%m-%dT%H:%M:%fZ','now')"  # OGC 12-128r17, table 4
            (row,) = base.execute("SELECT * FROM gpkg_contents").fetchall()
            assert "\x1b" not in row[3] and row[3].endswith(" plane")
            assert row[-1] == number and row[5:9] == pytest.approx((3, 4, 15, 12))
            (known,) = base.execute(
                "SELECT organization FROM gpkg_spatial_ref_sys WHERE srs_id = ?", (number,)
            ).fetchall()
            assert known == (maker,)
            heights = base.execute("SELECT elev FROM contours ORDER BY fid").fetchall()
            (geometry,) = base.execute("SELECT geom FROM contours WHERE elev = 2.5").fetchone()
        assert heights == [(0.5 * k,) for k in range(1, 8)]
        # z = (x - 3) / 4 + (y - 4) / 8 is 2.5 from the north-west, (9, 12), to (13, 4) at the south
        assert geometry[:2] == b"GP" and struct.unpack_from("<i", geometry, 4) == (number,)
        assert struct.unpack_from("<4d", geometry, 8) == pytest.approx((9, 13, 4, 12))
        line = shapely.from_wkb(geometry[40:])
        assert line.bounds == pytest.approx((9, 4, 13, 12))

    @needs("ogrinfo")
    def test_a_package_has_an_index_that_gdal_takes_and_keeps(self, tmp_path: Path) -> None:
        """It finds the lines of a place by it, and what it takes away goes from the index, too."""
        path = tmp_path / "c.gpkg"
        export_contours(terrain_of(PLANE), path, ContourRequest(SIDE, interval=0.5))
        clean = {name: value for name, value in os.environ.items() if "GDAL" not in name}

        def asked(*words: object) -> str:
            done = subprocess.run(["ogrinfo", *map(str, words)], capture_output=True, text=True,
                                  check=True, env=clean)  # fmt: skip
            assert "ERROR" not in done.stderr + done.stdout
            return done.stdout

        assert " = 1\n" in asked(path, "-sql", "SELECT HasSpatialIndex('contours', 'geom')")
        # z = (x - 4500) / 4 + (y + 320) / 8; 0.25 m around where it is 1
        near = asked("-ro", "-al", path, "-spat", 4503.75, -320, 4504.25, -319.75)
        assert re.findall(r"elev \(Real\) = (.*)", near) == ["1"]
        asked(path, "-sql", "DELETE FROM contours WHERE elev = 1")
        with sqlite3.connect(path) as base:
            held = base.execute("SELECT id FROM rtree_contours_geom ORDER BY id").fetchall()
            assert held == base.execute("SELECT fid FROM contours ORDER BY fid").fetchall()
        assert len(held) == 6

    def test_a_package_without_an_index_is_written_where_sqlite_has_none(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        class Plain(sqlite3.Connection):
            def execute(self, text: str, *more: Any) -> sqlite3.Cursor:
                return super().execute(text.replace("'rtree'", "'absent'"), *more)

        connect = sqlite3.connect
        monkeypatch.setattr(
            "terratool.io.geopackage.sqlite3.connect",
            lambda *a, **k: connect(*a, factory=Plain, **k),
        )
        path = tmp_path / "c.gpkg"
        export_contours(terrain_of(PLANE), path, ContourRequest(SIDE, interval=0.5))
        monkeypatch.undo()
        with sqlite3.connect(path) as base:
            assert base.execute("SELECT count(*) FROM contours").fetchone() == (7,)
            names = {name for (name,) in base.execute("SELECT name FROM sqlite_master")}
        assert not [name for name in names if "rtree" in name or "extensions" in name]

    @pytest.mark.parametrize("name", ["c.gpkg", "c.geojson"])
    def test_the_same_terrain_gives_the_same_bytes(self, tmp_path: Path, name: str) -> None:
        texts = []
        for folder in ("a", "b"):
            (tmp_path / folder).mkdir()
            path = tmp_path / folder / name
            export_contours(terrain_of(SITE), path, ContourRequest(SIDE))
            texts.append(path.read_bytes())
            assert [one.name for one in path.parent.iterdir()] == [name]
        assert texts[0] == texts[1]


def test_heights_are_decimals() -> None:
    """As people write them: 0.3, not three times the double of 0.1."""
    assert contour_heights(-0.25, 0.4, 0.1, 99) == [-0.2, -0.1, 0.0, 0.1, 0.2, 0.3]
    assert contour_heights(0.0, 2.0, 0.5, 99) == [0.5, 1.0, 1.5]


def test_a_line_ends_where_nothing_is_known() -> None:
    """At a void in the middle a contour is in two pieces."""
    z = np.tile(np.arange(7.0), (9, 1))
    (whole,) = dict(trace_contours(z, [2.5]))[2.5]
    assert sorted(whole[[0, -1], 1]) == [0, 8] and (whole[:, 0] == 2.5).all()
    z[4, 2] = np.nan
    first, second = dict(trace_contours(z, [2.5]))[2.5]
    assert first[:, 1].max() == 3.5 and second[:, 1].min() == 4.5


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["c.tif", "--layer", "contours"], ".geojson, .json or .gpkg"),
        (["c.gpkg", "--layer", "contours", "--layer", "height"], "one file cannot hold both"),
        (["c.gpkg", "--layer", "contours", "--cog"], "--cog is about rasters"),
        (["c.gpkg", "--layer", "contours", "--nodata", "-1"], "--nodata is about rasters"),
        (["c.gpkg", "--layer", "contours", "--interval", "0"], "--interval above 0"),
        (["c.gpkg", "--layer", "contours", "--interval", "1e-9"], "Give at least"),
        (["c.gpkg", "--layer", "contours", "--resolution", "1e-6"], "coarser --resolution"),
        (["c.gpkg", "--layer", "contours", "--bounds", 50, 50, 60, 60], "miss the terrain"),
        (
            ["c.gpkg", "--layer", "contours", "--resolution", 1, "--bounds", 1, 1, 1.4, 5],
            "Give a --resolution of at most 0.8",
        ),
        (
            ["c.gpkg", "--layer", "contours", "--resolution", 1, "--bounds", 1, 1, 5, 1.4],
            "no pixel has its centre in 1 1 5 1.4.",
        ),
        (["c.tif", "--interval", "1"], "Add --layer contours"),
        (["--layer", "contours"], "'OUT'"),
    ],
)
def test_what_is_refused(tmp_path: Path, words: list[Any], said: str) -> None:
    """In a sentence, and no file is left."""
    file = tmp_path / "yard.json"
    file.write_text(json.dumps(YARD), encoding="utf-8")
    out = [tmp_path / word if str(word)[:2] == "c." else word for word in words]
    ran = call("export-dem", file, *out)
    assert ran.code == 2 and said in ran.err, ran.err
    assert [path.name for path in tmp_path.iterdir()] == ["yard.json"]


def test_the_command_says_what_it_wrote(tmp_path: Path) -> None:
    """In words, and as JSON; level ground has no contours, and the file says so."""
    file, out = tmp_path / "plane.json", tmp_path / "c.geojson"
    file.write_text(json.dumps(PLANE), encoding="utf-8")
    asked = ("export-dem", file, out, "--layer", "contours", "--interval", "1")
    ran = call(*asked, "--resolution", "0.1", "--json")
    told = json.loads(ran.out)
    assert (told["lines"], told["heights"], told["width"], told["height"]) == (3, [1, 3], 122, 82)
    assert "exists already" in call(*asked).err
    level = {**PLANE, "elemTypes": {"p": {"x": [1]}}}
    file.write_text(json.dumps(level), encoding="utf-8")
    ran = call("export-dem", file, out, "--layer", "contours", "--overwrite")
    assert ran.code == 0 and "the ground is level" in ran.out
    assert lines_of(out) == {}


def test_a_part_has_the_lines_of_the_whole(tmp_path: Path) -> None:
    """Cut at the bounds, or at the rim where these reach beyond it."""
    terrain = terrain_of(SITE)
    whole = exported(terrain, tmp_path / "a.geojson")[1]
    bounds = (500003.0, 4649770.0, 500009.03, 4649790.0)
    part = exported(terrain, tmp_path / "b.geojson", bounds=bounds)[1]
    cut = shapely.box(*bounds)
    for height, lines in part.items():
        wanted = shapely.MultiLineString([*whole[height]]).intersection(cut)
        assert shapely.hausdorff_distance(shapely.MultiLineString([*lines]), wanted) < SIDE / 4
    points = np.concatenate([line for lines in part.values() for line in lines])
    assert points.min(axis=0)[0] == 500003 and points.max(axis=0)[0] == 500009.03
