"""Rules that the reader itself reports: the text, its keys and their types."""

from terratool.definition.rules.base import reader_rule

reader_rule(
    "TT101",
    "syntax",
    """
    The text is not JSON (RFC 8259).

    What comes after the first such place cannot be read with certainty, so it is the only finding.
    Most often a comma is missing or one too many, quotes are single, or a number has leading zeros.

    Fails:

        {"size": 10 "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Fails:

        {"size": 10, "elemTypes": {"hill": {"x": 'cos'}}, "elemTree": {"type": "hill"}}

    Fails:

        {"size": 010, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: the hint names what is missing or too much at that place.
    """,
)
reader_rule(
    "TT102",
    "duplicate-key",
    """
    A key stands twice in one object.

    JSON readers differ in which of the two they take, so the text means two things.

    Fails:

        {"size": 10, "size": 50, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Passes:

        {"size": 50, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: remove one of the two; a second surface or primitive wants a name of its own.
    """,
)
reader_rule(
    "TT103",
    "unknown-key",
    """
    A key that the format does not have.

    Most often it is a typo, and what was meant would silently be missing. Keys that begin with x-
    are yours: they are kept and mean nothing. The one exception is x-ignore, a list of codes of
    warnings that are not wanted for the object it stands in and for everything inside it.

    Fails:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "vscale": 2}}

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "vScale": 2}}

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "x-scale": 2}}

    To mend: write the key as the format spells it, or begin it with x-.
    """,
)
reader_rule(
    "TT105",
    "wrong-type",
    """
    A value has a type that its key does not take.

    A number in quotes is a text, and no key takes null: leave the key out instead.

    Fails:

        {"size": "10", "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: write what the hint asks for.
    """,
)
reader_rule(
    "TT106",
    "out-of-range",
    """
    A number lies outside the range of its key, or a text is none of those that its key takes.

    Most often a value is in another unit, or a sign or a decimal point is wrong.

    Fails:

        {"size": 0, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Fails:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "cells": 70000}}

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "cells": 65536}}

    To mend: the hint names the range; look whether the unit is the right one.
    """,
)
reader_rule(
    "TT107",
    "not-finite",
    """
    NaN, Infinity, or a number beyond the range of a 64-bit float.

    JSON has neither NaN nor Infinity. Where the ground is unknown, use a surface with "void": true.

    Fails:

        {"size": 10, "elemTypes": {"box": {"x": [1, NaN]}}, "elemTree": {"type": "box"}}

    Fails:

        {"size": 1e999, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Passes:

        {"size": 1e9, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: write a finite number, or leave the key out.
    """,
)
reader_rule(
    "TT108",
    "too-deep",
    """
    The text nests deeper than 10,000 levels of brackets, which is 5,000 levels of elements.

    Fails, 10,001 times:

        [

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Even grids of 2 × 2 cells shrink a kilometre below a grain of sand in 30 levels.

    To mend: give elements finer grids instead of more levels.
    """,
)
reader_rule(
    "TT109",
    "encoding",
    """
    The bytes are not UTF-8.

    JSON is always UTF-8; in another encoding names and descriptions would be read as other ones.

    Fails, in Latin-1:

        {"descr": "Gerät", "size": 1, "elemTypes": {"b": {"x": [1]}}, "elemTree": {"type": "b"}}

    Passes:

        {"descr": "Gerät", "size": 1, "elemTypes": {"b": {"x": [1]}}, "elemTree": {"type": "b"}}

    To mend: save the file as UTF-8.
    """,
)
reader_rule(
    "TT113",
    "unused-ignore",
    """
    An entry of x-ignore silences nothing.

    What it was for has been mended, or its code is misspelt, or it is that of an error, which
    cannot be ignored. An entry is the code of a warning or the beginning of codes, such as TT4.

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "x-ignore": ["TT208"]}
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "vScale": 0, "x-ignore": ["TT210"]}
        }

    To mend: remove the entry.
    """,
    "warning",
)
