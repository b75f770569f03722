"""Formulas of one variable, `t` for curves: a language parsed and evaluated, never executed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any

from msgspec import Struct

from terratool.definition.listmath import LIST_FUNCTIONS
from terratool.text.display import quote

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
"""Expressions of the named curves."""

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
    """Hint for a character that belongs to no token."""
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
    """Hint for a word that is not in the vocabulary, between two parts of a text."""
    small = word.lower()
    before, behind = before.strip(), behind.strip()
    alone = not before and not behind
    member = re.match(r"\.([A-Za-z]+)", behind)
    if member and member[1] in _KNOWN:
        return f"Write {member[1]} without {quote(word + '.')} before it."
    if small in _KNOWN or (alone and small in NAMED):
        return f"Write it in small letters: {small}."
    if small in _INSTEAD_OF_WORDS:
        return _INSTEAD_OF_WORDS[small]
    if re.match("=[^=]", behind):
        return _FORMULA_ALONE
    if len(word) == 1 and not behind.startswith("("):
        return "Write t, which is the only variable."
    from difflib import get_close_matches

    close = get_close_matches(small[:20], (*_KNOWN, *NAMED) if alone else _KNOWN, 1, 0.75)
    if close:
        return f"Did you mean {close[0]}?"
    if alone:
        return f"Write an expression in t, or one of the names {' '.join(NAMED)}."
    return f"Use only t, pi and the functions {_FUNCTIONS}."


MAX_LENGTH = 500
MAX_DEPTH = 40
MAX_OPERATIONS = 128
"""Most passes over all t; a text has room for twice as many, which would take too long."""
CHECK_POINTS = 4097
MAX_VALUE = 1e9

_SIGNS = {"+": "add", "-": "sub", "*": "mul", "/": "div"}
BINARY = (*_SIGNS.values(), "pow")

_BLANKS = " \t\r\n"
_tokens = re.compile(
    r"[ \t\r\n]*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z_0-9]*)|(?P<sign>\*\*|[-+*/(),])|(?P<end>\Z)|(?P<other>.))"
).finditer
_decimal_comma = re.compile("[0-9],[0-9]").search

Op = tuple[str, float | int | None]


class ExpressionError(ValueError):
    """Error of an expression that does not parse, or is not finite, with a hint."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class Expression(Struct, frozen=True):
    """Parsed expression: its text, its program in postfix order, and the name of its variable."""

    text: str
    program: tuple[Op, ...]
    variable: str = "t"


@lru_cache(maxsize=4096)
def parse(text: str, variable: str = "t") -> Expression:
    """Parse a named curve or an expression in one variable.

    Args:
        text: the name or the expression.
        variable: name of the variable.

    Raises:
        ExpressionError: the text is too long, too deep or no expression.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {len(text)} characters, more than {MAX_LENGTH}",
            "Shorten it, or write the curve as a vector of samples.",
        )
    named = NAMED.get(text.strip(_BLANKS))
    try:
        parser = _Parser(text, variable) if named is None else _Parser(named, "t")
        return Expression(text, parser.program(), variable)
    except ExpressionError as error:
        hint = re.sub(r"\bt\b", variable, error.hint)
        raise ExpressionError(error.message, hint) from None


class _Parser:
    """Recursive-descent parser, bounded by MAX_DEPTH, with Python's precedence of operators."""

    def __init__(self, text: str, variable: str) -> None:
        self._text, self._variable = text, variable
        self._tokens = _tokens(text)
        self._ops: list[Op] = []
        self._depth = 0
        self._kind = self._value = self._taken = ""
        self._at = self._next_at = 0
        self._advance()

    def program(self) -> tuple[Op, ...]:
        if self._kind == "end":
            raise ExpressionError(
                "the expression is empty",
                "Write one in t, such as t*(1 - t), or the name of a curve, such as cosbell.",
            )
        self._sum()
        if self._kind != "end":
            raise self._no_operator()
        count = _operations(self._ops)
        if count > MAX_OPERATIONS:
            raise ExpressionError(
                f"the expression has {count} operations, more than {MAX_OPERATIONS}",
                "Simplify it, or write the curve as a vector of samples.",
            )
        return tuple(self._ops)

    def _advance(self) -> None:
        match = next(self._tokens)
        self._kind = str(match.lastgroup)
        self._value = match[self._kind]
        self._at, self._next_at = match.span(self._kind)
        if self._kind == "other":
            raise ExpressionError(
                f"{quote(self._value)} {self._place()} has no meaning in an expression",
                instead_of_sign(self._text, self._at),
            )

    def _place(self) -> str:
        return f"at character {self._at + 1}"

    def _take(self, *signs: str) -> str:
        if self._kind == "sign" and self._value in signs:
            sign, self._taken = self._value, self._place()
            self._advance()
            return sign
        return ""

    def _deeper(self, parse: Callable[[], None]) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ExpressionError(
                f"the expression nests deeper than {MAX_DEPTH} levels {self._taken}",
                "Simplify it, or write the curve as a vector of samples.",
            )
        parse()
        self._depth -= 1

    def _sum(self) -> None:
        self._product()
        while sign := self._take("+", "-"):
            self._product()
            self._ops.append((_SIGNS[sign], None))

    def _product(self) -> None:
        self._factor()
        while sign := self._take("*", "/"):
            self._factor()
            self._ops.append((_SIGNS[sign], None))

    def _factor(self) -> None:
        if self._take("-"):
            self._deeper(self._factor)
            self._ops.append(("neg", None))
            return
        self._atom()
        if self._take("**"):
            self._deeper(self._factor)  # right-associative, and 2**-1 is allowed
            self._ops.append(("pow", None))

    def _atom(self) -> None:
        if self._kind == "number":
            self._number()
        elif self._kind == "name" and self._value in (self._variable, "pi"):
            is_pi = self._value == "pi"
            self._ops.append(("number", math.pi) if is_pi else ("t", None))
            self._advance()
        elif self._kind == "name" and self._value in UNARY + VARIADIC:
            self._call()
        elif self._kind == "name":
            raise self._unknown_name()
        elif self._take("("):
            opened = self._taken
            self._deeper(self._sum)
            self._close(opened)
        else:
            raise self._no_value()

    def _number(self) -> None:
        number = float(self._value)
        if math.isinf(number):
            raise ExpressionError(
                f"the number {quote(self._value)} {self._place()} is too large",
                "Write a smaller one.",
            )
        self._ops.append(("number", number))
        self._advance()

    def _call(self) -> None:
        name = self._value
        function = f'the function "{name}" {self._place()}'
        example = f"{name}(t)" if name in UNARY else f"{name}(t, 0.5)"
        self._advance()
        if not self._take("("):
            hint = f"Write parentheses behind it, as in {example}."
            if name in NAMED:
                hint = f"Write {example}, or ({NAMED[name]}) for the named curve."
            raise ExpressionError(f"{function} has no argument in parentheses", hint)
        count, opened = 1, self._taken
        self._deeper(self._sum)
        while self._take(","):
            self._deeper(self._sum)
            count += 1
        self._close(opened)
        if name in UNARY and count != 1:
            decimal = _decimal_comma(self._text)
            raise ExpressionError(
                f"{function} takes one argument, not {count}",
                DECIMAL_POINT if decimal else f"Write {example}, with one argument.",
            )
        if name in VARIADIC and count == 1:
            raise ExpressionError(
                f"{function} takes two arguments or more, not 1", f"Write {example}, with two."
            )
        self._ops.append((name, count if name in VARIADIC else None))

    def _close(self, opened: str) -> None:
        if self._kind == "end":
            raise ExpressionError(f'the "(" {opened} is never closed', 'Close it with a ")".')
        if not self._take(")"):
            raise self._no_operator()

    def _unknown_name(self) -> ExpressionError:
        before, behind = self._text[: self._at], self._text[self._next_at :]
        named = self._value.lower()
        if named in NAMED and named not in UNARY and (before + behind).strip():
            return ExpressionError(
                f'the named curve "{self._value}" {self._place()} stands inside an expression',
                f"Write its formula in its place: ({NAMED[named]}).",
            )
        return ExpressionError(
            f"{quote(self._value)} {self._place()} is no known name",
            instead_of_word(self._value, before, behind),
        )

    def _no_value(self) -> ExpressionError:
        if self._kind == "end":
            end = len(self._text.rstrip(_BLANKS))
            return ExpressionError(
                f"the expression ends after character {end}, where a value is missing",
                "Write a number, t, pi, a function or a parenthesis there.",
            )
        hint = "Write a number, t, pi, a function or a parenthesis before it."
        if self._value == "+":
            hint = "Leave this plus sign out."
        return ExpressionError(
            f'there is no value before the "{self._value}" {self._place()}', hint
        )

    def _no_operator(self) -> ExpressionError:
        """Error for a complete value that is followed by something other than an operator."""
        if self._value == ")":
            return ExpressionError(
                f'the ")" {self._place()} closes nothing', 'Remove it, or write a "(" before it.'
            )
        if self._value == ",":
            decimal = _decimal_comma(self._text, self._at - 1, self._at + 2)
            return ExpressionError(
                f'the "," {self._place()} separates no arguments',
                DECIMAL_POINT if decimal else "Remove it: only min and max take several values.",
            )
        return ExpressionError(
            f"there is no operator before {quote(self._value)} {self._place()}",
            INSTEAD_OF_CONDITIONS.get(self._value, PRODUCT),
        )


def evaluate(expression: Expression, t: Any, functions: Mapping[str, Callable[..., Any]]) -> Any:
    """Run the program over `t` with `functions` for each operation; numbers stay scalars."""
    stack: list[Any] = []
    for name, operand in expression.program:
        if name == "number":
            stack.append(operand)
        elif name == "t":
            stack.append(t)
        else:
            count = _arity(name, operand)
            arguments = stack[len(stack) - count :]
            del stack[len(stack) - count :]
            stack.append(functions[name](*arguments))
    return stack.pop()


def _arity(name: str, operand: float | int | None) -> int:
    if name in VARIADIC:
        return int(operand or 0)
    return 2 if name in BINARY else 1


_TS = [i / (CHECK_POINTS - 1) for i in range(CHECK_POINTS)]


@lru_cache(maxsize=32)
def sample_values(expression: Expression) -> list[float]:
    """Values at 4,097 evenly spaced t; the list is shared and must not be changed."""
    values = evaluate(expression, _TS, LIST_FUNCTIONS)
    return values if isinstance(values, list) else [values] * CHECK_POINTS


def value_at(expression: Expression, number: float) -> float:
    """Value of an expression where its variable is a number."""
    return float(evaluate(expression, number, LIST_FUNCTIONS))


def _operations(program: Iterable[Op]) -> int:
    """Number of passes over all t: a term without t takes none, and a power counts as two."""
    count = 0
    varying: list[bool] = []
    for name, operand in program:
        if name in ("number", "t"):
            varying.append(name == "t")
            continue
        arity = _arity(name, operand)
        varies = any(varying[-arity:])
        varying[-arity:] = [varies]
        if varies:
            count += 2 if name == "pow" else max(1, arity - 1)
    return count


def check(expression: Expression) -> None:
    """Check that values are finite and below 1e9 in size at 4,097 evenly spaced t.

    Raises:
        ExpressionError: values are not; the message names the first such t.
    """
    values = sample_values(expression)
    if all(map(MAX_VALUE.__gt__, map(abs, values))):  # false for NaN
        return
    for t, value in zip(_TS, values, strict=True):
        if not abs(value) < MAX_VALUE:
            what = f"reaches {value:.3g}" if math.isfinite(value) else "is not a finite number"
            raise ExpressionError(
                f"the expression {what} at {expression.variable} = {t:g}",
                f"Keep it finite and below 1e9 for every {expression.variable} from 0 to 1.",
            )
