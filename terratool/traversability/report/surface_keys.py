"""Keys of reports about the figures of a vehicle on a surface."""

from __future__ import annotations

from typing import Annotated

from msgspec import UNSET, Meta, Struct, UnsetType

from terratool.report.documents import (
    Share,
)
from terratool.traversability.report.keys import (
    DEG,
    Binding,
    Degrees,
    Joules,
    Kilopascals,
    ManyDegrees,
    Metres,
    MetresPerKilonewton,
    MetresPerSecond,
    NewtonMetres,
    Newtons,
    ReasonText,
    ResultMember,
    SquareMetres,
    Text,
    VerdictText,
)
from terratool.traversability.report.vehicle_keys import LoadKeys


class LoadSpanKeys(Struct, frozen=True):
    """Least and largest figures of a vehicle on a surface with each of its loads.

    Attributes:
        load: load with which it can do least.
    """

    load: LoadKeys
    climb_deg: Annotated[tuple[float | None, float | None], ResultMember(unit="deg", factor=DEG)]
    cross_slope_deg: Annotated[
        tuple[float | None, float | None], ResultMember(unit="deg", factor=DEG)
    ]
    step_m: Annotated[tuple[float | None, float | None], ResultMember(unit="m")]


class SlipCurveKeys(Struct, frozen=True):
    """Slip of the vehicle when it drives straight up a slope, or down, with its loads there.

    Slopes are every half degree from −10° to 2° beyond the largest climb, and that climb.
    """

    slope_deg: Annotated[tuple[float, ...], ResultMember(unit="deg", factor=DEG)]
    slip: tuple[Share | None, ...]


class DriftCurveKeys(Struct, frozen=True):
    """Crab angle of the vehicle when it drives straight across a slope.

    By it the vehicle heads uphill to hold its line, and drifts downhill if it does not. Slopes are
    every 5 degrees up to the largest cross-slope.
    """

    slope_deg: ManyDegrees
    crab_deg: ManyDegrees


class ChanceKeys(Struct, frozen=True):
    """Probabilities that a vehicle can drive on the level of a surface."""

    go: Share
    go_or_caution: Annotated[Share, ResultMember("drives")]
    climb_low_deg: Degrees | None
    climb_high_deg: Degrees | None


class SurfaceKeys(Struct, frozen=True):
    """Figures of a vehicle on a surface, under the wheel that bears most."""

    surface: str
    verdict: VerdictText
    binding: Binding
    missing: tuple[str, ...]
    preset: Text
    load_N: Newtons | None
    cohesion_kPa: Kilopascals | None
    friction_deg: Degrees | None
    sinkage_rate_m_per_kN: MetresPerKilonewton | None
    shear_modulus_m: Metres | None
    sinkage_m: Metres | None
    contact_length_m: Metres | None
    contact_area_m2: SquareMetres | None
    pressure_kPa: Kilopascals | None
    normal_stress_kPa: Kilopascals | None
    shear_stress_kPa: Kilopascals | None
    entry_angle_deg: Degrees | None
    strength_kPa: Kilopascals | None
    motor_stress_kPa: Kilopascals | None
    limit_torque_Nm: NewtonMetres | None
    thrust_N: Newtons | None
    resistance_N: Newtons | None
    drawbar_N: Newtons | None
    bearing_N: Newtons | None
    borne_at_m: Metres | None
    torque_Nm: NewtonMetres | None
    utilisation: float | None
    slip: float | None
    climb_deg: Degrees | None
    climb_error_deg: Degrees | None
    climb_binding: ReasonText | None
    cross_slope_deg: Degrees | None
    cross_slope_binding: ReasonText | None
    step_m: Metres | None
    step_binding: Text
    step_axle: Annotated[int, Meta(ge=1)] | None
    gap_m: Metres | None
    turning_Nm: NewtonMetres | None
    turning_work_J: Joules | None
    turning_slip: float | None
    turning_binding: ReasonText | None
    rolling: float | None
    energy_J_per_m: Annotated[float | None, ResultMember("energy")]
    driving_range_m: Metres | None
    braking: float | None
    stopping_m: Metres | None
    speed_limit_m_s: MetresPerSecond | None
    loads: LoadSpanKeys | None
    warnings: tuple[str, ...]
    slip_curve: SlipCurveKeys | None
    drift_curve: DriftCurveKeys | None
    probability: Annotated[ChanceKeys | UnsetType, ResultMember("chances")] = UNSET
