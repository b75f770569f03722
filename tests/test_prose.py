"""The check of sentences finds what leans on a neighbour, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import prose

GOOD = '''"""Sides of cells."""

LENGTHS = 1, 2
"""Side lengths (x, y), world units."""


def area(x: float) -> float:
    """Area in square units.

    Args:
        x: side along x.
    """
    text = "… is no docstring"
    return x
'''


@pytest.mark.parametrize(
    ("good", "bad", "line"),
    [
        ("Sides of cells.", "What cells have.", 1),
        ("Side lengths", "Their lengths", 4),
        ("Side lengths", "… and lengths", 4),
        ("Side lengths", "σ of lengths", 4),
        ("world units.", "world units …", 4),
        ("Area in", "area in", 8),
        ("x: side", "x: … side", 11),
    ],
)
def test_fragments_are_found_where_they_stand(good: str, bad: str, line: int) -> None:
    assert list(prose.faults("a.py", GOOD)) == []
    (found,) = prose.faults("a.py", GOOD.replace(good, bad))
    assert found.startswith(f"a.py:{line}: ")


def test_classes_of_one_name_are_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    files = [tmp_path / "a.py", tmp_path / "b.py"]
    for path, text in zip(files, ("class One: ...", "class Two: ...\nclass One: ..."), strict=True):
        path.write_text(text)
    assert list(prose.repeated_classes(files)) == ["One is the name of 2 classes: a.py:1, b.py:2."]
