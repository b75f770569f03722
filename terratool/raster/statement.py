"""The statement of loss: what a file of pixels could not keep, for people and for programs."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

_NOISE = 1e-6
"""Differences from here on are worth a word, in parts of a pixel."""


@dataclass(frozen=True, slots=True)
class Wall:
    """A wall between two neighbouring pixels: its size, and the middle between the two."""

    size: float
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class SubpixelFeature:
    """An element, or a detail of its curves, that is narrower than a pixel."""

    element: str
    width: float


@dataclass(frozen=True, slots=True)
class SubpixelFeatures:
    """How many there are, and the first of them."""

    count: int
    first: tuple[SubpixelFeature, ...]


@dataclass(frozen=True, slots=True)
class InterpolationError:
    """How far bilinear interpolation between the pixels is from the terrain.

    Attributes:
        points: at how many points it was measured.
        largest: the largest difference, without sign.
        rms: the root of the mean of their squares.
        x, y: where the largest one is.
        element: JSON pointer of the element there, or None.
    """

    points: int
    largest: float
    rms: float
    x: float
    y: float
    element: str | None


@dataclass(frozen=True, slots=True)
class RasterLoss:
    """What a grid loses. Lengths are in units of the terrain.

    Attributes:
        resolution: side of a pixel.
        wall_length: length, seen from above, of the walls that became ramps. A wall between two
            pixels counts by the direction it runs in, so turned and round walls have their length.
        wall_pairs: number of pairs of neighbours with a wall between them.
        estimated: whether these two numbers are estimates, from a part of the walls; `highest` is
            then the highest of that part.
        steepest: the steepest ramp that a wall became, its size the difference of the two pixels as
            stored; None without walls that are at least half of such a difference.
        highest: the highest wall between two pixels; None without walls.
        narrow: elements whose cells are narrower than a pixel.
        details: other elements with a straight stretch of a curve narrower than a pixel.
        nodata: pixels without a height.
        misfit: what lies between the pixels; None where no four of them have heights.
    """

    resolution: float
    wall_length: float
    wall_pairs: int
    estimated: bool
    steepest: Wall | None
    highest: Wall | None
    narrow: SubpixelFeatures
    details: SubpixelFeatures
    nodata: int
    misfit: InterpolationError | None

    @property
    def steepest_degrees(self) -> float:
        """Slope of the steepest ramp that a wall became; 0 without walls."""
        rise = self.steepest.size if self.steepest else 0.0
        return math.degrees(math.atan2(rise, self.resolution))

    def as_json(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""

        def narrows(found: SubpixelFeatures) -> dict[str, Any]:
            return {"count": found.count, "first": [asdict(one) for one in found.first]}

        steepest, highest = self.steepest, self.highest
        return {
            "walls": {
                "length": self.wall_length,
                "pairs": self.wall_pairs,
                "estimated": self.estimated,
                "steepest_ramp": steepest
                and {
                    "degrees": self.steepest_degrees,
                    "rise": steepest.size,
                    "x": steepest.x,
                    "y": steepest.y,
                },
                "largest_jump": highest
                and {"height": highest.size, "x": highest.x, "y": highest.y},
            },
            "narrow_elements": narrows(self.narrow),
            "narrow_details": narrows(self.details),
            "nodata": self.nodata,
            "interpolation": self.misfit and asdict(self.misfit),
        }

    def sentence(self) -> str:
        """All of it in a line of text."""
        parts = []
        if self.highest:
            about = "about " if self.estimated else ""
            slope = f" of up to {self.steepest_degrees:.1f}°" if self.steepest else ""
            parts.append(
                f"{about}{_length(self.wall_length)} of wall became ramps{slope} "
                f"({_length(self.highest.size)} in one pixel)"
            )
        if self.narrow.count:
            parts.append(
                _counted(self.narrow.count, "element is", "elements are") + " narrower than a pixel"
            )
        if self.details.count:
            parts.append(
                _counted(self.details.count, "element has", "elements have")
                + " details narrower than a pixel"
            )
        if self.misfit and self.misfit.largest > _NOISE * self.resolution:
            parts.append(f"pixels differ from the model by up to {_length(self.misfit.largest)}")
        if not parts:
            return "Lost: nothing; no walls, nothing narrower than a pixel."
        return f"Lost: {'; '.join(parts)}."


def _length(value: float) -> str:
    return f"{value:.3g} m" if abs(value) < 1000 else f"{value:,.0f} m"


def _counted(count: int, one: str, several: str) -> str:
    return f"{count:,} {one if count == 1 else several}"
