"""Wrong values of options: each verb refuses them in a sentence, whatever they are."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rasterio.transform import Affine

import terratool
from terratool.api.starting import starter_options
from terratool.api.values import fitted
from terratool.authoring.starters.build import KINDS
from terratool.field.rays import cast
from tests.budget import thinned
from tests.commands import ROOT

HUSKY = ROOT / "samples/vehicles/husky-a200.json"
ROUGH = ROOT / "samples/curricula/rough.json"
SONAR = ROOT / "samples/sensors/senscomp-6500.json"
SITE: dict[str, Any] = {
    "size": [4, 3],
    "surfTypes": {"sand": {"preset": "dry-sand"}},
    "elemTypes": {"flat": {"x": [0, 0], "x-ignore": ["TT308"]}, "box": {"x": [1]}},
    "elemTree": {
        "type": "flat", "surface": "sand", "cells": [4, 3],
        "children": [{"cellX": 3, "cellY": 0, "type": "box", "vScale": 0.2}],
    },
}  # fmt: skip
PLACE = Affine(1.0, 0.0, 0.0, 0.0, -1.0, 3.0)
HEIGHTS = np.arange(12.0).reshape(3, 4) / 10
POSE = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
RAGGED = [[1.0, 2.0], [3.0]]
OTHER = {**SITE, "elemTypes": {**SITE["elemTypes"], "box": {"x": [0.5]}}}
WRONG: dict[str, Any] = {
    "text": "abc", "none": None, "five": 5, "empty": [], "object": object(), "nan": math.nan,
    "minus": -1, "path": Path("none/there"), "ragged": RAGGED, "infinite": math.inf,
    "words": ["a"], "huge": 10**400, "tiny": 1e-300, "fine": 1e-6, "dict": {"a": 1}, "yes": True,
    "array": np.array([1.5, 2.5]), "four": (1, 2, 3, 2.5), "line": [(1, 1), (1, 2)],
    "set": {1, 2.5}, "generator": (one for one in [1, 2]),
}  # fmt: skip
RARE = [*WRONG][[*WRONG].index("ragged") + 1 :]
"""Values that only all tests of a night try."""


def terrain() -> terratool.Terrain:
    return terratool.load(SITE)


def definition() -> terratool.Definition:
    made = terratool.Definition(size=(4, 3))
    made.primitive("box", x=[1])
    made.root("box")
    return made


Verb = Callable[..., Any]
SURE: dict[str, Any] = {"overwrite": True}
VERBS: dict[str, tuple[Callable[[], Verb], dict[str, Any]]] = {
    "to_dem": (lambda: terrain().to_dem, {"resolution": 1}),
    "write_dem": (lambda: terrain().write_dem, {"path": "a.tif", "resolution": 1, **SURE}),
    "contours": (lambda: terrain().write_dem,
                 {"path": "a.geojson", "resolution": 1, "layers": "contours", **SURE}),
    "tiles": (lambda: terrain().write_dem,
              {"tiles": "t", "tile_size": 32768, "resolution": 1, **SURE}),
    "to_mesh": (lambda: terrain().to_mesh, {"max_error": 0.1}),
    "to_mjspec": (lambda: terrain().to_mjspec, {"max_error": 0.1}),
    "write_mesh": (lambda: terrain().write_mesh, {"path": "a.obj", "max_error": 0.1, **SURE}),
    "solid": (lambda: terrain().write_mesh, {"path": "a.stl", "solid": True, **SURE}),
    "grid": (lambda: terrain().write_mesh,
             {"path": "a.wrl", "resolution": 1, "elevation_grid": True, **SURE}),
    "mesh of tiles": (lambda: terrain().write_mesh, {"path": "a.obj", "tile_faces": 9, **SURE}),
    "export_sim": (lambda: terrain().export_sim, {"folder": "o", "target": "gazebo", **SURE}),
    "nav2": (lambda: terrain().export_sim, {"folder": "o", "target": "nav2", **SURE}),
    "render": (lambda: terrain().render, {"pixels": 200, "bare": True}),
    "perspective": (lambda: terrain().render,
                    {"pixels": 200, "bare": True, "perspective": True}),
    "profile": (lambda: terrain().render,
                {"pixels": 600, "profile": (0, 0.5, 4, 0.5), "exaggeration": 1.0}),
    "view": (lambda: terrain().view, {"max_error": 0.1, "height": 90}),
    "traversability": (lambda: terrain().traversability,
                       {"vehicle": HUSKY, "resolution": 0.5, "headings": 4}),
    "way": (lambda: terrain().traversability,
            {"vehicle": HUSKY, "waypoints": [(1, 1.5), (2, 1.5)], "headings": 4}),
    "scan": (lambda: terrain().scan, {"sensor": SONAR, "pose": POSE}),
    "write_scan": (lambda: terrain().write_scan,
                   {"output": "a.csv", "sensor": SONAR, "pose": POSE, "on_ground": 1, **SURE}),
    "deform": (lambda: terrain().deform,
               {"vehicle": HUSKY, "waypoints": [(1, 1.5), (2, 1.5)], **SURE}),
    "compare": (lambda: terrain().compare, {"map": HEIGHTS, "transform": PLACE, **SURE}),
    "map_scans": (lambda: terratool.map_scans, {"scans": "cloud.csv", "resolution": 1, **SURE}),
    "diff": (lambda: terrain().diff, {"other": OTHER, "resolution": 0.5, **SURE}),
    "load": (lambda: terratool.load, {"definition": SITE}),
    "check": (lambda: terratool.check, {"definition": SITE}),
    "import_terrain": (lambda: terratool.import_terrain,
                       {"source": HEIGHTS, "transform": PLACE, "max_error": 0.1}),
    "import_primitive": (lambda: terratool.import_primitive,
                         {"source": HEIGHTS, "name": "a", "transform": PLACE}),
    "Definition": (lambda: terratool.Definition, {"size": 3}),
    "surface": (lambda: definition().surface, {"name": "sand"}),
    "primitive": (lambda: definition().primitive, {"name": "flat", "x": [0, 1]}),
    "part": (lambda: definition().part, {"name": "pile", "type": "box"}),
    "track": (lambda: definition().track, {"path": [[1, 1], [2, 2]], "width": 0.2, "depth": 0.1}),
    "root": (lambda: definition().root, {"type": "box"}),
    "add": (lambda: definition().add, {"type": "box", "cell": (0, 0)}),
    "save": (lambda: definition().save, {"path": "a.json", **SURE}),
    "compile": (lambda: definition().compile, {}),
}  # fmt: skip


def ask(verb: Verb, given: dict[str, Any], option: str, value: Any) -> None:
    """Ask for a value of an option; what is refused, is refused in two sentences."""
    try:
        found = verb(**{**given, option: value})
        made = getattr(verb, "__self__", found)
        if isinstance(made, terratool.Definition):
            made.validate()  # which says what is wrong with keys of the text
    except terratool.TerratoolError as error:
        assert error.message and error.hint, option


@pytest.mark.parametrize("verb", VERBS)
def test_what_is_tried_is_taken_by_itself(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A row that is refused by itself would try nothing."""
    in_folder(tmp_path, monkeypatch)
    make, given = VERBS[verb]
    make()(**given)


def in_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in a folder that has the cloud which a row reads."""
    monkeypatch.chdir(folder)
    Path("cloud.csv").write_text("x,y,z\n2,3,4\n2.5,3,4\n", "utf-8")


@pytest.mark.parametrize(
    "value", [pytest.param(one, marks=[pytest.mark.nightly] * (one in RARE)) for one in WRONG]
)
@pytest.mark.parametrize("verb", VERBS)
def test_any_value_of_any_option_is_taken_or_refused(
    verb: str, value: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With an error of the package, whose two sentences say what is wrong and what to do."""
    in_folder(tmp_path, monkeypatch)
    make, given = VERBS[verb]
    options = [*inspect.signature(make()).parameters]
    for option in thinned(options, f"{verb} {value}"):
        ask(make(), given, option, WRONG[value])


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=[pytest.mark.nightly] * (kind == "course")) for kind in KINDS],
)
def test_any_value_of_a_starter_is_taken_or_refused(kind: str) -> None:
    for value in WRONG.values():
        ask(terratool.new, {}, "kind", value)
        for option in starter_options(kind):
            ask(partial(terratool.new, kind), {}, option, value)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda t: t.to_dem(bounds="abc"),
         "bounds is 'abc'. Give west, south, east, north, all of them numbers."),
        (lambda t: t.to_dem(bounds=[1, 2, 3]), "bounds is [1, 2, 3]. Give west, south, east, nor"),
        (lambda t: t.to_dem(layers=5), "layers is 5. Give a list of texts."),
        (lambda t: t.to_dem(resolution=1e-6),
         "4,000,000 × 3,000,000 pixels take 48,000,000,000,000 bytes, which do not fit into "
         f"memory. Give a coarser resolution, such as {4 / 4096:.4g}, or smaller bounds"),
        (lambda t: t.export_sim("o", 5), "target is 5. Give a text or a list of texts."),
        (lambda t: t.export_sim("o", "gazebo", flex=1), "flex is 1. Give True or False."),
        (lambda t: t.write_mesh("a.obj", origin=object()), "origin is of type object. Give"),
        (lambda t: t.traversability(None), "vehicle is None. Give a Vehicle, a text, a path or a"),
        (lambda t: t.traversability(5), "vehicle is 5. Give a Vehicle"),
        (lambda t: t.traversability([]), "No vehicle is given. Give one, or several"),
        (lambda t: t.traversability(HUSKY, headings=0), "The number of headings is 0. Give a mul"),
        (lambda t: t.traversability(HUSKY, routes=[(1, 2, 3)]), "Give x0, y0, x1, y1, or x0, y0,"),
        (lambda t: t.traversability(HUSKY, waypoints=5), "Give two or more rows of x and y, or of"),
        (lambda t: t.traversability(HUSKY, routes=(one for one in [(0, 1, 3, 1)])),
         "routes is of type generator. Make a list of it."),
        (lambda t: t.view(vehicle=HUSKY, routes=zip([0], [1], [3], [1], strict=True)),
         "routes is of type zip. Make a list of it."),
        (lambda t: t.traversability(HUSKY, routes=[{0, 1, 2, 3}]), "Give x0, y0, x1, y1, or x0,"),
        (lambda t: t.traversability(HUSKY, report=iter(["a.md"])), "Make a list of it."),
        (lambda t: t.to_dem(bounds={0, 1, 2, 3}), "bounds is {0, 1, 2, 3}. Make a list of it."),
        (lambda t: t.to_dem(layers={"slope": 1}.keys()), "Make a list of it."),
        (lambda t: t.view(height={1}), "height is {1}. Give a whole number."),
        (lambda t: t.view(height="x"), "height is 'x'. Give a whole number."),
        (lambda t: terratool.check(SITE, kind="vehicel"), "Did you mean vehicle?"),
        (lambda t: terratool.check(SITE, kind="foo"),
         "kind is 'foo'. Choose terrain, library, vehicle, curriculum or sensor."),
        (lambda t: terratool.check(SITE, limit=10**30), "limit is too large a number. Give a who"),
        (lambda t: t.scan(SONAR, POSE, on_ground=1, seed=2**63),
         "seed is too large a number. Give a whole number up to 2^63 - 1 in size."),
        (lambda _: terratool.curriculum(ROUGH, seed=2**62),
         "Give one from 0 to 9,007,199,254,740,992."),
        (lambda t: terratool.import_terrain(RAGGED, transform=PLACE, max_error=1),
         "The heights are no array of real numbers. Give one of rows and columns."),
        (lambda t: terratool.import_terrain(HEIGHTS, transform=PLACE, max_error=1, crs=object()),
         "crs is of type object. Give a text, a whole number"),
        (lambda t: terratool.import_terrain(HEIGHTS, transform=PLACE, max_error=1, nodata="x"),
         "nodata is 'x'. Give a number."),
        (lambda t: definition().add("box", cell="ab"),
         "cell is 'ab'. Give column and row, as in cell=(3, 2)."),
        (lambda t: terratool.Definition(size=3, descr=(one for one in "a")),
         "Definition's descr is of type generator. Give texts, numbers, lists or dictionaries."),
        (lambda _: terratool.curriculum(ROUGH, seed="a"), "seed is 'a'. Give a whole number."),
        (lambda _: terratool.curriculum(5), "spec is 5. Give a Spec, a dictionary, a text or a p"),
        (lambda _: terratool.curriculum(ROUGH, seed=[1]), "seed is [1]. Give a whole number."),
        (lambda _: terratool.curriculum(ROUGH, seed=1.5), "seed is 1.5. Give a whole number."),
        (lambda t: t.to_dem(layers=["height", "surface"])["slope"],
         "The DEM has no band 'slope', but height and surface. Name one of these, or ask for it"),
        (lambda t: t.to_dem()[0], "The DEM has no band 0, but height."),
        (lambda t: t.scan(SONAR, "24 16 0"),
         "The pose is '24 16 0'. Give six numbers, x, y, z, yaw, pitch, roll, or rows of them."),
        (lambda t: t.scan(SONAR, [1, 2]), "The pose is an array of shape (2,). Give six numbers"),
        (lambda t: t.deform(HUSKY, [("1", 1), (2, 1)]),
         "Waypoints are [('1', 1), (2, 1)]. Give two or more rows of x and y, or of"),
        (lambda t: t.deform(HUSKY, (one for one in [(1, 1), (2, 1)])),
         "Waypoints are of type generator. Give two or more rows of x and y, or of"),
        (lambda t: t.traversability(HUSKY, waypoints=[("a", 1), (2, 1)]),
         "Waypoints are ('a', 1). Give two or more rows of x and y, or of"),
        (lambda t: t.compare(HEIGHTS, transform=5), "Give an Affine or a list of numbers."),
        (lambda t: terratool.load({"size": object()}),
         "cannot be written as JSON: it holds a value of type object. Give texts, numbers"),
        (lambda t: t.diff(OTHER, min_change=math.nan), "min_change is nan. Give a number from 0"),
        (lambda t: t.diff(OTHER, min_change=-1), "min_change is -1. Give a number from 0 on."),
        (lambda t: t.diff(OTHER, min_change=math.inf), "min_change is inf. Give a number from 0"),
        (lambda t: t.compare(np.full((3, 4), np.nan), transform=PLACE),
         "The array has no heights. Give a number where there is one."),
        (lambda _: terratool.schema("terain"), "no schema 'terain'. Did you mean terrain?"),
    ],
)  # fmt: skip
def test_a_wrong_type_is_told_by_the_name_of_the_option(call: Any, says: str) -> None:
    with pytest.raises(terratool.RequestError) as error:
        call(terrain())
    assert says in str(error.value)


@pytest.mark.parametrize(
    "value",
    [
        None, "4", [1, "4"], [1, None], 4j, np.datetime64("2024-01-01"),
        pytest.param(10**400, id="huge"),
        np.array(["4"]), np.array([1.0, None]), np.ones(1, complex), np.zeros(1, "m8[s]"),
    ],
)  # fmt: skip
def test_what_is_no_real_number_is_no_coordinate(value: Any) -> None:
    for asked in ((value, 1), (1, value)):
        with pytest.raises(terratool.RequestError, match="A coordinate is no number"):
            terrain().height(*asked)
    with pytest.raises(terratool.RequestError, match="no number"):
        cast(terrain(), [[1, 1, value]], [[0, 0, 1]])
    assert terrain().height(np.array([1, 2.5], object), Decimal(1)).shape == (2,)


@pytest.mark.parametrize(
    "heights",
    [
        HEIGHTS + 0j, HEIGHTS.astype("M8[s]"), HEIGHTS.astype("m8[s]"), HEIGHTS.astype(str),
        np.where(HEIGHTS > 0, HEIGHTS, None), np.ma.masked_less(HEIGHTS + 0j, 0.5),
    ],
)  # fmt: skip
def test_heights_are_real_numbers(heights: Any) -> None:
    for ask_for in (
        lambda: terratool.import_terrain(heights, transform=PLACE, max_error=0.1),
        lambda: terratool.import_primitive(heights, "a", transform=PLACE),
        lambda: terrain().compare(heights, transform=PLACE),
    ):
        with pytest.raises(terratool.RequestError, match="no array of real numbers"):
            ask_for()


@pytest.mark.parametrize("load", [terratool.load_vehicle, terratool.load_sensor])
def test_what_is_no_path_is_told(load: Any) -> None:
    for value in (5, [], None, ""):
        with pytest.raises(terratool.ReadError, match="is no name of a file"):
            load(value)


def test_an_empty_path_is_told() -> None:
    for load in (terratool.load, terratool.check, terratool.curriculum):
        with pytest.raises(terratool.ReadError) as error:
            load("")
        assert str(error.value) == "'': is no name of a file. Check the path."


def test_values_become_what_records_hold() -> None:
    """Numbers of NumPy, paths, and words by themselves, in nested types, too."""
    said = {
        ("float | None", np.float32(0.5)): 0.5,
        ("float", 3): 3.0,
        ("int", np.int16(4)): 4,
        ("bool", np.bool_(True)): True,
        ("str", np.float64): "float64",
        ("Sequence[str]", "slope"): ("slope",),
        ("Sequence[str | Path]", Path("a/b")): ("a/b",),
        ("tuple[int, ...]", (1, 2, 3)): (1, 2, 3),
    }
    for (annotation, value), wanted in said.items():
        found = fitted("it", value, annotation, "terratool.api.terrain")
        assert found == wanted and type(found) is type(wanted)
    lines = np.array([[0, 1, 2, 3], [4, 5, 6, 7]])
    found = fitted("it", lines, "Line | Sequence[Line]", "terratool.api.terrain")
    assert found == ((0.0, 1.0, 2.0, 3.0), (4.0, 5.0, 6.0, 7.0))
    for annotation in ("float", "int", "str", "Sequence[str]", "Line | None"):
        for value in (True, b"a", {"a": 1}, [[1]], object()):
            with pytest.raises(terratool.RequestError, match=r"^it is .*\. Give .*\.$"):
                fitted("it", value, annotation, "terratool.api.terrain")
