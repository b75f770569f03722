"""Finders of walls that threads share."""

from __future__ import annotations

import terratool
from terratool.field.walls import WallFinders
from tests.commands import SAMPLE


def test_each_has_its_own_and_it_is_used_again() -> None:
    """No two at a time have the same finder; one that is done with serves the next."""
    finders = WallFinders(terratool.load(SAMPLE))
    with finders.one() as first, finders.one() as second:
        assert first is not second
    with finders.one() as third:
        assert third is first or third is second
