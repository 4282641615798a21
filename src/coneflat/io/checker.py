"""The checkerboard that shows what a flattening does to angles and areas."""

from __future__ import annotations

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..errors import OptionError
from ..geometry.planar import signed_double_areas

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
    area = np.abs(signed_double_areas(uv[uv_faces])).sum() / 2
    return float(np.sqrt(area) or 1.0) / cells


def check_cells(cells: float) -> None:
    """Raise OptionError if a checkerboard cannot have so many cells."""
    if not 0 < cells < np.inf:
        raise OptionError(f"the number of cells of the checkerboard must be positive, not {cells:g}")
