"""Height fields straight from a grid of heights: its nodes, its void, its rims, its classes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.simulators.collision import grid_patch as of_grid
from terratool.simulators.collision.grid_patch import grid_patch, is_one_grid
from terratool.simulators.collision.height_patch import HeightPatch
from terratool.simulators.options import SceneOptions
from terratool.simulators.scene import Scene
from tests.conftest import terrain_of
from tests.simulators import checks
from tests.simulators.checks import written
from tests.simulators.mujoco_adapter import MuJoCo

# oblong, mirrored in no way, with a hole within and one on the border
ROWS: list[list[float | None]] = [
    [1.5, 0.2, 0.9, 2.0, None, 1.1, 0.3],
    [0.4, 1.2, 0.1, 0.7, 1.6, 0.2, 0.8],
    [0.0, 0.6, None, 1.9, 0.5, 1.3, 0.1],
    [2.4, 0.8, 1.1, 0.3, 0.9, 0.6, 1.7],
    [0.3, 1.0, 0.5, 1.4, 0.2, 2.2, 0.9],
]


def site(registration: str, rows: Any = ROWS, **more: Any) -> Terrain:
    tree = {"type": "dem", "surface": "soil", "vScale": 0.5, "vOffset": -2, **more}
    return terrain_of(
        {
            "size": [14, 9],
            "origin": [500000, 4100000],
            "surfTypes": {"soil": {"fricAngle": 30}, "rock": {"fricAngle": 40}},
            "elemTypes": {"dem": {"grid": rows, "registration": registration}, "box": {"x": [1]}},
            "elemTree": tree,
        }
    )


def misses(patch: HeightPatch, terrain: Terrain, corner: int) -> np.ndarray:
    """Distances of planes through three corners of cells from the terrain; NaN where unused.

    Args:
        patch: the height field.
        terrain: what it stands for.
        corner: the diagonal that cells are cut along, 0 or 1.
    """
    west, south, east, north = patch.bounds
    rng = np.random.default_rng(4)
    u, v = rng.random((2, 40_000)) * np.array(patch.used.shape[::-1])[:, None]
    x = terrain.bounds[0] + west + u / patch.used.shape[1] * (east - west)
    y = terrain.bounds[1] + south + v / patch.used.shape[0] * (north - south)
    j, i = u.astype(int), v.astype(int)
    s, t = u - j, v - i
    z = patch.heights
    a, b, c, d = z[i, j], z[i, j + 1], z[i + 1, j], z[i + 1, j + 1]
    if corner:
        found = np.where(
            s + t < 1, a + s * (b - a) + t * (c - a), d + (1 - s) * (c - d) + (1 - t) * (b - d)
        )
    else:
        found = np.where(s > t, a + s * (b - a) + t * (d - b), a + s * (d - c) + t * (c - a))
    bounds = terrain.bounds
    x, y = x.clip(bounds[0], bounds[2]), y.clip(bounds[1], bounds[3])
    return np.where(patch.used[i, j], np.abs(found - terrain.height(x, y)), np.nan)


@pytest.mark.parametrize("registration", ["gridline", "pixel"])
@pytest.mark.parametrize("max_error", [10.0, 0.02])
def test_no_plane_is_farther_off_than_is_said(registration: str, max_error: float) -> None:
    """Along either diagonal; and the error is reached, but for the corners of cells."""
    terrain = site(registration)
    patch = grid_patch(terrain, max_error)
    assert patch is not None
    assert patch.error <= max_error
    found = [np.nanmax(misses(patch, terrain, corner)) for corner in (0, 1)]
    assert 0.95 * patch.error < max(found) <= patch.error
    assert patch.bounds == (0, 0, 14, 9)


@pytest.mark.parametrize("registration", ["gridline", "pixel"])
def test_cells_are_void_where_the_terrain_is(registration: str) -> None:
    terrain = site(registration)
    patch = grid_patch(terrain, 0.05)
    assert patch is not None
    rows, columns = patch.used.shape
    x, y = np.random.default_rng(5).random((2, 5000))
    west, south, east, north = terrain.bounds
    ground = ~np.isnan(terrain.height(west + x * (east - west), south + y * (north - south)))
    assert (patch.used[(y * rows).astype(int), (x * columns).astype(int)] == ground).all()
    assert not ground.all()


def test_a_large_grid_of_pixels_has_its_nodes_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """It goes on for half a pixel, and leaves out cells that are void in part."""
    monkeypatch.setattr(of_grid, "_FINE_NODES", 60)
    terrain = site("pixel")
    patch = grid_patch(terrain, 0.01)
    assert patch is not None
    assert patch.bounds == pytest.approx((-1, -0.9, 15, 9.9), abs=1e-9)
    numbers = np.array(ROWS, float)[::-1]
    assert patch.heights[1:-1, 1:-1] == pytest.approx(0.5 * numbers - 2, abs=1e-9, nan_ok=True)
    assert np.nanmax(misses(patch, terrain, 0)) <= patch.error
    assert patch.uncovered.sum() == 4 + 4  # the one on the border has its copy beyond
    monkeypatch.setattr(of_grid, "MOST_NODES", 60)
    assert grid_patch(terrain, 0.01) is None


@pytest.mark.parametrize("rows", [[[1.5]], [[1.0, 2.0, 0.5]], [[1.0], [3.0]]])
@pytest.mark.parametrize("registration", ["gridline", "pixel"])
def test_one_row_or_column(rows: Any, registration: str) -> None:
    terrain = site(registration, rows)
    patch = grid_patch(terrain, 0.01)
    assert patch is not None
    assert patch.used.all()
    assert max(np.nanmax(misses(patch, terrain, corner)) for corner in (0, 1)) <= patch.error < 1e-6


def test_cells_beside_the_void_keep_to_the_error() -> None:
    """They are no cells of the numbers alone."""
    terrain = site("pixel", [[None, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 0.0]])
    for error in (0.1, 0.01, 0.002):
        patch = grid_patch(terrain, error)
        assert patch is not None and patch.error <= error


def test_rims_of_tiny_cells_far_away_have_their_height() -> None:
    terrain = terrain_of(
        {
            "size": [0.0028, 0.002],
            "origin": [500000.123, 4100000.456],
            "elemTypes": {"dem": {"grid": ROWS, "registration": "pixel"}},
            "elemTree": {"type": "dem", "vScale": 1e-4},
        }
    )
    patch = grid_patch(terrain, 1e-6)
    assert patch is not None
    rows, columns = np.nonzero(patch.used)
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        assert not np.isnan(patch.heights[rows + row, columns + column]).any()
    assert patch.error < 1e-4


@pytest.mark.parametrize("max_error", [5e-324, 1e-320, 1e300, math.inf])
def test_any_error_may_be_asked_for(max_error: float) -> None:
    patch = grid_patch(site("pixel"), max_error)
    assert patch is not None
    assert math.prod(patch.heights.shape) <= 4.2e6


def test_what_stands_on_a_grid_leaves_no_field_of_it() -> None:
    box = {"type": "box", "at": [7, 4], "extent": 1}
    assert is_one_grid(site("pixel"))
    for more in ({"children": [box]}, {"turnDeg": 90}, {"turnDeg": 10}, {"type": "box"}):
        assert not is_one_grid(site("pixel", **more))
    spec = {"size": 9, "elemTypes": {"dem": {"grid": ROWS}}, "elemTree": {"type": "dem"}}
    gap = {"surfTypes": {"gap": {"void": True}}, "elemTree": {"type": "dem", "surface": "gap"}}
    rough = {"roughness": {"rms": 0.01, "correlation": 0.4}}
    assert is_one_grid(terrain_of(spec))
    assert not is_one_grid(terrain_of({**spec, **gap}))
    gap["surfTypes"] = {"gap": rough}
    assert not is_one_grid(terrain_of({**spec, **gap}))


@pytest.mark.parametrize("registration", ["gridline", "pixel"])
def test_rays_and_bodies_find_the_grid(registration: str, tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    folder, ground, manifest = written(
        site(registration), tmp_path / "out", "mujoco", origin="center"
    )
    assert [manifest["collision"][kind] for kind in ("box", "mesh", "hfield")] == [0, 0, 1]
    simulator = MuJoCo(folder, group=2)
    checks.check_rays(simulator, ground, manifest["collision"]["error"])
    checks.check_rest(simulator, ground, count=6)
    void = [at for at in ground.points(200, 6).tolist() if np.isnan(ground.height(*at))]
    floor = [simulator.ray_down(*at) for at in void]
    assert sum(z < -10 for z in floor if z is not None) > 0.8 * len(floor) > 9  # it has sides, too
    assert "the void is a pit with its floor at -1" in manifest["losses"][1]
    assert not list(folder.glob("*.msh"))
    assert list(manifest["surfaces"]) == ["soil"]


def test_each_class_has_its_friction(tmp_path: Path) -> None:
    """A height field for each surface; those of others are sunk under them."""
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    classes = {"file": "oblong.tif", "names": {"1": "rock"}}
    terrain = site("pixel", [[0.0, 1.0, 0.3], [2.0, 0.0, 1.0]], surfaceGrid=classes)
    folder, ground, manifest = written(terrain, tmp_path / "out", "mujoco", origin="center")
    simulator = MuJoCo(folder, group=2)
    assert manifest["collision"]["hfield"] == 2
    checks.check_rays(simulator, ground, manifest["collision"]["error"])
    angles = {"rock": 40, "soil": 30}
    for x, y in ground.points(60, 3).tolist():
        names = terrain.surface(
            x + np.array([0, 0.1, -0.1, 0, 0]), y + np.array([0, 0, 0, 0.1, -0.1])
        )
        if None not in names and len(set(names.tolist())) == 1:
            wanted = math.tan(math.radians(angles[names[0]]))
            assert simulator.friction_down(x, y) == pytest.approx(wanted, rel=1e-5)


def test_a_surface_as_wide_as_a_cell_has_its_friction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of nodes between alone; without them it is said that others hold its ground, too."""
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    classes = {"file": "oblong.tif", "names": {"1": "rock"}}
    flat = site("gridline", np.zeros((3, 4)).tolist(), surfaceGrid=classes)
    folder, _, manifest = written(flat, tmp_path / "one", "mujoco", origin="center")
    assert "shares its ground" not in str(manifest["losses"])
    model = MuJoCo(folder, group=2).model
    rock = np.array([[False, False, True], [True, False, False]])  # of cells, from the south
    for field, (own, name, angle) in enumerate(((~rock, "soil", 30), (rock, "rock", 40))):
        heights = model.hfield_data[field * 35 :][:35].reshape(5, 7)
        assert np.array_equal(heights[1::2, 1::2] > 0.5, own)
        friction = model.geom(f"/terrain/{name}/dem/0").friction[0]
        assert friction == pytest.approx(math.tan(math.radians(angle)))
    monkeypatch.setattr(of_grid, "_FINE_NODES", 15)
    strip = {"file": "row.tif", "names": {"2": "rock"}}
    flat = site("gridline", np.zeros((3, 5)).tolist(), surfaceGrid=strip)
    _, _, manifest = written(flat, tmp_path / "other", "mujoco", origin="center")
    assert "no wider than a cell shares its ground" in str(manifest["losses"])


def test_the_error_of_two_triangles_a_pixel_is_proposed() -> None:
    """Where a mesh within what was asked would be too large."""
    rows = np.random.default_rng(1).normal(size=(500, 400)).round(3).tolist()
    terrain = site("gridline", rows)
    z = 0.5 * np.array(rows)
    error = np.abs(z[1:, 1:] - z[1:, :-1] - z[:-1, 1:] + z[:-1, :-1]).max() / 4
    scene = Scene(terrain, "dem", SceneOptions(max_error=1e-5))
    with pytest.raises(RequestError, match="triangles, which no simulator takes") as told:
        _ = scene.built_mesh
    proposed = float(told.value.hint.split("--max-error ")[1].split(",")[0])
    assert error < proposed < 1.1 * error
