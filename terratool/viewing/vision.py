"""Colours that look alike to some kinds of colour vision, and places for letters on them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_VISIONS = np.array(
    [
        np.eye(3),
        # protanopia, deuteranopia, tritanopia
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
         [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
         [-0.011820, 0.042940, 0.968881]],
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
         [0.004733, 0.691367, 0.303900]],
    ]
)  # fmt: skip
"""Matrices from linear red, green and blue to those seen by each kind of colour vision, (4, 3, 3).

G. M. Machado, M. M. Oliveira and L. A. F. Fernandes, A physiologically-based model for simulation
of color vision deficiency, IEEE Transactions on Visualization and Computer Graphics 15(6), 2009."""
_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
"""Matrix from linear red, green and blue to X, Y and Z (IEC 61966-2-1)."""
_ALIKE = 10.0
"""Distance in CIELAB below which colours look alike in a shaded picture."""
_SIDE = 240
"""Pixels of the longer side on which places for letters are searched."""


def differences(colors: NDArray[Any]) -> NDArray[np.float64]:
    """Distances of colours to the kind of vision that tells them apart least, (n, n) float64.

    The unit is that of CIELAB, a just visible difference side by side (CIE 15, 1976).

    Args:
        colors: (n, 3) red, green, blue of sRGB, 0 to 255.
    """
    parts = np.asarray(colors, np.float64) / 255.0
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.einsum("vij,nj->vni", _VISIONS, linear), 0.0, 1.0)
    xyz = seen @ _XYZ.T / _XYZ.sum(axis=1)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    x, y, z = np.moveaxis(f, -1, 0)
    lab = np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)
    apart = np.linalg.norm(lab[:, :, None] - lab[:, None], axis=-1)
    return np.asarray(apart.min(axis=0))


def look_alike(colors: NDArray[Any]) -> bool:
    """Whether any two of some colours, (n, 3) from 0 to 255, look alike to anybody."""
    apart = differences(colors)
    return bool((apart[np.triu_indices(len(apart), 1)] < _ALIKE).any())


def roomiest_places(classes: NDArray[Any], wanted: list[int]) -> dict[int, tuple[int, int, int]]:
    """Places with most room for a letter, by class: row, column, pixels to the next class.

    Args:
        classes: (height, width) classes of the pixels of a picture.
        wanted: classes that get a letter.
    """
    stride = -(-max(classes.shape) // _SIDE)
    coarse = classes[stride // 2 :: stride, stride // 2 :: stride]
    found = {}
    for one in wanted:
        left, reach = np.pad(coarse == one, 1), 0
        place = -1
        while left.any():
            reach += 1
            place = int(np.argmax(left))
            inner = left.copy()
            for axis in (0, 1):
                inner &= np.roll(left, 1, axis) & np.roll(left, -1, axis)
            left = inner
        if reach:
            row, column = np.unravel_index(place, (coarse.shape[0] + 2, coarse.shape[1] + 2))
            at = [(int(n) - 1) * stride + stride // 2 for n in (row, column)]
            found[one] = at[0], at[1], reach * stride
    return found
