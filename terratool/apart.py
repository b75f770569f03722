"""What is kept apart from the current folder, which may be a stranger's: libraries, and processes.

Matplotlib reads a `matplotlibrc` there while it is imported, ezdxf an `ezdxf.ini`, netCDF an
`.ncrc`, GDAL files that are called like its tilings, and Python takes modules from there for
`python -c`. A pipe of such a name would keep a command waiting, a module would run.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

_OWN = ("MATPLOTLIBRC", "MPLCONFIGDIR", "EZDXF_CONFIG_FILE")
"""Variables by which the user names settings of these libraries, perhaps as seen from here."""
_ON = "TERRATOOL_APART"


def keep_apart() -> None:
    """Have this process, which is a command of terratool, keep apart from here on.

    As a library terratool does not, since the current folder is that of all threads of a program.
    """
    os.environ[_ON] = "1"
    os.environ["PYTHONSAFEPATH"] = "1"  # of processes that Dask starts
    os.environ["NCRCENV_IGNORE"] = "1"
    for name in filter(os.environ.get, _OWN):
        from pathlib import Path

        with contextlib.suppress(OSError):  # the current folder may be gone
            os.environ[name] = str(Path(os.environ[name]).absolute())


@contextlib.contextmanager
def apart() -> Iterator[None]:
    """Stand in a folder of our own while the block lasts, if this is a command."""
    if _ON not in os.environ:
        yield
        return
    from pathlib import Path

    here = None
    with contextlib.suppress(OSError):  # it may be gone, or not to be opened
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
