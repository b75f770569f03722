"""Layers of a terrain as one message of grid_map, in a bag of ROS 2.

The message is `grid_map_msgs/msg/GridMap` (github.com/ANYbotics/grid_map, `grid_map_msgs/msg`).
How it is laid out follows grid_map's sources: `grid_map_core/src/GridMapMath.cpp` puts index (0, 0)
at the largest x and the largest y, rows along −x and columns along −y, and the map's position in
its middle; `grid_map_ros/include/grid_map_ros/GridMapMsgHelpers.hpp` names the outer dimension
"column_index" and the inner one "row_index", as Eigen keeps matrices column by column.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.raster.grid import Grid, Window
from terratool.raster.loss import LossCounts, LossFinder, RasterLoss
from terratool.raster.painter import Painter
from terratool.raster.prefetch import TILE, prefetch, processors
from terratool.simulators.cells import cell_grid
from terratool.simulators.scene import Scene
from terratool.simulators.targets import Written
from terratool.text.display import counted, length
from terratool.traversability.results import GroundClass

MOST = 1024
"""The longer side has at most so many cells, if no resolution is given …"""
MOST_BYTES = 1 << 30
"""… and a message at most so many bytes: ROS 2 sends it in one piece."""
TOPIC = "/grid_map"
BAG = "grid_map"
TYPE = "grid_map_msgs/msg/GridMap"
GO, CAUTION, NO_GO = 1.0, 0.5, 0.0
"""Values of the layer "traversability"."""

_NAMES = (
    "elevation", "normal_x", "normal_y", "normal_z", "slope", "friction", "surface", "color",
)  # fmt: skip
_INFO = """\
float64 resolution
float64 length_x
float64 length_y
geometry_msgs/Pose pose
"""
_GRID_MAP = """\
std_msgs/Header header
grid_map_msgs/GridMapInfo info
string[] layers
string[] basic_layers
std_msgs/Float32MultiArray[] data
uint16 outer_start_index
uint16 inner_start_index
"""

Layers = dict[str, NDArray[np.float32]]

_NOTE = (
    "Layers: elevation in metres; normal_x, normal_y, normal_z of the unit normal; slope, the "
    "steepest, in radians from level; friction, a coefficient; surface, the index of a surface as "
    "in `surface_indices` of manifest.json, −1 for none; color, for RViz (8 bits each of red, "
    "green and blue, in the bits of a float). {}The basic layer is elevation; void, and what "
    "lies outside, is NaN in all."
)
_TRAVERSABILITY = (
    "traversability of {}, with its middle there: 1 for go, 0.5 for caution, 0 for what it "
    "cannot be driven on, get to or come back from, NaN for what is not known, judged in cells of "
    "{}, those of the map for Nav2. "
)
_PLAY = (
    "The bag is MCAP; on Humble install ros-humble-rosbag2-storage-mcap. grid_map_msgs comes with "
    "ros-DISTRO-grid-map-msgs. RViz shows it with the display GridMap, the fixed frame being map."
)


def write(scene: Scene, folder: Path) -> Written:
    """Write a folder grid_map, which is the bag.

    Raises:
        RequestError: as of `check`.
    """
    grid = _cells(scene)
    scene.say("sampling cells")
    layers, loss = _sampled(scene, grid)
    by, more, lacking = dict[str, Any](), "", ""
    verdict = scene.verdict
    if verdict is not None:
        values = _traversability(verdict.at_middles(grid))
        values[np.isnan(layers["elevation"])] = np.nan
        layers["traversability"] = values
        by, lacking = {**verdict.facts}, verdict.lacking
        more = _TRAVERSABILITY.format(verdict.vehicle, length(verdict.grid.resolution))
    x, y, _ = scene.zero
    west, south, east, north = grid.bounds
    middle = 0.5 * (west + east) - x, 0.5 * (south + north) - y
    scene.say("writing the bag")
    _write_bag(folder / BAG, grid, middle, layers)
    return Written(
        summary=f"{grid.width} × {grid.height} cells of {length(grid.resolution)}, "
        f"{counted(len(layers), 'layer')}",
        load=(f"ros2 bag play --loop --delay 1 {BAG}", f"ros2 topic info --verbose {TOPIC}"),
        language="sh",
        notes=(_NOTE.format(more), _PLAY),
        losses=(
            "A cell has what is at its middle, not a mean.",
            loss.sentence(grid.resolution, "cell"),
            *filter(None, [lacking]),
        ),
        facts={
            "grid_map": {
                "topic": TOPIC,
                "frame_id": "map",
                "resolution": grid.resolution,
                "size": [grid.width, grid.height],
                "position": list(middle),
                "layers": list(layers),
                "surface_indices": {
                    name: index for index, name in enumerate(scene.terrain.surfaces)
                },
                **by,
            }
        },
        meshed=False,
    )


def check(scene: Scene) -> None:
    """Refuse cells that no message can have.

    Raises:
        RequestError: there are too many, they are too large, or they do not go with the vehicle.
    """
    scene.cells()
    grid, layers = _cells(scene), len(_NAMES) + (scene.judge is not None)
    size = 4 * layers * grid.width * grid.height
    if size > MOST_BYTES:
        raise RequestError(
            f"{grid.width} × {grid.height} cells make a message of {size / 1e9:.1f} GB.",
            f"Give a coarser --resolution; a message may have {MOST_BYTES / 1e9:.1f} GB.",
        )


def _cells(scene: Scene) -> Grid:
    """Those of the layers: fewer than those that the vehicle judges."""
    return cell_grid(scene.terrain, scene.options.resolution, MOST)


class _Part(NamedTuple):
    """What a window has: bands (layers, height, width) float32, and what they lose."""

    window: Window
    bands: NDArray[np.float32]
    lost: LossCounts


def _sampled(scene: Scene, grid: Grid) -> tuple[Layers, RasterLoss]:
    """Layers of what is at the middles of cells, (height, width) from the north; what they lose."""
    terrain, zero = scene.terrain, scene.zero[2]
    finder = LossFinder(terrain, grid)
    painter = Painter(terrain, grid, np.float64, slopes=True, labels=finder.for_walls)
    frictions, colors = _tables(scene)

    def made(window: Window) -> _Part:
        whole = finder.with_neighbours(window)
        planes = painter.paint(whole)
        lost = finder.of(window, planes)
        planes = planes.cropped(window.height, window.width)
        assert planes.surfaces is not None
        assert planes.slope_x is not None and planes.slope_y is not None
        steep = np.hypot(planes.slope_x, planes.slope_y)
        up = 1.0 / np.hypot(steep, 1.0)
        bands = np.empty((len(_NAMES), window.height, window.width), np.float32)
        bands[0] = planes.heights - zero
        bands[1], bands[2], bands[3] = 0.0 - planes.slope_x * up, 0.0 - planes.slope_y * up, up
        bands[4] = np.arctan(steep)
        bands[5] = frictions[planes.surfaces]
        bands[6] = planes.surfaces.astype(np.float32) - 1.0
        bands[7] = colors[planes.surfaces]
        bands[:, np.isnan(planes.heights)] = np.nan
        return _Part(window, bands, lost)

    out = np.empty((len(_NAMES), grid.height, grid.width), np.float32)
    lost = LossCounts()
    for window, bands, more in prefetch(made, grid.windows(TILE, TILE), processors()):
        rows = slice(window.row, window.row + window.height)
        out[:, rows, window.column : window.column + window.width] = bands
        lost += more
    nodata = int(np.isnan(out[0]).sum())
    return dict(zip(_NAMES, out, strict=True)), finder.statement(lost, nodata)


def _tables(scene: Scene) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Frictions and colours, in the bits of floats, by the index of a surface and one."""
    materials = [scene.material(surface) for surface in range(-1, len(scene.terrain.surfaces))]
    frictions = np.array([one.friction for one in materials], np.float32)
    colors = [red << 16 | green << 8 | blue for red, green, blue in (m.color for m in materials)]
    return frictions, np.array(colors, np.uint32).view(np.float32)


def _traversability(classes: NDArray[np.uint8]) -> NDArray[np.float32]:
    values = np.full(len(GroundClass), NO_GO, np.float32)
    values[GroundClass.GO], values[GroundClass.CAUTION] = GO, CAUTION
    values[GroundClass.UNKNOWN] = np.nan
    return values[classes]


def _write_bag(path: Path, grid: Grid, middle: tuple[float, float], layers: Layers) -> None:
    """One message at time 0, kept for those who subscribe later."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    # the types that a GridMap has in it are the same in all distributions
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in (("grid_map_msgs/msg/GridMapInfo", _INFO), (TYPE, _GRID_MAP)):
        store.register(get_types_from_msg(text, name))
    kind = store.types
    header = kind["std_msgs/msg/Header"](kind["builtin_interfaces/msg/Time"](0, 0), "map")
    pose = kind["geometry_msgs/msg/Pose"](
        kind["geometry_msgs/msg/Point"](*middle, 0.0),
        kind["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
    )
    lengths = grid.width * grid.resolution, grid.height * grid.resolution
    info = kind["grid_map_msgs/msg/GridMapInfo"](grid.resolution, *lengths, pose)
    dimension = kind["std_msgs/msg/MultiArrayDimension"]
    layout = kind["std_msgs/msg/MultiArrayLayout"](
        [
            dimension("column_index", grid.height, grid.height * grid.width),
            dimension("row_index", grid.width, grid.width),
        ],
        0,
    )
    # rows of a grid_map run to the west, its columns to the south
    data = [
        kind["std_msgs/msg/Float32MultiArray"](layout, np.ascontiguousarray(layer[:, ::-1]).ravel())
        for layer in layers.values()
    ]
    message = kind[TYPE](header, info, list(layers), ["elevation"], data, 0, 0)
    never = QosTime(0, 0)
    kept = Qos(
        QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, never,
        never, QosLiveliness.AUTOMATIC, never, False,
    )  # fmt: skip
    # before version 9, of Jazzy, the quality of service is a text, which later ones read, too
    with Writer(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        to = writer.add_connection(TOPIC, TYPE, typestore=store, offered_qos_profiles=[kept])
        writer.write(to, 0, store.serialize_cdr(message, TYPE))
