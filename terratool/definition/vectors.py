"""Long vectors of curves: arrays in place of tuples, read by a kernel ahead of the other values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from msgspec import Struct

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LEAST = 1000
"""Fewest numbers of a curve that stand in a `Vector` rather than in a tuple."""

_LONG = 100_000
"""Fewest bytes of a text that may have vectors: loading NumPy takes as long as reading them."""

_PART = 1 << 17
"""Numbers that are hashed together."""

_MARK = "\0vector "
"""Beginning of a string that stands for a vector, ahead of its index; texts with NUL have none."""


class Vector(Sequence[float]):
    """Evenly spaced values of a curve, immutable: what a tuple of floats is, in 8 bytes a value."""

    __slots__ = ("_hash", "array")

    def __init__(self, array: NDArray[np.float64]) -> None:
        self.array = array
        """(n,) values."""
        self._hash: int | None = None

    def __len__(self) -> int:
        return len(self.array)

    def __getitem__(self, index: Any) -> Any:
        found = self.array[index]
        return Vector(found) if isinstance(index, slice) else float(found)

    def __iter__(self) -> Iterator[float]:
        return iter(self.array.tolist())

    def __reversed__(self) -> Iterator[float]:
        return iter(self.array[::-1].tolist())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Vector):
            return NotImplemented
        return len(self) == len(other) and bool((self.array == other.array).all())

    def __hash__(self) -> int:
        if self._hash is None:  # by parts, as a long vector fills the memory
            parts = (self.array[at : at + _PART] for at in range(0, len(self.array), _PART))
            # 0.0 turns -0.0 into 0.0, which is equal to it
            self._hash = hash(tuple(hash((part + 0.0).tobytes()) for part in parts))
        return self._hash

    def __repr__(self) -> str:
        return f"Vector of {len(self)} values"

    def __reduce__(self) -> tuple[Any, ...]:
        return Vector, (self.array,)

    def extremes(self) -> tuple[float, float]:
        """Return the least and the largest value."""
        return float(self.array.min()), float(self.array.max())

    def index(self, value: float, *ends: int) -> int:
        """Return the index of the first of the values that is equal to one."""
        if ends:
            return super().index(value, *ends)
        places = (self.array == value).nonzero()[0]
        if not len(places):
            raise ValueError(f"{value!r} is not in the vector")
        return int(places[0])


def range_of(values: Sequence[float]) -> tuple[float, float]:
    """Least and largest of the values of a curve."""
    if isinstance(values, Vector):
        return values.extremes()
    return min(values), max(values)


def is_mirrored(values: Sequence[float], slack: float) -> bool:
    """Whether the values of a curve are, within `slack`, the same backwards."""
    if isinstance(values, Vector):
        return bool((abs(values.array - values.array[::-1]) <= slack).all())
    return all(abs(a - b) <= slack for a, b in zip(values, reversed(values), strict=True))


def vector_of(values: Sequence[float]) -> Vector:
    """Vector of numbers."""
    import numpy as np

    return Vector(np.array(values, np.float64))


class LiftedText(Struct, frozen=True):
    """A JSON text whose long vectors were read, with a string in the place of each.

    Attributes:
        data: the text with these strings.
        vectors: vectors in the order of the text.
    """

    data: bytes
    vectors: tuple[Vector, ...] = ()

    def vector_of(self, value: object) -> Vector | None:
        """Return the vector that a value of the text stands for; None for another value."""
        if not (self.vectors and isinstance(value, str) and value.startswith(_MARK)):
            return None
        return self.vectors[int(value[len(_MARK) :])]


def lift_vectors(data: bytes, most: float) -> LiftedText:
    """Read the long vectors of a JSON text; those that have a fault stay in it.

    Args:
        data: a text in UTF-8, perhaps no JSON.
        most: largest size of a number.
    """
    if len(data) <= _LONG or b"\\u0000" in data:
        return LiftedText(data)
    import numpy as np

    from terratool.definition.exact import powers_of_ten
    from terratool.kernels import definition as kernels

    text = np.frombuffer(data, np.uint8)
    places = np.array(kernels.find_vectors(text, LEAST), np.int64).reshape(-1, 3)
    if not len(places):
        return LiftedText(data)
    numbers, powers, first = np.empty(places[:, 2].sum()), powers_of_ten(), 0
    parts: list[bytes] = []
    vectors: list[Vector] = []
    done = 0
    for begin, end, count in places.tolist():
        values = numbers[first : first + count]
        if kernels.read_vector(text[begin:end], powers, most, values):
            values.flags.writeable = False
            parts.append(data[done:begin] + b'"\\u0000vector %d"' % len(vectors))
            vectors.append(Vector(values))
            first, done = first + count, end
    return LiftedText(b"".join([*parts, data[done:]]), tuple(vectors))
