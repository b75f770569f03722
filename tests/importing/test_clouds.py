"""Clouds of points as terrains: heights of cells by a slow dictionary, ground, classes, errors."""

from __future__ import annotations

import json
import math
import struct
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import terratool
from terratool.errors import ReadError, RequestError
from terratool.importing import clouds as module
from terratool.importing.cells import CellRange, PointCells, Votes, cells_over
from terratool.importing.clouds import is_cloud, sample_cloud
from terratool.importing.ground import opened
from terratool.importing.sources import open_source
from terratool.importing.types import SampledHeights, SourceOptions
from terratool.io import npz, pcd, ply
from terratool.io.xyz import find_grid
from terratool.report.numbers import round_up
from tests.budget import examples
from tests.commands import call

Floats = NDArray[np.float64]
Rows = NDArray[Any]
DOUBLES = np.dtype([(name, "<f8") for name in "xyz"])
ALL = (-math.inf, math.inf)


def scattered(count: int = 900, west: float = 5000.0, south: float = -300.0) -> Floats:
    """Points over 12 × 5, denser to the east, whose heights no mirror leaves as they are."""
    draw = np.random.default_rng(7)
    x = 12 * np.sqrt(draw.uniform(0, 1, count))
    y = draw.uniform(0, 5, count)
    points = np.stack([west + x, south + y, x + 20 * y + draw.uniform(0, 1, count)], axis=1)
    points[0, :2], points[1, :2] = (west, south), (west + 12, south + 5)
    return np.round(points * 1024) / 1024  # binary fractions, so that sums are exact


def dictionary(
    points: Floats, side: float, pick: Callable[[list[float]], float]
) -> dict[tuple[int, int], float]:
    """Heights by column and row of multiples of the side, point by point."""
    ends = [max(points[:, axis]) for axis in (0, 1)]
    found = defaultdict(list)
    for point in points.tolist():
        cell = [math.floor(value / side) for value in point[:2]]
        for axis in (0, 1):
            if point[axis] == ends[axis] == cell[axis] * side and ends[axis] > min(points[:, axis]):
                cell[axis] -= 1  # the last edge is closed
        found[cell[0], cell[1]].append(point[2])
    return {cell: pick(heights) for cell, heights in found.items()}


def as_dictionary(heights: SampledHeights, side: float) -> dict[tuple[int, int], float]:
    first, base = round(heights.grid.west / side), round(heights.grid.south / side)
    return {
        (int(column) + first, int(row) + base): float(heights.values[row, column])
        for row, column in zip(*np.nonzero(~np.isnan(heights.values)), strict=True)
    }


def write_text(path: Path, points: Floats, form: str = "%.17g") -> Path:
    np.savetxt(path, points, fmt=form)
    return path


def records(points: Floats, kind: np.dtype[Any] = DOUBLES) -> Rows:
    rows = np.zeros(len(points), kind)
    for axis, name in enumerate("xyz"):
        rows[name] = points[:, axis]
    return rows


def write_las(
    path: Path, points: Floats, classes: Any = 1, version: str = "1.2", form: int = 0,
    records: Any = (), withheld: Any = 0,
) -> Path:  # fmt: skip
    laspy = pytest.importorskip("laspy")
    if path.suffix == ".laz":
        pytest.importorskip("lazrs")
    header = laspy.LasHeader(version=version, point_format=form)
    header.scales = np.full(3, 1 / 1024)
    header.offsets = np.floor(points.min(axis=0))
    header.vlrs.extend(records)
    with laspy.open(path, "w", header=header) as file:
        made = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
        made.x, made.y, made.z = points.T
        made.classification[:] = classes
        made.withheld[:] = withheld
        file.write_points(made)
    return path


def write(path: Path, points: Floats) -> Path:
    """Write points as the suffix says."""
    if path.suffix in (".xyz", ".txt"):
        return write_text(path, points)
    if path.suffix == ".csv":
        path.write_text("".join(f"{x!r};{y!r};{z!r}\n" for x, y, z in points.tolist()))
    elif path.suffix == ".ply":
        ply.write_points(path, [records(points)], DOUBLES, [])
    elif path.suffix == ".pcd":
        pcd.write_points(path, [records(points)], DOUBLES)
    elif path.suffix == ".npz":
        np.savez(path, **dict(zip("xyz", points.T, strict=True)))
    else:
        return write_las(path, points)
    return path


# --- cells ---------------------------------------------------------------------------------------

PICKS: dict[str, Callable[[list[float]], float]] = {
    "highest": max, "lowest": min, "mean": lambda heights: sum(heights) / len(heights)
}  # fmt: skip


@pytest.mark.parametrize("suffix", [".xyz", ".txt", ".csv", ".ply", ".pcd", ".npz", ".las", ".laz"])
@pytest.mark.parametrize("kind", PICKS)
def test_heights_are_those_of_a_dictionary(suffix: str, kind: Any, tmp_path: Path) -> None:
    """Each format, each kind of height: cells of a half count from multiples of a half."""
    points = scattered()
    path = write(tmp_path / f"cloud{suffix}", points)
    with open_source(str(path), SourceOptions(resolution=0.5, heights=kind)) as found:
        assert isinstance(found, SampledHeights)
        wanted = dictionary(points, 0.5, PICKS[kind])
        assert as_dictionary(found, 0.5) == pytest.approx(wanted, abs=1e-12)
        assert (found.grid.columns, found.grid.rows) == (24, 10)
        mirrored = points * (-1, 1, 1) + (2 * 5000 + 12, 0, 0)
        assert as_dictionary(found, 0.5) != pytest.approx(dictionary(mirrored, 0.5, PICKS[kind]))


def test_the_mean_is_taken_where_nothing_is_said(tmp_path: Path) -> None:
    path = write(tmp_path / "a.xyz", scattered())
    found = sample_cloud(str(path), SourceOptions(resolution=1.0))
    assert as_dictionary(found, 1.0) == pytest.approx(dictionary(scattered(), 1.0, PICKS["mean"]))
    assert "their mean height counts" in found.notes[0]


def test_many_batches_are_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither batches nor points that are read again make another mean."""
    path = write(tmp_path / "a.xyz", scattered(4000))
    options = SourceOptions(resolution=0.25)
    whole = sample_cloud(str(path), options)
    monkeypatch.setattr("terratool.io.text_points._CHUNK", 512)
    monkeypatch.setattr(module, "MOST_KEPT", 1000)
    parts = sample_cloud(str(path), options)
    assert np.array_equal(whole.values, parts.values, equal_nan=True)
    assert whole.notes == parts.notes


def test_edges_belong_to_the_east_and_north_and_the_last_to_the_last_cell(tmp_path: Path) -> None:
    """Of cells of 2 from 2 on: points on edges, and on those that no cell lies behind."""
    points = np.array([
        (2, 2, 1), (4, 2, 10), (3.999, 2, 100), (6, 2, 1000), (6, 5, 5000), (2, 4, 7), (2, 5, 9),
    ], float)  # fmt: skip
    path = write(tmp_path / "a.npz", points)
    found = sample_cloud(str(path), SourceOptions(resolution=2.0, heights="highest"))
    assert found.grid.bounds == (2, 2, 6, 6)
    assert found.values.tolist() == [[100, 1000], [9, 5000]]
    found = sample_cloud(str(path), SourceOptions(resolution=2.0, heights="lowest"))
    assert found.values.tolist() == [[1, 10], [7, 5000]]


@given(
    st.floats(-1e6, 1e6), st.floats(0, 1e3),
    st.sampled_from([0.1, 0.3, 1.0, 2.5, 1e-3, 7.0]),
)  # fmt: skip
@settings(max_examples=examples(300), deadline=None)
def test_cells_cover_all_places(low: float, length: float, side: float) -> None:
    """No place lies outside, no cell at an end is empty, and edges are decimals."""
    high = low + length
    cells = CellRange.over(low, high, side, ALL)
    at = cells.of(np.array([low, high]))
    assert at[0] == 0 and at[1] == cells.total - 1
    assert cells.start == float(f"{cells.start:.12g}")
    assert abs(cells.start / side - round(cells.start / side)) < 1e-6


def test_a_part_has_the_cells_of_the_whole(tmp_path: Path) -> None:
    """Cells with centres in the bounds, with the same heights; bounds do not move edges."""
    path = write(tmp_path / "a.pcd", scattered())
    whole = sample_cloud(str(path), SourceOptions(resolution=0.5))
    bounds = (5003.2, -298.4, 5007.3, -296.1)
    part = sample_cloud(str(path), SourceOptions(resolution=0.5, bounds=bounds))
    assert part.grid.bounds == (5003.0, -298.5, 5007.5, -296.0)
    np.testing.assert_allclose(part.values, whole.values[3:8, 6:15], rtol=1e-13)
    for bounds in ((0, 0, 1, 1), (5003.3, -298.4, 5003.4, -298.3)):
        with pytest.raises(RequestError, match="No cell has its centre"):
            sample_cloud(str(path), SourceOptions(resolution=0.5, bounds=bounds))


def test_no_resolution_takes_four_points_a_cell(tmp_path: Path) -> None:
    """15 points in each unit: cells of 1, of 0.1 for a tenth of the sides, gaps or not."""
    points = scattered(900, 0.0, 0.0)
    for factor, side in ((1.0, 1.0), (0.1, 0.1), (7.0, 5.0)):
        path = write(tmp_path / "a.npz", points * (factor, factor, 1.0))
        found = sample_cloud(str(path), SourceOptions())
        assert found.grid.dx == side
        assert found.notes[0] == (
            f"No --resolution was given: cells of {side:g} have 4 points or more."
        )
    apart = np.concatenate(
        [points, points + np.array([500.0, 400.0, 0.0])]
    )  # the area between has no points
    found = sample_cloud(str(write(tmp_path / "a.npz", apart)), SourceOptions())
    assert found.grid.dx <= 5.0


def test_round_up() -> None:
    assert [round_up(side) for side in (1, 1.01, 2.3, 6, 0.02, 0.021, 99.9)] == [
        1, 2, 5, 10, 0.02, 0.05, 100,
    ]  # fmt: skip


def test_up_and_scale(tmp_path: Path) -> None:
    """With y up, z of the file points south; millimetres become metres."""
    points = scattered()
    turned = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1) * 1000
    found = sample_cloud(
        str(write(tmp_path / "a.npz", turned)), SourceOptions(resolution=0.5, up="y", scale=0.001)
    )
    assert as_dictionary(found, 0.5) == pytest.approx(dictionary(points, 0.5, PICKS["mean"]))


def test_a_viewpoint_places_the_points(tmp_path: Path) -> None:
    """PCL's viewpoint: turned by a quarter to the left about z, and moved."""
    points = scattered(300, 0.25, 0.25)
    half = math.sqrt(0.5)
    path = tmp_path / "a.pcd"
    local = np.stack([points[:, 1] - 2, -(points[:, 0] - 1), points[:, 2] - 3], axis=1)
    pcd.write_points(path, [records(local)], DOUBLES, (), (1, 2, 3, half, 0, 0, half))
    found = sample_cloud(str(path), SourceOptions(resolution=1.0, heights="lowest"))
    wanted = dictionary(points, 1.0, min)
    assert as_dictionary(found, 1.0) == pytest.approx(wanted, abs=1e-9)


# --- which files are clouds ----------------------------------------------------------------------


def grid_points(columns: int = 9, rows: int = 5, step: float = 2.5) -> Floats:
    y, x = np.mgrid[:rows, :columns]
    return np.stack([x.ravel() * step, 50 - y.ravel() * step, x.ravel() * 1.0], axis=1)


def is_grid(points: Floats) -> bool:
    return find_grid([points]) is not None


def test_grids_are_no_clouds() -> None:
    """Whole or with gaps, by rows or by columns, in any order, rounded; one row, two columns."""
    draw = np.random.default_rng(2)
    points = grid_points()
    assert is_grid(points)
    assert is_grid(points[draw.random(len(points)) < 0.7])
    assert is_grid(points[np.lexsort((points[:, 1], points[:, 0]))])
    assert is_grid(points[draw.permutation(len(points))])
    assert is_grid(np.round(grid_points(step=1 / 3), 3))
    assert is_grid(grid_points(40, 1)) and is_grid(grid_points(2, 30))
    large = grid_points(300, 200)
    assert is_grid(large[draw.random(len(large)) < 0.3])
    assert not is_grid(large[draw.random(len(large)) < 0.2])  # less than a quarter


@pytest.mark.parametrize("digits", [1, 2, 3, 6])
def test_clouds_are_no_grids(digits: int) -> None:
    """Also where rounding puts all points on lines that are evenly spaced."""
    draw = np.random.default_rng(3)
    assert not is_grid(np.round(draw.uniform(0, 30, (5000, 3)), digits))
    assert not is_grid(np.round(draw.uniform(0, 30, (40, 3)), digits))
    lines = np.column_stack([np.repeat(np.arange(9.0), 200), draw.uniform(0, 30, (1800, 2))])
    assert not is_grid(np.round(lines, digits)) or digits == 1


def test_texts_are_told_by_their_points(tmp_path: Path) -> None:
    path = write_text(tmp_path / "grid.xyz", grid_points())
    assert not is_cloud(str(path)) and is_cloud(str(path), asked=True)
    path = write_text(tmp_path / "cloud.txt", scattered(), "%.2f")
    assert is_cloud(str(path))
    path.write_text("ncols 3\nnrows 2\n")
    assert not is_cloud(str(path), asked=True)
    assert not is_cloud(str(tmp_path / "none.xyz"), asked=True)


@pytest.mark.parametrize(
    "text",
    ["x,y,z\n{}", "//X Y Z\n{}", "# x y z\r\n{}", "\n\n{}", "\ufeffx;y;z\n{}", '"x","y","z"\n{}'],
    ids=range(6),
)
def test_headers_and_separators(text: str, tmp_path: Path) -> None:
    points = scattered(200)
    between = {"x,y": ",", "//X": " ", "# x": "\t", "\n\n{": " , ", "\ufeffx;": ";", '"x"': ","}
    (gap,) = (value for key, value in between.items() if text.startswith(key))
    lines = "\n".join(gap.join(f"{value!r}" for value in point) for point in points.tolist())
    path = tmp_path / "a.csv"
    path.write_text(text.format(lines), "utf-8", newline="")
    found = sample_cloud(str(path), SourceOptions(resolution=1.0, heights="highest"))
    assert as_dictionary(found, 1.0) == pytest.approx(dictionary(points, 1.0, max))


def test_named_columns_in_another_order_and_decimal_commas(tmp_path: Path) -> None:
    points = scattered(200)
    path = tmp_path / "a.csv"
    lines = (f"a;{z!r};{x!r};;{y!r}".replace(".", ",") for x, y, z in points.tolist())
    path.write_text("id;Z;X;note;Y\n" + "\n".join(lines))
    found = sample_cloud(str(path), SourceOptions(resolution=1.0, heights="highest"))
    assert as_dictionary(found, 1.0) == pytest.approx(dictionary(points, 1.0, max))


def test_a_ply_with_faces_is_a_mesh(tmp_path: Path) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    head += (
        "property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path = tmp_path / "a.ply"
    path.write_text(head.format(1) + "0 0 1\n4 0 1\n0 3 1\n3 0 1 2\n")
    assert not is_cloud(str(path))
    path.write_text(head.format(0) + "0 0 1\n4 0 1\n0 3 1\n")
    assert is_cloud(str(path))
    found = sample_cloud(str(path), SourceOptions(resolution=2.0))
    assert np.nan_to_num(found.values, nan=-1).tolist() == [[1, 1], [1, -1]]


# --- ground --------------------------------------------------------------------------------------


def town(east: float = 0.0, north: float = 0.0, count: int = 30_000) -> tuple[Floats, Floats]:
    """Points on a plane of some slope with boxes of 2 to 6 m, one at the border; and the plane."""
    draw = np.random.default_rng(5)
    x, y = 80 * draw.uniform(0, 1, count), 50 * draw.uniform(0, 1, count)
    plane = 300 + east * x + north * y
    z = plane + draw.normal(0, 0.02, count)
    for west, south, wide, deep, high in ((10, 8, 8, 14, 6), (40, 30, 12, 6, 3), (74, 0, 6, 9, 2)):
        z += high * ((x >= west) & (x < west + wide) & (y >= south) & (y < south + deep))
    return np.stack([x, y, z], axis=1), plane


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.1, -0.05), (0.4, 0.3)], ids=str)
def test_ground_is_told_from_boxes(slope: tuple[float, float], tmp_path: Path) -> None:
    """Within 0.1 m of the plane wherever there is ground, and no box is left."""
    points, plane = town(*slope)
    path = write(tmp_path / "town.npz", points)
    found = sample_cloud(str(path), SourceOptions(resolution=1.0, ground=True))
    x = found.grid.west + np.arange(found.grid.columns) + 0.5
    y = found.grid.south + np.arange(found.grid.rows) + 0.5
    wanted = 300 + slope[0] * x + slope[1] * y[:, None]
    box = np.zeros(wanted.shape, bool)
    for west, south, wide, deep in ((10, 8, 8, 14), (40, 30, 12, 6), (74, 0, 6, 9)):
        box[south : south + deep, west : west + wide] = True
    # the mean of some points on a slope lies beside the middle of its cell
    alone = sample_cloud(
        str(write(tmp_path / "plane.npz", np.stack([*points.T[:2], plane], axis=1))),
        SourceOptions(resolution=1.0),
    ).values
    assert np.nanmax(np.abs(alone - wanted)) < 0.5
    assert np.nanmax(np.abs(found.values - alone)) < 0.1
    assert np.isnan(found.values[box]).all()
    assert np.isnan(found.values[~box]).sum() <= 6
    ground = int((points[:, 2] < plane + 1).sum())
    assert found.notes[0].startswith(f"{ground:,} of 30,000 points are ground, by a morpholog")


def test_without_ground_boxes_stay(tmp_path: Path) -> None:
    points, _ = town()
    found = sample_cloud(str(write(tmp_path / "town.npz", points)), SourceOptions(resolution=1.0))
    assert np.nanmax(found.values) == pytest.approx(306, abs=0.1)


def test_a_point_below_the_ground_does_not_draw_it_down(tmp_path: Path) -> None:
    points, plane = town()
    points[::3000, 2] = plane[::3000] - 12
    path = write(tmp_path / "town.npz", points)
    found = sample_cloud(str(path), SourceOptions(resolution=1.0, ground=True))
    assert np.nanmin(found.values) > 299.9


def test_openings_are_those_of_scipy() -> None:
    from scipy import ndimage

    heights = np.random.default_rng(1).normal(size=(17, 29))
    for radius in (1, 2, 3, 5, 16, 40):
        wide = 2 * radius + 1
        least = ndimage.minimum_filter(heights, wide, mode="constant", cval=np.inf)
        wanted = ndimage.maximum_filter(least, wide, mode="constant", cval=-np.inf)
        assert np.array_equal(opened(heights, radius), wanted)


def test_classes_of_ground_come_before_the_filter(tmp_path: Path) -> None:
    """Class 2 counts, though its points are the upper ones, which no filter would take."""
    points = scattered(600)
    classes = np.where(np.arange(600) % 3, 5, 2)
    points[classes == 2, 2] += 100
    path = write_las(tmp_path / "a.las", points, classes)
    found = sample_cloud(str(path), SourceOptions(resolution=1.0, ground=True))
    assert as_dictionary(found, 1.0) == pytest.approx(
        dictionary(points[classes == 2], 1.0, PICKS["mean"])
    )
    assert found.notes[0] == "200 of 600 points are ground, by their class 2."


# --- LAS -----------------------------------------------------------------------------------------


def test_noise_and_withheld_points_are_left_out(tmp_path: Path) -> None:
    points = scattered(600)
    classes, withheld = np.full(600, 2), np.zeros(600, int)
    classes[:5], classes[5:9], withheld[9:12] = 7, 18, 1
    points[:12, 2] = 900
    path = write_las(tmp_path / "a.las", points, classes, "1.4", 6, withheld=withheld)
    found = sample_cloud(str(path), SourceOptions(resolution=1.0, heights="highest"))
    assert np.nanmax(found.values) < 200
    assert "12 points that the file marks as noise, or withholds, were left out." in found.notes


def test_the_commonest_class_is_the_surface(tmp_path: Path) -> None:
    """Of equals the lower number; cells without points have none; names are those of ASPRS."""
    places = {(0, 0): (6, 6, 2), (1, 0): (9, 3), (2, 0): (3, 9), (2, 1): (40, 40, 40, 2)}
    rows = [(x + 0.5, y + 0.5, 1.0 + x, c) for (x, y), all_ in places.items() for c in all_]
    data = np.array([*rows, (0.1, 1.9, 1.0, 1)])
    path = write_las(tmp_path / "a.las", data[:, :3], data[:, 3].astype(int), "1.4", 6)
    (tmp_path / "m").mkdir()
    for form in ("rows", "grid"):
        out = tmp_path / "m" / f"{form}.json"
        ran = call(
            "import-terrain", path, out, "--max-error", 0.01, "--resolution", 1, "--surfaces",
            "classes", "--as", form, "--json",
        )  # fmt: skip
        assert ran.code == 0, ran.err
        assert json.loads(ran.out)["surfaces"] == {
            "unclassified": 1, "low vegetation": 2, "building": 1, "class-40": 1,
            **({"void": 1} if form == "rows" else {}),
        }  # fmt: skip
        terrain = terratool.load(out)
        at = terrain.sample([0.5, 1.5, 2.5, 2.5, 0.5], [0.5, 0.5, 0.5, 1.5, 1.5]).surface
        names = [terrain.surfaces[index] for index in at]
        assert names == [
            "building", "low vegetation", "low vegetation", "class-40", "unclassified",
        ]  # fmt: skip


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 1), st.integers(0, 4)), min_size=1))
@settings(max_examples=examples(200), deadline=None)
def test_votes_are_those_of_a_dictionary(points: list[tuple[int, int, int]]) -> None:
    wanted = defaultdict(list)
    for x, y, number in points:
        wanted[y, x].append(number * 50)
    rows = np.array(points)
    x, y = CellRange.over(0.0, 3.0, 1.0, ALL), CellRange.over(0.0, 2.0, 1.0, ALL)
    votes = Votes(x, y, np.unique(rows[:, 2] * 50))
    for part in np.array_split(rows, 3):
        votes.add(part[:, 0] + 0.5, part[:, 1] + 0.5, (part[:, 2] * 50).astype(np.uint8))
    for row in range(2):
        for column in range(3):
            there = wanted.get((row, column), [])
            best = min(there, key=lambda one: (-there.count(one), one), default=-1)
            assert votes.commonest[row, column] == best


def test_classes_are_asked_of_what_has_none(tmp_path: Path) -> None:
    for path in (
        write(tmp_path / "a.xyz", scattered()), write_las(tmp_path / "a.las", scattered(), 1),
    ):  # fmt: skip
        ran = call(
            "import-terrain", path, tmp_path / "o.json", "--max-error", 1, "--surfaces", "classes"
        )
        assert ran.code == 2
        assert "Name a LAS whose points are classified" in ran.err
        assert not (tmp_path / "o.json").exists()


def keys(**codes: int) -> Any:
    """Record of GeoTIFF keys."""
    laspy = pytest.importorskip("laspy")
    words = [1, 1, 0, len(codes)]
    for key, code in codes.items():
        words += [int(key[1:]), 0, 1, code]
    data = struct.pack(f"<{len(words)}H", *words)
    return laspy.VLR("LASF_Projection", 34735, "", data)


def wkt(text: str) -> Any:
    laspy = pytest.importorskip("laspy")
    return laspy.VLR("LASF_Projection", 2112, "", text.encode() + b"\0")


def test_the_reference_system_is_kept(tmp_path: Path) -> None:
    """By GeoTIFF keys of LAS 1.2, by WKT of LAS 1.4, before and behind the points."""
    from rasterio.crs import CRS

    text = CRS.from_epsg(32633).to_wkt()
    path = tmp_path / "a.las"
    for version, form, said in (
        ("1.2", 0, [keys(k1024=1, k3072=32633)]), ("1.4", 6, [wkt(text)]),
        ("1.4", 6, [keys(k2048=4326), wkt(text)]),
    ):  # fmt: skip
        write_las(path, scattered(), 2, version, form, said)
        assert sample_cloud(str(path), SourceOptions(resolution=1)).grid.crs == "EPSG:32633"
    write_las(path, scattered(), 2, "1.4", 6)
    data = bytearray(path.read_bytes())
    struct.pack_into("<QI", data, 235, len(data), 1)
    head = struct.pack("<2x16sHQ32x", b"LASF_Projection", 2112, len(text) + 1)
    path.write_bytes(bytes(data) + head + text.encode() + b"\0")
    assert sample_cloud(str(path), SourceOptions(resolution=1)).grid.crs == "EPSG:32633"


def test_odd_reference_systems(tmp_path: Path) -> None:
    path = write_las(tmp_path / "a.las", scattered(), 2, records=[keys(k3072=2263)])
    found = sample_cloud(str(path), SourceOptions(resolution=1))
    assert found.grid.crs == "EPSG:2263" and found.grid.unit == "us-ft"
    assert "they are kept as they are" in found.notes[0]
    path = write_las(tmp_path / "a.las", scattered(900, 11, 47), 2, records=[keys(k2048=4326)])
    found = sample_cloud(str(path), SourceOptions(resolution=1))
    assert "reproject to EPSG:32633 by pdal translate" in found.notes[0]
    path = write_las(tmp_path / "a.las", scattered(900, 11, 47), 1, records=[keys(k2048=4326)])
    with pytest.raises(RequestError, match="the filter of ground is about metres"):
        sample_cloud(str(path), SourceOptions(resolution=1, ground=True))
    path = write_las(tmp_path / "a.las", scattered(), 2, records=[wkt("PROJCS[nonsense")])
    found = sample_cloud(str(path), SourceOptions(resolution=1))
    assert found.grid.crs is None and "not known" in found.notes[0]
    path = write_las(tmp_path / "a.las", scattered(), 2, records=[keys(k3072=32633)])
    with pytest.raises(RequestError, match="neither scaled nor turned"):
        sample_cloud(str(path), SourceOptions(resolution=1, scale=2.0))


# --- what is refused -----------------------------------------------------------------------------

NAN = math.nan
REFUSED: dict[str, tuple[list[tuple[float, float, float]], str]] = {
    "none": ([], "has no points"),
    "one": ([(1, 2, 3)], "has one point only"),
    "no numbers": ([(1, NAN, 3), (1, 2, math.inf), (1e30, 2, 3)], "none of its 3 points"),
    "along x": ([(x, 2, x) for x in range(9)], "lie on one line"),
    "along y": ([(2, x, x) for x in range(9)], "lie on one line"),
    "aslant": ([(4.5e6 + x, 5e5 + 2 * x, x) for x in range(9)], "lie on one line"),
    "at one place": ([(2, 3, x) for x in range(9)], "lie on one line"),
}


@pytest.mark.parametrize("case", REFUSED)
@pytest.mark.parametrize("suffix", [".ply", ".npz", ".pcd"])
def test_points_that_cover_no_area(case: str, suffix: str, tmp_path: Path) -> None:
    points, message = REFUSED[case]
    path = write(tmp_path / f"a{suffix}", np.array(points, float).reshape(-1, 3))
    with pytest.raises(ReadError, match=message):
        sample_cloud(str(path), SourceOptions(resolution=1.0))


def test_points_that_are_no_numbers_are_counted(tmp_path: Path) -> None:
    points = scattered()
    odd = np.array([(NAN, 1, 1), (5000, math.inf, 1), (5000, -300, -math.inf), (5000, -300, 1e9)])
    path = write(tmp_path / "a.ply", np.concatenate([odd, points]))
    found = sample_cloud(str(path), SourceOptions(resolution=1.0))
    assert as_dictionary(found, 1.0) == pytest.approx(dictionary(points, 1.0, PICKS["mean"]))
    assert found.notes[-1].startswith("4 points with coordinates that are no numbers below 1e+09")


def test_too_many_cells_are_refused_with_a_proposal(tmp_path: Path) -> None:
    """And the proposal works."""
    far = np.concatenate([scattered(), [(2e6, 1e6, 5.0)]])
    path = write(tmp_path / "a.npz", far)
    for side in (None, 1.0, 1e-3):
        with pytest.raises(RequestError, match="too many for so many points") as error:
            sample_cloud(str(path), SourceOptions(resolution=side))
        side = float(str(error.value.hint).split("--resolution ")[1].split()[0])
        assert sample_cloud(str(path), SourceOptions(resolution=side)).grid.columns > 100
    part = sample_cloud(str(path), SourceOptions(resolution=1, bounds=(5000, -300, 5012, -295)))
    assert part.grid.bounds == (5000, -300, 5012, -295)
    with pytest.raises(RequestError, match="The resolution is nan"):
        sample_cloud(str(path), SourceOptions(resolution=NAN))


def test_cells_that_doubles_cannot_tell_apart() -> None:
    with pytest.raises(RequestError, match="too small for places as far off"):
        cells_over((1e8, 1e8, 1e8 + 1e-4, 1e8 + 1e-4), 1e-5, None, 1 << 28, lambda: 1.0)


def test_single_precision_far_from_0_is_told(tmp_path: Path) -> None:
    """At 4,500,000 floats step by a half; the default cells are larger than that."""
    points = scattered(5000, 500_000.0, 4_500_000.0)
    kind = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    path = tmp_path / "a.ply"
    ply.write_points(path, [records(points, kind)], kind, [])
    found = sample_cloud(str(path), SourceOptions(resolution=1.0))
    assert found.notes[-1].startswith("x and y are in single precision, in steps of 0.5 so far")
    found = sample_cloud(str(path), SourceOptions())
    assert found.grid.dx == 5.0 and "single" not in "".join(found.notes)
    ply.write_points(path, [records(scattered(500, 0, 0), kind)], kind, [])
    assert "single" not in "".join(sample_cloud(str(path), SourceOptions()).notes)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.xyz", "1.5 2.25 3\n4 5\n7 8.125 9\n", 'has no x, y and z in the line "4 5"'),
        ("a.xyz", "1.5 2.25 3\n4 5 high\n", '"high" is no number'),
        ("a.txt", "1.5 2.25 3\n" + "4" * 3_000_000 + " 5 6\n", "a line of more than 1 MiB"),
    ],
)
def test_texts_that_are_broken(name: str, text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(text)
    ran = call("import-terrain", path, tmp_path / "o.json", "--max-error", 1, "--resolution", 1)
    assert ran.code == 3 and message in ran.err


def test_claims_and_cuts(tmp_path: Path) -> None:
    """10⁹ points of a header, and a LAZ without its end: a sentence, and no file."""
    out = tmp_path / "o.json"
    path = write(tmp_path / "a.ply", scattered())
    path.write_bytes(path.read_bytes().replace(b"vertex 900", b"vertex 1000000000"))
    ran = call("import-terrain", path, out, "--max-error", 1)
    assert ran.code == 3 and "ends before its points do" in ran.err
    path = write(tmp_path / "a.laz", scattered())
    path.write_bytes(path.read_bytes()[:-400])
    ran = call("import-terrain", path, out, "--max-error", 1)
    assert ran.code == 3 and "its points are broken, or end too early" in ran.err
    assert not out.exists()


@pytest.mark.parametrize(
    ("name", "option", "message"),
    [
        ("a.xyz", ("--band", 1), "--band is about rasters, but"),
        ("a.las", ("--crs", "EPSG:32633"), "is read as a cloud."),
        ("a.obj", ("--ground",), "--ground is about clouds of points, but"),
        ("a.tif", ("--resolution", 1), "about meshes and clouds of points"),
        ("a.npz", ("--link",), "Only the file of a raster can be linked"),
    ],
)
def test_options_of_other_sources(
    name: str, option: tuple[Any, ...], message: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    if path.suffix in (".xyz", ".npz", ".las"):
        write(path, scattered())
    error = () if "--link" in option else ("--max-error", 1)
    ran = call("import-terrain", path, tmp_path / "o.json", *error, *option)
    assert ran.code == 2 and message in ran.err


# --- commands and Python -------------------------------------------------------------------------


def test_import_and_export_agree(tmp_path: Path) -> None:
    """From the command and from Python; what is exported again has the same pixels."""
    points = scattered()
    path, out = write(tmp_path / "a.pcd", points), tmp_path / "o.json"
    told = ("--max-error", 0.001, "--resolution", 1, "--heights", "highest")
    assert call("import-terrain", path, out, *told).code == 0
    text = json.loads(out.read_text())
    assert text["origin"] == [5000, -300] and text["size"] == [12, 5]
    dem = terratool.load(out).to_dem(resolution=1)
    found = {
        (5000 + column, -300 + 4 - row): float(dem.heights[row, column])
        for row, column in np.ndindex(5, 12) if not np.isnan(dem.heights[row, column])
    }  # fmt: skip
    assert found == pytest.approx(dictionary(points, 1.0, max), abs=0.0011)
    made = terratool.import_terrain(path, max_error=0.001, resolution=1, heights="highest")
    assert np.array_equal(made.to_dem(resolution=1).heights, dem.heights, equal_nan=True)


def test_a_primitive_of_a_cloud(tmp_path: Path) -> None:
    draw = np.random.default_rng(0)
    x, y = draw.uniform(0, 6, (2, 4000))
    points = np.stack([x, y * 0.5, 2 - np.abs(x - 2) / 2], axis=1)
    path = write(tmp_path / "a.xyz", points)
    found = terratool.import_primitive(path, "ridge", resolution=0.25, heights="mean")
    assert found.error.largest < 0.1


def test_gaps_are_void_or_filled(tmp_path: Path) -> None:
    points = scattered(3000)
    hole = (np.abs(points[:, 0] - 5008) < 1) & (np.abs(points[:, 1] + 297) < 1)
    path, out = write(tmp_path / "a.npz", points[~hole]), tmp_path / "o.json"
    told = ("--max-error", 0.01, "--resolution", 0.5, "--overwrite")
    assert "void: " in call("import-terrain", path, out, *told).out
    ran = call("import-terrain", path, out, *told, "--fill")
    assert "without a height, filled" in ran.out and "void:" not in ran.out
    height = terratool.load(out).sample([5008.0], [-297.0]).height[0]
    assert height == pytest.approx(8 + 20 * 3 + 0.5, abs=3)


def test_npz_of_terratool_has_the_points_of_its_pcd(tmp_path: Path) -> None:
    """One reader a format: columns that a scan has besides do no harm."""
    points = scattered()
    columns = {**dict(zip("xyz", points.T, strict=True)), "range": points[:, 0]}
    kinds = {name: column.dtype for name, column in columns.items()}
    npz.write_points(tmp_path / "a.npz", [columns], kinds, dict)
    one = sample_cloud(str(tmp_path / "a.npz"), SourceOptions(resolution=1))
    other = sample_cloud(str(write(tmp_path / "a.pcd", points)), SourceOptions(resolution=1))
    assert np.array_equal(one.values, other.values, equal_nan=True)


def test_sums_of_high_places_round_little() -> None:
    """A million points at 8,000 m with millimetres: the mean is exact to 1e-9."""
    cells = PointCells(CellRange.over(0, 1, 1.0, ALL), CellRange.over(0, 1, 1.0, ALL))
    heights = 8000 + np.arange(200_000) % 7 / 1000
    for _ in range(5):
        cells.add(np.full(200_000, 0.5), np.full(200_000, 0.5), heights)
    assert abs(cells.heights[0, 0] - math.fsum(heights) / 200_000) < 1e-9


@pytest.mark.parametrize(
    "header", ["Easting,Northing,Elevation", '"X (m)","Y (m)","Z [m]"', "lon,lat,height"]
)
def test_names_of_columns_are_those_of_grids(tmp_path: Path, header: str) -> None:
    """A grid stays one, though its names have quotes; with an option of clouds it is none."""
    points = [(x, y, x + 100 * y) for y in range(7) for x in range(11)]
    lines = "".join(f"{x},{y},{z}\n" for x, y, z in points)
    (tmp_path / "a.csv").write_text(f"{header}\n{lines}")
    with open_source(str(tmp_path / "a.csv")) as source:
        assert (source.grid.columns, source.grid.rows) == (11, 7)
        assert source.read(0, 1)[0, :3].tolist() == [0, 1, 2]
    with open_source(str(tmp_path / "a.csv"), SourceOptions(resolution=2)) as source:
        assert (source.grid.columns, source.grid.rows) == (5, 3)
