"""What fields for PyTorch promise; tests/field/test_warp_field.py has the kernel that GPUs run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terratool.errors import RequestError
from terratool.field import warp_field
from tests.conftest import terrain_of
from tests.storey_examples import DEFINITIONS

torch = pytest.importorskip("torch", reason="torch is not installed")

OBLONG: dict[str, Any] = {
    "size": [40, 10],
    "origin": [300, -20],
    "surfTypes": {"sand": {"fricAngle": 28}, "ice": {}, "hole": {"void": True, "fricAngle": 30}},
    "elemTypes": {"ramp": {"x": [0, 1]}, "kerb": {"x": [[0, 0], [0.3, 0], [0.3, 1], [1, 1]]}},
    "elemTree": {
        "type": "ramp",
        "surface": "sand",
        "vScale": 4,
        "cells": [8, 5],
        "children": [
            {"cellX": 3, "cellY": 1, "type": "kerb", "vScale": 0.5, "surface": "ice"},
            {"cellX": 6, "cellY": 3, "type": "ramp", "vScale": 1, "turnDeg": 20},
            {"cellX": 7, "cellY": 4, "type": "ramp", "surface": "hole"},
        ],
    },
}
ORIGIN = (310, -15, 2)


def scan(dtype: Any) -> torch.Tensor:
    """Points of 300 robots, each in a grid of 4 × 5, some outside: (300, 4, 5, 2), on ORIGIN."""
    rng = np.random.default_rng(2)
    offsets = np.stack(np.meshgrid(np.arange(4) * 0.1, np.arange(5) * 0.1, indexing="ij"), -1)
    robots = rng.uniform((-11, -6), (31, 6), (300, 2))
    return torch.from_numpy(robots[:, None, None] + offsets).to(dtype)


def as_on_a_gpu(field: Any) -> Any:
    """The field, from now on asked by the kernel of Warp."""
    pytest.importorskip("warp", reason="warp-lang is not installed")
    field.asks_terrain = field.warp.asks_terrain = False
    return field


@pytest.fixture(params=["the terrain's own kernels", "the kernel of Warp"])
def field(request: pytest.FixtureRequest) -> Any:
    """A field on the CPU; and as it asks on a GPU, tried on the CPU."""
    found = terrain_of(OBLONG).to_torch(origin=ORIGIN)
    return as_on_a_gpu(found) if "Warp" in request.param else found


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_it_gives_what_the_terrain_gives(field: Any, dtype: Any) -> None:
    """At points from the origin, in any shape, in float32."""
    points = scan(dtype)
    x, y = np.moveaxis(points.double().numpy() + ORIGIN[:2], -1, 0)
    wanted, found = terrain_of(OBLONG).sample(x, y), field.sample(points)
    heights = (wanted.height - ORIGIN[2]).astype(np.float32)
    assert np.array_equal(found.height.numpy(), heights, equal_nan=True)
    assert np.array_equal(field.height(points).numpy(), heights, equal_nan=True)
    assert np.array_equal(found.surface.numpy(), wanted.surface)
    normal = found.normal.numpy()
    assert np.allclose(normal, wanted.normal, rtol=0, atol=2.0**-24, equal_nan=True)
    assert [each.dtype for each in found] == [torch.float32] * 2 + [torch.int32, torch.float32]
    tans = {"sand": math.tan(math.radians(28)), "ice": math.nan, "hole": math.nan}
    names = [None if n < 0 else field.surfaces[n] for n in found.surface.ravel()]
    assert {*names} == {"sand", "ice", "hole", None}
    friction = [tans.get(str(name), math.nan) for name in names]
    assert np.allclose(found.friction.ravel(), friction, rtol=1e-7, atol=0, equal_nan=True)


def test_points_of_any_stride(field: Any) -> None:
    """A part of a tensor, with gradients, is as good as a copy of it."""
    points = scan(torch.float32)
    wanted = field.height(points[::2, 1, 1:].clone())
    wide = torch.cat([points, points], -1).requires_grad_()
    found = field.height(wide[::2, 1, 1:, :2])
    assert torch.equal(found.nan_to_num(99), wanted.nan_to_num(99))
    assert found.requires_grad and not wanted.requires_grad


def test_no_points(field: Any) -> None:
    assert field.sample(torch.empty(0, 7, 2)).normal.shape == (0, 7, 3)
    assert field.height(torch.zeros(2)).shape == ()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
@pytest.mark.parametrize("name", ["bridge", "tunnel", "rack", "car park"])
@pytest.mark.parametrize(
    "kernel", ["the terrain's own", pytest.param("that of Warp", marks=pytest.mark.slow)]
)
def test_decks_and_bores(kernel: str, name: str, dtype: Any) -> None:
    """The highest tops, and those not above points in space, which count from the origin, too."""
    terrain, origin = terrain_of(DEFINITIONS[name]), (8, 3, 0.5)
    field = terrain.to_torch(origin=origin)
    if "Warp" in kernel:
        as_on_a_gpu(field)
    spots = torch.from_numpy(np.random.default_rng(3).uniform((-9, -4, -1), (53, 18, 9), (900, 3)))
    spots = spots.to(dtype).reshape(30, 30, 3)
    x, y, z = np.moveaxis(spots.double().numpy() + origin, -1, 0)
    seen = set()
    for points, at in ((spots[..., :2], (x, y)), (spots, (x, y, z))):
        below = len(at) == 3
        wanted, found = terrain.sample(*at), field.sample(points, below=below)
        heights = (wanted.height - origin[2]).astype(np.float32)
        assert np.array_equal(found.height.numpy(), heights, equal_nan=True)
        assert np.array_equal(field.height(points, below=below).numpy(), heights, equal_nan=True)
        assert np.array_equal(found.surface.numpy(), wanted.surface)
        normal = found.normal.numpy()
        assert np.allclose(normal, wanted.normal, rtol=0, atol=2.0**-24, equal_nan=True)
        seen.add(float(np.nansum(heights)))
    assert len(seen) == 2  # what is over a point is not what it sees below it


def test_a_scan_under_a_roof(field_of_car_park: Any) -> None:
    """Of a robot 0.3 m high below the ramp, on it, below the upper floor and on it, by hand."""
    spots = torch.tensor([(5, 10, 0.3), (5, 10, 1.8), (27, 5, 0.3), (27, 5, 3.3), (27, 5, -0.1)])
    found = field_of_car_park.height(spots, below=True)
    assert found.tolist()[:-1] == [0, 1.5, 0, 3] and math.isnan(found[-1])
    assert field_of_car_park.height(spots[:, :2]).tolist() == [1.5, 1.5, 5.5, 5.5, 5.5]


@pytest.fixture
def field_of_car_park() -> Any:
    return terrain_of(DEFINITIONS["car park"]).to_torch()


def test_points_in_space_over_plain_ground(field: Any) -> None:
    """What is above a point is not below it; heights were rounded, to a millionth or less."""
    points = scan(torch.float64)
    heights = field.height(points).double()
    on = torch.cat([points, heights.nan_to_num(0)[..., None]], -1)
    on[::2, ..., 2] -= 1e-6
    on[1::2, ..., 2] += 1e-6
    found = field.height(on, below=True).double()
    assert torch.equal(found[1::2].nan_to_num(99), heights[1::2].nan_to_num(99))
    assert found[::2].isnan().all()
    assert (field.sample(on[::2], below=True).surface == -1).all()


def test_flat_points_below_nothing_are_refused(field: Any) -> None:
    with pytest.raises(RequestError, match=r"Give \(…, 3\) float32 or float64, x, y and z, with"):
        field.sample(torch.zeros(4, 2), below=True)


@pytest.mark.parametrize(
    "points", [torch.zeros(4, 3), torch.zeros(4, 2, dtype=torch.int64), torch.zeros(())], ids=str
)
def test_other_points_are_refused(field: Any, points: torch.Tensor) -> None:
    with pytest.raises(RequestError, match=r"Give \(…, 2\) float32 or float64"):
        field.height(points)


def test_points_elsewhere_are_refused(field: Any) -> None:
    with pytest.raises(RequestError, match="The points are on meta, the terrain is on cpu"):
        field.height(torch.zeros(4, 2, device="meta"))


@pytest.mark.parametrize("device", ["cuda:77", "nonsense"])
def test_a_device_that_is_not_there(device: str) -> None:
    with pytest.raises(RequestError, match=f"PyTorch has no device '{device}' here"):
        terrain_of(OBLONG).to_torch(device)


def test_a_device_that_warp_has_not() -> None:
    pytest.importorskip("warp", reason="warp-lang is not installed")
    with pytest.raises(RequestError, match="Warp has no device 'meta' here"):
        terrain_of(OBLONG).to_torch("meta")


def test_without_the_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a CPU it does without Warp, but for kernels of one's own."""
    find = warp_field.find_spec
    monkeypatch.setattr(
        warp_field, "find_spec", lambda name: None if name == "warp" else find(name)
    )
    field = terrain_of(OBLONG).to_torch()
    assert field.height(torch.tensor([302.5, -15.0])) == 0.25
    with pytest.raises(RequestError, match=r"NVIDIA Warp is not installed.*terratool\[warp\]"):
        _ = field.warp
    monkeypatch.setattr(warp_field, "find_spec", lambda name: None)
    with pytest.raises(RequestError, match=r"PyTorch is not installed.*terratool\[torch\]"):
        terrain_of(OBLONG).to_torch()


# --- gradients ------------------------------------------------------------------------------------

CURVED: dict[str, Any] = {
    "size": [30, 12],
    "origin": [300, -20],
    "surfTypes": {"rough": {"roughness": {"rms": 0.05, "correlation": 2}}, "hole": {"void": True}},
    "elemTypes": {
        "wave": {"x": "cos(3*pi*t)", "y": [[0, 1], [1, 3]], "combine": "product"},
        "knoll": {"x": "cosbell", "combine": "radial"},
        "box": {"x": [1]},
    },
    "elemTree": {
        "type": "wave",
        "vScale": 2,
        "surface": "rough",
        "cells": [10, 4],
        "children": [
            {"cellX": 1, "cellY": 0, "span": [4, 3], "type": "knoll", "vScale": 1.5},
            {"cellX": 6, "cellY": 1, "type": "box", "surface": "hole"},
            {
                "at": [22, 6],
                "extent": [8, 6],
                "type": "box",
                "vScale": 5,
                "turnDeg": 20,
                "deck": {"thickness": 0.5, "datum": True},
            },
        ],
    },
}


def finite_differences(height: Any, points: Any, step: float = 1e-6) -> tuple[Any, Any]:
    """Central differences of heights along each axis, and where those of both sides agree.

    Where they do not, an edge or a bend is within the step.
    """
    here, differences, smooth = height(*points.T), [], np.ones(len(points), bool)
    for axis in range(points.shape[1]):
        move = step * np.eye(points.shape[1])[axis]
        ahead, behind = height(*(points + move).T), height(*(points - move).T)
        differences.append((ahead - behind) / (2 * step))
        smooth &= np.abs((ahead - here) - (here - behind)) < 1e-3 * step
    return np.stack(differences, -1), smooth


@pytest.mark.parametrize("below", [False, True])
@pytest.mark.parametrize(
    "kernel", ["the terrain's own", pytest.param("that of Warp", marks=pytest.mark.slow)]
)
def test_gradients_are_differences_of_heights(kernel: str, below: bool) -> None:
    """On curved, rough and turned ground, on a deck and below it, away from edges."""
    terrain = terrain_of(CURVED)
    field = terrain.to_torch(origin=(300, -20, 1))
    if "Warp" in kernel:
        as_on_a_gpu(field)
    rng = np.random.default_rng(6)
    points = rng.uniform((0, 0, -3), (30, 12, 9), (600, 3))[:, : 2 + below]
    wanted, smooth = finite_differences(
        lambda x, y, *z: terrain.height(300 + x, y - 20, *(each + 1 for each in z)), points
    )
    assert smooth.sum() > 300
    given = torch.from_numpy(points).requires_grad_()
    heights = field.height(given, below=below)
    assert heights.dtype == torch.float32
    pulls = torch.from_numpy(rng.uniform(-2, 2, len(points))).float()
    (heights.nan_to_num() * pulls).sum().backward()
    found = given.grad.numpy() / pulls.double().numpy()[:, None]
    assert np.abs(wanted[smooth]).max() > 0.5  # steep enough to be told from nothing
    assert np.allclose(found[smooth], wanted[smooth], rtol=1e-5, atol=1e-5)
    if below:
        assert (given.grad[:, 2] == 0).all()
    again = torch.from_numpy(points).requires_grad_()
    (field.sample(again, below=below).height.nan_to_num() * pulls).sum().backward()
    assert torch.equal(given.grad, again.grad)


def test_no_gradient_comes_from_where_no_ground_is(field: Any) -> None:
    """In the void and outside it is 0, so that leaving these heights out is enough."""
    points = torch.tensor([(28.0, 4.5), (-99.0, 0), (5.0, 3.0)], requires_grad=True)
    heights = field.height(points)
    assert heights.isnan().tolist() == [True, True, False]
    heights.sum().backward()  # NaN, of which each height has a share of 1
    assert points.grad is not None
    assert points.grad[:2].tolist() == [[0, 0], [0, 0]]
    assert points.grad[2].tolist() == pytest.approx([0.1, 0])


def test_a_point_below_all_ground_has_no_gradient(field: Any) -> None:
    points = torch.tensor([(5.0, 3.0, -50.0), (5.0, 3.0, 50.0)], requires_grad=True)
    field.height(points, below=True).nansum().backward()
    assert points.grad is not None
    assert points.grad.tolist() == [[0, 0, 0], pytest.approx([0.1, 0, 0])]


def test_a_point_rolls_downhill(field: Any) -> None:
    """A step of an optimiser against the gradient, in float32, through a function of points."""
    robot = torch.tensor([6.0, 3.5], requires_grad=True)
    feet = robot + torch.tensor([[0.1, 0.2], [-0.3, 0.1]])
    before = field.height(feet).mean()
    before.backward()
    assert robot.grad is not None and robot.grad.dtype == torch.float32
    with torch.no_grad():
        robot -= 2 * robot.grad
        after = field.height(robot + torch.tensor([[0.1, 0.2], [-0.3, 0.1]])).mean()
    assert (before - after).item() == pytest.approx(2 * 0.1**2, rel=1e-4)
    assert not after.requires_grad


def test_points_that_changed_meanwhile_are_refused(field: Any) -> None:
    """Autograd itself says so: their gradient would be that of other points."""
    points = torch.zeros(3, 2, requires_grad=True) * 1
    heights = field.height(points)
    points += 1
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        heights.sum().backward()


def test_what_is_no_height_has_no_gradient(field: Any) -> None:
    found = field.sample(torch.zeros(3, 2, requires_grad=True))
    assert [each.requires_grad for each in found] == [True, False, False, False]
