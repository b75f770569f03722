"""A report as JSON: records whose fields are its keys, as schemas/report.schema.json has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from msgspec import UNSET, Meta, Struct, UnsetType, structs

from terratool.definition.findings import Bounds
from terratool.definition.model import Pair, Range
from terratool.definition.vehicle import STEERINGS
from terratool.report.documents import (
    Count,
    Document,
    Share,
    Tool,
    each_of,
    json_text,
    one_of,
    plain_document,
)
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
    Numbers,
    ReasonText,
    ResultMember,
    Seconds,
    SquareMetres,
    Text,
    VerdictText,
    WattHours,
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
from terratool.traversability.vehicle import GEARS, MODELS, Vehicle

FORMAT_VERSION = 3

_GROUNDS = [one.label for one in wording.GROUNDS]
Fractions = Annotated[dict[str, Share], each_of(_GROUNDS)]
"""Shares of the ground by class."""
_MAPPED_REASONS = Meta(
    extra_json_schema={
        "propertyNames": one_of(
            one.label for one in Reason if one not in (Reason.NONE, Reason.TURNING)
        ).extra_json_schema
    }
)
_OF_A_SURFACE = Meta(
    extra_json_schema={
        **(each_of(["surface", *_GROUNDS]).extra_json_schema or {}),
        "properties": {"surface": {"type": ["string", "null"]}},
        "additionalProperties": {"type": "integer", "minimum": 0},
    }
)
"""Restriction of the numbers of pixels of a surface, whose name is the first key."""


class TerrainKeys(Struct, frozen=True):
    """Terrain of a report.

    Attributes:
        file: name of the definition's file, without its folder.
        descr: description of the terrain; empty for none.
        bounds: west, south, east, north, in world units.
    """

    file: str
    descr: str
    bounds: Bounds


class PlaceKeys(Struct, frozen=True):
    """Place on the terrain."""

    x: float
    y: float
    z: Annotated[float | None, ResultMember("height")]
    surface: Text
    element: Text


class WheelKeys(Struct, frozen=True):
    """Wheel of a vehicle."""

    radius_m: Metres
    width_m: Metres
    grouser_height_m: Annotated[Metres, Meta(ge=0)]
    contact_length_m: Annotated[Metres, Meta(ge=0)]
    patch_pressure_kPa: Kilopascals | None
    tread_m: Annotated[Metres, Meta(ge=0)]
    max_torque_Nm: NewtonMetres | None
    max_slip: Share


class AxleKeys(Struct, frozen=True):
    """Axle: wheels side by side, or a section of both tracks, or a pair of feet."""

    x_m: Metres
    wheels: Annotated[int, Meta(ge=1)]
    driven: bool
    wheel: WheelKeys | None


class TracksKeys(Struct, frozen=True):
    """Tracks of a vehicle."""

    length_m: Metres
    width_m: Metres
    radius_m: Metres
    front_height_m: Metres
    approach_deg: Degrees
    max_torque_Nm: NewtonMetres | None


class FeetKeys(Struct, frozen=True):
    """Feet of a vehicle."""

    diameter_m: Metres
    reach_m: Annotated[Metres, Meta(ge=0)]
    step_height_m: Metres
    bearing: Annotated[int, Meta(ge=1)]


class OverhangKeys(Struct, frozen=True):
    """Overhang of the body beyond an outermost axle."""

    length_m: Metres
    height_m: Metres | None


class MarginKeys(Struct, frozen=True):
    """Margins that are kept in reserve."""

    clearance_m: Metres
    step_m: Metres
    tip_deg: Degrees
    slope_deg: Degrees
    soil_deg: Degrees


class ThresholdKeys(Struct, frozen=True):
    """Limits at which go ends and caution ends."""

    utilisation: float
    slip: float
    caution_slip: float
    torque: float
    geometry: float
    drift_deg: Degrees
    caution_drift_deg: Degrees


class LoadKeys(Struct, frozen=True):
    """Load of a vehicle.

    Attributes:
        mass_kg: mass of all.
        cog_ahead_m: distance of the centre of gravity ahead of that of the vehicle.
    """

    mass_kg: Kilograms
    cog_height_m: Metres
    cog_ahead_m: Annotated[float, ResultMember("ahead")]


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


class BatteryKeys(Struct, frozen=True):
    """Battery of a vehicle.

    Attributes:
        capacity_Wh: energy of a full charge.
        reserve: share of a charge that is not to be used.
    """

    capacity_Wh: WattHours
    reserve: Share


class VehicleKeys(Struct, frozen=True):
    """Vehicle, or a wheel by itself, which has neither mass nor gravity."""

    name: str
    single_wheel: Annotated[bool, ResultMember("is_single")]
    mass_kg: Kilograms | None
    gravity_m_s2: MetresPerSquareSecond | None
    weight_N: Newtons
    wheel: WheelKeys
    axles: Annotated[tuple[AxleKeys, ...], Meta(min_length=1)]
    track_m: Annotated[float, ResultMember("track_width")]
    cog_height_m: Metres
    clearance_m: Metres | None
    body_width_m: Metres
    front: OverhangKeys
    rear: OverhangKeys
    loads: tuple[LoadKeys, ...]
    steering: Annotated[str, one_of(STEERINGS)]
    turning_radius_m: Metres
    speed_m_s: MetresPerSecond
    power_W: Watts
    max_drift_m: Metres | None
    efficiency: Share
    battery: BatteryKeys | None
    stopping_distance_m: Metres | None
    reaction_time_s: Seconds
    gear: Annotated[str, one_of(GEARS)]
    tracks: TracksKeys | None
    feet: FeetKeys | None
    margins: MarginKeys
    classes: Annotated[ThresholdKeys, ResultMember("thresholds")]


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


class BarrierKeys(Struct, frozen=True):
    """Barrier on a route."""

    binding: Binding
    bars: str
    width_m: Metres | None
    place: PlaceKeys


class SteepestKeys(Struct, frozen=True):
    """Steepest place of a route.

    Attributes:
        pitch_deg: pitch of the vehicle; nose up is positive.
    """

    pitch_deg: Annotated[float | None, ResultMember("value", factor=DEG)]
    binding: Binding
    place: PlaceKeys


class SoftestKeys(Struct, frozen=True):
    """Place of a route where wheels sink deepest.

    Attributes:
        sinkage_m: sinkage of the wheel that sinks deepest.
    """

    sinkage_m: Annotated[float | None, ResultMember("value")]
    binding: Binding
    place: PlaceKeys


class TightestKeys(Struct, frozen=True):
    """Place of a route with the smallest margin.

    Attributes:
        margin: 1 less the share that is used of the nearest limit; None where nothing would help.
    """

    margin: Annotated[float | None, ResultMember("value")]
    binding: Binding
    place: PlaceKeys


class DriftKeys(Struct, frozen=True):
    """Place of a route up to which a vehicle drifts farthest if nobody steers against it.

    Attributes:
        drift_m: distance from the line, downhill, since the last corner.
    """

    drift_m: Annotated[float, ResultMember("value")]
    place: PlaceKeys


class CrabKeys(Struct, frozen=True):
    """Place of a route where a vehicle has to head farthest uphill to hold its line.

    Attributes:
        crab_deg: angle between where it heads and where it moves.
    """

    crab_deg: Annotated[float, ResultMember("value", factor=DEG)]
    place: PlaceKeys


class LeastChanceKeys(Struct, frozen=True):
    """Place of a route with the smallest probability of go.

    Attributes:
        probability: share of the samples that are go there.
    """

    probability: Annotated[Share, ResultMember("value")]
    place: PlaceKeys


class ProfileKeys(Struct, frozen=True):
    """Samples along a route; all lists are of one length.

    Attributes:
        verdict: verdict of each sample.
        crab_deg: how far to the left of its way it heads to hold its line; below 0 to the right.
        drift_m: how far to the left of its line it drifts since the last corner, if nobody steers
            against it; below 0 to the right.
        binding: measure that binds at each sample.
    """

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
    verdict: Annotated[tuple[VerdictText, ...], ResultMember(codes=Verdict)]
    binding: Annotated[tuple[ReasonText | None, ...], ResultMember("reason", codes=Reason)]
    surface: tuple[Text, ...]
    element: tuple[Text, ...]
    crab_deg: ManyDegrees
    drift_m: ManyMetres
    tip_reserve_deg: Annotated[Numbers, ResultMember("reserve", factor=DEG)]
    stopping_m: ManyMetres
    speed_m_s: Annotated[Numbers, ResultMember("speed")]
    time_s: Annotated[Numbers, ResultMember("time")]
    energy_J: Annotated[Numbers, ResultMember("energy")]


class EmptiedKeys(Struct, frozen=True):
    """Place where a battery is empty.

    Attributes:
        distance_m: way up to there, seen from above.
    """

    distance_m: Annotated[float, ResultMember("value")]
    place: PlaceKeys


class ChargeKeys(Struct, frozen=True):
    """Charge that a route uses, there and, where that was asked for, back.

    Attributes:
        energy_Wh: energy of all of it.
        share: share of a full charge; above 1 where the battery does not last.
        verdict: caution where the reserve is used, no-go where the battery is empty before the end.
        emptied: place where the battery is empty on the way there.
    """

    energy_Wh: WattHours
    share: float
    verdict: VerdictText
    emptied: EmptiedKeys | None


class StopKeys(Struct, frozen=True):
    """Place of a route with the longest distance to stop from the vehicle's speed.

    Attributes:
        stopping_m: the distance; None where it cannot stop.
    """

    stopping_m: Annotated[float | None, ResultMember("value")]
    place: PlaceKeys


class SlowestKeys(Struct, frozen=True):
    """Place of a route with the least speed that stops in time.

    Attributes:
        speed_m_s: the speed.
    """

    speed_m_s: Annotated[float, ResultMember("value")]
    place: PlaceKeys


class RouteKeys(Struct, frozen=True):
    """Route from a start to a goal, or the barriers where there is none."""

    found: bool
    planned: bool
    verdict: VerdictText
    start: PlaceKeys
    goal: PlaceKeys
    length_m: Metres | None
    time_s: Seconds | None
    energy_J: Joules | None
    turning_J: Joules | None
    steepest: SteepestKeys | None
    softest: SoftestKeys | None
    tightest: TightestKeys | None
    drift: DriftKeys | None
    crab: CrabKeys | None
    drift_total_m: Metres | None
    strays: bool
    barriers: tuple[BarrierKeys, ...]
    reached: PlaceKeys | None
    note: Text
    one_way: bool
    against: tuple[BarrierKeys, ...]
    back: RouteKeys | None
    headings: int
    tried_headings: tuple[int, ...]
    ruled_out_headings: int | None
    charge: ChargeKeys | None
    longest_stop: Annotated[StopKeys | None, ResultMember("stop")]
    slowest: SlowestKeys | None
    load: LoadKeys | None
    all_go_longer_m: Metres | None
    alternatives: tuple[RouteKeys, ...]
    shared: Share | None
    profile: ProfileKeys | None
    probability: Annotated[Share | UnsetType, ResultMember("chance")] = UNSET
    least_probability: Annotated[LeastChanceKeys | UnsetType, ResultMember("least_chance")] = UNSET


class ZoneKeys(Struct, frozen=True):
    """A zone that the vehicle keeps out of.

    Attributes:
        name: name of the zone.
        area_m2: area of the zone.
    """

    name: str
    area_m2: SquareMetres


class ReachKeys(Struct, frozen=True):
    """Ground that can be reached from a place."""

    start: PlaceKeys
    share: Share
    returnable: Share
    note: Text


class LargestPartKeys(Struct, frozen=True):
    """The largest connected part of the ground."""

    place: Pair
    share: Share


class ChancePixels(Struct, frozen=True):
    """Number of pixels that are go with at least a probability.

    Attributes:
        at_least: the probability.
        pixels: number of pixels that reach it and no larger one.
    """

    at_least: Share
    pixels: Count


class MapKeys(Struct, frozen=True, rename={"start": "from"}):
    """Map in numbers: pixels and shares by class of ground.

    The classes are go, caution, no-go, unknown; one-way, which can be driven to from the start, but
    not back; cut-off, which can be driven on, but not to; and edge, which only the end of the
    terrain bars: the vehicle would stand over it, or would have to, to get there and back. The edge
    counts in no other share, and its own is one of all pixels with ground.

    Attributes:
        resolution_m: side of a pixel.
        width, height: number of columns and of rows.
        bounds: west, south, east, north, in world units.
        largest_part: largest part of the ground that can be driven about, if what can be reached is
            counted from it; None where it is counted from another place, or there is none.
        best_heading: pixels by class, with their best heading.
        worst_heading: pixels by class, with the verdict of the worst heading where they are go,
            caution, no-go or unknown.
        fractions: shares of the pixels with ground, but those at the edge, by class, with their
            best heading.
        binding: pixels that are caution or no-go at their best heading, by the measure that binds.
        by_surface: pixels of each surface by class, with their best heading; the name is null for
            ground without a surface.
        probability: pixels with ground by the probability that some heading is go, each counted
            where it reaches most, and none where that is not known; only where figures of soils are
            ranges.
    """

    resolution_m: Annotated[Metres, Meta(gt=0)]
    width: Count
    height: Count
    bounds: Bounds
    headings: Count
    start: Pair | None
    largest_part: LargestPartKeys | None
    pixels: Count
    best_heading: Annotated[dict[str, Count], each_of(_GROUNDS)]
    worst_heading: Annotated[dict[str, Count], each_of(_GROUNDS)]
    fractions: Fractions
    binding: Annotated[dict[str, Annotated[int, Meta(ge=1)]], _MAPPED_REASONS]
    by_surface: tuple[Annotated[dict[str, Any], _OF_A_SURFACE], ...]
    probability: tuple[ChancePixels, ...] | UnsetType = UNSET


class MendKeys(Struct, frozen=True):
    """Line of JSON that mends a definition, and the place for it.

    Attributes:
        where: place in the definition.
        line: line that goes there.
    """

    where: str
    line: str


class SamplingKeys(Struct, frozen=True):
    """Sampling of soils that are ranges, and of errors of heights.

    Attributes:
        height_error_m: standard deviation of heights; None where these are exact.
        correlation_m: length over which errors of heights are correlated.
    """

    samples: Annotated[int, Meta(ge=1)]
    seed: Count
    error: Share
    ranges: tuple[Range, ...]
    height_error_m: Metres | None
    correlation_m: Metres | None


class ReportKeys(Document, frozen=True, kw_only=True):
    """Findings of `terratool traversability` about a vehicle on a terrain.

    Units are in the names of keys; null stands for what is not known, means nothing or has no
    limit.

    Attributes:
        tool: program that wrote the report.
        terrain: the terrain.
        model: model of wheel and soil: slip, or what the paper says.
        sentence: verdict for people, and what binds most.
        mending: lines of JSON that mend what surfaces lack, by an example of a soil; none where
            nothing is lacking.
        map: classes of the ground; None where only routes were asked for.
        sampling: sampling of soils and of errors of heights, only where there are ranges or such
            errors; middles, and heights as they are, count for everything but probabilities.
    """

    format_version: int = FORMAT_VERSION
    tool: Tool = Tool()
    terrain: TerrainKeys
    vehicle: VehicleKeys
    model: Annotated[str, one_of(MODELS)]
    verdict: VerdictText
    sentence: str
    surfaces: tuple[SurfaceKeys, ...]
    mending: tuple[MendKeys, ...]
    map: MapKeys | None
    keep_out: tuple[ZoneKeys, ...]
    routes: tuple[RouteKeys, ...]
    reach: ReachKeys | None
    notes: tuple[str, ...]
    assumptions: tuple[str, ...]
    sampling: SamplingKeys | UnsetType = UNSET


class VehicleVerdict(Struct, frozen=True):
    """Verdict of one of several vehicles on the terrain.

    Attributes:
        vehicle: name of the vehicle's file, with the folder where files have one name.
        drives: whether the verdict is go or caution.
        verdict: verdict of the vehicle's report.
    """

    vehicle: str
    drives: bool
    verdict: VerdictText


class SurfaceVerdict(Struct, frozen=True):
    """Verdict and climb of one of several vehicles on a surface, out of its report.

    Attributes:
        vehicle: name of the vehicle.
    """

    vehicle: str
    verdict: VerdictText
    binding: Binding
    climb_deg: Degrees | None
    climb_binding: ReasonText | None


class SurfaceVerdicts(Struct, frozen=True):
    """Verdicts of all vehicles on a surface.

    Attributes:
        surface: name of the surface.
        vehicles: verdict of each vehicle.
    """

    surface: str
    vehicles: tuple[SurfaceVerdict, ...]


class RouteVerdict(Struct, frozen=True):
    """Result of one of several vehicles on a route, out of its report.

    Attributes:
        vehicle: name of the vehicle.
    """

    vehicle: str
    found: bool
    verdict: VerdictText
    length_m: Metres | None
    time_s: Seconds | None
    energy_J: Joules | None
    tightest: TightestKeys | None
    barriers: tuple[BarrierKeys, ...]


class RouteVerdicts(Struct, frozen=True):
    """Results of all vehicles on a route.

    Attributes:
        start, goal: first and last place.
        vehicles: result of each vehicle.
    """

    start: PlaceKeys
    goal: PlaceKeys
    vehicles: tuple[RouteVerdict, ...]


class MapShares(Struct, frozen=True):
    """Shares of ground in each class for one of several vehicles, out of its report.

    Attributes:
        vehicle: name of the vehicle.
    """

    vehicle: str
    resolution_m: Metres
    fractions: Fractions


class TogetherKeys(Struct, frozen=True):
    """Share of the ground that is go or caution for exactly these vehicles.

    Attributes:
        vehicles: names of the vehicles; none for ground that is neither for any.
        share: share of the ground that is at the edge for none of the vehicles.
    """

    vehicles: tuple[str, ...]
    share: Share


class MapComparisonKeys(Struct, frozen=True):
    """Maps of several vehicles side by side.

    Attributes:
        one_grid: whether all maps have the same pixels.
        vehicles: map of each vehicle.
        together: ground that is go or caution for some vehicles and for no others, the most first;
            empty where there is no grid of all. Of a map of more than 1600 pixels along a side one
            of each few along it is counted.
    """

    one_grid: bool
    vehicles: tuple[MapShares, ...]
    together: tuple[TogetherKeys, ...]


class ComparisonKeys(Document, frozen=True, kw_only=True):
    """Findings about several vehicles on one terrain, side by side, and the report of each.

    Units are in the names of keys; null stands for what is not known, means nothing or has no
    limit.

    Attributes:
        tool: program that wrote the report.
        verdict: verdict of the worst of the vehicles: no-go, unknown, caution, go.
        sentence: statement for people on which of the vehicles can drive there.
        vehicles: verdict of each vehicle, in the order in which they were given, as everywhere.
        surfaces: a row for each surface of the terrain.
        routes: a row for each way that was asked for.
        map: the maps of all; None where only routes were asked for.
        reports: report of each vehicle, as it would be by itself on that grid.
    """

    format_version: int = FORMAT_VERSION
    tool: Tool = Tool()
    verdict: VerdictText
    sentence: str
    vehicles: Annotated[tuple[VehicleVerdict, ...], Meta(min_length=2)]
    surfaces: tuple[SurfaceVerdicts, ...]
    routes: tuple[RouteVerdicts, ...]
    map: MapComparisonKeys | None
    notes: tuple[str, ...]
    reports: Annotated[tuple[ReportKeys, ...], Meta(min_length=2)]


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
        keep_out=tuple(ZoneKeys(zone.name, float(zone.shape.area)) for zone in report.keep_out),
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
            sampling.ranges,
            value_of(sampling.height_error),
            value_of(sampling.correlation),
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
