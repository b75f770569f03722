"""Helpers to run the command line as a user does, and a terrain whose answers are known."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from click.testing import CliRunner  # noqa: TID251

from terratool.cli import main
from terratool.definition.layout import canonical
from tests.served import LARGEST_INPUT, Place, serve

ROOT = Path(__file__).parents[1]
SAMPLE = str(ROOT / "samples" / "paper-example.json")
COMMAND = [sys.executable, "-m", "terratool"]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1", "COLUMNS": "100"}

# Four cells of 5 × 5 around the origin: south-west flat at 2, south-east a ramp from 2 to 7,
# north-west void, north-east flat at 2 with a step to 12 from the middle of the cell.
YARD: dict[str, Any] = {
    "size": 10,
    "origin": [-5, -5],
    "surfTypes": {"sand": {}, "hole": {"void": True}, "wet, grey": {}},
    "elemTypes": {
        "flat": {"x": [1]},
        "ramp": {"x": [0, 1]},
        "step": {"x": [[0, 0], [0.5, 0], [0.5, 1], [1, 1]]},
    },
    "elemTree": {
        "type": "flat", "vScale": 2, "surface": "sand", "cells": 2,
        "children": [
            {"cellX": 1, "cellY": 0, "type": "ramp", "vScale": 5},
            {"cellX": 0, "cellY": 1, "type": "flat", "surface": "hole"},
            {"cellX": 1, "cellY": 1, "type": "step", "vScale": 10, "surface": "wet, grey"},
        ],
    },
}  # fmt: skip

# Oblong ground with one plate, for commands that put something into a text.
PLATED: dict[str, Any] = {
    "size": [60, 26],
    "surfTypes": {"sand": {"cohesion": 1, "fricAngle": 28, "sinkage": 0.1}},
    "elemTypes": {"ground": {"x": [0, 0], "x-ignore": ["TT308"]}, "plate": {"x": [1]}},
    "elemTree": {
        "type": "ground", "surface": "sand", "cells": [3, 2],
        "children": [{"cellX": 0, "cellY": 1, "type": "plate", "vScale": 3, "cells": [4, 5]}],
    },
}  # fmt: skip


@dataclass(frozen=True)
class Ran:
    """What a command left behind."""

    code: int
    out: str
    err: str


def run(*arguments: object, stdin: str | bytes = b"", **environment: str) -> Ran:
    """Run the command with these arguments, and make sure that it ends in no traceback."""
    words = list(map(str, arguments))
    given = stdin.encode() if isinstance(stdin, str) else stdin
    if environment or len(given) > LARGEST_INPUT:
        done = subprocess.run(
            [*COMMAND, *words], input=given, capture_output=True, cwd=ROOT,
            env={**ENVIRONMENT, **environment}, timeout=120, check=False,
        )  # fmt: skip
        code, out, err = done.returncode, done.stdout, done.stderr
    else:
        code, out, err = serve(words, given, Place(ROOT, ENVIRONMENT), 120)
    ran = Ran(code, out.decode(), err.decode())
    assert "Traceback" not in ran.err, ran.err
    return ran


def call(*arguments: object, stdin: str | bytes = b"") -> Ran:
    """The same in this process: for what depends on neither signals nor real streams."""
    words = ["terratool", *map(str, arguments)]
    with CliRunner().isolation(stdin) as (out, err, _), patch.object(sys, "argv", words):
        code = main._run()
        sys.stdout.flush()
    return Ran(code, out.getvalue().decode(), err.getvalue().decode())


def plated_site(folder: Path) -> Path:
    """`PLATED` in its canonical layout."""
    path = folder / "site.json"
    path.write_text(canonical(json.dumps(PLATED)), encoding="utf-8")
    return path


@contextmanager
def not_for_ever(seconds: int = 60) -> Iterator[None]:
    """What would go on for minutes, or wait for ever, ends in a TimeoutError."""

    def give_up(*_: object) -> None:
        raise TimeoutError(f"it was not done after {seconds} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
