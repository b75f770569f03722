"""Whatever names and descriptions are, the files of all targets can be read."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from terratool.errors import RequestError
from terratool.simulators.targets import TARGETS
from tests.conftest import terrain_of
from tests.meshes import SITE
from tests.simulators.checks import written

WRITTEN_HERE = ("mujoco", "gazebo", "pybullet", "usd", "chrono")
NASTY = '<--"&\x01 --->'


def named(*surfaces: str, descr: str = "A site") -> dict[str, Any]:
    """The site with other surfaces: of the ground, of its column, of its box."""
    places = dict(zip((5, 4), surfaces[1:], strict=False))
    children = [
        {key: value for key, value in child.items() if value != "grass"}
        | ({"surface": places[child["cellX"]]} if child["cellX"] in places else {})
        for child in SITE["elemTree"]["children"]
    ]
    return {
        **SITE,
        "descr": descr,
        "surfTypes": {**{name: {} for name in surfaces}, "hole": {"void": True}},
        "elemTree": {**SITE["elemTree"], "surface": surfaces[0], "children": children},
    }


@pytest.mark.nightly
@pytest.mark.parametrize("target", WRITTEN_HERE)
def test_nasty_names(target: str, tmp_path: Path) -> None:
    if target == "usd":
        pytest.importorskip("pxr", reason="usd-core is not installed")
    definition = named(NASTY, "Ёж", "sand", descr=f"{NASTY}\n---")
    folder, _, manifest = written(terrain_of(definition), tmp_path / "o", target)
    assert set(manifest["surfaces"]) == {NASTY, "Ёж", "sand"}
    for path in folder.iterdir():
        assert path.name.isascii()
        if path.suffix in (".urdf", ".sdf", ".config"):
            ET.parse(path)
        elif path.suffix == ".json":
            json.loads(path.read_bytes())


@pytest.mark.parametrize("target", ["gazebo", "pybullet", "chrono"])
def test_files_differ_by_more_than_case(target: str, tmp_path: Path) -> None:
    folder, _, _ = written(terrain_of(named("Sand", "sand", "SAND")), tmp_path / "o", target)
    names = [path.name for path in folder.iterdir()]
    assert len({name.lower() for name in names}) == len(names)
    assert sum(name.endswith(".obj") for name in names) == 3


@pytest.mark.parametrize("heightmap", [False, True])
@pytest.mark.parametrize("target", WRITTEN_HERE)
def test_no_ground(target: str, heightmap: bool, tmp_path: Path) -> None:
    """It is said in a sentence, and nothing is left."""
    if target == "usd":
        pytest.importorskip("pxr", reason="usd-core is not installed")
    tree = {"type": "slope", "surface": "hole"}
    terrain = terrain_of({**SITE, "elemTree": tree})
    with pytest.raises(RequestError, match="all of it is void"):
        written(terrain, tmp_path / "o", target, heightmap=heightmap)
    assert not (tmp_path / "o").exists()


def test_readmes_can_be_shown(tmp_path: Path) -> None:
    """Names and descriptions bring no control characters and no rows of their own."""
    definition = named("a|b\x1b[31m\nc", descr="red\x1b[31m\nfox")
    folder, _, manifest = written(terrain_of(definition), tmp_path / "o", "pybullet")
    text = (folder / "README.md").read_text("utf-8")
    assert "\nfox\n" in text
    assert "\x1b" not in text and text[-1:] == "\n"
    assert r"| a\|b\\x1b\[31m\\nc | 0.7 |" in text  # as signs of Markdown have to be written
    assert manifest["losses"][-1].endswith(r"fricAngle: a|b\x1b[31m\nc.")


def test_targets_name_their_module() -> None:
    for target in TARGETS.values():
        assert target.write.__module__ == f"terratool.simulators.{target.writer}"
