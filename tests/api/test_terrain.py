"""A terrain's verbs against the field, other readers, and the commands that do the same."""

from __future__ import annotations

import io
import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

import terratool
from tests.commands import ROOT, YARD, call
from tests.storey_examples import DEFINITIONS

# Oblong, away from zero, with a ramp that rises to the north-east and one high box in a corner.
SITE: dict[str, Any] = {
    "descr": "Slope <with> a box",
    "size": [12, 8],
    "origin": [500000, 4649776],
    "crs": "EPSG:32633",
    "surfTypes": {
        "sand": {"fricAngle": 30, "color": [200, 180, 90]}, "rock": {"color": [90, 90, 99]},
    },
    "elemTypes": {"slope": {"x": [0, 1], "y": [0, 1], "combine": "sum"}, "box": {"x": [1]}},
    "elemTree": {
        "type": "slope", "vScale": 3, "surface": "sand", "cells": [12, 8],
        "children": [
            {"cellX": 9, "cellY": 1, "span": [2, 1], "type": "box", "vScale": 2, "surface": "rock"},
        ],
    },
}  # fmt: skip
HUSKY = ROOT / "samples/vehicles/husky-a200.json"
LIDAR = ROOT / "samples/sensors/velodyne-vlp-16.json"
POSE = (500003.0, 4649780.0, 0.0, 30.0, 0.0, 0.0)


@pytest.fixture
def terrain() -> terratool.Terrain:
    return terratool.load(SITE)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "site.json"
    path.write_text(json.dumps(SITE), "utf-8")
    return path


def test_noise_of_rounding_is_no_relief() -> None:
    """cos(π t) is 0 half way down from its middle only up to 6e-17."""
    definition = terratool.Definition(size=(10, 7))
    definition.primitive("flat", x=[0])
    definition.primitive("dent", x="cos(pi*t)", combine="radial")
    definition.root("flat", cells=(5, 4)).add("dent", cell=(1, 1), span=(3, 2), v_scale=0.55)
    terrain = definition.compile()
    assert terrain.relief is not None and abs(terrain.relief[1]) < 1e-15
    assert terrain.facts["relief"] == "−0.55 to 0 m" and "relief    −0.55 to 0 m\n" in str(terrain)


# --- reading --------------------------------------------------------------------------------------


def test_a_definition_comes_in_any_form(file: Path) -> None:
    import gzip

    text = json.dumps(SITE)
    definition = terratool.Definition(**{key: SITE[key] for key in ("size", "origin", "crs")})
    definition.surface("sand"), definition.surface("rock")
    definition.primitive("slope", **SITE["elemTypes"]["slope"])
    definition.primitive("box", x=[1])
    definition.root("slope", v_scale=3, surface="sand", cells=(12, 8)).add(
        "box", cell=(9, 1), span=(2, 1), v_scale=2, surface="rock"
    )
    forms = [file, str(file), text, "\n " + text, text.encode(), b"\xef\xbb\xbf" + text.encode(),
             gzip.compress(text.encode()), SITE, definition, terratool.load(SITE)]  # fmt: skip
    x, y = [500009.5, 500001.5], [4649777.5, 4649783.0]
    for form in forms:
        # 12 × 8 with a slope of 3 each way; the box of 2 stands at the first point
        assert terratool.load(form).height(x, y) == pytest.approx(
            [3 * 9.5 / 12 + 3 * 1.5 / 8 + 2, 3 * 1.5 / 12 + 3 * 7 / 8], abs=1e-9
        )
    assert terratool.load(file).name == "site.json"
    assert terratool.load(SITE).name == ""


@pytest.mark.parametrize(
    ("form", "kind", "says"),
    [
        ('{"size": 3}', "DefinitionError", "the definition:1:1: TT104"),
        (b"\x1f\x8b\x08 no gzip", "ReadError", "the definition"),
        ({"size": {1, 2}}, "RequestError", "it holds a value of type set"),
        ("nowhere.json", "ReadError", "nowhere.json: cannot be read"),
        ({"mass": 3, "wheels": {}}, "DefinitionError", "is a vehicle, where a terrain is wanted"),
        (5, "RequestError", "of type int is given. Give the path of a file, JSON as text"),
        (None, "RequestError", "of type NoneType is given"),
        ([SITE], "RequestError", "of type list is given"),
    ],
)
def test_what_is_no_terrain_is_refused(form: Any, kind: str, says: str) -> None:
    with pytest.raises(getattr(terratool, kind)) as error:
        terratool.load(form)
    assert says in str(error.value)
    assert "terratool validate" not in str(error.value)


@pytest.mark.parametrize("verb", ["height", "surface", "element", "normal", "sample", "locate"])
def test_points_that_are_none_are_refused(verb: str, terrain: terratool.Terrain) -> None:
    ask = getattr(terrain, verb)
    for x, y in (("a", 1), (1, {}), ([[1, 2], [3]], 4), (500001.0, object())):
        with pytest.raises(terratool.RequestError, match=r"^A coordinate is no number\. Give num"):
            ask(x, y)
    with pytest.raises(terratool.RequestError, match=r"x has the shape \(2,\), but y \(3,\)\."):
        ask([1, 2], [1, 2, 3])
    if verb in ("height", "normal", "sample"):
        with pytest.raises(terratool.RequestError, match=r"^below is no number\. Give numbers"):
            ask(1, 2, below="a")
        with pytest.raises(terratool.RequestError, match=r"\(2,\), but below \(3,\)\. Give arr"):
            ask([1, 2], [1, 2], below=[1, 2, 3])
    with pytest.raises(terratool.RequestError, match="direction or range is no number"):
        terrain.cast([1, 2, 3], ["a", 2, 3])


def test_contours_are_a_height_or_auto(terrain: terratool.Terrain) -> None:
    for wrong in (-1, 0.0, float("nan")):
        with pytest.raises(terratool.RequestError, match=r"^Contours are to be .*Give a finite"):
            terrain.render(contours=wrong)
    for wrong in ("slop", "0.5"):
        with pytest.raises(terratool.RequestError, match=r'^contours is .*Give a number or "auto"'):
            terrain.render(contours=wrong)


def test_libraries_lie_where_roots_say(tmp_path: Path) -> None:
    (tmp_path / "kit").mkdir()
    library = {"elemTypes": {"box": {"x": [1]}}}
    (tmp_path / "kit/kit.json").write_text(json.dumps(library), "utf-8")
    site = tmp_path / "sites/a.json"
    site.parent.mkdir()
    text = {"size": 2, "use": ["../kit/kit.json"], "elemTree": {"type": "box", "vScale": 3}}
    site.write_text(json.dumps(text), "utf-8")
    with pytest.raises(terratool.DefinitionError):
        terratool.load(site)
    for root in (tmp_path, str(tmp_path), [tmp_path], (str(tmp_path),)):
        terrain = terratool.load(site, root)
        assert terrain.height(1, 1) == 3
        assert terratool.check(site, library_roots=root).terrain is not None
    assert terrain.diff(terrain).same  # reads its text once more
    # a terrain knows its folder and its roots
    again = terratool.load(terrain)
    assert (again.name, again.height(1, 1)) == ("a.json", 3)
    assert terratool.load(again, tmp_path / "kit").height(1, 1) == 3
    assert terratool.check(terrain).findings == terratool.check(site, tmp_path).findings


def test_a_check_takes_the_options_of_the_command() -> None:
    steep = {**SITE, "surfTypes": {**SITE["surfTypes"], "unused": {}}}
    codes = [one.code for one in terratool.check(steep).findings]
    assert codes.count("TT205") == 1
    left = terratool.check(steep, ignore=["TT205"]).findings
    assert [one.code for one in left] == [one for one in codes if one != "TT205"]
    assert terratool.check(SITE, max_step=0.5).findings
    assert terratool.check(HUSKY, kind=None).vehicle is not None


def test_a_terrain_survives_another_process(terrain: terratool.Terrain) -> None:
    again = pickle.loads(pickle.dumps(terrain))
    assert type(again) is terratool.Terrain
    assert again.height(500009.5, 4649777.5) == terrain.height(500009.5, 4649777.5)
    assert again.diff(terrain).same


# --- showing itself -------------------------------------------------------------------------------


def test_it_says_what_it_is(terrain: terratool.Terrain) -> None:
    assert str(terrain).splitlines() == [
        "Slope <with> a box",
        "size      12 × 8 m",
        "elements  2",
        "surfaces  sand and rock",
        "relief    0 to 6 m",
        "crs       EPSG:32633",
    ]
    assert repr(terrain) == "<Terrain of 12 × 8, 2 elements: Slope <with> a box>"
    void = {**SITE, "surfTypes": {"sand": {"void": True}, "rock": {"void": True}}, "crs": None}
    del void["crs"]
    assert "relief    none, all is void\ncrs       none" in str(terratool.load(void))


@pytest.mark.slow
def test_a_picture_is_drawn_when_it_is_shown_and_once(
    terrain: terratool.Terrain, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    from PIL import Image

    from terratool.viewing import render

    drawn = []
    draw = render.png_of
    monkeypatch.setattr(render, "png_of", lambda *args: drawn.append(1) or draw(*args))
    str(terrain), repr(terrain)
    assert drawn == []
    html, png = terrain._repr_html_(), terrain._repr_png_()
    assert drawn == [1]
    assert "Slope &lt;with&gt; a box" in html and "<with>" not in html
    assert "<td style='text-align: left'>0 to 6 m</td>" in html
    assert "data:image/png;base64," in html
    wide, tall = Image.open(io.BytesIO(png)).size
    assert wide == 560 and tall < wide


def test_without_matplotlib_the_table_is_left(
    terrain: terratool.Terrain, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    assert terrain._repr_png_() is None
    assert "<img" not in terrain._repr_html_() and "12 × 8 m" in terrain._repr_html_()


# --- arrays ---------------------------------------------------------------------------------------


def test_a_dem_has_the_heights_of_the_field(terrain: terratool.Terrain) -> None:
    dem = terrain.to_dem(resolution=0.5, layers=["height", "surface", "slope"], dtype="float64")
    assert dem.shape == (16, 24) and list(dem.bands) == ["height", "surface", "slope"]
    x, y = np.meshgrid(dem.x, dem.y)
    assert dem["height"] == pytest.approx(terrain.height(x, y), abs=1e-12)
    assert np.array_equal(dem.array, dem["height"]) and np.asarray(dem).shape == (16, 24)
    assert (dem.x[0], dem.y[0]) == (500000.25, 4649783.75)  # the north-west
    names = np.array([None, *dem.surfaces], object)[dem["surface"]]
    assert np.array_equal(names, terrain.surface(x, y))
    # a slope of 3 over 12 and of 3 over 8
    assert dem["slope"][-1, 0] == pytest.approx(np.degrees(np.arctan(np.hypot(0.25, 0.375))))
    assert dem.crs.to_epsg() == 32633


def test_an_array_of_a_dem_has_its_heights_wherever_they_stand(terrain: terratool.Terrain) -> None:
    layers = ["surface", "slope", "color", "height"]
    dem = terrain.to_dem(resolution=1, layers=layers)
    assert list(dem.bands) == ["surface", "slope", "red", "green", "blue", "height"]
    x, y = np.meshgrid(dem.x, dem.y)
    assert np.asarray(dem) == pytest.approx(terrain.height(x, y), abs=1e-5)
    again = terratool.import_terrain(dem, max_error=0.01)
    assert np.abs(again.height(x, y) - terrain.height(x, y)).max() <= 0.0101
    slopes = terrain.to_dem(resolution=1, layers=["slope", "surface"])
    assert slopes.shape == (8, 12)
    says = r"^The DEM has no heights, but slope and surface\. Add \"height\" to its layers"
    for ask in (np.asarray, lambda dem: terratool.import_terrain(dem, max_error=0.1)):
        with pytest.raises(terratool.RequestError, match=says):
            ask(slopes)
    # of a single layer there is one array, which is no terrain
    alone = terrain.to_dem(resolution=1, layers="slope")
    assert np.array_equal(np.asarray(alone), slopes["slope"])
    with pytest.raises(terratool.RequestError, match="The DEM has no heights, but slope"):
        terratool.import_terrain(alone, max_error=0.1)


def test_a_dem_is_what_the_command_writes(
    terrain: terratool.Terrain, file: Path, tmp_path: Path
) -> None:
    """Read by another program: pixels, place and reference system."""
    options = ["--resolution", 0.3, "--bounds", 500002, 4649777, 500011, 4649781]
    assert call("export-dem", file, tmp_path / "a.tif", *options).code == 0
    dem = terrain.to_dem(resolution=0.3, bounds=(500002, 4649777, 500011, 4649781))
    with rasterio.open(tmp_path / "a.tif") as raster:
        assert np.array_equal(raster.read(1), dem.array)
        assert raster.transform == dem.transform and raster.crs == dem.crs


@pytest.mark.slow
def test_an_xarray_knows_places(terrain: terratool.Terrain) -> None:
    pytest.importorskip("xarray")
    array = terrain.to_dem(resolution=0.5, dtype="float64").to_xarray()
    assert array.dims == ("y", "x") and array.name == "height" and array.attrs["units"] == "m"
    there = array.sel(x=500009.75, y=4649777.25)
    assert float(there) == terrain.height(500009.75, 4649777.25) > 4
    assert "32633" in array.spatial_ref.attrs["crs_wkt"]
    west, dx, _, north, _, dy = map(float, array.spatial_ref.attrs["GeoTransform"].split())
    assert (west, dx, north, dy) == (500000, 0.5, 4649784, -0.5)
    several = terrain.to_dem(resolution=1, layers=["height", "surface"]).to_xarray()
    assert several.sel(band="surface", x=500009.5, y=4649777.5) == 2


@pytest.mark.slow
def test_a_mesh_lies_on_the_field(terrain: terratool.Terrain) -> None:
    mesh = terrain.to_mesh(max_error=0.01)
    assert mesh.bounds == pytest.approx(np.array([[500000, 4649776, 0], [500012, 4649784, 6]]))
    middle = mesh.triangles_center
    wall = mesh.face_attributes["wall"]
    heights = terrain.height(middle[~wall, 0], middle[~wall, 1])
    assert np.abs(middle[~wall, 2] - heights).max() <= 0.01
    assert wall.any() and np.abs(mesh.face_normals[wall, 2]).max() < 1e-6
    names = np.array([*mesh.metadata["surfaces"], None], object)
    found = names[mesh.face_attributes["surface"][~wall]]
    assert np.array_equal(found, terrain.surface(middle[~wall, 0], middle[~wall, 1]))
    assert len(np.unique(mesh.visual.face_colors, axis=0)) == 2
    # the box stands in the south-east
    high = middle[mesh.face_attributes["surface"] == mesh.metadata["surfaces"].index("rock")]
    assert high[:, 0].min() >= 500009 and high[:, 1].max() <= 4649778
    assert terrain.to_mesh(solid=True).is_volume


@pytest.mark.parametrize(
    ("origin", "zero"),
    [
        ("world", (0, 0, 0)),
        ("local", (500002, 4649777, 0)),
        ("center", (500006, 4649778.5, 0)),
        ([500001, 4649770, 2.5], (500001, 4649770, 2.5)),
    ],
    ids=str,
)
def test_a_mesh_has_its_zero_where_it_is_asked_for(
    terrain: terratool.Terrain, origin: Any, zero: tuple[float, float, float]
) -> None:
    """The world's by default; of a part, the corner and the middle are those of the part."""
    part = {"max_error": 0.1, "bounds": (500002, 4649777, 500010, 4649780)}
    world, mesh = terrain.to_mesh(**part), terrain.to_mesh(origin=origin, **part)
    assert world.bounds[0, :2].tolist() == [500002, 4649777]
    assert world.metadata["origin"] == (0, 0, 0) and mesh.metadata["origin"] == zero
    assert np.array_equal(mesh.faces, world.faces)
    assert np.allclose(mesh.vertices + np.array(zero), world.vertices, rtol=0, atol=1e-9)


def test_a_file_of_a_mesh_counts_from_its_corner(
    terrain: terratool.Terrain, tmp_path: Path
) -> None:
    """Unlike a mesh in memory, unless the world is asked for; the report says where the zero is."""
    import trimesh

    world = terrain.to_mesh(max_error=0.1)
    for options in ({}, {"origin": "world"}):
        path = tmp_path / "a.ply"
        report = terrain.write_mesh(path, max_error=0.1, overwrite=True, **options)
        assert report.origin == ((0, 0, 0) if options else (500000, 4649776, 0))
        written = trimesh.load(path, process=False)
        assert np.allclose(written.bounds + report.origin, world.bounds, rtol=0, atol=1e-6)


def test_a_mesh_in_memory_has_decks_and_bores() -> None:
    """Faces lie on tops and undersides, on the right side of what is solid."""
    definition = DEFINITIONS["car park"]
    terrain = terratool.load(definition)
    mesh = terrain.to_mesh(max_error=0.01)
    level = ~mesh.face_attributes["wall"]
    x, y, z = mesh.triangles_center[level].T
    up = mesh.face_normals[level, 2] > 0
    column = terrain.column(x, y)
    to_top = np.nanmin(np.abs(column.top - z[:, None]), axis=1)
    to_underside = np.nanmin(np.abs(column.bottom - z[:, None]), axis=1)
    assert np.where(up, to_top, to_underside).max() <= 0.01
    assert up.any() and not up.all()


# --- the commands ---------------------------------------------------------------------------------

BOTH: dict[str, tuple[str, list[Any], Callable[[Any, Path], object]]] = {
    "dem": ("a.tif", ["export-dem", "FILE", "OUT", "--resolution", 0.25, "--layer", "slope",
                      "--compress", "lzw"],
            lambda t, out: t.write_dem(out, resolution=0.25, layers=["slope"], compress="lzw")),
    "contours": ("a.geojson", ["export-dem", "FILE", "OUT", "--layer", "contours", "--resolution",
                               0.25, "--interval", 0.2],
                 lambda t, out: t.write_dem(out, layers=["contours"], resolution=0.25,
                                            interval=0.2)),
    "tiles": ("a/mosaic.vrt", ["export-dem", "FILE", "--tiles", "DIR", "--tile-size", 512],
              lambda t, out: t.write_dem(tiles=out.parent, tile_size=512)),
    "mesh": ("a.glb", ["export-mesh", "FILE", "OUT", "--max-error", 0.1, "--solid"],
             lambda t, out: t.write_mesh(out, max_error=0.1, solid=True)),
    "mesh of the world": ("a.ply", ["export-mesh", "FILE", "OUT", "--origin", "world"],
                          lambda t, out: t.write_mesh(out, origin="world")),
    "mesh about a point": ("a.obj", ["export-mesh", "FILE", "OUT",
                                        "--origin-at", 500001, 4649777, 1],
                           lambda t, out: t.write_mesh(out, origin=[500001, 4649777, 1])),
    "grid": ("a.wrl", ["export-mesh", "FILE", "OUT", "--elevation-grid", "--resolution", 1],
             lambda t, out: t.write_mesh(out, elevation_grid=True, resolution=1)),
    "tiles of a mesh": ("a/tiles.json", ["export-mesh", "FILE", "DIR.obj", "--tile-faces", 6],
                        lambda t, out: t.write_mesh(f"{out.parent}.obj", tile_faces=6)),
    "picture": ("a.png", ["render", "FILE", "OUT", "--layer", "slope", "--pixels", 600,
                          "--no-legend"],
                lambda t, out: t.render(out, layer="slope", pixels=600, legend=False)),
    "page": ("a.html", ["view", "FILE", "--output", "OUT", "--no-open", "--max-error", 0.1],
             lambda t, out: t.view(out, max_error=0.1)),
    "report": ("a.json", ["traversability", "FILE", "--vehicle", HUSKY, "--report", "OUT",
                          "--resolution", 0.5, "--route", 500001, 4649777, 500002, 4649782],
               lambda t, out: t.traversability(
                   HUSKY, report=out, resolution=0.5,
                   routes=[(500001, 4649777, 500002, 4649782)])),
    "map": ("a.tif", ["traversability", "FILE", "--vehicle", HUSKY, "--map", "OUT",
                      "--resolution", 1, "--headings", 4, "--model", "paper"],
            lambda t, out: t.traversability(HUSKY, map=out, resolution=1, headings=4,
                                            model="paper")),
    "scan": ("a.ply", ["scan", "FILE", "OUT", "--sensor", LIDAR, "--pose", *POSE, "--on-ground",
                       1.2, "--seed", 3, "--misses"],
             lambda t, out: t.write_scan(out, LIDAR, POSE, on_ground=1.2, seed=3, misses=True)),
}  # fmt: skip


@pytest.mark.parametrize("name", BOTH)
def test_a_verb_writes_what_its_command_writes(name: str, file: Path, tmp_path: Path) -> None:
    """Byte for byte."""
    out, words, write = BOTH[name]
    found = []
    for folder in ("command", "python"):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / out
        if folder == "command":
            places = {
                "FILE": file,
                "OUT": path,
                "DIR": path.parent,
                "DIR.obj": f"{path.parent}.obj",
            }
            assert call(*(places.get(str(word), word) for word in words)).code in (0, 1)
        else:
            write(terratool.load(file), path)
        found.append({
            one.relative_to(tmp_path / folder): one.read_bytes()
            for one in sorted((tmp_path / folder).rglob("*")) if one.is_file()
        })  # fmt: skip
    assert found[0].keys() == found[1].keys() and Path(out) in found[0]
    for one, data in found[0].items():
        if not one.name.startswith("."):  # the journal of tiles names their folder
            assert data == found[1][one], one


def test_simulators_get_the_same_files(file: Path, tmp_path: Path) -> None:
    options = {"max_error": 0.05, "origin": [500000, 4649776, 1], "friction": 0.5}
    terratool.load(file).export_sim(tmp_path / "python", ["gazebo", "pybullet"], **options)
    words = ["--target", "gazebo", "--target", "pybullet", "--max-error", 0.05, "--origin-at",
             500000, 4649776, 1, "--friction", 0.5]  # fmt: skip
    assert call("export-sim", file, tmp_path / "command", *words).code == 0
    written = [
        {one.relative_to(top): one.read_bytes() for one in top.rglob("*") if one.is_file()}
        for top in (tmp_path / "python", tmp_path / "command")
    ]
    assert written[0] == written[1] and len(written[0]) > 6


# --- answers --------------------------------------------------------------------------------------


def test_a_figure_is_one_of_matplotlib(terrain: terratool.Terrain) -> None:
    figure_type = pytest.importorskip("matplotlib.figure").Figure
    figure = terrain.render(pixels=500, dpi=100, layer="height")
    assert isinstance(figure, figure_type)
    assert max(figure.get_size_inches()) * figure.dpi == pytest.approx(500)
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png")  # outside of the settings that it was made with
    assert drawn.getbuffer().nbytes > 5000


def test_vehicles_are_files_or_vehicles(terrain: terratool.Terrain) -> None:
    asked = {"resolution": 0.5, "headings": 4}
    named = terrain.traversability(HUSKY, **asked)
    given = terrain.traversability(terratool.load_vehicle(HUSKY), **asked)
    assert named.summary.counts == given.summary.counts  # type: ignore[union-attr]
    both = terrain.traversability([HUSKY, ROOT / "samples/vehicles/warthog.json"], **asked)
    assert [one.vehicle.name for one in both.reports] == ["husky-a200", "warthog"]
    with pytest.raises(terratool.RequestError, match="is given twice"):
        terrain.traversability([HUSKY, HUSKY], **asked)
    with pytest.raises(terratool.RequestError, match=r"model is 'fast'\. Choose slip or paper"):
        terrain.traversability(HUSKY, model="fast", **asked)


def gentle() -> terratool.Terrain:
    """The site with a tenth of its slope, of a soil that is known."""
    document = json.loads(json.dumps(SITE))
    document["elemTree"]["vScale"] = 0.3
    document["surfTypes"]["sand"] = {"preset": "dry-sand"}
    return terratool.load(document)


def test_points_of_a_way_are_an_array_or_a_file(tmp_path: Path) -> None:
    terrain = gentle()
    way = np.array([[500002.0, 4649777.5], [500003, 4649780], [500002, 4649782]])
    path = tmp_path / "way.csv"
    path.write_text("\n".join(f"{x},{y}" for x, y in way))
    [drawn] = terrain.traversability(HUSKY, waypoints=[way], mapped=False).routes  # type: ignore[union-attr]
    [read] = terrain.traversability(HUSKY, waypoints=[path], mapped=False).routes  # type: ignore[union-attr]
    assert drawn.holds == read.holds and drawn.length == read.length > 4
    for alone in (way, way.tolist(), path, str(path)):
        [one] = terrain.traversability(HUSKY, waypoints=alone, mapped=False).routes  # type: ignore[union-attr]
        assert one.length == drawn.length


def test_four_numbers_are_one_way() -> None:
    terrain = gentle()
    line = (500002.0, 4649779.0, 500006.0, 4649782.0)
    other = (500006.0, 4649782.0, 500003.0, 4649779.5)

    def ends(routes: Any) -> list[tuple[float, ...]]:
        coarse = {"resolution": 0.5, "headings": 4}
        report = terrain.traversability(HUSKY, routes=routes, mapped=False, **coarse)  # type: ignore[arg-type]
        return [
            (one.start.x, one.start.y, one.goal.x, one.goal.y)
            for one in report.routes  # type: ignore[union-attr]
        ]

    for routes in (line, list(line), np.array(line), [line], np.array([line])):
        assert ends(routes) == [line]
    assert ends([line, other]) == ends(np.array([line, other])) == [line, other]
    assert ends(()) == ends([]) == []
    for wrong in ((1, 2, 3), 5, "1829", "here", [(1, 2, 3)], [line, (1, 2, 3)], [1, 2, 3, "x"]):
        with pytest.raises(terratool.RequestError, match="Give x0, y0, x1, y1, or x0, y0, z0"):
            ends(wrong)


def test_readings_lie_on_the_ground(terrain: terratool.Terrain) -> None:
    [frame] = terrain.scan(LIDAR, POSE, on_ground=1.2)
    points = frame.points[(frame.status == 0) & ~frame.wall]
    assert len(points) > 1000
    assert np.abs(points[:, 2] - terrain.height(points[:, 0], points[:, 1])).max() < 1e-6
    rows = np.array([POSE, (500009.0, 4649781.0, 9.0, 0.0, 0.0, 0.0)])
    assert len(terrain.scan(terratool.load_sensor(LIDAR), rows, on_ground=1.2)) == 2
    hits = terrain.cast([500009.5, 4649777.5, 20], [0, 0, -1])
    assert hits.point[2] == pytest.approx(terrain.height(500009.5, 4649777.5))
    for pose in (None, (1, 2, 3), "here", np.zeros((0, 6))):
        with pytest.raises(terratool.RequestError, match="Give"):
            terrain.scan(LIDAR, pose)


@pytest.mark.slow
def test_a_difference_goes_from_the_old_to_the_new(
    terrain: terratool.Terrain, tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib")
    higher = json.loads(json.dumps(SITE))
    higher["elemTree"]["children"][0]["vScale"] = 2.5
    found = terrain.diff(higher, resolution=0.1, map=tmp_path / "a.tif")
    assert not found.same and found.count("changed") == 1
    # half a metre on two square metres
    assert (found.ground.fill, found.ground.cut) == (pytest.approx(1.0), 0.0)
    back = terratool.load(higher).diff(terrain, resolution=0.1, picture=tmp_path / "a.png")
    assert (back.ground.fill, back.ground.cut) == (0.0, pytest.approx(1.0))
    with rasterio.open(tmp_path / "a.tif") as raster:
        pixels = raster.read(1)
        assert np.nansum(pixels) * raster.res[0] ** 2 == pytest.approx(1.0)
        assert pixels[-15, 95] == 0.5  # row 15 from the south, column 95 from the west
    assert (tmp_path / "a.png").stat().st_size > 5000
    assert terrain.diff(terratool.load(SITE)).same


@pytest.mark.nightly
def test_a_page_in_a_notebook_runs_its_script_and_nothing_else(tmp_path: Path) -> None:
    """In the frame that a notebook shows, in Chromium."""
    import time

    from tests.viewing.browsers import chromium

    shown = terratool.load(YARD).view(height=400)
    assert "12 × 8" not in repr(shown)
    html = shown._repr_html_()
    assert html.startswith("<iframe srcdoc=") and 'sandbox="allow-scripts"' in html
    outer = tmp_path / "notebook.html"
    outer.write_text(f"<!DOCTYPE html><body>{html}</body>", "utf-8")
    with chromium(tmp_path / "profile") as browser:
        browser.get(outer.as_uri())
        browser.switch_to.frame(0)
        end = time.monotonic() + 30
        script = "return document.body && document.body.dataset.shown"
        while browser.execute_script(script) is None:
            assert time.monotonic() < end
        assert browser.execute_script(script) == "yes"
        assert "faces" in browser.find_element("tag name", "body").text


def test_a_page_is_written_where_it_is_told(terrain: terratool.Terrain, tmp_path: Path) -> None:
    page = terrain.view()
    assert page.write(tmp_path / "a.html").read_text("utf-8") == page.text
    with pytest.raises(terratool.WriteError, match="exists already"):
        terrain.view(tmp_path / "a.html")
    with pytest.raises(terratool.RequestError, match="is no name of a page"):
        terrain.view(tmp_path / "a.png")
    assert [one.name for one in tmp_path.iterdir()] == ["a.html"]
