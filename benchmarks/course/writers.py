"""The course as grids of heights: Isaac Lab's mesh, OpenCRG, and a PNG for MuJoCo."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from course.truth import HIGHEST, LENGTH, WIDTH, Array, height

from terratool.io.png import png

_STEEP = 0.75
"""Isaac Lab's slope threshold: what is steeper becomes upright."""
_UNIT = 0.005
"""Isaac Lab's vertical scale, m."""
_FIELD, _IN_A_LINE = 10, 8
"""OpenCRG, LRFI: columns of a number, and numbers of a line."""


def _heights(step: float) -> tuple[Array, Array, Array]:
    """Grid lines along x and y, and heights where they cross, (x, y)."""
    x = np.linspace(0.0, LENGTH, round(LENGTH / step) + 1)
    y = np.linspace(0.0, WIDTH, round(WIDTH / step) + 1)
    return x, y, height(x[:, np.newaxis], y)


def _moves(z: Array, steep: float) -> Array:
    """By how many cells vertices move so that steep cells become upright, (x, y, 2).

    As Isaac Lab describes it: the lower vertex of a steep pair moves under the higher one, along
    the axes where it has such a neighbour, otherwise along the diagonal.
    """
    moves = np.zeros((*z.shape, 2))
    corners = np.zeros(z.shape)
    for axis in (0, 1):
        rise = np.diff(z, axis=axis)
        lower, upper = [slice(None)] * 2, [slice(None)] * 2
        lower[axis], upper[axis] = slice(None, -1), slice(1, None)
        moves[(*lower, axis)] += rise > steep
        moves[(*upper, axis)] -= rise < -steep
    rise = z[1:, 1:] - z[:-1, :-1]
    corners[:-1, :-1] += rise > steep
    corners[1:, 1:] -= rise < -steep
    return np.where(moves == 0.0, corners[..., np.newaxis], moves)


def write_isaac(path: Path, step: float = 0.1) -> None:
    """Write a mesh of a height grid as an OBJ, and an MJCF that shows it, beside it.

    A cell more on every side, as tiles of Isaac Lab have a border: vertices leave it, too.
    """
    x, y, exact = _heights(step)
    x, y = (np.concatenate([[-step], along, [along[-1] + step]]) for along in (x, y))
    z = np.rint(np.pad(exact, 1, mode="edge") / _UNIT) * _UNIT
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1) + step * _moves(z, _STEEP * step)
    vertices = np.concatenate([places, z[..., np.newaxis]], axis=-1).reshape(-1, 3)
    number = np.arange(1, z.size + 1).reshape(z.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    lines = ["v " + " ".join(f"{value:.6g}" for value in vertex) for vertex in vertices.tolist()]
    lines += ["f {} {} {}".format(*face) for face in faces.tolist()]
    path.with_suffix(".obj").write_text("\n".join(lines) + "\n")
    path.write_text(
        f'<mujoco>\n  <asset><mesh name="it" file="{path.stem}.obj"/></asset>\n  <worldbody>'
        '<geom type="mesh" mesh="it" contype="0" conaffinity="0"/></worldbody>\n</mujoco>\n'
    )


def write_crg(path: Path, step: float = 0.01) -> None:
    """Write OpenCRG as text (LRFI): a straight reference line along the middle."""
    _, y, z = _heights(step)
    lines = [
        "$CT",
        "A course of 12 x 3 m",
        "$",
        "$ROAD_CRG",
        "REFERENCE_LINE_START_U   = 0.0",
        f"REFERENCE_LINE_END_U     = {LENGTH}",
        f"REFERENCE_LINE_INCREMENT = {step}",
        f"LONG_SECTION_V_RIGHT     = {-WIDTH / 2}",
        f"LONG_SECTION_V_LEFT      = {WIDTH / 2}",
        f"LONG_SECTION_V_INCREMENT = {step}",
        "$",
        "$KD_DEFINITION",
        "#:LRFI",
        *(f"D:long section {n},m" for n in range(1, len(y) + 1)),
        "$",
        "$" * _FIELD * _IN_A_LINE,
    ]
    for section in z.tolist():
        numbers = [f"{value:{_FIELD}.6f}" for value in section]
        for begin in range(0, len(numbers), _IN_A_LINE):
            line = "".join(numbers[begin : begin + _IN_A_LINE])
            lines.append(line.ljust(_FIELD * _IN_A_LINE))
    path.write_text("\n".join(lines) + "\n")


def write_png(path: Path, step: float = 0.01) -> None:
    """Write a PNG of 8 bits, which is what MuJoCo reads, north up, and an MJCF with it, beside it.

    Sizes of a height field are half the sides, the range of heights, and how thick it is below.
    """
    _, _, z = _heights(step)
    pixels = np.rint(z.T[::-1] / HIGHEST * 255.0).astype(np.uint8)
    path.with_suffix(".png").write_bytes(png(pixels[:, :, np.newaxis]))
    size = f"{LENGTH / 2:g} {WIDTH / 2:g} {HIGHEST:g} 0.1"
    path.write_text(
        f'<mujoco>\n  <asset><hfield name="it" file="{path.stem}.png" size="{size}"/></asset>\n'
        f'  <worldbody><geom type="hfield" hfield="it" pos="{LENGTH / 2:g} {WIDTH / 2:g} 0"/>'
        "</worldbody>\n</mujoco>\n"
    )
