"""Perspectives: a mesh with upright walls, seen from the side, with light on it.

Faces are painted into a z-buffer that keeps the nearest face at each pixel. The division by depth
leaves faces flat triangles over which the inverse depth is linear, so everything else follows from
the index of the face.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain, check_bounds, clip_bounds
from terratool.kernels import mesh as mesh_kernels
from terratool.kernels import raster as raster_kernels
from terratool.mesh.export import collapse_degenerate, no_ground, relief_of
from terratool.mesh.formats.common import NO_COLOR
from terratool.mesh.stacked import build_all
from terratool.mesh.types import BuiltMesh
from terratool.raster.grid import grid_over
from terratool.raster.shading import LIGHT
from terratool.report.numbers import metres
from terratool.report.wording import count_of
from terratool.traversability.judge import Judge
from terratool.viewing.layers import (
    NO_GROUND,
    LayerPicture,
    layer_picture,
    light_on,
    paint_ground,
    surface_colors,
)
from terratool.viewing.options import RenderOptions
from terratool.viewing.plan import NO_MARGINS, Drawn, SheetMargins, unit_of
from terratool.viewing.sheet import (
    Legend,
    Rectangle,
    Sheet,
    chosen_exaggeration,
    exaggeration_text,
    key_width,
    new_sheet,
    note_of_chosen,
    number,
)

FINER = 2
"""Painted pixels per pixel of the picture and side; the picture has their mean."""
_MOST_ELEMENTS = 200_000
"""Most elements in the picture whose mesh is drawn; with more, a grid of heights is drawn."""
_GRID_SIDE = 1200
"""Intervals of that grid of heights along its longer side."""
_FAR = 3.0
"""Distance of the eye from the middle of the ground, in diagonals of the ground."""
_AMBIENT, _DIRECT, _FILL = 0.5, 0.6, 0.12
"""Shares of a colour by ambient light, by the light, and by a weak light opposite to it."""
_EDGE = 0.62
"""Factor on a colour on an edge."""
_SKIRT = 205, 201, 196
"""Colour (red, green, blue) of the sides of the block below the ground."""
_MOST_CHOSEN = 10.0
"""Largest exaggeration of heights that is chosen where none is given."""

Floats = NDArray[np.float64]


class Block(NamedTuple):
    """Mesh of the ground with the sides of the block below it.

    Attributes:
        vertices: (n, 3) float64 world coordinates.
        faces: (m, 3) int32 indices of vertices.
        surfaces: (m,) int64 index of the surface plus one; 0 for none, -1 for sides of the block.
        hidden: (m,) bool, whether a plan does not show a face: it stands upright, looks down, or
            lies below another one.
        normals: (m, 3, 3) float64 unit normals at the corners of faces.
    """

    vertices: Floats
    faces: NDArray[np.int32]
    surfaces: NDArray[np.int64]
    hidden: NDArray[np.bool_]
    normals: Floats


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """Position of the eye, and projection of the world onto the picture.

    Attributes:
        eye: (3,) world coordinates of the eye.
        axes: (3, 3) unit vectors in rows: right, up, and along the view.
        scale: pixels per world unit at depth 1.
        shift: (2,) offset of the picture's coordinates, pixels.
    """

    eye: Floats
    axes: Floats
    scale: float
    shift: Floats

    def project(self, points: Floats) -> Floats:
        """Project points, (n, 3): pixels to the right, pixels up, and the inverse depth."""
        seen = (points - self.eye) @ self.axes.T
        inverse = 1.0 / seen[:, 2]
        flat = seen[:, :2] * inverse[:, None] * self.scale + self.shift
        return np.column_stack([flat, inverse])


class NearestFaces(NamedTuple):
    """Nearest face at each pixel.

    Attributes:
        face: (height, width) int32 index of the face, -1 for none; rows from the bottom.
        inverse: (height, width) float64 inverse depth, 0 where there is no face.
    """

    face: NDArray[np.int32]
    inverse: Floats


def viewpoint_for(
    points: Floats, azimuth: float, elevation: float, size: tuple[int, int]
) -> Viewpoint:
    """Viewpoint from which all points fill a picture as far as they fit.

    Args:
        points: (n, 3) world coordinates.
        azimuth: direction from the ground to the eye, degrees clockwise from north.
        elevation: height of the eye above the horizon, degrees.
        size: width and height of the picture, pixels.
    """
    turn, tilt = math.radians(azimuth), math.radians(elevation)
    back = np.array(
        [math.sin(turn) * math.cos(tilt), math.cos(turn) * math.cos(tilt), math.sin(tilt)]
    )
    right = np.array([-math.cos(turn), math.sin(turn), 0.0])
    axes = np.stack([right, np.cross(back, right), -back])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    far = _FAR * float(np.linalg.norm(np.ptp(points, axis=0)))
    viewpoint = Viewpoint(middle + far * back, axes, 1.0, np.zeros(2))
    flat = viewpoint.project(points)[:, :2]
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = float(np.min((np.array(size) - 2.0) / np.maximum(high - low, 1e-12)))
    shift = 0.5 * np.array(size) - 0.5 - 0.5 * scale * (low + high)
    return Viewpoint(viewpoint.eye, axes, scale, shift)


def z_buffer(points: Floats, faces: NDArray[np.int32], height: int, width: int) -> NearestFaces:
    """Find the nearest face at the middle of each pixel; among equal ones the largest index.

    Args:
        points: (n, 3) pixels to the right and up, whole numbers at the middles of pixels, and the
            inverse depth, above 0.
        faces: (m, 3) int32 indices of points.
        height: number of rows of the picture.
        width: number of columns of the picture.
    """
    seen = NearestFaces(np.full((height, width), -1, np.int32), np.zeros((height, width)))
    raster_kernels.nearest_faces(points, faces, seen.inverse, seen.face)
    return seen


def draw_perspective(
    terrain: Terrain,
    options: RenderOptions,
    judge: Judge | None = None,
    progress: Callable[[str], object] = lambda _: None,
) -> Drawn:
    """Draw a perspective; to be called within `terratool.viewing.sheet.settings`.

    Seen from below, it shows undersides, ceilings and sides alone, as if there were no ground.

    Raises:
        RequestError: the bounds miss the terrain, there is no ground, the layer has nothing to
            show, or there are no storeys to be seen from below.
    """
    if options.elevation < 0.0 and terrain.storeys is None:
        raise RequestError(
            "There is no deck and no bore to be seen from below.", "Give --elevation from 5 to 90."
        )
    if options.bounds is not None:
        check_bounds(options.bounds, terrain)
    part = clip_bounds(terrain, options.bounds)
    sides = np.array([part[2] - part[0], part[3] - part[1]])
    plan = _plan(terrain, options, part, judge, progress)
    block, made = _block(terrain, options, part, progress)
    relief = float(np.ptp(block.vertices[block.faces[block.surfaces >= 0].ravel(), 2]))
    factor = options.exaggeration or chosen_exaggeration(float(sides.max()), relief, _MOST_CHOSEN)
    vertices = block.vertices * (1.0, 1.0, factor)
    # void has no faces, and so no entry in the legend
    swatches = tuple(
        swatch._replace(letter="") for swatch in plan.key.swatches if swatch.label != NO_GROUND
    )
    key = plan.key._replace(swatches=swatches) if options.has_legend else Legend()
    title = options.title_of(terrain.descr)
    margins = NO_MARGINS if options.bare else SheetMargins(
        left=14.0, bottom=48.0, right=key_width(key) + 28.0 if options.has_legend else 14.0,
        top=28.0 if title else 12.0,
    )  # fmt: skip
    corners = vertices[np.unique(block.faces)]
    sheet, ground = _sheet(corners, options, margins)
    viewpoint = viewpoint_for(
        corners, options.azimuth, options.elevation, (ground.width * FINER, ground.height * FINER)
    )
    progress("painting faces")
    if options.elevation < 0.0:
        block = _facing(block, viewpoint.eye / (1.0, 1.0, factor))
    points = viewpoint.project(vertices)
    seen = z_buffer(points, block.faces, ground.height * FINER, ground.width * FINER)
    progress("drawing")
    palette = surface_colors(terrain)[0] if options.layer == "surface" else None
    pixels = _shade(seen, block, viewpoint, _Paint(plan, palette), factor)
    axes = sheet.axes(ground)
    axes.imshow(pixels, aspect="auto", interpolation="none", origin="lower")
    axes.set_axis_off()
    wide, deep = (f"{side:,.6g}" for side in sides)
    unit = unit_of(terrain)
    said = f"{wide} {unit} from west to east, {deep} {unit} from south to north."
    if not options.bare:
        _draw_texts(sheet, ground, viewpoint, corners, [said], options)
        if factor != 1.0:
            sheet.warning(factor, sheet.pixels(64.0), sheet.pixels(17.0))
    if title:
        left = sheet.pixels(margins.left)
        sheet.title(title, left, sheet.width - 2 * left)
    if options.has_legend:
        beside = ground.left + ground.width + sheet.pixels(14.0)
        low, high = sheet.pixels(4.0), sheet.height - sheet.pixels(margins.top + 4.0)
        sheet.key(key, Rectangle(beside, low, sheet.width - beside - low, high - low))
    what = (
        f"perspective from {number(options.azimuth % 360.0)}°, {_tilt(options)}; "
        f"{made}; {exaggeration_text(factor)}"
    )
    return Drawn(sheet, what, (*note_of_chosen(factor, options.exaggeration), *plan.notes))


def _tilt(options: RenderOptions) -> str:
    """Phrase on how high above or below the horizon the eye of a perspective is."""
    side = "below" if options.elevation < 0.0 else "above"
    return f"{number(abs(options.elevation))}° {side}"


def _plan(
    terrain: Terrain, options: RenderOptions, part: tuple[float, float, float, float],
    judge: Judge | None, progress: Callable[[str], object],
) -> LayerPicture:  # fmt: skip
    """Layer seen from above, from which the ground takes its colours."""
    resolution = max(part[2] - part[0], part[3] - part[1]) / options.pixels
    resolution = min(resolution, part[2] - part[0], part[3] - part[1])
    return layer_picture(
        terrain, grid_over(terrain, resolution, part), options.layer, judge, progress
    )


def _block(
    terrain: Terrain, options: RenderOptions, part: tuple[float, float, float, float],
    progress: Callable[[str], object],
) -> tuple[Block, str]:  # fmt: skip
    """Ground as a block, and a phrase on its faces.

    Raises:
        RequestError: there is no ground.
    """
    error = options.max_error
    if error is None:
        # half a pixel of the ground, or of towers that are far higher than the ground is wide
        extent = max(part[2] - part[0], part[3] - part[1], relief_of(terrain, options.bounds))
        error = 0.5 * extent / options.pixels
    whole = terrain.written_out_or_none
    if whole is not None:
        west, south, east, north = whole.footprints()
        there = (west < part[2]) & (east > part[0]) & (south < part[3]) & (north > part[1])
        if np.count_nonzero(there) > _MOST_ELEMENTS:
            whole = None
    if whole is None:
        progress("painting heights")
        return _grid_block(terrain, part)
    progress(f"meshing within {metres(error)}")
    base: Literal["below"] | None = None if options.elevation < 0.0 else "below"
    built = collapse_degenerate(build_all(whole, error, options.bounds, base=base))
    if not len(built.mesh.faces):
        raise no_ground()
    return _mesh_block(
        built, whole
    ), f"{count_of(len(built.mesh.faces), 'face')} within {metres(error)}"


def _mesh_block(built: BuiltMesh, terrain: Terrain) -> Block:
    mesh = built.mesh
    found = mesh_kernels.corner_normals(mesh.vertices, mesh.faces, mesh.walls, built.error)
    normals = found[0].astype(np.float64)[found[1]]
    surfaces = mesh.surfaces.astype(np.int64) + 1
    surfaces[built.shell :] = -1
    vertices = mesh.vertices + mesh.origin
    hidden = mesh.walls
    if terrain.storeys is not None:
        corners = vertices[mesh.faces]
        x, y, z = corners.mean(axis=1).T
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        hidden = hidden | (u[:, 0] * v[:, 1] <= u[:, 1] * v[:, 0])
        hidden |= z < terrain.height(x, y) - 2.0 * built.error
    return Block(vertices, mesh.faces, surfaces, hidden, normals)


def _facing(block: Block, eye: Floats) -> Block:
    """The faces of a block that look towards the eye."""
    corners = block.vertices[block.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = np.einsum("nk,nk->n", across, eye - corners[:, 0]) > 0.0
    return block._replace(
        faces=block.faces[seen], surfaces=block.surfaces[seen], hidden=block.hidden[seen],
        normals=block.normals[seen],
    )  # fmt: skip


def _grid_block(terrain: Terrain, part: tuple[float, float, float, float]) -> tuple[Block, str]:
    """Ground as a block from a grid of heights, for too many elements for a mesh."""
    longer = max(part[2] - part[0], part[3] - part[1])
    grid = grid_over(terrain, longer / _GRID_SIDE, part)
    planes = paint_ground(terrain, grid)
    heights, ids = planes.heights, planes.surfaces
    assert ids is not None
    rows, columns = heights.shape
    x, y = np.meshgrid(grid.columns(grid.whole), grid.rows(grid.whole))
    known = np.isfinite(heights)
    if not known.any():
        raise no_ground()
    low, high = float(heights[known].min()), float(heights[known].max())
    vertices = np.column_stack([x.ravel(), y.ravel(), np.where(known, heights, low).ravel()])
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    nw, ne, sw, se = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    whole = known[:-1, :-1] & known[:-1, 1:] & known[1:, :-1] & known[1:, 1:]
    corners = (np.stack([sw, se, ne], axis=-1)[whole], np.stack([sw, ne, nw], axis=-1)[whole])
    faces = np.concatenate(corners)
    # a wall belongs to the higher ground, as in a mesh
    four = np.stack([sw, se, ne, nw], axis=-1)[whole]
    highest = np.take_along_axis(four, vertices[four, 2].argmax(axis=1)[:, None], axis=1)[:, 0]
    surfaces = np.tile(ids.ravel()[highest].astype(np.int64), 2)
    # the sides of the block
    edge = np.concatenate([index[0], index[1:, -1], index[-1, -2::-1], index[-2:0:-1, 0]])
    around = np.stack([edge, np.roll(edge, -1)], axis=-1)
    around = around[known.ravel()[around].all(axis=1)]
    foot = vertices[edge].copy()
    foot[:, 2] = low - max(0.1 * (high - low), 0.01 * longer)
    number_of = np.zeros(rows * columns, np.int32)
    number_of[edge] = np.arange(len(vertices), len(vertices) + len(edge), dtype=np.int32)
    one, two = around.T
    sides = np.concatenate(
        [
            np.stack([one, two, number_of[two]], axis=-1),
            np.stack([one, number_of[two], number_of[one]], axis=-1),
        ]
    )
    vertices = np.concatenate([vertices, foot])
    faces = np.concatenate([faces, sides]).astype(np.int32)
    surfaces = np.append(surfaces, np.full(len(sides), -1))
    flat = np.cross(
        vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    )
    flat /= np.maximum(np.linalg.norm(flat, axis=1), 1e-300)[:, None]
    normals = np.repeat(flat[:, None], 3, axis=1)
    walls = np.zeros(len(faces), np.bool_)
    walls[-len(sides) :] = True
    made = (
        f"{rows:,} × {columns:,} heights, as there are too many elements for a mesh: walls are as "
        "wide as a step of these"
    )
    if terrain.storeys is not None:
        made += ", and nothing is open below decks"
    return Block(vertices, faces, surfaces, walls, normals), made


def _sheet(
    vertices: Floats, options: RenderOptions, margins: SheetMargins
) -> tuple[Sheet, Rectangle]:
    """Sheet whose longer side has the size asked for, and the rectangle of the block on it."""
    per_point = options.dpi / 72.0
    left, bottom, right, top = (math.ceil(part * per_point) for part in margins)
    across, down = options.pixels - left - right, options.pixels - bottom - top
    if min(across, down) < 24:
        raise RequestError(
            "There is no room for the ground beside the letters.",
            "Give more --pixels or a smaller --dpi, or --no-legend.",
        )
    viewpoint = viewpoint_for(vertices, options.azimuth, options.elevation, (across, down))
    flat = viewpoint.project(vertices)[:, :2]
    width, height = (math.ceil(side) + 2 for side in np.ptp(flat, axis=0))
    width, height = min(width, across), min(height, down)
    least = 0 if options.bare else min(options.pixels, math.ceil(150.0 * per_point))
    wide, tall = max(width + left + right, least), max(height + bottom + top, least)
    sheet = new_sheet(wide, tall, options.dpi)
    return sheet, Rectangle(left, tall - top - height, width, height)


class _Paint(NamedTuple):
    """Sources of the colours of faces.

    Attributes:
        plan: layer seen from above, for the ground.
        palette: (surfaces + 1, 3) uint8 colours of surfaces, for ground and walls; None for other
            layers.
    """

    plan: LayerPicture
    palette: NDArray[np.uint8] | None


def _shade(
    seen: NearestFaces, block: Block, viewpoint: Viewpoint, paint: _Paint, factor: float
) -> NDArray[np.uint8]:
    """Picture, (height, width, 3) uint8: colours of the faces in the light, dark on edges."""
    drawn = seen.face >= 0
    face = seen.face[drawn]
    row, column = np.nonzero(drawn)
    points = viewpoint.project(block.vertices * (1.0, 1.0, factor))
    weights = _weights(points[block.faces[face]], column, row)
    normal = np.einsum("nc,nck->nk", weights, block.normals[face]) / (1.0, 1.0, factor)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    place = np.einsum("nc,nck->nk", weights, block.vertices[block.faces[face]])
    colors = _colors(block, face, place, paint)
    azimuth, height = LIGHT
    towards = np.array(
        [
            math.sin(azimuth) * math.cos(height),
            math.cos(azimuth) * math.cos(height),
            math.copysign(math.sin(height), -viewpoint.axes[2, 2]),
        ]
    )
    lit = np.maximum(normal @ towards, 0.0)
    opposite = np.maximum(normal @ (towards * (-1.0, -1.0, 1.0)), 0.0)
    colors *= np.minimum(_AMBIENT + _DIRECT * lit + _FILL * opposite, 1.15)[:, None]
    picture = np.full((*drawn.shape, 3), 255.0)
    picture[drawn] = colors
    picture[_edges(seen, block, drawn, normal)] *= _EDGE
    rows, columns = drawn.shape
    blocks = np.clip(picture, 0.0, 255.0).reshape(rows // FINER, FINER, columns // FINER, FINER, 3)
    return np.asarray(np.rint(blocks.mean(axis=(1, 3))), np.uint8)


def _weights(corners: Floats, column: NDArray[np.int64], row: NDArray[np.int64]) -> Floats:
    """Weights of the corners of faces at pixels, (n, 3): barycentric in the world."""
    u, v = corners[..., 0] - column[:, None], corners[..., 1] - row[:, None]
    one, two = np.roll(np.arange(3), -1), np.roll(np.arange(3), -2)
    areas = u[:, one] * v[:, two] - u[:, two] * v[:, one]
    whole = areas.sum(axis=1)
    flat = np.where(
        (whole == 0.0)[:, None], 1.0 / 3.0, areas / np.where(whole == 0.0, 1.0, whole)[:, None]
    )
    world = np.clip(flat, 0.0, 1.0) * corners[..., 2]
    total: Floats = world / world.sum(axis=1, keepdims=True)
    return total


def _colors(block: Block, face: NDArray[np.int32], place: Floats, paint: _Paint) -> Floats:
    """Colours of faces without light, (n, 3) float64; grey where a plan does not show them."""
    surfaces, plan = block.surfaces[face], paint.plan
    if paint.palette is not None:
        colors = paint.palette[np.maximum(surfaces, 0)].astype(np.float64)
    else:
        grid = plan.grid
        columns = np.floor((place[:, 0] - grid.west) / grid.resolution).astype(np.int64)
        rows = np.floor((grid.bounds[3] - place[:, 1]) / grid.resolution).astype(np.int64)
        at = np.clip(rows, 0, grid.height - 1), np.clip(columns, 0, grid.width - 1)
        step = max(4, max(grid.width, grid.height) // 160)
        colors = light_on(plan, np.ones(plan.heights.shape), step)[at].astype(np.float64)
        colors[block.hidden[face]] = NO_COLOR
    colors[surfaces < 0] = _SKIRT
    return colors


def _edges(
    seen: NearestFaces, block: Block, drawn: NDArray[np.bool_], normal: Floats
) -> NDArray[np.bool_]:
    """Pixels on edges, bool: the ground turns sharply, ends, or becomes a side of the block."""
    facing = np.zeros((*drawn.shape, 3))
    facing[drawn] = normal
    surface = np.full(drawn.shape, -2, np.int64)
    surface[drawn] = block.surfaces[seen.face[drawn]]
    edges = np.zeros(drawn.shape, np.bool_)
    for axis in (0, 1):
        here = tuple(slice(None, -1) if n == axis else slice(None) for n in (0, 1))
        there = tuple(slice(1, None) if n == axis else slice(None) for n in (0, 1))
        both = drawn[here] & drawn[there]
        turned = (facing[here] * facing[there]).sum(axis=-1) < math.cos(math.radians(30.0))
        other = (surface[here] < 0) != (surface[there] < 0)
        edges[here] |= (both & (turned | other)) | (drawn[here] != drawn[there])
    return edges & drawn


def _draw_texts(
    sheet: Sheet, ground: Rectangle, viewpoint: Viewpoint, vertices: Floats, said: list[str],
    options: RenderOptions,
) -> None:  # fmt: skip
    """Draw the arrow to the north, and the caption with sentences and the direction of view."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)

    def at(point: Floats) -> Floats:
        flat = viewpoint.project(point[None])[0, :2] / FINER
        corner: Floats = flat + np.array([ground.left, ground.bottom])
        return corner

    middle = 0.5 * (low + high)
    north = np.array([0.0, 0.05 * float(high[1] - low[1]), 0.0])
    foot, tip = at(middle), at(middle + north)
    right, up = ((tip - foot) / max(float(np.linalg.norm(tip - foot)), 1e-12)).tolist()
    # shifted so that the arrow and its letter stay on the sheet in any direction
    x = sheet.pixels(30.0 - 12.0 * right)
    y = sheet.pixels(22.0 - 12.0 * up)
    sheet.north_arrow(x, y, (right, up))
    seen = f"Seen from {number(options.azimuth % 360.0)}° (clockwise from north), {_tilt(options)}."
    line = " ".join([*(f"{text[0].upper()}{text[1:]}" for text in said), seen])
    sheet.caption([line], sheet.pixels(64.0), sheet.pixels(6.0))
