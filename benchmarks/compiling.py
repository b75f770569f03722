"""Compiling a million elements against the bare typed decoding of their text."""

from __future__ import annotations

import resource

import msgspec
import terrains
from measure import line, medians

from terratool.definition.model import Definition
from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.text.source import Source

if __name__ == "__main__":
    data = terrains.text(terrains.s3())
    source = Source("s3", data)
    definition = check(source).definition
    assert definition is not None
    count = len(Terrain(definition).arrays.elements)
    seconds = medians(
        {
            "decode": lambda: msgspec.json.decode(data, type=Definition),
            "compile": lambda: Terrain(definition),
        },
        runs=5,
    )
    print(f"{count:,} elements, {len(data) / 1e6:.0f} MB of text")
    line(
        f"compile, against bare typed decoding ({seconds['compile']:.2f} s)",
        seconds["compile"] / seconds["decode"],
        "none",
    )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / len(data)
    line("peak memory over the size of the text", peak, "none")
