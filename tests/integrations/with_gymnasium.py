"""Environments of Gymnasium whose robots stand on terrains."""

from __future__ import annotations

import numpy as np
import pytest

import terratool
from tests.integrations.pages import run_section


def test_the_ant_stands_on_its_tile() -> None:
    from gymnasium.envs.mujoco.ant_v5 import AntEnv

    from terratool.integrations.gymnasium import on_terrain

    spec = {
        "rows": 3, "columns": 2, "tile": [6, 5], "seed": 3,
        "kinds": {"box": {"kind": "box", "platform": 3}, "flat": {"kind": "flat"}},
    }  # fmt: skip
    made = terratool.curriculum(spec)
    terrain = terratool.load(made.text)
    env, flat = (
        on_terrain(AntEnv, terrain, origin=tuple(origin))(reset_noise_scale=0.0)
        for origin in made.origins[2]
    )
    for one in (env, flat):
        one.reset(seed=1)
        for _ in range(60):
            one.step(np.zeros(8))
    # as high over the top of the box as over level ground
    assert 0.3 < env.data.qpos[2] < 0.6
    assert env.data.qpos[2] == pytest.approx(flat.data.qpos[2], abs=1e-3)
    ground = {env.model.geom(c.geom1).name for c in env.data.contact}
    ground |= {env.model.geom(c.geom2).name for c in env.data.contact}
    assert any(name.startswith("ground/terrain/floor/") for name in ground)
    assert env.model.body_mass.sum() == pytest.approx(AntEnv().model.body_mass.sum())


def test_the_examples_of_the_page_run() -> None:
    run_section("Gymnasium")
