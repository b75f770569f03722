"""Export of a terrain to simulators: files, a README and a manifest for each."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from msgspec import UNSET, Struct, UnsetType

from terratool._version import __version__
from terratool.cluster import crew_of
from terratool.errors import ReadError, WriteError
from terratool.field.terrain import Terrain
from terratool.mesh.formats.common import is_ascii_word, lines_of, plain_names
from terratool.mesh.loss import MeshLoss
from terratool.output import (
    hold_signals,
    os_errors,
    part_folder,
    refuse_missing_folder,
    stop_on_signals,
)
from terratool.report.documents import Document, json_text, plain_document
from terratool.report.markup import escape_markdown, markdown_row
from terratool.report.numbers import coordinates
from terratool.simulators.options import SceneOptions
from terratool.simulators.scene import Material, Scene
from terratool.simulators.targets import Target, WrittenFiles, choose_targets, refuse_uninstalled
from terratool.tasks import processors
from terratool.text.display import printable
from terratool.text.files import is_regular, open_file
from terratool.traversability.judge import Judge

MANIFEST = "manifest.json"
README = "README.md"


@dataclass(frozen=True, slots=True)
class SimulatorReport:
    """Files that were written for one simulator.

    Attributes:
        folder: folder that holds all of the files.
        manifest: content of the manifest, ready for JSON.
    """

    folder: Path
    manifest: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class ExportPlan:
    """Request for files of simulators, checked as far as that needs no terrain.

    Attributes:
        folder: parent of the simulators' folders.
        targets: simulators by name.
        options: options of the files.
        judge: judge by the vehicle that the options name; None without a vehicle.
        source: file of the definition; None where it came from no file.
    """

    folder: Path
    targets: Mapping[str, Target]
    options: SceneOptions
    judge: Judge | None
    source: Path | None

    def write(
        self, terrain: Terrain, progress: Callable[[str], object] = lambda _: None
    ) -> tuple[SimulatorReport, ...]:
        """Write the files of a terrain; arguments and errors are those of `export_simulators`."""
        source = self.source
        scene = scene_of(terrain, "" if source is None else source.name, self.options)
        scene = replace(scene, say=progress, judge=self.judge)
        for target in self.targets.values():
            target.check(scene)
        reports = []
        with (
            os_errors(self.folder),
            stop_on_signals(),
            crew_of(self.options.dask, processors()) as crew,
            _make_folder(self.folder),
        ):
            scene = replace(scene, crew=crew)
            for key, target in self.targets.items():
                with part_folder(self.folder) as part:
                    written = target.write(scene, part)
                    own = written.scene or scene
                    manifest = _manifest(own, key, written, source)
                    manifest["files"] = _hashes(part)
                    (part / README).write_text(_readme(own, target, written), "utf-8")
                    (part / MANIFEST).write_text(json_text(manifest) + "\n", "utf-8")
                    _put_in_place(part, self.folder / key)
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
    """Check a request before there is a terrain, with arguments of `export_simulators`."""
    options, folder = options or SceneOptions(), Path(folder)
    wanted = choose_targets((targets,) if isinstance(targets, str) else tuple(targets))
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
    """Write a terrain for simulators, into a folder for each with a README and a manifest.

    Args:
        terrain: terrain to write.
        folder: parent of the simulators' folders; a missing one is made.
        targets: name of a simulator, or names of several; "all" is every one.
        options: options of the files; the defaults if None.
        source: file of the definition, after which the terrain is named in the files.
        overwrite: whether folders of an earlier export are written again.
        progress: function that is called with a phrase at each step.

    Raises:
        RequestError: a target is unknown or not installed, or an option makes no sense, or Dask is
            asked for and not installed.
        ReadError: the definition's or the vehicle's file cannot be read.
        DefinitionError: the vehicle's file has errors.
        WriteError: a folder is there already, holds something else, or cannot be written; or no
            Dask scheduler answers.
    """
    plan = plan_export(folder, targets, options, source=source, overwrite=overwrite)
    return plan.write(terrain, progress or (lambda _: None))


def scene_of(terrain: Terrain, file: str, options: SceneOptions) -> Scene:
    """Return the scene of a terrain, which is called as the file of its definition.

    Args:
        terrain: the terrain.
        file: name of the file; empty for none.
        options: options of the scene.

    Raises:
        RequestError: x and y of the terrain are degrees, or an option makes no sense.
    """
    terrain.refuse_degrees("A simulator")
    options.check()
    [name] = plain_names([Path(file).stem or "terrain"], _fits_name, "terrain")
    return Scene(terrain.written_out, name, options)


@contextlib.contextmanager
def _make_folder(folder: Path) -> Iterator[None]:
    """Make a folder for the block, and remove it again if it is new and stays empty."""
    was_there = folder.exists()
    folder.mkdir(exist_ok=True)
    try:
        yield
    finally:
        if not was_there:
            with contextlib.suppress(OSError):  # the folder may not be empty
                folder.rmdir()


def _fits_name(letter: str) -> bool:
    """Whether a character may stand in the name of a terrain."""
    return is_ascii_word(letter) or letter == "-"


def _check_folders(folder: Path, targets: tuple[str, ...], overwrite: bool) -> None:
    """Refuse folders that cannot be written, before there are files.

    Raises:
        WriteError: a folder exists and is not to be written again, or holds files of others.
    """
    refuse_missing_folder(folder)
    if folder.exists() and not folder.is_dir():
        raise WriteError(f"{folder}: is a file.", "Choose a folder.")
    for name in targets:
        place = folder / name
        if not place.exists() and not place.is_symlink():
            continue
        if place.is_symlink() or not place.is_dir() or not _earlier_files(place):
            raise WriteError(
                f"{place}: was not written by terratool, as no {MANIFEST} in it says so.",
                "Choose another folder, or remove it.",
            )
        if not overwrite:
            raise WriteError(f"{place}: exists already.", "Choose another folder, or --overwrite.")


def _earlier_files(place: Path) -> dict[str, Any]:
    """Return the SHA-256 of an earlier export's files by name; empty where there was none.

    The README and the manifest have None, as their hashes are not known.
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
    """Whether a name, from a manifest that anyone may have written, is of a file in a folder."""
    path = place / name
    return path.is_file() and path.resolve().is_relative_to(place.resolve())


def _put_in_place(part: Path, place: Path) -> None:
    """Move new files to their place; remove files of an earlier export, unless they were changed.

    Raises:
        WriteError: a file of others, or a link out of the folder, is in the way.
    """
    if not place.exists():
        part.replace(place)
        part.mkdir()  # the caller, who made the folder, removes it
        return
    new = sorted(_files(part), key=lambda name: name == MANIFEST)
    old = _earlier_files(place)
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
    """Return the names of all files in a folder, sorted, with forward slashes."""
    return sorted(
        (Path(where) / name).relative_to(folder).as_posix()
        for where, _, names in os.walk(folder)
        for name in names
    )


def _hashes(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of all files in a folder by name, and sync them to the disk."""
    found = {}
    for name in _files(folder):
        with open(folder / name, "rb+") as file:
            os.fsync(file.fileno())
        found[name] = _sha256(folder / name)
    return found


class ManifestSource(Struct, frozen=True):
    """File of a definition, and libraries by their paths from it, with SHA-256 hashes."""

    file: str
    sha256: str
    libraries: dict[str, str]


class ManifestSurface(Struct, frozen=True):
    """Surface with the values that the simulator takes."""

    word: str
    friction: float
    derived: str
    color: tuple[int, int, int]
    sonar_reflectivity: float | None


class Manifest(Document, frozen=True, kw_only=True):
    """Keys that manifests of all simulators have."""

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


def _manifest(scene: Scene, key: str, written: WrittenFiles, source: Path | None) -> dict[str, Any]:
    """Manifest: keys of all simulators, then those of this one alone."""
    west, south, east, north = scene.terrain.bounds
    x, y, _ = scene.zero
    head = Manifest(
        target=key,
        summary=written.summary,
        source=_source(source, scene.terrain.libraries),
        descr=scene.terrain.descr,
        origin=scene.zero,
        bounds=(west - x, south - y, east - x, north - y),
        max_error=scene.options.max_error
        if written.meshed or "collision" in written.facts
        else None,
        surfaces={
            one.name: ManifestSurface(
                one.word, one.friction, one.derivation, one.color, one.reflectivity
            )
            for one in _used_materials(scene, written.meshed)
        },
        losses=tuple(_losses(scene, written)),
        mesh=scene.loss if written.meshed else UNSET,
    )
    return {**plain_document(head), **written.facts}


def _refuse_missing(path: Path) -> None:
    """Refuse a definition that cannot be found.

    Raises:
        ReadError: the file cannot be found.
    """
    try:
        path.stat()
    except OSError as error:
        raise ReadError.of(path, error) from error


def _source(path: Path | None, libraries: Iterable[str]) -> ManifestSource | None:
    """Hashes of the definition and its libraries; None where it came from no file."""
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


def _losses(scene: Scene, written: WrittenFiles) -> Iterator[str]:
    """Yield sentences on what the files lose."""
    if written.meshed:
        *walls, lost = scene.loss.sentences()
        yield from walls
        apart = "error" in written.facts.get("collision", {})
        yield lost.replace("Lost", "Lost of the mesh, which is only seen", 1) if apart else lost
    yield from written.losses
    held = _frictions(scene, written)
    assumed = [printable(one.name) for one in held if one.derivation.startswith("assumed")]
    if assumed:
        names = ", ".join(assumed)
        yield f"Friction {scene.options.friction:g} is assumed, as there is no fricAngle: {names}."


def _readme(scene: Scene, target: Target, written: WrittenFiles) -> str:
    """Return the README: loading, content, frictions and losses of the files."""
    lines = [f"# {scene.name} in {target.title}", ""]
    for text in filter(None, (scene.terrain.descr, f"Here: {written.summary}.")):
        lines += [text, ""]
    lines += [f"```{written.language}", *written.load, "```", ""]
    for note in written.notes:
        lines += [note, ""]
    zero = coordinates(scene.zero)
    lines += [f"Zero is at {zero} of the world; x points east, y north, z up, in metres.", ""]
    held = _frictions(scene, written)
    lines += ["| surface | friction | from |", "|---|---|---|"] * bool(held)
    for one in held:
        cells = escape_markdown(one.name), f"{one.friction:.4g}", one.derivation
        lines.append(markdown_row(cells))
    lines += [*[""] * bool(held), *_losses(scene, written), ""]
    return "\n".join([*lines_of("\n".join(lines)), ""])


def _frictions(scene: Scene, written: WrittenFiles) -> Sequence[Material]:
    """Return the materials whose friction is in the files."""
    own = written.frictions
    return _used_materials(scene, written.meshed) if own is None else own


def _used_materials(scene: Scene, meshed: bool) -> list[Material]:
    """Return the materials of a scene; where no mesh has them, those of its storeys, too."""
    found, storeys = scene.used_materials(meshed), scene.terrain.storeys
    if meshed or storeys is None:
        return found
    is_void = [surface.void is True for surface in scene.terrain.surface_types.values()]
    worn = {
        -1 if surface == sheet.bare else surface
        for sheet in storeys.sheets
        for surface in sheet.top.arrays.worn.tolist()
        if surface == sheet.bare or (surface < len(is_void) and not is_void[surface])
    }
    names = {one.name for one in (*found, *map(scene.material, worn))}
    return [one for one in scene.materials if one.name in names]
