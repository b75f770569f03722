"""File formats of scans by suffix."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from terratool.errors import RequestError
from terratool.extras import install_command
from terratool.report.wording import listed
from terratool.sensing.formats.common import Record
from terratool.sensing.formats.images import BESIDE, write_png, write_tiff
from terratool.sensing.formats.points import write_csv, write_las, write_npz, write_pcd, write_ply
from terratool.sensing.formats.rosbag import write_bag
from terratool.sensing.readings import Frame


@dataclass(frozen=True, slots=True)
class ScanFormat:
    """A file format.

    Attributes:
        write: puts frames into a file, or into a folder.
        companions: suffixes of files that it puts beside.
        images: whether it holds images, which cameras alone make.
        folder: whether it is a folder.
        misses: whether it can hold rays without a reading; images and bags always do.
        axes: whether points can be in either's axes, the world's or the sensor's.
        module, package, extra: what has to be installed for it, as it is imported, as it is called,
            and the extra of terratool that has it; empty for nothing.
    """

    write: Callable[[Path, Iterator[Frame], Record], None]
    companions: tuple[str, ...] = ()
    images: bool = False
    folder: bool = False
    misses: bool = True
    axes: bool = True
    module: str = ""
    package: str = ""
    extra: str = ""


_LAS = ScanFormat(write_las, misses=False, module="laspy", package="laspy", extra="las")
_LAZ = ScanFormat(write_las, misses=False, module="lazrs", package="laspy and lazrs", extra="las")
_TIFF = ScanFormat(write_tiff, companions=(BESIDE,), images=True, axes=False)

FORMATS = {
    ".ply": ScanFormat(write_ply),
    ".pcd": ScanFormat(write_pcd),
    ".las": _LAS,
    ".laz": _LAZ,
    ".npz": ScanFormat(write_npz),
    ".csv": ScanFormat(write_csv),
    ".png": ScanFormat(write_png, companions=(BESIDE,), images=True, axes=False),
    ".tif": _TIFF,
    ".tiff": _TIFF,
    ".rosbag2": ScanFormat(
        write_bag, folder=True, axes=False, module="rosbags", package="rosbags", extra="ros"
    ),
}
"""By suffix."""


def format_of(path: Path) -> ScanFormat:
    """The format that a name asks for.

    Raises:
        RequestError: there is none, or what it needs is not installed.
    """
    suffix = path.suffix.lower()
    form = FORMATS.get(suffix)
    if form is None:
        what = f"ends with {suffix}" if suffix else "has no suffix"
        raise RequestError(
            f"{path}: {what}, which says no format.",
            f"Let it end with one of {listed([*FORMATS])}; .rosbag2 is a folder, a bag of ROS 2.",
        )
    if form.module and (find_spec(form.module) is None or (suffix == ".laz" and not _has_laspy())):
        raise RequestError(
            f"{suffix} needs {form.package}, which is not installed.",
            f"Install it: {install_command(form.extra)}",
        )
    return form


def _has_laspy() -> bool:
    return find_spec("laspy") is not None
