"""Universal Scene Description, by Pixar's own library."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from terratool.errors import WriteError
from terratool.mesh.formats.common import (
    encodable,
    face_colors,
    linear,
    points_of,
    surface_parts,
)
from terratool.mesh.types import Mesh


def write_usd(mesh: Mesh, path: Path, descr: str) -> None:
    """Write a .usda or .usdc: one Mesh with a subset and a material per surface, z up, in metres.

    Prims are named after the surfaces, in letters, digits and `_` of ASCII; their display names are
    the true ones. The origin stands in the layer's custom data.

    Raises:
        WriteError: the file cannot be written.
    """
    from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade, Vt

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, "/Terrain").GetPrim()
    stage.SetDefaultPrim(root)
    layer = stage.GetRootLayer()
    layer.customLayerData = {"terratool": {"origin": Gf.Vec3d(*mesh.origin.tolist())}}
    layer.documentation = encodable(descr)

    points = points_of(mesh)
    prim = UsdGeom.Mesh.Define(stage, "/Terrain/Mesh")
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
    prim.CreateFaceVertexIndicesAttr(
        Vt.IntArray.FromNumpy(np.ascontiguousarray(mesh.faces.ravel(), np.int32))
    )
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateDoubleSidedAttr(True)
    prim.CreateExtentAttr(
        Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)]))
    )
    light = np.array([linear((shade, 0, 0))[0] for shade in range(256)], np.float32)
    prim.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform).Set(
        Vt.Vec3fArray.FromNumpy(light[face_colors(mesh)])
    )
    UsdGeom.Subset.SetFamilyType(prim, UsdShade.Tokens.materialBind, UsdGeom.Tokens.partition)
    UsdGeom.Scope.Define(stage, "/Terrain/Materials")
    for part in surface_parts(mesh):
        word = part.word
        material = UsdShade.Material.Define(stage, f"/Terrain/Materials/Material_{word}")
        shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("Preview"))
        shader.CreateIdAttr("UsdPreviewSurface")
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(
            Gf.Vec3f(*linear(part.color))
        )
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        subset = UsdGeom.Subset.Define(stage, f"/Terrain/Mesh/Faces_{word}")
        subset.CreateElementTypeAttr(UsdGeom.Tokens.face)
        subset.CreateFamilyNameAttr(UsdShade.Tokens.materialBind)
        own = np.flatnonzero(mesh.surfaces == part.surface).astype(np.int32)
        subset.CreateIndicesAttr(Vt.IntArray.FromNumpy(own))
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(material)
        if part.surface >= 0:
            for named in (material, subset):
                named.GetPrim().SetDisplayName(encodable(part.name))
    try:
        layer.Export(str(path))
    except Tf.ErrorException as error:
        # each of its lines ends in what the system says, within quotes
        found = re.search(r": ([^:'\n]+)'$", str(error), re.MULTILINE)
        raise WriteError(
            f"{path.name}: cannot be written ({found[1].lower() if found else 'by USD'}).",
            "Check the length of the name, the folder, and the space on the disk.",
        ) from error
