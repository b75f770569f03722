"""Ruts: tracks that the wheels of a vehicle on a path leave in the definition."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.change import with_moved_paths
from terratool.definition.findings import Bounds
from terratool.definition.layout import TERRAIN
from terratool.definition.libraries import known_names
from terratool.definition.model import Surface, Track, middle_of
from terratool.definition.presets import preset_of
from terratool.definition.reader import Checked, CheckOptions, check, refusal
from terratool.errors import DefinitionError, MissedError, RequestError, WriteError
from terratool.field.terrain import Terrain
from terratool.field.types import OUTSIDE
from terratool.output import is_same_file, refuse_existing, refuse_missing_folder
from terratool.report.numbers import coordinates
from terratool.text.display import quote
from terratool.text.edit import set_member
from terratool.text.source import Source, read_source, write_source
from terratool.traversability.layers import sample_near, top_near
from terratool.traversability.limits import wheel_layout, wheel_loads
from terratool.traversability.route.paths import check_inside
from terratool.traversability.soil import bekker_sinkage
from terratool.traversability.vehicle import Vehicle, Wheel

SHARPEST = math.radians(20.0)
"""Sharpest turn of a path that is driven through, rad; sharper ones are made on the spot."""
TURN_STEP = math.radians(10.0)
"""Largest step of a turn on the spot, rad."""

Points = NDArray[np.float64]
"""Points (n, 2) or (n, 3), or numbers (n,), in world units."""

MOST_PASSES = 1_000_000_000
"""Most passes of a drive."""
SHARE = 0.2
"""Default tolerance of wheel lines, in widths of the narrowest wheel."""
_SAMPLES = 2_000_000
"""Most samples along a wheel's line."""
_COVERED = (
    "The path has no heights, so its ruts lie on the ground, below decks. Give points x, y and z "
    "for ruts on a deck."
)
_DIGITS = 6
"""Significant digits of depths and loads in a definition."""


def wheel_paths(
    vehicle: Vehicle, path: Points, tolerance: float, floors: Terrain | None = None
) -> list[tuple[int, Points]]:
    """The lines that the wheels roll along, seen from above.

    The vehicle is a rigid body that turns by skidding: its middle stays on the path, and it heads
    along the path, at a point where the path bends a little halfway between the two directions.

    Args:
        vehicle: the vehicle; wheels of one axle are spread evenly over the track.
        path: (n, 2) world coordinates, m, without repeated points; (n, 3) with heights of floors.
        tolerance: largest distance by which the lines are simplified, m.
        floors: terrain on whose tops the wheels stand; wanted with heights alone.

    Returns:
        Index in the `wheel_layout` and line, (m, 2) or (m, 3), of each wheel; of several wheels at
        one place only the first.

    Raises:
        RequestError: a wheel stands on nothing near the path.
    """
    places, headings = _poses(path)
    ahead = np.column_stack([np.sin(headings), np.cos(headings)])
    right = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    wheels = wheel_layout(vehicle)
    first: dict[tuple[float, float], int] = {}
    for index, place in enumerate(zip(wheels.x.tolist(), wheels.y.tolist(), strict=True)):
        first.setdefault(place, index)
    lines = []
    for (x, y), index in first.items():
        along = x - vehicle.middle
        line = places[:, :2] + along * ahead - y * right
        if floors is not None:
            reach = math.hypot(along, y) + vehicle.all_wheels[index].radius
            line = _on_floors(floors, line, _heights_along(places, along), reach)
        lines.append((index, simplify(line, tolerance)))
    return lines


def _heights_along(places: Points, ahead: float) -> Points:
    """Heights of a path, (n, 3), so far ahead of each of its places, m; it goes on straight."""
    run = np.r_[0.0, np.cumsum(np.hypot(*np.diff(places[:, :2], axis=0).T))]
    z, at = places[:, 2], run + ahead
    far, keep = np.r_[True, np.diff(run) > 0.0], run[-1]
    run, heights = run[far], z[far]
    slopes = np.diff(heights) / np.diff(run)
    before, beyond = np.minimum(at, 0.0) * slopes[0], np.maximum(at - keep, 0.0) * slopes[-1]
    return np.asarray(np.interp(at, run, heights) + before + beyond, np.float64)


def _on_floors(floors: Terrain, line: Points, z: Points, reach: float) -> Points:
    """A wheel's line, (n, 2), on the tops nearest to heights z, (n,): (n, 3).

    Raises:
        RequestError: a top is farther than `reach` from its height, m.
    """
    tops = np.asarray(top_near(floors, line[:, 0], line[:, 1], z), np.float64)
    far = np.flatnonzero(np.abs(tops - z) > reach)
    if len(far):
        at = far[0]
        raise _off_floor(line[at], float(tops[at]), float(z[at]))
    return np.column_stack([line, np.where(np.isnan(tops), z, tops)])


def _off_floor(place: Points, top: float, z: float) -> RequestError:
    """The error of a wheel that stands on nothing near its vehicle."""
    away = "below" if top < z else "above"
    return RequestError(
        f"A wheel would leave the vehicle's floor at {coordinates(place.round(3))}: what is there "
        f"lies {abs(top - z):.2g} m {away} it.",
        "Lead the path where all wheels are on the floor, and give more points with its height.",
    )


def _poses(path: Points) -> tuple[Points, Points]:
    """Poses along a path: places, as the path's points, and headings, rad clockwise from north."""
    legs = np.diff(path, axis=0)
    headings = np.arctan2(legs[:, 0], legs[:, 1])
    places, turned = [path[0]], [headings[0]]
    for at, before, after in zip(path[1:-1], headings[:-1], headings[1:], strict=True):
        turn = math.remainder(after - before, 2 * math.pi)
        if abs(turn) <= SHARPEST:
            angles = [before + 0.5 * turn]
        else:
            angles = (
                before + np.linspace(0.0, turn, math.ceil(abs(turn) / TURN_STEP) + 1)
            ).tolist()
        places += [at] * len(angles)
        turned += angles
    return np.array([*places, path[-1]]), np.array([*turned, headings[-1]])


def simplify(line: Points, tolerance: float) -> Points:
    """Leave out vertices of a polyline that lie within a tolerance, m, of the line that remains.

    The algorithm of Ramer (1972) and of Douglas and Peucker (1973); the ends stay.
    """
    keep = np.zeros(len(line), np.bool_)
    keep[[0, -1]] = True
    pending = [(0, len(line) - 1)]
    while pending:
        first, last = pending.pop()
        if last - first < 2:
            continue
        away = distances(line[first + 1 : last], line[first], line[last])
        farthest = int(away.argmax())
        if away[farthest] > tolerance:
            middle = first + 1 + farthest
            keep[middle] = True
            pending += [(first, middle), (middle, last)]
    return line[keep]


def distances(points: Points, begin: Points, end: Points) -> Points:
    """Distances of points, (n, 2) or (n, 3), from a segment, (n,)."""
    along = end - begin
    length = float(along @ along)
    t = ((points - begin) @ along) / length if length else np.zeros(len(points))
    nearest = begin + np.clip(t, 0.0, 1.0)[:, None] * along
    return np.asarray(np.hypot.reduce(points - nearest, axis=1), np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class DeformOptions:
    """Options of a drive that leaves ruts.

    Attributes:
        passes: number of times that the path is driven, from 1 on.
        surface: name of the surface that the ruts get; they keep that of the ground if None.
        multipass: exponent a of the growth of the depth with the passes n as n^(1/a), from 1 on: 2
            to 3 for loose soil, 4 to 5 for dense soil; the default of the format if None.
        max_error: largest distance by which the simplified lines of the wheels may be off, m; a
            fifth of the narrowest wheel's width if None.
    """

    passes: int = 1
    surface: str | None = None
    multipass: float | None = None
    max_error: float | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.passes <= MOST_PASSES:
            raise RequestError(
                f"The path is to be driven {self.passes:,} times.",
                f"Give a whole number from 1 to {MOST_PASSES:,}.",
            )
        if self.multipass is not None and not 1.0 <= self.multipass < math.inf:
            raise RequestError(
                f"The exponent of passes is {self.multipass:g}.", "Give a finite number from 1 on."
            )
        if self.max_error is not None and not 0.0 < self.max_error < math.inf:
            raise RequestError(
                f"The largest error is {self.max_error:g}.", "Give a finite length above 0."
            )


@dataclass(frozen=True, slots=True)
class Rut:
    """The ruts of a drive on a surface.

    Attributes:
        surface: name of the surface.
        length: length of the wheels' lines on the surface, m.
        depth: depth of the deepest first pass, m.
    """

    surface: str
    length: float
    depth: float


@dataclass(frozen=True, slots=True)
class Deformed:
    """The tracks of a definition after a drive.

    Attributes:
        tracks: all tracks, old ones first.
        added: number of new tracks.
        again: number of old tracks that have been driven along again.
        length: length of the wheels' lines, m.
        points: number of vertices of the wheels' lines.
        ruts: ruts on each surface, by name.
        ranged: names of surfaces whose sinkage is a range, of which the middle counts.
        notes: sentences on what the drive did not see.
    """

    tracks: tuple[Track, ...]
    added: int
    again: int
    length: float
    points: int
    ruts: tuple[Rut, ...]
    ranged: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def check_path(path: Points, extent: Bounds) -> None:
    """Refuse a path that leaves a terrain.

    Args:
        path: (n, 2) x and y of the middle of the vehicle, or (n, 3) with heights.
        extent: west, south, east, north of the terrain.

    Raises:
        RequestError: a point lies outside.
    """
    for place in path.tolist():
        check_inside("A point of the path", tuple(place), {"the terrain": extent})


def deform(
    checked: Checked,
    vehicle: Vehicle,
    path: NDArray[np.float64],
    options: DeformOptions | None = None,
) -> Deformed:
    """Drive a vehicle along a path.

    Each wheel bears its load on level ground, and its track has its width. The depth is z = k·W, k
    of the surface, as docs/format.md says; where the soil is a preset, the depth by Bekker for this
    wheel and load stands in the track.

    Args:
        checked: a terrain from `terratool.check` or `load_checked`.
        vehicle: the vehicle.
        path: (n, 2) world coordinates of the way of the vehicle's middle, m, on the ground; (n, 3)
            with heights near the tops that it drives on.
        options: passes, and what becomes of the ruts; the defaults if None.

    Raises:
        DefinitionError: the terrain has errors.
        RequestError: the path is too short, leaves the terrain, its ground or a storey, or lies on
            a surface without a sinkage; or the terrain is in degrees; or the vehicle has no wheels.
        MissedError: a wheel would sink by its radius or more.
    """
    if checked.terrain is None:
        raise refusal(checked)
    definition = checked.terrain
    if vehicle.gear != "wheels":
        raise RequestError(
            f"Only ruts of wheels are known, and the vehicle stands on {vehicle.gear}.",
            "Take a vehicle on wheels, or write the tracks of the definition by hand.",
        )
    wheels = vehicle.all_wheels
    options = options or DeformOptions()
    passes, surface, multipass = options.passes, options.surface, options.multipass
    tolerance = options.max_error
    if tolerance is None:
        tolerance = SHARE * min(wheel.width for wheel in wheels)
    bare = msgspec.structs.replace(definition, tracks=UNSET)
    floors = Terrain(msgspec.structs.replace(checked, terrain=bare), roughness=False)
    floors.refuse_degrees("A vehicle")
    storeyed = floors.storeys is not None
    path = _drop_repeats(path if storeyed else path[:, :2])
    surfaces = floors.surface_types  # those of libraries, too
    known = () if checked.document is None else known_names(checked.document).surfaces
    if surface is not None and surface not in known:
        raise RequestError(
            f"There is no surface {quote(surface)} for the ruts.", "Name one of surfTypes."
        )
    loads = wheel_loads(vehicle)
    lengths: dict[str, float] = {}
    deepest: dict[str, float] = {}
    fresh: list[Track] = []
    covered = False
    lines = wheel_paths(vehicle, path, tolerance, floors if path.shape[1] > 2 else None)
    for index, line in lines:
        load, wheel = float(loads[index]), wheels[index]
        found = _ground_along(floors, line, wheel)
        covered |= found.covered
        presets: dict[str, float] = {}
        for name, length in found.lengths.items():
            depth, is_preset = _depth(name, surfaces[name], wheel, load)
            if is_preset:
                presets[name] = _round_number(depth)
            lengths[name] = lengths.get(name, 0.0) + length
            deepest[name] = max(deepest.get(name, 0.0), depth)
        fresh.append(
            Track(
                path=_round_line(
                    line[:, :2] if found.grounded else line, min(tolerance, SHARE * wheel.width)
                ),
                width=wheel.width,
                load=_round_number(load * 1e-3),
                depth=presets or UNSET,
                passes=UNSET if passes == 1 else passes,
                multipass=UNSET if multipass is None else multipass,
                surface=UNSET if surface is None else surface,
            )
        )
    before = () if definition.tracks is UNSET else definition.tracks
    tracks, added, again = _merge_tracks(before, fresh)
    return Deformed(
        tracks,
        added,
        again,
        length=sum(lengths.values()),
        points=sum(len(track.path) for track in fresh),  # type: ignore[arg-type, misc]
        ruts=tuple(Rut(name, lengths[name], deepest[name]) for name in sorted(lengths)),
        ranged=tuple(n for n in sorted(lengths) if "sinkage" in surfaces[n].ranges),
        notes=(_COVERED,) if covered else (),
    )


def _drop_repeats(path: Points) -> Points:
    """Leave out points of a path that have the place of the point before.

    Raises:
        RequestError: fewer than two points are left.
    """
    moved = np.concatenate([[True], (np.diff(path[:, :2], axis=0) != 0.0).any(axis=1)])
    if np.count_nonzero(moved) < 2:
        raise RequestError(
            "The path has fewer than two different points.", "Give where it begins and ends."
        )
    out: NDArray[np.float64] = path[moved]
    return out


class _GroundAlong(NamedTuple):
    """Ground that a wheel runs over.

    Attributes:
        lengths: length of its line on each surface, m, by name.
        grounded: whether all of the line lies on the ground, rather than on storeys.
        covered: whether the line, which has no heights, has storeys over it.
    """

    lengths: dict[str, float]
    grounded: bool
    covered: bool


def _ground_along(floors: Terrain, line: Points, wheel: Wheel) -> _GroundAlong:
    """Find what a wheel runs over, from samples about half its width apart.

    Raises:
        RequestError: the line leaves the terrain, its ground or the floor that it is on, or some
            ground has no surface.
    """
    spacing = 0.5 * wheel.width
    lengths = np.hypot(*np.diff(line[:, :2], axis=0).T)
    if lengths.sum() / spacing > _SAMPLES:
        spacing = lengths.sum() / _SAMPLES
    counts = np.maximum(1, np.ceil(lengths / spacing)).astype(np.int64)
    leg = np.repeat(np.arange(len(lengths)), counts)
    within = np.arange(len(leg)) - np.repeat(np.cumsum(counts) - counts, counts)
    t = ((within + 0.5) / counts[leg])[:, None]
    places = np.concatenate([line[leg] * (1 - t) + line[leg + 1] * t, line[[0, -1]]])
    x, y, *z = places.T
    ground = floors.ground(x, y)
    samples = sample_near(floors, x, y, z[0] if z else ground)
    void = np.flatnonzero(np.isnan(samples.height))
    if len(void):
        at = places[void[0], :2]
        outside = samples.element[void[0]] == OUTSIDE
        raise RequestError(
            f"A wheel would run {'outside of the terrain' if outside else 'over no ground'} at "
            f"{coordinates(at.round(3))}.",
            "Give a path that stays on the terrain by half the vehicle's width."
            if outside
            else "Lead the path around it.",
        )
    tops = samples.height
    if z:
        jumps = np.abs(np.diff(tops[:-2])) > wheel.radius + spacing
        if jumps.any():
            n = int(jumps.argmax())
            raise _off_floor(places[n + 1, :2], float(tops[n + 1]), float(tops[n]))
    unnamed = np.flatnonzero(samples.surface < 0)
    if len(unnamed):
        at = places[unnamed[0], :2]
        raise RequestError(
            f"The ground at {coordinates(at.round(3))} has no surface, so nothing says how deep a "
            "wheel sinks.",
            'Give the root element a "surface".',
        )
    metres = np.bincount(
        samples.surface[: len(leg)], lengths[leg] / counts[leg], len(floors.surfaces)
    )
    seen = np.unique(samples.surface)
    return _GroundAlong(
        {floors.surfaces[i]: float(metres[i]) for i in seen.tolist()},
        bool((tops == ground).all()),
        not z and bool((tops < floors.height(x, y)).any()),
    )


def _depth(name: str, surface: Surface, wheel: Wheel, load: float) -> tuple[float, bool]:
    """Depth of a wheel's first pass on a surface, m, and whether a preset gives it.

    Raises:
        RequestError: the surface has neither sinkage nor preset.
        MissedError: the depth is the wheel's radius or more.
    """
    preset = preset_of(surface)
    if surface.sinkage is not UNSET:
        depth = load * 1e-3 * middle_of(surface.sinkage)
    elif preset is not None:
        depth = float(bekker_sinkage(preset, wheel, load))
    else:
        raise RequestError(
            f'The surface {quote(name)} has no "sinkage", so nothing says how deep a wheel sinks.',
            'Give it "sinkage" in m/kN, 0 for rigid ground, or a "preset".',
        )
    if depth >= wheel.radius:
        raise MissedError(
            f"A wheel with {load:.4g} N sinks {depth:.3g} m in {quote(name)}, and its radius is "
            f"{wheel.radius:.3g} m: it cannot drive there.",
            "Lead the path around it, or take larger wheels.",
        )
    return depth, surface.sinkage is UNSET


def _round_line(line: Points, tolerance: float) -> tuple[tuple[float, ...], ...]:
    """Round a line: x, y and z move by a quarter of the tolerance, m, at most."""
    decimals = max(0, math.ceil(-math.log10(0.5 * tolerance)))
    rounded = [tuple(round(one, decimals) + 0.0 for one in point) for point in line.tolist()]
    kept = [rounded[0]]
    kept += [point for before, point in pairwise(rounded) if point != before]
    return tuple(kept)


def _round_number(value: float) -> float:
    """Round a number to `_DIGITS` significant digits."""
    return float(f"{value:.{_DIGITS}g}")


def _merge_tracks(
    known: tuple[Track, ...], fresh: list[Track]
) -> tuple[tuple[Track, ...], int, int]:
    """Merge tracks: one with the path and wheel of another adds to its passes.

    Returns:
        All tracks, the number of new ones, and the number of old ones with more passes.
    """
    tracks = list(known)
    places = {_track_key(track): i for i, track in enumerate(tracks)}
    again: set[int] = set()
    for track in fresh:
        at = places.setdefault(_track_key(track), len(tracks))
        if at == len(tracks):
            tracks.append(track)
            continue
        old = tracks[at]
        tracks[at] = msgspec.structs.replace(old, passes=_passes(old) + _passes(track))
        if at < len(known):
            again.add(at)
    return tuple(tracks), len(tracks) - len(known), len(again)


def _track_key(track: Track) -> Any:
    """A hashable key of a track, equal for tracks that differ in passes and name only."""
    depth: Any = track.depth
    if isinstance(depth, dict):
        depth = tuple(sorted(depth.items()))
    return msgspec.structs.replace(track, descr=UNSET, passes=UNSET, depth=depth)


def _passes(track: Track) -> int:
    """Number of passes of a track, 1 by default."""
    return 1 if track.passes is UNSET else track.passes


def with_tracks(source: Source, deformed: Deformed, output: str | Path) -> Source:
    """Text of a definition with the tracks after a drive, for a file whose folder may be another.

    All other text stays as it is, but for the paths of libraries.
    """
    tracks = msgspec.to_builtins(deformed.tracks)
    text = with_moved_paths(source, output)
    data = set_member(text, "", "tracks", tracks, TERRAIN).apply(text)
    return msgspec.structs.replace(source, name=str(output), data=data)


def refuse_output(output: str | Path, inputs: Iterable[object], overwrite: bool) -> None:
    """Refuse a file that a drive cannot write, before it is computed.

    Args:
        output: file to write.
        inputs: vehicle and waypoints, of which paths are files that stay as they are.
        overwrite: whether the output may exist.

    Raises:
        WriteError: the output is read, exists, or has no folder.
    """
    for one in inputs:
        if isinstance(one, str | Path) and is_same_file(output, one):
            raise WriteError(f"{output}: is read, too, as {one}.", "Choose another name.")
    refuse_existing(Path(output), overwrite)
    refuse_missing_folder(Path(output))


def write_deformed(
    definition: str | Source,
    output: str | Path,
    deformed: Deformed,
    overwrite: bool = False,
    library_roots: tuple[str, ...] = (),
) -> int:
    """Write a definition with the tracks after a drive, all other text unchanged.

    The output is gzipped if its name ends with .gz, or if it is the definition and that is.

    Args:
        definition: text of the definition, or the path of its file.
        output: file to write.
        deformed: tracks after the drive.
        overwrite: whether the file may exist.
        library_roots: further folders under which libraries may lie.

    Returns:
        Growth of the text, bytes.

    Raises:
        DefinitionError: the definition would not be valid with the tracks.
        WriteError: the output cannot be written.
    """
    source = definition if isinstance(definition, Source) else read_source(definition)
    own = is_same_file(output, source.name)
    packed = source.packed if own else Path(output).name.lower().endswith(".gz")
    result = msgspec.structs.replace(with_tracks(source, deformed, output), packed=packed)
    folder = str(Path(source.name).parent)
    options = CheckOptions(warnings=False, library_roots=(*library_roots, folder))
    checked = check(result, options)
    if checked.terrain is None:
        first = checked.findings[0]
        raise DefinitionError(
            f"{source.name}: with the tracks, it would be invalid: {first.code}: {first.message}",
            first.hint,
            checked.findings,
        )
    write_source(result, output, overwrite)
    return result.size - source.size
