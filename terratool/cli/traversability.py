"""`terratool traversability`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    WHEEL,
    Northing,
    WordChoice,
    dask_option,
    flattened,
    from_corner,
    json_option,
    library_root_option,
    local_option,
    overwrite_option,
    roughness_option,
    vehicles_from,
    vehicles_option,
    wheel_options,
)
from terratool.cli.saying import say, say_block, say_error
from terratool.cli.terminal import StatusLine, load

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from terratool.cli.config import Config, DriveSettings
    from terratool.definition.findings import Bounds
    from terratool.traversability.compare import PreparedComparison
    from terratool.traversability.conditions import Condition
    from terratool.traversability.preparing import PreparedRequest
    from terratool.traversability.report.writing import JudgementFiles
    from terratool.traversability.request import Request
    from terratool.traversability.results import Reports
    from terratool.traversability.vehicle import Vehicle

# equal to those of route.graph, vehicle and ranges of terratool.traversability, which are not
# imported for --help; tests check
PREFERENCES = ("length", "time", "energy", "margin")
MODELS = ("slip", "paper")
SAMPLES = (256, 16, 1024)  # default, least, most


@click.command(
    "traversability",
    cls=Command,
    epilog="Example: terratool traversability samples/ramp-yard.json "
    "--vehicle samples/vehicles/husky-a200.json --route 4 60 70 8 --report yard.html",
)
@click.argument("files", nargs=-1, metavar="[FILE|DIR]...")
@option_group(
    "Vehicle",
    vehicles_option,
    click.option(
        "--model",
        type=WordChoice(MODELS),
        default=MODELS[0],
        show_default=True,
        metavar="WHAT",
        help="Of wheel and soil: slip, or what the paper says, 3.6.",
    ),
    click.option(
        "--margin",
        is_flag=True,
        help="Keep the error band of climbs on soft soil, up to 5°, in reserve.",
    ),
)
@option_group(
    "Routes",
    click.option(
        "--route",
        "routes",
        type=(float, Northing(), float, Northing()),
        multiple=True,
        metavar="X0 Y0 X1 Y1",
        help="Look for a way, once or several times; Y,Z is on a storey at Z.",
    ),
    click.option(
        "--waypoints",
        multiple=True,
        metavar="FILE",
        help="Check the way through the points of a CSV or GeoJSON file, x,y or x,y,z.",
    ),
    click.option("--return", "returns", is_flag=True, help="Look for the way back, too."),
    click.option(
        "--prefer",
        type=WordChoice(PREFERENCES),
        default="time",
        show_default=True,
        metavar="WHAT",
        help=f"Choose the best by {', '.join(PREFERENCES)}.",
    ),
    click.option(
        "--alternatives",
        type=click.IntRange(0, 9),
        default=0,
        metavar="N",
        help="Further ways that differ, up to 9.",
    ),
    click.option(
        "--keep-out",
        multiple=True,
        metavar="FILE",
        help="GeoJSON of zones that nothing of the vehicle enters.",
    ),
    click.option(
        "--from",
        "start",
        type=(float, Northing()),
        metavar="X Y",
        help="Say what can be reached from here, or Y,Z.  [default: the largest part]",
    ),
    local_option,
)
@option_group(
    "Answers",
    click.option(
        "--report",
        "reports",
        multiple=True,
        metavar="OUT",
        help=".json, .md or .html; .geojson: routes alone; .svg: slip against slope.",
    ),
    click.option(
        "--map",
        "map_",
        metavar="OUT.tif",
        help="Write the map; beside it OUT-worst.tif, -headings, -classes and -numbers.",
    ),
    click.option(
        "--fail-on",
        "conditions",
        multiple=True,
        metavar="WHAT",
        help="End with 1 if no-route, caution, no-go, unknown, or no-go-fraction>0.3, ….",
    ),
    click.option(
        "--format",
        "formats",
        multiple=True,
        metavar="FORM",
        help="Of findings, as for validate; FORM=OUT goes into a file.  [default: text]",
    ),
    json_option("The same as --format json."),
)
@option_group(
    "Ground",
    click.option(
        "--bounds", nargs=4, type=float, metavar="W S E N", help="Rectangle of the world."
    ),
    click.option(
        "--resolution",
        type=float,
        metavar="R",
        help="Side of a pixel.  [default: by the vehicle's width or a wheel's radius]",
    ),
    click.option(
        "--headings",
        type=click.IntRange(4, 64),
        metavar="N",
        help="4, 8, … 64 at each place.  [default: 8; where they show no way more]",
    ),
)
@option_group(
    "Samples of soils that are ranges (256 unless told), their seed, and who works (all here)",
    click.option(
        "--samples",
        type=click.IntRange(*SAMPLES[1:]),
        default=SAMPLES[0],
        show_default=True,
        metavar="N",
        help="Of soils whose figures are ranges, for probabilities of go.",
    ),
    click.option(
        "--seed",
        type=click.IntRange(0, 2**63 - 1),
        default=0,
        show_default=True,
        metavar="N",
        help="Number that these samples follow from.",
    ),
    click.option(
        "--height-error",
        nargs=2,
        type=float,
        metavar="M L",
        help="Heights are off by M m (standard deviation), alike over L m.",
    ),
    click.option(
        "--threads", type=click.IntRange(1), metavar="N", help="[default: one a processor]"
    ),
    dask_option("judge the ground"),
    dense=True,
)
@wheel_options
@overwrite_option()
@click.option(
    "--config", "config_file", metavar="FILE", help="Settings, in place of .terratool.toml."
)
@roughness_option
@library_root_option
def command(
    files: tuple[str, ...],
    model: str,
    margin: bool,
    reports: tuple[str, ...],
    map_: str | None,
    routes: tuple[Any, ...],
    waypoints: tuple[str, ...],
    returns: bool,
    start: Any,
    local: bool,
    prefer: Any,
    alternatives: int,
    keep_out: tuple[str, ...],
    resolution: float | None,
    bounds: tuple[float, float, float, float] | None,
    headings: int | None,
    samples: int,
    seed: int,
    height_error: tuple[float, float] | None,
    conditions: tuple[str, ...],
    formats: tuple[str, ...],
    config_file: str | None,
    threads: int | None,
    dask: str | None,
    overwrite: bool,
    as_json: bool,
    **values: Any,
) -> int:
    """Say whether a vehicle can drive on a terrain, FILE, where not, and why.

    Ends with 1 where a route has no way. Of several FILEs, or a DIR: a table. --fail-on takes >,
    >=, < or <= and go-, caution-, no-go-, unknown-, one-way-, cut-off-, edge-, reachable-fraction;
    route-length, route-time, route-energy; charge, least-margin, drift, steepest, sinkage.
    """
    from dataclasses import replace
    from pathlib import Path

    from terratool.cli.config import DriveSettings, project_settings
    from terratool.text.source import is_folder, refuse_absent
    from terratool.traversability.compare import prepare
    from terratool.traversability.conditions import answerable, parse
    from terratool.traversability.report.formats import renderer_of
    from terratool.traversability.report.writing import JudgementFiles
    from terratool.traversability.request import Request, check_places
    from terratool.traversability.route.waypoints import read_waypoints
    from terratool.traversability.route.zones import read_keep_out
    from terratool.traversability.soil import on_the_safe_side

    settings = project_settings(config_file)
    for text in conditions:
        parse(text)
    wheel = any(values[name] is not None for name in WHEEL)
    own = DriveSettings(
        vehicles=values["vehicle"] or (() if wheel else None),
        **_flat(routes, start),
        fail_on=conditions or None, resolution=resolution,
    )  # fmt: skip
    base = Request(
        waypoints=tuple(map(read_waypoints, waypoints)), returns=returns, prefer=prefer,
        alternatives=alternatives,
        keep_out=tuple(zone for path in keep_out for zone in read_keep_out(path)),
        bounds=bounds, headings=headings, samples=samples, seed=seed, threads=threads, dask=dask,
        height_error=height_error,
    )  # fmt: skip

    def vehicles_of(paths: tuple[str, ...]) -> list[Vehicle]:
        found = [one.by_model(model) for one in vehicles_from({**values, "vehicle": paths})]
        return [on_the_safe_side(one) for one in found] if margin else found

    forms = formats + ("json",) * as_json
    if len(files) != 1 or is_folder(files[0]) or forms not in ((), ("text",), ("json",)):
        for option, given in (
            ("--report", reports), ("--map", map_), ("--dask", dask), ("--local", local),
            ("--keep-out", keep_out),
        ):  # fmt: skip
            if given:
                raise click.UsageError(f"{option} is of one terrain. Name one FILE, or drop it.")
        return _judge_many(files, forms, settings, own, base, vehicles_of)
    (file,) = files
    refuse_absent(file)
    drive = settings.drive_settings(file, own)
    asked = drive.settings
    routes, start, resolution = asked.routes or (), asked.start, asked.resolution
    travels = bool(routes or waypoints)
    # settings are of many terrains
    with drive.telling("fail_on"):
        wanted = conditions or answerable(asked.fail_on or (), travels, start is not None)
    checks = [parse(text) for text in wanted]
    lines_only, curves = (
        [path for path in reports if Path(path).suffix.lower() == suffix]
        for suffix in (".geojson", ".svg")
    )
    routed = [*lines_only, *["--return"] * returns, *["--alternatives"] * bool(alternatives)]
    _refuse_unasked(checks, travels, start is not None, routed, curves, model)
    paths = asked.vehicles or ()
    for path in reports:
        renderer_of(path)  # refuses other suffixes
    _refuse_outputs((file, *paths, *waypoints, *keep_out), reports, _maps(map_, paths), overwrite)
    with drive.telling("vehicles"):
        vehicles = vehicles_of(paths)
    wants_map = map_ is not None or len(lines_only) + len(curves) < len(reports)
    request = replace(
        base,
        resolution=resolution,
        **drive.places,
        mapped=wants_map or any(check.needs == "map" for check in checks),
    )
    own_places = {"routes": own.routes, "start": own.start, "bounds": bounds}

    def placed(extent: Bounds) -> Request:
        return replace(request, **_moved(own_places, extent)) if local else request

    terrain = load(file, early=lambda extent: check_places(placed(extent), extent), storeys="kept")
    request = placed(terrain.bounds)
    planned = prepare(terrain, vehicles, request, map_path=map_, overwrite=overwrite)
    written = JudgementFiles(reports, map_, overwrite)
    result = _assess(planned, Path(file).name, written)
    return _print_result(result, checks, written, forms == ("json",))


def _flat(routes: Sequence[Any], start: Any) -> dict[str, Any]:
    """Numbers of the routes and the start of the command line; None for those not given."""
    return {
        "routes": tuple(map(flattened, routes)) or None,
        "start": None if start is None else flattened(start),
    }


def _moved(places: dict[str, Any], extent: Bounds) -> dict[str, Any]:
    """Places of the command line, as those of the world; without those that are not given."""
    found = {name: place for name, place in places.items() if place is not None}
    if routes := found.pop("routes", None):
        found["routes"] = tuple(from_corner(one, extent, len(one) // 2) for one in routes)
    if start := found.pop("start", None):
        found["start"] = from_corner(start, extent, len(start))
    return {
        name: place if name in ("routes", "start") else from_corner(place, extent)
        for name, place in found.items()
    }


def _judge_many(
    files: tuple[str, ...], formats: tuple[str, ...], settings: Config, own: DriveSettings,
    base: Request, vehicles: Callable[[tuple[str, ...]], list[Vehicle]],
) -> int:  # fmt: skip
    """Judge several files; return the exit code."""
    from terratool.cli.gate import GatePlan, judge_many
    from terratool.cli.options import has_roughness, library_roots
    from terratool.cli.outputs import ReportPlan
    from terratool.tasks import thread_count

    reports = ReportPlan.of(formats, settings.traversability.formats, settings)
    plan = GatePlan(files, reports, settings, own, base, vehicles, library_roots(), has_roughness())
    return judge_many(plan, thread_count(base.threads))


def _assess(planned: PreparedComparison, name: str, files: JudgementFiles) -> Reports:
    """Report on each vehicle; first print what its starts and goals show at once."""
    from terratool.traversability.blocked import first_look
    from terratool.traversability.report.writing import assess_all

    pixels, several = planned.requests[0].pixels, len(planned.requests) > 1
    with StatusLine("judging" if pixels else "looking for ways", pixels) as progress:
        for one in planned.requests:
            for line in first_look(one):
                progress.clear()
                say_error(f"{one.vehicle.name}: " * several + line)

        def begin(one: PreparedRequest | None) -> None:
            if one is None:
                progress.about("")
                progress.say("writing files")
            elif several:
                progress.about(one.vehicle.name)
                progress.say("judging" if one.pixels else "looking for ways", one.pixels)

        return assess_all(planned, name, files, progress, begin)


def _print_result(
    result: Reports, checks: list[Condition], written: JudgementFiles, wants_json: bool
) -> int:
    """Print the result, what was written, and conditions that do not hold; return the exit code."""
    from terratool.traversability.report.document import as_json
    from terratool.traversability.report.lines import as_lines

    reports = result.reports
    held = [
        (check.text.strip(), f"{report.vehicle.name}: " * bool(report.vehicle.name) + why)
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
            for path in written.paths([report.vehicle.name for report in reports]):
                say(f"{path}: written.")
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
