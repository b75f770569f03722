"""Watch over files that are checked again whenever they, or their libraries, change."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from pathlib import Path

from msgspec import Struct, structs

from terratool.definition.reader import Checked, CheckOptions, check, new_shelf
from terratool.text.source import read_source

EVERY = 0.5
"""Time between two looks at the files, s."""

State = tuple[int, int, int] | None
"""Time of the last change in ns, bytes and inode of a file; None where there is no file."""


def pause(seconds: float) -> None:
    """Wait for a time in seconds; a function of its own for tests."""
    time.sleep(seconds)


class _FileCheck(Struct):
    """Result of a check of a file, and the states of the file and its libraries at that time.

    Attributes:
        states: states by the names of the files, the checked file included.
        options: options of the check.
        checked: result of the check; None where the file could not be read.
    """

    states: dict[str, State]
    options: CheckOptions
    checked: Checked | None = None


class Watch:
    """Results of checks of files, kept for as long as the files stay as they are.

    Args:
        listed: function that names the files to check, as they are there now.
        every: time between two looks at the files, s.
    """

    def __init__(self, listed: Callable[[], Iterable[str]], every: float = EVERY) -> None:
        self._listed = listed
        self._every = every
        self._seen: dict[str, _FileCheck] = {}

    def look(self, name: str, options: CheckOptions) -> Checked:
        """Result for a file, which is read only if it has changed; a kept result has no model.

        Raises:
            ReadError: the file cannot be read, or is no regular file.
        """
        seen = self._seen.get(name)
        if seen and seen.checked and seen.options == options and not _differs(seen):
            return seen.checked
        # later changes count as unseen; the libraries are mostly those of before
        states = _states([name, *(seen.states if seen else ())])
        seen = self._seen[name] = _FileCheck({name: states[name]}, options)
        shelf = new_shelf(options)
        # a pipe may stand where a file was
        checked = check(read_source(name, named=False), options, kind=None, shelf=shelf)
        for library in shelf.files:
            seen.states[library] = states[library] if library in states else _state(library)
        seen.checked = _without_model(checked)
        return checked

    def wait(self) -> dict[str, str]:
        """Wait until some files differ from the last look, and then for a pause without changes.

        Returns:
            Change of each file, libraries included, in words, by its name.
        """
        before: dict[str, dict[str, State]] = {}
        while True:
            pause(self._every)
            listed = list(self._listed())
            now = {
                name: _states(self._seen[name].states if name in self._seen else [name])
                for name in listed
            }
            changed = [
                name for name in listed
                if name not in self._seen or now[name] != self._seen[name].states
            ]  # fmt: skip
            gone = self._seen.keys() - set(listed)
            # files that are still being written are left to be finished
            if (changed or gone) and now == before:
                told = dict.fromkeys(sorted(gone), "is gone")
                for name in changed:
                    old = self._seen[name].states if name in self._seen else {}
                    for file, state in now[name].items():
                        if state != old.get(file):
                            told[file] = _became(old.get(file), state)
                for name in gone:
                    del self._seen[name]
                return told
            before = now


def _became(old: State, new: State) -> str:
    return "is gone" if new is None else "is new" if old is None else "has changed"


def _without_model(checked: Checked) -> Checked:
    """Result of a check with its findings alone."""
    libraries = tuple(map(_without_model, checked.libraries))
    return structs.replace(
        checked, vehicle=None, terrain=None, tree=None, document=None, libraries=libraries
    )


def _differs(seen: _FileCheck) -> bool:
    return _states(seen.states) != seen.states


def _states(names: Iterable[str]) -> dict[str, State]:
    return {name: _state(name) for name in names}


def _state(name: str) -> State:
    try:
        found = Path(name).stat()
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
