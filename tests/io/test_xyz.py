"""Grids of points in text: they are read as GDAL reads complete ones, and gaps are void."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.shutil

from terratool.errors import ReadError
from terratool.importing.rasters import open_classes, open_raster
from terratool.importing.sources import open_source
from terratool.importing.types import PixelGrid, SourceOptions
from terratool.io import xyz
from terratool.io.xyz import find_grid, layout_of, read_points
from tests.rasters import geotiff

ROWS, COLUMNS = 4, 6
X, Y = np.meshgrid(500005.0 + 10 * np.arange(COLUMNS), 4500075.0 - 20 * np.arange(ROWS))
Z = np.arange(24.0).reshape(ROWS, COLUMNS) ** 2 / 8
"""Heights from the north, all of them different; the lowest is 0."""
POINTS = np.stack([X, Y, Z], axis=-1)


def text(points: np.ndarray, separator: str = " ", end: str = "\n", form: str = "%r") -> str:
    rows = points.reshape(-1, points.shape[-1]).tolist()
    return "".join(separator.join(form % one for one in row) + end for row in rows)


def read(path: Path, content: str | bytes) -> tuple[PixelGrid, np.ndarray]:
    """The grid of a text, and its heights from the north."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with open_raster(str(path), SourceOptions()) as source:
        return source.grid, source.read(0, source.grid.rows)[::-1]


ORDERS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "rows from the north": lambda points: points,
    "rows from the south": lambda points: points[::-1],
    "columns from the north": lambda points: points.transpose(1, 0, 2),
    "columns from the south": lambda points: points[::-1].transpose(1, 0, 2),
}


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(
    ("separator", "end", "form", "header"),
    [
        (" ", "\n", "%r", ""), ("\t", "\r\n", "%.2f", ""), (",", "\n", "%r", "x,y,z\n"),
        (";", "\n", "%.3f", "X;Y;Z\n"), (" ", "\n", "%.9e", ""), (" ", "\n", "%r", "x y z\n"),
    ],
)  # fmt: skip
def test_as_gdal_reads_it(
    tmp_path: Path, order: str, separator: str, end: str, form: str, header: str
) -> None:
    path = tmp_path / "a.xyz"
    grid, heights = read(path, header + text(ORDERS[order](POINTS), separator, end, form))
    with rasterio.open(path) as file:
        south_up = file.transform.e > 0
        assert np.allclose(heights, file.read(1)[:: -1 if south_up else 1], atol=1e-2)
        left, right = file.bounds.left, file.bounds.right
        assert (grid.west, grid.west + grid.columns * grid.dx) == pytest.approx((left, right))
        low, high = sorted((file.bounds.bottom, file.bounds.top))
        assert (grid.south, grid.south + grid.rows * grid.dy) == pytest.approx((low, high))
    assert (grid.columns, grid.rows, grid.dx, grid.dy) == (6, 4, 10, 20)


VARIANTS = {
    "blanks around": "".join(f"  {x:<12} {y}\t {z} \n" for x, y, z in POINTS.reshape(-1, 3)),
    "comma and blank": text(POINTS, ", "),
    "separators at the end": text(POINTS, ";", ";\n"),
    "decimal commas": text(POINTS, ";").replace(".", ","),
    "decimal commas between blanks": text(POINTS, "  ").replace(".", ","),
    "comments": "# of a survey\n// x y z\n\n" + text(POINTS) + "\n# the end\n",
    "a byte order mark": "\ufeffx y z\n" + text(POINTS),
    "no end of the last line": text(POINTS)[:-1],
    "more columns": "".join(f"{x} {y} {z} 7 8\n" for x, y, z in POINTS.reshape(-1, 3)),
    "columns by name": "id,Height,Northing,Easting\n"
    + "".join(f"{i},{z},{y},{x}\n" for i, (x, y, z) in enumerate(POINTS.reshape(-1, 3))),
    "columns by names in a comment": "//Y;X;Z\n"
    + "".join(f"{y};{x};{z}\n" for x, y, z in POINTS.reshape(-1, 3)),
    "any order": text(np.random.default_rng(1).permutation(POINTS.reshape(-1, 3))),
    "points twice": text(POINTS) * 2,
}


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("piece", [1 << 22, 50])
def test_variants(
    tmp_path: Path, variant: str, piece: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also in small pieces, parsed twice, as a large file is."""
    monkeypatch.setattr(xyz, "_PIECE", piece)
    monkeypatch.setattr(xyz, "_IN_MEMORY", 1 << 22 if piece > 50 else 0)
    monkeypatch.setattr(xyz, "_CELLS", 7)
    grid, heights = read(tmp_path / "a.txt", VARIANTS[variant])
    assert grid == PixelGrid(500000.0, 4500005.0, 10.0, 20.0, 6, 4, unit="")
    assert np.array_equal(heights, Z)


@pytest.mark.parametrize("scale", [1.0, 8.0])
def test_missing_points_are_void(tmp_path: Path, scale: float) -> None:
    """Whether heights are whole or not; the lowest of the others is 0."""
    missing = np.zeros(Z.shape, np.bool_)
    missing[1, 2] = missing[3, 5] = missing[0, 0] = True
    points = POINTS * [1, 1, scale]
    _, heights = read(tmp_path / "a.xyz", text(points[~missing]) + "500005 4500075 nan\n")
    assert np.array_equal(heights, np.where(missing, np.nan, scale * Z), equal_nan=True)


def test_whole_columns_may_be_missing(tmp_path: Path) -> None:
    kept = [0, 1, 4, 5]
    grid, heights = read(tmp_path / "a.xyz", text(POINTS[:, kept]))
    assert (grid.columns, grid.dx) == (6, 10.0)
    assert np.array_equal(heights[:, kept], Z[:, kept]) and np.isnan(heights[:, 2:4]).all()


def test_coordinates_that_were_rounded(tmp_path: Path) -> None:
    """Digits that were cut off, and noise of one coordinate, are within the tolerance."""
    noise = np.random.default_rng(2).uniform(-2e-4, 2e-4, (2, ROWS, COLUMNS))
    thirds = np.stack([X / 30 + noise[0], Y / 30 + noise[1], Z], axis=-1)
    for form in ("%.2f", "%.5f"):
        grid, heights = read(tmp_path / "a.xyz", text(thirds, form=form))
        assert np.allclose(heights, Z, atol=0.01)
        assert (grid.dx, grid.dy) == pytest.approx((1 / 3, 2 / 3), rel=0.01)


def test_doubles_keep_their_digits(tmp_path: Path) -> None:
    """GDAL reads single precision."""
    heights = read(tmp_path / "a.xyz", text(POINTS + np.array([0, 0, 4000.123456789])))[1]
    assert np.array_equal(heights, Z + 4000.123456789)


def test_a_quarter_of_the_cells_is_a_grid(tmp_path: Path) -> None:
    some = POINTS.reshape(-1, 3)
    corners = [0, 1, 6, 17, 22, 23]
    assert np.isfinite(read(tmp_path / "a.xyz", text(some[corners]))[1]).sum() == 6
    with pytest.raises(ReadError, match="is no grid, but a cloud of points"):
        read(tmp_path / "b.xyz", text(some[corners[:-2]]) + text(some[corners[-1:]]))


def test_clouds_are_named_as_such(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    for points in (
        random.uniform(0, 100, (2000, 3)),
        np.round(random.uniform(0, 100, (2000, 3)), 2),
        POINTS.reshape(-1, 3) @ [[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]],
    ):
        with pytest.raises(ReadError, match="is no grid, but a cloud of points"):
            read(tmp_path / "a.xyz", text(points))
        layout = layout_of(tmp_path / "a.xyz")
        assert layout is not None
        assert find_grid(read_points(tmp_path / "a.xyz", layout)) is None


@pytest.mark.parametrize("repeat", [1, 300])
def test_two_heights_of_one_place(tmp_path: Path, repeat: int) -> None:
    other = "500015.0 4500055.0 7.25\n"
    with pytest.raises(ReadError, match=r"a\.xyz: has two heights at 500015 4500055\."):
        read(tmp_path / "a.xyz", text(POINTS) * repeat + other)


@pytest.mark.parametrize("line", ["500015 4500055", "500015 4500055 high", "a b c", "1,2,3"])
def test_lines_that_are_no_points(tmp_path: Path, line: str) -> None:
    with pytest.raises(ReadError, match=f"has a line that is no point .{line}"):
        read(tmp_path / "a.xyz", text(POINTS) + f"{line}\n")


@pytest.mark.parametrize("separator", [" ", ",", ";"])
def test_a_line_that_lacks_a_column(tmp_path: Path, separator: str) -> None:
    """Or its columns would be taken for others."""
    numbered = np.insert(POINTS.reshape(-1, 3), 3, 7, axis=1)
    lines = text(np.repeat(numbered, 2, axis=0), separator).splitlines(keepends=True)
    lines[30] = separator.join(["500015", "4500055", "3"]) + "\n"
    with pytest.raises(ReadError, match=f"no point .500015{separator}4500055"):
        read(tmp_path / "a.xyz", "".join(lines))


def test_points_that_lie_nowhere(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="lies nowhere"):
        read(tmp_path / "a.xyz", text(POINTS) + "inf 4500055 3\n")


def test_a_line_without_end(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="a line of more than 1 MiB"):
        read(tmp_path / "a.xyz", text(POINTS) + "1" * (6 << 20))


@pytest.mark.parametrize("driver", ["AAIGrid", "GSAG", "ZMap", "USGSDEM"])
def test_other_texts_are_left_to_gdal(tmp_path: Path, driver: str) -> None:
    heights = np.arange(24, dtype=np.float32).reshape(4, 6)
    geotiff(tmp_path / "a.tif", heights)
    path = tmp_path / "a.txt"
    if driver != "USGSDEM":  # which wants a reference system, and is one line
        rasterio.shutil.copy(tmp_path / "a.tif", path, driver=driver)
    else:
        path.write_text("1 2 3 TITLE".ljust(1024) + "1 2 3")
    assert layout_of(path) is None


def test_what_is_beside_it_counts(tmp_path: Path) -> None:
    """The reference system that GDAL keeps there."""
    path = tmp_path / "a.xyz"
    (tmp_path / "a.xyz.aux.xml").write_text("<PAMDataset><SRS>EPSG:32633</SRS></PAMDataset>")
    grid, _ = read(path, text(POINTS))
    assert grid.crs == "EPSG:32633"


def test_a_grid_of_classes(tmp_path: Path) -> None:
    """Whole numbers are read as such, and a missing one is no class."""
    (tmp_path / "a.xyz").write_text("0.5 0.5 0\n1.5 0.5 1\n1.5 1.5 2\n")
    with open_classes(str(tmp_path / "a.xyz"), PixelGrid(0, 0, 1, 1, 2, 2)) as classes:
        assert classes.read(0, 2).tolist() == [[0, 1], [-1, 2]]


def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    read(tmp_path / "a.xyz", text(POINTS))
    with pytest.raises(ReadError):
        read(tmp_path / "a.xyz", text(POINTS) + "500015 4500055 1e9\n")
    assert list(folder.iterdir()) == []


def test_bytes_of_an_archive_that_may_lack_points(tmp_path: Path) -> None:
    """GDAL reads these, and cannot tell 0 from what is missing."""
    whole = text(POINTS * [1, 1, 0.5], form="%.0f")
    (tmp_path / "a.xyz.gz").write_bytes(gzip.compress(whole.encode()))
    with (
        pytest.raises(ReadError, match="may lack points") as caught,
        open_source(f"/vsigzip/{tmp_path}/a.xyz.gz"),
    ):
        pass
    assert "unpack the archive" in caught.value.hint
    lifted = text(POINTS + np.array([0, 0, 400]), form="%.3f")
    (tmp_path / "b.xyz.gz").write_bytes(gzip.compress(lifted.encode()))
    with open_source(f"/vsigzip/{tmp_path}/b.xyz.gz") as source:
        assert np.allclose(source.read(0, 4)[::-1], Z + 400, atol=1e-3)
