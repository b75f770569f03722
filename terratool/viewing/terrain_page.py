"""The page of a terrain: made, written into a file, or shown within a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from terratool.errors import RequestError
from terratool.output import refuse_existing, refuse_missing_folder, whole_file
from terratool.traversability.assess import assess
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.request import Request
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.headings import Progress
from terratool.traversability.vehicle import Vehicle
from terratool.viewing.mesh import PageOptions
from terratool.viewing.options import Line
from terratool.viewing.pages import page_of
from terratool.viewing.places import Site
from terratool.viewing.scene import PageScene, scene_of

SUFFIXES = (".html", ".htm")
"""Suffixes of files that hold a page."""
HEIGHT = 600
"""Height of a page within a notebook, pixels."""


@dataclass(frozen=True, slots=True)
class TerrainPage:
    """A page that shows a terrain; a notebook shows it where it is the value of a cell.

    Attributes:
        text: HTML text, one file that asks nothing of the net.
        facts: names, numbers, lines and verdicts of the page's scene.
        height: height of the page within a notebook, pixels.
    """

    text: str
    facts: Mapping[str, Any]
    height: int = HEIGHT

    def __repr__(self) -> str:
        return f"<a page of {len(self.text):,} letters; write(path) makes a file of it>"

    def _repr_html_(self) -> str:
        """Frame that holds the page, and lets it do no more than run its script."""
        return (
            f'<iframe srcdoc="{escape(self.text)}" sandbox="allow-scripts" width="100%" '
            f'height="{self.height:d}" style="border: 0"></iframe>'
        )

    def write(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write the page into a file, and return its path.

        Raises:
            RequestError: the suffix is not that of a page.
            WriteError: the file exists and is not to be overwritten, or cannot be written.
        """
        path = check_page(path, overwrite)
        with whole_file(path, overwrite) as part:
            part.write_text(self.text, encoding="utf-8", newline="\n")
        return path


def check_page(path: str | Path, overwrite: bool = False) -> Path:
    """Refuse a page that cannot be written, before any work; return its path.

    Raises:
        RequestError: the suffix is not that of a page.
        WriteError: the file exists and is not to be overwritten, or has no folder.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise RequestError(f"{path}: is no name of a page.", "Choose one that ends in .html.")
    refuse_existing(path, overwrite)
    refuse_missing_folder(path)
    return path


class SilentProgress:
    """A listener to progress that says nothing."""

    def __call__(self, more: float, /) -> None:
        """Take the number of pixels done."""

    def say(self, what: str, total: int | None = None, /) -> None:
        """Take the step that begins."""


def terrain_scene(
    site: Site,
    options: PageOptions | None = None,
    vehicle: Vehicle | None = None,
    routes: tuple[Line, ...] = (),
    progress: Progress | None = None,
) -> PageScene:
    """Make the scene of a page, with the verdicts on a vehicle and its ways.

    Args:
        site: the terrain and its texts.
        options: options of the mesh; the defaults if None.
        vehicle: vehicle that is judged; None for none.
        routes: x and y of the start and of the goal of each way of the vehicle.
        progress: listener to the progress.

    Raises:
        RequestError: there is no ground, a place lies outside, or a route has no vehicle.
    """
    progress = progress or SilentProgress()
    if routes and vehicle is None:
        raise RequestError("A route needs a vehicle.", "Add --vehicle.")
    report = None if vehicle is None else _judge(site, vehicle, routes, progress)
    return scene_of(site, options, report, progress.say)


def _judge(
    site: Site, vehicle: Vehicle, routes: tuple[Line, ...], progress: Progress
) -> TraversabilityReport:
    """Report on the vehicle: the map, and the routes that are asked for."""
    prepared = prepare_assessment(site.terrain, vehicle, Request(routes=routes))
    progress.say("judging", prepared.pixels)
    return assess(prepared, name=site.name, progress=progress)


def terrain_page(title: str, scene: PageScene, height: int = HEIGHT) -> TerrainPage:
    """Make the page of a scene.

    Args:
        title: name of the terrain.
        scene: scene, from `terrain_scene`.
        height: height of the page within a notebook, pixels.

    Raises:
        ReadError: three.js is not found.
    """
    return TerrainPage(page_of(title, scene.to_bytes()), scene.facts, height)
