"""Reader of the triangles of a USD file, in metres, by Pixar's own library in a process of its own.

That library opens the layers which a layer names wherever they lie, and may crash on a broken one.
So the process has limits of memory and time, and looks at what a layer names before it is composed.
"""

from __future__ import annotations

import contextlib
import json
import os
import struct
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError
from terratool.importing.types import MAX_FACES, Triangles
from terratool.importing.vrml.shapes import (
    ShapeMesh,
    box,
    cone,
    cylinder,
    halve_quads,
    placed,
    sphere,
)
from terratool.kernels import importing as kernels
from terratool.processes import limit_memory, python_calling

MEMORY, _PER_BYTE = 1 << 30, 40
"""Bytes of memory that the process may take beyond its libraries, and further ones for each byte of
the file."""

SECONDS, _BYTES_A_SECOND = 60.0, 1 << 20
"""Seconds that it may take, and how many bytes of the file allow for one more."""

_MAX_PRIMS = 100_000
"""Most prims that references within the file, and instances, may come to, besides one for each byte
of the file."""

_HEAD = struct.Struct("<Q")
"""Size of the JSON before the arrays in what the process says."""

_SOLIDS = ("Cone", "Cube", "Cylinder", "Plane", "Sphere")
_OTHERS = ("BasisCurves", "Capsule", "HermiteCurves", "NurbsCurves", "NurbsPatch", "Points",
           "TetMesh", "Volume")  # fmt: skip
_TURNS = {"X": (1, 2, 0), "Y": (0, 1, 2), "Z": (2, 0, 1)}
"""Where x, y and z come from in a shape whose axis is y, by the axis that is wanted."""

_SPANNED = {"X": (2, 1), "Y": (0, 2), "Z": (0, 1)}
"""Axes of the width and the length of a Plane, by its own axis."""


class RefusalError(Exception):
    """Raised for a file that is refused, with what is said behind its name, and a hint."""


def read_usd(path: Path) -> Triangles:
    """Read the triangles of all prims that are seen, in their places at the first time.

    Coordinates are in metres, in the axes of the stage. Prims that are invisible, or there as
    guides or proxies, are left out. Meshes are read as they are, without subdivision.

    Raises:
        ReadError: the file is broken, refers to other files, or takes too much memory or time.
    """
    size = path.stat().st_size
    try:
        done = subprocess.run(
            **python_calling(__name__, "main", os.fspath(path.absolute())),
            capture_output=True, check=False, timeout=SECONDS + size / _BYTES_A_SECOND,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise ReadError(f"{path}: takes too long to be read.", "Export a smaller part.") from None
    if done.returncode or len(done.stdout) < _HEAD.size:
        raise ValueError("the library of USD crashed, or needs too much memory")
    (length,) = _HEAD.unpack_from(done.stdout)
    head = json.loads(done.stdout[_HEAD.size : _HEAD.size + length])
    if "refused" in head:
        raise ReadError(f"{path}: {head['refused']}", head["hint"])
    if "broken" in head:
        raise ValueError(head["broken"])
    begin = _HEAD.size + length
    vertices = np.frombuffer(done.stdout, np.float64, 3 * head["vertices"], begin)
    faces = np.frombuffer(done.stdout, np.int32, 3 * head["faces"], begin + vertices.nbytes)
    return Triangles(
        vertices.reshape(-1, 3), faces.reshape(-1, 3), tuple(head["notes"]), head["up"]
    )


# --- in the process ------------------------------------------------------------------------------


def main() -> None:
    """Read the file that the command line names; write what is found to standard output."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the library prints
    from pxr import Usd, UsdGeom  # noqa: F401, memory is counted from here on

    name = sys.argv[1]
    limit_memory(MEMORY + _PER_BYTE * Path(name).stat().st_size)
    arrays: list[NDArray[Any]] = []
    try:
        found = read_stage(name)
    except RefusalError as error:
        head: dict[str, Any] = {"refused": error.args[0], "hint": error.args[1]}
    except MemoryError:
        head = {"refused": "needs too much memory.", "hint": "Export a smaller part."}
    except Exception as error:  # pxr raises Tf.ErrorException for anything
        lines = str(error).strip().splitlines()
        head = {"broken": lines[-1].strip() if lines else type(error).__name__}
    else:
        arrays = [found.vertices, found.faces]
        head = {
            "vertices": len(found.vertices), "faces": len(found.faces),
            "notes": found.notes, "up": found.up,
        }  # fmt: skip
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % _HEAD.size)  # arrays begin where doubles do
    with contextlib.suppress(OSError):
        out.write(_HEAD.pack(len(text)) + text)
        for array in arrays:
            out.write(np.ascontiguousarray(array).data)
        out.flush()
    os._exit(0)  # the library may crash when it ends


def read_stage(name: str) -> Triangles:
    """Read a file in this process, as `read_usd` does in one of its own.

    Raises:
        RefusalError: the file refers to other files, or is too large.
        Exception: any error of the library where the file is no USD.
    """
    from pxr import Sdf, Usd, UsdGeom

    layer = Sdf.Layer.FindOrOpen(name)
    if layer is None:
        raise ValueError("it is no layer")
    _refuse_others(layer)
    stage = Usd.Stage.Open(layer)
    reader = _StageReader(_MAX_PRIMS + Path(name).stat().st_size)
    reader.visit(stage.GetPseudoRoot(), np.eye(4))
    metres = UsdGeom.GetStageMetersPerUnit(stage)
    if not 0 < metres < np.inf:
        _refuse("its unit has no length.", "Set metersPerUnit, and export it again.")
    notes = reader.notes()
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        notes.append(
            "The file names no unit, so it is in centimetres by the standard of USD; metres were "
            "made of them (--scale 100 takes them as metres)."
        )
    elif metres != 1.0:
        notes.append(f"Lengths are in units of {metres:g} m; metres were made of them.")
    vertices = np.concatenate([np.empty((0, 3)), *reader.vertices]) * metres
    faces = np.concatenate([np.empty((0, 3), np.int32), *reader.faces])
    up = str(UsdGeom.GetStageUpAxis(stage)).lower()
    return Triangles(vertices, faces, tuple(notes), up)


def _refuse(what: str, hint: str) -> NoReturn:
    raise RefusalError(what, hint)


def _refuse_others(first: Any) -> None:
    """Refuse layers that name any but those in the same archive, before they are composed."""
    from pxr import Sdf

    package = f"{first.realPath}[" if first.GetFileFormat().IsPackage() else None
    pending, seen = [first], {first.identifier}
    while pending:
        layer = pending.pop()
        named = [*layer.GetCompositionAssetDependencies(), *layer.GetExternalAssetDependencies()]
        for address in filter(None, named):
            whole = layer.ComputeAbsolutePath(address)
            if package is None or not whole.startswith(package) or ".." in whole:
                _refuse(
                    f"a part of it lies in another file, {address[:60]!r}.",
                    "Flatten the stage into one file, as usdcat --flatten does.",
                )
            if whole not in seen:
                seen.add(whole)
                inner = Sdf.Layer.FindOrOpen(whole)
                if inner is None:
                    _refuse(f"its part {address[:60]!r} is missing.", "Export it again.")
                pending.append(inner)
        if _has_clips(layer):
            _refuse("it has value clips, which lie in other files.", "Flatten the stage.")


def _has_clips(layer: Any) -> bool:
    found = []

    def look(path: Any) -> None:
        spec = layer.GetObjectAtPath(path)
        if spec is not None and path.IsPrimPath() and spec.HasInfo("clips"):
            found.append(path)

    layer.Traverse(layer.pseudoRoot.path, look)
    return bool(found)


class _Walk(NamedTuple):
    """A prim to visit, with the place of its parent's coordinates in the stage."""

    prim: Any
    at: NDArray[np.float64]


class _StageReader:
    """Triangles of a stage so far, and what was left out; for so many prims at most."""

    def __init__(self, prims: int) -> None:
        self.vertices: list[NDArray[np.float64]] = []
        self.faces: list[NDArray[np.int32]] = []
        self.size = self.count = 0
        self.prims = prims
        self.left: Counter[str] = Counter()
        self.hidden = 0
        self.smooth = 0

    def notes(self) -> list[str]:
        """Return sentences about what was left out."""
        notes = []
        if self.left:
            listed = ", ".join(f"{count:,} {kind}" for kind, count in sorted(self.left.items()))
            notes.append(f"Parts of the file have no faces that are read: {listed}.")
        if self.hidden:
            notes.append(
                f"Left out, as they are invisible, guides or proxies: {self.hidden:,} prims with "
                "all that is in them."
            )
        if self.smooth:
            notes.append(f"Meshes with subdivision, read without it: {self.smooth:,}.")
        return notes

    def visit(self, root: Any, at: NDArray[np.float64]) -> None:
        """Add the triangles of a prim and of all prims in it, without recursion.

        Args:
            root: the prim.
            at: (4, 4) float64 by which a row x, y, z, 1 of its parent's coordinates is multiplied
                from the left.
        """
        from pxr import Usd, UsdGeom

        seen = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
        time = Usd.TimeCode.EarliestTime()
        pending = [_Walk(root, at)]
        while pending:
            prim, at = pending.pop()
            self.prims -= 1
            if self.prims < 0:
                _refuse(
                    "its parts are instances of each other too often.", "Export a smaller part."
                )
            if prim.IsA(UsdGeom.Imageable) and not self._is_seen(UsdGeom.Imageable(prim), time):
                self.hidden += 1
                continue
            if prim.IsA(UsdGeom.Xformable):
                form = UsdGeom.Xformable(prim)
                own = np.array(form.GetLocalTransformation(time))
                at = own if form.GetResetXformStack() else own @ at
            kind = str(prim.GetTypeName())
            if prim.IsA(UsdGeom.PointInstancer):
                self._instances(UsdGeom.PointInstancer(prim), at, time)
                continue
            if kind == "Mesh":
                self._add(self._mesh(UsdGeom.Mesh(prim), time), at)
            elif kind in _SOLIDS:
                self._add(_solid(kind, prim, time), at)
            elif kind in _OTHERS:
                self.left[kind] += 1
            pending += [_Walk(child, at) for child in reversed(prim.GetFilteredChildren(seen))]

    def _is_seen(self, prim: Any, time: Any) -> bool:
        """Return whether a prim whose parent is seen is seen, too."""
        if prim.GetVisibilityAttr().Get(time) == "invisible":
            return False
        return prim.GetPurposeAttr().Get() not in ("guide", "proxy")

    def _instances(self, instancer: Any, at: NDArray[np.float64], time: Any) -> None:
        """Add the prototypes of a PointInstancer, each at its points."""
        stage = instancer.GetPrim().GetStage()
        prototypes = instancer.GetPrototypesRel().GetForwardedTargets()
        numbers = instancer.GetProtoIndicesAttr().Get(time) or []
        matrices = instancer.ComputeInstanceTransformsAtTime(
            time, time, instancer.ExcludeProtoXform, instancer.IgnoreMask
        )
        mask = instancer.ComputeMaskAtTime(time) or [True] * len(numbers)
        for number, matrix, shown in zip(numbers, matrices, mask, strict=True):
            if shown:
                self.visit(stage.GetPrimAtPath(prototypes[number]), np.array(matrix) @ at)

    def _mesh(self, mesh: Any, time: Any) -> ShapeMesh:
        points = np.asarray(mesh.GetPointsAttr().Get(time) or [], np.float64).reshape(-1, 3)
        counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get(time) or [], np.int32)
        corners = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(time) or [], np.int32)
        if (counts < 0).any() or counts.sum(dtype=np.int64) != len(corners):
            raise ValueError("a mesh has not as many corners as it says")
        if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
            _refuse("a face refers to a vertex that is not there.", "Export it again.")
        if not np.isfinite(points).all():
            raise ValueError("coordinates are no numbers")
        holes = np.asarray(mesh.GetHoleIndicesAttr().Get(time) or [], np.int64)
        kept = np.ones(len(counts), np.bool_)
        kept[holes[(holes >= 0) & (holes < len(counts))]] = False
        if (counts == 3).all():
            faces = corners.reshape(-1, 3)[kept]
        else:
            within = np.repeat(kept, counts)
            ends = np.cumsum(counts[kept])
            faces = kernels.triangulate(points, np.insert(corners[within], ends, np.int32(-1)))[0]
        if mesh.GetOrientationAttr().Get(time) == "leftHanded":
            faces = faces[:, ::-1]
        scheme = mesh.GetSubdivisionSchemeAttr()
        self.smooth += scheme.HasAuthoredValue() and scheme.Get() != "none"
        return ShapeMesh(points, faces)

    def _add(self, mesh: ShapeMesh, at: NDArray[np.float64]) -> None:
        vertices, faces = placed(mesh, at.T[:3])
        self.count += len(faces)
        if self.count > MAX_FACES:
            _refuse(f"its parts come to more than {MAX_FACES:,} faces.", "Export a smaller part.")
        self.vertices.append(vertices)
        self.faces.append(np.asarray(faces + self.size, np.int32))
        self.size += len(vertices)


def _solid(kind: str, prim: Any, time: Any) -> ShapeMesh:
    """Return the triangles of a Cone, Cube, Cylinder, Plane or Sphere."""
    from pxr import UsdGeom

    shape = getattr(UsdGeom, kind)(prim)
    if kind == "Cube":
        return box(np.full(3, shape.GetSizeAttr().Get(time)))
    if kind == "Sphere":
        return sphere(shape.GetRadiusAttr().Get(time))
    axis = str(shape.GetAxisAttr().Get(time))
    if kind == "Plane":
        corners = np.zeros((4, 3))
        across, along = _SPANNED[axis]
        corners[:, across] = np.array([-0.5, 0.5, 0.5, -0.5]) * shape.GetWidthAttr().Get(time)
        corners[:, along] = np.array([-0.5, -0.5, 0.5, 0.5]) * shape.GetLengthAttr().Get(time)
        order = (0, 1, 2, 3) if axis == "Z" else (3, 2, 1, 0)
        return ShapeMesh(corners, halve_quads(np.array([order], np.int32)))
    radius, height = shape.GetRadiusAttr().Get(time), shape.GetHeightAttr().Get(time)
    mesh = (
        cone(radius, height, True, True)
        if kind == "Cone"
        else cylinder(radius, height, True, True, True)
    )
    return ShapeMesh(mesh.vertices[:, _TURNS[axis]], mesh.faces)
