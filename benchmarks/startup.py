"""Start-up of commands against `import click` alone, whole processes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from measure import line, medians

SAMPLE = Path(__file__).parent.parent / "samples" / "paper-example.json"


def start(*arguments: str) -> object:
    return subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True)


if __name__ == "__main__":
    seconds = medians(
        {
            "click": lambda: start("-c", "import click"),
            "help": lambda: start("-m", "terratool", "--help"),
            "validate": lambda: start("-m", "terratool", "validate", str(SAMPLE)),
            "query": lambda: start("-m", "terratool", "query", str(SAMPLE), "15", "15"),
        },
        runs=15,
    )
    for name, target in (("help", "<= 2.5"), ("validate", "<= 2.5"), ("query", "none")):
        line(f"{name}, against import click", seconds[name] / seconds["click"], target)
