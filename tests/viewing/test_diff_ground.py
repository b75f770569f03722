"""Volumes, areas and places of differences against sums of the slow reading of the format."""

from __future__ import annotations

import json
import math
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from terratool.errors import TerratoolError
from terratool.viewing.diff import ground
from terratool.viewing.diff.compare import DiffOptions, diff
from terratool.viewing.diff.results import Difference
from terratool.viewing.diff.sides import DiffSide, read_side
from tests import composition
from tests.budget import examples
from tests.edits import Files, edited
from tests.filesets import MAIN, file_sets
from tests.oracle import Answer, Oracle
from tests.strategies import box, definitions

EXAMPLES = examples(60)
TOLERANCE = 0.01
PIXELS = 6
"""Along the longer side: the oracle is slow."""
MEAN = 1e-6
"""So much may heights be off on average."""


class Pixel(NamedTuple):
    old: Answer
    new: Answer

    @property
    def change(self) -> float:
        return self.new.z - self.old.z


def saved(files: Files, folder: Path) -> str:
    for name, value in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(value), "utf-8")
    return str(folder / (MAIN if MAIN in files else "terrain.json"))


def meaning(files: Files) -> dict[str, Any]:
    """The files as one definition without parts and copies."""
    if MAIN not in files:
        return files["terrain.json"]
    return composition.plain(
        {name: json.dumps(value) for name, value in files.items()}, MAIN
    ).definition


def side(files: Files, folder: Path) -> DiffSide | None:
    """The definition, None where an edit has spoilt it."""
    try:
        return read_side(saved(files, folder), called=None, roots=(str(folder),), roughness=True)
    except TerratoolError:
        return None


def pixels(old: dict[str, Any], new: dict[str, Any], resolution: float) -> dict[Any, Pixel]:
    """What both have at the centres of pixels, which are counted from the south-west."""
    (west, width), (south, height) = box(new)
    before, after = Oracle(old), Oracle(new)
    # pixels with their centres clearly within, as for rasters
    columns, rows = (
        sum(
            (k + 0.5) * resolution < float(side) * (1 - 1e-9)
            for k in range(2 + int(float(side) / resolution))
        )
        for side in (width, height)
    )
    found = {}
    for row in range(rows):
        for column in range(columns):
            x = float(west) + (column + 0.5) * resolution
            y = float(south) + rows * resolution - (rows - 1 - row + 0.5) * resolution
            for oracle in (before, after):
                # on the edge of a turned rectangle or a disc, where rounding decides
                assume(oracle.margin(x, y, cells=False) > 1e-9)
            found[x, y] = Pixel(before.at(x, y), after.at(x, y))
    return found


def resolution_of(definition: dict[str, Any]) -> float:
    """A side of a pixel of which there are whole ones along the shorter side."""
    (_, width), (_, height) = box(definition)
    shorter, longer = sorted([float(width), float(height)])
    return shorter / max(1, round(PIXELS * shorter / longer))


@pytest.mark.nightly
@settings(max_examples=EXAMPLES)
@given(st.data())
def test_edits_change_what_the_format_says(data: st.DataObject) -> None:
    """Sums over the whole terrain, though what cannot differ is not looked at."""
    if data.draw(st.booleans(), label="parts"):
        texts = data.draw(file_sets()).texts
        files = {name: json.loads(text) for name, text in texts.items()}
    else:
        rutted, free = data.draw(st.booleans()), data.draw(st.booleans())
        files = {"terrain.json": data.draw(definitions(rutted=rutted, free=free))}
    changed = data.draw(edited(files))
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(ground, "SIDE", 2)  # so that there are windows to leave out
        old, new = side(files, Path(folder, "old")), side(changed, Path(folder, "new"))
        assume(old is not None and new is not None)
        assert old is not None
        assert new is not None
        resolution = resolution_of(meaning(changed))
        options = DiffOptions(min_change=TOLERANCE, resolution=resolution)
        found = diff(old, new, options).difference
    seen = pixels(meaning(files), meaning(changed), resolution)
    assert_holds(found, seen, resolution)


def assert_holds(found: Difference, seen: dict[Any, Pixel], resolution: float) -> None:
    area = resolution**2
    known = {at: one.change for at, one in seen.items() if math.isfinite(one.change)}
    slack = MEAN * area * sum(max(1.0, abs(change)) for change in known.values())
    fill = area * math.fsum(change for change in known.values() if change > 0)
    cut = -area * math.fsum(change for change in known.values() if change < 0)
    lost, gained, pairs = 0, 0, {}
    for one in seen.values():
        lost += math.isfinite(one.old.z) and math.isnan(one.new.z)
        gained += math.isnan(one.old.z) and math.isfinite(one.new.z)
        ground_there = math.isfinite(one.old.z) or math.isfinite(one.new.z)
        if one.old.surface != one.new.surface and ground_there:
            pair = one.old.surface, one.new.surface
            pairs[pair] = pairs.get(pair, 0) + 1
    told = found.ground
    if told is None:
        assert found.same
        assert max(cut, fill) <= slack
        assert not (lost or gained)
        renamed = " ".join(found.notes)
        assert all(f" {old} is called {new} " in renamed for old, new in pairs)
        return
    assert told.cut == pytest.approx(cut, abs=slack)
    assert told.fill == pytest.approx(fill, abs=slack)
    assert told.lost == pytest.approx(lost * area)
    assert told.gained == pytest.approx(gained * area)
    beyond = [sum(abs(c) > TOLERANCE + off for c in known.values()) for off in (MEAN, -MEAN)]
    assert beyond[0] * area * (1 - 1e-12) <= told.changed <= beyond[1] * area * (1 + 1e-12)
    most = max(map(abs, known.values()), default=0.0)
    if told.largest is None:
        assert most <= MEAN
    else:
        assert abs(told.largest.change) == pytest.approx(most, abs=2 * MEAN * max(1.0, most))
        at = min(known, key=lambda p: math.dist(p, (told.largest.x, told.largest.y)))
        assert told.largest.change == pytest.approx(known[at], abs=2 * MEAN * max(1.0, most))
    areas = {(one.old, one.new): one.area / area for one in told.surfaces}
    for (was, now), count in pairs.items():
        renamed = f" {was} is called {now} " in " ".join(found.notes)
        assert renamed or areas.get((was, now), 0.0) == pytest.approx(count), (was, now)
    assert sum(areas.values()) <= sum(pairs.values()) + 1e-6
