"""Simulated sonar: a fan of rays, the echo of each, and the first one above a threshold.

The amplitude of a ray is that of simulators of marine sonars (Cerqueira, Trocoli, Neves, Joyeux,
Albiez and Oliveira, A novel GPU-based sonar simulator for real-time applications, Computers &
Graphics 68, 2017; Choi, Olson, Davis, Zhang, Racson, Bingham, McCarrin, Vogt and Herman,
Physics-based modelling and simulation of multibeam echosounder perception for autonomous underwater
manipulation, Frontiers in Robotics and AI 8, 2021):

    √μ · cos θ · e^(−2 α r) / r² · D²

with the reflection μ of the surface, the angle of incidence θ, the absorption α, the range r and
the pattern D of the beam, out and back. The echo has two parts: a share δ by Lambert's law, and the
rest in a lobe about the mirrored direction, a normal distribution of deviation s in the angle β
from that direction:

    (1 − δ) · exp(−β² / 2 s²) / (π s² / 2) + δ / π,

per steradian of the fan. So a perfect mirror square to the axis has amplitude 1 / r², 1 at 1 m.
Mirrored sound is followed to the next surface, and heard from there if the sensor sees it: a corner
of two mirrors sends sound back to its source. Its r is half of the path.

Amplitudes are summed over the length of a pulse; no phases are kept. The pattern of a round piston
is 2 J1(x) / x with x = k a sin ψ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.sensing.poses import Poses
from terratool.sensing.readings import Frame, ReadingStatus, miss_status
from terratool.sensing.sensor import Sensor, Sonar

Floats = NDArray[np.float64]

_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
_OFF = 1e-7
"""Offset from a surface at which mirrored sound starts, m and as a share of its path."""
_SERIES = (0.5, -0.56249985, 0.21093573, -0.03954289, 0.00443319, -0.00031761, 0.00001109)
_SIZE = (0.79788456, 0.00000156, 0.01659667, 0.00017105, -0.00249511, 0.00113653, -0.00020033)
_PHASE = (
    -2.35619449, 0.12499612, 0.0000565, -0.00637879, 0.00074348, 0.00079824, -0.00029166,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Echoes:
    """Echoes of the rays of one ping, in arrays of (n,).

    Attributes:
        range: half of the path, m, ascending.
        amplitude: amplitude, relative to a perfect mirror at 1 m.
        surface: index of the last surface; -1 for none.
        element: index of the last element; -1 for none.
        wall: whether the last surface is a wall.
    """

    range: Floats
    amplitude: Floats
    surface: NDArray[np.int32]
    element: NDArray[np.int64]
    wall: NDArray[np.bool_]


def fan(sonar: Sonar) -> Floats:
    """Unit directions over the cone about x, (n, 3), on a spiral with equal solid angles."""
    count = sonar.rays
    height = 1.0 - (1.0 - math.cos(sonar.cone)) * (np.arange(count) + 0.5) / count
    radius = np.sqrt(np.maximum(1.0 - height * height, 0.0))
    turn = np.arange(count) * _GOLDEN
    return np.stack([height, radius * np.cos(turn), radius * np.sin(turn)], axis=-1)


def pattern(sonar: Sonar, directions: Floats) -> Floats:
    """Beam pattern D at unit directions (n, 3) in the sensor's axes, (n,); 1 on the axis."""
    ahead = directions[:, 0]
    if sonar.uniform:
        return np.where(ahead >= math.cos(sonar.cone) - 1e-12, 1.0, 0.0)
    sine = np.hypot(directions[:, 1], directions[:, 2])
    falls = np.abs(2.0 * bessel_over(sonar.wave_radius * sine))
    return np.where(ahead > 0.0, falls, 0.0)


def bessel_over(x: Floats) -> Floats:
    """Return J1(x) / x for x ≥ 0, to 1e-7: Abramowitz and Stegun 9.4.4 and 9.4.6."""
    small = np.polynomial.polynomial.polyval((np.minimum(x, 3.0) / 3.0) ** 2, _SERIES)
    large = np.maximum(x, 3.0)
    size = np.polynomial.polynomial.polyval(3.0 / large, _SIZE)
    phase = large + np.polynomial.polynomial.polyval(3.0 / large, _PHASE)
    over: Floats = np.where(x <= 3.0, small, size * np.cos(phase) / large**1.5)
    return over


def ping(terrain: Terrain, sensor: Sensor, pose: Poses, number: int) -> Frame:
    """Simulate one ping of a sonar, without noise.

    The reading is the first range at which the sum of amplitudes over a pulse reaches the
    threshold. The intensity is the largest such sum within a pulse from there; surface and element
    are those of the strongest echo up to that range.

    Args:
        terrain: terrain around the sensor.
        sensor: sensor with a sonar head.
        pose: pose of the sensor, one.
        number: number of the frame, from 0.
    """
    sonar = sensor.head
    assert isinstance(sonar, Sonar)
    matrix, origin = pose.matrices[0], pose.positions[0]
    first, echoes, lacking = _echoes(terrain, sensor, matrix, origin)
    within = (echoes.range >= sensor.least) & (echoes.range <= sensor.most)
    ranges, amplitudes = echoes.range[within], echoes.amplitude[within]
    sums = np.concatenate([[0.0], np.cumsum(amplitudes)])
    begins = np.searchsorted(ranges, ranges - sonar.pulse_length, "right")
    heard = sums[1:] - sums[begins]
    loud = np.flatnonzero(heard >= sonar.threshold)
    status, range_, amplitude = ReadingStatus.RETURN, math.nan, 0.0
    surface, element, wall = -1, -1, False
    if len(loud):
        index = int(loud[0])
        end = int(np.searchsorted(ranges, ranges[index] + sonar.pulse_length, "right"))
        range_, amplitude = float(ranges[index]), float(heard[index:end].max())
        strongest = int(begins[index] + np.argmax(amplitudes[begins[index] : end]))
        of = np.flatnonzero(within)[strongest]
        surface, element = int(echoes.surface[of]), int(echoes.element[of])
        wall = bool(echoes.wall[of])
    elif len(ranges):
        status = ReadingStatus.FAINT
    elif (echoes.range < sensor.least).any():
        status = ReadingStatus.NEAR
    elif len(echoes.range):
        status = ReadingStatus.FAR
    else:  # all sound left the terrain, or met surfaces from behind
        status = ReadingStatus(int(first.min())) if len(first) else ReadingStatus.FAINT
    return Frame(
        number=number,
        poses=pose,
        shape=(1,),
        range=np.array([range_]),
        local=np.array([[range_, 0.0, 0.0]]) if len(loud) else np.full((1, 3), np.nan),
        points=(origin + matrix[:, 0] * range_)[None],
        intensity=np.array([amplitude], np.float32),
        ring=np.zeros(1, np.uint16),
        offset=np.zeros(1),
        surface=np.array([surface], np.int32),
        element=terrain.short_numbers(np.array([element], np.int64)),
        wall=np.array([wall]),
        status=np.array([status], np.uint8),
        lacking=lacking,
    )


def _echoes(
    terrain: Terrain, sensor: Sensor, matrix: Floats, origin: Floats
) -> tuple[NDArray[np.uint8], Echoes, frozenset[int]]:
    """Statuses of rays without a hit, all echoes, and indices of surfaces without `sonarRefl`."""
    sonar = sensor.head
    assert isinstance(sonar, Sonar)
    reflections, unknown = _reflections(terrain, sonar)
    local = fan(sonar)
    ways = local @ matrix.T
    weight = 2.0 * math.pi * (1.0 - math.cos(sonar.cone)) / sonar.rays
    strength = weight * pattern(sonar, local)
    starts = np.tile(origin, (len(ways), 1))
    gone = np.zeros(len(ways))
    parts, lacking = list[Echoes](), set[int]()
    first = np.zeros(0, np.uint8)
    for bounce in range(sonar.bounces):
        hits = terrain.cast(starts, ways, np.maximum(2.0 * sensor.most - gone, 0.0))
        met = np.isfinite(hits.distance)
        if bounce == 0 and not met.all():
            first = miss_status(terrain, starts[~met], ways[~met])
        ways, gone, strength = ways[met], gone[met] + hits.distance[met], strength[met]
        points, normals = hits.point[met], hits.normal[met]
        surface = hits.surface[met]
        if not len(points):
            break
        lacking |= {*np.unique(surface[unknown[surface]]).tolist()} - {-1}
        strength = strength * np.sqrt(reflections[surface])
        back = origin - points
        far = np.linalg.norm(back, axis=-1)
        to = back / np.maximum(far, 1e-12)[:, None]
        cosine = (to * normals).sum(axis=-1)
        mirrored = ways - 2.0 * (ways * normals).sum(axis=-1, keepdims=True) * normals
        beyond = points + normals * (_OFF * np.maximum(1.0, gone))[:, None]
        seen = cosine > 0.0
        if bounce:  # the first hit is always seen from the sensor
            seen[seen] = np.isinf(
                terrain.cast(beyond[seen], to[seen], far[seen] * (1.0 - _OFF)).distance
            )
        beta = 2.0 * np.arcsin(np.minimum(np.linalg.norm(mirrored - to, axis=-1) / 2.0, 1.0))
        lobe = np.exp(-0.5 * (beta / sonar.lobe) ** 2) / (0.5 * math.pi * sonar.lobe**2)
        law = (1.0 - sonar.diffuse) * lobe + sonar.diffuse / math.pi
        half = 0.5 * (gone + far)
        spread = np.exp(-2.0 * sonar.absorption * half) / np.maximum(half, 1e-9) ** 2
        heard = strength * cosine * law * spread * pattern(sonar, -to @ matrix)
        parts.append(
            Echoes(
                half[seen],
                heard[seen],
                surface[seen],
                hits.element[met][seen],
                hits.wall[met][seen],
            )
        )
        strength = strength * (1.0 - sonar.diffuse)
        starts, ways = beyond, mirrored / np.linalg.norm(mirrored, axis=-1, keepdims=True)
    if not parts:
        none = np.zeros(0)
        empty = none.astype(np.int32), none.astype(np.int64), none.astype(bool)
        return first, Echoes(none, none, *empty), frozenset()
    order = np.argsort(np.concatenate([part.range for part in parts]), kind="stable")
    names = ("range", "amplitude", "surface", "element", "wall")
    columns = [np.concatenate([getattr(part, name) for part in parts])[order] for name in names]
    return first, Echoes(*columns), frozenset(lacking)


def _reflections(terrain: Terrain, sonar: Sonar) -> tuple[Floats, NDArray[np.bool_]]:
    """Reflections μ by surface, (surfaces + 1,), the last for none, and which are assumed."""
    given = [terrain.surface_types[name].sonar_refl for name in terrain.surfaces]
    known = [value is not UNSET for value in given]
    values = [sonar.reflection if value is UNSET else value for value in given]
    return np.array([*values, sonar.reflection]), ~np.array([*known, False])
