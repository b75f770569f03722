"""The innermost loops, in C++ (see docs/design.md): a part for each package that they serve.

They are built twice: for any processor of the platform, and for those of x86-64-v3 (AVX2), chosen
when this is imported. The environment variable `TERRATOOL_CPU=baseline` forces the first. Both give
the same bits.
"""

from __future__ import annotations

import os
from importlib import import_module

from terratool.kernels._processor import is_v3


def _variant() -> str:
    wanted = os.environ.get("TERRATOOL_CPU", "")
    if wanted not in ("", "baseline", "v3"):
        raise ImportError(f"TERRATOOL_CPU is {wanted!r}; it may be baseline or v3, or not set.")
    return wanted or ("v3" if is_v3() else "baseline")


variant = _variant()
"""Which of them is loaded: "baseline" or "v3"."""

_compiled = import_module(f"terratool.kernels.{variant}._kernels")
PARTS = ("definition", "field", "importing", "mesh", "raster", "traversability")
globals().update({part: getattr(_compiled, part) for part in PARTS})
