"""The pictures of docs/images that `terratool render` draws: `make pages` runs this.

Each curve and each way to combine two is a primitive of its own, on a plate.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from terratool.definition.expression import NAMED
from terratool.definition.reader import check
from terratool.field.terrain import Terrain, load
from terratool.text.source import Source
from terratool.viewing.options import RenderOptions
from terratool.viewing.render import render

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs/images"

CURVES: dict[str, Any] = {
    **{name: name for name in NAMED},
    "vector": [0, 0.3, 1, 0.2, 0.5, 0],
    "knots": [[0, 0], [0.25, 0], [0.25, 1], [1, 1]],
    "expression": "t**2*(1 - t)*6.75",
}
COMBINES: dict[str, dict[str, Any]] = {
    "product": {"x": "tent", "y": []},
    "sum": {"combine": "sum", "x": "tent", "y": []},
    "min": {"combine": "min", "x": "tent", "y": []},
    "max": {"combine": "max", "x": "tent", "y": []},
    "radial": {"combine": "radial", "x": "tent"},
}
SMALL = RenderOptions(perspective=True, bare=True, pixels=300, azimuth=200, elevation=28,
                      exaggeration=1.0, max_error=0.01)  # fmt: skip
README = RenderOptions(perspective=True, title="", pixels=1200)
SAMPLE = RenderOptions(perspective=True, bare=True, pixels=480)
TUTORIAL = RenderOptions(perspective=True, title="", pixels=900, dpi=100)


class Picture(NamedTuple):
    """A picture of the documentation."""

    name: str
    terrain: Terrain
    options: RenderOptions


def primitive(shape: dict[str, Any], height: float) -> Terrain:
    """A primitive of 8 × 5 in the middle of a plate of 10 × 7."""
    definition = {
        "size": [10, 7],
        "surfTypes": {
            "plate": {"color": [214, 210, 202]}, "shape": {"color": [205, 148, 70]},
        },
        "elemTypes": {"flat": {"x": [0, 0]}, "shape": shape},
        "elemTree": {
            "type": "flat", "surface": "plate", "children": [
                {"at": [5, 3.5], "extent": [8, 5], "type": "shape", "surface": "shape",
                 "vScale": height},
            ],
        },
    }  # fmt: skip
    return Terrain(check(Source("picture", json.dumps(definition).encode())))


def pictures() -> Iterator[Picture]:
    """All of them."""
    for name, curve in CURVES.items():
        yield Picture(f"curve-{name}.png", primitive({"x": curve}, 2.0), SMALL)
    for name, shape in COMBINES.items():
        height = 1.3 if name == "sum" else 2.0
        yield Picture(f"combine-{name}.png", primitive(shape, height), SMALL)
    yield Picture("readme.png", load(ROOT / "samples/stairs-and-kerbs.json"), README)


def gallery() -> Iterator[Picture]:
    """Those of docs/samples.md, and of the tutorial: its last yard."""
    shapes = json.loads((ROOT / "samples/kit/shapes.json").read_text("utf-8"))["elemTypes"]
    for name, shape in shapes.items():
        if name != "group":  # which is nothing by itself
            yield Picture(f"shape-{name}.png", primitive(shape, 2.0), SMALL)
    for path in sorted((ROOT / "samples").glob("*.json")):
        # what is too fine for so small a picture would only take time
        terrain = load(path, roughness=False)
        yield Picture(f"sample-{path.stem}.png", terrain, SAMPLE)
    page = (ROOT / "docs/tutorial.md").read_text("utf-8")
    *_, yard = re.findall(r"^```json\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    text = Source(str(ROOT / "samples/yard.json"), yard.encode())
    yield Picture("tutorial.png", Terrain(check(text)), TUTORIAL)


def main(folder: Path = IMAGES) -> None:
    """Draw them into a folder."""
    for picture in (*pictures(), *gallery()):
        render(picture.terrain, folder / picture.name, picture.options, overwrite=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
