"""Base of rules: subjects that rules look at, and the registry of rules."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cached_property
from inspect import cleandoc
from typing import TYPE_CHECKING, Any, TypeVar

from msgspec import UNSET, Struct, UnsetType

from terratool.definition.curriculum import CurriculumText
from terratool.definition.curves import CurveError, problems
from terratool.definition.findings import Owner, Remark, RemarkBatch, Severity, UnseenStorey
from terratool.definition.grid_files import LinkedGrid
from terratool.definition.keys import SLOTS, Kind
from terratool.definition.libraries import Clash, Named, SourceDocument, clashes_of, known_names
from terratool.definition.model import FACES, STOREYS, Definition, Primitive, Storey, Surface
from terratool.definition.part_sizes import PartSizes, sizes_of_places
from terratool.definition.sensor import SensorText
from terratool.definition.summaries import ShapeSummary, summarise_shape, with_heights
from terratool.definition.tree import Tree
from terratool.definition.uses import Uses
from terratool.definition.vehicle import AxleText, VehicleText, WheelsText, WheelText
from terratool.errors import ReadError

if TYPE_CHECKING:
    from terratool.definition.tile_files import TileProblem, TileSource


class _Subject(Struct, frozen=True, dict=True, kw_only=True):
    """Subject of rules about any kind of text.

    Attributes:
        unfit: by key, the owners whose value was left out; "" stands for the owner itself.
    """

    unfit: Mapping[str, Collection[Owner]] = {}

    def left_out(self, owner: Owner, *keys: str) -> bool:
        """Whether the value of one of the keys of an object, or all of the object, did not fit."""
        return bool(self.unfit) and any(owner in self.unfit.get(key, ()) for key in ("", *keys))


class Subject(_Subject, frozen=True, kw_only=True):
    """Subject of rules about terrains and libraries.

    Attributes:
        definition: model without the values that did not fit; a library's as that of a terrain.
        tree: elements of the terrain, or of the library's parts.
        document: file, with the libraries that it uses.
        size: size of the text, bytes.
        packed: whether the text came from gzip.
        max_step: height from which on a step is remarked on; None for no limit.
        look: function that looks at the heights of the terrain for storeys that change nothing.
    """

    definition: Definition
    tree: Tree
    document: SourceDocument
    size: int = 0
    packed: bool = False
    max_step: float | None = None
    look: Callable[[], tuple[UnseenStorey, ...]] = tuple

    @cached_property
    def unseen(self) -> tuple[UnseenStorey, ...]:
        """Decks and bores that change nothing; none where nobody looks, or the text has errors."""
        return self.look()

    @property
    def is_library(self) -> bool:
        """Whether the text is a library, not a terrain."""
        return self.document.kind == "library"

    @property
    def lacks_library(self) -> bool:
        """Whether a library cannot be had, and so names that it may define."""
        if self.left_out("", "use"):
            return True
        document = self.document
        return _lacks(document) or bool(document.catalogue.libraries_where(document, _lacks))

    @cached_property
    def uses(self) -> Uses:
        """Parts that the text knows, and their uses."""
        return Uses(self.document, known_names(self.document))

    @cached_property
    def storeys(self) -> frozenset[int]:
        """Elements that are decks or bores, or that stand for parts whose roots are."""
        tree, uses = self.tree, self.uses
        own = {
            index
            for key in STOREYS
            for index in (
                *self.unfit.get(key, ()),
                *(index for index, _ in tree.elements_with(key, tree.distinct(key) - {UNSET})),
            )
        }
        standing = {
            name
            for name in uses.known_parts & uses.graph.ends.keys()
            if (end := uses.graph.ends[name].root).tree.storey(end.element) is not UNSET
        }
        own.update(index for index, _ in tree.elements_with("part", standing))
        return frozenset(index for index in own if isinstance(index, int))

    @cached_property
    def shared_cells(self) -> list[tuple[int, int]]:
        """Elements that share cells with an earlier sibling, each with that one; no storeys."""
        return self.tree.shared_cells(self.storeys)

    @cached_property
    def place_sizes(self) -> PartSizes | None:
        """Sizes of parts in which there are free places; None where there are none."""
        return sizes_of_places(self.uses)

    @property
    def clashes(self) -> list[Clash]:
        """Names that two libraries define."""
        return clashes_of(self.document)

    @cached_property
    def surfaces(self) -> Mapping[str, Surface]:
        """Surfaces that the text knows, by name, those of libraries included."""
        return _Values(self.uses.names.surfaces)

    @cached_property
    def primitives(self) -> Mapping[str, Primitive]:
        """Primitives that the text knows, by name, those of libraries included."""
        return _Values(self.uses.names.primitives)

    @cached_property
    def curve_errors(self) -> dict[str, tuple[CurveError, ...]]:
        """Errors in the curves of primitives, by name; primitives without errors are left out."""
        found = ((name, problems(p)) for name, p in self.definition.primitives.items())
        return {name: curve_errors for name, curve_errors in found if curve_errors}

    @cached_property
    def summaries(self) -> dict[str, ShapeSummary]:
        """Summaries of the primitives that elements name; primitives with errors are left out."""
        others = {
            name: self.primitives[name]
            for name in self.tree.shapes - {UNSET}
            if name not in self.definition.primitives and name in self.primitives
        }
        theirs = {name: self._summary(name, p) for name, p in others.items() if not problems(p)}
        return self.own_summaries | theirs

    @cached_property
    def own_summaries(self) -> dict[str, ShapeSummary]:
        """Summaries of the primitives that stand in the file itself, except those with errors."""
        primitives = self.definition.primitives.items()
        return {
            name: self._summary(name, p) for name, p in primitives if name not in self.curve_errors
        }

    @cached_property
    def unread(self) -> dict[str, ReadError]:
        """Errors of rasters whose heights were wanted for summaries, by name of the primitive."""
        return {}

    def _summary(self, name: str, primitive: Primitive) -> ShapeSummary:
        """Summary of a primitive; the heights of a raster are read where steps have a limit."""
        summary, grid = summarise_shape(primitive), primitive.grid
        if self.max_step is not None and isinstance(grid, LinkedGrid):
            try:
                return with_heights(summary, grid.source)
            except ReadError as error:
                self.unread[name] = error
        return summary


def _lacks(document: SourceDocument) -> bool:
    """Whether a file is broken, or a library that it names cannot be had."""
    return None in document.uses or document.broken is not None


_Value = TypeVar("_Value")


class _Values(Mapping[str, _Value]):
    """Values of names, without the files that they stand in."""

    def __init__(self, names: Mapping[str, Named[Any]]) -> None:
        self._names = names

    def __getitem__(self, name: str) -> _Value:
        value: _Value = self._names[name].value
        return value

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


WHEEL_KEYS = tuple(key for key in SLOTS[WheelsText] if key in SLOTS[AxleText])
"""Keys of wheels that an axle may have of its own."""


class VehicleSubject(_Subject, frozen=True, kw_only=True):
    """Subject of rules about vehicles.

    Attributes:
        vehicle: model without the values that did not fit.
    """

    vehicle: VehicleText

    @cached_property
    def axles(self) -> tuple[AxleText, ...]:
        """Axles in document order, each with an x; empty if not all of them are known."""
        axles = self.vehicle.all_axles
        known = not self.left_out("", "axles", "wheelbase") and not any(
            axle.x is UNSET or self.left_out(f"/axles/{index}", "wheels", "driven")
            for index, axle in enumerate(axles)
        )
        return axles if known else ()

    @cached_property
    def wheels(self) -> tuple[tuple[str, WheelText, WheelText], ...]:
        """Common wheels, and the wheels of each axle that has keys of its own.

        Each item has the pointer, the wheels as they are written there, and the wheels with the
        keys of the common ones. Wheels with a value that did not fit are left out.
        """
        common = self.vehicle.wheels
        if self.left_out("", "wheels") or self.left_out("/wheels", *WHEEL_KEYS):
            return ()
        own = (
            (f"/axles/{index}", axle, self.vehicle.wheels_of(axle))
            for index, axle in enumerate(self.vehicle.all_axles)
            if axle.has_own and not self.left_out(f"/axles/{index}", *WHEEL_KEYS)
        )
        return ("/wheels", common, common), *own

    def figure(self, index: int, key: str) -> float | UnsetType:
        """Figure of the wheels of one of `axles`; UNSET where it is not known."""
        if self.left_out(f"/axles/{index}", key):
            return UNSET
        wheels = self.vehicle.wheels_of(self.axles[index])
        figure: float | UnsetType = getattr(wheels, SLOTS[AxleText][key].name)
        return figure

    def figures(self, key: str) -> tuple[float, ...]:
        """Figures of the wheels of `axles`, in their order; empty if one is not known."""
        found = [self.figure(index, key) for index in range(len(self.axles))]
        known = tuple(figure for figure in found if figure is not UNSET)
        return known if len(known) == len(found) else ()

    def place(self, index: int, key: str) -> str:
        """Pointer of a key of the wheels of an axle: in the axle, or in the common wheels."""
        own = getattr(self.vehicle.all_axles[index], SLOTS[AxleText][key].name) is not UNSET
        return f"/axles/{index}/{key}" if own else f"/wheels/{key}"


class SensorSubject(_Subject, frozen=True, kw_only=True):
    """Subject of rules about sensors.

    Attributes:
        sensor: model without the values that did not fit.
    """

    sensor: SensorText


class CurriculumSubject(_Subject, frozen=True, kw_only=True):
    """Subject of rules about specs of training tiles.

    Attributes:
        curriculum: model without the values that did not fit.
        tiles: terrains that tiles are made of, or what is wrong with them, by names of kinds.
    """

    curriculum: CurriculumText
    tiles: Mapping[str, TileSource | list[TileProblem]] = {}


def faces_of(tree: Tree) -> Iterator[tuple[int, str, str]]:
    """Yield each element whose other face has a primitive, the pointer of its name, and the name.

    The pointer begins at the element.
    """
    for index, key, storey in storeys_of(tree):
        if storey.face is not UNSET:
            yield index, f"/{key}/{FACES[type(storey)]}", storey.face


def storeys_of(tree: Tree) -> Iterator[tuple[int, str, Storey]]:
    """Yield each deck and bore: its element, its key, and what the key holds."""
    for key in STOREYS:
        for index, storey in tree.elements_with(key, tree.distinct(key) - {UNSET}):
            yield index, key, storey


_LONG = 80


def short_pointer(tree: Tree, index: int) -> str:
    """JSON pointer of an element for messages, without its beginning where it is long."""
    pointer = tree.pointer(index)
    return pointer if len(pointer) <= _LONG else "…/children/" + pointer.rpartition("/")[2]


Check = Callable[[Any], Iterator[Remark | RemarkBatch]]
"""Generator of a rule; it takes the subject of its kind, such as `Subject` for terrains."""


class Rule(Struct, frozen=True):
    """Rule: code, name, default severity, manual page, and the generator of its remarks.

    Attributes:
        check: generator of the remarks; None if the reader itself reports the code.
        kind: kind of text that `check` looks at; rules about terrains look at libraries, too.
    """

    code: str
    name: str
    severity: Severity
    manual: str
    check: Check | None = None
    kind: Kind = "terrain"

    @property
    def summary(self) -> str:
        """First sentence of the manual page."""
        return self.manual.partition("\n\n")[0].replace("\n", " ")


registry: dict[str, Rule] = {}
"""Rules by code, in the order of registration."""


def rule(
    code: str, name: str, severity: Severity = "error", kind: Kind = "terrain"
) -> Callable[[Check], Check]:
    """Register a generator as a rule about texts of a kind."""

    def register(check: Check) -> Check:
        registry[code] = Rule(code, name, severity, cleandoc(check.__doc__ or ""), check, kind)
        return check

    return register


def reader_rule(code: str, name: str, manual: str, severity: Severity = "error") -> None:
    """Register a code that the reader itself reports."""
    registry[code] = Rule(code, name, severity, cleandoc(manual))
