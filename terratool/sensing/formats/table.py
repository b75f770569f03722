"""Table of the file formats of scans by suffix."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

from terratool.errors import RequestError
from terratool.extras import install_command
from terratool.report.wording import join_words
from terratool.sensing.formats.common import Record
from terratool.sensing.formats.images import BESIDE, write_png, write_tiff
from terratool.sensing.formats.points import write_csv, write_las, write_npz, write_pcd, write_ply
from terratool.sensing.formats.rosbag import write_bag
from terratool.sensing.readings import Frame


@dataclass(frozen=True, slots=True)
class ScanFormat:
    """A file format of scans.

    Attributes:
        write: writes frames to a file, or to a folder.
        companions: suffixes of further files that `write` puts beside.
        images: whether the format holds images, which only cameras take.
        folder: whether a scan is a folder.
        misses: whether rays without a reading can be kept; images and bags always keep them.
        axes: whether points can be in world axes or in sensor axes.
        intensity: whether the largest intensity of points can be chosen.
        module: module to be imported; empty for none.
        package: package of the module, for messages; empty for none.
        extra: extra of terratool that installs the package; empty for none.
    """

    write: Callable[[Path, Iterator[Frame], Record], None]
    companions: tuple[str, ...] = ()
    images: bool = False
    folder: bool = False
    misses: bool = True
    axes: bool = True
    intensity: bool = True
    module: str = ""
    package: str = ""
    extra: str = ""


_LAS = ScanFormat(
    write_las, misses=False, intensity=False, module="laspy", package="laspy", extra="las"
)
_LAZ = replace(_LAS, module="lazrs", package="laspy and lazrs")
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
"""Formats of scans by suffix."""


def format_of(path: Path) -> ScanFormat:
    """Format of a path by its suffix.

    Raises:
        RequestError: no format has the suffix, or its package is not installed.
    """
    suffix = path.suffix.lower()
    form = FORMATS.get(suffix)
    if form is None:
        what = f"ends with {suffix}" if suffix else "has no suffix"
        raise RequestError(
            f"{path}: {what}, which says no format.",
            f"Let it end with one of {join_words([*FORMATS])}; "
            ".rosbag2 is a folder, a bag of ROS 2.",
        )
    if form.module and (find_spec(form.module) is None or (suffix == ".laz" and not _has_laspy())):
        raise RequestError(
            f"{suffix} needs {form.package}, which is not installed.",
            f"Install it: {install_command(form.extra)}",
        )
    return form


def _has_laspy() -> bool:
    return find_spec("laspy") is not None
