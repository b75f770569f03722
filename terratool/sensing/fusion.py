"""Heights fused from readings, each in a slot: a cell of a map, or a patch of a cell.

Heights are fused by the Kalman filter of elevation mapping: Fankhauser, Bloesch, Gehring, Hutter
and Siegwart, Robot-Centric Elevation Mapping with Uncertainty Estimates, CLAWAR 2014; Fankhauser,
Bloesch and Hutter, Probabilistic Terrain Mapping for Mobile Robots with Uncertain Localization,
IEEE RA-L 3(4), 2018. Two heights belong to one surface if their Mahalanobis distance is within a
gate; else the higher one is the ground. github.com/ANYbotics/elevation_mapping does so within a
scan, but keeps the old height where a later scan differs; here the higher one stays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.io.points import MOST_NAMES
from terratool.sensing.clouds import Cloud

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_MULTI_HEIGHT = 0.003
"""Standard deviation that a lower reading adds to a slot, m, as in elevation_mapping."""
_ROUNDS = 4
"""Iterations of the search for the top surface of a slot in a batch."""
_SURFACE = (1 << 20) - 1
"""Bits of a vote that have the surface; those above have the slot."""


class Fusion:
    """Fused readings of slots, filled batch by batch; arrays are (slots,).

    Attributes:
        height, variance: float64, fused height, m, and its variance, m²; inf before any reading.
        low, high: float64, least and largest height of all readings, m.
        count: int64, number of readings.
        ranged: int64, number of those with a range.
        range: float64, sum of ranges, m.
        time: float64, largest time, s; -inf for none.
        from_below: bool, whether the height is one of readings whose rays rise.
        numbers: numbers of surfaces by name, in order of first occurrence.
    """

    def __init__(self, slots: int, gate: float, tau: float) -> None:
        """Empty slots.

        Args:
            slots: number of slots.
            gate: square of the gate, in standard deviations.
            tau: variance of heights within a cell by relief, m².
        """
        self._gate, self._tau = gate, tau
        self.height, self.variance = np.zeros(slots), np.full(slots, np.inf)
        self.low, self.high = np.full(slots, np.inf), np.full(slots, -np.inf)
        self.count, self.ranged = np.zeros(slots, np.int64), np.zeros(slots, np.int64)
        self.time, self.range = np.full(slots, -np.inf), np.zeros(slots)
        self.from_below = np.zeros(slots, np.bool_)
        self.numbers: dict[str, int] = {}
        # votes by slot and surface: keys slot << 20 | surface, ascending
        self._voted, self._votes = np.zeros(0, np.int64), np.zeros(0, np.int64)

    def add(self, batch: Batch, cloud: Cloud, origin: Floats | None) -> None:
        """Fuse a batch: its readings within each slot first, then these with the slot.

        Args:
            batch: readings by slot.
            cloud: the cloud that they are of.
            origin: sensor position (3,), m, for readings without one; None if unknown.
        """
        self._note(batch, cloud, origin)
        top, member = batch.top(self._gate, self._tau)
        kept, replaced = self._fuse(batch.slots, top)
        if cloud.surface is not None:
            self._vote(batch, cloud, member & kept[batch.group], batch.slots[replaced])

    def _note(self, batch: Batch, cloud: Cloud, origin: Floats | None) -> None:
        """Update least and largest height, count, time and range of the slots of a batch."""
        slots = batch.slots
        self.low[slots] = np.minimum(self.low[slots], batch.reduce(np.minimum, batch.heights))
        self.high[slots] = np.maximum(self.high[slots], batch.reduce(np.maximum, batch.heights))
        self.count[slots] += batch.sizes
        if cloud.time is not None:
            time = cloud.time[batch.order]
            time = np.where(np.isfinite(time), time, -np.inf)
            self.time[slots] = np.maximum(self.time[slots], batch.reduce(np.maximum, time))
        ranges, origins = cloud.range, cloud.origin if cloud.origin is not None else origin
        if ranges is None and origins is not None:
            ranges = np.linalg.norm(cloud.points - origins, axis=1)
        if ranges is not None:
            ranges = ranges[batch.order]
            known = np.isfinite(ranges)
            self.range[slots] += batch.reduce(np.add, np.where(known, ranges, 0.0))
            self.ranged[slots] += batch.reduce(np.add, known.astype(np.int64))

    def _fuse(self, slots: Ints, top: TopSurface) -> tuple[Mask, Mask]:
        """Update slots by the Kalman filter.

        Returns:
            Masks of the slots that took the surface, and of those whose height it replaced.
        """
        height, before = self.height[slots], self.variance[slots]
        known = np.isfinite(before)
        before = np.where(known, before, 0.0)
        off = top.mean - height
        near = known & (off**2 <= self._gate * (before + top.variance + self._tau))
        # of one surface, what is seen from above is the top, and what is seen from below is not
        better = near & self.from_below[slots] & ~top.from_below
        worse = near & ~self.from_below[slots] & top.from_below
        taken = ~known | (~near & (off > 0.0)) | better
        lower = ~near & ~taken
        gain = np.where(near & ~better & ~worse, before, 0.0) / (before + top.variance)
        self.height[slots] = np.where(taken, top.mean, height + gain * off)
        after = (1.0 - gain) * before + np.where(lower, _MULTI_HEIGHT**2, 0.0)
        self.variance[slots] = np.where(taken, top.variance, after)
        self.from_below[slots] = np.where(taken, top.from_below, self.from_below[slots])
        return ~(lower | worse), taken & known

    def _vote(self, batch: Batch, cloud: Cloud, member: Mask, replaced: Ints) -> None:
        """Count the surfaces of readings that `member` marks; `replaced` slots lose their votes."""
        assert cloud.surface is not None
        for name in cloud.surfaces:
            self.numbers.setdefault(name, len(self.numbers))
        if len(self.numbers) > MOST_NAMES:
            raise RequestError(
                f"The scans name more than {MOST_NAMES:,} surfaces.",
                "Rename the column surface, if it holds something else.",
            )
        index = np.array([self.numbers[name] for name in cloud.surfaces], np.int64)
        surface = cloud.surface[batch.order]
        member = member & (surface >= 0)
        keys = batch.slots[batch.group[member]] << 20 | index[surface[member]]
        kept = slice(None) if not len(replaced) else ~np.isin(self._voted >> 20, replaced)
        found, counts = np.unique(keys, return_counts=True)
        merged = np.concatenate([self._voted[kept], found])
        self._voted, self._votes = _summed(merged, np.concatenate([self._votes[kept], counts]))

    def joined(self, label: Ints, slots: int) -> Fusion:
        """Fusion of other slots, each with the readings of those that become it.

        Of several the highest is fused first.

        Args:
            label: number of the new slot of each slot.
            slots: number of new slots.
        """
        new = Fusion(slots, self._gate, self._tau)
        new.numbers = self.numbers
        np.minimum.at(new.low, label, self.low)
        np.maximum.at(new.high, label, self.high)
        np.maximum.at(new.time, label, self.time)
        for whole, part in (
            (new.count, self.count), (new.ranged, self.ranged), (new.range, self.range)
        ):  # fmt: skip
            np.add.at(whole, label, part)
        order = np.lexsort((-self.height, label))
        starts = np.flatnonzero(np.diff(label[order], prepend=-1))
        rank = np.arange(len(order)) - np.repeat(starts, np.diff(np.append(starts, len(order))))
        votes = np.ones(len(label), np.bool_)
        for step in range(int(rank.max(initial=-1)) + 1):
            old = order[rank == step]
            top = TopSurface(self.height[old], self.variance[old], self.from_below[old])
            kept, replaced = new._fuse(label[old], top)
            votes[np.isin(label, label[old][replaced])] = False
            votes[old] = kept
        kept = votes[self._voted >> 20]
        keys = label[self._voted[kept] >> 20] << 20 | self._voted[kept] & _SURFACE
        new._voted, new._votes = _summed(keys, self._votes[kept])
        return new

    def likeliest(self, group: Callable[[Ints], Ints], count: int) -> NDArray[np.int32]:
        """Surface with most votes in each group of slots, -1 for none; of equals the first seen.

        Args:
            group: function that gives the numbers of the groups of slots.
            count: number of groups.
        """
        surface = self._voted & _SURFACE
        keys, votes = _summed(group(self._voted >> 20) << 20 | surface, self._votes)
        order = np.lexsort((-(keys & _SURFACE), votes, keys >> 20))
        out = np.full(count, -1, np.int32)
        out[keys[order] >> 20] = keys[order] & _SURFACE  # of several the last is kept
        return out


def _summed(keys: Ints, votes: Ints) -> tuple[Ints, Ints]:
    """Keys, each once, ascending, and the sums of their votes."""
    found, at = np.unique(keys, return_inverse=True)
    return found, np.bincount(at, votes, len(found)).astype(np.int64)


class TopSurface(NamedTuple):
    """Highest surface of each slot of a batch, (m,).

    Attributes:
        mean: float64, mean height of its readings, m.
        variance: float64, variance of the mean, m².
        from_below: whether the rays of all of its readings rise.
    """

    mean: Floats
    variance: Floats
    from_below: Mask


@dataclass(frozen=True, slots=True)
class Batch:
    """Readings of a cloud sorted by slot.

    Attributes:
        order: (n,) index of each reading in the cloud.
        slots: (m,) indices of the slots, ascending.
        starts: (m,) index of the first reading of each slot.
        sizes: (m,) number of readings of each slot.
        group: (n,) index into `slots` of each reading.
        heights: (n,) heights of the readings, m.
        variances: (n,) variances of the heights, m².
        rises: (n,) whether the ray of a reading rises; None if that does not count.
    """

    order: Ints
    slots: Ints
    starts: Ints
    sizes: Ints
    group: Ints
    heights: Floats
    variances: Floats
    rises: Mask | None = None

    @classmethod
    def of(
        cls, slot: Ints, inside: Mask, cloud: Cloud, variance: Floats, rises: Mask | None = None
    ) -> Batch:
        """Sort the readings that `inside` marks by their slots."""
        which = np.flatnonzero(inside)
        order = which[np.argsort(slot[which], kind="stable")]
        in_order = slot[order]
        starts = np.flatnonzero(np.concatenate([[True], in_order[1:] != in_order[:-1]]))
        sizes = np.diff(np.append(starts, len(order)))
        group = np.repeat(np.arange(len(starts)), sizes)
        heights, variances = cloud.points[order, 2], variance[order]
        rises = None if rises is None else rises[order]
        return cls(order, in_order[starts], starts, sizes, group, heights, variances, rises)

    def reduce(self, function: np.ufunc, values: NDArray[Any]) -> NDArray[Any]:
        """Reduce values, (n,), over the readings of each slot, (m,)."""
        out: NDArray[Any] = function.reduceat(values, self.starts)
        return out

    def top(self, gate: float, tau: float) -> tuple[TopSurface, Mask]:
        """Highest surface of each slot, and which readings belong to it.

        From the highest reading on, readings within the gate of the mean, or above, make the next
        mean; a few iterations find the middle of a noisy surface. If rays of some of these
        readings rise and those of others do not, the latter alone make the mean.

        Args:
            gate: square of the gate, in standard deviations.
            tau: variance of heights within a cell by relief, m².
        """
        highest = self.reduce(np.maximum, self.heights)
        below = self.heights - highest[self.group]
        mean = np.zeros(len(self.slots))
        variance = self.reduce(np.maximum, np.where(below == 0.0, self.variances, 0.0))
        member = np.ones(len(below), bool)
        for _ in range(_ROUNDS):
            off = below - mean[self.group]
            limit = gate * (self.variances + variance[self.group] + tau)
            member = (off >= 0.0) | (off * off <= limit)
            mean, variance = self._mean(below, member)
        from_below = np.zeros(len(self.slots), np.bool_)
        if self.rises is not None:
            from_below = ~self.reduce(np.logical_or, member & ~self.rises)
            member &= from_below[self.group] | ~self.rises
            mean, variance = self._mean(below, member)
        return TopSurface(highest + mean, variance, from_below), member

    def _mean(self, values: Floats, member: Mask) -> tuple[Floats, Floats]:
        """Mean of the values of the members in each slot, by their variances, and its variance."""
        weights = 1.0 / self.variances
        information = self.reduce(np.add, np.where(member, weights, 0.0))
        mean = self.reduce(np.add, np.where(member, weights * values, 0.0)) / information
        return mean, 1.0 / information
