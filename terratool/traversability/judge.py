"""Cells judged by a vehicle, for maps of robots that follow from where it can be driven."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.text.files import open_file
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.vehicle_files import load_vehicle
from terratool.traversability.verdicts import GroundClass

if TYPE_CHECKING:
    from terratool.cluster import Crew
    from terratool.traversability.survey import Surveyor


@dataclass(frozen=True, slots=True)
class CellVerdict:
    """Cells judged by a vehicle whose middle stands at their centres.

    Attributes:
        vehicle: name of the vehicle.
        grid: the cells.
        classes: (height, width) uint8 `GroundClass`, rows from the north; UNKNOWN where there is no
            ground.
        worst: (height, width) uint8, the same with the verdict of the worst heading where `classes`
            has a verdict.
        lacking: sentences on surfaces without a soil; empty where all have one.
        facts: the vehicle's file, the resolution and the cells by class, for a manifest.
        storeys: the same of each sheet of storeys; where it has no top a cell is UNKNOWN. Empty
            for a terrain without storeys.
    """

    vehicle: str
    grid: Grid
    classes: NDArray[np.uint8]
    worst: NDArray[np.uint8]
    lacking: str
    facts: Mapping[str, Any]
    storeys: tuple[CellVerdict, ...] = ()

    @property
    def drivable(self) -> NDArray[np.bool_]:
        """Cells that are go or caution, (height, width) bool, rows from the north."""
        classes = self.classes
        return np.asarray((classes == GroundClass.GO) | (classes == GroundClass.CAUTION))

    def at_middles(self, grid: Grid) -> NDArray[np.uint8]:
        """Classes at the middles of another grid's cells, (height, width), rows from the north.

        Cells north or east of this grid are UNKNOWN.
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
    """A vehicle that judges cells.

    Attributes:
        vehicle: the vehicle.
        file: name and SHA-256 of the vehicle's file, for a manifest.
    """

    vehicle: Vehicle
    file: Mapping[str, str]

    @classmethod
    def of(cls, path: str | Path) -> Judge:
        """Read the vehicle of a file.

        Raises:
            ReadError: the file cannot be read.
            DefinitionError: the file has errors, or is a terrain.
        """
        vehicle, path = load_vehicle(path), Path(path)
        file = {"file": path.name}
        if path.is_file():  # and not standard input
            with open_file(path) as opened:
                file["sha256"] = hashlib.file_digest(opened, "sha256").hexdigest()
        return cls(vehicle, file)

    def surveyor(self, terrain: Terrain, grid: Grid) -> Surveyor:
        """The surveyor that measures a grid's cells for the vehicle; none are measured yet.

        Raises:
            RequestError: the cells are too coarse or too fine for the vehicle.
        """
        from terratool.traversability.survey import Surveyor

        return Surveyor(terrain, self.vehicle, grid)

    def verdict(
        self, terrain: Terrain, grid: Grid, progress: Callable[[str], object],
        crew: Crew | None = None,
    ) -> CellVerdict:  # fmt: skip
        """Judge the cells of a grid at `HEADINGS` headings, those of the lowest tops first.

        Args:
            terrain: the ground, with all parts written out.
            grid: the cells.
            progress: called with words that say how many percent are done.
            crew: crew that judges; as many threads as processors if None.

        Raises:
            RequestError: the cells are too coarse or too fine for the vehicle, or the terrain is in
                degrees.
        """
        from terratool.cluster import Threads
        from terratool.tasks import processors
        from terratool.traversability.map import MapBuilder, stream_map
        from terratool.traversability.report.wording import lacking_of
        from terratool.traversability.soil import missing_of, turnings

        terrain.refuse_degrees("A vehicle")
        vehicle, surveyor = self.vehicle, self.surveyor(terrain, grid)
        builder = MapBuilder(terrain, surveyor, False, turnings(terrain, vehicle))
        total, done = grid.width * grid.height * builder.stack.layers, 0

        def report(more: int) -> None:
            nonlocal done
            done += more
            progress(f"judging {vehicle.name}, {100 * done // total} %")

        stream_map(surveyor, builder, None, crew or Threads(processors()), report)
        classes, _ = builder.classes(None, vehicle.area)
        classes[~builder.ground] = GroundClass.UNKNOWN
        missing = {
            name: missing_of(surface)
            for name, surface in terrain.surface_types.items()
            if surface.void is not True
        }
        bare = bool((builder.surfaces[builder.ground] == 0).any())
        lacking = lacking_of(missing, bare)
        if lacking:
            lacking += " Nothing is known of that ground."
        worst = builder.worst_classes(classes)
        first, *storeys = (
            self._of_sheet(grid, builder.of_sheet(classes, n), builder.of_sheet(worst, n), lacking)
            for n in range(builder.stack.sheets)
        )
        return replace(first, storeys=tuple(storeys))

    def _of_sheet(
        self, grid: Grid, classes: NDArray[np.uint8], worst: NDArray[np.uint8], lacking: str
    ) -> CellVerdict:
        counts = np.bincount(classes.ravel(), minlength=len(GroundClass)).tolist()
        by_class = dict(zip([one.label for one in GroundClass], counts, strict=True))
        facts = {
            "vehicle": dict(self.file), "judged_resolution": grid.resolution, "classes": by_class,
        }  # fmt: skip
        return CellVerdict(self.vehicle.name, grid, classes, worst, lacking, facts)
