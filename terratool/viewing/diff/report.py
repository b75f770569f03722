"""Reports of differences: text for people, JSON, Markdown, and commands for GitHub's log."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, get_args

from msgspec import UNSET

from terratool.report.documents import json_text
from terratool.report.markup import escape_markdown, markdown_row
from terratool.report.numbers import located, metres, per_cent, pixels
from terratool.report.wording import count_of
from terratool.report.workflow import annotation
from terratool.text.display import printable, quote
from terratool.viewing.diff.results import (
    ChangeKind,
    Comparison,
    DiffDocument,
    Difference,
    ElementChange,
    ElementPlace,
    EntryChange,
    FileDifference,
    FileStatus,
    GroundChange,
    KeyChange,
    Pair,
    StoreyChange,
    VerdictChange,
)

MOST = 20
"""Default number of lines of a list."""
ALL = "; --max-changes 0 lists all"
"""Words behind a list of which some lines are left out."""
_ALIKE = 3
"""Least number of elements with equal changes that share a line."""
_NAMED = 3
"""Most names in such a line, and in a cell of a table."""
_FLIPS = 5
"""Most changes of class that are listed for a vehicle."""
_UNKNOWN = "unknown"
"""Name of the class of ground without a verdict."""
_SIGNS = {"added": "+", "removed": "-", "moved": "~", "changed": "~", "renamed": "~"}
_DICTIONARIES = {"surface": "worn by", "primitive": "used by", "part": "stands in"}
_FACES = {
    "deck": ("top", "underside", "clearance"), "bore": ("floor", "ceiling", "clearance"),
}  # fmt: skip
"""Words for both faces of a storey, and for the room below the second."""
_STATUS: dict[FileStatus, str] = {
    "same": "same terrain", "different": "different", "added": "added", "removed": "removed",
    "invalid": "invalid", "unreadable": "unreadable",
}  # fmt: skip


def as_text(comparison: Comparison, most: int, rest: str = ALL) -> str:
    """Text for people: the differences in each file, and a summary of several.

    Args:
        comparison: results for all files.
        most: most lines of a list, 0 for all.
        rest: words behind a list of which some lines are left out.
    """
    lines: list[str] = []
    several = len(comparison.files) > 1
    for file in comparison.files:
        if several and file.status == "same" and not _notes(file):
            continue
        lines.append(f"{printable(file.file)}: {_STATUS[file.status]}")
        lines += (f"  {printable(line)}" for line in _lines(file, most, rest))
    if several:
        lines.append(_summary_line(comparison))
    return "\n".join(lines)


def _notes(file: FileDifference) -> tuple[str, ...]:
    return file.difference.notes if file.difference else ()


def _summary_line(comparison: Comparison) -> str:
    counts = [
        f"{count:,} {_STATUS[status] if status != 'same' else 'the same'}"
        for status in _STATUS
        if (count := comparison.count(status))
    ]
    return f"{count_of(len(comparison.files), 'terrain')}: {', '.join(counts)}."


def _lines(file: FileDifference, most: int, rest: str = ALL) -> Iterator[str]:
    if file.message:
        yield file.message
    if file.hint:
        yield file.hint
    if file.difference is not None:
        yield from lines_of(file.difference, most, rest)


def lines_of(found: Difference, most: int, rest: str = ALL) -> Iterator[str]:
    """Differences in lines; a list has at most `most`, 0 for all, and words for the rest."""
    for key in found.frame:
        yield _key(key)
    yield from _limit_lines(found.entries, most, _entry, rest)
    yield from _limit_lines(_groups([*found.elements, *found.tracks]), most, _group, rest)
    if found.ground is not None:
        yield from _ground(found.ground, bare=found.storeys is not UNSET)
    if found.storeys is not UNSET:
        yield from _storeys(found.storeys, most, rest)
    for verdict in found.verdicts:
        yield from _verdict(verdict, most, rest)
    for note in found.notes:
        yield f"note: {note}"


def _limit_lines(
    items: Sequence[Any], most: int, line: Callable[[Any], str], rest: str
) -> Iterator[str]:
    shown_items = items[:most] if most else items
    yield from map(line, shown_items)
    if len(items) > len(shown_items):
        yield f"  … and {len(items) - len(shown_items):,} more{rest}"


def _key(key: KeyChange) -> str:
    return f"{key.key} {key.old or 'none'} → {key.new or 'none'}"


def _entry(entry: EntryChange) -> str:
    text = f"{_SIGNS[entry.kind]} {entry.dictionary} {entry.name}"
    if entry.was:
        text += f", before {entry.was}"
    if entry.keys:
        text += f": {'; '.join(map(_key, entry.keys))}"
    where = ", ".join(entry.places) + (", …" if entry.used > len(entry.places) else "")
    tense = "was " if entry.kind == "removed" and entry.dictionary != "part" else ""
    how = _DICTIONARIES[entry.dictionary]
    if entry.kind == "removed" and entry.dictionary == "part":
        how = "stood in"
    return f"{text}; {tense}{how} {count_of(entry.used, 'element')}: {where}"


def _groups(changes: Sequence[ElementChange]) -> list[list[ElementChange]]:
    """Group equal changes, in the order of the first of each group."""
    groups: dict[Any, list[ElementChange]] = {}
    for change in changes:
        way = change.shift and tuple(f"{part:.6g}" for part in change.shift)
        key = change.kind, change.what, way, change.keys, change.part
        groups.setdefault(key, []).append(change)
    found: list[list[ElementChange]] = []
    for group in groups.values():
        found += [group] if len(group) >= _ALIKE else [[one] for one in group]
    order = {id(change): number for number, change in enumerate(changes)}
    return sorted(found, key=lambda group: order[id(group[0])])


def _group(group: list[ElementChange]) -> str:
    first = group[0]
    place = first.place
    sign, what = _SIGNS[first.kind], first.what
    if len(group) > 1:
        descrs = list(dict.fromkeys(quote(one.descr) for one in group if one.descr))
        called = f" ({_first(descrs)})" if descrs else ""
        places = _first([_line(one.place) + _at(one) for one in group])
        return f"{sign} {len(group):,} × {what}{called}{_change(first)}: {places}"
    where = _line(place)
    descr = f" {quote(first.descr)}" if first.descr else ""
    if first.kind in ("added", "removed") and place.bounds is not None:
        west, south, east, north = place.bounds
        where += f": {_side(west, east)} × {_side(south, north)} m{_at(first)}"
    if first.elements > 1:
        where += f", {count_of(first.elements, 'element')}"
    return f"{sign} {what}{descr}{_change(first)}: {where}"


def _side(low: float, high: float) -> str:
    return f"{high - low:.6g}"


def _first(texts: Sequence[str]) -> str:
    return ", ".join([*texts[:_NAMED], *["…"] * (len(texts) > _NAMED)])


def _line(place: ElementPlace) -> str:
    return place.pointer + (f" (line {place.line})" if place.line else "")


def _at(change: ElementChange) -> str:
    """Middle of an element that came or went, as " at 12 4.5"; empty for others."""
    if change.kind not in ("added", "removed") or change.place.bounds is None:
        return ""
    west, south, east, north = change.place.bounds
    shorter = min(east - west, north - south)
    middle = (west + east) / 2, (south + north) / 2
    return f" at {located(middle, shorter / 10.0 or 1.0)}"


def _change(change: ElementChange) -> str:
    parts: list[str] = [] if change.kind == "changed" else [change.kind]
    if change.shift is not None:
        way = ", ".join(f"{part:.6g}" for part in change.shift)
        parts = [f"moved by ({way})"]
    parts += map(_key, change.keys)
    return f" {'; '.join(parts)}" if parts else ""


def _area(area: float, whole: float) -> str:
    share = f" ({per_cent(area / whole)})" if whole > 0.0 else ""
    return f"{area:.6g} m²{share}"


def _ground(ground: GroundChange, bare: bool) -> Iterator[str]:
    name = "ground without storeys" if bare else "ground"
    grid = pixels(ground.grid.width, ground.grid.height, ground.grid.resolution)
    if ground.is_same:
        yield f"{name}: no difference at the centres of {grid}"
        return
    about = ""
    if ground.error > 1e-9 * (ground.cut + ground.fill):
        about = f" ({ground.error:.2g} apart from pixels twice as wide)"
    yield f"{name}: cut {ground.cut:.6g} m³, fill {ground.fill:.6g} m³{about}"
    if ground.changed:
        assert ground.around is not None
        box = located(ground.around, ground.grid.resolution)
        yield (
            f"  higher or lower by more than {metres(ground.tolerance)}: "
            f"{_area(ground.changed, ground.common)}, within {box}"
        )
    if (largest := ground.largest) is not None:
        elements = largest.old_element or "no element"
        if largest.new_element != largest.old_element:
            elements += f", now {largest.new_element or 'no element'}"
        place = located((largest.x, largest.y), ground.grid.resolution)
        yield (
            f"  largest change {largest.change:+.6g} m at {place}: "
            f"{largest.old:.6g} → {largest.new:.6g} m, {elements}"
        )
    for name, area in (
        ("ground lost to void", ground.lost), ("ground gained from void", ground.gained),
        ("of the old terrain outside of the new one", ground.left),
        ("of the new terrain outside of the old one", ground.joined),
    ):  # fmt: skip
        if area:
            yield f"  {name}: {area:.6g} m²"
    for surface in ground.surfaces:
        names = f"{surface.old or 'none'} → {surface.new or 'none'}"
        yield f"  surface {names}: {_area(surface.area, ground.common)}"
    yield f"  compared at the centres of {grid}"


def _storeys(changes: Sequence[StoreyChange], most: int, rest: str) -> Iterator[str]:
    counts = [
        f"{count:,} {kind}"
        for kind in get_args(ChangeKind)
        if (count := sum(change.kind == kind for change in changes))
    ]
    yield f"storeys: {', '.join(counts) or 'no difference'}"
    alike: dict[tuple[str, str, str], list[StoreyChange]] = {}
    for change in changes:
        alike.setdefault((change.kind, change.what, _figures(change)), []).append(change)
    groups: list[list[StoreyChange]] = []
    for group in alike.values():
        groups += [group] if len(group) >= _ALIKE else [[one] for one in group]
    yield from (f"  {line}" for line in _limit_lines(groups, most, _storey, rest))


def _storey(group: list[StoreyChange]) -> str:
    """Line on a storey, or on several with equal changes."""
    first = group[0]
    sign, what, figures = _SIGNS[first.kind], first.what, _figures(first)
    kind = f" {first.kind}" if first.old is None or first.new is None else ""
    names = [one.pointer for change in group if (one := change.new or change.old)]
    if len(group) > 1:
        return f"{sign} {len(group):,} × {what}{kind}: {figures}: {_first(names)}"
    before = ""
    if first.old is not None and first.new is not None and first.old.pointer != names[0]:
        before = f", before {first.old.pointer}"
    return f"{sign} {what} {names[0]}{before}{kind}: {figures}"


def _figures(change: StoreyChange) -> str:
    """Figures of a storey: all of one that came or went, of others those that differ."""
    old, new, words = change.old, change.new, _FACES[change.what]
    if old is None or new is None:
        one = new or old
        assert one is not None
        parts = [
            f"{word} {_heights(heights)} m"
            for word, heights in zip(words, (one.top, one.face, one.clearance), strict=True)
            if heights
        ]
        return ", ".join([*parts, f"volume {one.volume:.6g} m³"])
    parts = []
    if change.shift is not None:
        parts = [f"moved by ({', '.join(f'{way:.6g}' for way in change.shift)})"]
    parts += [
        f"{word} {_heights(by, '+')} m"
        for word, by in zip(words, (change.top, change.face, change.clearance), strict=True)
        if by
    ]
    if change.clearance is None:
        rooms = [f"{_heights(r)} m" if r else "none" for r in (old.clearance, new.clearance)]
        parts += [f"clearance {' → '.join(rooms)}"] if rooms[0] != rooms[1] else []
    for word, unit, *sizes in (
        ("area", "m²", old.area, new.area), ("volume", "m³", old.volume, new.volume)
    ):  # fmt: skip
        before, after = (f"{size:.6g}" for size in sizes)
        if before != after:
            parts.append(f"{word} {before} → {after} {unit}")
    return ", ".join(parts)


def _heights(heights: Pair, sign: str = "") -> str:
    """Least and largest height, or one where they are equal to six digits."""
    low, high = (f"{height:{sign}.6g}" for height in heights)
    return low if low == high else f"{low} to {high}"


def _verdict(verdict: VerdictChange, most: int, rest: str) -> Iterator[str]:
    name = verdict.vehicle
    if not verdict.flips:
        yield f"{name}: all verdicts are the same, on pixels of {verdict.grid.resolution:.4g} m"
        return
    yield (
        f"{name}: {per_cent(verdict.worse)} of the ground got worse, {per_cent(verdict.better)} "
        f"better, on pixels of {verdict.grid.resolution:.4g} m"
    )
    yield from _limit_lines(
        verdict.flips,
        min(most, _FLIPS),
        lambda flip: (
            f"  {flip.old} → {flip.new}: {per_cent(flip.share)}, {flip.area:.4g} m², as at "
            f"{located((flip.x, flip.y), verdict.grid.resolution)}"
        ),
        rest,
    )
    if any(_UNKNOWN in (flip.old, flip.new) for flip in verdict.flips):
        yield f"  {_UNKNOWN}: a surface lacks a figure of its soil; validate names it (TT401)"


def as_json(comparison: Comparison, most: int) -> str:  # noqa: ARG001, as others have it
    """JSON for scripts: all differences, with the version of the format."""
    return json_text(
        DiffDocument(
            same=comparison.same,
            summary={status: comparison.count(status) for status in _STATUS},
            files=comparison.files,
        )
    )


def as_markdown(comparison: Comparison, most: int) -> str:
    """Markdown for comments and summaries of CI: a table of files, then the differences in each."""
    lines = ["## Terrains", "", _summary_line(comparison), ""]
    listed_files = [file for file in comparison.files if file.status != "same" or _notes(file)]
    if not listed_files:
        return "\n".join(lines)
    verdicts = any(file.difference and file.difference.verdicts for file in listed_files)
    head = ["file", "what", "elements", "cut, m³", "fill, m³", "area, m²", "largest, m"]
    head += ["worse", "better"] * verdicts
    lines += [markdown_row(head), markdown_row(["---"] * len(head))]
    lines += (markdown_row(_cells(file, verdicts)) for file in listed_files)
    for file in listed_files:
        said = list(_lines(file, most))
        if said:
            lines += ["", f"### {escape_markdown(file.file)}", ""]
            lines += ["```", *map(printable, said), "```"]
    return "\n".join(lines)


def _cells(file: FileDifference, verdicts: bool) -> list[str]:
    cells = [escape_markdown(file.file), _STATUS[file.status]]
    found = file.difference
    if found is None:
        return [*cells, *[""] * (5 + 2 * verdicts)]
    cells.append(_counts(found))
    ground = found.ground
    if ground is None:
        cells += [""] * 4
    else:
        largest = "" if ground.largest is None else f"{ground.largest.change:+.4g}"
        cells += [f"{ground.cut:.4g}", f"{ground.fill:.4g}", f"{ground.changed:.4g}", largest]
    if verdicts:
        shares = found.verdicts
        cells.append(per_cent(max(one.worse for one in shares)) if shares else "")
        cells.append(per_cent(max(one.better for one in shares)) if shares else "")
    return cells


def _counts(found: Difference) -> str:
    kinds = ("added", "removed", "moved", "changed")
    counts = [f"{found.count(kind)} {kind}" for kind in kinds if found.count(kind)]  # type: ignore[arg-type]
    entries = [entry.name for entry in found.entries]
    return ", ".join([*counts, *entries[:_NAMED], *["…"] * (len(entries) > _NAMED)])


def as_github(comparison: Comparison, most: int) -> str:
    """Workflow commands, which GitHub shows beside the files: one for each file that differs."""
    lines = []
    for file in comparison.files:
        if file.status == "same":
            continue
        title = f"terrain {_STATUS[file.status]}"
        text = "\n".join(_lines(file, most))
        found = file.difference
        worse = found is not None and any(one.worse for one in found.verdicts)
        level = "error" if file.status in ("invalid", "unreadable") else "notice"
        level = "warning" if worse else level
        name, line = file.file, 1
        if found is not None:
            name = found.new
            places = (one.new for one in (*found.elements, *found.tracks) if one.new is not None)
            line = next((place.line for place in places if place.file == found.new), 1) or 1
        lines.append(annotation(level, {"file": name, "line": line, "title": title}, text))
    return "\n".join([*lines, _summary_line(comparison)])


REPORTERS: dict[str, Callable[[Comparison, int], str]] = {
    "text": as_text,
    "json": as_json,
    "markdown": as_markdown,
    "github": as_github,
}
