"""Parts and copies written out, against a plain reading and by hand."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from msgspec import UNSET

from terratool.definition.libraries import known_names
from terratool.definition.model import Element as ElementText
from terratool.definition.model import names_of, pair_of
from terratool.definition.reader import Checked, CheckOptions, check
from terratool.definition.tree import Tree
from terratool.definition.uses import Uses
from terratool.text.source import read_source
from tests import composition
from tests.filesets import MAIN, FileSet, file_sets, save

KEYS = {key: name for name, key in names_of(ElementText) if key != "children"}


def checked_files(files: FileSet, folder: Path) -> Checked:
    options = CheckOptions(warnings=False, library_roots=(str(folder),))
    return check(read_source(save(files, folder)), options)


def elements(tree: Tree) -> dict[str, dict[str, Any]]:
    """The elements of a tree by pointer: what they say, and how many children they have."""
    found = {}
    for index in range(len(tree)):
        values = {key: tree.value(name, index) for key, name in KEYS.items()}
        told = {key: value for key, value in values.items() if value is not UNSET}
        begin, end = tree.brood(index)
        found[tree.pointer(index)] = {**told, "children": end - begin}
    return found


def plain_elements(root: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The same of plain JSON."""
    found = {}
    pending = [("/elemTree", root)]
    while pending:
        pointer, node = pending.pop()
        below = node.get("children", [])
        found[pointer] = {**node, "children": len(below)}
        pending += [(f"{pointer}/children/{k}", child) for k, child in enumerate(below)]
    return found


def shares(root: dict[str, Any], size: Any) -> dict[str, float]:
    """The default of vScale, in the plain reading, by pointer."""
    x, y = composition.both(size)
    found = {}
    pending: list[tuple[str, dict[str, Any], float, float]] = [("/elemTree", root, x, y)]
    while pending:
        pointer, node, w, h = pending.pop()
        found[pointer] = min(w / x, h / y)
        columns, rows = composition.both(node["cells"])
        for k, child in enumerate(node.get("children", [])):
            if "at" in child:
                sides = composition.both(child["extent"])
            else:
                sides = [w * child["span"][0] / columns, h * child["span"][1] / rows]
            pending.append((f"{pointer}/children/{k}", child, *sides))
    return found


def assert_same(found: dict[str, Any], wanted: dict[str, Any], share: float, size: float) -> None:
    """Structure exactly, numbers to 1e-12."""
    exact = ("type", "surface", "descr", "cellX", "cellY", "children")
    assert {key: found.get(key) for key in exact} == {key: wanted.get(key) for key in exact}
    assert pair_of(found.get("cells", 10), 0) == tuple(composition.both(wanted["cells"]))
    if "at" in wanted:
        assert found["at"] == pytest.approx(tuple(wanted["at"]), rel=1e-12, abs=1e-12 * size)
        extent = pair_of(found["extent"], math.nan)
        assert extent == tuple(composition.both(wanted["extent"]))
    else:
        assert "at" not in found and "extent" not in found
        if "span" in wanted:
            assert found.get("span", (1, 1)) == tuple(wanted["span"])
    assert found.get("vScale", share) == pytest.approx(wanted["vScale"], rel=1e-12)
    assert found.get("vOffset", 0) == pytest.approx(wanted["vOffset"], rel=1e-12, abs=1e-14)
    turn = found.get("turnDeg", 0) - wanted["turnDeg"]
    assert abs(math.remainder(turn, 360)) <= 1e-12 * 360
    assert "part" not in found and "repeat" not in found


@settings(max_examples=300)
@given(file_sets())
def test_the_expansion_is_what_the_format_says(files: FileSet) -> None:
    """Elements, their order and their names, and how many there are."""
    with tempfile.TemporaryDirectory() as folder:
        checked = checked_files(files, Path(folder))
        assert checked.findings == ()
        expansion = checked.expansion
        assert expansion is not None
        definition = files.plain.definition
        wanted = plain_elements(definition["elemTree"])
        found = elements(expansion.tree)
        assert found.keys() == wanted.keys()
        size = definition["size"]
        defaults = shares(definition["elemTree"], size)
        for pointer, element in wanted.items():
            largest = max(composition.both(size))
            assert_same(found[pointer], element, defaults[pointer], largest)
        assert names(expansion.tree) == files.plain.names
        assert checked.document is not None
        uses = Uses(checked.document, known_names(checked.document)[0])
        assert uses.elements == len(expansion.tree) == composition.count(files.texts, MAIN)
        for dictionary, known in (
            ("surfTypes", expansion.definition.surfaces),
            ("elemTypes", expansion.definition.primitives),
        ):
            assert known.keys() == definition[dictionary].keys()


def names(tree: Tree) -> dict[str, str]:
    """What a query calls the elements, by their pointers."""
    found = {}
    for index in range(len(tree)):
        steps, at = [], index
        while at >= 0:
            parent = tree.parents[at]
            own = tree.roots[0] if parent < 0 else f"/children/{at - tree.first_child[parent]}"
            steps.append(tree.steps[at] if tree.steps is not None else own)
            at = parent
        found[tree.pointer(index)] = "".join(reversed(steps))
    return found
