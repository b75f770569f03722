"""Robots of mjlab on our tiles, in its own environment for training."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.integrations.pages import run_section

SPEC: dict[str, Any] = {
    "rows": 4,
    "columns": 5,
    "tile": [6, 5],
    "seed": 3,
    "border": 2,
    "kinds": {
        "stairs": {"kind": "pyramidStairs", "platform": 2.5},
        "boxes": {"kind": "box", "platform": 2.5, "proportion": 2},
        "ring": {"kind": "floatingRing", "platform": 2.5, "ringHeight": [0.6, 1]},
        "waves": {"kind": "waves", "amplitude": [0.05, 0.1], "count": 2},
    },
    "patches": {"spawn": {"radius": 0.3, "count": 3}},
}


def test_a_kind_of_several_columns_is_several_sub_terrains() -> None:
    from terratool.integrations.mjlab import terrain_generator_cfg

    cfg = terrain_generator_cfg(SPEC, num_rows=2)
    assert list(cfg.sub_terrains) == ["stairs", "boxes", "boxes 1", "ring", "waves"]
    assert (cfg.num_rows, cfg.size, cfg.border_width, cfg.seed) == (2, (6.0, 5.0), 2.0, 3)


def test_tiles_collide_where_the_terrain_is() -> None:
    import mujoco
    from mjlab.scene import Scene, SceneCfg
    from mjlab.terrains import TerrainEntityCfg

    from terratool.integrations.mjlab import terrain_generator_cfg

    cfg = terrain_generator_cfg(SPEC, options={"max_error": 0.01})
    terrain_cfg = TerrainEntityCfg(terrain_type="generator", terrain_generator=cfg)
    scene = Scene(SceneCfg(num_envs=8, terrain=terrain_cfg), device="cpu")
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert not model.body_mass.any()
    geoms = np.array([model.geom(n).name.startswith("tile") for n in range(model.ngeom)])
    assert (model.geom_group[geoms] == 0).all() and (model.geom_contype[geoms] == 1).all()
    origins = scene.terrain.terrain_origins.numpy().astype(float)
    assert origins.shape == (4, 5, 3)
    assert origins[..., 0].tolist() == [[-9.0] * 5, [-3.0] * 5, [3.0] * 5, [9.0] * 5]
    # stairs and boxes are as high as their origins, which grow with the row
    met = np.array([-1], np.int32)
    for column in range(3):
        z = origins[:, column, 2]
        assert (np.diff(z) > 0.02).all()
        for x, y, top in origins[:, column]:
            start = np.array([x, y, 20.0])
            far = mujoco.mj_ray(model, data, start, np.array([0, 0, -1.0]), None, 1, -1, met)
            assert 20 - far == pytest.approx(top, abs=1e-3)
    places = scene.terrain.flat_patches["spawn"].numpy().astype(float)
    assert places.shape == (4, 5, 3, 3)
    for x, y, top in places[:, [0, 1, 2, 3]].reshape(-1, 3):
        start = np.array([x, y, 20.0])
        far = mujoco.mj_ray(model, data, start, np.array([0, 0, -1.0]), None, 1, -1, met)
        assert 20 - far == pytest.approx(top, abs=2e-3)


def test_a_robot_stands_for_forty_steps_in_its_training() -> None:
    """The Go1 of the velocity task, with its scans of heights and its curriculum."""
    import mjlab.tasks.velocity.config.go1  # noqa: F401 -- registers the task
    import torch
    from mjlab.envs import ManagerBasedRlEnv
    from mjlab.tasks.registry import load_env_cfg

    from terratool.integrations.mjlab import terrain_generator_cfg

    cfg = load_env_cfg("Mjlab-Velocity-Rough-Unitree-Go1")
    cfg.seed = 1
    cfg.scene.num_envs = 10
    cfg.scene.terrain.terrain_generator = terrain_generator_cfg(SPEC, options={"max_error": 0.01})
    env = ManagerBasedRlEnv(cfg, device="cpu")
    env.reset()
    still = torch.zeros((10, env.action_manager.total_action_dim))
    for _ in range(40):
        observed, _, terminated, *_ = env.step(still)
        assert all(torch.isfinite(values).all() for values in observed.values())
    assert not terminated.any()
    height = env.scene["robot"].data.root_link_pos_w[:, 2] - env.scene.env_origins[:, 2]
    assert (height > 0.1).all() and (height < 0.4).all()
    assert torch.isfinite(env.scene["terrain_scan"].data.distances).all()


def test_the_examples_of_the_page_run() -> None:
    run_section("mjlab")
