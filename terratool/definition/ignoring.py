"""`x-ignore`: a list of codes in an object silences warnings about it and what is in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from terratool.definition.built import Owner
from terratool.definition.findings import Remark, shown
from terratool.definition.rules import Rule
from terratool.definition.tree import Tree


class Ignores:
    """The `x-ignore` lists of a definition, and which of their entries were of use."""

    def __init__(self, lists: list[tuple[Owner, Any]]) -> None:
        self._lists = lists
        self._used: set[tuple[Owner, int]] = set()
        self._codes = [
            (owner, index, code)
            for owner, listed in lists
            if isinstance(listed, list)
            for index, code in enumerate(listed)
            if isinstance(code, str) and code
        ]

    def __bool__(self) -> bool:
        return bool(self._lists)

    def others(self, code: str, remarks: Iterable[Remark], tree: Tree) -> Iterator[Remark]:
        """The warnings that no list around them silences; the lists that do are of use."""
        scopes = [
            (owner, index, _pointer(owner, tree) + "/")
            for owner, index, listed in self._codes
            if code.startswith(listed)
        ]
        for remark in remarks:
            pointer = _pointer(remark.element, tree) + remark.pointer + "/"
            silencing = [
                (owner, index) for owner, index, scope in scopes if pointer.startswith(scope)
            ]
            self._used.update(silencing)
            if not silencing:
                yield remark

    def unused(self, rules: Mapping[str, Rule], idle: frozenset[str]) -> Iterator[Remark]:
        """A remark on each entry that is none, or that silenced nothing.

        Args:
            rules: all rules by code.
            idle: codes of those that did not look this time.
        """
        for owner, listed in self._lists:
            if not isinstance(listed, list):
                yield _remark(owner, "", "it is no list.", 'Write a list of codes, as ["TT208"].')
                continue
            for index, code in enumerate(listed):
                if (owner, index) not in self._used and code not in list(idle):  # may be unhashable
                    yield _remark(owner, f"/{index}", *_why(code, rules))


def _why(code: Any, rules: Mapping[str, Rule]) -> tuple[str, str]:
    if not isinstance(code, str):
        return "an item is no code.", 'Write a text such as "TT208".'
    meant = [rule for rule in rules.values() if code and rule.code.startswith(code)]
    if not meant:
        return f"no rule has the code {shown(code)}.", "See terratool rules for the codes."
    if all(rule.severity == "error" for rule in meant):
        return (
            f"{shown(code)} is an error, which cannot be ignored.",
            "Mend it, and remove the code.",
        )
    return f"{shown(code)} silences nothing here.", "Remove it."


def _remark(owner: Owner, rest: str, message: str, hint: str) -> Remark:
    pointer, message = f"/x-ignore{rest}", f'in "x-ignore", {message}'
    if isinstance(owner, int):
        return Remark(pointer, message, hint, element=owner)
    return Remark(owner + pointer, message, hint)


def _pointer(owner: Owner, tree: Tree) -> str:
    if isinstance(owner, int):
        return tree.pointer(owner) if owner >= 0 else ""
    return owner
