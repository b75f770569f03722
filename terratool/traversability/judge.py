"""A vehicle that says where it can be driven, for maps whose cells follow from that."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.text.files import open_file
from terratool.traversability.results import GroundClass
from terratool.traversability.vehicle import Vehicle, load_vehicle

if TYPE_CHECKING:
    from terratool.traversability.survey import Surveyor


@dataclass(frozen=True, slots=True)
class Verdict:
    """What cells are to a vehicle whose middle stands there.

    Attributes:
        vehicle: its name.
        grid: the cells.
        classes: (height, width) uint8 `GroundClass`, rows from the north; UNKNOWN where there is no
            ground.
        lacking: which surfaces lack a soil, in sentences; empty where none does.
        facts: who judged, and how many cells are what, for a manifest.
    """

    vehicle: str
    grid: Grid
    classes: NDArray[np.uint8]
    lacking: str
    facts: Mapping[str, Any]

    @property
    def drivable(self) -> NDArray[np.bool_]:
        """Where it can be driven to, and away from again."""
        classes = self.classes
        return np.asarray((classes == GroundClass.GO) | (classes == GroundClass.CAUTION))

    def at_middles(self, grid: Grid) -> NDArray[np.uint8]:
        """Those at the middles of other cells; beyond these here all is UNKNOWN.

        (height, width), rows from the north.
        """
        own = self.grid
        columns = np.floor((grid.columns(grid.whole) - own.west) / own.resolution).astype(np.int64)
        rows = np.floor((grid.rows(grid.whole) - own.south) / own.resolution).astype(np.int64)
        beyond = (rows >= own.height)[:, None] | (columns >= own.width)
        at = np.minimum(rows, own.height - 1), np.minimum(columns, own.width - 1)
        found: NDArray[np.uint8] = self.classes[::-1][np.ix_(*at)]
        found[beyond] = GroundClass.UNKNOWN
        return found


@dataclass(frozen=True, slots=True)
class Judge:
    """A vehicle, and what a manifest says of its file."""

    vehicle: Vehicle
    file: Mapping[str, str]

    @classmethod
    def of(cls, path: str | Path) -> Judge:
        """The vehicle of a file.

        Raises:
            ReadError: it cannot be read.
            DefinitionError: it has errors, or is a terrain.
        """
        vehicle, path = load_vehicle(path), Path(path)
        file = {"file": path.name}
        if path.is_file():  # and not standard input
            with open_file(path) as opened:
                file["sha256"] = hashlib.file_digest(opened, "sha256").hexdigest()
        return cls(vehicle, file)

    def surveyor(self, terrain: Terrain, grid: Grid) -> Surveyor:
        """What measures cells for the vehicle; made in a moment.

        Raises:
            RequestError: the cells are too coarse or too fine for the vehicle.
        """
        from terratool.traversability.survey import Surveyor

        return Surveyor(terrain, self.vehicle, grid)

    def verdict(self, terrain: Terrain, grid: Grid, progress: Callable[[str], object]) -> Verdict:
        """Judge cells, with the headings of a map of traversability.

        Args:
            terrain: the ground, with all parts written out.
            grid: the cells.
            progress: is called with words that say how far it is.

        Raises:
            RequestError: the cells are too coarse or too fine for the vehicle.
        """
        from terratool.raster.prefetch import processors
        from terratool.traversability.map import MapBuilder, stream_map
        from terratool.traversability.report.wording import lacking_of
        from terratool.traversability.soil import missing_of, turnings

        vehicle, surveyor = self.vehicle, self.surveyor(terrain, grid)
        builder = MapBuilder(terrain, surveyor, False, turnings(terrain, vehicle))
        total, done = grid.width * grid.height, 0

        def told(more: int) -> None:
            nonlocal done
            done += more
            progress(f"judging {vehicle.name}, {100 * done // total} %")

        stream_map(surveyor, builder, None, processors(), told)
        classes, _ = builder.classes(None, vehicle.area)
        classes[~builder.ground] = GroundClass.UNKNOWN
        counts = np.bincount(classes.ravel(), minlength=len(GroundClass)).tolist()
        by_class = dict(zip([one.label for one in GroundClass], counts, strict=True))
        missing = {
            name: missing_of(surface)
            for name, surface in terrain.surface_types.items()
            if surface.void is not True
        }
        bare = bool((builder.surfaces[builder.ground] == 0).any())
        lacking = lacking_of(missing, bare)
        if lacking:
            lacking += " Nothing is known of that ground."
        facts = {
            "vehicle": dict(self.file), "judged_resolution": grid.resolution, "classes": by_class,
        }  # fmt: skip
        return Verdict(vehicle.name, grid, classes, lacking, facts)
