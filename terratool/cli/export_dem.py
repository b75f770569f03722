"""`terratool export-dem`."""

from __future__ import annotations

import json
import math
from dataclasses import asdict

import click


@click.command(
    "export-dem",
    epilog="Example: terratool export-dem samples/paper-example.json out.tif --resolution 0.1",
)
@click.argument("file")
@click.argument("output")
@click.option("--resolution", type=float, metavar="R", help="Side of a pixel.")
@click.option("--bounds", nargs=4, type=float, metavar="W S E N", help="World rectangle to write.")
@click.option("--overwrite", is_flag=True, help="Replace OUTPUT if it exists.")
@click.option("--json", "as_json", is_flag=True, help="Say what was written as JSON.")
def command(
    file: str,
    output: str,
    resolution: float | None,
    bounds: tuple[float, float, float, float] | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write the heights of FILE as a GeoTIFF.

    Float32 heights at the pixel centres, north up, NaN where there is no ground. Without
    --resolution a pixel is a tenth of the smallest cell, but the longer side has at most 4096.
    """
    from pathlib import Path

    from terratool.errors import WriteError
    from terratool.field.terrain import load
    from terratool.output import refuse_existing
    from terratool.raster.geotiff import write_geotiff
    from terratool.raster.grid import default_resolution, grid_over

    refuse_existing(Path(output), overwrite)
    if Path(output).exists() and Path(file).exists() and Path(output).samefile(file):
        raise WriteError(f"{output}: is the definition itself.", "Choose another name.")
    terrain = load(file)
    why = "as asked"
    if resolution is None:
        resolution, why = default_resolution(terrain)
    grid = grid_over(terrain, resolution, bounds)
    written = write_geotiff(terrain, grid, output, overwrite)
    if as_json:
        report = {
            "format_version": 1,
            "file": output,
            "width": grid.width,
            "height": grid.height,
            "resolution": resolution,
            "resolution_chosen": why,
            "bounds": list(grid.bounds),
            **{k: None if v != v else v for k, v in asdict(written).items()},
        }
        click.echo(json.dumps(report, indent=2, ensure_ascii=False))
        return
    heights = "no heights"
    if not math.isnan(written.low):
        heights = f"heights {written.low:.6g} to {written.high:.6g}"
    click.echo(
        f"{output}: {grid.width} × {grid.height} pixels of {resolution:g} ({why}), {heights}, "
        f"{written.nodata:,} of {written.pixels:,} pixels without a height"
    )
