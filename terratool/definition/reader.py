"""Text to definition: the fast way for clean files, the one that explains for the others."""

from __future__ import annotations

import gc
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import Struct

from terratool.definition.decode import Decoded, decode
from terratool.definition.findings import Finding, Owner, Remark, RemarkLog
from terratool.definition.keys import COMBINES, KEYS, Key, Kind, document_kind
from terratool.definition.model import (
    Definition,
    Element,
    Primitive,
    Roughness,
    Surface,
    Track,
    names_of,
)
from terratool.definition.rules import RULES
from terratool.definition.rules.base import Subject, VehicleSubject
from terratool.definition.tree import Tree, complete, flatten
from terratool.definition.vehicle import VehicleText
from terratool.errors import DefinitionError
from terratool.text.display import shown, unescape
from terratool.text.edit import Edit
from terratool.text.scan import value_end
from terratool.text.source import Source, read_source
from terratool.text.values import Repeated, read_values, repeated_keys

if TYPE_CHECKING:
    from terratool.text.locate import Position
    from terratool.text.syntax import JsonSyntaxError


class IgnoreLists:
    """The `x-ignore` lists of a definition, and which of their entries were of use."""

    def __init__(self, lists: list[tuple[Owner, Any]]) -> None:
        self._lists = lists
        self._used: set[tuple[Owner, int]] = set()
        self._codes = [
            (owner, index, code)
            for owner, listed in lists
            if isinstance(listed, list)
            for index, code in enumerate(listed)
            if isinstance(code, str) and code
        ]

    def __bool__(self) -> bool:
        return bool(self._lists)

    def unsilenced(self, code: str, remarks: Iterable[Remark], tree: Tree) -> Iterator[Remark]:
        """The warnings that no list around them silences; the lists that do are of use."""
        lists: dict[Owner, list[tuple[Owner, int]]] = {}
        for owner, index, listed in self._codes:
            if code.startswith(listed):
                lists.setdefault(owner, []).append((owner, index))
        if not lists:
            yield from remarks
            return
        silent: dict[Owner, bool] = {}  # what is known of owners, and so of all in them
        for remark in remarks:
            path: list[Owner] = []
            around: Owner | None = _owner(remark)
            while around is not None and around not in silent:
                path.append(around)
                around = _around(around, tree)
            silenced = around is not None and silent[around]
            for inner in reversed(path):
                self._used.update(lists.get(inner, ()))
                silenced = silent[inner] = silenced or inner in lists
            if not silenced:
                yield remark

    def unused(self, idle: tuple[str, ...]) -> Iterator[Remark]:
        """A remark on each entry that is none, or that silenced nothing.

        Args:
            idle: codes of rules that did not look this time.
        """
        for owner, listed in self._lists:
            if not isinstance(listed, list):
                yield _remark(owner, "", "it is no list.", 'Write a list of codes, as ["TT208"].')
                continue
            for index, code in enumerate(listed):
                if (owner, index) not in self._used and code not in idle:
                    yield _remark(owner, f"/{index}", *_why(code))


def _why(code: Any) -> tuple[str, str]:
    if not isinstance(code, str):
        return "an item is no code.", 'Write a text such as "TT208".'
    meant = [rule for rule in RULES.values() if code and rule.code.startswith(code)]
    if not meant:
        return f"no rule has the code {shown(code)}.", "See terratool rules for the codes."
    if all(rule.severity == "error" for rule in meant):
        return (
            f"{shown(code)} is an error, which cannot be ignored.",
            "Correct the error, and remove its code from x-ignore.",
        )
    return f"{shown(code)} silences nothing here.", "Remove it."


def _remark(owner: Owner, rest: str, message: str, hint: str) -> Remark:
    pointer, message = f"/x-ignore{rest}", f'in "x-ignore", {message}'
    if isinstance(owner, int):
        return Remark(pointer, message, hint, element=owner)
    return Remark(owner + pointer, message, hint)


def _owner(remark: Remark) -> Owner:
    """The innermost object around a remark, of those that may have a list."""
    if remark.element >= 0:
        return remark.element
    return "/".join(remark.pointer.split("/", 3)[:3])


def _around(owner: Owner, tree: Tree) -> Owner | None:
    """The next one out."""
    if isinstance(owner, int):
        parent = tree.parents[owner]
        return parent if parent >= 0 else ""
    return owner.rpartition("/")[0] if owner else None


class CheckOptions(Struct, frozen=True):
    """How closely to look.

    Attributes:
        warnings: look for what is no error, too.
        max_step: height of a step from which on it is remarked on, in units of the terrain.
        limit: how many findings to place; the others are counted.
        select: place those whose code begins with one of these; none means all.
        ignore: but none whose code begins with one of these.
    """

    warnings: bool = True
    max_step: float | None = None
    limit: int = 1000
    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()

    def shows(self, code: str) -> bool:
        """Whether findings of this code are wanted."""
        return (not self.select or code.startswith(self.select)) and not (
            self.ignore and code.startswith(self.ignore)
        )


class Checked(Struct, frozen=True, dict=True):
    """A text that was read.

    Attributes:
        findings: sorted by position, no more than `CheckOptions.limit`.
        counts: how many findings there are of each code, shown or not.
        readable: whether it was read to its end; if not, there is one finding that says why.
        vehicle: None if it has an error, or is no vehicle.
        terrain: None if it has an error, or is no terrain; its elements may be in `tree` alone.
        tree: the elements of the terrain, laid flat.
    """

    findings: tuple[Finding, ...]
    counts: Counter[str]
    readable: bool = True
    vehicle: VehicleText | None = None
    terrain: Definition | None = None
    tree: Tree | None = None

    @cached_property
    def definition(self) -> Definition | None:
        """The terrain with its elements; None if it has an error, or is no terrain."""
        if self.terrain is None or self.tree is None:
            return None
        return complete(self.terrain, self.tree)


def load_checked(path: str | Path) -> Checked:
    """Read a terrain that has no errors.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: it has errors; they are in `findings`, the first 1,000 of them.
    """
    source = read_source(path)
    checked = check(source, CheckOptions(warnings=False))
    if checked.terrain is None:
        if document_kind(source.data) == "vehicle":
            raise DefinitionError(
                f"{source.name}: is a vehicle, where a terrain is wanted.",
                "Name a terrain here, and the vehicle with --vehicle.",
            )
        raise refusal(checked)
    return checked


def load_definition(path: str | Path) -> Definition:
    """Read a definition that has no errors; raises what `load_checked` raises."""
    definition = load_checked(path).definition
    assert definition is not None
    return definition


def refusal(checked: Checked) -> DefinitionError:
    """The error that says what is first wrong with a text, and how many more there are."""
    first = checked.findings[0]
    count = checked.counts.total()
    more = f" terratool validate lists {count - 1} more." if count > 1 else ""
    return DefinitionError(
        f"{first.file}:{first.line}:{first.column}: {first.code}: {first.message}",
        first.hint + more,
        checked.findings,
    )


def check(
    source: Source, options: CheckOptions | None = None, kind: Kind | None = "terrain"
) -> Checked:
    """Read a text and let every rule look at it. Never raises for what the text contains.

    Args:
        source: the text.
        options: how closely to look.
        kind: what it is read as. None is what it looks like; what looks like neither is read as a
            terrain.
    """
    kind = kind or document_kind(source.data) or "terrain"
    with _no_collector():
        return _check(source, options or CheckOptions(), kind)


def _check(source: Source, options: CheckOptions, kind: Kind) -> Checked:
    found = RemarkLog(options.limit)
    decoded = _decode_quickly(source.data) if kind == "terrain" else None
    if decoded is None:
        from terratool.text.syntax import JsonSyntaxError

        try:
            value = read_values(source.data)
        except JsonSyntaxError as error:
            return _unreadable(source, error)
        decoded = decode(value, kind, found)
        del value
    repeated, count = repeated_keys(source.data, found.limit)
    found.take("TT102", map(_duplicate, repeated), count)
    _apply_rules(kind, decoded, source, found, options)
    findings = _placed(source, found, decoded, options)
    if any(RULES[code].severity == "error" for code in found.counts):
        return Checked(findings, found.counts)
    return Checked(
        findings,
        found.counts,
        vehicle=decoded.vehicle,
        terrain=decoded.definition,
        tree=decoded.tree,
    )


@contextmanager
def _no_collector() -> Iterator[None]:
    """Millions of new objects, and no garbage among them."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _decode_quickly(data: bytes) -> Decoded | None:
    """What the text says, if all of it fits."""
    try:
        definition = msgspec.json.decode(data, type=Definition)
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return None
    tree = flatten(definition)
    crs = definition.crs
    # the values of a crs are free, and may be beyond any float
    free = isinstance(crs, dict) or (isinstance(crs, int) and crs.bit_length() > 64)
    return None if free or not _in_range(definition, tree) else Decoded(definition, tree=tree)


_RANGED: dict[type, list[tuple[str, Key]]] = {
    kind: [
        (name, KEYS[kind][key])
        for name, key in names_of(kind)
        if KEYS[kind][key].kind in ("number", "whole")
    ]
    for kind in (Definition, Surface, Roughness, Track)
}


def _in_range(definition: Definition, tree: Tree) -> bool:
    """Whether every number whose range is not part of its type lies in that of its key."""
    surfaces = definition.surfaces.values()
    reliefs = [s.roughness for s in surfaces if s.roughness is not msgspec.UNSET]
    if any(r.rms is msgspec.UNSET or r.correlation is msgspec.UNSET for r in reliefs):
        return False
    ranged = [(tree.distinct("cells"), KEYS[Element]["cells"])]
    ranged += [
        ({getattr(owner, name)}, key)
        for owner in (definition, *surfaces, *reliefs, *definition.ruts)
        for name, key in _RANGED[type(owner)]
    ]
    for primitive in definition.primitives.values():
        if primitive.combine is not msgspec.UNSET and primitive.combine not in COMBINES:
            return False
        curves = (primitive.x, primitive.y)
        ranged += [(set(curve), KEYS[Primitive]["x"]) for curve in curves if type(curve) is tuple]
    for track in definition.ruts:
        ranged.append((set(chain.from_iterable(track.points)), KEYS[Track]["path"]))
        if track.depth is not msgspec.UNSET:
            depths = track.depth.values() if isinstance(track.depth, dict) else (track.depth,)
            ranged.append((set(depths), KEYS[Track]["depth"]))
    return all(map(_all_hold, ranged))


def _all_hold(ranged: tuple[set[Any], Key]) -> bool:
    values, key = ranged
    pairs = [value for value in values if isinstance(value, tuple)]
    numbers = values.difference(pairs, (msgspec.UNSET,))
    numbers.update(number for pair in pairs for number in pair)
    return not numbers or (key.holds(min(numbers)) and key.holds(max(numbers)))


def _apply_rules(
    kind: Kind, decoded: Decoded, source: Source, found: RemarkLog, options: CheckOptions
) -> None:
    """Let every rule look at a terrain or a vehicle, unless the text is no object."""
    subject: Subject | VehicleSubject
    if decoded.definition is not None:
        subject = Subject(
            definition=decoded.definition, tree=decoded.tree, unfit=decoded.unfit,
            size=source.size, packed=source.packed, max_step=options.max_step,
        )  # fmt: skip
    elif decoded.vehicle is not None:
        subject = VehicleSubject(vehicle=decoded.vehicle, unfit=decoded.unfit)
    else:
        return
    ignores = IgnoreLists(decoded.ignores)
    for rule in RULES.values():
        if (
            rule.check is not None
            and rule.kind == kind
            and (options.warnings or rule.severity == "error")
        ):
            remarks = rule.check(subject)
            if ignores and rule.severity == "warning":
                remarks = ignores.unsilenced(rule.code, remarks, decoded.tree)
            found.take(rule.code, remarks)
    if options.warnings:
        idle = ("TT211",) if kind == "terrain" and options.max_step is None else ()
        found.take("TT113", ignores.unused(idle))


def _placed(
    source: Source, found: RemarkLog, decoded: Decoded, options: CheckOptions
) -> tuple[Finding, ...]:
    """The findings that are wanted, by where they stand in the text."""
    found.kept = [kept for kept in found.kept if options.shows(kept[0])]
    if not found.kept:
        return ()
    from terratool.text.locate import Address, offsets, positions_of

    tree = decoded.tree
    pointers = [
        (tree.pointer(remark.element) if remark.element >= 0 else "") + remark.pointer
        for _, remark in found.kept
    ]
    addresses = [
        Address(pointer, remark.on_key, remark.occurrence)
        for pointer, (_, remark) in zip(pointers, found.kept, strict=True)
    ]
    at = offsets(source.data, addresses, found.counts["TT102"] > 0)
    places = positions_of(source.data, at)
    in_order = sorted(
        zip(places, found.kept, pointers, at, strict=True),
        key=lambda each: (each[0].line, each[0].column, each[1][0]),
    )
    findings = []
    for place, (code, remark), pointer, begin in in_order[: found.limit]:
        bounds = None
        if decoded.definition is not None and remark.element >= 0:
            bounds = tree.rectangle(remark.element, decoded.definition)
        fix = None
        if remark.fix:
            fix = Edit(begin, value_end(source.data, begin, source.size), remark.fix.encode())
        findings.append(_finding(source, code, pointer, remark, place, bounds, fix))
    return tuple(findings)


def _finding(
    source: Source, code: str, pointer: str, remark: Remark, place: Position,
    bounds: Any = None, fix: Edit | None = None,
) -> Finding:  # fmt: skip
    return Finding(
        source.name, code, RULES[code].severity, pointer, place.line, place.column,
        remark.message, remark.hint, bounds, place.excerpt, fix,
    )  # fmt: skip


def _duplicate(repeated: Repeated) -> Remark:
    pointer, occurrence = repeated
    key = shown(unescape(pointer.rsplit("/", 1)[1]))
    message = f"the key {key} stands twice in one object."
    hint = "Remove or rename one of the two."
    return Remark(pointer, message, hint, on_key=True, occurrence=occurrence)


def _unreadable(source: Source, error: JsonSyntaxError) -> Checked:
    """What is said of a text that is no JSON: this one thing."""
    from terratool.text.locate import positions_of
    from terratool.text.syntax import innermost

    offsets = [error.offset]
    if error.inside:
        offsets.append(innermost(source.data.decode("utf-8"), error.offset))
    at = [_in_bytes(source.data, offset) for offset in offsets]
    place, *opening = positions_of(source.data, at)
    message = error.message
    for line, column, _ in opening:
        message = f"{message[:-1]} that begins in line {line}, column {column}."
    fix = None
    if error.fix is not None:
        count, new = error.fix
        fix = Edit(at[0], _in_bytes(source.data, error.offset + count), new.encode())
    finding = _finding(source, error.code, "", Remark("", message, error.hint), place, fix=fix)
    return Checked((finding,), Counter([error.code]), readable=False)


def _in_bytes(data: bytes, offset: int) -> int:
    """An offset in characters, before which all is UTF-8, in bytes."""
    if data.isascii():
        return offset
    return len(data.decode("utf-8", "replace")[:offset].encode())
