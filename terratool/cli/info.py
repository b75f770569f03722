"""`terratool info`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from terratool.cli.command import Command
from terratool.cli.options import json_option, library_root_option, roughness_option
from terratool.cli.saying import say, say_json, write_json
from terratool.cli.terminal import StatusLine, load
from terratool.text.display import printable

if TYPE_CHECKING:
    from terratool.field.summary import TerrainSummary
    from terratool.field.terrain import Terrain


@click.command("info", cls=Command, epilog="Example: terratool info samples/paper-example.json")
@click.argument("file")
@click.option(
    "--geojson",
    is_flag=True,
    help="Write the footprints of elements and the lines of tracks as GeoJSON, in its crs.",
)
@json_option("Say it as JSON.")
@roughness_option
@library_root_option
def command(file: str, geojson: bool, as_json: bool) -> None:
    """Say what a terrain consists of: size, elements, heights, memory."""
    if as_json and geojson:
        raise click.UsageError("--json and --geojson are two formats. Choose one.")
    from terratool.field.summary import summarise

    terrain = load(file)
    if geojson:
        with StatusLine("writing"):
            _write_geojson(terrain)
        return
    with StatusLine("looking at heights"):
        summary = summarise(terrain)
    if as_json:
        say_json(summary)
    for line in [] if as_json else _lines(summary):
        say(line)


def _write_geojson(terrain: Terrain) -> None:
    """Print the elements as GeoJSON, a line for each feature, so that a million take no memory."""
    from terratool.field.footprints import features, geojson_head

    head = json.dumps(geojson_head(terrain), ensure_ascii=False)
    separator = f'{head[:-1]}, "features": ['
    for feature in features(terrain):
        write_json(f"{separator}\n{json.dumps(feature, ensure_ascii=False)}")
        separator = ","
    write_json("\n]}\n")


def _lines(s: TerrainSummary) -> list[str]:
    size, origin, height, tracks = s.size, s.origin, s.height, s.tracks
    lines = [printable(s.descr)] if s.descr else []
    lines += [
        f"size           {size[0]:g} × {size[1]:g}",
        f"origin         {origin[0]:.10g}, {origin[1]:.10g}",
        f"crs            {_crs(s.crs)}",
        f"levels         {s.levels}",
        f"elements       {s.elements:,}",
        *_counts("by primitive", s.elements_by_primitive),
        *_counts("by surface", s.elements_by_surface),
        f"smallest cell  {s.smallest_cell:g}",
    ]
    if tracks.count:
        lines.append(
            f"tracks         {tracks.count:,} of {tracks.segments:,} segments, "
            f"{tracks.length:.6g} long together"
        )
    if height.low is None:
        lines.append("height         none, all is void")
    else:
        lines.append(
            f"height         {height.low:.6g} to {height.high:.6g}, at {height.points:,} points"
        )
    for number, rough in enumerate(s.roughness):
        lines.append(
            f"{'' if number else 'roughness':15}{printable(rough.surface)}: rms {rough.rms:.6g}, "
            f"correlation {rough.correlation:.6g}, seed {rough.seed}"
        )
    for number, one in enumerate(s.ranges):
        lines.append(
            f"{'' if number else 'soil ranges':15}{printable(one.surface)}: {one.key} "
            f"{one.low:.6g} to {one.high:.6g}"
        )
    if s.ranges:
        lines.append(f"{'':15}where one number is wanted, the middle counts")
    lines.append(f"memory         {s.bytes:,} bytes compiled")
    return lines


def _crs(crs: Any) -> str:
    if crs is None:
        return "none"
    return json.dumps(crs) if isinstance(crs, dict) else printable(str(crs))


def _counts(title: str, counts: Mapping[str, int]) -> list[str]:
    counts = {printable(name): count for name, count in counts.items()}
    width = max(map(len, counts), default=0)
    return [
        f"{'  ' + title if not i else '':15}{name:{width}}  {count:,}"
        for i, (name, count) in enumerate(counts.items())
    ]
