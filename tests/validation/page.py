"""The figures of docs/validation.md, as the model has them now."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from terratool.definition.presets import PRESETS
from tests.validation.series import (
    AGAIN,
    ALL,
    BROKEN,
    CURIOSITY,
    DING,
    DING_SMOOTH,
    GRC1,
    LOOSE,
    LRV_LOAD,
    LUNAR,
    MGRU3,
    OPPORTUNITY,
    OTHER,
    RATES,
    TREC,
    Array,
    Series,
    angles_of,
    husky_climb,
    largest_slope,
    lrv,
    ratio,
    rms,
    slopes,
    tilted,
    traction_of,
    with_soil,
)

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "validation.md"


def table(head: str, rows: Iterable[Iterable[object]]) -> str:
    """A table of Markdown."""
    lines = [head, "|" + "---|" * (head.count("|") - 1)]
    return "\n".join([*lines, *("| " + " | ".join(map(str, row)) + " |" for row in rows)])


def signed(value: float) -> str:
    """With its sign, which is U+2212 where it is below 0."""
    tenths = round(float(value), 1)
    return f"{tenths:+.1f}".replace("-", "−") if tenths else "0.0"


def overview() -> str:
    """Of each series how far the model is off."""
    rows = []
    for one in ALL:
        level, sloping = one.errors(), one.errors(tilted)
        rows.append((
            one.title, len(level), f"{rms(level):.1f}", signed(level.mean()),
            f"{rms(sloping):.1f}", signed(sloping.mean()), f"{one.limit:.0f}",
        ))  # fmt: skip
    return table(
        "| series | points | rms, ° | bias, ° | rms on the slope, ° | bias, ° | limit, ° |", rows
    )


def point_by_point() -> str:
    """Each measured angle with that of the model."""
    rows = []
    for one in ALL:
        slips, measured = one.measured
        off = one.errors()
        rows += [
            (one.title, "slip, %", *(f"{100 * slip:.3g}" for slip in slips)),
            ("", "measured, °", *(f"{angle:.1f}" for angle in measured)),
            ("", "model less measured, °", *map(signed, off)),
        ]
    return table("| series | |" + " |" * 9, [(*row, *[""] * (11 - len(row))) for row in rows])


def parts() -> str:
    """How far the model is off without some of it."""
    choices: dict[str, Callable[[Series, Array], Array]] = {
        "as it is": angles_of, **BROKEN, **OTHER
    }  # fmt: skip
    rows = [
        (name, *(f"{rms(one.errors(angles)):.1f}" for one in ALL))
        for name, angles in choices.items()
    ]
    other = with_soil(GRC1)
    rows.append(
        ("GRC-1 of Chrono", *(f"{rms(one.errors(other)):.1f}" for one in ALL[:3]), "–", "–")
    )
    return table("| rms, ° | MGRU3 | other digitisation | TREC | Harbin, lugs | smooth |", rows)


def slip_at_slopes() -> str:
    """The slip, in percent, that slopes take."""
    steep = np.array([5.0, 10.0, 15.0, 20.0])
    rows = []
    for one in (MGRU3, AGAIN, TREC):
        slips, angles = one.measured
        inside = (steep >= angles[0]) & (steep <= angles[-1])
        taken = 100 * np.interp(steep, angles, slips)
        rows.append(
            (one.title, *(f"{t:.0f}" if i else "–" for t, i in zip(taken, inside, strict=True)))
        )
    slips = np.linspace(0.001, 0.6, 600)
    for load in (MGRU3.load, TREC.load):
        taken = 100 * np.interp(steep, slopes(LUNAR, MGRU3.wheel, load, slips), slips)
        rows.append((f"model, {load:.4g} N", *(f"{t:.0f}" for t in taken)))
    return table("| slip, % | 5° | 10° | 15° | 20° |", rows)


def sinkage_and_torque() -> str:
    """Of the lugged wheel of Harbin."""
    measured, (slips, _) = DING.table, DING.measured
    best = traction_of(DING, slips)
    rows = zip(
        (f"{100 * slip:.0f}" for slip in slips),
        (f"{z:g}" for z in measured["sinkage_mm"][1:]),
        (f"{1e3 * z:.1f}" for z in np.atleast_1d(best.sinkage)),
        (f"{torque:g}" for torque in measured["torque_nm"][1:]),
        (f"{torque:.1f}" for torque in np.atleast_1d(best.torque)),
        strict=True,
    )
    return table("| slip, % | sinkage measured, mm | model | torque measured, N m | model |", rows)


def lunar_rover() -> str:
    """Pull over load of the LRV's wheel, by the length on which it stands."""
    rows = []
    slips = np.linspace(0.01, 1.0, 100)
    for length in (0.0, 0.2, 0.3, 0.4):
        wheel = lrv(length)
        pull = ratio(LUNAR, wheel, LRV_LOAD, slips)
        rows.append((
            f"{wheel.shear_length:.2f}", *(f"{pull[n - 1]:.2f}" for n in (5, 15, 20, 25, 50, 100)),
            f"{100 * pull[24] / pull.max():.0f} %", f"{100 * slips[pull.argmax()]:.0f} %",
        ))  # fmt: skip
    return table(
        "| length, m | pull/load at 5 % | 15 % | 20 % | 25 % | 50 % | 100 % "
        "| at 25 %, of the largest | largest at |",
        rows,
    )


def rovers() -> str:
    """What the wheels of Opportunity and Curiosity climb, and how deep one of them sinks in."""
    rows = []
    for name in LOOSE:
        soil = PRESETS[name]
        deep = traction_of(Series("", "", *CURIOSITY, soil, 0.0), np.array([0.77])).sinkage
        rows.append((
            f"`{name}`", f"{largest_slope(OPPORTUNITY, soil):.0f}°",
            f"{largest_slope(CURIOSITY, soil):.0f}°",
            f"{100 * float(np.squeeze(deep)) / (2 * CURIOSITY[0].radius):.0f} %",
        ))  # fmt: skip
    return table(
        "| soil | Opportunity climbs | Curiosity climbs | and sinks in at 77 % slip, of its "
        "diameter |",
        rows,
    )


def firm_ground() -> str:
    """What a Husky climbs on crushed stone, by its sinkage."""
    rows = [
        (f"{rate:g}", *(f"{husky_climb(rate, slip):.1f}" for slip in (0.2, 1.0))) for rate in RATES
    ]
    return table("| k, m/kN | climb at a slip up to 20 %, ° | at any slip, ° |", rows)


TABLES = (
    overview, point_by_point, parts, slip_at_slopes, sinkage_and_torque, lunar_rover, rovers,
    firm_ground,
)  # fmt: skip


def said() -> list[str]:
    """What sentences of the page say in figures."""
    slips = np.linspace(0.1, 0.8, 15)
    gap = np.interp(slips, *TREC.measured) - np.interp(slips, *MGRU3.measured)
    shared = angles_of(TREC, slips) - angles_of(MGRU3, slips)
    smooth, lugs = DING_SMOOTH.measured[1], DING.measured[1]
    gain = angles_of(DING, DING.measured[0]) - angles_of(DING_SMOOTH, DING.measured[0])
    at_rest = float(angles_of(DING, np.zeros(1))[0])
    measured = np.degrees(np.arctan(DING.table["pull_n"][0] / DING.load))
    opportunity = np.linspace(0.01, 1.0, 100)
    climbs = slopes(PRESETS["lete-sand"], *OPPORTUNITY, opportunity)
    (tilt_slip, _), (again_slip, _), (pull_slip, _) = MGRU3.measured, AGAIN.measured, TREC.measured
    tilt_off = np.concatenate([MGRU3.errors(), AGAIN.errors()])
    tilt_slips = np.concatenate([tilt_slip, again_slip])
    first = np.abs(tilt_off[tilt_slips < 0.11]).max()
    short = -TREC.errors()[pull_slip < 0.11]
    middle = tilt_off[(tilt_slips > 0.35) & (tilt_slips < 0.45)]
    steep = np.linspace(5.0, 25.0, 201)
    readings = [np.interp(steep, *one.measured[::-1]) for one in (MGRU3, AGAIN)]
    return [
        f"differ by up to {100 * np.abs(readings[1] - readings[0]).max():.0f} points of slip",
        f"the tilt bed is met within {np.ceil(2 * first) / 2:.1f}°",
        f"pulls {short.min():.0f} to {short.max():.0f}° more than the model says",
        f"climbs {middle.min():.0f} to {middle.max():.0f}° more than the tilt bed showed",
        f"ends up to {-min(one.errors().min() for one in (MGRU3, AGAIN, TREC)):.0f}° too low",
        f"TREC's wheel is {gap.min():.0f} to {gap.max():.0f}° above the tilt bed's",
        f"explains at most {np.abs(shared).max():.1f}°",
        f"{gain.min():.1f} to {gain.max():.1f}°, measured are {(lugs - smooth).min():.1f} to "
        f"{(lugs - smooth).max():.1f}°",
        f"{signed(at_rest)}°, measured {signed(measured)}°",
        f"takes {100 * opportunity[np.argmax(climbs >= 17)]:.0f} % of slip at 17°",
    ]


def renewed(text: str) -> str:
    """The text of the page with each table as it is now, in the place of the one with its head."""
    for one in TABLES:
        new = one()
        head = new.partition("\n")[0]
        found = re.search(rf"^{re.escape(head)}(\n\|.*)*$", text, re.MULTILINE)
        if found:
            text = text[: found.start()] + new + text[found.end() :]
    return text
