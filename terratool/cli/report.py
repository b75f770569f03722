"""What `validate` found, and the formats in which it says so: one result, a table of reporters."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import click
from msgspec import Struct
from msgspec.structs import asdict

from terratool import __version__
from terratool.definition.findings import Finding
from terratool.definition.rules import RULES
from terratool.definition.rules.base import Rule
from terratool.text.display import Excerpt, columns_of, counted, printable

FORMAT_VERSION = 1
SARIF_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/os/schemas/sarif-schema-2.1.0.json"
_COLORS = {"error": "red", "warning": "yellow"}
_FIELDS = ("file", "code", "severity", "pointer", "line", "column", "message", "hint", "bounds")


class Unreadable(Struct, frozen=True):
    """A file that could not be read: one sentence why, one what to do."""

    file: str
    message: str
    hint: str


class ValidationSummary(Struct, frozen=True):
    """How many files and findings there were.

    Attributes:
        hidden: findings that are counted but not listed.
    """

    files: int = 0
    valid: int = 0
    invalid: int = 0
    unreadable: int = 0
    errors: int = 0
    warnings: int = 0
    hidden: int = 0


class ValidationReport(Struct, frozen=True):
    """What was found in all files."""

    findings: tuple[Finding, ...]
    unreadable: tuple[Unreadable, ...]
    summary: ValidationSummary


def as_text(report: ValidationReport) -> str:
    """For people: each finding with its line and a caret, a summary last."""
    lines = []
    for finding in report.findings:
        color = _COLORS[finding.severity]
        file = printable(finding.file)
        place = click.style(f"{file}:{finding.line}:{finding.column}:", bold=True)
        label = click.style(f"{finding.severity} {finding.code}:", fg=color, bold=True)
        lines.append(f"{place} {label} {finding.message}")
        if finding.excerpt is not None and finding.excerpt.text:
            lines += _shown(finding.line, finding.excerpt, color)
        lines.append(f"  {finding.hint}")
        lines.append("")
    return "\n".join([*lines, _summed_up(report.summary)])


def _shown(line: int, excerpt: Excerpt, color: str) -> Iterable[str]:
    number = str(line)
    before = sum(map(columns_of, excerpt.text[: excerpt.caret]))
    bar = click.style("|", fg="blue")
    yield f"  {click.style(number, fg='blue')} {bar} {excerpt.text}"
    yield f"  {' ' * len(number)} {bar} {' ' * before}{click.style('^', fg=color, bold=True)}"


def _summed_up(summary: ValidationSummary) -> str:
    parts = [f"{_count(summary.files, 'file')} checked"]
    if summary.invalid:
        parts.append(f"{summary.invalid:,} invalid")
    if summary.unreadable:
        parts.append(f"{summary.unreadable:,} unreadable")
    parts += [_count(summary.errors, "error"), _count(summary.warnings, "warning")]
    end = "."
    if summary.hidden:
        end = f"; {summary.hidden:,} of them not listed (see --max-findings)."
    return ", ".join(parts) + end


def _count(number: int, noun: str) -> str:
    return counted(number, noun) if number else f"no {noun}s"


def as_json(report: ValidationReport) -> str:
    """For scripts: versioned, with everything that is known of a finding."""
    import json

    findings = [{name: getattr(f, name) for name in _FIELDS} for f in report.findings]
    return json.dumps(
        {
            "format_version": FORMAT_VERSION,
            "findings": findings,
            "unreadable": [asdict(file) for file in report.unreadable],
            "summary": asdict(report.summary),
        },
        indent=2,
        ensure_ascii=False,
    )


def as_github(report: ValidationReport) -> str:
    """Workflow commands, which GitHub shows as annotations in the text of the file."""
    lines = []
    for f in report.findings:
        place = f"file={_property(f.file)},line={f.line},col={f.column},title={f.code}"
        lines.append(f"::{f.severity} {place}::{_data(f.message + chr(10) + f.hint)}")
    for file in report.unreadable:
        what = _data(f"{file.message}\n{file.hint}")
        lines.append(f"::error file={_property(file.file)},title=unreadable::{what}")
    return "\n".join([*lines, _summed_up(report.summary)])


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")


def as_sarif(report: ValidationReport) -> str:
    """SARIF 2.1.0, which code scanning services take."""
    import json

    notes = [(file.file, f"{file.message} {file.hint}") for file in report.unreadable]
    return json.dumps(sarif_log(report.findings, notes), indent=2, ensure_ascii=False)


def sarif_log(findings: Iterable[Finding], unreadable: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """The log of one run in SARIF 2.1.0.

    Args:
        findings: what was found.
        unreadable: names of files that could not be read, and why.
    """
    rules = RULES
    places = {code: index for index, code in enumerate(rules)}
    driver = {
        "name": "terratool",
        "semanticVersion": __version__,
        "rules": [_rule(rule) for rule in rules.values()],
    }
    notes = [
        {
            "level": "error",
            "message": {"text": text},
            "locations": [{"physicalLocation": {"artifactLocation": _artifact(file)}}],
        }
        for file, text in unreadable
    ]
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {"executionSuccessful": not unreadable, "toolExecutionNotifications": notes}
        ],
        "results": [_result(finding, places[finding.code]) for finding in findings],
    }
    return {"$schema": SARIF_SCHEMA, "version": "2.1.0", "runs": [run]}


def _rule(rule: Rule) -> dict[str, Any]:
    return {
        "id": rule.code,
        "name": rule.name,
        "shortDescription": {"text": rule.summary},
        "help": {"text": rule.manual},
        "defaultConfiguration": {"level": rule.severity},
    }


def _result(finding: Finding, rule: int) -> dict[str, Any]:
    properties: dict[str, Any] = {"hint": finding.hint}
    if finding.bounds is not None:
        properties["bounds"] = finding.bounds
    return {
        "ruleId": finding.code,
        "ruleIndex": rule,
        "level": finding.severity,
        "message": {"text": f"{finding.message} {finding.hint}"},
        "locations": [
            {
                "physicalLocation": {
                    "artifactLocation": _artifact(finding.file),
                    "region": {"startLine": finding.line, "startColumn": finding.column},
                },
                "logicalLocations": [{"fullyQualifiedName": finding.pointer}],
            }
        ],
        "properties": properties,
    }


def _artifact(file: str) -> dict[str, str]:
    import os
    from pathlib import Path
    from urllib.parse import quote

    path = Path(file)
    if path.is_absolute():
        return {"uri": path.as_uri()}
    return {"uri": quote(os.fsencode(file.replace(os.sep, "/")))}


REPORTERS: dict[str, Callable[[ValidationReport], str]] = {
    "text": as_text,
    "json": as_json,
    "sarif": as_sarif,
    "github": as_github,
}
