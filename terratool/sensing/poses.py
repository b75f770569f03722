"""Poses of a sensor: reading from numbers or CSV, interpolation, and placement on the ground.

Axes are those of ROS REP 103: x ahead, y to the left, z up. Roll, pitch and yaw turn about the
fixed axes x, y and z, in this order, so that R = Rz(yaw) · Ry(pitch) · Rx(roll): a positive yaw
turns to the left, a positive pitch looks down, a positive roll lowers the right side.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.definition.findings import Bounds
from terratool.errors import ReadError, RequestError
from terratool.field.terrain import Terrain
from terratool.io.clouds import rotation_matrices
from terratool.report.wording import join_words
from terratool.text.display import quote
from terratool.text.numbers import parse_number
from terratool.text.source import read_source

Floats = NDArray[np.float64]

MOST_POSES = 1_000_000
"""Most poses in a path."""
_MOST_BYTES = 1 << 28
_FAR = 1e12
"""Largest coordinate or angle of a pose; beyond it doubles do not resolve 0.1 mm."""
_COLUMNS = ("time", "x", "y", "z", "yaw", "pitch", "roll")
_BELOW = 1e-9
"""Tolerated depth of a sensor below the ground, relative to the larger of the two heights."""


@dataclass(frozen=True, slots=True)
class Poses:
    """Poses of a sensor.

    Attributes:
        times: (n,) times, s, ascending.
        positions: (n, 3) world positions, m; `place_on_ground` replaces z where requested.
        turns: (n, 4) unit quaternions x, y, z, w from sensor axes to world axes.
        timed: whether times are given; else the sensor rests at each pose.
    """

    times: Floats
    positions: Floats
    turns: Floats
    timed: bool = False

    def __len__(self) -> int:
        return len(self.times)

    @classmethod
    def join(cls, parts: list[Poses]) -> Poses:
        """Concatenate poses as poses of rest, with times 0, 1, 2 and so on."""
        return cls(
            np.arange(len(parts), dtype=np.float64),
            np.concatenate([part.positions for part in parts]),
            np.concatenate([part.turns for part in parts]),
        )

    def at(self, times: ArrayLike) -> Poses:
        """Interpolate poses: positions along straight lines, turns at constant rate.

        Before the first and after the last time the sensor is at rest.

        Args:
            times: (m,) times, s.
        """
        wanted = np.clip(np.asarray(times, np.float64), self.times[0], self.times[-1])
        if len(self) == 1:
            index = np.zeros(len(wanted), int)
            return Poses(wanted, self.positions[index], self.turns[index], self.timed)
        after = np.clip(np.searchsorted(self.times, wanted, "right"), 1, len(self) - 1)
        before = after - 1
        share = (wanted - self.times[before]) / (self.times[after] - self.times[before])
        positions = self.positions[before] * (1.0 - share[:, None])
        positions += self.positions[after] * share[:, None]
        return Poses(wanted, positions, _slerp(self.turns[before], self.turns[after], share), True)

    def only(self, index: int) -> Poses:
        """Pose at an index, as Poses of length 1."""
        one = slice(index, index + 1)
        return Poses(self.times[one], self.positions[one], self.turns[one], self.timed)

    @property
    def matrices(self) -> Floats:
        """Rotation matrices from sensor axes to world axes, (n, 3, 3), for column vectors."""
        return rotation_matrices(self.turns)


def quaternions(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> Floats:
    """Unit quaternions x, y, z, w, (n, 4), of yaw, pitch and roll, (n,), degrees."""
    half = [0.5 * np.radians(np.atleast_1d(np.asarray(a, np.float64))) for a in (yaw, pitch, roll)]
    (cy, cp, cr), (sy, sp, sr) = (tuple(map(part, half)) for part in (np.cos, np.sin))
    return np.stack(
        [
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
            cy * cp * cr + sy * sp * sr,
        ],
        axis=-1,
    )


def one_pose(numbers: tuple[float, ...]) -> Poses:
    """Pose at time 0 from x, y, z, yaw, pitch and roll, in m and degrees.

    Raises:
        RequestError: a number is NaN, infinite or too large.
    """
    for name, number in zip(_COLUMNS[1:], numbers, strict=True):
        if not abs(number) <= _FAR:  # nor NaN
            raise RequestError(
                f"The pose has {number:g} for {name}.", f"Give a number up to {_FAR:g} in size."
            )
    position = np.array([numbers[:3]], np.float64)
    return Poses(np.zeros(1), position, quaternions(*numbers[3:]))


def read_poses(path: str | Path) -> Poses:
    """Read poses from a CSV with a header: time, x, y, z, yaw, pitch, roll, in s, m and degrees.

    Columns may be in any order; other columns are ignored. Without times each line is a pose of
    rest; angles and z without a column are 0. Empty lines and lines that begin with # are ignored.

    Args:
        path: file; ``-`` is standard input.

    Raises:
        ReadError: the file cannot be read, or has no poses.
        RequestError: a header lacks x or y, a cell is no number, or times do not ascend.
    """
    source = read_source(path, _MOST_BYTES, "Give a path of fewer poses.")
    name = source.name
    try:
        text = source.data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ReadError(f"{name}: is no UTF-8 text.", "Save it as UTF-8 CSV.") from error
    places: dict[str, int] = {}
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            cells = [cell.strip() for cell in next(csv.reader([line]))]
        except csv.Error as error:  # a cell longer than the csv module takes
            raise RequestError(
                f"{name}:{number}: is no line of CSV ({error}).", "Write numbers and commas."
            ) from error
        if not places:
            places = _header(name, number, [cell.lower() for cell in cells])
            continue
        rows.append(_row(f"{name}:{number}", cells, places))
        if len(rows) > MOST_POSES:
            raise RequestError(
                f"{name}: holds more than {MOST_POSES:,} poses.", "Split it into several paths."
            )
        timed = "time" in places
        if timed and len(rows) > 1 and not rows[-1][0] > rows[-2][0]:
            raise RequestError(
                f"{name}:{number}: the time {rows[-1][0]:g} does not come after {rows[-2][0]:g}.",
                "Sort the lines by time, and keep one of each.",
            )
    if not rows:
        raise ReadError(f"{name}: holds no poses.", f"Write a header {','.join(_COLUMNS)}.")
    values = np.array(rows, np.float64)
    timed = "time" in places
    times = values[:, 0] if timed else np.arange(len(values), dtype=np.float64)
    return Poses(times, values[:, 1:4], quaternions(*values[:, 4:].T), timed)


def _header(name: str, number: int, cells: list[str]) -> dict[str, int]:
    places = {cell: index for index, cell in enumerate(cells) if cell in _COLUMNS}
    lacking = [column for column in ("x", "y") if column not in places]
    if lacking:
        raise RequestError(
            f"{name}:{number}: the header has no column {' and no '.join(lacking)}.",
            f"Begin with a header such as {','.join(_COLUMNS)}.",
        )
    repeated = [cell for cell in places if cells.count(cell) > 1]
    if repeated:
        raise RequestError(
            f"{name}:{number}: the header has {join_words(repeated)} twice.", "Keep one of each."
        )
    return places


def _row(place: str, cells: list[str], places: dict[str, int]) -> list[float]:
    row = []
    for column in _COLUMNS:
        index = places.get(column)
        if index is None:
            row.append(0.0)
            continue
        cell = cells[index] if index < len(cells) else ""
        value = parse_number(cell)
        if value is None or not abs(value) <= _FAR:  # nor NaN
            raise RequestError(
                f"{place}: {column} is {quote(cell)}, which is no number up to {_FAR:g} in size.",
                "Write a number for each column of the header.",
            )
        row.append(value)
    return row


def place_on_ground(poses: Poses, terrain: Terrain, height: float, follow: bool = False) -> Poses:
    """Place poses above the ground at their x and y, whatever their z.

    Where there are storeys, it is above the top that is nearest to z, of equally near ones the
    lower.

    Args:
        poses: poses to be placed.
        terrain: terrain below the poses.
        height: height above the ground, m, along z, or along the normal with `follow`.
        follow: whether poses tilt with the ground: pitch and roll are then relative to the ground
            instead of the level plane, and yaw stays. Else turns stay as they are.

    Raises:
        RequestError: a pose has no ground, the height is out of range, or the normal leads out of
            the terrain or below its ground.
    """
    if not 0.0 <= height <= _FAR:
        raise RequestError(
            f"The height above the ground is {height:g}.", "Give 0 or more, in metres."
        )
    refuse_outside(poses, terrain.bounds)
    x, y = poses.positions[:, 0], poses.positions[:, 1]
    tops = terrain.column(x, y).top
    # of equally near ones the lower; infinitely far is where there is none
    off = np.abs(tops - poses.positions[:, 2:])
    nearest = np.where(np.isnan(off), np.inf, off).argmin(axis=1)
    samples = terrain.sample(x, y, below=tops[np.arange(len(poses)), nearest])
    void = np.flatnonzero(np.isnan(samples.height))
    if len(void):
        raise RequestError(
            f"There is no ground {_place(poses, int(void[0]))}, only void.",
            "Move the pose, or leave out --on-ground.",
        )
    up = samples.normal if follow else np.tile([0.0, 0.0, 1.0], (len(poses), 1))
    positions = np.column_stack([x, y, samples.height]) + height * up
    turns = _tilted_turns(poses, up) if follow else poses.turns
    placed = replace(poses, positions=positions, turns=turns)
    if follow or terrain.storeys is not None:  # there may be a wall beside, or a roof above
        check_poses(placed, terrain)
    return placed


def check_poses(poses: Poses, terrain: Terrain) -> None:
    """Refuse poses outside the terrain, below the ground or in a storey.

    Raises:
        RequestError: a pose is.
    """
    refuse_outside(poses, terrain.bounds)
    x, y, z = poses.positions.T
    columns, z = terrain.column(x, y), z[:, None]
    slack = _BELOW * np.maximum(np.abs(z), np.abs(columns.top))
    inside = (z < columns.top - slack) & (z > columns.bottom + slack)
    for index, place in np.argwhere(inside).tolist():
        where, top = _place(poses, index), float(columns.top[index, place])
        bottom = float(columns.bottom[index, place])
        if math.isfinite(bottom):
            raise RequestError(
                f"The sensor is in what is solid from {bottom:.6g} to {top:.6g} m {where}.",
                f"Give a z below {bottom:.6g} or above {top:.6g}.",
            )
        raise RequestError(
            f"The sensor is {top - float(z[index, 0]):.3g} m below the ground {where}.",
            f"Give a z above {top:.6g}, or add --on-ground HEIGHT.",
        )


def refuse_outside(poses: Poses, extent: Bounds) -> None:
    """Refuse poses outside the extent of a terrain: west, south, east, north.

    Raises:
        RequestError: a pose is.
    """
    west, south, east, north = extent
    x, y = poses.positions[:, 0], poses.positions[:, 1]
    outside = np.flatnonzero(~((west <= x) & (x <= east) & (south <= y) & (y <= north)))
    if len(outside):
        raise RequestError(
            f"The sensor is outside of the terrain {_place(poses, int(outside[0]))}.",
            f"The terrain reaches from {west:.12g} to {east:.12g} in x and from {south:.12g} to "
            f"{north:.12g} in y.",
        )


def _place(poses: Poses, index: int) -> str:
    x, y, _ = poses.positions[index]
    when = f" at {poses.times[index]:.6g} s" if poses.timed else ""
    return f"at x {x:.12g}, y {y:.12g}{when}"


def _slerp(first: Floats, last: Floats, share: Floats) -> Floats:
    """Interpolate quaternions (n, 4) the shorter way at constant rate; Shoemake, SIGGRAPH 1985."""
    cosine = (first * last).sum(axis=-1)
    last = np.where(cosine[:, None] < 0.0, -last, last)
    angle = np.arccos(np.minimum(np.abs(cosine), 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6  # linear interpolation is as good, without division by 0
    safe = np.where(near, 1.0, sine)
    one = np.where(near, 1.0 - share, np.sin((1.0 - share) * angle) / safe)
    other = np.where(near, share, np.sin(share * angle) / safe)
    between = one[:, None] * first + other[:, None] * last
    unit: Floats = between / np.linalg.norm(between, axis=-1, keepdims=True)
    return unit


def _product(first: Floats, last: Floats) -> Floats:
    """Quaternion products (n, 4): the turn by `last`, then by `first`."""
    x, y, z, w = first.T
    a, b, c, d = last.T
    return np.stack(
        [
            w * a + x * d + y * c - z * b,
            w * b - x * c + y * d + z * a,
            w * c + x * b - y * a + z * d,
            w * d - x * a - y * b - z * c,
        ],
        axis=-1,
    )


def _tilted_turns(poses: Poses, normals: Floats) -> Floats:
    """Turns (n, 4) of poses tilted with the ground, whose normals (n, 3) point up.

    With yaw ψ, and pitch p and roll r of the ground along that heading, R becomes
    Rz(ψ) · Ry(p) · Rx(r) · Rz(−ψ) · R: the third column of Ry(p) · Rx(r) is
    (sin p cos r, −sin r, cos p cos r), the normal in axes of that yaw.
    """
    matrices = poses.matrices
    ahead, left = matrices[:, :2, 0], matrices[:, :2, 1]
    # a sensor that looks straight up or down has the heading of its left side
    upright = np.hypot(*ahead.T) < 1e-9
    yaw = np.where(
        upright, np.arctan2(-left[:, 0], left[:, 1]), np.arctan2(ahead[:, 1], ahead[:, 0])
    )
    along = np.cos(yaw) * normals[:, 0] + np.sin(yaw) * normals[:, 1]
    aside = np.cos(yaw) * normals[:, 1] - np.sin(yaw) * normals[:, 0]
    pitch, roll = (
        np.arctan2(along, normals[:, 2]),
        np.arctan2(-aside, np.hypot(along, normals[:, 2])),
    )
    heading, none = np.degrees(yaw), np.zeros(len(poses))
    ground = quaternions(heading, np.degrees(pitch), np.degrees(roll))
    return _product(ground, _product(quaternions(-heading, none, none), poses.turns))
