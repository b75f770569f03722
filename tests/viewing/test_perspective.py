"""Perspectives: the z-buffer against a slow one, and what is seen from where."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.viewing import perspective
from terratool.viewing.options import RenderOptions
from terratool.viewing.perspective import viewpoint_for, z_buffer
from terratool.viewing.render import render
from tests.conftest import terrain_of
from tests.viewing.pictures import PLATE, RED, SAND, hue_of, pixels_of, texts_of


def slow_buffer(points: NDArray[Any], faces: NDArray[Any], height: int, width: int) -> Any:
    """Inverse depths of all faces at all pixels, by barycentric coordinates, −9 where they are not.

    And how near a pixel is to the edge of any.
    """
    inverse = np.full((len(faces), height, width), -9.0)
    edge = np.full((height, width), np.inf)
    v, u = np.mgrid[:height, :width]
    for n, face in enumerate(faces):
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = points[face]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        b = ((u - ax) * (cy - ay) - (v - ay) * (cx - ax)) / area
        c = ((bx - ax) * (v - ay) - (by - ay) * (u - ax)) / area
        least = np.minimum(np.minimum(b, c), 1 - b - c)
        edge = np.minimum(edge, np.abs(least))
        inverse[n] = np.where(least >= 0, az + b * (bz - az) + c * (cz - az), -9.0)
    return inverse, edge


@pytest.mark.parametrize("seed", range(4))
def test_the_nearest_face_is_seen(seed: int) -> None:
    """Random faces, some beyond the picture; pixels on an edge but for rounding are left out."""
    draw = np.random.default_rng(seed)
    height, width = 23, 41
    points = draw.uniform([-8, -8, 0.1], [49, 31, 1.0], (60, 3))
    faces = draw.permutation(60).reshape(-1, 3).astype(np.int32)
    seen = z_buffer(points, faces, height, width)
    inverse, edge = slow_buffer(points, faces, height, width)
    best = np.sort(inverse, axis=0)[::-1]
    clear = (edge > 1e-9) & ((best[0] - best[1] > 1e-9) | (best[0] < 0))
    assert clear.mean() > 0.9
    wanted = np.where(best[0] > 0, inverse.argmax(axis=0), -1)
    assert (seen.face == wanted)[clear].all()
    hit = clear & (wanted >= 0)
    assert seen.inverse[hit] == pytest.approx(best[0][hit])


def test_faces_with_common_edges_leave_no_gap() -> None:
    """Fans around any points, with corners on the middles of pixels, too."""
    draw = np.random.default_rng(5)
    for _ in range(30):
        middle = draw.choice([draw.uniform(0, 20, 2), draw.integers(0, 20, 2)])
        rim = np.array([[-1, -1], [9, -1], [20, -1], [20, 7], [20, 20], [3, 20], [-1, 20], [-1, 5]])
        points = np.column_stack([np.vstack([middle, rim]), np.full(9, 0.5)])
        faces = np.array([[0, 1 + n, 1 + (n + 1) % 8] for n in range(8)], np.int32)
        assert (z_buffer(points, faces, 20, 20).face >= 0).all()


def test_of_equals_the_last_is_seen() -> None:
    """Faces that lie on one another, and both sides of an edge that runs through middles."""
    points = np.array([[0, 0, 0.5], [6, 2, 0.7], [6, 8, 0.2], [0, 6, 0.9]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    seen = z_buffer(points, np.vstack([faces, faces]), 9, 7).face
    assert {-1, 2, 3} == {*seen.ravel().tolist()}
    rows, columns = [0, 4, 8], [0, 3, 6]  # along the edge
    assert (seen[rows, columns] == 3).all()
    assert (z_buffer(points, faces[::-1].copy(), 9, 7).face[rows, columns] == 1).all()


def test_faces_that_are_seen_edge_on_show_nothing() -> None:
    points = np.array([[0, 0, 0.5], [4, 4, 0.7], [8, 8, 0.2], [2, 5, 0.4], [9, 5, 0.4]])
    faces = np.array([[0, 1, 2], [3, 4, 3]], np.int32)
    seen = z_buffer(points, faces, 9, 10)
    assert (seen.face == -1).all() and (seen.inverse == 0.0).all()


@pytest.mark.parametrize(
    ("azimuth", "right", "up"),
    [(180, (1, 0), (0, 1)), (0, (-1, 0), (0, -1)), (90, (0, 1), (-1, 0)), (270, (0, -1), (1, 0))],
)
def test_what_is_right_and_what_is_far(azimuth: float, right: Any, up: Any) -> None:
    """From the south, east is on the right and north is far away, and so on round."""
    box = np.array([[x, y, z] for x in (0, 8) for y in (0, 4) for z in (0, 1)], float)
    viewpoint = viewpoint_for(box, azimuth, 30.0, (800, 600))
    middle = np.array([4.0, 2.0, 0.5])
    here, there, beyond, above = viewpoint.project(
        middle + np.array([[0, 0, 0], [*right, 0], [*up, 0], [0, 0, 1]], float)
    )
    assert there[0] > here[0] and there[1] == pytest.approx(here[1], abs=1e-6)
    assert beyond[1] > here[1] and beyond[2] < here[2]
    assert above[1] > here[1] and above[0] == pytest.approx(here[0], abs=1e-6)
    flat = viewpoint.project(box)
    assert (flat[:, :2] >= 0).all() and (flat[:, :2] <= (799, 599)).all()
    assert np.ptp(flat[:, 0]) > 790 or np.ptp(flat[:, 1]) > 590


def picture(tmp_path: Path, **options: Any) -> NDArray[np.int64]:
    wanted = {"perspective": True, "pixels": 640, "dpi": 72.0, "legend": False, "title": ""}
    path = tmp_path / "view.png"
    render(terrain_of(PLATE), path, RenderOptions(**{**wanted, **options}), overwrite=True)
    return pixels_of(path)


def red(pixels: NDArray[np.int64]) -> NDArray[np.bool_]:
    return (pixels[..., 0] > 2.5 * pixels[..., 1]) & (pixels[..., 0] > 60)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("azimuth", "right", "far"),
    [(180, True, True), (0, False, False), (90, True, False), (270, False, True)],
)
def test_the_box_is_where_it_is(tmp_path: Path, azimuth: float, right: bool, far: bool) -> None:
    """In the north-east corner: at the back on the right, seen from the south."""
    pixels = picture(tmp_path, azimuth=azimuth, elevation=50.0, exaggeration=0.2)
    rows, columns = np.nonzero(red(pixels))
    ground = np.argwhere(pixels.max(axis=2) < 245)
    ground = ground[ground[:, 0] < 0.85 * len(pixels)]
    low, high = ground.min(axis=0), ground.max(axis=0)
    assert (columns.mean() > (low[1] + high[1]) / 2) == right
    assert (rows.mean() < (low[0] + high[0]) / 2) == far


def test_walls_are_upright(tmp_path: Path) -> None:
    """From the south: below the bright top of the box its wall, darker; below that sand.

    Its sides are straight, and it is as high as it should be, more so with exaggeration.
    """
    tall = []
    for factor in (1.0, 2.0):
        pixels = picture(tmp_path, azimuth=180.0, elevation=30.0, exaggeration=factor)
        columns = np.nonzero(red(pixels))[1]
        middle = pixels[:, round(columns.mean())]
        box = np.flatnonzero(red(middle))[2:]  # without the dark line behind
        bright = middle[box, 0]
        wall = box[bright < 0.85 * bright[0]]
        assert len(wall) > 10 and wall[0] > box[0] + 5  # the top is farther away
        assert hue_of(middle[wall[-1] + 3]) == hue_of(SAND)
        assert hue_of(middle[wall[len(wall) // 2]]) == hue_of(RED)
        # its sides are straight, and almost parallel
        south = red(pixels) & (np.abs(pixels - middle[wall[len(wall) // 2]]).max(axis=2) < 10)
        part = south[wall[4] : wall[-4]]
        row = np.arange(len(part))
        for side in (part.argmax(axis=1), part[:, ::-1].argmax(axis=1)):
            slope, start = np.polyfit(row, side, 1)
            assert abs(slope) < 0.25
            assert np.abs(side - (start + slope * row)).max() < 1.5
        tall.append(len(wall) / (columns.max() - columns.min()))
    # 3 high and 8 wide, seen from 30 degrees above
    assert tall[0] == pytest.approx(3 / 8 * np.cos(np.pi / 6), rel=0.15)
    assert tall[1] == pytest.approx(2 * tall[0], rel=0.15)


def test_towers_fit_into_the_picture(tmp_path: Path) -> None:
    """A thousand high on ground of 40: heights are multiplied by less than 1, and it says so."""
    definition = {**PLATE, "elemTree": {**PLATE["elemTree"], "vScale": 2}}
    definition["elemTree"]["children"] = [
        {"cellX": 8, "cellY": 3, "type": "flat", "vScale": 1000, "surface": "box red"}
    ]
    options = RenderOptions(perspective=True, pixels=400, dpi=72.0, legend=False)
    report = render(terrain_of(definition), tmp_path / "tower.png", options)
    assert "heights multiplied by 0.02" in report.what
    assert red(pixels_of(tmp_path / "tower.png")).sum() > 200


def test_void_is_open(tmp_path: Path) -> None:
    """From above, the paper is seen in the south-west corner."""
    pixels = picture(tmp_path, azimuth=180.0, elevation=90.0)
    ground = np.argwhere(red(pixels) | (np.abs(pixels - SAND).max(axis=2) < 40))
    low, high = ground.min(axis=0), ground.max(axis=0)
    south, west = high[0] - (high[0] - low[0]) // 8, low[1] + (high[1] - low[1]) // 20
    assert pixels[south, west].min() > 250
    north = low[0] + (high[0] - low[0]) // 8
    assert hue_of(pixels[north, west]) == hue_of(SAND)


def test_the_picture_says_how_it_is_seen(tmp_path: Path) -> None:
    path = tmp_path / "view.svg"
    options = RenderOptions(perspective=True, exaggeration=3.0, pixels=640, dpi=72.0)
    report = render(terrain_of(PLATE), path, options)
    texts = texts_of(path)
    (caption,) = (text for text in texts if "Seen from" in text)
    assert "40 m from west to east, 16 m from south to north" in caption
    assert "215°" in caption
    assert "Heights exaggerated 3 times: slopes look steeper than they are." in texts
    assert {"N", "sand", "box red"} <= {*texts}
    assert "heights exaggerated 3 times" in report.what


@pytest.mark.nightly
@pytest.mark.parametrize("perspective", [False, True])
@pytest.mark.parametrize("size", [450, 900])
def test_no_line_is_cut_off(perspective: bool, size: int, tmp_path: Path) -> None:
    """Whatever the size: titles end with dots before the edge, and captions are smaller."""
    factor = 3.0 if perspective else None
    options = RenderOptions(perspective=perspective, exaggeration=factor, pixels=size, legend=False)
    terrain = terrain_of(
        {**PLATE, "descr": "A plate with a name that no picture has room for. " * 4000}
    )
    render(terrain, tmp_path / "view.png", options)
    pixels = pixels_of(tmp_path / "view.png")
    assert (pixels[:, -4:] > 250).all()
    assert (pixels[:40] < 100).any()  # the title


def test_layers_lie_on_the_ground(tmp_path: Path) -> None:
    """Heights in their colours on the top of the box and on the ground; walls are grey."""
    pixels = picture(tmp_path, layer="height", azimuth=180.0, elevation=30.0)
    yellow = (pixels[..., 0] > 180) & (pixels[..., 2] < 110)
    rows, columns = np.nonzero(yellow)
    wall = pixels[rows.max() + 8, round(columns.mean())]
    assert np.ptp(wall) <= 2 and wall.max() < 128
    assert columns.mean() > pixels.shape[1] / 2


@pytest.mark.nightly
def test_too_many_elements_are_drawn_from_a_grid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Said so; the box and the void are where the mesh has them."""
    by_mesh = red(picture(tmp_path, azimuth=200.0))
    monkeypatch.setattr(perspective, "_MOST_ELEMENTS", 1)
    monkeypatch.setattr(perspective, "_GRID_SIDE", 400)
    options = RenderOptions(
        perspective=True, azimuth=200.0, pixels=640, dpi=72.0, legend=False, title=""
    )
    report = render(terrain_of(PLATE), tmp_path / "grid.png", options)
    assert "heights, as there are too many elements for a mesh" in report.what
    by_grid = red(pixels_of(tmp_path / "grid.png"))
    assert by_grid.shape == pytest.approx(by_mesh.shape, abs=3)
    rows, columns = (min(one, two) for one, two in zip(by_mesh.shape, by_grid.shape, strict=True))
    both = by_mesh[:rows, :columns] & by_grid[:rows, :columns]
    assert both.sum() > 0.8 * max(by_mesh.sum(), by_grid.sum())
    heights = picture(tmp_path, azimuth=200.0, layer="height")
    assert ((heights[..., 0] > 180) & (heights[..., 2] < 110)).sum() > 500  # the top of the box
