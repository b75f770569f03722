"""Small terrains with decks and bores, oblong and symmetric in no way."""

from __future__ import annotations

from typing import Any

Json = dict[str, Any]


def thing(kind: str, at: list[float], extent: list[float], **more: Any) -> Json:
    return {"type": kind, "at": at, "extent": extent, **more}


SURFACES: Json = {
    "soil": {"fricAngle": 30}, "wood": {"fricAngle": 20}, "stone": {"fricAngle": 40},
    "pit": {"void": True},
}  # fmt: skip
TYPES: Json = {
    "rise": {"x": [0, 1]}, "block": {"x": [1]}, "hill": {"x": "tent"},
    "vault": {"x": "flat", "y": [[0, 0], [0.3, 1], [0.7, 1], [1, 0]]},
    "span": {"x": [[0, 0], [0.25, 0.8], [0.75, 0.8], [1, 0]]},
}  # fmt: skip

# decks that are level, turned, sloping, arched, with a hole
DEPOT: Json = {
    "size": [14, 9],
    "surfTypes": SURFACES,
    "elemTypes": TYPES,
    "elemTree": {
        "type": "rise", "surface": "soil", "vScale": 0.28,
        "children": [
            thing("block", [1.9, 1.7], [0.1, 0.1], vScale=1.1),
            thing("block", [4.2, 1.7], [0.1, 0.1], vScale=1.1),
            thing("block", [3, 2.2], [2.6, 1.2], vScale=1.1, surface="wood",
                  deck={"thickness": 0.06},
                  children=[thing("block", [2, 0.5], [0.5, 0.4], vScale=0.3)]),
            thing("block", [10.6, 6.4], [5, 3.4], vScale=3, surface="stone",
                  deck={"thickness": 0.25, "datum": True}, children=[
                      thing("block", [1.2, 2.2], [0.9, 1.1], surface="pit"),
                      thing("block", [3.2, 0.1], [3.6, 0.2], vScale=0.4)]),
            thing("rise", [6.4, 7.4], [3.4, 1], vScale=2.6, vOffset=0.4, surface="wood",
                  deck={"thickness": 0.2, "datum": True}),
            thing("block", [3.6, 5.9], [3, 1], turnDeg=25, vScale=1.5, surface="wood",
                  deck={"thickness": 0.1, "datum": True}),
            thing("block", [11.8, 2], [3.6, 2], vScale=2, surface="stone",
                  deck={"under": "span", "vScale": 1.2, "vOffset": 0.5, "datum": True}),
            thing("hill", [7.2, 2.4], [3, 4], vScale=2.2),
            thing("block", [7.2, 2.1], [4.4, 1.1], vScale=0, surface="stone",
                  bore={"roof": "vault", "vScale": 0.5, "vOffset": 0.6}),
            thing("block", [1.2, 7.6], [1.6, 1.8], surface="pit"),
            thing("block", [1.3, 7.4], [2.3, 0.5], vScale=0.7, surface="wood",
                  deck={"thickness": 0.08, "datum": True}),
        ],
    },
}  # fmt: skip

# a level deck that is turned, two that are not, one of them over a void
SHELVES: Json = {
    "size": [8, 5],
    "surfTypes": SURFACES,
    "elemTypes": TYPES,
    "elemTree": {
        "type": "block", "surface": "soil", "vScale": 0.2,
        "children": [
            thing("block", [2.2, 2.4], [2.4, 0.8], turnDeg=25, vScale=0.9, surface="wood",
                  deck={"thickness": 0.1, "datum": True}),
            thing("block", [4.5, 1.5], [0.1, 0.1], vScale=1.5),
            thing("block", [5.2, 1.7], [1.5, 0.5], vScale=1.5, surface="stone",
                  deck={"thickness": 0.05}),
            thing("block", [6.6, 3.9], [1.2, 1.4], surface="pit"),
            thing("block", [6.4, 4.1], [1.8, 0.4], vScale=0.6, surface="wood",
                  deck={"thickness": 0.15}),
        ],
    },
}  # fmt: skip

TUNNEL: Json = {
    "size": [8, 5],
    "surfTypes": SURFACES,
    "elemTypes": TYPES,
    "elemTree": {
        "type": "block", "surface": "soil", "vScale": 0,
        "children": [
            thing("block", [3.9, 2.4], [1.8, 4], vScale=1.2),
            thing("block", [4, 2.1], [5, 0.9], vScale=0, surface="stone",
                  bore={"roof": "vault", "vScale": 0.3, "vOffset": 0.4}),
        ],
    },
}  # fmt: skip
