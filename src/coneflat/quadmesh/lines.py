"""Sharp edges and straight sides of the boundary on grid lines.

Chains of sharp edges become sides, as those of the boundary are: the grid has an integer for the common coordinate of
each, and relaxing moves their points there. Chains that deform the grid most for their length are left out until there
is a grid.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from scipy.sparse.csgraph import dijkstra

from ..base import BoolArray, ComplexArray, FloatArray, IntArray, Unmet, mask_of, plural
from ..errors import GridError
from ..geometry import map_factors, signed_angles
from ..mesh import NEXT, PREVIOUS, open_along, point_seams, point_vertices
from ..optimise import StretchEnergy
from .cross_field import sharp_ends
from .features import edge_indices, lengths_along, sharp_edges, without_stubs
from .integer_map import IntegerGrid
from .layout import GridLayout, Sides, at_origin, find_sides, joined_charts
from .round_layout import grid_about
from .rounding import find_rounding

# Preferred edges are put on a line if their direction differs from an axis by less, radians.
MAX_TURN = np.deg2rad(20.0)
# Squares: shorter chains of sharp edges are not put on lines.
SHORTEST = 4.0
# Largest cost of a preferred chain: the energy of the triangles near it, over its length and the root of the area.
MAX_COST = 5e-4
# The energy of a triangle that is flipped or nearly so.
FOLDED_ENERGY = 10.0


def grid_with_lines(
    layout: GridLayout, angle: float, is_required: bool, energy: StretchEnergy
) -> tuple[IntegerGrid | None, str]:
    """Return a grid with sharp edges on grid lines, or None if none are, and a note on those that are not, or "".

    Args:
        layout: a layout in which no edge joins two vertices on grid points.
        angle: dihedral angle above which edges are sharp, radians.
        is_required: put as many edges as possible on lines; else only those that deform the grid little.
        energy: what the grid minimises.
    """
    mesh, off, reason = layout.mesh, _deviations(layout), "too short for quads of this size"
    sharp = sharp_edges(mesh, angle) if is_required else edge_indices(mesh, sharp_ends(mesh, angle))
    candidates = sharp if is_required else sharp[np.abs(off[sharp]) < MAX_TURN]
    edges, grid = _long_chains(layout, candidates), None
    for attempt in count() if is_required else range(6):
        lined = _with_lines(layout, edges, off)
        if not len(lined.edges):
            break
        # For preferred edges, cones are separated all at once only: one at a time takes long.
        rounding = replace(find_rounding(lined.layout), attempts=None if is_required else 2)
        costs, is_folded = lined.costs(layout, rounding.displaced(rounding.basis @ rounding.start))
        # Each failure leaves out the costliest chains: of preferred edges half of them, or those above a bound that
        # decreases so that the attempts end; of required ones fewer.
        bound = 0.5 ** (1 + attempt / 4) * costs.max() if is_required else np.median(costs)
        max_cost = np.inf if is_required else MAX_COST * np.sqrt(layout.area)
        if costs.max() > max_cost:
            bound = 0.7**attempt * max_cost
        elif not is_folded or (is_required and attempt == 0):
            try:
                grid = grid_about(rounding, energy, 0)
                if grid.squares <= 2 * layout.area:
                    break
                reason, grid = f"squares would be {grid.squares:,.0f}, not {layout.area:,.0f}", None
            except GridError as error:
                reason = str(error)
        edges = _long_chains(layout, lined.edges[costs[lined.chain] < bound])
    grid = grid and replace(grid, features=mesh.edges[lined.edges])
    left = np.setdiff1d(sharp, lined.edges) if grid else sharp
    if not is_required or not len(left):
        return grid, "There are no sharp edges." if is_required and not len(sharp) else ""
    share = 100 * lengths_along(mesh, left).sum() / lengths_along(mesh, sharp).sum()
    return grid, Unmet(
        f"{plural(len(left), 'sharp edge')} of {len(sharp):,}, {share:.1f} % of their length, not on "
        f"grid lines: {reason}."
    )


def with_sides(layout: GridLayout) -> GridLayout:
    """Return a layout with all sides of its boundary on lines, along the nearest axes."""
    return replace(layout, sides=find_sides(layout, np.ones(len(layout.points), dtype=bool)))


def _deviations(layout: GridLayout) -> FloatArray:
    """Return (e,) the angle of each edge from the nearest axis."""
    halfedge, (starts, ends) = layout.mesh.edge_halfedges[:, 0], layout.ends
    return np.asarray(np.angle((layout.points[ends[halfedge]] - layout.points[starts[halfedge]]) ** 4) / 4)


def _long_chains(layout: GridLayout, edges: IntArray) -> IntArray:
    return edges[without_stubs(layout.mesh, edges, SHORTEST * layout.size)]


@dataclass(frozen=True, eq=False)
class _Lined:
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


def _with_lines(layout: GridLayout, edges: IntArray, off: FloatArray) -> _Lined:
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
        edges = _long_chains(layout, np.setdiff1d(edges, np.setdiff1d(clashing, edge[is_least])))
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
    return _Lined(at_origin(replace(parts, sides=sides), component), edges, chain)


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
