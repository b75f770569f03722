"""Wheels whose figures contradict each other, alone or together with those of their axle."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.keys import SLOTS
from terratool.definition.rules.base import WHEEL_KEYS, VehicleSubject, rule
from terratool.definition.vehicle import AxleText, WheelText
from terratool.text.display import quote

_KEYS = {key: SLOTS[AxleText][key].name for key in WHEEL_KEYS}
_FOREIGN = {
    "rigid": ("grouserHeight", "tyrePressure", "carcassStiffness"),
    "lugged": ("tyrePressure", "carcassStiffness"),
    "tyre": (),
}
"""Keys that wheels of a kind do not have, by kind."""
_NAMES = {"rigid": "a rigid wheel", "lugged": "a lugged wheel", "tyre": "a tyre"}


@rule("TT511", "contradictory-wheel", kind="vehicle")
def contradictory_wheel(subject: VehicleSubject) -> Iterator[Remark]:
    """A wheel has what its kind has not.

    A rigid wheel has neither lugs nor pressure, and a lugged one has no pressure; a tyre may have
    lugs. Lugs of height 0 are none. Where no kind is given, the other keys tell it. An axle without
    a kind of its own takes over that of the wheels.

    Fails:

        {
          "mass": 50,
          "wheels": {"radius": 0.16, "width": 0.11, "kind": "rigid", "tyrePressure": 80},
          "wheelbase": 0.5, "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11, "kind": "lugged"},
          "axles": [{"x": 0.25}, {"x": -0.25, "tyrePressure": 80}],
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11, "kind": "lugged"},
          "axles": [{"x": 0.25}, {"x": -0.25, "kind": "tyre", "tyrePressure": 80}],
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    To mend: remove the key, or give the kind that the wheel is of.
    """
    for owner, written, wheel in subject.wheels:
        kind = wheel.known_kind
        for key in _FOREIGN[kind]:
            # a key that an axle takes over is reported at the common wheels
            if getattr(wheel, _KEYS[key]) in (UNSET, 0) or not _wrote(written, key):
                continue
            others = [each for each, foreign in _FOREIGN.items() if key not in foreign]
            yield Remark(
                f"{owner}/{key}",
                f'"{key}" is a figure of {" or ".join(_NAMES[each] for each in others)}, but the '
                f'wheel is of kind "{kind}".',
                f'Remove "{key}", or write {" or ".join(map(quote, others))} as "kind" beside it.',
            )


def _wrote(written: WheelText, *keys: str) -> bool:
    return any(getattr(written, _KEYS[key]) is not UNSET for key in keys)


@rule("TT512", "oversized-contact", kind="vehicle")
def oversized_contact(subject: VehicleSubject) -> Iterator[Remark]:
    """The lugs are longer than the wheel's radius, or its contact is longer than its diameter.

    An axle with a radius of its own has the lugs and the contact length of the other wheels unless
    it has its own, or is of another kind.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11, "grouserHeight": 25},
          "wheelbase": 0.5, "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11, "contactLength": 0.15},
          "axles": [{"x": 0.25}, {"x": -0.25, "wheels": 1, "driven": false, "radius": 0.05}],
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11, "contactLength": 0.15},
          "axles": [
            {"x": 0.25},
            {"x": -0.25, "wheels": 1, "driven": false, "radius": 0.05, "contactLength": 0.02}
          ],
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    To mend: write both in metres. Lugs count from the rim, the contact along the ground.
    """
    for owner, written, wheel in subject.wheels:
        if wheel.radius is UNSET:
            continue
        for key, most, what in (
            ("grouserHeight", wheel.radius, "its radius is"),
            ("contactLength", 2 * wheel.radius, "its diameter is"),
        ):
            length = getattr(wheel, _KEYS[key])
            if length is UNSET or length <= most or not _wrote(written, "radius", key):
                continue
            yield Remark(
                f"{owner}/{key}" if _wrote(written, key) else f"{owner}/radius",
                f'the wheel has a "{key}" of {quote(length)} m, but {what} only {quote(most)} m.',
                f'Write "{key}" and "radius" in metres, in the axle, too, where it differs.',
            )


@rule("TT513", "idle-carcass", "warning", kind="vehicle")
def idle_carcass(subject: VehicleSubject) -> Iterator[Remark]:
    """The stiffness of a tyre's carcass has no effect, as there is no pressure that it adds to.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11, "carcassStiffness": 30},
          "wheelbase": 0.5, "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Passes:

        {
          "mass": 50,
          "wheels": {"radius": 0.16, "width": 0.11, "tyrePressure": 80, "carcassStiffness": 30},
          "wheelbase": 0.5, "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    To mend: add "tyrePressure", or leave the stiffness out.
    """
    effect: dict[str, bool] = {}
    for owner, written, wheel in subject.wheels:
        if wheel.carcass_stiffness is not UNSET:
            place = owner if _wrote(written, "carcassStiffness") else "/wheels"
            effect[place] = effect.get(place, False) or wheel.tyre_pressure is not UNSET
    for owner, any_effect in effect.items():
        if not any_effect:
            yield Remark(
                f"{owner}/carcassStiffness",
                '"carcassStiffness" has no effect without "tyrePressure".',
                'Add "tyrePressure", in kPa, or remove it.',
            )
