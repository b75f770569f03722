"""`terratool render`."""

from __future__ import annotations

import contextlib
import itertools
from functools import partial
from typing import Any

import click

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    WordChoice,
    json_option,
    library_root_option,
    output_argument,
    overwrite_option,
    roughness_option,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, load
from terratool.report.documents import Document

# equal to those of terratool.viewing.layers, which is not imported for --help; a test checks
LAYERS = (
    "height", "slope", "surface", "friction", "clearance", "storeys", "traversability",
    "traversability-worst", "foothold",
)  # fmt: skip


class _Interval(click.ParamType[Any]):
    """Parameter that is a number or "auto"; its error hints at a file that follows by mistake."""

    name = "interval"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, float) or value == "auto":
            return value
        try:
            return float(value)
        except ValueError:
            self.fail(f"{value!r} is no number. Give a height after --contours, or write it last.")


class _Render(Command):
    """Command that refuses a number below 0 after --contours as a number, not as an option."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        for option, word in itertools.pairwise(args):
            if option == "--contours" and word.startswith("-"):
                with contextlib.suppress(ValueError):
                    _refuse_interval(float(word))
        return super().parse_args(ctx, args)


def _refuse_interval(interval: float) -> None:
    from terratool.viewing.options import RenderOptions

    RenderOptions(contours=interval).check()


@click.command(
    "render",
    cls=_Render,
    epilog="Example: terratool render samples/nested-site.json site.png --contours 2 --grid",
)
@click.argument("file")
@output_argument
@option_group(
    "What is drawn",
    click.option(
        "--layer",
        type=WordChoice(LAYERS),
        default="surface",
        show_default=True,
        metavar="NAME",
        help=f"What the colours show: {', '.join(LAYERS)}.",
    ),
    click.option(
        "--vehicle",
        metavar="V.json",
        help="The vehicle of --layer traversability, its worst heading, or foothold.",
    ),
    click.option(
        "--bounds", nargs=4, type=float, metavar="W S E N", help="Rectangle of the world."
    ),
    click.option(
        "--contours",
        is_flag=False,
        flag_value="auto",
        type=_Interval(),
        metavar="[INTERVAL]",
        help="Draw contours so far apart, in units of the terrain; by itself about eight.",
    ),
    click.option(
        "--cut",
        type=float,
        metavar="Z",
        help="Draw the highest tops that are not above Z: a lower storey without what is over it.",
    ),
    click.option(
        "--grid", is_flag=True, help="Draw nested cells, and what elements are said to be."
    ),
)
@option_group(
    "From the side",
    click.option(
        "--profile",
        nargs=4,
        type=float,
        metavar="X0 Y0 X1 Y1",
        help="Draw a section from one point to another instead of a plan.",
    ),
    click.option(
        "--perspective", is_flag=True, help="Draw a view from the side instead of a plan."
    ),
    click.option(
        "--azimuth",
        type=float,
        default=215.0,
        show_default=True,
        metavar="DEG",
        help="From where that is seen, clockwise from north, -360 to 360.",
    ),
    click.option(
        "--elevation",
        type=float,
        default=35.0,
        show_default=True,
        metavar="DEG",
        help="How high over the horizon that is; below 0: undersides.",
    ),
    click.option(
        "--max-error",
        type=float,
        metavar="E",
        help="The largest error of its mesh.  [default: half a pixel of the picture]",
    ),
    click.option(
        "--exaggeration",
        type=float,
        metavar="F",
        help="Factor on the heights of both.  [default: 1, or more where the relief is below 1/20 "
        "of the width]",
    ),
)
@option_group(
    "The sheet",
    click.option(
        "--pixels",
        type=int,
        default=1600,
        show_default=True,
        metavar="N",
        help="Of the longer side, 200 to 4,096; 3 inches or more unless --bare is given.",
    ),
    click.option(
        "--dpi",
        type=float,
        default=150.0,
        show_default=True,
        metavar="N",
        help="Pixels of an inch: with more, letters are larger.",
    ),
    click.option(
        "--title", metavar="TEXT", help='Over the picture.  [default: the "descr" of FILE]'
    ),
    click.option("--no-legend", is_flag=True, help="Leave out what the colours mean."),
    click.option("--bare", is_flag=True, help="Leave out letters, axes and legend."),
)
@overwrite_option("Replace an existing file.")
@json_option("Say what was drawn as JSON.")
@roughness_option
@library_root_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    file: str,
    output: str,
    no_legend: bool,
    overwrite: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Draw the terrain FILE into the picture OUT: .png, .svg or .pdf.

    A plan shows the surfaces in their colours with light from the north-west, axes, a scale bar and
    an arrow to the north. --profile draws a section with upright walls instead, --perspective a
    view from the side. However fine the terrain is, only the pixels of the picture are painted.
    The same FILE and options give the same bytes.
    """
    from terratool.viewing.options import RenderOptions, refuse_idle
    from terratool.viewing.profile import check_section
    from terratool.viewing.render import check_request, render

    source = ctx.get_parameter_source
    refuse_idle(
        {name for name in options if source(name) is click.core.ParameterSource.COMMANDLINE},
        options["perspective"],
    )
    wanted = RenderOptions(legend=not no_legend, **options)
    _refuse_own(output, (file, options["vehicle"]))
    check_request(output, wanted, overwrite)
    early = None if wanted.profile is None else partial(check_section, wanted.profile)
    terrain = load(file, wanted.bounds, early, storeys="kept")
    with StatusLine("drawing") as status:
        report = render(terrain, output, wanted, overwrite=overwrite, progress=status.say)
    if as_json:
        say_json(
            PictureDocument(
                file=str(report.path),
                width=report.width,
                height=report.height,
                what=report.what,
                notes=list(report.notes),
            )
        )
        return
    say(f"{report.path}: {report.width:,} × {report.height:,} pixels, {report.what}")
    for note in report.notes:
        say(f"  {note}")


class PictureDocument(Document, frozen=True, kw_only=True):
    """Picture that was drawn, as JSON."""

    file: str
    width: int
    height: int
    what: str
    notes: list[str]


def _refuse_own(output: str, sources: tuple[str | None, ...]) -> None:
    """Refuse an output that is one of the inputs."""
    from terratool.errors import WriteError
    from terratool.output import is_same_file

    for source in sources:
        if source is not None and is_same_file(output, source):
            raise WriteError(f"{output}: is read, too.", "Choose another name.")
