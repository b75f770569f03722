"""Coordinate reference systems: the values that are taken, without reading a file or the net."""

from __future__ import annotations

import re
from contextlib import closing
from functools import lru_cache
from typing import Any, NamedTuple

import msgspec

from terratool.errors import RequestError

CrsValue = str | int | dict[str, Any]

FORMS = 'Write an authority and code such as "EPSG:32633", WKT, PROJJSON or a PROJ string.'

_AUTHORITIES = ("EPSG", "ESRI", "IAU_2015", "IGNF", "NKG", "NRCAN", "OGC")
"""Authorities of the database of PROJ 9."""
WELL_KNOWN = {
    "WGS84": "EPSG:4326", "WGS72": "EPSG:4322", "NAD83": "EPSG:4269", "NAD27": "EPSG:4267",
    "CRS84": "OGC:CRS84", "CRS83": "OGC:CRS83", "CRS27": "OGC:CRS27",
}  # fmt: skip
"""Codes of the names of systems that GDAL has always had."""

_authority = f"({'|'.join(_AUTHORITIES)})"
_code = r"([0-9A-Z_]+(?:\+[0-9]+)?)"
_coded = re.compile(f"{_authority}:{_code}", re.IGNORECASE).fullmatch
_urn = re.compile(f"urn:(?:x-)?ogc:def:crs:{_authority}:[0-9.]*:{_code}", re.IGNORECASE).fullmatch
_uri = re.compile(
    f"https?://www.opengis.net/def/crs/{_authority}/[0-9.]+/{_code}", re.IGNORECASE
).fullmatch
_epsg = re.compile(r"[1-9][0-9]{0,8}(?:\+[1-9][0-9]{0,8})?").fullmatch
_address = re.compile(r"[a-z][a-z0-9+.-]*://|/vsi", re.IGNORECASE).match
_wkt = re.compile(
    r"(?:(?:BOUND|COMPOUND|DERIVEDPROJ|ENG|GEOD|GEOG|PARAMETRIC|PROJ|TIME|VERT)(?:ETIC|RAPHIC|ECTED)?CRS"
    r"|GEOGCS|GEOCCS|PROJCS|VERT_CS|LOCAL_CS|COMPD_CS|ENGINEERINGCRS|VERTICALCRS)\s*\[",
    re.IGNORECASE,
).match
_keyword = re.compile(r"[A-Z_]+(?=\s*\[)", re.IGNORECASE).findall
_quoted = re.compile(r'"[^"]*"')
_AROUND = ("COMPOUNDCRS", "COMPD_CS", "BOUNDCRS", "SOURCECRS")
"""Keywords of WKT around the system of x and y."""
_ANGULAR = ("GEOGCRS", "GEOGRAPHICCRS", "GEOGCS")
_ELLIPSOIDAL = re.compile(r"\bCS\s*\[\s*ellipsoidal", re.IGNORECASE).search
LOCAL = "local"
"""Name of the transverse Mercator about the middle of a raster, on its own body."""
_LEAST, _LARGEST = 6.3e6, 6.45e6
"""Radii of the Earth in metres, whatever the ellipsoid."""
_SOUTHMOST, _NORTHMOST = -80.0, 84.0
"""Latitudes in degrees between which UTM has zones."""
_axis = re.compile(
    r'(?:SPHEROID|ELLIPSOID)\s*\[\s*"[^"]*"\s*,\s*(\d+(?:\.\d*)?(?:e\+?\d+)?)'
    r'|"(?:radius|semi_major_axis)"\s*:\s*(?:\{"value"\s*:\s*)?(\d+(?:\.\d*)?(?:e\+?\d+)?)'
    r'|(?:\+|")(?:R|a)"?\s*[=:]\s*"?(\d+(?:\.\d*)?(?:e\+?\d+)?)',
    re.IGNORECASE,
).search
"""Search for the largest radius of a body, in WKT, PROJJSON and parameters of PROJ."""
_LONGLAT = ("longlat", "latlong", "latlon", "lonlat")
_extension = re.compile(r'\bEXTENSION\b(?:\s*\[\s*"PROJ4"\s*,\s*"([^"]*)"\s*\])?', re.IGNORECASE)
_FILES = r"\b(PARAMETERFILE|PROJ-based|PROJ4_GRIDS)\b"
_reads = re.compile(
    rf"\b(nadgrids|geoidgrids|xy_grids|z_grids|grids|catalog|model|init|file)\s*=|{_FILES}",
    re.IGNORECASE,
).search
"""Search for parameters that make PROJ read a file."""
_grids = re.compile(rf"\b(?:nadgrids|geoidgrids)\s*=|{_FILES}", re.IGNORECASE).search
"""Search for grids that PROJ reads, in a text that may hold other things."""
_NO_GRIDS = re.compile(r"\+nadgrids=@null(?=[\s\"]|$)")
"""Empty datum shift, as in the Mercator projection of web maps; no file is read for it."""
_DEEPEST = 50
_parameter = re.compile(r"\+([a-z][a-z0-9_]*)(?:=([-+.\w'\"°,]+))?", re.IGNORECASE).fullmatch

_PARAMETERS = frozenset(
    """
    R R_A R_V R_a R_g R_h R_lat_a R_lat_g a alpha axis azi b bound datum e ellps es f gamma geoc
    geo_lat guam h k k_0 lat_0 lat_1 lat_2 lat_3 lat_b lat_ts lon_0 lon_1 lon_2 lon_3 lon_wrap
    lonc lsat m M n n_cut no_cut no_defs no_off no_rot no_uoff ns o_alpha o_lat_1 o_lat_2
    o_lat_c o_lat_p o_lon_1 o_lon_2 o_lon_c o_lon_p o_proj offset orient over path pm proj q
    r_lat_a rf rot_xy s south sweep t_epoch theta tilt title to_meter towgs84 type units v_1
    vto_meter vunits W wktext x_0 y_0 zone
    """.split()  # noqa: SIM905
)
"""Parameters of PROJ 9 that describe a reference system."""


class CrsProblem(NamedTuple):
    """Reason why a value is not taken as a reference system, one sentence, and a hint."""

    message: str
    hint: str = FORMS


class AuthorityCode(NamedTuple):
    """Entry of a reference system in the database of PROJ."""

    authority: str
    code: str


def authority_code(crs: CrsValue) -> AuthorityCode | None:
    """Entry that a value names: 32633, "EPSG:32633", "WGS84" or a URN; None for other values."""
    if isinstance(crs, int):
        return AuthorityCode("EPSG", str(crs))
    if not isinstance(crs, str):
        return None
    text = WELL_KNOWN.get(crs.strip().upper(), crs.strip())
    match = _coded(text) or _urn(text) or _uri(text)
    if match is None or (match[1].upper() == "EPSG" and not _epsg(match[2])):
        return None
    return AuthorityCode(match[1].upper(), match[2].upper())


def crs_problem(crs: CrsValue) -> CrsProblem | None:
    """Problem of a value as a reference system, as far as it shows without a database; or None.

    Taken are an authority with a code, WKT, PROJJSON and the parameters of PROJ, as a text or as
    an object. A value that would have a library open a file or an address is a problem.
    """
    if isinstance(crs, int):
        fits = 0 < crs < 2**31
        return None if fits else CrsProblem("the crs is a number that is no EPSG code.")
    if isinstance(crs, dict):
        return _object_problem(crs)
    text = crs.strip()
    if authority_code(text):
        return None
    if _address(text):
        return CrsProblem("the crs is an address, and nothing is fetched from the net.")
    if text.startswith("{"):
        try:
            return _object_problem(msgspec.json.decode(text, type=dict[str, Any]))
        except (msgspec.MsgspecError, RecursionError):
            return CrsProblem("the crs begins like PROJJSON, but is no JSON object.")
    if _wkt(text) and text.endswith("]"):
        return _wkt_problem(text)
    if text.startswith("+"):
        return _parameters_problem(text.split())
    return CrsProblem("the crs is no authority code, WKT, PROJJSON or PROJ string.")


def names_file(text: str) -> bool:
    """Whether a text, which may hold other things, has a reference system with grid files in it."""
    return _grids(_NO_GRIDS.sub("", text)) is not None


def is_geographic(crs: CrsValue) -> bool:
    """Whether x and y are angles, longitudes and latitudes, as far as that is known.

    Codes are looked up in the database of PROJ; without one only `WELL_KNOWN` systems are known.
    """
    if entry := authority_code(crs):
        path = _database()
        well_known = f"{entry.authority}:{entry.code}" in WELL_KNOWN.values()
        return well_known or (path is not None and _is_angular(path, entry))
    if isinstance(crs, dict):
        return _object_is_geographic(crs)
    text = str(crs).strip()
    if text.startswith("{"):
        try:
            return _object_is_geographic(msgspec.json.decode(text, type=dict[str, Any]))
        except (msgspec.MsgspecError, RecursionError):
            return False
    if text.startswith("+"):
        return re.search(rf"\+(o_)?proj=({'|'.join(_LONGLAT)})(?=\s|$)", text) is not None
    plain = _quoted.sub("", text)
    first = next((word for word in map(str.upper, _keyword(plain)) if word not in _AROUND), "")
    if first in ("GEODCRS", "GEODETICCRS"):
        return _ELLIPSOIDAL(plain) is not None
    return first in _ANGULAR


def _object_is_geographic(crs: dict[str, Any]) -> bool:
    if "proj" in crs:
        return crs["proj"] in _LONGLAT or crs.get("o_proj") in _LONGLAT
    for _ in range(_DEEPEST):
        components = crs.get("components")
        inner = components[0] if isinstance(components, list) and components else None
        inner = inner or crs.get("source_crs")
        if not isinstance(inner, dict):
            break
        crs = inner
    system = crs.get("coordinate_system")
    if crs.get("type") in ("GeodeticCRS", "DerivedGeodeticCRS"):
        return isinstance(system, dict) and system.get("subtype") == "ellipsoidal"
    return crs.get("type") in ("GeographicCRS", "DerivedGeographicCRS")


def metric_crs(crs: CrsValue, x: float, y: float) -> str:
    """Reference system in metres to be proposed for a place on longitudes and latitudes.

    That is the zone of UTM, as "EPSG:32633"; "local" beyond the zones, and on other bodies.

    Args:
        crs: reference system of the place.
        x: its longitude in degrees.
        y: its latitude in degrees.
    """
    if not _is_on_earth(crs) or not _SOUTHMOST <= y <= _NORTHMOST:
        return LOCAL
    zone = min(60, int((x + 180) % 360 // 6) + 1)
    return f"EPSG:{(32600 if y >= 0 else 32700) + zone}"


def is_earthly(radius: float) -> bool:
    """Whether a body of this radius in metres is the Earth."""
    return _LEAST <= radius <= _LARGEST


def _is_on_earth(crs: CrsValue) -> bool:
    """Whether a system is one of the Earth, or it cannot be told."""
    if entry := authority_code(crs):
        path = _database()
        radius = None if path is None else _radius(path, entry)
    else:
        text = msgspec.json.encode(crs).decode() if isinstance(crs, dict) else str(crs)
        found = _axis(text)
        radius = float(next(filter(None, found.groups()))) if found else None
    return radius is None or is_earthly(radius)


def refuse_degrees(crs: CrsValue | None, middle: tuple[float, float], doing: str) -> None:
    """Refuse a terrain in degrees for what needs lengths.

    Args:
        crs: reference system of the terrain; None for none.
        middle: x and y of its middle.
        doing: what needs lengths, as the beginning of a sentence.

    Raises:
        RequestError: x and y are degrees.
    """
    if crs is not None and is_geographic(crs):
        raise RequestError(
            f"{doing} needs lengths, and by its crs the terrain has x and y in degrees.",
            f"Import it again with --crs {metric_crs(crs, *middle)}, which has metres.",
        )


def _wkt_problem(text: str) -> CrsProblem | None:
    for extension in _extension.finditer(text):
        if extension[1] is None:
            return CrsProblem("the crs has an EXTENSION that is no text of PROJ.")
        if problem := _parameters_problem(extension[1].split()):
            return problem
    return _file_problem(_extension.sub("", text))


def _object_problem(crs: dict[str, Any]) -> CrsProblem | None:
    if "proj" in crs or "init" in crs:
        return _parameters_problem(
            [f"+{key}={value}" if value is not True else f"+{key}" for key, value in crs.items()]
        )
    if not isinstance(crs.get("type"), str):
        return CrsProblem('the crs is an object with neither "type" nor "proj".')
    pending: list[tuple[Any, int]] = [(crs, 0)]
    while pending:
        item, depth = pending.pop()
        if depth > _DEEPEST:
            return CrsProblem("the crs is nested too deep.")
        if isinstance(item, str) and (problem := _file_problem(item)):
            return problem
        if isinstance(item, list):
            pending += [(part, depth + 1) for part in item]
        elif isinstance(item, dict):
            pending += [(part, depth + 1) for part in item.values()]
            if "name" in item and isinstance(item.get("value"), str):
                return CrsProblem("the crs has a parameter that is a file.")
    return None


def _parameters_problem(words: list[str]) -> CrsProblem | None:
    for word in words:
        if _NO_GRIDS.fullmatch(word):
            continue
        if problem := _file_problem(word):
            return problem
        match = _parameter(word)
        if match is None or match[1] not in _PARAMETERS:
            return CrsProblem(f"the crs has {word[:40]!r}, which describes no reference system.")
    return None


def _file_problem(text: str) -> CrsProblem | None:
    found = _reads(_NO_GRIDS.sub("", text))
    if found is None:
        return None
    name = found[1] or found[2]
    return CrsProblem(
        f'the crs has "{name}", which reads a file.', "Leave it out; no file is read for a crs."
    )


def is_known(entry: AuthorityCode) -> bool | None:
    """Whether the database of PROJ has an entry; None if no database is at hand."""
    path = _database()
    return None if path is None else _has(path, entry)


@lru_cache(maxsize=256)
def _has(path: str, entry: AuthorityCode) -> bool | None:
    import sqlite3

    query = "SELECT 1 FROM crs_view WHERE auth_name = ? AND CAST(code AS TEXT) = ?"
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)) as database:
            return all(
                database.execute(query, (entry.authority, code)).fetchone()
                for code in entry.code.split("+")
            )
    except sqlite3.Error:
        return None


@lru_cache(maxsize=256)
def _is_angular(path: str, entry: AuthorityCode) -> bool:
    """Whether x and y of an entry of the database are angles; of a compound, those of its first."""
    import sqlite3

    kind = "SELECT type FROM crs_view WHERE auth_name = ? AND CAST(code AS TEXT) = ?"
    first = (
        "SELECT horiz_crs_auth_name, CAST(horiz_crs_code AS TEXT) FROM compound_crs "
        "WHERE auth_name = ? AND CAST(code AS TEXT) = ?"
    )
    wanted = (entry.authority, entry.code.partition("+")[0])
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)) as database:
            wanted = database.execute(first, wanted).fetchone() or wanted
            found = database.execute(kind, wanted).fetchone()
            return found is not None and str(found[0]).startswith("geographic")
    except sqlite3.Error:
        return False


@lru_cache(maxsize=256)
def _radius(path: str, entry: AuthorityCode) -> float | None:
    """Radius in metres of the body of a geographic entry of the database; None for others."""
    import sqlite3

    query = (
        "SELECT e.semi_major_axis FROM geodetic_crs c JOIN geodetic_datum d ON d.auth_name = "
        "c.datum_auth_name AND d.code = c.datum_code JOIN ellipsoid e ON e.auth_name = "
        "d.ellipsoid_auth_name AND e.code = d.ellipsoid_code "
        "WHERE c.auth_name = ? AND CAST(c.code AS TEXT) = ?"
    )
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)) as database:
            found = database.execute(query, entry).fetchone()
    except sqlite3.Error:
        return None
    return None if found is None else float(found[0])


def _database() -> str | None:
    """URI path of the database of PROJ, beside rasterio or in the folder of PROJ_DATA; or None."""
    import os
    from importlib.util import find_spec
    from pathlib import Path

    spec = find_spec("rasterio")
    folders = [*(spec.submodule_search_locations or [])] if spec else []
    found = [Path(folder, "proj_data") for folder in folders]
    found += [Path(os.environ[name]) for name in ("PROJ_DATA", "PROJ_LIB") if name in os.environ]
    for folder in found:
        if (folder / "proj.db").is_file():
            return (folder / "proj.db").as_uri().removeprefix("file:")
    return None
