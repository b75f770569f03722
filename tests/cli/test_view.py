"""`terratool view`: what it writes, what it refuses, and how it says so."""

from __future__ import annotations

import json
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.commands import ROOT, SAMPLE, YARD, call, run

HUSKY = ROOT / "samples/vehicles/husky-a200.json"


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Addresses that a browser with a window is asked to open."""
    asked: list[str] = []

    def take(url: str) -> bool:
        asked.append(url)
        return True

    monkeypatch.setattr(webbrowser, "open", take)
    monkeypatch.setenv("DISPLAY", ":0")
    return asked


def test_a_page_is_written_and_opened(opened: list[str], tmp_path: Path) -> None:
    out = tmp_path / "a page.html"
    ran = call("view", SAMPLE, "--output", out)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith(f"{out}: ")
    assert f"{out.stat().st_size:,} bytes" in ran.out
    assert opened == [out.as_uri()]
    first = out.read_bytes()
    ran = call("view", SAMPLE, "--output", out, "--no-open")
    assert ran.code == 3
    assert "exists already" in ran.err
    assert call("view", SAMPLE, "--output", out, "--no-open", "--overwrite").code == 0
    assert out.read_bytes() == first
    assert len(opened) == 1


def test_without_a_name_it_goes_into_a_folder_of_its_own(
    opened: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    ran = call("view", SAMPLE)
    assert ran.code == 0
    [page] = tmp_path.glob("terratool-*/paper-example.html")
    assert page.parent.stat().st_mode & 0o077 == 0
    assert ran.out.startswith(f"{page}: ")
    assert opened == [page.as_uri()]
    text = Path(SAMPLE).read_text("utf-8")
    ran = call("view", "-", stdin=text)
    assert ran.code == 0
    assert len(list(tmp_path.glob("terratool-*/terrain.html"))) == 1


def test_where_there_is_no_window_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER", "WSL_DISTRO_NAME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    ran = call("view", SAMPLE, "--output", tmp_path / "a.html")
    assert ran.code == 0
    assert ran.err == "No browser can be opened here. Open the page in yours.\n"


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["missing.json"], 3, "cannot be read"),
        (["missing.json", "--watch"], 3, "cannot be read"),
        ([SAMPLE, "--vehicle", "missing.json"], 3, "cannot be read"),
        ([SAMPLE, "--watch", "--output", "a.html"], 2, "--watch serves the page"),
        (["-", "--watch"], 2, "--watch needs a file"),
        ([SAMPLE, "--port", "8000"], 2, "--port is about --watch"),
        ([SAMPLE, "--watch", "--port", "65536"], 2, "--port"),
        ([SAMPLE, "--route", "1", "1", "2", "2"], 2, "A route needs a vehicle"),
        ([SAMPLE, "--route", "1", "1", "nan", "2", "--vehicle", str(HUSKY)], 2, "goal"),
        ([SAMPLE, "--route", "1", "1", "200", "2", "--vehicle", str(HUSKY)], 2, "goal"),
        ([SAMPLE, "--max-error", "nan"], 2, "The largest error is nan"),
        ([SAMPLE, "--max-error", "0"], 2, "The largest error is 0"),
        ([SAMPLE, "--max-faces", "0"], 2, "At most 0 faces"),
        ([SAMPLE, "--output", "a.txt"], 2, "is no name of a page"),
        ([SAMPLE, "--output", "none/a.html"], 3, "does not exist"),
        ([str(HUSKY)], 1, "is a vehicle, where a terrain is wanted"),
        ([str(ROOT / "samples/invalid/TT201-unknown-primitive.json")], 1, "TT201"),
    ],
)
def test_what_cannot_be_is_said(arguments: list[str], code: int, says: str) -> None:
    ran = call("view", *arguments, "--no-open")
    assert (ran.code, ran.out) == (code, "")
    assert says in ran.err


def test_ground_that_is_all_void_is_said(saved: Callable[[dict[str, Any]], Path]) -> None:
    path = saved({
        "size": 4, "surfTypes": {"hole": {"void": True}}, "elemTypes": {"b": {"x": [1]}},
        "elemTree": {"type": "b", "surface": "hole"},
    })  # fmt: skip
    ran = call("view", path, "--no-open")
    assert ran.code == 2
    assert "all of it is void" in ran.err


def test_the_definition_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "yard.html"
    path.write_text(json.dumps(YARD), "utf-8")
    ran = call("view", path, "--output", path, "--overwrite", "--no-open")
    assert ran.code == 3
    assert "is the definition itself" in ran.err
    assert json.loads(path.read_text("utf-8")) == YARD


@pytest.mark.slow
def test_a_route_without_a_way_is_a_no(tmp_path: Path) -> None:
    """The page is there, and says why; another route is there, too."""
    out = tmp_path / "a.html"
    site = ROOT / "samples/stairs-and-kerbs.json"
    words = ["view", site, "--vehicle", HUSKY, "--output", out, "--no-open", "--max-error", 0.1]
    ran = call(*words, "--route", 1, 1, 12, 1, "--route", 0, 0, 8, 5)
    assert ran.code == 1
    assert ran.err.startswith("terratool: There is no such route. The vehicle cannot stand at")
    assert ran.err.count("\n") == 1 and out.exists()
    ran = call(*words, "--route", 1, 1, 12, 1, "--overwrite")
    assert (ran.code, ran.err) == (0, "")


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    ran = call(
        "view", ROOT / "samples/stairs-and-kerbs.json", "--output", tmp_path / "a.html",
        "--no-open", "--max-faces", 3,
    )  # fmt: skip
    assert "2 faces within 4 m, as far as measured" in ran.out
    assert "  Left out: 29 elements; heights change by up to 4 m.\n" in ran.out


def test_a_grid_in_place_of_a_mesh_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terratool.viewing.effort.MOST_WORK", 0)
    ran = call("view", SAMPLE, "--output", tmp_path / "a.html", "--no-open", "--max-faces", 800)
    assert ran.code == 0
    assert (
        "as far as measured" in ran.out
        and "  It is drawn from a grid of 21 × 21 heights" in ran.out
    )


def test_help_has_an_example() -> None:
    ran = run("view", "--help")
    assert ran.code == 0
    assert "terratool view samples/warehouse.json" in ran.out
