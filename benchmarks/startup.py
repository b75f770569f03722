"""Start-up of commands, whole processes: against `import click` and `import numpy` alone.

With `--fresh`, the first run of each in a new virtual environment against the second, too.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
import venv
from functools import partial
from pathlib import Path

from measure import line, medians

MODULES = "click", "numpy"
SAMPLE = Path(__file__).resolve().parent.parent / "samples" / "paper-example.json"


COURSE, VEHICLE = SAMPLE.with_name("obstacle-course.json"), "samples/vehicles/husky-a200.json"
ROOT = SAMPLE.parents[1]


def commands(out: Path) -> dict[str, list[str]]:
    """What is started, by name."""
    return {
        "--help": ["--help"],
        "validate": ["validate", str(SAMPLE)],
        "query": ["query", str(SAMPLE), "15", "15"],
        "info": ["info", str(SAMPLE)],
        "export-dem": ["export-dem", str(SAMPLE), str(out / "a.tif"), "--overwrite"],
        "export-mesh": ["export-mesh", str(SAMPLE), str(out / "a.obj"), "--overwrite"],
    }


def longer(out: Path) -> dict[str, list[str]]:
    """What takes longer than to start, from files of the others."""
    return {
        "traversability": ["traversability", str(COURSE), "--vehicle", str(ROOT / VEHICLE)],
        "import-terrain": [
            "import-terrain", str(out / "a.tif"), str(out / "b.json"), "--max-error", "0.01",
            "--overwrite",
        ],
    }  # fmt: skip


KEPT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
"""The environment of users, in which Python keeps what it has compiled."""


def run(python: Path | str, *arguments: str, cwd: Path | None = None) -> object:
    return subprocess.run([python, *arguments], capture_output=True, check=True, cwd=cwd, env=KEPT)


def fresh(folder: Path) -> None:
    """The first run of each command after installing, against the second."""
    venv.create(folder / "venv", with_pip=True)
    python = folder / "venv" / "bin" / "python"
    run(python, "-m", "pip", "install", "-qq", str(ROOT))
    for name, arguments in (commands(folder) | longer(folder)).items():
        seconds = []
        for _ in range(2):
            begin = time.perf_counter()
            run(python, "-m", "terratool", *arguments, cwd=folder)  # not the checkout
            seconds.append(time.perf_counter() - begin)
        line(f"{name}, first time against the second ({seconds[1]:.2f} s)",
             seconds[0] / seconds[1], "1")  # fmt: skip


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        KEPT["PYTHONPYCACHEPREFIX"] = str(folder / "compiled")
        tasks = {
            name: partial(run, sys.executable, "-m", "terratool", *arguments)
            for name, arguments in commands(folder).items()
        }
        plain = {name: partial(run, sys.executable, "-c", f"import {name}") for name in MODULES}
        seconds = medians(plain | tasks, runs=15)
        for name in ("--help", "validate"):
            line(f"{name}, against import click", seconds[name] / seconds["click"], "<= 2.5")
        for name in ("query", "info", "export-dem", "export-mesh"):
            target = "<= 5" if name in ("query", "info") else "none"
            line(f"{name} ({seconds[name]:.2f} s), against import numpy",
                 seconds[name] / seconds["numpy"], target)  # fmt: skip
        if "--fresh" in sys.argv:
            fresh(folder)


if __name__ == "__main__":
    main()
