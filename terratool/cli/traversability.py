"""`terratool traversability`."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

import click

from terratool.cli.options import Names, vehicle_from, vehicle_options
from terratool.cli.terminal import Status, load, say

if TYPE_CHECKING:
    from terratool.traversability.conditions import Condition

# as route.graph, vehicle and ranges of terratool.traversability have them, which are not imported
# for --help; tests hold them equal
PREFERENCES = ("length", "time", "energy", "margin")
MODELS = ("slip", "paper")
SAMPLES = (256, 16, 1024)  # the default, least and most


@click.command(
    "traversability",
    epilog="Example: terratool traversability samples/ramp-yard.json "
    "--vehicle samples/vehicles/husky-a200.json --route 4 60 70 8 --report yard.html",
)
@click.argument("file")
@vehicle_options
@click.option(
    "--model",
    type=Names(MODELS),
    default=MODELS[0],
    show_default=True,
    metavar="WHAT",
    help="How wheel and soil are computed: slip, or what the paper says (section 3.6).",
)
@click.option(
    "--report",
    "reports",
    multiple=True,
    metavar="OUT.json|.md|.html|.geojson",
    help="Write a report, once or several times; as .geojson the routes alone.",
)
@click.option(
    "--map",
    "map_",
    metavar="OUT.tif",
    help="Write the map, and beside it OUT-classes.tif and OUT-numbers.tif.",
)
@click.option(
    "--route",
    "routes",
    nargs=4,
    type=float,
    multiple=True,
    metavar="X0 Y0 X1 Y1",
    help="Look for a way, once or several times.",
)
@click.option(
    "--waypoints",
    multiple=True,
    metavar="FILE",
    help="Check the way through the points of a CSV or GeoJSON file.",
)
@click.option(
    "--return",
    "returns",
    is_flag=True,
    help="Look for the way back, too.",
)
@click.option(
    "--from",
    "--reachable",
    "start",
    nargs=2,
    type=float,
    metavar="X Y",
    help="Say what can be reached from here.  [default: the largest part of the ground]",
)
@click.option(
    "--prefer",
    type=Names(PREFERENCES),
    default="time",
    show_default=True,
    metavar="WHAT",
    help=f"What a route is to be the best of: {', '.join(PREFERENCES)}.",
)
@click.option(
    "--resolution",
    type=float,
    metavar="R",
    help="Side of a pixel.  [default: a sixth of the vehicle's width for routes, else a quarter of "
    "a wheel's radius; or coarser]",
)
@click.option(
    "--bounds", nargs=4, type=float, metavar="W S E N", help="World rectangle to look at."
)
@click.option(
    "--headings",
    type=click.IntRange(4, 64),
    metavar="N",
    help="Headings at each place, a multiple of 4.  [default: 8; where these show no way 16, then "
    "32]",
)
@click.option(
    "--samples",
    type=click.IntRange(*SAMPLES[1:]),
    default=SAMPLES[0],
    show_default=True,
    metavar="N",
    help="Samples of soils whose figures are ranges, for probabilities of go.",
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**63 - 1),
    default=0,
    show_default=True,
    metavar="N",
    help="Seed of these samples.",
)
@click.option(
    "--fail-on",
    "conditions",
    multiple=True,
    metavar="WHAT",
    help="End with 1 if no-route, caution, no-go or unknown, or on a figure: no-go-fraction>0.3.",
)
@click.option("--threads", type=click.IntRange(1), metavar="N", help="Default: all processors.")
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
@click.option("--json", "as_json", is_flag=True, help="Write the report as JSON, no table.")
def command(
    file: str,
    model: str,
    reports: tuple[str, ...],
    map_: str | None,
    routes: tuple[tuple[float, float, float, float], ...],
    waypoints: tuple[str, ...],
    returns: bool,
    start: tuple[float, float] | None,
    prefer: Any,
    resolution: float | None,
    bounds: tuple[float, float, float, float] | None,
    headings: int | None,
    samples: int,
    seed: int,
    conditions: tuple[str, ...],
    threads: int | None,
    overwrite: bool,
    as_json: bool,
    **values: Any,
) -> int:
    """Say whether a vehicle can drive on the terrain FILE, where not, and why.

    For each surface: how deep the wheels sink, what they pull, what they climb. For each place and
    heading: go, caution or no-go, and what binds; --map writes that. --route looks for a way, and
    says what bars it where there is none; the command ends with 1 then. With a route and without
    --map, --report or --from only the ground that matters to it is looked at.

    --fail-on compares a figure by >, >=, < or <=: go-, caution-, no-go-, unknown-, one-way-,
    cut-off-, edge- or reachable-fraction, route-length (m), route-time (s), route-energy (J),
    least-margin, steepest (degrees), sinkage (m).
    """
    from pathlib import Path

    from terratool.output import whole_file
    from terratool.text.display import printable
    from terratool.traversability.assess import Request, assess, first_look, prepare_assessment
    from terratool.traversability.conditions import parse
    from terratool.traversability.report import document, tables
    from terratool.traversability.route.waypoints import read_waypoints

    checks = [parse(text) for text in conditions]
    travels = bool(routes or waypoints)
    lines_only = [path for path in reports if Path(path).suffix.lower() == ".geojson"]
    _refuse_unasked(checks, travels, start is not None, [*lines_only, *["--return"] * returns])
    renderers = [document.renderer_of(path) for path in reports]
    _refuse_outputs(file, values["vehicle"], waypoints, reports, map_, overwrite)
    vehicle = vehicle_from(values).by_model(model)
    wants_map = map_ is not None or len(lines_only) < len(reports)
    request = Request(
        routes=routes,
        waypoints=tuple(map(read_waypoints, waypoints)),
        returns=returns,
        start=start,
        prefer=prefer,
        resolution=resolution,
        bounds=bounds,
        headings=headings,
        mapped=wants_map or any(check.needs == "map" for check in checks),
        threads=threads,
        samples=samples,
        seed=seed,
    )
    planned = prepare_assessment(load(file), vehicle, request, map_path=map_, overwrite=overwrite)

    doing = "judging" if planned.pixels else "looking for ways"
    # every file is complete before the first one takes its place
    with Status(doing, planned.pixels) as progress, contextlib.ExitStack() as stack:
        parts = [stack.enter_context(whole_file(path, overwrite)) for path in reports]
        for line in first_look(planned):
            progress.clear()
            click.echo(f"terratool: {printable(line)}", err=True)
        report = assess(
            planned, name=Path(file).name, map_path=map_, overwrite=overwrite, progress=progress,
            stack=stack,
        )  # fmt: skip
        if parts or map_:
            progress.say("writing files")
        for part, render in zip(parts, renderers, strict=True):
            part.write_text(render(report), encoding="utf-8", newline="\n")
    held = [(check.text, why) for check in checks if (why := check.held(report))]
    lost = not all(route.holds for route in report.routes)
    code = int(bool(held or lost or (report.reach is not None and report.reach.note)))
    try:
        if as_json:
            click.echo(document.as_json(report), nl=False)
        else:
            for line in tables.as_lines(report):
                say(line)
    except BrokenPipeError:
        if not code:  # a "no" is one, whether somebody reads on or not
            raise
    for text, why in held:
        click.echo(f"terratool: --fail-on {printable(text.strip())}: {why}.", err=True)
    return code


def _refuse_unasked(
    checks: list[Condition], routed: bool, reaching: bool, others: list[str]
) -> None:
    """Refuse conditions on what is not asked for, and what else makes no sense without a route."""
    if others and not routed:
        raise click.UsageError(
            f"{others[0]} needs a route. Add --route X0 Y0 X1 Y1 or --waypoints FILE."
        )
    for check in checks:
        if check.needs == "route" and not routed:
            raise click.UsageError(
                f"--fail-on {check.text} needs a route. Add --route X0 Y0 X1 Y1 or --waypoints "
                "FILE."
            )
        if check.needs == "reach" and not reaching:
            raise click.UsageError(f"--fail-on {check.text} needs --from X Y.")


def _refuse_outputs(
    file: str,
    vehicle: str | None,
    waypoints: tuple[str, ...],
    reports: tuple[str, ...],
    map_: str | None,
    overwrite: bool,
) -> None:
    """Refuse files that cannot be, or that are something else, before any work."""
    import os
    from pathlib import Path

    from terratool.errors import RequestError, WriteError
    from terratool.output import is_same_file, refuse_existing, refuse_missing_folder
    from terratool.raster.export import COMPANIONS
    from terratool.traversability.map_files import map_paths

    outputs: dict[str, str] = {}
    names: list[tuple[str, tuple[str, ...]]] = [(path, ()) for path in reports]
    if map_ is not None:
        names += [(str(path), COMPANIONS) for path in map_paths(map_)]
    for name, companions in names:
        real = os.path.realpath(name)
        if real in outputs:
            raise RequestError(
                f"{name}: is to be written twice, also as {outputs[real]}.",
                "Give each file a name of its own.",
            )
        outputs[real] = name
        for source in (file, vehicle, *waypoints):
            if source and is_same_file(name, source):
                raise WriteError(f"{name}: is read, too, as {source}.", "Choose another name.")
        refuse_existing(Path(name), overwrite, companions)
        refuse_missing_folder(Path(name))
