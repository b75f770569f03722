"""The simulators that files can be written for, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from terratool.errors import RequestError
from terratool.extras import install_command
from terratool.report.wording import join_words
from terratool.text.display import quote
from terratool.text.meaning import guess, near_names

if TYPE_CHECKING:
    from terratool.simulators.scene import Material, Scene


@dataclass(frozen=True, slots=True)
class WrittenFiles:
    """Account of the files that a writer has written.

    Attributes:
        summary: the files in a few words.
        load: lines of a program or shell that load the files.
        language: language of `load`, as Markdown names it.
        notes: further paragraphs for whoever uses the files.
        losses: sentences on what the files cannot hold, or hold only roughly.
        facts: figures for programs, ready for JSON.
        meshed: whether the files hold the mesh of the scene.
        frictions: materials whose friction the files hold; None for all that the scene uses.
        scene: scene whose mesh the files hold, if that is a part of the ground alone; else None.
    """

    summary: str
    load: tuple[str, ...]
    language: str
    notes: tuple[str, ...] = ()
    losses: tuple[str, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)
    meshed: bool = True
    frictions: tuple[Material, ...] | None = None
    scene: Scene | None = None


@dataclass(frozen=True, slots=True)
class Target:
    """A simulator that files can be written for.

    Attributes:
        title: name of the simulator for people.
        writer: module in `terratool.simulators` whose `write` puts files into a folder; its
            `check`, if it has one, refuses in a moment what cannot be written.
        needs: module that has to be installed, its package, and the extra of terratool that has
            it; empty for nothing.
    """

    title: str
    writer: str
    needs: tuple[str, str, str] | tuple[()] = ()

    @property
    def write(self) -> Callable[[Scene, Path], WrittenFiles]:
        """Function that writes the files of a scene into an existing folder."""
        writer: Callable[[Scene, Path], WrittenFiles] = self._module.write
        return writer

    def check(self, scene: Scene) -> None:
        """Refuse a scene that cannot be written, before any long work.

        Raises:
            RequestError: the scene cannot be written.
        """
        if hasattr(self._module, "check"):
            self._module.check(scene)

    @property
    def _module(self) -> ModuleType:
        return import_module(f"terratool.simulators.{self.writer}")


TARGETS = {
    "mujoco": Target("MuJoCo", "mujoco"),
    "gazebo": Target("Gazebo", "gazebo"),
    "pybullet": Target("PyBullet", "bullet"),
    "usd": Target("USD physics", "usd", ("pxr", "usd-core", "usd")),
    "chrono": Target("Project Chrono", "chrono"),
    "nav2": Target("Nav2", "nav2"),
    "grid-map": Target("grid_map", "grid_map", ("rosbags", "rosbags", "ros")),
}


def choose_targets(names: tuple[str, ...]) -> dict[str, Target]:
    """Return targets by name, in the order of the table; "all" is all of them.

    Raises:
        RequestError: a name is of no target, or no target is named.
    """
    if not names:
        raise RequestError(
            "No target is named.", f"Name one with --target: {', '.join(TARGETS)}, or all."
        )
    for name in names:
        if name not in TARGETS and name != "all":
            raise RequestError(f"There is no target {quote(name)}.", _hint_on(name))
    return {name: one for name, one in TARGETS.items() if name in names or "all" in names}


def _hint_on(name: str) -> str:
    """Return a hint on a name that is of no target."""
    known = [*TARGETS, "all"]
    parts = name.replace(",", " ").split()
    near = [near_names(part, known)[:1] for part in parts]
    if len(near) > 1 and all(near):
        return f"Name each by itself: {_as_options([name for (name,) in near])}."
    # a name among several is no guess for all of them
    return guess(name, known) * (len(parts) == 1) or f"Choose from {', '.join(TARGETS)}, or all."


def refuse_uninstalled(targets: Mapping[str, Target]) -> None:
    """Refuse targets that need a package which is not installed.

    Raises:
        RequestError: a package is not installed.
    """
    missing = {
        name: one.needs[1:]
        for name, one in targets.items()
        if one.needs and find_spec(one.needs[0]) is None
    }
    if missing:
        packages = join_words([f"{package} for {name}" for name, (package, _) in missing.items()])
        install = install_command(*(extra for _, extra in missing.values()))
        rest = _as_options([name for name in targets if name not in missing])
        raise RequestError(
            f"Not installed: {packages}.",
            f"Choose the others ({rest}), or run {install}" if rest else f"Run {install}",
        )


def _as_options(names: Sequence[str]) -> str:
    """Return targets as options of a command."""
    return " ".join(f"--target {name}" for name in names)
