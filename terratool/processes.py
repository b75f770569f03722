"""Calls in a Python process of their own, for libraries that may crash, and limits of memory."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any


def python_calling(module: str, function: str, *arguments: str) -> dict[str, Any]:
    """Return arguments of `subprocess` to call a function, which reads its own in `sys.argv`.

    Modules are those of this process, and none of the current folder, which may be a stranger's.
    """
    folders = [*filter(None, sys.path), str(Path(__file__).parents[1])]
    program = f"from {module} import {function}; {function}()"
    return {
        "args": [sys.executable, "-P", "-c", program, *arguments],
        "env": {**os.environ, "PYTHONPATH": os.pathsep.join(folders)},
        "stdin": subprocess.DEVNULL,
    }


def memory_bytes() -> float:
    """Bytes of memory that the machine has; infinity where the system does not say."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return math.inf


def limit_memory(most: int) -> None:
    """Limit the memory of this process to what it has and a little more, where the system can.

    Args:
        most: further bytes that the process may take.
    """
    try:
        import resource

        pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
        limit = pages * resource.getpagesize() + most
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, OSError, ValueError):
        return
