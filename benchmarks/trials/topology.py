"""The topology of a triangle mesh in plain numpy, independent of the package to be checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


@dataclass(frozen=True, eq=False)
class Topology:
    """Edges and boundary of a mesh.

    Attributes:
        edges: (e, 2) vertices, the smaller first.
        count: (e,) faces at each edge.
        inner: (k,) edges of two faces.
        sides: (k, 2) their two half-edges; half-edge 3 f + i runs from corner i to corner i + 1 of face f.
        is_border: (n,) vertices on an edge of one face.
        is_used: (n,) vertices of a face.
        component: (n,) connected component of each vertex.
    """

    edges: np.ndarray
    count: np.ndarray
    inner: np.ndarray
    sides: np.ndarray
    is_border: np.ndarray
    is_used: np.ndarray
    component: np.ndarray

    def is_seam(self, uv_faces: np.ndarray) -> np.ndarray:
        """Return (k,) whether the sides of each inner edge have different points, (m, 3) those of the corners."""
        tails, heads = uv_faces.ravel(), np.roll(uv_faces, -1, axis=1).ravel()
        first, second = self.sides.T
        return (tails[first] != heads[second]) | (heads[first] != tails[second])

    def edge_of_halfedges(self, faces: np.ndarray) -> np.ndarray:
        """Return (3m,) the edge of each half-edge of the faces."""
        size = len(self.is_used)
        tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        keys = self.edges[:, 0] * size + self.edges[:, 1]
        return np.searchsorted(keys, np.minimum(tails, heads) * size + np.maximum(tails, heads))

    @classmethod
    def of(cls, faces: np.ndarray, vertices: int) -> Topology:
        tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        low, high = np.minimum(tails, heads), np.maximum(tails, heads)
        _, first, count = np.unique(low * vertices + high, return_index=True, return_counts=True)
        order = np.argsort(low * vertices + high, kind="stable")
        start = np.cumsum(count) - count
        inner = np.flatnonzero(count == 2)
        sides = np.stack([order[start[inner]], order[start[inner] + 1]], axis=1)
        edges = np.stack([low[first], high[first]], axis=1)
        is_border, is_used = np.zeros((2, vertices), dtype=bool)
        is_border[edges[count == 1]] = True
        is_used[faces] = True
        graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(vertices, vertices))
        return cls(edges, count, inner, sides, is_border, is_used, connected_components(graph, False)[1])

    def euler(self, faces: np.ndarray, component: int) -> int:
        """Return V - E + F of a component."""
        is_inside = self.component == component
        return int(
            (is_inside & self.is_used).sum()
            - is_inside[self.edges[:, 0]].sum()
            + is_inside[faces[:, 0]].sum()
        )

    def border_loops(self) -> list[np.ndarray]:
        """Return the vertices of each loop of the boundary, in no order."""
        border = self.edges[self.count == 1]
        size = len(self.is_border)
        graph = coo_matrix((np.ones(len(border)), border.T), shape=(size, size))
        label = connected_components(graph, False)[1]
        return [np.flatnonzero((label == loop) & self.is_border) for loop in np.unique(label[self.is_border])]
