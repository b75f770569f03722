"""Names that a wrong word may stand for: by what it means, a word they share, or its letters."""

from __future__ import annotations

import re
from collections.abc import Iterable

_MOST = 3
_ALIKE = 0.7
"""Least similarity, 0 to 1, of a misspelling: castle is less similar to craters."""
_NEARLY = 0.85
"""Least similarity, 0 to 1, of a misspelling of a word of others: isac is like isaac."""
_SHORTEST = 3
"""Fewest letters of a word that is looked for within others: "to" is in too many."""
_words = re.compile(r"[A-Z]?[^\W\d_A-Z]+|[A-Z]+(?![a-z])|[0-9]+").findall
"""Words of a name: those of "pyramidStairs", "dry-sand" and "rock_10"."""
_MEANT = {
    # options
    "resolution": "tr cell cell-size cellsize pixel-size pixelsize px-size gsd grid-size spacing",
    "max-error": "tolerance tol error eps epsilon accuracy precision max-z-error simplify",
    "min-change": "tolerance tol threshold",
    "output": "o out outfile out-file output-file destination dest save write to",
    "overwrite": "force replace clobber yes",
    "extent": "size sides dimensions",
    "profile": "section cross-section crosssection transect",
    "perspective": "3d 3-d three-d isometric oblique",
    "bounds": "bbox extent region area roi crop clip projwin te rectangle",
    "crs": "epsg srs projection proj t-srs",
    "max-faces": "faces triangles max-triangles budget decimate target-faces",
    "vehicle": "robot rover",
    "from": "reachable start source",
    "route": "goal to path",
    "waypoints": "path via trajectory",
    "poses": "path trajectory",
    "pixels": "size width px image-size",
    "turn": "yaw rotate rotation angle heading",
    "fit-turn": "turn rotate rotation angle",
    "values": "samples",
    "cell": "place",
    "threads": "jobs workers cores processes",
    "compress": "compression",
    "library-root": "library include library-path lib",
    "target": "sim simulator engine format",
    "origin": "center centre zero",
    "origin-at": "origin offset",
    "sensor-at": "origin position",
    "exaggeration": "z-scale zscale vertical-exaggeration scale",
    "json": "format machine",
    "digits": "decimals precision places ndigits",
    "format": "markdown report json fmt pretty prettify",
    "preset": "soil material ground",
    "layer": "band channel attribute",
    "on-ground": "height above-ground",
    # simulators
    "usd": "isaac isaac-sim isaacsim isaac-lab isaaclab omniverse openusd physx newton usdc",
    "gazebo": "sdf ignition ign gz gz-sim gazebo-sim harmonic",
    "nav2": "ros ros2 costmap map-server navigation navigation2 occupancy occupancy-grid",
    "mujoco": "mjcf mjx mjlab robosuite",
    "pybullet": "bullet urdf",
    "chrono": "pychrono project-chrono scm",
    "grid-map": "gridmap elevation-map elevation-mapping ros ros2",
    # layers
    "height": "elevation dem dtm z altitude",
    "slope": "gradient steepness inclination",
    "surface": "class classes semantic material label",
    "color": "rgb colour texture",
    "hillshade": "shade shading shaded relief",
    "contours": "isolines isohypses lines",
    "traversability": "trav cost verdict traverse drivable navigate plan route",
    # commands
    "validate": "check lint verify test",
    "new": "create init make generate gen",
    "render": "plot draw picture image",
    "view": "show open gui preview browse",
    "query": "sample height probe",
    "export-dem": "dem raster geotiff tif heightmap export-raster",
    "export-mesh": "mesh glb gltf stl export-glb export-gltf export-stl export-ply",
    "export-sim": "sim simulate simulator sdf gazebo mujoco usd isaac ros",
    "import-terrain": "import import-dem import-mesh from-dem",
    "scan": "lidar sensor raycast",
    "map": "slam mapping fuse",
    "compare": "evaluate score",
    "deform": "drive ruts",
    "bundle": "pack flatten",
    "info": "stats summary describe",
}
"""Words of others for a name, by the name."""


def near_names(word: object, known: Iterable[str]) -> list[str]:
    """Names that a word may stand for, at most three, the likeliest first; none if nothing is near.

    Args:
        word: wrong word, such as "--res", "isaac" or "heigth".
        known: names that there are, with or without the hyphens of options.
    """
    names = {name.lstrip("-"): name for name in known}
    plain = str(word).lstrip("-").lower().replace("_", "-")
    if plain in names:
        return [names[plain]]
    found = [name for name in names if plain in _meant(name)]
    found += [name for name in _with_word(plain, names) if name not in found]
    if len(plain) > 1:
        found += [name for name in names if name.startswith(plain) and name not in found]
    if not found:
        found = spelled_like(plain, names, 1, _ALIKE)[:1] or _misspelt(plain, names)
    return [names[name] for name in found[:_MOST]]


def guess(word: object, known: Iterable[str]) -> str:
    """Question whether one of the `near_names` was meant; empty if there is none."""
    near = near_names(word, known)
    return f"Did you mean {' or '.join(near)}?" if near else ""


def spelled_like(word: str, known: Iterable[str], most: int = 2, least: float = 0.6) -> list[str]:
    """Names whose letters are like those of a word, the likeliest first.

    First come names of the same letters, then those that have the word as one of theirs, then
    those that contain it or are contained in it, in the order of `known`, then the most similar
    ones.

    Args:
        word: wrong word, such as "stairs" for "pyramidStairs".
        known: names that there are.
        most: most names that are only similar.
        least: least similarity of these, from 0 to 1.
    """
    from difflib import get_close_matches

    names = list(known)
    found = _with_word(word, names)
    plain = _letters(word)
    if len(plain) >= _SHORTEST:
        for name in names:
            other = _letters(name)
            inside = len(other) >= _SHORTEST and other in plain
            if name not in found and (plain in other or inside):
                found.append(name)
    found.sort(key=lambda name: _letters(name) != plain)
    found += [name for name in get_close_matches(word, names, most, least) if name not in found]
    return found


def _with_word(word: str, names: Iterable[str]) -> list[str]:
    """Names that have a word as one of theirs, whatever the case."""
    plain = _letters(word)
    if len(plain) < _SHORTEST:
        return []
    return [name for name in names if plain in map(str.lower, _words(name))]


def _misspelt(word: str, names: Iterable[str]) -> list[str]:
    """The name for which a word of others stands that is like a word, or none."""
    from difflib import get_close_matches

    meant = {other: name for name in names for other in _meant(name)}
    return [meant[other] for other in get_close_matches(word, meant, 1, _NEARLY)]


def _letters(name: str) -> str:
    return "".join(_words(name)).lower()


def _meant(name: str) -> list[str]:
    return _MEANT.get(name, "").split()
