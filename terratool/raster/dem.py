"""A terrain as a DEM: pixels chosen, options checked, written into files or held in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.transform import Affine

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.extras import install_command
from terratool.field.terrain import Terrain
from terratool.io.bands import Bands
from terratool.output import refuse_existing
from terratool.processes import memory_bytes
from terratool.raster.contour_files import (
    ContourReport,
    ContourRequest,
    check_contours,
    export_contours,
)
from terratool.raster.export import (
    Progress,
    RasterReport,
    RasterRequest,
    export_dem,
)
from terratool.raster.geotiff import crs_of, transform_of
from terratool.raster.grid import (
    DEFAULT_PIXELS,
    Grid,
    default_resolution,
    grid_over,
    overhang,
    resolution_within,
)
from terratool.raster.layers import layers_named
from terratool.raster.mosaic import TILE_SIZE, export_mosaic
from terratool.raster.tiles import INDEX
from terratool.raster.windows import WindowMaker, windows_of
from terratool.report.wording import join_words
from terratool.tasks import prefetch, thread_count

if TYPE_CHECKING:
    import xarray

HEIGHT = "height"
"""Layer and band of heights."""
CONTOURS = "contours"
"""Layer that is lines, and no pixels."""
AnyDemReport = RasterReport | ContourReport

_OF_RASTERS = (
    "dtype", "compress", "max_error", "nodata", "cog", "overviews", "tiles", "tile_size", "dask",
    "threads", "losses",
)  # fmt: skip
"""Options that lines have no use for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DemOptions(RasterRequest):
    """Options of a DEM: its pixels, its layers and its files.

    Attributes:
        resolution: side of a pixel, in units of the terrain; chosen by the finest detail if None.
        bounds: world rectangle west, south, east, north; the whole terrain if None.
        cog: whether the file is a cloud-optimised GeoTIFF.
        tiles: folder of the GeoTIFFs of a mosaic; None for a single file.
        tile_size: side of a tile, pixels; 4096 if None.
        dask: address of a Dask scheduler whose workers make the tiles, or "local"; None for none.
        interval: height from one contour to the next, where the layer is "contours", which are
            lines; a round one that gives about eight if None.
    """

    resolution: float | None = None
    bounds: Bounds | None = None
    cog: bool = False
    tiles: str | Path | None = None
    tile_size: int | None = None
    dask: str | None = None
    interval: float | None = None

    @property
    def traced(self) -> bool:
        """Whether lines are wanted, and no pixels."""
        return CONTOURS in self.layers

    def check(self) -> None:
        """Refuse options that do not go together, before a terrain is read.

        Raises:
            RequestError: an option makes no sense, alone or with another one.
        """
        _ = self.compression  # refuses a name or an error that makes no sense
        if self.traced and {*self.layers} != {CONTOURS}:
            raise RequestError(
                "Contours are lines, the other layers are pixels: one file cannot hold both.",
                "Write them one after the other.",
            )
        if self.interval is not None and not self.traced:
            raise RequestError("--interval is about contours.", "Add --layer contours.")
        if self.tiles is None:
            for name, value in (("--dask", self.dask), ("--tile-size", self.tile_size)):
                if value is not None:
                    raise RequestError(
                        f"{name} is about tiles, but a single file is asked for.",
                        "Add --tiles DIR.",
                    )
        elif self.tiles == "":
            raise RequestError("The name of the folder for --tiles is empty.", "Give one.")
        elif self.cog:
            raise RequestError(
                "The tiles of a mosaic are plain GeoTIFFs, not cloud-optimised ones.",
                "Leave out --cog or --tiles.",
            )
        elif self.overviews:
            raise RequestError(
                "The tiles of a mosaic have no overviews.",
                "Leave out --overviews, and add them to the index with gdaladdo -ro.",
            )

    def output_of(self, output: str | Path | None) -> Path:
        """Path of the file, which the options name by their tiles alone where `output` is None.

        Raises:
            RequestError: an option makes no sense, or nothing names the file.
            WriteError: the file exists, and is not to be overwritten.
        """
        self.check()
        if output is None:
            if self.tiles is None:
                raise RequestError("No file is named.", "Name one, or a folder by --tiles DIR.")
            output = Path(self.tiles, INDEX)
        if self.traced:
            check_contours(Path(output), self.interval, self.overwrite)
        elif self.tiles is None:
            refuse_existing(Path(output), self.overwrite)
        return Path(output)


def refuse_idle(given: Set[str], layers: Sequence[str]) -> None:
    """Refuse options that would have no effect on contours.

    Args:
        given: names of the options that the user gave.
        layers: names of the layers.

    Raises:
        RequestError: an option is idle.
    """
    for name in _OF_RASTERS:
        if name in given and {*layers} == {CONTOURS}:
            option = f"--{name.replace('_', '-')}"
            raise RequestError(f"{option} is about rasters.", f"Leave out {option}.")


@dataclass(frozen=True, slots=True)
class GridChoice:
    """Pixels over a terrain, and how they were chosen.

    Attributes:
        grid: the pixels.
        why: phrase on who chose the resolution.
        overhang: distances by which pixels reach over the east and the north side of the bounds.
    """

    grid: Grid
    why: str
    overhang: tuple[float, float]

    @classmethod
    def of(
        cls, terrain: Terrain, resolution: float | None = None, bounds: Bounds | None = None
    ) -> GridChoice:
        """Pixels over a terrain or a part of it, as fine as its finest detail if nothing is said.

        Raises:
            RequestError: the resolution or the bounds make no sense for the terrain.
        """
        why = "as asked"
        if resolution is None:
            resolution, why = default_resolution(terrain, bounds)
        grid = grid_over(terrain, resolution, bounds)
        return cls(grid, why, overhang(grid, bounds or terrain.bounds))

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return self.grid.width * self.grid.height

    def sentences(self) -> Iterator[str]:
        """Yield sentences on the ends of the last pixels, if not at the sides."""
        for side, over in zip(("east", "north"), self.overhang, strict=True):
            if over:
                where = "before" if over < 0 else "beyond"
                yield f"The last pixels end {abs(over):.4g} {where} the {side} side."


def write_dem(
    terrain: Terrain,
    choice: GridChoice,
    output: str | Path,
    options: DemOptions,
    progress: Progress | None = None,
    say: Callable[[str], object] = lambda _: None,
) -> AnyDemReport:
    """Write layers of a terrain: a file for each kind, a mosaic of tiles, or contours.

    Args:
        terrain: terrain to be written.
        choice: its pixels.
        output: file to write, from `DemOptions.output_of`; its suffix names the format.
        options: layers and options.
        progress: called with the number of pixels done since its last call; not for contours.
        say: called with words on each step of contours.

    Raises:
        RequestError: options conflict with each other or with the format.
        WriteError: a file exists, cannot be written or does not fit on the disk.
        DefinitionError: the CRS of the terrain is unknown.
    """
    if options.traced:
        request = ContourRequest(
            choice.grid.resolution, options.bounds, options.interval, options.overwrite
        )
        return export_contours(terrain, output, request, say)
    if options.tiles is None:
        return export_dem(terrain, choice.grid, output, options, cog=options.cog, progress=progress)
    size = TILE_SIZE if options.tile_size is None else options.tile_size
    return export_mosaic(
        terrain, choice.grid, options.tiles, output, options,
        tile_size=size, dask=options.dask, progress=progress,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class DemArrays:
    """DEM in memory: an array for each band, its place and its reference system.

    NumPy takes it for the array of its heights, or of its only band.

    Attributes:
        bands: (rows, columns) array of each band by its name, in the order of the layers that were
            asked for, row 0 in the north: float32 or float64 with NaN for none; for "surface"
            numbers of surfaces, 0 for none.
        transform: affine transform from column and row of a pixel's corner to world x and y.
        crs: coordinate reference system; None without one.
        resolution: side of a pixel, in units of the terrain.
        units: unit of each band, by name; empty for none.
        surfaces: names of the surfaces; the pixels of "surface" have 1 for the first of them.
    """

    bands: Mapping[str, NDArray[Any]]
    transform: Affine
    crs: CRS | None
    resolution: float
    units: Mapping[str, str] = field(default_factory=dict)
    surfaces: tuple[str, ...] = ()

    @property
    def array(self) -> NDArray[Any]:
        """Array of the heights, or of the only band, (rows, columns), row 0 in the north.

        Raises:
            RequestError: there are several bands, and none has heights.
        """
        if len(self.bands) > 1:
            return self.heights
        return next(iter(self.bands.values()))

    @property
    def heights(self) -> NDArray[Any]:
        """Array of the heights, (rows, columns), row 0 in the north.

        Raises:
            RequestError: no band has heights.
        """
        if HEIGHT not in self.bands:
            raise RequestError(
                f"The DEM has no heights, but {join_words(list(self.bands))}.",
                'Add "height" to its layers, or take a band by its name.',
            )
        return self.bands[HEIGHT]

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns."""
        rows, columns = next(iter(self.bands.values())).shape
        return rows, columns

    @property
    def x(self) -> NDArray[np.float64]:
        """World x of the pixels' centres, (columns,) float64, from west to east."""
        return np.asarray(self.transform.c + (np.arange(self.shape[1]) + 0.5) * self.transform.a)

    @property
    def y(self) -> NDArray[np.float64]:
        """World y of the pixels' centres, (rows,) float64, from north to south."""
        return np.asarray(self.transform.f + (np.arange(self.shape[0]) + 0.5) * self.transform.e)

    def __getitem__(self, band: str) -> NDArray[Any]:
        """Array of a band by its name.

        Raises:
            RequestError: there is no such band.
        """
        if not isinstance(band, str) or band not in self.bands:
            raise RequestError(
                f"The DEM has no band {band!r}, but {join_words(list(self.bands))}.",
                "Name one of these, or ask for it among the layers.",
            )
        return self.bands[band]

    def __array__(
        self, dtype: np.dtype[Any] | None = None, copy: bool | None = None
    ) -> NDArray[Any]:
        if copy:
            return np.array(self.array, dtype)
        return np.asarray(self.array, dtype)

    def to_xarray(self) -> xarray.DataArray:
        """DataArray of xarray with x, y and, of several bands, band as coordinates.

        The reference system stands in the coordinate spatial_ref, where rioxarray looks for it.

        Raises:
            RequestError: xarray is not installed.
        """
        try:
            import xarray
        except ImportError as error:
            raise RequestError(
                "xarray is not installed.", f"Install it: {install_command('xarray')}"
            ) from error
        names = list(self.bands)
        place = {"GeoTransform": " ".join(f"{one!r}" for one in self.transform.to_gdal())}
        if self.crs is not None:
            place["crs_wkt"] = place["spatial_ref"] = self.crs.to_wkt()
        coords: dict[str, Any] = {"y": self.y, "x": self.x, "spatial_ref": ((), 0, place)}
        if len(names) == 1:
            unit = self.units.get(names[0], "")
            attributes = {"units": unit} if unit else {}
            attributes["grid_mapping"] = "spatial_ref"
            return xarray.DataArray(self.array, coords, ("y", "x"), names[0], attributes)
        coords["band"] = names
        stacked = np.stack(list(self.bands.values()))
        return xarray.DataArray(
            stacked, coords, ("band", "y", "x"), "terrain", {"grid_mapping": "spatial_ref"}
        )


def _empty_arrays(grid: Grid, files: Sequence[Bands]) -> list[NDArray[Any]]:
    """Arrays (bands, rows, columns) of each file, to be painted.

    Raises:
        RequestError: they do not fit into the memory of the machine.
    """
    needed = grid.width * grid.height * sum(bands.pixel_bytes for bands in files)
    try:
        if needed > memory_bytes():
            raise MemoryError
        return [np.empty((bands.count, grid.height, grid.width), bands.dtype) for bands in files]
    except MemoryError:
        west, south, east, north = grid.bounds
        enough, _ = resolution_within(east - west, north - south, DEFAULT_PIXELS)
        raise RequestError(
            f"{grid.width:,} × {grid.height:,} pixels take {needed:,} bytes, which do not fit into "
            "memory.",
            f"Give a coarser --resolution, such as {enough:.4g}, or smaller --bounds; a file takes "
            "as many as there is space for.",
        ) from None


def dem_arrays(terrain: Terrain, choice: GridChoice, request: RasterRequest) -> DemArrays:
    """Paint layers of a terrain into memory; the pixels are those that `write_dem` writes.

    Args:
        terrain: terrain to be painted.
        choice: its pixels.
        request: names of the layers, their data type and the number of threads.

    Raises:
        RequestError: a layer or the data type is unknown, a value exceeds the type, or the pixels
            do not fit into memory.
        DefinitionError: the CRS of the terrain is unknown.
    """
    grid = choice.grid
    files, threads = request.files(terrain, grid), thread_count(request.threads)
    crs = crs_of(terrain)
    found = _empty_arrays(grid, files)
    maker = WindowMaker(terrain, grid, files)
    for made in prefetch(maker.make, windows_of(grid.whole, files), threads):
        window = made.window
        rows = slice(window.row, window.row + window.height)
        columns = slice(window.column, window.column + window.width)
        for whole, pixels in zip(found, made.buffer.pixels, strict=True):
            whole[:, rows, columns] = pixels
        maker.reuse(made)
    arrays: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    for file, pixels in zip(files, found, strict=True):
        arrays.update(zip(file.names, pixels, strict=True))
        units.update(zip(file.names, file.units, strict=True))
    layers = {layer.name: layer for file in files for layer in file.layers}
    asked = [name for one in layers_named(request.layers) for name in layers[one.name].bands]
    bands = {name: arrays[name] for name in asked}
    has_surfaces = any(file.content == "surface" for file in files)
    names = terrain.surfaces if has_surfaces else ()
    return DemArrays(bands, transform_of(grid), crs, grid.resolution, units, names)
