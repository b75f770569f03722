"""The command that installs an extra."""

from __future__ import annotations

import sys


def install_command(*extras: str) -> str:
    """Return the command that adds extras to this installation, for any shell.

    The interpreter in use runs pip, as another one would install for itself. The installed
    terratool stays, so an index is asked for missing packages only.

    Args:
        extras: names of extras, as in pyproject.toml.
    """
    python = sys.executable or "python"
    python = f'"{python}"' if " " in python else python
    return f'{python} -m pip install "terratool[{",".join(extras)}]"'
