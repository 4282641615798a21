"""The checkerboard that shows what a flattening does to angles and areas."""

from __future__ import annotations

import numpy as np

from ._arrays import FloatArray, IntArray
from .errors import OptionError

LIGHT_CELL = (0.86, 0.87, 0.89)
"""A light, slightly cool grey."""

DARK_CELL = (0.34, 0.46, 0.62)
"""Blue, so that red and black marks stand out."""

CELLS = 36
"""Cells in a row that is as long as the square root of the area: about 20 across a ball."""


def cell_side(uv: FloatArray, uv_faces: IntArray, cells: float = CELLS) -> float:
    """Return the side, in UV units, of square cells of which the layout's area holds `cells` squared.

    Args:
        uv: (u, 2) points of the layout.
        uv_faces: (m, 3) index into them of every triangle corner.
        cells: how many are as long as the root of the area.

    Raises:
        OptionError: `cells` is no positive number.
    """
    check_cells(cells)
    p, q, r = np.moveaxis(uv[uv_faces], 1, 0)
    one, two = q - p, r - p
    area = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2
    return float(np.sqrt(area) or 1.0) / cells


def check_cells(cells: float) -> None:
    """Raise OptionError if a checkerboard cannot have so many cells."""
    if not 0 < cells < np.inf:
        raise OptionError(f"the number of cells of the checkerboard must be positive, not {cells:g}")
