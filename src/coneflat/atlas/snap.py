"""Layouts rounded to numbers of fewer digits, without triangles that rounding turns over or lays on others."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..geometry.overlap import Overlaps, find_overlaps
from ..geometry.planar import signed_double_areas
from .touch import part_touching

# Of 32-bit numbers below 1: how far apart they are.
SPACING = 2.0**-24
# Places that are tried for a point: so many spacings away at most, along each axis.
REACH = 3
# Times all triangles that are upside down are looked at. More than MOST of them are too many to be cured one by one.
ROUNDS, MOST = 4, 5000


def snap_apart(
    points: FloatArray, corners: IntArray, stored: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, Overlaps]:
    """Return points as they are stored, triangles upright and apart where they were and rounding admits it.

    And what overlaps nevertheless.

    Args:
        points: (u, 2) of the plane.
        corners: (m, 3) indices of points.
        stored: returns the points that are read where some are written.
    """
    rounded = stored(points)
    if np.array_equal(rounded, points):
        return points, find_overlaps(points, corners)
    upright = signed_double_areas(points[corners]) > 0
    rounded = _turned_back(rounded, corners, upright, stored)
    parted, overlaps = part_touching(rounded, corners, stored)
    if (upright & (signed_double_areas(parted[corners]) <= 0)).any():
        parted = _turned_back(parted, corners, upright, stored)
        overlaps = find_overlaps(parted, corners)
    return parted, overlaps


def _turned_back(
    points: FloatArray, corners: IntArray, upright: BoolArray, stored: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Return points, some a few spacings away, at which triangles that rounding turned over are upright again.

    upright: (m,) True for triangles that are to be.
    """
    points = points.copy()
    steps = SPACING * np.mgrid[-REACH : REACH + 1, -REACH : REACH + 1].reshape(2, -1).T
    steps = steps[np.argsort((steps**2).sum(axis=1), kind="stable")]
    for _ in range(ROUNDS):
        bad = np.flatnonzero((signed_double_areas(points[corners]) <= 0) & upright)
        if not 0 < len(bad) <= MOST:
            break
        near = np.flatnonzero(np.isin(corners, corners[bad]).any(axis=1) & upright)
        for point in np.unique(corners[bad]).tolist():
            star = corners[near[(corners[near] == point).any(axis=1)]]
            places = stored(points[point] + steps * max(1.0, np.abs(points[point]).max()))
            flat = np.repeat(points[star][None], len(places), axis=0)
            flat[:, star == point] = places[:, None]
            least = signed_double_areas(flat.reshape(-1, 3, 2)).reshape(len(places), -1).min(axis=1)
            if least[0] <= 0 and least.max() > least[0]:
                points[point] = places[np.argmax(least > 0) if (least > 0).any() else np.argmax(least)]
    return points
