"""Which rasters are opened: those on this machine, which lead nowhere else."""

from __future__ import annotations

import gzip
import io
import os
import re
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from rasterio._err import CPLE_OutOfMemoryError
from rasterio.errors import RasterioIOError
from rasterio.transform import Affine

from terratool.errors import ReadError, RequestError
from terratool.importing.rasters import open_classes
from terratool.importing.sources import open_source
from terratool.importing.types import PixelGrid, SourceOptions
from terratool.io.opening import DRIVERS, gdal_errors, refuse_remote
from tests.commands import ROOT, call
from tests.conftest import terrain_of
from tests.mosaics import SITE
from tests.rasters import geotiff

VRT = """<VRTDataset rasterXSize="6" rasterYSize="4">
  <GeoTransform>0, 1, 0, 4, 0, -1</GeoTransform>
  <VRTRasterBand dataType="Float32" band="1"{band}>
    <SimpleSource><SourceFilename relativeToVRT="{relative}">{source}</SourceFilename>
      <SourceBand>1</SourceBand></SimpleSource>
  </VRTRasterBand>{more}
</VRTDataset>"""


def dem(path: Path) -> Path:
    """Six columns and four rows of heights, all of them different."""
    path.parent.mkdir(exist_ok=True)
    with rasterio.open(
        path, "w", driver="GTiff", width=6, height=4, count=1, dtype="float32",
        transform=Affine(1, 0, 0, 0, -1, 4),
    ) as file:  # fmt: skip
        file.write(np.arange(24, dtype=np.float32).reshape(1, 4, 6))
    return path


def vrt(path: Path, source: str, relative: int = 1, band: str = "", more: str = "") -> Path:
    path.parent.mkdir(exist_ok=True)
    text = VRT.format(source=source, relative=relative, band=band, more=more)
    path.write_text(text, encoding="utf-8")
    return path


def heights(path: object, **options: bool) -> np.ndarray:
    with open_source(str(path), SourceOptions(**options)) as source:
        return source.read(0, source.grid.rows)


@pytest.mark.parametrize(
    "name",
    [
        "http://127.0.0.1/dem.tif", "https://example.com/dem.tif", "/vsicurl/http://a/dem.tif",
        "/vsicurl_streaming/http://a/b.tif", "/vsis3/bucket/dem.tif", "s3://bucket/dem.tif",
        "gs://bucket/dem.tif", "zip+https://example.com/a.zip!dem.tif", "az://a/b", "FTP://a/b.tif",
        "/vsizip//vsicurl/http://a/b.zip/c.tif", "/vsizip/vsis3/a/b.zip",
        "/vsicached?file=a.tif",
        "/vsisubfile/0_9,a.tif", "/vsimem/a.tif", "WMS:http://a/wms", "WCS:https://a/wcs",
        "/vsizip/{vsis3/a/b.zip}/c.tif", "/vsizip/{/vsis3/a/b.zip}/c.tif", "zip://vsis3/a/b.zip!c.tif",
        "zip:///vsis3/a/b.zip!c.tif", "tar+file://vsicurl/x!c.tif",
        "NETCDF:http://a/b.nc:z", "<GDAL_WMS></GDAL_WMS>", '{"type":"Feature"}',
    ],
)  # fmt: skip
def test_names_that_lead_to_the_net(name: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError):
        refuse_remote(name)
    ran = call("import-terrain", name, tmp_path / "out.json", "--max-error", 1)
    assert ran.code == 3 and not (tmp_path / "out.json").exists()


@pytest.mark.parametrize(
    "name",
    ["dem.tif", "/a/dem.tif", "C:\\data\\dem.tif", "/vsizip/a.zip/dem.tif", "zip://a.zip!dem.tif",
     "/vsigzip/a.asc.gz", 'NETCDF:"a.nc":z', 'HDF5:"a.h5"://group/z', "file:///a/dem.tif",
     "a b/http.tif", "GTIFF_DIR:2:a.tif"],
)  # fmt: skip
def test_names_of_files(name: str) -> None:
    refuse_remote(name)


@pytest.fixture
def archives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    """A DEM in archives of several kinds, in the folder where we are; and its heights."""
    monkeypatch.chdir(tmp_path)
    data = dem(tmp_path / "a.tif").read_bytes()
    expected = heights("a.tif")
    (tmp_path / "a.tif").unlink()
    for name in ("a.zip", "packed.data"):
        with zipfile.ZipFile(name, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("a.tif", data)
            archive.writestr("in it/b c.tif", data)
    for name, mode in (("a.tar", "w"), ("a.tar.gz", "w:gz")):
        with tarfile.open(name, mode) as archive:
            member = tarfile.TarInfo("in it/a.tif")
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    Path("a.tif.gz").write_bytes(gzip.compress(data))
    return expected


@pytest.mark.parametrize(
    "name",
    ["zip://a.zip!a.tif", "zip://a.zip!/in it/b c.tif", "zip://{here}/a.zip!a.tif",
     "ZIP+file://a.zip!a.tif", "zip://packed.data!a.tif", "/vsizip/a.zip/a.tif",
     "/vsizip/{here}/a.zip/in it/b c.tif", "/vsizip//{here}/a.zip/a.tif",
     "/vsizip/{{packed.data}}/a.tif", "tar://a.tar!in it/a.tif", "tar://a.tar.gz!in it/a.tif",
     "/vsitar/a.tar.gz/in it/a.tif", "/vsigzip/a.tif.gz", "gzip://a.tif.gz"],
)  # fmt: skip
@pytest.mark.parametrize("allow_remote", [False, True])
def test_rasters_in_archives(
    name: str, allow_remote: bool, archives: np.ndarray, tmp_path: Path
) -> None:
    """As rasterio and as GDAL name them; nothing is left beside the archive."""
    before = sorted(tmp_path.iterdir())
    found = heights(name.format(here=tmp_path), allow_remote=allow_remote)
    assert np.array_equal(found, archives)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("a.zip", "Name the raster in the archive, as in zip://a.zip!dem.tif."),
        ("a.tar", "Name the raster in the archive, as in tar://a.tar!dem.tif."),
        ("a.tif.gz", "Unpack it, or name what is in it: /vsigzip/a.tif.gz."),
        ("zip://a.zip!b.tif", "unpack the archive"),
        ("/vsizip/a.zip", "unpack the archive"),
        ("/vsizip/a.zip/surfer.grd", "unpack the archive"),
        ("a.grib", "Make a GeoTIFF of it with gdal_translate"),
        ("file:none.tif", "Check the path"),
    ],
)
def test_what_to_do_where_nothing_is_read(name: str, hint: str, archives: np.ndarray) -> None:
    with zipfile.ZipFile("a.zip", "a") as archive:
        archive.writestr("surfer.grd", b"DSAA\n2 2\n0 1\n0 1\n0 1\n1 2\n3 4\n")
    Path("a.grib").write_bytes(b"GRIB\0\0\0\2" + bytes(100) + b"7777")
    with pytest.raises(ReadError) as caught:
        heights(name)
    assert hint in caught.value.hint
    for word in re.findall(r"\S+a\.(?:zip|tar)!|/vsigzip/\S+(?=\.$)", caught.value.hint):
        inside = {"zip://a.zip!": "a.tif", "tar://a.tar!": "in it/a.tif"}.get(word, "")
        assert np.array_equal(heights(word + inside), archives)


@pytest.mark.parametrize(
    "error", [KeyError, TypeError, ValueError, RuntimeError, NotImplementedError, AttributeError]
)
def test_faults_of_the_program_are_not_told_as_those_of_a_raster(error: type[Exception]) -> None:
    with pytest.raises(error, match="own"), gdal_errors("a.tif"):
        raise error("own")


def _color_table(path: Path) -> None:
    with rasterio.open(path) as file:
        file.colormap(1)  # a ValueError of rasterio's


def _inverse(_: Path) -> None:
    ~Affine(0, 0, 0, 0, 0, 0)


def _reference_system(_: Path) -> None:
    rasterio.crs.CRS.from_string("EPSG:99")


def _vanished(path: Path) -> None:
    path.with_name("b").stat()


@pytest.mark.parametrize("fails", [_color_table, _inverse, _reference_system, _vanished])
def test_errors_of_rasterio_are_told_as_those_of_a_raster(
    fails: Callable[[Path], None], tmp_path: Path
) -> None:
    path = dem(tmp_path / "a.tif")
    with pytest.raises(ReadError, match=r"a\.tif: cannot be read as a"), gdal_errors("a.tif"):
        fails(path)


def test_too_little_memory_is_told_as_such(tmp_path: Path) -> None:
    """By Python, by NumPy within rasterio, and by GDAL."""
    path = dem(tmp_path / "a.tif")

    def by_rasterio() -> None:
        with rasterio.open(path) as file:
            file.read(1, out_shape=(1 << 24, 1 << 24))

    def by_gdal() -> None:
        raise RasterioIOError("read failed") from CPLE_OutOfMemoryError(2, 2, "cannot allocate")

    for fails in (lambda: np.empty(1 << 56), by_rasterio, by_gdal):
        with pytest.raises(ReadError) as caught, gdal_errors("a.tif"):
            fails()
        assert caught.value.message == "a.tif: does not fit into memory."
        assert "--bounds" in caught.value.hint


def test_the_documentation_lists_the_drivers() -> None:
    """Those that are asked, and the known ones that are not."""
    text = " ".join((ROOT / "docs" / "import-rasters.md").read_text("utf-8").split())
    listed = text.partition("These drivers of GDAL are asked: ")[2].partition(".")[0]
    assert sorted(listed.split(", ")) == sorted(DRIVERS)
    assert "GRIB is not" in text and "GRIB" not in DRIVERS


def test_a_mosaic_in_its_folder(tmp_path: Path) -> None:
    """Sources beside it and below it, by relative and by whole names."""
    beside, below = dem(tmp_path / "a.tif"), dem(tmp_path / "tiles" / "b.tif")
    expected = heights(beside)
    for source, relative in (("a.tif", 1), ("tiles/b.tif", 1), (str(beside), 0), (str(below), 0)):
        assert np.array_equal(heights(vrt(tmp_path / "m.vrt", source, relative)), expected)
    vrt(tmp_path / "tiles" / "inner.vrt", "b.tif")
    with pytest.raises(ReadError, match="is a VRT and may lead on"):
        heights(vrt(tmp_path / "m.vrt", "tiles/inner.vrt"))


@pytest.mark.parametrize("driver", ["AAIGrid", "SRTMHGT", "ENVI", "netCDF", "XYZ", "PNG", "GSAG"])
def test_a_mosaic_of_another_format(tmp_path: Path, driver: str) -> None:
    """As `gdalbuildvrt x.vrt *.hgt` makes it, in a folder whose name needs escapes."""
    folder = tmp_path / "a & b"
    expected, name = heights(dem(folder / "a.tif")), "N45E007.hgt"
    if driver == "SRTMHGT":
        large = np.random.default_rng(4).integers(0, 900, (1201, 1201))
        (folder / name).write_bytes(large.astype(">i2").tobytes())
        expected = large[:4, :6][::-1]
    else:
        name = "a.dat"
        options = {"driver": driver}
        with rasterio.open(folder / "a.tif") as file:
            whole = file.read(1).astype(np.uint8 if driver == "PNG" else np.float32)
        geotiff(folder / "a.tif", whole, side=1, corner=(0, 4))
        rasterio.shutil.copy(folder / "a.tif", folder / name, **options)
    path = vrt(folder / "m.vrt", name)
    text = path.read_text().replace(
        "</SourceBand>",
        '</SourceBand><SrcRect xOff="0" yOff="0" xSize="6" ySize="4"/>'
        '<DstRect xOff="0" yOff="0" xSize="6" ySize="4"/>',
    )
    path.write_text(text)
    assert np.array_equal(heights(path), expected)


def test_a_mosaic_has_the_guards_of_each_raster(tmp_path: Path) -> None:
    """What is refused alone is refused in a mosaic, and sizes are held against the sources."""
    dem(tmp_path / "a.tif")
    rasterio.shutil.copy(tmp_path / "a.tif", tmp_path / "a.asc", driver="AAIGrid")
    path = vrt(tmp_path / "m.vrt", "a.asc")
    assert heights(path).shape == (4, 6)
    path.write_text(path.read_text().replace('rasterXSize="6"', 'rasterXSize="900000000"'))
    with pytest.raises(ReadError, match="claims 900,000,000 × 4 pixels"):
        heights(path)
    vrt(tmp_path / "m.vrt", "a.asc")
    (tmp_path / "a.asc.msk").write_text("<VRTDataset/>")
    with pytest.raises(ReadError, match="is no TIFF, though GDAL takes it for a part"):
        heights(path)
    (tmp_path / "a.asc.msk").unlink()
    (tmp_path / "b.asc").write_text("ncols 9999\nnrows 99\nxllcorner 0\nyllcorner 0\n1 2\n")
    with pytest.raises(ReadError):
        heights(vrt(tmp_path / "m.vrt", "b.asc"))
    (tmp_path / "c.xyz").write_text("0 0 0\n1 0 1\n0 1 2\n")
    with pytest.raises(ReadError, match="a grid of points with gaps"):
        heights(vrt(tmp_path / "m.vrt", "c.xyz"))
    os.mkfifo(tmp_path / "p.asc")
    with pytest.raises(ReadError, match="is no regular file"):
        heights(vrt(tmp_path / "m.vrt", "p.asc"))


def test_a_source_is_opened_by_its_driver_alone(tmp_path: Path) -> None:
    """A raw raster has no sign of its own, so that another driver could take it for its file."""
    raw = b"<GDAL_WMS></GDAL_WMS>".ljust(2 * 1201**2, b"\0")
    (tmp_path / "N45E007.hgt").write_bytes(raw)
    path = vrt(tmp_path / "m.vrt", "N45E007.hgt")
    wanted = np.frombuffer(raw, ">i2").reshape(1201, 1201)
    found = heights(path)
    with rasterio.open("vrt://" + str(tmp_path / "N45E007.hgt") + "?if=SRTMHGT") as file:
        assert np.array_equal(file.read(1), wanted)
    assert np.isfinite(found).all()


def test_mosaics_of_files_elsewhere_are_asked_for(tmp_path: Path) -> None:
    outside = dem(tmp_path / "out.tif")
    path = vrt(tmp_path / "in" / "m.vrt", "../out.tif")
    with pytest.raises(ReadError) as caught:
        heights(path)
    assert "--allow-vrt" in caught.value.hint
    assert np.array_equal(heights(path, allow_vrt=True), heights(outside))
    with pytest.raises(ReadError, match="is no file on this machine"):
        heights(vrt(path, "http://127.0.0.1/a.tif", 0), allow_vrt=True)
    vrt(tmp_path / "in" / "inner.vrt", "../out.tif")
    with pytest.raises(ReadError, match="is a VRT and may lead on"):
        heights(vrt(path, "inner.vrt"), allow_vrt=True)


def test_our_own_mosaics_are_read(tmp_path: Path) -> None:
    from terratool.raster.grid import grid_over
    from terratool.raster.mosaic import export_mosaic

    terrain = terrain_of(SITE)
    export_mosaic(terrain, grid_over(terrain, 0.01, None), tmp_path / "m", tile_size=512)
    assert np.isfinite(heights(tmp_path / "m" / "mosaic.vrt")).any()


@pytest.mark.parametrize(
    ("source", "relative"),
    [("../out.tif", 1), ("/etc/hostname", 0), ("/vsicurl/http://127.0.0.1/a.tif", 0),
     ("http://127.0.0.1/a.tif", 0), ("wms.xml", 1), ("link.tif", 1), ("missing.tif", 1),
     ("m.vrt", 1), ("stac.json", 1)],
)  # fmt: skip
def test_mosaics_that_lead_elsewhere(tmp_path: Path, source: str, relative: int) -> None:
    outside = dem(tmp_path / "out.tif")
    folder = tmp_path / "in"
    path = vrt(folder / "m.vrt", source, relative)
    (folder / "wms.xml").write_text("<GDAL_WMS><Service/></GDAL_WMS>")
    (folder / "stac.json").write_text('{"stac_version": "1.0.0"}')
    (folder / "link.tif").symlink_to(outside)
    with pytest.raises(ReadError):
        heights(path)


@pytest.mark.parametrize(
    ("band", "more"),
    [
        (' subClass="VRTRawRasterBand"', ""),
        (' subClass="VRTDerivedRasterBand"', ""),
        ("", '<Metadata domain="GEOLOCATION"><MDI key="X_DATASET">/etc/x</MDI></Metadata>'),
        ("", '<!DOCTYPE a [<!ENTITY b "c">]>'),
        ("", "<sourcefilename>/etc/hostname</sourcefilename>"),
        (' subclass="VRTRawRasterBand"', ""),
        ("", "<subClass>VRTWarpedDataset</subClass>"),
        ("", "<MaskBand><VRTRasterBand dataType='Byte'/></MaskBand>"),
    ],
)
def test_mosaics_that_compute(tmp_path: Path, band: str, more: str) -> None:
    dem(tmp_path / "a.tif")
    with pytest.raises(ReadError):
        heights(vrt(tmp_path / "m.vrt", "a.tif", band=band, more=more))


def test_descriptions_in_disguise(tmp_path: Path) -> None:
    """GDAL looks for them behind other text, in archives, and beside a file."""
    secret = dem(tmp_path / "secret.tif")
    folder = tmp_path / "in"
    plain = vrt(folder / "plain.vrt", str(secret), 0).read_text("utf-8")
    (folder / "text.vrt").write_text("x " + plain)
    (folder / "space.vrt").write_text(" " * 600 + plain)
    with zipfile.ZipFile(folder / "z.zip", "w") as archive:
        archive.writestr("plain.vrt", plain)
    (folder / "g.vrt.gz").write_bytes(gzip.compress(plain.encode()))
    dem(folder / "a.tif")
    (folder / "a.tif.msk").write_text(plain)
    (folder / "b.bin").write_text("x <GDAL_WMTS></GDAL_WMTS>")
    vrt(folder / "wmts.vrt", "b.bin")
    for name in (
        folder / "text.vrt", folder / "space.vrt", f"/vsizip/{folder}/z.zip/plain.vrt",
        f"/vsizip/{folder}/z.zip", f"zip://{folder}/z.zip!plain.vrt", f"/vsigzip/{folder}/g.vrt.gz",
        f"file://{folder}/plain.vrt", f"file:{folder}/plain.vrt", folder / "a.tif",
        folder / "wmts.vrt", "https:/x/y.tif",
    ):  # fmt: skip
        with pytest.raises(ReadError):
            heights(name)


def test_labels_that_name_other_folders(tmp_path: Path) -> None:
    """A part of a raster lies beside it."""
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "a.img").write_bytes(np.arange(24, dtype="<f4").tobytes())
    label = (
        "PDS_VERSION_ID = PDS3\nRECORD_TYPE = FIXED_LENGTH\nRECORD_BYTES = 24\n"
        'FILE_RECORDS = 4\n^IMAGE = ("../raw/a.img",1)\nOBJECT = IMAGE\nLINES = 4\n'
        "LINE_SAMPLES = 6\nSAMPLE_TYPE = PC_REAL\nSAMPLE_BITS = 32\nEND_OBJECT = IMAGE\nEND\n"
    )
    path = tmp_path / "in" / "a.lbl"
    path.parent.mkdir()
    path.write_text(label)
    with pytest.raises(ReadError):
        heights(path)
    path.write_text(label.replace("../raw/", ""))
    (path.parent / "a.img").write_bytes((tmp_path / "raw" / "a.img").read_bytes())
    assert heights(path).max() == 23


@pytest.mark.parametrize(
    "text",
    ['<!DOCTYPE a [<!ENTITY b "c">]><PAMDataset><PAMRasterBand/></PAMDataset>', "<PAMDataset>", ""],
)
def test_names_of_classes_that_cannot_be_read(tmp_path: Path, text: str) -> None:
    with rasterio.open(
        tmp_path / "a.tif", "w", driver="GTiff", width=6, height=4, count=1, dtype="uint8",
        transform=Affine(1, 0, 0, 0, -1, 4),
    ) as file:  # fmt: skip
        file.write(np.ones((1, 4, 6), np.uint8))
    (tmp_path / "a.tif.aux.xml").write_text(text, encoding="utf-8")
    with (
        pytest.raises(ReadError, match=r"aux\.xml: cannot be read as XML") as caught,
        open_classes(str(tmp_path / "a.tif"), PixelGrid(0, 0, 1, 1, 6, 4)),
    ):
        pass
    assert "move it elsewhere" in caught.value.hint


GRIDS = 'GEOGCS["x",DATUM["y",SPHEROID["z",6378137,298],EXTENSION["PROJ4_GRIDS","{}"]]]'


@pytest.mark.parametrize("suffix", [".prj", ".tif.aux.xml"])
def test_reference_systems_that_name_files(tmp_path: Path, suffix: str) -> None:
    """A pipe in place of the grid would hang whoever opened it."""
    grid = tmp_path / "grid.gsb"
    os.mkfifo(grid)
    dem(tmp_path / "a.tif")
    text = GRIDS.format(grid)
    if suffix != ".prj":
        text = f"<PAMDataset><SRS>{escape(text)}</SRS></PAMDataset>"
    (tmp_path / f"a{suffix}").write_text(text)
    with pytest.raises(ReadError, match="names a file"):
        heights(tmp_path / "a.tif")


def test_reference_systems_within_a_raster(tmp_path: Path) -> None:
    """One that names a grid is left out, and nothing is reprojected by it."""
    path = tmp_path / "a.img"
    path.write_bytes(np.arange(24, dtype="<f4").tobytes())
    system = GRIDS.format("/a.gsb")[:-1] + ',PRIMEM["g",0],UNIT["degree",0.017453292519943295]]'
    path.with_suffix(".hdr").write_text(
        "ENVI\nsamples = 6\nlines = 4\nbands = 1\nheader offset = 0\ndata type = 4\n"
        "interleave = bsq\nbyte order = 0\nmap info = {Geographic Lat/Lon, 1, 1, 10, 50, 1, 1}\n"
        f"coordinate system string = {{{system}}}\n"
    )
    with open_source(str(path)) as source:
        assert source.grid.crs is None
        assert any("reads a file" in note for note in source.notes)
    with (
        pytest.raises(RequestError, match="reads a file"),
        open_source(str(path), SourceOptions(crs="EPSG:32632")),
    ):
        pass


def test_what_is_asked_for_is_allowed(tmp_path: Path) -> None:
    outside = dem(tmp_path / "out.tif")
    path = vrt(tmp_path / "in" / "m.vrt", "../out.tif")
    assert np.array_equal(heights(path, allow_remote=True), heights(outside))


WMS = """<GDAL_WMS><Service name="TMS">
<ServerUrl>{url}/${{z}}/${{x}}/${{y}}.tif</ServerUrl></Service>
<DataWindow><UpperLeftX>0</UpperLeftX><UpperLeftY>4</UpperLeftY><LowerRightX>6</LowerRightX>
<LowerRightY>0</LowerRightY><SizeX>6</SizeX><SizeY>4</SizeY></DataWindow>
<BandsCount>1</BandsCount><DataType>Float32</DataType></GDAL_WMS>"""


def test_nobody_is_asked(server: tuple[str, list[str]], tmp_path: Path) -> None:
    """Names, descriptions and sidecars: nothing of a stranger's has a command talk."""
    url, asked = server
    (tmp_path / "wms.tif").write_text(WMS.format(url=url))
    dem(tmp_path / "a.tif")
    (tmp_path / "a.tif.aux.xml").write_text(
        "<PAMDataset><PAMRasterBand band='1'><Metadata domain='OVERVIEWS'>"
        f"<MDI key='OVERVIEW_FILE'>/vsicurl/{url}/o.tif</MDI></Metadata></PAMRasterBand>"
        f"<Metadata domain='OVERVIEWS'><MDI key='OVERVIEW_FILE'>/vsicurl/{url}/o.tif</MDI>"
        "</Metadata></PAMDataset>"
    )
    vrt(tmp_path / "m.vrt", f"/vsicurl/{url}/a.tif", 0)
    for name in (f"{url}/a.tif", f"/vsicurl/{url}/a.tif", *map(str, sorted(tmp_path.iterdir()))):
        call("import-terrain", name, tmp_path / "out.json", "--max-error", 1, "--overwrite")
        call("import-terrain", tmp_path / "a.tif", tmp_path / "out.json", "--max-error", 1,
             "--surfaces", name, "--overwrite")  # fmt: skip
    assert asked == []


def test_the_list_of_drivers_is_known_to_gdal() -> None:
    """Those that this build has; none of them fetches anything."""
    with rasterio.Env() as env:
        there = set(env.drivers())
    assert {"GTiff", "AAIGrid", "netCDF"} <= there & set(DRIVERS)
    assert not {"WMS", "WCS", "WMTS", "HTTP", "STACIT", "STACTA", "OGCAPI", "PLMosaic", "EEDAI",
                "DAAS", "MRF", "KMLSUPEROVERLAY", "DERIVED", "MEM"} & set(DRIVERS)  # fmt: skip
