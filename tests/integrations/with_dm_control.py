"""Walkers of dm_control on terrains: by its composer, and by its suite."""

from __future__ import annotations

from typing import Any

import numpy as np

import terratool
from tests.integrations.pages import run_section

SPEC: dict[str, Any] = {
    "rows": 2,
    "columns": 2,
    "tile": [6, 5],
    "seed": 3,
    "origin": "center",
    "kinds": {
        "stairs": {"kind": "pyramidStairs", "platform": 2.5},
        "waves": {"kind": "waves", "amplitude": [0.05, 0.1], "count": 2},
    },
}


def test_an_ant_of_the_composer_stands_on_its_tile() -> None:
    from dm_control import composer, mjcf
    from dm_control.locomotion.walkers.ant import Ant

    from terratool.integrations.dm_control import terrain_arena

    made = terratool.curriculum(SPEC)
    arena = terrain_arena(terratool.load(made.text), max_error=0.01)
    walker = Ant()
    arena.add_free_entity(walker)
    physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
    assert physics.model.body("terrain/").mass[0] < 1e-4
    for origin in made.origins[:, 0]:
        physics.reset()
        walker.set_pose(physics, origin + np.array([0, 0, 0.8]))
        for _ in range(1200):
            physics.step()
        height = physics.bind(walker.root_body).xpos[2] - origin[2]
        assert 0.15 < height < 0.6
        ground = {physics.model.geom(c.geom1).name for c in physics.data.contact}
        ground |= {physics.model.geom(c.geom2).name for c in physics.data.contact}
        assert any(name.startswith("terrain/terrain:floor:stairs:") for name in ground)

    class Still(composer.Task):  # type: ignore[misc]
        @property
        def root_entity(self) -> Any:
            return arena

        def get_reward(self, _physics: Any) -> float:
            return 0.0

    env = composer.Environment(Still())
    env.reset()
    assert not env.step(env.action_spec().generate_value()).last()


def test_the_walker_of_the_suite_falls_on_the_ground() -> None:
    import mujoco
    from dm_control.mujoco.wrapper import MjModel
    from dm_control.suite import walker

    made = terratool.curriculum(SPEC)
    terrain = terratool.load(made.text)
    xml, files = walker.get_model_and_assets()
    include = {name.removeprefix("./"): text for name, text in files.items()}
    robot = mujoco.MjSpec.from_string(xml, include=include)
    robot.delete(robot.geom("floor"))
    ground = terrain.to_mjspec(origin=tuple(made.origins[1, 0]))
    robot.attach(ground, prefix="ground/", frame=robot.worldbody.add_frame())
    physics = walker.Physics.from_model(MjModel(robot.compile()))
    physics.named.data.qpos["rootz"] = 0.3
    for _ in range(1200):
        physics.step()
    torso = physics.named.data.xpos["torso"]
    assert 0.0 < torso[2] < 0.5
    assert np.abs(physics.data.qvel).max() < 0.5


def test_the_examples_of_the_page_run() -> None:
    run_section("dm_control")
