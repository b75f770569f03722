"""A terrain in MuJoCo."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

_SECONDS = 2.5
_FAR = 1e3
"""Bodies that have nothing to do are so far away."""


class MuJoCo:
    """As `tests.simulators.checks.Simulator` wants it; attached to a scene with bodies.

    Args:
        folder: of the files.
        group: which geoms rays meet: 3 collide, 2 are seen.
    """

    def __init__(self, folder: Path, group: int = 3) -> None:
        import mujoco

        scene = mujoco.MjSpec()
        terrain = mujoco.MjSpec.from_file(str(folder / "terrain.xml"))
        scene.attach(terrain, frame=scene.worldbody.add_frame())
        slider = scene.worldbody.add_body(name="slider", mocap=True)
        sphere = slider.add_body(name="dropped")
        sphere.add_joint(name="up", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
        ball = scene.worldbody.add_body(name="ball")
        box = scene.worldbody.add_body(name="box")
        for body in (ball, box):
            body.add_freejoint()
        for body in (sphere, ball):
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0], mass=1)
        box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.2, 0.2, 0.05], mass=1)
        self._mujoco = mujoco
        self.model: Any = scene.compile()
        self.data: Any = mujoco.MjData(self.model)
        self.hidden = not self.model.geom_rgba[self.model.geom_group == 3, 3].any()
        """Whether what collides is not seen, by rays either; here it is, from now on."""
        self.model.geom_rgba[:, 3] = 1
        self._groups = np.zeros(6, np.uint8)
        self._groups[group] = 1
        self._reset()

    def _reset(self) -> None:
        mujoco, model, data = self._mujoco, self.model, self.data
        mujoco.mj_resetData(model, data)
        model.opt.gravity[:] = 0, 0, -9.81
        data.mocap_pos[0] = -_FAR, -_FAR, _FAR
        for name, place in (("ball", -_FAR - 9), ("box", -_FAR - 19)):
            self._place(name, [place, place, _FAR])
        mujoco.mj_forward(model, data)

    def _place(self, name: str, place: list[float], turn: tuple[float, ...] = (1, 0, 0, 0)) -> None:
        begin = self._address(name)
        self.data.qpos[begin : begin + 3] = place
        self.data.qpos[begin + 3 : begin + 7] = turn

    def _address(self, name: str) -> int:
        return int(self.model.jnt_qposadr[self.model.body(name).jntadr[0]])

    def _where(self, name: str) -> list[float]:
        return [float(number) for number in self.data.body(name).xpos]

    def ray_down(self, x: float, y: float) -> float | None:
        hit = self.ray([x, y, 500.0], [x, y, -500.0])
        return None if hit is None else hit[2]

    def ray(self, start: list[float], end: list[float]) -> list[float] | None:
        begin, way = np.array(start, float), np.subtract(end, start)
        length = float(np.linalg.norm(way))
        geom = np.zeros(1, np.int32)
        far = self._mujoco.mj_ray(
            self.model, self.data, begin, way / length, self._groups, 1, -1, geom
        )
        return None if far < 0 or far > length else (begin + way / length * far).tolist()

    def friction_down(self, x: float, y: float) -> float:
        """The friction of what a ray from above meets."""
        geom = np.zeros(1, np.int32)
        way = np.array([0.0, 0.0, -1.0])
        self._mujoco.mj_ray(
            self.model, self.data, np.array([x, y, 500.0]), way, self._groups, 1, -1, geom
        )
        return float(self.model.geom_friction[geom[0], 0])

    def drop(self, x: float, y: float, z: float, radius: float) -> float | None:
        assert radius == 0.1
        self._reset()
        self.data.mocap_pos[0] = x, y, z + radius + 0.02
        self._run(1.0)
        found = self._where("dropped")[2] - radius
        return None if found < z - 1 else found

    def roll(self, start: list[float], direction: list[float], radius: float) -> list[float]:
        assert radius == 0.1
        self._reset()
        self._place("ball", start)
        self.model.opt.gravity[:] = 1.5 * direction[0], 1.5 * direction[1], -9.81
        self._run(_SECONDS)
        return self._where("ball")

    def slide(self, place: list[float], slope: float, seconds: float) -> float:
        self._reset()
        angle = math.atan(slope)
        x, y, z = place
        start = [x - 0.051 * math.sin(angle), y, z + 0.051 * math.cos(angle)]
        self._place("box", start, (math.cos(angle / 2), 0, -math.sin(angle / 2), 0))
        self._run(seconds)
        return math.dist(self._where("box"), start)

    def _run(self, seconds: float) -> None:
        for _ in range(round(seconds / self.model.opt.timestep)):
            self._mujoco.mj_step(self.model, self.data)
