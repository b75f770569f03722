"""The protocol by which other modules query a terrain, and the samples at its points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from numbers import Real
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.errors import RequestError

if TYPE_CHECKING:
    from terratool.definition.findings import Bounds
    from terratool.definition.model import Surface
    from terratool.field.records import FieldArrays
    from terratool.field.storeys import Storeys
    from terratool.kernels import field as kernels

OUTSIDE = -2
"""Element index of a point outside of the terrain."""


@dataclass(frozen=True, slots=True)
class PointSamples:
    """Ground at points, each array in the shape of the points.

    Attributes:
        height: float64, world units; NaN outside the terrain and in the void.
        element: int64, index of the element that decides the surface, or number of elements plus
            the index of the track that does; -1 where no footprint lies, OUTSIDE outside.
        surface: int32, index into `Terrain.surfaces`; -1 for none.
        normal: (…, 3) float64, upward unit normal; NaN where the height is NaN.
    """

    height: NDArray[np.float64]
    element: NDArray[np.int64]
    surface: NDArray[np.int32]
    normal: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PointColumns:
    """All that is solid at points, as intervals of heights from below, (…, n) each.

    A point has the intervals that it has; what is left of its row is NaN, or -1. Intervals are
    closed, and have no point in common.

    Attributes:
        bottom: float64, world units; -inf where the ground is solid all the way down.
        top: float64, world units.
        clear: float64, height from the top to the next bottom; inf above the highest top.
        surface: int32, index into `Terrain.surfaces` of the top's surface; -1 for none.
        element: int64, number of the element that decides the top, for `Terrain.pointer`; -1 where
            no footprint lies.
        under: int64, number of the element that decides the bottom; -1 where that is -inf.
        normal: (…, n, 3) float64, upward unit normal of the top.
    """

    bottom: NDArray[np.float64]
    top: NDArray[np.float64]
    clear: NDArray[np.float64]
    surface: NDArray[np.int32]
    element: NDArray[np.int64]
    under: NDArray[np.int64]
    normal: NDArray[np.float64]


class TerrainField(Protocol):
    """A compiled terrain, as rays, cell addresses and devices query it; `Terrain` implements it."""

    @property
    def arrays(self) -> FieldArrays:
        """Flat arrays of the field."""
        ...

    @property
    def field(self) -> kernels.Field:
        """Flat arrays of the field, checked and kept by the kernels."""
        ...

    @property
    def ray_index(self) -> kernels.RayIndex:
        """Index for rays, of the terrain with its parts written out."""
        ...

    @property
    def storeys(self) -> Storeys | None:
        """Decks and bores; None where there are none."""
        ...

    @property
    def storey_ray_index(self) -> kernels.StoreyRayIndex:
        """Index for rays, of a terrain that has storeys."""
        ...

    @property
    def written_out(self) -> TerrainField:
        """The terrain with all parts and copies written out.

        Raises:
            RequestError: parts and copies come to too many elements.
        """
        ...

    @property
    def bounds(self) -> Bounds:
        """World rectangle west, south, east, north."""
        ...

    @property
    def levels(self) -> int:
        """Levels of nesting, 1 for a root alone."""
        ...

    @property
    def parents(self) -> NDArray[np.int32]:
        """Index of each element's parent, (n,); -1 for the root."""
        ...

    @property
    def surfaces(self) -> tuple[str, ...]:
        """Names of the surfaces, in the order of their indices."""
        ...

    @property
    def surface_types(self) -> Mapping[str, Surface]:
        """Surfaces by name."""
        ...

    def height(self, x: ArrayLike, y: ArrayLike, below: ArrayLike | None = None) -> Any:
        """Heights at points, float64 in their shape; NaN where there is none."""
        ...

    def sample(self, x: ArrayLike, y: ArrayLike, below: ArrayLike | None = None) -> PointSamples:
        """Height, element, surface and normal at points."""
        ...

    def cells(self) -> NDArray[np.float64]:
        """World rectangles of the elements' cells, (4, n)."""
        ...

    def numbers_of(self, elements: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers in this terrain of elements and tracks of `written_out`."""
        ...


def real_numbers(array: NDArray[Any]) -> NDArray[np.float64]:
    """An array as float64, masked where it is.

    Raises:
        TypeError, OverflowError: an item is no real number, such as a text, a date or None, which
            NumPy would take for some; or too large a one.
    """
    plain = np.asarray(array)
    real = plain.dtype.kind in "biuf" or (
        plain.dtype.kind == "O" and all(isinstance(one, Real | Decimal) for one in plain.flat)
    )
    if not real:
        raise TypeError("an item is no real number")
    return array.astype(np.float64, copy=False)


def points_of(
    x: ArrayLike, y: ArrayLike, second: str = "y"
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates of points as float64 arrays of one shape, which broadcast views may be.

    Args:
        x: the first ones.
        y: the second ones, or what else points have.
        second: name of these in messages.

    Raises:
        RequestError: a coordinate is no number, or the shapes do not fit together.
    """
    try:
        x, y = real_numbers(np.asarray(x)), real_numbers(np.asarray(y))
    except (TypeError, ValueError, OverflowError):
        what = "A coordinate" if second == "y" else second
        raise RequestError(f"{what} is no number.", "Give numbers, or arrays of them.") from None
    if x.shape == y.shape:
        return x, y
    try:
        shape = np.broadcast_shapes(x.shape, y.shape)
    except ValueError:
        raise RequestError(
            f"x has the shape {x.shape}, but {second} {y.shape}.",
            "Give arrays of one shape, or that broadcast together.",
        ) from None
    return np.broadcast_to(x, shape), np.broadcast_to(y, shape)
