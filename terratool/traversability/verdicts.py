"""Verdicts, classes of ground, and the measures that bind."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from terratool.kernels import traversability as kernels

_GROUNDS = ("unknown", "go", "caution", "no-go", "cut-off", "edge", "one-way")
_SIGNS = "?✔!✘⊘▫→"


class NamedNumber(IntEnum):
    """A number with a name for people, which is its text."""

    @property
    def label(self) -> str:
        """Name for people and in files."""
        raise NotImplementedError

    def __str__(self) -> str:
        return self.label

    def __format__(self, spec: str) -> str:
        return format(self.label, spec)


class GroundNumber(NamedNumber):
    """A number of a kind of ground."""

    @property
    def label(self) -> str:
        """Name of the kind of ground, for people and in files."""
        return _GROUNDS[self]

    @property
    def sign(self) -> str:
        """One character for those who see no colours."""
        return _SIGNS[self]


class Verdict(GroundNumber):
    """Verdict on driving the vehicle at a place; see `RANKS` for which is worse."""

    UNKNOWN = 0
    GO = 1
    CAUTION = 2
    NO_GO = 3


RANKS = np.array([2, 0, 1, 3], np.uint8)
"""Rank of each `Verdict`, the larger, the worse: go, caution, unknown, no-go."""


class GroundClass(GroundNumber):
    """Class of a place on a map: the verdict of its best heading, and whether it is connected.

    The first four have the names and numbers of `Verdict`.
    """

    UNKNOWN = 0
    GO = 1
    CAUTION = 2
    NO_GO = 3
    CUT_OFF = 4
    EDGE = 5
    ONE_WAY = 6


COLORS: dict[GroundClass, tuple[int, int, int]] = {
    GroundClass.UNKNOWN: (158, 158, 158),
    GroundClass.GO: (190, 232, 218),
    GroundClass.CAUTION: (224, 138, 30),
    GroundClass.NO_GO: (140, 28, 68),
    GroundClass.CUT_OFF: (120, 140, 190),
    GroundClass.EDGE: (228, 228, 228),
    GroundClass.ONE_WAY: (246, 214, 96),
}
"""Red, green, blue of each class, from 0 to 255, distinct for any kind of colour vision.

In grey the verdicts differ, too: L* 88, 65, 31, unknown 65."""

_LABELS = (
    "nothing", "no ground", "edge of the terrain", "soil unknown", "traction", "motor torque",
    "slip", "sinkage", "side-slip", "tip-over", "step", "high-centred", "approach or departure",
    "roughness", "turning on the spot", "drift", "foothold", "keep-out", "headroom",
)  # fmt: skip
"""Names of the measures, by `Reason`."""


class Reason(NamedNumber):
    """The measure that binds: the one nearest to its limit, or farthest beyond it."""

    NONE = 0
    NO_GROUND = 1
    EDGE = 2
    SOIL_UNKNOWN = 3
    TRACTION = 4
    TORQUE = 5
    SLIP = 6
    SINKAGE = 7
    SIDE_SLIP = 8
    TIP_OVER = 9
    STEP = 10
    HIGH_CENTRED = 11
    APPROACH = 12
    ROUGHNESS = 13
    TURNING = 14
    DRIFT = 15
    FOOTHOLD = 16
    KEEP_OUT = 17
    HEADROOM = 18

    @property
    def label(self) -> str:
        """Name of the measure, for people and in files."""
        return _LABELS[self]


kernels.check_enumerations(Verdict, Reason)
