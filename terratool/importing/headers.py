"""What the headers of meshes ask for, looked at before a reader believes them."""

from __future__ import annotations

import json
import re
import struct
import zipfile
from pathlib import Path
from typing import Any

from terratool.errors import ReadError

MAX_UNPACKED = 2**32
"""An archive that unpacks to more bytes than these is refused."""

MAX_VALUES = 2**28
"""Values of glTF that the file does not hold, and that would have to be made up."""

_HEAD = 1 << 16
"""Bytes in which a header has to say how many faces there are."""

_JSON, _MAGIC = 0x4E4F534A, b"glTF"
_MODES = {0: "points", 1: "lines", 2: "lines", 3: "lines", 6: "triangle fans"}
_PACKED = ("EXT_meshopt_compression", "KHR_draco_mesh_compression")


def check_archive(path: Path) -> None:
    """Refuse an archive that would fill the memory.

    Raises:
        ReadError: it would unpack to more than 4 GiB.
        zipfile.BadZipFile: it is no archive.
    """
    with zipfile.ZipFile(path) as archive:
        size = sum(info.file_size for info in archive.infolist())
    if size > MAX_UNPACKED:
        raise ReadError(
            f"{path}: would unpack to {size:,} bytes.",
            f"At most {MAX_UNPACKED:,} are read; export a smaller part.",
        )


def check_gltf(path: Path) -> tuple[str, ...]:
    """Refuse a glTF or GLB that is compressed or makes up values; say what else is not read.

    Raises:
        ReadError: it is, or does.
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
            "Export it again.",
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
    """How many faces a PLY or OFF says that it has, or a text of STL begins; 0 for others."""
    kind = path.suffix.lower()
    with open(path, "rb") as file:
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
    with open(path, "rb") as file:
        if path.suffix.lower() == ".gltf":
            text = file.read()
        else:
            magic, _, _, length, kind = struct.unpack("<4s4I", _exactly(file.read(20), 20))
            if magic != _MAGIC or kind != _JSON:
                raise ValueError("it does not begin like a GLB")
            text = _exactly(file.read(length), length)
    header = json.loads(text)
    if not isinstance(header, dict):
        raise ValueError("its header is no object")
    return header


def _exactly(data: bytes, length: int) -> bytes:
    if len(data) != length:
        raise ValueError("it is cut short")
    return data
