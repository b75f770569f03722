"""Meshes as files: what other programs read is the mesh, its sides, and its colours."""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.errors import RequestError, WriteError
from terratool.mesh.export import collapse_degenerate, write_mesh
from terratool.mesh.formats.common import (
    color_text,
    is_ascii_word,
    plain_names,
    write_faces,
    write_points,
)
from terratool.mesh.formats.table import FORMATS
from terratool.mesh.types import BuiltMesh, Mesh, PlanLoss
from terratool.report.documents import json_text
from tests.programs import lacking, program
from tests.viewers import (
    NASTY,
    READERS,
    Read,
    by_assimp,
    by_trimesh,
    mirrored,
    oblong,
    output,
    turned_inside_out,
    usd_parts,
)

PAIRS = [
    pytest.param(suffix, reader, id=f"{suffix[1:]}-{reader.__name__[3:]}")
    for suffix, readers in READERS.items()
    for reader in readers
]
DESCR = 'Yard "A" & <B> -- 3 \\ surfaces\nsecond line: Löß'


def written(mesh: Mesh, folder: Path, suffix: str, descr: str = DESCR) -> Path:
    """A mesh as a file; skips the test where its library is not installed."""
    if suffix in (".usda", ".usdc"):
        pytest.importorskip("pxr", reason="usd-core is not installed")
    return write_mesh(mesh, folder / f"t{suffix}", descr=descr)[0]


def test_every_format_is_read_by_somebody_else() -> None:
    """A format that is added to the table needs a reader here."""
    assert READERS.keys() == FORMATS.keys()


@pytest.mark.parametrize(("suffix", "reader"), PAIRS)
def test_others_read_the_mesh(suffix: str, reader: Callable[[Path], Read], tmp_path: Path) -> None:
    """The same triangles, with the same side outside, in the colours of their surfaces."""
    read = reader(written(oblong(), tmp_path, suffix))
    assert read.same(oblong())
    if FORMATS[suffix].surfaces and (suffix, reader) != (".ply", by_assimp):
        assert all(color for color, _ in read.triangles)


@pytest.mark.parametrize(("suffix", "reader"), PAIRS)
def test_a_mirrored_mesh_is_told_apart(
    suffix: str, reader: Callable[[Path], Read], tmp_path: Path
) -> None:
    """What passes the test above is neither mirrored along an axis nor inside out."""
    for wrong in (*(mirrored(oblong(), axis) for axis in range(3)), turned_inside_out(oblong())):
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        assert not reader(written(wrong, folder, suffix)).same(oblong())


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_coordinates_of_the_world(suffix: str, tmp_path: Path) -> None:
    """They are 64 bits long: what float32 keeps near 0 is kept far away."""
    pytest.importorskip("trimesh")
    mesh = oblong()
    path = write_mesh(mesh, tmp_path / f"t{suffix}", world=True)[0]
    assert b"500000.25" not in path.read_bytes()
    found = np.array([corners for _, corners in by_trimesh(path).triangles]).reshape(-1, 3)
    near = mesh.vertices[mesh.faces].reshape(-1, 3).astype(np.float32)
    found, wanted = (np.unique(p.round(6), axis=0) for p in (found, near + mesh.origin))
    assert np.abs(found - wanted).max() < 2e-9
    assert by_trimesh(path).same(replace(mesh, vertices=mesh.vertices + mesh.origin))


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".ply", ".glb"])
def test_all_digits_are_there(suffix: str, tmp_path: Path) -> None:
    """The numbers of a file are those of the mesh as float32, to the last bit."""
    pytest.importorskip("trimesh")
    found = [corners for _, corners in by_trimesh(written(oblong(), tmp_path, suffix)).triangles]
    mesh = oblong()
    wanted = mesh.vertices[mesh.faces].astype(np.float32)
    assert (
        np.unique(np.float32(found).reshape(-1, 3), axis=0).tolist()
        == np.unique(wanted.reshape(-1, 3), axis=0).tolist()
    )


@pytest.mark.parametrize("suffix", FORMATS)
def test_the_origin_is_said(suffix: str, tmp_path: Path) -> None:
    """Vertices are near 0; where that is in the world can be read from the file."""
    path = written(oblong(), tmp_path, suffix)
    if suffix == ".glb":
        assert gltf(path)["asset"]["extras"]["origin"] == [500000.25, 4649776.5, 812]
    elif suffix in (".usda", ".usdc"):
        from pxr import Usd

        stage = Usd.Stage.Open(str(path))
        data = stage.GetRootLayer().customLayerData
        assert tuple(data["terratool"]["origin"]) == (500000.25, 4649776.5, 812)
    else:
        assert b"500000.25 4649776.5 812" in path.read_bytes()


def gltf(path: Path) -> Any:
    """The JSON of a GLB."""
    data = path.read_bytes()
    return json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])


_VALIDATE = """
const fs = require('fs'), validator = require('gltf-validator');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])))
  .then(report => console.log(JSON.stringify(report)));
"""


def validated(path: Path) -> Any:
    """What Khronos' validator says of a GLB.

    Node finds the package where NODE_PATH says, or in the global folder of npm.
    """
    node = program("node")
    places = [os.environ.get("NODE_PATH", "")]
    if npm := shutil.which("npm"):
        command = [npm, "root", "--global"]
        places.append(subprocess.run(command, capture_output=True, text=True).stdout.strip())
    environment = {**os.environ, "NODE_PATH": os.pathsep.join(filter(None, places))}
    found = [node, "-e", "require.resolve('gltf-validator')"]
    if subprocess.run(found, env=environment, capture_output=True).returncode:
        lacking("gltf-validator")
    return json.loads(output(node, "-e", _VALIDATE, path, env=environment))


def test_glb_is_valid(tmp_path: Path) -> None:
    """Nothing to say for Khronos' validator: one primitive and material per surface."""
    report = validated(written(oblong(), tmp_path, ".glb"))
    assert report["issues"]["messages"] == []
    assert report["info"]["materialCount"] == 3
    assert report["info"]["totalTriangleCount"] == 12


def test_glb_is_y_up(tmp_path: Path) -> None:
    """North is -z, and names are what they were."""
    text = gltf(written(oblong(), tmp_path, ".glb"))
    assert [material["name"] for material in text["materials"]] == ["sand", NASTY, "none"]
    sand = text["accessors"][text["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    assert sand["min"] == pytest.approx([-3.25, -0.9739999, -1.75])
    assert sand["max"] == pytest.approx([-2, -0.2937496, 1.5])


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_usd_is_valid(suffix: str, tmp_path: Path) -> None:
    """Nothing to say for Pixar's validators, and the true names are there."""
    path = written(oblong(), tmp_path, suffix)
    pytest.importorskip("pxr.UsdValidation", reason="usd-core has no validators before 25.2")
    from pxr import Usd, UsdGeom, UsdValidation

    stage = Usd.Stage.Open(str(path))
    context = UsdValidation.ValidationContext(
        UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    )
    errors = [(error.GetName(), error.GetMessage()) for error in context.Validate(stage)]
    assert errors == []
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    names = {prim.GetDisplayName() for prim in stage.Traverse()} - {""}
    assert names == {"sand", NASTY}


def test_usd_collides_with_the_friction_of_its_surfaces(tmp_path: Path) -> None:
    """Each surface collides by its own triangles; what has no known friction has none."""
    path = written(oblong(), tmp_path, ".usda")
    from pxr import Usd, UsdGeom, UsdPhysics, UsdShade

    stage = Usd.Stage.Open(str(path))
    assert UsdPhysics.GetStageKilogramsPerUnit(stage) == 1
    assert not [prim for prim in stage.Traverse() if prim.IsA(UsdPhysics.Scene)]
    found = {}
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh):
            continue
        assert prim.HasAPI(UsdPhysics.CollisionAPI)
        assert UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get() == "none"
        points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get())
        ends = np.array(UsdGeom.Mesh(prim).GetExtentAttr().Get())
        assert ends.tolist() == [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
        for part, faces in usd_parts(prim):
            bound, _ = UsdShade.MaterialBindingAPI(part).ComputeBoundMaterial("physics")
            physics = UsdPhysics.MaterialAPI(bound)
            found[part.GetDisplayName()] = (
                len(faces),
                bound.GetPrim().HasAPI(UsdPhysics.MaterialAPI)
                and (
                    physics.GetStaticFrictionAttr().Get(),
                    physics.GetDynamicFrictionAttr().Get(),
                    physics.GetRestitutionAttr().Get(),
                ),
            )
    mu = pytest.approx((0.55, 0.55, 0))
    assert found == {"sand": (4, mu), NASTY: (6, False), "": (2, False)}


def test_obj_has_a_group_and_a_material_for_each_surface(tmp_path: Path) -> None:
    """Their names are words; what they stand for is said beside them."""
    path, materials = write_mesh(oblong(), tmp_path / "my yard.obj")
    lines = path.read_text(encoding="utf-8").splitlines()
    words = ["sand", "Löß_Kies_nass_1_--_砂_", "none"]
    assert [line[2:] for line in lines if line.startswith("g ")] == words
    assert [line[7:] for line in lines if line.startswith("usemtl ")] == words
    text = materials.read_text(encoding="utf-8")
    assert [line[7:] for line in text.splitlines() if line.startswith("newmtl ")] == words
    said = [line[10:] for line in lines if line.startswith("# surface ")]
    assert [json.loads(name) for name in said] == ["sand", NASTY]


@pytest.mark.parametrize("reader", READERS[".obj"])
def test_file_names_with_spaces(reader: Callable[[Path], Read], tmp_path: Path) -> None:
    """An OBJ names its MTL, and cannot quote it either; readers take the rest of the line."""
    path, _ = write_mesh(oblong(), tmp_path / "Löß  my yard.v1.obj")
    read = reader(path)
    assert read.same(oblong())
    assert all(color for color, _ in read.triangles)


def test_ply_tells_surfaces_and_walls(tmp_path: Path) -> None:
    """Each face has the number of its surface, and whether it is a wall."""
    pytest.importorskip("trimesh")
    import trimesh

    mesh = oblong()
    path = written(mesh, tmp_path, ".ply")
    data = trimesh.load_mesh(path, process=False).metadata["_ply_raw"]["face"]["data"]
    assert data["surface"].ravel().tolist() == mesh.surfaces.tolist()
    assert data["wall"].ravel().tolist() == mesh.walls.tolist()
    assert f"comment surface 1 {json.dumps(NASTY)}\n".encode() in path.read_bytes()


def test_vrml_has_names_and_indentation(tmp_path: Path) -> None:
    """A person finds the surfaces, and programs find a Shape for each."""
    path = written(oblong(), tmp_path, ".wrl")
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[0] == "#VRML V2.0 utf8"
    assert "    DEF Shape_sand Shape {" in lines
    depth = 0
    for line in lines:
        bare = line.split("#")[0].strip()
        depth -= bare[:1] in ("}", "]")
        if bare:
            assert len(line) - len(line.lstrip()) == 2 * depth, line
        depth += bare[-1:] in ("{", "[")
    assert depth == 0
    shapes = ElementTree.fromstring(
        output(program("tovrmlx3d"), path, "--encoding=xml").encode()
    ).iter("Shape")
    assert [shape.get("DEF") for shape in shapes] == [
        "Shape_sand", "Shape_Lo_Kies_nass_1_", "Shape_none",
    ]  # fmt: skip


def test_x3d_is_well_formed(tmp_path: Path) -> None:
    """Names and descriptions do not break the XML."""
    root = ElementTree.fromstring(written(oblong(), tmp_path, ".x3d").read_bytes())
    about = {meta.get("name"): meta.get("content") for meta in root.iter("meta")}
    assert about["description"] == DESCR.replace("\n", " ")
    assert len({node.get("DEF") for node in root.iter() if node.get("DEF")}) == 17


@pytest.mark.parametrize("suffix", FORMATS)
def test_strange_texts(suffix: str, tmp_path: Path) -> None:
    """Names and descriptions may hold anything that JSON may."""
    names = ("\x00\x1f\ud800\u2028", "", "-->]]>} Shape {", "\nend_header\nv 1 2 3")
    mesh = oblong()
    surfaces = np.arange(12, dtype=np.int32) % 4
    four = [0, 1, 2, 0]
    mesh = replace(
        mesh,
        names=names,
        surfaces=surfaces,
        colors=mesh.colors[four],
        frictions=mesh.frictions[four],
    )
    path = written(mesh, tmp_path, suffix, "\x00\ud800\u2028end_header\n--> } Shape {")
    for reader in READERS[suffix]:
        try:
            read = reader(path)
        except pytest.skip.Exception:
            continue
        assert read.same(mesh)
    if suffix == ".glb":
        assert validated(path)["issues"]["messages"] == []


def test_one_surface_and_no_surfaces(tmp_path: Path) -> None:
    """A mesh without any name is written, too."""
    mesh = oblong()
    bare = replace(
        mesh,
        names=(),
        colors=np.zeros((0, 3), np.uint8),
        frictions=np.zeros(0),
        surfaces=np.full(12, -1, np.int32),
    )
    for suffix in FORMATS:
        path = written(bare, tmp_path, suffix)
        if suffix in (".obj", ".ply", ".stl", ".glb"):
            assert by_trimesh(path).same(bare)


def texts(numbers: Any) -> list[str]:
    """Numbers as they are written."""
    file = io.BytesIO()
    points = np.resize(np.asarray(numbers, np.float32), (-(-len(numbers) // 3), 3))
    write_points(file, points)
    return file.getvalue().decode().split()[: len(numbers)]


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0, "0"), (-0.0, "0"), (1, "1"), (-1, "-1"), (10, "10"), (100, "100"), (0.1, "0.1"),
        (-0.05, "-0.05"), (12.3, "12.3"), (1 / 3, "0.33333334"), (16777216, "16777216"),
        (123456792, "123456790"), (1e15, "1000000000000000"), (1e16, "1e16"), (1e-5, "0.00001"),
        (1.25e-6, "1.25e-6"), (-1e-6, "-1e-6"), (9.999999e-6, "9.999999e-6"),
        (3.4028235e38, "3.4028235e38"), (1e-45, "1.4013e-45"), (0.99999994, "0.99999994"),
        (999999.94, "999999.94"), (9.5367431640625e-07, "9.536743e-7"),
    ],
)  # fmt: skip
def test_numbers(number: float, text: str) -> None:
    """The shortest text that reads back as the same float32."""
    assert texts([number, 7, number]) == [text, "7", text]


def test_all_kinds_of_numbers() -> None:
    """They read back as the same float32, and NumPy knows no text with fewer digits."""
    rng = np.random.default_rng(1)
    bits = rng.integers(0, 1 << 32, 300_000, dtype=np.uint32).view(np.float32)
    plain = np.concatenate([rng.normal(0, 100, 300_000), np.arange(3000) / 100])
    numbers = np.concatenate([bits[np.isfinite(bits)], plain.astype(np.float32)])
    subnormal = np.abs(numbers) < np.finfo(np.float32).smallest_normal
    found = texts(numbers)
    assert (np.array(found, np.float64).astype(np.float32) == numbers).all()
    few = slice(None, None, 50)
    for text, number, short in zip(found[few], numbers[few], ~subnormal[few], strict=True):
        shortest = np.format_float_scientific(number, trim="-").partition("e")[0]
        digits = text.partition("e")[0].replace(".", "").strip("-0")
        assert not short or len(digits) <= len(shortest.replace(".", "").strip("-0")), (
            text,
            number,
        )


def test_doubles() -> None:
    """15 digits; what has fewer is as it was typed."""
    rng = np.random.default_rng(1)
    typed = [
        f"{number:.15g}"
        for number in rng.normal(0, 1, 30_000) * 10.0 ** rng.integers(-3, 9, 30_000)
    ]
    typed += ["4649776.5", "0.1", "500000.583333", "-0.001", "123456789012345", "1e+20"]
    file = io.BytesIO()
    write_points(file, np.resize(np.array(typed, float), (len(typed) // 3, 3)))
    found = file.getvalue().decode().split()
    assert [f"{float(text):.15g}" for text in found] == typed
    assert all(len(text.partition("e")[0].replace(".", "").strip("-0")) <= 15 for text in found)
    assert found[-6:] == [*typed[-6:-1], "1e20"]


def test_faces_of_all_lengths() -> None:
    """Numbers of vertices, from the first digit to the last that int32 has."""
    ends = [10**n - 1 for n in range(1, 10)] + [10**n for n in range(10)] + [0, 2**31 - 2]
    faces = np.resize(np.array(ends, np.int32), (70_000, 3))
    file = io.BytesIO()
    write_faces(file, faces, 1, b"f ")
    assert file.getvalue().decode() == "".join(
        f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces.tolist()
    )


def test_colors_read_back() -> None:
    """By rounding and by cutting."""
    for shade in range(256):
        number = float(color_text((shade, 0, 0)).split()[0])
        assert round(number * 255) == int(number * 255 + 1e-9) == shade


def test_names() -> None:
    """Different names stay different, whatever is left of them."""
    names = ["a", "a", "a_2", "ä", "b c", "b  c", "砂", "土", "_", "x__y", ""]
    assert plain_names(names, is_ascii_word, "surface") == [
        "a", "a_2", "a_2_2", "a_3", "b_c", "b_c_2", "surface", "surface_2", "surface_3", "x__y",
        "surface_4",
    ]  # fmt: skip
    assert json_text("a\u2028\ud800\x7f") == '"a\\u2028\\ud800\\u007f"'


def test_obj_and_materials_appear_together(tmp_path: Path) -> None:
    """Neither is there when the other cannot be; and both are kept unless told otherwise."""
    (tmp_path / "t.mtl").write_text("mine")
    with pytest.raises(WriteError, match=r"t\.mtl: exists already"):
        write_mesh(oblong(), tmp_path / "t.obj")
    assert [path.name for path in tmp_path.iterdir()] == ["t.mtl"]
    both = write_mesh(oblong(), tmp_path / "t.obj", overwrite=True)
    assert both == (tmp_path / "t.obj", tmp_path / "t.mtl")
    assert sorted(tmp_path.iterdir()) == sorted(both)


def test_what_cannot_be_written(tmp_path: Path) -> None:
    """Unknown suffixes, no faces, and what is no float32."""
    mesh = oblong()
    for name, match in (("t.3ds", "no mesh format has the suffix"), ("t", "has no suffix")):
        with pytest.raises(RequestError, match=match):
            write_mesh(mesh, tmp_path / name)
    empty = replace(mesh, faces=mesh.faces[:0], surfaces=mesh.surfaces[:0], walls=mesh.walls[:0])
    with pytest.raises(RequestError, match="no ground"):
        write_mesh(empty, tmp_path / "t.obj")
    with pytest.raises(RequestError, match="too short for coordinates of the world"):
        write_mesh(mesh, tmp_path / "t.glb", world=True)
    for number in (np.nan, 1e39):
        vertices = mesh.vertices.copy()
        vertices[3, 1] = number
        with pytest.raises(RequestError, match="no numbers"):
            write_mesh(replace(mesh, vertices=vertices), tmp_path / "t.obj")
    assert not list(tmp_path.iterdir())


def test_edges_that_float32_cannot_tell_from_a_point_are_left_out() -> None:
    """A closed mesh stays closed, and nothing else changes."""
    # a pyramid over a square, its tip an edge that is too short
    vertices = [(0, 0, 0), (9, 0, 0), (9, 5, 0), (0, 5, 0), (3, 2, 4), (3 + 1e-9, 2, 4)]
    faces = [(0, 1, 4), (1, 5, 4), (1, 2, 5), (2, 3, 5), (3, 4, 5), (3, 0, 4), (0, 2, 1), (0, 3, 2)]
    mesh = replace(
        oblong(),
        vertices=np.array(vertices, float),
        faces=np.array(faces, np.int32),
        surfaces=np.arange(8, dtype=np.int32) % 2,
        walls=np.zeros(8, bool),
    )
    built = collapse_degenerate(BuiltMesh(mesh, 6, 0.0, PlanLoss()))
    assert built.mesh.faces.tolist() == [
        [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]
    ]  # fmt: skip
    assert built.mesh.surfaces.tolist() == [0, 0, 1, 1, 0, 1]
    assert built.shell == 4 and len(built.mesh.vertices) == 5
    apart = replace(built.mesh, vertices=built.mesh.vertices[[0, 1, 2, 3, 0]])
    same = BuiltMesh(apart, 6, 0.0, PlanLoss())
    assert len(collapse_degenerate(same).mesh.faces) == 4  # edges 0-4 and 3-0-4 have no length
    same = BuiltMesh(built.mesh, 4, 0.0, PlanLoss())
    assert collapse_degenerate(same) is same
