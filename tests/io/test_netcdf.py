"""Classic netCDFs: how long the file has to be, by its header; and those of several variables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import netcdf_file

from terratool.errors import ReadError
from terratool.importing.sources import open_source
from terratool.io.netcdf import classic_bytes

ROWS, COLUMNS = 5, 7
HEIGHTS = np.arange(float(ROWS * COLUMNS)).reshape(ROWS, COLUMNS)


def written(path: Path, kinds: str, records: int = 0, version: int = 1, by_record: int = 1) -> Path:
    """A netCDF with a variable of heights, and others of each record, by SciPy."""
    with netcdf_file(path, "w", version=version) as file:
        file.title = b"an odd title"
        for name, length in (("t", None), ("y", ROWS), ("x", COLUMNS), ("three", 3)):
            file.createDimension(name, length)
        heights = file.createVariable("heights", kinds[0], ("y", "x"))
        heights[:] = HEIGHTS
        heights.units = b"m"
        for i in range(by_record if records else 0):
            one = file.createVariable(f"r{i}", kinds[-1], ("t", "three"))
            one[:] = np.ones((records, 3))
    return path


def needed(path: Path) -> int | None:
    with open(path, "rb") as file:
        return classic_bytes(file)


@pytest.mark.parametrize("kinds", ["bb", "hd", "ib", "fh", "db"])
@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize(("records", "by_record"), [(0, 0), (1, 1), (3, 1), (3, 2)])
def test_the_length_is_that_of_the_file(
    tmp_path: Path, kinds: str, version: int, records: int, by_record: int
) -> None:
    """Up to the padding behind the last number, which other programs leave out."""
    path = written(tmp_path / "a.nc", kinds, records, version, by_record)
    size = path.stat().st_size
    found = needed(path)
    assert found is not None and size - 4 < found <= size


def test_a_whole_file_is_read_and_a_cut_one_is_not(tmp_path: Path) -> None:
    """Also where what is missing belongs to a variable that nobody asked for."""
    path = written(tmp_path / "a.nc", "dh", 3, by_record=2)
    data = path.read_bytes()
    name = f"netcdf:{path}:heights"
    with open_source(name) as source:
        found = source.read(0, ROWS)
    assert np.array_equal(found, HEIGHTS) or np.array_equal(found, HEIGHTS[::-1])
    size = needed(path)
    path.write_bytes(data[:size])
    with open_source(name):
        pass
    path.write_bytes(data[: size - 1] if size else b"")
    with (
        pytest.raises(ReadError, match=f"has {size - 1:,} bytes, but its variables take {size:,}"),
        open_source(name),
    ):
        pass


def test_several_variables_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    with netcdf_file(path, "w") as file:
        file.createDimension("y", ROWS)
        file.createDimension("x", COLUMNS)
        for name, values in (("elevation", HEIGHTS), ("slope", -HEIGHTS)):
            file.createVariable(name, "d", ("y", "x"))[:] = values
    with pytest.raises(ReadError) as caught, open_source(str(path)):
        pass
    assert caught.value.message == f"{path}: holds 2 variables: elevation, slope."
    named = caught.value.hint.removeprefix("Name one of them, as ").removesuffix(".")
    with open_source(named) as source:
        assert source.read(0, ROWS).max() == HEIGHTS.max()


@pytest.mark.parametrize("length", range(0, 200, 7))
def test_headers_that_end_early(tmp_path: Path, length: int) -> None:
    data = written(tmp_path / "a.nc", "dh", 3).read_bytes()
    (tmp_path / "b.nc").write_bytes(data[:length])
    assert needed(tmp_path / "b.nc") is None


def test_headers_that_claim_much(tmp_path: Path) -> None:
    """Counts of billions end with the bytes of the file."""
    data = bytearray(written(tmp_path / "a.nc", "dh").read_bytes())
    for at in range(8, len(data) - 4, 4):
        (tmp_path / "b.nc").write_bytes(data[:at] + b"\x7f\xff\xff\xff" + data[at + 4 :])
        found = needed(tmp_path / "b.nc")
        assert found is None or found > 0
