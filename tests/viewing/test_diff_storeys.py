"""Differences of decks and bores: by hand, and against the slow reading of the format."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from jsonschema import Draft202012Validator
from msgspec import UNSET

import terratool
from terratool.text.source import Source
from terratool.viewing.diff.compare import DiffOptions, diff
from terratool.viewing.diff.report import lines_of
from terratool.viewing.diff.results import Difference, StoreyChange
from terratool.viewing.diff.sides import DiffSide, side_of
from terratool.viewing.diff.storeys import StoreySide
from tests.commands import call
from tests.storey_examples import BRIDGE, CAR_PARK, DEFINITIONS, RACK, TUNNEL, box
from tests.storeys import Storeys

Json = dict[str, Any]
Edit = Callable[[Json], object]


def side(definition: Json) -> DiffSide:
    return side_of(Source("terrain.json", json.dumps(definition).encode()))


def edited(definition: Json, edit: Edit) -> Json:
    new = copy.deepcopy(definition)
    edit(new["elemTree"]["children"])
    return new


def compared(old: Json, new: Json, **options: Any) -> Difference:
    return diff(side(old), side(new), DiffOptions(**options)).difference


def changes(old: Json, edit: Edit, **options: Any) -> tuple[StoreyChange, ...]:
    found = compared(old, edited(old, edit), **options).storeys
    assert found is not UNSET
    return found


def test_a_thicker_slab_hangs_lower() -> None:
    """24 × 4 × 0.5 with a kerb of 24 × 0.4 × 0.15, a quarter thicker."""
    (one,) = changes(BRIDGE, lambda tree: tree[0]["deck"].update(thickness=0.75))
    assert (one.kind, one.what, one.shift, one.top) == ("changed", "deck", None, None)
    assert one.face == one.clearance == (-0.25, -0.25)
    old, new = one.old, one.new
    assert old is not None and new is not None
    assert old.pointer == new.pointer == "/elemTree/children/0"
    assert old.bounds == new.bounds == (8, 8, 32, 12)
    assert (old.top, old.face, new.face) == ((4.0, 4.15), (3.5, 3.5), (3.25, 3.25))
    assert old.area == new.area == 24 * 4
    assert old.volume == pytest.approx(24 * 4 * 0.5 + 24 * 0.4 * 0.15, rel=1e-12)
    assert new.volume == pytest.approx(old.volume + 24 * 4 * 0.25, rel=1e-12)
    # the valley is a plane of 0 in its middle: the largest room is that up to the underside
    assert old.clearance is not None and old.clearance[1] == 3.5


def test_a_slab_that_is_raised_gives_room() -> None:
    (one,) = changes(BRIDGE, lambda tree: tree[0].update(vScale=4.5))
    assert one.top == one.face == (0.5, 0.5)
    assert one.clearance == (0.5, 0.5)
    assert one.old is not None and one.new is not None
    assert one.old.volume == pytest.approx(one.new.volume, rel=1e-12)


def test_a_curved_underside_changes_more_here_and_less_there() -> None:
    """1 + 2.5 · dome to 1 + 2 · dome: least at the rims, and half a metre at the crown."""
    (one,) = changes(BRIDGE, lambda tree: tree[1]["deck"].update(vScale=2))
    assert one.top is None and one.face is not None
    low, high = one.face
    assert low == pytest.approx(-0.5, abs=1e-4) and -0.1 < high < 0
    # ∫ (3 - s · dome) = (3 - s · π / 4) · 16 · 4
    for found, scale in ((one.old, 2.5), (one.new, 2.0)):
        assert found is not None
        assert found.volume == pytest.approx((3 - scale * math.pi / 4) * 64, rel=1e-3)


def test_ground_that_is_raised_takes_the_room_of_a_slab_that_stays() -> None:
    """A plinth of a metre under the slab's south: its faces stay."""
    (one,) = changes(BRIDGE, lambda tree: tree.append(box(18, 6, 20, 9, vScale=1)))
    assert (one.kind, one.top, one.face, one.clearance) == ("changed", None, None, (-1.0, 0.0))
    found = compared(BRIDGE, edited(BRIDGE, lambda t: t.append(box(18, 6, 20, 9, vScale=1))))
    assert found.ground is not None and found.ground.fill == pytest.approx(6)


def test_a_storey_that_moves_is_told_where_to() -> None:
    (one,) = changes(BRIDGE, lambda tree: tree[0].update(at=[21, 8.5]))
    assert (one.kind, one.shift, one.top, one.face) == ("moved", (1, -1.5), None, None)
    assert one.old is not None and one.new is not None and one.new.bounds == (9, 6.5, 33, 10.5)


def test_a_mirrored_storey_is_none_that_stayed() -> None:
    """The ramp of the car park, to the west: by 3 m at either end."""
    (one,) = changes(CAR_PARK, lambda tree: tree[1].update(turnDeg=180))
    assert one.kind == "changed" and one.old is not None and one.new is not None
    assert one.top == pytest.approx((-3, 3), abs=0.1)
    assert one.old.volume == pytest.approx(one.new.volume) == pytest.approx(10 * 4 * 0.25)


def test_what_came_and_what_went() -> None:
    """In the place of the arch there is another one beside it: too far to be the same."""

    def edit(tree: list[Json]) -> None:
        del tree[1]
        tree.insert(0, box(2, 1, 5, 3, vScale=6, deck={"thickness": 1, "datum": True}))

    gone, came = changes(BRIDGE, edit)
    assert (gone.kind, gone.new, came.kind, came.old) == ("removed", None, "added", None)
    assert gone.old is not None and came.new is not None
    assert (gone.old.pointer, came.new.pointer) == ("/elemTree/children/1", "/elemTree/children/0")
    # on the bank of 4 m: a metre below the underside
    assert came.new.top == (6, 6) and came.new.clearance == (1, 1)
    assert (came.new.area, came.new.volume) == pytest.approx((6, 6))


def test_a_shelf_that_is_put_first_makes_no_other_differ() -> None:
    """All shelves of a rack have one footprint, and those behind it have other pointers."""
    new = copy.deepcopy(RACK)
    shelf = box(0, 0, 3, 1, vScale=1, surface="wood", deck={"thickness": 0.05})
    new["parts"]["rack"]["children"].insert(2, shelf)
    found = compared(RACK, new).storeys
    assert found is not UNSET
    came = [one.new for one in found if one.kind == "added" and one.new]
    # once as it is and once twice as large
    assert [one.volume for one in came] == pytest.approx([3 * 0.05, 3 * 0.1])
    # the shelf over it, from 1.45 on, had 0.85 of room down to the one at 0.6, and has 0.45
    others = [(one.kind, one.top, one.face, one.clearance) for one in found if one.kind != "added"]
    assert [one[:3] for one in others] == [("changed", None, None)] * 2
    assert [one[3] for one in others] == [pytest.approx((-0.4,) * 2), pytest.approx((-0.8,) * 2)]


def test_of_one_pointer_or_else_of_one_footprint() -> None:
    """Two slabs change their order and their thickness: places tell which is which."""

    def slabs(first: Json, second: Json) -> Edit:
        return lambda tree: tree.extend([first, second])

    west = box(1, 1, 5, 2, vScale=7, deck={"thickness": 1, "datum": True})
    east = box(34, 15, 39, 17, vScale=8, deck={"thickness": 1, "datum": True})
    old = edited(BRIDGE, slabs(west, east))
    thin = {"thickness": 0.5, "datum": True}
    new = edited(BRIDGE, slabs({**east, "deck": thin}, {**west, "deck": thin}))
    found = compared(old, new).storeys
    assert found is not UNSET
    assert [(one.kind, one.top, one.face) for one in found] == [("changed", None, (0.5, 0.5))] * 2
    names = [(one.old.pointer[-1], one.new.pointer[-1]) for one in found if one.old and one.new]
    assert names == [("2", "3"), ("3", "2")]


def test_a_hole_in_a_floor_is_a_change_of_its_area() -> None:
    (one,) = changes(CAR_PARK, lambda tree: tree[0]["children"].pop(0))
    assert (one.top, one.face, one.kind) == (None, None, "changed")
    assert one.old is not None and one.new is not None
    assert (one.old.area, one.new.area) == pytest.approx((400 - 4, 400))


def test_a_tunnel_that_is_higher_has_more_room() -> None:
    (one,) = changes(TUNNEL, lambda tree: tree[1]["bore"].update(height=6))
    assert (one.what, one.top, one.face) == ("bore", None, (1.0, 1.0))
    # 6 m below the hill's top of 8 m; less over the walkway of 0.2 m
    assert one.old is not None and one.new is not None
    assert one.old.clearance == pytest.approx((4.8, 5)) and one.clearance == pytest.approx((1, 1))
    assert one.new.clearance == pytest.approx((5.8, 6))
    # the walkway is a metre wide
    assert one.old.volume == pytest.approx(60 * 6 * 5 - 60 * 1 * 0.2)


def test_a_change_within_the_tolerance_is_none() -> None:
    thicker: Edit = lambda tree: tree[0]["deck"].update(thickness=0.51)  # noqa: E731
    assert len(changes(BRIDGE, thicker)) == 1
    assert changes(BRIDGE, thicker, min_change=0.02) == ()
    # beyond the rectangle that is compared
    assert changes(BRIDGE, thicker, bounds=(0.0, 14.0, 40.0, 20.0)) == ()


def test_one_side_alone_may_have_storeys() -> None:
    plain = edited(BRIDGE, lambda tree: tree.clear())
    for old, new, kind in ((plain, BRIDGE, "added"), (BRIDGE, plain, "removed")):
        found = compared(old, new)
        assert found.storeys is not UNSET and found.ground is not None
        assert [one.kind for one in found.storeys] == [kind] * 2
        assert found.ground.is_same
    found = compared(plain, edited(plain, lambda tree: tree.append(box(1, 1, 2, 2))))
    assert found.storeys is UNSET and b"storeys" not in msgspec.json.encode(found)


@pytest.mark.parametrize("name", [name for name in DEFINITIONS if name != "rack"])
def test_faces_are_those_of_the_slow_reading(name: str) -> None:
    """Of each storey at points over it and beside it, with its pointer and what it is."""
    definition = DEFINITIONS[name]
    oracle = Storeys(definition)
    terrain = side(definition).terrain
    found = {one.pointer: one for one in StoreySide(terrain, terrain.bounds, None).found}
    rng = np.random.default_rng(7)
    wide, tall = terrain.size
    met = set()
    for x, y in zip(rng.uniform(0, wide, 80), rng.uniform(0, tall, 80), strict=True):
        if oracle.margin(x, y) < 1e-6:
            continue
        there = {one.pointer: one for one in oracle.faces(x, y)[1]}
        for pointer, one in found.items():
            top, face = (float(values[0, 0]) for values in one.faces(
                np.array([[x]]), np.array([[y]])
            ))  # fmt: skip
            wanted = there.get(pointer)
            if wanted is None or math.isnan(wanted.other):
                assert math.isnan(top) and math.isnan(face)
                continue
            assert one.is_bore == (wanted.kind == "bore")
            between = (wanted.other - wanted.top.z) * (1 if one.is_bore else -1)
            if between <= 0 or (math.isnan(between) and not one.is_bore):
                assert math.isnan(face)
            else:
                met.add(pointer)
                assert face == pytest.approx(wanted.other, abs=1e-7)
                assert top == pytest.approx(wanted.top.z, abs=1e-7, nan_ok=True)
    assert len(met) > len(found) / 3


def saved(path: Path, value: Json) -> Path:
    path.write_text(json.dumps(value), "utf-8")
    return path


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """The bridge, and the bridge with a thicker slab, a pier below it, and without the arch."""

    def edit(tree: list[Json]) -> None:
        tree[0]["deck"]["thickness"] = 0.75
        del tree[1]
        tree.append(box(1, 14, 3, 19, vScale=5, deck={"thickness": 0.5, "datum": True}))

    return saved(tmp_path / "old.json", BRIDGE), saved(tmp_path / "new.json", edited(BRIDGE, edit))


def test_the_report_names_what_changed(files: tuple[Path, Path]) -> None:
    ran = call("diff", *files, "--format", f"json={files[0].parent / 'a.json'}")
    assert (ran.code, ran.err) == (0, "")
    lines = ran.out.splitlines()
    at = lines.index("  storeys: 1 added, 1 removed, 1 changed")
    assert lines[at + 1 : at + 4] == [
        "    ~ deck /elemTree/children/0: underside -0.25 m, clearance -0.25 m, "
        "volume 49.44 → 73.44 m³",
        lines[at + 2],
        "    + deck /elemTree/children/1 added: top 5 m, underside 4.5 m, clearance 0.5 m, "
        "volume 5 m³",
    ]
    assert lines[at + 2].startswith(
        "    - deck /elemTree/children/1 removed: top 4 m, underside 1."
    )
    assert any(line.startswith("  ground without storeys: no difference") for line in lines)
    assert not any("not shown" in line for line in lines)
    found = json.loads((files[0].parent / "a.json").read_text("utf-8"))
    Draft202012Validator(terratool.schema("difference")).validate(found)
    storeys = found["files"][0]["difference"]["storeys"]
    assert [one["kind"] for one in storeys] == ["changed", "removed", "added"]


def test_equal_changes_share_a_line() -> None:
    """Four tables of a row are 0.25 m thicker; a fifth one, beside it, is thicker by less."""
    row = box(1, 1, 2, 2, vScale=6, deck={"thickness": 0.5, "datum": True},
              repeat={"count": [2, 2], "step": [1.5, 2]})  # fmt: skip
    other = box(30, 17, 38, 19, vScale=6, deck={"thickness": 0.5, "datum": True})
    old = edited(BRIDGE, lambda tree: tree.extend([row, other]))

    def edit(tree: list[Json]) -> None:
        tree[2]["deck"]["thickness"], tree[3]["deck"]["thickness"] = 0.75, 0.625

    *_, said, four, one = (line.strip() for line in lines_of(compared(old, edited(old, edit)), 20))
    assert said == "storeys: 5 changed"
    names = ", ".join(f"/elemTree/children/2[{i},{j}]" for i, j in ((0, 0), (1, 0), (0, 1)))
    figures = "underside -0.25 m, clearance -0.25 m, volume 0.5 → 0.75 m³"
    assert four == f"~ 4 × deck: {figures}: {names}, …"
    figures = "underside -0.125 m, clearance -0.125 m, volume 8 → 10 m³"
    assert one == f"~ deck /elemTree/children/3: {figures}"


def test_the_map_has_tops_and_clearances(files: tuple[Path, Path], tmp_path: Path) -> None:
    import rasterio

    out = tmp_path / "change.tif"
    assert call("diff", *files, "--map", out, "--resolution", 0.5).code == 0
    with rasterio.open(out) as file:
        assert file.descriptions[2:] == ("new less old highest top", "new less old clearance")
        ground, surface, top, room = file.read()

        def at(band: Any, x: float, y: float) -> float:
            return float(band[file.index(x, y)])

        assert not ground.any() and not surface.any()
        # the slab's underside, the arch in the valley's middle, and what came over the west bank
        assert (at(top, 20.25, 10.25), at(room, 20.25, 10.25)) == (0, -0.25)
        assert (at(top, 20.25, 16.25), at(top, 2.25, 15.25)) == (-4, 1)
        assert (at(top, 2.25, 4.75), at(top, 37.75, 15.25)) == (0, 0)
        assert math.isnan(at(room, 20.25, 16.25)) and math.isnan(at(room, 2.25, 15.25))


@pytest.mark.nightly
def test_the_picture_shows_tops_and_what_changed_below(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    """From the north to the south: the arch is gone (red), what came in the west is higher (blue),
    the slab, further south, has another underside (orange)."""
    pytest.importorskip("matplotlib")
    from PIL import Image

    out, again = tmp_path / "a.png", tmp_path / "b.png"
    for name in (out, again):
        assert call("diff", *files, "--picture", name).code == 0
    assert out.read_bytes() == again.read_bytes()
    pixels = np.asarray(Image.open(out).convert("RGB")).astype(int)
    pixels = pixels[:, : int(0.78 * pixels.shape[1])]
    red, green, blue = np.moveaxis(pixels, 2, 0)
    places = {
        "gone": (red - green > 60) & (red - blue > 60) & (green < 80),
        "higher": (blue - red > 25) & (blue - green > 8),
        "below": (red > 180) & (green > 120) & (blue < 60),
    }
    middle = {name: np.argwhere(mask).mean(axis=0) for name, mask in places.items()}
    assert middle["below"][0] > middle["gone"][0] + 20  # rows count from the north
    assert middle["higher"][1] < middle["gone"][1] - 100
    assert abs(middle["below"][1] - middle["gone"][1]) < 10
