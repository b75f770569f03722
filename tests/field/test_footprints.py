"""The footprints of elements as GeoJSON, against points that the field answers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from terratool.field.footprints import features, geojson_head
from terratool.field.terrain import load
from tests.commands import ROOT, call
from tests.conftest import terrain_of

OBLONG = {
    "size": [40, 24], "origin": [-3, 7], "crs": "EPSG:32633",
    "elemTypes": {"box": {"x": [1, 1]}, "disc": {"x": [1, 1], "combine": "radial"}},
    "surfTypes": {"sand": {}},
    "elemTree": {
        "type": "box", "surface": "sand", "cells": [4, 3],
        "children": [
            {"type": "box", "cellX": 0, "cellY": 0, "turnDeg": 30, "vScale": 8},
            {"type": "disc", "cellX": 2, "cellY": 1, "span": [2, 1], "turnDeg": 70, "vScale": 4},
            {"type": "disc", "cellX": 1, "cellY": 2, "vScale": 2},
            {"type": "box", "cellX": 3, "cellY": 2, "turnDeg": -90, "vScale": 16},
        ],
    },
    "tracks": [
        {"path": [[0, 10], [5, 10], [9, 12]], "width": 0.5, "depth": 0.1, "surface": "sand"},
    ],
}  # fmt: skip


def inside(polygon: list[list[float]], x: float, y: float) -> float:
    """How far within a convex polygon, anticlockwise, a point lies; negative outside."""
    corners = np.array(polygon)
    sides = np.diff(corners, axis=0)
    lengths = np.hypot(*sides.T)
    kept = lengths > 0
    ahead = sides[kept] / lengths[kept, None]
    away = np.array([x, y]) - corners[:-1][kept]
    return float((ahead[:, 0] * away[:, 1] - ahead[:, 1] * away[:, 0]).min())


def test_polygons_hold_what_elements_raise() -> None:
    """Heights are sums of powers of two, which tell the elements over a point apart."""
    terrain = terrain_of(OBLONG)
    found = list(features(terrain))
    polygons = [
        f["geometry"]["coordinates"][0] for f in found if f["geometry"]["type"] == "Polygon"
    ]
    scales = [0, 8, 4, 2, 16]
    rng = np.random.default_rng(3)
    points = rng.uniform((-3, 7), (37, 31), (3000, 2))
    heights = terrain.height(*points.T)
    base = terrain.height(-2.9, 30.9)
    counted = 0
    for (x, y), height in zip(points, heights, strict=True):
        within = [inside(polygon, x, y) for polygon in polygons]
        if min(map(abs, within)) < 0.03:  # near an edge
            continue
        total = sum(scale for scale, depth in zip(scales, within, strict=True) if depth > 0)
        assert height - base == pytest.approx(total, abs=0.2)  # or in the rut
        counted += 1
    assert counted > 2500


def test_what_is_said_of_them() -> None:
    terrain = terrain_of(OBLONG)
    head = geojson_head(terrain)
    assert head["crs"]["properties"]["name"] == "urn:ogc:def:crs:EPSG::32633"
    *_, last, track = features(terrain)
    assert last["properties"] == {
        "pointer": "/elemTree/children/3", "type": "box", "surface": "sand",
    }  # fmt: skip
    assert track["geometry"] == {"type": "LineString", "coordinates": [[0, 10], [5, 10], [9, 12]]}
    assert track["properties"] == {
        "pointer": "/tracks/0", "surface": "sand", "width": 0.5, "passes": 1,
    }  # fmt: skip


@pytest.mark.parametrize("sample", sorted((ROOT / "samples").glob("*.json")), ids=lambda p: p.stem)
def test_samples(sample: Path) -> None:
    """The command writes one feature for each element, those of storeys too, and each track."""
    ran = call("info", sample, "--geojson")
    assert (ran.code, ran.err) == (0, "")
    found = json.loads(ran.out)
    terrain = load(sample)
    assert len(found["features"]) == terrain.all_elements + terrain.tracks
    for feature in found["features"]:
        if feature["geometry"]["type"] == "Polygon":
            (ring,) = feature["geometry"]["coordinates"]
            assert ring[0] == ring[-1] and len(ring) >= 4
            x, y = np.array(ring).T
            assert (x[:-1] * y[1:] - x[1:] * y[:-1]).sum() > 0  # anticlockwise


def test_decks_and_bores_by_hand() -> None:
    """A deck over sloping ground with a load in its middle, a bore that a deck stands in."""
    tunnel = {
        "at": [30, 13], "extent": [20, 6], "turnDeg": 90, "type": "box", "vScale": 1,
        "bore": {"roof": "box", "vScale": 5, "datum": True},
    }  # fmt: skip
    inner = {
        "at": [10, 3],
        "extent": [4, 2],
        "type": "box",
        "vScale": 2,
        "deck": {"thickness": 0.5},
    }
    shelf = {
        "cellX": 0, "cellY": 1, "type": "box", "vScale": 3, "deck": {"thickness": 0.25},
        "surface": "sand", "cells": [3, 1],
        "children": [{"type": "disc", "cellX": 1, "cellY": 0, "vScale": 0.5}],
    }  # fmt: skip
    tree = {"type": "slope", "vScale": 8, "cells": [4, 3], "children": [shelf, tunnel]}
    types = {**OBLONG["elemTypes"], "slope": {"x": [0, 1]}}  # type: ignore[dict-item]
    terrain = terrain_of({**OBLONG, "elemTypes": types, "elemTree": tree})
    tunnel_text = {**tunnel, "turnDeg": 0, "children": [inner]}
    found = {one["properties"]["pointer"]: one for one in features(terrain)}
    said = {pointer: one["properties"] for pointer, one in found.items()}
    # the slope rises 8 over 40: it is 1 in the middle of the first cell, 5 m from the west
    assert said["/elemTree/children/0"] == {
        "pointer": "/elemTree/children/0", "type": "box", "surface": "sand",
        "deck": "/elemTree/children/0", "top": 4.5, "underside": 3.75,
    }  # fmt: skip
    assert said["/elemTree/children/0/children/0"] == {
        "pointer": "/elemTree/children/0/children/0", "type": "disc", "surface": "sand",
        "deck": "/elemTree/children/0",
    }  # fmt: skip
    bore = said["/elemTree/children/1"]
    assert (bore["surface"], bore["floor"], bore["ceiling"]) == (None, 1.0, 5.0)
    ring = np.array(found["/elemTree/children/1"]["geometry"]["coordinates"][0])
    # turned by a quarter about (27, 20) of the world
    assert np.allclose([ring.min(axis=0), ring.max(axis=0)], [[24, 10], [30, 30]])
    text = {**OBLONG, "elemTypes": types, "elemTree": {**tree, "children": [shelf, tunnel_text]}}
    nested = [one["properties"] for one in features(terrain_of(text))]
    (one,) = (p for p in nested if p["pointer"] == "/elemTree/children/1/children/0")
    assert one["deck"] == one["pointer"] and (one["top"], one["underside"]) == (3.0, 2.5)
