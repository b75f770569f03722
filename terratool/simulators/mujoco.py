"""MuJoCo: an MJCF with convex solids and height fields that collide, and a mesh to be seen."""

from __future__ import annotations

import hashlib
import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.extras import install_command
from terratool.mesh.export import no_ground
from terratool.mesh.formats.common import points_of, shape_of
from terratool.report.numbers import metres
from terratool.report.wording import count_of
from terratool.simulators.collision.build import Collision, CollisionRequest, collision_of
from terratool.simulators.collision.height_patch import SINK, HeightPatch
from terratool.simulators.collision.lattices import UPRIGHT
from terratool.simulators.collision.smooth import SmoothGround, height_fields_of, smooth_ground
from terratool.simulators.collision.solids import BELOW, Solid, base_below, plan_rectangle
from terratool.simulators.markup import child, comment, numbers, rgba, write_xml, xml_text
from terratool.simulators.naming import ContactNames
from terratool.simulators.options import SceneOptions
from terratool.simulators.pieces import file_names
from terratool.simulators.scene import Material, Scene
from terratool.simulators.targets import WrittenFiles

if TYPE_CHECKING:
    import mujoco

_FILE, _INCLUDED = "terrain.xml", "include.xml"
_FINE = 500_000
"""Least faces of the seen mesh that solids are cut from; below, a finer mesh is built."""
_MESH_SHARE = 0.5
"""Share of the solids' error that a mesh may have which is built for cutting."""
_MANY = 1_500_000
"""Most faces of the seen mesh that solids are cut from; above, a coarser mesh is built."""
_COARSEST = 0.02
"""Largest error that solids get from a coarser mesh, in parts of the relief."""
_FACES_A_SECOND = 250
"""Faces of the ground and of storeys, before they are cut, that take a second."""
_SEAM = 10.0
"""Largest reach of a solid into another surface of the same height, in errors."""
_ROLLING = "0.005 0.0001"
"""Torsional and rolling friction: MuJoCo's defaults."""

_ASKED = 64
"""Most cells of a height field whose elements are asked for its name."""

_NEUTRAL: dict[str, dict[str, object]] = {
    "mesh": {"scale": "1 1 1", "inertia": "legacy", "maxhullvert": -1},
    "material": {
        "texture": "", "texrepeat": "1 1", "texuniform": "false", "emission": 0, "specular": 0,
        "shininess": 0, "reflectance": 0, "metallic": -1, "roughness": -1,
    },
    "geom": {
        # axes stand above the euler of another default, whatever unit its angles have
        "pos": "0 0 0", "xyaxes": "1 0 0 0 1 0", "size": "0 0 0",
        "contype": 1, "conaffinity": 1, "condim": 3, "priority": 1, "solmix": 1,
        "solref": "0.02 1", "solimp": "0.9 0.95 0.001 0.5 2", "margin": 0, "gap": 0,
        "mass": 0, "density": 0, "shellinertia": "false", "fluidshape": "none",
        "fluidcoef": "0.5 0.25 1.5 1 1", "hfield": "", "mesh": "", "material": "", "fitscale": 1,
        "group": 3,
    },
}  # fmt: skip
"""Attributes that the defaults of another model could set, by tag: most are MuJoCo's own defaults.
What later versions than 3.2 know is not there, as older ones refuse it."""

_ATTACHED = (
    "Into a model of yours, from anywhere; a prefix keeps names apart:",
    "```python\n"
    'scene = mujoco.MjSpec.from_file("robot.xml")\n'
    f'terrain = mujoco.MjSpec.from_file("{_FILE}")\n'
    'scene.attach(terrain, prefix="ground/", frame=scene.worldbody.add_frame())\n'
    "model = scene.compile()\n"
    "```",
    f'Or write `<include file="{_INCLUDED}"/>` into a model, with the path of this folder before'
    f" it. That attaches `{_FILE}`, so the model's own defaults and folders do not reach it (MuJoCo"
    f" 3.3.5 and newer). With an older one include `{_FILE}` itself, from a model in this folder"
    " without a `meshdir`.",
)
_NAMES = (
    "A geom is called TERRAIN/SURFACE/ELEMENT/NUMBER, such as `{}`, so that contacts can be told"
    " apart; the element is the part or the primitive that stands in the terrain's tree. Its class"
    " is TERRAIN/SURFACE. All geoms are of the world's body: they have no mass."
)
_PRIORITY = (
    " `priority` 1: the friction of the ground counts, whatever a robot says, and so do its"
    " condim, solref and solimp. A geom that needs its own wants `priority` 2."
)
_LAYERS = (
    "Geoms of group 2 are the exact mesh: cameras and rangefinders see it, and nothing collides"
    " with it. What collides is of group 3, which rays pass, as its alpha is 0. To see it:"
    " `model.geom_rgba[model.geom_group == 3, 3] = 1`, and group 3 switched on in the viewer."
    f" It has{_PRIORITY}"
)
_FIELD = (
    "All ground is one grid of heights, so a height field of group 2 is both seen and collided"
    f" with. It has{_PRIORITY}"
)
_FLEXES = (
    "Geoms of group 2 are the exact mesh: cameras and rangefinders see it, and nothing collides"
    " with it. The same mesh collides as rigid flexes of group 3, which are not seen. They have"
    " `priority` 1: the friction of the ground counts, whatever a robot says."
)


def write(scene: Scene, folder: Path) -> WrittenFiles:
    """Write an MJCF, meshes to be seen, and height fields to collide with, into a folder."""

    def save(name: str, chunks: Iterable[bytes]) -> str:
        with open(folder / name, "wb") as file:
            file.writelines(chunks)
        return name

    root, told, own = _model(scene, save)
    write_xml(root, folder / _FILE)
    write_xml(_attaching(scene.name), folder / _INCLUDED)
    return WrittenFiles(
        summary=told.summary,
        language="python",
        load=(
            "import mujoco  # pip install mujoco",
            f'model = mujoco.MjModel.from_xml_path("{_FILE}")',
            "data = mujoco.MjData(model)",
        ),
        notes=(*_ATTACHED, told.note, *told.names),
        losses=told.losses,
        facts={"collision": told.facts},
        meshed=told.frictions is None,
        frictions=told.frictions,
        scene=own,
    )


def _smooth_of(scene: Scene) -> SmoothGround | None:
    """Return the ground where nothing stands upright; None where all is to become solids."""
    options, terrain = scene.options, scene.terrain
    if options.collision == "hfield":
        scene.say("laying height fields")
        patches = height_fields_of(terrain, options.max_error, options.max_geoms)
        return SmoothGround(terrain, [terrain.bounds], [], patches)
    if options.collision == "convex":
        return None
    scene.say("laying height fields where nothing stands upright")
    found = smooth_ground(terrain, options.max_error, options.max_geoms)
    return found if found.solids or found.patches else None


def _beside(scene: Scene, smooth: SmoothGround) -> Scene:
    """Return the scene of the ground beside what height fields and domes stand for.

    Where there are storeys, the mesh of all of it is seen.
    """
    if scene.terrain.storeys is not None:
        return scene
    worn = {surface for patch in smooth.patches for surface in patch.used_surfaces}
    worn |= {solid.surface for solid in smooth.solids}
    return replace(scene, terrain=smooth.terrain, holes=smooth.areas, beside=frozenset(worn))


def mjspec(scene: Scene) -> mujoco.MjSpec:
    """Return the MJCF and its files as a spec in memory.

    Raises:
        RequestError: MuJoCo is not installed, or there is no ground.
    """
    if find_spec("mujoco") is None:
        raise RequestError("MuJoCo is not installed.", f"Run {install_command('mujoco')}")
    from mujoco import MjSpec

    files: dict[str, bytes] = {}

    def save(name: str, chunks: Iterable[bytes]) -> str:
        content = b"".join(chunks)
        # specs that are attached to one another have one store of files
        name = f"{hashlib.sha256(content).hexdigest()}{Path(name).suffix}"
        files[name] = content
        return name

    root, _, _ = _model(scene, save)
    return MjSpec.from_string(xml_text(root), assets=files)


_Save = Callable[[str, Iterable[bytes]], str]
"""Function that keeps a file, given piece by piece, and returns the name that it has then."""


def _model(scene: Scene, save: _Save) -> tuple[ET.Element, _Told, Scene]:
    """Return the MJCF of a scene, an account of it, and the scene whose mesh is seen.

    Files that the MJCF names are saved.
    """
    wanted = scene.options.max_error
    scene = scene.storeys_within(_FACES_A_SECOND * scene.options.max_seconds)
    root = ET.Element("mujoco", model=scene.name)
    if scene.terrain.descr:
        comment(root, scene.terrain.descr)
    model = _Mjcf(scene, save, ET.Element("asset"), ET.Element("worldbody"), set())
    if scene.options.flex:
        _add_visuals(model)
        told = _add_flexes(model)
    elif scene.grid_patch is not None:
        told = _CollisionGeoms(model).add_grid(scene.grid_patch)
    else:
        smooth = _smooth_of(scene)
        if smooth is not None:
            model = model._replace(scene=_beside(scene, smooth))
        if smooth is None or not model.scene.holes or not smooth.is_all:
            _add_visuals(model)
        told = _CollisionGeoms(model).add(smooth)
    if scene.options.max_error > wanted:
        coarse = metres(scene.options.max_error)
        told = told._replace(losses=(
            *told.losses,
            f"Within {metres(wanted)}, decks and bores would take too long, so all is within"
            f" {coarse}: --max-seconds N allows more.",
        ))  # fmt: skip
    root.extend([_defaults(scene, model.worn), model.asset, model.world])
    return root, told, model.scene


class _Mjcf(NamedTuple):
    """A model that is being written.

    Attributes:
        scene: the terrain.
        save: function that keeps a file.
        asset: element of meshes, height fields and materials.
        world: element of the world's body: what is of it weighs nothing, and statistics of the
            model leave it out.
        worn: indices of the surfaces that have a class.
    """

    scene: Scene
    save: _Save
    asset: ET.Element
    world: ET.Element
    worn: set[int]

    def class_of(self, surface: int) -> dict[str, str]:
        """Return the attribute that names the class of a surface, by its index."""
        self.worn.add(surface)
        return {"class": f"{self.scene.name}/{self.scene.material(surface).word}"}

    @property
    def own_class(self) -> dict[str, str]:
        """Attribute that names the class of the whole terrain."""
        return {"class": self.scene.name}

    def place(self, at: Iterable[float]) -> str:
        """Return a place in the coordinates of the mesh as one of the world."""
        return numbers(np.add(self.scene.offset, list(at)).tolist())


def _defaults(scene: Scene, worn: Iterable[int]) -> ET.Element:
    """Return the classes of the terrain: one that leaves nothing to others, and one a surface."""
    default = ET.Element("default")
    whole = child(default, "default", **{"class": scene.name})
    for tag, attributes in _NEUTRAL.items():
        child(whole, tag, **attributes)
    for one in map(scene.material, sorted(worn)):
        own = child(whole, "default", **{"class": f"{scene.name}/{one.word}"})
        child(own, "geom", rgba=_hidden(one), friction=_friction(one))
    return default


def _attaching(name: str) -> ET.Element:
    """Return a model that attaches that of a terrain, by its name."""
    root = ET.Element("mujoco", model=name)
    child(child(root, "asset"), "model", name=name, file=_FILE)
    child(child(root, "worldbody"), "attach", model=name, prefix=f"{name}/")
    return root


class _Told(NamedTuple):
    """Account of what collides.

    Attributes:
        summary: what collides in a few words.
        note: paragraph on what is seen and what collides.
        losses: sentences on its distance from the terrain.
        facts: figures for programs.
        names: paragraph on the names of geoms; none where these are of no elements.
        frictions: materials of what collides; None where a mesh is seen, whose materials count.
    """

    summary: str
    note: str
    losses: tuple[str, ...]
    facts: dict[str, object]
    names: tuple[str, ...] = ()
    frictions: tuple[Material, ...] | None = None


def _add_visuals(model: _Mjcf) -> None:
    """Add a material and a mesh for each surface, to be seen; nothing collides with them."""
    scene = model.scene
    points = points_of(scene.mesh)
    materials = [scene.material(part.surface) for part in scene.parts]
    files = file_names(materials, "msh")
    for part, one, own in zip(scene.parts, materials, files, strict=True):
        name = f"{scene.name}/{one.word}/seen"
        file = model.save(own, _msh(*shape_of(points, part)))
        child(model.asset, "material", name=name, rgba=rgba(one.color), **model.own_class)
        # the mesh is open, so only its faces can have a mass
        child(model.asset, "mesh", name=name, file=file, inertia="shell", **model.own_class)
        child(
            model.world, "geom", name=name, type="mesh", mesh=name, pos=model.place((0, 0, 0)),
            material=name, rgba=rgba(one.color), **_SEEN, **model.class_of(part.surface),
        )  # fmt: skip


_SEEN = {"group": 2, "contype": 0, "conaffinity": 0}
"""Attributes of a geom that is seen, and that nothing collides with."""


def _msh(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> Iterator[bytes]:
    """Yield MuJoCo's binary mesh: counts of vertices, normals, texture points, faces; then these.

    MuJoCo wants four vertices at least, so the first ones are repeated.
    """
    vertices = np.concatenate([vertices, vertices[: max(0, 4 - len(vertices))]])
    yield np.array([len(vertices), 0, 0, len(faces)], "<i4").tobytes()
    yield vertices.astype("<f4").tobytes()
    yield faces.astype("<i4").tobytes()


def _hidden(one: Material) -> str:
    """Return the colour of a material as four numbers, with an alpha that rays and cameras pass."""
    return f"{rgba(one.color)[:-1]}0"


def _friction(one: Material) -> str:
    """Return sliding, torsional and rolling friction of a material."""
    return f"{one.friction:.6g} {_ROLLING}"


class _CollisionGeoms:
    """Geoms that collide: boxes, convex meshes and height fields, as they are added to an MJCF."""

    def __init__(self, model: _Mjcf) -> None:
        self._model, self._scene = model, model.scene
        self._names = ContactNames(model.scene)
        self._counts = {"box": 0, "mesh": 0, "hfield": 0}

    def add(self, smooth: SmoothGround | None = None) -> _Told:
        """Add solids and height fields that collide.

        Args:
            smooth: ground that is both seen and collided with, beside the scene; None for none.
        """
        options, scene = self._scene.options, self._scene
        if smooth is not None and scene.holes and smooth.is_all:
            return self._add_smooth(smooth)
        own, error = self._errors()
        parts = scene.parts_within(own)
        if parts is not None:
            built = parts.ground
        else:
            built = scene.built_mesh
            if own != options.max_error and built.error > own:
                built = scene.mesh_within(own)
        seam, most = _SEAM * options.max_error, options.max_geoms
        if smooth is not None:
            most = max(1, most - len(smooth.solids) - len(smooth.patches))
        request = CollisionRequest(
            scene.terrain, built, error, seam, most, scene.say, parts,
            () if smooth is None else smooth.areas, options.max_seconds,
        )  # fmt: skip
        found = collision_of(request)
        levels = (built if len(built.mesh.faces) else scene.built_mesh).mesh.vertices[:, 2]
        self._add_all(found, float(levels.min()), float(levels.max()), smooth)
        if smooth is not None:
            found = found._replace(
                solids=found.solids + smooth.solids, patches=found.patches + smooth.patches
            )
        counts = self._counts
        summary = _summary(counts)
        solids = found.height + built.error
        losses = _loss_sentence(found, solids, options, error, sum(counts.values()))
        return _Told(summary, _LAYERS, (losses,), self._facts(found, solids, seam), self._example)

    def _add_smooth(self, smooth: SmoothGround) -> _Told:
        """Add height fields and domes that are all of the ground.

        Raises:
            RequestError: there is no ground.
        """
        options, scene = self._scene.options, self._scene
        found = Collision(smooth.solids, smooth.patches, options.max_error)
        if not found.solids and not any(patch.used.any() for patch in found.patches):
            raise no_ground()
        self._add_all(Collision([], [], 0.0), math.inf, -math.inf, smooth)
        counts = self._counts
        summary = _summary(counts)
        solids = options.max_error if found.solids else 0.0
        losses = _loss_sentence(found, solids, options, solids, sum(counts.values()))
        worn = [scene.material(n) for n in sorted(scene.beside, key=lambda n: (n < 0, n))]
        facts = self._facts(found, solids, 0.0)
        return _Told(summary, _LAYERS, (losses,), facts, self._example, tuple(worn))

    def _add_all(
        self, found: Collision, low: float, high: float, smooth: SmoothGround | None
    ) -> None:
        """Add geoms of a mesh with a lowest and a highest level, and those that are seen, too."""
        seen = Collision([], [], 0.0)
        if smooth is not None:
            seen = Collision(smooth.solids, smooth.patches, 0.0)
        for levels in (
            *(solid.top[:, 2] for solid in seen.solids),
            *(patch.heights for patch in seen.patches if patch.used.any()),
        ):
            low, high = min(low, float(np.nanmin(levels))), max(high, float(np.nanmax(levels)))
        self._base = base_below(low, high)
        self._sunk = low - SINK * max(high - low, BELOW)
        for part in (found, seen):
            begin = len(self._model.world)
            worn, roofs = [one.surface for one in part.solids], [one.top for one in part.solids]
            names = self._names.of_roofs(worn, roofs)
            for name, solid in zip(names, part.solids, strict=True):
                self._add_solid(name, solid)
            for patch in part.patches:
                for surface in patch.used_surfaces:
                    self._add_patch(patch, surface)
            if part is seen and self._scene.holes:
                self._show(begin)

    def _show(self, begin: int) -> None:
        """Add what is seen of the geoms from an index on; nothing collides with it."""
        surfaces = {self._model.class_of(n)["class"]: n for n in sorted(self._model.worn)}
        for geom in list(self._model.world)[begin:]:
            own = dict(geom.attrib)
            color = rgba(self._scene.material(surfaces[own["class"]]).color)
            name = f"{own.pop('name')}/seen"
            child(self._model.world, "geom", name=name, **own, rgba=color, **_SEEN)

    def add_grid(self, patch: HeightPatch) -> _Told:
        """Add a height field for each surface of a grid, which is seen and collides.

        Raises:
            RequestError: there is no ground.
        """
        if not patch.used.any():
            raise no_ground()
        low, high = float(np.nanmin(patch.heights)), float(np.nanmax(patch.heights))
        self._sunk, self._base = low - SINK * max(high - low, BELOW), low
        surfaces = patch.used_surfaces
        for surface in surfaces:
            self._add_patch(patch, surface, seen=True)
        found = Collision([], [patch], 0.0)
        rows, columns = patch.heights.shape
        fields = count_of(len(surfaces), "height field")
        parts = "; ".join(_field_parts(found, self._scene.options.max_error))
        return _Told(
            f"{fields} of {columns:,} × {rows:,} heights, straight from the grid",
            _FIELD,
            (f"What collides: {parts}.", *_grid_losses(patch, self._sunk)),
            self._facts(found, 0.0, 0.0),
            self._example,
            tuple(self._scene.material(surface) for surface in surfaces),
        )

    def _facts(self, found: Collision, solids: float, seam: float) -> dict[str, object]:
        """Return figures of what collides: its geoms, and their distances from the terrain."""
        return {
            **self._counts,
            "max_geoms": self._scene.options.max_geoms,
            "error": max(solids, found.worst),
            "solids_error": solids,
            "seam": seam,
            "height_fields_error": found.worst,
        }

    def _errors(self) -> tuple[float, float]:
        """Return the errors of the mesh that solids are cut from, and of the solids."""
        built, error = self._scene.built_mesh, self._scene.options.max_error
        faces = len(built.mesh.faces)
        if _FINE <= faces <= _MANY:
            return error, error
        if faces > _MANY:  # few geoms cannot stand for so many faces within the error
            coarsest = _COARSEST * float(np.ptp(built.mesh.vertices[:, 2]))
            error = min(error * faces / _FINE, max(error, coarsest))
        return _MESH_SHARE * error, error

    @property
    def _example(self) -> tuple[str, ...]:
        """Paragraph on the names of geoms, with the last one as an example."""
        names = (str(geom.get("name")) for geom in reversed(self._model.world))
        return (_NAMES.format(next(name for name in names if not name.endswith("/seen"))),)

    def _add_geom(self, kind: str, name: str, surface: int, **attributes: object) -> None:
        """Add a geom of a kind, and count it."""
        self._counts[kind] += 1
        child(
            self._model.world, "geom", name=name, type=kind, **attributes,
            **self._model.class_of(surface),
        )  # fmt: skip

    def _add_solid(self, name: str, solid: Solid) -> None:
        box = plan_rectangle(solid)
        if box is not None:
            half = 0.5 * (box.top - (self._base if box.under is None else box.under))
            cos, sin = math.cos(box.turn), math.sin(box.turn)
            turn = {"xyaxes": numbers((cos, sin, 0, -sin, cos, 0))} if box.turn else {}
            self._add_geom(
                "box", name, solid.surface, size=numbers((*box.half, half)),
                pos=self._model.place((*box.middle, box.top - half)), **turn,
            )  # fmt: skip
            return
        below = solid.under
        if below is None:
            ring = np.concatenate([solid.top, solid.top[:1]])[:, :2]
            ring = shapely.get_coordinates(shapely.convex_hull(shapely.linestrings(ring)))[:-1]
            below = np.column_stack([ring, np.full(len(ring), self._base)])
        middle = solid.top.mean(axis=0)  # vertices are near zero, as MuJoCo keeps them in float32
        corners = np.concatenate([solid.top, below]) - middle
        child(
            self._model.asset, "mesh", name=name, vertex=numbers(corners.ravel()),
            **self._model.own_class,
        )  # fmt: skip
        self._add_geom("mesh", name, solid.surface, mesh=name, pos=self._model.place(middle))

    def _add_patch(self, patch: HeightPatch, surface: int, seen: bool = False) -> None:
        used = patch.used & (patch.surfaces == surface)
        rows, columns = np.flatnonzero(used.any(axis=1)), np.flatnonzero(used.any(axis=0))
        patch = patch.crop(rows[0], rows[-1] + 1, columns[0], columns[-1] + 1)
        own = patch.used & (patch.surfaces == surface)
        [name] = self._names.at([surface], [_middles(patch, own)])
        used = np.pad(own, 1)
        nodes = used[:-1, :-1] | used[:-1, 1:] | used[1:, :-1] | used[1:, 1:]
        heights = np.where(nodes, patch.heights, self._sunk)
        west, south, east, north = patch.bounds
        low, high = float(heights.min()), float(heights.max())
        file = f"{self._scene.name}-{self._counts['hfield']}.bin"
        rows_of_bytes = ((row - low).astype("<f4").tobytes() for row in heights)
        shape = np.array(heights.shape, "<i4").tobytes()
        file = self._model.save(file, itertools.chain([shape], rows_of_bytes))
        # MuJoCo stretches heights to 0 … 1
        # its sides are walls down to the lower ground beside it
        deep = max(BELOW, low - self._base)
        size = 0.5 * (east - west), 0.5 * (north - south), max(high - low, 1e-6), deep
        child(self._model.asset, "hfield", name=name, file=file, size=numbers(size))
        look = {"group": 2, "rgba": rgba(self._scene.material(surface).color)} if seen else {}
        self._add_geom(
            "hfield", name, surface, hfield=name,
            pos=self._model.place((0.5 * (west + east), 0.5 * (south + north), low)), **look,
        )  # fmt: skip


def _middles(patch: HeightPatch, used: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return x, y, z of the middles of some used cells of a height field, (n, 3)."""
    row, column = np.nonzero(used)
    some = np.linspace(0, len(row) - 1, min(len(row), _ASKED)).round().astype(np.intp)
    row, column = row[some], column[some]
    # MuJoCo parts cells from the south-west to the north-east
    return 0.5 * (patch.at(row, column) + patch.at(row + 1, column + 1))


def _summary(counts: dict[str, int]) -> str:
    """Return what collides in a few words."""
    return (
        f"{count_of(sum(counts.values()), 'geom')} to collide with: "
        f"{count_of(counts['box'], 'box')}, {count_of(counts['mesh'], 'convex mesh')}, "
        f"{count_of(counts['hfield'], 'height field')}"
    )


def _grid_losses(patch: HeightPatch, sunk: float) -> Iterator[str]:
    """Yield sentences on the rims and the void of a height field straight from a grid.

    Args:
        patch: the height field.
        sunk: height of its nodes where there is no ground.
    """
    if _are_covered(patch):
        yield "A surface that is no wider than a cell shares its ground with those beside it."
    half = metres(0.5 * max(patch.cell))
    beyond = patch.bounds[0] < 0.0  # west of the terrain
    if beyond:
        yield f"The height field goes on for {half}, half a pixel, beyond the edge of the terrain."
    if patch.uncovered.any():
        floor = f"the void is a pit with its floor at {metres(sunk)}"
        soon = f", which begins up to {half} too soon" if beyond else ""
        yield f"Height fields have no holes, so {floor}{soon}."


def _loss_sentence(
    found: Collision, solids: float, options: SceneOptions, allowed: float, geoms: int
) -> str:
    """Return a sentence on the distance of colliding geoms from the terrain.

    Args:
        found: solids and height fields.
        solids: largest distance of solids from the terrain.
        options: options of the files.
        allowed: error that solids were allowed before there were too many.
        geoms: number of geoms.
    """
    wanted, most = options.max_error, options.max_geoms
    parts = []
    if found.solids:
        parts.append(f"solids are up to {metres(solids)} off the terrain, square to it")
        if (found.raised or allowed > wanted) and geoms <= most:
            parts[0] += f", to keep to {count_of(most, 'geom')}: --max-geoms N allows more"
        if found.late:
            parts[0] += ", as the time was over: --max-seconds N allows more"
        if len({solid.surface for solid in found.solids}) > 1:
            parts.append(f"they reach up to {metres(_SEAM * wanted)} into other surfaces")
    parts += _field_parts(found, wanted, ", as measured")
    if geoms > most:
        parts.append(
            f"{count_of(most, 'geom')} would be too far off, so there are {geoms:,}: "
            "--max-geoms N allows more, and --flex is exact"
        )
    return f"What collides: {'; '.join(parts)}."


def _are_covered(patch: HeightPatch) -> bool:
    """Whether a cell has no node of its own surface alone, so that other fields hold it, too."""
    alike = np.pad(patch.surfaces, 1, mode="edge")
    around = alike[1:, 1:], alike[1:, :-1], alike[:-1, 1:], alike[:-1, :-1]
    several = np.minimum.reduce(around) != np.maximum.reduce(around)
    corners = several[1:, 1:] & several[1:, :-1] & several[:-1, 1:] & several[:-1, :-1]
    return bool((corners & patch.used).any())


def _field_parts(found: Collision, wanted: float, how: str = "") -> Iterator[str]:
    """Yield parts of a sentence on the distance of height fields from the terrain.

    Args:
        found: height fields.
        wanted: error that was asked for.
        how: source of the figure.
    """
    if found.patches:
        said = f"height fields up to {metres(found.worst)}, along z{how}"
        if found.worst > wanted:
            said += f", on {found.share_over(wanted):.2g} % of them by more than was asked"
        yield said
        width = found.wall_width
        if width:
            yield (
                f"walls, and ground steeper than {math.degrees(math.atan(UPRIGHT)):.0f}°, "
                f"are slopes on them up to {metres(width)} wide"
            )
        if found.raggedness:
            yield f"lines between surfaces on them up to {metres(found.raggedness)}, a cell"


def _add_flexes(model: _Mjcf) -> _Told:
    """Add the mesh as rigid flexes, one for each surface, which are not seen."""
    scene = model.scene
    points = points_of(scene.mesh)
    for part in scene.parts:
        one = scene.material(part.surface)
        vertices, faces = shape_of(points, part)
        flex = child(
            model.world, "flexcomp", name=f"{scene.name}/{one.word}", type="direct", dim=2,
            rigid="true", radius=0, group=3, rgba=_hidden(one), pos=model.place((0, 0, 0)),
            point=numbers(vertices.ravel()), element=" ".join(map(str, faces.ravel().tolist())),
        )  # fmt: skip
        child(flex, "contact", selfcollide="none", priority=1, friction=_friction(one))
    number = len(scene.mesh.faces)
    return _Told(
        f"{count_of(number, 'face')} to collide with, "
        f"in {count_of(len(scene.parts), 'rigid flex')}",
        _FLEXES,
        (
            "What has flat faces, such as a box, falls through triangles of a flex that are larger"
            " than it (seen with MuJoCo 4.0); spheres do not.",
        ),
        {"flexes": len(scene.parts), "faces": number},
    )
