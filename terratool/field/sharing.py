"""Compilation of templates into a field with shared parts, and the names of its elements."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.exact import rests_of, side
from terratool.definition.sharing import Blueprint, BlueprintNode, smallest_cell
from terratool.definition.uses import MAX_ELEMENTS
from terratool.errors import RequestError
from terratool.field.classes import class_column
from terratool.field.compile import Compiled
from terratool.field.pieces import Floats
from terratool.field.records import (
    COPIES,
    ELEMENT,
    IN_CELLS,
    MEMBER,
    PLACE,
    FieldArrays,
    SharingArrays,
)
from terratool.field.tables import (
    Columns,
    Ints,
    Runs,
    bins_of,
    dense_runs,
    kinds_of,
    mark_plain,
    order_of,
    place_terrain,
    placed_of,
    poses_of,
    rank_of,
    reorder,
    runs_of,
    surroundings,
)
from terratool.kernels import field as kernels

LARGEST_NUMBER = 1 << 126
"""Most elements that can be numbered."""

MIRRORS = (0, 2, 3, 1)
"""Axes along which 0 to 3 quarter turns mirror places: bit 1 for x, bit 2 for y."""

_SLACK = 8.0
"""Factor on the terrain's corner and sides in bounds of rounding, before grids are laid."""


class SharedMember(NamedTuple):
    """An element of a template with its copies and their numbers.

    Attributes:
        element: index in the field of its first row.
        firsts: first number of each copy that is scattered, or of all copies, among the numbers of
            its siblings and of the elements in them.
        each: number of elements of each copy in rows, itself included.
        row: copies in a row; 0 without `repeat`.
        places: places of scattered copies in their list by size; None for others.
        step: end of its name, before and after the place among the copies.
        families: index of the family in its copies, or in each scattered copy; -1 for none.
    """

    element: int
    firsts: Sequence[int]
    each: int
    row: int
    places: Ints | None
    step: tuple[str, str]
    families: Ints

    def copy_at(self, number: int) -> tuple[int, int]:
        """Return the copy that a number among the siblings falls into, and the number within it."""
        if self.places is None:
            copy, left = divmod(number - self.firsts[0], self.each)
            return copy, left
        copy = bisect_right(self.firsts, number) - 1
        return copy, number - self.firsts[copy]

    def family_of(self, copy: int) -> int:
        """Return the index of the family in a copy; -1 for none."""
        return int(self.families[0 if self.places is None else copy])

    def name_of(self, copy: int) -> str:
        """Return the end of the name of a copy."""
        before, after = self.step
        place = ""
        if self.places is not None:
            place = f"[{self.places[copy]}]"
        elif self.row:
            place = f"[{copy % self.row},{copy // self.row}]"
        return f"{before}{place}{after}"


class Tally(NamedTuple):
    """Numbers of elements of a shared terrain, and the way to each.

    Attributes:
        elements: number of all elements.
        by_kind: number of elements of each kind.
        levels: levels of nesting.
        families: members in each element of the text, by `SharedMember.family_of`.
        root: the root of the terrain.
    """

    elements: int
    by_kind: tuple[int, ...]
    levels: int
    families: tuple[tuple[SharedMember, ...], ...]
    root: SharedMember

    def way(self, number: int) -> list[tuple[SharedMember, int]]:
        """Return the members on the way to an element by its number, each with its copy."""
        way = [(self.root, 0)]
        while number:
            member, copy = way[-1]
            members = self.families[member.family_of(copy)]
            before = bisect_right(members, number - 1, key=lambda one: one.firsts[0])
            copy, number = members[before - 1].copy_at(number - 1)
            way.append((members[before - 1], copy))
        return way

    def name(self, number: int) -> str:
        """Return the name of an element by its number."""
        return "".join(member.name_of(copy) for member, copy in self.way(number))


class _Draft(NamedTuple):
    """Elements of all templates, one template after the other behind all roots.

    Attributes:
        nodes: roots of the templates, and then their elements.
        parents: index of the parent node of each node; -1 for a root.
        levels: index of the first node of each level, and the number of nodes.
        quarters: quarter turns of the template of each node.
        first: (nodes + 1,) int64, first row of each node, and the number of rows.
        below: (rows,) int64, row whose children stand in each row; -1 for none.
        often: number of times that the parent of each node stands in the terrain, of any size.
    """

    nodes: list[BlueprintNode]
    parents: list[int]
    levels: list[int]
    quarters: list[int]
    first: Ints
    below: Ints
    often: list[int]

    @property
    def node_of(self) -> Ints:
        """Node of each row, (rows,) int64."""
        return np.repeat(np.arange(len(self.nodes)), np.diff(self.first))

    def values(self, name: str) -> list[Any]:
        """Values of an attribute of the elements that nodes stand for."""
        roots = [node.chain.root for node in self.nodes]
        return [root.tree.value(name, root.element) for root in roots]

    def spread(self, values: Sequence[Any], dtype: Any) -> NDArray[Any]:
        """Spread values of nodes, or arrays for their copies, over all rows as a column."""
        arrays = [index for index, value in enumerate(values) if isinstance(value, np.ndarray)]
        plain = list(values)
        for index in arrays:
            plain[index] = values[index][0] if len(values[index]) else plain[0]
        column = np.repeat(np.array(plain, dtype), np.diff(self.first), axis=0)
        for index in arrays:
            column[self.first[index] : self.first[index + 1]] = values[index]
        return column


def compile_shared(plan: Blueprint, *, roughness: bool = True) -> tuple[Compiled, Tally]:
    """Compile the templates of a terrain, with or without reliefs.

    Raises:
        RequestError: the terrain comes to more elements than can be numbered.
    """
    draft = _draft(plan)
    definition = plan.definition
    classes = class_column(draft.values("surface_grid"))
    columns, bounding, factors = _columns(draft, plan, classes.of)
    order, dense = order_of(bounding, draft.first[draft.levels].tolist())
    columns, bounding, dense = reorder(columns, order), reorder(bounding, order), dense[order]
    node_of, free = draft.node_of[order], columns.free
    below = draft.below[order]
    below = np.where(below >= 0, rank_of(order)[below], -1)

    runs = runs_of(columns)
    grids, owners = runs.grids, runs.owners
    grid_of = np.where(below >= 0, runs.grid_of[below], 0).astype(np.uint32)
    grids["count"] = 1.0
    in_cells = np.flatnonzero(grids["standing"][1:] == IN_CELLS)
    grids["count"][in_cells + 1] = columns.cells[owners[in_cells]]
    # until grids are laid, assume the least exact positions
    corner, extent = np.array(definition.corner, float), np.array(definition.extent, float)
    grids["corner"][:, :, 0] = _SLACK * np.maximum(np.abs(corner), np.abs(corner + extent))
    grids["pitch"][:, :, 0] = _SLACK * extent

    places, rests = _free_places(draft)
    placed = placed_of(bounding, places, rests, grid_of > 0)
    places, rests = placed.places, placed.rests
    copies, copies_of = _copies(draft, node_of)
    middles = places.copy()
    own_copies = copies[copies_of[free]]
    far = own_copies["step"] * (own_copies["count"] - 1.0)
    middles["at"] += 0.5 * far
    reach = placed.reach + 0.5 * np.abs(far) * (1 + 1e-9)
    placed = placed._replace(places=middles, reach=reach)
    ranges = runs.ranges
    ranges.last[0] = 1  # roots of other templates are no elements
    bins = bins_of(runs, ranges, grid_of, placed, dense)
    grids["corner"] = grids["pitch"] = 0.0
    place_terrain(grids, definition)

    elements = np.zeros(len(order), ELEMENT)
    elements["cell"] = columns.cell
    elements["cell"][free] = placed.cell[free, :1] >> (0, 16) & 0xFFFF
    elements["scale"] = columns.scale
    elements["offset"] = columns.offset
    elements["grid"] = grid_of
    elements["pose"], poses = poses_of(columns, np.ones(len(order)))
    found = kinds_of(definition, columns, columns.surface, classes.grids)
    elements["kind"] = found.of
    plain = mark_plain(runs, elements, found.kinds, columns.turn)
    grids["leaves"] = _leaves(runs, columns, draft, node_of, plain)

    members, tally = _number(draft, order, plan)
    members["copies"] = copies_of
    members["factor"] = factors[order]
    mirrors = np.array([MIRRORS[quarters] for quarters in draft.quarters], np.uint8)[node_of]
    arrays = FieldArrays(
        elements=elements,
        grids=grids,
        poses=poses,
        places=places,
        rests=rests,
        kinds=found.kinds,
        curves=found.curves,
        classes=found.classes,
        voids=found.voids,
        shared=SharingArrays(members, copies, mirrors[runs.first], extent),
        **bins._asdict(),
        **surroundings(definition, roughness=roughness),
    )
    by_kind = [0] * len(found.kinds)
    kinds = found.of[rank_of(order)[draft.first[:-1]].clip(0, len(order) - 1)].tolist()
    rows = np.diff(draft.first).tolist()
    for node, kind, often, many in zip(draft.nodes, kinds, draft.often, rows, strict=True):
        by_kind[kind] += often * node.many * many
    compiled = Compiled(
        arrays,
        np.zeros(0, np.uint32),
        columns.parent.astype(np.int32),
        smallest_cell(plan),
        tuple(definition.surfaces),
        tally.levels,
        found.primitives,
    )
    return compiled, tally._replace(by_kind=tuple(by_kind))


def refuse_piled(field: kernels.Field, name: str) -> None:
    """Refuse a shared field in which too many elements lie over one point.

    Args:
        field: the field.
        name: file name for the message.

    Raises:
        RequestError: more than `MAX_ELEMENTS` lie over one point, or may do so.
    """
    most = kernels.most_over_point(field)
    if most > MAX_ELEMENTS:
        raise RequestError(
            f"{name}: up to {most:.3g} elements lie over one point, copies on each other, "
            f"and more than {MAX_ELEMENTS:,} are not added up.",
            "Make the steps of copies longer, or place fewer parts on each other.",
        )


def _draft(plan: Blueprint) -> _Draft:
    count = len(plan.templates)
    nodes = [
        plan.root._replace(cells=template.cells, inner=-1, copies=None)
        for template in plan.templates
    ]
    quarters = [template.quarters for template in plan.templates]
    parents, levels = [-1] * count, [0, count]
    for number, template in enumerate(plan.templates):
        start = len(nodes)
        nodes += template.nodes
        levels += [start + end for end in template.levels[1:]]
        quarters += [template.quarters] * len(template.nodes)
        for parent, begin, end in template.families:
            parents += [number if parent < 0 else start + parent] * (end - begin)
    first = np.cumsum([0, *(node.rows for node in nodes)])
    below = [*range(count), *(node.inner for node in nodes[count:])]
    for parent in set(parents[count:]):
        if parent >= count:
            below[parent] = int(first[parent])
    draft = _Draft(nodes, parents, levels, quarters, first, np.zeros(0, np.int64), [])
    return draft._replace(below=draft.spread(below, np.int64), often=_often(draft, count))


def _often(draft: _Draft, roots: int) -> list[int]:
    """Number of times that the parent of each node stands in the terrain; 0 for other roots."""
    within = [1] + [0] * (len(draft.nodes) - 1)  # copies of each node's children
    often = [1] + [0] * (len(draft.nodes) - 1)
    for index in range(roots, len(draft.nodes)):
        node = draft.nodes[index]
        often[index] = within[draft.parents[index]]
        within[index] += often[index] * node.many
        if isinstance(node.inner, np.ndarray):
            for number, count in zip(*np.unique(node.inner, return_counts=True), strict=True):
                within[int(number)] += often[index] * int(count)
        elif node.inner >= 0:
            within[node.inner] += often[index] * node.many * node.rows
    return often


def _columns(draft: _Draft, plan: Blueprint, classes: Ints) -> tuple[Columns, Columns, Floats]:
    """Elements as columns, first copies alone and rows of copies as blocks, and their factors.

    Args:
        draft: elements of all templates.
        plan: templates.
        classes: (nodes,) index of each node's raster of classes; -1 for none.
    """
    nodes, definition = draft.nodes, plan.definition
    types = {name: i for i, name in enumerate(definition.primitives)}
    surfaces: dict[Any, int] = {name: i for i, name in enumerate(definition.surfaces)}
    surfaces[UNSET] = -1
    chains = [node.chain for node in nodes]

    def floats(values: list[Any], default: float) -> Floats:
        return draft.spread([default if v is UNSET else v for v in values], np.float64)

    named = draft.values("type")
    free = draft.spread([node.at is not None for node in nodes], np.bool_)
    cell, span = (
        draft.spread([getattr(node, key) for node in nodes], np.int64) for key in ("cell", "span")
    )
    above = [-1 if parent < 0 else int(draft.first[parent]) for parent in draft.parents]
    columns = Columns(
        parent=draft.spread(above, np.int64),
        cell=cell,
        span=span,
        cells=draft.spread([node.cells for node in nodes], np.int64),
        scale=floats([chain.scale for chain in chains], math.nan),
        offset=floats([chain.offset for chain in chains], 0.0),
        turn=np.fmod(floats([node.turn for node in nodes], 0.0), 360.0),
        type=draft.spread([types[name] for name in named], np.int64),
        surface=draft.spread([surfaces[node.surface] for node in nodes], np.int64),
        classes=draft.spread(classes.tolist(), np.int64),
        free=free,
        place=np.cumsum(free) - 1,
    )
    copied = [
        (int(row), node.copies)
        for row, node in zip(draft.first.tolist(), nodes, strict=False)
        if node.copies is not None and node.at is None
    ]
    if copied:
        cell, span = cell.copy(), span.copy()
    for row, own in copied:
        for axis in (0, 1):
            far = int(own.step[axis]) * (own.counts[axis] - 1)
            cell[row, axis] += min(far, 0)
            span[row, axis] += abs(far)
    factors = floats([chain.factor for chain in chains], 1.0)
    return columns, columns._replace(cell=cell, span=span), factors


def _free_places(draft: _Draft) -> tuple[NDArray[Any], NDArray[Any]]:
    """Places of free elements in the order of rows, and the remainders of their doubles, PLACE."""
    free = [node for node in draft.nodes if node.at is not None]
    counts = [node.rows for node in free]
    places, rests = np.zeros(sum(counts), PLACE), np.zeros(sum(counts), PLACE)
    typed = np.zeros(len(places), np.bool_)
    for node, end in zip(free, np.cumsum(counts, dtype=np.int64).tolist(), strict=True):
        rows = slice(end - node.rows, end)
        places["at"][rows], places["extent"][rows] = node.at, node.extent
        if node.rests is None:
            typed[rows] = True
        else:
            rests["at"][rows] = node.rests  # sizes are drawn as doubles
    for name in ("at", "extent"):
        rests[name][typed] = rests_of(places[name][typed])
    return places, rests


def _copies(draft: _Draft, node_of: Ints) -> tuple[NDArray[Any], Ints]:
    """COPIES, and the index of each element's copies, int64; entry 0 is a single copy."""
    known: dict[Any, int] = {None: 0}
    of = np.array([known.setdefault(node.copies, len(known)) for node in draft.nodes], np.int64)
    copies = np.zeros(len(known), COPIES)
    copies["count"] = 1
    for copy, index in known.items():
        if copy is not None:
            pitch = [side(step) for step in copy.step]
            copies[index] = copy.step, pitch, copy.counts, copy.across
    return copies, of[node_of]


def _leaves(
    runs: Runs, columns: Columns, draft: _Draft, node_of: Ints, plain: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Mask of grids that count as grids of leaves, as in the field with parts written out.

    That field rounds slopes differently in grids of leaves.
    """
    first = runs.first
    own = np.array([node.many for node in draft.nodes], np.int64)[node_of]
    others = slice(1, first[1] if len(first) > 1 else None)  # roots of other templates
    own[others] = 0
    plain = plain.copy()
    plain[others] = True
    leaves = np.logical_and.reduceat(plain, first)
    often = [draft.often[node] for node in node_of[first].tolist()]
    return leaves & dense_runs(columns, first, np.add.reduceat(own, first), often)


class _NodeNumbers(NamedTuple):
    """Numbers of the elements of templates, by their nodes.

    Attributes:
        firsts: number of the first copy of each node, or of each of its scattered copies, among its
            siblings and the elements in them.
        each: number of elements of each copy, itself included.
        inside: number of elements in the cell of each node.
        depth: levels in the cell of each node.
    """

    firsts: list[Sequence[int]]
    each: list[int]
    inside: list[int]
    depth: list[int]


def _number(draft: _Draft, order: Ints, plan: Blueprint) -> tuple[NDArray[Any], Tally]:
    """Number all elements, parents before children, siblings in the order of the text.

    Args:
        draft: the elements.
        order: (rows,) the row of each element of the field.
        plan: the templates.
    """
    nodes, roots = draft.nodes, len(plan.templates)
    children: list[list[int]] = [[] for _ in nodes]
    for index in range(roots, len(nodes)):
        if nodes[index].rows:
            children[draft.parents[index]].append(index)
    for siblings in children:
        siblings.sort(key=lambda child: _document(nodes[child]))
    within = [index if children[index] else node.inner for index, node in enumerate(nodes)]
    found = _numbers(draft, children, within, plan)
    total = 1 + found.inside[0]
    if total > LARGEST_NUMBER:
        raise RequestError(
            f"Parts and copies come to more than {LARGEST_NUMBER:.3g} elements, "
            "and so many are not numbered.",
            "Lower the counts, or leave out the smallest parts.",
        )
    rows = np.zeros(len(order), MEMBER)
    place = rank_of(order)
    members = []
    for index, node in enumerate(nodes):
        own = slice(int(draft.first[index]), int(draft.first[index + 1]))
        rows["first"][own] = _halves(found.firsts[index])
        rows["each"][own] = _halves([found.each[index]])
        row = 0 if node.copies is None else node.copies.counts[node.copies.across]
        families = np.broadcast_to(within[index], node.rows)
        members.append(
            SharedMember(
                int(place[own.start]) if node.rows else -1, found.firsts[index],
                found.each[index], row, node.numbers, node.step, families,
            )
        )  # fmt: skip
    root = SharedMember(0, (0,), total, 0, None, plan.root.step, np.zeros(1, np.int64))
    listed = tuple(tuple(members[child] for child in siblings) for siblings in children)
    return rows[order], Tally(total, (), 1 + found.depth[0], listed, root)


def _numbers(
    draft: _Draft, children: list[list[int]], within: list[Any], plan: Blueprint
) -> _NodeNumbers:
    """Number the elements in the cell of each node, inner ones first.

    Args:
        draft: the elements.
        children: indices of the children of each node, in the order of the text.
        within: node whose children stand in each node, or array of such nodes by scattered copy.
        plan: the templates.
    """
    nodes, count = draft.nodes, len(draft.nodes)
    inside, depth, each = [0] * count, [0] * count, [1] * count
    firsts: list[Sequence[int]] = [(0,)] * count
    for index in _inner_first(plan):
        for child in children[index]:
            node, start = nodes[child], inside[index]
            below = np.unique(within[child]).tolist()
            sizes = {number: 1 + (inside[number] if number >= 0 else 0) for number in below}
            each[child] = max(sizes.values())
            if len(set(sizes.values())) > 1:  # of scattered copies
                own = [sizes[number] for number in within[child].tolist()]
                firsts[child] = list(accumulate(own[:-1], initial=start))
                inside[index] += sum(own)
            else:
                many = node.many * node.rows
                scattered = range(start, start + many * each[child], each[child])
                firsts[child] = (start,) if node.numbers is None else scattered
                inside[index] += many * each[child]
            deepest = max(depth[number] if number >= 0 else 0 for number in below)
            depth[index] = max(depth[index], 1 + deepest)
    return _NodeNumbers(firsts, each, inside, depth)


def _halves(numbers: Sequence[int]) -> NDArray[np.uint64]:
    """Whole numbers of 128 bits as (n, 2) uint64, the lower half first."""
    if isinstance(numbers, range) and numbers.stop <= 1 << 63:
        low = np.arange(numbers.start, numbers.stop, numbers.step).astype(np.uint64)
        return np.column_stack([low, np.zeros_like(low)])
    halves = [(number & 0xFFFFFFFFFFFFFFFF, number >> 64) for number in numbers]
    return np.array(halves, np.uint64).reshape(-1, 2)


def _inner_first(plan: Blueprint) -> Iterator[int]:
    """Yield the indices of all nodes, children before their parents."""
    end = len(plan.templates) + sum(len(template.nodes) for template in plan.templates)
    for root in range(len(plan.templates) - 1, -1, -1):
        begin = end - len(plan.templates[root].nodes)
        yield from range(end - 1, begin - 1, -1)
        yield root
        end = begin


def _document(node: BlueprintNode) -> int:
    """Return the place of an element among its siblings in the text."""
    return int(node.step[0].removeprefix("/children/").partition("[")[0])
