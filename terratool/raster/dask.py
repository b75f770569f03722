"""Tiles of a mosaic made by the workers of a Dask scheduler, on this machine or on others.

The terrain is sent once and handed on among the workers. They write the tiles themselves, so that
all need to share the folder; only what is known of a tile comes back.
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
"""In place of an address: processes on this machine."""

_PATIENCE = 60
"""Seconds to wait for a first worker."""

_AHEAD = 2
"""Tiles for each thread of the workers that wait at the scheduler, so that none is ever idle."""

_LOST = 5
"""How often in a row tiles may be lost together with all workers that knew the terrain."""


@contextlib.contextmanager
def connected(address: str, processes: int) -> Iterator[Client]:
    """A connection to a Dask scheduler, whose log is quiet; "local" is processes on this machine.

    Raises:
        RequestError: Dask is not installed.
        WriteError: no scheduler answers.
    """
    try:
        import distributed  # noqa: F401 # before its log is made quiet
    except ImportError as error:
        raise RequestError("Dask is not installed.", f"Run {install_command('dask')}") from error
    with _quiet(), _client(address, processes) as client:
        yield client


def made_by_dask(
    client: Client, tiler: TileMaker, jobs: Iterable[Job], address: str
) -> Generator[Done, None, None]:
    """Make tiles by Dask, in the order in which they are complete.

    A tile whose worker is lost is made by another one, unless it has lost as many as Dask allows
    (its setting distributed.scheduler.allowed-failures).

    Args:
        client: the connection.
        tiler: makes a tile.
        jobs: the tiles; are taken one by one when there is room for them.
        address: what the scheduler is called in messages.

    Raises:
        RequestError: terratool is not installed on the workers.
        WriteError: the scheduler is lost, it has no workers, or they cannot write.
    """
    try:
        yield from _made(client, tiler, iter(jobs), address)
    except (OSError, TimeoutError) as error:
        raise WriteError(
            f"{address}: the Dask scheduler, or each of its workers, was lost.",
            "Start them anew; the next run goes on where this one stopped.",
        ) from error


def _made(
    client: Client, tiler: TileMaker, jobs: Iterator[Job], address: str
) -> Generator[Done, None, None]:
    from distributed import as_completed

    try:
        terrain = _sent(client, tiler)
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
            if again:  # all workers that knew the terrain are gone
                lost += 1
                if lost > _LOST:
                    raise WriteError(
                        f"{address}: the workers were lost {lost} times in a row.",
                        "Look at their logs; the next run goes on where this one stopped.",
                    )
                if terrain.status != "finished":
                    terrain = _sent(client, tiler)
                jobs = chain(again, jobs)
            submit()
    except BaseException:
        remove_scratch(tiler.scratch)  # workers see that and stop
        raise
    finally:
        with contextlib.suppress(Exception):  # the scheduler may be gone
            client.cancel([future for _, future in waiting.values()])


def _make(
    tiler: TileMaker, tile: RasterTile, known: FinishedTile | None
) -> tuple[FinishedTile, bool]:
    """Make a tile on a worker."""
    return tiler.make(tile, known, tiler.check)


def _sent(client: Client, tiler: TileMaker) -> Future:
    """The tiler on all workers that are there; later ones get it from these."""
    client.wait_for_workers(1, timeout=_PATIENCE)
    return client.scatter(tiler, broadcast=True, hash=False)


def _result(future: Future, tile: RasterTile) -> tuple[FinishedTile, bool]:
    """What a worker says of a tile, or its complaint in a sentence."""
    from distributed import KilledWorker
    from distributed.comm import CommClosedError

    where = f"tile {tile.row}, {tile.column}"
    try:
        result: tuple[FinishedTile, bool] = future.result()
    except (TerratoolError, CommClosedError):  # that is our own connection to the scheduler
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
    """A connection to a scheduler, which is started for it if it is to be local."""
    from distributed import Client
    from distributed.comm import normalize_address, resolve_address

    with contextlib.ExitStack() as stack:
        try:
            if address == LOCAL:
                cluster = stack.enter_context(local_cluster(processes))
                client = Client(cluster, set_as_default=False)
            else:
                # a client that cannot even resolve it would complain once more when it is deleted
                resolve_address(normalize_address(address))
                client = Client(address, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise WriteError(
                f"{address}: no Dask scheduler answers.",
                "Give an address such as tcp://host:8786, or start one: dask scheduler",
            ) from error
        yield stack.enter_context(client)


def local_cluster(processes: int, **scheduler: Any) -> LocalCluster:
    """A scheduler, with these options, and processes of one thread, for this machine alone."""
    from distributed import LocalCluster

    with _deaf_to_interrupts():
        return LocalCluster(
            n_workers=processes, threads_per_worker=1, processes=True, host="127.0.0.1",
            dashboard_address=None, silence_logs=logging.CRITICAL,
            # its web server is there even without a dashboard, and would want port 8787
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0", **scheduler},
        )  # fmt: skip


@contextlib.contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Let threads and processes that are started now, and theirs, hear no Ctrl-C.

    A terminal sends it to all processes; it is for the one that started the others to end them.
    """
    if not hasattr(signal, "pthread_sigmask"):  # not there on Windows
        yield
        return
    _start_tracker()  # would unblock them again later
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_tracker() -> None:
    """Start the process that cleans up after killed ones, and let it do so in silence."""
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
def _quiet() -> Iterator[None]:
    """Leave the log of Dask to its own processes: what matters here becomes a sentence."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    before = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)
