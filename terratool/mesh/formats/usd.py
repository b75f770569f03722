"""Universal Scene Description, by Pixar's own library."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import WriteError
from terratool.mesh.formats.common import (
    SurfacePart,
    encodable_text,
    is_ascii_word,
    linear_color,
    plain_names,
    points_of,
    shape_of,
    surface_parts,
)
from terratool.mesh.types import Mesh

if TYPE_CHECKING:
    from pxr import Usd


@dataclass(frozen=True, slots=True)
class UsdLayout:
    """Layout of a stage of USD.

    Attributes:
        name: name of the terrain, after which the root is named.
        descr: description of the terrain.
        place: position in the stage of the zero of the mesh.
        per_surface: whether each surface is a Mesh of its own, in place of a GeomSubset of one.
    """

    name: str = "terrain"
    descr: str = ""
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    per_surface: bool = False


def write_usd(mesh: Mesh, path: Path, descr: str) -> None:
    """Write a .usda or .usdc of a mesh; see `usd_stage` for what is in it.

    Raises:
        WriteError: the file cannot be written.
    """
    save_stage(usd_stage(mesh, UsdLayout(path.stem, descr)), path)


def save_stage(stage: Usd.Stage, path: Path) -> None:
    """Write the root layer of a stage to a file.

    Raises:
        WriteError: the file cannot be written.
    """
    from pxr import Tf

    try:
        stage.GetRootLayer().Export(str(path))
    except Tf.ErrorException as error:
        # each line of the message ends in the system's reason, within quotes
        found = re.search(r": ([^:'\n]+)'$", str(error), re.MULTILINE)
        raise WriteError(
            f"{path.name}: cannot be written ({found[1].lower() if found else 'by USD'}).",
            "Check the length of the name, the folder, and the space on the disk.",
        ) from error


def usd_stage(mesh: Mesh, layout: UsdLayout) -> Usd.Stage:
    """Return a stage in memory that holds a mesh: z up, in metres and kilograms.

    The root, an Xform, has the name of the terrain. In it lie the scope `Materials`, with a
    Material for each surface, and one Mesh, `Mesh`, with a GeomSubset of the family `materialBind`
    for each surface; or, per surface, the scope `Surfaces` with a Mesh for each. Prims are named
    after the surfaces, in letters, digits and `_` of ASCII; their display names are the true ones.
    A Mesh of a single surface has no subsets. The first subset is that with the largest area from
    above: readers of one material a Mesh take its. The origin stands in the layer's custom data.

    Bodies collide with the triangles as they are. A surface whose friction is known has it as
    static and dynamic friction, without restitution, in its Material, which is bound for physics,
    too. There is no PhysicsScene, which belongs to the stage that refers to the terrain.
    """
    from pxr import Gf, Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    terrain = UsdGeom.Xform.Define(stage, root_path(layout.name))
    if any(layout.place):
        terrain.AddTranslateOp().Set(Gf.Vec3d(*layout.place))
    root = terrain.GetPrim()
    stage.SetDefaultPrim(root)
    layer = stage.GetRootLayer()
    layer.customLayerData = {"terratool": {"origin": Gf.Vec3d(*mesh.origin.tolist())}}
    layer.documentation = encodable_text(layout.descr)

    points = points_of(mesh)
    parts = surface_parts(mesh)
    identifiers = prim_names(part.name for part in parts)
    materials = root.GetPath().AppendChild("Materials")
    UsdGeom.Scope.Define(stage, materials)
    surfaces = [
        _Surface(part, name, _material(stage, materials.AppendChild(name), mesh, part))
        for part, name in zip(parts, identifiers, strict=True)
    ]
    del mesh  # whose memory is wanted for what follows
    if layout.per_surface:
        scope = root.GetPath().AppendChild("Surfaces")
        UsdGeom.Scope.Define(stage, scope)
        for surface in surfaces:
            own, faces = shape_of(points, surface.part)
            _define_mesh(stage, scope.AppendChild(surface.name), own, faces, [surface])
        return stage
    faces = surfaces[0].part.faces
    if len(surfaces) > 1:
        surfaces.sort(key=lambda one: -_area(points, one.part.faces))
        faces = np.concatenate([one.part.faces for one in surfaces])
    _define_mesh(stage, root.GetPath().AppendChild("Mesh"), points, faces, surfaces)
    return stage


def root_path(name: str) -> str:
    """Return the path of the root of a stage by the name of its terrain."""
    return f"/{prim_names([name], 'terrain')[0]}"


def prim_names(names: Any, other: str = "surface") -> list[str]:
    """Return different identifiers of USD for names: words of ASCII that begin with no digit.

    Args:
        names: names, in any script.
        other: identifier of a name of which nothing is left.
    """
    words = plain_names(names, is_ascii_word, other)
    return plain_names((f"_{one}" if one[0].isdigit() else one for one in words), str.isascii, "")


@dataclass(frozen=True, slots=True)
class _Surface:
    """Faces of a surface, with the name of its prims and its Material."""

    part: SurfacePart
    name: str
    material: Any


def _material(stage: Usd.Stage, path: Any, mesh: Mesh, part: SurfacePart) -> Any:
    """Define the Material of a surface: its colour, and its friction where that is known."""
    from pxr import Gf, Sdf, UsdPhysics, UsdShade

    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, path.AppendChild("Preview"))
    shader.CreateIdAttr("UsdPreviewSurface")
    color = Gf.Vec3f(*linear_color(part.color))
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(color)
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    friction = mesh.frictions[part.surface] if part.surface >= 0 else math.nan
    if not math.isnan(friction):
        physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
        physics.CreateStaticFrictionAttr(friction)
        physics.CreateDynamicFrictionAttr(friction)
        physics.CreateRestitutionAttr(0.0)
    _show_name(material, part)
    return material


def _define_mesh(
    stage: Usd.Stage,
    path: Any,
    points: NDArray[np.float32],
    faces: NDArray[np.int32],
    surfaces: Sequence[_Surface],
) -> None:
    """Define a Mesh that collides with its faces, those of one surface after those of another."""
    from pxr import Gf, UsdGeom, UsdPhysics, UsdShade, Vt

    shape = UsdGeom.Mesh.Define(stage, path)
    shape.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    shape.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
    shape.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
    shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    shape.CreateDoubleSidedAttr(True)
    shape.CreateExtentAttr(
        Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)]))
    )
    UsdPhysics.CollisionAPI.Apply(shape.GetPrim())
    # bodies collide with the triangles, not with their hull
    UsdPhysics.MeshCollisionAPI.Apply(shape.GetPrim()).CreateApproximationAttr(
        UsdPhysics.Tokens.none
    )
    binding = UsdShade.MaterialBindingAPI.Apply(shape.GetPrim())
    if len(surfaces) == 1:
        color = Gf.Vec3f(*linear_color(surfaces[0].part.color))
        shape.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([color])
        _bind(binding, surfaces[0])
        _show_name(shape, surfaces[0].part)
        return
    first = 0
    for surface in surfaces:
        end = first + len(surface.part.faces)
        subset = binding.CreateMaterialBindSubset(
            surface.name, Vt.IntArray.FromNumpy(np.arange(first, end, dtype=np.int32))
        )
        _bind(UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()), surface)
        _show_name(subset, surface.part)
        first = end
    binding.SetMaterialBindSubsetsFamilyType(UsdGeom.Tokens.partition)


def _bind(binding: Any, surface: _Surface) -> None:
    """Bind the Material of a surface to a prim, for physics too where it has friction."""
    from pxr import UsdPhysics, UsdShade

    binding.Bind(surface.material)
    if surface.material.GetPrim().HasAPI(UsdPhysics.MaterialAPI):
        binding.Bind(surface.material, UsdShade.Tokens.weakerThanDescendants, "physics")


def _show_name(prim: Any, part: SurfacePart) -> None:
    """Give a prim the true name of a surface."""
    if part.surface >= 0:
        prim.GetPrim().SetDisplayName(encodable_text(part.name))


def _area(points: NDArray[np.float32], faces: NDArray[np.int32]) -> float:
    """Return the area of faces as seen from above, to which walls add nothing."""
    x, y = points[:, 0].astype(np.float64), points[:, 1].astype(np.float64)
    a, b, c = faces.T
    twice = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
    return float(0.5 * np.abs(twice).sum())
