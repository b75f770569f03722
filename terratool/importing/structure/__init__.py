"""Boxes, ramps, ridges and hills are recovered from a DEM."""

from __future__ import annotations

from terratool.importing.structure.finding import find_structures
from terratool.importing.structure.spelling import (
    definition_of,
    deviation,
    element_of,
    evaluate,
    primitive_of,
    subtract,
)
from terratool.importing.structure.types import CurveText, Structure

__all__ = [
    "CurveText",
    "Structure",
    "definition_of",
    "deviation",
    "element_of",
    "evaluate",
    "find_structures",
    "primitive_of",
    "subtract",
]
