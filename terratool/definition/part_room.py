"""Room that parts need for what stands at free places in them."""

from __future__ import annotations

import math

from msgspec import UNSET

from terratool.definition.libraries import known_names
from terratool.definition.model import Pair, pair_of
from terratool.definition.turning import turned_shape
from terratool.definition.uses import Root, Uses, box_of_copies, quarter_turns

_ANY = 0.0, 0.0


class PartRoom:
    """Least cells of the parts that a file without errors knows.

    Args:
        uses: parts of the file and their uses.
    """

    def __init__(self, uses: Uses) -> None:
        self._uses = uses
        self._known: dict[str, Pair] = {}

    def of(self, name: str) -> Pair:
        """Least sides of a cell for a part; 0 where any do."""
        if name not in self._known:
            self._known[name] = self._below(self._uses.graph.root(name))
        return self._known[name]

    def _below(self, root: Root) -> Pair:
        """Least sides of an element's cell, for the part that it is and for its children."""
        tree, index = root.tree, root.element
        name = tree.value("part", index)
        least = _ANY
        if name is not UNSET:
            least = self.of(name)
            if quarter_turns(tree.value("turn_deg", index)) % 2:
                least = least[1], least[0]
        columns, rows = tree.grid(index)
        for child in range(*tree.brood(index)):
            if tree.value("at", child) is not UNSET:
                wanted = self._reach(Root(tree, child, root.home))
            elif tree.value("scatter", child) is not UNSET:
                wanted = _ANY  # the sizes of copies do not depend on the cell
            else:
                below = self._below(Root(tree, child, root.home))
                across, along = tree.block(child)[2:]
                wanted = below[0] * columns / across, below[1] * rows / along
            least = max(least[0], wanted[0]), max(least[1], wanted[1])
        return least

    def _reach(self, root: Root) -> Pair:
        """Distances from the south-west to which an element at a free place reaches."""
        tree, index = root.tree, root.element
        at, extent, repeat = (tree.value(key, index) for key in ("at", "extent", "repeat"))
        end = self._uses.end(root)
        assert end is not None
        primitives = known_names(end.root.home).primitives
        primitive = primitives.get(end.root.tree.value("type", end.root.element))
        round_ = primitive is not None and primitive.value.combine == "radial"
        turn = 0.0 if tree.value("scatter", index) is not UNSET else end.turn
        reach = turned_shape(pair_of(extent, math.nan), turn, round_).reach
        return box_of_copies(at, reach, repeat)[1]
