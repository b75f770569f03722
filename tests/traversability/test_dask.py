"""Maps that the workers of Dask judge are those of one machine, byte for byte."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.cluster import local_cluster
from terratool.errors import RequestError
from terratool.io.geotiff import TILE
from terratool.raster.grid import Window, grid_over
from terratool.traversability.assess import assess
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.ranges import draw, soil_samples
from terratool.traversability.request import Request
from terratool.traversability.survey import Surveyor
from tests.clusters import arrived, files_in, kill_in_mid_task
from tests.commands import call
from tests.conftest import terrain_of
from tests.mosaics import SITE
from tests.surveys import ROVER

# soils of which one is a range; 12 × 8 at 0.0125 is 960 × 640 pixels, 2 × 2 tiles
SOILS: dict[str, Any] = SITE | {
    "surfTypes": SITE["surfTypes"]
    | {"rock": {"cohesion": [0, 1], "fricAngle": [12, 35], "sinkage": [0.02, 0.6]}}
}
REQUEST = Request(headings=4, samples=16, seed=3, threads=2)


def judged(path: Path, request: Request) -> Any:
    """Write a map; the report."""
    path.parent.mkdir()
    prepared = prepare_assessment(terrain_of(SOILS), ROVER, request, map_path=path)
    return assess(prepared, map_path=path)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("resolution", "routes"), [(0.0125, ()), (0.02, ((500001, 4649783, 500011, 4649777),))]
)
def test_a_worker_is_killed_in_the_middle_of_a_tile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, resolution: float, routes: Any
) -> None:
    """Files, figures and routes are those of one machine, with a survey for routes and without."""
    request = replace(REQUEST, resolution=resolution, routes=routes)
    alone = judged(tmp_path / "alone" / "map.tif", request)
    kill_in_mid_task(monkeypatch, tmp_path / "log", 2)
    with local_cluster(2) as cluster:
        its = judged(
            tmp_path / "dask" / "map.tif", replace(request, dask=cluster.scheduler_address)
        )
    assert files_in(tmp_path / "dask") == files_in(tmp_path / "alone")
    assert its.summary == alone.summary and its.routes == alone.routes
    assert np.array_equal(its.preview.heights, alone.preview.heights, equal_nan=True)
    surveyor = Surveyor(terrain_of(SOILS), ROVER, alone.summary.grid, 4)
    whole = alone.summary.grid.whole
    tasks = len(list(surveyor.windows(whole) if routes else whole.cut(TILE, TILE)))
    assert 4 <= tasks < (tmp_path / "log").stat().st_size <= tasks + 2


@pytest.mark.parametrize("shift", [1, 4])
def test_a_surveyor_that_arrives_is_as_good(shift: int) -> None:
    """From frames at any address, as Dask hands them over."""
    terrain = terrain_of(SOILS)
    draws = draw(terrain, 16, 3)
    assert draws is not None
    grid = grid_over(terrain, 0.2)
    surveyor = Surveyor(terrain, ROVER, grid, 8, soil_samples(terrain, ROVER, draws))
    surveyors = surveyor, arrived(surveyor, shift)
    own, its = (one.measure(Window(3, 5, 20, 30)) for one in surveyors)
    for name in ("heights", "verdict", "reason", "numbers", "clearance", "chance"):
        assert np.array_equal(getattr(own, name), getattr(its, name), equal_nan=True), name
    assert len(np.unique(own.chance)) > 2


def test_dask_is_about_maps(saved: Callable[..., Path]) -> None:
    """Of one terrain; a search for routes looks at one tile after the other."""
    request = replace(REQUEST, routes=((1, 1, 2, 2),), mapped=False, dask="local")
    with pytest.raises(RequestError, match=r"--dask is about maps.*Add --map OUT"):
        prepare_assessment(terrain_of(SOILS), ROVER, request)
    one, other = saved(SITE), saved(SITE | {"descr": "another"})
    done = call("traversability", one, other, "--wheel-radius", 0.1, "--dask", "local")
    assert done.code == 2 and "--dask is of one terrain" in done.err
