"""A report as a plain value for JSON, as schemas/report.schema.json describes it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.text.display import shown
from terratool.traversability.report.page import as_page
from terratool.traversability.report.tables import as_markdown
from terratool.traversability.results import (
    Barrier,
    Extreme,
    Figures,
    Location,
    MapSummary,
    Reach,
    Reason,
    Route,
    RouteProfile,
    TraversabilityReport,
    Verdict,
)
from terratool.traversability.vehicle import Overhang, Vehicle

FORMAT_VERSION = 1

_VERDICTS = (Verdict.GO, Verdict.CAUTION, Verdict.NO_GO, Verdict.UNKNOWN)


def as_dict(report: TraversabilityReport) -> dict[str, Any]:
    """A report as dictionaries, lists, texts and finite numbers.

    Units are in the names of keys; what is not known, means nothing or has no limit is None.
    """
    return {
        "format_version": FORMAT_VERSION,
        "terrain": {
            "file": report.terrain,
            "descr": report.descr,
            "bounds": list(map(_finite, report.bounds)),
        },
        "vehicle": _vehicle(report.vehicle),
        "verdict": report.verdict.label,
        "sentence": report.sentence,
        "surfaces": [_figures(figures) for figures in report.surfaces],
        "map": _summary(report.summary),
        "routes": [_route(route) for route in report.routes],
        "reach": _reach(report.reach) if report.reach else None,
        "notes": list(report.notes),
        "assumptions": list(report.assumptions),
    }


def as_json(report: TraversabilityReport) -> str:
    """A report as the text of a JSON file."""
    return json.dumps(as_dict(report), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(value: float | None, factor: float = 1.0) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return _tidy(float(value) * factor)


def _tidy(value: float) -> float:
    """Twelve digits: without what factors of units leave at the end of numbers."""
    return float(f"{value:.12g}")


def _degrees(value: float | None) -> float | None:
    return None if value is None else _finite(math.degrees(value))


def _binding(reason: Reason) -> str | None:
    return None if reason == Reason.NONE else reason.label


def _vehicle(vehicle: Vehicle) -> dict[str, Any]:
    wheel, margins, limits = vehicle.wheel, vehicle.margins, vehicle.thresholds
    return {
        "name": vehicle.name,
        "single_wheel": vehicle.is_single,
        "mass_kg": None if vehicle.is_single else _finite(vehicle.mass),
        "gravity_m_s2": None if vehicle.is_single else _finite(vehicle.gravity),
        "weight_N": _finite(vehicle.weight),
        "wheel": {
            "radius_m": _finite(wheel.radius),
            "width_m": _finite(wheel.width),
            "max_torque_Nm": _finite(wheel.max_torque),
            "max_slip": _finite(wheel.max_slip),
        },
        "axles": [
            {"x_m": _finite(axle.x), "wheels": axle.wheels, "driven": axle.driven}
            for axle in vehicle.axles
        ],
        "track_m": _finite(vehicle.track),
        "cog_height_m": _finite(vehicle.cog_height),
        "clearance_m": _finite(vehicle.clearance),
        "body_width_m": _finite(vehicle.body_width),
        "front": _overhang(vehicle.front),
        "rear": _overhang(vehicle.rear),
        "speed_m_s": _finite(vehicle.speed),
        "power_W": _finite(vehicle.power),
        "margins": {
            "clearance_m": _finite(margins.clearance),
            "step_m": _finite(margins.step),
            "tip_deg": _degrees(margins.tip),
            "slope_deg": _degrees(margins.slope),
        },
        "classes": {
            "utilisation": _finite(limits.utilisation),
            "slip": _finite(limits.slip),
            "caution_slip": _finite(limits.caution_slip),
            "torque": _finite(limits.torque),
            "geometry": _finite(limits.geometry),
        },
    }


def _overhang(end: Overhang) -> dict[str, float | None]:
    return {"length_m": _finite(end.length), "height_m": _finite(end.height)}


def _figures(figures: Figures) -> dict[str, Any]:
    return {
        "surface": figures.surface,
        "verdict": figures.verdict.label,
        "binding": _binding(figures.reason),
        "missing": list(figures.missing),
        "preset": figures.preset or None,
        "load_N": _finite(figures.load),
        "cohesion_kPa": _finite(figures.cohesion, 1e-3),
        "friction_deg": _degrees(figures.friction),
        "sinkage_rate_m_per_kN": _finite(figures.sinkage_rate, 1e3),
        "shear_modulus_m": _finite(figures.shear_modulus),
        "sinkage_m": _finite(figures.sinkage),
        "contact_length_m": _finite(figures.contact_length),
        "contact_area_m2": _finite(figures.contact_area),
        "pressure_kPa": _finite(figures.pressure, 1e-3),
        "normal_stress_kPa": _finite(figures.normal_stress, 1e-3),
        "shear_stress_kPa": _finite(figures.shear_stress, 1e-3),
        "thrust_N": _finite(figures.thrust),
        "resistance_N": _finite(figures.resistance),
        "drawbar_N": _finite(figures.drawbar),
        "torque_Nm": _finite(figures.torque),
        "utilisation": _finite(figures.utilisation),
        "slip": _finite(figures.slip),
        "climb_deg": _degrees(figures.climb),
        "climb_binding": _binding(figures.climb_limit),
        "cross_slope_deg": _degrees(figures.cross_slope),
        "cross_slope_binding": _binding(figures.cross_limit),
        "step_m": _finite(figures.step),
        "step_binding": figures.step_limit or None,
        "gap_m": _finite(figures.gap),
        "warnings": list(figures.warnings),
    }


def _counts(counts: dict[Verdict, int]) -> dict[str, int]:
    return {verdict.label: int(counts.get(verdict, 0)) for verdict in _VERDICTS}


def _summary(summary: MapSummary) -> dict[str, Any]:
    grid = summary.grid
    return {
        "resolution_m": _finite(grid.resolution),
        "width": grid.width,
        "height": grid.height,
        "bounds": list(map(_finite, grid.bounds)),
        "headings": summary.headings,
        "pixels": summary.pixels,
        "best_heading": _counts(summary.counts),
        "worst_heading": _counts(summary.worst_counts),
        "fractions": {verdict.label: _finite(summary.fraction(verdict)) for verdict in _VERDICTS},
        "binding": {
            reason.label: int(count)
            for reason, count in sorted(summary.reasons.items())
            if count and reason != Reason.NONE
        },
        "by_surface": [
            {"surface": name or None, **_counts(counts)}
            for name, counts in summary.by_surface.items()
        ],
    }


def _place(place: Location) -> dict[str, Any]:
    return {
        "x": _finite(place.x),
        "y": _finite(place.y),
        "z": _finite(place.height),
        "surface": place.surface or None,
        "element": place.element or None,
    }


def _extreme(extreme: Extreme | None, key: str, value: float | None) -> dict[str, Any] | None:
    if extreme is None:
        return None
    return {key: value, "binding": _binding(extreme.reason), "place": _place(extreme.place)}


def _route(route: Route) -> dict[str, Any]:
    steep, soft, tight = route.steepest, route.softest, route.tightest
    return {
        "found": route.found,
        "planned": route.planned,
        "verdict": route.verdict.label,
        "start": _place(route.start),
        "goal": _place(route.goal),
        "length_m": _finite(route.length),
        "time_s": _finite(route.time),
        "energy_J": _finite(route.energy),
        "steepest": _extreme(steep, "pitch_deg", _degrees(steep.value) if steep else None),
        "softest": _extreme(soft, "sinkage_m", _finite(soft.value) if soft else None),
        "tightest": _extreme(tight, "margin", _finite(tight.value) if tight else None),
        "barriers": [_barrier(bar) for bar in route.barriers],
        "reached": _place(route.reached) if route.reached else None,
        "profile": _profile(route.profile) if route.profile else None,
    }


def _barrier(bar: Barrier) -> dict[str, Any]:
    return {
        "binding": _binding(bar.reason),
        "bars": bar.bars,
        "width_m": _finite(bar.width),
        "place": _place(bar.place),
    }


def _column(values: NDArray[Any], factor: float = 1.0) -> list[float | None]:
    scaled = np.asarray(values, np.float64) * factor
    return [_tidy(value) if math.isfinite(value) else None for value in scaled.tolist()]


def _profile(profile: RouteProfile) -> dict[str, Any]:
    per_radian = 180.0 / math.pi
    return {
        "x": _column(profile.x),
        "y": _column(profile.y),
        "heading_deg": _column(profile.heading),
        "distance_m": _column(profile.distance),
        "z": _column(profile.height),
        "sinkage_m": _column(profile.sinkage),
        "pitch_deg": _column(profile.pitch, per_radian),
        "roll_deg": _column(profile.roll, per_radian),
        "slip": _column(profile.slip),
        "utilisation": _column(profile.utilisation),
        "verdict": [Verdict(code).label for code in profile.verdict.tolist()],
        "binding": [_binding(Reason(code)) for code in profile.reason.tolist()],
        "surface": [name or None for name in profile.surface],
    }


def _reach(reach: Reach) -> dict[str, Any]:
    return {
        "start": _place(reach.start),
        "share": _finite(reach.share),
        "returnable": _finite(reach.returnable),
    }


FORMATS: dict[str, Callable[[TraversabilityReport], str]] = {
    ".json": as_json,
    ".md": as_markdown,
    ".html": as_page,
}


def renderer_of(path: str | Path) -> Callable[[TraversabilityReport], str]:
    """What makes the text of a report's file of this name.

    Raises:
        RequestError: there is no such format.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        what = f"there are no reports as {shown(suffix)}" if suffix else "has no suffix"
        raise RequestError(f"{path}: {what}.", f"Let it end in {', '.join(FORMATS)}.")
    return FORMATS[suffix]
