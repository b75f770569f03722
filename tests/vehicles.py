"""Random vehicles that are in order, and one whose every figure is known."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import strategies as st

from terratool.text.source import Source
from tests.strategies import Json

# Nothing of it is symmetric: a mirrored, turned or shifted vehicle is another one.
LOPSIDED: Json = {
    "descr": "Three axles, the middle one of a single wheel",
    "mass": 120,
    "gravity": "mars",
    "wheels": {
        "radius": 0.2, "width": 0.1, "kind": "lugged", "grouserHeight": 0.015,
        "contactLength": 0.09, "maxTorque": 30, "maxSlip": 0.8, "rollingResistance": 0.004,
    },
    "axles": [
        {
            "x": 0.4, "wheels": 1, "driven": False, "radius": 0.12, "width": 0.06, "kind": "tyre",
            "tyrePressure": 80, "carcassStiffness": 15, "contactLength": 0.07,
            "rollingResistance": 0.03,
        },
        {"x": 2.0, "wheels": 4},
        {"x": -0.3, "driven": True, "grouserHeight": 0.025, "maxTorque": 45},
    ],
    "wheelbase": 2.3,
    "track": 0.9,
    "cog": {"x": 0.5, "height": 0.35},
    "clearance": 0.17,
    "height": 1.4,
    "bodyWidth": 0.7,
    "overhang": {"front": 0.5, "frontHeight": 0.25, "rear": 0.3},
    "steering": "wheels",
    "speed": 0.5,
    "power": 25,
    "maxDrift": 0.4,
    "efficiency": 0.75,
    "battery": {"capacity": 480, "reserve": 0.2},
    "stoppingDistance": 1.5,
    "reactionTime": 0.25,
    "margins": {"clearance": 0.02, "step": 0.01, "tip": 10, "slope": 5},
    "classes": {
        "utilisation": 0.6, "slip": 0.1, "cautionSlip": 0.3, "torque": 0.5, "geometry": 0.8,
        "drift": 7, "cautionDrift": 25,
    },
    "x-note": {"mass": None},
}  # fmt: skip

SMALLEST: Json = {
    "mass": 50,
    "wheels": {"radius": 0.16, "width": 0.11},
    "wheelbase": 0.5,
    "track": 0.55,
    "cog": {"height": 0.2},
    "clearance": 0.13,
}

TRACKED: Json = {
    "mass": [40, 65.5],
    "tracks": {
        "length": 0.7, "width": 0.15, "radius": 0.1, "frontHeight": 0.18, "approachAngle": 30,
        "maxTorque": 60, "maxSlip": 0.5,
    },
    "track": 0.55,
    "cog": {"x": [-0.05, 0.1], "height": [0.2, 0.3]},
    "clearance": 0.08,
    "turningRadius": 0.5,
}  # fmt: skip

WALKING: Json = {
    "mass": 30,
    "feet": {
        "diameter": 0.05, "length": 0.6, "stepHeight": 0.2, "reach": 0.1, "pairs": 3,
        "bearingFeet": 3,
    },
    "track": 0.4,
    "cog": {"x": 0.05, "height": 0.3},
    "clearance": 0.3,
}  # fmt: skip


def source(value: Any) -> Source:
    return Source("v.json", json.dumps(value).encode())


def _numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


def _some(members: dict[str, st.SearchStrategy[Any]]) -> st.SearchStrategy[Json]:
    """Any of these keys, none too many."""
    return st.fixed_dictionaries({}, optional=members)


def _kinds(radius: float) -> st.SearchStrategy[Json]:
    """What makes a wheel one of a kind, right for a radius from this one to its double."""
    lugs = _numbers(0, 0.9 * radius)
    rest = {"contactLength": _numbers(0, 1.9 * radius)}
    rigid = {"kind": st.just("rigid"), **rest}
    lugged = {"kind": st.just("lugged"), **rest}
    tyre = {"grouserHeight": lugs, "carcassStiffness": _numbers(0, 200), **rest}
    pressure = _numbers(5, 900)
    return st.one_of(
        _some(rigid),
        st.fixed_dictionaries({"grouserHeight": lugs}, optional=lugged),
        st.fixed_dictionaries({"kind": st.just("lugged")}, optional=rest),
        st.fixed_dictionaries({"kind": st.just("tyre")}, optional={"grouserHeight": lugs, **rest}),
        st.fixed_dictionaries(
            {"tyrePressure": pressure}, optional={"kind": st.just("tyre"), **tyre}
        ),
    )


@st.composite
def _own_wheel(draw: st.DrawFn, radius: float, width: float) -> Json:
    """What an axle says of its wheels: none are larger than the common ones."""
    own = draw(
        _some(
            {
                "radius": _numbers(0.5 * radius, radius),
                "width": _numbers(0.5 * width, width),
                "maxTorque": _numbers(0.001, 1000),
            }
        )
    )
    if draw(st.booleans()):
        kind = draw(_kinds(0.5 * radius).filter(lambda kind: "kind" in kind))
        own |= kind
    return own


@st.composite
def _range(draw: st.DrawFn, low: float, high: float) -> Any:
    """A number, or a range of them."""
    number = draw(_numbers(low, high))
    return [number, draw(_numbers(number, high))] if draw(st.booleans()) else number


@st.composite
def wheeled(draw: st.DrawFn) -> Json:
    """A vehicle on wheels without errors, whole numbers among its figures, axles in any order."""
    radius = draw(_numbers(0.02, 0.5))
    width = draw(_numbers(0.01, 0.3))
    value: Json = {
        "wheels": {"radius": radius, "width": width},
        "track": 3.001 * width + draw(_numbers(0, 2)),
        "cog": {},
    }
    gaps = draw(st.lists(_numbers(2.001, 6), min_size=1, max_size=4))
    xs = [draw(_numbers(-2, 2))]
    for gap in gaps:
        xs.append(xs[-1] - gap * radius)
    if draw(st.booleans()):
        axles = [
            {
                "x": x,
                **draw(_some({"wheels": st.integers(1, 4), "driven": st.booleans()})),
                **draw(_own_wheel(radius, width)),
            }
            for x in xs
        ]
        axles[0].update(wheels=2, driven=True)
        value["axles"] = draw(st.permutations(axles))
        value["cog"]["x"] = draw(_numbers(0.01, 0.99)) * (xs[-1] - xs[0]) + xs[0]
        if draw(st.booleans()):
            value["wheelbase"] = xs[0] - xs[-1]
    else:
        value["wheelbase"] = xs[0] - xs[-1]
    value["wheels"] |= draw(_kinds(0.5 * radius))
    share = _numbers(0.01, 1)
    value["wheels"] |= draw(
        _some(
            {
                "maxTorque": _numbers(0.001, 1000),
                "maxSlip": share,
                "rollingResistance": _numbers(0, 0.99),
            }
        )
    )
    value |= draw(_some({"steering": st.sampled_from(["skid", "wheels"])}))
    return value | draw(_rest(value["cog"]))


@st.composite
def _tracked(draw: st.DrawFn) -> Json:
    """A vehicle on tracks without errors."""
    length, radius = draw(_numbers(0.1, 3)), draw(_numbers(0.02, 0.3))
    tracks = {"length": length, "width": draw(_numbers(0.01, 0.3)), "radius": radius}
    tracks |= draw(
        _some(
            {
                "frontHeight": _numbers(radius, 2 * radius),
                "approachAngle": _numbers(1, 89),
                "maxTorque": _numbers(0.001, 1000),
                "maxSlip": _numbers(0.01, 1),
            }
        )
    )
    cog = draw(_some({"x": _range(-0.49 * length, 0.49 * length)}))
    value = {"tracks": tracks, "track": tracks["width"] + draw(_numbers(0.01, 2)), "cog": cog}
    return value | draw(_rest(cog))


@st.composite
def _walking(draw: st.DrawFn) -> Json:
    """A vehicle on feet without errors."""
    pairs = draw(st.integers(2, 4))
    diameter = draw(_numbers(0.01, 0.2))
    length = diameter * pairs + draw(_numbers(0, 2))
    feet = {"diameter": diameter, "length": length, "stepHeight": draw(_numbers(0.01, 1))}
    feet |= draw(_some({"reach": _numbers(0, 0.5), "bearingFeet": st.integers(1, 2 * pairs)}))
    if pairs > 2 or draw(st.booleans()):
        feet["pairs"] = pairs
    cog = draw(_some({"x": _range(-0.49 * length, 0.49 * length)}))
    value = {"feet": feet, "track": diameter + draw(_numbers(0.01, 2)), "cog": cog}
    return value | draw(_rest(cog))


def vehicles() -> st.SearchStrategy[Json]:
    """Vehicles without errors, on wheels, tracks or feet."""
    return st.one_of(wheeled(), _tracked(), _walking())


@st.composite
def _rest(draw: st.DrawFn, cog: Json) -> Json:
    """What all vehicles have, whatever they stand on; `cog` is what is known of that."""
    share = _numbers(0.01, 1)
    return {
        "mass": draw(st.integers(1, 5000) | _range(0.1, 5000)),
        "cog": {**cog, "height": draw(_range(0.01, 2))},
        "clearance": draw(_numbers(0.01, 1)),
    } | draw(
        _some(
            {
                "descr": st.text(),
                "gravity": st.sampled_from(["earth", "mars", "moon"]) | _numbers(0.1, 20),
                "bodyWidth": _numbers(0.05, 3),
                "turningRadius": _numbers(0, 50),
                "speed": _numbers(0.01, 20),
                "power": _numbers(0, 1000),
                "maxDrift": _numbers(0.01, 10),
                "height": _numbers(10, 100),
                "efficiency": share,
                "battery": st.fixed_dictionaries(
                    {"capacity": _numbers(0.1, 1e4)}, optional={"reserve": _numbers(0, 0.99)}
                ),
                "stoppingDistance": _numbers(0.01, 100),
                "reactionTime": _numbers(0, 10),
                "overhang": _some(
                    {
                        "front": _numbers(0.01, 2),
                        "frontHeight": _numbers(0.01, 2),
                        "rear": _numbers(0.01, 2),
                        "rearHeight": _numbers(0.01, 2),
                    }
                ),
                "margins": _some(
                    {
                        "clearance": _numbers(0, 0.1),
                        "step": _numbers(0, 0.1),
                        "tip": _numbers(0, 89),
                        "slope": _numbers(0, 89),
                    }
                ),
                "classes": _some(
                    {
                        "utilisation": share,
                        "slip": _numbers(0.01, 0.5),
                        "cautionSlip": _numbers(0.5, 1),
                        "torque": share,
                        "geometry": share,
                        "drift": _numbers(0.1, 10),
                        "cautionDrift": _numbers(10, 89),
                    }
                ),
            }
        )
    )
