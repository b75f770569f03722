"""Terrains that are too fine for simulators at the default error."""

from __future__ import annotations

import re

import numpy as np
import pytest

from terratool.errors import RequestError
from terratool.mesh.build import build
from terratool.simulators import scene
from terratool.simulators.options import SceneOptions
from terratool.simulators.scene import Scene
from tests.conftest import terrain_of


def test_a_mesh_that_is_too_large_is_refused_with_an_error_that_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(scene, "_MOST_FACES", 4000)
    monkeypatch.setattr(scene, "_MANY_FACES", 1000)
    rows = np.random.default_rng(2).normal(size=(50, 70)).cumsum(0).cumsum(1) / 100
    grid = {"grid": rows.round(4).tolist()}
    definition = {
        "size": [14, 10],
        "elemTypes": {"g": grid},
        "elemTree": {"type": "g", "vScale": 1},
    }
    terrain = terrain_of(definition)
    with pytest.raises(RequestError, match=r"about [\d,]+ triangles") as caught:
        Scene(terrain, "it", SceneOptions(max_error=0.001)).built_mesh  # noqa: B018
    (proposed,) = re.findall(r"--max-error ([\d.]+),", caught.value.hint)
    faces = len(build(terrain, float(proposed)).mesh.faces)
    assert 20 < faces < 2500
    assert len(Scene(terrain, "it", SceneOptions(max_error=float(proposed))).built_mesh.mesh.faces)
