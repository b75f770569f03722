"""Programs that tests call and that packages of Python do not bring, and how each is had.

A test is skipped without those it asks for here; .ci/run installs them all and wants it to run.
`python -m tests.programs` prints packages of Debian that may be missing.
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterable
from typing import NoReturn

import pytest

DEBIAN = {
    "assimp": "assimp-utils",
    "bash": "bash",
    "c++": "g++",
    "chromedriver": "chromium-driver",
    "chromium": "chromium",
    "gdal_contour": "gdal-bin",
    "gdaldem": "gdal-bin",
    "gdalinfo": "gdal-bin",
    "git": "git",
    "ign": "ignition-tools",
    "ignition-physics": "libignition-physics-dev libignition-physics-heightmap-dev "
    "libignition-physics5-dartsim-plugin5 libsdformat-dev sdformat-sdf",
    "make": "make",
    "mount": "mount",
    "node": "nodejs",
    "npm": "npm",
    "objdump": "binutils",
    "ogr2ogr": "gdal-bin",
    "ogrinfo": "gdal-bin",
    "pivy": "python3-pivy",
    "pkg-config": "pkg-config",
    "strace": "strace",
    "tovrmlx3d": "view3dscene",
}
NPM = ("gltf-validator",)


def program(name: str) -> str:
    """Path of a program; the test is skipped without it."""
    return _path(name) or lacking(name)


def needs(name: str) -> pytest.MarkDecorator:
    """Mark of tests that are skipped without a program."""
    return pytest.mark.skipif(_path(name) is None, reason=f"{name} is not installed")


def _path(name: str) -> str | None:
    assert name in DEBIAN, f"{name} is not in the table of tests/programs.py"
    return shutil.which(name)


def lacking(name: str) -> NoReturn:
    """Skip the test for want of something that would have to be installed."""
    pytest.skip(f"{name} is not installed")


def lacked(why: str) -> str | None:
    """Name of what was lacking, by the reason for which a test was skipped."""
    found = re.search(r"(\S+) is not installed|could not import '(\w+)", why)
    return (found[1] or found[2]) if found else None


def how_to_get(names: Iterable[str]) -> str:
    """Commands that install what is lacking; what no table has is a package of Python."""
    commands: dict[str, set[str]] = {"apt install": set(), "npm install --global": set()}
    for name in names:
        command = "apt install" if name in DEBIAN else "npm install --global"
        if name not in DEBIAN and name not in NPM:
            command = "pip install"
        commands.setdefault(command, set()).update(DEBIAN.get(name, name).split())
    return "; ".join(" ".join([command, *sorted(of)]) for command, of in commands.items() if of)


if __name__ == "__main__":
    lacks = {of for name, of in DEBIAN.items() if shutil.which(name) is None}
    sys.stdout.write(" ".join(sorted(lacks)) + "\n")
