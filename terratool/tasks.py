"""Independent tasks, and threads that do them ahead of the thread that takes their results."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Generic, TypeVar

from terratool.errors import RequestError

T = TypeVar("T")
R = TypeVar("R")
S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class Work(Generic[S, T, R]):
    """Independent tasks that differ by a job and have all else in common.

    Attributes:
        do: function of what is common and of a job, of a module or a class, so that other machines
            find it.
        common: what all tasks have in common; several threads use it at a time.
        name: function of a job that names its task in messages, as "tile 3, 17".
        smaller: what makes a task smaller, for a hint; empty where nothing does.
        stop: called when tasks are given up while some are at work, so that these end, too.
        resumes: whether the next run goes on where this one stopped.
        ordered: whether results come in the order of jobs; those of other machines come as they are
            ready otherwise.
    """

    do: Callable[[S, T], R]
    common: S
    name: Callable[[T], str]
    smaller: str = ""
    stop: Callable[[], object] | None = None
    resumes: bool = False
    ordered: bool = True


def processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def thread_count(threads: int | None) -> int:
    """Number of threads as requested, or the number of processors for None.

    Raises:
        RequestError: the number is below 1.
    """
    if threads is not None and threads < 1:
        raise RequestError(f"The number of threads is {threads}.", "Give 1 or more.")
    return threads or processors()


def prefetch(
    function: Callable[[T], R],
    items: Iterable[T],
    threads: int,
    stop: Callable[[], object] | None = None,
) -> Generator[R, None, None]:
    """Yield `function` of each item, in order, computed by threads a few items ahead.

    Args:
        function: function of an item.
        items: items, taken one by one as threads become free.
        threads: number of threads; 0 for the calling thread alone.
        stop: called before busy threads are awaited whose results nobody takes.
    """
    if not threads:
        yield from map(function, items)
        return
    with ThreadPoolExecutor(threads) as pool:
        waiting: deque[Future[R]] = deque()

        def first() -> R:
            found = waiting[0].result()  # which stays, if the wait for it is broken off
            waiting.popleft()
            return found

        try:
            for item in items:
                waiting.append(pool.submit(function, item))
                if len(waiting) > threads:
                    yield first()
            while waiting:
                yield first()
        finally:
            for future in waiting:
                future.cancel()
            if waiting and stop:
                stop()
