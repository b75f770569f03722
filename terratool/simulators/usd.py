"""USD physics: a Mesh for each surface that collides as it is, with its friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from terratool.mesh.formats.usd import write_usd
from terratool.mesh.types import Mesh
from terratool.report.wording import count_of
from terratool.simulators.scene import Scene
from terratool.simulators.targets import WrittenFiles

_FILE = "terrain.usdc"


def write(scene: Scene, folder: Path) -> WrittenFiles:
    """Write a USD layer into a folder.

    Raises:
        WriteError: the file cannot be written.
    """
    mesh = _with_materials(scene)
    write_usd(mesh, folder / _FILE, scene.terrain.descr, scene.offset)
    prims = [f"/Terrain/Surface_{part.word}" for part in scene.parts]
    several = len(prims) > 1
    meshes = (
        f"a Mesh for each of {len(prims):,} surfaces collides" if several else "1 Mesh collides"
    )
    return WrittenFiles(
        summary=f"{meshes}, of {count_of(len(mesh.faces), 'face')}{' together' * several}",
        language="python",
        load=(
            "import newton",
            "builder = newton.ModelBuilder()",
            f'builder.add_usd("{_FILE}")',
        ),
        notes=(
            "Newton reads USD after `pip install 'newton[importers]'`. Isaac Sim, Isaac Lab and"
            " usdview take the file by a reference, such as"
            f' `UsdFileCfg(usd_path="…/{_FILE}")`. There is no PhysicsScene: that belongs to the'
            " stage that refers to the terrain.",
            "Each surface is a Mesh with `PhysicsCollisionAPI`, `approximation` none, and a"
            " Material with static and dynamic friction alike, without restitution.",
        ),
        losses=(
            "How the friction of two bodies combines is up to the engine: PhysX takes their average"
            " unless told otherwise, Newton what its solver takes.",
        ),
        facts={"prims": prims, "faces": len(mesh.faces)},
    )


def _with_materials(scene: Scene) -> Mesh:
    """Return the mesh with friction everywhere: assumed where unknown, and without a surface."""
    mesh, (*own, none) = scene.mesh, scene.materials
    return replace(
        mesh,
        surfaces=np.where(mesh.surfaces < 0, np.int32(len(own)), mesh.surfaces),
        names=(*mesh.names, none.name),
        colors=np.concatenate([mesh.colors, np.array([none.color], np.uint8)]),
        frictions=np.array([one.friction for one in (*own, none)]),
    )
