"""Fewer triangles for display: points of a layout merged in small cells."""

from __future__ import annotations

import numpy as np

from ..._arrays import BoolArray, FloatArray, IntArray
from ...errors import MeshError
from ...geometry.planar import signed_double_areas

CELLS = 4095
"""Cells along an axis at most, so that the five numbers of a cell fit into 60 bits."""

TINY = 1e-300
"""Keeps a model without area from dividing by zero."""

ROUNDS = 60
"""Sizes of cells that are tried at most; each is larger by a tenth or more."""


def thin(
    places: FloatArray, uv: FloatArray, faces: IntArray, kept: BoolArray, most: int
) -> tuple[IntArray, IntArray]:
    """Return at most so many triangles in place of all: the faces that stay, and their (k, 3) new corners.

    Points are merged that lie in one cell both in space and in the plane; each cell is represented by its point
    nearest to their mean. Points that are kept, those on outlines, stay themselves. Such a map of a chart's
    points, the identity on its outline, covers all of the chart, so no holes appear in the plane or in space.

    Args:
        places: (u, 3) points in space, of a size about 1.
        uv: (u, 2) the same points in the plane.
        faces: (m, 3) triangles.
        kept: (u,) which points must stay.
        most: triangles wanted at most.

    Raises:
        MeshError: the triangles along outlines alone are more than that.
    """
    areas = signed_double_areas(uv[faces])
    area = float(np.linalg.norm(np.cross(*sides(places[faces])), axis=1).sum())
    scale = np.sqrt(np.abs(areas).sum() / max(area, TINY))
    coordinates = np.column_stack([places, uv / max(scale, TINY)])
    coordinates -= coordinates.min(axis=0)
    extent = float(coordinates.max())
    # A cell holds about two triangles.
    size = float(np.sqrt(area / most))
    for _ in range(ROUNDS):
        new = _representatives(coordinates, kept, max(size, extent / CELLS))
        corners = new[faces]
        stay = (
            (corners[:, 0] != corners[:, 1])
            & (corners[:, 1] != corners[:, 2])
            & (corners[:, 2] != corners[:, 0])
        )
        # Where merging folds the plane, what runs forward covers all that what runs backward does.
        stay[stay] = signed_double_areas(uv[corners[stay]]) * areas[stay] > 0
        count = int(stay.sum())
        if count <= most:
            chosen = np.flatnonzero(stay)
            return chosen, corners[chosen]
        if size > extent:
            break
        size *= float(np.clip(np.sqrt(count / most), 1.1, 2.0))
    raise MeshError(
        f"{len(faces):,} triangles are too many for a page of {most:,}: {count:,} of them lie along seams or "
        "boundaries, where none can be left out; allow more"
    )


def _representatives(coordinates: FloatArray, kept: BoolArray, size: float) -> IntArray:
    """Return (u,) the point that stands for each."""
    new = np.arange(len(coordinates))
    free = np.flatnonzero(~kept)
    if not len(free):
        return new
    cells = np.floor(coordinates[free] / size).astype(np.int64)
    key = np.zeros(len(free), dtype=np.int64)
    for column in cells.T:
        key = key * (CELLS + 1) + column
    _, cell = np.unique(key, return_inverse=True)
    cell = cell.reshape(-1)
    members = np.bincount(cell)
    off = np.zeros(len(free))
    for column in coordinates[free].T:
        off += (column - (np.bincount(cell, weights=column) / members)[cell]) ** 2
    order = np.lexsort([off, cell])
    first = np.concatenate([[0], np.cumsum(members)[:-1]])
    new[free] = free[order[first]][cell]
    return new


def sides(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the two sides (m, d) of triangles (m, 3, d) from their first corner."""
    return corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
