"""The sum of powers of the strains of a layout, and its derivatives."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from ....base import BoolArray, FloatArray, IntArray
from ....geometry import signed_double_areas
from ....optimise import ElementPattern
from .strain import FlatEdges, Stretch

# Weight of the squared strain beside the higher power, which alone would not hold points where nothing is strained.
QUADRATIC = 0.05
# Weight of the area term r + 1 / r - 2 of triangles whose area changes by a factor r: triangles that are about to flip
# would block all steps.
AREAS = 1e-2
# Weight of the squared difference of the strains of both sides of a seam.
EQUAL_SIDES = 1e5
# Relative size of what is added to the diagonal, as each piece may move freely.
REGULARISATION = 1e-7


class PowerSum:
    """The sum over all edges of powers of the strain, relative to what a material allows, that is minimised.

    Its terms depend on the coordinates of an edge, of the corners of a triangle, or of both sides of a seam. These are
    its elements: each adds a square block to the Hessian.

    Args:
        edges: the edges of the layout.
        corners: (m, 3) the points of its triangles.
        stretch: what the material allows.
        is_free: (n,) the points that move.
    """

    def __init__(self, edges: FlatEdges, corners: IntArray, stretch: Stretch, is_free: BoolArray) -> None:
        self.edges, self.corners, self.stretch = edges, corners, stretch
        self.weights = edges.lengths**2 / np.mean(edges.lengths**2)
        self.difference_weights = EQUAL_SIDES * self.weights[edges.partners[:, 0]]
        self.is_free = is_free
        number = np.where(is_free, np.cumsum(is_free) - 1, is_free.sum())
        size = 2 * int(is_free.sum())
        unknown = np.minimum(2 * number[:, None] + np.arange(2), size)
        of_edges = unknown[edges.ends].reshape(-1, 4)
        of_seams = of_edges[edges.partners].reshape(-1, 8)
        of_triangles = unknown[corners].reshape(-1, 6)
        self.unknown = np.concatenate([part.ravel() for part in (of_edges, of_seams, of_triangles)])
        sizes = np.repeat([4, 8, 6], [len(of_edges), len(of_seams), len(of_triangles)])
        self.pattern = ElementPattern.of(np.concatenate([[0], np.cumsum(sizes)]), self.unknown, size)
        # Blocks' entries of points that do not move are added to one after the last entry.
        self.slots = np.where(self.pattern.slots < 0, self.pattern.matrix.nnz, self.pattern.slots)

    def value(self, points: FloatArray, bounds: FloatArray, exponent: int) -> float:
        """Return the sum, infinite if a triangle is flipped.

        Args:
            points: (n, 2) the points.
            bounds: (k,) the largest strain of each edge.
            exponent: of the strain.
        """
        ratios = signed_double_areas(points[self.corners]) / self.edges.double_areas
        if not (ratios > 0).all():
            return np.inf
        strains = self.edges.strains(points) / bounds
        powers = QUADRATIC * strains**2 + np.abs(strains) ** exponent
        of_seams = self.difference_weights @ self._differences(strains) ** 2
        return float(self.weights @ powers + of_seams + AREAS * (ratios + 1 / ratios - 2).sum())

    def derivatives(
        self, points: FloatArray, bounds: FloatArray, exponent: int
    ) -> tuple[FloatArray, csc_matrix]:
        """Return (2f,) the gradient by the coordinates of the free points, and the positive part of the Hessian.

        Arguments as of `value`. The matrix is the same one each time, with other entries.
        """
        p, strains = exponent, self.edges.strains(points) / bounds
        size = np.abs(strains)
        slopes = self.weights * (2 * QUADRATIC * strains + p * size ** (p - 1) * np.sign(strains))
        curvatures = self.weights * (2 * QUADRATIC + p * (p - 1) * size ** (p - 2))
        scale = self.edges.lengths * bounds
        vectors = self.edges.vectors(points)
        norms = np.linalg.norm(vectors, axis=1)
        along = vectors / norms[:, None]
        change = _by_ends(along / scale[:, None])
        rotation = _by_ends(np.stack([-along[:, 1], along[:, 0]], axis=1))
        first, second = self.edges.partners.T
        closing = np.concatenate([change[first], -change[second]], axis=1)
        of_areas, ratios = self._area_changes(points)
        closing_slopes = 2 * self.difference_weights * self._differences(strains)
        area_slopes = AREAS * (1 - ratios**-2.0)
        gradients = (
            change * slopes[:, None],
            closing * closing_slopes[:, None],
            of_areas * area_slopes[:, None],
        )
        turns = np.maximum(slopes / (scale * norms), 0)
        blocks = (
            _squares(change, curvatures) + _squares(rotation, turns),
            _squares(closing, 2 * self.difference_weights),
            _squares(of_areas, 2 * AREAS * ratios**-3.0),
        )
        return self._gradient(gradients), self._hessian(blocks)

    def _differences(self, strains: FloatArray) -> FloatArray:
        """Return (q,) the differences of the strains of both sides of seam edges."""
        first, second = self.edges.partners.T
        return strains[first] - strains[second]

    def _area_changes(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the ratios (m,) of areas to those on the surface, and before them their derivatives (m, 6)."""
        places = points[self.corners]
        opposite = places[:, [2, 0, 1]] - places[:, [1, 2, 0]]
        values = np.stack([-opposite[:, :, 1], opposite[:, :, 0]], axis=2)
        values /= self.edges.double_areas[:, None, None]
        return values.reshape(-1, 6), signed_double_areas(places) / self.edges.double_areas

    def _gradient(self, parts: tuple[FloatArray, ...]) -> FloatArray:
        size = self.pattern.matrix.shape[0]
        values = np.concatenate([part.ravel() for part in parts])
        return np.asarray(np.bincount(self.unknown, values, size + 1)[:size], dtype=np.float64)

    def _hessian(self, blocks: tuple[FloatArray, ...]) -> csc_matrix:
        matrix = self.pattern.matrix
        values = np.concatenate([block.ravel() for block in blocks])
        matrix.data = np.bincount(self.slots, values, matrix.nnz + 1)[:-1]
        diagonal = self.pattern.diagonal
        matrix.data[diagonal] += REGULARISATION * matrix.data[diagonal].mean()
        return matrix


def _by_ends(along: FloatArray) -> FloatArray:
    """Return (k, 4) the derivatives by the ends of edges of what changes by `along` (k, 2) times the vector."""
    return np.concatenate([-along, along], axis=1)


def _squares(rows: FloatArray, weights: FloatArray) -> FloatArray:
    """Return (k, s, s) the products of rows (k, s) with themselves, times weights (k,)."""
    return (weights[:, None] * rows)[:, :, None] * rows[:, None, :]
