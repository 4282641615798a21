"""Tips of seams, moved to where the seams are shortest for a bound of the energy.

A tip is a vertex inside the mesh at which a seam ends. As at the tip of a crack, the energy falls where a seam gets
longer. At the shortest seams, the decrease per length is the same at all tips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import BoolArray, FloatArray, IntArray, mask_of
from ..geometry import triangle_energies
from ..mesh.connectivity import TriangleMesh
from ..stages import Layout
from .free_seams import freed, recut

# Lengths relative to the square root of the area: of the extension that measures the decrease of the energy; over which
# the decrease per length falls to 1 / e; and the largest move of a tip.
PROBE, DECAY, MAX_MOVE = 0.02, 0.015, 0.2
# Rings of triangles around an extension that move when its effect is measured.
RINGS = 6


@dataclass(frozen=True, eq=False)
class Tips:
    """The t tips of the seams of a layout.

    Attributes:
        vertices: (t,) the vertices.
        behind: the edges of each tip's seam, from the tip to the next node.
        ahead: the edges that continue it straight ahead.
        rates: (t,) decrease of the energy per cost of a longer seam.
    """

    vertices: IntArray
    behind: list[IntArray]
    ahead: list[IntArray]
    rates: FloatArray


def find_tips(layout: Layout, seams: IntArray, costs: FloatArray) -> Tips:
    """Return the tips of the seams (k,) of a layout, for (e,) costs of cutting the edges."""
    mesh, size = layout.mesh, np.sqrt(layout.area)
    is_seam = mask_of(len(mesh.edges), seams)
    degree = np.bincount(mesh.edges[seams].ravel(), minlength=len(mesh.vertices))
    vertices = np.flatnonzero((degree == 1) & ~mesh.is_boundary_vertex)
    inside = ~mesh.is_boundary_vertex
    behind = [_walk(mesh, tip, None, np.inf, is_seam, (degree == 2) & inside) for tip in vertices.tolist()]
    limits = MAX_MOVE * size, np.isfinite(costs), (degree == 0) & inside
    ahead = [_walk(mesh, tip, path[0], *limits) for tip, path in zip(vertices.tolist(), behind, strict=True)]
    probes = [path[: _steps(mesh, path, PROBE * size)] for path in ahead]
    gains = _gains(layout, seams, probes)
    length = np.array([max(costs[path].sum(), 1e-300) for path in probes])
    # The mean over the extension is less than the value at the tip.
    rates = np.where(gains > 0, gains / length * np.exp(length / (2 * DECAY * size)), 0.0)
    return Tips(vertices, behind, ahead, rates)


def moves_for(layout: Layout, tips: Tips, slack: float) -> FloatArray:
    """Return (t,) the lengths by which seams become shorter at their tips, so that the energy rises by a slack.

    Along a seam, rates are modelled as an exponential function of the length; the rates of all tips become equal.

    Args:
        layout: the layout.
        tips: its tips.
        slack: how much the energy may rise; if it is negative, how much it has to fall.
    """
    is_known = tips.rates > 0
    rates, size = tips.rates[is_known], float(np.sqrt(layout.area))
    change = slack / (DECAY * size * rates.sum())
    moves = np.zeros(len(tips.rates))
    moves[is_known] = DECAY * ((np.log1p(change) if change > 0 else change) + np.log(rates.mean() / rates))
    return np.clip(moves, -MAX_MOVE, MAX_MOVE) * size


def moved_tips(layout: Layout, seams: IntArray, tips: Tips, moves: FloatArray) -> tuple[IntArray, IntArray]:
    """Return (k,) the seams and (s,) the cones of a layout after its tips are moved.

    Args:
        layout: the layout.
        seams: (k,) its seams.
        tips: their tips.
        moves: (t,) the lengths by which seams become shorter.
    """
    mesh = layout.mesh
    closed, opened, ends = [seams[:0]], [seams], dict[int, int]()
    tip_paths = zip(tips.vertices.tolist(), tips.behind, tips.ahead, moves.tolist(), strict=True)
    for tip, behind, ahead, move in tip_paths:
        path = behind if move > 0 else ahead
        steps = path[: _steps(mesh, path, abs(move))]
        (closed if move > 0 else opened).append(steps)
        # A seam that is closed as a whole needs no cone.
        ends[tip] = -1 if move > 0 and len(steps) == len(behind) else _end(mesh, tip, steps)
    cones = np.array([ends.get(cone, cone) for cone in layout.cones.tolist()], dtype=np.int64)
    seams = np.setdiff1d(np.concatenate(opened), np.concatenate(closed))
    return seams, np.intersect1d(cones, mesh.edges[seams])


def _walk(
    mesh: TriangleMesh, tip: int, before: int | None, size: float, is_allowed: BoolArray, passes: BoolArray
) -> IntArray:
    """Return the edges of the straightest path from a vertex, up to a length.

    Args:
        mesh: the mesh.
        tip: the first vertex.
        before: an edge at it that the path continues; None for any direction.
        size: the length.
        is_allowed: (e,) the edges of the path.
        passes: (n,) vertices at which the path does not end. With a direction, all its vertices are among them.
    """
    path, vertex, length, points = list[int](), tip, 0.0, mesh.vertices
    starts, edges = mesh.incident_edges
    ahead = None if before is None else _unit(2 * points[tip] - points[mesh.edges[before]].sum(axis=0))
    while length < size and (vertex == tip or passes[vertex]):
        around = edges[starts[vertex] : starts[vertex + 1]]
        neighbours = mesh.edges[around].sum(axis=1) - vertex
        chosen = is_allowed[around] & (~np.isin(around, path[-1:]))
        if ahead is not None:
            chosen &= passes[neighbours]
        around, neighbours = around[chosen], neighbours[chosen]
        if not len(around):
            break
        steps = points[neighbours] - points[vertex]
        sizes = np.maximum(np.sqrt((steps**2).sum(axis=1)), np.finfo(float).tiny)
        best = 0
        if ahead is not None:
            straight = steps @ ahead / sizes
            best = int(straight.argmax())
            if straight[best] <= 0:
                break
            ahead = _unit(ahead + steps[best] / sizes[best])
        path.append(int(around[best]))
        length += sizes[best]
        vertex = int(neighbours[best])
    return np.array(path, dtype=np.int64)


def _unit(vector: FloatArray) -> FloatArray:
    return vector / max(float(np.linalg.norm(vector)), np.finfo(float).tiny)


def _steps(mesh: TriangleMesh, path: IntArray, size: float) -> int:
    """Return the number of edges at the start of a path whose length is nearest to a given one."""
    ends = mesh.vertices[mesh.edges[path]]
    lengths = np.cumsum(np.sqrt(((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1)))
    return int(np.argmin(np.abs(np.concatenate([[0.0], lengths]) - size)))


def _end(mesh: TriangleMesh, start: int, path: IntArray) -> int:
    for edge in path.tolist():
        start = int(mesh.edges[edge].sum() - start)
    return start


def _gains(layout: Layout, seams: IntArray, paths: list[IntArray]) -> FloatArray:
    """Return for each path how much the energy falls if it is cut and only the triangles around it move."""
    mesh, path_of = layout.mesh, np.full(len(layout.mesh.vertices), -1)
    for i, path in enumerate(paths):
        path_of[mesh.edges[path]] = i
    for _ in range(RINGS):
        previous = path_of.copy()
        for tail, head in (mesh.edges.T, mesh.edges[:, ::-1].T):
            reached = (path_of[head] < 0) & (previous[tail] >= 0)
            path_of[head[reached]] = previous[tail[reached]]
    longer = recut(layout, np.concatenate([seams, *paths]))
    is_near = np.zeros(len(longer.points), dtype=bool)
    is_near[longer.corners] = path_of[mesh.faces] >= 0
    moved, _ = freed(longer, is_near)
    before, after = (triangle_energies(tail.lengths, tail.points[tail.corners]) for tail in (layout, moved))
    change = (before - after) / layout.area
    nearest = path_of[mesh.faces].max(axis=1)
    return np.bincount(nearest[nearest >= 0], change[nearest >= 0], len(paths)).astype(np.float64)
