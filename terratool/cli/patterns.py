"""Patterns of file names in settings: what each matches, and what one without a match may mean."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from fnmatch import fnmatch

from terratool.text.display import quote

_ALIKE = 0.7
"""Least similarity, 0 to 1, of a misspelt pattern."""
_LONGEST = 500
"""Most characters of a pattern that is compared with others."""
_MOST = 100
"""Most folders that are tried."""


def is_match(pattern: str, path: str) -> bool:
    """Whether a pattern matches a path with slashes, or its name where the pattern has none."""
    return fnmatch(path if "/" in pattern else path.rpartition("/")[2], pattern)


def idle_patterns(patterns: Iterable[str], paths: Collection[str]) -> list[str]:
    """Patterns that match none of the paths."""
    return [pattern for pattern in patterns if not any(is_match(pattern, path) for path in paths)]


def hint_on(pattern: str, paths: Collection[str]) -> str:
    """Sentence on the pattern that one without a match may mean, or on how the paths look."""
    if not paths:
        return "Correct the pattern, or remove it."
    near = [one for one in _elsewhere(pattern, paths) if not idle_patterns([one], paths)]
    if not near and len(pattern) <= _LONGEST:
        from difflib import get_close_matches

        last = pattern.rpartition("/")[2]
        known = [f"{folder}/{last}" for folder in _folders(paths)] if "/" in pattern else []
        known = [one for one in known if not idle_patterns([one], paths)]
        names = paths if "/" in pattern else {path.rpartition("/")[2] for path in paths}
        near = get_close_matches(pattern, known or sorted(names), 1, _ALIKE)
    if near:
        return f"Did you mean {quote(near[0])}?"
    return f"Correct the pattern, or remove it: a file is {quote(min(paths))}."


def _elsewhere(pattern: str, paths: Collection[str]) -> list[str]:
    """Patterns of all in the folder that a pattern names, and of the same below other folders."""
    own, folders = pattern.rstrip("/"), _folders(paths)
    inside = [f"{folder}/*" for folder in folders if folder == own or folder.endswith(f"/{own}")]
    return inside + [f"{folder}/{pattern}" for folder in folders if "/" in own]


def _folders(paths: Collection[str]) -> list[str]:
    """Folders of paths, and those that hold them, the shortest names first."""
    parents = {path.rpartition("/")[0] for path in paths}
    parts = [parent.split("/") for parent in parents if parent]
    found = {"/".join(part[:end]) for part in parts for end in range(1, len(part) + 1)}
    return sorted(found, key=lambda one: (len(one), one))[:_MOST]
