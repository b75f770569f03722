"""Shared helpers: terrains from plain dictionaries."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from terratool.definition.reader import check
from terratool.definition.source import Source
from terratool.field.terrain import Terrain

settings.register_profile(
    "terratool",
    deadline=None,  # the first call of a kernel compiles it
    suppress_health_check=list(HealthCheck),
    derandomize="TERRATOOL_FUZZ" not in os.environ,
    database=None,
    print_blob=True,
)
settings.load_profile("terratool")


def terrain_of(definition: dict[str, Any]) -> Terrain:
    """The terrain of a definition that must be valid."""
    checked = check(Source("test.json", json.dumps(definition).encode()))
    assert checked.definition is not None, checked.findings
    return Terrain(checked.definition)


@pytest.fixture
def saved(tmp_path: Path) -> Callable[[dict[str, Any]], Path]:
    """Save a definition in a file of its own."""

    def save(definition: dict[str, Any], name: str = "terrain.json") -> Path:
        path = tmp_path / name
        path.write_text(json.dumps(definition), encoding="utf-8")
        return path

    return save
