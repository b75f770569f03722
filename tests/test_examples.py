"""Every file in example-files and samples: dropping one there adds a test."""

from __future__ import annotations

from pathlib import Path

import pytest

from terratool.definition.reader import check
from terratool.definition.rules import all_rules
from terratool.definition.source import read_source

HERE = Path(__file__).parent
VALID = sorted((HERE / "example-files" / "valid").glob("*.json"))
INVALID = sorted((HERE / "example-files" / "invalid").glob("*.json"))
SAMPLES = sorted((HERE.parent / "samples").glob("*.json"))


def expected(path: Path) -> list[tuple[str, str, str]]:
    """Place, code and pointer, from lines such as ``3:14 TT105 /elemTree/cells``."""
    found = []
    for line in path.with_suffix(".expected").read_text("utf-8").splitlines():
        place, code, *pointer = line.split(" ", 2)
        found.append((place, code, pointer[0] if pointer else ""))
    return found


@pytest.mark.parametrize("path", INVALID, ids=lambda path: path.stem)
def test_invalid_example(path: Path) -> None:
    """An invalid file has the findings that are listed beside it, all of them, and no others."""
    checked = check(read_source(path))
    found = [(f"{f.line}:{f.column}", f.code, f.pointer) for f in checked.findings]
    assert found == expected(path)
    assert checked.definition is None


@pytest.mark.parametrize("path", VALID, ids=lambda path: path.stem)
def test_valid_example(path: Path) -> None:
    """A valid file has no errors."""
    checked = check(read_source(path))
    assert [f for f in checked.findings if f.severity == "error"] == []
    assert checked.definition is not None


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_sample(path: Path) -> None:
    """A sample is a good example: nothing is wrong with it, and nothing to remark on."""
    checked = check(read_source(path))
    assert checked.findings == ()
    assert checked.definition is not None


def test_every_rule_has_an_example() -> None:
    """Each code stands in one of the lists at least, and each list belongs to a file."""
    lists = sorted((HERE / "example-files" / "invalid").glob("*.expected"))
    assert [path.stem for path in lists] == [path.stem for path in INVALID]
    codes = {code for path in INVALID for _, code, _ in expected(path)}
    assert codes == set(all_rules())
    assert VALID
    assert SAMPLES
