"""Exact grid coordinates: a point of the surface has consistent coordinates in all triangles that contain it.

Quarter turns and integer translations are exact for numbers with a fixed number of binary digits. So one corner of each
vertex is rounded to such a number, and its coordinates are transported around the vertex to the other corners (H.-C.
Ebke, D. Bommes, M. Campen, L. Kobbelt, "QEx: robust quad mesh extraction", 2013). After that no rounding occurs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..base import BoolArray, FloatArray, IntArray, list_some, mask_of, plural
from ..errors import GridError
from ..geometry import fill_orientations, halfedge_twins, quarters_around, rotated, sides_between
from ..mesh.connectivity import TriangleMesh
from .options import GRID_TOLERANCE

if TYPE_CHECKING:
    from .integer_map import IntegerGrid

# Grid units: closer coordinates are snapped to a grid line. Errors of solvers are about 1e-12.
SNAP_DISTANCE = 1e-9


@dataclass(frozen=True, eq=False)
class ExactGrid:
    """An exact integer-grid map, as arrays for compiled kernels.

    Attributes:
        mesh: the triangles.
        corners: (m, 3, 2) exact grid coordinates: across every edge, the motion maps one side exactly to the other.
        twin: (3m,) the opposite half-edge of each, -1 on the boundary.
        turns: (3m,) quarter turns from the coordinates of the half-edge's triangle to those of its twin's.
        shifts: (3m, 2) integer translations, added after the rotation.
        fans: corners as indices into `faces.ravel()`: array k holds the corner of each vertex k steps counterclockwise
            of its first corner, which on the boundary is the most clockwise one; vertices with fewer corners are left
            out.
    """

    mesh: TriangleMesh
    corners: FloatArray
    twin: IntArray
    turns: IntArray
    shifts: FloatArray
    fans: list[IntArray]


def exact_grid(grid: IntegerGrid) -> ExactGrid:
    """Return an integer-grid map with exact coordinates.

    Raises:
        GridError: the map is not an integer-grid map: the two sides of an edge do not match, a cone is not a grid
            point, or a triangle is not counterclockwise.
    """
    mesh = TriangleMesh(np.asarray(grid.vertices, np.float64), np.asarray(grid.faces, np.int64))
    corner_grid = np.ascontiguousarray(grid.corner_grid, np.float64)
    twin = halfedge_twins(mesh)
    # The motions of a half-edge are those to its twin's triangle, the inverse of the given ones.
    turns = np.where(twin >= 0, np.asarray(grid.turns)[twin] % 4, 0)
    shifts = np.where(twin[:, None] >= 0, np.asarray(grid.shifts)[twin], 0.0)
    fans = _fans(mesh, twin)
    largest = max(float(np.abs(corner_grid).max()), float(np.abs(shifts).max(initial=0.0)), 1.0)
    # Coordinates have two binary digits less than a double, so that sums of coordinates and shifts are exact.
    step = np.ldexp(1.0, int(np.frexp(largest)[1]) - 51)
    start = np.zeros((len(mesh.vertices), 2))
    start[mesh.faces.ravel()[fans[0]]] = step * np.round(corner_grid.reshape(-1, 2)[fans[0]] / step)
    rounded = np.round(start)
    snapped = np.where(np.abs(start - rounded) <= SNAP_DISTANCE, rounded, start)
    exact = ExactGrid(mesh, corner_grid, twin, turns, shifts, fans)
    corners, is_off = _transport(exact, snapped)
    bad = mesh.faces[orientations(corners) <= 0]
    if bad.size:  # Snapping degenerates very thin triangles: their vertices are rounded, but not snapped.
        snapped[bad] = start[bad]
        corners, is_off = _transport(exact, snapped)
    exact = replace(exact, corners=corners)
    _require_map(exact, corner_grid, is_off)
    return exact


def _fans(mesh: TriangleMesh, twin: IntArray) -> list[IntArray]:
    """Return the corners around vertices in counterclockwise steps, see `ExactGrid.fans`."""
    flat, corner = mesh.faces.ravel(), np.arange(mesh.faces.size)
    first = np.full(len(mesh.vertices), -1, dtype=np.int64)
    first[flat[::-1]] = corner[::-1]
    most_clockwise = twin[corner - corner % 3 + (corner + 2) % 3] < 0
    first[flat[most_clockwise]] = corner[most_clockwise]
    fans, corner = [], first[first >= 0]
    while len(corner):
        fans.append(corner)
        into = twin[corner - corner % 3 + (corner + 1) % 3]
        into = into[into >= 0]
        corner = into - into % 3 + (into + 1) % 3
        corner = corner[corner != first[flat[corner]]]
    return fans


def _transport(exact: ExactGrid, start: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return (m, 3, 2) the coordinates of all corners, transported from the first corners of the vertices (n, 2).

    And (n,) whether the coordinates of a vertex differ after a full loop.
    """
    flat, current = exact.mesh.faces.ravel(), start.copy()
    corners = np.empty((len(flat), 2))
    for corner in exact.fans:
        corners[corner] = current[flat[corner]]
        out = corner - corner % 3 + (corner + 1) % 3
        goes_on = exact.twin[out] >= 0
        vertex, out = flat[corner[goes_on]], out[goes_on]
        current[vertex] = rotated(exact.turns[out], current[vertex]) + exact.shifts[out]
    is_off = (current != start).any(axis=1) & ~exact.mesh.is_boundary_vertex
    return corners.reshape(-1, 3, 2), is_off


def orientations(corners: FloatArray) -> IntArray:
    """Return (m,) the exact orientation signs of triangles with corners (m, 3, 2)."""
    signs = np.empty(len(corners), dtype=np.int64)
    fill_orientations(corners.reshape(-1, 6), np.empty(12), signs)
    return signs


def _require_map(exact: ExactGrid, corner_grid: FloatArray, is_off: BoolArray) -> None:
    """Raise GridError unless sides of edges match, triangles are counterclockwise, and cones lie on grid points."""
    mesh, flat = exact.mesh, exact.corners.reshape(-1, 2)
    off = np.abs(exact.corners - corner_grid).max(axis=(1, 2))
    is_cone = ~mesh.is_boundary_vertex & (quarters_around(mesh, sides_between(exact.corners)) != 4)
    is_between = mask_of(len(mesh.vertices), mesh.faces.ravel()[(flat != np.round(flat)).any(axis=1)])
    apart = f"the two sides of edges of {{}} are up to {off.max():.1e} grid units apart"
    for is_bad, nouns, text in (
        (is_off, ("vertex", "vertices"), "{} around which the grid does not close"),
        (~(off <= GRID_TOLERANCE), ("face",), apart),
        (orientations(exact.corners) <= 0, ("triangle",), "{} without area or flipped in the grid"),
        (is_cone & is_between, ("cone",), "{} off the grid points"),
    ):
        bad = np.flatnonzero(is_bad)
        if len(bad):
            raise GridError(f"{text.format(plural(len(bad), *nouns))}: {list_some(bad)}")
