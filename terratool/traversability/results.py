"""Results about a vehicle, or several, on a terrain: reports."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from terratool.definition.model import Range
from terratool.report.wording import count_of
from terratool.text.display import printable
from terratool.traversability.figures import Figures
from terratool.traversability.keep_out import Zone
from terratool.traversability.map_results import MapSummary, Preview
from terratool.traversability.route.results import Reach, Route
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import RANKS, Verdict


@dataclass(frozen=True, slots=True)
class Sampling:
    """Sampling of the figures of soils that are ranges, and of errors of heights.

    Attributes:
        samples: number of samples.
        seed: seed of the generator.
        error: largest error of a share of the samples, at 95 % confidence.
        ranges: ranges that were sampled, every value in them equally likely.
        height_error: standard deviation of heights, m; None where heights are exact.
        correlation: correlation length of errors of heights, m; None for exact ones.
    """

    samples: int
    seed: int
    error: float
    ranges: tuple[Range, ...]
    height_error: float | None = None
    correlation: float | None = None


@dataclass(frozen=True, slots=True)
class TraversabilityReport:
    """The results of one run for a vehicle on a terrain.

    Attributes:
        terrain: name of the definition's file.
        descr: description of the terrain.
        bounds: west, south, east, north of the terrain, m.
        vehicle: the vehicle.
        surfaces: figures of each surface.
        summary: the map in numbers; None where only routes were asked for.
        verdict: verdict of the worst route; without routes, of the map: go where all of the ground
            is, caution where some of it is go or caution, unknown where nothing is known, else
            no-go. The edge does not count.
        routes: routes and checked waypoints, in the order of the request.
        reach: ground that can be reached; None where it was not asked for.
        preview: the map, coarse enough for a picture; None where no map is wanted.
        assumptions: assumptions of the models, in sentences.
        notes: sentences on how the results were computed: resolutions, and why.
        geojson: a feature collection without features, with the terrain's reference system.
        sampling: sampling of the soils; None where no figures are ranges.
        keep_out: zones that the vehicle keeps out of.
    """

    terrain: str
    descr: str
    bounds: tuple[float, float, float, float]
    vehicle: Vehicle
    surfaces: tuple[Figures, ...]
    summary: MapSummary | None
    verdict: Verdict
    routes: tuple[Route, ...] = ()
    reach: Reach | None = None
    preview: Preview | None = None
    assumptions: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    geojson: dict[str, Any] = field(default_factory=lambda: {"type": "FeatureCollection"})
    sampling: Sampling | None = None
    keep_out: tuple[Zone, ...] = ()

    def __repr__(self) -> str:
        about = " on ".join(printable(name) for name in (self.vehicle.name, self.terrain) if name)
        ways = f", {count_of(len(self.routes), 'way')}" if self.routes else ""
        return f"<TraversabilityReport{' of ' if about else ''}{about}: {self.verdict}{ways}>"

    @property
    def drives(self) -> bool:
        """Whether the vehicle can drive: the verdict is go or caution."""
        return self.verdict in (Verdict.GO, Verdict.CAUTION)

    @property
    def reports(self) -> tuple[TraversabilityReport]:
        """The report alone, in a tuple, for functions that also take a `VehicleComparison`."""
        return (self,)


@dataclass(frozen=True, slots=True)
class VehicleComparison:
    """Reports of several vehicles of which the same was asked on one terrain, one or more.

    Attributes:
        reports: one for each vehicle, in the order in which they were given.
        notes: sentences on the grids of all vehicles.
    """

    reports: tuple[TraversabilityReport, ...]
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        each = (f"{printable(one.vehicle.name)} {one.verdict}" for one in self.reports)
        return f"<VehicleComparison: {', '.join(each)}>"

    @property
    def verdict(self) -> Verdict:
        """Worst verdict of all vehicles."""
        return max((one.verdict for one in self.reports), key=RANKS.__getitem__)

    @property
    def terrain(self) -> str:
        """Name of the definition's file."""
        return self.reports[0].terrain

    @property
    def descr(self) -> str:
        """Description of the terrain."""
        return self.reports[0].descr


Reports = TraversabilityReport | VehicleComparison
"""Results for one vehicle, or for several; both have `reports`."""
