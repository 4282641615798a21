"""A nearly symmetric mesh parted by a curve of edges along its plane of symmetry."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from .._arrays import BoolArray, FloatArray, IntArray
from ..mesh import TriangleMesh, label_components
from .mirror import Mirror

# Triangles may change sides that are so many mean edges from the plane at most.
BAND = 3.0
# Edges that are avoided cost so many times as much; and capacities are whole numbers up to this for the mean edge.
AVOIDED, UNIT = 100, 1000


def part_halves(
    mesh: TriangleMesh, mirror: Mirror, edge_costs: FloatArray, is_avoided: BoolArray
) -> BoolArray | None:
    """Return (m,) whether each face is on the left of a curve of edges near the plane of symmetry; None without one.

    Where edges lie in the plane, it is these. Else the cheapest curve is taken: a minimum cut of the dual graph near
    the plane, edges being dearer the farther they are from it.

    Args:
        mesh: connected.
        mirror: its plane of symmetry.
        edge_costs: (e,) positive.
        is_avoided: (e,) edges that should not be part of the curve.
    """
    height = mirror.height[mesh.faces]
    is_left = height.sum(axis=1) > 0
    if ((height > 0).any(axis=1) & (height < 0).any(axis=1)).any() or (height == 0).all(axis=1).any():
        is_left = _cut_band(mesh, mirror, edge_costs, is_avoided)
    is_left = _without_islands(mesh, is_left)
    return is_left if _sides(mesh, is_left)[0] == 2 else None


def _cut_band(mesh: TriangleMesh, mirror: Mirror, edge_costs: FloatArray, is_avoided: BoolArray) -> BoolArray:
    """Return (m,) the faces on the left of the cheapest curve near the plane."""
    ends = mirror.height[mesh.edges]
    reach = np.abs(ends[:, 0] - ends[:, 1]).mean()
    middle = mirror.height[mesh.faces].mean(axis=1)
    # Nodes: 0 for all that is left of the band, 1 for all that is right of it, then the faces in it.
    node = np.where(middle > 0, 0, 1)
    inside = np.flatnonzero(np.abs(middle) <= BAND * reach)
    node[inside] = 2 + np.arange(len(inside))
    glued = ~mesh.is_boundary_edge
    one, two = node[mesh.edge_faces[glued]].T
    off = np.abs(ends[glued]).mean(axis=1) / reach
    costs = edge_costs[glued] * (1 + off**2) * np.where(is_avoided[glued], AVOIDED, 1)
    capacity = np.clip(UNIT * costs / edge_costs.mean(), 1, 2**20).astype(np.int32)
    apart = one != two
    one, two, capacity = one[apart], two[apart], capacity[apart]
    count = len(inside) + 2
    ways = np.concatenate([one, two]), np.concatenate([two, one])
    graph = csr_matrix((np.tile(capacity, 2), ways), shape=(count, count), dtype=np.int32)
    graph.sum_duplicates()
    residual = graph - maximum_flow(graph, 0, 1).flow
    residual.data[residual.data < 0] = 0
    residual.eliminate_zeros()
    reached = np.zeros(count, dtype=bool)
    reached[breadth_first_order(residual, 0, return_predecessors=False)] = True
    left: BoolArray = reached[node]
    return left


def _sides(mesh: TriangleMesh, is_left: BoolArray) -> tuple[int, IntArray]:
    """Return the connected parts of the two sides, and (m,) the part of each face."""
    faces = mesh.edge_faces[~mesh.is_boundary_edge]
    faces = faces[is_left[faces[:, 0]] == is_left[faces[:, 1]]]
    return label_components(len(is_left), faces[:, 0], faces[:, 1])


def _without_islands(mesh: TriangleMesh, is_left: BoolArray) -> BoolArray:
    """Return sides of which what hangs together neither with most of the left nor with most of the right changed."""
    count, part = _sides(mesh, is_left)
    if count <= 2:
        return is_left
    sizes = np.bincount(part, minlength=count)
    own = np.zeros(count, dtype=bool)
    own[part] = is_left
    keep = [int(np.argmax(np.where(own == side, sizes, -1))) for side in (False, True)]
    return np.where(np.isin(part, keep), is_left, ~is_left)
