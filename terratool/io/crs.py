"""Coordinate reference systems as GDAL and PROJ know them."""

from __future__ import annotations

import rasterio
from rasterio.crs import CRS
from rasterio.errors import CRSError

from terratool.definition.crs import FORMS, CrsValue, authority_code, crs_problem, is_known
from terratool.errors import RequestError
from terratool.text.display import quote


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
