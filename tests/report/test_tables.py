"""Tables: rows for a terminal, and those of several that become one."""

from __future__ import annotations

from enum import Enum

from hypothesis import given
from hypothesis import strategies as st

from terratool.report.tables import (
    WIDTH,
    Column,
    Judged,
    Table,
    align,
    columns_in,
    join_tables,
    truncate,
    wrap,
)


class Verdict(Enum):
    """As results have it."""

    GO = "go"

    @property
    def label(self) -> str:
        """Name."""
        return self.value

    @property
    def sign(self) -> str:
        """Character."""
        return "+"


def table(title: str, columns: str, *rows: str) -> Table:
    return Table(
        (Column(title, False), *map(Column, columns.split())),
        tuple(tuple(row.split()) for row in rows),
    )


class TestJoined:
    def test_equal_ones_are_one(self) -> None:
        one = table("soil", "c phi", "sand 1 30", "clay 4 13")
        assert join_tables([("a", one)], "vehicle") == one
        assert join_tables([("a", one), ("b", one)], "vehicle") == one

    def test_two_columns_stand_beside_each_other(self) -> None:
        """In the order of the longer one; a dash where one has nothing."""
        first = table("figure", "value", "mass 20", "speed 2")
        second = table("figure", "value", "mass 30", "track 1", "speed 3")
        assert join_tables([("a", first), ("b", second)], "vehicle") == Table(
            (Column("figure", False), Column("a"), Column("b")),
            (("mass", "20", "30"), ("track", "–", "1"), ("speed", "2", "3")),
        )

    def test_wider_ones_are_stacked(self) -> None:
        """Rows of one thing together; columns by their titles, wherever they stand."""
        first = table("soil", "climb gap", "sand 6 1", "clay 8 2")
        second = table("soil", "climb step gap", "sand 7 5 3", "rock 9 6 4")
        assert join_tables([("a", first), ("b", second)], "vehicle") == Table(
            (Column("soil, vehicle", False), Column("climb"), Column("step"), Column("gap")),
            (
                ("sand, a", "6", "–", "1"),
                ("sand, b", "7", "5", "3"),
                ("clay, a", "8", "–", "2"),
                ("rock, b", "9", "6", "4"),
            ),
        )

    def test_verdicts_are_named(self) -> None:
        columns = (Column("ground", False), Column("best"), Column("worst"))
        one, two = (Table(columns, ((Verdict.GO, x, x),)) for x in "12")
        found = join_tables([("a", one), ("b", two)], "vehicle")
        assert found.rows == (("go, a", "1", "1"), ("go, b", "2", "2"))

    def test_one_without_rows_adds_none(self) -> None:
        one = table("soil", "climb gap", "sand 6 1")
        assert join_tables([("a", Table((), ())), ("b", one)], "vehicle").rows == (
            ("sand, b", "6", "1"),
        )


def test_a_judgement_is_a_verdict_and_what_there_is_to_say() -> None:
    assert Judged(Verdict.GO, "13°").label == "go, 13°"


def test_columns_are_flush() -> None:
    """The first and the last left, numbers right, words that are named left."""
    rows = [("name", "climb", "level", "why"), ("sand", "6.5", "go", "slip"), ("é", "13", "no", "")]
    assert list(align(rows, words=("go", "no"))) == [
        "name  climb  level  why",
        "sand    6.5  go     slip",
        "é        13  no",
    ]
    assert list(align(rows, left=True))[1] == "sand  6.5    go     slip"


@given(st.lists(st.text(min_size=1), min_size=1), st.integers(1, 30))
def test_a_cut_text_fits(words: list[str], columns: int) -> None:
    text = " ".join(words)
    found = truncate(text, columns)
    assert columns_in(found) <= columns
    assert found == text or found.endswith("…")
    assert (found == text) == (columns_in(text) <= columns)


def test_lines_break_at_words_but_not_before_a_unit() -> None:
    """Letters of the Far East take two columns each."""
    assert list(wrap("aa bb 12 % cc", width=7)) == ["aa bb", "  12 %", "  cc"]
    assert list(wrap("砂 " * 4, "", 7)) == ["砂 砂", "砂 砂"]
    assert all(columns_in(line) <= WIDTH for line in wrap("word " * 99))
