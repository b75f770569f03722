"""Rule on grids of training tiles that cannot be made from their specs."""

from __future__ import annotations

from collections.abc import Iterator

from terratool.definition.findings import Remark
from terratool.definition.rules.base import CurriculumSubject, rule


@rule("TT801", "training-tiles", kind="curriculum")
def training_tiles(subject: CurriculumSubject) -> Iterator[Remark]:
    """A grid of training tiles cannot be made as its spec says.

    There is no such kind of tile, what stands on a tile does not fit into it, a name is none that a
    definition can have, a range ends before it begins, the surface is void, or there are too many
    tiles. Keys, types and ranges have the codes that they have in terrains (TT102 to TT107), and so
    has the surface.

    Fails:

        {"rows": 2, "columns": 3, "kinds": {"up": {"kind": "stairs"}}}

    Fails:

        {"rows": 2, "columns": 3, "tile": 4, "kinds": {"up": {"kind": "waves", "border": 2}}}

    Passes:

        {"rows": 2, "columns": 3, "tile": 8, "kinds": {"up": {"kind": "waves", "border": 2}}}

    To mend: the hint names what is known or what fits; docs/curriculum.md has all kinds and keys.
    """
    from terratool.definition.rules.tile_faults import faults  # few texts are specs

    yield from faults(subject)
