"""Training tiles from Python, with the options of `terratool curriculum`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from terratool.api.options import takes
from terratool.authoring.curriculum.build import Curriculum, curriculum
from terratool.definition.tile_spec import Spec


@takes(called="curriculum")
def curriculum_of(
    spec: Spec | Mapping[str, Any] | str | Path, seed: int | None = None
) -> Curriculum:
    """Make a grid of training tiles.

    Args:
        spec: a spec, the dictionary of one, or the path of its file.
        seed: seed in place of the spec's own; None for its own. A `Spec` keeps its own.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the spec is not valid; `findings` has all that is wrong.
        RequestError: the seed is out of its range, or the tiles come to too many elements.
    """
    return curriculum(spec, seed)
