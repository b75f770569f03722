"""What shells complete: files, names that a file knows, codes, targets and formats.

Click has the protocol and the scripts. What a parameter takes follows from its name, which means
the same in every command, but for formats; so commands need not know of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import click
from click.shell_completion import (
    BashComplete,
    CompletionItem,
    FishComplete,
    ShellComplete,
    ZshComplete,
    add_completion_class,
)

from terratool.definition.libraries import Dictionary

Items = list[CompletionItem[str]]
_DEFINITION = "definition"
"""The type of items that stand for *.json and *.json.gz; click has "file" and "dir" itself."""


class _Completing(ShellComplete):
    """Completes by the names of parameters where click itself knows nothing.

    A shell shows nothing where anything goes wrong: a person is in the middle of a line.
    """

    def get_completions(self, args: list[str], incomplete: str) -> Items:
        try:
            return self._completions(args, incomplete)
        except Exception:
            return []

    def _completions(self, args: list[str], incomplete: str) -> Items:
        from click.shell_completion import _resolve_context, _resolve_incomplete

        ctx = _resolve_context(self.cli, self.ctx_args, self.prog_name, args)
        asked, incomplete = _resolve_incomplete(ctx, args, incomplete)
        items = asked.shell_complete(ctx, incomplete)
        if not items and isinstance(asked, click.Parameter):
            if isinstance(asked, click.Option):
                # click gives up on the whole line where the last option has no value yet
                while args and args.pop() not in asked.opts:
                    pass
                ctx = _resolve_context(self.cli, self.ctx_args, self.prog_name, args)
            items = _items_for(asked.name or "", ctx, incomplete)
        return items

    def plain_type(self, item: CompletionItem[str]) -> str:
        """The type of an item, as far as the script knows it."""
        known = item.type != _DEFINITION or _DEFINITION in self.source_template
        return item.type if known else "file"


class _Bash(_Completing, BashComplete):
    source_template = BashComplete.source_template.replace(
        "read type value", "read -r type value"
    ).replace(
        "elif [[ $type == 'plain' ]]",
        """elif [[ $type == 'definition' ]]; then
            compopt -o filenames
            COMPREPLY=($(compgen -d -- "$value"; compgen -f -X '!*.json' -- "$value"
                compgen -f -X '!*.json.gz' -- "$value"))
            (( ${#COMPREPLY[@]} )) || compopt -o default
        elif [[ $type == 'plain' ]]""",
    )

    def source(self) -> str:
        return ShellComplete.source(self)  # that of click starts a bash to ask for its version

    def format_completion(self, item: CompletionItem[str]) -> str:
        value = item.value
        if item.type == "plain":  # bash inserts it as it is
            value = "".join(c if c.isalnum() or c in "-_+=./:@,|" else f"\\{c}" for c in value)
        return f"{self.plain_type(item)},{value}"


class _Zsh(_Completing, ZshComplete):
    source_template = ZshComplete.source_template.replace(
        """elif [[ "$type" == "file" ]]""",
        """elif [[ "$type" == "definition" ]]; then
            _files -g "*.json(|.gz)"
        elif [[ "$type" == "file" ]]""",
    )

    def format_completion(self, item: CompletionItem[str]) -> str:
        item.type = self.plain_type(item)
        return super().format_completion(item)


class _Fish(_Completing, FishComplete):
    source_template = FishComplete.source_template.replace(
        'string split "," $completion', 'string split -m 1 "," $completion'
    ).replace(
        """else if test $metadata[1] = "file";""",
        """else if test $metadata[1] = "definition";
            __fish_complete_path $metadata[2] |
                string match -r '^.*(?:/|\\.json|\\.json\\.gz)(?:\\t.*)?$';
        else if test $metadata[1] = "file";""",
    )

    def format_completion(self, item: CompletionItem[str]) -> str:
        item.type = self.plain_type(item)
        return super().format_completion(item)


SHELLS: dict[str, type[ShellComplete]] = {"bash": _Bash, "zsh": _Zsh, "fish": _Fish}


def register() -> None:
    """Have click use these, in place of its own."""
    for shell in SHELLS.values():
        add_completion_class(shell)


def script(cli: click.Command, shell: str, variable: str) -> str:
    """The script that has a shell complete the command `terratool`.

    Args:
        cli: the command.
        shell: a key of `SHELLS`.
        variable: of the environment, by which the shell asks.
    """
    return SHELLS[shell](cli, {}, "terratool", variable).source()


# --- what parameters take ------------------------------------------------------------------------


def _items_for(name: str, ctx: click.Context, incomplete: str) -> Items:
    if name in _FILES:
        return [CompletionItem(incomplete, type=_FILES[name])]
    if name in _NAMES:
        values: Iterable[str] = _names(ctx, _NAMES[name])
    elif name in _WORDS:
        values = _WORDS[name](ctx)
    else:
        return []
    # of a list only the last word is completed
    before, comma, last = incomplete.rpartition(",") if name in _LISTS else ("", "", incomplete)
    # what cannot be printed cannot be typed, and a line feed would begin another item
    found = [v for v in values if v.isprintable() and v.lower().startswith(last.lower())]
    return [CompletionItem(f"{before}{comma}{value}") for value in found]


_FILES = {
    **dict.fromkeys(
        ("file", "files", "spec", "vehicle", "vehicles", "sensor_file", "into", "baseline"),
        _DEFINITION,
    ),
    **dict.fromkeys(
        ("output", "source", "points", "path_file", "waypoints", "reports", "map_", "surfaces",
         "picture", "config_file", "tiles"),
        "file",
    ),
    "folder": "dir",
    "library_root": "dir",
}  # fmt: skip
"""Parameters that are files or folders."""
_NAMES: dict[str, Dictionary] = {
    "surface": "surfTypes", "kind": "elemTypes", "name": "elemTypes", "part": "parts",
}  # fmt: skip
"""Parameters that are names which the file knows that was named before."""
_READ = ("file", "into", "files")
"""Parameters that name such a file."""
_LISTS = ("select", "ignore")
"""Parameters that may hold several values, with commas between them."""


def _names(ctx: click.Context, dictionary: Dictionary) -> list[str]:
    from terratool.definition.outline import names_in

    for parameter in _READ:
        value = ctx.params.get(parameter)
        file = value[0] if isinstance(value, tuple) and value else value
        if isinstance(file, str):
            return names_in(Path(file).expanduser())[dictionary]
    return []


def _codes(_: click.Context) -> list[str]:
    from terratool.definition.rules import RULES

    return list(RULES)


def _targets(_: click.Context) -> list[str]:
    from terratool.simulators.targets import TARGETS

    return [*TARGETS, "all"]


def _formats(ctx: click.Context) -> list[str]:
    if ctx.command.name == "diff":
        from terratool.cli.diff import FORMATS

        return list(FORMATS)
    from terratool.cli.report import REPORTERS

    return list(REPORTERS)


def _conditions(_: click.Context) -> list[str]:
    from terratool.traversability.conditions import WORDS

    return list(WORDS)


_WORDS: dict[str, Callable[[click.Context], list[str]]] = {
    "code": _codes, "select": _codes, "ignore": _codes, "targets": _targets, "formats": _formats,
    "conditions": _conditions,
}  # fmt: skip
"""Parameters that are words of the tool."""
