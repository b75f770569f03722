"""Layers: what a raster can hold besides heights, and how they are laid into files."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.presets import property_of
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.io.bands import Bands
from terratool.raster.painter import Planes, id_type

Pixels = NDArray[Any]

NO_COLOR = (128, 128, 128)
"""Ground whose surface has no colour; where there is no ground it is black."""


@dataclass(frozen=True, slots=True)
class Layer:
    """One thing that is known of the ground at each pixel.

    Attributes:
        name: how it is asked for.
        bands: what its bands are called.
        unit: of its values; "1" for a share or a ratio, empty for what is counted or chosen.
        content: of its pixels: "number", "surface" or "color".
        soil: the attribute of a surface that it shows; empty for others.
        slopes: whether the slopes are needed for it.
        mean: how values are averaged: as "number", as "direction" in degrees, as "vector" of all
            bands; empty where they have no mean.
    """

    name: str
    bands: tuple[str, ...]
    unit: str
    content: str = "number"
    soil: str = ""
    slopes: bool = False
    mean: str = "number"

    @property
    def title(self) -> str:
        """What a column of its values is called."""
        return f"{self.bands[0]} ({self.unit})" if self.unit not in ("", "1") else self.bands[0]

    @property
    def surfaces(self) -> bool:
        """Whether the surfaces are needed for it."""
        return bool(self.soil) or self.content != "number"


LAYERS: dict[str, Layer] = {
    layer.name: layer
    for layer in (
        Layer("height", ("height",), "m"),
        Layer("surface", ("surface",), "", "surface", mean=""),
        Layer("slope", ("slope",), "degree", slopes=True),
        # where the ground falls to, clockwise from north
        Layer("aspect", ("aspect",), "degree", slopes=True, mean="direction"),
        Layer("normal", ("normal x", "normal y", "normal z"), "1", slopes=True, mean="vector"),
        Layer("cohesion", ("cohesion",), "kPa", soil="cohesion"),
        Layer("friction", ("friction angle",), "degree", soil="fric_angle"),
        Layer("sinkage", ("sinkage",), "m/kN", soil="sinkage"),
        # the share of sound that comes back
        Layer("sonar", ("sonar reflectance",), "1", soil="sonar_refl"),
        Layer("color", ("red", "green", "blue"), "", "color", soil="color"),
    )
}


@dataclass(frozen=True)
class LayerBands(Bands):
    """Bands of one file that hold layers.

    Attributes:
        layers: in the order of their bands.
    """

    layers: tuple[Layer, ...] = ()

    @classmethod
    def of(
        cls, layers: Sequence[Layer], dtype: np.dtype[Any], empty: float = math.nan
    ) -> LayerBands:
        """Bands of layers of the same content; `empty` stands for none, in layers of numbers."""
        bands = [(name, layer) for layer in layers for name in layer.bands]
        return cls(
            tuple(name for name, _ in bands),
            tuple(layer.unit for _, layer in bands),
            dtype,
            layers[0].content,
            empty,
            tuple(layer.mean for _, layer in bands),
            tuple(layers),
        )


def layers_named(names: Sequence[str]) -> tuple[Layer, ...]:
    """The layers of these names, each once.

    Raises:
        RequestError: there is no such layer.
    """
    if not names:
        raise RequestError("No layer is asked for.", f"The layers are {', '.join(LAYERS)}.")
    for name in names:
        if name not in LAYERS:
            raise RequestError(
                f"There is no layer {name!r}.", f"The layers are {', '.join(LAYERS)}."
            )
    return tuple(LAYERS[name] for name in dict.fromkeys(names))


def files_of(
    layers: Sequence[Layer], terrain: Terrain, dtype: np.dtype[Any], empty: float = math.nan
) -> tuple[LayerBands, ...]:
    """The files that layers take: one for all numbers, and one each for surfaces and colours.

    Surfaces and colours cannot share one: their bytes are told apart by what the whole file says
    of its colours. The first layer's file comes first.
    """
    dtypes = {"number": dtype, "surface": id_type(terrain), "color": np.dtype(np.uint8)}
    return tuple(
        LayerBands.of(
            [layer for layer in layers if layer.content == content],
            dtypes[content],
            empty if content == "number" else math.nan,
        )
        for content in dict.fromkeys(layer.content for layer in layers)
    )


@dataclass(frozen=True)
class SurfaceValues:
    """Values of the surfaces of a terrain, by id: the index of the surface and one."""

    terrain: Terrain = field(repr=False)

    def lacking(self, layer: Layer) -> list[str]:
        """Names of the surfaces, other than void ones, that have no value for a layer."""
        if not layer.soil:
            return []
        return [
            name
            for name, surface in self.terrain.surface_types.items()
            if surface.void is not True and property_of(surface, layer.soil) is UNSET
        ]

    def ranged(self, layer: Layer) -> list[str]:
        """Names of the surfaces of which a layer has the middle of a range."""
        types = self.terrain.surface_types
        return [name for name, surface in types.items() if layer.soil in surface.ranges]

    @cached_property
    def voids(self) -> NDArray[np.bool_]:
        """Whether there is no ground."""
        kinds = (surface.void is True for surface in self.terrain.surface_types.values())
        return np.array([True, *kinds])

    def values(self, layer: Layer, dtype: np.dtype[Any]) -> Pixels:
        """(surfaces + 1,) numbers, NaN where a surface has none and where there is no ground."""
        values = np.full(len(self.voids), np.nan)
        for id_, surface in enumerate(self.terrain.surface_types.values(), 1):
            value = property_of(surface, layer.soil)
            if value is not UNSET and not self.voids[id_]:
                values[id_] = value
        with np.errstate(over="ignore"):  # what is infinite is noticed when it is painted
            return values.astype(dtype)

    @cached_property
    def colors(self) -> NDArray[np.uint8]:
        """(surfaces + 1, 3) colours."""
        surfaces = self.terrain.surface_types.values()
        colors = (NO_COLOR if surface.color is UNSET else surface.color for surface in surfaces)
        return np.array([NO_COLOR, *colors], np.uint8)


def layer_painter(bands: LayerBands, terrain: Terrain) -> Callable[[Planes, Pixels], None]:
    """A function from the planes of a window into the bands of a file, (bands, height, width)."""
    soils = SurfaceValues(terrain)
    tables: dict[str, Pixels] = {
        layer.name: soils.colors if layer.content == "color" else soils.values(layer, bands.dtype)
        for layer in bands.layers
        if layer.soil
    }

    def lay(planes: Planes, out: Pixels) -> None:
        band = 0
        for layer in bands.layers:
            part = out[band : band + len(layer.bands)]
            band += len(layer.bands)
            if layer.soil:
                assert planes.surfaces is not None
                table = tables[layer.name].reshape(len(soils.voids), -1)
                for values, plane in zip(table.T, part, strict=True):
                    np.take(values, planes.surfaces, out=plane)
                    if layer.content == "color":
                        plane[np.isnan(planes.heights)] = 0
            else:
                _COMPUTED[layer.name](planes, part)

    return lay


def _height(planes: Planes, out: Pixels) -> None:
    out[0] = planes.heights


def _surface(planes: Planes, out: Pixels) -> None:
    out[0] = planes.surfaces


def _slope(planes: Planes, out: Pixels) -> None:
    assert planes.slope_x is not None and planes.slope_y is not None
    np.hypot(planes.slope_x, planes.slope_y, out=out[0])
    np.degrees(np.arctan(out[0], out=out[0]), out=out[0])


def _aspect(planes: Planes, out: Pixels) -> None:
    assert planes.slope_x is not None and planes.slope_y is not None
    angle = np.degrees(np.arctan2(-planes.slope_x, -planes.slope_y))
    np.mod(angle, 360.0, out=angle)
    angle[angle == 360.0] = 0.0  # what is just below 0 rounds up
    angle[(planes.slope_x == 0.0) & (planes.slope_y == 0.0)] = np.nan
    out[0] = angle


def _normal(planes: Planes, out: Pixels) -> None:
    assert planes.slope_x is not None and planes.slope_y is not None
    steep = np.hypot(planes.slope_x, planes.slope_y)
    np.divide(1.0, np.hypot(steep, 1.0, out=steep), out=out[2])
    np.subtract(0.0, planes.slope_x * out[2], out=out[0])
    np.subtract(0.0, planes.slope_y * out[2], out=out[1])


_COMPUTED: dict[str, Callable[[Planes, Pixels], None]] = {
    "height": _height, "surface": _surface, "slope": _slope, "aspect": _aspect, "normal": _normal,
}  # fmt: skip
