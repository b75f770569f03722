"""Text to definition: the fast way for clean files, the one that explains for the others."""

from __future__ import annotations

import gc
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from terratool.definition import jsontext, structure
from terratool.definition.findings import Finding, Remark, unescape
from terratool.definition.jsontext import JsonText, MisspeltError
from terratool.definition.model import Definition
from terratool.definition.rules import Subject, all_rules
from terratool.definition.source import Source, read_source
from terratool.definition.tree import flatten
from terratool.errors import DefinitionError

Coded = tuple[str, Remark]

_NOT_PLAIN = (b'"x-', b'" :', b'"\t:', b'"\r:', b'"\n:', b"\\u00")
"""Keys of one's own, and spellings that keep keys from being counted."""


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
    text: JsonText | None = None
    coded: list[Coded] = []
    definition = _decode(source.data)
    if definition is None:
        try:
            text = jsontext.parse(source.data.decode("utf-8"))
        except UnicodeDecodeError as error:
            return Checked(None, (_bad_encoding(source, error),))
        except MisspeltError as error:
            return Checked(None, (_misspelt(source, error),))
        definition, coded = structure.build(text.value)
    duplicates = [_duplicate(source, text, *each) for each in text.duplicates] if text else []
    if definition is not None:
        coded += _apply_rules(definition, {remark.pointer for _, remark in coded})
    findings = duplicates
    if coded:
        text = text or jsontext.parse(source.data.decode("utf-8"))
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
        # A key is lost where it stood twice: what was kept, written again, has fewer keys. A quote
        # and colon inside a text are an escaped quote, which both texts have alike.
        again = msgspec.json.encode(definition)
        return definition if data.count(b'":') == again.count(b'":') else None
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return None
    finally:
        if was_enabled:
            gc.enable()


def _apply_rules(definition: Definition, known: set[str]) -> list[Coded]:
    subject = Subject(definition, flatten(definition))
    found = [
        (rule.code, remark)
        for rule in all_rules().values()
        if rule.check is not None
        for remark in rule.check(subject)
    ]
    return [(code, remark) for code, remark in found if not _follows(code, remark, known)]


def _follows(code: str, remark: Remark, known: Iterable[str]) -> bool:
    """A key that was there but did not fit is not missing besides."""
    if code == "TT104":
        return f"{remark.pointer}/{remark.missing}" in known
    return code == "TT303" and any(
        p in known for p in (remark.pointer + "/x", remark.pointer + "/y")
    )


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
        f'the key "{_last(pointer)}" stands twice in one object.',
        "Remove or rename one of the two.",
        on_key=True,
    )
    return _finding(source, "TT102", remark, text.line_column(offset))


def _last(pointer: str) -> str:
    return unescape(pointer.rsplit("/", 1)[1])


def _misspelt(source: Source, error: MisspeltError) -> Finding:
    remark: Any = Remark("", error.message, error.hint)
    text = source.data.decode("utf-8")
    return _finding(source, error.code, remark, jsontext.line_column(text, error.offset))


def _bad_encoding(source: Source, error: UnicodeDecodeError) -> Finding:
    before = source.data[: error.start].decode("utf-8")
    remark = Remark(
        "", f"the byte 0x{source.data[error.start]:02X} is no UTF-8.", "Save the file as UTF-8."
    )
    return _finding(source, "TT109", remark, jsontext.line_column(before, len(before)))
