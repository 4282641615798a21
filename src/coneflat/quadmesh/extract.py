"""Extraction of a quad mesh from an integer-grid map, and a layer of quads where the boundary cuts squares.

H.-C. Ebke, D. Bommes, M. Campen, L. Kobbelt, "QEx: robust quad mesh extraction", 2013.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse.csgraph import dijkstra

from ..base import FloatArray, IntArray, Unmet, dots, list_some, plural
from ..errors import GridError
from ..geometry import signed_double_areas
from ..mesh import NEXT, PREVIOUS, label_components
from .cross_field import SHARP_ANGLE
from .features import vertex_graph
from .grid_coordinates import ExactGrid, exact_grid
from .grid_points import LOST, GridPoints, Ports, find_points, find_ports, join_ports
from .integer_map import IntegerGrid
from .limits import check_extraction
from .quad_mesh import CoarseGridError, QuadMesh, corner_fans, degenerate_quads, opposite_sides


def extract_quads(grid: IntegerGrid, leave_out: bool = False) -> QuadMesh:
    """Return the quad mesh whose edges are the grid lines of an integer-grid map.

    The vertices are the grid points on the surface. From each, grid lines leave in as many directions as its angle has
    quarter turns. They are traced for one unit, across triangles and seams, to the next grid points. A path that turns
    left at each point closes after four sides, which bound a quad. All decisions use exact predicates.

    Squares that the boundary cuts are left out and counted. The result is manifold: quads that touch in a single point
    get separate vertices there.

    Args:
        grid: the map.
        leave_out: leave out degenerate quads, instead of raising an error.

    Raises:
        GridError: the map is not an integer-grid map, is so coarse that a quad is degenerate, or
            has too many squares or crossings.
        TooLargeError: there is not enough memory.
    """
    check_extraction(grid.corner_grid)
    exact = exact_grid(grid)
    points = find_points(exact)
    ports = find_ports(exact, points)
    mates = join_ports(exact, points, ports)
    _require_pairs(mates, ports)
    following = _turn_left(mates, ports)
    darts, left_out = _close(following, ports)
    area = float(signed_double_areas(exact.corners).sum()) / 2
    # The tolerance covers rounding of the sum over all triangles.
    if not exact.mesh.is_boundary_edge.any() and (left_out or abs(area - len(darts)) > 1e-3):
        raise GridError(f"{len(darts):,} quads cover a grid of {area:.3f} squares: some are missing")
    if not len(darts):
        raise GridError(
            f"no complete square of the grid lies on the surface, of {area:.1f} squares: use more quads, or a smaller "
            "size"
        )
    origin, quads, edges = _split_fans(darts, mates, ports.points)
    notes: tuple[str, ...] = ()
    while (bad := degenerate_quads(quads, edges)).any():
        text = f"{plural(int(bad.sum()), 'degenerate quad')} of {len(quads):,}"
        if not leave_out or bad.all():
            raise CoarseGridError(f"{text} ({list_some(np.flatnonzero(bad))}): use more quads", grid)
        darts, notes = darts[~bad], (*notes, Unmet(f"Left out {text}: the surface is too thin there."))
        origin, quads, edges = _split_fans(darts, mates, ports.points)
    barycentric = _barycentric(exact, points, origin)
    corners = exact.mesh.vertices[exact.mesh.faces[points.faces[origin]]]
    return QuadMesh(
        np.einsum("qi,qix->qx", barycentric, corners),
        quads,
        points.faces[origin],
        barycentric,
        left_out,
        area - len(darts),
        exact.mesh,
        notes,
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


def with_borders(quads: QuadMesh) -> QuadMesh:
    """Return a quad mesh with a further layer of quads between each of its boundaries and that of the surface.

    Each vertex on a boundary of the quads is joined to the nearest point of the boundary of the surface. These points
    are smoothed along the boundary, and its corners are among them. There is no layer where two boundaries do not
    correspond, because quads are missing at thin parts or cover a hole.
    """
    mesh, count = quads.surface, len(quads.vertices)
    loops = mesh.boundary_walks()
    loop_of, place = np.full((2, len(mesh.vertices)), -1)
    for number, loop in enumerate(loops):
        loop_of[mesh.tails[loop]], place[mesh.tails[loop]] = number, np.arange(len(loop))
    graph, border = vertex_graph(mesh), np.flatnonzero(mesh.is_boundary_vertex)
    away, _, source = dijkstra(graph, indices=border, return_predecessors=True, min_only=True)
    tails, heads = quads.quads.ravel(), np.roll(quads.quads, -1, axis=1).ravel()
    alone = opposite_sides(quads.quads) < 0
    layers, faces, weights, taken, missing = [quads.quads], [quads.faces], [quads.barycentric], [-1], 0
    for walk in _walks(tails[alone], heads[alone]):
        points, corners = quads.vertices[walk], mesh.faces[quads.faces[walk]]
        ways = np.linalg.norm(mesh.vertices[corners] - points[:, None], axis=2) + away[corners]
        nearest = source[corners[np.arange(len(walk)), np.argmin(ways, axis=1)]]
        loop = loops[number := int(np.bincount(loop_of[nearest]).argmax())]
        starts = mesh.vertices[mesh.tails[loop]]
        steps = mesh.vertices[mesh.heads[loop]] - starts
        at, off = _places_along(points, np.minimum(place[nearest], len(loop) - 1), starts, steps)
        is_there = off.max() <= 1e-9 * graph.max()
        if at is None or is_there or number in taken:
            missing += not is_there
            continue
        taken.append(number)
        ends = np.cumsum(np.sqrt(dots(steps, steps)))
        edge = np.minimum(np.searchsorted(ends, at, side="right"), len(loop) - 1)
        share = np.clip(1 - (ends[edge] - at) / np.sqrt(dots(steps, steps))[edge], 0, 1)[:, None]
        side = loop[edge] % 3
        outer, count = count + np.arange(len(walk)), count + len(walk)
        layers.append(np.stack([np.roll(walk, -1), walk, outer, np.roll(outer, -1)], axis=1))
        faces.append(loop[edge] // 3)
        weights.append(
            (1 - share) * np.eye(3)[np.take(NEXT, side)] + share * np.eye(3)[np.take(PREVIOUS, side)]
        )
    on, barycentric = np.concatenate(faces), np.concatenate(weights)
    points = np.einsum("qi,qix->qx", barycentric, mesh.vertices[mesh.faces[on]])
    bordered = replace(
        quads, vertices=points, quads=np.concatenate(layers), faces=on, barycentric=barycentric
    )
    if missing:
        return bordered
    note = f"A layer of quads along the boundary replaces {plural(quads.left_out, 'square')} that it cuts."
    return replace(bordered, left_out=0, area_left_out=0.0, notes=(*quads.notes, note))


def _walks(tails: IntArray, heads: IntArray) -> list[IntArray]:
    """Return the closed walks along directed edges, of which one leaves each vertex, as their vertices."""
    following, walks = dict(zip(tails.tolist(), heads.tolist(), strict=True)), []
    while following:
        walk = [next(iter(following))]
        while (vertex := following.pop(walk[-1], None)) is not None:
            walk.append(vertex)
        walks.append(np.array(walk[:-1], dtype=np.int64))
    return walks


def _places_along(
    points: FloatArray, edge: IntArray, starts: FloatArray, steps: FloatArray
) -> tuple[FloatArray | None, FloatArray]:
    """Return (k,) positions along a closed polyline, and the distances of points (k, 3) from it.

    Args:
        points: the points, around the polyline.
        edge: (k,) the edge of the polyline at whose start it is nearest to each point.
        starts, steps: (b, 3) starts and vectors of the edges.

    Returns:
        Positions that increase, at least one at each corner; None if the points do not run once around. Distances.
    """
    lengths = np.sqrt(dots(steps, steps))
    # Along a boundary of few edges, the nearest one need not be next to the nearest vertex.
    nearby = np.stack([edge, edge - 1]) if len(steps) > 64 else np.arange(len(steps))[:, None] + 0 * edge
    share = np.clip(
        dots(points - starts[nearby], steps[nearby]) / np.maximum(lengths[nearby] ** 2, 1e-300), 0, 1
    )
    off = np.linalg.norm(starts[nearby] + share[..., None] * steps[nearby] - points, axis=2)
    ends, total = np.cumsum(lengths), lengths.sum()
    at = (ends[nearby] - lengths[nearby] * (1 - share))[off.argmin(axis=0), np.arange(len(points))]
    gaps = (np.roll(at, -1) - at + total / 2) % total - total / 2
    if abs(gaps.sum() - total) > total / 2:
        return None, off.min(axis=0)
    at = at[0] + np.cumsum(gaps) - gaps
    several = np.concatenate([at - total, at, at + total])
    falling = np.minimum.accumulate(several[::-1])[::-1]
    at = (np.maximum.accumulate(several) + falling)[len(at) : 2 * len(at)] / 2
    for _ in range(60):  # smoothed until no gap is very small
        before, after = np.append(at[-1] - total, at[:-1]), np.append(at[1:], at[0] + total)
        if (after - at).min() >= 0.3 * total / len(at):
            break
        at = at / 2 + (before + after) / 4
    cosines = dots(steps, np.roll(steps, 1, axis=0)) / np.maximum(lengths * np.roll(lengths, 1), 1e-300)
    bends = np.flatnonzero(cosines < np.cos(SHARP_ANGLE))
    for corner in (ends - lengths)[bends[np.argsort(-cosines[bends], kind="stable")]]:  # the sharpest last
        away = (corner - at + total / 2) % total - total / 2
        at[np.argmin(np.abs(away))] += away[np.argmin(np.abs(away))]
    return at % total, off.min(axis=0)
