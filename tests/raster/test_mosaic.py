"""A mosaic is the raster of a single file, however often it was interrupted."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import rasterio

from terratool.errors import WriteError
from terratool.output import PART
from terratool.raster import export, tiles
from terratool.raster.export import RasterReport
from terratool.raster.grid import Grid, grid_over
from terratool.raster.journal import NAME, journal_of
from terratool.raster.mosaic import fingerprint
from tests.commands import COMMAND, ENVIRONMENT, ROOT, call
from tests.conftest import terrain_of
from tests.mosaics import ALL, SITE, contents, export_dem, export_mosaic, finished, wait_until
from tests.programs import needs

TILES = 6  # 1200 × 800 pixels in tiles of 512, which divides neither side


@pytest.fixture
def grid() -> Grid:
    return grid_over(terrain_of(SITE), 0.01)


def mosaic(folder: Path, *arguments: Any, **options: Any) -> RasterReport:
    terrain = terrain_of(SITE)
    grid = grid_over(terrain, 0.01)
    return export_mosaic(terrain, grid, folder, *arguments, **options)


def pixels_of(path: Path) -> bytes:
    with rasterio.open(path) as file:
        return file.read().tobytes()


class TestOneRaster:
    """The index opens as what a single file would be."""

    @pytest.mark.nightly
    @pytest.mark.parametrize("dtype", ["float32", "float64"])
    @pytest.mark.parametrize("size", [512, 1024, 4096])
    def test_bit_for_bit(self, tmp_path: Path, grid: Grid, dtype: str, size: int) -> None:
        """All layers, through tiles that are cut at the edges."""
        terrain = terrain_of(SITE)
        export_dem(terrain, grid, tmp_path / "a.tif", ALL, dtype=dtype)
        written = export_mosaic(
            terrain, grid, tmp_path / "a", layers=ALL, dtype=dtype, tile_size=size
        )
        for end in ("", "-surface", "-color", "-hillshade"):
            whole, index = tmp_path / f"a{end}.tif", tmp_path / "a" / f"mosaic{end}.vrt"
            assert pixels_of(index) == pixels_of(whole)
        assert [file.path for file in written.files] == [
            tmp_path / "a" / f"mosaic{end}.vrt" for end in ("", "-surface", "-color", "-hillshade")
        ]

    @pytest.mark.nightly
    @pytest.mark.parametrize("crs", ["EPSG:32633", "EPSG:2056", None])
    def test_it_says_of_itself_what_the_file_does(self, tmp_path: Path, crs: str | None) -> None:
        """Place, names, units, colours, attribute table and statistics."""
        definition = {key: value for key, value in SITE.items() if key != "crs"}
        terrain = terrain_of({**definition, "origin": [5, 4], **({"crs": crs} if crs else {})})
        grid = grid_over(terrain, 0.01)
        one = export_dem(terrain, grid, tmp_path / "a.tif", ALL)
        other = export_mosaic(terrain, grid, tmp_path / "a", layers=ALL, tile_size=512)
        for end in ("", "-surface", "-color", "-hillshade"):
            with (
                rasterio.open(tmp_path / f"a{end}.tif") as a,
                rasterio.open(tmp_path / "a" / f"mosaic{end}.vrt") as b,
            ):
                for what in (
                    "shape", "count", "dtypes", "crs", "transform", "bounds", "descriptions",
                    "units", "colorinterp", "scales", "offsets", "block_shapes",
                ):  # fmt: skip
                    assert getattr(a, what) == getattr(b, what), what
                assert str(a.nodatavals) == str(b.nodatavals)
                for key, value in b.tags().items():
                    assert a.tags().get(key, "Area") == value
                for band in a.indexes:
                    ours, theirs = b.tags(band), a.tags(band)
                    assert ours.keys() == theirs.keys()
                    for key in ours:
                        assert float(ours[key]) == pytest.approx(float(theirs[key]), rel=1e-9)
                if end == "-surface":
                    colors = b.colormap(1)
                    assert colors == {id_: a.colormap(1)[id_] for id_ in colors}
        assert (one.nodata, one.surfaces, one.lacking) == (
            other.nodata, other.surfaces, other.lacking,
        )  # fmt: skip

    @pytest.mark.nightly
    @needs("gdalinfo")
    def test_another_gdal_agrees(self, tmp_path: Path, grid: Grid) -> None:
        """Also on the pixels, by its own checksums, and on the attribute table."""
        terrain = terrain_of(SITE)
        layers = ("height", "slope", "surface", "color", "hillshade")
        export_dem(terrain, grid, tmp_path / "a.tif", layers, compress="deflate")
        export_mosaic(
            terrain, grid, tmp_path / "a", layers=layers, tile_size=512, compress="deflate"
        )
        for end in ("", "-surface", "-color", "-hillshade"):
            told = [
                json.loads(subprocess.check_output(["gdalinfo", "-json", "-checksum", str(path)]))
                for path in (tmp_path / f"a{end}.tif", tmp_path / "a" / f"mosaic{end}.vrt")
            ]
            for key in ("size", "geoTransform", "cornerCoordinates", "wgs84Extent", "rat"):
                assert told[0].get(key) == told[1].get(key), key
            for one in told:
                assert one["coordinateSystem"]["dataAxisToSRSAxisMapping"] == [1, 2]
                assert 'ID["EPSG",32633]]' in one["coordinateSystem"]["wkt"]
            for one, other in zip(told[0]["bands"], told[1]["bands"], strict=True):
                for key in (
                    "type", "colorInterpretation", "description", "unit", "noDataValue",
                    "checksum", "min", "max", "categories",
                ):  # fmt: skip
                    assert one.get(key) == other.get(key), key

    def test_threads_change_no_byte(self, tmp_path: Path) -> None:
        for threads in (1, 3):
            mosaic(tmp_path / str(threads), layers=ALL, threads=threads)
        assert contents(tmp_path / "1") == contents(tmp_path / "3")

    def test_a_tile_is_a_raster_of_its_own(self, tmp_path: Path) -> None:
        """It knows where it is and what it holds."""
        mosaic(tmp_path / "a")
        with rasterio.open(tmp_path / "a" / "tile-1-2.tif") as tile:
            assert tile.bounds == pytest.approx((500010.24, 4649776, 500012, 4649778.88), abs=1e-9)
            assert tile.shape == (288, 176) and tile.crs.to_epsg() == 32633
            assert float(tile.tags(1)["STATISTICS_MAXIMUM"]) == tile.read(1).max()

    def test_it_may_be_moved(self, tmp_path: Path) -> None:
        """Tiles are named relative to the index, also if that is elsewhere, or behind a link."""
        (tmp_path / "here" / "maps").mkdir(parents=True)
        (tmp_path / "here" / "link").symlink_to("maps")
        mosaic(tmp_path / "here" / "tiles", tmp_path / "here" / "link" / "site.VRT")
        before = pixels_of(tmp_path / "here" / "maps" / "site.VRT")
        (tmp_path / "here").rename(tmp_path / "there")
        assert pixels_of(tmp_path / "there" / "maps" / "site.VRT") == before
        assert not (tmp_path / "there" / "tiles" / "mosaic.vrt").exists()


class TestResumed:
    """Finished tiles are kept, anything else is made again, and no byte tells."""

    @pytest.mark.nightly
    def test_after_a_kill(self, tmp_path: Path, saved: Callable[..., Path]) -> None:
        """Tiles that the journal had are the same files as before."""
        definition, folder = saved(SITE), tmp_path / "a"
        arguments = ["export-dem", definition, "--resolution", "0.002", "--tile-size", "512"]
        arguments += ["--json", "--layer", "height", "--layer", "surface", "--tiles"]
        with subprocess.Popen(
            [*COMMAND, *map(str, arguments), folder], env=ENVIRONMENT, stdout=subprocess.DEVNULL
        ) as process:
            wait_until(lambda: finished(folder) >= 5 or process.poll() is not None)
            process.kill()
        count = finished(folder)
        assert process.returncode == -signal.SIGKILL and 5 <= count < 12 * 8
        lines = (folder / NAME).read_text().splitlines()[1:]
        names = [
            name for line in lines if line.endswith("]")
            for name, *_ in json.loads(json.loads(line)[1])["files"]
        ]  # fmt: skip
        before = {name: (folder / name).stat() for name in names}
        done = json.loads(call(*arguments, folder).out)
        assert done["tiles"]["kept"] == len(names) / 2 >= 5
        assert done["tiles"]["kept"] + done["tiles"]["made"] == 12 * 8
        for name, was in before.items():
            now = (folder / name).stat()
            assert (now.st_ino, now.st_mtime_ns) == (was.st_ino, was.st_mtime_ns)
        uninterrupted = json.loads(call(*arguments, tmp_path / "b").out)
        assert contents(folder) == contents(tmp_path / "b")
        for key in ("nodata", "surfaces", "losses", "lacking"):
            assert done[key] == uninterrupted[key]
        for one, other in zip(done["files"], uninterrupted["files"], strict=True):
            assert one["bands"] == other["bands"]

    @pytest.mark.slow
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_after_a_signal(
        self, tmp_path: Path, saved: Callable[..., Path], number: signal.Signals
    ) -> None:
        """It leaves finished tiles, the journal and nothing else."""
        folder = tmp_path / "a"
        arguments = ["export-dem", saved(SITE), "--resolution", "0.001", "--tile-size", "1024"]
        with subprocess.Popen(
            [*COMMAND, *map(str, arguments), "--tiles", folder],
            env=ENVIRONMENT, stderr=subprocess.PIPE, text=True,
        ) as process:  # fmt: skip
            wait_until(lambda: finished(folder) >= 2 or process.poll() is not None)
            process.send_signal(number)
            _, told = process.communicate(timeout=60)
        assert process.returncode == 128 + number and "Traceback" not in told
        names = {path.name for path in folder.iterdir()}
        assert 2 <= finished(folder) < 12 * 8
        assert all(name == NAME or name.endswith(".tif") for name in names)

    @pytest.mark.slow
    def test_a_signal_does_not_wait_for_a_tile(
        self, tmp_path: Path, saved: Callable[..., Path]
    ) -> None:
        """Which could take minutes: what is half-written is given up."""
        folder = tmp_path / "a"
        arguments = ["export-dem", saved(SITE), "--resolution", "0.001", "--tile-size", "8192"]

        def begun() -> bool:
            with suppress(FileNotFoundError):  # files come and go
                return bool(list(folder.glob(".*/*/*.tif")))
            return False

        with subprocess.Popen([*COMMAND, *map(str, arguments), "--tiles", folder]) as process:
            wait_until(lambda: begun() or process.poll() is not None)
            process.send_signal(signal.SIGTERM)
            assert process.wait(60) == 143
        assert [path.name for path in folder.iterdir()] == [NAME]

    @pytest.mark.nightly
    @pytest.mark.parametrize(
        "damage",
        [
            "truncated",
            "flipped",
            "foreign",
            "missing",
            "torn",
            "changed",
            "unheard of",
        ],
    )
    def test_what_is_not_as_it_was_is_made_again(self, tmp_path: Path, damage: str) -> None:
        """Whatever happened to a tile, or to its line of the journal."""
        folder = tmp_path / "a"
        mosaic(folder, layers=ALL)
        whole = contents(folder)
        tile, journal = folder / "tile-1-1-surface.tif", folder / NAME
        content, lines = tile.read_bytes(), journal.read_bytes().splitlines(keepends=True)
        (at,) = (n for n, line in enumerate(lines) if b"tile-1-1-surface.tif" in line)
        if damage == "truncated":
            tile.write_bytes(content[:-1])
        elif damage == "flipped":
            tile.write_bytes(content[:-9] + bytes([content[-9] ^ 1]) + content[-8:])
        elif damage == "foreign":
            shutil.copy(folder / "tile-0-0-surface.tif", tile)
        elif damage == "missing":
            tile.unlink()
        elif damage == "torn":
            journal.write_bytes(b"".join(lines[:at]) + lines[at][:-20])
        elif damage == "changed":
            lines[at] = lines[at].replace(b"[1, 1]", b"[1, 0]")
            journal.write_bytes(b"".join(lines))
        else:
            journal.write_bytes(b"".join(lines[:at] + lines[at + 1 :]))
        lost = TILES - at + 1 if damage == "torn" else 1
        report = mosaic(folder, layers=ALL)
        assert report.tiles and (report.tiles.kept, report.tiles.made) == (TILES - lost, lost)
        assert contents(folder) == whole
        again = mosaic(folder, layers=ALL)
        assert again.tiles and (again.tiles.kept, again.tiles.made) == (TILES, 0)

    def test_the_report_is_that_of_one_run(self, tmp_path: Path) -> None:
        """To the last bit of a mean: what is kept is counted as if it was made."""
        whole = mosaic(tmp_path / "a", layers=ALL)
        for name in ("tile-0-1.tif", "tile-1-0-color.tif"):
            (tmp_path / "a" / name).unlink()
        resumed = mosaic(tmp_path / "a", layers=ALL)
        assert resumed.tiles and resumed.tiles.kept == TILES - 2
        for what in ("nodata", "surfaces", "lacking", "grid"):
            assert getattr(resumed, what) == getattr(whole, what)
        assert resumed.files == whole.files

    def test_left_overs_of_a_killed_run_are_removed(self, tmp_path: Path) -> None:
        """But not those of other exports into the same folder, nor anything else."""
        mosaic(tmp_path / "a")
        (tmp_path / "a" / ".terratool-tiles-0123.part" / "deep").mkdir(parents=True)
        (tmp_path / "a" / ".terratool-0123.part").mkdir()
        mosaic(tmp_path / "a")
        left = [path.name for path in (tmp_path / "a").iterdir() if path.is_dir()]
        assert left == [".terratool-0123.part"]

    def test_progress_counts_kept_tiles(self, tmp_path: Path) -> None:
        for _ in range(2):
            seen: list[int] = []
            mosaic(tmp_path / "a", progress=seen.append)
            assert sum(seen) == 1200 * 800 and len(seen) == TILES


class TestAnother:
    """What is not the same mosaic is refused, and kept, unless it is to be overwritten."""

    @pytest.mark.parametrize(
        ("options", "word"),
        [
            ({"layers": ("height", "slope")}, "choice of layers"),
            ({"dtype": "float64"}, "type of numbers"),
            ({"compress": "deflate"}, "compression"),
            ({"tile_size": 1024}, "tile size"),
            ({"losses": False}, "choice of losses"),
        ],
    )
    def test_refused(self, tmp_path: Path, options: dict[str, Any], word: str) -> None:
        mosaic(tmp_path / "a")
        before = contents(tmp_path / "a")
        with pytest.raises(WriteError, match=f"holds a mosaic with another {word}"):
            mosaic(tmp_path / "a", **options)
        assert contents(tmp_path / "a") == before

    def test_another_terrain_or_grid(self, tmp_path: Path, grid: Grid) -> None:
        mosaic(tmp_path / "a")
        surfaces = {**SITE["surfTypes"], "rock": {"cohesion": 8.6}}
        other = terrain_of({**SITE, "surfTypes": surfaces})
        with pytest.raises(WriteError, match="another definition"):
            export_mosaic(other, grid, tmp_path / "a", tile_size=512)
        with pytest.raises(WriteError, match="another grid"):
            coarser = grid_over(terrain_of(SITE), 0.02)
            export_mosaic(terrain_of(SITE), coarser, tmp_path / "a", tile_size=512)

    def test_fingerprint(self) -> None:
        """Of what the definition means, not of how it is written."""
        own = fingerprint(terrain_of(SITE))
        backwards = dict(reversed(SITE.items()))
        assert fingerprint(terrain_of(backwards)) == own
        assert fingerprint(terrain_of({**SITE, "x-note": 1})) == own
        for key, value in (
            ("descr", "other"), ("crs", "EPSG:32634"), ("origin", [500000, 4649777]),
            ("elemTree", {**SITE["elemTree"], "vScale": 2}),
        ):  # fmt: skip
            assert fingerprint(terrain_of({**SITE, key: value})) != own

    def test_overwriting_begins_anew_and_removes_its_own(self, tmp_path: Path) -> None:
        """Tiles, what GDAL put beside them, and indexes; all else stays."""
        folder = tmp_path / "a"
        mosaic(folder, tmp_path / "site.vrt", layers=("height", "color"))
        mine = ["notes.txt", "tile-1.tif", "my-tile-0-0.tif", "tile-0-0.tif.txt", "other.vrt"]
        for name in [*mine, "tile-0-0.tif.aux.xml"]:
            (folder / name).write_text("mine")
        report = mosaic(folder, tile_size=1024, overwrite=True)
        assert report.tiles and (report.tiles.kept, report.tiles.made) == (0, 2)
        assert sorted(contents(folder)) == sorted(
            [*mine, "tile-0-0.tif", "tile-0-1.tif", "mosaic.vrt"]
        )
        assert all((folder / name).read_text() == "mine" for name in mine)
        assert not list(tmp_path.glob("*.vrt"))

    def test_files_without_a_journal(self, tmp_path: Path) -> None:
        """Nobody knows whose they are."""
        folder = tmp_path / "a"
        folder.mkdir()
        (folder / "tile-0-1.tif").write_text("mine")
        with pytest.raises(WriteError, match=r"tile-0-1\.tif: exists already"):
            mosaic(folder)
        assert contents(folder) == {"tile-0-1.tif": b"mine"}
        mosaic(folder, overwrite=True)
        assert len(contents(folder)) == TILES + 1

    def test_a_run_that_came_to_nothing(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Its journal, without a tile, stands in nobody's way."""

        def lost(*_: Any, **__: Any) -> Any:
            raise WriteError("The disk is lost.")

        with monkeypatch.context() as patch, pytest.raises(WriteError, match="is lost"):
            patch.setattr("terratool.raster.mosaic._work", lost)
            mosaic(tmp_path / "a")
        assert [path.name for path in (tmp_path / "a").iterdir()] == [NAME]
        report = mosaic(tmp_path / "a", tile_size=1024)
        assert report.tiles and report.tiles.made == 2
        with pytest.raises(WriteError, match="another tile size"):
            mosaic(tmp_path / "a")

    def test_an_index_that_is_not_its_own(self, tmp_path: Path) -> None:
        """Refused before any tile is made; its own is written again."""
        (tmp_path / "a.vrt").write_text("mine")
        with pytest.raises(WriteError, match="exists already"):
            mosaic(tmp_path / "a", tmp_path / "a.vrt")
        assert sorted(path.name for path in tmp_path.iterdir()) == ["a.vrt"]
        mosaic(tmp_path / "a", tmp_path / "b.vrt")
        mosaic(tmp_path / "a", tmp_path / "b.vrt")
        (tmp_path / "b.vrt").write_text("mine")
        with pytest.raises(WriteError, match="exists already"):
            mosaic(tmp_path / "a", tmp_path / "b.vrt")

    def test_two_at_a_time(self, tmp_path: Path) -> None:
        """Only one process writes the journal."""
        pytest.importorskip("fcntl", reason="there are no such locks on Windows")
        mosaic(tmp_path / "a")
        header = json.loads(json.loads((tmp_path / "a" / NAME).read_text().splitlines()[0])[1])
        with (
            journal_of(tmp_path / "a", header["mosaic"], overwrite=False),
            pytest.raises(WriteError, match="another process is writing"),
        ):
            mosaic(tmp_path / "a", overwrite=True)
        mosaic(tmp_path / "a")


KILLED = """
import os, sys
from pathlib import Path
from terratool.raster.journal import NAME, journal_of
folder, overwrite = Path(sys.argv[1]), bool(sys.argv[2])
before = (folder / NAME).read_bytes() if overwrite else b""
for last in range(1000):
    (folder / NAME).unlink(missing_ok=True)
    if overwrite:
        (folder / NAME).write_bytes(before)
    if not (child := os.fork()):
        seen = 0
        def hook(event, arguments):
            global seen
            seen += event.startswith(("open", "os.", "fcntl.", "shutil."))
            if seen > last:
                os._exit(9)
        sys.addaudithook(hook)
        with journal_of(folder, {"of": "anew"}, overwrite) as journal:
            journal.begin(overwrite)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    print((folder / NAME).read_text() if (folder / NAME).exists() else "none", end="|")
    if not status:
        break
"""


class TestKilled:
    """At whatever it did with files last, the journal has its first line, or is not there."""

    @pytest.mark.slow
    @pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on Windows")
    @pytest.mark.parametrize("overwrite", [False, True])
    def test_the_journal_is_whole(self, tmp_path: Path, overwrite: bool) -> None:
        if overwrite:
            with journal_of(tmp_path, {"of": "before"}, overwrite=False) as journal:
                journal.begin(overwrite=False)
        done = subprocess.run(
            [sys.executable, "-c", KILLED, tmp_path, "1" * overwrite],
            capture_output=True, text=True, env=ENVIRONMENT, check=True,
        )  # fmt: skip
        seen = done.stdout.split("|")[:-1]
        told = [text and (text if text == "none" else json.loads(text)[1]) for text in seen]
        assert len(told) > 5
        anew = '{"mosaic": {"of": "anew"}}'
        assert set(told) == {'{"mosaic": {"of": "before"}}' if overwrite else "none", anew}
        assert told[-1] == anew
        assert sorted(path.name for path in tmp_path.iterdir() if PART not in path.name) == [NAME]


class TestWrong:
    """A sentence, a hint, and nothing left behind."""

    def test_a_full_disk(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Refused early; tiles that are there need no more space."""
        need = 1200 * 800 * 4
        monkeypatch.setattr(export, "free_bytes", lambda _: need - 1)
        with pytest.raises(WriteError, match=rf"may take {need:,} bytes, but {need - 1:,} are"):
            mosaic(tmp_path / "a")
        assert list(tmp_path.iterdir()) == []
        monkeypatch.undo()
        mosaic(tmp_path / "a")
        (tmp_path / "a" / "tile-1-1.tif").unlink()
        tile = 512 * 288 * 4
        monkeypatch.setattr(export, "free_bytes", lambda _: tile - 1)
        with pytest.raises(WriteError, match=rf"the rest of .* may take {tile:,} bytes"):
            mosaic(tmp_path / "a")
        monkeypatch.setattr(export, "free_bytes", lambda _: tile)
        mosaic(tmp_path / "a")

    def test_a_tile_that_fails(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Ends the run; what was finished before is kept, what was not leaves nothing."""
        folder, fill = tmp_path / "a", tiles.fill_files

        def fail(*arguments: Any, window: Any, **options: Any) -> Any:
            filled = fill(*arguments, window=window, **options)
            if (window.row, window.column) == (512, 512):
                raise WriteError("tile-1-1.tif: cannot be written.")
            return filled

        monkeypatch.setattr(tiles, "fill_files", fail)
        with pytest.raises(WriteError, match="tile-1-1"):
            mosaic(folder, threads=1)
        there = sorted(contents(folder))
        before = ["tile-0-0.tif", "tile-0-1.tif", "tile-0-2.tif", "tile-1-0.tif"]
        # the thread may have made the next one before anybody knew of the failure
        assert there in (before, [*before, "tile-1-2.tif"])
        noted = finished(folder)
        assert noted in (len(before), len(there))  # a file is named before it is noted
        assert len(list(folder.iterdir())) == len(there) + 1
        monkeypatch.undo()
        report = mosaic(folder)
        assert report.tiles and report.tiles.kept == noted

    @pytest.mark.nightly
    @pytest.mark.parametrize("short", [1, 5000, 150_000])
    def test_a_disk_that_fills_up(
        self, tmp_path: Path, saved: Callable[..., Path], short: int
    ) -> None:
        """Also while a file is closed, of which GDAL says nothing."""
        resource = pytest.importorskip("resource", reason="there are no limits on Windows")
        arguments = ["export-dem", saved(SITE), "--resolution", "0.02", "--threads", "1"]
        assert call(*arguments, tmp_path / "a.tif").code == 0
        limit = (tmp_path / "a.tif").stat().st_size - short

        def limited() -> None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        (tmp_path / "a.tif").unlink()
        for out in (["a.tif"], ["--tiles", "t", "--tile-size", "1024"]):
            done = subprocess.run(
                [*COMMAND, *map(str, arguments), *out],
                env=ENVIRONMENT, cwd=tmp_path, preexec_fn=limited, capture_output=True, check=False,
            )  # fmt: skip
            assert done.returncode == 3 and b"Traceback" not in done.stderr
            assert b"\nterratool: " in b"\n" + done.stderr
        assert not list(tmp_path.rglob("*.tif")) and not list(tmp_path.rglob("*.part"))

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("arguments", "code", "word"),
        [
            (["a.tif", "--dask", "local"], 2, "Add --tiles DIR"),
            (["a.tif", "--tile-size", "512"], 2, "Add --tiles DIR"),
            (["--dask", "local"], 2, "'OUT'"),
            (["a.vrt"], 2, "--tiles"),
            (["a.tif", "--tiles", "t"], 2, "is a .vrt"),
            (["--tiles", "t", "--cog"], 2, "--cog"),
            (["--tiles", "t", "--tile-size", "500"], 2, "multiple of 512"),
            (["--tiles", "t", "--tile-size", "0"], 2, "multiple of 512"),
            (["--tiles", "no/t"], 3, "does not exist"),
            (["no/a.vrt", "--tiles", "t"], 3, "does not exist"),
            (["--tiles", "terrain.json"], 3, "is no folder"),
            (["--tiles", "t", "--resolution", "0.00002"], 3, "are free"),
        ],
    )
    def test_by_command(
        self, tmp_path: Path, saved: Callable[..., Path], arguments: list[str], code: int, word: str
    ) -> None:
        saved(SITE)
        done = subprocess.run(
            [*COMMAND, "export-dem", "terrain.json", *arguments],
            env=ENVIRONMENT, cwd=tmp_path, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == code and word in done.stderr, done.stderr
        assert done.stdout == "" and "Traceback" not in done.stderr
        assert len(done.stderr.strip().splitlines()) >= 2
        assert [path.name for path in tmp_path.iterdir()] == ["terrain.json"]


def test_the_command_says_what_it_did(tmp_path: Path, saved: Callable[..., Path]) -> None:
    arguments = ["export-dem", saved(SITE), "--resolution", "0.01", "--tile-size", "512"]
    done = call(*arguments, "--tiles", tmp_path / "a", "--json")
    assert json.loads(done.out)["tiles"] == {
        "folder": str(tmp_path / "a"), "size": 512, "rows": 2, "columns": 3, "kept": 0, "made": 6,
    }  # fmt: skip
    (tmp_path / "a" / "tile-0-0.tif").unlink()
    text = call(*arguments, "--tiles", tmp_path / "a").out
    assert "2 × 3 tiles of 512², 1 made, 5 kept of an earlier run" in text
    assert f"{tmp_path / 'a' / 'mosaic.vrt'}: float32" in text
    plain = call(
        "export-dem", ROOT / "samples" / "paper-example.json", tmp_path / "a.tif", "--json"
    )
    assert json.loads(plain.out)["tiles"] is None
