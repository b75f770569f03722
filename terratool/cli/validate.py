"""`terratool validate`."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Callable, Iterable
from itertools import chain
from pathlib import Path
from typing import Any, NoReturn

import click
import msgspec
from msgspec import Struct, field, structs

from terratool.cli.baseline import KnownFindings, read_baseline, write_baseline
from terratool.cli.command import Command, option_group
from terratool.cli.config import Config, project_settings
from terratool.cli.options import json_option, library_root_option, library_roots
from terratool.cli.outputs import ReportPlan
from terratool.cli.report import REPORTERS, Unreadable, ValidationReport, ValidationSummary
from terratool.cli.saying import say, say_error
from terratool.cli.sources import files_of
from terratool.cli.terminal import StatusLine, short_name
from terratool.definition.findings import Finding, UnseenStorey
from terratool.definition.reader import Checked, CheckOptions, check, new_shelf
from terratool.definition.rules import RULES
from terratool.errors import ReadError, RequestError, WriteError
from terratool.output import is_same_file
from terratool.report.wording import count_of
from terratool.text.display import quote
from terratool.text.source import (
    is_folder,
    leads_out,
    read_source,
    real_path,
    write_source,
)

_ALL = 10**9
_MOST_FINDINGS = 1000
_ROUNDS = 1000
"""Most rounds of mending of a file in one run; an error of syntax takes a round of its own."""


def _codes(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> tuple[str, ...]:
    try:
        return _known_codes(values)
    except RequestError as error:
        raise click.BadParameter(str(error)) from error


def _known_codes(values: tuple[str, ...]) -> tuple[str, ...]:
    """Codes of rules, or beginnings of codes, from texts that may list several.

    Raises:
        RequestError: no rule has such a code.
    """
    codes = tuple(
        code.strip().upper() for code in chain.from_iterable(v.split(",") for v in values)
    )
    for code in codes:
        if not code or not any(known.startswith(code) for known in RULES):
            what = f"no rule has the code {quote(code)}" if code else "there is an empty code"
            raise RequestError(f"{what}.", "Run terratool rules for the list.")
    return codes


def _number(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    if value is not None and math.isnan(value):
        raise click.BadParameter("nan is no number.")
    return value


class _ValidationPlan(Struct, frozen=True):
    """Request by options, or else by settings.

    Attributes:
        reports: formats of the report.
        strict: whether warnings make a file invalid.
        select: codes, or beginnings, of the rules to check; empty for all.
        ignore: codes, or beginnings, of the rules not to check.
        max_step: tallest vertical step without a warning; None for no limit.
        limit: largest number of findings that are listed.
        baseline: file of known findings; None for none.
    """

    reports: ReportPlan
    strict: bool
    select: tuple[str, ...]
    ignore: tuple[str, ...]
    max_step: float | None
    limit: int
    baseline: str | None

    def writes(self, name: str) -> bool:
        """Whether a file is the baseline or an output."""
        own = self.baseline is not None and is_same_file(self.baseline, name)
        return own or self.reports.writes(name)


def _settings(config_file: str | None) -> Config:
    """Settings from a named file, or from the nearest one of the working directory.

    Raises:
        ReadError: the file of settings cannot be read.
        RequestError: the file has an unknown setting or code.
    """
    settings = project_settings(config_file)
    for codes in (settings.select, settings.ignore, *settings.per_file_ignores.values()):
        try:
            _known_codes(codes)
        except RequestError as error:
            raise RequestError(f"{settings.file}: {error.message}", error.hint) from error
    return settings


def _plan(formats: tuple[str, ...], settings: Config, given: dict[str, Any]) -> _ValidationPlan:
    """Make the plan from options and settings; options outrank settings.

    Raises:
        click.UsageError: the options contradict each other.
        RequestError: the settings name a file that they may not.
        WriteError: a file cannot be written.
    """
    reports = ReportPlan.of(formats, settings.formats, settings)
    limit = settings.max_findings if given["max_findings"] is None else given["max_findings"]
    limit = _MOST_FINDINGS if limit is None else limit
    baseline = None if settings.baseline is None else settings.path_here(settings.baseline)
    plan = _ValidationPlan(
        reports,
        settings.strict if given["strict"] is None else given["strict"],
        given["select"] or _known_codes(settings.select),
        given["ignore"] or _known_codes(settings.ignore),
        settings.max_step if given["max_step"] is None else given["max_step"],
        min(limit or _ALL, _ALL),
        given["baseline"] or baseline,
    )
    reports.refuse_outputs()
    if not any(map(CheckOptions(select=plan.select, ignore=plan.ignore).shows, RULES)):
        raise click.UsageError("--select and --ignore leave no rule. Drop one of them.")
    return plan


class _ValidationTally(Struct):
    """Findings in all files so far.

    Attributes:
        findings: findings to list.
        lasting: findings for a baseline: all but those of texts that are no JSON.
        unreadable: files that could not be read.
        files: names of the files that were read.
        counts: number of findings by code, listed or not.
        paths: real paths of the files that were read.
        libraries: real paths of those that were met as libraries of others.
        valid: number of valid files.
        known: number of findings that the baseline has.
    """

    findings: list[Finding] = field(default_factory=list)
    lasting: list[Finding] = field(default_factory=list)
    unreadable: list[Unreadable] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    paths: set[str] = field(default_factory=set)
    libraries: set[str] = field(default_factory=set)
    valid: int = 0
    known: int = 0

    def add(
        self,
        name: str,
        checked: Checked,
        options: CheckOptions,
        known: KnownFindings | None,
        strict: bool,
    ) -> None:
        """Add the findings of a file that are not known."""
        options = options.of(checked.name)
        counts = Counter(
            {
                code: count
                for code, count in checked.counts.items()
                if options.shows(code) or not checked.readable
            }
        )
        findings = list(checked.findings[: options.limit])
        if checked.readable:
            self.lasting += findings
            if known is not None:
                left = known.unknown(findings)
                self.known += len(findings) - len(left)
                counts -= Counter(f.code for f in findings) - Counter(f.code for f in left)
                findings = left
        by_severity = _by_severity(counts)
        self.valid += not by_severity["error"] and not (strict and by_severity["warning"])
        self.counts += counts
        self.findings += findings
        self.files.append(name)
        self.paths.add(real_path(name))

    def add_libraries(self, libraries: Iterable[Checked], *given: Any) -> None:
        """Add the findings of the libraries that a file uses, if they are new."""
        for library in libraries:
            real = real_path(library.name)
            if real not in self.paths:
                self.add(library.name, library, *given)
                self.libraries.add(real)

    def is_library(self, name: str) -> bool:
        """Whether a file was added as a library of another."""
        return name != "-" and real_path(name) in self.libraries

    def report(self, limit: int, statistics: bool) -> ValidationReport:
        """Report with at most `limit` findings."""
        listed = tuple(self.findings[:limit])
        by_severity = _by_severity(self.counts)
        summary = ValidationSummary(
            files=len(self.files) + len(self.unreadable),
            valid=self.valid,
            invalid=len(self.files) - self.valid,
            unreadable=len(self.unreadable),
            errors=by_severity["error"],
            warnings=by_severity["warning"],
            notes=by_severity["note"],
            hidden=self.counts.total() - len(listed),
            known=self.known,
        )
        return ValidationReport(
            listed, tuple(self.unreadable), summary, tuple(self.files),
            dict(self.counts) if statistics else None,
        )  # fmt: skip


def _mend(name: str, options: CheckOptions, status: StatusLine) -> None:
    """Apply the unambiguous fixes to a file, and write it anew if there are any.

    Raises:
        ReadError: the file cannot be read.
        RequestError: the file is standard input.
        WriteError: the file cannot be written.
    """
    if name == "-":
        raise RequestError(
            "--fix writes files, and standard input is none.", "Give the name of a file."
        )

    from terratool.text.edit import apply_edits

    source, shelf = read_source(name, named=False), new_shelf(options)
    data, count = source.data, 0
    checked = check(source, options, kind=None, shelf=shelf)
    # an error of syntax hides all others, hence the rounds
    for _ in range(_ROUNDS):
        edits = [finding.fix for finding in checked.findings if finding.fix is not None]
        if not edits:
            break
        mended = apply_edits(data, edits)
        after = check(structs.replace(source, data=mended), options, kind=None, shelf=shelf)
        # no fix may make a key appear twice
        if after.counts["TT102"] > checked.counts["TT102"]:
            break
        data, checked, count = mended, after, count + len(edits)
    else:
        status.clear()
        say_error(f"{name}: run --fix again for more.")
    if count:
        write_source(structs.replace(source, data=data), name, overwrite=True)
        status.clear()
        say_error(f"{name}: mended in {count_of(count, 'place')}.")


def _is_definition(name: str) -> bool:
    """Whether a file is an object with a top-level key of some definition."""
    try:
        data = read_source(name, named=False).data
        members = msgspec.json.decode(data, type=dict[str, msgspec.Raw])
    except (msgspec.MsgspecError, RecursionError, UnicodeError, ReadError):
        return False
    return not members.keys().isdisjoint(
        (
            "size",
            "surfTypes",
            "elemTypes",
            "elemTree",
            "parts",
            "mass",
            "wheels",
            "kinds",
            "lidar",
            "camera",
            "sonar",
        )
    )


def _by_severity(counts: Counter[str]) -> Counter[str]:
    by_severity: Counter[str] = Counter()
    for code, count in counts.items():
        by_severity[RULES[code].severity] += count
    return by_severity


def _look(checked: Checked) -> tuple[UnseenStorey, ...]:
    """Decks and bores that change nothing; what looks for them is imported for terrains alone."""
    if checked.uses is None or not checked.uses.has_storeys:
        return ()
    from terratool.field.unseen import unseen_storeys

    return unseen_storeys(checked)


class _ValidationJob(Struct, frozen=True):
    """Files to check, with the plan for it.

    Attributes:
        names: names of files and folders, as they are given.
        plan: request for formats, rules and limits.
        settings: settings, for the codes to ignore in each file.
        roots: folders under which libraries may lie.
        reached: folders to which links in folders may lead.
        compared: whether findings of the baseline are left out.
        named: whether the user named the files, and not the settings.
    """

    names: tuple[str, ...]
    plan: _ValidationPlan
    settings: Config
    roots: tuple[str, ...] = ()
    reached: tuple[str, ...] = ()
    compared: bool = True
    named: bool = True

    @property
    def limit(self) -> int:
        """Largest number of findings of one file that are kept."""
        return _ALL if self.plan.baseline is not None else self.plan.limit

    def options(self, room: int) -> CheckOptions:
        """Options of the check of a file, with at most `room` findings."""
        plan = self.plan
        return CheckOptions(
            True, plan.max_step, room, plan.select, plan.ignore, self.roots, self.ignored_codes,
            _look,
        )  # fmt: skip

    def ignored_codes(self, file: str) -> tuple[str, ...]:
        """Codes that the settings ignore in a file."""
        return _known_codes(self.settings.ignored_codes(file))

    def mend(self, status: StatusLine) -> None:
        """Mend all files, before any is checked with its libraries.

        Raises:
            RequestError: a file is standard input.
            WriteError: a file cannot be written.
        """
        for given in self.names:
            for name in files_of(given, self.reached, []):
                if self.plan.writes(name):
                    continue
                if name != given and leads_out(name, (given,)):
                    status.clear()
                    say_error(
                        f"{name}: is a link out of the folder that was named, and stays as it is."
                    )
                    continue
                status.say(f"mending {short_name(name)}")
                with contextlib.suppress(ReadError):  # the check reports it
                    _mend(name, self.options(_ALL), status)

    def file_names(self) -> list[str]:
        """Names of the files that exist now and are to be checked."""
        return [
            name
            for given in self.names
            for name in files_of(given, self.reached, [])
            if not (self.plan.writes(name) or self.passes_over(name))
        ]

    def passes_over(self, name: str) -> bool:
        """Whether a file, met in a folder, is an output of another command."""
        return name not in self.names and self.settings.writes(name)

    def say_idle(self, found: _ValidationTally) -> bool:
        """Print the patterns of the settings that match none of their files, if there are any."""
        if self.named or found.unreadable:
            return False
        patterns = self.settings.per_file_ignores
        idle = self.settings.idle("per-file-ignores", patterns, found.files)
        for error in idle:
            say_error(error.message, error.hint)
        return bool(idle)

    def check_all(
        self, look: Callable[[str, CheckOptions], Checked], status: StatusLine
    ) -> _ValidationTally:
        """Check all files, one after the other.

        Args:
            look: function that reads and checks a file.
            status: progress that names the file.

        Raises:
            ReadError: the baseline cannot be read.
            WriteError: an output is a file that is to be checked.
        """
        plan, found = self.plan, _ValidationTally()
        known = (
            KnownFindings(plan.baseline) if plan.baseline is not None and self.compared else None
        )
        for name in chain.from_iterable(
            files_of(one, self.reached, found.unreadable) for one in self.names
        ):
            status.say(f"checking {short_name(name)}")
            if plan.writes(name):
                if name in self.names or _is_definition(name):
                    raise WriteError(f"{name}: is to be checked.", "Write elsewhere.")
                continue  # an output met in a folder
            if self.passes_over(name):
                continue
            options = self.options(max(0, self.limit - len(found.findings)))
            if found.is_library(name):
                continue
            try:
                checked = look(name, options)
            except ReadError as error:
                found.unreadable.append(Unreadable(name, error.message, error.hint))
                continue
            found.add(name, checked, options, known, plan.strict)
            found.add_libraries(checked.libraries, options, known, plan.strict)
        return found

    def watch(self, statistics: bool) -> NoReturn:
        """Report on all files, and again whenever some have changed, until Ctrl-C.

        Raises:
            KeyboardInterrupt: Ctrl-C was pressed.
            ReadError, WriteError: `check_all` raises them.
        """
        from terratool.definition.watch import Watch

        watch = Watch(self.file_names)
        watched = False
        while True:
            with StatusLine("checking") as status:
                found = self.check_all(
                    lambda name, options: watch.look(
                        name, structs.replace(options, limit=self.limit)
                    ),
                    status,
                )
            if self.plan.reports.form != "sarif":
                _say_unreadable(found)
            self.plan.reports.write(found.report(self.plan.limit, statistics))
            self.say_idle(found)
            if not watched:
                files = count_of(len(found.files) + len(found.unreadable), "file")
                say_error(f"watching {files}; Ctrl-C ends it.")
                watched = True
            for name, became in watch.wait().items():
                say_error(f"{name}: {became}.")


def _refuse_watching(names: tuple[str, ...], fix: bool, update_baseline: bool) -> None:
    for option, given in (("--fix", fix), ("--update-baseline", update_baseline)):
        if given:
            raise click.UsageError(f"--watch only looks, and {option} writes. Drop one of them.")
    if "-" in names:
        raise click.UsageError("--watch needs files, and - is none. Name a file or a directory.")


def _say_unreadable(found: _ValidationTally) -> None:
    """Print the files that could not be read."""
    for file in found.unreadable:
        say_error(file.message, file.hint)


@click.command(
    "validate",
    cls=Command,
    epilog="Example: terratool validate samples/paper-example.json --strict",
)
@click.argument("files", nargs=-1, metavar="[FILE|DIR]...")
@option_group(
    "How it is said",
    click.option(
        "--format",
        "formats",
        multiple=True,
        metavar="FORM",
        help=f"{', '.join(REPORTERS)}; FORM=OUT goes into a file; may be repeated.  "
        "[default: text]",
    ),
    json_option("The same as --format json."),
    click.option(
        "--max-findings",
        type=click.IntRange(min=0),
        metavar="N",
        help=f"List so many at most and count the rest; 0 lists all.  [default: {_MOST_FINDINGS}]",
    ),
    click.option("--statistics", is_flag=True, help="Say how often each rule was broken."),
)
@option_group(
    "What counts",
    click.option("--strict/--no-strict", default=None, help="Warnings make a file invalid, too."),
    click.option(
        "--select",
        multiple=True,
        metavar="CODE",
        callback=_codes,
        help="Only these rules: TT104, or TT1 for all that begin so; may be repeated.",
    ),
    click.option(
        "--ignore", multiple=True, metavar="CODE", callback=_codes, help="All rules but these."
    ),
    click.option(
        "--max-step",
        type=click.FloatRange(min=0),
        metavar="H",
        callback=_number,
        help="Warn of elements that make a vertical step taller than H.",
    ),
    click.option(
        "--baseline",
        metavar="FILE",
        help="Leave out findings that this file has from an earlier run.",
    ),
    click.option("--update-baseline", is_flag=True, help="Write all findings into the baseline."),
)
@option_group(
    "What is done",
    click.option("--fix", is_flag=True, help="Mend in place what can be mended in one way only."),
    click.option(
        "--watch",
        is_flag=True,
        help="Check again whenever a file, or a library that it uses, changes.",
    ),
)
@click.option("--config", "config_file", metavar="FILE", help="Settings, in place of those found.")
@library_root_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    files: tuple[str, ...],
    formats: tuple[str, ...],
    as_json: bool,
    update_baseline: bool,
    statistics: bool,
    fix: bool,
    watch: bool,
    config_file: str | None,
    **given: Any,
) -> None:
    """Check terrains, libraries, vehicles, sensors, curricula: what is wrong, where, what to do.

    A file is a vehicle, a sensor, a library or the spec of a curriculum if its $schema says so, or
    else its keys; all others are terrains.
    FILE may be gzipped, and - is standard input; of a DIR all *.json and *.json.gz are checked, but
    nothing whose name begins with a dot. Libraries that a terrain uses are checked, too, each once.
    Exits 0 if all are valid, 1 if one is not, 3 if one cannot be read. A text that is not JSON is
    an error whatever is selected. With --watch there is one report after another, each on all
    files; Ctrl-C ends it with exit code 130.

    Settings are those of .terratool.toml, or of [tool.terratool] in pyproject.toml, in this folder
    or the nearest one above; options outrank them.
    """
    settings = _settings(config_file)
    plan = _plan(formats + ("json",) * as_json, settings, given)
    names = files or settings.files()
    if not names:
        raise click.UsageError(
            "There is nothing to check. Name files or directories, or set paths in .terratool.toml."
        )
    if update_baseline:
        if plan.baseline is None:
            raise click.UsageError("--update-baseline needs the name of one. Add --baseline FILE.")
        if given["baseline"] is None:
            settings.refuse_output(plan.baseline)
        if Path(plan.baseline).exists():
            read_baseline(plan.baseline)  # refuses to replace a file that is no baseline
    folders = (name if is_folder(name) else str(Path(name).parent) for name in names)
    roots = library_roots() + tuple(folders)
    reached = (".", *roots, *(() if files else (settings.folder,)))
    job = _ValidationJob(
        names, plan, settings, roots, reached, compared=not update_baseline, named=bool(files)
    )
    if watch:
        _refuse_watching(names, fix, update_baseline)
        job.watch(statistics)
    with StatusLine("checking") as status:
        if fix:
            job.mend(status)
        shelf = new_shelf(job.options(job.limit))

        def look(name: str, options: CheckOptions) -> Checked:
            # files that the settings name may be a stranger's
            source = read_source(name, named=name in files)
            return check(source, options, kind=None, shelf=shelf)

        found = job.check_all(look, status)
    if plan.reports.form != "sarif" or update_baseline:
        _say_unreadable(found)
    if update_baseline and found.unreadable:
        raise ReadError(
            f"{plan.baseline}: was not written, as not all files could be read.",
            "Name files that can be read.",
        )
    if update_baseline:
        assert plan.baseline is not None
        write_baseline(plan.baseline, found.lasting)
        say(f"{plan.baseline}: {count_of(len(found.lasting), 'finding')} known now.")
        ctx.exit(0)
    report = found.report(plan.limit, statistics)
    plan.reports.write(report)
    idle = job.say_idle(found)
    wrong = 2 if idle and plan.strict else int(report.summary.invalid > 0)
    ctx.exit(3 if found.unreadable else wrong)
