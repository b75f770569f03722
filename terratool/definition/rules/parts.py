"""Rules on parts, and on elements that stand for them."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.model import LARGEST, SMALLEST
from terratool.definition.part_sizes import PLACES
from terratool.definition.rules.base import Subject, rule
from terratool.definition.rules.names import NameHints
from terratool.definition.tree import PARTS, part_pointer
from terratool.definition.uses import MAX_DEPTH
from terratool.text.display import escape, quote


@rule("TT707", "unknown-part")
def unknown_part(subject: Subject) -> Iterator[Remark]:
    """The part of an element is a name that parts does not have, here or in a library.

    While a library is missing, nothing is said.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"crate": {"type": "box"}},
          "elemTree": {
            "type": "box",
            "children": [
              {"cellX": 0, "cellY": 0, "part": "crate"}, {"cellX": 1, "cellY": 0, "part": "Crate"}
            ]
          }
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"crate": {"type": "box"}},
          "elemTree": {"type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "crate"}]}
        }

    To mend: write a name that is there, in the same case, or add the part or its library.
    """
    parts = subject.uses.names.parts
    if subject.lacks_library:
        return
    missing = subject.tree.distinct("part") - parts.keys() - {UNSET}
    hints = NameHints(parts, "parts")
    for index, name in subject.tree.elements_with("part", missing):
        if name in subject.primitives:
            message = f"{quote(name)} is a primitive, where a part belongs."
            hint, fix = f'Write "type": {quote(name)} in place of "part".', ""
        else:
            message, (hint, fix) = f"no part is called {quote(name)}.", hints[name]
        yield Remark("/part", message, hint, element=index, fix=fix)


@rule("TT708", "part-circle")
def part_circle(subject: Subject) -> Iterator[Remark]:
    """A part contains itself, directly or through other parts.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"tower": {
            "type": "box", "children": [{"cellX": 4, "cellY": 4, "part": "tower"}]
          }},
          "elemTree": {"type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "tower"}]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"tower": {"type": "box", "children": [{"cellX": 4, "cellY": 4, "part": "top"}]},
            "top": {"type": "box"}
          },
          "elemTree": {"type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "tower"}]}
        }

    To mend: take the part out of itself.
    """
    uses, tree = subject.uses, subject.tree
    if not uses.circles:
        return
    own = {part_pointer(name): name for name in subject.definition.assemblies}
    for index, name in tree.elements_with("part", uses.circles):
        outer = own.get(tree.roots[tree.root_of[index]])
        if outer is not None and uses.circle_of[name] == uses.circle_of.get(outer):
            through = "itself" if outer == name else f"{quote(name)}, which contains it"
            yield Remark(
                "/part",
                f"the part {quote(outer)} contains {through}.",
                "Take it out, or put another part there.",
                element=index,
            )


@rule("TT709", "beside-part")
def beside_part(subject: Subject) -> Iterator[Remark]:
    """An element with a part has a type, a surfaceGrid, a deck, cells or children as well.

    The part says what stands there, and what stands on it. Beside it may be the keys of its place,
    descr, surface, vScale, vOffset and turnDeg. The root of the part may be a deck or a bore.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"crate": {"type": "box"}},
          "elemTree": {
            "type": "box", "children": [{"cellX": 0, "cellY": 0, "type": "box", "part": "crate"}]
          }
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"crate": {"type": "box"}},
          "elemTree": {"type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "crate"}]}
        }

    To mend: remove the key, or write the part out there.
    """
    tree = subject.tree
    if tree.distinct("part") == {UNSET}:
        return
    for index, part in enumerate(tree.column("part")):
        if part is UNSET:
            continue
        for key, name in (
            ("type", "type"), ("surfaceGrid", "surface_grid"), ("deck", "deck"), ("bore", "bore"),
            ("cells", "cells"), ("children", "children"),
        ):  # fmt: skip
            if tree.value(name, index) is not UNSET:
                message = f'the element has "{key}" beside "part".'
                hint = f'Remove "{key}", or write the part out here.'
                yield Remark(f"/{key}", message, hint, on_key=True, element=index)


@rule("TT710", "part-turn")
def part_turn(subject: Subject) -> Iterator[Remark]:
    """A part is turned by other than a multiple of 90 degrees.

    A part turns as a whole, with all cells in it, and cells stay aligned with the axes.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"crate": {"type": "box"}},
          "elemTree": {
            "type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "crate", "turnDeg": 45}]
          }
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"crate": {"type": "box"}},
          "elemTree": {
            "type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "crate", "turnDeg": 270}]
          }
        }

    To mend: turn it by 0, 90, 180 or 270, or turn the elements in it.
    """
    tree = subject.tree
    if tree.distinct("part") == {UNSET}:
        return
    for index, (part, turn) in enumerate(
        zip(tree.column("part"), tree.column("turn_deg"), strict=True)
    ):
        if part is not UNSET and turn is not UNSET and turn % 90 != 0:
            yield Remark(
                "/turnDeg",
                f"a part is turned by {quote(turn)} degrees, which is no multiple of 90.",
                "Turn it by 0, 90, 180 or 270, or turn the elements in it.",
                element=index,
            )


@rule("TT715", "beyond-limits")
def beyond_limits(subject: Subject) -> Iterator[Remark]:
    """The factors of parts in parts, their depth or their sizes go beyond what is computed.

    The vScale of an element is a factor on every vScale and vOffset of the part in it, and so on in
    parts in parts; what comes out may be up to 1e30. The thickness of a deck and the height of a
    bore, to which it applies as well, stay above 0. Up to 1,000 parts may stand in one another.
    Parts with free places in them may stand in up to 10,000 sizes, with 200,000 cells around these
    places in all; cells of one size in a part count once.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {
            "low": {"type": "box"},
            "high": {"type": "box", "children": [
              {"cellX": 0, "cellY": 0, "part": "low", "vScale": 1e20}
            ]}
          },
          "elemTree": {
            "type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "high", "vScale": 1e20}]
          }
        }

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"shelf": {"type": "box", "vScale": 1, "deck": {"thickness": 0.05}}},
          "elemTree": {
            "type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "shelf", "vScale": -1}]
          }
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {
            "low": {"type": "box"},
            "high": {"type": "box", "children": [
              {"cellX": 0, "cellY": 0, "part": "low", "vScale": 2}
            ]}
          },
          "elemTree": {
            "type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "high", "vScale": 3}]
          }
        }

    To mend: lower the factors, or give the part the same size in more places.
    """
    uses = subject.uses
    if uses.circles:
        return
    for index, name in subject.tree.elements_with("part", uses.known_parts):
        if uses.depths[name] > MAX_DEPTH:
            yield Remark(
                "/part",
                f"with {quote(name)}, {uses.depths[name]:,} parts stand in one another, "
                f"and more than {MAX_DEPTH:,} are not read.",
                "Write some of them out where they stand.",
                element=index,
            )
    if subject.is_library or subject.definition.size is UNSET:
        return
    if subject.place_sizes is not None and not subject.place_sizes.complete:
        yield Remark(
            PARTS,
            f"parts with free places stand in more than {PLACES.sizes:,} sizes, or more than "
            f"{PLACES.cells:,} cells in them have sides of their own.",
            "Give the part the same size in more places.",
        )
    for use, bounds in uses.height_bounds():
        if not bounds.thinnest >= SMALLEST:
            yield Remark(
                "/part",
                f"with the factors of heights here, a deck or a bore in the part {quote(use.part)} "
                f"would be {bounds.thinnest:.4g} thick.",
                "Write a larger vScale, here or in the part.",
                element=use.element,
            )
        if not bounds.largest <= LARGEST:  # true for NaN, too
            yield Remark(
                "/part",
                f"heights within the part {quote(use.part)} go beyond 1e30 here.",
                "Lower vScale here or in the part.",
                element=use.element,
            )


@rule("TT717", "unused-part", "warning")
def unused_part(subject: Subject) -> Iterator[Remark]:
    """A part stands nowhere in the terrain.

    Parts of libraries may wait for those who need them; a terrain's own are for itself. While a
    library is missing, nothing is said.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"crate": {"type": "box"}},
          "elemTree": {"type": "box"}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "parts": {"crate": {"type": "box"}},
          "elemTree": {"type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "crate"}]}
        }

    To mend: remove it, or let an element stand for it.
    """
    uses = subject.uses
    if not uses.has_root or uses.has_unknown_part or subject.lacks_library:
        return
    for name in subject.definition.assemblies:
        if name not in uses.parts_in_use:
            yield Remark(
                f"/parts/{escape(name)}",
                f"no element stands for the part {quote(name)}.",
                'Remove it, or name it by "part".',
                on_key=True,
            )
