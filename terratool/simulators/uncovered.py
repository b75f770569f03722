"""Meshes without those faces that boxes and cylinders stand for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.mesh.triangulate import delaunay
from terratool.mesh.types import CornerNormals, Mesh
from terratool.simulators.level_solids import SAGITTA, LevelSolid
from terratool.simulators.rectangles import NEAR

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]

_GRID = 1e-3
"""Spacing of the places to which cuts are rounded, in parts of the distance that counts as none."""


def uncovered(mesh: Mesh, solids: list[LevelSolid], error: float) -> Mesh:
    """Return a mesh without what lies on the outside of solids.

    Level faces that are covered in part are cut; upright ones are kept then.

    Args:
        mesh: mesh with normals.
        solids: solids that stand for parts of the mesh.
        error: error of the mesh: its polygons are no farther from circles that they stand for.
    """
    if not solids:
        return mesh
    covers = _Covers(solids, error)
    corners = mesh.vertices[mesh.faces]
    gone = np.zeros(len(mesh.faces), np.bool_)
    walls = np.flatnonzero(mesh.walls)
    gone[walls] = covers.hold_walls(corners[walls])
    level = np.flatnonzero(~mesh.walls & (np.ptp(corners[:, :, 2], axis=1) <= covers.near))
    whole, left = covers.cut_level(corners[level], mesh.surfaces[level])
    gone[level[whole]] = True
    return _joined(mesh, ~gone, left)


@dataclass(frozen=True)
class _AddedFaces:
    """Level faces that are added to a mesh.

    Attributes:
        corners: (n, 3, 3) float64 corners, counter-clockwise from outside.
        surfaces: (n,) int32 index of the surface of each.
    """

    corners: Floats
    surfaces: Ints


class _Covers:
    """Boxes and cylinders that cover faces."""

    def __init__(self, solids: list[LevelSolid], error: float) -> None:
        self.near, self._error = NEAR * error, error
        self._ones = solids
        columns = np.array(
            [(one.surface, one.under, one.top, *one.middle, *one.half) for one in solids]
        )
        self._surfaces, self._spans = columns[:, 0], columns[:, 1:3]
        self._middles, self._halves = columns[:, 3:5], columns[:, 5:7]
        self._axes = np.array([one.axes for one in solids])
        self._round = np.array([one.is_round for one in solids])
        self._rings = np.array([one.corners() for one in solids])

    def hold_walls(self, corners: Floats) -> Bools:
        """Whether upright faces, (n, 3, 3), lie in sides of solids, (n,)."""
        found = np.zeros(len(corners), np.bool_)
        if not len(corners):
            return found
        plan = corners[:, :, :2]
        longest = np.argmax(np.linalg.norm(np.roll(plan, -1, axis=1) - plan, axis=2), axis=1)
        at = np.arange(len(plan))
        ends = np.stack([plan[at, longest], plan[at, (longest + 1) % 3]], axis=1)
        span = np.column_stack([corners[:, :, 2].min(axis=1), corners[:, :, 2].max(axis=1)])
        lines = shapely.linestrings(ends)

        def near(tree: shapely.STRtree, sides: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
            """Return faces and indices in a tree of sides of solids that may cover them."""
            face, side = tree.query(lines, predicate="dwithin", distance=self.near)
            one = own[side // sides]
            fits = (span[face, 0] >= self._spans[one, 0] - self.near) & (
                span[face, 1] <= self._spans[one, 1] + self.near
            )
            return face[fits], side[fits]

        own = np.flatnonzero(~self._round)
        sides = np.stack([self._rings[own], np.roll(self._rings[own], -1, axis=1)], axis=2)
        sides = sides.reshape(-1, 2, 2)
        face, side = near(shapely.STRtree(shapely.linestrings(sides)), 4)
        found |= self._are_along(ends, face, sides[side])
        own = np.flatnonzero(self._round)
        reach = self._halves[own] + self._error
        low, high = self._middles[own] - reach, self._middles[own] + reach
        face, side = near(shapely.STRtree(shapely.box(*low.T, *high.T)), 1)
        one = own[side]
        radius, middle = self._halves[one, 0], self._middles[one]
        off = np.linalg.norm(ends[face] - middle[:, None], axis=2) - radius[:, None]
        halfway = np.linalg.norm(ends[face].mean(axis=1) - middle, axis=1)
        on = (np.abs(off) <= self.near).all(axis=1)
        found[face[on & (halfway >= radius - SAGITTA * self._error)]] = True
        return found

    def _are_along(self, ends: Floats, face: NDArray[np.intp], sides: Floats) -> Bools:
        """Whether faces are covered by sides in their planes, seen from above, (n,).

        Args:
            ends: (n, 2, 2) ends of faces.
            face: (m,) face that each side may cover.
            sides: (m, 2, 2) ends of the sides.
        """
        begin, along = ends[face, 0], ends[face, 1] - ends[face, 0]
        way = sides[:, 1] - sides[:, 0]
        normal = np.stack([-way[:, 1], way[:, 0]], axis=1)
        normal /= np.linalg.norm(way, axis=1)[:, None]
        off = ((ends[face] - sides[:, :1]) * normal[:, None]).sum(axis=2)
        on = (np.abs(off) <= self.near).all(axis=1)
        face, begin, along, sides = face[on], begin[on], along[on], sides[on]
        share = ((sides - begin[:, None]) * along[:, None]).sum(axis=2)
        share /= (along * along).sum(axis=1)[:, None]
        # the sides of each face come after those of the one before: one sum has all unions
        share = share.clip(0.0, 1.0) + 2.0 * face[:, None]
        low, high = share.min(axis=1), share.max(axis=1)
        order = np.lexsort([low, face])
        low, high = low[order], high[order]
        before = np.concatenate([[-np.inf], np.maximum.accumulate(high)[:-1]])[: len(high)]
        covered = np.bincount(face[order], (high - np.maximum(low, before)).clip(0.0), len(ends))
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        return np.asarray((1.0 - covered) * lengths <= 2.0 * self.near)

    def cut_level(self, corners: Floats, surfaces: Ints) -> tuple[Bools, _AddedFaces]:
        """Return whether solids cover level faces, (n, 3, 3), and what is left of these."""
        sides = corners[:, 1:, :2] - corners[:, :1, :2]
        up = sides[:, 0, 0] * sides[:, 1, 1] > sides[:, 0, 1] * sides[:, 1, 0]
        shrunk = shapely.polygons([one.corners(-self.near) for one in self._ones])
        polygons = shapely.polygons(corners[:, :, :2])
        face, one = shapely.STRtree(shrunk).query(polygons, predicate="intersects")
        level = np.where(up[face], self._spans[one, 1], self._spans[one, 0])
        fits = np.abs(corners[face, 0, 2] - level) <= self.near
        fits &= (surfaces[face] == self._surfaces[one]) | ~up[face]
        face, one = face[fits], one[fits]
        away = np.einsum(
            "nci,nki->nck", corners[face, :, :2] - self._middles[one, None], self._axes[one]
        )
        half = self._halves[one, None]
        within = (np.abs(away) <= half + self.near).all(axis=(1, 2))
        radius = np.linalg.norm(away, axis=2).max(axis=1, initial=0.0)
        within &= ~self._round[one] | (radius <= half[:, 0, 0] + self.near)
        gone = np.zeros(len(corners), np.bool_)
        gone[face[within]] = True
        some = ~gone[face] & ~self._round[one]
        face, one = face[some], one[some]
        left = [_AddedFaces(np.empty((0, 3, 3)), np.empty(0, np.int32))]
        kinds = np.column_stack([surfaces, up, np.round(corners[:, 0, 2] / self.near)])[face]
        _, kind = np.unique(kinds, axis=0, return_inverse=True)
        for k in range(int(kind.max(initial=-1)) + 1):
            own = np.unique(face[kind.reshape(-1) == k])
            rings = self._rings[np.unique(one[kind.reshape(-1) == k])]
            rest = self._difference(polygons[own], shapely.polygons(rings))
            first = own[0]
            plan = rest if up[first] else rest[:, ::-1]
            z = np.full((*plan.shape[:2], 1), corners[first, 0, 2])
            worn = np.full(len(plan), surfaces[first], np.int32)
            left.append(_AddedFaces(np.concatenate([plan, z], axis=2), worn))
            gone[own] = True
        return gone, _AddedFaces(
            np.concatenate([one.corners for one in left]),
            np.concatenate([one.surfaces for one in left]),
        )

    def _difference(self, polygons: NDArray[np.object_], covers: NDArray[np.object_]) -> Floats:
        """Return triangles, (n, 3, 2), of what polygons hold and covers do not."""
        grid = _GRID * self.near
        whole = shapely.union_all(polygons, grid_size=grid)
        covered = shapely.union_all(covers, grid_size=grid)
        rest = shapely.get_parts(shapely.difference(whole, covered, grid_size=grid))
        found = [np.empty((0, 3, 2))]
        for polygon in rest:
            if polygon.geom_type != "Polygon" or polygon.buffer(-self.near).is_empty:
                continue
            rings = [shapely.get_coordinates(ring)[:-1] for ring in shapely.get_rings(polygon)]
            starts = np.cumsum([0, *map(len, rings)])
            edges = [
                np.column_stack([own, np.roll(own, -1)])
                for own in map(np.arange, starts[:-1], starts[1:])
            ]
            points, triangles, _ = delaunay(
                np.concatenate(rings), np.concatenate(edges), within=True
            )
            found.append(points[triangles])
        return np.concatenate(found)


def _joined(mesh: Mesh, kept: Bools, more: _AddedFaces) -> Mesh:
    """Return some faces of a mesh with normals, and more faces that are level."""
    assert mesh.normals is not None
    count, own = len(mesh.vertices), more.corners.reshape(-1, 3)
    added = np.arange(count, count + len(own), dtype=np.int32).reshape(-1, 3)
    a, b = np.moveaxis(more.corners[:, 1:, :2] - more.corners[:, :1, :2], 1, 0)
    down = a[:, 0] * b[:, 1] < a[:, 1] * b[:, 0]
    directions, corners = mesh.normals.directions, mesh.normals.corners
    level = np.array([(0, 0, 1), (0, 0, -1)], directions.dtype)
    ends = np.repeat((len(directions) + down).astype(np.int32)[:, None], 3, axis=1)
    return replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, own]),
        faces=np.concatenate([mesh.faces[kept], added]),
        surfaces=np.concatenate([mesh.surfaces[kept], more.surfaces]),
        walls=np.concatenate([mesh.walls[kept], np.zeros(len(added), np.bool_)]),
        normals=CornerNormals(
            np.concatenate([directions, level]), np.concatenate([corners[kept], ends])
        ),
    )
