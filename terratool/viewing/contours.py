"""The contours of a plan, with labels where these can be read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.raster.contours import contour_heights, trace_contours
from terratool.raster.shading import contour_interval
from terratool.viewing.cells import LABEL
from terratool.viewing.layers import FINER, LayerPicture
from terratool.viewing.sheet import INK, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_CONTOURS = 200
"""Most contours of a picture."""
_INDEX = 5
"""Number of contours from one thicker, labelled contour to the next."""
_LETTER = 0.65
"""Width of a letter, in sizes of the letters."""
_ROOM = 1.5
"""Least distance of labelled contours at a label, in heights of a label."""
_LINE = 3.0
"""Least length of a line that is labelled, in lengths of the label."""
_STRAIGHT = 0.9
"""Least chord of the line below a label, in lengths of the label."""
_GAP = 2.0
"""Least distance from one label to the next, in widths of a label."""
_TRIED = 64
"""Number of places of a line that are tried for a label."""

Floats = NDArray[np.float64]
"""An array of float64."""


class _LabelPlace(NamedTuple):
    """A place for a label: world x and y, width of the label, length of its line, world units."""

    x: float
    y: float
    wide: float
    line: float


def draw_contours(axes: Axes, picture: LayerPicture, wanted: Any, dpi: float) -> str:
    """Draw contours, and return a caption with their interval.

    Args:
        axes: axes of the plan.
        picture: layer whose heights are contoured.
        wanted: interval of the contours, m; "auto" for about eight contours.
        dpi: pixels per inch.

    Raises:
        RequestError: the contours would be too many.
    """
    grid, heights = picture.grid, picture.heights
    interval = contour_interval(heights) if wanted == "auto" else float(wanted)
    known = heights[np.isfinite(heights)]
    if interval == 0.0:
        return "The ground is level: no contours."
    levels = contour_heights(float(known.min()), float(known.max()), interval, _MOST_CONTOURS)
    caption = f"Contours {number(float(f'{interval:.6g}'))} m apart."
    if not levels:
        return f"{caption} None lies between the heights drawn."
    from matplotlib.contour import ContourSet

    step = np.s_[::FINER]
    x, y = grid.columns(grid.whole)[step], grid.rows(grid.whole)[step]
    z = heights[step, step].astype(np.float64)
    if min(z.shape) < 2:
        return caption
    columns, rows = np.arange(len(x)), np.arange(len(y))
    lines = {
        level: [
            np.column_stack([np.interp(line[:, 0], columns, x), np.interp(line[:, 1], rows, y)])
            for line in found
        ]
        for level, found in trace_contours(z, levels)
    }
    few = len(levels) <= _INDEX
    for which, width in ((False, 0.45), (True, 0.9)):
        drawn_levels = [
            level
            for level in levels
            if (round(level / interval) % _INDEX == 0) == which or (few and which)
        ]
        if not drawn_levels:
            continue
        drawn = ContourSet(
            axes, drawn_levels, [lines[level] for level in drawn_levels], colors=INK,
            linewidths=width, alpha=0.7, linestyles="solid",
        )  # fmt: skip
        if not which:
            continue
        per_point = abs(x[1] - x[0]) * dpi / 72.0
        ground = _ContourSpacing(x, y, z, interval * (1 if few else _INDEX), per_point)
        places = [
            place
            for level in drawn_levels
            for line in lines[level]
            for place in ground.place_on(line, number(level))
        ]
        chosen = [(place.x, place.y) for place in _spread_out(places)]
        if chosen:
            axes.clabel(drawn, fontsize=LABEL, fmt=number, inline_spacing=2, manual=chosen)
    return caption


class _ContourSpacing:
    """Distances between neighbouring labelled contours, by place, in points of the picture.

    Args:
        x: (columns,) world x of the nodes.
        y: (rows,) world y of the nodes, from the north.
        z: (rows, columns) heights, m.
        apart: interval of labelled contours, m.
        per_point: length of a point of the picture on the ground, world units.
    """

    def __init__(self, x: Floats, y: Floats, z: Floats, apart: float, per_point: float) -> None:
        self._x, self._y = x, y
        reach = math.ceil(0.5 * LABEL * per_point / abs(x[1] - x[0]))
        rise = _highest_near(np.hypot(*np.gradient(z, y, x)), reach)
        with np.errstate(divide="ignore", invalid="ignore"):
            self._apart = np.nan_to_num(apart / rise / per_point, nan=0.0)
        self._per_point = per_point

    def _spacing_at(self, x: Floats, y: Floats) -> Floats:
        """Distances of labelled contours at places in the world, points."""
        columns = np.rint(np.interp(x, self._x, np.arange(len(self._x)))).astype(np.int64)
        rows = np.rint(np.interp(-y, -self._y, np.arange(len(self._y)))).astype(np.int64)
        return self._apart[rows, columns]

    def place_on(self, line: Floats, text: str) -> Iterator[_LabelPlace]:
        """The straightest place of a line on which a label can be read, if there is one.

        None is at a wall, where contours coincide, or on a hill smaller than its label.
        """
        wide = (len(text) + 1) * LABEL * _LETTER * self._per_point
        along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
        whole = float(along[-1])
        if whole < _LINE * wide:
            return
        tried = np.linspace(wide, whole - wide, _TRIED)
        window = tried[:, None] + np.linspace(-0.5, 0.5, 5) * wide
        x, y = (np.interp(window, along, line[:, axis]) for axis in (0, 1))
        chord = np.hypot(x[:, -1] - x[:, 0], y[:, -1] - y[:, 0])
        chord[self._spacing_at(x, y).min(axis=1) < _ROOM * LABEL] = 0.0
        best = int(chord.argmax())
        if chord[best] >= _STRAIGHT * wide:
            yield _LabelPlace(float(x[best, 2]), float(y[best, 2]), wide, whole)


def _highest_near(values: Floats, reach: int) -> Floats:
    """The highest value in a square around each node that extends `reach` nodes to all sides."""
    for axis in (0, 1):
        wide = np.pad(values, [(reach, reach) if axis == n else (0, 0) for n in (0, 1)], "edge")
        views = np.lib.stride_tricks.sliding_window_view(wide, 2 * reach + 1, axis)
        values = views.max(axis=-1)
    return values


def _spread_out(places: Iterable[_LabelPlace]) -> list[_LabelPlace]:
    """Choose places that are not near to each other, those of the longest lines first."""
    chosen: list[_LabelPlace] = []
    for place in sorted(places, key=lambda one: -one.line):
        gap = _GAP * place.wide
        if all(math.hypot(place.x - one.x, place.y - one.y) > gap for one in chosen):
            chosen.append(place)
    return chosen
