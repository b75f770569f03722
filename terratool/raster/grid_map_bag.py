"""Layers over a grid as grid_map messages in a ROS 2 bag.

The message is `grid_map_msgs/msg/GridMap` (github.com/ANYbotics/grid_map, `grid_map_msgs/msg`).
The layout follows grid_map's sources: `grid_map_core/src/GridMapMath.cpp` puts index (0, 0)
at the largest x and the largest y, rows along −x and columns along −y, and the map's position in
its middle; `grid_map_ros/include/grid_map_ros/GridMapMsgHelpers.hpp` names the outer dimension
"column_index" and the inner one "row_index", as Eigen keeps matrices column by column.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terratool.raster.grid import Grid

MOST_BYTES = 1 << 30
"""Most bytes of a message, which ROS 2 sends in one piece."""
TOPIC = "/grid_map"
"""Topic of the finest map."""
TYPE = "grid_map_msgs/msg/GridMap"

Layers = dict[str, NDArray[np.float32]]

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


@dataclass(frozen=True, slots=True)
class GridMap:
    """Content of a GridMap message.

    Attributes:
        grid: cells of the map.
        middle: x and y of the centre of the map in the frame "map", m.
        layers: (height, width) float32 by name, rows from the north; one is named elevation.
        topic: topic of the message.
    """

    grid: Grid
    middle: tuple[float, float]
    layers: Layers
    topic: str = TOPIC


def files_of_bag(path: Path) -> tuple[str, str]:
    """Names of all files in a bag written at `path`."""
    return "metadata.yaml", f"{Path(os.path.realpath(path)).name}.mcap"


def write_grid_maps(path: Path, maps: Sequence[GridMap]) -> None:
    """Write a bag, a folder, of messages at time 0 with transient local durability."""
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

    # the types within a GridMap are the same in all distributions
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in (("grid_map_msgs/msg/GridMapInfo", _INFO), (TYPE, _GRID_MAP)):
        store.register(get_types_from_msg(text, name))
    kind = store.types
    header = kind["std_msgs/msg/Header"](kind["builtin_interfaces/msg/Time"](0, 0), "map")
    dimension = kind["std_msgs/msg/MultiArrayDimension"]
    never = QosTime(0, 0)
    kept = Qos(
        QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, never,
        never, QosLiveliness.AUTOMATIC, never, False,
    )  # fmt: skip
    # until version 8, before Jazzy, the quality of service is a text, which later readers accept
    with Writer(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        for one in maps:
            grid = one.grid
            pose = kind["geometry_msgs/msg/Pose"](
                kind["geometry_msgs/msg/Point"](*one.middle, 0.0),
                kind["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
            )
            lengths = grid.width * grid.resolution, grid.height * grid.resolution
            info = kind["grid_map_msgs/msg/GridMapInfo"](grid.resolution, *lengths, pose)
            layout = kind["std_msgs/msg/MultiArrayLayout"](
                [
                    dimension("column_index", grid.height, grid.height * grid.width),
                    dimension("row_index", grid.width, grid.width),
                ],
                0,
            )
            # rows of a grid_map run west, columns south
            data = [
                kind["std_msgs/msg/Float32MultiArray"](
                    layout, np.ascontiguousarray(layer[:, ::-1]).ravel()
                )
                for layer in one.layers.values()
            ]
            message = kind[TYPE](header, info, list(one.layers), ["elevation"], data, 0, 0)
            to = writer.add_connection(
                one.topic, TYPE, typestore=store, offered_qos_profiles=[kept]
            )
            writer.write(to, 0, store.serialize_cdr(message, TYPE))
