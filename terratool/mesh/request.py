"""A mesh as it is asked for: one file, many tiles, or a grid of heights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.mesh.elevation import ElevationGridReport, export_elevation_grid
from terratool.mesh.export import MeshOptions, MeshReport, check_request, export_mesh
from terratool.mesh.formats.table import mesh_format
from terratool.mesh.tiles import MeshTilesReport, TileCount, export_tiles

AnyMeshReport = MeshReport | MeshTilesReport | ElevationGridReport


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshRequest(MeshOptions):
    """Options of a mesh and of its files.

    Attributes:
        tile_faces: number of faces, about, of each tile of a mesh that is too large for one file;
            None for one file.
        dask: address of a Dask scheduler whose workers build the tiles, or "local"; None for none.
        elevation_grid: whether a .wrl has a grid of heights instead of faces; walls become ramps.
        resolution: distance between the nodes of such a grid, in units of the terrain; chosen if
            None.
    """

    tile_faces: int | None = None
    dask: str | None = None
    elevation_grid: bool = False
    resolution: float | None = None

    @property
    def has_storeys(self) -> bool:
        """Whether what is written has the decks and bores of a terrain."""
        return not self.elevation_grid and self.tile_faces is None

    def check_file(self, output: str | Path, overwrite: bool = False) -> None:
        """Refuse options that do not go together or with a file, before a terrain is read.

        Raises:
            RequestError: an option makes no sense, alone, with another one or with the format.
            WriteError: the file exists and is not to be overwritten, or its folder is missing.
        """
        output = Path(output)
        if self.resolution is not None and not self.elevation_grid:
            raise RequestError(
                "--resolution is about a grid of heights, but a mesh is asked for.",
                "Add --elevation-grid, or say --max-error instead.",
            )
        given = {
            "--max-error": self.max_error is not None,
            "--max-faces": self.max_faces is not None,
            "--solid": self.solid,
            "--base": self.base is not None,
            f"--origin {self.origin}": isinstance(self.origin, str) and self.origin != "local",
            "--origin-at": not isinstance(self.origin, str),
            "--tile-faces": self.tile_faces is not None,
            "--dask": self.dask is not None,
            "--no-normals": not self.normals,
        }
        for name in filter(given.get, given):
            if self.elevation_grid:
                raise RequestError(
                    f"{name} is about a mesh, but a grid of heights is asked for.",
                    f"Leave out {name} or --elevation-grid.",
                )
        if not self.normals and not mesh_format(output).normals:
            raise RequestError(
                f"{output}: has no normals anyway.",
                "Leave out --no-normals, which is about an .obj.",
            )
        if self.dask is not None and self.tile_faces is None:
            raise RequestError(
                "--dask is about tiles, but a single file is asked for.", "Add --tile-faces N."
            )
        self.check(tiles=self.tile_faces is not None)
        if self.tile_faces is None:
            check_request(output, overwrite, self.world)
        elif self.tile_faces < 1:
            raise RequestError(
                f"Tiles of {self.tile_faces} faces are asked for.", "Ask for 1 or more."
            )


def write_mesh_files(
    terrain: Terrain,
    output: str | Path,
    request: MeshRequest,
    *,
    overwrite: bool = False,
    progress: Callable[[str], object] = lambda _: None,
) -> AnyMeshReport:
    """Write a terrain as a mesh, as tiles of one, or as a grid of heights.

    Args:
        terrain: terrain to write; tiles and grids are of its ground alone.
        output: file to write, whose suffix names the format; tiles go into a folder that is called
            as the file is without its suffix.
        request: options of the mesh and of its files.
        overwrite: whether files may exist.
        progress: function that is called with a phrase at each step.

    Raises:
        RequestError: there is no ground, an option makes no sense, or the format cannot hold the
            mesh.
        WriteError: a file exists, or cannot be written.
    """
    output = Path(output)
    request.check_file(output, overwrite)
    if not request.has_storeys:
        terrain = terrain.ground_alone
    if request.elevation_grid:
        return export_elevation_grid(
            terrain, output, request.resolution, request.bounds, overwrite=overwrite
        )
    if request.tile_faces is None:
        return export_mesh(terrain, output, request, overwrite=overwrite, progress=progress)
    return export_tiles(
        terrain,
        output.with_suffix(""),
        output.suffix.lower(),
        request,
        TileCount(request.tile_faces),
        overwrite=overwrite,
        dask=request.dask,
        progress=lambda done, tiles, faces: progress(f"{done} of {tiles} tiles, {faces:,} faces"),
    )
