"""Reports made by hand: every kind of result, names that markup dislikes, odd numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from terratool.raster.grid import Grid
from terratool.traversability.figures import Figures, LoadSpan, SlipCurve
from terratool.traversability.map_results import MapSummary, Preview
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.results import (
    Barrier,
    ChargeUse,
    Extreme,
    Location,
    Reach,
    Route,
    RouteProfile,
)
from terratool.traversability.vehicle import Axle, Battery, Load, Overhang, Vehicle, Wheel
from terratool.traversability.verdicts import GroundClass, Reason, Verdict

NASTY = '<b>"& | `x` *y* _z_ [a](b) \\'
LONG = "a very long name of a surface, which no table for a terminal could ever show " * 2

ROVER = Vehicle(
    Wheel(0.125, 0.1, 8.0, 0.8),
    (
        Axle(0.3),
        Axle(0.0, driven=False, wheel=Wheel(0.11, 0.05, 8.0, 0.8, patch_pressure=95e3)),
        Axle(-0.3, wheel=Wheel(0.125, 0.1, 5.0, 0.8, 0.02, 0.12)),
    ),
    25.0,
    3.71,
    track_width=0.6,
    cog_height=0.2,
    clearance=0.15,
    body_width=0.5,
    front=Overhang(0.2, 0.2),
    speed=0.05,
    power=12.0,
    name="rover",
)

GRID = Grid(100.0, 200.0, 0.5, 30, 80)
"""Oblong, away from 0."""


def place(x: float = 110.5, y: float = 210.25, surface: str = "sand", **more: Any) -> Location:
    return Location(x, y, more.get("height", 1.25), surface, more.get("element", "/elemTree"))


_SLOPES = tuple(math.radians(angle) for angle in (-10, -5, 0, 5, 10, 15, 17.3, 18, 19))
SLIPS = SlipCurve(_SLOPES, (math.nan, 0.0, 0.21, 0.25, 0.3, 0.45, 0.6, 0.7, math.nan))
SAND = Figures(
    "sand", "dry-sand", (), 23.2, 1040.0, math.radians(28), 1.8e-4, 0.025, 0.00417, 0.0453,
    0.00453, 5120.0, 9800.0, 5400.0, 0.31, None, None, 2.2, 12.3, 4.1, 8.2,
    0.61, 0.27, 0.21, math.radians(17.3), Reason.TRACTION, math.radians(21.0), Reason.SIDE_SLIP,
    0.031, "torque", 1, 0.11, Verdict.GO, Reason.SLIP,
    ("z/D is above 0.15, where the model's accuracy ends.",), slip_curve=SLIPS, turning=7.4,
    turning_work=31.5, turning_slip=0.55,
)  # fmt: skip
ROCK = Figures(
    "rock", "", (), 23.2, 0.0, math.radians(35), 0.0, None, 0.0, None, None, None, None, None,
    None, None, None, 2.6, 16.2, 0.0, 16.2, 0.0, 0.0, None, math.radians(35), Reason.TRACTION,
    math.radians(56.3), Reason.TIP_OVER, 0.052, "friction", 1, 0.2, Verdict.GO, Reason.NONE,
    turning=9.1, turning_binding=Reason.TORQUE,
)  # fmt: skip
BOG = Figures(
    LONG, "", (), 23.2, 100.0, 0.01, 0.01, None, 0.232, 0.1, 0.01, 2000.0, math.inf, 0.0, 1.5,
    None, None, 0.0, 0.0, 9.0, -9.0, 4.0, math.inf, math.nan, None, Reason.SINKAGE, None,
    Reason.SINKAGE, 0.0, "sinkage", None, 0.0, Verdict.NO_GO, Reason.SINKAGE,
)  # fmt: skip
BARE = Figures(NASTY, missing=("cohesion", "fricAngle"))


def preview(grid: Grid = GRID) -> Preview:
    """Go in the west, caution, no-go, unknown to the east, other ground in a row; a hill; no ground
    in a corner."""
    shape = (grid.height, grid.width)
    row, column = np.indices(shape)
    heights = np.exp(-(((row - 8) / 6) ** 2) - ((column - 20) / 9) ** 2).astype(np.float32)
    ground = np.choose(4 * column // grid.width, [1, 2, 3, 0]).astype(np.uint8)
    ground[-3:] = np.choose(3 * column[-3:] // grid.width, [4, 5, 6])
    heights[: grid.height // 4, -grid.width // 8 :] = np.nan
    return Preview(grid, heights, ground, "EPSG:32633")


def profile(n: int = 200, found: bool = True) -> RouteProfile:
    """From (105, 202) to (130, 212), over a hill; no-go towards the end unless there is a way."""
    t = np.linspace(0.0, 1.0, n)
    verdict = np.where(t < 0.6, 1, 2).astype(np.uint8)
    if not found:
        verdict[t > 0.9] = 3
    slip = np.full(n, 0.1)
    slip[: n // 3] = np.nan
    return RouteProfile(
        105.0 + 25.0 * t, 202.0 + 10.0 * t, np.full(n, 68.0), 26.9 * t, np.sin(3.0 * t),
        0.004 + 0.004 * (t > 0.5), 0.2 * np.cos(3.0 * t), 0.0 * t, slip, 0.3 + 0.4 * t, verdict,
        np.where(verdict == 1, 0, 6).astype(np.uint8), ("sand",) * n, ("/elemTree",) * n,
        np.full(n, -0.03), 0.8 * t,
        0.7 - 0.2 * t, 1.0 + t, np.full(n, 0.05), 612.0 * t, 5230.0 * t,
    )  # fmt: skip


WAY = Route(
    place(105.0, 202.0), place(130.0, 212.0), True, True, Verdict.CAUTION, 27.3, 5230.0, 612.0,
    Extreme(-0.21, place()), Extreme(0.008, place(surface=NASTY)),
    Extreme(0.27, place(), Reason.SLIP), profile(), turning=830.0,
    drift=Extreme(0.8, place(130.0, 212.0)), crab=Extreme(0.03, place()), drift_total=0.8,
)  # fmt: skip
CHARGED = replace(
    WAY, charge=ChargeUse(5230.0, 0.82, 0.2), stop=Extreme(1.9, place()),
    slowest=Extreme(0.02, place()), load=Load(25.0, 0.3, -0.05),
)  # fmt: skip
EMPTIED = replace(
    CHARGED, verdict=Verdict.NO_GO, stop=Extreme(math.inf, place()),
    charge=ChargeUse(5230.0, 1.3, 0.2, Extreme(20.5, place(124.0, 209.5))),
)  # fmt: skip
NO_WAY = Route(
    place(105.0, 202.0), place(130.0, 212.0, NASTY), False, True, Verdict.NO_GO,
    barriers=(
        Barrier(place(121.0, 208.0, "rock"), Reason.STEP, "/elemTree/children/3 (surface 'rock')",
                0.4),
        Barrier(place(128.0, 211.0, LONG), Reason.SINKAGE, f"/elemTree ({NASTY})", 2.5),
    ),
    reached=place(120.5, 207.5),
)  # fmt: skip
BACK = Route(
    place(130.0, 212.0), place(105.0, 202.0), True, True, Verdict.GO, 51.0, 9000.0, 1400.0,
    Extreme(0.1, place()), Extreme(0.008, place()), Extreme(0.5, place(), Reason.SLIP), profile(),
)  # fmt: skip
ONE_WAY = replace(
    WAY, one_way=True, against=NO_WAY.barriers[:1], back=BACK, verdict=Verdict.CAUTION
)
LADEN = replace(
    ROVER, battery=Battery(6400.0, 0.2), efficiency=0.8, stopping_distance=1.5,
    reaction_time=0.25, loads=(Load(20.0, 0.2), Load(25.0, 0.3, -0.05)),
)  # fmt: skip
SPAN = LoadSpan(
    LADEN.loads[1], (None, math.radians(17.3)), (math.radians(9.0), math.radians(21.0)),
    (0.031, 0.05),
)  # fmt: skip
NO_RETURN = replace(ONE_WAY, back=NO_WAY, verdict=Verdict.NO_GO)
WAYPOINTS = Route(
    place(105.0, 202.0), place(130.0, 212.0), False, False, Verdict.NO_GO, None, math.inf, None,
    Extreme(0.3, place()), Extreme(0.02, place()), Extreme(-math.inf, place(), Reason.STEP),
    profile(found=False), NO_WAY.barriers[:1],
)  # fmt: skip

G = GroundClass
OTHERS = {G.CUT_OFF: 40, G.EDGE: 20, G.ONE_WAY: 10}
SUMMARY = MapSummary(
    GRID, 8,
    {G.GO: 600, G.CAUTION: 600, G.NO_GO: 530, G.UNKNOWN: 530, **OTHERS},
    {G.GO: 0, G.CAUTION: 1200, G.NO_GO: 530, G.UNKNOWN: 530, **OTHERS},
    {Reason.TRACTION: 600, Reason.STEP: 529, Reason.SINKAGE: 1},
    {"sand": {G.GO: 600, G.CAUTION: 600}, "rock": {G.NO_GO: 530, **OTHERS},
     NASTY: {G.UNKNOWN: 500}, "": {G.UNKNOWN: 30}, "unused": {}},
    (105.0, 202.0),
)  # fmt: skip

ASSUMPTIONS = ("Static, a rigid smooth wheel.", "No bulldozing, no grousers.")


def report(**changes: Any) -> TraversabilityReport:
    """A report with all there can be, unless something else is said."""
    values: dict[str, Any] = {
        "terrain": "site & yard.json",
        "descr": f"A site {NASTY}",
        "bounds": GRID.bounds,
        "vehicle": ROVER,
        "surfaces": (SAND, ROCK, BOG, BARE),
        "summary": SUMMARY,
        "verdict": Verdict.NO_GO,
        "routes": (WAY, NO_WAY, WAYPOINTS),
        "reach": Reach(place(105.0, 202.0), 0.625, 0.5, best_cells()),
        "preview": replace(preview(), reached=best_cells()),
        "assumptions": ASSUMPTIONS,
        "notes": ("The map has 80 × 30 pixels of 0.5 (as asked).",),
    }
    return TraversabilityReport(**{**values, **changes})


def best_cells() -> np.ndarray:
    return preview().ground < 3


EMPTY = MapSummary(GRID, 8, {}, {}, {}, {})

KINDS: dict[str, TraversabilityReport] = {
    "all": report(),
    "way": report(routes=(WAY,), verdict=Verdict.CAUTION),
    "no-way": report(routes=(NO_WAY,)),
    "one-way": report(routes=(ONE_WAY,), verdict=Verdict.CAUTION),
    "no-return": report(routes=(NO_RETURN,)),
    "lines": report(summary=None, preview=None, reach=None),
    "charge": report(
        vehicle=LADEN, routes=(CHARGED,), verdict=Verdict.CAUTION,
        surfaces=(
            replace(
                SAND, rolling=0.02, energy=61.0, driving_range=84.0, braking=0.61,
                stopping=0.012, speed_limit=0.05, loads=SPAN,
            ),
            replace(ROCK, stopping=math.inf, braking=0.0, speed_limit=0.0),
        ),
    ),
    "emptied": report(vehicle=LADEN, routes=(EMPTIED,), verdict=Verdict.NO_GO),
    "map": report(routes=(), reach=None, verdict=Verdict.CAUTION),
    "wheel": report(vehicle=Vehicle.single(Wheel(0.2, 0.1), 100.0), routes=(), reach=None),
    "nothing": report(
        surfaces=(), summary=EMPTY, routes=(), reach=None, preview=None, assumptions=(), notes=(),
        verdict=Verdict.UNKNOWN, descr="",
    ),
}  # fmt: skip
