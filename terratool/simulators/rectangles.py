"""Rectangles of level ground in which nothing is lower, cut along the outlines of what is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.mesh.components import components

Floats = NDArray[np.float64]

NEAR = 0.02
"""Distance that counts as none, in errors: levels of a mesh that are hardly apart are one."""


class CutRectangle(NamedTuple):
    """A rectangle along the axes.

    Attributes:
        low: (2,) least x and y.
        high: (2,) largest x and y.
    """

    low: Floats
    high: Floats

    @property
    def middle(self) -> Floats:
        """Place of the middle, (2,)."""
        return 0.5 * (self.low + self.high)

    @property
    def half(self) -> Floats:
        """Half of the side lengths along x and y, (2,)."""
        return 0.5 * (self.high - self.low)

    @property
    def corners(self) -> Floats:
        """Corners from the south-west one on, counter-clockwise, (4, 2)."""
        (west, south), (east, north) = self.low, self.high
        return np.array([(west, south), (east, south), (east, north), (west, north)])

    def parts(self, across: int, at: float) -> tuple[CutRectangle, CutRectangle]:
        """Return the parts below and above a line across x (0) or y (1)."""
        lower, upper = self.high.copy(), self.low.copy()
        lower[across] = upper[across] = at
        return CutRectangle(self.low, lower), CutRectangle(upper, self.high)


class PlanTriangles(NamedTuple):
    """Triangles seen from above.

    Attributes:
        plan: (n, 3, 2) corners.
        low: (n, 2) least x and y.
        high: (n, 2) largest x and y.
    """

    plan: Floats
    low: Floats
    high: Floats

    @classmethod
    def of(cls, plan: Floats) -> PlanTriangles:
        """Return triangles by their corners, (n, 3, 2)."""
        return cls(plan, plan.min(axis=1), plan.max(axis=1))

    @property
    def extent(self) -> CutRectangle:
        """The smallest rectangle around all."""
        return CutRectangle(self.low.min(axis=0), self.high.max(axis=0))

    def within(self, rectangle: CutRectangle, near: float) -> PlanTriangles:
        """Return those that reach into a rectangle by more than `near`."""
        low, high = rectangle.low + near, rectangle.high - near
        (west, south), (east, north) = self.low.T, self.high.T
        own = (east > low[0]) & (west < high[0]) & (north > low[1]) & (south < high[1])
        found = np.flatnonzero(own)
        # one side of a triangle may have the rectangle on its other side
        away, half = self.plan[found] - rectangle.middle, rectangle.half - near
        sides = away[:, [1, 2, 0]] - away
        normals = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
        along = normals @ away.transpose(0, 2, 1)
        reach = np.abs(normals) @ half
        out = (along.min(axis=2) > reach) | (along.max(axis=2) < -reach)
        found = found[~out.any(axis=1)]
        return PlanTriangles(self.plan[found], self.low[found], self.high[found])


class CutLines(NamedTuple):
    """Lines across one axis, along which a rectangle may be cut.

    Attributes:
        at: (n,) place of each line on the axis.
        ends: (n, 2) place where each line begins and ends on the other axis.
    """

    at: Floats
    ends: Floats

    def longest(
        self, rectangle: CutRectangle, across: int, near: float
    ) -> tuple[float, float] | None:
        """Return the line with the longest sides on it, None where no line is in a rectangle.

        Args:
            rectangle: rectangle to be cut.
            across: axis that the lines are across, 0 for x and 1 for y.
            near: distance that counts as none.

        Returns:
            Length of the sides in parts of the rectangle's, and place of the line.
        """
        (low, high), other = rectangle, 1 - across
        begin = np.maximum(self.ends[:, 0], low[other])
        lengths = np.minimum(self.ends[:, 1], high[other]) - begin
        own = (lengths > near) & (self.at > low[across] + near) & (self.at < high[across] - near)
        if not own.any():
            return None
        order = np.argsort(self.at[own], kind="stable")
        at, lengths = self.at[own][order], lengths[own][order]
        begins = np.flatnonzero(np.diff(at, prepend=-np.inf) > near)
        sums = np.add.reduceat(lengths, begins)
        best = int(np.argmax(sums))
        same = slice(begins[best], begins[best + 1] if best + 1 < len(begins) else len(at))
        place = float(at[same][np.argmax(lengths[same])])
        return float(sums[best] / (high[other] - low[other])), place


def lines_of(outline: Floats, near: float) -> tuple[CutLines, CutLines]:
    """Return lines across x and across y: sides along them, and around connected others.

    Args:
        outline: (n, 2, 2) ends of sides.
        near: distance that counts as none.
    """
    size = np.abs(outline[:, 1] - outline[:, 0])
    slanting = outline[(size > near).all(axis=1)]
    points = np.ascontiguousarray(slanting).reshape(-1, 2).view(np.complex128).ravel()
    names = np.unique(points.round(9), return_inverse=True)[1].reshape(-1, 2)
    joined = components(names, int(names.max(initial=-1)) + 1)[names[:, 0]]
    chains, chain = np.unique(joined, return_inverse=True)
    low, high = np.full((len(chains), 2), np.inf), np.full((len(chains), 2), -np.inf)
    np.minimum.at(low, chain.reshape(-1), slanting.min(axis=1))
    np.maximum.at(high, chain.reshape(-1), slanting.max(axis=1))
    found = []
    for across, other in ((0, 1), (1, 0)):
        straight = outline[size[:, across] <= near]
        at = straight[:, :, across].mean(axis=1), low[:, across], high[:, across]
        around = np.column_stack([low[:, other], high[:, other]])
        own = np.sort(straight[:, :, other], axis=1)
        found.append(CutLines(np.concatenate(at), np.concatenate([own, around, around])))
    return found[0], found[1]


def cut(
    whole: CutRectangle,
    level: PlanTriangles,
    lower: PlanTriangles,
    lines: tuple[CutLines, CutLines],
    least: float,
) -> Iterator[tuple[CutRectangle, Floats]]:
    """Yield rectangles into which nothing lower reaches, and the level triangles in each.

    Args:
        whole: rectangle to be cut.
        level: triangles that the rectangles are to hold.
        lower: triangles that no rectangle may hold.
        lines: lines along which it may be cut.
        least: least side length of a rectangle.
    """
    near = NEAR * least
    stack = [(whole, level, lower)]
    while stack:
        one, level, lower = stack.pop()
        if min(one.half) < 0.5 * least:
            continue
        level, lower = level.within(one, near), lower.within(one, near)
        if not len(level.plan):
            continue
        if not len(lower.plan):
            yield one, level.plan
            continue
        found = [some.longest(one, across, near) for across, some in enumerate(lines)]
        best = max((k for k in (0, 1) if found[k]), key=lambda k: found[k] or (), default=None)
        if best is not None and (line := found[best]):
            stack += [(part, level, lower) for part in one.parts(best, line[1])]
