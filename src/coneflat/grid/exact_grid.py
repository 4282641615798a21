"""Grid coordinates without rounding: the same point of the surface has the same place seen from all its triangles.

Turns by quarters and whole translations are exact on numbers with a fixed number of binary places. So one corner of
each vertex is rounded to such places, and carried around the vertex to the others (H.-C. Ebke, D. Bommes, M. Campen, L.
Kobbelt, "QEx: robust quad mesh extraction", 2013). From there on nothing is rounded any more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..compiled import compiled
from ..errors import GridError
from ..geometry.orientation import fill_orientations
from ..mesh import TriangleMesh
from ..text import list_some, plural

# Binary digits of a coordinate: those of a double, but for two, as sums of coordinates and shifts are to be exact.
DIGITS = 51
# Grid units: what is so near a grid line is on it. Solvers leave 1e-12; what is on a line is to stay there.
SNAP = 1e-9
# Grid units by which the corners of a vertex may differ: far more than rounding, far less than what matters.
LOOSE = 1e-6


class GridMap(Protocol):
    """An integer-grid map of a triangle mesh; half-edge 3 f + i is the side of face f opposite its corner i.

    Attributes:
        vertices, faces: (n, 3), (m, 3) the mesh.
        corner_grid: (m, 3, 2) grid coordinates of every triangle corner, counterclockwise in each triangle.
        turns: (3m,) quarter turns, -1 on the boundary: a point x of the twin's triangle is R(turns) x + shifts in the
            coordinates of the half-edge's own, R(k) being the counterclockwise rotation by k quarters.
        shifts: (3m, 2) whole translations.
        cones: (s,) vertices whose angle is not that of four quarters, at whole points.
        quarters: (s,) quarter turns of their angle.
    """

    @property
    def vertices(self) -> FloatArray:
        """(n, 3) positions."""

    @property
    def faces(self) -> IntArray:
        """(m, 3) vertex indices."""

    @property
    def corner_grid(self) -> FloatArray:
        """(m, 3, 2) grid coordinates."""

    @property
    def turns(self) -> IntArray:
        """(3m,) quarter turns across half-edges."""

    @property
    def shifts(self) -> IntArray:
        """(3m, 2) translations across half-edges."""

    @property
    def cones(self) -> IntArray:
        """(s,) vertices."""

    @property
    def quarters(self) -> IntArray:
        """(s,) quarter turns of the angles of the cones."""


@dataclass(frozen=True, eq=False)
class ExactGrid:
    """A map onto the integer grid that is exact, in arrays as kernels take them.

    Attributes:
        mesh: the triangles.
        corners: (m, 3, 2) grid coordinates, exact: across every edge one side is the other moved.
        twin: (3m,) the other half-edge of each edge, -1 on the boundary.
        turns: (3m,) quarter turns from the coordinates of the half-edge's triangle to those of its twin's.
        shifts: (3m, 2) likewise, added after turning; whole.
        first: (n,) a corner of each vertex, numbered along `faces.ravel()`; on the boundary the most clockwise.
    """

    mesh: TriangleMesh
    corners: FloatArray
    twin: IntArray
    turns: IntArray
    shifts: FloatArray
    first: IntArray


def exact_grid(grid: GridMap) -> ExactGrid:
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
    first = _first_corners(mesh, twin)
    most = max(float(np.abs(given).max()), float(np.abs(shifts).max(initial=0.0)), 1.0)
    step = np.ldexp(1.0, int(np.frexp(most)[1]) - DIGITS)
    start = step * np.round(given.reshape(-1, 2)[first] / step)
    whole = np.round(start)
    snapped = np.where(np.abs(start - whole) <= SNAP, whole, start)
    corners = np.empty_like(given)
    is_off = np.zeros(len(first), dtype=bool)
    _carry(snapped, first, twin, turns, shifts, corners, is_off)
    bad = mesh.faces[_signs(corners) <= 0]
    if bad.size:  # Triangles flatter than that: their vertices are rounded only.
        snapped[bad] = start[bad]
        _carry(snapped, first, twin, turns, shifts, corners, is_off)
    exact = ExactGrid(mesh, corners, twin, turns, shifts, first)
    _require_map(exact, given, is_off)
    _require_cones(exact, grid)
    return exact


def _crossings(grid: GridMap, twin: IntArray) -> tuple[IntArray, FloatArray]:
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
            f"in faces {where}: this is no integer-grid map"
        )
    return turns, shifts


def turned(turns: IntArray, points: FloatArray) -> FloatArray:
    """Return (k, 2) points turned by quarters (k,), without rounding."""
    cosine, sine = np.array([1.0, 0.0, -1.0, 0.0])[turns], np.array([0.0, 1.0, 0.0, -1.0])[turns]
    x, y = points[:, 0], points[:, 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=1)


def _first_corners(mesh: TriangleMesh, twin: IntArray) -> IntArray:
    """Return (n,) the least corner of each vertex, on the boundary the one that has no other clockwise of it."""
    flat = mesh.faces.ravel()
    first = np.full(len(mesh.vertices), -1, dtype=np.int64)
    first[flat[::-1]] = np.arange(len(flat))[::-1]
    corner = np.arange(len(flat))
    leaving = corner - corner % 3 + (corner % 3 + 2) % 3
    most_clockwise = twin[leaving] < 0
    first[flat[most_clockwise]] = corner[most_clockwise]
    return first


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


@compiled
def _carry(
    start: FloatArray,
    first: IntArray,
    twin: IntArray,
    turns: IntArray,
    shifts: FloatArray,
    corners: FloatArray,
    is_off: BoolArray,
) -> None:
    """Carry the place of each vertex from its first corner counterclockwise to all its corners.

    is_off: (n,) becomes True where it does not come back to where it was, or where it does though the surface turns
        by quarters around it and the place is no grid point.
    """
    for v in range(len(first)):
        if first[v] < 0:
            continue
        x, y = start[v, 0], start[v, 1]
        corner, total = first[v], 0
        is_off[v] = False
        while True:
            f, i = corner // 3, corner % 3
            corners[f, i, 0] = x
            corners[f, i, 1] = y
            out = 3 * f + (i + 1) % 3
            into = twin[out]
            if into < 0:
                break
            x, y = turn(turns[out], x, y)
            x += shifts[out, 0]
            y += shifts[out, 1]
            total += turns[out]
            corner = into - into % 3 + (into % 3 + 1) % 3
            if corner == first[v]:
                whole = x == np.floor(x) and y == np.floor(y)
                is_off[v] = x != start[v, 0] or y != start[v, 1] or (total % 4 != 0 and not whole)
                break


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
    bad = np.flatnonzero(~(off <= LOOSE))
    if len(bad):
        raise GridError(
            f"the two sides of edges of {plural(len(bad), 'face')} are up to {np.max(off):.1e} grid units apart: "
            f"{list_some(bad)}"
        )
    bad = np.flatnonzero(_signs(exact.corners) <= 0)
    if len(bad):
        raise GridError(
            f"{plural(len(bad), 'triangle')} without area or upside down in the grid: {list_some(bad)}"
        )


def _require_cones(exact: ExactGrid, grid: GridMap) -> None:
    """Raise GridError unless the inner vertices that have not four quarters of angle are the cones, on grid points."""
    mesh = exact.mesh
    sides = exact.corners[:, [1, 2, 0]] - exact.corners
    back = -sides[:, [2, 0, 1]]
    cross = sides[..., 0] * back[..., 1] - sides[..., 1] * back[..., 0]
    angle = np.arctan2(cross, (sides * back).sum(axis=2))
    total = np.bincount(mesh.faces.ravel(), angle.ravel(), len(mesh.vertices))
    found = np.round(total / (np.pi / 2)).astype(np.int64)
    said = np.full(len(found), 4, dtype=np.int64)
    said[np.asarray(grid.cones, np.int64)] = grid.quarters
    inner = ~mesh.is_boundary_vertex
    used = exact.first >= 0
    bad = np.flatnonzero(used & inner & (found != said))
    if len(bad):
        raise GridError(
            f"{plural(len(bad), 'vertex', 'vertices')} with other angles than said: {list_some(bad)}; vertex {bad[0]} "
            f"has {found[bad[0]]} quarter turns, not {said[bad[0]]}"
        )
    place = exact.corners.reshape(-1, 2)[exact.first]
    bad = np.flatnonzero(used & inner & (said != 4) & (place != np.round(place)).any(axis=1))
    if len(bad):
        raise GridError(f"{plural(len(bad), 'cone')} off the grid points: {list_some(bad)}")
