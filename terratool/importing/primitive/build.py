"""Import of a patch of heights as one primitive, or as a few that stand in one cell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from terratool.definition.model import LARGEST, SMALLEST
from terratool.errors import MissedError, RequestError
from terratool.importing.primitive import fit
from terratool.importing.primitive.entries import (
    FitError,
    PrimitiveEntry,
    entries_of,
    fit_error,
)
from terratool.importing.primitive.fit import CurveForm
from terratool.importing.primitive.products import Patch, ProductSum
from terratool.importing.types import HeightSource, SampledHeights
from terratool.report.numbers import coordinates, tenths

MOST_TERMS = 16
MOST_SAMPLES = 256
MOST_VALUES = 512
"""Most values of all terms along a side; the time for a fit grows with the cube."""

_GAIN = 0.98
"""Largest ratio of errors at which a turn is kept, or a sum in place of a product."""

_POOR = 0.01
"""Share of the relief above which an error is reported with better options."""

_OTHERWISE = "For a smaller error there is import-terrain."
_ROWS = 1024
_HELPS = 0.9
"""Largest ratio of errors at which one more term is recommended."""

Combine = Literal["auto", "product", "sum"]


@dataclass(frozen=True, slots=True)
class PrimitiveRequest:
    """Options for importing a patch.

    Attributes:
        values: values in each curve; the fewest that suffice if None.
        fit_turn: whether to look for the best angle.
        terms: number of primitives in the cell.
        recognise: whether to write named curves where they fit.
        max_error: largest error, in units of the heights; None for any.
        combine: combination of the two curves; "auto" takes the better one.
        x_steps: world positions of vertical steps along x, as walls of a mesh make.
        y_steps: world positions of vertical steps along y.
    """

    values: int | None = None
    fit_turn: bool = False
    terms: int = 1
    recognise: bool = False
    max_error: float | None = None
    combine: Combine = "product"
    x_steps: tuple[float, ...] = ()
    y_steps: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class ImportedPrimitive:
    """Primitives for a patch, with their error.

    Attributes:
        names: names of the primitives.
        entries: the primitives.
        error: error of the compiled terrain.
        missing: number of pixels without a height.
        size: sides of the patch along x and y, in units of the CRS.
        unit: unit of the heights; "" where it is not known.
        unturned: largest error on the same pixels without the turn; None without a turn.
        more: largest error with one more term; None if it was not tried or is no better.
        notes: sentences about the source and the choices made.
    """

    names: tuple[str, ...]
    entries: tuple[PrimitiveEntry, ...]
    error: FitError
    missing: int
    size: tuple[float, float]
    unit: str
    unturned: float | None = None
    more: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def behind(self) -> str:
        """Unit of heights as it stands behind a number; empty where it is not known."""
        return f" {self.unit}" if self.unit else ""

    def primitives(self) -> dict[str, Any]:
        """Return the members of `elemTypes`."""
        return {
            name: entry.primitive() for name, entry in zip(self.names, self.entries, strict=True)
        }

    def elements(
        self, cell: tuple[int, int] | None = None, span: tuple[int, int] = (1, 1)
    ) -> list[dict[str, Any]]:
        """Return the elements that place the primitives, all in one block of cells."""
        found = []
        for k, (name, entry) in enumerate(zip(self.names, self.entries, strict=True)):
            element = entry.element(name, cell, span)
            if k > 0:
                element["x-ignore"] = ["TT208"]  # they share the cell with the first
            found.append(element)
        return found

    def to_json(self) -> dict[str, Any]:
        """Return the report as JSON values."""
        return {
            "primitives": self.primitives(),
            "elements": self.elements(),
            "error": self.error.to_json(),
            "missing": self.missing,
            "unit": self.unit,
            "unturned": self.unturned,
            "oneMoreTerm": self.more,
            "notes": list(self.notes),
        }


def read_samples(heights: HeightSource) -> SampledHeights:
    """Read all heights of a source into memory."""
    if isinstance(heights, SampledHeights):
        return heights
    grid = heights.grid
    values = np.empty((grid.rows, grid.columns))
    for first in range(0, grid.rows, _ROWS):
        count = min(_ROWS, grid.rows - first)
        values[first : first + count] = heights.read(first, count)
    return SampledHeights(grid, values, tuple(heights.notes))


def import_primitive(
    samples: SampledHeights, name: str, wanted: PrimitiveRequest | None = None
) -> ImportedPrimitive:
    """Make primitives of a patch of heights.

    One primitive makes the heights vScale · x(u) · y(v) + vOffset with u and v from 0 to 1 over the
    whole patch, from the outer edges of its pixels; several make the sum.

    Args:
        samples: the patch.
        name: name of the primitive; several terms get the names NAME-1, NAME-2, ….
        wanted: options; the defaults if None.

    Raises:
        RequestError: the patch has fewer than two pixels with a height, or the options make no
            sense.
    """
    wanted = wanted or PrimitiveRequest()
    names = names_of(name, wanted)
    _refuse_empty(samples)
    patch = Patch(samples)
    notes = list(samples.notes)
    unturned = more = None
    low, high = float(np.nanmin(samples.values)), float(np.nanmax(samples.values))
    if low == high:
        entries: tuple[PrimitiveEntry, ...] = (PrimitiveEntry([1], None, low),)
        notes.append("The patch is level.")
    else:
        patch, terms, unturned = _best(patch, wanted)
        entries = entries_of(
            terms, patch.turn, high - low, lambda tried: fit.center_error(patch, tried)
        )
        if wanted.fit_turn and patch.turn == 0.0:
            notes.append("No turn fits better than none.")
    error = fit_error(patch, entries)
    if wanted.recognise and low < high:
        from terratool.importing.primitive.recognise import recognise

        named = recognise(patch, terms, error.largest, wanted.max_error)
        if named is None:
            notes.append("No named curve fits within the largest error.")
        else:
            entries = (named,)
            error = fit_error(patch, entries)
    elif error.largest > _POOR * error.relief and not entries[0].summed:
        more = _one_more(patch, wanted, terms)
        more = more if more is not None and more < error.largest else None
    missing = int(np.isnan(samples.values).sum())
    names, size, unit = names[: len(entries)], samples.grid.size, samples.grid.unit
    return ImportedPrimitive(
        names, entries, error, missing, size, unit, unturned, more, tuple(notes)
    )


def names_of(name: str, wanted: PrimitiveRequest) -> tuple[str, ...]:
    """Return the names of the primitives: NAME, or NAME-1, NAME-2, … for several terms.

    Raises:
        RequestError: the options make no sense.
    """
    _refuse_request(name, wanted)
    if wanted.terms == 1:
        return (name,)
    return tuple(f"{name}-{k + 1}" for k in range(wanted.terms))


def _best(patch: Patch, wanted: PrimitiveRequest) -> tuple[Patch, ProductSum, float | None]:
    """Return the best fit, the patch with its turn, and the largest error without that turn."""
    unturned = None
    if wanted.fit_turn:
        counts = None if wanted.values is None else (wanted.values, wanted.values)
        turned = replace(patch, turn=fit.best_turn(patch, wanted.terms, counts))
        covered = _covered_patch(turned)
        heights = covered.values[~np.isnan(covered.values)]
        # heights without relief determine no turn
        if turned.turn != 0.0 and heights.size and heights.min() < heights.max():
            terms, error = _best_combination(turned, wanted)
            unturned = _best_combination(covered, wanted)[1]
            if error <= _GAIN * unturned:
                return turned, terms, unturned
    return patch, _best_combination(patch, wanted)[0], None


def _covered_patch(turned: Patch) -> Patch:
    """Return the pixels that a turned primitive covers, as an unturned patch."""
    rows, columns = turned.values.shape
    within = turned.covers(np.arange(rows)[:, None], np.arange(columns)[None, :])
    values = np.where(within, turned.values, np.nan)
    return Patch(replace(turned.samples, values=values))


def _best_combination(patch: Patch, wanted: PrimitiveRequest) -> tuple[ProductSum, float]:
    """Return the better of a product and a sum, if both are allowed, and its largest error."""
    found = []
    for summed in (False, True):
        if wanted.combine in ("auto", "sum" if summed else "product"):
            curves = _curves(patch, wanted, summed)
            found.append(fit.fit_terms(patch, curves, _counts(patch, curves, wanted.values)))
    if len(found) == 2 and found[1][1] <= _GAIN * found[0][1]:
        return found[1]
    return found[0]


def _curves(patch: Patch, wanted: PrimitiveRequest, summed: bool) -> CurveForm:
    west, south, east, north = patch.samples.grid.bounds
    return CurveForm(
        wanted.terms,
        tuple((x - west) / (east - west) for x in wanted.x_steps),
        tuple((y - south) / (north - south) for y in wanted.y_steps),
        summed,
    )


def _counts(patch: Patch, curves: CurveForm, samples: int | None) -> tuple[int, int]:
    if samples is None:
        return fit.fewest_values(patch, curves)
    rows, columns = patch.values.shape
    # a single row or column determines no curve across
    return samples if columns > 1 else 1, samples if rows > 1 else 1


def _one_more(patch: Patch, wanted: PrimitiveRequest, terms: ProductSum) -> float | None:
    """Return the largest error with one more term; None if no more are allowed."""
    if terms.count >= MOST_TERMS or min(patch.values.shape) <= terms.count:
        return None
    curves = replace(_curves(patch, wanted, False), terms=terms.count + 1)
    counts = len(terms.x_nodes), len(terms.y_nodes)
    return fit.fit_terms(patch, curves, counts)[1]


def _refuse_request(name: str, wanted: PrimitiveRequest) -> None:
    """Refuse options that make no sense, alone or together."""
    if not name:
        raise RequestError("The primitive has no name.", "Give it one with --name.")
    try:
        name.encode()
    except UnicodeEncodeError as error:
        raise RequestError(f"{name!r} is no name in UTF-8.", "Choose another --name.") from error
    if not 1 <= wanted.terms <= MOST_TERMS:
        raise RequestError(
            f"{wanted.terms} terms are asked for.", f"Ask for 1 to {MOST_TERMS} with --terms."
        )
    if wanted.values is not None and not 1 <= wanted.values <= MOST_SAMPLES:
        raise RequestError(
            f"Curves of {wanted.values} values are asked for.",
            f"Ask for 1 to {MOST_SAMPLES} with --values.",
        )
    if wanted.terms * (wanted.values or 0) > MOST_VALUES:
        raise RequestError(
            f"{wanted.terms} terms of curves with {wanted.values} values are asked for.",
            f"Ask for fewer: together no more than {MOST_VALUES} along a side.",
        )
    if wanted.max_error is not None and not 0.0 <= wanted.max_error < math.inf:
        raise RequestError(
            f"The largest error is {wanted.max_error:g}.", "Give --max-error of 0 or more."
        )
    for option, given in (
        ("--combine", wanted.combine != "product"),
        ("--recognise", wanted.recognise),
    ):
        if given and wanted.terms > 1:
            raise RequestError(
                f"{option} is about one primitive, but {wanted.terms} terms are asked for.",
                f"Leave out {option} or --terms.",
            )
    if wanted.recognise and wanted.combine != "product":
        raise RequestError(
            "Named curves are looked for in products only.", "Leave out --combine or --recognise."
        )
    if wanted.fit_turn and (wanted.x_steps or wanted.y_steps):
        raise RequestError(
            "Walls along x and y are no steps of turned curves.", "Leave out --fit-turn."
        )


def _refuse_empty(samples: SampledHeights) -> None:
    """Refuse a patch with too few heights for a curve, or with sides that no definition allows."""
    grid = samples.grid
    size = f"{grid.columns} × {grid.rows} pixels"
    sides = grid.size
    if min(sides) < SMALLEST or max(sides) > LARGEST:
        raise RequestError(
            f"The patch is {sides[0]:.4g} × {sides[1]:.4g}, and the sides of a terrain are from "
            f"{SMALLEST:g} to {LARGEST:g}.",
            "Check the reference system of the source.",
        )
    known = int((~np.isnan(samples.values)).sum())
    if known == 0:
        raise RequestError(
            f"None of the {size} has a height.", "Choose other pixels with --bounds or --window."
        )
    if known == 1:
        raise RequestError(
            f"Of the {size} only one has a height, which makes no curve.",
            "Choose more pixels with --bounds or --window.",
        )


def refuse_missed(imported: ImportedPrimitive, wanted: PrimitiveRequest) -> None:
    """Refuse primitives that are farther from their patch than was allowed.

    Raises:
        MissedError: the error is larger.
    """
    largest = imported.error.largest
    if wanted.max_error is not None and largest > wanted.max_error:
        raise MissedError(
            f"The error is {largest:.4g}{imported.behind}, and {wanted.max_error:g} is allowed; "
            "nothing was written.",
            "Allow more, or try more --terms, --fit-turn or a smaller patch.",
        )


def sentences(imported: ImportedPrimitive) -> Iterator[str]:
    """Yield sentences for people about the fit."""
    error, unit = imported.error, imported.behind
    yield (
        f"Error: {_size_text(error.largest, error, unit)} at most, at "
        f"{coordinates((error.x, error.y))}; {_size_text(error.rms, error, unit)} RMS, "
        f"over {error.pixels:,} pixels."
    )
    if imported.missing:
        yield f"{imported.missing:,} pixels without a height count for nothing."
    if imported.entries[0].turn != 0.0:
        bare = tenths(error.bare / (error.bare + error.pixels))
        yield (
            f"Turned by {imported.entries[0].turn:g}°, it leaves {bare} of the patch bare; "
            f"unturned, the error for the rest would be {imported.unturned:.3g}{unit}."
        )
    if error.largest > _POOR * error.relief:
        more = ""
        if imported.more is not None and imported.more < _HELPS * error.largest:
            count = len(imported.entries) + 1
            more = (
                f"{count} terms in the same cell (--terms {count}) would leave "
                f"{_size_text(imported.more, error, unit)}; "
            )
        yield f"{more}import-terrain keeps to any error." if more else _OTHERWISE
    yield from imported.notes


def _size_text(size: float, error: FitError, unit: str) -> str:
    return f"{size:.4g}{unit} ({error.share(size):.3g} % of the relief)"
