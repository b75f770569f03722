"""Findings as a log in the Static Analysis Results Interchange Format (OASIS SARIF 2.1.0)."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from terratool import __version__
from terratool.definition.findings import Finding
from terratool.definition.rules import Rule, all_rules

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/os/schemas/sarif-schema-2.1.0.json"


def log(findings: Iterable[Finding], unreadable: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """The log of one run.

    Args:
        findings: what was found.
        unreadable: names of files that could not be read, and why.
    """
    rules = all_rules()
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
    return {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}


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
    path = Path(file)
    if path.is_absolute():
        return {"uri": path.as_uri()}
    return {"uri": quote(os.fsencode(file.replace(os.sep, "/")))}
