"""Which pixels a raster has, if no resolution is given, and where sides are no whole number."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import given
from hypothesis import strategies as st

import terratool
from terratool.errors import RequestError
from terratool.raster.export import export_dem
from terratool.raster.grid import default_resolution, grid_over, overhang
from tests.commands import ROOT, call
from tests.conftest import terrain_of
from tests.mosaics import SITE

SLOPE: dict[str, Any] = {
    "origin": [10, 20],
    "elemTypes": {"slope": {"x": [0, 1], "y": [1, 2]}},
    "elemTree": {"type": "slope", "cells": [4, 2]},
}


def slope(width: float, depth: float, **more: Any) -> terratool.Terrain:
    return terrain_of({**SLOPE, "size": [width, depth], **more})


def track(x0: float, y0: float, x1: float, y1: float, width: float) -> dict[str, Any]:
    """In coordinates from the south-west corner."""
    path = [[10 + x0, 20 + y0], [10 + x1, 20 + y1]]
    return {"width": width, "depth": 0.05, "path": path}


class TestDefault:
    """What shows is what is there."""

    def test_three_pixels_across_the_narrowest_track(self) -> None:
        ruts = [track(1, 3.07, 7, 3.07, 0.12), track(2, 1, 2, 5, 0.9)]
        terrain = slope(8, 6, tracks=ruts)
        resolution, why = default_resolution(terrain)
        assert (resolution, why) == (pytest.approx(0.04), "a third of the narrowest track")
        grid = grid_over(terrain, resolution)
        column = grid.columns(grid.whole)[100]
        across = terrain.height(np.full(grid.height, column), grid.rows(grid.whole))
        plain = slope(8, 6).height(np.full(grid.height, column), grid.rows(grid.whole))
        lowered = np.flatnonzero(plain - across > 0.049)
        assert len(lowered) == 3

    def test_wide_tracks_need_no_finer_pixels(self) -> None:
        found = default_resolution(slope(8, 6, tracks=[track(1, 3, 7, 3, 0.9)]))
        assert found == (0.3, "a third of the narrowest track")
        found = default_resolution(slope(8, 6, tracks=[track(1, 3, 7, 3, 2.5)]))
        assert found == (0.6, "a tenth of the smallest cell")

    def test_a_part_has_its_own(self) -> None:
        """Of tracks, cells and curves; a limit of pixels holds for the part, too."""
        fine = {"type": "slope", "cellX": 3, "cellY": 1, "cells": 1000}
        tree = {**SLOPE["elemTree"], "children": [
            {**fine, "children": [{"type": "slope", "cellX": 999, "cellY": 999}]}]}  # fmt: skip
        terrain = slope(8, 6, elemTree=tree, tracks=[track(1, 1, 3, 1, 0.06)])
        limit = "4096 pixels on the longer side; a tenth of the smallest cell, 0.0002, "
        assert default_resolution(terrain) == (8 / 4096, limit + "would take 40,000")
        part = 10 + 4, 20 + 0, 10 + 8, 20 + 3
        assert default_resolution(terrain, part) == (0.6, "a tenth of the smallest cell")
        part = 10 + 2, 20 + 0, 10 + 8, 20 + 3
        assert default_resolution(terrain, part)[0] == pytest.approx(0.02)
        part = 10 + 7.9, 20 + 5.95, 10 + 9, 20 + 9
        assert default_resolution(terrain, part)[0] == pytest.approx(0.0002)
        with pytest.raises(RequestError, match="miss the terrain"):
            default_resolution(terrain, (0, 0, 1, 1))

    def test_the_command_says_why(self, tmp_path: Path) -> None:
        out = tmp_path / "a.tif"
        ran = call("export-dem", ROOT / "samples" / "wheel-tracks.json", out, "--no-losses")
        assert "pixels of 0.0333333 (a third of the narrowest track)" in ran.out
        with rasterio.open(out) as file:
            assert file.res == pytest.approx((0.1 / 3, 0.1 / 3), rel=1e-12)

    def test_a_raster_of_a_narrow_part(self) -> None:
        terrain = slope(8, 6)
        part = 11, 21, 17, 21.1
        assert default_resolution(terrain, part) == (pytest.approx(0.1), "one row of pixels")
        assert grid_over(terrain, default_resolution(terrain, part)[0], part).height == 1


class TestWholePixels:
    """Pixels whose centres lie on the terrain."""

    def test_a_side_that_is_no_whole_number(self, tmp_path: Path) -> None:
        terrain = slope(524.6, 384.13)
        grid = grid_over(terrain, 1)
        assert (grid.width, grid.height) == (525, 384)
        assert overhang(grid, terrain.bounds) == pytest.approx((0.4, -0.13))
        assert export_dem(terrain, grid, tmp_path / "a.tif").nodata == 0
        with rasterio.open(tmp_path / "a.tif") as file:
            assert file.bounds == (10, 20, 535, 404)
            heights = file.read(1)
            x, y = file.xy(0, 524)  # the north-east corner
        assert heights[0, 524] == np.float32(terrain.height(x, y))

    @given(
        st.floats(0.3, 300), st.floats(0.3, 300), st.floats(0.05, 20),
        st.sampled_from([(0.0, 0.0), (500000.0, 4649776.25), (-7.3, 1e-3)]),
    )  # fmt: skip
    def test_no_row_and_no_column_is_empty(
        self, width: float, depth: float, resolution: float, origin: tuple[float, float]
    ) -> None:
        """Nor is one left out that has its centres on the terrain, but for rounding."""
        if min(width, depth) < 0.51 * resolution:
            return
        terrain = slope(width, depth, origin=list(origin))
        grid = grid_over(terrain, resolution)
        x, y = grid.columns(grid.whole), grid.rows(grid.whole)
        assert np.isfinite(terrain.height(x, np.full(len(x), origin[1] + depth / 2))).all()
        assert np.isfinite(terrain.height(np.full(len(y), origin[0] + width / 2), y)).all()
        near = 1e-5 * resolution
        assert x[-1] + resolution >= origin[0] + width - near
        assert y[0] + resolution >= origin[1] + depth - near
        assert max(map(abs, overhang(grid, terrain.bounds))) <= resolution / 2 + near

    @pytest.mark.parametrize("steps", [0.5, 1.5, 10.5, 0.5 + 2**20])
    def test_a_centre_on_the_edge_is_none(self, steps: float) -> None:
        """Whichever way the quotient rounds: of two ways one would be a row without heights."""
        for step in (0.1, 0.3, 0.7, 1.1):
            terrain = slope(3 * step, steps * step)
            assert grid_over(terrain, step).height == max(1, math.floor(steps))

    def test_parts_are_rounded_too(self) -> None:
        terrain = slope(50, 40)
        part = 12.0, 21.0, 22.4, 31.6
        grid = grid_over(terrain, 1, part)
        assert (grid.width, grid.height) == (10, 11)
        assert overhang(grid, part) == pytest.approx((-0.4, 0.4))

    def test_the_command_says_where_they_end(self, tmp_path: Path) -> None:
        source = tmp_path / "a.json"
        source.write_text(json.dumps({**SITE, "size": [12.4, 8.13]}))
        ran = call("export-dem", source, tmp_path / "a.tif", "--resolution", 1)
        assert "The last pixels end 0.4 before the east side." in ran.out
        assert "The last pixels end 0.13 before the north side." in ran.out
        ran = call("export-dem", source, tmp_path / "b.tif", "--resolution", 0.7, "--json")
        over = json.loads(ran.out)["overhang"]
        assert over == pytest.approx([18 * 0.7 - 12.4, 12 * 0.7 - 8.13])
        ran = call("export-dem", source, tmp_path / "c.tif", "--resolution", 0.62 / 2,
                   "--bounds", 500000, 4649776, 500006.2, 4649779.1)  # fmt: skip
        assert "last pixels" not in ran.out

    def test_tiles_are_those_of_one_raster(self, tmp_path: Path) -> None:
        """A mosaic of a side that is no whole number has the same pixels at the same places."""
        source = tmp_path / "a.json"
        source.write_text(json.dumps({**SITE, "size": [12.4, 8.13]}))
        one, many = tmp_path / "one.tif", tmp_path / "tiles"
        ran = [
            call("export-dem", source, *where, "--resolution", 0.009, "--no-losses")
            for where in ((one,), ("--tiles", many, "--tile-size", 512))
        ]
        assert [r.code for r in ran] == [0, 0]
        with rasterio.open(one) as a, rasterio.open(many / "mosaic.vrt") as b:
            assert (a.bounds, a.shape) == (b.bounds, b.shape)
            assert np.array_equal(a.read(1), b.read(1), equal_nan=True)
