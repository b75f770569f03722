"""Pictures of a terrain: a plan, a section or a perspective, as PNG, SVG or PDF."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from terratool.field.coarse import coarse
from terratool.field.terrain import Terrain
from terratool.output import refuse_existing, refuse_missing_folder, whole_file
from terratool.traversability.judge import Judge
from terratool.viewing.options import RenderOptions, RenderReport, picture_format
from terratool.viewing.perspective import draw_perspective
from terratool.viewing.plan import Drawn, draw_plan
from terratool.viewing.section_sheet import draw_section
from terratool.viewing.sheet import encoded, require_matplotlib, settings, write

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Progress = Callable[[str], object]
"""A function that is called with words on the step that begins."""


def check_request(path: str | Path, options: RenderOptions, overwrite: bool = False) -> Path:
    """Refuse a picture that cannot be drawn, before a terrain is read.

    Raises:
        RequestError: an option makes no sense, the suffix says no format, or Matplotlib is missing.
        WriteError: the file exists and is not to be overwritten, or has no folder.
    """
    path = Path(path)
    picture_format(path)
    options.check()
    require_matplotlib()
    refuse_existing(path, overwrite)
    refuse_missing_folder(path)
    return path


def render(
    terrain: Terrain,
    path: str | Path,
    options: RenderOptions | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = lambda _: None,
) -> RenderReport:
    """Draw a terrain into a file. Equal terrains and options give equal bytes.

    Args:
        terrain: the terrain.
        path: path of the picture, a .png, .svg or .pdf.
        options: options of the picture; a plan of the surfaces if None.
        overwrite: whether the picture may exist already.
        progress: called with words on the step that begins.

    Raises:
        RequestError: an option makes no sense for this terrain, or Matplotlib is missing.
        ReadError, DefinitionError: the vehicle cannot be read, or has errors.
        WriteError: the file exists and is not to be overwritten, or cannot be written.
    """
    options = RenderOptions() if options is None else options
    path = check_request(path, options, overwrite)
    with settings():
        drawn = _draw(terrain, options, progress)
        progress("writing")
        with whole_file(path, overwrite) as part:
            write(drawn.sheet, part)
    sheet = drawn.sheet
    return RenderReport(path, sheet.width, sheet.height, drawn.what, drawn.notes)


def figure_of(terrain: Terrain, options: RenderOptions | None = None) -> Figure:
    """Draw a terrain as a figure of Matplotlib; arguments and errors are those of `render`."""
    options = RenderOptions() if options is None else options
    options.check()
    with settings():
        return _draw(terrain, options).sheet.figure


def png_of(terrain: Terrain, options: RenderOptions | None = None) -> bytes:
    """Draw a terrain as the bytes of a PNG; arguments and errors are those of `render`."""
    options = RenderOptions() if options is None else options
    options.check()
    with settings():
        return encoded(_draw(terrain, options).sheet, ".png")


def _draw(terrain: Terrain, options: RenderOptions, progress: Progress = lambda _: None) -> Drawn:
    """Draw a section, a perspective or a plan, within `settings`."""
    judge = None if options.vehicle is None else Judge.of(options.vehicle)
    terrain = terrain if options.has_storeys else terrain.ground_alone
    terrain, notes = coarse(terrain, options.bounds)
    if options.profile is not None:
        drawn = draw_section(terrain, options, progress)
    elif options.perspective:
        drawn = draw_perspective(terrain, options, judge, progress)
    else:
        drawn = draw_plan(terrain, options, judge, progress)
    return drawn._replace(notes=(*drawn.notes, *notes, *terrain.hidden))
