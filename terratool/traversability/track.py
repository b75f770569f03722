"""A pair of tracks on soil: sinkage, resistance, thrust, and the steps that they climb.

Formulas are those of a rigid, flat track: M. G. Bekker, *Introduction to Terrain-Vehicle Systems*,
1969, and J. Y. Wong, *Theory of Ground Vehicles*, 4th ed., Wiley 2008, the chapter on tracked
vehicles. The kernels have the same ones, section by section: kernels/traversability/track.hpp.
All functions take numbers, or arrays that broadcast together, in N, m, Pa and rad.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.presets import Preset
from terratool.kernels import traversability as kernels

if TYPE_CHECKING:
    from terratool.traversability.vehicle import Vehicle

SECTIONS = 6
"""Number of sections of a track, each of which stands on one soil and has its own load."""
MOST_GRIP = kernels.MOST_GRIP
"""Largest strength of the ground under a track, in loads: the most that the rule for measured
wheels gives anywhere. On stiff clay the area times the cohesion would be many times the load, and
no track presses into such clay: an assumption."""

_ANGLES = 91
"""Number of places on the belt that are looked at while it climbs a step."""
_CLOSE = 1e-6
"""Accuracy of the highest step, m."""


def plate_sinkage(preset: Preset, pressure: Any, width: float) -> Any:
    """Sinkage z = (p/(kc/b + kφ))^(1/n) of a plate in a soil, m (Bekker 1969).

    Args:
        preset: a soil with n, kc and kφ in kN and m.
        pressure: p, Pa.
        width: b, the smaller side of the plate, or the diameter of a disc, m.
    """
    stiffness = 1e3 * (preset.cohesive / width + preset.frictional)
    return (np.asarray(pressure, np.float64) / stiffness) ** (1.0 / preset.exponent)


def compaction_resistance(load: Any, sinkage: Any, length: float, exponent: float) -> Any:
    """Resistance Rc = 2 b (kc/b + kφ) z^(n + 1)/(n + 1) of two tracks, N (Bekker 1969).

    The pressure p is (kc/b + kφ) zⁿ, so that Rc = W z/(L (n + 1)): the work of pressing soil down.
    """
    return load * sinkage / (length * (exponent + 1.0))


def mobilised_mean(length: Any, modulus: Any, slip: Any) -> Any:
    """Share 1 − K/(s L) (1 − exp(−s L/K)) of the strength that a slip mobilises along a track.

    The law of Janosi and Hanamoto, 1961, whose shear s x grows along the track from its front, as a
    mean over its length (Wong). 0 at no slip, and 1 where K is 0, not known.
    """
    known = np.asarray(modulus) > 0.0
    x = np.asarray(np.asarray(slip, np.float64) * length / np.where(known, modulus, 1.0))
    return np.where(known, kernels.mean_shares(x.ravel()).reshape(x.shape), 1.0)[()]


def thrust(load: Any, area: float, cohesion: Any, tan_friction: Any, share: Any) -> Any:
    """Thrust F = (A c + W tan φ) · share, N, of tracks that touch an area A, m² (Wong)."""
    return (area * cohesion + load * tan_friction) * share


def track_gap(front: float, rear: float) -> float:
    """Widest gap that tracks cross: the distance of the centre of gravity to the nearer end, m.

    Until the front end lies on the far edge the centre of gravity must not have left the near one,
    and so the rear end must have the far edge before it. Derived here.
    """
    return min(front, rear)


class TrackOutline(NamedTuple):
    """A pair of tracks as seen from the side, m.

    Attributes:
        front, rear: distances from the centre of gravity to the ends of what lies on the ground.
        height: height of the centre of gravity.
        radius: radius of the front idler with its belt.
        axle: height of the front idler's middle, `radius` where it stands on the ground.
        approach: angle at which the belt rises towards it, from a roller of its radius, rad.
    """

    front: float
    rear: float
    height: float
    radius: float
    axle: float
    approach: float


@lru_cache(maxsize=256)
def track_step(outline: TrackOutline, friction: float, most: float) -> tuple[float, str]:
    """The highest step that tracks climb, m, and in words what limits it; by statics, derived here.

    The rear end of the track stands on the lower level, and the edge of the step touches the belt:
    first the idler or the rising part, then ever further back, and the body tilts. At every place
    there must be forces at both that hold the vehicle, each within friction, of which the belts
    give no more than the motors let them. That ends where the centre of gravity is above
    the edge: from there the vehicle falls forward onto the upper level. Before that it must
    not be behind the rear end of the track. A step higher than the front idler's middle
    is not reached.

    Args:
        outline: the tracks.
        friction: μ of belt and ground.
        most: largest force of both belts, in weights of the vehicle; infinity for no limit.
    """
    high = outline.axle
    binding = _binding(outline, high, friction, most)
    if not binding:
        return high, "height of the track's front"
    low = 0.0
    while high - low > _CLOSE:
        middle = 0.5 * (low + high)
        found = _binding(outline, middle, friction, most)
        if found:
            high, binding = middle, found
        else:
            low = middle
    return low if low > _CLOSE else 0.0, binding


def _binding(outline: TrackOutline, height: float, friction: float, most: float) -> str:
    """The measure, in words, that keeps tracks from climbing a step; empty where nothing does."""
    angle, arm, lever = _touched(outline, height)
    passed = lever >= arm
    # up to the place where the centre of gravity is above the edge
    needed: NDArray[np.bool_] = np.cumsum(passed) - passed == 0
    lever = np.minimum(lever, arm)
    tips = (lever <= 0.0) & needed
    if tips.any() or not passed.any():
        return "tip-over"
    forces = angle[needed], arm[needed], lever[needed], height
    if not _holds(*forces, friction, math.inf).all():
        return "friction"
    return "" if _holds(*forces, friction, most).all() else "motor torque"


class _Touched(NamedTuple):
    """Places of the belt that the edge of a step touches in turn, (n,) each.

    Attributes:
        angle: angle of the belt from the horizontal, rad.
        arm, lever: distances of the edge and of the centre of gravity from the rear end, along, m.
    """

    angle: NDArray[np.float64]
    arm: NDArray[np.float64]
    lever: NDArray[np.float64]


def _touched(outline: TrackOutline, height: float) -> _Touched:
    """Places of the belt that the edge of a step of a height touches."""
    length, radius = outline.front + outline.rear, outline.radius
    # of the belt, ahead of the end on the ground, above it, and how steep it is: around the idler,
    # down the rise, around the roller at its foot, and back along the ground
    risen = max(outline.axle - radius, 0.0)
    start = outline.approach if risen > 0.0 else 0.0
    ahead = risen / math.tan(start) if risen > 0.0 else 0.0
    upper, lower = np.linspace(0.5 * math.pi, start, _ANGLES), np.linspace(start, 0.0, _ANGLES)
    rise, flat = np.linspace(1.0, 0.0, _ANGLES), np.linspace(0.0, -length, 4 * _ANGLES)[:-1]
    bend = radius * math.sin(start), radius * (1.0 - math.cos(start))
    along = [ahead + radius * np.sin(upper), bend[0] + ahead * rise, radius * np.sin(lower), flat]
    above = [
        risen + radius * (1.0 - np.cos(upper)), bend[1] + risen * rise,
        radius * (1.0 - np.cos(lower)), np.zeros_like(flat),
    ]  # fmt: skip
    steep = np.concatenate([upper, np.full_like(rise, start), lower, np.zeros_like(flat)])
    x, z = np.concatenate(along) + length, np.concatenate(above)
    touch = [float(np.interp(height, z[::-1], of[::-1])) for of in (x, steep)]  # at first
    x, z, steep = (
        np.concatenate([[first], of])
        for first, of in ((touch[0], x), (height, z), (touch[1], steep))
    )
    reached = (z <= height) & (np.hypot(x, z) > height)
    x, z, steep = x[reached], z[reached], steep[reached]
    tilt = np.arcsin(height / np.hypot(x, z)) - np.arctan2(z, x)
    arm = x * np.cos(tilt) - z * np.sin(tilt)
    lever = outline.rear * np.cos(tilt) - outline.height * np.sin(tilt)
    return _Touched(steep + tilt, arm, lever)


def _holds(
    angle: NDArray[np.float64], arm: NDArray[np.float64], lever: NDArray[np.float64],
    height: float, friction: float, most: float,
) -> NDArray[np.bool_]:  # fmt: skip
    """Whether forces at the edge and at the rear end can hold the vehicle, (n,).

    In weights of the vehicle: N2 across the belt at the edge and T2 along it, N1 and T1 at the rear
    end. N2 a + T2 b = lever, a = d cos ψ + H sin ψ, b = d sin ψ − H cos ψ, from the moments about
    the rear end; T1 = N2 sin ψ − T2 cos ψ; N1 = 1 − N2 cos ψ − T2 sin ψ. All are linear in T2,
    of which there is an interval that every condition permits, or none.
    """
    sine, cosine = np.sin(angle), np.cos(angle)
    a, b = arm * cosine + height * sine, arm * sine - height * cosine
    # each number is a pair: its value at T2 = 0, and its change with T2
    n2 = np.stack([lever / a, -b / a])
    t2 = np.stack([np.zeros_like(a), np.ones_like(a)])
    t1 = n2 * sine - t2 * cosine
    n1 = np.stack([np.ones_like(a), np.zeros_like(a)]) - n2 * cosine - t2 * sine
    rows = [
        n1,
        n2,
        friction * n2 - t2,
        friction * n2 + t2,
        friction * n1 - t1,
        friction * n1 + t1,
    ]
    if math.isfinite(most):
        rows.append(np.stack([np.full_like(a, most), np.zeros_like(a)]) - t1 - t2)
    value, change = np.stack(rows, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = -value / change
    low = np.where(change > 0.0, root, -np.inf).max(axis=0)
    high = np.where(change < 0.0, root, np.inf).min(axis=0)
    never = ((change == 0.0) & (value < -1e-12)).any(axis=0)
    return np.asarray((low <= high + 1e-12) & ~never)


def outline_of(vehicle: Vehicle) -> TrackOutline:
    """The outline of a tracked vehicle that drives ahead."""
    tracks = vehicle.tracks
    assert tracks is not None
    return TrackOutline(
        vehicle.middle + 0.5 * tracks.length, 0.5 * tracks.length - vehicle.middle,
        vehicle.cog_height, tracks.radius, tracks.front_height, tracks.approach,
    )  # fmt: skip
