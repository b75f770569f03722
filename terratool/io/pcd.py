"""PCD 0.7 point clouds, the format of PCL, read and written."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError
from terratool.io.points import NAMED, PointBatch, Wanted, short_text
from terratool.io.rows import Fields, RowLayout, header_line, read_rows, write_after
from terratool.text.display import quote
from terratool.text.files import open_file
from terratool.text.numbers import parse_number, parse_whole

WORLD = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""Viewpoint of points in world axes: position x, y, z and quaternion w, x, y, z."""
_TYPES = {
    **{("I", str(size)): f"i{size}" for size in (1, 2, 4, 8)},
    **{("U", str(size)): f"u{size}" for size in (1, 2, 4, 8)},
    ("F", "4"): "f4", ("F", "8"): "f8",
}  # fmt: skip
_LARGEST = 1e30
"""Bound on the numbers of a viewpoint, exclusive."""
_FLATTEST = 1e-100
"""Least size of the largest component of a quaternion; a smaller one has no direction."""


def read_points(path: Path, wanted: Wanted) -> Iterator[PointBatch]:
    """Read points of a PCD, text or binary; PCD holds no names.

    Raises:
        ReadError: the file is no PCD, or a compressed one.
    """
    with open_file(path) as file:
        said: dict[str, list[str]] = {}
        comments: list[str] = []
        while "DATA" not in said:
            words = header_line(path, file).split()
            if words[:1] == ["#"]:
                comments.append(" ".join(words[1:]))
            if words and not words[0].startswith("#"):
                said[words[0].upper()] = words[1:]
        data = said["DATA"][:1]
        try:
            layout, viewpoint = _header(said, "<" if data == ["binary"] else "")
        except (KeyError, ValueError) as error:
            raise ReadError(
                f"{path}: its header is no PCD's ({short_text(error)}).",
                "Write it with PCL: numbers of type F, I or U, a count of points, a viewpoint.",
            ) from error
        if data not in (["ascii"], ["binary"]):
            raise ReadError(
                f"{path}: is packed.",
                "Unpack it: pcl_convert_pcd_ascii_binary IN.pcd OUT.pcd 1",
            )
        turned = None if np.array_equal(viewpoint, WORLD) else viewpoint
        for columns in read_rows(path, file, layout, wanted):
            columns.pop(NAMED, None)
            yield PointBatch(columns, (), tuple(comments), turned)


def _header(said: dict[str, list[str]], order: str) -> tuple[RowLayout, NDArray[np.float64]]:
    """Layout of the rows, and viewpoint (7,), from the entries of a header.

    Raises:
        KeyError, ValueError: an entry is missing or invalid.
    """
    names = said["FIELDS"]
    counts = [_whole(text) for text in said.get("COUNT", ["1"] * len(names))]
    fields: Fields = []
    for name, letter, size, many in zip(names, said["TYPE"], said["SIZE"], counts, strict=True):
        form = _TYPES.get((letter.upper(), size))
        if form is None:
            raise ValueError(f"{quote(name)} is of type {quote(letter)} and size {quote(size)}")
        fields.append((name if many == 1 else "", form, many))
    pose = np.array([parse_number(text) for text in said.get("VIEWPOINT", ())] or WORLD, float)
    far = pose.shape != (7,) or not (np.abs(pose) < _LARGEST).all()
    if far or np.abs(pose[3:]).max() < _FLATTEST:
        raise ValueError("no viewpoint")
    [count] = said["POINTS"][:1]
    return RowLayout(fields, _whole(count), order), pose


def _whole(text: str) -> int:
    found = parse_whole(text)
    if found is None:
        raise ValueError(f"{quote(text)} is no count")
    return found


def write_points(
    path: Path,
    batches: Iterable[NDArray[Any]],
    kind: np.dtype[Any],
    comments: Sequence[str] = (),
    viewpoint: Sequence[float] = WORLD,
) -> None:
    """Write a binary PCD of rows of `kind`; `viewpoint` as in `PointBatch`."""
    names = kind.names or ()

    def header(count: int) -> bytes:
        lines = [
            "# .PCD v0.7 - Point Cloud Data file format",
            *(f"# {comment}" for comment in comments),
            "VERSION 0.7",
            f"FIELDS {' '.join(names)}",
            f"SIZE {' '.join(str(kind[name].itemsize) for name in names)}",
            f"TYPE {' '.join(kind[name].kind.upper() for name in names)}",
            f"COUNT {' '.join('1' for _ in names)}",
            f"WIDTH {count}",
            "HEIGHT 1",
            f"VIEWPOINT {' '.join(f'{number:.17g}' for number in viewpoint)}",
            f"POINTS {count}",
            "DATA binary",
        ]
        return "".join(f"{line}\n" for line in lines).encode()

    write_after(path, batches, header)
