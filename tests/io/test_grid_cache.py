"""The cache of unpacked grids: what is taken from it, what is not, and what goes."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.definition.grid_files import FileIdentity, GridSource
from terratool.io import grid_cache
from terratool.io.grid_cache import GridFacts, MappedGrid, Put
from tests.commands import call

HEIGHTS = np.array([[0, 1.5, 4], [9, -2, 3]])
SOURCE = GridSource("/dem.tif", 1, FileIdentity(1, 2, 3, 4, 5, "ends"), columns=3, rows=2)
FACTS = GridFacts(SOURCE, single=False, low=-2, high=9, voids=False, edged=True)


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of a cache of its own, which is not made yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "terratool" / "grids"


@pytest.fixture
def settled(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file is marked at once."""
    monkeypatch.setattr(grid_cache, "_SETTLED", -(10**10))


@pytest.fixture
def sums(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A number for each checksum that was computed of a whole file."""
    computed: list[int] = []
    compute = grid_cache._sum

    def counted(*arguments: Any) -> int:
        computed.append(compute(*arguments))
        return computed[-1]

    monkeypatch.setattr(grid_cache, "_sum", counted)
    return computed


def write(put: Put) -> GridFacts:
    put(24, HEIGHTS[1].tobytes())
    put(0, HEIGHTS[0].tobytes())
    return FACTS


def kept(key: str = "a", how: Callable[[Put], GridFacts] = write) -> MappedGrid | None:
    return grid_cache.keep(key, FACTS, how)


def is_there(key: str = "a") -> bool:
    """Whether the heights of a key are in the cache; if so, they are right."""
    found = grid_cache.mapped(key)
    if found is None:
        return False
    assert found.facts == FACTS
    assert np.array_equal(found.data.view(np.float64).reshape(2, 3), HEIGHTS)
    return True


def listed() -> list[str]:
    return [one.path.name for one in grid_cache.files()]


def test_heights_are_kept(place: Path) -> None:
    assert not is_there() and grid_cache.facts("a") is None
    assert kept() is not None and is_there() and not is_there("b")
    assert grid_cache.facts("a") == FACTS
    assert [path.stat().st_mode & 0o777 for path in (place, place / "a.grid")] == [0o700, 0o600]


@pytest.mark.usefixtures("settled")
def test_a_file_is_read_whole_once_for_each_state(place: Path, sums: list[int]) -> None:
    """A change that keeps its size and its time is known by the time of the change of that."""
    kept()
    del sums[:]
    for _ in range(3):
        assert is_there() and not sums
    path = place / "a.grid"
    status, data = path.stat(), bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert path.stat().st_mtime_ns == status.st_mtime_ns
    assert not is_there() and len(sums) == 1
    data[-1] ^= 1
    path.write_bytes(data)
    assert is_there() and len(sums) == 2 and is_there() and len(sums) == 2


def test_a_file_that_changed_just_now_is_read_whole_each_time(
    place: Path, sums: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grid_cache, "_SETTLED", 10**12)
    kept()
    del sums[:]
    assert is_there() and is_there() and len(sums) == 2
    assert [path.name for path in place.iterdir()] == ["a.grid"]


@pytest.mark.usefixtures("settled")
@pytest.mark.parametrize("what", ["mode", "owner", "link", "text", "empty", "of another"])
def test_a_mark_that_is_not_ours_counts_for_nothing(
    what: str, place: Path, tmp_path: Path, sums: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    kept()
    kept("b")
    mark, target = place / "a.grid.whole", tmp_path / "target"
    if what == "mode":
        mark.chmod(0o622)
    elif what == "owner":
        ours = grid_cache._is_ours
        inode = mark.stat().st_ino
        monkeypatch.setattr(
            grid_cache, "_is_ours", lambda status, *more: (
                status.st_ino != inode and ours(status, *more))
        )  # fmt: skip
    elif what == "link":
        mark.rename(target)
        mark.symlink_to(target)
    else:
        mark.write_bytes(
            {"text": b"x", "empty": b""}.get(what, (place / "b.grid.whole").read_bytes())
        )
    del sums[:]
    assert is_there() and len(sums) == 1


@pytest.mark.usefixtures("settled")
def test_no_mark_is_written_through_a_link(place: Path, tmp_path: Path) -> None:
    kept()
    mark, target = place / "a.grid.whole", tmp_path / "target"
    target.write_text("mine")
    mark.unlink()
    mark.symlink_to(target)
    assert is_there() and target.read_text() == "mine"


def other_user(monkeypatch: pytest.MonkeyPatch) -> None:
    me = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: me + 1)


def test_the_folder_of_another_user_is_neither_read_nor_written(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept()
    other_user(monkeypatch)
    assert not is_there() and grid_cache.facts("a") is None and not listed()
    assert kept("b") is None and grid_cache.clear() == []
    assert [path.name for path in place.iterdir()] == ["a.grid"]


def test_the_file_of_another_user_is_not_read(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Even in a folder that is this user's."""
    kept()
    monkeypatch.setattr(grid_cache, "_own_folder", lambda: place)
    assert is_there()
    other_user(monkeypatch)
    assert not is_there() and grid_cache.facts("a") is None


@pytest.mark.parametrize("mode", [0o701, 0o710, 0o720, 0o777])
def test_a_folder_that_others_may_enter_is_done_without(place: Path, mode: int) -> None:
    kept()
    place.chmod(mode)
    assert not is_there() and kept("b") is None
    assert [path.name for path in place.iterdir()] == ["a.grid"]
    place.chmod(0o700)
    assert is_there()


def test_a_folder_that_is_a_link_is_done_without(place: Path, tmp_path: Path) -> None:
    kept()
    place.rename(tmp_path / "elsewhere")
    place.symlink_to(tmp_path / "elsewhere")
    assert not is_there() and kept("b") is None and not listed()
    assert [path.name for path in (tmp_path / "elsewhere").iterdir()] == ["a.grid"]


@pytest.mark.parametrize("mode", [0o602, 0o620])
def test_a_file_that_others_may_write_is_not_read(place: Path, mode: int) -> None:
    kept()
    (place / "a.grid").chmod(mode)
    assert not is_there()
    assert kept() is not None and is_there() and (place / "a.grid").stat().st_mode & 0o77 == 0


def test_no_byte_may_be_another(place: Path) -> None:
    """Of the head and of the heights; a byte between them is not used."""
    kept()
    path = place / "a.grid"
    data = path.read_bytes()
    used = [at for at in range(len(data)) if data[at] or at >= len(data) - HEIGHTS.nbytes]
    for at in (*used[:30], *used[30::17], len(data) - 1):
        path.write_bytes(data[:at] + bytes([data[at] ^ 64]) + data[at + 1 :])
        assert not is_there(), at
    for cut in (data[:-1], data + b"\0", data[:20], b""):
        path.write_bytes(cut)
        assert not is_there()
    path.write_bytes(data)
    assert is_there()


def test_what_is_no_file_is_not_opened(place: Path) -> None:
    kept()
    (place / "a.grid").unlink()
    os.mkfifo(place / "a.grid")
    assert not is_there() and grid_cache.facts("a") is None
    assert kept() is None or is_there()


def test_a_disk_that_is_full_is_told_by_none_and_leaves_nothing(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether that is known beforehand, or as it is written."""

    def full(put: Put) -> GridFacts:
        write(put)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    assert kept(how=full) is None and list(place.iterdir()) == []
    monkeypatch.setattr(grid_cache, "free_bytes", lambda _: 2 * HEIGHTS.nbytes - 1)
    assert kept() is None and list(place.iterdir()) == []
    monkeypatch.setattr(grid_cache, "free_bytes", lambda _: 2 * HEIGHTS.nbytes)
    assert kept() is not None


def test_a_grid_larger_than_the_cache_is_not_kept(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grid_cache, "MOST_BYTES", HEIGHTS.nbytes - 1)
    assert kept() is None and list(place.iterdir()) == []


@pytest.mark.usefixtures("settled")
def test_the_least_recently_used_go(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With their marks, and not the newest."""
    for key in "abc":
        kept(key)
    for age, key in enumerate("abc"):
        os.utime(place / f"{key}.grid.whole", (100 + age, 100 + age))
    assert is_there("a") and listed() == ["b.grid", "c.grid", "a.grid"]
    monkeypatch.setattr(grid_cache, "MOST_BYTES", 3 * grid_cache.files()[0].nbytes)
    for age, path in enumerate(one.path for one in grid_cache.files()):
        later = time.time() + 1000 + age
        os.utime(f"{path}.whole", (later, later))
    kept("d")
    assert sorted(listed()) == ["a.grid", "c.grid", "d.grid"]
    names = {path.name for path in place.iterdir()}
    assert names == {f"{key}.grid{mark}" for key in "acd" for mark in ("", ".whole")}
    assert len(grid_cache.clear()) == 3
    assert list(place.iterdir()) == []


KILLED = """
import os, signal
from tests.io.test_grid_cache import kept, write

def die(put):
    write(put)
    os.kill(os.getpid(), signal.SIGKILL)

kept(how=die)
"""


@pytest.fixture
def left(place: Path) -> Iterator[Path]:
    """What a process left that was killed as it wrote."""
    ended = subprocess.run(
        [sys.executable, "-c", KILLED], check=False, cwd=Path(__file__).parents[2]
    )
    assert ended.returncode == -signal.SIGKILL
    (folder,) = place.iterdir()
    yield folder


@pytest.mark.slow
def test_what_a_killed_process_left_is_listed_and_cleared(left: Path) -> None:
    size = sum(path.stat().st_size for path in left.iterdir())
    assert size >= HEIGHTS.nbytes
    assert f"1 raster, {size:,} bytes\n" in call("cache").out
    assert "1 raster" in call("cache", "--clear").out
    assert not left.exists()


@pytest.mark.slow
def test_what_a_process_of_another_machine_left_is_cleared(left: Path) -> None:
    """Or of this machine before it was started anew: no process can be asked for it."""
    other = left.rename(left.with_name(".terratool-00000000-1-0123456789ab.part"))
    assert listed() == [other.name]
    grid_cache.clear()
    assert not other.exists()


def test_what_a_process_is_writing_stays(place: Path) -> None:
    seen = []

    def look(put: Put) -> GridFacts:
        seen.extend(path.name for path in place.iterdir())
        assert grid_cache.files() == [] and grid_cache.clear() == []
        return write(put)

    assert kept(how=look) is not None and len(seen) == 1
    assert is_there()


def test_an_error_in_the_reading_of_a_file_is_no_crash(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept()

    def broken(*_: Any) -> int:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(grid_cache, "_read_head", broken)
    assert not is_there() and grid_cache.facts("a") is None
    monkeypatch.undo()
    monkeypatch.setenv("XDG_CACHE_HOME", str(place.parents[1]))
    monkeypatch.setattr(grid_cache, "_sum", broken)
    assert not is_there()
