"""Commands killed at random moments: every output is whole, as it was before, or not there.

`python -m tests.kills` starts commands that write, ends each by SIGKILL, SIGTERM or SIGINT at some
moment, and looks at the folder. Then the same command runs to its end: its outputs are those of a
run that nobody disturbed, and nothing else is left.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from terratool.output import PART
from terratool.raster.journal import NAME as JOURNAL
from tests.commands import COMMAND, ENVIRONMENT, ROOT

SAMPLES = ROOT / "samples"
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
Contents = dict[str, bytes]


class Job(NamedTuple):
    """A command that writes.

    Attributes:
        name: of the writer.
        words: of the command; those with an @ are files of the folder that it runs in.
        inputs: files that the folder has before: their names, and where they are copied from.
        before: words of a run that leaves other outputs under the same names, in place of the
            second, which names the source; none if the inputs are what is overwritten.
    """

    name: str
    words: tuple[str, ...]
    inputs: tuple[tuple[str, str], ...] = ()
    before: str = ""


SITE, YARD = "samples/nested-site.json", "samples/stairs-and-kerbs.json"
TRACKS = "samples/wheel-tracks.json"
HUSKY = "samples/vehicles/husky-a200.json"
_DEM = ("--resolution", "0.5", "--overwrite")
_WIDE = ("--resolution", "0.1", "--overviews", "--overwrite")
_MESH = ("--max-error", "0.05", "--overwrite")
_ALL = ("--layer", "height", "--layer", "surface", "--layer", "slope", "--layer", "color")


def jobs() -> list[Job]:
    """All writers."""
    found = [
        Job(f"dem {ending}", ("export-dem", SITE, f"@a.{ending}", *_DEM), before=YARD)
        for ending in ("tif", "asc", "png", "npy", "xyz", "img")
    ]
    found.append(Job("dem cog", ("export-dem", SITE, "@a.tif", "--cog", *_DEM), before=YARD))
    found.append(Job("dem overviews", ("export-dem", SITE, "@a.tif", *_WIDE), before=YARD))
    circular = ("export-dem", SITE, "@a.tif", "--layer", "aspect", *_WIDE)
    found.append(Job("dem cog aspect", (*circular, "--cog"), before=YARD))
    found.append(Job("dem layers", ("export-dem", SITE, "@a.tif", *_ALL, *_DEM), before=YARD))
    tiles = ("--tile-size", "512", "--resolution", "0.1")
    found.append(Job("dem tiles", ("export-dem", SITE, "--tiles", "@tiles", *_ALL, *tiles)))
    dask = ("--dask", "local", *tiles)
    found.append(Job("dem dask", ("export-dem", SITE, "--tiles", "@tiles", *dask)))
    found += [
        Job(f"mesh {ending}", ("export-mesh", SITE, f"@a.{ending}", *_MESH), before=YARD)
        for ending in ("obj", "wrl", "glb", "stl", "ply", "x3d", "usdc")
    ]
    grid = ("--elevation-grid", "--resolution", "0.5", "--overwrite")
    hills = "samples/dunes.json"
    found.append(Job("mesh grid", ("export-vrml", YARD, "@a.wrl", *grid), before=hills))
    many = ("--tile-faces", "2000", *_MESH)
    found.append(Job("mesh tiles", ("export-mesh", SITE, "@tiles.obj", *many)))
    dems = (("dem.tif", SITE),)
    terrain = ("--max-error", "0.5", "--overwrite")
    for ending in ("json", "json.gz"):
        words = ("import-terrain", "@dem.tif", f"@a.{ending}", *terrain)
        found.append(Job(f"terrain {ending}", words, dems))
    definition = (("a.json", SITE),)
    new = ("--name", "new", "--window", "10", "10", "60", "40")
    into = ("import-primitive", "@dem.tif", *new, "--into", "@a.json", "--overwrite")
    found.append(Job("primitive into", into, (*dems, *definition)))
    output = ("import-primitive", "@dem.tif", *new, "--output", "@p.json", "--overwrite")
    found.append(Job("primitive", output, dems))
    element = ("--type", "bench", "--at", "10", "10", "--extent", "2", "1", "--turn", "30")
    added = ("--output", "@b.json", "--overwrite")  # in place, a second run would add another
    found.append(Job("add", ("add", "@a.json", *element, *added), definition))
    kit_user = ("bundle", "samples/warehouse.json", "@a.json", "--overwrite")
    found.append(Job("bundle", kit_user, before="samples/obstacle-course.json"))
    found.append(Job("format", ("format", "@a.json"), (("a.json", "minified"),)))
    wrong = (("a.json", "samples/invalid/TT104-missing-in-element.json"),)
    found.append(Job("fix", ("validate", "--fix", "@a.json"), (("a.json", "misspelt"),)))
    known = ("validate", "@a.json", "--baseline", "@known.json", "--update-baseline")
    found.append(Job("baseline", known, wrong))
    reports = [f"--format={form}=@out.{form}" for form in ("json", "sarif", "junit", "gitlab")]
    found.append(Job("findings", ("validate", "@a.json", *reports), wrong))
    wheels = ("--vehicle", HUSKY, "--waypoints", "@path.csv", "--output", "@a.json", "--overwrite")
    found.append(Job("deform", ("deform", TRACKS, *wheels), (*definition, ("path.csv", "path"))))
    outputs = ("--report", "@r.html", "--report", "@r.md", "--report", "@r.json", "--map", "@m.tif")
    drive = ("--vehicle", HUSKY, "--resolution", "2", "--headings", "4", "--overwrite")
    found.append(Job("map", ("traversability", SITE, *outputs, *drive), before=YARD))
    lines = (
        "--map",
        "@m.tif",
        "--report",
        "@r.geojson",
        "--report",
        "@r.html",
        "--report",
        "@r.json",
    )
    way = ("--route", "3", "3", "17", "10", "--return")
    found.append(Job("route", ("traversability", YARD, *way, *lines, *drive), before=TRACKS))
    for target in ("mujoco", "gazebo", "pybullet", "usd", "chrono", "nav2", "grid-map"):
        told = ("--target", target, "--max-error", "0.05", "--overwrite")
        found.append(Job(f"simulator {target}", ("export-sim", YARD, "@sim", *told), before=TRACKS))
    several = ("--target", "nav2", "--target", "pybullet", "--vehicle", HUSKY, "--overwrite")
    found.append(Job("simulators", ("export-sim", YARD, "@sim", *several), before=TRACKS))
    course = ("curriculum", "samples/curricula/rough.json", "@course.json", "--overwrite")
    found.append(Job("curriculum", course, before="samples/curricula/all-kinds.json"))
    return found + _seen() + _sensed() + _packed()


def _seen() -> list[Job]:
    """Pictures, pages and differences."""
    over, hall = ("--overwrite",), "samples/warehouse.json"
    found = [
        Job(f"picture {ending}", ("render", hall, f"@a.{ending}", *over), before=YARD)
        for ending in ("png", "svg", "pdf")
    ]
    page = ("view", hall, "--no-open", "--output", "@a.html", *over)
    found.append(Job("page", page, before=YARD))
    shown = ("--picture", "@d.png", "--map", "@d.tif", *over)
    found.append(Job("difference", ("diff", hall, YARD, *shown), before="samples/dunes.json"))
    return found


def _sensed() -> list[Job]:
    """Scans in all formats, robots' maps of them, and how good these are."""
    hall, over = "samples/warehouse.json", ("--on-ground", "1.5", "--overwrite")
    camera = ("--sensor", "samples/sensors/realsense-d435.json", *_LIDAR[2:])
    found = [
        Job(f"scan {ending}", ("scan", hall, f"@a.{ending}", *_LIDAR, *over), before=YARD)
        for ending in ("ply", "pcd", "las", "laz", "npz", "csv", "rosbag2")
    ]
    found += [
        Job(f"images {ending}", ("scan", hall, f"@a.{ending}", *camera, *over), before=YARD)
        for ending in ("png", "tif")
    ]
    sonar = ("--sensor", "samples/sensors/senscomp-6500.json", "--poses", "@poses.csv", *over)
    found.append(Job("scan path", ("scan", YARD, "@a.npz", *sonar), (("poses.csv", "poses"),)))
    told = ("--resolution", "0.5", "--output", "@m.tif", "--overwrite")
    for ending in ("npz", "csv", "ply", "pcd", "las", "laz"):
        scans = ((f"scan.{ending}", hall), (f"other.{ending}", YARD))
        words = ("map", f"@scan.{ending}", *told)
        found.append(Job(f"robot map {ending}", words, scans, f"@other.{ending}"))
    scans = (("scan.npz", hall), ("other.npz", YARD))
    bag = ("map", "@scan.npz", *told, "--bag", "@map_bag")
    found.append(Job("robot map bag", bag, scans, "@other.npz"))
    shown = ("compare", "@map.tif", hall, "--picture", "@p.png", "--overwrite")
    found.append(Job("compare", shown, (("map.tif", hall),)))
    return found


def _packed() -> list[Job]:
    """What comes out of archives, and what settings ask for."""
    terrain = ("--max-error", "0.5", "--overwrite")
    unpacked = ("import-terrain", "zip://@dem.zip!dem.tif", "@a.json", *terrain)
    found = [Job("terrain of an archive", unpacked, (("dem.zip", SITE),))]
    set_ = ((".terratool.toml", "settings"), ("a.json", "misspelt"))
    found.append(Job("settings", ("validate",), set_))
    new = ("new", "craters", "@a.json.gz", "--seed", "5", "--overwrite")
    found.append(Job("new", new, before="rough"))
    return found


_LIDAR = (
    "--sensor", "samples/sensors/velodyne-vlp-16.json", "--pose", "8", "5", "0", "20", "0", "0",
)  # fmt: skip


@dataclass
class Bench:
    """A job, and what its folder holds before it and after it, if nobody disturbs it.

    Attributes:
        old: what is there before; a run begins with that or, if the job brings its own inputs
            only, with those.
        new: what is there afterwards.
        codes: that it ends with, first and again.
        seconds: that it takes.
    """

    job: Job
    inputs: Contents
    old: Contents
    new: Contents
    codes: tuple[int, int]
    seconds: float


@dataclass
class Tally:
    """What came of all kills."""

    counts: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)


def run(words: tuple[str, ...], folder: Path) -> subprocess.Popen[str]:
    """Start a command in a folder, whose files have an @ before their names."""
    placed = [str(ROOT / word) if word.startswith("samples/") else word for word in words]
    return subprocess.Popen(
        [*COMMAND, *(word.replace("@", "") for word in placed)],
        cwd=folder, env=ENVIRONMENT, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def finish(words: tuple[str, ...], folder: Path, codes: tuple[int, ...] = (0, 1)) -> int:
    """Run a command to its end, and return its code.

    Raises:
        AssertionError: that is another one, or it ended by a traceback.
    """
    process = run(words, folder)
    _, told = process.communicate(timeout=120)
    assert process.returncode in codes and "Traceback" not in told, (
        f"{words} ends with {process.returncode}: {told}"
    )
    return process.returncode


def contents(folder: Path) -> Contents:
    """The files of a folder; of a journal, whose lines come in no order, no more than that."""
    return {
        str(path.relative_to(folder)): b"" if path.name == JOURNAL else path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def put(folder: Path, files: Contents) -> None:
    """Have a folder hold these files and nothing else."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def source(name: str, folder: Path) -> bytes:
    """An input by its name."""
    if name == "path":
        return b"x,y\n5,6\n20,12\n34,17\n"
    if name == "poses":
        lines = "".join(f"{n},{3 + n},3,0,{20 * n}\n" for n in range(9))
        return f"time,x,y,z,yaw\n{lines}".encode()
    if name == "settings":
        return b'paths = ["a.json"]\nformats = ["json=a.log", "sarif=b.sarif", "text"]\n'
    if name == "minified":
        return json.dumps(json.loads((ROOT / SITE).read_text())).encode()
    if name == "misspelt":
        return (ROOT / SITE).read_bytes().replace(b'"vScale"', b'"vscale"')
    return (ROOT / name).read_bytes()


def made(name: str, origin: str, folder: Path) -> Contents:
    """An input by its name, and what belongs to it: a DEM, a scan or a map of a terrain, …"""
    stem, _, ending = name.partition(".")
    ground = ("--on-ground", "1.5")
    words = {
        "dem": ("export-dem", origin, "@dem.tif", "--resolution", "1"),
        "scan": ("scan", origin, f"@{name}", *_LIDAR, *ground),
        "other": ("scan", origin, f"@{name}", *_LIDAR, *ground),
        "map": ("scan", origin, "@scan.npz", *_LIDAR, *ground),
    }.get(stem)
    if words is None:
        return {name: source(origin, folder)}
    put(folder, {})
    finish(words, folder)
    if stem == "map":
        finish(("map", "@scan.npz", "--resolution", "0.5", "--output", "@map.tif"), folder)
        (folder / "scan.npz").unlink()
    if ending == "zip":
        with zipfile.ZipFile(folder / name, "w") as archive:
            archive.write(folder / "dem.tif", "dem.tif")
        (folder / "dem.tif").unlink()
    return contents(folder)


def bench(job: Job, folder: Path) -> Bench:
    """Find out what a job does when nobody disturbs it."""
    inputs: Contents = {}
    folder.mkdir()
    for name, origin in job.inputs:
        inputs |= made(name, origin, folder)
    put(folder, inputs)
    if job.before:
        finish((job.words[0], job.before, *job.words[2:]), folder)
    old = contents(folder)
    put(folder, inputs)
    began = time.monotonic()
    code = finish(job.words, folder)
    seconds = time.monotonic() - began
    new = contents(folder)
    assert new != old, job
    codes = code, finish(job.words, folder)
    return Bench(job, inputs, old, new, codes, seconds)


def kill(one: Bench, folder: Path, rng: random.Random, tally: Tally) -> None:
    """Kill a job at some moment, look, and have it run again."""
    before = one.old if rng.random() < 0.6 else one.inputs
    put(folder, before)
    number = rng.choice(SIGNALS)
    process = run(one.job.words, folder)
    began = time.monotonic()
    # half of them once something is being written, for which a start takes long
    writing = rng.random() < 0.5
    delay = rng.random() * one.seconds * (0.3 if writing else 1.1)
    while writing and process.poll() is None and not list(folder.rglob(f"{PART}*")):
        time.sleep(0.001)
    time.sleep(delay if not writing else delay * rng.random())
    process.send_signal(number)
    _, told = process.communicate(timeout=60)
    moment = f"{one.job.name}, {number.name} after {time.monotonic() - began:.3f} s"
    wrong = looked_at(one, before, folder, number, told)
    try:
        finish(one.job.words, folder, one.codes)
    except AssertionError as error:
        wrong.append(f"the next run {error}")
    found = contents(folder)
    if found != one.new:
        names = sorted(name for name in {*found, *one.new} if found.get(name) != one.new.get(name))
        wrong.append(f"after the next run, {', '.join(names)} are not as they should be")
    with tally.lock:
        tally.counts["ended before" if process.returncode in (0, 1) else number.name] += 1
        tally.faults += [f"{moment}: {what}" for what in wrong]


def looked_at(
    one: Bench, before: Contents, folder: Path, number: signal.Signals, told: str
) -> list[str]:
    """What is wrong in a folder where a job was killed."""
    # Python prints one by itself where it is interrupted before terratool has begun
    begun = ", in _run\n" in told
    wrong = ["a traceback:\n" + told] if "Traceback" in told and begun else []
    for name, data in contents(folder).items():
        if name.startswith(PART) or f"/{PART}" in name:
            if number != signal.SIGKILL:
                wrong.append(f"{name} is left")
        elif data not in (before.get(name), one.new.get(name)):
            wrong.append(f"{name} is neither old nor new")
    # what goes with another file may be gone for a moment, as that is new or old
    main = {name for name in before if name in one.new and ".aux.xml" not in name}
    companions = (".mtl", ".prj")
    gone = sorted(name for name in main - {*contents(folder)} if not name.endswith(companions))
    return wrong + [f"{name} is gone" for name in gone]


def main() -> int:
    """Parse, kill, print; 1 if a file was torn."""
    parser = argparse.ArgumentParser(prog="python -m tests.kills", description=__doc__)
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", default="", help="writers whose names have this in them")
    wanted = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which the commands inherit
    tally, began = Tally(), time.monotonic()
    chosen = [job for job in jobs() if wanted.only in job.name]
    with (
        tempfile.TemporaryDirectory(prefix="terratool-kills-") as name,
        ThreadPoolExecutor(wanted.processes) as pool,
    ):
        base = Path(name)
        benches = list(pool.map(lambda job: bench(job, base / job.name), chosen))

        def one(index: int) -> None:
            rng = random.Random(f"{wanted.seed} {index}")
            kill(benches[index % len(benches)], base / str(index), rng, tally)
            shutil.rmtree(base / str(index), ignore_errors=True)

        list(pool.map(one, range(wanted.kills)))
    for fault in tally.faults:
        print(fault)
    print(f"{len(chosen)} writers in {time.monotonic() - began:.0f} s")
    print("| kills | SIGKILL | SIGTERM | SIGINT | ended before | faults |")
    print("|---:|---:|---:|---:|---:|---:|")
    heads = ("SIGKILL", "SIGTERM", "SIGINT", "ended before")
    counts = (wanted.kills, *(tally.counts[head] for head in heads), len(tally.faults))
    print("| " + " | ".join(f"{number:,}" for number in counts) + " |")
    return int(bool(tally.faults))


if __name__ == "__main__":
    sys.exit(main())
