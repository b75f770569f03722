"""`terratool --version`: installed versions, without importing the packages."""

from __future__ import annotations

import platform
import re
from collections.abc import Iterator
from importlib import metadata

import click

from terratool._version import __version__
from terratool.cli.saying import say_block
from terratool.errors import TerratoolError

_WORKING = ("test", "dev", "bench", "docs")
"""Extras that only work on terratool itself needs."""
_requirement = re.compile(r"([\w.-]+)(?:[^;]*?)(?:;.*extra == ['\"](\w+)['\"].*)?").fullmatch
_MISSING = "not installed"


def say_version(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    """Print the versions and exit; the callback of --version."""
    if not value or ctx.resilient_parsing:
        return
    lines = [f"terratool, version {__version__}"]
    lines += [f"{name:14} {version}" for name, version in _versions()]
    say_block("\n".join(lines))
    ctx.exit()


def _versions() -> Iterator[tuple[str, str]]:
    """Names and versions of Python, the kernels, required packages and extras."""
    yield (
        "python",
        (
            f"{platform.python_version()} ({platform.python_implementation()}, {platform.system()} "
            f"{platform.machine()})"
        ),
    )
    yield "kernels", _kernels()
    needed, extras = _requirements()
    for name in needed:
        yield name, _version(name)
    gdal, proj = _gdal()
    yield "GDAL", gdal
    yield "PROJ", proj
    for extra, names in extras.items():
        yield f"[{extra}]", ", ".join(f"{name} {_version(name)}" for name in names)


def _kernels() -> str:
    try:
        from terratool.kernels import variant
    except TerratoolError as error:
        return f"none: {error}"
    return variant


def _requirements() -> tuple[list[str], dict[str, list[str]]]:
    """Names of required packages, and of those of each extra, from the installed metadata."""
    try:
        lines = metadata.requires("terratool") or []
    except metadata.PackageNotFoundError:  # not installed: a checkout on the path
        lines = []
    needed: list[str] = []
    extras: dict[str, list[str]] = {}
    for line in lines:
        match = _requirement(line)
        if match is None or match[2] in _WORKING:
            continue
        (needed if match[2] is None else extras.setdefault(match[2], [])).append(match[1])
    return sorted(needed), {extra: sorted(extras[extra]) for extra in sorted(extras)}


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return _MISSING


def _gdal() -> tuple[str, str]:
    """Versions of GDAL and PROJ that rasterio has.

    Only the extension module that knows them is loaded, as rasterio takes a third of a second.
    """
    from importlib.machinery import EXTENSION_SUFFIXES
    from importlib.util import find_spec, module_from_spec, spec_from_file_location
    from pathlib import Path

    try:
        package = find_spec("rasterio")
        assert package is not None
        assert package.origin is not None
        folder = Path(package.origin).parent
        (path,) = (p for end in EXTENSION_SUFFIXES if (p := folder / f"_version{end}").is_file())
        spec = spec_from_file_location("rasterio._version", path)
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        proj = ".".join(map(str, module.get_proj_version()))
        return str(module.gdal_version()), proj
    except Exception:  # --version has to answer with any version of rasterio
        return "unknown", "unknown"
