"""What a crs may be: nothing that has a library open a file or the net."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rasterio.crs import CRS

from terratool.definition.crs import (
    AuthorityCode,
    authority_code,
    crs_problem,
    is_geographic,
    is_known,
    metric_crs,
)
from terratool.definition.reader import check
from terratool.errors import RequestError
from terratool.io.crs import read_crs
from terratool.sensing.map_files import MapOutput
from terratool.text.source import Source
from terratool.traversability.ruts import deform
from terratool.traversability.vehicle_files import load_vehicle
from tests.commands import ROOT, call

BOX = {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "vScale": 1}}
WEB_MERCATOR = (
    "+proj=merc +a=6378137 +b=6378137 +lat_ts=0 +lon_0=0 +x_0=0 +y_0=0 +k=1 +units=m "
    "+nadgrids=@null +wktext +no_defs"
)


@pytest.mark.parametrize(
    ("crs", "epsg"),
    [
        ("EPSG:32633", 32633), ("epsg:32633", 32633), (32633, 32633), (" EPSG:32633 ", 32633),
        ("urn:ogc:def:crs:EPSG::32633", 32633), ("urn:ogc:def:crs:EPSG:9.8:32633", 32633),
        ("WGS84", 4326), ("http://www.opengis.net/def/crs/EPSG/0/32633", 32633),
        ("IAU_2015:30100", None), ("EPSG:32633+5773", None),
        ("OGC:CRS84", None), ("ESRI:54009", None),
        ("+proj=utm +zone=33 +datum=WGS84 +units=m +no_defs", 32633), (WEB_MERCATOR, None),
        ({"proj": "utm", "zone": 33, "datum": "WGS84", "south": False}, 32633),
    ],
)  # fmt: skip
def test_what_is_taken(crs: Any, epsg: int | None) -> None:
    assert crs_problem(crs) is None
    found = read_crs(crs)
    assert found.to_wkt()
    assert epsg is None or found.to_epsg() == epsg


@pytest.mark.parametrize("code", [2056, 27700, 3031, 3857, 4258, 4326, 32633, 32755])
@pytest.mark.parametrize("version", ["WKT1_GDAL", "WKT1_ESRI", "WKT2_2015", "WKT2_2019"])
def test_what_libraries_write_is_taken(code: int, version: str) -> None:
    """WKT in its dialects, and PROJJSON as an object and as a text."""
    whole = CRS.from_epsg(code)
    written = whole.to_wkt(version=version)
    assert crs_problem(written) is None
    assert read_crs(written).to_wkt()
    projjson = whole.to_dict(projjson=True)
    assert crs_problem(projjson) is None and crs_problem(json.dumps(projjson)) is None
    assert read_crs(projjson) == whole


COMPOUND = (5554, 7415, 9518)
CODES = [2056, 3031, 3857, 4258, 4326, 4936, 4937, 4979, *COMPOUND, 27700, 32633]
"""Codes of EPSG: projected, geographic in two and three dimensions, geocentric, compound."""


@pytest.mark.parametrize("code", CODES)
def test_degrees_are_known_as_proj_knows_them(code: int) -> None:
    """By code, and in WKT of all dialects, PROJJSON and the parameters of PROJ."""
    import pyproj

    whole = pyproj.CRS.from_epsg(code)
    wanted = (whole.sub_crs_list or [whole])[0].is_geographic
    spelled = [code, f"EPSG:{code}", f"urn:ogc:def:crs:EPSG::{code}", whole.to_json_dict()]
    spelled += [whole.to_json(), f" {whole.to_wkt()} "]
    for version in ("WKT1_GDAL", "WKT1_ESRI", "WKT2_2015", "WKT2_2019_SIMPLIFIED"):
        try:
            spelled.append(whole.to_wkt(version, pretty=True))
        except pyproj.exceptions.CRSError:  # no dialect has all systems
            assert version.startswith("WKT1")
    spelled.append(CRS.from_epsg(code).to_proj4() if code not in COMPOUND else None)
    found = {str(one): is_geographic(one) for one in spelled if one}
    assert found == dict.fromkeys(found, wanted) and len(found) > 5


@pytest.mark.parametrize(
    ("crs", "wanted"),
    [
        ("OGC:CRS84", True), ("wgs84", True), ("EPSG:4326+5773", True), ("EPSG:32633+5773", False),
        ("IAU_2015:30100", True), ("IAU_2015:30135", False), ("EPSG:99999999", False),
        ("+proj=latlong +datum=WGS84", True), ("+proj=utm +zone=33", False),
        ("+proj=ob_tran +o_proj=longlat +o_lon_p=0 +o_lat_p=39", True),
        ({"proj": "longlat"}, True), ({"proj": "utm", "zone": 33}, False),
        ('PROJCRS["longlat GEOGCRS[", BASEGEOGCRS["WGS 84"]]', False),
        ('BOUNDCRS[SOURCECRS[GEOGCRS["a"]],TARGETCRS[PROJCRS["b"]]]', True),
        ({"type": "BoundCRS", "source_crs": {"type": "GeographicCRS"}}, True),
        ({"type": "CompoundCRS", "components": [{"type": "ProjectedCRS"}]}, False),
        ('LOCAL_CS["site"]', False),
    ],
)  # fmt: skip
def test_degrees_of_other_texts(crs: Any, wanted: bool) -> None:
    assert is_geographic(crs) is wanted


def test_without_a_database_the_well_known_are_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terratool.definition.crs._database", lambda: None)
    assert is_geographic(4326) and is_geographic("NAD27") and not is_geographic("EPSG:4258")


@pytest.mark.parametrize(
    ("place", "code"),
    [((15.1, 45), 32633), ((-180, 1), 32601), ((180, -1), 32701), ((-70.5, -33), 32719)],
)
def test_the_zone_that_is_named_holds_the_place(place: tuple[float, float], code: int) -> None:
    """The area of use that PROJ has for the code holds the place, too."""
    import pyproj

    assert metric_crs("EPSG:4326", *place) == f"EPSG:{code}"
    area = pyproj.CRS.from_epsg(code).area_of_use
    assert area is not None
    assert area.west <= place[0] % -360 <= area.east or area.west <= place[0] <= area.east
    assert area.south <= place[1] <= area.north


BAD = [
    "http://127.0.0.1:8799/crs", "HTTPS://example.com/a.wkt", "/vsicurl/http://example.com/a",
    "ftp://example.com/x", "file:///etc/passwd", "/etc/passwd", "site.prj",
    "./site.prj", "@site.prj",
    "ESRI::site.prj", "+init=epsg:4326", "init=epsg:4326", "proj=utm zone=33",
    "+proj=longlat +nadgrids=shift.gsb",
    "+proj=longlat +nadgrids=@shift.gsb", "+proj=longlat +nadgrids=@null,shift.gsb",
    "+proj=utm +zone=33 +geoidgrids=egm96.gtx", "+proj=longlat +ellps=/etc/passwd",
    "+proj=pipeline +step +proj=utm +zone=33", "+proj=utm +zone=33 @site.prj", "nonsense", "",
    "+proj=utm +zone=33\n+nadgrids=shift.gsb", {"init": "epsg:4326"}, {"a": 1}, {},
    {"proj": "longlat", "nadgrids": "shift.gsb"}, {"type": 3}, 0, -4326, 10**400,
    'PROJCS["x",EXTENSION["PROJ4","+proj=utm +nadgrids=shift.gsb"]]',
    'BOUNDCRS[SOURCECRS[],ABRIDGEDTRANSFORMATION["a",PARAMETERFILE["f","shift.gsb"]]]',
    {"type": "BoundCRS", "transformation": {"parameters": [{"name": "f", "value": "shift.gsb"}]}},
    'GEOGCS["x",DATUM["y",SPHEROID["z",6378137,298],EXTENSION["PROJ4_GRIDS","/a.gsb"]]]',
    'BOUNDCRS[SOURCECRS[],ABRIDGEDTRANSFORMATION["a",PARAMETERFILE("f","/a.gsb")]]',
    'PROJCS["x",EXTENSION["PROJ4","+proj=defmodel +model=/a.json"]]',
    'PROJCS["x",EXTENSION["PROJ4","+proj=merc +nadgrids=@null.gsb"]]',
    'BOUNDCRS[METHOD["PROJ-based operation method: +proj=defmodel +model=/a.json"]]',
    {"type": "BoundCRS", "method": {"name": "PROJ-based operation method: +proj=x"}},
    "EPSG:32633.0", "EPSG:3.2633E4", "EPSG:032633", "EPSG:3E4",
    "IMPORT_FROM_WKT", "AUTO:42001,12,55", '{"type": ', "[" * 200_000,
]  # fmt: skip


@pytest.mark.parametrize("crs", BAD, ids=lambda crs: str(crs)[:30])
def test_what_is_not(crs: Any) -> None:
    problem = crs_problem(crs)
    assert problem is not None and problem.message.endswith(".") and problem.hint
    with pytest.raises(RequestError):
        read_crs(crs)
    data = json.dumps({**BOX, "crs": crs}).encode()
    assert {f.code for f in check(Source("a", data)).findings} <= {"TT114", "TT107"}
    assert check(Source("a", data)).terrain is None


def test_an_object_that_is_nested_deep() -> None:
    deep: Any = {}
    for _ in range(3000):
        deep = {"a": deep}
    assert crs_problem({"type": "GeographicCRS", **deep}) is not None


def test_codes_are_looked_up() -> None:
    """What the database does not have is a warning, and no name of a file is tried."""
    assert authority_code("ESRI:54009") == AuthorityCode("ESRI", "54009")
    assert is_known(AuthorityCode("EPSG", "32633")) is True
    assert is_known(AuthorityCode("EPSG", "32633+5773")) is True
    assert is_known(AuthorityCode("EPSG", "32633+1")) is False
    data = json.dumps({**BOX, "crs": "EPSG:326333"}).encode()
    assert [f.code for f in check(Source("a", data)).findings] == ["TT115"]


def test_no_database(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without PROJ nothing is known of a code, and nothing is said."""
    monkeypatch.setattr("terratool.definition.crs._database", lambda: None)
    assert is_known(AuthorityCode("EPSG", "326333")) is None
    data = json.dumps({**BOX, "crs": "EPSG:326333"}).encode()
    assert not check(Source("a", data)).findings


def test_a_file_of_that_name_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file whose name is a code that nobody knows is not taken for what is in it."""
    monkeypatch.chdir(tmp_path)
    for name in ("IAU_2015:1", "site.prj"):
        (tmp_path / name).write_text(CRS.from_epsg(32633).to_wkt(), encoding="utf-8")
        with pytest.raises(RequestError):
            read_crs(name)


def test_nobody_is_asked(server: tuple[str, list[str]], tmp_path: Path) -> None:
    """The definition of a stranger has no command talk to an address."""
    url, asked = server
    path = tmp_path / "site.json"
    path.write_text(json.dumps({**BOX, "crs": url}), encoding="utf-8")
    assert call("validate", path).code == 1
    assert call("export-dem", path, tmp_path / "out.tif").code == 1
    assert asked == []


DEGREES = {
    "size": [0.02, 0.01], "origin": [15.1, 45.2], "crs": "EPSG:4326",
    "surfTypes": {"sand": {"preset": "dry-sand"}},
    "elemTypes": {"hill": {"x": [0, 1, 0]}},
    "elemTree": {"type": "hill", "surface": "sand", "vScale": 300},
}  # fmt: skip
VEHICLE = ("--vehicle", ROOT / "samples" / "vehicles" / "husky-a200.json")
LIDAR = ROOT / "samples" / "sensors" / "velodyne-vlp-16.json"


@pytest.mark.parametrize(
    "line",
    [
        ("traversability", "t.json", *VEHICLE),
        ("traversability", "t.json", *VEHICLE, *VEHICLE[:1], VEHICLE[1].with_stem("warthog")),
        ("export-sim", "t.json", "sim", "--target", "gazebo"),
        ("export-sim", "t.json", "sim", "--target", "nav2", *VEHICLE),
        ("scan", "t.json", "o.ply", "--sensor", LIDAR, "--pose", 15.11, 45.205, 2, 0, 0, 0),
        ("export-dem", "t.json", "o.tif", "--layer", "slope"),
        ("export-dem", "t.json", "--tiles", "o", "--layer", "height", "--layer", "aspect"),
        ("export-dem", "t.json", "o.tif", "--layer", "normal"),
        ("export-dem", "t.json", "o.tif", "--layer", "hillshade"),
        ("render", "t.json", "o.png", "--layer", "slope"),
        ("render", "t.json", "o.png", "--layer", "traversability", *VEHICLE),
    ],
    ids=lambda line: " ".join(map(str, line[:5:2])),
)
def test_what_needs_lengths_refuses_degrees(
    line: tuple[Any, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the option of the import that mends it, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    Path("t.json").write_text(json.dumps(DEGREES), "utf-8")
    before = set(Path().iterdir())
    ran = call(*line)
    assert ran.code == 2
    assert "degrees" in ran.err and "--crs EPSG:32633" in ran.err
    assert set(Path().iterdir()) == before


def test_ruts_and_maps_of_robots_refuse_degrees(tmp_path: Path) -> None:
    checked = check(Source("t.json", json.dumps(DEGREES).encode()))
    path = np.array([[15.105, 45.205], [15.11, 45.205]])
    with pytest.raises(RequestError, match="degrees") as refused:
        deform(checked, load_vehicle(VEHICLE[1]), path)
    assert "--crs EPSG:32633" in refused.value.hint
    with pytest.raises(RequestError, match="degrees") as refused:
        MapOutput(tmp_path / "o.tif", 1, crs="EPSG:4326").check()
    assert "--crs" in refused.value.hint


def test_heights_and_surfaces_need_no_lengths(tmp_path: Path) -> None:
    (tmp_path / "t.json").write_text(json.dumps(DEGREES), "utf-8")
    ran = call("export-dem", tmp_path / "t.json", tmp_path / "o.tif", "--layer", "height")
    assert ran.code == 0, ran.err
