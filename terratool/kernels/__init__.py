"""The innermost loops, in C++ (see docs/internals.md): a part for each package that they serve.

Wheels have them twice: for any processor of the platform, and for those of x86-64-v3 (AVX2), chosen
when this is imported; what is installed in place has one variant, for the processor at hand. The
environment variable `TERRATOOL_CPU=baseline` forces the first. Both give the same bits.
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


def _not_built(variant: str) -> TerratoolError:
    return TerratoolError(
        f"The kernels of terratool are not built for {variant} here.",
        "Build them for every processor: run make install VARIANTS=all, or pip install .",
    )


def _variant() -> str:
    runs = ("v3", "baseline") if is_v3() else ("baseline",)
    built = [name for name in runs if find_spec(f"terratool.kernels.{name}")]
    wanted = os.environ.get("TERRATOOL_CPU", "")
    if wanted and wanted not in runs:
        raise RequestError(
            f"TERRATOOL_CPU is {wanted!r}, which this processor has not.",
            f"Set it to {' or '.join(sorted(built))}, or not at all.",
        )
    if not built or (wanted and wanted not in built):
        raise _not_built(wanted or "this processor")
    return wanted or built[0]


variant = _variant()
"""Which of them is loaded: "baseline" or "v3"."""

try:
    _compiled = import_module(f"terratool.kernels.{variant}._kernels")
except ImportError as error:
    raise _not_built(variant) from error
PARTS = ("definition", "field", "importing", "mesh", "raster", "traversability")
globals().update({part: getattr(_compiled, part) for part in PARTS})
