"""Rules: each is a generator of remarks; its docstring is its manual page.

A rule is registered by `rule` with its code, a name and a default severity. The runner alone adds
code, severity and position. What only the reader can see (syntax, duplicate keys, types) is
registered by `reader_rule`, so that every code is listed and explained in one place.

Codes: TT1xx the text and its keys, TT2xx names and cells, TT3xx curves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from inspect import cleandoc

from terratool.definition.findings import Remark, Severity
from terratool.definition.model import Definition
from terratool.definition.tree import Tree

_MODULES = ("reading", "presence", "ranges", "names", "placement", "curves")


@dataclass(frozen=True, slots=True)
class Subject:
    """What a rule looks at: a definition and its elements laid flat."""

    definition: Definition
    tree: Tree


Check = Callable[[Subject], Iterator[Remark]]


@dataclass(frozen=True, slots=True)
class Rule:
    """A code, its name, default severity and manual page, and the generator behind it."""

    code: str
    name: str
    severity: Severity
    manual: str
    check: Check | None


_rules: dict[str, Rule] = {}


def rule(code: str, name: str, severity: Severity = "error") -> Callable[[Check], Check]:
    """Register a generator as a rule."""

    def register(check: Check) -> Check:
        _rules[code] = Rule(code, name, severity, cleandoc(check.__doc__ or ""), check)
        return check

    return register


def reader_rule(code: str, name: str, manual: str, severity: Severity = "error") -> None:
    """Register a code that the reader itself reports."""
    _rules[code] = Rule(code, name, severity, cleandoc(manual), None)


@cache
def all_rules() -> dict[str, Rule]:
    """Every rule by its code, in the order of the codes."""
    for module in _MODULES:
        import_module(f"{__name__}.{module}")
    return dict(sorted(_rules.items()))
