"""Formats of reports by the suffixes of their files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from terratool.errors import RequestError
from terratool.text.display import quote
from terratool.traversability.report.curves import as_svg
from terratool.traversability.report.document import as_json
from terratool.traversability.report.page import as_markdown, as_page
from terratool.traversability.report.routes import as_geojson
from terratool.traversability.results import Reports

FORMATS: dict[str, Callable[[Reports], str]] = {
    ".json": as_json,
    ".md": as_markdown,
    ".html": as_page,
    ".svg": as_svg,
    ".geojson": as_geojson,
}


def renderer_of(path: str | Path) -> Callable[[Reports], str]:
    """Function that makes the text of a report, by the suffix of its file.

    Raises:
        RequestError: no format has the suffix.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        what = f"there are no reports as {quote(suffix)}" if suffix else "has no suffix"
        raise RequestError(f"{path}: {what}.", f"Let it end in {', '.join(FORMATS)}.")
    return FORMATS[suffix]
