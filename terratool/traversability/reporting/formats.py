"""The formats of a report's file, by suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from terratool.text.display import shown
from terratool.errors import RequestError
from terratool.traversability.reporting.document import as_json
from terratool.traversability.reporting.markdown import as_markdown
from terratool.traversability.reporting.page import as_page
from terratool.traversability.results import TraversabilityReport

FORMATS: dict[str, Callable[[TraversabilityReport], str]] = {
    ".json": as_json,
    ".md": as_markdown,
    ".html": as_page,
}


def renderer_of(path: str | Path) -> Callable[[TraversabilityReport], str]:
    """What makes the text of a report's file of this name.

    Raises:
        RequestError: there is no such format.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        what = f"there are no reports as {shown(suffix)}" if suffix else "has no suffix"
        raise RequestError(f"{path}: {what}.", f"Let it end in {', '.join(FORMATS)}.")
    return FORMATS[suffix]
