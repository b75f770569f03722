"""Lines as a GeoPackage, the SQLite file of OGC 12-128r19 that every GIS reads."""

from __future__ import annotations

import contextlib
import sqlite3
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terratool.definition.crs import AuthorityCode
from terratool.errors import WriteError
from terratool.report.inert import xml_text

if TYPE_CHECKING:
    from rasterio.crs import CRS

_APPLICATION = 0x47504B47
_VERSION = 10300
_NO_TIME = "1970-01-01T00:00:00.000Z"
"""Time of the last change, which is the same for the same lines."""
_OWN = 100000
"""Number of a reference system that has no EPSG code."""
_PLANE = -1
"""Number of the plane without a reference system."""
_HEADER = struct.Struct("<2sBBi4d")
_LINE = struct.Struct("<BII")

_TABLES = """
CREATE TABLE gpkg_spatial_ref_sys (
  srs_name TEXT NOT NULL, srs_id INTEGER PRIMARY KEY, organization TEXT NOT NULL,
  organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (
  table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
  description TEXT DEFAULT '',
  last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
  CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (
  table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL,
  srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name),
  CONSTRAINT uk_gc_table_name UNIQUE (table_name),
  CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
  CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE contours (
  fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom LINESTRING, elev DOUBLE);
"""

_INDEX = """
CREATE TABLE gpkg_extensions (
  table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL, definition TEXT NOT NULL,
  scope TEXT NOT NULL, CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name));
INSERT INTO gpkg_extensions VALUES ('contours', 'geom', 'gpkg_rtree_index',
  'http://www.geopackage.org/spec120/#extension_rtree', 'write-only');
CREATE VIRTUAL TABLE rtree_contours_geom USING rtree(id, minx, maxx, miny, maxy);
"""
"""Spatial index of the lines (OGC 12-128r17, F.3)."""
_SOME, _NONE = (
    "NEW.geom NOTNULL AND NOT ST_IsEmpty(NEW.geom)",
    "NEW.geom ISNULL OR ST_IsEmpty(NEW.geom)",
)
_PUT = (
    "INSERT OR REPLACE INTO rtree_contours_geom VALUES (NEW.fid, ST_MinX(NEW.geom), "
    "ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom)); "
)
_DROP = "DELETE FROM rtree_contours_geom WHERE id = OLD.fid; "
_TRIGGERS = (
    ("insert", "INSERT", _SOME, _PUT),
    ("update1", "UPDATE OF geom", f"OLD.fid = NEW.fid AND ({_SOME})", _PUT),
    ("update2", "UPDATE OF geom", f"OLD.fid = NEW.fid AND ({_NONE})", _DROP),
    ("update3", "UPDATE", f"OLD.fid != NEW.fid AND ({_SOME})", _DROP + _PUT),
    ("update4", "UPDATE", f"OLD.fid != NEW.fid AND ({_NONE})",
     "DELETE FROM rtree_contours_geom WHERE id IN (OLD.fid, NEW.fid); "),
    ("delete", "DELETE", "OLD.geom NOT NULL", _DROP),
)  # fmt: skip
"""Name, event, condition and action of the triggers with which other programs keep the index."""

_WGS84 = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,'
    'AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,'
    'AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],'
    'AXIS["Latitude",NORTH],AXIS["Longitude",EAST],AUTHORITY["EPSG","4326"]]'
)
_SYSTEMS = (
    ("Undefined Cartesian SRS", _PLANE, "NONE", _PLANE, "undefined", "any plane"),
    ("Undefined geographic SRS", 0, "NONE", 0, "undefined", "any longitude and latitude"),
    ("WGS 84 geodetic", 4326, "EPSG", 4326, _WGS84, "longitude and latitude in degrees"),
)
"""Reference systems that every GeoPackage has."""


def write_contours(
    path: Path, contours: Iterable[tuple[float, NDArray[np.float64]]], crs: CRS | None,
    named: AuthorityCode | None, descr: str,
) -> None:  # fmt: skip
    """Write lines as the table `contours` with the column `elev`.

    They have a spatial index, unless SQLite here has none.

    Args:
        path: file to write, which does not exist.
        contours: height of each line, and its (n, 2) x and y.
        crs: reference system of x and y; None without one.
        named: entry that the system is stated by; None for other forms.
        descr: description of the table.

    Raises:
        WriteError: SQLite cannot write the file.
    """
    try:
        with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as base:
            known = "SELECT 1 FROM pragma_module_list WHERE name = 'rtree'"
            indexed = base.execute(known).fetchone() is not None
            base.executescript(
                f"PRAGMA application_id = {_APPLICATION}; PRAGMA user_version = {_VERSION};"
                "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN;"
                + _TABLES
                + _INDEX * indexed
            )
            number = _add_system(base, crs, named)
            whole = np.array([np.inf, np.inf, -np.inf, -np.inf])
            for fid, (line, height, sides) in enumerate(_rows(contours, number, whole), 1):
                base.execute("INSERT INTO contours VALUES (?, ?, ?)", (fid, line, height))
                if indexed:
                    place = (fid, *sides)
                    base.execute("INSERT INTO rtree_contours_geom VALUES (?, ?, ?, ?, ?)", place)
            # they call functions that only other programs have, and come last
            for name, event, condition, action in _TRIGGERS * indexed:
                base.execute(
                    f"CREATE TRIGGER rtree_contours_geom_{name} AFTER {event} ON contours "
                    f"WHEN {condition} BEGIN {action}END"
                )
            box = whole.tolist() if np.isfinite(whole).all() else [None] * 4
            base.execute(
                "INSERT INTO gpkg_contents VALUES ('contours', 'features', 'contours', ?, ?, "
                "?, ?, ?, ?, ?)",
                (xml_text(descr), _NO_TIME, *box, number),
            )
            base.execute(
                "INSERT INTO gpkg_geometry_columns VALUES "
                "('contours', 'geom', 'LINESTRING', ?, 0, 0)",
                (number,),
            )
            base.execute("COMMIT")
    except sqlite3.Error as error:
        raise WriteError(
            f"{path.name}: cannot be written ({error}).", "Check the space on the disk."
        ) from error


def _add_system(base: sqlite3.Connection, crs: CRS | None, named: AuthorityCode | None) -> int:
    """Add the reference systems, and return the number of the given one."""
    systems, number = list(_SYSTEMS), _PLANE
    if crs is not None:
        text = crs.to_wkt()
        name = text.split('"')[1] if '"' in text else "own"
        maker, code = "NONE", _OWN
        if named is not None and named.code.isdecimal():
            maker, code = named.authority, int(named.code)
        number = code if maker == "EPSG" else _OWN
        if number not in (system[1] for system in systems):
            systems.append((name, number, maker, code, text, ""))
    base.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", systems)
    return number


def _rows(
    contours: Iterable[tuple[float, NDArray[np.float64]]], number: int, whole: NDArray[np.float64]
) -> Iterator[tuple[bytes, float, tuple[float, float, float, float]]]:
    """Yield each line with its height and its west, east, south, north; widen `whole` by them."""
    for height, line in contours:
        low, high = line.min(axis=0), line.max(axis=0)
        np.minimum(whole[:2], low, out=whole[:2])
        np.maximum(whole[2:], high, out=whole[2:])
        # little-endian, with the rectangle around the line
        sides = float(low[0]), float(high[0]), float(low[1]), float(high[1])
        header = _HEADER.pack(b"GP", 0, 0b11, number, *sides)
        points = np.ascontiguousarray(line, "<f8").tobytes()
        yield header + _LINE.pack(1, 2, len(line)) + points, height, sides
