"""Rasters beside a definition, of heights or of classes: what their headers say of them."""

from __future__ import annotations

import os
from importlib import import_module
from typing import Protocol

from msgspec import UNSET, Struct, structs

from terratool.definition.model import Definition, Element, GridFile, GridRows, SurfaceGrid
from terratool.definition.tree import Tree, complete, flatten


class FileIdentity(Struct, frozen=True):
    """State of a file that tells whether it is still the same one.

    Attributes:
        device: number of its file system.
        inode: number in that.
        size: bytes.
        modified: time of the last change of its bytes, ns.
        changed: time of the last change of its bytes, its owner or its mode, ns.
        ends: digest of its first and last bytes.
    """

    device: int
    inode: int
    size: int
    modified: int
    changed: int
    ends: str


class GridSource(Struct, frozen=True):
    """Band of a raster, as its header tells; the numbers are read when they are asked for.

    Attributes:
        path: path without links.
        band: number of the band, from 1.
        identity: state of the file when its header was read.
        columns: pixels from west to east.
        rows: pixels from north to south.
        aspect: width of a pixel by its height; None where the file says no place.
        upright: whether rows run from north to south and columns from west to east, or no place is
            said.
        crs: reference system as a definition spells it; None for none.
        overview: index of the overview whose pixels are meant, from 0; None for the band itself.
        classes: whether it is read for classes, which may have a palette, rather than for heights.
    """

    path: str
    band: int
    identity: FileIdentity
    columns: int
    rows: int
    aspect: float | None = None
    upright: bool = True
    crs: str | None = None
    overview: int | None = None
    classes: bool = False


class LinkedGrid(GridFile, frozen=True, rename="camel", kw_only=True):
    """Grid file whose raster was found."""

    source: GridSource


class LinkedSurfaceGrid(SurfaceGrid, frozen=True, rename="camel", kw_only=True):
    """Raster of classes that was found."""

    source: GridSource

    def __hash__(self) -> int:
        return hash((self.source, frozenset(self.names.items())))


class Rasters(Protocol):
    """Rasters that a definition and its libraries name, with limits on all of them."""

    def source(self, path: str, band: int, classes: bool = False) -> GridSource:
        """Band of a raster, whose header is read once.

        Args:
            path: path without links.
            band: number of the band, from 1.
            classes: whether it is to hold classes rather than heights.

        Raises:
            ReadError: the file is no raster with such a band, changes meanwhile, or claims too
                much; or there are too many.
        """
        ...


def no_rasters() -> Rasters:
    """Return rasters of which none was asked for yet."""
    # by its name: rasters are opened by what stands upon definitions, and NumPy comes with it
    found: Rasters = import_module("terratool.io.grid_files").Headers()
    return found


def rows_of(source: GridSource) -> GridRows:
    """Read all heights of a band, which fit into memory, as rows of a text.

    Raises:
        ReadError: the file has changed since its header was read, or is broken.
    """
    found: GridRows = import_module("terratool.io.grid_files").rows_of(source)
    return found


Ranges = tuple[tuple[float, float], tuple[float, float], bool]
"""Least and greatest height of a grid, those on its rim, and whether some heights are void."""


def ranges_of(source: GridSource) -> Ranges:
    """Read the ranges of all heights of a band and of those on its rim, and whether some are void.

    Raises:
        ReadError: the file has changed since its header was read, or is broken.
    """
    found: Ranges = import_module("terratool.io.grid_files").ranges_of(source)
    return found


def as_written(definition: Definition) -> Definition:
    """Definition as a text in the current folder would have it, without what was found."""
    linked = {
        name: structs.replace(primitive, grid=GridFile(_from_here(grid.source.path), grid.band))
        for name, primitive in definition.primitives.items()
        if isinstance(grid := primitive.grid, LinkedGrid)
    }
    if linked:
        definition = structs.replace(definition, elem_types=definition.primitives | linked)
    tree = flatten(definition)
    classes = tree.distinct("surface_grid") - {UNSET}
    if not classes:
        return definition
    written = {
        grid: SurfaceGrid(
            file=_from_here(grid.source.path) if isinstance(grid, LinkedSurfaceGrid) else grid.file,
            band=grid.band,
            names=grid.names,
        )
        for grid in classes
    }
    columns = {name: tree.column(name) for name in Element.__struct_fields__ if name != "children"}
    columns["surface_grid"] = [written.get(grid, grid) for grid in tree.column("surface_grid")]
    return complete(definition, Tree([], tree.families, tree.levels, columns, tree.roots))


def _from_here(path: str) -> str:
    return os.path.relpath(path, os.path.realpath(".")).replace(os.sep, "/")
