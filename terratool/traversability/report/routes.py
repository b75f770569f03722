"""Routes as GeoJSON features: the whole route, stretches of one ground, and places."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from terratool._version import __version__
from terratool.report.documents import json_text
from terratool.report.numbers import exact
from terratool.traversability.keep_out import Zone
from terratool.traversability.results import Reports, TraversabilityReport
from terratool.traversability.route.drifting import corridor
from terratool.traversability.route.results import Barrier, Location, Route, RouteProfile
from terratool.traversability.verdicts import Reason, Verdict

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Feature = dict[str, Any]


def as_geojson(reports: Reports) -> str:
    """Routes as the text of a GeoJSON file, a line for each feature.

    With several vehicles, each feature names its vehicle.
    """
    found = []
    for one in reports.reports:
        own = {} if isinstance(reports, TraversabilityReport) else {"vehicle": one.vehicle.name}
        found += [
            {**feature, "properties": {**own, **feature["properties"]}}
            for feature in route_features(one.routes)
        ]
    found += [_zone(zone) for zone in reports.reports[0].keep_out]
    head = {**reports.reports[0].geojson, "terratool": __version__}
    lines = ",\n".join(json_text(feature, None) for feature in found)
    return f'{json_text(head, None)[:-1]}, "features": [\n{lines}\n]}}\n'


def route_features(routes: Sequence[Route]) -> Iterator[Feature]:
    """Yield features of routes, of their stretches, and of their places.

    `kind` of a feature is "route", "stretch" (of one surface, element, verdict and reason),
    "drift" (the ground between the route and where it drifts to), "start", "goal", or "barrier".
    `route` counts the routes from 1, and `alternative` those of a route; a way back has `back`.
    Coordinates are those of the terrain. Unknown values are null.
    """
    for number, route in enumerate(routes, 1):
        yield from _features(route, {"route": number, "back": False})
        for other, way in enumerate(route.alternatives, 1):
            own = {"route": number, "back": False, "alternative": other}
            yield from _features(way, own)
        if route.back is not None:
            yield from _features(route.back, {"route": number, "back": True})


def _zone(zone: Zone) -> Feature:
    """Feature of a keep-out zone: its area, corridors as wide as they are."""
    return _feature(_area(zone.shape), {"kind": "keep-out", "name": zone.name})


def _area(shape: BaseGeometry) -> dict[str, Any]:
    """The geometry of polygons; outlines run anticlockwise, those of holes clockwise (RFC 7946)."""
    import shapely
    from shapely.geometry.polygon import orient

    parts = [orient(part) for part in shapely.get_parts(shape).tolist()]
    one = shape.geom_type == "Polygon"
    return dict(shapely.geometry.mapping(parts[0] if one else shapely.MultiPolygon(parts)))


def _features(route: Route, own: dict[str, Any]) -> Iterator[Feature]:
    yield _feature(_line(route), {"kind": "route", **own, **_summary(route)})
    if route.profile is not None:
        yield from _stretches(route.profile, own)
        yield from _strip(route, own)
    for kind, place in (("start", route.start), ("goal", route.goal)):
        yield _feature(_point(place), {"kind": kind, **own, **_ground(place)})
    for bar in route.barriers:
        yield _barrier(bar, "barrier", own)
    for bar in route.against:
        yield _barrier(bar, "barrier back", own)


def _summary(route: Route) -> dict[str, Any]:
    chances = {}
    if route.least_chance is not None:
        least = exact(route.least_chance.value)
        chances = {"probability": exact(route.chance), "least_probability": least}
    return {
        "found": route.found,
        "verdict": route.verdict.label,
        "one_way": route.one_way,
        "headings": route.headings,
        "length_m": exact(route.length),
        "time_s": exact(route.time),
        "energy_J": exact(route.energy),
        "turning_J": exact(route.turning),
        "drift_m": exact(route.drift.value) if route.drift else None,
        "drift_total_m": exact(route.drift_total),
        "charge": None if route.charge is None else exact(route.charge.share),
        "note": route.note or None,
        **({} if route.shared is None else {"shared": exact(route.shared)}),
        **chances,
    }


def _stretches(profile: RouteProfile, own: dict[str, Any]) -> Iterator[Feature]:
    """Features of the stretches; a leg belongs to the ground at its beginning."""
    keys = list(
        zip(profile.surface, profile.element, profile.verdict.tolist(), profile.reason.tolist(),
            strict=True)
    )  # fmt: skip
    last = len(keys) - 1
    begin = 0
    for end in range(1, last + 1):
        if end < last and keys[end] == keys[begin]:
            continue
        surface, element, verdict, reason = keys[begin]
        part = slice(begin, end + 1)
        if profile.distance[end] > profile.distance[begin]:
            yield _feature(
                _line_of(profile, part),
                {
                    "kind": "stretch", **own, "surface": surface or None,
                    "pointer": element or None, "verdict": Verdict(verdict).label,
                    "binding": None if reason == Reason.NONE else Reason(reason).label,
                    "from_m": exact(float(profile.distance[begin])),
                    "to_m": exact(float(profile.distance[end])),
                    "utilisation": _largest(profile.utilisation[part]),
                    "sinkage_m": _largest(profile.sinkage[part]),
                    "slip": _largest(profile.slip[part]),
                },
            )  # fmt: skip
        begin = end


def _strip(route: Route, own: dict[str, Any]) -> Iterator[Feature]:
    """The feature of the ground between a route and where it drifts to; none if it hardly does."""
    import shapely

    assert route.profile is not None
    # an outline crosses itself where the drift changes sides, the ground between two samples hardly
    pieces = [
        shapely.convex_hull(
            shapely.multipoints(np.stack([line[:-1], line[1:], aside[1:], aside[:-1]], axis=1))
        )
        for outline in corridor(route.profile)
        for line, aside in [(outline[: len(outline) // 2], outline[len(outline) // 2 :][::-1])]
    ]
    if pieces and route.drift is not None:
        strip = shapely.union_all(np.concatenate(pieces))
        uphill = None if route.crab is None else exact(math.degrees(route.crab.value))
        yield _feature(
            _area(shapely.MultiPolygon([one for one in shapely.get_parts(strip) if one.area > 0])),
            {"kind": "drift", **own, "drift_m": exact(route.drift.value), "crab_deg": uphill},
        )


def _barrier(bar: Barrier, kind: str, own: dict[str, Any]) -> Feature:
    found = {"binding": bar.reason.label, "bars": bar.bars, "width_m": exact(bar.width)}
    return _feature(_point(bar.place), {"kind": kind, **own, **found, **_ground(bar.place)})


def _ground(place: Location) -> dict[str, Any]:
    return {
        "z": exact(place.height), "surface": place.surface or None,
        "pointer": place.element or None,
    }  # fmt: skip


def _line(route: Route) -> dict[str, Any] | None:
    return None if route.profile is None else _line_of(route.profile, slice(None))


def _line_of(profile: RouteProfile, part: slice) -> dict[str, Any] | None:
    """Line through different places of a part of a profile; None for fewer than two."""
    heights = [0.0 if math.isnan(z) else z for z in profile.height[part].tolist()]
    points = np.column_stack([profile.x[part], profile.y[part], heights]).tolist()
    line = [point for n, point in enumerate(points) if n == 0 or point[:2] != points[n - 1][:2]]
    return {"type": "LineString", "coordinates": line} if len(line) > 1 else None


def _point(place: Location) -> dict[str, Any]:
    height = [] if place.height is None else [place.height]
    return {"type": "Point", "coordinates": [place.x, place.y, *height]}


def _feature(geometry: dict[str, Any] | None, properties: dict[str, Any]) -> Feature:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _largest(values: Any) -> float | None:
    return None if np.isnan(values).all() else exact(float(np.nanmax(values)))
