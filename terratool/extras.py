"""How what an extra brings is installed."""

from __future__ import annotations

import sys


def install_command(*extras: str) -> str:
    """The command that adds extras to this installation, for any shell.

    The interpreter in use runs pip, as another one would install for itself; what it has of
    terratool stays, so nothing is looked for on an index but what is missing.

    Args:
        extras: names of them, as in pyproject.toml.
    """
    python = sys.executable or "python"
    python = f'"{python}"' if " " in python else python
    return f'{python} -m pip install "terratool[{",".join(extras)}]"'
