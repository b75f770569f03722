"""Terrains and libraries as they are written: frozen typed values, absent keys `UNSET`.

The classes mirror the text key by key (``cell_x`` is ``cellX``). Defaults are not filled in:
they depend on the place in the tree, and `terratool.field` gives them their meaning.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import UNSET, Meta, Struct, UnsetType, structs

from terratool.definition.key import FLAG, SCHEMA, TEXT, Key, Shape, choice, ranged, whole
from terratool.report.documents import one_of

MAX_CELLS = 65536
MAX_SCATTERED = 1_000_000
"""Most scattered copies of an element."""
MAX_SCATTERED_IN_ALL = 10_000_000
"""Most scattered copies of a terrain."""
MAX_SEED = 2**53
"""Largest seed: whole numbers up to it are the same in every reader of JSON."""
MAX_BANDS = 65535
"""Most bands of a raster, as in a TIFF."""
MAX_PASSES = 10**9
"""Most passes of a track; sums of passes stay whole in doubles."""
POINT_LENGTHS = (2, 3)
"""Numbers of a point of a track: x and y, and perhaps z."""
COMBINES = ("product", "sum", "min", "max", "radial")
"""Ways in which the two curves of a primitive combine."""
REGISTRATIONS = ("gridline", "pixel")
"""Ways in which the numbers of a grid stand in the unit square, in the words of GMT: the outer ones
on its edges, or each in the middle of a pixel."""

CLASS = "(0|-?[1-9][0-9]{0,14})"
"""Pattern of a class of a raster, a whole number, as a key of `names` spells it."""

LARGEST = 1e30
"""Largest size of lengths, heights and factors; their sums and squares stay finite."""
SMALLEST = 1e-30

DEFAULT_CELLS = 10
"""Cells of an element's grid along each axis where `cells` is absent."""

DEFAULT_MULTIPASS = 3.0
"""Value of `multipass` of a track where it is absent: between loose and medium soil."""

Pair = tuple[float, float]
CurveValue = tuple[float | Pair, ...] | str
"""Value of a curve: a vector, a list of knots (a rule refuses a mixture), or a string.

A long vector is a `terratool.definition.vectors.Vector`.
"""
GridRows = tuple[tuple[float | None, ...], ...]
"""Heights of a grid: rows from north to south, each from west to east; None is void."""
SoilFigure = float | Pair
"""Figure of a soil: a number, or a range [low, high] in which every value is equally likely."""
SOIL_FIGURES = ("cohesion", "fric_angle", "sinkage", "shear_modulus", "rolling_resistance")
"""Attributes of a surface that may be ranges."""


# ranges of the numbers of elements, tested while decoding: a later test takes far longer
_Place = Annotated[int, Meta(ge=0, le=MAX_CELLS - 1)]
_Count = Annotated[int, Meta(ge=1, le=MAX_CELLS)]
_Number = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
_Length = Annotated[float, Meta(ge=SMALLEST, le=LARGEST)]


Number = TypeVar("Number", int, float)


def names_of(kind: type) -> Iterator[tuple[str, str]]:
    """Pairs of each attribute of a class of the model and its key in the text."""
    yield from zip(kind.__struct_fields__, kind.__struct_encode_fields__, strict=True)  # type: ignore[attr-defined]


def pair_of(
    value: Number | tuple[Number, Number] | UnsetType, default: Number
) -> tuple[Number, Number]:
    """Values for both axes, from one for both or one for each."""
    if value is UNSET:
        return default, default
    return value if isinstance(value, tuple) else (value, value)


def middle_of(figure: SoilFigure) -> float:
    """Number that counts for a figure of a soil: the middle of a range."""
    if not isinstance(figure, tuple):
        return figure
    low, high = figure
    return 0.5 * low + 0.5 * high


def ends_of(figure: SoilFigure) -> Pair:
    """Least and largest value of a figure of a soil."""
    return figure if isinstance(figure, tuple) else (figure, figure)


class Roughness(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Relief of a surface, finer than any element; `terratool.field.relief` computes it."""

    rms: float | UnsetType = UNSET
    correlation: float | UnsetType = UNSET
    seed: int | UnsetType = UNSET


class Surface(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Surface (the micro-terrain): soil, friction, colour, sonar and relief."""

    descr: str | UnsetType = UNSET
    preset: str | UnsetType = UNSET
    cohesion: SoilFigure | UnsetType = UNSET
    fric_angle: SoilFigure | UnsetType = UNSET
    sinkage: SoilFigure | UnsetType = UNSET
    color: tuple[int, int, int] | UnsetType = UNSET
    sonar_refl: float | UnsetType = UNSET
    shear_modulus: SoilFigure | UnsetType = UNSET
    rolling_resistance: SoilFigure | UnsetType = UNSET
    unit_weight: float | UnsetType = UNSET
    void: bool | UnsetType = UNSET
    roughness: Roughness | UnsetType = UNSET

    @property
    def ranges(self) -> dict[str, Pair]:
        """Figures that are ranges of several values, by attribute; empty for a void surface."""
        if self.void is True:
            return {}
        figures = ((name, getattr(self, name)) for name in SOIL_FIGURES)
        return {
            name: figure
            for name, figure in figures
            if isinstance(figure, tuple) and figure[0] < figure[1]
        }


_SoilKey = Annotated[str, one_of(key for name, key in names_of(Surface) if name in SOIL_FIGURES)]


class Range(Struct, frozen=True):
    """Figure of a surface that is a range of several values.

    Attributes:
        surface: name of the surface.
        key: key of the figure, in whose unit the values are.
        low: least value.
        high: largest value.
    """

    surface: str
    key: _SoilKey
    low: float
    high: float


def ranges_of(surfaces: Mapping[str, Surface]) -> tuple[Range, ...]:
    """Figures of surfaces that are ranges of several values."""
    keys = dict(names_of(Surface))
    return tuple(
        Range(name, keys[attribute], low, high)
        for name, surface in surfaces.items()
        for attribute, (low, high) in surface.ranges.items()
    )


class GridFile(Struct, frozen=True, forbid_unknown_fields=True, rename="camel"):
    """Raster beside the text that holds the heights of a grid, row 0 in the north."""

    file: str
    band: int | UnsetType = UNSET

    @property
    def band_number(self) -> int:
        """Number of the band, from 1."""
        return 1 if self.band is UNSET else self.band


class Primitive(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Primitive: two cross-section curves and the way in which they combine, or a grid."""

    descr: str | UnsetType = UNSET
    x: CurveValue | UnsetType = UNSET
    y: CurveValue | UnsetType = UNSET
    combine: str | UnsetType = UNSET
    registration: str | UnsetType = UNSET
    grid: GridRows | GridFile | UnsetType = UNSET

    @property
    def registered(self) -> str:
        """Registration of the grid: by lines for rows in the text, by pixels for a file."""
        if self.registration is UNSET:
            return REGISTRATIONS[isinstance(self.grid, GridFile)]
        return self.registration


class Repeat(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", gc=False):
    """Copies of an element in rows: the copy at (i, j) is moved by i and j steps.

    A step is in whole cells for an element in a cell, in units of the terrain at a free place.
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


class SurfaceGrid(GridFile, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Raster beside the text that holds classes, and the names of surfaces that they stand for."""

    names: dict[str, str]

    def __hash__(self) -> int:
        return hash((self.file, self.band, frozenset(self.names.items())))


class Storey(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Other face of an element that stands over other ground or is cut through it.

    The face lies at a distance from the element's own surface, or has a primitive of its own.
    """

    v_scale: float | UnsetType = UNSET
    v_offset: float | UnsetType = UNSET
    datum: bool | UnsetType = UNSET

    @property
    def gap(self) -> float | UnsetType:
        """Distance of the face from the element's own surface; `UNSET` where a primitive gives it.

        It counts downwards for a deck and upwards for a bore.
        """
        gap: float | UnsetType = getattr(self, GAPS[type(self)])
        return gap

    @property
    def face(self) -> str | UnsetType:
        """Name of the primitive of the face; `UNSET` where a distance gives it."""
        face: str | UnsetType = getattr(self, FACES[type(self)])
        return face

    def times(self, factor: float) -> Storey:
        """Return the storey with all its heights multiplied by a factor."""
        if factor == 1.0:
            return self
        scale = 1.0 if self.v_scale is UNSET else self.v_scale
        heights: dict[str, Any] = {}
        if self.gap is not UNSET:
            heights[GAPS[type(self)]] = factor * self.gap
        if self.face is not UNSET:
            heights["v_scale"] = factor * scale
        if self.v_offset is not UNSET:
            heights["v_offset"] = factor * self.v_offset
        return structs.replace(self, **heights)


class Deck(Storey, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Storey that stands over other ground, with its underside."""

    thickness: float | UnsetType = UNSET
    under: str | UnsetType = UNSET


class Bore(Storey, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Storey that is cut through other ground, with its ceiling."""

    height: float | UnsetType = UNSET
    roof: str | UnsetType = UNSET


GAPS: dict[type[Storey], str] = {Deck: "thickness", Bore: "height"}
"""Key, and attribute, of the distance between the two faces of each kind of storey."""
FACES: dict[type[Storey], str] = {Deck: "under", Bore: "roof"}
"""Key, and attribute, of the primitive of the other face of each kind of storey."""
STOREYS: dict[str, type[Storey]] = {"deck": Deck, "bore": Bore}
"""Class of each kind of storey by its key, and attribute, of an element."""
FACE_KEYS = {"vScale": "v_scale", "vOffset": "v_offset"}
"""Attributes of the numbers of the primitive of the other face, by key."""


class Element(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", gc=False):
    """Primitive or part placed in a cell, with the grid that divides the cell for its children.

    The cell is one of the parent's grid, or is given by its middle and sides (a free place).
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
    surface_grid: SurfaceGrid | UnsetType = UNSET
    deck: Deck | UnsetType = UNSET
    bore: Bore | UnsetType = UNSET
    v_scale: _Number | UnsetType = UNSET
    v_offset: _Number | UnsetType = UNSET
    turn_deg: _Number | UnsetType = UNSET
    cells: int | tuple[int, int] | UnsetType = UNSET
    children: tuple[Element, ...] | UnsetType = UNSET


class Track(Struct, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Rut of one wheel: a polyline with a width, and the depth of the wheel's sinkage along it."""

    descr: str | UnsetType = UNSET
    path: tuple[tuple[float, ...], ...] | UnsetType = UNSET
    width: float | UnsetType = UNSET
    load: float | UnsetType = UNSET
    depth: float | dict[str, float] | UnsetType = UNSET
    passes: int | UnsetType = UNSET
    multipass: float | UnsetType = UNSET
    surface: str | UnsetType = UNSET

    @property
    def points(self) -> tuple[Pair, ...]:
        """Points (x, y) of the polyline, empty where absent."""
        return () if self.path is UNSET else tuple((point[0], point[1]) for point in self.path)

    @property
    def heights(self) -> tuple[float, ...]:
        """Height at each point, near which the ground lies that the wheel is on; NaN for none."""
        path = () if self.path is UNSET else self.path
        return tuple(point[2] if len(point) > 2 else math.nan for point in path)

    @property
    def by_load(self) -> bool:
        """Whether the depth, in part or all of it, follows from the load and the ground."""
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
    def library_paths(self) -> tuple[str, ...]:
        """Paths of the libraries that the text uses, empty where absent."""
        return () if self.use is UNSET else self.use

    @property
    def surfaces(self) -> dict[str, Surface]:
        """Surfaces by name, empty where absent."""
        return {} if self.surf_types is UNSET else self.surf_types

    @property
    def primitives(self) -> dict[str, Primitive]:
        """Primitives by name, empty where absent."""
        return {} if self.elem_types is UNSET else self.elem_types

    @property
    def assemblies(self) -> dict[str, Element]:
        """Parts by name, empty where absent."""
        return {} if self.parts is UNSET else self.parts


class Definition(Library, frozen=True, forbid_unknown_fields=True, rename="camel", kw_only=True):
    """Terrain as it is written."""

    size: float | Pair | UnsetType = UNSET
    origin: Pair | UnsetType = UNSET
    crs: str | int | dict[str, object] | UnsetType = UNSET
    elem_tree: Element | UnsetType = UNSET
    tracks: tuple[Track, ...] | UnsetType = UNSET

    @property
    def extent(self) -> Pair:
        """Side lengths along x and y; NaN where the size is absent."""
        return pair_of(self.size, math.nan)  # a rule reports a terrain without a size

    @property
    def corner(self) -> Pair:
        """World position of the south-west corner."""
        return (0.0, 0.0) if self.origin is UNSET else self.origin

    @property
    def ruts(self) -> tuple[Track, ...]:
        """Tracks of the terrain, empty where absent."""
        return () if self.tracks is UNSET else self.tracks


# --- keys -----------------------------------------------------------------------------------------

_DESCR = TEXT.describe(
    "What the terrain is, in a line.",
    "Test yard with a kerb",
    default="",
)
_USE = Key("a list of paths of libraries", "paths").describe(
    "Libraries, by paths relative to this file with forward slashes; their names are known here.",
    ["kit/racks.json"],
    default=[],
)
_SURFACES = Key("a dictionary of surfaces, an object", "object").describe(
    "Surfaces (the micro-terrain) by name.",
    {"sand": {"cohesion": 1.04, "fricAngle": 28}},
    default={},
)
_PRIMITIVES = Key("a dictionary of primitives, an object", "object").describe(
    "Primitives by name.", {"box": {"x": [1]}}
)
_PARTS = Key("a dictionary of parts, an object", "object").describe(
    "Dictionary of parts: elements with all that stands on them, for elements to stand for.",
    {"crate": {"type": "box", "vScale": 0.4}},
    default={},
)
_NUMBER = Key("a number up to 1e30 in size", "number", -LARGEST, LARGEST)
_CURVE = Key(
    "a curve: numbers up to 1e30 in size, [t, z] knots, a name or an expression",
    "curve",
    -LARGEST,
    LARGEST,
)
_CURVES = (
    "A cross-section curve over t from 0 to 1: numbers at evenly spaced t; [] to copy "
    "the other curve; [t, z] knots, two at one t for a vertical step; a named curve "
    "(flat ramp tent cos cosbell dome gauss smoothstep); or an expression in t."
)


def _figure(
    what: str,
    low: float,
    high: float = math.inf,
    *,
    open_low: bool = False,
    open_high: bool = False,
) -> Key:
    """Key for a figure of a soil: a number, or a range of numbers."""
    return ranged(Key(what, "number", low, high, open_low, open_high))


def _thick(what: str) -> Key:
    """Key for the distance of the other face of a storey from its own surface."""
    words = f"the distance of {what}, above 0, from 1e-30 to 1e30"
    return Key(words, "number", SMALLEST, LARGEST)


_SHAPE = Key("the name of a primitive, a text", "text")
_DATUM = FLAG.describe(
    "Heights count from 0, not from the elements whose cells it is in.", True, default=False
)
_EVEN = "; or a range [low, high] in which every value is equally likely."


TERRAIN_KEYS: dict[Shape, dict[str, Key]] = {
    Definition: {
        "$schema": SCHEMA.describe(
            "Address of this schema, for editors.", "../schemas/terrain.schema.json", default="",
        ),
        "descr": _DESCR,
        "use": _USE,
        "size": Key(
            "a side length above 0, from 1e-30 to 1e30, or a pair [x, y] of them", "number",
            SMALLEST, LARGEST, length=2,
        ).describe(
            "Side length in units of the terrain (metres unless said otherwise), or [x, y].",
            [120, 80],
        ),
        "origin": Key(
            "the position [x, y] of the south-west corner, two numbers up to 1e30 in size",
            "number", -LARGEST, LARGEST, alone=False, length=2,
        ).describe(
            "World position [x, y] of the south-west corner.", [500000, 4649776], default=[0, 0],
        ),
        "crs": Key('a coordinate reference system such as "EPSG:32633"', "any").describe(
            "Coordinate reference system: an authority and code, WKT, an EPSG number or PROJ "
            "parameters.", "EPSG:32633",
        ),
        "surfTypes": _SURFACES,
        "elemTypes": _PRIMITIVES,
        "parts": _PARTS,
        "elemTree": Key("the root element, an object", "object").describe(
            "The root element, which covers the whole terrain.",
            {"type": "slope", "surface": "sand"},
        ),
        "tracks": Key("a list of tracks", "list").describe(
            "Ruts that wheels have left, each a polyline with a width and a depth.",
            [{"path": [[2, 3], [30, 3.5]], "width": 0.2, "load": 0.25}], default=[],
        ),
    },
    Library: {
        "$schema": SCHEMA.describe(
            "Address of this schema, for editors.", "../../schemas/library.schema.json", default="",
        ),
        "descr": _DESCR,
        "use": _USE,
        "surfTypes": _SURFACES,
        "elemTypes": _PRIMITIVES,
        "parts": _PARTS,
    },
    Surface: {
        "descr": TEXT.describe("What the surface is.", "Quartz sand", default=""),
        "preset": Key("the name of a soil, a text", "text").describe(
            "A soil by name, for what the surface does not say itself: cohesion, friction angle "
            "and shear modulus; its sinkage depends on the wheel and its load.", "dry-sand",
        ),
        "cohesion": _figure("a cohesion in kPa, 0 or more", 0).describe(
            "Cohesion c of the soil, kPa" + _EVEN, 1.04, [0.8, 1.3],
        ),
        "fricAngle": _figure(
            "a friction angle in degrees, from 0 to below 90", 0, 90, open_high=True,
        ).describe(
            "Angle of internal friction, degrees" + _EVEN, 28, [26, 30],
        ),
        "sinkage": _figure("metres of sinkage per kN of wheel load, 0 or more", 0).describe(
            "Metres of sinkage per kN of wheel load (z = k W); 0 is rigid" + _EVEN, 0.18,
            [0.1, 0.25],
        ),
        "color": Key(
            "three whole numbers [red, green, blue] from 0 to 255", "whole", 0, 255, alone=False,
            length=3,
        ).describe(
            "Colour [red, green, blue], 0 to 255.", [194, 178, 128],
        ),
        "sonarRefl": Key("a reflection from 0 to 1", "number", 0, 1).describe(
            "Reflection of sonar, 0 to 1.", 0.24,
        ),
        "shearModulus": _figure("a shear modulus in metres, above 0", 0, open_low=True).describe(
            "Shear deformation modulus K (Janosi-Hanamoto), metres" + _EVEN, 0.025, [0.01, 0.025],
        ),
        "rollingResistance": _figure(
            "a coefficient, from 0 to below 1", 0, 1, open_high=True,
        ).describe(
            "Force over load with which this ground resists rolling, beside what sinking in takes"
            + _EVEN, 0.013, [0.01, 0.02], default=0,
        ),
        "unitWeight": Key(
            "a weight in kN/m³, above 0 and up to 1000", "number", 0, 1000, open_low=True,
        ).describe(
            "Weight γ of a volume of the soil under the gravity there, kN/m³; for what feet may "
            "load it with.", 15, default=15,
        ),
        "void": FLAG.describe(
            "There is no ground here: no height, a gap in meshes, nothing drives.", True,
            default=False,
        ),
        "roughness": Key('a relief, an object { "rms": …, "correlation": … }', "object").describe(
            "Relief finer than elements, computed from the position alone and added to the "
            "height where this is the surface.", {"rms": 0.01, "correlation": 0.1, "seed": 7},
        ),
    },
    Roughness: {
        "rms": Key(
            "the standard deviation of the relief in units of the terrain, from 0 to 1e30",
            "number", 0, LARGEST,
        ).describe(
            "Standard deviation of the relief, in units of the terrain.", 0.01,
        ),
        "correlation": Key(
            "a correlation length above 0 in units of the terrain, from 1e-30 to 1e30", "number",
            SMALLEST, LARGEST,
        ).describe(
            "Correlation length, in units of the terrain: the distance at which the "
            "autocorrelation has fallen to 1/e.", 0.1,
        ),
        "seed": Key(f"a whole number from 0 to {MAX_SEED}", "whole", 0, MAX_SEED).describe(
            "Which of all such reliefs it is; equal seeds and lengths give equal shapes.", 7,
            default=0,
        ),
    },
    Primitive: {
        "descr": TEXT.describe("What the primitive is.", "Round hill", default=""),
        "x": _CURVE.describe(_CURVES, "cos"),
        "y": _CURVE.describe(_CURVES, []),
        "combine": choice("way to combine two curves", COMBINES).describe(
            "How the curves combine: product x(u)*y(v), sum, min, max, or radial: x turned about "
            "the middle of the cell.", "radial", default="product",
        ),
        "registration": choice("registration of a grid", REGISTRATIONS).describe(
            "Where the numbers of the grid stand: the outer ones on the edges (gridline), or each "
            "in the middle of a pixel (pixel). Left out: gridline for rows, pixel for a file.",
            "pixel",
        ),
        "grid": Key(
            "a list of rows of numbers up to 1e30 in size and null, all equally long, or an object "
            '{ "file": "dem.tif", "band": 1 }', "grid", -LARGEST, LARGEST,
        ).describe(
            "Heights over the unit square, bilinear in between, in place of x, y and combine: rows "
            "from north to south, each from west to east, null is void; or a raster beside this "
            "file.",
            [[0, 1, 0], [1, 3, 1], [0, None, 0]], {"file": "dem.tif"},
        ),
    },
    GridFile: {
        "file": Key("the path of a raster, a text", "text").describe(
            "Raster of heights, by a path relative to this file with forward slashes; its place "
            "and its reference system are not used.", "dem.tif",
        ),
        "band": whole(1, MAX_BANDS).describe("Band that holds the heights.", 2, default=1),
    },
    SurfaceGrid: {
        "file": Key("the path of a raster, a text", "text").describe(
            "Raster of classes, by a path relative to this file with forward slashes; its place "
            "and its reference system are not used.", "classes.tif",
        ),
        "band": whole(1, MAX_BANDS).describe("Band that holds the classes.", 2, default=1),
        "names": Key('names of surfaces by classes, as { "1": "sand" }', "names").describe(
            "Names of surfaces in surfTypes by the classes that stand for them, whole numbers in "
            "quotes; other classes leave the surface of the element.", {"1": "sand", "2": "rock"},
        ),
    },
    Element: {
        "cellX": Key(
            "a column of the parent's grid, a whole number from 0", "whole", 0, MAX_CELLS - 1,
        ).describe(
            "Column of the parent's grid, from 0 in the west.", 1,
        ),
        "cellY": Key(
            "a row of the parent's grid, a whole number from 0", "whole", 0, MAX_CELLS - 1,
        ).describe(
            "Row of the parent's grid, from 0 in the south.", 4,
        ),
        "span": Key(
            f"two whole numbers [w, h] of cells from 1 to {MAX_CELLS}", "whole", 1, MAX_CELLS,
            alone=False, length=2,
        ).describe(
            "Cells [w, h] that it occupies, from its cell to the east and north.", [3, 2],
            default=[1, 1],
        ),
        "at": Key(
            "the place [x, y] of the middle in the parent's cell, two numbers up to 1e30 in size",
            "number", -LARGEST, LARGEST, alone=False, length=2,
        ).describe(
            "Middle of its cell, [x, y] in units of the terrain from the south-west corner of "
            "the parent's cell; in place of cellX, cellY and span.", [12.3, 4.5],
        ),
        "extent": Key(
            "a side length above 0, from 1e-30 to 1e30, or a pair [w, h] of them", "number",
            SMALLEST, LARGEST, length=2,
        ).describe(
            "Sides of its cell [w, h] in units of the terrain, or one number for both; goes with "
            "at.", [2.5, 0.8],
        ),
        "repeat": Key(
            'an object { "count": [nx, ny], "step": [dx, dy] }, counts from 1 to ' f"{MAX_CELLS}",
            "members",
        ).describe(
            "Copies of the element in rows, each moved by whole cells, or by units of the "
            "terrain where it has at.", {"count": [5, 1], "step": [2, 0]},
        ),
        "scatter": Key('an object { "count": n, "sizes": [least, most], … }', "members").describe(
            "Copies strewn over the cell of the element, each a square with a place and a size "
            "of its own.", {"count": 200, "sizes": [0.2, 1.5], "seed": 7},
        ),
        "descr": TEXT.describe("What the element is.", "Loading dock", default=""),
        "type": Key("the name of a primitive, a text", "text").describe(
            "Name of a primitive in elemTypes.", "box",
        ),
        "part": Key("the name of a part, a text", "text").describe(
            "Name of a part, whose tree stands in this element's cell; in place of type.", "rack",
        ),
        "surface": Key("the name of a surface, a text", "text").describe(
            "Name of a surface in surfTypes; left out: that of the element whose cell it is in, "
            "or of the part's root.", "sand",
        ),
        "surfaceGrid": Key(
            'an object { "file": "classes.tif", "names": { "1": "sand" } }', "members"
        ).describe(
            "Raster of classes over the element's footprint, in place of its surface where it has "
            "a class that names knows.",
            {"file": "classes.tif", "names": {"1": "sand", "2": "rock"}},
        ),
        "deck": Key('an object such as { "thickness": 0.3 }', "members").describe(
            "The element and all in its cell stand over other ground, with an underside: a bridge, "
            "a shelf, a roof. Heights count from the elements whose cells it is in.",
            {"thickness": 0.3, "datum": True},
        ),
        "bore": Key('an object such as { "height": 3 }', "members").describe(
            "The element and all in its cell are cut through other ground, with a ceiling: a "
            "tunnel, a culvert, a cave. Heights count from the elements whose cells it is in.",
            {"height": 3, "datum": True},
        ),
        "vScale": _NUMBER.describe(
            "Factor on the curves, may be negative; left out: side of its cell / side of the "
            "terrain, the smaller of the two directions. Of a part: factor on all its heights, "
            "left out 1.", -0.5,
        ),
        "vOffset": _NUMBER.describe(
            "Added to the height; of a part to that of its root.", 2, default=0,
        ),
        "turnDeg": Key(
            "an angle in degrees, a number up to 1e30 in size", "number", -LARGEST, LARGEST,
        ).describe(
            "Turn about the vertical axis through the middle of the cell, degrees, clockwise "
            "seen from above. A part turns whole, by multiples of 90; so does an element that "
            "has at, by any angle.", 40, default=0,
        ),
        "cells": Key(
            f"a whole number from 1 to {MAX_CELLS}, or a pair of them", "whole", 1, MAX_CELLS,
            length=2,
        ).describe(
            "The grid that divides this element's cell for its children: n, or [nx, ny].", [4, 2],
            default=DEFAULT_CELLS,
        ),
        "children": Key("a list of elements", "list").describe(
            "Elements placed in that grid; several may share a cell.",
            [{"type": "box", "cellX": 1, "cellY": 4}], default=[],
        ),
    },
    Deck: {
        "thickness": _thick("the underside").describe(
            "How far the underside lies below the deck's own top; children do not move it. In "
            "place of under.", 0.3,
        ),
        "under": _SHAPE.describe(
            "Name of a primitive in elemTypes: the shape of the underside over the deck's "
            "footprint, in place of thickness.", "arch",
        ),
        "vScale": _NUMBER.describe("Factor on the curves of under.", 2.5, default=1),
        "vOffset": _NUMBER.describe("Added to the height of under.", 1, default=0),
        "datum": _DATUM,
    },
    Bore: {
        "height": _thick("the ceiling").describe(
            "How far the ceiling lies above the bore's own floor; children do not move it. In "
            "place of roof.", 3,
        ),
        "roof": _SHAPE.describe(
            "Name of a primitive in elemTypes: the shape of the ceiling over the bore's footprint, "
            "in place of height.", "vault",
        ),
        "vScale": _NUMBER.describe("Factor on the curves of roof.", 4, default=1),
        "vOffset": _NUMBER.describe("Added to the height of roof.", 1, default=0),
        "datum": _DATUM,
    },
    Repeat: {
        "count": Key(
            f"two whole numbers [nx, ny] of copies from 1 to {MAX_CELLS}", "whole", 1, MAX_CELLS,
            alone=False, length=2,
        ).describe(
            "How many copies [nx, ny], the element itself among them.", [5, 1],
        ),
        "step": Key(
            "two steps [dx, dy], numbers up to 1e30 in size", "number", -LARGEST, LARGEST,
            alone=False, length=2,
        ).describe(
            "How far [dx, dy] the next copy is.", [2, 0],
        ),
    },
    Scatter: {
        "count": Key(
            f"a whole number of copies from 1 to {MAX_SCATTERED:,}", "whole", 1, MAX_SCATTERED,
        ).describe(
            "How many copies; in place of density.", 200,
        ),
        "density": Key(
            "copies in a square unit, above 0 and up to 1e30", "number", SMALLEST, LARGEST,
        ).describe(
            "Copies in a square unit of the terrain, where the element has at and extent.", 0.5,
        ),
        "sizes": Key(
            "the least and the largest side [least, most], from 1e-30 to 1e30", "number",
            SMALLEST, LARGEST, alone=False, length=2,
        ).describe(
            "Least and largest side [least, most]; heights grow with the side.", [0.2, 1.5],
        ),
        "distance": Key("a distance from 0 to 1e30", "number", 0, LARGEST).describe(
            "What is left between the circles around two copies at least; left out, copies may "
            "overlap.", 0.1,
        ),
        "turned": FLAG.describe(
            "Turn each copy by an angle of its own, a part by a quarter.", True, default=False,
        ),
        "seed": Key(f"a whole number from 0 to {MAX_SEED}", "whole", 0, MAX_SEED).describe(
            "Other numbers give other places.", 7, default=0,
        ),
    },
    Track: {
        "descr": TEXT.describe("What the track is.", "Front left wheel", default=""),
        "path": Key(
            "a list of two points [x, y] or [x, y, z] or more, numbers up to 1e30 in size", "path",
            -LARGEST, LARGEST,
        ).describe(
            "The points of the polyline, two or more, in world coordinates: all [x, y] for a wheel "
            "on the ground, or all [x, y, z] for one on the floors nearest to these heights.",
            [[2, 3], [30, 3.5]], [[2, 3, 6], [30, 3.5, 6.2]],
        ),
        "width": Key("a width above 0, from 1e-30 to 1e30", "number", SMALLEST, LARGEST).describe(
            "Width of the rut.", 0.2,
        ),
        "load": Key("the load of the wheel in kN, from 0 to 1e30", "number", 0, LARGEST).describe(
            "Load of the wheel, kN; the first pass sinks by the sinkage of the ground's surface "
            "times the load.", 0.25,
        ),
        "depth": Key(
            "a depth from 0 to 1e30, or depths by the names of surfaces", "depth", 0, LARGEST,
        ).describe(
            "Depth of the first pass, in place of that by the load: one number, or by the names "
            "of surfaces of the ground.", 0.05, {"sand": 0.05, "rock": 0},
        ),
        "passes": Key(f"a whole number from 1 to {MAX_PASSES}", "whole", 1, MAX_PASSES).describe(
            "How many times the wheel has passed.", 3, default=1,
        ),
        "multipass": Key("an exponent of 1 or more, up to 1e30", "number", 1, LARGEST).describe(
            "a in z1 n^(1/a), the depth after n passes: 2 to 3 in loose, 3 to 4 in medium, 4 to "
            "5 in dense soil.", 2.5, default=DEFAULT_MULTIPASS,
        ),
        "surface": Key("the name of a surface, a text", "text").describe(
            "Name of the surface in the rut, in surfTypes and not void; left out: that of the "
            "ground.", "packed",
        ),
    },
}  # fmt: skip
