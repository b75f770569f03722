"""`terratool validate`."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from terratool.definition.findings import Finding
from terratool.definition.reader import check
from terratool.definition.source import read_source
from terratool.errors import ReadError

FORMAT_VERSION = 1


@click.command("validate", epilog="Example: terratool validate samples/paper-example.json")
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json"]),
    default="text",
    help="How the findings are written.",
)
@click.pass_context
def command(ctx: click.Context, files: tuple[str, ...], form: str) -> None:
    """Check terrain definitions and say what is wrong, and where.

    FILE may be gzipped, and - is standard input. Exits 0 if all are valid, 1 if one is not, 3 if
    one cannot be read.
    """
    findings: list[Finding] = []
    invalid = unreadable = 0
    for name in files:
        try:
            checked = check(read_source(name))
        except ReadError as error:
            click.echo(f"terratool: {error.message}\n  {error.hint}", err=True)
            unreadable += 1
            continue
        findings.extend(checked.findings)
        invalid += checked.definition is None
    counts = {
        "files": len(files),
        "valid": len(files) - invalid - unreadable,
        "invalid": invalid,
        "unreadable": unreadable,
        "errors": sum(finding.severity == "error" for finding in findings),
        "warnings": sum(finding.severity == "warning" for finding in findings),
    }
    click.echo(_json(findings, counts) if form == "json" else _text(findings, counts))
    ctx.exit(3 if unreadable else int(invalid > 0))


def _text(findings: list[Finding], counts: dict[str, int]) -> str:
    lines = []
    for f in findings:
        lines.append(f"{f.file}:{f.line}:{f.column}: {f.severity} {f.code}: {f.message}")
        lines.append(f"  {f.hint}")
    parts = [f"{_count(counts['files'], 'file')} checked"]
    parts += [f"{counts[key]} {key}" for key in ("invalid", "unreadable") if counts[key]]
    parts.append(_count(counts["errors"], "error"))
    parts.append(_count(counts["warnings"], "warning"))
    return "\n".join([*lines, ", ".join(parts) + "."])


def _count(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def _json(findings: list[Finding], counts: dict[str, int]) -> str:
    report = {
        "format_version": FORMAT_VERSION,
        "findings": [asdict(finding) for finding in findings],
        "summary": counts,
    }
    return json.dumps(report, indent=2, ensure_ascii=False)
