"""Grid lines followed for one unit from grid point to grid point, across triangles and seams.

A line is followed just beside itself, on its left or on its right, so it never meets a vertex: exact signs tell which
two sides of a triangle it crosses, and a line along edges is no special case.
"""

from __future__ import annotations

import numpy as np

from ...base import FloatArray, IntArray, compiled, dots
from ...geometry import fill_orientations, orientation
from .exact_grid import ExactGrid, turn
from .points import AXES, GridPoints, Ports, find_entry

#: Where a port leads to no other: the boundary is in the way, or something is wrong with the map.
BOUNDARY, LOST = -1, -2


def join_ports(exact: ExactGrid, found: GridPoints, ports: Ports) -> IntArray:
    """Return (k,) the port that each leads to, BOUNDARY or LOST."""
    ends = np.empty((len(ports.faces), 3), dtype=np.int64)
    _follow_all(
        exact.corners,
        exact.twin,
        exact.turns,
        exact.shifts,
        found.start,
        found.places,
        ports.places,
        ports.faces,
        ports.directions,
        ends,
    )
    mates, face, direction = ends.T
    arrived = np.flatnonzero(mates >= 0)
    mates[arrived] = _ports_back(
        exact, found, ports, mates[arrived], face[arrived], (direction[arrived] + 2) % 4
    )
    return mates


def _ports_back(
    exact: ExactGrid, found: GridPoints, ports: Ports, entry: IntArray, face: IntArray, direction: IntArray
) -> IntArray:
    """Return (k,) the port of the point of each entry that leads into a triangle in a direction, or LOST.

    If the direction runs along the side of the triangle that is most counterclockwise, the port is the neighbour's.
    """

    def keys(points: IntArray, faces: IntArray, directions: IntArray) -> IntArray:
        return 4 * (points * len(exact.corners) + faces) + directions

    known = keys(ports.points, ports.faces, ports.directions)
    order = np.argsort(known, kind="stable")

    def port_at(which: IntArray) -> IntArray:
        wanted = keys(found.points[entry[which]], face[which], direction[which])
        at = order[np.minimum(np.searchsorted(known, wanted, sorter=order), len(order) - 1)]
        return np.where(known[at] == wanted, at, LOST)

    port = port_at(np.arange(len(entry)))
    lost = np.flatnonzero(port == LOST)
    beside = np.full(len(lost), -1)
    along, places = AXES[direction[lost]], found.places[entry[lost]]
    for i in range(3):
        a, b = exact.corners[face[lost], (i + 1) % 3], exact.corners[face[lost], (i + 2) % 3]
        side, half = b - a, 3 * face[lost] + i
        signs = np.empty(len(lost), dtype=np.int64)
        fill_orientations(np.concatenate([a, b, places], axis=1), np.empty(12), signs)
        is_along = (side[:, 0] * along[:, 1] == side[:, 1] * along[:, 0]) & (dots(side, along) < 0)
        is_along &= (signs == 0) & (exact.twin[half] >= 0) & (beside < 0)
        beside[is_along] = half[is_along]
    lost, beside = lost[beside >= 0], beside[beside >= 0]
    direction[lost] = (direction[lost] + exact.turns[beside]) % 4
    face[lost] = exact.twin[beside] // 3
    port[lost] = port_at(lost)
    return port


@compiled
def _follow_all(
    corners: FloatArray,
    twin: IntArray,
    turns: IntArray,
    shifts: FloatArray,
    start: IntArray,
    places: FloatArray,
    port_places: FloatArray,
    port_faces: IntArray,
    directions: IntArray,
    ends: IntArray,
) -> None:
    """Fill in (k, 3) the entry where each port leads to, see `_follow`, its triangle and the direction there."""
    parts = np.empty(12)
    for k in range(len(port_faces)):
        f, d = port_faces[k], directions[k]
        x, y = port_places[k, 0], port_places[k, 1]
        for on_left in (True, False):
            face, entry, heading = _follow(
                corners, twin, turns, shifts, start, places, f, x, y, d, on_left, parts
            )
            if entry != BOUNDARY:
                break
        ends[k, 0], ends[k, 1], ends[k, 2] = entry, face, heading


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
