"""Definitions that are written in Python say what a text says, and nothing else."""

from __future__ import annotations

import gzip
import inspect
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terratool
from terratool.definition.keys import KEYS
from terratool.definition.model import (
    Definition,
    Element,
    Primitive,
    Surface,
    Track,
    names_of,
)
from terratool.definition.reader import check
from terratool.text.source import Source

YARD = """{
  "descr": "Yard",
  "size": [20, 12],
  "surfTypes": {
    "sand": { "preset": "dry-sand", "fricAngle": [26, 30] }
  },
  "elemTypes": {
    "ground": { "x": [0], "x-ignore": ["TT308"], "x-why": "It is level" },
    "box": { "x": [1] }
  },
  "parts": {
    "pallet": {
      "type": "box", "vScale": 0.15, "cells": 2,
      "children": [
        { "cellX": 0, "cellY": 1, "type": "box", "vScale": 0.4 }
      ]
    }
  },
  "elemTree": {
    "type": "ground", "surface": "sand", "cells": [10, 6],
    "children": [
      { "at": [3, 4], "extent": [1.2, 0.8], "repeat": { "count": [3, 2], "step": [2, 1.5] }, "part": "pallet" },
      {
        "cellX": 7, "cellY": 1, "span": [3, 2], "type": "box", "vScale": 1.5, "cells": 4,
        "children": [
          { "cellX": 1, "cellY": 2, "type": "box", "vScale": 0.2 }
        ]
      },
      {
        "cellX": 0, "cellY": 5, "span": [6, 1], "scatter": { "count": 5, "sizes": [0.2, 0.6], "seed": 4 }, "type": "box"
      }
    ]
  },
  "tracks": [
    { "path": [[1, 1], [18, 2]], "width": 0.2, "depth": 0.05 }
  ]
}
"""  # noqa: E501


def yard() -> terratool.Definition:
    """What YARD says, in Python."""
    made = terratool.Definition(size=(20, 12), descr="Yard")
    sand = made.surface("sand", preset="dry-sand", fric_angle=np.array([26, 30]))
    made.primitive("ground", x=[0], x_ignore=["TT308"], x_why="It is level")
    made.primitive("box", x=[1])
    made.part("pallet", "box", v_scale=0.15, cells=2).add("box", cell=(0, 1), v_scale=0.4)
    made.root("ground", surface=sand, cells=(10, 6))
    rows = {"count": (3, 2), "step": (2, 1.5)}
    made.add(part="pallet", at=(3, 4), extent=(1.2, 0.8), repeat=rows)
    box = made.add("box", cell=np.array([7, 1]), span=(3, 2), v_scale=np.float64(1.5), cells=4)
    box.add("box", cell_x=1, cell_y=2, v_scale=0.2, surface=None)
    strewn = {"count": 5, "sizes": (0.2, 0.6), "seed": 4}
    made.add("box", cell=(0, 5), span=(6, 1), scatter=strewn)
    made.track(path=[(1, 1), (18, 2)], width=0.2, depth=0.05)
    return made


def test_the_text_is_that_of_a_person_in_the_canonical_layout() -> None:
    made = yard()
    assert made.text == str(made) == YARD
    assert made.document == json.loads(YARD)
    assert repr(made) == "<Definition of size (20, 12), 5 elements>"
    assert made.validate() == ()


def test_the_terrain_is_that_of_the_text(tmp_path: Path) -> None:
    terrain, read = yard().compile(), terratool.load(YARD)
    x, y = np.meshgrid(np.linspace(0, 20, 83), np.linspace(0, 12, 61))
    assert np.array_equal(terrain.height(x, y), read.height(x, y))
    # the pallet's box stands in the north-west of its second copy; the inner box on the large one
    assert terrain.height([4.7, 19], [4.2, 3]) == pytest.approx([0.55, 1.5])
    assert terrain.height(14 + 1.5 * 6 / 4, 2 + 2.5) == pytest.approx(1.7)
    assert terrain.elements == 1 + 6 * 2 + 2 + 5
    assert terrain.diff(read).same


def test_it_is_saved_as_it_reads(tmp_path: Path) -> None:
    made, path = yard(), tmp_path / "yard.json"
    assert made.save(path) == path
    assert path.read_text("utf-8") == YARD
    with pytest.raises(terratool.WriteError, match=r"exists already.*overwrite=True"):
        made.save(path)
    made.save(path, overwrite=True)
    made.save(tmp_path / "yard.json.gz")
    assert gzip.decompress((tmp_path / "yard.json.gz").read_bytes()).decode() == YARD
    for name in ("yard.txt", ".json"):
        with pytest.raises(terratool.RequestError, match=r"end in \.json"):
            made.save(tmp_path / name)


def test_what_has_errors_is_not_saved(tmp_path: Path) -> None:
    made = yard()
    made.add("bax", cell=(1, 1))
    with pytest.raises(terratool.DefinitionError, match=r"TT201.*bax"):
        made.save(tmp_path / "a.json")
    with pytest.raises(terratool.DefinitionError):
        made.compile()
    assert list(tmp_path.iterdir()) == []


def test_libraries_are_found_from_where_it_is_saved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sites").mkdir()
    library = terratool.Definition()
    library.primitive("box", x=[1])
    (tmp_path / "sites/kit.json").write_text(library.text, "utf-8")
    made = terratool.Definition(size=3, use=[Path("kit.json")])
    made.root("box", v_scale=2)
    monkeypatch.chdir(tmp_path)
    assert "TT701" in {one.code for one in made.validate()}
    assert terratool.load(made.save(tmp_path / "sites/a.json")).height(1, 1) == 2
    monkeypatch.chdir(tmp_path / "sites")
    assert made.validate() == () and made.compile().height(1, 1) == 2


def test_findings_are_those_of_the_reader() -> None:
    """All of them, errors and warnings, in the order of the text."""
    made = yard()
    made.surface("mud")
    made.add("bax", cell=(12, 1), v_scale=0)
    found = made.validate()
    assert found == check(Source("the definition", made.text.encode())).findings
    assert {"TT201", "TT205"} <= {one.code for one in found}
    line = made.text.splitlines()[found[0].line - 1]
    assert '"mud"' in line


METHODS: list[tuple[type, Any, tuple[Any, ...]]] = [
    (Surface, lambda made, **keys: made.surface("s", **keys), ("surfTypes", "s")),
    (Primitive, lambda made, **keys: made.primitive("p", **keys), ("elemTypes", "p")),
    (Element, lambda made, **keys: made.add(**keys), ("elemTree", "children", 0)),
    (Element, lambda made, **keys: made.root("g").add(**keys), ("elemTree", "children", 0)),
    (Element, lambda made, **keys: made.part("q", **keys), ("parts", "q")),
    (Track, lambda made, **keys: made.track(**keys), ("tracks", 0)),
]


@pytest.mark.parametrize(("kind", "method", "place"), METHODS)
def test_each_key_of_the_text_has_a_name(kind: type, method: Any, place: tuple[Any, ...]) -> None:
    """With the examples of the table of keys, and no key that it does not have."""
    seen = 0
    for name, key in names_of(kind):
        for example in KEYS[kind][key].examples if key != "children" else ():
            made = terratool.Definition()
            method(made, **{name: example})
            found: Any = made.document
            for step in place:
                found = found[step]
            assert found == {key: example}
            seen += 1
    assert seen > 3


def test_a_terrain_has_the_keys_of_its_text() -> None:
    made = {"descr", "use", "size", "origin", "crs"}
    signature = inspect.signature(terratool.Definition)
    assert made == set(signature.parameters) - {"x_ignore", "x_why"}
    built = {"schema", "surf_types", "elem_types", "parts", "elem_tree", "tracks"}
    assert made | built == {name for name, _ in names_of(Definition)}


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda d: d.surface("clay", fricangle=3),
         "surface takes no 'fricangle'. Did you mean fric_angle?"),
        (lambda d: d.add("box", vScale=3), "add takes no 'vScale'. Did you mean v_scale?"),
        (lambda d: d.root().add("box", spn=3), "add takes no 'spn'. Did you mean span?"),
        (lambda d: d.add("box", scatter={"conut": 3}),
         "add's scatter takes no 'conut'. Did you mean count?"),
        (lambda d: d.surface("a", roughness={"rm": 3}),
         "surface's roughness takes no 'rm'. Did you mean rms?"),
        (lambda d: d.root("box", at=(1, 2)), "root takes no 'at'."),
        (lambda d: d.surface("sand"), "There is a surface 'sand' already."),
        (lambda d: d.part("pallet"), "There is a part 'pallet' already."),
        (lambda d: terratool.Definition(siz=3), "Definition takes no 'siz'. Did you mean size?"),
        (lambda d: d.add("box", cell=3), "cell is 3. Give column and row, as in cell=(3, 2)."),
        (lambda d: d.add("box", cell=(3, 2), cell_x=1),
         "The cell is given twice. Leave out cell_x and cell_y."),
    ],
)  # fmt: skip
def test_what_the_text_cannot_say_is_refused(call: Any, says: str) -> None:
    made = yard()
    with pytest.raises(terratool.RequestError) as error:
        call(made)
    assert says in str(error.value)
    assert made.text == YARD


def test_values_that_are_given_later_change_nothing() -> None:
    """What was given is copied, and what is asked for is a copy."""
    curve = [0.0, 1.0]
    made = terratool.Definition(size=3)
    made.primitive("ramp", x=curve)
    curve.append(5.0)
    made.document["elemTypes"]["ramp"]["x"].append(7.0)
    assert made.document["elemTypes"]["ramp"]["x"] == [0.0, 1.0]
    made.add("ramp", surface=object())  # type: ignore[arg-type]
    with pytest.raises(terratool.RequestError, match="cannot be written as JSON"):
        made.validate()


def faulty(second: str = "box") -> terratool.Definition:
    """A box in a hill, whose primitive does not exist if it is not called box."""
    yard = terratool.Definition(size=(20, 12))
    yard.primitive("box", x=[1])
    yard.root("box", cells=(10, 6))
    yard.add("box", cell=(0, 0))
    yard.add("box", cell=(4, 3), cells=2).add(second, cell=(1, 0), v_scale=2)
    return yard


def test_errors_say_where_by_the_pointer_and_not_by_lines_that_nobody_sees(tmp_path: Path) -> None:
    yard = faulty("bax")
    pointer = "/elemTree/children/1/children/0/type"
    calls = [yard.compile, lambda: terratool.load(yard), lambda: terratool.load(yard.document)]
    for call in calls:
        with pytest.raises(terratool.DefinitionError) as error:
            call()
        assert error.value.message.startswith(f"the definition: {pointer}: TT201: no primitive")
        assert error.value.findings[0].pointer == pointer
    path = tmp_path / "yard.json"
    with pytest.raises(terratool.DefinitionError) as error:
        yard.save(path)
    assert error.value.message.startswith(f"{path}: {pointer}: TT201")
    with pytest.raises(terratool.DefinitionError, match=r"^the definition: TT104: "):
        terratool.load({"size": 3})
    # a text that was given, and one in a file, have lines
    line = yard.text[: yard.text.index("bax")].count("\n") + 1
    path.write_text(yard.text)
    for form in (yard.text, yard.text.encode(), path):
        with pytest.raises(terratool.DefinitionError, match=rf":{line}:\d+: TT201"):
            terratool.load(form)


def test_an_element_is_taken_out_with_all_that_is_in_it() -> None:
    without = faulty()
    ends = [without.add("box", cell=(n, 5)) for n in (7, 8, 9)]
    whole = without.document
    inner = ends[1].add("box", cell=(0, 0))
    inner.remove()
    assert without.document == whole  # no empty list is left
    ends[1].add("box", cell=(0, 0))
    ends[1].remove()
    del whole["elemTree"]["children"][3]
    assert without.document == whole and repr(without).endswith("6 elements>")
    for gone in (ends[1], inner):
        with pytest.raises(terratool.RequestError, match="taken out already"):
            gone.remove()
    twin = without.add("box", cell=(9, 5))  # equal to another one, which stays
    twin.remove()
    assert without.document == whole
    part = without.part("pile", "box")
    part.add("box", cell=(0, 0)).remove()
    assert without.document["parts"] == {"pile": {"type": "box"}}
    part.remove()
    assert "parts" not in without.document and '"parts"' not in without.text
    root = without.root()
    root.remove()
    assert "elemTree" not in without.document


def test_nothing_is_added_to_what_is_taken_out() -> None:
    """Neither to an element itself, nor to one that stood in it, nor to a part or a root."""
    site = faulty()
    outer = site.add("box", cell=(7, 5))
    inner = outer.add("box", cell=(0, 0)).add("box", cell=(0, 0))
    part, root = site.part("pile", "box"), site.root()
    outer.remove(), part.remove()
    left = site.document
    says = r"^The element has been taken out already\. Add to another one\.$"
    for gone in (outer, inner, part):
        with pytest.raises(terratool.RequestError, match=says):
            gone.add("box", cell=(1, 1))
    root.add("box", cell=(8, 5)).remove()
    assert site.document == left
    root.remove()
    site.part("pile", "box"), site.root("box")  # others of these names
    for gone in (part, root):
        with pytest.raises(terratool.RequestError, match=says):
            gone.add("box", cell=(1, 1))


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int16])
def test_grids_are_arrays_or_lists(dtype: Any) -> None:
    """Rows from the north; what is no number is void, and masked numbers are."""
    rows: list[list[Any]] = [[1, 2, 3], [4, 5, 6]]
    heights = np.array(rows, dtype)
    if dtype != np.int16:
        heights[1, 0], rows[1][0] = np.nan, None
    definition = terratool.Definition(size=(6, 3))
    definition.primitive("array", grid=heights)
    definition.primitive("list", grid=[[1, 2, 3], [4, float("nan"), 6]], registration="pixel")
    definition.primitive("single", grid=[[1, 2], [np.float32(3), np.float32("nan")]])
    definition.primitive("masked", grid=np.ma.masked_equal(np.array([[1, 9], [3, 4]]), 9))
    types = definition.document["elemTypes"]
    assert types["array"]["grid"] == rows
    assert types["list"]["grid"] == [[1, 2, 3], [4, None, 6]]
    assert types["single"]["grid"] == [[1, 2], [3, None]]
    assert types["masked"]["grid"] == [[1, None], [3, 4]]
    definition.root("array", v_scale=1)
    terrain = definition.compile()
    assert terrain.height(6, 3) == 3 and terrain.height(6, 0) == 6


@pytest.mark.parametrize("grid", ["rows", [1, 2], {"rows": 1}, 7, np.zeros(3)])
def test_what_is_no_grid_is_refused_by_the_reader(grid: Any) -> None:
    definition = terratool.Definition(size=(6, 3))
    definition.primitive("dem", grid=grid)
    definition.root("dem")
    findings = definition.validate()
    assert any(finding.pointer.startswith("/elemTypes/dem/grid") for finding in findings)
