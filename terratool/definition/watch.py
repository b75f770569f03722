"""Files that are checked again whenever they, or libraries that they use, change."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from pathlib import Path

from msgspec import Struct, structs

from terratool.definition.reader import Checked, CheckOptions, check, new_shelf
from terratool.text.source import read_source

EVERY = 0.5
"""s between two looks at the files."""

State = tuple[int, int, int] | None
"""Time of the last change in ns, bytes and number of a file; None where there is none."""


def pause(seconds: float) -> None:
    """Wait until it is time for another look."""
    time.sleep(seconds)


class _Seen(Struct):
    """What was found in a file, and how it and its libraries were then.

    Attributes:
        states: by their names, the file itself included.
        options: how closely it was looked at.
        checked: None where it could not be read.
    """

    states: dict[str, State]
    options: CheckOptions
    checked: Checked | None = None


class Watch:
    """Remembers what was found in files for as long as they stay as they are.

    Args:
        listed: names the files that are checked, as they are there now.
        every: s between two looks at them.
    """

    def __init__(self, listed: Callable[[], Iterable[str]], every: float = EVERY) -> None:
        self._listed = listed
        self._every = every
        self._seen: dict[str, _Seen] = {}

    def look(self, name: str, options: CheckOptions) -> Checked:
        """The findings in a file, which is read only if it has changed; then with what it says.

        Raises:
            ReadError: it cannot be read, or is no regular file.
        """
        seen = self._seen.get(name)
        if seen and seen.checked and seen.options == options and not _differs(seen):
            return seen.checked
        # a change from here on is one that was not seen; libraries are mostly those of before
        states = _states([name, *(seen.states if seen else ())])
        seen = self._seen[name] = _Seen({name: states[name]}, options)
        shelf = new_shelf(options)
        # what was a file may be a pipe by now
        checked = check(read_source(name, named=False), options, kind=None, shelf=shelf)
        for library in shelf.files:
            seen.states[library] = states[library] if library in states else _state(library)
        seen.checked = _without_model(checked)
        return checked

    def wait(self) -> dict[str, str]:
        """Wait until some of the files differ from what was looked at, and then for one pause.

        Returns:
            what became of each of them, libraries included, by its name.
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
            # what is still being written is left to be finished
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
    """The findings alone: what the files say is not needed any more."""
    libraries = tuple(map(_without_model, checked.libraries))
    return structs.replace(
        checked, vehicle=None, terrain=None, tree=None, document=None, libraries=libraries
    )


def _differs(seen: _Seen) -> bool:
    return _states(seen.states) != seen.states


def _states(names: Iterable[str]) -> dict[str, State]:
    return {name: _state(name) for name in names}


def _state(name: str) -> State:
    try:
        found = Path(name).stat()
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
