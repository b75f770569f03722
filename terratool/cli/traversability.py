"""`terratool traversability`."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

import click

from terratool.cli.options import (
    WHEEL,
    WordChoice,
    library_root_option,
    roughness_option,
    vehicles_from,
    vehicles_options,
)
from terratool.cli.saying import say, say_block, say_error
from terratool.cli.terminal import StatusLine, load

if TYPE_CHECKING:
    from collections.abc import Callable

    from terratool.cli.config import Config, DriveSettings
    from terratool.traversability.assess import PreparedRequest, Request
    from terratool.traversability.conditions import Condition
    from terratool.traversability.results import Reports, TraversabilityReport
    from terratool.traversability.vehicle import Vehicle

# equal to those of route.graph, vehicle and ranges of terratool.traversability, which are not
# imported for --help; tests check
PREFERENCES = ("length", "time", "energy", "margin")
MODELS = ("slip", "paper")
SAMPLES = (256, 16, 1024)  # default, least, most


@click.command(
    "traversability",
    epilog="Example: terratool traversability samples/ramp-yard.json "
    "--vehicle samples/vehicles/husky-a200.json --route 4 60 70 8 --report yard.html",
)
@click.argument("files", nargs=-1, metavar="[FILE|DIR]...")
@vehicles_options
@click.option(
    "--model",
    type=WordChoice(MODELS),
    default=MODELS[0],
    show_default=True,
    metavar="WHAT",
    help="How wheel and soil are computed: slip, or what the paper says (section 3.6).",
)
@click.option(
    "--report",
    "reports",
    multiple=True,
    metavar="OUT.json|.md|.html|.geojson|.svg",
    help="Write a report, once or several times; as .geojson the routes alone, as .svg a picture "
    "of slip against slope.",
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
    type=WordChoice(PREFERENCES),
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
@click.option(
    "--format",
    "formats",
    multiple=True,
    metavar="FORM[=OUT]",
    help="How findings on files are written, as by validate: text, json, sarif, github, junit, "
    "gitlab.",
)
@click.option("--config", "config_file", metavar="FILE", help="Settings, in place of those found.")
@click.option("--threads", type=click.IntRange(1), metavar="N", help="Default: all processors.")
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
@click.option("--json", "as_json", is_flag=True, help="Write the report as JSON, no table.")
@roughness_option
@library_root_option
def command(
    files: tuple[str, ...],
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
    formats: tuple[str, ...],
    config_file: str | None,
    threads: int | None,
    overwrite: bool,
    as_json: bool,
    **values: Any,
) -> int:
    """Say whether a vehicle can drive on a terrain, FILE, where not, and why.

    For each surface: how deep the wheels sink, what they pull, what they climb. For each place and
    heading: go, caution or no-go, and what binds; --map writes that. --route looks for a way, and
    says what bars it where there is none; the command ends with 1 then. With a route and without
    --map, --report or --from only the ground that matters to it is looked at.

    Several --vehicle are compared; maps have the vehicles' names in theirs. The command ends with
    1 if it would with any of them alone.

    Of several FILEs, or the terrains in a DIR, a table says what becomes of each. What fails is
    a finding; all are judged, and the command ends with 1, or 3 if one cannot be read. Vehicles,
    routes, conditions and paths may stand in .terratool.toml, under [traversability].

    --fail-on compares a figure by >, >=, < or <=: go-, caution-, no-go-, unknown-, one-way-,
    cut-off-, edge- or reachable-fraction, route-length (m), route-time (s), route-energy (J),
    least-margin, steepest (degrees), sinkage (m).
    """
    from dataclasses import replace
    from pathlib import Path

    from terratool.cli.config import DriveSettings, project_settings
    from terratool.cli.gate import asked_of
    from terratool.output import whole_file
    from terratool.text.source import is_folder
    from terratool.traversability.assess import Request
    from terratool.traversability.compare import prepare
    from terratool.traversability.conditions import parse
    from terratool.traversability.report.formats import renderer_of
    from terratool.traversability.results import VehicleComparison
    from terratool.traversability.route.waypoints import read_waypoints

    settings = project_settings(config_file)
    for text in conditions:
        parse(text)
    wheel = any(values[name] is not None for name in WHEEL)
    own = DriveSettings(
        vehicles=values["vehicle"] or (() if wheel else None), routes=routes or None, start=start,
        fail_on=conditions or None, resolution=resolution,
    )  # fmt: skip
    base = Request(
        waypoints=tuple(map(read_waypoints, waypoints)), returns=returns, prefer=prefer,
        bounds=bounds, headings=headings, samples=samples, seed=seed, threads=threads,
    )  # fmt: skip

    def vehicles_of(paths: tuple[str, ...]) -> list[Vehicle]:
        return [one.by_model(model) for one in vehicles_from({**values, "vehicle": paths})]

    if len(files) != 1 or is_folder(files[0]) or formats:
        for option, given in (("--report", reports), ("--map", map_)):
            if given:
                raise click.UsageError(f"{option} is of one terrain. Name one FILE, or drop it.")
        return _judge_many(files, formats, settings, own, base, vehicles_of, as_json)
    (file,) = files
    asked = asked_of(file, own, settings)
    routes, start, resolution = asked.routes or (), asked.start, asked.resolution
    checks = [parse(text) for text in asked.fail_on or ()]
    travels = bool(routes or waypoints)
    lines_only, curves = (
        [path for path in reports if Path(path).suffix.lower() == suffix]
        for suffix in (".geojson", ".svg")
    )
    routed = [*lines_only, *["--return"] * returns]
    _refuse_unasked(checks, travels, start is not None, routed, curves, model)
    paths = asked.vehicles or ()
    renderers = list(map(renderer_of, reports))
    _refuse_outputs((file, *paths, *waypoints), reports, _maps(map_, paths), overwrite)
    vehicles = vehicles_of(paths)
    wants_map = map_ is not None or len(lines_only) + len(curves) < len(reports)
    request = replace(
        base,
        routes=routes,
        start=start,
        resolution=resolution,
        mapped=wants_map or any(check.needs == "map" for check in checks),
    )
    planned, notes = prepare(load(file), vehicles, request, map_path=map_, overwrite=overwrite)
    doing = "judging" if planned[0].pixels else "looking for ways"
    # every file is complete before the first one takes its place
    with StatusLine(doing, planned[0].pixels) as progress, contextlib.ExitStack() as stack:
        parts = [stack.enter_context(whole_file(path, overwrite)) for path in reports]
        found = _assess(planned, Path(file).name, map_, overwrite, progress, stack)
        result = VehicleComparison(found, notes) if len(found) > 1 else found[0]
        if parts or map_:
            progress.say("writing files")
        for part, render in zip(parts, renderers, strict=True):
            part.write_text(render(result), encoding="utf-8", newline="\n")
    return _print_result(result, checks, as_json)


def _judge_many(
    files: tuple[str, ...], formats: tuple[str, ...], settings: Config, own: DriveSettings,
    base: Request, vehicles: Callable[[tuple[str, ...]], list[Vehicle]], as_json: bool,
) -> int:  # fmt: skip
    """Judge several files; return the exit code."""
    from terratool.cli.gate import GatePlan, judge_many
    from terratool.cli.options import has_roughness, library_roots
    from terratool.cli.outputs import ReportPlan
    from terratool.raster.export import thread_count

    if as_json and any("=" not in text for text in formats):
        raise click.UsageError("Both --json and --format are for standard output. Keep one.")
    reports = ReportPlan.of(formats, settings.traversability.formats, settings)
    plan = GatePlan(
        files, reports, settings, own, base, vehicles, library_roots(), has_roughness(), as_json
    )
    return judge_many(plan, thread_count(base.threads))


def _assess(
    planned: list[PreparedRequest], name: str, map_: str | None, overwrite: bool,
    progress: StatusLine, stack: contextlib.ExitStack,
) -> tuple[TraversabilityReport, ...]:  # fmt: skip
    """Report on each vehicle; first print what its starts and goals show at once.

    Requests are removed from their list, one by one, as each holds much memory.
    """
    from terratool.traversability.assess import assess, first_look
    from terratool.traversability.compare import map_path_of

    several, found = len(planned) > 1, []
    for one in planned:
        whose = f"{one.vehicle.name}: " * several
        for line in first_look(one):
            progress.clear()
            say_error(whose + line)
    while planned:
        one, path = planned.pop(0), map_
        if several:
            progress.about(one.vehicle.name)
            progress.say("judging" if one.pixels else "looking for ways", one.pixels)
            path = map_ and str(map_path_of(map_, one.vehicle.name))
        report = assess(
            one, name=name, map_path=path, overwrite=overwrite, progress=progress, stack=stack
        )
        found.append(report)
    progress.about("")
    return tuple(found)


def _print_result(result: Reports, checks: list[Condition], wants_json: bool) -> int:
    """Print the result and the conditions that do not hold; return the exit code."""
    from terratool.traversability.report.document import as_json
    from terratool.traversability.report.lines import as_lines

    reports = result.reports
    several = len(reports) > 1
    held = [
        (check.text.strip(), f"{report.vehicle.name}: " * several + why)
        for report in reports
        for check in checks
        if (why := check.why_met(report))
    ]
    lost = not all(route.holds for report in reports for route in report.routes)
    nowhere = any(report.reach is not None and report.reach.note for report in reports)
    code = int(bool(held or lost or nowhere))
    try:
        if wants_json:
            say_block(as_json(result).removesuffix("\n"), machine=True)
        else:
            for line in as_lines(result):
                say(line)
    except BrokenPipeError:
        if not code:  # with a "no" the exit code stays 1 even if the reader has gone
            raise
    for text, why in held:
        say_error(f"--fail-on {text}: {why}.")
    return code


def _maps(map_: str | None, vehicles: tuple[str, ...]) -> list[str]:
    """Names of the maps that are asked for, one for each vehicle."""
    if map_ is None or len(vehicles) < 2:
        return [] if map_ is None else [map_]
    from terratool.traversability.compare import map_path_of, names_of

    return [str(map_path_of(map_, name)) for name in names_of(vehicles)]


def _refuse_unasked(
    checks: list[Condition], routed: bool, reaching: bool, others: list[str], curves: list[str],
    model: str,
) -> None:  # fmt: skip
    """Refuse conditions on results that are not asked for, and options that need a route."""
    if others and not routed:
        raise click.UsageError(
            f"{others[0]} needs a route. Add --route X0 Y0 X1 Y1 or --waypoints FILE."
        )
    for path in curves * (model == "paper"):
        raise click.UsageError(
            f"{path}: there is no slip in the model paper. Leave it out, or take --model slip."
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
    sources: tuple[str, ...], reports: tuple[str, ...], maps: list[str], overwrite: bool
) -> None:
    """Refuse outputs that cannot be written, or that are inputs, before any work."""
    import os
    from pathlib import Path

    from terratool.errors import RequestError, WriteError
    from terratool.io.pam import COMPANIONS
    from terratool.output import is_same_file, refuse_existing, refuse_missing_folder
    from terratool.traversability.map_files import map_paths

    outputs: dict[str, str] = {}
    named = {*map(Path, reports), *(map(Path, maps) if len(maps) == 1 else ())}
    names: list[tuple[str, tuple[str, ...]]] = [(path, ()) for path in reports]
    names += [(str(path), COMPANIONS) for map_ in maps for path in map_paths(map_)]
    for name, companions in names:
        real = os.path.realpath(name)
        if real in outputs:
            raise RequestError(
                f"{name}: is to be written twice, also as {outputs[real]}.",
                "Give each file a name of its own.",
            )
        outputs[real] = name
        for source in sources:
            if is_same_file(name, source):
                raise WriteError(f"{name}: is read, too, as {source}.", "Choose another name.")
        if Path(name).is_symlink() and Path(name) not in named:
            raise WriteError(f"{name}: is a link.", "Choose another name, or remove it.")
        refuse_existing(Path(name), overwrite, companions)
        refuse_missing_folder(Path(name))
