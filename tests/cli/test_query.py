"""`terratool query`: points from arguments, CSV and pipes; answers as CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import signal
import subprocess
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.cli import query
from tests.commands import COMMAND, ENVIRONMENT, ROOT, YARD, Ran, call

HEADER = "x,y,z,surface,element,nx,ny,nz,note"
SLOPE = sqrt(0.5)
FLAT = (0.0, 0.0, 1.0)

# point -> height, surface, element, normal; worked out from the drawing in `commands`
ANSWERS = {
    (-3, -2): (2.0, "sand", "/elemTree", FLAT),
    (-5, -5): (2.0, "sand", "/elemTree", FLAT),
    (2, -1): (4.0, "sand", "/elemTree/children/0", (-SLOPE, 0.0, SLOPE)),
    (-1, 3): (None, "hole", "/elemTree/children/1", (None, None, None)),
    (1, 1): (2.0, "wet, grey", "/elemTree/children/2", FLAT),
    (5, 5): (12.0, "wet, grey", "/elemTree/children/2", FLAT),
    (5.001, 0): (None, None, None, (None, None, None)),
    (-6, 1e9): (None, None, None, (None, None, None)),
}


@pytest.fixture
def yard(tmp_path: Path) -> Path:
    path = tmp_path / "yard.json"
    path.write_text(json.dumps(YARD), encoding="utf-8")
    return path


def note(z: float | None, surface: str | None) -> str:
    """Why there is no height; a void has a surface."""
    return "" if z is not None else "void" if surface else "outside"


def rows(ran: Ran) -> list[list[str]]:
    assert (ran.code, ran.err) == (0, "")
    header, *found = csv.reader(io.StringIO(ran.out, newline=""))
    assert ",".join(header) == HEADER
    return found


def heights(ran: Ran) -> list[tuple[float, float, float]]:
    return [(float(x), float(y), float(z)) for x, y, z, *_ in rows(ran)]


def test_answers_as_csv(yard: Path) -> None:
    """Each point has its row; what it does not have is an empty cell."""
    found = rows(call("query", yard, *(n for point in ANSWERS for n in point)))
    for (point, (z, surface, element, normal)), row in zip(ANSWERS.items(), found, strict=True):
        assert (float(row[0]), float(row[1])) == point
        assert row[3:5] == [surface or "", element or ""]
        assert row[8] == note(z, surface)
        for text, value in zip([row[2], *row[5:8]], [z, *normal], strict=True):
            assert (text == "") if value is None else float(text) == pytest.approx(value, abs=1e-9)


def test_answers_as_json(yard: Path) -> None:
    """The same as JSON, with null for what there is not, and a version."""
    ran = call("query", yard, *(n for point in ANSWERS for n in point), "--json")
    assert (ran.code, ran.err) == (0, "")
    report = json.loads(ran.out)
    points = report if isinstance(report, list) else report["points"]
    for (point, (z, surface, element, normal)), row in zip(ANSWERS.items(), points, strict=True):
        assert list(row) == HEADER.split(",")
        assert (row["x"], row["y"]) == point
        assert (row["surface"], row["element"]) == (surface, element)
        assert row["note"] == (note(z, surface) or None)
        expected = [z, *normal]
        for key, value in zip(("z", "nx", "ny", "nz"), expected, strict=True):
            assert row[key] == (value if value is None else pytest.approx(value, abs=1e-9))


def test_json_carries_a_version(yard: Path) -> None:
    """A script can tell the version of the report, as with every other JSON."""
    report = json.loads(call("query", yard, 1, 1, "--json").out)
    assert isinstance(report, dict)
    assert report["format_version"] == 1


def test_the_surface_with_a_comma_is_quoted(yard: Path) -> None:
    """A name cannot shift the columns."""
    assert call("query", yard, 1, 1).out.splitlines()[1].startswith('1.0,1.0,2.0,"wet, grey",/elem')


@pytest.mark.parametrize(
    ("texts", "points"),
    [
        (["-3", "-2"], [(-3, -2)]),
        (["-.5", "-1e0"], [(-0.5, -1)]),
        (["-3", "-2", "--no-roughness"], [(-3, -2)]),
        (["--no-roughness", "--", "-3", "-2"], [(-3, -2)]),
        (["-4", "-4", "-3", "-3"], [(-4, -4), (-3, -3)]),
    ],
)
def test_negative_numbers_are_no_options(
    yard: Path, texts: list[str], points: list[tuple[float, float]]
) -> None:
    """Coordinates may be negative, in any spelling, before options and behind them."""
    assert heights(call("query", yard, *texts)) == [(x, y, 2.0) for x, y in points]


RAMP = [(1.0, -1.0, 3.0), (2.5, -2.0, 4.5)]


@pytest.mark.parametrize(
    "text",
    [
        "1,-1\n2.5,-2\n",
        "1,-1\n2.5,-2",
        "1,-1\r\n2.5,-2\r\n",
        "1;-1\n2.5;-2\n",
        "1\t-1\n2.5\t-2\n",
        "1 -1\n 2.5   -2 \n",
        "x,y\n1,-1\n2.5,-2\n",
        "y,x\n-1,1\n-2,2.5\n",
        "X,Y\n1,-1\n2.5,-2\n",
        '"x","y"\n"1","-1"\n"2.5","-2"\n',
        "name,y,other,x\na,-1,,1\nb,-2,,2.5\n",
        'name,x,y\n"a, b",1,-1\n"c",2.5,-2\n',
        "x;y;name\n1;-1;a, b\n2.5;-2;c\n",
        "1;-1;a, b\n2.5;-2;c\n",
        "x\ty\tname\n1\t-1\ta, b\n2.5\t-2\tc; d\n",
        " x , y \n 1 , -1 \n2.5,-2\n",
        "# points\n\nx,y\n# first\n1,-1\n\n   \n2.5,-2\n\n",
        "  # indented\n1,-1\n2.5,-2\n",
        "\ufeffx,y\n1,-1\n2.5,-2\n",
        "\ufeff1,-1\n2.5,-2\n",
        "1,-1,7,8\n2.5,-2,9\n",
        "1e0,-1E+0\n+2.5,-2.\n",
    ],
)
def test_csv_of_many_kinds(yard: Path, text: str) -> None:
    """A header in any order or none, any usual delimiter, comments, marks and line ends."""
    assert_ramp(call("query", yard, "--points", "-", stdin=text))


@pytest.mark.parametrize("text", ["y,x\r\n-1,1\r\n-2,2.5\r\n", "\ufeffx;y\n1;-1\n2.5;-2"])
def test_csv_from_a_file(yard: Path, tmp_path: Path, text: str) -> None:
    """A file is read as a pipe is."""
    path = tmp_path / "points.csv"
    path.write_bytes(text.encode())
    assert_ramp(call("query", yard, "--points", path))


def assert_ramp(ran: Ran) -> None:
    for found, (x, y, z) in zip(heights(ran), RAMP, strict=True):
        assert found == (x, y, pytest.approx(z, rel=1e-12))


@pytest.mark.parametrize("text", ["", "\n\n", "x,y\n", "# nothing\n"])
@pytest.mark.parametrize(("form", "length"), [("csv", 1), ("json", 0)])
def test_no_points(yard: Path, text: str, form: str, length: int) -> None:
    """No points make no answers, and that is good."""
    ran = call("query", yard, "--points", "-", *["--json"] * (form == "json"), stdin=text)
    assert (ran.code, ran.err) == (0, "")
    if form == "csv":
        assert ran.out.splitlines() == [HEADER][:length]
    else:
        report = json.loads(ran.out)
        assert len(report if isinstance(report, list) else report["points"]) == length


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("1,2\n3\n", 2),
        ("1,2\n\n# c\n3,\n", 4),
        ("1,2\nx,y\n", 2),
        ("lon,lat\n1,2\n", 1),
        ("x,y\n1,two\n", 2),
        ("1,2\n1,nan\n", 2),
        ("1,2\n1,inf\n", 2),
        ("1,2\n1,1e999\n", 2),
        ("1,2\n1_0,2\n", 2),
        ("y,z,x\n1,2,3\n1,2\n", 3),
        ("1,2\n\0,2\n", 2),
    ],
)
def test_a_malformed_line(yard: Path, tmp_path: Path, text: str, line: int) -> None:
    """A line that holds no point exits 3 and is named by its number."""
    path = tmp_path / "points.csv"
    path.write_text(text, encoding="utf-8")
    ran = call("query", yard, "--points", path)
    assert ran.code == 3
    assert ran.err.startswith(f"terratool: {path}:{line}: "), ran.err


@pytest.mark.parametrize("piped", [False, True], ids=["file", "pipe"])
def test_points_in_another_encoding(yard: Path, tmp_path: Path, piped: bool) -> None:
    """Bytes that are no UTF-8 exit 3 with what to do, from a pipe as from a file."""
    path = tmp_path / "points.csv"
    path.write_bytes("name,x,y\ncafé,1,2\n".encode("latin-1"))
    source = "-" if piped else path
    ran = call("query", yard, "--points", source, stdin=path.read_bytes() if piped else b"")
    assert ran.code == 3
    assert "UTF-8" in ran.err


def test_points_that_are_not_there(yard: Path, tmp_path: Path) -> None:
    """A missing file of points exits 3 and leaves standard output empty."""
    path = tmp_path / "absent.csv"
    ran = call("query", yard, "--points", path)
    assert ran.code == 3
    assert ran.err.startswith(f"terratool: {path}: cannot be read ")
    assert ran.out == ""


def test_more_points_than_one_chunk(yard: Path) -> None:
    """A long list is answered whole and in order."""
    count = 70_001
    text = "".join(f"{i % 5},{-(i % 3)}\n" for i in range(1, count + 1))
    found = call("query", yard, "--points", "-", stdin=text).out.splitlines()[1:]
    assert len(found) == count
    for index in (1, 65_536, 65_537, count):
        x, y, z = found[index - 1].split(",")[:3]
        assert (float(x), float(y)) == (index % 5, -(index % 3))
        # the row y = 0 belongs to the step, the others to the ramp
        expected = (2 if index % 5 < 2.5 else 12) if index % 3 == 0 else 2 + index % 5
        assert float(z) == pytest.approx(expected)


@pytest.mark.parametrize("form", ["csv", "json"])
@pytest.mark.parametrize(
    ("height", "options", "text"),
    [
        (1.0188999999999999, [], "1.0189"),
        (0.1 + 0.2, [], "0.3"),
        (-0.1234567894, [], "-0.123456789"),
        (-1e-12, [], "0.0"),
        (1e-12, ["--digits", 13], "1e-12"),
        (0.1 + 0.2, ["--digits", 17], "0.30000000000000004"),
        (2.0 / 3.0, ["--digits", 3], "0.667"),
        (2.0 / 3.0, ["--digits", 0], "1.0"),
        (4649776.1234567, [], "4649776.1234567"),
        (98765432109.87654, [], "98765432109.87654"),
        (1e22, [], "1e+22"),
    ],
)
def test_numbers_have_nine_decimals_at_most(
    tmp_path: Path, form: str, height: float, options: list[Any], text: str
) -> None:
    """Fewer where fewer say it, and of a large number no more than a double has."""
    path = tmp_path / "level.json"
    definition = {
        "size": 3, "elemTypes": {"flat": {"x": [1]}},
        "elemTree": {"type": "flat", "vScale": 0, "vOffset": height},
    }  # fmt: skip
    path.write_text(json.dumps(definition), encoding="utf-8")
    ran = call("query", path, 1, 2, *["--json"] * (form == "json"), *options)
    if form == "csv":
        assert rows(ran)[0][2] == text
    else:
        assert f'"z": {text},' in ran.out


@given(st.floats(-1e30, 1e30))
def test_what_is_printed_is_what_was_found(height: float) -> None:
    """To a billionth, or to the last bit of what is too large for that."""
    (shown,) = query._rounded(np.array([height]), 9)
    assert shown is not None
    assert abs(shown - height) <= 0.5e-9 + np.spacing(abs(height)) * (abs(height) < 1e7)
    assert len(repr(shown).partition(".")[2]) <= 9 or "e" in repr(shown) or abs(height) > 9e6


def started(yard: Path) -> subprocess.Popen[bytes]:
    """A query that reads a pipe; Ctrl-C reaches it even where the tests run in the background."""
    return subprocess.Popen(
        [*COMMAND, "query", str(yard), "--points", "-"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        cwd=ROOT, env=ENVIRONMENT,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip


@pytest.mark.slow
def test_a_reader_that_has_gone_is_no_trouble(yard: Path, tmp_path: Path) -> None:
    """With its output cut off, as by ``| head -1``, a query ends at once and in silence."""
    points = tmp_path / "points.csv"
    points.write_text("1,1\n" * 100_000)
    with subprocess.Popen(
        [*COMMAND, "query", str(yard), "--points", str(points)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT, env=ENVIRONMENT,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline().decode().strip() == HEADER
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0, "1 would mean that the answer is no"


def test_ctrl_c(yard: Path) -> None:
    """Ctrl-C in the middle of a long query exits 130, without a traceback."""
    with started(yard) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(b"1,1\n" * 66_000)  # more than a chunk, and the pipe stays open
        process.stdin.flush()
        assert process.stdout.readline().decode().strip() == HEADER
        assert process.stdout.readline().startswith(b"1.0,1.0,2.0,")
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == 130
    assert b"Traceback" not in errors
    assert errors.decode().strip() == "terratool: stopped."


@pytest.mark.parametrize("points", [(-6, 2), (-6, 2, 500, 1)])
def test_points_none_of_which_is_on_the_terrain(yard: Path, points: tuple[int, ...]) -> None:
    """What to do has the sides of the terrain, and says of what they are."""
    ran = call("query", yard, *points)
    assert (ran.code, ran.out) == (2, "")
    assert "\n  Give x and y within west south east north -5 -5 5 5.\n" in ran.err
