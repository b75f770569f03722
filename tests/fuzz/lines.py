"""Poses, ways and points by lines, and what a project sets and knows: a few mistakes in each."""

from __future__ import annotations

import json
import os
import random
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from terratool.cli.baseline import read_baseline
from terratool.cli.config import read_config
from terratool.sensing.poses import read_poses
from terratool.traversability.route.waypoints import read_waypoints
from tests.commands import ROOT
from tests.fuzz.harness import Case, Target, WrongError, ask
from tests.fuzz.mutation import NUMBERS, TEXTS, mutate_bytes, mutate_text, mutate_tree

_YARD = ROOT / "samples" / "stairs-and-kerbs.json"
_HUSKY = ROOT / "samples" / "vehicles" / "husky-a200.json"
_HOKUYO = ROOT / "samples" / "sensors" / "hokuyo-utm-30lx.json"

_LINES = [
    b"time,x,y,z,yaw,pitch,roll\n0,3,3,1,0,0,0\n0.5,4,5,1,20,-3,1e0\n1.5,4.5,6,1.5,40,0,0\n",
    b"# a path\nX, Y , yaw\r\n3,3,0\r\n\r\n4,5.5,-90\r\n",
    b'\xef\xbb\xbfx;y\n3;4\n5;6\n"7";8\n',
    b"3 4\n5\t6\n7.5 8.25e0\n",
    b'y,x,name\n3,4,"a ""b"""\n5,6,\'\n',
    b'{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry": '
    b'{"type": "LineString", "coordinates": [[3, 4], [5, 6, 7], [8.5, 9]]}}]}',
    b'{"type": "LineString", "coordinates": [[3, 4], [12, 4]]}',
]
_ODD = [
    "²", "١", "1_0", "nan", "-inf", "1e400", "9" * 5000, '"', '""', "\0", "\u2028", "é", "0x1",
    ",", ";", "\t", "#", "[" * 3000, "{", "}", "x" * 140_000, ",".join("1" * 3000),
]  # fmt: skip


def make_lines(rng: random.Random) -> Case:
    """Lines of numbers, or a line of GeoJSON, with one to a few mistakes."""
    data = rng.choice(_LINES)
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        if rng.random() < 0.2:
            at = rng.randint(0, len(data))
            data = data[:at] + rng.choice(_ODD).encode() + data[at + rng.randint(0, 3) :]
        else:
            data = mutate_text(rng, data, rng.choice(_LINES))
    return Case(".csv", data)


def try_lines(case: Case, folder: Path) -> str:
    """Read them as poses and as a way, as points now and then; by the commands that take them."""
    name, draw = folder / "case.csv", zlib.crc32(case.data)
    name.write_bytes(case.data)
    try:
        if draw % 32 == 0:
            ask("query", _YARD, "--points", name)
        if draw % 128 == 1:
            ask(
                "deform",
                _YARD,
                "--vehicle",
                _HUSKY,
                "--waypoints",
                name,
                "--output",
                folder / "a.json",
            )
        if draw % 128 == 2:
            ask("scan", _YARD, folder / "a.npz", "--sensor", _HOKUYO, "--poses", name)
        if draw % 2:
            points = read_waypoints(name)
        else:
            poses = read_poses(name)
            points = np.concatenate([poses.positions, poses.turns, poses.times[:, None]], axis=1)
        if not np.isfinite(points).all():
            raise WrongError("a place is no number")
    finally:
        for path in folder.iterdir():
            path.unlink()
    return "read"


# --- what a project sets and knows ---------------------------------------------------------------

_SETTINGS = [
    """# what holds here
paths = ["a.json", "."]
strict = true
select = ["TT1", "TT2"]
ignore = ["TT402"]
max-step = 0.3
max-findings = 7
formats = ["json", "sarif=out.sarif"]
baseline = "known.json"

[per-file-ignores]
"a*" = ["TT2", "TT306"]
"sub/*.json" = ["TT101"]
""",
    '[project]\nname = "a"\n[tool.other]\nx = 1979-05-27T07:32:00Z\n[tool.terratool]\n'
    'paths = ["a.json"]\nmax-step = 1e-1\n[tool.terratool.per-file-ignores]\n"*" = ["TT4"]\n',
]
_KNOWN = '{"findings": {"a.json": {"00ff": 1, "ff00": 2}, "sub/b.json": {}}, "format_version": 1}'
_VALUES = [
    "9" * 5000, "1e999", "inf", "nan", "-1", "0x" + "f" * 2000, '""', "''", "[]", "{}", "[[]]",
    "[" * 2000, "{a={a={}}}", "1979-05-27", '"""', '"\\u0000"', '"\\ud800"', "²", "true", "0b2",
    '["TT9"]', '["text=a.txt"]', '["json=b.json", "text"]', '["none"]', '"../x"', "a.b.c.d = 1",
]  # fmt: skip


def make_settings(rng: random.Random) -> Case:
    """Settings of a project, or a baseline, with one to a few mistakes."""
    if rng.random() < 0.2:
        tree: Any = json.loads(_KNOWN)
        for _ in range(rng.choice([1, 1, 2, 4])):
            tree = mutate_tree(rng, tree, ["findings", "format_version"], json.loads(_KNOWN))
        data = json.dumps(tree).encode("utf-8", "replace")
        return Case(".json", mutate_bytes(rng, data, data) if rng.random() < 0.2 else data)
    at = rng.randrange(2)
    data = _SETTINGS[at].encode()
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        lines = data.split(b"\n")
        line = rng.randrange(len(lines))
        kind = rng.randrange(6)
        key = lines[line].partition(b"=")[0]
        if kind < 2:
            lines[line] = key + b"= " + rng.choice([*_VALUES, *map(str, NUMBERS)]).encode()
        elif kind == 2:
            lines[line] = key + b"= " + json.dumps(rng.choice(TEXTS)).encode()
        data = b"\n".join(lines) if kind < 3 else mutate_text(rng, data, data)
    return Case((".toml", "pyproject.toml")[at], data)


def try_settings(case: Case, folder: Path) -> str:
    """Read them; those that stay in their folder hold for a command now and then."""
    if case.suffix == ".json":
        (folder / "known.json").write_bytes(case.data)
        read_baseline(str(folder / "known.json"))
        return "known"
    name = folder / (case.suffix if case.suffix != ".toml" else ".terratool.toml")
    name.write_bytes(case.data)
    before = Path.cwd()
    try:
        config = read_config(name)
        if config is None:
            return "none"
        if zlib.crc32(case.data) % 32 == 0 and _stays(config.paths):
            (folder / "a.json").write_bytes(_YARD.read_bytes())
            os.chdir(folder)
            ask("validate")
    finally:
        os.chdir(before)
        for path in folder.iterdir():
            path.unlink()
    return "set"


def _stays(paths: tuple[str, ...]) -> bool:
    """Whether paths lead out of no folder, as far as can be seen."""
    return not any(path.startswith(("/", "-")) or ".." in path for path in paths)


TARGETS = (
    Target("lines", 100_000, make_lines, try_lines),
    Target("settings", 100_000, make_settings, try_settings),
)
