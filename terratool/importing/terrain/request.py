"""Request and result of the import of a whole DEM, and what all of its forms share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from terratool.definition.presets import PRESETS
from terratool.errors import ReadError, RequestError
from terratool.importing.terrain.methods import FINEST, METHODS, Method, methods_named, step_for
from terratool.importing.terrain.writing import MeasuredError
from terratool.importing.types import HeightSource, PixelGrid
from terratool.report.numbers import round_down, round_up
from terratool.report.wording import join_words
from terratool.text.display import quote

MOST_AS_ROWS = 2_000_000
"""Most pixels of a DEM that becomes rows where nothing is said; a larger one becomes a grid."""

_NARROWEST = 2.0**-40
"""Least ratio of a pixel's side to the largest coordinate; below it doubles round pixels away."""

MOST_IN_MEMORY = 1 << 24
"""Most pixels of a DEM that is held in memory; larger ones are read by rows, twice."""

MOST_SEARCHED = 1 << 22
"""Most pixels of a DEM that is searched for structures where nothing is said."""

REACH = 512
"""Distance in pixels within which GDAL looks for heights to fill a gap."""

NO_GROUND = "void"
"""Name of the surface of pixels without a height."""

_LEVEL = 1e-3
"""Least error that is proposed, in units of the heights: that of level ground."""

Floats = NDArray[np.float64]
Progress = Callable[[int], object]
Searching = Callable[[int | None], object]
"""Gets the number of structures found so far; None when they are not looked for any more."""


@dataclass(frozen=True, slots=True)
class GroundSurface:
    """Surface of the terrain where no class gives another one.

    Attributes:
        name: name of the surface.
        preset: its soil; None leaves the figures to the user.
    """

    name: str
    preset: str | None = None

    @property
    def surface(self) -> dict[str, Any]:
        """Return the members of the surface in a definition."""
        return {} if self.preset is None else {"preset": self.preset}


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """Options for importing a DEM.

    Attributes:
        max_error: largest error, in units of the heights; if None, 1 % of the relief, rounded down
            to 1, 2 or 5 · 10^k. None with `link`.
        methods: names of the methods that may be tried: rows, columns, nodal-rows, nodal-columns
            and hats, or methods themselves; all if empty.
        fill: whether unknown heights are filled rather than void.
        structures: whether to look for boxes, ramps and hills; if None, up to `MOST_SEARCHED`
            pixels, and where there are to be walls.
        walls: whether structures get upright walls where the DEM has a gap of a pixel.
        surfaces: name of a raster of classes, or "classes" for those of the points of a LAS.
        title: name of the source, for the description.
        allow_vrt: whether a VRT of classes may be a mosaic of files out of its folder.
        allow_remote: whether the raster of classes may lie on the net, or lead anywhere.
        cells: cells of the tree: "half-pixels" make the smallest file, in "pixels" own elements are
            easily added.
        surface: name of the surface of the ground where no class says otherwise; that of the preset
            if None.
        preset: soil of that surface; None leaves its figures to the user.
        as_: what is made of the heights: "rows" of curves in the text, or a "grid", a raster beside
            it; rows up to `MOST_AS_ROWS` pixels if None, and wherever another option is about rows.
        link: whether the grid is the source itself, a raster beside the definition or below.
        dask: address of a Dask scheduler whose workers make rows, or "local" for as many processes
            on this machine as there are processors; None for none.
        decks: whether what stands over other ground in a mesh becomes decks; if not, the highest
            surface is kept.
    """

    max_error: float | None = None
    methods: Sequence[str | Method] = ()
    fill: bool = False
    structures: bool | None = None
    walls: bool = False
    surfaces: str | None = None
    title: str = ""
    allow_vrt: bool = False
    allow_remote: bool = False
    cells: Literal["half-pixels", "pixels"] = "half-pixels"
    surface: str | None = None
    preset: str | None = None
    as_: Literal["rows", "grid"] | None = None
    link: bool = False
    dask: str | None = None
    decks: bool = True

    @property
    def of_rows(self) -> list[str]:
        """Options given that are about rows, as the command spells them."""
        given = {
            "--method": bool(self.methods), "--walls": self.walls,
            "--structures": self.structures is True,
            "--cells": self.cells != "half-pixels",
        }  # fmt: skip
        return [name for name, one in given.items() if one]

    def makes_grid(self, grid: PixelGrid) -> bool:
        """Return whether heights of some pixels become a grid.

        Raises:
            RequestError: another option is about rows, or there is no such form.
        """
        if self.as_ not in (None, "rows", "grid"):
            raise RequestError(f"A DEM cannot be made {self.as_!r}.", "Choose rows or grid.")
        if self.link and self.as_ == "rows":
            raise RequestError("A link makes a grid, and rows are asked for.", "Leave out --link.")
        if (self.as_ == "grid" or self.link) and self.of_rows:
            raise RequestError(
                f"{self.of_rows[0]} is about rows, and a grid is asked for.",
                f"Leave out {self.of_rows[0]}, or ask for rows.",
            )
        as_grid = self.link or self.as_ == "grid"
        if self.as_ is None and not as_grid:
            as_grid = grid.rows * grid.columns > MOST_AS_ROWS and not self.of_rows
        if as_grid and self.dask is not None:
            raise RequestError(
                "--dask is about rows, and the pixels become a grid.",
                "Leave out --dask, or ask for rows by --as rows.",
            )
        return as_grid

    def searches(self, grid: PixelGrid) -> bool:
        """Return whether heights of some pixels are searched for boxes, ramps and hills.

        Raises:
            RequestError: they are to be, and are too many.
        """
        pixels = grid.rows * grid.columns
        if self.structures is None and not self.walls:
            return pixels <= MOST_SEARCHED
        wanted = self.structures is not False
        if wanted and pixels > MOST_IN_MEMORY:
            raise RequestError(
                f"Structures among more than {MOST_IN_MEMORY:,} pixels are not looked for.",
                f"Leave out {'--structures' if self.structures else '--walls'}, or import a part.",
            )
        return wanted

    @property
    def pixels(self) -> bool:
        """Whether the root's cells are the pixels."""
        return self.cells == "pixels"

    @property
    def ground(self) -> GroundSurface | None:
        """Surface of the root; None without one."""
        name = self.preset if self.surface is None else self.surface
        return None if name is None else GroundSurface(name, self.preset)

    @property
    def tried(self) -> tuple[Method, ...]:
        """Methods that may be tried.

        Raises:
            RequestError: there is no method of a name.
        """
        given = ((one,) if isinstance(one, Method) else methods_named(one) for one in self.methods)
        return tuple(chain.from_iterable(given)) or METHODS

    @property
    def allowed(self) -> float:
        """Largest error; 0 for a link, and where it is still to be proposed."""
        return self.max_error or 0.0

    def for_heights(
        self, low: float, high: float, grid: PixelGrid
    ) -> tuple[ImportOptions, tuple[str, ...]]:
        """Options with the error that is proposed for some heights, and a note if it was."""
        if self.max_error is not None:
            return self, ()
        error = proposed_error(low, high)
        why = "1 % of the relief, rounded down" if low < high else "as the ground is level"
        note = f"Within {error:g}{grid.behind}, {why}: --max-error chooses another."
        return replace(self, max_error=error), (note,)

    def check(self) -> None:
        """Refuse options that make no sense for any source.

        Raises:
            RequestError: an option makes no sense.
        """
        if self.cells not in ("half-pixels", "pixels"):
            raise RequestError(f"The cells are {self.cells!r}.", "Choose half-pixels or pixels.")
        if self.preset is not None and self.preset not in PRESETS:
            raise RequestError(
                f"There is no preset {self.preset!r}.",
                f"The presets are {join_words(tuple(PRESETS))}.",
            )
        _ = self.tried
        _refuse_ground(self.ground)
        if not self.link:
            if self.max_error is not None:
                step_for(self.max_error, 0.0)  # refuse a bad error before reading
            return
        for option, given in (
            ("--max-error", self.max_error is not None), ("--fill", self.fill),
            ("--surfaces", self.surfaces),
        ):  # fmt: skip
            if given:
                raise RequestError(
                    f"{option} is about what is written, and a link to the source is wanted.",
                    f"Leave out {option} or --link.",
                )


@dataclass(frozen=True, slots=True)
class DeckReport:
    """Decks of an import, and their errors at the centres of pixels.

    Attributes:
        rectangles: number of decks between two planes.
        grids: number of decks with a grid.
        columns: number of pixels over which something stands over other ground.
        top: largest error of a top, in units of the heights.
        under: largest error of an underside.
        other: number of these pixels with another number of intervals than the mesh has, or with
            one that is farther off than the error allows.
    """

    rectangles: int
    grids: int
    columns: int
    top: float
    under: float
    other: int


@dataclass(frozen=True, slots=True)
class ImportReport:
    """Result of an import.

    Attributes:
        grid: the pixels.
        options: options of the import.
        method: method by which the heights were written; None if structures explain all of them.
        step: unit to which heights were rounded.
        relief: highest minus lowest height.
        error: error measured on the compiled field at the pixel centres.
        bound: error that holds everywhere against the bilinear DEM.
        unknown: number of pixels without a height.
        structures: number of structures of each kind.
        surfaces: number of pixels of each surface.
        size: size of the file in bytes.
        notes: sentences about the source.
        raster: raster of the heights beside the file; None where they stand in the text.
        raster_size: size of the raster in bytes.
        classes: raster of the classes beside the file; None where there are none, or they stand in
            the text.
        decks: decks of a mesh, and their errors; None where nothing stands over other ground.
    """

    grid: PixelGrid
    options: ImportOptions
    method: Method | None
    step: float
    relief: float
    error: MeasuredError
    bound: float
    unknown: int
    structures: dict[str, int]
    surfaces: dict[str, int]
    size: int
    notes: tuple[str, ...]
    raster: Path | None = None
    raster_size: int = 0
    classes: Path | None = None
    decks: DeckReport | None = None

    @property
    def walls(self) -> bool:
        """Whether there are structures with upright walls."""
        return self.options.walls and bool(self.structures)


def proposed_error(low: float, high: float) -> float:
    """Error for heights of which none is given: 1 % of the relief, or less by a round number."""
    least = max(_LEVEL, FINEST * max(abs(low), abs(high)))
    wanted = max(0.01 * (high - low), least)
    found = round_down(wanted)
    return found if found >= least else round_up(wanted, (1,))


def add_ground(
    ground: GroundSurface, types: dict[str, dict[str, Any]], counts: dict[str, int], grid: PixelGrid
) -> None:
    """Add the surface of the root to those of classes, with all pixels that have no class.

    Args:
        ground: surface of the root.
        types: members of surfaces by name, to which it is added.
        counts: number of pixels of each of these, likewise.
        grid: the pixels.

    Raises:
        RequestError: a class has the same name, and a preset is given.
    """
    if ground.name in types and ground.preset is not None:
        raise RequestError(
            f"The classes have a surface {quote(ground.name)} already, with a soil of its own.",
            "Leave out --preset, or choose another --surface.",
        )
    types.setdefault(ground.name, ground.surface)
    bare = grid.rows * grid.columns - sum(counts.values())
    if bare:
        counts[ground.name] = counts.get(ground.name, 0) + bare


def lacking_note(name: str, lacking: int, ground: GroundSurface | None) -> tuple[str, ...]:
    """Sentence on pixels for which a raster has no class, if there are any."""
    bare = f"the surface {quote(ground.name)}" if ground else "no surface"
    return (f"{name} has no class for {lacking:,} pixels: {bare}.",) if lacking else ()


def _refuse_ground(ground: GroundSurface | None) -> None:
    if ground is None:
        return
    if not ground.name or ground.name == NO_GROUND:
        what = "has no name" if not ground.name else f"is called {quote(ground.name)}, as gaps are"
        raise RequestError(f"The surface of the ground {what}.", "Give another --surface.")
    try:
        ground.name.encode()
    except UnicodeEncodeError as error:
        raise RequestError(
            f"{ground.name!r} is no name in UTF-8.", "Choose another --surface."
        ) from error


def refuse_pixels(grid: PixelGrid) -> None:
    """Refuse pixels of which no terrain can be made.

    Raises:
        ReadError: there is one pixel only, or doubles cannot tell pixels apart.
    """
    if grid.rows * grid.columns < 2:
        raise ReadError("There is one pixel only, which is no terrain.", "Take more of the source.")
    farthest = max(abs(side) for side in grid.bounds)
    if not min(grid.dx, grid.dy) >= _NARROWEST * farthest:
        raise ReadError(
            f"Pixels of {min(grid.dx, grid.dy):g} cannot be told apart at {farthest:g}.",
            "Give the source another origin, as with gdal_edit.py -a_ullr.",
        )


def head_of(grid: PixelGrid, options: ImportOptions) -> dict[str, Any]:
    """Return the first members of the definition: description, size, origin and crs."""
    pixel = f"{grid.dx:.12g}"
    if grid.dx != grid.dy:
        pixel += f" × {grid.dy:.12g}"
    within = "" if options.link else f", imported within {options.allowed:g}{grid.behind}"
    head: dict[str, Any] = {
        "descr": f"{options.title or 'A DEM'}{within}; pixels of {pixel}",
        "size": list(grid.size),
        "origin": [grid.west, grid.south],
    }
    if grid.crs is not None:
        head["crs"] = grid.crs
    return head


def origin_of(
    source: HeightSource, options: ImportOptions, method: str, error: float
) -> dict[str, Any]:
    """Value of `x-source` of a definition: where it came from, for `terratool info`.

    Args:
        source: the DEM.
        options: options of the import.
        method: how its heights are written.
        error: error measured at the pixels.
    """
    found: dict[str, Any] = {"file": options.title or "a DEM"}
    if source.stated.crs is not None:
        found["crs"] = source.stated.crs
    if source.stated.unit:
        found["unit"] = source.stated.unit
    if not options.link:
        found |= {"wanted": options.allowed, "error": float(f"{error:.4g}")}
    return {**found, "method": method}


def fill_gaps(heights: Floats) -> Floats:
    """Fill unknown heights by inverse distance weighting, as GDAL does.

    Args:
        heights: (rows, columns) float64, NaN where unknown.

    Returns:
        (rows, columns) float64, NaN where no height is known within `REACH` pixels.
    """
    from rasterio.fill import fillnodata

    known = ~np.isnan(heights)
    if known.all():
        return heights
    smooth = fillnodata(
        heights.copy(),
        mask=known.astype(np.uint8),
        max_search_distance=min(REACH, max(heights.shape)),
    )
    return np.where(known, heights, smooth)
