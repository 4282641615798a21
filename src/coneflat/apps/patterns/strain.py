"""Strain of layouts: the relative change of length of every edge, and layouts in which the largest one is small."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags, eye

from ... import TriangleMesh
from ...base import BoolArray, FloatArray, IntArray, check_cancelled, has_any, mask_of
from ...errors import MetricError
from ...geometry import double_areas, edge_lengths, signed_double_areas
from ...linalg import Factor, factorize

# Exponents of the strain whose sums are minimised one after the other. The last ones all but minimise the largest.
EXPONENTS = (2, 4, 8, 16, 32)
# Newton steps for each exponent; fewer are made where a step gains less than GAIN.
STEPS, GAIN = 8, 1e-3
# Weight of the squared strain beside the higher power, which alone would not hold points where nothing is strained.
QUADRATIC = 0.05
# Weight of the area term r + 1 / r - 2 of triangles whose area changes by a factor r: triangles that are about to flip
# would block all steps.
AREAS = 1e-2
# Weight of the squared difference of the strains of both sides of a seam.
EQUAL_SIDES = 1e5
# Relative size of what is added to the diagonal, as each piece may move freely.
REGULARISATION = 1e-7
# Halvings of a step until it flips no triangle and lowers the sum.
HALVINGS = 30
# Steps that make both sides of seams equally long; each squares the relative difference.
CLOSING_STEPS, CLOSED = 12, 1e-12


@dataclass(frozen=True, eq=False)
class FlatEdges:
    """The k edges of triangles in the plane; the two sides of a seam are different edges.

    Attributes:
        ends: (k, 2) their points, the smaller index first.
        lengths: (k,) their lengths on the surface.
        edges: (k,) the edge of the mesh of each of them.
        partners: (q, 2) the two sides of each of q seam edges, as indices of flat edges.
        double_areas: (m,) twice the areas of the triangles on the surface.
    """

    ends: IntArray
    lengths: FloatArray
    edges: IntArray
    partners: IntArray
    double_areas: FloatArray

    @classmethod
    def of(cls, mesh: TriangleMesh, corners: IntArray) -> FlatEdges:
        """Return the edges of a layout; corners: (m, 3) the point at each corner of the triangles of `mesh`."""
        sides = np.stack([corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]], axis=2).reshape(-1, 2)
        ends, first = np.unique(np.sort(sides, axis=1), axis=0, return_index=True)
        edges = mesh.halfedge_edges[first]
        tips = mesh.vertices[mesh.edges[edges]]
        order = np.argsort(edges, kind="stable")
        is_pair = edges[order[1:]] == edges[order[:-1]]
        partners = np.stack([order[:-1][is_pair], order[1:][is_pair]], axis=1)
        lengths = np.linalg.norm(tips[:, 1] - tips[:, 0], axis=1)
        return cls(ends, lengths, edges, partners, double_areas(edge_lengths(mesh.vertices, mesh.faces)))

    def around(self, is_free: BoolArray, is_triangle: BoolArray) -> FlatEdges:
        """Return the edges with free points (n,) and their partners; is_triangle: (m,) the triangles to keep."""
        has_free: BoolArray = has_any(is_free, self.ends)
        partners = self.partners[has_any(has_free, self.partners)]
        chosen = has_free | mask_of(len(has_free), partners)
        number = np.cumsum(chosen) - 1
        return FlatEdges(
            self.ends[chosen],
            self.lengths[chosen],
            self.edges[chosen],
            number[partners],
            self.double_areas[is_triangle],
        )

    def vectors(self, points: FloatArray) -> FloatArray:
        """Return (k, 2) the flat edges as vectors."""
        return points[self.ends[:, 1]] - points[self.ends[:, 0]]

    def strains(self, points: FloatArray) -> FloatArray:
        """Return (k,) the relative changes of length."""
        return np.linalg.norm(self.vectors(points), axis=1) / self.lengths - 1


@dataclass(frozen=True)
class Stretch:
    """How far a material may be strained.

    Attributes:
        warp: largest relative change of length along the grain, which is the second axis of the plane.
        weft: the same across the grain.

    Notes:
        In a direction at an angle t to the grain, it is warp cos^2 t + weft sin^2 t, as the strain of a fabric without
        shear would be.
    """

    warp: float
    weft: float

    def bounds(self, vectors: FloatArray) -> FloatArray:
        """Return (k,) the largest strains along vectors (k, 2)."""
        squares = vectors**2
        return (self.weft * squares[:, 0] + self.warp * squares[:, 1]) / squares.sum(axis=1)


def relative_strains(edges: FlatEdges, points: FloatArray, stretch: Stretch) -> FloatArray:
    """Return (k,) the strains divided by the bounds in their directions: from -1 to 1 where a material allows them."""
    return edges.strains(points) / stretch.bounds(edges.vectors(points))


def least_strain(
    edges: FlatEdges,
    corners: IntArray,
    points: FloatArray,
    stretch: Stretch,
    exponents: tuple[int, ...] = EXPONENTS,
    is_free: BoolArray | None = None,
) -> FloatArray:
    """Return points (n, 2) in the plane whose largest strain, relative to what a material allows, is small.

    No triangle is flipped, and both sides of seams become nearly equally long.

    Args:
        edges: the edges of the layout.
        corners: (m, 3) the points of its triangles.
        points: (n, 2) places without flipped triangles to start from.
        stretch: what the material allows.
        exponents: of the strain, whose sum over all edges, weighted by squared lengths, is minimised for each in turn.
        is_free: (n,) the points that move; None for all.

    Notes:
        Newton's method with the positive part of the Hessian. The bounds by direction are those at the start of a step.
    """
    if is_free is None:
        is_free = np.ones(len(points), dtype=bool)
    is_triangle = has_any(is_free, corners)
    edges, corners = edges.around(is_free, is_triangle), corners[is_triangle]
    moving = np.flatnonzero(np.repeat(is_free, 2))
    if not len(moving):
        return points
    factor: Factor | None = None
    matrix: csc_matrix | None = None
    for exponent in exponents:
        model = _PowerSum(edges, corners, stretch, exponent)
        for _ in range(STEPS):
            check_cancelled()
            bounds = stretch.bounds(edges.vectors(points))
            before = model.value(points, bounds)
            gradient, hessian = model.derivatives(points, bounds)
            matrix = _with_pattern_of(_regularised(hessian[moving][:, moving]), matrix)
            factor = factorize(matrix, factor)
            shift = np.zeros(gradient.size)
            shift[moving] = -factor.solve(gradient[moving])
            slope, step = float(gradient @ shift), shift.reshape(-1, 2)
            length = _step_length(model, points, bounds, step, slope)
            points = points + length * step
            if length == 0 or -slope < GAIN * before:
                break
    return points


class _PowerSum:
    """The sum of powers of the relative strain that is minimised."""

    def __init__(self, edges: FlatEdges, corners: IntArray, stretch: Stretch, exponent: int) -> None:
        self.edges, self.corners, self.stretch, self.exponent = edges, corners, stretch, exponent
        self.weights = edges.lengths**2 / np.mean(edges.lengths**2)
        first, second = edges.partners.T
        rows = np.tile(np.arange(len(first)), 2)
        signs = np.concatenate([np.ones(len(first)), -np.ones(len(first))])
        shape = len(first), len(edges.lengths)
        self.differences = csr_matrix((signs, (rows, np.concatenate([first, second]))), shape=shape)
        self.difference_weights = EQUAL_SIDES * self.weights[first]

    def value(self, points: FloatArray, bounds: FloatArray) -> float:
        """Return the sum."""
        strains = self.edges.strains(points) / bounds
        powers = QUADRATIC * strains**2 + np.abs(strains) ** self.exponent
        ratios = signed_double_areas(points[self.corners]) / self.edges.double_areas
        if not (ratios > 0).all():
            return np.inf
        areas = AREAS * float((ratios + 1 / ratios - 2).sum())
        return (
            float(self.weights @ powers + self.difference_weights @ (self.differences @ strains) ** 2) + areas
        )

    def derivatives(self, points: FloatArray, bounds: FloatArray) -> tuple[FloatArray, csr_matrix]:
        """Return (2n,) the gradient, and (2n, 2n) the positive part of the Hessian."""
        p, strains = self.exponent, self.edges.strains(points) / bounds
        size = np.abs(strains)
        slopes = self.weights * (2 * QUADRATIC * strains + p * size ** (p - 1) * np.sign(strains))
        curvatures = self.weights * (2 * QUADRATIC + p * (p - 1) * size ** (p - 2))
        scale = self.edges.lengths * bounds
        vectors = self.edges.vectors(points)
        norms = np.linalg.norm(vectors, axis=1)
        along = vectors / norms[:, None]
        change = self._jacobian(along / scale[:, None], len(points))
        rotation = self._jacobian(np.stack([-along[:, 1], along[:, 0]], axis=1), len(points))
        closing = self.differences @ change
        gradient = change.T @ slopes
        gradient += 2 * closing.T @ (self.difference_weights * (self.differences @ strains))
        of_areas, ratios = area_jacobian(self.corners, points, self.edges.double_areas)
        gradient += of_areas.T @ (AREAS * (1 - ratios**-2.0))
        hessian = (
            of_areas.T @ diags(2 * AREAS * ratios**-3.0) @ of_areas
            + change.T @ diags(curvatures) @ change
            + rotation.T @ diags(np.maximum(slopes / (scale * norms), 0)) @ rotation
            + closing.T @ diags(2 * self.difference_weights) @ closing
        )
        return gradient, hessian

    def _jacobian(self, along: FloatArray, count: int) -> csr_matrix:
        return edge_jacobian(self.edges.ends, along, count)


def edge_jacobian(ends: IntArray, along: FloatArray, count: int) -> csr_matrix:
    """Return (k, 2 count) the derivative of a quantity of edges that changes by `along` (k, 2) times their vector."""
    columns = (2 * ends[:, :, None] + np.arange(2)).reshape(-1)
    values = np.stack([-along, along], axis=1).reshape(-1)
    return csr_matrix((values, columns, np.arange(0, len(values) + 1, 4)), shape=(len(ends), 2 * count))


def area_jacobian(
    corners: IntArray, points: FloatArray, double_areas: FloatArray
) -> tuple[csr_matrix, FloatArray]:
    """Return the derivative (m, 2n) of the ratios of flat areas to those on the surface, and the ratios (m,)."""
    places = points[corners]
    opposite = places[:, [2, 0, 1]] - places[:, [1, 2, 0]]
    values = np.stack([-opposite[:, :, 1], opposite[:, :, 0]], axis=2) / double_areas[:, None, None]
    columns = (2 * corners[:, :, None] + np.arange(2)).reshape(-1)
    shape = len(corners), 2 * len(points)
    jacobian = csr_matrix((values.reshape(-1), columns, np.arange(0, columns.size + 1, 6)), shape=shape)
    return jacobian, signed_double_areas(places) / double_areas


def _regularised(hessian: csr_matrix) -> csc_matrix:
    diagonal = hessian.diagonal()
    matrix = csc_matrix(hessian + REGULARISATION * diagonal.mean() * eye(len(diagonal)))
    matrix.sort_indices()
    return matrix


def _with_pattern_of(matrix: csc_matrix, previous: csc_matrix | None) -> csc_matrix:
    """Return a matrix that shares the indices of the previous one if they are equal, so that its analysis serves."""
    if previous is not None and np.array_equal(matrix.indices, previous.indices):
        matrix.indices = previous.indices
    return matrix


def _step_length(
    model: _PowerSum,
    points: FloatArray,
    bounds: FloatArray,
    step: FloatArray,
    slope: float,
) -> float:
    """Return the length of a step that flips no triangle and lowers the sum, at most 1; 0 if there is none."""
    before, length = model.value(points, bounds), 1.0
    for _ in range(HALVINGS):
        moved = points + length * step
        if model.value(moved, bounds) <= before + 1e-4 * length * slope:
            return length
        length /= 2
    return 0.0


def with_equal_sides(edges: FlatEdges, corners: IntArray, points: FloatArray) -> FloatArray:
    """Return points (n, 2) nearest to those given for which both sides of every seam edge are equally long.

    Args:
        edges: the edges of the layout.
        corners: (m, 3) the points of its triangles.
        points: (n, 2) places in which they are nearly so, without flipped triangles.

    Raises:
        MetricError: there are none nearby, or a triangle would be flipped.

    Notes:
        Newton's method on the differences, each step the smallest one in the squared change of all lengths.
    """
    if not len(edges.partners):
        return points
    first, second = edges.partners.T
    lengths = edges.lengths[first]
    for _ in range(CLOSING_STEPS):
        vectors = edges.vectors(points)
        norms = np.linalg.norm(vectors, axis=1)
        gaps = (norms[first] - norms[second]) / lengths
        if np.abs(gaps).max() <= CLOSED:
            if (signed_double_areas(points[corners]) > 0).all():
                return points
            break
        along = vectors / norms[:, None]
        change = edge_jacobian(edges.ends, along / edges.lengths[:, None], len(points))
        closing = change[first] - change[second]
        points = points + _smallest_step(change, closing, gaps).reshape(-1, 2)
    raise MetricError("the two sides of seams could not be made equally long")


def _smallest_step(change: csr_matrix, closing: csr_matrix, gaps: FloatArray) -> FloatArray:
    """Return the step whose change of lengths is smallest among those that close the gaps, to first order.

    The multipliers of the gaps are found with a penalty that is raised: the matrix remains positive definite.
    """
    stiffness = change.T @ change
    penalty = 1e6
    matrix = csc_matrix(
        stiffness
        + penalty * (closing.T @ closing)
        + 1e-6 * stiffness.diagonal().mean() * eye(closing.shape[1])
    )
    matrix.sort_indices()
    factor = factorize(matrix)
    step, multipliers = np.zeros(closing.shape[1]), np.zeros(len(gaps))
    for _ in range(3):
        step = -factor.solve(closing.T @ (multipliers + penalty * gaps))
        multipliers = multipliers + penalty * (closing @ step + gaps)
    return step
