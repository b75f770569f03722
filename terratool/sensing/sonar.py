"""What a sonar hears: a fan of rays, what each of them brings back, and the first echo.

The amplitude of a ray is that of simulators of marine sonars (Cerqueira, Trocoli, Neves, Joyeux,
Albiez and Oliveira, A novel GPU-based sonar simulator for real-time applications, Computers &
Graphics 68, 2017; Choi, Olson, Davis, Zhang, Racson, Bingham, McCarrin, Vogt and Herman,
Physics-based modelling and simulation of multibeam echosounder perception for autonomous underwater
manipulation, Frontiers in Robotics and AI 8, 2021):

    √μ · cos θ · e^(−2 α r) / r² · D²

with the reflection μ of the surface, the angle of incidence θ, the absorption α, the range r and
the pattern D of the beam, on the way out and on the way back. What comes back has two parts, a
share δ by Lambert's law and the rest mirrored into a lobe about the mirrored direction, a normal
distribution of the deviation s in the angle β from there:

    (1 − δ) · exp(−β² / 2 s²) / (π s² / 2) + δ / π,

in each steradian of the fan. So a perfect mirror square to the axis has 1 / r², and 1 in a metre.
Sound that is mirrored away is followed to the next surface, and heard from there if it can be seen:
the way of a corner, whose two mirrors send sound back where it came from. Its r is half of the way.

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
from terratool.sensing.readings import Frame, Status, passed
from terratool.sensing.sensor import Sensor, Sonar

Floats = NDArray[np.float64]

_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
_OFF = 1e-7
"""How far off a surface sound goes on, in metres and in parts of its way: not on it again."""
_SERIES = (0.5, -0.56249985, 0.21093573, -0.03954289, 0.00443319, -0.00031761, 0.00001109)
_SIZE = (0.79788456, 0.00000156, 0.01659667, 0.00017105, -0.00249511, 0.00113653, -0.00020033)
_PHASE = (
    -2.35619449, 0.12499612, 0.0000565, -0.00637879, 0.00074348, 0.00079824, -0.00029166,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Echoes:
    """What comes back of the rays of one ping, each array (n,).

    Attributes:
        range: half of the way, m, ascending.
        amplitude: 1 is that of a perfect mirror in a metre.
        surface, element, wall: what sent it back last.
    """

    range: Floats
    amplitude: Floats
    surface: NDArray[np.int32]
    element: NDArray[np.int64]
    wall: NDArray[np.bool_]


def fan(sonar: Sonar) -> Floats:
    """(n, 3) directions over the cone about x, each for as large a part of it, on a spiral."""
    count = sonar.rays
    height = 1.0 - (1.0 - math.cos(sonar.cone)) * (np.arange(count) + 0.5) / count
    radius = np.sqrt(np.maximum(1.0 - height * height, 0.0))
    turn = np.arange(count) * _GOLDEN
    return np.stack([height, radius * np.cos(turn), radius * np.sin(turn)], axis=-1)


def pattern(sonar: Sonar, directions: Floats) -> Floats:
    """D of directions (n, 3) of length 1 in the sensor's axes: 1 on the axis."""
    ahead = directions[:, 0]
    if sonar.uniform:
        return np.where(ahead >= math.cos(sonar.cone) - 1e-12, 1.0, 0.0)
    sine = np.hypot(directions[:, 1], directions[:, 2])
    falls = np.abs(2.0 * bessel_over(sonar.wave_radius * sine))
    return np.where(ahead > 0.0, falls, 0.0)


def bessel_over(x: Floats) -> Floats:
    """J1(x) / x for x of 0 or more; Abramowitz and Stegun 9.4.4 and 9.4.6, to 1e-7."""
    small = np.polynomial.polynomial.polyval((np.minimum(x, 3.0) / 3.0) ** 2, _SERIES)
    large = np.maximum(x, 3.0)
    size = np.polynomial.polynomial.polyval(3.0 / large, _SIZE)
    phase = large + np.polynomial.polynomial.polyval(3.0 / large, _PHASE)
    over: Floats = np.where(x <= 3.0, small, size * np.cos(phase) / large**1.5)
    return over


def ping(terrain: Terrain, sensor: Sensor, pose: Poses, number: int) -> Frame:
    """What a sonar hears of one ping, exactly.

    The reading is the first range at which the amplitudes of a pulse come to the threshold. Its
    intensity is the largest that they come to within a pulse from there; its surface and element
    are those of the strongest ray until then.
    """
    sonar = sensor.head
    assert isinstance(sonar, Sonar)
    matrix, origin = pose.matrices[0], pose.positions[0]
    first, echoes, lacking = _heard(terrain, sensor, matrix, origin)
    within = (echoes.range >= sensor.least) & (echoes.range <= sensor.most)
    ranges, amplitudes = echoes.range[within], echoes.amplitude[within]
    sums = np.concatenate([[0.0], np.cumsum(amplitudes)])
    begins = np.searchsorted(ranges, ranges - sonar.pulse_length, "right")
    heard = sums[1:] - sums[begins]
    loud = np.flatnonzero(heard >= sonar.threshold)
    status, range_, amplitude = Status.RETURN, math.nan, 0.0
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
        status = Status.FAINT
    elif (echoes.range < sensor.least).any():
        status = Status.NEAR
    elif len(echoes.range):
        status = Status.FAR
    else:  # all of it went where there is nothing, or was seen from behind
        status = Status(int(first.min())) if len(first) else Status.FAINT
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
        element=np.array([element], np.int64),
        wall=np.array([wall]),
        status=np.array([status], np.uint8),
        lacking=lacking,
    )


def _heard(
    terrain: Terrain, sensor: Sensor, matrix: Floats, origin: Floats
) -> tuple[NDArray[np.uint8], Echoes, frozenset[int]]:
    """What became of rays that met nothing, all echoes, and surfaces of unknown reflection."""
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
            first = passed(terrain, starts[~met], ways[~met])
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
        if bounce:  # the first one is seen, as the ray came from there
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
    """μ by surface, the last one that of no surface, and which of them are not known."""
    given = [terrain.surface_types[name].sonar_refl for name in terrain.surfaces]
    known = [value is not UNSET for value in given]
    values = [sonar.reflection if value is UNSET else value for value in given]
    return np.array([*values, sonar.reflection]), ~np.array([*known, False])
