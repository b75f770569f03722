"""What a definition is imported from: one way to open rasters and meshes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from terratool.errors import ReadError, RequestError
from terratool.field.terrain import Bounds, refuse_empty
from terratool.importing.samples import HeightSource

MESHES = (
    ".obj", ".stl", ".ply", ".glb", ".gltf", ".off", ".3mf", ".dxf", ".wrl", ".wrz",
)  # fmt: skip
"""Endings of the files that are read as meshes; all others are for GDAL."""

_OTHER_MESHES = (
    ".3ds", ".blend", ".dae", ".dwg", ".fbx", ".igs", ".sdf", ".step", ".stp", ".urdf", ".usd",
    ".usda", ".usdc", ".usdz", ".x3d",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """What to take from a source, and how.

    Attributes:
        bounds: west, south, east, north in the source's coordinates (those of `crs`, if given).
        window: column, row, width, height in pixels of a raster, from the north-west.
        band: of a raster, from 1.
        crs: reference system to reproject a raster to.
        nodata: a number that stands for none.
        resolution: side of a pixel, for a mesh.
        up: the axis of a mesh that points up, "y" or "z"; as its format has it, if None.
        scale: factor on the coordinates of a mesh.
    """

    bounds: Bounds | None = None
    window: tuple[int, int, int, int] | None = None
    band: int | None = None
    crs: str | None = None
    nodata: float | None = None
    resolution: float | None = None
    up: str | None = None
    scale: float = 1.0


def is_mesh(name: str) -> bool:
    """Whether a file is read as a mesh, by its name."""
    return name.lower().endswith(MESHES)


@contextlib.contextmanager
def open_source(name: str, options: SourceOptions = SourceOptions()) -> Iterator[HeightSource]:
    """Open a raster or a mesh as heights at the centres of pixels.

    Raises:
        ReadError: it cannot be read, or has no heights.
        RequestError: an option does not fit it.
    """
    refuse_odd(name, options)
    if is_mesh(name):
        from terratool.importing.sampling import read_mesh

        yield read_mesh(name, options.resolution, options.up, options.scale, options.bounds)
        return
    from terratool.importing.rasters import open_raster

    with open_raster(
        name,
        band=options.band,
        bounds=options.bounds,
        window=options.window,
        crs=options.crs,
        nodata=options.nodata,
    ) as heights:
        yield heights


def refuse_odd(name: str, options: SourceOptions) -> None:
    """Refuse options that are about the other kind of source, and what is neither.

    Raises:
        ReadError: it is a definition or a folder.
        RequestError: an option does not fit it or another one, or the bounds are empty.
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
    if name.lower().endswith((".json", ".json.gz")):
        raise ReadError(
            f"{name}: is a definition already.",
            "Name a DEM or a mesh; export-dem makes a DEM of a definition.",
        )
    if Path(name).is_dir():
        raise ReadError(f"{name}: is a folder.", "Name a file in it.")
