"""The notebook of the samples runs from its first cell to its last, and shows what it says."""

from __future__ import annotations

import ast
import json
from typing import Any

import pytest

from tests.commands import ROOT

NOTEBOOK = json.loads((ROOT / "samples/notebook.ipynb").read_text("utf-8"))


def run_cell(source: str, names: dict[str, Any]) -> Any:
    """Run a cell as Jupyter does: the value of its last line, if that is an expression."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    return (
        None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    )


@pytest.mark.slow
def test_all_cells_run(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a folder of its own, without the net; what a cell shows is what Jupyter would show."""
    pytest.importorskip("matplotlib")
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    names: dict[str, Any] = {}
    cells = ["".join(one["source"]) for one in NOTEBOOK["cells"] if one["cell_type"] == "code"]
    values = [run_cell(cell, names) for cell in cells]
    assert values[1] == ()  # nothing to remark on
    assert values[2]._repr_html_().count("<tr>") == 5 and values[2]._repr_png_()
    assert values[3].shape == (5, 7) and values[3].max() == pytest.approx(0.75)
    assert values[4] == ("concrete", "/elemTree/children/1")
    assert values[5]._repr_html_().startswith("<iframe")
    assert values[6].get_size_inches().max() * values[6].dpi == pytest.approx(900)
    assert values[7][0] == (80, 120) and "sim" in values[7][2]
    verdict, found, length = values[8]
    assert verdict in ("go", "caution") and found and 8.5 <= length < 12
    assert values[9][0] > 500
    assert values[10][0] == 1 and values[10][1] == pytest.approx(0.5, abs=0.01)
    again, terrain = names["again"], names["terrain"]
    x, y = (0.5 * (values + 1) for values in (3.0, 5.0))
    assert abs(again.height(x, y) - terrain.height(x, y)) <= 0.011


def test_it_is_kept_without_outputs() -> None:
    """So that a change of a cell is one of its lines."""
    for cell in NOTEBOOK["cells"]:
        assert cell.get("outputs", []) == [] and cell.get("execution_count") is None


def test_pages_that_name_it_say_what_it_needs() -> None:
    for page in ("docs/api.md", "docs/samples.md"):
        text = (ROOT / page).read_text("utf-8")
        assert "`pip install jupyterlab matplotlib`" in text, page
