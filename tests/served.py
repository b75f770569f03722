"""Commands in processes that need not import anything, as each is a fork of one that has.

A command begins in milliseconds rather than in half a second. It has its own streams, folder and
environment, and ends as Python does, with all that is to be done at the end.
"""

from __future__ import annotations

import atexit
import gc
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
import threading
import traceback
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib import import_module
from io import BufferedReader, BufferedWriter, FileIO, TextIOWrapper
from pathlib import Path
from typing import BinaryIO, NamedTuple, cast

import terratool

LARGEST_INPUT = 16_384
"""Most bytes of standard input, so that a pipe holds it all."""
_LARGEST_MESSAGE = 1 << 18
"""Most bytes of words and environment."""
_LEFT_OUT = (
    "__init__", "__main__", "bullet", "mujoco", "torch_field", "torch_gradient", "usd",
    "warp_field", "warp_kernels",
)  # fmt: skip
"""Modules that few commands need, or that begin threads."""
_OTHERS = (
    "jinja2", "jsonschema", "matplotlib.backends.backend_agg", "matplotlib.figure", "pyproj",
    "rasterio.warp", "scipy.spatial", "trimesh",
)  # fmt: skip
"""Modules that commands import late, and that begin no threads."""


class Place(NamedTuple):
    """Where a command runs.

    Attributes:
        folder: current folder.
        environment: all variables; of Python's own only PYTHONUNBUFFERED counts.
        merged: whether standard error goes where standard output goes.
    """

    folder: Path
    environment: dict[str, str]
    merged: bool = False


def serve(words: list[str], given: bytes, place: Place, seconds: float) -> tuple[int, bytes, bytes]:
    """Run `python -m terratool` and return its exit code, negative for a signal, and its output.

    Args:
        words: words behind the command's name.
        given: standard input, of `LARGEST_INPUT` bytes at most.
        place: where it runs.
        seconds: longest time that it may take.

    Raises:
        TimeoutError: the command was not done in time.
    """
    server, channel = _server()
    (stdin, write), (out, stdout), (err, stderr) = os.pipe(), os.pipe(), os.pipe()
    theirs = stdin, stdout, stdout if place.merged else stderr
    request = json.dumps([words, str(place.folder), place.environment]).encode()
    socket.send_fds(channel, [request], theirs)
    os.write(write, given)
    for descriptor in (write, stdin, stdout, stderr):
        os.close(descriptor)
    channel.settimeout(seconds)
    with open(out, "rb") as printed, open(err, "rb") as told, ThreadPoolExecutor(2) as readers:
        texts = readers.map(lambda stream: stream.read(), (printed, told))
        try:
            code = int(channel.recv(64))
        except BaseException:  # an alarm may end the wait, too
            os.killpg(server.pid, signal.SIGKILL)
            channel.close()
            server.wait()
            _server.cache_clear()
            raise
        return code, *texts


@cache
def _server() -> tuple[subprocess.Popen[bytes], socket.socket]:
    """Server of this process, which ends when this process does, and the channel to it."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _LARGEST_MESSAGE)
    with theirs:
        command = [sys.executable, "-m", __name__, str(theirs.fileno())]
        return subprocess.Popen(
            command, pass_fds=[theirs.fileno()], start_new_session=True,
            cwd=Path(__file__).parents[1],
            # PROJ reads its variable when it is imported, which commands do later
            env={**os.environ, "PYTHONUTF8": "1", "PROJ_DEBUG": "0"},
        ), ours  # fmt: skip


def _wait_for_request(channel: socket.socket) -> list[str] | None:
    """Answer requests; return the words of one in the fork that is to run it, None at the end."""
    while True:
        request, descriptors, _, _ = socket.recv_fds(channel, _LARGEST_MESSAGE, 3)
        if not request:
            return None
        process = os.fork()
        if process == 0:
            channel.close()
            words, folder, environment = json.loads(request)
            for number, descriptor in enumerate(descriptors):
                os.dup2(descriptor, number)
                os.close(descriptor)
            os.chdir(folder)
            os.environ.clear()
            os.environ.update(environment)
            return list(words)
        for descriptor in descriptors:
            os.close(descriptor)
        _, status = os.waitpid(process, 0)
        channel.send(str(os.waitstatus_to_exitcode(status)).encode())


def _run(words: list[str]) -> None:
    """Run the command in this process, and end it."""
    sys.argv[1:] = words
    sys.stdin = TextIOWrapper(BufferedReader(FileIO(0, closefd=False)))
    at_once = "PYTHONUNBUFFERED" in os.environ
    raw = FileIO(1, "w", closefd=False)
    sys.stdout = TextIOWrapper(
        cast(BinaryIO, raw) if at_once else BufferedWriter(raw), write_through=at_once
    )
    raw = FileIO(2, "w", closefd=False)
    sys.stderr = TextIOWrapper(BufferedWriter(raw), errors="backslashreplace", line_buffering=True)
    code = 0
    try:
        runpy.run_module("terratool", run_name="__main__", alter_sys=True)
    except SystemExit as end:  # as Python takes its code
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        if isinstance(end.code, str):
            sys.stderr.write(f"{end.code}\n")
    except BaseException:
        code = 1
        traceback.print_exc()
    finally:
        # most of Python's own ending is giving back memory, which takes long in a fork
        for thread in threading.enumerate():
            if thread is not threading.current_thread() and not thread.daemon:
                thread.join()
        atexit._run_exitfuncs()
        sys.stdout.flush()
        os._exit(code)


def _main() -> None:
    package = Path(terratool.__file__).parent
    for path in sorted(package.rglob("*.py")):
        if path.stem not in _LEFT_OUT:
            import_module(".".join(path.relative_to(package.parent).with_suffix("").parts))
    for name in _OTHERS:
        import_module(name)
    gc.freeze()
    words = _wait_for_request(socket.socket(fileno=int(sys.argv[1])))
    if words is not None:
        _run(words)


if __name__ == "__main__":
    _main()
