"""Rotation of a flat map so that a direction of the surface points up."""

from __future__ import annotations

import numpy as np

from ..base.arrays import FloatArray


def rotated_up(flat: FloatArray, positions: FloatArray, up: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the points of a flat map (n, 2) about their mean, rotated so that a direction of the surface points up.

    The direction is mapped by the affine map from the positions to the plane that fits the points best.

    Args:
        flat: (n, 2) points.
        positions: (n, 3) their positions on the surface.
        up: (3,) direction.
        weights: (n,) areas around the points.
    """
    share = weights / weights.sum()
    flat, placed = flat - flat.mean(axis=0), positions - share @ positions
    roots = np.sqrt(share)[:, None]
    affine = np.linalg.lstsq(roots * placed, roots * (flat - share @ flat), rcond=None)[0]
    x, y = up @ affine
    length = float(np.hypot(x, y))
    # On a surface that is flat and seen along the direction, no direction in the plane is up.
    return flat @ np.array([[y, x], [-x, y]]) / length if length > 0 else flat
