"""What is packed: gzip, zip and tar around files that are good, broken as containers."""

from __future__ import annotations

import gzip
import io
import random
import tarfile
import warnings
import zipfile
import zlib
from functools import cache, partial
from pathlib import Path

from terratool.definition.reader import check
from terratool.importing.meshes import read_triangles
from terratool.importing.sources import open_source
from terratool.importing.types import SourceOptions
from terratool.sensing.clouds import read_clouds
from terratool.text.source import read_source
from tests.commands import ROOT
from tests.fuzz.clouds import clouds
from tests.fuzz.files import meshes, rasters
from tests.fuzz.harness import Case, Target, WrongError, ask
from tests.fuzz.mutation import INTEGERS, mutate_bytes

LONGEST = 1_000_000
"""Bytes of a case: what is stored and not packed may be longer."""

_compress = partial(gzip.compress, mtime=0)
Members = list[tuple[str, bytes]]

_FILLERS = [b" ", b"\0", b"[],", b"0,", b'{"a":1},', b'"a":1,', b"<a/>", b"[", b"#\n", b"\n"]
"""What bombs are made of."""


_ENTRY = [(6, 2), (8, 2), (10, 2), (16, 4), (20, 4), (24, 4), (28, 2), (42, 4)]
"""Places in an entry of the directory of a zip, and bytes: version, flags, method, sums, sizes."""


@cache
def _gzips() -> list[tuple[str, bytes]]:
    """What is read as gzip: suffix and the text."""
    names = ("paper-example", "kit/soils", "vehicles/husky-a200", "curricula/rough")
    found = [(".json.gz", (ROOT / "samples" / f"{name}.json").read_bytes()) for name in names]
    texts = {Path(files[0][0]).suffix: files[0][1] for files in meshes()}
    found.append((".wrz", texts[".wrl"]))
    found.append((".x3dz", texts[".x3d"]))
    return [*found, *((".tif.gz", _raster("tif")), (".asc.gz", _raster("asc")))]


@cache
def _raster(ending: str) -> bytes:
    """A raster that is one file."""
    return next(files[0][1] for files in rasters() if files[0][0].endswith(ending))


@cache
def _zips() -> list[tuple[str, Members]]:
    """What is read as zip: suffix, and names and bytes of the members."""
    found: list[tuple[str, Members]] = [(".zip", [("in it/case.tif", _raster("tif"))])]
    three = next(files[0][1] for files in meshes() if files[0][0].endswith(".3mf"))
    npz = next(data for suffix, data in clouds() if suffix == ".npz")
    for suffix, data in ((".3mf", three), (".npz", npz)):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            found.append((suffix, [(name, archive.read(name)) for name in archive.namelist()]))
    return found


# --- mistakes ------------------------------------------------------------------------------------


def make_archive(rng: random.Random) -> Case:
    """A container with mistakes in it, whose contents are good for the most part, or a bomb."""
    if rng.random() < 0.5:
        suffix, text = rng.choice(_gzips())
        data = _zipped(rng, _stuffed(rng, text))
    elif rng.random() < 0.15:
        suffix, data = ".tar", _tarred(rng)
    else:
        suffix, members = rng.choice(_zips())
        data = _archived(rng, members)
    for _ in range(rng.choice([0, 1, 1, 2, 4])):
        data = mutate_bytes(rng, data, data)
    return Case(suffix, data[:LONGEST])


def _stuffed(rng: random.Random, text: bytes) -> bytes:
    """A text, now and then with far more in it than there was."""
    if rng.random() < 0.9:
        return text
    filler = rng.choice(_FILLERS)
    (size,) = rng.choices([1 << 12, 1 << 18, 1 << 22, 1 << 24, 3 << 24], [30, 30, 20, 5, 1])
    much = filler * (size // len(filler))
    at = rng.choice([0, len(text), text.find(b"\n") + 1, rng.randint(0, len(text))])
    return text[:at] + much + text[at:]


def _zipped(rng: random.Random, text: bytes) -> bytes:
    """A gzip of one member or several, with headers that say more or less."""
    kind = rng.randrange(8)
    if kind == 0:
        cuts = sorted(rng.randint(0, len(text)) for _ in range(rng.choice([1, 2, 50])))
        ends = zip([0, *cuts], [*cuts, len(text)], strict=True)
        return b"".join(_compress(text[a:b]) + bytes(rng.choice([0, 0, 3])) for a, b in ends)
    if kind == 1:
        return _compress(b"") * rng.choice([1, 100, 3000, 70_000]) + _compress(text)
    if kind == 2:
        return _compress(_compress(text))
    data = gzip.compress(text, rng.choice([0, 1, 9]), mtime=0)
    if kind == 3:  # an extra field, a name and a comment in the header
        extra = rng.randbytes(rng.choice([0, 5, 300]))
        told = len(extra).to_bytes(2, "little") + extra + b"name" * rng.choice([1, 5000]) + b"\0"
        flags = rng.choice([4 | 8, 8, 4, 2, 16, 0xE0])
        return data[:3] + bytes([flags]) + data[4:10] + told + data[10:]
    return data


def _archived(rng: random.Random, members: Members) -> bytes:
    """A zip with other methods, flags, sizes or members than it should have."""
    members = [(name, _stuffed(rng, data)) for name, data in members]
    kind = rng.randrange(10)
    if kind == 0:
        members += rng.choices(members, k=rng.choice([1, 3]))
    elif kind == 1:
        members += [(f"{n}.model", b"") for n in range(rng.choice([10, 2000]))]
    elif kind == 2:
        members[rng.randrange(len(members))] = rng.choice(["", "..", "/x", "a\0b", "é", "x/"]), b"x"
    elif kind == 3:
        rng.shuffle(members)
        members.pop()
    method = rng.choice([0, 0, 8, 8, 8, 8, 12, 14])
    whole = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(whole, "w", method) as archive:
        warnings.simplefilter("ignore")  # of names that stand twice
        for name, data in members:
            archive.writestr(zipfile.ZipInfo(name or "a"), data, method)
        archive.comment = b"c" * rng.choice([0, 0, 9, 60_000])
    data = bytearray(whole.getvalue())
    entry = data.rfind(b"PK\1\2")
    if kind > 5 and entry > 0:  # the last entry of the directory: flags, method, sizes, offset
        at, width = rng.choice(
            [(6, 2), (8, 2), (10, 2), (16, 4), (20, 4), (24, 4), (28, 2), (42, 4)]
        )
        value = rng.choice(INTEGERS) % (1 << 8 * width)
        data[entry + at : entry + at + width] = value.to_bytes(width, "little")
    return bytes(data)


def _tarred(rng: random.Random) -> bytes:
    whole = io.BytesIO()
    with tarfile.open(fileobj=whole, mode=rng.choice(["w", "w:gz"])) as archive:
        entry = tarfile.TarInfo("in it/case.tif")
        data = _raster("tif")
        entry.size = len(data)
        archive.addfile(entry, io.BytesIO(data))
    return whole.getvalue()


# --- what is done with them ----------------------------------------------------------------------


def try_archive(case: Case, folder: Path) -> str:
    """Read it as what its name says."""
    name = folder / f"case{case.suffix}"
    name.write_bytes(case.data)
    try:
        if case.suffix == ".json.gz":
            for finding in check(read_source(name), kind=None).findings:
                if not finding.message:
                    raise WrongError(f"a finding of {finding.code} without words")
            if zlib.crc32(case.data) % 64 == 0:
                ask("validate", name)
                ask("info", name)
        elif case.suffix == ".npz":
            for cloud in read_clouds(name):
                cloud.points.sum()
        elif case.suffix in (".3mf", ".wrz", ".x3dz"):
            read_triangles(name)
        else:
            places = {
                ".zip": f"zip://{name}!in it/case.tif",
                ".tar": f"tar://{name}!in it/case.tif",
            }
            place = places.get(case.suffix, f"/vsigzip/{name}")
            with open_source(place, SourceOptions()) as source:
                source.read(0, min(source.grid.rows, 64))
    finally:
        for path in folder.iterdir():
            path.unlink()
    return "read"


TARGETS = (Target("archives", 100_000, make_archive, try_archive),)
