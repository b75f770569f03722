"""Coordinate reference systems as GDAL and PROJ know them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import rasterio
from rasterio.crs import CRS
from rasterio.errors import CRSError

from terratool.definition.crs import (
    FORMS,
    LOCAL,
    CrsValue,
    authority_code,
    crs_problem,
    is_known,
)
from terratool.errors import RequestError
from terratool.text.display import quote

_SAME_BODY = 0.01
"""Largest difference of two radii of one body, as a share: equators and poles, spheres between."""
_GEODETIC = ("GeographicCRS", "GeodeticCRS", "DerivedGeographicCRS")
_DIGITS = 6
"""Decimals of the degrees about which a local system lies: some 0.1 m on the Earth."""


def read_crs(crs: CrsValue | CRS) -> CRS:
    """Parse a coordinate reference system without letting PROJ or GDAL open a file.

    One that rasterio has read stays as it is.

    Raises:
        RequestError: the form is not accepted, or PROJ does not know the system.
    """
    if isinstance(crs, CRS):
        return crs
    problem = crs_problem(crs)
    if problem is not None:
        raise RequestError(f"{shown_crs(crs)} names no reference system.", problem.hint)
    entry = authority_code(crs)
    try:
        with rasterio.Env():  # sends GDAL's own message to its log, not to the terminal
            if entry is None:
                return CRS.from_user_input(crs)
            # PROJ would try an unknown code as a file name
            if is_known(entry) is False:
                raise CRSError("not in the database")
            return CRS.from_user_input(f"{entry.authority}:{entry.code}")
    except CRSError as error:
        raise RequestError(f"{shown_crs(crs)} names no reference system.", FORMS) from error


def spell_crs(crs: CRS | None, about: list[str]) -> str | None:
    """Spell a reference system as a definition does: by its code, else as WKT.

    Args:
        crs: the system; None for none.
        about: list that gets a sentence if the system is left out, as it reads a file.
    """
    wkt = "" if crs is None else str(crs.to_wkt())
    if crs is None or not wkt:
        return None
    if crs_problem(wkt):
        about.append("The reference system reads a file, and was left out.")
        return None
    number = crs.to_epsg()
    return f"EPSG:{number}" if number else wkt


def shown_crs(crs: CrsValue) -> str:
    """Text of a reference system for messages."""
    return quote(crs) if isinstance(crs, str | int) else "an object"


def radius_of(crs: CRS) -> float | None:
    """Largest radius in metres of the body of a reference system; None where it has none."""
    base = _base_of(_members(crs))
    datum = base.get("datum") or base.get("datum_ensemble") or {}
    ellipsoid = datum.get("ellipsoid") or {}
    length = ellipsoid.get("radius", ellipsoid.get("semi_major_axis"))
    if not isinstance(length, dict):
        return None if length is None else float(length)
    unit = length.get("unit")
    return float(length["value"]) * (unit["conversion_factor"] if isinstance(unit, dict) else 1.0)


def refuse_other_body(name: str, crs: CRS, target: CRS, option: str) -> None:
    """Refuse a reference system of another celestial body, by the radii of the two.

    Args:
        name: what has the system, for messages.
        crs: its system.
        target: the other system.
        option: option that names that.

    Raises:
        RequestError: the bodies differ.
    """
    one, other = radius_of(crs), radius_of(target)
    if one is None or other is None or abs(one - other) <= _SAME_BODY * max(one, other):
        return
    raise RequestError(
        f"{name}: the reference system that {option} names is on another celestial body, with a "
        f"radius of {other / 1e3:,.0f} km rather than {one / 1e3:,.0f} km.",
        f"Name one of the same body, or --crs {LOCAL}.",
    )


def local_crs(crs: CRS, x: float, y: float) -> CRS:
    """Transverse Mercator about a place, in metres, on the datum of a reference system.

    Args:
        crs: the system, in which the place is given.
        x: west-east coordinate of the place.
        y: south-north coordinate of the place.

    Raises:
        RequestError: the system has no datum, or the place is none of it.
    """
    from rasterio.warp import transform

    base = _base_of(_members(crs))
    if base.get("type") not in _GEODETIC:
        raise RequestError(
            "The reference system has no place on a celestial body.",
            f"Leave out --crs {LOCAL}, or name its system with --source-crs.",
        )
    angles = _made(base)
    (east,), (north,) = transform(crs, angles, [x], [y])
    if not (math.isfinite(east) and math.isfinite(north)):
        raise RequestError(
            f"The middle, {x:.10g} {y:.10g}, is no place of the reference system.",
            "Check the place and the system with gdalinfo.",
        )
    _, radians = angles.units_factor
    east, north = math.degrees(east * radians), math.degrees(north * radians)
    east = (east + 180.0) % 360.0 - 180.0
    values = {"Latitude": round(north, _DIGITS), "Longitude": round(east, _DIGITS)}
    parameters: list[dict[str, Any]] = [
        {"name": f"{name} of natural origin", "value": value, "unit": "degree"}
        for name, value in values.items()
    ]
    parameters += [
        {"name": "Scale factor at natural origin", "value": 1, "unit": "unity"},
        {"name": "False easting", "value": 0, "unit": "metre"},
        {"name": "False northing", "value": 0, "unit": "metre"},
    ]
    made = {
        "type": "ProjectedCRS",
        "name": f"Transverse Mercator about {values['Longitude']:g} {values['Latitude']:g}",
        "base_crs": base,
        "conversion": {
            "name": "local", "method": {"name": "Transverse Mercator"}, "parameters": parameters,
        },
        "coordinate_system": {
            "subtype": "Cartesian",
            "axis": [
                {"name": "Easting", "abbreviation": "E", "direction": "east", "unit": "metre"},
                {"name": "Northing", "abbreviation": "N", "direction": "north", "unit": "metre"},
            ],
        },
    }  # fmt: skip
    return _made(made)


def crs_in_metres(crs: CRS) -> CRS:
    """Projection with metres in place of its own unit; coordinates become others by a factor."""
    found = _members(crs)
    projected = next((one for one in _around(found) if one.get("type") == "ProjectedCRS"), found)
    for axis in projected["coordinate_system"]["axis"]:
        axis["unit"] = "metre"
    projected.pop("id", None)
    projected["name"] += " in metres"
    return _made(projected)


def horizontal_crs(crs: CRS) -> CRS:
    """Reference system without the vertical part of a compound one."""
    found = _members(crs)
    parts = found.get("components", [])
    return _made(next((one for one in parts if one["type"] != "VerticalCRS"), found))


def _members(crs: CRS) -> dict[str, Any]:
    """Members of a reference system as PROJJSON."""
    return dict(crs.to_dict(projjson=True))


def _made(members: dict[str, Any]) -> CRS:
    """Reference system of PROJJSON, kept as WKT, from which rasterio can spell it otherwise."""
    return CRS.from_wkt(CRS.from_user_input(json.dumps(members)).to_wkt())


def _around(crs: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Systems of PROJJSON that stand within each other: compounds, shifted ones, projections."""
    inner: Any = crs
    while isinstance(inner, dict):
        yield inner
        parts = inner.get("components")
        inner = parts[0] if parts else inner.get("source_crs") or inner.get("base_crs")


def _base_of(crs: dict[str, Any]) -> dict[str, Any]:
    """Innermost system of PROJJSON, that of longitudes and latitudes if there is one."""
    *_, base = _around(crs)
    return base


def vertical_unit(crs: CRS) -> str:
    """Name of the unit of heights of a reference system; "" where it has none."""
    members = _members(crs)
    for part in members.get("components", [members]):
        for axis in part.get("coordinate_system", {}).get("axis", []):
            if axis["direction"] in ("up", "down"):
                unit = axis.get("unit", "")
                return str(unit.get("name", "") if isinstance(unit, dict) else unit)
    return ""
