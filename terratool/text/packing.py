"""Packed bytes, gzip and zip, unpacked no further than may be meant."""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import zipfile

GZIP = b"\x1f\x8b"
"""What gzip begins with."""
PLENTY, TIMES = 1 << 22, 100
"""What is packed may come to so many bytes, or to so many times its own, whichever is more."""
MOST_MEMBERS = 1 << 16
"""Most members of a gzip; BGZF has 64 KiB in each, so that 2 GiB of text are half as many."""

_FIRST, _LARGEST = 1 << 6, 1 << 20
_ENCRYPTED = 0x1
_GUNZIP = "Unpack it with gunzip first, if it is meant to be so large."
_padding = re.compile(rb"\0*").match


class PackingError(Exception):
    """Packed bytes are broken, or come to more than may be meant.

    Args:
        message: what is wrong with a file, to stand behind its name.
        hint: what to do.
    """

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.message, self.hint = message, hint


def most_unpacked(size: int) -> int:
    """Bytes that a packed file of so many may come to."""
    return max(PLENTY, TIMES * size)


def pack(data: bytes, compress: Callable[[bytes], bytes]) -> bytes:
    """A gzip that `gunzip` takes, alone or behind others: some is stored where it is too small.

    Args:
        data: what is packed.
        compress: makes a gzip of some bytes.
    """
    packed = compress(data)
    if len(data) <= TIMES * len(packed):
        return packed
    plain = len(data) // TIMES + 1
    import gzip

    return gzip.compress(data[:plain], 0, mtime=0) + compress(data[plain:])


def gunzip(data: bytes, most: int) -> bytes:
    """The bytes that a gzip packs, in time proportional to both.

    Args:
        data: one member or several, zeros behind each allowed.
        most: what they may come to; of more one byte too many is given.

    Raises:
        PackingError: it is broken, comes to far more than its size, or has too many members.
    """
    parts: list[bytes] = []
    allowed = min(most, most_unpacked(len(data)))
    at = size = members = 0
    while at < len(data) and size <= allowed:
        members += 1
        if members > MOST_MEMBERS:
            raise PackingError(f"is gzip of more than {MOST_MEMBERS:,} members.", _GUNZIP)
        stream, step = zlib.decompressobj(wbits=31), _FIRST
        # what is behind a member is copied at its end, so that it gets little at first
        while not stream.eof and size <= allowed:
            fed = data[at : at + step]
            if not fed:
                raise _broken("the stream ends too early")
            try:
                part = stream.decompress(fed, allowed + 1 - size)
            except zlib.error as error:
                # without the number of the error
                raise _broken(str(error).rsplit(": ", 1)[-1]) from error
            parts.append(part)
            size += len(part)
            at += len(fed)
            step = min(2 * step, _LARGEST)
        at = _padding(data, at - len(stream.unused_data)).end()  # type: ignore[union-attr]
    if allowed < min(size, most):
        raise PackingError(f"comes to more than {TIMES} times its size.", _GUNZIP)
    return b"".join(parts)


def _broken(reason: str) -> PackingError:
    return PackingError(f"is broken gzip ({reason}).", "Write or fetch the file again.")


def refuse_members(archive: zipfile.ZipFile, names: Iterable[str], size: int) -> None:
    """Refuse members of a zip archive that cannot be meant, before any of them is read.

    No more is read of a member than it says that it has.

    Args:
        archive: which is open.
        names: of the members that are to be read.
        size: of the archive, in bytes.

    Raises:
        PackingError: they are encrypted, packed otherwise than by deflate, or come to too much.
    """
    import zipfile

    members = [archive.getinfo(name) for name in names]
    for member in members:
        if member.flag_bits & _ENCRYPTED:
            raise PackingError("is an archive that is encrypted.", "Save it without a password.")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise PackingError("is packed, and not by deflate.", "Pack it as zip does, or not.")
    if sum(member.file_size for member in members) > most_unpacked(size):
        raise PackingError(
            f"comes to more than {TIMES} times its size.", "Save it without compression."
        )
