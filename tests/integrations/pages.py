"""Examples of docs/train-robots.md, which need programs that other tests go without."""

from __future__ import annotations

import re

from tests.commands import ROOT
from tests.test_docs import run_python


def run_section(heading: str) -> None:
    """Run the blocks of a section, and compare values with their comments."""
    page = (ROOT / "docs" / "train-robots.md").read_text("utf-8")
    (section,) = re.findall(rf"^## {heading}\n(.*?)(?=^## |\Z)", page, re.MULTILINE | re.DOTALL)
    blocks = re.findall(r"^```py\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)
    assert blocks
    for block in blocks:
        run_python(block)
