"""Rasters of classes that decide which surface an element wears."""

from __future__ import annotations

import json
import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition.reader import load_checked
from terratool.errors import ReadError
from terratool.field.terrain import Terrain
from terratool.mesh.build import build
from terratool.raster.grid import Grid
from terratool.raster.painter import Painter
from tests.budget import examples
from tests.classes import CLASSES
from tests.conftest import terrain_of
from tests.oracle import Oracle
from tests.rasters import geotiff
from tests.strategies import surface_grids

Json = dict[str, Any]

SURFACES: Json = {
    "sand": {"cohesion": 1, "fricAngle": 30, "sinkage": 0.1, "color": [200, 180, 120]},
    "rock": {"cohesion": 0, "fricAngle": 35, "sinkage": 0, "color": [90, 90, 90]},
    "clods": {"sinkage": 0.02, "roughness": {"rms": 0.01, "correlation": 0.4}},
    "hole": {"void": True},
}
TYPES: Json = {
    "plate": {"x": [1]},
    "disc": {"combine": "radial", "x": [1]},
    "dem": {"grid": [[0, 1, 3], [2, 0, 1]], "registration": "pixel"},
    "stair": {"x": [[0, 0], [0.5, 0], [0.5, 1], [1, 1]]},
}
OBLONG = {"file": "oblong.tif", "names": {"1": "rock", "3": "hole"}}


def yard(root: Json, **more: Any) -> Json:
    """An oblong terrain of sand, of no proportions that a raster has."""
    base = {"type": "plate", "vScale": 1, "surface": "sand"}
    return {
        "size": [7, 4], "surfTypes": SURFACES, "elemTypes": TYPES, "elemTree": base | root, **more
    }  # fmt: skip


def map_of(terrain: Terrain, columns: int, rows: int) -> list[list[str | None]]:
    """Surfaces in the middles of even cells, rows from the north."""
    west, south, east, north = terrain.bounds
    x = west + (np.arange(columns) + 0.5) * (east - west) / columns
    y = north - (np.arange(rows) + 0.5) * (north - south) / rows
    found: list[list[str | None]] = terrain.surface(*np.meshgrid(x, y)).tolist()
    return found


def test_classes_lie_as_one_reads_a_map() -> None:
    """The first row in the north; what has no name, and nodata, leaves the element its own."""
    terrain = terrain_of(yard({"surfaceGrid": OBLONG}))
    assert map_of(terrain, 3, 2) == [["rock", "sand", "hole"], ["sand", "sand", "rock"]]
    assert terrain.element(0.5, 3.5) == "/elemTree"
    assert np.isnan(terrain.height(6, 3)) and terrain.height(6, 1) == 1


def test_a_pixel_has_its_west_and_south_edges() -> None:
    """To the last bit; and the last pixels have the edges of the terrain."""
    terrain = terrain_of(yard({"surfaceGrid": {"file": "oblong.tif", "names": {"1": "rock"}}}))
    edge = 7 / 3
    for x, y, wanted in (
        (math.nextafter(edge, 0), 3.5, "rock"), (edge, 3.5, "sand"), (0, 2, "rock"),
        (0, math.nextafter(2, 0), "sand"), (7, 0, "rock"), (7, math.nextafter(2, 0), "rock"),
        (14 / 3, 0, "rock"), (math.nextafter(14 / 3, 0), 0, "sand"),
    ):  # fmt: skip
        assert terrain.surface(x, y) == wanted, (x, y)


@pytest.mark.parametrize(
    ("turn", "x", "y", "wanted"),
    [
        (90, (2.5, 3.5), (3, 2, 1), [["sand", "rock"], ["sand", "sand"], ["rock", "clods"]]),
        (180, (2, 3, 4), (2.5, 1.5), [["rock", "sand", "sand"], ["clods", "sand", "rock"]]),
        (-90, (2.5, 3.5), (3, 2, 1), [["clods", "rock"], ["sand", "sand"], ["rock", "sand"]]),
    ],
)
def test_classes_turn_with_their_element(turn: int, x: Any, y: Any, wanted: Any) -> None:
    """A quarter clockwise brings the west of the raster to the north."""
    grid = {"file": "oblong.tif", "names": {"1": "rock", "3": "clods"}}
    child = {"at": [3, 2], "extent": [3, 2], "type": "plate", "turnDeg": turn, "surfaceGrid": grid}
    terrain = terrain_of(yard({"children": [child]}))
    assert terrain.surface(*np.meshgrid(x, y)).tolist() == wanted


def test_later_and_deeper_elements_decide_before_a_class() -> None:
    """A child takes over the surface of its parent, not the classes of that."""
    children = [
        {"at": [1, 3], "extent": [1, 1], "type": "plate"},
        {"at": [6, 1], "extent": [1, 1], "type": "plate", "surface": "clods"},
    ]
    terrain = terrain_of(yard({"surfaceGrid": OBLONG, "children": children}))
    assert terrain.surface([1, 6, 0.2], [3, 1, 3.9]).tolist() == ["sand", "clods", "rock"]


def test_one_file_means_what_each_element_names() -> None:
    """It is mapped once, whatever its classes stand for."""
    twice = [
        {"at": [x, 2], "extent": [3, 2], "type": kind, "surfaceGrid": {"file": "one.tif"} | names}
        for x, kind, names in (
            (2, "plate", {"names": {"1": "rock"}}), (5, "disc", {"names": {"1": "clods"}}),
        )
    ]  # fmt: skip
    terrain = terrain_of(yard({"children": twice}))
    assert terrain.surface([2, 5, 6.4], [2, 2, 2.95]).tolist() == ["rock", "clods", "sand"]
    assert len(terrain.arrays.curves.mapped.sources) == 1
    assert terrain.count_by_surface() == {"sand": 3, "rock": 1, "clods": 1, "hole": 0}


def test_ruts_and_reliefs_are_those_of_the_class() -> None:
    names = {"1": "rock", "2": "clods"}
    grid = {"file": "row.tif", "names": names}  # rock, clods, sand, sand
    track = {"path": [[0.5, 2], [6.5, 2]], "width": 1, "load": 1}
    terrain = terrain_of(yard({"surfaceGrid": grid}, tracks=[track]))
    smooth = terrain_of(yard({"surfaceGrid": grid}, tracks=[track]), roughness=False)
    depths = 1 - smooth.height([1, 2.5, 4.5, 6], [2, 2, 2, 2])
    assert depths.tolist() == pytest.approx([0, 0.02, 0.1, 0.1], abs=1e-12)
    rough = terrain.height([1, 2.5, 4.5], [0.5, 0.5, 0.5]) != 1
    assert rough.tolist() == [False, True, False]


@pytest.mark.nightly
@settings(max_examples=examples(60))
@given(st.data())
def test_rays_meet_the_surface_of_the_class(data: st.DataObject) -> None:
    """On elements of all kinds, turned and not, away from borders."""
    kind = data.draw(st.sampled_from(sorted(TYPES)))
    turn = data.draw(st.sampled_from([0, 0, 90, 33, -120]))
    child = {"at": [3.4, 1.9], "extent": [2.2, 1.4], "type": kind, "turnDeg": turn, "vScale": 0.2}
    child["surfaceGrid"] = data.draw(surface_grids(["rock", "sand", "hole"]))
    root = {"children": [child], "surfaceGrid": data.draw(surface_grids(["rock", "hole"]))}
    definition = yard(root)
    if data.draw(st.booleans()):
        definition["tracks"] = [{"path": [[1, 1], [6, 3]], "width": 0.5, "load": 2}]
    terrain, oracle = terrain_of(definition), Oracle(definition)
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    ends = rng.uniform((0, 0, 0), (7, 4, 1), (40, 3))
    origins = np.column_stack([rng.uniform((0, 0), (7, 4), (40, 2)), rng.uniform(2, 5, 40)])
    hits = terrain.cast(origins, ends - origins)
    for n in np.flatnonzero(np.isfinite(hits.distance) & ~hits.wall):
        x, y = hits.point[n, :2].tolist()
        if oracle.margin(x, y) > 1e-6:
            wanted = oracle.at(x, y)
            assert wanted.surface == terrain.surfaces[hits.surface[n]], (x, y)
            assert hits.point[n, 2] == pytest.approx(wanted.z, abs=1e-9)


def test_rays_meet_ruts_and_reliefs_class_by_class() -> None:
    """Along a rut that is as deep as each class lets a wheel sink, and beside it."""
    grid = {"file": "row.tif", "names": {"1": "rock", "2": "clods"}}
    track = {"path": [[0.1, 2], [6.9, 2]], "width": 1, "load": 1}
    terrain = terrain_of(yard({"surfaceGrid": grid}, tracks=[track]))
    x = np.linspace(0.3, 6.5, 60)
    origins = np.column_stack([x - 0.2, np.where(np.arange(60) % 2, 2.1, 0.7), np.full(60, 1.1)])
    hits = terrain.cast(origins, [1.0, 0.01, -0.5])
    assert np.isfinite(hits.distance).all()
    clear = ~hits.wall & (np.abs(hits.point[:, 0] * 4 / 7 % 1 - 0.5) < 0.499)
    assert clear.sum() > 50
    found = terrain.sample(hits.point[clear, 0], hits.point[clear, 1])
    assert np.abs(hits.point[clear, 2] - found.height).max() < 1e-9
    assert (hits.surface[clear] == found.surface).all()
    assert len(np.unique(np.round(found.height, 2))) >= 3


def test_labels_part_classes_whose_reliefs_differ() -> None:
    """So that walls between reliefs are looked for; where nothing is rough there is no need."""
    names = {"1": "rock", "2": "clods"}
    definition = yard({"surfaceGrid": {"file": "row.tif", "names": names}})
    pixels = Grid(0, 0, 0.25, 16, 28)
    planes = Painter(terrain_of(definition), pixels, labels=True).paint(pixels.whole)
    assert planes.labels is not None and planes.surfaces is not None
    borders = np.diff(planes.surfaces.astype(int), axis=1) != 0
    assert borders.any() and ((np.diff(planes.labels.astype(int), axis=1) != 0) == borders).all()
    smooth = terrain_of(definition, roughness=False)
    labels = Painter(smooth, pixels, labels=True).paint(pixels.whole).labels
    assert labels is not None and len(np.unique(labels)) == 1


def test_a_ray_falls_through_a_class_without_ground() -> None:
    """And meets what is behind the hole from below, the rim of which is no wall."""
    terrain = terrain_of(yard({"surfaceGrid": OBLONG}))
    hits = terrain.cast(
        [[6, 3, 3], [6, 1, 3], [6, 3.9, 0.5]], [[0, 0, -1], [0, 0, -1], [0, -2, 0.4]]
    )
    assert np.isfinite(hits.distance).tolist() == [False, True, True]
    assert [terrain.surfaces[one] for one in hits.surface[1:]] == ["rock", "rock"]


@pytest.mark.parametrize(
    "root",
    [
        {"surfaceGrid": OBLONG},
        {"type": "dem", "surfaceGrid": OBLONG, "turnDeg": 180},
        {"children": [{"at": [3, 2], "extent": [3, 1.5], "turnDeg": 30, "type": "stair",
                       "surfaceGrid": {"file": "tall.tif", "names": {"1": "rock", "-7": "hole"}}}]},
        {"children": [{"at": [3, 2], "extent": [3, 2.5], "type": "plate", "vScale": 0,
                       "surfaceGrid": {"file": "column.tif", "names": {"2": "rock"}}}]},
    ],
    ids=["root", "half a turn", "turned", "level"],
)  # fmt: skip
def test_a_mesh_follows_the_borders_between_surfaces(root: Json) -> None:
    """Each face is of one surface, that of all points in it; there is none over a hole."""
    terrain = terrain_of(yard(root))
    mesh = build(terrain, 1e-2).mesh
    corners = mesh.vertices[mesh.faces[~mesh.walls]][:, :, :2]
    weights = np.random.default_rng(3).dirichlet((1, 1, 1), 5)
    points = np.einsum("kc,ncd->nkd", weights, corners)
    found = terrain.sample(points[..., 0], points[..., 1])
    edges = corners - np.roll(corners, 1, axis=1)
    areas = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2
    large = areas > 1e-6  # slivers lie within rounding of a border
    wanted = np.broadcast_to(mesh.surfaces[~mesh.walls][:, None], found.surface.shape)
    assert (found.surface == wanted)[large].all()
    assert not np.isnan(found.height[large]).any()
    x, y = np.meshgrid(np.linspace(0, 7, 281)[:-1] + 0.0125, np.linspace(0, 4, 161)[:-1] + 0.0125)
    ground = float((~np.isnan(terrain.height(x, y))).mean()) * 28
    assert areas.sum() == pytest.approx(ground, abs=0.15)


def test_a_terrain_with_classes_travels() -> None:
    terrain = terrain_of(yard({"surfaceGrid": OBLONG}))
    other = pickle.loads(pickle.dumps(terrain))
    assert map_of(other, 6, 4) == map_of(terrain, 6, 4)


def saved(folder: Path, grid: Json, **more: Any) -> Path:
    """A terrain in a folder, whose root has a raster of classes."""
    (folder / "t.json").write_text(json.dumps(yard({"surfaceGrid": grid}, **more)))
    return folder / "t.json"


@pytest.mark.parametrize("kind", ["uint8", "int16", "int32", "uint32", "float32", "float64"])
def test_classes_are_of_any_type(kind: str, tmp_path: Path) -> None:
    """Whole numbers are; what is not whole is none that has a name."""
    rows = np.array([[1, 2, 3], [2, 99, 1]], np.float64)
    if kind.startswith("float"):
        rows[1, 1] = 1.25
    geotiff(tmp_path / "c.tif", rows.astype(kind), nodata=99)
    terrain = Terrain(load_checked(saved(tmp_path, OBLONG | {"file": "c.tif"})))
    assert map_of(terrain, 3, 2) == [["rock", "sand", "hole"], ["sand", "sand", "rock"]]


def test_classes_may_have_a_palette_and_a_band(tmp_path: Path) -> None:
    """A palette is of classes, where heights have none."""
    rows = np.array([[[9, 9, 9], [9, 9, 9]], [[1, 2, 3], [2, 4, 1]]], np.uint8)
    geotiff(tmp_path / "c.tif", rows)
    terrain = Terrain(load_checked(saved(tmp_path, OBLONG | {"file": "c.tif", "band": 2})))
    assert map_of(terrain, 3, 2) == [["rock", "sand", "hole"], ["sand", "sand", "rock"]]
    geotiff(tmp_path / "p.tif", rows[1])
    with rasterio.open(tmp_path / "p.tif", "r+") as file:
        file.write_colormap(1, {n: (n, n, n, 255) for n in range(5)})
    terrain = Terrain(load_checked(saved(tmp_path, OBLONG | {"file": "p.tif"})))
    assert map_of(terrain, 3, 2) == [["rock", "sand", "hole"], ["sand", "sand", "rock"]]


def test_one_file_may_have_heights_and_classes(tmp_path: Path) -> None:
    geotiff(tmp_path / "c.tif", np.array([[1, 2, 3], [2, 4, 1]], np.uint8))
    path = saved(tmp_path, OBLONG | {"file": "c.tif"})
    text = json.loads(path.read_text())
    text["elemTypes"]["dem"] = {"grid": {"file": "c.tif"}}
    text["elemTree"]["type"] = "dem"
    path.write_text(json.dumps(text))
    for _ in range(2):  # unpacked, and from the cache
        terrain = Terrain(load_checked(path))
        assert terrain.height(7 / 6, 3) == 1 and terrain.surface(7 / 6, 3) == "rock"
        assert terrain.height(3.5, 1) == 4 and terrain.surface(3.5, 1) == "sand"


def test_a_raster_that_changes_is_told(tmp_path: Path) -> None:
    geotiff(tmp_path / "c.tif", np.array([[1, 2, 3], [2, 4, 1]], np.uint8))
    checked = load_checked(saved(tmp_path, OBLONG | {"file": "c.tif"}))
    geotiff(tmp_path / "c.tif", np.array([[1, 2, 3, 4], [2, 4, 1, 1]], np.uint8))
    with pytest.raises(ReadError, match="has changed since its header was read"):
        Terrain(checked)


def test_pixels_of_more_than_256_surfaces_have_their_classes() -> None:
    many = {f"s{n}": {"cohesion": n} for n in range(300)}
    grid = {"file": "row.tif", "names": {"1": "s299", "2": "s7", "0": "rock"}}
    definition = yard({"surfaceGrid": grid})
    definition["surfTypes"] = SURFACES | many
    terrain = terrain_of(definition)
    surfaces = Painter(terrain, Grid(0, 0, 1.0, 4, 7)).paint(Grid(0, 0, 1.0, 4, 7).whole).surfaces
    assert surfaces is not None
    names = [None, *terrain.surfaces]
    assert [names[one] for one in surfaces[0, [0, 2, 4, 6]]] == ["s299", "s7", "rock", "sand"]


def test_the_rasters_of_these_tests_are_like_themselves_from_one_side_alone() -> None:
    """Or a turn or a mirror would pass unseen; but for a single row, column or pixel."""
    for rows in CLASSES.values():
        if len(rows) > 1 and len(rows[0]) > 1:
            numbers = np.array([[-1 if n is None else n for n in row] for row in rows])
            seen = {np.flip(numbers, axes).tobytes() for axes in ((), (0,), (1,), (0, 1))}
            assert len(seen) == 4
