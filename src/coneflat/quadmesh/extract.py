"""Extraction of a quad mesh from an integer-grid map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import FloatArray, IntArray, Unmet, dots, list_some, plural
from ..errors import GridError
from ..geometry import signed_double_areas
from ..mesh import label_components
from .grid_coordinates import ExactGrid, exact_grid
from .grid_points import LOST, GridPoints, Ports, find_points, find_ports, join_ports
from .integer_map import IntegerGrid
from .limits import check_extraction
from .quad_mesh import QuadMesh, corner_fans, degenerate_quads

# Squares: difference of the area of a grid and the number of its quads that rounding explains.
AREA_TOLERANCE = 1e-3


@dataclass(frozen=True)
class DegenerateQuads:
    """Why quads are not a mesh: some have a vertex twice, or a side with the vertices of another edge.

    Attributes:
        reason: how many, and which.
    """

    reason: str


def extract_quads(grid: IntegerGrid) -> QuadMesh:
    """Return the quad mesh whose edges are the grid lines of an integer-grid map.

    Raises:
        GridError: the map is not an integer-grid map, is so coarse that a quad is degenerate, or has too many squares
            or crossings.
        TooLargeError: there is not enough memory.

    See Also:
        find_quads: the method; it returns a reason for degenerate quads.
    """
    quads = find_quads(grid)
    if isinstance(quads, DegenerateQuads):
        raise GridError(quads.reason)
    return quads


def find_quads(grid: IntegerGrid, leave_out: bool = False) -> QuadMesh | DegenerateQuads:
    """Return the quad mesh whose edges are the grid lines of an integer-grid map, or why these quads are not a mesh.

    Args:
        grid: the map.
        leave_out: leave out degenerate quads, unless all are.

    Raises:
        GridError: the map is not an integer-grid map, or has too many squares or crossings.
        TooLargeError: there is not enough memory.

    Notes:
        The vertices are the grid points on the surface. From each, grid lines leave in as many directions as its angle
        has quarter turns. They are traced for one unit, across triangles and seams, to the next grid points. A path
        that turns left at each point closes after four sides, which bound a quad. All decisions use exact predicates.
        Squares that the boundary cuts are left out and counted. The result is manifold: quads that touch in a single
        point get separate vertices there.

    References:
        H.-C. Ebke, D. Bommes, M. Campen, L. Kobbelt, "QEx: robust quad mesh extraction", 2013.
    """
    check_extraction(grid.corner_grid)
    exact = exact_grid(grid)
    points = find_points(exact)
    ports = find_ports(exact, points)
    mates = join_ports(exact, points, ports)
    _require_pairs(mates, ports)
    darts, left_out = _close(_turn_left(mates, ports), ports)
    area = float(signed_double_areas(exact.corners).sum()) / 2
    _require_all_squares(exact, area, len(darts), left_out)
    origin, quads, edges = _split_fans(darts, mates, ports.points)
    notes: tuple[str, ...] = ()
    while (bad := degenerate_quads(quads, edges)).any():
        text = f"{plural(int(bad.sum()), 'degenerate quad')} of {len(quads):,}"
        if not leave_out or bad.all():
            return DegenerateQuads(f"{text} ({list_some(np.flatnonzero(bad))}): use more quads")
        darts, notes = darts[~bad], (*notes, Unmet(f"Left out {text}: the surface is too thin there."))
        origin, quads, edges = _split_fans(darts, mates, ports.points)
    barycentric = _barycentric(exact, points, origin)
    corners = exact.mesh.vertices[exact.mesh.faces[points.faces[origin]]]
    return QuadMesh(
        vertices=np.einsum("qi,qix->qx", barycentric, corners),
        quads=quads,
        faces=points.faces[origin],
        barycentric=barycentric,
        left_out=left_out,
        area_left_out=area - len(darts),
        surface=exact.mesh,
        notes=notes,
    )


def _require_all_squares(exact: ExactGrid, area: float, count: int, left_out: int) -> None:
    """Raise GridError if there are no quads, or if some are missing on a surface without boundary.

    Args:
        exact: the map.
        area: its area in squares.
        count: number of quads.
        left_out: number of squares that do not close.
    """
    is_closed = not exact.mesh.is_boundary_edge.any()
    if is_closed and (left_out or abs(area - count) > AREA_TOLERANCE):
        raise GridError(f"{count:,} quads cover a grid of {area:.3f} squares: some are missing")
    if not count:
        raise GridError(
            f"no complete square of the grid lies on the surface, of {area:.1f} squares: use more quads, or a smaller "
            "size"
        )


def _require_pairs(mates: IntArray, ports: Ports) -> None:
    """Raise GridError unless each port leads to another port, which leads back, or to the boundary."""
    leads = mates >= 0
    bad = np.flatnonzero((mates == LOST) | (leads & (mates[mates] != np.arange(len(mates)))))
    if len(bad):
        raise GridError(
            f"{plural(len(bad), 'grid line')} of {len(mates):,} that ends at no grid point or does not lead back, in "
            f"faces {list_some(np.unique(ports.faces[bad]))}"
        )


def _turn_left(mates: IntArray, ports: Ports) -> IntArray:
    """Return (k,) the next port along the quad to the left of each port, clockwise of its mate; -1 for none."""
    clockwise = np.arange(len(mates)) - 1
    first, count = ports.start[:-1], np.diff(ports.start)
    has_ports = count > 0
    clockwise[first[has_ports]] = np.where(ports.is_boundary[has_ports], -1, (first + count - 1)[has_ports])
    return np.where(mates >= 0, clockwise[mates], -1)


def _close(following: IntArray, ports: Ports) -> tuple[IntArray, int]:
    """Return (p, 4) the ports along the sides of each quad, and the number of squares that do not close."""
    steps = [np.arange(len(following))]
    for _ in range(4):
        steps.append(np.where(steps[-1] >= 0, following[steps[-1]], -1))
    around = np.stack(steps[:4], axis=1)
    closes = (steps[4] == steps[0]) & (around >= 0).all(axis=1)
    darts = around[closes & (around.min(axis=1) == steps[0])]
    # There is a quarter turn between each port and its counterclockwise neighbour; the last on the boundary has none.
    is_corner = ~closes
    last = ports.start[1:][ports.is_boundary & (np.diff(ports.start) > 0)] - 1
    is_corner[last] = False
    joined = np.flatnonzero(is_corner & (following >= 0))
    joined = joined[is_corner[following[joined]]]
    labels = label_components(len(following), joined, following[joined])[1]
    return darts, len(np.unique(labels[is_corner]))


def _split_fans(darts: IntArray, mates: IntArray, points: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return (q,) the grid point of each vertex, (p, 4) the vertices of quads, and (p, 4) the edges of their sides.

    There is one vertex for each fan of quads around a point. Vertices are in the order of points.
    """
    corner = np.arange(darts.size)
    corner_of = np.full(len(points), -1, dtype=np.int64)
    corner_of[darts.ravel()] = corner
    # The quad on the other side of the edge has the mate of the port.
    opposite = corner_of[mates[darts.ravel()]]
    count, fan = corner_fans(opposite)
    point_of = np.empty(count, dtype=np.int64)
    point_of[fan] = points[darts.ravel()]
    rank = np.argsort(point_of, kind="stable")
    edge = np.where(opposite >= 0, np.minimum(corner, opposite), corner)
    return point_of[rank], np.argsort(rank)[fan].reshape(-1, 4), edge.reshape(-1, 4)


def _barycentric(exact: ExactGrid, grid_points: GridPoints, points: IntArray) -> FloatArray:
    """Return (q, 3) barycentric coordinates of grid points in their triangles, not rounded on sides."""
    corners = exact.corners[grid_points.faces[points]]
    offset = corners - grid_points.own_places[points][:, None]
    following, preceding = offset[:, [1, 2, 0]], offset[:, [2, 0, 1]]
    areas = following[..., 0] * preceding[..., 1] - following[..., 1] * preceding[..., 0]
    side = grid_points.sides[points]
    for i in range(3):
        areas[side == i, i] = 0.0
        areas[side == 3 + i] = np.eye(3)[i]
    areas = np.maximum(areas, 0.0)
    total = areas.sum(axis=1)
    # A triangle may be so thin that it has no area in double precision.
    thin = np.flatnonzero(~(total > 0))
    areas[thin], total[thin] = _along_longest_side(offset[thin]), 1.0
    return areas / total[:, None]


def _along_longest_side(corners: FloatArray) -> FloatArray:
    """Return (k, 3) barycentric coordinates of the point on the longest side of triangles nearest to the origin.

    corners: (k, 3, 2) corners of the triangles.
    """
    sides = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    longest, row = dots(sides, sides).argmax(axis=1), np.arange(len(corners))
    along, start = sides[row, longest], corners[row, (longest + 1) % 3]
    share = np.clip(-dots(start, along) / np.maximum(dots(along, along), np.finfo(float).tiny), 0, 1)
    weights = np.zeros((len(corners), 3))
    weights[row, (longest + 1) % 3], weights[row, (longest + 2) % 3] = 1 - share, share
    return weights
