"""What differs between two definitions, as frozen records; lengths in units of the terrain."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from terratool.definition.findings import Bounds
from terratool.report.documents import Document

ChangeKind = Literal["added", "removed", "moved", "changed"]
EntryKind = Literal["added", "removed", "renamed", "changed"]
Dictionary = Literal["surface", "primitive", "part"]
FileStatus = Literal["same", "different", "added", "removed", "invalid", "unreadable"]
Pair = tuple[float, float]


class KeyChange(Struct, frozen=True):
    """A key whose value differs.

    Attributes:
        key: its name; of what has no key what it is, as place, parent or order.
        old, new: its values as text, empty where there is none.
    """

    key: str
    old: str
    new: str


class EntryChange(Struct, frozen=True):
    """A surface, a primitive or a part that differs.

    Attributes:
        dictionary: what it is.
        kind: what became of it.
        name: in the new definition; in the old one where it was removed.
        was: in the old definition, if it was renamed; else empty.
        keys: that differ.
        used: elements that wear a surface or have a primitive, parts and copies written out; of a
            part the elements of the text that it stands in.
        places: names of the first of these elements, as they stand in the text.
    """

    dictionary: Dictionary
    kind: EntryKind
    name: str
    was: str = ""
    keys: tuple[KeyChange, ...] = ()
    used: int = 0
    places: tuple[str, ...] = ()


class ElementPlace(Struct, frozen=True):
    """Where an element stands.

    Attributes:
        pointer: its name.
        file: the file that it stands in.
        line: there, from 1.
        bounds: the world rectangle of its cell; None in a part, which stands in many places.
    """

    pointer: str
    file: str
    line: int
    bounds: Bounds | None = None


class ElementChange(Struct, frozen=True):
    """An element, or a track, that differs.

    Attributes:
        kind: what became of it.
        what: its primitive or its part, in the new definition where it is there.
        descr: what it says of itself.
        old, new: where it stood and stands; None where it does not.
        shift: how far the middle of its cell moved, to the east and to the north.
        keys: that differ.
        elements: how many the text has in it, itself included.
        part: the part that it is in; empty for the terrain itself.
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
        """Where it stands, or stood."""
        place = self.new or self.old
        assert place is not None
        return place


class PixelGrid(Struct, frozen=True):
    """The pixels whose centres were compared.

    Attributes:
        bounds: west, south, east, north of their edges.
        resolution: side of a pixel.
        width, height: how many there are along x and along y.
    """

    bounds: Bounds
    resolution: float
    width: int
    height: int


class LargestChange(Struct, frozen=True):
    """Where heights differ most, of the pixel centres.

    Attributes:
        x, y: the place.
        old, new: the heights.
        old_element, new_element: what decides the surface there.
    """

    x: float
    y: float
    old: float
    new: float
    old_element: str | None
    new_element: str | None

    @property
    def change(self) -> float:
        """New less old."""
        return self.new - self.old


class SurfaceArea(Struct, frozen=True):
    """Ground that wore one surface and wears another.

    Attributes:
        old, new: their names, in the new definition where one was renamed; None for no surface.
        area: of it.
    """

    old: str | None
    new: str | None
    area: float


class GroundChange(Struct, frozen=True):
    """What became of the ground that both terrains have.

    Attributes:
        grid: what was compared; the volumes are sums over its pixels.
        tolerance: what heights may differ by.
        common: area of the rectangle that both terrains, and the bounds asked for, have in common.
        cut: volume of old ground over new.
        fill: volume of new ground over old.
        error: how far the volumes are from those of pixels twice as wide, m³; no bound, as where
            heights jump along round edges they may be off by more.
        changed: area where heights differ by more than the tolerance.
        around: the rectangle around that, None where there is none.
        largest: where they differ most; None where they do nowhere.
        lost, gained: areas where there was ground and is none, and the other way around.
        surfaces: areas whose surface differs, the largest first.
        left, joined: areas of the old terrain outside of the new one, and of the new outside of
            the old.
    """

    grid: PixelGrid
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


class Flip(Struct, frozen=True):
    """Ground that was one thing to a vehicle and is another.

    Attributes:
        old, new: classes of ground, as in a map of verdicts.
        area: of it.
        share: of the ground that both terrains have.
        x, y: the first such place from the north-west.
    """

    old: str
    new: str
    area: float
    share: float
    x: float
    y: float


class VerdictChange(Struct, frozen=True):
    """What became of a vehicle's verdicts.

    Attributes:
        vehicle: its name.
        grid: the pixels of both maps.
        ground: area that both terrains have ground on.
        worse, better: shares of it that got worse and better.
        old, new: share of the ground in each class that there is.
        flips: the largest first.
    """

    vehicle: str
    grid: PixelGrid
    ground: float
    worse: float
    better: float
    old: dict[str, float]
    new: dict[str, float]
    flips: tuple[Flip, ...]


class Difference(Struct, frozen=True):
    """What differs between two definitions.

    Attributes:
        old, new: the names of their files.
        same: whether they are the same terrain, whatever their texts look like.
        frame: size, origin and crs, where these differ.
        entries: surfaces, primitives and parts in use that differ.
        elements: in the order of the text.
        tracks: likewise.
        notes: sentences on what differs and changes no terrain.
        ground: None where nothing can differ, or cannot be compared.
        verdicts: of each vehicle that was asked for.
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

    def count(self, kind: ChangeKind) -> int:
        """How many elements and tracks became that."""
        return sum(change.kind == kind for change in (*self.elements, *self.tracks))


class FileDifference(Struct, frozen=True):
    """What became of one file.

    Attributes:
        file: its name, in folders that under both.
        status: what became of it.
        difference: where both could be read.
        message: one sentence on a file that is on one side only, or cannot be compared.
        hint: what to do.
    """

    file: str
    status: FileStatus
    difference: Difference | None = None
    message: str = ""
    hint: str = ""


class Comparison(Struct, frozen=True):
    """What became of all files."""

    files: tuple[FileDifference, ...]

    def count(self, *statuses: FileStatus) -> int:
        """How many files became one of these."""
        return sum(file.status in statuses for file in self.files)

    @property
    def same(self) -> bool:
        """Whether all are."""
        return self.count("same") == len(self.files)


class DiffDocument(Document, frozen=True, kw_only=True):
    """What differs, as JSON; see schemas/difference.schema.json."""

    same: bool
    summary: dict[FileStatus, int]
    files: tuple[FileDifference, ...]
