"""Commands that show their options in groups, and guess what a wrong option means."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from shlex import quote as quote_word
from typing import Any, NamedTuple, TypeVar

import click

from terratool.text.display import quote
from terratool.text.meaning import guess, near_names

_Function = TypeVar("_Function", bound=Callable[..., Any])
_GROUPS = "__option_groups__"
_WIDEST = 30
"""Most characters of an option with its text beside it."""


class OptionGroup(NamedTuple):
    """Options under one heading of a page of help.

    Attributes:
        heading: text over them.
        options: names of their parameters.
        dense: whether their names alone are shown, several on a line.
    """

    heading: str
    options: tuple[str, ...]
    dense: bool = False


def option_group(
    heading: str, *options: Callable[[Any], Any], dense: bool = False
) -> Callable[[_Function], _Function]:
    """Decorator that adds options to a command under a heading of its help.

    Args:
        heading: text over the options.
        options: decorators of click, in the order of the help.
        dense: whether the help shows their names alone.
    """

    def decorate(function: _Function) -> _Function:
        before = len(_parameters(function))
        for option in reversed(options):
            function = option(function)
        added = reversed(_parameters(function)[before:])
        group = OptionGroup(heading, tuple(str(one.name) for one in added), dense)
        function.__dict__.setdefault(_GROUPS, []).insert(0, group)
        return function

    return decorate


def _parameters(function: Callable[..., Any]) -> list[click.Parameter]:
    found: list[click.Parameter] = getattr(function, "__click_params__", [])
    return found


def guess_option(word: str) -> str:
    """Sentence on the option of the running command that a word may mean; empty if none is."""
    return _guess(click.get_current_context().command, word)


def _guess(command: click.Command, word: str) -> str:
    options = [one for one in command.params if isinstance(one, click.Option)]
    names = [name for one in options for name in (*one.opts, *one.secondary_opts)]
    found = guess(word, [name for name in names if name.startswith("--")])
    if not found and near_names(word, ["--output"]):
        writing = [one.opts[0] for one in options if _writes_files(one)]
        if writing:
            return f"Files are written by {' or '.join(writing)}."
        return "What the command says goes to standard output. Write > FILE in place of it."
    return found


def _writes_files(option: click.Option) -> bool:
    """Whether an option of a command without an output of its own names files to write."""
    return option.opts[0] in ("--report", "--picture", "--format") and (
        option.multiple or option.metavar != "FORM"
    )


class Command(click.Command):
    """Command whose help has a heading for each group of options; those of no group come last."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse words; an unknown option is an error that guesses the option that was meant."""
        words = list(args)  # click takes them away
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            name = error.option_name
            # what click takes for several short options, as -tr
            name = next((word for word in words if word[:2] == name != word), name)
            raise click.UsageError(self.no_option(name), error.ctx or ctx) from error
        except click.UsageError as error:
            error.ctx = error.ctx or ctx
            option = _option_of(self, error)
            wrong = "" if option is None else _wrong_number(option, words)
            if wrong:
                raise click.UsageError(wrong, error.ctx) from error
            if error.message.startswith("Got unexpected extra argument") and self._only_says():
                out = next(
                    (
                        word
                        for word in reversed(words)
                        if word in error.message and _is_new_file(word)
                    ),
                    None,
                )
                if out is not None:
                    raise click.UsageError(
                        f"{quote(out)} is one argument too many: the result goes to standard "
                        f"output. Write > {quote_word(out)} in place of it.",
                        error.ctx or ctx,
                    ) from error
            raise

    def no_option(self, name: str) -> str:
        """Sentences on an option that there is not."""
        return f"There is no option {name}. {_guess(self, name)}".rstrip()

    def _only_says(self) -> bool:
        """Whether the command takes no output."""
        return not any(one.name == "output" for one in self.params)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, group by group."""
        options = {str(one.name): one for one in self.get_params(ctx) if _is_shown(one)}
        groups: list[OptionGroup] = list(getattr(self.callback, _GROUPS, ()))
        grouped = {name for group in groups for name in group.options}
        others = tuple(name for name in options if name not in grouped)
        groups.append(OptionGroup("Also" if groups else "Options", others))
        rows = {name: _row(option, ctx) for name, option in options.items()}
        listed = [rows[name][0] for group in groups if not group.dense for name in group.options]
        column = max(len(name) for name in listed if len(name) <= _WIDEST) + 2
        formatter.write_paragraph()
        for group in groups:
            formatter.write(f"{group.heading}:\n")
            with formatter.indentation():
                if group.dense:
                    # a no-break space holds an option and its value together
                    names = [rows[name][0].replace(" ", "\u00a0") for name in group.options]
                    _write_plain(formatter, "  ".join(names))
                    continue
                for name in group.options:
                    for line in _lines(rows[name], column, formatter.width - 2):
                        formatter.write(f"  {line}\n")

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the example, whose words are whole on their lines, so that it can be copied."""
        if self.epilog is None or self.epilog.startswith("\b"):
            super().format_epilog(ctx, formatter)
            return
        formatter.write_paragraph()
        _write_plain(formatter, self.epilog)


def _option_of(command: click.Command, error: click.UsageError) -> click.Option | None:
    """Option of several values that an error is about; None if it is about something else."""
    options = [one for one in command.params if isinstance(one, click.Option) and one.nargs > 1]
    if isinstance(error, click.BadParameter):
        return next((one for one in options if one is error.param), None)
    name = error.option_name if isinstance(error, click.BadOptionUsage) else ""
    return next((one for one in options if name in one.opts), None)


def _wrong_number(option: click.Option, words: list[str]) -> str:
    """Sentences on an option without all of its numbers; empty if none lacks any."""
    names = {*option.opts}
    wanted = str(option.metavar)
    spread = [part for word in words for part in _split_off(word, names)]
    for place, word in enumerate(spread):
        if word not in names:
            continue
        given = []
        for number in spread[place + 1 : place + 1 + option.nargs]:
            if not _are_numbers(number):
                break
            given.append(number)
        few = len(given) < option.nargs
        # 0,17 in its place is a number with a wrong point
        if any("," in number if few else number.endswith(",") for number in given):
            return (
                f"{word} {' '.join(given)} has commas. Give {wanted} as separate words, without "
                "commas."
            )
        if few:
            after = spread[place + 1 + len(given) :][:1]
            before = f" before {quote(after[0])}" if after else ""
            return (
                f"{word} takes {option.nargs} numbers, {wanted}, not {len(given)}{before}. Give "
                "all of them as separate words."
            )
    return ""


def _split_off(word: str, names: set[str]) -> list[str]:
    """An option and the value behind its =, or else the word itself."""
    name, sign, value = word.partition("=")
    return [name, value] if sign and name in names else [word]


def _are_numbers(word: str) -> bool:
    """Whether a word is a number, or several with commas."""
    try:
        [float(part) for part in word.split(",") if part]
    except ValueError:
        return False
    return any(c.isalnum() for c in word)


def _is_new_file(word: str) -> bool:
    """Whether a word may be the name of a file that is to be written."""
    from pathlib import Path

    path = Path(word)
    return word[:1] != "-" and "\0" not in word and path.suffix[1:2].isalpha() and not path.exists()


def _write_plain(formatter: click.HelpFormatter, text: str) -> None:
    for line in _wrap(text, formatter.width - 2):
        formatter.write(f"  {line}\n".replace("\u00a0", " "))


def _wrap(text: str, width: int) -> list[str]:
    from textwrap import wrap

    return wrap(text, width, break_on_hyphens=False, break_long_words=False)


def _is_shown(parameter: click.Parameter) -> bool:
    return isinstance(parameter, click.Option) and not parameter.hidden


def _row(option: click.Parameter, ctx: click.Context) -> tuple[str, str]:
    """Names of an option with its value, and its text."""
    record = option.get_help_record(ctx)
    assert record is not None and isinstance(option, click.Option)
    names, text = record[0], option.help or ""
    if option.secondary_opts:
        names = "/".join((*option.opts, *option.secondary_opts))
    default = option.default
    if option.show_default and default is not None:
        shown = f"{default:g}" if isinstance(default, float) else str(default)
        text += f"  [default: {shown}]"
    return names, text + ("  [required]" if option.required else "")


def _lines(row: tuple[str, str], column: int, width: int) -> Iterator[str]:
    """Lines of an option: its names, and its text in a column beside them."""
    names, text = row
    lines = _wrap(text, max(width - column, 10)) or [""]
    if len(names) > _WIDEST:
        yield names
    else:
        yield f"{names:{column}}{lines.pop(0)}".rstrip()
    for line in lines:
        yield " " * column + line
