"""Print the table of boxes and cylinders in docs/simulators.md.

python -m benchmarks.boxes [SAMPLE …]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import terratool
from terratool.report.numbers import tenths
from terratool.simulators.export import export_simulators

SAMPLES = (
    "warehouse", "stairs-and-kerbs", "obstacle-course", "ramp-yard", "car-park", "rack-hall",
)  # fmt: skip


def row(name: str) -> str:
    """Numbers of boxes and cylinders, and the share of the ground that is left to meshes."""
    terrain = terratool.load(f"samples/{name}.json")
    with tempfile.TemporaryDirectory() as place:
        [report] = export_simulators(terrain, Path(place) / "out", "pybullet")
    found = report.manifest
    return f"| {name} | {found['boxes']} | {found['cylinders']} | {tenths(found['meshed'])} |"


if __name__ == "__main__":
    for sample in sys.argv[1:] or SAMPLES:
        print(row(sample), flush=True)
