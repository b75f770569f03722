"""S3 clean, with a warning in every third element, with one error, or one in every element."""

from __future__ import annotations

import re

TURN = re.compile(rb'"turnDeg": (\d+)')
SCALE = re.compile(rb'"vScale": ([\d.]+)')
CELL = re.compile(rb'"cellX": (\d+)')
TYPE = re.compile(rb'"type": "(\w+)"')

# what is wrong: the code to be found, a pattern, and what takes the place of what it matches
ONE = {
    "a comma is missing": ("TT101", CELL, rb'"cellX": \1 "x-": 0'),
    "a wrong type": ("TT105", SCALE, rb'"vScale": "\1"'),
    "an unknown name": ("TT201", TYPE, rb'"type": "\1s"'),
    "an unknown key": ("TT103", SCALE, rb'"vscale": \1'),
    "a duplicate key": ("TT102", TYPE, rb'"type": "\1", "type": "\1"'),
    "a number out of range": ("TT106", SCALE, rb'"vScale": 1e31'),
    "1e999": ("TT107", SCALE, rb'"vScale": 1e999'),
}
ALL = {
    "an unknown key": ("TT103", SCALE, rb'"vscale": \1'),
    "a wrong type": ("TT105", SCALE, rb'"vScale": "\1"'),
    "an unknown name": ("TT201", TYPE, rb'"type": "\1s"'),
    "out of the grid": ("TT203", CELL, rb'"cellX": 9\1'),
    "a duplicate key": ("TT102", TYPE, rb'"type": "\1", "type": "\1"'),
}
KINDS = {
    "clean": None,
    "a warning in every third element": ("TT213", TURN, rb'"turnDeg": \1', False),
    **{f"{what} near the end": (*how, True) for what, how in ONE.items()},
    **{f"{what} in every element": (*how, False) for what, how in ALL.items()},
}


def broken(data: bytes, kind: str) -> bytes:
    """The text of S3 with one kind of mistakes; only that of warnings trims elements."""
    if KINDS[kind] is None or KINDS[kind][1] is not TURN:
        data = TURN.sub(b'"turnDeg": 180', data)
    if KINDS[kind] is None:
        return data
    _, pattern, replacement, one = KINDS[kind]
    near_end = len(data) - 1000 if one else 0
    return data[:near_end] + pattern.sub(replacement, data[near_end:], count=int(one))
