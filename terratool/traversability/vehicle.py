"""Vehicle files become vehicles in SI units, with everything that has a default filled in."""

from __future__ import annotations

import math
from pathlib import Path

from msgspec import UNSET, Struct

from terratool.definition.reader import CheckOptions, refusal
from terratool.definition.recognising import document_kind
from terratool.definition.source import read_source
from terratool.definition.vehicles.model import VehicleText
from terratool.definition.vehicles.reader import check_vehicle
from terratool.errors import DefinitionError
from terratool.traversability.types import (
    Axle,
    Margins,
    Overhang,
    Thresholds,
    Vehicle,
    Wheel,
)


def load_vehicle(path: str | Path) -> Vehicle:
    """Read a vehicle file that has no errors; ``-`` is standard input.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: it has errors, or is a terrain; errors are in `findings`.
    """
    source = read_source(path)
    checked = check_vehicle(source, CheckOptions(warnings=False))
    if checked.vehicle is None:
        if document_kind(source.data) == "terrain":
            raise DefinitionError(
                f"{source.name}: is a terrain, where a vehicle is wanted.",
                "Name a vehicle file here, such as samples/vehicles/husky-a200.json.",
            )
        raise refusal(checked)
    name = Path(source.name).name.removesuffix(".gz").removesuffix(".json")
    return vehicle_of(checked.vehicle, name)


def vehicle_of(text: VehicleText, name: str = "") -> Vehicle:
    """What the text of a vehicle means.

    Args:
        text: without errors.
        name: for reports.
    """
    placed = [
        Axle(axle.x - text.cog_x, axle.count, axle.is_driven)
        for axle in text.all_axles
        if axle.x is not UNSET
    ]
    given = _given(text)
    hang, margins = _given(text.overhang), _given(text.margins)
    for angle in margins.keys() & {"tip", "slope"}:
        margins[angle] = math.radians(margins[angle])
    return Vehicle(
        wheel=Wheel(**_given(text.wheels)),
        # from the front to the rear, whatever the order in the file
        axles=tuple(sorted(placed, key=lambda axle: -axle.x)),
        gravity=text.acceleration,
        cog_height=_given(text.cog)["height"],
        front=_overhang(hang, "front", given["clearance"]),
        rear=_overhang(hang, "rear", given["clearance"]),
        margins=Margins(**margins),
        thresholds=Thresholds(**_given(text.classes)),
        name=name,
        **{key: given[key] for key in _PLAIN if key in given},
    )


_PLAIN = ("mass", "track", "clearance", "body_width", "speed", "power")


def _given(text: Struct) -> dict[str, float]:
    """What stands in the text, by the names of the model; what is absent has its default later."""
    pairs = ((name, getattr(text, name)) for name in text.__struct_fields__)
    return {name: value for name, value in pairs if value is not UNSET}


def _overhang(given: dict[str, float], end: str, clearance: float) -> Overhang:
    """The end of the body is as high as the rest of it unless it is said to be elsewhere."""
    if end not in given:
        return Overhang()
    return Overhang(given[end], given.get(f"{end}_height", clearance))
