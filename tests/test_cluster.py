"""Work done by threads or by the workers of Dask: results in order, none lost, causes told."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
from collections.abc import Iterator
from pathlib import Path
from socket import gethostname
from typing import Any

import msgspec
import numpy as np
import pytest

from terratool import cluster
from terratool.cluster import Parcel, Threads, crew_of, local_cluster
from terratool.definition.grid_files import GridSource
from terratool.definition.reader import load_checked
from terratool.errors import ReadError, RequestError, WriteError
from terratool.field.records import MappedGrids
from terratool.field.terrain import Terrain
from terratool.io.grid_files import Headers
from terratool.tasks import Work
from tests.clusters import kill_in_mid_task
from tests.rasters import geotiff

HEIGHTS = np.arange(12.0).reshape(3, 4)


def raster(path: Path, heights: Any = HEIGHTS) -> GridSource:
    """A raster in a file, as a definition finds it."""
    geotiff(path, heights)
    return Headers().source(str(path), 1)


def add(common: int, job: int) -> int:
    """A task; one job cannot be done."""
    if job < 0:
        raise ValueError("below zero")
    return common + job


def process(_common: None, _job: int) -> int:
    """A task that tells where it is done."""
    return os.getpid()


def ended(_common: None, job: int) -> None:
    """A task that ends any worker."""
    os.kill(os.getpid(), signal.SIGKILL)


def sums(common: int = 100) -> Work[int, int, int]:
    return Work(add, common, name=lambda job: f"job {job}", smaller="add less")


class TestParcel:
    """What tasks have in common says on arrival what is wrong with it."""

    def sent(self, content: Any, version: str | None = None) -> Parcel:
        """A parcel on a worker."""
        parcel = Parcel(content) if version is None else Parcel(content, version)
        arrived: Parcel = pickle.loads(pickle.dumps(parcel, 5))
        return arrived

    def test_it_is_handed_on(self) -> None:
        """Unopened or opened, as one worker fetches it from another."""
        once = self.sent((add, np.arange(3)))
        for parcel in (once, self.sent(once.open()), pickle.loads(pickle.dumps(once, 5))):
            assert parcel.open()[0] is add and np.array_equal(parcel.open()[1], np.arange(3))

    def test_another_version(self) -> None:
        """It is not even unpacked there."""
        parcel = self.sent((_Broken(), None), "0.0.1")
        with pytest.raises(RequestError, match=r"but the work is of 0\.0\.1.*the same version"):
            parcel.open()

    def test_a_grid_that_is_not_seen(self, tmp_path: Path) -> None:
        parcel = self.sent(MappedGrids([raster(tmp_path / "dem.tif")]))
        (tmp_path / "dem.tif").unlink()
        where = f"^{gethostname()}: .*dem.tif: cannot be read .*Let all machines see the same file"
        with pytest.raises(ReadError, match=where):
            parcel.open()

    def test_a_grid_that_is_another_file_there(self, tmp_path: Path) -> None:
        parcel = self.sent(MappedGrids([raster(tmp_path / "dem.tif")]))
        geotiff(tmp_path / "dem.tif", HEIGHTS + 1)
        with pytest.raises(ReadError, match=f"changed .* or is another file on {gethostname()}"):
            parcel.open()

    def test_machines_number_file_systems_each_in_its_own_way(self, tmp_path: Path) -> None:
        source = raster(tmp_path / "dem.tif")
        there = msgspec.structs.replace(source.identity, device=source.identity.device + 1)
        grids = MappedGrids([source])
        grids.sources = (msgspec.structs.replace(source, identity=there),)
        arrived = self.sent(grids).open()
        assert np.array_equal(arrived.numbers(0), HEIGHTS) and arrived.sources == (source,)


class _Broken:
    """What no other version can unpack."""

    def __reduce__(self) -> Any:
        return int, ("no number",)


@pytest.mark.parametrize("threads", [0, 3])
def test_threads_keep_the_order(threads: int) -> None:
    assert list(Threads(threads).run(sums(), range(50))) == list(range(100, 150))


@pytest.mark.parametrize("early", [True, False])
def test_threads_at_work_are_told_that_nobody_waits(early: bool) -> None:
    """But not where all results were taken, as the next step may need what was made."""
    told: list[bool] = []
    work = Work(add, 1, name=str, stop=lambda: told.append(True))
    with contextlib.closing(Threads(2).run(work, range(9))) as results:
        assert (next(results) if early else sum(results)) == (1 if early else 45)
    assert told == [True] * early


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Scheduler of two workers."""
    with local_cluster(2) as found:
        yield found.scheduler_address


@pytest.mark.nightly
class TestWorkers:
    """Processes on this machine."""

    def test_the_order_is_kept(self, address: str) -> None:
        with crew_of(address, 1) as crew:
            assert list(crew.run(sums(), range(50))) == list(range(100, 150))
            assert list(crew.run(sums(), [])) == []

    def test_a_task_that_fails_is_named(self, address: str) -> None:
        with (
            crew_of(address, 1) as crew,
            pytest.raises(WriteError, match=r"^job -1: a worker failed .ValueError: below zero"),
        ):
            list(crew.run(sums(), [1, -1, 3]))

    def test_few_tasks_are_begun_before_their_results_are_taken(self, address: str) -> None:
        """However many there are, or memory would fill."""
        taken: list[int] = []

        def jobs() -> Iterator[int]:
            for job in range(1000):
                taken.append(job)
                yield job

        with crew_of(address, 1) as crew, contextlib.closing(crew.run(sums(), jobs())) as results:
            for done in range(100):
                next(results)
                assert len(taken) - done <= cluster._HELD * 2 + 1
        assert len(taken) < 200

    def test_a_worker_that_is_killed_loses_one_task(
        self, address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        kill_in_mid_task(monkeypatch, tmp_path / "log")
        with crew_of(address, 1) as crew:
            assert list(crew.run(sums(), range(20))) == list(range(100, 120))
        assert 20 < (tmp_path / "log").stat().st_size <= 20 + 2

    def test_all_workers_are_killed(self) -> None:
        """And what the tasks have in common is gone with them: it is sent once more."""
        work = Work(process, None, name=str)
        with local_cluster(1) as found, crew_of(found.scheduler_address, 1) as crew:
            results = crew.run(work, range(12))
            first = next(results)
            os.kill(first, signal.SIGKILL)
            rest = list(results)
        assert len(rest) == 11 and rest[-1] != first

    def test_a_task_that_ends_its_worker(self) -> None:
        work = Work(ended, None, name=lambda job: f"job {job}", smaller="add less")
        with (
            local_cluster(1, allowed_failures=0) as found,
            crew_of(found.scheduler_address, 1) as crew,
            pytest.raises(WriteError, match=r"job 7: all workers .* lost, 1 of them.*or add less"),
        ):
            list(crew.run(work, [7]))

    def test_a_grid_that_workers_do_not_see(self, address: str, tmp_path: Path) -> None:
        """The task says so; without tasks nobody would know."""
        raster(tmp_path / "dem.tif")
        (tmp_path / "site.json").write_text(
            '{"size": [4, 3], "elemTypes": {"dem": {"grid": {"file": "dem.tif"}}}, '
            '"elemTree": {"type": "dem"}}'
        )
        terrain = Terrain(load_checked(tmp_path / "site.json"))
        (tmp_path / "dem.tif").unlink()
        work = Work(Terrain.height, terrain, name=str)
        with (
            crew_of(address, 1) as crew,
            pytest.raises(ReadError, match=r"dem\.tif: cannot be read"),
        ):
            list(crew.run(work, [0]))
