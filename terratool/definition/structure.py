"""From plain JSON values to the typed model, with a remark for everything that does not fit.

What does not fit is left out of the model and noted, so that the rules can still look at the rest
and need not complain about what only follows.
"""

from __future__ import annotations

from itertools import chain
from typing import Any

from msgspec import UNSET, UnsetType

from terratool.definition.built import Built, Owner
from terratool.definition.findings import RemarkLog
from terratool.text.display import escape, shown
from terratool.definition.fitting import Decoder, remark_on
from terratool.definition.keys import KEYS
from terratool.definition.model import Definition, Element, Primitive, Surface, Track
from terratool.definition.slots import BIGGEST, NEVER, SLOTS, QuickCheck
from terratool.definition.tree import Tree
from terratool.definition.wording import JSON_NAMES, unknown_key


def build(value: Any, found: RemarkLog) -> Built:
    """Build the model of a parsed JSON value, without recursion over the elements."""
    return _TerrainDecoder(found).build(value)


class _TerrainDecoder(Decoder):
    def build(self, value: Any) -> Built:
        if not isinstance(value, dict):
            self._add(
                "TT105",
                "",
                f"the definition is {JSON_NAMES[type(value)]} where an object is expected.",
                'Write { "size": …, "elemTypes": {…}, "elemTree": {…} }.',
            )
            return self._built
        fields = self._fields(Definition, value, "")
        for key, name, kind in (
            ("surfTypes", "surf_types", Surface),
            ("elemTypes", "elem_types", Primitive),
        ):
            if name in fields:
                fields[name] = self._dictionary(kind, fields[name], f"/{key}")
        if "tracks" in fields:
            fields["tracks"] = self._tracks(fields["tracks"])
        if "elem_tree" in fields:
            self._built.tree = self._tree(fields.pop("elem_tree"))
        self._built.definition = Definition(**fields)
        return self._built

    def _dictionary(self, kind: type, entries: dict[str, Any], pointer: str) -> dict[str, Any]:
        built = {}
        for name, value in entries.items():
            here = f"{pointer}/{escape(name)}"
            if isinstance(value, dict):
                built[name] = kind(**self._fields(kind, value, here))
            else:
                what = "surface" if kind is Surface else "primitive"
                self._wrong_type(here, "", f"the {what} {shown(name)}", "an object", value)
                built[name] = kind()  # the name exists, whatever its value
        return built

    def _tracks(self, values: list[Any]) -> tuple[Track, ...]:
        built = []
        for index, value in enumerate(values):
            here = f"/tracks/{index}"
            if isinstance(value, dict):
                built.append(Track(**self._fields(Track, value, here)))
            else:
                self._wrong_type(here, "", "a track", "an object", value)
                built.append(Track())  # keeps its place
        return tuple(built)

    def _tree(self, root: dict[str, Any]) -> Tree:
        values: list[dict[str, Any]] = []
        families = []
        levels = [0]
        level: list[Any] = [root]
        while level:
            start = len(values)
            if set(map(type, level)) != {dict}:
                level = [self._element(value, index) for index, value in enumerate(level, start)]
            values.extend(level)
            after = len(values)
            levels.append(after)
            broods = [value.get("children", UNSET) for value in level]
            level = []
            if broods.count(UNSET) < len(broods):  # most elements are in the last level
                for index, children in enumerate(broods, start):
                    if isinstance(children, list):
                        begin = after + len(level)
                        level.extend(children)
                        families.append((index, begin, after + len(level)))
                    elif children is not UNSET:
                        wanted = KEYS[Element]["children"].words
                        self._wrong_type(index, "/children", '"children"', wanted, children)
                        self._leave_out(index, "children")
        used = set(chain.from_iterable(values))
        columns = {}
        for key, slot in SLOTS[Element].items():
            if key in used and key != "children":
                columns[slot.name] = [value.get(key, UNSET) for value in values]
                self._mend(key, slot, columns[slot.name])
            else:
                columns[slot.name] = [UNSET] * len(values)
        self._own_keys(used - SLOTS[Element].keys(), values)
        return Tree([], families, levels, columns)

    def _own_keys(self, own: set[str], values: list[dict[str, Any]]) -> None:
        """All keys that elements have besides those of the format."""
        if "x-ignore" in own:
            self._built.ignores += [
                (index, value["x-ignore"])
                for index, value in enumerate(values)
                if "x-ignore" in value
            ]
        own = {key for key in own if not key.startswith("x-")}
        if own:
            remarks = (
                remark_on(
                    index,
                    "/" + escape(key),
                    *unknown_key(Element, key, frozenset(value)),
                    on_key=True,
                )
                for index, value in enumerate(values)
                if not own.isdisjoint(value)
                for key in value
                if key in own
            )
            count = sum(map(own.__contains__, chain.from_iterable(values)))
            self._found.take("TT103", remarks, count)

    def _element(self, value: Any, index: int) -> dict[str, Any]:
        if isinstance(value, dict):
            return value
        self._wrong_type(index, "", "an element", "an object", value)
        return {}  # keeps its place, so that the others keep their pointers

    def _mend(self, key: str, slot: QuickCheck, column: list[Any]) -> None:
        """Convert what has to be, and leave out what does not fit."""
        types = set(map(type, column)) - {UnsetType}
        if types <= slot.types:
            numbers = set(column) - {UNSET} if types - {str} else ()
            if not numbers or (slot.low <= min(numbers) and max(numbers) <= slot.high):
                if slot.number and int in types:
                    column[:] = [float(n) if type(n) is int else n for n in column]
                return
        wanted, uncounted, misfits = KEYS[Element][key], 0, 0
        unfit: set[Owner] = set()
        full = self._found.full("TT106")
        for index, item in enumerate(column):
            its = type(item)
            if its is UnsetType:
                continue
            if its in slot.types:
                if its is str or slot.low <= item <= slot.high:
                    if slot.number:
                        column[index] = float(item)
                    continue
                if full and -BIGGEST <= item <= BIGGEST:  # nobody wants to read of it
                    uncounted += 1
                    column[index] = UNSET
                    unfit.add(index)
                    continue
            elif its in NEVER and self._found.full("TT105"):
                misfits += 1
                column[index] = UNSET
                unfit.add(index)
                continue
            self._failed = False
            column[index] = self._fit(wanted, key, item, index)
            if self._failed:
                column[index] = UNSET
                unfit.add(index)
                full = self._found.full("TT106")
        self._found.take("TT106", iter(()), uncounted)
        self._found.take("TT105", iter(()), misfits)
        if unfit:
            self._built.unfit[key] = unfit
