"""Names of what collides: TERRAIN/SURFACE/ELEMENT/NUMBER, so that contacts can be told apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.mesh.formats.common import is_ascii_word, plain_names
from terratool.simulators.scene import Scene
from terratool.text.display import unescape

Floats = NDArray[np.float64]

TRACK, NONE = "track", "ground"
"""Words in place of an element's: for the ruts of a track, and for ground that no element has."""
_INWARDS = 0.9, 0.5, 0.1
"""Places from the middle of a roof to its corners at which the ground is asked, in parts."""


class ContactNames:
    """Names of what collides with one terrain.

    The element's word is the name of the part, or else of the primitive, of the element that stands
    in the terrain's own tree. Numbers count from 0 for each surface and element.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._words: dict[str, str] = {}
        self._counts: Counter[str] = Counter()

    def of_roofs(self, surfaces: Sequence[int], roofs: Sequence[Floats]) -> list[str]:
        """Return names for what has convex roofs, by the elements that the ground under them is of.

        Higher ground may stand on a part of a roof, so the ground is asked in several places.

        Args:
            surfaces: index of the surface of each roof, -1 for none.
            roofs: (n, 3) corners of each roof, in the coordinates of the mesh.
        """
        places = []
        for corners in roofs:
            middle = corners.mean(axis=0)
            inner = [middle + part * (corners - middle) for part in _INWARDS]
            places.append(np.concatenate([middle[None], *inner]))
        return self.at(surfaces, places)

    def at(self, surfaces: Sequence[int], places: Sequence[Floats]) -> list[str]:
        """Return names by the elements of those places that are nearest to the ground.

        Args:
            surfaces: index of the surface of what gets each name, -1 for none.
            places: (n, 3) places on its ground or near it, in the coordinates of the mesh.
        """
        if not places:
            return []
        terrain = self._scene.terrain
        west, south, _, _ = terrain.bounds
        x, y, z = np.concatenate(places).T
        # the mesh may be a little below the terrain
        near = z + self._scene.options.max_error
        below = near if terrain.storeys is not None else None
        found = terrain.sample(x + west, y + south, below)
        counts = [len(one) for one in places]
        off = np.abs(found.height - z)
        off[np.isnan(off) | (found.surface != np.repeat(surfaces, counts))] = np.inf
        which = np.repeat(np.arange(len(places)), counts)
        order = np.lexsort((off, which))  # of equal ones the first
        best = order[np.cumsum([0, *counts[:-1]])]
        elements = found.element[best]
        words = {
            number: self._word(element_word(terrain, number)) if number >= 0 else NONE
            for number in np.unique(elements).tolist()
        }
        return [
            self.next(surface, words[number])
            for surface, number in zip(surfaces, elements.tolist(), strict=True)
        ]

    def next(self, surface: int, element: str) -> str:
        """Return the next name for a surface, by its index, and the word of an element."""
        base = f"{self._scene.name}/{self._scene.material(surface).word}/{element}"
        self._counts[base] += 1
        return f"{base}/{self._counts[base] - 1}"

    def _word(self, name: str) -> str:
        """Return a word in letters, digits and `_` of ASCII for a name, different from others."""
        if name not in self._words:
            *_, self._words[name] = plain_names([*self._words, name], is_ascii_word, "element")
        return self._words[name]


def element_word(terrain: Terrain, element: int) -> str:
    """Return the name of the part, or else of the primitive, of an element of the terrain's tree.

    Args:
        terrain: terrain with all parts written out.
        element: index of the element or of one in its part, as `Terrain.sample` has it, 0 or more.
    """
    pointer = terrain.pointer(element)
    assert pointer is not None
    if pointer.startswith("/tracks/"):
        return TRACK
    _, inside, chain = pointer.partition(">")
    if not inside:
        return terrain.type_of(element)
    # such as kit/storage.json#/parts/rack/children/3, or without the file
    link = chain.partition(">")[0].rpartition("#")[2]
    return unescape(link.split("/")[2])
