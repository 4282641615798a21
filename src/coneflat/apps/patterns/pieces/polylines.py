"""Polylines in the plane: distances along them, and their straight parts."""

from __future__ import annotations

import numpy as np

from ....base import FloatArray, IntArray

# Turn of a straight part of a border from end to end, radians: a part of 50 mm is within 0.1 mm of a line.
MAX_TURN = np.radians(0.5)


def distances(line: FloatArray) -> FloatArray:
    """Return (k,) the distance of each of k points along the polyline through them."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def ends_of_straight_parts(first: FloatArray, second: FloatArray) -> IntArray:
    """Return the points at which parts of a seam begin and end that are straight on both of its sides.

    Args:
        first, second: (k, 2) its sides, in the same direction.
    """
    ends, total = [0], 0.0
    for point, turn in enumerate(np.maximum(_turns(first), _turns(second)).tolist(), start=1):
        total += turn
        if total > MAX_TURN:
            ends.append(point)
            total = 0.0
    return np.array([*ends, len(first) - 1])


def _turns(line: FloatArray) -> FloatArray:
    """Return (k - 2,) the angles by which a polyline turns at its inner points."""
    steps = np.diff(line, axis=0)
    before, after = steps[:-1], steps[1:]
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.abs(np.arctan2(across, (before * after).sum(axis=1)))
