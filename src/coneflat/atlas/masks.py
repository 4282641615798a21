"""Charts as sets of cells of a grid, each at several angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import FloatArray, IntArray
from .outline import Outlines


@dataclass(frozen=True, eq=False)
class Masks:
    """j = k * t shapes, which are k charts at t angles each; every cell that a chart has a point in belongs to it.

    Attributes:
        cell: width of a cell, in the unit of the outlines.
        turns: t.
        angle: (j,) that the chart is turned by, radians; those of chart 0 come first.
        low: (j,) lower left corner of the turned chart, which is that of the shape's lower left cell.
        size: (j, 2) columns and rows.
        runs: (r, 3) row, first and last column of cells in a row.
        first: (j + 1,) the first run of each shape.
        widest: (j,) the longest run of each shape.
    """

    cell: float
    turns: int
    angle: FloatArray
    low: NDArray[np.complex128]
    size: IntArray
    runs: IntArray
    first: IntArray
    widest: IntArray

    @property
    def cells(self) -> IntArray:
        """(k,) how many cells each chart has at the first of its angles."""
        length = self.runs[:, 2] - self.runs[:, 1] + 1
        cells: IntArray = np.add.reduceat(length, self.first[:-1])[:: self.turns]
        return cells


def cover_charts(outlines: Outlines, angles: FloatArray, cell: float) -> Masks:
    """Return the cells, of the given width, of charts turned by (k, t) angles."""
    from .cover_kernel import cover

    count, turns = angles.shape
    low, extent = turned_boxes(outlines, angles)
    size = np.column_stack([extent.real.ravel() // cell, extent.imag.ravel() // cell]).astype(np.int64) + 1
    first = np.empty(count * turns + 1, dtype=np.int64)
    runs = np.empty((0, 3), dtype=np.int64)
    found = 2 * int(size[:, 1].sum())
    while found > len(runs):
        runs = np.empty((found, 3), dtype=np.int64)
        found = cover(
            outlines.sides.view(np.float64),
            outlines.start,
            np.repeat(np.arange(count), turns),
            np.column_stack([np.cos(angles).ravel(), np.sin(angles).ravel()]),
            low.ravel().view(np.float64).reshape(-1, 2),
            size,
            cell,
            runs,
            first,
        )
    runs = runs[:found]
    shape = np.repeat(np.arange(count * turns), np.diff(first))
    longest = np.lexsort((runs[:, 1] - runs[:, 2], shape))[first[:-1]]
    return Masks(cell, turns, angles.ravel(), low.ravel(), size, runs, first, longest)


def turned_boxes(
    outlines: Outlines, angles: FloatArray
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return (k, t) lower left corners of the boxes around charts turned by angles, and their widths and heights."""
    low, high = np.empty((2, *angles.shape), dtype=np.complex128)
    points, start = outlines.sides.ravel(), 2 * outlines.start[:-1]
    chart = np.repeat(np.arange(len(outlines)), 2 * np.diff(outlines.start))
    for i, turn in enumerate(np.exp(1j * angles).T):
        turned = points * turn[chart]
        for part in ("real", "imag"):
            setattr(low[:, i], part, np.minimum.reduceat(getattr(turned, part), start))
            setattr(high[:, i], part, np.maximum.reduceat(getattr(turned, part), start))
    return low, high - low
