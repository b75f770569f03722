"""Slip against slope: the numbers, the chart of a report and the picture of its own."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from terratool.definition.reader import check
from terratool.traversability import wheel as wheels
from terratool.traversability.figures import Figures, SlipCurve
from terratool.traversability.limits import slip_limit, slope_demand
from terratool.traversability.report import curves, tables
from terratool.traversability.report.document import as_dict
from terratool.traversability.report.page import as_markdown, as_page
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.soil import CURVE_BEYOND, CURVE_STEP, slip_curve, surface_figures
from terratool.traversability.vehicle import Axle, Margins, Soil, Thresholds, Vehicle, Wheel
from terratool.traversability.vehicle_files import load_vehicle, vehicle_of
from terratool.traversability.verdicts import Reason
from tests import reports
from tests.commands import ROOT, call
from tests.conftest import terrain_of
from tests.vehicles import LOPSIDED, source

SVG = "{http://www.w3.org/2000/svg}"
TURF = Soil.of(1.72, 29.0, 0.04, 0.025)
FIRM = Soil.of(2.0, 42.0, 0.003, 0.015)
HARD = Soil.of(0.0, 35.0, 0.0, 0.01)


def lopsided() -> Vehicle:
    """Three axles, one of them towed and with a tyre, motors that differ, a margin of 5°."""
    checked = check(source(LOPSIDED), kind="vehicle")
    assert checked.vehicle is not None
    return vehicle_of(checked.vehicle)


NOSE_HEAVY = Vehicle(
    Wheel(0.2, 0.12), (Axle(0.3), Axle(-0.6, wheel=Wheel(0.25, 0.1, grouser_height=0.02))),
    60.0, track_width=0.7, cog_height=0.3,
)  # fmt: skip
TAIL_HEAVY = replace(
    NOSE_HEAVY,
    axles=(
        Axle(0.6, driven=False, wheel=Wheel(0.15, 0.08)),
        Axle(-0.3, wheel=Wheel(0.25, 0.1, grouser_height=0.02)),
    ),
)


def bisected(low: float, high: float, lacks: Callable[[float], bool]) -> float:
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if lacks(middle) else (low, middle)
    return 0.5 * (low + high)


def slip_by_statics(vehicle: Vehicle, soil: Soil, slope: float) -> float:
    """The largest slip of two axles' wheels, from single wheels and textbook statics.

    Loads are (m g/L)(l_r cos α − h sin α) and (m g/L)(l_f cos α + h sin α); the driven wheels use
    one share of strength, for which each has a slip; their pull is what the slope and towed wheels
    ask for. 0 where they are held back. The rear wheels run in the ruts of the front ones, which
    they make deeper: 2^(1/3) of the deeper first pass, if that is no more than on fresh ground.
    """
    front, rear = vehicle.axles
    base = front.x - rear.x
    sine, cosine = math.sin(slope), math.cos(slope)
    loads = (
        vehicle.weight / base * (-rear.x * cosine - vehicle.cog_height * sine) / front.wheels,
        vehicle.weight / base * (front.x * cosine + vehicle.cog_height * sine) / rear.wheels,
    )
    need, driven = vehicle.weight * sine, []
    first, second = (soil.sinkage * load for load in loads)
    deeper = min(2 ** (1 / 3) * max(first, second) - first, second)
    soils = soil, replace(soil, sinkage=deeper / loads[1])
    for axle, load, under in zip(vehicle.axles, loads, soils, strict=True):
        own = vehicle.wheel_of(axle)
        if axle.driven:
            driven.append((axle.wheels, own, load, under))
        else:
            need += axle.wheels * float(wheels.towed_resistance(load, under, own))

    def slips(share: float) -> list[float]:
        return [
            bisected(
                0.0, 1e3,
                lambda s: float(wheels.traction(load, under, own, s).mobilised) < share,  # noqa: B023
            )
            for _, own, load, under in driven
        ]  # fmt: skip

    def pull(share: float) -> float:
        found = zip(driven, slips(share), strict=True)
        return sum(
            count * float(wheels.traction(load, under, own, slip).drawbar)
            for (count, own, load, under), slip in found
        )

    if pull(0.0) >= need:
        return 0.0
    # before the pull's peak, as far as slips of 1 go
    shares = [share for share in np.linspace(0.0, 1.0, 201) if max(slips(share)) <= 1.0]
    enough = next(n for n, share in enumerate(shares) if pull(share) >= need)
    share = bisected(shares[enough - 1], shares[enough], lambda share: pull(share) < need)
    return max(slips(share))


@pytest.mark.nightly
@pytest.mark.parametrize("soil", [TURF, FIRM, HARD], ids=["turf", "firm", "hard"])
@pytest.mark.parametrize("vehicle", [NOSE_HEAVY, TAIL_HEAVY], ids=["nose", "tail"])
def test_agrees_with_wheels_one_by_one(vehicle: Vehicle, soil: Soil) -> None:
    figures = figures_of(vehicle, soil)
    curve, climb = figures.slip_curve, figures.climb
    assert curve is not None and climb is not None and climb > math.radians(5)
    able = [(slope, slip) for slope, slip in zip(*_members(curve), strict=True) if slope <= climb]
    chosen = [*able[:: len(able) // 6], able[-1]]
    for slope, slip in chosen:
        assert slip == pytest.approx(slip_by_statics(vehicle, soil, slope), abs=1e-6), slope
    assert chosen[0][1] == 0.0 and chosen[-1][1] > 0.3


def _members(curve: SlipCurve) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return curve.slope, curve.slip


def figures_of(vehicle: Vehicle, soil: Soil) -> Figures:
    surface = {
        "cohesion": soil.cohesion / 1e3, "fricAngle": math.degrees(soil.friction),
        "sinkage": soil.sinkage * 1e3,
        **({"shearModulus": soil.shear_modulus} if soil.shear_modulus else {}),
    }  # fmt: skip
    terrain = terrain_of(
        {"size": 1, "surfTypes": {"g": surface}, "elemTypes": {"f": {"x": [0]}},
         "elemTree": {"type": "f", "surface": "g"}}
    )  # fmt: skip
    return surface_figures("g", terrain.surface_types["g"], vehicle)


def random_cases() -> list[tuple[Vehicle, Soil]]:
    rng = np.random.default_rng(7)
    found = []
    for _ in range(150):
        radius = float(rng.uniform(0.1, 0.3))
        wheel = Wheel(
            radius, radius * float(rng.uniform(0.3, 1.0)),
            max_torque=float(rng.choice([math.inf, rng.uniform(3.0, 60.0)])),
            max_slip=float(rng.choice([1.0, rng.uniform(0.1, 1.0)])),
            grouser_height=float(rng.choice([0.0, 0.1 * radius])),
        )  # fmt: skip
        ahead, behind = rng.uniform(0.2, 0.8, 2)
        middle = [Axle(float(rng.uniform(-0.1, 0.1)), driven=bool(rng.integers(2)))]
        axles = (Axle(float(ahead)), *middle * int(rng.integers(2)), Axle(-float(behind)))
        vehicle = Vehicle(
            wheel, axles, 3e3 * radius**2, track_width=0.8, cog_height=float(rng.uniform(0.1, 0.6)),
            margins=Margins(slope=float(rng.choice([0.0, 0.05]))),
            thresholds=Thresholds(caution_slip=float(rng.uniform(0.3, 1.0))),
        )  # fmt: skip
        soil = Soil.of(
            float(rng.choice([0.0, rng.uniform(0.0, 20.0)])),
            float(rng.uniform(15.0, 42.0)),
            float(rng.choice([0.0, rng.uniform(0.0, 0.1)])),
            float(rng.uniform(0.003, 0.04)),
        )
        found.append((vehicle, soil))
    return found


@pytest.mark.nightly
def test_rises_up_to_the_climb_and_ends_there() -> None:
    """For any vehicle: no gap before the climb, never down; beyond it there is nothing to have."""
    bound = set()
    for vehicle, soil in random_cases():
        figures = figures_of(vehicle, soil)
        curve, climb = figures.slip_curve, figures.climb
        assert curve is not None
        steps = [math.degrees(b - a) for a, b in pairwise(curve.slope)]
        assert min(steps) > 0.0 and max(steps) <= CURVE_STEP + 1e-9
        last = math.degrees(climb or 0.0) + CURVE_BEYOND
        assert last - CURVE_STEP < math.degrees(curve.slope[-1]) <= last + 1e-9
        if climb is None:
            need = slope_demand(vehicle, soil)
            assert not (need.drives and need.slip <= slip_limit(vehicle))
            continue
        assert climb in curve.slope
        up = [slip for slope, slip in zip(*_members(curve), strict=True) if 0.0 <= slope <= climb]
        assert all(0.0 <= a <= b + 1e-9 for a, b in pairwise(up))  # not NaN, either
        assert up[-1] <= slip_limit(vehicle) + 1e-6
        known = [slip for slip in curve.slip if not math.isnan(slip)]
        assert all(a <= b + 1e-9 for a, b in pairwise(known[: known.index(up[-1]) + 1]))
        bound.add(figures.climb_binding)
        if climb == 0.0:
            continue  # the margin may be more than it climbs
        exact = climb + vehicle.margins.slope
        if figures.climb_binding != Reason.TIP_OVER:
            beyond = slope_demand(vehicle, soil, exact + math.radians(0.01))
            assert not (beyond.drives and beyond.slip <= slip_limit(vehicle)), figures
        if figures.climb_binding == Reason.SLIP:
            at = slope_demand(vehicle, soil, exact)
            assert at.slip == pytest.approx(slip_limit(vehicle), abs=1e-6)
    assert bound >= {Reason.SLIP, Reason.TORQUE, Reason.TIP_OVER}


def test_there_is_none_where_slip_is_not_known() -> None:
    assert figures_of(NOSE_HEAVY, replace(TURF, shear_modulus=0.0)).slip_curve is None
    assert slip_curve(NOSE_HEAVY.by_model("paper"), TURF, 0.1) is None


def report_of(vehicle: Vehicle, *soils: Soil) -> TraversabilityReport:
    figures = tuple(
        replace(figures_of(vehicle, soil), surface=f"ground {n}") for n, soil in enumerate(soils)
    )
    return reports.report(vehicle=vehicle, surfaces=figures)


class Chart:
    """A chart, read again: its scales from the numbers along its sides."""

    def __init__(self, text: str) -> None:
        self.root = ElementTree.fromstring(text)
        numbers = [
            (one.text or "", float(one.get("x", 0)), float(one.get("y", 0)), one.get("class"))
            for one in self.root.iter(f"{SVG}text")
        ]
        plain = [(text, x, y) for text, x, y, kind in numbers if kind is None]
        self.names = [(text, x, y) for text, x, y, kind in numbers if kind == "name halo"]
        self.legend = [text for text, _, _, kind in numbers if kind == "name"]
        down = sorted((float(t[:-2]) / 100, y - 4.0) for t, _, y in plain if t.endswith(" %"))
        across = sorted((float(t[:-1].replace("−", "-")), x) for t, x, _ in plain if "°" in t)
        self._y = np.polyfit(*zip(*down, strict=True), 1)
        self._x = np.polyfit(*zip(*across, strict=True), 1)
        assert self._y[0] < 0.0 < self._x[0]  # slip upwards, slope to the right

    def slip(self, y: float) -> float:
        return float((y - self._y[1]) / self._y[0])

    def slope(self, x: float) -> float:
        return float((x - self._x[1]) / self._x[0])

    def limits(self) -> dict[str, float]:
        """Slip at each line that is marked, by what is said of it."""
        lines = [
            self.slip(float(re.findall(r"[\d.]+", one.get("d", ""))[1]))
            for one in self.root.iter(f"{SVG}path")
            if one.get("class") == "limit"
        ]
        said = [
            one.text or "" for one in self.root.iter(f"{SVG}text") if one.get("class") == "halo"
        ]
        return dict(zip(said, lines, strict=True))

    def dots(self) -> list[tuple[float, float]]:
        return [
            (self.slope(float(one.get("cx", 0))), self.slip(float(one.get("cy", 0))))
            for one in self.root.iter(f"{SVG}circle")
        ]

    def curves(self, kind: str) -> list[list[tuple[float, float]]]:
        found = []
        for one in self.root.iter(f"{SVG}polyline"):
            if ("beyond" in one.get("class", "").split()) == (kind == "beyond"):
                points = [point.split(",") for point in one.get("points", "").split()]
                found.append([(self.slope(float(x)), self.slip(float(y))) for x, y in points])
        return found


class TestChart:
    @pytest.mark.parametrize("width", [900.0, 330.0])
    def test_marks_are_where_they_belong(self, width: float) -> None:
        """Of a vehicle whose classes are not the usual ones: go up to 10 %, caution up to 30 %."""
        report = report_of(lopsided(), TURF, FIRM)
        marks = curves.slip_marks([report.vehicle])
        chart = Chart(curves.slip_chart(curves.slip_lines(report), marks, width))
        assert chart.limits() == {
            "10 %: go ends": pytest.approx(0.1, abs=1e-3),
            "30 %: caution ends": pytest.approx(0.3, abs=1e-3),
            "100 %: it stays where it is": pytest.approx(1.0, abs=1e-3),
        }
        for (slope, slip), one, curve in zip(
            chart.dots(), report.surfaces, chart.curves("able"), strict=True
        ):
            assert one.climb is not None and one.slip_curve is not None
            assert slope == pytest.approx(math.degrees(one.climb), abs=0.1)
            exact = one.slip_curve.slip[one.slip_curve.slope.index(one.climb)]
            assert slip == pytest.approx(exact, abs=1e-3)
            able = [
                (math.degrees(a), b)
                for a, b in zip(*_members(one.slip_curve), strict=True)
                if a <= one.climb and not math.isnan(b)
            ]
            assert np.allclose(curve, able, atol=(0.1, 1e-3))
        for curve in chart.curves("beyond"):
            assert all(a <= b for (a, _), (b, _) in pairwise(curve))

    def test_a_wheel_that_is_not_to_slip_has_one_limit(self) -> None:
        vehicle = replace(NOSE_HEAVY, wheel=replace(NOSE_HEAVY.wheel, max_slip=0.15))
        assert [mark for mark, _ in curves.slip_marks([vehicle])] == [0.15, 1.0]
        usual = [mark for mark, _ in curves.slip_marks([NOSE_HEAVY])]
        assert usual == [0.2, 0.6, 1.0]

    def test_names_do_not_cover_each_other(self) -> None:
        """Ten surfaces, some alike: all are in the legend; what has room is named at its curve."""
        soils = [replace(TURF, friction=math.radians(angle)) for angle in range(14, 24)]
        report = report_of(NOSE_HEAVY, *soils, soils[0])
        for width, named in ((900.0, 1), (330.0, 0)):
            text = curves.slip_chart(
                curves.slip_lines(report), curves.slip_marks([NOSE_HEAVY]), width
            )
            chart = Chart(text)
            assert len(chart.legend) == 11
            assert named <= len(chart.names) < 11
            for (a, x, y), (b, u, v) in combinations(chart.names, 2):
                apart = x + 6 * len(a) <= u or u + 6 * len(b) <= x
                assert apart or abs(y - v) >= 12, (a, b)
            assert all(x + 6 * len(name) <= width for name, x, _ in chart.names)
            dots = [
                (float(one.get("cx", 0)), float(one.get("cy", 0)))
                for one in chart.root.iter(f"{SVG}circle")
            ]
            for name, x, y in chart.names:
                # the nearest dot is its own
                far = [
                    math.hypot(max(x - u, 0, u - x - 6 * len(name)), max(y - 10 - v, 0, v - y - 3))
                    for u, v in dots
                ]
                own = dots[int(name.removeprefix("ground "))]
                assert dots[int(np.argmin(far))] == own, name

    def test_lines_differ_in_colour_or_dashes(self) -> None:
        soils = [replace(TURF, friction=math.radians(angle)) for angle in range(18, 42)]
        root = Chart(
            curves.slip_chart(curves.slip_lines(report_of(NOSE_HEAVY, *soils)), [], 900.0)
        ).root
        looks = [
            (one.get("class"), one.get("stroke-dasharray"))
            for one in root.iter(f"{SVG}path")
            if "curve" in one.get("class", "")
        ]
        assert len(set(looks)) == len(looks) == 24

    def test_colours_are_told_apart_by_all_eyes(self) -> None:
        """ΔE of 30 or more, as seen without one kind of cones; 3 to 1 on the paper or more."""
        for block in curves.style().split("@media"):
            shades = dict(re.findall(r"--(\w+): (#\w{6})", block))
            lines = [shades[f"s{n}"] for n in range(curves.COLOURS)]
            paper = _luminance(_linear(shades["paper"]))
            for one in lines:
                low, high = sorted((paper, _luminance(_linear(one))))
                assert (high + 0.05) / (low + 0.05) >= 3.0
            for eyes in EYES.values():
                seen = [_lab(np.clip(np.array(eyes) @ _linear(one), 0.0, 1.0)) for one in lines]
                apart = [math.dist(a, b) for a, b in combinations(seen, 2)]
                assert min(apart) >= 30.0, eyes

    def test_a_name_is_no_markup(self) -> None:
        bad = replace(figures_of(NOSE_HEAVY, TURF), surface=reports.NASTY)
        text = curves.as_svg(
            reports.report(vehicle=NOSE_HEAVY, surfaces=(bad,), terrain="a<b.json")
        )
        assert Chart(text).legend[0].startswith('<b>"& | `x`')


# of Machado, Oliveira and Fernandes, A physiologically-based model for simulation of color vision
# deficiency, 2009: no cones for red, green or blue; and all
EYES = {
    "protanopia": [
        [0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
    "all": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
}  # fmt: skip


def _linear(color: str) -> np.ndarray:
    parts = np.array([int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def _luminance(linear: np.ndarray) -> float:
    return float(linear @ [0.2126, 0.7152, 0.0722])


def _lab(linear: np.ndarray) -> tuple[float, float, float]:
    """CIE L*a*b* under D65."""
    to_xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    t = to_xyz @ linear / [0.95047, 1.0, 1.08883]
    x, y, z = np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


class TestReports:
    def test_have_the_same_numbers(self) -> None:
        """Of the curve itself, in degrees; a table of each 5°, up to each climb."""
        report = report_of(NOSE_HEAVY, TURF, FIRM, replace(TURF, shear_modulus=0.0))
        turf, firm, _ = report.surfaces
        told = as_dict(report)["surfaces"]
        assert told[2]["slip_curve"] is None
        for one, kept in ((told[0], turf), (told[1], firm)):
            assert kept.slip_curve is not None
            slopes = [math.degrees(slope) for slope in kept.slip_curve.slope]
            assert one["slip_curve"]["slope_deg"] == pytest.approx(slopes, abs=1e-9)
            wanted = [None if math.isnan(slip) else slip for slip in kept.slip_curve.slip]
            assert one["slip_curve"]["slip"] == pytest.approx(wanted, abs=1e-9)
        table = tables.slips(report)
        angles = [int(column.title[:-1]) for column in table.columns[1:]]
        assert angles[:3] == [0, 5, 10]
        most = max(math.degrees(one.climb or 0.0) for one in report.surfaces[:2])
        assert most - 5 < angles[-1] <= most
        for row, one in zip(table.rows, (turf, firm), strict=True):
            for angle, cell in zip(angles, row[1:], strict=True):
                assert one.climb is not None and isinstance(cell, str)
                if angle > math.degrees(one.climb):
                    assert cell == "–"
                else:
                    need = slope_demand(
                        NOSE_HEAVY, TURF if one is turf else FIRM, math.radians(angle)
                    )
                    assert float(cell.removesuffix(" %")) == pytest.approx(
                        100 * need.slip, rel=6e-3
                    )
        for text in (as_markdown(report), as_page(report)):
            assert "which has no shearModulus" in text
            assert "Slip on slopes that the vehicle climbs" in text
        assert as_page(report).count('<svg class="slip"') == 2

    def test_the_model_paper_has_no_slip(self) -> None:
        report = report_of(NOSE_HEAVY.by_model("paper"), TURF)
        assert as_dict(report)["surfaces"][0]["slip_curve"] is None
        for text in (as_markdown(report), as_page(report)):
            assert "There is no slip in the model paper." in text
            assert "that the vehicle climbs" not in text
        assert '<svg class="slip"' not in as_page(report)


YARD = str(ROOT / "samples" / "ramp-yard.json")
HUSKY = str(ROOT / "samples" / "vehicles" / "husky-a200.json")


def test_a_picture_of_its_own(tmp_path: Path) -> None:
    """Standing alone, in colours of its own; the same bytes again; no map is asked for by it."""
    out = tmp_path / "slip.svg"
    route = ("--route", 10, 60, 12, 60, "--headings", 4)
    ran = call("traversability", YARD, "--vehicle", HUSKY, *route, "--report", out, "--json")
    assert (ran.code, ran.err) == (0, "")
    document = json.loads(ran.out)
    assert document["map"] is None
    text = out.read_text("utf-8")
    chart = Chart(text)
    assert "prefers-color-scheme: dark" in text and "ramp-yard.json, husky-a200" in text
    climbs = [one["climb_deg"] for one in document["surfaces"] if one["sinkage_rate_m_per_kN"]]
    assert [slope for slope, _ in chart.dots()] == pytest.approx(climbs, abs=0.1)
    shown = (ROOT / "docs" / "images" / "slip.svg").read_text("utf-8")
    number = re.compile(r"\d+\.\d")  # the last digit may be another on other processors
    assert number.sub("", shown) == number.sub("", text)
    there, here = (np.array(number.findall(one), float) for one in (shown, text))
    assert np.abs(there - here).max() < 0.15
    again = tmp_path / "again.svg"
    assert call("traversability", YARD, "--vehicle", HUSKY, *route, "--report", again).code == 0
    assert again.read_bytes() == out.read_bytes()


def test_no_picture_of_the_model_paper(tmp_path: Path) -> None:
    """Said at once."""
    out = tmp_path / "slip.svg"
    ran = call(
        "traversability", YARD, "--vehicle", HUSKY, "--model", "paper", "--report", out
    )  # fmt: skip
    assert ran.code == 2 and not out.exists()
    assert "slip.svg: there is no slip in the model paper." in ran.err


def test_a_terrain_without_shear_moduli_has_a_sentence() -> None:
    report = report_of(NOSE_HEAVY, replace(TURF, shear_modulus=0.0))
    text = curves.as_svg(report)
    assert ElementTree.fromstring(text).tag == f"{SVG}svg"
    assert "Slip is not known on &quot;ground 0&quot;, which has no shearModulus." in text


def test_the_samples_reach_their_limit() -> None:
    """The Husky on turf: 60 % of slip, where its caution ends, at what is called its climb."""
    vehicle = load_vehicle(HUSKY)
    one = figures_of(vehicle, TURF)
    assert one.slip_curve is not None and one.climb is not None
    at = one.slip_curve.slip[one.slip_curve.slope.index(one.climb)]
    assert at == pytest.approx(0.6, abs=1e-6)
