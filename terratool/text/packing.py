"""Unpacking of gzip and zip up to a limit, so that a small file cannot fill the memory."""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import zipfile

GZIP = b"\x1f\x8b"
"""First two bytes of a gzip."""
PLENTY = 1 << 22
"""Unpacked bytes that are allowed whatever the packed size."""
TIMES = 100
"""Unpacked bytes allowed per packed byte, where that is more than `PLENTY`."""
MOST_MEMBERS = 1 << 16
"""Most members of a gzip; BGZF packs 64 KiB into each, so that 2 GiB of text have half as many."""

_FIRST_STEP = 1 << 6
"""Packed bytes of a member that are unpacked first; the step doubles up to `_LARGEST_STEP`."""
_LARGEST_STEP = 1 << 20
_ENCRYPTED = 0x1
_GUNZIP = "Unpack it with gunzip first, if it is meant to be so large."
_padding = re.compile(rb"\0*").match


class PackingError(Exception):
    """Broken packed bytes, or bytes that unpack to more than is allowed.

    Args:
        message: sentence on the fault, to stand behind a file's name.
        hint: sentence on the remedy.
    """

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.message, self.hint = message, hint


def most_unpacked(size: int) -> int:
    """Return the most unpacked bytes that a packed file of a size in bytes may have."""
    return max(PLENTY, TIMES * size)


def pack(data: bytes, compress: Callable[[bytes], bytes]) -> bytes:
    """Pack bytes into a gzip that `gunzip` accepts.

    Of bytes that pack too well for the limit, a part is stored without compression.

    Args:
        data: bytes to pack.
        compress: returns a gzip of bytes.
    """
    packed = compress(data)
    if len(data) <= TIMES * len(packed):
        return packed
    plain = len(data) // TIMES + 1
    import gzip

    return gzip.compress(data[:plain], 0, mtime=0) + compress(data[plain:])


def gunzip(data: bytes, most: int) -> bytes:
    """Unpack a gzip, in time proportional to its packed and unpacked size.

    Args:
        data: one member or several; zeros may stand behind each.
        most: limit of the unpacked bytes; of a longer text the first `most` + 1 are returned.

    Raises:
        PackingError: the gzip is broken, unpacks to far more than its size, or has too many
            members.
    """
    parts: list[bytes] = []
    allowed = min(most, most_unpacked(len(data)))
    at = size = members = 0
    while at < len(data) and size <= allowed:
        members += 1
        if members > MOST_MEMBERS:
            raise PackingError(f"is gzip of more than {MOST_MEMBERS:,} members.", _GUNZIP)
        stream, step = zlib.decompressobj(wbits=31), _FIRST_STEP
        # zlib copies the bytes behind a member, so that the first step is small
        while not stream.eof and size <= allowed:
            fed = data[at : at + step]
            if not fed:
                raise _gzip_error("the stream ends too early")
            try:
                part = stream.decompress(fed, allowed + 1 - size)
            except zlib.error as error:
                # zlib's words without the error number
                raise _gzip_error(str(error).rsplit(": ", 1)[-1]) from error
            parts.append(part)
            size += len(part)
            at += len(fed)
            step = min(2 * step, _LARGEST_STEP)
        at = _padding(data, at - len(stream.unused_data)).end()  # type: ignore[union-attr]
    if allowed < min(size, most):
        raise PackingError(f"comes to more than {TIMES} times its size.", _GUNZIP)
    return b"".join(parts)


def _gzip_error(reason: str) -> PackingError:
    return PackingError(f"is broken gzip ({reason}).", "Write or fetch the file again.")


def refuse_members(archive: zipfile.ZipFile, names: Iterable[str], size: int) -> None:
    """Refuse members of a zip archive before they are read: encrypted, oddly packed or too large.

    Reading a member never gives more bytes than the archive declares for it.

    Args:
        archive: open archive.
        names: names of the members that are to be read.
        size: size of the archive in bytes.

    Raises:
        PackingError: a member is encrypted or packed otherwise than by deflate, or all of them come
            to too many bytes.
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
