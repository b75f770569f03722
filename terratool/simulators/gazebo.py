"""Gazebo: a model of one static link, and a world with it; or a picture of heights."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

from terratool.report.numbers import metres, never_quite, per_cent
from terratool.report.wording import count_of
from terratool.simulators.heightmap import HeightMap, write_heightmap
from terratool.simulators.level_solids import LevelSolid
from terratool.simulators.markup import child, comment, numbers, one_line, rgba, write_xml
from terratool.simulators.pieces import Contacts, write_contacts
from terratool.simulators.scene import Material, Scene
from terratool.simulators.targets import WrittenFiles

_VERSION = "1.7"
"""Version of SDFormat, which Ignition Citadel and all later ones read."""
_PICTURE = "heights.png"
_STEP = 0.001
"""Time step of the world's physics, s."""


def write(scene: Scene, folder: Path) -> WrittenFiles:
    """Write a model, a world, and an OBJ for each surface or a picture of heights."""
    if scene.options.heightmap:
        scene = scene.ground
    model = ET.Element("model", name=scene.name)
    if scene.terrain.descr:
        comment(model, scene.terrain.descr)
    child(model, "static", "true")
    link = child(model, "link", name="terrain")
    if scene.options.heightmap:
        written = _add_heightmap(scene, link, folder)
    else:
        written = _add_meshes(scene, link, folder)
    root = ET.Element("sdf", version=_VERSION)
    root.append(model)
    write_xml(root, folder / "model.sdf")
    write_xml(_config(scene), folder / "model.config")
    write_xml(_world(scene, model), folder / "world.sdf")
    return written


_LOAD = ("gz sim world.sdf   # Fortress and before: ign gazebo world.sdf",)
_NOTES = (
    "`world.sdf` opens as it is: a sun, gravity, and the terrain. Into a world of yours the terrain"
    " comes by `<include><uri>model://gazebo</uri></include>`, `gazebo` being the name of this"
    " folder; say where it lies: `export GZ_SIM_RESOURCE_PATH=$(dirname $PWD)`"
    " (`IGN_GAZEBO_RESOURCE_PATH` for Fortress and before).",
)
_RETRO = (
    "`laser_retro` is the `sonarRefl` of the surface, 0 to 1, where it has one: what part of a"
    " sound comes back. For light it is a stand-in.",
)
_UNREAD = (
    "Gazebo Sim with DART, its default, takes the friction of {} for 1, whatever the file says, and"
    " of two bodies the lower friction counts: give wheels that of the ground. Gazebo Classic reads"
    " what the file says."
)


def _add_meshes(scene: Scene, link: ET.Element, folder: Path) -> WrittenFiles:
    """Add a visual for each surface, and collisions: boxes, cylinders, and what is left of it."""
    contacts = write_contacts(scene, folder)
    place = f"{numbers(scene.offset)} 0 0 0"
    for surface in contacts.surfaces:
        one = surface.material
        comment(link, f"surface {one.name}: friction {one.friction:.4g}, {one.derivation}")
        if surface.file is not None:
            geometry = _add_collision(link, f"{surface.name}/mesh", place, one)
            child(child(geometry, "mesh"), "uri", surface.file)
        for solid in surface.solids:
            pose = f"{numbers(solid.center(scene))} 0 0 {solid.shape.turn:.9g}"
            _add_shape(_add_collision(link, solid.name, pose, one), solid.shape)
        visual = child(link, "visual", name=f"{surface.name}/visual")
        child(visual, "pose", place)
        child(child(child(visual, "geometry"), "mesh"), "uri", surface.seen)
        _add_color(visual, one)
    faces = len(scene.mesh.faces)
    return WrittenFiles(
        summary=f"a mesh for each of {count_of(len(contacts.surfaces), 'surface')} is seen, of"
        f" {count_of(faces, 'face')} together; {contacts.summary} to collide with",
        language="sh",
        load=_LOAD,
        notes=(
            *_NOTES,
            "Each surface has files of its own: Gazebo Sim takes the whole of a file for a"
            " collision, whatever `<submesh>` says.",
            *contacts.note,
            *_RETRO,
        ),
        losses=tuple(_mesh_losses(contacts)),
        facts={"faces": faces, **contacts.facts},
    )


def _mesh_losses(contacts: Contacts) -> Iterator[str]:
    """Yield sentences on meshes that collide, if there are any."""
    if contacts.faces:
        part = f" ({never_quite(contacts.meshed)} of the ground, and walls)" * contacts.reduced
        yield _UNREAD.format(f"meshes{part}")
    yield from contacts.losses


def _add_collision(link: ET.Element, name: str, pose: str, one: Material) -> ET.Element:
    """Add a collision of a material to a link, and return its geometry, to be filled."""
    shape = child(link, "collision", name=name)
    child(shape, "pose", pose)
    geometry = child(shape, "geometry")
    _add_contact(shape, one)
    return geometry


def _add_shape(geometry: ET.Element, shape: LevelSolid) -> None:
    length, width, height = shape.size
    if shape.is_round:
        cylinder = child(geometry, "cylinder")
        child(cylinder, "radius", numbers([0.5 * length]))
        child(cylinder, "length", numbers([height]))
    else:
        child(child(geometry, "box"), "size", numbers((length, width, height)))


def _add_color(shape: ET.Element, one: Material) -> None:
    material = child(shape, "material")
    color = rgba(one.color)
    child(material, "ambient", color)
    child(material, "diffuse", color)
    child(material, "specular", "0 0 0 1")


def _add_contact(shape: ET.Element, one: Material) -> None:
    if one.reflectivity is not None:
        child(shape, "laser_retro", f"{one.reflectivity:.6g}")
    friction, value = child(child(shape, "surface"), "friction"), f"{one.friction:.6g}"
    ode = child(friction, "ode")
    child(ode, "mu", value)
    child(ode, "mu2", value)
    bullet = child(friction, "bullet")
    child(bullet, "friction", value)
    child(bullet, "friction2", value)
    torsional = child(friction, "torsional")
    child(torsional, "coefficient", value)


def _add_heightmap(scene: Scene, link: ET.Element, folder: Path) -> WrittenFiles:
    """Add a picture of heights that is seen and collides."""
    found = write_heightmap(scene.terrain, folder / _PICTURE)
    west, south, east, north = scene.terrain.bounds
    size = east - west, north - south, found.range
    x, y, _ = scene.offset
    middle = x + 0.5 * size[0], y + 0.5 * size[1], found.low - scene.zero[2]
    one = scene.material(found.surface)
    for kind in ("collision", "visual"):
        shape = child(link, kind, name=f"heights_{kind}")
        # physics of Gazebo Sim reads <pose> alone, its rendering <pos> alone
        collides = kind == "collision"
        if collides:
            child(shape, "pose", f"{numbers(middle)} 0 0 0")
        heightmap = child(child(shape, "geometry"), "heightmap")
        child(heightmap, "uri", _PICTURE)
        child(heightmap, "size", numbers(size))
        child(heightmap, "pos", numbers((0.0, 0.0, 0.0) if collides else middle))
        _add_contact(shape, one) if collides else _add_color(shape, one)
    return WrittenFiles(
        summary=f"a picture of {found.side} × {found.side} heights",
        language="sh",
        load=_LOAD,
        notes=(
            *_NOTES,
            "The place of the picture is in the `<pose>` of the collision and in the `<pos>` of the"
            " visual, as Gazebo Sim reads them; Gazebo Classic wants both in `<pos>`.",
            *_RETRO,
        ),
        losses=tuple(_picture_losses(scene, found, one, size)),
        facts={
            "heightmap": {
                "side": found.side,
                "size": list(size),
                "step": found.range / 255,
                "rms_error": found.rms,
                "max_error": found.worst,
                "void": found.void,
            }
        },
        meshed=False,
        frictions=(one,),
    )


def _picture_losses(
    scene: Scene, found: HeightMap, one: Material, size: tuple[float, float, float]
) -> list[str]:
    step = found.range / 255
    lines = [
        *scene.terrain.hidden,
        f"Heights are in steps of {metres(step)}, from 8 bits, at every"
        f" {metres(size[0] / (found.side - 1))} × {metres(size[1] / (found.side - 1))}; walls"
        " become slopes.",
        f"At {count_of(found.points, 'random point')} they are {metres(found.rms)} off (root mean"
        f" square), and {metres(found.worst)} at most.",
    ]
    if found.void:
        lines.append(
            f"The void, {per_cent(found.void, 2)} of the area, is ground at {metres(found.low)}."
        )
    if len(scene.used_materials(False)) > 1:
        lines.append(
            f"All of it has the friction and colour of {one.name}, which covers most of it."
        )
    off = 0.5 * max(size[:2]) / found.side
    lines.append(
        f"DART takes a side for {found.side} spaces, not {found.side - 1}: towards the border its"
        f" heights lie up to {metres(off)} too near to the middle."
    )
    lines.append(_UNREAD.format("height maps"))
    return lines


def _config(scene: Scene) -> ET.Element:
    root = ET.Element("model")
    child(root, "name", scene.name)
    child(root, "version", "1.0")
    child(root, "sdf", "model.sdf", version=_VERSION)
    child(root, "description", one_line(scene.terrain.descr or scene.name))
    return root


def _world(scene: Scene, model: ET.Element) -> ET.Element:
    """Return a world that holds the model, so that no path has to be set to open it."""
    root = ET.Element("sdf", version=_VERSION)
    world = child(root, "world", name=scene.name)
    physics = child(world, "physics", name="steps", type="ode")
    child(physics, "max_step_size", _STEP)
    child(physics, "real_time_factor", 1)
    child(world, "gravity", "0 0 -9.81")
    look = child(world, "scene")
    child(look, "ambient", "0.4 0.4 0.4 1")
    child(look, "background", "0.7 0.8 0.9 1")
    sun = child(world, "light", name="sun", type="directional")
    child(sun, "cast_shadows", "true")
    child(sun, "pose", "0 0 100 0 0 0")
    child(sun, "diffuse", "0.8 0.8 0.8 1")
    child(sun, "specular", "0.2 0.2 0.2 1")
    child(sun, "direction", "-0.5 0.3 -0.9")
    world.append(model)
    return root
