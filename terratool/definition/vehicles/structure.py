"""From plain JSON values to the model of a vehicle, with a remark for all that does not fit."""

from __future__ import annotations

from typing import Any, TypeVar

from msgspec import Struct

from terratool.definition.built import Built
from terratool.definition.findings import RemarkLog
from terratool.definition.fitting import Decoder
from terratool.definition.vehicles.keys import MAX_AXLES, REQUIRED, VEHICLE_KEYS
from terratool.definition.vehicles.model import (
    AxleText,
    ClassesText,
    CogText,
    MarginsText,
    OverhangText,
    VehicleText,
    WheelsText,
)
from terratool.definition.wording import JSON_NAMES

_Part = TypeVar("_Part", bound=Struct)
_PARTS: dict[str, type[Struct]] = {
    "wheels": WheelsText, "cog": CogText, "overhang": OverhangText, "margins": MarginsText,
    "classes": ClassesText,
}  # fmt: skip


def build_vehicle(value: Any, found: RemarkLog) -> tuple[VehicleText | None, Built]:
    """The vehicle as far as it fits, None where the text is no object; and what was left out."""
    builder = _VehicleDecoder(found)
    return builder.build(value), builder.built


class _VehicleDecoder(Decoder):
    @property
    def built(self) -> Built:
        """What was left out and what is ignored."""
        return self._built

    def build(self, value: Any) -> VehicleText | None:
        if not isinstance(value, dict):
            self._add(
                "TT105",
                "",
                f"the vehicle is {JSON_NAMES[type(value)]} where an object is expected.",
                'Write { "mass": …, "wheels": {…}, "wheelbase": …, … }.',
            )
            return None
        fields = self._fields(VehicleText, value, "")
        for key, kind in _PARTS.items():
            if key in fields:
                fields[key] = self._part(kind, fields[key], f"/{key}", f'"{key}"')
        if "axles" in fields:
            fields["axles"] = self._axles(fields["axles"])
        self._require(VehicleText, value, "", "the vehicle")
        if "axles" not in value and "wheelbase" not in value:
            message = 'the vehicle has neither "axles" nor "wheelbase".'
            self._add("TT104", "", message, 'Add "axles", or "wheelbase" for two driven axles.')
        return VehicleText(**fields)

    def _part(self, kind: type[_Part], value: dict[str, Any], pointer: str, name: str) -> _Part:
        self._require(kind, value, pointer, name)
        return kind(**self._fields(kind, value, pointer))

    def _axles(self, values: list[Any]) -> tuple[AxleText, ...]:
        if not 2 <= len(values) <= MAX_AXLES:
            words = VEHICLE_KEYS[VehicleText]["axles"].words
            self._wrong_type("", "/axles", '"axles"', words, values)
            self._leave_out("", "axles")
        axles = []
        for index, value in enumerate(values):
            here = f"/axles/{index}"
            if isinstance(value, dict):
                axles.append(self._part(AxleText, value, here, "the axle"))
            else:
                self._wrong_type(here, "", f'item {index} of "axles"', "an axle, an object", value)
                axles.append(AxleText())
        return tuple(axles)

    def _require(self, kind: type, value: dict[str, Any], pointer: str, name: str) -> None:
        for key in REQUIRED.get(kind, ()):
            if key not in value:
                hint = f'Add "{key}", {VEHICLE_KEYS[kind][key].words}.'
                self._add("TT104", pointer, f'{name} has no "{key}".', hint)
