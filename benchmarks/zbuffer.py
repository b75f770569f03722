"""Meshes seen from above: a million faces on a million pixels, and what the statement costs."""

from __future__ import annotations

import sys

import numpy as np
from measure import line, medians

from terratool.importing.sampling import sample
from terratool.importing.types import Triangles
from terratool.kernels import importing as kernels


def sheet(side: int) -> Triangles:
    """An uneven grid of side × side points over 1000 × 1000."""
    rng = np.random.default_rng(1)
    step = 1000 / (side - 1)
    x, y = np.meshgrid(*[np.linspace(0, 1000, side)] * 2)
    inner = np.zeros(x.shape)
    inner[1:-1, 1:-1] = 0.3 * step
    x = x + inner * rng.uniform(-1, 1, x.shape)
    y = y + inner * rng.uniform(-1, 1, x.shape)
    n = np.arange(x.size).reshape(x.shape)
    a, b, c, d = n[:-1, :-1], n[:-1, 1:], n[1:, 1:], n[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3).astype(np.int32)
    return Triangles(np.stack([x, y, np.sin(x / 50)], axis=-1).reshape(-1, 3), faces)


def solid(mesh: Triangles) -> Triangles:
    """The sheet, and another one below that faces down."""
    low = mesh.vertices * (1, 1, 0) - (0, 0, 2)
    faces = np.concatenate([mesh.faces, mesh.faces[:, ::-1] + np.int32(len(low))])
    return Triangles(np.concatenate([mesh.vertices, low]), faces)


def shuffled(mesh: Triangles) -> Triangles:
    order = np.random.default_rng(2).permutation(len(mesh.faces))
    return Triangles(mesh.vertices, mesh.faces[order])


if __name__ == "__main__":
    quick = "--quick" in sys.argv
    mesh = sheet(200 if quick else 708)
    pixels = 250 if quick else 1000
    mixed, block = shuffled(mesh), solid(mesh)
    heights = np.full((pixels, pixels), np.nan)
    counts = np.zeros(heights.shape, np.uint8)

    def painted(mesh: Triangles) -> None:
        points = kernels.to_pixels(mesh.vertices, 0.0, 0.0, 1000 / pixels, 1000 / pixels)
        heights.fill(np.nan)
        counts.fill(0)
        kernels.paint_faces(points, mesh.faces, 1e-9, heights, counts)

    def gathered() -> None:
        """What any way to sample a mesh has to do: look at three corners of each face."""
        mesh.vertices[mesh.faces].sum()

    seconds = medians(
        {
            "gather": gathered,
            "paint": lambda: painted(mesh),
            "mixed": lambda: painted(mixed),
            "sample": lambda: sample(mesh, 1000 / pixels),
            "block": lambda: sample(block, 1000 / pixels),
        }
    )
    label = f"{len(mesh.faces):,} faces, {pixels}²: "
    line(
        f"{label}z-buffer against gathering corners ({seconds['paint'] * 1e3:.0f} ms)",
        seconds["paint"] / seconds["gather"],
        "<= 2",
    )
    line(f"{label}… faces in random order", seconds["mixed"] / seconds["paint"], "none")
    line(
        f"{label}the whole of sample, with its notes ({seconds['sample'] * 1e3:.0f} ms)",
        seconds["sample"] / seconds["paint"],
        "<= 2",
    )
    line(
        f"{label}… of a solid with twice the faces ({seconds['block'] * 1e3:.0f} ms)",
        seconds["block"] / seconds["sample"],
        "none",
    )
