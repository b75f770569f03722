"""The worst heading, and the headings with which a vehicle drives: files, pictures, sentences."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio

from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.traversability.assess import assess
from terratool.traversability.judge import Judge
from terratool.traversability.map_files import map_paths
from terratool.traversability.map_results import Preview
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.report.page import as_page
from terratool.traversability.report.roses import CELLS, Rose, rose_path, roses
from terratool.traversability.report.wording import conclusion
from terratool.traversability.request import Request
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.verdicts import GroundClass
from tests.conftest import terrain_of
from tests.surveys import ROVER

TOPPLES = replace(ROVER, cog_height=0.6, clearance=0.2)
"""A rover that tips over sideways at 22.6° and, half as long again as wide, forwards at 26.6°."""


def hill(rise: float = 5.0) -> Terrain:
    """20 by 10 m of rock: level in the west, a plane that rises to the east from x 8 to 18."""
    return terrain_of(
        {
            "size": [20, 10],
            "surfTypes": {"rock": {"cohesion": 0, "fricAngle": 40, "sinkage": 0}},
            "elemTypes": {"ramp": {"x": [[0, 0], [0.4, 0], [0.9, 1], [1, 1]]}, "flat": {"x": [0]}},
            "elemTree": {"type": "ramp", "vScale": rise, "surface": "rock"},
        }
    )


def report_on(terrain: Terrain, map_path: Path | None = None) -> TraversabilityReport:
    """The report of the rover that topples."""
    request = Request(resolution=0.1, threads=1)
    prepared = prepare_assessment(terrain, TOPPLES, request, map_path=map_path)
    return assess(prepared, map_path=map_path)


def test_a_slope_that_only_its_fall_line_is_driven_on(tmp_path: Path) -> None:
    """It tips over sideways at 22.6°: on 24.7° it drives up and down, and at 45° to that."""
    rise = 10.0 * math.tan(math.radians(24.7))
    path = tmp_path / "m.tif"
    report = report_on(hill(rise), path)
    files = map_paths(path)
    at = [(13.0, 5.0)]
    found = []
    for name in files[:3]:
        with rasterio.open(name) as file:
            found.append(int(next(iter(file.sample(at)))[0]))
    best, worst, bits = found
    assert best == GroundClass.CAUTION and worst == GroundClass.NO_GO
    # clockwise from north: all but the first and the fifth, north and south
    assert bits == 0b11101110
    preview = report.preview
    assert preview is not None and preview.worst is not None and report.summary is not None
    counts = np.bincount(preview.worst.ravel(), minlength=len(GroundClass))
    stride = round(preview.grid.resolution / report.summary.grid.resolution)
    assert stride == 1 and dict(enumerate(counts.tolist())) == {
        int(ground): count for ground, count in report.summary.worst_counts.items()
    }


@pytest.mark.parametrize(
    ("best", "worst", "begins"),
    [
        ((77, 0, 23), (3, 0, 97), "77 % of the ground is go with the best heading, 3 % with every "
         "heading; 23 % is no-go."),
        ((77, 3, 20), (67, 3, 30), "77 % of the ground is go, 3 % is caution and 20 % is no-go."),
        ((5, 90, 5), (5, 0, 95), "5 % of the ground is go, 90 % is caution and 5 % is no-go; 95 % "
         "is no-go with the worst heading."),
        ((100, 0, 0), (45, 0, 55), "All of the ground is go, with the best heading at each place; "
         "45 % with every heading."),
        ((100, 0, 0), (100, 0, 0), "All of the ground is go, with the best heading at each place."),
    ],
)  # fmt: skip
def test_the_first_sentence_says_what_every_heading_can(
    best: tuple[int, ...], worst: tuple[int, ...], begins: str
) -> None:
    """Where that is much less than what some heading can."""
    known = report_on(hill(0.0))
    assert known.summary is not None
    kinds = GroundClass.GO, GroundClass.CAUTION, GroundClass.NO_GO
    counts, worsts = (dict(zip(kinds, numbers, strict=True)) for numbers in (best, worst))
    summary = replace(known.summary, counts=counts, worst_counts=worsts, reasons={})
    assert conclusion(replace(known, summary=summary)) == begins


def sampled(bits: np.ndarray, heights: np.ndarray | None = None, headings: int = 8) -> Preview:
    """A map with these headings, and ground everywhere unless heights are given."""
    shape = bits.shape
    level = np.zeros(shape, np.float32) if heights is None else heights
    return Preview(
        Grid(0.0, 0.0, 1.0, *shape), level, np.ones(shape, np.uint8), "",
        np.full(shape, 3, np.uint8), bits, headings,
    )  # fmt: skip


class TestRoses:
    """Roses of cells, by hand."""

    def test_only_ground_where_headings_differ_counts(self) -> None:
        """Half of a cell is driven to the east; all headings, or none, do not count."""
        bits = np.full((2 * CELLS, 4 * CELLS), 255, np.uint8)  # cells of 4 pixels
        bits[4:8, 8:12] = [[4, 4, 255, 255], [12, 12, 255, 255], [0] * 4, [0] * 4]
        assert list(roses(sampled(bits))) == [
            Rose(10.0, 6.0, (0.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0))
        ]

    def test_little_ground_that_differs_makes_none(self) -> None:
        bits = np.full((CELLS, 10 * CELLS), 255, np.uint8)  # cells of 100 pixels
        bits[0, :10], bits[:2, 20:26] = 4, 4
        assert [rose.right for rose in roses(sampled(bits))] == [25.0]

    @pytest.mark.parametrize(
        ("heading", "right", "down"), [(0, 0, -1), (2, 1, 0), (4, 0, 1), (6, -1, 0)]
    )
    def test_petals_point_where_the_vehicle_heads(
        self, heading: int, right: int, down: int
    ) -> None:
        """North is up, east is right."""
        bits = np.full((10, CELLS), 255, np.uint8)
        bits[3, 7] = 1 << heading
        path = rose_path(sampled(bits))
        x, y = np.array(re.findall(r"[ML]([\d.]+) ([\d.]+)", path), float).T
        assert len(x) == 4 and path.endswith("Z")
        assert (x[0], y[0]) == (7.5, 3.5)
        tip = np.array([x[2] - x[0], y[2] - y[0]])
        assert tip == pytest.approx([0.47 * right, 0.47 * down], abs=0.06)

    def test_more_headings_have_more_bits(self) -> None:
        bits = np.full((CELLS, CELLS), 2**16 - 1, np.uint16)
        bits[2, 5] = 1 << 12  # to the west
        (rose,) = roses(sampled(bits, headings=16))
        assert rose.shares.index(1.0) == 12 and (rose.right, rose.down) == (5.5, 2.5)


def test_the_page_shows_both_headings() -> None:
    report = report_on(hill(10.0 * math.tan(math.radians(24.7))))
    page = as_page(report)
    assert page.count("<img ") == 2 and page.count('class="roses"') == 1
    assert page.index("by the best heading.") < page.index("by the worst heading.")
    assert "white petals" in page
    level = as_page(report_on(hill(0.0)))
    assert level.count("<img ") == 1 and "the worst heading" not in level


def test_judged_cells_know_the_worst_heading(tmp_path: Path) -> None:
    """On the hill it is no-go, on the level it is what the best is."""
    vehicle = {
        "mass": 20, "wheels": {"radius": 0.1, "width": 0.06}, "wheelbase": 0.6, "track": 0.5,
        "cog": {"height": 0.6}, "clearance": 0.2,
    }  # fmt: skip
    path = tmp_path / "v.json"
    path.write_text(json.dumps(vehicle), "utf-8")
    terrain = hill(10.0 * math.tan(math.radians(24.7)))
    found = Judge.of(path).verdict(terrain, Grid(0.0, 0.0, 0.1, 100, 200), lambda _: None)
    assert found.worst[50, 130] == GroundClass.NO_GO != found.classes[50, 130]
    assert found.worst[50, 40] == found.classes[50, 40] == GroundClass.GO
