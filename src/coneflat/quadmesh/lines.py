"""Layouts cut along sharp edges, whose chains become sides, as those of the boundary are.

The grid has an integer for the common coordinate of each side, and relaxing moves its points there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.csgraph import dijkstra

from ..base import BoolArray, ComplexArray, FloatArray, IntArray, mask_of
from ..geometry import map_factors, signed_angles
from ..mesh import NEXT, PREVIOUS, open_along, point_seams, point_vertices
from .features import lengths_along, without_stubs
from .grid_layout import GridLayout, Sides, at_origin, find_sides, joined_charts

# Squares: shorter chains of sharp edges are not put on lines.
SHORTEST = 4.0
# The energy of a triangle that is flipped or nearly so.
FOLDED_ENERGY = 10.0


def deviations(layout: GridLayout) -> FloatArray:
    """Return (e,) the angle of each edge from the nearest axis."""
    halfedge, (starts, ends) = layout.mesh.edge_halfedges[:, 0], layout.ends
    return np.asarray(np.angle((layout.points[ends[halfedge]] - layout.points[starts[halfedge]]) ** 4) / 4)


def long_chains(layout: GridLayout, edges: IntArray) -> IntArray:
    """Return the edges (k,) of a layout that are in chains long enough for grid lines."""
    return edges[without_stubs(layout.mesh, edges, SHORTEST * layout.size)]


@dataclass(frozen=True, eq=False)
class LinedLayout:
    """A layout cut along edges, which are sides: (k,) these edges of its mesh, and (k,) the chain of each."""

    layout: GridLayout
    edges: IntArray
    chain: IntArray

    def costs(self, before: GridLayout, moved: ComplexArray) -> tuple[FloatArray, bool]:
        """Return (c,) the energy of triangles near each chain over its length, and whether any triangle is flipped.

        Args:
            before: the layout that is not cut.
            moved: (u,) where the points move.
        """
        mesh, chains = before.mesh, int(self.chain.max()) + 1
        derivative, conjugate_derivative = map_factors(
            (places := before.points[before.corners])[:, PREVIOUS] - places[:, NEXT]
        )
        after = moved[self.layout.corners]
        after = after - after[:, :1]
        a, b = (np.abs((factor * after).sum(axis=1)) ** 2 for factor in (derivative, conjugate_derivative))
        # The mean of the quasi-conformal distortion and its inverse, minus 1.
        is_folded = b >= 0.95 * a
        excess = np.where(is_folded, FOLDED_ENERGY, 2 * b / np.where(is_folded, 1.0, a - b))
        energy = before.double_areas() / 2 * np.minimum(excess, FOLDED_ENERGY)
        at = np.zeros(len(mesh.vertices), dtype=np.int64)
        at[mesh.edges[self.edges]] = self.chain[:, None]
        vertices_on = np.unique(mesh.edges[self.edges])
        nearest = dijkstra(before.graph(), indices=vertices_on, min_only=True, return_predecessors=True)[2]
        near_faces = np.flatnonzero(nearest[mesh.faces[:, 0]] >= 0)
        chain = at[nearest[mesh.faces[near_faces, 0]]]
        along = np.bincount(self.chain, lengths_along(mesh, self.edges), chains) / before.size
        costs: FloatArray = np.bincount(chain, energy[near_faces], chains) / along
        return costs, bool(is_folded.any())


def with_lines(layout: GridLayout, edges: IntArray, off: FloatArray) -> LinedLayout:
    """Return a layout cut along edges, which become sides.

    Of two edges that leave a vertex in the same direction, the one farther from it is left out.

    Args:
        layout: the layout.
        edges: (k,) inner edges of its mesh.
        off: (e,) the angle of each edge from its axis.
    """
    mesh = layout.mesh
    places = layout.points[layout.corners]
    angles = signed_angles(places[:, PREVIOUS] - places[:, NEXT]).ravel()
    while True:
        cut = open_along(mesh, edges)
        border = cut.mesh.edge_halfedges[cut.mesh.is_boundary_edge, 0]
        edge, tails, heads = mesh.halfedge_edges[border], cut.mesh.tails[border], cut.mesh.heads[border]
        # The angle between two axes, at each copy of a vertex, is a multiple of a quarter turn.
        turned = np.bincount(cut.mesh.faces.ravel(), angles, len(cut.origin))
        turned += np.bincount(tails, off[edge], len(turned)) - np.bincount(heads, off[edge], len(turned))
        quarters = np.rint(turned / (np.pi / 2)).astype(np.int64)
        is_same = cut.mesh.is_boundary_vertex & (quarters <= 0)
        size = np.where(np.isin(edge, edges), np.abs(off[edge]), -1.0)
        largest = np.full(len(turned), -1.0)
        for ends_at in (tails, heads):
            np.maximum.at(largest, ends_at, size)
        clashes = np.stack([is_same[tails], is_same[heads]])
        is_least = (clashes & (size + 1e-9 < np.stack([largest[tails], largest[heads]]))).any(axis=0)
        if not len(clashing := edge[clashes.any(axis=0) & (size >= 0)]):
            break
        # The farther of each two, unless a third one is still farther from the same direction.
        edges = long_chains(layout, np.setdiff1d(edges, np.setdiff1d(clashing, edge[is_least])))
    n = len(mesh.vertices)
    on, on_side = mask_of(n, mesh.edges[edges]), mask_of(n, layout.vertex[layout.sides.points])
    turns = np.bincount(cut.origin, minlength=n) != np.where(mesh.is_boundary_vertex, 1, 2)
    turns[cut.origin[cut.mesh.is_boundary_vertex & (quarters != 2)]] = True
    nodes = np.setdiff1d(np.flatnonzero(on & turns & (on_side | ~mesh.is_boundary_vertex)), layout.cones)
    opened = open_along(mesh, np.union1d(edges, point_seams(mesh, layout.corners)))
    point_before = point_vertices(layout.corners, opened.mesh.faces, len(opened.origin))
    sides = Sides(np.union1d(nodes, layout.sides.corners))
    parts, component = joined_charts(
        replace(layout, corners=opened.mesh.faces, points=layout.points[point_before], sides=sides)
    )
    sides, chain = _sides(parts, edges, off, np.isin(point_before, layout.sides.points))
    return LinedLayout(at_origin(replace(parts, sides=sides), component), edges, chain)


def _sides(
    layout: GridLayout, edges: IntArray, off: FloatArray, is_straight: BoolArray
) -> tuple[Sides, IntArray]:
    """Return the sides of the boundary and the left sides of chains of edges (k,), and (k,) the chain of each edge."""
    points, chains = layout.points, layout.chains()
    border, order = find_sides(layout, is_straight), np.argsort(chains.edges)
    which = order[np.searchsorted(chains.edges[order], edges)]
    left = chains.left[which]
    numbers, chain = np.unique(chains.chain[which], return_inverse=True)
    along = (points[left[:, 1]] - points[left[:, 0]]) * np.exp(-1j * off[edges])
    # The doubled angle makes opposite directions equal.
    double = np.bincount(chain, (along**2).real, len(numbers))
    incidences = np.unique(np.stack([left.ravel(), chain.repeat(2)], axis=1), axis=0)
    sides = Sides(
        layout.sides.corners,
        np.concatenate([border.points, incidences[:, 0]]),
        np.concatenate([border.side, incidences[:, 1] + len(border.axis)]),
        np.concatenate([border.axis, np.where(double >= 0, 1, 0)]),
    )
    return sides, chain
