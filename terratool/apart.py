"""Keep libraries and processes apart from the current folder, which may be a stranger's.

Matplotlib reads a `matplotlibrc` there while it is imported, ezdxf an `ezdxf.ini`, netCDF an
`.ncrc`, GDAL files that are called like its tilings, and Python takes modules from there for
`python -c`. A pipe of such a name would keep a command waiting, and a module would run.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

_OWN = ("MATPLOTLIBRC", "MPLCONFIGDIR", "EZDXF_CONFIG_FILE")
"""Environment variables that name settings of these libraries, perhaps by a relative path."""
_ON = "TERRATOOL_APART"
"""Environment variable that marks a process which keeps apart."""


def keep_apart() -> None:
    """Keep this process, a command of terratool, apart from the current folder from now on.

    As a library terratool does not, since all threads of a program share the current folder.
    """
    os.environ[_ON] = "1"
    os.environ["PYTHONSAFEPATH"] = "1"  # for processes that Dask starts
    os.environ["NCRCENV_IGNORE"] = "1"
    for name in filter(os.environ.get, _OWN):
        from pathlib import Path

        with contextlib.suppress(OSError):  # the current folder may be gone
            os.environ[name] = str(Path(os.environ[name]).absolute())


@contextlib.contextmanager
def apart() -> Iterator[None]:
    """Change to terratool's own folder while the block lasts, if this process keeps apart."""
    if _ON not in os.environ:
        yield
        return
    from pathlib import Path

    here = None
    with contextlib.suppress(OSError):  # the current folder may be gone or unreadable
        here = os.open(".", getattr(os, "O_PATH", os.O_RDONLY))
    back = Path.cwd() if here is None else None
    os.chdir(Path(__file__).parent)
    try:
        yield
    finally:
        if here is None:
            assert back is not None
            os.chdir(back)
        else:
            os.fchdir(here)
            os.close(here)
