"""Ctrl-C while a kernel works on, which hears of nothing: the command ends soon all the same.

Python runs its handlers of signals between two steps of the main thread. A long call holds them up,
and so do threads that are waited for. A thread of its own hears of a signal at once; if the command
has not ended a little later, that thread ends it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Iterator

PATIENCE = 0.7
"""s that a command has to end by itself."""
_ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
said = threading.Event()
"""Whether it was said that the command was stopped."""


@contextlib.contextmanager
def end_on_signals() -> Iterator[None]:
    """Within, the command ends soon after a signal, whatever it does then.

    That is after Ctrl-C, and after SIGTERM and SIGHUP where they are handled. Where the system is
    none of POSIX it is left as it is.
    """
    if os.name != "posix" or threading.current_thread() is not threading.main_thread():
        yield
        return
    hears, tells = os.pipe()
    os.set_blocking(tells, False)
    before = signal.set_wakeup_fd(tells, warn_on_full_buffer=False)
    threading.Thread(target=_end, args=(hears,), daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(tells)  # which ends the thread


def _end(hears: int) -> None:
    number = 0
    while number not in _ENDING:
        heard = os.read(hears, 1)
        if not heard:
            os.close(hears)
            return
        number = heard[0]
    time.sleep(PATIENCE)
    from terratool.cli.terminal import Status
    from terratool.output import abandon_parts

    abandon_parts()
    with contextlib.suppress(OSError):
        if Status.shown is not None:
            Status.shown.clear()
        if number == signal.SIGINT and not said.is_set():
            # not by way of sys.stderr, whose lock the main thread may hold
            os.write(2, b"terratool: stopped.\n")
    os._exit(128 + number)
