"""Charts of slip against slope as SVG: a line for each surface, or for each vehicle."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from terratool.report import numbers
from terratool.report.tables import columns_of, truncate
from terratool.text.display import printable
from terratool.traversability.figures import SlipCurve
from terratool.traversability.limits import slip_limit
from terratool.traversability.report import wording
from terratool.traversability.report.tables import title
from terratool.traversability.report.wording import vehicle_name
from terratool.traversability.results import Reports, TraversabilityReport
from terratool.traversability.vehicle import Vehicle

COLOURS = 6
"""Number of colours in curves.css, distinct for any kind of colour vision."""
DASHES = ("", "7 3", "2 3", "9 3 2 3")
"""Dashes of lines, which go with every colour, so that lines differ in grey, too."""

_LEFT, _RIGHT, _TOP, _BELOW, _ROW = 52.0, 14.0, 24.0, 46.0, 20.0
"""Margins around the curves for numbers and titles, and height of a row of the legend, pixels."""
_TALL, _NAME, _SWATCH = 280.0, 24, 30.0
_LETTER = 6.4
"""Approximate width of a letter, pixels."""
_SLOPES, _NUMBER = (5, 10, 15, 30, 45, 90), 36.0
"""Steps between numbers of slopes, degrees, and the room for a number, pixels."""
_NEAR = 4.0
"""Distance of the points of a curve that are checked against names, pixels."""

PAGE, PANEL, PHONE = 900.0, 460.0, 330.0
"""Widths of a chart on a page, of one of several there, and of each on a phone, pixels."""

NO_SURFACE = "There is no surface to drive on."


class PlotFrame(NamedTuple):
    """Part of a chart that shows x from `x[0]` to `x[1]` and y from `y[0]` up to `y[1]`."""

    left: float
    top: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]

    def right(self, x: float) -> float:
        """Position of an x, pixels from the left."""
        return self.left + self.width * (x - self.x[0]) / (self.x[1] - self.x[0])

    def down(self, y: float) -> float:
        """Position of a y, pixels from the top."""
        return self.top + self.height * (self.y[1] - y) / (self.y[1] - self.y[0])

    def points(self, xs: Sequence[float], ys: Sequence[float]) -> str:
        """Points as the attribute `points` of a polyline."""
        pairs = zip(xs, ys, strict=True)
        return " ".join(f"{self.right(x):.1f},{self.down(y):.1f}" for x, y in pairs)


@dataclass(frozen=True, slots=True)
class Line:
    """Curve of a chart.

    Attributes:
        name: name of the surface or the vehicle.
        curve: slip against slope.
        climb: largest climb, rad; None where the vehicle cannot even drive on the level.
        error: error band of slopes, rad, to both sides.
    """

    name: str
    curve: SlipCurve
    climb: float | None
    error: float = 0.0

    def spans(self) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
        """Slopes (degrees) and slips up to the largest climb, and those beyond it."""
        known = [
            (math.degrees(slope), slip, self.climb is not None and slope <= self.climb)
            for slope, slip in zip(self.curve.slope, self.curve.slip, strict=True)
            if not math.isnan(slip)
        ]
        able = [(slope, slip) for slope, slip, able in known if able]
        return able, [*able[-1:], *((slope, slip) for slope, slip, able in known if not able)]


def slip_lines(report: TraversabilityReport) -> list[Line]:
    """Lines of a report, one for each surface whose slip is known."""
    return [
        Line(title(one), one.slip_curve, one.climb, one.climb_error or 0.0)
        for one in report.surfaces
        if one.slip_curve
    ]


class Panel(NamedTuple):
    """Content of a chart of slip against slope.

    Attributes:
        lines: curves of the chart.
        marks: slips to mark, with their texts.
        heading: heading of the chart; empty for none.
    """

    lines: list[Line]
    marks: list[tuple[float, str]]
    heading: str


def slip_panels(reports: Reports) -> list[Panel]:
    """Charts of a report: one with all surfaces, or for several vehicles one for each surface.

    Lines whose slip is not known are left out.
    """
    marks = slip_marks([one.vehicle for one in reports.reports])
    if isinstance(reports, TraversabilityReport):
        lines = slip_lines(reports)
        return [Panel(lines, marks, "")] if lines else []
    found = []
    for row in zip(*(one.surfaces for one in reports.reports), strict=True):
        lines = [
            Line(vehicle_name(of), one.slip_curve, one.climb, one.climb_error or 0.0)
            for of, one in zip(reports.reports, row, strict=True)
            if one.slip_curve is not None
        ]
        if _can_draw(lines):
            found.append(Panel(lines, marks, title(row[0])))
    return found


def slip_marks(vehicles: Sequence[Vehicle]) -> list[tuple[float, str]]:
    """Limits of slip with their texts, the lowest first; with names of vehicles if not of all."""
    by_slip: dict[tuple[float, str], list[str]] = {}
    for vehicle in vehicles:
        most = slip_limit(vehicle)
        if vehicle.thresholds.slip < most:
            by_slip.setdefault((vehicle.thresholds.slip, "go ends"), []).append(vehicle.name)
        if most < 1.0:
            by_slip.setdefault((most, "caution ends"), []).append(vehicle.name)
    marks = []
    for (slip, what), names in sorted(by_slip.items()):
        whose = f" ({', '.join(map(printable, names))})" if len(names) < len(vehicles) else ""
        marks.append((slip, f"{numbers.share(slip)}: {what}{whose}"))
    return [*marks, (1.0, f"{numbers.share(1.0)}: it stays where it is")]


def slip_chart(
    lines: Sequence[Line], marks: Sequence[tuple[float, str]], width: float, heading: str = ""
) -> str:
    """Chart as an SVG element, `width` pixels wide, 240 or more; empty where there are no lines.

    Slope in degrees runs to the right, slip upwards. Colours are those of curves.css.
    """
    if not _can_draw(lines):
        return ""
    parts, tall = _chart(lines, marks, width, heading)
    return _element(parts, width, tall, _description(lines))


def _sheet(panels: Sequence[Panel]) -> str:
    """Charts as one SVG element, two in a row; empty where there are none."""
    parts, top, tall = [], 0.0, 0.0
    for number, (lines, marks, heading) in enumerate(panels):
        if number and number % 2 == 0:
            top, tall = top + tall, 0.0
        chart, own = _chart(lines, marks, PANEL, heading)
        tall = max(tall, own + _ROW)
        at = f"{PANEL * (number % 2):g} {top:g}"
        parts += [f'<g transform="translate({at})"><title>{escape(heading)}</title>', *chart]
        parts.append("</g>")
    described = "Slip against slope, surface by surface."
    return _element(parts, PANEL * min(len(panels), 2), top + tall, described) if panels else ""


def _can_draw(lines: Sequence[Line]) -> bool:
    return any(sum(map(len, line.spans())) > 1 for line in lines)


def _element(parts: Sequence[str], width: float, tall: float, described: str) -> str:
    head = (
        f'<svg class="slip" xmlns="http://www.w3.org/2000/svg" role="img" '
        f'viewBox="0 0 {width:g} {tall:g}" width="{width:g}" height="{tall:g}" '
        f'aria-label="{escape(described)}">'
    )
    return "".join((head, *parts, "</svg>"))


def _chart(
    lines: Sequence[Line], marks: Sequence[tuple[float, str]], width: float, heading: str
) -> tuple[list[str], float]:
    """Elements of a chart, and its height in pixels."""
    slopes = [math.degrees(slope) for line in lines for slope in line.curve.slope]
    ends = 5.0 * math.floor(min(slopes) / 5.0), 5.0 * math.ceil(max(slopes) / 5.0)
    frame = PlotFrame(_LEFT, _TOP, width - _LEFT - _RIGHT, _TALL, ends, (0.0, 1.08))
    legend, rows = _legend(lines, frame.left, width)
    tall = _TOP + _TALL + _BELOW + rows * _ROW
    return [*_axes(frame, heading), *_curves(frame, lines, marks), *legend], tall


@cache
def style() -> str:
    """Text of curves.css."""
    return Path(__file__).with_name("curves.css").read_text("utf-8")


def _as_file(chart: str, without: str) -> str:
    """Chart as the text of an SVG file; a file with a sentence where there is no chart."""
    if not chart:
        chart = _element([_text(without, 20.0, 34.0, "title")], 720.0, 60.0, without)
    head, _, body = chart.partition(">")
    paper = '<rect class="paper" width="100%" height="100%"/>'
    return f"{head}>\n<style>\n{style()}</style>\n{paper}\n{body}\n".replace("><", ">\n<")


def as_svg(reports: Reports) -> str:
    """Slip against slope, surface by surface, as the text of an SVG file."""
    panels = slip_panels(reports)
    if isinstance(reports, TraversabilityReport):
        heading = f"{reports.terrain}, {reports.vehicle.name or 'a wheel'}"
        chart = "".join(slip_chart(lines, marks, PAGE, heading) for lines, marks, _ in panels)
    else:
        chart = _sheet(panels)
    return _as_file(chart, wording.slip_unknown(reports.reports[0]) or NO_SURFACE)


def _description(lines: Sequence[Line]) -> str:
    parts = []
    for line in lines:
        able, _ = line.spans()
        far = f"{numbers.share(able[-1][1])} at {able[-1][0]:.1f}°" if able else "not on the level"
        parts.append(f"{printable(line.name)} {far}")
    return f"Slip against slope, to the largest climb: {'; '.join(parts)}."


def _axes(frame: PlotFrame, heading: str) -> Iterator[str]:
    """Lines and numbers of both axes, and the heading."""
    bottom = frame.top + frame.height
    for percent in range(0, 101, 20):
        y = frame.down(percent / 100)
        yield f'<path class="rule" d="M{frame.left:g} {y:.1f}h{frame.width:g}"/>'
        yield f'<text x="{frame.left - 6:g}" y="{y + 4:.1f}" text-anchor="end">{percent} %</text>'
    low, high = frame.x
    apart = next(step for step in _SLOPES if frame.width * step / (high - low) > _NUMBER)
    for slope in range(apart * math.ceil(low / apart), math.floor(high) + 1, apart):
        x = frame.right(slope)
        yield f'<path class="tick" d="M{x:.1f} {bottom:g}v5"/>'
        text = f"{slope}°".replace("-", "−")
        yield f'<text x="{x:.1f}" y="{bottom + 18:g}" text-anchor="middle">{text}</text>'
    yield f'<path class="rule" d="M{frame.right(0.0):.1f} {frame.top:g}v{frame.height:g}"/>'
    yield f'<path class="tick" d="M{frame.left:g} {bottom:g}h{frame.width:g}"/>'
    end = frame.left + frame.width
    yield (
        f'<text class="title" x="{end:g}" y="{bottom + 34:g}" text-anchor="end">'
        "slope, downhill below 0</text>"
    )
    yield f'<text class="title" x="{frame.left:g}" y="{frame.top - 8:g}">slip</text>'
    if heading:
        most = int((frame.width - 40.0) / _LETTER)
        yield (
            f'<text class="title" x="{end:g}" y="{frame.top - 8:g}" text-anchor="end">'
            f"{escape(truncate(printable(heading), most))}</text>"
        )


def _style_of(number: int) -> tuple[str, str]:
    """CSS class and dash attribute of the line of a number."""
    dashes = DASHES[(number + number // COLOURS) % len(DASHES)]
    return f"s{number % COLOURS}", f' stroke-dasharray="{dashes}"' if dashes else ""


class _Box(NamedTuple):
    """Rectangle of a chart that something covers, pixels from the left and from the top."""

    left: float
    top: float
    right: float
    bottom: float

    @classmethod
    def of(cls, text: str, x: float, y: float) -> _Box:
        """Rectangle of a text that begins at x on the baseline y."""
        return cls(x, y - 10.0, x + _text_width(text), y + 3.0)

    def meets(self, other: _Box) -> bool:
        """Whether two rectangles overlap."""
        return (
            self.left < other.right and other.left < self.right
            and self.top < other.bottom and other.top < self.bottom
        )  # fmt: skip

    def distance(self, x: float, y: float) -> float:
        """Distance of a point from the rectangle, pixels; 0 inside."""
        across = max(self.left - x, 0.0, x - self.right)
        return math.hypot(across, max(self.top - y, 0.0, y - self.bottom))


def _curves(
    frame: PlotFrame, lines: Sequence[Line], marks: Sequence[tuple[float, str]]
) -> Iterator[str]:
    """Elements of the marks, the curves over them, and names where there is room."""
    taken: list[_Box] = []
    most = int((frame.width - 10.0) / _LETTER)
    marks = [(slip, truncate(text, most)) for slip, text in marks]
    for slip, text in marks:
        y = frame.down(slip)
        yield f'<path class="limit" d="M{frame.left:g} {y:.1f}h{frame.width:g}"/>'
        taken.append(_Box.of(text, frame.left + 5.0, y - 6.0))
        taken.append(_Box(frame.left, y - 1.0, frame.left + frame.width, y + 1.0))
    for number, line in enumerate(lines):
        if area := _band(frame, line):
            yield f'<polygon class="band {_style_of(number)[0]}" points="{area}"/>'
    trails, ends = [], []
    for number, line in enumerate(lines):
        colour, dashes = _style_of(number)
        for kind, points in zip(("", " beyond"), line.spans(), strict=True):
            if len(points) > 1:
                at = frame.points(*zip(*points, strict=True))
                yield f'<polyline class="curve{kind} {colour}"{dashes} points="{at}"/>'
                trails += _trail([(frame.right(x), frame.down(y)) for x, y in points])
        if line.spans()[0]:
            slope, slip = line.spans()[0][-1]
            x, y = frame.right(slope), frame.down(slip)
            ends.append((x, y, line))
            taken.append(_Box(x - 5.0, y - 5.0, x + 5.0, y + 5.0))
            yield f'<circle class="{colour}" cx="{x:.1f}" cy="{y:.1f}" r="4.5"/>'
    for slip, text in marks:
        yield _text(text, frame.left + 5.0, frame.down(slip) - 6.0, "halo")
    for x, y, line in ends:
        name = truncate(line.name, _NAME)
        others = [end[:2] for end in ends if end[:2] != (x, y)]
        for left, down in (
            (8, 4),
            (8, 16),
            (8, -8),
            (-8 - _text_width(name), 4),
            (-8 - _text_width(name), -8),
        ):
            box = _Box.of(name, x + left, y + down)
            # a name must be nearest to its own curve
            own = box.distance(x, y) + 3.0
            alone = all(box.distance(*end) > own for end in others)
            inside = box.left > frame.left and box.right < frame.left + frame.width
            covers = any(map(box.meets, taken)) or any(box.distance(*at) == 0.0 for at in trails)
            if alone and inside and not covers:
                taken.append(box)
                yield _text(name, x + left, y + down, "name halo")
                break


def _band(frame: PlotFrame, line: Line) -> str:
    """Points of the area in which a curve lies by its error band; empty for none.

    A wheel that is held back does not slip, whatever the error.
    """
    able, beyond = line.spans()
    points = [(slope, slip) for slope, slip in [*able, *beyond[1:]] if slip > 0.0]
    if not line.error or len(points) < 2:
        return ""
    slopes, slips = zip(*points, strict=True)
    far, (low, high) = math.degrees(line.error), frame.x
    xs = [*(max(low, slope - far) for slope in slopes)]
    xs += [min(high, slope + far) for slope in reversed(slopes)]
    return frame.points(xs, [*slips, *reversed(slips)])


def _trail(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Points along a polyline, at most `_NEAR` apart."""
    found = [points[0]]
    for (x0, y0), (x1, y1) in pairwise(points):
        count = max(1, math.ceil(math.hypot(x1 - x0, y1 - y0) / _NEAR))
        found += [
            (x0 + (x1 - x0) * n / count, y0 + (y1 - y0) * n / count) for n in range(1, count + 1)
        ]
    return found


def _legend(lines: Sequence[Line], left: float, width: float) -> tuple[list[str], int]:
    """Elements of the legend, names with largest climbs, and its number of rows."""
    parts, x, row = [], left, 0
    for number, line in enumerate(lines):
        climb = "not on the level" if line.climb is None else numbers.degrees(line.climb)
        climb += f" ± {numbers.degrees(line.error)}" if line.error else ""
        text = f"{truncate(line.name, _NAME)} {climb}"
        wide = _SWATCH + _text_width(text) + 14.0
        if x > left and x + wide > width:
            x, row = left, row + 1
        y = _TOP + _TALL + _BELOW + _ROW * row + 8.0
        colour, dashes = _style_of(number)
        parts.append(f'<path class="curve {colour}"{dashes} d="M{x:.1f} {y - 4:.1f}h24"/>')
        parts.append(_text(text, x + _SWATCH, y, "name"))
        x += wide
    return parts, row + 1


def _text_width(text: str) -> float:
    return _LETTER * sum(map(columns_of, printable(text)))


def _text(text: str, x: float, y: float, kind: str) -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}">{escape(printable(text))}</text>'
