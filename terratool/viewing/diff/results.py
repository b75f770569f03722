"""Records of differences between two definitions; lengths are in world units."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from msgspec import UNSET, Struct, UnsetType

from terratool.definition.findings import Bounds
from terratool.report.documents import Count, Document, each_of

ChangeKind = Literal["added", "removed", "moved", "changed"]
EntryKind = Literal["added", "removed", "renamed", "changed"]
Dictionary = Literal["surface", "primitive", "part"]
FileStatus = Literal["same", "different", "added", "removed", "invalid", "unreadable"]
Pair = tuple[float, float]


class KeyChange(Struct, frozen=True):
    """Old and new value of a key.

    Attributes:
        key: name of the key; a word such as place, parent or order where no key is written.
        old, new: values as text, empty where there is none.
    """

    key: str
    old: str
    new: str


class EntryChange(Struct, frozen=True):
    """A difference in a surface, a primitive or a part.

    Attributes:
        dictionary: kind of the entry.
        kind: kind of the change.
        name: name in the new definition; in the old one where the entry was removed.
        was: name in the old definition, if the entry was renamed; else empty.
        keys: keys that differ.
        used: number of elements that use a surface or a primitive, parts and copies written out;
            for a part, number of elements of the text that place it.
        places: JSON pointers of the first elements that use the entry.
    """

    dictionary: Dictionary
    kind: EntryKind
    name: str
    was: str = ""
    keys: tuple[KeyChange, ...] = ()
    used: int = 0
    places: tuple[str, ...] = ()


class ElementPlace(Struct, frozen=True):
    """Place of an element in the text and in the world.

    Attributes:
        pointer: JSON pointer of the element, with the file before it in a library.
        file: name of the file that has the element.
        line: line in that file, from 1; 0 where it was not looked up.
        bounds: world rectangle of the cell; None in a part, which stands in many places.
    """

    pointer: str
    file: str
    line: int
    bounds: Bounds | None = None


class ElementChange(Struct, frozen=True):
    """A difference in an element, or in a track.

    Attributes:
        kind: kind of the change.
        what: primitive or part of the element, in the new definition if the element is there.
        descr: description of the element; empty for none.
        old, new: old and new place; None where the element is only on the other side.
        shift: movement of the middle of the cell, east and north; None if it did not move.
        keys: keys that differ.
        elements: number of elements that the text has in this one, itself included.
        part: name of the part that has the element; empty for the terrain itself.
    """

    kind: ChangeKind
    what: str
    descr: str = ""
    old: ElementPlace | None = None
    new: ElementPlace | None = None
    shift: Pair | None = None
    keys: tuple[KeyChange, ...] = ()
    elements: int = 1
    part: str = ""

    @property
    def place(self) -> ElementPlace:
        """New place of the element; the old one if the element was removed."""
        place = self.new or self.old
        assert place is not None
        return place


class ComparedGrid(Struct, frozen=True):
    """Grid of pixels whose centres were compared.

    Attributes:
        bounds: west, south, east, north edge of the grid.
        resolution: side of a pixel.
        width, height: number of pixels along x and along y.
    """

    bounds: Bounds
    resolution: float
    width: int
    height: int


class LargestChange(Struct, frozen=True):
    """Largest difference of heights at a pixel centre.

    Attributes:
        x, y: world coordinates of the pixel centre.
        old, new: heights there.
        old_element, new_element: JSON pointers of the elements that decide the surface there; None
            for none.
    """

    x: float
    y: float
    old: float
    new: float
    old_element: str | None
    new_element: str | None

    @property
    def change(self) -> float:
        """New height less old height."""
        return self.new - self.old


class SurfaceArea(Struct, frozen=True):
    """Area of ground that changed from one surface to another.

    Attributes:
        old, new: names of the surfaces in the new definition; None for no surface.
        area: area of this ground.
    """

    old: str | None
    new: str | None
    area: float


class GroundChange(Struct, frozen=True):
    """Differences of the ground in the rectangle that both terrains have.

    Attributes:
        grid: pixels that were compared; volumes and areas are sums over them.
        tolerance: largest difference of heights that does not count as changed ground.
        common: area of the rectangle that both terrains, and the bounds asked for, have in common.
        cut: volume of old ground over new.
        fill: volume of new ground over old.
        error: difference of the volumes from those of pixels twice as wide, m³; no bound, as
            heights that jump along round edges may make the volumes less exact.
        changed: area where heights differ by more than the tolerance.
        around: rectangle around the changed area; None if nothing changed.
        largest: largest difference of heights; None if no heights differ.
        lost, gained: area where ground became void, and where void became ground.
        surfaces: areas whose surface differs, the largest first.
        left, joined: area of the old terrain outside of the new one, and of the new terrain
            outside of the old one.
    """

    grid: ComparedGrid
    tolerance: float
    common: float
    cut: float = 0.0
    fill: float = 0.0
    error: float = 0.0
    changed: float = 0.0
    around: Bounds | None = None
    largest: LargestChange | None = None
    lost: float = 0.0
    gained: float = 0.0
    surfaces: tuple[SurfaceArea, ...] = ()
    left: float = 0.0
    joined: float = 0.0

    @property
    def is_same(self) -> bool:
        """Whether no height, surface or void differs at any pixel centre, nor any edge."""
        areas = self.lost, self.gained, self.left, self.joined
        return self.largest is None and not self.surfaces and not any(areas)


class ComparedStorey(Struct, frozen=True):
    """A deck or a bore of one side, at the centres of pixels over its footprint.

    Attributes:
        pointer: JSON pointer of its element, with that of a copy or in a part.
        bounds: world rectangle around its footprint.
        top: least and largest height of its top, or of the floor of a bore; None for none.
        face: those of its underside, or of its ceiling.
        clearance: least and largest room below that, down to the next top; None for none.
        area: area of its footprint, without holes.
        volume: volume between its faces.
    """

    pointer: str
    bounds: Bounds
    top: Pair | None
    face: Pair | None
    clearance: Pair | None
    area: float
    volume: float


class StoreyChange(Struct, frozen=True):
    """A difference in a deck or a bore.

    Attributes:
        kind: kind of the change.
        what: what it is.
        old, new: the storey on each side; None where it is only on the other one.
        shift: movement to the east and to the north; None if its size differs, too, or it stays.
        top: least and largest change of the top, or of the floor; None within the tolerance.
        face: those of the underside, or of the ceiling.
        clearance: those of the room below that.
    """

    kind: ChangeKind
    what: Literal["deck", "bore"]
    old: ComparedStorey | None = None
    new: ComparedStorey | None = None
    shift: Pair | None = None
    top: Pair | None = None
    face: Pair | None = None
    clearance: Pair | None = None


class Flip(Struct, frozen=True):
    """Ground that changed from one class of verdicts to another.

    Attributes:
        old, new: names of the classes, those of a traversability map.
        area: area of this ground.
        share: share of the ground that both terrains have, from 0 to 1.
        x, y: world coordinates of the first such pixel centre, from the north-west.
    """

    old: str
    new: str
    area: float
    share: float
    x: float
    y: float


class VerdictChange(Struct, frozen=True):
    """Differences of a vehicle's verdicts.

    Attributes:
        vehicle: name of the vehicle.
        grid: pixels of both maps.
        ground: area on which both terrains have ground.
        worse, better: shares of that area that got worse and better, from 0 to 1.
        old, new: share of that area in each class, by the name of the class.
        flips: changes of class, the largest first.
    """

    vehicle: str
    grid: ComparedGrid
    ground: float
    worse: float
    better: float
    old: dict[str, float]
    new: dict[str, float]
    flips: tuple[Flip, ...]


class Difference(Struct, frozen=True):
    """All differences between two definitions.

    Attributes:
        old, new: names of the files.
        same: whether both are the same terrain, whatever their texts look like.
        frame: size, origin and crs, where these differ.
        entries: surfaces, primitives and parts in use that differ.
        elements: elements that differ, in the order of the text.
        tracks: tracks that differ, the changed first, then the removed and the added.
        notes: sentences on differences that change no terrain.
        ground: differences of the ground; None where it cannot differ, or cannot be compared.
        verdicts: differences of verdicts, for each vehicle that was asked for.
        storeys: decks and bores that differ; not there if neither terrain has any, or they are not
            compared.
    """

    old: str
    new: str
    same: bool
    frame: tuple[KeyChange, ...] = ()
    entries: tuple[EntryChange, ...] = ()
    elements: tuple[ElementChange, ...] = ()
    tracks: tuple[ElementChange, ...] = ()
    notes: tuple[str, ...] = ()
    ground: GroundChange | None = None
    verdicts: tuple[VerdictChange, ...] = ()
    storeys: tuple[StoreyChange, ...] | UnsetType = UNSET

    def count(self, kind: ChangeKind) -> int:
        """Number of elements and tracks with a kind of change."""
        return sum(change.kind == kind for change in (*self.elements, *self.tracks))


class FileDifference(Struct, frozen=True):
    """Result for one file, or for two files of one name.

    Attributes:
        file: name of the file; for folders, the name below both.
        status: result of the comparison.
        difference: differences; None unless both files could be read.
        message: one sentence on a file that is on one side only, or cannot be compared.
        hint: advice where the files cannot be compared; else empty.
    """

    file: str
    status: FileStatus
    difference: Difference | None = None
    message: str = ""
    hint: str = ""

    @staticmethod
    def of(file: str, found: Difference) -> FileDifference:
        """Result for two files that could be read."""
        return FileDifference(file, "same" if found.same else "different", found)


class Comparison(Struct, frozen=True):
    """Results for all files."""

    files: tuple[FileDifference, ...]

    def count(self, *statuses: FileStatus) -> int:
        """Number of files whose status is one of these."""
        return sum(file.status in statuses for file in self.files)

    @property
    def same(self) -> bool:
        """Whether all files are the same terrains."""
        return self.count("same") == len(self.files)


class DiffDocument(Document, frozen=True, kw_only=True):
    """Findings of `terratool diff`: changes of elements, surfaces and ground, file by file.

    Lengths are in units of the terrain; null stands for what there is not.

    Attributes:
        same: whether all files are the same terrains.
        summary: number of files by status.
        files: one entry for two files, one for each name for two folders.
    """

    same: bool
    summary: Annotated[dict[FileStatus, Count], each_of(get_args(FileStatus))]
    files: tuple[FileDifference, ...]
