"""Commands in this process, where all kernels are loaded already."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pytest

from terratool.cli import main
from tests.commands import Ran

Within = Callable[..., Ran]


@pytest.fixture
def within(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Within:
    """Run `terratool` with these arguments."""

    def ran(*arguments: object) -> Ran:
        monkeypatch.setattr(sys, "argv", ["terratool", *map(str, arguments)])
        code = main._run()
        return Ran(code, *capsys.readouterr())

    return ran
