"""What others call things comes out as text: no terminal, no log and no reader obeys it."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from terratool.cli import main
from tests.commands import ROOT, call
from tests.test_inert import site

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")

PACKAGE = ROOT / "terratool"
PRINTERS = {"echo", "secho", "echo_via_pager", "pause", "confirm", "prompt", "progressbar"}
STREAMS = {"stdout", "stderr", "__stdout__", "__stderr__"}
ALLOWED = {
    "cli/saying.py": "prints",
    "cli/terminal.py": "how far it is, on a line that is written over",
    "cli/main.py": "sets up the streams, and closes one that takes no more",
    "io/gdal_copy.py": "a process of ours that answers another one",
    "io/guards.py": "a process of ours that tells another one what is wrong with a raster",
    "io/las.py": "a process of ours that gives another one the points of a file",
}
"""Modules that may touch a standard stream, and why."""


def prints(path: Path) -> Iterator[str]:
    """What a module does that ends on a terminal."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Attribute):
            whose = node.value.id if isinstance(node.value, ast.Name) else ""
            if whose == "sys" and node.attr in STREAMS:
                yield f"sys.{node.attr}"
            if whose == "click" and node.attr in PRINTERS:
                yield f"click.{node.attr}"
            if whose == "os" and node.attr == "write":
                yield "os.write"
        elif isinstance(node, ast.ImportFrom) and node.module in ("click", "sys"):
            yield from (
                f"from {node.module}" for one in node.names if one.name in PRINTERS | STREAMS
            )
        elif isinstance(node, ast.Name) and node.id == "print":
            yield "print"


@pytest.mark.nightly
def test_nothing_else_prints() -> None:
    """Every word goes through one module, which escapes it."""
    found = {
        path.relative_to(PACKAGE).as_posix(): set(prints(path)) for path in PACKAGE.rglob("*.py")
    }
    assert found["cli/saying.py"] == {"sys.stdout", "click.echo"}
    # says so when no stream of Python can be trusted any more: a constant
    assert found.pop("cli/stopping.py") == {"os.write"}
    assert {name for name, printed in found.items() if printed} <= ALLOWED.keys()
    for name in ALLOWED.keys() - {"cli/saying.py"}:
        assert found[name] <= {"sys.stdout", "sys.stderr"}, name


HOSTILE = {
    "escape sequence": "\x1b[31mred\x1b]0;title\x07",
    "c1": "\x9b2J\x85x\x7f",
    "direction": "a\u202eb\u2066c\u200b\u2028d",
    "lines": "line\nfeed\r\treturn",
    "command": "::error::x",
    "old command": "x##[error]y",
    "no utf-8": "x\udcff\udc9b",
    "quotes": "a'b\"c`d`$(e)",
}


@pytest.fixture(params=HOSTILE)
def name(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A hostile name; the current folder has all that commands want under it."""
    monkeypatch.chdir(tmp_path)
    name = HOSTILE[request.param]
    Path(f"{name}.json").write_text(json.dumps(site(name.encode("utf-8", "replace").decode())))
    Path(f"{name}-x.json").write_text(json.dumps({**site("rock"), "no key": 1, "use": ["no.json"]}))
    for kind, file in (
        ("v", "vehicles/husky-a200"), ("s", "sensors/hokuyo-utm-30lx"), ("c", "curricula/rough")
    ):  # fmt: skip
        shutil.copy(ROOT / "samples" / f"{file}.json", f"{name}-{kind}.json")
    Path(f"{name}.csv").write_text("1,1\n5,3\n")
    return name


def told(*words: object) -> str:
    """What a command prints, after a look at it."""
    done = call(*words)
    assert done.code in (0, 1, 2, 3), words
    for stream in (done.out, done.err):
        raw = {c for c in stream if not c.isprintable()} - {"\n"}
        assert not raw, (words, stream)
    for text in (done.err, *[done.out] * ("github" not in words)):
        assert not re.search(r"^\s*::|##\[", text, re.MULTILINE), (words, text)
    return done.out


def kind_of(n: str) -> str:
    """A primitive of the terrain under a name."""
    return str(next(iter(json.loads(Path(f"./{n}.json").read_text())["elemTypes"])))


def commands(n: str) -> dict[str, list[list[Any]]]:
    """Words for each command, of which each says something of the name."""
    d, v, s, c, table = (
        f"./{n}{end}" for end in (".json", "-v.json", "-s.json", "-c.json", ".csv")
    )
    pose = ["--pose", 2, 2, 1, 0, 30, 0]
    fit, kind = ["--max-error", 0.5], kind_of(n)
    return {
        "new": [["flat", f"./{n}-n.json"], ["flat", f"./{n}-n.json"], ["flat", f"./{n}/n.json"]],
        "validate": [
            [d], [f"./{n}-x.json"], [f"./{n}-no.json"], ["."], [d, "--format", n],
            [d, "--select", n],
            [d, "--config", table], [d, f"--{n}"], [d, "--baseline", table],
            [d, f"./{n}-x.json", "--baseline", f"./{n}-b.json", "--update-baseline"],
            [f"./{n}-x.json", "--fix"],
        ],
        "format": [[d], [f"./{n}-no.json"], [table], ["--check", "."], [f"./{n}"]],
        "add": [
            [d, "--type", n, "--at", 1, 1, "--extent", 1], [d, "--type", "kind", "--cell", 0, 0],
            [d, "--type", kind, "--cell", 2, 1, "--output", f"./{n}-a.json"],
        ],
        "info": [[d], [f"./{n}-x.json"], [f"./{n}-no.json"]],
        "query": [[d, 1, 1, 3, 1], [d, n, 1], [d, "--points", table], [d, "--points", v]],
        "export-dem": [
            [d, f"./{n}.tif", "--resolution", 1], [d, f"./{n}.tif"], [d, f"./{n}.{n}"],
            [d, f"./{n}.img", "--resolution", 1], [d, "--tiles", f"./{n}-t", "--resolution", 1],
            [d, f"./{n}-l.tif", "--layer", n], [d, "--tiles", table],
        ],
        "export-mesh": [[d, f"./{n}.glb", *fit], [d, f"./{n}.obj", *fit], [d, f"./{n}.{n}"]],
        "export-obj": [[d, f"./{n}-m.obj", *fit]],
        "export-vrml": [[d, f"./{n}.wrl", *fit], [d, f"./{n}.wrl", *fit]],
        "export-sim": [
            [d, f"./{n}-sim", "--target", "nav2"], [d, f"./{n}-sim", "--target", "nav2"],
            [d, table, "--target", "nav2"], [d, f"./{n}-sim", "--target", n],
        ],
        "render": [[d, f"./{n}.png", "--pixels", 600], [d, f"./{n}.png"], [d, f"./{n}.{n}"]],
        "view": [[d, "--output", f"./{n}.html", "--no-open"], [d, "--output", f"./{n}.html"],
                 [f"./{n}-no.json", "--watch", "--no-open"]],
        "import-primitive": [
            [f"./{n}.tif", "--name", "p", "--output", f"./{n}-p.json"],
            [f"./{n}-no.tif", "--name", "p"],
            [table, "--name", "p"], [f"./{n}.tif", "--name", n, "--into", d],
        ],
        "import-terrain": [
            [f"./{n}.tif", f"./{n}-i.json", *fit], [f"./{n}.tif", f"./{n}-i.json", *fit],
            [table, f"./{n}-j.json", *fit], [f"./{n}-x.json", f"./{n}-j.json", *fit],
        ],
        "scan": [[d, f"./{n}.npz", "--sensor", s, *pose], [d, f"./{n}.{n}", "--sensor", s, *pose],
                 [d, f"./{n}-2.ply", "--sensor", d, *pose],
                 [d, f"./{n}-2.ply", "--sensor", s, "--poses", d]],
        "map": [[f"./{n}.npz", "--resolution", 1, "--output", f"./{n}-map.tif"],
                [d, "--resolution", 1, "--output", f"./{n}-map2.tif"]],
        "compare": [[f"./{n}-map.tif", d, "--max-rmse", 0], [d, d], [f"./{n}-no.tif", d]],
        "deform": [[d, "--vehicle", v, "--waypoints", table, "--output", f"./{n}-d.json"],
                   [d, "--vehicle", d, "--waypoints", table, "--output", f"./{n}-d2.json"]],
        "traversability": [
            [d, "--vehicle", v, "--resolution", 1, "--headings", 4, "--fail-on", "go-fraction<2"],
            [d, "--vehicle", d], [d, "--vehicle", v, "--fail-on", n],
            [d, "--vehicle", v, "--report", f"./{n}.{n}"], [d, "--vehicle", v, "--report", table],
        ],
        "diff": [
            [d, f"./{n}-no.json"], [d, f"./{n}-x.json"], [d, d], [d, "/dev/null"],
            [d, "/dev/null", "--read-as", n],
            ["--git", n, d, "0" * 40, "100644", f"./{n}-x.json", "0" * 40, "100644"],
            ["--git", n, d, "0" * 40, "100644", "/dev/null", ".", "."],
            [".", "."], [".", ".", "--format", "markdown"],
        ],
        "curriculum": [[c, f"./{n}-cc.json"], [d, f"./{n}-cc2.json"], [c, f"./{n}.{n}"]],
        "bundle": [[d, f"./{n}-bb.json"], [f"./{n}-x.json", "-"]],
        "rules": [[n]],
        "cache": [[], ["--clear"], [n]],
        "completion": [[n]],
        n: [[]],
    }  # fmt: skip


MACHINES: dict[str, Callable[[str], list[list[Any]]]] = {
    "validate": lambda n: [
        [f"./{n}-x.json", f"./{n}-no.json", "--format", form]
        for form in ("json", "sarif", "junit", "gitlab", "github")
    ],
    "info": lambda n: [[f"./{n}.json", "--json"], [f"./{n}.json", "--geojson"]],
    "query": lambda n: [[f"./{n}.json", 1, 1, 3, 1, "--json"]],
    "diff": lambda n: [
        [f"./{n}.json", "/dev/null", "--format", form] for form in ("json", "github")
    ],
    "add": lambda n: [
        [
            f"./{n}.json",
            "--type",
            next(iter(json.loads(Path(f"{n}.json").read_text())["elemTypes"])),
            "--cell",
            2,
            1,
            "-o",
            f"./{n}-j.json",
            "--json",
        ]
    ],
    "bundle": lambda n: [[f"./{n}.json", f"./{n}-k.json", "--json"]],
    "format": lambda n: [[f"./{n}.json", f"./{n}-no.json", "--check", "--json"]],
    "render": lambda n: [[f"./{n}.json", f"./{n}-k.png", "--pixels", 600, "--json"]],
    "view": lambda n: [[f"./{n}.json", "-o", f"./{n}-k.html", "--no-open", "--json"]],
    "compare": lambda n: [[f"./{n}-map.tif", f"./{n}.json", "--json"]],
    "traversability": lambda n: [
        [f"./{n}.json", "--vehicle", f"./{n}-v.json", "--resolution", 1, "--headings", 4, "--json"]
    ],
}
JSON = ("export-dem", "export-mesh", "export-sim", "scan", "map", "deform", "curriculum", "new",
        "import-terrain")  # fmt: skip


@pytest.mark.nightly
def test_no_command_prints_what_a_terminal_obeys(name: str) -> None:
    """Whatever files are called: results, errors, usage, and all that is written on the way."""
    told_of = commands(name)
    assert main._COMMANDS.keys() == told_of.keys() - {name}
    for command, runs in told_of.items():
        for words in runs:
            told(command, *words)
    outs = {path.name for path in Path().iterdir()}
    if name.isprintable():  # all was done, and not only refused
        made = ("-n.json", "-a.json", ".tif", "-t", ".glb", ".wrl", "-sim", ".png", ".html", ".npz",
                "-p.json", "-i.json", "-map.tif", "-d.json", "-cc.json", "-bb.json")  # fmt: skip
        assert outs >= {f"{name}{end}" for end in made}


@pytest.mark.nightly
def test_what_machines_read_is_still_theirs(name: str) -> None:
    """It has escapes of JSON and XML, which mean the same."""
    n = name
    told("export-dem", f"./{n}.json", f"./{n}.tif", "--resolution", 1)
    words = [f"./{n}.json", f"./{n}.npz", "--sensor", f"./{n}-s.json", "--pose", 2, 2, 1, 0, 30, 0]
    told("scan", *words)
    told("map", f"./{n}.npz", "--resolution", 1, "--output", f"./{n}-map.tif")
    for command, more in MACHINES.items():
        for words in more(n):
            text = told(command, *words)
            if not {"junit", "github", "gitlab"} & set(map(str, words)) and text:
                json.loads(text)
            assert text or "--json" not in words or command == "compare" or "\udcff" in n, words
    for command in JSON:
        words = commands(n)[command][0]
        for path in (f"{n}-n.json", f"{n}-cc.json", f"{n}-d.json", f"{n}-i.json"):
            Path(path).unlink(missing_ok=True)
        more = [] if command == "new" else ["--overwrite"]
        text = told(command, *words, *more, "--json")
        assert not text or json.loads(text)
    (found,) = json.loads(told("validate", f"./{n}-no.json", "--format", "json"))["unreadable"]
    assert found["file"] == f"./{n}-no.json"


def test_a_definition_is_itself_in_a_pipe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a terminal it has escapes; in a pipe it is what a file would be, byte for byte."""
    text = json.dumps({**site("rock"), "descr": "a\x9b2J\u202eb"}, ensure_ascii=False)
    done = call("format", "-", stdin=text)
    assert "a\x9b2J\u202eb" in done.out
    monkeypatch.setattr("terratool.cli.saying.is_terminal", lambda: True)
    shown = call("format", "-", stdin=text)
    assert r"a\u009b2J\u202eb" in shown.out
    assert json.loads(shown.out) == json.loads(done.out)
