"""The derivative of heights by the points at which they are asked, for autograd of PyTorch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch.autograd.function import once_differentiable

Ask = Callable[[torch.Tensor], torch.Tensor]


class GroundHeight(torch.autograd.Function):  # type: ignore[misc]  # of no known type
    """Heights at points, whose derivatives by x and y are the slopes of the ground.

    Where the ground has no finite slope, outside, in the void and on a vertical tangent, the
    derivative is 0, and so it is by z. Derivatives are not differentiated themselves.
    """

    @staticmethod
    def forward(ctx: Any, points: torch.Tensor, heights: Ask, slopes: Ask) -> torch.Tensor:
        """Heights at points, (…), by a function of points; `slopes` gives (…, 2) when needed."""
        ctx.save_for_backward(points)  # so that points changed in place meanwhile are refused
        ctx.slopes = slopes
        return heights(points)

    @staticmethod
    @once_differentiable  # type: ignore[untyped-decorator]  # likewise
    def backward(ctx: Any, gradient: torch.Tensor) -> tuple[torch.Tensor, None, None]:
        """Gradient by the points, in their shape and type, of that by the heights."""
        (points,) = ctx.saved_tensors
        slopes = ctx.slopes(points).nan_to_num(0.0, 0.0, 0.0)
        by_points = torch.zeros_like(points)
        by_points[..., :2] = gradient[..., None] * slopes
        return by_points, None, None
