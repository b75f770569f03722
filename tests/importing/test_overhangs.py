"""Meshes with overhangs: ground and decks whose columns are those of the mesh."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.field.terrain import Terrain, load
from terratool.importing.sampling import sample
from terratool.importing.terrain.build import import_terrain
from terratool.importing.terrain.rectangles import around
from terratool.importing.terrain.request import ImportOptions, ImportReport
from terratool.importing.types import Triangles
from tests.commands import ROOT
from tests.commands import call as run

Solid = list[tuple[float, float]]
Columns = Callable[[float, float], Solid]
WIDE, DEEP = 14.0, 9.0


def mesh_of(points: Any, faces: Any) -> Triangles:
    return Triangles(np.array(points, np.float64), np.array(faces, np.int32).reshape(-1, 3))


def joined(*meshes: Triangles) -> Triangles:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return mesh_of(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def flipped(mesh: Triangles) -> Triangles:
    return mesh_of(mesh.vertices, mesh.faces[:, ::-1])


def ground(x: Any, y: Any) -> Any:
    """A plane, which an import keeps to within the rounding of its rows."""
    return 0.05 * x - 0.03 * y + 0.2


def sheet(height: Callable[..., Any], west=0.0, south=0.0, east=WIDE, north=DEEP) -> Triangles:
    """An open sheet over a rectangle, linear in it."""
    corners = [(west, south), (east, south), (east, north), (west, north)]
    return mesh_of([(x, y, height(x, y)) for x, y in corners], [(0, 1, 2), (0, 2, 3)])


def slab(
    middle: tuple[float, float], sides: tuple[float, float], top: Any, under: Any, turn: float = 0.0
) -> Triangles:
    """A closed body between two planes of x and y, turned clockwise by degrees."""
    a = math.radians(turn)
    corners = []
    for u, v in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)):
        along, across = u * sides[0], v * sides[1]
        x = middle[0] + along * math.cos(a) + across * math.sin(a)
        y = middle[1] - along * math.sin(a) + across * math.cos(a)
        corners.append((x, y))
    points = [(x, y, face(x, y)) for face in (under, top) for x, y in corners]
    quads = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return mesh_of(points, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def level(z: float) -> Callable[..., Any]:
    return lambda x, y: z + 0.0 * x


def held(
    x: Any, y: Any, middle: tuple[float, float], sides: tuple[float, float], turn: float = 0.0
) -> tuple[Any, Any]:
    """Whether points lie in a turned rectangle, and their distance from its rim."""
    a = math.radians(turn)
    dx, dy = x - middle[0], y - middle[1]
    along, across = dx * math.cos(a) - dy * math.sin(a), dx * math.sin(a) + dy * math.cos(a)
    inside = np.minimum(sides[0] / 2 - np.abs(along), sides[1] / 2 - np.abs(across))
    return inside > 0, np.abs(inside)


def imported(
    mesh: Triangles, folder: Path, error: float = 0.01, pixel: float = 0.25, **options: Any
) -> tuple[Terrain, ImportReport]:
    path = folder / "t.json"
    heights = sample(mesh, pixel, decks=True)
    options = {"structures": False, **options}
    report = import_terrain(heights, path, ImportOptions(error, **options), overwrite=True)
    return load(path), report


def columns(terrain: Terrain, x: Any, y: Any) -> list[Solid]:
    found = terrain.column(x, y)
    return [
        [(a, b) for a, b in zip(low, high, strict=True) if not math.isnan(b)]
        for low, high in zip(found.bottom.tolist(), found.top.tolist(), strict=True)
    ]


def check(terrain: Terrain, x: Any, y: Any, wanted: list[Solid], error: float) -> None:
    """The same intervals at points, each end within the error."""
    for at, here, there in zip(zip(x, y, strict=True), columns(terrain, x, y), wanted, strict=True):
        assert len(here) == len(there), (at, here, there)
        for (low, high), (bottom, top) in zip(here, there, strict=True):
            assert abs(high - top) <= error, (at, here, there)
            assert low == bottom or abs(low - bottom) <= error, (at, here, there)


def places(count: int = 800, seed: int = 3) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    random = np.random.default_rng(seed)
    return random.uniform(0.01, WIDE - 0.01, count), random.uniform(0.01, DEEP - 0.01, count)


def tilted(x: Any, y: Any) -> Any:
    return 3.0 + 0.1 * x + 0.02 * y


@pytest.mark.parametrize("turn", [0.0, 23.0, -71.5])
@pytest.mark.parametrize(
    ("top", "under"),
    [
        (level(3.2), level(2.75)),
        (tilted, lambda x, y: tilted(x, y) - 0.3),
        (tilted, level(2.5)),
    ],
)
def test_slabs_come_back_as_one_rectangle(
    turn: float, top: Any, under: Any, tmp_path: Path
) -> None:
    """Oblong, off the middle, turned, level or sloped: exact at random points, not at pixels."""
    middle, sides = (6.2, 4.1), (6.6, 2.3)
    mesh = joined(sheet(ground), slab(middle, sides, top, under, turn))
    terrain, report = imported(mesh, tmp_path)
    assert report.decks is not None
    assert (report.decks.rectangles, report.decks.grids, report.decks.other) == (1, 0, 0)
    assert max(report.decks.top, report.decks.under) <= 0.01
    x, y = places()
    inside, rim = held(x, y, middle, sides, turn)
    clear = rim > 1e-3
    assert 50 < np.count_nonzero(inside) < 300
    wanted = [
        [(-math.inf, ground(a, b))] + [(under(a, b), top(a, b))] * bool(one)
        for a, b, one in zip(x, y, inside, strict=True)
    ]
    kept = [solid for solid, one in zip(wanted, clear, strict=True) if one]
    check(terrain, x[clear], y[clear], kept, 0.01)


def test_a_mirrored_mesh_is_mirrored(tmp_path: Path) -> None:
    """Mirrored vertices turn all faces inside out; the columns are those of the mirror image."""
    middle, sides, turn = (4.2, 3.1), (5.0, 1.4), 20.0
    mesh = joined(sheet(ground), slab(middle, sides, level(3), level(2.5), turn))
    mirror = mesh_of(mesh.vertices * (-1, 1, 1) + (WIDE, 0, 0), mesh.faces)
    terrain, report = imported(mirror, tmp_path)
    assert report.decks is not None
    assert [note for note in report.notes if "vertical" not in note] == []
    x, y = places()
    inside, rim = held(WIDE - x, y, middle, sides, turn)
    other, _ = held(x, y, middle, sides, turn)
    assert (inside != other).any()
    clear = rim > 1e-3
    found = np.array([len(solid) for solid in columns(terrain, x, y)])
    assert np.array_equal(found[clear] == 2, inside[clear])


def arch(x: Any, y: Any) -> tuple[Any, Any]:
    """Top and underside of an arch that is bent along both axes; the underside dips below 0."""
    top = 3.0 + 0.4 * np.sin(0.5 * x) + 0.1 * y
    return top, 2.6 - 0.16 * (x - 6.5) ** 2 - 0.02 * (y - 5) ** 2


def arch_mesh() -> Triangles:
    x, y = np.meshgrid(np.linspace(2, 11, 37), np.linspace(3, 7, 17))
    top, under = arch(x, y)
    rows, wide = x.shape
    number = np.arange(rows * wide).reshape(rows, wide)
    a, b, c, d = (
        part.ravel()
        for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    )
    tops = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    ring = np.concatenate([number[0], number[1:, -1], number[-1, -2::-1], number[-2:0:-1, 0]])
    rim = [
        face
        for p, q in zip(ring, np.roll(ring, -1), strict=True)
        for face in ((p + number.size, q + number.size, q), (p + number.size, q, p))
    ]
    points = [np.stack([x, y, z], -1).reshape(-1, 3) for z in (top, under)]
    return mesh_of(np.concatenate(points), np.concatenate([tops, tops[:, ::-1] + number.size, rim]))


@pytest.mark.parametrize("as_", ["rows", "grid"])
def test_an_arch_has_an_underside_of_its_own(as_: Any, tmp_path: Path) -> None:
    """The feet of the arch stand in the ground, which is what is solid below them."""
    terrain, report = imported(
        joined(sheet(level(0.5)), arch_mesh()), tmp_path, 0.02, 0.125, as_=as_
    )
    assert report.decks is not None
    assert report.decks.grids == 1
    assert report.decks.rectangles == 0
    assert report.decks.other == 0
    assert 0 < max(report.decks.top, report.decks.under) <= 0.02
    decks = [
        one
        for one in json.loads((tmp_path / "t.json").read_text())["elemTree"]["children"]
        if "deck" in one
    ]
    assert [set(one["deck"]) for one in decks] == [{"under", "vScale", "vOffset", "datum"}]
    x, y = (one.ravel() for one in np.meshgrid(np.arange(0.0625, WIDE, 0.125),
                                               np.arange(0.0625, DEEP, 0.125)))  # fmt: skip
    top, under = arch(x, y)
    on = (np.abs(x - 6.5) < 4.5) & (np.abs(y - 5) < 2)
    # the mesh is straight between points of the arch: off by an eighth of bend times step squared
    sag = 0.25**2 / 8 * 0.4
    clear = np.abs(under - 0.5) > 0.02 + sag
    wanted = [
        [(-math.inf, 0.5)] if not one else
        [(-math.inf, t)] if u < 0.5 else [(-math.inf, 0.5), (u, t)]
        for one, t, u in zip(on, top, under, strict=True)
    ]  # fmt: skip
    kept = [solid for solid, one in zip(wanted, clear, strict=True) if one]
    assert {len(solid) for solid in kept} == {1, 2}
    check(terrain, x[clear], y[clear], kept, 0.02 + sag)


def test_two_shelves_and_a_post(tmp_path: Path) -> None:
    """Shelves that a post passes are one rectangle each; a pallet on one of them is another."""
    shelves = [slab((5, 4), (6, 1.5), level(z), level(z - 0.1)) for z in (1.25, 2.5)]
    post = slab((3, 4.2), (0.5, 0.5), level(3), level(-1))
    pallet = slab((6.5, 3.75), (1, 0.75), level(1.75), level(1.25))
    terrain, report = imported(joined(sheet(level(0)), *shelves, post, pallet), tmp_path)
    assert report.decks is not None
    assert (report.decks.rectangles, report.decks.grids, report.decks.other) == (3, 0, 0)
    floor = (-math.inf, 0.0)
    check(
        terrain,
        np.array([4.0, 6.5, 3.0, 9.0]),
        np.array([4.0, 3.75, 4.2, 4.0]),
        [
            [floor, (1.15, 1.25), (2.4, 2.5)],
            [floor, (1.15, 1.75), (2.4, 2.5)],
            [(-math.inf, 3.0)],
            [floor],
        ],
        0.01,
    )


def test_one_body_twice_over_a_point(tmp_path: Path) -> None:
    """A lower and an upper floor that a wall joins are two decks there, and one at the wall."""
    parts = [
        slab((4, 4.5), (6, 5), level(1.5), level(1.25)),
        slab((8, 4.5), (9, 3), level(4), level(3.5)),
        slab((6.75, 4.5), (0.5, 3), level(4), level(1.25)),
    ]
    terrain, report = imported(joined(sheet(ground), *parts), tmp_path)
    assert report.decks is not None
    assert report.decks.other == 0
    x, y = np.array([2.0, 5.0, 6.7, 10.0, 5.0]), np.array([4.0, 4.0, 4.0, 4.0, 2.5])
    below = [(-math.inf, float(z)) for z in ground(x, y)]
    check(
        terrain, x, y,
        [
            [below[0], (1.25, 1.5)],
            [below[1], (1.25, 1.5), (3.5, 4)],
            [below[2], (1.25, 4)],
            [below[3], (3.5, 4)],
            [below[4], (1.25, 1.5)],
        ],
        0.01,
    )  # fmt: skip


def test_a_bridge_that_reaches_out_over_nothing(tmp_path: Path) -> None:
    """Ground that ends below is ground all the same; the bridge beyond it stands over the void."""
    block = slab((4, 4.5), (8, 9), level(1), level(-2))
    deck = slab((8, 3), (11, 2), level(3), level(2.6))
    terrain, report = imported(joined(block, deck), tmp_path)
    assert report.decks is not None
    assert (report.decks.rectangles, report.decks.other) == (1, 0)
    check(
        terrain,
        np.array([5.0, 5.0, 12.0, 12.0]),
        np.array([3.0, 7.0, 3.0, 7.0]),
        [[(-math.inf, 1.0), (2.6, 3.0)], [(-math.inf, 1.0)], [(2.6, 3.0)], []],
        0.01,
    )


def test_a_sheet_over_a_sheet_is_told_not_made_up(tmp_path: Path) -> None:
    """A roof of one face has no underside: it stays solid, as without decks, and a note says so."""
    mesh = joined(sheet(level(0)), sheet(level(3), 2, 2, 6, 5))
    samples = sample(mesh, 0.5, decks=True)
    assert samples.overhangs is None
    np.testing.assert_array_equal(samples.values, sample(mesh, 0.5).values)
    assert any("a sheet without an underside lies over another one" in s for s in samples.notes)
    assert any("48 of 504 pixels" in s for s in samples.notes)


def test_faces_that_are_there_twice_count_once() -> None:
    """The whole mesh over again: the same decks, and no word of sheets."""
    mesh = joined(sheet(level(0)), slab((5, 4), (6, 2), level(3), level(2.5), 25))
    once, twice = (sample(one, 0.25, decks=True) for one in (mesh, joined(mesh, mesh)))
    assert once.overhangs is not None
    assert twice.overhangs is not None
    assert once.overhangs.bodies == twice.overhangs.bodies == 1
    np.testing.assert_array_equal(once.overhangs.solid.pixel, twice.overhangs.solid.pixel)
    np.testing.assert_array_equal(once.overhangs.solid.bottom, twice.overhangs.solid.bottom)
    np.testing.assert_array_equal(once.values, twice.values)
    assert not any("sheet" in note for note in twice.notes)


def test_too_many_pixels_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terratool.importing.sampling.MOST_PIXELS", 100)
    mesh = joined(sheet(level(0)), slab((5, 4), (6, 2), level(3), level(2.5)))
    samples = sample(mesh, 0.5, decks=True)
    assert samples.overhangs is None
    assert any("no decks are made" in note for note in samples.notes)
    assert any("only the highest is kept" in note for note in samples.notes)


def test_bodies_that_are_too_many_are_solid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The larger of two slabs is a deck, the other one is solid down to the ground, and counted."""
    monkeypatch.setattr("terratool.importing.overhangs.MOST_BODIES", 1)
    parts = [slab((3, 4), (4, 5), level(3), level(2)), slab((10, 6), (2, 3), level(4), level(3.5))]
    terrain, report = imported(joined(sheet(level(0)), *parts), tmp_path)
    assert any("over 96 of 2,016 pixels" in note for note in report.notes)
    assert report.decks is not None
    assert (report.decks.rectangles, report.decks.other) == (1, 96)
    check(
        terrain,
        np.array([3.1, 10.1, 7.1]),
        np.array([4.1, 6.1, 6.1]),
        [[(-math.inf, 0.0), (2, 3)], [(-math.inf, 4.0)], [(-math.inf, 0.0)]],
        0.01,
    )


def test_a_slab_turned_inside_out_is_told_and_kept(tmp_path: Path) -> None:
    middle, sides = (5.0, 3.0), (4.0, 2.0)
    good = slab((10, 6), (3, 2), level(3), level(2.5))
    bad = flipped(slab(middle, sides, level(3), level(2.5)))
    samples = sample(joined(sheet(level(0)), good, bad), 0.5, decks=True)
    assert samples.overhangs is not None
    assert any(note.startswith("In 32 of 504 pixels") for note in samples.notes)
    terrain, _ = imported(joined(sheet(level(0)), good, bad), tmp_path, pixel=0.5)
    check(terrain, np.array([5.1]), np.array([3.1]), [[(-math.inf, 0.0), (2.5, 3.0)]], 0.01)


def test_what_has_no_overhang_is_as_before(tmp_path: Path) -> None:
    """A box sunk into the ground and one upon another: the same bytes with decks and without."""
    parts = [
        slab((4, 4), (3, 2), level(2), level(-1), 15),
        slab((9, 5), (2, 2), level(1), level(-3)),
        slab((9, 5), (1, 1), level(2), level(1)),
    ]
    mesh = joined(sheet(ground), *parts)
    texts = []
    for decks in (False, True):
        path = tmp_path / f"{decks}.json"
        report = import_terrain(sample(mesh, 0.5, decks=decks), path, ImportOptions(0.01))
        assert report.decks is None
        texts.append(path.read_bytes())
    assert texts[0] == texts[1]


def test_sides_through_centres_of_pixels(tmp_path: Path) -> None:
    """Sides that run through centres hold them to the west and south, in the mesh and the deck."""
    mesh = joined(sheet(level(0)), slab((5.125, 3.625), (4.5, 2.0), level(2), level(1.5)))
    terrain, report = imported(mesh, tmp_path)
    assert report.decks is not None
    assert (report.decks.rectangles, report.decks.grids, report.decks.other) == (1, 0, 0)
    found = columns(terrain, np.array([2.875, 7.375, 5, 5]), np.array([3.6, 3.6, 2.625, 4.625]))
    assert [len(solid) for solid in found] == [2, 1, 2, 1]


@pytest.mark.parametrize("as_", ["rows", "grid"])
@pytest.mark.parametrize(("wide", "turn"), [(6.2, 0.0), (6.2, 31.0), (4.01312349, 0.0)])
def test_decks_up_to_the_rim_of_the_terrain(
    wide: float, turn: float, as_: Any, tmp_path: Path
) -> None:
    """Rounding must not lead out of the terrain, which is an error; pixels are no round numbers."""
    mesh = joined(
        slab((3.1, 2.3), (6.2, 4.6), level(0), level(-1), turn),
        slab((wide / 2, 2.3), (wide, 4.6), level(3), level(2), turn),
    )
    path = tmp_path / "t.json"
    options = ImportOptions(0.01, as_=as_, structures=False)
    report = import_terrain(sample(mesh, 6.2 / 131, decks=True), path, options)
    assert report.decks is not None
    assert (report.decks.rectangles, report.decks.grids, report.decks.other) == (1, 0, 0)
    check(load(path), np.array([3.0]), np.array([2.0]), [[(-math.inf, 0.0), (2.0, 3.0)]], 0.01)


def test_a_deck_reaches_into_the_bank(tmp_path: Path) -> None:
    """Beside a wall there is no notch between the deck and the ground, which falls in a pixel."""
    bank = slab((2, 4.5), (4, 9), level(2), level(-1))
    mesh = joined(sheet(level(0)), bank, slab((6, 4), (4, 2), level(2), level(1.5)))
    terrain, _ = imported(mesh, tmp_path)
    x = np.arange(3.5, 5, 0.01)
    np.testing.assert_allclose(terrain.height(x, np.full(len(x), 4.1)), 2, atol=0.01)


@pytest.mark.slow
def test_the_terrains_of_ours_come_back(tmp_path: Path) -> None:
    """A bridge with a kerb and an arch: the columns of the terrain, away from edges."""
    from tests.storey_examples import BRIDGE

    (tmp_path / "in.json").write_text(json.dumps(BRIDGE))
    assert (
        run("export-mesh", tmp_path / "in.json", tmp_path / "a.glb", "--max-error", 0.01).code == 0
    )
    ran = run("import-terrain", tmp_path / "a.glb", tmp_path / "b.json", "--max-error", 0.02,
              "--resolution", 0.25)  # fmt: skip
    assert ran.code == 0, ran.err
    assert "another number" not in ran.out
    assert "Decks: " in ran.out
    assert "overhang" not in ran.err
    old, new = (load(tmp_path / f"{name}.json") for name in ("in", "b"))
    x, y = (one.ravel() for one in np.meshgrid(np.arange(0.375, 40, 0.75),
                                               np.arange(0.625, 20, 0.5)))  # fmt: skip
    wanted = columns(old, x, y)
    assert sum(len(solid) == 2 for solid in wanted) > 200
    check(new, x, y, wanted, 0.03)


@pytest.mark.slow
def test_the_command_says_what_became_decks(tmp_path: Path) -> None:
    mesh = joined(sheet(level(1)), slab((5, 4), (6, 2), level(3), level(2.5), 12))
    path = tmp_path / "mesh.obj"
    path.write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in mesh.vertices.tolist())
        + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in mesh.faces.tolist())
    )
    out = tmp_path / "t.json"
    told = ("import-terrain", path, out, "--max-error", 0.01, "--resolution", 0.25, "--overwrite",
            "--no-structures")  # fmt: skip
    ran = run(*told, "--preset", "dry-sand")
    assert ran.code == 0, ran.err
    assert "Decks: 1 rectangle, over " in ran.out
    assert "Error of decks at the pixels: tops at most " in ran.out
    assert "Lost" not in ran.out
    deck = json.loads(out.read_text())["elemTree"]["children"][-1]
    assert deck["surface"] == "dry-sand"
    assert deck["turnDeg"] == pytest.approx(12, abs=1e-4)
    assert run("validate", out, "--strict").code == 0
    report = json.loads(run(*told, "--json").out)["decks"]
    assert report["rectangles"] == 1
    assert report["other"] == 0
    ran = run(*told, "--no-decks")
    assert "only the highest is kept" in ran.err
    assert "Decks" not in ran.out
    assert "deck" not in out.read_text()


@pytest.mark.parametrize("turn", [0.0, 17.0, -40.0])
def test_the_rectangle_around_points(turn: float) -> None:
    a = math.radians(turn)
    u, v = np.random.default_rng(2).uniform(-0.5, 0.5, (2, 60))
    along, across = (
        np.append(u, [0.5, -0.5, 0.5, -0.5]) * 7,
        np.append(v, [0.5, 0.5, -0.5, -0.5]) * 2,
    )
    x = 3 + along * math.cos(a) + across * math.sin(a)
    y = -1 - along * math.sin(a) + across * math.cos(a)
    place = around(np.stack([x, y], axis=1))
    assert place is not None
    assert place == pytest.approx((3, -1, 7, 2, a), abs=1e-9)
    assert around(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])) is None


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["rack-hall", "car-park", "gorge"])
def test_samples_come_back(name: str, tmp_path: Path) -> None:
    """Columns of meshes of samples at the centres of pixels are those of the samples."""
    sample_ = ROOT / "samples" / f"{name}.json"
    assert run("export-mesh", sample_, tmp_path / "a.glb").code == 0
    ran = run("import-terrain", tmp_path / "a.glb", tmp_path / "b.json", "--max-error", 0.02,
              "--resolution", 0.23)  # fmt: skip
    assert ran.code == 0, ran.err
    old, new = load(sample_), load(tmp_path / "b.json")
    west, south, east, north = old.bounds
    x, y = (one.ravel() for one in np.meshgrid(np.arange(west + 0.115, east, 0.23),
                                               np.arange(south + 0.115, north, 0.23)))  # fmt: skip
    check(new, x, y, columns(old, x, y), 0.03)
