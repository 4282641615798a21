"""Triangles that only touch, and what rounding does to them: moved apart, or turned back, by as little as it needs.

Polyhedra unfold to charts that touch themselves along edges, and charts without padding touch each other. Turned and
scaled, such edges may come to lie across each other by a digit; numbers of fewer digits turn thin triangles over.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..geometry.overlap import Overlaps, find_overlaps
from ..geometry.planar import signed_double_areas
from ..mesh.connectivity import NEXT

# Of the extent of the layout: what overlaps by less touches, and is then moved by so much more than it overlaps.
TOUCHING_OVERLAP, SEPARATING_GAP = 1e-11, 2.0**-49
# Of 32-bit numbers below 1: how far apart they are. Of points that are stored as such, what overlaps by less than
# sixteen times that touches, and is moved by twice that more than it overlaps.
SINGLE_SPACING = 2.0**-24
# What is moved may touch something else then, and triangles that are turned back may turn others over.
MAX_ROUNDS = 10


def part_touching(
    points: FloatArray, corners: IntArray, stored: Callable[[FloatArray], FloatArray] | None = None
) -> tuple[FloatArray, Overlaps]:
    """Return points of the plane at which triangles that touch do not overlap, and what overlaps nevertheless.

    Args:
        points: (u, 2).
        corners: (m, 3) indices of points.
        stored: rounds points to those that can be stored, as 32-bit numbers; None for doubles.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float((high - low).max())
    touching, apart = (
        (TOUCHING_OVERLAP, SEPARATING_GAP) if stored is None else (16 * SINGLE_SPACING, 2 * SINGLE_SPACING)
    )
    if stored is not None:
        points = stored(points)
    best, found = points, find_overlaps(points, corners)
    overlaps = found
    for _ in range(MAX_ROUNDS):
        moves = _moves(points @ np.array([1, 1j]), corners, overlaps.pairs, touching * extent, apart * extent)
        if not moves.any():
            break
        points = np.clip(points + np.stack([moves.real, moves.imag], axis=1), low, high)
        if stored is not None:
            points = stored(points)
        overlaps = find_overlaps(points, corners)
        if len(overlaps.pairs) < len(found.pairs):
            best, found = points, overlaps
    return best, found


def _moves(
    places: NDArray[np.complex128], corners: IntArray, pairs: IntArray, touching: float, apart: float
) -> NDArray[np.complex128]:
    """Return (u,) by what points are to be moved so that triangles that hardly overlap are apart.

    touching: what overlaps by less does so hardly. apart: by how much they are then to be apart.
    """
    moves = np.zeros(len(places), dtype=np.complex128)
    if not len(pairs):
        return moves
    both = corners[pairs]
    across, depth = _least_depth(places[both])
    hardly = depth < touching
    both, across, move = both[hardly], across[hardly], depth[hardly] / 2 + apart
    # Where they have a point in common, it stays.
    shared = (
        (both[:, 0, :, None] == both[:, 1, None, :]).any(axis=2),
        (both[:, 1, :, None] == both[:, 0, None, :]).any(axis=2),
    )
    for side, sign in ((0, -1.0), (1, 1.0)):
        ahead = sign * (np.conj(across[:, None]) * places[both[:, side]]).real
        reaches = (ahead - ahead.min(axis=1, keepdims=True) < 2 * move[:, None]) & ~shared[side]
        step = np.broadcast_to((sign * move * across)[:, None], reaches.shape)
        np.add.at(moves, both[:, side][reaches], step[reaches])
    return moves


def _least_depth(corners: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], FloatArray]:
    """Return (k,) unit vectors along which the second of two triangles (k, 2, 3) is out of the first soonest, and when.

    They are across a side of either (as for `geometry.overlap.join`).
    """
    sides = corners[..., NEXT] - corners
    turned = (np.conj(sides[..., 0]) * sides[..., 1]).imag < 0
    outward = -1j * sides / np.maximum(np.abs(sides), np.finfo(float).tiny)
    outward = np.where(turned[..., None], -outward, outward)
    # Across the sides of the first away from it, and of the second towards it.
    across = np.concatenate([outward[:, 0], -outward[:, 1]], axis=1)
    heights = (np.conj(across)[:, None, :, None] * corners[:, :, None, :]).real
    depths = heights[:, 0].max(axis=2) - heights[:, 1].min(axis=2)
    best = depths.argmin(axis=1)
    chosen = np.arange(len(best)), best
    return across[chosen], np.maximum(depths[chosen], 0.0)


# Places that are tried for a point: so many spacings away at most, along each axis.
MAX_GRID_STEPS = 3
# Triangles that are flipped: more are too many to be turned back one by one.
MAX_TURNED_BACK = 5000


def snap_apart(
    points: FloatArray, corners: IntArray, stored: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, Overlaps]:
    """Return points as stored, with triangles positively oriented and disjoint where they were and rounding permits.

    And what overlaps nevertheless.

    Args:
        points: (u, 2) of the plane.
        corners: (m, 3) indices of points.
        stored: returns the points that are read where some are written.
    """
    rounded = stored(points)
    if np.array_equal(rounded, points):
        return points, find_overlaps(points, corners)
    is_positive = signed_double_areas(points[corners]) > 0
    rounded = _turned_back(rounded, corners, is_positive, stored)
    parted, overlaps = part_touching(rounded, corners, stored)
    if (is_positive & (signed_double_areas(parted[corners]) <= 0)).any():
        parted = _turned_back(parted, corners, is_positive, stored)
        overlaps = find_overlaps(parted, corners)
    return parted, overlaps


def _turned_back(
    points: FloatArray, corners: IntArray, is_positive: BoolArray, stored: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Return points, some a few spacings away, at which triangles that rounding flipped are positively oriented again.

    is_positive: (m,) True for triangles that are to be.
    """
    points = points.copy()
    steps = (
        SINGLE_SPACING
        * np.mgrid[-MAX_GRID_STEPS : MAX_GRID_STEPS + 1, -MAX_GRID_STEPS : MAX_GRID_STEPS + 1]
        .reshape(2, -1)
        .T
    )
    steps = steps[np.argsort((steps**2).sum(axis=1), kind="stable")]
    for _ in range(MAX_ROUNDS):
        bad = np.flatnonzero((signed_double_areas(points[corners]) <= 0) & is_positive)
        if not 0 < len(bad) <= MAX_TURNED_BACK:
            break
        near = np.flatnonzero(np.isin(corners, corners[bad]).any(axis=1) & is_positive)
        for point in np.unique(corners[bad]).tolist():
            star = corners[near[(corners[near] == point).any(axis=1)]]
            places = stored(points[point] + steps * max(1.0, np.abs(points[point]).max()))
            flat = np.repeat(points[star][None], len(places), axis=0)
            flat[:, star == point] = places[:, None]
            least = signed_double_areas(flat.reshape(-1, 3, 2)).reshape(len(places), -1).min(axis=1)
            if least[0] <= 0 and least.max() > least[0]:
                points[point] = places[np.argmax(least > 0) if (least > 0).any() else np.argmax(least)]
    return points
