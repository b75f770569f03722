"""A picture of a survey: the hills in grey, the verdicts in colour, no-go and unknown hatched."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from terratool.traversability.results import COLORS, RANKS, Survey, Verdict

SHADING = 0.8, 1.08
"""Shares of a colour that are left in the shade and in full light."""

_SIDE = 720
"""Pixels that the longer side has at least, so that the hatching is fine."""
_HATCH = 12
"""Pixels from one line of the hatching to the next."""
_OUTLINE = (11, 61, 145)
"""Colour of the outline of what can be reached."""
_LIGHT = np.radians(315.0), np.radians(45.0)
"""Azimuth and height of the light."""
_RELIEF = np.tan(np.radians(40.0))
"""Slope that the steeper ground of a flat terrain is exaggerated to."""
_MOST = 10.0


def best(survey: Survey) -> NDArray[np.uint8]:
    """The verdict of the best heading at each pixel, (height, width) uint8.

    What is not known is better than no-go, as it is in the map.
    """
    verdicts = np.argsort(RANKS).astype(np.uint8)  # by their ranks
    out: NDArray[np.uint8] = verdicts[RANKS[survey.verdict].min(axis=0)]
    return out


def exaggeration(survey: Survey) -> float:
    """How much steeper the shading shows the ground, 1 to 10: so that gentle hills are seen."""
    east, north = _gradient(survey.heights, survey.grid.resolution)
    steepness = np.hypot(east, north)
    steepness = steepness[steepness > 0.0]
    if not steepness.size:
        return 1.0
    factor = float(np.clip(_RELIEF / np.quantile(steepness, 0.95), 1.0, _MOST))
    return float(f"{factor:.1g}")


def hillshade(
    heights: NDArray[np.float32], resolution: float, exaggerated: float = 1.0
) -> NDArray[np.float64]:
    """Light on the ground, 0 to 1, (height, width) float64; level ground has sin 45°.

    Slopes by Horn's formula (B. K. P. Horn, Hill shading and the reflectance map, Proceedings of
    the IEEE 69(1), 1981), light from the north-west; missing neighbours count as level.

    Args:
        heights: (height, width), rows from the north, NaN where there is no ground.
        resolution: side of a pixel.
        exaggerated: factor on heights.
    """
    east, north = _gradient(heights, resolution)
    azimuth, height = _LIGHT
    east, north = east * exaggerated, north * exaggerated
    towards = -east * np.sin(azimuth) - north * np.cos(azimuth)
    light = (np.sin(height) + towards * np.cos(height)) / np.sqrt(1.0 + east**2 + north**2)
    return np.asarray(np.clip(light, 0.0, 1.0))


def paint(survey: Survey, reached: NDArray[np.bool_] | None = None) -> NDArray[np.uint8]:
    """The picture, (height, width, 4) uint8 RGBA, transparent where there is no ground.

    A pixel of the survey is a square of as many pixels as it takes for the longer side to have 720.

    Args:
        survey: of a vehicle.
        reached: (height, width) what can be reached; gets an outline.
    """
    shade = hillshade(survey.heights, survey.grid.resolution, exaggeration(survey))
    verdict = best(survey)
    palette = np.array([COLORS[code] for code in sorted(COLORS)], np.float64)
    level = np.sin(_LIGHT[1])
    # shading must not turn one verdict's lightness to another's
    light = np.clip(1.0 + 0.4 * (shade - level), *SHADING)
    painted = palette[verdict] * light[..., np.newaxis]
    scale = max(1, -(-_SIDE // max(verdict.shape)))
    painted = painted.repeat(scale, axis=0).repeat(scale, axis=1)
    verdict = verdict.repeat(scale, axis=0).repeat(scale, axis=1)
    row, column = np.indices(verdict.shape, np.int32)
    line = (row + column) % _HATCH < 3
    painted[line & (verdict == Verdict.NO_GO)] *= 0.55
    dot = (row % _HATCH < 4) & (column % _HATCH < 4)
    painted[dot & (verdict == Verdict.UNKNOWN)] *= 0.6
    if reached is not None:
        inside = reached.repeat(scale, axis=0).repeat(scale, axis=1)
        painted[_rim(inside)] = _OUTLINE
    ground = np.isfinite(survey.heights).repeat(scale, axis=0).repeat(scale, axis=1)
    rgba = np.empty((*verdict.shape, 4), np.uint8)
    rgba[..., :3] = np.clip(np.rint(painted), 0.0, 255.0)
    rgba[..., 3] = np.where(ground, 255, 0)
    rgba[~ground, :3] = 0
    return rgba


def _rim(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The outermost two pixels of an area."""
    core = np.pad(inside, 2, mode="edge")
    rows, columns = inside.shape
    shrunk = np.ones_like(inside)
    for row, column in ((0, 2), (4, 2), (2, 0), (2, 4)):
        shrunk &= core[row : row + rows, column : column + columns]
    return inside & ~shrunk


def png(pixels: NDArray[np.uint8]) -> bytes:
    """A picture as the bytes of a PNG file.

    Args:
        pixels: (height, width, bands) uint8.
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning
    from rasterio.io import MemoryFile

    height, width, bands = pixels.shape
    with rasterio.Env(GDAL_PAM_ENABLED=False), MemoryFile(ext=".png") as memory:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with memory.open(
                driver="PNG", height=height, width=width, count=bands, dtype="uint8", ZLEVEL=9
            ) as file:
                file.write(np.moveaxis(pixels, -1, 0))
        return bytes(memory.getbuffer())


def _gradient(
    heights: NDArray[np.float32], resolution: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rise for each unit to the east and to the north, by Horn's weights; 0 where unknown."""
    padded = np.pad(heights.astype(np.float64), 1, mode="reflect", reflect_type="odd")
    middle = padded[1:-1, 1:-1]
    rows, columns = middle.shape

    def at(row: int, column: int) -> NDArray[np.float64]:
        near = padded[1 + row : 1 + row + rows, 1 + column : 1 + column + columns]
        return np.where(np.isfinite(near), near, middle)

    east = at(-1, 1) + 2.0 * at(0, 1) + at(1, 1) - at(-1, -1) - 2.0 * at(0, -1) - at(1, -1)
    north = at(-1, -1) + 2.0 * at(-1, 0) + at(-1, 1) - at(1, -1) - 2.0 * at(1, 0) - at(1, 1)
    span = 8.0 * resolution
    return np.nan_to_num(east / span), np.nan_to_num(north / span)
