"""Interleaved timing: only ratios from one run count on a shared machine."""

from __future__ import annotations

import resource
import statistics
import time
from collections.abc import Callable


def processor() -> float:
    """Seconds of processors that this process and its ended children took."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def medians(
    tasks: dict[str, Callable[[], object]],
    runs: int = 7,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, float]:
    """Seconds of each task: the median of `runs`, taken in turn after one that is not counted."""
    seconds: dict[str, list[float]] = {name: [] for name in tasks}
    for run in range(runs + 1):
        for name, task in tasks.items():
            begin = clock()
            task()
            if run:
                seconds[name].append(clock() - begin)
    return {name: statistics.median(values) for name, values in seconds.items()}


def line(what: str, ratio: float, target: str) -> None:
    """Print one result."""
    print(f"{what:66} {ratio:8.2f} ×   target {target}", flush=True)
