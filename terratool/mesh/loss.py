"""The statement of loss of a mesh: what it shows and what it cannot, for people and programs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

_NOTICED = 0.1
"""Rounding is worth a word from this part of the allowed error on."""
_NOISE = 1e-6
"""Differences from here on are worth a word, in parts of the distance between two nodes."""


@dataclass(frozen=True, slots=True)
class Peak:
    """The largest of something, and where in the world it is."""

    size: float
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class WallSummary:
    """The walls of a mesh. Lengths are in units of the terrain.

    Attributes:
        length: seen from above.
        area: of their faces.
        highest: the highest one; None without walls.
    """

    length: float = 0.0
    area: float = 0.0
    highest: Peak | None = None


@dataclass(frozen=True, slots=True)
class OmittedElements:
    """Elements that a mesh leaves out, and what they are worth.

    Attributes:
        small: how many were left out because their cells are too small for the mesh.
        faint: how many because they change heights too little …
        faintest: … and no less than what the highest of these changes them by.
        points: at how many points it was measured what all of them together change …
        change: … and the largest change that was found; None without points.
    """

    small: int = 0
    faint: int = 0
    faintest: float = 0.0
    points: int = 0
    change: Peak | None = None


@dataclass(frozen=True, slots=True)
class RutLoss:
    """What a mesh loses of the ruts of a terrain. Lengths are in its units.

    Attributes:
        beside: how far from where it should be a side of a rut stands, at most.
        narrow: number of tracks left out because they are too narrow for the mesh.
        shallow: number of those left out because they make no deeper ruts than was asked …
        deepest: … and the deepest that one of them makes by itself.
    """

    beside: float = 0.0
    narrow: int = 0
    shallow: int = 0
    deepest: float = 0.0


@dataclass(frozen=True, slots=True)
class MeshLoss:
    """What a mesh shows, and what it loses. Lengths are in units of the terrain.

    Attributes:
        wanted: the largest error that was asked for.
        allowed: the largest error that there might be, to keep to `max_faces`.
        error: the one that was reached: no point of the ground is farther, along z, from the
            terrain without what is left out.
        max_faces: how many faces there were to be at most, if that was said.
        aside: how far inside of its arc the wall of a disc stands, at most.
        rounding: how far a coordinate of the file is from that of the mesh, at most.
        walls: its walls, without the outer sides of a solid.
        left: what is left out.
        ruts: what is lost of ruts; None for a terrain without tracks.
    """

    wanted: float
    allowed: float
    error: float
    max_faces: int | None
    aside: float
    rounding: float
    walls: WallSummary
    left: OmittedElements
    ruts: RutLoss | None = None

    @property
    def miss(self) -> float:
        """How far the ground is from the whole terrain: the error and what is left out.

        A bound where nothing is left out, otherwise as far as was measured.
        """
        return self.error + (self.left.change.size if self.left.change else 0.0)

    def as_json(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        left = self.left
        return {
            "wanted_error": self.wanted,
            "allowed_error": self.allowed,
            "error": self.error,
            "max_faces": self.max_faces,
            "miss": self.miss,
            "miss_measured": left.change is not None,
            "aside": self.aside,
            "rounding": self.rounding,
            "walls": walls_as_json(self.walls),
            "left_out": {
                "small": left.small,
                "faint": left.faint,
                "faintest": left.faintest,
                "points": left.points,
                "largest_change": left.change and asdict(left.change),
            },
            **({"ruts": asdict(self.ruts)} if self.ruts else {}),
        }

    def sentences(self) -> Iterator[str]:
        """All of it in lines of text."""
        yield f"Walls: {walls_in_words(self.walls)}."
        parts = [f"the ground is up to {length(self.error)} off the terrain"] * (self.error > 0)
        if self.error > self.allowed:
            parts[0] += ", as nothing finer can be drawn"
        if self.aside > 0:
            parts.append(f"edges of discs lie up to {length(self.aside)} inside of their arcs")
        if self.ruts and self.ruts.beside > 0:
            parts.append(f"sides of ruts lie up to {length(self.ruts.beside)} aside")
        parts += self._left_in_words()
        if self.rounding > _NOTICED * self.allowed:
            parts.append(f"coordinates are rounded by up to {length(self.rounding)}")
        yield f"Lost: {'; '.join(parts) or 'nothing'}."

    def _left_in_words(self) -> Iterator[str]:
        left = self.left
        if left.small:
            yield f"{counted(left.small, 'element')} too small for the mesh left out"
        if left.faint:
            yield (
                f"{counted(left.faint, 'element')} left out to keep to {self.max_faces:,} faces, "
                f"the highest of {length(left.faintest)}"
            )
        yield from self._tracks_in_words()
        if left.change:
            yield (
                f"with them the ground is up to {length(self.miss)} off, as far as was measured "
                f"at {counted(left.points, 'point')}"
            )

    def _tracks_in_words(self) -> Iterator[str]:
        if self.ruts and self.ruts.narrow:
            yield f"{counted(self.ruts.narrow, 'track')} too narrow for the mesh left out"
        if self.ruts and self.ruts.shallow:
            yield (
                f"{counted(self.ruts.shallow, 'track')} left out to keep to {self.max_faces:,} "
                f"faces, the deepest of {length(self.ruts.deepest)}"
            )


@dataclass(frozen=True, slots=True)
class GridLoss:
    """What a grid of heights loses. Lengths are in units of the terrain.

    Attributes:
        spacing: the longer one of the distances between two neighbouring nodes.
        walls: those of the terrain, which become ramps.
        points: at how many points the grid was compared with the terrain …
        miss: … and the largest difference, whichever way viewers halve the squares.
        rms: the root of the mean of the squares of these differences.
    """

    spacing: float
    walls: WallSummary
    points: int
    miss: Peak
    rms: float

    def as_json(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {
            "walls": walls_as_json(self.walls),
            "points": self.points,
            "miss": asdict(self.miss),
            "rms": self.rms,
        }

    def sentences(self) -> Iterator[str]:
        """All of it in a line of text."""
        parts = []
        if self.walls.highest:
            parts.append(
                f"{length(self.walls.length)} of wall, up to {length(self.walls.highest.size)} "
                "high, became ramps"
            )
        if self.miss.size > _NOISE * self.spacing:
            parts.append(
                f"the grid is up to {length(self.miss.size)} off the terrain, "
                f"as measured at {counted(self.points, 'point')}"
            )
        yield f"Lost: {'; '.join(parts) or 'nothing'}."


def walls_as_json(walls: WallSummary) -> dict[str, Any]:
    """Walls as plain values."""
    highest = walls.highest
    return {
        "length": walls.length,
        "area": walls.area,
        "highest": highest and {"height": highest.size, "x": highest.x, "y": highest.y},
    }


def walls_in_words(walls: WallSummary) -> str:
    """Walls in a phrase."""
    if not walls.highest:
        return "none"
    return (
        f"{length(walls.length)} seen from above, {length(walls.area)}², "
        f"up to {length(walls.highest.size)} high"
    )


def length(value: float) -> str:
    """A length in words."""
    return f"{value:.3g} m" if abs(value) < 1000 else f"{value:,.0f} m"


def counted(count: int, what: str) -> str:
    """A number of things in words."""
    return f"{count:,} {what}{'' if count == 1 else 's'}"
