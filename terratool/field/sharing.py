"""From templates to the arrays of a field whose parts are shared, and the names of its elements."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.expand import MAX_ELEMENTS
from terratool.definition.sharing import Blueprint, Node, smallest_cell
from terratool.errors import RequestError
from terratool.field.compile import Compiled
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
    in_order,
    kinds_of,
    mark_plain,
    order_of,
    placed_of,
    poses_of,
    rank_of,
    runs_of,
    surroundings,
)
from terratool.kernels import field as kernels

LARGEST_NUMBER = 1 << 126
"""So many elements are numbered at most."""

MIRRORS = (0, 2, 3, 1)
"""Along which axes so many quarter turns mirror places: 1 for x, 2 for y."""

_SLACK = 8.0
"""The bins of free elements hold this much more than where they are laid absolutely."""


class Member(NamedTuple):
    """An element of a template, and which number it has.

    Attributes:
        element: its index in the field.
        first: the number of its first copy, among its siblings and what is in them.
        each: how many elements each copy comes to.
        row: copies in a row; 0 without `repeat`.
        step: the end of its name, before and after the place among the copies.
        family: the elements in it; -1 for none.
    """

    element: int
    first: int
    each: int
    row: int
    step: tuple[str, str]
    family: int


class Tally(NamedTuple):
    """What a shared terrain comes to.

    Attributes:
        elements: all elements.
        by_kind: of each kind.
        levels: of nesting.
        families: the elements in each element of the text, by `Member.family`.
        root: the element of the terrain.
    """

    elements: int
    by_kind: tuple[int, ...]
    levels: int
    families: tuple[tuple[Member, ...], ...]
    root: Member

    def way(self, number: int) -> list[tuple[Member, int]]:
        """The members that lead to an element by its number, each with the place of its copy."""
        way = [(self.root, 0)]
        while number:
            number -= 1
            members = self.families[way[-1][0].family]
            member = members[bisect_right(members, number, key=lambda one: one.first) - 1]
            copy, number = divmod(number - member.first, member.each)
            way.append((member, copy))
        return way

    def name(self, number: int) -> str:
        """The name of an element by its number."""
        steps = []
        for member, copy in self.way(number):
            before, after = member.step
            place = f"[{copy % member.row},{copy // member.row}]" if member.row else ""
            steps.append(f"{before}{place}{after}")
        return "".join(steps)


class _Draft(NamedTuple):
    """The elements of all templates, one after the other behind their roots."""

    nodes: list[Node]
    parents: list[int]
    levels: list[int]
    below: list[int]  # the element or root whose children stand in each; -1 for none
    quarters: list[int]  # of the template that each is in


def compile_shared(plan: Blueprint, *, roughness: bool = True) -> tuple[Compiled, Tally]:
    """Compile the templates of a terrain; with reliefs or without.

    Raises:
        RequestError: it comes to more elements than can be numbered.
    """
    draft = _draft(plan)
    many = _multiplicities(draft, len(plan.templates))
    definition = plan.definition
    columns, bounding = _columns(draft, plan)
    order, dense = order_of(bounding, draft.levels)
    columns, bounding, dense = in_order(columns, order), in_order(bounding, order), dense[order]
    parents, free = columns.parent, columns.free
    nodes = [draft.nodes[index] for index in order.tolist()]
    many = [many[index] for index in order.tolist()]
    below = np.array(draft.below)[order]
    below = np.where(below >= 0, rank_of(order)[below], -1)

    runs = runs_of(columns)
    grids, owners = runs.grids, runs.owners
    grid_of = np.where(below >= 0, runs.grid_of[below], 0).astype(np.uint32)
    grids["count"] = 1.0
    in_cells = np.flatnonzero(grids["standing"][1:] == IN_CELLS)
    grids["count"][in_cells + 1] = columns.cells[owners[in_cells]]
    # until they are laid, they lie where places are least exact
    corner, extent = np.array(definition.corner, float), np.array(definition.extent, float)
    grids["corner"][:, :, 0] = _SLACK * np.maximum(np.abs(corner), np.abs(corner + extent))
    grids["pitch"][:, :, 0] = _SLACK * extent

    places = _free_places(nodes, free)
    placed = placed_of(bounding._replace(place=np.cumsum(free) - 1), places, grid_of > 0)
    copies, copies_of = _copies(nodes)
    middles = places.copy()
    own_copies = copies[copies_of[free]]
    far = own_copies["step"] * (own_copies["count"] - 1.0)
    middles["at"] += 0.5 * far
    reach = placed.reach + 0.5 * np.abs(far) * (1 + 1e-9)
    placed = placed._replace(places=middles, reach=reach)
    ranges = runs.ranges
    ranges.last[0] = 1  # the other roots are none
    bins = bins_of(runs, ranges, grid_of, placed, dense)
    grids["corner"] = grids["pitch"] = 0.0

    elements = np.zeros(len(parents), ELEMENT)
    elements["cell"] = columns.cell
    elements["cell"][free] = placed.cell[free, :1] >> (0, 16) & 0xFFFF
    elements["scale"] = columns.scale
    elements["offset"] = columns.offset
    elements["grid"] = grid_of
    elements["pose"], poses = poses_of(columns, np.ones(len(parents)))
    found = kinds_of(definition, columns.type, columns.surface)
    elements["kind"] = found.of
    plain = mark_plain(runs, elements, found.kinds, columns.turn)
    grids["leaves"] = _leaves(runs, columns, nodes, many, plain)

    members, tally = _number(nodes, below, parents, plan)
    members["copies"] = copies_of
    mirrors = np.array([MIRRORS[quarters] for quarters in draft.quarters], np.uint8)[order]
    arrays = FieldArrays(
        elements=elements,
        grids=grids,
        poses=poses,
        places=places,
        kinds=found.kinds,
        curves=found.curves,
        voids=bool(found.kinds["is_void"].any()),
        shared=SharingArrays(members, copies, mirrors[runs.first], extent),
        **bins._asdict(),
        **surroundings(definition, roughness=roughness),
    )
    by_kind = [0] * len(found.kinds)
    for kind, count in zip(found.of.tolist(), many, strict=True):
        by_kind[kind] += count
    compiled = Compiled(
        arrays,
        np.zeros(0, np.uint32),
        parents.astype(np.int32),
        smallest_cell(plan),
        tuple(definition.surfaces),
        tally.levels,
        found.primitives,
    )
    return compiled, tally._replace(by_kind=tuple(by_kind))


def refuse_piled(field: kernels.Field, name: str) -> None:
    """Refuse a shared field, of the file of this name, with too many elements over one point.

    Raises:
        RequestError: there are, or may be, more than `MAX_ELEMENTS`.
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
    draft = _Draft(nodes, [-1] * count, [0, count], list(range(count)), quarters)
    for number, template in enumerate(plan.templates):
        start = len(nodes)
        nodes += template.nodes
        draft.levels.extend(start + end for end in template.levels[1:])
        draft.quarters.extend([template.quarters] * len(template.nodes))
        below = [node.inner for node in template.nodes]
        for parent, begin, end in template.families:
            above = number if parent < 0 else start + parent
            draft.parents.extend([above] * (end - begin))
            if parent >= 0:
                below[parent] = start + parent
        draft.below.extend(below)
    return draft


def _multiplicities(draft: _Draft, roots: int) -> list[int]:
    """How often each element stands in the terrain; 0 for the roots of other templates."""
    within = [1] + [0] * (len(draft.nodes) - 1)  # how often what is in an element or root stands
    many = [1] + [0] * (len(draft.nodes) - 1)
    for index in range(roots, len(draft.nodes)):
        many[index] = within[draft.parents[index]] * draft.nodes[index].many
        if draft.below[index] >= 0:
            within[draft.below[index]] += many[index]
    return many


def _columns(draft: _Draft, plan: Blueprint) -> tuple[Columns, Columns]:
    """The elements column by column, of their first copies and of all their copies together."""
    nodes, definition = draft.nodes, plan.definition
    types = {name: i for i, name in enumerate(definition.primitives)}
    surfaces: dict[Any, int] = {name: i for i, name in enumerate(definition.surfaces)}
    surfaces[UNSET] = -1

    scales = [node.chain.scale for node in nodes]
    named = [node.chain.root.tree.value("type", node.chain.root.element) for node in nodes]
    free = np.array([node.at is not None for node in nodes], np.bool_)
    cell = np.array([node.cell for node in nodes], np.int64)
    span = np.array([node.span for node in nodes], np.int64)
    columns = Columns(
        parent=np.array(draft.parents, np.int64),
        cell=cell,
        span=span,
        cells=np.array([node.cells for node in nodes], np.int64),
        scale=np.array([math.nan if scale is UNSET else scale for scale in scales]),
        offset=np.array(
            [0.0 if n.chain.offset is UNSET else n.chain.offset for n in nodes], np.float64
        ),
        turn=np.fmod(np.array([node.turn for node in nodes], np.float64), 360.0),
        type=np.array([types[name] for name in named], np.int64),
        surface=np.array([surfaces[node.surface] for node in nodes], np.int64),
        free=free,
        place=np.cumsum(free) - 1,
    )
    cell, span = cell.copy(), span.copy()
    for index, node in enumerate(nodes):
        if node.copies is not None and node.at is None:
            for axis in (0, 1):
                far = int(node.copies.step[axis]) * (node.copies.counts[axis] - 1)
                cell[index, axis] += min(far, 0)
                span[index, axis] += abs(far)
    return columns, columns._replace(cell=cell, span=span)


def _free_places(nodes: list[Node], free: NDArray[np.bool_]) -> NDArray[Any]:
    places = np.zeros(np.count_nonzero(free), PLACE)
    if len(places):
        places["at"] = [node.at for node in nodes if node.at is not None]
        places["extent"] = [node.extent for node in nodes if node.extent is not None]
    return places


def _copies(nodes: list[Node]) -> tuple[NDArray[Any], Ints]:
    """COPIES, and for each element which of these; the first is one copy."""
    known: dict[Any, int] = {None: 0}
    of = np.array([known.setdefault(node.copies, len(known)) for node in nodes], np.int64)
    copies = np.zeros(len(known), COPIES)
    copies["count"] = 1
    for copy, index in known.items():
        if copy is not None:
            copies[index] = copy.step, copy.counts, copy.across
    return copies, of


def _leaves(
    runs: Runs, columns: Columns, nodes: list[Node], many: list[int], plain: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which grids are of leaves where the terrain is written out: it rounds slopes otherwise."""
    first = runs.first
    own = np.array([node.many for node in nodes], np.int64)
    others = slice(1, first[1] if len(first) > 1 else None)  # roots of other templates
    own[others] = 0
    plain = plain.copy()
    plain[others] = True
    leaves = np.logical_and.reduceat(plain, first)
    often = [many[index] // nodes[index].many for index in first.tolist()]
    return leaves & dense_runs(columns, first, np.add.reduceat(own, first), often)


def _number(
    nodes: list[Node], below: Ints, parents: Ints, plan: Blueprint
) -> tuple[NDArray[Any], Tally]:
    """Number all elements, each before what is in it, siblings in the order of the text."""
    count = len(nodes)
    children: list[list[int]] = [[] for _ in range(count)]
    for index in range(len(plan.templates), count):
        children[parents[index]].append(index)
    first, inside, depth = [0] * count, [0] * count, [0] * count
    for index in _inner_first(plan):
        children[index].sort(key=lambda child: _document(nodes[child]))
        for child in children[index]:
            first[child] = inside[index]
            within = int(below[child])
            each = 1 + (inside[within] if within >= 0 else 0)
            inside[index] += each * nodes[child].many
            depth[index] = max(depth[index], 1 + (depth[within] if within >= 0 else 0))
    total = 1 + inside[0]
    if total > LARGEST_NUMBER:
        raise RequestError(
            f"Parts and copies come to more than {LARGEST_NUMBER:.3g} elements, "
            "and so many are not numbered.",
            "Lower the counts, or leave out the smallest parts.",
        )
    members = np.zeros(count, MEMBER)
    listed: list[list[Member]] = [[] for _ in range(count)]
    root = Member(0, 0, total, 0, plan.root.step, 0)
    for index, node in enumerate(nodes):
        within = int(below[index])
        each = 1 + (inside[within] if within >= 0 else 0)
        members["factor"][index] = node.chain.factor
        members["first"][index] = first[index] & 0xFFFFFFFFFFFFFFFF, first[index] >> 64
        members["each"][index] = each & 0xFFFFFFFFFFFFFFFF, each >> 64
    for index in range(count):
        for child in children[index]:
            node, within = nodes[child], int(below[child])
            each = 1 + (inside[within] if within >= 0 else 0)
            row = 0 if node.copies is None else node.copies.counts[node.copies.across]
            listed[index].append(Member(child, first[child], each, row, node.step, within))
    families = tuple(map(tuple, listed))
    return members, Tally(total, (), 1 + depth[0], families, root)


def _inner_first(plan: Blueprint) -> Iterator[int]:
    """Indices of all elements and roots, those of what is in them before."""
    end = len(plan.templates) + sum(len(template.nodes) for template in plan.templates)
    for root in range(len(plan.templates) - 1, -1, -1):
        begin = end - len(plan.templates[root].nodes)
        yield from range(end - 1, begin - 1, -1)
        yield root
        end = begin


def _document(node: Node) -> int:
    """The place of an element among its siblings."""
    return int(node.step[0].removeprefix("/children/").partition("[")[0])
