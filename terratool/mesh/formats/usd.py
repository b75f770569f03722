"""Universal Scene Description, by Pixar's own library."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from terratool.errors import WriteError
from terratool.mesh.formats.common import (
    encodable_text,
    linear_color,
    points_of,
    shape_of,
    surface_parts,
)
from terratool.mesh.types import Mesh


def write_usd(
    mesh: Mesh, path: Path, descr: str, place: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> None:
    """Write a .usda or .usdc: a Mesh and a Material per surface, z up, in metres and kilograms.

    Prims are named after the surfaces, in letters, digits and `_` of ASCII; their display names are
    the true ones. The origin stands in the layer's custom data; `place` is its position in the
    stage.

    Bodies collide with the triangles of each Mesh as they are. A surface whose friction is known
    has it as static and dynamic friction, without restitution, in its Material, which is bound for
    physics, too. There is no PhysicsScene, which belongs to the stage that refers to the terrain.

    Raises:
        WriteError: the file cannot be written.
    """
    from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    terrain = UsdGeom.Xform.Define(stage, "/Terrain")
    if any(place):
        terrain.AddTranslateOp().Set(Gf.Vec3d(*place))
    root = terrain.GetPrim()
    stage.SetDefaultPrim(root)
    layer = stage.GetRootLayer()
    layer.customLayerData = {"terratool": {"origin": Gf.Vec3d(*mesh.origin.tolist())}}
    layer.documentation = encodable_text(descr)

    UsdGeom.Scope.Define(stage, "/Terrain/Materials")
    points = points_of(mesh)
    for part in surface_parts(mesh):
        color = Gf.Vec3f(*linear_color(part.color))
        material = UsdShade.Material.Define(stage, f"/Terrain/Materials/Material_{part.word}")
        shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("Preview"))
        shader.CreateIdAttr("UsdPreviewSurface")
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(color)
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")

        own, faces = shape_of(points, part)
        shape = UsdGeom.Mesh.Define(stage, f"/Terrain/Surface_{part.word}")
        shape.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(own))
        shape.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
        shape.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
        shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        shape.CreateDoubleSidedAttr(True)
        shape.CreateExtentAttr(
            Vt.Vec3fArray.FromNumpy(np.stack([own.min(axis=0), own.max(axis=0)]))
        )
        shape.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([color])
        UsdPhysics.CollisionAPI.Apply(shape.GetPrim())
        # bodies collide with the triangles, not with their hull
        UsdPhysics.MeshCollisionAPI.Apply(shape.GetPrim()).CreateApproximationAttr(
            UsdPhysics.Tokens.none
        )
        binding = UsdShade.MaterialBindingAPI.Apply(shape.GetPrim())
        binding.Bind(material)
        friction = mesh.frictions[part.surface] if part.surface >= 0 else math.nan
        if not math.isnan(friction):
            physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
            physics.CreateStaticFrictionAttr(friction)
            physics.CreateDynamicFrictionAttr(friction)
            physics.CreateRestitutionAttr(0.0)
            binding.Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")
        if part.surface >= 0:
            for named in (material, shape):
                named.GetPrim().SetDisplayName(encodable_text(part.name))
    try:
        layer.Export(str(path))
    except Tf.ErrorException as error:
        # each line of the message ends in the system's reason, within quotes
        found = re.search(r": ([^:'\n]+)'$", str(error), re.MULTILINE)
        raise WriteError(
            f"{path.name}: cannot be written ({found[1].lower() if found else 'by USD'}).",
            "Check the length of the name, the folder, and the space on the disk.",
        ) from error
