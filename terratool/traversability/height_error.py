"""Errors of a terrain's heights, as samples of what they change under a vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.relief import FALLEN, mix64
from terratool.raster.grid import Grid, Window
from terratool.traversability.footprint import HeadingFootprint
from terratool.traversability.vehicle import Vehicle

_BLOCK = 32.0 / 35.0 / FALLEN
"""Integral of the correlation over a line, in correlation lengths."""
_SLIGHT = 1e-12
"""Share of the largest variance below which a component of the errors is left out."""
_LARGEST = 1e6
"""Largest standard deviation and correlation length, m."""


@dataclass(frozen=True, slots=True)
class HeightError:
    """Errors of a terrain's heights: normal, with the mean 0.

    Two errors at a distance d have the correlation (1 − d²/R²)³, 0 from R on, as the relief of
    rough surfaces has; it falls to 1/e at the correlation length.

    Attributes:
        deviation: standard deviation of a height, m.
        correlation: correlation length, m; 0 for errors that are independent from place to place.
    """

    deviation: float
    correlation: float

    def check(self) -> None:
        """Refuse numbers that make no sense.

        Raises:
            RequestError: a number is below 0, no number, or too large.
        """
        for what, value in (
            ("error of heights", self.deviation), ("correlation length", self.correlation),
        ):  # fmt: skip
            if not 0.0 <= value <= _LARGEST:
                raise RequestError(
                    f"The {what} is {value:g} m.", f"Give metres from 0 to {_LARGEST:g}."
                )

    def correlation_at(self, apart: NDArray[np.float64]) -> NDArray[np.float64]:
        """Correlation of errors at distances, m, in their shape."""
        reach = self.correlation / FALLEN
        if reach == 0.0:
            return np.asarray(apart == 0.0, np.float64)
        return np.asarray((1.0 - (np.minimum(apart, reach) / reach) ** 2) ** 3)


def footprint_errors(
    vehicle: Vehicle, footprints: Sequence[HeadingFootprint], resolution: float,
    error: HeightError, samples: int, seed: int,
) -> NDArray[np.float64]:  # fmt: skip
    """Samples of what errors of heights change under a vehicle, (headings, samples, 6) float64.

    The six are slopes ahead and to the left, as tangents, by the plane fitted to the wheels; the
    height of the ground above that plane in the middle of the body, at the front end and at the
    rear end; and a step at the foremost wheels, from their middles to a radius ahead; m. All of
    them are sums of errors at the wheels and at five more places, so that their covariances follow
    from the correlation. Those of all headings belong to one and the same ground. A Latin hypercube
    over their principal components.
    """
    where, sums = zip(
        *(_sums(vehicle, footprint, resolution) for footprint in footprints), strict=True
    )
    count = len(footprints)
    covariance = np.empty((count, 6, count, 6))
    for a in range(count):
        for b in range(a, count):
            apart = np.hypot(*(where[a][:, None] - where[b][None]).T).T
            found = sums[a] @ error.correlation_at(apart) @ sums[b].T
            covariance[a, :, b], covariance[b, :, a] = found, found.T
    values, vectors = np.linalg.eigh(covariance.reshape(6 * count, 6 * count))
    kept = values > _SLIGHT * max(float(values[-1]), _SLIGHT)
    spread = vectors[:, kept] * (error.deviation * np.sqrt(values[kept]))
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, 1])))
    shares = (np.arange(samples) + 0.5) / samples
    normal = np.array([NormalDist().inv_cdf(share) for share in shares.tolist()])
    drawn = np.empty((int(kept.sum()), samples))
    for component in drawn:
        component[:] = generator.permutation(normal)
    return np.ascontiguousarray((spread @ drawn).reshape(count, 6, samples).transpose(0, 2, 1))


def _sums(
    vehicle: Vehicle, footprint: HeadingFootprint, resolution: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places with errors, (n, 2) m to the east and the north, and six sums of them, (6, n)."""
    east, north = footprint.direction
    half = 0.5 * vehicle.wheelbase
    wheels = footprint.wheels[:, ::-1] * np.array([resolution, -resolution])
    front, rear = half + vehicle.front.length, -half - vehicle.rear.length
    ahead = np.array([0.0, front, rear, half, half + vehicle.wheel.radius])
    # wheels in a row take the ground's own slope, over the length of a wheel
    reach = vehicle.wheel.radius
    own = reach * np.array([[east, north], [-east, -north], [-north, east], [north, -east]])
    where = np.concatenate([wheels, ahead[:, None] * (east, north), own])
    count, total = len(wheels), len(where)
    plane = np.zeros((3, total))  # height in the middle, and slopes to the east and the north
    plane[:, :count] = footprint.fit
    if vehicle.wheelbase == 0.0 or vehicle.track_width == 0.0:
        along, across = np.zeros((2, total))
        along[count + 5 : count + 7] = 0.5 / reach, -0.5 / reach
        across[count + 7 :] = 0.5 / reach, -0.5 / reach
        plane[1], plane[2] = along * east - across * north, along * north + across * east
    sums = np.zeros((6, total))
    sums[0] = plane[1] * east + plane[2] * north
    sums[1] = plane[2] * east - plane[1] * north
    for number, x in enumerate((0.0, front, rear)):
        sums[2 + number] = -(plane[0] + x * sums[0])
        sums[2 + number, count + number] += 1.0
    sums[5, count + 4], sums[5, count + 3] = 1.0, -1.0
    return where, sums


def block_shifts(
    grid: Grid, window: Window, error: HeightError, samples: int, seed: int
) -> NDArray[np.int64]:
    """Row of the errors with which the samples begin at each pixel of a window, (height, width).

    Errors are alike in blocks of the world that are as long as the correlation reaches on average,
    and independent from block to block.
    """
    side = max(_BLOCK * error.correlation, grid.resolution)
    blocks = (
        np.floor(np.asarray(axis) / side).astype(np.int64).astype(np.uint64)
        for axis in (grid.rows(window), grid.columns(window))
    )
    rows, columns = (mix64(block + np.uint64(seed % 2**63)) for block in blocks)
    return (mix64(rows[:, None] * np.uint64(3) + columns) % np.uint64(samples)).astype(np.int64)
