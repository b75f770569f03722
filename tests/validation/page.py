"""The figures of docs/validation.md, as the model has them now."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from terratool.definition.presets import PRESETS
from tests.validation.fit import FITTED, bootstrap, errors, factor, fitted, without
from tests.validation.rule import RULE
from tests.validation.series import (
    AGAIN,
    ALL,
    BROKEN,
    CLIMBERS,
    COHESIVE,
    CRABS,
    CURIOSITY,
    DING,
    GRC1,
    K10,
    K10_LUGS,
    LOOSE,
    LRV,
    LRV_LOAD,
    LUNAR,
    MGRU3,
    OPPORTUNITY,
    OTHER,
    RASHID_DRY,
    RATES,
    TREC,
    Angles,
    Array,
    Crab,
    along,
    angles_of,
    husky_climb,
    largest_slope,
    ratio,
    rms,
    side_of,
    slopes,
    sunk,
    tilted,
    traction_of,
    with_modulus,
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


def signed3(value: float) -> str:
    """With its sign, to three decimals."""
    return f"{float(value):+.3f}".replace("-", "−")


def within(depths: Array, most: float = 1.5) -> str:
    """How many logarithms of factors are within one."""
    return f"{int((np.abs(depths) < np.log(most)).sum())} of {len(depths)}"


def sideways(one: Crab, steepest: float = 45.0, most: float = 0.6) -> Array:
    """The force sideways over load that the model gives a steered wheel."""
    crab, slip, load, _ = one.measured(steepest, most)
    return side_of(one, along(slip, crab), crab, load)


def with_sign(errors: Array) -> str:
    """The rms of errors, and their mean."""
    return f"{rms(errors):.1f} ({signed(errors.mean())})"


def overview() -> str:
    """Of each set how far the model is off, and how far a fit without the set is."""
    rows = []
    for one in ALL:
        level = one.errors()
        alone, lab = (
            errors(without(one, whole_laboratory=whole), one).angle for whole in (False, True)
        )
        rows.append((
            one.title, len(level), f"{rms(level):.1f}", signed(level.mean()),
            signed(level[np.abs(level).argmax()]), with_sign(alone), with_sign(lab),
            f"{one.limit:.1f}",
        ))  # fmt: skip
    return table(
        "| set | points | rms, ° | bias, ° | worst, ° | left out, ° | with its laboratory, ° "
        "| limit, ° |",
        rows,
    )


def constants() -> str:
    """The fitted constants, those of the program, and how far they move."""
    meaning = {
        "reach": "REACH: length to which K of the books belongs, m",
        "rim_friction": "RIM_FRICTION: friction of soil on a bare rim",
        "growth": "GROWTH: angle by which a bare rim digs itself in at a slip of 1, rad",
    }
    ranges = np.percentile(bootstrap(), [5, 95], axis=0).T
    rows = [
        (meaning[name], f"{getattr(fitted(), name):.3f}", f"{getattr(RULE, name):g}",
         f"{low:.2f} to {high:.2f}")
        for name, (low, high) in zip(FITTED, ranges, strict=True)
    ]  # fmt: skip
    return table("| constant | fit | program | 5 to 95 % of draws |", rows)


def point_by_point() -> str:
    """Each measured angle with that of the model."""
    rows = []
    for one in ALL:
        slips, measured = one.measured
        off = one.errors()
        rows += [
            (one.title, "slip, %", *(f"{100 * slip:.3g}" for slip in slips)),
            ("", "measured, °", *(f"{angle:.1f}".replace("-", "−") for angle in measured)),
            ("", "model less measured, °", *map(signed, off)),
        ]
    return table("| set | |" + " |" * 9, [(*row, *[""] * (11 - len(row))) for row in rows])


def parts() -> str:
    """How far the model is off without some of it."""
    choices: dict[str, Angles] = {"as it is": angles_of, **BROKEN, **OTHER}
    rows = [
        (name, *(f"{rms(one.errors(angles)):.1f}" for one in ALL))
        for name, angles in choices.items()
    ]
    other = with_soil(GRC1)
    rows.append((
        "GRC-1 of Chrono", *(f"{rms(one.errors(other)):.1f}" for one in ALL[:3]), *["–"] * 8
    ))  # fmt: skip
    return table(
        "| rms, ° | MGRU3 | again | TREC | Harbin lugs | smooth | K10 smooth | lugs | KLS-1 smooth "
        "| lugs | Rashid 2.4 | 0.2 |",
        rows,
    )


def crabs() -> str:
    """Force sideways over load, measured and of the model, by wheel, crab angle and slip."""
    rows = []
    for one in CRABS:
        crab, slip, _, measured = one.measured(90.0, 1.0)
        model = sideways(one, 90.0, 1.0)
        for angle in np.unique(crab):
            here = crab == angle
            rows.append((
                one.title, f"{np.degrees(angle):.0f}°",
                *(f"{had:.2f}, {has:.2f}" for had, has in
                  zip(measured[here], model[here], strict=True)),
            ))  # fmt: skip
        assert len(slip) == 25
    return table("| wheel | crab angle | slip 0 | 0.23 | 0.5 | 0.75 | 0.9 |", rows)


def depths() -> str:
    """Sinkage and torque of the model over those measured, of each set that has some."""
    rows = []
    for one in ALL:
        points = one.points
        if np.isfinite(points.sinkage).all():
            model = traction_of(one, points.slip, points.load)
            deep = np.log(model.sinkage / points.sinkage)
            rows.append((
                one.title, len(deep), factor(deep), within(deep),
                factor(np.log(model.torque / points.torque))
                if np.isfinite(points.torque).all() else "–",
            ))  # fmt: skip
    return table(
        "| set | points | sinkage over measured | within 1.5 | torque over measured |", rows
    )


def clay() -> str:
    """What wheels climb on cohesive soils, at a slip of 20 % and at any."""
    rows = []
    for name in COHESIVE:
        cells = []
        for wheel, load in CLIMBERS.values():
            climbs = slopes(PRESETS[name], wheel, load, np.array([0.2, 1.0]))
            cells.append(", ".join(f"{angle:.0f}°" for angle in climbs))
        rows.append((f"`{name}`", *cells))
    return table("| soil | " + " | ".join(CLIMBERS) + " |", rows)


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


def lunar_rover() -> str:
    """Pull over load of the LRV's wheel."""
    rows = []
    slips = np.linspace(0.01, 1.0, 100)
    for name, tyre in (("treads as lugs", True), ("a bare rim", False)):
        pull = ratio(LUNAR, replace(LRV, tyre=tyre), LRV_LOAD, slips)
        rows.append((
            name, *(f"{pull[n - 1]:.2f}" for n in (5, 15, 20, 25, 50, 100)),
            f"{100 * pull[14] / pull.max():.0f} to {100 * pull[24] / pull.max():.0f} %",
        ))  # fmt: skip
    return table(
        "| wheel | pull/load at 5 % | 15 % | 20 % | 25 % | 50 % | 100 % "
        "| at 15 to 25 %, of the largest |",
        rows,
    )


def rovers() -> str:
    """What the wheels of Opportunity and Curiosity climb, and how deep one of them sinks in."""
    rows = []
    for name in LOOSE:
        soil = PRESETS[name]
        deep = sunk(soil, *CURIOSITY, 0.77)
        rows.append((
            f"`{name}`", f"{largest_slope(OPPORTUNITY, soil):.0f}°",
            f"{largest_slope(CURIOSITY, soil):.0f}°",
            f"{100 * deep / (2 * CURIOSITY[0].radius):.0f} %",
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
    overview, constants, point_by_point, depths, crabs, parts, slip_at_slopes, clay, lunar_rover,
    rovers, firm_ground,
)  # fmt: skip


def said() -> list[str]:
    """What sentences of the page say in figures."""
    slips = np.linspace(0.1, 0.8, 15)
    gap = np.interp(slips, *TREC.measured) - np.interp(slips, *MGRU3.measured)
    shared = angles_of(TREC, slips) - angles_of(MGRU3, slips)
    tilt = [(one, one.errors(tilted)) for one in (MGRU3, AGAIN)]
    steep = np.linspace(5.0, 25.0, 201)
    readings = [np.interp(steep, *one.measured[::-1]) for one in (MGRU3, AGAIN)]
    off = [one.errors() for one in ALL]
    middle = np.concatenate([
        one.errors()[(one.points.slip > 0.1) & (one.points.slip < 0.45)] for one in (MGRU3, AGAIN)
    ])  # fmt: skip
    left = [
        rms(errors(without(one, whole_laboratory=whole), one).angle)
        for one in ALL for whole in (False, True)
    ]  # fmt: skip
    twice = [errors(RULE, one).depth for one in ALL if one.tells_depth and one is not RASHID_DRY]
    at_rest = [(one, float(angles_of(one, np.zeros(1), one.table.get("load_n", [one.load])[0])[0]))
               for one in (DING, K10, K10_LUGS)]  # fmt: skip
    stood = [np.degrees(np.arctan(one.table["pull_n"][0] / one.table.get("load_n", [one.load])[0]))
             for one, _ in at_rest]  # fmt: skip
    crab = [sideways(one) - one.measured()[3] for one in CRABS]
    as_given = [
        side_of(one, slip, angle, load) - had
        for one in CRABS for angle, slip, load, had in [one.measured()]
    ]  # fmt: skip
    opportunity = np.linspace(0.01, 1.0, 100)
    climbs = slopes(PRESETS["lete-sand"], *OPPORTUNITY, opportunity)
    points = np.concatenate(off)
    modulus = [rms(DING.errors(with_modulus(k))) for k in (0.0097, 0.0131)]
    return [
        f"differ by up to {100 * np.abs(readings[1] - readings[0]).max():.0f} points of slip",
        f"mean of the biases is {signed(np.mean([e.mean() for e in off]))}°, the rms of all "
        f"{len(points)} points {rms(points):.1f}°",
        f"largest of those columns is {max(left):.1f}°",
        f"climbs {middle.min():.0f} to {middle.max():.0f}° more than the tilt bed showed",
        f"TREC's wheel is {gap.min():.0f} to {gap.max():.0f}° above the tilt bed's",
        f"explains at most {np.abs(shared).max():.1f}°",
        "rms "
        + " and ".join(f"{rms(e):.1f}" for _, e in tilt)
        + "°, bias "
        + " and ".join(signed(e.mean()) for _, e in tilt)
        + "°",
        f"at 80 % slip it is {-TREC.errors()[-1]:.0f}° too low",
        "−".join(["", f"{-at_rest[1][1]:.1f}° against "]) + f"−{-stood[1]:.1f}° measured for the "
        f"smooth wheel, −{-at_rest[2][1]:.1f}° against −{-stood[2]:.1f}° for the one with lugs",
        f"Harbin's {signed(at_rest[0][1])}° against {signed(stood[0])}°",
        f"within a factor of 1.5 in {within(np.concatenate(twice))} points",
        f"rms {rms(crab[0]):.3f} W for the smooth wheel and {rms(crab[1]):.3f} W for the one with "
        f"lugs, bias {signed3(crab[0].mean())} and {signed3(crab[1].mean())} W",
        f"{rms(as_given[0]):.3f} and {rms(as_given[1]):.3f} W if their slip is taken as that along "
        "the heading",
        f"takes {100 * opportunity[np.argmax(climbs >= 17)]:.0f} % of slip at 17°",
        f"{min(modulus):.1f} to {max(modulus):.1f}°",
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
