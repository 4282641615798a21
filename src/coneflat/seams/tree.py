"""Seams of a connected mesh.

Seams may end anywhere on a boundary loop, as if it were contracted to a point. Loops and cones
are connected by a tree; where there are handles, the shortest loops around them are cut as well. That opens the mesh
to a disk.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.text import plural
from ..errors import OptionError, SeamError
from ..geometry.operators import at_safe_scale
from ..linalg.shortest_paths import MultiGraph, Paths
from ..mesh.connectivity import TriangleMesh, label_components
from ..mesh.open_mesh import cut_open
from ..mesh.ties import mesh_tie_key
from ..stages import Cut, SeamSpec

NO_EDGES = np.empty(0, dtype=np.int64)
# Relative: on grids many paths are equally long, and rounding should not choose among them, lest the result
# depend on the numbering. Far above rounding, far below what anyone would see in a seam.
TIE_BREAK = 1e-7


def find_seams(
    mesh: TriangleMesh,
    cones: IntArray,
    edge_costs: FloatArray,
    is_avoided: BoolArray | None = None,
    *,
    required: IntArray = NO_EDGES,
    forbidden: IntArray = NO_EDGES,
) -> IntArray:
    """Return the edges (k,) to cut so that a connected mesh becomes a disk with all cones on its border.

    Where required edges close curves that cut the mesh into pieces, every piece becomes a disk.

    Args:
        mesh: the mesh.
        cones: (s,) vertices that the seams must reach.
        edge_costs: (e,) positive; the length of each edge, say, or what `edge_costs` makes of it.
        is_avoided: (e,) edges to cut only if nothing else serves, such as diagonals of polygons.
        required: edges that are cut in any case; on the boundary they mean nothing.
        forbidden: edges that are not cut.

    Raises:
        SeamError: every set of seams needs forbidden edges; or edges are both required and forbidden.
        OptionError: costs are not positive numbers.
    """
    is_required, is_forbidden = np.zeros((2, len(mesh.edges)), dtype=bool)
    is_required[required] = True
    is_required &= ~mesh.is_boundary_edge
    is_forbidden[forbidden] = True
    _refuse(is_required & is_forbidden, "both required and forbidden as seams")
    key = mesh_tie_key(mesh)
    costs = _checked(edge_costs, len(mesh.edges)) * (1 + TIE_BREAK * key[mesh.edges].sum(axis=1))
    for dear in (is_avoided, is_forbidden):
        if dear is not None and dear.any():
            costs = np.where(dear, costs + costs.sum(), costs)

    is_cut = mesh.is_boundary_edge | is_required
    is_end = np.zeros(len(mesh.vertices), dtype=bool)
    is_end[mesh.edges[is_cut]] = is_end[cones] = True
    if is_end.any():
        is_cut |= _tree(mesh, costs, is_cut, is_end)
        is_end[mesh.edges[is_cut]] = True
        is_cut |= _loops(mesh, costs, is_cut, is_end)
    else:
        is_end[np.argmax(key)] = True
        is_cut = _without_loose_ends(mesh, _loops(mesh, costs, is_cut, is_end))
    seams = _as_slit(mesh, costs, is_cut & ~mesh.is_boundary_edge)
    _refuse(seams & is_forbidden, "needed to open the mesh, but forbidden as seams")
    return np.flatnonzero(seams)


def cut_to_disk(mesh: TriangleMesh, cones: IntArray, costs: FloatArray, spec: SeamSpec) -> Cut:
    """Return a connected mesh cut open to a disk with the cones on its border (Section 4.2 of the paper).

    Args:
        mesh: the mesh.
        cones: (s,) vertices that the seams must reach.
        costs: (e,) of the edges.
        spec: which edges to avoid, and which must not be cut.

    Raises:
        SeamError: every set of seams needs forbidden edges.
    """
    seams = find_seams(mesh, cones, costs, spec.is_avoided, forbidden=np.flatnonzero(spec.is_forbidden))
    return Cut(cut_open(mesh, seams).mesh, seams)


def _checked(costs: FloatArray, count: int) -> FloatArray:
    """Return (e,) costs, brought to a size at which their sums are finite where they are not."""
    if np.shape(costs) != (count,) or not (np.isfinite(costs).all() and (costs > 0).all()):
        raise OptionError(f"costs of edges must be {count:,} positive numbers")
    return at_safe_scale(np.asarray(costs, dtype=np.float64))


def _refuse(edges: BoolArray, what: str) -> None:
    count = int(edges.sum())
    if count:
        raise SeamError(f"{plural(count, 'edge')} of {len(edges):,} {'is' if count == 1 else 'are'} {what}")


def _tree(mesh: TriangleMesh, costs: FloatArray, is_cut: BoolArray, is_end: BoolArray) -> BoolArray:
    """Return (e,) a tree of paths that connects the ends (n,), at most twice as long as the shortest.

    K. Mehlhorn, "A faster approximation algorithm for the Steiner problem in graphs", 1988: one search from all
    ends at once, then a minimum spanning tree over the cheapest bridges between their regions. What is cut already
    (e,) costs nothing.
    """
    paths = MultiGraph(len(mesh.vertices), mesh.edges, costs, mesh.edges_beside).shortest_paths(
        np.flatnonzero(is_end)
    )
    regions = paths.source[mesh.edges]
    bridges = np.flatnonzero(regions[:, 0] != regions[:, 1])
    over = np.where(is_cut[bridges], 0.0, _costs_over(mesh, costs, paths, bridges))
    tree = MultiGraph(len(mesh.vertices), regions[bridges], over).minimum_spanning_tree()
    return _paths_over(mesh, paths, bridges[tree])


def _loops(mesh: TriangleMesh, costs: FloatArray, is_cut: BoolArray, is_end: BoolArray) -> BoolArray:
    """Return (e,) loops that open each piece of a cut mesh to a disk, the shortest with the paths to their ends.

    Shortest paths from the ends (n,), those of the cut, to all vertices are a forest; a spanning forest of the faces
    over the edges that are neither in it nor cut leaves 2 * genus edges (tree-cotree, D. Eppstein 2003), and takes
    those first that would close the longest loops (J. Erickson and K. Whittlesey 2005).
    """
    pairs = mesh.edge_faces[~is_cut]
    pieces, _ = label_components(len(mesh.faces), *pairs.T)
    inner = len(mesh.vertices) - int(is_end.sum())
    if len(pairs) == inner + len(mesh.faces) - pieces:
        return np.zeros(len(costs), dtype=bool)
    paths = MultiGraph(len(mesh.vertices), mesh.edges, costs, mesh.edges_beside).shortest_paths(
        np.flatnonzero(is_end)
    )
    is_left = ~is_cut
    is_left[paths.edge[~is_end]] = False
    left = np.flatnonzero(is_left)
    dual = MultiGraph(len(mesh.faces), mesh.edge_faces[left], -_costs_over(mesh, costs, paths, left))
    return _paths_over(mesh, paths, np.delete(left, dual.minimum_spanning_tree()))


def _costs_over(mesh: TriangleMesh, costs: FloatArray, paths: Paths, edges: IntArray) -> FloatArray:
    """Return (k,) the cost of the path over each edge from end to end."""
    return costs[edges] + paths.distance[mesh.edges[edges]].sum(axis=1)


def _paths_over(mesh: TriangleMesh, paths: Paths, edges: IntArray) -> BoolArray:
    """Return (e,) the paths over edges (k,) from end to end."""
    found = np.zeros(len(mesh.edges), dtype=bool)
    found[edges] = True
    found[paths.edge[paths.nodes_to(mesh.edges[edges].ravel())]] = True
    return found


def _without_loose_ends(mesh: TriangleMesh, is_cut: BoolArray) -> BoolArray:
    """Return (e,) the edges of a cut that are parts of loops, or between them."""
    kept = is_cut.copy()
    while True:
        cut = np.flatnonzero(kept)
        _, place, degree = np.unique(mesh.edges[cut], return_inverse=True, return_counts=True)
        is_loose = (degree[place.reshape(-1, 2)] == 1).any(axis=1)
        if not is_loose.any():
            return kept
        kept[cut[is_loose]] = False


def _as_slit(mesh: TriangleMesh, costs: FloatArray, seams: BoolArray) -> BoolArray:
    """Return seams that a mesh can be cut along: a slit of one edge would have the same vertices on both sides."""
    if seams.sum() != 1 or mesh.is_boundary_edge.any():
        return seams
    beside = np.isin(mesh.edges, mesh.edges[seams]).sum(axis=1) == 1
    longer = seams.copy()
    longer[np.argmin(np.where(beside, costs, np.inf))] = True
    return longer
