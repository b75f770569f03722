"""The smallest error for which a mesh has no more than so many faces."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from terratool.errors import RequestError
from terratool.mesh.types import BuiltMesh

BUILDS = 8
"""So many meshes are built between an error that is too large and one that is too small."""
ENOUGH = 0.95
"""A mesh with this part of the faces that it may have is good enough."""
_AIM = 0.975
_STRIDES = 0.125, 0.5
"""By these factors, at the least and the most, an error becomes smaller that is too large."""
_CLOSE = 1.2
"""What is wanted is tried when an error is larger by no more than this factor."""
_NEAR = 1.01
"""Two errors that differ by no more than this factor are the same."""
_POOR = 0.05
"""An error of more than this part of the relief is compared with leaving elements out."""
_FAINT = 0.5, 5.0
"""Elements that change heights by no more than so many errors may be left out: the first of these
is better for smooth ground, the second for blocks, whose number of faces no error changes."""

Attempt = Callable[[float, float], BuiltMesh]
"""Builds a mesh with a largest error, leaving out elements that change heights by no more than …"""


class BudgetedMesh(NamedTuple):
    """A mesh, the error that it was to have, and what left-out elements were to change at most."""

    built: BuiltMesh
    error: float
    least: float

    @property
    def faces(self) -> int:
        """Number of faces."""
        return len(self.built.mesh.faces)

    @property
    def miss(self) -> float:
        """How far the mesh is from the terrain, about."""
        return self.built.error + max(self.built.loss.faintest, self.built.loss.ruts.deepest)

    @property
    def whole(self) -> bool:
        """Whether nothing is left out because it changes heights too little."""
        return not (self.built.loss.faint or self.built.loss.ruts.shallow)


def within_budget(
    attempt: Attempt, wanted: float, relief: float, largest: float, most: int
) -> BudgetedMesh:
    """The mesh with the smallest error that has at most so many faces, as far as a few tries tell.

    First all elements stay, and only the error grows, to all of the relief if need be. Walls stay
    whatever the error, so that may not be enough, or be a poor bargain: then elements that change
    heights little are left out, too, if this makes a better mesh. Errors are tried from large to
    small ones, so that no mesh is built with very many more faces than there may be.

    Args:
        attempt: builds a mesh.
        wanted: the error that would be good enough.
        relief: difference of the highest and the lowest height, about.
        largest: no less than what any element but the root changes a height by.
        most: so many faces.

    Raises:
        RequestError: there are more, whatever is left out.
    """
    top = max(relief, wanted)
    start = min(top, max(wanted, _POOR * relief))
    fits = [_search(partial(_without, attempt, 0.0), wanted, start, top, most)]
    if fits[0].faces > most or fits[0].miss > max(_POOR * relief, 2 * wanted):
        for share in _FAINT:
            # at this error, all elements but the root are left out
            top = max(relief, wanted, 1.001 / share * largest)
            fits.append(_search(partial(_without, attempt, share), wanted, top, top, most))
    fewest = min(fit.faces for fit in fits)
    if fewest > most:
        raise RequestError(
            f"The mesh has {fewest:,} faces at least, and {most:,} are allowed.",
            "Allow more with --max-faces, or give smaller --bounds.",
        )
    return min((fit for fit in fits if fit.faces <= most), key=lambda fit: fit.miss)


def _without(attempt: Attempt, share: float, error: float) -> BudgetedMesh:
    """A mesh without the elements that change heights by no more than so many errors."""
    return BudgetedMesh(attempt(error, share * error), error, share * error)


def _search(
    attempt: Callable[[float], BudgetedMesh], wanted: float, start: float, top: float, most: int
) -> BudgetedMesh:
    """The fit with the smallest error that was found, or the one at the top if none fits.

    Args:
        attempt: builds a mesh with a largest error.
        wanted: the smallest error to try.
        start: the first one.
        top: the largest one.
        most: so many faces.
    """
    aim = _AIM * most
    below: tuple[float, int] | None = None
    high = attempt(start)
    if high.faces > most:
        below = start, high.faces
        if start < top:
            high = attempt(top)
        if high.faces > most:
            return high
    while below is None and high.error > wanted:
        # faces are about as the inverse of the error
        error = high.error * min(max(high.faces / aim, _STRIDES[0]), _STRIDES[1])
        if high.error <= _CLOSE * wanted or (high.built.error <= wanted and high.whole):
            error = wanted  # not many more faces; or, where the mesh is exact, none
        elif high.faces >= ENOUGH * most:
            break
        error = max(error, wanted)
        below, high = _narrowed(attempt(error), below, high, most)
    moved = 0  # how often in a row the same end has come nearer
    for _ in range(BUILDS):
        if not below or high.faces >= ENOUGH * most or high.error <= _NEAR * below[0]:
            break
        share = math.log(below[1] / aim) / math.log(below[1] / max(high.faces, 1))
        # faces that go in steps are no power of anything
        share = 0.5 if abs(moved) > 2 else min(max(share, 0.1), 0.9)
        before = below
        below, high = _narrowed(
            attempt(below[0] ** (1 - share) * high.error**share), below, high, most
        )
        moved = max(moved, 0) + 1 if below is before else min(moved, 0) - 1
    return high


def _narrowed(
    fit: BudgetedMesh, below: tuple[float, int] | None, high: BudgetedMesh, most: int
) -> tuple[tuple[float, int] | None, BudgetedMesh]:
    """The error with too many faces and the best fit, after one more try."""
    return (below, fit) if fit.faces <= most else ((fit.error, fit.faces), high)
