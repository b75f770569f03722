"""The picture of docs/validation.md: measured points, and the curves of the model."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from terratool.traversability.report.curves import PlotFrame
from tests.validation.series import (
    AGAIN,
    DING,
    DING_SMOOTH,
    K10,
    K10_LUGS,
    KLS,
    KLS_LUGS,
    MGRU3,
    RASHID,
    TREC,
    Array,
    Series,
    angles_of,
    with_modulus,
)

PICTURE = Path(__file__).parents[2] / "docs" / "images" / "validation.svg"

WIDTH, HEIGHT, TOP, SIDE = 300, 240, 46, 260
STYLE = """\
text { font: 12px sans-serif; fill: #222 }
.t { font-weight: bold }
.s { font-size: 11px; fill: #555 }
.g { stroke: #ddd; fill: none }
.b { fill: #1f5f99; fill-opacity: .13 }
.m { fill: none; stroke: #1f5f99; stroke-width: 2 }
.n { fill: none; stroke: #1f5f99; stroke-width: 1.5; stroke-dasharray: 5 3 }
.p { fill: #c0392b }
.q { fill: #fff; stroke: #c0392b; stroke-width: 1.6 }"""


def place(number: int) -> tuple[float, float]:
    """Left and top of a panel, three in a row."""
    return 50 + (number % 3) * (WIDTH + 10), TOP + (number // 3) * 340


class Panel:
    """Slip to the right, 0 to 100 %, and the angle up, −5 to 35°."""

    def __init__(self, left: float, top: float, title: str) -> None:
        self.left = left
        self.frame = PlotFrame(left, top, SIDE, HEIGHT, (0.0, 1.0), (-5.0, 35.0))
        self.parts = [f'<text class="t" x="{left}" y="{top - 18}">{title}</text>']
        for angle in range(0, 31, 10):
            self._line("g", np.array([0.0, 1.0]), np.full(2, float(angle)))
            self._text(left - 6, self.frame.down(angle) + 4, f"{angle}°", "end")
        for slip in (0, 20, 40, 60, 80, 100):
            self._text(self.frame.right(slip / 100), top + HEIGHT + 16, f"{slip} %", "middle")
        self._text(self.frame.right(0.5), top + HEIGHT + 34, "slip", "middle")

    def _text(self, x: float, y: float, text: str, anchor: str = "start") -> None:
        self.parts.append(
            f'<text class="s" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'
        )

    def _line(self, kind: str, slips: Array, angles: Array) -> None:
        self.parts.append(f'<polyline class="{kind}" points="{self.frame.points(slips, angles)}"/>')

    def curve(self, kind: str, series: Series) -> None:
        """What the model says of a series."""
        slips = _slips(series)
        self._line(kind, slips, angles_of(series, slips))

    def band(self, series: Series, low: float, high: float) -> None:
        """What it says for K from `low` to `high`."""
        slips = _slips(series)
        upper, lower = (with_modulus(k)(series, slips, series.load) for k in (low, high))
        around = np.concatenate([slips, slips[::-1]]), np.concatenate([upper, lower[::-1]])
        self.parts.insert(0, f'<polygon class="b" points="{self.frame.points(*around)}"/>')

    def dots(self, kind: str, series: Series) -> None:
        """What was measured."""
        for slip, angle in zip(*series.measured, strict=True):
            x, y = self.frame.right(slip), self.frame.down(angle)
            self.parts.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="4"/>')

    def legend(self, lowest: float, *rows: tuple[str, str]) -> None:
        """What its marks mean, from an angle up."""
        x, bottom, high = self.left + 90.0, self.frame.down(lowest), 15.0 * len(rows)
        self.parts.append(
            f'<rect x="{x - 14}" y="{bottom + 4 - high:.1f}" width="170" height="{high}" '
            'fill="#fff"/>'
        )
        for n, (kind, text) in enumerate(rows):
            y = bottom - 15.0 * n
            if kind in "pq":
                self.parts.append(f'<circle class="{kind}" cx="{x}" cy="{y - 4:.1f}" r="4"/>')
            elif kind == "b":
                self.parts.append(
                    f'<rect class="b" x="{x - 10}" y="{y - 9:.1f}" width="20" height="10"/>'
                )
            else:
                self.parts.append(f'<path class="{kind}" d="M{x - 10} {y - 4:.1f}h20"/>')
            self._text(x + 16, y, text)


def _slips(series: Series) -> Array:
    """Steps of slip for a curve, from where the model leaves the bottom of the picture."""
    slips = np.linspace(0.0, 1.0, 101)
    lowest = np.minimum(angles_of(series, slips), with_modulus(0.025)(series, slips, series.load))
    return slips[lowest > -5.0]


class Subject(NamedTuple):
    """What one panel shows.

    Attributes:
        title: above the panel.
        first: measured dots, filled, with a solid curve of the model.
        second: further dots, hollow, if any.
        also: whether the second has a dashed curve of its own.
        words: for the first and the second dots.
        band: K in m between which the model of the first lies.
        lowest: angle at the bottom of its legend.
    """

    title: str
    first: Series
    second: Series | None
    also: bool
    words: tuple[str, str]
    band: tuple[float, float]
    lowest: float = -3.7


SUBJECTS = (
    Subject("NASA, tilt bed: slope climbed", MGRU3, AGAIN, False,
            ("measured", "other digitisation"), (0.010, 0.025)),
    Subject("NASA, TREC: pull", TREC, None, False, ("measured", ""), (0.010, 0.025)),
    Subject("Harbin: pull", DING, DING_SMOOTH, True, ("lugs", "smooth rim"), (0.0097, 0.0131)),
    Subject("K10 mini: pull", K10_LUGS, K10, True, ("lugs", "smooth rim"), (0.010, 0.025), 18.0),
    Subject("KLS-1: pull", KLS_LUGS, KLS, True, ("lugs", "smooth rim"), (0.010, 0.025), 18.0),
    Subject("Rashid-1: pull", RASHID, None, False, ("measured", ""), (0.010, 0.025)),
)  # fmt: skip
"""Six panels; pull is atan(pull/load)."""


def _panel(subject: Subject, left: float, top: float) -> Panel:
    panel = Panel(left, top, subject.title)
    panel.band(subject.first, *subject.band)
    panel.curve("m", subject.first)
    low, high = (f"{1e3 * value:.3g}" for value in subject.band)
    rows = [("b", f"model, K {low} to {high} mm"), ("m", "model")]
    if subject.also and subject.second:
        panel.curve("n", subject.second)
        rows[1:] = [("n", f"model, {subject.words[1]}"), ("m", f"model, {subject.words[0]}")]
    if subject.second:
        panel.dots("q", subject.second)
        rows.append(("q", subject.words[1]))
    panel.dots("p", subject.first)
    panel.legend(subject.lowest, *rows, ("p", subject.words[0]))
    return panel


def picture() -> str:
    """Measured points and curves of the model, as SVG."""
    panels = (
        _panel(subject, *place(number)) for number, subject in enumerate(SUBJECTS)
    )  # fmt: skip
    body = "\n".join(line for panel in panels for line in panel.parts)
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 960 680" role="img" '
        'aria-label="Measured angles against slip for eleven sets, and the curves of the model">\n'
        f"<style>\n{STYLE}\n</style>\n"
        f'<rect width="960" height="680" fill="#fff"/>\n{body}\n</svg>\n'
    )
