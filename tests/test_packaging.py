"""A built wheel works outside of the checkout, with its schemas."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.nightly  # the wheel is compiled; CI uses one by `make outside`

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel built from this checkout, unpacked far from it."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [
        sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation",
        "--no-index", "-Ccmake.define.TERRATOOL_VARIANTS=native", "--wheel-dir", str(folder),
        str(ROOT),
    ]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True, cwd=folder)
    (wheel,) = folder.glob("terratool-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def run(unpacked: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Without `site`, which would find the checkout where it is installed in place."""
    others = [sysconfig.get_path(name) for name in ("purelib", "platlib")]
    return subprocess.run(
        [sys.executable, "-S", *arguments],
        capture_output=True, text=True, check=True, cwd=unpacked.parent,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(unpacked), *others])},
    )  # fmt: skip


def test_the_wheel_has_the_schemas_and_nothing_stray(unpacked: Path) -> None:
    tops = {path.name for path in unpacked.iterdir() if not path.name.endswith(".dist-info")}
    assert tops == {"terratool"}
    for path in (ROOT / "schemas").iterdir():
        assert (unpacked / "terratool" / "schemas" / path.name).read_bytes() == path.read_bytes()
    package = Path("terratool")
    style = package / "traversability" / "report" / "style.css"  # of the HTML report
    page = package / "viewing" / "page"
    types = (package / "py.typed", package / "__init__.pyi")
    for path in (
        style,
        *types,
        *(page / name for name in ("template.html", "page.css", "page.js")),
    ):
        assert (unpacked / path).read_bytes() == (ROOT / path).read_bytes()


def test_the_wheel_works_by_itself(unpacked: Path) -> None:
    code = "import terratool; print(terratool.__file__); print(terratool.schema()['title'])"
    where, title = run(unpacked, "-c", code).stdout.splitlines()
    assert Path(where).parent == unpacked / "terratool"
    assert title == "terratool terrain definition"
    sample = str(ROOT / "samples" / "paper-example.json")
    assert run(unpacked, "-m", "terratool", "query", sample, "15", "15").stdout.count("\n") == 2
