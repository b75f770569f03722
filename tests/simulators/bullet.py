"""A terrain in PyBullet."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from typing import Any

STEP = 1 / 240
_SECONDS = 2.5


class Bullet:
    """As `tests.simulators.checks.Simulator` wants it, loaded as the README of the files says."""

    def __init__(self, folder: Path) -> None:
        import pybullet

        # what says nothing of a connection means the first
        if pybullet.isConnected():
            pybullet.disconnect()
        [code] = re.findall(r"```python\n(.*?)```", (folder / "README.md").read_text("utf-8"), re.S)
        names: dict[str, Any] = {}
        before = Path.cwd()
        os.chdir(folder)
        try:
            exec(code, names)
        finally:
            os.chdir(before)
        self._bullet, self.terrain = pybullet, names["terrain"]
        pybullet.setGravity(0, 0, -9.81)

    def close(self) -> None:
        if self._bullet.isConnected():
            self._bullet.disconnect()

    def ray_down(self, x: float, y: float) -> float | None:
        hit = self.ray([x, y, 500.0], [x, y, -500.0])
        return None if hit is None else hit[2]

    def ray(self, start: list[float], end: list[float]) -> list[float] | None:
        [(body, _, _, place, _)] = self._bullet.rayTest(start, end)
        return None if body < 0 else list(place)

    def drop(self, x: float, y: float, z: float, radius: float) -> float | None:
        bullet = self._bullet
        begin = z + radius + 0.02
        body = bullet.createMultiBody(
            baseMass=0,
            basePosition=[x, y, begin],
            linkMasses=[1],
            linkCollisionShapeIndices=[self._sphere(radius)],
            linkVisualShapeIndices=[-1],
            linkPositions=[[0, 0, 0]],
            linkOrientations=[[0, 0, 0, 1]],
            linkInertialFramePositions=[[0, 0, 0]],
            linkInertialFrameOrientations=[[0, 0, 0, 1]],
            linkParentIndices=[0],
            linkJointTypes=[bullet.JOINT_PRISMATIC],
            linkJointAxis=[[0, 0, 1]],
        )
        bullet.setJointMotorControl2(body, 0, bullet.VELOCITY_CONTROL, force=0)
        self._run(1.0)
        found = bullet.getLinkState(body, 0)[0][2] - radius
        bullet.removeBody(body)
        return None if found < z - 1 else found

    def roll(self, start: list[float], direction: list[float], radius: float) -> list[float]:
        bullet = self._bullet
        body = bullet.createMultiBody(1, self._sphere(radius), basePosition=start)
        bullet.changeDynamics(body, -1, lateralFriction=1, linearDamping=0, angularDamping=0)
        bullet.setGravity(1.5 * direction[0], 1.5 * direction[1], -9.81)
        self._run(_SECONDS)
        found = bullet.getBasePositionAndOrientation(body)[0]
        bullet.setGravity(0, 0, -9.81)
        bullet.removeBody(body)
        return list(found)

    def slide(self, place: list[float], slope: float, seconds: float) -> float:
        bullet = self._bullet
        angle = math.atan(slope)
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[0.2, 0.2, 0.05])
        x, y, z = place
        above = 0.051
        start = [x - above * math.sin(angle), y, z + above * math.cos(angle)]
        turn = bullet.getQuaternionFromEuler([0, -angle, 0])
        body = bullet.createMultiBody(1, shape, basePosition=start, baseOrientation=turn)
        bullet.changeDynamics(body, -1, lateralFriction=1, linearDamping=0, angularDamping=0)
        self._run(seconds)
        found = bullet.getBasePositionAndOrientation(body)[0]
        bullet.removeBody(body)
        return math.dist(found, start)

    def _sphere(self, radius: float) -> int:
        bullet = self._bullet
        return int(bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=radius))

    def _run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP)):
            self._bullet.stepSimulation()
