"""100,000 strings as curves: each ends in finite values or in a finding, in at most 50 ms.

Run `python benchmarks/expressions.py [seed]`; it exits with 1 if a string breaks the promise.
"""

from __future__ import annotations

import json
import math
import random
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import chain, repeat

from terratool.definition import expression
from terratool.definition.accuracy import survey
from terratool.definition.expression import NAMED, UNARY, VARIADIC
from terratool.definition.listmath import LIST_FUNCTIONS
from terratool.definition.reader import check
from terratool.text.source import Source

LIMIT = 0.050
LEAVES = ["t"] * 8 + ["pi", "0", "1", "2", ".5", "3.", "1e-3", "9e9", "9e99", "1e307", "4e-324"]
SIGNS = ["+", "-", "*", "/", "**", " + ", "\t*\n"]
SCRAPS = [
    *LEAVES, *SIGNS, *NAMED, *UNARY, *VARIADIC, "(", ")", ",", " ", ".", "e", "E+", "^", "²", "π",
    "=", "<", "[", "]", "'", '"', "\\", "\0", "\u00a0", "\ud800", "😀", "_", "x", "np.", "if ",
    "lambda t:", "__import__('os')", "9**9**9**9", "inf", "nan", "1_0", "0x1", "1j", "#", ";",
]  # fmt: skip
WRAPS = [
    "({})", "-{}", "({})**1", "({})**2", "({})**.5", "2**({})", "1/({})", "({})/0", "({})*9",
    "t-({})", "min({},t)", "max(t,{})", *(f"{name}({{}})" for name in UNARY),
]  # fmt: skip
UNITS = [  # nowhere finite or no number, or as small as numbers get, which takes longest
    "t", "-t", "t/0", "log(-t)**0", "1/(1/(t-t))", "0**-t", "1/(1e9+t)**99", "(0*t-2)**1025",
    "(2+0*t)**1024", "9e9**1e307**t", "sqrt(-1-t)**0", "tan(1/(t-t))**0", "1/sinh(9e9*t)**2",
    "tan(9e9*t)", "asin(2+t)**0", "min(t,-t,t)", "(t/9e307)**1", "log(t/9e307)", "t/9e307/9*9/9*9",
]  # fmt: skip
LONGEST = [
    *(character * 1_000_000 for character in '(-t9 "\0π😀'), "9" + "**9" * 333_333,
    "sin(" * 250_000, "9**9**9**9", "9" + "**9" * 40, "(" * 500, "min(t" + ",t" * 128 + ")",
    "t/9e307" + "/9*9" * 63, "t/9e307" + "/9*9" * 123,
    *("(" * 40 + "t/9e307" + ")**1" * 40 + "/9" * count for count in (47, 145)),
]  # fmt: skip


def formula(rng: random.Random, depth: int) -> str:
    """A text of the grammar."""
    kind = rng.randrange(10)
    if depth == 0 or kind < 2:
        return rng.choice(LEAVES)
    inner = formula(rng, depth - 1)
    if kind < 6:
        other = formula(rng, depth - 1)
        if rng.random() < 0.3:
            inner, other = f"({inner})", f"({other})"
        return inner + rng.choice(SIGNS) + other
    if kind == 6:
        return f"-({inner})"
    if kind == 7:
        more = "".join(f",{formula(rng, depth - 1)}" for _ in range(rng.randint(1, 3)))
        return f"{rng.choice(VARIADIC)}({inner}{more})"
    return f"{rng.choice(UNARY)}({inner})"


def mutated(rng: random.Random) -> str:
    """A text of the grammar with one to four mistakes."""
    text = rng.choice([*NAMED, *NAMED.values()]) if rng.random() < 0.2 else formula(rng, 4)
    for _ in range(rng.randint(1, 4)):
        at = rng.randint(0, len(text))
        to = min(len(text), at + rng.randint(0, 6))
        middle = rng.choice(["", rng.choice(SCRAPS), text[at:to] * 2, text[at:to][::-1]])
        text = text[:at] + middle + text[to:]
    return text


def noise(rng: random.Random) -> str:
    """Tokens, bytes or characters at random."""
    length = int(rng.expovariate(1 / 12))
    kind = rng.randrange(3)
    if kind == 0:
        return "".join(rng.choice(SCRAPS) for _ in range(length))
    if kind == 1:
        return rng.randbytes(length).decode("latin-1")
    return "".join(chr(rng.randrange(sys.maxunicode + 1)) for _ in range(length))


def heavy(rng: random.Random) -> str:
    """A text that comes close to the limits: repeated, or wrapped over and over."""
    text = formula(rng, 2)
    if rng.random() < 0.5:
        wrap = rng.choice(WRAPS)
        for _ in range(rng.randint(1, 40)):
            text = wrap.format(text)
    return repeated(text, rng.choice(SIGNS[:4]))


def repeated(unit: str, sign: str) -> str:
    """As many of a text as the format allows."""
    count = 500 // (len(unit) + 1)
    while count > 1:
        try:
            expression.parse(sign.join([unit] * count))
            break
        except expression.ExpressionError:
            count -= 1
    return sign.join([unit] * max(count, 1))


def long(rng: random.Random) -> str:
    """A thousand to a million characters."""
    length = int(10 ** rng.uniform(3, 6))
    piece = rng.choice([rng.choice(SCRAPS), formula(rng, 3) + "+", noise(rng) or "t"])
    return (piece * (length // len(piece) + 1))[:length]


def strings(rng: random.Random) -> Iterator[tuple[str, str]]:
    """100,000 pairs of a kind and a text."""
    worst = LONGEST + [repeated(unit, sign) for unit in UNITS for sign in SIGNS[:4]]
    makers: list[tuple[str, int, Callable[[random.Random], str]]] = [
        ("grammar", 35_000, lambda rng: formula(rng, rng.randint(1, 6))),
        ("mutated", 40_000, mutated),
        ("noise", 22_000, noise),
        ("heavy", 2_500, heavy),
        ("long", 500 - len(worst), long),
    ]
    return chain(
        zip(repeat("worst"), worst),
        ((kind, make(rng)) for kind, count, make in makers for _ in range(count)),
    )


def spelled(text: str) -> bytes:
    """A terrain with the text as a curve; halves of surrogate pairs have to be escaped."""
    terrain = {"size": 1, "elemTypes": {"a": {"x": text}}, "elemTree": {"type": "a"}}
    try:
        return json.dumps(terrain, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        return json.dumps(terrain).encode()


def fault(text: str) -> tuple[str, float, bool]:
    """What is wrong with the outcome ("" if nothing), the seconds it took, whether it is valid."""
    source = Source("fuzz.json", spelled(text))
    for cached in (expression.parse, expression.sample_values, survey):
        cached.cache_clear()
    begin = time.perf_counter()
    try:
        checked = check(source)
    except BaseException as error:
        return f"ends in {error!r}", 0.0, False
    seconds = time.perf_counter() - begin
    if checked.definition is None:
        said = checked.findings and all(f.message and f.hint for f in checked.findings)
        return "" if said else "is refused without a word", seconds, False
    values = expression.evaluate(expression.parse(text), [0.0, 0.5, 1.0], LIST_FUNCTIONS)
    values = values if isinstance(values, list) else [values]
    good = all(math.isfinite(value) and abs(value) < expression.MAX_VALUE for value in values)
    return "" if good else "is valid without being finite", seconds, True


def main(seed: int) -> int:
    """Try them all, and print what each kind came to."""
    tried: Counter[str] = Counter()
    valid: Counter[str] = Counter()
    slowest: dict[str, tuple[float, str]] = {}
    faults = 0
    for kind, text in strings(random.Random(seed)):
        wrong, seconds, is_valid = fault(text)
        for _ in range(3):  # something else may have had the machine
            if wrong or seconds <= LIMIT / 2:
                break
            seconds = min(seconds, fault(text)[1])
        if seconds > LIMIT:
            wrong = f"takes {seconds * 1000:.0f} ms"
        tried[kind] += 1
        valid[kind] += is_valid
        slowest[kind] = max(slowest.get(kind, (0.0, "")), (seconds, text))
        if wrong:
            faults += 1
            print(f"{text[:500]!a} {wrong}")
    for kind, count in tried.items():
        seconds, text = slowest[kind]
        print(
            f"{kind:8} {count:6} strings, {valid[kind]:6} of them curves; the slowest took "
            f"{seconds * 1000:5.1f} ms: {text[:40]!a}"
        )
    print(f"{sum(tried.values())} strings with seed {seed}, {faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 1))
