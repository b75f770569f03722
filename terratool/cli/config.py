"""Settings of a project for commands that check it, in `.terratool.toml` or pyproject.toml.

The project may be a stranger's: its settings name no file outside of their folder, and no output
that could do harm in it.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

import msgspec
from msgspec import Meta, Struct, field

from terratool.cli.config_words import wrong_setting, wrong_table
from terratool.cli.patterns import hint_on, idle_patterns, is_match
from terratool.errors import ReadError, RequestError, TerratoolError
from terratool.output import is_same_file
from terratool.report.wording import count_of
from terratool.text.display import quote
from terratool.text.meaning import guess

_T = TypeVar("_T")
_OWN_FIELDS = ("file", "folder", "named")
OWN, SHARED = ".terratool.toml", "pyproject.toml"
_MOST_BYTES = 1 << 20
_MOST_PATTERNS = 1000
_MOST_IDLE = 10
"""Most patterns without a match that are told."""
_PART = r"""(?:[\w-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')"""
_long_key = re.compile(rf"(?<![\w-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{30}}").search
"""Search for a key of more than 30 parts (a.a.a…), whose parsing takes quadratic time."""
REPORTS = (".json", ".log", ".md", ".sarif", ".txt", ".xml")
"""Suffixes of the reports that settings may name."""


class DriveSettings(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab", kw_only=True):
    """Settings of `traversability` for all terrains, or for some; None where nothing is set.

    Attributes:
        vehicles: files of vehicles.
        routes: x and y of the start and of the goal of each route.
        start: x and y from which ground is reached; `from` in the file.
        fail_on: conditions on which a file fails.
        resolution: side of a pixel.
    """

    vehicles: tuple[str, ...] | None = None
    routes: tuple[tuple[float, float, float, float], ...] | None = None
    start: tuple[float, float] | None = field(default=None, name="from")
    fail_on: tuple[str, ...] | None = None
    resolution: float | None = None


class FileDrive(NamedTuple):
    """Settings of `traversability` for one file, of options and of the project.

    Attributes:
        settings: the settings.
        sources: where each attribute is set, in words; empty for an option.
    """

    settings: DriveSettings
    sources: dict[str, str]

    @contextlib.contextmanager
    def telling(self, name: str) -> Iterator[None]:
        """Have errors about an attribute within the block say where it is set, if not by options.

        Args:
            name: name of the attribute.
        """
        try:
            yield
        except TerratoolError as error:
            if source := self.sources.get(name):
                error.message = f"{source}: {error.message.replace('--fail-on', 'fail-on', 1)}"
                error.args = (error.message,)
            raise

    @property
    def places(self) -> dict[str, Any]:
        """Attributes of a request that are places, and where settings ask for them."""
        return {
            "routes": self.settings.routes or (),
            "start": self.settings.start,
            "routes_of": self.sources.get("routes", ""),
            "start_of": self.sources.get("start", ""),
        }


class DriveConfig(DriveSettings, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """Settings of `traversability` of a project.

    Attributes:
        paths: files and directories to judge where the command line names none.
        formats: values of `--format`.
        per_file: settings that stand in place of these, by a pattern of file names.
    """

    paths: tuple[str, ...] = ()
    formats: tuple[str, ...] = ()
    per_file: Annotated[dict[str, DriveSettings], Meta(max_length=_MOST_PATTERNS)] = {}


class Config(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab", kw_only=True):
    """Settings of a project; those without a line here are the options of the same names.

    Attributes:
        file: file of the settings; empty for none.
        folder: folder to which `paths` and the patterns of `per_file_ignores` are relative.
        named: whether the user named the file, which may then lie beside the terrains' folder.
        paths: files and directories to check where the command line names none.
        per_file_ignores: codes to ignore, by a pattern of file names.
        formats: values of `--format`.
        traversability: settings of that command.
    """

    file: str = ""
    folder: str = "."
    named: bool = False
    paths: tuple[str, ...] = ()
    strict: bool = False
    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    per_file_ignores: Annotated[dict[str, tuple[str, ...]], Meta(max_length=_MOST_PATTERNS)] = {}
    max_step: Annotated[float, Meta(ge=0)] | None = None
    max_findings: Annotated[int, Meta(ge=0)] | None = None
    formats: tuple[str, ...] = ()
    baseline: str | None = None
    traversability: DriveConfig = DriveConfig()

    def files(self, paths: tuple[str, ...] | None = None) -> tuple[str, ...]:
        """Paths to check, or other paths of the settings, relative to the working directory.

        Raises:
            RequestError: one of them lies outside.
        """
        paths = self.paths if paths is None else paths
        # a name with NUL is reported where it is read
        return tuple(path if "\0" in path else self.path_here(path) for path in paths)

    def path_here(self, path: str) -> str:
        """Path of the settings, relative to the working directory.

        Raises:
            RequestError: the path lies outside, links followed.
        """
        if "\0" not in path:
            found = os.path.relpath(Path(self.folder, path))
            if self.holds(found):
                return f"./{found}" if found == "-" else found  # "-" is stdin
        where = "outside of its folder"
        if self.named:
            where = "neither in its folder nor in the current one"
        raise RequestError(
            f"{self.file}: names {quote(path)}, which lies {where}.", "Name it on the command line."
        )

    def holds(self, name: str) -> bool:
        """Whether a file, links followed, lies in the folder of the settings, or an allowed one.

        Settings that the user named may also name files in the working directory.
        """
        return bool(self._below(name))

    def _below(self, name: str) -> list[Path]:
        """Paths of a file, links followed, relative to each allowed folder that holds it."""
        real = Path(os.path.realpath(name))
        roots = map(os.path.realpath, (self.folder, ".") if self.named else (self.folder,))
        return [real.relative_to(root) for root in roots if real.is_relative_to(root)]

    def writes(self, name: str) -> bool:
        """Whether a file is the baseline of the settings, or one of their outputs."""
        forms = (*self.formats, *self.traversability.formats)
        paths = [text.partition("=")[2] for text in forms] + [self.baseline or ""]
        return any(path and is_same_file(Path(self.folder, path), name) for path in paths)

    def output_path(self, path: str) -> str:
        """Path of an output, relative to the working directory.

        Raises:
            RequestError: the path lies outside, or where something else than a report belongs.
        """
        found = self.path_here(path)
        self.refuse_output(found)
        return found

    def refuse_output(self, name: str) -> None:
        """Refuse an output that settings may not name, by its path from the working directory.

        Raises:
            RequestError: the file lies outside, or where something else than a report belongs.
        """
        below = self._below(name)
        why = ""
        if not below:
            why = "leads out of its folder"
        elif any(_is_hidden(part) for path in below for part in path.parts):
            why = "is hidden, or lies in a hidden folder"
        elif not {Path(name).suffix.lower(), below[0].suffix.lower()} <= {*REPORTS}:
            why = f"ends in none of {', '.join(REPORTS)}"
        if why:
            raise RequestError(
                f"{self.file}: has {quote(name)} written, which {why}.",
                "Name it on the command line.",
            )

    def ignored_codes(self, file: str) -> tuple[str, ...]:
        """Codes to ignore in a file."""
        found = self._of_file(self.per_file_ignores, file)
        return tuple(code for _, codes in found for code in codes)

    def drive_settings(self, file: str, given: DriveSettings) -> FileDrive:
        """Settings of `traversability` for a file.

        Of patterns that match, the last one counts, and options, `given`, outrank all.

        Raises:
            RequestError: a vehicle of the settings lies outside.
        """
        where = f" in {os.path.relpath(self.file or '.')}"
        found: dict[str, Any] = {}
        sources: dict[str, str] = {}
        per_file = self._of_file(self.traversability.per_file, file)
        for source, settings in (
            ("[traversability]" + where, self.traversability),
            *((quote(pattern) + where, settings) for pattern, settings in per_file),
            ("", given),
        ):
            for name in DriveSettings.__struct_fields__:
                if (value := getattr(settings, name)) is not None:
                    found[name], sources[name] = value, source
        if sources.get("vehicles"):
            found["vehicles"] = self.files(found["vehicles"])
        return FileDrive(DriveSettings(**found), sources)

    def idle(self, table: str, patterns: Iterable[str], files: Iterable[str]) -> list[RequestError]:
        """Errors on the patterns of a table that match none of the files.

        Args:
            table: name of the table of settings.
            patterns: its patterns.
            files: names of all files that were looked at.
        """
        paths = {self._path_below(file) for file in files}
        counted = f"none of the {count_of(len(paths), 'file')}" if paths else "no file"
        return [
            RequestError(
                f"{self.file}: the pattern {quote(pattern)} of [{table}] matches {counted}.",
                hint_on(pattern, paths),
            )
            for pattern in islice(idle_patterns(patterns, paths), _MOST_IDLE)
        ]

    def _of_file(self, table: dict[str, _T], file: str) -> list[tuple[str, _T]]:
        """Patterns that match a file, with their values."""
        if not table:
            return []
        path = self._path_below(file)
        return [each for each in table.items() if is_match(each[0], path)]

    def _path_below(self, file: str) -> str:
        """Path of a file, with slashes, from the folder of the settings."""
        return Path(os.path.relpath(file or ".", self.folder)).as_posix()


def _is_hidden(part: str) -> bool:
    """Whether a part of a path is hidden on some file system: `.git`, but also `git~1`."""
    name = "".join(c for c in part if c.isprintable())
    return name.startswith(".") or re.fullmatch(r"git~\d", name.casefold()) is not None


def project_settings(config_file: str | None) -> Config:
    """Settings from a named file, or from the nearest one of the working directory.

    Raises:
        ReadError: the file of settings cannot be read.
        RequestError: the file has an unknown setting, or no table of settings.
    """
    if config_file is None:
        return find_config(Path.cwd())
    settings = read_config(Path(config_file), named=True)
    if settings is None:
        raise RequestError(f"{config_file}: has no [tool.terratool].", "Add that table.")
    return settings


def find_config(start: Path) -> Config:
    """Settings of the nearest folder that has some, from a folder upwards; defaults if none has.

    Raises:
        ReadError: a file of settings cannot be read.
        RequestError: the file is no TOML, or has an unknown setting.
    """
    for folder in (start, *start.parents):
        for name in (OWN, SHARED):
            path = folder / name
            # a folder without permission counts as one without settings
            with contextlib.suppress(PermissionError):
                if path.is_file() and (found := read_config(path)) is not None:
                    if not found.holds(str(path)):
                        raise RequestError(
                            f"{path}: is a link out of its folder.",
                            "Put the settings themselves there, or name them by --config.",
                        )
                    return found
    return Config()


def _tables(table: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield tables of settings, the whole last, each with its name and its type."""
    drive = table.get("traversability") if isinstance(table, dict) else None
    files = drive.get("per-file") if isinstance(drive, dict) else None
    if isinstance(files, dict) and len(files) <= _MOST_PATTERNS:
        for pattern, settings in files.items():
            yield f"traversability.per-file.{quote(pattern)}", settings, DriveSettings
    if drive is not None:
        yield "traversability", drive, DriveConfig
    yield "", table, Config


def _refuse_wrong(path: Path, name: str, table: Any, kind: Any) -> None:
    """Refuse a table of settings that has an unknown one, or one of another type.

    Args:
        path: file of the settings.
        name: name of the table; empty for the whole.
        table: the table.
        kind: struct that it should be.

    Raises:
        RequestError: a setting is not taken.
    """
    if not isinstance(table, dict):
        said, hint = wrong_table(name or "tool.terratool", table)
        raise RequestError(f"{path}: {said}", hint)
    names = sorted({*kind.__struct_encode_fields__} - {*_OWN_FIELDS})
    for key in table:
        if key not in names:
            hint = f"{guess(key, names)} There are {', '.join(names)}.".lstrip()
            where = f"[{name}] has" if name else "has"
            raise RequestError(
                f"{path}: {where} a setting that is not taken ({quote(key)} is no key).", hint
            )
    for one in msgspec.structs.fields(kind):
        if one.encode_name in table:
            wrong = wrong_setting(one.encode_name, table[one.encode_name], one.type)
            if wrong is not None:
                said, hint = wrong
                raise RequestError(f"{path}: {name}{'.' * bool(name)}{said}", hint)


def read_config(path: Path, named: bool = False) -> Config | None:
    """Settings in a file; None if the file is a pyproject.toml without any.

    Args:
        path: file of the settings.
        named: whether the user named the file.

    Raises:
        ReadError: the file cannot be read.
        RequestError: the file is no TOML, or has an unknown setting.
    """
    try:
        with open(path, "rb") as file:
            data = file.read(_MOST_BYTES + 1)
        text = data.decode("utf-8")
    except OSError as error:
        raise ReadError.of(path, error) from error
    except UnicodeDecodeError as error:
        raise ReadError(f"{path}: is no UTF-8 text.", "Save it as UTF-8.") from error
    if len(data) > _MOST_BYTES:
        raise ReadError(f"{path}: holds more than 1 MiB.", "Name settings by --config.")
    shared = path.name == SHARED
    if shared and "terratool" not in text:
        return None
    import tomllib

    try:
        if _long_key(text):
            raise ValueError("a key has more than 30 parts")
        table: Any = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number may be too long
        raise RequestError(f"{path}: is no TOML ({error}).", "Correct the file there.") from error
    if shared:
        tool = table.get("tool")
        table = tool.get("terratool") if isinstance(tool, dict) else None
        if table is None:
            return None
    for name, part, kind in _tables(table):
        _refuse_wrong(path, name, part, kind)
    config = msgspec.convert(table, Config)
    return msgspec.structs.replace(config, file=str(path), folder=str(path.parent), named=named)
