"""A layer of quads along the boundary of a surface, where it cuts squares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.sparse.csgraph import dijkstra

from ..base import FloatArray, IntArray, dots, plural
from ..mesh import NEXT, PREVIOUS
from .cross_field import SHARP_ANGLE
from .features import vertex_graph
from .quad_mesh import QuadMesh, opposite_sides

# Vertices are on a boundary if they are nearer than this fraction of the longest edge.
TOUCHING = 1e-9
# Boundaries of up to so many edges are compared with each point.
MAX_EDGES_TO_COMPARE = 64
# Rounds of spreading points along a boundary, and the least gap at which it ends, relative to the mean gap.
MAX_SPREADING, MIN_GAP = 60, 0.3
# Points move along a boundary by at most so many mean gaps to be spread or to be at a corner: where no quads fit into a
# narrow part of the surface, they would be drawn into it.
MAX_SHIFT = 1.5
# A quad of the layer is left out if one of its points is farther from the quads than so many of their mean edges.
MAX_LAYER_WIDTH = 3.0


def with_borders(quads: QuadMesh) -> QuadMesh:
    """Return a quad mesh with a further layer of quads between each of its boundaries and that of the surface.

    Each vertex on a boundary of the quads is joined to the nearest point of the boundary of the surface. These points
    are smoothed along the boundary, and its corners are among them. There is no layer where two boundaries do not
    correspond, because quads are missing at thin parts or cover a hole. Quads of the layer that leap are left out.
    """
    mesh, count = quads.surface, len(quads.vertices)
    nearest_loop, longest_edge = _loop_finder(quads), vertex_graph(mesh).max()
    layers, faces, weights, joined_loops, missing = (
        [quads.quads], [quads.faces], [quads.barycentric], set[int](), 0,
    )  # fmt: skip
    tails, heads = quads.quads.ravel(), np.roll(quads.quads, -1, axis=1).ravel()
    is_alone = opposite_sides(quads.quads) < 0
    for walk in _walks(tails[is_alone], heads[is_alone]):
        number, loop, edge = nearest_loop(walk)
        starts = mesh.vertices[mesh.tails[loop]]
        steps = mesh.vertices[mesh.heads[loop]] - starts
        at, distances = _places_along(quads.vertices[walk], edge, starts, steps)
        is_there = distances.max() <= TOUCHING * longest_edge
        if at is None or is_there or number in joined_loops:
            missing += not is_there
            continue
        joined_loops.add(number)
        faces_on, weights_on = _on_loop(loop, at, steps)
        outer, count = count + np.arange(len(walk)), count + len(walk)
        layers.append(np.stack([np.roll(walk, -1), walk, outer, np.roll(outer, -1)], axis=1))
        faces.append(faces_on)
        weights.append(weights_on)
    on, barycentric = np.concatenate(faces), np.concatenate(weights)
    points = np.einsum("qi,qix->qx", barycentric, mesh.vertices[mesh.faces[on]])
    bordered = replace(
        quads, vertices=points, quads=np.concatenate(layers), faces=on, barycentric=barycentric
    )
    return _without_leaps(bordered, quads, is_complete=not missing)


def _without_leaps(bordered: QuadMesh, quads: QuadMesh, is_complete: bool) -> QuadMesh:
    """Return quads with a layer, without its quads that leap, and with a note.

    Args:
        bordered: the quads with the layer.
        quads: the quads without it.
        is_complete: there is a layer along each boundary.
    """
    layer = bordered.vertices[bordered.quads[len(quads.quads) :]]
    inner = bordered.vertices[quads.quads]
    edge = np.linalg.norm(inner - np.roll(inner, 1, axis=1), axis=2).mean()
    widths = np.linalg.norm(layer - layer[:, [3, 2, 1, 0]], axis=2).max(axis=1)
    is_leap = np.append(np.zeros(len(quads.quads), dtype=bool), widths > MAX_LAYER_WIDTH * edge)
    leaps = int(is_leap.sum())
    bordered = bordered.without(is_leap) if leaps else bordered
    if not is_complete:
        return bordered
    if leaps:
        share = leaps / len(layer)
        return replace(bordered, left_out=leaps, area_left_out=share * quads.area_left_out)
    note = f"A layer of quads along the boundary replaces {plural(quads.left_out, 'square')} that it cuts."
    return replace(bordered, left_out=0, area_left_out=0.0, notes=(*quads.notes, note))


def _loop_finder(quads: QuadMesh) -> Callable[[IntArray], tuple[int, IntArray, IntArray]]:
    """Return a function that finds the boundary of the surface nearest to a walk along one of the quads.

    It returns the number of the boundary, its half-edges, and the index among these of the nearest to each vertex.
    """
    mesh, loops = quads.surface, quads.surface.boundary_walks()
    loop_of, place = np.full((2, len(mesh.vertices)), -1)
    for number, loop in enumerate(loops):
        loop_of[mesh.tails[loop]], place[mesh.tails[loop]] = number, np.arange(len(loop))
    border = np.flatnonzero(mesh.is_boundary_vertex)
    away, _, source = dijkstra(vertex_graph(mesh), indices=border, return_predecessors=True, min_only=True)

    def nearest_loop(walk: IntArray) -> tuple[int, IntArray, IntArray]:
        corners = mesh.faces[quads.faces[walk]]
        ways = np.linalg.norm(mesh.vertices[corners] - quads.vertices[walk][:, None], axis=2) + away[corners]
        nearest = source[corners[np.arange(len(walk)), np.argmin(ways, axis=1)]]
        number = int(np.bincount(loop_of[nearest]).argmax())
        return number, loops[number], np.minimum(place[nearest], len(loops[number]) - 1)

    return nearest_loop


def _on_loop(loop: IntArray, at: FloatArray, steps: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return (k,) the triangles and (k, 3) the barycentric coordinates of positions along a boundary.

    Args:
        loop: (b,) its half-edges.
        at: (k,) positions, in units of length.
        steps: (b, 3) the vectors of the edges.
    """
    lengths = np.sqrt(dots(steps, steps))
    ends = np.cumsum(lengths)
    edge = np.minimum(np.searchsorted(ends, at, side="right"), len(loop) - 1)
    share = np.clip(1 - (ends[edge] - at) / lengths[edge], 0, 1)[:, None]
    side = loop[edge] % 3
    weights = (1 - share) * np.eye(3)[np.take(NEXT, side)] + share * np.eye(3)[np.take(PREVIOUS, side)]
    return loop[edge] // 3, weights


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
    at, distances = _nearest_positions(points, edge, starts, steps, lengths)
    total = lengths.sum()
    gaps = (np.roll(at, -1) - at + total / 2) % total - total / 2
    if abs(gaps.sum() - total) > total / 2:
        return None, distances
    increasing = _increasing(at[0] + np.cumsum(gaps) - gaps, total)
    reach = MAX_SHIFT * total / len(at)
    at = np.clip(_spread(increasing, total), increasing - reach, increasing + reach)
    return _moved_to_corners(at, steps, lengths) % total, distances


def _nearest_positions(
    points: FloatArray, edge: IntArray, starts: FloatArray, steps: FloatArray, lengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return (k,) the positions along a polyline nearest to points, and their distances; see `_places_along`."""
    # Along a boundary of few edges, the nearest one need not be next to the nearest vertex.
    is_long = len(steps) > MAX_EDGES_TO_COMPARE
    nearby = np.stack([edge, edge - 1]) if is_long else np.arange(len(steps))[:, None] + 0 * edge
    share = np.clip(
        dots(points - starts[nearby], steps[nearby]) / np.maximum(lengths[nearby] ** 2, 1e-300), 0, 1
    )
    off = np.linalg.norm(starts[nearby] + share[..., None] * steps[nearby] - points, axis=2)
    ends = np.cumsum(lengths)
    at = (ends[nearby] - lengths[nearby] * (1 - share))[off.argmin(axis=0), np.arange(len(points))]
    return at, off.min(axis=0)


def _increasing(at: FloatArray, total: float) -> FloatArray:
    """Return positions that do not decrease along a closed line of a total length: means of bounds from both sides."""
    several = np.concatenate([at - total, at, at + total])
    falling = np.minimum.accumulate(several[::-1])[::-1]
    return (np.maximum.accumulate(several) + falling)[len(at) : 2 * len(at)] / 2


def _spread(at: FloatArray, total: float) -> FloatArray:
    """Return positions along a closed line, smoothed until no gap is very small."""
    for _ in range(MAX_SPREADING):
        before, after = np.append(at[-1] - total, at[:-1]), np.append(at[1:], at[0] + total)
        if (after - at).min() >= MIN_GAP * total / len(at):
            break
        at = at / 2 + (before + after) / 4
    return at


def _moved_to_corners(at: FloatArray, steps: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return positions along a closed polyline, the nearest one to each of its corners moved there if it is near."""
    ends, total = np.cumsum(lengths), lengths.sum()
    reach = MAX_SHIFT * total / len(at)
    cosines = dots(steps, np.roll(steps, 1, axis=0)) / np.maximum(lengths * np.roll(lengths, 1), 1e-300)
    bends = np.flatnonzero(cosines < np.cos(SHARP_ANGLE))
    for corner in (ends - lengths)[bends[np.argsort(-cosines[bends], kind="stable")]]:  # the sharpest last
        away = (corner - at + total / 2) % total - total / 2
        nearest = np.argmin(np.abs(away))
        if abs(away[nearest]) <= reach:
            at[nearest] += away[nearest]
    return at
