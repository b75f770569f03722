"""A compiled field for PyTorch: heights, normals, surfaces and friction under many robots."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from numpy.typing import ArrayLike

from terratool.errors import RequestError
from terratool.field.friction import frictions_of
from terratool.field.host_field import HostField
from terratool.field.warp_field import WarpField, check_origin, require_package

if TYPE_CHECKING:
    import torch

    from terratool.field.types import TerrainField


class TorchSample(NamedTuple):
    """Ground at points; tensors in the points' shape, on their device.

    Attributes:
        height: (…) float32, above the origin's height; NaN outside and in the void.
        normal: (…, 3) float32, upward unit normals, on an edge of its east and north side; NaN
            outside and in the void.
        surface: (…) int32, index into `surfaces`; -1 for none.
        friction: (…) float32, coefficient of friction, tan φ; NaN without ground.
    """

    height: torch.Tensor
    normal: torch.Tensor
    surface: torch.Tensor
    friction: torch.Tensor


class TorchField:
    """A terrain on a device, for tensors of PyTorch.

    On a CPU it uses the terrain's own kernels, which are faster there than Warp's and give the same
    results. Heights have gradients where points have them: their derivative by x and y is the slope
    of the ground, that of its east and north side on an edge. It is 0 outside, in the void, where
    the slope is infinite, and by z. A wall between two points has no part in it.

    Attributes:
        surfaces: names of the surfaces, in the order of their indices.
        origin: world position of the zero of points and heights.
        device: PyTorch device.
        asks_terrain: whether the terrain's own kernels are used rather than Warp's.
    """

    device: torch.device

    def __init__(
        self,
        terrain: TerrainField,
        device: str | torch.device = "cpu",
        *,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        default_friction: float = math.nan,
    ) -> None:
        """Bring a terrain to a device; see `Terrain.to_torch`."""
        torch = require_package("torch", "PyTorch", "torch")
        try:
            self.device = torch.empty(0, device=device).device  # with the device's number
        except (RuntimeError, AssertionError, NotImplementedError) as error:
            raise RequestError(
                f"PyTorch has no device {str(device)!r} here.",
                'Take "cpu"; "cuda" needs a GPU, and a build of PyTorch for it.',
            ) from error
        self.surfaces, self.origin = terrain.surfaces, check_origin(origin)
        self._default_friction = default_friction
        self._host = HostField(terrain, self.origin, frictions_of(terrain, default_friction))
        self.asks_terrain = self.device.type == "cpu"
        if not self.asks_terrain:
            _ = self.warp

    @cached_property
    def warp(self) -> WarpField:
        """The terrain on the device for arrays of Warp, and for your own kernels.

        Raises:
            RequestError: Warp is not installed, or the terrain is too large for a device.
        """
        return WarpField(
            self._host.terrain,
            str(self.device),
            origin=self.origin,
            default_friction=self._default_friction,
        )

    def height(self, points: torch.Tensor, *, below: bool = False) -> torch.Tensor:
        """Heights at points, (…) float32 above the origin's; NaN outside and in the void.

        They are those of the highest tops, and have gradients where points have them.

        Args:
            points: (…, 2) float32 or float64 on the device, x and y from the origin; with `below`
                (…, 3), x, y and z.
            below: whether the highest top not above each point is wanted; NaN where there is none.

        Raises:
            RequestError: the points have another shape, type or device.
        """
        self._check_points(points, below)
        if not points.requires_grad:
            return self._heights(points)
        from terratool.field.torch_gradient import GroundHeight

        return GroundHeight.apply(points, self._heights, self._slopes)

    def sample(self, points: torch.Tensor, *, below: bool = False) -> TorchSample:
        """Height, normal, surface and friction at points; only heights have gradients.

        Args:
            points: (…, 2) float32 or float64 on the device, x and y from the origin; with `below`
                (…, 3), x, y and z.
            below: whether the highest top not above each point is wanted.

        Raises:
            RequestError: the points have another shape, type or device.
        """
        self._check_points(points, below)
        found = self._samples(points.detach())
        if not points.requires_grad:
            return found
        from terratool.field.torch_gradient import GroundHeight

        return found._replace(
            height=GroundHeight.apply(points, lambda _: found.height, self._slopes)
        )

    def _heights(self, points: torch.Tensor) -> torch.Tensor:
        import torch

        points = points.detach()
        if self.asks_terrain:
            return torch.from_numpy(self._host.height(points.numpy()))
        height = torch.empty(points.shape[:-1], dtype=torch.float32, device=self.device)
        self._launch(points, height)
        return height

    def _samples(self, points: torch.Tensor) -> TorchSample:
        import torch

        if self.asks_terrain:
            return TorchSample(*map(torch.from_numpy, self._host.sample(points.numpy())))
        shape, device = points.shape[:-1], self.device
        out = TorchSample(
            torch.empty(shape, dtype=torch.float32, device=device),
            torch.empty((*shape, 3), dtype=torch.float32, device=device),
            torch.empty(shape, dtype=torch.int32, device=device),
            torch.empty(shape, dtype=torch.float32, device=device),
        )
        self._launch(points, *out)
        return out

    def _slopes(self, points: torch.Tensor) -> torch.Tensor:
        """Slopes of the ground at points, (…, 2); NaN without ground."""
        import torch

        if self.asks_terrain:
            return torch.from_numpy(self._host.slopes(points.numpy()))
        normal = self._samples(points).normal
        return -normal[..., :2] / normal[..., 2:]

    def _check_points(self, points: torch.Tensor, below: bool) -> None:
        import torch

        size, names = (3, "x, y and z") if below else (2, "x and y")
        if points.dtype not in (torch.float32, torch.float64) or points.shape[-1:] != (size,):
            raise RequestError(
                f"The points are {tuple(points.shape)} of {points.dtype}.",
                f"Give (…, {size}) float32 or float64, {names}{', with `below`' * below}.",
            )
        if points.device != self.device:
            raise RequestError(
                f"The points are on {points.device}, the terrain is on {self.device}.",
                "Bring the one to the other.",
            )

    def _launch(self, points: torch.Tensor, *out: torch.Tensor) -> None:
        """Launch the kernel of Warp to fill tensors, on PyTorch's current stream of the device."""
        import torch
        import warp as wp

        field = self.warp
        if not points.numel():
            return
        double = points.dtype == torch.float64
        kinds = {2: wp.vec2d if double else wp.vec2f, 3: wp.vec3d if double else wp.vec3f}
        size = points.shape[-1]
        arrays = [wp.from_torch(points.reshape(-1, size).contiguous(), dtype=kinds[size])]
        for tensor, width in zip(out, (1, 3, 1, 1), strict=False):
            flat = tensor.view(-1) if width == 1 else tensor.view(-1, width)
            arrays.append(wp.from_torch(flat, dtype=wp.vec3f if width == 3 else None))
        stream = None
        if self.device.type == "cuda":
            stream = wp.stream_from_torch(torch.cuda.current_stream(self.device))
        field.launch(*arrays, stream=stream)
