"""The best mesh with no more than so many faces."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from terratool.errors import RequestError
from terratool.mesh import export
from terratool.mesh.build import build
from terratool.mesh.types import BuiltMesh, PlanLoss
from tests.conftest import terrain_of
from tests.meshes import HILL, box, crowd, errors, exported, flat, read


@pytest.mark.nightly
@pytest.mark.parametrize("most", [6_000, 4_000, 1_200, 300, 2])
def test_faces_are_limited(tmp_path: Path, most: int) -> None:
    """The statement holds for what somebody else finds in the file, whatever was left out."""
    terrain = crowd()
    report = exported(terrain, tmp_path / "a.ply", 0.001, most)
    mesh, statement = read(tmp_path / "a.ply"), report.statement
    assert len(mesh.faces) == report.faces <= most
    aside = statement.wall_offset + 2e-6
    found = errors(mesh, terrain, 20_000, statement.miss, aside)
    # what is left out is measured at points; there may be more between them
    assert np.quantile(found, 0.999) <= statement.miss + 1e-5
    assert found.max() <= 1.1 * statement.miss + 1e-5
    left = statement.left
    assert (left.change is None) == (left.faint == 0)
    if left.faint:
        assert left.faintest <= 5.0 * statement.allowed
        assert found.max() > 0.5 * statement.miss
        assert f"{left.faint} elements left out to keep to" in "".join(statement.sentences())
    else:
        assert statement.miss == statement.error and report.faces > 0.7 * most


def test_enough_faces_change_nothing(tmp_path: Path) -> None:
    terrain = crowd()
    free = exported(terrain, tmp_path / "a.ply", 0.05)
    bound = exported(terrain, tmp_path / "b.ply", 0.05, free.faces)
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()
    assert structs.replace(bound.statement, max_faces=None) == free.statement
    fewer = exported(terrain, tmp_path / "c.ply", 0.05, free.faces - 1)
    assert fewer.faces < free.faces and fewer.statement.allowed > 0.05


def test_smooth_ground_gets_nearly_all_faces(tmp_path: Path) -> None:
    """The error grows no more than it has to."""
    terrain = terrain_of({**HILL, "elemTree": {"type": "bell", "vScale": 5}})
    sizes = {}
    for most in (20_000, 5_000, 500):
        report = exported(terrain, tmp_path / f"{most}.ply", 1e-5, most)
        assert 0.9 * most < report.faces <= most
        assert report.statement.left.faint == 0
        sizes[most] = report.statement.error
    # faces are as the inverse of the error
    assert 2.5 < sizes[5_000] / sizes[20_000] < 6
    assert 6 < sizes[500] / sizes[5_000] < 16


def test_the_lowest_elements_are_left_out(tmp_path: Path) -> None:
    """Of boxes no error makes fewer faces: the highest ones stay, exactly."""
    heights = {(x, y): round(0.1 + 0.01 * (10 * x + y), 2) for x in range(10) for y in range(10)}
    alone = {place: height for place, height in heights.items() if sum(place) % 2}
    terrain = flat(*(box(*place, height) for place, height in alone.items()))
    all_faces = exported(terrain, tmp_path / "a.ply", 0.01).faces
    report = exported(terrain, tmp_path / "b.ply", 0.01, all_faces // 2)
    left = report.statement.left
    gone = sorted(alone.values())[: left.faint]
    assert 0 < left.faint < len(alone)
    assert left.faintest == gone[-1] == pytest.approx(report.statement.miss)
    assert left.change and left.change.size == pytest.approx(gone[-1])
    place = int(left.change.x), int(left.change.y)
    assert alone[place] == gone[-1]
    kept = len(alone) - left.faint
    mesh = read(tmp_path / "b.ply")
    tops = {round(float(z), 2) for z in mesh.vertices[:, 2]} - {0}
    assert tops == set(sorted(alone.values())[left.faint :]) and len(tops) == kept
    assert report.statement.error == pytest.approx(0, abs=1e-12)


def test_pebbles_go_before_the_hill_does(tmp_path: Path) -> None:
    """An error for all that spoils the ground is worse than leaving out what is low."""
    hill = {"type": "bell", "cellX": 0, "cellY": 0, "span": [10, 10], "vScale": 5}
    pebbles = [box(x, y, 0.05) for x in range(0, 10, 2) for y in range(0, 10, 2)]
    report = exported(flat(hill, *pebbles), tmp_path / "a.ply", 0.01, 300)
    assert report.faces <= 300
    assert report.statement.left.faint == len(pebbles)
    assert report.statement.miss < 0.2


@pytest.mark.parametrize("wanted", [1e-6, 0.001, 0.03])
def test_the_best_of_several_bargains(wanted: float) -> None:
    """Ground whose faces are as the inverse of the error, and pebbles that cost 400 faces."""
    tries = []

    def attempt(error: float, least: float) -> Any:
        tries.append(error)
        pebbles = least < 0.05
        faces = range(round(10 + 10 / error + 400 * pebbles))
        mesh: Any = SimpleNamespace(faces=faces)
        loss = PlanLoss() if pebbles else PlanLoss(faint=40, faintest=0.05)
        return BuiltMesh(mesh, 0, error, loss)

    def fitted(most: int) -> export.BudgetedMesh:
        tries.clear()
        fit = export.within_budget(attempt, wanted, 5.0, 5.0, most)
        assert fit.faces <= most and len(tries) <= 3 * export.BUILDS
        assert max(10 / error for error in tries) <= max(10 * most, 10 / wanted)
        return fit

    # all stay at an error of 0.33, or the pebbles go at 0.024
    fit = fitted(440)
    assert fit.built.loss.faint == 40 and fit.miss < max(0.08, wanted + 0.06)
    assert fit.error >= wanted
    # at an error of 0.1 they may stay
    fit = fitted(520)
    assert fit.built.loss.faint == 0 and 0.09 < fit.miss < 0.11
    enough = round(411 + 10 / wanted)
    assert fitted(enough).error == wanted


def test_holes_stay(tmp_path: Path) -> None:
    """A hole is more than a change of heights, however little its own height is."""
    pebbles = [box(x, y, 0.2) for x in range(0, 10, 2) for y in range(0, 10, 2)]
    terrain = flat(*pebbles, {**box(5, 5, 0.001), "surface": "hole"})
    report = exported(terrain, tmp_path / "a.ply", 0.01, 20)
    assert report.statement.left.faint == len(pebbles)
    mesh = read(tmp_path / "a.ply")
    a, b, c = (mesh.vertices[mesh.faces[:, k], :2] for k in range(3))
    (u, v) = (b - a, c - a)
    area = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2
    assert area == pytest.approx(99, rel=1e-6)


def test_a_limit_that_cannot_be_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One is told the least that is possible, after a bounded number of tries."""
    tries = []

    def counting(*arguments: Any, **options: Any) -> Any:
        tries.append(arguments[1])
        return build(*arguments, **options)

    monkeypatch.setattr(export, "build_all", counting)
    for terrain, least in ((crowd(), 2), (flat({**box(5, 5, 1), "surface": "hole"}), 8)):
        tries.clear()
        with pytest.raises(RequestError, match=rf"has {least} faces at least, and 1 are allowed"):
            exported(terrain, tmp_path / "a.ply", 0.001, 1)
        assert len(tries) <= 3 * export.BUILDS
    assert exported(crowd(), tmp_path / "a.ply", 1e9, 2).faces == 2
    (path,) = tmp_path.iterdir()
    assert path.name == "a.ply"
