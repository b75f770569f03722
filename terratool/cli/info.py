"""`terratool info`."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from terratool.cli.command import Command
from terratool.cli.options import (
    has_roughness,
    json_option,
    library_root_option,
    library_roots,
    roughness_option,
)
from terratool.cli.saying import say, say_json, write_json
from terratool.cli.terminal import StatusLine, short_name
from terratool.report.numbers import without_noise
from terratool.report.wording import decks_and_bores
from terratool.text.display import printable

if TYPE_CHECKING:
    from terratool.field.library_summary import LibrarySummary
    from terratool.field.summary import ImportedFrom, TerrainSummary
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
    """Say what a terrain consists of: size, elements, heights, memory.

    Of a library it says the surfaces, primitives and parts that are written in it, with their
    heights, and the least cells of parts with free places.
    """
    if as_json and geojson:
        raise click.UsageError("--json and --geojson are two formats. Choose one.")
    if _is_library(file):
        _say_library(file, as_json, geojson)
        return
    from terratool.definition.reader import load_checked
    from terratool.field.summary import imported_from, summarise
    from terratool.field.terrain import Terrain

    with StatusLine(f"reading {short_name(file)}"):
        checked = load_checked(file, library_roots())
        terrain = Terrain(checked, roughness=has_roughness())
    if geojson:
        with StatusLine("writing"):
            _write_geojson(terrain)
        return
    with StatusLine("looking at heights"):
        text = None if checked.document is None else checked.document.source.data
        summary = summarise(terrain, None if text is None else imported_from(text))
    if as_json:
        say_json(summary)
    for line in [] if as_json else _lines(summary):
        say(line)


def _is_library(file: str) -> bool:
    """Whether a file is a library; pipes and standard input, which are read once, are not asked."""
    from pathlib import Path

    from terratool.definition.keys import document_kind
    from terratool.text.source import read_source

    return Path(file).is_file() and document_kind(read_source(file).data) == "library"


def _say_library(file: str, as_json: bool, geojson: bool) -> None:
    """Print the summary of a library."""
    from terratool.errors import RequestError
    from terratool.field.library_summary import summarise_library

    if geojson:
        raise RequestError(
            f"{file}: is a library, whose parts stand nowhere yet.",
            "Leave out --geojson, or name a terrain.",
        )
    with StatusLine("looking at parts"):
        summary = summarise_library(file, library_roots(), roughness=has_roughness())
    if as_json:
        say_json(summary)
    for line in [] if as_json else _library_lines(summary):
        say(line)


def _library_lines(library: LibrarySummary) -> Iterator[str]:
    """Lines for people: a block for surfaces, primitives and parts, with a line for each."""
    if library.descr:
        yield printable(library.descr)
    yield f"uses           {', '.join(map(printable, library.libraries)) or 'no library'}"
    yield from _block(
        "surfaces",
        [
            _Row(one.name, (one.preset or "void" * one.void or "–",), one.descr)
            for one in library.surfaces
        ],
    )
    yield from _block(
        "primitives",
        [_Row(one.name, (_span(one.low, one.high),), one.descr) for one in library.primitives],
    )
    yield from _block(
        "parts",
        [
            _Row(
                one.name,
                (_room(one.least), _span(one.low, one.high), f"{one.elements:,}"),
                one.descr,
            )
            for one in library.parts
        ],
        ("in a cell of", "heights", "elements"),
    )


class _Row(NamedTuple):
    """Name, figures and description of an entry of a library."""

    name: str
    figures: tuple[str, ...]
    descr: str


def _block(title: str, rows: list[_Row], heads: tuple[str, ...] = ()) -> Iterator[str]:
    """Lines of one dictionary, in columns."""
    if not rows:
        yield f"{title:15}none"
        return
    cells = [[printable(row.name), *map(printable, row.figures)] for row in rows]
    if heads:
        cells.insert(0, ["", *heads])
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    texts = [""] * bool(heads) + [printable(row.descr) for row in rows]
    for number, (row, text) in enumerate(zip(cells, texts, strict=True)):
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        yield f"{'' if number else title:15}{line}  {text}".rstrip()


def _room(least: tuple[float, float] | None) -> str:
    return "any size" if least is None else f"{least[0]:.6g} × {least[1]:.6g}"


def _span(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return "–"
    # what is left of a sum of heights that cancel each other is no height
    return " to ".join(f"{round(value, 9) + 0.0:.4g}" for value in (low, high))


def _write_geojson(terrain: Terrain) -> None:
    """Print the elements as GeoJSON, a line for each feature, so that a million take no memory."""
    from terratool.field.footprints import features, geojson_head

    head = json.dumps(geojson_head(terrain), ensure_ascii=False)
    separator = f'{head[:-1]}, "features": ['
    for feature in features(terrain):
        write_json(f"{separator}\n{json.dumps(feature, ensure_ascii=False)}")
        separator = ","
    write_json("\n]}\n")


def _imported(found: ImportedFrom | None) -> Iterator[str]:
    """Line on the source of an import."""
    if found is None:
        return
    said = [
        found.file,
        found.crs and _crs_name(found.crs),
        found.unit and f"heights in {found.unit}",
    ]
    if found.error is not None:
        said.append(f"within {found.error:.4g}")
    said.append(found.method and f"by {found.method}")
    yield f"imported from  {printable(', '.join(filter(None, said)))}"


def _crs_name(crs: str) -> str:
    """Code of a reference system, or the name that its WKT has."""
    quoted = crs.split('"')
    return quoted[1] if len(quoted) > 2 else crs


def _lines(s: TerrainSummary) -> list[str]:
    size, origin, height, tracks = s.size, s.origin, s.height, s.tracks
    lines = [printable(s.descr)] if s.descr else []
    lines += [
        *_imported(s.imported),
        f"size           {size[0]:g} × {size[1]:g}",
        f"origin         {origin[0]:.10g}, {origin[1]:.10g}",
        f"crs            {_crs(s.crs)}",
        f"levels         {s.levels}",
        f"elements       {s.elements:,}",
        *_counts("by primitive", s.elements_by_primitive),
        *_counts("by surface", s.elements_by_surface),
        f"smallest cell  {s.smallest_cell:g}",
    ]
    if s.storeys.decks + s.storeys.bores:
        lines.append(f"storeys        {decks_and_bores(s.storeys.decks, s.storeys.bores)}")
    if tracks.count:
        lines.append(
            f"tracks         {tracks.count:,} of {tracks.segments:,} segments, "
            f"{tracks.length:.6g} long together"
        )
    if height.low is None:
        lines.append(f"height         {'none, all is void' if height.points else 'not looked at'}")
    else:
        low, high = without_noise(height.low, height.high or 0.0)
        lines.append(f"height         {low:.6g} to {high:.6g}, at {height.points:,} points")
    lines += [f"               {note}" for note in height.notes]
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


_NUMBERED = re.compile(r"(.*\D)\d+")
_MANY = 20
"""Least number of names that differ by a number alone and share a line."""
_STEMS = {"row-": "rows of a DEM", "column-": "columns of a DEM"}
"""Plural names of what an import of a DEM numbers, by the stem of its primitives."""


def _folded(counts: Mapping[str, int]) -> dict[str, int]:
    """Numbers of elements by printable name, with one name for many that are numbered."""
    stems = {name: found[1] if (found := _NUMBERED.fullmatch(name)) else "" for name in counts}
    sizes = Counter(stems.values())
    folded: Counter[str] = Counter()
    for name, count in counts.items():
        stem = stems[name]
        said = printable(name)
        if stem and sizes[stem] >= _MANY:
            said = f"{sizes[stem]:,} {_STEMS.get(stem) or f'named {printable(stem)}…'}"
        folded[said] += count
    return dict(folded)


def _crs(crs: Any) -> str:
    if crs is None:
        return "none"
    return json.dumps(crs) if isinstance(crs, dict) else printable(str(crs))


def _counts(title: str, counts: Mapping[str, int]) -> list[str]:
    counts = _folded(counts)
    width = max(map(len, counts), default=0)
    return [
        f"{'  ' + title if not i else '':15}{name:{width}}  {count:,}"
        for i, (name, count) in enumerate(counts.items())
    ]
