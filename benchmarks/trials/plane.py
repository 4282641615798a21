"""Simple, slow measures of triangles in the plane, to check those of the package."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

#: Twice the area divided by the squared longest side below which a triangle has no area; half of the digits are exact.
NO_AREA = 1e-12
#: Least depth of an overlap that is counted, relative to the extent of the layout.
DEEP = 1e-9
#: Least length of a side, relative to that extent, whose normal is a thousand times more accurate than that depth.
SHORT = 1e-4


def double_areas(corners: np.ndarray) -> np.ndarray:
    """Return (m,) twice the signed areas; `corners` is (m, 3, 2)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def side_lengths(corners: np.ndarray) -> np.ndarray:
    """Return (m, 3) the lengths of the sides from corner i to i + 1, in any dimension."""
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def angles(corners: np.ndarray) -> np.ndarray:
    """Return (m, 3) the inner angles, all positive."""
    out, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cross = out[..., 0] * back[..., 1] - out[..., 1] * back[..., 0]
    return np.arctan2(np.abs(cross), (out * back).sum(axis=2))


def charts_of(uv_faces: np.ndarray) -> np.ndarray:
    """Return (m,) the chart of each triangle: those that are connected by sides with the same two points."""
    count = len(uv_faces)
    tails, heads = uv_faces.ravel(), np.roll(uv_faces, -1, axis=1).ravel()
    key = np.minimum(tails, heads) * (uv_faces.max() + 1) + np.maximum(tails, heads)
    order = np.argsort(key, kind="stable")
    is_repeated = np.flatnonzero(key[order][1:] == key[order][:-1])
    first, second = order[is_repeated] // 3, order[is_repeated + 1] // 3
    return connected_components(
        coo_matrix((np.ones(len(first)), (first, second)), shape=(count, count)), False
    )[1]


def flipped(corners: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """Return (m,) whether triangles are flipped relative to the area of their chart; those without area are not."""
    areas = double_areas(corners)
    areas[np.abs(areas) <= NO_AREA * side_lengths(corners).max(axis=1) ** 2] = 0.0
    against: np.ndarray = np.sign(np.bincount(chart, areas))[chart] * areas < 0
    return against


def overlap_depths(corners: np.ndarray) -> np.ndarray:
    """Return the (m, m) depths of overlaps of pairs of triangles; negative if a line separates them.

    By separating axes: the least depth over the six sides' normals. Triangles without area are nowhere.
    """
    areas = double_areas(corners)
    turned = np.where((areas < 0)[:, None, None], corners[:, ::-1], corners)
    sides = np.roll(turned, -1, axis=1) - turned
    with np.errstate(divide="ignore", invalid="ignore"):
        inward = np.stack([-sides[..., 1], sides[..., 0]], axis=2) / np.linalg.norm(sides, axis=2)[..., None]
    depth = np.full((len(corners), len(corners)), np.inf)
    for side in range(3):
        normal, start = inward[:, side], turned[:, side]
        height = (
            np.einsum("id,jkd->ijk", normal, turned) - np.einsum("id,id->i", normal, start)[:, None, None]
        )
        depth = np.minimum(depth, height.max(axis=2))
    depth = np.minimum(depth, depth.T)
    nowhere = areas == 0
    depth[nowhere], depth[:, nowhere] = -1.0, -1.0
    np.fill_diagonal(depth, -1.0)
    return depth


def difference_from_multiple(angle: np.ndarray, quantum: float) -> np.ndarray:
    """Return the differences of angles from the nearest multiples of a quantum."""
    return np.abs(angle - quantum * np.round(angle / quantum))
