"""`terratool traversability` on many files: a table, and findings in the formats of `validate`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click
from msgspec import UNSET, Struct, UnsetType

from terratool.cli.config import Config, DriveSettings
from terratool.cli.outputs import ReportPlan
from terratool.cli.report import (
    FindingDocument,
    Unreadable,
    ValidationReport,
    ValidationSummary,
    finding_documents,
)
from terratool.cli.saying import say, say_error
from terratool.cli.sources import files_of
from terratool.cli.terminal import StatusLine
from terratool.report.documents import Count, Document, json_text
from terratool.report.numbers import NOTHING
from terratool.report.tables import align
from terratool.text.display import printable
from terratool.text.source import is_folder
from terratool.traversability.report.keys import VerdictText
from terratool.traversability.report.map_keys import Fractions

if TYPE_CHECKING:
    from terratool.traversability.gate import FileJob, FileVerdict, VehicleRow
    from terratool.traversability.request import Request
    from terratool.traversability.vehicle import Vehicle

_OTHERS = ("vehicle", "sensor", "library", "curriculum")
"""Kinds of files that are passed over in folders."""


class GatePlan(Struct, frozen=True):
    """Request for many files, by options and settings.

    Attributes:
        names: files and folders that the user names; empty for those of the settings.
        reports: formats of the findings.
        settings: settings of the project.
        given: settings that options stand in place of.
        request: what is asked besides.
        vehicles: function that makes the vehicles of files, or of options where there are none.
        library_roots: folders under which libraries may lie.
        roughness: whether rough surfaces have their relief.
    """

    names: tuple[str, ...]
    reports: ReportPlan
    settings: Config
    given: DriveSettings
    request: Request
    vehicles: Callable[[tuple[str, ...]], list[Vehicle]]
    library_roots: tuple[str, ...] = ()
    roughness: bool = True

    def files(self, unreadable: list[Unreadable]) -> Iterator[str]:
        """Yield the terrains that are to be judged.

        Raises:
            click.UsageError: neither options nor settings name any.
        """
        own = self.settings.traversability.paths or self.settings.paths
        names = self.names or self.settings.files(own)
        if not names:
            raise click.UsageError(
                "There is nothing to judge. Name files or directories, or set paths in "
                ".terratool.toml."
            )
        folders = tuple(name for name in names if is_folder(name))
        reached = (".", *self.library_roots, *folders)
        reached += () if self.names else (self.settings.folder,)
        for given in names:
            for name in files_of(given, reached, unreadable):
                if self.reports.writes(name) or self.settings.writes(name):
                    continue
                if name == given or _may_be_terrain(name):
                    yield name

    def refuse_idle(self, files: Sequence[str]) -> None:
        """Refuse settings for files of which there are none, where the settings name all files.

        Raises:
            RequestError: a pattern matches no file.
        """
        patterns = () if self.names else self.settings.traversability.per_file
        idle = self.settings.idle("traversability.per-file", patterns, files)
        for error in idle[:-1]:
            say_error(error.message, error.hint)
        if idle:
            raise idle[-1]

    def job(self, file: str, known: dict[tuple[str, ...], tuple[Vehicle, ...]]) -> FileJob:
        """Job of a file, with the vehicles that are known or now read."""
        from terratool.traversability.conditions import answerable, parse
        from terratool.traversability.gate import FileJob

        drive = self.settings.drive_settings(file, self.given)
        own = drive.settings
        paths = own.vehicles or ()
        if paths not in known:
            with drive.telling("vehicles"):
                known[paths] = tuple(self.vehicles(paths))
        routed = bool(own.routes or self.request.waypoints)
        with drive.telling("fail_on"):
            conditions = answerable(own.fail_on or (), routed, own.start is not None)
        checks = [parse(text) for text in conditions]
        request = replace(
            self.request, resolution=own.resolution,
            mapped=any(check.needs == "map" for check in checks),
            **drive.places,
        )  # fmt: skip
        return FileJob(
            file, known[paths], request, conditions, self.library_roots, self.roughness,
            file in self.names,
        )  # fmt: skip


def _may_be_terrain(name: str) -> bool:
    """Whether a file of a folder is no vehicle, sensor, library or curriculum."""
    from terratool.definition.keys import document_kind
    from terratool.errors import ReadError
    from terratool.text.source import read_source

    try:
        return document_kind(read_source(name, named=False).data) not in _OTHERS
    except ReadError:
        return True  # which is told of it


def judge_many(plan: GatePlan, threads: int) -> int:
    """Judge all files, and say what came out; return the exit code.

    Raises:
        RequestError, ReadError, DefinitionError: a vehicle or a setting makes no sense.
        WriteError: an output cannot be written.
    """
    from terratool.traversability.gate import judge_files
    from terratool.traversability.gate_rules import GATES

    plan.reports.refuse_outputs()
    unreadable: list[Unreadable] = []
    known: dict[tuple[str, ...], tuple[Vehicle, ...]] = {}
    files = list(dict.fromkeys(plan.files(unreadable)))
    if not unreadable:
        plan.refuse_idle(files)
    jobs = [plan.job(file, known) for file in files]
    for text in plan.given.fail_on or ():
        if jobs and not any(text in job.conditions for job in jobs):
            raise click.UsageError(
                f"--fail-on {text} needs a route or a start, and no file has one. Add --route "
                "X0 Y0 X1 Y1 or --from X Y, or name them in the settings."
            )
    with StatusLine("judging", len(jobs), unit="files") as status:
        found = judge_files(jobs, threads, status)
    unreadable += [
        Unreadable(one.file, *one.unreadable) for one in found if one.unreadable is not None
    ]
    read = tuple(one.file for one in found if one.unreadable is None)
    findings = tuple(finding for one in found for finding in one.findings)
    failed = len({finding.file for finding in findings})
    summary = ValidationSummary(
        files=len(read) + len(unreadable), valid=len(read) - failed, invalid=failed,
        unreadable=len(unreadable), errors=len(findings),
    )  # fmt: skip
    report = ValidationReport(
        findings, tuple(unreadable), summary, read, further=GATES, command="traversability"
    )
    if plan.reports.form != "sarif":
        for file in unreadable:
            say_error(file.message, file.hint)
        for one in found:
            for note in one.notes:
                say(f"{one.file}: {note}", err=True)
    if plan.reports.form == "text" and found:
        for line in _table(found):
            say(line)
        say("")
    plan.reports.write(report, {"json": json_text(_document(found, report))})
    return 3 if unreadable else int(failed > 0)


def _table(found: Sequence[FileVerdict]) -> Iterator[str]:
    """Yield the lines of a table of all files, the names at their ends."""
    cells: list[list[str]] = [[*_COLUMNS]]
    names = ["file"]
    for one in found:
        for row in one.rows:
            cells.append(_cells(row))
            names.append(one.file)
        if not one.rows:
            cells.append(["not judged", *[NOTHING] * (len(_COLUMNS) - 1)])
            names.append(one.file)
    if len({row[-1] for row in cells[1:]} - {NOTHING}) < 2:
        cells = [row[:-1] for row in cells]
    lines = [*align([[*row, ""] for row in cells], words=_WORDS)]
    wide = max(map(len, lines))
    for line, name in zip(lines, names, strict=True):
        yield f"{line:{wide}}  {printable(name)}"


_COLUMNS = ("verdict", "go", "caution", "no-go", "unknown", "cut off", "routes", "vehicle")
_WORDS = ("vehicle",)


def _cells(row: VehicleRow) -> list[str]:
    from terratool.report.numbers import share

    shares = [NOTHING] * 5
    if (part := row.fractions) is not None:
        lost = part["cut-off"] + part["one-way"]
        shares = [
            *(share(part[name]) for name in ("go", "caution", "no-go", "unknown")),
            share(lost),
        ]
    routes = f"{row.found} of {row.routes}" if row.routes else NOTHING
    return [row.verdict, *shares, routes, printable(row.vehicle) or NOTHING]


class VehicleDocument(Struct, frozen=True):
    """Result of a vehicle on a terrain, as JSON.

    Attributes:
        vehicle: name of the vehicle; empty for a wheel by itself.
        verdict: verdict of its report.
        sentence: the verdict in words.
        fractions: shares of the pixels with ground, but those at the edge, by class, with their
            best heading; None where there is no map.
        routes: number of routes, and of waypoints, that were asked for.
        routes_found: number of these that can be driven, there and back if that was asked for.
    """

    vehicle: str
    verdict: VerdictText
    sentence: str
    fractions: Fractions | None
    routes: Count
    routes_found: Count


class FileRowDocument(Struct, frozen=True):
    """Results of all vehicles on a terrain, as JSON.

    Attributes:
        file: name of the file.
        vehicles: results of the vehicles; none where the terrain could not be judged.
        notes: sentences on what was not judged; None for none.
    """

    file: str
    vehicles: list[VehicleDocument]
    notes: tuple[str, ...] | UnsetType = UNSET


class GateDocument(Document, frozen=True, kw_only=True):
    """Results on many terrains, as JSON, with what they fail on as `validate` has it.

    Attributes:
        findings: what files fail on, and errors of their texts.
        unreadable: files that could not be read.
        summary: numbers of files and findings.
        files: results on each terrain.
    """

    findings: list[FindingDocument]
    unreadable: tuple[Unreadable, ...]
    summary: ValidationSummary
    files: list[FileRowDocument]


def _document(found: Sequence[FileVerdict], report: ValidationReport) -> GateDocument:
    return GateDocument(
        files=[
            FileRowDocument(
                one.file,
                [
                    VehicleDocument(
                        row.vehicle, row.verdict, row.sentence, row.fractions, row.routes, row.found
                    )
                    for row in one.rows
                ],
                one.notes or UNSET,
            )
            for one in found
        ],
        findings=finding_documents(report),
        unreadable=report.unreadable,
        summary=report.summary,
    )
