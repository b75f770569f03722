"""A key of the format: what its value must be, in words and in numbers, and what it means."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, Literal

from msgspec import Struct, structs

LEAST, MOST = 1e-6, 1e6
"""Range of the measures of vehicles and sensors, in their units; products of them stay finite."""
Shape = type | str
"""An object of the format: its class of the model, or of tiles the name of their kind."""


class Key(Struct, frozen=True):
    """A key: its value in words, its type, and the range of its number or numbers.

    Attributes:
        words: what a message asks for.
        kind: what the value, or each item of it, is.
        low: least number, included unless `open_low`.
        high: greatest number, included unless `open_high`.
        alone: whether one such value stands by itself.
        length: items of a list, at most so many in `numbers`; 0 where a list is not taken.
        choices: texts that are taken; none means all. A number's are those that stand for one.
        noun: what one of the choices is.
        descr: what the key means, one sentence or more, for editors and help.
        examples: values that show it, as in JSON.
        default: what counts where the key is left out, as in JSON; None where that follows from
            other keys, or the key must be there.
    """

    words: str
    kind: Literal[
        "text",
        "number",
        "whole",
        "flag",
        "object",
        "list",
        "curve",
        "path",
        "depth",
        "members",
        "paths",
        "numbers",
        "any",
    ]
    low: float = -inf
    high: float = inf
    open_low: bool = False
    open_high: bool = False
    alone: bool = True
    length: int = 0
    choices: tuple[str, ...] = ()
    noun: str = ""
    descr: str = ""
    examples: tuple[Any, ...] = ()
    default: Any = None

    def holds(self, number: float) -> bool:
        """Whether a number lies in the range."""
        above = number > self.low if self.open_low else number >= self.low
        below = number < self.high if self.open_high else number <= self.high
        return above and below

    def describe(self, descr: str, *examples: Any, default: Any = None) -> Key:
        """The same key with its meaning, examples and default."""
        return structs.replace(self, descr=descr, examples=examples, default=default)


TEXT = Key("a text", "text")
SCHEMA = Key("the address of the JSON Schema, a text", "text")
FLAG = Key("true or false", "flag")


def choice(noun: str, choices: Sequence[str]) -> Key:
    """One of some texts."""
    words = "one of " + ", ".join(f'"{name}"' for name in choices)
    return Key(words, "text", choices=tuple(choices), noun=noun)


def measure(what: str, unit: str, most: float = MOST) -> Key:
    """A number above 0: a length, a mass and their like."""
    return Key(f"{what} in {unit}, from {LEAST:g} to {most:g}", "number", LEAST, most)


def reserve(what: str, unit: str, most: float = MOST) -> Key:
    """A number of 0 or more."""
    return Key(f"{what} in {unit}, from 0 to {most:g}", "number", 0, most)


def share(what: str) -> Key:
    """A number above 0 and up to 1."""
    return Key(f"{what}, above 0 and up to 1", "number", 0, 1, open_low=True)


def number(low: float, high: float) -> Key:
    """A number from `low` to `high`."""
    return Key(f"a number from {low:,.12g} to {high:,.12g}", "number", low, high)


def number_range(low: float, high: float) -> Key:
    """Two numbers from `low` to `high`, the smaller one first."""
    words = f"two numbers [least, greatest] from {low:,.12g} to {high:,.12g}"
    return Key(words, "number", low, high, alone=False, length=2)


def whole(low: int, high: int) -> Key:
    """A whole number from `low` to `high`."""
    return Key(f"a whole number from {low:,} to {high:,}", "whole", low, high)
