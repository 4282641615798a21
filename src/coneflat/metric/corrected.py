"""Exact metrics whose holonomy along loops is a multiple of a quantum.

For given cones, an exactly conformal metric has no degree of freedom left, so its holonomy along the handles is
determined (Abel and Jacobi). To make it a multiple of a quantum, the conformal structure is changed: the edge lengths
are modified as little as possible.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray, has_any, mask_of
from ..errors import ConvergenceError
from ..geometry import corner_angles, double_areas
from ..geometry.handles import Holonomy, curvature_by_log_lengths, difference_from_multiple, edge_means
from ..geometry.straight import FlatTriangles
from ..geometry.triangles import slacks
from ..linalg import factorize
from ..mesh.connectivity import TriangleMesh, nearby
from ..stages import ConeSolution, FlatMetric

# Largest number of steps, and largest error in radians at the end; about six steps are needed for well-placed cones.
MAX_STEPS, TOLERANCE = 40, 1e-11
# Largest change of the log of a length in one step. After a larger change, the derivatives are computed again.
MAX_CHANGE = 0.5
# Smallest fraction of a step that is taken. Below it, triangles are close to degenerate and the search fails.
MIN_FRACTION = 1e-3
# Weight of scaling in the norm of a strain, relative to shear: nearly zero, as scaling can be undone conformally.
SCALING_WEIGHT = 1e-3
# Shear near cones changes the holonomy of loops most, as it has the effect of moving the cones; but it would be
# concentrated on few triangles. In this number of rings around cones, the weight of shear is divided by the weight
# of scaling.
CONE_RINGS = 3


def corrected_flat_metric(
    lengths: FloatArray,
    solution: ConeSolution,
    solve: Callable[[FloatArray, ConeSolution], FlatMetric],
    holonomy: Holonomy,
    quantum: float,
) -> FlatMetric:
    """Return a flat metric with the cones of a solution whose holonomy along loops is a multiple of a quantum.

    For each loop there is a change of edge lengths of least shear that rotates this loop and no other. Large changes
    are made in steps, unless more are needed than are left, or seem to be by how much the error has decreased in the
    last eight. Broyden's method is used for the last steps, on the few rotation angles.

    Args:
        lengths: (m, 3) side lengths.
        solution: cones, target curvatures and the linear log conformal factor.
        solve: returns the exact metric of other side lengths for cones.
        holonomy: of loops along the handles, and around the holes if the boundary is free.
        quantum: radians.

    Raises:
        ConvergenceError: the rotations did not converge to multiples of the quantum, or need too many steps.

    Notes:
        The unknowns are the rotation angles of the loops, fewer than a hundred, and the equations have no potential,
        so that `linalg.newton`, which decreases a convex function, does not apply.

    References:
        C. G. Broyden, "A class of methods for solving nonlinear simultaneous equations", 1965.
    """
    # The first error is the ninth.
    mesh, original_lengths, changes, errors = holonomy.mesh, lengths, None, 8 * [np.inf]
    off, inverse, step = np.empty(0), np.empty((0, 0)), np.empty(0)
    for left in range(MAX_STEPS, -1, -1):
        metric = solve(lengths, solution)
        triangles = triangles_of(metric)
        before, off = off, difference_from_multiple(holonomy.of_flat(triangles), quantum)
        errors.append(float(np.abs(off).max()))
        # With many loops, rounding leaves more: the errors then no longer decrease.
        is_rounding = errors[-2] < 2 * errors[-1] <= 200 * TOLERANCE
        if errors[-1] <= TOLERANCE or is_rounding:
            change = float(np.abs(np.log(lengths / original_lengths)).max())
            note = (
                f"Rotations around holes and along handles were off by up to {errors[8]:.2g} rad; edge lengths were "
                f"changed by up to {100 * change:.2g}% to make them multiples of {quantum:.4g} rad (quantise)."
            )
            return replace(metric, notes=(*metric.notes, note))
        if changes is None:
            sides = np.abs(triangles.sides).reshape(-1, 3)
            norm = shear_norm(mesh, lengths, solution.cones)
            changes, inverse = least_changes(holonomy, sides, norm, metric.is_open), np.eye(len(off))
        else:
            gained = inverse @ (off - before)
            inverse += np.outer(step - gained, step @ inverse) / (step @ gained)
        step = -inverse @ off
        fraction = min(1.0, MAX_CHANGE / np.abs(changes @ step).max())
        # More steps are needed, if all change lengths as much, or the error decreases as slowly as before.
        is_far = 1 / fraction > left or 8 * errors[-1] > left * (errors[-9] - errors[-1])
        sheared, fraction = _sheared(mesh, lengths, changes @ step, fraction)
        if is_far or fraction <= MIN_FRACTION:
            break
        lengths, changes = sheared, changes if fraction == 1 else None
        solution = replace(solution, log_scale=metric.log_scale - np.log(metric.scale))
    raise ConvergenceError(
        f"rotations around holes and along handles did not reach multiples of {quantum / np.pi:.4g} pi: they are off "
        f"by {errors[-1]:.2g} rad; other cones (--distortion, --cone-count) may help"
    )


def triangles_of(metric: FlatMetric) -> FlatTriangles:
    """Return the triangles of an exact metric."""
    assert metric.triangles is not None
    return metric.triangles


def _sheared(
    mesh: TriangleMesh, lengths: FloatArray, change: FloatArray, fraction: float
) -> tuple[FloatArray, float]:
    """Return (m, 3) side lengths changed by a fraction of a step, halved until triangles have area, and the fraction.

    Args:
        mesh, lengths: the mesh and its (m, 3) side lengths.
        change: (e,) change of the logs of edge lengths.
        fraction: the first fraction.
    """
    while True:
        sheared = lengths * np.exp((fraction * change)[mesh.halfedge_edges]).reshape(-1, 3)
        if fraction <= MIN_FRACTION or slacks(sheared).min() > 0:
            return sheared, fraction
        fraction /= 2


def least_changes(holonomy: Holonomy, sides: FloatArray, norm: csc_matrix, fixed: BoolArray) -> FloatArray:
    """Return (e, l) changes of the logs of edge lengths; each rotates one loop by one radian, to first order.

    Args:
        holonomy: of the l loops.
        sides: (m, 3) lengths in the current flat metric.
        norm: (e, e) matrix of the norm that is minimised.
        fixed: (n,) vertices with fixed conformal scale. The scale of the others compensates the change of curvature.
    """
    mesh = holonomy.mesh
    fixed = fixed.copy()
    fixed[0] |= not fixed.any()
    by_lengths = holonomy.by_log_lengths(sides)
    means = edge_means(mesh)[:, ~fixed]
    curvature = curvature_by_log_lengths(mesh, sides)[~fixed]
    by_scale = np.asarray((by_lengths @ means).todense()).T
    answer = factorize(csc_matrix(curvature @ means)).solve(np.ascontiguousarray(by_scale))
    slopes = np.asarray(by_lengths.todense()).T - curvature.T @ answer
    smoothed = factorize(norm).solve(slopes)
    return smoothed @ np.linalg.inv(slopes.T @ smoothed)


def shear_norm(mesh: TriangleMesh, lengths: FloatArray, cones: IntArray) -> csc_matrix:
    """Return (e, e) the matrix of the area integral of squared shear, for changes of the logs of edge lengths.

    In each triangle, the log of a side of direction t changes by m + a cos 2t + b sin 2t, where (a, b) is the shear.
    """
    angles = corner_angles(lengths)
    # Directions of sides 0, 1, 2 around the triangle; consecutive sides differ by the exterior angle.
    directions = np.stack(
        [np.zeros(len(angles)), np.pi - angles[:, 2], 2 * np.pi - angles[:, 2] - angles[:, 0]], axis=1
    )
    harmonics = np.stack([np.ones_like(directions), np.cos(2 * directions), np.sin(2 * directions)], axis=2)
    parts = np.linalg.inv(harmonics)  # (m, 3, 3): from the changes of the sides to m, a, b
    at_cones = has_any(mask_of(len(mesh.vertices), cones), mesh.faces)
    is_stiff = has_any(nearby(mesh.faces, at_cones, CONE_RINGS - 2), mesh.faces)
    areas = double_areas(lengths) * np.where(is_stiff, 1 / SCALING_WEIGHT, 1.0)
    norms = areas[:, None] * [SCALING_WEIGHT, 1.0, 1.0]
    blocks = np.einsum("fki,fk,fkj->fij", parts, norms, parts)
    edges = mesh.halfedge_edges.reshape(-1, 3)
    rows, columns = np.repeat(edges, 3, axis=1), np.tile(edges, (1, 3))
    shape = (len(mesh.edges), len(mesh.edges))
    return csc_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
