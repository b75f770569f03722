"""The ground that an edit changed, as a map and as a picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from terratool.errors import RequestError
from terratool.viewing.diff.compare import ComparedDefinitions, DiffOptions
from terratool.viewing.diff.map import refuse_map, write_map


@dataclass(frozen=True, slots=True)
class GroundFiles:
    """Files on the ground of two definitions.

    Attributes:
        map_path: path of a .tif with new less old heights; None for none.
        picture: path of a .png of what was cut and filled; None for none.
        overwrite: whether files may exist.
    """

    map_path: str | Path | None = None
    picture: str | Path | None = None
    overwrite: bool = False

    def check(self) -> None:
        """Refuse files that cannot be written, before any work.

        Raises:
            RequestError: a name has another suffix, or Matplotlib is missing.
            WriteError: a file exists and is not to be overwritten, or has no folder.
        """
        if self.map_path:
            refuse_map(str(self.map_path), self.overwrite)
        if self.picture:
            from terratool.viewing.differences import refuse_picture

            refuse_picture(str(self.picture), self.overwrite)

    def write(
        self,
        compared: ComparedDefinitions,
        options: DiffOptions,
        progress: Callable[[str], object] = lambda _: None,
    ) -> None:
        """Write the map and the picture of two definitions.

        Raises:
            RequestError: the ground of the two cannot be compared.
            WriteError: a file cannot be written.
        """
        both, found = compared.both, compared.difference
        if both is None and (self.map_path or self.picture):
            what = "map" if self.map_path else "picture"
            raise RequestError(
                f"{found.new}: its ground cannot be compared, so that there is no {what}.",
                "Leave it out to see what differs.",
            )
        if self.map_path and both is not None:
            progress(f"writing {self.map_path}")
            write_map(both, str(self.map_path), options.resolution, overwrite=self.overwrite)
        if self.picture and both is not None:
            from terratool.viewing.diff.picture import write_picture

            progress(f"drawing {self.picture}")
            write_picture(
                both, found, str(self.picture),
                tolerance=options.min_change, overwrite=self.overwrite,
            )  # fmt: skip
