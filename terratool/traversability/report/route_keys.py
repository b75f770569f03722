"""Keys of reports about routes and reach."""

from __future__ import annotations

from typing import Annotated

from msgspec import UNSET, Struct, UnsetType

from terratool.report.documents import (
    Share,
)
from terratool.traversability.report.keys import (
    DEG,
    Binding,
    Joules,
    ManyDegrees,
    ManyMetres,
    Metres,
    Numbers,
    ReasonText,
    ResultMember,
    Seconds,
    Text,
    VerdictText,
    WattHours,
)
from terratool.traversability.report.vehicle_keys import LoadKeys
from terratool.traversability.verdicts import Reason, Verdict


class PlaceKeys(Struct, frozen=True):
    """Place on the terrain."""

    x: float
    y: float
    z: Annotated[float | None, ResultMember("height")]
    surface: Text
    element: Text


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


class ReachKeys(Struct, frozen=True):
    """Ground that can be reached from a place."""

    start: PlaceKeys
    share: Share
    returnable: Share
    note: Text
