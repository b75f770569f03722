"""Rules on files, and on the size, origin and reference system of terrains."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.rules.base import Subject, rule

_STEPS = 64  # a terrain has at least this many coordinates along each side
_LARGE = 10_000_000


@rule("TT111", "unresolved")
def unresolved(subject: Subject) -> Iterator[Remark]:
    """A terrain so small, or so far from 0, that 64-bit coordinates cannot tell its points apart.

    At 1e16 the next number is 2 away; whole cells would vanish between two coordinates.

    Fails:

        {
          "size": 10, "origin": [1e16, 0],
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    Passes:

        {
          "size": 10, "origin": [500000, 4649776],
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    To mend: move the origin nearer to 0, or check the unit of size.
    """
    definition = subject.definition
    if definition.size is UNSET:
        return
    for corner, side in zip(definition.corner, definition.extent, strict=True):
        if 0 < side < _STEPS * math.ulp(abs(corner) + abs(side)):
            yield Remark(
                "/size",
                "the terrain is too small for coordinates as large as those of its origin.",
                "Move the origin nearer to 0.",
            )
            return


@rule("TT112", "uncompressed", "warning")
def uncompressed(subject: Subject) -> Iterator[Remark]:
    """A text of more than 10 MB that is not gzipped.

    Definitions of that size come from imports, not from hands. Gzipped they take a tenth of the
    space and are read as they are.

    Fails, with 11 MB of space behind:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: gzip the file and let its name end in .json.gz.
    """
    if subject.size > _LARGE and not subject.packed:
        yield Remark(
            "",
            f"the text has {subject.size / 1e6:.0f} MB and is not compressed.",
            "Run gzip on the file; a .json.gz is read as it is.",
        )


@rule("TT114", "no-crs")
def no_crs(subject: Subject) -> Iterator[Remark]:
    """The coordinate reference system is none, or would have a library open a file or an address.

    Taken are an authority with a code, WKT, PROJJSON and the parameters of PROJ, as a text or as
    an object. A definition may come from a stranger: so there is no +init, no +nadgrids but @null,
    no name of a file and no URL.

    Fails:

        {
          "size": 10, "crs": "http://example.com/crs.wkt",
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    Fails:

        {
          "size": 10, "crs": "+proj=longlat +nadgrids=shift.gsb",
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    Passes:

        {
          "size": 10, "crs": "EPSG:32633",
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    To mend: write an authority and code, which says the same in a few characters.
    """
    crs = subject.definition.crs
    if crs is UNSET:
        return
    from terratool.definition.crs import crs_problem

    if problem := crs_problem(crs):
        yield Remark("/crs", *problem)


@rule("TT115", "unknown-crs", "warning")
def unknown_crs(subject: Subject) -> Iterator[Remark]:
    """No coordinate reference system has that code.

    It is looked up in the database of PROJ. A newer PROJ may know more; without one, as in an
    installation that writes no rasters, nothing is looked up.

    Fails:

        {
          "size": 10, "crs": "EPSG:326333",
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    Passes:

        {
          "size": 10, "crs": "EPSG:32633",
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    To mend: correct the code; epsg.io and crs-explorer.proj.org have all of them.
    """
    crs = subject.definition.crs
    if crs is UNSET:
        return
    from terratool.definition.crs import authority_code, crs_problem, is_known

    if crs_problem(crs):
        return
    entry = authority_code(crs)
    if entry is not None and is_known(entry) is False:
        yield Remark(
            "/crs",
            f'the database of PROJ has no "{entry.authority}:{entry.code}".',
            "Correct the code; a raster cannot be written with it.",
        )


@rule("TT116", "degrees", "warning")
def degrees(subject: Subject) -> Iterator[Remark]:
    """The coordinate reference system is geographic: x and y are degrees.

    Heights are not, so that slopes, distances and areas mean nothing. Whatever needs lengths, as
    vehicles, sensors and simulators do, refuses such a terrain. A code is looked up in the database
    of PROJ.

    Fails:

        {
          "size": 0.01, "origin": [15, 45], "crs": "EPSG:4326",
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "vScale": 300}
        }

    Passes:

        {
          "size": 800, "origin": [500000, 4983000], "crs": "EPSG:32633",
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "vScale": 300}
        }

    To mend: import the ground again with --crs and a system in metres, such as the UTM zone.
    """
    definition = subject.definition
    if definition.crs is UNSET or definition.size is UNSET:
        return
    from terratool.definition.crs import crs_problem, is_geographic, metric_crs

    if not crs_problem(definition.crs) and is_geographic(definition.crs):
        (x, y), (width, height) = definition.corner, definition.extent
        system = metric_crs(definition.crs, x + width / 2, y + height / 2)
        yield Remark(
            "/crs",
            "the crs has x and y in degrees, so that slopes and distances mean nothing.",
            f"Import it again with --crs {system}, in metres.",
        )
