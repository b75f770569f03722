"""Text to definition: the fast way for clean files, the one that explains for the others."""

from __future__ import annotations

import gc
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from terratool.definition import jsontext, structure
from terratool.definition.findings import Finding, Remark, shown, unescape
from terratool.definition.jsontext import JsonText, MisspeltError
from terratool.definition.model import Definition
from terratool.definition.rules import Subject, all_rules
from terratool.definition.source import Source, read_source
from terratool.definition.tree import flatten
from terratool.errors import DefinitionError

Coded = tuple[str, Remark]

_NOT_PLAIN = (b'"x-', b"\\u00")
"""Keys of one's own, and a spelling of colons that keeps keys from being counted."""


@dataclass(frozen=True, slots=True)
class Checked:
    """A text that was read: its definition, if it has no error, and all findings by position."""

    definition: Definition | None
    findings: tuple[Finding, ...]


def load_definition(path: str | Path) -> Definition:
    """Read a definition that has no errors.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: it has errors; they are in `findings`.
    """
    checked = check(read_source(path))
    if checked.definition is None:
        errors = tuple(f for f in checked.findings if f.severity == "error")
        first = errors[0]
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise DefinitionError(
            f"{first.file}:{first.line}:{first.column}: {first.code}: {first.message}{more}",
            first.hint,
            errors,
        )
    return checked.definition


def check(source: Source) -> Checked:
    """Read a text and let every rule look at it. Never raises for what the text contains."""
    definition = _decode(source.data)
    if definition is not None and not _apply_rules(definition):
        return Checked(definition, ())
    try:
        text = jsontext.parse(source.data.decode("utf-8"))
    except UnicodeDecodeError as error:
        return Checked(None, (_bad_encoding(source, error),))
    except MisspeltError as error:
        return Checked(None, (_misspelt(source, error),))
    definition, coded = structure.build(text.value)
    if definition is not None:
        faulty = {remark.pointer for _, remark in coded}
        above = {p[:end] for p in faulty for end in _ends(p)}
        coded += [
            found for found in _apply_rules(definition) if not _follows(*found, faulty, above)
        ]
    findings = [_duplicate(source, text, *each) for each in text.duplicates]
    findings += [_place(source, text, *each) for each in coded]
    if any(finding.severity == "error" for finding in findings):
        definition = None
    return Checked(definition, tuple(sorted(findings, key=lambda f: (f.line, f.column, f.code))))


def _decode(data: bytes) -> Definition | None:
    """The definition if the text is clean JSON of the right types without duplicate keys."""
    if any(sign in data for sign in _NOT_PLAIN):
        return None
    was_enabled = gc.isenabled()
    gc.disable()  # a million new objects and no garbage
    try:
        definition = msgspec.json.decode(data, type=Definition)
        if isinstance(definition.crs, dict):
            return None  # free values, which may hold infinities
        # A key is lost where it stood twice: what was kept, written again, has fewer colons. Those
        # inside of texts are in both alike.
        again = msgspec.json.encode(definition)
        return definition if data.count(b":") == again.count(b":") else None
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return None
    finally:
        if was_enabled:
            gc.enable()


def _apply_rules(definition: Definition) -> list[Coded]:
    subject = Subject(definition, flatten(definition))
    return [
        (rule.code, remark)
        for rule in all_rules().values()
        if rule.check is not None
        for remark in rule.check(subject)
    ]


def _ends(pointer: str) -> list[int]:
    """Where the pointer and those of all values around it end."""
    return [i for i, char in enumerate(pointer) if char == "/"] + [len(pointer)]


def _follows(code: str, remark: Remark, faulty: set[str], above: set[str]) -> bool:
    """Whether a remark only follows from a value that did not fit and was left out.

    `faulty` are the pointers of such values, `above` these and those of all values around them.
    """
    pointer = remark.pointer
    if code == "TT104":
        return pointer in faulty or f"{pointer}/{remark.missing}" in above
    if code == "TT303":
        return pointer in faulty or f"{pointer}/x" in above or f"{pointer}/y" in above
    if code == "TT202":
        return "/surfTypes" in faulty
    if code == "TT203":
        element = pointer.split("/span/")[0].removesuffix("/cellX").removesuffix("/cellY")
        parent = element.rsplit("/children/", 1)[0]
        return f"{parent}/cells" in above or f"{element}/span" in above
    return False


def _place(source: Source, text: JsonText, code: str, remark: Remark) -> Finding:
    offset = text.offset(remark.pointer, remark.on_key)
    return _finding(source, code, remark, text.line_column(offset))


def _finding(source: Source, code: str, remark: Remark, place: tuple[int, int]) -> Finding:
    severity = all_rules()[code].severity
    line, column = place
    return Finding(
        source.name, code, severity, remark.pointer, line, column, remark.message, remark.hint,
        remark.bounds,
    )  # fmt: skip


def _duplicate(source: Source, text: JsonText, pointer: str, offset: int) -> Finding:
    remark = Remark(
        pointer,
        f"the key {shown(_last(pointer))} stands twice in one object.",
        "Remove or rename one of the two.",
        on_key=True,
    )
    return _finding(source, "TT102", remark, text.line_column(offset))


def _last(pointer: str) -> str:
    return unescape(pointer.rsplit("/", 1)[1])


def _misspelt(source: Source, error: MisspeltError) -> Finding:
    remark: Any = Remark("", error.message, error.hint)
    return _finding(source, error.code, remark, _line_column(source.data, error.offset))


def _bad_encoding(source: Source, error: UnicodeDecodeError) -> Finding:
    remark = Remark(
        "", f"the byte 0x{source.data[error.start]:02X} is no UTF-8.", "Save the file as UTF-8."
    )
    before = source.data[: error.start]
    return _finding(source, "TT109", remark, _line_column(before, len(before.decode("utf-8"))))


def _line_column(data: bytes, offset: int) -> tuple[int, int]:
    starts = list(jsontext.line_starts(data.decode("utf-8")[:offset]))
    return len(starts), offset - starts[-1] + 1
