"""Grid coordinates without rounding: the same point of the surface has the same place seen from all its triangles.

Turns by quarters and whole translations are exact on numbers with a fixed number of binary places. So one corner of
each vertex is rounded to such places, and carried around the vertex to the others (H.-C. Ebke, D. Bommes, M. Campen, L.
Kobbelt, "QEx: robust quad mesh extraction", 2013). From there on nothing is rounded any more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ... import TriangleMesh
from ...base import BoolArray, FloatArray, IntArray, compiled, list_some, plural
from ...errors import GridError
from ...geometry import fill_orientations, sides_between
from .layout import GRID_TOLERANCE, quarters_around

if TYPE_CHECKING:
    from .integer_map import IntegerGrid

# Grid units: what is so near a grid line is on it. Solvers leave 1e-12; what is on a line is to stay there.
SNAP_DISTANCE = 1e-9


@dataclass(frozen=True, eq=False)
class ExactGrid:
    """A map onto the integer grid that is exact, in arrays as kernels take them.

    Attributes:
        mesh: the triangles.
        corners: (m, 3, 2) grid coordinates, exact: across every edge one side is the other moved.
        twin: (3m,) the other half-edge of each edge, -1 on the boundary.
        turns: (3m,) quarter turns from the coordinates of the half-edge's triangle to those of its twin's.
        shifts: (3m, 2) likewise, added after turning; whole.
        fans: corners, numbered along `faces.ravel()`: the first one of each vertex, on the boundary the most clockwise;
            the second ones counterclockwise of these, where there are any; and so on.
    """

    mesh: TriangleMesh
    corners: FloatArray
    twin: IntArray
    turns: IntArray
    shifts: FloatArray
    fans: list[IntArray]


def exact_grid(grid: IntegerGrid) -> ExactGrid:
    """Return an integer-grid map made exact.

    Raises:
        GridError: it is none: the two sides of an edge do not fit, a cone is no grid point or has another angle
            than said, or a triangle is not counterclockwise.
    """
    mesh = TriangleMesh(np.asarray(grid.vertices, np.float64), np.asarray(grid.faces, np.int64))
    given = np.ascontiguousarray(grid.corner_grid, np.float64)
    twin = np.full(mesh.faces.size, -1, dtype=np.int64)
    one, two = mesh.edge_halfedges[~mesh.is_boundary_edge].T
    twin[one], twin[two] = two, one
    turns, shifts = _crossings(grid, twin)
    fans = _fans(mesh, twin)
    most = max(float(np.abs(given).max()), float(np.abs(shifts).max(initial=0.0)), 1.0)
    # Binary digits of a coordinate: those of a double, but for two, as sums of coordinates and shifts are to be exact.
    step = np.ldexp(1.0, int(np.frexp(most)[1]) - 51)
    start = np.zeros((len(mesh.vertices), 2))
    start[mesh.faces.ravel()[fans[0]]] = step * np.round(given.reshape(-1, 2)[fans[0]] / step)
    whole = np.round(start)
    snapped = np.where(np.abs(start - whole) <= SNAP_DISTANCE, whole, start)
    exact = ExactGrid(mesh, given, twin, turns, shifts, fans)
    corners, is_off = _carried(exact, snapped)
    bad = mesh.faces[_signs(corners) <= 0]
    if bad.size:  # Triangles flatter than that: their vertices are rounded only.
        snapped[bad] = start[bad]
        corners, is_off = _carried(exact, snapped)
    exact = replace(exact, corners=corners)
    _require_map(exact, given, is_off)
    _require_cones(exact, grid)
    return exact


def _crossings(grid: IntegerGrid, twin: IntArray) -> tuple[IntArray, FloatArray]:
    """Return (3m,), (3m, 2) the motions from each half-edge's triangle to its twin's, the inverses of those given."""
    inner = twin >= 0
    turns, shifts = np.zeros(len(twin), dtype=np.int64), np.zeros((len(twin), 2))
    turns[inner] = np.asarray(grid.turns)[twin[inner]]
    shifts[inner] = np.asarray(grid.shifts)[twin[inner]]
    back = turned(turns[inner] % 4, shifts[twin[inner]])
    wrong = (turns[inner] + turns[twin[inner]]) % 4 != 0
    wrong |= (back + shifts[inner] != 0).any(axis=1) | (turns[inner] < 0) | (turns[inner] > 3)
    if wrong.any():
        where = list_some(np.flatnonzero(inner)[wrong] // 3)
        raise GridError(
            f"{plural(int(wrong.sum()), 'half-edge')} with a motion that is not the inverse of the twin's, "
            f"in faces {where}: this is not an integer-grid map"
        )
    return turns, shifts


def turned(turns: IntArray, points: FloatArray) -> FloatArray:
    """Return (k, 2) points turned by quarters (k,), without rounding."""
    cosine, sine = np.array([1.0, 0.0, -1.0, 0.0])[turns], np.array([0.0, 1.0, 0.0, -1.0])[turns]
    x, y = points[:, 0], points[:, 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=1)


def _fans(mesh: TriangleMesh, twin: IntArray) -> list[IntArray]:
    """Return the corners of vertices step by step counterclockwise, see `ExactGrid.fans`."""
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


def _carried(exact: ExactGrid, start: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return (m, 3, 2) the places of vertices (n, 2), carried from their first corners to the others.

    And (n,) which do not come back to where they were, or do though the surface turns by quarters around them and the
    place is no grid point.
    """
    flat, here = exact.mesh.faces.ravel(), start.copy()
    corners, total = np.empty((len(flat), 2)), np.zeros(len(start), dtype=np.int64)
    for corner in exact.fans:
        corners[corner] = here[flat[corner]]
        out = corner - corner % 3 + (corner + 1) % 3
        goes_on = exact.twin[out] >= 0
        vertex, out = flat[corner[goes_on]], out[goes_on]
        here[vertex] = turned(exact.turns[out], here[vertex]) + exact.shifts[out]
        total[vertex] += exact.turns[out]
    is_off = (here != start).any(axis=1)
    is_off |= (total % 4 != 0) & (start != np.round(start)).any(axis=1)
    return corners.reshape(-1, 3, 2), is_off & ~exact.mesh.is_boundary_vertex


@compiled
def turn(quarters: int, x: float, y: float) -> tuple[float, float]:
    """Return a point turned counterclockwise by quarters from 0 to 3, without rounding."""
    if quarters == 0:
        return x, y
    if quarters == 1:
        return -y, x
    if quarters == 2:
        return -x, -y
    return y, -x


def _signs(corners: FloatArray) -> IntArray:
    """Return (m,) the orientations of triangles, exact."""
    signs = np.empty(len(corners), dtype=np.int64)
    fill_orientations(corners.reshape(-1, 6), np.empty(12), signs)
    return signs


def _require_map(exact: ExactGrid, given: FloatArray, is_off: BoolArray) -> None:
    """Raise GridError unless the two sides of all edges fit, and all triangles are counterclockwise."""
    bad = np.flatnonzero(is_off)
    if len(bad):
        raise GridError(
            f"{plural(len(bad), 'vertex', 'vertices')} around which the grid does not close, or turns though they are "
            f"no grid points: {list_some(bad)}"
        )
    off = np.abs(exact.corners - given).max(axis=(1, 2))
    bad = np.flatnonzero(~(off <= GRID_TOLERANCE))
    if len(bad):
        raise GridError(
            f"the two sides of edges of {plural(len(bad), 'face')} are up to {np.max(off):.1e} grid units apart: "
            f"{list_some(bad)}"
        )
    bad = np.flatnonzero(_signs(exact.corners) <= 0)
    if len(bad):
        raise GridError(
            f"{plural(len(bad), 'triangle')} without area or flipped in the grid: {list_some(bad)}"
        )


def _require_cones(exact: ExactGrid, grid: IntegerGrid) -> None:
    """Raise GridError unless the inner vertices that have not four quarters of angle are the cones, on grid points."""
    mesh = exact.mesh
    found = quarters_around(mesh, sides_between(exact.corners))
    said = np.full(len(found), 4, dtype=np.int64)
    said[np.asarray(grid.cones, np.int64)] = grid.quarters
    inner = ~mesh.is_boundary_vertex & (np.bincount(mesh.faces.ravel(), minlength=len(found)) > 0)
    bad = np.flatnonzero(inner & (found != said))
    if len(bad):
        raise GridError(
            f"{plural(len(bad), 'vertex', 'vertices')} with other angles than said: {list_some(bad)}; vertex {bad[0]} "
            f"has {found[bad[0]]} quarter turns, not {said[bad[0]]}"
        )
    place = exact.corners.reshape(-1, 2)[exact.fans[0]]
    is_loose = np.zeros(len(found), dtype=bool)
    is_loose[mesh.faces.ravel()[exact.fans[0]]] = (place != np.round(place)).any(axis=1)
    bad = np.flatnonzero(inner & (said != 4) & is_loose)
    if len(bad):
        raise GridError(f"{plural(len(bad), 'cone')} off the grid points: {list_some(bad)}")
