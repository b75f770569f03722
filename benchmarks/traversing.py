"""A traversability map against the heights of the same grid as `export-dem` writes them."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import terrains
from measure import line, medians

from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.raster.export import RasterRequest, export_dem
from terratool.raster.grid import grid_over
from terratool.text.source import Source
from terratool.traversability.assess import assess
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.request import Request
from terratool.traversability.vehicle import Axle, Vehicle, Wheel
from terratool.traversability.vehicle_files import load_vehicle

VEHICLE = Vehicle(
    Wheel(0.2, 0.15, 40.0),
    (Axle(0.35), Axle(-0.35)),
    mass=70.0,
    track_width=0.6,
    cog_height=0.25,
    clearance=0.15,
    body_width=0.5,
)
"""The size of a common research rover."""


VEHICLES = Path(__file__).parent.parent / "samples" / "vehicles"


def mapped(
    terrain: Terrain, request: Request, out: Path | None = None, vehicle: Vehicle = VEHICLE
) -> None:
    """Judge every pixel, and write the map if that is wanted."""
    prepared = prepare_assessment(terrain, vehicle, request, map_path=out, overwrite=True)
    assess(prepared, map_path=out, overwrite=True)


def slipping(pixels: int, runs: int) -> None:
    """Measure what it takes where slip counts, on the rougher terrain."""
    definition = terrains.s2()
    without = Terrain(check(Source("s2", terrains.text(definition))))
    for surface in definition["surfTypes"].values():
        surface["shearModulus"] = 0.02
    known = Terrain(check(Source("s2", terrains.text(definition))))
    request = Request(resolution=grid_over(known, 100 / pixels).resolution)
    seconds = medians(
        {"without": lambda: mapped(without, request), "with": lambda: mapped(known, request)}, runs
    )
    line(
        f"S2 {pixels}², 8 headings: with shear moduli against without",
        seconds["with"] / seconds["without"],
        "none",
    )


def sampled(pixels: int, runs: int) -> None:
    """Measure what ranges of a soil cost, on the rougher terrain, where slip counts."""
    definition = terrains.s2()
    for surface in definition["surfTypes"].values():
        surface["shearModulus"] = 0.02
    without = Terrain(check(Source("s2", terrains.text(definition))))
    for key, share in (("cohesion", 0.3), ("fricAngle", 0.1), ("sinkage", 0.3)):
        sand = definition["surfTypes"]["sand"]
        sand[key] = [sand[key] * (1 - share), sand[key] * (1 + share)]
    ranged = Terrain(check(Source("s2", terrains.text(definition))))
    resolution = grid_over(ranged, 100 / pixels).resolution
    seconds = medians(
        {
            "without": lambda: mapped(without, Request(resolution=resolution)),
            "64": lambda: mapped(ranged, Request(resolution=resolution, samples=64)),
            "256": lambda: mapped(ranged, Request(resolution=resolution)),
        },
        runs,
    )
    for samples in ("64", "256"):
        line(
            f"S2 {pixels}², 8 headings: {samples} samples of a soil with ranges against none",
            seconds[samples] / seconds["without"],
            "none",
        )


def geared(pixels: int, runs: int) -> None:
    """Measure what tracks and feet cost against wheels, on the rougher terrain."""
    terrain = Terrain(check(Source("s2", terrains.text(terrains.s2()))))
    request = Request(resolution=grid_over(terrain, 100 / pixels).resolution)
    kinds = {"wheels": "husky-a200", "tracks": "superdroid-hd2", "feet": "unitree-b2"}
    vehicles = {kind: load_vehicle(VEHICLES / f"{name}.json") for kind, name in kinds.items()}
    seconds = medians(
        {
            kind: lambda vehicle=vehicle: mapped(terrain, request, vehicle=vehicle)
            for kind, vehicle in vehicles.items()
        },
        runs,
    )
    for kind in ("tracks", "feet"):
        each = 1e6 * seconds[kind] / pixels**2
        line(
            f"S2 {pixels}², 8 headings: {kind} against wheels ({each:.1f} µs/pixel)",
            seconds[kind] / seconds["wheels"],
            "none",
        )


def compare(name: str, terrain: Terrain, pixels: int, folder: Path, runs: int) -> None:
    """Measure one terrain."""
    grid = grid_over(terrain, 100 / pixels)
    out, request = folder / "out.tif", RasterRequest(overwrite=True, losses=False)
    seconds = medians(
        {
            "heights": lambda: export_dem(terrain, grid, out, request),
            "map": lambda: mapped(terrain, Request(resolution=grid.resolution), out),
            "one": lambda: mapped(terrain, Request(resolution=grid.resolution, threads=1)),
            "two": lambda: mapped(terrain, Request(resolution=grid.resolution, threads=2)),
        },
        runs,
    )
    speed = pixels * pixels / seconds["map"] / 1e6
    label = f"{name.upper()} {pixels}², 8 headings: "
    line(
        f"{label}against heights ({speed:.2f} Mpixel/s)",
        seconds["map"] / seconds["heights"],
        "none",
    )
    line(f"{label}two threads", seconds["one"] / seconds["two"], "none")


if __name__ == "__main__":
    size, runs = (512, 1) if "--quick" in sys.argv else (2048, 3)
    with tempfile.TemporaryDirectory() as folder:
        for name in ("s1", "s2"):
            definition = check(Source(name, terrains.text(getattr(terrains, name)()))).definition
            compare(name, Terrain(definition), size, Path(folder), runs)
        slipping(size, runs)
        sampled(size, runs)
        geared(size, runs)
