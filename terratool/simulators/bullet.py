"""PyBullet: a URDF with a link for each surface, which collides with its triangles as they are."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from terratool.report.wording import count_of
from terratool.simulators.boxes import BOXES, box_place, size_of, with_boxes
from terratool.simulators.markup import child, comment, numbers, rgba, write_xml
from terratool.simulators.pieces import write_contacts, write_pieces
from terratool.simulators.scene import Scene
from terratool.simulators.targets import WrittenFiles

_FILE = "terrain.urdf"
_ROOT = "terrain"


def write(scene: Scene, folder: Path) -> WrittenFiles:
    """Write a URDF, and an OBJ for each surface, into a folder."""
    robot = ET.Element("robot", name=scene.name)
    if scene.terrain.descr:
        comment(robot, scene.terrain.descr)
    _add_zero_mass(child(robot, "link", name=_ROOT))
    pieces = write_pieces(scene, folder)
    contacts = write_contacts(scene, folder, pieces)
    place = numbers(scene.offset)
    for (one, file), collides in zip(pieces, contacts, strict=True):
        comment(robot, f"surface {one.name}: friction {one.friction:.4g}, {one.derivation}")
        # the prefix keeps a surface from having the name of the root
        link = child(robot, "link", name=f"surface_{one.word}")
        _add_zero_mass(link)
        contact = child(link, "contact")
        child(contact, "lateral_friction", value=f"{one.friction:.6g}")
        for kind, own in (("visual", file), ("collision", collides.file)):
            if own is None:
                continue
            # PyBullet takes the convex hull of a mesh that is not marked as concave
            shape = child(link, kind, **({"concave": "yes"} if kind == "collision" else {}))
            child(shape, "origin", xyz=place, rpy="0 0 0")
            child(child(shape, "geometry"), "mesh", filename=own)
            if kind == "visual":
                material = child(shape, "material", name=f"surface_{one.word}")
                child(material, "color", rgba=rgba(one.color))
        for box in collides.boxes:
            shape = child(link, "collision")
            child(shape, "origin", xyz=numbers(box_place(scene, box)), rpy=f"0 0 {box.turn:.9g}")
            child(child(shape, "geometry"), "box", size=numbers(size_of(box)))
        joint = child(robot, "joint", name=f"to_{one.word}", type="fixed")
        child(joint, "parent", link=_ROOT)
        child(joint, "child", link=f"surface_{one.word}")
    write_xml(robot, folder / _FILE)
    faces, boxes = len(scene.mesh.faces), len(scene.boxes)
    return WrittenFiles(
        summary=f"{count_of(len(pieces), 'link')} to collide with, of {count_of(faces, 'face')}"
        f"{with_boxes(boxes)}",
        language="python",
        load=(
            "import pybullet  # pip install pybullet",
            "pybullet.connect(pybullet.DIRECT)",
            "pybullet.setPhysicsEngineParameter(enableFileCaching=0)",
            f'terrain = pybullet.loadURDF("{_FILE}", useFixedBase=1)',
        ),
        notes=(*_NOTES, *(BOXES,) * bool(boxes)),
        losses=(
            "PyBullet multiplies the friction of two bodies: give lateralFriction 1 to bodies that"
            " the friction of the ground alone is to act on (theirs is 0.5 by default).",
            "The faces have no inside: a body that a step of the simulation takes through them"
            " falls on. Keep speed times time step below the size of the body.",
        ),
        facts={
            "links": [f"surface_{one.word}" for one, _ in pieces],
            "faces": faces,
            **({"boxes": boxes} if boxes else {}),
        },
    )


_NOTES = (
    "Without the third line PyBullet takes a mesh from its memory where it has read one of the same"
    " path before, be it of another terrain. Gravity is yours to set.",
    "Each surface is a link of its own; `manifest.json` lists them as `links`, from link 0 on, and"
    " a contact or a ray names its link.",
    '`concave="yes"` is PyBullet\'s own; other readers of URDF may take convex hulls.',
)


def _add_zero_mass(link: ET.Element) -> None:
    """Give a link no mass; without that PyBullet assumes one, and says so."""
    inertial = child(link, "inertial")
    child(inertial, "mass", value=0)
    child(inertial, "inertia", ixx=0, ixy=0, ixz=0, iyy=0, iyz=0, izz=0)
