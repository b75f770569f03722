"""What a project sets for `validate`, in `.terratool.toml` or in its pyproject.toml."""

from __future__ import annotations

import contextlib
import os
from fnmatch import fnmatch
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from terratool.errors import ReadError, RequestError

_OWN_FIELDS = ("file", "folder")
OWN, SHARED = ".terratool.toml", "pyproject.toml"


class Config(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab", kw_only=True):
    """The settings; each has the meaning of the option of that name.

    Attributes:
        file: where they stand.
        folder: what `paths` and the patterns of `per_file_ignores` are relative to.
        paths: files and directories to check where the command line names none.
        per_file_ignores: codes by a pattern of file names.
        formats: as `--format`, once or several times.
    """

    file: str = ""
    folder: str = "."
    paths: tuple[str, ...] = ()
    strict: bool = False
    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    per_file_ignores: dict[str, tuple[str, ...]] = {}
    max_step: Annotated[float, Meta(ge=0)] | None = None
    max_findings: Annotated[int, Meta(ge=0)] | None = None
    formats: tuple[str, ...] = ()
    baseline: str | None = None

    def files(self) -> tuple[str, ...]:
        """The paths as the working directory has them."""
        return tuple(self.located(path) for path in self.paths)

    def located(self, path: str) -> str:
        """A path of the settings as the working directory has it."""
        return os.path.relpath(Path(self.folder, path))

    def written(self, path: str) -> str:
        """The same of a file that is to be written.

        Raises:
            RequestError: it lies outside of the folder of the settings, which may be a stranger's.
        """
        if "\0" in path or not Path(self.folder, path).resolve().is_relative_to(
            Path(self.folder).resolve()
        ):
            raise RequestError(
                f"{self.file}: names {path!r}, which lies outside of its folder.",
                "Name it on the command line.",
            )
        return self.located(path)

    def ignored(self, file: str) -> tuple[str, ...]:
        """The codes that are ignored in a file; a pattern without a slash is of names alone."""
        if not self.per_file_ignores:
            return ()
        path = Path(os.path.relpath(file or ".", self.folder)).as_posix()
        return tuple(
            code
            for pattern, codes in self.per_file_ignores.items()
            if fnmatch(path if "/" in pattern else path.rpartition("/")[2], pattern)
            for code in codes
        )


def find_config(start: Path) -> Config:
    """The settings of the nearest folder that has some, from a folder upwards.

    Raises:
        ReadError: a file of settings cannot be read.
        RequestError: it is no TOML, or has a setting that there is not.
    """
    for folder in (start, *start.parents):
        for name in (OWN, SHARED):
            path = folder / name
            # a folder that may not be looked into has no settings for us
            with contextlib.suppress(PermissionError):
                if path.is_file() and (found := read_config(path)) is not None:
                    return found
    return Config()


def read_config(path: Path) -> Config | None:
    """The settings in a file; None if it is a pyproject.toml without any.

    Raises:
        ReadError: the file cannot be read.
        RequestError: it is no TOML, or has a setting that there is not.
    """
    try:
        text = path.read_text("utf-8")
    except OSError as error:
        raise ReadError.of(path, error) from error
    except UnicodeDecodeError as error:
        raise ReadError(f"{path}: is no UTF-8 text.", "Save it as UTF-8.") from error
    shared = path.name == SHARED
    if shared and "terratool" not in text:
        return None
    import tomllib

    try:
        table: Any = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise RequestError(f"{path}: is no TOML ({error}).", "Correct the file there.") from error
    if shared:
        tool = table.get("tool")
        table = tool.get("terratool") if isinstance(tool, dict) else None
        if table is None:
            return None
    try:
        for own in _OWN_FIELDS:
            if isinstance(table, dict) and own in table:
                raise msgspec.ValidationError(f"Object contains unknown field `{own}`")
        config = msgspec.convert(table, Config)
    except msgspec.ValidationError as error:
        settings = ", ".join(sorted(Config.__struct_encode_fields__[len(_OWN_FIELDS) :]))
        raise RequestError(
            f"{path}: has a setting that is not taken ({error}).", f"There are {settings}."
        ) from error
    return msgspec.structs.replace(config, file=str(path), folder=str(path.parent))
