"""The terrain that all other packages query: a compiled field and the names of its parts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from copy import copy
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from msgspec import UNSET
from numpy.typing import ArrayLike, NDArray

from terratool.definition.crs import refuse_degrees
from terratool.definition.expand import (
    Expansion,
    expand,
    with_names,
    with_names_in_use,
)
from terratool.definition.findings import Bounds
from terratool.definition.model import Definition
from terratool.definition.reader import Checked, load_checked, refusal, uses_of
from terratool.definition.sharing import blueprint
from terratool.definition.uses import MAX_ELEMENTS, Uses
from terratool.definition.written import write_out
from terratool.errors import RequestError, StoreysWarning, warn_outside
from terratool.field.compile import Compiled, compile_definition
from terratool.field.records import CurveArrays, FieldArrays, align_arrays
from terratool.field.sharing import Tally, compile_shared, refuse_piled
from terratool.field.storeys import FIRST_STOREY, ColumnGround, ColumnRows, Storeys
from terratool.field.tracks import without_tracks
from terratool.field.types import OUTSIDE, PointColumns, PointSamples, points_of
from terratool.kernels import field as kernels
from terratool.report.numbers import coordinates
from terratool.report.wording import hidden_storeys

if TYPE_CHECKING:
    import torch

    from terratool.field.addresses import CellAddress
    from terratool.field.rays import RayHits
    from terratool.field.torch_field import TorchField
    from terratool.field.warp_field import WarpField

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CHUNK = 1 << 21
"""Points of a batch that are sorted at a time."""
SHARE_ABOVE = 65_536
"""Number of elements above which parts and copies are shared rather than written out."""
FARTHEST = 1 << 62
"""Element numbers from here on are kept in a table, as they fit in no index."""
SMALL_FIELD = 1 << 20
"""Size in bytes below which a field stays in the cache, so that its points are not sorted."""
_SMALL_BATCH = 1 << 13
"""Number of points below which a batch is not sorted."""


def check_bounds(bounds: Bounds, terrain: Terrain) -> None:
    """Refuse a rectangle that does not overlap a terrain.

    Raises:
        RequestError: the rectangle is empty, or misses the terrain.
    """
    check_overlap(bounds, terrain.bounds, "the terrain")


def check_overlap(bounds: Bounds, extent: Bounds, name: str) -> None:
    """Refuse a rectangle that does not overlap an extent.

    Args:
        bounds: west, south, east, north of the rectangle.
        extent: west, south, east, north that it has to overlap.
        name: name of the extent in messages.

    Raises:
        RequestError: the rectangle is empty, or misses the extent.
    """
    refuse_empty(bounds)
    west, south, east, north = bounds
    if west >= extent[2] or east <= extent[0] or south >= extent[3] or north <= extent[1]:
        raise RequestError(
            f"The bounds {coordinates(bounds)} miss {name}.",
            f"Give bounds that overlap {coordinates(extent)}, where {name} lies.",
        )


def refuse_empty(bounds: Bounds) -> None:
    """Refuse an empty rectangle.

    Raises:
        RequestError: the rectangle is empty, or has a side that is no finite number.
    """
    west, south, east, north = bounds
    said = coordinates(bounds)
    if not all(map(math.isfinite, bounds)):
        raise RequestError(
            f"The bounds are {said}.", "Give four finite numbers: west, south, east, north."
        )
    if west >= east or south >= north:
        raise RequestError(
            f"The bounds {said} are empty.",
            "Give west south east north, west below east and south below north.",
        )


def clip_bounds(terrain: Terrain, bounds: Bounds | None) -> Bounds:
    """Return the part of a terrain within bounds; the whole terrain if None."""
    west, south, east, north = terrain.bounds
    if bounds is None:
        return west, south, east, north
    return max(west, bounds[0]), max(south, bounds[1]), min(east, bounds[2]), min(north, bounds[3])


def batch_heights(
    arrays: FieldArrays, field: kernels.Field, x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Heights at points; `x`, `y` and the result are (n,) float64."""
    out = np.empty(len(x))
    if arrays.busy_nbytes < SMALL_FIELD or len(x) < _SMALL_BATCH:
        kernels.heights(field, x, y, out)
        return out
    size = min(CHUNK, len(x))
    order = np.empty(size, np.int64)
    sorted_x, sorted_y, heights = np.empty(size), np.empty(size), np.empty(size)
    for begin in range(0, len(x), size):
        part = slice(begin, begin + size)
        count = len(x[part])
        by_place = order[:count], sorted_x[:count], sorted_y[:count]
        kernels.sort_by_place(x[part], y[part], arrays.bounds, *by_place)
        kernels.heights(field, *by_place[1:], heights[:count])
        out[part][by_place[0]] = heights[:count]
    return out


def _derived(kind: type) -> set[str]:
    """Names of attributes of a class that follow from the others, and are kept when known."""
    return {
        name
        for base in kind.__mro__
        for name, member in vars(base).items()
        if isinstance(member, cached_property)
    }


class Terrain:
    """A compiled terrain.

    All queries take x and y in world units, as numbers or arrays that broadcast together, and
    return the broadcast shape. Outside of the terrain the height is NaN and everything else None.
    """

    def __init__(
        self,
        definition: Definition | Checked,
        *,
        roughness: bool = True,
        share_above: float = SHARE_ABOVE,
    ) -> None:
        """Compile a valid definition, or one that was checked.

        Args:
            definition: a valid definition, or the result of a check.
            roughness: whether rough surfaces have their relief.
            share_above: number of elements above which parts and copies are shared rather than
                written out; it changes no result.

        Raises:
            DefinitionError: the checked definition has errors.
            RequestError: the definition comes to too many elements.
        """
        uses = definition.uses if isinstance(definition, Checked) else uses_of(definition)
        if uses is None:
            assert isinstance(definition, Checked)
            raise refusal(definition)
        self._compiled: Compiled
        self._tally: Tally | None = None
        self._source: Definition | Checked | None = None
        self._roughness = roughness
        self._far: dict[int, int] = {}
        storeys, worn, shapes = None, set[Any](), set[Any]()
        if uses.has_storeys:
            written = write_out(uses, with_names(uses), "storeys")
            if written.storeys():  # copies may find no place
                storeys, worn, shapes = written, written.worn, written.shapes
        if uses.is_composed and uses.elements > share_above:
            self._source = definition
            plan = blueprint(uses, worn, shapes)
            if isinstance(definition, Checked):
                plan = plan._replace(definition=definition.with_tracks(plan.definition))
            definition = plan.definition
            self._compiled, self._tally = compile_shared(plan, roughness=roughness)
            refuse_piled(self.field, uses.document.source.name)
        elif storeys is not None:
            elements = write_out(uses, with_names(uses), "ground")
            names = worn | elements.worn, shapes | elements.shapes
            named = with_names_in_use(with_names(uses), *names, uses)
            definition = definition.with_tracks(named) if isinstance(definition, Checked) else named
            self._compiled = compile_definition(definition, elements, roughness=roughness)
        else:
            expansion = _written_out(definition, uses)
            definition = expansion.definition
            self._compiled = compile_definition(definition, expansion.elements, roughness=roughness)
        self.storeys: Storeys | None = None
        """Decks and bores; None where there are none."""
        self.hidden: tuple[str, ...] = ()
        """Sentence on the storeys that the terrain does not show; none for a whole terrain."""
        self.descr = "" if definition.descr is UNSET else definition.descr
        self.crs: str | int | dict[str, object] | None = (
            None if definition.crs is UNSET else definition.crs
        )
        """Coordinate reference system as it is written, or None."""
        self.size = definition.extent
        """Side lengths along x and y, world units."""
        self.primitives = tuple(definition.primitives)
        """Names of the primitives."""
        self.surface_types = dict(definition.surfaces)
        """Surfaces by name."""
        self.libraries = tuple(one.source.name for one in uses.document.all_libraries)
        """Files of the libraries that the terrain uses, directly or through others, in order."""
        if storeys is not None:
            self.storeys = Storeys(storeys, definition, self._plain)

    def _plain(self, compiled: Compiled, definition: Definition) -> Terrain:
        """Terrain of other elements in place of these, without parts that are shared."""
        other = Terrain.__new__(Terrain)
        vars(other).update(self._own)
        other._compiled, other._tally, other._source, other.storeys = compiled, None, None, None
        other.primitives = tuple(definition.primitives)
        other.surface_types = dict(definition.surfaces)
        return other

    @property
    def compiled(self) -> Compiled:
        """The compiled ground."""
        return self._compiled

    @cached_property
    def ground_alone(self) -> Self:
        """The terrain without its storeys, and what is in them."""
        if self.storeys is None:
            return self
        other = copy(self)
        other.storeys = None
        other.hidden = (hidden_storeys(self.storeys.decks, self.storeys.bores),)
        vars(other)["field"] = self.field
        return other

    def ground_only(self) -> Self:
        """`ground_alone`, for what knows no storeys yet; a warning says what it leaves out."""
        for sentence in self.ground_alone.hidden if self.storeys is not None else ():
            warn_outside(sentence, StoreysWarning)
        return self.ground_alone

    @cached_property
    def bare(self) -> Terrain:
        """The ground without ruts and reliefs."""
        if not self.tracks and not self.is_rough:
            return self.ground_alone
        arrays = without_tracks(self.arrays)
        return self.ground_alone.with_arrays(arrays._replace(reliefs=arrays.reliefs[:0]))

    @property
    def arrays(self) -> FieldArrays:
        """Flat arrays of the field."""
        return self._compiled.arrays

    @cached_property
    def field(self) -> kernels.Field:
        """Flat arrays of the field, checked and kept by the kernels."""
        return kernels.Field(self.arrays)

    @property
    def _own(self) -> dict[str, Any]:
        """Attributes but those that follow from others."""
        derived = _derived(type(self))
        return {name: value for name, value in vars(self).items() if name not in derived}

    def __getstate__(self) -> dict[str, Any]:
        return self._own

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _compiled=align_arrays(state["_compiled"]))

    def with_arrays(self, arrays: FieldArrays) -> Self:
        """Return this terrain with other arrays of the field."""
        other = copy(self)
        other._compiled = self._compiled._replace(arrays=arrays)
        return other

    def with_curves(self, curves: CurveArrays) -> Self:
        """Return this terrain with other curves, which its parts have if they are written out."""
        return self.with_arrays(self.arrays._replace(curves=curves))

    @property
    def bounds(self) -> Bounds:
        """World rectangle west, south, east, north."""
        west, south, east, north = (float(side) for side in self.arrays.bounds)
        return west, south, east, north

    @property
    def surfaces(self) -> tuple[str, ...]:
        """Names of the surfaces, in the order of their indices."""
        return self._compiled.surfaces

    @property
    def smallest_cell(self) -> float:
        """Shortest side of any element's cell, world units."""
        return self._compiled.smallest_cell

    @property
    def tracks(self) -> int:
        """Number of tracks."""
        return len(self.arrays.tracks.passes)

    @property
    def is_rough(self) -> bool:
        """Whether any surface has a relief."""
        return len(self.arrays.reliefs) > 0

    def refuse_degrees(self, doing: str) -> None:
        """Refuse a terrain whose x and y are degrees for what needs lengths, such as "A vehicle".

        Raises:
            RequestError: the reference system of the terrain is geographic.
        """
        west, south, east, north = self.bounds
        refuse_degrees(self.crs, (0.5 * (west + east), 0.5 * (south + north)), doing)

    @property
    def levels(self) -> int:
        """Levels of nesting, 1 for a root alone."""
        return self._compiled.levels

    @property
    def elements(self) -> int:
        """Number of elements of the ground, with parts and copies written out."""
        return len(self.arrays.elements) if self._tally is None else self._tally.elements

    @property
    def all_elements(self) -> int:
        """Number of elements, those of storeys included, with parts and copies written out."""
        return self.elements + (0 if self.storeys is None else self.storeys.elements)

    @property
    def is_shared(self) -> bool:
        """Whether parts are shared by the places that they stand in, rather than written out."""
        return self._tally is not None

    @cached_property
    def written_out(self) -> Terrain:
        """The terrain with all parts and copies written out, so that each element is in its arrays.

        Raises:
            RequestError: parts and copies come to too many elements.
        """
        if self._source is None:
            return self
        whole = Terrain(self._source, roughness=self._roughness, share_above=math.inf)
        return whole.ground_alone if self.hidden else whole

    @property
    def written_out_or_none(self) -> Terrain | None:
        """The terrain with all parts and copies written out; None if there are too many."""
        try:
            return self.written_out
        except RequestError:
            return None

    @property
    def nbytes(self) -> int:
        """Memory of the compiled field in bytes."""
        c = self._compiled
        return c.arrays.nbytes + c.document.nbytes + c.parents.nbytes

    def height(self, x: ArrayLike, y: ArrayLike, below: ArrayLike | None = None) -> Any:
        """Heights at points: a float for numbers, else a float64 array; NaN without ground.

        Args:
            x: world positions.
            y: world positions.
            below: heights; the highest top that is not above them is wanted, rather than the
                highest of all.
        """
        x, y, below, shape = _points_below(x, y, below)
        heights = batch_heights(self.arrays, self.field, x, y)
        if self.storeys is not None and not self.tracks and not self.is_rough:
            kernels.top_heights(self.storeys.field, x, y, below, heights)
            return heights.reshape(shape)[()]
        if below is not None:
            heights[~(heights <= below)] = np.nan
        if self.storeys is not None and (near := self.storeys.near(x, y)).any():
            rows = self._columns(x[near], y[near])
            some, place = rows.last if below is None else rows.below(below[near])
            found = np.full(len(some), np.nan)
            found[some] = rows.top[place]
            heights[near] = found
        return heights.reshape(shape)[()]

    def ground(self, x: ArrayLike, y: ArrayLike) -> Any:
        """Heights of the ground below all storeys, and of floors cut through it; else as `height`.

        It is NaN where nothing is solid from below: over a void.
        """
        x, y, shape = _points(x, y)
        heights = batch_heights(self.arrays, self.field, x, y)
        if self.storeys is not None and (near := self.storeys.near(x, y)).any():
            rows = self._columns(x[near], y[near])
            heights[near] = np.where(np.isneginf(rows.bottom[:, 0]), rows.top[:, 0], np.nan)
        return heights.reshape(shape)[()]

    def column(self, x: ArrayLike, y: ArrayLike) -> PointColumns:
        """All that is solid at points, as intervals of heights from below."""
        x, y, shape = _points(x, y)
        rows = self._columns(x, y)
        clear = np.full_like(rows.top, np.nan)
        clear[:, :-1] = rows.bottom[:, 1:] - rows.top[:, :-1]
        _, place = rows.last
        clear[place] = np.inf
        normal = _normals(rows.slope_x, rows.slope_y)

        def shaped(values: NDArray[Any]) -> NDArray[Any]:
            return values.reshape(*shape, *values.shape[1:])

        return PointColumns(
            shaped(rows.bottom),
            shaped(rows.top),
            shaped(clear),
            shaped(rows.surface),
            shaped(rows.element),
            shaped(rows.under),
            shaped(normal),
        )

    def _columns(self, x: Floats, y: Floats) -> ColumnRows:
        """Columns at points, (n,) each."""
        if self.storeys is None:
            return ColumnRows.of_ground(ColumnGround(*self._samples(x, y)))
        return self.columns_at(x, y)

    def columns_at(self, x: Floats, y: Floats, *, bare: bool = False) -> ColumnRows:
        """Columns of a terrain with storeys as rows.

        Args:
            x: (n,) world positions.
            y: (n,) world positions.
            bare: whether ruts and reliefs are left out.
        """
        assert self.storeys is not None
        ground = ColumnGround(*self.bare._samples(x, y))
        return self.storeys.columns(self.bare if bare else self, x, y, ground)

    def surface(self, x: ArrayLike, y: ArrayLike) -> Any:
        """Names of the surfaces at points, a str or an object array; None without a surface."""
        return self._surface_names[self.sample(x, y).surface]

    def element(self, x: ArrayLike, y: ArrayLike) -> Any:
        """JSON pointers of the elements that decide the surface at points; None where none does.

        Through parts and libraries a pointer is a chain: see docs/format.md, names of elements.
        """
        element = self.sample(x, y).element
        unique, index = np.unique(element.ravel(), return_inverse=True)
        pointers = np.array([self.pointer(i) for i in unique.tolist()], object)
        return pointers[index].reshape(element.shape)[()]

    def locate(self, x: ArrayLike, y: ArrayLike) -> CellAddress:
        """Cells of the nested grids that hold points, level by level: the paper's Ψ.

        See `terratool.field.addresses.addresses`. `element` gives the element that decides the
        surface.

        Raises:
            RequestError: the parts of the terrain come to too many elements.
        """
        from terratool.field.addresses import addresses

        return addresses(self.ground_only(), x, y)

    def normal(self, x: ArrayLike, y: ArrayLike, below: ArrayLike | None = None) -> Floats:
        """Upward unit normals at points, (…, 3) float64; on an edge, of its east and north side."""
        return self.sample(x, y, below).normal

    def sample(self, x: ArrayLike, y: ArrayLike, below: ArrayLike | None = None) -> PointSamples:
        """Height, element, surface and normal at points in one pass.

        Args:
            x: world positions.
            y: world positions.
            below: heights; the highest top that is not above them is wanted, rather than the
                highest of all.
        """
        x, y, below, shape = _points_below(x, y, below)
        height, element, surface, gradient = self._samples(x, y)
        if below is not None:
            above = ~(height <= below)
            height[above], gradient[above] = np.nan, np.nan
            element[above & (element != OUTSIDE)], surface[above] = -1, -1
        if self.storeys is not None and (near := self.storeys.near(x, y)).any():
            rows = self._columns(x[near], y[near])
            some, place = rows.last if below is None else rows.below(below[near])
            at = np.flatnonzero(near)
            height[at], gradient[at] = np.nan, np.nan
            void = ~some & (element[at] != OUTSIDE)
            if below is not None:
                element[at[void]], surface[at[void]] = -1, -1
            at = at[some]
            height[at], element[at] = rows.top[place], rows.element[place]
            surface[at] = rows.surface[place]
            gradient[at] = np.column_stack([rows.slope_x[place], rows.slope_y[place]])
        return PointSamples(
            height.reshape(shape),
            element.reshape(shape),
            surface.reshape(shape),
            _normals(gradient[:, 0], gradient[:, 1]).reshape(*shape, 3),
        )

    def _samples(self, x: Floats, y: Floats) -> tuple[Floats, Ints, NDArray[np.int32], Floats]:
        """Height, element, surface and gradient of the ground at points, (n,) and (n, 2)."""
        height = np.empty(len(x))
        element, surface = np.empty(len(x), np.int64), np.empty(len(x), np.int32)
        gradient = np.empty((len(x), 2))
        if self._tally is None:
            kernels.samples(self.field, x, y, height, element, surface, gradient)
        else:
            number = np.empty((len(x), 2), np.uint64)
            kernels.shared_samples(self.field, x, y, height, element, surface, number, gradient)
            element = self._numbered(element, number)
        return height, element, surface, gradient

    @cached_property
    def ray_index(self) -> kernels.RayIndex:
        """Index for rays, of the terrain with its parts written out."""
        from terratool.field.rays import ray_index

        return ray_index(self)

    @cached_property
    def storey_ray_index(self) -> kernels.StoreyRayIndex:
        """Index for rays, of a terrain that has storeys."""
        from terratool.field.rays import storey_ray_index

        return storey_ray_index(self)

    @cached_property
    def _document_order(self) -> NDArray[np.int64]:
        """Number in the document of each element of `written_out`, (n,) int64."""
        from terratool.field.rays import document_order

        compiled = self.written_out._compiled
        return document_order(compiled.parents, compiled.document)

    def numbers_of(self, elements: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers in this terrain of elements and tracks of `written_out`, if parts are shared."""
        count = len(self._document_order)
        tracks = elements - count + self.first_track
        own = self._document_order[np.clip(elements, 0, count - 1)]
        same = (elements < 0) | (elements >= FIRST_STOREY)
        return np.where(same, elements, np.where(elements < count, own, tracks))

    def short_numbers(self, elements: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers that fit files, which `pointer` takes, too: storeys' follow those of tracks."""
        is_storey = elements >= FIRST_STOREY
        return np.where(is_storey, elements - FIRST_STOREY + self._first_short, elements)

    @property
    def _first_short(self) -> int:
        return self.first_track + self.tracks

    def cast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        max_range: ArrayLike = math.inf,
        threads: int | None = None,
    ) -> RayHits:
        """First hits of rays with the ground or a wall; see `terratool.field.rays.cast`.

        Args:
            origins: (…, 3) world positions at which rays begin.
            directions: (…, 3) directions of any length but 0.
            max_range: (…) largest distances.
            threads: number of threads; all processors if None.

        Raises:
            RequestError: a number is NaN, a direction 0, or a range below 0; `threads` is below 1;
                or the parts of the terrain come to too many elements.
        """
        from terratool.field.rays import cast

        return cast(self, origins, directions, max_range, threads)

    def to_torch(
        self,
        device: str | torch.device = "cpu",
        *,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        default_friction: float = math.nan,
    ) -> TorchField:
        """Copy the terrain to a device, for tensors of PyTorch: see docs/tensors.md.

        Args:
            device: "cpu", "cuda", "cuda:1" …
            origin: world position x, y, z of the zero of points and heights.
            default_friction: coefficient of friction where the ground has no friction angle.

        Raises:
            RequestError: PyTorch or Warp is not installed, the device does not exist, or the
                terrain is too large for any.
        """
        from terratool.field.torch_field import TorchField

        return TorchField(self, device, origin=origin, default_friction=default_friction)

    def to_warp(
        self,
        device: str | None = None,
        *,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        default_friction: float = math.nan,
    ) -> WarpField:
        """Copy the terrain to a device, for arrays of NVIDIA Warp: see docs/tensors.md.

        Args:
            device: "cpu", "cuda:0" …; None for Warp's default device.
            origin: world position x, y, z of the zero of points and heights.
            default_friction: coefficient of friction where the ground has no friction angle.

        Raises:
            RequestError: Warp is not installed, the device does not exist, or the terrain is too
                large for any.
        """
        from terratool.field.warp_field import WarpField

        return WarpField(self, device, origin=origin, default_friction=default_friction)

    @property
    def first_track(self) -> int:
        """Number of the first track, which follows those of the elements."""
        return min(self.elements, FARTHEST)

    def _numbered(
        self, element: NDArray[np.int64], number: NDArray[np.uint64]
    ) -> NDArray[np.int64]:
        """Numbers of elements and tracks of a shared field, from their indices in the arrays.

        Elements whose numbers fit in no index are numbered in the order in which they are met.
        """
        count = len(self.arrays.elements)
        found = np.where(element < 0, element, number[:, 0].astype(np.int64))
        found = np.where(element >= count, element - count + self.first_track, found)
        far = (element >= 0) & (element < count)
        far &= (number[:, 1] > 0) | (number[:, 0] >= FARTHEST)
        for point in np.flatnonzero(far).tolist():
            low, high = number[point].tolist()
            known = self._far.setdefault(low | high << 64, len(self._far))
            found[point] = FARTHEST + self.tracks + known
        return found

    def _number(self, element: int) -> int:
        """Number of an element of a shared field among all elements."""
        if element < self.first_track:
            return element
        return list(self._far)[element - FARTHEST - self.tracks]

    def _is_track(self, element: int) -> bool:
        return self.first_track <= element < self.first_track + self.tracks

    def primitive_of(self) -> NDArray[np.int64]:
        """Index into `primitives` of each element, (n,) int64."""
        primitives: NDArray[np.int64] = self._compiled.primitives[self.arrays.elements["kind"]]
        return primitives

    @property
    def _by_kind(self) -> list[int]:
        """Number of elements of the ground of each kind."""
        if self._tally is not None:
            return list(self._tally.by_kind)
        arrays = self.arrays
        counts = np.bincount(arrays.elements["kind"], minlength=len(arrays.kinds))
        return list(map(int, counts))

    def _kinds(self) -> Iterator[tuple[Terrain, int, int]]:
        """Yield kinds of elements, by a terrain and their number in it, with how many there are."""
        for kind, count in enumerate(self._by_kind):
            yield self, kind, count
        for sheet in () if self.storeys is None else self.storeys.sheets:
            kinds = sheet.top.arrays.elements["kind"][sheet.storeys >= 0]
            for kind, count in enumerate(np.bincount(kinds).tolist()):
                if count:
                    yield sheet.top, kind, count

    def count_by_primitive(self) -> dict[str, int]:
        """Number of elements of each primitive, unused primitives and storeys included."""
        counts = dict.fromkeys(self.primitives, 0)
        for terrain, kind, count in self._kinds():
            counts[terrain.primitives[terrain._compiled.primitives[kind]]] += count
        return counts

    def count_by_surface(self) -> dict[str, int]:
        """Number of elements with each surface: their own, inherited, or by classes of a raster."""
        counts = dict.fromkeys(self.surfaces, 0)
        for terrain, kind, count in self._kinds():
            for surface in terrain.arrays.worn_by(terrain.arrays.kinds[kind]):
                if (name := terrain.surfaces[surface]) in counts:  # no surface has one in a sheet
                    counts[name] += count
        return counts

    def cells(self) -> NDArray[np.float64]:
        """World rectangles of the elements' cells: (4, n) float64 west, south, east, north."""
        out = np.empty((4, len(self.arrays.elements)))
        kernels.cell_rectangles(self.field, self._compiled.parents, out)
        return out

    def all_cells(self) -> NDArray[np.float64] | None:
        """World rectangles of the cells of all elements, also where parts are shared.

        (4, n) float64 west, south, east, north, in no particular order; None if there are more than
        `MAX_ELEMENTS`.
        """
        if self._tally is None:
            return self.cells()
        if self.elements > MAX_ELEMENTS:
            return None
        out = np.empty((4, self.elements))
        kernels.shared_rectangles(self.field, out)
        return out

    def footprints(self) -> NDArray[np.float64]:
        """World rectangles around the elements' footprints: (4, n) float64, as `cells` has them.

        A rectangle equals the cell, except for turned elements at free places, which no cell trims.
        """
        arrays, out = self.arrays, self.cells()
        poses = arrays.poses[arrays.elements["pose"]]
        whole = np.flatnonzero((poses["free"] != 0) & (poses["turned"] != 0))
        sides = self.arrays.places["extent"][self.place_of(whole)].T
        cos, sin = np.abs(poses["cos"][whole]), np.abs(poses["sin_u"][whole])
        beyond = 0.5 * (cos * sides + sin * sides[::-1] - sides)
        out[:2, whole] -= beyond
        out[2:, whole] += beyond
        return out

    def place_of(self, elements: NDArray[np.int64]) -> NDArray[np.int64]:
        """Index of the place of each of some free elements, int64."""
        halves = self.arrays.elements["cell"][elements].astype(np.int64)
        place: NDArray[np.int64] = halves[:, 0] + (halves[:, 1] << 16)
        return place

    @property
    def parents(self) -> NDArray[np.int32]:
        """Index of each element's parent, (n,) int32; -1 for the root.

        Where parts are shared, only `written_out` has all elements.
        """
        return self._compiled.parents

    def descr_of(self, element: int) -> str:
        """Description of an element by its index; empty if it has none.

        Tracks and elements of shared parts have none here; `written_out` has all elements.
        """
        return (self._compiled.descrs or {}).get(element, "")

    def pointer(self, element: int) -> str | None:
        """JSON pointer of an element or track by its index; None for a negative index.

        For an element in a part, it is a chain: the pointer of the part, and the pointer within it.
        """
        if element < 0:
            return None
        if self.storeys is not None:
            short = element - self._first_short
            if 0 <= short < len(self.storeys.written) and self.first_track < FARTHEST:
                element = FIRST_STOREY + short
            if element >= FIRST_STOREY:
                return self.storeys.pointer(element)
        if self._is_track(element):
            return f"/tracks/{element - self.first_track}"
        if self._tally is not None:
            return self._tally.name(self._number(element))
        steps = []
        while element >= 0:
            steps.append(self._compiled.step(element))
            element = int(self._compiled.parents[element])
        return "".join(reversed(steps))

    def type_of(self, element: int) -> str:
        """Name of the primitive of an element of the ground or of storeys, by its index.

        Parts and copies are written out.
        """
        if self.storeys is not None and element >= FIRST_STOREY:
            return self.storeys.type_of(element)
        index: int = self._compiled.primitives[self.arrays.elements["kind"][element]]
        return self.primitives[index]

    @cached_property
    def _surface_names(self) -> NDArray[Any]:
        return np.array([*self.surfaces, None], object)


def load(
    path: str | Path,
    library_roots: tuple[str, ...] = (),
    *,
    roughness: bool = True,
    early: Callable[[Bounds], object] | None = None,
) -> Terrain:
    """Read, check and compile a definition.

    Args:
        path: the file.
        library_roots: further folders under which the libraries that it uses may lie.
        roughness: whether rough surfaces have their relief.
        early: called with the bounds of the terrain before its elements are looked at; what it
            raises ends the reading.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the definition is no valid terrain; the findings say why.
    """
    return Terrain(load_checked(path, library_roots, early), roughness=roughness)


def _written_out(definition: Definition | Checked, uses: Uses) -> Expansion:
    expansion = definition.expansion if isinstance(definition, Checked) else expand(uses)
    assert expansion is not None
    return expansion


def _points(
    x: ArrayLike, y: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[int, ...]]:
    """Points in a row, (n,) each, and the shape that they broadcast to."""
    x, y = points_of(x, y)
    first, second = (np.ascontiguousarray(one).ravel() for one in (x, y))
    return first, second, x.shape


def _points_below(
    x: ArrayLike, y: ArrayLike, below: ArrayLike | None
) -> tuple[Floats, Floats, Floats | None, tuple[int, ...]]:
    """Points in a row with the heights below which a top is wanted, and the shape of all."""
    if below is None:
        x, y, shape = _points(x, y)
        return x, y, None, shape
    x, y = points_of(x, y)
    x, below = points_of(x, below, "below")
    y, below = points_of(y, below)
    first, second, third = (
        np.ascontiguousarray(np.broadcast_to(one, below.shape)).ravel() for one in (x, y, below)
    )
    return first, second, third, below.shape


def _normals(slope_x: Floats, slope_y: Floats) -> Floats:
    """Upward unit normals by the slopes along x and y, (…, 3)."""
    length = np.sqrt(slope_x * slope_x + slope_y * slope_y + 1.0)
    normal = np.empty((*slope_x.shape, 3))
    for axis, part in enumerate((0.0 - slope_x, 0.0 - slope_y, 1.0)):
        normal[..., axis] = part / length
    return normal
