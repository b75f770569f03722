"""Surveys drawn by hand: what a vehicle is said to be able to do, cell by cell."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid
from terratool.traversability.limits import wheel_layout
from terratool.traversability.map_results import Survey
from terratool.traversability.parameters import vehicle_params
from terratool.traversability.route.graph import ALLOWED, BACKING, Costs, Turns
from terratool.traversability.survey import Stance, Verdicts
from terratool.traversability.vehicle import Axle, Overhang, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict
from tests.conftest import terrain_of

ROVER = Vehicle(
    Wheel(0.1, 0.06),
    (Axle(0.3), Axle(-0.3)),
    mass=20.0,
    gravity=10.0,
    track_width=0.5,
    clearance=0.12,
    body_width=0.5,
    front=Overhang(0.15, 0.2),
    rear=Overhang(0.1, 0.2),
    speed=0.5,
    power=3.0,
)

SIGNS = {
    ".": (Verdict.GO, Reason.NONE),
    "c": (Verdict.CAUTION, Reason.SLIP),
    "#": (Verdict.NO_GO, Reason.STEP),
    "~": (Verdict.NO_GO, Reason.TRACTION),
    "e": (Verdict.NO_GO, Reason.EDGE),
    "?": (Verdict.UNKNOWN, Reason.SOIL_UNKNOWN),
    " ": (Verdict.NO_GO, Reason.NO_GROUND),
}


def level(width: float, height: float, origin: tuple[float, float] = (0.0, 0.0)) -> Terrain:
    """Level ground of one surface."""
    return terrain_of(
        {
            "size": [width, height],
            "origin": list(origin),
            "surfTypes": {"floor": {"cohesion": 0, "fricAngle": 35, "sinkage": 0}},
            "elemTypes": {"flat": {"x": "flat"}},
            "elemTree": {"type": "flat", "vScale": 0, "surface": "floor"},
        }
    )


def drawn(
    picture: str,
    *,
    resolution: float = 1.0,
    headings: int = 8,
    origin: tuple[float, float] = (0.0, 0.0),
    heights: NDArray[Any] | None = None,
    **planes: Any,
) -> Survey:
    """A survey as a picture shows it, the north above, alike for all headings.

    Planes of numbers are given by name: what broadcasts to (headings, height, width).
    """
    lines = [line for line in picture.split("\n") if line.strip("\t")]
    shape = (headings, len(lines), len(lines[0]))
    signs = np.array([[SIGNS[sign] for sign in line] for line in lines], np.uint8)
    if heights is None:
        heights = np.where(signs[..., 1] == Reason.NO_GROUND, np.nan, 0.0)
    given: dict[str, Any] = {
        "utilisation": np.array([np.nan, 0.5, 0.9, 2.0])[signs[..., 0]],
        "pitch": 0.0,
        "roll": 0.0,
        "sinkage": 0.0,
        "slip": 0.0,
        "energy": 10.0,
        "crab": 0.0,
        "reserve": 0.8,
    } | planes
    grid = Grid(*origin, resolution, *shape[1:])
    return Survey(
        grid,
        heights.astype(np.float32),
        np.ones(shape[1:], np.uint8),
        np.broadcast_to(signs[..., 0], shape).copy(),
        np.broadcast_to(signs[..., 1], shape).copy(),
        **{
            name: np.broadcast_to(np.asarray(plane, np.float32), shape).copy()
            for name, plane in given.items()
        },
    )


def level_costs(height: int, width: int, headings: int = 8) -> Costs:
    """What moves cost on level ground of cells of a metre, all of which can be driven."""
    shape = (headings, height, width)
    return Costs.of(
        np.ones(shape, np.float32), np.full(shape, ALLOWED | BACKING, np.uint8),
        np.zeros(shape[1:], np.float32), 1.0, Turns(0.1), 1.0,
    )  # fmt: skip


def barred(
    survey: Survey, headings: list[int], cells: Any, reason: Reason = Reason.TRACTION
) -> Survey:
    """The survey with some headings made no-go at cells (an index of rows and columns)."""
    for heading in headings:
        survey.verdict[heading][cells] = Verdict.NO_GO
        survey.reason[heading][cells] = reason
        survey.utilisation[heading][cells] = 2.0
    return survey


def judged(
    vehicle: Vehicle,
    soils: Any,
    slopes: NDArray[np.float64],
    ids: list[int],
    ruts: list[tuple[float, float, float]] | None = None,
) -> NDArray[np.float32]:
    """The numbers of a vehicle on plane slopes, (kernels.PLANES, n).

    Args:
        vehicle: heads north.
        soils: by id, and the steps on them, as of `soil_table`.
        slopes: (n, 2) tangents along and across.
        ids: of the soil under each wheel.
        ruts: depth of the first pass, passes and exponent of the rut under each wheel.
    """
    shape = (1, len(slopes))
    flat = np.zeros(shape, np.float32)
    along, across = slopes.astype(np.float32).T

    def under(wheels: Any, dtype: Any) -> NDArray[Any]:
        return np.array(wheels, dtype)[:, None, None].repeat(shape[1], axis=2)

    pressed = (
        (None,) * 3 if ruts is None else (under(of, np.float32) for of in zip(*ruts, strict=True))
    )
    wheels = np.array([[wheel, 0, 0] for wheel in range(len(wheel_layout(vehicle).x))])
    stance = Stance(
        np.stack([flat, -across[None], along[None]]), flat, flat, flat, flat, flat, flat,
        np.zeros(shape, np.bool_), under(ids, np.uint8), *pressed, 0, wheels,
    )  # fmt: skip
    out = Verdicts(*np.empty((3, *shape), np.uint8), np.empty((kernels.PLANES, *shape), np.float32))
    on_soils = kernels.VehicleOnSoils(vehicle_params(vehicle), *soils)
    kernels.judge_cells(on_soils, stance, 0.0, 1.0, out)
    return out.numbers[:, 0]


def stood(terrain: Terrain, vehicle: Vehicle, grid: Grid, step: float) -> Survey:
    """A crude survey of a terrain: where within its rectangle heights differ by more than `step`.

    It knows the edge, missing ground and shape, and nothing of soil.
    """
    front, rear, side = vehicle.rectangle
    x, y = np.meshgrid(grid.columns(grid.whole), grid.rows(grid.whole))
    heights = terrain.height(x, y)
    survey = drawn(("." * grid.width + "\n") * grid.height, resolution=grid.resolution,
                   origin=(grid.west, grid.south), heights=heights)  # fmt: skip
    west, south, east, north = terrain.bounds
    for heading in range(8):
        sine, cosine = np.sin(heading * np.pi / 4), np.cos(heading * np.pi / 4)
        low, high = heights.copy(), heights.copy()
        edge = np.zeros(x.shape, np.bool_)
        for along in np.linspace(-rear, front, 9):
            for across in np.linspace(-side, side, 7):
                px = x + along * sine + across * cosine
                py = y + along * cosine - across * sine
                edge |= (px < west) | (px > east) | (py < south) | (py > north)
                z = terrain.height(px, py)
                low, high = np.minimum(low, z), np.maximum(high, z)
        with np.errstate(invalid="ignore"):
            barred(survey, [heading], np.abs(high - low) > step, Reason.STEP)
        barred(survey, [heading], np.isnan(low) & ~edge, Reason.NO_GROUND)
        barred(survey, [heading], edge, Reason.EDGE)
    survey.surfaces[:] = terrain.sample(x, y).surface + 1
    return survey
