"""Seams of a connected mesh.

Seams may end anywhere on a boundary loop, as if it were contracted to a point. Loops and cones
are connected by a tree; where there are handles, the shortest loops around them are cut as well. That opens the mesh
to a disk. Then seams are exchanged for shorter and straighter ones.
"""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..errors import OptionError, SeamError
from ..geometry.graph import MultiGraph
from ..geometry.operators import at_safe_scale
from ..geometry.ties import mesh_tie_key
from ..mesh import TriangleMesh
from ..text import plural
from .improve import shorten
from .key_paths import Fixed
from .open_mesh import NOTHING, OpenMesh, Reach, Terminals
from .shortest_paths import find_between
from .straighten import BENDING, Straightener

# Relative: on grids many paths are equally long, and rounding should not choose among them, lest the result
# depend on the numbering. Far above rounding, far below what anyone would see in a seam.
TIE_BREAK = 1e-7
# How often the whole mesh may be searched, all in all, until seams are short, and until they are straight; and so many
# vertices more, which take little time. A dozen cones need no more, hundreds on a small mesh could go on for long.
SHORTEN, STRAIGHTEN, SPARE = 6, 9, 50_000
# With much more, one avoided edge that needs turns could cost more than two without.
MOST_BENDING = 0.25


def find_seams(
    mesh: TriangleMesh,
    cones: IntArray,
    edge_costs: FloatArray,
    is_avoided: BoolArray | None = None,
    *,
    required: IntArray = NOTHING,
    forbidden: IntArray = NOTHING,
    bending: float = BENDING,
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
        bending: a seam that turns by a right angle at every vertex is taken for longer by this part of its length;
            0 to 0.25. Of paths that are nearly equally short the straighter are preferred.

    Raises:
        SeamError: every set of seams needs forbidden edges; or edges are both required and forbidden.
        OptionError: `bending` is none, or costs are no positive numbers.
    """
    if not 0 <= bending <= MOST_BENDING:
        raise OptionError(f"bending must be a number from 0 to {MOST_BENDING:g}, not {bending:g}")
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

    work = OpenMesh(mesh, costs, mesh.is_boundary_edge | is_required)
    fixed = _fixed(work, cones)
    _open(work, fixed, int(np.argmax(key)))
    if work.cut.any():
        shorten(work, fixed, SHORTEN * len(mesh.vertices) + SPARE)
        if bending > 0:
            Straightener(work, float(bending)).straighten(fixed, STRAIGHTEN * len(mesh.vertices) + SPARE)
    seams = _as_slit(mesh, costs, work.cut[mesh.edge_halfedges[:, 0]] & ~mesh.is_boundary_edge)
    _refuse(seams & is_forbidden, "needed to open the mesh, but forbidden as seams")
    return np.flatnonzero(seams)


def _checked(costs: FloatArray, count: int) -> FloatArray:
    """Return (e,) costs, brought to a size at which their sums are finite where they are not."""
    if np.shape(costs) != (count,) or not (np.isfinite(costs).all() and (costs > 0).all()):
        raise OptionError(f"costs of edges must be {count:,} positive numbers")
    return at_safe_scale(np.asarray(costs, dtype=np.float64))


def _refuse(edges: BoolArray, what: str) -> None:
    count = int(edges.sum())
    if count:
        raise SeamError(f"{plural(count, 'edge')} of {len(edges):,} {'is' if count == 1 else 'are'} {what}")


def _fixed(work: OpenMesh, cones: IntArray) -> Fixed:
    """Return what the border is before there are seams, and the cones off it."""
    on_border, is_cone = np.zeros((2, len(work.height)), dtype=bool)
    on_border[work.tail[work.cut]] = on_border[work.mesh.heads[work.cut]] = True
    is_cone[cones] = True
    return Fixed(work.cut.copy(), on_border, is_cone & ~on_border)


def _open(work: OpenMesh, fixed: Fixed, base: int) -> None:
    """Cut a mesh to disks. Seams of a surface with handles meet at `base` if there is nothing else to meet at."""
    points = np.flatnonzero(fixed.cones)
    if not len(points) and not work.cut.any():
        points = np.array([base])
    connect_terminals(work, work.label_terminals(points))
    # A point that is still alone had nothing to be connected to.
    terminals = work.label_terminals(points)
    if handle_count(work, terminals):
        open_handles(work, terminals)


def _as_slit(mesh: TriangleMesh, costs: FloatArray, seams: BoolArray) -> BoolArray:
    """Return seams that a mesh can be cut along: a slit of one edge would have the same vertices on both sides."""
    if seams.sum() != 1 or mesh.is_boundary_edge.any():
        return seams
    beside = np.isin(mesh.edges, mesh.edges[seams]).sum(axis=1) == 1
    longer = seams.copy()
    longer[np.argmin(np.where(beside, costs, np.inf))] = True
    return longer


def connect_terminals(work: OpenMesh, terminals: Terminals) -> None:
    """Cut along trees that connect the terminals of each piece, at most twice as long as the shortest.

    K. Mehlhorn, "A faster approximation algorithm for the Steiner problem in graphs", 1988: one search from all
    terminals at once, then a minimum spanning tree over the cheapest bridges between their regions.
    """
    reach = work.search(terminals, terminals.around, np.zeros(len(terminals.around)))
    bridges, one, two = find_between(
        work.mesh.edge_halfedges, work.cut, work.twin, work.tail, terminals.number, reach.origin
    )
    regions = MultiGraph(terminals.count, one, two, _costs_over(work, reach, bridges))
    _cut_over(work, bridges[regions.minimum_spanning_tree()], reach)
    work.forget(terminals, reach)


def handle_count(work: OpenMesh, terminals: Terminals) -> int:
    """Return the number of handles of an open mesh; `terminals` has one of each piece."""
    on_border = np.zeros(len(work.height), dtype=bool)
    on_border[work.tail[terminals.around]] = True
    vertices = len(on_border) - int(on_border.sum()) + terminals.count
    # A border curve is one vertex of a closed surface.
    return (2 * terminals.count - vertices + len(_bridges(work)) - len(work.mesh.faces)) // 2


def open_handles(work: OpenMesh, terminals: Terminals) -> None:
    """Cut the loops around handles that are shortest with the paths from there to the one terminal of each piece.

    These paths to all vertices are a spanning tree; one of the faces over the edges that are not in it leaves
    2 * genus edges (tree-cotree, D. Eppstein 2003), and takes those first that would close the longest loops
    (J. Erickson and K. Whittlesey 2005).
    """
    reach = work.search(terminals, terminals.around, np.zeros(len(terminals.around)))
    in_tree = np.zeros(len(work.tail), dtype=bool)
    before = work.slots[reach.before[reach.vertices]]
    in_tree[before] = in_tree[work.twin[before]] = True
    bridges = _bridges(work)
    bridges = bridges[~in_tree[bridges]]
    one, two = bridges // 3, work.twin[bridges] // 3
    dual = MultiGraph(len(work.mesh.faces), one, two, -_costs_over(work, reach, bridges))
    is_left = np.ones(len(bridges), dtype=bool)
    is_left[dual.minimum_spanning_tree()] = False
    _cut_over(work, bridges[is_left], reach)
    work.forget(terminals, reach)


def _bridges(work: OpenMesh) -> IntArray:
    """Return a half-edge of each edge off the border."""
    halfedges = work.mesh.edge_halfedges[:, 0]
    return halfedges[~work.cut[halfedges]]


def _costs_over(work: OpenMesh, reach: Reach, halfedges: IntArray) -> FloatArray:
    """Return the cost of the path over each half-edge from terminal to terminal."""
    distance = np.maximum(reach.distance, 0.0)
    ends = work.tail[halfedges], work.tail[work.twin[halfedges]]
    costs: FloatArray = work.cost[halfedges] + distance[ends[0]] + distance[ends[1]]
    return costs


def _cut_over(work: OpenMesh, bridges: IntArray, reach: Reach) -> None:
    """Cut the paths over bridges."""
    paths = [work.path_over(reach, side) for h in bridges.tolist() for side in (h, int(work.twin[h]))]
    work.cut_along(np.array([h for path in paths for h in path], dtype=np.int64))
