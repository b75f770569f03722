"""The picture of docs/validation.md: measured points, and the curves of the model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from terratool.traversability.report.curves import PlotFrame
from tests.validation.series import (
    AGAIN,
    DING,
    DING_SMOOTH,
    MGRU3,
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


class Panel:
    """Slip to the right, 0 to 100 %, and the angle up, −5 to 35°."""

    def __init__(self, left: float, title: str) -> None:
        self.left = left
        self.frame = PlotFrame(left, TOP, SIDE, HEIGHT, (0.0, 1.0), (-5.0, 35.0))
        self.parts = [f'<text class="t" x="{left}" y="28">{title}</text>']
        for angle in range(0, 31, 10):
            self._line("g", np.array([0.0, 1.0]), np.full(2, float(angle)))
            self._text(left - 6, self.frame.down(angle) + 4, f"{angle}°", "end")
        for slip in (0, 20, 40, 60, 80, 100):
            self._text(self.frame.right(slip / 100), TOP + HEIGHT + 16, f"{slip} %", "middle")
        self._text(self.frame.right(0.5), TOP + HEIGHT + 34, "slip", "middle")

    def _text(self, x: float, y: float, text: str, anchor: str = "start") -> None:
        self.parts.append(
            f'<text class="s" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'
        )

    def _line(self, kind: str, slips: Array, angles: Array) -> None:
        self.parts.append(f'<polyline class="{kind}" points="{self.frame.points(slips, angles)}"/>')

    def curve(
        self, kind: str, series: Series, angles: Callable[[Series, Array], Array] = angles_of
    ) -> None:
        """What the model says of a series."""
        slips = _slips(series)
        self._line(kind, slips, angles(series, slips))

    def band(self, series: Series, low: float, high: float) -> None:
        """What it says for K from `low` to `high`."""
        slips = _slips(series)
        upper, lower = with_modulus(low)(series, slips), with_modulus(high)(series, slips)
        around = np.concatenate([slips, slips[::-1]]), np.concatenate([upper, lower[::-1]])
        self.parts.insert(0, f'<polygon class="b" points="{self.frame.points(*around)}"/>')

    def dots(self, kind: str, series: Series) -> None:
        """What was measured."""
        for slip, angle in zip(*series.measured, strict=True):
            x, y = self.frame.right(slip), self.frame.down(angle)
            self.parts.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="4"/>')

    def legend(self, *rows: tuple[str, str]) -> None:
        """What its marks mean, from the bottom up."""
        x, y, high = self.left + 90.0, self.frame.down(-3.7), 15.0 * len(rows)
        self.parts.append(
            f'<rect x="{x - 14}" y="{y + 4 - high:.1f}" width="180" height="{high}" fill="#fff"/>'
        )
        for n, (kind, text) in enumerate(rows):
            y = self.frame.down(-3.7) - 15.0 * n
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
    return slips[(angles_of(series, slips) > -5.0) & (with_modulus(0.025)(series, slips) > -5.0)]


def picture() -> str:
    """Measured points and curves of the model, as SVG."""
    tilt = Panel(50, "Tilt bed: slope climbed, MGRU3")
    tilt.band(MGRU3, 0.010, 0.025)
    tilt.curve("m", MGRU3)
    tilt.dots("p", MGRU3)
    tilt.dots("q", AGAIN)
    tilt.legend(
        ("b", "model, K 10 to 25 mm"), ("m", "model, K 18 mm"),
        ("q", "other digitisation"), ("p", "measured"),
    )  # fmt: skip
    pull = Panel(50 + WIDTH + 10, "Pull, TREC: atan(pull/load)")
    pull.band(TREC, 0.010, 0.025)
    pull.curve("m", TREC)
    pull.dots("p", TREC)
    pull.legend(("b", "model, K 10 to 25 mm"), ("m", "model, K 18 mm"), ("p", "measured"))
    aside = Panel(50 + 2 * (WIDTH + 10), "Kept aside, Harbin: atan(pull/load)")
    aside.band(DING, 0.0097, 0.0131)
    aside.curve("m", DING)
    aside.curve("n", DING_SMOOTH)
    aside.dots("p", DING)
    aside.dots("q", DING_SMOOTH)
    aside.legend(
        ("b", "model, K 9.7 to 13.1 mm"), ("n", "model, smooth rim"),
        ("q", "measured, smooth rim"), ("m", "model, lugs"), ("p", "measured, lugs"),
    )  # fmt: skip
    body = "\n".join(line for panel in (tilt, pull, aside) for line in panel.parts)
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 960 340" role="img" '
        'aria-label="Measured angles against slip for three wheels, and the curves of the model">\n'
        f"<style>\n{STYLE}\n</style>\n"
        f'<rect width="960" height="340" fill="#fff"/>\n{body}\n</svg>\n'
    )
