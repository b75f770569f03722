"""Scans as files: what is asked for is looked at first, then frames are read and written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.output import (
    refuse_existing,
    refuse_folder,
    refuse_missing_folder,
    whole_file,
    whole_folder,
)
from terratool.raster.grid_map_bag import files_of_bag
from terratool.sensing.formats.common import Record
from terratool.sensing.formats.images import image_path
from terratool.sensing.formats.table import ScanFormat, format_of
from terratool.sensing.readings import Status
from terratool.sensing.scan import Scan, Tally
from terratool.sensing.sensor import Camera


@dataclass(frozen=True, slots=True)
class ScanOutput:
    """Where a scan goes, and what of it.

    Attributes:
        path: the file, or the folder of a bag.
        world: whether points are in the world's axes; else in the sensor's.
        misses: whether rays without a reading are kept.
        overwrite: whether it may be there already.
    """

    path: Path
    world: bool = True
    misses: bool = False
    overwrite: bool = False

    def checked(self, scan: Scan) -> ScanFormat:
        """The format, if it goes with the scan.

        Raises:
            RequestError: it does not, or what it needs is not installed.
            WriteError: the path cannot be written.
        """
        form = format_of(self.path)
        suffix = self.path.suffix.lower()
        if form.images and not isinstance(scan.sensor.head, Camera):
            raise RequestError(
                f"{self.path}: is an image, and a {scan.sensor.kind} takes none.",
                "Write .ply, .pcd, .las, .npz, .csv or .rosbag2, or take a camera.",
            )
        if self.misses and not form.misses:
            raise RequestError(
                f"{suffix} cannot hold rays without a reading.",
                "Leave out --misses, or write .ply, .pcd, .npz or .csv.",
            )
        if not self.world and not form.axes:
            raise RequestError(
                f"--frame sensor has no effect on {suffix}, which has the sensor's axes anyway.",
                "Leave it out.",
            )
        if not form.folder:
            refuse_existing(self.path, self.overwrite, form.companions)
            for number in range(scan.frames if form.images else 0):
                refuse_existing(image_path(self.path, number, scan.frames), self.overwrite)
        else:
            refuse_folder(self.path, self.overwrite, files_of_bag(self.path))
        refuse_missing_folder(self.path)
        return form


@dataclass(frozen=True, slots=True)
class ScanReport:
    """What was read and written.

    Attributes:
        path: where.
        files: their names; of a bag those in it.
        tally: what was read.
        scan: what was scanned with, and from where.
        surfaces: names of the surfaces, as `Tally.surfaces` has them.
    """

    path: Path
    files: tuple[str, ...]
    tally: Tally
    scan: Scan
    surfaces: tuple[str, ...]

    @property
    def returns(self) -> int:
        """How many rays have a reading."""
        return int(self.tally.statuses[Status.RETURN])

    @property
    def by_surface(self) -> dict[str, int]:
        """Returns by the name of the surface; "" for none. Those that have none are left out."""
        names = [*self.surfaces, ""]
        return {
            name: int(count)
            for name, count in zip(names, self.tally.surfaces, strict=True)
            if count
        }

    @property
    def lacking(self) -> list[str]:
        """Surfaces that a sonar met, and whose reflection had to be assumed."""
        return [self.surfaces[index] for index in sorted(self.tally.lacking)]


def export_scan(
    terrain: Terrain,
    scan: Scan,
    output: ScanOutput,
    progress: Callable[[int], None] | None = None,
) -> ScanReport:
    """Read all frames of a scan and write them.

    Args:
        terrain: what is scanned.
        scan: how.
        output: where to.
        progress: is told how many rays more are done.

    Raises:
        RequestError: the format does not go with the scan, or a pose cannot be.
        WriteError: the file cannot be written.
    """
    form = output.checked(scan)
    scan = scan.placed(terrain)
    record = Record(terrain, scan.sensor, scan.frames, output.world, output.misses)
    tally = Tally.of(terrain)
    frames = tally.counting(scan.read(terrain, progress))
    if form.folder:
        own = files_of_bag(output.path)
        with whole_folder(output.path, output.overwrite, own) as part:
            form.write(part, frames, record)
            files = tuple(sorted(own))
    else:
        with whole_file(output.path, output.overwrite, form.companions) as part:
            form.write(part, frames, record)
            files = tuple(sorted(one.name for one in part.parent.iterdir()))
    return ScanReport(output.path, files, tally, scan, terrain.surfaces)
