"""Tiles that the workers of Dask make are those of one machine, whatever happens to a worker."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

from terratool import cluster as ours
from terratool.errors import RequestError, WriteError
from terratool.io.geotiff import Compression
from terratool.raster import mosaic as mosaics
from terratool.raster.export import RasterReport
from terratool.raster.grid import Grid, grid_over
from terratool.raster.layers import files_of, layers_named
from terratool.raster.painter import Painter
from terratool.raster.tiles import TileMaker, Tiling
from tests.commands import COMMAND, ENVIRONMENT
from tests.conftest import terrain_of
from tests.mosaics import ALL, SITE, contents, export_dem, export_mosaic, finished, wait_until

distributed = pytest.importorskip("distributed", reason="distributed is not installed")


def grid_at(resolution: float) -> Grid:
    return grid_over(terrain_of(SITE), resolution)


def mosaic(folder: Path, grid: Grid, **options: Any) -> RasterReport:
    return export_mosaic(terrain_of(SITE), grid, folder, **options)


def parts(folder: Path) -> set[str]:
    """Folders of tiles that are being written just now, and have begun to be."""
    return {str(path.parent) for path in folder.glob(".terratool-tiles-*.part/*/*.tif")}


@pytest.mark.nightly
def test_whole_windows_threads_and_dask_are_one(tmp_path: Path) -> None:
    """Bit for bit: a single file, and mosaics by one thread, by three and by two processes."""
    grid = grid_at(0.01)
    export_dem(terrain_of(SITE), grid, tmp_path / "whole.tif", ALL)
    reports = [
        mosaic(tmp_path / name, grid, layers=ALL, threads=threads, dask=dask)
        for name, threads, dask in (("one", 1, None), ("three", 3, None), ("dask", 2, "local"))
    ]
    assert contents(tmp_path / "one") == contents(tmp_path / "three") == contents(tmp_path / "dask")
    for one, other in zip(reports[0].files, reports[2].files, strict=True):
        assert one.statistics == other.statistics
    assert reports[0].nodata == reports[2].nodata and reports[0].surfaces == reports[2].surfaces
    for end in ("", "-surface", "-color", "-hillshade"):
        with (
            rasterio.open(tmp_path / f"whole{end}.tif") as whole,
            rasterio.open(tmp_path / "dask" / f"mosaic{end}.vrt") as index,
        ):
            assert whole.read().tobytes() == index.read().tobytes()


@pytest.mark.nightly
@pytest.mark.parametrize("others", [1, 0])
def test_a_worker_is_killed_in_the_middle_of_a_tile(tmp_path: Path, others: int) -> None:
    """Its tile is made by another one; if there was none, by one that comes later.

    The worker is stopped, is seen to have a tile half-written, and is killed. Where it was the only
    one, the terrain is lost with it, and is sent once more.
    """
    grid, folder = grid_at(0.004), tmp_path / "a"
    tiles = 6 * 4
    layers = ("height", "slope")
    with ours.local_cluster(1 + others) as cluster, ThreadPoolExecutor(1) as pool:
        address = cluster.scheduler_address
        victim = next(iter(cluster.workers.values())).pid
        run: Future[RasterReport] = pool.submit(mosaic, folder, grid, layers=layers, dask=address)

        def halfway() -> bool:
            # each worker writes one file at a time: if there is one for each, one is the victim's
            if finished(folder) == 0 or len(parts(folder)) <= others:
                assert not run.done()
                return False
            os.kill(victim, signal.SIGSTOP)
            if len(parts(folder)) > others:
                return True
            os.kill(victim, signal.SIGCONT)
            return False

        wait_until(halfway)
        before = finished(folder)
        os.kill(victim, signal.SIGKILL)
        report = run.result(timeout=300)
    assert 0 < before < tiles
    assert report.tiles and (report.tiles.kept, report.tiles.made) == (0, tiles)
    assert finished(folder) == tiles
    mosaic(tmp_path / "b", grid, layers=layers)
    assert contents(folder) == contents(tmp_path / "b")
    assert not list(folder.glob(".*"))


@pytest.mark.nightly
def test_the_coordinator_is_killed_and_resumes_without_dask(
    tmp_path: Path, saved: Callable[..., Path]
) -> None:
    """What the workers had finished is kept, whoever goes on; their processes do not stay."""
    folder = tmp_path / "a"
    arguments = ["export-dem", saved(SITE), "--resolution", "0.004", "--tile-size", "512"]
    arguments += ["--tiles", folder]
    command = [*COMMAND, *map(str, arguments), "--dask", "local", "--threads", "2"]
    with subprocess.Popen(command, env=ENVIRONMENT, stderr=subprocess.PIPE) as process:
        wait_until(lambda: finished(folder) >= 2 or process.poll() is not None)
        process.kill()
        assert process.stderr  # ends when all processes that have it are gone
        assert b"Traceback" not in process.stderr.read()
    assert process.returncode == -signal.SIGKILL
    count = finished(folder)
    done = subprocess.run(
        [*COMMAND, *map(str, arguments), "--json"], env=ENVIRONMENT, capture_output=True, check=True
    )
    tiles = json.loads(done.stdout)["tiles"]
    assert tiles["kept"] == count >= 2 and tiles["kept"] + tiles["made"] == 24
    mosaic(tmp_path / "b", grid_at(0.004))
    assert contents(folder) == contents(tmp_path / "b")


@pytest.mark.nightly
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal(tmp_path: Path, saved: Callable[..., Path], number: signal.Signals) -> None:
    """To all processes at once, as a terminal sends it: no word of Dask's, nothing half-written."""
    folder = tmp_path / "a"
    command = [*COMMAND, "export-dem", saved(SITE), "--resolution", "0.002", "--tile-size", "512"]
    command += ["--tiles", folder, "--dask", "local", "--threads", "2"]
    with subprocess.Popen(
        [*map(str, command)],
        env=ENVIRONMENT, stderr=subprocess.PIPE, text=True, start_new_session=True,
    ) as process:  # fmt: skip
        wait_until(lambda: finished(folder) >= 2 or process.poll() is not None)
        os.killpg(process.pid, number)
        _, told = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert told.strip() == ("terratool: stopped." if number == signal.SIGINT else "")
    assert finished(folder) >= 2 and not list(folder.glob(".*"))


@pytest.mark.nightly
def test_what_is_killed_leaves_no_word_of_its_processes() -> None:
    """As where a command takes too long to end after a signal."""
    code = """
import os
from terratool.cluster import local_cluster
if __name__ == "__main__":
    kept = local_cluster(2)
    os._exit(3)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], env=ENVIRONMENT, stderr=subprocess.PIPE, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (3, "")


class TestSent:
    """What travels to the workers."""

    def tiler(self, folder: Path) -> TileMaker:
        terrain = terrain_of(SITE)
        files = files_of(layers_named(ALL), terrain, np.dtype("float32"))
        tiling = Tiling(grid_at(0.01), files, Compression(), 512, True, folder)
        return TileMaker(terrain, tiling, folder)

    @pytest.mark.parametrize("shift", [0, 1, 4])
    def test_arrays_that_arrive_are_as_good(self, tmp_path: Path, shift: int) -> None:
        """Dask hands over arrays as they were received: read-only, and at any address."""
        buffers: list[Any] = []
        tiler = self.tiler(tmp_path)
        sent = pickle.dumps(tiler, 5, buffer_callback=buffers.append)
        frames = [bytes(shift) + bytes(buffer) for buffer in buffers]
        arrived = pickle.loads(sent, buffers=[memoryview(frame)[shift:] for frame in frames])
        assert shift or not arrived.terrain.arrays.elements.flags.writeable
        window = tiler.tiling.grid.whole
        planes = [Painter(t.terrain, t.tiling.grid).paint(window) for t in (tiler, arrived)]
        assert np.array_equal(planes[0].heights, planes[1].heights, equal_nan=True)

    @pytest.mark.nightly
    def test_the_terrain_travels_once(self, tmp_path: Path, monkeypatch: Any) -> None:
        """A tile takes no more than its place, however large the terrain."""
        sizes = []
        perform = ours._perform

        class Client(distributed.Client):  # type: ignore[misc, name-defined]
            def scatter(self, data: Any, **options: Any) -> Any:
                sizes.append(("terrain", len(pickle.dumps(data, 5))))
                return super().scatter(data, **options)

            def submit(self, function: Any, terrain: Any, *arguments: Any, **options: Any) -> Any:
                assert function is perform and isinstance(terrain, distributed.Future)
                sizes.append(("tile", len(pickle.dumps(arguments))))
                return super().submit(function, terrain, *arguments, **options)

        monkeypatch.setattr(distributed, "Client", Client)
        mosaic(tmp_path / "a", grid_at(0.01), dask="local", threads=2)
        assert [what for what, _ in sizes] == ["terrain"] + ["tile"] * 6
        assert max(size for what, size in sizes if what == "tile") < 1000

    def test_a_folder_that_is_not_shared(self, tmp_path: Path) -> None:
        """Or from which the run has gone that wanted the tile: nothing may be written then."""
        tiler = self.tiler(tmp_path / "not" / "here")
        with pytest.raises(WriteError, match="is not seen, or no longer written"):
            tiler.make((0, next(tiler.tiling.tiles()), None))
        assert list(tmp_path.iterdir()) == []


class TestWrong:
    """A sentence, and not a word of Dask's own."""

    @pytest.mark.nightly
    def test_no_scheduler(self, tmp_path: Path, saved: Callable[..., Path]) -> None:
        command = [*COMMAND, "export-dem", saved(SITE), "--tiles", tmp_path / "a", "--dask"]
        environment = {**ENVIRONMENT, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "1s"}
        for address in ("tcp://127.0.0.1:1", "nonsense://x", "no host at all"):
            done = subprocess.run(
                [*map(str, command), address],
                env=environment, capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert done.returncode == 3
            assert done.stderr.splitlines() == [
                f"terratool: {address}: no Dask scheduler answers.",
                "  Give an address such as tcp://host:8786, or start one: dask scheduler",
            ]
            assert not (tmp_path / "a").exists()

    @pytest.mark.nightly
    def test_the_scheduler_is_killed(self, tmp_path: Path, saved: Callable[..., Path]) -> None:
        """A scheduler and a worker as on a cluster; what was finished is kept."""
        there, folder = tmp_path / "scheduler.json", tmp_path / "a"
        environment = {**ENVIRONMENT, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "2s"}
        dask = [sys.executable, "-m", "distributed.cli.dask_"]
        with contextlib.ExitStack() as stack:

            def started(*command: object) -> Any:
                process = stack.enter_context(
                    subprocess.Popen(
                        [*map(str, command)], env=environment, stderr=subprocess.PIPE, text=True
                    )
                )
                stack.callback(process.kill)
                return process

            options = ["--host", "127.0.0.1", "--no-dashboard"]
            scheduler = started(
                *dask[:2], dask[2] + "scheduler", *options, "--port", 0, "--scheduler-file", there,
                "--dashboard-address", "127.0.0.1:0",
            )  # fmt: skip
            wait_until(lambda: there.exists() and there.read_text().endswith("}"))
            address = json.loads(there.read_text())["address"]
            started(*dask[:2], dask[2] + "worker", address, *options, "--nthreads", 1, "--no-nanny")
            run = started(
                *COMMAND, "export-dem", saved(SITE), "--resolution", 0.004, "--tile-size", 512,
                "--tiles", folder, "--dask", address,
            )  # fmt: skip
            wait_until(lambda: finished(folder) >= 2 or run.poll() is not None)
            scheduler.kill()
            _, told = run.communicate(timeout=200)
        assert run.returncode == 3
        assert told.splitlines() == [
            f"terratool: {address}: the Dask scheduler, or each of its workers, was lost.",
            "  Start them anew; the next run goes on where this one stopped.",
        ]
        assert finished(folder) >= 2 and not list(folder.glob(".*"))

    @pytest.mark.slow
    def test_the_scheduler_is_lost_while_a_result_travels(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """That is no failure of the worker's."""

        def gone(future: Any) -> Any:
            raise distributed.comm.CommClosedError("reset by peer")

        with ours.local_cluster(1) as cluster:
            monkeypatch.setattr(distributed.Future, "result", gone)
            with pytest.raises(WriteError, match="the Dask scheduler, or each of its workers"):
                mosaic(tmp_path / "a", grid_at(0.01), dask=cluster.scheduler_address)

    def test_no_workers(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(ours, "_PATIENCE", 0.2)
        with ours.local_cluster(0) as cluster, pytest.raises(WriteError, match="has had no worker"):
            mosaic(tmp_path / "a", grid_at(0.01), dask=cluster.scheduler_address)

    def test_no_dask(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "distributed", None)
        with pytest.raises(RequestError, match=r'-m pip install "terratool\[dask\]"'):
            mosaic(tmp_path / "a", grid_at(0.01), dask="local")

    @pytest.mark.slow
    def test_a_worker_complains(self, tmp_path: Path) -> None:
        """What it cannot write, it says in the words of the program."""
        grid = grid_at(0.01)
        (tmp_path / "a" / "tile-0-1.tif").mkdir(parents=True)
        with pytest.raises(WriteError, match=r"tile-0-1\.tif: is a folder"):
            mosaic(tmp_path / "a", grid, dask="local", threads=1)
        assert not list((tmp_path / "a").glob(".*"))

    @pytest.mark.nightly
    def test_many_workers_are_lost_by_one_tile(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """As Dask allows so many; here the first is the last."""
        monkeypatch.setattr(TileMaker, "__reduce__", lambda tiler: (_Deadly, ()))
        with (
            ours.local_cluster(1, allowed_failures=0) as cluster,
            pytest.raises(
                WriteError, match=r"tile 0, \d: all workers that made it were lost, 1 of them"
            ),
        ):
            mosaic(tmp_path / "a", grid_at(0.01), dask=cluster.scheduler_address)


class _Deadly:
    """A tiler that ends its process."""

    @property
    def tiling(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.nightly
def test_jobs_are_taken_when_there_is_room(tmp_path: Path) -> None:
    """A planet's millions of tiles do not wait at the scheduler all at once."""
    taken: list[int] = []
    most = 0
    terrain, grid = terrain_of(SITE), grid_at(0.005)
    files = files_of(layers_named(["height"]), terrain, np.dtype("float32"))
    tiling = Tiling(grid, files, Compression(), 512, False, tmp_path)
    lock = threading.Lock()

    def jobs() -> Iterator[Any]:
        for number, tile in enumerate(tiling.tiles()):
            with lock:
                taken.append(number)
            yield number, tile, None

    done = 0
    work = mosaics._work(TileMaker(terrain, tiling, tmp_path))
    with ours.crew_of("local", 1) as crew, contextlib.closing(crew.run(work, jobs())) as made:
        for _ in made:
            most = max(most, len(taken) - done)
            done += 1
    assert done == len(taken) == 20 and most <= 3
