"""Rules on rasters beside the text, of the heights of grids or of classes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.grid_files import GridSource, LinkedGrid, LinkedSurfaceGrid
from terratool.definition.libraries import path_between
from terratool.definition.model import CLASS, Pair
from terratool.definition.part_sizes import Cells, PartSize, PartSizes, SizeLimits
from terratool.definition.rules.base import Subject, faces_of, reader_rule, rule
from terratool.definition.tree import ROOT
from terratool.definition.uses import Root, elements_of
from terratool.text.display import escape, quote

_is_class = re.compile(CLASS).fullmatch
_NOT_UPRIGHT = (
    "the raster does not lie north up; its first row is taken as the north.",
    "Resample it with gdalwarp.",
)
_NEAR = 0.01
"""Share by which the aspect of a raster and that of a cell may differ."""

reader_rule(
    "TT312",
    "grid-file",
    """
    The raster of a grid cannot be read: it is missing, no raster of heights, or lacks the band.

    Paths begin at the folder of the file that names the raster. Of it only its own bytes are read:
    no file beside it, no net. A band holds real numbers; a palette and complex numbers are no
    heights. NaN, infinite numbers and ones beyond 1e30 in size are void. The raster of a
    surfaceGrid obeys the same rules, but its classes may have a palette.

    Its header is held against its size: all rasters that are unpacked as a whole have together at
    most 67,108,864 pixels beyond 64 for each byte of their files. A definition and its libraries
    name at most 1,000 bands.

    Fails:

        {"size": 9, "elemTypes": {"d": {"grid": {"file": "dem.tif"}}}, "elemTree": {"type": "d"}}

    Passes:

        {"size": 9, "elemTypes": {"d": {"grid": [[0, 1], [2, 3]]}}, "elemTree": {"type": "d"}}

    To mend: check the path, and the raster with gdalinfo.
    """,
)
reader_rule(
    "TT313",
    "grid-path",
    """
    The path of a raster is none that may be followed.

    It is relative to the file that names it, with forward slashes; nothing is read from the net.
    The raster lies under the folder of the terrain, under the current folder, or under one that is
    named by --library-root, so that a file from elsewhere cannot have others read.

    Fails:

        {
          "size": 10,
          "elemTypes": {"dem": {"grid": {"file": "/data/dem.tif"}}}, "elemTree": {"type": "dem"}
        }

    Fails:

        {
          "size": 10,
          "elemTypes": {"dem": {"grid": {"file": "https://example.org/dem.tif"}}},
          "elemTree": {"type": "dem"}
        }

    Passes:

        {"size": 10, "elemTypes": {"dem": {"grid": [[0, 1], [2, 3]]}}, "elemTree": {"type": "dem"}}

    To mend: put the raster beside the terrain, and write its path from there.
    """,
)


@rule("TT316", "surface-class")
def surface_class(subject: Subject) -> Iterator[Remark]:
    """A key among the names of a surfaceGrid is no class, a whole number.

    Classes are written as 1 or -2, in quotes as all keys of JSON, without a leading zero and with
    15 digits at most. A class that the raster does not have is no error.

    Fails:

        classes.tif: 2 × 2 pixels of 5 × 5 in EPSG:32632

        {
          "size": 10, "surfTypes": {"sand": {"preset": "dry-sand"}}, "elemTypes": {"b": {"x": [1]}},
          "elemTree": {
            "type": "b", "surfaceGrid": {"file": "classes.tif", "names": {"1.5": "sand"}}
          }
        }

    Passes:

        classes.tif: 2 × 2 pixels of 5 × 5 in EPSG:32632

        {
          "size": 10, "surfTypes": {"sand": {"preset": "dry-sand"}}, "elemTypes": {"b": {"x": [1]}},
          "elemTree": {
            "type": "b", "surfaceGrid": {"file": "classes.tif", "names": {"1": "sand"}}
          }
        }

    To mend: write the number that the raster has where the surface is.
    """
    wrong = {
        grid: [key for key in grid.names if not _is_class(key)]
        for grid in subject.tree.distinct("surface_grid") - {UNSET}
    }
    strange = {grid for grid, keys in wrong.items() if keys}
    for index, grid in subject.tree.elements_with("surface_grid", strange):
        for key in wrong[grid]:
            yield Remark(
                f"/surfaceGrid/names/{escape(key)}",
                f"{quote(key)} is no class.",
                'Write a whole number in quotes, as "1".',
                on_key=True,
                element=index,
            )


def _sources(subject: Subject) -> Iterator[tuple[str, GridSource]]:
    """Names of primitives that are rasters, the file's own and others that are used, and these."""
    if not subject.document.rasters:
        return
    uses = subject.uses
    roots = [] if uses.circles else list(map(uses.part, uses.parts_in_use))
    used = subject.tree.shapes.union(*map(_shapes, roots))
    others = sorted(name for name in used - {UNSET} if name in subject.primitives)
    for name in dict.fromkeys([*subject.definition.primitives, *others]):
        primitive = subject.primitives[name]
        if isinstance(primitive.grid, LinkedGrid):
            yield name, primitive.grid.source


def _shapes(root: Root) -> set[Any]:
    """Primitives of the elements of a part, and of the other faces of these."""
    tree, own = root.tree, elements_of(root)
    found = set(map(tree.column("type").__getitem__, own))
    if tree.has_storeys:
        found |= {storey.face for storey in map(tree.storey, own) if storey is not UNSET}
    return found


def raster_place(subject: Subject, name: str) -> tuple[str, int]:
    """Pointer of a raster's path, or the element at which it begins: the first one that has it."""
    if name in subject.definition.primitives:
        return f"/elemTypes/{escape(name)}/grid/file", -1
    own = subject.tree.column("type")
    if name in own:
        return "/type", own.index(name)
    for index, pointer, face in faces_of(subject.tree):
        if face == name:
            return pointer, index
    uses = subject.uses
    leading = uses.parts_leading_to(lambda root: name in _shapes(root))
    return "/part", next(use.element for use in uses.within(uses.root) if use.part in leading)


@rule("TT314", "grid-aspect", "warning")
def grid_aspect(subject: Subject) -> Iterator[Remark]:
    """An element stretches a raster, or the raster does not lie north up.

    The place of a raster is not used: its first row is the north of the cell, its first column the
    west. Where it says how wide and tall its pixels are, the cell has the proportions of all of
    them. Rasters in degrees are not looked at. A part is looked at in the sizes that it stands in,
    up to 1,000 of these, with 20,000 cells in all. What it has is told of once, in the part; if
    that is in a library, where the part stands. The rasters of a surfaceGrid, an under and a roof
    are looked at likewise, but not in parts.

    Fails:

        dem.tif: 2 × 2 pixels of 5 × 5 in EPSG:32632

        {
          "size": [10, 20],
          "elemTypes": {"dem": {"grid": {"file": "dem.tif"}}}, "elemTree": {"type": "dem"}
        }

    Passes:

        dem.tif: 2 × 2 pixels of 5 × 5 in EPSG:32632

        {
          "size": [10, 10],
          "elemTypes": {"dem": {"grid": {"file": "dem.tif"}}}, "elemTree": {"type": "dem"}
        }

    To mend: give the element a cell of the raster's proportions; resample a raster that does not
    lie north up with gdalwarp.
    """
    from terratool.definition.crs import is_geographic

    upright = {}
    for name, source in _sources(subject):
        if source.aspect is None or (source.crs and is_geographic(source.crs)):
            continue
        if source.upright:
            upright[name] = _proportions(subject, name, source)
            continue
        if name in subject.definition.primitives:  # that of a library is told of there
            yield Remark(f"/elemTypes/{escape(name)}/grid/file", *_NOT_UPRIGHT)
    tree = subject.tree
    for index, name in enumerate(tree.column("type") if upright else ()):
        if name in upright:
            raster = _raster_of(name)
            yield from _outside_parts(subject, index, "/type", raster, upright[name])
    for index, pointer, name in faces_of(tree) if upright else ():
        if name in upright:
            raster = _raster_of(name)
            yield from _outside_parts(subject, index, pointer, raster, upright[name])
    for index, grid in tree.elements_with("surface_grid", _class_grids(subject)):
        source, here = grid.source, "/surfaceGrid/file"
        if source.aspect is None or (source.crs and is_geographic(source.crs)):
            continue
        if source.upright:
            wanted = source.aspect * source.columns / source.rows
            yield from _outside_parts(subject, index, here, "the raster of classes", wanted)
            continue
        yield Remark(here, *_NOT_UPRIGHT, element=index)
    yield from _in_parts(subject, upright)


_MEND = "Give the element a cell of these proportions."


def _raster_of(name: str) -> str:
    return f"the raster of {quote(name)}"


def _stretched(raster: str, cell: Pair, wanted: float) -> str:
    """Words on a cell that has other proportions than its raster; empty where it has them."""
    wide, tall = cell
    if abs(wide - wanted * tall) <= _NEAR * max(wide, wanted * tall):
        return ""
    return (
        f"the cell is {wide:.6g} × {tall:.6g}, and {raster} is {wanted:.4g} times as wide as tall"
    )


def _outside_parts(
    subject: Subject, index: int, pointer: str, raster: str, wanted: float
) -> Iterator[Remark]:
    """Yield a remark on an element in no part whose cell has other proportions than a raster."""
    tree = subject.tree
    if tree.roots[tree.root_of[index]] != ROOT:
        return
    cell = tree.rectangle(index, subject.definition)
    if cell is None:
        return
    # a turn leaves the sides as they are
    stretched = _stretched(raster, (cell[2] - cell[0], cell[3] - cell[1]), wanted)
    if stretched:
        yield Remark(pointer, f"{stretched}.", _MEND, element=index)


def _class_grids(subject: Subject) -> set[LinkedSurfaceGrid]:
    """Rasters of classes that were found."""
    grids = subject.tree.distinct("surface_grid")
    return {grid for grid in grids if isinstance(grid, LinkedSurfaceGrid)}


def _in_parts(subject: Subject, upright: dict[str, float]) -> Iterator[Remark]:
    """Yield remarks on elements of parts, in the sizes that these stand in."""
    uses = subject.uses
    if not upright or not uses.has_root or uses.circles or subject.definition.size is UNSET:
        return

    def look(cells: Cells) -> Iterator[tuple[int, str, int]]:
        root = cells.root
        for index in elements_of(root) if root != uses.root else ():
            name = root.tree.value("type", index)
            if name in upright:
                yield cells.number(index), name, index

    sizes = PartSizes(uses, set(uses.parts_in_use), look, SizeLimits(1_000, 20_000))
    told: set[int] = set()
    seen: set[PartSize] = set()
    for alike in sizes.alike():
        size, name = alike.size, str(alike.key)
        lengths, cell = (each.turn_by(size.lies).lengths for each in (alike.sides, size.sides))
        stretched = _stretched(_raster_of(name), lengths, upright[name])
        own = alike.root.tree is subject.tree
        mark = id(alike.elements) if own else id(sizes.found[size])
        if not stretched or mark in told:
            continue
        told.add(mark)
        where = f"where the part {quote(size.part)} stands in {cell[0]:.6g} × {cell[1]:.6g}"
        if own:
            for index in alike.elements:
                yield Remark("/type", f"{stretched}, {where}.", _MEND, element=index)
            continue
        library = path_between(subject.document, alike.root.home)
        place = f"{library}#{alike.root.tree.pointer(alike.elements[0])}"
        for user in sizes.elements_leading_to(size, seen):
            yield Remark("/part", f"in {place}, {stretched}, {where}.", _MEND, element=user)


def _proportions(subject: Subject, name: str, source: GridSource) -> float:
    """Width of a raster by its height, from its outer numbers or from its outer edges."""
    less = subject.primitives[name].registered == "gridline"
    columns, rows = max(source.columns - less, 1), max(source.rows - less, 1)
    return (source.aspect or 1.0) * columns / rows


@rule("TT315", "grid-crs", "warning")
def grid_crs(subject: Subject) -> Iterator[Remark]:
    """A raster has another reference system than the terrain.

    The reference system of a raster is not used, nor is it resampled; most often the raster has to
    be projected first. Systems are compared by their codes.

    Fails:

        dem.tif: 2 × 2 pixels of 5 × 5 in EPSG:32632

        {
          "size": 10, "crs": "EPSG:32633",
          "elemTypes": {"dem": {"grid": {"file": "dem.tif"}}}, "elemTree": {"type": "dem"}
        }

    Passes:

        dem.tif: 2 × 2 pixels of 5 × 5 in EPSG:32632

        {
          "size": 10, "crs": "EPSG:32632",
          "elemTypes": {"dem": {"grid": {"file": "dem.tif"}}}, "elemTree": {"type": "dem"}
        }

    To mend: project the raster with gdalwarp, or correct the crs.
    """
    from terratool.definition.crs import authority_code

    crs = subject.definition.crs
    own = None if crs is UNSET else authority_code(crs)
    places = [(*raster_place(subject, name), source) for name, source in _sources(subject)]
    places += [
        ("/surfaceGrid/file", element, grid.source)
        for grid, element in subject.tree.first_of("surface_grid").items()
        if isinstance(grid, LinkedSurfaceGrid)
    ]
    for pointer, element, source in places:
        its = authority_code(source.crs) if source.crs else None
        if own is not None and its is not None and its != own:
            yield Remark(
                pointer,
                f"the raster is in {its.authority}:{its.code}, the terrain in "
                f"{own.authority}:{own.code}.",
                "Project the raster with gdalwarp -t_srs, or correct the crs.",
                element=element,
            )
