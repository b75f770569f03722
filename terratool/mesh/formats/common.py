"""Surfaces, names, colours, comments and numbers for all formats of meshes."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import mesh as kernels
from terratool.mesh.types import HeightGrid, Mesh

NO_COLOR = (128, 128, 128)
"""Colour (red, green, blue) of faces without a surface."""

NO_NAME = "none"
"""Name of faces without a surface, where a format wants one."""


@dataclass(frozen=True, slots=True)
class SurfacePart:
    """The faces of one surface, at least one.

    Attributes:
        surface: index into the names of the mesh; -1 for none.
        name: name of the surface in the definition; `NO_NAME` for none.
        word: name in characters that a format allows, different from those of other parts.
        color: red, green, blue of the surface, 0 to 255.
        faces: (m, 3) int32 indices of vertices of the mesh.
        normals: (m, 3) int32 indices of normals of the mesh, if that has any.
    """

    surface: int
    name: str
    word: str
    color: tuple[int, int, int]
    faces: NDArray[np.int32]
    normals: NDArray[np.int32] | None


def points_of(mesh: Mesh) -> NDArray[np.float32]:
    """Return vertices as all files have them, (n, 3) float32, relative to the mesh's origin."""
    return np.ascontiguousarray(mesh.vertices, np.float32)


def world_points_of(mesh: Mesh) -> NDArray[np.float64]:
    """Return vertices in the world, (n, 3) float64: those of `points_of` plus the origin."""
    return points_of(mesh) + mesh.origin


def is_ascii_word(character: str) -> bool:
    """Whether a character may stand in identifiers of any format."""
    return character.isascii() and (character.isalnum() or character == "_")


def surface_parts(mesh: Mesh, allowed: Callable[[str], bool] = is_ascii_word) -> list[SurfacePart]:
    """Return the faces of a mesh by surface, in order; faces without a surface come last.

    Args:
        mesh: mesh to part.
        allowed: function that says whether a character may stand in words.
    """
    count = len(mesh.names)
    # faces without a surface come last
    places = np.where(mesh.surfaces < 0, np.int32(count), mesh.surfaces)
    counts = np.bincount(places, minlength=count + 1)
    ends = np.cumsum(counts)
    faces = mesh.faces
    normals = mesh.normals.corners if mesh.normals else None
    if np.count_nonzero(counts) > 1:
        faces = kernels.sort_faces(faces, places, counts)
        if normals is not None:
            normals = kernels.sort_faces(normals, places, counts)
    used = np.flatnonzero(counts).tolist()
    names = [*mesh.names, NO_NAME]
    colors = [*map(tuple, mesh.colors.tolist()), NO_COLOR]
    words = plain_names([names[place] for place in used], allowed, "surface")
    own = [slice(end - count, end) for end, count in zip(ends, counts, strict=True)]
    return [
        SurfacePart(
            surface=place if place < count else -1,
            name=names[place],
            word=word,
            color=colors[place],
            faces=faces[own[place]],
            normals=None if normals is None else normals[own[place]],
        )
        for place, word in zip(used, words, strict=True)
    ]


def shape_of(
    points: NDArray[np.float32], part: SurfacePart
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the vertices of a part alone, (n, 3), and its faces as indices of these, (m, 3).

    Programs that take parts for separate meshes copy all vertices that a part can see.
    """
    return kernels.take_vertices(points, part.faces)


def face_colors(mesh: Mesh) -> NDArray[np.uint8]:
    """Return the colour of each face, (m, 3) uint8."""
    # -1 is the last colour
    table = np.concatenate([mesh.colors.reshape(-1, 3), np.array([NO_COLOR], np.uint8)])
    return table[mesh.surfaces]


_BLOCK = 1 << 15
"""Lines that are made at a time, few enough for their text to stay in the cache."""


def write_points(
    file: BinaryIO, points: NDArray[Any], before: bytes = b"", after: bytes = b"\n"
) -> None:
    """Write points, (n, 3), as lines of text.

    Each float32 is the shortest number that reads back as the same, each float64 has 15 digits.
    """
    _write(file, (points,), kernels.put_points, (), before, after)


def write_faces(
    file: BinaryIO,
    faces: NDArray[np.int32],
    first: int = 0,
    before: bytes = b"",
    after: bytes = b"\n",
    normals: NDArray[np.int32] | None = None,
) -> None:
    """Write faces, (m, 3), as lines of text; the first vertex has the number `first`.

    With normals, (m, 3), each corner is vertex//normal, and the first normal has the number
    `first`, too.
    """
    if normals is None:
        _write(file, (faces,), kernels.put_faces, (first,), before, after)
    else:
        _write(file, (faces, normals), kernels.put_corners, (first,), before, after)


def _write(
    file: BinaryIO,
    arrays: tuple[NDArray[Any], ...],
    put: Callable[..., int],
    extra: tuple[Any, ...],
    before: bytes,
    after: bytes,
) -> None:
    """Write rows of arrays as lines, by a kernel that puts the text of rows into a buffer."""
    arrays = tuple(np.ascontiguousarray(rows) for rows in arrays)
    count = len(arrays[0])
    # the bytes of a number hold a float64, or two int32 with the text between them
    size = 3 * kernels.NUMBER_BYTES + 2 + len(before) + len(after)
    out = np.empty(min(_BLOCK, count) * size, np.uint8)
    texts = [np.frombuffer(text, np.uint8) for text in (before, after)]
    for begin in range(0, count, _BLOCK):
        end = put(out, *(rows[begin : begin + _BLOCK] for rows in arrays), *extra, *texts)
        file.write(out[:end].data)


def plain_names(names: Iterable[str], allowed: Callable[[str], bool], other: str) -> list[str]:
    """Return different names of allowed characters only, as close to `names` as possible.

    Letters lose accents that are not allowed, and runs of other characters become one `_`. A name
    of which nothing is left becomes `other`, and equal names are numbered.
    """
    taken: set[str] = set()
    found = []
    for name in names:
        plain = _plain_name(name, allowed)
        unique = plain = plain if plain.strip("_") else other
        count = 1
        while unique in taken:
            count += 1
            unique = f"{plain}_{count}"
        taken.add(unique)
        found.append(unique)
    return found


def _plain_name(name: str, allowed: Callable[[str], bool]) -> str:
    """Return a name of allowed characters only, not empty where `name` is not."""
    letters: list[str] = []
    replaced = False
    for character in name:
        bare = character
        if not allowed(character):
            bare = unicodedata.normalize("NFKD", character)[:1]
        known = allowed(bare)
        if known or not replaced:
            letters.append(bare if known else "_")
        replaced = not known
    return "".join(letters)


def lines_of(descr: str) -> Iterator[str]:
    """Yield the lines of a description, of printable characters only."""
    for line in descr.splitlines():
        yield "".join(letter if letter.isprintable() else "\ufffd" for letter in line).rstrip()


def encodable_text(text: str) -> str:
    """Return a text without halves of characters, which JSON may hold and UTF-8 may not."""
    return "".join("\ufffd" if "\ud800" <= letter <= "\udfff" else letter for letter in text)


def origin_of(mesh: Mesh | HeightGrid) -> str:
    """Return the world position of the local zero, each number the shortest that reads back."""
    return " ".join(repr(number).removesuffix(".0") for number in mesh.origin.tolist())


def color_text(color: tuple[int, int, int]) -> str:
    """Return a colour as three numbers from 0 to 1.

    Numbers are rounded up, so that a reader finds the same byte again by rounding or cutting.
    """
    return " ".join(f"{math.ceil(shade / 255 * 1e4) / 1e4:g}" for shade in color)


def linear_color(color: tuple[int, int, int]) -> tuple[float, float, float]:
    """Return a colour in linear light, 0 to 1, after IEC 61966-2-1 (sRGB)."""
    red, green, blue = (
        shade / 255 / 12.92 if shade <= 10 else ((shade / 255 + 0.055) / 1.055) ** 2.4
        for shade in color
    )
    return red, green, blue


def overview(points: NDArray[np.float32]) -> tuple[str, str]:
    """Return the position of a camera that sees all points, and its turn about x, in radians.

    The camera is in the south and above. Cameras of VRML and X3D look along -z, which is down here.
    """
    low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    # the field of view of cameras is an eighth of a circle
    distance = 0.5 / math.sin(math.pi / 8) * float(np.linalg.norm(high - low))
    tilt = math.pi / 3
    x, y, z = ((low + high) / 2).tolist()
    place = (x, y - distance * math.sin(tilt), z + distance * math.cos(tilt))
    return " ".join(f"{number:.9g}" for number in place), f"{tilt:.6g}"
