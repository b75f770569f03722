"""JSON Schemas of what commands write with ``--json``, from the records whose fields are the keys.

`make schemas` writes them into schemas/, with those of `terratool.definition.schema_writing`. The
meaning of a key stands in the docstring of its record, or of the result that it is made of.
"""

from __future__ import annotations

import inspect
import json
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_type_hints

from msgspec import UNSET, Struct, structs
from msgspec.json import schema_components

from terratool.cli.gate import GateDocument
from terratool.cli.query import QueryDocument
from terratool.definition import schema_writing
from terratool.field.library_summary import LibrarySummary
from terratool.field.summary import TerrainSummary
from terratool.report.documents import Document
from terratool.traversability import figures, map_results, results, vehicle
from terratool.traversability.report import (
    comparison_keys,
    document,
    map_keys,
    route_keys,
    surface_keys,
    vehicle_keys,
)
from terratool.traversability.report.keys import sources_of
from terratool.traversability.route import results as ways
from terratool.viewing.diff.results import DiffDocument

OUTPUTS: dict[str, tuple[type[Document], str]] = {
    "report": (document.ReportKeys, "traversability report"),
    "comparison": (document.ComparisonKeys, "traversability report of several vehicles"),
    "gate": (GateDocument, "traversability of many files"),
    "difference": (DiffDocument, "difference"),
    "info": (TerrainSummary, "info"),
    "library-info": (LibrarySummary, "info of a library"),
    "query": (QueryDocument, "query"),
}
"""Record and title of each schema."""

_MADE_OF: dict[type, type] = {
    route_keys.PlaceKeys: ways.Location,
    vehicle_keys.WheelKeys: vehicle.Wheel,
    vehicle_keys.AxleKeys: vehicle.Axle,
    vehicle_keys.TracksKeys: vehicle.Tracks,
    vehicle_keys.FeetKeys: vehicle.Feet,
    vehicle_keys.OverhangKeys: vehicle.Overhang,
    vehicle_keys.MarginKeys: vehicle.Margins,
    vehicle_keys.ThresholdKeys: vehicle.Thresholds,
    vehicle_keys.LoadKeys: vehicle.Load,
    vehicle_keys.BatteryKeys: vehicle.Battery,
    vehicle_keys.VehicleKeys: vehicle.Vehicle,
    surface_keys.SlipCurveKeys: figures.SlipCurve,
    surface_keys.DriftCurveKeys: figures.DriftCurve,
    surface_keys.ChanceKeys: figures.Chances,
    surface_keys.LoadSpanKeys: figures.LoadSpan,
    surface_keys.SurfaceKeys: figures.Figures,
    route_keys.BarrierKeys: ways.Barrier,
    route_keys.SteepestKeys: ways.Extreme,
    route_keys.SoftestKeys: ways.Extreme,
    route_keys.TightestKeys: ways.Extreme,
    route_keys.LeastChanceKeys: ways.Extreme,
    route_keys.DriftKeys: ways.Extreme,
    route_keys.CrabKeys: ways.Extreme,
    route_keys.StopKeys: ways.Extreme,
    route_keys.SlowestKeys: ways.Extreme,
    route_keys.EmptiedKeys: ways.Extreme,
    route_keys.ChargeKeys: ways.ChargeUse,
    route_keys.ProfileKeys: ways.RouteProfile,
    route_keys.RouteKeys: ways.Route,
    route_keys.ReachKeys: ways.Reach,
    map_keys.LargestPartKeys: map_results.LargestPart,
    map_keys.MapKeys: map_results.MapSummary,
    document.SamplingKeys: results.Sampling,
    document.ReportKeys: results.TraversabilityReport,
    comparison_keys.SurfaceVerdict: surface_keys.SurfaceKeys,
    comparison_keys.RouteVerdict: route_keys.RouteKeys,
    comparison_keys.MapShares: map_keys.MapKeys,
    document.ComparisonKeys: results.VehicleComparison,
}
"""Class of the results that a record is made of, or record that it is an extract of."""

_UNIT = re.compile(r", (?:rad|Pa|N m|N|m/N|m/s²|m/s|m²|m³|m|kg|s|J|W)(?=[,;.:])")
"""Unit of a result in its docstring; that of a key is in the key's name."""
_NULL = re.compile(r"\b(?:None|NONE|NaN|infinity)\b")
"""Values of a result that are null in JSON."""


@cache
def _said(kind: type) -> tuple[str, dict[str, str]]:
    """Description of a class, and of its attributes and properties by name."""
    text, _, attributes = inspect.cleandoc(kind.__doc__ or "").partition("\n\nAttributes:\n")
    entries = re.findall(r"^    (\w[^:]*): (.*(?:\n {5,}.*)*)", attributes, re.MULTILINE)
    found = {
        name: str(member.__doc__).partition("\n\n")[0]
        for name, member in vars(kind).items()
        if isinstance(member, property)
    }
    found |= {name: said for names, said in entries for name in names.split(", ")}
    return " ".join(text.split()), {name: " ".join(said.split()) for name, said in found.items()}


def _meaning(kind: type, name: str) -> str:
    """Meaning of a field of a record, or of an attribute of a result, in its docstring.

    Raises:
        LookupError: no docstring says what it means.
    """
    for base in kind.__mro__:
        if said := _said(base)[1].get(name):
            return said
    if (source := _MADE_OF.get(kind)) is None:
        raise LookupError(f"no docstring says what {kind.__name__}.{name} is")
    members = {one.key: one.member for one in sources_of(kind)}
    return _meaning(source, name if issubclass(source, Struct) else members[name])


def _records(hint: Any, found: dict[str, type[Struct]]) -> dict[str, type[Struct]]:
    """Records in a type, and in those, by name, beside the ones found before."""
    inside = [*get_args(hint)]
    if isinstance(hint, type) and issubclass(hint, Struct) and hint.__name__ not in found:
        found[hint.__name__] = hint
        inside += get_type_hints(hint).values()
    for one in inside:
        _records(one, found)
    return found


def _definition(kind: type[Struct], written: dict[str, Any]) -> dict[str, Any]:
    """Schema of a record, of what msgspec writes of its types: all of its keys and no others."""
    properties, fields = written["properties"], structs.fields(kind)
    for field in fields:
        value = properties[field.encode_name]
        value.pop("default", None)
        value.get("anyOf", []).sort(key={"type": "null"}.__eq__)  # msgspec 0.19 has it first
        if field.name == "format_version":
            value = {"const": field.default}
        said = _UNIT.sub("", _meaning(kind, field.name))
        said = _NULL.sub("left out" if field.default is UNSET else "null", said)
        if '"null"' in json.dumps(value):
            said = said.replace("empty", "null")
        said = said[0].upper() + said[1:]
        properties[field.encode_name] = {"description": said, **value}
    return {
        "description": _said(kind)[0],
        "type": "object",
        "properties": properties,
        "required": [field.encode_name for field in fields if field.default is not UNSET],
        "additionalProperties": False,
    }


def schema_text(name: str) -> str:
    """Text of a schema, one of `OUTPUTS`."""
    kind, title = OUTPUTS[name]
    written = schema_components([kind], ref_template="#/$defs/{name}")[1]
    shared = _records(document.ReportKeys, {}) if name == "comparison" else {}
    definitions = {
        one.__name__: _definition(one, written[one.__name__])
        for one in _records(kind, {}).values()
        if one.__name__ not in shared
    }
    found = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:terratool:schema:{name}",
        "title": f"terratool {title}",
        **definitions.pop(kind.__name__),
        "$defs": definitions,
    }
    text = json.dumps(found, indent=2, ensure_ascii=False) + "\n"
    for one in shared:
        place = "" if one == "ReportKeys" else f"#/$defs/{one}"
        text = text.replace(f'"#/$defs/{one}"', f'"urn:terratool:schema:report{place}"')
    return text


if __name__ == "__main__":
    texts = {one: schema_writing.schema_text(one) for one in schema_writing.NAMES}
    for name, text in (texts | {one: schema_text(one) for one in OUTPUTS}).items():
        path = Path(sys.argv[1], f"{name}.schema.json")
        path.write_text(text, encoding="utf-8", newline="\n")
