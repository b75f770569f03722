"""The scene of a page: a mesh in few bytes, elements, soils, lines and verdicts."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec import UNSET

from terratool.definition.model import SOIL_FIGURES
from terratool.definition.presets import preset_of, property_of
from terratool.field.terrain import Terrain
from terratool.mesh.types import Mesh
from terratool.report.wording import count_of
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.results import Route
from terratool.traversability.verdicts import COLORS, GroundClass
from terratool.viewing.layers import surface_colors
from terratool.viewing.mesh import (
    FaceKind,
    Faces,
    Floats,
    Ints,
    MeshRounding,
    PageOptions,
    Progress,
    faces_of,
    fitted_mesh,
    slope_error,
    wall_offset_of,
    wedges_of,
)
from terratool.viewing.places import Places, Site

_BEST, _QUICK = 9, 6
"""Levels of compression."""
_LARGE = 1 << 25
"""Largest scene, bytes, that is compressed best; the best level takes seconds beyond."""
_TRACK_POINTS = 100_000
"""Approximate most points of all lines of tracks."""
_ALONG = 400
"""Steps along a track per longer side of the terrain."""


@dataclass(frozen=True, slots=True)
class PageScene:
    """A terrain for a page.

    Attributes:
        facts: names, numbers, lines and verdicts of the page besides arrays, for JSON.
        arrays: (n, columns) int64 arrays within 32 bits, by name.
    """

    facts: dict[str, Any]
    arrays: dict[str, Ints]

    def to_bytes(self) -> bytes:
        """Encode the scene, compressed (RFC 1950), as page.js reads it.

        A JSON text follows its length, then the arrays. Each column is a list of differences from
        row to row: the lowest bytes of all differences, then the next bytes, up to the highest.
        Most bytes are equal, so this order compresses best.
        """
        import deflate

        listed = [
            {"name": name, "rows": len(array), "columns": array.shape[1]}
            for name, array in self.arrays.items()
        ]
        text = json.dumps({**self.facts, "arrays": listed}, ensure_ascii=False).encode()
        parts = [len(text).to_bytes(4, "little"), text]
        for array in self.arrays.values():
            steps = np.diff(array, axis=0, prepend=0).astype("<i4")
            planes = np.ascontiguousarray(steps.T).view(np.uint8).reshape(-1, 4)
            parts.append(
                np.ascontiguousarray(
                    planes.reshape(array.shape[1], len(array), 4).transpose(0, 2, 1)
                ).tobytes()
            )
        whole = b"".join(parts)
        return bytes(deflate.zlib_compress(whole, _BEST if len(whole) <= _LARGE else _QUICK))


def scene_of(
    site: Site,
    options: PageOptions | None = None,
    report: TraversabilityReport | None = None,
    progress: Progress = lambda _: None,
) -> PageScene:
    """Make the scene of a page.

    Args:
        site: the terrain and its texts.
        options: options of the mesh; the defaults if None.
        report: traversability of a vehicle, whose map and routes are drawn; None for none.
        progress: called with words on the step that begins.

    Raises:
        RequestError: there is no ground, or the faces allowed are too few whatever is left out.
    """
    options = options or PageOptions()
    fit = fitted_mesh(site.terrain, options, progress)
    mesh, grid_of = fit.built.mesh, fit.grid
    terrain = site.terrain if grid_of is None else site.terrain.ground_alone
    progress(f"asking the field about {count_of(len(mesh.faces), 'face')}")
    faces = faces_of(terrain, fit.built, from_field=grid_of is None)
    wedges = wedges_of(mesh, faces)
    grid = MeshRounding.of(mesh, fit.built.error)
    used, of_face = np.unique(faces.element, return_inverse=True)
    west, south, east, north = terrain.bounds
    low, high = _heights(mesh, faces)
    kinds = np.bincount(faces.kind, minlength=len(FaceKind)).tolist()
    progress("looking up elements")
    facts: dict[str, Any] = {
        "format": 1,
        "descr": terrain.descr,
        "crs": terrain.crs if isinstance(terrain.crs, str) else "",
        "bounds": [west, south, east, north],
        "heights": [low, high],
        "origin": list(grid.origin),
        "steps": list(grid.steps),
        "error": fit.miss + grid.rounding,
        "slope_error": slope_error(terrain, mesh, faces, fit.built.error),
        "measured": fit.measured,
        "wall_offset": wall_offset_of(fit.built),
        "left_out": fit.left_out,
        "change": fit.change,
        "hidden": list(terrain.hidden),
        "grid": None if grid_of is None else [*grid_of.shape, grid_of.step],
        "ground_faces": kinds[FaceKind.TOP],
        "under_faces": kinds[FaceKind.UNDERSIDE],
        "block_faces": kinds[FaceKind.BLOCK],
        "storeys": fit.built.storeys is not None,
        "elements_total": terrain.elements,
        "surfaces": _surfaces(terrain),
        **_elements(site, used.tolist()),
        "tracks": _tracks(terrain, grid),
        "routes": [] if report is None else [_route(grid, one) for one in report.routes],
        "map": None if report is None or report.preview is None else _verdict(report),
    }
    arrays = {
        "positions": grid.whole(mesh.vertices[wedges.vertex]),
        "normals": wedges.normal,
        "corners": wedges.corners.reshape(-1, 1),
        "elements": of_face.reshape(-1, 1).astype(np.int64),
        "faceSurfaces": faces.surface.reshape(-1, 1).astype(np.int64),
    }
    if report is not None and report.preview is not None:
        if faces.raised is not None:
            arrays["raised"] = faces.raised.reshape(-1, 1).astype(np.int64)
        preview = report.preview
        worst = preview.ground if preview.worst is None else preview.worst
        for name, classes in (("verdict", preview.ground), ("worst", worst)):
            arrays[name] = classes[::-1].reshape(-1, 1).astype(np.int64)
    return PageScene(facts, arrays)


def _heights(mesh: Mesh, faces: Faces) -> tuple[float, float]:
    """Lowest and highest height of a mesh without the sides of its block, m."""
    z = mesh.vertices[mesh.faces[faces.kind != FaceKind.BLOCK], 2] + mesh.origin[2]
    return float(z.min()), float(z.max())


# --- names, keys, soils ---------------------------------------------------------------------------


def _elements(site: Site, used: list[int]) -> dict[str, Any]:
    """Names, places and keys of elements, in the order of `used`, with each place listed once."""
    places = Places(site.checked)
    names = [site.terrain.pointer(element) for element in used]
    chains = [() if name is None else places.of(name) for name in names]
    lines = places.lines(place for chain in chains for place in chain)
    index = {place: number for number, place in enumerate(lines)}
    own: dict[int, dict[str, Any]] = {}
    for chain in chains:
        if chain and index[chain[-1]] not in own:
            own[index[chain[-1]]] = places.keys(chain[-1])
    return {
        "files": places.files,
        "places": [[place.file, line, place.pointer] for place, line in lines.items()],
        "keys": {str(number): keys for number, keys in own.items()},
        "names": [name or "" for name in names],
        "chains": [[index[place] for place in chain] for chain in chains],
        "descrs": [site.terrain.descr_of(element) for element in used],
    }


_SOIL = {
    "cohesion": "kPa", "fric_angle": "°", "sinkage": "m/kN", "shear_modulus": "m",
    "rolling_resistance": "",
}  # fmt: skip
"""Units of the figures of a soil, by attribute of the surface."""


def _surfaces(terrain: Terrain) -> list[dict[str, Any]]:
    """Surfaces and their soils, in the order of their indices; ground without a surface last."""
    listed: list[dict[str, Any]] = []
    colors = surface_colors(terrain)[0].tolist()
    for color, (name, surface) in zip(colors[1:], terrain.surface_types.items(), strict=True):
        soil = []
        for attribute, unit in _SOIL.items():
            value = getattr(surface, attribute)
            if isinstance(value, tuple | list):
                text = f"{value[0]:g} to {value[1]:g} {unit}".rstrip()
            else:
                value = property_of(surface, attribute)
                text = "" if value is UNSET else f"{value:g} {unit}".rstrip()
            if text:
                soil.append([_WORDS[attribute], text])
        preset = preset_of(surface)
        if preset is not None:
            soil.insert(0, ["soil", f"{surface.preset}: {preset.descr}"])
        descr = "" if surface.descr is UNSET else surface.descr
        listed.append({"name": name, "color": color, "soil": soil, "descr": descr})
    return [*listed, {"name": "", "color": colors[0], "soil": [], "descr": ""}]


_WORDS = {
    "cohesion": "cohesion", "fric_angle": "friction angle", "sinkage": "sinkage",
    "shear_modulus": "shear modulus", "rolling_resistance": "rolling resistance",
}  # fmt: skip
"""Names of the figures of a soil, by attribute of the surface."""
assert set(_SOIL) >= set(SOIL_FIGURES) - {"preset"}


# --- lines and verdicts ---------------------------------------------------------------------------


def _tracks(terrain: Terrain, grid: MeshRounding) -> list[dict[str, Any]]:
    """Names and middle lines of tracks, on their ground."""
    tracks = terrain.arrays.tracks
    segments = tracks.segments
    west, south, east, north = terrain.bounds
    step = max(east - west, north - south) / _ALONG
    long = np.hypot(segments["end_x"] - segments["x"], segments["end_y"] - segments["y"])
    step = max(step, float(long.sum()) / _TRACK_POINTS)
    found = []
    for index in range(terrain.tracks):
        own = segments[tracks.first[index] : tracks.first[index + 1]]
        xs, ys, zs = [], [], []
        for one in own:
            x0, y0, x1, y1 = (float(one[key]) for key in ("x", "y", "end_x", "end_y"))
            parts = max(1, math.ceil(math.hypot(x1 - x0, y1 - y0) / step))
            along = np.arange(parts) / parts
            xs.append(x0 + along * (x1 - x0))
            ys.append(y0 + along * (y1 - y0))
            zs.append(float(one["z"]) + along * (float(one["end_z"]) - float(one["z"])))
        x = np.append(np.concatenate(xs), float(own["end_x"][-1]))
        y = np.append(np.concatenate(ys), float(own["end_y"][-1]))
        z = _tops_along(terrain, x, y, np.append(np.concatenate(zs), float(own["end_z"][-1])))
        known = np.isfinite(z)
        found.append(
            {
                "name": terrain.pointer(terrain.elements + index),
                "points": grid.line(x[known], y[known], z[known]),
            }
        )
    return found


def _tops_along(terrain: Terrain, x: Floats, y: Floats, z: Floats) -> Floats:
    """Heights of the tops nearest to those of a path, (n,); of the lowest ones where it has NaN."""
    if terrain.storeys is None:
        return np.asarray(terrain.height(x, y))
    tops = terrain.column(x, y).top
    off = np.abs(tops - z[:, None])
    off[np.isnan(z), 0] = 0.0
    nearest = np.where(np.isnan(off), np.inf, off).argmin(axis=1)
    return np.asarray(np.where(np.isnan(z), terrain.ground(x, y), tops[np.arange(len(x)), nearest]))


def _route(grid: MeshRounding, route: Route) -> dict[str, Any]:
    """Line, verdicts and figures of a route; both ends alone where no route was found."""
    ends = [[one.x, one.y] for one in (route.start, route.goal)]
    facts: dict[str, Any] = {"found": route.found, "ends": ends, "verdict": route.verdict.label}
    facts["length"], facts["time"], facts["note"] = route.length, route.time, route.note
    profile = route.profile
    if profile is None:
        known_z = (one.height for one in (route.start, route.goal))
        z = np.array([grid.origin[2] if one is None else one for one in known_z])
        x, y = np.array(ends).T
        facts["points"] = grid.line(x, y, z)
        facts["verdicts"] = []
        return facts
    known = np.isfinite(profile.height)
    facts["points"] = grid.line(profile.x[known], profile.y[known], profile.height[known])
    facts["verdicts"] = profile.verdict[known].tolist()
    return facts


def _verdict(report: TraversabilityReport) -> dict[str, Any]:
    """Grid of a vehicle's map, and names and colours of its classes."""
    preview = report.preview
    assert preview is not None
    grid = preview.grid
    return {
        "vehicle": report.vehicle.name,
        "west": grid.west,
        "south": grid.south,
        "resolution": grid.resolution,
        "width": grid.width,
        "height": grid.height,
        "classes": [{"name": one.label, "color": list(COLORS[one])} for one in GroundClass],
    }
