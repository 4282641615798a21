"""The linear model of a mesh, phi = phi_0 + sum_s k_s g_s: the data that do not depend on the cones."""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np
from scipy.sparse import csc_matrix

from ...base.arrays import BoolArray, FloatArray, IntArray, mask_of
from ...base.threads import concurrently
from ...stages import ConeSolution, LaplacianInverse
from ..solution import target_from_log_scale
from .coarse_model import CoarseModel, coarse_model
from .green import GreenOperator

# Number of vertices per unknown of the coarse model, and bounds of the number of unknowns, for which the dense inverse
# is cheaper than the factorization of the Laplacian of the mesh.
VERTICES_PER_UNKNOWN, MIN_SIZE, MAX_SIZE = 12, 600, 1200


class LinearModel:
    """The data shared by all sets of cones on a connected mesh; computed when first needed.

    Attributes:
        laplacian: (n, n) cotangent Laplacian.
        curvature: (n,) angle defect, radians.
        is_boundary: (n,) vertices with phi = 0 that absorb the remaining curvature.
        operator: the Laplacian of the inner vertices, factorized once.
        coarse_size: number of functions of the coarse basis.
    """

    def __init__(
        self,
        laplacian: csc_matrix,
        curvature: FloatArray,
        is_boundary: BoolArray,
        operator: GreenOperator,
        coarse_size: int,
    ) -> None:
        self.laplacian, self.curvature, self.is_boundary = laplacian, curvature, is_boundary
        self.operator, self.coarse_size = operator, coarse_size

    @classmethod
    def of(
        cls,
        laplacian: csc_matrix,
        curvature: FloatArray,
        share: FloatArray,
        is_boundary: BoolArray,
        tie_key: FloatArray,
        coarse_size: int | None = None,
    ) -> LinearModel:
        """Return the model of a mesh.

        Args:
            laplacian, curvature, is_boundary: see the class; without boundary vertices the mesh counts as closed.
            share: (n,) weight of each vertex in E; the sum is 1.
            tie_key: (n,) the unknowns are sorted by this key.
            coarse_size: number of functions of the coarse basis; None: by the number of unknowns.
        """
        operator = GreenOperator(laplacian, share, is_boundary, np.argsort(tie_key, kind="stable"))
        size = coarse_size or min(max(len(operator.vertices) // VERTICES_PER_UNKNOWN, MIN_SIZE), MAX_SIZE)
        return cls(laplacian, curvature, is_boundary, operator, size)

    def with_weights(self, share: FloatArray) -> LinearModel:
        """Return the model of the same mesh with other weights (n,) of the vertices; the factorization is shared."""
        operator = self.operator.with_weights(share)
        if operator is self.operator:
            return self
        return LinearModel(self.laplacian, self.curvature, self.is_boundary, operator, self.coarse_size)

    @property
    def inner(self) -> FloatArray:
        """(f,) curvature of the unknowns, radians."""
        return self.curvature[self.operator.vertices]

    @cached_property
    def log_scale(self) -> FloatArray:
        """(f,) phi_0, the log conformal factor without cones."""
        return -self.operator.solve(self.inner)

    @cached_property
    def distortion(self) -> float:
        """E without cones."""
        return float(np.sqrt(self.log_scale @ self.operator.weighted(self.log_scale)))

    @cached_property
    def score(self) -> FloatArray:
        """(f,) half the derivative of E^2 by the curvature of a cone at each unknown, without any cones."""
        return self.operator.solve(self.operator.weighted(self.log_scale))

    @cached_property
    def coarse(self) -> CoarseModel:
        """The kernel of E on a coarse basis."""
        operator = self.operator
        modelled = partial(coarse_model, operator, self.inner, self.coarse_size)
        # Computed during the factorization: saves 10 to 13% of the time of 29,000 to 97,000 triangles on two threads.
        with concurrently(modelled, 2 * len(operator.vertices)) as modelling:
            constant = self.distortion**2
            return modelling.result().scaled_to(constant)

    def solution_of(self, cones: IntArray, curvatures: FloatArray) -> ConeSolution:
        """Return the solution of cones at inner vertices (s,) with given curvatures (s,), radians."""
        operator, target = self.operator, np.zeros(len(self.curvature))
        target[cones] = curvatures
        log_scale = np.zeros(len(target))
        log_scale[operator.vertices] = operator.solve((target - self.curvature)[operator.vertices])
        absorbed = target_from_log_scale(self.laplacian, self.curvature, log_scale, self.is_boundary)
        is_zero = ~mask_of(len(target), operator.vertices)
        inverse = LaplacianInverse(operator.solve_at_vertices, self.laplacian, is_zero, operator.break_even)
        return ConeSolution(cones, target + absorbed, log_scale, inverse)
