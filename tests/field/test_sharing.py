"""Parts that are shared by the places they stand in answer as parts that are written out."""

from __future__ import annotations

import json
import math
import pickle
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.definition.reader import Checked, check, load_checked
from terratool.field.terrain import OUTSIDE, Terrain
from terratool.text.source import Source
from tests.filesets import FileSet, file_sets, save

ALWAYS = -1
Json = dict[str, Any]


def checked(definition: Json) -> Checked:
    found = check(Source("terrain.json", json.dumps(definition).encode()))
    assert found.terrain is not None, found.findings
    return found


def both(definition: Json) -> tuple[Terrain, Terrain]:
    """A terrain whose parts are shared, and the same written out."""
    shared, plain = Terrain(checked(definition), share_above=ALWAYS), Terrain(checked(definition), share_above=math.inf)
    assert shared.is_shared and not plain.is_shared
    return shared, plain


def telling_points(plain: Terrain, seed: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Points anywhere, and on and next to the corners, edges and middles of all elements."""
    rng = np.random.default_rng(seed)
    west, south, east, north = plain.bounds
    cells = plain.footprints()
    x = np.concatenate([cells[0], cells[2], (cells[0] + cells[2]) / 2])
    y = np.concatenate([cells[1], cells[3], (cells[1] + cells[3]) / 2])
    x = np.concatenate([x, np.nextafter(x, -np.inf), np.nextafter(x, np.inf)])
    y = np.concatenate([y, np.nextafter(y, -np.inf), np.nextafter(y, np.inf)])
    x, y = rng.choice(x, 600), rng.choice(y, 600)
    within = rng.integers(0, cells.shape[1], 600)
    inside = rng.uniform(0, 1, (2, 600))
    x = np.concatenate([x, rng.uniform(west, east, 200), cells[0][within] * (1 - inside[0]) + cells[2][within] * inside[0]])
    y = np.concatenate([y, rng.uniform(south, north, 200), cells[1][within] * (1 - inside[1]) + cells[3][within] * inside[1]])
    return x, y


def compare(shared: Terrain, plain: Terrain, seed: int = 0) -> None:
    x, y = telling_points(plain, seed)
    np.testing.assert_array_equal(shared.height(x, y), plain.height(x, y))
    one, other = shared.sample(x, y), plain.sample(x, y)
    np.testing.assert_array_equal(one.height, other.height)
    np.testing.assert_array_equal(one.normal, other.normal)
    np.testing.assert_array_equal(shared.surface(x, y), plain.surface(x, y))
    np.testing.assert_array_equal(shared.surface_of(one.element), one.surface)
    assert shared.locate(x, y).tolist() == plain.locate(x, y).tolist()
    assert shared.elements == plain.elements
    assert shared.levels == plain.levels
    assert shared.smallest_cell == plain.smallest_cell
    assert shared.count_by_primitive() == plain.count_by_primitive()
    assert shared.count_by_surface() == plain.count_by_surface()


@settings(max_examples=200, deadline=None)
@given(files=file_sets(), seed=st.integers(0, 99))
def test_shared_parts_answer_as_those_written_out(
    files: FileSet, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Heights, normals, surfaces and names are the same to the bit."""
    path = save(files, tmp_path_factory.mktemp("set"))
    found = load_checked(path, (str(path.parent.parent),))
    plain = Terrain(found, share_above=math.inf)
    shared = Terrain(found, share_above=ALWAYS)
    compare(shared, plain, seed)
