"""The innermost loops, in C++ (see docs/internals.md): a part for each package that they serve.

They are built twice: for any processor of the platform, and for those of x86-64-v3 (AVX2), chosen
when this is imported. The environment variable `TERRATOOL_CPU=baseline` forces the first. Both give
the same bits.
"""

from __future__ import annotations

import os
from importlib import import_module
from importlib.util import find_spec

from terratool.errors import RequestError, TerratoolError

try:
    from terratool.kernels._processor import is_v3
except ModuleNotFoundError as error:
    raise TerratoolError(
        "The kernels of terratool are not built here.", "Run make install, or pip install -e ."
    ) from error


def _variant() -> str:
    wanted = os.environ.get("TERRATOOL_CPU", "")
    has_v3 = is_v3() and find_spec("terratool.kernels.v3") is not None
    known = ("baseline", "v3") if has_v3 else ("baseline",)
    if wanted and wanted not in known:
        raise RequestError(
            f"TERRATOOL_CPU is {wanted!r}, which this processor, or this build, has not.",
            f"Set it to {' or '.join(known)}, or not at all.",
        )
    return wanted or known[-1]


variant = _variant()
"""Which of them is loaded: "baseline" or "v3"."""

_compiled = import_module(f"terratool.kernels.{variant}._kernels")
PARTS = ("definition", "field", "importing", "mesh", "raster", "traversability")
globals().update({part: getattr(_compiled, part) for part in PARTS})
