"""Tiles of a mesh that the workers of Dask build are those of one machine, byte for byte."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.cluster import local_cluster
from terratool.errors import RequestError
from terratool.mesh.export import MeshOptions
from terratool.mesh.request import MeshRequest
from terratool.mesh.tiles import TileBuilder, TileCount, lay_out
from tests.clusters import arrived, files_in, kill_in_mid_task
from tests.conftest import terrain_of
from tests.meshes import SITE, exported_tiles

TRACKED = SITE | {
    "tracks": [{"path": [[500001, 4649777], [500008, 4649782]], "width": 0.4, "depth": 0.1}]
}


def built_alike(one: Any, other: Any) -> bool:
    """Whether two tiles are the same to the last bit."""
    arrays = ("vertices", "faces", "surfaces", "walls", "origin")
    return one.error == other.error and all(
        getattr(one.mesh, name).tobytes() == getattr(other.mesh, name).tobytes() for name in arrays
    )


@pytest.mark.parametrize("shift", [1, 4])
def test_a_builder_that_arrives_is_as_good(shift: int) -> None:
    """From frames at any address, as Dask hands them over; a tile with a rut and three seams."""
    terrain = terrain_of(TRACKED)
    layout = lay_out(terrain, 0.01, TileCount(rows=2, columns=3))
    builder = TileBuilder(terrain, layout, MeshOptions(0.01, origin="center"), True)
    own, its = (one.build((1, 1)) for one in (builder, arrived(builder, shift)))
    assert built_alike(own, its) and len(own.mesh.faces) > 20
    assert np.array_equal(own.mesh.normals.corners, its.mesh.normals.corners)


@pytest.mark.nightly
@pytest.mark.parametrize(("suffix", "origin"), [(".obj", "center"), (".ply", "world")])
def test_a_worker_is_killed_in_the_middle_of_a_tile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, origin: Any
) -> None:
    """The files and the index are those of one machine, and no more than that tile is lost."""
    terrain, told = terrain_of(TRACKED), []
    options: dict[str, Any] = {"rows": 3, "columns": 4, "origin": origin}
    exported_tiles(terrain, tmp_path / "alone", suffix, 0.01, **options)
    kill_in_mid_task(monkeypatch, tmp_path / "log")
    with local_cluster(2) as cluster:
        report = exported_tiles(
            terrain, tmp_path / "dask", suffix, 0.01, **options, dask=cluster.scheduler_address,
            progress=lambda *done: told.append(done[:2]),
        )  # fmt: skip
    assert files_in(tmp_path / "dask") == files_in(tmp_path / "alone")
    assert 12 < (tmp_path / "log").stat().st_size <= 12 + 2
    assert told == [(done, 12) for done in range(1, 13)]
    assert [tile[:2] for tile in report.tiles] == [(i, j) for i in range(3) for j in range(4)]


def test_dask_is_about_tiles(tmp_path: Path) -> None:
    with pytest.raises(RequestError, match=r"--dask is about tiles.*Add --tile-faces N"):
        MeshRequest(dask="local").check_file(tmp_path / "a.obj")


def test_no_scheduler_leaves_the_tiles_that_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dask is asked for before an earlier export is removed."""
    terrain = terrain_of(SITE)
    exported_tiles(terrain, tmp_path / "a", ".ply", 0.1, 1, 2)
    before = files_in(tmp_path / "a")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RequestError, match="Dask is not installed"):
        exported_tiles(terrain, tmp_path / "a", ".ply", 0.1, 2, 3, overwrite=True, dask="local")
    assert files_in(tmp_path / "a") == before
