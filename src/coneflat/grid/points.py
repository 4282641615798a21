"""The points of an integer grid on a surface, each once, and the directions in which grid lines leave them.

A point lies inside a triangle, within an edge or at a vertex; which, exact signs decide (H.-C. Ebke, D. Bommes, M.
Campen, L. Kobbelt, "QEx: robust quad mesh extraction", 2013).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import FloatArray, IntArray
from ..compiled import compiled
from ..geometry.orientation import orientation
from .exact_grid import ExactGrid, turn

# Where in its triangle a point lies: within side 0, 1 or 2, at corner 0, 1 or 2, or inside.
CORNER, INSIDE = 3, 6


@dataclass(frozen=True, eq=False)
class GridPoints:
    """The grid points of a surface.

    Attributes:
        start: (m + 1,) triangle f, with its boundary, holds the entries from start[f] to start[f + 1].
        places: (e, 2) their coordinates in the triangle, sorted by the second, then by the first.
        points: (e,) the point of each entry; those on edges and at vertices have several.
        entry: (p,) the entry that a point is known by.
        faces: (p,) the triangle of that entry.
        sides: (p,) where in that triangle the point lies: within side 0 to 2, at corner 3 to 5, or inside, 6.
    """

    start: IntArray
    places: FloatArray
    points: IntArray
    entry: IntArray
    faces: IntArray
    sides: IntArray

    @property
    def own_places(self) -> FloatArray:
        """(p, 2) coordinates of each point in its own triangle."""
        return self.places[self.entry]


@dataclass(frozen=True, eq=False)
class Ports:
    """The directions in which grid lines leave grid points, counterclockwise around each.

    Attributes:
        start: (p + 1,) point v has the ports from start[v] to start[v + 1].
        faces: (k,) the triangle that a port leads into, or along whose side it leads.
        directions: (k,) 0 to 3, quarter turns from the first axis of that triangle's coordinates.
        is_boundary: (p,) whether the point is on the boundary, where the first port has none clockwise of it.
    """

    start: IntArray
    faces: IntArray
    directions: IntArray
    is_boundary: IntArray

    @property
    def points(self) -> IntArray:
        """(k,) the point of each port."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))


def find_points(exact: ExactGrid) -> GridPoints:
    """Return the grid points of a surface."""
    corners, faces = exact.corners, exact.mesh.faces
    counts = np.zeros(len(faces) + 1, dtype=np.int64)
    none, nowhere = np.empty(0, dtype=np.int64), np.empty((0, 2))
    _fill_entries(corners, counts, nowhere, none, True)
    start = np.cumsum(counts)
    places = np.empty((start[-1], 2))
    sides = np.empty(start[-1], dtype=np.int64)
    _fill_entries(corners, start.copy(), places, sides, False)
    points, entry = np.empty(len(places), dtype=np.int64), np.empty(len(places), dtype=np.int64)
    count = _number(
        faces, exact.twin, exact.turns, exact.shifts, len(exact.first), start, places, sides, points, entry
    )
    entry = entry[:count]
    return GridPoints(
        start, places, points, entry, np.searchsorted(start, entry, side="right") - 1, sides[entry]
    )


@compiled
def _fill_entries(
    corners: FloatArray, start: IntArray, places: FloatArray, sides: IntArray, only_count: bool
) -> None:
    """Find the grid points in each triangle with its boundary, row by row.

    start: (m + 1,) where each triangle's entries begin; or, to count them, zeros: start[f + 1] becomes the number.
    """
    parts = np.empty(12)
    for f in range(len(corners)):
        c = corners[f]
        low_x, high_x = np.ceil(min(c[0, 0], c[1, 0], c[2, 0])), np.floor(max(c[0, 0], c[1, 0], c[2, 0]))
        low_y, high_y = np.ceil(min(c[0, 1], c[1, 1], c[2, 1])), np.floor(max(c[0, 1], c[1, 1], c[2, 1]))
        if low_x > high_x:
            continue
        filled = start[f]
        y = low_y
        while y <= high_y:
            x = low_x
            while x <= high_x:
                side = _side_of(c, x, y, parts)
                if side >= 0:
                    if only_count:
                        start[f + 1] += 1
                    else:
                        places[filled, 0] = x
                        places[filled, 1] = y
                        sides[filled] = side
                        filled += 1
                x += 1.0
            y += 1.0


@compiled
def _side_of(c: FloatArray, x: float, y: float, parts: FloatArray) -> int:
    """Return where a point lies in a triangle with corners (3, 2), see `GridPoints.sides`; -1 outside it."""
    zeros, last, total = 0, -1, 0
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        sign = orientation(c[a, 0], c[a, 1], c[b, 0], c[b, 1], x, y, parts)
        if sign < 0:
            return -1
        if sign == 0:
            zeros, last, total = zeros + 1, i, total + i
    if zeros == 0:
        return INSIDE
    if zeros == 1:
        return last
    return CORNER + 3 - total  # The corner that both sides have is opposite the third.


@compiled
def find_entry(start: IntArray, places: FloatArray, face: int, x: float, y: float) -> int:
    """Return the entry of a triangle at a place, -1 where there is none."""
    low, high = start[face], start[face + 1]
    while low < high:
        middle = (low + high) // 2
        if places[middle, 1] < y or (places[middle, 1] == y and places[middle, 0] < x):
            low = middle + 1
        else:
            high = middle
    if low < start[face + 1] and places[low, 0] == x and places[low, 1] == y:
        return low
    return -1


@compiled
def _number(
    faces: IntArray,
    twin: IntArray,
    turns: IntArray,
    shifts: FloatArray,
    vertex_count: int,
    start: IntArray,
    places: FloatArray,
    sides: IntArray,
    points: IntArray,
    entry: IntArray,
) -> int:
    """Number the points in the order in which triangles have them, and return how many there are.

    Args:
        points: (e,) filled: the point of each entry.
        entry: filled: the first entry of each point.
    """
    at_vertex = np.full(vertex_count, -1, dtype=np.int64)
    count = 0
    for f in range(len(faces)):
        for e in range(start[f], start[f + 1]):
            side = sides[e]
            points[e] = -1
            if side < CORNER:
                h = 3 * f + side
                if 0 <= twin[h] < h:
                    x, y = turn(turns[h], places[e, 0], places[e, 1])
                    x, y = x + shifts[h, 0], y + shifts[h, 1]
                    points[e] = points[find_entry(start, places, twin[h] // 3, x, y)]
            elif side < INSIDE:
                points[e] = at_vertex[faces[f, side - CORNER]]
            if points[e] < 0:
                if CORNER <= side < INSIDE:
                    at_vertex[faces[f, side - CORNER]] = count
                points[e] = count
                entry[count] = e
                count += 1
    return count


def find_ports(exact: ExactGrid, found: GridPoints) -> Ports:
    """Return the directions in which grid lines leave the grid points."""
    flat, points = exact.mesh.faces.ravel(), found.faces
    degree = np.bincount(flat, minlength=len(exact.first))
    at_corner = (found.sides >= CORNER) & (found.sides < INSIDE)
    vertex = flat[3 * points[at_corner] + found.sides[at_corner] - CORNER]
    room = 5 * int((~at_corner).sum()) + int((2 * degree[vertex] + 1).sum())
    start = np.zeros(len(points) + 1, dtype=np.int64)
    port_faces, directions = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
    is_boundary = np.zeros(len(points), dtype=np.int64)
    _fill_ports(
        exact.mesh.faces,
        exact.corners,
        exact.twin,
        exact.first,
        found.faces,
        found.sides,
        start,
        port_faces,
        directions,
        is_boundary,
    )
    return Ports(start, port_faces[: start[-1]], directions[: start[-1]], is_boundary)


@compiled
def _fill_ports(
    faces: IntArray,
    corners: FloatArray,
    twin: IntArray,
    first: IntArray,
    point_faces: IntArray,
    sides: IntArray,
    start: IntArray,
    port_faces: IntArray,
    directions: IntArray,
    is_boundary: IntArray,
) -> None:
    count = 0
    for p in range(len(point_faces)):
        f, side = point_faces[p], sides[p]
        if side == INSIDE:
            for d in range(4):
                port_faces[count + d] = f
                directions[count + d] = d
            count += 4
        elif side < CORNER:
            h = 3 * f + side
            while h >= 0:
                f, i = h // 3, h % 3
                closed = twin[h] < 0
                one, two = corners[f, (i + 1) % 3], corners[f, (i + 2) % 3]
                x, y = two[0] - one[0], two[1] - one[1]
                count = _add_ports(f, x, y, -x, -y, closed, port_faces, directions, count)
                is_boundary[p] |= closed
                h = -1 if twin[h] == 3 * point_faces[p] + side else twin[h]
        else:
            begin = first[faces[f, side - CORNER]]
            corner = begin
            while True:
                f, i = corner // 3, corner % 3
                into = twin[3 * f + (i + 1) % 3]
                one, two, own = corners[f, (i + 1) % 3], corners[f, (i + 2) % 3], corners[f, i]
                count = _add_ports(
                    f,
                    one[0] - own[0],
                    one[1] - own[1],
                    two[0] - own[0],
                    two[1] - own[1],
                    into < 0,
                    port_faces,
                    directions,
                    count,
                )
                if into < 0:
                    is_boundary[p] = 1
                    break
                corner = into - into % 3 + (into % 3 + 1) % 3
                if corner == begin:
                    break
        start[p + 1] = count


@compiled
def _add_ports(
    face: int,
    x: float,
    y: float,
    to_x: float,
    to_y: float,
    closed: bool,
    port_faces: IntArray,
    directions: IntArray,
    count: int,
) -> int:
    """Add the directions from (x, y) counterclockwise up to (to_x, to_y), which counts if closed; return the number.

    The angle between is at most half a turn. Signs of differences and comparisons are exact.
    """
    if x > 0 and y >= 0:
        d = 0
    elif y > 0:
        d = 1
    elif x < 0:
        d = 2
    else:
        d = 3
    along_x, along_y = turn(d, 1.0, 0.0)
    if x * along_y != y * along_x:  # One of x and y is not multiplied by 0, so the products are exact.
        d = (d + 1) % 4
    for _ in range(3):
        along_x, along_y = turn(d, 1.0, 0.0)
        from_start, to_end = x * along_y - y * along_x, along_x * to_y - along_y * to_x
        if from_start > 0:
            within = to_end > 0 or (closed and to_end == 0)
        elif from_start == 0:
            within = x * along_x + y * along_y > 0 or (closed and to_end == 0)
        else:
            within = False
        if not within:
            break
        port_faces[count] = face
        directions[count] = d
        count += 1
        d = (d + 1) % 4
    return count
