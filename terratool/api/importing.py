"""Imports: a terrain or a primitive from a raster, a mesh, or an array with its place."""

from __future__ import annotations

import contextlib
import operator
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, overload

from numpy.typing import ArrayLike
from rasterio.transform import Affine

from terratool.api.mapping import refuse_transform
from terratool.api.options import fill, options_of, takes
from terratool.api.sources import source_of
from terratool.api.terrain import UserTerrain, load
from terratool.definition.tree import ROOT
from terratool.errors import RequestError, WriteError
from terratool.importing.arrays import PlacedArray, sampled_array
from terratool.importing.primitive.build import (
    ImportedPrimitive,
    PrimitiveRequest,
    import_primitive,
    names_of,
    refuse_missed,
)
from terratool.importing.primitive.insert import (
    CellPath,
    insert_primitive,
    target_of,
    write_primitives,
)
from terratool.importing.primitive.reading import read_patch
from terratool.importing.sources import open_source
from terratool.importing.terrain.build import import_terrain
from terratool.importing.terrain.grids import outputs_of
from terratool.importing.terrain.request import ImportOptions, ImportReport
from terratool.importing.types import HeightSource, SampledHeights, SourceOptions
from terratool.output import is_same_file, refuse_existing, refuse_missing_folder
from terratool.text.source import refuse_name

AnyHeights = str | Path | ArrayLike | PlacedArray
"""Heights: path of a raster or a mesh, or an array, row 0 in the north."""
_OF_ARRAYS = ("crs", "nodata", "allow_vrt", "allow_remote")
"""Options about a source that arrays have, too."""


@overload
def import_terrain_from(
    source: AnyHeights, output: None = None, *,
    transform: Affine | Sequence[float] | None = None, **options: Any,
) -> UserTerrain: ...  # fmt: skip
@overload
def import_terrain_from(
    source: AnyHeights, output: str | Path, *,
    transform: Affine | Sequence[float] | None = None, overwrite: bool = False, **options: Any,
) -> ImportReport: ...  # fmt: skip
@takes(ImportOptions, SourceOptions, without=("title",), called="import_terrain")
def import_terrain_from(
    source: AnyHeights,
    output: str | Path | None = None,
    *,
    transform: Affine | Sequence[float] | None = None,
    overwrite: bool = False,
    **options: Any,
) -> ImportReport | UserTerrain:
    """Make a definition of a DEM or a mesh, as `terratool import-terrain` does.

    The terrain is within `max_error` of the DEM everywhere, which is bilinear between the centres
    of its pixels; that is measured.

    Args:
        source: path of a raster or a mesh, or an array of heights, row 0 in the north.
        output: file to write, compressed if it ends in .gz; None gives the terrain itself.
        transform: affine transform of an array, as rasterio has it: from column and row of a
            pixel's corner to world x and y.
        overwrite: whether the file may exist already.
        **options: options of `ImportOptions` and `SourceOptions`, by name.

    Raises:
        ReadError: the source cannot be read, has no height, or is too small or large.
        RequestError: an option makes no sense, alone or for the source.
        WriteError: the file cannot be written.
    """
    wanted = fill(ImportOptions, options, title=_title(source))
    wanted.check()
    if output is not None:
        refuse_name(output)
        _refuse_same(output, source, wanted.surfaces)
        with _opened(source, transform, options, wanted.decks) as heights:
            for written in outputs_of(output, wanted, heights.grid):
                _refuse_same(written, source, wanted.surfaces)
            return import_terrain(heights, output, wanted, overwrite)
    if wanted.as_ == "grid" or wanted.link:
        raise RequestError(
            "A grid is a raster beside a file, and no file is named.",
            f"Name one, or leave out {'link' if wanted.link else 'as_'}.",
        )
    wanted = replace(wanted, as_="rows")
    with tempfile.TemporaryDirectory(prefix="terratool-") as folder:
        path = Path(folder, "terrain.json")
        with _opened(source, transform, options, wanted.decks) as heights:
            import_terrain(heights, path, wanted)
        return load(source_of(path.read_bytes()))


@takes(PrimitiveRequest, SourceOptions, without=("x_steps", "y_steps"), called="import_primitive")
def import_primitive_from(
    source: AnyHeights,
    name: str,
    *,
    transform: Affine | Sequence[float] | None = None,
    into: str | Path | None = None,
    output: str | Path | None = None,
    cell: tuple[int, int] | None = None,
    span: tuple[int, int] | None = None,
    parent: str = ROOT,
    overwrite: bool = False,
    **options: Any,
) -> ImportedPrimitive:
    """Make a primitive of a patch of heights, as `terratool import-primitive` does.

    `primitives()` of the result has the entries for elemTypes, `elements()` elements of them, and
    `notes` sentences on the source and on the cell.

    Args:
        source: path of a raster or a mesh, or an array of heights, row 0 in the north.
        name: name of the primitive.
        transform: affine transform of an array, as rasterio has it.
        into: terrain or library that it is added to; None for none.
        output: file to write: `into` with the primitive, or the primitive alone.
        cell: column and row of the cell where an element is added to `into`; None for no element.
        span: columns and rows of cells that this element takes; one cell if None.
        parent: JSON pointer of the element whose grid has the cell.
        overwrite: whether to replace a primitive of that name, and an output that exists.
        **options: options of `PrimitiveRequest` and `SourceOptions`, by name.

    Raises:
        ReadError: the source cannot be read, or has no height.
        RequestError: an option makes no sense, alone or for the source.
        MissedError: the error is larger than `max_error`; nothing is written.
        DefinitionError: `into` has errors.
        WriteError: a file exists, or cannot be written.
    """
    wanted = fill(PrimitiveRequest, options)
    names = names_of(name, wanted)
    if cell is not None and into is None:
        raise RequestError("A cell is about a definition.", "Name that by into=….")
    if span is not None and cell is None:
        raise RequestError("A span goes with a cell.", "Say where by cell=….")
    place = None
    if cell is not None:
        place = CellPath(pair("cell", cell, 0), parent, pair("span", span or (1, 1), 1))
    target = None
    if into is not None:
        target = target_of(
            str(into), names, place, None if output is None else str(output), overwrite
        )
    elif output is not None:
        refuse_existing(Path(output), overwrite)
        refuse_missing_folder(Path(output))
    if output is not None:
        _refuse_same(output, source)
    if isinstance(source, str | Path):
        refuse_transform(transform)
        patch, wanted = read_patch(str(source), fill(SourceOptions, options), wanted)
    else:
        patch = _array(source, transform, options)
    imported = import_primitive(patch, name, wanted)
    refuse_missed(imported, wanted)
    if target is not None:
        remarks = insert_primitive(target, imported, overwrite)
        imported = replace(imported, notes=(*imported.notes, *remarks))
    elif output is not None:
        write_primitives(imported, output, overwrite)
    return imported


def pair(name: str, value: Any, least: int) -> tuple[int, int]:
    """Two whole numbers.

    Raises:
        RequestError: the value is something else, or a number is below the least.
    """
    try:
        x, y = (operator.index(one) for one in value)
    except (TypeError, ValueError):
        x = y = least - 1
    if min(x, y) < least:
        raise RequestError(f"{name} is {value!r}.", f"Give two whole numbers from {least} on.")
    return x, y


def _title(source: AnyHeights) -> str:
    """Name of a source for the description."""
    return Path(source).name if isinstance(source, str | Path) else "an array"


def _refuse_same(output: str | Path, *sources: object) -> None:
    """Refuse an output that is one of the inputs."""
    for one in sources:
        if isinstance(one, str | Path) and is_same_file(str(one), output):
            raise WriteError(f"{output}: is the same file as {one}.", "Choose another name.")


@contextlib.contextmanager
def _opened(
    source: AnyHeights,
    transform: Affine | Sequence[float] | None,
    options: dict[str, Any],
    decks: bool,
) -> Iterator[HeightSource]:
    """Open a source by its path, or take an array."""
    if not isinstance(source, str | Path):
        yield _array(source, transform, options)
        return
    refuse_transform(transform)
    with open_source(str(source), fill(SourceOptions, options), decks=decks) as heights:
        yield heights


def _array(
    source: ArrayLike | PlacedArray, transform: Affine | Sequence[float] | None,
    options: dict[str, Any],
) -> SampledHeights:  # fmt: skip
    """Heights of an array; refuse options that are about files."""
    for name in options_of(SourceOptions):
        if name in options and name not in _OF_ARRAYS:
            raise RequestError(f"{name} is about files, but an array is given.", "Leave it out.")
    return sampled_array(source, transform, options.get("crs"), options.get("nodata"))
