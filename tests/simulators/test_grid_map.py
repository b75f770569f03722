"""Bags for grid_map, read back with rosbags by the message's own definition.

Where the cell of an index lies is written here from grid_map's `GridMapMath.cpp`
(`getPositionFromIndex`), how data are laid out from `GridMapMsgHelpers.hpp`, not from the code
under test.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from terratool.definition.reader import check
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.simulators.export import export_simulators
from terratool.simulators.options import SceneOptions
from terratool.text.source import Source
from terratool.traversability.map import stream_map
from tests.commands import ROOT, call

HUSKY = ROOT / "samples" / "vehicles" / "husky-a200.json"
LAYERS = [
    "elevation", "normal_x", "normal_y", "normal_z", "slope", "friction", "surface", "color",
]  # fmt: skip

# oblong, away from the origin, and no two corners alike: a ramp that rises to the east, one that
# rises to the north, a box, a hole
YARD: dict[str, Any] = {
    "size": [9, 5],
    "origin": [-2, 30],
    "surfTypes": {
        "sand": {"fricAngle": 30, "cohesion": 1, "sinkage": 0, "color": [200, 180, 20]},
        "hole": {"void": True},
        "slab": {"color": [1, 2, 3]},
    },
    "elemTypes": {
        "flat": {"x": [1]}, "east": {"x": [0, 1], "y": [1]}, "north": {"x": [1], "y": [0, 1]},
    },
    "elemTree": {
        "type": "east", "vScale": 0.9, "vOffset": 2,
        "children": [
            {"at": [4, 2.5], "extent": [7, 4], "type": "flat", "vScale": 0, "surface": "sand"},
            {"at": [2, 1], "extent": [1, 1], "type": "flat", "vScale": 3, "surface": "slab"},
            {"at": [6, 3.5], "extent": [2, 1], "type": "north", "vScale": 0.5, "surface": "sand"},
            {"at": [7, 0.5], "extent": [1, 0.5], "type": "flat", "vScale": 0, "surface": "hole"},
        ],
    },
}  # fmt: skip


def yard() -> Terrain:
    return Terrain(check(Source("yard.json", json.dumps(YARD).encode())))


class Bag:
    """The one message of a topic of a bag."""

    def __init__(self, folder: Path, topic: str = "/grid_map") -> None:
        with Reader(folder / "grid_map") as reader:
            self.topics = [one.topic for one in reader.connections]
            [connection] = (one for one in reader.connections if one.topic == topic)
            assert connection.msgtype == "grid_map_msgs/msg/GridMap"
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
            [(_, self.time, raw)] = reader.messages([connection])
            self.message: Any = store.deserialize_cdr(raw, connection.msgtype)
            [self.qos] = connection.ext.offered_qos_profiles

    @property
    def names(self) -> list[str]:
        return list(self.message.layers)

    def positions(self) -> Any:
        """Where the cell of each index lies: x by row, y by column."""
        info = self.message.info
        rows, columns = (
            round(length / info.resolution) for length in (info.length_x, info.length_y)
        )
        first_x = info.pose.position.x + 0.5 * info.length_x - 0.5 * info.resolution
        first_y = info.pose.position.y + 0.5 * info.length_y - 0.5 * info.resolution
        x = first_x - np.arange(rows) * info.resolution
        y = first_y - np.arange(columns) * info.resolution
        return x, y

    def layer(self, name: str) -> Any:
        """(rows, columns), as Eigen has the matrix of a layer."""
        part = self.message.data[self.names.index(name)]
        outer, inner = part.layout.dim
        assert (outer.label, inner.label) == ("column_index", "row_index")
        assert (outer.stride, inner.stride) == (outer.size * inner.size, inner.size)
        assert part.layout.data_offset == 0 and len(part.data) == outer.stride
        assert part.data.dtype == np.float32
        rows, columns = np.mgrid[: inner.size, : outer.size]
        return part.data[columns * inner.size + rows]


def exported(folder: Path, **options: Any) -> tuple[Bag, dict[str, Any]]:
    options.setdefault("resolution", 0.1)
    [report] = export_simulators(yard(), folder, ("grid-map",), SceneOptions(**options))
    return Bag(report.folder), dict(report.manifest)


@pytest.mark.parametrize("origin", ["world", "local", "center", (1.5, -3.0, 0.25)])
def test_heights_are_where_they_stand(tmp_path: Path, origin: Any) -> None:
    """Each cell has the height of the terrain at its place; a mirrored or turned layer fails."""
    bag, _ = exported(tmp_path, origin=origin)
    x0, y0, z0 = {"world": (0, 0, 0), "local": (-2, 30, 0), "center": (2.5, 32.5, 0)}.get(
        str(origin), origin
    )
    x, y = bag.positions()
    heights, wanted = bag.layer("elevation"), yard().height(x[:, None] + x0, y + y0) - z0
    assert heights.shape == (90, 50)
    np.testing.assert_allclose(heights, wanted, atol=1e-6)
    for turned in (wanted[::-1], wanted[:, ::-1], wanted[::-1, ::-1]):
        assert np.nanmax(np.abs(turned - wanted)) > 1.0  # the terrain itself tells them apart
    assert np.isnan(heights).sum() == 10 * 5
    info = bag.message.info
    assert (info.resolution, info.length_x, info.length_y) == pytest.approx((0.1, 9.0, 5.0))
    assert (info.pose.position.x, info.pose.position.y) == pytest.approx((2.5 - x0, 32.5 - y0))
    assert info.pose.orientation.w == 1.0


@pytest.mark.parametrize("side", [0.35, 5.0])
def test_cells_that_do_not_divide_the_terrain(tmp_path: Path, side: float) -> None:
    """They count from the south-west corner; what reaches over the edge is not known."""
    bag, _ = exported(tmp_path, origin="world", resolution=side)
    x, y = bag.positions()
    assert (x[-1], y[-1]) == pytest.approx((-2 + side / 2, 30 + side / 2))
    assert (len(x), len(y)) == (math.ceil(9 / side), math.ceil(5 / side))
    wanted = yard().height(x[:, None], y)
    np.testing.assert_allclose(bag.layer("elevation"), wanted, atol=1e-6)
    assert np.isnan(wanted[0]).all() == (x[0] > 7)


def test_layers(tmp_path: Path) -> None:
    """What the definition says of four places, in all layers."""
    bag, manifest = exported(tmp_path, origin="world", friction=0.4)
    assert bag.topics == ["/grid_map"]
    assert bag.names == LAYERS and list(bag.message.basic_layers) == ["elevation"]
    assert (bag.message.outer_start_index, bag.message.inner_start_index) == (0, 0)
    x, y = bag.positions()
    indices = manifest["grid_map"]["surface_indices"]

    def at(east: float, north: float) -> dict[str, Any]:
        row, column = np.abs(x + 2 - east).argmin(), np.abs(y - 30 - north).argmin()
        return {name: bag.layer(name)[row, column] for name in bag.names}

    sand, slab, slope, bare = at(4.05, 2.05), at(2.05, 1.05), at(6.05, 3.55), at(8.55, 4.75)
    for place, name, friction in ((sand, "sand", math.tan(math.radians(30))), (slab, "slab", 0.4)):
        assert place["surface"] == indices[name]
        assert place["friction"] == pytest.approx(friction)
        assert place["slope"] == pytest.approx(math.atan(0.1))
    assert bare["surface"] == -1 and bare["friction"] == pytest.approx(0.4)
    assert int(np.float32(sand["color"]).view(np.uint32)) == 200 << 16 | 180 << 8 | 20
    assert int(np.float32(slab["color"]).view(np.uint32)) == 1 << 16 | 2 << 8 | 3
    # 0.1 up to the east, 0.5 up to the north
    length = math.sqrt(1 + 0.1**2 + 0.5**2)
    normal = [slope[f"normal_{axis}"] for axis in "xyz"]
    np.testing.assert_allclose(normal, np.array([-0.1, -0.5, 1.0]) / length, rtol=1e-5)
    assert slope["slope"] == pytest.approx(math.atan(math.hypot(0.1, 0.5)))
    assert all(math.isnan(value) for value in at(7.05, 0.55).values())


def test_a_vehicle_has_a_layer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same verdicts as in the map for Nav2, cell by cell, found out once for both."""
    judged = Mock(wraps=stream_map)
    monkeypatch.setattr("terratool.traversability.map.stream_map", judged)
    options = SceneOptions(vehicle=HUSKY, resolution=0.1, origin="world")
    nav2, grid_map = export_simulators(yard(), tmp_path, ("nav2", "grid-map"), options)
    assert judged.call_count == 1
    bag, manifest = Bag(grid_map.folder), grid_map.manifest
    pixels = (nav2.folder / "map.pgm").read_bytes().split(b"\n", 3)[3]
    from_north = np.frombuffer(pixels, np.uint8).reshape(50, 90)
    layer = bag.layer("traversability")
    cells = np.where(layer > 0, 254, 0)
    cells[np.isnan(layer)] = 205
    assert set(np.unique(cells).tolist()) == {0, 205, 254}
    np.testing.assert_array_equal(cells[::-1].T, from_north)
    assert manifest["grid_map"]["vehicle"]["file"] == "husky-a200.json"


def test_verdicts_are_those_of_the_map_for_nav2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where cells are larger than those: each has that in which its middle lies."""
    monkeypatch.setattr("terratool.simulators.grid_map.MOST", 27)
    judged = Mock(wraps=stream_map)
    monkeypatch.setattr("terratool.traversability.map.stream_map", judged)
    options = SceneOptions(vehicle=HUSKY, origin="world")
    # the hole ends between middles of cells of 0.05 and of a third
    *rest, hole = YARD["elemTree"]["children"]
    text = {
        **YARD,
        "elemTree": {**YARD["elemTree"], "children": [*rest, {**hole, "at": [6.67, 1.25]}]},
    }
    terrain = Terrain(check(Source("yard.json", json.dumps(text).encode())))
    nav2, grid_map = export_simulators(terrain, tmp_path, ("nav2", "grid-map"), options)
    assert judged.call_count == 1
    bag, facts = Bag(grid_map.folder), grid_map.manifest["grid_map"]
    pixels = (nav2.folder / "map.pgm").read_bytes().split(b"\n", 3)[3]
    from_south = np.frombuffer(pixels, np.uint8).reshape(100, 180)[::-1]
    (x, y), layer = bag.positions(), bag.layer("traversability")
    assert (facts["resolution"], facts["judged_resolution"]) == (pytest.approx(1 / 3), 0.05)
    assert layer.shape == (27, 15)
    columns, rows = (x + 2) / 0.05, (y - 30) / 0.05
    wanted = from_south[np.ix_(rows.astype(int), columns.astype(int))].T
    cells = np.where(layer > 0, 254, 0)
    cells[np.isnan(layer)] = 205
    known = ~np.isnan(bag.layer("elevation"))
    assert np.isnan(layer[~known]).all() and (wanted[~known] != 205).any()
    # middles on the line between two cells may be in either
    for whole in (columns, rows):
        apart = np.abs(whole - np.round(whole)) > 1e-6
        known &= apart[:, None] if whole is columns else apart
    assert known.sum() > 100
    np.testing.assert_array_equal(cells[known], wanted[known])
    assert {0, 205, 254} == set(np.unique(wanted[known]).tolist())


def test_what_lacks_a_soil_is_named(tmp_path: Path) -> None:
    """In the words of `traversability`; not without a vehicle."""
    file = tmp_path / "yard.json"
    file.write_text(json.dumps(YARD))
    ran = call("traversability", file, "--vehicle", HUSKY, "--resolution", "0.1")
    lacking = (
        'Surface "slab" lacks cohesion, fricAngle and sinkage; some of the ground has no surface.'
    )
    assert lacking in " ".join(ran.out.split())
    for vehicle in (HUSKY, None):
        options = SceneOptions(vehicle=vehicle, resolution=0.1)
        place = tmp_path / str(vehicle is None)
        for report in export_simulators(yard(), place, ("nav2", "grid-map"), options):
            said = [line for line in report.manifest["losses"] if "lacks" in line]
            assert said == [f"{lacking} Nothing is known of that ground."] * (vehicle is not None)


def test_losses_are_measured(tmp_path: Path) -> None:
    """The statement of export-dem: the box and its wall of 3 m are in it."""
    _, manifest = exported(tmp_path)
    assert manifest["losses"][0] == "A cell has what is at its middle, not a mean."
    assert "of wall became ramps" in manifest["losses"][1]
    assert "(3 m in one cell)" in manifest["losses"][1]
    # a hole has no friction to be assumed, ground without a surface has
    assert list(manifest["surfaces"]) == ["sand", "slab", "none"]
    assert manifest["losses"][2].endswith("as there is no fricAngle: slab, none.")


def test_the_same_bytes(tmp_path: Path) -> None:
    """Nothing of the clock or of the folder is in the files."""
    for name in ("one", "another"):
        bag, _ = exported(tmp_path / name)
    stamp = bag.message.header.stamp
    assert (bag.time, stamp.sec, stamp.nanosec, bag.message.header.frame_id) == (0, 0, 0, "map")
    assert bag.qos.durability.name == "TRANSIENT_LOCAL"
    files = [
        {
            path.relative_to(folder): path.read_bytes()
            for path in folder.rglob("*")
            if path.is_file()
        }
        for folder in (tmp_path / "one", tmp_path / "another")
    ]
    assert files[0] == files[1]
    names = {path.as_posix() for path in files[0]}
    bag_files = {"grid-map/grid_map/grid_map.mcap", "grid-map/grid_map/metadata.yaml"}
    assert names == {"grid-map/README.md", "grid-map/manifest.json", *bag_files}


def test_written_again(tmp_path: Path) -> None:
    """An earlier bag is replaced."""
    exported(tmp_path, origin="local")
    options = SceneOptions(resolution=0.5)
    [report] = export_simulators(yard(), tmp_path, ("grid-map",), options, overwrite=True)
    assert Bag(report.folder).layer("elevation").shape == (18, 10)


def test_too_large(tmp_path: Path) -> None:
    with pytest.raises(RequestError, match=r"message of 1\.4 GB"):
        exported(tmp_path / "o", resolution=0.001)
    assert not list(tmp_path.glob("o/*"))


def test_by_default_cells_are_few(tmp_path: Path) -> None:
    bag, _ = exported(tmp_path, resolution=None)
    assert bag.layer("elevation").shape == (180, 100)
