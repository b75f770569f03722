"""`terratool curriculum`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import click
from msgspec import Struct

from terratool.cli.command import Command
from terratool.cli.options import (
    json_option,
    library_root_option,
    library_roots,
    output_argument,
    overwrite_option,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, short_name
from terratool.report.documents import Document
from terratool.report.wording import count_of, join_words
from terratool.text.display import quote

if TYPE_CHECKING:
    from terratool.authoring.curriculum.build import Curriculum


@click.command(
    "curriculum",
    cls=Command,
    epilog="Example: terratool curriculum samples/curricula/rough.json course.json --seed 7",
)
@click.argument("spec")
@output_argument
@click.option(
    "--seed",
    type=click.IntRange(0, 2**53),
    metavar="N",
    help="Number that all random choices follow from, instead of the spec's own.",
)
@library_root_option
@overwrite_option()
@json_option()
@click.pass_context
def command(
    ctx: click.Context, spec: str, output: str, seed: int | None, overwrite: bool, as_json: bool
) -> None:
    """Make a grid of training tiles of SPEC: a definition, OUT, and origins beside it.

    Tiles stand in rows along x, which get more difficult, and in columns along y, each of a kind.
    OUT ends in .json; what ends in .origins.npz instead holds where robots begin on each tile,
    level places on it, its kind and its difficulty. The same SPEC and seed give the same bytes.
    """
    from pathlib import Path

    from terratool.authoring.curriculum.build import (
        ORIGINS,
        curriculum,
        write_curriculum,
    )
    from terratool.authoring.curriculum.reading import load_spec
    from terratool.errors import DefinitionError, RequestError
    from terratool.output import is_same_file, refuse_existing, refuse_missing_folder
    from terratool.text.source import PLAIN, refuse_name

    refuse_name(output, PLAIN)
    if is_same_file(spec, output):
        raise RequestError(
            f"{output}: is the same file as {spec}.", "Give the definition another name."
        )
    refuse_existing(Path(output), overwrite, (ORIGINS,))
    refuse_missing_folder(Path(output))
    with StatusLine(f"reading {short_name(spec)}") as status:
        try:
            read = load_spec(spec, seed, library_roots())
        except DefinitionError as error:
            if not error.findings:
                raise
            status.clear()
            for finding in error.findings:
                place = f"{finding.file}:{finding.line}:{finding.column}"
                say(f"{place}: {finding.code}: {finding.message}", err=True)
                say(f"  {finding.hint}", err=True)
            ctx.exit(error.exit_code)
        status.say("making tiles")
        made = curriculum(read)
        status.say(f"writing {short_name(output)}")
        origins = write_curriculum(made, output, overwrite)
    if as_json:
        say_json(_document(made, output, str(origins)))
        return
    for line in lacking(made):
        say(line, err=True)
    say(as_text(made, output, str(origins)))


class PatchPlaces(Struct, frozen=True):
    """Numbers of level places of a patch that were wanted, and that were not found."""

    wanted: int
    missing: int


class CurriculumDocument(Document, frozen=True, kw_only=True):
    """Summary of a curriculum, as JSON."""

    file: str
    origins: str
    bytes: int
    rows: int
    columns: int
    tile: tuple[float, ...]
    seed: int
    bounds: tuple[float, ...]
    elements: int
    kinds: Mapping[str, int]
    patches: dict[str, PatchPlaces]


def _document(made: Curriculum, output: str, origins: str) -> CurriculumDocument:
    spec = made.spec
    return CurriculumDocument(
        file=output,
        origins=origins,
        bytes=len(made.text.encode()),
        rows=spec.rows,
        columns=spec.columns,
        tile=spec.tile,
        seed=spec.seed,
        bounds=made.terrain.bounds,
        elements=made.terrain.elements,
        kinds=made.counts,
        patches={
            patch.name: PatchPlaces(
                spec.rows * spec.columns * patch.count, made.missing[patch.name]
            )
            for patch in spec.patches
        },
    )


def lacking(made: Curriculum) -> Iterator[str]:
    """Lines for people on kinds without a tile, and on level places that were not found."""
    spec = made.spec
    for kind in spec.kinds:
        if kind.proportion and not made.counts[kind.name]:
            yield (
                f"{quote(kind.name)}: no tile is of this kind, as its proportion is too small for "
                f"{count_of(spec.columns, 'column')}. Make it larger, or add columns."
                if spec.curriculum
                else f"{quote(kind.name)}: no tile is of this kind, as each has a random one. Make "
                "its proportion larger, or add tiles."
            )
    for name, missing in made.missing.items():
        if missing:
            tiles = count_of(made.tiles_without(name), "tile")
            yield (
                f"{quote(name)}: {missing:,} of {made.patches[name].size // 3:,} level places were "
                f"not found, on {tiles}; they are NaN."
            )


def as_text(made: Curriculum, output: str, origins: str) -> str:
    """Summary of a curriculum in a line for people."""
    spec = made.spec
    kinds = join_words([f"{count:,} {name}" for name, count in made.counts.items() if count])
    return (
        f"{output}: {count_of(spec.rows * spec.columns, 'tile')} ({kinds}), "
        f"{count_of(made.terrain.elements, 'element')}, {len(made.text.encode()):,} bytes; "
        f"{origins}: {join_words(list(made.arrays))}"
    )
