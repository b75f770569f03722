"""Print the tables of docs/simulators.md: what MuJoCo collides with in each sample.

python -m benchmarks.geoms [SAMPLE …]
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path

import terratool
from terratool.simulators.export import export_simulators

SAMPLES = (
    "warehouse", "stairs-and-kerbs", "paper-example", "sandy-cove", "ramp-yard", "wheel-tracks",
    "obstacle-course", "camber-road", "nested-site", "lunar-craters", "dunes", "planetary-site",
    "car-park", "rack-hall", "gorge", "cave",
)  # fmt: skip


def row(name: str) -> str:
    """Numbers of geoms, how far they are off the terrain, in metres, and seconds of export."""
    terrain = terratool.load(f"samples/{name}.json")
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as place:
        [report] = export_simulators(terrain, Path(place) / "out", "mujoco")
        counts = json.loads((report.folder / "manifest.json").read_text("utf-8"))["collision"]
    seconds = f"{time.perf_counter() - begin:.1f}"
    solids = f"{counts['solids_error']:.2g}" if counts["box"] + counts["mesh"] else ""
    fields = f"{counts['height_fields_error']:.2g}" if counts["hfield"] else ""
    numbers = [f"{counts[kind]:,}" for kind in ("box", "mesh", "hfield")]
    return f"| {' | '.join([name, *numbers, solids, fields, seconds])} |"


if __name__ == "__main__":
    for sample in sys.argv[1:] or SAMPLES:
        print(row(sample), flush=True)
