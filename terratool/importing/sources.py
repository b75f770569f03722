"""Opening rasters and meshes as heights, by their names."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from terratool.definition.model import LARGEST
from terratool.errors import ReadError, RequestError
from terratool.field.terrain import refuse_empty
from terratool.importing.types import HeightSource, SourceOptions
from terratool.text.source import is_folder

MESHES = (
    ".obj", ".stl", ".ply", ".glb", ".gltf", ".off", ".3mf", ".dxf", ".wrl", ".wrl.gz", ".wrz",
    ".x3d", ".x3d.gz", ".x3dz", ".x3dv", ".x3dv.gz", ".x3dvz", ".dae", ".usd", ".usda", ".usdc",
    ".usdz",
)  # fmt: skip
"""Suffixes of the files that are read as meshes; GDAL opens all others."""

_OTHER_MESHES = (
    ".3ds", ".blend", ".dwg", ".fbx", ".igs", ".sdf", ".step", ".stp", ".urdf", ".x3db",
)  # fmt: skip

_ALL_OF_IT = SourceOptions()


def is_mesh(name: str) -> bool:
    """Tell whether a file of this name is read as a mesh."""
    return name.lower().endswith(MESHES)


@contextlib.contextmanager
def open_source(name: str, options: SourceOptions = _ALL_OF_IT) -> Iterator[HeightSource]:
    """Open a raster or a mesh as heights at the centres of pixels.

    Raises:
        ReadError: the source cannot be read, or has no heights.
        RequestError: an option does not fit the source.
    """
    check_options(name, options)
    if is_mesh(name):
        from terratool.importing.meshes import read_triangles
        from terratool.importing.sampling import sample

        triangles = read_triangles(name, options.up, options.scale)
        yield sample(triangles, options.resolution, options.bounds, name)
        return
    from terratool.importing.rasters import open_raster

    with open_raster(name, options) as heights:
        yield heights


def check_options(name: str, options: SourceOptions) -> None:
    """Refuse options of the other kind of source, and sources of neither kind.

    Raises:
        ReadError: the source is a definition, a folder or a file of another format.
        RequestError: an option does not fit the source or another option, or the bounds are empty.
    """
    if name.lower().endswith(_OTHER_MESHES):
        raise ReadError(
            f"{name}: {Path(name).suffix.lower()} files are not read.",
            f"Export it as one of {', '.join(MESHES)}.",
        )
    if options.bounds is not None and options.window is not None:
        raise RequestError(
            "--window and --bounds both say which part is meant.", "Leave out one of them."
        )
    mesh = is_mesh(name)
    for option, value, of_mesh in (
        ("--window", options.window, False),
        ("--band", options.band, False),
        ("--crs", options.crs, False),
        ("--nodata", options.nodata, False),
        ("--size", options.size, False),
        ("--height-range", options.height_range, False),
        ("--encoding", options.encoding, False),
        ("--source-units", options.source_units, False),
        ("--units", options.units, False),
        ("--source-crs", options.source_crs, False),
        ("--resolution", options.resolution, True),
        ("--up", options.up, True),
        ("--scale", None if options.scale == 1.0 else options.scale, True),
    ):
        if value is not None and of_mesh != mesh:
            raise RequestError(
                f"{option} is about {'meshes' if of_mesh else 'rasters'}, but {name} is read as a "
                f"{'mesh' if mesh else 'raster'}.",
                f"Leave out {option}.",
            )
    if options.bounds is not None:
        refuse_empty(options.bounds)
    _refuse_numbers(options)
    if name.lower().endswith((".json", ".json.gz")):
        raise ReadError(
            f"{name}: is a definition already.",
            "Name a DEM or a mesh; export-dem makes a DEM of a definition.",
        )
    if is_folder(name):
        raise ReadError(f"{name}: is a folder.", "Name a file in it.")


def _refuse_numbers(options: SourceOptions) -> None:
    """Refuse a size or a range of heights that is none, and options that both say what heights are.

    Raises:
        RequestError: an option makes no sense.
    """
    size, ends = options.size, options.height_range
    if size is not None and not all(0.0 < side <= LARGEST for side in size):
        raise RequestError(
            f"The size is {size[0]:g} × {size[1]:g}.", "Give two sides above 0, as --size 120 80."
        )
    if ends is not None and (ends[0] == ends[1] or not all(abs(end) <= LARGEST for end in ends)):
        raise RequestError(
            f"The heights range from {ends[0]:g} to {ends[1]:g}.",
            "Give two different heights, as --height-range 0 10.",
        )
    for option, given in (("--band", options.band), ("--height-range", ends)):
        if options.encoding is not None and given is not None:
            raise RequestError(
                f"{option} and --encoding both say what heights are.", "Leave out one of them."
            )
