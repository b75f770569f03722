"""Parts that are one: a ramp, and the last pixel of it that was taken for a box."""

from __future__ import annotations

from terratool.importing.terrains.structure.types import Axis, PixelPart
from terratool.kernels import importing as kernels

CLOSE = 1e-3
"""How far heights may be apart, in steps of a ramp."""


def merged(parts: list[PixelPart]) -> list[PixelPart]:
    """Parts without the boxes that are the high end of a ramp.

    Where a ramp leads up to a platform of its own height, its high end has no wall, so that it
    could as well be one pixel shorter and have a box of one pixel beside it.
    """
    places = {(part.x, part.y): index for index, part in enumerate(parts)}
    out: list[PixelPart | None] = list(parts)
    for index, part in enumerate(parts):
        for along_x in (True, False):
            ramp, across = (part.x, part.y) if along_x else (part.y, part.x)
            if ramp.code not in (kernels.RAMP, kernels.FALL) or across.code != kernels.FLAT:
                continue
            step = part.scale / (ramp.stop - ramp.first)
            end = ramp.end if ramp.code == kernels.RAMP else ramp.begin - 2
            last = Axis(kernels.FLAT, end, end + 2)
            place = places.get((last, across) if along_x else (across, last))
            box = None if place is None else out[place]
            if place is None or box is None:
                continue
            if abs(box.scale - part.scale - step / 2.0) > CLOSE * abs(step):
                continue
            longer = Axis(ramp.code, min(ramp.begin, end), max(ramp.end, end + 2))
            x, y = (longer, across) if along_x else (across, longer)
            out[index], out[place] = PixelPart(x, y, part.scale + step), None
    return [part for part in out if part is not None]
