"""Scan export: checks of the request, then simulation and writing frame by frame."""

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
from terratool.sensing.readings import ReadingStatus
from terratool.sensing.scan import Scan, ScanTally
from terratool.sensing.sensor import Camera

_LARGEST_INTENSITY = 65535
"""Largest intensity of any driver, that of 16 bits."""


@dataclass(frozen=True, slots=True)
class ScanOutput:
    """Destination and content of a scan file.

    Attributes:
        path: file to write, or folder of a bag.
        world: whether points are in world axes; else in sensor axes.
        misses: whether rays without a reading are kept.
        overwrite: whether to replace existing files.
        intensity_max: intensity that stands for 1, that of a white surface met squarely.
    """

    path: Path
    world: bool = True
    misses: bool = False
    overwrite: bool = False
    intensity_max: float = 1.0

    def checked_format(self, scan: Scan) -> ScanFormat:
        """Format of the path, checked against the scan.

        Raises:
            RequestError: the format does not hold the scan, or needs a package that is missing.
            WriteError: the path exists or cannot be written.
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
        if self.intensity_max != 1.0:
            self._check_intensity(form, scan)
        if not form.folder:
            refuse_existing(self.path, self.overwrite, form.companions)
            for number in range(scan.frames if form.images else 0):
                refuse_existing(image_path(self.path, number, scan.frames), self.overwrite)
        else:
            refuse_folder(self.path, self.overwrite, files_of_bag(self.path))
        refuse_missing_folder(self.path)
        return form

    def _check_intensity(self, form: ScanFormat, scan: Scan) -> None:
        """Refuse a largest intensity that is no number for one, or of which nothing is written.

        Raises:
            RequestError: it is refused.
        """
        if not 0.0 < self.intensity_max <= _LARGEST_INTENSITY:
            raise RequestError(
                f"The largest intensity is {self.intensity_max:g}.",
                f"Give a number above 0, up to {_LARGEST_INTENSITY:,}, with --intensity-max: "
                "255 is usual.",
            )
        suffix, kind = self.path.suffix.lower(), scan.sensor.kind
        if form.images or (form.folder and kind == "camera"):
            why = f"on images, and {suffix} has these of a camera"
        elif kind == "sonar":
            why = "on a sonar, whose intensities are amplitudes"
        elif not form.intensity:
            why = f"on {suffix}, whose intensities are from 0 to 65,535 anyway"
        else:
            return
        raise RequestError(f"--intensity-max has no effect {why}.", "Leave it out.")


@dataclass(frozen=True, slots=True)
class ScanReport:
    """Report of an exported scan.

    Attributes:
        path: file, or folder of a bag.
        files: names of all files written; of a bag those within.
        tally: counts of the readings.
        scan: sensor, poses and options of the scan.
        surfaces: names of the surfaces, in the order of `ScanTally.surfaces`.
    """

    path: Path
    files: tuple[str, ...]
    tally: ScanTally
    scan: Scan
    surfaces: tuple[str, ...]

    @property
    def returns(self) -> int:
        """Number of rays with a reading."""
        return int(self.tally.statuses[ReadingStatus.RETURN])

    @property
    def by_surface(self) -> dict[str, int]:
        """Number of returns by surface name, "" for none; names without returns are left out."""
        names = [*self.surfaces, ""]
        return {
            name: int(count)
            for name, count in zip(names, self.tally.surfaces, strict=True)
            if count
        }

    @property
    def lacking(self) -> list[str]:
        """Names of surfaces without `sonarRefl` that a sonar met."""
        return [self.surfaces[index] for index in sorted(self.tally.lacking)]


def export_scan(
    terrain: Terrain,
    scan: Scan,
    output: ScanOutput,
    progress: Callable[[int], None] | None = None,
) -> ScanReport:
    """Simulate all frames of a scan and write them.

    Args:
        terrain: terrain to be scanned.
        scan: sensor, poses and options.
        output: destination and content of the file.
        progress: called with the number of rays done since its last call.

    Raises:
        RequestError: the format does not hold the scan, a pose is outside or below the ground, or
            the terrain is in degrees.
        WriteError: the file exists or cannot be written.
    """
    terrain.refuse_degrees("A sensor")
    form = output.checked_format(scan)
    scan = scan.check_poses(terrain)
    record = Record(
        terrain, scan.sensor, scan.frames, output.world, output.misses, output.intensity_max
    )
    tally = ScanTally.of(terrain)
    frames = tally.count(scan.read(terrain, progress))
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
