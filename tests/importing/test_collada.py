"""COLLADA: parts in their places, units and axes, and what lies elsewhere or multiplies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from terratool.errors import ReadError
from terratool.importing import collada
from terratool.importing.meshes import read_triangles
from tests.importing.test_meshes import (
    FACES,
    PART,
    POINTS,
    as_set,
    corners_of,
    dae,
    refused,
    same,
)

Z_UP = "<up_axis>Z_UP</up_axis>"
TENT = corners_of("triangles")


def put(folder: Path, nodes: str = f"<node>{PART}</node>", asset: str = Z_UP, **how: Any) -> Path:
    path = folder / "tent.dae"
    path.write_text(dae(how.pop("geometry", TENT), nodes, asset, **how))
    return path


@pytest.mark.parametrize(
    ("axis", "points", "note"),
    [
        ("X_UP", [(z, -x, -y) for x, y, z in POINTS], "its y points west, and its z south."),
        ("Y_UP", [(x, z, -y) for x, y, z in POINTS], "x stays east, and its z points south."),
        ("Z_UP", POINTS, ""),
    ],
)
def test_the_axis_of_the_file_counts(axis: str, points: Any, note: str, tmp_path: Path) -> None:
    path = put(tmp_path, asset=f"<up_axis> {axis}\n</up_axis>", points=points)
    found = read_triangles(path)
    assert same(found)
    assert all(said.endswith(note) for said in found.notes)
    assert len(found.notes) == bool(note)
    assert same(read_triangles(path, up="z"), points)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("", 1),
        ('<unit name="inch" meter="0.0254"/>', 0.0254),
        ("<unit/>", 1),
        ('<unit meter="1e3"/>', 1000),
    ],
)
def test_the_unit_of_the_file_counts(unit: str, factor: float, tmp_path: Path) -> None:
    found = read_triangles(put(tmp_path, asset=unit + Z_UP))
    assert same(found, np.multiply(POINTS, factor))
    assert any("metres were made of them" in note for note in found.notes) == (factor != 1)


def test_large_coordinates_keep_their_last_digits(tmp_path: Path) -> None:
    points = [(500000.001 + x, 4500000.002 + y, z) for x, y, z in POINTS]
    assert same(read_triangles(put(tmp_path, points=points)), points)


def test_parts_stand_in_their_places(tmp_path: Path) -> None:
    """Transformations apply from the last one on; instances of nodes count as often as they are."""
    nodes = f"""<node><translate>10 -2 3</translate><rotate>1 2 3 40</rotate><scale>1 2 -3</scale>
<node><matrix>0 -1 0 5  1 0 0 6  0 0 1 7  0 0 0 1</matrix>{PART}</node>
<instance_node url="#n"/></node><node>{PART}</node>"""
    library = (
        f"<library_nodes><node id='n'><translate>0 0 9</translate>{PART}</node></library_nodes>"
    )
    found = read_triangles(put(tmp_path, nodes, more=library))
    turn = Rotation.from_rotvec(np.radians(40) * np.array([1, 2, 3]) / np.sqrt(14))

    def outer(points: Any) -> Any:
        return turn.apply(np.multiply(points, (1, 2, -3))) + np.array([10, -2, 3])

    parts = [
        outer([(5 - y, 6 + x, 7 + z) for x, y, z in POINTS]),
        outer([(x, y, z + 9) for x, y, z in POINTS]),
        np.array(POINTS, float),
    ]
    turned = [face[::-1] for face in FACES]  # by the mirror
    wanted = sorted(
        triangle
        for points, faces in zip(parts, (turned, turned, FACES), strict=True)
        for triangle in as_set(points, faces)
    )
    assert as_set(found.vertices, found.faces) == wanted


def test_without_a_scene_all_counts(tmp_path: Path) -> None:
    path = put(tmp_path)
    text = path.read_text()
    path.write_text(text[: text.index("<library_visual")] + "</COLLADA>")
    assert same(read_triangles(path))
    path.write_text(text.replace('<scene><instance_visual_scene url="#s"/></scene>', ""))
    assert same(read_triangles(path))


def test_polygons_are_cut_well_and_holes_are_told(tmp_path: Path) -> None:
    """An L, whose corner would be outside of a fan, and a quadrilateral."""
    points = [
        (0, 0, 1),
        (6, 0, 1),
        (6, 1, 1),
        (1, 1, 1),
        (1, 3, 1),
        (0, 3, 1),
        (8, 0, 1),
        (8, 1, 1),
    ]
    inputs = '<input semantic="VERTEX" source="#v" offset="0"/>'
    faces = f"<polylist>{inputs}<vcount>6 4</vcount><p>0 1 2 3 4 5 1 6 7 2</p></polylist>"
    faces += f"<polygons>{inputs}<ph><p>0 1 2</p><h>3 4 5</h></ph></polygons><lines/>"
    found = read_triangles(put(tmp_path, geometry=faces, points=points))
    a, b, c = np.moveaxis(found.vertices[found.faces], 1, 0)
    assert np.cross(b - a, c - a)[:, 2].min() > 0
    assert np.cross(b - a, c - a)[:, 2].sum() / 2 == pytest.approx(6 + 2 + 2)
    (note,) = found.notes
    assert note.startswith("Parts of the file are no triangles and were left out: ")
    assert "1 of polygons with holes" in note
    assert "1 of lines" in note


def test_a_prefix_and_windows_ends_of_lines(tmp_path: Path) -> None:
    path = put(tmp_path)
    text = path.read_text().replace("xmlns=", "xmlns:c=")
    out = "".join(
        f"<{part}" if part[0] == "?" else f"</c:{part[1:]}" if part[0] == "/" else f"<c:{part}"
        for part in text.split("<")[1:]
    )
    path.write_bytes(out.replace("\n", "\r\n").encode())
    assert same(read_triangles(path))


BROKEN = {
    "another file": (
        f"<node>{PART.replace('#g', 'hill.dae#g')}</node>",
        "lies in another file, 'hill",
    ),
    "a node in another file": (
        '<node><instance_node url="file:///etc/passwd"/></node>',
        "'file:///",
    ),
    "nothing": ("<node/>", "has no faces"),
    "a missing geometry": (f"<node>{PART.replace('#g', '#h')}</node>", "there is no geometry 'h'"),
    "a matrix": (f"<node><matrix>1 2</matrix>{PART}</node>", "cannot be read as COLLADA"),
    "a word": (f"<node><scale>1 x 2</scale>{PART}</node>", "cannot be read as COLLADA"),
    "a skew": (f"<node><skew>45 1 0 0 0 1 0</skew>{PART}</node>", "lookat or skew"),
    "itself": ('<node id="n"><instance_node url="#n"/></node>', "hold each other without end"),
    "nodes": (
        "".join(
            f"<node id='n{n}'>" + 2 * f"<instance_node url='#n{n + 1}'/>" + "</node>"
            for n in range(40)
        )
        + f'<node id="n40">{PART}</node>',
        "hold each other without end, or too often",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_scenes_that_are_refused(name: str, tmp_path: Path) -> None:
    nodes, wanted = BROKEN[name]
    assert wanted in refused(put(tmp_path, nodes)).message


@pytest.mark.parametrize(
    ("old", "new"),
    [("8 4", "8 5"), ("8 4", "8 -1"), ("8 4", "8"), ("8 4", "8 4e12"), ('count="5"', 'count="6"'),
     ('stride="4"', 'stride="0"'), ('source="#a"', 'source="b.dae#a"'), ("#p", "#v"),
     ('name="Z"', ""), ('offset="1"/>', 'offset="-1"/>')],
)  # fmt: skip
def test_meshes_that_are_refused(old: str, new: str, tmp_path: Path) -> None:
    path = put(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    refused(path)


def test_entities_are_refused(tmp_path: Path) -> None:
    path = put(tmp_path)
    text = path.read_text()
    bomb = '<!DOCTYPE COLLADA [<!ENTITY a "7 7 7">]>'
    path.write_text(text.replace("<COLLADA", f"{bomb}<COLLADA", 1))
    assert "entities" in refused(path).message


def test_faces_that_multiply_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terratool.importing.types.MAX_FACES", 7)
    path = put(tmp_path, f"<node>{PART}{PART}</node>")
    with pytest.raises(ReadError, match="more than 7 faces"):
        collada.read_collada(path)
