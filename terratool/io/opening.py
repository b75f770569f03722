"""Opening of rasters by GDAL, restricted to local files of known formats."""

from __future__ import annotations

import contextlib
import os
import re
import sys
import warnings
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import tostring
from xml.parsers.expat import ExpatError

import rasterio
from affine import AffineError
from rasterio._err import CPLE_BaseError, CPLE_OutOfMemoryError
from rasterio._path import _parse_path
from rasterio.errors import (
    NodataShadowWarning,
    NotGeoreferencedWarning,
    RasterioError,
    WarpOperationError,
)
from rasterio.io import DatasetReader
from rasterio.windows import Window

from terratool.definition.crs import names_file
from terratool.errors import ReadError, TerratoolError, interruption
from terratool.io.expat import EntityError, tree_of
from terratool.io.guards import (
    UNPACK,
    is_netcdf,
    on_disk,
    probe,
    refuse_claims,
    refuse_surfer_claims,
)
from terratool.io.xyz import XyzLayout, as_raster, layout_of, made_of_points
from terratool.report.wording import count_of
from terratool.text.files import is_regular, open_file

DRIVERS = (
    "AAIGrid", "BMP", "BT", "DTED", "EHdr", "ENVI", "GIF", "GPKG", "GS7BG", "GSAG", "GSBG",
    "GTiff", "HF2", "HFA", "ISIS3", "JP2OpenJPEG", "JPEG", "LCP", "netCDF", "NWT_GRD", "PDS",
    "PDS4", "PNG", "PNM", "ROI_PAC", "RST", "SAGA", "SDTS", "SGI", "SIGDEM", "SRTMHGT", "Terragen",
    "USGSDEM", "VICAR", "WEBP", "XYZ", "ZMap",
)  # fmt: skip
"""GDAL drivers that read a raster from its own files; a VRT is checked and opened separately."""

_LISTED = "AAIGrid"
"""Driver whose rows are read once in order, so that the first missing one raises: GDAL seeks a row
by all before it, and repeats that for each missing row."""
_GRIDDED = "XYZ"
"""Driver that reads texts of points in archives and VRTs; it has no nodata for bytes from 0."""
_TIFFS = "GTiff"
_PROBED = "netCDF"
_PLAIN_DRIVERS = tuple(driver for driver in DRIVERS if driver != _PROBED)
_NETCDFS = (".nc", ".nc4", ".cdf")

_NOT_ARCHIVED = ("GSAG", "ISIS3", "PDS", "PDS4")
"""Drivers refused in archives, where the claims and links of their headers are not checked."""
_LOCAL = frozenset(["file", "gz", "gzip", "tar", "zip"])
_ARCHIVES = ("vsizip/", "vsitar/", "vsigzip/", "vsi7z/", "vsirar/")
_SIDECARS = (".msk", ".MSK", ".ovr", ".OVR")

_archived = re.compile(r"(zip|tar)(?:\+file)?://([^!]+)!/?(.+)", re.IGNORECASE).fullmatch
_scheme = re.compile(r"([a-z0-9.+-]+)://", re.IGNORECASE).match
_address = re.compile(r"(?:https?|ftp|s3|gs|az|adls?|oss|swift|hdfs|dap):/", re.IGNORECASE).search
_virtual = re.compile(r"(?<=[/{])vsi[a-z0-9_]+[/?]", re.IGNORECASE).findall

_ZIP, _GZIP, _TAR = b"PK\3\4", b"\x1f\x8b", b"ustar"
_SIDECAR_ENDINGS = (
    ".att", ".eph", ".hdr", ".imd", ".prj", ".pvl", ".rpb", ".rpc", ".til", ".txt", ".xml",
)  # fmt: skip
"""Endings of sidecar files that GDAL reads whatever their stem."""
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_described = re.compile(rb"<\s*(?:VRTDataset|GDAL_|WM|WCS|Capabilities|OGR)", re.IGNORECASE).search

_label = re.compile(
    rb"PDS_VERSION_ID|ODL_VERSION_ID|IsisCube|Product_Observational", re.IGNORECASE
).search
_comments = re.compile(rb"/\*.*?\*/", re.DOTALL)
_pointers = re.compile(
    rb"""\^[\w:]+[\s=({]*("[^"]*"|'[^']*'|[^\s,)}]*)|<(?:\w+:)?file_name\b[^>]*>([^<]*)"""
).findall
"""Find the files that a label of PDS, ISIS or PDS4 names, which may hold the pixels."""

_HEAD = 1 << 14
"""Bytes read to tell a file's format; GDAL's drivers look at fewer."""
_PIECE = 1 << 24
_MAX_VRT = 256 << 20
_MAX_LABEL = 16 << 20

_PLAIN: dict[str, frozenset[str]] = {
    "VRTDataset": frozenset(["rasterXSize", "rasterYSize"]),
    "SRS": frozenset(["dataAxisToSRSAxisMapping", "coordinateEpoch"]),
    "GeoTransform": frozenset(),
    "Metadata": frozenset(["domain"]),
    "MDI": frozenset(["key"]),
    "OverviewList": frozenset(["resampling"]),
    "VRTRasterBand": frozenset(["dataType", "band", "blockXSize", "blockYSize"]),
    **dict.fromkeys(
        ["Description", "UnitType", "Offset", "Scale", "NoDataValue", "HideNoDataValue",
         "ColorInterp", "ColorTable", "CategoryNames", "Category", "SimpleSource", "ComplexSource",
         "SourceBand", "NODATA", "F", "Name", "Type", "Usage", "Histograms", "HistItem",
         "HistMin", "HistMax", "BucketCount", "IncludeOutOfRange", "Approximate", "HistCounts"],
        frozenset(),
    ),
    "Entry": frozenset(["c1", "c2", "c3", "c4"]),
    "GDALRasterAttributeTable": frozenset(["tableType", "Row0Min", "BinSize"]),
    "FieldDefn": frozenset(["index"]),
    "Row": frozenset(["index"]),
    "SourceFilename": frozenset(["relativeToVRT", "shared"]),
    "SourceProperties": frozenset(
        ["RasterXSize", "RasterYSize", "DataType", "BlockXSize", "BlockYSize"]
    ),
    "SrcRect": frozenset(["xOff", "yOff", "xSize", "ySize"]),
    "DstRect": frozenset(["xOff", "yOff", "xSize", "ySize"]),
}  # fmt: skip
"""Elements allowed in a VRT, and the attributes of each; GDAL knows more, in any case."""
_DOMAINS = (None, "", "IMAGE_STRUCTURE")


@contextlib.contextmanager
def open_local(
    name: str,
    *,
    allow_remote: bool,
    allow_vrt: bool = False,
    overview: int | None = None,
    **environment: Any,
) -> Iterator[Any]:
    """Open a raster by rasterio for the block, after checks of its files and its size.

    Args:
        name: path, or another name that GDAL opens.
        allow_remote: whether the raster may lie on a network or refer to remote files.
        allow_vrt: whether a VRT may be a mosaic of files out of its folder, on this machine.
        overview: index of the overview to open in place of the raster, from 0.
        environment: GDAL configuration options.

    Raises:
        ReadError: the raster cannot be opened, or refers to files that are not allowed.
    """
    drivers = None
    place = _place(name)
    whole = on_disk(place)
    if whole is not None:
        _refuse_special(whole)
    environment["CPL_VSIL_GZIP_WRITE_PROPERTIES"] = "NO"
    # with several threads GDAL only prints errors of JPEG 2000 tiles, and reads on
    environment["GDAL_NUM_THREADS"] = "1"
    if not allow_remote:
        place, drivers = _drivers_for(name, place, allow_vrt)
        environment |= {"CPL_VSIL_CURL_ALLOWED_FILENAME": "-", "GDAL_VRT_ENABLE_PYTHON": "NO"}
        if on_disk(name) is None:  # no plain file: sidecar files are not looked for
            environment["GDAL_DISABLE_READDIR_ON_OPEN"] = "EMPTY_DIR"
    with (
        warnings.catch_warnings(), _no_decoding_tracebacks(), rasterio.Env(**environment),
        contextlib.ExitStack() as stack,
    ):  # fmt: skip
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        warnings.simplefilter("ignore", NodataShadowWarning)
        with gdal_errors(name):
            text = _points_of(name)
            if text is not None:
                place, drivers = str(stack.enter_context(as_raster(Path(name), text))), [_TIFFS]
            # rasterio.open accepts only one driver
            level = {} if overview is None else {"overview_level": overview}
            file = stack.enter_context(DatasetReader(_parse_path(place), driver=drivers, **level))
            # GDAL opens the file that this domain names, wherever it lies, to list files
            if not allow_remote and file.tags(ns="OVERVIEWS"):
                raise ReadError(
                    f"{name}: says that its overviews are another file.",
                    "Make a GeoTIFF of it with gdal_translate, or add --allow-remote.",
                )
            anywhere = allow_remote or allow_vrt or text is not None
            files = [] if anywhere else file.files
        _refuse_files(name, files)
        with gdal_errors(name):
            refuse_claims(name, file, placed=overview is None)
            if file.driver == _GRIDDED and file.nodata is None and file.dtypes[0] == "uint8":
                raise ReadError(f"{name}: may lack points, which GDAL reads as 0.", UNPACK)
            if file.driver == _LISTED:
                file.read(1, window=Window(0, 0, 1, file.height))
        yield file


def _points_of(name: str) -> XyzLayout | None:
    """Layout of a text of points on this machine; None for any other raster."""
    return layout_of(Path(name)) if is_regular(name) else None


def refuse_band(
    name: str,
    dtypes: Sequence[str],
    band: int,
    missing: type[TerratoolError] = ReadError,
    what: str = "heights",
) -> None:
    """Refuse a band that a raster does not have, or that holds no real numbers.

    Args:
        name: name of the raster, for messages.
        dtypes: types of the numbers of its bands.
        band: number of the band, from 1.
        missing: error for a band that the raster does not have.
        what: what the numbers of the band are to be.

    Raises:
        TerratoolError: the raster does not have the band; the one that `missing` names.
        ReadError: the band holds complex numbers.
    """
    if not 1 <= band <= len(dtypes):
        raise missing(
            f"{name}: has {count_of(len(dtypes), 'band')}, and no band {band}.",
            "Name a band that is there, counted from 1." if dtypes else "Name a raster.",
        )
    if "complex" in dtypes[band - 1]:
        raise ReadError(
            f"{name}: holds complex numbers in band {band}, not {what}.",
            "Name a band of real numbers.",
        )


@contextlib.contextmanager
def gdal_errors(name: str) -> Iterator[None]:
    """Turn errors of GDAL, rasterio and affine in the block into a ReadError.

    Raises:
        ReadError: the raster cannot be read, or memory ran out.
    """
    try:
        yield
    except (
        RasterioError, CPLE_BaseError, WarpOperationError, OSError, ValueError, RuntimeError,
        AffineError, MemoryError, SystemError,
    ) as error:  # fmt: skip
        stopped = interruption(error)
        if stopped is not None:
            raise stopped from None
        if isinstance(error, MemoryError) or isinstance(error.__cause__, CPLE_OutOfMemoryError):
            raise ReadError(
                f"{name}: does not fit into memory.",
                "Take a part of it with --bounds, or close other programs.",
            ) from error
        if isinstance(error, (ValueError, RuntimeError)) and not _of_gdal(error):
            raise
        reason = str(error.__cause__ or error).strip().rstrip(".")
        reason = reason.removeprefix(f"{name}: ").removeprefix(f"'{name}' ")
        raise ReadError(
            f"{name}: cannot be read as a raster ({reason or type(error).__name__}).",
            _way_out(name, reason),
        ) from error


def _of_gdal(error: BaseException) -> bool:
    """Return whether an error is defined, or was raised, in rasterio or affine."""
    modules = [type(error).__module__]
    trace = error.__traceback__
    while trace is not None:
        modules.append(trace.tb_frame.f_globals.get("__name__", ""))
        trace = trace.tb_next
    return any(module.partition(".")[0] in ("rasterio", "affine") for module in modules)


def _way_out(name: str, reason: str) -> str:
    """Hint for a raster that cannot be read."""
    scheme = _scheme(name)
    if name.startswith("/vsi") or (scheme and scheme[1].lower() in ("gzip", "tar", "zip")):
        return f"Check the name within the archive. {UNPACK}"
    with contextlib.suppress(OSError, ValueError), open_file(name) as file:
        head = file.read(_HEAD)
        if not head:
            return "The file is empty: fetch it again."
        if head.startswith(_ZIP):
            return f"Name the raster in the archive, as in zip://{name}!dem.tif."
        if head[257:262] == _TAR:
            return f"Name the raster in the archive, as in tar://{name}!dem.tif."
        if head.startswith(_GZIP) and name.lower().endswith((".tgz", ".tar.gz")):
            return f"Name the raster in the archive, as in tar://{name}!dem.tif."
        if head.startswith(_GZIP):
            return f"Unpack it, or name what is in it: /vsigzip/{name}."
    if "not recognized" in reason:
        return (
            "Make a GeoTIFF of it with gdal_translate; docs/import-rasters.md lists the formats "
            "that are read."
        )
    return "Check the path, and the file with gdalinfo -checksum."


@contextlib.contextmanager
def _no_decoding_tracebacks() -> Iterator[None]:
    """Suppress tracebacks that rasterio prints for GDAL messages that are no UTF-8.

    They reach either `sys.unraisablehook` or `sys.excepthook`.
    """
    unraisable, uncaught = sys.unraisablehook, sys.excepthook

    def on_unraisable(found: Any) -> None:
        if not isinstance(found.exc_value, UnicodeDecodeError):
            unraisable(found)

    def on_uncaught(kind: Any, error: BaseException, trace: Any) -> None:
        if not isinstance(error, UnicodeDecodeError):
            uncaught(kind, error, trace)

    sys.unraisablehook, sys.excepthook = on_unraisable, on_uncaught
    try:
        yield
    finally:
        sys.unraisablehook, sys.excepthook = unraisable, uncaught


def refuse_remote(name: str) -> None:
    """Refuse a name that is a network address, or uses a network file system of GDAL.

    Raises:
        ReadError: the name is remote, or inline XML or JSON.
    """
    scheme = _scheme(name)
    remote = scheme is not None and not _LOCAL.issuperset(scheme[1].lower().split("+"))
    if remote or _address(name) or any(part not in _ARCHIVES for part in _virtual(name)):
        raise ReadError(
            f"{name}: is no file on this machine.", "Fetch it first, or add --allow-remote."
        )
    if name.lstrip().startswith(("<", "{")):
        raise ReadError(f"{name[:40]}: is no name of a file.", "Name a raster or a mesh.")


def _place(name: str) -> str:
    """GDAL's name of a raster: zip:// and tar:// addresses become /vsizip/ and /vsitar/."""
    found = _archived(name)
    return f"/vsi{found[1].lower()}/{{{found[2]}}}/{found[3]}" if found else name


def _drivers_for(name: str, place: str, allow_vrt: bool) -> tuple[str, list[str]]:
    """Name of a raster for GDAL, and the drivers that may open it.

    Args:
        name: name as given.
        place: name as passed to GDAL, from `_place`.
        allow_vrt: whether a VRT may be a mosaic of files out of its folder.

    Raises:
        ReadError: the raster is remote, or refers to files outside its folder.
    """
    refuse_remote(name)
    refuse_remote(place)
    path = Path(name)
    try:
        if not path.is_file():
            return place, _drivers_within(place)
        _refuse_pipes((path,))
        _refuse_sidecars(path)
        _refuse_grids(path)
        with open_file(path) as file:
            head = file.read(_HEAD)
            if _label(head):
                _refuse_pointers(path, head + file.read(_MAX_LABEL))
                file.seek(len(head))
            if not _is_vrt(head):
                return place, _drivers_by_head(name, head)
            text = head + file.read(_MAX_VRT)
    except (OSError, ValueError):
        return place, list(_PLAIN_DRIVERS)  # GDAL raises the error
    return _mosaic(path, text, allow_vrt) or place, ["VRT"]


def _drivers_by_head(name: str, head: bytes) -> list[str]:
    """Drivers that may open a file, by its first bytes."""
    refuse_surfer_claims(name, head)
    if not is_netcdf(head):
        return list(_PLAIN_DRIVERS)
    probe(name)
    return [_PROBED]


def _drivers_within(name: str) -> list[str]:
    """Drivers that may open a member of an archive or a variable of a netCDF.

    Drivers of labels are left out: the files that a label names cannot be checked in an archive.
    """
    packed = name.startswith("/vsi")
    if not name.upper().startswith("NETCDF:") and not (packed and name.lower().endswith(_NETCDFS)):
        return [driver for driver in _PLAIN_DRIVERS if driver not in _NOT_ARCHIVED]
    probe(name)
    return [_PROBED]


def _refuse_pointers(path: Path, label: bytes) -> None:
    """Refuse a label whose pixels may lie outside its folder: GDAL opens the files it names.

    Raises:
        ReadError: the label names a file by a path, or by markup.
    """
    for parts in _pointers(_comments.sub(b" ", label)):
        named = b"".join(parts)
        if any(sign in named for sign in (b"/", b"\\", b"&", b"<")):
            raise ReadError(
                f"{path}: is a label that names {named.decode('utf-8', 'replace')[:60]!r}, which "
                "may lie out of its folder.",
                "Make a GeoTIFF of it with gdal_translate, or add --allow-remote.",
            )


def _refuse_special(path: Path) -> None:
    """Refuse a pipe or a device, on which GDAL would block.

    Raises:
        ReadError: the path is no regular file.
    """
    if not is_regular(path):
        raise ReadError(f"{path}: is no regular file.", "Copy what it gives into a file.")


def _refuse_pipes(rasters: Collection[Path]) -> None:
    """Refuse pipes and devices beside rasters that GDAL may open as parts of these.

    GDAL opens sidecar files by name, and in some formats files that the raster names.

    Raises:
        ReadError: a folder holds such a pipe or device, or cannot be listed.
    """
    stems: dict[Path, set[str]] = {}
    for path in rasters:
        stems.setdefault(path.parent, set()).add(path.stem.casefold())
    for folder, known in stems.items():
        try:
            with os.scandir(folder) as entries:
                others = [entry for entry in entries if not (entry.is_file() or entry.is_dir())]
        except OSError as error:
            raise ReadError.of(folder, error) from error
        special = [Path(entry.path) for entry in others if Path(entry.path).exists()]
        for path in special:
            name = path.name.casefold()
            if name.endswith(_SIDECAR_ENDINGS) or any(map(name.startswith, known)):
                _refuse_special(path)
        if special:
            for raster in (path for path in rasters if path.parent == folder):
                _refuse_named(raster, special)


def _refuse_named(raster: Path, special: list[Path]) -> None:
    """Refuse pipes and devices whose names occur in the bytes of a raster, in any case.

    Raises:
        ReadError: the raster names one of them.
    """
    names = {os.fsencode(path.name).lower(): path for path in special}
    longest, before = max(map(len, names)), b""
    with open_file(raster) as file:
        while piece := file.read(_PIECE):
            text = before + piece.lower()
            for name, path in names.items():
                if name in text:
                    _refuse_special(path)
            before = text[-longest:]


def _refuse_sidecars(path: Path) -> None:
    """Refuse mask and overview sidecars that are no TIFF: GDAL opens them by any driver."""
    for suffix in _SIDECARS:
        sidecar = path.with_name(path.name + suffix)
        if sidecar.exists() and not _is_tiff(sidecar):
            raise ReadError(
                f"{sidecar}: is no TIFF, though GDAL takes it for a part of {path.name}.",
                "Remove it, or add --allow-remote.",
            )


def _refuse_grids(path: Path) -> None:
    """Refuse a sidecar whose reference system names grid files: PROJ would open these."""
    for beside in (
        path.with_name(path.name + ".aux.xml"), path.with_suffix(".aux.xml"),
        path.with_suffix(".prj"), path.with_suffix(".PRJ"), path.with_suffix(".qpj"),
    ):  # fmt: skip
        if not beside.is_file():
            continue
        with open_file(beside) as file:
            text = file.read().decode("utf-8", "replace")
        if names_file(text):
            raise ReadError(
                f"{beside}: has a reference system that names a file.",
                "Take that out of it, or add --allow-remote.",
            )


def _is_tiff(path: Path) -> bool:
    """Return whether a file is a TIFF that no other driver takes for an XML description."""
    try:
        with open_file(path) as file:
            head = file.read(_HEAD)
    except OSError:
        return False
    return head.startswith(_TIFF) and not _described(head)


def _is_vrt(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a VRT."""
    return head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<VRTDataset")


def _mosaic(path: Path, text: bytes, allow_vrt: bool) -> str:
    """Check a VRT, which is a plain mosaic of rasters in its own folder or below.

    Each raster is refused for what it would be refused for alone. GDAL would open it by any
    driver, so that one that is no TIFF gets the driver that opened it here.

    Args:
        path: path of the VRT.
        text: its bytes.
        allow_vrt: whether the rasters may lie elsewhere on this machine.

    Returns:
        The VRT with the driver of each raster; empty where all of them are TIFFs.

    Raises:
        ReadError: the VRT is too large, no plain XML, has other elements or attributes, or names a
            source that is no such raster.
    """
    hint = "Make a GeoTIFF of it with gdal_translate, or add --allow-remote."
    if len(text) > _MAX_VRT:
        raise ReadError(f"{path}: is a VRT that is too large.", hint)
    try:
        root = tree_of(text)
    except (ExpatError, EntityError) as error:
        raise ReadError(f"{path}: is no plain XML ({error}).", hint) from error
    for element in root.iter():
        known = _PLAIN.get(element.tag)
        plain = known is not None and known.issuperset(element.attrib)
        if not plain or element.get("domain") not in _DOMAINS:
            raise ReadError(
                f"{path}: is more than a plain mosaic: it has {element.tag[:40]!r} with "
                f"{', '.join(element.attrib)[:60] or 'no attributes'}.",
                hint,
            )
    folder = path.resolve().parent
    drivers: dict[Path, str] = {}
    for element in root.iter("SourceFilename"):
        name = (element.text or "").strip()
        source = folder / name if element.get("relativeToVRT") == "1" else Path(name)
        if source not in drivers:
            refuse_remote(name)
            inside = source.is_absolute() and source.resolve().is_relative_to(folder)
            if not inside and not (allow_vrt and source.is_absolute()):
                raise ReadError(
                    f"{path}: names {name[:60]!r}, which lies out of its folder.",
                    "Copy it there, or add --allow-vrt."
                    if source.is_absolute()
                    else "Make it anew in its own folder, or of rasters with full paths.",
                )
            drivers[source] = _driver_of(path, source, name[:60])
        element.text, element.attrib = f"{source}", {"relativeToVRT": "0"}
        if drivers[source] != _TIFFS:
            element.text = f"vrt://{source}?if={drivers[source]}"
    _refuse_pipes(drivers)
    return "" if set(drivers.values()) <= {_TIFFS} else tostring(root, "unicode")


def _driver_of(path: Path, source: Path, name: str) -> str:
    """Return the driver that opens a source of a VRT, after all checks of it.

    Args:
        path: path of the VRT.
        source: path of the source.
        name: name of the source in the VRT, for messages.

    Raises:
        ReadError: the source is a VRT itself, no raster, or a text of a grid with gaps.
    """
    hint = "Make a GeoTIFF of that with gdal_translate, and name it."
    if not source.is_file():
        raise ReadError(f"{path}: names {name!r}, which is no file.", "Copy it there.")
    if _is_tiff(source):
        _refuse_sidecars(source)
        return _TIFFS
    with open_file(source) as file:
        if _is_vrt(file.read(_HEAD)):
            raise ReadError(f"{path}: names {name!r}, which is a VRT and may lead on.", hint)
    if "?" in str(source):
        raise ReadError(f"{path}: names {name!r}, which has a question mark.", "Rename it.")
    with open_local(str(source), allow_remote=False) as raster:
        if not made_of_points(raster):
            return str(raster.driver)
        for _, window in raster.block_windows(1):
            if not raster.read_masks(1, window=window).all():
                raise ReadError(f"{path}: names {name!r}, a grid of points with gaps.", hint)
    return _GRIDDED


def _refuse_files(name: str, files: list[str]) -> None:
    """Refuse a raster with parts outside its folder, which labels may name.

    Raises:
        ReadError: a file of the dataset lies elsewhere.
    """
    path = Path(name)
    if not path.is_file():
        return
    folders = {path.parent.resolve(), path.resolve().parent}
    for file in files:
        inside = any(Path(file).resolve().is_relative_to(folder) for folder in folders)
        if Path(file).exists() and not inside:
            raise ReadError(
                f"{name}: has a part outside of its folder, {file}.",
                "Copy it there, or add --allow-remote.",
            )
