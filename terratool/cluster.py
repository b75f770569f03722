"""Work done by the workers of a Dask scheduler, on this machine or on others, or by threads here.

What tasks have in common is sent once and passed on among the workers. A task whose worker is lost
goes to another one. Results come back; only who asked for them writes files, but for work that says
otherwise.
"""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import signal
import threading
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from itertools import chain, islice
from operator import itemgetter
from socket import gethostname
from typing import TYPE_CHECKING, Any, Protocol, TypeVar
from uuid import uuid4

from terratool._version import __version__
from terratool.errors import RequestError, TerratoolError, WriteError
from terratool.extras import install_command
from terratool.tasks import Work, prefetch

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

T = TypeVar("T")
R = TypeVar("R")

LOCAL = "local"
"""Address that stands for processes on this machine."""

_PATIENCE = 60
"""Seconds to wait for a first worker."""

_AHEAD = 2
"""Tasks queued at the scheduler per worker thread, so that no thread idles."""

_HELD = 4
"""Most tasks per worker thread that are begun while an older one is not done, so that memory has
room for their results."""

_ALIGNMENT = 8
"""Divisor of addresses of arrays."""

_LOST = 5
"""Most consecutive losses of tasks together with all workers that hold what these share."""


class Crew(Protocol):
    """Threads or workers that do independent tasks."""

    def run(self, work: Work[Any, T, R], jobs: Iterable[T]) -> Generator[R, None, None]:
        """Yield the result of each job.

        Args:
            work: work to be done.
            jobs: jobs, taken one by one as there is room.

        Raises:
            RequestError: terratool is not installed on a worker, or in another version.
            WriteError: the scheduler is lost, it has no workers, or a task fails on all of them.
        """


class Threads:
    """Crew of threads of this process.

    Args:
        count: number of threads; 0 for the calling thread alone.
    """

    def __init__(self, count: int) -> None:
        self._count = count

    def run(self, work: Work[Any, T, R], jobs: Iterable[T]) -> Generator[R, None, None]:
        """Yield the result of each job in order; arguments are those of `Crew.run`."""

        def do(job: T) -> R:
            return work.do(work.common, job)

        return prefetch(do, jobs, self._count, work.stop)


@contextlib.contextmanager
def crew_of(dask: str | None, threads: int, processes: int | None = None) -> Iterator[Crew]:
    """Crew for the block: threads, or the workers of a Dask scheduler, whose log is silenced.

    Args:
        dask: address of a Dask scheduler; "local" starts one on this machine; None for threads.
        threads: number of threads; 0 for the calling thread alone.
        processes: number of processes of a local scheduler; that of threads if None.

    Raises:
        RequestError: Dask is not installed.
        WriteError: no scheduler answers.
    """
    if dask is None:
        yield Threads(threads)
        return
    refuse_missing_dask()
    with _silent_log(), _client(dask, processes or threads) as client:
        yield Cluster(client, dask)


def refuse_missing_dask() -> None:
    """Refuse work for Dask where it is not installed.

    Raises:
        RequestError: Dask is not installed.
    """
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise RequestError("Dask is not installed.", f"Run {install_command('dask')}") from error


class Parcel:
    """Common part of tasks on its way to workers, packed until a task opens it.

    So a worker of another version, or one that does not see a file, can say so by the task.

    Args:
        content: function of tasks, and what they have in common.
        version: version of terratool that packed it.
    """

    def __init__(self, content: Any, version: str = __version__) -> None:
        self._content, self._version = content, version
        self._packed: tuple[bytes, list[pickle.PickleBuffer]] | None = None
        self._opening = threading.Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        with self._opening:
            packed = self._packed
            if packed is None:
                buffers: list[pickle.PickleBuffer] = []
                packed = pickle.dumps(self._content, 5, buffer_callback=buffers.append), buffers
        return _arrived, (self._version, *packed)

    def open(self) -> Any:
        """Return the content.

        Raises:
            RequestError: another version of terratool packed it.
            ReadError: it needs a file that is not here, or not the same one.
        """
        if self._version != __version__:
            raise RequestError(
                f"{gethostname()}: has terratool {__version__}, but the work is of "
                f"{self._version}.",
                "Install the same version for all workers.",
            )
        with self._opening:
            if self._packed is not None:
                text, buffers = self._packed
                self._content = pickle.loads(text, buffers=map(_aligned, buffers))
                self._packed = None
            return self._content


def _aligned(buffer: Any) -> Any:
    """Bytes of an array at an address that kernels can read; Dask receives them at any address."""
    import numpy as np

    found = np.frombuffer(buffer, np.uint8)
    return found if found.ctypes.data % _ALIGNMENT == 0 else found.copy()


def _arrived(version: str, text: bytes, buffers: list[pickle.PickleBuffer]) -> Parcel:
    """Parcel on a worker, still packed."""
    parcel = Parcel(None, version)
    parcel._packed = text, buffers
    return parcel


def _perform(parcel: Parcel, job: bytes) -> bytes:
    """Do a task on a worker; job and result are pickled.

    Dask would hand over arrays as they were received: read-only, and at any address.
    """
    do, common = parcel.open()
    return pickle.dumps(do(common, pickle.loads(job)), 5)


class Cluster:
    """Crew of the workers of a Dask scheduler.

    A task whose worker is lost goes to another worker, as often as Dask's setting
    distributed.scheduler.allowed-failures permits.

    Args:
        client: connection to the scheduler.
        address: name of the scheduler in messages.
    """

    def __init__(self, client: Client, address: str) -> None:
        self._client, self._address = client, address

    def run(self, work: Work[Any, T, R], jobs: Iterable[T]) -> Generator[R, None, None]:
        """Yield the result of each job; arguments and errors are those of `Crew.run`."""
        try:
            yield from self._run(work, enumerate(jobs))
        except (OSError, TimeoutError) as error:
            raise WriteError(
                f"{self._address}: the Dask scheduler, or each of its workers, was lost.",
                f"Start them anew; {_AFTER[work.resumes]}",
            ) from error

    def _run(
        self, work: Work[Any, T, R], jobs: Iterator[tuple[int, T]]
    ) -> Generator[R, None, None]:
        from distributed import as_completed

        try:
            parcel = self._send(work)
        except (OSError, TimeoutError) as error:
            raise WriteError(
                f"{self._address}: the scheduler has had no worker for {_PATIENCE} seconds.",
                f"Start some: dask worker {self._address}",
            ) from error
        completed = as_completed(loop=self._client.loop)
        waiting: dict[str, tuple[int, T, Future]] = {}
        ready: dict[int, R] = {}
        lost = wanted = 0

        def submit() -> None:
            threads = max(1, sum(self._client.nthreads().values()))
            room = min(_AHEAD * threads, _HELD * threads - len(ready)) - len(waiting)
            least = 0 if waiting else 1  # workers may have gone, but the oldest task is wanted
            for number, job in islice(jobs, max(least, room)):
                key = f"task-{number}-{uuid4().hex}"
                packed = pickle.dumps(job, 5)
                future = self._client.submit(_perform, parcel, packed, key=key, pure=False)
                waiting[key] = number, job, future
                completed.add(future)

        try:
            submit()
            for batch in completed.batches():
                again: list[tuple[int, T]] = []
                for future in batch:
                    number, job, _ = waiting.pop(future.key)
                    try:
                        if future.status not in ("finished", "error"):
                            raise CancelledError
                        ready[number], lost = _result(future, work, job), 0
                    except CancelledError:
                        again.append((number, job))
                while ready and (wanted in ready or not work.ordered):
                    result = ready.pop(wanted if work.ordered else next(iter(ready)))
                    wanted += 1
                    yield result
                if again:  # all workers that held the parcel are gone
                    lost += 1
                    if lost > _LOST:
                        raise WriteError(
                            f"{self._address}: the workers were lost {lost} times in a row.",
                            f"Look at their logs; {_AFTER[work.resumes]}",
                        )
                    if parcel.status != "finished":
                        parcel = self._send(work)
                    jobs = chain(sorted(again, key=itemgetter(0)), jobs)
                submit()
        except BaseException:
            if work.stop:
                work.stop()
            raise
        finally:
            left = [future for *_, future in waiting.values()]
            with contextlib.suppress(Exception):  # the scheduler may be gone
                self._client.cancel(left)

    def _send(self, work: Work[Any, Any, Any]) -> Future:
        """Send what tasks have in common to all present workers; later ones fetch it from these."""
        self._client.wait_for_workers(1, timeout=_PATIENCE)
        return self._client.scatter(Parcel((work.do, work.common)), broadcast=True, hash=False)


_AFTER = {True: "the next run goes on where this one stopped.", False: "then run this again."}
"""End of a hint after a loss, by whether the next run goes on where this one stopped."""


def _result(future: Future, work: Work[Any, T, R], job: T) -> R:
    """Result of a task from its worker; errors of the worker become sentences."""
    from distributed import KilledWorker
    from distributed.comm import CommClosedError

    try:
        result: R = pickle.loads(future.result())
    except (TerratoolError, CommClosedError, CancelledError):
        raise  # of the last two, one means that our own connection is lost
    except KilledWorker as error:
        smaller = f", or {work.smaller}" if work.smaller else ""
        raise WriteError(
            f"{work.name(job)}: all workers that made it were lost, "
            f"{error.allowed_failures + 1} of them.",
            f"Give them more memory{smaller}.",
        ) from error
    except ImportError as error:
        raise RequestError(
            f"{work.name(job)}: a worker cannot load terratool ({error}).",
            "Install the same version for all workers.",
        ) from error
    except Exception as error:
        raise WriteError(
            f"{work.name(job)}: a worker failed ({type(error).__name__}: {error}).",
            f"Look at its log; {_AFTER[work.resumes]}",
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
    from multiprocessing import resource_tracker

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
