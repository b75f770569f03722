"""A report as a plain value for JSON, as schemas/report.schema.json describes it."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from terratool._version import __version__
from terratool.errors import RequestError
from terratool.text.display import inert_json, json_text, shown
from terratool.traversability.report import wording
from terratool.traversability.report.curves import as_svg
from terratool.traversability.report.page import as_markdown, as_page
from terratool.traversability.report.routes import route_features
from terratool.traversability.results import (
    Barrier,
    Chances,
    Extreme,
    Figures,
    GroundClass,
    LargestPart,
    Location,
    MapSummary,
    Reach,
    Reason,
    Route,
    RouteProfile,
    SlipCurve,
    TraversabilityReport,
    Verdict,
)
from terratool.traversability.vehicle import (
    Axle,
    Margins,
    Overhang,
    Thresholds,
    Vehicle,
    Wheel,
)

FORMAT_VERSION = 2

_KEYS: dict[type, str] = {
    Vehicle: "name single_wheel mass_kg gravity_m_s2 weight_N wheel axles track_m cog_height_m "
    "clearance_m body_width_m front rear steering speed_m_s power_W margins classes",
    Wheel: "radius_m width_m grouser_height_m contact_length_m patch_pressure_kPa exit_ratio "
    "max_torque_Nm max_slip",
    Axle: "x_m wheels driven wheel",
    Overhang: "length_m height_m",
    Margins: "clearance_m step_m tip_deg slope_deg",
    Thresholds: "utilisation slip caution_slip torque geometry",
    Figures: "surface verdict binding missing preset load_N cohesion_kPa friction_deg "
    "sinkage_rate_m_per_kN shear_modulus_m sinkage_m contact_length_m contact_area_m2 pressure_kPa "
    "normal_stress_kPa shear_stress_kPa entry_angle_deg strength_kPa motor_stress_kPa "
    "limit_torque_Nm thrust_N resistance_N drawbar_N torque_Nm utilisation slip "
    "climb_deg climb_binding cross_slope_deg cross_slope_binding step_m step_binding step_axle "
    "gap_m turning_Nm turning_work_J turning_slip turning_binding warnings slip_curve",
    SlipCurve: "slope_deg slip",
    Location: "x y z surface element",
    Barrier: "binding bars width_m place",
    Route: "found planned verdict start goal length_m time_s energy_J turning_J steepest softest "
    "tightest barriers reached note one_way against back headings tried_headings "
    "ruled_out_headings profile",
    RouteProfile: "x y heading_deg distance_m z sinkage_m pitch_deg roll_deg slip utilisation "
    "verdict binding surface element",
    Reach: "start share returnable note",
    LargestPart: "place share",
    Chances: "go go_or_caution climb_low_deg climb_high_deg",
}
"""Keys of records: names of members, and units where they have one."""

_UNITS = {
    "m_per_kN": 1e3, "m_s2": 1.0, "m_s": 1.0, "m2": 1.0, "m": 1.0, "kg": 1.0, "s": 1.0, "J": 1.0,
    "W": 1.0, "Nm": 1.0, "N": 1.0, "kPa": 1e-3, "deg": 180.0 / math.pi,
}  # fmt: skip
"""For each unit of a key the factor from SI units."""

_OTHER_NAMES = {
    "binding": "reason",
    "go_or_caution": "drives",
    "classes": "thresholds",
    "single_wheel": "is_single",
    "track": "track_width",
    "z": "height",
}
"""Members that have another name than their key."""

_KEY = re.compile(rf"(\w+?)(?:_({'|'.join(_UNITS)}))?")


def as_dict(report: TraversabilityReport) -> dict[str, Any]:
    """A report as dictionaries, lists, texts and finite numbers.

    Units are in the names of keys; what is not known, means nothing or has no limit is None.
    """
    document = {
        "format_version": FORMAT_VERSION,
        "tool": {"name": "terratool", "version": __version__},
        "terrain": {
            "file": report.terrain,
            "descr": report.descr,
            "bounds": _plain(report.bounds),
        },
        "vehicle": _plain(report.vehicle),
        "model": report.vehicle.model,
        "verdict": report.verdict.label,
        "sentence": wording.conclusion(report),
        "surfaces": _plain(report.surfaces),
        "mending": [{"where": place, "line": line} for place, line in wording.mending(report)],
        "map": None if report.summary is None else _summary(report.summary),
        "routes": _plain(report.routes),
        "reach": _plain(report.reach),
        "notes": list(report.notes),
        "assumptions": list(report.assumptions),
    }
    sampling = report.sampling
    if sampling is not None:
        document["sampling"] = {
            "samples": sampling.samples,
            "seed": sampling.seed,
            "error": _plain(sampling.error),
            "ranges": [
                dict(zip(("surface", "key", "low", "high"), one, strict=True))
                for one in sampling.ranges
            ],
        }
    return document


def as_json(report: TraversabilityReport) -> str:
    """A report as the text of a JSON file."""
    return file_text(as_dict(report))


def file_text(value: Any) -> str:
    """A plain value as the text of a JSON file."""
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    return inert_json(text) + "\n"


def _plain(value: Any, factor: float = 1.0) -> Any:
    """A value for JSON: None for an empty text, for no reason, and for what is not finite.

    Floating-point numbers have twelve digits: none that only come from factors of units.
    """
    if isinstance(value, float):
        return float(f"{value * factor:.12g}") if math.isfinite(value) else None
    if isinstance(value, str):
        return value or None
    if isinstance(value, Verdict):
        return value.label
    if isinstance(value, Reason):
        return None if value == Reason.NONE else value.label
    if isinstance(value, tuple):
        return [_plain(each, factor) for each in value]
    if isinstance(value, np.ndarray):
        return [_plain(each, factor) for each in value.tolist()]
    return _record(value) if type(value) in _KEYS else value


def _record(record: Any) -> dict[str, Any]:
    """The members of a record by their keys."""
    document = {}
    for key in _KEYS[type(record)].split():
        name, unit = _KEY.fullmatch(key).groups()  # type: ignore[union-attr]
        document[key] = _plain(getattr(record, _OTHER_NAMES.get(name, name)), _UNITS.get(unit, 1.0))
    match record:
        case Vehicle():
            document["name"] = record.name
            if record.is_single:
                document["mass_kg"] = document["gravity_m_s2"] = None
        case Figures():
            document["surface"] = record.surface
            if record.chances is not None:
                document["probability"] = _plain(record.chances)
        case Route():
            for name, key in (
                ("steepest", "pitch_deg"),
                ("softest", "sinkage_m"),
                ("tightest", "margin"),
            ):
                document[name] = _extreme(getattr(record, name), key)
            if record.least_chance is not None:
                least = record.least_chance
                document["probability"] = _plain(record.chance)
                document["least_probability"] = {
                    "probability": _plain(least.value), "place": _plain(least.place),
                }  # fmt: skip
        case RouteProfile():
            document["heading_deg"] = _plain(record.heading)
            document["verdict"] = [Verdict(code).label for code in record.verdict.tolist()]
            document["binding"] = [_plain(Reason(code)) for code in record.reason.tolist()]
    return document


def _extreme(extreme: Extreme | None, key: str) -> dict[str, Any] | None:
    if extreme is None:
        return None
    value = _plain(extreme.value, _UNITS["deg"] if key == "pitch_deg" else 1.0)
    return {key: value, "binding": _plain(extreme.reason), "place": _plain(extreme.place)}


def _counts(counts: dict[GroundClass, int]) -> dict[str, int]:
    return {ground.label: counts.get(ground, 0) for ground in wording.GROUNDS}


def _summary(summary: MapSummary) -> dict[str, Any]:
    grid = summary.grid
    document = {
        "resolution_m": _plain(grid.resolution),
        "width": grid.width,
        "height": grid.height,
        "bounds": _plain(grid.bounds),
        "headings": summary.headings,
        "from": _plain(summary.start),
        "largest_part": _plain(summary.largest),
        "pixels": summary.pixels,
        "best_heading": _counts(summary.counts),
        "worst_heading": _counts(summary.worst_counts),
        "fractions": {ground.label: _plain(summary.fraction(ground)) for ground in wording.GROUNDS},
        "binding": {
            reason.label: count
            for reason, count in sorted(summary.reasons.items())
            if count and reason != Reason.NONE
        },
        "by_surface": [
            {"surface": name or None, **_counts(counts)}
            for name, counts in summary.by_surface.items()
        ],
    }
    if summary.chances is not None:
        document["probability"] = [
            {"at_least": bound, "pixels": count} for bound, count in summary.chances.items()
        ]
    return document


def as_geojson(report: TraversabilityReport) -> str:
    """The routes of a report as the text of a GeoJSON file, a line for each feature."""
    return geojson_text(report, route_features(report.routes))


def geojson_text(report: TraversabilityReport, features: Iterable[dict[str, Any]]) -> str:
    """Features as the text of a GeoJSON file, with the head that a report has for it."""
    head = {**report.geojson, "terratool": __version__}
    lines = ",\n".join(json_text(one, None) for one in features)
    return f'{json_text(head, None)[:-1]}, "features": [\n{lines}\n]}}\n'


FORMATS: dict[str, Callable[[TraversabilityReport], str]] = {
    ".json": as_json,
    ".md": as_markdown,
    ".html": as_page,
    ".svg": as_svg,
    ".geojson": as_geojson,
}


def renderer_of(
    path: str | Path, formats: Mapping[str, Callable[[Any], str]] = FORMATS
) -> Callable[[Any], str]:
    """What makes the text of a report's file of this name, of some formats by suffix.

    Raises:
        RequestError: there is no such format.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in formats:
        what = f"there are no reports as {shown(suffix)}" if suffix else "has no suffix"
        raise RequestError(f"{path}: {what}.", f"Let it end in {', '.join(formats)}.")
    return formats[suffix]
