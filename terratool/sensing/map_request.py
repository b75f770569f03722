"""A map of scans as it is asked for: cells, noise of the sensor, and files."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from terratool.definition.findings import Bounds
from terratool.errors import RequestError, WriteError
from terratool.output import is_same_file
from terratool.sensing.map_files import MapOutput
from terratool.sensing.patches import GAP
from terratool.sensing.robot_map import SIGMA, MapOptions, RobotMap, map_scans
from terratool.sensing.sensor import Noise, Sensor, load_sensor

Place = tuple[float, float, float]
"""World x, y and z, m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MapRequest:
    """Options of a map of scans and of its files.

    Attributes:
        resolution: side of the finest cells, m.
        levels: number of sizes of cells, each twice the one before; a file OUT.level-1.tif, … for
            each.
        storeys: up to so many patches a cell, from below, in bands elevation-1, …, so that what
            stands over other ground is one of its own; None for one height a cell.
        gap: distance of heights up to which readings are of one patch, m; 0.5 if None.
        bounds: world rectangle west, south, east, north of the map; all readings if None.
        sensor_at: x, y and z of the sensor, m, for scans that do not say where it was.
        sigma: standard deviation of ranges, m; 0.02 if None.
        sensor: sensor whose noise counts instead, or the path of its file.
        crs: reference system of the scans, which the files name.
        bag: folder that becomes a bag of ROS 2, of grid_maps; None for no bag.
        overwrite: whether files may exist.
    """

    resolution: float
    levels: int = 3
    storeys: int | None = None
    gap: float | None = None
    bounds: Bounds | None = None
    sensor_at: Place | None = None
    sigma: float | None = None
    sensor: Sensor | str | Path | None = None
    crs: str | None = None
    bag: str | Path | None = None
    overwrite: bool = False

    def __post_init__(self) -> None:
        self._options(Noise())  # refuses numbers that make no map
        if self.gap is not None and self.storeys is None:
            raise RequestError(
                "--gap is about patches, and the map has none.", "Give --storeys, or leave it out."
            )
        if self.sigma is not None and self.sensor is not None:
            raise RequestError(
                "Both --sigma and --sensor say how far ranges are off.", "Keep one of them."
            )
        if self.sigma is not None and not 0.0 < self.sigma < math.inf:
            raise RequestError(
                f"The standard deviation of ranges is {self.sigma:g} m.",
                "Give a finite length above 0.",
            )

    def output_of(self, output: str | Path, scans: Sequence[str | Path]) -> MapOutput:
        """Files of the map, which can be written.

        Raises:
            RequestError, WriteError: `MapOutput.check` raises them, or the output is a scan.
        """
        for scan in scans:
            if is_same_file(output, str(scan)):
                raise WriteError(f"{output}: is read, too.", "Choose another name.")
        bag = Path(self.bag) if self.bag else None
        found = MapOutput(Path(output), self.levels, bag, self.crs, self.overwrite)
        found.check()
        return found

    @property
    def options(self) -> MapOptions:
        """Cells and noise of the map.

        Raises:
            ReadError, DefinitionError: the sensor's file cannot be read, or has errors.
        """
        noise = Noise(sigma=SIGMA if self.sigma is None else self.sigma)
        if isinstance(self.sensor, Sensor):
            noise = self.sensor.noise
        elif self.sensor is not None:
            noise = load_sensor(self.sensor).noise
        return self._options(noise)

    def _options(self, noise: Noise) -> MapOptions:
        gap = GAP if self.gap is None else self.gap
        return MapOptions(self.resolution, self.levels, noise, storeys=self.storeys, gap=gap)

    def read(
        self, scans: Sequence[str | Path], progress: Callable[[str], Any] = lambda _: None
    ) -> RobotMap:
        """Map of scans in files, fused in their order.

        Raises:
            RequestError, ReadError, DefinitionError: `map_scans` raises them, or `options`.
        """
        return map_scans(scans, self.options, self.bounds, self.sensor_at, progress)
