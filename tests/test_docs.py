"""The examples of the README and of the pages in docs/ are run, and say what the pages say."""

from __future__ import annotations

import ast
import re
import shlex
import shutil
import subprocess
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import trimesh

from tests.commands import COMMAND, ENVIRONMENT, ROOT, call

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PROGRESS = re.compile(r"^terratool: .*\d s\n", re.MULTILINE)  # of a slow machine
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: Path) -> list[tuple[str, str]]:
    """All fenced blocks of a page: what the fence calls it, and its text."""
    return [(found[1], found[2]) for found in FENCE.finditer(page.read_text("utf-8"))]


def sessions() -> list[object]:
    """Blocks that show commands and what they say, with the last JSON that stands before each."""
    found = []
    for page in PAGES:
        text = ""
        for language, block in blocks(page):
            if language == "json":
                text = block
            elif block.startswith("$ terratool "):
                name = f"{page.stem}-{block.split()[2]}"
                found.append(pytest.param(block, text, id=name))
    return found


@pytest.mark.parametrize(("block", "text"), sessions())
def test_commands_say_what_the_page_shows(block: str, text: str, tmp_path: Path) -> None:
    """A line of "…" stands for whatever follows; a file that is no sample is the JSON before."""
    shutil.copytree(ROOT / "samples", tmp_path / "samples")
    for session in re.split(r"^\$ ", block.replace("\\\n", ""), flags=re.MULTILINE)[1:]:
        command, _, shown = session.partition("\n")
        program, *words = shlex.split(command)
        assert program == "terratool"
        if words[1].endswith(".json") and not (tmp_path / words[1]).exists():
            (tmp_path / words[1]).write_text(text, "utf-8")
        done = subprocess.run(
            [*COMMAND, *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            cwd=tmp_path,
            env={**ENVIRONMENT, "PYTHONUNBUFFERED": "1"},
            timeout=120,
            check=False,
        )
        said = PROGRESS.sub("", done.stdout.decode())
        if shown.endswith("…\n"):
            shown = shown.removesuffix("…\n")
            said = said[: len(shown)]
        assert said == shown


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that examples speak of: a DEM of 400 × 400 pixels, and a mesh in millimetres."""
    folder = tmp_path_factory.mktemp("docs")
    shutil.copytree(ROOT / "samples", folder / "samples")
    craters = folder / "samples/lunar-craters.json"
    assert call("export-dem", craters, folder / "dem.tif", "--resolution", 0.5).code == 0
    definition = next(text for language, text in blocks(PAGES[0]) if language == "json")
    yard = folder / "dune-and-kerb.json"
    yard.write_text(definition, "utf-8")
    assert call("export-mesh", yard, folder / "metres.stl").code == 0
    trimesh.load_mesh(folder / "metres.stl").apply_scale(1000).export(folder / "yard.stl")
    return folder


def pythons() -> list[object]:
    """The blocks of Python of all pages."""
    return [
        pytest.param(text, id=page.stem)
        for page in PAGES
        for language, text in blocks(page)
        if language == "python"
    ]


@pytest.mark.parametrize("block", pythons())
def test_python_gives_what_its_comments_say(
    block: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All lines run; where a comment is a value or a shape, the expression before it has it."""
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}
    exec(block, names)
    for line in block.splitlines():
        code, _, comment = line.partition("  # ")
        if "..." in comment:
            continue
        with suppress(ValueError, SyntaxError):
            shown = ast.literal_eval(comment)
            value = eval(code, names)
            assert value == (pytest.approx(shown) if isinstance(shown, float) else shown), line
        if array := re.match(r"(\(\d+, \d+(, \d+)?\)) (float\d+)", comment):
            value = names[code.split(" = ")[0]]
            assert (value.shape, str(value.dtype)) == (ast.literal_eval(array[1]), array[3]), line
