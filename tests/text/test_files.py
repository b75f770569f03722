"""What is no regular file holds nobody up, unless a user named it."""

from __future__ import annotations

import os
import socket
import threading
from pathlib import Path

import pytest

from terratool.errors import ReadError
from terratool.text.files import is_regular, open_file
from terratool.text.source import read_source

pytestmark = pytest.mark.skipif(os.name == "nt", reason="there are no pipes with names")
ZERO = "/dev/zero"


@pytest.fixture
def special(tmp_path: Path) -> dict[str, Path]:
    """A pipe that nobody writes into, a socket, links to a device and to a pipe, a folder."""
    found = {
        name: tmp_path / name for name in ("pipe", "socket", "device", "null", "link", "folder")
    }
    os.mkfifo(found["pipe"])
    with socket.socket(socket.AF_UNIX) as one:
        before = Path.cwd()
        os.chdir(tmp_path)  # names of sockets are short
        try:
            one.bind("socket")
        finally:
            os.chdir(before)
    found["device"].symlink_to(ZERO)
    found["null"].symlink_to(os.devnull)
    found["link"].symlink_to("pipe")
    found["folder"].mkdir()
    return found


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("pipe", "it is a pipe"),
        ("link", "it is a pipe"),
        ("socket", "it is a socket"),
        ("device", "it is a device"),
        ("null", "it is a device"),
        ("folder", "directory"),
    ],
)
def test_what_nobody_named_is_a_regular_file(
    special: dict[str, Path], name: str, said: str
) -> None:
    assert not is_regular(special[name])
    with pytest.raises(OSError, match="(?i)" + said):
        open_file(special[name])
    with pytest.raises(ReadError, match="(?i)" + said) as caught:
        read_source(special[name], named=False)
    assert str(special[name]) in caught.value.message and caught.value.hint


@pytest.mark.parametrize("name", ["device", "socket", "folder"])
def test_what_never_ends_is_not_read_though_it_was_named(
    special: dict[str, Path], name: str
) -> None:
    with pytest.raises(ReadError, match=r"a device|a socket|directory"):
        read_source(special[name])


def test_a_pipe_that_was_named_is_waited_for(special: dict[str, Path]) -> None:
    """As one of `<(…)` is; the null device is empty."""
    writer = threading.Thread(target=lambda: special["link"].write_bytes(b"{}"))
    writer.start()
    try:
        assert read_source(special["pipe"]).data == b"{}"
    finally:
        writer.join()
    assert read_source(special["null"]).data == b""


def test_a_file_that_becomes_a_pipe_meanwhile(
    special: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the look at it and the opening there is a moment."""
    place = special["folder"] / "a.json"
    place.write_text("{}")
    look = place.stat()

    def swapped(path: Path) -> os.stat_result:
        place.unlink()
        os.mkfifo(place)
        return look

    monkeypatch.setattr(Path, "stat", swapped)
    with pytest.raises(OSError, match="it is a pipe"):
        open_file(place)


def test_regular_files_are_read_links_followed(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"abc")
    (tmp_path / "b").symlink_to("a")
    assert is_regular(tmp_path / "b") and not is_regular("a\0b") and not is_regular("none")
    for named in (True, False):
        with open_file(tmp_path / "b", named=named) as file:
            assert file.read() == b"abc"


def test_files_of_the_kernel_have_no_size(tmp_path: Path) -> None:
    if not Path("/proc/version").exists():
        pytest.skip("there is no /proc")
    assert read_source("/proc/version", named=False).size > 10
