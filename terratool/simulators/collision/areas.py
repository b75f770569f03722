"""Rectangles of curved ground in which nothing stands upright, for height fields."""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
import shapely

from terratool.definition.findings import Bounds
from terratool.field.bounds import curve_hulls, curve_pieces, nonzero_edges, with_holes
from terratool.field.footprints import outline_of
from terratool.field.records import COMBINE, STEPPED
from terratool.field.terrain import Terrain
from terratool.simulators.collision.height_patch import Bools, Floats
from terratool.simulators.collision.lattices import GroundSampler

_ASIDE = 1e-7
"""Distance from an edge at which heights beside it are asked, in the terrain's longer side."""
_ON_EDGE = 16
"""Points on each edge at which a wall is looked for."""
_ARC = 0.9
"""Cosine of the turn at a corner above which it is on an arc."""
_SMALLEST = 1 / 512
"""Least side of an area, in the terrain's longer side."""
_MOST = 2000
"""Most rectangles that are looked at."""
_LOOKED = 32
"""Columns and rows of cells in which a rectangle is looked at."""
_PLANE = 1e-4
"""Largest change of slope between two places that is rounding, in errors."""
_SOME = 0.01
"""Share of curved cells up to which a rectangle has no curved ground."""
_MIDDLE = 0.35
"""Largest distance from the middle at which a rectangle is cut beside a bent wall, in its side."""
_FULL = 0.3
"""Least share of curved cells of an area."""
_NEAR = 1e-9
"""Distance that is rounding, in the terrain's longer side."""


class JumpLines(NamedTuple):
    """Places where ground may jump, seen from above, in the world.

    Attributes:
        lines: (n, 2, 2) float64 ends of straight lines.
        blocks: (m, 4) float64 west, south, east, north of rectangles with walls anywhere.
    """

    lines: Floats
    blocks: Floats


def walls_of(terrain: Terrain, least: float) -> JumpLines:
    """Return where the ground of a terrain may jump; its outer edges are no walls.

    Args:
        terrain: terrain with all parts written out; where its storeys are, walls may be anywhere.
        least: least height of a wall.
    """
    storeys, terrain = terrain.storeys, terrain.ground_alone
    arrays = terrain.arrays
    elements, kinds = arrays.elements, arrays.kinds
    cells, footprints = terrain.cells().T, terrain.footprints().T
    own = elements["kind"]
    stepped = np.array([_has_steps(terrain, kind) for kind in kinds], np.bool_)
    whole = stepped[own] | (with_holes(arrays)[own] & (kinds["combine"][own] == COMBINE["grid"]))
    whole &= (elements["scale"] != 0.0) | (kinds["is_void"][own] != 0)
    edged = (nonzero_edges(arrays)[own] != 0) | (elements["offset"] != 0.0)
    poses = arrays.poses[elements["pose"]]
    # what is turned is cut off by its cell
    edged |= (kinds["is_void"][own] != 0) | ((poses["turned"] != 0) & (poses["free"] == 0))
    bent = (kinds["combine"][own] == COMBINE["radial"]) | (poses["turned"] != 0)
    plain = np.flatnonzero(edged & ~bent & ~whole)
    corners = cells[plain][:, [[0, 1], [2, 1], [2, 3], [0, 3]]]  # (n, 4, 2)
    lines = [
        np.stack(
            [np.roll(corners, 1, axis=1), corners, np.roll(corners, -1, axis=1)], axis=2
        ).reshape(-1, 3, 2)
    ]
    for index in np.flatnonzero(edged & bent & ~whole).tolist():
        west, south, east, north = cells[index].tolist()
        rectangle = np.array([[west, south], [east, south], [east, north], [west, north]])
        disc = kinds["combine"][own[index]] == COMBINE["radial"]
        outline = outline_of(rectangle, poses[index], bool(disc))
        before, behind = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
        lines.append(np.stack([before, outline, behind], axis=1))
    found = np.concatenate(lines)
    found = found[_are_walls(terrain, found, least)][:, 1:]
    blocks = [footprints[whole]]
    if storeys is not None:
        blocks += [sheet.top.footprints().T[sheet.storeys >= 0] for sheet in storeys.sheets]
    tracks = arrays.tracks.segments
    if terrain.tracks:
        x = np.stack([tracks["x"], tracks["end_x"]])
        y = np.stack([tracks["y"], tracks["end_y"]])
        reach = tracks["reach"]
        blocks.append(
            np.stack(
                [x.min(0) - reach, y.min(0) - reach, x.max(0) + reach, y.max(0) + reach], axis=1
            )
        )
    return JumpLines(found, np.concatenate(blocks))


def _has_steps(terrain: Terrain, kind: np.void) -> bool:
    """Whether a curve of a kind jumps between its ends."""
    if kind["combine"] == COMBINE["grid"]:
        return False
    for n, axis in enumerate("xy"):
        if kind["knotted"][n] == STEPPED:
            return True
        hulls = curve_hulls(curve_pieces(terrain.arrays, kind, axis)[1])
        jump = np.abs(hulls[0, 1:] - hulls[3, :-1])
        if (jump > 1e-9 * np.abs(hulls).max()).any():
            return True
    return False


def _are_walls(terrain: Terrain, lines: Floats, least: float) -> Bools:
    """Whether the ground jumps somewhere on each line, (n,).

    Args:
        terrain: terrain.
        lines: (n, 3, 2) the corner before each line, and its ends; those of a disc are on its arc.
        least: least height of a wall.
    """
    west, south, east, north = terrain.bounds
    aside = _ASIDE * max(east - west, north - south)
    along = np.diff(lines, axis=1)
    along /= np.maximum(np.linalg.norm(along, axis=2), 1e-300)[:, :, None]
    normals = np.stack([-along[..., 1], along[..., 0]], axis=2)
    share = np.append(0.0, (np.arange(_ON_EDGE) + 0.5) / _ON_EDGE)
    points = lines[:, None, 1] + share[:, None] * (lines[:, 2] - lines[:, 1])[:, None]
    across = np.repeat(normals[:, 1:], len(share), axis=1)
    across[:, 0] += normals[:, 0]
    across *= aside
    # at a corner that is no part of an arc, other edges end
    arc = (along[:, 0] * along[:, 1]).sum(axis=1) > _ARC
    one, other = points + across, points - across
    within = np.ones(points.shape[:2], np.bool_)
    within[:, 0] = arc
    for side in (one, other):
        within &= (side > (west, south)).all(axis=2) & (side < (east, north)).all(axis=2)
    found = np.zeros(points.shape[:2], np.bool_)
    one, other = one[within], other[within]
    a, b = terrain.ground(one[:, 0], one[:, 1]), terrain.ground(other[:, 0], other[:, 1])
    found[within] = (np.abs(a - b) > least) | (np.isnan(a) != np.isnan(b))
    return np.asarray(found.any(axis=1))


def smooth_areas(sampler: GroundSampler, walls: JumpLines, max_error: float) -> list[Bounds]:
    """Return rectangles of curved ground without walls, which do not overlap.

    First come footprints of elements. Other ground with walls is cut along them, until there are
    none, or it is small.

    Args:
        sampler: heights of the ground.
        walls: where ground may jump.
        max_error: largest distance from the ground along z.
    """
    west, south, east, north = whole = sampler.terrain.bounds
    longest = max(east - west, north - south)
    near, smallest, plane = _NEAR * longest, _SMALLEST * longest, _PLANE * max_error
    found = _element_areas(sampler, walls, 2.0 * smallest, plane)
    number = len(found)
    walls = JumpLines(walls.lines, np.concatenate([walls.blocks, np.array(found).reshape(-1, 4)]))
    held = np.array(found).reshape(-1, 4)
    queue: list[tuple[float, int, Bounds, JumpLines]] = [(0.0, 0, whole, walls)]
    for looked in range(1, _MOST):
        if not queue:
            break
        _, _, bounds, around = heapq.heappop(queue)
        inside = _inside(around, bounds, near)
        curved = _curved(sampler, bounds, plane)
        _drop(curved, bounds, held)
        if np.count_nonzero(curved) <= _SOME * curved.size:
            continue
        low, high = np.array(bounds[:2]) + near, np.array(bounds[2:]) - near
        blocks = inside.blocks
        if ((blocks[:, :2] < low) & (blocks[:, 2:] > high)).all(axis=1).any():
            continue  # walls may be anywhere in it
        size = max(bounds[2] - bounds[0], bounds[3] - bounds[1])
        if len(inside.lines) or len(inside.blocks):
            if size < 2.0 * smallest:
                continue
            sides = _sides(bounds, *_best_cut(inside, bounds, near))
        else:
            rows, columns = np.flatnonzero(curved.any(axis=1)), np.flatnonzero(curved.any(axis=0))
            box = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
            within = curved[box[0] : box[1], box[2] : box[3]]
            if np.count_nonzero(within) >= _FULL * within.size or size < 4.0 * smallest:
                found.append(_shrunk(bounds, curved.shape, box))
                continue
            wide = bounds[2] - bounds[0] > bounds[3] - bounds[1]
            at = 0.5 * (bounds[0] + bounds[2]) if wide else 0.5 * (bounds[1] + bounds[3])
            sides = _sides(bounds, 0 if wide else 1, at)
        for k, side in enumerate(sides):
            area = (side[2] - side[0]) * (side[3] - side[1])
            heapq.heappush(queue, (-area, 2 * looked + k, side, inside))
    return found[:number] + _merged(found[number:], walls, near)


def _drop(cells: Bools, bounds: Bounds, rectangles: Floats) -> None:
    """Drop the cells of a rectangle whose middles lie in others, (k, 4)."""
    west, south, east, north = bounds
    y, x = (
        low + (high - low) * (np.arange(count) + 0.5) / count
        for low, high, count in ((south, north, len(cells)), (west, east, cells.shape[1]))
    )
    here = (rectangles[:, :2] < (east, north)).all(axis=1)
    here &= (rectangles[:, 2:] > (west, south)).all(axis=1)
    for left, bottom, right, top in rectangles[here].tolist():
        rows, columns = np.searchsorted(y, (bottom, top)), np.searchsorted(x, (left, right))
        cells[rows[0] : rows[1], columns[0] : columns[1]] = False


def _element_areas(
    sampler: GroundSampler, walls: JumpLines, smallest: float, plane: float
) -> list[Bounds]:
    """Return footprints of elements, the largest first, with curved ground and without walls.

    Args:
        sampler: heights of the ground.
        walls: where ground may jump.
        smallest: least side of a footprint.
        plane: largest change of slope that is rounding, times the distance of the places.
    """
    terrain = sampler.terrain
    west, south, east, north = terrain.bounds
    near = _NEAR * max(east - west, north - south)
    arrays = terrain.arrays
    own, poses = arrays.elements["kind"], arrays.poses[arrays.elements["pose"]]
    cells = terrain.cells().T
    fits = (arrays.kinds["combine"][own] != COMBINE["radial"]) & (poses["turned"] == 0)
    fits &= (cells[:, 2:] - cells[:, :2]).min(axis=1) >= smallest
    cells = np.unique(cells[fits], axis=0)
    inner = shapely.box(*(cells + np.array([near, near, -near, -near])).T)
    free = np.ones(len(cells), np.bool_)
    for shapes in (shapely.linestrings(walls.lines), shapely.box(*walls.blocks.T)):
        if len(shapes):
            free[shapely.STRtree(shapes).query(inner, predicate="intersects")[0]] = False
    cells, inner = cells[free], inner[free]
    found: list[int] = []
    for k in np.argsort(-shapely.area(inner), kind="stable").tolist():
        if found and shapely.intersects(inner[found], inner[k]).any():
            continue
        bounds: Bounds = tuple(cells[k].tolist())
        if np.count_nonzero(_curved(sampler, bounds, plane)) >= _FULL * _LOOKED**2 * _oblong(
            bounds
        ):
            found.append(k)
    return [tuple(cells[k].tolist()) for k in found]


def _oblong(bounds: Bounds) -> float:
    """Return the ratio of the shorter to the longer side of a rectangle."""
    sides = bounds[2] - bounds[0], bounds[3] - bounds[1]
    return min(sides) / max(sides)


def _merged(areas: list[Bounds], walls: JumpLines, near: float) -> list[Bounds]:
    """Return rectangles, where two that make one without walls in it are one."""
    found = sorted(areas)
    k = 0
    while k < len(found):
        one = found[k]
        for other in found[k + 1 :]:
            whole = (
                min(one[0], other[0]), min(one[1], other[1]),
                max(one[2], other[2]), max(one[3], other[3]),
            )  # fmt: skip
            sizes = [(b[2] - b[0]) * (b[3] - b[1]) for b in (one, other, whole)]
            within = sizes[0] + sizes[1] >= sizes[2] * (1.0 - 1e-9)
            if within and not any(len(some) for some in _inside(walls, whole, near)):
                found.remove(one)
                found.remove(other)
                found = sorted([*found, whole])
                k = -1
                break
        k += 1
    return found


def _shrunk(bounds: Bounds, shape: tuple[int, ...], box: tuple[int, ...]) -> Bounds:
    """Return the part of a rectangle with a range of rows and columns of cells."""
    west, south, east, north = bounds
    y = np.linspace(south, north, shape[0] + 1)
    x = np.linspace(west, east, shape[1] + 1)
    return float(x[box[2]]), float(y[box[0]]), float(x[box[3]]), float(y[box[1]])


def _curved(sampler: GroundSampler, bounds: Bounds, least: float) -> Bools:
    """Whether the ground is no plane in cells of a rectangle, and beside them, (n, m)."""
    west, south, east, north = bounds
    inside = 1e-6 * max(east - west, north - south)
    longer = max(east - west, north - south)
    columns, rows = (
        max(2, round(_LOOKED * side / longer)) for side in (east - west, north - south)
    )
    x = np.linspace(west + inside, east - inside, 4 * columns + 1)
    y = np.linspace(south + inside, north - inside, 4 * rows + 1)
    slopes = sampler.slopes_at(x, y)
    if np.isnan(slopes).all():
        return np.zeros((rows, columns), np.bool_)
    # where the ground jumps, slopes are no steeper
    least /= max(x[1] - x[0], y[1] - y[0])
    bend = np.zeros(slopes.shape[1:], np.bool_)
    bend[:, :-1] |= (~(np.abs(np.diff(slopes, axis=2)) <= least)).any(axis=0)
    bend[:-1] |= (~(np.abs(np.diff(slopes, axis=1)) <= least)).any(axis=0)
    out = np.zeros((rows, columns), np.bool_)
    for j, i in np.ndindex(5, 5):
        out |= bend[j : 4 * rows - 4 + j + 1 : 4, i : 4 * columns - 4 + i + 1 : 4]
    wide = np.pad(out, 1)
    for j, i in np.ndindex(3, 3):
        out |= wide[j : j + rows, i : i + columns]
    return out


def _inside(walls: JumpLines, bounds: Bounds, near: float) -> JumpLines:
    """Return the walls that go into a rectangle, those on its edges left out."""
    low, high = np.array(bounds[:2]) + near, np.array(bounds[2:]) - near
    lines = walls.lines
    keep = (lines.max(axis=1) > low).all(axis=1) & (lines.min(axis=1) < high).all(axis=1)
    blocks = walls.blocks
    held = (blocks[:, 2:] > low).all(axis=1) & (blocks[:, :2] < high).all(axis=1)
    return JumpLines(lines[keep], blocks[held])


def _best_cut(walls: JumpLines, bounds: Bounds, near: float) -> tuple[int, float]:
    """Return axis and place of the cut along which most walls stand, about the middle if none."""
    best = -1.0, 0, 0.0
    for axis in (0, 1):
        low, high = bounds[axis], bounds[axis + 2]
        other_low, other_high = bounds[1 - axis], bounds[3 - axis]
        a, b = walls.lines[:, 0], walls.lines[:, 1]
        straight = np.abs(a[:, axis] - b[:, axis]) <= near
        length = np.abs(
            a[:, 1 - axis].clip(other_low, other_high) - b[:, 1 - axis].clip(other_low, other_high)
        )
        places = np.concatenate(
            [a[straight, axis], walls.blocks[:, axis], walls.blocks[:, axis + 2]]
        )
        tall = np.minimum(walls.blocks[:, 3 - axis], other_high) - np.maximum(
            walls.blocks[:, 1 - axis], other_low
        )
        weights = np.concatenate([length[straight], tall, tall])
        # of bent lines the ends are where a cut leaves all of them on one side
        bent = ~straight
        if bent.any():
            ends = np.stack([a[bent, axis], b[bent, axis]])
            ends = np.array([ends.min(), ends.max()])
            # slivers are no gain
            ends = ends[np.abs((ends - low) / (high - low) - 0.5) < _MIDDLE]
            places, weights = np.append(places, ends), np.append(weights, np.full(len(ends), near))
        inner = (places > low + near) & (places < high - near)
        places, weights = places[inner], weights[inner]
        if not len(places):
            continue
        order = np.argsort(places, kind="stable")
        places, weights = places[order], weights[order]
        begin = np.flatnonzero(np.append(True, np.diff(places) > near))
        total = np.add.reduceat(weights, begin) / (other_high - other_low)
        at = places[begin]
        share = (at - low) / (high - low)
        score = np.minimum(total, 1.0) + 0.5 * np.minimum(share, 1.0 - share)
        k = int(np.argmax(score))
        if score[k] > best[0]:
            best = float(score[k]), axis, float(at[k])
    if best[0] < 0.0:
        axis = 0 if bounds[2] - bounds[0] > bounds[3] - bounds[1] else 1
        return axis, 0.5 * (bounds[axis] + bounds[axis + 2])
    return best[1], best[2]


def _sides(bounds: Bounds, axis: int, at: float) -> list[Bounds]:
    """Return both sides of a cut of a rectangle."""
    west, south, east, north = bounds
    if axis == 0:
        return [(west, south, at, north), (at, south, east, north)]
    return [(west, south, east, at), (west, at, east, north)]
