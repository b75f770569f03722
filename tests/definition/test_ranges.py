"""Ranges in the figures of soils: what counts where one number is wanted, layout, and mending."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition.layout import canonical
from terratool.definition.model import ends_of, middle_of
from terratool.definition.presets import property_of
from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.raster.layers import LAYERS, SurfaceValues
from terratool.text.source import Source
from tests.commands import call

RANGED = {
    "cohesion": [0.5, 1.5], "fricAngle": [24, 31], "sinkage": [0.1, 0.2],
    "shearModulus": [0.01, 0.025],
}  # fmt: skip
MIDDLES = {"cohesion": 1, "fricAngle": 27.5, "sinkage": 0.15, "shearModulus": 0.0175}


def definition(soil: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {
        "size": [12, 7],
        "surfTypes": {"sand": soil},
        "elemTypes": {"box": {"x": [1]}},
        "elemTree": {"type": "box", "surface": "sand", "vScale": 1},
        **more,
    }


def terrain(text: dict[str, Any]) -> Terrain:
    checked = check(Source("t.json", json.dumps(text).encode()))
    assert not checked.findings
    return Terrain(checked)


FIGURES = st.floats(1e-300, 1e308) | st.just(0.0)


@given(FIGURES, FIGURES)
def test_the_middle_lies_between_the_ends(one: float, other: float) -> None:
    """It is finite, and that of equal ends is the number itself."""
    low, high = sorted((one, other))
    assert low <= middle_of((low, high)) <= high
    assert middle_of((low, low)) == low
    assert middle_of(low) == low
    assert ends_of(low) == (low, low)
    assert ends_of((low, high)) == (low, high)


def test_heights_of_tracks_are_those_of_the_middle() -> None:
    """A track by its load sinks by the middle of the range."""
    tracks = [{"path": [[1, 3], [11, 3]], "width": 0.4, "load": 0.5}]
    ground, plain = (terrain(definition(s, tracks=tracks)) for s in (RANGED, MIDDLES))
    x, y = np.meshgrid(np.linspace(0, 12, 50), np.linspace(0, 7, 36))
    assert ground.height(5, 3) == pytest.approx(1 - 0.5 * 0.15)
    np.testing.assert_allclose(ground.height(x, y), plain.height(x, y), rtol=1e-15)


@pytest.mark.parametrize("layer", ["cohesion", "friction", "sinkage"])
def test_layers_have_the_middle(layer: str) -> None:
    values, plain = (
        SurfaceValues(terrain(definition(s))).values(LAYERS[layer], np.dtype(np.float64))
        for s in (RANGED, MIDDLES)
    )
    np.testing.assert_allclose(values, plain, rtol=1e-15)


def test_a_range_counts_instead_of_the_preset() -> None:
    sand = terrain(definition({"preset": "dry-sand", "fricAngle": [20, 31]})).surface_types["sand"]
    assert property_of(sand, "fric_angle") == 25.5
    assert property_of(sand, "cohesion") == 1.04
    assert sand.ranges == {"fric_angle": (20.0, 31.0)}


def test_a_void_has_no_ranges() -> None:
    """Nobody can drive where there is no ground, whatever it were."""
    ground = terrain(
        definition(
            {"void": True, "cohesion": [1, 2]},
            elemTree={"type": "box", "surface": "sand", "vScale": 1},
        )
    )
    assert not ground.surface_types["sand"].ranges


def test_ranges_stand_on_one_line() -> None:
    """The canonical layout keeps the two numbers together, in the order of the figures' keys."""
    text = json.dumps(
        definition({key: RANGED[key] for key in sorted(RANGED, reverse=True)}), indent=4
    )
    laid = canonical(text)
    line = (
        '"sand": { "cohesion": [0.5, 1.5], "fricAngle": [24, 31], "sinkage": [0.1, 0.2], '
        '"shearModulus": [0.01, 0.025] }'
    )
    assert line in laid
    assert canonical(laid) == laid


def test_fix_writes_one_number_for_equal_ends(tmp_path: Path) -> None:
    """That is all that it changes, and then nothing is left to say."""
    path = tmp_path / "t.json"
    soil = {"cohesion": 1.04, "fricAngle": [28.5, 28.5], "sinkage": [1e-5, 0.00001]}
    path.write_text(json.dumps(definition(soil)))
    assert call("validate", path, "--fix").code == 0
    assert json.loads(path.read_text()) == definition(
        {"cohesion": 1.04, "fricAngle": 28.5, "sinkage": 1e-5}
    )
    assert call("validate", path, "--strict").code == 0


def test_findings_name_the_very_end_in_sarif(tmp_path: Path) -> None:
    """Each end has its place in the formats for machines."""
    path = tmp_path / "t.json"
    path.write_text(json.dumps(definition({**RANGED, "fricAngle": [25, 95]}), indent=1))
    found = json.loads(call("validate", path, "--format", "sarif").out)["runs"][0]["results"]
    assert [one["ruleId"] for one in found] == ["TT106"]
    region = found[0]["locations"][0]["physicalLocation"]["region"]
    lines = path.read_text().splitlines()
    assert lines[region["startLine"] - 1][region["startColumn"] - 1 :] == "95"
