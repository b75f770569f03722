"""A report as JSON: records whose fields are its keys, as schemas/report.schema.json has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from msgspec import UNSET, Meta, Struct, UnsetType

from terratool.definition.findings import Bounds
from terratool.definition.model import Range
from terratool.report.documents import (
    Count,
    Document,
    Share,
    Tool,
    json_text,
    one_of,
    plain_document,
)
from terratool.traversability.report import comparison, wording
from terratool.traversability.report.comparison_keys import (
    MapComparisonKeys,
    MapShares,
    RouteVerdict,
    RouteVerdicts,
    SurfaceVerdict,
    SurfaceVerdicts,
    TogetherKeys,
    VehicleVerdict,
)
from terratool.traversability.report.keys import (
    Kind,
    Metres,
    SquareMetres,
    VerdictText,
    fill_keys,
    value_of,
)
from terratool.traversability.report.map_keys import MapKeys, keys_of_map
from terratool.traversability.report.route_keys import ReachKeys, RouteKeys
from terratool.traversability.report.surface_keys import SurfaceKeys
from terratool.traversability.report.vehicle_keys import VehicleKeys, keys_of_vehicle
from terratool.traversability.results import Reports, TraversabilityReport, VehicleComparison
from terratool.traversability.vehicle import MODELS

FORMAT_VERSION = 3


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


class ZoneKeys(Struct, frozen=True):
    """A zone that the vehicle keeps out of.

    Attributes:
        name: name of the zone.
        area_m2: area of the zone.
    """

    name: str
    area_m2: SquareMetres


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
        vehicle=keys_of_vehicle(report.vehicle),
        model=report.vehicle.model,
        verdict=report.verdict.label,
        sentence=wording.conclusion(report),
        surfaces=tuple(fill_keys(SurfaceKeys, one) for one in report.surfaces),
        mending=tuple(MendKeys(place, line) for place, line in wording.mends(report)),
        map=None if report.summary is None else keys_of_map(report.summary),
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
