"""Depth cameras, by the pinhole model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terratool.sensing.readings import Frame
from terratool.sensing.sensor import Sensor
from tests.sensing.yard import BRICK, SNOW, STEEL, frame, sensor

PLAIN = {"width": 81, "height": 61, "fov": 60}
ODD = {"width": 81, "height": 61, "focal": [70, 90], "principal": [30, 25.3]}


def pictured(keys: dict[str, Any], *angles: float) -> tuple[Sensor, Frame]:
    camera = sensor(camera=keys)
    return camera, frame(camera, *angles)


@pytest.mark.parametrize("keys", [PLAIN, ODD])
def test_a_wall_is_where_the_pinhole_has_it(keys: dict[str, Any]) -> None:
    """The brick's face is 18 m ahead, from 4 m left to 2 m right, 1.8 m up to 1.2 m down.

    Its pixels are those with u from cx − fx · 4 / 18 to cx + fx · 2 / 18 and v from
    cy − fy · 1.8 / 18 to cy + fy · 1.2 / 18, and all of them have a depth of 18 m, not a range.
    """
    _, got = pictured(keys)
    fx, fy = keys.get("focal", [40.5 / math.tan(math.radians(30))] * 2)
    cx, cy = keys.get("principal", [40, 30])
    u, v = np.meshgrid(np.arange(81), np.arange(61))
    face = (cx - fx * 4 / 18 < u) & (u < cx + fx * 2 / 18)
    face &= (cy - fy * 1.8 / 18 < v) & (v < cy + fy * 1.2 / 18)
    surface, depth = got.surface.reshape(61, 81), got.range.reshape(61, 81)
    np.testing.assert_array_equal((surface == BRICK) & got.wall.reshape(61, 81), face)
    assert face.sum() > 200
    np.testing.assert_allclose(depth[face], 18, rtol=1e-9)
    ground = surface == SNOW
    np.testing.assert_allclose(depth[ground], 1.2 * fy / (v - cy)[ground], rtol=1e-9)
    assert np.isnan(depth[: int(cy - fy * 1.8 / 18)]).all()


def test_points_lie_on_what_is_seen() -> None:
    """In the world they are on faces and the ground, whichever way the camera looks."""
    _, got = pictured(PLAIN, 80, 3, 0)
    assert {*got.surface[got.returns]} == {SNOW, STEEL}
    steel = got.points[(got.surface == STEEL) & got.wall]
    np.testing.assert_allclose(steel[:, 1], 219, atol=1e-9)
    assert 107 <= steel[:, 0].min() < 108 and 112 < steel[:, 0].max() <= 113
    np.testing.assert_allclose(got.points[got.surface == SNOW, 2], 0.5, atol=1e-9)
    # yaw 80 leaves north left of the middle
    columns = np.nonzero(got.surface.reshape(61, 81) == STEEL)[1]
    assert columns.mean() < 40


def test_range_limits_are_of_depth() -> None:
    """A face in 18 m is seen to its corners by one that reads 18 m, though they are farther."""
    for most, seen in ((18.001, True), (17.999, False)):
        got = frame(sensor(camera=PLAIN, range=[0.1, most]))
        assert ((got.surface == BRICK).sum() > 200) == seen


def test_noise_is_of_depth() -> None:
    """σ by the depth, along the pixel's ray."""
    camera = sensor(camera=PLAIN, noise={"perSquareMetre": 0.001})
    exact, noisy = frame(camera), frame(camera, seed=3)
    face = exact.surface == BRICK
    off = noisy.range[face] - 18
    assert np.std(off) == pytest.approx(0.001 * 18**2, rel=0.15)
    factor = noisy.range[face, None] / 18
    np.testing.assert_allclose(noisy.local[face], exact.local[face] * factor, atol=1e-9)
