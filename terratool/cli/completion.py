"""`terratool completion`."""

from __future__ import annotations

import click

from terratool.cli.command import Command
from terratool.cli.options import WordChoice
from terratool.cli.saying import say_block

_SHELLS = ("bash", "zsh", "fish")


@click.command("completion", cls=Command, epilog='Example: eval "$(terratool completion bash)"')
@click.argument("shell", type=WordChoice(_SHELLS), metavar="|".join(_SHELLS))
@click.pass_context
def command(ctx: click.Context, shell: str) -> None:
    """Print the script that has a shell complete terratool.

    It completes commands, options, their words, and files. To have it in every shell, add to
    ~/.bashrc the line eval "$(terratool completion bash)", to ~/.zshrc, behind compinit, eval
    "$(terratool completion zsh)", or for fish: terratool completion fish >
    ~/.config/fish/completions/terratool.fish. Bash has to be 4.4 or newer.
    """
    from click.shell_completion import get_completion_class

    from terratool.cli.main import COMPLETE

    complete = get_completion_class(shell)
    assert complete is not None
    say_block(complete(ctx.find_root().command, {}, "terratool", COMPLETE).source(), machine=True)
