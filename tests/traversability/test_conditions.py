"""What `--fail-on` says: what it takes, what it refuses, and when it holds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.errors import RequestError
from terratool.traversability.conditions import FIGURES, WORDS, parse
from terratool.traversability.report.wording import ends
from terratool.traversability.verdicts import Verdict
from tests import reports

ALL = reports.KINDS["all"]
GO = reports.report(routes=(reports.WAY,), verdict=Verdict.GO)


def with_verdict(verdict: Verdict, **more: Any) -> Any:
    return replace(reports.KINDS["map"], verdict=verdict, **more)


@pytest.mark.parametrize(
    ("text", "report", "why"),
    [
        ("no-route", ALL, "2 of 3 routes cannot be driven"),
        ("no-route", GO, ""),
        ("caution", with_verdict(Verdict.GO), ""),
        ("caution", with_verdict(Verdict.CAUTION), "the verdict is caution"),
        ("caution", with_verdict(Verdict.NO_GO), "the verdict is no-go"),
        ("caution", with_verdict(Verdict.UNKNOWN), "the verdict is unknown"),
        ("no-go", with_verdict(Verdict.CAUTION), ""),
        ("no-go", with_verdict(Verdict.UNKNOWN), ""),
        ("no-go", with_verdict(Verdict.NO_GO), "the verdict is no-go"),
        ("unknown", with_verdict(Verdict.GO), "unknown-fraction is 0.229437"),
        ("unknown", with_verdict(Verdict.GO, summary=reports.EMPTY), ""),
        ("unknown", with_verdict(Verdict.UNKNOWN, summary=reports.EMPTY), "verdict is unknown"),
        # of 2330 pixels 600 are go and caution each, 530 no-go and unknown each, 70 others
        ("no-go-fraction>0.22", ALL, "no-go-fraction is 0.229437"),
        ("cut-off-fraction>0.01", ALL, "cut-off-fraction is 0.017316"),
        ("one-way-fraction>0.01", ALL, ""),
        ("no-route", reports.KINDS["no-return"], "1 of 1 routes cannot be driven"),
        ("no-route", reports.KINDS["one-way"], ""),
        ("no-go-fraction > 0.26", ALL, ""),
        ("go-fraction<0.25", ALL, ""),
        ("go-fraction<=0.3", ALL, "go-fraction is 0.25974"),
        ("caution-fraction>=0", ALL, "caution-fraction is"),
        ("unknown-fraction>0.22", ALL, "unknown-fraction is 0.229437"),
        ("reachable-fraction<0.7", ALL, "reachable-fraction is 0.625"),
        ("reachable-fraction<0.625", ALL, ""),
        ("reachable-fraction<=0.625", ALL, "reachable-fraction is 0.625"),
        ("route-length>27", GO, "route-length is 27.3 m"),
        ("route-length>27.3", GO, ""),
        ("route-time>=612", GO, "route-time is 612 s"),
        ("route-energy>5e3", GO, "route-energy is 5230 J"),
        ("least-margin<0.3", GO, "least-margin is 0.27"),
        ("least-margin<0.2", GO, ""),
        ("steepest>12", GO, "steepest is 12.0321°"),  # it is −0.21 rad, downhill
        ("steepest>12.1", GO, ""),
        ("sinkage>0.007", GO, "sinkage is 0.008 m"),  # on the way
        ("sinkage>0.007", reports.KINDS["map"], "sinkage is 0.232 m"),  # of the surfaces
        ("sinkage>0.3", reports.KINDS["map"], ""),
        ("steepest>12", GO, f"° on the way from {ends(reports.WAY)}, at ("),
        ("route-length>27", GO, f" m on the way from {ends(reports.WAY)}"),
        ("sinkage>0.007", reports.KINDS["map"], ' m on "'),
        # a way that there is not fails by itself
        ("route-length>1e9", ALL, ""),
        ("steepest>80", reports.report(routes=(reports.NO_WAY,)), ""),
        (
            "steepest>80",
            reports.report(routes=(replace(reports.WAY, steepest=None),)),
            "steepest is not known on the way from",
        ),
        ("least-margin<0", reports.report(routes=(reports.WAYPOINTS,)), "least-margin is -inf"),
    ],
)
def test_holds(text: str, report: Any, why: str) -> None:
    held = parse(text).why_met(report)
    assert bool(held) == bool(why)
    assert why in held


@pytest.mark.parametrize(
    ("text", "part", "hint"),
    [
        ("noroute", "there is no such condition", "Did you mean no-route?"),
        ("no-go-fractoin>0.3", 'no figure "no-go-fractoin"', "Did you mean no-go-fraction?"),
        ("no-go-fraction", "compared with nothing", "no-go-fraction>0.3"),
        ("no-go>0.3", "no-go is compared with nothing", "Write no-go alone."),
        ("no-go-fraction=0.3", "= compares nothing", "Write >, >=, < or <=."),
        ("no-go-fraction!=0.3", "!= compares nothing", "Write >, >=, < or <=."),
        ("no-go-fraction>", '"" is no number', "Write no-go-fraction>0.3"),
        ("no-go-fraction>30%", '"30%" is no number', "Write no-go-fraction>0.3"),
        ("no-go-fraction>30", "is a share", "from 0 to 1"),
        ("no-go-fraction>nan", "is no number", "Write"),
        ("steepest>inf", "is no number", "Write"),
        ("", "there is no such condition", "There is no-route, caution"),
        ("\x1b[0m", "there is no such condition", "There is no-route"),
    ],
)
def test_refuses(text: str, part: str, hint: str) -> None:
    with pytest.raises(RequestError) as caught:
        parse(text)
    assert part in caught.value.message
    assert hint in caught.value.hint
    assert caught.value.exit_code == 2
    assert caught.value.message.isprintable()


@given(st.text(max_size=30))
def test_any_text_is_taken_or_refused(text: str) -> None:
    try:
        condition = parse(text)
    except RequestError as error:
        assert error.message.isprintable()
    else:
        assert condition.name in {*WORDS, *FIGURES}


@given(st.sampled_from(sorted(FIGURES)), st.sampled_from(["<", "<=", ">", ">="]), st.floats(0, 1))
def test_a_comparison_and_its_opposite(name: str, comparison: str, limit: float) -> None:
    """For a figure that is known just one of them holds."""
    opposite = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}[comparison]
    report = reports.report(routes=(reports.CHARGED,), surfaces=(reports.SAND,))
    one = parse(f"{name}{comparison}{limit!r}")
    other = parse(f"{name} {opposite} {limit!r}")
    assert bool(one.why_met(report)) != bool(other.why_met(report))
    assert math.isclose(one.limit, limit)


def test_says_what_it_needs() -> None:
    needs = {text: parse(text).needs for text in ("no-route", "caution", "sinkage>1")}
    assert needs == {"no-route": "route", "caution": "", "sinkage>1": ""}
    assert parse("unknown").needs == parse("go-fraction<1").needs == "map"
    assert parse("reachable-fraction<1").needs == "reach"
    assert parse("steepest>1").needs == "route"
