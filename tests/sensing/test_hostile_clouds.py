"""Small clouds that claim much, or say what no cloud says: a sentence, no time and no memory."""

from __future__ import annotations

import io
import struct
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.errors import ReadError, RequestError
from terratool.sensing.clouds import read_clouds
from tests.fuzz.clouds import try_cloud
from tests.fuzz.harness import Case, Target, alone

TARGET = Target("clouds", 1, lambda _: Case("", b""), try_cloud)
POINTS = np.arange(9, dtype="<f4").tobytes()


def pcd(data: bytes = POINTS, **keys: str) -> bytes:
    """Three points, as PCL writes them, but for some lines."""
    said = {"FIELDS": "x y z", "SIZE": "4 4 4", "TYPE": "F F F", "POINTS": "3", **keys}
    said["DATA"] = said.pop("DATA", "binary")  # behind which the points begin
    return "".join(f"{key} {value}\n" for key, value in said.items()).encode() + data


def ply(
    count: str, form: str = "binary_little_endian", more: str = "", data: bytes = POINTS
) -> bytes:
    fields = "".join(f"property float {name}\n" for name in "xyz")
    head = f"ply\nformat {form} 1.0\n{more}element vertex {count}\n{fields}end_header\n"
    return head.encode() + data


def member(header: str, data: bytes = bytes(80)) -> bytes:
    """An array of NumPy with any header."""
    text = header.encode("latin-1") + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + data


PLAIN = member("{'descr': '<f8', 'fortran_order': False, 'shape': (10,)}")


def npz(method: int = zipfile.ZIP_DEFLATED, **members: bytes) -> bytes:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", method) as archive:
        for name, data in {"x": PLAIN, "y": PLAIN, "z": PLAIN, **members}.items():
            archive.writestr(f"{name}.npy", data)
    return whole.getvalue()


def header(descr: str = "'<f8'", shape: str = "(10,)", more: str = "") -> str:
    return f"{{{more}'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}"


def spoilt(archive: bytes, flags: int = 0) -> bytes:
    """An archive of which the first member is packed in no way, or is said to be encrypted."""
    data = bytearray(archive)
    data[50:70] = bytes(20) if flags else b"\xff" * 20
    data[6] |= flags
    data[data.find(b"PK\1\2") + 8] |= flags
    return bytes(data)


def las(**at: tuple[int, str, int]) -> bytes:
    """A LAS 1.4 of three points, with other numbers at some places of its header."""
    import laspy

    made = laspy.LasHeader(version="1.4", point_format=6)
    made.scales = np.full(3, 0.01)
    whole = io.BytesIO()
    with laspy.open(whole, "w", header=made, closefd=False) as file:
        points = laspy.ScaleAwarePointRecord.zeros(3, header=made)
        points.x = points.y = points.z = np.arange(3.0)
        file.write_points(points)
    data = bytearray(whole.getvalue())
    for place, form, value in at.values():
        struct.pack_into(form, data, place, value)
    return bytes(data)


HUGE = "9" * 4000
REFUSED: dict[str, tuple[str, bytes, str]] = {
    "a billion columns": (".pcd", pcd(COUNT="1 1 1000000000"), "ends before its points"),
    "no columns at all": (".pcd", pcd(COUNT="1 1 -1"), '"-1" is no count'),
    "points below 0": (".pcd", pcd(POINTS="-1"), '"-1" is no count'),
    "points of another script": (".pcd", pcd(POINTS="²"), "is no count"),
    "points without end": (".pcd", pcd(POINTS=HUGE), "is no count"),
    "a petabyte of points": (".pcd", pcd(POINTS="90071992547409"), "ends before its points"),
    "characters": (".pcd", pcd(SIZE="8 4 4", TYPE="a F F"), 'is of type "a"'),
    "complex numbers": (".pcd", pcd(SIZE="8 4 4", TYPE="C F F"), 'is of type "C"'),
    "times": (".pcd", pcd(SIZE="8 4 4", TYPE="M F F"), 'is of type "M"'),
    "spans of time": (".pcd", pcd(SIZE="8 4 4", TYPE="m F F"), 'is of type "m"'),
    "half a number": (".pcd", pcd(SIZE="2 4 4"), 'and size "2"'),
    "a viewpoint nowhere": (".pcd", pcd(VIEWPOINT="1e300 0 0 1e-320 0 0 0"), "no viewpoint"),
    "a viewpoint of nothing": (".pcd", pcd(VIEWPOINT="0 0 0 1e-320 0 0 0"), "no viewpoint"),
    "a viewpoint of words": (".pcd", pcd(VIEWPOINT="a b c d e f g"), "no viewpoint"),
    "ten billion lines": (".pcd", pcd(POINTS="9999999999", DATA="ascii"), "ends before"),
    "a line without end": (".pcd", pcd(POINTS="9", DATA="ascii", data=b"1 " * 700_000), "1 MiB"),
    "vertices of another script": (".ply", ply("²"), "or no vertices"),
    "vertices of Arabia": (".ply", ply("٣"), "or no vertices"),
    "vertices without end": (".ply", ply(HUGE), "or no vertices"),
    "a petabyte of vertices": (".ply", ply("90071992547409"), "ends before its points"),
    "digits of another script": (".ply", ply("1", "ascii", data="1 ٣ 1\n".encode()), "no row of"),
    "digits with bars": (".ply", ply("1", "ascii", data=b"1 1_0 1\n"), "no row of numbers"),
    "an array of zeros as names": (
        ".npz",
        npz(surfaces=member(header(shape="(20000000,)"), bytes(160_000_000))),
        "more than 100 times its size",
    ),
    "zeros as places": (
        ".npz",
        npz(**{name: member(header(shape="(5000000,)"), bytes(40_000_000)) for name in "xyz"}),
        "more than 100 times its size",
    ),
    "LZMA": (".npz", npz(zipfile.ZIP_LZMA), "not by deflate"),
    "BZIP2": (".npz", npz(zipfile.ZIP_BZIP2), "not by deflate"),
    "broken deflate": (".npz", spoilt(npz()), r"a\.npz: "),
    "a password": (".npz", spoilt(npz(), 1), "encrypted"),
    "a header of brackets": (".npz", npz(x=member("(" * 9000)), "whose header is none"),
    "a header of minuses": (".npz", npz(x=member("-" * 9000 + "1")), "whose header is none"),
    "a header without end": (".npz", npz(x=member("{'''")), "whose header is none"),
    "a header of lists": (".npz", npz(x=member(header(more="[1]: 2, "))), "whose header is none"),
    "a header of true": (".npz", npz(surfaces=member(header(shape="(True,)"))), "without a length"),
    "a header below 0": (".npz", npz(x=member(header(shape="(-5,)"))), "without a length"),
    "a header of Googol": (".npz", npz(x=member(header(shape=f"({HUGE},)"))), "ends before"),
    "long names": (
        ".npz", npz(surfaces=member(header("'<U99999999'", "(9,)"))), "ends before its arrays",
    ),
    "names of nothing": (
        ".npz", npz(surfaces=member(header("'<U0'", f"({HUGE},)"), b"")), "no list of names",
    ),
    "numbers as names": (".npz", npz(surfaces=PLAIN), "no list of names"),
    "objects": (".npz", npz(x=member(header("'|O'"))), "no column of numbers"),
    "complex columns": (".npz", npz(x=member(header("'<c8'"))), "no column of numbers"),
    "names of 2 MB": (
        ".csv",
        b"x,y,z,surface\n" + b"".join(b"1,2,3,%040d\n" % n for n in range(50_000)),
        "more than 65,536 surfaces, or more than 1 MiB",
    ),
    "a line of 1 MB": (".csv", b"x,y,z\n" + b"1," * 600_000, "a line of more than 1 MiB"),
    "numbers of another script": (".csv", "x,y,z\n١,1,1\n".encode(), "is no number"),
    "numbers with bars": (".csv", b"x,y,z\n1_0,1,1\n", "is no number"),
    "records without end": (".las", las(records=(100, "<I", 2**32 - 1)), "claims more than"),
    "points behind the end": (".las", las(offset=(96, "<I", 2**31)), "claims more than"),
    "a small header": (".las", las(header=(94, "<H", 0)), "claims more than"),
    "a long way to the points": (".las", las(count=(247, "<Q", 2**62)), "ends before its points"),
    "an unknown format": (".las", las(form=(104, "<B", 63)), "header is no LAS's"),
    "LAZ without its record": (".las", las(form=(104, "<B", 134)), "points are broken"),
    "LAZ of 2⁶² points": (
        ".las", las(form=(104, "<B", 134), count=(247, "<Q", 2**62)), "more than 100 times",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_told_in_a_sentence(name: str, tmp_path: Path) -> None:
    suffix, data, said = REFUSED[name]
    path = tmp_path / f"a{suffix}"
    path.write_bytes(data)
    with pytest.raises((ReadError, RequestError), match=said) as caught, warnings.catch_warnings():
        warnings.simplefilter("error")
        list(read_clouds(path))
    assert path.name in caught.value.message and caught.value.hint


@pytest.mark.parametrize("name", REFUSED)
def test_it_takes_no_time_and_no_memory(name: str) -> None:
    """In a process of its own, as `make fuzz` tries it, with the command that makes maps."""
    fault = alone(TARGET, Case(*REFUSED[name][:2]))
    assert fault is None, (fault.kind, fault.detail)


READ: dict[str, tuple[str, bytes]] = {
    "brackets for a name": (".ply", ply("3", more=f"comment surface 0 {'[' * 2000}\n")),
    "digits for a name": (".ply", ply("3", more=f"comment surface 0 {'9' * 4000}\n")),
    "padding": (".pcd", pcd(FIELDS="x y z _", SIZE="4 4 4 1", TYPE="F F F U", COUNT="1 1 1 0")),
    "a viewpoint and no numbers": (
        ".pcd", pcd(VIEWPOINT="1 2 3 0 1 0 0", data=np.array([np.nan, np.inf, 1e38] * 3, "<f4")
                    .tobytes()),
    ),
    "a signalling NaN": (".ply", ply("3", data=b"\x01\x00\xa0\x7f" * 3 + POINTS[12:])),
    "a header of Python 2": (".npz", npz(x=member(header(shape="(10L,)")))),
    "a header that warns": (".npz", npz(x=member(header("'\\<f8'")))),
    "no surfaces": (".npz", npz(surfaces=member(header("'<U1'", "(0,)"), b""))),
    "long doubles": (".npz", npz(x=member(header("'<f16'"), b"\xff" * 160))),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_odd_is_read_without_a_word(name: str, tmp_path: Path) -> None:
    fault = alone(TARGET, Case(*READ[name]))
    assert fault is None, (fault.kind, fault.detail)


def test_indices_of_bytes_are_none_or_names(tmp_path: Path) -> None:
    """-1 in unsigned bytes is 255, which no list of names has."""
    path = tmp_path / "a.ply"
    kind = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("surface", "u1")])
    rows = np.array([(1, 2, 3, 255), (1, 2, 3, 1), (1, 2, 3, 0)], kind)
    fields = "".join(f"property float {name}\n" for name in "xyz") + "property uchar surface\n"
    names = 'comment surface 0 "a"\ncomment surface 1 "b  c"\n'
    head = f"ply\nformat binary_little_endian 1.0\n{names}element vertex 3\n{fields}end_header\n"
    path.write_bytes(head.encode() + rows.tobytes())
    (cloud,) = read_clouds(path)
    assert cloud.surface is not None and cloud.surface.tolist() == [-1, 1, 0]
    assert cloud.surfaces == ("a", "b  c")


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize(("version", "form"), [("1.2", 0), ("1.2", 3), ("1.3", 4), ("1.4", 7)])
def test_las_of_others(suffix: str, version: str, form: int, tmp_path: Path) -> None:
    """Of all versions, in several batches, with the numbers that laspy itself reads."""
    import laspy

    header = laspy.LasHeader(version=version, point_format=form)
    header.scales, header.offsets = np.array([0.01, 0.02, 0.5]), np.array([5e5, -4e6, 9.0])
    count, path = 70_000, tmp_path / f"a{suffix}"
    with laspy.open(path, "w", header=header) as file:
        points: Any = laspy.ScaleAwarePointRecord.zeros(count, header=header)
        values = np.random.default_rng(1).integers(-10_000, 10_000, (3, count))
        points.X, points.Y, points.Z = values
        if form:
            points.gps_time = np.arange(count) / 7
        file.write_points(points)
    found = list(read_clouds(path))
    exact = laspy.read(path)
    wanted = np.stack([exact.x, exact.y, exact.z], axis=-1)
    np.testing.assert_array_equal(np.concatenate([one.points for one in found]), wanted)
    if form:
        times = np.concatenate([one.time for one in found if one.time is not None])
        np.testing.assert_array_equal(times, exact.gps_time)


def test_a_broken_laz_ends_no_process(tmp_path: Path) -> None:
    """What lazrs takes at its word would take 60 GB, and the process with it."""
    import laspy

    whole = io.BytesIO()
    header = laspy.LasHeader(version="1.4", point_format=6)
    with laspy.open(whole, "w", header=header, do_compress=True, closefd=False) as file:
        file.write_points(laspy.ScaleAwarePointRecord.zeros(300, header=header))
    data = bytearray(whole.getvalue())
    offset = struct.unpack_from("<I", data, 96)[0]
    chunks = struct.unpack_from("<q", data, offset)[0]
    struct.pack_into("<I", data, chunks + 4, 2**32 - 1)
    layers = offset + 8 + header.point_format.size + 4
    struct.pack_into("<9I", data, layers, *[2**32 - 1] * 9)
    fault = alone(TARGET, Case(".laz", bytes(data)))
    assert fault is None, (fault.kind, fault.detail)
    path = tmp_path / "a.laz"
    path.write_bytes(data)
    with pytest.raises(ReadError, match="points are broken"):
        list(read_clouds(path))
