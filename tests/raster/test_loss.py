"""What a grid loses, where the answer is known, and against slow ways to find it."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import reduce
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.field.bounds import largest_heights, nonzero_edges
from terratool.field.terrain import Terrain
from terratool.kernels import field as kernels
from terratool.raster import loss
from terratool.raster.grid import Grid, Window, grid_over
from terratool.raster.loss import (
    InterpolationError,
    LargestJump,
    LossCounts,
    LossFinder,
    RasterLoss,
    SteepestRamp,
    SubpixelFeature,
    SubpixelFeatures,
    WallLoss,
    subpixel_features,
)
from terratool.raster.painter import Painter
from tests.brute import walls
from tests.conftest import terrain_of
from tests.raster.test_painter import EXAMPLES, crowded
from tests.strategies import definitions

TYPES: dict[str, Any] = {
    "nothing": {"x": [0]},
    "box": {"x": [1]},
    "column": {"combine": "radial", "x": [1]},
    "dome": {"combine": "radial", "x": "dome"},
    "hill": {"x": "cos", "y": []},
    "tent": {"x": "tent"},
    "slope": {"x": [0, 1]},
    "pyramid": {"combine": "min", "x": "tent", "y": []},
    "stairs": {"x": [[0, 0], [0.2, 0], [0.2, 1], [0.6, 1], [0.6, 2], [1, 2]]},
}


def terrain_with(*children: dict[str, Any], size: Any = 10, **root: Any) -> Terrain:
    """A level terrain of 10 × 10 cells with these children."""
    children_ = [{"vScale": 1, **child} for child in children]
    tree = {"type": "nothing", **root, "children": children_}
    surfaces = {"hole": {"void": True}, "rock": {}}
    return terrain_of({"size": size, "surfTypes": surfaces, "elemTypes": TYPES, "elemTree": tree})


def at(x: int, y: int, w: int = 1, h: int = 1, **more: Any) -> dict[str, Any]:
    """An element in a block of cells."""
    return {"cellX": x, "cellY": y, "span": [w, h], **more}


def part_of(
    terrain: Terrain, grid: Grid, size: tuple[int, int] = (512, 512), dtype: Any = np.float32
) -> LossCounts:
    """What is lost in all windows of a size."""
    found = LossFinder(terrain, grid, dtype)
    painter = Painter(terrain, grid, dtype, surfaces=False, labels=True)
    parts = [found.of(w, painter.paint(found.with_neighbours(w))) for w in grid.windows(*size)]
    return sum(parts, LossCounts())


def statement_of(terrain: Terrain, resolution: float, dtype: Any = np.float32) -> RasterLoss:
    grid = grid_over(terrain, resolution)
    found = LossFinder(terrain, grid, dtype)
    return found.statement(part_of(terrain, grid, dtype=dtype), 0)


def walls_of(terrain: Terrain, resolution: float) -> WallLoss:
    return statement_of(terrain, resolution).walls


class TestWalls:
    """Lengths, heights and ramps of walls whose measures are known."""

    @pytest.mark.parametrize("size", [10, [10, 20], [30, 10]])
    def test_of_a_box_have_its_perimeter(self, size: Any) -> None:
        """All four sides, each as long as it is; the ramp climbs the box within a pixel."""
        terrain = terrain_with(at(2, 3, 5, 4, type="box", vScale=2.1), size=size)
        width, height = terrain.size
        found = walls_of(terrain, 0.1)
        assert found.length == pytest.approx(2 * (0.5 * width + 0.4 * height), rel=1e-6)
        assert found.pairs == round(found.length / 0.1)
        assert not found.estimated
        assert found.steepest_ramp and found.largest_jump
        assert found.largest_jump.height == pytest.approx(2.1, abs=1e-9)
        assert found.steepest_ramp.rise == np.float32(2.1)
        assert found.steepest_ramp.degrees == pytest.approx(math.degrees(math.atan(21)), abs=1e-4)

    @pytest.mark.parametrize("resolution", [0.1, 0.037, 0.2])
    @pytest.mark.parametrize("turn", [10, 33, 45, 60, 90, 135])
    def test_of_a_turned_box(self, turn: float, resolution: float) -> None:
        """The trimmed square has eight sides; none counts by the steps that pixels make of it."""
        a = math.radians(turn % 90)
        length = 4 * 4.0
        if a:  # each corner of the square that sticks out is cut off, with two legs
            out = 2 * (math.cos(a) + math.sin(a) - 1)
            length += 4 * (out * (1 / math.tan(a) + math.tan(a)))
            length -= 4 * (out / math.cos(a) + out / math.sin(a))
        found = walls_of(terrain_with(at(3, 3, 4, 4, type="box", turnDeg=turn)), resolution)
        # the ends of eight sides are known to a pixel
        assert found.length == pytest.approx(length, abs=4 * resolution)

    @pytest.mark.parametrize("resolution", [0.1, 0.037])
    def test_of_a_column_have_its_circumference(self, resolution: float) -> None:
        """Neither 4/π too long, as its steps are, nor the diagonals of them."""
        found = walls_of(terrain_with(at(3, 3, 5, 5, type="column")), resolution)
        assert found.length == pytest.approx(5 * math.pi, rel=3e-3)

    def test_between_equal_neighbours_are_none(self) -> None:
        """Two boxes side by side are one; a candidate is no wall."""
        terrain = terrain_with(at(2, 2, type="box"), at(3, 2, type="box"))
        part = part_of(terrain, grid_over(terrain, 0.1))
        assert (part.candidates, part.tested, part.pairs) == (70, 70, 60)

    def test_of_stairs_and_of_what_they_end_at(self) -> None:
        """Two risers of 1 and the far end of 2, with the sides where it is above the ground."""
        found = walls_of(terrain_with(at(2, 2, 5, 5, type="stairs")), 0.1)
        assert found.length == pytest.approx(5 + 5 + 5 + 2 * 0.8 * 5, rel=1e-6)
        assert found.largest_jump
        assert found.largest_jump.height == pytest.approx(2)
        assert 5 <= found.largest_jump.x <= 7.001
        assert found.steepest_ramp
        assert 5 <= found.steepest_ramp.x <= 7.001

    def test_on_a_slope_are_no_ramp_of_their_own(self) -> None:
        """Across a low wall the slope is what climbs; along the slope its ramp is its own."""
        low, high = (
            terrain_with(at(2, 3, 5, 4, type="box", vScale=height), type="slope", vScale=100)
            for height in (0.02, 20.0)
        )
        found = walls_of(low, 0.1)
        assert found.length == pytest.approx(18, rel=1e-6)
        assert found.largest_jump and found.largest_jump.height == pytest.approx(0.02, rel=1e-6)
        assert found.steepest_ramp and found.steepest_ramp.rise == pytest.approx(0.02, rel=1e-4)
        found = walls_of(high, 0.1)
        assert found.steepest_ramp and found.steepest_ramp.rise == pytest.approx(20 + 1, rel=1e-5)

    def test_lower_than_a_thousandth_of_a_pixel_do_not_count(self) -> None:
        for height, length in ((0.9e-4, 0), (1.1e-4, 18)):
            terrain = terrain_with(at(2, 3, 5, 4, type="box", vScale=height))
            assert walls_of(terrain, 0.1).length == pytest.approx(length, rel=1e-6)

    @pytest.mark.parametrize("name", ["hill", "dome", "pyramid"])
    def test_of_what_ends_at_the_ground_are_none(self, name: str) -> None:
        """Not even at the rim of a dome, which is upright."""
        terrain = terrain_with(at(2, 2, 5, 5, type=name), at(7, 8, type=name, turnDeg=180))
        found = walls_of(terrain, 0.1)
        assert (found.length, found.pairs) == (0, 0)
        assert found.steepest_ramp is None
        assert found.largest_jump is None

    def test_of_a_dome_on_a_step(self) -> None:
        """A wall as high as the step all around it, however steep the dome goes on."""
        found = walls_of(terrain_with(at(2, 2, 6, 6, type="dome", vOffset=0.01)), 0.05)
        assert found.length == pytest.approx(6 * math.pi, rel=5e-3)

    @pytest.mark.parametrize("patch", [{}, {"turnDeg": 90}])
    def test_of_where_a_relief_ends(self, patch: dict[str, Any]) -> None:
        """A patch that adds no height ends one relief and begins another: upright, all around."""
        gravel, mud = (
            {"roughness": {"rms": rms, "correlation": 0.7, "seed": seed}}
            for rms, seed in ((0.05, 3), (0.02, 8))
        )
        patch = {"type": "box", "vScale": 0, "surface": "mud", **at(2, 3, 4, 4), **patch}
        tree = {"type": "nothing", "surface": "gravel", "children": [patch]}
        surfaces = {"gravel": gravel, "mud": mud}
        found = walls_of(
            terrain_of({"size": 10, "surfTypes": surfaces, "elemTypes": TYPES, "elemTree": tree}),
            0.1,
        )
        # all but where the two are as high by chance: within 1e-4 of a jump of 0.054 rms
        assert 0.95 * 16 <= found.length <= 16 * (1 + 1e-9)
        assert found.largest_jump and 0.05 < found.largest_jump.height < 5 * math.hypot(0.05, 0.02)

    def test_against_the_slope(self) -> None:
        """A low kerb down on a steep slope up is found: slopes are taken off what is compared."""
        terrain = terrain_with(at(4, 0, 6, 10, type="box", vScale=-0.05), type="slope", vScale=20)
        found = walls_of(terrain, 0.1)
        assert found.length == pytest.approx(10)
        assert found.largest_jump
        assert found.largest_jump.height == pytest.approx(0.05)

    def test_to_the_outside_and_the_void_do_not_count(self) -> None:
        """The terrain's own edges are none, nor those of a hole, wherever the pixels end."""
        hole = at(3, 3, 2, 2, type="box", surface="hole", vScale=5)
        terrain = terrain_with(hole, vOffset=7, surface="rock")
        for resolution in (0.1, 0.3):
            grid = Grid(-1.0, -1.0, resolution, round(12 / resolution), round(12 / resolution))
            part = part_of(terrain, grid)
            assert (part.candidates, part.pairs, part.length) == (0, 0, 0)

    @staticmethod
    def found(terrain: Terrain, grid: Grid) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Heights of the walls in all pairs along x and along y, and the lengths they stand for."""
        window = Window(0, 0, grid.height, grid.width)
        planes = Painter(terrain, grid, np.float64, labels=True).paint(window)
        labels, arrays = planes.labels, terrain.arrays
        assert labels is not None
        pairs, _ = kernels.find_candidates(labels, planes.heights, grid.height, grid.width)
        jumps, lengths = np.empty(len(pairs)), np.empty(len(pairs))
        kernels.measure_walls(
            kernels.WallFinder(terrain.field, nonzero_edges(arrays)), pairs,
            grid.columns(window), grid.rows(window), grid.resolution,
            1e-7 * largest_heights(arrays).max(), jumps, lengths,
        )  # fmt: skip
        across = np.zeros((grid.height, grid.width - 1))
        along = np.zeros((grid.height - 1, grid.width))
        for pair, jump in zip(pairs.tolist(), jumps.tolist(), strict=True):
            (along if pair % 2 else across)[divmod(pair >> 1, grid.width)] = jump
        return across, along, lengths

    @settings(max_examples=EXAMPLES)
    @given(st.data())
    def test_are_no_more_than_jumps(self, data: st.DataObject) -> None:
        """Of any terrain; a pair stands for a pixel of wall at most."""
        definition = data.draw(
            definitions(free=data.draw(st.booleans()), gridded=True, classed=True)
        )
        terrain = terrain_of(definition)
        count = data.draw(st.sampled_from([7, 10, 37]))
        grid = grid_over(terrain, min(max(terrain.size) / count, min(terrain.size)))
        across, along, lengths = self.found(terrain, grid)
        largest = 2 * largest_heights(terrain.arrays).sum()
        assert across.max(initial=0) <= largest
        assert along.max(initial=0) <= largest
        assert ((lengths >= 0) & (lengths <= 1)).all()
        assert (lengths > 0).sum() == (across > 0).sum() + (along > 0).sum()

    @pytest.mark.nightly
    def test_are_those_that_halving_finds(self) -> None:
        """And lower ones on slopes, at which heights between the two pixels do jump."""
        terrain = terrain_of(crowded())
        grid = grid_over(terrain, 100 / 250)
        x, y = np.meshgrid(
            grid.columns(Window(0, 0, 1, grid.width)), grid.rows(Window(0, 0, grid.height, 1))
        )
        between = np.linspace(0, grid.resolution, 2000)
        for along_x, found in zip((True, False), self.found(terrain, grid)[:2], strict=True):
            slow = ~np.isnan(walls(terrain, x, y, along_x))
            assert slow.sum() > 5000
            assert (found[slow] > 0).all()
            more = np.argwhere((found > 0) & ~slow)[::5]
            assert len(more) > 100
            at_x, at_y = x[*more.T][:, None], y[*more.T][:, None]
            if along_x:
                heights = terrain.height(at_x + between, at_y)
            else:
                heights = terrain.height(at_x, at_y - between)
            bent = np.abs(np.diff(heights, n=2, axis=1)).max(axis=1)
            assert (bent > 0.8 * found[*more.T]).all()


class TestWindows:
    """Windows, their order and threads change nothing, but for which pairs are tested."""

    terrain = terrain_with(
        at(1, 1, 3, 3, type="box", turnDeg=20), at(5, 2, 3, 5, type="stairs", turnDeg=70),
        at(2, 6, 3, 3, type="column"), type="slope",
    )  # fmt: skip
    grid = grid_over(terrain, 0.05)

    def test_add_up_to_the_whole(self) -> None:
        """Of any size; lengths to what the rounding of each window is."""
        whole = part_of(self.terrain, self.grid)
        for size in ((200, 200), (64, 37), (1, 200), (200, 1), (7, 9)):
            parts = part_of(self.terrain, self.grid, size)
            windows = len(list(self.grid.windows(*size)))
            assert abs(parts.length - whole.length) <= windows
            assert replace(parts, length=whole.length) == whole

    def test_add_up_in_any_order(self) -> None:
        """To the same, bit for bit; so threads change nothing."""
        found = LossFinder(self.terrain, self.grid)
        painter = Painter(self.terrain, self.grid, labels=True)
        parts = [
            found.of(w, painter.paint(found.with_neighbours(w))) for w in self.grid.windows(50, 30)
        ]
        rng = np.random.default_rng(0)
        sums = {
            sum((parts[k] for k in rng.permutation(len(parts))), LossCounts()) for _ in range(20)
        }
        assert len(sums) == 1

        def part(window: Window) -> LossCounts:
            return found.of(window, painter.paint(found.with_neighbours(window)))

        with ThreadPoolExecutor(4) as pool:
            assert list(pool.map(part, self.grid.windows(50, 30))) == parts
        assert reduce(lambda a, b: b + a, parts) in sums

    def test_planes_that_do_not_fit_are_refused(self) -> None:
        """Of the window without its margins, or without labels."""
        found = LossFinder(self.terrain, self.grid)
        window = Window(0, 0, 10, 10)
        assert found.with_neighbours(window) == Window(0, 0, 11, 11)
        assert found.with_neighbours(Window(190, 190, 10, 10)) == Window(190, 190, 10, 10)
        for painter, which in (
            (Painter(self.terrain, self.grid, labels=True), window),
            (Painter(self.terrain, self.grid), found.with_neighbours(window)),
        ):
            with pytest.raises(ValueError, match="are wanted"):
                found.of(window, painter.paint(which))

    @pytest.mark.nightly
    @pytest.mark.parametrize("size", [(600, 600), (50, 600), (128, 128)])
    def test_with_too_many_walls_are_estimated(
        self, size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """A fraction of the pairs tells the length to a few percent, and the steepest ramp."""
        terrain = terrain_of(crowded())
        grid = grid_over(terrain, 100 / 600)
        monkeypatch.setattr(loss, "_TESTS", 10**9)
        exact = part_of(terrain, grid, size)
        assert exact.tested == exact.candidates
        monkeypatch.undo()
        monkeypatch.setattr(loss, "_TESTS", 1800)
        part = part_of(terrain, grid, size)
        assert part.candidates == exact.candidates > 3 * part.tested
        assert part.length == pytest.approx(exact.length, rel=0.05)
        assert part.pairs == pytest.approx(exact.pairs, rel=0.05)
        assert part.steepest == exact.steepest
        assert part.highest <= exact.highest
        assert LossFinder(terrain, grid).statement(part, 0).walls.estimated

    def test_spread_is_even_and_in_step_with_nothing(self) -> None:
        """Ascending, none twice, about as many of each residue."""
        for count, limit in ((1000, 1000), (999, 1000), (1001, 1000), (10**6, 999), (12345, 77)):
            chosen = loss._spread(count, limit)
            assert len(chosen) == min(count, limit)
            assert (np.diff(chosen) > 0).all()
            assert 0 <= chosen[0] <= chosen[-1] < count
        residues = np.bincount(loss._spread(100_000, 1000) % 100, minlength=100)
        assert residues.max() < 40


def narrow(terrain: Terrain, resolution: float, bounds: Any = None) -> SubpixelFeatures:
    return subpixel_features(terrain, grid_over(terrain, resolution, bounds))[0]


def narrow_details(terrain: Terrain, resolution: float) -> SubpixelFeatures:
    return subpixel_features(terrain, grid_over(terrain, resolution))[1]


class TestNarrow:
    """What is narrower than a pixel, by hand."""

    def test_elements(self) -> None:
        """By the shorter side of their cells, within the grid, named in the field's order."""
        children = [
            at(0, 0, type="box"),
            at(1, 0, 2, 1, type="box"),
            at(2, 2, 2, 2, type="column", cells=4, children=[
                {"type": "hill", "cellX": k, "cellY": 0} for k in range(3)]),
            at(9, 9, type="box", cells=100, children=[
                {"type": "box", "cellX": k, "cellY": k} for k in range(30)]),
        ]  # fmt: skip
        terrain = terrain_with(*children)
        found = narrow(terrain, 0.5)
        assert found.count == 30
        assert found.first == tuple(
            SubpixelFeature(f"/elemTree/children/3/children/{k}", pytest.approx(0.01))
            for k in range(20)
        )
        assert narrow(terrain, 0.01).count == 0  # just as wide as a pixel
        assert narrow(terrain, 0.5001).count == 33
        assert narrow(terrain, 1.0).count == 33
        assert narrow(terrain, 1.25).count == 36
        assert [one.element for one in narrow(terrain, 1.25, (0, 0, 5, 5)).first] == [
            "/elemTree/children/0", "/elemTree/children/1",
            *(f"/elemTree/children/2/children/{k}" for k in range(3)),
        ]  # fmt: skip

    def test_of_a_terrain_that_is_oblong_and_far(self) -> None:
        """Cells of 1 × 2 are 1 wide, as exactly as places in UTM allow."""
        definition = {
            "size": [10, 20], "origin": [500000.1, 4649776.7], "elemTypes": TYPES,
            "elemTree": {"type": "box", "children": [{"type": "box", "cellX": 3, "cellY": 4}]},
        }  # fmt: skip
        terrain = terrain_of(definition)
        for resolution, count in ((1.0, 0), (1.0000001, 1), (1.5, 1), (0.9, 0)):
            assert narrow(terrain, resolution).count == count

    @pytest.mark.parametrize(
        ("primitive", "width"),
        [
            ({"x": [0, 1, 0, 1, 0]}, 0.25),
            ({"x": [0, 1, 2, 3, 0]}, 0.25),
            ({"x": [0, 1, 2, 3, 4]}, None),  # straight: nothing to lose
            ({"x": [1, 1, 1]}, None),
            ({"x": [1, 2]}, None),
            ({"x": "cos"}, None),
            ({"x": [1], "y": [0, 1, 0]}, 2 * 0.5),
            ({"x": [0, 3, 0, 1, 0], "y": [0, 1, 0]}, 0.25),
            ({"x": [[0, 0], [0.3, 0], [0.35, 1], [1, 0]]}, 0.05),
            ({"x": [[0, 0], [0.3, 0], [0.3, 1], [0.5, 1], [0.5, 0], [1, 0]]}, 0.2),
            ({"x": [[0, 0], [1, 0], [1, 2]]}, None),  # a step at the very end
            ({"combine": "radial", "x": [0, 1, 0]}, None),
            ({"combine": "radial", "x": [0, 0, 1, 0, 0]}, 0.25),
            ({"combine": "radial", "x": [0, 1, 1, 0]}, 1 / 3),  # a level top of twice 1/6
            ({"combine": "radial", "x": [[0, 0], [0.9, 0], [0.9, 1], [1, 1]]}, 0.1),
        ],
    )
    def test_details(self, primitive: dict[str, Any], width: float | None) -> None:
        """The shortest straight stretch of an element that is 1 × 2 itself."""
        child = {"type": "p", "cellX": 1, "cellY": 1, "vScale": 1}
        terrain = terrain_of(
            {"size": [10, 20], "elemTypes": {**TYPES, "p": primitive},
             "elemTree": {"type": "nothing", "children": [child, {**child, "vScale": 0}]}}
        )  # fmt: skip
        details = narrow_details(terrain, 0.999)
        if width is None or width >= 0.999:
            assert details == SubpixelFeatures(0, ())
        else:
            assert details.count == 1
            (one,) = details.first
            assert one.element == "/elemTree/children/0"
            assert one.width == pytest.approx(width)
            for resolution, count in ((width * 1.001, 1), (width * 0.999, 0)):
                assert narrow_details(terrain, resolution).count == count
        # an element that is narrow itself is not counted twice
        assert narrow_details(terrain, 1.01).count == 0


class TestInterpolationError:
    """What bilinear interpolation makes of the pixels."""

    @pytest.mark.parametrize("resolution", [0.1, 0.5, 1.0])
    def test_of_a_tent(self, resolution: float) -> None:
        """The ridge between two pixels is cut by half of what a pixel climbs."""
        terrain = terrain_with(type="tent", vScale=1)
        error = statement_of(terrain, resolution, np.float64).interpolation
        assert error
        cut = 0.2 * resolution / 2
        assert error.largest == pytest.approx(cut, rel=1e-9)
        assert (error.x, error.y) == (5, 5)
        assert error.element == "/elemTree"
        share = resolution / (10 - resolution)
        assert error.rms == pytest.approx(cut * math.sqrt(share / 3), rel=0.05)
        assert error.points == min(100_000, 4 * round(10 / resolution) ** 2) // 2 + 1

    def test_of_what_is_bilinear_is_rounding(self) -> None:
        """In float32 what that rounds off, in float64 nothing."""
        terrain = terrain_with(type="slope", vScale=1)
        single, double = (
            statement_of(terrain, 0.3, t).interpolation for t in (np.float32, np.float64)
        )
        assert single and double
        assert 1e-9 < single.largest < 1e-7
        assert double.largest < 1e-14
        assert 0 < single.rms < single.largest

    def test_of_an_element_that_no_pixel_sees(self) -> None:
        """Its middle is looked at, and it is named."""
        needle = at(3, 3, type="box", cells=1001, children=[
            {"type": "box", "cellX": 500, "cellY": 500, "vScale": 9}])  # fmt: skip
        error = statement_of(terrain_with(needle), 0.1).interpolation
        assert error
        assert error.largest == pytest.approx(9)
        assert error.element == "/elemTree/children/0/children/0"

    def test_where_a_corner_has_no_height_is_skipped(self) -> None:
        """And where there is nothing but such corners there is no answer."""
        hole = at(0, 0, 10, 5, type="nothing", surface="hole")
        terrain = terrain_with(hole, type="tent", surface="rock", vScale=1)
        error = statement_of(terrain, 0.1).interpolation
        assert error
        assert error.y > 5
        assert statement_of(terrain_with({**hole, "span": [10, 10]}), 0.1).interpolation is None

    @pytest.mark.parametrize("size", [[10, 1], [1, 10], 1])
    def test_of_a_row_of_pixels(self, size: Any) -> None:
        """Or a column, or one: interpolated along it."""
        error = statement_of(terrain_with(type="hill", vScale=1, size=size), 1.0).interpolation
        assert error
        assert math.isfinite(error.largest)


class TestStatement:
    """As text and as JSON."""

    nothing = RasterLoss(
        WallLoss(0.0, 0, False, None, None), SubpixelFeatures(0, ()), SubpixelFeatures(0, ()), 0,
        None,
    )  # fmt: skip
    walls = WallLoss(
        12.345, 70, False, SteepestRamp(84.56, 2.1, 1.0, 2.0), LargestJump(2.12, 3.0, 4.0)
    )
    everything = RasterLoss(
        walls, SubpixelFeatures(1, (SubpixelFeature("/elemTree", 0.1),)),
        SubpixelFeatures(1234, ()), 5, InterpolationError(10, 0.5, 0.1, 1.0, 2.0, None),
    )  # fmt: skip

    def test_in_a_sentence(self) -> None:
        """Only what there is; estimates say so."""
        nothing = "Lost: nothing; no walls, nothing narrower than a pixel."
        assert self.nothing.sentence(0.1) == nothing
        assert self.everything.sentence(0.2) == (
            "Lost: 12.3 m of wall became ramps of up to 84.6° (2.12 m in one pixel); 1 element is "
            "narrower than a pixel; 1,234 elements have details narrower than a pixel; pixels "
            "differ from the model by up to 0.5 m."
        )
        about = replace(self.walls, estimated=True, length=1234567.8)
        said = replace(self.everything, walls=about).sentence(0.2)
        assert said.startswith("Lost: about 1,234,568 m of wall became")
        slight = replace(self.everything, walls=replace(self.walls, steepest_ramp=None))
        assert slight.sentence(0.2).startswith("Lost: 12.3 m of wall became ramps (2.12 m in one ")
        only = replace(self.nothing, interpolation=self.everything.interpolation)
        assert only.sentence(0.1) == "Lost: pixels differ from the model by up to 0.5 m."

    def test_as_json(self) -> None:
        """Its fields are the keys; no NumPy number is left in it."""
        assert msgspec.json.decode(msgspec.json.encode(self.everything)) == {
            "walls": {
                "length": 12.345, "pairs": 70, "estimated": False,
                "steepest_ramp": {"degrees": 84.56, "rise": 2.1, "x": 1.0, "y": 2.0},
                "largest_jump": {"height": 2.12, "x": 3.0, "y": 4.0},
            },
            "narrow_elements": {"count": 1, "first": [{"element": "/elemTree", "width": 0.1}]},
            "narrow_details": {"count": 1234, "first": []},
            "nodata": 5,
            "interpolation": {
                "points": 10, "largest": 0.5, "rms": 0.1, "x": 1.0, "y": 2.0, "element": None
            },
            "left_out": 0,
        }  # fmt: skip
        for stated in (
            statement_of(terrain_with(at(2, 2, type="box")), 0.1),
            statement_of(terrain_with(), 3.0),
        ):
            msgspec.json.encode(stated)


@pytest.mark.nightly
def test_of_many_elements_some_are_named() -> None:
    """All are counted."""
    children = [{"type": "hill", "cellX": k % 600, "cellY": k // 600} for k in range(300_000)]
    terrain = terrain_of(
        {"size": 600, "elemTypes": TYPES,
         "elemTree": {"type": "nothing", "cells": 600, "children": children}}
    )  # fmt: skip
    found = narrow(terrain, 2.0)
    assert found.count == 300_000
    assert len(found.first) == 20
