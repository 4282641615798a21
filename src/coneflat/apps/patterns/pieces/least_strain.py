"""Layouts in which the largest strain is small."""

from __future__ import annotations

import numpy as np

from ....base import BoolArray, FloatArray, IntArray, check_cancelled, has_any
from ....linalg import Factor, factorize
from .power_sum import PowerSum
from .strain import FlatEdges, Stretch, relative_strains

# Exponents of the strain whose sums are minimised one after the other. The last ones all but minimise the largest.
EXPONENTS = (2, 4, 8, 16, 32)
# Newton steps for each exponent; fewer are made where a step lowers the mean of the powers by less than this fraction
# of the strain.
STEPS, GAIN = 8, 3e-4
# Sum that counts as 0.
TINY = 1e-300
# Halvings of a step until it flips no triangle and lowers the sum, by this fraction of the linear decrease.
HALVINGS, ARMIJO = 30, 1e-4


def least_strain(
    edges: FlatEdges,
    corners: IntArray,
    points: FloatArray,
    stretch: Stretch,
    exponents: tuple[int, ...] = EXPONENTS,
    is_free: BoolArray | None = None,
    until_within: bool = False,
) -> FloatArray:
    """Return points (n, 2) in the plane whose largest strain, relative to what a material allows, is small.

    No triangle is flipped, and both sides of seams become nearly equally long.

    Args:
        edges: the edges of the layout.
        corners: (m, 3) the points of its triangles.
        points: (n, 2) places without flipped triangles to start from.
        stretch: what the material allows.
        exponents: of the strain, whose sum over all edges, weighted by squared lengths, is minimised for one after
            the other.
        is_free: (n,) the points that move; None for all.
        until_within: whether exponents are left out once all strains are within what the material allows.

    Notes:
        Newton's method with the positive part of the Hessian. The bounds by direction are those at the start of a step.
    """
    if is_free is None:
        is_free = np.ones(len(points), dtype=bool)
    is_triangle = has_any(is_free, corners)
    edges, corners = edges.around(is_free, is_triangle), corners[is_triangle]
    if not is_free.any():
        return points
    factor: Factor | None = None
    total = PowerSum(edges, corners, stretch, is_free)
    for exponent in exponents:
        if until_within and (np.abs(relative_strains(edges, points, stretch)) <= 1).all():
            break
        for _ in range(STEPS):
            check_cancelled()
            points, factor, gain = _after_step(total, points, exponent, factor)
            if gain < exponent * GAIN:
                break
    return points


def _after_step(
    total: PowerSum, points: FloatArray, exponent: int, factor: Factor | None
) -> tuple[FloatArray, Factor, float]:
    """Return the points after a Newton step, the factor of its matrix, and the relative gain that was predicted.

    The gain is 0 if no step flips no triangle and lowers the sum.
    """
    bounds = total.stretch.bounds(total.edges.vectors(points))
    before = total.value(points, bounds, exponent)
    gradient, hessian = total.derivatives(points, bounds, exponent)
    factor = factorize(hessian, factor)
    change = -factor.solve(gradient)
    step, slope = np.zeros_like(points), float(gradient @ change)
    step[total.is_free] = change.reshape(-1, 2)
    length = 1.0
    for _ in range(HALVINGS):
        after = points + length * step
        if total.value(after, bounds, exponent) <= before + ARMIJO * length * slope:
            return after, factor, -slope / max(before, TINY)
        length /= 2
    return points, factor, 0.0
