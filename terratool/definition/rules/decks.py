"""Rules on the heights and places of decks and bores."""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections.abc import Iterator
from functools import cached_property
from heapq import heappop, heappush
from itertools import pairwise, product
from typing import Any, NamedTuple

from msgspec import UNSET

from terratool.definition.cell_kinds import cell_kinds, default_scales
from terratool.definition.curves import GridShape, shape_of
from terratool.definition.findings import Bounds, Remark
from terratool.definition.model import FACES, Deck, Pair, Primitive, Storey
from terratool.definition.rules.base import Subject, rule, short_pointer, storeys_of
from terratool.definition.summaries import Range, combine_values, curve_values, value_range
from terratool.definition.tree import ROOT, Tree
from terratool.definition.turning import turned_shape
from terratool.definition.uses import Root
from terratool.text.display import quote

_SAMPLES = 32
"""Points along each side of a footprint at which both faces are compared."""
_MOST = 1000
"""Most pairs of faces that are compared, and most copies of a deck that are looked at."""
_MOST_PAIRS = 1_000_000
"""Most pairs of decks, or of decks and segments of tracks, that are compared."""
_CLOSE = 1e-9


class _Heights:
    """Own heights of decks and bores, counted from what they count from; without their children."""

    def __init__(self, subject: Subject) -> None:
        self._subject, self._tree = subject, subject.tree
        self._sampled: dict[str, list[float]] = {}

    @cached_property
    def _defaults(self) -> list[float]:
        """Default vScale in each kind of cells."""
        return list(default_scales(cell_kinds(self._tree), self._subject.definition.extent))

    def numbers(self, index: int) -> Pair | None:
        """Factor and offset of an element; None where the place decides, or a value is wrong."""
        tree, subject = self._tree, self._subject
        if subject.left_out(index, "vScale", "vOffset") or self.shape(index) is None:
            return None
        scale, offset = tree.value("v_scale", index), tree.value("v_offset", index)
        if scale is UNSET and tree.value("scatter", index) is not UNSET:
            scale = 1.0
        if scale is UNSET:
            in_part = tree.roots[tree.root_of[index]] != ROOT
            if in_part or subject.is_library or subject.definition.size is UNSET:
                return None
            scale = self._defaults[cell_kinds(tree).of[index]]
        return scale, 0.0 if offset is UNSET else offset

    def shape(self, index: int) -> str | None:
        """Primitive of an element; None where it is not known or has errors."""
        name = self._tree.value("type", index)
        return name if name in self._subject.summaries else None

    def range(self, name: str, numbers: Pair) -> Range:
        """Least and largest height of a primitive; NaN where its raster is not read."""
        ends = [numbers[0] * value + numbers[1] for value in self._value_range(name)]
        return min(ends), max(ends)

    def _value_range(self, name: str) -> Range:
        return value_range(self._subject.summaries[name])

    def samples(self, name: str) -> list[float]:
        """Values of a primitive over its footprint, row by row; NaN for none."""
        if name not in self._sampled:
            self._sampled[name] = list(_values(self._subject.primitives[name]))
        return self._sampled[name]


def _face_numbers(storey: Storey) -> Pair:
    """Factor and offset of the primitive of the other face."""
    scale, offset = storey.v_scale, storey.v_offset
    return 1.0 if scale is UNSET else scale, 0.0 if offset is UNSET else offset


def _values(primitive: Primitive) -> Iterator[float]:
    """Yield values of a primitive at evenly spaced points of the unit square, row by row."""
    shape = shape_of(primitive)
    times = [(k + 0.5) / _SAMPLES for k in range(_SAMPLES)]
    x = curve_values(shape.x)
    y = x if shape.y is None else curve_values(shape.y)
    for v, u in product(times, times):
        if shape.grid is not None:
            yield _grid_value(shape.grid, u, v)
        elif shape.y is None:
            rho = math.hypot(2 * u - 1, 2 * v - 1)
            yield x(0.5 + rho / 2) if rho <= 1 else math.nan
        else:
            yield combine_values(shape.combine, x(u), y(v))


def _grid_value(grid: GridShape, u: float, v: float) -> float:
    """Value of a grid between its numbers; NaN beside a void one, and for a file."""
    if not grid.rows:
        return math.nan
    pixel, rows = grid.registration == "pixel", grid.rows[::-1]  # from the south
    counts = len(rows[0]), len(rows)
    firsts, parts = [], []
    for t, count in zip((u, v), counts, strict=True):
        place = t * count - 0.5 if pixel else t * (count - 1)
        place = min(max(place, 0.0), count - 1.0)
        firsts.append(min(int(place), max(count - 2, 0)))
        parts.append(place - firsts[-1])
    (i, j), (a, b) = firsts, parts
    after = min(i + 1, counts[0] - 1), min(j + 1, counts[1] - 1)
    corners = [rows[y][x] for y in (j, after[1]) for x in (i, after[0])]
    south_west, south_east, north_west, north_east = (
        math.nan if one is None else one for one in corners
    )
    south = (1 - a) * south_west + a * south_east
    return (1 - b) * south + b * ((1 - a) * north_west + a * north_east)


@rule("TT220", "crossed-faces", "warning")
def crossed_faces(subject: Subject) -> Iterator[Remark]:
    """The underside of a deck is above its own top, or the ceiling of a bore below its own floor.

    There is no deck there, and nothing is cut. That can be meant, as for a rock that ends where
    both faces meet; mostly a height is missing. Both faces are compared at 32 × 32 points of the
    footprint, without what stands on the element. Heights of rasters are not read, elements in
    parts are looked at where they have a vScale, and 1,000 different pairs of faces at most.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}, "arch": {"x": "dome"}},
          "elemTree": {"type": "box", "children": [{
            "cellX": 2, "cellY": 1, "type": "box", "vScale": 3,
            "deck": {"under": "arch", "vScale": 2.5, "vOffset": 1}
          }]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}, "arch": {"x": "dome"}},
          "elemTree": {"type": "box", "children": [{
            "cellX": 2, "cellY": 1, "type": "box", "vScale": 4,
            "deck": {"under": "arch", "vScale": 2.5, "vOffset": 1}
          }]}
        }

    To mend: raise the top, or lower the vScale or vOffset of the other face.
    """
    heights = _Heights(subject)
    shares: dict[tuple[str, str, Pair, Pair, bool], float] = {}
    for index, key, storey in storeys_of(subject.tree):
        own, numbers = heights.shape(index), heights.numbers(index)
        face = storey.face if storey.gap is UNSET else UNSET
        if own is None or numbers is None or face is UNSET or face not in subject.summaries:
            continue
        is_deck = isinstance(storey, Deck)
        pair = own, face, numbers, _face_numbers(storey), is_deck
        if pair not in shares:
            if len(shares) >= _MOST:
                continue
            shares[pair] = _crossed_share(heights, *pair)
        if shares[pair] > 0:
            faces = f"the underside {quote(face)} is above the deck's own top"
            if not is_deck:
                faces = f"the ceiling {quote(face)} is below the bore's own floor"
            share = f"{100 * shares[pair]:.2g}" if shares[pair] < 1 else "100"
            what = "no deck is" if is_deck else "nothing is cut"
            yield Remark(
                f"/{key}/{FACES[type(storey)]}",
                f"{faces} on {share} % of the footprint, where {what}.",
                f'Change "vOffset" or "vScale" in "{key}", or those beside it.',
                element=index,
            )


def _crossed_share(
    heights: _Heights, own: str, face: str, numbers: Pair, others: Pair, is_deck: bool
) -> float:
    """Share of a footprint on which the other face lies on the wrong side."""
    low, high = heights.range(own, numbers)
    least, most = heights.range(face, others)
    if (most <= low) if is_deck else (least >= high):
        return 0.0
    way = 1.0 if is_deck else -1.0
    slack = _CLOSE * max(abs(low), abs(high), abs(least), abs(most))
    known = crossed = 0
    for a, b in zip(heights.samples(own), heights.samples(face), strict=True):
        above = way * (others[0] * b + others[1] - numbers[0] * a - numbers[1])
        known += above == above
        crossed += above > slack
    return crossed / known if known else 0.0


@rule("TT221", "datum-height", "warning")
def datum_height(subject: Subject) -> Iterator[Remark]:
    """A deck or bore with datum has neither vOffset nor vScale, so its height is that of its cell.

    Its heights count from 0, and not from what it stands on. Without a number of its own it lies at
    the default height, the side of its cell by that of the terrain, which says nothing of where a
    bridge is. The root of a part may get its vOffset where the part stands, and is not looked at.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "deck": {"thickness": 0.3, "datum": true}}
          ]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{
            "cellX": 2, "cellY": 1, "type": "box", "vScale": 3,
            "deck": {"thickness": 0.3, "datum": true}
          }]}
        }

    To mend: give vOffset, or vScale, beside the deck or bore.
    """
    tree = subject.tree
    for index, key, storey in storeys_of(tree):
        if storey.datum is not True or tree.parents[index] < 0:
            continue
        given = {tree.value(name, index) for name in ("v_scale", "v_offset", "scatter")}
        if given == {UNSET} and not subject.left_out(index, "vScale", "vOffset"):
            yield Remark(
                f"/{key}/datum",
                f'the {key} counts from 0, and has neither "vOffset" nor "vScale".',
                f'Write the height that is meant beside "{key}".',
                element=index,
            )


class _Slab(NamedTuple):
    """Copy of a deck that is solid all over between two heights.

    Attributes:
        box: west, south, east, north in the parent's grid, or from the corner of its cell.
        base: whether the heights count from 0, and whether the box is at a free place.
        low: greatest height of the underside.
        high: least height of the top.
        element: element of the deck.
    """

    box: Bounds
    base: tuple[bool, bool]
    low: float
    high: float
    element: int


@rule("TT222", "overlapping-decks", "warning")
def overlapping_decks(subject: Subject) -> Iterator[Remark]:
    """Two decks in one parent overlap in place and in height.

    Where they do they are one body, of which the higher top and the lower underside count. Decks
    above one another in one cell are no fault. What is told is sure: compared are rectangles in
    cells, or at free places, without turns but by quarters, between the highest place of the
    underside and the lowest of the top. Scattered decks are not looked at, nor are more than a
    million pairs in one parent.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "vScale": 3, "deck": {"thickness": 0.3}},
            {"cellX": 2, "cellY": 1, "type": "box", "vScale": 3.2, "deck": {"thickness": 0.3}}
          ]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "vScale": 3, "deck": {"thickness": 0.3}},
            {"cellX": 2, "cellY": 1, "type": "box", "vScale": 6, "deck": {"thickness": 0.3}}
          ]}
        }

    To mend: move one of the two, or change its height. Where it is meant, silence TT222 by
    x-ignore.
    """
    tree, heights = subject.tree, _Heights(subject)
    families: dict[int, list[_Slab]] = {}
    for index, storey in tree.elements_with("deck", tree.distinct("deck") - {UNSET}):
        parent = tree.parents[index]
        if parent >= 0:
            families.setdefault(parent, []).extend(_slabs(subject, heights, index, storey))
    for slabs in families.values():
        for later, earlier in sorted(_overlapping(slabs).items()):
            yield Remark(
                "",
                f"the deck overlaps that of {short_pointer(tree, earlier)} in place and in height.",
                "Move one of the two, or change its height.",
                element=later,
            )


def _slabs(subject: Subject, heights: _Heights, index: int, deck: Deck) -> Iterator[_Slab]:
    """Yield the copies of a deck, if it fills its rectangle and is surely solid somewhere."""
    tree, name, numbers = subject.tree, heights.shape(index), heights.numbers(index)
    if name is None or numbers is None or tree.value("scatter", index) is not UNSET:
        return
    turn = tree.value("turn_deg", index)
    turn = 0.0 if turn is UNSET else turn
    place, summary = tree.place(index), subject.summaries[name]
    if summary.y is None or turn % (180 if place is None else 90) != 0:
        return
    low, high = heights.range(name, numbers)
    if isinstance(deck.thickness, float):
        under = high - deck.thickness
    elif deck.face in subject.summaries:
        under = heights.range(str(deck.face), _face_numbers(deck))[1]
    else:
        return
    if under < low:  # false for NaN, too
        base = deck.datum is True, place is not None
        for box in _boxes(tree, index, turn):
            yield _Slab(box, base, under, low, index)


def _boxes(tree: Tree, index: int, turn: float) -> Iterator[Bounds]:
    """Yield rectangles of an element and its first copies, in cells or units of the terrain."""
    place, repeat = tree.place(index), tree.value("repeat", index)
    if place is None:
        west, south, wide, tall = map(float, tree.block(index))
    else:
        (x, wide), (y, tall) = place
        if turn % 180 != 0:
            wide, tall = tall, wide
        west, south = x - wide / 2, y - tall / 2
    for x, y in _moves(repeat):
        yield west + x, south + y, west + x + wide, south + y + tall


def _moves(repeat: Any) -> Iterator[Pair]:
    """Yield the movements of the copies of an element, of the first one alone where they are many.

    Args:
        repeat: `repeat` of the element; `UNSET` for none.
    """
    if repeat is UNSET or repeat.count[0] * repeat.count[1] > _MOST:
        yield 0.0, 0.0
        return
    for j, i in product(range(repeat.count[1]), range(repeat.count[0])):
        yield i * repeat.step[0], j * repeat.step[1]


def _overlapping(slabs: list[_Slab]) -> dict[int, int]:
    """Decks that overlap an earlier one, each with one of these."""
    found: dict[int, int] = {}
    line: list[tuple[float, int]] = []  # south edge and number of those that a line meets, in order
    ends: list[tuple[float, int]] = []  # where they end, and their numbers
    tallest = max((slab.box[3] - slab.box[1] for slab in slabs), default=0.0)
    pairs = 0
    slabs = sorted(slabs)
    for number, slab in enumerate(slabs):
        west, south, east, north = slab.box
        while ends and ends[0][0] <= west + _CLOSE * (east - west):
            over = heappop(ends)[1]
            del line[bisect_left(line, (slabs[over].box[1], over))]
        near = line[bisect_left(line, (south - tallest, -1)) : bisect_left(line, (north, -1))]
        pairs += len(near)
        if pairs > _MOST_PAIRS:
            break
        for other in (slabs[one] for _, one in near):
            earlier, later = sorted((slab.element, other.element))
            if earlier < later and slab.base == other.base and _share_room(slab, other):
                found[later] = min(found.get(later, earlier), earlier)
        insort(line, (south, number))
        heappush(ends, (east, number))
    return found


def _share_room(one: _Slab, other: _Slab) -> bool:
    """Whether two slabs that overlap along x do so along y and in height."""
    spans = ((a.box[1], a.box[3], a.low, a.high) for a in (one, other))
    (south, north, low, high), (y, top, under, over) = spans
    room = min(north, top) - max(south, y), min(high, over) - max(low, under)
    return room[0] > _CLOSE * (north - south) and room[1] > _CLOSE * (high - low)


@rule("TT608", "track-below-deck", "warning")
def track_below_deck(subject: Subject) -> Iterator[Remark]:
    """The points of a track have no z, and its path runs below a deck.

    Such a track lies on the ground, below whatever stands over it. A wheel that was on the deck has
    points [x, y, z], with about the height of its top. Compared are the middle line of the track
    and the rectangles of decks outside of parts, or of parts that are decks, where no copies are
    scattered, a million pairs of segments and decks at most; whether the deck is clear of the
    ground is not looked at.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "vScale": 3, "deck": {"thickness": 0.3}}
          ]},
          "tracks": [{"path": [[0.5, 1.5], [9, 1.5]], "width": 0.2, "depth": 0.05}]
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "vScale": 3, "deck": {"thickness": 0.3}}
          ]},
          "tracks": [{"path": [[2.2, 1.5, 4], [2.8, 1.5, 4]], "width": 0.2, "depth": 0.05}]
        }

    To mend: give the points a z, or silence TT608 by x-ignore in the track where the ground is
    meant.
    """
    flat = {
        f"/tracks/{index}": track
        for index, track in enumerate(subject.definition.ruts)
        if all(map(math.isnan, track.heights))
    }
    boxes = list(_deck_boxes(subject)) if flat else []
    left = _MOST_PAIRS
    for here, track in flat.items():
        left -= len(boxes) * len(track.points)
        if left < 0 or subject.left_out(here):
            continue
        for index, box in boxes:
            if any(_meets(start, end, box) for start, end in pairwise(track.points)):
                yield Remark(
                    f"{here}/path",
                    f"the track runs below the deck {short_pointer(subject.tree, index)}, and lies "
                    "on the ground there.",
                    "Give its points a z, as [x, y, z], if the wheel was on the deck.",
                )
                break


def _deck_boxes(subject: Subject) -> Iterator[tuple[int, Bounds]]:
    """Yield decks outside of parts and their world rectangles, one for each of the first copies."""
    tree, definition = subject.tree, subject.definition
    for index in sorted(subject.storeys):
        end = subject.uses.end(Root(tree, index, subject.document))
        inside = tree.parents[index] >= 0 and tree.roots[tree.root_of[index]] == ROOT
        if not inside or end is None or tree.value("scatter", index) is not UNSET:
            continue
        cell = tree.rectangle(index, definition)
        if cell is None or not isinstance(end.root.tree.storey(end.root.element), Deck):
            continue
        wide, tall = cell[2] - cell[0], cell[3] - cell[1]
        out, step = (0.0, 0.0), (1.0, 1.0)
        if tree.place(index) is None:
            _, _, columns, rows = tree.block(index)
            step = wide / columns, tall / rows
        else:
            reach = turned_shape((wide, tall), end.turn, is_round=False).reach
            out = reach[0] - wide / 2, reach[1] - tall / 2
        for i, j in _moves(tree.value("repeat", index)):
            x, y = i * step[0], j * step[1]
            yield index, (
                cell[0] + x - out[0], cell[1] + y - out[1],
                cell[2] + x + out[0], cell[3] + y + out[1],
            )  # fmt: skip


def _meets(start: Pair, end: Pair, box: Bounds) -> bool:
    """Whether a segment has a stretch within a rectangle, by Liang and Barsky (1984)."""
    first, last = 0.0, 1.0
    for axis in (0, 1):
        step = end[axis] - start[axis]
        low, high = box[axis] - start[axis], box[axis + 2] - start[axis]
        if step == 0:
            if not low < 0 < high:
                return False
            continue
        ends = sorted((low / step, high / step))
        first, last = max(first, ends[0]), min(last, ends[1])
    return first < last
