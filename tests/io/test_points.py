"""Points of every format: what is written of plain arrays is read again, and other tools agree."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.io import csv_, las, npz, pcd, ply
from terratool.io import points as module
from terratool.io.points import PointBatch

KIND = np.dtype([("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("range", "<f8"), ("surface", "<i4")])
WANTED = {"x": 0, "y": 0, "z": 0, "range": 0, "surface": 0}
NAMES = ("sand", "a “b”", "end_header")


def batches() -> list[NDArray[Any]]:
    """Two batches of 5 and of 3 points, whole thousandths, and one of none."""
    draw = np.random.default_rng(4)
    found = []
    for count in (5, 0, 3):
        rows = np.zeros(count, KIND)
        for name in "xyz":
            rows[name] = draw.integers(-9000, 9000, count) / 1000
        rows["range"] = draw.uniform(1, 9, count)
        rows["surface"] = draw.integers(-1, 3, count)
        found.append(rows)
    return found


def write_ply(path: Path, rows: list[NDArray[Any]]) -> None:
    ply.write_points(path, rows, KIND, ["any words", *ply.name_comments(NAMES)])


def write_pcd(path: Path, rows: list[NDArray[Any]]) -> None:
    pcd.write_points(path, rows, KIND, ["any words"])


def write_las(path: Path, rows: list[NDArray[Any]]) -> None:
    extra = {"range": "m", "surface": "index"}
    las.write_points(path, rows, KIND, las.LasHeader("plain arrays", NAMES, "", extra))


def write_npz(path: Path, rows: list[NDArray[Any]]) -> None:
    kinds = {name: KIND[name] for name in WANTED}
    columns = ({name: one[name] for name in WANTED} for one in rows)
    npz.write_points(path, columns, kinds, lambda: {npz.NAMES: np.array(NAMES)})


def write_csv(path: Path, rows: list[NDArray[Any]]) -> None:
    def cells() -> Iterator[list[Any]]:
        for one in rows:
            columns = [csv_.cells_of(one[name]) for name in WANTED]
            yield [*columns[:4], [NAMES[n] if n >= 0 else "" for n in columns[4]]]

    csv_.write_points(path, cells(), list(WANTED))


WRITERS: dict[str, tuple[Callable[[Path, Any], None], Any]] = {
    "ply": (write_ply, ply.read_points), "pcd": (write_pcd, pcd.read_points),
    "las": (write_las, las.read_points), "laz": (write_las, las.read_points),
    "npz": (write_npz, npz.read_points), "csv": (write_csv, csv_.read_points),
}  # fmt: skip


def together(read: list[PointBatch], name: str) -> NDArray[Any]:
    return np.concatenate([part.columns[name] for part in read])


@pytest.mark.parametrize("suffix", WRITERS)
def test_columns_come_back(suffix: str, tmp_path: Path) -> None:
    """Coordinates, ranges and names of surfaces; PCD alone has no names, and says so by none."""
    if suffix in ("las", "laz"):
        pytest.importorskip({"las": "laspy", "laz": "lazrs"}[suffix])
    write, read_points = WRITERS[suffix]
    write(tmp_path / f"a.{suffix}", batches())
    read = list(read_points(tmp_path / f"a.{suffix}", WANTED))
    wanted = np.concatenate(batches())
    for name in ("x", "y", "z", "range"):
        close = 1e-9 if suffix in ("las", "laz") else 0.0
        assert together(read, name) == pytest.approx(wanted[name], abs=close)
    if suffix == "pcd":
        assert "surface" not in read[0].columns
        return
    found = [read[0].names[n] if n >= 0 else "" for n in together(read, "surface")]
    assert found == [NAMES[n] if n >= 0 else "" for n in wanted["surface"]]


@pytest.mark.parametrize("suffix", WRITERS)
def test_what_is_not_wanted_is_not_read(suffix: str, tmp_path: Path) -> None:
    if suffix in ("las", "laz"):
        pytest.importorskip({"las": "laspy", "laz": "lazrs"}[suffix])
    write, read_points = WRITERS[suffix]
    write(tmp_path / f"a.{suffix}", batches())
    (part, *_) = read_points(tmp_path / f"a.{suffix}", {"x": 0, "y": 0, "z": 0})
    assert {*part.columns} == {"x", "y", "z"}


@pytest.mark.parametrize("suffix", ["ply", "pcd"])
def test_comments_are_read(suffix: str, tmp_path: Path) -> None:
    write, read_points = WRITERS[suffix]
    write(tmp_path / "a", batches())
    (part,) = read_points(tmp_path / "a", WANTED)
    assert "any words" in part.comments


def test_a_viewpoint_is_read(tmp_path: Path) -> None:
    """The world's own is none."""
    view = (1.5, -2.0, 3.0, 0.5, 0.5, -0.5, 0.5)
    pcd.write_points(tmp_path / "a", batches(), KIND, viewpoint=view)
    (part,) = pcd.read_points(tmp_path / "a", WANTED)
    assert part.viewpoint is not None and tuple(part.viewpoint) == view
    pcd.write_points(tmp_path / "b", batches(), KIND)
    (part,) = pcd.read_points(tmp_path / "b", WANTED)
    assert part.viewpoint is None


@pytest.mark.parametrize("suffix", ["ply", "npz", "csv"])
def test_names_have_an_end(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write, read_points = WRITERS[suffix]
    write(tmp_path / "a", batches())
    monkeypatch.setattr(module, "MOST_NAMES", 1)
    with pytest.raises(RequestError, match="more than 1 surfaces"):
        list(read_points(tmp_path / "a", WANTED))


def test_cells_have_digits_for_their_type() -> None:
    assert csv_.cells_of(np.array([0.1, np.nan])) == [0.1, ""]
    assert csv_.cells_of(np.array([0.1, np.nan], np.float32)) == ["0.1", ""]
    assert csv_.cells_of(np.array([-1, 7])) == [-1, 7]
