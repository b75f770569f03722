"""USD as a source: parts in their places, units and axes, and what lies elsewhere or multiplies."""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from terratool.importing import usd
from terratool.importing.meshes import read_triangles
from terratool.importing.types import Triangles
from terratool.importing.usd import RefusalError, read_stage
from terratool.mesh.export import write_mesh
from tests.importing.test_meshes import FACES, POINTS, as_set, refused, same
from tests.viewers import oblong

pytest.importorskip("pxr", reason="usd-core is not installed")

HEAD = '#usda 1.0\n(\n    upAxis = "Z"\n    metersPerUnit = 1\n)\n'


def mesh(name: str = "Tent", more: str = "", points: Any = POINTS, faces: Any = FACES) -> str:
    """A mesh without any symmetry."""
    corners = [n for face in faces for n in face]
    return f"""def Mesh "{name}" {{
    int[] faceVertexCounts = {[len(face) for face in faces]}
    int[] faceVertexIndices = {corners}
    point3f[] points = [{", ".join(map(str, map(tuple, points)))}]
    {more}
}}
"""


def put(folder: Path, body: str, head: str = HEAD, name: str = "tent.usda") -> Path:
    path = folder / name
    path.write_text(head + body)
    return path


def read(folder: Path, body: str, head: str = HEAD) -> Triangles:
    """What is read in this process, as a process of its own takes long."""
    return read_stage(str(put(folder, body, head)))


def refusal(folder: Path, body: str) -> str:
    with pytest.raises(RefusalError) as caught:
        read(folder, body)
    what, hint = caught.value.args
    assert what.endswith(".")
    assert hint.endswith(".")
    return str(what)


# -- files of all kinds, by the process -----------------------------------------------------------


@pytest.mark.nightly
@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz", ".usd"])
def test_files_of_all_kinds(suffix: str, tmp_path: Path, capfd: Any) -> None:
    from pxr import Sdf, UsdUtils

    path = put(tmp_path, mesh())
    if suffix == ".usdz":
        assert UsdUtils.CreateNewUsdzPackage(str(path), str(tmp_path / "tent.usdz"))
    elif suffix != ".usda":
        Sdf.Layer.FindOrOpen(str(path)).Export(str(tmp_path / f"tent{suffix}"))
    capfd.readouterr()
    found = read_triangles(tmp_path / f"tent{suffix}")
    assert same(found)
    assert found.notes == ()
    assert same(
        read_triangles(tmp_path / f"tent{suffix}", up="y"), [(x, -z, y) for x, y, z in POINTS]
    )
    assert capfd.readouterr() == ("", "")


@pytest.mark.nightly
def test_meshes_of_ours_come_back(tmp_path: Path) -> None:
    ours = oblong()
    (path, *_) = write_mesh(ours, tmp_path / "mesh.usdc")
    found = read_triangles(path)
    assert as_set(found.vertices, found.faces, 5) == as_set(ours.vertices, ours.faces, 5)


@pytest.mark.nightly
def test_broken_files_are_refused(tmp_path: Path, capfd: Any) -> None:
    from pxr import Sdf

    path = put(tmp_path, mesh())
    Sdf.Layer.FindOrOpen(str(path)).Export(str(tmp_path / "tent.usdc"))
    capfd.readouterr()
    for name in ("tent.usda", "tent.usdc"):
        data = (tmp_path / name).read_bytes()
        for bad in (data[: len(data) // 2], b"rubbish", data[:8] + b"\xff" * 90):
            (tmp_path / name).write_bytes(bad)
            assert "cannot be read as USD" in refused(tmp_path / name).message
    assert (
        "lies in another file"
        in refused(put(tmp_path, 'def "A" (references = @/etc/hill.usda@) {}')).message
    )
    assert capfd.readouterr() == ("", "")


@pytest.mark.nightly
def test_memory_and_time_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Prims that refer to each other come to a thousand million."""
    body = mesh("L0")
    for n in range(9):
        parts = "".join(f'def "P{m}" (references = </L{n}>) {{}}\n' for m in range(10))
        body += f'def "L{n + 1}" {{ {parts} }}\n'
    monkeypatch.setattr(usd, "SECONDS", 8.0)
    monkeypatch.setattr(usd, "MEMORY", 200 << 20)
    said = refused(put(tmp_path, body)).message
    assert "needs too much memory" in said or "takes too long" in said


def test_a_package_that_is_missing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = put(tmp_path, mesh())
    monkeypatch.setitem(sys.modules, "pxr", None)
    error = refused(path)
    assert "USD needs pxr" in error.message
    assert error.hint == f'Run {sys.executable} -m pip install "terratool[usd]"'


# -- what is read ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("head", "factor", "up", "said"),
    [
        (HEAD, 1, "z", 0),
        (HEAD.replace("= 1", "= 0.01"), 0.01, "z", 1),
        (HEAD.replace('"Z"', '"Y"').replace("= 1", "= 0.3048"), 0.3048, "y", 1),
        ("#usda 1.0\n", 0.01, "y", 1),
    ],
)
def test_units_and_axes_of_the_file_count(
    head: str, factor: float, up: str, said: int, tmp_path: Path
) -> None:
    found = read(tmp_path, mesh(), head)
    assert same(found, np.multiply(POINTS, factor))
    assert found.up == up
    assert len(found.notes) == said
    assert all("metres were made of them" in note for note in found.notes)


def test_prims_stand_in_their_places(tmp_path: Path) -> None:
    """Scales, turns and moves, a reset, a mirror, and a reference within the file."""
    body = f"""def Xform "A" {{
    double3 xformOp:translate = (10, -2, 3)
    float3 xformOp:rotateXYZ = (10, 20, 30)
    float3 xformOp:scale = (1, 2, -3)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]
    def Scope "S" {{
        {mesh()}
        def Xform "Here" (references = </Part>) {{
            uniform token[] xformOpOrder = ["!resetXformStack!"]
        }}
    }}
}}
over "Part" {{ {mesh("Inner")} }}
def Xform "Twice" (instanceable = true; references = </Part>) {{
    double3 xformOp:translate = (0, 0, 50)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
    found = read(tmp_path, body)
    turn = Rotation.from_euler("xyz", [10, 20, 30], degrees=True)
    moved = turn.apply(np.multiply(POINTS, (1, 2, -3))) + np.array([10, -2, 3])
    wanted = as_set(moved, [face[::-1] for face in FACES], 5)  # turned by the mirror
    wanted += as_set(POINTS, FACES, 5)
    wanted += as_set(np.array(POINTS) + np.array([0, 0, 50]), FACES, 5)
    assert as_set(found.vertices, found.faces, 5) == sorted(wanted)


def test_instances_at_points(tmp_path: Path) -> None:
    """A prototype's own place counts, before that of the point; a point may be invisible."""
    moved = """double3 xformOp:translate = (1, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]"""
    body = f"""def PointInstancer "I" {{
    double3 xformOp:translate = (100, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel prototypes = [</I/P/Tent>, </I/P/Other>]
    int[] protoIndices = [0, 1, 0, 1]
    point3f[] positions = [(0, 0, 0), (0, 20, 0), (0, 40, 5), (99, 99, 99)]
    quath[] orientations = [(1, 0, 0, 0), (0, 0, 0, 1), (1, 0, 0, 0), (1, 0, 0, 0)]
    float3[] scales = [(1, 1, 1), (1, 1, 1), (2, 1, 1), (1, 1, 1)]
    int64[] invisibleIds = [3]
    def Scope "P" {{
        {mesh()}
        {mesh("Other", moved)}
    }}
}}
"""
    found = read(tmp_path, body)
    x, y, z = np.array(POINTS, float).T
    wanted = as_set(np.column_stack([x + 100, y, z]), FACES)
    wanted += as_set(np.column_stack([99 - x, 20 - y, z]), FACES)  # turned by 180°
    wanted += as_set(np.column_stack([2 * x + 100, y + 40, z + 5]), FACES)
    assert as_set(found.vertices, found.faces) == sorted(wanted)


def test_what_is_not_seen_is_left_out(tmp_path: Path) -> None:
    body = mesh()
    for n, more in enumerate(
        ['token visibility = "invisible"', 'uniform token purpose = "guide"',
         'uniform token purpose = "proxy"']
    ):  # fmt: skip
        body += mesh(f"M{n}", more) + f'def Xform "X{n}" {{ {more}\n {mesh()} }}\n'
    body += f'class "C" {{ {mesh()} }}\nover "O" {{ {mesh()} }}\n'
    body += f'def Xform "Off" (active = false) {{ {mesh()} }}\n'
    body += 'def BasisCurves "B" {}\ndef Capsule "K" {}\n'
    body += f'def Xform "R" {{ uniform token purpose = "render"\n {mesh()} }}\n'
    found = read(tmp_path, body)
    assert as_set(found.vertices, found.faces) == sorted(as_set(POINTS, FACES) * 2)
    assert found.notes == (
        "Parts of the file have no faces that are read: 1 BasisCurves, 1 Capsule.",
        "Left out, as they are invisible, guides or proxies: 6 prims with all that is in them.",
    )


def test_polygons_holes_and_left_hands(tmp_path: Path) -> None:
    flat = [(0, 0), (6, 0), (6, 1), (1, 1), (1, 3), (0, 3), (8, 0), (8, 1)]
    points = [(x, y, 1) for x, y in flat]
    faces = [(0, 1, 2, 3, 4, 5), (1, 6, 7, 2), (0, 2, 4)]
    for more, sign in (("", 1), ('uniform token orientation = "leftHanded"', -1)):
        body = mesh(more=f"int[] holeIndices = [2]\n{more}", points=points, faces=faces)
        found = read(tmp_path, body)
        a, b, c = np.moveaxis(found.vertices[found.faces], 1, 0)
        normals = sign * np.cross(b - a, c - a)[:, 2]
        assert normals.min() > 0
        assert normals.sum() / 2 == pytest.approx(6 + 2 + 2)


def test_the_first_time_counts(tmp_path: Path) -> None:
    more = """double3 xformOp:translate.timeSamples = { 5: (0, 0, 7), 9: (0, 0, 99) }
    uniform token[] xformOpOrder = ["xformOp:translate"]"""
    assert same(read(tmp_path, mesh(more=more)), np.add(POINTS, (0, 0, 7)))


@pytest.mark.parametrize(
    ("prim", "low", "high"),
    [
        ('Cube "C" { double size = 3 }', (-1.5, -1.5, -1.5), (1.5, 1.5, 1.5)),
        ('Sphere "C" { double radius = 3 }', (-3, -3, -3), (3, 3, 3)),
        ('Cylinder "C" { double radius = 2 double height = 9 }', (-2, -2, -4.5), (2, 2, 4.5)),
        ('Cone "C" { double radius = 2 double height = 9 uniform token axis = "X" }',
         (-4.5, -2, -2), (4.5, 2, 2)),
        ('Plane "C" { double width = 2 double length = 8 }', (-1, -4, 0), (1, 4, 0)),
        ('Plane "C" { double width = 2 double length = 8 uniform token axis = "X" }',
         (0, -4, -1), (0, 4, 1)),
        ('Plane "C" { double width = 2 double length = 8 uniform token axis = "Y" }',
         (-1, 0, -4), (1, 0, 4)),
    ],
)  # fmt: skip
def test_shapes(prim: str, low: Any, high: Any, tmp_path: Path) -> None:
    """As the library itself has their extents."""
    from pxr import Usd, UsdGeom

    body = "def " + prim.replace("double", "\n double").replace("uniform", "\n uniform")
    found = read(tmp_path, body.replace("}", "\n}\n"))
    assert np.allclose([found.vertices.min(axis=0), found.vertices.max(axis=0)], [low, high])
    stage = Usd.Stage.Open(str(tmp_path / "tent.usda"))
    shape = stage.GetPrimAtPath("/C")
    boundary = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(shape), 0)
    assert np.allclose(boundary, [low, high])
    a, b, c = np.moveaxis(found.vertices[found.faces], 1, 0)
    outward = np.cross(b - a, c - a)
    if "Plane" in prim:
        assert (outward[:, np.ptp(found.vertices, axis=0) == 0] > 0).all()
    elif "Cone" not in prim:
        assert ((outward * (a + b + c)).sum(axis=1) > 0).all()


def test_a_cone_points_along_its_axis(tmp_path: Path) -> None:
    for axis in "XYZ":
        found = read(tmp_path, f'def Cone "C" {{\n uniform token axis = "{axis}"\n}}\n')
        along = found.vertices[:, "XYZ".index(axis)]
        assert (along == along.max()).sum() == 1
        assert (along == along.min()).sum() > 9


# -- other files, and too much --------------------------------------------------------------------


@pytest.fixture
def other(tmp_path: Path) -> Iterator[Path]:
    """A file beside, which would be read."""
    yield put(tmp_path, mesh("Other"), name="other.usda")


@pytest.mark.parametrize(
    "body",
    [
        'def "A" (references = @./other.usda@) {}',
        'def "A" (references = @other.usda@</Other>) {}',
        'def "A" (prepend payload = @other.usda@) {}',
        'def "A" (variants = { string v = "a" }; prepend variantSets = "v") {\n'
        'variantSet "v" = {\n"a" (\nreferences = @other.usda@\n) {\n}\n}\n}',
        'def "A" (references = @`"${X}"`@) {}',
        'def "A" (clips = { dictionary default = { asset[] assetPaths = [@other.usda@];'
        ' string primPath = "/Other"; double2[] active = [(0, 0)] } }) {}',
    ],
)
def test_other_files_are_not_opened(body: str, other: Path, tmp_path: Path) -> None:
    said = refusal(tmp_path, f"{mesh()}\n{body}\n")
    assert "other file" in said or "another file" in said


def test_sublayers_are_not_opened(other: Path, tmp_path: Path) -> None:
    head = HEAD.replace("(\n", "(\n    subLayers = [@./other.usda@]\n", 1)
    with pytest.raises(RefusalError, match=r"another file, '\./other\.usda'"):
        read(tmp_path, mesh(), head)


def test_an_archive_has_its_own_members_alone(tmp_path: Path) -> None:
    inner = put(tmp_path, mesh("Other"), name="other.usda")
    for name, address, good in (
        ("own.usdz", "other.usda", True),
        ("out.usdz", f"{tmp_path}/other.usda", False),
        ("up.usdz", "../other.usda", False),
        ("none.usdz", "missing.usda", False),
    ):
        first = put(
            tmp_path, f'def "A" (references = @{address}@</Other>) {{}}\n', name="first.usda"
        )
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.write(first, "first.usda")
            archive.write(inner, "other.usda")
        if good:
            assert same(read_stage(str(tmp_path / name)))
        else:
            with pytest.raises(RefusalError):
                read_stage(str(tmp_path / name))


def test_textures_are_not_looked_for(tmp_path: Path) -> None:
    more = "asset inputs:file = @/etc/passwd@"
    assert same(read(tmp_path, mesh(more=more)))


def test_prims_that_multiply_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(usd, "_MAX_PRIMS", -800)
    body = mesh("L0")
    for n in range(6):
        parts = "".join(
            f'def "P{m}" (instanceable = true; references = </L{n}>) {{}}\n' for m in range(4)
        )
        body += f'def "L{n + 1}" {{ {parts} }}\n'
    assert "too often" in refusal(tmp_path, body)


def test_faces_that_multiply_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(usd, "MAX_FACES", 7)
    assert "more than 7 faces" in refusal(tmp_path, mesh() + mesh("B"))


@pytest.mark.parametrize(
    ("old", "new"),
    [("[3, 3, 3, 3]", "[3, 3, 3, 4]"), ("[3, 3, 3, 3]", "[3, 3, 3, -3]"), ("[0, 1, 4", "[0, 1, 5"),
     ("(6, 0, 2)", "(nan, 0, 2)"), ("metersPerUnit = 1", "metersPerUnit = -1")],
)  # fmt: skip
def test_meshes_that_are_refused(old: str, new: str, tmp_path: Path) -> None:
    text = HEAD + mesh()
    assert old in text
    with pytest.raises((RefusalError, ValueError)):
        read(tmp_path, text.replace(old, new), "")
