"""Values, texts and bytes with a few mistakes in them."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence
from typing import Any

NUMBERS: list[Any] = [
    0, 1, -1, 2, 3, 10, 0.5, 0.1, -0.0, 1e-9, 1e-30, 5e-324, 1e9, 1e30, 1.0000001e30, 1e308, -1e300,
    255, 256, 65535, 65536, 65537, 2**31 - 1, 2**31, -(2**31), 2**53 + 1, 2**63, 2**64, 10**30,
    10**400, 45, 90, 89.99999999999999, 360, -90.00000000000001, 1 / 3, float("nan"), float("inf"),
]  # fmt: skip
TEXTS = [
    "", " ", "t", "flat", "EPSG:32633", "EPSG:0", "EPSG:99999999", "http://127.0.0.1:9/crs", "\0",
    "+proj=utm +zone=33", "+proj=longlat +nadgrids=@null", "+init=epsg:4326", "/etc/passwd",
    'LOCAL_CS["x",UNIT["m",1]]', "x" * 5000, "<script>alert(1)</script>", "a\nb", "::error::x",
    "%0A", "../../x", "`x`", "=1+1", "\x1b[31m", "\ud800", "\U0001f600", "\u202e", "TT208", "TT",
    "urn:ogc:def:crs:EPSG::4326", "GEOGCS[" * 200, "IGNF:LAMB93", "ESRI:102100", "file:///x",
    "{}", '{"type":"GeographicCRS"}', "sin(9e9*t)", "1/t", "t**-1", "(" * 600, "earth", "pebble",
]  # fmt: skip
INTEGERS = [
    0,
    1,
    2,
    3,
    4,
    7,
    8,
    16,
    255,
    256,
    32767,
    65535,
    2**16,
    2**24,
    2**31 - 1,
    2**31,
    2**32 - 1,
]
_number = re.compile(rb"-?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_word = re.compile(rb"[A-Za-z_][A-Za-z_0-9.]*")

Place = tuple[Any, Any]
"""A dictionary or list, and a key or index in it."""


def place_in(rng: random.Random, tree: Any) -> Place | None:
    """Some place of a tree: a member or an item, the deeper ones as likely as the others."""
    found: Place | None = None
    node = tree
    while isinstance(node, dict | list) and node:
        key = rng.choice(list(node)) if isinstance(node, dict) else rng.randrange(len(node))
        found = node, key
        node = node[key]
        if rng.random() < 0.2:
            break
    return found


def mutate_tree(rng: random.Random, tree: Any, keys: Sequence[str], other: Any) -> Any:
    """Change one place of a tree.

    Args:
        rng: makes the choices.
        tree: of dictionaries and lists; changed.
        keys: those that a document of its kind may have.
        other: a tree that parts are taken from.
    """
    place = place_in(rng, tree)
    if place is None:
        return tree
    node, key = place
    kind = rng.randrange(16)
    if kind < 5:
        node[key] = _near(rng, node[key])
    elif kind == 5:
        node[key] = rng.choice(NUMBERS)
    elif kind == 6:
        node[key] = rng.choice(TEXTS)
    elif kind == 7:
        del node[key]
    elif kind == 8:
        node[key] = rng.choice([None, True, False, [], {}, [[]], [node[key]], {"x": node[key]}])
    elif kind in (9, 10) and (graft := place_in(rng, other)) is not None:
        node[key] = graft[0][graft[1]]
    elif kind == 11 and isinstance(node, list):
        node[key:key] = [node[key]] * rng.choice([1, 1, 2, 50])
    elif kind in (11, 12) and isinstance(node, dict):
        new = rng.choice([*keys, _misspelt(rng, str(key)), rng.choice(TEXTS), f"x-{key}"])
        node[new] = node.pop(key) if rng.random() < 0.5 else node[key]
    elif kind == 13:
        node[key] = _nested(rng, node[key])
    elif isinstance(node, dict):
        node[rng.choice(keys)] = rng.choice([*NUMBERS, *TEXTS[:8], node[key], [1, 2], [0, 0, 9]])
    return tree


def _near(rng: random.Random, value: Any) -> Any:
    """A value like another one, of which many are as good."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + rng.choice([-2, -1, 1, 2, 10])
    if isinstance(value, float):
        return value * rng.choice([-1, 0.5, 2, 1 + 1e-9, 10, 0]) + rng.choice([0, 0, 1e-6, 1])
    if isinstance(value, str):
        return _misspelt(rng, value)
    if isinstance(value, list):
        shuffled = value[:]
        rng.shuffle(shuffled)
        return rng.choice([shuffled, value[:-1], value + value[:1]])
    return value


def _misspelt(rng: random.Random, text: str) -> str:
    at = rng.randint(0, len(text))
    return (
        text[:at] + rng.choice(["", "x", "é", "\n", '"', " ", "0"]) + text[at + rng.randint(0, 1) :]
    )


def _nested(rng: random.Random, value: Any) -> Any:
    """A value some levels deeper."""
    for _ in range(rng.choice([1, 3, 30, 300])):
        value = [value] if rng.random() < 0.5 else {"children": [value]}
    return value


def mutate_bytes(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Change one place of some bytes."""
    size = len(data)
    at = rng.randrange(size + 1)
    kind = rng.randrange(9)
    if kind == 0:
        return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
    if kind == 1 and at < size:
        return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]
    if kind == 2:
        return data[:at]
    if kind == 3:
        return data[:at] + data[at + rng.choice([1, 1, 2, 4, 16, 200]) :]
    if kind == 4:
        return data[:at] + rng.randbytes(rng.choice([1, 2, 4, 16])) + data[at:]
    if kind == 5:
        to = at + rng.choice([1, 4, 12, 100, 1000])
        return data[:to] + data[at:to] * rng.choice([1, 1, 3]) + data[to:]
    if kind == 6:
        start = rng.randrange(len(other) + 1)
        length = rng.choice([4, 16, 100, 1000])
        return data[:at] + other[start : start + length] + data[at + rng.choice([0, length]) :]
    width = rng.choice([1, 2, 2, 4, 4, 4, 8])
    value = rng.choice(INTEGERS) * rng.choice([1, 1, 1, -1])
    spelled = (value % (1 << 8 * width)).to_bytes(width, rng.choice(["little", "big"]))
    # headers stand at the front, and their numbers at even places
    at = rng.randrange(min(size, 512) // 2 + 1) * 2 if rng.random() < 0.7 else at
    return data[:at] + spelled + data[at + width :]


def mutate_text(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Change a number, a word or a line of a text, or some of its bytes."""
    kind = rng.randrange(8)
    if kind < 3 and (new := _replaced(rng, _number, data, _spelled_number(rng))) is not None:
        return new
    if kind == 3:
        words = _word.findall(other)
        new = _replaced(rng, _word, data, rng.choice(words) if words else b"x")
        if new is not None:
            return new
    if kind in (4, 5):
        lines = data.splitlines(keepends=True)
        if len(lines) > 1:
            at = rng.randrange(len(lines))
            change: Callable[[], list[bytes]] = rng.choice([
                lambda: lines[:at] + lines[at + 1 :],
                lambda: lines[: at + 1] + lines[at:],
                lambda: lines[:at] + lines[at:at + 1] * 200 + lines[at + 1 :],
                lambda: [*lines[:at], rng.choice(other.splitlines(keepends=True)), *lines[at:]],
            ])  # fmt: skip
            return b"".join(change())
    return mutate_bytes(rng, data, other)


def _spelled_number(rng: random.Random) -> bytes:
    number = rng.choice(NUMBERS)
    return b"1" + b"0" * 400 if number == 10**400 else str(number).encode()


def _replaced(
    rng: random.Random, pattern: re.Pattern[bytes], data: bytes, new: bytes
) -> bytes | None:
    """The bytes with one match of a pattern, near some place, replaced."""
    start = rng.randrange(len(data) + 1)
    match = pattern.search(data, start) or pattern.search(data)
    return None if match is None else data[: match.start()] + new + data[match.end() :]
