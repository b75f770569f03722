"""What GDAL may open: local rasters of known formats, and nothing that leads elsewhere."""

from __future__ import annotations

import contextlib
import re
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import rasterio
from rasterio._err import CPLE_BaseError
from rasterio._path import _parse_path
from rasterio.errors import NotGeoreferencedWarning, RasterioError, WarpOperationError
from rasterio.io import DatasetReader

from terratool.errors import ReadError

DRIVERS = (
    "AAIGrid", "AIG", "BIGGIF", "BMP", "BT", "CTG", "DTED", "EHdr", "ENVI", "ERS", "GIF", "GPKG",
    "GRIB", "GS7BG", "GSAG", "GSBG", "GTiff", "HDF5", "HDF5Image", "HF2", "HFA", "ISCE", "ISIS2",
    "ISIS3", "JP2OpenJPEG", "JPEG", "LCP", "Leveller", "NDF", "netCDF", "NITF", "NWT_GRD", "PAux",
    "PCIDSK", "PDS", "PDS4", "PNG", "PNM", "ROI_PAC", "RRASTER", "RST", "SAGA", "SDTS", "SGI",
    "SIGDEM", "SNODAS", "SRTMHGT", "Terragen", "USGSDEM", "VICAR", "VRT", "WEBP", "XYZ", "Zarr",
    "ZMap",
)  # fmt: skip
"""Of GDAL: those that read a raster from its own files, without the net or code in the file."""

_LOCAL = frozenset(["file", "gz", "gzip", "tar", "zip"])
_ARCHIVES = ("vsizip/", "vsitar/", "vsigzip/", "vsi7z/", "vsirar/")

_scheme = re.compile(r"([a-z0-9.+-]+)://", re.IGNORECASE).match
_address = re.compile(r"(?:https?|ftp|s3|gs|az|adls?|oss|swift|hdfs|dap)://", re.IGNORECASE).search
_virtual = re.compile(r"(?<=/)vsi[a-z0-9_]+[/?]").findall

_entities = re.compile(rb"<!(?:DOCTYPE|ENTITY)", re.IGNORECASE).search

_MAX_VRT = 256 << 20
_MAX_NESTING = 8
_HEAD = 512


@contextlib.contextmanager
def open_local(name: str, *, allow_remote: bool, **environment: Any) -> Iterator[Any]:
    """A raster as rasterio opens it.

    Args:
        name: a path, or whatever else GDAL opens.
        allow_remote: whether it may lie on the net, or lead there.
        environment: settings of GDAL.

    Raises:
        ReadError: it cannot be opened, or leads where it may not.
    """
    drivers = None
    if not allow_remote:
        refuse_remote(name)
        refuse_leading(name)
        drivers = list(DRIVERS)
        # even what a sidecar file names is not fetched
        environment |= {"CPL_VSIL_CURL_ALLOWED_FILENAME": "-", "GDAL_VRT_ENABLE_PYTHON": "NO"}
    with (
        warnings.catch_warnings(), _unreadable_complaints(), rasterio.Env(**environment),
        contextlib.ExitStack() as stack,
    ):  # fmt: skip
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with gdal_errors(name):
            # rasterio.open takes one driver, this several
            file = stack.enter_context(DatasetReader(_parse_path(name), driver=drivers))
        yield file


@contextlib.contextmanager
def gdal_errors(name: str) -> Iterator[None]:
    """GDAL's errors as ours.

    Raises:
        ReadError: GDAL, or rasterio, raised what it raises for files that it cannot read.
    """
    try:
        yield
    except (RasterioError, CPLE_BaseError, WarpOperationError, OSError, ValueError) as error:
        reason = str(error.__cause__ or error).strip().rstrip(".")
        reason = reason.removeprefix(f"{name}: ").removeprefix(f"'{name}' ")
        raise ReadError(
            f"{name}: cannot be read as a raster ({reason or type(error).__name__}).",
            "Check the path, and the file with gdalinfo -checksum.",
        ) from error


@contextlib.contextmanager
def _unreadable_complaints() -> Iterator[None]:
    """Keep quiet about messages of GDAL that are no UTF-8, of which rasterio makes a traceback."""
    before = sys.unraisablehook

    def hook(unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, UnicodeDecodeError):
            before(unraisable)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before


def refuse_remote(name: str) -> None:
    """Refuse a name that is an address, or a file system of GDAL that leads to the net.

    Raises:
        ReadError: it is.
    """
    scheme = _scheme(name)
    remote = scheme is not None and not _LOCAL.issuperset(scheme[1].lower().split("+"))
    if remote or _address(name) or any(part not in _ARCHIVES for part in _virtual(name)):
        raise ReadError(
            f"{name}: does not lie on this machine.",
            "Fetch the file first, or add --allow-remote.",
        )
    if name.lstrip().startswith(("<", "{")):
        raise ReadError(f"{name[:40]}: is no name of a file.", "Name a raster or a mesh.")


def refuse_leading(name: str, folder: Path | None = None, nesting: int = 0) -> None:
    """Refuse a file that leads out of its folder: a VRT by its sources, others by their nature.

    Args:
        name: a path; what is not there, or is no path, is left to GDAL.
        folder: what it must lie in, if not any.
        nesting: how many VRTs lead there.

    Raises:
        ReadError: it does.
    """
    path = Path(name)
    try:
        if not path.is_file():
            if folder is None:
                return
            raise ReadError(f"{name}: is no file.", "Look at what the VRT names.")
        if folder is not None and not path.resolve().is_relative_to(folder):
            raise ReadError(
                f"{name}: lies outside of the folder of the VRT that names it.",
                "Copy it there, or make one file of all with gdal_translate.",
            )
        with open(path, "rb") as file:
            head = file.read(_HEAD).removeprefix(b"\xef\xbb\xbf").lstrip()
            text = file.read(_MAX_VRT) if head.startswith(b"<VRTDataset") else b""
    except (OSError, ValueError):
        return  # GDAL says what is wrong
    if head.startswith(b"<VRTDataset"):
        _refuse_sources(path, head + text, nesting)
    elif head.startswith((b"<", b"{")):
        raise ReadError(
            f"{name}: is a description of a raster that lies elsewhere, or no raster at all.",
            "Name the raster itself, or add --allow-remote.",
        )


def _refuse_sources(path: Path, text: bytes, nesting: int) -> None:
    """Refuse a VRT of another kind than a plain mosaic, or with sources out of its folder."""
    hint = "Make a GeoTIFF of it with gdal_translate, or add --allow-remote."
    if nesting >= _MAX_NESTING or len(text) > _MAX_VRT or _entities(text):
        raise ReadError(f"{path}: is a VRT that is too large or too deep, or has entities.", hint)
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ReadError(f"{path}: is no XML ({error}).", hint) from error
    kinds = {element.get("subClass", "VRTSourcedRasterBand") for element in root.iter()}
    domains = {element.get("domain") for element in root.iter("Metadata")}
    if kinds != {"VRTSourcedRasterBand"} or "GEOLOCATION" in domains:
        raise ReadError(f"{path}: is a VRT that computes, and no plain mosaic.", hint)
    folder = path.resolve().parent
    seen = set()
    for element in root.iter("SourceFilename"):
        source = (element.text or "").strip()
        whole = str(folder / source) if element.get("relativeToVRT") == "1" else source
        if whole in seen:
            continue
        seen.add(whole)
        refuse_remote(whole)
        refuse_leading(whole, folder, nesting + 1)
