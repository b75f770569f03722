"""Meshes from files of all formats: what is read is what was written, or a sentence."""

from __future__ import annotations

import base64
import json
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.errors import ReadError, RequestError, TerratoolError
from terratool.importing import meshes, types
from terratool.importing.meshes import READERS, read_triangles
from terratool.importing.sources import open_source
from terratool.importing.types import SampledHeights, SourceOptions, Triangles
from terratool.mesh.export import write_mesh
from terratool.text import packing
from tests.budget import examples
from tests.conftest import terrain_of
from tests.meshes import exported
from tests.programs import program
from tests.viewers import oblong

POINTS = [(0, 0, 1), (6, 0, 2), (6, 3, 4.25), (0, 3, 0.5), (2, 1, 5)]
FACES = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
"""An oblong tent without any symmetry, z up, in numbers that float32 holds."""

Corner = tuple[float, ...]


def as_set(vertices: Any, faces: Any, digits: int = 9) -> list[tuple[Corner, ...]]:
    """Triangles in an order of their own, each from its least corner on, as it is wound."""
    out = []
    for face in np.asarray(vertices, np.float64)[np.asarray(faces)].round(digits) + 0.0:
        corners = [tuple(corner) for corner in face.tolist()]
        least = corners.index(min(corners))
        out.append(tuple(corners[least:] + corners[:least]))
    return sorted(out)


def same(triangles: Triangles, points: Any = POINTS, faces: Any = FACES) -> bool:
    assert triangles.vertices.dtype == np.float64
    assert triangles.faces.dtype == np.int32
    return as_set(triangles.vertices, triangles.faces) == as_set(points, faces)


def y_up(points: Any) -> list[Corner]:
    """The same place where y is up, and z points south."""
    return [(x, z, -y) for x, y, z in points]


# -- files, written by hand ---------------------------------------------------------------------


def obj_lines(points: Any = POINTS) -> list[str]:
    return ["v {} {} {}".format(*point) for point in points]


def put_obj(path: Path) -> None:
    faces = ["f {} {} {}".format(*(n + 1 for n in face)) for face in FACES]
    path.write_text("\n".join(["# tent", *obj_lines(), *faces]) + "\n")


def put_obj_with_all(path: Path) -> None:
    """Groups, materials, textures, normals, continued lines, and Windows' ends of lines."""
    lines = ["mtllib none.mtl", "o tent", *obj_lines(), "vt 0 0", "vt 1 0", "vn 0 0 1", "g south"]
    lines += ["usemtl red", "f 1/1/1 2/2/1 5/1/1", "f 2/1/1 \\", "3/2/1 5/1/1", "g north"]
    lines += ["usemtl blue", "s off", "f 3/1/1 4/1/1 5/1/1", "l 1 2", "f 4/1/1 1/1/1 5/2/1"]
    path.write_bytes("\r\n".join(lines).encode() + b"\r\n")


def put_obj_counted_back(path: Path) -> None:
    """Negative numbers count back from where they stand, and not from the end of the file."""
    lines = [*obj_lines(POINTS[:2]), "v 2 1 5", "vt 0 0", "f -3/-1 -2/-1 -1/-1"]
    lines += [*obj_lines(POINTS[2:]), "f 2/1 4/1 3/1", "f -3 -2 -1", "f -2//  1 -1"]
    path.write_text("\n".join(lines).replace("//", "") + "\n")


def put_stl(path: Path) -> None:
    rows = [
        struct.pack("<12fH", 0, 0, 0, *(x for n in face for x in POINTS[n]), 0) for face in FACES
    ]
    path.write_bytes(b"tent".ljust(80) + struct.pack("<I", len(FACES)) + b"".join(rows))


def put_stl_text(path: Path) -> None:
    lines = ["solid tent"]
    for face in FACES:
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += ["vertex {} {} {}".format(*POINTS[n]) for n in face]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid tent", ""]))


def put_ply(path: Path, kind: str = "ascii", real: str = "float") -> None:
    header = ["ply", f"format {kind} 1.0", "comment tent", f"element vertex {len(POINTS)}"]
    header += [f"property {real} {axis}" for axis in "xyz"] + [f"element face {len(FACES)}"]
    header += ["property list uchar int vertex_indices", "end_header", ""]
    if kind == "ascii":
        body = "\n".join(" ".join(map(str, row)) for row in POINTS + [(3, *f) for f in FACES])
        path.write_text("\n".join(header) + body + "\n")
        return
    order = "<" if "little" in kind else ">"
    number = "d" if real == "double" else "f"
    blob = b"".join(struct.pack(f"{order}3{number}", *point) for point in POINTS)
    blob += b"".join(struct.pack(f"{order}B3i", 3, *face) for face in FACES)
    path.write_bytes("\n".join(header).encode() + blob)


def put_off(path: Path) -> None:
    rows = [" ".join(map(str, row)) for row in POINTS + [(3, *face) for face in FACES]]
    path.write_text("\n".join(["OFF", "# tent", f"{len(POINTS)} {len(FACES)} 0", *rows]) + "\n")


def gltf_of(points: Any, faces: Any, uri: bool, **node: Any) -> tuple[dict[str, Any], bytes]:
    """A header and its buffer."""
    flat = [x for point in points for x in point]
    corners = [n for face in faces for n in face]
    blob = struct.pack(f"<{len(flat)}f", *flat) + struct.pack(f"<{len(corners)}I", *corners)
    buffer: dict[str, Any] = {"byteLength": len(blob)}
    if uri:
        words = base64.b64encode(blob).decode()
        buffer["uri"] = f"data:application/octet-stream;base64,{words}"
    header = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **node}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [buffer],
        "bufferViews": [
            {"buffer": 0, "byteLength": 4 * len(flat)},
            {"buffer": 0, "byteOffset": 4 * len(flat), "byteLength": 4 * len(corners)},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": len(corners), "type": "SCALAR"},
        ],
    }
    return header, blob


def put_gltf(path: Path, **change: Any) -> None:
    header, _ = gltf_of(y_up(POINTS), FACES, uri=True)
    path.write_text(json.dumps(header | change))


def glb_bytes(header: dict[str, Any], blob: bytes) -> bytes:
    text = json.dumps(header).encode()
    text, blob = text.ljust(-(-len(text) // 4) * 4), blob.ljust(-(-len(blob) // 4) * 4, b"\0")
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def put_glb(path: Path) -> None:
    path.write_bytes(glb_bytes(*gltf_of(y_up(POINTS), FACES, uri=False)))


def put_glb_moved(path: Path) -> None:
    """Half as large, turned by 90° about the vertical and moved in its node, which undo that."""
    #      a turn of +90° about y takes (x, y, z) to (z, y, -x)
    before = [((-(z - 3)) * 2, (y - 1) * 2, (x - 8) * 2) for x, y, z in y_up(POINTS)]
    half = 0.5**0.5
    header, blob = gltf_of(
        before, FACES, uri=False,
        translation=[8, 1, 3], rotation=[0, half, 0, half], scale=[0.5, 0.5, 0.5],
    )  # fmt: skip
    path.write_bytes(glb_bytes(header, blob))


CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"


def put_3mf(path: Path, unit: str = 'unit="inch"', factor: float = 0.0254) -> None:
    """A part of an assembly, moved twice."""
    points = [(x / factor - 10, y / factor - 7, z / factor + 5) for x, y, z in POINTS]
    vertices = "".join('<vertex x="{!r}" y="{!r}" z="{!r}"/>'.format(*point) for point in points)
    faces = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*face) for face in FACES)
    model = f"""<?xml version="1.0" encoding="UTF-8"?>
<model {unit} xml:lang="en-US" xmlns="{CORE}"><resources>
<object id="1" type="model"><mesh><vertices>{vertices}</vertices>
<triangles>{faces}</triangles></mesh></object>
<object id="2" type="model"><components>
<component objectid="1" transform="1 0 0 0 1 0 0 0 1 10 0 0"/></components></object>
</resources><build><item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 7 -5"/></build></model>"""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", model)


def put_dxf(path: Path, kind: str = "3DFACE", inserted: bool = False) -> None:
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")
    from ezdxf.render import MeshBuilder

    drawing = ezdxf.new(units=6)
    space, points = drawing.modelspace(), POINTS
    if inserted:  # turned by 90° and twice as large in one block, moved in another
        inner, outer = drawing.blocks.new("INNER"), drawing.blocks.new("OUTER")
        outer.add_blockref(
            "INNER", (3, 4, 5), {"rotation": 90, "xscale": 2, "yscale": 2, "zscale": 2}
        )
        space.add_blockref("OUTER", (10, -1, 0))
        points = [((y - 3) / 2, -(x - 13) / 2, (z - 5) / 2) for x, y, z in POINTS]
        space.add_line((0, 0), (99, 99))
        space = inner
    if kind == "3DFACE":
        for face in FACES:
            space.add_3dface([points[n] for n in face])
    else:
        builder = MeshBuilder()
        builder.add_mesh(vertices=points, faces=FACES)
        (builder.render_mesh if kind == "MESH" else builder.render_polyface)(space)
    drawing.saveas(path)


def dae(geometry: str, nodes: str, asset: str = "", points: Any = POINTS, more: str = "") -> str:
    """A COLLADA file with the tent's points, whose w is no coordinate."""
    numbers = " ".join("{} 9 {} {}".format(*point) for point in points)
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{asset}</asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="{4 * len(points) + 1}">7 {numbers}</float_array>
<technique_common><accessor source="#a" count="{len(points)}" stride="4" offset="1">
<param name="X" type="float"/><param type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
{geometry}</mesh></geometry></library_geometries>{more}
<library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


PART = '<instance_geometry url="#g"/>'


def corners_of(kind: str) -> str:
    """The faces of the tent as an element, whose corners have a second index each."""
    inputs = '<input semantic="VERTEX" source="#v" offset="1"/>'
    inputs += '<input semantic="NORMAL" source="#none" offset="0"/>'
    lists = [" ".join(f"8 {n}" for n in face) for face in FACES]
    if kind == "trifans":
        lists = [" ".join(f"8 {n}" for n in (4, 0, 1, 2, 3, 0))]
    elif kind == "tristrips":
        lists = ["8 0 8 1 8 4 8 2", "8 2 8 3 8 4 8 0"]
    elif kind != "polygons":
        lists = [" ".join(lists)]
    body = "".join(f"<p>{numbers}</p>" for numbers in lists)
    if kind == "polylist":
        body = f"<vcount>3 3 3 3</vcount>{body}"
    return f'<{kind} count="4">{inputs}{body}</{kind}>'


def put_dae(path: Path, kind: str = "triangles") -> None:
    path.write_text(dae(corners_of(kind), f"<node>{PART}</node>", points=y_up(POINTS)))


PUT: list[tuple[str, Callable[[Path], None]]] = [
    (".obj", put_obj),
    (".obj", put_obj_with_all),
    (".obj", put_obj_counted_back),
    (".stl", put_stl),
    (".stl", put_stl_text),
    (".ply", put_ply),
    (".ply", partial(put_ply, kind="binary_little_endian")),
    (".ply", partial(put_ply, kind="binary_big_endian", real="double")),
    (".off", put_off),
    (".gltf", put_gltf),
    (".glb", put_glb),
    (".glb", put_glb_moved),
    (".3mf", put_3mf),
    (".3mf", partial(put_3mf, unit="", factor=0.001)),
    (".3mf", partial(put_3mf, unit='unit="meter"', factor=1.0)),
    *(
        (".dae", partial(put_dae, kind=kind))
        for kind in ("triangles", "polylist", "polygons", "trifans", "tristrips")
    ),
    (".dxf", put_dxf),
    (".dxf", partial(put_dxf, kind="MESH")),
    (".dxf", partial(put_dxf, kind="POLYLINE")),
    (".dxf", partial(put_dxf, inserted=True)),
    (".dxf", partial(put_dxf, kind="MESH", inserted=True)),
    (".dxf", partial(put_dxf, kind="POLYLINE", inserted=True)),
]
FIRST = dict(reversed(PUT))


@pytest.mark.parametrize(("suffix", "put"), PUT)
def test_what_was_written_is_read(
    suffix: str, put: Callable[[Path], None], tmp_path: Path, capfd: Any
) -> None:
    path = tmp_path / f"tent{suffix}"
    put(path)
    assert same(read_triangles(path))
    assert same(read_triangles(path, scale=0.5), np.multiply(POINTS, 0.5))
    assert same(read_triangles(str(path), up="y"), _tipped(path))
    assert capfd.readouterr() == ("", "")


def _tipped(path: Path) -> Any:
    """What comes of the tent when y is taken to be up."""
    if READERS[path.suffix].up == "y":
        return POINTS
    return [(x, -z, y) for x, y, z in POINTS]


def test_the_suffix_may_be_in_capitals(tmp_path: Path) -> None:
    put_stl(tmp_path / "TENT.STL")
    assert same(read_triangles(tmp_path / "TENT.STL"))


def test_a_y_up_format_can_be_said_to_have_z_up(tmp_path: Path) -> None:
    put_glb(tmp_path / "tent.glb")
    assert same(read_triangles(tmp_path / "tent.glb", up="z"), y_up(POINTS))


def test_notes_say_which_way_is_up_and_what_the_unit_was(tmp_path: Path) -> None:
    for suffix, put in PUT[:9]:
        put(tmp_path / f"tent{suffix}")
        assert read_triangles(tmp_path / f"tent{suffix}").notes == ()
    put_glb(tmp_path / "tent.glb")
    (note,) = read_triangles(tmp_path / "tent.glb").notes
    assert note == "The file has y up: x stays east, and its z points south."
    put_3mf(tmp_path / "tent.3mf")
    (note,) = read_triangles(tmp_path / "tent.3mf").notes
    assert note == "The file is in inches; metres were made of them."


def heights_of(path: Path, resolution: float, **options: Any) -> SampledHeights:
    """The heights of a mesh in a file."""
    with open_source(str(path), SourceOptions(resolution=resolution, **options)) as samples:
        assert isinstance(samples, SampledHeights)
        return samples


def test_heights_of_a_file(tmp_path: Path) -> None:
    """From bytes to pixels: the south-west corner is low, the top stands in the south-west."""
    put_stl(tmp_path / "tent.stl")
    samples = heights_of(tmp_path / "tent.stl", 0.5)
    assert samples.values.shape == (6, 12)
    assert samples.grid.bounds == (0, 0, 6, 3)
    # 0.75, 0.25 lies in the triangle of (0, 0, 1), (6, 0, 2) and (2, 1, 5)
    assert samples.values[0, 1] == pytest.approx(1 + 0.75 / 6 + 0.25 * (5 - 1 - 2 / 6), rel=1e-12)
    # 2.25, 1.25 in that of (6, 3, 4.25), (0, 3, 0.5) and (2, 1, 5)
    assert samples.values[2, 4] == pytest.approx(5 + 0.25 * 3.75 / 6 - 0.25 * 3.25 / 2, rel=1e-12)
    # 2.75, 1.25 in that of (6, 0, 2), (6, 3, 4.25) and (2, 1, 5), which has the highest centre
    assert samples.values[2, 5] == pytest.approx(5 - 0.75 * 2.25 / 4 + 0.25 * 0.75, rel=1e-12)
    assert samples.values[2, 5] == samples.values.max()


def test_bounds_and_scale_go_together(tmp_path: Path) -> None:
    put_stl(tmp_path / "tent.stl")
    whole = heights_of(tmp_path / "tent.stl", 0.5)
    part = heights_of(tmp_path / "tent.stl", 5.0, scale=10, bounds=(20.0, 10.0, 60.0, 25.0))
    np.testing.assert_allclose(part.values, 10 * whole.values[2:5, 4:], rtol=1e-12)


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".ply", ".glb"])
def test_meshes_of_ours_come_back(suffix: str, tmp_path: Path) -> None:
    mesh = oblong()
    (path, *_) = write_mesh(mesh, tmp_path / f"mesh{suffix}")
    read = read_triangles(path)
    assert as_set(read.vertices, read.faces, 5) == as_set(mesh.vertices, mesh.faces, 5)


@pytest.mark.parametrize(
    ("kind", "suffix"),
    [("obj", ".obj"), ("stl", ".stl"), ("stlb", ".stl"), ("ply", ".ply"), ("plyb", ".ply"),
     ("gltf2", ".gltf"), ("glb2", ".glb"), ("3mf", ".3mf"), ("collada", ".dae")],
)  # fmt: skip
def test_meshes_of_others_are_read(kind: str, suffix: str, tmp_path: Path) -> None:
    """Assimp writes the tent; it leaves the axes of a file as they are, and says no unit."""
    put_obj(tmp_path / "in.obj")
    command = [
        program("assimp"),
        "export",
        str(tmp_path / "in.obj"),
        str(tmp_path / f"out{suffix}"),
    ]
    subprocess.run([*command, f"-f{kind}"], check=True, capture_output=True)
    scale = 1000.0 if kind == "3mf" else 1.0
    assert same(read_triangles(tmp_path / f"out{suffix}", up="z", scale=scale))


def test_vrml_of_ours_comes_back(tmp_path: Path) -> None:
    mesh = oblong()
    (path, *_) = write_mesh(mesh, tmp_path / "mesh.wrl")
    read = read_triangles(path)
    assert as_set(read.vertices, read.faces, 5) == as_set(mesh.vertices, mesh.faces, 5)


@pytest.mark.parametrize("suffix", [".wrl", ".wrz"])
def test_vrml_has_y_up(suffix: str, tmp_path: Path) -> None:
    points = ", ".join(" ".join(map(str, point)) for point in y_up(POINTS))
    faces = " ".join(f"{a} {b} {c} -1" for a, b, c in FACES)
    (tmp_path / f"tent{suffix}").write_text(
        f"#VRML V2.0 utf8\nShape {{ geometry IndexedFaceSet {{ solid FALSE\n"
        f"coord Coordinate {{ point [{points}] }} coordIndex [{faces}] }} }}\n"
    )
    assert same(read_triangles(tmp_path / f"tent{suffix}"))


def test_a_terrain_comes_back_as_heights(tmp_path: Path) -> None:
    """Export, import: the heights are those of the field, but for pixels beside a wall."""
    terrain = terrain_of(
        {
            "size": [12, 8],
            "elemTypes": {
                "slope": {"x": [0, 1]}, "kerb": {"x": [[0, 0], [0.4, 0], [0.4, 1], [1, 1]]},
            },
            "elemTree": {
                "type": "slope", "vScale": 0.75, "cells": [6, 4],
                "children": [{"cellX": 3, "cellY": 0, "span": [3, 4], "type": "kerb", "vScale": 2}],
            },
        }
    )  # fmt: skip

    for solid in (False, True):
        exported(terrain, tmp_path / "yard.stl", solid=solid, overwrite=True)
        samples = heights_of(tmp_path / "yard.stl", 0.25)
        x, y = np.meshgrid(0.125 + 0.25 * np.arange(48), 0.125 + 0.25 * np.arange(32))
        np.testing.assert_allclose(samples.values, terrain.height(x, y), rtol=0, atol=1e-5)
        assert [note for note in samples.notes if "overhang" in note] == []
        from terratool.importing.sampling import steps

        xs, ys = steps(read_triangles(tmp_path / "yard.stl"), (0.0, 0.0, 12.0, 8.0))
        np.testing.assert_allclose(xs, [8.4], atol=1e-5)
        assert len(ys) == 0


# -- special contents ---------------------------------------------------------------------------


def test_polygons_become_triangles(tmp_path: Path) -> None:
    """Quads and a pentagon; the outline is kept whichever way they are cut."""
    outline = [(0, 0, 1), (4, 0, 1), (4, 2, 1), (3, 3, 1), (0, 3, 1)]
    lines = [*obj_lines(outline), "v 6 0 1", "v 6 2 1", "f 1 2 3 4 5", "f 2 6 7 3"]
    (tmp_path / "floor.obj").write_text("\n".join(lines))
    samples = heights_of(tmp_path / "floor.obj", 0.5)
    assert (samples.values[:4] == 1).all()
    # the slanting side runs through centres
    bare = [[False] * 8 + [True] * 4, [False] * 7 + [True] * 5]
    assert np.isnan(samples.values[4:]).tolist() == bare


@pytest.mark.parametrize("extra", [False, True])
@pytest.mark.parametrize("turn", range(5))
def test_concave_faces_of_a_drawing_are_cut_well(extra: bool, turn: int, tmp_path: Path) -> None:
    """An arrow that points west, from any corner on, wound either way; not quite in one plane."""
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")
    drawing = ezdxf.new()
    arrow = [(0.1, 2.0, 0.5), (8.1, 0.0, 0.7), (4.1, 2.0, 0.5), (8.1, 4.0, 0.5)]
    if extra:  # a fifth corner in the middle of a side
        arrow.insert(1, (4.1, 1.0, 0.6))
    with drawing.modelspace().add_mesh().edit_data() as data:
        data.vertices = arrow
        face = np.roll(range(len(arrow)), turn).tolist()
        data.faces = [tuple(face if turn % 2 else face[::-1])]
    drawing.saveas(tmp_path / "arrow.dxf")
    triangles = read_triangles(tmp_path / "arrow.dxf")
    assert set(map(tuple, triangles.vertices.tolist())) == set(arrow)
    values = heights_of(tmp_path / "arrow.dxf", 0.5).values
    assert np.isnan(values[3:5, 9:]).all()
    assert not np.isnan(values[3:5, 2:9]).any()


def test_a_drawing_says_what_is_left_out_and_its_unit(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")
    drawing = ezdxf.new(units=4)
    space = drawing.modelspace()
    space.add_3dface([(0, 0, 0), (3000, 0, 0), (3000, 2000, 0), (0, 2000, 500)])
    space.add_line((0, 0), (1, 1))
    space.add_line((0, 0), (1, 2))
    space.add_circle((0, 0), 1)
    drawing.saveas(tmp_path / "site.dxf")
    triangles = read_triangles(tmp_path / "site.dxf", scale=0.001)
    assert len(triangles.faces) == 2
    np.testing.assert_allclose(triangles.vertices.max(axis=0), [3, 2, 0.5])
    assert triangles.notes == (
        "The drawing also has entities without faces, which were left out: 1 CIRCLE, 2 LINE.",
        "The drawing says that its unit is the millimetre; coordinates are taken as they are, "
        "a scale of 0.001 makes metres of them.",
    )


def test_a_polygon_mesh_and_rows_of_blocks(tmp_path: Path) -> None:
    """A grid of 3 × 2 vertices, inserted in 2 rows and 3 columns."""
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")
    drawing = ezdxf.new()
    block = drawing.blocks.new("TILE")
    grid = block.add_polymesh((3, 2))
    for i in range(3):
        for k in range(2):
            grid.set_mesh_vertex((i, k), (i, k, i + 10 * k))
    drawing.modelspace().add_blockref(
        "TILE",
        (100, 50),
        {"row_count": 2, "row_spacing": 4, "column_count": 3, "column_spacing": 5},
    )
    drawing.saveas(tmp_path / "tiles.dxf")
    triangles = read_triangles(tmp_path / "tiles.dxf")
    assert len(triangles.faces) == 6 * 4
    samples = heights_of(tmp_path / "tiles.dxf", 1.0)
    assert samples.grid.bounds == (100, 50, 112, 55)
    assert (~np.isnan(samples.values)).sum() == 6 * 2
    np.testing.assert_allclose(samples.values[0, 5:7], [5.5, 6.5])


def test_a_block_that_holds_itself_is_refused(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")
    drawing = ezdxf.new()
    block = drawing.blocks.new("SELF")
    block.add_3dface([(0, 0, 0), (1, 0, 0), (1, 1, 0)])
    block.add_blockref("SELF", (1, 0))
    drawing.modelspace().add_blockref("SELF", (0, 0))
    drawing.saveas(tmp_path / "self.dxf")
    refused(tmp_path / "self.dxf")


@pytest.mark.nightly
def test_blocks_that_multiply_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")
    monkeypatch.setattr(meshes, "MAX_ENTITIES", 1000)
    drawing = ezdxf.new()
    drawing.blocks.new("B0").add_3dface([(0, 0, 0), (1, 0, 0), (1, 1, 0)])
    for level in range(1, 6):
        block = drawing.blocks.new(f"B{level}")
        for n in range(10):
            block.add_blockref(f"B{level - 1}", (n, 0))
    drawing.modelspace().add_blockref("B5", (0, 0))
    path = tmp_path / "bomb.dxf"
    drawing.saveas(path)
    assert f"more than {1000 + path.stat().st_size:,} entities" in refused(path).message


@pytest.mark.nightly
def test_a_block_in_a_huge_grid_is_refused(tmp_path: Path) -> None:
    """A few bytes that claim 2^31 columns; what is asked for in reason is read."""
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")
    drawing = ezdxf.new()
    drawing.blocks.new("B").add_3dface([(0, 0, 0), (1, 0, 0), (1, 1, 0)])
    insert = drawing.modelspace().add_blockref("B", (0, 0))
    insert.grid((3, 20), (2, 2))
    drawing.saveas(tmp_path / "grid.dxf")
    assert len(read_triangles(tmp_path / "grid.dxf").faces) == 60
    insert.grid((2**15 - 1, 2**15 - 1), (2, 2))
    path = tmp_path / "huge.dxf"
    drawing.saveas(path)
    most = meshes.MAX_ENTITIES + path.stat().st_size
    assert f"more than {most:,} entities" in refused(path).message


def test_parts_of_a_scene_stand_as_often_as_they_are_placed(tmp_path: Path) -> None:
    box = trimesh.creation.box((1, 2, 3))
    scene = trimesh.Scene()
    for n in range(3):
        matrix = np.eye(4)
        matrix[:3, 3] = 10 * n, n, 0
        scene.add_geometry(box, geom_name="box", transform=matrix)
    scene.export(tmp_path / "boxes.glb")
    triangles = read_triangles(tmp_path / "boxes.glb", up="z")
    assert len(triangles.faces) == 36
    np.testing.assert_allclose(triangles.vertices.min(axis=0), [-0.5, -1, -1.5])
    np.testing.assert_allclose(triangles.vertices.max(axis=0), [20.5, 3, 1.5])


ONE = (
    '<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>'
    '<vertex x="0" y="2" z="4"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles>'
    "</mesh>"
)


def put_assembly(path: Path, items: str, objects: dict[str, str], **others: str) -> None:
    """A 3MF in metres with objects by number, and more files."""
    space = f'xmlns="{CORE}" xmlns:p="{CORE.replace("core/2015/02", "production/2015/06")}"'
    inner = "".join(f'<object id="{key}">{text}</object>' for key, text in objects.items())
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in others.items():
            more = f'<object id="1">{text}</object>'
            archive.writestr(
                f"3D/{name}.model", f"<model {space}><resources>{more}</resources><build/></model>"
            )
        archive.writestr(
            "3D/3dmodel.model",
            f'<model unit="meter" {space}><resources>{inner}</resources><build>{items}</build>'
            "</model>",
        )


def rows(count: int, key: int, step: str) -> str:
    """Components one after the other along an axis."""
    parts = [
        f'<component objectid="{key}" transform="1 0 0 0 1 0 0 0 1 {step.format(n)}"/>'
        for n in range(count)
    ]
    return f"<components>{''.join(parts)}</components>"


def test_a_3mf_of_rows_of_rows(tmp_path: Path) -> None:
    """40 × 30 triangles in two levels, the whole turned by 90°: x becomes y, y becomes -x."""
    put_assembly(
        tmp_path / "rows.3mf",
        '<item objectid="3" transform="0 1 0 -1 0 0 0 0 1 100 200 0"/>',
        {"1": ONE, "2": rows(40, 1, "{}0 0 0"), "3": rows(30, 2, "0 {}0 0")},
    )
    triangles = read_triangles(tmp_path / "rows.3mf")
    wanted = [
        [(x, y, 0), (x, y + 1, 0), (x - 2, y, 4)]
        for x in range(100, 100 - 300, -10)
        for y in range(200, 200 + 400, 10)
    ]
    assert same(triangles, np.array(wanted).reshape(-1, 3), np.arange(3600).reshape(-1, 3))


def test_a_3mf_may_have_parts_in_files_of_their_own(tmp_path: Path) -> None:
    part = '<components><component p:path="/3D/part.model" objectid="1"/></components>'
    put_assembly(tmp_path / "a.3mf", '<item objectid="1"/>', {"1": part}, part=ONE)
    assert same(read_triangles(tmp_path / "a.3mf"), [(0, 0, 0), (1, 0, 0), (0, 2, 4)], [(0, 1, 2)])


@pytest.mark.parametrize(
    ("objects", "words"),
    [
        ({"9": '<components><component objectid="9"/></components>'}, "holds itself"),
        ({"1": rows(2, 9, "0 0 0"), "9": rows(2, 1, "0 0 0")}, "holds itself"),
        ({"1": ONE, "9": rows(1, 2, "0 0 0")}, "no object 2"),
        ({"9": ONE.replace('v3="2"', 'v3="3"')}, "vertex that is not there"),
        ({"9": ONE.replace('x="1"', 'x="one"')}, "cannot be read"),
        ({"9": ONE.replace("triangle ", "square ")}, "no faces"),
        ({"99": ONE} | {str(n): rows(2, n + 1, "0 0 0") for n in range(9, 99)}, "more than"),
    ],
)  # fmt: skip
def test_a_3mf_that_is_no_assembly_is_refused(
    objects: dict[str, str], words: str, tmp_path: Path
) -> None:
    put_assembly(tmp_path / "a.3mf", '<item objectid="9"/>', objects)
    assert words in refused(tmp_path / "a.3mf").message


def test_parts_that_are_no_triangles_are_counted(tmp_path: Path) -> None:
    header, blob = gltf_of(y_up(POINTS), FACES, uri=False)
    attributes = {"attributes": {"POSITION": 0}}
    header["meshes"][0]["primitives"] += [attributes | {"mode": mode} for mode in (0, 1, 1, 6)]
    (tmp_path / "tent.glb").write_bytes(glb_bytes(header, blob))
    triangles = read_triangles(tmp_path / "tent.glb")
    assert same(triangles)
    assert triangles.notes[0] == (
        "Parts of the file are no triangles and were left out: 2 of lines, 1 of points, "
        "1 of triangle fans."
    )


def test_large_coordinates_keep_their_last_digits(tmp_path: Path) -> None:
    points = [(431200.123456, 5768400.654321, 100.25), (431212.123456, 5768400.654321, 101.5),
              (431212.123456, 5768406.654321, 99.125)]  # fmt: skip
    (tmp_path / "utm.obj").write_text("\n".join([*obj_lines(points), "f 1 2 3"]))
    triangles = read_triangles(tmp_path / "utm.obj")
    assert sorted(map(tuple, triangles.vertices.tolist())) == sorted(points)


def test_faces_with_coordinates_that_are_no_numbers_are_dropped(tmp_path: Path) -> None:
    rows = [struct.pack("<12fH", 0, 0, 0, *(x for n in f for x in POINTS[n]), 0) for f in FACES]
    rows += [
        struct.pack("<12fH", 0, 0, 0, 0, 0, 0, 1, 0, bad, 0, 1, 0, 0)
        for bad in (np.nan, np.inf, -np.inf, 2e30)
    ]
    path = tmp_path / "tent.stl"
    path.write_bytes(bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows))
    triangles = read_triangles(path)
    assert same(triangles)
    assert np.isfinite(triangles.vertices).all()
    assert triangles.notes == (
        "4 of 8 faces have coordinates that are no numbers below 1e+30, and were left out.",
    )
    path.write_bytes(bytes(80) + struct.pack("<I", 4) + b"".join(rows[4:]))
    assert "no face has coordinates" in refused(path).message


# -- files that cannot be read ------------------------------------------------------------------


def refused(path: Path, **how: Any) -> ReadError:
    with pytest.raises(ReadError) as caught:
        read_triangles(path, **how)
    error = caught.value
    assert error.message.startswith(f"{path}: ")
    assert error.message.endswith(".")
    assert error.hint.endswith((".", '"'))
    assert "\n" not in str(error)
    return error


@pytest.mark.parametrize("suffix", FIRST)
def test_broken_files_are_refused(suffix: str, tmp_path: Path, capfd: Any) -> None:
    good, path = tmp_path / f"good{suffix}", tmp_path / f"bad{suffix}"
    FIRST[suffix](good)
    data = good.read_bytes()
    rng = np.random.default_rng(5)
    for bad in (
        b"", b"\0", b"\n", b"hello, world\n", b"{}", b"[]", data[:4], data[:24],
        data[: len(data) // 4], rng.bytes(3000), b"\xff\xfe" * 200, bytes(5000),
    ):  # fmt: skip
        path.write_bytes(bad)
        refused(path)
    if suffix not in (".obj",):  # whose lines have no end
        path.write_bytes(data[: len(data) - 25])
        refused(path)
    assert capfd.readouterr() == ("", "")


def test_what_is_cut_short_between_two_lines_is_refused(tmp_path: Path) -> None:
    """Where a format says how much there is to come, or how it ends."""
    for suffix, put, lines in (
        (".ply", put_ply, 1),
        (".off", put_off, 1),
        (".stl", put_stl_text, 3),
    ):
        path = tmp_path / f"tent{suffix}"
        put(path)
        whole = path.read_text().splitlines()
        path.write_text("\n".join(whole[:-lines]))
        assert "cut short" in str(refused(path))
    path.write_text("\n".join(whole + whole[:-lines]))
    assert "has 4 of 8 faces" in refused(path).message


@pytest.mark.parametrize("suffix", FIRST)
def test_the_wrong_suffix_is_refused(suffix: str, tmp_path: Path) -> None:
    for other, put in FIRST.items():
        if other != suffix:
            put(tmp_path / f"a{other}")
            (tmp_path / f"a{other}").rename(tmp_path / f"b{suffix}")
            refused(tmp_path / f"b{suffix}")


@pytest.mark.parametrize("suffix", FIRST)
def test_changed_bytes_end_in_triangles_or_in_a_sentence(suffix: str, tmp_path: Path) -> None:
    good, path = tmp_path / f"good{suffix}", tmp_path / f"bad{suffix}"
    FIRST[suffix](good)
    data = good.read_bytes()
    end = len(data) if suffix != ".dxf" else min(len(data), 3000)

    @settings(max_examples=examples(8 if suffix == ".dxf" else 100))
    @given(
        st.lists(st.tuples(st.integers(0, end - 1), st.integers(0, 255)), min_size=1, max_size=9)
    )
    def change(changes: list[tuple[int, int]]) -> None:
        bad = bytearray(data)
        for at, value in changes:
            bad[at] = value
        path.write_bytes(bad)
        try:
            triangles = read_triangles(path)
        except TerratoolError as error:
            assert error.message.startswith(str(path))
        else:
            assert np.isfinite(triangles.vertices[triangles.faces]).all()

    change()


def test_files_that_are_not_there(tmp_path: Path) -> None:
    assert "does not exist" in refused(tmp_path / "none.stl").message
    (tmp_path / "folder.obj").mkdir()
    assert "is a folder" in refused(tmp_path / "folder.obj").message
    assert ".xyz is no format of a mesh" in refused(tmp_path / "cloud.xyz").message
    assert "without a suffix" in refused(tmp_path / "cloud").message
    refused(tmp_path / "nul\0.stl")


@pytest.mark.parametrize(
    ("suffix", "text"),
    [
        (".ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                 "property float z\nend_header\n0 0 0\n1 0 0\n1 1 1\n"),
        (".obj", "v 0 0 0\nv 1 0 0\nv 1 1 1\n"),
        (".obj", "v 0 0 0\nv 1 0 0\nv 1 1 1\nl 1 2\nl 2 3\n"),
        (".off", "OFF\n3 0 0\n0 0 0\n1 0 0\n1 1 1\n"),
        (".stl", "solid none\nendsolid none\n"),
        (".gltf", '{"asset": {"version": "2.0"}, "scenes": [{"nodes": []}], "scene": 0}'),
    ],
)  # fmt: skip
def test_points_and_nothing_are_no_mesh(suffix: str, text: str, tmp_path: Path) -> None:
    (tmp_path / f"a{suffix}").write_text(text)
    refused(tmp_path / f"a{suffix}")


@pytest.mark.parametrize(
    ("suffix", "text"),
    [
        (".obj", "v 0 0 0\nv 1 0 0\nv 1 1 1\nf 1 2 4\n"),
        (".obj", "v 0 0 0\nv 1 0 0\nv 1 1 1\nf 1 2 3\nf 2 3"),
        (".obj", "v 0 0 0\nv 1 0 0\nv 1 1 1\nf 1/1 2\nf 1 2 3\n"),
        (".obj", "v 0 0 0\nv 1 0 0\nv 1 1 1\nf -1 -2 -4\n"),
        (".obj", "v 0 0 0\nv 1 0 0\nv 1 1 1\nf 0 1 2\n"),
        (".obj", "v 0 0 0\nv 1 0 0\nv 1 1 1\nf 1/1 2/2 0/3\n"),
        (".obj", "v 0 0 0\nv 1 zero 0\nv 1 1 1\nf 1 2 3\n"),
        (".off", "OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 1\n3 0 1 3\n"),
        (".off", "OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 1\n3 0 1 -1\n"),
        (".ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                 "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
                 "end_header\n0 0 0\n1 0 0\n1 1 1\n3 0 1 7\n"),
    ],
)  # fmt: skip
def test_faces_of_nothing_are_refused(suffix: str, text: str, tmp_path: Path) -> None:
    (tmp_path / f"a{suffix}").write_text(text)
    refused(tmp_path / f"a{suffix}")


@pytest.mark.parametrize(
    "change",
    [{"asset": {"version": "1.0"}}, {"asset": {}, "meshes": {"a": {"primitives": []}}}],
)
def test_gltf_1_is_called_so(change: dict[str, Any], tmp_path: Path) -> None:
    put_gltf(tmp_path / "tent.gltf", **change)
    assert "is glTF 1.0" in refused(tmp_path / "tent.gltf").message
    glb = struct.pack("<4s4I", b"glTF", 1, 24, 4, 0) + b"{}  "
    (tmp_path / "tent.glb").write_bytes(glb)
    assert "is glTF 1.0" in refused(tmp_path / "tent.glb").message


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "compressed by KHR_draco"),
        ({"accessors": [{"componentType": 5126, "count": 10**13, "type": "VEC3"}] * 2}, "asks for"),
        ({"accessors": [{"bufferView": 0, "componentType": 5126, "count": 10**13,
                         "type": "VEC3"}] * 2}, "cannot be read"),
        ({"bufferViews": [{"buffer": 0, "byteLength": 10**13}] * 2}, "cannot be read"),
        ({"accessors": [{"bufferView": 0, "componentType": 5122, "normalized": True, "count": 5,
                         "type": "VEC3"}] * 2}, "positions are packed"),
        ({"buffers": [{"uri": "none.bin", "byteLength": 108}]}, "cannot be read"),
    ],
)  # fmt: skip
def test_headers_that_ask_for_too_much_are_refused(
    change: dict[str, Any], words: str, tmp_path: Path
) -> None:
    put_gltf(tmp_path / "tent.gltf", **change)
    assert words in refused(tmp_path / "tent.gltf").message


def test_an_archive_that_would_fill_the_memory_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "bomb.3mf"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", bytes(299_000))
        archive.writestr("3D/part.xml", bytes(1000))  # which the other one may name
    monkeypatch.setattr(packing, "PLENTY", 300_000)
    assert "comes to more" not in refused(path).message
    monkeypatch.setattr(packing, "PLENTY", 299_999)
    assert "comes to more than 100 times its size" in refused(path).message


def test_a_long_comment_is_read_over(tmp_path: Path) -> None:
    put_3mf(tmp_path / "tent.3mf")
    with zipfile.ZipFile(tmp_path / "tent.3mf") as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(tmp_path / "long.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            long = b"<!--" + b"x" * 4_000_000 + b"-->"
            archive.writestr(name, data + long if name.endswith(".model") else data)
    found = read_triangles(tmp_path / "long.3mf")
    assert len(found.faces) == len(read_triangles(tmp_path / "tent.3mf").faces)


def test_instances_that_multiply_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_glb(tmp_path / "tent.glb")
    monkeypatch.setattr(types, "MAX_FACES", 3)
    assert "more than 3 faces" in refused(tmp_path / "tent.glb").message


def test_nothing_else_need_be_installed(tmp_path: Path) -> None:
    """What trimesh takes if it is there is not needed; and nothing heavy is loaded too early."""
    paths = []
    for suffix, put in FIRST.items():
        if suffix != ".dxf":
            paths.append(str(tmp_path / f"tent{suffix}"))
            put(tmp_path / f"tent{suffix}")
    code = f"""
import sys
for name in ("scipy", "networkx", "lxml", "PIL", "ezdxf", "jsonschema"):
    sys.modules[name] = None
import terratool.importing.sampling
import terratool.importing.sources
import terratool.importing.meshes
assert {{"trimesh", "rasterio"}}.isdisjoint(sys.modules)
for path in {paths!r}:
    print(len(terratool.importing.meshes.read_triangles(path).faces))
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.split() == [str(len(FACES))] * len(paths)
    assert done.stderr == ""


def test_a_package_that_is_missing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_dxf(tmp_path / "tent.dxf")
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    error = refused(tmp_path / "tent.dxf")
    assert "DXF needs ezdxf" in error.message
    assert error.hint == f'Run {sys.executable} -m pip install "terratool[import]"'


@pytest.mark.parametrize("how", [{"up": "x"}, {"up": "Z"}, {"scale": 0.0}, {"scale": -1.0},
                                 {"scale": float("nan")}, {"scale": float("inf")}])  # fmt: skip
def test_axes_and_scales_that_make_no_sense(how: dict[str, Any], tmp_path: Path) -> None:
    put_stl(tmp_path / "tent.stl")
    with pytest.raises(RequestError):
        read_triangles(tmp_path / "tent.stl", **how)


def test_a_wall_seen_from_above_is_nothing(tmp_path: Path) -> None:
    """Whoever forgets that y is up is told so."""
    lines = ["v 0 0 0", "v 4 0 0", "v 4 3 0", "v 0 3 0", "f 1 2 3", "f 1 3 4"]
    path = tmp_path / "floor.obj"
    path.write_text("\n".join(lines))
    with pytest.raises(ReadError, match="all faces are vertical") as caught:
        heights_of(path, 1.0, up="y")
    assert caught.value.message.startswith(f"{path}: ")
    assert (heights_of(path, 1.0).values == 0).all()


@pytest.mark.slow
def test_an_obj_need_not_be_utf_8(tmp_path: Path) -> None:
    """Comments and names in Latin-1, as old programs write them, and no package to guess it."""
    path = tmp_path / "cafe.obj"
    points = "".join(f"v {x} {y} {z}\n" for x, y, z in POINTS)
    faces = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FACES)
    path.write_bytes(f"# caf\u00e9\no gr\u00fcn\n{points}{faces}".encode("latin-1"))
    script = (
        "import sys\n"
        "sys.modules['charset_normalizer'] = sys.modules['chardet'] = None\n"
        "from terratool.importing.meshes import read_triangles\n"
        f"print(len(read_triangles({str(path)!r}).faces))\n"
    )
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert ran.stdout == f"{len(FACES)}\n"
    assert same(read_triangles(path))
