"""Packed bytes come to no more than may be meant, in time that grows with them."""

from __future__ import annotations

import gzip
import io
import zipfile
import zlib
from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.text.packing import (
    MOST_MEMBERS,
    PLENTY,
    TIMES,
    PackingError,
    gunzip,
    most_unpacked,
    pack,
    refuse_members,
)

_compress = partial(gzip.compress, mtime=0)
_EMPTY = _compress(b"")
_ALL = 1 << 40


@given(
    parts=st.lists(st.tuples(st.binary(max_size=400), st.integers(0, 5)), max_size=8),
    repeats=st.integers(1, 40),
)
def test_members_one_after_the_other(parts: list[tuple[bytes, int]], repeats: int) -> None:
    """Of any length, empty ones too, with zeros behind each; Python's own reading is the same."""
    data = b"".join(_compress(part * repeats) + bytes(zeros) for part, zeros in parts)
    data = _EMPTY + data
    assert gunzip(data, _ALL) == gzip.decompress(data) == b"".join(p * repeats for p, _ in parts)


@pytest.mark.parametrize("size", [63, 64, 65, 100_000, 3_000_000])
def test_members_of_many_lengths(size: int) -> None:
    """The pieces in which a member is fed grow from 64 bytes on."""
    data = bytes(range(256)) * (size // 256 + 1)
    assert gunzip(gzip.compress(data, 0) + _compress(b"end"), _ALL) == data + b"end"


@pytest.mark.parametrize("keep", [1, 9, 17, -1, -4, -9])
def test_what_is_cut_off_is_broken(keep: int) -> None:
    with pytest.raises(PackingError, match=r"is broken gzip \("):
        gunzip(_compress(b"a") + _compress(b"text")[:keep], _ALL)


@pytest.mark.parametrize("tail", [b"\0x", b"\x1f\x8bx", b"x"])
def test_what_follows_is_gzip_or_zeros(tail: bytes) -> None:
    with pytest.raises(PackingError, match=r"is broken gzip \("):
        gunzip(_compress(b"text") + tail, _ALL)


def test_empty_members_take_work_as_they_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each member once copied all that follows: 150,000 took half a minute."""
    fed, stream_of = 0, zlib.decompressobj

    class Counting:
        def __init__(self, wbits: int) -> None:
            self._stream = stream_of(wbits=wbits)

        def __getattr__(self, name: str) -> Any:
            return getattr(self._stream, name)

        def decompress(self, data: bytes, most: int) -> bytes:
            nonlocal fed
            fed += len(data)
            return self._stream.decompress(data, most)

    monkeypatch.setattr(zlib, "decompressobj", Counting)
    work = []
    for count in (5_000, 60_000):
        assert gunzip(_EMPTY * count + _compress(b"{}"), _ALL) == b"{}"
        work.append(fed)
        fed = 0
    assert 0 < work[1] < 13 * work[0]
    with pytest.raises(PackingError, match=rf"more than {MOST_MEMBERS:,} members"):
        gunzip(_EMPTY * (MOST_MEMBERS + 1), _ALL)


def test_a_bomb_is_given_up_at_the_bound() -> None:
    assert len(gunzip(_compress(bytes(PLENTY)), _ALL)) == PLENTY
    for data in (bytes(PLENTY + 1), bytes(50_000_000)):
        with pytest.raises(PackingError, match=f"comes to more than {TIMES} times its size"):
            gunzip(_compress(data), _ALL)
    # the caller's own bound is said by the caller
    assert len(gunzip(_compress(bytes(5000)), 1000)) == 1001
    assert len(gunzip(_compress(bytes(50_000_000)), 1000)) == 1001


def test_what_is_written_is_read() -> None:
    """Also where it would come to far more than its size, alone and behind others."""
    for data in (b"", b"text", bytes(PLENTY + 1), bytes(20_000_000), b"0," * 9_000_000):
        packed = pack(data, _compress)
        assert gzip.decompress(packed) == gunzip(packed, _ALL) == data
        assert packed == pack(data, _compress)
    pieces = [pack(bytes(size), _compress) for size in (PLENTY, PLENTY + 5, 1_000_000)]
    assert len(gunzip(b"".join(pieces), _ALL)) == 2 * PLENTY + 1_000_005


def _zip(method: int = zipfile.ZIP_DEFLATED, size: int = 100) -> zipfile.ZipFile:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", method) as archive:
        archive.writestr("a", b"a")
        archive.writestr("b", bytes(size))
    return zipfile.ZipFile(whole)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_members_of_a_zip_are_plain_or_deflated(method: int) -> None:
    with _zip(method) as archive, pytest.raises(PackingError, match="not by deflate"):
        refuse_members(archive, ["a"], 1000)
    with _zip(zipfile.ZIP_STORED) as archive:
        refuse_members(archive, ["a", "b"], 1000)


def test_members_of_a_zip_come_to_no_more_than_may_be_meant() -> None:
    with _zip(size=PLENTY) as archive:
        refuse_members(archive, ["b"], 5000)
        with pytest.raises(PackingError, match="comes to more than"):
            refuse_members(archive, ["a", "b"], 5000)
        refuse_members(archive, ["a", "b"], PLENTY // TIMES + 1)
        refuse_members(archive, ["a"], 1)
    assert most_unpacked(1) == PLENTY and most_unpacked(PLENTY) == TIMES * PLENTY


def test_encrypted_members_are_refused() -> None:
    with _zip() as archive:
        archive.getinfo("b").flag_bits |= 1
        refuse_members(archive, ["a"], 1000)
        with pytest.raises(PackingError, match="encrypted"):
            refuse_members(archive, ["a", "b"], 1000)
