"""Boxes, ramps, ridges and hills are recovered from a DEM."""

from terratool.importing.terrains.structure.evaluating import (
    definition_of,
    deviation,
    element_of,
    evaluate,
    primitive_of,
    subtract,
)
from terratool.importing.terrains.structure.finding import find_structures
from terratool.importing.terrains.structure.types import CurveText, Structure

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
