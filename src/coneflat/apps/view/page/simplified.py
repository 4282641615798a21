"""Meshes simplified for display: points in the same cell of a grid are merged, but not those of outlines."""

from __future__ import annotations

import numpy as np

from ....base import BoolArray, FloatArray, IntArray
from ....errors import MeshError
from ....geometry import signed_double_areas

GRID_CELLS = 4095
"""Largest number of cells along an axis, so that the five indices of a cell fit into 60 bits."""


def simplify(
    places: FloatArray, uv: FloatArray, faces: IntArray, fixed: BoolArray, max_triangles: int
) -> tuple[IntArray, IntArray]:
    """Return the (k,) faces of a mesh that remain if it is simplified for display, and (k, 3) their corners.

    Points in the same cell of a grid, in space and in the plane, are merged into the one nearest to their mean. The
    points on outlines are not merged. Such a map of the points of a chart, the identity on its outline, covers the
    whole chart, so no holes appear in the plane or in space.

    Args:
        places: (u, 3) points in space, within about the unit ball.
        uv: (u, 2) the same points in the plane.
        faces: (m, 3) triangles.
        fixed: (u,) whether a point must remain.
        max_triangles: largest number of triangles.

    Raises:
        MeshError: there are more triangles than that along outlines alone.
    """
    areas = signed_double_areas(uv[faces])
    area = float(np.linalg.norm(np.cross(*sides(places[faces])), axis=1).sum())
    scale = np.sqrt(np.abs(areas).sum() / max(area, 1e-300))
    coordinates = np.column_stack([places, uv / max(scale, 1e-300)])
    coordinates -= coordinates.min(axis=0)
    extent = float(coordinates.max())
    # A cell contains about two triangles.
    size = float(np.sqrt(area / max_triangles))
    for _ in range(60):
        unmerged = fixed
        while True:
            corners = _representatives(coordinates, unmerged, max(size, extent / GRID_CELLS))[faces]
            remain = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
            folded = np.flatnonzero(remain)
            folded = folded[signed_double_areas(uv[corners[folded]]) * areas[folded] <= 0]
            # Where merging folds the plane, positively oriented triangles cover all that flipped ones cover. But a
            # fold at an outline may extend beyond it, so the points there are not merged either.
            crossing = folded[fixed[faces[folded]].any(axis=1) & ~unmerged[faces[folded]].all(axis=1)]
            if not len(crossing):
                break
            unmerged = unmerged.copy()
            unmerged[faces[crossing]] = True
        remain[folded] = False
        count = int(remain.sum())
        if count <= max_triangles:
            chosen = np.flatnonzero(remain)
            return chosen, corners[chosen]
        if size > extent:
            break
        size *= float(np.clip(np.sqrt(count / max_triangles), 1.1, 2.0))
    raise MeshError(
        f"the mesh of {len(faces):,} triangles cannot be reduced to {max_triangles:,} for display: {count:,} of them "
        "lie along seams or boundaries; allow more"
    )


def _representatives(coordinates: FloatArray, fixed: BoolArray, size: float) -> IntArray:
    """Return (u,) the point into which each point is merged."""
    representative = np.arange(len(coordinates))
    free = np.flatnonzero(~fixed)
    if not len(free):
        return representative
    cells = np.floor(coordinates[free] / size).astype(np.int64)
    key = np.zeros(len(free), dtype=np.int64)
    for column in cells.T:
        key = key * (GRID_CELLS + 1) + column
    _, cell = np.unique(key, return_inverse=True)
    cell = cell.reshape(-1)
    members = np.bincount(cell)
    squared = np.zeros(len(free))
    for column in coordinates[free].T:
        squared += (column - (np.bincount(cell, weights=column) / members)[cell]) ** 2
    order = np.lexsort([squared, cell])
    first = np.concatenate([[0], np.cumsum(members)[:-1]])
    representative[free] = free[order[first]][cell]
    return representative


def sides(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the two (m, d) sides of (m, 3, d) triangles from their first corner."""
    return corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
