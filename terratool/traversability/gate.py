"""Many terrains judged by processes side by side: what each file fails on, as findings."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from queue import Empty, SimpleQueue
from threading import Lock

from terratool.definition.findings import Finding
from terratool.definition.reader import Checked, CheckOptions, check, no_terrain
from terratool.errors import ReadError, TerratoolError
from terratool.field.terrain import Terrain
from terratool.processes import python_calling
from terratool.report import numbers
from terratool.text.locate import Address, offsets, positions_of
from terratool.text.source import Source, read_source
from terratool.traversability.assess import assess
from terratool.traversability.blocked import BlockedEnd, blocked_ends
from terratool.traversability.compare import prepare
from terratool.traversability.conditions import parse
from terratool.traversability.gate_rules import GATES
from terratool.traversability.notes import headroom_note
from terratool.traversability.report.wording import conclusion, route_line
from terratool.traversability.request import Request, ends_of
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.results import Route
from terratool.traversability.vehicle import Vehicle

_NAMES = {rule.code: rule.name for rule in GATES}


@dataclass(frozen=True, slots=True)
class FileJob:
    """A terrain to be judged.

    Attributes:
        file: name of the file.
        vehicles: vehicles that are judged, one or more, with different names.
        request: what is asked of each of them.
        conditions: conditions on which the file fails; those on routes hold only where there are.
        library_roots: folders under which libraries may lie.
        roughness: whether rough surfaces have their relief.
        named: whether the user named the file, which may then be a pipe.
    """

    file: str
    vehicles: tuple[Vehicle, ...]
    request: Request
    conditions: tuple[str, ...] = ()
    library_roots: tuple[str, ...] = ()
    roughness: bool = True
    named: bool = False


@dataclass(frozen=True, slots=True)
class VehicleRow:
    """Result of a vehicle on a terrain, in a few numbers.

    Attributes:
        vehicle: name of the vehicle; empty for a wheel by itself.
        verdict: label of the verdict.
        sentence: the verdict in words.
        fractions: shares of ground by the label of their class; None where there is no map.
        routes: number of routes, and of waypoints, that were asked for.
        found: number of these that can be driven, there and back if that was asked for.
    """

    vehicle: str
    verdict: str
    sentence: str
    fractions: dict[str, float] | None
    routes: int
    found: int


@dataclass(frozen=True, slots=True)
class FileVerdict:
    """Result of all vehicles on a terrain.

    Attributes:
        file: name of the file.
        rows: result of each vehicle; empty where the terrain could not be judged.
        findings: what the file fails on; empty where it passes.
        unreadable: sentences on why the file cannot be read, and what to do; None if it can.
        notes: sentences on what was not judged.
    """

    file: str
    rows: tuple[VehicleRow, ...] = ()
    findings: tuple[Finding, ...] = ()
    unreadable: tuple[str, str] | None = None
    notes: tuple[str, ...] = ()


def judge_file(job: FileJob) -> FileVerdict:
    """Judge the terrain of a file; no file and no error of it makes this raise."""
    try:
        source = read_source(job.file, named=job.named)
    except ReadError as error:
        return FileVerdict(job.file, unreadable=(error.message, error.hint))
    options = CheckOptions(warnings=False, library_roots=job.library_roots)
    checked = check(source, options)
    if checked.terrain is None:
        return FileVerdict(job.file, findings=_broken(source, checked))
    try:
        terrain = Terrain(checked, roughness=job.roughness)
        planned, _ = prepare(terrain, job.vehicles, job.request)
        reports, blocked = [], []
        while planned:  # each holds much memory
            one = planned.pop(0)
            blocked.append([*blocked_ends(one)])
            reports.append(assess(one, name=os.path.basename(job.file)))  # noqa: PTH119
    except TerratoolError as error:
        refused = _finding(source, "TD104", error.message, error.hint)
        return FileVerdict(job.file, findings=(refused,))
    several = len(reports) > 1
    findings = [
        finding
        for report, ends in zip(reports, blocked, strict=True)
        for finding in _failures(source, job, report, ends, several)
    ]
    findings.sort(key=lambda finding: (finding.line, finding.column))
    notes = tuple(
        dict.fromkeys(note for one in job.vehicles for note in headroom_note(terrain, one))
    )
    return FileVerdict(job.file, tuple(map(_row, reports)), tuple(findings), notes=notes)


def _broken(source: Source, checked: Checked) -> tuple[Finding, ...]:
    """Findings in a text that is no terrain, or has errors."""
    error = no_terrain(source, checked)
    return error.findings or (_finding(source, "TD104", error.message, error.hint),)


def _failures(
    source: Source, job: FileJob, report: TraversabilityReport, blocked: list[BlockedEnd],
    several: bool,
) -> Iterator[Finding]:  # fmt: skip
    """Yield what a report fails on; routes whose ends are blocked fail as such."""
    whose = f"{report.vehicle.name}: " * several
    mine = f"{report.vehicle.name}: " if report.vehicle.name and not several else ""
    told = partial(_finding, source, whose=whose)
    names = [
        *(f"route {' '.join(map(numbers.place, ends_of(route)))}" for route in job.request.routes),
        *(f"waypoints {number}" for number in range(1, len(job.request.waypoints) + 1)),
    ]
    for end in blocked:
        hint = "Make room there, or move the route's end."
        yield told("TD102", end.place.note, hint, end.place.pointer, names[end.route])
    barred = {end.route for end in blocked}
    for number, route in enumerate(report.routes):  # waypoints come last
        if not route.holds and number not in barred:
            hint = "Make room there, or ask for another way."
            yield told("TD101", route_line(_lost(route)), hint, _pointer(route), names[number])
    if report.reach is not None and report.reach.note:
        hint = "Make room there, or set out from another place."
        place = f"from {numbers.place(job.request.start or ())}"
        yield told("TD102", report.reach.note, hint, report.reach.pointer, place)
    for text in job.conditions:
        condition = parse(text)
        if condition.name == "no-route":
            continue  # told by its route
        if why := condition.why_met(report):
            name = text.strip()
            hint = "Change the ground, or the limit."
            yield told("TD103", f"{name}: {mine}{why}.", hint, subject=name)


def _lost(route: Route) -> Route:
    """The way, or the way back, that cannot be driven."""
    return route if not route.found or route.back is None else route.back


def _pointer(route: Route) -> str:
    """Pointer of the element of the file that bars a route first; empty where none is named."""
    barriers = _lost(route).barriers
    return barriers[0].pointer if barriers else ""


def _finding(
    source: Source, code: str, message: str, hint: str, pointer: str = "", subject: str = "",
    whose: str = "",
) -> Finding:  # fmt: skip
    """Finding at an element, on a subject; `whose` is put before both of its texts."""
    (place,) = positions_of(source.data, offsets(source.data, [Address(pointer)]))
    says = any(map(str.isalnum, place.excerpt.text))  # a brace does not
    return Finding(
        source.name, code, "error", pointer, place.line, place.column, whose + message, hint,
        excerpt=place.excerpt if pointer and says else None,
        subject=whose + (subject or _NAMES[code]),
    )  # fmt: skip


def _row(report: TraversabilityReport) -> VehicleRow:
    summary = report.summary
    return VehicleRow(
        report.vehicle.name,
        report.verdict.label,
        conclusion(report),
        {one.label: summary.fraction(one) for one in summary.counts} if summary else None,
        len(report.routes),
        sum(route.holds for route in report.routes),
    )


def judge_files(
    jobs: Sequence[FileJob], threads: int, progress: Callable[[int], object] = lambda _: None
) -> list[FileVerdict]:
    """Judge terrains by as many processes as there are threads; results are in order.

    A process that dies takes only the terrain along that it was at. Whatever stops this ends all
    processes, and none is begun after that.

    Args:
        jobs: terrains to be judged; each gets its share of the threads where jobs are few.
        threads: number of threads in all.
        progress: called with 1 for each terrain that is done.
    """
    workers = max(1, min(threads, len(jobs)))
    waiting: SimpleQueue[int] = SimpleQueue()
    for index in range(len(jobs)):
        waiting.put(index)
    found: dict[int, FileVerdict] = {}
    processes = [_JudgeProcess() for _ in range(workers)]

    def serve(process: _JudgeProcess) -> None:
        with contextlib.suppress(Empty):
            while True:
                index = waiting.get_nowait()
                job = jobs[index]
                request = replace(job.request, threads=max(1, threads // workers))
                verdict = process.judge(replace(job, request=request))
                if verdict is None:
                    return
                found[index] = verdict
                progress(1)

    with ThreadPoolExecutor(workers) as pool:
        try:
            list(pool.map(serve, processes))
        finally:
            for process in processes:  # threads wait for what these answer
                process.stop()
    return [found[index] for index in range(len(jobs))]


class _JudgeProcess:
    """A process that judges one terrain after the other, and is started when it is needed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False
        self._changes = Lock()  # held while the process begins or ends

    def judge(self, job: FileJob) -> FileVerdict | None:
        """Have a terrain judged; None once this is stopped."""
        why = "its process ended"
        try:
            process = self._begun()
        except OSError as error:
            why, process = f"no process could be started ({error.strerror})", None
        if process is not None:
            try:
                assert process.stdin is not None and process.stdout is not None
                pickle.dump(job, process.stdin)
                process.stdin.flush()
                answer: FileVerdict = pickle.load(process.stdout)
                return answer
            except (EOFError, OSError, ValueError, pickle.UnpicklingError):
                with self._changes:
                    self._end()
        return (
            None if self._stopped else FileVerdict(job.file, findings=(_broken_off(job.file, why),))
        )

    def stop(self) -> None:
        """End the process, whatever it is at, and begin none any more."""
        with self._changes:
            self._stopped = True
            self._end()

    def _begun(self) -> subprocess.Popen[bytes] | None:
        """The process, begun if need be; None once this is stopped."""
        with self._changes:
            if self._process is None and not self._stopped:
                self._process = subprocess.Popen(
                    **{**python_calling(__name__, "serve_jobs"), "stdin": subprocess.PIPE},
                    stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                )  # fmt: skip
            return self._process

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()


def _broken_off(file: str, why: str) -> Finding:
    return Finding(
        file, "TD105", "error", "", 1, 1, f"the judgement broke off: {why}.",
        "Judge the file by itself, on coarser pixels or fewer threads.", subject=_NAMES["TD105"],
    )  # fmt: skip


def serve_jobs() -> None:
    """Judge the jobs that come on standard input, and answer each on standard output."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started this ends it
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # nothing else may get between the answers
    while True:
        try:
            job: FileJob = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            verdict = judge_file(job)
        except Exception as error:
            what = f"an error of terratool, {type(error).__name__}"
            verdict = FileVerdict(job.file, findings=(_broken_off(job.file, what),))
        pickle.dump(verdict, answers)
        answers.flush()
