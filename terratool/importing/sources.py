"""Opening rasters, meshes and clouds of points as heights."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

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


Kind = Literal["raster", "mesh", "cloud"]
_KINDS: dict[Kind, str] = {"raster": "rasters", "mesh": "meshes", "cloud": "clouds of points"}


def kind_of(name: str, options: SourceOptions) -> Kind:
    """Kind of a source by its name, and of texts and PLYs by how they begin."""
    from terratool.importing.clouds import is_cloud

    if is_cloud(name, asked=_asks_for_cells(options)):
        return "cloud"
    return "mesh" if is_mesh(name) else "raster"


def _asks_for_cells(options: SourceOptions) -> bool:
    """Whether an option is about clouds, or about sides of pixels, which texts of grids have."""
    return options.resolution is not None or options.heights is not None or options.ground


@contextlib.contextmanager
def open_source(
    name: str, options: SourceOptions = _ALL_OF_IT, *, decks: bool = False
) -> Iterator[HeightSource]:
    """Open a raster, a mesh or a cloud of points as heights at the centres of pixels.

    Args:
        name: name of the source.
        options: options of reading.
        decks: whether heights of a mesh are those of the ground where something stands over it.

    Raises:
        ReadError: the source cannot be read, or has no heights.
        RequestError: an option does not fit the source.
    """
    kind = check_options(name, options)
    if kind == "cloud":
        from terratool.importing.clouds import sample_cloud

        yield sample_cloud(name, options)
        return
    if kind == "mesh":
        from terratool.importing.meshes import read_triangles
        from terratool.importing.sampling import sample

        triangles = read_triangles(name, options.up, options.scale)
        yield sample(triangles, options.resolution, options.bounds, name, decks=decks)
        return
    from terratool.importing.rasters import open_raster

    with open_raster(name, options) as heights:
        yield heights


def check_options(name: str, options: SourceOptions) -> Kind:
    """Return the kind of a source; refuse options of other kinds, and sources of none.

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
    from terratool.importing.clouds import TEXTS

    kind = kind_of(name, options)
    raster: tuple[Kind, ...] = ("raster",)
    points: tuple[Kind, ...] = ("mesh", "cloud")
    cloud: tuple[Kind, ...] = ("cloud",)
    for option, value, kinds in (
        ("--window", options.window, raster),
        ("--band", options.band, raster),
        ("--crs", options.crs, raster),
        ("--nodata", options.nodata, raster),
        ("--size", options.size, raster),
        ("--height-range", options.height_range, raster),
        ("--encoding", options.encoding, raster),
        ("--source-units", options.source_units, raster),
        ("--units", options.units, raster),
        ("--source-crs", options.source_crs, raster),
        ("--resolution", options.resolution, points),
        ("--up", options.up, points),
        ("--scale", None if options.scale == 1.0 else options.scale, points),
        ("--heights", options.heights, cloud),
        ("--ground", options.ground or None, cloud),
    ):
        if value is not None and kind not in kinds:
            raise RequestError(
                f"{option} is about {' and '.join(_KINDS[one] for one in kinds)}, but {name} is "
                f"read as a {kind}.",
                f"Leave out {option}, or write points as lines of x, y and z."
                if "cloud" in kinds and name.lower().endswith(TEXTS)
                else f"Leave out {option}.",
            )
    if options.bounds is not None:
        refuse_empty(options.bounds)
    _refuse_numbers(options)
    if name.lower().endswith((".json", ".json.gz")):
        raise ReadError(
            f"{name}: is a definition already.",
            "Name a DEM, a mesh or a cloud; export-dem makes a DEM of a definition.",
        )
    if is_folder(name):
        raise ReadError(f"{name}: is a folder.", "Name a file in it.")
    return kind


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
