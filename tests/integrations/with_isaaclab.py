"""Isaac Lab's own importer and generator with ours: its code, not ours, is what is tried."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from terratool.integrations.isaaclab import TerrainGenerator, TileCfg, terrain_generator_cfg
from tests.integrations.lab import isaac_lab_terrains
from tests.integrations.pages import run_section

SIZE = (8.0, 8.0)
DIFFICULTY = 0.43


@pytest.fixture(scope="module")
def lab() -> Any:
    """Isaac Lab's terrains."""
    return isaac_lab_terrains()


def generator_cfg(lab: Any, tiles: dict[str, Any], **changes: Any) -> Any:
    given = {
        "seed": 4, "curriculum": True, "size": SIZE, "border_width": 3.0, "num_rows": 1,
        "num_cols": len(tiles), "difficulty_range": (DIFFICULTY, DIFFICULTY),
        "sub_terrains": tiles,
    }  # fmt: skip
    return lab.TerrainGeneratorCfg(**{**given, **changes})


def hits(mesh: Any, x: Any, y: Any, from_z: float = 9.0, down: float = -1.0) -> Any:
    """Heights that rays meet, by the ray caster of Isaac Lab; infinite where they meet nothing."""
    import torch
    from isaaclab.utils.warp import convert_to_warp_mesh, raycast_mesh

    cast = convert_to_warp_mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), device="cpu")
    starts = torch.tensor(np.stack([x, y, np.full_like(x, from_z)], 1), dtype=torch.float32)
    along = torch.zeros_like(starts)
    along[:, 2] = down
    return raycast_mesh(starts[None], along[None], cast)[0][0, :, 2].numpy()


def strewn(columns: int, count: int = 6000) -> Any:
    """Points of a row of tiles about 0, 0."""
    half = np.array([SIZE[0] / 2, columns * SIZE[1] / 2])
    return np.random.default_rng(8).uniform(-half, half, (count, 2)).T


def kinds(lab: Any) -> dict[str, Any]:
    """Isaac Lab's kinds in which nothing is random."""
    return {
        "flat": lab.MeshPlaneTerrainCfg(),
        "stairs": lab.MeshPyramidStairsTerrainCfg(
            step_height_range=(0.05, 0.23), step_width=0.3, platform_width=3.0, border_width=1.0
        ),
        "stairs down": lab.MeshInvertedPyramidStairsTerrainCfg(
            step_height_range=(0.05, 0.23), step_width=0.3, platform_width=3.0, border_width=1.0
        ),
        "rails": lab.MeshRailsTerrainCfg(
            rail_thickness_range=(0.05, 0.1), rail_height_range=(0.05, 0.3), platform_width=2.5
        ),
        "pit": lab.MeshPitTerrainCfg(
            pit_depth_range=(0.05, 1.1), platform_width=2.5, double_pit=True
        ),
        "box": lab.MeshBoxTerrainCfg(
            box_height_range=(0.05, 0.2), platform_width=1.5, double_box=True
        ),
        "gap": lab.MeshGapTerrainCfg(gap_width_range=(0.05, 1.1), platform_width=2.5),
        "ring": lab.MeshFloatingRingTerrainCfg(
            ring_width_range=(0.5, 1.0), ring_height_range=(0.4, 1.0), ring_thickness=0.05,
            platform_width=2.5,
        ),
    }  # fmt: skip


def test_its_kinds_are_made_as_it_makes_them(lab: Any) -> None:
    tiles = kinds(lab)
    cfg = generator_cfg(lab, tiles)
    ours, theirs = TerrainGenerator(cfg), lab.TerrainGenerator(cfg)
    x, y = strewn(len(tiles))
    one, other = (hits(made.terrain_mesh, x, y) for made in (ours, theirs))
    # theirs are points on an edge now and then, as rays are float32
    assert (~np.isclose(one, other, atol=2e-3)).mean() < 0.004
    under = y > (len(tiles) / 2 - 1) * SIZE[1]  # of the ring, from below
    one, other = (hits(made.terrain_mesh, x[under], y[under], 0.02, 1.0) for made in (ours, theirs))
    assert np.isfinite(one).sum() > 50
    assert (~np.isclose(one, other, atol=2e-3)).mean() < 0.004
    assert ours.terrain_origins == pytest.approx(theirs.terrain_origins, abs=2e-3)


def test_its_importer_takes_our_generator(lab: Any) -> None:
    from isaaclab.terrains import terrain_importer
    from isaaclab.terrains.config import ROUGH_TERRAINS_CFG

    taken: list[Any] = []
    patches = {
        "root": lab.FlatPatchSamplingCfg(
            num_patches=3, patch_radius=[0.2, 0.3], max_height_diff=0.05
        )
    }
    cfg = ROUGH_TERRAINS_CFG.replace(
        class_type=TerrainGenerator, num_rows=2, num_cols=10, curriculum=True, seed=1
    )
    cfg.sub_terrains["boxes"].flat_patch_sampling = patches
    importer_cfg = lab.TerrainImporterCfg(
        prim_path="/World/ground", terrain_type="generator", terrain_generator=cfg, num_envs=50,
        max_init_terrain_level=1, visual_material=None, physics_material=None,
    )  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            terrain_importer, "create_prim_from_mesh", lambda _, mesh, **__: taken.append(mesh)
        )
        importer = terrain_importer.TerrainImporter(importer_cfg)
    (mesh,) = taken
    assert mesh.visual.vertex_colors.shape == (len(mesh.vertices), 4)
    assert importer.terrain_origins.shape == (2, 10, 3)
    assert importer.terrain_origins[..., :2].mean(dim=(0, 1)).abs().max() < 1e-5
    assert importer.flat_patches["root"].shape == (2, 10, 3, 3)
    origins = importer.env_origins.numpy()
    x, y = origins[:, 0].astype(float), origins[:, 1].astype(float)
    # robots begin on the ground of the mesh, or just over what is lower within a metre
    below = origins[:, 2] - hits(mesh, x + 0.011, y + 0.007)
    assert (below > -0.06).all() and (below < 0.25).all()
    places = importer.flat_patches["root"][:, 4:6].reshape(-1, 3).numpy().astype(float)
    assert hits(mesh, places[:, 0], places[:, 1]) == pytest.approx(places[:, 2], abs=6e-3)


def test_its_generator_takes_our_tiles(lab: Any) -> None:
    tiles = {
        "ours": TileCfg({"kind": "pyramidStairs", "border": 1, "platform": 3}),
        "theirs": kinds(lab)["stairs"],
    }
    made = lab.TerrainGenerator(generator_cfg(lab, tiles))
    x, y = strewn(1)
    heights = [hits(made.terrain_mesh, x, y + side) for side in (-4.0, 4.0)]
    assert (np.isclose(*heights, atol=1e-3)).mean() > 0.995
    assert made.terrain_origins[0, 0] + [0, 8, 0] == pytest.approx(made.terrain_origins[0, 1])


def test_a_spec_is_a_configuration(lab: Any) -> None:
    cfg = terrain_generator_cfg("samples/curricula/own.json", num_rows=2)
    cfg.validate()
    assert (cfg.size, cfg.num_rows, cfg.num_cols, cfg.border_width) == ((8.0, 8.0), 2, 5, 2.0)
    made = cfg.class_type(cfg=cfg.copy(), device="cpu")
    assert made.flat_patches["spawn"].shape == (2, 5, 10, 3)
    assert made.curriculum.counts == {"hurdles": 4, "podium": 4, "floating ring": 2}


@pytest.mark.usefixtures("lab")
def test_the_examples_of_the_page_run() -> None:
    run_section("Isaac Lab")
