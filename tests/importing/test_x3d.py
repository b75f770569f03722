"""X3D in both of its texts: what VRML97 says in its words, and what only X3D has."""

from __future__ import annotations

import gzip
import re
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.errors import ReadError
from terratool.importing.meshes import read_triangles
from terratool.importing.sources import open_source
from terratool.importing.types import SourceOptions
from terratool.importing.vrml.scene import read_vrml, up_axis_of
from terratool.mesh.export import write_mesh
from tests.commands import ROOT, SAMPLE, run
from tests.programs import program
from tests.viewers import oblong, output
from tests.vrml import TRIANGLE, corners, saved

PROLOGUE = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<!DOCTYPE X3D PUBLIC "ISO//Web3D//DTD X3D 3.3//EN" '
    '"http://www.web3d.org/specifications/x3d-3.3.dtd">\n'
)
POINTS = "0 0 0, 4 0 1, 4 3 1, 2 1 .5, 0 3 0, 0 0 5"
FACE = f"<IndexedFaceSet coordIndex='0 1 2'><Coordinate point='{POINTS}'/></IndexedFaceSet>"
SHAPE = f"<Shape>{FACE}</Shape>"


def scene(body: str, head: str = "") -> bytes:
    """An X3D file with nodes in its scene."""
    text = f"{PROLOGUE}<X3D profile='Interchange' version='3.3'>{head}<Scene>{body}</Scene></X3D>"
    return text.encode()


def read(folder: Path, data: bytes, name: str = "t.x3d") -> np.ndarray:
    """The corners of the triangles in a file, (m, 3, 3)."""
    path = folder / name
    path.write_bytes(data)
    return corners(read_vrml(path))


def refusal(folder: Path, data: bytes, name: str = "t.x3d") -> str:
    """What is said of a file that cannot be read; both sentences are there, on one line."""
    path = folder / name
    path.write_bytes(data)
    with pytest.raises(ReadError) as caught:
        read_triangles(path)
    error = caught.value
    assert error.message.endswith(".")
    assert error.hint.endswith((".", "?"))
    assert str(error).isprintable()
    assert len(str(error)) < 500
    return str(error).removeprefix(f"{path}:")


SAME = {
    "face set": (SHAPE, "IndexedFaceSet { coord C coordIndex [ 0 1 2 ] }"),
    "a concave face, clockwise": (
        f"<Shape><Appearance><Material diffuseColor='1 0 0'/></Appearance><IndexedFaceSet "
        f"ccw='false' convex='false' coordIndex='0 1 2 3 4 -1 0 5 1'><Coordinate point='{POINTS}'/>"
        "</IndexedFaceSet></Shape>",
        "IndexedFaceSet { ccw FALSE convex FALSE coord C coordIndex [ 0 1 2 3 4 -1 0 5 1 ] }",
    ),
    "grid of heights": (
        "<Shape><ElevationGrid xDimension='3' zDimension='4' xSpacing='2' zSpacing='.5'"
        " height='1 2 4 0 7 3 1 9 2 5 5 1'><Color color='1 1 1'/></ElevationGrid></Shape>",
        "ElevationGrid { xDimension 3 zDimension 4 xSpacing 2 zSpacing .5"
        " height [ 1 2 4 0 7 3 1 9 2 5 5 1 ] }",
    ),
    "box": ("<Shape><Box size='1 2 5'/></Shape>", "Box { size 1 2 5 }"),
    "cone without a bottom": (
        "<Shape><Cone bottomRadius='2' height='3' bottom='false'/></Shape>",
        "Cone { bottomRadius 2 height 3 bottom FALSE }",
    ),
    "extrusion": (
        "<Shape><Extrusion spine='0 0 0 0 2 0 1 4 0' scale='1 1 2 1 1 1' endCap='false'/></Shape>",
        "Extrusion { spine [ 0 0 0, 0 2 0, 1 4 0 ] scale [ 1 1 2 1 1 1 ] endCap FALSE }",
    ),
}


@pytest.mark.parametrize("name", SAME)
def test_as_vrml97_has_it(name: str, tmp_path: Path) -> None:
    """The same node in a Transform of a Transform, in three texts: the same triangles."""
    xml, vrml = SAME[name]
    vrml = vrml.replace("coord C", f"coord Coordinate {{ point [ {POINTS} ] }}")
    inner = "translation='1 -2 3' rotation='1 2 3 0.7' center='1 0 2' scale='1 2 -.5'"
    outer = "scaleOrientation='0 1 1 0.4' scale='3 1 1'"
    xml = f"<Transform {outer}><Group><Transform {inner}>{xml}</Transform></Group></Transform>"
    fields = re.sub(r"='([^']*)'", r" \1 ", f"{outer} children Group {{ children Transform {{ ")
    fields += re.sub(r"='([^']*)'", r" \1 ", inner)
    classic = f"Transform {{ {fields} children Shape {{ geometry {vrml} }} }} }} }}"
    wanted = corners(read_vrml(saved(tmp_path, classic)))
    assert np.array_equal(read(tmp_path, scene(xml)), wanted)
    text = b"#X3D V3.3 utf8\nPROFILE Interchange\n" + classic.encode()
    assert np.array_equal(read(tmp_path, text, "t.x3dv"), wanted)


QUAD = [(0, 0, 0), (4, 0, 1), (4, 3, 1), (2, 1, 0.5), (0, 3, 0), (0, 0, 5)]
SETS = {
    "<IndexedTriangleSet index='0 1 2 3 4 5 0'>C</IndexedTriangleSet>": [(0, 1, 2), (3, 4, 5)],
    "<IndexedTriangleSet index='0 1 2' ccw='false'>C</IndexedTriangleSet>": [(2, 1, 0)],
    "<TriangleSet>C</TriangleSet>": [(0, 1, 2), (3, 4, 5)],
    # 11.4.10: of every second triangle the first two corners change places
    "<IndexedTriangleStripSet index='5 0 1 2 -1 3 4 0 -1'>C</IndexedTriangleStripSet>": [
        (5, 0, 1), (1, 0, 2), (3, 4, 0),
    ],
    "<TriangleStripSet stripCount='4'>C4</TriangleStripSet>": [(0, 1, 2), (2, 1, 3)],
    "<TriangleStripSet stripCount='3 3'>C</TriangleStripSet>": [(0, 1, 2), (3, 4, 5)],
    "<IndexedTriangleFanSet index='0 1 2 4 -1 5 1 2'>C</IndexedTriangleFanSet>": [
        (0, 1, 2), (0, 2, 4), (5, 1, 2),
    ],
    "<TriangleFanSet fanCount='6'>C</TriangleFanSet>": [
        (0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5),
    ],
    "<IndexedQuadSet index='0 1 2 4'>C</IndexedQuadSet>": [(0, 1, 2), (0, 2, 4)],
    "<QuadSet>C4</QuadSet>": [(0, 1, 2), (0, 2, 3)],
}  # fmt: skip


@pytest.mark.parametrize(("node", "faces"), SETS.items(), ids=lambda x: str(x)[1:25])
def test_sets_of_triangles(node: str, faces: list[tuple[int, ...]], tmp_path: Path) -> None:
    """Corner for corner, as ISO/IEC 19775-1, 11.4, has it; both kinds of Coordinate."""
    four = " ".join(POINTS.replace(",", "").split()[:12])
    node = node.replace("C4", f"<CoordinateDouble point='{four}'/>")
    node = node.replace(">C<", f"><Coordinate point='{POINTS}'/><")
    found = read(tmp_path, scene(f"<Shape>{node}</Shape>"))
    assert np.array_equal(found, np.array(QUAD, float)[np.array(faces)])


@pytest.mark.parametrize("counts", ["2 4", "3", "3 4", "-3 9", "2147483647 2147483647", "0 6"])
def test_counts_that_do_not_fit(counts: str, tmp_path: Path) -> None:
    node = f"<TriangleFanSet fanCount='{counts}'><Coordinate point='{POINTS}'/></TriangleFanSet>"
    assert "fanCount" in refusal(tmp_path, scene(f"<Shape>{node}</Shape>"))


def test_nodes_used_again(tmp_path: Path) -> None:
    """A shape, the points of a face set, and a group are each in two places."""
    body = f"""
      <Group DEF='G'><Transform translation='10 0 0'><Shape DEF='S'>
        <IndexedFaceSet coordIndex='0 1 2'><Coordinate DEF='P' point='{POINTS}'/></IndexedFaceSet>
      </Shape></Transform></Group>
      <Transform translation='0 100 0'><Group USE='G'/></Transform>
      <Shape USE='S'/>
      <Shape><IndexedFaceSet coordIndex='4 3 2'><Coordinate USE='P'/></IndexedFaceSet></Shape>
    """
    found = read(tmp_path, scene(body))
    points = np.array(QUAD, float)
    first, other = points[[0, 1, 2]], points[[4, 3, 2]]
    east, up = np.array([10, 0, 0]), np.array([0, 100, 0])
    assert np.array_equal(found, [first + east, first + east + up, first, other])


def test_a_name_given_twice_is_the_last_one(tmp_path: Path) -> None:
    body = "<Shape DEF='A'><Box/></Shape><Shape DEF='A'><Cone/></Shape><Shape USE='A'/>"
    assert len(read(tmp_path, scene(body))) == 12 + 2 * 128


def test_what_is_seen_and_what_is_not(tmp_path: Path) -> None:
    """Of a Switch its choice, of a LOD the finest; proxies, prototypes and scripts are not seen."""
    body = f"""
      <Switch whichChoice='1'><Shape><Cone/></Shape><Shape><Box/></Shape></Switch>
      <Switch><Shape><Cone/></Shape></Switch>
      <LOD range='9'><Shape><Box/></Shape><Shape><Cone/></Shape></LOD>
      <Collision><Shape containerField='proxy'><Sphere/></Shape><Shape><Box/></Shape></Collision>
      <ProtoDeclare name='P'><ProtoBody><Shape><Box/></Shape></ProtoBody></ProtoDeclare>
      <Script><field name='f' type='SFNode' accessType='inputOutput'>{SHAPE}</field></Script>
      <CADLayer><CADPart translation='1 2 3'><CADFace><Shape><Box/></Shape></CADFace></CADPart>
      </CADLayer><StaticGroup><Shape><Box/></Shape></StaticGroup>
      <ROUTE fromNode='a' fromField='b' toNode='c' toField='d'/>
    """
    assert len(read(tmp_path, scene(body))) == 5 * 12


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    path = tmp_path / "t.x3d"
    shapes = "<Shape><GeoElevationGrid/></Shape><Shape><IndexedLineSet/></Shape>"
    path.write_bytes(scene(f"{SHAPE}{shapes}<HAnimHumanoid>{SHAPE}</HAnimHumanoid><Viewpoint/>"))
    found = read_vrml(path)
    assert len(found.faces) == 1
    assert found.notes == (
        "Left out, as it has no faces: 1 IndexedLineSet.",
        "Left out, as nodes of these kinds are not read: 1 GeoElevationGrid, 1 HAnimHumanoid.",
    )


EFFECT = (
    'appearance Appearance { effects Effect { language "GLSL" initializeOnly SFFloat k 1.1'
    " inputOutput SFNode t NULL inputOnly SFBool b inputOutput SFNode around USE S"
    ' parts EffectPart { type "FRAGMENT" } } }'
)


@pytest.mark.parametrize("head", ["#X3D V3.3 utf8", "#VRML V2.0 utf8"])
def test_unknown_nodes_are_passed_over_with_the_fields_that_they_declare(
    head: str, tmp_path: Path
) -> None:
    text = f"{head}\nDEF S {TRIANGLE.replace('Shape {', f'Shape {{ {EFFECT}')}"
    text += " ColorSetInterpolator { key [ 0 1 ] more Deep { x [ 1 2 ] } } USE S"
    path = tmp_path / "t.x3dv"
    path.write_text(text)
    found = read_vrml(path)
    wanted = corners(read_vrml(saved(tmp_path, TRIANGLE)))
    assert corners(found).tolist() == np.concatenate([wanted, wanted]).tolist()
    assert found.notes == (
        "Left out, as nodes of these kinds are not read: "
        "1 Effect, 1 EffectPart, 1 ColorSetInterpolator, 1 Deep.",
    )


def test_shaders_with_declared_fields_need_no_note(tmp_path: Path) -> None:
    shader = EFFECT.replace("effects Effect", "shaders ComposedShader").replace("Effect", "Shader")
    path = tmp_path / "t.x3dv"
    path.write_text(f"#X3D V3.3 utf8\nDEF S {TRIANGLE.replace('Shape {', f'Shape {{ {shader}')}")
    assert read_vrml(path).notes == ()


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("t.x3d", scene(SHAPE, "<head><unit category='length' name='foot' "
                        "conversionFactor='0.3048'/></head>")),
        ("t.x3dv", f"#X3D V4.0 utf8\nPROFILE Immersive COMPONENT Geometry3D:2\nMETA \"a\" \"b\"\n"
                   f"UNIT length foot 0.3048 EXPORT A AS B\n{TRIANGLE}".encode()),
    ],
)  # fmt: skip
def test_lengths_become_metres(name: str, data: bytes, tmp_path: Path) -> None:
    plain = scene(SHAPE) if name == "t.x3d" else b"#X3D V3.0 utf8\n" + TRIANGLE.encode()
    wanted = read(tmp_path, plain, name) * 0.3048
    assert np.allclose(read(tmp_path, data, name), wanted, rtol=1e-15)
    assert read_vrml(tmp_path / name).notes == ("Lengths are in foot; metres were made of them.",)
    data = data.replace(b"length", b"angle")
    assert "angles are in foot" in refusal(tmp_path, data, name)


def test_nodes_of_the_classic_text(tmp_path: Path) -> None:
    """Those that VRML97 does not have, and the words of X3D for fields of a Script."""
    text = (
        "#X3D V3.3 utf8\nScript { initializeOnly SFVec3f size 1 1 1 inputOutput SFDouble d 2 }"
        " Shape { appearance Appearance { material PhysicalMaterial { } }"
        " geometry Box { size 2 4 6 solid FALSE } } TimeSensor { }"
    )
    found = read(tmp_path, text.encode(), "t.x3dv")
    assert found.min(axis=(0, 1)).tolist() == [-1, -2, -3]


# --- there and back ------------------------------------------------------------------------------


def test_what_is_written_comes_back_vertex_for_vertex(tmp_path: Path) -> None:
    """A mesh that is symmetric in no way, in single precision as it is written; z stays up."""
    mesh = oblong()
    (path,) = write_mesh(mesh, tmp_path / "t.x3d", descr='y "z" <b> ')
    found = read_triangles(path)
    assert up_axis_of(path) == "z"
    assert found.notes == ()
    points = np.asarray(mesh.vertices, np.float32)

    def listed(triangles: np.ndarray) -> list[list[tuple[float, ...]]]:
        """Each from its least corner on, in the same sense."""
        rows = [[tuple(corner) for corner in triangle] for triangle in triangles.tolist()]
        turns = [row.index(min(row)) for row in rows]
        return sorted(row[k:] + row[:k] for row, k in zip(rows, turns, strict=True))

    assert listed(corners(found).astype(np.float32)) == listed(points[mesh.faces])


@pytest.mark.slow
@pytest.mark.parametrize("sample", ["nested-site", "wheel-tracks"])
def test_a_terrain_is_the_same_in_vrml_and_x3d(sample: str, tmp_path: Path) -> None:
    for suffix in ("wrl", "x3d"):
        out = tmp_path / f"t.{suffix}"
        terrain = ROOT / "samples" / f"{sample}.json"
        assert run("export-mesh", terrain, out, "--max-error", "0.5").code == 0
    one, other = (read_triangles(tmp_path / f"t.{suffix}") for suffix in ("wrl", "x3d"))
    assert np.array_equal(one.vertices, other.vertices)
    assert np.array_equal(one.faces, other.faces)


def test_y_is_up_unless_the_file_says_otherwise(tmp_path: Path) -> None:
    path = tmp_path / "t.x3d"
    path.write_bytes(scene(SHAPE))
    found = read_triangles(path)
    assert found.vertices[found.faces[0]].tolist() == [[0, 0, 0], [4, -1, 0], [4, -1, 3]]
    assert any("y up" in note for note in found.notes)
    path.write_bytes(scene(SHAPE, "<head><meta name='up' content='z'/></head>"))
    found = read_triangles(path)
    assert found.vertices[found.faces[0]].tolist() == [[0, 0, 0], [4, 0, 1], [4, 3, 1]]


@pytest.mark.slow
def test_x3d_is_a_source_of_imports(tmp_path: Path) -> None:
    mesh, out = tmp_path / "t.x3d", tmp_path / "t.json"
    assert run("export-mesh", SAMPLE, mesh, "--max-error", "1").code == 0
    assert run("import-terrain", mesh, out, "--max-error", "0.5", "--resolution", "5").code == 0


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ["xml", "classic"])
@pytest.mark.parametrize("sample", ["stairs-and-kerbs", "nested-site"])
def test_castle_writes_the_same_in_x3d(sample: str, encoding: str, tmp_path: Path) -> None:
    """What Castle Game Engine makes of our VRML97 has the triangles that this has."""
    path = tmp_path / "t.wrl"
    terrain = ROOT / "samples" / f"{sample}.json"
    assert run("export-mesh", terrain, path, "--max-error", "0.5").code == 0
    text = output(program("tovrmlx3d"), path, f"--encoding={encoding}")
    name = "other.x3d" if encoding == "xml" else "other.x3dv"
    if encoding == "classic":
        text = text.replace(text.splitlines()[0], "#X3D V3.3 utf8", 1)
    found = read(tmp_path, text.encode(), name)
    assert np.allclose(found, corners(read_vrml(path)), rtol=1e-6, atol=1e-6)


# --- strangers -----------------------------------------------------------------------------------

LAUGHS = "".join(
    f'<!ENTITY a{n + 1} "{f"&a{n};" * 10}">' for n in range(9)
)  # 10 to the power of 9 laughs
BROKEN = {
    "billion laughs": (
        f'<!DOCTYPE X3D [<!ENTITY a0 "lol">{LAUGHS}]><X3D><Scene><Group DEF="&a9;"/></Scene></X3D>',
        "the file declares or uses entities of its own",
    ),
    "an empty internal subset": ("<!DOCTYPE X3D [ ]><X3D/>", "declares or uses entities"),
    "an external entity": (
        '<!DOCTYPE X3D [<!ENTITY x SYSTEM "file:///etc/passwd">]><X3D><Scene>&x;</Scene></X3D>',
        "declares or uses entities",
    ),
    "a parameter entity": (
        '<!DOCTYPE X3D [<!ENTITY % x SYSTEM "http://127.0.0.1:9/x"> %x;]><X3D/>',
        "declares or uses entities",
    ),
    "an entity of a document type elsewhere": (
        '<!DOCTYPE X3D SYSTEM "other.dtd"><X3D><Scene>&x;</Scene></X3D>',
        "declares or uses entities",
    ),
    "another root": ("<svg><X3D/></svg>", '1:1: the file begins with "svg"'),
    "no XML": ("<X3D><Scene></X3D>", "1:15: this is no well-formed XML (mismatched tag)"),
    "nothing in it": ("<X3D/>", "no node in it has a surface"),
    "a node within itself": (
        "<X3D><Scene>\n<Group DEF='A'><Group USE='A'/></Group></Scene></X3D>",
        '2:16: USE of "A" within the node of that name',
    ),
    "an unknown name": ("<X3D><Scene><Group DEF='Hill'/><Group USE='Hil'/></Scene></X3D>",
                        'Did you mean "Hill"?'),
    "another file": ("<X3D><Scene><Inline url='a.x3d'/></Scene></X3D>", "the Inline lies in"),
    "an instance": ("<X3D><Scene><ProtoInstance name='Hill'/></Scene></X3D>",
                    "1:13: a ProtoInstance stands here, and its prototype is not read"),
    "a huge grid": (
        "<X3D><Scene><Shape><ElevationGrid xDimension='2000000000' zDimension='2000000000'/>"
        "</Shape></Scene></X3D>",
        "1:20: the ElevationGrid of 2,000,000,000 × 2,000,000,000 has 0 heights",
    ),
    "no number": (SHAPE.replace("0 0 5", "0 0 O"), 'in "point" "O" is no number'),
    "not a number": (SHAPE.replace("0 0 5", "0 0 nan"), 'in "point" "nan" is no number'),
    "a number too large": (SHAPE.replace("0 0 5", "0 0 1e999"), 'in "point" 1e999 is too large'),
    "a number and more": (SHAPE.replace("0 0 5", "0 0 5#"), "is no number"),
    "a number missing": (SHAPE.replace(", 0 0 5", ", 0 0"), '"point" has 17 numbers'),
    "half a corner": (SHAPE.replace("'0 1 2'", "'0 1 2.5'"), '"2.5" is no integer'),
    "no such point": (SHAPE.replace("'0 1 2'", "'0 1 6'"), "there is no point 6; the last one"),
    "no such triangle": (
        SHAPE.replace("IndexedFaceSet coordIndex", "IndexedTriangleSet index")
        .replace("/IndexedFaceSet", "/IndexedTriangleSet").replace("'0 1 2'", "'0 1 6'"),
        "there is no point 6",
    ),
    "neither true nor false": (SHAPE.replace("Set coord", "Set ccw='yes' coord"), '"ccw" is no'),
    "a misspelt field": (
        f"<Transform Translation='1 2 3'>{SHAPE}</Transform>",
        'Transform has no field "Translation". Did you mean "translation"?',
    ),
    "no vector": (f"<Transform translation='1 2'>{SHAPE}</Transform>", '"translation" has 2'),
    "an empty vector": (f"<Transform translation=''>{SHAPE}</Transform>", '"translation" is no'),
    "two geometries": ("<Shape><Box/><Box/></Shape>", '"geometry" is no SFNode'),
    "points of another kind": (
        "<Shape><IndexedFaceSet coordIndex='0 1 2'><Color containerField='coord'/>"
        "</IndexedFaceSet></Shape>", '"coord" is a Color and no Coordinate',
    ),
    "too large to place": (
        "<Transform scale='1e200 1 1'>" * 2 + SHAPE + "</Transform>" * 2,
        "become too large",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files(name: str, tmp_path: Path) -> None:
    text, wanted = BROKEN[name]
    data = text.encode() if text.startswith(("<X3D", "<!", "<svg")) else scene(text)
    said = refusal(tmp_path, data)
    assert said.startswith(wanted) if wanted[:1].isdigit() else wanted in said


def test_no_file_is_opened_but_the_one_that_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither the document type nor what lies beside it."""
    (tmp_path / "x3d-3.3.dtd").write_text('<!ENTITY x "no">')
    monkeypatch.chdir(tmp_path)
    opened: list[str] = []
    real = open

    def watched(path: object, *args: object, **more: object) -> object:
        opened.append(str(path))
        return real(path, *args, **more)  # type: ignore[call-overload]

    monkeypatch.setattr("builtins.open", watched)
    data = scene(SHAPE).replace(b"http://www.web3d.org/specifications/", b"")
    assert len(read(tmp_path, data)) == 1
    assert {Path(name).name for name in opened} <= {"t.x3d"}


@pytest.mark.nightly
def test_nodes_a_hundred_thousand_deep(tmp_path: Path) -> None:
    deep = 100_000
    found = read(tmp_path, scene("<Group>" * deep + SHAPE + "</Group>" * deep))
    assert len(found) == 1
    refusal(tmp_path, scene("<Group>" * deep))


def test_used_without_end(tmp_path: Path) -> None:
    """2 to the power of 40 boxes in 2 kB."""
    body = "<Shape DEF='N0'><Box/></Shape>"
    for n in range(40):
        body += f"<Group DEF='N{n + 1}'><Group USE='N{n}'/><Group USE='N{n}'/></Group>"
    assert "repeats more than can be read" in refusal(tmp_path, scene(body))


def test_every_beginning_of_a_file(tmp_path: Path) -> None:
    """A file that was cut off is refused, wherever."""
    data = scene(f"<Group DEF='G'>{SHAPE}</Group><Group USE='G'/>")
    assert len(read(tmp_path, data)) == 2
    for end in range(len(data)):
        refusal(tmp_path, data[:end])


def test_other_encodings(tmp_path: Path) -> None:
    """XML says in which it is."""
    data = scene(f"<!-- Löß -->{SHAPE}").decode()
    wanted = read(tmp_path, data.encode())
    for encoding in ("utf-16", "iso-8859-1", "utf-16-le", "utf-16-be"):
        other = data.replace("UTF-8", encoding).encode(encoding)
        assert np.array_equal(read(tmp_path, other), wanted)


@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_texts_in_utf_16(encoding: str, mark: str, tmp_path: Path) -> None:
    """What they say of themselves is read, faults are where an editor has them."""
    head = "<head><meta name='up' content='z'/></head>"
    data = scene(SHAPE, head).decode().replace("UTF-8", "UTF-16")
    path = tmp_path / "t.x3d"
    path.write_bytes((mark + data).encode(encoding))
    assert up_axis_of(path) == "z"
    fault = data.replace("0 0 5", "0 0 O").replace("<Scene>", "<Scene>\n<!-- Löß 🚜 --> ")
    said = refusal(tmp_path, (mark + fault).encode(encoding))
    assert said.startswith("4:") and 'in "point" "O" is no number' in said
    laughs = '<!DOCTYPE X3D [<!ENTITY a "b">]><X3D/>'
    assert "declares or uses entities" in refusal(tmp_path, (mark + laughs).encode(encoding))
    for broken in (b"\0", "\ud800".encode(encoding, "surrogatepass")):
        said = refusal(tmp_path, (mark + data).encode(encoding) + broken)
        assert "begins as UTF-16, and is none" in said and "UTF-8" in said
    words = f"{mark}#X3D V3.3 utf8\n{TRIANGLE}".encode(encoding)
    if mark:
        assert len(read(tmp_path, words, "t.x3dv")) == 1
    else:
        assert "begins neither" in refusal(tmp_path, words, "t.x3dv")


@pytest.mark.parametrize(
    ("name", "data"),
    [("t.x3dz", scene(SHAPE)), ("t.x3dvz", b"#X3D V3.0 utf8\n" + TRIANGLE.encode())],
)
def test_packed_files(name: str, data: bytes, tmp_path: Path) -> None:
    """By gzip, as its standard has it (ISO/IEC 19776-3); they are sources of imports."""
    plain = tmp_path / name.removesuffix("z")
    plain.write_bytes(data)
    path = tmp_path / name
    path.write_bytes(gzip.compress(data, mtime=0))
    assert np.array_equal(read_triangles(path).vertices, read_triangles(plain).vertices)
    up = SourceOptions(up="z")
    with open_source(str(path), up) as source, open_source(str(plain), up) as other:
        assert np.array_equal(
            source.read(0, source.grid.rows), other.read(0, other.grid.rows), equal_nan=True
        )
    path.write_bytes(gzip.compress(data)[:-9])
    assert "broken gzip" in refusal(tmp_path, path.read_bytes(), name)


def test_packed_texts_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A bomb is given up at the bound, before it fills the memory; long lists of zeros are not."""
    bound = 1 << 20
    monkeypatch.setattr("terratool.text.packing.PLENTY", bound)
    whole = scene(SHAPE)
    for size in (bound, bound + 1):
        data = gzip.compress(whole.replace(b"</Scene>", b"</Scene>" + b" " * (size - len(whole))))
        assert len(data) * 100 < bound
        if size == bound:
            assert len(read(tmp_path, data, "t.x3dz")) == 1
        else:
            said = refusal(tmp_path, data, "t.x3dz")
            assert "comes to more than 100 times its size. Unpack it" in said
    bomb = gzip.compress(b"\0" * (1 << 27))
    tracemalloc.start()
    refusal(tmp_path, bomb, "t.wrz")
    assert tracemalloc.get_traced_memory()[1] < 1 << 25
    tracemalloc.stop()


PARTS = [
    "<Group>", "</Group>", "<Group", " DEF='A'", " USE='A'", ">", "/>", "<Shape>", "</Shape>",
    "<Box/>", SHAPE, "<IndexedFaceSet", " coordIndex='0 1 2'", "<Coordinate", " point='0 0 0'",
    "<!--", "-->", "<![CDATA[", "]]>", "&lt;", "&#0;", "&x;", "<?x?>", "<Switch", "\0", "é", "<",
    " whichChoice='0'", " containerField='proxy'", "<Scene>", "</Scene>", "<X3D>", "<head>",
]  # fmt: skip


@given(parts=st.lists(st.sampled_from(PARTS), max_size=30))
def test_any_parts(parts: list[str], tmp_path_factory: pytest.TempPathFactory) -> None:
    """They are read or refused, and nothing else happens."""
    path = tmp_path_factory.getbasetemp() / "parts.x3d"
    path.write_bytes(scene("".join(parts)))
    try:
        assert len(read_vrml(path).faces)
    except ReadError as error:
        assert error.hint
