"""Sonars: the law of the echo, what is missed at a grazing angle, and what a corner does."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j1

from terratool.field.terrain import Terrain
from terratool.sensing.poses import one_pose
from terratool.sensing.readings import Frame, ReadingStatus
from terratool.sensing.scan import Scan, ScanOptions
from terratool.sensing.sensor import Sonar
from terratool.sensing.sonar import bessel_over, fan, pattern
from tests.conftest import terrain_of
from tests.sensing.yard import sensor

BEAM: dict[str, Any] = {"beamWidth": 10, "threshold": 1e-9, "diffuse": 0}


def room(sonar_refl: float | None = 0.64, floor: float = 0.0, *, screen: bool = False) -> Terrain:
    """Walls 40 high to the east, x = 30, and to the north, y = 20: they meet in a corner.

    A screen that swallows sound stands at x = 24 for y from 8.9 to 13.9.
    """
    felt = {"at": [24, 11.4], "extent": [0.2, 5], "type": "flat", "vScale": 40, "surface": "floor"}
    surface = {} if sonar_refl is None else {"sonarRefl": sonar_refl}
    return terrain_of(
        {
            "size": [40, 30],
            "surfTypes": {"wall": surface, "floor": {"sonarRefl": floor}, "tar": {}},
            "elemTypes": {"flat": {"x": [1]}},
            "elemTree": {
                "type": "flat", "vScale": 0, "surface": "floor",
                "children": [
                    {"at": [35, 15], "extent": [10, 30], "type": "flat", "vScale": 40,
                     "surface": "wall"},
                    {"at": [15, 25], "extent": [30, 10], "type": "flat", "vScale": 40,
                     "surface": "wall"},
                    *([felt] if screen else []),
                ],
            },
        }
    )  # fmt: skip


ROOM = room()


def heard(keys: dict[str, Any], *pose: float, terrain: Terrain = ROOM, **more: Any) -> Frame:
    """The ping of a sonar from a pose."""
    sonar = sensor(sonar={**BEAM, **keys}, **more)
    (frame,) = Scan(sonar, one_pose(pose), ScanOptions()).check_poses(terrain).read(terrain)
    return frame


def amplitude(keys: dict[str, Any], *pose: float, terrain: Terrain = ROOM) -> float:
    """All that comes back, summed over so long a pulse that it holds everything."""
    frame = heard({"pulseLength": 1000, "threshold": 1e-12, **keys}, *pose, terrain=terrain)
    assert frame.returns.all()
    return float(frame.intensity[0])


# The pieces


def test_the_bessel_function_is_that_of_scipy() -> None:
    """To 1e-7, on both sides of 3 and at 0."""
    x = np.concatenate([[1e-9], np.linspace(0.01, 60, 5000)])
    np.testing.assert_allclose(bessel_over(x), j1(x) / x, atol=2e-7)
    assert bessel_over(np.zeros(1))[0] == 0.5


def test_half_of_the_power_is_sent_at_half_of_the_width() -> None:
    """D² is ½ there, D is 1 on the axis, and the fan ends where D is 0 for the first time."""
    head = sensor(sonar={**BEAM, "beamWidth": 17}).head
    assert isinstance(head, Sonar)
    for angle, power in ((0.0, 1.0), (math.radians(8.5), 0.5), (head.cone, 0.0)):
        direction = np.array([[math.cos(angle), 0.0, math.sin(angle)]])
        assert pattern(head, direction)[0] ** 2 == pytest.approx(power, abs=1e-6)
    assert pattern(head, np.array([[-1.0, 0.0, 0.0]]))[0] == 0.0


def test_the_fan_covers_the_cone_evenly() -> None:
    """Means of powers of cos ψ over the cone are those of the integral; no side is preferred."""
    head = sensor(sonar={**BEAM, "cone": 80}).head
    assert isinstance(head, Sonar)
    ways = fan(head)
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1)
    least = math.cos(math.radians(40))
    assert ways[:, 0].min() >= least
    for power in (1, 2, 7):
        mean = (1 - least ** (power + 1)) / ((power + 1) * (1 - least))
        assert (ways[:, 0] ** power).mean() == pytest.approx(mean, rel=1e-4)
    np.testing.assert_allclose(ways[:, 1:].mean(axis=0), 0, atol=1e-3)


# The law


@pytest.mark.parametrize("distance", [2.0, 5.0, 12.0])
@pytest.mark.parametrize("absorption", [0.0, 1.5])
def test_a_mirror_square_to_the_axis(distance: float, absorption: float) -> None:
    """√μ · e^(−2 α r) / r², less what the beam loses beside its axis; the range is the distance."""
    keys = {"absorption": absorption, "lobe": 1, "rays": 40_000}
    got = amplitude(keys, 30 - distance, 10, 20, 0, 0, 0)
    alpha = absorption * math.log(10) / 20
    assert got == pytest.approx(0.8 * math.exp(-2 * alpha * distance) / distance**2, rel=0.03)
    frame = heard({**keys, "pulseLength": 0.05}, 30 - distance, 10, 20, 0, 0, 0)
    assert frame.range[0] == pytest.approx(distance, rel=1e-3)
    assert frame.points[0] == pytest.approx([30, 10, 20], abs=0.02)
    assert frame.wall[0] and ROOM.surfaces[frame.surface[0]] == "wall"


def test_a_rough_wall_square_to_the_axis() -> None:
    """By Lambert's law: the integral of √μ cos θ / π · D⁴ / r² over the beam, r = d / cos θ."""
    head = sensor(sonar=BEAM).head
    assert isinstance(head, Sonar)

    def ring(theta: float) -> float:
        x = head.wave_radius * math.sin(theta)
        two_ways = (2 * j1(x) / x) ** 2 if x else 1.0
        spread = (math.cos(theta) / 4.0) ** 2
        return two_ways * math.cos(theta) / math.pi * spread * 2 * math.pi * math.sin(theta)

    expected = 0.8 * quad(ring, 0, head.cone)[0]
    got = amplitude({"diffuse": 1, "bounces": 1}, 26, 10, 20, 0, 0, 0)
    assert got == pytest.approx(expected, rel=1e-3)


def test_reflections_are_those_of_the_surface() -> None:
    """Amplitudes go with √μ: a quarter of μ is half of the amplitude, none is none."""
    pose = (26, 10, 20, 0, 0, 0)
    full = amplitude({}, *pose, terrain=room(1.0))
    assert amplitude({}, *pose, terrain=room(0.25)) == pytest.approx(full / 2, rel=1e-9)
    assert heard({}, *pose, terrain=room(0.0)).status[0] == ReadingStatus.FAINT


def test_what_a_surface_lacks_is_assumed_and_told() -> None:
    """The sensor's own value stands in; surfaces that were not met are not told of."""
    pose = (26, 10, 20, 0, 0, 0)
    bare = room(None)
    frame = heard({"sonarRefl": 0.25}, *pose, terrain=bare)
    assert [bare.surfaces[index] for index in frame.lacking] == ["wall"]
    known = heard({"sonarRefl": 0.9}, *pose, terrain=room(0.25))
    assert known.lacking == frozenset()
    np.testing.assert_allclose(frame.intensity, known.intensity)


# What follows from it


MODEST = {"threshold": 0.0015, "pulseLength": 0.1}
"""A mirror of 0.64 is heard over some 20 m by this one."""


def test_a_smooth_wall_at_a_grazing_angle_is_missed() -> None:
    """Square to it the wall in 8 m is heard; turned by 35 degrees it is not, unless it is rough."""
    square = heard(MODEST, 22, 10, 20, 0, 0, 0)
    assert square.range[0] == pytest.approx(8, rel=1e-2)
    turned = heard({**MODEST, "bounces": 1}, 22, 15, 20, -35, 0, 0)
    assert turned.status[0] == ReadingStatus.FAINT
    assert np.isnan(turned.range[0])
    rough = heard({**MODEST, "diffuse": 1, "threshold": 1e-6}, 22, 15, 20, -35, 0, 0)
    assert rough.returns[0]
    assert 8 < rough.range[0] < 8 / math.cos(math.radians(35))


def test_a_corner_is_seen() -> None:
    """Along the bisector both walls are at 45 degrees and mirror sound back by way of each other.

    It comes from the edge where they meet. Without a second bounce nothing is heard.
    """
    away = 10.0
    pose = (30 - away, 20 - away, 20, 45, 0, 0)
    corner = heard(MODEST, *pose)
    assert corner.range[0] == pytest.approx(away * math.sqrt(2), rel=1e-2)
    assert heard({**MODEST, "bounces": 1}, *pose).status[0] == ReadingStatus.FAINT
    # both mirrors count, √μ · √μ, and the incidence on the last; its range is that of the edge
    keys = {"lobe": 1, "rays": 40_000}
    expected = 0.64 * math.cos(math.radians(45)) / (2 * away**2)
    assert amplitude(keys, *pose) == pytest.approx(expected, rel=0.05)
    # of other directions along the walls it is seen as well: a corner is, from anywhere
    aside = (22, 13, 20, math.degrees(math.atan2(7, 8)), 0, 0)
    assert heard(MODEST, *aside).range[0] == pytest.approx(math.hypot(8, 7), rel=1e-2)


def test_the_way_back_has_to_be_free() -> None:
    """A screen right of the axis lets out what comes back by the right, and stops it there.

    Left of the axis sound meets the north wall first, then the east one, and comes back on the
    right; there the screen swallows it. So hardly anything of the corner is left.
    """
    screened = room(screen=True)
    pose = (20, 10, 20, 45, 0, 0)
    free = float(heard(MODEST, *pose).intensity[0])
    rest = heard({**MODEST, "threshold": 0.25 * free}, *pose, terrain=screened)
    assert not rest.returns[0]


def test_the_first_loud_echo_is_the_reading() -> None:
    """A nearer wall beside the beam is read only where it is loud enough; else what is behind."""
    straight = heard(MODEST, 10, 10, 20, 0, 0, 0)
    assert straight.range[0] == pytest.approx(20, rel=1e-2)
    down = heard({**MODEST, "threshold": 1e-9}, 10, 10, 3, 0, 90, 0, terrain=room(floor=0.5))
    assert down.range[0] == pytest.approx(3, rel=1e-2)
    assert not down.wall[0]


def test_what_is_not_heard_is_told_apart() -> None:
    """Too near, too far, too faint, and nothing there at all."""
    pose = (22, 10, 20, 0, 0, 0)
    assert heard({}, *pose, range=[9, 30]).status[0] == ReadingStatus.NEAR
    assert heard({}, *pose, range=[0.1, 7]).status[0] == ReadingStatus.FAR
    assert heard({"threshold": 1}, *pose).status[0] == ReadingStatus.FAINT
    assert heard({}, 22, 10, 20, 180, -10, 0).status[0] == ReadingStatus.OUTSIDE
    frame = heard({"threshold": 1}, *pose)
    assert (frame.surface[0], frame.element[0], frame.wall[0]) == (-1, -1, False)


def test_the_echo_turns_with_the_sonar() -> None:
    """The point read lies along the axis, whichever way that is."""
    frame = heard({}, 22, 13, 20, 90, 0, 0)
    np.testing.assert_allclose(frame.points[0], [22, 20, 20], atol=0.1)
    np.testing.assert_allclose(frame.local[0], [7, 0, 0], atol=0.1)
