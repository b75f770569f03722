"""What a look at the keys of a long text rules out."""

from __future__ import annotations

import json

from terratool.text.values import KeySurvey, survey_keys

LONG = {"filling": "x" * 100_000}


def test_a_key_anywhere_is_not_absent() -> None:
    """A key of an inner object counts; a text that is spelled like one does not."""
    text = json.dumps({**LONG, "a": [{"span": 1}, {"span": 2}], "b": "cellX"}).encode()
    survey = survey_keys(text, ("span", "cellX", "turnDeg"))
    assert survey == KeySurvey(may_repeat=False, absent=frozenset({"cellX", "turnDeg"}))


def test_a_repeated_key_is_seen() -> None:
    """Of two objects with the same key none repeats it; of one with it twice it may."""
    head = json.dumps(LONG)[:-1].encode()
    assert not survey_keys(head + b', "a": {"at": 1}, "b": {"at": 2}}').may_repeat
    assert survey_keys(head + b', "a": {"at": 1, "b": {}, "at": 2}}').may_repeat


def test_an_escape_in_a_key_rules_nothing_out() -> None:
    """It may spell any key."""
    text = json.dumps(LONG)[:-1].encode() + b', "\\u0073pan": 1}'
    assert survey_keys(text, ("span", "at")) == KeySurvey()


def test_of_a_short_text_nothing_is_known() -> None:
    """It is read sooner than kernels are loaded."""
    assert survey_keys(b"{}", ("span",)) == KeySurvey()
