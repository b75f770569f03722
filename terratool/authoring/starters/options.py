"""Kinds of new terrains: their options, and the values that a user gives them."""

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
from terratool.report.wording import join_words

Members = dict[str, Any]
"""Members of a JSON object of the definition, by key."""
Value = float | int | str | tuple[float, float]

MM = 1000
"""Millimetres per metre."""
LARGEST = 10_000.0
"""Longest side of a terrain, m."""
LAST_SEED = 2**53 - 1


class Option(Key, frozen=True, kw_only=True):
    """Option of a kind of terrain on the command line.

    Attributes:
        name: name on the command line, without its dashes.
        unit: unit of its numbers; empty for none.
        otherwise: meaning of a default that is None, in words.
        metavar: placeholder of the values in the help.
        in_mm: whether values in metres are rounded to whole millimetres.
    """

    name: str
    unit: str = ""
    otherwise: str = ""
    metavar: str = ""
    in_mm: bool = False

    @property
    def key(self) -> str:
        """Name of the option in Python, with _ in place of -."""
        return self.name.replace("-", "_")

    @property
    def shown_default(self) -> str:
        """Default of the option in words."""
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
        """Range or choices of the option in words."""
        if self.choices:
            return join_words(self.choices)
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.low:,.16g} to {self.high:,.16g}{unit}"

    def valid_value(self, value: Any) -> Value:
        """Return a valid value of the option, lengths rounded to whole millimetres.

        Raises:
            RequestError: the value is out of range or of another type.
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
        if not self.holds(number):  # true for NaN, too
            raise RequestError(f"{name} is {number:,.16g}.", f"Give {self.range}.")
        if self.kind == "whole":
            if not number.is_integer():
                raise RequestError(f"{name} is {number:,.16g}.", "Give a whole number.")
            return int(number)
        return round(number * MM) / MM if self.in_mm else number


@dataclass(frozen=True, slots=True)
class Wanted:
    """Values of all options of a kind, each valid by itself.

    Attributes:
        values: values by the keys of the kind's options, all of them; None where there is none.
    """

    values: Mapping[str, Value | None]

    def number(self, key: str) -> float:
        """Value of an option for a number, or for a length in metres."""
        value = self.values[key]
        assert isinstance(value, (float, int))
        return value

    def mm(self, key: str) -> int:
        """Value of an option for a length, in whole millimetres."""
        return mm(self.number(key))

    def whole(self, key: str) -> int:
        """Value of an option for a whole number."""
        return int(self.number(key))

    def word(self, key: str) -> str:
        """Value of an option for a word."""
        return str(self.values[key])

    def pair(self, key: str) -> tuple[float, float]:
        """Value of an option for two lengths, m."""
        value = self.values[key]
        assert isinstance(value, tuple)
        return value

    def size(self, needed: tuple[int, int] | None = None) -> tuple[int, int]:
        """Sides of the terrain in whole millimetres.

        Args:
            needed: sides (x, y) in mm where the user gave none; None if there is a default.
        """
        if self.values["size"] is None:
            assert needed is not None
            return needed
        x, y = self.pair("size")
        return mm(x), mm(y)

    @property
    def draw(self) -> RandomDraw:
        """Random numbers that follow from the seed."""
        return RandomDraw(self.whole("seed"))


@dataclass(slots=True)
class RandomDraw:
    """Random numbers that are the same on every machine and in every version.

    The numbers are the shares by which the format strews copies: integers of 64 bits, mixed by
    SplitMix64, and one division by a power of 2.

    Attributes:
        seed: seed of the numbers.
        number: count of the numbers drawn so far.
    """

    seed: int
    number: int = 0

    def share(self) -> float:
        """Random number from 0 to below 1."""
        self.number += 1
        return share(self.seed, self.number, 0)

    def below(self, end: int) -> int:
        """Random whole number from 0 to below `end`."""
        return math.floor(self.share() * end)

    def between(self, low: int, high: int) -> int:
        """Random whole number from `low` to `high`, both included."""
        return low + self.below(high - low + 1)


def mm(metres: float) -> int:
    """Length in whole millimetres, rounded to the nearest."""
    return round(metres * MM)


def m(millimetres: float) -> float | int:
    """Length in metres from millimetres; a whole number of metres is an int, as in JSON."""
    metres = millimetres / MM
    return int(metres) if metres == int(metres) else metres


def place(x: float, y: float, w: int, h: int) -> Members:
    """Free place of an element (`at`, `extent`) by its middle and its sides, all in mm."""
    return {"at": [m(x), m(y)], "extent": [m(w), m(h)]}


@dataclass(frozen=True, slots=True)
class Kind:
    """Kind of terrain that a user can start from.

    Attributes:
        descr: description, one line.
        options: options of the kind.
        make: function that makes the definition from the values of the options.
    """

    descr: str
    options: tuple[Option, ...]
    make: Callable[[Wanted], Members]


def size_option(
    default: tuple[float, float] | None, least: float = 1.0, most: float = LARGEST
) -> Option:
    """Option for the sides of the terrain, m."""
    option = pair_option("size", default, "Sides of the terrain along x and y.", least, most, "X Y")
    return replace(option, otherwise="what is on it, and 2 m around")


def pair_option(
    name: str, default: tuple[float, float] | None, descr: str, low: float, high: float,
    metavar: str,
) -> Option:  # fmt: skip
    """Option for two lengths in m, in whole millimetres."""
    return Option(
        "two lengths", "number", low, high, alone=False, length=2, descr=descr, default=default,
        name=name, unit="m", metavar=metavar, in_mm=True,
    )  # fmt: skip


def length_option(name: str, default: float, descr: str, low: float, high: float) -> Option:
    """Option for a length in m, in whole millimetres."""
    return replace(
        number_option(name, default, descr, low, high), unit="m", metavar="M", in_mm=True
    )


def number_option(name: str, default: float, descr: str, low: float, high: float) -> Option:
    """Option for a number without a unit."""
    return Option(
        "a number", "number", low, high, descr=descr, default=default, name=name, metavar="S"
    )


def count_option(
    name: str, default: int | None, descr: str, low: int, high: int, otherwise: str = ""
) -> Option:
    """Option for a whole number."""
    return Option(
        "a whole number", "whole", low, high, descr=descr, default=default, name=name,
        otherwise=otherwise, metavar="N",
    )  # fmt: skip


def choice_option(
    name: str, default: str, descr: str, choices: tuple[str, ...], metavar: str
) -> Option:
    """Option for one of several words."""
    return Option(
        "a word", "text", choices=choices, descr=descr, default=default, name=name, metavar=metavar
    )


SEED = count_option("seed", 0, "Number that all random choices follow from.", 0, LAST_SEED)
