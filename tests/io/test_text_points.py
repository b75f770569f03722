"""Points as lines of text: numbers to the last bit, layouts, and lines that are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.errors import ReadError
from terratool.io import text_points
from terratool.io.text_points import TextLayout, layout_of, numbers_in
from tests.budget import examples

PLAIN = TextLayout((0, 1, 2), 0)
HERE = Path("a.xyz")


@given(
    st.lists(st.tuples(*[st.floats()] * 4), min_size=1), st.sampled_from([" ", ",", "\t", " , "])
)
@settings(max_examples=examples(400), deadline=None)
def test_numbers_are_those_of_python(rows: list[tuple[float, ...]], gap: str) -> None:
    """Every double, infinite or none, to the last bit; the fourth column is passed over."""
    text = "".join(gap.join(map(repr, row)) + "\r\n" for row in rows).encode()
    wanted = np.array(rows)
    assert np.array_equal(numbers_in(HERE, text, PLAIN), wanted[:, :3], equal_nan=True)
    turned = numbers_in(HERE, text, TextLayout((3, 0, 1), 0))
    assert np.array_equal(turned, wanted[:, [3, 0, 1]], equal_nan=True)


def test_lines_that_are_none_are_passed_over() -> None:
    text = b"# 1 2 3\n\n 1 2 3\n//4 5 6\n   \n-7,,+8e1 \n9 8 7"
    found = numbers_in(HERE, text, PLAIN)
    assert np.array_equal(found, [[1, 2, 3], [-7, np.nan, 80], [9, 8, 7]], equal_nan=True)
    assert len(numbers_in(HERE, b"", PLAIN)) == 0


@pytest.mark.parametrize("text", [b"1 2 3\n4 5\n", b"1 2 3\n4,5\r\n", b"1 2 3\n4\n5 6\n"])
def test_lines_that_are_too_short_are_named(text: bytes) -> None:
    """Though the numbers of all lines would make whole rows."""
    with pytest.raises(ReadError, match=r"has no x, y and z in the line .4"):
        numbers_in(HERE, text, PLAIN)


@pytest.mark.parametrize("word", ["1_0", "٣", "0x", "1e", "--1", "1.2.3", "north"])
def test_words_are_no_numbers(word: str) -> None:
    with pytest.raises(ReadError, match="is no number"):
        numbers_in(HERE, f"1 2 3\n4 {word} 6\n".encode(), PLAIN)


def test_layouts() -> None:
    assert layout_of(b"1 2 3") == PLAIN
    assert layout_of(b"x y z\n1 2 3") == TextLayout((0, 1, 2), 6)
    assert layout_of(b"//Z, Y ,X\n1,2,3") == TextLayout((2, 1, 0), 10)
    assert layout_of(b"# by hand\n1 2 3 4") == TextLayout((0, 1, 2), 10)
    for none in (b"", b"1 2", b"a b c\n1 2 3", b"x,y\n1,2", b"{}", b"\0\1\2", b"x y z", b"1;2"):
        assert layout_of(none) is None
    layout = layout_of(b"1,5;2;3")
    assert layout is not None and numbers_in(HERE, b"1,5;2;3", layout).tolist() == [[1.5, 2, 3]]


def test_any_chunks_make_the_same_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = np.round(np.random.default_rng(1).normal(0, 1e4, (300, 3)), 3)
    path = tmp_path / "a.xyz"
    np.savetxt(path, rows, fmt="%.3f")
    for size in (64, 65, 1000, 1 << 20):
        monkeypatch.setattr(text_points, "_CHUNK", size)
        found = [batch.columns for batch in text_points.read_points(path, {})]
        for axis, name in enumerate("xyz"):
            joined = np.concatenate([columns[name] for columns in found])
            assert np.array_equal(joined, rows[:, axis])


@pytest.mark.parametrize("text", ["1 2 3\n4 5 6,5\n", "1,5 2 3\n4 5 6,5\n", "1 2 3\n4,25 5 6\n"])
def test_decimal_commas_between_blanks(text: str) -> None:
    """The first line may have none."""
    layout = layout_of(text.encode())
    assert layout is not None
    rows = [[float(word.replace(",", ".")) for word in line.split()] for line in text.splitlines()]
    assert numbers_in(HERE, text.encode(), layout).tolist() == rows


def test_a_comma_in_another_column_is_none_of_decimals() -> None:
    text = b"1 2 3 soil\n4 5 6 rock,soil\n"
    layout = layout_of(text)
    assert layout == TextLayout((0, 1, 2), 0)
    assert numbers_in(HERE, text, layout).tolist() == [[1, 2, 3], [4, 5, 6]]
