"""Comparison of two definitions: texts first, then the ground, only where it can differ."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec import UNSET, UnsetType, structs

from terratool.definition.findings import Bounds
from terratool.errors import DefinitionError, RequestError
from terratool.field.terrain import Terrain
from terratool.io.crs import shown_crs
from terratool.raster.geotiff import crs_of
from terratool.report.wording import count_of
from terratool.traversability.route.headings import Progress
from terratool.traversability.vehicle import Vehicle
from terratool.viewing.diff.ground import Both, area_of, common_bounds, compare_ground
from terratool.viewing.diff.regions import intersection, reaches, track_reach, users
from terratool.viewing.diff.results import (
    Difference,
    GroundChange,
    KeyChange,
    StoreyChange,
    VerdictChange,
)
from terratool.viewing.diff.sides import DiffSide, surface_key
from terratool.viewing.diff.storeys import compare_storeys
from terratool.viewing.diff.texts import TextDifference, compare_texts
from terratool.viewing.diff.verdicts import compare_verdicts

TOLERANCE = 1e-3
"""Default tolerance, m: heights that differ by no more do not count as changed ground."""


@dataclass(frozen=True, slots=True)
class DiffOptions:
    """Options of a comparison.

    Attributes:
        min_change: largest difference of heights that does not count as changed ground.
        bounds: world rectangle of the ground to compare; None for all.
        resolution: side of a pixel; None to choose it.
        vehicles: vehicles whose verdicts are compared.
        everywhere: whether ground is compared even where nothing can differ; for tests.
    """

    min_change: float = TOLERANCE
    bounds: Bounds | None = None
    resolution: float | None = None
    vehicles: tuple[Vehicle, ...] = ()
    everywhere: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.min_change < math.inf:
            raise RequestError(f"--min-change is {self.min_change:g}.", "Give a number from 0 on.")


@dataclass(frozen=True, slots=True)
class ComparedDefinitions:
    """Differences between two definitions, and the terrains for pictures and maps.

    Attributes:
        difference: differences for reports.
        both: both terrains; None where their ground cannot be compared.
    """

    difference: Difference
    both: Both | None


def diff(
    old: DiffSide,
    new: DiffSide,
    options: DiffOptions | None = None,
    progress: Progress | None = None,
) -> ComparedDefinitions:
    """Compare two definitions.

    Two definitions are the same terrain if everything that makes heights, surfaces, soils and
    places is equal, however it is written. Names, descriptions and unused entries do not count.

    Args:
        old: old definition.
        new: new definition.
        options: options; the defaults if None.
        progress: progress that names each step; None for none.

    Raises:
        RequestError: bounds or resolution make no grid, or a vehicle cannot be asked there.
    """
    options = options or DiffOptions()
    frame, notes = _frame(old, new)
    texts = compare_texts(old, new)
    differs = bool(frame) or not texts.is_empty
    notes += texts.notes
    if differs and not frame and _is_one_field(old, new):
        what = count_of(texts.places, "place")
        notes.append(f"It is written otherwise in {what}, and means the same to the last bit.")
        texts, differs = TextDifference(structs.replace(texts.entries, changes=())), False
    bounds = common_bounds(old.ground, new.ground, options.bounds)
    ground: GroundChange | None = None
    verdicts: tuple[VerdictChange, ...] = ()
    both: Both | None = None
    if bounds is None:
        notes.append("The two have no ground in common.")
    elif any(key.key == "crs" and key.old and key.new for key in frame):
        notes.append("The ground is not compared, as the two have different reference systems.")
    else:
        regions: Any = None if options.everywhere else _regions(old, new, texts, bool(frame))
        surfaces = texts.entries.names.surfaces
        whole = old.terrain, new.terrain
        both = Both(
            old.ground, new.ground, bounds, regions, surfaces,
            None if all(one.storeys is None for one in whole) else whole,
        )  # fmt: skip
    if options.vehicles:
        notes += [
            f"Verdicts on the {which} terrain: {sentence}"
            for which, side in (("old", old), ("new", new))
            for sentence in side.ground.hidden
        ]
    storeys: tuple[StoreyChange, ...] | UnsetType = UNSET
    if differs and both is not None:
        if progress is not None:
            progress.say("comparing the ground")
        ground = compare_ground(both, tolerance=options.min_change, resolution=options.resolution)
        ground = _with_outside(ground, both, options.bounds)
        if both.whole is not None:
            storeys = compare_storeys(
                *both.whole, bounds=both.bounds, regions=both.regions, tolerance=options.min_change
            )
        verdicts = tuple(
            compare_verdicts(
                old.ground, new.ground, vehicle, bounds=both.bounds,
                resolution=options.resolution, progress=progress,
            )
            for vehicle in options.vehicles
        )  # fmt: skip
    difference = Difference(
        old=old.name,
        new=new.name,
        same=not differs,
        frame=tuple(frame),
        entries=(*texts.entries.changes, *texts.parts),
        elements=texts.elements,
        tracks=texts.tracks,
        notes=tuple(notes),
        ground=ground,
        verdicts=verdicts,
        storeys=storeys,
    )
    return ComparedDefinitions(difference, both)


def _frame(old: DiffSide, new: DiffSide) -> tuple[list[KeyChange], list[str]]:
    """Differences of size, origin and reference system, and notes on equal systems."""
    found, notes = [], []
    first, second = old.definition, new.definition
    if first.extent != second.extent:
        found.append(KeyChange("size", *(f"{w:.12g} × {h:.12g}" for w, h in _pairs(old, new))))
    if first.corner != second.corner:
        corners = (f"({x:.12g}, {y:.12g})" for x, y in (first.corner, second.corner))
        found.append(KeyChange("origin", *corners))
    before, after = old.terrain.crs, new.terrain.crs
    if before != after:
        if _is_one_system(old.terrain, new.terrain):
            notes.append("The reference system is written otherwise.")
        else:
            texts = ("" if one is None else shown_crs(one) for one in (before, after))
            found.append(KeyChange("crs", *texts))
    return found, notes


def _pairs(old: DiffSide, new: DiffSide) -> Iterator[tuple[float, float]]:
    yield old.definition.extent
    yield new.definition.extent


def _is_one_system(old: Terrain, new: Terrain) -> bool:
    """Whether two terrains have one reference system, written in two ways."""
    try:
        first, second = crs_of(old), crs_of(new)
    except DefinitionError:
        return False
    return first is not None and first == second


def _is_one_field(old: DiffSide, new: DiffSide) -> bool:
    """Whether two definitions have one field, with the same surfaces, however they are written."""
    before, after = old.terrain, new.terrain
    if before.is_shared != after.is_shared or len(before.surfaces) != len(after.surfaces):
        return False
    surfaces = (
        [surface_key(side.terrain.surface_types[name]) for name in side.terrain.surfaces]
        for side in (old, new)
    )
    first, second = surfaces
    return bool(first == second) and _equal(_arrays_of(before), _arrays_of(after))


def _arrays_of(terrain: Terrain) -> tuple[Any, ...]:
    """All that makes the ground of a terrain, and its decks and bores."""
    storeys = terrain.storeys
    if storeys is None:
        return tuple(terrain.arrays)
    return (
        *terrain.arrays, *storeys.table,
        *((sheet.is_bore, sheet.top.surfaces, sheet.storeys, sheet.faced, *sheet.top.arrays,
           *sheet.face.arrays) for sheet in storeys.sheets),
    )  # fmt: skip


def _equal(one: Any, other: Any) -> bool:
    """Whether arrays, or tuples of them, are equal to the last bit."""
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(_equal, one, other))
    if isinstance(one, np.ndarray):
        alike = one.dtype == other.dtype and one.shape == other.shape
        return bool(alike and one.tobytes() == other.tobytes())
    return bool(one == other)


def _regions(
    old: DiffSide, new: DiffSide, texts: TextDifference, moved: bool
) -> tuple[Bounds, ...] | None:
    """Rectangles outside of which nothing differs; None where anything may."""
    if moved:
        return None
    found: list[Bounds] = list(reaches(texts.raw, old, new))
    relief, shapes = set(texts.entries.relief), set(texts.entries.shapes)
    for side, dirty in (
        (old, {was for was, _ in texts.dirty}),
        (new, {now for _, now in texts.dirty}),
    ):
        rectangles = users(side, relief, shapes, dirty)
        if rectangles is None:
            return None
        found += rectangles
    found += (place.bounds for one in texts.tracks for place in (one.old, one.new)
              if place is not None and place.bounds is not None)  # fmt: skip
    if any(entry.dictionary == "surface" for entry in texts.entries.changes):
        # surfaces decide the sinkage of wheels, and so the depth of tracks
        found += map(track_reach, (*old.definition.ruts, *new.definition.ruts))
    return tuple(dict.fromkeys(found))


def _with_outside(ground: GroundChange, both: Both, bounds: Bounds | None) -> GroundChange:
    """Return a copy with the areas of each terrain that lie outside of the other."""
    areas = []
    for terrain in (both.old, both.new):
        part = terrain.bounds if bounds is None else intersection(terrain.bounds, bounds)
        areas.append(0.0 if part is None else area_of(part) - area_of(both.bounds))
    return structs.replace(ground, left=areas[0], joined=areas[1])
