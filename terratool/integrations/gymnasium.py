"""Gymnasium's robots of MuJoCo on terrains."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import terratool

if TYPE_CHECKING:
    import mujoco


def on_terrain(
    env: type, terrain: terratool.Terrain, *, floor: str = "floor", **options: Any
) -> type:
    """Class of an environment whose robot stands on a terrain rather than on its floor.

    Robots begin where their model has them, above 0, 0, 0: so `origin` should be a point of the
    ground, such as an origin of a training tile.

    Args:
        env: class of an environment of MuJoCo, such as
            `gymnasium.envs.mujoco.ant_v5.AntEnv`.
        terrain: a terrain.
        floor: name of the model's own ground, which is taken out.
        **options: options of `Terrain.to_mjspec`.

    Returns:
        A subclass, which takes what `env` takes.

    Raises:
        RequestError: an option makes no sense, or there is no ground.
    """
    spec = terrain.to_mjspec(**options)
    import mujoco  # which to_mjspec wants, and says so

    def initialize(self: Any) -> tuple[mujoco.MjModel, mujoco.MjData]:
        robot = mujoco.MjSpec.from_file(self.fullpath)
        own = robot.geom(floor)
        if own is not None:
            robot.delete(own)
        robot.attach(spec.copy(), prefix="ground/", frame=robot.worldbody.add_frame())
        model = robot.compile()
        # as MujocoEnv does
        view = model.vis.global_
        view.offwidth = max(view.offwidth, self.width)
        view.offheight = max(view.offheight, self.height)
        return model, mujoco.MjData(model)

    return type(f"{env.__name__}OnTerrain", (env,), {"_initialize_simulation": initialize})
