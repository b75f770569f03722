"""VRML97 scenes: what the standard says, where other programs differ or cannot be asked."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from terratool.errors import ReadError
from terratool.importing.vrml.scene import UP, read_vrml, up_axis_of
from terratool.importing.vrml.shapes import SIDES, extrusion, planes_along, pose, product, transform
from tests.vrml import HEADER, TRIANGLE, corners, measures, read, saved

trimesh = pytest.importorskip("trimesh")

KITE = np.array([(0.5, 0), (0, -0.5), (-0.3, 0), (0, 0.7), (0.5, 0)])
NO_TURN = np.array([(0.0, 0, 1, 0)])
NO_SCALE = np.array([(1.0, 1)])
NUMBER = st.floats(-9, 9, allow_subnormal=False).map(lambda x: round(x, 3))
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)


def shape(geometry: str) -> str:
    return f"Shape {{ geometry {geometry} }}"


def test_y_is_up() -> None:
    assert UP == "y"


@pytest.mark.parametrize(
    ("text", "axis"),
    [("# z is up\n", "z"), ("#a\n\n#b\n# z is up\nGroup { }", "z"), ("#x is up\n", "x"),
     ("Group { }\n# z is up\n", None), ("# z is up, perhaps\n", None), ("", None)],
)  # fmt: skip
def test_the_axis_that_a_comment_states(text: str, axis: str | None, tmp_path: Path) -> None:
    assert up_axis_of(saved(tmp_path, text)) == axis


@pytest.mark.parametrize("ending", ["\n", "\r", "\r\n"])
@pytest.mark.parametrize("packed", [False, True])
def test_bytes_of_all_kinds(ending: str, packed: bool, tmp_path: Path) -> None:
    """Line ends of all systems, text that is no UTF-8, a byte order mark, gzip in two members."""
    text = HEADER + f'# Hügel\n# "\nWorldInfo {{ title "Grün \\"{{" }}\n{TRIANGLE}'
    data = text.replace("\n", ending).encode("latin-1")
    members = gzip.compress(data[:60]) + gzip.compress(data[60:])
    path = tmp_path / "t.wrl"
    path.write_bytes(members if packed else b"\xef\xbb\xbf" + data)
    found = read_vrml(path)
    assert found.vertices.tolist() == [[0.5, 0, 0], [3, 0.25, 0], [0, 2, 7]]
    assert found.faces.tolist() == [[0, 1, 2]]
    assert found.vertices.dtype == np.float64
    assert found.faces.dtype == np.int32


def test_what_some_programs_write(tmp_path: Path) -> None:
    """Scalars in brackets, lists without, names from digits and with points: they are clear."""
    found = read(
        tmp_path,
        "DEF 3d.box-1 Shape { geometry IndexedFaceSet { coordIndex 0 1 2 -1"
        " coord [ Coordinate { point 0 0 0 1 0 0 0 2 7 } ] } }"
        " Transform { translation [ 1 2 3 ] children USE 3d.box-1 }",
    )
    assert found.vertices.tolist() == [
        [0, 0, 0], [1, 0, 0], [0, 2, 7], [1, 2, 3], [2, 2, 3], [1, 4, 10]
    ]  # fmt: skip
    assert found.faces.tolist() == [[0, 1, 2], [3, 4, 5]]


# --- geometry -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("geometry", "volume"),
    [
        ("Sphere { radius 3 }", 4 / 3 * math.pi * 27),
        ("Cone { bottomRadius 2 height 7 }", math.pi * 4 * 7 / 3),
        ("Cylinder { radius 2 height 7 }", math.pi * 4 * 7),
        ("Box { size 2 3 7 }", 42),
    ],
)
def test_solids(geometry: str, volume: float, tmp_path: Path) -> None:
    """They are closed, seen from outside, and a little within the round one, which is said."""
    found = read(tmp_path, shape(geometry))
    mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    if geometry.startswith("Box"):
        assert np.isclose(mesh.volume, volume)
        assert not found.notes
    else:
        assert 0.995 * volume < mesh.volume < volume
        assert f"{SIDES} sides" in found.notes[0]


@pytest.mark.parametrize(
    ("fields", "area"),
    [
        ("Cone { bottomRadius 3 height 4 bottom FALSE }", math.pi * 3 * 5),
        ("Cone { bottomRadius 3 height 4 side FALSE }", math.pi * 9),
        ("Cylinder { radius 3 height 4 bottom FALSE top FALSE }", math.pi * 6 * 4),
        ("Cylinder { radius 3 height 4 side FALSE top FALSE }", math.pi * 9),
        ("Cylinder { radius 3 height 4 side FALSE bottom FALSE }", math.pi * 9),
    ],
)
def test_parts_of_solids(fields: str, area: float, tmp_path: Path) -> None:
    found = measures(corners(read(tmp_path, shape(fields))))
    assert np.isclose(found.area, area, rtol=3e-3)
    if "side FALSE" in fields:
        level = 2.0 if "bottom FALSE" in fields else -2.0
        assert found.bounds[:, 1].tolist() == [level, level]
        assert found.normal[1] * level > 0


@pytest.mark.parametrize(
    "geometry",
    [
        "IndexedFaceSet { %s coord Coordinate { point [ 0 0 0, 1 0 0, 0 3 0, 1 4 2 ] }"
        " coordIndex [ 0 1 2 -1 1 3 2 ] }",
        "ElevationGrid { %s xDimension 2 zDimension 3 height [ 1 2 4, 0 7 3 ] }",
        "Extrusion { %s }",
    ],
)
def test_clockwise_faces_are_turned(geometry: str, tmp_path: Path) -> None:
    """ccw FALSE says that what looks clockwise is seen from outside."""
    one = corners(read(tmp_path, shape(geometry % "ccw TRUE")))
    other = corners(read(tmp_path, shape(geometry % "ccw FALSE")))
    assert (other[:, ::-1] == one).all()


def test_a_mirror_keeps_the_outside_outside(tmp_path: Path) -> None:
    found = read(tmp_path, f"Transform {{ scale -1 2 3 children {shape('Box { }')} }}")
    assert np.isclose(measures(corners(found)).volume, 8 * 6)


@given(
    center=VECTOR,
    axis=VECTOR.filter(any),
    angle=NUMBER,
    scale=st.tuples(*[st.floats(0.1, 5)] * 3),
    scale_axis=VECTOR.filter(any),
    scale_angle=NUMBER,
    translation=VECTOR,
    point=VECTOR,
)
def test_transform(
    center: tuple[float, ...],
    axis: tuple[float, ...],
    angle: float,
    scale: tuple[float, ...],
    scale_axis: tuple[float, ...],
    scale_angle: float,
    translation: tuple[float, ...],
    point: tuple[float, ...],
) -> None:
    """Step by step, with SciPy's rotations, in the order of VRML97, 6.52."""

    def turn(axis: tuple[float, ...], angle: float) -> Rotation:
        return Rotation.from_rotvec(np.array(axis) / np.linalg.norm(axis) * angle)

    wanted = np.subtract(point, center)
    wanted = turn(scale_axis, scale_angle).inv().apply(wanted) * scale
    wanted = turn(axis, angle).apply(turn(scale_axis, scale_angle).apply(wanted))
    wanted = wanted + center + translation
    matrix = pose(
        np.array(center),
        np.array([*axis, angle]),
        np.array(scale),
        np.array([*scale_axis, scale_angle]),
        np.array(translation),
    )
    points = np.array([point, (0, 0, 0)])
    found = transform(matrix, points)
    assert np.allclose(found[0], wanted, atol=1e-9)
    assert np.allclose(
        transform(product(matrix, matrix), points), transform(matrix, found), atol=1e-8
    )


def test_an_axis_of_no_length_turns_nothing(tmp_path: Path) -> None:
    found = read(tmp_path, f"Transform {{ rotation 0 0 0 2 children {TRIANGLE} }}")
    assert found.vertices.tolist() == [[0.5, 0, 0], [3, 0.25, 0], [0, 2, 7]]


# --- extrusions ---------------------------------------------------------------------------------


@given(st.lists(VECTOR, min_size=2, max_size=8))
def test_planes_are_turned_and_nothing_else(points: list[tuple[float, ...]]) -> None:
    """At each point three axes of length 1, at right angles, and right-handed."""
    for plane in planes_along(np.array(points)):
        assert np.allclose(plane @ plane.T, np.eye(3), atol=1e-6)
        assert np.linalg.det(plane) > 0


@given(st.lists(VECTOR, min_size=4, max_size=8, unique=True))
def test_closed_spines_end_as_they_begin(points: list[tuple[float, ...]]) -> None:
    """Though on the way round the z axis may have come to point the other way."""
    planes = planes_along(np.array([*points, points[0]]))
    assert (planes[0] == planes[-1]).all()


@given(st.lists(VECTOR, min_size=4, max_size=8, unique=True))
def test_closed_spines_may_begin_anywhere(points: list[tuple[float, ...]]) -> None:
    """Planes are those of the points, but for a half turn, as z goes on from that of the first."""
    spine = np.array(points)
    behind, before = np.roll(spine, -1, axis=0) - spine, np.roll(spine, 1, axis=0) - spine
    sines = np.linalg.norm(np.cross(behind, before), axis=1)
    sines /= np.linalg.norm(behind, axis=1) * np.linalg.norm(before, axis=1)
    one = planes_along(np.vstack((spine, spine[:1])))[:-1]
    other = np.roll(planes_along(np.vstack((spine[1:], spine[:2])))[:-1], 1, axis=0)
    bent = sines > 1e-4
    if bent.any():
        assert np.allclose(one[..., 1], other[..., 1])
    turns = np.abs((one[bent][..., 2] * other[bent][..., 2]).sum(axis=1))
    assert np.allclose(turns, 1)


@given(st.lists(VECTOR, min_size=3, max_size=7, unique=True), st.data())
def test_a_point_twice_changes_nothing(
    points: list[tuple[float, ...]], data: st.DataObject
) -> None:
    """Points that coincide have one plane (VRML97, 6.18.3)."""
    spine = np.array(points)
    at = data.draw(st.integers(0, len(points) - 1))
    planes = planes_along(spine)
    assert (planes_along(np.insert(spine, at, spine[at], axis=0)) == np.insert(
        planes, at, planes[at], axis=0
    )).all()  # fmt: skip


def test_a_full_turn_in_place_makes_a_ball(tmp_path: Path) -> None:
    """Half a disc turned about its straight side, at points that all coincide."""
    angles = np.linspace(0, math.pi, 33)
    section = np.column_stack((np.sin(angles), np.cos(angles))) * 2
    steps = np.linspace(0, 2 * math.pi, 65)
    turns = np.column_stack((0 * steps, 0 * steps, 0 * steps + 1, steps))
    mesh = extrusion(section, np.zeros((65, 3)), NO_SCALE, turns, False, False)
    found = measures(mesh.vertices[mesh.faces])
    assert np.allclose(found.bounds, [[-2] * 3, [2] * 3], atol=1e-9)
    assert np.isclose(abs(found.volume), 4 / 3 * math.pi * 8, rtol=0.01)


def test_closed_extrusions_are_closed() -> None:
    """Without caps where they end as they began; if caps are wanted, the standard adds them."""
    spine = np.array([(0, 0, 0), (4, 0, 0), (5, 3, 1), (0, 3, 0), (0, 0, 0)], float)
    mesh = extrusion(KITE, spine, NO_SCALE, NO_TURN, False, False)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).is_watertight
    capped = extrusion(KITE, spine, NO_SCALE, NO_TURN, True, True)
    assert len(capped.faces) == len(mesh.faces) + 2 * 2
    mesh = extrusion(KITE, spine[:-1], NO_SCALE, NO_TURN, True, True)
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert whole.is_watertight
    assert whole.is_winding_consistent
    assert whole.volume > 0


def test_a_ring_has_the_volume_of_pappus() -> None:
    """Area of the section times the path of its centre."""
    angles = np.linspace(0, 2 * math.pi, 721)
    spine = np.column_stack((7 * np.cos(angles), 7 * np.sin(angles), 0 * angles))
    spine[-1] = spine[0]
    mesh = extrusion(KITE, spine, NO_SCALE, NO_TURN, False, False)
    area = 0.8 * 1.2 / 2
    # x of the section points to the inside or the outside of the ring, by its first segments
    centre = 0.2 / 3
    volume = abs(measures(mesh.vertices[mesh.faces]).volume)
    wanted = [2 * math.pi * (7 + side * centre) * area for side in (-1, 1)]
    assert np.isclose(wanted, volume, rtol=1e-4).any()


@pytest.mark.parametrize("name", ["scale", "orientation"])
def test_too_few_values_of_an_extrusion(name: str, tmp_path: Path) -> None:
    values = "1 1, 2 2" if name == "scale" else "0 0 1 0, 0 0 1 1"
    text = f"Extrusion {{ spine [ 0 0 0, 0 1 0, 1 2 0 ] {name} [ {values} ] }}"
    with pytest.raises(Exception, match=f'2:18: .* 2 values of "{name}" for 3 points'):
        read(tmp_path, shape(text))


# --- nodes in nodes -----------------------------------------------------------------------------


def test_a_name_given_twice_is_the_last_one(tmp_path: Path) -> None:
    text = f"DEF T {TRIANGLE} DEF T Group {{ children [ USE T ] }} USE T"
    assert len(read(tmp_path, text).faces) == 3


def test_scripts_may_point_at_what_they_lie_in(tmp_path: Path) -> None:
    """Nothing of a Script is seen."""
    found = read(
        tmp_path,
        'DEF R Transform { children [ DEF S Script { directOutput TRUE url "javascript:"'
        "  field SFNode own USE S field SFNode root USE R"
        f"  field SFNode more {TRIANGLE} eventIn SFBool go eventOut SFVec3f out }} ]"
        f"  ROUTE S.out TO R.translation }} {TRIANGLE}",
    )
    assert len(found.faces) == 1


def test_files_that_are_not_seen_are_not_missed(tmp_path: Path) -> None:
    """An Inline stops reading only where it would show."""
    assert read(
        tmp_path,
        f'LOD {{ level [ {TRIANGLE} Inline {{ url "far.wrl" }} ] }}'
        ' Switch { choice [ Inline { url "x.wrl" } ] }',
    ).faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(("which", "count"), [(0, 1), (1, 2), (2, 0), (-1, 0), (-2, 0), (-3, 0)])
def test_what_a_switch_shows(which: int, count: int, tmp_path: Path) -> None:
    """One of its choices, or none."""
    two = f"Group {{ children [ {TRIANGLE} {TRIANGLE} ] }}"
    switch = f"Switch {{ choice [ {TRIANGLE} {two} ] whichChoice {which} }}"
    assert len(read(tmp_path, f"{TRIANGLE} {switch}").faces) == 1 + count


def test_what_is_left_out_is_counted(tmp_path: Path) -> None:
    """Points, lines and texts; lights and sensors are nothing to look at."""
    lines = "IndexedLineSet { coord Coordinate { point [ 0 0 0 1 1 1 ] } coordIndex [ 0 1 -1 ] }"
    found = read(
        tmp_path,
        f"DEF L {shape(lines)} USE L {shape('PointSet { }')} {shape('Text { string [ ] }')}"
        f" PointLight {{ }} Billboard {{ children {TRIANGLE} }} LOD {{ level {TRIANGLE} }}",
    )
    assert len(found.faces) == 2
    assert found.notes == (
        "Left out, as it has no faces: 2 IndexedLineSet, 1 PointSet, 1 Text.",
        "Billboard, which turns to its viewer, as it stands in the file: 1.",
        "LOD, its first and finest level: 1.",
    )


def test_polygons_without_area_are_counted(tmp_path: Path) -> None:
    points = "coord Coordinate { point [ 0 0 0, 4 0 0, 4 3 0, 0 2 0, 9 9 9 ] }"
    found = read(
        tmp_path, shape(f"IndexedFaceSet {{ {points} coordIndex [ 0 1 -1 0 2 1 3 -1 3 2 1 -1 ] }}")
    )
    assert "have no area: 1." in found.notes[0]
    assert "cross themselves" in found.notes[1]
    assert found.vertices.max() == 4  # the vertex that no face has is not there


def test_shapes_may_share_their_points(tmp_path: Path) -> None:
    """Each takes those that it needs."""
    many = " ".join(f"{n} {n * n % 7} {n % 3}," for n in range(1000))
    found = read(
        tmp_path,
        shape(f"IndexedFaceSet {{ coord DEF P Coordinate {{ point [ {many} ] }} }}")
        + "".join(
            shape(f"IndexedFaceSet {{ coord USE P coordIndex [ {n} {n + 5} {n + 1} ] }}")
            for n in (3, 990)
        ),
    )
    assert len(found.vertices) == 6
    assert corners(found)[:, :, 0].tolist() == [[3, 8, 4], [990, 995, 991]]


def test_only_the_first_node_of_a_prototype_is_seen(tmp_path: Path) -> None:
    """The others are there for routes and scripts (VRML97, 4.8.3)."""
    text = f"PROTO A [ ] {{ {TRIANGLE} Shape {{ geometry Box {{ }} }} }}"
    assert len(read(tmp_path, f"{text} A {{ }} DEF B A {{ }} USE B").faces) == 3


def test_a_prototype_in_another_file_is_refused_where_it_is_seen(tmp_path: Path) -> None:
    text = 'EXTERNPROTO Glow [ field SFFloat x ] [ "glow.wrl#Glow" ]'
    look = TRIANGLE.replace("Shape {", "Shape { appearance Glow { x 1 }")
    assert len(read(tmp_path, f"{text} {look} Switch {{ choice Glow {{ }} }}").faces) == 1
    with pytest.raises(ReadError, match="a ProtoInstance stands here"):
        read(tmp_path, f"{text} {look} Glow {{ }}")
