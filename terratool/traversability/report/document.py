"""A report as JSON: records whose fields are its keys, as schemas/report.schema.json has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from msgspec import UNSET, Struct, UnsetType, structs

from terratool.report.documents import Document, Tool, json_text, plain_document
from terratool.traversability.report import comparison, wording
from terratool.traversability.report.keys import (
    DEG,
    Binding,
    Degrees,
    Joules,
    Kilograms,
    Kilopascals,
    Kind,
    ManyDegrees,
    ManyMetres,
    Metres,
    MetresPerKilonewton,
    MetresPerSecond,
    MetresPerSquareSecond,
    NewtonMetres,
    Newtons,
    Number,
    Numbers,
    ResultMember,
    Seconds,
    SquareMetres,
    Text,
    Watts,
    fill_keys,
    value_of,
)
from terratool.traversability.results import (
    GroundClass,
    MapSummary,
    Reason,
    Reports,
    TraversabilityReport,
    VehicleComparison,
    Verdict,
)
from terratool.traversability.vehicle import Vehicle

FORMAT_VERSION = 2


class TerrainKeys(Struct, frozen=True):
    """Terrain of a report."""

    file: str
    descr: str
    bounds: Numbers


class PlaceKeys(Struct, frozen=True):
    """Place on the terrain."""

    x: float | None
    y: float | None
    z: Annotated[float | None, ResultMember("height")]
    surface: Text
    element: Text


class WheelKeys(Struct, frozen=True):
    """Wheel of a vehicle."""

    radius_m: Metres
    width_m: Metres
    grouser_height_m: Metres
    contact_length_m: Metres
    patch_pressure_kPa: Kilopascals
    exit_ratio: Number
    max_torque_Nm: NewtonMetres
    max_slip: Number


class AxleKeys(Struct, frozen=True):
    """Axle: wheels side by side."""

    x_m: Metres
    wheels: int
    driven: bool
    wheel: WheelKeys | None


class OverhangKeys(Struct, frozen=True):
    """Overhang of the body beyond an outermost axle."""

    length_m: Metres
    height_m: Metres


class MarginKeys(Struct, frozen=True):
    """Margins that are kept in reserve."""

    clearance_m: Metres
    step_m: Metres
    tip_deg: Degrees
    slope_deg: Degrees


class ThresholdKeys(Struct, frozen=True):
    """Limits at which go ends and caution ends."""

    utilisation: Number
    slip: Number
    caution_slip: Number
    torque: Number
    geometry: Number


class VehicleKeys(Struct, frozen=True):
    """Vehicle, or a wheel by itself, which has neither mass nor gravity."""

    name: str
    single_wheel: Annotated[bool, ResultMember("is_single")]
    mass_kg: Kilograms
    gravity_m_s2: MetresPerSquareSecond
    weight_N: Newtons
    wheel: WheelKeys
    axles: tuple[AxleKeys, ...]
    track_m: Annotated[float | None, ResultMember("track_width")]
    cog_height_m: Metres
    clearance_m: Metres
    body_width_m: Metres
    front: OverhangKeys
    rear: OverhangKeys
    steering: str
    speed_m_s: MetresPerSecond
    power_W: Watts
    margins: MarginKeys
    classes: Annotated[ThresholdKeys, ResultMember("thresholds")]


class SlipCurveKeys(Struct, frozen=True):
    """Slip against the slope that is driven straight up or down."""

    slope_deg: ManyDegrees
    slip: Numbers


class ChanceKeys(Struct, frozen=True):
    """Probabilities that a vehicle can drive on the level of a surface."""

    go: Number
    go_or_caution: Annotated[Number, ResultMember("drives")]
    climb_low_deg: Degrees
    climb_high_deg: Degrees


class SurfaceKeys(Struct, frozen=True):
    """Figures of a vehicle on a surface."""

    surface: str
    verdict: str
    binding: Binding
    missing: tuple[str, ...]
    preset: Text
    load_N: Newtons
    cohesion_kPa: Kilopascals
    friction_deg: Degrees
    sinkage_rate_m_per_kN: MetresPerKilonewton
    shear_modulus_m: Metres
    sinkage_m: Metres
    contact_length_m: Metres
    contact_area_m2: SquareMetres
    pressure_kPa: Kilopascals
    normal_stress_kPa: Kilopascals
    shear_stress_kPa: Kilopascals
    entry_angle_deg: Degrees
    strength_kPa: Kilopascals
    motor_stress_kPa: Kilopascals
    limit_torque_Nm: NewtonMetres
    thrust_N: Newtons
    resistance_N: Newtons
    drawbar_N: Newtons
    torque_Nm: NewtonMetres
    utilisation: Number
    slip: Number
    climb_deg: Degrees
    climb_binding: Text
    cross_slope_deg: Degrees
    cross_slope_binding: Text
    step_m: Metres
    step_binding: Text
    step_axle: int | None
    gap_m: Metres
    turning_Nm: NewtonMetres
    turning_work_J: Joules
    turning_slip: Number
    turning_binding: Text
    warnings: tuple[str, ...]
    slip_curve: SlipCurveKeys | None
    probability: Annotated[ChanceKeys | UnsetType, ResultMember("chances")] = UNSET


class BarrierKeys(Struct, frozen=True):
    """Barrier on a route."""

    binding: Binding
    bars: Text
    width_m: Metres
    place: PlaceKeys


class SteepestKeys(Struct, frozen=True):
    """Steepest place of a route."""

    pitch_deg: Annotated[float | None, ResultMember("value", factor=DEG)]
    binding: Binding
    place: PlaceKeys


class SoftestKeys(Struct, frozen=True):
    """Place of a route where wheels sink deepest."""

    sinkage_m: Annotated[float | None, ResultMember("value")]
    binding: Binding
    place: PlaceKeys


class TightestKeys(Struct, frozen=True):
    """Place of a route with the smallest margin."""

    margin: Annotated[float | None, ResultMember("value")]
    binding: Binding
    place: PlaceKeys


class LeastChanceKeys(Struct, frozen=True):
    """Place of a route with the smallest probability of go."""

    probability: Annotated[float | None, ResultMember("value")]
    place: PlaceKeys


class ProfileKeys(Struct, frozen=True):
    """Samples along a route."""

    x: Numbers
    y: Numbers
    heading_deg: Annotated[Numbers, ResultMember("heading")]
    distance_m: ManyMetres
    z: Annotated[Numbers, ResultMember("height")]
    sinkage_m: ManyMetres
    pitch_deg: ManyDegrees
    roll_deg: ManyDegrees
    slip: Numbers
    utilisation: Numbers
    verdict: Annotated[tuple[str, ...], ResultMember(codes=Verdict)]
    binding: Annotated[tuple[Text, ...], ResultMember("reason", codes=Reason)]
    surface: tuple[Text, ...]
    element: tuple[Text, ...]


class RouteKeys(Struct, frozen=True):
    """Route from a start to a goal, or the barriers where there is none."""

    found: bool
    planned: bool
    verdict: str
    start: PlaceKeys
    goal: PlaceKeys
    length_m: Metres
    time_s: Seconds
    energy_J: Joules
    turning_J: Joules
    steepest: SteepestKeys | None
    softest: SoftestKeys | None
    tightest: TightestKeys | None
    barriers: tuple[BarrierKeys, ...]
    reached: PlaceKeys | None
    note: Text
    one_way: bool
    against: tuple[BarrierKeys, ...]
    back: RouteKeys | None
    headings: int
    tried_headings: tuple[int, ...]
    ruled_out_headings: int | None
    profile: ProfileKeys | None
    probability: Annotated[Number | UnsetType, ResultMember("chance")] = UNSET
    least_probability: Annotated[LeastChanceKeys | UnsetType, ResultMember("least_chance")] = UNSET


class ReachKeys(Struct, frozen=True):
    """Ground that can be reached from a place."""

    start: PlaceKeys
    share: Number
    returnable: Number
    note: Text


class LargestPartKeys(Struct, frozen=True):
    """The largest connected part of the ground."""

    place: Numbers
    share: Number


class ChancePixels(Struct, frozen=True):
    """Number of pixels that are go with at least a probability."""

    at_least: float
    pixels: int


class MapKeys(Struct, frozen=True, rename={"start": "from"}):
    """Map in numbers: pixels and shares by class of ground."""

    resolution_m: Metres
    width: int
    height: int
    bounds: Numbers
    headings: int
    start: Numbers | None
    largest_part: LargestPartKeys | None
    pixels: int
    best_heading: dict[str, int]
    worst_heading: dict[str, int]
    fractions: dict[str, Number]
    binding: dict[str, int]
    by_surface: tuple[dict[str, Any], ...]
    probability: tuple[ChancePixels, ...] | UnsetType = UNSET


class MendKeys(Struct, frozen=True):
    """Line of JSON that mends a definition, and the place for it."""

    where: str
    line: str


class RangeKeys(Struct, frozen=True):
    """Range of a figure of a surface."""

    surface: str
    key: str
    low: float
    high: float


class SamplingKeys(Struct, frozen=True):
    """Sampling of soils that are ranges."""

    samples: int
    seed: int
    error: Number
    ranges: tuple[RangeKeys, ...]


class ReportKeys(Document, frozen=True, kw_only=True):
    """Report on one vehicle."""

    format_version: int = FORMAT_VERSION
    tool: Tool = Tool()
    terrain: TerrainKeys
    vehicle: VehicleKeys
    model: str
    verdict: str
    sentence: str
    surfaces: tuple[SurfaceKeys, ...]
    mending: tuple[MendKeys, ...]
    map: MapKeys | None
    routes: tuple[RouteKeys, ...]
    reach: ReachKeys | None
    notes: tuple[str, ...]
    assumptions: tuple[str, ...]
    sampling: SamplingKeys | UnsetType = UNSET


class VehicleVerdict(Struct, frozen=True):
    """Verdict of one of several vehicles on the terrain."""

    vehicle: str
    drives: bool
    verdict: str


class SurfaceVerdict(Struct, frozen=True):
    """Verdict and climb of one of several vehicles on a surface, out of its report."""

    vehicle: str
    verdict: str
    binding: Text
    climb_deg: Number
    climb_binding: Text


class SurfaceVerdicts(Struct, frozen=True):
    """Verdicts of all vehicles on a surface."""

    surface: str
    vehicles: tuple[SurfaceVerdict, ...]


class RouteVerdict(Struct, frozen=True):
    """Result of one of several vehicles on a route, out of its report."""

    vehicle: str
    found: bool
    verdict: str
    length_m: Number
    time_s: Number
    energy_J: Number
    tightest: TightestKeys | None
    barriers: tuple[BarrierKeys, ...]


class RouteVerdicts(Struct, frozen=True):
    """Results of all vehicles on a route."""

    start: PlaceKeys
    goal: PlaceKeys
    vehicles: tuple[RouteVerdict, ...]


class MapShares(Struct, frozen=True):
    """Shares of ground in each class for one of several vehicles, out of its report."""

    vehicle: str
    resolution_m: Number
    fractions: dict[str, Number]


class TogetherKeys(Struct, frozen=True):
    """Share of the ground that is go or caution for exactly these vehicles."""

    vehicles: tuple[str, ...]
    share: Number


class MapComparisonKeys(Struct, frozen=True):
    """Maps of several vehicles side by side."""

    one_grid: bool
    vehicles: tuple[MapShares, ...]
    together: tuple[TogetherKeys, ...]


class ComparisonKeys(Document, frozen=True, kw_only=True):
    """Several vehicles side by side, as schemas/comparison.schema.json has them."""

    format_version: int = FORMAT_VERSION
    tool: Tool = Tool()
    verdict: str
    sentence: str
    vehicles: tuple[VehicleVerdict, ...]
    surfaces: tuple[SurfaceVerdicts, ...]
    routes: tuple[RouteVerdicts, ...]
    map: MapComparisonKeys | None
    notes: tuple[str, ...]
    reports: tuple[ReportKeys, ...]


def as_dict(reports: Reports) -> dict[str, Any]:
    """Report, or comparison with its reports, as dictionaries, lists, texts and finite numbers.

    Units are in the names of keys; numbers that are unknown, infinite or without meaning are None.
    """
    return plain_document(_document(reports))


def as_json(reports: Reports) -> str:
    """Report, or comparison with its reports, as the text of a JSON file."""
    return json_text(_document(reports)) + "\n"


def _document(reports: Reports) -> ReportKeys | ComparisonKeys:
    if isinstance(reports, VehicleComparison):
        return _comparison(reports)
    return _report(reports)


def _report(report: TraversabilityReport) -> ReportKeys:
    sampling = report.sampling
    return ReportKeys(
        terrain=TerrainKeys(report.terrain, report.descr, value_of(report.bounds)),
        vehicle=_vehicle(report.vehicle),
        model=report.vehicle.model,
        verdict=report.verdict.label,
        sentence=wording.conclusion(report),
        surfaces=tuple(fill_keys(SurfaceKeys, one) for one in report.surfaces),
        mending=tuple(MendKeys(place, line) for place, line in wording.mends(report)),
        map=None if report.summary is None else _map(report.summary),
        routes=tuple(fill_keys(RouteKeys, one) for one in report.routes),
        reach=None if report.reach is None else fill_keys(ReachKeys, report.reach),
        notes=report.notes,
        assumptions=report.assumptions,
        sampling=UNSET
        if sampling is None
        else SamplingKeys(
            sampling.samples,
            sampling.seed,
            value_of(sampling.error),
            tuple(RangeKeys(*one) for one in sampling.ranges),
        ),
    )


def _vehicle(vehicle: Vehicle) -> VehicleKeys:
    found = fill_keys(VehicleKeys, vehicle)
    if vehicle.is_single:
        return structs.replace(found, mass_kg=None, gravity_m_s2=None)
    return found


def _map(summary: MapSummary) -> MapKeys:
    grid, chances = summary.grid, summary.chances
    return MapKeys(
        resolution_m=value_of(grid.resolution),
        width=grid.width,
        height=grid.height,
        bounds=value_of(grid.bounds),
        headings=summary.headings,
        start=value_of(summary.start),
        largest_part=value_of(summary.largest, nested=LargestPartKeys),
        pixels=summary.pixels,
        best_heading=_counts(summary.counts),
        worst_heading=_counts(summary.worst_counts),
        fractions={one.label: value_of(summary.fraction(one)) for one in wording.GROUNDS},
        binding={
            reason.label: count
            for reason, count in sorted(summary.reasons.items())
            if count and reason != Reason.NONE
        },
        by_surface=tuple(
            {"surface": name or None, **_counts(counts)}
            for name, counts in summary.by_surface.items()
        ),
        probability=UNSET
        if chances is None
        else tuple(ChancePixels(bound, count) for bound, count in chances.items()),
    )


def _counts(counts: dict[GroundClass, int]) -> dict[str, int]:
    return {ground.label: counts.get(ground, 0) for ground in wording.GROUNDS}


def _comparison(found: VehicleComparison) -> ComparisonKeys:
    reports = tuple(map(_report, found.reports))
    names = [one.vehicle.name for one in reports]
    surfaces = zip(*(one.surfaces for one in reports), strict=True)
    routes = zip(*(one.routes for one in reports), strict=True)
    return ComparisonKeys(
        verdict=found.verdict.label,
        sentence=comparison.conclusion(found),
        vehicles=tuple(
            VehicleVerdict(name, one.drives, one.verdict.label)
            for name, one in zip(names, found.reports, strict=True)
        ),
        surfaces=tuple(
            SurfaceVerdicts(row[0].surface, _pick(SurfaceVerdict, names, row)) for row in surfaces
        ),
        routes=tuple(
            RouteVerdicts(row[0].start, row[0].goal, _pick(RouteVerdict, names, row))
            for row in routes
        ),
        map=_maps(found, names, [one.map for one in reports if one.map is not None]),
        notes=found.notes,
        reports=reports,
    )


def _maps(
    found: VehicleComparison, names: Sequence[str], maps: Sequence[MapKeys]
) -> MapComparisonKeys | None:
    if len(maps) < len(names):
        return None
    grids = {(one.resolution_m, one.width, one.height, one.bounds) for one in maps}
    return MapComparisonKeys(
        one_grid=len(grids) == 1,
        vehicles=_pick(MapShares, names, maps),
        together=tuple(
            TogetherKeys(vehicles, value_of(share))
            for vehicles, share in comparison.together(found)
        ),
    )


def _pick(kind: type[Kind], names: Sequence[str], row: Sequence[Struct]) -> tuple[Kind, ...]:
    """Records of a type, one for each vehicle's name, with keys of the records in a row."""
    _, *keys = kind.__struct_fields__
    return tuple(
        kind(name, *(getattr(one, key) for key in keys))
        for name, one in zip(names, row, strict=True)
    )
