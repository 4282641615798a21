"""The points of an integer grid on a surface, and the grid lines that connect them.

Exact predicates decide whether a point lies inside a triangle, on an edge or at a vertex (H.-C. Ebke, D. Bommes, M.
Campen, L. Kobbelt, "QEx: robust quad mesh extraction", 2013). Lines are traced for one unit from point to point, across
triangles and seams. A traced line is symbolically displaced by an infinitesimal distance to its left or right, so that
it never meets a vertex: exact signs give the two sides of a triangle that it crosses, and a line along edges is not a
special case.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..base import BoolArray, FloatArray, IntArray, compiled, dots, mask_of
from ..geometry import orientation, rotated, turn
from .grid_coordinates import ExactGrid, orientations

#: Values for a port without a mate: its line ends at the boundary, or the map is invalid.
BOUNDARY, LOST = -1, -2
# The directions of ports.
AXES = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])

# A map and its points as arguments of kernels: corners, twin, turns and shifts of an `ExactGrid`, start and places of
# `GridPoints`.
Grid: TypeAlias = tuple[FloatArray, IntArray, IntArray, FloatArray, IntArray, FloatArray]


@dataclass(frozen=True, eq=False)
class GridPoints:
    """The grid points of a surface.

    Attributes:
        start: (m + 1,) the closed triangle f contains the entries from start[f] to start[f + 1].
        places: (e, 2) coordinates of the entries in the triangle, sorted by the second, then by the first coordinate.
        points: (e,) the point of each entry; points on edges and at vertices have several entries.
        entry: (p,) a representative entry of each point.
        faces: (p,) the triangle of that entry.
        sides: (p,) position of the point in that triangle: 0 to 2 on a side, 3 to 5 at a corner, 6 inside.
    """

    start: IntArray
    places: FloatArray
    points: IntArray
    entry: IntArray
    faces: IntArray
    sides: IntArray

    @property
    def own_places(self) -> FloatArray:
        """(p, 2) coordinates of each point in the triangle of its representative entry."""
        return self.places[self.entry]


@dataclass(frozen=True, eq=False)
class Ports:
    """The directions in which grid lines leave grid points, counterclockwise around each.

    Attributes:
        start: (p + 1,) point v has the ports from start[v] to start[v + 1].
        faces: (k,) the triangle that contains the start of the grid line, inside or along a side.
        directions: (k,) 0 to 3, quarter turns from the first axis of that triangle's coordinates.
        places: (k, 2) the coordinates of the point in that triangle.
        is_boundary: (p,) whether the point is on the boundary, where the first port has no clockwise neighbour.
    """

    start: IntArray
    faces: IntArray
    directions: IntArray
    places: FloatArray
    is_boundary: BoolArray

    @property
    def points(self) -> IntArray:
        """(k,) the point of each port."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))


def find_points(exact: ExactGrid) -> GridPoints:
    """Return the grid points of a surface."""
    faces, places = _candidates(exact.corners)
    corners = exact.corners[faces]
    repeated = np.broadcast_to(places[:, None], corners.shape)
    rows = np.stack([corners[:, [1, 2, 0]], corners[:, [2, 0, 1]], repeated], axis=2)
    signs = orientations(rows.reshape(-1, 3, 2)).reshape(-1, 3)
    within = (signs >= 0).all(axis=1)
    faces, places, on = faces[within], places[within], signs[within] == 0
    # The common corner of two sides is opposite the third side.
    sides = np.choose(on.sum(axis=1), [6, on.argmax(axis=1), 3 + on.argmin(axis=1)])
    label = _same_point(exact, faces, places, sides)
    _, entry, points = np.unique(label, return_index=True, return_inverse=True)
    # Points are numbered in the order of triangles.
    rank = np.argsort(entry)
    number, entry = np.argsort(rank), entry[rank]
    start = np.concatenate([[0], np.cumsum(np.bincount(faces, minlength=len(exact.corners)))])
    return GridPoints(start, places, number[points.ravel()], entry, faces[entry], sides[entry])


def _candidates(corners: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return (k,) triangles and (k, 2) candidate grid points: all in the triangles, and a few others."""
    low, high = np.ceil(corners[..., 1].min(axis=1)), np.floor(corners[..., 1].max(axis=1))
    faces, y = _ranges(low, high)
    leftmost, rightmost = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for i in range(3):
        start, end = corners[faces, i], corners[faces, (i + 1) % 3]
        along = end - start
        meets = (along[:, 1] != 0) & (np.minimum(start[:, 1], end[:, 1]) <= y)
        meets &= y <= np.maximum(start[:, 1], end[:, 1])
        x = start[meets, 0] + (y - start[:, 1])[meets] / along[meets, 1] * along[meets, 0]
        leftmost[meets], rightmost[meets] = np.minimum(leftmost[meets], x), np.maximum(rightmost[meets], x)
    rows, x = _ranges(np.floor(leftmost), np.ceil(rightmost))
    return faces[rows], np.stack([x, y[rows]], axis=1)


def _ranges(low: FloatArray, high: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the concatenated integer ranges from low to high: (k,) the index of the range, and (k,) the integer."""
    counts = np.maximum(high - low + 1, 0).astype(np.int64)
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, low[owner] + np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


def _same_point(exact: ExactGrid, faces: IntArray, places: FloatArray, sides: IntArray) -> IntArray:
    """Return (k,) a label for each entry, equal for entries of the same point."""
    at_vertex = (sides >= 3) & (sides < 6)
    on_edge = sides < 3
    label = np.arange(len(faces)) + len(exact.mesh.vertices)
    label[at_vertex] = exact.mesh.faces[faces[at_vertex], sides[at_vertex] - 3]
    half = 3 * faces[on_edge] + sides[on_edge]
    owner, place = half.copy(), places[on_edge]
    seen = np.flatnonzero((exact.twin[half] >= 0) & (exact.twin[half] < half))
    owner[seen] = exact.twin[half[seen]]
    place[seen] = rotated(exact.turns[half[seen]], place[seen]) + exact.shifts[half[seen]]
    keys = np.concatenate([owner[:, None], place.astype(np.int64)], axis=1)
    _, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    label[on_edge] = label[on_edge][first][which.ravel()]
    return label


@compiled
def find_entry(start: IntArray, places: FloatArray, face: int, x: float, y: float) -> int:
    """Return the entry of a triangle at given coordinates, -1 if there is none."""
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


def find_ports(exact: ExactGrid, points: GridPoints) -> Ports:
    """Return the directions in which grid lines leave the grid points."""
    corners, flat = exact.corners, exact.mesh.faces.ravel()
    inside = np.flatnonzero(points.sides == 6)
    every = np.broadcast_to(np.arange(4), (len(inside), 4))
    parts = [
        (inside, points.faces[inside], points.own_places[inside], every, np.zeros(len(inside), dtype=bool))
    ]

    on_edge = np.flatnonzero(points.sides < 3)
    half, places = 3 * points.faces[on_edge] + points.sides[on_edge], points.own_places[on_edge]
    for _ in range(2):
        faces, i = half // 3, half % 3
        side = corners[faces, (i + 2) % 3] - corners[faces, (i + 1) % 3]
        closed = exact.twin[half] < 0
        parts.append((on_edge, faces, places, _directions(side, -side, closed), closed))
        places = (rotated(exact.turns[half], places) + exact.shifts[half])[~closed]
        on_edge, half = on_edge[~closed], exact.twin[half[~closed]]
    at_vertex = np.flatnonzero((points.sides >= 3) & (points.sides < 6))
    point = np.full(len(exact.mesh.vertices), -1)
    point[flat[3 * points.faces[at_vertex] + points.sides[at_vertex] - 3]] = at_vertex
    for fan in exact.fans:
        fan = fan[point[flat[fan]] >= 0]
        faces, i = fan // 3, fan % 3
        place = corners[faces, i]
        start_side, end_side = corners[faces, (i + 1) % 3] - place, corners[faces, (i + 2) % 3] - place
        closed = exact.twin[3 * faces + (i + 1) % 3] < 0
        parts.append((point[flat[fan]], faces, place, _directions(start_side, end_side, closed), closed))
    point_of_wedge, faces, places, directions, closed = (
        np.concatenate(parts_of_field) for parts_of_field in zip(*parts, strict=True)
    )
    order = np.argsort(point_of_wedge, kind="stable")
    wedge, which = np.nonzero(directions[order] >= 0)
    wedge = order[wedge]
    is_boundary = mask_of(len(points.entry), point_of_wedge[closed])
    start = np.concatenate([[0], np.cumsum(np.bincount(point_of_wedge[wedge], minlength=len(points.entry)))])
    return Ports(start, faces[wedge], directions[wedge, which], places[wedge], is_boundary)


def _directions(start: FloatArray, end: FloatArray, closed: BoolArray) -> IntArray:
    """Return (w, 4) the axis directions in angles from `start` counterclockwise to `end`, padded with -1.

    `start` and `end` have shape (w, 2). An angle is at most half a turn; it includes `start`, and `end` only if
    `closed`. Signs of differences and comparisons are exact.
    """
    x, y = start.T
    d = np.select([(x > 0) & (y >= 0), y > 0, x < 0], [0, 1, 2], 3)
    # The components of an axis are 0 and 1 or -1, so the products are exact.
    d = (d + (_cross(start, AXES[d]) != 0)) % 4
    directions = np.full((len(d), 4), -1)
    goes_on = np.ones(len(d), dtype=bool)
    for k in range(3):
        along = AXES[d]
        since, left = _cross(start, along), _cross(along, end)
        is_last = closed & (left == 0)
        goes_on &= np.where(
            since > 0, (left > 0) | is_last, (since == 0) & ((dots(start, along) > 0) | is_last)
        )
        directions[goes_on, k] = d[goes_on]
        d = (d + 1) % 4
    return directions


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def join_ports(exact: ExactGrid, points: GridPoints, ports: Ports) -> IntArray:
    """Return (k,) the mate of each port: the port at the other end of its grid line, BOUNDARY or LOST."""
    ends = np.empty((len(ports.faces), 3), dtype=np.int64)
    grid = exact.corners, exact.twin, exact.turns, exact.shifts, points.start, points.places
    _follow_all(grid, ports.places, ports.faces, ports.directions, ends)
    mates, face, direction = ends.T
    arrived = np.flatnonzero(mates >= 0)
    mates[arrived] = _ports_back(
        exact, points, ports, mates[arrived], face[arrived], (direction[arrived] + 2) % 4
    )
    return mates


def _ports_back(
    exact: ExactGrid,
    grid_points: GridPoints,
    ports: Ports,
    entry: IntArray,
    face: IntArray,
    direction: IntArray,
) -> IntArray:
    """Return (k,) the port of the point of each entry in a given triangle and direction, or LOST.

    If the direction is along the most counterclockwise side of the triangle, the port belongs to the neighbour.
    """

    def keys(points: IntArray, faces: IntArray, directions: IntArray) -> IntArray:
        return 4 * (points * len(exact.corners) + faces) + directions

    keys_of_ports = keys(ports.points, ports.faces, ports.directions)
    order = np.argsort(keys_of_ports, kind="stable")

    def port_at(which: IntArray) -> IntArray:
        sought = keys(grid_points.points[entry[which]], face[which], direction[which])
        at = order[np.minimum(np.searchsorted(keys_of_ports, sought, sorter=order), len(order) - 1)]
        return np.where(keys_of_ports[at] == sought, at, LOST)

    port = port_at(np.arange(len(entry)))
    lost = np.flatnonzero(port == LOST)
    crossed = np.full(len(lost), -1)
    along, places = AXES[direction[lost]], grid_points.places[entry[lost]]
    for i in range(3):
        a, b = exact.corners[face[lost], (i + 1) % 3], exact.corners[face[lost], (i + 2) % 3]
        side, half = b - a, 3 * face[lost] + i
        signs = orientations(np.stack([a, b, places], axis=1))
        is_along = (_cross(side, along) == 0) & (dots(side, along) < 0)
        is_along &= (signs == 0) & (exact.twin[half] >= 0) & (crossed < 0)
        crossed[is_along] = half[is_along]
    lost, crossed = lost[crossed >= 0], crossed[crossed >= 0]
    direction[lost] = (direction[lost] + exact.turns[crossed]) % 4
    face[lost] = exact.twin[crossed] // 3
    port[lost] = port_at(lost)
    return port


@compiled
def _follow_all(
    grid: Grid, port_places: FloatArray, port_faces: IntArray, directions: IntArray, ends: IntArray
) -> None:
    """Fill in (k, 3) the entry at the end of each port's grid line, see `_follow`, its triangle and the direction."""
    parts = np.empty(12)
    for k in range(len(port_faces)):
        f, d = port_faces[k], directions[k]
        x, y = port_places[k, 0], port_places[k, 1]
        for on_left in (True, False):
            face, entry, heading = _follow(grid, f, x, y, d, on_left, parts)
            if entry != BOUNDARY:
                break
        ends[k, 0], ends[k, 1], ends[k, 2] = entry, face, heading


@compiled
def _follow(
    grid: Grid, f: int, x: float, y: float, d: int, on_left: bool, parts: FloatArray
) -> tuple[int, int, int]:
    """Return the triangle and the entry at the end of a grid line of one unit, and its direction there.

    Args:
        grid: the map and its points.
        f, x, y, d: triangle, coordinates and direction at the start.
        on_left: displace the line to its left, so that points on it count as right of it; else to its right.
        parts: (12,) buffer, see `orientation`.

    Returns:
        Triangle, entry and direction. The entry is BOUNDARY if the line leaves the surface, and LOST if it does not
        end at a grid point.
    """
    corners, twin, turns, shifts, start, places = grid
    along_x, along_y = turn(d, 1.0, 0.0)
    to_x, to_y = x + along_x, y + along_y
    for _ in range(len(corners) + 2):
        c = corners[f]
        left, on, inside = 0, 0, True  # Bit i stands for corner i.
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            inside &= orientation(c[a, 0], c[a, 1], c[b, 0], c[b, 1], to_x, to_y, parts) >= 0
            side = orientation(x, y, to_x, to_y, c[i, 0], c[i, 1], parts)
            left |= (side > 0 or (side == 0 and not on_left)) << i
            on |= (side == 0) << i
        if inside:
            entry = find_entry(start, places, f, to_x, to_y)
            return f, (entry if entry >= 0 else LOST), d
        out = -1
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            # The line leaves through the side from a corner on its right to one on its left; or, if it is along a
            # side and displaced outwards, through that side.
            upwards = (left >> b) & 1 and not (left >> a) & 1
            is_along = (on >> a) & (on >> b) & 1 and ((left >> i) & 1) != on_left
            if upwards or is_along:
                out = i
        h = 3 * f + out
        if out < 0 or twin[h] < 0:
            return f, BOUNDARY, d
        x, y = turn(turns[h], x, y)
        to_x, to_y = turn(turns[h], to_x, to_y)
        x, y = x + shifts[h, 0], y + shifts[h, 1]
        to_x, to_y = to_x + shifts[h, 0], to_y + shifts[h, 1]
        d = (d + turns[h]) % 4
        f = twin[h] // 3
    return f, LOST, d
