"""End of a command after Ctrl-C, even while a kernel runs.

Python runs handlers of signals between two steps of the main thread. A long call delays them, and
so does waiting for threads. Here a thread of its own learns of a signal at once, and ends the
command if that has not ended by itself a little later.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Iterator

PATIENCE = 0.7
"""Time that a command has to end by itself, s."""
_ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
stop_reported = threading.Event()
"""Event that is set once the message that the command was stopped is printed."""


@contextlib.contextmanager
def end_on_signals() -> Iterator[None]:
    """Context in which the command ends soon after a signal, whatever it is doing.

    The signals are SIGINT, and SIGTERM and SIGHUP where Python handles them. On systems other than
    POSIX the context does nothing.
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
        os.close(tells)  # ends the thread


def _end(hears: int) -> None:
    number = 0
    while number not in _ENDING:
        heard = os.read(hears, 1)
        if not heard:
            os.close(hears)
            return
        number = heard[0]
    time.sleep(PATIENCE)
    from terratool.cli.terminal import StatusLine
    from terratool.output import abandon_parts

    abandon_parts()
    with contextlib.suppress(OSError):
        if StatusLine.shown is not None:
            StatusLine.shown.clear()
        if number == signal.SIGINT and not stop_reported.is_set():
            # sys.stderr is not used, as the main thread may hold its lock
            os.write(2, b"terratool: stopped.\n")
    os._exit(128 + number)
