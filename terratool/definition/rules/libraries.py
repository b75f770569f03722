"""Rules on libraries that a file uses, and on the names that it has from them."""

from __future__ import annotations

from collections.abc import Iterator

from terratool.definition.findings import Remark
from terratool.definition.libraries import DICTIONARIES, Dictionary
from terratool.definition.rules.base import Subject, reader_rule, rule
from terratool.text.display import escape, quote

_NOUNS: dict[Dictionary, str] = {
    "surfTypes": "surface", "elemTypes": "primitive", "parts": "part",
}  # fmt: skip

reader_rule(
    "TT701",
    "unreadable-library",
    """
    A library cannot be read: it is missing, a folder, no regular file, or too large.

    Paths begin at the folder of the file that names the library. A definition may use 1,000
    libraries, directly or through others, name them 10,000 times, and have 1 GiB of text in them.

    Fails:

        {
          "size": 10, "use": ["kit/boxes.json"],
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: check the path and the file.
    """,
)
reader_rule(
    "TT702",
    "library-path",
    """
    The path of a library is none that may be followed.

    It is relative to the file that names it, with forward slashes; nothing is read from the net.
    The library lies under the folder of the terrain, under the current folder, or under one that
    is named by --library-root, so that a file from elsewhere cannot have others read. Where
    several files are validated together, the folders of all of them count.

    Fails:

        {
          "size": 10, "use": ["https://example.org/kit.json"],
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    Fails:

        {
          "size": 10, "use": ["/kit/boxes.json"],
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: put the library beside the terrain, and write its path from there.
    """,
)
reader_rule(
    "TT703",
    "no-library",
    """
    A file that is used is a terrain or a vehicle.

    A library has surfTypes, elemTypes and parts, and no size and no elemTree, so that it can stand
    nowhere by itself.

    Fails:

        site.json: {"size": 5, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

        {
          "size": 10, "use": ["site.json"],
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    Passes:

        kit.json: {"elemTypes": {"box": {"x": [1]}}}

        {"size": 10, "use": ["kit.json"], "elemTree": {"type": "box"}}

    To mend: move what both need into a library, and use that.
    """,
)
reader_rule(
    "TT706",
    "broken-library",
    """
    A library that is used has errors.

    They are reported with the place in the library where they stand. Here the entry of use is named
    that leads there.

    Fails:

        kit.json: {"elemTypes": {"box": {"x": [1], "combine": "times"}}}

        {"size": 10, "use": ["kit.json"], "elemTree": {"type": "box"}}

    Passes:

        kit.json: {"elemTypes": {"box": {"x": [1], "combine": "product"}}}

        {"size": 10, "use": ["kit.json"], "elemTree": {"type": "box"}}

    To mend: correct the library.
    """,
)


@rule("TT704", "ambiguous-name")
def ambiguous_name(subject: Subject) -> Iterator[Remark]:
    """Two libraries have one name, and the file itself does not say what it is.

    What a file defines itself wins over its libraries; among libraries none wins.

    Fails:

        one.json: {"elemTypes": {"box": {"x": [1]}}}

        two.json: {"elemTypes": {"box": {"x": [0, 1]}}}

        {"size": 10, "use": ["one.json", "two.json"], "elemTree": {"type": "box"}}

    Passes:

        one.json: {"elemTypes": {"box": {"x": [1]}}}

        two.json: {"elemTypes": {"ramp": {"x": [0, 1]}}}

        {
          "size": 10, "use": ["one.json", "two.json"],
          "elemTree": {
            "type": "box", "children": [{"type": "ramp", "cellX": 0, "cellY": 0}]
          }
        }

    To mend: rename one of the two, or define the name in the file itself.
    """
    through: dict[int, int] = {}
    for index, library in enumerate(subject.document.uses if subject.clashes else ()):
        for one in () if library is None else (library, *library.all_libraries):
            through.setdefault(id(one), index)
    for clash in subject.clashes:
        yield Remark(
            f"/use/{through[id(clash.second)]}",
            f"the {_NOUNS[clash.dictionary]} {quote(clash.name)} is in "
            f"{quote(clash.first.source.name)} and in {quote(clash.second.source.name)}.",
            f'Rename one of the two, or define it in "{clash.dictionary}" here.',
        )


@rule("TT705", "library-circle")
def library_circle(subject: Subject) -> Iterator[Remark]:
    """A library uses itself, directly or through others.

    Fails:

        kit.json: {"use": ["kit.json"], "elemTypes": {"box": {"x": [1]}}}

        {"size": 10, "use": ["kit.json"], "elemTree": {"type": "box"}}

    Passes:

        kit.json: {"elemTypes": {"box": {"x": [1]}}}

        {"size": 10, "use": ["kit.json"], "elemTree": {"type": "box"}}

    To mend: move what both need into a library of its own.
    """
    document = subject.document
    for index, library in enumerate(document.uses):
        if library is None:
            continue
        if document is library:
            yield Remark(f"/use/{index}", "the library uses itself.", "Remove this path.")
        elif document.catalogue.reaches(library, document):
            yield Remark(
                f"/use/{index}",
                f"the library {quote(library.source.name)} uses this file, which uses it.",
                "Move what both need into a library of its own.",
            )


@rule("TT716", "unused-library", "warning")
def unused_library(subject: Subject) -> Iterator[Remark]:
    """A terrain uses nothing of a library, nor of those behind it.

    While a library is missing, nothing is said.

    Fails:

        kit.json: {"elemTypes": {"ramp": {"x": [0, 1]}}}

        {
          "size": 10, "use": ["kit.json"],
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}
        }

    Passes:

        kit.json: {"elemTypes": {"ramp": {"x": [0, 1]}}}

        {"size": 10, "use": ["kit.json"], "elemTree": {"type": "ramp"}}

    To mend: remove its path from use.
    """
    if not subject.document.uses or subject.is_library:
        return
    if subject.uses.has_unknown_part or subject.lacks_library:
        return
    needed = subject.uses.needed_names
    for index, library in enumerate(subject.document.uses):
        if library is None:
            continue
        if not any(
            not needed[dictionary].keys().isdisjoint(one.entries[dictionary])
            for one in (library, *library.all_libraries)
            for dictionary in DICTIONARIES
        ):
            yield Remark(
                f"/use/{index}",
                f"nothing is used of the library {quote(library.source.name)}.",
                "Remove its path.",
            )


@rule("TT718", "hiding-name", "warning")
def hiding_name(subject: Subject) -> Iterator[Remark]:
    """A name of the file hides the same name of a library.

    What the file defines itself wins, also where parts of the library use the name.

    Fails:

        kit.json: {"elemTypes": {"box": {"x": [1]}}}

        {
          "size": 10, "use": ["kit.json"],
          "elemTypes": {"box": {"x": [0, 1, 0]}}, "elemTree": {"type": "box"}
        }

    Passes:

        kit.json: {"elemTypes": {"box": {"x": [1]}}}

        {
          "size": 10, "use": ["kit.json"],
          "elemTypes": {"roof": {"x": [0, 1, 0]}},
          "elemTree": {"type": "box", "children": [{"type": "roof", "cellX": 0, "cellY": 0}]}
        }

    To mend: rename it, or remove it if the library's is meant. Where hiding is meant, silence TT718
    by x-ignore.
    """
    document = subject.document
    for dictionary in DICTIONARIES:
        own = document.entries[dictionary]
        repeated = [name for name in document.catalogue.repeated_names[dictionary] if name in own]
        hidden = [
            (library, name)
            for name in repeated
            for library in document.catalogue.homes(document, dictionary, name)
        ]
        for library, name in sorted(hidden, key=lambda one: one[0].source.name):
            yield Remark(
                f"/{dictionary}/{escape(name)}",
                f"the {_NOUNS[dictionary]} {quote(name)} hides that of the library "
                f"{quote(library.source.name)}.",
                "Rename it, or remove it if the library's is meant.",
                on_key=True,
            )
