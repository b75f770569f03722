"""USD physics: one Mesh that collides as it is, with the friction of each surface."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from terratool.mesh.formats.usd import UsdLayout, save_stage, usd_stage
from terratool.mesh.types import Mesh
from terratool.report.wording import count_of
from terratool.simulators.scene import Scene
from terratool.simulators.targets import WrittenFiles
from terratool.text.display import printable

if TYPE_CHECKING:
    from pxr import Usd

_FILE = "terrain.usdc"


def stage_of(scene: Scene) -> Usd.Stage:
    """Return a stage in memory with the mesh of a scene and the friction of its surfaces.

    Raises:
        RequestError: there is no ground.
    """
    layout = UsdLayout(scene.name, scene.terrain.descr, scene.offset, scene.options.per_surface)
    return usd_stage(_with_materials(scene), layout)


def write(scene: Scene, folder: Path) -> WrittenFiles:
    """Write a USD layer into a folder.

    Raises:
        WriteError: the file cannot be written.
    """
    stage = stage_of(scene)
    save_stage(stage, folder / _FILE)
    prims = list(stage.Traverse())
    meshes = [prim for prim in prims if prim.GetTypeName() == "Mesh"]
    subsets = [prim for prim in prims if prim.GetTypeName() == "GeomSubset"]
    count = sum(len(prim.GetAttribute("faceVertexCounts").Get()) for prim in meshes)
    faces = count_of(count, "face")
    if len(meshes) > 1:
        summary = f"a Mesh for each of {len(meshes):,} surfaces collides, of {faces} together"
    else:
        within = f" in {len(subsets):,} GeomSubsets" * bool(subsets)
        summary = f"1 Mesh collides, of {faces}{within}"
    return WrittenFiles(
        summary=summary,
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
            "Each Mesh has `PhysicsCollisionAPI` and `approximation` none. Each surface is a"
            " GeomSubset or a Mesh, with a Material of static and dynamic friction alike, without"
            " restitution.",
        ),
        losses=tuple(_losses(meshes, subsets)),
        facts={"prims": [str(prim.GetPath()) for prim in meshes + subsets], "faces": count},
    )


def _with_materials(scene: Scene) -> Mesh:
    """Return the mesh with friction everywhere: assumed where unknown, and without a surface."""
    mesh, (*own, none) = scene.take_mesh(), scene.materials
    return replace(
        mesh,
        surfaces=np.where(mesh.surfaces < 0, np.int32(len(own)), mesh.surfaces),
        names=(*mesh.names, none.name),
        colors=np.concatenate([mesh.colors, np.array([none.color], np.uint8)]),
        frictions=np.array([one.friction for one in (*own, none)]),
    )


def _losses(meshes: Sequence[Usd.Prim], subsets: Sequence[Usd.Prim]) -> Iterator[str]:
    """Yield sentences on what readers lose of Meshes and GeomSubsets."""
    if len(meshes) > 1:
        yield (
            "Isaac Lab's RayCaster, and so its height scanner, meets the first Mesh alone: leave"
            " out --per-surface for it, or take its MultiMeshRayCaster."
        )
    if subsets:
        first = printable(subsets[0].GetDisplayName())
        yield (
            f"Newton takes one friction for a Mesh, that of the first GeomSubset ({first}):"
            " --per-surface gives each surface its own."
        )
    yield (
        "How the friction of two bodies combines is up to the engine: PhysX takes their average"
        " unless told otherwise, Newton what its solver takes."
    )
