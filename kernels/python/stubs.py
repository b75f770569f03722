"""Write the type stubs of the kernels from what the compiled module says of itself.

    python kernels/python/stubs.py [--check]

They stand in terratool/kernels, a file for each part of the module.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "terratool" / "kernels"
STUBGEN = """
import runpy, terratool.kernels
runpy.run_module("nanobind.stubgen", run_name="__main__")
"""
SPECS = "SPECS: dict[str, list[dict[str, Any]]]"
HEAD = '''"""{title}: the kernels in C++. Written by `make stubs`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
'''


def made() -> dict[str, str]:
    """The text of each stub, by its name."""
    import terratool.kernels as kernels

    texts = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in kernels.PARTS:
            module = f"terratool.kernels.{kernels.variant}._kernels.{name}"
            path = Path(folder) / f"{name}.pyi"
            subprocess.run(
                [sys.executable, "-c", STUBGEN, "-q", "-m", module, "-o", path], check=True
            )
            text = re.sub(r"^SPECS: dict = .*$", SPECS, path.read_text(), flags=re.MULTILINE)
            text = re.sub(r"^( *)(Shapes: .*)$", _wrapped, text, flags=re.MULTILINE)
            text = text.replace("import np\n", "").strip()
            lines = [line for line in text.splitlines() if not line.startswith(("import", "from"))]
            path.write_text(HEAD.format(title=name.capitalize()) + "\n" + "\n".join(lines) + "\n")
        for command in (["check", "--select", "F401", "--fix", "--quiet"], ["format", "--quiet"]):
            config = ["--config", FOLDER.parents[1] / "pyproject.toml"]
            subprocess.run([sys.executable, "-m", "ruff", *command, *config, folder], check=True)
        for path in Path(folder).glob("*.pyi"):
            texts[path.name] = path.read_text()
    return texts


def _wrapped(line: re.Match[str]) -> str:
    indent, words = line.groups()
    return textwrap.fill(words, 100, initial_indent=indent, subsequent_indent=indent)


def main() -> None:
    stale = {name: text for name, text in made().items() if _old(name) != text}
    if "--check" in sys.argv:
        if stale:
            sys.exit(f"Stubs of the kernels are old: {', '.join(stale)}. Run make stubs.")
        return
    for name, text in stale.items():
        (FOLDER / name).write_text(text)


def _old(name: str) -> str:
    path = FOLDER / name
    return path.read_text() if path.exists() else ""


if __name__ == "__main__":
    main()
