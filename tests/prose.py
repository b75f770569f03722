"""Check that docstrings stand alone and that class names are unique: `python -m tests.prose`."""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]

FRAGMENT = re.compile(
    r"…|\.\.\.|[a-zà-ÿα-ω](?![\w.]*\()|"
    r"(What|How|Of|Those|Their|Its|Theirs|Likewise|So (many|much|often|long|far)|The same|And|Or|"
    r"Nor|But|As above|Also|Besides|More of|Then|It|They|Them|These|This|That)\b"
)
"""Beginnings of sentences that lean on a neighbour, or that name nothing."""

ENTRY = re.compile(r"^ {4,}[*\w][\w*, ]*(?:\([^)]*\))?: (?P<text>.+)$", re.MULTILINE)
"""An entry of `Args:` or `Attributes:` in Google's style."""


def docstrings(tree: ast.Module) -> Iterator[ast.Constant]:
    """All docstrings of a module, those below assignments included."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if not isinstance(body, list):
            continue
        scope = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        for before, here in zip([None, *body], body, strict=False):
            if not (isinstance(here, ast.Expr) and isinstance(here.value, ast.Constant)):
                continue
            attribute = isinstance(before, ast.Assign | ast.AnnAssign)
            if isinstance(here.value.value, str) and (attribute or (scope and before is None)):
                yield here.value


def faults(name: str, source: str) -> Iterator[str]:
    """Sentences on the docstrings of a file that do not stand alone."""
    for docstring in docstrings(ast.parse(source)):
        line, text = docstring.lineno, str(docstring.value)
        first = text.strip().partition("\n")[0]
        if FRAGMENT.match(first) or first.endswith("…") or text.rstrip().endswith("…"):
            yield f"{name}:{line}: {first!r} does not stand alone."
        for entry in ENTRY.finditer(text):
            if entry["text"].startswith(("…", "the same.", "likewise")):
                where = line + text[: entry.start()].count("\n")
                yield f"{name}:{where}: {entry[0].strip()!r} does not stand alone."


def repeated_classes(files: list[Path]) -> Iterator[str]:
    """Sentences on the names that several classes have."""
    places = defaultdict(list)
    for path in files:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{path.relative_to(ROOT)}:{node.lineno}")
    for name, at in sorted(places.items()):
        if len(at) > 1:
            yield f"{name} is the name of {len(at)} classes: {', '.join(at)}."


def main() -> int:
    """Print all faults; 1 if there are any."""
    files = sorted((ROOT / "terratool").rglob("*.py"))
    found = [*repeated_classes(files)]
    for path in files:
        found += faults(str(path.relative_to(ROOT)), path.read_text("utf-8"))
    print(*found, sep="\n", end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
