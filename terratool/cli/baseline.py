"""Baselines: files of known findings, from which new findings are told apart."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import msgspec
from msgspec import Struct

from terratool.definition.findings import Finding
from terratool.errors import ReadError
from terratool.output import whole_file
from terratool.text.files import open_file

FORMAT_VERSION = 1


class Baseline(Struct, frozen=True, forbid_unknown_fields=True):
    """Known findings.

    Attributes:
        findings: number of known findings by fingerprint, by name of the file relative to the
            folder of the baseline.
        format_version: version of the format.
    """

    findings: dict[str, dict[str, int]]
    format_version: int = FORMAT_VERSION


def fingerprint(finding: Finding) -> str:
    """Digest of a finding's code, message and text there, which stays when lines move."""
    text = finding.excerpt.text if finding.excerpt else ""
    return digest(finding.code, finding.message, text)


def digest(*texts: str) -> str:
    """Digest of texts: 128 bits of their SHA-256, in hexadecimal digits."""
    from hashlib import sha256

    return sha256("\n".join(texts).encode("utf-8", "surrogatepass")).hexdigest()[:32]


def read_baseline(path: str) -> Baseline:
    """Read a baseline.

    Raises:
        ReadError: the file cannot be read, or is no baseline.
    """
    try:
        with open_file(path) as file:
            found = msgspec.json.decode(file.read(), type=Baseline)
    except OSError as error:
        raise ReadError.of(path, error, "Write it first, with --update-baseline.") from error
    except (msgspec.MsgspecError, RecursionError, ValueError) as error:
        raise ReadError(
            f"{path}: is no baseline ({error}).", "Write it anew, with --update-baseline."
        ) from error
    if found.format_version != FORMAT_VERSION:
        raise ReadError(
            f"{path}: is a baseline of version {found.format_version}.",
            "Write it anew, with --update-baseline.",
        )
    return found


def write_baseline(path: str, findings: Iterable[Finding]) -> None:
    """Write a baseline of findings.

    Raises:
        WriteError: the file cannot be written.
    """
    known: dict[str, Counter[str]] = {}
    for finding in findings:
        known.setdefault(_name(path, finding), Counter())[fingerprint(finding)] += 1
    data = msgspec.json.encode(Baseline({k: dict(v) for k, v in known.items()}), order="sorted")
    with whole_file(path, overwrite=True) as part:
        part.write_bytes(msgspec.json.format(data, indent=1) + b"\n")


class KnownFindings:
    """Known findings that are left to take out, each as often as the baseline has it.

    Args:
        path: file of the baseline.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._left = {
            name: Counter(counts) for name, counts in read_baseline(path).findings.items()
        }

    def unknown(self, findings: Iterable[Finding]) -> list[Finding]:
        """Findings that are not known; known ones are used up."""
        return [finding for finding in findings if not self._take(finding)]

    def _take(self, finding: Finding) -> bool:
        left = self._left.get(_name(self._path, finding))
        mark = fingerprint(finding)
        if left is None or left[mark] <= 0:
            return False
        left[mark] -= 1
        return True


def _name(path: str, finding: Finding) -> str:
    """Name of a finding's file in a baseline; bytes that are no UTF-8 become escapes."""
    name = Path(os.path.relpath(finding.file, Path(path).parent)).as_posix()
    return name.encode("utf-8", "backslashreplace").decode()
