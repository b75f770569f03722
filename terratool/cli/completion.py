"""`terratool completion`."""

from __future__ import annotations

import click

from terratool.cli.options import Names
from terratool.cli.saying import say_block

_SHELLS = ("bash", "zsh", "fish")


@click.command("completion", epilog='Example: eval "$(terratool completion bash)"')
@click.argument("shell", type=Names(_SHELLS), metavar="|".join(_SHELLS))
@click.pass_context
def command(ctx: click.Context, shell: str) -> None:
    """Print the script that has a shell complete terratool.

    It completes commands, options and their values, files, and the surfaces, primitives and parts
    of the file that stands in the line. To have it in every shell, add to ~/.bashrc the line
    eval "$(terratool completion bash)", to ~/.zshrc, behind compinit, eval "$(terratool completion
    zsh)", or for fish: terratool completion fish > ~/.config/fish/completions/terratool.fish. Bash
    has to be 4.4 or newer.
    """
    from terratool.cli.completing import script
    from terratool.cli.main import COMPLETE

    say_block(script(ctx.find_root().command, shell, COMPLETE), machine=True)
