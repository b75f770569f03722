"""Results as JSON."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import UNSET, Struct, UnsetType

import terratool
from terratool.report.documents import Document, Tool, json_text, plain_document


class Inner(Struct, frozen=True):
    """A record in a record."""

    high: float


@dataclass(frozen=True)
class Rut:
    """A record of another kind."""

    depth: float


class Outer(Document, frozen=True, kw_only=True):
    """A document."""

    name: str
    path: Path = Path("a") / "b"
    inner: tuple[Inner, ...] = ()
    ruts: tuple[Rut, ...] = ()
    number: Any = None
    more: int | UnsetType = UNSET


def test_keys_are_fields_in_their_order() -> None:
    """The version first; what is unset is left out."""
    found = Outer(name="x", inner=(Inner(0.1),), ruts=(Rut(2.0),), number=np.float64(0.25))
    assert json_text(found, None) == (
        f'{{"format_version": 1, "name": "x", "path": "{Path("a") / "b"}", '
        '"inner": [{"high": 0.1}], "ruts": [{"depth": 2.0}], "number": 0.25}'
    )
    assert plain_document(found) == json.loads(json_text(found))
    assert plain_document(Outer(name="x", more=3))["more"] == 3


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_null(value: float) -> None:
    found = plain_document(Outer(name="x", inner=(Inner(value), Inner(1.0)), number={"a": value}))
    assert (found["inner"], found["number"]) == ([{"high": None}, {"high": 1.0}], {"a": None})


@pytest.mark.parametrize("value", [10**400, "\ud800", "::error::x", "\x1b[31m", 1e300, 5e-324])
def test_what_is_read_is_what_was_written(value: Any) -> None:
    """Numbers of any size and texts of any kind; on a terminal all of it can be shown."""
    text = json_text({"it": [value]})
    assert json.loads(text) == {"it": [value]}
    assert text.replace("\n", "").isprintable()


def test_a_tool_has_a_version() -> None:
    assert json.loads(json_text(Tool())) == {"name": "terratool", "version": terratool.__version__}


def test_what_is_no_value_is_refused() -> None:
    with pytest.raises(TypeError, match="object is not to be encoded"):
        json_text({"it": object()})
