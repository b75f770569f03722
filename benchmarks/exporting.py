"""`export-dem` end to end: against rasterio writing the ready array, and against interpolation."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import rasterio
import terrains
from dems import ready, write_ready
from measure import line, medians
from rasterio.enums import Resampling
from scipy.interpolate import RegularGridInterpolator

from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.raster.export import RasterRequest, export_dem
from terratool.raster.geotiff import transform_of
from terratool.raster.grid import Grid, Window, grid_over
from terratool.raster.overviews import factors
from terratool.tasks import processors
from terratool.text.source import Source

OVERWRITE = RasterRequest(overviews=False, overwrite=True)


def write_overviews(heights: np.ndarray, grid: Grid, path: Path) -> None:
    """The same with overviews."""
    write_ready(heights, grid, path)
    with (
        rasterio.Env(GDAL_NUM_THREADS="ALL_CPUS", GDAL_TIFF_OVR_BLOCKSIZE="512"),
        rasterio.open(path, "r+") as file,
    ):
        file.build_overviews(factors(file.width, file.height), Resampling.average)


def compare(name: str, terrain: Terrain, pixels: int, folder: Path, runs: int) -> None:
    """Measure one terrain."""
    grid = grid_over(terrain, 100 / pixels)
    heights = ready(terrain, grid)
    out = folder / "out.tif"
    seconds = medians(
        {
            "ready": lambda: write_ready(heights, grid, folder / "ready.tif"),
            "windows": lambda: write_ready(heights, grid, folder / "ready.tif", windows=True),
            "export": lambda: export_dem(terrain, grid, out, replace(OVERWRITE, losses=False)),
            "losses": lambda: export_dem(terrain, grid, out, OVERWRITE),
            "overviews": lambda: export_dem(
                terrain, grid, out, replace(OVERWRITE, losses=False, overviews=True)
            ),
            "ready overviews": lambda: write_overviews(heights, grid, folder / "ready.tif"),
        },
        runs,
    )
    label = f"{name.upper()} {pixels}²: "
    target = "<= 1.15" if pixels == 16384 else "none"
    speed = 4e-6 * pixels**2 / seconds["export"]
    line(f"{label}export against the ready array ({speed:.0f} MB/s)",
         seconds["export"] / seconds["ready"], target)  # fmt: skip
    line(f"{label}with the statement of losses", seconds["losses"] / seconds["ready"], target)
    line(f"{label}with overviews, against rasterio's with overviews",
         seconds["overviews"] / seconds["ready overviews"], target)  # fmt: skip
    line(f"{label}export against the ready array in windows",
         seconds["export"] / seconds["windows"], "none")  # fmt: skip


_READY = """
import sys, numpy, rasterio
heights = numpy.load(sys.argv[1])
with rasterio.open(
    sys.argv[2], "w", driver="GTiff", dtype="float32", count=1, nodata=numpy.nan,
    width=heights.shape[1], height=heights.shape[0],
    transform=rasterio.Affine(*map(float, sys.argv[4:])),
    compress="zstd", zstd_level=1, predictor=3, tiled=True, blockxsize=512, blockysize=512,
    bigtiff="if_safer", num_threads=sys.argv[3],
) as file:
    file.write(heights, 1)
"""


def whole_processes(name: str, text: bytes, terrain: Terrain, pixels: int, folder: Path) -> None:
    """As a user has it, from start to end: the command, and a script that loads the array."""
    grid = grid_over(terrain, 100 / pixels)
    np.save(folder / "ready.npy", ready(terrain, grid))
    (folder / "terrain.json").write_bytes(text)
    script = [
        sys.executable, "-c", _READY, folder / "ready.npy", folder / "ready.tif",
        str(processors()), *map(str, transform_of(grid)[:6]),
    ]  # fmt: skip
    command = [
        sys.executable, "-m", "terratool", "export-dem", folder / "terrain.json",
        folder / "out.tif", "--resolution", str(100 / pixels), "--overwrite", "--no-overviews",
    ]  # fmt: skip
    quiet = {"check": True, "capture_output": True}
    seconds = medians(
        {
            "ready": lambda: subprocess.run(script, **quiet),
            "export": lambda: subprocess.run([*command, "--no-losses"], **quiet),
            "losses": lambda: subprocess.run(command, **quiet),
        },
        3,
    )
    label = f"{name.upper()} {pixels}², whole processes: "
    line(f"{label}export-dem against rasterio", seconds["export"] / seconds["ready"], "<= 1.15")
    line(f"{label}with the statement of losses", seconds["losses"] / seconds["ready"], "<= 1.15")


_POINTS = """<OGRVRTDataSource><OGRVRTLayer name="points">
<SrcDataSource>{points}</SrcDataSource><GeometryType>wkbPoint25D</GeometryType>
<GeometryField encoding="PointFromColumns" x="x" y="y" z="z"/>
</OGRVRTLayer></OGRVRTDataSource>"""


def interpolate(terrain: Terrain, folder: Path, pixels: int) -> None:
    """Against making the same pixels from heights that are known at an eighth of the resolution."""
    grid, coarse = grid_over(terrain, 100 / pixels), grid_over(terrain, 800 / pixels)
    known = ready(terrain, coarse)[::-1]
    window, every = Window(0, 0, pixels, pixels), Window(0, 0, pixels // 8, pixels // 8)
    x, y = coarse.columns(every), coarse.rows(every)[::-1]
    wanted = np.meshgrid(grid.rows(window), grid.columns(window), indexing="ij")
    points = folder / "points.csv"
    at_x, at_y = np.meshgrid(x, y)
    rows = np.column_stack([at_x.ravel(), at_y.ravel(), known.ravel()])
    np.savetxt(points, rows, fmt="%.9g", delimiter=",", header="x,y,z", comments="")
    layer = folder / "points.vrt"
    layer.write_text(_POINTS.format(points=points))
    command = [
        "gdal_grid", "-q", "-a", "linear", "-ot", "Float32", "-l", "points",
        "-outsize", str(pixels), str(pixels), "-txe", "0", "100", "-tye", "0", "100",
        layer, folder / "grid.tif",
    ]  # fmt: skip
    spline = RegularGridInterpolator((y, x), known, bounds_error=False, fill_value=None)
    tasks = {
        "export": lambda: export_dem(terrain, grid, folder / "out.tif", OVERWRITE),
        "scipy": lambda: spline((wanted[0], wanted[1])),
    }
    if shutil.which("gdal_grid"):
        tasks["gdal_grid"] = lambda: subprocess.run(command, check=True)
    seconds = medians(tasks, 3)
    for other in list(seconds)[1:]:
        line(f"S2 {pixels}²: {other} from {pixels // 8}² points, against export-dem",
             seconds[other] / seconds["export"], "none")  # fmt: skip


_PEAK = """
import sys
from terratool.field.terrain import load
from terratool.raster.export import RasterRequest, export_dem
from terratool.raster.grid import grid_over
terrain = load(sys.argv[1])
grid = grid_over(terrain, 100 / int(sys.argv[3]))
export_dem(terrain, grid, sys.argv[2], RasterRequest(overviews=False, overwrite=True))
# not getrusage, which begins with the peak of the parent
print(*(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""


def peak(definition: Path, out: Path, pixels: int) -> float:
    """Peak of resident memory of an export, in MB."""
    done = subprocess.run(
        [sys.executable, "-c", _PEAK, definition, out, str(pixels)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return int(done.stdout) * 1024 / 1e6


def main() -> None:
    quick = "--quick" in sys.argv
    sizes = (1024,) if quick else (4096, 16384)
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name:
        folder = Path(name)
        for terrain_name in ("s1", "s2", "s3"):
            text = terrains.text(getattr(terrains, terrain_name)())
            definition = check(Source(terrain_name, text)).definition
            assert definition is not None
            terrain = Terrain(definition)
            for pixels in sizes:
                compare(terrain_name, terrain, pixels, folder, runs=3 if pixels > 9000 else 7)
            whole_processes(terrain_name, text, terrain, sizes[-1], folder)
            if terrain_name == "s2":
                interpolate(terrain, folder, 512 if quick else 2048)
        if not Path("/proc/self/status").exists():
            print("memory: not measured, as this system has no /proc")
            return
        (folder / "s2.json").write_bytes(terrains.text(terrains.s2()))
        peaks = [peak(folder / "s2.json", folder / "out.tif", pixels) for pixels in
                 ((512, 1024) if quick else (4096, 32768))]  # fmt: skip
        label = "S2: peak of memory" + ("" if quick else " at 32768² against 4096²")
        line(f"{label} ({peaks[0]:.0f} and {peaks[1]:.0f} MB)", peaks[1] / peaks[0], "<= 1.5")


if __name__ == "__main__":
    main()
