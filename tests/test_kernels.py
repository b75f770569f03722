"""The boundary between Python and the kernels: what is refused, and that all variants agree."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import terratool.traversability.wheel  # noqa: F401, it declares records
from terratool import kernels
from terratool.field.bounds import nonzero_edges
from terratool.field.rays import storey_ray_index
from terratool.field.records import SAMPLES
from terratool.mesh.plan import plan_of
from terratool.mesh.types import COVERING_ELEMENT, Regions, Triangulation
from terratool.traversability.parameters import SoilSamples, soil_table, vehicle_params
from tests.conftest import terrain_of
from tests.programs import program
from tests.storey_examples import DEFINITIONS
from tests.surveys import ROVER, level_costs

ROOT = Path(__file__).parents[1]
X86 = platform.machine() in ("x86_64", "AMD64")
TERRAIN = terrain_of(
    {"size": [3, 2], "elemTypes": {"p": {"x": [0, 1]}}, "surfTypes": {"a": {}},
     "elemTree": {"type": "p", "surface": "a", "cells": 2, "children": [
         {"type": "p", "cellX": 1, "cellY": 0}]}}
)  # fmt: skip

Spec = dict[str, Any]
FUNCTIONS = [
    (part, name) for part in kernels.PARTS for name in sorted(getattr(kernels, part).SPECS)
]


def specs(part: str, name: str) -> list[Spec]:
    """What a function takes, as the bindings say."""
    found: list[Spec] = getattr(kernels, part).SPECS[name]
    return found


def known(kind: str) -> Any:
    """An object of a class of the kernels, or a number."""
    if kind in ("float", "int", "bool"):
        return {"float": 1.0, "int": 1, "bool": False}[kind]
    if kind == "Field":
        return TERRAIN.field
    edges = nonzero_edges(TERRAIN.arrays)
    if kind == "GridBytes":
        return kernels.field.GridMemory([np.zeros(64, np.uint8)])
    if kind == "Search":
        way = level_costs(3, 4)
        return kernels.traversability.Search(way, np.zeros(1, np.int64), 2, 3)
    if kind == "Painter":
        return kernels.field.Painter(TERRAIN.field, np.zeros(2, np.bool_), True, edges)
    if kind == "RayIndex":
        return kernels.field.RayIndex(TERRAIN.field, TERRAIN.cells())
    if kind == "StoreyRayIndex":
        return storey_ray_index(terrain_of(DEFINITIONS["bridge"]))
    if kind == "WallFinder":
        return kernels.field.WallFinder(TERRAIN.field, edges)
    if kind == "Storeys":
        storeys = terrain_of(DEFINITIONS["bridge"]).storeys
        assert storeys is not None
        return storeys.field
    if kind == "VehicleOnSoils":
        soils = soil_table(TERRAIN, ROVER)
        return kernels.traversability.VehicleOnSoils(vehicle_params(ROVER), *soils)
    if kind == "VehicleOnSamples":
        samples = SoilSamples(*np.ones((len(SoilSamples._fields), 70, len(TERRAIN.surfaces) + 1)))
        return kernels.traversability.VehicleOnSamples(vehicle_params(ROVER), samples)
    plan, _ = plan_of(TERRAIN, 0.1)
    if kind == "Plan":
        return plan.kernel_plan
    assert kind == "Refinement"
    triangle = Triangulation(
        np.array([[0, 0], [1000, 0], [0, 1000]]),
        np.array([[0, 1, 2]], np.int32),
        np.full((1, 3), -1, np.int32),
    )
    flag, nothing = np.zeros(1, bool), (np.zeros(2, np.int64), np.empty(0, COVERING_ELEMENT))
    region = Regions(*nothing, np.zeros(1, np.int32), flag, flag, np.zeros(1), np.zeros(1))
    return kernels.mesh.Refinement(
        plan.kernel_plan, region, triangle, np.zeros(1, np.int32), np.zeros((1, 3)), np.full(4, -1)
    )


def dtype_of(spec: Spec) -> np.dtype[Any]:
    return np.dtype(kernels.RECORDS[spec["record"]] if "record" in spec else spec["dtype"])


def shape_of(spec: Spec, spelled: str, letters: dict[str, int]) -> tuple[int, ...]:
    """A shape as it is spelled; each letter stands for a number of its own."""
    _, _, text = spelled.partition("[")
    sides = text.rstrip("]").split(",") if text else ["_"] * spec["rank"]
    lengths = []
    for side in sides:
        letter, _, more = side.partition("+")
        if letter.isdigit():
            lengths.append(int(letter))
        elif letter == "_":
            lengths.append(4)
        else:
            first = 2 if letter == "E" else 3 + len(letters)
            lengths.append(letters.setdefault(letter, first) + int(more or 0))
    return tuple(lengths)


def valid(spec: Spec, letters: dict[str, int]) -> Any:
    """An argument that fits."""
    if "members" in spec:
        members = {
            m["spelled"].lstrip("?").partition("[")[0]: valid(m, letters) for m in spec["members"]
        }
        return SimpleNamespace(**members)
    if "choices" in spec:
        return valid({**spec["choices"][0], "spelled": spec["spelled"]}, letters)
    if "rank" in spec:
        return np.zeros(shape_of(spec, spec["spelled"], letters), dtype_of(spec))
    return known(spec["type"])


def arrays_of(arguments: list[Spec], values: list[Any]) -> Iterator[tuple[str, Spec, Any, Any]]:
    """All arrays among arguments: name, spec, and where they are: an index or an attribute."""
    for k, (spec, value) in enumerate(zip(arguments, values, strict=True)):
        name = spec["spelled"].lstrip("?").partition("[")[0]
        if "members" in spec:
            for member in spec["members"]:
                own = member["spelled"].lstrip("?").partition("[")[0]
                yield f"{name}.{own}", member, value, own
        else:
            yield name, spec, values, k


def broken(array: np.ndarray, spec: Spec, writes: bool) -> Iterator[tuple[str, Any]]:
    """What does not fit in the place of an array."""
    kind = np.dtype([("a", np.int16)]) if array.dtype != np.int16 else np.dtype(np.float32)
    yield "dtype", np.zeros(array.shape, kind)
    if "record" not in spec and array.itemsize > 1:
        yield "byte order", array.astype(array.dtype.newbyteorder())
    yield "rank", np.zeros((*array.shape, 1), array.dtype)
    if array.ndim > 1:
        yield "rank", array[0]
    strided = np.zeros((*array.shape[:-1], 2 * array.shape[-1]), array.dtype)[..., ::2]
    turned = np.asfortranarray(np.zeros(array.shape, array.dtype))
    for what, wrong in (("stride", strided), ("order", turned)):
        if not wrong.flags.c_contiguous:  # one row, or one number, is contiguous in every order
            yield what, wrong
    yield "list", array.tolist()
    yield "nothing", None
    if writes:
        fixed = array.copy()
        fixed.flags.writeable = False
        yield "read-only", fixed


@pytest.mark.parametrize(("part", "name"), FUNCTIONS, ids=lambda value: value)
def test_arrays_that_do_not_fit_are_refused(part: str, name: str) -> None:
    """By dtype, rank, stride, order, and where they are written to, whether they may be."""
    arguments, function = specs(part, name), getattr(getattr(kernels, part), name)
    letters: dict[str, int] = {}
    values = [valid(spec, letters) for spec in arguments]
    for argument, spec, holder, where in arrays_of(arguments, values):
        if "rank" not in spec and "choices" not in spec:
            continue
        one = spec["choices"][0] if "choices" in spec else spec
        fits = holder[where] if isinstance(where, int) else getattr(holder, where)
        for what, wrong in broken(fits, one, one["writes"]):
            if wrong is None and spec["spelled"].startswith("?"):
                continue
            put(holder, where, wrong)
            with pytest.raises(TypeError) as refused:
                function(*values)
            assert str(refused.value).startswith(f"{name}(): {argument} must be "), what
        put(holder, where, fits)


def put(holder: Any, where: Any, value: Any) -> None:
    """Put an argument in its place."""
    if isinstance(where, int):
        holder[where] = value
    else:
        setattr(holder, where, value)


@pytest.mark.parametrize(("part", "name"), FUNCTIONS, ids=lambda value: value)
def test_arrays_of_another_length_are_refused(part: str, name: str) -> None:
    """Wherever a length follows from that of another array, or is a number."""
    arguments, function = specs(part, name), getattr(getattr(kernels, part), name)
    letters: dict[str, int] = {}
    values = [valid(spec, letters) for spec in arguments]
    everywhere = "".join(str(a) for a in arguments)
    for _, spec, holder, where in arrays_of(arguments, values):
        if "rank" not in spec and "choices" not in spec:
            continue
        fits = holder[where] if isinstance(where, int) else getattr(holder, where)
        sides = spec["spelled"].partition("[")[2].rstrip("]").split(",")
        for axis, side in enumerate(sides if sides[0] else []):
            letter = side.partition("+")[0]
            alone = letter == "_" or (not letter.isdigit() and uses(everywhere, letter) < 2)
            if alone and letter != "E":
                continue
            shape = list(fits.shape)
            shape[axis] += 1
            put(holder, where, np.zeros(shape, fits.dtype))
            with pytest.raises(TypeError, match=rf"{name}\(\): [\w.]+ must be "):
                function(*values)
        put(holder, where, fits)


def uses(text: str, letter: str) -> int:
    """How often a letter stands for a length."""
    return sum(
        side.partition("+")[0] == letter
        for shape in re.findall(r"\[([^\]']*)\]", text)
        for side in shape.split(",")
    )


@pytest.mark.parametrize("value", ["1", None, [1], 1j])
def test_numbers_that_are_none_are_refused(value: Any) -> None:
    x = np.zeros((2, 3))
    with pytest.raises(TypeError, match=r"gather\(\): shift must be a number, but is"):
        kernels.raster.gather(x, value, np.zeros((5, 3)))


@pytest.mark.parametrize("value", [1.5, "1", 1 << 70])
def test_whole_numbers_that_are_none_are_refused(value: Any) -> None:
    labels, heights = np.zeros((2, 3), np.uint32), np.zeros((2, 3))
    with pytest.raises(TypeError, match=r"height must be a whole number of 64 bits, but is"):
        kernels.field.find_candidates(labels, heights, value, 3)


def test_what_is_no_field_is_refused() -> None:
    with pytest.raises(TypeError, match=r"heights\(\): field must be a Field, but is str"):
        kernels.field.heights("field", np.zeros(1), np.zeros(1), np.zeros(1))


@pytest.mark.parametrize(
    ("count", "first", "samples"),
    [(-1, 0, 0), (np.inf, 0, 0), (-(10**6), SAMPLES + 10**6, 0), (1, SAMPLES, 1), (5, SAMPLES, 5)],
)
def test_curves_have_as_many_numbers_as_they_say(count: float, first: int, samples: int) -> None:
    arrays = TERRAIN.arrays
    kinds, curves = arrays.kinds.copy(), arrays.curves._replace(samples=np.zeros(samples))
    kinds["count"][-1, 0], kinds["knotted"][-1, 0], kinds["special"][-1] = count, 0, 1
    kinds["pieces"][-1, 0] = first, 0
    with pytest.raises(TypeError, match="a curve leads nowhere"):
        kernels.field.Field(arrays._replace(kinds=kinds, curves=curves))
    if samples == 5:  # as many as it says, but not for what has no samples
        kinds["count"][-1, 0] = 4
        kernels.field.Field(arrays._replace(kinds=kinds, curves=curves))
        kinds["special"][-1] = 0
        with pytest.raises(TypeError, match="a curve of samples leads nowhere"):
            kernels.field.Field(arrays._replace(kinds=kinds, curves=curves))


@pytest.mark.parametrize(
    ("name", "member", "value", "what"),
    [
        ("elements", "kind", 9, "an element"),
        ("elements", "grid", 9, "an element"),
        ("elements", "grid", 1, "the grid of an element"),
        ("grids", "row", 0, "a row of bins"),
        ("grids", "table", 99, "a grid"),
        ("kinds", "pieces", 99, "a curve"),
        ("kinds", "pieces", SAMPLES, "a curve"),
    ],
)
def test_a_field_that_leads_nowhere_is_refused(
    name: str, member: str, value: int, what: str
) -> None:
    """Once, when it is made; kernels follow all of its indices."""
    arrays = TERRAIN.arrays
    changed = getattr(arrays, name).copy()
    changed[member][-1] = value
    with pytest.raises(TypeError, match=f"{what} leads nowhere"):
        kernels.field.Field(arrays._replace(**{name: changed}))


def test_objects_that_hold_nothing_are_refused() -> None:
    """Made by __new__ alone."""
    x = np.zeros(1)
    for kind in (kernels.field.Field, kernels.mesh.Plan):
        empty = kind.__new__(kind)
        with pytest.raises(TypeError, match=r"field must be a Field, but is"):
            kernels.field.heights(empty, x, x, x.copy())


def test_planes_that_a_painter_has_not_are_refused() -> None:
    x, plane = np.array([1.0, 2.0]), np.zeros((2, 2))
    painter = kernels.field.Painter(TERRAIN.field, np.zeros(2, np.bool_), False, None)
    others = ["surfaces", "slope_x", "slope_y", "labels", "columns", "within", "figures", "seen"]
    planes = SimpleNamespace(heights=plane, **dict.fromkeys(others))
    kernels.field.paint(painter, x, x, 1.0, 0, 0, planes)
    for name, wrong in (("slope_y", plane), ("labels", np.zeros((2, 2), np.uint32))):
        more = SimpleNamespace(**{**vars(planes), name: wrong})
        with pytest.raises(TypeError, match=r"Painter\(\): a (slope|label) leads nowhere"):
            kernels.field.paint(painter, x, x, 1.0, 0, 0, more)


def test_pairs_of_pixels_that_are_not_there_are_refused() -> None:
    finder = known("WallFinder")
    x, y = np.array([0.5, 1.5]), np.array([0.5, 1.5, 2.5])
    for pair in (-1, 2 * 1, 2 * 5, 2 * 4 + 1, 99):
        with pytest.raises(IndexError, match="leads nowhere"):
            kernels.field.first_wall(finder, np.array([pair]), np.zeros(1), x, y, 1.0, 0.1)
    with pytest.raises(IndexError, match="leads nowhere"):
        kernels.field.first_wall(finder, np.array([0]), np.zeros(1), x[:0], y, 1.0, 0.1)
    labels = np.zeros((2, 3), np.uint32)
    with pytest.raises(IndexError, match="fewer labels"):
        kernels.field.find_candidates(labels, np.zeros((2, 3)), 3, 3)


def test_an_index_of_rays_is_made_of_a_field_and_its_cells() -> None:
    cells = TERRAIN.cells()
    for wrong in (cells[:3], cells.astype(np.float32), cells[:, :1], cells.tolist()):
        with pytest.raises(TypeError, match=r"RayIndex\(\): cells must be "):
            kernels.field.RayIndex(TERRAIN.field, wrong)
    with pytest.raises(TypeError, match=r"RayIndex\(\): field must be a Field, but is str"):
        kernels.field.RayIndex("field", cells)
    empty = kernels.field.RayIndex.__new__(kernels.field.RayIndex)
    three, one = np.zeros((1, 3)), np.zeros(1)
    rays = SimpleNamespace(origins=three, directions=three, most=one)
    with pytest.raises(TypeError, match=r"cast\(\): index must be a RayIndex, but is"):
        kernels.field.cast(empty, rays, SimpleNamespace())


def test_indices_of_storeys_are_those_of_their_fields() -> None:
    storeys, index = known("Storeys"), known("RayIndex")
    with pytest.raises(TypeError, match=r"StoreyRayIndex\(\): a sheet leads nowhere"):
        kernels.field.StoreyRayIndex(storeys, index, ())
    with pytest.raises(TypeError, match=r"StoreyRayIndex\(\): tops leads nowhere"):
        kernels.field.StoreyRayIndex(storeys, index, [(index, index)])
    with pytest.raises(TypeError, match=r"StoreyRayIndex\(\): index must be a "):
        kernels.field.StoreyRayIndex(storeys, storeys, ())
    with pytest.raises(TypeError, match=r"StoreyRayIndex\(\): index must be a "):
        kernels.field.StoreyRayIndex(index, index, ())


def test_dtypes_that_are_not_the_structs_are_refused() -> None:
    """Member by member: a name, a type or a place that differs."""
    from terratool.field.records import (
        CLASS_GRID,
        COPIES,
        ELEMENT,
        FREE_BINS,
        GRID,
        KIND,
        MEMBER,
        PLACE,
        POSE,
        RASTER,
        RELIEF,
        SEGMENT,
    )

    *most, kind, grid = ELEMENT.descr
    swapped = np.dtype([*most, grid, kind])
    wider = np.dtype([*ELEMENT.descr, ("more", np.float64)])
    other = np.dtype([*most, kind, ("grid", np.int32)])
    apart = np.dtype([("cell", np.uint16), ("cell_y", np.uint16), *ELEMENT.descr[1:]])
    others = (
        GRID, POSE, PLACE, FREE_BINS, KIND, RASTER, CLASS_GRID, SEGMENT, MEMBER, COPIES, RELIEF,
    )  # fmt: skip
    for wrong in (swapped, wider, other, apart):
        with pytest.raises(TypeError, match="is not the struct of the kernels"):
            kernels.field.check_records(wrong, *others)
    kernels.field.check_records(ELEMENT, *others)


# The variants

DIGEST = """
import sys
sys.path.insert(0, {root!r})
from tests.test_kernels import digest
print(digest())
"""


def digest() -> str:
    """What some terrains are worth everywhere, as one number."""
    from terratool.field.terrain import load
    from terratool.mesh.build import build
    from terratool.raster.grid import grid_over
    from terratool.raster.loss import LossFinder
    from terratool.raster.painter import Painter

    found = hashlib.sha256(b"")
    for path in sorted((ROOT / "samples").glob("*.json")):
        terrain = load(path)
        west, south, east, north = terrain.bounds
        rng = np.random.default_rng(5)
        x, y = rng.uniform(west, east, 5000), rng.uniform(south, north, 5000)
        sample = terrain.sample(x, y)
        grid = grid_over(terrain, max(terrain.size) / 211)
        planes = Painter(terrain, grid, np.float64, slopes=True, labels=True).paint(grid.whole)
        arrays = [terrain.height(x, y), sample.height, sample.element, sample.normal]
        tall = np.nanmax(sample.height) + 0.1 * max(terrain.size)
        ways = rng.normal(size=(5000, 3)) * [1, 1, 0.2]
        hits = terrain.cast(np.column_stack([x, y, rng.uniform(0, tall, 5000)]), ways)
        arrays += [hits.distance, hits.point, hits.normal, hits.element, hits.wall]
        arrays += [planes.heights, planes.surfaces, planes.slope_x, planes.slope_y, planes.labels]
        found.update(repr(LossFinder(terrain, grid).of(grid.whole, planes)).encode())
        if path.stem in ("paper-example", "stairs-and-kerbs", "wheel-tracks"):
            mesh = build(terrain, 0.05).mesh
            arrays += [mesh.vertices, mesh.faces]
        for array in arrays:
            found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


@pytest.mark.slow
@pytest.mark.skipif(not X86, reason="other processors have one variant")
def test_both_variants_give_the_same_bits() -> None:
    """Heights, surfaces, normals, rays, planes, losses and meshes of all samples.

    And so does a BLAS for another processor, whose sums come in another order.
    """
    if not kernels.is_v3():
        pytest.skip("this processor has no x86-64-v3")
    if not all(find_spec(f"terratool.kernels.{variant}") for variant in ("baseline", "v3")):
        pytest.skip("one variant was built; make baseline builds both")
    said = []
    for variant, blas in (("baseline", "Prescott"), ("v3", "Haswell")):
        environment = {**os.environ, "TERRATOOL_CPU": variant, "OPENBLAS_CORETYPE": blas}
        command = [sys.executable, "-c", DIGEST.format(root=str(ROOT))]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
        said.append(done.stdout)
    assert len(said[0]) == 65
    assert said[0] == said[1]


def test_the_variant_can_be_chosen_and_no_other() -> None:
    """One that is not built here is refused, with what builds it."""
    code = "from terratool import kernels; print(kernels.variant)"
    for wanted in ("baseline", "v3", "fastest"):
        environment = {**os.environ, "TERRATOOL_CPU": wanted}
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, env=environment
        )
        if wanted == "fastest" or (wanted == "v3" and not kernels.is_v3()):
            assert f"TERRATOOL_CPU is '{wanted}', which this processor" in done.stderr
        elif find_spec(f"terratool.kernels.{wanted}"):
            assert done.stdout.split() == [wanted]
        else:
            assert f"not built for {wanted} here" in done.stderr
            assert "make install VARIANTS=all" in done.stderr


# What the compiler made of it

INSTRUCTION = re.compile(r"^\s+[0-9a-f]+:\s+(?:[0-9a-f]{2} )+\s*(\w+)", re.MULTILINE)


@pytest.mark.slow
@pytest.mark.skipif(not X86, reason="other processors name these otherwise")
def test_no_product_and_sum_are_one_instruction() -> None:
    """Fused multiply-add rounds once; where it is used would be up to the compiler."""
    path = kernels._compiled.__file__
    text = subprocess.run(
        [program("objdump"), "--disassemble", path], capture_output=True, text=True, check=True
    ).stdout
    names = set(INSTRUCTION.findall(text))
    assert {"mulsd", "vmulsd"} & names
    assert not [name for name in names if re.match(r"vfn?m(add|sub)", name)]


def compile_commands() -> dict[str, list[str]]:
    """How the source of the field's bindings was compiled, by variant."""
    found = {}
    for path in ROOT.glob("build/*/compile_commands.json"):
        for entry in json.loads(path.read_text()):
            variant = re.search(r"kernels_(\w+)\.dir/kernels/python/field\.cpp", entry["command"])
            if variant and " -O3 " in entry["command"] and "-fsanitize" not in entry["command"]:
                found[variant[1]] = entry["command"].split()
    return found


@pytest.mark.nightly
@pytest.mark.skipif(not X86, reason="other processors name these otherwise")
@pytest.mark.skipif(not compile_commands(), reason="the kernels were not built in this checkout")
@pytest.mark.parametrize("variant", sorted(compile_commands()))
def test_rows_are_added_by_vector_instructions(variant: str, tmp_path: Path) -> None:
    """Multiplications, or where there are none additions, of several numbers at a time."""
    source = ROOT / "tests" / "rows.cpp"
    command = compile_commands()[variant]
    for option in ("-o", "-c"):
        at = command.index(option)
        del command[at : at + 2]
    out = tmp_path / "rows.s"
    subprocess.run([*command, "-S", str(source), "-o", str(out)], check=True, cwd=ROOT)
    bodies = re.split(r"^(\w+):$", out.read_text(), flags=re.MULTILINE)
    functions = dict(zip(bodies[1::2], bodies[2::2], strict=True))
    names = re.findall(r"^void (\w+)\(", source.read_text(), flags=re.MULTILINE)
    assert len(names) > 10
    for name in names:
        assert re.search(r"\bv?(mul|add|sub)p[ds]\b|\bv?paddd\b", functions[name]), name
