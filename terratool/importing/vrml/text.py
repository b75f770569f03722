"""Words, strings and numbers of a VRML97 or X3D text, with their places."""

from __future__ import annotations

import math
import re

import numpy as np
from numpy.typing import NDArray

from terratool.definition.exact import powers_of_ten
from terratool.errors import ReadError
from terratool.kernels import importing as kernels
from terratool.text.locate import positions_of

_gap = re.compile(rb"(?:[\t-\r ,]++|#[^\r\n]*+)*+").match
_word = re.compile(rb"[^\x00-\x20,#\"\[\]{}\x7f]++").match
_string = re.compile(rb'"(?:[^"\\]++|\\.)*+"', re.DOTALL).match
_numbers = re.compile(rb"#[^\r\n]*+|[^\t-\r ,#]++").finditer
NUMERIC = frozenset(b"+-.0123456789")
"""First bytes of numbers."""

_GAPS = frozenset(b"\t\n\v\f\r ,#")
_SHOWN = 40


_long = re.compile(rf"[^\s\"]{{{_SHOWN + 1},}}").sub


def short(word: str) -> str:
    """Return a word of a text, shortened for a message."""
    if len(word) > _SHOWN:
        word = word[: _SHOWN - 1] + "…"
    return "".join(c if c.isprintable() else "�" for c in word)


def _readable(message: str) -> str:
    """Return a message in which long and unprintable words of the text are shortened."""
    words = _long(lambda match: short(match.group()), message)
    return "".join(c if c.isprintable() else "�" for c in words)


class PlacedText:
    """A text whose errors name line and column."""

    def __init__(self, name: str, data: bytes) -> None:
        self.name = name
        self.data = data

    def error(self, at: int, message: str, hint: str) -> ReadError:
        """Return the error at an offset in bytes, with its line and its column."""
        (place,) = positions_of(self.data, [at])
        where = f"{self.name}:{place.line}:{place.column}"
        return ReadError(f"{where}: {_readable(message)}", _readable(hint))

    def place_of(self, at: int, index: int) -> int:  # noqa: ARG002, others can tell
        """Return the offset of a number in the value of a field that begins at an offset."""
        return at


class VrmlText(PlacedText):
    """A text that is read from its beginning to its end.

    Attributes:
        at: offset of the next byte.
    """

    def __init__(self, name: str, data: bytes) -> None:
        super().__init__(name, data)
        self.at = 0
        self._bytes = np.frombuffer(data, np.uint8)

    def peek(self) -> int:
        """Return the first byte of the next word, or -1 at the end."""
        data, at = self.data, self.at
        if at < len(data) and data[at] not in _GAPS:
            return data[at]
        at = self.at = _gap(data, at).end()  # type: ignore[union-attr]
        return data[at] if at < len(data) else -1

    def take(self, byte: bytes) -> bool:
        """Skip a bracket if it comes next, and tell whether it did."""
        if self.peek() == byte[0]:
            self.at += 1
            return True
        return False

    def need(self, byte: bytes, where: str) -> int:
        """Skip a bracket that has to come next, and return its offset.

        Raises:
            ReadError: another word comes next.
        """
        if not self.take(byte):
            raise self.missing_error(f'"{byte.decode()}" {where}')
        return self.at - 1

    def word(self, what: str) -> str:
        """Return the next word.

        Raises:
            ReadError: no word comes next.
        """
        self.peek()
        match = _word(self.data, self.at)
        if match is None:
            raise self.missing_error(what)
        self.at = match.end()
        return match.group().decode("utf-8", "replace")

    def string(self) -> str:
        """Skip a string, and return the text between its quotation marks.

        Raises:
            ReadError: the string has no end, or none comes next.
        """
        match = _string(self.data, self.at)
        if match is None:
            raise self.error(
                self.at,
                "the string that begins here has no end.",
                "Close it by a quotation mark; the file may be cut off.",
            )
        self.at = match.end()
        return match.group()[1:-1].decode("utf-8", "replace")

    def run(self) -> NDArray[np.float64]:
        """Return the numbers that follow, (n,) float64.

        Raises:
            ReadError: a word is no number, or too large.
        """
        numbers, hard, end = kernels.read_numbers(self._bytes, self.at, powers_of_ten())
        for index, begin in hard:
            self.at = begin
            numbers[index] = self._hard()
        self.at = end
        if end < len(self.data) and self.data[end] in NUMERIC:
            raise self.error(end, f"{self.quote_next()} is no number.", "Write it as 12 or 1.5e-3.")
        return numbers

    def _hard(self) -> float:
        word = self.word("a number")
        number = float(int(word, 16)) if "x" in word.lower() else float(word)
        if math.isinf(number):
            raise self.error(
                self.at - len(word), f"{word[:_SHOWN]} is too large.", "Write a smaller number."
            )
        return number

    def place_of(self, at: int, index: int) -> int:
        """Return the offset of a number in a run, or a list, that begins at an offset."""
        begin = at + 1 if self.data[at : at + 1] == b"[" else at
        for match in _numbers(self.data, begin):
            if match.group()[:1] != b"#":
                if not index:
                    return match.start()
                index -= 1
        return at

    def quote_next(self) -> str:
        """Return the next word in quotes for a message."""
        if self.peek() < 0:
            return "the end of the file"
        match = _word(self.data, self.at)
        word = (match.group() if match else self.data[self.at : self.at + 1])[: 4 * _SHOWN]
        return f'"{short(word.decode("utf-8", "replace"))}"'

    def missing_error(self, what: str) -> ReadError:
        """Return the error that `what` is missing at the next word."""
        shown = self.quote_next()
        hint = "The file may be cut off; write or fetch it again."
        if self.at < len(self.data):
            hint = "Correct the file there, or write it again."
        return self.error(self.at, f"{what} is missing; there is {shown}.", hint)
