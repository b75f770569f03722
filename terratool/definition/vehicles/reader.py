"""Text to vehicle, with findings of the same kind as those of a terrain."""

from __future__ import annotations

from terratool.definition.findings import RemarkLog
from terratool.definition.ignoring import IgnoreLists
from terratool.definition.reader import (
    Checked,
    CheckOptions,
    check,
    placed,
    plain_values,
    take_repeated,
    unreadable,
)
from terratool.definition.recognising import document_kind
from terratool.definition.rules import VehicleSubject, all_rules
from terratool.definition.source import Source
from terratool.definition.vehicles.structure import build_vehicle


def check_any(source: Source, options: CheckOptions | None = None) -> Checked:
    """Read a terrain or a vehicle, whatever it looks like; what is neither is read as a terrain."""
    if document_kind(source.data) == "vehicle":
        return check_vehicle(source, options)
    return check(source, options)


def check_vehicle(source: Source, options: CheckOptions | None = None) -> Checked:
    """Read a vehicle and let every rule look at it. Never raises for what the text contains."""
    options = options or CheckOptions()
    found = RemarkLog(options.limit)
    value, misspelt = plain_values(source.data)
    if misspelt is not None:
        return unreadable(source, misspelt)
    take_repeated(source.data, found)
    vehicle, built = build_vehicle(value, found)
    rules = all_rules()
    if vehicle is not None:
        subject = VehicleSubject(vehicle, built.unfit)
        ignores = IgnoreLists(built.ignores)
        for rule in rules.values():
            if rule.vehicle_check is not None and (options.warnings or rule.severity == "error"):
                remarks = rule.vehicle_check(subject)
                if rule.severity == "warning":
                    remarks = ignores.others(rule.code, remarks, built.tree)
                found.take(rule.code, remarks)
        if options.warnings:
            found.take("TT113", ignores.unused(rules, frozenset()))
    if any(rules[code].severity == "error" for code in found.counts):
        vehicle = None
    findings = placed(source, found, built, options)
    return Checked(None, findings, found.counts, vehicle=vehicle)
