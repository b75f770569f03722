"""The one way from a terrain to the files of simulators: written, explained, and listed."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msgspec import UNSET, Struct, UnsetType

from terratool._version import __version__
from terratool.errors import ReadError, WriteError
from terratool.field.terrain import Terrain
from terratool.mesh.formats.common import ascii_word, lines_of, plain_names
from terratool.mesh.loss import MeshLoss
from terratool.output import (
    hold_signals,
    os_errors,
    part_folder,
    refuse_missing_folder,
    stop_on_signals,
)
from terratool.report.documents import Document, json_text, plain_document
from terratool.report.markup import escaped_markdown, markdown_row
from terratool.report.numbers import spelled
from terratool.simulators.options import SceneOptions
from terratool.simulators.scene import Material, Scene
from terratool.simulators.targets import Target, Written, chosen, refuse_uninstalled
from terratool.text.display import printable
from terratool.text.files import is_regular, open_file
from terratool.traversability.judge import Judge

MANIFEST = "manifest.json"
README = "README.md"


@dataclass(frozen=True, slots=True)
class SimulatorReport:
    """What was written for one simulator.

    Attributes:
        folder: it is all in here.
        manifest: what the manifest says.
    """

    folder: Path
    manifest: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class ExportPlan:
    """Files for simulators, of which all is checked that can be without the terrain.

    Attributes:
        folder: of the folders.
        targets: the simulators, by name.
        options: what is wanted.
        judge: the vehicle that the options name.
        source: the file of the definition; None where it has none.
    """

    folder: Path
    targets: Mapping[str, Target]
    options: SceneOptions
    judge: Judge | None
    source: Path | None

    def write(
        self, terrain: Terrain, progress: Callable[[str], object] = lambda _: None
    ) -> tuple[SimulatorReport, ...]:
        """Write a terrain; arguments and errors are those of `export_simulators`."""
        source = self.source
        stem = "terrain" if source is None else source.stem
        [name] = plain_names([stem], _in_name, "terrain")
        scene = Scene(terrain.written_out, name, self.options, progress, self.judge)
        for target in self.targets.values():
            target.check(scene)
        reports = []
        with os_errors(self.folder), stop_on_signals(), _made(self.folder):
            for key, target in self.targets.items():
                with part_folder(self.folder) as part:
                    written = target.write(scene, part)
                    manifest = _manifest(scene, key, written, source)
                    manifest["files"] = _hashes(part)
                    (part / README).write_text(_readme(scene, target, written), "utf-8")
                    (part / MANIFEST).write_text(json_text(manifest) + "\n", "utf-8")
                    _put(part, self.folder / key)
                reports.append(SimulatorReport(self.folder / key, manifest))
        return tuple(reports)


def plan_export(
    folder: str | Path,
    targets: str | Iterable[str],
    options: SceneOptions | None = None,
    *,
    source: str | Path | None = None,
    overwrite: bool = False,
) -> ExportPlan:
    """Check what can be checked before there is a terrain; as of `export_simulators`."""
    options, folder = options or SceneOptions(), Path(folder)
    wanted = chosen((targets,) if isinstance(targets, str) else tuple(targets))
    options.check()
    judge = None if options.vehicle is None else Judge.of(options.vehicle)
    source = None if source is None else Path(source)
    if source is not None:
        _refuse_missing(source)
    refuse_uninstalled(wanted)
    _check_folders(folder, tuple(wanted), overwrite)
    return ExportPlan(folder, wanted, options, judge, source)


def export_simulators(
    terrain: Terrain,
    folder: str | Path,
    targets: str | Iterable[str],
    options: SceneOptions | None = None,
    *,
    source: str | Path | None = None,
    overwrite: bool = False,
    progress: Callable[[str], object] | None = None,
) -> tuple[SimulatorReport, ...]:
    """Write a terrain for simulators, each into a folder of its own with a README and a manifest.

    Args:
        terrain: the terrain.
        folder: where the folders go; it is made where it is missing.
        targets: the name of a simulator, or names of several; "all" is every one.
        options: what is wanted.
        source: the definition; its name is that of the terrain in the files.
        overwrite: whether folders that an earlier run has written are written again.
        progress: is called with words that say how far it is.

    Raises:
        RequestError: a target is unknown or not installed, or what was asked for makes no sense.
        ReadError: the definition's or the vehicle's file cannot be read.
        DefinitionError: it has errors.
        WriteError: a folder is there already, holds something else, or cannot be written.
    """
    plan = plan_export(folder, targets, options, source=source, overwrite=overwrite)
    return plan.write(terrain, progress or (lambda _: None))


@contextlib.contextmanager
def _made(folder: Path) -> Iterator[None]:
    """Have a folder there; it goes again if nothing comes to be in it."""
    was_there = folder.exists()
    folder.mkdir(exist_ok=True)
    try:
        yield
    finally:
        if not was_there:
            with contextlib.suppress(OSError):  # as it holds something
                folder.rmdir()


def _in_name(letter: str) -> bool:
    """Whether a character may stand in the name of a terrain."""
    return ascii_word(letter) or letter == "-"


def _check_folders(folder: Path, targets: tuple[str, ...], overwrite: bool) -> None:
    """Refuse what can be known to fail before there are files.

    Raises:
        WriteError: a folder is there already and not to be written again, or holds files of others.
    """
    refuse_missing_folder(folder)
    if folder.exists() and not folder.is_dir():
        raise WriteError(f"{folder}: is a file.", "Choose a folder.")
    for name in targets:
        place = folder / name
        if not place.exists() and not place.is_symlink():
            continue
        if place.is_symlink() or not place.is_dir() or not _earlier(place):
            raise WriteError(
                f"{place}: was not written by terratool, as no {MANIFEST} in it says so.",
                "Choose another folder, or remove it.",
            )
        if not overwrite:
            raise WriteError(f"{place}: exists already.", "Choose another folder, or --overwrite.")


def _earlier(place: Path) -> dict[str, Any]:
    """Names of the files that an earlier run has written, and their SHA-256; none where it has not.

    Those of the README and of the manifest itself are not known.
    """
    if (place / MANIFEST).is_symlink():
        return {}
    try:
        with open_file(place / MANIFEST) as file:
            manifest = json.loads(file.read())
        files = {**manifest["files"], README: None, MANIFEST: None}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return {}
    return {name: digest for name, digest in files.items() if _is_own(place, name)}


def _is_own(place: Path, name: str) -> bool:
    """Whether a file lies in a folder; a manifest may have been written by anyone."""
    path = place / name
    return path.is_file() and path.resolve().is_relative_to(place.resolve())


def _put(part: Path, place: Path) -> None:
    """Give what is written its place; what an earlier run had written goes, unless it was changed.

    Raises:
        WriteError: something of others is in the way, or a link out of the folder.
    """
    if not place.exists():
        part.replace(place)
        part.mkdir()  # as it is removed
        return
    new = sorted(_files(part), key=lambda name: name == MANIFEST)
    old = _earlier(place)
    for name in new:
        for path in (place / name, *(place / name).parents):
            if path == place:
                break
            taken = path.is_symlink() or (path == place / name and path.exists())
            if taken and (path.is_dir() or name not in old):
                raise WriteError(
                    f"{path}: is in the way, and was not written by terratool.",
                    "Choose another folder, or move it elsewhere.",
                )
    gone = [name for name in old if name not in new and _sha256(place / name) == old[name]]
    with hold_signals():
        for name in gone:
            (place / name).unlink()
        for name in new:
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (part / name).replace(place / name)


def _files(folder: Path) -> list[str]:
    """Names of all files in a folder, in order, with forward slashes."""
    return sorted(
        (Path(where) / name).relative_to(folder).as_posix()
        for where, _, names in os.walk(folder)
        for name in names
    )


def _hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of all files in a folder by name; they are on the disk afterwards."""
    found = {}
    for name in _files(folder):
        with open(folder / name, "rb+") as file:
            os.fsync(file.fileno())
        found[name] = _sha256(folder / name)
    return found


class ManifestSource(Struct, frozen=True):
    """The definition's file, with the libraries that it uses by their places beside it; SHA-256."""

    file: str
    sha256: str
    libraries: dict[str, str]


class ManifestSurface(Struct, frozen=True):
    """What a simulator is told of a surface."""

    word: str
    friction: float
    derived: str
    color: tuple[int, int, int]
    sonar_reflectivity: float | None


class Manifest(Document, frozen=True, kw_only=True):
    """What the manifest says of files for any simulator."""

    generator: str = f"terratool {__version__}"
    target: str
    summary: str
    source: ManifestSource | None
    descr: str
    origin: tuple[float, ...]
    bounds: tuple[float, ...]
    max_error: float | None
    surfaces: dict[str, ManifestSurface]
    losses: tuple[str, ...]
    mesh: MeshLoss | UnsetType = UNSET


def _manifest(scene: Scene, key: str, written: Written, source: Path | None) -> dict[str, Any]:
    """The keys of all manifests, then those that a simulator has for itself."""
    west, south, east, north = scene.terrain.bounds
    x, y, _ = scene.zero
    head = Manifest(
        target=key,
        summary=written.summary,
        source=_source(source, scene.terrain.libraries),
        descr=scene.terrain.descr,
        origin=scene.zero,
        bounds=(west - x, south - y, east - x, north - y),
        max_error=scene.options.max_error if written.meshed else None,
        surfaces={
            one.name: ManifestSurface(
                one.word, one.friction, one.derivation, one.color, one.reflectivity
            )
            for one in scene.used(written.meshed)
        },
        losses=tuple(_losses(scene, written)),
        mesh=scene.loss if written.meshed else UNSET,
    )
    return {**plain_document(head), **written.facts}


def _refuse_missing(path: Path) -> None:
    """Refuse a definition that is not there.

    Raises:
        ReadError: it is not.
    """
    try:
        path.stat()
    except OSError as error:
        raise ReadError.of(path, error) from error


def _source(path: Path | None, libraries: Iterable[str]) -> ManifestSource | None:
    """What a manifest says of the definition; None where it came from no file."""
    if path is None or not is_regular(path):
        return None
    used = {Path(os.path.relpath(one, path.parent)).as_posix(): _sha256(one) for one in libraries}
    return ManifestSource(path.name, _sha256(path), used)


def _sha256(path: str | Path) -> str:
    try:
        with open_file(path) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ReadError.of(path, error) from error


def _losses(scene: Scene, written: Written) -> Iterator[str]:
    """What files lose, in sentences."""
    if written.meshed:
        walls, lost = scene.loss.sentences()
        yield walls
        apart = "error" in written.facts.get("collision", {})
        yield lost.replace("Lost", "Lost of the mesh, which is only seen", 1) if apart else lost
    yield from written.losses
    held = _frictions(scene, written)
    assumed = [printable(one.name) for one in held if one.derivation.startswith("assumed")]
    if assumed:
        names = ", ".join(assumed)
        yield f"Friction {scene.options.friction:g} is assumed, as there is no fricAngle: {names}."


def _readme(scene: Scene, target: Target, written: Written) -> str:
    """How to load the files, what they are, and what they lose."""
    lines = [f"# {scene.name} in {target.title}", ""]
    for text in filter(None, (scene.terrain.descr, f"Here: {written.summary}.")):
        lines += [text, ""]
    lines += [f"```{written.language}", *written.load, "```", ""]
    for note in written.notes:
        lines += [note, ""]
    zero = spelled(scene.zero)
    lines += [f"Zero is at {zero} of the world; x points east, y north, z up, in metres.", ""]
    held = _frictions(scene, written)
    lines += ["| surface | friction | from |", "|---|---|---|"] * bool(held)
    for one in held:
        cells = escaped_markdown(one.name), f"{one.friction:.4g}", one.derivation
        lines.append(markdown_row(cells))
    lines += [*[""] * bool(held), *_losses(scene, written), ""]
    return "\n".join([*lines_of("\n".join(lines)), ""])


def _frictions(scene: Scene, written: Written) -> Sequence[Material]:
    """The surfaces whose friction is in the files."""
    return scene.used(written.meshed) if written.frictions is None else written.frictions
