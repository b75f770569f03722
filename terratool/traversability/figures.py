"""Figures of a vehicle on level ground of a surface."""

from __future__ import annotations

from dataclasses import dataclass

from terratool.traversability.vehicle import Load
from terratool.traversability.verdicts import Reason, Verdict


@dataclass(frozen=True, slots=True)
class SlipCurve:
    """Slip against slope of a vehicle that drives straight up or down, (n,) each.

    Slopes lie half a degree apart, with the largest climb among them.

    Attributes:
        slope: slopes, rad, rising; below 0 downhill.
        slip: slip of the driven wheel that slips most; NaN where the vehicle cannot drive.
    """

    slope: tuple[float, ...]
    slip: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class DriftCurve:
    """Crab angle against side slope of a vehicle that drives straight across, (n,) each.

    Attributes:
        slope: side slopes, rad, each 5 degrees from 0 to the largest cross-slope.
        crab: crab angle, rad: by how much the vehicle heads uphill to hold its line, and drifts
            downhill if it does not.
    """

    slope: tuple[float, ...]
    crab: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Chances:
    """Probabilities of driving on level ground of a surface, as shares of samples of its soil.

    Attributes:
        go: probability of go, from 0 to 1.
        drives: probability of go or caution, from 0 to 1.
        climb_low: climb that 5 % of the samples stay below, rad; None where the vehicle cannot
            even drive on the level.
        climb_high: climb that 5 % of the samples exceed, rad; None like the other one.
    """

    go: float
    drives: float
    climb_low: float | None
    climb_high: float | None


@dataclass(frozen=True, slots=True)
class LoadSpan:
    """Least and largest figures of a vehicle on a surface, with each of its loads.

    Attributes:
        load: load with which it can do least, whose figures those of the surface are.
        climb: steepest slope that is climbed, rad; None where it cannot even drive on the level.
        cross_slope: steepest cross-slope, rad; None like the climb.
        step: height of the highest step that is climbed, m.
    """

    load: Load
    climb: tuple[float | None, float | None]
    cross_slope: tuple[float | None, float | None]
    step: tuple[float | None, float | None]


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of a vehicle on level ground of a surface, and the slopes and steps that it takes.

    Numbers are None where they mean nothing (a rigid surface has no contact area), or cannot be
    known (`missing` says what the surface lacks). Forces are those of the wheel that bears most,
    of a track, or of a foot as it walks.

    Attributes:
        surface: name of the surface.
        preset: name of the preset that the surface takes its soil from; empty for none.
        missing: keys that the surface lacks; if there are any, all numbers are None.
        load: load W, N.
        cohesion: cohesion c, Pa.
        friction: friction angle φ, rad.
        sinkage_rate: sinkage per load k, m/N.
        shear_modulus: shear modulus K, m; None where all strength is mobilised.
        sinkage: sinkage z, m.
        contact_length: length of the ground that the wheel touches, r sin θ1, m.
        contact_area: contact length times the wheel's width, m².
        pressure: mean pressure on the contact area, Pa.
        normal_stress: peak normal stress σmax at the largest thrust, Pa.
        shear_stress: peak shear stress τmax at the largest thrust, Pa.
        entry_angle: entry angle θ1 at rest, rad, from the downward vertical.
        strength: shear strength of the soil in the model `paper`, c + σ tan φ, Pa, with the σ that
            the motor's largest torque makes, or σmax where that is not limited.
        motor_stress: shear stress τ of the motor's largest torque in the model `paper`, Pa.
        limit_torque: torque that belongs to σmax and τmax, N m.
        thrust: thrust at the largest torque and slip allowed, N.
        resistance: resistance at the largest torque and slip allowed, N.
        drawbar: drawbar pull at the largest torque and slip allowed, N.
        torque: torque needed on the level, N m.
        utilisation: share of the soil's strength used on the level.
        slip: slip on the level; None where it is not known.
        climb: steepest slope that is climbed, rad; None where the vehicle cannot even drive on the
            level.
        climb_binding: measure that binds at the climb.
        cross_slope: steepest cross-slope, rad; None like the climb.
        cross_slope_binding: measure that binds at the cross-slope, or on the level.
        step: height of the highest step that is climbed, m; None like the climb.
        step_binding: measure that binds at the step, in words.
        step_axle: axle that does not get up a higher step, 1 for the foremost; None where the body
            does not, or the wheel is by itself.
        gap: width of the widest gap that is crossed, m; None like the climb.
        verdict: verdict on level ground.
        reason: measure that binds on level ground.
        warnings: sentences on what is unusual.
        slip_curve: slip against slope; None where slip is not known.
        chances: probabilities where figures of the soil are ranges, whose middles all other
            figures take; None where none are.
        turning: moment that resists turning on the spot, N m; the largest that is reached where the
            vehicle cannot turn.
        turning_work: work of the wheels for a quarter turn, J; None where the vehicle cannot turn.
        turning_slip: slip of the treads in a turn; None where the vehicle cannot turn.
        turning_binding: measure that forbids turning.
        climb_error: error band of the climb to both sides, rad: less on firmer soil, 0 on ground
            that does not yield, in the model `paper`, and where it is kept in reserve; None like
            the climb.
        drift_curve: crab angle against side slope; None where slip is not known.
        rolling: coefficient of rolling resistance that counts, the larger of ground and wheel.
        energy: energy of a charge for a metre on the level, J: that of the wheels by the motors'
            efficiency, and the power drawn all the time; None where the vehicle cannot drive.
        driving_range: way on the level that a charge without its reserve lasts for, m; None without
            a battery, or where the vehicle cannot drive.
        braking: deceleration on the level as a share of gravity.
        stopping: distance to stop from the vehicle's speed on the level, m.
        speed_limit: largest speed that stops within the vehicle's stopping distance on the level,
            m/s; None where that is not limited.
        loads: what it can do with each of its loads, if these differ; other figures are then those
            of the load with which it can do least, and of energy and stopping the worst of all.
        bearing: load that the soil bears on a foot, N; None for wheels, tracks and rigid ground.
        borne_at: depth in which a foot stands, m: its sinkage, or where the soil bears it if that
            is deeper; None like the load that it bears.
    """

    surface: str
    preset: str = ""
    missing: tuple[str, ...] = ()
    load: float | None = None
    cohesion: float | None = None
    friction: float | None = None
    sinkage_rate: float | None = None
    shear_modulus: float | None = None
    sinkage: float | None = None
    contact_length: float | None = None
    contact_area: float | None = None
    pressure: float | None = None
    normal_stress: float | None = None
    shear_stress: float | None = None
    entry_angle: float | None = None
    strength: float | None = None
    motor_stress: float | None = None
    limit_torque: float | None = None
    thrust: float | None = None
    resistance: float | None = None
    drawbar: float | None = None
    torque: float | None = None
    utilisation: float | None = None
    slip: float | None = None
    climb: float | None = None
    climb_binding: Reason = Reason.NONE
    cross_slope: float | None = None
    cross_slope_binding: Reason = Reason.NONE
    step: float | None = None
    step_binding: str = ""
    step_axle: int | None = None
    gap: float | None = None
    verdict: Verdict = Verdict.UNKNOWN
    reason: Reason = Reason.NONE
    warnings: tuple[str, ...] = ()
    slip_curve: SlipCurve | None = None
    chances: Chances | None = None
    turning: float | None = None
    turning_work: float | None = None
    turning_slip: float | None = None
    turning_binding: Reason = Reason.NONE
    climb_error: float | None = None
    drift_curve: DriftCurve | None = None
    rolling: float | None = None
    energy: float | None = None
    driving_range: float | None = None
    braking: float | None = None
    stopping: float | None = None
    speed_limit: float | None = None
    loads: LoadSpan | None = None
    bearing: float | None = None
    borne_at: float | None = None
