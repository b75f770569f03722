"""X3D 3.3 as XML (ISO/IEC 19776-1)."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

from terratool.mesh.formats.common import (
    color_text,
    lines_of,
    origin_of,
    overview,
    points_of,
    shape_of,
    surface_parts,
    write_faces,
    write_points,
)
from terratool.mesh.types import Mesh
from terratool.report.documents import json_text

_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE X3D PUBLIC "ISO//Web3D//DTD X3D 3.3//EN" "http://www.web3d.org/specifications/x3d-3.3.dtd">
<X3D profile="Interchange" version="3.3">
  <head>
"""


def write_x3d(mesh: Mesh, path: Path, descr: str) -> None:
    """Write an X3D file: a Shape with an Appearance and an IndexedFaceSet per surface, z up.

    Nodes are named after the surfaces, in letters, digits and `_` of ASCII, as their names are XML
    ids; the true names stand in comments.
    """
    points = points_of(mesh)
    place, tilt = overview(points)
    about = {"description": " ".join(lines_of(descr)), "origin": origin_of(mesh), "up": "z"}
    with open(path, "wb") as file:
        file.write(_HEAD.encode())
        for key, text in about.items():
            if text:
                file.write(f'    <meta name="{key}" content={quoteattr(text)}/>\n'.encode())
        file.write(
            "  </head>\n"
            "  <Scene>\n"
            f'    <Viewpoint DEF="Overview" description="from the south" position="{place}" '
            f'orientation="1 0 0 {tilt}"/>\n'
            '    <Group DEF="Terrain">\n'.encode()
        )
        for part in surface_parts(mesh):
            word = part.word
            own, faces = shape_of(points, part)
            if part.surface >= 0:
                file.write(f"      <!-- surface {_comment(part.name)} -->\n".encode())
            file.write(
                f'      <Shape DEF="Shape_{word}">\n'
                f'        <Appearance DEF="Appearance_{word}">\n'
                f'          <Material DEF="Material_{word}" '
                f'diffuseColor="{color_text(part.color)}"/>\n'
                "        </Appearance>\n"
                f'        <IndexedFaceSet DEF="Faces_{word}" solid="false" coordIndex="\n'.encode()
            )
            write_faces(file, faces, 0, b"", b" -1\n")
            file.write(f'">\n          <Coordinate DEF="Points_{word}" point="\n'.encode())
            write_points(file, own)
            file.write(b'"/>\n        </IndexedFaceSet>\n      </Shape>\n')
        file.write(b"    </Group>\n  </Scene>\n</X3D>\n")


def _comment(text: str) -> str:
    """Return a text as a JSON string for a comment, which must not hold two hyphens in a row."""
    return json_text(text).replace("--", "-\\u002d")
