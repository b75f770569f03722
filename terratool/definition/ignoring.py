"""`x-ignore`: a list of codes in an object silences warnings about it and what is in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from terratool.definition.built import Owner
from terratool.definition.findings import Remark
from terratool.text.display import shown
from terratool.definition.rules import Rule
from terratool.definition.tree import Tree


class IgnoreLists:
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
        lists: dict[Owner, list[tuple[Owner, int]]] = {}
        for owner, index, listed in self._codes:
            if code.startswith(listed):
                lists.setdefault(owner, []).append((owner, index))
        if not lists:
            yield from remarks
            return
        silent: dict[Owner, bool] = {}  # what is known of owners, and so of all in them
        for remark in remarks:
            path: list[Owner] = []
            around: Owner | None = _owner(remark)
            while around is not None and around not in silent:
                path.append(around)
                around = _around(around, tree)
            silenced = around is not None and silent[around]
            for inner in reversed(path):
                self._used.update(lists.get(inner, ()))
                silenced = silent[inner] = silenced or inner in lists
            if not silenced:
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


def _owner(remark: Remark) -> Owner:
    """The innermost object around a remark, of those that may have a list."""
    if remark.element >= 0:
        return remark.element
    return "/".join(remark.pointer.split("/", 3)[:3])


def _around(owner: Owner, tree: Tree) -> Owner | None:
    """The next one out."""
    if isinstance(owner, int):
        parent = tree.parents[owner]
        return parent if parent >= 0 else ""
    return owner.rpartition("/")[0] if owner else None
