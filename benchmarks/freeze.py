"""Record what every command writes and what the library answers, to compare two states of the code.

    python benchmarks/freeze.py record DIR [--like OTHER] [--only WORD,...] [DEM ...]
        files, texts, exit codes and arrays; of the generated terrains of another recording
    python benchmarks/freeze.py compare DIR OTHER
        names what is not the same byte by byte

With --only, just commands whose names begin with one of the words, and the arrays if `arrays` is
one; what only the first of two recordings has is then no difference.

A recording compares only with one made by the same versions of NumPy and GDAL. What Hypothesis
generates depends on the constants in the code, so give --like from the second recording on.
"""

from __future__ import annotations

import filecmp
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

GENERATED = 120
"""Definitions drawn from the strategies of the tests, as many again with tracks."""
LAYERS = (
    "height", "surface", "slope", "aspect", "normal", "cohesion", "friction", "sinkage", "sonar",
    "color",
)  # fmt: skip
VEHICLES = ("husky-a200", "curiosity", "neobotix-mp-500")

Command = tuple[str, list[str]]


def commands(
    name: str, wide: float, origin: tuple[float, float], relief: float
) -> Iterator[Command]:
    """What is run for a terrain: a name for its results, and the arguments, in its own folder."""
    file = f"../../samples/{name}.json"
    fine, coarse = f"{wide / 397:.5g}", f"{wide / 90:.5g}"
    for form in ("text", "json", "sarif", "github"):
        yield f"validate-{form}", ["validate", file, "--format", form]
    yield "info", ["info", file]
    yield "info-json", ["info", file, "--json"]
    yield "format", ["format", file, "--check"]
    yield "query-csv", ["query", file, "--points", "points.csv"]
    yield "query-json", ["query", file, "--points", "points.csv", "--json"]
    every = [word for layer in LAYERS for word in ("--layer", layer)]
    yield "dem-tif", ["export-dem", file, "dem.tif", "--resolution", fine]
    yield "dem-all", ["export-dem", file, "all.tif", "--resolution", coarse, *every]
    yield "dem-npy", ["export-dem", file, "dem.npy", "--resolution", fine, "--dtype", "float64"]
    yield "dem-asc", ["export-dem", file, "dem.asc", "--resolution", coarse]
    yield "dem-png", ["export-dem", file, "dem.png", "--resolution", coarse, "--json"]
    yield "dem-cog", ["export-dem", file, "cog.tif", "--resolution", fine, "--cog"]
    yield "dem-default", ["export-dem", file, "default.tif"]
    tiles = ["--tiles", "tiles", "--tile-size", "128"]
    yield "dem-tiles", ["export-dem", file, *tiles, "--resolution", fine]
    for suffix in ("obj", "wrl", "glb", "stl", "ply", "x3d", "usda"):
        yield f"mesh-{suffix}", ["export-mesh", file, f"mesh.{suffix}"]
    close = ["--max-error", f"{relief / 150:.3g}"]
    yield "mesh-solid", ["export-mesh", file, "solid.obj", "--solid", *close]
    yield "mesh-tiles", ["export-mesh", file, "tiled.obj", "--tile-faces", "4000", *close]
    yield "mesh-few", ["export-mesh", file, "few.ply", "--max-faces", "2000", "--json"]
    yield "mesh-grid", ["export-mesh", file, "grid.wrl", "--elevation-grid"]
    error = f"{max(relief / 200, 1e-3):.3g}"
    terrain = ["--max-error", error]
    yield "terrain", ["import-terrain", "dem.tif", "terrain.json", *terrain]
    yield "terrain-walls", ["import-terrain", "dem.tif", "walls.json", *terrain, "--walls"]
    for method in ("rows", "columns", "nodal-rows", "nodal-columns", "hats"):
        how = ["--method", method, "--no-structures", *terrain]
        yield f"terrain-{method}", ["import-terrain", "all.tif", f"{method}.json.gz", *how]
    yield "terrain-mesh", [
        "import-terrain", "mesh.glb", "mesh.json", "--resolution", coarse, *terrain,
    ]  # fmt: skip
    for form, extra in {
        "plain": [], "turn": ["--fit-turn"], "terms": ["--terms", "3"],
        "sum": ["--combine", "auto", "--values", "9"], "recognise": ["--recognise"],
    }.items():  # fmt: skip
        yield f"primitive-{form}", [
            "import-primitive", "dem.tif", "--name", "patch", "--window", "40", "30", "90", "70",
            *extra, "--json",
        ]  # fmt: skip
    for suffix in ("wrl", "obj", "ply", "stl"):
        yield f"primitive-{suffix}", [
            "import-primitive", f"mesh.{suffix}", "--name", "patch", "--resolution", coarse,
            "--up", "z",
        ]  # fmt: skip
    x, y = origin
    for vehicle in VEHICLES:
        # a window that a minute is enough for
        bounds = ["--bounds", *(f"{v:.6g}" for v in (x, y, x + min(wide, 30), y + min(wide, 20)))]
        outputs = ["--map", f"{vehicle}.tif"]
        for form in ("json", "html", "md"):
            outputs += ["--report", f"{vehicle}.{form}"]
        route = ["--route", *(f"{v:.6g}" for v in (x + 3, y + 3, x + 18, y + 12))]
        yield f"drive-{vehicle}", [
            "traversability", file, "--vehicle", f"../../samples/vehicles/{vehicle}.json",
            *bounds, *outputs, *route, "--resolution", "0.15",
        ]  # fmt: skip
    wheel = ["--wheel-radius", "0.2", "--wheel-width", "0.1", "--load", "150"]
    yield "wheel", ["traversability", file, *wheel, "--resolution", "0.5"]
    yield "deform", ["deform", file, *wheel, "--waypoints", "path.csv", "--output", "deformed.json"]
    yield "dem-deformed", ["export-dem", "deformed.json", "deformed.tif", "--resolution", coarse]
    yield "mesh-deformed", ["export-mesh", "deformed.json", "deformed.ply", *close]


def run(folder: Path, name: str, arguments: list[str]) -> None:
    """Run a command in a folder, and keep what it says."""
    done = subprocess.run(
        [sys.executable, "-m", "terratool", *arguments],
        cwd=folder,
        capture_output=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "100"},
        check=False,
    )
    said = b"exit %d\n--- out\n%s--- err\n%s" % (done.returncode, done.stdout, done.stderr)
    (folder / f"{name}.said").write_bytes(said)


def record_commands(out: Path, dems: list[Path], only: tuple[str, ...] = ("",)) -> None:
    """All commands on all samples, and imports of DEMs."""
    from terratool.field.summary import height_range
    from terratool.field.terrain import load

    shutil.copytree(ROOT / "samples", out / "samples")

    def one(path: Path) -> None:
        folder = out / "commands" / path.stem
        folder.mkdir(parents=True)
        terrain = load(path)
        west, south, east, north = terrain.bounds
        rng = np.random.default_rng(1)
        x, y = rng.uniform(west - 1, east + 1, 3000), rng.uniform(south - 1, north + 1, 3000)
        np.savetxt(folder / "points.csv", np.stack([x, y], 1), "%.9g", ",")
        t = np.linspace(0.15, 0.85, 25)
        path_x = west + t * (east - west)
        path_y = south + (0.5 + 0.2 * np.sin(9 * t)) * (north - south)
        np.savetxt(folder / "path.csv", np.stack([path_x, path_y], 1), "%.9g", ",")
        low, high, _ = height_range(terrain)
        relief = (high or 0.0) - (low or 0.0)
        for name, arguments in commands(path.stem, max(terrain.size), (west, south), relief):
            if name.startswith(only):
                run(folder, name, arguments)

    def dem(path: Path) -> None:
        folder = out / "commands" / path.stem
        folder.mkdir(parents=True)
        copy = shutil.copy(path, folder)
        for error in ("0.05", "0.5"):
            name = f"terrain-{error}"
            arguments = ["import-terrain", Path(copy).name, f"{name}.json.gz"]
            run(folder, name, [*arguments, "--max-error", error])
        window = ["--window", "10", "12", "60", "50"]
        for form in ("--fit-turn", "--recognise", "--json"):
            arguments = ["import-primitive", Path(copy).name, "--name", "patch", *window, form]
            run(folder, f"primitive{form}", arguments)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(one, sorted((ROOT / "samples").glob("*.json"))))
        list(pool.map(dem, dems))


def generated() -> Iterator[tuple[str, dict[str, Any]]]:
    """Definitions, the same in every run."""
    from hypothesis import HealthCheck, Phase, given, settings
    from meshes import random_definition
    from strategies import definitions

    for rutted in (False, True):
        found: list[dict[str, Any]] = []

        @settings(
            database=None, derandomize=True, max_examples=GENERATED, phases=[Phase.generate],
            suppress_health_check=list(HealthCheck), deadline=None,
        )  # fmt: skip
        @given(definitions(rutted=rutted))
        def collect(definition: dict[str, Any]) -> None:
            found.append(definition)  # noqa: B023, called before the next turn

        collect()
        for n, definition in enumerate(found):
            yield f"{'rutted' if rutted else 'plain'}-{n:03}", definition
    import meshes

    shapes = {k: v for k, v in vars(meshes).items() if k.isupper() and k != "SURFACES"}
    for label, primitives in sorted(shapes.items()):
        if isinstance(primitives, dict):
            for seed in range(12):
                made = random_definition(seed, 12 + 8 * seed, primitives)
                yield f"random-{label.lower()}-{seed:02}", made


def recorded(folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """The definitions of a recording."""
    for path in sorted((folder / "arrays").glob("*.npz")):
        with np.load(path) as found:
            if "definition" in found:
                yield path.stem, json.loads(found["definition"].tobytes())


def record_arrays(out: Path, like: Path | None = None) -> None:
    """What the library answers: heights, samples, windows, losses, meshes."""
    definitions = (
        recorded(like)
        if like
        else [
            *generated(),
            *(
                (f"sample-{path.stem}", json.loads(path.read_text()))
                for path in sorted((ROOT / "samples").glob("*.json"))
            ),
        ]
    )
    folder = out / "arrays"
    folder.mkdir()
    for name, definition in definitions:
        np.savez(folder / f"{name}.npz", **arrays(definition))
    np.savez(folder / "wheels.npz", **wheels())


def arrays(definition: dict[str, Any]) -> dict[str, Any]:
    """All of a definition; compiled, asked, painted and meshed."""
    import strategies

    from terratool.definition.reader import check
    from terratool.field.records import scalar_columns
    from terratool.field.terrain import Terrain
    from terratool.mesh.build import build
    from terratool.raster.grid import grid_over
    from terratool.raster.loss import LossFinder
    from terratool.raster.painter import Painter
    from terratool.text.source import Source

    found: dict[str, Any] = {"definition": np.frombuffer(json.dumps(definition).encode(), np.uint8)}
    checked = check(Source("terrain", json.dumps(definition).encode())).definition
    if checked is None:
        return found
    terrain = Terrain(checked)
    west, south, east, north = terrain.bounds
    found["offsets"], found["elements"] = terrain.arrays.offsets, terrain.arrays.elements
    for n, column in enumerate(scalar_columns(terrain.arrays.grids)):
        found[f"grids-{n}"] = column
    found["cells"] = terrain.cells()
    rng = np.random.default_rng(3)
    x, y = rng.uniform(west, east, 2000), rng.uniform(south, north, 2000)
    try:
        marked = np.array(strategies.landmarks(definition) + strategies.rims(definition))
        x, y = np.concatenate([x, marked[:, 0]]), np.concatenate([y, marked[:, 1]])
    except (KeyError, TypeError):  # a sample with keys that the strategies do not make
        pass
    found["x"], found["y"] = x, y
    found["height"] = terrain.height(x, y)
    sample = terrain.sample(x, y)
    found["element"], found["surface"], found["normal"] = (
        sample.element, sample.surface, sample.normal,
    )  # fmt: skip
    for n, share in enumerate((113, 37.7)):
        grid = grid_over(terrain, min(max(terrain.size) / share, 0.9 * min(terrain.size)))
        for dtype in (np.float32, np.float64):
            painter = Painter(terrain, grid, dtype, slopes=True, labels=True)
            planes = painter.paint(grid.whole)
            kind = f"{n}-{np.dtype(dtype)}"
            found[f"{kind}-heights"], found[f"{kind}-surfaces"] = planes.heights, planes.surfaces
            found[f"{kind}-slope_x"], found[f"{kind}-slope_y"] = planes.slope_x, planes.slope_y
            found[f"{kind}-labels"] = planes.labels
            losses = LossFinder(terrain, grid, dtype)
            found[f"{kind}-losses"] = np.array(repr(losses.of(grid.whole, planes)))
    relief = float(np.nanmax(found["height"], initial=0) - np.nanmin(found["height"], initial=0))
    for solid in (False, True):
        try:
            built = build(terrain, max(relief / 60, 1e-3), base="below" if solid else None)
        except Exception as error:  # what it says is recorded, too
            found[f"mesh-{solid}-error"] = np.array(repr(error))
            continue
        mesh = built.mesh
        found[f"mesh-{solid}-vertices"], found[f"mesh-{solid}-faces"] = mesh.vertices, mesh.faces
        found[f"mesh-{solid}-surfaces"], found[f"mesh-{solid}-walls"] = mesh.surfaces, mesh.walls
        found[f"mesh-{solid}-error"] = np.array([built.error, built.loss.wall_offset, built.shell])
    return found


def wheels() -> dict[str, Any]:
    """The formulas of wheels on soil, over arrays."""
    from terratool.traversability import wheel as wheels
    from terratool.traversability.vehicle import Soil, Wheel

    rng = np.random.default_rng(4)
    found: dict[str, Any] = {}
    for n in range(40):
        radius, width = 10 ** rng.uniform(-2, 1), 10 ** rng.uniform(-2, 0.5)
        wheel = Wheel(radius, width, float(rng.choice([np.inf, 10 ** rng.uniform(-1, 3)])), 0.6)
        soil = Soil(
            float(rng.choice([0.0, 10 ** rng.uniform(1, 5)])), float(rng.uniform(0, 0.9)),
            float(rng.choice([0.0, 10 ** rng.uniform(-9, -3)])),
            float(rng.choice([0.0, 10 ** rng.uniform(-4, -1)])),
        )  # fmt: skip
        load = np.concatenate([[0.0], 10 ** rng.uniform(-3, 6, 200)])
        for call in (wheels.contact, wheels.traction):
            made = call(load, soil, wheel)
            for name in made.__dataclass_fields__:
                found[f"{n}-{call.__name__}-{name}"] = np.asarray(getattr(made, name))
        found[f"{n}-towed"] = wheels.towed_resistance(load, soil, wheel)
        found[f"{n}-grip"] = wheels.lateral_grip(load, soil, wheel)
    return found


def files(folder: Path) -> set[Path]:
    """All files below a folder, relative to it."""
    found = {path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}
    return found - {Path("only")}


def differing(one: Path, other: Path) -> Iterator[str]:
    """A line for each file that is not in both, or not the same in both."""
    first, second = files(one), files(other)
    if (other / "only").read_text():
        first &= second
    for path in sorted(first ^ second):
        yield f"{path}: only in {one if path in first else other}"
    for path in sorted(first & second):
        if filecmp.cmp(one / path, other / path, shallow=False):
            continue
        if path.suffix == ".said" and _without_chance(one, path) == _without_chance(other, path):
            continue
        if path.suffix != ".npz":
            yield f"{path}: differs"
            continue
        a, b = np.load(one / path), np.load(other / path)
        for name in sorted({*a.files, *b.files}):
            if name not in a.files or name not in b.files:
                yield f"{path}: {name} is only in one"
            elif _told(a[name]) != _told(b[name]):
                yield f"{path}: {name} differs{_by(a[name], b[name])}"


def _without_chance(folder: Path, path: Path) -> bytes:
    """What a command said, without how long it took and where it ran."""
    said = (folder / path).read_bytes().replace(bytes(folder), b"")
    return re.sub(rb"(?m)^terratool: .*, \d+ s.*\n", b"", said)


def _told(values: np.ndarray) -> bytes:
    """What is compared: bytes; of texts that name classes, all but these names."""
    if values.dtype.kind == "U":
        return re.sub(r"\b[A-Z]\w*\(", "(", str(values)).encode()
    return values.tobytes()


def _by(a: np.ndarray, b: np.ndarray) -> str:
    if a.shape != b.shape:
        return f", shapes {a.shape} and {b.shape}"
    if a.dtype.kind not in "fiu":
        return f": {a} and {b}" if a.size == 1 else ""
    with np.errstate(all="ignore"):
        apart = np.abs(a.astype(float) - b.astype(float))
    count = int(((a != b) & ~((a != a) & (b != b))).sum())
    return f" at {count} of {a.size}, by {np.nanmax(apart, initial=0.0):.3g} at most"


def main() -> None:
    match sys.argv[1:]:
        case ["record", out, *dems]:
            like: Path | None = None
            only: tuple[str, ...] = ("",)
            if dems[:1] == ["--like"]:
                like, dems = Path(dems[1]), dems[2:]
            if dems[:1] == ["--only"]:
                only, dems = tuple(dems[1].split(",")), dems[2:]
            folder = Path(out)
            folder.mkdir(parents=True)
            if "arrays".startswith(only):
                record_arrays(folder, like)
            if only != ("arrays",):
                record_commands(folder, [Path(dem) for dem in dems], only)
            (folder / "only").write_text(",".join(only))
        case ["compare", one, other]:
            lines = list(differing(Path(one), Path(other)))
            if any(": definition differs" in line for line in lines):
                lines.insert(
                    0, "The definitions differ: record the second one with --like the first."
                )
            print("\n".join([*lines, f"{len(files(Path(one)))} files, {len(lines)} differences"]))
            sys.exit(bool(lines))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
