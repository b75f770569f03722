"""Helpers for work by Dask: workers that end in the middle of a task, and counts of tasks."""

from __future__ import annotations

import os
import pickle
import signal
from pathlib import Path
from typing import Any

import pytest

from terratool import cluster
from terratool.cluster import Parcel


def kill_in_mid_task(monkeypatch: pytest.MonkeyPatch, log: Path, tasks: int = 3) -> None:
    """Have a worker end in the middle of a task, once, when so many tasks were begun.

    Args:
        monkeypatch: what undoes this.
        log: file that gets a byte for each task that is begun.
        tasks: number of the task that is lost.
    """

    def parcel(content: Any) -> Parcel:
        return Parcel((_do, (str(log), tasks, content)))

    monkeypatch.setattr(cluster, "Parcel", parcel)


def _do(common: Any, job: Any) -> Any:
    """Do a task; the one that is to be lost has its result, but does not get to hand it over."""
    log, lost, (do, own) = common
    with open(log, "ab", buffering=0) as file:
        file.write(b".")
        begun = file.tell()
    result = do(own, job)
    if begun == lost:
        os.kill(os.getpid(), signal.SIGKILL)
    return result


def arrived(content: Any, shift: int) -> Any:
    """Content of a parcel on a worker, whose arrays were received at odd addresses, read-only."""
    buffers: list[pickle.PickleBuffer] = []
    sent = pickle.dumps(Parcel(content), 5, buffer_callback=buffers.append)
    frames = [bytes(shift) + bytes(buffer) for buffer in buffers]
    parcel = pickle.loads(sent, buffers=[memoryview(frame)[shift:] for frame in frames])
    return parcel.open()


def files_in(folder: Path) -> dict[str, bytes]:
    """Content of all files below a folder, by name."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
