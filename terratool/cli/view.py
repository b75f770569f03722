"""`terratool view`."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    has_roughness,
    json_option,
    library_root_option,
    library_roots,
    output_option,
    overwrite_option,
    roughness_option,
    vehicle_from,
    vehicle_option,
    wheel_options,
)
from terratool.cli.saying import flush, say, say_error, say_json
from terratool.cli.terminal import StatusLine, short_name
from terratool.report.documents import Document

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from terratool.errors import TerratoolError
    from terratool.traversability.vehicle import Vehicle
    from terratool.viewing.mesh import PageOptions
    from terratool.viewing.places import Site
    from terratool.viewing.scene import PageScene

Routes = tuple[tuple[float, float, float, float], ...]
_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER", "WSL_DISTRO_NAME")
"""Environment variables of which one is set where Linux can open a window."""


@click.command(
    "view",
    cls=Command,
    epilog="\b\nExamples: terratool view samples/warehouse.json\n"
    "          terratool view site.json -o site.html --no-open\n"
    "          terratool view site.json --watch",
)
@click.argument("file")
@option_group(
    "Page",
    output_option("Where the page goes.  [default: a new folder among the temporary ones]"),
    click.option("--no-open", is_flag=True, help="Do not open the page in a browser."),
    click.option(
        "--watch",
        is_flag=True,
        help="Serve the page to this machine alone, and draw it again whenever FILE is saved.",
    ),
    click.option(
        "--port",
        type=click.IntRange(0, 65535),
        metavar="N",
        help="The port of --watch.  [default: any that is free]",
    ),
)
@option_group(
    "Ground",
    click.option(
        "--max-error",
        type=float,
        metavar="E",
        help="How far the ground may be from the terrain, along z, anywhere.  [default: 0.001, or "
        "as small as about 200,000 faces allow, 40,000 with --watch]",
    ),
    click.option(
        "--max-faces",
        type=int,
        metavar="N",
        help="Enlarge the error, and then leave out the lowest elements, until there are no more.",
    ),
)
@option_group(
    "Verdicts",
    vehicle_option,
    click.option(
        "--route",
        "routes",
        nargs=4,
        type=float,
        multiple=True,
        metavar="X0 Y0 X1 Y1",
        help="Draw a way of the vehicle, once or several times.",
    ),
)
@wheel_options
@overwrite_option("Replace a page that exists.")
@json_option()
@roughness_option
@library_root_option
def command(
    file: str,
    output: str | None,
    no_open: bool,
    watch: bool,
    port: int | None,
    routes: Routes,
    max_error: float | None,
    max_faces: int | None,
    overwrite: bool,
    as_json: bool,
    **values: Any,
) -> int:
    """Show the terrain FILE in a browser: turn it, ask what is where, switch layers.

    The page is one file, and asks nothing of the net. Where there is no way for a --route, the page
    is written and the exit code is 1. With --watch it is served at 127.0.0.1 until
    Ctrl-C. Where FILE is broken it keeps the last good picture, with the findings beside it.
    """
    from terratool.viewing.mesh import PageOptions
    from terratool.viewing.pages import three_js
    from terratool.viewing.places import read_site
    from terratool.viewing.terrain_page import terrain_scene

    if watch and output is not None:
        raise click.UsageError("--watch serves the page, and --output writes it. Drop one of them.")
    if watch and as_json:
        raise click.UsageError("--json is about a page that is written. Drop it, or --watch.")
    if watch and file == "-":
        raise click.UsageError("--watch needs a file, and - is none. Name a file.")
    if port is not None and not watch:
        raise click.UsageError("--port is about --watch. Add that, or leave out --port.")
    wheeled = any(value is not None for value in values.values())
    if routes and not wheeled:
        raise click.UsageError("A route needs a vehicle. Add --vehicle V.json.")
    options = PageOptions(max_error, max_faces, live=watch)
    options.check()
    path = None if output is None else _page_path(output, file, overwrite)
    three_js()
    vehicle = vehicle_from(values) if wheeled else None
    if watch:
        _follow(file, options, vehicle, routes, port or 0, not no_open)
    with StatusLine(f"reading {short_name(file)}") as status:
        site = read_site(file, library_roots(), roughness=has_roughness())
        scene = terrain_scene(site, options, vehicle, routes, status)
        status.say("writing the page")
        written = _write(file, scene, path, overwrite)
    if as_json:
        say_json(written)
    else:
        for line in _lines(written):
            say(line)
    if not no_open and not _open(Path(written.file).resolve().as_uri()):
        say("No browser can be opened here. Open the page in yours.", err=True)
    lost = [route["note"] for route in written.routes if not route["found"]]
    for note in lost:
        say_error(f"There is no such route. {note}")
    return int(bool(lost))


class PageDocument(Document, frozen=True, kw_only=True):
    """Page that was written, as JSON."""

    file: str
    bytes: int
    faces: int
    error: float
    measured: bool
    routes: list[dict[str, Any]]
    notes: list[str]


def _page_path(output: str, file: str, overwrite: bool) -> Path:
    """Path of the page; refuse one that cannot be written, before any work."""
    from terratool.errors import WriteError
    from terratool.output import is_same_file
    from terratool.viewing.terrain_page import check_page

    if is_same_file(output, file):
        raise WriteError(f"{output}: is the definition itself.", "Choose another name.")
    return check_page(output, overwrite)


def _write(file: str, scene: PageScene, path: Path | None, overwrite: bool) -> PageDocument:
    """Write the page and return what is to be said of it."""
    from terratool.viewing.terrain_page import terrain_page

    page = terrain_page(short_name(file), scene)
    path = page.write(_temporary(file) if path is None else path, overwrite)
    facts = scene.facts
    return PageDocument(
        file=str(path),
        bytes=len(page.text.encode()),
        faces=len(scene.arrays["elements"]),
        error=facts["error"],
        measured=facts["measured"],
        routes=[{key: route[key] for key in ("found", "note")} for route in facts["routes"]],
        notes=list(_notes(facts)),
    )


def _lines(written: PageDocument) -> Iterator[str]:
    """Lines for people on a page."""
    from terratool.report.numbers import metres
    from terratool.report.wording import count_of

    within = f"{count_of(written.faces, 'face')} within {metres(written.error)}"
    if written.measured:
        within += ", as far as measured"
    yield f"{written.file}: {within}, {written.bytes:,} bytes"
    for note in written.notes:
        yield f"  {note}"


def _notes(facts: dict[str, Any]) -> Iterator[str]:
    """Sentences on parts of the terrain that the page cannot show."""
    from terratool.report.numbers import metres
    from terratool.report.wording import count_of

    yield from facts["hidden"]
    if facts["left_out"]:
        yield (
            f"Left out: {count_of(facts['left_out'], 'element')}; "
            f"heights change by up to {metres(facts['change'])}."
        )
    if facts["grid"]:
        rows, columns, step = facts["grid"]
        yield (
            f"It is drawn from a grid of {rows:,} × {columns:,} heights, as there is too much for a"
            f" mesh. Walls are as wide as a step: {metres(step)}."
        )


def _temporary(file: str) -> Path:
    """Path of a page in a new folder that no other user can write to."""
    import tempfile

    from terratool.errors import WriteError

    try:
        folder = Path(tempfile.mkdtemp(prefix="terratool-"))
    except OSError as error:
        raise WriteError.of(tempfile.gettempdir(), error, "Name a page by -o OUT.") from error
    stem = "terrain" if file == "-" else Path(file).name.removesuffix(".gz").removesuffix(".json")
    return folder / f"{stem}.html"


def _follow(
    file: str, options: PageOptions, vehicle: Vehicle | None, routes: Routes, port: int,
    opens: bool,
) -> NoReturn:  # fmt: skip
    from terratool.text.source import read_source
    from terratool.viewing.live import FollowedFile, LiveState, PageServer, follow
    from terratool.viewing.pages import page_of
    from terratool.viewing.terrain_page import terrain_scene

    read_source(file, named=False)  # refuses what is no regular file
    state = LiveState()
    print_version = _version_printer(file)

    def scene(site: Site) -> PageScene:
        with StatusLine(f"drawing {short_name(file)}") as status:
            return terrain_scene(site, options, vehicle, routes, status)

    with PageServer(page_of(short_name(file), live=True), state, port) as server:
        say(f"{server.url} shows {file}; Ctrl-C ends it.")
        flush()
        if opens and not _open(server.url):
            say("No browser can be opened here. Open this address in yours.", err=True)
        follow(state, FollowedFile(file, library_roots(), has_roughness()), scene, print_version)


def _version_printer(file: str) -> Callable[[TerratoolError | None], object]:
    """Function that prints a line for each version of a file."""

    def print_version(problem: TerratoolError | None) -> None:
        if problem is None:
            say_error(f"{file}: drawn.")
        else:
            say_error(problem.message)

    return print_version


def _open(url: str) -> bool:
    """Open a page in a browser with a window; return whether there is one."""
    import webbrowser

    windows = sys.platform in ("darwin", "win32") or any(map(os.environ.get, _DISPLAYS))
    if not windows:
        return False
    try:
        return webbrowser.open(url)
    except (OSError, webbrowser.Error):
        return False
