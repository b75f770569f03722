"""Validating a million elements: against bare decoding, against JSON Schema, and in memory.

The text is S3, clean but for the warning of its size; the same with a cell that trims every third
element, which is a warning each; and with errors: one near its end, or one in every element.
Everything that is compared has one file before it, and starts from bytes.
"""

from __future__ import annotations

import gc
import json
import resource
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import jsonschema
import jsonschema_rs
import msgspec
import terrains
from measure import line, medians
from mistakes import KINDS, broken

import terratool
from terratool.definition.model import Definition
from terratool.definition.reader import Checked, check
from terratool.text.source import Source

SCHEMA = Path(__file__).parent.parent / "schemas" / "terrain.schema.json"


def write(path: Path, small: Path) -> None:
    """S3, and S3 with one level less."""
    path.write_bytes(terrains.text(terrains.s3()))
    small.write_bytes(terrains.text(terrains.s3(sides=(6, 6, 6))))


def expect(kind: str, checked: Checked) -> None:
    """Stop unless what was found is what was put in."""
    code, one = ("TT112", True) if KINDS[kind] is None else (KINDS[kind][0], KINDS[kind][-1])
    found = checked.counts[code]
    assert found == 1 if one else found > 300_000, (kind, checked.counts)
    assert (checked.definition is not None) == (code in ("TT112", "TT213"))


def peak(path: Path, kind: str) -> float:
    """Peak memory of a process that checks a text, modules and all, over the size of the text."""
    data = broken(path.read_bytes(), kind)
    expect(kind, check(Source("s3", data)))
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / len(data)


def alone(task: Callable[..., object], *arguments: object) -> object:
    """Call in a new process; this one is still small then, as children begin with its peak."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(task, *arguments).result()


def against_decoding(path: Path) -> None:
    """Check texts with errors and without against the bare typed decoding of the valid one."""
    data = path.read_bytes()
    decode = partial(msgspec.json.decode, data, type=Definition)
    for kind in KINDS:
        source = Source("s3", broken(data, kind))
        runs = 5 if kind == "clean" else 3
        seconds = medians({"decode": decode, "check": partial(check, source)}, runs)
        line(
            f"{kind} ({seconds['check']:.2f} s)",
            seconds["check"] / seconds["decode"],
            "<= 3" if kind == "clean" else "<= 10",
        )


def against_schemas(small: Path) -> None:
    """The published schema, which is the structure alone, against all rules on the same file."""
    data = small.read_bytes()
    source = Source("s3", data)
    schema = terratool.schema()
    slow, quick = jsonschema.Draft202012Validator(schema), jsonschema_rs.validator_for(schema)
    tasks = {
        "check": lambda: check(source),
        "jsonschema": lambda: list(slow.iter_errors(json.loads(data))),
        "jsonschema-rs": lambda: list(quick.iter_errors(json.loads(data))),
    }
    assert check(source).counts.total() == 0
    assert not tasks["jsonschema"]() and not tasks["jsonschema-rs"]()
    seconds = medians(tasks, runs=3)
    for name in ("jsonschema", "jsonschema-rs"):
        ratio = seconds[name] / seconds["check"]
        line(f"check against {name} ({seconds[name]:.2f} s)", ratio, "> 1")
    commands = {
        "terratool": ["terratool", "validate", str(small)],
        "check-jsonschema": ["check_jsonschema", "--schemafile", str(SCHEMA), str(small)],
    }
    seconds = medians({name: partial(run, command) for name, command in commands.items()}, runs=3)
    ratio = seconds["check-jsonschema"] / seconds["terratool"]
    what = f"terratool validate against check-jsonschema ({seconds['check-jsonschema']:.2f} s)"
    line(what, ratio, "> 1")


def run(command: list[str]) -> None:
    subprocess.run([sys.executable, "-m", *command], stdout=subprocess.DEVNULL, check=True)


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        path, small = Path(folder, "s3.json"), Path(folder, "small.json")
        alone(write, path, small)
        print(f"{path.stat().st_size / 1e6:.0f} MB of text, peak memory over its size")
        for kind in KINDS:
            line(kind, alone(peak, path, kind), "<= 12")
        print("check, against the bare typed decoding of the valid text")
        gc.disable()
        against_decoding(path)
        gc.enable()
        print(f"{small.stat().st_size / 1e6:.1f} MB of text")
        against_schemas(small)
