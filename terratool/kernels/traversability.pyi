"""Traversability: the kernels in C++. Written by `make stubs`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

UTILISATION: int = 0

PITCH: int = 1

ROLL: int = 2

SINKAGE: int = 3

SLIP: int = 4

ENERGY: int = 5

DRAWBAR: int = 6

RESERVE: int = 7

CRAB: int = 8

PLANES: int = 9

FULL_LUG: float = 0.005

REACH: float = 0.59

RIM_FRICTION: float = 0.46

GROWTH: float = 0.305

MOST_GRIP: float = 1.16

def check_records(traction: np.dtype[Any], demand: np.dtype[Any]) -> None:
    """Refuse dtypes that are not the structs of the kernels."""

def check_enumerations(verdict: object, reason: object) -> None:
    """Refuse enumerations that are not those of the kernels."""

class VehicleOnSoils:
    """A vehicle on the soils of a terrain, and its tables."""

    def __init__(self, vehicle: object, soils: object, steps: object) -> None: ...

class VehicleOnSamples:
    """A vehicle on samples of the soils of a terrain, and its tables."""

    def __init__(self, vehicle: object, soils: object) -> None: ...

SPECS: dict[str, list[dict[str, Any]]]

def contacts(
    load: NDArray[np.float64], sinkage: NDArray[np.float64], slip: NDArray[np.float64], wheel: Any
) -> NDArray[np.float64]:
    """
    Sinkage, entry angle, effective area and shear length.

    Shapes: load[n], sinkage[n], slip[n].
    """

def bearing_factors(tan_friction: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Bearing capacity factors of cohesion.

    Shapes: tan_friction[n].
    """

def mean_shares(displacement: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Shares of strength mobilised along tracks.

    Shapes: displacement[n].
    """

def tractions(
    load: NDArray[np.float64],
    soils: Any,
    slip: NDArray[np.float64],
    max_torque: NDArray[np.float64],
    wheel: Any,
    out: NDArray[np.void],
) -> None:
    """
    What driven wheels can do at a slip.

    Shapes: load[n], slip[n], max_torque[n], out[n].
    """

def demands(
    load: NDArray[np.float64],
    soils: Any,
    pull: NDArray[np.float64],
    wheel: Any,
    out: NDArray[np.void],
) -> None:
    """
    What wheels need to push.

    Shapes: load[n], pull[n], out[n].
    """

def towing(load: NDArray[np.float64], soils: Any, wheel: Any) -> NDArray[np.float64]:
    """
    Resistance of wheels without torque.

    Shapes: load[n].
    """

def grips(
    load: NDArray[np.float64], soils: Any, slip: NDArray[np.float64], wheel: Any
) -> NDArray[np.float64]:
    """
    What holds wheels at a slip.

    Shapes: load[n], slip[n].
    """

def side_forces(
    load: NDArray[np.float64],
    soils: Any,
    slip: NDArray[np.float64],
    crab: NDArray[np.float64],
    wheel: Any,
) -> NDArray[np.float64]:
    """
    Forces sideways at a slip and a crab angle.

    Shapes: load[n], slip[n], crab[n].
    """

def softnesses(
    load: NDArray[np.float64], sinkage: NDArray[np.float64], wheel: Any
) -> NDArray[np.float64]:
    """
    0 on rigid ground, 1 on soft soil.

    Shapes: load[n], sinkage[n].
    """

def measured_forces(
    normal: NDArray[np.float64], shear: NDArray[np.float64], entry: NDArray[np.float64], wheel: Any
) -> NDArray[np.float64]:
    """
    Load, torque and drawbar pull.

    Shapes: normal[n], shear[n], entry[n].
    """

def measured_stresses(
    load: NDArray[np.float64], torque: NDArray[np.float64], entry: NDArray[np.float64], wheel: Any
) -> NDArray[np.float64]:
    """
    Normal and shear stress.

    Shapes: load[n], torque[n], entry[n].
    """

def wheel_loads(layout: Any, weight: float, pitch: float, roll: float) -> NDArray[np.float64]:
    """Loads of a vehicle's wheels on a slope."""

def drive(
    layout: Any, weight: float, pitch: float, soil: Any, pull: float, sinkage: NDArray[np.float64]
) -> dict[str, Any]:
    """
    What it asks of a vehicle's wheels to push on a slope.

    Shapes: sinkage[w].
    """

def steepest(across: bool, layout: Any, weight: float, soil: Any, slip: float) -> dict[str, Any]:
    """The largest slope on a soil, and the reason that limits it."""

def crab_across(layout: Any, weight: float, soil: Any, angle: float) -> float:
    """The crab angle of a vehicle that drives across a slope."""

def braking(layout: Any, weight: float, soil: Any) -> float:
    """What brakes a vehicle on the level, as a share of its weight."""

def turn_on_spot(
    layout: Any,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    weight: float,
    soil: Any,
    slip: float,
) -> dict[str, Any]:
    """
    What it takes a vehicle to turn on the spot by a radian.

    Shapes: x[w], y[w].
    """

def judge(
    shares: NDArray[np.float64],
    go: NDArray[np.float64],
    strict: NDArray[np.bool_],
    reasons: NDArray[np.uint8],
) -> tuple[int, int, float]:
    """
    Verdict, reason and largest share of measures.

    Shapes: shares[m], go[m], strict[m], reasons[m].
    """

def judge_cells(vehicle: VehicleOnSoils, stance: Any, east: float, north: float, out: Any) -> None:
    """Judge a vehicle with a heading at every reference point."""

def judge_samples(
    vehicle: VehicleOnSamples,
    stance: Any,
    east: float,
    north: float,
    verdict: NDArray[np.uint8],
    go: NDArray[np.uint64],
) -> None:
    """
    Mark the samples on which a vehicle with a heading goes, as bits.

    Shapes: verdict[h,w], go[h,w,k].
    """

def judge_uneven(
    vehicle: VehicleOnSoils,
    sampled: VehicleOnSamples,
    stance: Any,
    east: float,
    north: float,
    errors: NDArray[np.float64],
    shift: NDArray[np.int64],
    go: NDArray[np.uint64],
) -> None:
    """
    Mark the samples of soils and of errors of heights on which a vehicle goes, as bits.

    Shapes: errors[_,6], shift[h,w], go[h,w,k].
    """

def count_samples(go: NDArray[np.uint64], out: NDArray[np.uint32]) -> None:
    """
    How many samples are marked at each place.

    Shapes: go[h,w,_], out[h,w].
    """

def highest(
    ground: NDArray[np.float32], first: int, offsets: NDArray[np.int64], out: NDArray[np.float32]
) -> None:
    """
    The highest ground under offsets.

    Shapes: ground[_,_,_], offsets[k,3], out[_,_].
    """

def supports(
    heights: NDArray[np.float32],
    tread: NDArray[np.int64],
    lift: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """
    How high a wheel stands at every pixel.

    Shapes: heights[h,w], tread[k,2], lift[k], out[h,w].
    """

def raise_supports(
    crests: Any,
    tread: NDArray[np.int64],
    shifts: NDArray[np.float32],
    wheel: Any,
    out: NDArray[np.float32],
) -> None:
    """
    Raise supports where wheels meet crests.

    Shapes: tread[k,2], shifts[k,2], out[h,w].
    """

def stand(
    supports: NDArray[np.float32],
    ground: NDArray[np.float32],
    first: int,
    standing: Any,
    out: NDArray[np.float32],
) -> None:
    """
    The plane through the supports of the wheels.

    Shapes: supports[_,p,c], ground[r,p,c], out[3,_,_].
    """

def mean(
    ground: NDArray[np.float32], first: int, offsets: NDArray[np.int64], out: NDArray[np.float32]
) -> None:
    """
    The mean over offsets.

    Shapes: ground[_,_,_], offsets[k,3], out[_,_].
    """

def bumps(
    ground: NDArray[np.float32],
    first: int,
    offsets: NDArray[np.int64],
    shifts: NDArray[np.float32],
    plane: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """
    How far the ground under offsets stands above its plane at most.

    Shapes: ground[_,_,_], offsets[k,3], shifts[k,2], plane[3,h,w], out[h,w].
    """

def raise_bumps(
    crests: Any,
    phases: int,
    first: int,
    offsets: NDArray[np.int64],
    shifts: NDArray[np.float32],
    plane: NDArray[np.float32],
    body: Any,
    out: NDArray[np.float32],
) -> None:
    """
    Raise bumps to what of crests within a body stands above its plane.

    Shapes: offsets[k,2], shifts[k,2], plane[3,h,w], out[h,w].
    """

def roughness(
    ground: NDArray[np.float32],
    first: int,
    offsets: NDArray[np.int64],
    shifts: NDArray[np.float32],
    plane: NDArray[np.float32],
    spread: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """
    RMS distance of the ground at offsets from its plane.

    Shapes: ground[_,_,_], offsets[k,3], shifts[k,2], plane[3,h,w], spread[3], out[h,w].
    """

def rest_belts(
    ground: NDArray[np.float32], first: int, belts: Any, out: NDArray[np.float32]
) -> None:
    """
    The plane that two rigid belts rest on.

    Shapes: ground[_,p,c], out[3,_,_].
    """

def rate_footholds(
    heights: NDArray[np.float32],
    surfaces: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.uint32],
    limits: Any,
    out: NDArray[np.float32],
) -> None:
    """
    The largest share of a foothold's limits that a foot takes.

    Shapes: heights[h,w], surfaces[h,w], out[h,w].
    """

def choose_footholds(
    heights: NDArray[np.float32],
    shares: NDArray[np.float32],
    foot: Any,
    height: NDArray[np.float32],
    share: NDArray[np.float32],
) -> None:
    """
    The best foothold within reach of every pixel.

    Shapes: heights[h,w], shares[h,w], height[h,w], share[h,w].
    """

def departures(
    ground: NDArray[np.float32],
    first: int,
    offsets: NDArray[np.int64],
    shifts: NDArray[np.float32],
    plane: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """
    How far ground at offsets is from its plane at most.

    Shapes: ground[_,_,_], offsets[k,3], shifts[k,2], plane[3,h,w], out[h,w].
    """

def find_layer(solids: Any, sheet: int, apart: bool, rise: float, reach: int, out: Any) -> None:
    """What a layer of driving shows at every pixel."""

def raise_steps(
    supports: NDArray[np.float32],
    pairs: NDArray[np.int64],
    jumps: NDArray[np.float64],
    gaps: Any,
    east: float,
    north: float,
    strides: int,
    out: NDArray[np.float32],
) -> None:
    """
    Mark pixels beside walls with the step that a wheel meets.

    Shapes: supports[h,w], pairs[n], jumps[n], out[h,w].
    """

class Search:
    """A search for the cheapest way to a cell."""

    def __init__(self, costs: object, starts: object, row: int, column: int) -> None: ...

ALONG: int = 0

AGAINST: int = 1

BOTH: int = 2

def advance(search: Search) -> int:
    """Search on; the index of a tile that must be known for that, or -1."""

def cost(search: Search) -> float:
    """What the way costs; infinity where there is none."""

def way(search: Search) -> NDArray[np.int64]:
    """The states of the way, the goal first."""

def mark(search: Search, out: NDArray[np.bool_]) -> None:
    """
    Mark the cells that were reached.

    Shapes: out[_,_].
    """

def pull(
    costs: Any, states: NDArray[np.int64], rounds: int, both: bool, near: int
) -> NDArray[np.int64]:
    """
    Corners of a way pulled straight: row, column, sign of the leg, side of turn.

    Shapes: states[n,3].
    """

def pull_bends(
    costs: Any, corners: NDArray[np.float64], radius: float, rounds: int, both: bool, near: int
) -> NDArray[np.float64]:
    """
    Corners of a way with arcs pulled straight: row, column, sign of the leg, and the arc's begin and end on the legs, its radius, and whether it is the search's.

    Shapes: corners[n,7].
    """

def flood(
    moves: Any,
    direction: int,
    can: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.uint32] | NDArray[np.uint64],
    places: Any,
    fresh: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.uint32] | NDArray[np.uint64],
    reached: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.uint32] | NDArray[np.uint64],
    states: int,
) -> int:
    """
    Spread over what can be driven; over how many states, fewer once all is done.

    Shapes: can[h,w], fresh[h,w], reached[h,w].
    """

def find_parts(
    moves: Any,
    can: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.uint32] | NDArray[np.uint64],
    places: Any,
    fresh: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.uint32] | NDArray[np.uint64],
    reached: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.uint32] | NDArray[np.uint64],
    parts: NDArray[np.int64],
    states: int,
) -> int:
    """
    Find the largest part that can be driven both ways; over how many states this went.

    Shapes: can[h,w], fresh[h,w], reached[h,w], parts[2,3].
    """
