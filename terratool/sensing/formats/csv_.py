"""CSV: a line for each point, surfaces by name."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from terratool.report.inert import inert_cell
from terratool.sensing.formats.common import Record
from terratool.sensing.readings import Frame, Status

COLUMNS = (
    "time", "frame", "ring", "x", "y", "z", "range", "intensity", "surface", "element", "wall",
    "status",
)  # fmt: skip


def write_csv(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write a header and a line for each point; what is not known is empty.

    Numbers have as many digits as bring back the same double.
    """
    names = [*map(inert_cell, record.terrain.surfaces), ""]
    words = [status.name.lower() for status in Status]
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for frame in frames:
            rows = record.rows(frame)
            columns: list[list[Any]] = []
            for name in COLUMNS:
                values = rows[name].tolist()
                if name == "surface":
                    values = [names[index] for index in values]
                elif name == "status":
                    values = [words[index] for index in values]
                elif name == "element":
                    values = ["" if index < 0 else index for index in values]
                elif name in ("x", "y", "z", "range"):
                    values = ["" if number != number else number for number in values]
                elif name == "intensity":
                    values = [str(number) for number in rows[name].astype(np.float32)]
                columns.append(values)
            writer.writerows(zip(*columns, strict=True))
