"""Cells that the workers of Dask look at are those of one machine, byte for byte."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from terratool.cluster import local_cluster
from terratool.errors import RequestError
from terratool.raster.grid import Window, grid_over
from terratool.simulators.cells import cell_grid
from terratool.simulators.export import export_simulators
from terratool.simulators.obstacles import OCCUPIED, DrivingLimits, ObstacleFinder
from terratool.simulators.options import SceneOptions, refuse_idle
from terratool.simulators.storey_obstacles import StoreyObstacleFinder
from tests.clusters import arrived, files_in, kill_in_mid_task
from tests.conftest import terrain_of
from tests.mosaics import SITE
from tests.simulators.test_storey_maps import YARD

HUSKY = Path(__file__).parents[2] / "samples/vehicles/husky-a200.json"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Scheduler of two workers."""
    with local_cluster(2) as found:
        yield found.scheduler_address


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("options", "tasks"),
    [
        (SceneOptions(max_error=0.1, resolution=0.01), 20 + 6),
        (SceneOptions(max_error=0.1, resolution=0.02, vehicle=HUSKY), 2 + 2),
    ],
    ids=["limits", "vehicle"],
)
def test_a_worker_is_killed_in_the_middle_of_a_task(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: SceneOptions, tasks: int
) -> None:
    """Windows of Nav2's map, layers of grid_map, and verdicts of a vehicle for both."""
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    targets = ("gazebo", "nav2", "grid-map")
    export_simulators(terrain_of(SITE), tmp_path / "alone", targets, options)
    kill_in_mid_task(monkeypatch, tmp_path / "log", 2)
    with_dask = replace(options, dask=address)
    export_simulators(terrain_of(SITE), tmp_path / "dask", targets, with_dask)
    assert files_in(tmp_path / "dask") == files_in(tmp_path / "alone")
    assert tasks < (tmp_path / "log").stat().st_size <= tasks + 2


@pytest.mark.parametrize("shift", [1, 4])
def test_a_finder_that_arrives_is_as_good(shift: int) -> None:
    """From frames at any address, as Dask hands them over."""
    terrain = terrain_of(SITE)
    finder = ObstacleFinder(terrain, grid_over(terrain, 0.1), DrivingLimits.of(20.0, 0.1))
    window = Window(10, 60, 40, 50)
    own, its = (one.find(window) for one in (finder, arrived(finder, shift)))
    assert all(map(np.array_equal, own[1:], its[1:]))
    assert own.window == its.window and own.steep.any() and len(own.walls) > 10


@pytest.mark.parametrize("shift", [1, 16])
def test_finders_of_decks_and_bores_that_arrive_are_as_good(shift: int) -> None:
    """Aligned arrays stay in the message, read-only. But for the ramp the decks are level."""
    _, *others = YARD["elemTree"]["children"]
    terrain = terrain_of({**YARD, "elemTree": {**YARD["elemTree"], "children": others}})
    grid = cell_grid(terrain, 0.1)
    finder = StoreyObstacleFinder(terrain, grid, DrivingLimits.of(20.0, 0.1))
    window = Window(40, 10, 28, 90)
    own, its = (one.find(window) for one in (finder, arrived(finder, shift)))
    assert own.window == its.window and len(own.sheets) == len(its.sheets) == 4
    for one, other in zip(own.sheets, its.sheets, strict=True):
        assert all(map(np.array_equal, one, other))
    assert any((sheet.cells == OCCUPIED).any() for sheet in own.sheets[1:])


def test_dask_is_about_cells() -> None:
    """What becomes a mesh alone follows step by step."""
    refuse_idle({"dask"}, ["mujoco", "nav2"])
    with pytest.raises(RequestError, match="--dask is about nav2 and grid-map"):
        refuse_idle({"dask"}, ["mujoco", "gazebo"])


def test_nothing_is_left_where_there_is_no_dask(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RequestError, match="Dask is not installed"):
        export_simulators(terrain_of(SITE), tmp_path / "a", "nav2", SceneOptions(dask="local"))
    assert list(tmp_path.iterdir()) == []
