"""MuJoCo: an MJCF with convex solids and height fields that collide, and a mesh to be seen."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.mesh.formats.common import lines_of, shape_of
from terratool.simulators.collision import HeightPatch, collision_of
from terratool.simulators.prisms import Floats, Solid, rectangle
from terratool.simulators.scene import Material, Scene
from terratool.simulators.targets import Written
from terratool.text.display import counted, length

_FILE = "terrain.xml"
_BELOW = 1.0
"""Solids reach so far below the lowest ground, in units of the terrain …"""
_PART = 0.1
"""… and no less than this part of the relief."""
_SINK = 8.0
"""What a height field leaves out lies so many reliefs below: so its sides are steep."""
_MESH_SHARE = 0.5
"""This part of the error is the mesh's; solids and height fields may take the rest."""


def write(scene: Scene, folder: Path) -> Written:
    """Write an MJCF, meshes to be seen, and height fields to collide with, into a folder."""
    pieces = _Flexes(scene, folder) if scene.options.flex else _Solids(scene, folder)
    x, y, z = scene.offset
    lines = ["<!--", *(f"  {line.replace('--', '- -')}" for line in lines_of(scene.terrain.descr)), "-->"]
    lines = lines if scene.terrain.descr else []
    lines += [f"<mujoco model={quoteattr(scene.name)}>", "  <asset>"]
    seen = list(_picture(scene, folder))
    lines += [f"    {line}" for line, _ in seen] + [f"    {line}" for line in pieces.assets]
    lines += ["  </asset>", "  <worldbody>", f'    <body name="terrain" pos="{_numbers((x, y, z))}">']
    lines += [f"      {line}" for _, line in seen] + [f"      {line}" for line in pieces.geoms]
    lines += ["    </body>", "  </worldbody>", "</mujoco>", ""]
    (folder / _FILE).write_text("\n".join(lines), "utf-8")
    return Written(
        summary=pieces.summary,
        language="python",
        load=(
            "import mujoco",
            f'model = mujoco.MjModel.from_xml_path("{_FILE}")',
            "data = mujoco.MjData(model)",
        ),
        notes=_NOTES,
        losses=tuple(pieces.losses),
        facts=pieces.facts,
    )


_NOTES = (
    f'Into a model of yours: put its file into this folder and write `<include file="{_FILE}"/>`'
    " into it, or attach it from anywhere, which is the way of mjlab and dm_control, too:",
    "```python\n"
    'scene = mujoco.MjSpec.from_file("robot.xml")\n'
    f'scene.attach(mujoco.MjSpec.from_file("{_FILE}"), frame=scene.worldbody.add_frame())\n'
    "model = scene.compile()\n"
    "```",
    "Geoms of group 2 are the exact mesh: cameras and rangefinders see it, and nothing collides with"
    " it. Geoms of group 3 collide. Rays pass them, as their alpha is 0: set it to 1 to see them."
    " They have `priority` 1, so that the friction of the ground counts, whatever a robot says.",
)


def _numbers(values: Floats | tuple[float, ...]) -> str:
    """Numbers as text, each to a tenth of a micrometre or nine digits."""
    return " ".join(f"{round(float(value), 7) + 0.0:.12g}" for value in np.ravel(values))


def _picture(scene: Scene, folder: Path) -> Iterator[tuple[str, str]]:
    """Materials and meshes that are seen: each asset, and the geom of it."""
    mesh = scene.mesh
    points = np.ascontiguousarray(mesh.vertices, np.float32)
    for part in scene.parts:
        one = scene.material(part.surface)
        name = f"terrain_{one.word}"
        vertices, faces = shape_of(points, part)
        _write_msh(folder / f"{one.word}.msh", vertices, faces)
        color = _numbers(np.array(one.color) / 255)
        yield (
            f'<material name="{name}" rgba="{color} 1" specular="0" shininess="0"/>'
            f'<mesh name="{name}" file="{one.word}.msh" inertia="shell"/>',
            f'<geom name="{name}" type="mesh" mesh="{name}" material="{name}" group="2"'
            ' contype="0" conaffinity="0"/>',
        )


def _write_msh(path: Path, vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> None:
    """MuJoCo's own binary mesh: numbers of vertices, normals, texture points, faces; then these."""
    with open(path, "wb") as file:
        file.write(np.array([len(vertices), 0, 0, len(faces)], "<i4").tobytes())
        file.write(vertices.astype("<f4").tobytes())
        file.write(faces.astype("<i4").tobytes())


def _contact(one: Material) -> str:
    """What a geom of a surface says of its contacts."""
    return f'priority="1" friction="{one.friction:.6g} 0.005 0.0001" group="3"'


class _Solids:
    """Boxes, convex meshes and height fields."""

    def __init__(self, scene: Scene, folder: Path) -> None:
        options = scene.options
        error = options.max_error
        built = scene.mesh_within(_MESH_SHARE * error)
        found = collision_of(scene.terrain, built, error, options.max_geoms, scene.say)
        levels = built.mesh.vertices[:, 2]
        low, relief = float(levels.min()), float(np.ptp(levels))
        self._base = low - max(_BELOW, _PART * relief)
        self._sunk = low - _SINK * max(relief, 1e-3)
        self._scene, self._folder = scene, folder
        self.assets: list[str] = []
        self.geoms: list[str] = []
        self._counts = {"box": 0, "mesh": 0, "hfield": 0}
        for solid in found.solids:
            self._add_solid(solid)
        for patch in found.patches:
            for surface in np.unique(patch.surfaces[patch.used]).tolist():
                self._add_patch(patch, surface)
        number = sum(self._counts.values())
        counts = self._counts
        self.summary = (
            f"{counted(number, 'geom')} collide: {counts['box']} boxes, {counts['mesh']} convex"
            f" meshes, {counts['hfield']} height fields"
        )
        roof = found.height + built.error
        fields = max((patch.error for patch in found.patches), default=0.0)
        self.losses = [f"What collides is up to {length(max(roof, fields))} off the terrain, along z."]
        if roof > 1.001 * error:
            self.losses[0] += f" To keep to {options.max_geoms} geoms, that is more than was asked."
        self.facts = {
            "collision": {**counts, "error": max(roof, fields), "max_geoms": options.max_geoms}
        }

    def _add_solid(self, solid: Solid) -> None:
        one = self._scene.material(solid.surface)
        box = rectangle(solid)
        if box is not None:
            name = f"terrain_box_{self._counts['box']}"
            self._counts["box"] += 1
            half = 0.5 * (box.top - self._base)
            turn = "" if box.turn == 0 else f' quat="{_numbers((np.cos(box.turn / 2), 0, 0, np.sin(box.turn / 2)))}"'
            self.geoms.append(
                f'<geom name="{name}" type="box" size="{_numbers((*box.half, half))}"'
                f' pos="{_numbers((*box.middle, box.top - half))}"{turn}'
                f' rgba="{_rgba(one)}" {_contact(one)}/>'
            )
            return
        name = f"terrain_mesh_{self._counts['mesh']}"
        self._counts["mesh"] += 1
        ring = shapely.get_coordinates(
            shapely.convex_hull(shapely.linestrings(np.concatenate([solid.top, solid.top[:1]])[:, :2]))
        )[:-1]
        below = np.column_stack([ring, np.full(len(ring), self._base)])
        # near 0, as MuJoCo keeps vertices in float32
        middle = solid.top.mean(axis=0)
        corners = np.concatenate([solid.top, below]) - middle
        self.assets.append(f'<mesh name="{name}" vertex="{_numbers(corners)}"/>')
        self.geoms.append(
            f'<geom name="{name}" type="mesh" mesh="{name}" pos="{_numbers(middle)}"'
            f' rgba="{_rgba(one)}" {_contact(one)}/>'
        )

    def _add_patch(self, patch: HeightPatch, surface: int) -> None:
        one = self._scene.material(surface)
        used = patch.used & (patch.surfaces == surface)
        rows, columns = np.flatnonzero(used.any(axis=1)), np.flatnonzero(used.any(axis=0))
        top, bottom = int(rows[-1]) + 1, int(rows[0])
        left, right = int(columns[0]), int(columns[-1]) + 1
        used = np.pad(used[bottom:top, left:right], 1)
        nodes = used[:-1, :-1] | used[:-1, 1:] | used[1:, :-1] | used[1:, 1:]
        heights = np.where(nodes, patch.heights[bottom : top + 1, left : right + 1], self._sunk)
        west, south, east, north = patch.bounds
        dx, dy = (east - west) / patch.used.shape[1], (north - south) / patch.used.shape[0]
        half = 0.5 * dx * (right - left), 0.5 * dy * (top - bottom)
        middle = west + dx * left + half[0], south + dy * bottom + half[1]
        low, high = float(heights.min()), float(heights.max())
        name = f"terrain_field_{self._counts['hfield']}"
        self._counts["hfield"] += 1
        with open(self._folder / f"{name}.bin", "wb") as file:
            file.write(np.array(heights.shape, "<i4").tobytes())
            file.write(heights.astype("<f4").tobytes())
        size = _numbers((*half, max(high - low, 1e-6), max(low - self._base, _BELOW)))
        self.assets.append(f'<hfield name="{name}" file="{name}.bin" size="{size}"/>')
        self.geoms.append(
            f'<geom name="{name}" type="hfield" hfield="{name}" pos="{_numbers((*middle, low))}"'
            f' rgba="{_rgba(one)}" {_contact(one)}/>'
        )


def _rgba(one: Material) -> str:
    return f"{_numbers(np.array(one.color) / 255)} 0"


class _Flexes:
    """The mesh itself as rigid flexes, one for each surface."""

    def __init__(self, scene: Scene, folder: Path) -> None:
        points = np.ascontiguousarray(scene.mesh.vertices, np.float32)
        self.assets: list[str] = []
        self.geoms: list[str] = []
        for part in scene.parts:
            one = scene.material(part.surface)
            vertices, faces = shape_of(points, part)
            elements = " ".join(map(str, faces.ravel().tolist()))
            self.geoms += [
                f'<flexcomp name="terrain_flex_{one.word}" type="direct" dim="2" rigid="true"'
                f' radius="0" rgba="{_rgba(one)}" group="3" point="{_numbers(vertices)}"'
                f' element="{elements}">',
                f'  <contact priority="1" friction="{one.friction:.6g} 0.005 0.0001"'
                ' selfcollide="none"/>',
                "</flexcomp>",
            ]
        number = len(scene.mesh.faces)
        self.summary = f"{counted(number, 'face')} collide, in {counted(len(scene.parts), 'rigid flex')}es"
        self.losses = [
            "What has flat faces, such as a box, falls through triangles of a flex that are larger"
            " than it (seen with MuJoCo 4.0); spheres, capsules and round wheels do not."
        ]
        self.facts = {"collision": {"flex": len(scene.parts), "faces": number}}
