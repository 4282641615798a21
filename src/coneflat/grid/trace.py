"""Grid lines followed for one unit from grid point to grid point, across triangles and seams.

A line is followed just beside itself, on its left or on its right, so it never meets a vertex: exact signs tell which
two sides of a triangle it crosses, and a line along edges is no special case.
"""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..compiled import compiled
from ..geometry.orientation import orientation
from .exact_grid import ExactGrid, turn
from .points import GridPoints, Ports, find_entry

#: Where a port leads to no other: the boundary is in the way, or something is wrong with the map.
BOUNDARY, LOST = -1, -2


def join_ports(exact: ExactGrid, found: GridPoints, ports: Ports) -> IntArray:
    """Return (k,) the port that each leads to, BOUNDARY or LOST."""
    mates = np.empty(len(ports.faces), dtype=np.int64)
    _join(
        exact.corners,
        exact.twin,
        exact.turns,
        exact.shifts,
        found.start,
        found.places,
        found.points,
        found.own_places,
        found.faces,
        ports.start,
        ports.faces,
        ports.directions,
        mates,
    )
    return mates


@compiled
def _join(
    corners: FloatArray,
    twin: IntArray,
    turns: IntArray,
    shifts: FloatArray,
    start: IntArray,
    places: FloatArray,
    points: IntArray,
    own_places: FloatArray,
    own_faces: IntArray,
    port_start: IntArray,
    port_faces: IntArray,
    directions: IntArray,
    mates: IntArray,
) -> None:
    parts = np.empty(12)
    for p in range(len(port_start) - 1):
        for k in range(port_start[p], port_start[p + 1]):
            f, d = port_faces[k], directions[k]
            x, y = _place_in(points, start, places, own_places, own_faces, p, f)
            face, entry, heading = _follow(
                corners, twin, turns, shifts, start, places, f, x, y, d, True, parts
            )
            if entry == BOUNDARY:
                face, entry, heading = _follow(
                    corners, twin, turns, shifts, start, places, f, x, y, d, False, parts
                )
            mates[k] = entry
            if entry >= 0:
                mates[k] = _port_back(
                    corners,
                    twin,
                    turns,
                    places[entry, 0],
                    places[entry, 1],
                    face,
                    (heading + 2) % 4,
                    port_start[points[entry]],
                    port_start[points[entry] + 1],
                    port_faces,
                    directions,
                    parts,
                )


@compiled
def _place_in(
    points: IntArray,
    start: IntArray,
    places: FloatArray,
    own_places: FloatArray,
    own_faces: IntArray,
    point: int,
    face: int,
) -> tuple[float, float]:
    """Return the coordinates of a point in a triangle that it belongs to."""
    if face == own_faces[point]:
        return own_places[point, 0], own_places[point, 1]
    entry = start[face]
    while points[entry] != point:
        entry += 1
    return places[entry, 0], places[entry, 1]


@compiled
def _follow(
    corners: FloatArray,
    twin: IntArray,
    turns: IntArray,
    shifts: FloatArray,
    start: IntArray,
    places: FloatArray,
    f: int,
    x: float,
    y: float,
    d: int,
    on_left: bool,
    parts: FloatArray,
) -> tuple[int, int, int]:
    """Return the triangle and the entry where a unit's way ends, and its direction there.

    Args:
        f, x, y, d: triangle, coordinates and direction at the start.
        on_left: follow the line just left of itself, so that what is on it lies right; or just right of it.

    Returns:
        For the entry BOUNDARY, where the way leaves the surface; LOST, where it ends at no grid point.
    """
    along_x, along_y = turn(d, 1.0, 0.0)
    to_x, to_y = x + along_x, y + along_y
    for _ in range(len(corners) + 2):
        c = corners[f]
        left, on, inside = 0, 0, True  # Bit i is that of corner i.
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
            # It leaves through the side from a corner on its right to one on its left; or, if it runs along a side
            # and just outside of it, through that.
            upwards = (left >> b) & 1 and not (left >> a) & 1
            beside = (on >> a) & (on >> b) & 1 and ((left >> i) & 1) != on_left
            if upwards or beside:
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


@compiled
def _port_back(
    corners: FloatArray,
    twin: IntArray,
    turns: IntArray,
    x: float,
    y: float,
    face: int,
    d: int,
    first: int,
    last: int,
    port_faces: IntArray,
    directions: IntArray,
    parts: FloatArray,
) -> int:
    """Return the port of a point, among those from first to last, that leads into a triangle in a direction.

    If the direction runs along the side of the triangle that is most counterclockwise, the port is the neighbour's.
    """
    for _ in range(2):
        for k in range(first, last):
            if port_faces[k] == face and directions[k] == d:
                return k
        along_x, along_y = turn(d, 1.0, 0.0)
        for i in range(3):
            a, b = corners[face, (i + 1) % 3], corners[face, (i + 2) % 3]
            side_x, side_y = b[0] - a[0], b[1] - a[1]
            if side_x * along_y - side_y * along_x != 0 or side_x * along_x + side_y * along_y >= 0:
                continue
            if orientation(a[0], a[1], b[0], b[1], x, y, parts) == 0 and twin[3 * face + i] >= 0:
                d = (d + turns[3 * face + i]) % 4
                face = twin[3 * face + i] // 3
                break
    return LOST
