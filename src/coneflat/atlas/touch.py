"""Repair of rounding errors in layouts: overlaps of touching triangles, and thin triangles flipped by rounding.

Polyhedra unfold to charts that touch themselves along edges, and charts without padding touch each other. After
rotation and scaling, such edges may cross each other by a rounding error. Rounding to 32-bit numbers can flip thin
triangles. Points are moved by as little as necessary.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..geometry.overlap import Overlaps, find_overlaps
from ..geometry.planar import signed_double_areas
from ..mesh.connectivity import NEXT

# Relative to the extent of the layout: triangles that overlap by less than TOUCHING_OVERLAP are touching, and are
# separated to a distance of SEPARATING_GAP.
TOUCHING_OVERLAP, SEPARATING_GAP = 1e-11, 2.0**-49
# Spacing of 32-bit numbers below 1. Points stored as such are touching if they overlap by less than sixteen spacings,
# and are separated to a distance of two spacings.
SINGLE_SPACING = float(np.finfo(np.float32).epsneg)
# Maximum number of repetitions: moved points may cause new overlaps, and repaired triangles may flip others.
MAX_ROUNDS = 10


def separate_touching(
    points: FloatArray, corners: IntArray, stored: Callable[[FloatArray], FloatArray] | None = None
) -> tuple[FloatArray, Overlaps]:
    """Return points moved such that touching triangles do not overlap, and the remaining overlaps.

    Args:
        points: (u, 2) positions in the plane.
        corners: (m, 3) indices of points.
        stored: rounds points to values that can be stored, such as 32-bit numbers; None for doubles.

    Returns:
        (u, 2) the points, and the overlaps that remain.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float((high - low).max())
    touching, gap = (
        (TOUCHING_OVERLAP, SEPARATING_GAP) if stored is None else (16 * SINGLE_SPACING, 2 * SINGLE_SPACING)
    )
    if stored is not None:
        points = stored(points)
    best, remaining = points, find_overlaps(points, corners)
    overlaps = remaining
    for _ in range(MAX_ROUNDS):
        moves = _moves(points @ np.array([1, 1j]), corners, overlaps.pairs, touching * extent, gap * extent)
        if not moves.any():
            break
        points = np.clip(points + np.stack([moves.real, moves.imag], axis=1), low, high)
        if stored is not None:
            points = stored(points)
        overlaps = find_overlaps(points, corners)
        if len(overlaps.pairs) < len(remaining.pairs):
            best, remaining = points, overlaps
    return best, remaining


def _moves(
    places: NDArray[np.complex128], corners: IntArray, pairs: IntArray, touching: float, gap: float
) -> NDArray[np.complex128]:
    """Return (u,) translations of points that separate touching triangles.

    touching: largest depth of an overlap that is separated. gap: distance of the triangles afterwards.
    """
    moves = np.zeros(len(places), dtype=np.complex128)
    if not len(pairs):
        return moves
    corner_pairs = corners[pairs]
    across, depth = _least_depth(places[corner_pairs])
    is_touching = depth < touching
    corner_pairs, across, move = corner_pairs[is_touching], across[is_touching], depth[is_touching] / 2 + gap
    # Points that the two triangles share stay in place.
    shared = (
        (corner_pairs[:, 0, :, None] == corner_pairs[:, 1, None, :]).any(axis=2),
        (corner_pairs[:, 1, :, None] == corner_pairs[:, 0, None, :]).any(axis=2),
    )
    for side, sign in ((0, -1.0), (1, 1.0)):
        ahead = sign * (np.conj(across[:, None]) * places[corner_pairs[:, side]]).real
        reaches = (ahead - ahead.min(axis=1, keepdims=True) < 2 * move[:, None]) & ~shared[side]
        step = np.broadcast_to((sign * move * across)[:, None], reaches.shape)
        np.add.at(moves, corner_pairs[:, side][reaches], step[reaches])
    return moves


def _least_depth(corners: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], FloatArray]:
    """Return (k,) unit vectors of least penetration and (k,) penetration depths of two triangles (k, 2, 3).

    Moving the second triangle along the vector by the depth separates it from the first. The vector is normal to a
    side of either triangle (as for `geometry.overlap.join`).
    """
    sides = corners[..., NEXT] - corners
    turned = (np.conj(sides[..., 0]) * sides[..., 1]).imag < 0
    outward = -1j * sides / np.maximum(np.abs(sides), np.finfo(float).tiny)
    outward = np.where(turned[..., None], -outward, outward)
    # Outward normals of the first triangle, and inward normals of the second.
    across = np.concatenate([outward[:, 0], -outward[:, 1]], axis=1)
    heights = (np.conj(across)[:, None, :, None] * corners[:, :, None, :]).real
    depths = heights[:, 0].max(axis=2) - heights[:, 1].min(axis=2)
    best = depths.argmin(axis=1)
    chosen = np.arange(len(best)), best
    return across[chosen], np.maximum(depths[chosen], 0.0)


# Positions that are tried for a point: up to this number of spacings away along each axis.
MAX_GRID_STEPS = 3
# Number of flipped triangles above which they are not repaired, as this is done one by one.
MAX_FLIPPED = 5000


def round_safely(
    points: FloatArray, corners: IntArray, stored: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, Overlaps]:
    """Return points rounded to stored values, where possible without new flipped triangles or overlaps.

    Args:
        points: (u, 2) positions in the plane.
        corners: (m, 3) indices of points.
        stored: returns the points that are read back after the given ones are written.

    Returns:
        (u, 2) the rounded points, and the overlaps that remain.
    """
    rounded = stored(points)
    if np.array_equal(rounded, points):
        return points, find_overlaps(points, corners)
    is_positive = signed_double_areas(points[corners]) > 0
    rounded = _unflipped(rounded, corners, is_positive, stored)
    separated, overlaps = separate_touching(rounded, corners, stored)
    if (is_positive & (signed_double_areas(separated[corners]) <= 0)).any():
        separated = _unflipped(separated, corners, is_positive, stored)
        overlaps = find_overlaps(separated, corners)
    return separated, overlaps


def _unflipped(
    points: FloatArray, corners: IntArray, is_positive: BoolArray, stored: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Return points, some moved by a few spacings, at which triangles flipped by rounding are positively oriented.

    is_positive: (m,) True for triangles that must be positively oriented.
    """
    points = points.copy()
    along = SINGLE_SPACING * np.arange(-MAX_GRID_STEPS, MAX_GRID_STEPS + 1)
    steps = np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)
    steps = steps[np.argsort((steps**2).sum(axis=1), kind="stable")]
    for _ in range(MAX_ROUNDS):
        flipped = np.flatnonzero((signed_double_areas(points[corners]) <= 0) & is_positive)
        if not 0 < len(flipped) <= MAX_FLIPPED:
            break
        candidates = np.flatnonzero(np.isin(corners, corners[flipped]).any(axis=1) & is_positive)
        for point in np.unique(corners[flipped]).tolist():
            star = corners[candidates[(corners[candidates] == point).any(axis=1)]]
            places = stored(points[point] + steps * max(1.0, np.abs(points[point]).max()))
            flat = np.repeat(points[star][None], len(places), axis=0)
            flat[:, star == point] = places[:, None]
            smallest = signed_double_areas(flat.reshape(-1, 3, 2)).reshape(len(places), -1).min(axis=1)
            if smallest[0] <= 0 and smallest.max() > smallest[0]:
                points[point] = places[
                    np.argmax(smallest > 0) if (smallest > 0).any() else np.argmax(smallest)
                ]
    return points
