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
    """

    def __init__(self, terrain: Terrain) -> None:
        self._terrain = terrain
        self._edges = nonzero_edges(terrain.arrays)
        self._idle: deque[kernels.WallFinder] = deque()

    @contextmanager
    def one(self) -> Iterator[kernels.WallFinder]:
        """Lend a finder that no other thread uses meanwhile."""
        try:
            finder = self._idle.pop()
        except IndexError:
            finder = kernels.WallFinder(self._terrain.field, self._edges)
        yield finder
        self._idle.append(finder)
