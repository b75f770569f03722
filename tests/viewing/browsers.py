"""A Chromium without a window, in which pages are opened and clicked."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.programs import program


@contextmanager
def chromium(
    folder: Path, width: int = 1000, height: int = 700, options: Sequence[str] = ()
) -> Iterator[Any]:
    """A browser of its own, with a new profile; it draws without a graphics card."""
    further = options
    binary, driver = program("chromium"), program("chromedriver")
    selenium = pytest.importorskip("selenium.webdriver")
    from selenium.webdriver.chrome.service import Service

    os.environ["SE_OFFLINE"] = "true"  # nothing is fetched
    options = selenium.ChromeOptions()
    options.binary_location = binary
    for argument in (
        "headless=new", "no-sandbox", "disable-gpu", "no-first-run", "use-angle=swiftshader",
        "enable-unsafe-swiftshader", "disable-background-networking", "disable-component-update",
        "disable-sync", "disable-dev-shm-usage", "hide-scrollbars", "force-device-scale-factor=1",
        f"user-data-dir={folder}", f"window-size={width},{height}",
        *further,
    ):  # fmt: skip
        options.add_argument(f"--{argument}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = selenium.Chrome(options=options, service=Service(driver))
    try:
        yield browser
    finally:
        browser.quit()
