"""Isaac Lab's own configurations of sub-terrains as kinds of training tiles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from terratool.errors import RequestError
from terratool.integrations.tiles import TileSpec
from terratool.text.display import quote


class _Kind(NamedTuple):
    """Kind of tiles that a configuration stands for.

    Attributes:
        kind: name of the kind.
        keys: keys of the kind by attributes of the configuration.
        fixed: values of keys that the configuration has no attribute for.
    """

    kind: str
    keys: Mapping[str, str]
    fixed: Mapping[str, Any] = {}


_PLATFORM = {"platform_width": "platform"}
_BORDER = {"border_width": "border"}
_STAIRS = {
    "step_height_range": "stepHeight", "step_width": "stepWidth", "holes": "holes",
    **_PLATFORM, **_BORDER,
}  # fmt: skip
_FIELD_STAIRS = {
    "step_height_range": "stepHeight", "step_width": "stepWidth", "inverted": "inverted",
    **_PLATFORM, **_BORDER,
}  # fmt: skip
_SLOPE = {"slope_range": "slope", "inverted": "inverted", **_PLATFORM, **_BORDER}
_OBJECTS = {
    "abs_height_noise": "noise", "rel_height_noise": "relativeNoise",
    "platform_height": "platformHeight", **_PLATFORM,
}  # fmt: skip
_PARAMETERS = {"num_objects": "count", "height": "height", "radius": "radius"}
"""Keys of repeated objects by attributes of their configurations at difficulty 0 and at 1."""

_KINDS = {
    "MeshPlaneTerrainCfg": _Kind("flat", {}),
    "MeshPyramidStairsTerrainCfg": _Kind("pyramidStairs", _STAIRS),
    "MeshInvertedPyramidStairsTerrainCfg": _Kind("pyramidStairs", _STAIRS, {"inverted": True}),
    "MeshRandomGridTerrainCfg": _Kind(
        "randomGrid",
        {"grid_width": "gridWidth", "grid_height_range": "height", "holes": "holes", **_PLATFORM},
    ),
    "MeshRailsTerrainCfg": _Kind(
        "rails",
        {"rail_thickness_range": "thickness", "rail_height_range": "height", **_PLATFORM},
    ),
    "MeshPitTerrainCfg": _Kind(
        "pit", {"pit_depth_range": "depth", "double_pit": "double", **_PLATFORM}
    ),
    "MeshBoxTerrainCfg": _Kind(
        "box", {"box_height_range": "height", "double_box": "double", **_PLATFORM}
    ),
    "MeshGapTerrainCfg": _Kind(
        "gap", {"gap_width_range": "gapWidth", **_PLATFORM}, {"holes": True}
    ),
    "MeshFloatingRingTerrainCfg": _Kind(
        "floatingRing",
        {
            "ring_width_range": "ringWidth", "ring_height_range": "ringHeight",
            "ring_thickness": "thickness", **_PLATFORM,
        },
    ),
    "MeshStarTerrainCfg": _Kind(
        "star",
        {
            "num_bars": "bars", "bar_width_range": "width", "bar_height_range": "height",
            **_PLATFORM,
        },
    ),
    "MeshRepeatedPyramidsTerrainCfg": _Kind("repeatedPyramids", _OBJECTS),
    "MeshRepeatedBoxesTerrainCfg": _Kind("repeatedBoxes", _OBJECTS),
    "MeshRepeatedCylindersTerrainCfg": _Kind("repeatedCylinders", _OBJECTS),
    "HfRandomUniformTerrainCfg": _Kind(
        "randomRough", {"noise_range": "noise", "noise_step": "noiseStep", **_BORDER}
    ),
    "HfPyramidSlopedTerrainCfg": _Kind("pyramidSlope", _SLOPE),
    "HfInvertedPyramidSlopedTerrainCfg": _Kind("pyramidSlope", _SLOPE),
    "HfPyramidStairsTerrainCfg": _Kind("pyramidStairs", _FIELD_STAIRS),
    "HfInvertedPyramidStairsTerrainCfg": _Kind("pyramidStairs", _FIELD_STAIRS),
    "HfDiscreteObstaclesTerrainCfg": _Kind(
        "discreteObstacles",
        {
            "obstacle_height_mode": "mode", "obstacle_width_range": "width",
            "obstacle_height_range": "height", "num_obstacles": "count", **_PLATFORM,
        },
    ),
    "HfWaveTerrainCfg": _Kind(
        "waves", {"amplitude_range": "amplitude", "num_waves": "count", **_BORDER}
    ),
    "HfSteppingStonesTerrainCfg": _Kind(
        "steppingStones",
        {
            "stone_height_max": "stoneHeight", "stone_width_range": "stoneWidth",
            "stone_distance_range": "stoneDistance", **_PLATFORM,
        },
    ),
}  # fmt: skip
"""Kinds of tiles by the names of Isaac Lab's classes."""


def tile_of(name: str, sub: Any, grid: Any) -> TileSpec:
    """Kind of tiles that a sub-terrain of a configuration stands for.

    Args:
        name: name of the sub-terrain, for errors.
        sub: configuration of the sub-terrain, or the keys of a kind.
        grid: configuration of the generator.

    Raises:
        RequestError: the sub-terrain is of no known kind.
    """
    if isinstance(sub, Mapping):
        keys = {key: value for key, value in sub.items() if key != "proportion"}
        return TileSpec(keys, sub.get("proportion", 1.0))
    patches = getattr(sub, "flat_patch_sampling", None)
    if isinstance(getattr(sub, "kind", None), Mapping):
        return TileSpec(sub.kind, sub.proportion, patches, sub.folder)
    known = _KINDS.get(type(sub).__name__)
    if known is None:
        raise RequestError(
            f"The sub-terrain {quote(name)} is a {type(sub).__name__}, which is no kind of tile "
            "here.",
            "Give the keys of a kind, or leave this grid to Isaac Lab's own generator, which takes "
            "a TileCfg beside it.",
        )
    keys = {key: _plain(getattr(sub, attribute)) for attribute, key in known.keys.items()}
    return TileSpec(
        {"kind": known.kind, **keys, **known.fixed, **_others(sub, grid)}, sub.proportion, patches
    )


def _others(sub: Any, grid: Any) -> dict[str, Any]:
    """Values of keys that follow from several attributes."""
    if hasattr(sub, "holes_depth"):
        return {"depth": -float(sub.holes_depth)}
    if hasattr(sub, "downsampled_scale"):
        scale = sub.downsampled_scale
        return {"spacing": float(grid.horizontal_scale if scale is None else scale)}
    if not hasattr(sub, "object_params_start"):
        return {}
    first, last = sub.object_params_start, sub.object_params_end
    found = {
        key: [_plain(getattr(first, attribute)), _plain(getattr(last, attribute))]
        for attribute, key in _PARAMETERS.items()
        if hasattr(first, attribute)
    }
    if hasattr(first, "size"):
        sides = zip(first.size, last.size, strict=True)
        found |= dict(zip(("length", "width"), map(_plain, sides), strict=True))
    return found


def _plain(value: Any) -> Any:
    return list(map(float, value)) if isinstance(value, tuple | list) else value
