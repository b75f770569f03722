"""Keys of reports that hold several vehicles side by side."""

from __future__ import annotations

from msgspec import Struct

from terratool.report.documents import (
    Share,
)
from terratool.traversability.report.keys import (
    Binding,
    Degrees,
    Joules,
    Metres,
    ReasonText,
    Seconds,
    VerdictText,
)
from terratool.traversability.report.map_keys import Fractions
from terratool.traversability.report.route_keys import BarrierKeys, PlaceKeys, TightestKeys


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
