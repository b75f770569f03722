"""What the user wrote, as frozen typed values; absent keys are `UNSET`.

The classes mirror the text key by key (``cell_x`` is ``cellX``). Defaults are not filled in:
they depend on the place in the tree, and `terratool.field` gives them their meaning.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, NamedTuple, TypeVar

import msgspec
from msgspec import UNSET, Meta, Struct, UnsetType

MAX_CELLS = 65536
MAX_SCATTERED = 1_000_000
"""Most scattered copies of an element."""
MAX_SCATTERED_IN_ALL = 10_000_000
"""Most scattered copies of a terrain."""
MAX_SEED = 2**53
"""Whole numbers up to here are the same in every reader of JSON."""

LARGEST = 1e30
"""No length, height or factor may be larger in size; sums and squares then stay finite."""
SMALLEST = 1e-30

DEFAULT_CELLS = 10
"""Cells of an element's grid along each axis where `cells` is absent."""

DEFAULT_MULTIPASS = 3.0
"""The `multipass` of a track where it is absent: between loose and medium soil."""

Pair = tuple[float, float]
CurveValue = tuple[float | Pair, ...] | str
"""A vector, a list of knots (never both in one list; a rule sees to that), or a string."""
SoilFigure = float | Pair
"""A number, or a range [low, high] in which every value is equally likely."""
SOIL_FIGURES = ("cohesion", "fric_angle", "sinkage", "shear_modulus")
"""Attributes of a surface that may be ranges."""


# the ranges of numbers of elements, held against while decoding: later it takes far longer
_Place = Annotated[int, Meta(ge=0, le=MAX_CELLS - 1)]
_Count = Annotated[int, Meta(ge=1, le=MAX_CELLS)]
_Number = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
_Length = Annotated[float, Meta(ge=SMALLEST, le=LARGEST)]


Number = TypeVar("Number", int, float)


def names_of(kind: type) -> Iterator[tuple[str, str]]:
    """Each attribute of a class of the model, and its key in the text."""
    yield from zip(kind.__struct_fields__, kind.__struct_encode_fields__, strict=True)  # type: ignore[attr-defined]


def pair_of(
    value: Number | tuple[Number, Number] | UnsetType, default: Number
) -> tuple[Number, Number]:
    """A number for both axes, or one for each."""
    if value is UNSET:
        return default, default
    return value if isinstance(value, tuple) else (value, value)


def middle_of(figure: SoilFigure) -> float:
    """The one number that counts for a figure of a soil: of a range its middle."""
    if not isinstance(figure, tuple):
        return figure
    low, high = figure
    return 0.5 * low + 0.5 * high


def ends_of(figure: SoilFigure) -> Pair:
    """The least and the largest value that a figure of a soil may have."""
    return figure if isinstance(figure, tuple) else (figure, figure)


class Roughness(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """The relief of a surface, finer than any element: see `terratool.field.relief`."""

    rms: float | UnsetType = UNSET
    correlation: float | UnsetType = UNSET
    seed: int | UnsetType = UNSET


class Surface(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """The micro-terrain: soil, friction, colour, sonar and relief of a surface."""

    descr: str | UnsetType = UNSET
    preset: str | UnsetType = UNSET
    cohesion: SoilFigure | UnsetType = UNSET
    fric_angle: SoilFigure | UnsetType = UNSET
    sinkage: SoilFigure | UnsetType = UNSET
    color: tuple[int, int, int] | UnsetType = UNSET
    sonar_refl: float | UnsetType = UNSET
    shear_modulus: SoilFigure | UnsetType = UNSET
    void: bool | UnsetType = UNSET
    roughness: Roughness | UnsetType = UNSET

    @property
    def ranges(self) -> dict[str, Pair]:
        """Figures that may have several values, by attribute; none where there is no ground."""
        if self.void is True:
            return {}
        figures = ((name, getattr(self, name)) for name in SOIL_FIGURES)
        return {
            name: figure
            for name, figure in figures
            if isinstance(figure, tuple) and figure[0] < figure[1]
        }


class Range(NamedTuple):
    """A figure of a surface that may have several values: the surface's name, the key, the ends."""

    surface: str
    key: str
    low: float
    high: float


def ranges_of(surfaces: Mapping[str, Surface]) -> tuple[Range, ...]:
    """The figures of surfaces, by name, that may have several values."""
    keys = dict(names_of(Surface))
    return tuple(
        Range(name, keys[attribute], low, high)
        for name, surface in surfaces.items()
        for attribute, (low, high) in surface.ranges.items()
    )


class Primitive(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Two cross-section curves and how they combine."""

    descr: str | UnsetType = UNSET
    x: CurveValue | UnsetType = UNSET
    y: CurveValue | UnsetType = UNSET
    combine: str | UnsetType = UNSET


class Repeat(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", gc=False):
    """Copies of an element in rows: the one at (i, j) is moved by i and j steps.

    A step is in whole cells for an element in a cell, in units of the terrain for one at a place.
    """

    count: tuple[_Count, _Count]
    step: tuple[_Number, _Number]


class Scatter(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", gc=False):
    """Copies of an element strewn over its cell, each with a place and a size of its own."""

    sizes: tuple[_Length, _Length]
    count: Annotated[int, Meta(ge=1, le=MAX_SCATTERED)] | UnsetType = UNSET
    density: _Length | UnsetType = UNSET
    seed: Annotated[int, Meta(ge=0, le=MAX_SEED)] | UnsetType = UNSET
    distance: Annotated[float, Meta(ge=0, le=LARGEST)] | UnsetType = UNSET
    turned: bool | UnsetType = UNSET


class Element(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", gc=False):
    """A primitive or a part placed in a cell, with the grid that divides it for its children.

    The cell is one of the parent's grid, or has its middle at a place of its own.
    """

    cell_x: _Place | UnsetType = UNSET
    cell_y: _Place | UnsetType = UNSET
    span: tuple[_Count, _Count] | UnsetType = UNSET
    at: tuple[_Number, _Number] | UnsetType = UNSET
    # no range here: msgspec 0.22 mixes up a number with a range and a pair beside it
    extent: float | Pair | UnsetType = UNSET
    repeat: Repeat | UnsetType = UNSET
    scatter: Scatter | UnsetType = UNSET
    descr: str | UnsetType = UNSET
    type: str | UnsetType = UNSET
    part: str | UnsetType = UNSET
    surface: str | UnsetType = UNSET
    v_scale: _Number | UnsetType = UNSET
    v_offset: _Number | UnsetType = UNSET
    turn_deg: _Number | UnsetType = UNSET
    cells: int | tuple[int, int] | UnsetType = UNSET
    children: tuple[Element, ...] | UnsetType = UNSET


class Track(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """The rut of one wheel: a polyline with a width, and how deep the wheel sinks along it."""

    descr: str | UnsetType = UNSET
    path: tuple[Pair, ...] | UnsetType = UNSET
    width: float | UnsetType = UNSET
    load: float | UnsetType = UNSET
    depth: float | dict[str, float] | UnsetType = UNSET
    passes: int | UnsetType = UNSET
    multipass: float | UnsetType = UNSET
    surface: str | UnsetType = UNSET

    @property
    def points(self) -> tuple[Pair, ...]:
        """The polyline, empty where absent."""
        return () if self.path is UNSET else self.path

    @property
    def by_load(self) -> bool:
        """Whether its depth, in part or all of it, follows from the load and the ground."""
        return self.load is not UNSET and not isinstance(self.depth, float)


class Library(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Surfaces, primitives and parts for terrains and other libraries to use."""

    schema: str | UnsetType = msgspec.field(default=UNSET, name="$schema")
    descr: str | UnsetType = UNSET
    use: tuple[str, ...] | UnsetType = UNSET
    surf_types: dict[str, Surface] | UnsetType = UNSET
    elem_types: dict[str, Primitive] | UnsetType = UNSET
    parts: dict[str, Element] | UnsetType = UNSET

    @property
    def used(self) -> tuple[str, ...]:
        """The paths of the libraries that it uses, none where absent."""
        return () if self.use is UNSET else self.use

    @property
    def surfaces(self) -> dict[str, Surface]:
        """The dictionary of surfaces, empty where absent."""
        return {} if self.surf_types is UNSET else self.surf_types

    @property
    def primitives(self) -> dict[str, Primitive]:
        """The dictionary of primitives, empty where absent."""
        return {} if self.elem_types is UNSET else self.elem_types

    @property
    def assemblies(self) -> dict[str, Element]:
        """The dictionary of parts, empty where absent."""
        return {} if self.parts is UNSET else self.parts


class Definition(Library, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """One terrain."""

    size: float | Pair | UnsetType = UNSET
    origin: Pair | UnsetType = UNSET
    crs: str | int | dict[str, object] | UnsetType = UNSET
    elem_tree: Element | UnsetType = UNSET
    tracks: tuple[Track, ...] | UnsetType = UNSET

    @property
    def extent(self) -> Pair:
        """Side lengths along x and y."""
        return pair_of(self.size, math.nan)  # a rule says where there is none

    @property
    def corner(self) -> Pair:
        """World position of the south-west corner."""
        return (0.0, 0.0) if self.origin is UNSET else self.origin

    @property
    def ruts(self) -> tuple[Track, ...]:
        """The tracks, none where absent."""
        return () if self.tracks is UNSET else self.tracks
