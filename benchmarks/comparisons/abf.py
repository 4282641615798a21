"""Angle based flattening with cones: ABF++, and its linear approximation.

The conditions under which corner angles are those of a flat metric (A. Sheffer, E. de Sturler, "Parameterization of
faceted surfaces for meshing using angle-based flattening", 2001) are stated there for a disk. They are local, so they
extend to cones and to any topology.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags, vstack

from coneflat import TriangleMesh
from coneflat.base import FloatArray, IntArray, plural
from coneflat.base.text import error_text
from coneflat.errors import ConvergenceError, CurvatureError
from coneflat.geometry import corner_angles, halfedge_twins
from coneflat.geometry.handles import handle_loops
from coneflat.geometry.planar import as_pairs
from coneflat.layout import far_pins, pinned_least_squares
from coneflat.linalg import factorize
from coneflat.mesh import NEXT, PREVIOUS
from coneflat.stages import ConeSolution, Cut, Embedding, FlatMetric, SolveStatistics

from .disk_maps import embedding_metric

# Lower bound of angles, radians: those of needles can be rounded to 0, but their logs and relative squares must be
# finite.
MIN_ANGLE = 1e-8
# Angle in radians that replaces linear angles that are not positive, so that the shape of the triangle is finite.
LEAST_SHAPE = 1e-3
# ABF++: largest number of steps; tolerance of the conditions, radians and logs; and largest change of an angle by a
# further step. Conditions must hold accurately, but the minimum need not be found to the last digits.
STEPS, TOLERANCE, LAST_CHANGE = 100, 1e-9, 1e-6


#: Returns (3m,) angles, the number of Newton steps, and whether they converged, from conditions and target angles.
Solve: TypeAlias = Callable[["AngleConditions", FloatArray], tuple[FloatArray, int, bool]]


def angle_based(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    solve: Solve,
    is_free: bool = False,
) -> FlatMetric:
    """Return the angle based flattening of a mesh.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) its side lengths.
        solution: cones and their curvatures.
        solve: `linear_angles` or `nearest_angles`.
        is_free: cut first and prescribe nothing at cones and seams, as in 2008; seams are then a free boundary.
    """

    def embed(cut: Cut) -> Embedding:
        """Return the least squares reconstruction from angles, with the area of the mesh.

        Raises:
            ConvergenceError: the solver did not reach its tolerance.
            CurvatureError: the angle of a cone is too large for its triangles.
        """
        notes: list[str] = []
        solved_mesh, curvature = mesh, solution.target
        if is_free:
            solved_mesh, curvature = cut.mesh, np.zeros(len(cut.mesh.vertices))
            if len(cut.seams):
                notes.append(
                    "The mesh was cut first: the angles of cones, and lengths along seams, were left free."
                )
        conditions = angle_conditions(solved_mesh, curvature)
        angles, steps, converged = solve(
            conditions, target_angles(solved_mesh, corner_angles(lengths), curvature)
        )
        residual = conditions.residual(np.clip(angles, MIN_ANGLE, np.pi - MIN_ANGLE))
        if not converged:
            raise ConvergenceError(
                f"angle based flattening did not converge: the conditions on angles are {error_text(residual)} "
                f"after {plural(steps, 'step')}; method 'exact', other cones, a repair or remeshing may help"
            )
        by_triangle = angles.reshape(-1, 3)
        broken = int((by_triangle.min(axis=1) <= 0).sum())
        if broken:
            notes.append(f"{plural(broken, 'triangle')} with an angle below 0: method 'abf++' avoids this.")
        statistics = SolveStatistics(newton_steps=steps, residual=residual, broken=broken)
        return Embedding(least_squares_points(cut.mesh, by_triangle, lengths), statistics, tuple(notes))

    return embedding_metric(mesh, lengths, solution, embed, has_target_cones=not is_free)


def least_squares_points(disk: TriangleMesh, angles: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return (n, 2) points of a disk, up to a similarity, whose corner angles fit given ones (Section 5 of ABF++).

    Angles that are not positive are replaced by `LEAST_SHAPE`, and the largest angle is reduced accordingly.

    Args:
        disk: a topological disk.
        angles: (m, 3) radians, which sum to pi.
        lengths: (m, 3) side lengths, used to choose two distant pins.
    """
    rows = np.arange(len(angles))
    third = np.argmax(angles, axis=1)
    first, second = NEXT[third], PREVIOUS[third]
    first_angle, second_angle = (
        np.where(angle > 0, angle, LEAST_SHAPE) for angle in (angles[rows, first], angles[rows, second])
    )
    turn = np.sin(second_angle) / np.sin(first_angle + second_angle) * np.exp(1j * first_angle)
    values = np.stack([turn - 1, -turn, np.ones(len(rows))], axis=1)
    columns = disk.faces[rows[:, None], np.stack([first, second, third], axis=1)]
    equations = csr_matrix((values.ravel(), (np.repeat(rows, 3), columns.ravel())))
    return as_pairs(pinned_least_squares(equations, far_pins(disk, lengths)))


def nearest_angles(conditions: AngleConditions, targets: FloatArray) -> tuple[FloatArray, int, bool]:
    """Return the angles of a flat metric with the least sum of squared relative differences from target angles (ABF++).

    Newton's method for sum w (x - wanted)^2 / 2, w = 1 / wanted^2, with Lagrange multipliers, where each system is
    reduced to the multipliers of vertices. Logs replace products of sines: this makes the second derivative of the
    Lagrangian diagonal without approximation, and convergence quadratic where it stays positive.

    A step that would move angles more than half way to 0 or pi is shortened, and their weights are increased. The
    Lagrangian has a saddle point and no minimum, so a line search as in `linalg.newton` has no merit function.

    Args:
        conditions: the conditions on angles.
        targets: (3m,) target angles, radians, positive and less than pi.

    Returns:
        (3m,) radians; the number of Newton steps; and whether the angles converged.

    References:
        A. Sheffer, B. Levy, M. Mogilnitsky, A. Bogomyakov, "ABF++: fast and robust angle based flattening", 2005.
    """
    angles, weights = targets.copy(), targets**-2
    sums = len(conditions.totals)
    forces = np.zeros(sums + conditions.ratios.shape[0])
    residual = conditions.residual(angles)
    for count in range(STEPS + 1):
        # At least a tenth of the objective's second derivative remains, so that each step has a minimum.
        bend = -(conditions.ratios.T @ forces[sums:]) / np.sin(angles) ** 2
        step, pushed = least_change(
            conditions.slopes(angles),
            conditions.off(angles),
            excess_of(angles),
            np.maximum(weights + bend, 0.1 * weights),
            weights * (angles - targets),
        )
        change = float(np.abs(step).max())
        converged = residual <= TOLERANCE and change <= LAST_CHANGE
        if converged or count == STEPS or not np.isfinite(change):
            break
        bound = 0.5 * np.where(step < 0, angles, np.pi - angles)
        is_long = np.abs(step) > bound
        fraction = float((bound[is_long] / np.abs(step[is_long])).min(initial=1.0))
        weights[is_long] *= 2.0
        angles += fraction * step
        forces += fraction * (pushed - forces)
        residual = conditions.residual(angles)
    return angles, count, converged


def linear_angles(conditions: AngleConditions, targets: FloatArray) -> tuple[FloatArray, int, bool]:
    """Return the angles that satisfy the conditions to first order with the least relative change.

    The logarithm of the wheel condition is linearised at the target angles. With the linear conditions on sums around
    vertices and in triangles, this is a system A x = b for the changes x of the angles. With the diagonal matrix D of
    the target angles, the D^-1 x of least norm is D A^T (A D^2 A^T)^-1 b, which needs one solve. The angles can be
    negative, and satisfy the wheel conditions up to the square of the changes.

    Args:
        conditions: the conditions on angles.
        targets: (3m,) target angles, radians, positive and less than pi.

    Returns:
        The same as `nearest_angles`.

    References:
        R. Zayer, B. Levy, H.-P. Seidel, "Linear angle based parameterization", 2007.
    """
    off, slopes = conditions.off(targets), conditions.slopes(targets)
    change, _ = least_change(slopes, off, excess_of(targets), targets**-2, np.zeros_like(targets))
    return targets + change, 1, True


@dataclass(frozen=True, eq=False)
class AngleConditions:
    """The conditions on the (3m,) corner angles of a mesh, in addition to sums of pi in triangles.

    The sine of an angle is the length of the opposite side over the diameter of the circumcircle. So along a strip of
    triangles, the differences of log sines at the crossed edges add up to the change of size. This must be zero around
    a vertex (the wheel condition), along a handle and around a hole, also at cones. The conditions of inner vertices,
    handles and all holes but one are independent and imply the others. Without a boundary, the conditions of one vertex
    follow from the rest, both the angle sum (Gauss-Bonnet) and the wheel condition.

    Attributes:
        sums: (k, 3m) matrix with 1 for the angles around each inner vertex.
        totals: (k,) their sums: 2 pi, or the cone angle.
        ratios: (l, 3m) matrix of +1 and -1 for log sines that sum to zero.
    """

    sums: csr_matrix
    totals: FloatArray
    ratios: csr_matrix

    def off(self, angles: FloatArray) -> FloatArray:
        """Return (k + l,) the errors of the conditions: radians, and logs of ratios of lengths."""
        return np.concatenate([self.sums @ angles - self.totals, self.ratios @ np.log(np.sin(angles))])

    def residual(self, angles: FloatArray) -> float:
        """Return the largest error of the conditions, including the angle sums of triangles."""
        return float(np.abs(self.off(angles)).max(initial=np.abs(excess_of(angles)).max()))

    def slopes(self, angles: FloatArray) -> csr_matrix:
        """Return (k + l, 3m) the derivative of `off`."""
        return csr_matrix(vstack([self.sums, self.ratios @ diags(1 / np.tan(angles))]))


def excess_of(angles: FloatArray) -> FloatArray:
    """Return (m,) the angle sum of each triangle minus pi, for corner angles (3m,)."""
    return angles.reshape(-1, 3).sum(axis=1) - np.pi


def angle_conditions(mesh: TriangleMesh, curvature: FloatArray) -> AngleConditions:
    """Return the conditions for a flat metric with given curvatures at inner vertices; the boundary is free.

    Args:
        mesh: a connected mesh.
        curvature: (n,) radians; ignored on the boundary.
    """
    inside = np.flatnonzero(~mesh.is_boundary_vertex)
    if len(inside) == len(mesh.vertices):
        inside = inside[1:]
    shape = len(mesh.vertices), mesh.faces.size
    corners = np.arange(mesh.faces.size).reshape(-1, 3)
    ones = np.ones(corners.shape)
    at = mesh.faces.ravel()
    sums = csr_matrix((ones.ravel(), (at, corners.ravel())), shape=shape)
    ratios = csr_matrix(
        (
            np.concatenate([ones, -ones], axis=None),
            (np.tile(at, 2), np.concatenate([corners[:, NEXT], corners[:, PREVIOUS]], axis=None)),
        ),
        shape=shape,
    )
    loops = _strip_ratios(mesh, handle_loops(mesh, holes=True))
    return AngleConditions(
        sums[inside], 2 * np.pi - curvature[inside], csr_matrix(vstack([ratios[inside], loops]))
    )


def _strip_ratios(mesh: TriangleMesh, strips: list[IntArray]) -> csr_matrix:
    """Return (k, 3m) with +1 at the corner opposite each half-edge that a strip crosses, -1 opposite its twin."""
    crossed = np.concatenate([*strips, np.empty(0, dtype=np.int64)])
    rows = np.repeat(np.arange(len(strips)), [len(strip) for strip in strips])
    columns = np.concatenate([crossed, halfedge_twins(mesh)[crossed]])
    values = np.repeat([1.0, -1.0], len(crossed))
    return csr_matrix((values, (np.tile(rows, 2), columns)), shape=(len(strips), mesh.faces.size))


def target_angles(mesh: TriangleMesh, angles: FloatArray, curvature: FloatArray) -> FloatArray:
    """Return (3m,) the target angles: those of the mesh, scaled at each inner vertex to the prescribed sum.

    These are the optimal angles of angle based flattening (as in ABF++, Sheffer et al. 2005), with the cone angle
    instead of 2 pi at cones. If a scaled angle is pi or more, all angles at the vertex are equal instead.

    Args:
        mesh: the mesh.
        angles: (m, 3) angles of its triangles, radians.
        curvature: (n,) target curvature, radians.

    Raises:
        CurvatureError: a cone angle is 0, or at least pi times the number of its triangles.
    """
    at = mesh.faces.ravel()
    angles = np.maximum(angles, MIN_ANGLE)
    count = np.bincount(at, minlength=len(mesh.vertices))
    total = np.bincount(at, angles.ravel(), len(mesh.vertices))
    vertex_targets = np.where(mesh.is_boundary_vertex, total, 2 * np.pi - curvature)
    low = np.flatnonzero(vertex_targets <= MIN_ANGLE)
    if len(low):
        raise CurvatureError(
            f"{plural(len(low), 'cone')} whose angle is not positive: {vertex_targets[low[0]] / np.pi:.4g} pi; "
            "curvatures must be below 2 pi"
        )
    wide = np.flatnonzero(vertex_targets >= np.pi * count)
    if len(wide):
        worst = wide[0]
        raise CurvatureError(
            f"{plural(len(wide), 'cone')} with angles too large for the triangles around: {count[worst]} of them "
            f"cannot have an angle of {vertex_targets[worst] / np.pi:.4g} pi; choose others, or remesh"
        )
    scaled: FloatArray = angles.ravel() * (vertex_targets / total)[at]
    too_wide = np.zeros(len(count), dtype=bool)
    too_wide[at[scaled >= np.pi]] = True
    return np.where(too_wide[at], (vertex_targets / count)[at], scaled)


def least_change(
    slopes: csr_matrix, off: FloatArray, excess: FloatArray, stiffness: FloatArray, pull: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the x that minimises x.(stiffness x) / 2 + pull.x with slopes x = -off and triangle sums of pi.

    The condition of each triangle involves its three angles only, so it is eliminated with these. The remaining system
    is in the multipliers of vertices, two for each inner one (the reduction of ABF++, Sheffer et al. 2005). Its matrix
    is a sum of squares, two of them for the two directions in which the angles of a triangle can change.

    Args:
        slopes, off: (k, 3m) and (k,) the conditions.
        excess: (m,) angle sums of triangles minus pi.
        stiffness: (3m,) diagonal of the quadratic term, positive.
        pull: (3m,) linear term.

    Returns:
        (3m,) the change, and (k,) the Lagrange multipliers of the conditions.
    """
    i, j, k = stiffness.reshape(-1, 3).T
    pairs = i * j + j * k + k * i
    particular = -(np.stack([j * k, k * i, i * j], axis=1) * (excess / pairs)[:, None]).ravel()
    spoke = np.stack([j + k, -k, -j], axis=1) / np.sqrt(pairs * (j + k))[:, None]
    two = np.stack([np.zeros(len(i)), np.ones(len(i)), -np.ones(len(i))], axis=1) / np.sqrt(j + k)[:, None]
    columns = np.arange(2 * len(i)).repeat(3)
    rows = np.tile(np.arange(len(stiffness)), 2)
    directions = csr_matrix((np.concatenate([spoke, two], axis=None), (rows, columns)))
    half = csr_matrix(slopes @ directions)
    matrix = csc_matrix(half @ half.T)
    matrix.sort_indices()
    factor = factorize(matrix)
    pulled = directions.T @ pull
    right = off + slopes @ particular - half @ pulled
    forces = factor.solve(right)
    # One step of iterative refinement reduces rounding errors.
    forces += factor.solve(right - half @ (half.T @ forces))
    return particular - directions @ (pulled + half.T @ forces), forces
