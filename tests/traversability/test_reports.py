"""Reports: one result in four forms, each well made whatever the names and numbers are."""

from __future__ import annotations

import json
import math
import re
import subprocess
import warnings
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest
import rasterio
from hypothesis import given
from hypothesis import strategies as st
from rasterio.errors import NotGeoreferencedWarning
from rasterio.io import MemoryFile

import terratool
from terratool.io.png import png
from terratool.raster import shading
from terratool.raster.grid import Grid
from terratool.report.tables import columns_of
from terratool.traversability.assess import verdict_of
from terratool.traversability.map_results import MapSummary, Preview
from terratool.traversability.report import drawing, tables, wording
from terratool.traversability.report.document import as_dict, as_json
from terratool.traversability.report.lines import as_lines
from terratool.traversability.report.page import as_markdown, as_page
from terratool.traversability.report.routes import as_geojson
from terratool.traversability.report.wording import conclusion
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.results import Reach, RouteProfile
from terratool.traversability.vehicle import Vehicle, Wheel
from terratool.traversability.verdicts import COLORS, GroundClass, Reason, Verdict
from tests import reports
from tests.programs import program

SCHEMA = terratool.schema("report")
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
XHTML = "{http://www.w3.org/1999/xhtml}"
SVG = "{http://www.w3.org/2000/svg}"

every_kind = pytest.mark.parametrize("kind", reports.KINDS)


def page_of(report: TraversabilityReport) -> ElementTree.Element:
    """The page, read by a parser that forgives nothing."""
    return ElementTree.fromstring(as_page(report).removeprefix("<!DOCTYPE html>\n"))


def text_in(element: ElementTree.Element) -> str:
    return " ".join("".join(element.itertext()).split())


def numbers_in(value: Any) -> Iterator[float]:
    if isinstance(value, dict):
        for inner in value.values():
            yield from numbers_in(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from numbers_in(inner)
    elif isinstance(value, float):
        yield value


class TestDocument:
    def test_the_schema_is_one(self) -> None:
        jsonschema.Draft202012Validator.check_schema(SCHEMA)

    @every_kind
    def test_every_report_fits_the_schema(self, kind: str) -> None:
        """Also as read again from its text, which has no NaN or infinity."""
        document = as_dict(reports.KINDS[kind])
        assert json.loads(as_json(reports.KINDS[kind])) == document
        assert [error.json_path for error in VALIDATOR.iter_errors(document)] == []
        assert all(map(math.isfinite, numbers_in(document)))

    def test_the_schema_knows_each_key(self) -> None:
        """A key that is left out, or a new one, is seen: the schema is as strict as it looks."""
        document = as_dict(reports.KINDS["all"])
        for key in document:
            assert not VALIDATOR.is_valid({k: v for k, v in document.items() if k != key})
        assert not VALIDATOR.is_valid({**document, "more": 1})
        document["surfaces"][0]["sinkage"] = 0.1
        assert not VALIDATOR.is_valid(document)

    def test_units_are_those_of_the_names(self) -> None:
        """Values by hand: degrees of radians, kPa of Pa, m/kN of m/N."""
        document = as_dict(reports.KINDS["all"])
        sand = document["surfaces"][0]
        assert sand["friction_deg"] == pytest.approx(28.0)
        assert sand["cohesion_kPa"] == pytest.approx(1.04)
        assert sand["sinkage_rate_m_per_kN"] == pytest.approx(0.18)
        assert sand["normal_stress_kPa"] == pytest.approx(9.8)
        assert sand["sinkage_m"] == 0.00417
        assert document["vehicle"]["weight_N"] == pytest.approx(25 * 3.71)
        assert document["routes"][0]["steepest"]["pitch_deg"] == pytest.approx(math.degrees(-0.21))
        assert document["map"]["fractions"]["unknown"] == pytest.approx(530 / (2330 - 20))

    def test_axles_with_wheels_of_their_own_have_them(self) -> None:
        """In the document as in the table of figures; the others have none."""
        vehicle = as_dict(reports.KINDS["all"])["vehicle"]
        front, middle, rear = (axle["wheel"] for axle in vehicle["axles"])
        assert front is None
        assert vehicle["wheel"]["grouser_height_m"] == 0
        assert vehicle["wheel"]["patch_pressure_kPa"] is None  # a rigid rim
        assert (middle["radius_m"], middle["patch_pressure_kPa"]) == (0.11, pytest.approx(95))
        assert (rear["grouser_height_m"], rear["contact_length_m"]) == (0.02, 0.12)
        assert (rear["max_torque_Nm"], rear["tread_m"]) == (5, 0.02)
        page = as_markdown(reports.KINDS["all"])
        assert "| radius 0.125 m, width 0.1 m |" in page
        (axles,) = (line for line in page.splitlines() if line.startswith("| axles |"))
        assert axles == (
            "| axles | 2 driven wheels 0.3 m ahead; 2 towed wheels at the centre of gravity, of "
            "radius 0.11 m, width 50 mm, 95 kPa on hard ground; 2 driven wheels 0.3 m behind, of "
            "radius 0.125 m, width 0.1 m, lugs of 20 mm, a contact of 0.12 m or more, at most "
            "5 N m |"
        )

    def test_what_is_not_known_is_null(self) -> None:
        document = as_dict(reports.KINDS["all"])
        assert document["surfaces"][3]["sinkage_m"] is None
        assert document["surfaces"][2]["normal_stress_kPa"] is None  # infinite
        assert document["routes"][0]["profile"]["slip"][0] is None  # NaN
        assert document["vehicle"]["rear"]["height_m"] is None  # nothing can touch
        assert as_dict(reports.KINDS["wheel"])["vehicle"]["wheel"]["max_torque_Nm"] is None


def test_each_report_says_what_has_written_it() -> None:
    report = reports.KINDS["all"]
    assert as_dict(report)["tool"] == {"name": "terratool", "version": terratool.__version__}
    assert as_markdown(report).endswith(f"\nterratool {terratool.__version__}\n")
    assert f"<p>terratool {terratool.__version__}</p>" in as_page(report)
    assert json.loads(as_geojson(report))["terratool"] == terratool.__version__


class TestMarkdown:
    @every_kind
    def test_every_row_has_the_cells_of_its_table(self, kind: str) -> None:
        """A name with | in it makes no cell more."""
        width = None
        for line in as_markdown(reports.KINDS[kind]).split("\n"):
            if not line.startswith("|"):
                width = None
                continue
            cells = len(re.findall(r"(?<!\\)\|", line)) - 1
            width = width or cells
            assert cells == width > 1, line

    def test_nothing_of_the_users_is_markup(self) -> None:
        text = as_markdown(reports.KINDS["all"])
        assert "<b>" not in text
        assert r"\<b\>" in text
        assert r"\`x\` \*y\* \_z\_ \[a\](b) \\" in text

    def test_says_the_verdict_first(self) -> None:
        first, _, second = as_markdown(reports.KINDS["all"]).split("\n")[:3]
        assert first.startswith("# ✘ no-go")
        assert second.startswith("**There is no way from (105, 202) to (130, 212): step at")


class TestPage:
    def test_reach_is_told_from_a_pin_that_is_seen(self) -> None:
        """One of its own; where a route starts there, too, that one's, which would cover it."""
        whole = reports.KINDS["all"]
        assert whole.reach is not None
        for start, letter in ((reports.WAY.goal, "S"), (reports.WAY.start, "A")):
            reach = replace(whole.reach, start=start)
            text = as_page(replace(whole, reach=reach, routes=(reports.WAY,)))
            assert f"can be reached from {letter}." in text
            assert f">{letter}</span>" in text
            assert (">S</span>" in text) == (letter == "S")

    @every_kind
    def test_is_well_formed(self, kind: str) -> None:
        root = page_of(reports.KINDS[kind])
        assert root.tag == f"{XHTML}html"
        assert root.get("lang") == "en"

    def test_a_tiny_share_is_no_markup(self) -> None:
        """In the legend of the map, too."""
        counts = {GroundClass.GO: 99_999, GroundClass.ONE_WAY: 1}
        summary = replace(reports.SUMMARY, counts=counts)
        text = text_in(page_of(reports.report(summary=summary)))
        assert "one-way <0.1 %" in text

    @every_kind
    def test_takes_nothing_from_elsewhere(self, kind: str) -> None:
        """No script, no link, no address but those of namespaces, which nobody follows."""
        text = as_page(reports.KINDS[kind])
        for namespace in ("http://www.w3.org/1999/xhtml", "http://www.w3.org/2000/svg"):
            text = text.replace(f'xmlns="{namespace}"', "")
        assert "://" not in text
        assert "@import" not in text
        tags = {element.tag.rpartition("}")[2] for element in page_of(reports.KINDS[kind]).iter()}
        assert not tags & {"script", "link", "iframe", "object", "embed", "base", "form"}
        for element in page_of(reports.KINDS[kind]).iter():
            for name in ("src", "href"):
                assert element.get(name, "data:").startswith("data:")
            assert not any(name.startswith("on") for name in element.keys())  # noqa: SIM118

    @every_kind
    def test_is_the_same_twice(self, kind: str) -> None:
        assert as_page(reports.KINDS[kind]) == as_page(reports.KINDS[kind])

    def test_names_are_shown_as_they_are(self) -> None:
        root = page_of(reports.KINDS["all"])
        assert reports.NASTY in "".join(root.itertext())
        assert not list(root.iter(f"{XHTML}b"))
        titles = [element.text for element in root.iter(f"{XHTML}title")]
        assert titles == ["no-go: site & yard.json"]

    @pytest.mark.nightly
    @given(st.text(max_size=20))
    def test_no_name_breaks_it(self, name: str) -> None:
        """Control characters and halves of pairs, too, which XML may not hold."""
        odd = reports.report(
            terrain=name, descr=name, preview=None,
            surfaces=(replace(reports.SAND, surface=name),), routes=(reports.NO_WAY,),
            vehicle=replace(reports.ROVER, name=name),
        )  # fmt: skip
        page_of(odd)
        as_page(odd).encode()
        as_markdown(odd).encode()

    def test_the_parts_stand_in_order(self) -> None:
        """The verdict first, limits and assumptions last."""
        root = page_of(reports.KINDS["way"])
        (strong,) = root.iter(f"{XHTML}strong")
        assert strong.text == "! caution"
        titles = [text_in(element) for element in root.iter(f"{XHTML}h2")]
        assert titles == [
            "Route", "Reach", "Surfaces", "Map", "Vehicle", "Limits and assumptions",
        ]  # fmt: skip
        text = as_page(reports.KINDS["way"])
        assert text.index('class="verdict"') < text.index("<img ") < text.index("<h2>")

    def test_pictures_and_tables_say_what_they_are(self) -> None:
        """Each picture has a text, each table its heads; what only decorates is hidden."""
        root = page_of(reports.KINDS["all"])
        for image in root.iter(f"{XHTML}img"):
            assert image.get("alt")
        for svg in root.iter(f"{SVG}svg"):
            assert svg.get("aria-hidden") == "true" or (
                svg.get("role") == "img" and svg.get("aria-label")
            )
        rows = 0
        for table in root.iter(f"{XHTML}table"):
            heads = [text_in(head) for head in table.iter(f"{XHTML}th") if head.get("scope")]
            assert heads
            for row in table.findall(f"{XHTML}tbody/{XHTML}tr"):
                first, *cells = row
                assert first.get("scope") == "row"
                titles = [text_in(head) for head in table.find(f"{XHTML}thead/{XHTML}tr") or ()]
                assert [cell.get("data-title") for cell in cells] == titles[1:]
                rows += 1
        assert rows > 20

    def test_coordinates_stand_along_the_sides(self) -> None:
        """Of the picture, 100 to 140 by 200 to 215: x from the west, y from the north."""
        root = page_of(reports.KINDS["way"])
        side, foot = (
            {
                span.text: float((span.get("style") or "").partition(":")[2].rstrip("%"))
                for span in next(d for d in root.iter(f"{XHTML}div") if d.get("class") == name)
            }
            for name in ("side", "foot")
        )
        assert foot == {"100": 0.0, "110": 25.0, "120": 50.0, "130": 75.0, "140": 100.0}
        assert side == pytest.approx({"200": 100.0, "205": 66.67, "210": 33.33, "215": 0.0})
        caption = text_in(next(root.iter(f"{XHTML}figcaption")))
        assert "Along the sides stand x and y in EPSG:32633, m." in caption

    def test_contours_are_those_of_the_legend(self) -> None:
        """Of a plane from 100 to 139 m to the east: a line between pixels each 5 m."""
        heights = np.tile(np.arange(100, 140, dtype=np.float32), (20, 1))
        plane = Preview(Grid(0, 0, 1, 20, 40), heights, np.ones((20, 40), np.uint8))
        page = as_page(reports.report(preview=plane, reach=None))
        assert "heights from 100 to 139\u00a0m, lines every 5\u00a0m" in page
        assert shading.contour_interval(plane.heights) == 5
        scale = 720 // 40
        row = drawing.map_picture(plane)[5, scale // 2 :: scale, 0].astype(int)
        dark = np.flatnonzero(row < row.max() - 20)
        assert dark.tolist() == [4, 9, 14, 19, 24, 29, 34]
        level = replace(plane, heights=heights * 0 + 7)
        assert shading.contour_interval(level.heights) == 0
        assert "height 7\u00a0m" in as_page(reports.report(preview=level, reach=None))

    def test_the_way_lies_where_it_is(self) -> None:
        """In thousandths of the picture from its north-west: a mirrored one would be caught."""
        root = page_of(reports.KINDS["way"])
        lines = [
            line.get("points", "")
            for line in root.iter(f"{SVG}polyline")
            if line.get("class") == "way"
        ]
        first, last = lines[-1].split()[0], lines[-1].split()[-1]
        # the picture is 100 to 140 by 200 to 215
        assert tuple(map(float, first.split(","))) == pytest.approx((125.0, 866.7), abs=0.05)
        assert tuple(map(float, last.split(","))) == pytest.approx((750.0, 200.0), abs=0.05)
        pins = {
            pin.text: pin.get("style")
            for pin in root.iter(f"{XHTML}span")
            if pin.get("class") == "pin"
        }
        assert pins["A"] == "left:12.50%;top:86.67%"
        assert pins["B"] == "left:75.00%;top:20.00%"

    def test_what_bars_the_way_is_said_and_shown(self) -> None:
        text = as_page(reports.KINDS["no-way"])
        assert "/elemTree/children/3 (surface &#x27;rock&#x27;)" in text
        assert text.count('class="pin bar"') == 2

    def test_contrast_of_the_verdicts_is_enough(self) -> None:
        """At least 4.5 to 1 for the words on the colours (WCAG 2.2, success criterion 1.4.3)."""
        style = as_page(reports.KINDS["nothing"])
        shades = dict(re.findall(r"--([\w-]+): (#\w{6})", style.split("}")[0]))
        found = re.findall(r"strong\.([\w-]+) \{ background: ([^;]+); color: (#\w{6})", style)
        assert len(found) == 4
        for name, back, ink in found:
            back = shades[name] if back.startswith("var") else back
            low, high = sorted((_luminance(back), _luminance(ink)))
            assert (high + 0.05) / (low + 0.05) >= 4.5, name


def _luminance(color: str) -> float:
    parts = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


class TestPicture:
    def test_light_comes_from_the_north_west(self) -> None:
        """A plane that falls to the north-west is brighter than level ground, by Horn's formula."""
        row, column = np.indices((6, 9), np.float32)
        level = shading.hillshade(np.zeros((6, 9), np.float32), 1.0)
        assert np.allclose(level, math.sin(math.pi / 4))
        # rises to the south-east by 45° in that direction: it faces the light exactly
        facing = shading.hillshade((row + column).astype(np.float32) / np.sqrt(2), 1.0)
        assert np.allclose(facing, 1.0, atol=1e-6)
        away = shading.hillshade(-(row + column).astype(np.float32) / np.sqrt(2), 1.0)
        assert np.allclose(away, 0.0, atol=1e-6)
        across = shading.hillshade((row - column).astype(np.float32) / np.sqrt(2), 1.0)
        assert np.allclose(across, 0.5, atol=1e-6)

    def test_agrees_with_gdal(self, tmp_path: Any) -> None:
        """gdaldem's hillshade of the same heights, where all neighbours are there."""
        heights = reports.preview().heights[8:, :60]
        path = tmp_path / "dem.tif"
        with rasterio.open(
            path, "w", driver="GTiff", height=heights.shape[0], width=heights.shape[1], count=1,
            dtype="float32", crs="EPSG:32633", transform=rasterio.Affine(0.5, 0, 0, 0, -0.5, 0),
        ) as file:  # fmt: skip
            file.write(heights, 1)
        out = tmp_path / "shade.tif"
        subprocess.run(
            [program("gdaldem"), "hillshade", "-q", path, out], check=True, capture_output=True
        )
        with rasterio.open(out) as file:
            wanted = file.read(1).astype(float)
        shade = shading.hillshade(heights, 0.5)
        # gdaldem writes 1 + 254 · light
        assert np.allclose(1 + 254 * shade[1:-1, 1:-1], wanted[1:-1, 1:-1], atol=1.0)

    def test_verdicts_differ_in_grey(self) -> None:
        """In any light the three stay apart as greys do, and unknown is dotted."""
        ranges = []
        for verdict in (GroundClass.NO_GO, GroundClass.CAUTION, GroundClass.GO):
            grey = float(np.dot(COLORS[verdict], (0.299, 0.587, 0.114)))
            ranges.append((grey * drawing.SHADING[0], grey * drawing.SHADING[1]))
        assert all(dark[1] < light[0] for dark, light in pairwise(ranges))

    def test_legend_and_picture_have_the_same_colours(self) -> None:
        style = as_page(reports.KINDS["nothing"])
        shades = dict(re.findall(r"--([\w-]+): (#\w{6})", style))
        for verdict, color in COLORS.items():
            assert shades[verdict.label] == "#{:02x}{:02x}{:02x}".format(*color)

    def test_the_png_holds_what_was_painted(self) -> None:
        pixels = drawing.map_picture(replace(reports.preview(), reached=reports.best_cells()))
        assert pixels.shape == (270, 720, 4)
        assert pixels[5, -5, 3] == 0  # no ground in the north-east
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with MemoryFile(png(pixels)) as memory, memory.open() as file:
                assert np.array_equal(np.moveaxis(file.read(), 0, -1), pixels)
        assert png(pixels) == png(pixels)


class TestChart:
    def test_peaks_stay(self) -> None:
        """One sample of ten thousand is seen: highest, deepest, no-go."""
        n = 10_000
        base = reports.profile(n)
        height, sinkage, verdict = base.height * 0, base.sinkage * 0, base.verdict * 0 + 1
        height[7123], sinkage[2000], verdict[4000] = 3.0, 0.05, 3
        drawn = drawing.chart(
            replace(base, height=height, sinkage=sinkage, verdict=verdict.astype(np.uint8)), 600
        )
        root = ElementTree.fromstring(drawn)
        assert [rect.get("class") for rect in root.iter(f"{SVG}rect")] == ["go", "no-go", "go"]
        ground = next(p for p in root.iter(f"{SVG}path") if p.get("class") == "ground")
        ys = [float(y) for y in re.findall(r" ([\d.]+)", ground.get("d", ""))]
        assert (min(ys), max(ys)) == (22.0, 152.0)
        texts = [text.text for text in root.iter(f"{SVG}text")]
        assert {"3", "50", "height, m", "sinkage, mm", "distance, m"} <= set(texts)

    def test_marks_do_not_overlap(self) -> None:
        """At the width of a phone, numbers along the way keep apart."""
        for total in (0.37, 12.0, 9876.5):
            base = reports.profile()
            scaled = replace(base, distance=base.distance / base.distance[-1] * total)
            root = ElementTree.fromstring(drawing.chart(scaled, 330))
            marks = [
                (float(text.get("x", "")), len(text.text or ""))
                for text in root.iter(f"{SVG}text")
                if text.get("text-anchor") == "middle"
            ]
            assert len(marks) >= 2
            for (x, wide), (other, also) in pairwise(marks):
                assert other - x > 3.5 * (wide + also) + 4

    @pytest.mark.parametrize("n", [0, 1, 2])
    def test_few_samples(self, n: int) -> None:
        base = reports.profile(2)
        few = RouteProfile(**{name: getattr(base, name)[:n] for name in RouteProfile.__slots__})
        assert bool(drawing.chart(few, 600)) == (n == 2)

    def test_ground_that_is_not_there_leaves_a_gap(self) -> None:
        base = reports.profile()
        base.height[80:120] = np.nan
        root = ElementTree.fromstring(drawing.chart(base, 600))
        ground = next(p for p in root.iter(f"{SVG}path") if p.get("class") == "ground")
        assert ground.get("d", "").count("M") == 2

    @given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 9))
    def test_ticks_are_round_and_within(self, first: float, side: float, count: int) -> None:
        last = first + side
        if last - first < 1e-9 * max(abs(first), abs(last)):
            return
        found = shading.ticks(first, last, count)
        assert len(found) <= count + 1
        slack = 1e-6 * side
        assert all(first - slack <= value <= last + slack for value in found)


class TestTable:
    @every_kind
    def test_fits_eighty_columns(self, kind: str) -> None:
        for line in as_lines(reports.KINDS[kind]):
            assert sum(map(columns_of, line)) <= 80, line

    def test_wide_characters_count_twice(self) -> None:
        odd = reports.report(surfaces=(replace(reports.SAND, surface="砂" * 40), reports.ROCK))
        lines = [line for line in as_lines(odd) if "sand" in line or "砂" in line]
        assert lines
        assert any("砂砂…" in line for line in lines)
        # but for lines of JSON, which are not broken
        told = [line for line in as_lines(odd) if not line.startswith('  "')]
        assert all(sum(map(columns_of, line)) <= 80 for line in told)

    def test_says_what_limits_steps(self) -> None:
        """Once where it is the same for all, else surface by surface."""
        rock = replace(reports.ROCK, step_binding="friction", step_axle=3)
        stone = replace(rock, surface="stone")
        alike = " ".join(as_lines(reports.report(surfaces=(rock, stone))))
        assert "Steps are limited by friction at the rear axle." in alike
        text = " ".join(as_lines(reports.report(surfaces=(rock, reports.SAND, reports.BARE))))
        told = "friction at the rear axle (rock) and torque at the front axle (sand)."
        assert told in " ".join(text.split())

    def test_reasons_are_not_cut(self) -> None:
        """What is too long for a line goes on in the next."""
        reasons = {reason: 100 + reason for reason in (Reason.APPROACH, *range(4, 10))}
        summary = replace(
            reports.SUMMARY, reasons={Reason(reason): n for reason, n in reasons.items()}
        )
        text = " ".join(" ".join(as_lines(reports.report(summary=summary))).split())
        assert re.search(r"What binds: approach or departure \d\S* %, tip-over", text)

    def test_columns_line_up(self) -> None:
        lines = list(as_lines(reports.KINDS["wheel"]))
        start = lines.index("") + 1
        head, sand, rock = lines[start : start + 3]
        for title, one, other in (("level", "go ", "go "), ("what binds", "slip", "–")):
            at = head.index(title)
            assert sand[at:].startswith(one)
            assert rock[at:].startswith(other)

    def test_says_the_verdict_first_and_once(self) -> None:
        text = "\n".join(as_lines(reports.KINDS["all"]))
        assert text.startswith("no-go: There is no way from (105, 202) to (130, 212): step at")
        assert "\n".join(as_lines(reports.KINDS["way"])).count("There is a way") == 1


class TestConclusion:
    @pytest.mark.parametrize(
        ("counts", "verdict", "part"),
        [
            ({GroundClass.GO: 5}, Verdict.GO, "All of the ground is go"),
            (
                {GroundClass.GO: 5, GroundClass.NO_GO: 5},
                Verdict.CAUTION,
                "50 % of the ground is go",
            ),
            ({GroundClass.NO_GO: 5}, Verdict.NO_GO, "100 % of the ground is no-go"),
            ({GroundClass.NO_GO: 5, GroundClass.GO: 0}, Verdict.NO_GO, "step, on 100 %"),
            ({GroundClass.UNKNOWN: 5}, Verdict.UNKNOWN, "Nothing is known"),
            ({GroundClass.UNKNOWN: 5, GroundClass.NO_GO: 5}, Verdict.NO_GO, "50 % is unknown"),
            ({GroundClass.UNKNOWN: 1, GroundClass.GO: 3}, Verdict.CAUTION, "25 % is unknown"),
            ({GroundClass.GO: 3, GroundClass.CUT_OFF: 1}, Verdict.CAUTION, "and 25 % is cut off"),
            # what carries downhill only, where the vehicle gets about nowhere
            (
                {GroundClass.ONE_WAY: 1, GroundClass.NO_GO: 3},
                Verdict.NO_GO,
                "no place that the vehicle can",
            ),
            (
                {GroundClass.ONE_WAY: 1, GroundClass.NO_GO: 3},
                Verdict.NO_GO,
                "25 % can be reached, but not",
            ),
            ({}, Verdict.UNKNOWN, "no ground"),
        ],
    )
    def test_of_a_map(self, counts: dict[GroundClass, int], verdict: Verdict, part: str) -> None:
        reasons = {Reason.STEP: counts.get(GroundClass.NO_GO, 0)}
        summary = MapSummary(Grid(0, 0, 1, 1, 10), 8, counts, counts, reasons, {})
        assert verdict_of(summary, ()) == verdict
        assert part in conclusion(reports.report(summary=summary, routes=(), reach=None))

    @pytest.mark.parametrize(
        ("counts", "verdict", "part"),
        [
            (
                {GroundClass.GO: 8, GroundClass.EDGE: 2},
                Verdict.GO,
                "is go, with the best heading at each place. The edge of the terrain, 20 %",
            ),
            ({GroundClass.UNKNOWN: 8, GroundClass.EDGE: 2}, Verdict.UNKNOWN, "Nothing is known"),
            (
                {GroundClass.CAUTION: 8, GroundClass.EDGE: 2},
                Verdict.CAUTION,
                "100 % of the ground is caution. The edge",
            ),
            ({GroundClass.EDGE: 2}, Verdict.NO_GO, "100 % of the ground lies at the edge"),
        ],
    )
    def test_the_edge_says_nothing_of_the_ground(
        self, counts: dict[GroundClass, int], verdict: Verdict, part: str
    ) -> None:
        """Every terrain has a rim where a vehicle would stand over it: level ground is go."""
        summary = MapSummary(Grid(0, 0, 1, 1, 10), 8, counts, counts, {}, {})
        assert verdict_of(summary, ()) == verdict
        assert part in conclusion(reports.report(summary=summary, routes=(), reach=None))

    def test_the_worst_route_decides(self) -> None:
        """Not the map, and not the first."""
        summary = MapSummary(Grid(0, 0, 1, 1, 10), 8, {GroundClass.GO: 5}, {}, {}, {})
        routes = (reports.WAY, reports.NO_WAY)
        assert verdict_of(summary, routes) == Verdict.NO_GO
        assert "/elemTree/children/3 (surface 'rock')" in conclusion(
            reports.report(summary=summary, routes=routes)
        )
        unknown = replace(reports.NO_WAY, verdict=Verdict.UNKNOWN)
        assert verdict_of(summary, (reports.WAY, unknown)) == Verdict.UNKNOWN


def test_a_wheel_by_itself_has_a_load_and_no_body() -> None:
    wheel = dict(tables.properties(Vehicle.single(Wheel(0.2, 0.1), 100.0)).rows)
    assert wheel["load"] == "100 N"
    assert wheel["largest torque of a wheel"] == "no limit"
    assert not {"mass", "track", "clearance"} & set(wheel)


@pytest.mark.parametrize(
    ("returnable", "end"),
    [
        (0.96904, "and left again."),
        (0.96902, "and left again from nearly all of that."),
        (0.5, "and left again from 50 %."),
    ],
)
def test_what_can_be_left_again_is_told_apart_where_the_digits_are_alike(
    returnable: float, end: str
) -> None:
    found = Reach(reports.place(3.0, 4.0), 0.96904, returnable, reports.best_cells())
    line = wording.reach_line(found)
    assert line == f"From (3, 4) 96.9 % of the ground can be reached, {end}"
