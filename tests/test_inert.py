"""What a stranger calls things stays a name: no output becomes markup, a command or another line.

Each output of a terrain whose surface, description and primitive have a hostile name is compared
with that of a plain one: read by a reader that is not ours, both have the same skeleton. The same
for what files are called.
"""

from __future__ import annotations

import csv
import io
import json
import os
import re
import struct
from collections.abc import Callable, Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import pytest
import rasterio
import trimesh

from tests.commands import ROOT, call

PLAIN = "plain"
HOSTILE = {
    "script": "<script>alert(1)</script>",
    "attribute": "'\"><img src=x onerror=alert(1)>",
    "quote": 'a"b',
    "apostrophe": "it's",
    "line feed": "a\nb",
    "lines": "a\r\nv 1 2 3\rusemtl b\u2028f 1 2 3\u0085x",
    "annotation": "::error file=x::y",
    "annotation on a line": "x\n::error file=y::z\n",
    "encoded": "%0A::error::x%0D%25",
    "folder": "../../etc/passwd",
    "backticks": "`rm -rf /` ```sh",
    "shell": "$(reboot); & | > x",
    "formula": '=HYPERLINK("http://x","y")',
    "formula at": "@SUM(1+1)",
    "formula plus": "+1+cmd|' /C calc'!A0",
    "formula tab": "\t=1",
    "escape sequence": "\x1b[31mred\x1b]0;title\x07\x9b2J",
    "override": "a\u202eb\u2066c\u200b",
    "xml": "]]>--><x y='z'/><!-- &lt; &#10; <!DOCTYPE a>",
    "hyphens": "a--b-",
    "link": "[x](javascript:alert(1)) ![y](http://z/p.png) <http://z>",
    "table": "a | b |\n|---|---|\n# c",
    "template": "{{ 7 * 7 }} {% raw %} ${x}",
    "node": "} Script { url \"javascript:x\" } DEF x Group { #",
    "header": "end_header",
    "backslash": "a\\nb\\",
    "blanks": "  a  ",
    "long": "ab " * 400,
}  # fmt: skip


def site(name: str) -> dict[str, Any]:
    """Oblong, with a surface, a primitive and texts of that name."""
    kind = f"{name}kind"
    soil = {"cohesion": 1, "fricAngle": 30, "sinkage": 0.01, "shearModulus": 0.01}
    return {
        "descr": name or PLAIN,
        "size": [6, 4],
        "surfTypes": {
            name: {"descr": name, "color": [200, 10, 30], **soil},
            "other": {"color": [1, 90, 30], **soil},
        },
        "elemTypes": {kind: {"descr": name, "x": [1]}},
        "elemTree": {
            "descr": name, "type": kind, "surface": "other", "vScale": 0, "cells": [3, 2],
            "children": [{"type": kind, "surface": name, "cellX": 1, "cellY": 0, "vScale": 0.25}],
        },
    }  # fmt: skip


def vehicle(name: str) -> dict[str, Any]:
    husky = json.loads((ROOT / "samples" / "vehicles" / "husky-a200.json").read_text())
    return {**husky, "descr": name}


# --- skeletons: what is left of an output without its texts ---------------------------------------


def of_json(value: Any) -> Any:
    """The keys and types of a value; where keys are names, of their values alone."""
    if isinstance(value, dict):
        named = "other" in value or any(key.endswith("kind") for key in value)
        pairs = [("" if named else key, of_json(item)) for key, item in value.items()]
        return sorted(pairs, key=str)
    return [of_json(item) for item in value] if isinstance(value, list) else type(value).__name__


def of_xml(text: str | bytes) -> Any:
    root = ElementTree.fromstring(text)
    return [(element.tag, sorted(element.attrib)) for element in root.iter()]


# names stand beside their curves only where there is room for them
BESIDE = ("text", "name halo")


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[Any] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if (tag, dict(attrs).get("class")) != BESIDE:
            self.found.append((tag, [name for name, _ in attrs]))

    def handle_comment(self, data: str) -> None:  # noqa: ARG002, as the parser calls it
        self.found.append("comment")

    def handle_decl(self, decl: str) -> None:
        self.found.append(decl)


def of_html(text: str) -> Any:
    parser = _Tags()
    parser.feed(text)
    parser.close()
    return parser.found


def of_markdown(text: str) -> Any:
    """The tags of what it is rendered to, HTML in it included."""
    markdown = pytest.importorskip("markdown_it", reason="markdown-it-py is not installed")
    parser = markdown.MarkdownIt("gfm-like", {"html": True, "linkify": False})
    return of_html(parser.render(text))


def of_lines(text: str) -> Any:
    """The first words of the lines that are no comments, however lines are told apart."""
    lines = [line.split() for line in text.splitlines()]
    return [words[0] for words in lines if words and not words[0].startswith("#")]


def of_vrml(text: str) -> Any:
    """The words that are no numbers, texts or comments, nor the names of nodes."""
    # VRML97, 5.2: a comment ends at a line feed or carriage return
    text = re.sub(r'"(?:[^"\\]|\\.)*"|#[^\n\r]*', lambda m: " " if m[0][0] == "#" else ' "" ', text)
    text = re.sub(r"\b(DEF|USE)\s+\S+", r"\1", text)
    return re.findall(r"[A-Za-z_]\w*|[{}\[\]]|\"\"", text)


def printable(text: str) -> None:
    """A terminal is told nothing."""
    assert [c for c in text if not c.isprintable() and c != "\n"] == []


# --- outputs: each takes a folder with site.json and vehicle.json, and says its skeleton ----------


def ran(*words: object, codes: tuple[int, ...] = (0, 1)) -> str:
    """Run a command; what it says on standard output."""
    done = call(*words)
    assert done.code in codes, done.err
    printable(done.err)
    return done.out


def mesh(folder: Path, ending: str, *more: object) -> Path:
    path = folder / f"out.{ending}"
    printable(ran("export-mesh", folder / "site.json", path, "--max-error", 1, *more))
    return path


def as_obj(folder: Path) -> Any:
    path = mesh(folder, "obj")
    both = [path.read_text(), path.with_suffix(".mtl").read_text()]
    assert set(of_lines(both[0])) == {"mtllib", "v", "vn", "g", "usemtl", "f"}
    return [*map(of_lines, both), len(trimesh.load(path, force="mesh").faces)]


def as_vrml(folder: Path) -> Any:
    return of_vrml(mesh(folder, "wrl").read_text())


def as_grid(folder: Path) -> Any:
    more = ("--elevation-grid", "--resolution", 1)
    path = folder / "grid.wrl"
    printable(ran("export-mesh", folder / "site.json", path, *more))
    return of_vrml(path.read_text())


def as_x3d(folder: Path) -> Any:
    data = mesh(folder, "x3d").read_bytes()
    return of_xml(data), data.count(b"<!--")


def as_usd(folder: Path, ending: str = "usda") -> Any:
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    stage = usd.Stage.Open(str(mesh(folder, ending)))
    return [(prim.GetTypeName(), len(prim.GetAttributes())) for prim in stage.Traverse()]


def as_glb(folder: Path) -> Any:
    data = mesh(folder, "glb").read_bytes()
    (length,) = struct.unpack("<I", data[12:16])
    return of_json(json.loads(data[20 : 20 + length]))


def as_ply(folder: Path) -> Any:
    path = mesh(folder, "ply")
    header = path.read_bytes().partition(b"end_header\n")[0].decode("ascii")
    words = [line.split()[0] for line in header.splitlines()]
    comments = words.count("comment")
    kept = [word for word in words if word != "comment"]
    assert comments >= 3
    return kept, len(trimesh.load(path, process=False).faces)


def as_stl(folder: Path) -> Any:
    data = mesh(folder, "stl").read_bytes()
    assert not data.startswith(b"solid") and data[:80].rstrip(b"\0 ").isascii()
    return len(data)


def dem(folder: Path, ending: str, *more: object) -> Path:
    path = folder / f"out.{ending}"
    words = ("export-dem", folder / "site.json", path, "--resolution", 0.5, *more)
    printable(ran(*words))
    return path


def as_geotiff(folder: Path) -> Any:
    path = dem(folder, "tif", "--layer", "height", "--layer", "surface")
    found: list[Any] = []
    for name in (path, path.with_name("out-surface.tif")):
        with rasterio.open(name) as file:
            found += [sorted(file.tags()), sorted(file.tags(1)), file.descriptions, file.units]
        aside = name.with_name(f"{name.name}.aux.xml")
        found.append(aside.exists() and of_xml(aside.read_bytes()))
    return found


def as_image(folder: Path) -> Any:
    path = dem(folder, "png", "--layer", "surface")
    with rasterio.open(path) as file:
        found = [sorted(file.tags()), sorted(file.tags(1))]
    return [found, of_xml((folder / "out.png.aux.xml").read_bytes())]


def as_vrt(folder: Path) -> Any:
    words = ("--resolution", 0.5, "--layer", "height", "--layer", "surface")
    printable(ran("export-dem", folder / "site.json", "--tiles", folder / "tiles", *words))
    names = sorted(path.name for path in (folder / "tiles").iterdir())
    found = []
    for name in ("mosaic.vrt", "mosaic-surface.vrt"):
        text = (folder / "tiles" / name).read_bytes()
        sources = [e.text for e in ElementTree.fromstring(text).iter("SourceFilename")]
        found.append((of_xml(text), sources))
    return names, found


def report(folder: Path, ending: str, *more: object) -> str:
    path = folder / f"report.{ending}"
    words = ("--resolution", 1, "--headings", 4, "--route", 1, 1, 5, 3, "--report", path)
    printable(
        ran("traversability", folder / "site.json", "--vehicle", folder / VEHICLE, *words, *more)
    )
    return path.read_text(encoding="utf-8")


VEHICLE = "vehicle.json"


def as_html(folder: Path) -> Any:
    found = of_html(report(folder, "html"))
    tags = {entry[0] for entry in found if isinstance(entry, tuple)}
    assert not tags & {"script", "img-", "iframe", "object", "a", "x"}
    return found


def as_markdown(folder: Path) -> Any:
    return of_markdown(report(folder, "md"))


def as_slip(folder: Path) -> Any:
    text = report(folder, "svg")
    assert ElementTree.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
    return of_html(text)


def compared(ending: str) -> Callable[[Path], Any]:
    """The page or the Markdown of two vehicles side by side."""

    def output(folder: Path) -> Any:
        other = folder / "other.json"
        other.write_bytes((folder / VEHICLE).read_bytes())
        skeleton = {"html": of_html, "md": of_markdown}[ending]
        return skeleton(report(folder, ending, "--vehicle", other))

    return output


def as_report(folder: Path) -> Any:
    return of_json(json.loads(report(folder, "json")))


def as_csv(folder: Path) -> Any:
    text = ran("query", folder / "site.json", 1, 1, 3, 1, 9, 9)
    printable(text)
    rows = list(csv.reader(io.StringIO(text)))
    assert not [cell for row in rows[1:] for cell in row[3:5] if cell[:1] in tuple("=+-@\t\r")]
    name = next(iter(json.loads((folder / "site.json").read_text())["surfTypes"]))
    cell = rows[2][3]
    if cell.isascii():  # escapes are those of Python, and can be undone
        assert cell.encode("ascii").decode("unicode_escape") in (name, f"'{name}")
    return [len(row) for row in rows]


def as_json(folder: Path) -> Any:
    words = ("query", folder / "site.json", 1, 1, 3, 1, 9, 9, "--json")
    found = json.loads(ran(*words))
    name = next(iter(json.loads((folder / "site.json").read_text())["surfTypes"]))
    assert found["points"][1]["surface"] == name
    return of_json(found)


def as_info(folder: Path) -> Any:
    printable(text := ran("info", folder / "site.json"))
    return len(text.splitlines())


def as_info_json(folder: Path) -> Any:
    return of_json(json.loads(ran("info", folder / "site.json", "--json")))


def as_geojson(folder: Path) -> Any:
    return of_json(json.loads(ran("info", folder / "site.json", "--geojson")))


def findings(folder: Path, form: str) -> str:
    """Of the terrain without its surface, so that messages have its name."""
    terrain = json.loads((folder / "site.json").read_text())
    terrain["surfTypes"] = {"other": {"preset": terrain["descr"]}}
    terrain[f"no key {terrain['descr']}"] = 1
    path = folder / "wrong.json"
    path.write_text(json.dumps(terrain))
    return ran("validate", path, "--format", form, codes=(1,))


def as_text(folder: Path) -> Any:
    printable(text := findings(folder, "text"))
    return [line[:2] for line in text.splitlines()]


def as_github(folder: Path) -> Any:
    lines = findings(folder, "github").split("\n")
    assert all(line.isprintable() or "\t" in line for line in lines)
    annotation = re.compile(r"::(error|warning) file=[^:,]*,line=\d+,col=\d+,title=TT\d+::.*")
    return [bool(annotation.fullmatch(line)) or line[:8] for line in lines]


def as_findings(form: str) -> Callable[[Path], Any]:
    reader = of_xml if form == "junit" else lambda text: of_json(json.loads(text))
    return lambda folder: reader(findings(folder, form))


def as_canonical(folder: Path) -> Any:
    ran("format", folder / "site.json")
    text = (folder / "site.json").read_text()
    return of_json(json.loads(text))


def as_driven(folder: Path) -> Any:
    (folder / "path.csv").write_text("1,1\n5,3\n")
    words = ("--waypoints", folder / "path.csv", "--output", folder / "driven.json")
    told = ran("deform", folder / "site.json", "--vehicle", folder / VEHICLE, *words)
    printable(told)
    return of_json(json.loads((folder / "driven.json").read_text()))


OUTPUTS: dict[str, Callable[[Path], Any]] = {
    "obj": as_obj, "vrml": as_vrml, "elevation grid": as_grid, "x3d": as_x3d, "usda": as_usd,
    "usdc": lambda folder: as_usd(folder, "usdc"), "glb": as_glb, "ply": as_ply, "stl": as_stl,
    "geotiff": as_geotiff, "png": as_image, "vrt": as_vrt, "html": as_html,
    "markdown": as_markdown, "slip": as_slip, "compared": compared("html"),
    "compared markdown": compared("md"), "report": as_report, "csv": as_csv, "json": as_json,
    "info": as_info, "info json": as_info_json, "geojson": as_geojson, "text": as_text,
    "github": as_github, "canonical": as_canonical, "deform": as_driven,
    **{form: as_findings(form) for form in ("sarif", "junit", "gitlab")},
    "findings": as_findings("json"),
}  # fmt: skip


def put(folder: Path, name: str) -> None:
    (folder / "site.json").write_text(json.dumps(site(name)))
    (folder / VEHICLE).write_text(json.dumps(vehicle(name)))


@cache
def expected(output: str) -> Any:
    with TemporaryDirectory() as name:
        put(Path(name), PLAIN)
        return OUTPUTS[output](Path(name))


@pytest.mark.slow
@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("hostile", HOSTILE)
def test_names(hostile: str, output: str, tmp_path: Path) -> None:
    put(tmp_path, HOSTILE[hostile])
    assert OUTPUTS[output](tmp_path) == expected(output)
    assert not [path for path in tmp_path.parent.iterdir() if path.name == "passwd"]


# --- names of files ------------------------------------------------------------------------------

FILES = {
    key: name
    for key, name in HOSTILE.items()
    if name.strip() and "/" not in name and len(name) < 80
}


@pytest.fixture(params=FILES)
def named(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """A folder with a terrain and a vehicle of a hostile name, which is the current folder."""
    name = FILES[request.param]
    (tmp_path / f"{name}.json").write_text(json.dumps(site("rock")))
    (tmp_path / f"{name}-vehicle.json").write_text(json.dumps(vehicle("rover")))
    before = Path.cwd()
    os.chdir(tmp_path)
    yield tmp_path, name
    os.chdir(before)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
def test_files_in_reports(named: tuple[Path, str], tmp_path: Path) -> None:
    _, name = named
    reports = {"html": of_html, "md": of_markdown, "json": lambda text: of_json(json.loads(text))}
    (tmp_path / "a.json").write_text(json.dumps(site("rock")))
    (tmp_path / "a-vehicle.json").write_text(json.dumps(vehicle("rover")))
    found = []
    for stem in ("a", name):
        words = ["--resolution", 1, "--headings", 4, "--vehicle", f"./{stem}-vehicle.json"]
        words += [word for end in reports for word in ("--report", f"out.{end}")]
        printable(ran("traversability", f"./{stem}.json", *words, "--overwrite"))
        texts = {end: (tmp_path / f"out.{end}").read_text() for end in reports}
        found.append([reports[end](text) for end, text in texts.items()])
    assert found[0] == found[1]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
def test_files_in_findings(named: tuple[Path, str], tmp_path: Path) -> None:
    _, name = named
    wrong = json.dumps({**site("rock"), "no key": 1})
    found = []
    for stem in ("a", name):
        (tmp_path / f"{stem}.json").write_text(wrong)
        file = f"./{stem}.json"
        told = {form: ran("validate", file, "--format", form, codes=(1,))
                for form in ("text", "github", "json", "sarif", "gitlab", "junit")}  # fmt: skip
        printable(told["text"])
        printable(told["github"])
        found.append([
            len(told["text"].splitlines()), [line[:8] for line in told["github"].split("\n")],
            *(of_json(json.loads(told[form])) for form in ("json", "sarif", "gitlab")),
            of_xml(told["junit"]),
        ])  # fmt: skip
    assert found[0] == found[1]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
def test_files_that_are_written(named: tuple[Path, str]) -> None:
    """Each is there, or was refused in a sentence; the OBJ still finds its materials."""
    folder, name = named
    for ending in ("obj", "x3d", "wrl", "glb", "tif", "asc", "json"):
        out = f"./{name}-out.{ending}"
        if ending in ("tif", "asc"):
            words: tuple[object, ...] = ("export-dem", f"./{name}.json", out, "--resolution", 1)
        elif ending == "json":
            words = ("deform", f"./{name}.json", "--vehicle", f"./{name}-vehicle.json",
                     "--waypoints", "path.csv", "--output", out)  # fmt: skip
            (folder / "path.csv").write_text("1,1\n5,3\n")
        else:
            words = ("export-mesh", f"./{name}.json", out, "--max-error", 1)
        done = call(*words)
        printable(done.out + done.err)
        assert done.code == 0 or (done.code in (2, 3) and not (folder / out).exists())
        if ending == "obj" and done.code == 0:
            text = (folder / out).read_text()
            assert set(of_lines(text)) == {"mtllib", "v", "vn", "g", "usemtl", "f"}
            (materials,) = re.findall("^mtllib (.*)$", text, re.MULTILINE)
            assert (folder / materials).exists()


def test_files_that_are_not_there(named: tuple[Path, str]) -> None:
    _, name = named
    file = f"./no {name}"
    for words in (
        ("query", file, 1, 1),
        ("export-dem", file, "a.tif"),
        ("validate", file),
        ("import-terrain", file, "a.json"),
    ):
        done = call(*words)
        assert done.code in (2, 3)
        printable(done.out + done.err)
