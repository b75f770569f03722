"""The examples of the README and of the pages in docs/ are run, and say what the pages say."""

from __future__ import annotations

import ast
import math
import re
import shlex
import shutil
import subprocess
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import trimesh

import terratool
from terratool.definition.reader import check
from terratool.text.source import Source
from tests.commands import ENVIRONMENT, ROOT, call
from tests.served import Place, serve

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PROGRESS = re.compile(r"^terratool: .*\d s\n", re.MULTILINE)  # of a slow machine
FENCE = re.compile(r"^```([\w{}-]*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SAVED = re.compile(
    r"[Ss]ave this as `([^`]+)`[^\n]*\n(?:[^`\n]*\n)*?```(?:json|toml|csv)\n(.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
WALKS = [
    ROOT / "docs" / f"{name}.md"
    for name in (
        "tutorial", "author-a-site", "edit-a-dem", "gate-a-repository", "drive-a-vehicle",
        "load-in-a-simulator",
    )
]  # fmt: skip
"""Pages that are walked through from an empty folder on, each block after the one before."""


def blocks(page: Path) -> list[tuple[str, str]]:
    """All fenced blocks of a page: what the fence calls it, and its text."""
    return [(found[1], found[2]) for found in FENCE.finditer(page.read_text("utf-8"))]


def saved(page: Path) -> dict[str, str]:
    """The files that a page tells its readers to save, by name."""
    return {found[1]: found[2] for found in SAVED.finditer(page.read_text("utf-8"))}


def sessions() -> list[object]:
    """Blocks that show commands and what they say, with the last JSON that stands before each."""
    found = []
    for page in PAGES:
        if page in WALKS:
            continue
        text = ""
        for language, block in blocks(page):
            if language == "json":
                text = block
            elif block.startswith("$ terratool "):
                name = f"{page.stem}-{block.split()[2]}"
                found.append(pytest.param(block, text, saved(page), id=name))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("block", "text", "files"), sessions())
def test_commands_say_what_the_page_shows(
    block: str, text: str, files: dict[str, str], tmp_path: Path
) -> None:
    """A line of "…" stands for whatever follows; a file that is no sample is the JSON before."""
    shutil.copytree(ROOT / "samples", tmp_path / "samples")
    if " out/" in block:
        (tmp_path / "out").mkdir()  # as `make demo` does
    for name, saved_text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(saved_text, "utf-8")
    for command, shown in commands(block):
        program, *words = shlex.split(command)
        assert program == "terratool"
        if words[1].endswith(".json") and not (tmp_path / words[1]).exists():
            (tmp_path / words[1]).write_text(text, "utf-8")
        assert_says(words, shown, tmp_path)


def test_what_readers_save_draws_no_remark() -> None:
    """Terrains of all pages are clean, but of the one that explains what is remarked on."""
    seen = 0
    for page in PAGES:
        if page.stem == "format":
            continue
        for name, text in saved(page).items():
            if '"elemTree"' in text and '"use"' not in text:
                assert check(Source(f"{page.stem}: {name}", text.encode())).findings == ()
                seen += 1
    assert seen >= 3


def test_the_readme_leaves_nothing_behind_that_git_does_not_ignore() -> None:
    """What its examples write, and what readers save, goes into out/."""
    assert "out/" in (ROOT / ".gitignore").read_text("utf-8").splitlines()
    assert all(name.startswith("out/") for name in saved(PAGES[0]))
    words = {
        word
        for _, block in blocks(PAGES[0])
        if block.startswith("$ ")
        for command, _ in commands(block)
        for word in shlex.split(command)
        if re.search(r"\.(json|png|html|glb|tif|gz)$", word) and not word.startswith("samples/")
    }
    assert len(words) > 5
    assert {word for word in words if not word.startswith("out/")} == set()


def commands(block: str) -> list[tuple[str, str]]:
    """The commands of a block, each with what is shown below it."""
    parts = re.split(r"^\$ ", block.replace("\\\n", ""), flags=re.MULTILINE)[1:]
    return [(command, shown) for command, _, shown in (part.partition("\n") for part in parts)]


def assert_says(words: list[str], shown: str, folder: Path) -> int:
    """Run a command, and give its exit code; a line of "…" stands for whatever follows."""
    place = Place(folder, {**ENVIRONMENT, "PYTHONUNBUFFERED": "1"}, merged=True)
    code, printed, _ = serve(words, b"", place, 120)
    said = PROGRESS.sub("", printed.decode())
    if shown.endswith("…\n"):
        shown = shown.removesuffix("…\n")
        said = said[: len(shown)]
    assert said == shown
    return code


@pytest.mark.slow
@pytest.mark.parametrize("page", WALKS, ids=lambda page: page.stem)
def test_a_page_goes_as_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the folder of the project on, in its order: files are saved, commands are run."""
    shutil.copytree(ROOT / "samples", tmp_path / "samples")
    monkeypatch.chdir(tmp_path)
    text = page.read_text("utf-8")
    files = {found.end(): (found[1], found[2]) for found in SAVED.finditer(text)}
    code, ran = 0, 0
    for fence in FENCE.finditer(text):
        if fence.end() in files:
            name, content = files[fence.end()]
            Path(name).write_text(content, "utf-8")
        elif fence[1] == "python":
            run_python(fence[2])
        for command, shown in commands(fence[2]):
            program, *words = shlex.split(command)
            if program == "terratool":
                code, ran = assert_says(words, shown, Path.cwd()), ran + 1
            elif command == "echo $?":
                assert shown == f"{code}\n"
            else:
                run_shell(program, words, monkeypatch)
                assert not shown
    assert ran >= 4
    assert len(files) == text.count("ave this as `")


def run_shell(program: str, words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """What pages ask of a shell besides terratool."""
    if program == "mkdir":
        Path(words[0]).mkdir()
    elif program == "cd":
        monkeypatch.chdir(words[0])
    else:
        assert program in ("cp", "sed")
        subprocess.run([program, *words], check=True, timeout=10)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that examples speak of: a DEM of 400 × 400 pixels, and a mesh in millimetres."""
    folder = tmp_path_factory.mktemp("docs")
    shutil.copytree(ROOT / "samples", folder / "samples")
    for name, text in saved(ROOT / "docs/format.md").items():
        (folder / name).write_text(text, "utf-8")
    craters = folder / "samples/lunar-craters.json"
    assert call("export-dem", craters, folder / "dem.tif", "--resolution", 0.5).code == 0
    definition = next(text for language, text in blocks(PAGES[0]) if language == "json")
    yard = folder / "dune-and-kerb.json"
    yard.write_text(definition, "utf-8")
    assert call("export-mesh", yard, folder / "metres.stl").code == 0
    trimesh.load_mesh(folder / "metres.stl").apply_scale(1000).export(folder / "yard.stl")
    return folder


@pytest.mark.parametrize("page", ["README.md", "CHANGELOG.md"])
def test_the_number_of_rules(page: str) -> None:
    listed = call("rules").out.count("\nTT") + 1
    (said,) = re.findall(r"(\d+) rules", (ROOT / page).read_text("utf-8"))
    assert int(said) == listed


def pythons() -> list[object]:
    """The blocks of Python of all pages."""
    return [
        pytest.param(text, id=page.stem)
        for page in PAGES
        if page not in WALKS
        for language, text in blocks(page)
        if language == "python"
    ]


@pytest.mark.parametrize("block", pythons())
def test_python_gives_what_its_comments_say(
    block: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All lines run; where a comment is a value or a shape, the expression before it has it."""
    monkeypatch.chdir(folder)
    run_python(block)


def run_python(block: str) -> None:
    """Run a block, and compare each expression with the value that its comment shows."""
    for package in ("torch", "mujoco", "pybullet", "pxr"):
        if re.search(rf"^(?:import|from) {package}|to_{package}\b", block, re.MULTILINE):
            pytest.importorskip(package, reason=f"{package} is not installed")
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


class Row(NamedTuple):
    """What a table of docs/format.md says of a point.

    Attributes:
        page_line: where.
        file: the terrain that it is about.
        point: x and y.
        said: the other columns by their heads.
    """

    page_line: int
    file: str
    point: tuple[float, float]
    said: dict[str, str]


def rows() -> list[Row]:
    """Rows of all tables of points, each about the file that was named last."""
    found: list[Row] = []
    file, heads = "", []
    for number, line in enumerate((ROOT / "docs/format.md").read_text("utf-8").splitlines(), 1):
        if named := re.search(r"[Ss]ave this as `([^`]+)`|query (samples/\S+)", line):
            file, heads = named[1] or named[2], []
        cells = [cell.strip() for cell in line.removeprefix("|").removesuffix("|").split("|")]
        if line.startswith(("| x | y | z |", "| x | y | column |")):
            heads = cells
        elif not line.startswith("|"):
            heads = []
        elif heads and not line.startswith("|---"):
            said = dict(zip(heads, cells, strict=True))
            found.append(Row(number, file, (float(said["x"]), float(said["y"])), said))
    return found


@pytest.fixture(scope="module")
def terrains(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All files of docs/format.md, and the samples."""
    folder = tmp_path_factory.mktemp("format")
    shutil.copytree(ROOT / "samples", folder / "samples")
    for name, text in saved(ROOT / "docs/format.md").items():
        (folder / name).write_text(text, "utf-8")
    return folder


def test_the_tables_are_found() -> None:
    files = [row.file for row in rows()]
    assert len(files) == 100
    assert {*files} >= {"first.json", "parts.json", "places.json", "edges.json"}


@pytest.mark.parametrize("file", sorted({row.file for row in rows()}))
def test_tables_of_the_format_say_what_the_terrain_says(file: str, terrains: Path) -> None:
    """Heights to six digits, surfaces and elements; an empty height is none."""
    terrain = terratool.load(terrains / file)
    for _, _, point, said in (row for row in rows() if row.file == file):
        if "column" in said:
            column = terrain.column(*point)
            ends = [
                float(end)
                for end in re.findall(r"[-\d.e]+", said["column"].replace("−∞", "-1e999"))
            ]
            assert ends[::2] == pytest.approx(column.bottom.tolist(), rel=1e-6), said
            assert ends[1::2] == pytest.approx(column.top.tolist(), rel=1e-6), said
            continue
        z = float(said["z"]) if said["z"] else math.nan
        assert terrain.height(*point) == pytest.approx(z, rel=1e-6, abs=1e-6, nan_ok=True), said
        assert (terrain.element(*point) or "") == said["element"].strip("`"), said
        if "surface" in said:
            assert (terrain.surface(*point) or "") == said["surface"], said


@pytest.mark.parametrize("file", sorted(saved(ROOT / "docs/format.md")))
def test_files_of_the_format_are_valid(file: str, terrains: Path) -> None:
    """Even strictly, but for what the page does not speak of: unused names and soils."""
    ran = call("validate", "--strict", "--ignore", "TT2,TT4", terrains / file)
    assert ran.code == 0, ran.out
