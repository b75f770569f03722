"""Keys of the format: the values that a key takes, in words and in numbers, and its meaning."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, Literal

from msgspec import Struct, structs

LEAST, MOST = 1e-6, 1e6
"""Range of the measures of vehicles and sensors, in their units; products of them stay finite."""
Shape = type | str
"""Kind of object of the format: its class of the model, or the name of a kind of tiles."""


class Key(Struct, frozen=True):
    """Key of the format: its value in words, its type, and the range of its number or numbers.

    Attributes:
        words: description of the value, as messages ask for it.
        kind: type of the value, or of each item of a list.
        low: least number, included unless `open_low`.
        high: greatest number, included unless `open_high`.
        alone: whether one such value may stand by itself, outside of a list.
        length: number of items of a list, the most of them for `numbers`; 0 where no list is taken.
        choices: texts that are taken; empty for all. For a number, texts that stand for one.
        noun: noun for one of the choices, as messages use it.
        descr: meaning of the key, one sentence or more, for editors and help.
        examples: example values, as in JSON.
        default: value that counts where the key is left out, as in JSON; None where it follows from
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
        "grid",
        "path",
        "depth",
        "members",
        "names",
        "paths",
        "numbers",
        "formula",
        "formulas",
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
        """Whether a number lies in the range of the key."""
        above = number > self.low if self.open_low else number >= self.low
        below = number < self.high if self.open_high else number <= self.high
        return above and below

    def describe(self, descr: str, *examples: Any, default: Any = None) -> Key:
        """Return the key with its meaning, examples and default."""
        return structs.replace(self, descr=descr, examples=examples, default=default)


TEXT = Key("a text", "text")
FORMULA = Key(
    'a number up to 1e9 in size, or an expression such as "0.1 + 0.3 * difficulty"', "formula",
    -1e9, 1e9,
)  # fmt: skip
SCHEMA = Key("the address of the JSON Schema, a text", "text")
FLAG = Key("true or false", "flag")


def choice(noun: str, choices: Sequence[str]) -> Key:
    """Key whose value is one of some texts."""
    words = "one of " + ", ".join(f'"{name}"' for name in choices)
    return Key(words, "text", choices=tuple(choices), noun=noun)


def measure(what: str, unit: str, most: float = MOST) -> Key:
    """Key for a number above 0, such as a length or a mass."""
    return Key(f"{what} in {unit}, from {LEAST:g} to {most:g}", "number", LEAST, most)


def reserve(what: str, unit: str, most: float = MOST) -> Key:
    """Key for a number of 0 or more."""
    return Key(f"{what} in {unit}, from 0 to {most:g}", "number", 0, most)


def ranged(of: Key) -> Key:
    """Key for a number as of another key, or for a range of such numbers."""
    return structs.replace(of, words=f"{of.words}, or a range [low, high]", length=2)


def share(what: str) -> Key:
    """Key for a number above 0 and up to 1."""
    return Key(f"{what}, above 0 and up to 1", "number", 0, 1, open_low=True)


def number(low: float, high: float) -> Key:
    """Key for a number from `low` to `high`."""
    return Key(f"a number from {low:,.12g} to {high:,.12g}", "number", low, high)


def number_range(low: float, high: float) -> Key:
    """Key for two numbers from `low` to `high`, the smaller one first."""
    words = f"two numbers [least, greatest] from {low:,.12g} to {high:,.12g}"
    return Key(words, "number", low, high, alone=False, length=2)


def whole(low: int, high: int) -> Key:
    """Key for a whole number from `low` to `high`."""
    return Key(f"a whole number from {low:,} to {high:,}", "whole", low, high)
