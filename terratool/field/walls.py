"""Finders of the walls of a terrain, one per thread."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

from terratool.field.bounds import nonzero_edges
from terratool.field.terrain import Terrain
from terratool.kernels import field as kernels


class WallFinders:
    """Pool of wall finders of a terrain, so that each thread has its own.

    Args:
        terrain: terrain with all parts written out.
        storeys: whether walls are those of the highest tops, rather than of the ground alone.
    """

    def __init__(self, terrain: Terrain, storeys: bool = False) -> None:
        self._terrain = terrain
        above = terrain.storeys if storeys else None
        self._storeys = None if above is None else above.field
        self._edges = nonzero_edges(terrain.arrays)
        self._idle: deque[kernels.WallFinder] = deque()

    @contextmanager
    def one(self) -> Iterator[kernels.WallFinder]:
        """Lend a finder that no other thread uses meanwhile."""
        try:
            finder = self._idle.pop()
        except IndexError:
            finder = kernels.WallFinder(self._terrain.field, self._edges, self._storeys)
        yield finder
        self._idle.append(finder)
