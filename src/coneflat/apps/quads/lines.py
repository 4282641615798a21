"""Sharp edges and straight sides of the boundary on grid lines.

Chains of sharp edges become sides, as the boundary is: the grid has a variable for the common coordinate of each. Where
no grid has them all, those that deform it most for their length are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ... import TriangleMesh
from ...base import BoolArray, ComplexArray, FloatArray, IntArray, plural
from ...errors import ConvergenceError, GridError
from ...geometry import map_factors, signed_angles
from ...layout import StretchEnergy
from ...mesh import NEXT, PREVIOUS, open_along
from .cross_field import sharp_ends
from .features import edge_indices, feature_chains, lengths_along, without_stubs
from .features import sharp_edges as every_sharp_edge
from .integer_map import IntegerGrid
from .layout import GridLayout, Sides, at_origin, find_sides, joined_charts
from .round_layout import grid_about
from .rounding import find_rounding

# Preferred edges are put on a line if their direction differs from an axis by less, radians.
MAX_TURN = np.deg2rad(20.0)
# Squares: shorter chains of sharp edges are not put on lines.
SHORTEST = 4.0
# Largest mean quasi-conformal distortion of a grid with preferred edges on grid lines.
MAX_QC = 1.11
# Number of grids that are tried, and of predictions before these.
MAX_GRIDS, MAX_TRIES = 8, 60
# The energy of a triangle that is flipped or nearly so.
FOLDED = 10.0
import os,sys,time
DBG=os.environ.get("LINES_DEBUG")

def grid_with_lines(
    layout: GridLayout, edges: IntArray, energy: StretchEnergy, required: bool
) -> tuple[IntegerGrid | None, IntArray]:
    """Return a grid with edges (k,) on grid lines, as far as possible, and these edges; None if no edge is.

    Args:
        layout: a layout in which no edge joins two vertices on grid points.
        edges: sharp edges of its mesh.
        energy: what the grid minimises.
        required: put also edges on lines that are not along an axis, and accept a large distortion.
    """
    off = _deviations(layout)
    if not required:
        edges = edges[np.abs(off[edges]) < MAX_TURN]
    edges, tries = _long_chains(layout, edges), 0
    for _ in range(MAX_TRIES):
        if not len(edges) or tries == MAX_GRIDS:
            break
        lined, edges = with_lines(layout, edges, off)
        if not len(edges): break
        if DBG: print("edges", len(edges), "length", lengths_along(layout.mesh, edges).sum(), file=sys.stderr)
        rounding = find_rounding(lined)
        moved = rounding.displaced(rounding.smooth)
        cost, folded = _costs(layout, edges, lined, moved)
        if DBG: print("cost", np.round(cost,3).tolist(), "folded", np.round(folded,3).tolist(), file=sys.stderr)
        if required or not (folded > 0).any():
            tries += 1
            try:
                t=time.time()
                found = grid_about(rounding, energy, 0)
                if DBG: print("grid qc", found.qc_before, found.qc_mean, "least area", found.least_area, found.notes, time.time()-t,file=sys.stderr)
            except (GridError, ConvergenceError) as error:
                if DBG: print("FAILED", error, time.time()-t, file=sys.stderr)
            else:
                if required or found.qc_mean < MAX_QC:
                    return replace(found, features=layout.mesh.edges[edges]), edges
        else:
            cost = folded
        chain, _ = feature_chains(layout.mesh, edges)
        worst = cost >= max(float(cost.max()) / 2, 1e-12)
        edges = _long_chains(layout, edges[~worst[chain]])
    return None, edges[:0]


def sharp_edges(layout: GridLayout, angle: float, required: bool) -> IntArray:
    """Return the edges of a layout's mesh sharper than an angle; only long chains of these, unless they are required."""
    if required:
        return every_sharp_edge(layout.mesh, angle)
    return edge_indices(layout.mesh, sharp_ends(layout.mesh, angle))


def notes(mesh: TriangleMesh, edges: IntArray, kept: IntArray) -> tuple[str, ...]:
    """Return a note on the edges that are not among those kept, if there are any, or no edges at all."""
    if not len(edges):
        return ("There are no sharp edges to put on grid lines.",)
    left = np.setdiff1d(edges, kept)
    if not len(left):
        return ()
    share = 100 * lengths_along(mesh, left).sum() / lengths_along(mesh, edges).sum()
    return (f"{plural(len(left), 'sharp edge')} of {len(edges):,}, {share:.1f} % of their length, not on grid lines.",)


def _deviations(layout: GridLayout) -> FloatArray:
    """Return (e,) the angle of each edge from the nearest axis."""
    one, (starts, ends) = layout.mesh.edge_halfedges[:, 0], layout.ends
    off: FloatArray = np.angle((layout.points[ends[one]] - layout.points[starts[one]]) ** 4) / 4
    return off


def _long_chains(layout: GridLayout, edges: IntArray) -> IntArray:
    return edges[without_stubs(layout.mesh, edges, SHORTEST * layout.size)]


def with_sides(layout: GridLayout) -> GridLayout:
    """Return a layout with all sides of its boundary on lines, along the nearest axes."""
    return replace(layout, sides=find_sides(layout, np.ones(len(layout.points), dtype=bool)))


def with_lines(layout: GridLayout, edges: IntArray, off: FloatArray) -> tuple[GridLayout, IntArray]:
    """Return a layout cut along edges (k,), which become sides, and these edges.

    Of two edges that leave a vertex in the same direction only one is kept.

    Args:
        layout: the layout.
        edges: inner edges of its mesh.
        off: (e,) the angle of each edge from the axis on which it is to lie.
    """
    mesh, (starts, ends) = layout.mesh, layout.ends
    places = layout.points[layout.corners]
    angles = signed_angles(places[:, PREVIOUS] - places[:, NEXT])
    while True:
        cut = open_along(mesh, edges)
        border = cut.mesh.edge_halfedges[cut.mesh.is_boundary_edge, 0]
        turned = np.bincount(cut.mesh.faces.ravel(), angles.ravel(), len(cut.origin))
        edge = mesh.halfedge_edges[border]
        turned += np.bincount(cut.mesh.tails[border], off[edge], len(turned))
        turned -= np.bincount(cut.mesh.heads[border], off[edge], len(turned))
        quarters = np.rint(turned / (np.pi / 2)).astype(np.int64)
        same = np.flatnonzero(cut.mesh.is_boundary_vertex & (quarters <= 0))
        if not len(same):
            break
        at = np.concatenate([edge[np.isin(cut.mesh.tails[border], same)], edge[np.isin(cut.mesh.heads[border], same)]])
        at = np.intersect1d(at, edges)
        worst = at[np.abs(off[at]) >= np.abs(off[at]).max() - 1e-9]
        edges = np.setdiff1d(edges, worst)
        edges = _long_chains(layout, edges)
    border = np.flatnonzero(cut.mesh.is_boundary_vertex)
    turns = np.zeros(len(mesh.vertices), dtype=bool)
    turns[cut.origin[border[quarters[border] != 2]]] = True
    inside, copies = ~mesh.is_boundary_vertex, np.bincount(cut.origin, minlength=len(turns))
    on = np.zeros(len(turns), dtype=bool); on[mesh.edges[edges]] = True
    turns |= np.where(inside, on & (copies != 2), copies > 1)
    nodes = np.setdiff1d(np.flatnonzero(turns & on), layout.cones)
    is_feature = np.zeros(len(mesh.edges), dtype=bool)
    is_feature[edges] = True
    inner = ~mesh.is_boundary_edge
    there, back = mesh.edge_halfedges[inner].T
    is_seam = is_feature.copy()
    is_seam[inner] |= (starts[there] != ends[back]) | (ends[there] != starts[back])
    opened = open_along(mesh, np.flatnonzero(is_seam))
    moved = np.zeros(len(opened.origin), dtype=np.complex128)
    moved[opened.mesh.faces.ravel()] = layout.points[layout.corners.ravel()]
    straight = np.zeros(len(moved), dtype=bool)
    straight[opened.mesh.faces.ravel()] = np.isin(layout.corners.ravel(), layout.sides.points)
    sides = Sides(np.union1d(nodes, layout.sides.corners))
    found, component = joined_charts(replace(layout, corners=opened.mesh.faces, points=moved, sides=sides))
    return at_origin(replace(found, sides=_sides(found, is_feature, off, straight)), component), edges


def _sides(layout: GridLayout, is_feature: BoolArray, off: FloatArray, is_straight: BoolArray) -> Sides:
    """Return the sides of the boundary, and the left sides of chains of features."""
    points, chains = layout.points, layout.chains()
    border = find_sides(layout, is_straight)
    feature = is_feature[chains.edges]
    left, chain = chains.left[feature], chains.chain[feature]
    along = points[left[:, 1]] - points[left[:, 0]]
    along *= np.exp(-1j * off[chains.edges[feature]])
    numbers, which = np.unique(chain, return_inverse=True)
    # The doubled angle makes opposite directions equal.
    double = np.bincount(which, (along**2).real, len(numbers))
    both = np.unique(np.stack([left.ravel(), which.repeat(2)], axis=1), axis=0)
    return Sides(
        layout.sides.corners,
        np.concatenate([border.points, both[:, 0]]),
        np.concatenate([border.side, both[:, 1] + len(border.axis)]),
        np.concatenate([border.axis, np.where(double >= 0, 1, 0)]),
    )


def _costs(
    layout: GridLayout, edges: IntArray, lined: GridLayout, moved: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    """Return (c,) the energy near each chain of edges if points move, and the folded area, both over its length."""
    mesh = layout.mesh
    before, after = lined.points[lined.corners], moved[lined.corners]
    one, two = map_factors(before[:, PREVIOUS] - before[:, NEXT])
    places = after - after[:, :1]
    a, b = np.abs((one * places).sum(axis=1)) ** 2, np.abs((two * places).sum(axis=1)) ** 2
    areas, is_folded = lined.double_areas() / 2, b >= 0.95 * a
    with np.errstate(divide="ignore", invalid="ignore"):
        energy = areas * np.where(is_folded, FOLDED, np.minimum(2 * b / (a - b), FOLDED))
    chain, _ = feature_chains(mesh, edges)
    count = int(chain.max()) + 1
    at = np.zeros(len(mesh.vertices), dtype=np.int64)
    ends = mesh.edges[edges]
    at[ends] = chain[:, None]
    starts, heads = lined.ends
    lengths = np.abs(lined.points[heads] - lined.points[starts])
    graph = csr_matrix((lengths, (mesh.tails, mesh.heads)), shape=(len(at),) * 2)
    graph = graph.maximum(graph.T)
    nearest = dijkstra(graph, indices=np.unique(ends), min_only=True, return_predecessors=True)[2]
    of_face = at[np.maximum(nearest, 0)][mesh.faces[:, 0]]
    along = np.bincount(chain, lengths_along(mesh, edges), count) / layout.size
    return tuple(np.bincount(of_face, each, count) / along for each in (energy, areas * is_folded))
