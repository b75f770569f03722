"""The generator for Isaac Lab, tried as its importer does; its package is not needed here.

The importer calls `class_type(cfg=…, device=…)` and reads `terrain_mesh`, `terrain_origins` and
`flat_patches` of what it gets; configurations are classes of Isaac Lab by name and attributes.
"""

from __future__ import annotations

from types import SimpleNamespace as Cfg
from typing import Any

import numpy as np
import pytest

from terratool.errors import DefinitionError, RequestError
from terratool.integrations.isaaclab import TerrainGenerator, TileCfg
from terratool.integrations.isaaclab_kinds import tile_of
from terratool.integrations.tiles import without_gaps

SIZE = (6.0, 5.0)


def lab(name: str, **values: Any) -> Any:
    """A configuration of a sub-terrain of Isaac Lab, by the name of its class."""
    given = {"proportion": 1.0, "size": (10.0, 10.0), "flat_patch_sampling": None, **values}
    return type(name, (Cfg,), {})(**given)


def generator_cfg(tiles: dict[str, Any], **changes: Any) -> Cfg:
    given = {
        "seed": 4, "curriculum": True, "size": SIZE, "border_width": 0.0, "border_height": 1.0,
        "num_rows": 2, "num_cols": len(tiles), "color_scheme": "none", "horizontal_scale": 0.1,
        "difficulty_range": (0.0, 1.0), "sub_terrains": tiles,
    }  # fmt: skip
    return Cfg(**{**given, **changes})


def patches(**changes: Any) -> Cfg:
    anywhere = (-1e6, 1e6)
    given = {
        "num_patches": 3, "patch_radius": [0.1, 0.3], "max_height_diff": 0.05,
        "x_range": anywhere, "y_range": anywhere, "z_range": anywhere,
    }  # fmt: skip
    return Cfg(**{**given, **changes})


BOX = {"kind": "box", "platform": 1.5, "height": [0.1, 0.5]}


def test_a_grid_lies_about_zero_with_origins_on_it() -> None:
    made = TerrainGenerator(cfg=generator_cfg({"a": BOX, "b": {"kind": "flat"}}, border_width=2.0))
    assert made.terrain_mesh.bounds[:, :2].tolist() == [[-8, -7], [8, 7]]
    assert made.terrain_origins[..., 0].tolist() == [[-3, -3], [3, 3]]
    assert made.terrain_origins[..., 1].tolist() == [[-2.5, 2.5], [-2.5, 2.5]]
    heights = made.terrain_origins[..., 2]
    assert (heights[:, 0] > 0.09).all() and not heights[:, 1].any()
    assert heights[1, 0] > heights[0, 0]
    # a vertex of the mesh stands at each origin's height beside it
    top = made.terrain_mesh.vertices[made.terrain_mesh.vertices[:, 1] < 0]
    for row, x in enumerate((-3, 3)):
        near = np.abs(top[:, 0] - x) < 1
        assert top[near, 2].max() == pytest.approx(heights[row, 0], abs=1e-6)
    assert made.flat_patches == {}
    assert "2 × 2 tiles" in str(made)


def test_the_seed_decides_or_that_of_numpy() -> None:
    tiles = {"a": {"kind": "repeatedBoxes"}}
    one, same, other = (
        TerrainGenerator(generator_cfg(tiles, seed=seed)).curriculum.text for seed in (1, 1, 2)
    )
    assert one == same != other
    np.random.seed(7)
    from_numpy = TerrainGenerator(generator_cfg(tiles, seed=None)).curriculum
    assert from_numpy.spec.seed == 7


@pytest.mark.parametrize("scheme", ["height", "random"])
def test_colours_follow_the_scheme(scheme: str) -> None:
    mesh = TerrainGenerator(generator_cfg({"a": BOX}, color_scheme=scheme)).terrain_mesh
    colors = mesh.visual.vertex_colors
    assert colors.shape == (len(mesh.vertices), 4)
    low, high = (mesh.vertices[:, 2] == level for level in mesh.bounds[:, 2])
    if scheme == "height":
        assert len(np.unique(colors[low], axis=0)) == len(np.unique(colors[high], axis=0)) == 1
        assert (colors[low][0] != colors[high][0]).any()
    else:
        assert len(np.unique(colors, axis=0)) > len(colors) / 2


def test_places_that_were_not_found_are_those_that_were() -> None:
    gap = np.full(3, np.nan)
    places = np.array([[[[1.0, 2, 3], [4, 5, 6], gap, gap, gap], [gap] * 5]])
    filled = without_gaps(places, np.array([[True, False]]), "root")
    assert filled[0, 0, :, 0].tolist() == [1, 4, 1, 4, 1]
    assert np.isnan(filled[0, 1]).all()


def test_no_level_place_is_said() -> None:
    impossible = {"root": patches(z_range=(3.0, 4.0))}
    cfg = generator_cfg({"a": TileCfg(BOX, flat_patch_sampling=impossible)})
    with pytest.raises(RequestError, match='No level place "root" was found on the tile in row 0'):
        TerrainGenerator(cfg)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"color_scheme": "rainbow"}, "color_scheme"),
        ({"border_width": 2.0, "border_height": -1.0}, "wall"),
        ({"sub_terrains": {"a": lab("MyTerrainCfg")}}, '"a" is a MyTerrainCfg'),
    ],
)
def test_what_cannot_be_made_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(RequestError, match=said):
        TerrainGenerator(generator_cfg({"a": BOX}, **changes))


def test_values_that_make_no_sense_are_refused() -> None:
    with pytest.raises(DefinitionError, match="platform"):
        TerrainGenerator(generator_cfg({"a": {"kind": "gap", "platform": 6}}))


def test_a_tile_alone_is_what_functions_of_sub_terrains_give() -> None:
    cfg = TileCfg(BOX, size=SIZE)
    (mesh,), origin = cfg.function(0.5, cfg.copy())
    assert mesh.bounds.tolist() == [[0, 0, 0], [6, 5, 0.3]]
    assert origin.tolist() == [3, 2.5, 0.3]
    assert cfg.to_dict()["kind"] == BOX


RANGE = (0.1, 0.3)
OBJECTS = {
    "object_params_start": Cfg(num_objects=3, height=0.1, radius=0.2),
    "object_params_end": Cfg(num_objects=9, height=0.4, radius=0.5),
    "abs_height_noise": (0.0, 0.1), "rel_height_noise": (0.9, 1.1), "platform_width": 1.0,
    "platform_height": 0.2,
}  # fmt: skip
BOXES = {
    **OBJECTS,
    "object_params_start": Cfg(num_objects=3, height=0.1, size=(0.2, 0.3)),
    "object_params_end": Cfg(num_objects=9, height=0.4, size=(0.5, 0.6)),
}
REPEATED = {
    "count": [3, 9], "height": [0.1, 0.4], "noise": [0.0, 0.1], "relativeNoise": [0.9, 1.1],
    "platform": 1.0, "platformHeight": 0.2,
}  # fmt: skip


@pytest.mark.parametrize(
    ("cfg", "keys"),
    [
        (lab("MeshPlaneTerrainCfg"), {"kind": "flat"}),
        (
            lab("MeshInvertedPyramidStairsTerrainCfg", step_height_range=RANGE, step_width=0.3,
                platform_width=1.0, border_width=0.5, holes=False),
            {"kind": "pyramidStairs", "stepHeight": [0.1, 0.3], "stepWidth": 0.3, "platform": 1.0,
             "border": 0.5, "holes": False, "inverted": True},
        ),
        (
            lab("MeshGapTerrainCfg", gap_width_range=RANGE, platform_width=1.0),
            {"kind": "gap", "gapWidth": [0.1, 0.3], "platform": 1.0, "holes": True},
        ),
        (
            lab("MeshFloatingRingTerrainCfg", ring_width_range=RANGE, ring_height_range=(0.5, 0.9),
                ring_thickness=0.05, platform_width=1.0),
            {"kind": "floatingRing", "ringWidth": [0.1, 0.3], "ringHeight": [0.5, 0.9],
             "thickness": 0.05, "platform": 1.0},
        ),
        (
            lab("HfRandomUniformTerrainCfg", noise_range=RANGE, noise_step=0.02,
                downsampled_scale=None, border_width=0.2, horizontal_scale=0.1),
            {"kind": "randomRough", "noise": [0.1, 0.3], "noiseStep": 0.02, "border": 0.2,
             "spacing": 0.25},
        ),
        (
            lab("HfInvertedPyramidSlopedTerrainCfg", slope_range=(0.0, 0.4), platform_width=2.0,
                border_width=0.25, inverted=True),
            {"kind": "pyramidSlope", "slope": [0.0, 0.4], "platform": 2.0, "border": 0.25,
             "inverted": True},
        ),
        (
            lab("HfSteppingStonesTerrainCfg", stone_height_max=0.1, stone_width_range=(0.3, 1.0),
                stone_distance_range=RANGE, holes_depth=-2.0, platform_width=1.0),
            {"kind": "steppingStones", "stoneHeight": 0.1, "stoneWidth": [0.3, 1.0],
             "stoneDistance": [0.1, 0.3], "depth": 2.0, "platform": 1.0},
        ),
        (
            lab("MeshRepeatedCylindersTerrainCfg", **OBJECTS),
            {"kind": "repeatedCylinders", "radius": [0.2, 0.5], **REPEATED},
        ),
        (
            lab("MeshRepeatedBoxesTerrainCfg", **BOXES),
            {"kind": "repeatedBoxes", "length": [0.2, 0.5], "width": [0.3, 0.6], **REPEATED},
        ),
    ],
    ids=lambda one: type(one).__name__,
)  # fmt: skip
def test_configurations_of_isaac_lab_are_kinds(cfg: Any, keys: dict[str, Any]) -> None:
    grid = generator_cfg({"a": cfg}, horizontal_scale=0.25)
    assert tile_of("a", cfg, grid).keys == keys
    # and the spec takes them
    assert TerrainGenerator(Cfg(**{**vars(grid), "num_rows": 1})).curriculum.counts == {"a": 1}
