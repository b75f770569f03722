"""Poses: turns against another library, paths between their lines, and ground under them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from terratool.errors import RequestError, TerratoolError
from terratool.sensing.poses import Poses, one_pose, place_on_ground, quaternions, read_poses
from tests.conftest import terrain_of

RANDOM = np.random.default_rng(3)
RAMP = terrain_of(
    {
        "size": [20, 10],
        "elemTypes": {"ramp": {"x": [0, 1]}},
        "elemTree": {"type": "ramp", "vScale": 10},
    }
)
"""It rises by 1 in 2 to the east."""
ASLANT = terrain_of(
    {
        "size": [20, 10],
        "elemTypes": {"ramp": {"combine": "sum", "x": [0, 1], "y": [0.4, 0]}},
        "elemTree": {"type": "ramp", "vScale": 10},
    }
)
"""It rises by 1 in 2 to the east, and falls by 2 in 5 to the north."""


def test_turns_are_those_of_scipy() -> None:
    """Roll, pitch and yaw about fixed axes x, y and z: SciPy's "xyz"."""
    yaw, pitch, roll = RANDOM.uniform(-200, 200, (3, 50))
    got = Poses(np.arange(50.0), np.zeros((50, 3)), quaternions(yaw, pitch, roll))
    expected = Rotation.from_euler("xyz", np.stack([roll, pitch, yaw], -1), degrees=True)
    np.testing.assert_allclose(got.matrices, expected.as_matrix(), atol=1e-12)
    alike = (got.turns * expected.as_quat()).sum(axis=-1)
    np.testing.assert_allclose(np.abs(alike), 1, atol=1e-12)


def test_turns_between_are_those_of_scipy() -> None:
    """At an even rate, the shorter way; positions along lines; at rest before and after."""
    turns = quaternions(*RANDOM.uniform(-180, 180, (3, 6)))
    times = np.array([0.0, 0.5, 0.6, 3.0, 4.0, 9.0])
    poses = Poses(times, RANDOM.uniform(-9, 9, (6, 3)), turns, True)
    at = np.concatenate([RANDOM.uniform(0, 9, 40), times])
    got = poses.at(at)
    expected = Slerp(times, Rotation.from_quat(turns))(at).as_matrix()
    np.testing.assert_allclose(got.matrices, expected, atol=1e-9)
    for axis in range(3):
        line = np.interp(at, times, poses.positions[:, axis])
        np.testing.assert_allclose(got.positions[:, axis], line, atol=1e-12)
    ends = poses.at([-1.0, 10.0])
    np.testing.assert_array_equal(ends.positions, poses.positions[[0, -1]])
    np.testing.assert_allclose(ends.matrices, poses.matrices[[0, -1]], atol=1e-12)


def test_on_the_ground_it_stands_upright_or_with_the_slope() -> None:
    """Upright it is above the place, else off it along the normal; the heading is kept."""
    pose = one_pose((4, 3, -99, 0, 0, 0))
    upright = place_on_ground(pose, RAMP, 0.5)
    np.testing.assert_allclose(upright.positions, [[4, 3, 2.5]])
    np.testing.assert_array_equal(upright.turns, pose.turns)
    tilted = place_on_ground(pose, RAMP, 0.5, follow=True)
    normal = np.array([-1, 0, 2]) / np.sqrt(5)
    np.testing.assert_allclose(tilted.positions, [np.array([4, 3, 2]) + 0.5 * normal], atol=1e-12)
    ahead, left, up = tilted.matrices[0].T
    np.testing.assert_allclose(up, normal, atol=1e-12)
    np.testing.assert_allclose(ahead, np.array([2, 0, 1]) / np.sqrt(5), atol=1e-12)
    np.testing.assert_allclose(left, [0, 1, 0], atol=1e-12)
    # across the slope it leans to its right, uphill being left of it when it looks south
    south = place_on_ground(one_pose((4, 3, 0, -90, 0, 0)), RAMP, 0.0, follow=True)
    np.testing.assert_allclose(south.matrices[0][:, 0], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(south.matrices[0][:, 2], normal, atol=1e-12)


def test_with_the_slope_headings_are_kept() -> None:
    """Ahead stays in the upright plane of the yaw, and pitch and roll count from the ground."""
    normal = np.array([-0.5, 0.4, 1.0]) / np.linalg.norm([-0.5, 0.4, 1.0])
    yaws = np.arange(-180.0, 180.0, 15.0)
    angles = [(yaw, 0.0, 0.0) for yaw in yaws]
    angles += [tuple(row) for row in RANDOM.uniform(-170, 170, (40, 3)).tolist()]
    angles += [(30.0, 90.0, 0.0), (-75.0, -90.0, 0.0)]
    poses = Poses.join([one_pose((4, 3, 0, *each)) for each in angles])
    got = place_on_ground(poses, ASLANT, 0.2, follow=True).matrices
    for (yaw, pitch, roll), matrix in zip(angles, got, strict=True):
        level = np.array([np.cos(np.radians(yaw)), np.sin(np.radians(yaw)), 0.0])
        ahead = level - [0.0, 0.0, (level @ normal) / normal[2]]
        ahead /= np.linalg.norm(ahead)
        ground = np.column_stack([ahead, np.cross(normal, ahead), normal])
        own = Rotation.from_euler("xyz", [roll, pitch, 0], degrees=True).as_matrix()
        np.testing.assert_allclose(matrix, ground @ own, atol=1e-9)
    headings = np.degrees(np.arctan2(got[: len(yaws), 1, 0], got[: len(yaws), 0, 0]))
    off = (headings - yaws + 180.0) % 360.0 - 180.0
    np.testing.assert_allclose(off, 0.0, atol=1e-9)


def test_the_normal_leads_into_no_wall_and_not_over_the_rim() -> None:
    """High over a slope it stands beside its place, where there may be a block, or nothing."""
    blocked = terrain_of(
        {
            "size": [20, 10],
            "elemTypes": {"ramp": {"x": [0, 1]}, "flat": {"x": [1]}},
            "elemTree": {
                "type": "ramp",
                "vScale": 10,
                "children": [
                    {"at": [7, 5], "extent": [2, 10], "type": "flat", "vScale": 15},
                ],
            },
        }
    )
    pose = one_pose((9, 4, 0, 0, 0, 0))
    place_on_ground(pose, blocked, 3.0)
    with pytest.raises(RequestError, match=r"below the ground at x 7\.65"):
        place_on_ground(pose, blocked, 3.0, follow=True)
    with pytest.raises(RequestError, match=r"outside of the terrain at x -0\.34"):
        place_on_ground(one_pose((1, 4, 0, 0, 0, 0)), blocked, 3.0, follow=True)


def test_a_path_is_read_by_its_header(tmp_path: Path) -> None:
    """Columns in any order, others passed over, comments and empty lines too."""
    path = tmp_path / "p.csv"
    path.write_text("# made by hand\nYaw, X ,y,note,z,time\n\n90,1,2,a,3,0\n-90,4,5,b,6,1.5\n")
    poses = read_poses(path)
    assert poses.timed
    np.testing.assert_array_equal(poses.times, [0, 1.5])
    np.testing.assert_array_equal(poses.positions, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_allclose(poses.turns, quaternions([90, -90], [0, 0], [0, 0]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y,z,time\n1,2,3,1\n1,2,3,1\n", ":3: the time 1 does not come after 1."),
        ("x,y,z,time\n1,2,3,2\n1,2,3,1\n", ":3: the time 1 does not come after 2."),
        ("x,y\n1,nan\n", ":2: y is"),
        ("x,y\n1\n", ":2: y is"),
        ("x,y\n1,inf\n", ":2: y is"),
        ("x,y\n1,1e300\n", ":2: y is"),
        ("x,z\n1,2\n", ":1: the header has no column y."),
        ("1,2,3\n", "no column x and no y"),
        ("x,y,x\n1,2,3\n", "x twice"),
        ("x,y\n", "holds no poses"),
        ("", "holds no poses"),
        (f"x,y\n{'1' * 131_073},2\n", ":2: is no line of CSV (field larger than field limit"),
        (f"x,y,{'n' * 131_073}\n1,2,3\n", ":1: is no line of CSV"),
    ],
)
def test_a_path_that_is_none_is_told_in_a_sentence(text: str, words: str, tmp_path: Path) -> None:
    """With the line."""
    path = tmp_path / "p.csv"
    path.write_text(text)
    with pytest.raises(TerratoolError) as caught:
        read_poses(path)
    assert words in caught.value.message
    assert caught.value.hint


def test_no_ground_under_it_is_told() -> None:
    """In the void, or outside."""
    with pytest.raises(RequestError, match=r"at x 21, y 3\. The terrain reaches from "):
        place_on_ground(one_pose((21, 3, 0, 0, 0, 0)), RAMP, 1.0)
    for number in (np.nan, np.inf, 1e300):
        with pytest.raises(RequestError, match="for pitch"):
            one_pose((1, 2, 3, 0, number, 0))
