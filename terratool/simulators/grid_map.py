"""Layers of a terrain as one message of grid_map, in a bag of ROS 2."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.io.geotiff import TILE
from terratool.raster.grid import Grid, Window, window_name
from terratool.raster.grid_map_bag import MOST_BYTES, TOPIC, GridMap, Layers, write_grid_maps
from terratool.raster.loss import LossCounts, LossFinder, RasterLoss
from terratool.raster.painter import Painter
from terratool.report.numbers import metres
from terratool.report.wording import count_of
from terratool.simulators.cells import cell_grid
from terratool.simulators.scene import Scene
from terratool.simulators.storey_cells import SheetTops, middles_near, sheet_tops
from terratool.simulators.targets import WrittenFiles
from terratool.tasks import Work
from terratool.traversability.layers import sheets_of
from terratool.traversability.notes import headroom_note
from terratool.traversability.verdicts import GroundClass

MOST = 1024
"""Most cells on the longer side, if no resolution is given."""
BAG = "grid_map"
GO, CAUTION, NO_GO = 1.0, 0.5, 0.0
"""Values of the layer "traversability" for ground that is go, caution and no-go."""

_NAMES = (
    "elevation", "normal_x", "normal_y", "normal_z", "slope", "friction", "surface", "color",
)  # fmt: skip
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
_CEILING = "ceiling, the bottom of what is over the elevation, in metres, NaN under the sky. "
_STOREYS = (
    f"{TOPIC} has the lowest tops: the ground, below decks too, and the ground over a bore. "
    f"{TOPIC}/storey_1 and so on have the tops of decks and the floors of bores, NaN where they "
    "have none; those in one map do not lie over each other."
)
_PLAY = (
    "The bag is MCAP; on Humble install ros-humble-rosbag2-storage-mcap. grid_map_msgs comes with "
    "ros-DISTRO-grid-map-msgs. RViz shows it with the display GridMap, the fixed frame being map."
)


def write(scene: Scene, folder: Path) -> WrittenFiles:
    """Write the bag as a folder grid_map into a folder.

    Raises:
        RequestError: `check` refuses the cells.
    """
    grid = _layer_grid(scene)
    scene.say("sampling cells")
    sheets, loss = _sample_layers(scene, grid)
    layers, topics = sheets[0], _topics(len(sheets))
    by, more, lacking = dict[str, Any](), "", ""
    verdict = scene.verdict
    if verdict is not None:
        for one, judged in zip(sheets, (verdict, *verdict.storeys), strict=True):
            values = _traversability(judged.at_middles(grid))
            values[np.isnan(one["elevation"])] = np.nan
            one["traversability"] = values
        by, lacking = {**verdict.facts}, verdict.lacking
        more = _TRAVERSABILITY.format(verdict.vehicle, metres(verdict.grid.resolution))
    x, y, _ = scene.zero
    west, south, east, north = grid.bounds
    middle = 0.5 * (west + east) - x, 0.5 * (south + north) - y
    scene.say("writing the bag")
    maps = [GridMap(grid, middle, *one) for one in zip(sheets, topics, strict=True)]
    write_grid_maps(folder / BAG, maps)
    summary = f"{grid.width} × {grid.height} cells of {metres(grid.resolution)}, "
    summary += count_of(len(layers), "layer")
    if len(sheets) > 1:
        summary += f"; {count_of(len(sheets) - 1, 'map')} of decks and bores"
        more += _CEILING
        if scene.judge is not None:
            lacking = " ".join(
                [lacking, *headroom_note(scene.terrain, scene.judge.vehicle)]
            ).strip()
    return WrittenFiles(
        summary=summary,
        load=(f"ros2 bag play --loop --delay 1 {BAG}", f"ros2 topic info --verbose {TOPIC}"),
        language="sh",
        notes=(_NOTE.format(more), *[_STOREYS] * (len(sheets) > 1), _PLAY),
        losses=(
            "A cell has what is at its middle, not a mean.",
            loss.sentence(grid.resolution, "cell"),
            *["That is of the ground; decks and bores are not counted."] * (len(sheets) > 1),
            *filter(None, [lacking]),
        ),
        facts={
            "grid_map": {
                "topic": TOPIC,
                **({"topics_of_storeys": topics[1:]} if len(sheets) > 1 else {}),
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
    """Refuse cells that no message can hold.

    Raises:
        RequestError: the cells are too many or too large, or do not go with the vehicle.
    """
    scene.cells()
    grid, layers = _layer_grid(scene), len(_names_of(scene.terrain)) + (scene.judge is not None)
    size = 4 * layers * grid.width * grid.height
    if size > MOST_BYTES:
        raise RequestError(
            f"{grid.width} × {grid.height} cells make a message of {size / 1e9:.1f} GB.",
            f"Give a coarser --resolution; a message may have {MOST_BYTES / 1e9:.1f} GB.",
        )


def _layer_grid(scene: Scene) -> Grid:
    """Return the grid of the layers, by default of fewer cells than the vehicle judges."""
    return cell_grid(scene.terrain, scene.options.resolution, MOST)


def _names_of(terrain: Terrain) -> tuple[str, ...]:
    """Names of the layers of a terrain, but for a vehicle's."""
    return (*_NAMES, *["ceiling"] * (terrain.storeys is not None))


def _topics(maps: int) -> list[str]:
    """Topics of maps: that of the lowest tops, and one of each sheet of storeys."""
    return [TOPIC, *(f"{TOPIC}/storey_{number}" for number in range(1, maps))]


class _LayerWindow(NamedTuple):
    """Layers of a window.

    Attributes:
        window: window of the grid.
        bands: (sheets, layers, height, width) float32 values at the middles of cells.
        lost: counts of what the cells lose.
    """

    window: Window
    bands: NDArray[np.float32]
    lost: LossCounts


class LayerSampler:
    """Sampler of layers at the middles of cells; several threads may use one at a time.

    Args:
        terrain: the ground.
        grid: the cells.
        zero: height of the zero of the files.
        frictions: (surfaces + 1,) float32 frictions by surface index + 1.
        colors: (surfaces + 1,) float32 colours by surface index + 1.
    """

    def __init__(
        self, terrain: Terrain, grid: Grid, zero: float,
        frictions: NDArray[np.float32], colors: NDArray[np.float32],
    ) -> None:  # fmt: skip
        self._given = terrain, grid, zero, frictions, colors
        self._terrain, self._names = terrain, _names_of(terrain)
        self.finder = LossFinder(terrain, grid)
        labels = self.finder.for_walls
        self._painter = Painter(terrain, grid, np.float64, slopes=True, labels=labels)

    def __reduce__(self) -> tuple[Any, ...]:
        return LayerSampler, self._given

    def sample(self, window: Window) -> _LayerWindow:
        """Sample the layers of a window."""
        *_, zero, frictions, colors = self._given
        whole = self.finder.with_neighbours(window)
        planes = self._painter.paint(whole)
        lost = self.finder.of(window, planes)
        planes = planes.part(*window.within(whole))
        assert planes.surfaces is not None
        assert planes.slope_x is not None and planes.slope_y is not None
        tops = SheetTops.empty((sheets_of(self._terrain), *planes.heights.shape))
        tops.top[0], tops.surface[0] = planes.heights, planes.surfaces
        tops.slope_x[0], tops.slope_y[0] = planes.slope_x, planes.slope_y
        if self._terrain.storeys is not None:
            near, x, y = middles_near(self._terrain, self._given[1], window)
            values: Any
            for values, here in zip(tops, sheet_tops(self._terrain, x, y), strict=True):
                values[:, near] = here
        steep = np.hypot(tops.slope_x, tops.slope_y)
        up = 1.0 / np.hypot(steep, 1.0)
        sheets, *shape = tops.top.shape
        bands = np.empty((sheets, len(self._names), *shape), np.float32)
        layers = bands.swapaxes(0, 1)
        layers[0] = tops.top - zero
        layers[1], layers[2], layers[3] = 0.0 - tops.slope_x * up, 0.0 - tops.slope_y * up, up
        layers[4] = np.arctan(steep)
        layers[5] = frictions[tops.surface]
        layers[6] = tops.surface.astype(np.float32) - 1.0
        layers[7] = colors[tops.surface]
        layers[:, np.isnan(tops.top)] = np.nan
        if self._terrain.storeys is not None:
            layers[8] = tops.ceiling - zero
        return _LayerWindow(window, bands, lost)


def _sample_layers(scene: Scene, grid: Grid) -> tuple[list[Layers], RasterLoss]:
    """Return layers at cell middles by name, (height, width) from the north; and their loss.

    Those of the ground are the first, and those of each sheet of storeys follow.
    """
    terrain = scene.terrain
    sampler = LayerSampler(terrain, grid, scene.zero[2], *_surface_tables(scene))
    work = Work(LayerSampler.sample, sampler, name=window_name)
    names = _names_of(terrain)
    out = np.empty((sheets_of(terrain), len(names), grid.height, grid.width), np.float32)
    lost = LossCounts()
    with contextlib.closing(scene.crew.run(work, grid.windows(TILE, TILE))) as found:
        for window, bands, more in found:
            rows = slice(window.row, window.row + window.height)
            out[:, :, rows, window.column : window.column + window.width] = bands
            lost += more
    nodata = int(np.isnan(out[0, 0]).sum())
    sheets = [dict(zip(names, layers, strict=True)) for layers in out]
    return sheets, sampler.finder.statement(lost, nodata)


def _surface_tables(scene: Scene) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return tables by surface index + 1: friction, and 0xRRGGBB in the bits of a float32."""
    materials = [scene.material(surface) for surface in range(-1, len(scene.terrain.surfaces))]
    frictions = np.array([one.friction for one in materials], np.float32)
    colors = [red << 16 | green << 8 | blue for red, green, blue in (m.color for m in materials)]
    return frictions, np.array(colors, np.uint32).view(np.float32)


def _traversability(classes: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the layer "traversability" of ground classes; NaN for unknown ground."""
    values = np.full(len(GroundClass), NO_GO, np.float32)
    values[GroundClass.GO], values[GroundClass.CAUTION] = GO, CAUTION
    values[GroundClass.UNKNOWN] = np.nan
    return values[classes]
