"""Cases in forked workers: which of them end in a traceback, take too long or too much, or crash.

A case is the name and the bytes of a file. Worker k of n makes and tries the cases k, k + n, …;
case i depends on the seed, the target and i alone. What fails is tried once more by itself, in a
process of its own, and made smaller.
"""

from __future__ import annotations

import contextlib
import faulthandler
import json
import mmap
import os
import pickle
import random
import resource
import select
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from terratool.errors import TerratoolError
from tests.commands import call

SECONDS = 2.0
"""A case takes no more than this of a processor …"""
BYTES = 500 << 20
"""… and no more memory than this, beyond what the worker had."""
_HANG = 15.0
"""A case that takes longer than this on the clock is stopped."""
_CAP = 4 << 30
"""What a worker may take at all, so that the machine goes on."""
_STATE = struct.Struct("=qqd")
_HEADER = struct.Struct("=I")


class Case(NamedTuple):
    """A file: what its name ends with, and its bytes."""

    suffix: str
    data: bytes


@dataclass(frozen=True)
class Target:
    """What is tried.

    Attributes:
        name: of the target, and of its folder in the corpus.
        count: cases of a full run.
        make: a case from random numbers.
        attempt: uses a case in an empty folder; says in a word or two what came of it, and raises
            what is no error of terratool only by mistake.
    """

    name: str
    count: int
    make: Callable[[random.Random], Case]
    attempt: Callable[[Case, Path], str]


class WrongError(Exception):
    """An answer that is not what it must be."""


def ask(*arguments: object) -> str:
    """Run a command, which ends in a code that is known; what it says on standard output."""
    ran = call(*arguments)
    if ran.code not in (0, 1, 2, 3):
        raise WrongError(f"{arguments[0]} ends with {ran.code}")
    if ran.code and not ran.out + ran.err:
        raise WrongError(f"{arguments[0]} fails without a word")
    return ran.out


class Fault(NamedTuple):
    """What is wrong with a case.

    Attributes:
        kind: "traceback", "slow", "large", "crash" or "output".
        where: what tells faults apart: the error and its place.
        detail: all that is known.
        case: the file.
    """

    kind: str
    where: str
    detail: str
    case: Case


KINDS = ("traceback", "slow", "large", "crash", "output")


@dataclass
class Tally:
    """What came of a run.

    Attributes:
        cases: how many were tried.
        outcomes: how often each word was said.
        faults: those that are alike only once.
        counts: how many there were of each kind.
    """

    cases: int = 0
    seconds: float = 0.0
    outcomes: Counter[str] = field(default_factory=Counter)
    faults: dict[tuple[str, str], Fault] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)


# --- one case ------------------------------------------------------------------------------------


def attempt(target: Target, case: Case, folder: Path) -> tuple[str, Fault | None]:
    """What came of a case in this process, and what is wrong with that."""
    complaints: list[str] = []

    def overheard(unraisable: Any) -> None:
        complaints.append(f"unraisable {unraisable.exc_value!r}")

    before, sys.unraisablehook = sys.unraisablehook, overheard
    size, peak, begin = _said(), _peak(), _seconds()
    outcome, kind, where, detail = "refused", "", "", ""
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            outcome = target.attempt(case, folder)
    except MemoryError:
        kind, where = "large", "MemoryError"
    except TerratoolError as error:
        if isinstance(error.__cause__, MemoryError):
            kind, where, detail = "large", "MemoryError", str(error)
    except BaseException as error:
        kind, where, detail = "traceback", _place(error), traceback.format_exc()
    finally:
        sys.unraisablehook = before
    complaints += [f"{one.category.__name__}: {one.message}" for one in warned]
    if not kind and (seconds := _seconds() - begin) > SECONDS:
        kind, where, detail = "slow", "", f"{seconds:.1f} s"
    if not kind and (taken := _peak() - peak) > BYTES:
        kind, where, detail = "large", "", f"{taken >> 20} MB"
    if not kind and (complaints or _said() > size):
        spoken = os.pread(2, 2000, size).decode("utf-8", "replace").strip()
        kind, where = "output", (complaints or [spoken])[0][:40]
        detail = "\n".join([*complaints, spoken])
    return outcome, Fault(kind, where, detail, case) if kind else None


def _place(error: BaseException) -> str:
    """The error and the innermost line of terratool that it came through."""
    lines = traceback.extract_tb(error.__traceback__)
    ours = [line for line in lines if "/terratool/" in line.filename] or list(lines)
    name = ours[-1].filename.rpartition("/terratool/")[2]
    return f"{type(error).__name__} at {name}:{ours[-1].lineno}"


def _peak() -> int:
    """The most memory so far, in bytes, of this process or one that it started."""
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return max(own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss) << 10


def _seconds() -> float:
    """Of processors, those of processes that were started and have ended included."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def _said() -> int:
    """Bytes on standard error, which is a file in a worker."""
    return os.fstat(2).st_size


# --- workers -------------------------------------------------------------------------------------


class _Worker:
    """A forked process, and what it is at."""

    def __init__(self, work: Callable[[_Worker], None]) -> None:
        self._state = mmap.mmap(-1, _STATE.size)
        self._inlet, outlet = os.pipe()
        self._buffer = b""
        self.at(-1)
        sys.stdout.flush()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # threads, which idle here
            self.process = os.fork()
        if self.process == 0:
            os.close(self._inlet)
            self._outlet = outlet
            code = 1
            try:
                _settle()
                work(self)
                code = 0
            except BaseException:
                self.tell(traceback.format_exc())
            finally:
                os._exit(code)
        os.close(outlet)

    def at(self, index: int, done: int = 0) -> None:
        """Say which case comes now, and how many it has not told of."""
        self._state[:] = _STATE.pack(index, done, time.monotonic())

    @property
    def index(self) -> int:
        """The case that it is at, or died of; -1 where it is at none."""
        return int(_STATE.unpack(self._state[:])[0])

    @property
    def untold(self) -> int:
        """Cases before that which it has not told of."""
        return int(_STATE.unpack(self._state[:])[1])

    @property
    def hangs(self) -> bool:
        return bool(time.monotonic() - _STATE.unpack(self._state[:])[2] > _HANG)

    def tell(self, value: Any) -> None:
        """Send something to the process that began this one."""
        data = pickle.dumps(value)
        data = _HEADER.pack(len(data)) + data
        while data:
            data = data[os.write(self._outlet, data) :]

    def fileno(self) -> int:
        return self._inlet

    def hear(self) -> tuple[list[Any], bool]:
        """What it has told, and whether it has ended."""
        chunk = os.read(self._inlet, 1 << 20)
        self._buffer += chunk
        told = []
        while len(self._buffer) >= _HEADER.size:
            end = _HEADER.size + _HEADER.unpack(self._buffer[: _HEADER.size])[0]
            if len(self._buffer) < end:
                break
            told.append(pickle.loads(self._buffer[_HEADER.size : end]))
            self._buffer = self._buffer[end:]
        return told, not chunk

    def stop(self) -> int:
        """End it; the signal that it died of, or 0."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.process, signal.SIGKILL)
        return self.wait()

    def wait(self) -> int:
        """The signal that it died of, or 0."""
        _, status = os.waitpid(self.process, 0)
        os.close(self._inlet)
        return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0


def _settle() -> None:
    """Take what a worker may, and send what it prints into a file."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    faulthandler.disable()  # it is pytest's, and would print there
    with tempfile.TemporaryFile() as sink:
        os.dup2(sink.fileno(), 1)
        os.dup2(sink.fileno(), 2)
    resource.setrlimit(resource.RLIMIT_DATA, (_CAP, _CAP))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


@contextlib.contextmanager
def _scratch() -> Iterator[Path]:
    """An empty folder, in memory where that is possible."""
    memory = Path("/dev/shm")
    where = memory if memory.is_dir() else None
    with tempfile.TemporaryDirectory(prefix="terratool-fuzz-", dir=where) as name:
        yield Path(name)


def alone(target: Target, case: Case) -> Fault | None:
    """What is wrong with a case, in a process of its own."""

    def work(worker: _Worker) -> None:
        worker.tell(attempt(target, case, folder)[1])

    with _scratch() as folder:
        worker, until = _Worker(work), time.monotonic() + _HANG
        ready, told, ended = True, [], False
        while ready and not told and not ended:  # a long case comes piece by piece
            ready = bool(select.select([worker], [], [], max(0.0, until - time.monotonic()))[0])
            told, ended = worker.hear() if ready else ([], True)
        number = worker.wait() if ready else worker.stop()
    if not ready:
        return Fault("slow", "", f"more than {_HANG:g} s", case)
    if not told:
        return Fault("crash", _signal(number), "", case)
    if isinstance(told[0], str):
        raise RuntimeError(told[0])
    fault: Fault | None = told[0]
    return fault


def _signal(number: int) -> str:
    return signal.Signals(number).name if number else "exit"


def case_of(target: Target, seed: int, index: int) -> Case:
    """A case by its number."""
    return target.make(random.Random(f"{seed} {target.name} {index}"))


def run(target: Target, count: int, seed: int, seconds: float, processes: int) -> Tally:
    """Try so many cases, for so long at most."""
    tally, begin = Tally(), time.monotonic()
    with _scratch() as folder:
        workers = {
            lane: _begin(target, seed, range(lane, count, processes), folder, begin + seconds)
            for lane in range(processes)
        }
        while workers:
            ready = select.select(list(workers.values()), [], [], 0.5)[0]
            for lane, worker in list(workers.items()):
                ended, number = False, 0
                if worker in ready:
                    told, ended = worker.hear()
                    for one in told:
                        if isinstance(one, str):  # a fault of ours, outside of a case
                            raise RuntimeError(one)
                        cases, outcomes, fault = one
                        tally.cases += cases
                        tally.outcomes.update(outcomes)
                        if fault is not None:
                            _take(tally, target, fault)
                    if ended:
                        number = worker.wait()
                elif worker.hangs:
                    ended, number = True, worker.stop()
                if ended:
                    del workers[lane]
                    if number or worker.index >= 0:  # it died of a case
                        tally.cases += worker.untold + 1
                        _take(tally, target, alone(target, case_of(target, seed, worker.index)))
                        rest = range(worker.index + processes, count, processes)
                        workers[lane] = _begin(target, seed, rest, folder, begin + seconds)
    tally.seconds = time.monotonic() - begin
    return tally


def _begin(target: Target, seed: int, indexes: range, scratch: Path, until: float) -> _Worker:
    """A worker for some cases; it says how many it has done, and what is wrong with one."""

    def work(worker: _Worker) -> None:
        folder = Path(tempfile.mkdtemp(dir=scratch))
        done, outcomes, said = 0, Counter[str](), time.monotonic()
        for index in indexes:
            worker.at(index, done)
            case = case_of(target, seed, index)
            outcome, fault = attempt(target, case, folder)
            done += 1
            outcomes[outcome] += 1
            now = time.monotonic()
            if fault is not None or now - said > 1:
                worker.tell((done, outcomes, fault))
                done, outcomes, said = 0, Counter[str](), now
            if now > until:
                break
        worker.tell((done, outcomes, None))
        worker.at(-1)

    return _Worker(work)


def _take(tally: Tally, target: Target, fault: Fault | None) -> None:
    """Count a fault that shows again by itself, and make the first of its like smaller."""
    if fault is None:
        return
    if fault.kind in ("slow", "large") or (fault.kind, fault.where) not in tally.faults:
        fault = alone(target, fault.case)
        if fault is None:  # something else had the machine, or its memory
            return
    if (fault.kind, fault.where) not in tally.faults:
        tally.faults[fault.kind, fault.where] = smaller(target, fault)
    tally.counts[fault.kind] += 1


# --- smaller -------------------------------------------------------------------------------------


def smaller(target: Target, fault: Fault, tries: int = 500, seconds: float = 60) -> Fault:
    """A fault of the same kind at the same place, with as little as possible around it."""
    until = time.monotonic() + seconds
    found = True
    while found:
        found = False
        for data in _parts(fault.case.data):
            tries -= 1
            if tries < 0 or time.monotonic() > until:
                return fault
            less = alone(target, Case(fault.case.suffix, data))
            if less and (less.kind, less.where) == (fault.kind, fault.where):
                fault, found = less, True
                break
    return fault


def _parts(data: bytes) -> Iterator[bytes]:
    """What is left of some bytes without a part of them, from the largest parts on."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        tree = None
    if not isinstance(tree, dict | list):
        size = len(data) // 2
        while size:
            for start in range(0, len(data), size):
                yield data[:start] + data[start + size :]
            size //= 2
        return
    text = json.dumps(tree).encode()
    if len(text) < len(data):
        yield text
    places = []
    pending = [tree]
    while pending:
        node = pending.pop()
        keys = list(node) if isinstance(node, dict) else range(len(node))
        for key in keys:
            places.append((len(json.dumps(node[key])), len(places), node, key))
            if isinstance(node[key], dict | list):
                pending.append(node[key])
    for _, _, node, key in sorted(places, key=lambda place: (-place[0], place[1])):
        before = node[key]
        members = dict(node) if isinstance(node, dict) else None
        del node[key]
        yield json.dumps(tree).encode()
        if members is None:
            node.insert(key, before)
        else:
            node.clear()
            node.update(members)
