"""VRML97 texts that are none, or too much: a sentence with a line and a column, and no more."""

from __future__ import annotations

import gzip
import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.errors import ReadError
from terratool.importing.vrml import parse, scene
from terratool.importing.vrml.scene import read_vrml
from tests.vrml import HEADER, TRIANGLE, read

DEEP = 100_000


def refusal(folder: Path, data: bytes) -> str:
    """What is said of a file that cannot be read; both sentences are there."""
    path = folder / "t.wrl"
    path.write_bytes(data)
    with pytest.raises(ReadError) as caught:
        read_vrml(path)
    error = caught.value
    assert error.message.startswith(f"{path}:")
    assert error.message.endswith(".")
    assert error.hint.endswith((".", "?"))
    assert "\n" not in str(error)
    return str(error).removeprefix(f"{path}:")


HEADS = {
    b"": "1:1: the file is empty",
    b"#VRML V1.0 ascii\nSeparator { }": " no node in it has a surface",
    b"#VRML V1.0 ascii\nSeparator { Cube { width [ ] } }": '2:26: "width" is no SFFloat',
    b"#VRML V1.0 ascii\nSeparator { IndexedFaceSet { coordIndex 0 } }": "2:41: there is no point 0",
    b"#VRML V1.0 ascii\nSeparator { WWWInline { } }": "2:13: the Inline lies in another file",
    b"#VRML V1.0 ascii\nCube { parts (SIDES": '2:6: the "{" here is never closed',
    b"#VRML V1.0\nCube { }": "1:1: the file begins neither with",
    b"#X3D V9.0 utf8\nGroup { }": "1:1: the file begins neither with",
    b"#VRML V2.0 utf16\n": "1:1: the file begins neither with",
    b"#VRML V2.0 utf8x\n": "1:1: the file begins neither with",
    b" " + HEADER.encode() + TRIANGLE.encode(): "1:1: the file begins neither with",
    b"solid cube\n": "1:1: the file begins neither with",
    bytes(range(256)) * 99: "1:1: the file begins neither with",
    gzip.compress(b"#VRML V1.0 ascii\n"): " no node in it has a surface",
    gzip.compress((HEADER + TRIANGLE).encode())[:-9]: " is broken gzip",
    gzip.compress((HEADER + TRIANGLE).encode())[:20]: " is broken gzip",
    b"\x1f\x8b rubbish": " is broken gzip",
    HEADER.encode(): " no node in it has a surface",
}


@pytest.mark.parametrize(("data", "wanted"), HEADS.items(), ids=range(len(HEADS)))
def test_other_files(data: bytes, wanted: str, tmp_path: Path) -> None:
    assert refusal(tmp_path, data).startswith(wanted)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="cannot be read"):
        read_vrml(tmp_path / "none.wrl")
    with pytest.raises(ReadError, match="cannot be read"):
        read_vrml(tmp_path)


FACES = (
    "Shape { geometry IndexedFaceSet { coord Coordinate { point [\n%s ] } coordIndex [\n%s ] } }"
)
POINTS, CORNERS = "0 0 0, 1 0 0, 0 1 0", "0 1 2 -1"
TEXTS = {
    "USE Foo": '2:1: no node before this USE is called "Foo"',
    "DEF Hill Group { } USE Hil": 'Did you mean "Hill"?',
    "DEF A Group { children USE A }": '2:24: USE of "A" within the node of that name',
    "Transfrom { }": '2:1: VRML97 has no node "Transfrom"',
    "Group { children\n Transfrom { } }": 'Did you mean "Transform"?',
    "Separator { }": " no node in it has a surface. Left out, as nodes of these kinds",
    "Group { childern [ ] }": '2:9: Group has no field "childern". Did you mean "children"?',
    "Group { children }": '2:18: a value is missing; there is "}"',
    "Group { children [ 3 ] }": '2:18: "children" is no MFNode',
    "Shape { geometry [ Box { } Box { } ] }": '2:18: "geometry" is no SFNode',
    "Shape { geometry 'Box' }": "2:18: VRML97 has no node",
    "Box { size TRUE }": '2:12: "size" is no SFVec3f. Write numbers.',
    "Box { size 1 2 }": '2:12: "size" has 2 numbers, and not 3',
    "Box { size 1 2 3 4 }": '2:12: "size" has 4 numbers, and not 3',
    "Box { size [ ] }": '2:12: "size" is no SFVec3f',
    "Cylinder { top 1 }": '2:16: "top" is no SFBool. Write TRUE or FALSE.',
    "Cylinder { top true }": "2:16: VRML97 has no node",
    "Switch { whichChoice 0.5 }": '2:22: "0.5" is no integer of 32 bits',
    FACES % ("0 0 0, 1 0 0, 0 1", CORNERS): '2:60: "point" has 8 numbers',
    FACES % (POINTS, "0 1 # 7\n 3 -1"): "5:2: there is no point 3; the last one is 2.",
    FACES % ("", CORNERS): "4:1: there is no point 0; there are none.",
    FACES % (POINTS, "0 1 2.5 -1"): '4:5: "2.5" is no integer',
    FACES % (POINTS, "0 1 3000000000 -1"): '4:5: "3000000000" is no integer',
    FACES % ("0 0 nan", CORNERS): '3:5: "nan" is no number',
    FACES % ("NaN 0 0", CORNERS): '3:1: "NaN" is no number',
    FACES % ("0 -inf 0", CORNERS): '3:3: "-inf" is no number',
    FACES % ("0 1e400 0", CORNERS): "3:3: 1e400 is too large",
    FACES % ("0 Box { }", CORNERS): '3:3: "Box" is no number',
    FACES % (POINTS, CORNERS) + "}": '4:15: a node is missing; there is "}"',
    (FACES % (POINTS, CORNERS))[:-1]: '2:7: the "{" here is never closed',
    FACES[:60] % (): '2:60: the "[" here is never closed',
    "Shape { geometry IndexedFaceSet { coord Box { } } }": '"coord" is a Box and no Coordinate',
    'WorldInfo { title "abc }': "2:19: the string that begins here has no end",
    'WorldInfo { title "abc\\" }': "2:19: the string that begins here has no end",
    "Group ": '2:7: "{" behind Group is missing; there is the end of the file',
    "DEF": "2:4: the name behind DEF is missing",
    "ROUTE a.b c.d": '2:1: the ROUTE has no "TO"',
    'Group { children [\n Inline { url "a.wrl" } ] }': "3:2: the Inline lies in another file",
    'EXTERNPROTO X [ field SFInt32 x ] "x.wrl"\n X { x 1 }': "3:2: a ProtoInstance stands here",
    "PROTO A [ field SFVec3f x 1 2 ] { Box { size IS x } }\n A { }": '2:27: "size" has 2 numbers',
    "PROTO A [ ] { Group { } ": '2:13: the "{" here is never closed',
    "PROTO A [ field SFNode x": "2:25: a value is missing",
    "PROTO A [ ] { A { } } A { }": " no node in it has a surface. Left out",
    "A { } PROTO A [ ] { Box { } }": " no node in it has a surface. Left out",
    "PROTO A [ ] { USE B } DEF B Box { } A { }": '2:15: no node before this USE is called "B"',
    "Box { size IS x }": "2:12: VRML97 has no node",
    "Shape { geometry ElevationGrid { xDimension 3 zDimension 2 height [ 1 2 3 ] } }": (
        "2:18: the ElevationGrid of 3 × 2 has 3 heights"
    ),
    "ElevationGrid { xDimension -3 zDimension -1 height [ 1 2 3 ] }": "2:1: the ElevationGrid of",
    "ElevationGrid { xDimension 2000000000 zDimension 2000000000 }": "2:1: the ElevationGrid of",
    "Transform { scale 1e200 1 1 children " * 2 + TRIANGLE + "} }": (
        "the coordinates of the IndexedFaceSet become too large"
    ),
    "Shape { geometry PointSet { } }": " no node in it has a surface. Left out, as it has no faces",
    "\0\0\0": "2:1: a node is missing",
    "é { }": " no node in it has a surface. Left out, as nodes of these kinds are not read: 1 é",
    "# é\n# é\rDEF é Group { } é": '4:17: VRML97 has no node "é"',
}


@pytest.mark.parametrize(("text", "wanted"), TEXTS.items(), ids=range(len(TEXTS)))
def test_broken_texts(text: str, wanted: str, tmp_path: Path) -> None:
    said = refusal(tmp_path, (HEADER + text).encode())
    assert said.startswith(wanted) if wanted[0] in " 23456789" else wanted in said


def test_every_beginning_of_a_text(tmp_path: Path) -> None:
    """A file that was cut off is refused, wherever; the whole one is read."""
    text = (
        f'WorldInfo {{ title "a\\"b" info [ "x" "y" ] }} DEF G Group {{ children ['
        f" Transform {{ children DEF T {TRIANGLE} translation 0x1 2e0 3. }} ] }}"
    )
    assert len(read(tmp_path, text).faces) == 1
    for end in range(len(text) - 1):
        refusal(tmp_path, (HEADER + text[:end]).encode())


WORDS = [
    "DEF", "USE", "A", "Group", "{", "}", "[", "]", "children", "Shape", "geometry", "1", "-1",
    "0x", "1e", "#", "\n", '"', "IS", "PROTO", "field", "SFNode", "NULL", "TRUE", "Coordinate",
    "IndexedFaceSet", "coord", "point", "coordIndex", "0 0 0 1 1 1 2 0 0", "0 1 2", "Script",
    "ROUTE", "TO", "Switch", "choice", "whichChoice", "EXTERNPROTO", "Extrusion", "spine", "é",
    TRIANGLE,
]  # fmt: skip


@given(words=st.lists(st.sampled_from(WORDS), max_size=40))
def test_any_words(words: list[str], tmp_path_factory: pytest.TempPathFactory) -> None:
    """They are read or refused, and nothing else happens."""
    path = tmp_path_factory.getbasetemp() / "words.wrl"
    path.write_text(HEADER + " ".join(words), encoding="utf-8")
    try:
        assert len(read_vrml(path).faces)
    except ReadError as error:
        assert error.hint


def test_any_bytes_in_a_good_text(tmp_path: Path) -> None:
    """One byte or a few of it changed, left out, or doubled."""
    text = (
        f"DEF T {TRIANGLE} Transform {{ rotation 0 1 0 .5 children [ USE T"
        " Shape { geometry IndexedFaceSet { coord Coordinate { point"
        " [ 0 0 0, 1 2 3, 4 5 6, 7 8 8 ] } coordIndex [ 0 1 2 -1 0 2 3 -1 ] } }"
        " Shape { geometry Extrusion { } } ] }"
    ).encode()
    path = tmp_path / "t.wrl"
    rng = random.Random(5)
    refused = 0
    for _ in range(400):
        data = bytearray(text)
        for _ in range(rng.randint(1, 3)):
            at = rng.randrange(len(data))
            data[at : at + rng.randint(0, 2)] = bytes(
                rng.choice([rng.randrange(256), *b'{}[]"# 0.']) for _ in range(rng.randint(0, 2))
            )
        path.write_bytes(HEADER.encode() + data)
        try:
            read_vrml(path)
        except ReadError:
            refused += 1
    assert 100 < refused < 400


# --- too much -----------------------------------------------------------------------------------


@pytest.mark.nightly
def test_deep_nodes(tmp_path: Path) -> None:
    """No depth is too much, neither of nodes nor of the lists between them."""
    text = "Group{children[" * DEEP + TRIANGLE + "]}" * DEEP
    assert len(read(tmp_path, text).faces) == 1


def test_deep_transforms(tmp_path: Path) -> None:
    text = "Transform{translation 1 0 -2 children " * 5000 + TRIANGLE + "}" * 5000
    assert read(tmp_path, text).vertices.tolist() == [
        [5000.5, 0, -10000], [5003, 0.25, -10000], [5000, 2, -9993]
    ]  # fmt: skip


@pytest.mark.parametrize(
    "words",
    ["Group{children[", "Group{children[Group{", "Shape{geometry Script{field SFNode x ", "[", "{",
     "Group{children [ [ "],
)  # fmt: skip
def test_deep_and_never_closed(words: str, tmp_path: Path) -> None:
    refusal(tmp_path, (HEADER + words * (DEEP // 5)).encode())


BOMBS = {
    "USE": f"DEF N0 {TRIANGLE}"
    + "".join(f" DEF N{n} Group{{children[USE N{n - 1} USE N{n - 1}]}}" for n in range(1, 60)),
    "USE of nothing": "DEF N0 Group{}"
    + "".join(f" DEF N{n} Group{{children[USE N{n - 1} USE N{n - 1}]}}" for n in range(1, 60)),
    "indices": "DEF A Shape{geometry IndexedFaceSet{coordIndex[" + "-1 " * 9999 + "]}}"
    + " USE A" * 9999,
    "spheres": "DEF A Shape{geometry Sphere{}}" + " USE A" * 9999,
    "extrusion": "Shape{geometry Extrusion{spine[" + "1 2 3 " * 9999 + "]crossSection["
    + "1 2 " * 9999 + "]}}",
}  # fmt: skip


@pytest.mark.parametrize("name", BOMBS)
def test_repeated_without_end(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a smaller limit, so that the test is quick: a small text can ask for any amount."""
    monkeypatch.setattr(scene, "REPEATED", 1_000_000)
    said = refusal(tmp_path, (HEADER + BOMBS[name]).encode())
    assert "USE repeats more than can be read" in said


@pytest.mark.parametrize("times", [2, 30])
def test_prototypes_of_prototypes(
    times: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of two instances of the one before; a smaller limit makes the test quick."""
    monkeypatch.setattr(parse, "EXPANDED", 10_000)
    text = f"PROTO P0 [ ] {{ {TRIANGLE} }}"
    for n in range(times):
        text += f" PROTO P{n + 1} [ ] {{ Group {{ children [ P{n} {{ }} P{n} {{ }} ] }} }}"
    text += f" P{times} {{ }}"
    if times == 2:
        assert len(read(tmp_path, text).faces) == 4
    else:
        assert "prototypes are written out to more than" in refusal(
            tmp_path, (HEADER + text).encode()
        )


@pytest.mark.nightly
@pytest.mark.parametrize(
    "node",
    [
        "Group { }",
        "Transform { rotation 1 1 0 1 scale 1 2 3 scaleOrientation 1 1 1 1 children [ %s ] }",
        "Shape { geometry Extrusion { spine [ 0 0 0, 0 1 0, 1 2 0 ] } }",
        "Shape { geometry Box { } }",
    ],
    ids=["groups", "poses", "extrusions", "boxes"],
)
def test_a_small_text_is_given_up_soon(
    node: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 2 to the power of 40 nodes so many are visited as take a second, whatever they are."""
    visits = []
    visit = scene._SceneWalker.visit
    monkeypatch.setattr(
        scene._SceneWalker, "visit", lambda self, place: visits.append(1) or visit(self, place)
    )
    inner = "DEF N0 " + node.replace("%s", "")
    around = node if "%s" in node else "Group { children [ %s ] }"
    for n in range(40):
        inner += f" DEF N{n + 1} " + around.replace("%s", f"USE N{n} USE N{n}")
    assert "repeats more than can be read" in refusal(tmp_path, (HEADER + inner).encode())
    heavy = 0 if node == "Group { }" else 60_000
    assert len(visits) < (heavy or 200_000)


def test_what_is_written_out_is_never_too_much(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scene, "REPEATED", 0)
    many = f"{TRIANGLE} Group {{ children [ {TRIANGLE} ] }}" * 50
    heights = " ".join(map(str, range(35)))
    grid = f"ElevationGrid {{ xDimension 5 zDimension 7 height [ {heights} ] }}"
    assert len(read(tmp_path, f"{many} Shape {{ geometry {grid} }}").faces) == 100 + 2 * 4 * 6
