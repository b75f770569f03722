"""Layers of a picture: colours of the pixels of a grid over a terrain, and their legend.

Only the pixels of the picture are painted, however fine the terrain is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from string import ascii_uppercase
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.mesh.build import GREY
from terratool.mesh.formats.common import NO_COLOR
from terratool.raster.grid import Grid, Window, grid_over
from terratool.raster.layers import LAYERS, Layer, LayerBands, SurfaceValues, layer_painter
from terratool.raster.painter import COLUMN_BANDS, Painter, Planes
from terratool.report.wording import join_words
from terratool.tasks import prefetch, processors
from terratool.text.display import quote
from terratool.text.meaning import guess
from terratool.traversability.judge import Judge
from terratool.traversability.map import default_resolution
from terratool.traversability.report.drawing import SHADING, hatch
from terratool.traversability.verdicts import COLORS, GroundClass
from terratool.viewing.sheet import Legend, Scale, Swatch
from terratool.viewing.vision import look_alike

FINER = 2
"""Painted pixels per pixel of the picture and side; a pixel of the picture is their mean."""
VERDICTS = ("traversability", "traversability-worst")
"""Names of the layers of verdicts: by the best heading at each place, and by the worst."""
JUDGED = (*VERDICTS, "foothold")
"""Names of the layers that need a vehicle."""
NAMES = ("height", "slope", "surface", "friction", "clearance", "storeys", *JUDGED)
"""Names of the layers."""

VOID = (255, 255, 255)
"""Colour of pixels without ground, below slanted lines."""
NO_GROUND = "void, no ground"
"""Words of a legend for pixels without ground."""
_VOID_LINE = (170, 170, 170)
"""Colour of the slanted lines on pixels without ground."""

PALETTE = (
    (230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66), (0, 114, 178), (213, 94, 0),
    (204, 121, 167),
)  # fmt: skip
"""Colours for surfaces that have none, distinct for any kind of colour vision (M. Okabe and K. Ito,
Color universal design, 2008)."""

_COLORS = {
    "height": "cividis", "slope": "viridis", "friction": "viridis", "foothold": "viridis",
    "clearance": "viridis", "storeys": "cividis",
}  # fmt: skip
"""Colour maps of layers of numbers, even to any kind of colour vision (J. R. Nuñez, C. R. Anderton
and R. S. Renslow, Optimizing colormaps with consideration for color vision deficiency, PLOS ONE
13(7), 2018)."""
_TITLES = {
    "height": "height (m)", "slope": "slope (°)", "friction": "friction angle (°)",
    "foothold": "foothold margin", "clearance": "clearance (m)", "storeys": "tops",
}  # fmt: skip
"""Titles of the scales of layers of numbers."""
_UNKNOWN = {"friction": "no fricAngle", "clearance": "open to the sky"}
"""Words of a legend for pixels without a value; "unknown" for other layers."""
_ROWS = 128
"""Number of rows of a window that a thread paints."""
_MAP_PIXELS = 1024
"""Most pixels on the longer side of a map of verdicts, unless these are too coarse."""
_HATCHES = {
    GroundClass.NO_GO: "////",
    GroundClass.CUT_OFF: "\\\\\\\\",
    GroundClass.ONE_WAY: "\\\\\\\\",
    GroundClass.UNKNOWN: "..",
}
"""Patterns of Matplotlib for legends that look like `hatch` in pictures."""

Colors = NDArray[np.uint8] | NDArray[np.float64]
"""Colours, (height, width, 3) red, green, blue from 0 to 255."""


class Light(NamedTuple):
    """Light on the colours of a picture.

    Attributes:
        contrast: change of the factor on a colour per change of the hill shade.
        shade, glare: smallest and largest factor on a colour.
        steeper: largest factor on slopes in shading.
    """

    contrast: float
    shade: float
    glare: float
    steeper: float


_ON_SURFACES = Light(0.75, 0.5, 1.2, 10.0)
"""Light on the colours of surfaces."""
_ON_HEIGHTS = Light(0.4, 0.7, 1.1, 2.0)
"""Light on the colours of heights."""
_ON_VERDICTS = Light(0.4, *SHADING, 10.0)
"""Light on the colours of verdicts, too weak to turn one verdict's lightness to another's."""


@dataclass(frozen=True, slots=True)
class LayerPicture:
    """A layer over a grid.

    Attributes:
        grid: pixels of the layer.
        heights: (height, width) float64 m, rows from the north; NaN where there is no ground.
        surfaces: (height, width) index of the surface and one, 0 for none.
        colors: (height, width, 3) from 0 to 255, without light; undefined where there is no
            ground.
        key: legend of the colours.
        light: light on the colours; None where shading would hide the colours' meaning.
        classes: (height, width) uint8 `GroundClass` of verdicts; None for other layers.
        notes: sentences on facts that the picture does not show.
        letters: letters of the legend, with their numbers in `surfaces`; none where anybody can
            tell the colours apart.
    """

    grid: Grid
    heights: NDArray[Any]
    surfaces: NDArray[Any]
    colors: Colors
    key: Legend
    light: Light | None
    classes: NDArray[np.uint8] | None = None
    notes: tuple[str, ...] = ()
    letters: tuple[tuple[str, int], ...] = ()

    def rows(self, start: int, stop: int) -> LayerPicture:
        """The layer with the pixels of some rows only; `grid` is still that of all rows."""
        part = slice(start, stop)
        return replace(
            self,
            heights=self.heights[part],
            surfaces=self.surfaces[part],
            colors=self.colors[part],
            classes=None if self.classes is None else self.classes[part],
        )

    def named(self, label: str, other: str) -> LayerPicture:
        """The layer with other words for a line of its legend."""
        swatches = (
            one._replace(label=other) if one.label == label else one for one in self.key.swatches
        )
        return replace(self, key=self.key._replace(swatches=tuple(swatches)))


def surface_colors(terrain: Terrain) -> tuple[NDArray[np.uint8], list[str]]:
    """Colours by id, (surfaces + 1, 3) uint8, and names of surfaces whose colour is chosen here.

    Id 0 is ground without a surface. Surfaces without a colour get the colours of `PALETTE` in
    turn, and grey once these are used up.
    """
    colors: list[tuple[int, ...]] = [NO_COLOR]
    without: list[str] = []
    for name, surface in terrain.surface_types.items():
        if surface.color is not UNSET:
            colors.append(tuple(surface.color))
            continue
        colors.append(PALETTE[len(without)] if len(without) < len(PALETTE) else GREY)
        if surface.void is not True:
            without.append(name)
    return np.array(colors, np.uint8), without


def paint_ground(terrain: Terrain, grid: Grid, layer: Layer = LAYERS["surface"]) -> Planes:
    """Paint heights, surfaces and what a layer needs at the pixels of a grid, in parallel.

    Where there are storeys, they are those of the highest tops.
    """
    bands = COLUMN_BANDS if layer.columns else 0
    painter = Painter(terrain, grid, np.float64, slopes=layer.slopes, storeys=bands)
    whole = painter.blank(grid.whole)
    windows = list(grid.windows(_ROWS, grid.width))

    def paint(window: Any) -> None:
        """Paint the rows of a window."""
        rows = slice(window.row, window.row + window.height)
        plane: Any
        for plane, part in zip(whole, painter.paint(window), strict=True):
            if plane is not None:
                plane[..., rows, :] = part

    for _ in prefetch(paint, windows, processors()):
        pass
    return whole


def paint_below(terrain: Terrain, grid: Grid, cut: float) -> Planes:
    """Paint heights, surfaces and slopes of the highest tops that are not above a height."""
    painter = Painter(terrain, grid, np.float64, slopes=True)
    whole = painter.blank(grid.whole)

    def paint(window: Window) -> None:
        """Paint the rows of a window."""
        x, y = np.meshgrid(grid.columns(window), grid.rows(window))
        found = terrain.sample(x, y, below=cut)
        rows = slice(window.row, window.row + window.height)
        part = whole.part(rows, slice(None))
        assert part.surfaces is not None
        assert part.slope_x is not None and part.slope_y is not None
        part.heights[:], part.surfaces[:] = found.height, found.surface + 1
        part.slope_x[:] = -found.normal[..., 0] / found.normal[..., 2]
        part.slope_y[:] = -found.normal[..., 1] / found.normal[..., 2]

    for _ in prefetch(paint, list(grid.windows(_ROWS, grid.width)), processors()):
        pass
    return whole


def layer_picture(
    terrain: Terrain,
    grid: Grid,
    layer: str,
    judge: Judge | None = None,
    progress: Callable[[str], object] = lambda _: None,
    cut: float | None = None,
) -> LayerPicture:
    """Paint a layer at the pixels of a grid.

    Args:
        terrain: the ground.
        grid: pixels of the layer.
        layer: name of the layer, one of `NAMES`.
        judge: vehicle of the layers of `JUDGED`; None for other layers.
        progress: called with words on the step that begins.
        cut: height above which nothing is shown; None to show all.

    Raises:
        RequestError: no surface has the figure of the layer; there is no ground; or the ground is
            too large for the vehicle's verdict.
    """
    if layer == "friction":
        _refuse_unknown_friction(terrain)
    shown = LAYERS["surface" if layer in JUDGED else layer]
    if shown.columns:
        _refuse_single_tops(terrain, layer)
    progress("painting")
    planes = paint_ground(terrain, grid, shown) if cut is None else paint_below(terrain, grid, cut)
    ground = ~np.isnan(planes.heights)
    if cut is not None and not ground.any():
        raise RequestError(
            f"No top lies below the cut at {cut:,.6g}.", "Give a greater height, or other bounds."
        )
    if not ground.any():
        raise RequestError(
            "There is no ground to be drawn: all of it is void.", "Choose other bounds."
        )
    assert planes.surfaces is not None
    if layer == "surface":
        return _surface_layer(terrain, grid, planes)
    if layer in VERDICTS:
        assert judge is not None
        return _verdict_layer(terrain, grid, planes, judge, progress, layer == VERDICTS[1])
    if layer == "foothold":
        assert judge is not None
        return _foothold_layer(terrain, grid, planes, judge, progress)
    return _number_layer(terrain, grid, planes, layer)


def _refuse_unknown_friction(terrain: Terrain) -> None:
    """Refuse a terrain on which no surface has a friction angle."""
    values = SurfaceValues(terrain).values(LAYERS["friction"], np.dtype(np.float64))
    if np.isnan(values).all():
        raise RequestError(
            "No surface of the terrain has a fricAngle, so there is no friction to be drawn.",
            "Add one to a surface, or a preset; or choose another layer.",
        )


def _refuse_single_tops(terrain: Terrain, layer: str) -> None:
    """Refuse a terrain on which nothing stands over other ground."""
    if terrain.storeys is None:
        raise RequestError(
            f"Nothing stands over other ground, so there is no layer {layer} to be drawn.",
            "Add a deck or a bore, or choose another layer.",
        )


def _surface_layer(terrain: Terrain, grid: Grid, planes: Planes) -> LayerPicture:
    """The layer `surface`, with letters where colours look alike to some."""
    assert planes.surfaces is not None
    colors, without = surface_colors(terrain)
    seen = np.bincount(planes.surfaces[~np.isnan(planes.heights)].ravel(), minlength=len(colors))
    drawn_ids = [*filter(seen.__getitem__, range(1, len(colors))), *[0] * bool(seen[0])]
    letters = [""] * len(drawn_ids)
    if len(drawn_ids) <= len(ascii_uppercase) and look_alike(colors[drawn_ids]):
        letters = list(ascii_uppercase[: len(drawn_ids)])
    names = ["no surface", *terrain.surfaces]
    swatches = [
        Swatch(names[id_], _rgb(colors[id_]), letter=letter)
        for id_, letter in zip(drawn_ids, letters, strict=True)
    ]
    pairs = tuple(pair for pair in zip(letters, drawn_ids, strict=True) if pair[0])
    drawn = [name for name in without if seen[terrain.surfaces.index(name) + 1]]
    notes = []
    if drawn:
        has = "has" if len(drawn) == 1 else "have"
        notes.append(
            f"{join_words([quote(name) for name in drawn])} {has} no color in the definition; "
            "those of the legend were chosen here."
        )
    return LayerPicture(
        grid, planes.heights, planes.surfaces, colors[planes.surfaces],
        Legend("surface", (*swatches, *void_swatch(planes.heights))), _ON_SURFACES,
        notes=tuple(notes), letters=pairs,
    )  # fmt: skip


def _number_layer(terrain: Terrain, grid: Grid, planes: Planes, layer: str) -> LayerPicture:
    """A layer of numbers, with a scale of colours; counts have a line for each in the legend."""
    from matplotlib import colormaps

    if LAYERS[layer].slopes:
        terrain.refuse_degrees(f"The layer {layer}")
    bands, ground = np.empty((1, *planes.heights.shape)), ~np.isnan(planes.heights)
    painter = layer_painter(LayerBands.of([LAYERS[layer]], np.dtype(np.float64)), terrain, grid)
    painter(planes, bands, np.s_[:, :])
    values = bands[0]
    known = ground & np.isfinite(values)
    low, high = (float(end(values[known])) if known.any() else 0.0 for end in (np.min, np.max))
    if layer == "slope":
        low = 0.0
    if not high - low > 1e-9 * max(1.0, abs(high)):
        low, high = low - 0.5 * (layer != "slope"), high + 0.5
    scale = Scale(_TITLES[layer], low, high, _COLORS[layer])
    part = np.where(known, (values - low) / (high - low), 0.0)
    colors = colormaps[scale.colors](part, bytes=True)[..., :3]
    swatches = []
    if (unknown := ground & ~known).any():
        colors[unknown] = NO_COLOR
        swatches.append(Swatch(_UNKNOWN.get(layer, "unknown"), NO_COLOR))
    key = Legend("", (*swatches, *void_swatch(planes.heights)), scale)
    if layer == "storeys":
        counts, first = np.unique(values[known], return_index=True)
        lines = zip(counts.tolist(), colors[known][first], strict=True)
        swatches = [Swatch(f"{count:g}", _rgb(color)) for count, color in lines]
        key = Legend(scale.title, (*swatches, *void_swatch(planes.heights)))
    light = _ON_HEIGHTS if layer == "height" else None
    return LayerPicture(grid, planes.heights, _ids(planes), colors, key, light)


def _verdict_layer(
    terrain: Terrain, grid: Grid, planes: Planes, judge: Judge, progress: Callable[[str], object],
    worst: bool,
) -> LayerPicture:  # fmt: skip
    """A layer of `VERDICTS`: classes of a map of its own, at the pixels of the picture."""
    terrain.refuse_degrees("A vehicle")
    terrain = terrain.written_out
    bounds = grid.bounds
    part = _clip_to_terrain(terrain, bounds)
    resolution, why = _map_resolution(terrain, judge, part)
    verdict = judge.verdict(terrain, grid_over(terrain, resolution, part), progress)
    classes = (verdict.worst if worst else verdict.classes)[_places_in(verdict.grid, grid)]
    palette = np.array([COLORS[code] for code in sorted(COLORS)], np.uint8)
    ground = ~np.isnan(planes.heights)
    seen = np.bincount(classes[ground], minlength=len(GroundClass))
    order = (
        GroundClass.GO, GroundClass.CAUTION, GroundClass.NO_GO, GroundClass.ONE_WAY,
        GroundClass.CUT_OFF, GroundClass.EDGE, GroundClass.UNKNOWN,
    )  # fmt: skip
    swatches = [
        Swatch(code.label, COLORS[code], _HATCHES.get(code, "")) for code in order if seen[code]
    ]
    share = seen[GroundClass.GO] + seen[GroundClass.CAUTION]
    counted = int(seen.sum() - seen[GroundClass.EDGE])
    notes = [
        f"{verdict.vehicle} can drive on {share / max(1, counted):.0%} of the ground drawn"
        f"{', with every heading' * worst}; judged at pixels of {resolution:.4g} m ({why})."
    ]
    if verdict.lacking:
        notes.append(verdict.lacking)
    title = "worst heading" if worst else verdict.vehicle
    return LayerPicture(
        grid, planes.heights, _ids(planes), palette[classes],
        Legend(title, (*swatches, *void_swatch(planes.heights))), _ON_VERDICTS,
        classes, tuple(notes),
    )  # fmt: skip


def _places_in(own: Grid, grid: Grid) -> tuple[NDArray[Any], ...]:
    """Index of the pixels of a grid that hold the middles of those of another, or are nearest."""
    columns = np.floor((grid.columns(grid.whole) - own.west) / own.resolution).astype(np.int64)
    rows = np.floor((own.bounds[3] - grid.rows(grid.whole)) / own.resolution).astype(np.int64)
    return np.ix_(np.clip(rows, 0, own.height - 1), np.clip(columns, 0, own.width - 1))


def _foothold_layer(
    terrain: Terrain, grid: Grid, planes: Planes, judge: Judge, progress: Callable[[str], object]
) -> LayerPicture:
    """The layer `foothold`: what a foot has in reserve, none below 0, at the picture's pixels."""
    from matplotlib import colormaps

    terrain.refuse_degrees("A vehicle")
    terrain = terrain.written_out
    part = _clip_to_terrain(terrain, grid.bounds)
    resolution, why = _map_resolution(terrain, judge, part)
    own = grid_over(terrain, resolution, part)
    progress("looking for footholds")
    margins = 1.0 - judge.surveyor(terrain, own).footholds()[_places_in(own, grid)]
    scale = Scale(_TITLES["foothold"], 0.0, 1.0, _COLORS["foothold"])
    colors = colormaps[scale.colors](np.clip(margins, 0.0, 1.0), bytes=True)[..., :3]
    ground = ~np.isnan(planes.heights)
    barred = ground & ~(margins > 0.0)
    colors[barred] = COLORS[GroundClass.NO_GO]
    swatches = (Swatch("no foothold", COLORS[GroundClass.NO_GO]),) if barred.any() else ()
    share = float(np.mean(~barred[ground]))
    note = (
        f"A foot of {judge.vehicle.name} can be set on {share:.0%} of the ground drawn; judged "
        f"at pixels of {resolution:.4g} m ({why})."
    )
    key = Legend(judge.vehicle.name, (*swatches, *void_swatch(planes.heights)), scale)
    return LayerPicture(grid, planes.heights, _ids(planes), colors, key, None, notes=(note,))


def _map_resolution(terrain: Terrain, judge: Judge, part: Any) -> tuple[float, str]:
    """The resolution of verdicts, m, and why: that of a map without a file, if fine enough.

    Raises:
        RequestError: the ground is too long for the vehicle.
    """
    try:
        return default_resolution(terrain, judge.vehicle, part, _MAP_PIXELS)
    except RequestError:
        pass
    try:
        return default_resolution(terrain, judge.vehicle, part)
    except RequestError as error:
        raise RequestError(error.message, "Look at a part of it with --bounds W S E N.") from error


def _clip_to_terrain(terrain: Terrain, bounds: Any) -> Any:
    """The part of a rectangle that lies on the terrain."""
    west, south, east, north = terrain.bounds
    return max(west, bounds[0]), max(south, bounds[1]), min(east, bounds[2]), min(north, bounds[3])


def _ids(planes: Planes) -> NDArray[Any]:
    """Surfaces of painted planes, which have them."""
    assert planes.surfaces is not None
    return planes.surfaces


def void_swatch(heights: NDArray[Any]) -> tuple[Swatch, ...]:
    """The line of the legend for pixels without ground; none where all have ground."""
    return (Swatch(NO_GROUND, VOID, "///"),) if np.isnan(heights).any() else ()


def _rgb(color: NDArray[np.uint8]) -> tuple[int, int, int]:
    """Red, green and blue as a tuple of whole numbers."""
    red, green, blue = (int(part) for part in color)
    return red, green, blue


def light_on(picture: LayerPicture, light: NDArray[np.float64], step: int) -> NDArray[np.uint8]:
    """Shade the pixels of a picture, (height, width, 3) uint8, and hatch verdicts and the void.

    Args:
        picture: the layer.
        light: (height, width) factor on the colours.
        step: pixels from one line of hatching to the next.
    """
    painted = picture.colors * light[..., None]
    if picture.classes is not None:
        hatch(painted, picture.classes, step)
    void = np.isnan(picture.heights)
    row, column = np.ogrid[: void.shape[0], : void.shape[1]]
    line = (row + column) % step < max(1, step // 6)
    painted[void] = VOID
    painted[void & line] = _VOID_LINE
    return np.clip(np.rint(painted), 0.0, 255.0).astype(np.uint8)


def check_layer(layer: str, vehicle: object) -> None:
    """Refuse a name that is no layer, and a layer without its vehicle.

    Raises:
        RequestError: there is no such layer, or the vehicle is missing or not needed.
    """
    if layer not in NAMES:
        raise RequestError(
            f"There is no layer {layer!r}.",
            guess(layer, NAMES) or f"The layers are {', '.join(NAMES)}.",
        )
    if layer in JUDGED and vehicle is None:
        raise RequestError(f"The layer {layer} needs a vehicle.", "Add --vehicle V.json.")
    if layer not in JUDGED and vehicle is not None:
        raise RequestError(
            f"The layer {layer} needs no vehicle.",
            "Add --layer traversability, or leave out --vehicle.",
        )


def level_light() -> float:
    """Value of `hillshade` on level ground."""
    return math.sin(math.radians(45.0))
