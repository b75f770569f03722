"""Maps for Nav2, read as its map server reads them.

The reader here is written from nav2_map_server's `map_io.cpp`, not from the code under test.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition.reader import check
from terratool.errors import ReadError, RequestError
from terratool.field.terrain import Terrain
from terratool.simulators.cells import cell_grid
from terratool.simulators.export import export_simulators
from terratool.simulators.obstacles import FREE, OCCUPIED, UNKNOWN, DrivingLimits, occupancy
from terratool.simulators.options import SceneOptions
from terratool.text.source import Source
from tests.budget import examples
from tests.commands import ROOT, call, run

HUSKY = ROOT / "samples" / "vehicles" / "husky-a200.json"
WEST, SOUTH = 10.25, -3.5

TYPES = {
    "flat": {"x": [1]},
    "ramp": {"x": [0, 1], "y": [1]},
    "ramp north": {"x": [1], "y": [0, 1]},
    "disc": {"x": [1], "combine": "radial"},
    "ground": {"x": [0, 0]},
}
SOIL = {"cohesion": 1, "fricAngle": 35, "sinkage": 0}


def text_of(*children: dict[str, Any], size: tuple[float, float] = (6, 4)) -> dict[str, Any]:
    """Oblong level ground away from the origin, with things on it."""
    return {
        "size": list(size),
        "origin": [WEST, SOUTH],
        "surfTypes": {"floor": SOIL, "hole": {"void": True}},
        "elemTypes": TYPES,
        "elemTree": {"type": "ground", "surface": "floor", "vScale": 1, "children": [*children]},
    }


def terrain_of(*children: dict[str, Any], size: tuple[float, float] = (6, 4)) -> Terrain:
    """The same, compiled."""
    return compiled(text_of(*children, size=size))


def compiled(text: dict[str, Any]) -> Terrain:
    return Terrain(check(Source("it.json", json.dumps(text).encode())))


def at(x: float, y: float, wide: float, deep: float, height: float, **more: Any) -> dict[str, Any]:
    """A box, or what `type` says, by its middle and sides."""
    placed = {"at": [x, y], "extent": [wide, deep], "vScale": height}
    return {"type": "flat", **placed, **more}


# what the east has the west has not, nor the north what the south has
YARD = (
    at(1.5, 1.0, 0.5, 1.0, 0.4),
    at(4.5, 3.25, 2.0, 0.5, 0.5, type="ramp"),  # 14°
    at(4.75, 0.75, 0.5, 0.5, 0.5, type="ramp"),  # 45°
    at(2.75, 3.5, 0.5, 0.5, 0.0, surface="hole"),
    at(2.75, 2.0, 0.3, 0.3, 0.05),
)


@dataclass
class Map:
    """What map_server makes of a map."""

    cells: Any  # (height, width), rows from the south
    resolution: float
    origin: tuple[float, float]

    def at(self, x: float, y: float) -> int:
        """What the cell at a place of the frame is."""
        column, row = (
            math.floor((c - o) / self.resolution) for c, o in zip((x, y), self.origin, strict=True)
        )
        return int(self.cells[row, column])


def read(folder: Path, name: str = "map.yaml") -> Map:
    """As `loadMapYaml` and `loadMapFromFile` do, in the mode trinary."""
    said = yaml.safe_load((folder / name).read_text())
    assert (said["mode"], said["negate"]) == ("trinary", 0)
    assert len(said["origin"]) == 3 and said["origin"][2] == 0
    magic, size, most, pixels = (folder / said["image"]).read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    assert (magic, most, len(pixels)) == (b"P5", b"255", width * height)
    cells = np.empty((height, width), int)
    for row in range(height):
        shade = np.frombuffer(pixels, np.uint8, width, row * width) / 255.0
        occupied = 1.0 - shade
        values = np.where(occupied < said["free_thresh"], FREE, UNKNOWN)
        cells[height - row - 1] = np.where(said["occupied_thresh"] < occupied, OCCUPIED, values)
    return Map(cells, said["resolution"], (said["origin"][0], said["origin"][1]))


def exported(terrain: Terrain, folder: Path, **options: Any) -> tuple[Map, dict[str, Any]]:
    """The map of a terrain, and its manifest."""
    [report] = export_simulators(terrain, folder, ("nav2",), SceneOptions(**options))
    return read(report.folder), dict(report.manifest)


def cells_of(terrain: Terrain, side: float, slope: float = 20.0, step: float = 0.1) -> Any:
    """What cells are, rows from the south."""
    grid = cell_grid(terrain, side)
    return occupancy(terrain, grid, DrivingLimits.of(slope, step))[::-1]


@pytest.mark.parametrize("origin", ["world", "local", (3.0, -7.5, 1.0)])
def test_marks_are_where_they_stand(tmp_path: Path, origin: Any) -> None:
    """Each mark is found at its place of the frame; a mirrored or turned map fails."""
    there, manifest = exported(terrain_of(*YARD), tmp_path, origin=origin)
    x0, y0, _ = {"world": (0, 0, 0), "local": (WEST, SOUTH, 0)}.get(str(origin), origin)
    assert there.cells.shape == (80, 120) and there.resolution == 0.05

    def cell(x: float, y: float) -> int:
        return there.at(WEST - x0 + x, SOUTH - y0 + y)

    assert cell(1.26, 0.6) == cell(1.74, 1.4) == cell(1.5, 0.51) == cell(1.5, 1.49) == OCCUPIED
    assert cell(1.24, 0.6) == cell(1.76, 1.4) == cell(1.5, 0.49) == cell(1.5, 1.51) == FREE
    assert cell(4.5, 3.25) == FREE and cell(4.75, 0.75) == OCCUPIED
    assert cell(5.49, 3.25) == OCCUPIED and cell(3.51, 3.25) == FREE  # the wall at the ramp's end
    assert cell(2.75, 3.5) == cell(2.51, 3.74) == UNKNOWN
    assert cell(2.49, 3.5) == cell(2.75, 3.24) == FREE
    assert cell(2.75, 2.0) == cell(2.6, 2.0) == FREE  # a kerb that is low enough
    for x, y in ((0.1, 0.1), (5.9, 3.9), (0.1, 3.9), (5.9, 0.1), (4.5, 2.9), (1.5, 3.0)):
        assert cell(x, y) == FREE
    shares = manifest["map"]["shares"]
    for name, value in (("free", FREE), ("occupied", OCCUPIED), ("unknown", UNKNOWN)):
        assert shares[name] == np.mean(there.cells == value)
    assert f"{100 * shares['occupied']:.1f} % occupied" in manifest["summary"]


def test_walls_between_cells_are_the_upper_ones() -> None:
    """Of a box on the lines between cells the ring inside is occupied, of a pit that outside."""
    box = cells_of(terrain_of(at(3.0, 1.75, 1.0, 0.5, 0.3)), 0.05)
    ring = np.zeros_like(box)
    ring[30:40, 50:70] = OCCUPIED
    ring[31:39, 51:69] = FREE
    np.testing.assert_array_equal(box, ring)
    pit = cells_of(terrain_of(at(3.0, 1.75, 1.0, 0.5, -0.3)), 0.05)
    ring = np.zeros_like(pit)
    ring[29:41, 50:70] = ring[30:40, 49:71] = OCCUPIED
    ring[30:40, 50:70] = FREE
    for corner in ((29, 49), (29, 70), (40, 49), (40, 70)):  # touched in a point: one or the other
        ring[corner] = pit[corner]
    np.testing.assert_array_equal(pit, ring)


@given(
    st.floats(0.1, 5.9), st.floats(0.1, 3.9), st.sampled_from([0.0, 17.0, 45.0]),
    st.sampled_from([0.02, 0.003]), st.sampled_from(["flat", "disc"]),
)  # fmt: skip
@settings(max_examples=examples(60), deadline=None)
def test_thin_posts_do_not_vanish(x: float, y: float, turn: float, side: float, kind: str) -> None:
    """A post of 2 cm, and one of 3 mm, marks the cell of 5 cm that it stands in, and few more."""
    cells = cells_of(terrain_of(at(x, y, side, side, 0.8, turnDeg=turn, type=kind)), 0.05)
    found = np.argwhere(cells == OCCUPIED)
    assert 1 <= len(found) <= 4
    # no cell but those that it reaches; and one of these holds most of it
    far = np.abs((found[:, ::-1] + 0.5) * 0.05 - (x, y)).max(axis=1)
    assert far.max() <= 0.025 + 0.71 * side + 1e-9
    assert far.min() <= 0.025 + 1e-6


@given(st.floats(0.1, 5.9), st.floats(0.1, 3.9), st.sampled_from([0.0, 17.0]))
@settings(max_examples=examples(40), deadline=None)
def test_narrow_peaks_of_grids_do_not_vanish(x: float, y: float, turn: float) -> None:
    """A number of 7 × 5 over 2 × 3 cm, in the third column and the second row, marks its cell."""
    peak = np.zeros((5, 7))
    peak[1, 2] = 1.0
    sides = 0.02, 0.03
    text = text_of(at(x, y, *sides, 0.8, turnDeg=turn, type="peak"))
    text["elemTypes"] = {**TYPES, "peak": {"grid": peak.tolist()}}
    found = np.argwhere(cells_of(compiled(text), 0.05) == OCCUPIED)
    east, north = (2 / 6 - 0.5) * sides[0], (3 / 4 - 0.5) * sides[1]
    cos, sin = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    top = np.array([x + east * cos + north * sin, y + north * cos - east * sin])
    assert 1 <= len(found) <= 4
    far = np.abs((found[:, ::-1] + 0.5) * 0.05 - top).max(axis=1)
    assert far.min() <= 0.025 + 1e-6 and far.max() <= 0.025 + 0.02


@given(st.floats(0, 180), st.floats(1.2, 4.8), st.floats(1.2, 2.8))
@settings(max_examples=examples(40), deadline=None)
def test_thin_walls_have_no_gaps(turn: float, x: float, y: float) -> None:
    """No way leads through a wall of 4 mm that is 2 m long: all cells along it are occupied."""
    cells = cells_of(terrain_of(at(x, y, 2.0, 0.004, 0.5, turnDeg=turn)), 0.05)
    angle, along = math.radians(turn), np.linspace(-0.999, 0.999, 801)
    there_x, there_y = x + along * math.cos(angle), y - along * math.sin(angle)
    column, row = np.floor(there_x / 0.05).astype(int), np.floor(there_y / 0.05).astype(int)
    inside = np.minimum(there_x % 0.05, 0.05 - there_x % 0.05) > 0.003
    inside &= np.minimum(there_y % 0.05, 0.05 - there_y % 0.05) > 0.003
    missed = set(zip(row[inside], column[inside], strict=True))
    missed -= set(map(tuple, np.argwhere(cells == OCCUPIED).tolist()))
    clipped = [  # of a cell that the wall cuts a corner off a little may be missed, no more
        np.count_nonzero(inside & (row == r) & (column == c)) * 2.0 / 800 for r, c in missed
    ]
    assert max(clipped, default=0.0) < 0.03


@pytest.mark.parametrize("side", [0.05, 0.11])
def test_free_cells_hold_no_wall(side: float) -> None:
    """Where 17 × 17 points of a cell differ by more than a step it is occupied, but for slivers."""
    terrain = terrain_of(
        at(2.7, 2.1, 1.0, 0.6, 0.3, turnDeg=23), at(5.0, 1.0, 1.0, 0.7, 0.101, turnDeg=-41),
        at(1.0, 3.1, 0.5, 0.5, -0.15, type="disc"), at(4.6, 3.2, 0.7, 0.3, 0.0, surface="hole"),
        at(1.1, 1.2, 1.1, 0.7, -0.101, turnDeg=67), at(2.9, 3.4, 0.8, 0.5, -0.101, turnDeg=8),
    )  # fmt: skip
    cells, points = cells_of(terrain, side), 17
    part = (np.arange(points) + 0.5) / points
    x, y = (((np.arange(count)[:, None] + part) * side).ravel() for count in cells.shape[::-1])
    z = terrain.height(WEST + x, SOUTH + y[:, None])
    z = z.reshape(cells.shape[0], points, cells.shape[1], points).swapaxes(1, 2)
    z = z.reshape(*cells.shape, -1)
    low, high = np.fmin.reduce(z, axis=-1), np.fmax.reduce(z, axis=-1)
    below, above = z < low[..., None] + 0.05, z > high[..., None] - 0.05
    sliver = np.minimum(below.mean(axis=-1), above.mean(axis=-1)) < 0.02
    wall = high - low > 0.1
    assert wall.sum() > 80
    assert (cells[wall & ~sliver] == OCCUPIED).all()
    hole = np.isnan(z).any(axis=-1)
    assert hole.sum() > 5 and (cells[hole] != FREE).all()
    calm = (high - low == 0.0) & ~hole
    assert (cells[calm] != UNKNOWN).all()


@pytest.mark.parametrize(("height", "cell"), [(0.0999, FREE), (0.1001, OCCUPIED)])
def test_the_highest_step(height: float, cell: int) -> None:
    cells = cells_of(terrain_of(at(2.02, 1.53, 1.0, 0.5, height)), 0.05)
    assert (cells == cell).any() and (cells != OCCUPIED).all() == (cell == FREE)


@pytest.mark.parametrize(("degrees", "cell"), [(19.99, FREE), (20.01, OCCUPIED)])
def test_the_steepest_slope(degrees: float, cell: int) -> None:
    """A slope up to the limit is free, whichever way it goes."""
    rise = 2.0 * math.tan(math.radians(degrees))
    east = cells_of(terrain_of(at(3.0, 2.0, 2.0, 1.0, rise, type="ramp")), 0.05)
    assert (east[32:48, 42:78] == cell).all()
    north = cells_of(terrain_of(at(3.0, 2.0, 1.0, 2.0, rise, type="ramp north")), 0.05)
    assert (north[22:58, 52:68] == cell).all()


@pytest.mark.parametrize(("begin", "height"), [(0.505, 0.08), (0.52, 0.006)])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_narrow_steep_face_is_a_slope(begin: float, height: float, axis: str) -> None:
    """Between places that are looked at it is seen by how much they differ, at one by its slope."""
    face = {axis: [[0, 0], [begin, 0], [begin + 0.01, 1], [1, 1]], "yx"["xy".index(axis)]: [1]}
    text = {
        "size": [1, 1], "elemTypes": {"face": face}, "elemTree": {"type": "face", "vScale": height},
    }  # fmt: skip
    cells = cells_of(compiled(text), 0.05)
    across = cells if axis == "x" else cells.T
    assert (across[:, 10] == OCCUPIED).all() and (np.delete(across, 10, axis=1) == FREE).all()


def test_what_reaches_over_the_edge_is_unknown() -> None:
    """Where cells do not divide the terrain the last ones are not all known."""
    cells = cells_of(terrain_of(size=(3.0, 2.0)), 0.07)
    assert cells.shape == (29, 43)
    assert (cells[:28, :42] == FREE).all()
    assert (cells[28] == UNKNOWN).all() and (cells[:, 42] == UNKNOWN).all()


def test_large_terrains_have_coarser_cells() -> None:
    grid = cell_grid(terrain_of(size=(600.0, 150.0)), None)
    assert grid.width <= 4096 and grid.width * grid.resolution == pytest.approx(600)
    assert grid.height * grid.resolution == pytest.approx(150)


def test_numbers_of_numpy(tmp_path: Path) -> None:
    """They stand in the YAML as others do."""
    terrain = terrain_of(size=(3, 2))
    origin = tuple(np.array([1.0, 2.5, 3.0]))
    there, _ = exported(terrain, tmp_path, resolution=np.float64(0.25), origin=origin)
    assert (there.resolution, there.origin) == (0.25, (WEST - 1.0, SOUTH - 2.5))


def test_one_row_of_cells(tmp_path: Path) -> None:
    """Cells as large as the shorter side are no larger than the terrain."""
    there, _ = exported(terrain_of(size=(6.3, 2.1)), tmp_path, resolution=2.1)
    assert there.cells.tolist() == [[FREE, FREE, FREE]]


def test_the_readme_says_what_decided(tmp_path: Path) -> None:
    """The limits or the vehicle, the side of a cell, and that tops are free."""
    _, manifest = exported(
        terrain_of(*YARD), tmp_path / "a", max_slope=17.5, max_step=0.25, resolution=0.125
    )
    text = (tmp_path / "a" / "nav2" / "README.md").read_text("utf-8")
    for words in ("0.125 m wide", "17.5° (--max-slope)", "0.25 m (--max-step)"):
        assert words in text
    assert any(
        line.startswith("The level top of something high is free") for line in manifest["losses"]
    )
    exported(terrain_of(*YARD), tmp_path / "b", vehicle=HUSKY, resolution=0.125)
    text = (tmp_path / "b" / "nav2" / "README.md").read_text("utf-8")
    assert "0.125 m wide" in text and "the vehicle, husky-a200," in text
    assert "--max-s" not in text


@pytest.mark.nightly
def test_a_vehicle_decides(tmp_path: Path) -> None:
    """Free is what the map of traversability has as go or caution."""
    text, out = text_of(*YARD, at(5.2, 2.0, 0.8, 0.8, 0.6)), tmp_path / "map.tif"
    file = tmp_path / "yard.json"
    file.write_text(json.dumps(text))
    ran = run(
        "traversability", str(file), "--vehicle", str(HUSKY), "--map", str(out),
        "--resolution", "0.1",
    )  # fmt: skip
    assert ran.code in (0, 1), ran.err
    with rasterio.open(out) as raster:
        classes = raster.read(1)
    there, manifest = exported(compiled(text), tmp_path / "o", vehicle=HUSKY, resolution=0.1)
    wanted = np.where((classes == 1) | (classes == 2), FREE, OCCUPIED)
    terrain, middle = compiled(text), (np.arange(60) + 0.5) * 0.1
    ground = ~np.isnan(terrain.height(WEST + middle, SOUTH + middle[39::-1, None]))
    wanted[(classes == 0) | ~ground] = UNKNOWN
    assert {FREE, OCCUPIED, UNKNOWN} == set(np.unique(wanted).tolist())
    np.testing.assert_array_equal(there.cells, wanted[::-1])
    assert manifest["map"]["vehicle"]["file"] == "husky-a200.json"
    assert sum(manifest["map"]["classes"].values()) == wanted.size


def test_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        exported(terrain_of(*YARD), tmp_path / name)
    files = [sorted((tmp_path / name / "nav2").iterdir()) for name in ("one", "two")]
    assert [f.name for f in files[0]] == ["README.md", "manifest.json", "map.pgm", "map.yaml"]
    for one, two in zip(*files, strict=True):
        assert one.read_bytes() == two.read_bytes()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"max_slope": 95.0}, "steepest slope is 95"),
        ({"max_slope": 0.0}, "steepest slope is 0"),
        ({"max_step": -0.1}, "highest step is -0.1"),
        ({"max_step": math.nan}, "highest step is nan"),
        ({"resolution": 0.0}, "resolution is 0"),
        ({"resolution": 1e-5}, "makes more than 268,435,456 cells"),
        ({"resolution": 4.01}, "Cells of 4.01 are larger than the terrain, of 6 × 4"),
    ],
)
def test_refused(tmp_path: Path, options: dict[str, Any], says: str) -> None:
    with pytest.raises(RequestError, match=says):
        exported(terrain_of(), tmp_path / "o", **options)
    assert not list(tmp_path.glob("o/*"))


def test_a_vehicle_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="there"):
        exported(terrain_of(), tmp_path, vehicle=tmp_path / "there.json")


def test_the_command(tmp_path: Path) -> None:
    """It says the shares; what makes no sense is refused before anything is written."""
    file = tmp_path / "yard.json"
    file.write_text(json.dumps(text_of(*YARD)))
    words = ["export-sim", file, tmp_path / "o", "--target", "nav2"]
    refused = call(*words, "--max-step", "-1")
    assert (refused.code, "highest step is -1" in refused.err) == (2, True)
    missing = call(*words, "--vehicle", tmp_path / "none.json")
    assert (missing.code, "none.json" in missing.err) == (3, True)
    assert not list(tmp_path.glob("o/*"))
    done = call(*words, "--max-slope", "50", "--max-step", "0.6")
    assert done.code == 0 and "0.0 % occupied, 1.0 % unknown" in done.out  # 10 × 10 of 120 × 80
    assert (read(tmp_path / "o" / "nav2").cells != OCCUPIED).all()


def test_few_obstacles_are_not_said_to_be_none(tmp_path: Path) -> None:
    """One post on a large yard: neither all of it is free, nor nothing occupied."""
    _, manifest = exported(terrain_of(at(7.0, 5.0, 0.2, 0.2, 1.0), size=(30, 20)), tmp_path)
    shares = manifest["map"]["shares"]
    assert 0.0 < shares["occupied"] < 0.0005
    assert "more than 99.9 % free, less than 0.1 % occupied, 0.0 % unknown" in manifest["summary"]
