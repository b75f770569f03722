"""Terrains, vehicles and curves: made of the samples by small mistakes, read, and asked."""

from __future__ import annotations

import json
import math
import pickle
import random
import zlib
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.expressions import formula, heavy, mutated, noise, spelled
from terratool.authoring.curriculum.reading import load_spec
from terratool.definition.accuracy import SLACK, TOLERANCE
from terratool.definition.bundle import bundle
from terratool.definition.expression import NAMED
from terratool.definition.keys import KEYS as KEYS_OF
from terratool.definition.keys import Kind
from terratool.definition.layout import canonical
from terratool.definition.libraries import known_names
from terratool.definition.model import COMBINES
from terratool.definition.reader import Checked, check
from terratool.definition.uses import Uses
from terratool.field.terrain import Terrain
from terratool.mesh.export import relief_of
from terratool.raster.grid import grid_over
from terratool.raster.painter import Painter
from terratool.sensing.poses import one_pose
from terratool.sensing.scan import Scan, ScanOptions
from terratool.sensing.sensor import load_sensor
from terratool.text.source import Source
from terratool.traversability.vehicle_files import vehicle_of
from tests.commands import ROOT
from tests.fuzz.harness import Case, Target, WrongError, ask
from tests.fuzz.mutation import mutate_bytes, mutate_tree
from tests.oracle import Expression
from tests.sensing.yard import HERE as PLACE
from tests.sensing.yard import TERRAIN as YARD
from tests.vehicles import LOPSIDED, TRACKED, WALKING

HERE = (*PLACE, 20.0, 0.0, 0.0)
KEYS = sorted({*chain.from_iterable(KEYS_OF.values()), "x-ignore", "x-note"})
LONGEST = 200_000
"""Bytes of a definition, so that repeated repetition ends."""


_HARMLESS = {"TT306", "TT307", "TT308"}
"""Warnings of a curve that do not say that it may be off."""


_FINE = 1e15
_STEEP = 1e4
"""Elements that rise by so many errors, or more, make meshes without end."""


@cache
def _texts(kind: Kind) -> list[bytes]:
    folders = {
        "terrain": ["samples", "samples/invalid", "tests/example-files/valid"],
        "vehicle": ["samples/vehicles"],
        "sensor": ["samples/sensors"],
        "curriculum": ["samples/curricula"],
    }[kind]
    paths = chain.from_iterable(sorted((ROOT / folder).glob("*.json")) for folder in folders)
    found = [path.read_bytes() for path in paths if path.stat().st_size < 20_000]
    if kind == "vehicle":
        found += [json.dumps(value).encode() for value in (LOPSIDED, TRACKED, WALKING)]
    return found


@cache
def _trees(kind: Kind) -> list[bytes]:
    """The texts as trees, pickled, which is the quickest way to a copy."""
    found = []
    for text in _texts(kind):
        try:
            found.append(pickle.dumps(json.loads(text)))
        except ValueError:
            continue
    return found


def make_terrain(rng: random.Random) -> Case:
    """A definition that is nearly right, or quite."""
    if rng.random() < 0.3:
        tree = _random_terrain(rng)
        mistakes = rng.choice([0, 0, 1, 2])
    else:
        tree = pickle.loads(rng.choice(_trees("terrain")))
        mistakes = rng.choice([1, 1, 2, 3, 8])
    return _with_mistakes(rng, tree, mistakes, "terrain")


def make_vehicle(rng: random.Random) -> Case:
    """A vehicle that is nearly right, or quite."""
    tree = pickle.loads(rng.choice(_trees("vehicle")))
    return _with_mistakes(rng, tree, rng.choice([1, 1, 1, 2, 4]), "vehicle")


def make_sensor(rng: random.Random) -> Case:
    """A sensor that is nearly right, or quite."""
    tree = pickle.loads(rng.choice(_trees("sensor")))
    return _with_mistakes(rng, tree, rng.choice([0, 1, 1, 1, 2, 4]), "sensor")


def make_curriculum(rng: random.Random) -> Case:
    """A spec of training tiles that is nearly right, or quite; small, so that it can be made."""
    tree = pickle.loads(rng.choice(_trees("curriculum")))
    tree |= {"rows": rng.randint(1, 3), "columns": rng.randint(1, 4)}
    tree["kinds"] = dict(rng.sample(sorted(tree["kinds"].items()), rng.randint(1, 3)))
    return _with_mistakes(rng, tree, rng.choice([0, 1, 1, 1, 2, 4]), "curriculum")


def _with_mistakes(rng: random.Random, tree: Any, mistakes: int, kind: Kind) -> Case:
    for _ in range(mistakes):
        other = pickle.loads(rng.choice(_trees(kind)))
        tree = mutate_tree(rng, tree, KEYS, other)
    try:
        data = json.dumps(tree, ensure_ascii=False, separators=(",", ":")).encode()
    except (UnicodeEncodeError, RecursionError):
        data = b'{"size":1}'
    if rng.random() < 0.15:
        for _ in range(rng.choice([1, 1, 3])):
            data = mutate_bytes(rng, data, rng.choice(_texts(kind)))
    return Case(".json", data[:LONGEST])


def _random_terrain(rng: random.Random) -> Any:
    """A definition without mistakes, of any numbers."""
    primitives = {f"p{n}": _random_primitive(rng) for n in range(rng.randint(1, 3))}
    scale = 10.0 ** rng.choice([0, 0, 1, 2, -3, 6, -30, 29])
    tree = {
        "size": rng.choice([scale, [scale, scale * rng.choice([0.5, 3, 1e-6])]]),
        "surfTypes": {"s": {"void": rng.random() < 0.2}, "r": {"color": [1, 2, 3]}},
        "elemTypes": primitives,
        "elemTree": _random_element(rng, list(primitives), 0),
    }
    if rng.random() < 0.3:
        tree["origin"] = [rng.choice([-5, 1e6, 1e30, 0.1]), rng.choice([0, -1e9])]
    if rng.random() < 0.2:
        path = [[rng.uniform(-0.2, 1.2) * scale for _ in "xy"] for _ in range(rng.randint(2, 5))]
        tree["tracks"] = [{"path": path, "width": scale / rng.choice([3, 30, 1e9]), "depth": 0.1}]
    return tree


def _random_primitive(rng: random.Random) -> Any:
    values = [rng.choice([0, 1, rng.uniform(-1, 2), 1e-9, 1e30]) for _ in range(rng.randint(1, 6))]
    times = sorted(rng.choice([0.5, rng.random()]) for _ in values[2:])
    knots = [[t, z] for t, z in zip([0, *times, 1], [*values, 1], strict=False)]
    found = {"x": rng.choice([values, knots, rng.choice(list(NAMED)), formula(rng, 3)])}
    found["combine"] = rng.choice(COMBINES)
    if found["combine"] != "radial" and rng.random() < 0.7:
        found["y"] = rng.choice([[], values[::-1], rng.choice(list(NAMED))])
    return found


def _random_element(rng: random.Random, types: list[str], level: int) -> Any:
    found: Any = {"type": rng.choice(types)}
    if rng.random() < 0.5:
        found["vScale"] = rng.choice([0, 1, -1, rng.uniform(-3, 3), 1e-12, 1e20])
    if rng.random() < 0.3:
        found["turnDeg"] = rng.choice([90, 45, 180, rng.uniform(-400, 400), 1e-9])
    if rng.random() < 0.3:
        found["surface"] = rng.choice("sr")
    if level < 5 and rng.random() < 0.7:
        nx, ny = (rng.choice([1, 2, 3, 7, 65536]) for _ in "xy")
        found["cells"] = [nx, ny]
        found["children"] = []
        for _ in range(rng.randint(0, 3)):
            child = _random_element(rng, types, level + 1)
            child |= {"cellX": rng.randrange(nx), "cellY": rng.randrange(ny)}
            if rng.random() < 0.3:
                spare = nx - child["cellX"], ny - child["cellY"]
                child["span"] = [rng.randint(1, n) for n in spare]
            found["children"].append(child)
    return found


def make_composition(rng: random.Random) -> Case:
    """A terrain of parts in parts, copies and free places, with few mistakes."""
    scale = 10.0 ** rng.choice([0, 1, 1, 2, -3, 6])
    names = [f"q{n}" for n in range(rng.randint(1, 4))]
    tree: Any = {
        "size": rng.choice([scale, [scale, scale * rng.choice([0.5, 3])]]),
        "surfTypes": {"s": {"void": rng.random() < 0.2}, "r": {}},
        "elemTypes": {"p0": _random_primitive(rng), "p1": {"x": [1]}},
        "elemTree": _random_composition(rng, names, scale, 0),
        "parts": {
            # now and then a part that contains itself
            name: _random_composition(rng, names[n + (rng.random() < 0.97) :], 1e-3 * scale, 1)
            for n, name in enumerate(names)
        },
    }
    if rng.random() < 0.3:
        tree["use"] = rng.choices(_LIBRARIES, _LIKELY, k=rng.randint(0, 3))
    return _with_mistakes(rng, tree, rng.choice([0, 0, 0, 1, 1, 3]), "terrain")


_LIBRARIES = (
    "samples/kit/soils.json", "samples/kit/storage.json", "samples/kit/../kit/rocks.json",
    "samples/warehouse.json", "samples/none.json", "../x.json", "/etc/passwd", "samples", "",
)  # fmt: skip
_LIKELY = (50, 50, 50, 1, 1, 1, 1, 1, 1)


def _random_composition(rng: random.Random, names: list[str], side: float, level: int) -> Any:
    """An element, without its place, in a cell of which each side is so long or longer."""
    found: Any = {}
    if rng.random() < 0.4:
        found["vScale"] = rng.choice([0, 1, -1, rng.uniform(-3, 3), 1e-12, 1e9])
    if rng.random() < 0.3:
        found["vOffset"] = rng.choice([0, 1, rng.uniform(-3, 3)])
    if rng.random() < 0.4:
        found["turnDeg"] = 45 if rng.random() < 0.03 else rng.choice([90, 90, -90, 180, 270.0, 450])
    if rng.random() < 0.3:
        found["surface"] = rng.choice("sr")
    if names and rng.random() < 0.6:
        return found | {"part": rng.choice(names)}
    found["type"] = rng.choice(["p0", "p1"])
    if level > 3:
        return found
    grid = found["cells"] = [rng.choice([1, 2, 3, 3, 65536 if level > 2 else 1]) for _ in "xy"]
    found["children"] = []
    for _ in range(rng.randint(0, 3)):
        free = rng.random() < 0.4
        own = side * rng.choice([1e-6, 0.05, 0.1]) if free else side / max(grid)
        child = _random_composition(rng, names, own, level + 1)
        count = [rng.choice([1, 2, 3]) for _ in "xy"]
        if free:
            child["at"] = [side * rng.uniform(0.3, 0.6) for _ in "xy"]
            child["extent"] = rng.choice([own, [own, own * rng.choice([1, 2])]])
            step = [side * rng.uniform(-0.05, 0.05) for _ in "xy"]
        else:
            child |= {"cellX": rng.randrange(grid[0]), "cellY": rng.randrange(grid[1])}
            step = [0, 0]
            if rng.random() < 0.5:
                child |= {"cellX": 0, "cellY": 0}
                step, count = [1, 1], [rng.randint(1, min(n, 9)) for n in grid]
        if rng.random() < 0.02:
            count = [65536, 65536]
        if rng.random() < 0.3:
            child["repeat"] = {"count": count, "step": step}
        found["children"].append(child)
    return found


def make_curve(rng: random.Random) -> Case:
    """A terrain that is one curve."""
    kind = rng.randrange(20)
    if kind < 12:
        text = formula(rng, rng.randint(1, 6))
    elif kind < 18:
        text = mutated(rng)
    elif kind == 18:
        text = noise(rng)
    else:
        text = heavy(rng)
    return Case(".json", spelled(text))


# --- what is done with them ----------------------------------------------------------------------


def try_terrain(case: Case, folder: Path) -> str:
    """Check it, and ask it in every way that is quick; now and then by commands, too."""
    draw = zlib.crc32(case.data)
    checked = _checked(case, "terrain")
    if checked.readable and draw % 4 == 0:
        _lay_out(case.data)
    if draw % 128 == 0:
        _say_findings(case, folder, draw // 128)
    if checked.definition is None:
        return "invalid"
    if any(finding.code == "TT722" for finding in checked.findings):
        return "said to take long"
    terrain = Terrain(checked)
    west, south, east, north = terrain.bounds
    shares = np.array([-0.1, 0, 0.1, 1 / 3, 0.5, 0.9, 1])
    x, y = np.meshgrid(west + shares * (east - west), south + shares * (north - south))
    found = terrain.sample(x, y)
    if np.isinf(found.height).any() or not np.array_equal(
        found.height, terrain.height(x, y), equal_nan=True
    ):
        raise WrongError("heights are infinite, or of two kinds")
    if draw % 8 == 0:
        grid = grid_over(terrain, max(terrain.size) / 16)
        Painter(terrain, grid, slopes=True, labels=True).paint(grid.whole)
    if draw % 64 == 0:
        _write(case, folder, terrain, draw // 64)
    return "valid"


def _checked(case: Case, kind: Kind) -> Checked:
    """What the reader makes of it; what it finds is said, and lies in the text."""
    source = Source("case.json", case.data.removeprefix(b"\xef\xbb\xbf"))
    checked = check(source, kind=kind)
    lines = 1 + len(source.data.decode("utf-8", "replace").splitlines())
    for finding in checked.findings:
        if not (finding.message and 1 <= finding.line <= lines and finding.column >= 1):
            raise WrongError(f"a finding of {finding.code} without words or a place")
        finding.message.encode()
    return checked


def _lay_out(data: bytes) -> None:
    """The canonical text has the same values, and is its own."""
    text = data.decode("utf-8").removeprefix("\ufeff")
    once = canonical(text)
    if canonical(once) != once:
        raise WrongError("the canonical text is not its own")
    try:
        same = json.dumps(json.loads(once), sort_keys=True) == json.dumps(
            json.loads(text), sort_keys=True
        )
    except (RecursionError, ValueError):  # deeper, or with longer numbers, than Python reads
        return
    if not same:
        raise WrongError("the canonical text says something else")


def _say_findings(case: Case, folder: Path, draw: int) -> None:
    name = folder / "case.json"
    name.write_bytes(case.data)
    form = ("text", "json", "sarif", "github", "junit", "gitlab")[draw % 6]
    ask("validate", name, "--format", form)
    ask("format", name)
    name.unlink()


def _write(case: Case, folder: Path, terrain: Terrain, draw: int) -> None:
    name, size = folder / "case.json", max(terrain.size)
    name.write_bytes(case.data)
    dem = ("dem.tif", "dem.asc", "dem.png", "dem.npy")[draw % 4]
    mesh = ("mesh.glb", "mesh.obj", "mesh.stl", "mesh.wrl", "mesh.x3d", "mesh.ply")[draw % 6]
    ask("export-dem", name, folder / dem, "--resolution", repr(size / 12), "--overwrite")
    error = relief_of(terrain, None) / 20 or 1
    arrays = terrain.arrays
    numbers = np.append(arrays.curves.pieces, arrays.curves.samples)
    largest = np.abs(numbers).max(initial=0) * np.abs(arrays.elements["scale"]).max()
    # nor what is so much larger than the error that the digits of float64 do not tell it
    if largest < min(_STEEP * error, 1e30) and size < _FINE * error:
        ask("export-mesh", name, folder / mesh, "--max-error", repr(error), "--overwrite")
    ask("info", name, "--json")
    for path in folder.iterdir():
        path.unlink()


def try_composition(case: Case, folder: Path) -> str:
    """Check and count it; what is not too large is the same as its bundle and its expansion."""
    checked = _checked(case, "terrain")
    for library in checked.libraries:
        if any(not finding.message or finding.line < 1 for finding in library.findings):
            raise WrongError("a finding of a library without words or a place")
    if checked.terrain is None or checked.document is None:
        return "invalid"
    count = Uses(checked.document, known_names(checked.document)).elements
    if count > _WRITTEN:
        text = bundle(checked).text
        if check(Source("bundle.json", text.encode())).terrain is None:
            raise WrongError("a bundle is invalid")
        return "large"
    if checked.expansion is None or len(checked.expansion.tree) != count:
        raise WrongError("there are as many elements as were counted, or not")
    terrain = Terrain(checked)
    west, south, east, north = terrain.bounds
    shares = np.array([0, 0.03, 0.06, 0.1, 1 / 3, 0.5, 0.9, 1])
    x, y = np.meshgrid(west + shares * (east - west), south + shares * (north - south))
    heights = terrain.height(x, y).tobytes()
    for expanded in (False, True):
        text, rounded, _ = bundle(checked, expanded=expanded)
        other = check(Source("bundle.json", text.encode()))
        if other.terrain is None:
            raise WrongError(f"expanded: {expanded}: {other.findings[0].message}")
        if not rounded and Terrain(other).height(x, y).tobytes() != heights:
            raise WrongError(f"expanded: {expanded}: heights differ")
    return "valid"


_WRITTEN = 5_000


def try_vehicle(case: Case, folder: Path) -> str:
    """Check it, and let it drive now and then."""
    checked = _checked(case, "vehicle")
    if checked.readable:
        _lay_out(case.data)
    if checked.vehicle is None:
        return "invalid"
    vehicle_of(checked.vehicle)
    if zlib.crc32(case.data) % 64 == 0:
        name = folder / "case.json"
        name.write_bytes(case.data)
        terrain = ROOT / "tests" / "example-files" / "valid" / "every-key.json"
        ask("traversability", terrain, "--vehicle", name, "--resolution", 1, "--headings", 4)
        name.unlink()
    return "valid"


def try_sensor(case: Case, folder: Path) -> str:
    """Check it; what is valid reads a yard now and then, if it has few rays."""
    checked = _checked(case, "sensor")
    if checked.readable:
        _lay_out(case.data)
    if checked.sensor is None:
        return "invalid"
    name = folder / "case.json"
    name.write_bytes(case.data)
    sensor = load_sensor(name)
    scan = Scan(sensor, one_pose(HERE), ScanOptions(seed=1))
    if scan.rays > _FEW_RAYS:
        return "many rays"
    if zlib.crc32(case.data) % 4 == 0:
        for frame in scan.check_poses(YARD).read(YARD):
            if not np.isfinite(frame.points[frame.returns]).all():
                raise WrongError("a reading is no number")
    if zlib.crc32(case.data) % 64 == 1:
        ask("validate", name)
        yard = ROOT / "samples" / "stairs-and-kerbs.json"
        pose = ("--pose", 3, 3, 0, 0, 0, 0, "--on-ground", 1)
        ask("scan", yard, folder / "scan.npz", "--sensor", name, *pose)
        if (folder / "scan.npz").exists():
            told = ("--resolution", 1, "--sensor", name, "--output", folder / "map.tif")
            ask("map", folder / "scan.npz", *told)
    for path in folder.iterdir():
        path.unlink()
    return "valid"


_FEW_RAYS = 100_000


def try_curriculum(case: Case, folder: Path) -> str:
    """Check it; some of the small ones are made."""
    source = Source("case.json", case.data.removeprefix(b"\xef\xbb\xbf"))
    for finding in check(source, kind="curriculum").findings:
        if not (finding.message and finding.line >= 1 and finding.column >= 1):
            raise WrongError(f"a finding of {finding.code} without words or a place")
    name = folder / "case.json"
    name.write_bytes(case.data)
    try:
        spec = load_spec(name)
        pieces = sum(patch.count for patch in spec.patches) * spec.rows * spec.columns
        if max(spec.rows * spec.columns, pieces) > 30 or max(spec.tile) > 20:
            return "large"
        if zlib.crc32(case.data) % 4 == 0:
            ask("curriculum", name, folder / "made.json")
        if zlib.crc32(case.data) % 64 == 1:
            ask("validate", name)
            ask("format", name, "--check")
    finally:
        for path in folder.iterdir():
            path.unlink()
    return "valid"


def try_curve(case: Case, folder: Path) -> str:
    """Check it, and hold what is compiled against an independent reading."""
    checked = _checked(case, "terrain")
    if checked.definition is None:
        return "invalid"
    terrain = Terrain(checked)
    text = json.loads(case.data)["elemTypes"]["a"]["x"]
    points = [0.03125, 0.1, 0.25, 0.3, 1 / 3, 0.5, 0.7, 0.84375, 0.999]
    heights = terrain.height(points, [0.5] * len(points)).tolist()
    if not all(map(math.isfinite, heights)):
        raise WrongError("a height is not finite")
    doubted = {finding.code for finding in checked.findings if finding.code.startswith("TT3")}
    if text in NAMED or doubted - _HARMLESS:
        return "named or warned of"
    for t, height in zip(points, heights, strict=True):
        try:
            value = Expression(text).value(t)
        except (ArithmeticError, ValueError):
            continue
        largest = max(map(abs, heights))
        if abs(value - height) > max(SLACK * TOLERANCE, 1e-11 * largest):
            raise WrongError("a compiled curve is off")
    return "valid"


TARGETS = (
    Target("definitions", 1_000_000, make_terrain, try_terrain),
    Target("compositions", 100_000, make_composition, try_composition),
    Target("vehicles", 100_000, make_vehicle, try_vehicle),
    Target("curves", 100_000, make_curve, try_curve),
    Target("sensors", 100_000, make_sensor, try_sensor),
    Target("curricula", 100_000, make_curriculum, try_curriculum),
)
