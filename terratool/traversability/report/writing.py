"""Assessment of vehicles into their reports and maps, of which all or none appear."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from terratool.output import whole_file
from terratool.traversability.assess import assess
from terratool.traversability.compare import PreparedComparison, map_path_of
from terratool.traversability.map_files import map_paths
from terratool.traversability.preparing import PreparedRequest
from terratool.traversability.report.formats import renderer_of
from terratool.traversability.results import Reports, TraversabilityReport, VehicleComparison
from terratool.traversability.route.headings import Progress


@dataclass(frozen=True, slots=True)
class JudgementFiles:
    """Files of an assessment.

    Attributes:
        reports: reports, each in the format of its suffix.
        map_path: path of the map; the names of several vehicles are put into it. None for no map.
        overwrite: whether files may exist.
    """

    reports: tuple[str | Path, ...] = ()
    map_path: str | Path | None = None
    overwrite: bool = False

    def map_of(self, vehicle: str, several: bool) -> Path | None:
        """Path of the map of one vehicle; None for no map."""
        if self.map_path is None:
            return None
        return map_path_of(self.map_path, vehicle) if several else Path(self.map_path)

    def paths(self, vehicles: Sequence[str]) -> list[Path]:
        """Paths of all files for vehicles with these names: those of the maps, then the reports."""
        several = len(vehicles) > 1
        maps = [path for name in vehicles if (path := self.map_of(name, several)) is not None]
        return [*(file for path in maps for file in map_paths(path)), *map(Path, self.reports)]


NO_FILES = JudgementFiles()
"""No file at all."""


def assess_all(
    planned: PreparedComparison,
    name: str = "",
    files: JudgementFiles = NO_FILES,
    progress: Progress | None = None,
    begin: Callable[[PreparedRequest | None], object] = lambda _: None,
) -> Reports:
    """Find out of each vehicle whether, where and why not it can drive, and write the files.

    Every file is complete before the first one takes its place.

    Args:
        planned: checked requests, of which none is left afterwards, as each holds much memory.
        name: name of the terrain, for people.
        files: files to write.
        progress: called with the number of pixels done; its `say` names the step.
        begin: called with each request before it is answered, and with None before files are
            written.

    Raises:
        RequestError: no report has such a suffix, or a figure of a surface is too large.
        WriteError: a file exists already, or cannot be written.
    """
    renderers = list(map(renderer_of, files.reports))
    requests, several = planned.requests, len(planned.requests) > 1

    def reports(stack: contextlib.ExitStack) -> Iterator[TraversabilityReport]:
        while requests:
            one = requests.pop(0)
            begin(one)
            yield assess(
                one, name=name, map_path=files.map_of(one.vehicle.name, several),
                overwrite=files.overwrite, progress=progress, stack=stack,
            )  # fmt: skip

    with contextlib.ExitStack() as stack:
        parts = [stack.enter_context(whole_file(one, files.overwrite)) for one in files.reports]
        found = tuple(reports(stack))
        result: Reports = VehicleComparison(found, planned.notes) if several else found[0]
        if parts or files.map_path:
            begin(None)
        for part, render in zip(parts, renderers, strict=True):
            part.write_text(render(result), encoding="utf-8", newline="\n")
    return result
