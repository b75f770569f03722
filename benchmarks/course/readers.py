"""Heights and friction of the course from its files, and from nothing else."""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple, Protocol

import mujoco
import numpy as np
from course.truth import WIDTH, Array

import terratool
from terratool.field.friction import frictions_of

_ABOVE = 100.0
"""Rays begin so high, m."""


class Ground(NamedTuple):
    """What lies at points.

    Attributes:
        height: m; NaN where there is nothing.
        friction: coefficient; None if the file has none.
    """

    height: Array
    friction: Array | None


class Reader(Protocol):
    """A file that has been read."""

    def at(self, x: Array, y: Array) -> Ground:
        """What lies at points; x and y have one length."""


class Definition:
    """A definition, in terratool."""

    def __init__(self, path: Path) -> None:
        self._terrain = terratool.load(path)
        self._friction = frictions_of(self._terrain).astype(float)

    def at(self, x: Array, y: Array) -> Ground:
        """See `Reader`."""
        found = self._terrain.sample(x, y)
        return Ground(found.height, self._friction[found.surface + 1])


class MuJoCo:
    """An MJCF, by rays from above on the geoms of one group."""

    def __init__(self, path: Path, group: int = 0) -> None:
        self._model = mujoco.MjModel.from_xml_path(str(path))
        self._model.geom_rgba[:, 3] = 1.0  # rays pass what cannot be seen
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        self._groups = np.arange(mujoco.mjNGROUP) == group

    def at(self, x: Array, y: Array) -> Ground:
        """See `Reader`."""
        ground = Ground(np.full(len(x), np.nan), np.full(len(x), np.nan))
        down, groups = np.array([0.0, 0.0, -1.0]), self._groups.astype(np.uint8)
        geom = np.zeros(1, np.int32)
        for n, start in enumerate(np.stack([x, y, np.full(len(x), _ABOVE)], axis=1)):
            far = mujoco.mj_ray(self._model, self._data, start, down, groups, 1, -1, geom)
            if far >= 0.0:
                ground.height[n] = _ABOVE - far
                ground.friction[n] = self._model.geom_friction[geom[0], 0]
        return ground


class Sdf:
    """Boxes and extruded triangles of an SDF, as half-spaces."""

    def __init__(self, path: Path) -> None:
        found = ET.parse(path).iter("collision")
        self._solids = [(_half_spaces(one), float(one.findtext(".//mu", ""))) for one in found]

    def at(self, x: Array, y: Array) -> Ground:
        """See `Reader`."""
        height, friction = np.full(len(x), -np.inf), np.full(len(x), np.nan)
        for (normals, offsets), mu in self._solids:
            free = offsets[:, np.newaxis] - normals[:, :2] @ np.stack([x, y])
            up = normals[:, 2, np.newaxis]
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = free / up
            top = np.where(up > 1e-6, ends, np.inf).min(axis=0)
            bottom = np.where(up < -1e-6, ends, -np.inf).max(axis=0)
            beside = ((np.abs(up) <= 1e-6) & (free < 0.0)).any(axis=0)
            higher = ~beside & (top >= bottom) & (top > height)
            height, friction = np.where(higher, top, height), np.where(higher, mu, friction)
        return Ground(np.where(np.isfinite(height), height, np.nan), friction)


def _numbers(text: str | None) -> Array:
    return np.array((text or "").split(), float)


def _half_spaces(collision: ET.Element) -> tuple[Array, Array]:
    """Outward normals n and offsets d of a convex solid, n · p ≤ d, in the frame of the model."""
    if (sides := collision.findtext(".//size")) is not None:
        half = _numbers(sides) / 2
        normals, offsets = np.concatenate([np.eye(3), -np.eye(3)]), np.concatenate([half, half])
    else:
        corners = np.array([_numbers(point.text) for point in collision.iter("point")])
        ways = np.roll(corners, -1, axis=0) - corners  # counterclockwise
        sides = np.stack([ways[:, 1], -ways[:, 0], np.zeros(len(ways))], axis=1)
        sides /= np.linalg.norm(sides, axis=1, keepdims=True)
        normals = np.concatenate([sides, [[0, 0, 1], [0, 0, -1]]])
        thick = float(collision.findtext(".//height", ""))
        offsets = np.concatenate([(sides[:, :2] * corners).sum(axis=1), [thick, 0.0]])
    pose = _numbers(collision.findtext("pose"))
    (cr, cp, cy), (sr, sp, sy) = np.cos(pose[3:]), np.sin(pose[3:])
    turn = (
        np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    )
    normals = normals @ turn.T
    return normals, offsets + normals @ pose[:3]


class Crg:
    """An OpenCRG file of text with a straight reference line, bilinear between its numbers."""

    def __init__(self, path: Path) -> None:
        lines = iter(path.read_text().splitlines())
        head = list(itertools.takewhile(lambda line: not line.startswith("$$$$"), lines))
        said = dict(line.split(" = ") for line in head if " = " in line)
        known = {key.strip(): float(value) for key, value in said.items()}
        sections = sum(line.startswith("D:long section") for line in head)
        self._step = known["REFERENCE_LINE_INCREMENT"], known["LONG_SECTION_V_INCREMENT"]
        self._start = known["REFERENCE_LINE_START_U"], known["LONG_SECTION_V_RIGHT"]
        block = math.ceil(sections / 8)
        rows = np.array(
            [[line[n : n + 10].strip() or "nan" for n in range(0, 80, 10)] for line in lines]
        )
        self._z = rows.astype(float).reshape(-1, 8 * block)[:, :sections]

    def at(self, x: Array, y: Array) -> Ground:
        """See `Reader`."""
        u = (x - self._start[0]) / self._step[0]
        v = (y - WIDTH / 2 - self._start[1]) / self._step[1]
        i, j = (
            np.clip(np.floor(w).astype(int), 0, n - 2)
            for w, n in zip((u, v), self._z.shape, strict=True)
        )
        s, t, z = u - i, v - j, self._z
        low = z[i, j] * (1 - t) + z[i, j + 1] * t
        high = z[i + 1, j] * (1 - t) + z[i + 1, j + 1] * t
        return Ground(low * (1 - s) + high * s, None)
