"""A layer of quads along the boundary of a surface, where it cuts squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse.csgraph import dijkstra

from ..base import FloatArray, IntArray, dots, plural
from ..mesh import NEXT, PREVIOUS
from .cross_field import SHARP_ANGLE
from .features import vertex_graph
from .quad_mesh import QuadMesh, opposite_sides


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
