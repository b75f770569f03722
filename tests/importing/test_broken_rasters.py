"""Rasters that are broken, or claim more than they have: a sentence, quickly, and no memory."""

from __future__ import annotations

import gzip
import io
import json
import math
import struct
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from rasterio.transform import Affine

from terratool.errors import ReadError
from terratool.importing.sources import open_source
from terratool.importing.types import SourceOptions
from terratool.io.guards import HARMLESS, PACKED
from tests.commands import ENVIRONMENT, call, run
from tests.rasters import geotiff

HEIGHTS = np.arange(24.0).reshape(4, 6)  # from the north

Tags = dict[int, tuple[int, Sequence[float]]]


def tiff(pixels: bytes, tags: Tags, width: int = 6, height: int = 4) -> bytes:
    """A little-endian TIFF of one strip of bytes; `tags` are types and values by number."""
    base: Tags = {
        256: (4, [width]), 257: (4, [height]), 258: (3, [8]), 259: (3, [1]), 262: (3, [1]),
        273: (4, [8]), 277: (3, [1]), 278: (4, [height]), 279: (4, [len(pixels)]),
        33550: (12, [1.0, 1.0, 0.0]), 33922: (12, [0.0, 0.0, 0.0, 0.0, 4.0, 0.0]),
    }  # fmt: skip
    base |= tags
    directory = 8 + len(pixels)
    after = directory + 2 + 12 * len(base) + 4
    fields, more = b"", b""
    for tag, (kind, values) in sorted(base.items()):
        data = struct.pack(f"<{len(values)}{ {2: 'B', 3: 'H', 4: 'I', 12: 'd'}[kind] }", *values)
        field = data.ljust(4, b"\0")
        if len(data) > 4:
            field, more = struct.pack("<I", after + len(more)), more + data
        fields += struct.pack("<HHI", tag, kind, len(values)) + field
    head = b"II*\0" + struct.pack("<I", directory) + pixels
    return head + struct.pack("<H", len(base)) + fields + bytes(4) + more


def geokeys(*keys: int, count: int | None = None) -> Tags:
    """The directory of GeoKeys: number, place, count and value of each."""
    return {34735: (3, [1, 1, 0, len(keys) // 4 if count is None else count, *keys])}


def netcdf(dimensions: int = 2, attributes: int = 1, length: int = 6, rows: int = 4) -> bytes:
    """HEIGHTS as a classic netCDF; the counts in its header may be others than there are."""

    def name(text: str) -> bytes:
        return struct.pack(">I", len(text)) + text.encode().ljust(-(-len(text) // 4) * 4, b"\0")

    head = b"CDF\1" + struct.pack(">III", 0, 10, dimensions)
    head += name("y") + struct.pack(">I", rows) + name("x") + struct.pack(">I", length)
    head += struct.pack(">II", 12, attributes) + name("title") + struct.pack(">II", 2, 4) + b"dem "
    head += struct.pack(">II", 11, 1) + name("z") + struct.pack(">III", 2, 0, 1) + bytes(8)
    head += struct.pack(">III", 5, (4 * rows * length) % 2**32, len(head) + 12)
    return head + HEIGHTS.astype(">f4").tobytes()


def read(path: object, **options: Any) -> np.ndarray:
    """Heights from the north."""
    with open_source(str(path), SourceOptions(**options)) as source:
        return source.read(0, source.grid.rows)[::-1]


def saved(path: Path, data: bytes | str) -> Path:
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def zipped(name: str, data: bytes) -> bytes:
    """An archive of one file."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, data)
    return packed.getvalue()


def memory_for(path: Path | str) -> tuple[str, int]:
    """What a process that opens a source says, and the most memory, in MB, that it or one of its
    own has had, besides what it takes to read a good one."""
    code = (
        "import resource, sys\n"
        "from terratool.errors import ReadError\n"
        "from terratool.importing.sources import open_source\n"
        "try:\n"
        "    with open_source(sys.argv[1]) as source:\n"
        "        source.read(0, source.grid.rows)\n"
        "    print('read')\n"
        "except ReadError as error:\n"
        "    print(error.message)\n"
        "status = open('/proc/self/status').read()\n"  # ru_maxrss counts who started it, too
        "print(int(status.split('VmHWM:')[1].split()[0]) // 1024)\n"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)],
        capture_output=True, text=True, check=True, env=ENVIRONMENT,
    )  # fmt: skip
    assert done.stderr == ""
    *said, own, children = done.stdout.splitlines()
    return "\n".join(said), max(int(own), int(children))


class TestBroken:
    """Errors of GDAL are sentences."""

    @pytest.mark.parametrize(
        "tags",
        [
            geokeys(1024, 0, 1, 1, 0, 0, 1, 1, 3072, 0, 1, 32633),
            geokeys(1024, 9999, 1, 1, 3072, 256, 1, 1),
            geokeys(1024, 34737, 5, 0, 3072, 34736, 5, 7),
            geokeys(1024, 0, 1, 1, count=2000),
            geokeys(1024, 0, 1, 1, 3072, 0, 1, 32767, 3076, 0, 1, 7),
            geokeys(1024, 0, 1, 2, 2048, 0, 1, 32767, 2054, 0, 1, 7),
            {**geokeys(1026, 34737, 3, 0), 34737: (2, [255, 254, 0])},
            {34735: (3, [7])},
        ],
    )
    @pytest.mark.parametrize("crs", [None, "EPSG:32632"])
    def test_geokeys(self, tmp_path: Path, tags: Tags, crs: str | None) -> None:
        """Where the file lies may be unknown; its heights are there, or a sentence is."""
        path = saved(tmp_path / "a.tif", tiff(HEIGHTS.astype("u1").tobytes(), tags))
        more = ["--crs", crs] if crs else []
        ran = (call if crs else run)(
            "import-terrain", path, tmp_path / "o.json", "--max-error", 1, *more
        )
        assert ran.code in (0, 2, 3)
        assert "Traceback" not in ran.err and "proj.db" not in ran.err and "_uom_" not in ran.err
        try:
            assert crs or np.array_equal(read(path), HEIGHTS)
        except ReadError as error:  # its name is no text
            assert 34737 in tags and "utf-8" in error.message
        call("import-terrain", path, tmp_path / "p.json", "--max-error", 1, "--surfaces", path)

    @pytest.mark.parametrize("compression", [2, 3, 4, 5, 7, 8, 32773, 34887, 50000, 65000])
    def test_compressed_pixels(self, tmp_path: Path, compression: int) -> None:
        """CCITT in three kinds, LZW, JPEG, deflate, …"""
        one_bit = {258: (3, [1])} if compression < 5 else {}
        tags: Tags = {**one_bit, 259: (3, [compression]), **geokeys(1024, 0, 1, 1)}
        path = saved(tmp_path / "a.tif", tiff(b"\xff\x37\xa1" * 20, tags, 60, 40))
        for more in ([], ["--band", 1], ["--band", 1, "--surfaces", path]):
            out = tmp_path / f"o{len(more)}.json"
            ran = call("import-terrain", path, out, "--max-error", 1, *more)
            assert ran.code in (0, 3) and out.exists() == (ran.code == 0)

    def test_tiles_of_a_jpeg_2000_that_are_broken(
        self, tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        """No heights are made up for them, and GDAL prints nothing itself."""
        heights = np.random.default_rng(5).integers(0, 4000, (192, 256)).astype(np.int16)
        geotiff(tmp_path / "a.tif", heights)
        path = tmp_path / "a.jp2"
        options = {"BLOCKXSIZE": 64, "BLOCKYSIZE": 64, "QUALITY": 100, "REVERSIBLE": "YES"}
        rasterio.shutil.copy(tmp_path / "a.tif", path, driver="JP2OpenJPEG", **options)
        assert np.array_equal(read(path), heights)
        data = bytearray(path.read_bytes())
        # behind the head of a part of a tile (ISO/IEC 15444-1, A.4.2)
        at = data.index(b"\xff\x90\0\x0a", len(data) // 2)
        data[at + 12 : at + 40] = b"\xff" * 28
        capfd.readouterr()
        with pytest.raises(ReadError, match="cannot be read as a raster"):
            read(saved(path, bytes(data)))
        assert capfd.readouterr().err == ""

    def test_places_and_scales_that_are_no_numbers(self, tmp_path: Path) -> None:
        raw = HEIGHTS.astype("<f4").tobytes()
        header = "BYTEORDER I\nNROWS 4\nNCOLS 6\nNBITS 32\nPIXELTYPE FLOAT\nULXMAP 0\nULYMAP 0\n"
        path = saved(tmp_path / "a.bil", raw)
        for side in ("1", "0", "nan", "inf"):
            saved(tmp_path / "a.hdr", f"{header}XDIM {side}\nYDIM 1\n")
            if side == "1":
                assert np.array_equal(read(path), HEIGHTS)
                continue
            with pytest.raises(ReadError, match="have no size, or lie nowhere"):
                read(path)
        for scale in (math.inf, math.nan):
            name = geotiff(tmp_path / "b.tif", HEIGHTS, band={"scales": (scale,)})
            with pytest.raises(ReadError, match="scale or an offset that is no number"):
                read(name)

    def test_heights_that_are_infinite_once_scaled(self, tmp_path: Path) -> None:
        """Without a complaint of NumPy: warnings are errors here."""
        heights = np.full((4, 6), 1e300)
        heights[1, 2], heights[2, 3] = 0, math.inf
        band = {"scales": (1e300,), "offsets": (7.0,)}
        with open_source(geotiff(tmp_path / "b.tif", heights, band=band)) as source:
            assert np.nansum(source.read(0, 4)) == 7
            assert source.notes == ("23 pixels are infinite: taken as nodata.",)

    def test_messages_that_are_no_text_are_not_printed(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """Rasterio hands them to both hooks of the interpreter; other errors pass."""
        name = geotiff(tmp_path / "a.tif", HEIGHTS)
        before = sys.excepthook, sys.unraisablehook
        with open_source(name):
            unreadable = UnicodeDecodeError("utf-8", b"\xff", 0, 1, "of GDAL")
            sys.excepthook(UnicodeDecodeError, unreadable, None)
            assert capsys.readouterr().err == ""
            sys.excepthook(KeyError, KeyError("other"), None)
            assert "other" in capsys.readouterr().err
        assert before == (sys.excepthook, sys.unraisablehook)


class TestNetCDF:
    """A library that believes what it reads is kept in a process of its own."""

    def test_a_good_one(self, tmp_path: Path) -> None:
        path = saved(tmp_path / "a.nc", netcdf())
        found = read(path)
        assert np.array_equal(found, HEIGHTS) or np.array_equal(found, HEIGHTS[::-1])
        assert np.array_equal(read(f"NETCDF:{path}:z"), found)

    def test_one_in_an_archive(self, tmp_path: Path) -> None:
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            archive.writestr("bad.nc", netcdf(dimensions=0x8000002))
        with pytest.raises(ReadError):
            read(f"/vsizip/{tmp_path}/a.zip/bad.nc")

    @pytest.mark.slow
    @pytest.mark.parametrize(
        "counts",
        [
            {"dimensions": 0x8000002}, {"dimensions": 0x10000002}, {"attributes": 0x7FFF00},
            {"attributes": 0x3FFFFFFF}, {"attributes": 0x77000000}, {"length": 0x7FFFFFF0},
        ],
    )  # fmt: skip
    @pytest.mark.parametrize("prefix", ["", "NETCDF:"])
    def test_counts_that_are_not_there(
        self, tmp_path: Path, counts: dict[str, int], prefix: str
    ) -> None:
        """Some crash the library, others have it take gigabytes."""
        path = saved(tmp_path / "a.nc", netcdf(**counts))
        assert path.stat().st_size < 400
        said, memory = memory_for(Path(f"{prefix}{path}:z" if prefix else path))
        assert "a.nc" in said and said != "read"
        assert memory < 600


class TestClaims:
    """More pixels than bytes can hold."""

    HEADS = (
        ("name", "head"),
        [
            ("a.bt", b"binterr1.3" + struct.pack("<IIhhhh4d", 2**29, 13, 4, 1, 1, 33, 0, 9, 0, 9)),
            ("a.grd", b"DSAA\n17 2147483647\n0 1\n0 1\n0 1\n1 2 3\n"),
            ("a.grd", b"DSAA\n2147483647 13\n0 1\n0 1\n0 1\n1 2 3\n"),
            ("a.asc", b"ncols 440242\nnrows 90000\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n"),
            ("a.tif", tiff(bytes(24), {324: (4, [8] * 9)}, 1 << 20, 1 << 20)),
            ("a.asc", b"ncols 12\nnrows 9999\nxllcorner 0\nyllcorner 0\ncellsize 2\n" + b"1 " * 99),
            ("a.pgm", b"P5\n1000000 1000000\n255\n" + bytes(99)),
        ],
    )  # fmt: skip

    @pytest.mark.slow
    @pytest.mark.parametrize(*HEADS)
    def test_of_small_files(self, tmp_path: Path, name: str, head: bytes) -> None:
        said, memory = memory_for(saved(tmp_path / name, head.ljust(400, b"\0")))
        assert name in said and said != "read"
        assert memory < 500

    @pytest.mark.slow
    @pytest.mark.parametrize(*HEADS)
    @pytest.mark.parametrize("archive", ["zip", "gz", "zip of zip"])
    def test_of_small_files_in_archives(
        self, tmp_path: Path, name: str, head: bytes, archive: str
    ) -> None:
        """They are held against the archive, which is what there is."""
        data, place = head.ljust(400, b"\0"), f"{tmp_path}/a.zip/{name}"
        if archive == "gz":
            saved(tmp_path / f"{name}.gz", gzip.compress(data))
            place = f"/vsigzip/{tmp_path}/{name}.gz"
        else:
            saved(tmp_path / "a.zip", zipped(name, data))
            place = f"/vsizip/{place}"
        if archive == "zip of zip":
            saved(tmp_path / "b.zip", zipped("a.zip", (tmp_path / "a.zip").read_bytes()))
            (tmp_path / "a.zip").unlink()
            place = f"/vsizip/{{/vsizip/{{{tmp_path}/b.zip}}/a.zip}}/{name}"
        said, memory = memory_for(place)
        assert name in said and said != "read"
        assert memory < 500

    def test_bombs(self, tmp_path: Path) -> None:
        """Of level heights in two archives, a million times as many as there are bytes."""
        side = 16384
        tags: Tags = {258: (3, [16]), 339: (3, [2]), 278: (4, [1]),
                      273: (4, [8] * side), 279: (4, [2 * side] * side)}  # fmt: skip
        inner = zipped("a.tif", tiff(bytes(2 * side * 64), tags, side, side))
        saved(tmp_path / "b.zip", zipped("a.zip", inner))
        place = f"/vsizip/{{/vsizip/{{{tmp_path}/b.zip}}/a.zip}}/a.tif"
        with pytest.raises(ReadError, match=f"claims {side:,} × {side:,} pixels, but") as caught:
            read(place)
        assert "unpack the archive" in caught.value.hint
        said, memory = memory_for(place)
        assert "claims" in said and memory < 500

    @pytest.mark.nightly
    def test_what_is_packed_well_is_read_from_its_archive(self, tmp_path: Path) -> None:
        """Twenty pixels a byte and more, which a raw file could not have."""
        columns = 2500
        digits = np.random.default_rng(1).integers(0, 10, (2000, columns // 100))
        digits[-1, 0] = 9
        rows = (" ".join(row) for row in np.repeat(digits, 100, axis=1).astype("U1"))
        head = f"ncols {columns}\nnrows 2000\nxllcorner 3\nyllcorner 4\ncellsize 1\n"
        saved(tmp_path / "a.zip", zipped("a.asc", (head + "\n".join(rows)).encode()))
        assert (tmp_path / "a.zip").stat().st_size * 20 < 2000 * columns
        with open_source(f"zip://{tmp_path}/a.zip!a.asc") as source:
            assert (source.grid.columns, source.grid.rows) == (columns, 2000)
            assert source.read(0, 1)[0, :100].tolist() == [9] * 100

    def test_what_is_sparse_or_level_is_read(self, tmp_path: Path) -> None:
        """Tiles that were never written, and such as compress well."""
        sizes = {}
        for name, options in {
            "level": {"compress": "zstd"}, "sparse": {"sparse_ok": True, "blockxsize": 256},
            "empty": {"sparse_ok": True, "width": 10240, "height": 9984, "compress": "zstd"},
        }.items():  # fmt: skip
            profile: dict[str, Any] = {
                "driver": "GTiff", "count": 1, "width": 6000, "height": 4000, "dtype": "float32",
                "tiled": True, "transform": Affine(1, 0, 9, 0, -1, 0), **options,
            }  # fmt: skip
            with rasterio.open(tmp_path / f"{name}.tif", "w", **profile) as file:
                if name == "level":
                    file.write(np.full((1, 4000, 6000), 7, np.float32))
                elif name == "sparse":
                    window = rasterio.windows.Window(0, file.height - 2000, 6000, 2000)
                    file.write(np.full((1, 2000, 6000), 7, np.float32), window=window)
                else:  # one tile
                    window = rasterio.windows.Window(0, file.height - 256, 256, 256)
                    file.write(np.full((1, 256, 256), 7, np.float32), window=window)
            sizes[name] = (tmp_path / f"{name}.tif").stat().st_size
            with open_source(str(tmp_path / f"{name}.tif")) as source:
                assert source.read(0, 1)[0, 0] == 7
        assert sizes["level"] * PACKED > 2 * 6000 * 4000
        # the last has fewer bytes than its pixels need, but the index of all tiles
        assert 10240 * 9984 > PACKED * sizes["empty"] > HARMLESS

    def test_what_is_claimed_and_true_has_a_way_out(self, tmp_path: Path) -> None:
        """What the hint names is done, by GDAL as gdal_translate does it, and read."""
        path, stored = tmp_path / "a.tif", tmp_path / "b.tif"
        heights = np.full((3900, 4100), 7, np.int16)
        heights[3, 5] = 9
        geotiff(path, heights, compress="zstd", blockysize=3900)
        assert path.stat().st_size * PACKED < heights.size
        with pytest.raises(ReadError, match="claims 4,100 × 3,900 pixels, but has") as caught:
            read(path)
        assert "gdal_translate -co COMPRESS=NONE" in caught.value.hint
        rasterio.shutil.copy(path, stored, driver="GTiff", COMPRESS="NONE", BIGTIFF="IF_SAFER")
        assert np.array_equal(read(stored), heights)

    @pytest.mark.parametrize("name", ["a.pgm", "a.grd", "a.nc"])
    def test_what_cannot_be_true_is_cut_short(self, tmp_path: Path, name: str) -> None:
        """Where all pixels are stored, to store them again does not help."""
        data = {"a.pgm": b"P5\n1000000 1000000\n255\n" + bytes(99), "a.nc": netcdf(rows=4_000_000),
                "a.grd": b"DSAA\n17 2147483647\n0 1\n0 1\n0 1\n1 2 3\n"}[name]  # fmt: skip
        with pytest.raises(ReadError, match="claims") as caught:
            read(saved(tmp_path / name, data))
        assert "cut short" in caught.value.hint and "gdal_translate" not in caught.value.hint

    def test_a_classic_netcdf_has_all_of_its_numbers(self, tmp_path: Path) -> None:
        """Rows without a byte are not even counted through."""
        with pytest.raises(ReadError, match=r"claims 1 × 4,000,000 pixels, but has \d\d\d bytes"):
            read(saved(tmp_path / "a.nc", netcdf(length=1, rows=4_000_000)))

    def test_pixels_that_become_too_many(self, tmp_path: Path) -> None:
        """Reprojected, a needle over half of the earth is a square."""
        name = geotiff(
            tmp_path / "a.tif", np.zeros((2, 4000)), (0.02, 1e-5), (10, 50), crs="EPSG:4326"
        )
        with pytest.raises(ReadError, match="would become"):
            read(name, crs="EPSG:32632")

    def test_the_command_says_so(self, tmp_path: Path) -> None:
        path = saved(tmp_path / "a.nc", netcdf(dimensions=0x8000002))
        ran = run("import-terrain", path, tmp_path / "o.json", "--max-error", 1)
        assert ran.code == 3 and list(tmp_path.iterdir()) == [path]
        assert ran.err.splitlines()[0].startswith("terratool: ") and "netCDF" in ran.err
        assert json.dumps(ran.out) == '""'


@pytest.mark.parametrize("beside", [False, True])
def test_a_png_that_is_cut_short_is_told(tmp_path: Path, beside: bool) -> None:
    """GDAL reads what is missing as 0. The end is its own, not that of a file beside it."""
    pixels = np.random.default_rng(4).integers(1, 200, (60, 90)).astype(np.uint8)
    geotiff(tmp_path / "a.tif", pixels)
    path = tmp_path / "a.png"
    rasterio.shutil.copy(tmp_path / "a.tif", path, driver="PNG")
    (tmp_path / "a.png.aux.xml").unlink()
    if beside:
        note = f"<PAMDataset><Metadata><MDI key='a'>{'x' * 9000}</MDI></Metadata></PAMDataset>"
        (tmp_path / "a.png.aux.xml").write_text(note)
    assert np.array_equal(read(path), pixels)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(ReadError, match=r"a\.png: has no end\. It may be cut short"):
        read(path)
