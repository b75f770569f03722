"""Shared helpers: terrains from plain dictionaries."""

from __future__ import annotations

import http.server
import json
import os
import tempfile
import threading
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
from hypothesis import HealthCheck, settings

from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.text.source import Source
from tests.budget import examples
from tests.programs import how_to_get, lacked

# the cache of this user stays as it is, and processes of tests have one together
os.environ["XDG_CACHE_HOME"] = str(Path(tempfile.gettempdir(), f"terratool-tests-{os.getuid()}"))

settings.register_profile(
    "terratool",
    deadline=None,
    max_examples=examples(100),
    suppress_health_check=list(HealthCheck),
    derandomize="TERRATOOL_FUZZ" not in os.environ,
    database=None,
    print_blob=True,
)
settings.load_profile("terratool")


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """With TERRATOOL_NO_SKIPS=1, as in CI, a test that lacks a program or a package fails."""
    return _unskipped((yield))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """The same for a module that is skipped as a whole."""
    return _unskipped((yield))


Report = TypeVar("Report", pytest.TestReport, pytest.CollectReport)


def _unskipped(report: Report) -> Report:
    why = str(report.longrepr[2]) if isinstance(report.longrepr, tuple) else str(report.longrepr)
    if report.outcome == "skipped" and lacked(why) and os.environ.get("TERRATOOL_NO_SKIPS") == "1":
        report.outcome = "failed"
        report.longrepr = f"{why}, and TERRATOOL_NO_SKIPS=1 wants all tests to run"
    return report


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> Generator[None, object, object]:
    """The last line of all says what was lacking; TERRATOOL_LACKING names a file for the tests."""
    done = yield
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None or hasattr(session.config, "workerinput"):
        return done
    skipped = {
        report.nodeid: name
        for report in reporter.stats.get("skipped", [])
        if isinstance(report.longrepr, tuple) and (name := lacked(report.longrepr[2]))
    }
    if path := os.environ.get("TERRATOOL_LACKING"):
        Path(path).write_text("".join(f"{test}\n" for test in skipped), "utf-8")
    if skipped:
        names = sorted(set(skipped.values()))
        reporter.write_line(
            f"{len(skipped)} skipped for want of {', '.join(names)}: {how_to_get(names)}"
        )
    return done


def text_of(value: Any) -> str:
    """A value as JSON; elements may nest deeper than json.dumps can go."""
    opened, pending = [], value
    while isinstance(pending, dict) and ("children" in pending or "elemTree" in pending):
        inner = "elemTree" if "elemTree" in pending else "children"
        if inner == "children" and len(pending["children"]) != 1:
            break
        rest = json.dumps({key: item for key, item in pending.items() if key != inner})[1:-1]
        brackets = ("[", "]") if inner == "children" else ("", "")
        opened.append((f'{{{rest}{", " * bool(rest)}"{inner}": {brackets[0]}', brackets[1] + "}"))
        pending = pending["children"][0] if inner == "children" else pending["elemTree"]
    before = "".join(part for part, _ in opened)
    return before + json.dumps(pending) + "".join(part for _, part in reversed(opened))


def terrain_of(definition: dict[str, Any], *, roughness: bool = True) -> Terrain:
    """The terrain of a definition that must be valid; with reliefs or without.

    It lies beside the rasters of tests/classes.py, if it has any.
    """
    text, name = text_of(definition), "test.json"
    if '"surfaceGrid"' in text:
        from tests.classes import class_folder

        name = str(class_folder() / name)
    checked = check(Source(name, text.encode()))
    assert checked.definition is not None, checked.findings
    return Terrain(checked, roughness=roughness)


@pytest.fixture
def saved(tmp_path: Path) -> Callable[[dict[str, Any]], Path]:
    """Save a definition in a file of its own."""

    def save(definition: dict[str, Any], name: str = "terrain.json") -> Path:
        path = tmp_path / name
        path.write_text(json.dumps(definition), encoding="utf-8")
        return path

    return save


@pytest.fixture
def server() -> Iterator[tuple[str, list[str]]]:
    """An address on this machine, and what was asked of it."""
    asked: list[str] = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_error(404)

        def log_message(self, *args: object) -> None:
            pass

    listening = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=listening.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{listening.server_port}", asked
    listening.shutdown()
    listening.server_close()
