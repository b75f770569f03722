"""The words of the language of curves, and what to write in place of words and signs of others."""

from __future__ import annotations

import re
from difflib import get_close_matches

from terratool.text.display import shown

NAMED = {
    "flat": "1",
    "ramp": "t",
    "tent": "1 - abs(2*t - 1)",
    "cos": "cos(pi*(t - 0.5))",
    "cosbell": "0.5 - 0.5*cos(2*pi*t)",
    "dome": "sqrt(1 - (2*t - 1)**2)",
    "gauss": "exp(-18*(t - 0.5)**2)",
    "smoothstep": "t**2*(3 - 2*t)",
}
"""Named curves as expressions."""

UNARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt",
    "abs",
)  # fmt: skip
VARIADIC = ("min", "max")

PRODUCT = "Write a product with *, as in 2*t."
DECIMAL_POINT = "Write a decimal number with a point, as in 1.5."
_POWER = "Write a power with **, as in t**2."
_BENDS = "Write a bend with min, max or abs, and a step with knots."
_FORMULA_ALONE = "Write the formula alone, without an equals sign."
_KNOWN = ("t", "pi", *UNARY, *VARIADIC)
_FUNCTIONS = " ".join(UNARY + VARIADIC)

INSTEAD_OF_CONDITIONS = dict.fromkeys(
    ("if", "else", "and", "or", "not", "in", "is", "where", "when", "mod"), _BENDS
)
_INSTEAD_OF_WORDS = {
    **INSTEAD_OF_CONDITIONS,
    **dict.fromkeys(("floor", "ceil", "round", "int", "sign", "step"), _BENDS),
    **dict.fromkeys(("pow", "power"), _POWER),
    "e": "Write exp(t) for e**t, and exp(1) for e alone.",
    "ln": "Write log, which is the natural logarithm.",
}
_INSTEAD_OF_SIGNS = {
    **dict.fromkeys("^⁰¹²³⁴⁵⁶⁷⁸⁹", _POWER),
    **dict.fromkeys("<>≤≥≠!?:&", _BENDS),
    **dict.fromkeys("×·", PRODUCT),
    **dict.fromkeys("−–", "Write the minus sign as a hyphen."),
    **dict.fromkeys("[]{}", "Write round parentheses."),
    **dict.fromkeys("'\"`", "Leave the quotation marks out."),
    "=": _FORMULA_ALONE,
    "÷": "Write a quotient with /, as in t/2.",
    "√": "Write a root with sqrt, as in sqrt(t).",
    "π": "Write it in letters: pi.",
    "|": "Write an absolute value with abs, as in abs(t).",
    ";": "Separate arguments with a comma.",
}


def instead_of_sign(text: str, at: int) -> str:
    """What to do about a character that belongs to no token."""
    sign = text[at]
    if sign == "[" and not text[:at].strip():
        return "Write a vector or knots without quotation marks around them."
    if sign == "=" and text[at + 1 : at + 2] == "=":
        return _BENDS
    if not sign.isprintable():
        return "Remove this invisible character, or write a space."
    return _INSTEAD_OF_SIGNS.get(
        sign, f"Use only numbers, t, pi, + - * / **, parentheses and {_FUNCTIONS}."
    )


def instead_of_word(word: str, before: str, behind: str) -> str:
    """What to do about a word that is not in the vocabulary, between two parts of a text."""
    small = word.lower()
    before, behind = before.strip(), behind.strip()
    alone = not before and not behind
    member = re.match(r"\.([A-Za-z]+)", behind)
    if member and member[1] in _KNOWN:
        return f"Write {member[1]} without {shown(word + '.')} before it."
    if small in _KNOWN or (alone and small in NAMED):
        return f"Write it in small letters: {small}."
    if small in _INSTEAD_OF_WORDS:
        return _INSTEAD_OF_WORDS[small]
    if re.match("=[^=]", behind):
        return _FORMULA_ALONE
    if len(word) == 1 and not behind.startswith("("):
        return "Write t, which is the only variable."
    close = get_close_matches(small[:20], (*_KNOWN, *NAMED) if alone else _KNOWN, 1, 0.75)
    if close:
        return f"Did you mean {close[0]}?"
    if alone:
        return f"Write an expression in t, or one of the names {' '.join(NAMED)}."
    return f"Use only t, pi and the functions {_FUNCTIONS}."
