"""The first seams of a mesh: they open it to disks, and are not yet short."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..graph import MultiGraph
from .open_mesh import Circles, OpenMesh, Reach


def connect_circles(work: OpenMesh, circles: Circles) -> None:
    """Cut along trees that connect the circles of each piece, at most twice as long as the shortest.

    K. Mehlhorn, "A faster approximation algorithm for the Steiner problem in graphs", 1988: one search from all
    circles at once, then a minimum spanning tree over the cheapest bridges between their regions.
    """
    reach = work.search(circles, circles.around, np.zeros(len(circles.around)))
    bridges = _bridges(work)
    one, two = (_regions(work, circles, reach, side) for side in (bridges, work.twin[bridges]))
    between = one != two
    bridges = bridges[between]
    regions = MultiGraph(circles.count, one[between], two[between], _costs_over(work, reach, bridges))
    _cut_over(work, bridges[regions.minimum_spanning_tree()], reach)
    work.forget(circles, reach)


def handle_count(work: OpenMesh, circles: Circles) -> int:
    """Return the number of handles of an open mesh; `circles` has one of each piece."""
    on_border = np.zeros(len(work.height), dtype=bool)
    on_border[work.tail[circles.around]] = True
    vertices = len(on_border) - int(on_border.sum()) + circles.count
    # A border curve is one vertex of a closed surface.
    return (2 * circles.count - vertices + len(_bridges(work)) - len(work.mesh.faces)) // 2


def open_handles(work: OpenMesh, circles: Circles) -> None:
    """Cut the loops around handles that are shortest with the ways from there to the one circle of each piece.

    These ways to all vertices are a spanning tree; one of the faces over the edges that are not in it leaves
    2 * genus edges (tree-cotree, D. Eppstein 2003), and takes those first that would close the longest loops
    (J. Erickson and K. Whittlesey 2005).
    """
    reach = work.search(circles, circles.around, np.zeros(len(circles.around)))
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
    work.forget(circles, reach)


def _bridges(work: OpenMesh) -> IntArray:
    """Return a half-edge of each edge off the border."""
    halfedges = work.mesh.edge_halfedges[:, 0]
    return halfedges[~work.cut[halfedges]]


def _regions(work: OpenMesh, circles: Circles, reach: Reach, halfedges: IntArray) -> IntArray:
    """Return the circle that is nearest to the vertex that each half-edge leaves."""
    circle = circles.number[halfedges]
    return np.where(circle < 0, reach.origin[work.tail[halfedges]], circle)


def _costs_over(work: OpenMesh, reach: Reach, halfedges: IntArray) -> FloatArray:
    """Return the cost of the way over each half-edge from circle to circle."""
    distance = np.maximum(reach.distance, 0.0)
    ends = work.tail[halfedges], work.tail[work.twin[halfedges]]
    costs: FloatArray = work.cost[halfedges] + distance[ends[0]] + distance[ends[1]]
    return costs


def _cut_over(work: OpenMesh, bridges: IntArray, reach: Reach) -> None:
    """Cut the ways over bridges."""
    ways = [work.way_over(reach, side) for h in bridges.tolist() for side in (h, int(work.twin[h]))]
    work.cut_along(np.array([h for way in ways for h in way], dtype=np.int64))
