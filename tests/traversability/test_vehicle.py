"""Vehicle files: what they mean, in SI units and seen from the centre of gravity."""

from __future__ import annotations

import copy
import gzip
import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given

import terratool
from terratool.definition.reader import check
from terratool.definition.vehicle import ROLLING
from terratool.errors import DefinitionError, ReadError
from terratool.traversability.vehicle import (
    Axle,
    Battery,
    Load,
    Margins,
    Overhang,
    Thresholds,
    Vehicle,
    Wheel,
)
from terratool.traversability.vehicle_files import CARCASS, load_vehicle, vehicle_of
from tests.commands import ROOT, SAMPLE
from tests.strategies import Json
from tests.vehicles import LOPSIDED, SMALLEST, source, wheeled


def meant(value: Json) -> Vehicle:
    checked = check(source(value), kind="vehicle")
    assert checked.vehicle is not None, checked.findings
    return vehicle_of(checked.vehicle)


def written(tmp_path: Path, value: Any, name: str = "v.json") -> Path:
    path = tmp_path / name
    path.write_text(json.dumps(value), encoding="utf-8")
    return path


def test_every_key_arrives_in_its_place_and_unit() -> None:
    """Axles from the front to the rear, ahead of the centre of gravity; angles in radians."""
    vehicle = meant(LOPSIDED)
    assert [axle.x for axle in vehicle.axles] == pytest.approx([1.5, -0.1, -0.8])
    assert [(axle.wheels, axle.driven) for axle in vehicle.axles] == [
        (4, True), (1, False), (2, True),
    ]  # fmt: skip
    assert vehicle.wheel == Wheel(
        0.2, 0.1, 30.0, 0.8, grouser_height=0.015, contact_length=0.09, rolling=0.004
    )
    # of another kind, and so without lugs; of the same kind, but with longer ones
    castor = Wheel(0.12, 0.06, 30.0, 0.8, 0.0, 0.07, pytest.approx(95e3), tyre=True, rolling=0.03)
    assert [vehicle.wheel_of(axle) for axle in vehicle.axles] == [
        vehicle.wheel, castor, Wheel(0.2, 0.1, 45.0, 0.8, 0.025, 0.09, rolling=0.004),
    ]  # fmt: skip
    assert [axle.wheel is None for axle in vehicle.axles] == [True, False, False]
    assert (vehicle.mass, vehicle.gravity, vehicle.track_width) == (120, 3.71, 0.9)
    assert (vehicle.cog_height, vehicle.clearance, vehicle.body_width) == (0.35, 0.17, 0.7)
    assert vehicle.steering == "wheels"
    assert vehicle.front == Overhang(0.5, 0.25)
    assert vehicle.rear == Overhang(0.3, 0.17)  # as high as the rest of the body
    assert (vehicle.speed, vehicle.power, vehicle.efficiency) == (0.5, 25, 0.75)
    assert vehicle.battery == Battery(480 * 3600.0, 0.2)
    assert (vehicle.stopping_distance, vehicle.reaction_time) == (1.5, 0.25)
    assert vehicle.loads == ()
    assert vehicle.margins == Margins(0.02, 0.01, math.pi / 18, pytest.approx(math.pi / 36))
    angles = math.radians(7), math.radians(25)
    assert vehicle.thresholds == Thresholds(0.6, 0.1, 0.3, 0.5, 0.8, *angles)
    assert (vehicle.max_drift, vehicle.height) == (0.4, 1.4)
    assert vehicle.wheels == 7
    assert vehicle.wheelbase == pytest.approx(2.3)
    assert vehicle.middle == pytest.approx(0.35)
    assert vehicle.weight == pytest.approx(445.2)
    # the longer of overhang and wheel ahead, behind and to each side
    assert vehicle.rectangle == pytest.approx((1.15 + 0.5, 1.15 + 0.3, 0.5))


def test_what_is_left_out_has_its_default() -> None:
    """Those of the vehicle's own values, but for what the file requires."""
    assert meant(SMALLEST) == Vehicle(
        Wheel(0.16, 0.11),
        (Axle(0.25), Axle(-0.25)),
        50,
        track_width=0.55,
        cog_height=0.2,
        clearance=0.13,
    )


def test_ranges_of_loads_are_their_corners() -> None:
    """Eight of three ranges; the vehicle is the heaviest and highest, in the middle along it."""
    cog = {"x": [0.1, 0.5], "height": [0.3, 0.6]}
    vehicle = meant({**LOPSIDED, "mass": [120, 200], "cog": cog})
    assert (vehicle.mass, vehicle.cog_height) == (200, 0.6)
    assert [axle.x for axle in vehicle.axles] == pytest.approx([1.7, 0.1, -0.6])
    assert len(vehicle.loads) == 8
    assert Load(120, 0.6, pytest.approx(-0.2)) in vehicle.loads
    light_ahead = next(one for one in vehicle.cases if one.mass == 120 and one.axles[0].x < 1.6)
    assert [axle.x for axle in light_ahead.axles] == pytest.approx([1.5, -0.1, -0.8])
    assert not light_ahead.loads
    # a range of one value is none, and other ranges alone have their two ends
    one = meant({**LOPSIDED, "mass": [120, 120]})
    assert (one.loads, one.cases) == ((), (one,))
    assert len(meant({**LOPSIDED, "mass": [100, 120]}).loads) == 2


WHEELS: Json = {"radius": 0.25, "width": 0.2}


@pytest.mark.parametrize(
    ("wheels", "wheel"),
    [
        ({}, Wheel(0.25, 0.2)),
        ({"kind": "rigid"}, Wheel(0.25, 0.2)),
        ({"kind": "lugged"}, Wheel(0.25, 0.2, grouser_height=0.025)),
        ({"grouserHeight": 0.01}, Wheel(0.25, 0.2, grouser_height=0.01)),
        ({"kind": "tyre"}, Wheel(0.25, 0.2, tyre=True, rolling=ROLLING)),
        ({"tyrePressure": 70}, Wheel(0.25, 0.2, patch_pressure=90e3, tyre=True, rolling=ROLLING)),
        (
            {"tyrePressure": 70, "carcassStiffness": 0},
            Wheel(0.25, 0.2, patch_pressure=70e3, tyre=True, rolling=ROLLING),
        ),
        (
            {"tyrePressure": 70, "carcassStiffness": 35, "grouserHeight": 0.03},
            Wheel(0.25, 0.2, grouser_height=0.03, patch_pressure=105e3, tyre=True, rolling=ROLLING),
        ),
        (
            {"kind": "tyre", "contactLength": 0.2},
            Wheel(0.25, 0.2, contact_length=0.2, tyre=True, rolling=ROLLING),
        ),
    ],
)  # fmt: skip
def test_a_kind_of_wheel_stands_for_its_figures(wheels: Json, wheel: Wheel) -> None:
    """Lugs of a tenth of the radius; kPa become Pa, and the carcass adds 20 kPa to a pressure."""
    assert meant({**SMALLEST, "wheels": {**WHEELS, **wheels}}).wheel == wheel


@pytest.mark.parametrize(
    ("wheels", "axle", "wheel"),
    [
        ({}, {"radius": 0.06}, Wheel(0.06, 0.2)),
        # the lugs that the kind stands for are of the axle's own radius
        ({"kind": "lugged"}, {"radius": 0.1}, Wheel(0.1, 0.2, grouser_height=0.1 * 0.1)),
        ({"grouserHeight": 0.02}, {"radius": 0.1}, Wheel(0.1, 0.2, grouser_height=0.02)),
        ({"grouserHeight": 0.02}, {"kind": "rigid"}, Wheel(0.25, 0.2)),
        ({"grouserHeight": 0.02}, {"grouserHeight": 0}, Wheel(0.25, 0.2)),
        ({"tyrePressure": 70}, {"kind": "rigid", "maxTorque": 3}, Wheel(0.25, 0.2, 3.0)),
        (
            {"tyrePressure": 70},
            {"tyrePressure": 50},
            Wheel(0.25, 0.2, patch_pressure=70e3, tyre=True, rolling=ROLLING),
        ),
        ({"maxSlip": 0.5}, {"width": 0.1}, Wheel(0.25, 0.1, max_slip=0.5)),
        (
            {},
            {"tyrePressure": 50},
            Wheel(0.25, 0.2, patch_pressure=70e3, tyre=True, rolling=ROLLING),
        ),
        ({}, {"radius": 0.25, "width": 0.2}, None),
        ({"tyrePressure": 70}, {"kind": "tyre"}, None),
    ],
)
def test_an_axle_has_wheels_of_its_own(wheels: Json, axle: Json, wheel: Wheel | None) -> None:
    """Key by key, but for what belongs to another kind; the same wheels are none of its own."""
    value = {key: item for key, item in SMALLEST.items() if key != "wheelbase"}
    value["axles"] = [{"x": 0.4}, {"x": -0.4, **axle}]
    front, rear = meant({**value, "wheels": {**WHEELS, **wheels}}).axles
    assert (front.wheel, rear.wheel) == (None, wheel)


@pytest.mark.parametrize("name", ["husky-a200", "warthog"])
def test_samples_have_the_torque_of_their_climb(name: str) -> None:
    """The data sheet's 45 degrees: a rear wheel pushes as it bears, by the moments of the axles.

    The lever of the weight about the front axle is x_f cos α + h sin α, so that the rear bears
    this by the wheelbase; of the thrust m g sin α it takes its share of the loads.
    """
    vehicle = load_vehicle(ROOT / "samples" / "vehicles" / f"{name}.json")
    lever = vehicle.axles[0].x + vehicle.cog_height * math.tan(math.radians(45))
    thrust = vehicle.weight * math.sin(math.radians(45)) * lever / vehicle.wheelbase
    assert vehicle.axles[-1].wheels == 2
    needed = 0.5 * thrust * vehicle.wheel.radius
    assert needed <= vehicle.wheel.max_torque <= 1.005 * needed


def test_the_castor_of_a_sample_has_its_own_radius() -> None:
    """It is less than half of that of the driven wheels."""
    vehicle = load_vehicle(ROOT / "samples" / "vehicles" / "neobotix-mp-500.json")
    assert [vehicle.wheel_of(axle).radius for axle in vehicle.axles] == [0.13, 0.06]


def test_the_centre_of_gravity_is_in_the_middle_unless_it_is_told() -> None:
    """Of the outermost axles, wherever the frame has its origin and others stand."""
    axles = [{"x": -0.6}, {"x": 3.4}, {"x": 0.2}]
    value = {key: item for key, item in SMALLEST.items() if key != "wheelbase"}
    vehicle = meant({**value, "axles": axles})
    assert [axle.x for axle in vehicle.axles] == pytest.approx([2, -1.2, -2])
    assert vehicle.middle == 0


@pytest.mark.parametrize(
    ("gravity", "value"), [("earth", 9.80665), ("mars", 3.71), ("moon", 1.62), (2, 2), (0.5, 0.5)]
)
def test_gravity_by_name_or_number(gravity: Any, value: float) -> None:
    """Three have a name, and any may be given."""
    assert meant({**SMALLEST, "gravity": gravity}).gravity == value


def test_the_overhang_of_one_end_is_not_the_other() -> None:
    """What hangs over at the rear hangs over at the rear."""
    vehicle = meant({**SMALLEST, "overhang": {"rear": 0.4, "rearHeight": 0.3}})
    assert vehicle.front == Overhang()
    assert vehicle.rear == Overhang(0.4, 0.3)
    assert vehicle.rectangle == pytest.approx((0.41, 0.65, 0.33))


def shifted(value: Json, by: float) -> Json:
    value = copy.deepcopy(value)
    if "axles" in value:
        for axle in value["axles"]:
            axle["x"] += by
        if "x" in value["cog"]:
            value["cog"]["x"] += by
    return value


def mirrored(value: Json) -> Json:
    value = copy.deepcopy(value)
    for axle in value.get("axles", ()):
        axle["x"] *= -1
    if "x" in value["cog"]:
        value["cog"]["x"] *= -1
    hang = value.get("overhang", {})
    ends = {"front": "rear", "rear": "front", "frontHeight": "rearHeight"}
    ends |= {"rearHeight": "frontHeight"}
    value["overhang"] = {ends[key]: number for key, number in hang.items()}
    return value


@given(wheeled())
def test_the_frame_of_the_axles_is_free(value: Json) -> None:
    """Its origin may be anywhere, and the axles stand in any order."""
    vehicle = meant(value)
    moved = meant(shifted(value, 7.25))
    assert [axle.x for axle in moved.axles] == pytest.approx(
        [axle.x for axle in vehicle.axles], abs=1e-9
    )
    assert [axle.x for axle in vehicle.axles] == sorted(
        (axle.x for axle in vehicle.axles), reverse=True
    )
    assert vehicle.axles[0].x > 0 > vehicle.axles[-1].x
    turned = {**value, "axles": value["axles"][::-1]} if "axles" in value else value
    assert meant(turned) == vehicle


@given(wheeled())
def test_a_vehicle_driven_backwards_is_its_mirror_image(value: Json) -> None:
    """Front and rear change places, and with them axles and overhangs."""
    vehicle, back = meant(value), meant(mirrored(value))
    assert [axle.x for axle in back.axles] == pytest.approx(
        [-axle.x for axle in reversed(vehicle.axles)], abs=1e-12
    )
    assert [axle.driven for axle in back.axles] == [a.driven for a in reversed(vehicle.axles)]
    assert (back.front, back.rear) == (vehicle.rear, vehicle.front)
    ahead, behind, aside = vehicle.rectangle
    assert back.rectangle == pytest.approx((behind, ahead, aside))


def test_a_wheel_by_itself() -> None:
    """It bears its load whatever the gravity, and has no body."""
    vehicle = Vehicle.single(Wheel(0.2, 0.1, 5), 100)
    assert vehicle.is_single
    assert (vehicle.weight, vehicle.wheels, vehicle.wheelbase) == (100, 1, 0)
    assert vehicle.rectangle == (0.2, 0.2, 0.05)
    assert not meant(SMALLEST).is_single


def test_it_is_read_from_files(tmp_path: Path) -> None:
    """Plain or gzipped, and called what the file is called."""
    path = written(tmp_path, LOPSIDED, "rover.json")
    packed = tmp_path / "rover.json.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    assert load_vehicle(path) == load_vehicle(str(packed)) == terratool.load_vehicle(path)
    assert load_vehicle(path).name == "rover"


def test_a_terrain_is_no_vehicle_and_the_other_way(tmp_path: Path) -> None:
    """Where one is wanted and the other given, that is what is said."""
    with pytest.raises(DefinitionError, match="is a terrain, where a vehicle is wanted"):
        load_vehicle(SAMPLE)
    path = written(tmp_path, SMALLEST)
    with pytest.raises(DefinitionError, match="is a vehicle, where a terrain is wanted"):
        terratool.load(path)


def test_errors_are_raised_with_their_findings(tmp_path: Path) -> None:
    """The first one by its place, and how many more there are."""
    path = written(tmp_path, {**SMALLEST, "mass": 0, "track": -1})
    with pytest.raises(DefinitionError) as raised:
        load_vehicle(path)
    assert raised.value.message == f'{path}:1:10: TT106: "mass" is 0, out of its range.'
    assert raised.value.hint.endswith(" terratool validate lists 1 more.")
    assert [finding.pointer for finding in raised.value.findings] == ["/mass", "/track"]
    with pytest.raises(ReadError):
        load_vehicle(tmp_path / "absent.json")
    for text in ("[]", "3", "{}", "", "{"):
        path.write_text(text)
        with pytest.raises(DefinitionError, match=r"v\.json:1:\d: TT10[145]: "):
            load_vehicle(path)


def test_warnings_do_not_keep_it_from_being_read(tmp_path: Path) -> None:
    """What is only unusual is a vehicle all the same."""
    assert load_vehicle(written(tmp_path, {**SMALLEST, "speed": 90})).speed == 90


def test_the_page_tells_the_truth() -> None:
    """Its example is clean, and its tables have each key and the default that is in effect."""
    page = (ROOT / "docs" / "vehicle.md").read_text("utf-8")
    (example,) = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    checked = check(source(json.loads(example)), kind="vehicle")
    assert checked.vehicle is not None
    assert checked.findings == ()
    rows = dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]+) \|$", page, re.MULTILINE))
    thresholds = Thresholds()
    assert float(rows["utilisation"]) == thresholds.utilisation
    assert float(rows["slip"]) == thresholds.slip
    assert float(rows["cautionSlip"]) == thresholds.caution_slip
    assert float(rows["torque"]) == thresholds.torque
    assert math.radians(float(rows["drift"])) == thresholds.drift
    assert math.radians(float(rows["cautionDrift"])) == thresholds.caution_drift
    assert float(rows["geometry"]) == thresholds.geometry
    assert float(rows["speed"]) == meant(SMALLEST).speed
    assert float(rows["power"]) == meant(SMALLEST).power
    assert float(rows["maxSlip"]) == Wheel(1, 1).max_slip
    assert float(rows["contactLength"]) == Wheel(1, 1).contact_length
    assert float(rows["carcassStiffness"]) * 1e3 == CARCASS
