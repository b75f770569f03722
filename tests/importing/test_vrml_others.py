"""VRML97 scenes: Coin, view3dscene and we read the same; what is written here comes back."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import terratool
from terratool.importing.vrml.scene import read_vrml, up_axis_of
from terratool.mesh.export import write_mesh
from terratool.mesh.formats.vrml import write_elevation_grid
from terratool.mesh.types import HeightGrid
from tests.commands import ROOT, SAMPLE, run
from tests.programs import program
from tests.viewers import by_trimesh, oblong, output
from tests.vrml import TRIANGLE, by_coin, corners, measures, read, saved


def shape(geometry: str) -> str:
    return f"Shape {{ geometry {geometry} }}"


def turned(inner: str, more: str = "") -> str:
    """Something in a place where no two axes are alike."""
    return f"Transform {{ translation 1 -2 3 rotation 1 2 3 0.7 {more} children [ {inner} ] }}"


SECTION = "crossSection [ .5 0, 0 -.5, -.3 0, 0 .7, .5 0 ]"
"""A kite, counterclockwise as seen from above."""
L_SHAPE = "crossSection [ 0 0, 0 2, 3 2, 3 1, 1 1, 1 0, 0 0 ] convex FALSE"
POINTS = "coord DEF P Coordinate { point [ 0 0 0, 4 0 1, 4 3 1, 2 1 .5, 0 3 0, 0 0 5 ] }"

SCENES = {
    "box": turned(shape("Box { size 1 2 5 }")),
    "box without a size": turned(shape("Box { }")),
    "triangle": TRIANGLE,
    "concave face": turned(
        shape(f"IndexedFaceSet {{ convex FALSE {POINTS} coordIndex [ 0 1 2 3 4 -1 0 5 1 ] }}")
    ),
    "quadrilaterals": turned(
        shape(
            "IndexedFaceSet { coord Coordinate { point [ 0 0 0, 0 0 2, 3 0 2, 3 0 0, 3 1 0, 0 1 0 ]"
            "} coordIndex [ 0 1 2 3 -1, 3 4 5 0 -1 ] }"
        )
    ),
    "grid of heights": turned(
        shape(
            "ElevationGrid { xDimension 3 zDimension 4 xSpacing 2 zSpacing .5"
            " height [ 1 2 4, 0 7 3, 1 9 2, 5 5 1 ] }"
        )
    ),
    "extrusion without fields": turned(shape("Extrusion { }")),
    "extrusion, all fields": turned(
        shape(
            f"Extrusion {{ {L_SHAPE} spine [ 0 0 0, 0 2 0, 1 4 0, 3 5 1 ]"
            " scale [ 1 1, 2 1, 1 1, .5 2 ]"
            " orientation [ 0 1 0 0, 0 1 0 .3, 1 0 0 .2, 0 1 0 1 ] }"
        )
    ),
    "extrusion, excess values": shape(
        f"Extrusion {{ {SECTION} spine [ 0 0 0, 0 2 0 ] scale [ 1 1, 2 1, 9 9, 9 9 ] }}"
    ),
    "extrusion, open section and a cap": shape(
        "Extrusion { crossSection [ .5 0, 0 -.5, -.3 0, 0 .7 ] endCap FALSE"
        " spine [ 0 1 0, 1 2 0, 1 3 2 ] }"
    ),
    "extrusion, closed": shape(
        f"Extrusion {{ {SECTION} beginCap FALSE endCap FALSE"
        " spine [ 0 0 0, 4 0 0, 5 3 1, 0 3 0, 0 0 0 ] }"
    ),
    "extrusion, straight": shape(f"Extrusion {{ {SECTION} spine [ 1 0 0, 3 1 0, 7 3 0 ] }}"),
    "extrusion, along z": shape(f"Extrusion {{ {SECTION} spine [ 0 0 0, 0 0 5 ] }}"),
    "extrusion, down": shape(f"Extrusion {{ {SECTION} spine [ 1 5 0, 1 2 0, 1 -4 0 ] }}"),
    "extrusion, straight at first": shape(
        f"Extrusion {{ {SECTION} spine [ 0 0 0, 1 0 0, 2 0 0, 3 0 2, 4 1 2, 5 2 2, 6 3 2 ] }}"
    ),
    "extrusion, bends both ways": shape(
        f"Extrusion {{ {SECTION} spine [ 0 0 0, 2 0 0, 3 2 0, 5 2.5 0, 6 5 0, 6 7 1 ] }}"
    ),
    "transform, all fields": turned(
        TRIANGLE, "scale 1 2 3 center 4 5 6 scaleOrientation 3 1 0 0.4"
    ),
    "transforms in transforms": turned(
        f"{TRIANGLE} Group {{ children {turned(shape('Box { }'), 'scale .5 2 1 center 0 1 0')} }}"
        f" {turned(turned(TRIANGLE, 'scaleOrientation 0 1 0 1 scale 3 1 1'))}"
    ),
    "USE": f"DEF T {TRIANGLE} {turned('USE T')}"
    f" {turned('Anchor { children USE T }', 'scale 2 3 4')}",
    "Switch": turned(
        f"Switch {{ whichChoice 1 choice [ {shape('Box { }')}, {TRIANGLE}, {shape('Box { }')} ] }}"
        f" Switch {{ choice [ {shape('Box { }')} ] }}"
        f" Switch {{ whichChoice 3 choice [ {shape('Box { }')} ] }}"
        f" Switch {{ whichChoice 0 choice {shape('Box { size 1 2 9 }')} }}"
    ),
    "LOD": f"LOD {{ range [ 1e9 ] level [ {TRIANGLE}, {shape('Box { }')} ] }}",
    "Collision": f"Collision {{ proxy {shape('Box { }')} children {TRIANGLE} }}",
    "prototypes": (
        "PROTO Slab [ field SFVec3f s 1 2 3 field MFNode more [ ] eventIn SFBool e ]"
        " { Transform { scale IS s children [ Shape { geometry Box { size 2 1 5 } }"
        " Group { children IS more } ] } }"
        f" DEF A Slab {{ }} {turned(f'Slab {{ s 2 1 .5 more [ {TRIANGLE} USE A ] }}')}"
        " PROTO Two [ exposedField SFVec3f t 9 0 0 ] { Group { children [ DEF A Slab { s IS t }"
        f" Transform {{ translation IS t children USE A }} ] }} }}"
        " Two { t 1 7 2 }"
    ),
    "no faces": TRIANGLE
    + ' PointLight { } Viewpoint { position 0 0 9 } NavigationInfo { type [ "FLY" "ANY" ] }'
    + " DEF C TimeSensor { } DEF I PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0 1 1 1 ] }"
    + " ROUTE C.fraction_changed TO I.set_fraction",
}


@pytest.mark.parametrize("name", SCENES)
def test_coin_reads_the_same(name: str, tmp_path: Path) -> None:
    """As many triangles within the same bounds, of the same area, at the same place and side."""
    path = saved(tmp_path, SCENES[name])
    found, wanted = corners(read_vrml(path)), by_coin(path)
    assert len(found) == len(wanted)
    for one, other in zip(measures(found), measures(wanted), strict=True):
        assert np.allclose(one, other, rtol=2e-5, atol=2e-4)


@pytest.mark.parametrize("name", SCENES)
def test_a_mirrored_scene_is_told_apart(name: str, tmp_path: Path) -> None:
    """What passes the test above is not mirrored in any axis, nor has two axes exchanged."""
    found = corners(read(tmp_path, SCENES[name]))
    for wrong in (
        *(found * np.where(np.arange(3) == axis, -1, 1) for axis in range(3)),
        *(found[:, :, list(order)] for order in ((1, 0, 2), (0, 2, 1), (2, 1, 0))),
        found[:, ::-1],
    ):
        assert not all(
            np.allclose(one, other, rtol=2e-5, atol=2e-4)
            for one, other in zip(measures(found), measures(wrong), strict=True)
        )


KITE = (
    "Coordinate3 { point [ 0 0 0, 4 0 1, 4 3 1, 0 3 0, 2 1 5 ] }"
    " DEF F IndexedFaceSet { coordIndex [ 0, 1, 4, -1, 1, 2, 4, -1 ] }"
)
OLD_SCENES = {
    "a state that goes on": f"Separator {{ {KITE} Translation {{ translation 1 2 7 }} USE F"
    " Rotation { rotation 1 2 3 .7 } Scale { scaleFactor 1 2 3 } USE F }",
    "separators": f"Separator {{ {KITE} Separator {{ Translation {{ translation 1 2 7 }} USE F"
    " Coordinate3 { point [ 9 0 0, 4 0 1, 4 3 1, 0 3 0, 2 1 5 ] } USE F } USE F"
    " TransformSeparator { Scale { scaleFactor 3 1 2 } USE F Coordinate3 { point [ 0 0 9, 1 0 0, "
    "0 5 0, 0 0 0, 1 1 1 ] } } USE F Group { Scale { scaleFactor 3 1 2 } } USE F }",
    "transform, all fields": "Transform { translation 1 -2 3 rotation 1 2 3 .7 scaleFactor 1 2 3"
    f" scaleOrientation 3 1 0 .4 center 4 5 6 }} {KITE}",
    "matrix": f"MatrixTransform {{ matrix 1 2 0 0  0 1 .5 0  3 0 1 0  5 6 7 1 }} {KITE}",
    "cube": "Translation { translation 1 2 7 } Cube { width 1 height 2 depth 5 }",
    "switch": f"Separator {{ Switch {{ whichChild -3 {KITE} }} Switch {{ USE F }}"
    " Switch { whichChild 1 Cube { } Cube { width 7 } } LOD { range [ 9 ] center 0 0 0"
    " USE F Cube { width 9 } } }",
    "an anchor and much without faces": f"WWWAnchor {{ name http://x.org/a {KITE} }}"
    ' Info { string "Group { Cube { } }" } PerspectiveCamera { position 0 0 9 } DEF N Material {'
    " ambientColor [ 0 0 0, 1 1 1 ] transparency .5 } Texture2 { wrapS CLAMP image 1 1 1 0xFF }"
    " MaterialBinding { value PER_FACE } IndexedLineSet { coordIndex [ 0 1 -1 ] } USE N",
    "a field that is declared": "Group { Mine { fields [ SFFloat a, MFString isA ] isA [ "
    '"Material" ] a .3 } Cube { fields [ SFFloat width ] width 10 } }',
}


@pytest.mark.parametrize("name", OLD_SCENES)
def test_coin_reads_the_same_of_vrml_1(name: str, tmp_path: Path) -> None:
    path = tmp_path / "old.wrl"
    path.write_text(f"#VRML V1.0 ascii\n{OLD_SCENES[name]}")
    found, wanted = corners(read_vrml(path)), by_coin(path)
    assert len(found) == len(wanted) > 0
    for one, other in zip(measures(found), measures(wanted), strict=True):
        assert np.allclose(one, other, rtol=2e-5, atol=2e-4)


def test_faces_of_vrml_1_that_are_seen_clockwise(tmp_path: Path) -> None:
    path = tmp_path / "old.wrl"
    both = [
        f"#VRML V1.0 ascii\nShapeHints {{ vertexOrdering {order} }} {KITE}"
        for order in ("COUNTERCLOCKWISE", "CLOCKWISE")
    ]
    found = []
    for text in both:
        path.write_text(text)
        found.append(measures(corners(read_vrml(path))).normal)
    assert np.allclose(found[0], -found[1])
    assert found[0].any()


@pytest.mark.parametrize(
    ("parts", "shares"),
    [("", (1, 1, 1)), ("parts ALL", (1, 1, 1)), ("parts SIDES", (1, 0, 0)),
     ("parts (SIDES | TOP)", (1, 0, 1)), ("parts (BOTTOM)", (0, 1, 0))],
)  # fmt: skip
def test_parts_of_a_cylinder_of_vrml_1(
    parts: str, shares: tuple[int, int, int], tmp_path: Path
) -> None:
    path = tmp_path / "old.wrl"
    path.write_text(f"#VRML V1.0 ascii\nCylinder {{ radius 2 height 7 {parts} }}")
    areas = np.array([2 * np.pi * 2 * 7, np.pi * 4, np.pi * 4])
    assert measures(corners(read_vrml(path))).area == pytest.approx(areas @ shares, rel=5e-3)


ROUND = {
    "Sphere { radius 3 }": ([-3, -3, -3], [3, 3, 3]),
    "Cone { bottomRadius 2 height 5 }": ([-2, -2.5, -2], [2, 2.5, 2]),
    "Cylinder { radius 2 height 7 top FALSE }": ([-2, -3.5, -2], [2, 3.5, 2]),
    "Cylinder { side FALSE bottom FALSE }": ([-1, 1, -1], [1, 1, 1]),
}


@pytest.mark.parametrize("geometry", ROUND)
def test_coin_has_round_ones_of_fewer_sides(geometry: str, tmp_path: Path) -> None:
    path = saved(tmp_path, shape(geometry))
    found, wanted = measures(corners(read_vrml(path))), measures(by_coin(path))
    assert np.allclose(found.bounds, ROUND[geometry])
    assert np.allclose(found.area, wanted.area, rtol=0.03)
    assert np.allclose(found.volume, wanted.volume, rtol=0.05)
    assert found.volume == 0 or found.volume > wanted.volume
    assert np.allclose(found.normal, wanted.normal, rtol=0.03, atol=1e-5)


def test_view3dscene_reads_the_same_numbers(tmp_path: Path) -> None:
    """Spellings of numbers, comments, commas and strings do not lead its converter elsewhere."""
    path = saved(
        tmp_path,
        '# "a [ string { in a comment\n'
        'WorldInfo{title "a \\" # { quoted"info["x","y # \\\\"]}Shape{geometry IndexedFaceSet{'
        "coord Coordinate{point[+1 -.5 5.,,1e1\t0x10 2.5E-1#c\r 1E+2,0 -0 ]}coordIndex[0 1\n2,-1,"
        "0x2 1 +0]}}",
    )
    text = output(program("tovrmlx3d"), path, "--encoding=xml")
    (faces,) = ElementTree.fromstring(text.encode()).iter("IndexedFaceSet")
    (coordinate,) = faces.iter("Coordinate")
    points = [float(word) for word in str(coordinate.get("point")).split()]
    indices = [int(word) for word in str(faces.get("coordIndex")).split()]
    found = read_vrml(path)
    assert found.vertices.ravel().tolist() == points
    assert [index for index in indices if index >= 0] == found.faces.ravel().tolist()


# --- what this project writes -------------------------------------------------------------------


def test_meshes_come_back(tmp_path: Path) -> None:
    """The same triangles, surface by surface; numbers have the digits of float32."""
    mesh = oblong()
    (path, *_) = write_mesh(mesh, tmp_path / "t.wrl", descr="Löß \\ first\nsecond")
    found = read_vrml(path)
    wanted = mesh.vertices.astype(np.float32)[mesh.faces]
    assert found.notes == ()
    assert sorted(corners(found).astype(np.float32).tolist()) == sorted(wanted.tolist())
    assert up_axis_of(path) == "z"


def test_grids_of_heights_come_back(tmp_path: Path) -> None:
    """Rows from the north, heights along z; the quarter turn has 9 digits."""
    heights = np.array([[1.5, 2, 4, 0.25], [0, 7, 3, 8], [1, 9, 2, -3]], np.float32)
    grid = HeightGrid(
        heights=heights,
        surfaces=np.zeros((3, 4), np.int32),
        spacing=(0.5, 2.0),
        origin=np.zeros(3),
        names=("sand",),
        colors=np.array([[230, 180, 81]], np.uint8),
    )
    path = tmp_path / "grid.wrl"
    write_elevation_grid(grid, path, "A grid")
    found = read_vrml(path)
    y, x = np.mgrid[:3, :4]
    wanted = np.column_stack((x.ravel() * 0.5, 4 - y.ravel() * 2.0, heights.ravel()))
    assert np.allclose(found.vertices, wanted, atol=1e-7)
    assert len(found.faces) == 2 * 2 * 3
    normals = np.cross(
        corners(found)[:, 1] - corners(found)[:, 0], corners(found)[:, 2] - corners(found)[:, 0]
    )
    assert (normals[:, 2] > 0).all()
    assert up_axis_of(path) == "z"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["warehouse", "paper-example"])
def test_samples_come_back(name: str, tmp_path: Path) -> None:
    """The triangles of the PLY of the same terrain, as trimesh reads that."""
    sample, files = ROOT / "samples" / f"{name}.json", []
    for suffix in ("wrl", "ply"):
        files.append(tmp_path / f"t.{suffix}")
        ran = run("export-mesh", sample, files[-1])
        assert ran.code == 0, ran.err
    found = corners(read_vrml(files[0])).astype(np.float32)
    wanted = [triangle for _, triangle in by_trimesh(files[1]).triangles]
    assert sorted(found.tolist()) == sorted(np.float32(wanted).tolist())


def test_heights_of_a_sample_come_back(tmp_path: Path) -> None:
    """Those of the terrain at the nodes, but at walls, where two meet."""
    path = tmp_path / "t.wrl"
    ran = run("export-vrml", SAMPLE, path, "--elevation-grid", "--resolution", "1.37")
    assert ran.code == 0, ran.err
    found = read_vrml(path)
    x, y, z = found.vertices.T
    assert np.allclose(found.vertices.min(axis=0)[:2], 0, atol=1e-6)
    assert np.allclose(found.vertices.max(axis=0)[:2], 100, atol=1e-6)
    inside = (x > 0.1) & (x < 99.9) & (y > 0.1) & (y < 99.9)
    heights = terratool.load(SAMPLE).height(x[inside], y[inside])
    assert (np.abs(heights - z[inside]) < 1e-5).mean() > 0.98
    assert np.ptp(z) > 1
