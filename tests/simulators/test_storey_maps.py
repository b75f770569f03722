"""Maps of decks and bores for Nav2 and grid_map, on a yard that has no symmetry."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from terratool.field.terrain import Terrain
from terratool.simulators.cells import cell_grid
from terratool.simulators.export import export_simulators
from terratool.simulators.obstacles import FREE, OCCUPIED, UNKNOWN, DrivingLimits, occupancy
from terratool.simulators.options import SceneOptions
from terratool.simulators.storey_obstacles import storey_occupancy
from tests.commands import ROOT, call
from tests.conftest import terrain_of
from tests.simulators.test_grid_map import Bag
from tests.simulators.test_nav2 import Map, read

HUSKY = ROOT / "samples" / "vehicles" / "husky-a200.json"
WEST, SOUTH = 10.25, -3.5
SOIL = {"cohesion": 1, "fricAngle": 35, "sinkage": 0}


def deck(at: list[float], extent: list[float], height: float, **more: Any) -> dict[str, Any]:
    """A level deck of 0.1 m, or what `type` says."""
    placed = {"at": at, "extent": extent, "vScale": height, "surface": "steel"}
    return {"type": "flat", **placed, "deck": {"thickness": 0.1}, **more}


YARD: dict[str, Any] = {
    "size": [12, 7],
    "origin": [WEST, SOUTH],
    "surfTypes": {"floor": SOIL, "steel": {**SOIL, "fricAngle": 30}, "hole": {"void": True}},
    "elemTypes": {"flat": {"x": [1]}, "ramp": {"x": [0, 1], "y": [1]}},
    "elemTree": {
        "type": "flat", "vScale": 0, "surface": "floor",
        "children": [
            # a ramp to a dock, x 1.5 to 5.5 to 8.5, y 1 to 3; a roof over a quarter of the dock
            deck([3.5, 2], [4, 2], 0.8, type="ramp"),
            deck([7, 2], [3, 2], 0.8),
            deck([7.5, 2.5], [2, 1], 3),
            # a hill with a tunnel from west to east, x 9.5 to 11.5, y 5 to 6
            {"at": [10.5, 5], "extent": [2, 3], "type": "flat", "vScale": 2},
            {"at": [10.5, 5.5], "extent": [3, 1], "type": "flat", "vScale": 0,
             "bore": {"height": 1, "datum": True}},
            # a cutting through a bank, x 6.5 to 7.5, y 5.2 to 5.8
            {"at": [7, 5.5], "extent": [1, 2], "type": "flat", "vScale": 0.5},
            {"at": [7, 5.5], "extent": [2, 0.6], "type": "flat", "vScale": 0,
             "bore": {"height": 1, "datum": True}},
            # a plank, x 0.74 to 1.26, over a hole, x 0.5 to 1.5, y 5 to 6
            {"at": [1, 5.5], "extent": [1, 1], "type": "flat", "vScale": 0, "surface": "hole"},
            deck([1, 5.5], [0.52, 2], 0.05),
        ],
    },
}  # fmt: skip
BORE, DECKS, ROOF = 1, 2, 3
"""Numbers of the sheets: bores come first, then decks that lie beside each other."""


def yard() -> Terrain:
    return terrain_of(YARD)


def maps(folder: Path, count: int = 4) -> list[Map]:
    """The maps of an export: that of the lowest tops, and those of storeys."""
    names = ["map.yaml", *(f"map.storey-{number}.yaml" for number in range(1, count))]
    assert sorted(names) == sorted(path.name for path in folder.glob("*.yaml"))
    return [read(folder, name) for name in names]


def exported(folder: Path, target: str = "nav2", **options: Any) -> tuple[Path, dict[str, Any]]:
    wanted = SceneOptions(origin="world", **{"resolution": 0.1, **options})
    [report] = export_simulators(yard(), folder, (target,), wanted)
    return report.folder, dict(report.manifest)


@pytest.mark.parametrize(
    ("sheet", "x", "y", "cell"),
    [
        (0, 7.05, 2.05, FREE),  # below the dock
        (0, 3.55, 0.95, FREE),  # beside the ramp: of a wall the upper cells are occupied
        (0, 10.55, 4.05, FREE),  # on the hill
        (0, 9.55, 4.05, OCCUPIED),
        (0, 10.55, 5.55, FREE),  # on the hill, over the tunnel
        (0, 9.55, 5.55, OCCUPIED),  # over its mouth
        (0, 9.35, 5.55, FREE),  # before it
        (0, 7.05, 5.25, FREE),  # in the cutting, whose rim is the bank's
        (0, 7.05, 5.85, OCCUPIED),
        (0, 7.05, 5.95, FREE),
        (0, 0.65, 5.55, UNKNOWN),  # the hole, the plank over it
        (0, 1.05, 5.55, FREE),
        (0, 1.35, 5.55, UNKNOWN),
        (BORE, 10.55, 5.05, FREE),  # beside the wall of the tunnel
        (BORE, 10.55, 4.95, UNKNOWN),
        (BORE, 9.65, 5.95, FREE),
        (BORE, 7.05, 2.05, UNKNOWN),
        (BORE, 7.05, 5.75, FREE),
        (DECKS, 0.75, 5.55, UNKNOWN),  # the hole reaches into the cells at the sides of the plank
        (DECKS, 0.85, 5.55, FREE),
        (DECKS, 1.25, 5.55, UNKNOWN),
        (DECKS, 3.55, 2.05, FREE),
        (DECKS, 3.55, 1.05, OCCUPIED),  # the side of the ramp, 0.4 m high
        (DECKS, 3.55, 0.95, UNKNOWN),
        (DECKS, 1.65, 1.05, FREE),  # and 3 cm
        (DECKS, 5.45, 1.55, FREE),  # where the ramp meets the dock
        (DECKS, 5.55, 1.55, FREE),
        (DECKS, 5.55, 2.95, OCCUPIED),
        (DECKS, 8.45, 2.05, OCCUPIED),
        (DECKS, 8.55, 2.05, UNKNOWN),
        (DECKS, 7.55, 2.55, FREE),  # below the roof
        (ROOF, 7.55, 2.55, FREE),
        (ROOF, 6.55, 2.55, OCCUPIED),
        (ROOF, 7.55, 2.05, OCCUPIED),
        (ROOF, 7.55, 1.95, UNKNOWN),
    ],
)  # fmt: skip
def test_cells_by_hand(nav2: list[Map], sheet: int, x: float, y: float, cell: int) -> None:
    """By slope and step: what is over a place, and what is below it, have maps of their own."""
    assert nav2[sheet].at(WEST + x, SOUTH + y) == cell


@pytest.fixture(scope="module")
def nav2(tmp_path_factory: pytest.TempPathFactory) -> list[Map]:
    return maps(exported(tmp_path_factory.mktemp("nav2"))[0])


def test_what_is_said_of_them(tmp_path: Path) -> None:
    """Which is which, by numbers and heights from zero; and what they cannot say."""
    folder, manifest = exported(tmp_path / "a")
    facts = manifest["storeys"]
    assert [one["file"] for one in facts] == [f"map.storey-{n}.yaml" for n in (1, 2, 3)]
    assert [(one.get("bores"), one.get("decks")) for one in facts] == [
        (2, None), (None, 3), (None, 1),
    ]  # fmt: skip
    # the middle of the ramp's lowest cells is 5 cm up its 4 m
    assert facts[0]["heights"] == [0, 0] and facts[2]["heights"] == [3, 3]
    assert facts[1]["heights"] == pytest.approx([0.01, 0.8])
    for one in facts:
        said = yaml.safe_load((folder / one["file"]).read_text())
        assert said["image"] == one["file"].replace(".yaml", ".pgm")
        cells = read(folder, one["file"]).cells
        assert one["shares"]["free"] == np.mean(cells == FREE)
    readme = (folder / "README.md").read_text("utf-8")
    assert "| map.storey-2.yaml | 3 decks | 0.01 to 0.8 m |" in readme
    assert any(line.startswith("Headroom is not judged without") for line in manifest["losses"])
    assert not any("not shown" in line for line in manifest["losses"])


def test_away_from_storeys_nothing_is_new() -> None:
    """There the map has what that of the ground has, thin posts among it."""
    post = {"at": [5.03, 5.02], "extent": [0.02, 0.02], "type": "flat", "vScale": 1}
    tree = YARD["elemTree"]
    text = {**YARD, "elemTree": {**tree, "children": [*tree["children"], post]}}
    terrain, limits = terrain_of(text), DrivingLimits.of(20.0, 0.1)
    grid = cell_grid(terrain, 0.25)
    found = storey_occupancy(terrain, grid, limits)
    ground = occupancy(terrain.ground_alone, grid, limits)
    assert found.shape == (4, *ground.shape)
    changed = np.zeros(ground.shape, np.bool_)
    changed[2:10, 3:5] = changed[3:9, 25:31] = True  # the plank, and the cutting
    assert (ground == OCCUPIED).sum() > 10 and (ground == UNKNOWN).sum() == 16
    np.testing.assert_array_equal(found[0][~changed], ground[~changed])
    assert (found[0] == UNKNOWN).sum() == 8  # of 4 × 4 cells of the hole those beside the plank
    assert (found[1:, 12:16] == UNKNOWN).all() and (found[1:, :, 38:][:, 8:] == UNKNOWN).all()


@pytest.mark.parametrize("curve", [{"x": [0, 1], "y": [1]}, {"x": [1], "y": [0, 1]}])
@pytest.mark.parametrize(("rise", "cell"), [(0.5, FREE), (0.6, OCCUPIED)])
def test_a_slope_is_no_step(curve: Any, rise: float, cell: int) -> None:
    """On a ramp with a rise of 0.5 over 2 m, 14°, no step is seen, be it as low as a millimetre."""
    ramp = {**deck([3, 2], [2, 2], rise), "type": "slope"}
    types = {**YARD["elemTypes"], "slope": curve}
    tree = {**YARD["elemTree"], "children": [ramp]}
    terrain = terrain_of({**YARD, "elemTypes": types, "elemTree": tree})
    limits = DrivingLimits.of(math.degrees(math.atan(0.26)), 0.001)
    found = storey_occupancy(terrain, cell_grid(terrain, 0.1), limits)
    assert (found[1, -29:-11, 21:39] == cell).all()


def vehicle(folder: Path, height: float | None) -> Path:
    """A Husky of another height."""
    text = json.loads(HUSKY.read_text("utf-8"))
    text.pop("height")
    if height is not None:
        text["height"] = height
    path = folder / f"husky-{height}.json"
    path.write_text(json.dumps(text), "utf-8")
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("height", "below_dock", "below_ramp"),
    [(0.4, FREE, OCCUPIED), (0.9, OCCUPIED, OCCUPIED), (None, FREE, FREE)],
)
def test_a_vehicle_needs_room(
    tmp_path: Path, height: float | None, below_dock: int, below_ramp: int
) -> None:
    """The dock leaves 0.7 m, the ramp 0.2 m at a place. Nothing leads to the roof."""
    folder, manifest = exported(tmp_path, vehicle=vehicle(tmp_path, height))
    found = maps(folder)

    def cell(sheet: int, x: float, y: float) -> int:
        return found[sheet].at(WEST + x, SOUTH + y)

    assert cell(0, 7.05, 2.05) == below_dock and cell(0, 3.05, 2.05) == below_ramp
    assert cell(DECKS, 3.05, 2.05) == cell(DECKS, 7.05, 1.55) == FREE
    assert cell(ROOF, 7.55, 2.55) == OCCUPIED and cell(ROOF, 7.05, 1.55) == UNKNOWN
    assert cell(DECKS, 3.05, 1.05) == OCCUPIED and cell(0, 4.05, 5.05) == FREE
    said = [line for line in manifest["losses"] if line.startswith("Headroom is not judged")]
    assert len(said) == (height is None)
    shares = manifest["storeys"][DECKS - 1]["shares"]
    assert shares["free"] == np.mean(found[DECKS].cells == FREE)


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", [None, HUSKY])
def test_the_bank_at_a_bridge_is_lower_than_its_roof(tmp_path: Path, vehicle: Path | None) -> None:
    """The upright bank, x from 5 on, lies apart from the bed, and is the lowest top there."""
    children = [
        {"at": [8.5, 2.5], "extent": [7, 5], "type": "flat", "vScale": 2},
        deck([3, 2.5], [4, 2], 2),
        deck([6.25, 2.5], [1.5, 3], 5),
    ]
    tree = {**YARD["elemTree"], "children": children}
    terrain = terrain_of({**YARD, "size": [12, 5], "elemTree": tree})
    options = SceneOptions(vehicle=vehicle, resolution=0.1, origin="world")
    [report] = export_simulators(terrain, tmp_path, ("nav2",), options)
    lowest, storeys = maps(report.folder, 2)
    assert lowest.at(WEST + 6.25, SOUTH + 2.55) == FREE
    assert storeys.at(WEST + 6.25, SOUTH + 2.55) == (FREE if vehicle is None else OCCUPIED)
    assert storeys.at(WEST + 4.95, SOUTH + 2.55) == storeys.at(WEST + 3.05, SOUTH + 2.55) == FREE


def test_layers_have_all_tops(tmp_path: Path) -> None:
    """Over each cell the maps together have the tops of its column, and what is over each."""
    folder, manifest = exported(tmp_path, "grid-map")
    terrain, topics = yard(), ["/grid_map", *(f"/grid_map/storey_{n}" for n in (1, 2, 3))]
    bags = [Bag(folder, topic) for topic in topics]
    assert bags[0].topics == topics and bags[0].names[-1] == "ceiling"
    assert manifest["grid_map"]["topics_of_storeys"] == topics[1:]
    x, y = bags[0].positions()
    column = terrain.column(*np.broadcast_arrays(x[:, None], y))
    over = np.roll(column.bottom, -1, axis=-1)
    over[..., -1] = np.nan
    heights = np.stack([bag.layer("elevation") for bag in bags], -1)
    twice = np.isclose(heights[..., :1], heights[..., 1:])  # as a plank over a hole is lowest, too
    assert 0 < twice.sum() < 0.02 * twice.size
    for name, wanted in (("elevation", column.top), ("ceiling", over)):
        layers = np.stack([bag.layer(name) for bag in bags], -1)
        layers[..., 1:][twice] = np.nan
        tops = np.sort(layers, axis=-1)
        wanted = np.sort(wanted, axis=-1)
        wide = wanted.shape[-1]
        np.testing.assert_allclose(tops[..., :wide], wanted, atol=1e-6)
        assert np.isnan(tops[..., wide:]).all()
    mirrored = heights[::-1], heights[:, ::-1]
    assert all(np.nanmax(np.abs(heights - one)) > 0.7 for one in mirrored)

    def at(sheet: int, east: float, north: float) -> dict[str, float]:
        place = np.abs(x - WEST - east).argmin(), np.abs(y - SOUTH - north).argmin()
        return {name: float(bags[sheet].layer(name)[place]) for name in bags[sheet].names}

    index = manifest["grid_map"]["surface_indices"]
    below, ramp, tunnel = at(0, 7.55, 2.55), at(DECKS, 3.55, 2.05), at(BORE, 10.55, 5.55)
    assert below["elevation"] == 0 and below["ceiling"] == pytest.approx(0.7)
    assert (below["surface"], ramp["surface"]) == (index["floor"], index["steel"])
    assert ramp["friction"] == pytest.approx(math.tan(math.radians(30)))
    assert ramp["slope"] == pytest.approx(math.atan(0.2)) and math.isnan(ramp["ceiling"])
    assert ramp["normal_x"] == pytest.approx(-0.2 / math.hypot(0.2, 1), rel=1e-5)
    assert tunnel["elevation"] == 0 and tunnel["ceiling"] == 1
    assert at(DECKS, 7.55, 2.55)["ceiling"] == pytest.approx(2.9)
    assert list(manifest["surfaces"]) == ["floor", "steel"]


@pytest.mark.slow
def test_verdicts_are_those_of_the_maps_for_nav2(tmp_path: Path) -> None:
    """Sheet by sheet and cell by cell."""
    options = SceneOptions(vehicle=HUSKY, resolution=0.1, origin="world")
    one, other = export_simulators(yard(), tmp_path, ("nav2", "grid-map"), options)
    for number, there in enumerate(maps(one.folder)):
        topic = "/grid_map" + (f"/storey_{number}" if number else "")
        bag = Bag(other.folder, topic)
        layer = bag.layer("traversability")[::-1, ::-1].T  # rows from the south
        known = ~np.isnan(layer)
        assert known.any()
        np.testing.assert_array_equal(
            np.where(layer[known] > 0, FREE, OCCUPIED), there.cells[known]
        )


def test_each_target_sees_what_it_knows(tmp_path: Path) -> None:
    """Of two targets one may say what it leaves out, and the other not."""
    file = tmp_path / "yard.json"
    file.write_text(json.dumps(YARD), "utf-8")
    words = ("export-sim", file, tmp_path / "o", "--resolution", "0.25")
    ran = call(*words, "--target", "nav2", "--target", "grid-map", "--json")
    assert (ran.code, ran.err) == (0, "")
    for one in json.loads(ran.out)["targets"].values():
        assert not any("not shown" in line for line in one["losses"])
        assert one["summary"].endswith("3 maps of decks and bores")
