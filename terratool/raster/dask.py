"""Tiles of a mosaic made by the workers of a Dask scheduler, on this machine or on others.

The terrain is sent once and passed on among the workers. Workers write the tiles, so all must share
the folder; only the statistics and checksums of a tile are returned.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
from collections.abc import Generator, Iterable, Iterator
from itertools import chain, islice
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from terratool.errors import RequestError, TerratoolError, WriteError
from terratool.extras import install_command
from terratool.raster.tiles import Done, FinishedTile, Job, RasterTile, TileMaker, remove_scratch

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster


LOCAL = "local"
"""Address that stands for processes on this machine."""

_PATIENCE = 60
"""Seconds to wait for a first worker."""

_AHEAD = 2
"""Tiles queued at the scheduler per worker thread, so that no thread idles."""

_LOST = 5
"""Most consecutive losses of tiles together with all workers that hold the terrain."""


@contextlib.contextmanager
def connect(address: str, processes: int) -> Iterator[Client]:
    """Connect to a Dask scheduler for the block, with its log silenced.

    Args:
        address: address of the scheduler; "local" starts one on this machine.
        processes: number of processes of a local scheduler.

    Raises:
        RequestError: Dask is not installed.
        WriteError: no scheduler answers.
    """
    try:
        import distributed  # noqa: F401 # before its log is made quiet
    except ImportError as error:
        raise RequestError("Dask is not installed.", f"Run {install_command('dask')}") from error
    with _silent_log(), _client(address, processes) as client:
        yield client


def make_by_dask(
    client: Client, tiler: TileMaker, jobs: Iterable[Job], address: str
) -> Generator[Done, None, None]:
    """Make tiles by Dask workers, yielded in order of completion.

    A tile whose worker is lost goes to another worker, as often as Dask's setting
    distributed.scheduler.allowed-failures permits.

    Args:
        client: connection to the scheduler.
        tiler: maker of tiles, sent to the workers.
        jobs: tiles to be made, taken one by one as the queue has room.
        address: name of the scheduler in messages.

    Raises:
        RequestError: terratool is not installed on the workers.
        WriteError: the scheduler is lost, it has no workers, or these cannot write.
    """
    try:
        yield from _make_tiles(client, tiler, iter(jobs), address)
    except (OSError, TimeoutError) as error:
        raise WriteError(
            f"{address}: the Dask scheduler, or each of its workers, was lost.",
            "Start them anew; the next run goes on where this one stopped.",
        ) from error


def _make_tiles(
    client: Client, tiler: TileMaker, jobs: Iterator[Job], address: str
) -> Generator[Done, None, None]:
    from distributed import as_completed

    try:
        terrain = _send(client, tiler)
    except (OSError, TimeoutError) as error:
        raise WriteError(
            f"{address}: the scheduler has had no worker for {_PATIENCE} seconds.",
            f"Start some: dask worker {address}",
        ) from error
    waiting: dict[str, tuple[Job, Future]] = {}
    completed = as_completed(loop=client.loop)
    lost = 0

    def submit() -> None:
        room = _AHEAD * max(1, sum(client.nthreads().values())) - len(waiting)
        for job in islice(jobs, max(0, room)):
            key = f"tile-{job[0]}-{uuid4().hex}"
            future = client.submit(_make, terrain, *job[1:], key=key, pure=False)
            waiting[key] = job, future
            completed.add(future)

    try:
        submit()
        for batch in completed.batches():
            again = []
            for future in batch:
                job, _ = waiting.pop(future.key)
                if future.status in ("finished", "error"):
                    lost = 0
                    yield job[0], *_result(future, job[1])
                else:
                    again.append(job)
            if again:  # all workers that held the terrain are gone
                lost += 1
                if lost > _LOST:
                    raise WriteError(
                        f"{address}: the workers were lost {lost} times in a row.",
                        "Look at their logs; the next run goes on where this one stopped.",
                    )
                if terrain.status != "finished":
                    terrain = _send(client, tiler)
                jobs = chain(again, jobs)
            submit()
    except BaseException:
        remove_scratch(tiler.scratch)  # workers notice and stop
        raise
    finally:
        with contextlib.suppress(Exception):  # the scheduler may be gone
            client.cancel([future for _, future in waiting.values()])


def _make(
    tiler: TileMaker, tile: RasterTile, known: FinishedTile | None
) -> tuple[FinishedTile, bool]:
    """Make a tile on a worker; returns as `TileMaker.make`."""
    return tiler.make(tile, known, tiler.check)


def _send(client: Client, tiler: TileMaker) -> Future:
    """Send the tile maker to all present workers; later ones fetch it from these."""
    client.wait_for_workers(1, timeout=_PATIENCE)
    return client.scatter(tiler, broadcast=True, hash=False)


def _result(future: Future, tile: RasterTile) -> tuple[FinishedTile, bool]:
    """Result of a tile from its worker; errors of the worker become sentences."""
    from distributed import KilledWorker
    from distributed.comm import CommClosedError

    where = f"tile {tile.row}, {tile.column}"
    try:
        result: tuple[FinishedTile, bool] = future.result()
    except (TerratoolError, CommClosedError):  # the latter: our own connection is lost
        raise
    except KilledWorker as error:
        raise WriteError(
            f"{where}: all workers that made it were lost, {error.allowed_failures + 1} of them.",
            "Give them more memory, or take a smaller --tile-size.",
        ) from error
    except ImportError as error:
        raise RequestError(
            f"{where}: a worker cannot load terratool ({error}).",
            "Install the same version for all workers.",
        ) from error
    except Exception as error:
        raise WriteError(
            f"{where}: a worker failed ({type(error).__name__}: {error}).",
            "Look at its log; the next run goes on where this one stopped.",
        ) from error
    return result


@contextlib.contextmanager
def _client(address: str, processes: int) -> Iterator[Any]:
    """Connect to a scheduler for the block; a local one is started first."""
    from distributed import Client
    from distributed.comm import normalize_address, resolve_address

    with contextlib.ExitStack() as stack:
        try:
            if address == LOCAL:
                cluster = stack.enter_context(local_cluster(processes))
                client = Client(cluster, set_as_default=False)
            else:
                # a client with an address that does not resolve prints an error on deletion
                resolve_address(normalize_address(address))
                client = Client(address, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise WriteError(
                f"{address}: no Dask scheduler answers.",
                "Give an address such as tcp://host:8786, or start one: dask scheduler",
            ) from error
        yield stack.enter_context(client)


def local_cluster(processes: int, **scheduler: Any) -> LocalCluster:
    """Start a scheduler and one-thread worker processes that only this machine can reach."""
    from distributed import LocalCluster

    with _blocked_interrupts():
        return LocalCluster(
            n_workers=processes, threads_per_worker=1, processes=True, host="127.0.0.1",
            dashboard_address=None, silence_logs=logging.CRITICAL,
            # the web server starts even without a dashboard, by default on port 8787
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0", **scheduler},
        )  # fmt: skip


@contextlib.contextmanager
def _blocked_interrupts() -> Iterator[None]:
    """Block SIGINT for threads and processes started in the block, and their children.

    A terminal sends Ctrl-C to all processes; the parent ends the others.
    """
    if not hasattr(signal, "pthread_sigmask"):  # not there on Windows
        yield
        return
    _start_tracker()  # started later, it would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_tracker() -> None:
    """Start multiprocessing's resource tracker without its warnings."""
    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = "ignore:resource_tracker:UserWarning"
    try:
        resource_tracker.ensure_running()
    finally:
        if before is None:
            del os.environ["PYTHONWARNINGS"]
        else:
            os.environ["PYTHONWARNINGS"] = before


@contextlib.contextmanager
def _silent_log() -> Iterator[None]:
    """Silence Dask's loggers in this process for the block; errors become sentences."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    before = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)
