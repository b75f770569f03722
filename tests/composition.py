"""A slow, plain reading of libraries, parts and copies, for the tests to compare with.

Texts of several files become one definition without `use`, `parts`, `part`, `repeat` and `scatter`:
what they mean (docs/format.md). No code is shared with the package. Files are taken to be valid.
"""

from __future__ import annotations

import json
import math
import posixpath
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from msgspec import UNSET

from terratool.definition.model import Scatter
from tests.decimals import meant
from tests.scattering import slowly

Json = dict[str, Any]
Texts = dict[str, str]
"""JSON texts by the paths of their files, with forward slashes, relative to one folder."""
DICTIONARIES = ("surfTypes", "elemTypes", "parts")


@dataclass(frozen=True)
class Plain:
    """What files mean.

    Attributes:
        definition: with elements of primitives alone; what depends on the place is written out,
            and places are fractions.
        names: what a query calls each element, by its pointer in the definition.
    """

    definition: Json
    names: dict[str, str]


@dataclass(frozen=True)
class Around:
    """What is around an element: all in whole numbers and fractions.

    Attributes:
        home: the file that its text stands in.
        factor: on all its heights, from the parts that it is in.
        quarters: clockwise turns of all of these.
        sides: of its own cell, as it lies in the terrain.
        name: its own, as far as the text that it stands in.
        pointer: in the plain definition.
    """

    home: str
    factor: Fraction
    quarters: int
    sides: tuple[Fraction, Fraction]
    name: str
    pointer: str


def scatter_of(value: Json) -> Scatter:
    """What a text asks for."""
    return Scatter(
        sizes=(float(value["sizes"][0]), float(value["sizes"][1])), count=value["count"],
        seed=value.get("seed", 0), turned=value.get("turned", False),
        distance=float(value["distance"]) if "distance" in value else UNSET,
    )  # fmt: skip


_HEIGHTS = ("thickness", "height", "vScale", "vOffset")
"""Keys of decks and bores that factors multiply."""


def both(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value, value]


@dataclass
class Reading:
    """Files that are read as one terrain, the first of them."""

    files: dict[str, Json]
    main: str
    names: dict[str, str] = field(default_factory=dict)

    def libraries(self) -> list[str]:
        """All files that are used, each once."""
        found: list[str] = []
        pending = [self.main]
        while pending:
            user = pending.pop(0)
            for path in self.files[user].get("use", []):
                library = posixpath.normpath(posixpath.join(posixpath.dirname(user), path))
                if library not in found:
                    found.append(library)
                    pending.append(library)
        return found

    def known(self, dictionary: str) -> dict[str, tuple[Any, str]]:
        """Each name with its value, and the file that it stands in: the terrain's own wins."""
        found: dict[str, tuple[Any, str]] = {}
        for file in [*self.libraries(), self.main]:
            for name, value in self.files[file].get(dictionary, {}).items():
                found[name] = (value, file)
        return found

    def terrain(self) -> Plain:
        text = self.files[self.main]
        self.parts = self.known("parts")
        x, y = both(text["size"])
        self.size = meant(x), meant(y)
        found = {key: value for key, value in text.items() if key not in (*DICTIONARIES, "use")}
        for dictionary in ("surfTypes", "elemTypes"):
            found[dictionary] = {name: v for name, (v, _) in self.known(dictionary).items()}
        root = Around(self.main, Fraction(1), 0, self.size, "/elemTree", "/elemTree")
        found["elemTree"] = self.written(text["elemTree"], {}, root)
        return Plain(found, self.names)

    def written(self, node: Json, place: Json, around: Around) -> Json:
        """An element, in a place, and all below it."""
        stands = [(node, around.home)]
        name = around.name
        while "part" in stands[-1][0]:
            outer, home = stands[-1]
            inner, file = self.parts[outer["part"]]
            there = posixpath.relpath(file, posixpath.dirname(self.main) or ".") + "#"
            spelled = outer["part"].replace("~", "~0").replace("/", "~1")
            name += f">{there if file != home else ''}/parts/{spelled}"
            stands.append((inner, file))
        root, home = stands.pop()
        self.names[around.pointer] = name
        w, h = around.sides
        factor, quarters = Fraction(1), 0
        offset, surface = Fraction(root.get("vOffset", 0)), root.get("surface")
        for one, _ in reversed(stands):
            offset = offset * Fraction(one.get("vScale", 1)) + Fraction(one.get("vOffset", 0))
            factor *= Fraction(one.get("vScale", 1))
            quarters += int(one.get("turnDeg", 0)) // 90
            surface = one.get("surface") if surface is None else surface
        factor, quarters = factor * around.factor, (quarters + around.quarters) % 4
        scale = Fraction(root.get("vScale", min(w / self.size[0], h / self.size[1])))
        grid = both(root.get("cells", 10))
        found = {
            **place,
            "type": root["type"],
            "vScale": float(scale * factor),
            "vOffset": float(offset * around.factor),
            "turnDeg": float((Fraction(root.get("turnDeg", 0)) + 90 * quarters) % 360),
            "cells": grid[::-1] if quarters % 2 else grid,
        }
        said = [one["descr"] for one, _ in [*stands, (root, home)] if "descr" in one]
        found |= {"descr": said[0]} if said else {}
        found |= {} if surface is None else {"surface": surface}
        found |= {"surfaceGrid": root["surfaceGrid"]} if "surfaceGrid" in root else {}
        for key in ("deck", "bore"):
            if key in root:
                storey = root[key] | (
                    {}
                    if not {"under", "roof"} & root[key].keys()
                    else {"vScale": root[key].get("vScale", 1)}
                )
                found[key] = {
                    name: float(Fraction(value) * factor) if name in _HEIGHTS else value
                    for name, value in storey.items()
                }
        below = Around(home, factor, quarters, around.sides, name, around.pointer)
        children = [
            child
            for index, inner in enumerate(root.get("children", []))
            for child in self.copies(inner, index, grid, below)
        ]
        if children:
            found["children"] = []
        for index, (inner, here, its) in enumerate(children):
            pointer = f"{around.pointer}/children/{index}"
            its = Around(its.home, its.factor, its.quarters, its.sides, its.name, pointer)
            found["children"].append(self.written(inner, here, its))
        return found

    def copies(
        self, node: Json, index: int, grid: list[int], parent: Around
    ) -> Iterator[tuple[Json, Json, Around]]:
        """A child as often as it is repeated: its text, its place and what is around it."""
        if "scatter" in node:
            yield from self.scattered(node, index, grid, parent)
            return
        repeat = node.get("repeat", {"count": [1, 1], "step": [0, 0]})
        for j in range(repeat["count"][1]):
            for i in range(repeat["count"][0]):
                shift = [meant(repeat["step"][0]) * i, meant(repeat["step"][1]) * j]
                name = f"{parent.name}/children/{index}" + f"[{i},{j}]" * ("repeat" in node)
                if "at" in node:
                    place, sides = self.free_place(node, shift, parent)
                else:
                    place, sides = self.block(node, shift, grid, parent)
                yield (
                    node, place,
                    Around(parent.home, parent.factor, parent.quarters, sides, name, ""),
                )  # fmt: skip

    def scattered(
        self, node: Json, index: int, grid: list[int], parent: Around
    ) -> Iterator[tuple[Json, Json, Around]]:
        """The copies of a scattered child: all heights of each are multiplied by its size."""
        if "at" in node:
            sides = [meant(side) for side in both(node["extent"])]
            corner = [meant(at) - side / 2 for at, side in zip(node["at"], sides, strict=True)]
        else:
            whole = parent.sides[::-1] if parent.quarters % 2 else parent.sides
            pitch = [side / n for side, n in zip(whole, grid, strict=True)]
            sides = [one * n for one, n in zip(pitch, node.get("span", [1, 1]), strict=True)]
            corner = [pitch[0] * node["cellX"], pitch[1] * node["cellY"]]
        turn = node.get("turnDeg", 0)
        found = slowly(
            scatter_of(node["scatter"]), (float(sides[0]), float(sides[1])),
            by_quarters="part" in node, tilted=turn % 90 != 0,
        )  # fmt: skip
        for copy in found:
            own = {"vScale": 1, **node, "turnDeg": math.fmod(turn, 360) + copy.turn}
            at = [corner[axis] + Fraction(copy.middle[axis]) for axis in (0, 1)]
            free = {"at": at, "extent": Fraction(copy.side)}
            place, its = self.free_place(free, [Fraction(0), Fraction(0)], parent)
            factor = parent.factor * Fraction(copy.side)
            name = f"{parent.name}/children/{index}[{copy.number}]"
            yield own, place, Around(parent.home, factor, parent.quarters, its, name, "")

    def free_place(
        self, node: Json, shift: list[Fraction], parent: Around
    ) -> tuple[Json, tuple[Fraction, Fraction]]:
        """Its middle turns with the part around the middle of the parent's cell.

        Its own sides stay as they are, as its own turn grows.
        """
        w, h = parent.sides
        if parent.quarters % 2:  # in the part the cell lay the other way
            w, h = h, w
        x = meant(node["at"][0]) + shift[0] - w / 2
        y = meant(node["at"][1]) + shift[1] - h / 2
        for _ in range(parent.quarters):
            x, y = y, -x
        at = [parent.sides[0] / 2 + x, parent.sides[1] / 2 + y]
        sides = [meant(side) for side in both(node["extent"])]
        return {"at": at, "extent": node["extent"]}, (sides[0], sides[1])

    def block(
        self, node: Json, shift: list[Fraction], grid: list[int], parent: Around
    ) -> tuple[Json, tuple[Fraction, Fraction]]:
        """Its cells turn with the part; a quarter at a time: what was west is north then."""
        x, y = node["cellX"] + int(shift[0]), node["cellY"] + int(shift[1])
        w, h = node.get("span", [1, 1])
        columns, rows = grid
        for _ in range(parent.quarters):
            x, y, w, h = y, columns - x - w, h, w
            columns, rows = rows, columns
        sides = parent.sides[0] * w / columns, parent.sides[1] * h / rows
        return {"cellX": x, "cellY": y, "span": [w, h]}, sides


def plain(texts: Texts, main: str) -> Plain:
    """What files mean, of which one is a terrain."""
    return Reading({path: json.loads(text) for path, text in texts.items()}, main).terrain()


def count(texts: Texts, main: str) -> int:
    """How many elements they come to, without writing them out."""
    reading = Reading({path: json.loads(text) for path, text in texts.items()}, main)
    parts = reading.known("parts")
    known: dict[str, int] = {}

    def of(node: Json) -> int:
        if "part" in node:
            name = node["part"]
            if name not in known:
                known[name] = of(parts[name][0])
            return known[name]
        total = 1
        for child in node.get("children", []):
            nx, ny = child.get("repeat", {}).get("count", [1, 1])
            total += child.get("scatter", {}).get("count", nx * ny) * of(child)
        return total

    return of(reading.files[main]["elemTree"])
