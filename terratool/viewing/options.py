"""Options of a picture of a terrain, and the report on one that was drawn."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.viewing.sheet import FORMATS

LEAST_SIZE, MOST_SIZE = 200, 4096
"""Fewest and most pixels of the longer side of a picture."""
LEAST_DPI, MOST_DPI = 36.0, 600.0
"""Fewest and most pixels per inch."""
LEAST_EXAGGERATION, MOST_EXAGGERATION = 1e-6, 1e6
"""Smallest and largest factor on heights."""

CUT = ("height", "slope", "surface", "friction")
"""Names of the layers that can be cut at a height."""

Contours = float | Literal["auto"] | None
"""An interval of contours, m; "auto" for a round one; None for no contours."""
Line = tuple[float, float, float, float]
"""World x and y of the first end of a line, and of the last."""


def line_length(line: Line) -> float:
    """Length of a line, seen from above, world units."""
    x0, y0, x1, y1 = line
    return math.hypot(x1 - x0, y1 - y0)


@dataclass(frozen=True, slots=True)
class RenderOptions:
    """Options of a picture.

    Attributes:
        layer: layer that the colours show, one of `terratool.viewing.layers.NAMES`.
        vehicle: path of the vehicle of the layers `traversability`, `traversability-worst` and
            `foothold`.
        bounds: west, south, east, north of the picture, world units; the whole terrain if None.
        contours: interval of contours, in units of the terrain; "auto" for a round one with about
            eight contours; None for no contours.
        cut: height of a plan's cut, in units of the terrain: the highest tops that are not above it
            are drawn; None for the highest of all.
        grid: whether nested cells are drawn, with the descriptions of elements.
        profile: x and y of both ends of a section, which is drawn instead of a plan.
        perspective: whether a view from the side is drawn instead of a plan.
        azimuth: direction from which a perspective is seen, degrees clockwise from north, -360 to
            360.
        elevation: angle above the horizon from which a perspective is seen, degrees, 5 to 90; -5 to
            -90 for undersides of decks and ceilings of bores, seen from below.
        max_error: largest error of a perspective's mesh, in units of the terrain; half a pixel if
            None.
        exaggeration: factor on heights of a section or a perspective; chosen if None.
        title: title over the picture; the terrain's description if None, no title if empty.
        legend: whether a legend of the colours is drawn.
        bare: whether all letters, axes and legends are left out.
        pixels: number of pixels of the longer side.
        dpi: pixels per inch; letters keep their size in inches.
    """

    layer: str = "surface"
    vehicle: str | Path | None = None
    bounds: Bounds | None = None
    contours: Contours = None
    cut: float | None = None
    grid: bool = False
    profile: Line | None = None
    perspective: bool = False
    azimuth: float = 215.0
    elevation: float = 35.0
    max_error: float | None = None
    exaggeration: float | None = None
    title: str | None = None
    legend: bool = True
    bare: bool = False
    pixels: int = 1600
    dpi: float = 150.0

    def check(self) -> None:
        """Refuse options that make no sense for any terrain.

        Raises:
            RequestError: an option makes no sense; the message names it.
        """
        from terratool.viewing.layers import check_layer

        check_layer(self.layer, self.vehicle)
        if not LEAST_SIZE <= self.pixels <= MOST_SIZE:
            raise RequestError(
                f"The longer side is to have {self.pixels:,} pixels.",
                f"Give --pixels from {LEAST_SIZE} to {MOST_SIZE:,}; look closer with --bounds, or "
                "write a raster of any size with terratool export-dem.",
            )
        if not LEAST_DPI <= self.dpi <= MOST_DPI:
            raise RequestError(
                f"An inch is to have {self.dpi:g} pixels.",
                f"Give --dpi from {LEAST_DPI:g} to {MOST_DPI:g}.",
            )
        if self.pixels / self.dpi < 3.0 and not self.bare:
            raise RequestError(
                f"{self.pixels} pixels at {self.dpi:g} to an inch leave no room beside the "
                "letters.",
                f"Give --pixels of at least {math.ceil(3.0 * self.dpi)}, a smaller --dpi, "
                "or --bare.",
            )
        self._check_contours()
        self._check_views()

    @property
    def has_storeys(self) -> bool:
        """Whether the picture shows the decks and bores of a terrain."""
        return self.vehicle is None

    @property
    def has_legend(self) -> bool:
        """Whether the picture has a legend."""
        return self.legend and not self.bare

    def title_of(self, descr: str) -> str:
        """Title of the picture of a terrain with a description, `descr`; empty for no title."""
        if self.bare:
            return ""
        return descr if self.title is None else self.title

    def _check_contours(self) -> None:
        """Refuse an interval of contours that is a wrong word, or not finite and above 0."""
        interval = self.contours
        if isinstance(interval, str) and interval != "auto":
            raise RequestError(f"Contours are to be {interval!r}.", 'Give a height, or "auto".')
        if isinstance(interval, int | float) and not (math.isfinite(interval) and interval > 0.0):
            raise RequestError(
                f"Contours are to be {interval:g} apart.", "Give a finite height above 0."
            )

    def _check_views(self) -> None:
        """Refuse options of one kind of picture (plan, section, perspective) with another."""
        if self.profile is not None and self.perspective:
            raise RequestError(
                "A section and a perspective are two pictures.",
                "Leave out --profile or --perspective.",
            )
        upright = self.profile is not None or self.perspective
        what = "a section" if self.profile is not None else "a perspective"
        plans = {
            "--contours": self.contours is not None, "--cut": self.cut is not None,
            "--grid": self.grid,
        }  # fmt: skip
        for option, given in plans.items():
            if given and upright:
                raise RequestError(f"{option} is about plans, not {what}.", f"Leave out {option}.")
        self._check_cut()
        if self.profile is not None:
            self._check_profile(self.profile)
        factor = self.exaggeration
        if factor is not None:
            if not upright:
                raise RequestError(
                    "Heights of a plan are not exaggerated.",
                    "Leave out --exaggeration, or add --profile or --perspective.",
                )
            if not LEAST_EXAGGERATION <= factor <= MOST_EXAGGERATION:
                raise RequestError(
                    f"The exaggeration is {factor:g}.",
                    f"Give a factor from {LEAST_EXAGGERATION:g} to {MOST_EXAGGERATION:g}.",
                )
        if self.perspective:
            self._check_perspective()

    def _check_cut(self) -> None:
        """Refuse a cut at no height, and one with a layer that does not know it."""
        if self.cut is None:
            return
        if not math.isfinite(self.cut):
            raise RequestError(f"The cut is at {self.cut:g}.", "Give a finite height.")
        if self.layer not in CUT:
            raise RequestError(
                f"The layer {self.layer} is not cut.",
                f"Leave out --cut, or choose one of {', '.join(CUT)}.",
            )

    def _check_profile(self, line: Line) -> None:
        """Refuse options that a section does not have, and ends that are one point."""
        if self.bounds is not None:
            raise RequestError("A section ends where --profile says.", "Leave out --bounds.")
        if self.layer != "surface":
            raise RequestError(f"A section shows surfaces, not {self.layer}.", "Leave out --layer.")
        if not all(map(math.isfinite, line)):
            said = " ".join(f"{value:g}" for value in line)
            raise RequestError(
                f"The ends of the section are {said}.", "Give four finite numbers: X0 Y0 X1 Y1."
            )
        if line[:2] == line[2:]:
            raise RequestError("Both ends of the section are one point.", "Give two points.")

    def _check_perspective(self) -> None:
        """Refuse angles and errors of a perspective that are out of range."""
        if not -360.0 <= self.azimuth <= 360.0:
            raise RequestError(
                f"The azimuth is {self.azimuth:g} degrees.", "Give --azimuth from -360 to 360."
            )
        if not 5.0 <= abs(self.elevation) <= 90.0:
            raise RequestError(
                f"The perspective is to be seen from {self.elevation:g} degrees above.",
                "Give --elevation from 5 to 90, or from -90 to -5 for what decks have below.",
            )
        error = self.max_error
        if error is not None and not (math.isfinite(error) and error > 0.0):
            raise RequestError(f"The largest error is {error:g}.", "Give a finite height above 0.")


def refuse_idle(given: Set[str], perspective: bool) -> None:
    """Refuse options about a perspective where none is drawn.

    Args:
        given: names of the options that the user gave.
        perspective: whether a perspective is drawn.

    Raises:
        RequestError: an option would have no effect.
    """
    for name in ("azimuth", "elevation", "max_error"):
        if name in given and not perspective:
            option = f"--{name.replace('_', '-')}"
            raise RequestError(
                f"{option} is about perspectives.", f"Add --perspective, or leave out {option}."
            )


@dataclass(frozen=True, slots=True)
class RenderReport:
    """A report on a picture that was drawn.

    Attributes:
        path: path of the picture.
        width, height: pixels of the picture; for SVG and PDF those of a print at the wanted `dpi`.
        what: contents of the picture, in words.
        notes: sentences on choices, and on facts that the picture does not show.
    """

    path: Path
    width: int
    height: int
    what: str
    notes: tuple[str, ...]


def picture_format(path: Path) -> str:
    """The suffix of a picture's path, in lower case.

    Raises:
        RequestError: no picture is written with that suffix.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        named = f"{suffix!r}" if suffix else "no suffix"
        raise RequestError(
            f"{path.name}: a picture has {named}, which says no format."
            if not suffix
            else f"{path.name}: pictures are not written as {named}.",
            f"Give a name that ends in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}.",
        )
    return suffix
