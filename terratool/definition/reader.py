"""Reader of definitions: a fast way for clean files, and a slow one that explains faults."""

from __future__ import annotations

import gc
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property, partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import Struct, structs

from terratool.definition.curriculum import CurriculumText
from terratool.definition.curves import has_knots
from terratool.definition.decode import Decoded, decode
from terratool.definition.findings import (
    Bounds,
    Finding,
    Owner,
    Remark,
    RemarkBatch,
    RemarkLog,
    UnseenStorey,
)
from terratool.definition.key import Key
from terratool.definition.keys import KEYS, Kind, document_kind
from terratool.definition.libraries import Shelf, SourceDocument, known_names
from terratool.definition.model import (
    COMBINES,
    LARGEST,
    POINT_LENGTHS,
    REGISTRATIONS,
    STOREYS,
    Bore,
    Deck,
    Definition,
    Element,
    GridFile,
    Library,
    Pair,
    Primitive,
    Roughness,
    Surface,
    SurfaceGrid,
    Track,
    names_of,
    pair_of,
)
from terratool.definition.rules import RULES
from terratool.definition.rules.base import (
    CurriculumSubject,
    SensorSubject,
    Subject,
    VehicleSubject,
)
from terratool.definition.sensor import SensorText
from terratool.definition.tree import ROOT, Tree, complete, flatten
from terratool.definition.uses import Uses
from terratool.definition.vectors import (
    LEAST,
    LiftedText,
    Vector,
    lift_vectors,
    vector_of,
)
from terratool.definition.vehicle import VehicleText
from terratool.errors import DefinitionError
from terratool.report.wording import count_of
from terratool.text.display import printable, quote, unescape
from terratool.text.scan import value_end
from terratool.text.source import Source, read_source, real_path
from terratool.text.values import (
    KeySurvey,
    Repeated,
    read_values,
    repeated_keys,
    survey_keys,
)

if TYPE_CHECKING:
    from terratool.definition.expand import Expansion
    from terratool.text.edit import Edit
    from terratool.text.locate import Position
    from terratool.text.syntax import JsonSyntaxError


class IgnoreLists:
    """Lists `x-ignore` of a definition, and the entries of them that silenced something."""

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

    def filter_remarks(
        self, code: str, remarks: Iterable[Remark | RemarkBatch], tree: Tree
    ) -> Iterator[Remark | RemarkBatch]:
        """Yield the remarks that no list around them silences; note the entries that do."""
        lists: dict[Owner, list[tuple[Owner, int]]] = {}
        for owner, index, listed in self._codes:
            if code.startswith(listed):
                lists.setdefault(owner, []).append((owner, index))
        if not lists:
            yield from remarks
            return
        silent: dict[Owner, bool] = {}  # known for owners, and so for all in them

        def is_silenced(owner: Owner) -> bool:
            path: list[Owner] = []
            around: Owner | None = owner
            while around is not None and around not in silent:
                path.append(around)
                around = _around(around, tree)
            silenced = around is not None and silent[around]
            for inner in reversed(path):
                self._used.update(lists.get(inner, ()))
                silenced = silent[inner] = silenced or inner in lists
            return silenced

        for remark in remarks:
            if isinstance(remark, RemarkBatch):
                told = [index for index in remark.elements if not is_silenced(index)]
                yield RemarkBatch(told, remark.remark)
            elif not is_silenced(_owner(remark, tree)):
                yield remark

    def useless_entries(self, idle: tuple[str, ...]) -> Iterator[Remark]:
        """Yield a remark on each entry that is only the code of errors, or that silenced nothing.

        Args:
            idle: codes of rules that were not applied this time.
        """
        for owner, listed in self._lists:
            if not isinstance(listed, list):
                yield _remark(owner, "", "it is no list.", 'Write a list of codes, as ["TT208"].')
                continue
            for index, code in enumerate(listed):
                if (owner, index) not in self._used and code not in idle:
                    yield _remark(owner, f"/{index}", *_entry_problem(code))


def _entry_problem(code: Any) -> tuple[str, str]:
    if not isinstance(code, str):
        return "an item is no code.", 'Write a text such as "TT208".'
    meant = [rule for rule in RULES.values() if code and rule.code.startswith(code)]
    if not meant:
        return f"no rule has the code {quote(code)}.", "See terratool rules for the codes."
    if all(rule.severity == "error" for rule in meant):
        return (
            f"{quote(code)} is an error, which cannot be ignored.",
            "Correct the error, and remove its code from x-ignore.",
        )
    return f"{quote(code)} silences nothing here.", "Remove it."


def _remark(owner: Owner, rest: str, message: str, hint: str) -> Remark:
    pointer, message = f"/x-ignore{rest}", f'in "x-ignore", {message}'
    if isinstance(owner, int):
        return Remark(pointer, message, hint, element=owner)
    return Remark(owner + pointer, message, hint)


def _owner(remark: Remark, tree: Tree) -> Owner:
    """Innermost object around a remark, of those that may have a list."""
    if remark.element >= 0:
        return remark.element
    pointer = "/".join(remark.pointer.split("/", 3)[:3])
    return tree.root_at.get(pointer, pointer)  # a part is an element


def _around(owner: Owner, tree: Tree) -> Owner | None:
    """Owner one level further out; None for the text itself."""
    if isinstance(owner, int):
        parent = tree.parents[owner]
        return parent if parent >= 0 else ""
    return owner.rpartition("/")[0] if owner else None


class CheckOptions(Struct, frozen=True):
    """Options of a check.

    Attributes:
        warnings: whether rules with warnings and notes are applied, too.
        max_step: height from which on a step is remarked on, in units of the terrain; None for no
            limit.
        limit: most findings that are placed; the others are counted.
        select: beginnings of codes whose findings are placed; empty for all.
        ignore: beginnings of codes whose findings are not placed.
        ignored_in: function of a file's name that gives further beginnings for `ignore`; libraries
            are files, too.
        library_roots: folders under which libraries may lie, beside the current one and the
            folder of the file.
        look: function that looks at the heights of a terrain for decks and bores that change
            nothing; None for none, as this takes a compiled terrain.
    """

    warnings: bool = True
    max_step: float | None = None
    limit: int = 1000
    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    library_roots: tuple[str, ...] = ()
    ignored_in: Callable[[str], tuple[str, ...]] = lambda _: ()
    look: Callable[[Checked], tuple[UnseenStorey, ...]] | None = None

    def of(self, file: str) -> CheckOptions:
        """Return the options with the codes that are ignored in a file."""
        return structs.replace(self, ignore=self.ignore + self.ignored_in(file))

    def shows(self, code: str) -> bool:
        """Whether findings of a code are placed."""
        return (not self.select or code.startswith(self.select)) and not (
            self.ignore and code.startswith(self.ignore)
        )


class Checked(Struct, frozen=True, dict=True):
    """Result of reading and checking a text.

    Attributes:
        findings: findings sorted by position, no more than `CheckOptions.limit`.
        counts: number of findings of each code, shown or not.
        readable: whether the text was read to its end; if not, the one finding tells why.
        vehicle: vehicle; None if it has an error, or the text is no vehicle.
        sensor: sensor; None if it has an error, or the text is no sensor.
        curriculum: spec of training tiles; None if it has an error, or the text is no spec.
        tiles: terrains (`TileSource`) that tiles of `curriculum` are made of, by names of kinds.
        terrain: terrain, whose elements may be in `tree` alone; None if it has an error, or the
            text is no terrain.
        tree: elements of the terrain or the library.
        document: text with its libraries; None if it has an error, or is no terrain or library.
        libraries: results for each library that the text uses, directly or through others.
        name: name of the file.
    """

    findings: tuple[Finding, ...]
    counts: Counter[str]
    readable: bool = True
    vehicle: VehicleText | None = None
    sensor: SensorText | None = None
    curriculum: CurriculumText | None = None
    tiles: Mapping[str, Any] = {}
    terrain: Definition | None = None
    tree: Tree | None = None
    document: SourceDocument | None = None
    libraries: tuple[Checked, ...] = ()
    name: str = ""

    def __repr__(self) -> str:
        counts = Counter(finding.severity for finding in self.findings)
        said = ", ".join(count_of(number, severity) for severity, number in sorted(counts.items()))
        return f"<Checked {printable(self.name) or 'text'}: {said or 'nothing found'}>"

    @cached_property
    def expansion(self) -> Expansion | None:
        """Terrain with parts and copies written out; None if there is no terrain.

        Raises:
            RequestError: parts and copies come to too many elements.
        """
        if self.uses is None:
            return None
        from terratool.definition.expand import expand

        expansion = expand(self.uses)
        return structs.replace(expansion, definition=self.with_tracks(expansion.definition))

    @cached_property
    def uses(self) -> Uses | None:
        """Parts of the terrain and their uses; None if there is no terrain."""
        if self.terrain is None or self.document is None:
            return None
        return Uses(self.document, known_names(self.document))

    def with_tracks(self, definition: Definition) -> Definition:
        """Return a definition with the tracks of `terrain`, which callers replace."""
        return structs.replace(definition, tracks=self.terrain.tracks if self.terrain else ())

    @cached_property
    def definition(self) -> Definition | None:
        """Terrain with its elements; None if it has an error, or the text is no terrain."""
        if self.terrain is None or self.tree is None:
            return None
        return complete(self.terrain, self.tree)


_NO_TERRAIN: dict[Kind | None, str] = {
    "vehicle": "Name a terrain here, and the vehicle with --vehicle.",
    "sensor": "Name a terrain here, and the sensor with --sensor.",
    "library": 'Name a terrain; its "use" may list libraries.',
    "curriculum": "Make a terrain of it with terratool curriculum, and name that here.",
}
"""Hints for texts of kinds other than terrains, by kind."""


class _Extent(Struct, frozen=True):
    """Place of a terrain, as its text has it; nothing else is looked at."""

    size: float | Pair
    origin: Pair = (0.0, 0.0)


def bounds_in(data: bytes) -> Bounds | None:
    """West, south, east and north of the terrain in a text; None where the text does not tell."""
    try:
        found = msgspec.json.decode(data, type=_Extent)
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return None
    (west, south), (width, depth) = found.origin, pair_of(found.size, 0.0)
    return (west, south, west + width, south + depth) if width > 0 and depth > 0 else None


def load_checked(
    path: str | Path,
    library_roots: tuple[str, ...] = (),
    early: Callable[[Bounds], object] | None = None,
) -> Checked:
    """Read a terrain that has no errors.

    Args:
        path: path of the file.
        library_roots: further folders under which the libraries of the terrain may lie.
        early: called with the bounds of the terrain before its elements are looked at; what it
            raises ends the reading.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the terrain has errors; `findings` has the first 1,000 of them.
    """
    source = read_source(path)
    if early is not None and (bounds := bounds_in(source.data)) is not None:
        early(bounds)
    checked = check(source, CheckOptions(warnings=False, library_roots=library_roots))
    if checked.terrain is None:
        raise no_terrain(source, checked)
    return checked


def no_terrain(source: Source, checked: Checked) -> DefinitionError:
    """Error for a text that was read as a terrain, and is none, or has errors."""
    kind = document_kind(source.data)
    if kind in _NO_TERRAIN:
        return DefinitionError(
            f"{source.name}: is a {kind}, where a terrain is wanted.", _NO_TERRAIN[kind]
        )
    return refusal(checked, source.seen)


def load_definition(path: str | Path) -> Definition:
    """Read a definition that has no errors; raises the errors of `load_checked`."""
    definition = load_checked(path).definition
    assert definition is not None
    return definition


def uses_of(definition: Definition) -> Uses:
    """Parts of a valid definition without libraries, and their uses."""
    source = Source("the definition", b"")
    document = SourceDocument(source, Decoded(definition, tree=flatten(definition)), RemarkLog(0))
    return Uses(document, known_names(document))


def refusal(checked: Checked, seen: bool = True) -> DefinitionError:
    """Error with the first finding of a text, and the number of the others.

    Args:
        checked: result of the check.
        seen: whether users see the text; otherwise a JSON pointer says where the finding is.
    """
    first = checked.findings[0]
    place = f":{first.line}:{first.column}"
    if not seen and first.file == checked.name:
        place = f": {printable(first.pointer)}" if first.pointer else ""
    count = checked.counts.total()
    more = f" terratool validate lists {count - 1} more." if count > 1 else ""
    return DefinitionError(
        f"{first.file}{place}: {first.code}: {first.message}",
        first.hint + more,
        checked.findings,
    )


def check(
    source: Source,
    options: CheckOptions | None = None,
    kind: Kind | None = "terrain",
    shelf: Shelf | None = None,
) -> Checked:
    """Read a text and apply every rule to it; no content of the text makes it raise.

    The libraries that the text uses are read and checked, too.

    Args:
        source: text to check.
        options: options of the check; None for the defaults.
        kind: kind that the text is read as. None is the kind that it looks like, or a terrain where
            it looks like none.
        shelf: shelf that keeps libraries for the next text; None for a new one.
    """
    kind = kind or document_kind(source.data) or "terrain"
    options = options or CheckOptions()
    with _no_collector():
        document = read_document(source, kind, options.limit)
        if document.model.library_paths and source.name != "<stdin>":
            document.real = real_path(source.name)
        if document.decoded.curriculum is not None:
            options = structs.replace(
                options, library_roots=(*options.library_roots, document.folder)
            )
        shelf = shelf or new_shelf(options)
        shelf.link(document)
        if document.decoded.curriculum is not None:
            from terratool.definition.tile_files import open_tiles

            others = CheckOptions(warnings=False, library_roots=options.library_roots)
            document.tiles = open_tiles(
                document, shelf, lambda text: check(text, others, None, shelf)
            )
        for library in document.all_libraries:
            _own_result(library, options)
        libraries = tuple(_full_result(library, options) for library in document.all_libraries)
        return structs.replace(_full_result(document, options), libraries=libraries)


def new_shelf(options: CheckOptions | None = None) -> Shelf:
    """Shelf without libraries."""
    options = options or CheckOptions()
    return Shelf(
        lambda source: read_document(source, "library", options.limit), options.library_roots
    )


def read_document(source: Source, kind: Kind, limit: int = 1000) -> SourceDocument:
    """Read a text into the model, as far as its values fit."""
    if kind in ("terrain", "library"):
        lifted = lift_vectors(source.data, LARGEST)
        document = _document_of(source, lifted, kind, limit) if lifted.vectors else None
        if document is not None:
            return document
    document = _document_of(source, LiftedText(source.data), kind, limit)
    assert document is not None
    return document


def _document_of(source: Source, text: LiftedText, kind: Kind, limit: int) -> SourceDocument | None:
    """Text in the model; None where a vector that was lifted is no curve of a primitive."""
    found = RemarkLog(limit)
    quick = _decode_quickly(text, kind) if kind in ("terrain", "library") else None
    keys = None
    if quick is not None:
        decoded, keys = quick
    else:
        try:
            value = read_values(text.data)
        except _syntax_error() as error:
            broken = SourceDocument(source, Decoded(), found, broken=error, kind=kind)
            return None if text.vectors else broken
        decoded = decode(value, kind, found)
        del value
        library = decoded.library or decoded.definition
        if library is not None and not _put_vectors(library, text):
            return None
    repeated, count = repeated_keys(text.data, found.limit, keys)
    found.take("TT102", map(_duplicate, repeated), count)
    return SourceDocument(source, decoded, found, kind=kind)


def _put_vectors(library: Library, text: LiftedText) -> bool:
    """Put the long vectors of a text into its primitives; whether all have their place there."""
    left = len(text.vectors)
    for name, primitive in library.primitives.items():
        for key in ("x", "y"):
            value = getattr(primitive, key)
            vector = text.vector_of(value)
            left -= vector is not None
            if type(value) is tuple and len(value) >= LEAST and not has_knots(value):
                vector = vector_of(value)
            if vector is not None:
                library.primitives[name] = structs.replace(
                    library.primitives[name], **{key: vector}
                )
    return not left


def _syntax_error() -> type[JsonSyntaxError]:
    """Class of syntax errors, from a module that is imported only for a text that is no JSON."""
    from terratool.text.syntax import JsonSyntaxError

    return JsonSyntaxError


def _full_result(document: SourceDocument, options: CheckOptions) -> Checked:
    """Result for a text, errors of the libraries that it uses included."""
    own = _own_result(document, options)
    bad = document.catalogue.libraries_where(document, _is_bad)
    if not bad or document.broken is not None:
        return own.checked
    broken = {id(library): _own_result(library, options).checked for library in bad}
    found = own.found.copy()
    for code in [code for code in found.counts if RULES[code].severity == "note"]:
        found.drop(code)
    found.take("TT706", _broken_libraries(document, broken))
    findings = _locate_findings(document.source, found, document.decoded, options)
    return Checked(findings, found.counts, name=document.source.name)


def _is_bad(document: SourceDocument) -> bool:
    """Whether rules have found an error in a text that was checked."""
    known: _OwnResult | None = document.__dict__.get("_own_result")
    return known is not None and not known.is_good


class _OwnResult(Struct, frozen=True):
    """Findings of rules on a text by itself."""

    found: RemarkLog
    checked: Checked

    @property
    def is_good(self) -> bool:
        """Whether the text has no error."""
        return not any(RULES[code].severity == "error" for code in self.checked.counts)


def _own_result(document: SourceDocument, options: CheckOptions) -> _OwnResult:
    """Apply rules to a text, once for each text."""
    # kept beside the fields of the document, as pickling a terrain leaves it behind
    known: _OwnResult | None = document.__dict__.get("_own_result")
    if known is not None:
        return known
    found, decoded = document.found.copy(), document.decoded
    if document.broken is not None:
        looked = _OwnResult(found, _unreadable(document.source, document.broken))
    else:
        for code, remark in document.problems:
            found.take(code, iter((remark,)))
        _apply_rules(document, found, options)
        findings = _locate_findings(document.source, found, decoded, options)
        looked = _OwnResult(found, Checked(findings, found.counts, name=document.source.name))
        if looked.is_good:
            looked = structs.replace(looked, checked=structs.replace(
                looked.checked, vehicle=decoded.vehicle, sensor=decoded.sensor,
                curriculum=decoded.curriculum, tiles=document.tiles,
                terrain=decoded.definition, tree=decoded.tree,
                document=document if decoded.definition or decoded.library else None,
            ))  # fmt: skip
    document.__dict__["_own_result"] = looked
    return looked


def _broken_libraries(document: SourceDocument, broken: dict[int, Checked]) -> Iterator[Remark]:
    """Yield a remark on each library with errors, at the entry of `use` that leads there."""
    left = dict(broken)
    for index, library in enumerate(document.uses):
        for one in () if library is None else (library, *library.all_libraries):
            checked = left.pop(id(one), None)
            if checked is None:
                continue
            first = next((f for f in checked.findings if f.severity == "error"), None)
            count = sum(n for code, n in checked.counts.items() if RULES[code].severity == "error")
            where = f": {first.line}:{first.column}: {first.message}" if first else "."
            yield Remark(
                f"/use/{index}",
                f"the library {quote(one.source.name)} has {count_of(count, 'error')}{where}",
                first.hint if first else "Run terratool validate on it.",
            )


@contextmanager
def _no_collector() -> Iterator[None]:
    """Turn off garbage collection while millions of objects are made, none of them garbage."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


_ELEMENT_NAMES = {key: name for name, key in names_of(Element) if name != "children"}
"""Attributes of elements by their keys."""


def _decode_quickly(text: LiftedText, kind: Kind) -> tuple[Decoded, KeySurvey] | None:
    """Model and survey of the keys of a text in which all values fit; None for other texts."""
    model: type[Library] = Definition if kind == "terrain" else Library
    try:
        definition: Library = msgspec.json.decode(text.data, type=model)
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return None
    if not _put_vectors(definition, text):
        return None
    keys = survey_keys(text.data, tuple(_ELEMENT_NAMES))
    tree = flatten(definition, (_ELEMENT_NAMES[key] for key in keys.absent))
    terrain = definition if isinstance(definition, Definition) else None
    crs = terrain.crs if terrain else msgspec.UNSET
    # the values of a crs are free, and may be beyond any float
    free = isinstance(crs, dict) or (isinstance(crs, int) and crs.bit_length() > 64)
    if free or not _in_range(definition, tree):
        return None
    return Decoded(terrain, None if terrain else definition, tree=tree), keys


_RANGED: dict[type, list[tuple[str, Key]]] = {
    kind: [
        (name, KEYS[kind][key])
        for name, key in names_of(kind)
        if KEYS[kind][key].kind in ("number", "whole")
    ]
    for kind in (Definition, Library, Surface, Roughness, Track, Deck, Bore)
}


def _in_range(definition: Library, tree: Tree) -> bool:
    """Whether every number whose range is not part of its type lies in the range of its key."""
    surfaces = definition.surfaces.values()
    reliefs = [s.roughness for s in surfaces if s.roughness is not msgspec.UNSET]
    if any(r.rms is msgspec.UNSET or r.correlation is msgspec.UNSET for r in reliefs):
        return False
    ranged = [(tree.distinct(key), KEYS[Element][key]) for key in ("cells", "extent")]
    bands = {grid.band for grid in tree.distinct("surface_grid") - {msgspec.UNSET}}
    ranged.append((bands, KEYS[SurfaceGrid]["band"]))
    ranged += [
        ({getattr(storey, name) for storey in tree.distinct(key) - {msgspec.UNSET}}, wanted)
        for key, kind in STOREYS.items()
        for name, wanted in _RANGED[kind]
    ]
    tracks = definition.ruts if isinstance(definition, Definition) else ()
    ranged += [
        ({getattr(owner, name)}, key)
        for owner in (definition, *surfaces, *reliefs, *tracks)
        for name, key in _RANGED[type(owner)]
    ]
    for primitive in definition.primitives.values():
        if primitive.combine is not msgspec.UNSET and primitive.combine not in COMBINES:
            return False
        curves: tuple[Any, ...] = (primitive.x, primitive.y)
        for curve in curves:
            if isinstance(curve, tuple | Vector):
                numbers = {*curve.extremes()} if isinstance(curve, Vector) else set(curve)
                ranged.append((numbers, KEYS[Primitive]["x"]))
        if primitive.registration not in (msgspec.UNSET, *REGISTRATIONS):
            return False
        if isinstance(primitive.grid, GridFile):
            ranged.append(({primitive.grid.band}, KEYS[GridFile]["band"]))
        elif primitive.grid is not msgspec.UNSET:
            numbers = set(chain.from_iterable(primitive.grid)) - {None}
            ranged.append((numbers, KEYS[Primitive]["grid"]))
    for track in tracks:
        path = () if track.path is msgspec.UNSET else track.path
        if any(len(point) not in POINT_LENGTHS for point in path):
            return False
        ranged.append((set(chain.from_iterable(path)), KEYS[Track]["path"]))
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


def _apply_rules(document: SourceDocument, found: RemarkLog, options: CheckOptions) -> None:
    """Apply all rules to the models of a text; a text that is no object has none."""
    decoded = document.decoded
    ignores = IgnoreLists(decoded.ignores)
    subjects = _subjects(document, options)
    # notes are of texts without errors
    for rule in sorted(RULES.values(), key=lambda rule: rule.severity == "note"):
        if rule.check is None or not (options.warnings or rule.severity == "error"):
            continue
        if rule.severity == "note" and any(RULES[c].severity == "error" for c in found.counts):
            continue
        for kind, subject in subjects:
            if rule.kind != kind:
                continue
            remarks = rule.check(subject)
            if decoded.curriculum is not None and kind == "terrain":
                from terratool.definition.tile_ground import on_ground

                remarks = on_ground(remarks)
            if ignores and rule.severity != "error":
                remarks = ignores.filter_remarks(rule.code, remarks, decoded.tree)
            found.take(rule.code, remarks)
    if options.warnings and subjects:
        looked = any(kind == "terrain" for kind, _ in subjects)
        idle = ("TT211",) * (looked and options.max_step is None)
        idle += ("TT223", "TT224") * (options.look is None or decoded.library is not None)
        found.take("TT113", ignores.useless_entries(idle))


def _subjects(document: SourceDocument, options: CheckOptions) -> list[tuple[Kind, Any]]:
    """Subjects of rules with the kind of those rules; empty where a text is no object."""
    decoded, source = document.decoded, document.source
    terrain = decoded.definition
    if decoded.library is not None:
        library = decoded.library
        terrain = Definition(**{name: getattr(library, name) for name, _ in names_of(Library)})
    if terrain is not None:
        look: Callable[[], tuple[UnseenStorey, ...]] = tuple
        if options.look is not None and decoded.library is None:
            sound = Checked((), Counter(), terrain=terrain, tree=decoded.tree, document=document)
            look = partial(_look, sound, options.look)
        return [("terrain", Subject(
            definition=terrain, tree=decoded.tree, document=document, unfit=decoded.unfit,
            size=source.size, packed=source.packed, max_step=options.max_step, look=look,
        ))]  # fmt: skip
    if decoded.vehicle is not None:
        return [("vehicle", VehicleSubject(vehicle=decoded.vehicle, unfit=decoded.unfit))]
    if decoded.sensor is not None:
        return [("sensor", SensorSubject(sensor=decoded.sensor, unfit=decoded.unfit))]
    if decoded.curriculum is not None:
        from terratool.definition.tile_ground import ground_subject

        spec = CurriculumSubject(
            curriculum=decoded.curriculum, unfit=decoded.unfit, tiles=document.tiles
        )
        subjects: list[tuple[Kind, Any]] = [("curriculum", spec)]
        ground = ground_subject(spec)
        return subjects if ground is None else [*subjects, ("terrain", ground)]
    return []


def _look(
    checked: Checked, look: Callable[[Checked], tuple[UnseenStorey, ...]]
) -> tuple[UnseenStorey, ...]:
    """Storeys that change nothing in a text without errors; none if a library of it has some."""
    document = checked.document
    assert document is not None
    return () if document.catalogue.libraries_where(document, _is_bad) else look(checked)


def _locate_findings(
    source: Source, found: RemarkLog, decoded: Decoded, options: CheckOptions
) -> tuple[Finding, ...]:
    """Findings that are wanted, sorted by their positions in the text."""
    shows = options.of(source.name).shows
    found.kept = [kept for kept in found.kept if shows(kept[0])]
    if not found.kept:
        return ()
    from terratool.text.edit import Edit
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
        terrain, element = decoded.definition, remark.element
        if terrain is not None and element >= 0 and tree.roots[tree.root_of[element]] == ROOT:
            bounds = tree.rectangle(element, terrain)
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
    key = quote(unescape(pointer.rsplit("/", 1)[1]))
    message = f"the key {key} stands twice in one object."
    hint = "Remove or rename one of the two."
    return Remark(pointer, message, hint, on_key=True, occurrence=occurrence)


def _unreadable(source: Source, error: JsonSyntaxError) -> Checked:
    """Result for a text that is no JSON: the one finding on its syntax."""
    from terratool.text.edit import Edit
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
    return Checked((finding,), Counter([error.code]), readable=False, name=source.name)


def _in_bytes(data: bytes, offset: int) -> int:
    """Byte offset of an offset in characters, before which the data is valid UTF-8."""
    if data.isascii():
        return offset
    return len(data.decode("utf-8", "replace")[:offset].encode())
