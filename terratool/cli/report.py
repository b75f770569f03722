"""Reports of findings: the result, and a table of functions that format it."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import click
from msgspec import UNSET, Struct, UnsetType

from terratool._version import __version__
from terratool.cli.baseline import digest, fingerprint
from terratool.definition.findings import Bounds, Finding, Severity
from terratool.definition.rules import RULES
from terratool.definition.rules.base import Rule
from terratool.report.documents import Document, json_text
from terratool.report.inert import inert_xml, xml_text
from terratool.report.tables import columns_of
from terratool.report.wording import count_of
from terratool.report.workflow import annotation
from terratool.text.display import Excerpt, printable

SARIF_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/os/schemas/sarif-schema-2.1.0.json"
_HOME = "https://doi.org/10.2507/26th.daaam.proceedings.056"
"""Address of the paper on the model, as the project has none of its own yet."""
_COLORS = {"error": "red", "warning": "yellow", "note": "cyan"}
_IN_WORKFLOWS = {"error": "error", "warning": "warning", "note": "notice"}
_IN_GITLAB = {"error": "major", "warning": "minor", "note": "info"}
_LISTED = 12
"""Most other places of a group that are named."""


class Unreadable(Struct, frozen=True):
    """File that could not be read.

    Attributes:
        file: name of the file.
        message: one sentence on the cause.
        hint: one sentence of advice.
    """

    file: str
    message: str
    hint: str


class ValidationSummary(Struct, frozen=True):
    """Numbers of files and findings.

    Attributes:
        files: number of files that were to be checked.
        valid: number of files without errors, or with --strict without warnings.
        invalid: number of files that were read and are not valid.
        unreadable: number of files that could not be read.
        errors: number of errors, listed or not.
        warnings: number of warnings, listed or not.
        hidden: number of findings that are counted but not listed.
        known: number of findings that are left out, as a baseline has them.
        notes: number of notes, listed or not.
    """

    files: int = 0
    valid: int = 0
    invalid: int = 0
    unreadable: int = 0
    errors: int = 0
    warnings: int = 0
    hidden: int = 0
    known: int = 0
    notes: int = 0


class FindingGroup(Struct, frozen=True):
    """Findings in one file with equal messages: the first, and the others in their order."""

    first: Finding
    others: list[Finding]

    def rest(self) -> str:
        """Sentence on the other places; empty if there are none."""
        if not self.others:
            return ""
        places = ", ".join(f"{other.line}:{other.column}" for other in self.others[:_LISTED])
        more = ", …" if len(self.others) > _LISTED else ""
        return f"The same in {count_of(len(self.others), 'more place')}: {places}{more}."


class ValidationReport(Struct, frozen=True):
    """Findings in all files.

    Attributes:
        findings: findings that are listed.
        unreadable: files that could not be read.
        summary: numbers of files and findings.
        files: names of the files that were read.
        statistics: number of findings by code; None unless asked for.
        further: rules of the command's own, beside those on texts.
        command: command that found them.
    """

    findings: tuple[Finding, ...]
    unreadable: tuple[Unreadable, ...]
    summary: ValidationSummary
    files: tuple[str, ...] = ()
    statistics: dict[str, int] | None = None
    further: tuple[Rule, ...] = ()
    command: str = "validate"

    @property
    def rules(self) -> Mapping[str, Rule]:
        """Rules that findings may be of, by code."""
        return RULES | {rule.code: rule for rule in self.further}

    @property
    def verdicts(self) -> tuple[str, str]:
        """Words for a file that passes, and for one that fails."""
        return ("valid", "invalid") if self.command == "validate" else ("passed", "failed")

    def groups(self) -> list[FindingGroup]:
        """Findings in groups of equal messages, in the order of the first of each."""
        groups: dict[tuple[str, str, str, str], FindingGroup] = {}
        for finding in self.findings:
            key = finding.file, finding.code, finding.message, finding.hint
            if key in groups:
                groups[key].others.append(finding)
            else:
                groups[key] = FindingGroup(finding, [])
        return list(groups.values())


class FindingPlace(Struct, frozen=True):
    """Other place of a finding, as JSON.

    Attributes:
        pointer: JSON pointer of the value in the text.
        line, column: place in the text, from 1; columns count characters.
        bounds: west, south, east, north of the element concerned, in world units; None where there
            is none.
    """

    pointer: str
    line: int
    column: int
    bounds: Bounds | None


class FindingDocument(Struct, frozen=True):
    """Findings in one file with equal messages, as JSON: the first, and the other places.

    Attributes:
        file: name of the file.
        code: code of the rule.
        severity: severity of the rule.
        pointer: JSON pointer of the value in the text.
        line, column: place in the text, from 1; columns count characters.
        message: one sentence on what is wrong.
        hint: one sentence of advice.
        bounds: west, south, east, north of the element concerned, in world units; None where there
            is none.
        more: other places of the same.
    """

    file: str
    code: str
    severity: Severity
    pointer: str
    line: int
    column: int
    message: str
    hint: str
    bounds: Bounds | None
    more: list[FindingPlace]


_FIELDS = FindingDocument.__struct_fields__[:-1]


class ValidationDocument(Document, frozen=True, kw_only=True):
    """Findings in all files, as JSON."""

    format_version: int = 2
    findings: list[FindingDocument]
    unreadable: tuple[Unreadable, ...]
    summary: ValidationSummary
    statistics: dict[str, int] | UnsetType = UNSET


def as_text(report: ValidationReport) -> str:
    """Text for people: each finding with its line and a caret, a summary last."""
    lines = []
    for group in report.groups():
        finding = group.first
        color = _COLORS[finding.severity]
        file = printable(finding.file)
        place = click.style(f"{file}:{finding.line}:{finding.column}:", bold=True)
        label = click.style(f"{finding.severity} {finding.code}:", fg=color, bold=True)
        lines.append(f"{place} {label} {printable(finding.message)}")
        if finding.excerpt is not None and finding.excerpt.text:
            lines += _excerpt_lines(finding.line, finding.excerpt, color)
        lines += [f"  {printable(text)}" for text in (finding.hint, group.rest()) if text]
        lines.append("")
    statistics = report.statistics or {}
    for code, count in sorted(statistics.items(), key=lambda item: (-item[1], item[0])):
        rule = report.rules[code]
        lines.append(f"{count:>8,}  {code}  {rule.severity:7}  {rule.name}")
    if statistics:
        lines.append("")
    return "\n".join([*lines, _summary_line(report)])


def _excerpt_lines(line: int, excerpt: Excerpt, color: str) -> Iterable[str]:
    number = str(line)
    before = sum(map(columns_of, excerpt.text[: excerpt.caret]))
    bar = click.style("|", fg="blue")
    yield f"  {click.style(number, fg='blue')} {bar} {excerpt.text}"
    yield f"  {' ' * len(number)} {bar} {' ' * before}{click.style('^', fg=color, bold=True)}"


def _summary_line(report: ValidationReport) -> str:
    summary = report.summary
    parts = [f"{_count(summary.files, 'file')} checked"]
    if summary.invalid:
        parts.append(f"{summary.invalid:,} {report.verdicts[1]}")
    if summary.unreadable:
        parts.append(f"{summary.unreadable:,} unreadable")
    parts += [_count(summary.errors, "error"), _count(summary.warnings, "warning")]
    if summary.notes:
        parts.append(count_of(summary.notes, "note"))
    end = "."
    if summary.hidden:
        end = f"; {summary.hidden:,} of them not listed (see --max-findings)."
    if summary.known:
        end += f" {count_of(summary.known, 'known finding')} left out."
    return ", ".join(parts) + end


def _count(number: int, noun: str) -> str:
    return count_of(number, noun) if number else f"no {noun}s"


def finding_documents(report: ValidationReport) -> list[FindingDocument]:
    """Findings for JSON, grouped."""
    return [
        FindingDocument(
            **{name: getattr(group.first, name) for name in _FIELDS},
            more=[
                FindingPlace(other.pointer, other.line, other.column, other.bounds)
                for other in group.others
            ],
        )
        for group in report.groups()
    ]


def as_json(report: ValidationReport) -> str:
    """JSON for scripts: versioned, with all keys of a finding."""
    return json_text(
        ValidationDocument(
            findings=finding_documents(report),
            unreadable=report.unreadable,
            summary=report.summary,
            statistics=UNSET if report.statistics is None else report.statistics,
        )
    )


def as_github(report: ValidationReport) -> str:
    """Workflow commands, which GitHub shows as annotations in the text of the file."""
    lines = []
    for group in report.groups():
        f = group.first
        place = {"file": f.file, "line": f.line, "col": f.column, "title": f.code}
        text = "\n".join(filter(None, (f.message, f.hint, group.rest())))
        lines.append(annotation(_IN_WORKFLOWS[f.severity], place, text))
    for file in report.unreadable:
        what = f"{file.message}\n{file.hint}"
        lines.append(annotation("error", {"file": file.file, "title": "unreadable"}, what))
    return "\n".join([*lines, _summary_line(report)])


def as_sarif(report: ValidationReport) -> str:
    """SARIF 2.1.0, which code scanning services take."""
    places = {code: index for index, code in enumerate(report.rules)}
    driver = {
        "name": "terratool",
        "version": __version__,
        "semanticVersion": __version__,
        "informationUri": _HOME,
        "rules": [_rule(rule) for rule in report.rules.values()],
    }
    notes = [
        {
            "level": "error",
            "message": {"text": f"{file.message} {file.hint}"},
            "locations": [{"physicalLocation": {"artifactLocation": _artifact(file.file)}}],
        }
        for file in report.unreadable
    ]
    marks = fingerprints(report)
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {"executionSuccessful": not report.unreadable, "toolExecutionNotifications": notes}
        ],
        "results": [
            _result(group, places[group.first.code], mark)
            for group, mark in zip(report.groups(), marks, strict=True)
        ],
    }
    log = {"$schema": SARIF_SCHEMA, "version": "2.1.0", "runs": [run]}
    return json_text(log)


def fingerprints(report: ValidationReport) -> list[str]:
    """Mark of each group, unique in the report, which stays when lines move."""
    seen: Counter[str] = Counter()
    marks = []
    for group in report.groups():
        mark = digest(group.first.file, fingerprint(group.first))
        seen[mark] += 1
        marks.append(f"{mark}:{seen[mark]}")
    return marks


def _rule(rule: Rule) -> dict[str, Any]:
    return {
        "id": rule.code,
        "name": rule.name,
        "shortDescription": {"text": rule.summary},
        "help": {"text": rule.manual},
        "defaultConfiguration": {"level": rule.severity},
    }


def _result(group: FindingGroup, rule: int, mark: str) -> dict[str, Any]:
    finding = group.first
    properties: dict[str, Any] = {"hint": finding.hint}
    if finding.bounds is not None:
        properties["bounds"] = finding.bounds
    result = {
        "ruleId": finding.code,
        "ruleIndex": rule,
        "level": finding.severity,
        "message": {"text": f"{finding.message} {finding.hint}"},
        "locations": [_location(finding)],
        "partialFingerprints": {"terratool/v1": mark},
        "properties": properties,
    }
    if group.others:
        result["relatedLocations"] = list(map(_location, group.others))
    return result


def _location(finding: Finding) -> dict[str, Any]:
    return {
        "physicalLocation": {
            "artifactLocation": _artifact(finding.file),
            "region": {"startLine": finding.line, "startColumn": finding.column},
        },
        "logicalLocations": [{"fullyQualifiedName": finding.pointer}],
    }


def _artifact(file: str) -> dict[str, str]:
    from pathlib import Path
    from urllib.parse import quote

    path = Path(file)
    if path.is_absolute():
        return {"uri": path.as_uri()}
    return {"uri": quote(os.fsencode(file.replace(os.sep, "/")))}


def as_junit(report: ValidationReport) -> str:
    """JUnit's XML, which CI servers show: a suite for each file, a case for each group."""
    from xml.etree import ElementTree as Xml

    suites: dict[str, list[FindingGroup]] = {file: [] for file in report.files}
    for group in report.groups():
        suites.setdefault(group.first.file, []).append(group)
    top = Xml.Element("testsuites", name=f"terratool {report.command}")
    for file, groups in suites.items():
        suite = Xml.SubElement(
            top, "testsuite", name=xml_text(file), tests=str(max(1, len(groups))),
            failures=str(sum(group.first.severity != "note" for group in groups)), errors="0",
        )  # fmt: skip
        for group in groups:
            f = group.first
            name = f"{f.code} {f.subject or f'at {f.line}:{f.column}'}"
            case = Xml.SubElement(suite, "testcase", classname=xml_text(file), name=xml_text(name))
            said = Xml.SubElement(case, "system-out" if f.severity == "note" else "failure")
            if f.severity != "note":
                said.attrib.update(type=f.severity, message=xml_text(f.message))
            lines = (f"{file}:{f.line}:{f.column}: {f.message}", f.hint, group.rest())
            said.text = xml_text("\n".join(filter(None, lines)))
        if not groups:
            Xml.SubElement(suite, "testcase", classname=xml_text(file), name=report.verdicts[0])
    for unread in report.unreadable:
        name = xml_text(unread.file)
        suite = Xml.SubElement(top, "testsuite", name=name, tests="1", failures="0", errors="1")
        case = Xml.SubElement(suite, "testcase", classname=name, name="readable")
        error = Xml.SubElement(case, "error", message=xml_text(unread.message))
        error.text = xml_text(unread.hint)
    Xml.indent(top)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{inert_xml(Xml.tostring(top, "unicode"))}'


def _relative(file: str) -> str:
    """Name of a file without a leading "./"."""
    return file.removeprefix("./")


def as_gitlab(report: ValidationReport) -> str:
    """GitLab's code quality report, which merge requests show."""
    issues = [
        {
            "description": " ".join(
                filter(None, (group.first.message, group.first.hint, group.rest()))
            ),
            "check_name": group.first.code,
            "severity": _IN_GITLAB[group.first.severity],
            "fingerprint": mark,
            "location": {"path": _relative(group.first.file), "lines": {"begin": group.first.line}},
        }
        for group, mark in zip(report.groups(), fingerprints(report), strict=True)
    ]
    issues += [
        {
            "description": f"{file.message} {file.hint}",
            "check_name": "unreadable",
            "severity": "blocker",
            "fingerprint": digest(file.file),
            "location": {"path": _relative(file.file), "lines": {"begin": 1}},
        }
        for file in report.unreadable
    ]
    return json_text(issues)


REPORTERS: dict[str, Callable[[ValidationReport], str]] = {
    "text": as_text,
    "json": as_json,
    "sarif": as_sarif,
    "github": as_github,
    "junit": as_junit,
    "gitlab": as_gitlab,
}


_HEAD = b"|".join(
    (
        rb'\{\n  "format_version": \d+,\n  "findings": \[',
        rb'\{\n  "\$schema": "[^"\n]*",\n  "version": "2\.1\.0",\n  "runs": \[\n    \{\n'
        rb'      "tool": \{\n        "driver": \{\n          "name": "terratool",',
        rb'<\?xml version="1\.0" encoding="UTF-8"\?>\n'
        rb'<testsuites name="terratool (?:validate|traversability)"',
        rb"\[\]\n\Z",
        rb'\[\n  \{\n    "description": "[^\n]*",\n    "check_name": "(?:T[TD]\d+|unreadable)",\n',
    )
)
"""Pattern of the beginnings of reports in JSON, SARIF, JUnit's XML and GitLab's JSON."""
_LINE = (
    rb"(?:[^\n]+:\d+:\d+: (?:error|warning|note) T[TD]\d+: [^\n]*"
    rb"|::(?:error|warning|notice) [^\n]*|  [^\n]*)?"
)
_LAST = (
    rb"(?:no files|[\d,]+ files?) checked, (?:[\d,]+ (?:invalid|failed|unreadable), )*"
    rb"(?:no|[\d,]+) errors?, (?:no|[\d,]+) warnings?[^\n]*\."
)
"""Pattern of the last line of a text, and of annotations, whose other lines are `_LINE`."""
_LOOKED_AT = 1 << 16


def is_report(name: str) -> bool:
    """Whether a file is a report of findings in any format, by its first and last 64 KiB."""
    try:
        with open(name, "rb") as file:
            head = file.read(_LOOKED_AT)
            file.seek(max(len(head), file.seek(0, os.SEEK_END) - _LOOKED_AT))
            tail = file.read()
    except OSError:  # an unreadable file counts as none
        return False
    if re.match(_HEAD, head):
        return True
    whole = head if not tail else head.rpartition(b"\n")[0] + b"\n" + tail.partition(b"\n")[2]
    *lines, last, end = [b"", b"", *whole.split(b"\n")]
    is_line = re.compile(_LINE).fullmatch
    return not end and bool(re.fullmatch(_LAST, last)) and all(map(is_line, lines))
