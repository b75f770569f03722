"""Heights of a raster of which only the blocks that were asked for are in memory."""

from __future__ import annotations

import mmap
import sys
import threading
import weakref
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from terratool.errors import ReadError
from terratool.processes import memory_bytes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from terratool.io.grid_cache import GridFacts

_PIXELS = 20
"""Power of two of the pixels of a block."""
_LAZY: dict[str, int] = {}
"""Options of a map of addresses without memory."""
if sys.platform == "linux":  # MAP_NORESERVE, which Python names from 3.13 on
    _LAZY = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | 0x4000}
_SHARE = 0.5
"""Largest share of the machine's memory that blocks of all rasters of a process take."""


class BlockShape(NamedTuple):
    """Shape of the blocks that a raster is read by.

    Attributes:
        shift_x, shift_y: powers of two of the columns and of the rows of a block.
        across: number of blocks from west to east.
        down: number of blocks from north to south.
    """

    shift_x: int
    shift_y: int
    across: int
    down: int


def block_shape(columns: int, rows: int, own: tuple[int, int]) -> BlockShape:
    """Return the shape of the blocks that a raster is read by.

    Args:
        columns: number of the raster's pixels from west to east.
        rows: number of its pixels from north to south.
        own: rows and columns of the blocks that it is stored in: strips are read whole.
    """
    side = _PIXELS // 2
    shift_x = side if own[1] < columns else (columns - 1).bit_length()
    shift_y = max(_PIXELS - shift_x, (own[0] - 1).bit_length() if own[1] >= columns else 0)
    across, down = ((columns - 1) >> shift_x) + 1, ((rows - 1) >> shift_y) + 1
    return BlockShape(shift_x, shift_y, across, down)


Read = Callable[[int, int, int, int], "NDArray[Any]"]
"""Function that reads the heights of a window by its first column and row, its columns and rows."""


class GridBlocks:
    """Blocks of a band's heights, each read when it is first asked for.

    Attributes:
        data: (bytes,) uint8, numbers row by row from the north; the system has memory for it only
            where blocks were read.
    """

    _lock = threading.Lock()
    _taken = 0  # bytes of the blocks of all rasters
    # bytes of those that are gone: they are told by the garbage collector, in any thread, which may
    # hold the lock
    _given: ClassVar[deque[list[int]]] = deque()

    def __init__(self, facts: GridFacts, shape: BlockShape, read: Read) -> None:
        """Set address space aside for the heights of a band.

        Raises:
            ReadError: the system has none.
        """
        import numpy as np

        self.shift_x, self.shift_y, self.across, down = shape
        self.count = self.across * down
        self._facts, self._read = facts, read
        self._loaded: set[int] = set()
        self._bytes = [0]
        weakref.finalize(self, GridBlocks._given.append, self._bytes)
        try:
            memory = mmap.mmap(-1, facts.nbytes, **_LAZY)
        except (OSError, ValueError, OverflowError) as error:
            raise ReadError(
                f"{facts.source.path}: this process has no room for addresses of its "
                f"{facts.nbytes:,} bytes of heights.",
                "Take a coarser raster, or allow more virtual memory.",
            ) from error
        self.data: NDArray[np.uint8] = np.frombuffer(memory, np.uint8)

    def load(self, block: int) -> None:
        """Read a block, if it is not there.

        Raises:
            ReadError: it cannot be read, or the blocks take too much memory.
        """
        source = self._facts.source
        row, column = (block // self.across) << self.shift_y, (block % self.across) << self.shift_x
        rows = min(1 << self.shift_y, source.rows - row)
        columns = min(1 << self.shift_x, source.columns - column)
        with self._lock:
            if block in self._loaded:
                return
            more = rows * columns * (4 if self._facts.single else 8)
            self._refuse(more)
            heights = self._read(column, row, columns, rows)
            self._numbers[row : row + rows, column : column + columns] = heights
            self._loaded.add(block)
            self._bytes[0] += more
            GridBlocks._taken += more

    def _refuse(self, more: int) -> None:
        """Refuse so many bytes of blocks more, with the lock held.

        Raises:
            ReadError: they take too much memory.
        """
        while GridBlocks._given:
            GridBlocks._taken -= GridBlocks._given.popleft()[0]
        if GridBlocks._taken + more > _SHARE * memory_bytes():
            raise ReadError(
                f"{self._facts.source.path}: more of its heights are asked for than memory holds: "
                f"with {more:,} bytes more, blocks of rasters take over half of it.",
                "Ask for a part of the terrain, or make the raster coarser.",
            )

    def load_all(self) -> None:
        """Read all blocks.

        Raises:
            ReadError: one cannot be read, or they take too much memory.
        """
        with self._lock:
            self._refuse(self._facts.nbytes - self._bytes[0])
        for block in range(self.count):
            self.load(block)

    @property
    def _numbers(self) -> NDArray[Any]:
        import numpy as np

        source = self._facts.source
        kind = np.float32 if self._facts.single else np.float64
        found: NDArray[Any] = self.data.view(kind).reshape(source.rows, source.columns)
        return found
