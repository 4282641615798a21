"""Seams of a connected mesh.

Seams may end anywhere on a boundary loop, as if it were contracted to a point. Boundary loops and cones are connected
by a tree; on surfaces with handles, the shortest loops around them are cut as well. This cuts the mesh to a disk. Holes
that are kept need not be connected.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, mask_of
from ..base.progress import stage
from ..base.text import plural
from ..errors import OptionError, SeamError
from ..geometry.operators import at_safe_scale
from ..linalg.shortest_paths import MultiGraph, Paths
from ..mesh.charts import cut_open
from ..mesh.connectivity import TriangleMesh, label_components
from ..mesh.holes import with_fans
from ..mesh.ties import mesh_tie_key
from ..stages import Cut, SeamSpec

NO_EDGES = np.empty(0, dtype=np.int64)
# Relative change of costs that breaks ties. On grids many paths are equally long; if rounding chose among them, the
# result would depend on the numbering. The value is far above rounding and far below visible differences of seams.
TIE_BREAK = 1e-7
# Cost of an edge that costs nothing, relative to the mean cost: paths of more of them remain longer.
NO_COST = 1e-9


def find_seams(
    mesh: TriangleMesh,
    cones: IntArray,
    edge_costs: FloatArray,
    is_avoided: BoolArray | None = None,
    *,
    forbidden: IntArray = NO_EDGES,
    kept_holes: Sequence[IntArray] = (),
) -> IntArray:
    """Return (k,) the edges to cut so that a mesh becomes a disk with all cones on its border.

    No seam has to reach holes that are kept. Where seams pass one, this costs nothing.

    Args:
        mesh: the mesh; it may have several components if each of them has a cone or a boundary.
        cones: (s,) vertices that the seams must reach.
        edge_costs: (e,) positive costs, for example the edge lengths, or the result of `edge_costs`.
        is_avoided: (e,) True for edges that are cut only if necessary, such as diagonals of polygons.
        forbidden: edges that must not be cut.
        kept_holes: the half-edges of boundary loops that may remain holes, in order; not all loops.

    Raises:
        SeamError: every set of seams needs forbidden edges.
        OptionError: costs are not positive numbers.

    Notes:
        Cones and boundary loops are connected by an approximate Steiner tree (Section 4.3 of the paper): the shortest
        paths from all of them divide the vertices into regions, and a minimum spanning tree is chosen of the cheapest
        paths between regions; it costs at most twice as much as the cheapest tree. On a surface of genus g, 2 g loops
        from a tree-cotree decomposition are added, each the shortest through its edge.

    References:
        A. Sheffer, J. Hart, "Seamster: inconspicuous low-distortion texture seam layout", 2002.
        K. Mehlhorn, "A faster approximation algorithm for the Steiner problem in graphs", 1988.
        D. Eppstein, "Dynamic generators of topologically embedded graphs", 2003.
        J. Erickson, K. Whittlesey, "Greedy optimal homotopy and homology generators", 2005.

    See Also:
        edge_costs: costs that prefer creases and hidden places.
        cut_open: the mesh cut along seams.
    """
    is_forbidden = mask_of(len(mesh.edges), forbidden)
    key = mesh_tie_key(mesh)
    first_keys, second_keys = key.take(mesh.edges).T
    costs = _checked(edge_costs, len(mesh.edges)) * (1 + TIE_BREAK * (first_keys + second_keys))
    for is_costly in (is_avoided, is_forbidden):
        if is_costly is not None and is_costly.any():
            costs = np.where(is_costly, costs + costs.sum(), costs)

    is_cut = _opened(mesh, costs, cones) if not kept_holes else _opened_around(mesh, costs, cones, kept_holes)
    seams = _lengthened(mesh, costs, is_cut & ~mesh.is_boundary_edge)
    count = int((seams & is_forbidden).sum())
    if count:
        verb = "is" if count == 1 else "are"
        raise SeamError(
            f"{plural(count, 'edge')} of {len(seams):,} {verb} needed to open the mesh, but forbidden as seams"
        )
    return np.flatnonzero(seams)


def _opened(mesh: TriangleMesh, costs: FloatArray, cones: IntArray) -> BoolArray:
    """Return (e,) the edges of the border of a mesh after it is cut to a disk with all cones on its border."""
    is_cut = mesh.is_boundary_edge.copy()
    is_end = mask_of(len(mesh.vertices), mesh.edges[is_cut])
    is_end[cones] = True
    if is_end.any():
        is_cut |= _tree(mesh, costs, is_cut, is_end)
        is_end[mesh.edges[is_cut]] = True
        return is_cut | _loops(mesh, costs, is_cut, is_end)
    is_end[np.argmax(mesh_tie_key(mesh))] = True
    return without_loose_ends(mesh, _loops(mesh, costs, is_cut, is_end))


def _opened_around(
    mesh: TriangleMesh, costs: FloatArray, cones: IntArray, holes: Sequence[IntArray]
) -> BoolArray:
    """Return (e,) the same as `_opened`, for the mesh with filled holes: seams in and along these cost nothing."""
    filled = with_fans(mesh, [mesh.tails[hole] for hole in holes])
    place = filled.halfedge_edges[mesh.edge_halfedges[:, 0]]
    filled_costs = np.full(len(filled.edges), NO_COST * costs.mean())
    on_border = mask_of(len(costs), mesh.halfedge_edges[np.concatenate(holes)])
    filled_costs[place[~on_border]] = costs[~on_border]
    return _opened(filled, filled_costs, cones)[place]


@stage("cut")
def cut_to_disk(
    mesh: TriangleMesh,
    cones: IntArray,
    costs: FloatArray,
    spec: SeamSpec,
    kept_holes: Sequence[IntArray] = (),
) -> Cut:
    """Return a connected mesh cut open to a disk with the cones on its border (Section 4.3 of the paper).

    Args:
        mesh: the mesh.
        cones: (s,) vertices that the seams must reach.
        costs: (e,) costs of cutting the edges, positive.
        spec: the edges to avoid and the forbidden ones.
        kept_holes: boundary loops that may remain holes, see `find_seams`.

    Raises:
        SeamError: every set of seams needs forbidden edges.
        OptionError: costs are not positive numbers.
    """
    forbidden = np.flatnonzero(spec.is_forbidden)
    seams = find_seams(mesh, cones, costs, spec.is_avoided, forbidden=forbidden, kept_holes=kept_holes)
    return Cut(cut_open(mesh, seams, len(kept_holes)).mesh, seams)


def _checked(costs: FloatArray, count: int) -> FloatArray:
    """Return (e,) validated costs, rescaled if their sums would overflow."""
    if np.shape(costs) != (count,) or not (np.isfinite(costs).all() and (costs > 0).all()):
        raise OptionError(f"costs of edges must be {count:,} positive numbers")
    return at_safe_scale(np.asarray(costs, dtype=np.float64))


def _tree(mesh: TriangleMesh, costs: FloatArray, is_cut: BoolArray, is_end: BoolArray) -> BoolArray:
    """Return (e,) the edges of a tree that connects the ends (n,), at most twice as costly as the cheapest.

    This is the algorithm of Mehlhorn 1988: one search from all ends simultaneously, then a minimum spanning tree over
    the cheapest bridges between their regions. Edges that are already cut (e,) cost nothing.
    """
    paths = MultiGraph(len(mesh.vertices), mesh.edges, costs, mesh.incident_edges).shortest_paths(
        np.flatnonzero(is_end)
    )
    regions = paths.source[mesh.edges]
    bridges = np.flatnonzero(regions[:, 0] != regions[:, 1])
    over = np.where(is_cut[bridges], 0.0, _costs_over(mesh, costs, paths, bridges))
    tree = MultiGraph(len(mesh.vertices), regions[bridges], over).minimum_spanning_tree()
    return _paths_over(mesh, paths, bridges[tree])


def _loops(mesh: TriangleMesh, costs: FloatArray, is_cut: BoolArray, is_end: BoolArray) -> BoolArray:
    """Return (e,) the shortest loops, with the paths to the cut, that open each piece of a cut mesh to a disk.

    The shortest paths from the ends (n,), the vertices of the cut, to all vertices form a forest. A spanning forest of
    the faces over the edges that are neither in this forest nor cut leaves 2 * genus edges (tree-cotree, D. Eppstein
    2003). It prefers the edges that would close the longest loops (J. Erickson and K. Whittlesey 2005).
    """
    pairs = mesh.edge_faces[~is_cut]
    pieces, _ = label_components(len(mesh.faces), *pairs.T)
    inner = len(mesh.vertices) - int(is_end.sum())
    if len(pairs) == inner + len(mesh.faces) - pieces:
        return np.zeros(len(costs), dtype=bool)
    paths = MultiGraph(len(mesh.vertices), mesh.edges, costs, mesh.incident_edges).shortest_paths(
        np.flatnonzero(is_end)
    )
    is_uncovered = ~is_cut
    is_uncovered[paths.edge[~is_end]] = False
    uncovered = np.flatnonzero(is_uncovered)
    dual = MultiGraph(
        len(mesh.faces), mesh.edge_faces[uncovered], -_costs_over(mesh, costs, paths, uncovered)
    )
    return _paths_over(mesh, paths, np.delete(uncovered, dual.minimum_spanning_tree()))


def _costs_over(mesh: TriangleMesh, costs: FloatArray, paths: Paths, edges: IntArray) -> FloatArray:
    """Return (k,) the cost of the path through each edge, from source to source."""
    return costs[edges] + paths.distance[mesh.edges[edges]].sum(axis=1)


def _paths_over(mesh: TriangleMesh, paths: Paths, edges: IntArray) -> BoolArray:
    """Return (e,) the edges of the paths through given edges (k,), from source to source."""
    on_paths = mask_of(len(mesh.edges), edges)
    on_paths[paths.edge[paths.nodes_to(mesh.edges[edges].ravel())]] = True
    return on_paths


def without_loose_ends(mesh: TriangleMesh, is_cut: BoolArray) -> BoolArray:
    """Return (e,) the edges of a cut that are in loops or in paths between loops; dangling paths are removed."""
    remaining = is_cut.copy()
    while True:
        cut = np.flatnonzero(remaining)
        _, place, degree = np.unique(mesh.edges[cut], return_inverse=True, return_counts=True)
        is_loose = (degree[place.reshape(-1, 2)] == 1).any(axis=1)
        if not is_loose.any():
            return remaining
        remaining[cut[is_loose]] = False


def _lengthened(mesh: TriangleMesh, costs: FloatArray, seams: BoolArray) -> BoolArray:
    """Return seams that are longer by an edge where they consist of one: such a cut duplicates no vertex."""
    longer, is_border = seams.copy(), seams | mesh.is_boundary_edge
    degree = np.bincount(mesh.edges[is_border].ravel(), minlength=len(mesh.vertices))
    cut = np.flatnonzero(seams)
    for edge in cut[(degree[mesh.edges[cut]] == 1).all(axis=1)]:
        is_adjacent = np.isin(mesh.edges, mesh.edges[edge]).sum(axis=1) == 1
        longer[np.argmin(np.where(is_adjacent, costs, np.inf))] = True
    return longer
