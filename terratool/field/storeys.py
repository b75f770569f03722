"""Storeys of a terrain: decks over other ground and bores through it, in sheets of plain terrains.

A sheet has storeys that share no point. One plain terrain has these storeys and the elements in
whose cells they are, which are void there: its height at a point is that of the storey over it. A
second one has the other faces of the same storeys, undersides of decks or ceilings of bores.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
from msgspec import UNSET, structs
from numpy.typing import NDArray

from terratool.definition.model import Bore, Definition, Primitive, Storey, Surface
from terratool.definition.written import Written
from terratool.field.bounds import largest_heights
from terratool.field.compile import Compiled, compile_definition
from terratool.field.storey_levels import level_cells
from terratool.kernels import field as kernels
from terratool.report.wording import decks_and_bores

if TYPE_CHECKING:
    from terratool.field.terrain import Terrain

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FIRST_STOREY = 3 << 61
"""Number of the first element of storeys; numbers of the ground and of tracks are smaller."""

_CELLS_EACH = 256
_MOST_CELLS = 1 << 20
"""Cells of the lattice for each storey, and most cells of all."""
_LAST_BIT = 63
"""Bit of the lattice for all sheets from this one on."""
_WIDER = 1e-9
"""Share of a rectangle's sides by which it grows, against rounding."""
_MOST_VALUES = 1 << 22
"""Most intervals of the points that are looked at together."""


class StoreyTable(NamedTuple):
    """Decks and bores by their numbers, (s,) each.

    Attributes:
        gaps: float64, distance between the two faces; NaN where a primitive gives the other one.
        numbers: int64, number of the storey's own element, from `FIRST_STOREY` on.
        surface: int32, index of the surface of the other face; -1 for none.
    """

    gaps: Floats
    numbers: Ints
    surface: NDArray[np.int32]


class StoreyLattice(NamedTuple):
    """Even lattice over all storeys.

    Attributes:
        frame: (4,) west, south, and cells per unit along x and y.
        cells: (rows, columns) uint64 from the south-west, a bit for each sheet that may have a
            storey there; the last bit stands for all further sheets.
        levels: (rows, columns) height that decks of one level have all over a cell; NaN where they
            may not.
    """

    frame: Floats
    cells: NDArray[np.uint64]
    levels: Floats


@dataclass(frozen=True)
class StoreySheet:
    """Storeys that share no point, all decks or all bores.

    Attributes:
        top: plain terrain of their tops.
        face: plain terrain of their own elements with the other face in place of each.
        storeys: (n,) int32, number of the storey of each element of `top`; -1 for none.
        numbers: (n,) int64, number of each element of `top`, from `FIRST_STOREY` on.
        faced: (m,) int32, number of the storey of each element of `face`; -1 for none.
        bare: index of the surface of `top` that stands for none.
        is_bore: whether they are bores.
    """

    top: Terrain
    face: Terrain
    storeys: NDArray[np.int32]
    numbers: Ints
    faced: NDArray[np.int32]
    bare: int
    is_bore: bool

    @property
    def tops(self) -> kernels.Field:
        """Field of the tops."""
        return self.top.field

    @property
    def faces(self) -> kernels.Field:
        """Field of the other faces."""
        return self.face.field

    @property
    def most(self) -> float:
        """Height that no top exceeds: all that elements in and around a storey add at most."""
        largest, parents = largest_heights(self.top.arrays), self.top.parents
        is_own = self.storeys >= 0
        sums = np.bincount(self.storeys[is_own], largest[is_own], minlength=1)
        begins = np.flatnonzero(is_own & (self.storeys[parents] != self.storeys))
        sums, around = sums[self.storeys[begins]], parents[begins]
        while (around >= 0).any():
            sums += np.where(around >= 0, largest[around], 0.0)
            around = np.where(around >= 0, parents[around], -1)
        most = float(sums.max(initial=0.0))
        return most + 1e-9 * most  # heights are rounded

    def other_face(self, gaps: Floats) -> Terrain:
        """Plain terrain of the other faces, with the gaps between the faces, (storeys,)."""
        elements = self.face.arrays.elements.copy()
        gap = np.where(self.faced < 0, 0.0, np.nan_to_num(gaps[self.faced]))
        elements["offset"] += gap if self.is_bore else -gap
        return self.face.with_arrays(self.face.arrays._replace(elements=elements))


class ColumnRows(NamedTuple):
    """Columns at points, as the kernels fill them: intervals from below, (n, m) each but `held`.

    Attributes:
        held: (n,) int32, number of intervals.
        bottom: float64; -inf for the ground.
        top: float64.
        slope_x: float64, slope of the top along x.
        slope_y: float64, slope of the top along y.
        surface: int32, index of the surface of the top; -1 for none.
        element: int64, number of the element of the top; -1 for none.
        under: int64, number of the element of the bottom; -1 for the ground.
    """

    held: NDArray[np.int32]
    bottom: Floats
    top: Floats
    slope_x: Floats
    slope_y: Floats
    surface: NDArray[np.int32]
    element: Ints
    under: Ints

    @classmethod
    def empty(cls, points: int, most: int) -> ColumnRows:
        """Rows for so many points and intervals, without any."""
        shape = points, most
        bottom, top, slope_x, slope_y = np.full((4, *shape), math.nan)
        surface, element = np.full(shape, -1, np.int32), np.full(shape, -1)
        held = np.zeros(points, np.int32)
        return cls(held, bottom, top, slope_x, slope_y, surface, element, element.copy())

    @classmethod
    def of_ground(cls, ground: ColumnGround) -> ColumnRows:
        """Rows for ground without storeys."""
        height, element, surface, gradient = ground
        some = ~np.isnan(height)
        rows = cls.empty(len(height), 1)
        rows.held[:], rows.bottom[some, 0] = some, -np.inf
        rows.top[:, 0], rows.slope_x[:, 0], rows.slope_y[:, 0] = height, *gradient.T
        rows.element[some, 0], rows.surface[some, 0] = element[some], surface[some]
        return rows

    def narrowed(self) -> ColumnRows:
        """Return the rows with as many intervals as any point has, one at least."""
        wide = max(1, int(self.held.max(initial=0)))
        return ColumnRows._make([self.held, *(one[:, :wide] for one in self.matrices)])

    @property
    def matrices(self) -> tuple[NDArray[Any], ...]:
        """All members but the number of intervals."""
        rest: tuple[NDArray[Any], ...] = self[1:]
        return rest

    @property
    def last(self) -> tuple[NDArray[np.bool_], tuple[Ints, Ints]]:
        """Points that have an interval, as a mask, and the place of the highest one of each."""
        some = self.held > 0
        return some, (np.flatnonzero(some), self.held[some].astype(np.int64) - 1)

    def below(self, z: Floats) -> tuple[NDArray[np.bool_], tuple[Ints, Ints]]:
        """Points that have a top not above z, as a mask, and the place of the highest such one."""
        low = (self.top <= z[:, None]).sum(axis=1)
        some = low > 0
        return some, (np.flatnonzero(some), low[some] - 1)


class ColumnGround(NamedTuple):
    """Ground of columns without ruts and reliefs, (n,) each; gradient (n, 2)."""

    height: Floats
    element: Ints
    surface: NDArray[np.int32]
    gradient: Floats


class _Plan(NamedTuple):
    """Elements of storeys with what is known of each, (n,) each.

    Attributes:
        written: the elements, and those in whose cells they are.
        own: index of the storey that each is of; -1 for the ground.
        depth: number of storeys around each, its own included.
        datum: number of storeys around the last one whose heights count from 0, and this one; 0
            for none.
        is_deck: whether the storey of each is a deck.
        worn: code of the surface of each; 0 for none.
        bounds: (4, n) west, south, east, north around it and all that is in it.
    """

    written: Written
    own: Ints
    depth: Ints
    datum: Ints
    is_deck: NDArray[np.bool_]
    worn: Ints
    bounds: Floats


class Storeys:
    """Decks and bores of a terrain.

    Attributes:
        sheets: sheets in the order in which columns take them.
        decks: number of decks.
        bores: number of bores.
        elements: number of elements of storeys.
        written: all elements of storeys, and those in whose cells they are.
        table: storeys by number.
        lattice: where which sheet has storeys.
    """

    def __init__(
        self,
        written: Written,
        definition: Definition,
        plain: Callable[[Compiled, Definition], Terrain],
    ) -> None:
        """Compile storeys.

        Args:
            written: all elements of storeys, and those in whose cells they are.
            definition: the terrain, with all names in use.
            plain: maker of a terrain from what is compiled, and of its definition.
        """
        self.written = written
        own = written.storeys()
        self.bores = sum(isinstance(one, Bore) for one in own.values())
        self.decks = len(own) - self.bores
        definition = structs.replace(definition, tracks=UNSET)
        whole = plain(compile_definition(definition, written, roughness=False), definition)
        plan = _plan(written, own, whole)
        self.elements = int(np.count_nonzero(plan.own >= 0))
        footprints = np.empty((4, len(written)))
        footprints[:, _order(whole)] = whole.footprints()
        number = np.full(len(written), -1, np.int32)
        indices = np.fromiter(own, np.int64, len(own))
        number[indices] = np.arange(len(own))
        surfaces = {name: code for code, name in enumerate(definition.surfaces)}
        worn = [surfaces.get(name, -1) for name in written.values_of(plan.worn[indices])]
        self.table = StoreyTable(
            np.array([math.nan if s.gap is UNSET else s.gap for s in own.values()], np.float64),
            FIRST_STOREY + indices,
            np.array(worn, np.int32),
        )
        maker = _SheetMaker(plan, own, number, definition, plain)
        keyed = _sheet_keys(plan, indices)
        self.sheets = tuple(maker.make(members) for members in keyed)
        self.lattice = _lattice(footprints, keyed)

    def __repr__(self) -> str:
        return f"<Storeys: {decks_and_bores(self.decks, self.bores)}>"

    @cached_property
    def field(self) -> kernels.Storeys:
        """Sheets, table and lattice, checked and kept by the kernels."""
        # arrays that came in a message are read-only
        self.lattice = self.lattice._replace(levels=np.full(self.lattice.cells.shape, np.nan))
        field = kernels.Storeys(self.sheets, self.table, self.lattice)
        level = level_cells(self)
        if not level.any():
            return field
        y, x = (at + 0.5 for at in np.nonzero(level))
        frame, heights = self.lattice.frame, np.full(len(x), np.nan)
        x, y = frame[0] + x / frame[2], frame[1] + y / frame[3]
        kernels.top_heights(field, x, y, None, heights)
        self.lattice.levels[level] = heights
        return field

    @property
    def nbytes(self) -> int:
        """Memory of the compiled storeys in bytes."""
        fields = sum(sheet.top.nbytes + sheet.face.nbytes for sheet in self.sheets)
        return fields + self.lattice.cells.nbytes + self.lattice.levels.nbytes

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "field"}

    def near(self, x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Whether storeys may be at points, (n,); where not, there is the ground alone."""
        out = np.empty(len(x), np.bool_)
        kernels.near_storeys(self.field, x, y, out)
        return out

    def pointer(self, number: int) -> str:
        """Name of an element of storeys by its number, from `FIRST_STOREY` on."""
        steps, number = [], number - FIRST_STOREY
        while number >= 0:
            steps.append(self.written.step(number))
            number = int(self.written.parent[number])
        return "".join(reversed(steps))

    def type_of(self, number: int) -> str:
        """Name of the primitive of an element of storeys by its number, from `FIRST_STOREY` on."""
        written = self.written
        return str(written.names.values[written.rows.type[number - FIRST_STOREY]])

    def columns(self, terrain: Terrain, x: Floats, y: Floats, ground: ColumnGround) -> ColumnRows:
        """Columns at points on a terrain.

        Args:
            terrain: the terrain, which has the tracks and the reliefs.
            x: (n,) world positions.
            y: (n,) world positions.
            ground: ground at the points.
        """
        most = 1 + len(self.sheets)
        size = max(1, _MOST_VALUES // most)
        parts = []
        for begin in range(0, max(1, len(x)), size):
            own = slice(begin, begin + size)
            rows = ColumnRows.empty(len(x[own]), most)
            here = ColumnGround._make(np.ascontiguousarray(one[own]) for one in ground)
            kernels.columns(
                self.field, terrain.field, x[own], y[own], here, terrain.first_track, rows
            )
            parts.append(rows.narrowed())
        if len(parts) == 1:
            return parts[0]
        found = ColumnRows.empty(len(x), max(part.top.shape[1] for part in parts))
        begin = 0
        for part in parts:
            end = begin + len(part.held)
            found.held[begin:end] = part.held
            for whole, one in zip(found.matrices, part.matrices, strict=True):
                whole[begin:end, : one.shape[1]] = one
            begin = end
        return found


def _order(terrain: Terrain) -> Ints:
    """Index in the written elements of each element of a terrain, (n,)."""
    written = terrain.compiled.written
    assert written is not None
    return written[1]


def _plan(written: Written, own: dict[int, Storey], whole: Terrain) -> _Plan:
    count = len(written)
    indices = np.fromiter(own, np.int64, len(own))
    is_storey = np.zeros(count, np.bool_)
    is_storey[indices] = True
    has_datum = np.zeros(count, np.bool_)
    has_datum[indices] = [one.datum is True for one in own.values()]
    decks = np.zeros(count, np.bool_)
    decks[indices] = [not isinstance(one, Bore) for one in own.values()]
    storey, depth, datum = np.full(count, -1), np.zeros(count, np.int64), np.zeros(count, np.int64)
    worn = written.rows.surface.copy()
    levels = list(zip(written.levels[:-1], written.levels[1:], strict=True))
    for begin, end in levels:
        level = slice(begin, end)
        if begin:
            above = written.parent[level]
            storey[level], depth[level], datum[level] = storey[above], depth[above], datum[above]
            worn[level] = np.where(worn[level] == 0, worn[above], worn[level])
        storey[level] = np.where(is_storey[level], np.arange(begin, end), storey[level])
        depth[level] += is_storey[level]
        datum[level] = np.where(has_datum[level], depth[level], datum[level])
    bounds = np.empty((4, count))
    cells, feet = whole.cells(), whole.footprints()
    bounds[:, _order(whole)] = np.concatenate(
        [np.minimum(cells[:2], feet[:2]), np.maximum(cells[2:], feet[2:])]
    )
    turned = written.rows.free & ~np.isnan(written.rows.turn) & (written.rows.turn % 360 != 0)
    _widen(bounds, turned)  # their edges are closed
    for begin, end in reversed(levels[1:]):
        above = written.parent[begin:end]
        for side, pick in zip(range(4), (np.minimum,) * 2 + (np.maximum,) * 2, strict=True):
            pick.at(bounds[side], above, bounds[side, begin:end])
    is_deck = np.where(storey >= 0, decks[storey], False)
    return _Plan(written, storey, depth, datum, is_deck, worn, bounds)


def _widen(bounds: Floats, which: Any = slice(None)) -> None:
    """Make rectangles a little larger, (4, n), in place."""
    more = _WIDER * (bounds[2:, which] - bounds[:2, which])
    bounds[:2, which] -= more
    bounds[2:, which] += more


_Class = tuple[int, bool, int]
"""Depth of a storey, whether it is a deck, and level of its element: bores count before decks."""


def _sheet_keys(plan: _Plan, storeys: Ints) -> list[Ints]:
    """Storeys of each sheet, by index, in the order in which columns take the sheets.

    Storeys of one depth and kind are in the order of the field: level by level, and in that of the
    document within a level. Of two that may share a point, or that elements around the other may
    reach, the later one comes into a later sheet.
    """
    written = plan.written
    count = len(written)
    nested = np.repeat(np.arange(len(written.levels) - 1), np.diff(written.levels))
    depths, decks = plan.depth.tolist(), plan.is_deck.tolist()
    classes: list[_Class] = list(zip(depths, decks, nested.tolist(), strict=True))
    needs: list[dict[_Class, int]] = [{} for _ in range(count)]  # sheets that each has in it
    begins: list[dict[_Class, int]] = [{} for _ in range(count)]  # its first one in its parent
    own = set(storeys.tolist())
    for parent, begin, end in reversed(list(_families(written))):
        active = [child for child in range(begin, end) if child in own or needs[child]]
        for child in active:
            if child in own:
                needs[child][classes[child]] = 1
        earlier = _earlier_overlaps(plan.bounds[:, active])
        for place, child in enumerate(active):
            for kind, many in needs[child].items():
                first = max(
                    (
                        begins[other].get(kind, 0) + needs[other][kind]
                        for other in (active[one] for one in earlier[place])
                        if kind in needs[other]
                    ),
                    default=0,
                )
                begins[child][kind] = first
                needs[parent][kind] = max(needs[parent].get(kind, 0), first + many)
    sheets: dict[tuple[_Class, int, int], list[int]] = {}
    for index in storeys.tolist():
        kind, sheet, at = classes[index], 0, index
        while at > 0:
            sheet += begins[at].get(kind, 0)
            at = int(written.parent[at])
        sheets.setdefault((kind, sheet, int(plan.datum[index])), []).append(index)
    return [np.array(sheets[key]) for key in sorted(sheets)]


def _families(written: Written) -> Iterator[tuple[int, int, int]]:
    """Yield parent, first and end (exclusive) of all siblings."""
    if len(written) < 2:
        return
    begins = 1 + np.flatnonzero(np.diff(written.parent[1:], prepend=-1))
    ends = np.append(begins[1:], len(written))
    yield from zip(written.parent[begins].tolist(), begins.tolist(), ends.tolist(), strict=True)


def _earlier_overlaps(bounds: Floats) -> list[list[int]]:
    """Earlier rectangles that each of some overlaps, (4, n); those that touch do not."""
    count = bounds.shape[1]
    found: list[list[int]] = [[] for _ in range(count)]
    if count < 2:
        return found
    boxes = shapely.box(*bounds)
    one, other = shapely.STRtree(boxes).query(boxes)
    west, south, east, north = bounds
    both = (other < one) & (west[one] < east[other]) & (west[other] < east[one])
    both &= (south[one] < north[other]) & (south[other] < north[one])
    for later, earlier in zip(one[both].tolist(), other[both].tolist(), strict=True):
        found[later].append(earlier)
    return found


def _fresh(names: Iterable[str], name: str) -> str:
    """Name that is none of some."""
    known = set(names)
    while name in known:
        name += "'"
    return name


class _SheetMaker:
    """Maker of sheets from the elements of storeys."""

    def __init__(
        self,
        plan: _Plan,
        own: dict[int, Storey],
        number: NDArray[np.int32],
        definition: Definition,
        plain: Callable[[Compiled, Definition], Terrain],
    ) -> None:
        self._plan, self._own, self._number, self._plain = plan, own, number, plain
        outside = _fresh(definition.surfaces, "outside")
        bare = _fresh((*definition.surfaces, outside), "bare")
        level = _fresh(definition.primitives, "level")
        # behind all others, so that these keep their indices
        self._definition = structs.replace(
            definition,
            surf_types={**definition.surfaces, outside: Surface(void=True), bare: Surface()},
            elem_types={**definition.primitives, level: Primitive(x=(1.0,))},
        )
        code = plan.written.names.number
        self._outside, self._bare, self._level = code(outside), code(bare), code(level)

    def make(self, members: Ints) -> StoreySheet:
        """Sheet of storeys, by their indices."""
        plan = self._plan
        written = plan.written
        is_own = np.isin(plan.own, members)
        kept = is_own.copy()
        around = members
        while len(around):
            around = np.unique(written.parent[around])
            around = around[around >= 0]
            kept[around] = True
        top, index = self._compile(kept, is_own, int(plan.datum[members[0]]), {})
        faces = {int(one): self._own[int(one)] for one in members}
        own_element = np.zeros(len(written), np.bool_)
        own_element[members] = True
        bottom = kept & (~is_own | own_element)
        face, behind = self._compile(bottom, own_element, int(plan.datum[members[0]]), faces)
        storey = np.where(is_own, self._number[np.where(is_own, plan.own, 0)], -1)
        return StoreySheet(
            top, face, storey[index].astype(np.int32), FIRST_STOREY + index,
            np.where(own_element, storey, -1)[behind].astype(np.int32),
            len(self._definition.surfaces) - 1, not plan.is_deck[members[0]],
        )  # fmt: skip

    def _compile(
        self,
        kept: NDArray[np.bool_],
        is_own: NDArray[np.bool_],
        datum: int,
        faces: dict[int, Storey],
    ) -> tuple[Terrain, Ints]:
        """Plain terrain of some elements, and the index of each of its elements among all.

        Args:
            kept: (n,) mask of the elements.
            is_own: (n,) mask of those of the storeys.
            datum: number of storeys from which on elements around count.
            faces: storeys whose other faces are wanted, by the index of their own elements; empty
                for the tops of all.
        """
        plan = self._plan
        indices = np.flatnonzero(kept)
        written = plan.written.only(kept)
        rows = written.rows
        own = is_own[kept]
        worn = plan.worn[kept]
        worn[worn == 0] = self._bare
        if faces:
            worn[:] = self._bare
        rows.surface[:] = np.where(own, worn, self._outside)
        rows.surface_grid[~own | bool(faces)] = 0
        still = ~own & (plan.depth[kept] < datum)
        rows.type[still], rows.scale[still], rows.offset[still] = self._level, 0.0, 0.0
        place = {index: at for at, index in enumerate(indices.tolist())} if faces else {}
        for index, storey in faces.items():
            if storey.face is not UNSET:
                at = place[index]
                rows.type[at] = written.names.number(storey.face)
                rows.scale[at] = 1.0 if storey.v_scale is UNSET else storey.v_scale
                rows.offset[at] = 0.0 if storey.v_offset is UNSET else storey.v_offset
        compiled = compile_definition(self._definition, written, roughness=False)
        terrain = self._plain(compiled, self._definition)
        return terrain, indices[_order(terrain)]


def _lattice(footprints: Floats, sheets: list[Ints]) -> StoreyLattice:
    """Lattice over the footprints of storeys, (4, n), of which each sheet has some."""
    storeys = np.concatenate(sheets)
    bounds = footprints[:, storeys].copy()
    _widen(bounds)
    bit = np.repeat(np.arange(len(sheets)), [len(one) for one in sheets])
    low, high = bounds[:2].min(axis=1), bounds[2:].max(axis=1)
    extent = high - low
    cells = min(_MOST_CELLS, _CELLS_EACH * len(storeys))
    side = math.sqrt(extent[0] * extent[1] / cells)
    shape = np.clip(np.ceil(extent / side), 1, cells).astype(np.int64)
    per = shape * (1 - 1e-12) / extent
    first = np.clip(((bounds[:2].T - low) * per).astype(np.int64), 0, shape - 1)
    last = np.clip(((bounds[2:].T - low) * per).astype(np.int64), 0, shape - 1)
    out = np.zeros(shape[::-1], np.uint64)
    masks = np.uint64(1) << np.minimum(bit, _LAST_BIT).astype(np.uint64)
    for (i, j), (i_last, j_last), mask in zip(first.tolist(), last.tolist(), masks, strict=True):
        out[j : j_last + 1, i : i_last + 1] |= mask
    return StoreyLattice(np.concatenate([low, per]), out, np.full(out.shape, np.nan))
