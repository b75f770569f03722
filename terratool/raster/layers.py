"""Layers of a raster: heights, surfaces, slopes, soils and colours, and their files."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.presets import property_of
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.io.bands import Bands
from terratool.raster.grid import Grid
from terratool.raster.painter import (
    CLEARANCE_BAND,
    COLUMN_BANDS,
    COUNT_BAND,
    GROUND_BAND,
    Planes,
    id_type,
)
from terratool.raster.shading import shade_bytes
from terratool.text.meaning import guess

Pixels = NDArray[Any]

NO_COLOR = (128, 128, 128)
"""Red, green and blue of ground whose surface has no colour; pixels without ground are black."""


@dataclass(frozen=True, slots=True)
class Layer:
    """A property of the ground at each pixel.

    Attributes:
        name: name on the command line and in requests.
        bands: names of the bands.
        unit: unit of the values; "1" for a share or a ratio, empty for counts and categories.
        content: meaning of the pixels: "number", "surface", "color" or "shade".
        soil: attribute of a surface that the layer shows; empty for computed layers.
        slopes: whether the layer is computed from slopes.
        columns: whether the layer is computed from all tops, not from the highest alone.
        mean: averaging of values: "number", "direction" in degrees, "vector" over all bands, or
            empty for none.
    """

    name: str
    bands: tuple[str, ...]
    unit: str
    content: str = "number"
    soil: str = ""
    slopes: bool = False
    mean: str = "number"
    columns: bool = False

    @property
    def title(self) -> str:
        """Column title of the first band: its name, and its unit in parentheses."""
        return f"{self.bands[0]} ({self.unit})" if self.unit not in ("", "1") else self.bands[0]

    @property
    def surfaces(self) -> bool:
        """Whether the layer is computed from surfaces."""
        return bool(self.soil) or self.content == "surface"


LAYERS: dict[str, Layer] = {
    layer.name: layer
    for layer in (
        Layer("height", ("height",), "m"),
        Layer("surface", ("surface",), "", "surface", mean=""),
        Layer("slope", ("slope",), "degree", slopes=True),
        # downhill direction, clockwise from north
        Layer("aspect", ("aspect",), "degree", slopes=True, mean="direction"),
        Layer("normal", ("normal x", "normal y", "normal z"), "1", slopes=True, mean="vector"),
        Layer("cohesion", ("cohesion",), "kPa", soil="cohesion"),
        Layer("friction", ("friction angle",), "degree", soil="fric_angle"),
        Layer("sinkage", ("sinkage",), "m/kN", soil="sinkage"),
        # share of sound reflected
        Layer("sonar", ("sonar reflectance",), "1", soil="sonar_refl"),
        Layer("color", ("red", "green", "blue"), "", "color", soil="color"),
        Layer("hillshade", ("hillshade",), "", "shade"),
        Layer("ground", ("ground",), "m", columns=True),
        # from the ground to the next underside
        Layer("clearance", ("clearance",), "m", columns=True),
        Layer("storeys", ("storeys",), "", columns=True),
        # further bands of those that have more tops: see with_tops
        Layer("columns", ("top-1",), "m", columns=True),
    )
}


def with_tops(layer: Layer, most: int) -> Layer:
    """Layer with as many bands as columns of so many tops have; other layers are as they were."""
    if layer.name != "columns":
        return layer
    more = (name for k in range(2, most + 1) for name in (f"bottom-{k}", f"top-{k}"))
    return replace(layer, bands=("top-1", *more))


@dataclass(frozen=True)
class LayerBands(Bands):
    """Bands of one file, from layers.

    Attributes:
        layers: layers in the order of their bands.
    """

    layers: tuple[Layer, ...] = ()

    @classmethod
    def of(
        cls, layers: Sequence[Layer], dtype: np.dtype[Any], empty: float = math.nan
    ) -> LayerBands:
        """Build the bands of layers of equal content; `empty` is the nodata value of numbers."""
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
    """Look layers up by name; repeated names count once.

    Raises:
        RequestError: no name is given, or a name is unknown.
    """
    if not names:
        raise RequestError("No layer is asked for.", f"The layers are {', '.join(LAYERS)}.")
    for name in names:
        if name not in LAYERS:
            raise RequestError(
                f"There is no layer {name!r}.",
                guess(name, LAYERS) or f"The layers are {', '.join(LAYERS)}.",
            )
    return tuple(LAYERS[name] for name in dict.fromkeys(names))


def files_of(
    layers: Sequence[Layer], terrain: Terrain, dtype: np.dtype[Any], empty: float = math.nan
) -> tuple[LayerBands, ...]:
    """Group layers into files: one for all numbers, and one each for surfaces, colours and shades.

    Surfaces and colours cannot share a file, as its colour interpretation holds for all bands. The
    file of the first layer comes first.
    """
    byte = np.dtype(np.uint8)
    dtypes = {"number": dtype, "surface": id_type(terrain), "color": byte, "shade": byte}
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
    """Property values of a terrain's surfaces by surface id: index + 1, 0 for no surface."""

    terrain: Terrain = field(repr=False)

    def lacking(self, layer: Layer) -> list[str]:
        """Names of the surfaces without a value for a layer; void ones are left out."""
        if not layer.soil:
            return []
        return [
            name
            for name, surface in self.terrain.surface_types.items()
            if surface.void is not True and property_of(surface, layer.soil) is UNSET
        ]

    def given_as_range(self, layer: Layer) -> list[str]:
        """Names of the surfaces that give a layer as a range, whose middle is shown."""
        types = self.terrain.surface_types
        return [name for name, surface in types.items() if layer.soil in surface.ranges]

    @cached_property
    def voids(self) -> NDArray[np.bool_]:
        """Whether a surface id means no ground, (surfaces + 1,) bool."""
        kinds = (surface.void is True for surface in self.terrain.surface_types.values())
        return np.array([True, *kinds])

    def values(self, layer: Layer, dtype: np.dtype[Any]) -> Pixels:
        """Values of a layer by surface id, (surfaces + 1,); NaN for unknown values and the void."""
        values = np.full(len(self.voids), np.nan)
        for id_, surface in enumerate(self.terrain.surface_types.values(), 1):
            value = property_of(surface, layer.soil)
            if value is not UNSET and not self.voids[id_]:
                values[id_] = value
        with np.errstate(over="ignore"):  # infinite values are refused after painting
            return values.astype(dtype)

    @cached_property
    def colors(self) -> NDArray[np.uint8]:
        """Red, green and blue by surface id, (surfaces + 1, 3) uint8."""
        surfaces = self.terrain.surface_types.values()
        colors = (NO_COLOR if surface.color is UNSET else surface.color for surface in surfaces)
        return np.array([NO_COLOR, *colors], np.uint8)


def layer_painter(
    bands: LayerBands, terrain: Terrain, grid: Grid
) -> Callable[[Planes, Pixels, tuple[slice, slice]], None]:
    """Build a function that fills bands of a file, (bands, height, width), from painted planes.

    Its last argument says which rows and columns of the planes the bands have; what is shaded looks
    at their neighbours, too.
    """
    soils = SurfaceValues(terrain)
    tables: dict[str, Pixels] = {
        layer.name: soils.colors if layer.content == "color" else soils.values(layer, bands.dtype)
        for layer in bands.layers
        if layer.soil
    }

    def lay(painted: Planes, out: Pixels, place: tuple[slice, slice]) -> None:
        planes, band = painted.part(*place), 0
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
            elif layer.columns:
                assert planes.columns is not None
                part[:] = planes.columns[_BANDS[layer.name]]
            elif layer.content == "shade":
                part[0] = shade_bytes(painted.heights, grid.resolution)[place]
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
    angle[angle == 360.0] = 0.0  # angles just below 0 round up to 360
    angle[(planes.slope_x == 0.0) & (planes.slope_y == 0.0)] = np.nan
    out[0] = angle


def _normal(planes: Planes, out: Pixels) -> None:
    assert planes.slope_x is not None and planes.slope_y is not None
    steep = np.hypot(planes.slope_x, planes.slope_y)
    np.divide(1.0, np.hypot(steep, 1.0, out=steep), out=out[2])
    np.subtract(0.0, planes.slope_x * out[2], out=out[0])
    np.subtract(0.0, planes.slope_y * out[2], out=out[1])


_BANDS = {
    "ground": slice(GROUND_BAND, GROUND_BAND + 1),
    "clearance": slice(CLEARANCE_BAND, CLEARANCE_BAND + 1),
    "storeys": slice(COUNT_BAND, COUNT_BAND + 1),
    "columns": slice(COLUMN_BANDS, None),
}
"""Bands of `Planes.columns` that each layer of columns has."""
_COMPUTED: dict[str, Callable[[Planes, Pixels], None]] = {
    "height": _height, "surface": _surface, "slope": _slope, "aspect": _aspect, "normal": _normal,
}  # fmt: skip
