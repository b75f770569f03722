"""The sheet of a picture: a figure with a size in pixels, its legend, scale bar and north arrow.

Matplotlib draws with the settings that are fixed here: files of settings, styles and the time have
no effect, and its global state is left as it was.
"""

from __future__ import annotations

import contextlib
import io
import logging
import math
import warnings
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from terratool.apart import apart
from terratool.errors import RequestError
from terratool.extras import install_command
from terratool.raster.shading import ticks
from terratool.report.numbers import round_down, round_up
from terratool.text.display import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".png", ".svg", ".pdf")
"""Suffixes of the files that pictures are written as."""

INK = "#202020"
"""Colour of lines and letters."""
_FAINT = "#606060"
"""Colour of captions."""
_FONT, _SMALL = 8.0, 7.0
"""Sizes of letters and of small letters, points of 1/72 inch."""
_LETTER = 0.55
"""Approximate width of a letter, in sizes of the letters."""
_LINE = 1.45
"""Distance from one line of text to the next, in sizes of the letters."""
_SWATCH = 14.0
"""Width of a patch of colour in a legend, points."""
_MOST_SWATCHES = 40
"""Most lines of a legend."""
_FLATTEST, _TALLEST = 1 / 20, 2.0
"""Least and largest relief that is shown without a factor, as shares of the width."""
_LEVEL = 1e-6
"""Relief up to which ground is level, as a share of the width."""

_SETTINGS = {
    "font.family": ["DejaVu Sans"],
    "font.size": _FONT,
    "text.parse_math": False,  # a name may have two dollar signs
    "svg.hashsalt": "terratool",
    "svg.fonttype": "none",  # texts stay texts
    "path.simplify": False,  # what stands upright stays so
    "hatch.linewidth": 0.6,
}
"""Settings of Matplotlib that differ from its defaults."""
_METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": "terratool"},
    ".pdf": {"CreationDate": None, "Creator": "terratool", "Producer": None},
}
"""Metadata of the files by suffix; None leaves out an entry of Matplotlib's."""


class Rectangle(NamedTuple):
    """A rectangle on a sheet, in pixels from its south-west corner."""

    left: int
    bottom: int
    width: int
    height: int


class Swatch(NamedTuple):
    """A line of a legend.

    Attributes:
        label: text of the line.
        color: red, green, blue, 0 to 255.
        hatch: pattern of Matplotlib over the colour; empty for none.
        letter: letter on the colour, in the legend and in the picture; empty for none.
    """

    label: str
    color: tuple[int, int, int]
    hatch: str = ""
    letter: str = ""


class Scale(NamedTuple):
    """A scale of colours for numbers.

    Attributes:
        title: name of the numbers, with their unit.
        low, high: numbers at both ends.
        colors: name of the colour map of Matplotlib.
    """

    title: str
    low: float
    high: float
    colors: str


class Legend(NamedTuple):
    """The legend of a picture.

    Attributes:
        title: title over the lines; empty for none.
        swatches: lines of the legend.
        scale: scale of colours; None where colours stand for no numbers.
    """

    title: str = ""
    swatches: tuple[Swatch, ...] = ()
    scale: Scale | None = None


def require_matplotlib() -> None:
    """Refuse to draw without Matplotlib.

    Raises:
        RequestError: Matplotlib is not installed.
    """
    try:
        with _quiet_matplotlib(), apart():
            import matplotlib  # noqa: F401, only whether it is there
    except ImportError as error:
        raise RequestError(
            "Pictures are drawn by Matplotlib, which is not installed.",
            f"Run {install_command('plot')}",
        ) from error


@contextlib.contextmanager
def _quiet_matplotlib() -> Iterator[None]:
    """Silence Matplotlib's warnings on folders that it cannot write and on missing fonts."""
    log = logging.getLogger("matplotlib")
    before = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(before)


@dataclass(frozen=True)
class Sheet:
    """A figure with places in pixels from its south-west corner.

    Attributes:
        figure: figure of Matplotlib.
        width, height: sides, pixels.
        dpi: pixels per inch, which has 72 points.
    """

    figure: Figure
    width: int
    height: int
    dpi: float

    def pixels(self, points: float) -> int:
        """Convert points to whole pixels."""
        return round(points * self.dpi / 72.0)

    def axes(self, place: Rectangle) -> Axes:
        """Add axes at a place."""
        left, bottom, width, height = place
        axes: Axes = self.figure.add_axes(
            (
                left / self.width,
                bottom / self.height,
                width / self.width,
                height / self.height,
            )
        )
        return axes

    def text(self, x: float, y: float, text: str, **style: Any) -> None:
        """Draw a text at a place in pixels."""
        style = {"color": INK, "fontsize": _FONT, **style}
        self.figure.text(x / self.width, y / self.height, text, **style)

    def line(self, x: Sequence[float], y: Sequence[float], **style: Any) -> None:
        """Draw a line through places in pixels."""
        from matplotlib.lines import Line2D

        style = {"color": INK, "linewidth": 0.8, "solid_capstyle": "butt", **style}
        places = [value / self.width for value in x], [value / self.height for value in y]
        self.figure.add_artist(Line2D(*places, transform=self.figure.transFigure, **style))

    def patch(self, x: Sequence[float], y: Sequence[float], **style: Any) -> None:
        """Draw a filled shape through places in pixels."""
        from matplotlib.patches import Polygon

        corners = [(a / self.width, b / self.height) for a, b in zip(x, y, strict=True)]
        style = {"facecolor": INK, "edgecolor": INK, "linewidth": 0.6, **style}
        self.figure.add_artist(
            Polygon(corners, closed=True, transform=self.figure.transFigure, **style)
        )

    def key(self, key: Legend, place: Rectangle) -> None:
        """Draw a legend at the top of a place, and its colour bar below."""
        top = place.bottom + place.height
        line = self.pixels(_FONT * _LINE)
        if key.title and key.swatches:
            self.text(place.left, top, key.title, va="top", fontweight="bold")
            top -= round(1.3 * line)
        fits = max(1, (top - place.bottom) // line - (0 if key.scale is None else 8))
        shown = min(len(key.swatches), fits, _MOST_SWATCHES)
        if shown < len(key.swatches):
            shown = max(shown - 1, 0)
        wide, room = self.pixels(_SWATCH), place.width - self.pixels(1.5 * _SWATCH)
        for swatch in key.swatches[:shown]:
            low, high = top - round(0.85 * line), top - round(0.05 * line)
            left, right = place.left, place.left + wide
            red, green, blue = (part / 255.0 for part in swatch.color)
            self.patch(
                [left, right, right, left], [low, low, high, high],
                facecolor=(red, green, blue), hatch=swatch.hatch or None,
            )  # fmt: skip
            if swatch.letter:
                dark = 0.3 * red + 0.6 * green + 0.1 * blue < 0.5
                self.text(
                    (left + right) / 2, (low + high) / 2, swatch.letter, ha="center",
                    va="center_baseline", fontsize=_SMALL, fontweight="bold",
                    color="white" if dark else INK,
                )  # fmt: skip
            label = self.shorten(swatch.label, room, _FONT)
            self.text(place.left + self.pixels(1.5 * _SWATCH), top, label, va="top")
            top -= line
        if shown < len(key.swatches):
            left_out = f"and {len(key.swatches) - shown} more"
            self.text(place.left, top, left_out, va="top", color=_FAINT)
            top -= line
        if key.scale is not None:
            self._color_bar(key.scale, place, top - line // 2)

    def _color_bar(self, scale: Scale, place: Rectangle, top: int) -> None:
        """Draw a colour bar in a place, from `top` downwards."""
        import numpy as np

        line = self.pixels(_FONT * _LINE)
        self.text(place.left, top, scale.title, va="top", fontweight="bold")
        top -= round(1.6 * line)
        tall = max(4 * line, min(top - place.bottom, 14 * line))
        axes = self.axes(Rectangle(place.left, top - tall, self.pixels(_SWATCH), tall))
        axes.imshow(
            np.linspace(0.0, 1.0, 256)[:, None], cmap=scale.colors, aspect="auto", origin="lower",
            extent=(0.0, 1.0, scale.low, scale.high),
        )  # fmt: skip
        axes.set_xticks([])
        axes.yaxis.tick_right()
        set_ticks(axes, "y", max(2, tall // (3 * line)))

    def shorten(self, text: str, room: float, size: float = _FONT) -> str:
        """Shorten a text to one line that about fits into `room` pixels."""
        text = " ".join(printable(text).split())
        most = max(3, int(room / (self.pixels(size) * _LETTER)))
        return text if len(text) <= most else f"{text[: most - 1]}…"

    def text_width(self, text: str, size: float, weight: str = "normal") -> float:
        """Width of a line of text, pixels."""
        from matplotlib.backends.backend_agg import RendererAgg
        from matplotlib.font_manager import FontProperties

        # measured as Agg draws pixels: its letters are set wider than outlines
        letters = FontProperties(size=size, weight=weight)
        untyped: Any = RendererAgg
        renderer = untyped(1, 1, self.dpi)
        return float(renderer.get_text_width_height_descent(text, letters, False)[0])

    def fitting_size(self, text: str, left: int, size: float, weight: str = "normal") -> float:
        """Largest size of letters up to `size`, points, at which a line fits from `left` on."""
        room = self.width - left - self.pixels(6.0)
        return size * min(1.0, room / max(self.text_width(text, size, weight), 1.0))

    def title(self, text: str, left: int, room: int) -> None:
        """Draw a title at the very top, cut off to fit into `room` pixels."""
        size, weight = _FONT + 2.0, "bold"
        text = " ".join(printable(text).split())

        def cut(kept: int) -> str:
            return f"{text[:kept].rstrip()}…"

        # no letter is narrower than a pixel
        if len(text) > room or self.text_width(text, size, weight) > room:
            lengths = range(1, min(len(text), room))
            text = cut(
                bisect_right(
                    lengths, room, key=lambda n: math.ceil(self.text_width(cut(n), size, weight))
                )
            )
        self.text(
            left, self.height - self.pixels(6.0), text, va="top", fontsize=size, fontweight=weight
        )

    def caption(self, lines: Sequence[str], left: int, bottom: int) -> None:
        """Draw small lines of text, the last of them at the bottom; smaller still if need be."""
        size = min((self.fitting_size(text, left, _SMALL) for text in lines), default=_SMALL)
        for up, text in enumerate(reversed(lines)):
            y = bottom + up * self.pixels(_SMALL * _LINE)
            self.text(left, y, text, va="bottom", fontsize=size, color=_FAINT)

    def warning(self, factor: float, left: int, bottom: int) -> None:
        """Draw a bold line on a factor on heights."""
        said = f"{exaggeration_text(factor).capitalize()}: {slopes_look(factor)}."
        size = self.fitting_size(said, left, _FONT, "bold")
        self.text(left, bottom, said, va="bottom", fontsize=size, fontweight="bold")

    def scale_bar(self, place: Rectangle, per_pixel: float, unit: str) -> None:
        """Draw a scale bar of a round length that fits into a place, in two halves.

        `per_pixel` is the length of a pixel, in the unit.
        """
        whole = round_down(place.width * per_pixel)
        long = whole / per_pixel
        low, high = place.bottom, place.bottom + self.pixels(3.0)
        for part, color in enumerate((INK, "white")):
            left = place.left + part * long / 2.0
            right = left + long / 2.0
            self.patch([left, right, right, left], [low, low, high, high], facecolor=color)
        above = high + self.pixels(2.0)
        self.text(place.left, above, "0", ha="center", va="bottom", fontsize=_SMALL)
        self.text(
            place.left + long, above, f"{number(whole)} {unit}", ha="center", va="bottom",
            fontsize=_SMALL,
        )  # fmt: skip

    def north_arrow(self, x: float, y: float, towards: tuple[float, float] = (0.0, 1.0)) -> None:
        """Draw a north arrow with its foot at a place in pixels.

        `towards` is the place of its tip from its foot, right and up, in lengths of the arrow.
        """
        tall, half = self.pixels(20.0), self.pixels(4.5)
        right, up = towards
        long = math.hypot(right, up) or 1.0
        across = -up / long * half, right / long * half
        tip = x + right * tall, y + up * tall
        notch = x + right * tall * 0.25, y + up * tall * 0.25
        for side, color in ((1.0, INK), (-1.0, "white")):
            wing = x + side * across[0], y + side * across[1]
            self.patch(
                [tip[0], wing[0], notch[0]], [tip[1], wing[1], notch[1]], facecolor=color,
                joinstyle="round",
            )  # fmt: skip
        gap = self.pixels(5.5)
        self.text(
            tip[0] + right / long * gap, tip[1] + up / long * gap, "N", ha="center", va="center",
            fontweight="bold",
        )  # fmt: skip


def number(value: float) -> str:
    """A number as text on axes: up to 10 digits, without trailing zeros."""
    text = f"{value:.10g}"
    return "0" if text == "-0" else text


def chosen_exaggeration(width: float, relief: float, most: float) -> float:
    """Choose a round factor on heights.

    The factor is 1 for most relief. Relief flatter than `_FLATTEST` of the width is raised to that
    share, by a factor of `most` at most. Relief higher than `_TALLEST` times the width is lowered.
    """
    if not relief > _LEVEL * width:
        return 1.0
    if relief > _TALLEST * width:
        return round_down(width / relief)
    return min(round_up(max(_FLATTEST * width / relief, 1.0), (1, 2, 3, 5)), most)


def exaggeration_text(factor: float) -> str:
    """Words on a factor on heights."""
    if factor == 1.0:
        return "heights not exaggerated"
    if factor < 1.0:
        return f"heights multiplied by {number(float(f'{factor:.6g}'))}"
    return f"heights exaggerated {number(float(f'{factor:.6g}'))} times"


def slopes_look(factor: float) -> str:
    """Words on the look of slopes with a factor on heights."""
    return f"slopes look {'steeper' if factor > 1.0 else 'gentler'} than they are"


def note_of_chosen(factor: float, wanted: float | None) -> tuple[str, ...]:
    """A sentence on a factor on heights that was chosen; none where it is 1 or was wanted."""
    if wanted is not None or factor == 1.0:
        return ()
    look = slopes_look(factor)
    return (f"{look[0].upper()}{look[1:]}; --exaggeration 1 shows them as they are.",)


def set_ticks(axes: Axes, axis: str, count: int) -> list[str]:
    """Set about `count` round numbers on an axis, "x" or "y", and return their labels."""
    low, high = axes.get_xlim() if axis == "x" else axes.get_ylim()
    places = ticks(low, high, max(1, count))
    labels = [number(place) for place in places]
    side = axes.xaxis if axis == "x" else axes.yaxis
    side.set_ticks(places, labels=labels)
    side.set_tick_params(labelsize=_SMALL, length=3.0, width=0.6, colors=INK)
    return labels


def width_of(labels: Sequence[str]) -> float:
    """Approximate width of the widest of some small labels, points."""
    return max((len(label) for label in labels), default=0) * _SMALL * 0.65


def key_width(key: Legend) -> float:
    """Approximate width of a legend, points, from 60 to 150."""
    letters = max((len(swatch.label) for swatch in key.swatches), default=0)
    scale = 0 if key.scale is None else len(key.scale.title)
    wanted = 1.5 * _SWATCH + letters * _FONT * 0.62
    return min(max(wanted, scale * _FONT * 0.7, 60.0), 150.0)


@contextlib.contextmanager
def settings() -> Iterator[None]:
    """Have Matplotlib draw by its own defaults and by `_SETTINGS` alone."""
    require_matplotlib()
    import matplotlib as mpl

    wanted: dict[Any, Any] = dict(mpl.rcParamsDefault)
    wanted.update(_SETTINGS)
    for name in [name for name in wanted if name.startswith("backend")]:
        del wanted[name]  # of windows, of which there are none
    with mpl.rc_context(wanted), warnings.catch_warnings(), _quiet_matplotlib():
        # letters that the font lacks become boxes in a PNG; in an SVG they are still letters
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def new_sheet(width: int, height: int, dpi: float) -> Sheet:
    """An empty sheet with sides in pixels, within `settings`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / dpi, height / dpi), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return Sheet(figure, width, height, dpi)


def encoded(sheet: Sheet, suffix: str) -> bytes:
    """Encode a sheet in the format of a suffix, within `settings`."""
    drawn = io.BytesIO()  # on a full disk the writer of PDF would end in an error of its own
    sheet.figure.savefig(drawn, format=suffix[1:], dpi=sheet.dpi, metadata=_METADATA[suffix])
    return drawn.getvalue()


def write(sheet: Sheet, path: Path) -> None:
    """Write a sheet in the format of a path's suffix, within `settings`."""
    path.write_bytes(encoded(sheet, path.suffix.lower()))
