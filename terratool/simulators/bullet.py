"""PyBullet: a URDF with a link for each surface: boxes, cylinders, and triangles elsewhere."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from terratool.report.wording import count_of
from terratool.simulators.level_solids import LevelSolid
from terratool.simulators.markup import child, comment, numbers, rgba, write_xml
from terratool.simulators.pieces import write_contacts
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
    contacts = write_contacts(scene, folder)
    place = numbers(scene.offset)
    for surface in contacts.surfaces:
        one = surface.material
        comment(robot, f"surface {one.name}: friction {one.friction:.4g}, {one.derivation}")
        link = child(robot, "link", name=surface.name)
        _add_zero_mass(link)
        child(child(link, "contact"), "lateral_friction", value=f"{one.friction:.6g}")
        visual = child(link, "visual", name=f"{surface.name}/visual")
        child(visual, "origin", xyz=place, rpy="0 0 0")
        child(child(visual, "geometry"), "mesh", filename=surface.seen)
        child(child(visual, "material", name=surface.name), "color", rgba=rgba(one.color))
        if surface.file is not None:
            # PyBullet takes the convex hull of a mesh that is not marked as concave
            shape = child(link, "collision", name=f"{surface.name}/mesh", concave="yes")
            child(shape, "origin", xyz=place, rpy="0 0 0")
            child(child(shape, "geometry"), "mesh", filename=surface.file)
        for solid in surface.solids:
            shape = child(link, "collision", name=solid.name)
            center = numbers(solid.center(scene))
            child(shape, "origin", xyz=center, rpy=f"0 0 {solid.shape.turn:.9g}")
            _add_shape(child(shape, "geometry"), solid.shape)
        joint = child(robot, "joint", name=f"{surface.name}/joint", type="fixed")
        child(joint, "parent", link=_ROOT)
        child(joint, "child", link=surface.name)
    write_xml(robot, folder / _FILE)
    faces = len(scene.mesh.faces)
    flags = _ROUND * bool(contacts.cylinders)
    return WrittenFiles(
        summary=f"{count_of(len(contacts.surfaces), 'link')}, seen as {count_of(faces, 'face')};"
        f" {contacts.summary} to collide with",
        language="python",
        load=(
            "import pybullet  # pip install pybullet",
            "pybullet.connect(pybullet.DIRECT)",
            "pybullet.setPhysicsEngineParameter(enableFileCaching=0)",
            f'terrain = pybullet.loadURDF("{_FILE}", useFixedBase=1{flags})',
        ),
        notes=(*_NOTES, *contacts.note, *(_CYLINDERS,) * bool(contacts.cylinders)),
        losses=(
            "PyBullet multiplies the friction of two bodies: give lateralFriction 1 to bodies that"
            " the friction of the ground alone is to act on (theirs is 0.5 by default).",
            *(_HOLLOW,) * bool(contacts.faces),
            *contacts.losses,
        ),
        facts={
            "links": [surface.name for surface in contacts.surfaces],
            "faces": faces,
            **contacts.facts,
        },
    )


_ROUND = ", flags=pybullet.URDF_USE_IMPLICIT_CYLINDER"
_CYLINDERS = (
    "Without `URDF_USE_IMPLICIT_CYLINDER` PyBullet takes a prism of 32 sides for a cylinder, whose"
    " sides are up to 0.5 % of the radius too near to its axis."
)
_HOLLOW = (
    "The faces of meshes have no inside: a body that a step of the simulation takes through them"
    " falls on. Keep speed times time step below the size of the body."
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


def _add_shape(geometry: ET.Element, shape: LevelSolid) -> None:
    length, width, height = shape.size
    if shape.is_round:
        child(geometry, "cylinder", radius=numbers([0.5 * length]), length=numbers([height]))
    else:
        child(geometry, "box", size=numbers((length, width, height)))
