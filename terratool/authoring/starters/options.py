"""What a kind of terrain can be told, and what it was told."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

from msgspec.structs import replace

from terratool.definition.key import Key
from terratool.definition.scattering import share
from terratool.errors import RequestError
from terratool.report.wording import listed

Members = dict[str, Any]
"""Of an object of the definition."""
Value = float | int | str | tuple[float, float]

MM = 1000
"""mm in a metre."""
LARGEST = 10_000.0
"""The longest side of a terrain, m."""
LAST_SEED = 2**53 - 1


class Option(Key, frozen=True, kw_only=True):
    """A key that a kind can be told on the command line.

    Attributes:
        name: name on the command line, without its dashes.
        unit: unit of its numbers; empty for none.
        otherwise: what counts where the default is None.
        metavar: what stands for its values in the help.
        in_mm: whether its numbers are whole millimetres, in metres.
    """

    name: str
    unit: str = ""
    otherwise: str = ""
    metavar: str = ""
    in_mm: bool = False

    @property
    def key(self) -> str:
        """Its name in Python."""
        return self.name.replace("-", "_")

    @property
    def shown_default(self) -> str:
        """Its default in words."""
        match self.default:
            case None:
                return self.otherwise
            case (first, second):
                return f"{first:g} {second:g}"
            case float() | int() as number:
                return f"{number:g}"
            case word:
                return str(word)

    @property
    def range(self) -> str:
        """The values that it may have, in words."""
        if self.choices:
            return listed(self.choices)
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.low:,.16g} to {self.high:,.16g}{unit}"

    def accepted(self, value: Any) -> Value:
        """A value that is good; lengths in whole millimetres.

        Raises:
            RequestError: it is none.
        """
        if self.choices:
            if value not in self.choices:
                raise RequestError(f"--{self.name} is {value!r}.", f"Choose from {self.range}.")
            return str(value)
        if self.length:
            if not isinstance(value, (tuple, list)) or len(value) != 2:
                raise RequestError(f"--{self.name} is {value!r}.", "Give two numbers.")
            first, second = self.metavar.split()
            return self._number(value[0], f"{first} of "), self._number(value[1], f"{second} of ")
        return self._number(value)

    def _number(self, value: Any, which: str = "") -> float | int:
        name = f"{which}--{self.name}"
        if isinstance(value, bool) or not isinstance(value, Real):
            raise RequestError(f"{name} is {value!r}.", f"Give a number, {self.range}.")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not self.holds(number):  # nor NaN
            raise RequestError(f"{name} is {number:,.16g}.", f"Give {self.range}.")
        if self.kind == "whole":
            if not number.is_integer():
                raise RequestError(f"{name} is {number:,.16g}.", "Give a whole number.")
            return int(number)
        return round(number * MM) / MM if self.in_mm else number


@dataclass(frozen=True, slots=True)
class Wanted:
    """What was asked for, all of it good by itself.

    Attributes:
        values: by the keys of the kind's options, all of them.
    """

    values: Mapping[str, Value | None]

    def number(self, key: str) -> float:
        """A number, or a length in metres."""
        value = self.values[key]
        assert isinstance(value, (float, int))
        return value

    def mm(self, key: str) -> int:
        """A length in whole millimetres."""
        return mm(self.number(key))

    def whole(self, key: str) -> int:
        """A whole number."""
        return int(self.number(key))

    def word(self, key: str) -> str:
        """One of some words."""
        return str(self.values[key])

    def pair(self, key: str) -> tuple[float, float]:
        """Two lengths, m."""
        value = self.values[key]
        assert isinstance(value, tuple)
        return value

    def size(self, needed: tuple[int, int] | None = None) -> tuple[int, int]:
        """Sides of the terrain in whole millimetres.

        Args:
            needed: them, where none were asked for.
        """
        if self.values["size"] is None:
            assert needed is not None
            return needed
        x, y = self.pair("size")
        return mm(x), mm(y)

    @property
    def draw(self) -> Draw:
        """Random numbers by the seed."""
        return Draw(self.whole("seed"))


@dataclass(slots=True)
class Draw:
    """Random numbers that are the same on every machine and in every version.

    They are the shares by which the format strews copies: whole numbers of 64 bits, mixed by
    SplitMix64, and one division by a power of 2.

    Attributes:
        seed: what they follow from.
        number: of the next one.
    """

    seed: int
    number: int = 0

    def share(self) -> float:
        """From 0 to below 1."""
        self.number += 1
        return share(self.seed, self.number, 0)

    def below(self, end: int) -> int:
        """A whole number from 0 to below `end`."""
        return math.floor(self.share() * end)

    def between(self, low: int, high: int) -> int:
        """A whole number from `low` to `high`, both included."""
        return low + self.below(high - low + 1)


def mm(metres: float) -> int:
    """Metres in whole millimetres."""
    return round(metres * MM)


def m(millimetres: float) -> float | int:
    """Millimetres in metres, as JSON has them at their shortest."""
    metres = millimetres / MM
    return int(metres) if metres == int(metres) else metres


def place(x: float, y: float, w: int, h: int) -> Members:
    """The free place of an element by its middle and its sides, all in mm."""
    return {"at": [m(x), m(y)], "extent": [m(w), m(h)]}


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of terrain.

    Attributes:
        descr: what it is, in one line.
        options: what it can be told.
        make: the definition of what is wanted.
    """

    descr: str
    options: tuple[Option, ...]
    make: Callable[[Wanted], Members]


def size_option(
    default: tuple[float, float] | None, least: float = 1.0, most: float = LARGEST
) -> Option:
    """Sides of the terrain, m."""
    option = pair_option("size", default, "Sides of the terrain along x and y.", least, most, "X Y")
    return replace(option, otherwise="what is on it, and 2 m around")


def pair_option(
    name: str, default: tuple[float, float] | None, descr: str, low: float, high: float,
    metavar: str,
) -> Option:  # fmt: skip
    """Two lengths, m, in whole millimetres."""
    return Option(
        "two lengths", "number", low, high, alone=False, length=2, descr=descr, default=default,
        name=name, unit="m", metavar=metavar, in_mm=True,
    )  # fmt: skip


def length_option(name: str, default: float, descr: str, low: float, high: float) -> Option:
    """A length, m, in whole millimetres."""
    return replace(
        number_option(name, default, descr, low, high), unit="m", metavar="M", in_mm=True
    )


def number_option(name: str, default: float, descr: str, low: float, high: float) -> Option:
    """A number without a unit."""
    return Option(
        "a number", "number", low, high, descr=descr, default=default, name=name, metavar="S"
    )


def count_option(
    name: str, default: int | None, descr: str, low: int, high: int, otherwise: str = ""
) -> Option:
    """A whole number of something."""
    return Option(
        "a whole number", "whole", low, high, descr=descr, default=default, name=name,
        otherwise=otherwise, metavar="N",
    )  # fmt: skip


def choice_option(
    name: str, default: str, descr: str, choices: tuple[str, ...], metavar: str
) -> Option:
    """One of some words."""
    return Option(
        "a word", "text", choices=choices, descr=descr, default=default, name=name, metavar=metavar
    )


SEED = count_option("seed", 0, "Number that all random choices follow from.", 0, LAST_SEED)
