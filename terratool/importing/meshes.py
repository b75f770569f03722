"""Readers of triangles from mesh files of many formats, and from DXF drawings."""

from __future__ import annotations

import contextlib
import io
import json
import logging
import os
import re
import struct
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.apart import apart
from terratool.errors import ReadError, RequestError, TerratoolError
from terratool.extras import install_command
from terratool.importing.collada import read_collada
from terratool.importing.threemf import read_3mf
from terratool.importing.types import (
    Triangles,
    join_triangles,
    refuse_many_faces,
    refuse_missing_vertices,
)
from terratool.importing.upright import TURNED, turn_up, up_note
from terratool.importing.usd import read_usd
from terratool.importing.vrml.scene import UP, read_vrml, up_axis_of
from terratool.text.files import open_file

MAX_VALUES = 2**28
"""Most values of a glTF that its file does not hold, and that a reader would have to fill in."""

_HEAD = 1 << 16
"""Bytes in which a PLY or OFF header has to state its number of faces."""

MAX_ENTITIES = 10_000
"""Most entities that the blocks of a DXF may come to, besides one for each byte of the file."""

_JSON, _MAGIC = 0x4E4F534A, b"glTF"
_MODES = {0: "points", 1: "lines", 2: "lines", 3: "lines", 6: "triangle fans"}
_PACKED = ("EXT_meshopt_compression", "KHR_draco_mesh_compression")

_UNITS = {
    1: ("inch", 0.0254),
    2: ("foot", 0.3048),
    4: ("millimetre", 0.001),
    5: ("centimetre", 0.01),
    7: ("kilometre", 1000.0),
    14: ("decimetre", 0.1),
}
"""Unit names of $INSUNITS, and their lengths in metres (DXF reference, header variables)."""

LARGEST = 1e30
"""Limit of coordinates without sign, as in a definition."""


@dataclass(frozen=True, slots=True)
class Reader:
    """Reader of a mesh format.

    Attributes:
        name: name of the format for people.
        read: reads the triangles of a file, in the file's own axes.
        up: axis that points up, or a function that finds it for a file.
        needs: packages beyond those that terratool always has.
        extra: extra that brings these packages.
    """

    name: str
    read: Callable[[Path], Triangles]
    up: str | Callable[[Path], str] = "z"
    needs: tuple[str, ...] = ()
    extra: str = "import"


def read_triangles(path: str | Path, up: str | None = None, scale: float = 1.0) -> Triangles:
    """Read the triangles of a mesh file, z up.

    Nothing is merged, repaired or reordered. Scenes are assembled, with every part in its place.

    Args:
        path: a file with a suffix of `READERS`.
        up: axis that points up, "y" or "z"; if None, the one that the file states, as COLLADA, USD
            and the project's own files do, or the usual one of the format: y for glTF, VRML and
            X3D, z for others. With y, (x, y, z) becomes (x, -z, y). A note says where the one that
            is taken looks wrong.
        scale: factor on all coordinates, which are in metres for 3MF, COLLADA and USD.

    Raises:
        ReadError: the file is missing, is no whole mesh of its format, or has no faces; a package
            is missing.
        RequestError: the axis or the scale makes no sense.
    """
    path = Path(path)
    if up not in (None, "y", "z"):
        raise RequestError(f"No mesh has its {up} axis up.", "Give y or z.")
    if not 0 < scale < LARGEST:
        raise RequestError(f"The scale is {scale:g}.", "Give a factor above 0.")
    reader = _reader_of(path)
    triangles = _drop_bad_faces(_try_reader(reader, path), path)
    told = up
    if up is None:
        up = triangles.up or (reader.up if isinstance(reader.up, str) else reader.up(path))
    notes = triangles.notes
    if up in TURNED:
        notes += (TURNED[up],)
    if told is None and up != "x":
        notes += up_note(triangles, up)
    vertices = turn_up(triangles.vertices, up)
    if scale != 1.0:
        vertices = vertices * scale
    return Triangles(vertices, triangles.faces, notes)


def _reader_of(path: Path) -> Reader:
    """Return the reader for a file.

    Raises:
        ReadError: the file is missing or unreadable, its suffix is unknown, or a package is
            missing.
    """
    reader = next((READERS[end] for end in READERS if path.name.lower().endswith(end)), None)
    if reader is None:
        raise ReadError(
            f"{path}: {path.suffix or 'a name without a suffix'} is no format of a mesh.",
            f"One of these is: {', '.join(READERS)}.",
        )
    try:
        if path.is_dir():
            raise ReadError(f"{path}: is a folder.", "Give the name of a file.")
        if not path.exists():
            raise ReadError(f"{path}: does not exist.", "Check the name.")
        with open_file(path) as file:
            empty = not file.read(1)
    except (OSError, ValueError) as error:
        why = (getattr(error, "strerror", None) or str(error)).lower()
        raise ReadError(f"{path}: cannot be read ({why}).", "Check the file.") from error
    if empty:
        raise ReadError(f"{path}: is empty.", "Export the mesh again.")
    for package in reader.needs:
        try:
            with apart():
                import_module(package)
        except ImportError as error:
            raise ReadError(
                f"{path}: {reader.name} needs {package}, which is not installed.",
                f"Run {install_command(reader.extra)}",
            ) from error
    return reader


def _try_reader(reader: Reader, path: Path) -> Triangles:
    """Read a file, and turn every failure into an error for the user.

    Raises:
        ReadError: the reader fails, in whatever way.
    """
    try:
        with _quiet():
            return reader.read(path)
    except TerratoolError:
        raise
    except MemoryError as error:
        raise ReadError(
            f"{path}: does not fit into memory.", "Export a smaller part of the mesh."
        ) from error
    except RecursionError as error:
        raise ReadError(f"{path}: its parts hold themselves.", "Export it again.") from error
    except Exception as error:
        # libraries raise anything for broken input, from AssertionError to zlib.error
        words = " ".join(str(error).split())
        # trimesh imports a guesser of encodings only where a file is no text
        why = f" ({words[:100]})" if words and not isinstance(error, ImportError) else ""
        raise ReadError(
            f"{path}: cannot be read as {reader.name}{why}.",
            "It may be cut short, or of another format than its suffix says; export it again, as "
            "triangles.",
        ) from error


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Silence the output of readers, and turn NumPy's warning of unread numbers into an error."""
    logs = [logging.getLogger(name) for name in ("trimesh", "ezdxf")]
    levels = [log.level for log in logs]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", "string or file could not be read to its end")
        for log in logs:
            log.setLevel(logging.CRITICAL + 1)
        try:
            yield
        finally:
            for log, level in zip(logs, levels, strict=True):
                log.setLevel(level)


def _drop_bad_faces(triangles: Triangles, path: Path) -> Triangles:
    """Return triangles without faces whose coordinates are NaN, infinite or too large.

    Raises:
        ReadError: no face is left, or a face refers to a missing vertex.
    """
    vertices, faces, notes = triangles.vertices, triangles.faces, triangles.notes
    if len(faces) == 0:
        raise ReadError(
            f"{path}: has no faces.{' '.join(('', *notes))}",
            "Points and lines have to be triangulated first; a file that is cut short has to be "
            "exported again.",
        )
    refuse_missing_vertices(path, faces, len(vertices))
    with np.errstate(invalid="ignore"):
        bad: NDArray[np.bool_] = ~np.all(np.abs(vertices) < LARGEST, axis=1)
    if bad.any():
        kept = ~bad[faces].any(axis=1)
        if not kept.any():
            raise ReadError(
                f"{path}: no face has coordinates that are numbers.", "Export it again."
            )
        dropped = len(faces) - int(kept.sum())
        if dropped:
            notes += (
                f"{dropped:,} of {len(faces):,} faces have coordinates that are no numbers below "
                f"{LARGEST:g}, and were left out.",
            )
        faces = faces[kept]
        vertices = np.where(bad[:, None], 0.0, vertices)
    return replace(triangles, vertices=vertices, faces=faces, notes=notes)


def _by_trimesh(path: Path, kind: str) -> Triangles:
    """Read the meshes of a scene by trimesh, each as often as the scene has it."""
    import trimesh

    notes = check_gltf(path) if kind in ("glb", "gltf") else ()
    plain = {} if kind in ("stl", "off") else {"skip_materials": True}
    with open_file(path) as file:
        scene: Any = trimesh.load(
            _with_forward_numbers(_as_utf8(file.read())) if kind == "obj" else file,
            file_type=kind,
            resolver=_buffers_beside(path) if kind == "gltf" else None,
            force="scene",
            process=False,
            **plain,
        )
    placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
    parts = [(matrix, scene.geometry[name]) for matrix, name in placed]
    meshes = [part for part in parts if hasattr(part[1], "faces")]
    if len(meshes) < len(parts) and not notes:
        notes += (
            f"Parts of the file have no faces and were left out: {len(parts) - len(meshes):,}.",
        )
    refuse_many_faces(path, sum(len(mesh.faces) for _, mesh in meshes))
    triangles = join_triangles(
        ((_transform(mesh.vertices, matrix), np.asarray(mesh.faces)) for matrix, mesh in meshes),
        path,
    )
    declared = declared_faces(path)
    if 0 < len(triangles.faces) < declared:
        raise ReadError(
            f"{path}: has {len(triangles.faces):,} of {declared:,} faces; it is cut short.",
            "Export it again.",
        )
    return replace(triangles, notes=notes)


def _buffers_beside(path: Path) -> Any:
    """Return a resolver that gives trimesh regular files in a glTF's folder, and nothing else."""
    from trimesh.resolvers import FilePathResolver

    def get(name: str) -> bytes:
        folder = path.parent.resolve()
        buffer = (folder / name.strip()).resolve()
        if not buffer.is_relative_to(folder):
            raise ValueError(f"it names {name[:60]!r}, which lies out of its folder")
        with open_file(buffer) as file:
            return file.read()

    resolver = FilePathResolver(str(path))
    resolver.get = get
    return resolver


def _transform(vertices: Any, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Transform vertices, (n, 3), by a 4 × 4 matrix."""
    points = np.asarray(vertices, np.float64)
    if np.array_equal(matrix, np.eye(4)):
        return points
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def _with_forward_numbers(text: bytes) -> io.BytesIO:
    """Return an OBJ whose faces count vertices from the first one.

    Negative numbers count back from the face (Wavefront, Object Files, "Referencing groups of
    vertices"), but trimesh counts them back from the end of the file.
    """
    if re.search(rb"^[ \t]*f(?:[ \t]+[^\s\\]+){0,2}[ \t\r]*$", text, re.MULTILINE):
        raise ValueError("a face has fewer than three corners")
    if not re.search(rb"^\s*f\s(?:[^\n]*-|(?:[^\n]*\s)?0+[\s/])", text, re.MULTILINE):
        return io.BytesIO(text)

    def forward_number(number: bytes, count: int) -> bytes:
        place = int(number)
        if place == 0 or place < -count:
            raise ValueError(f"a face has the number {place}")
        return b"%d" % (place if place > 0 else place + count + 1)

    seen = {b"v": 0, b"vt": 0, b"vn": 0}
    lines = []
    for line in text.splitlines():
        words = line.split()
        if words and words[0] in seen:
            seen[words[0]] += 1
        elif words and words[0] == b"f":
            counts = (seen[b"v"], seen[b"vt"], seen[b"vn"])
            corners = (zip(word.split(b"/"), counts, strict=False) for word in words[1:])
            line = b"f " + b" ".join(
                b"/".join(forward_number(*pair) if pair[0] else b"" for pair in one)
                for one in corners
            )
        lines.append(line)
    return io.BytesIO(b"\n".join(lines))


def _as_utf8(text: bytes) -> bytes:
    """Return a text in UTF-8 or Latin-1 as UTF-8; only comments and names may differ."""
    try:
        text.decode()
    except UnicodeDecodeError:
        return text.decode("latin-1").encode()
    return text


# --- headers -------------------------------------------------------------------------------------


def check_gltf(path: Path) -> tuple[str, ...]:
    """Refuse a glTF or GLB that cannot be read whole, and return notes on parts left out.

    Raises:
        ReadError: the file is compressed, lacks values, or has sparse or packed positions.
        ValueError: the header is no JSON, or is cut short.
    """
    header = _gltf_header(path)
    packed = [name for name in _PACKED if name in header.get("extensionsRequired", [])]
    if packed:
        raise ReadError(
            f"{path}: is compressed by {packed[0]}.", "Export it without that compression."
        )
    accessors = header.get("accessors", [])
    made_up = sum(item.get("count", 0) for item in accessors if "bufferView" not in item)
    if made_up > MAX_VALUES:
        raise ReadError(
            f"{path}: its header asks for {made_up:,} values that the file does not hold.",
            "Export it with all values in the file: each accessor with a bufferView.",
        )
    left: dict[str, int] = {}
    for mesh in header.get("meshes", []):
        for primitive in mesh["primitives"]:
            position = accessors[primitive["attributes"]["POSITION"]]
            if position.get("normalized") or "sparse" in position:
                raise ReadError(
                    f"{path}: its positions are {'sparse' if 'sparse' in position else 'packed'}.",
                    "Export it with plain positions of type float.",
                )
            kind = _MODES.get(primitive.get("mode", 4))
            if kind:
                left[kind] = left.get(kind, 0) + 1
    listed = ", ".join(f"{number:,} of {kind}" for kind, number in sorted(left.items()))
    return (f"Parts of the file are no triangles and were left out: {listed}.",) if left else ()


def declared_faces(path: Path) -> int:
    """Number of faces that the header of a PLY or OFF states or a text STL begins; 0 for others."""
    kind = path.suffix.lower()
    with open_file(path) as file:
        if kind == ".stl":
            size = path.stat().st_size
            head = file.read(84)
            if len(head) == 84 and size == 84 + 50 * struct.unpack("<I", head[80:])[0]:
                return 0
            return (head + file.read()).lower().count(b"outer loop")
        head = file.read(_HEAD)
    if kind == ".ply":
        found = re.search(rb"^element\s+face\s+(\d+)", head, re.MULTILINE)
    elif kind == ".off":
        found = re.search(rb"OFF\s+\d+\s+(\d+)", re.sub(rb"#[^\n]*", b"", head))
    else:
        return 0
    return int(found[1]) if found else 0


def _gltf_header(path: Path) -> dict[str, Any]:
    with open_file(path) as file:
        if path.suffix.lower() == ".gltf":
            text = file.read()
        else:
            magic, version, _, length, kind = struct.unpack("<4s4I", _exactly(file.read(20), 20))
            if magic == _MAGIC and version == 1:
                raise _old_gltf(path)
            if magic != _MAGIC or kind != _JSON:
                raise ValueError("it does not begin like a GLB")
            size = path.stat().st_size
            text = _exactly(file.read(min(length, size)), length)
            while head := file.read(8):  # chunks that trimesh would read at once
                (length,) = struct.unpack("<I", _exactly(head, 8)[:4])
                if length > size - file.tell():
                    raise ValueError("it is cut short")
                file.seek(length, os.SEEK_CUR)
    header = json.loads(text)
    if not isinstance(header, dict):
        raise ValueError("its header is no object")
    asset = header.get("asset")
    version = asset.get("version") if isinstance(asset, dict) else None
    # version 1 has dictionaries where version 2 has lists
    old = version is None and isinstance(header.get("meshes"), dict)
    if old or str(version).startswith("1"):
        raise _old_gltf(path)
    return header


def _old_gltf(path: Path) -> ReadError:
    return ReadError(
        f"{path}: is glTF 1.0, and version 2.0 is read.",
        "Export the scene as glTF 2.0, or convert it.",
    )


def _exactly(data: bytes, length: int) -> bytes:
    if len(data) != length:
        raise ValueError("it is cut short")
    return data


# --- DXF -----------------------------------------------------------------------------------------


def read_dxf(path: Path) -> Triangles:
    """Read the faces in the model space of a drawing, polygons cut into triangles.

    Raises:
        ReadError: blocks are nested without end.
        Exception: any error of ezdxf where the file is no DXF.
    """
    import ezdxf
    from ezdxf.disassemble import recursive_decompose

    drawing = ezdxf.readfile(path)
    corners: list[tuple[float, float, float]] = []
    others: Counter[str] = Counter()
    most = MAX_ENTITIES + path.stat().st_size
    for count, entity in enumerate(recursive_decompose(drawing.modelspace())):
        if count >= most:
            raise ReadError(
                f"{path}: its blocks come to more than {most:,} entities.",
                "Explode and purge the drawing, and export the terrain alone.",
            )
        before = len(corners)
        for polygon in _polygons(entity):
            for triangle in _triangles(polygon):
                corners.extend((point.x, point.y, point.z) for point in triangle)
        if len(corners) == before:
            others[entity.dxftype()] += 1
    notes = []
    if others:
        listed = ", ".join(f"{number:,} {kind}" for kind, number in sorted(others.items()))
        notes.append(f"The drawing also has entities without faces, which were left out: {listed}.")
    unit = _UNITS.get(int(drawing.header.get("$INSUNITS", 0)))
    if unit:
        notes.append(
            f"The drawing says that its unit is the {unit[0]}; coordinates are taken as they are, "
            f"a scale of {unit[1]:g} makes metres of them."
        )
    vertices = np.array(corners, np.float64).reshape(-1, 3)
    faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    return Triangles(vertices, faces, tuple(notes))


def _polygons(entity: Any) -> Any:
    """Faces of a DXF entity, as lists of points; none for other kinds of entities."""
    from ezdxf.render.mesh import MeshBuilder

    kind = entity.dxftype()
    if kind == "3DFACE":
        return [entity.wcs_vertices()]
    if kind == "MESH":
        return MeshBuilder.from_mesh(entity).faces_as_vertices()
    if kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
        return MeshBuilder.from_polyface(entity).faces_as_vertices()
    return ()


def _triangles(polygon: Any) -> Iterator[Any]:
    """Cut a polygon of points into triangles between them; none if it has fewer than three."""
    points = list(polygon)
    count = len(points)
    first = 0
    if count > 3:
        bends = [(points[n] - points[n - 1]).cross(points[n - count + 1] - points[n])
                 for n in range(count)]  # fmt: skip
        normal = sum((points[n - 1].cross(points[n]) for n in range(count)), start=0 * points[0])
        inward = [n for n in range(count) if bends[n].dot(normal) < 0]
        if inward and count > 4:
            from ezdxf.math.triangulation import mapbox_earcut_3d

            # earcut returns rounded points in one plane
            for ear in mapbox_earcut_3d(points):
                yield [min(points, key=corner.distance) for corner in ear]
            return
        first = inward[0] if inward else 0
    points = points[first:] + points[:first]
    for n in range(1, count - 1):
        yield points[0], points[n], points[n + 1]


_VRML = Reader("VRML", read_vrml, up=lambda path: up_axis_of(path) or UP)
_X3D = replace(_VRML, name="X3D")
_USD = Reader("USD", read_usd, up="y", needs=("pxr",), extra="usd")
READERS = {
    ".obj": Reader("OBJ", partial(_by_trimesh, kind="obj")),
    ".stl": Reader("STL", partial(_by_trimesh, kind="stl")),
    ".ply": Reader("PLY", partial(_by_trimesh, kind="ply")),
    ".glb": Reader("GLB", partial(_by_trimesh, kind="glb"), up="y"),
    ".gltf": Reader("glTF", partial(_by_trimesh, kind="gltf"), up="y"),
    ".off": Reader("OFF", partial(_by_trimesh, kind="off")),
    ".3mf": Reader("3MF", read_3mf),
    ".dae": Reader("COLLADA", read_collada, up="y"),
    ".dxf": Reader("DXF", read_dxf, needs=("ezdxf",)),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), _USD),
    **dict.fromkeys((".wrl", ".wrl.gz", ".wrz"), _VRML),
    **dict.fromkeys((".x3d", ".x3d.gz", ".x3dz", ".x3dv", ".x3dv.gz", ".x3dvz"), _X3D),
}
"""Readers of mesh formats by suffix."""
