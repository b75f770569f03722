"""Rules on tracks: paths that are none, depths that nothing gives, and missing ground."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, pairwise

from msgspec import UNSET

from terratool.definition.exact import decimal_sum
from terratool.definition.findings import Remark
from terratool.definition.model import Track
from terratool.definition.rules.base import Subject, rule
from terratool.text.display import quote


@rule("TT601", "no-depth")
def no_depth(subject: Subject) -> Iterator[Remark]:
    """A track has neither a load nor a depth, so nothing says how deep it is.

    With a load, in kN, the wheel sinks by the sinkage of the ground's surface times the load. A
    depth is one number, or one for each surface by its name.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"},
          "tracks": [{"path": [[1, 2], [8, 2]], "width": 0.2}]
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"},
          "tracks": [{"path": [[1, 2], [8, 2]], "width": 0.2, "load": 0.25}]
        }

    To mend: add the load of the wheel, or the depth of the rut.
    """
    for here, track in _tracks(subject):
        lacking = track.load is UNSET and track.depth is UNSET
        if lacking and not subject.left_out(here, "load", "depth"):
            yield Remark(
                here,
                'the track has neither "load" nor "depth".',
                'Add the "load" of the wheel in kN, or the "depth" of the rut.',
            )


@rule("TT602", "short-path")
def short_path(subject: Subject) -> Iterator[Remark]:
    """The path of a track has fewer than two points, so the wheel goes nowhere.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"},
          "tracks": [{"path": [[1, 2]], "width": 0.2, "depth": 0.05}]
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"},
          "tracks": [{"path": [[1, 2], [8, 2]], "width": 0.2, "depth": 0.05}]
        }

    To mend: give the points that the wheel passes, or remove the track.
    """
    for here, track in _tracks(subject):
        if track.path is not UNSET and len(track.path) < 2:
            count = "no point" if not track.path else "one point"
            yield Remark(
                f"{here}/path",
                f"the path has {count}, where it takes two or more.",
                "Add the points that the wheel passes, or remove the track.",
            )


@rule("TT603", "repeated-point", "warning")
def repeated_point(subject: Subject) -> Iterator[Remark]:
    """Two points of a path that follow one another are the same.

    The second changes nothing: a track counts once, however often it passes a place.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"},
          "tracks": [{"path": [[1, 2], [8, 2], [8, 2]], "width": 0.2, "depth": 0.05}]
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"},
          "tracks": [{"path": [[1, 2], [8, 2], [8, 9]], "width": 0.2, "depth": 0.05}]
        }

    To mend: remove one of the two points.
    """
    for here, track in _tracks(subject):
        for index, (point, after) in enumerate(pairwise(track.path or ()), 1):
            if point == after:
                yield Remark(
                    f"{here}/path/{index}",
                    f"the point [{', '.join(map(quote, after))}] stands twice in a row.",
                    "Remove one of the two.",
                )


@rule("TT604", "track-outside", "warning")
def track_outside(subject: Subject) -> Iterator[Remark]:
    """A track lies wholly outside of the terrain, so it changes nothing.

    Paths are in world coordinates, as the origin is: where that is not 0, 0, neither is the
    south-west corner. Compared are the rectangles around the segments and half the width.

    Fails:

        {
          "size": 10, "origin": [500, 800],
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"},
          "tracks": [{"path": [[1, 2], [8, 2]], "width": 0.2, "depth": 0.05}]
        }

    Passes:

        {
          "size": 10, "origin": [500, 800],
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"},
          "tracks": [{"path": [[501, 802], [508, 802]], "width": 0.2, "depth": 0.05}]
        }

    To mend: add the origin to the points, or remove the track.
    """
    (west, south), (wide, tall) = subject.definition.corner, subject.definition.extent
    if not wide > 0 or not tall > 0:
        return  # another rule reports the size
    east, north = decimal_sum(west, wide), decimal_sum(south, tall)
    for here, track in _tracks(subject):
        reach = 0.0 if track.width is UNSET else track.width / 2
        if track.points and not any(
            min(x, end_x) <= east + reach
            and max(x, end_x) >= west - reach
            and min(y, end_y) <= north + reach
            and max(y, end_y) >= south - reach
            for (x, y), (end_x, end_y) in pairwise(chain(track.points, track.points[-1:]))
        ):
            yield Remark(
                f"{here}/path",
                "the track lies wholly outside of the terrain.",
                f"Points are world coordinates, here from [{quote(west)}, {quote(south)}] "
                f"to [{quote(east)}, {quote(north)}].",
            )


@rule("TT605", "track-without-sinkage", "warning")
def track_without_sinkage(subject: Subject) -> Iterator[Remark]:
    """A track takes its depth from its load, and a surface that elements wear has no sinkage.

    Where the ground is of that surface, the rut has no depth. Whether the track comes there is not
    looked at.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "x-ignore": ["TT401"]}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"},
          "tracks": [{"path": [[1, 2], [8, 2]], "width": 0.2, "load": 0.25}]
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"},
          "tracks": [{"path": [[1, 2], [8, 2]], "width": 0.2, "load": 0.25}]
        }

    To mend: add the sinkage, 0 for rigid ground, or give the track a depth on that surface.
    """
    if not subject.definition.ruts:
        return
    surfaces, worn = subject.surfaces, subject.tree.worn
    lacking = [
        name
        for name in surfaces
        if name in worn and surfaces[name].sinkage is UNSET and surfaces[name].void is not True
    ]
    for here, track in _tracks(subject):
        given = track.depth if isinstance(track.depth, dict) else ()
        missing = [name for name in lacking if name not in given] if track.by_load else []
        if missing and not subject.left_out(here, "depth"):
            names = ", ".join(quote(name) for name in missing[:3]) + ", …" * (len(missing) > 3)
            verb = "have" if len(missing) > 1 else "has"
            yield Remark(
                here,
                f'the track sinks by its load, and {names} {verb} no "sinkage".',
                'Add "sinkage", 0 for rigid ground, or give the track a "depth" there.',
            )


@rule("TT606", "void-track")
def void_track(subject: Subject) -> Iterator[Remark]:
    """The surface of a track is void, but a wheel leaves ground behind.

    Fails:

        {
          "size": 10,
          "surfTypes": {"hole": {"void": true}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"},
          "tracks": [{"path": [[1, 2], [8, 2]], "width": 0.2, "depth": 0.05, "surface": "hole"}]
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"firm": {"cohesion": 4, "fricAngle": 33, "sinkage": 0.01}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"},
          "tracks": [{"path": [[1, 2], [8, 2]], "width": 0.2, "depth": 0.05, "surface": "firm"}]
        }

    To mend: write a surface that is not void; holes are made by elements.
    """
    surfaces = subject.surfaces
    for here, track in _tracks(subject):
        if track.surface in surfaces and surfaces[str(track.surface)].void is True:
            yield Remark(
                f"{here}/surface",
                f"the surface {quote(str(track.surface))} is void, and a track leaves ground.",
                "Write a surface that is not void, or leave it out.",
            )


@rule("TT607", "mixed-path")
def mixed_path(subject: Subject) -> Iterator[Remark]:
    """Some points of a path have a height, and others have none.

    A track of points [x, y] lies on the ground. One of points [x, y, z] lies on the floors that are
    nearest to these heights, such as the deck of a bridge.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"},
          "tracks": [{"path": [[1, 2, 1], [8, 2]], "width": 0.2, "depth": 0.05}]
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"},
          "tracks": [{"path": [[1, 2, 1], [8, 2, 1]], "width": 0.2, "depth": 0.05}]
        }

    To mend: give all points a z, or none.
    """
    for here, track in _tracks(subject):
        path = () if track.path is UNSET else track.path
        for index, point in enumerate(path):
            if len(point) != len(path[0]):
                has = "a z" if len(point) > len(path[0]) else "no z"
                yield Remark(
                    f"{here}/path/{index}",
                    f"the point has {has}, unlike the first one.",
                    "Write all points as [x, y], or all as [x, y, z].",
                )
                break


def _tracks(subject: Subject) -> Iterator[tuple[str, Track]]:
    for index, track in enumerate(subject.definition.ruts):
        here = f"/tracks/{index}"
        if not subject.left_out(here):
            yield here, track
