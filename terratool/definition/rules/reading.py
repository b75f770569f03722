"""What the reader itself reports: the text, its keys and their types."""

from terratool.definition.rules import reader_rule

reader_rule(
    "TT101",
    "syntax",
    """
    The text is no JSON (RFC 8259).

    Fails: ``{"size": 100 "elemTree": {}}`` (a comma is missing).
    Passes: ``{"size": 100, "elemTree": {}}``.
    """,
)
reader_rule(
    "TT102",
    "duplicate-key",
    """
    A key stands twice in one object; JSON readers differ in which one they take.

    Fails: ``{"size": 100, "size": 50}``.
    Passes: ``{"size": 100}``.
    """,
)
reader_rule(
    "TT103",
    "unknown-key",
    """
    A key that the format does not have: most often a typo. Keys that begin with ``x-`` are yours.

    Fails: ``{"type": "box", "cellx": 1}``.
    Passes: ``{"type": "box", "cellX": 1, "x-note": "surveyed 2015"}``.
    """,
)
reader_rule(
    "TT105",
    "wrong-type",
    """
    A value of a type that its key does not take.

    Fails: ``"cellX": "1"``.
    Passes: ``"cellX": 1``.
    """,
)
reader_rule(
    "TT107",
    "not-finite",
    """
    NaN, Infinity, or a number beyond the range of a 64-bit float.

    Fails: ``"vScale": 1e999``.
    Passes: ``"vScale": 1e9``.
    """,
)
reader_rule(
    "TT108",
    "too-deep",
    """
    The text nests deeper than 10,000 levels, which is 5,000 levels of elements.

    Fails: 100,000 opening brackets.
    Passes: 1,000 levels of elements.
    """,
)
reader_rule(
    "TT109",
    "encoding",
    """
    The bytes are no UTF-8.

    Fails: a name written in Latin-1.
    Passes: the same file saved as UTF-8.
    """,
)
