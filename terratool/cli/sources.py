"""Files of names and folders that a command is given."""

from __future__ import annotations

from collections.abc import Iterator

from terratool.cli.report import Unreadable
from terratool.errors import ReadError
from terratool.text.source import leads_out, sources


def files_of(given: str, reached: tuple[str, ...], unreadable: list[Unreadable]) -> Iterator[str]:
    """Yield the file of a name, or the files of a folder, without links out of some folders.

    Args:
        given: name of a file or a folder.
        reached: folders to which links in a folder may lead.
        unreadable: list that gets what cannot be read.
    """
    try:
        for name in sources(given):
            if name != given and leads_out(name, reached):
                message = f"{name}: is a link out of the folders that may be read."
                hint = "Put the file itself there, or name its folder by --library-root."
                unreadable.append(Unreadable(name, message, hint))
            else:
                yield name
    except ReadError as error:
        unreadable.append(Unreadable(given, error.message, error.hint))
