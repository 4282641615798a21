"""Charts side by side in the unit square."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._arrays import FloatArray

GAP = 0.02  # between charts, in units of the square root of their total bounding area


def arrange(charts: Sequence[FloatArray]) -> tuple[list[FloatArray], float]:
    """Move charts apart and scale all by one factor so that they fit into [0, 1]^2.

    Charts stand in rows, the tallest first; a chart alone fills the square as far as its shape allows.

    Args:
        charts: for each chart its points (c, 2), all at one scale.

    Returns:
        The moved charts, and the scale factor.
    """
    sizes = np.array([np.ptp(chart, axis=0) for chart in charts])
    side = float(np.sqrt(sizes.prod(axis=1).sum()))
    if side == 0:  # only segments and points
        side = float(sizes.max())
    corners = _rows(sizes + GAP * side, max(1.1 * side, float(sizes[:, 0].max() + GAP * side)))
    extent = float((corners + sizes).max())
    scale = 1.0 / extent
    moved = [
        np.clip((chart - chart.min(axis=0) + corner) * scale, 0.0, 1.0)
        for chart, corner in zip(charts, corners, strict=True)
    ]
    return moved, scale


def _rows(sizes: FloatArray, width: float) -> FloatArray:
    """Return the lower left corner of each box, in rows of at most the given width."""
    corners = np.zeros_like(sizes)
    x = y = height = 0.0
    for box in np.lexsort((sizes[:, 0], -sizes[:, 1])):
        if x > 0 and x + sizes[box, 0] > width * (1 + 1e-12):
            x, y, height = 0.0, y + height, 0.0
        corners[box] = x, y
        x += sizes[box, 0]
        height = max(height, sizes[box, 1])
    return corners
