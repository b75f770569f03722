"""Innermost loops in C++ (see docs/internals.md), with a part for each package that calls them.

Wheels hold two variants, one for all processors of the platform and one for x86-64-v3 (AVX2),
chosen on import; an installation in place holds one, for its own processor. The environment
variable `TERRATOOL_CPU=baseline` selects the first. Both give the same bits.
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
    """Error for a variant that is missing."""
    return TerratoolError(
        f"The kernels of terratool are not built for {variant} here.",
        "Build them for every processor: run make install VARIANTS=all, or pip install .",
    )


def _choose_variant() -> str:
    """Choose the variant for this processor, or the one that TERRATOOL_CPU names.

    Raises:
        RequestError: the processor does not support the variant of TERRATOOL_CPU.
        TerratoolError: the variant is not built.
    """
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


variant = _choose_variant()
"""Name of the loaded variant: "baseline" or "v3"."""

try:
    _compiled = import_module(f"terratool.kernels.{variant}._kernels")
except ImportError as error:
    raise _not_built(variant) from error
PARTS = ("definition", "field", "importing", "mesh", "raster", "traversability")
"""Names of the parts, attributes of this package."""
globals().update({part: getattr(_compiled, part) for part in PARTS})
