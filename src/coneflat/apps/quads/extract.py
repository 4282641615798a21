"""Extraction of a quad mesh from an integer-grid map.

H.-C. Ebke, D. Bommes, M. Campen, L. Kobbelt, "QEx: robust quad mesh extraction", 2013.
"""

from __future__ import annotations

import numpy as np

from ...base import FloatArray, IntArray, list_some, plural
from ...errors import GridError
from ...geometry import signed_double_areas
from ...mesh import label_components
from .exact_grid import ExactGrid, exact_grid
from .grid_points import LOST, GridPoints, Ports, find_points, find_ports, join_ports
from .integer_map import IntegerGrid
from .quad_mesh import CoarseGridError, QuadMesh, degenerate_quads

# Largest number of squares; at about a kilobyte of peak memory for each, many machines have enough.
MAX_SQUARES = 20_000_000


def extract_quads(grid: IntegerGrid, leave_out: bool = False) -> QuadMesh:
    """Return the quad mesh whose edges are the grid lines of an integer-grid map.

    The vertices are the grid points on the surface. From each, grid lines leave in as many directions as its angle has
    quarter turns. They are traced for one unit, across triangles and seams, to the next grid points. A path that turns
    left at each point closes after four sides, which bound a quad. All decisions use exact predicates.

    Squares that the boundary cuts are left out and counted. The result is manifold: quads that touch in a single point
    get separate vertices there.

    Args:
        grid: the map.
        leave_out: leave out quads with the same vertex or edge twice, instead of raising an error.

    Raises:
        GridError: the map is not an integer-grid map, is so coarse that a quad has the same vertex or edge twice, or
            has too many squares.

    References:
        H.-C. Ebke, D. Bommes, M. Campen, L. Kobbelt, "QEx: robust quad mesh extraction", 2013.
    """
    area = float(signed_double_areas(grid.corner_grid).sum()) / 2
    if area > MAX_SQUARES:
        raise GridError(
            f"a grid of {area:,.0f} squares is too fine: at most {MAX_SQUARES:,} quads can be extracted"
        )
    exact = exact_grid(grid)
    found = find_points(exact)
    ports = find_ports(exact, found)
    mates = join_ports(exact, found, ports)
    _require_pairs(mates, ports)
    following = _turn_left(mates, ports)
    darts, left_out = _close(following, ports)
    is_closed = not exact.mesh.is_boundary_edge.any()
    if is_closed and left_out:
        raise GridError(f"{plural(left_out, 'square')} of the grid with other than four sides")
    area = float(signed_double_areas(exact.corners).sum()) / 2
    # The tolerance covers rounding of the sum over all triangles.
    if is_closed and abs(area - len(darts)) > 1e-3:
        raise GridError(f"{len(darts):,} quads cover a grid of {area:.3f} squares: some are missing")
    if not len(darts):
        raise GridError(
            f"no complete square of the grid lies on the surface, of {area:.1f} squares: use more quads"
        )
    origin, quads, edges = _split_fans(darts, mates, ports.points)
    notes: tuple[str, ...] = ()
    while (bad := degenerate_quads(quads, edges)).any():
        text = f"{plural(int(bad.sum()), 'quad')} of {len(quads):,} with a vertex or an edge twice"
        if not leave_out or bad.all():
            raise CoarseGridError(f"{text} ({list_some(np.flatnonzero(bad))}): use more quads")
        darts, notes = darts[~bad], (*notes, f"Left out {text}: the surface is too thin there.")
        origin, quads, edges = _split_fans(darts, mates, ports.points)
    barycentric = _barycentric(exact, found, origin)
    corners = exact.mesh.vertices[exact.mesh.faces[found.faces[origin]]]
    return QuadMesh(
        np.einsum("qi,qix->qx", barycentric, corners),
        quads,
        found.faces[origin],
        barycentric,
        left_out,
        area - len(darts),
        exact.mesh,
        notes,
    )


def _require_pairs(mates: IntArray, ports: Ports) -> None:
    """Raise GridError unless each port leads to another port, which leads back, or to the boundary."""
    points = ports.points
    lost = np.flatnonzero(mates == LOST)
    if len(lost):
        raise GridError(
            f"{plural(len(lost), 'grid line')} of {len(mates):,} that ends at no grid point, in faces "
            f"{list_some(np.unique(ports.faces[lost]))}"
        )
    leads = np.flatnonzero(mates >= 0)
    bad = leads[mates[mates[leads]] != leads]
    if len(bad):
        raise GridError(
            f"{plural(len(bad), 'grid line')} of {len(mates):,} that does not lead back, from points "
            f"{list_some(np.unique(points[bad]))}"
        )


def _turn_left(mates: IntArray, ports: Ports) -> IntArray:
    """Return (k,) the next port along the quad to the left of each port, clockwise of its mate; -1 for none."""
    clockwise = np.arange(len(mates)) - 1
    first, count = ports.start[:-1], np.diff(ports.start)
    some = count > 0
    clockwise[first[some]] = np.where(ports.is_boundary[some], -1, (first + count - 1)[some])
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
    after = np.roll(corner.reshape(-1, 4), -1, axis=1).ravel()
    corner_of = np.full(len(points), -1, dtype=np.int64)
    corner_of[darts.ravel()] = corner
    # The quad on the other side of the edge has the mate of the port.
    other = corner_of[mates[darts.ravel()]]
    shared = np.flatnonzero(other >= 0)
    one, two = shared, other[shared]
    ends = np.concatenate([one, after[one]]), np.concatenate([after[two], two])
    count, fan = label_components(darts.size, *ends)
    point_of = np.empty(count, dtype=np.int64)
    point_of[fan] = points[darts.ravel()]
    rank = np.argsort(point_of, kind="stable")
    number = np.empty(count, dtype=np.int64)
    number[rank] = np.arange(count)
    edge = np.where(other >= 0, np.minimum(corner, other), corner)
    return point_of[rank], number[fan].reshape(-1, 4), edge.reshape(-1, 4)


def _barycentric(exact: ExactGrid, found: GridPoints, points: IntArray) -> FloatArray:
    """Return (q, 3) barycentric coordinates of grid points in their triangles, exact on sides and at corners."""
    corners = exact.corners[found.faces[points]]
    offset = corners - found.own_places[points][:, None]
    one, two = offset[:, [1, 2, 0]], offset[:, [2, 0, 1]]
    areas = one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]
    side = found.sides[points]
    for i in range(3):
        areas[side == i, i] = 0.0
        areas[side == 3 + i] = np.eye(3)[i]
    areas = np.maximum(areas, 0.0)
    return areas / areas.sum(axis=1, keepdims=True)
