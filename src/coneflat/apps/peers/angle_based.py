"""Angle based flattening with cones: ABF++, and its linear approximation.

The conditions under which corner angles are those of a flat metric (A. Sheffer, E. de Sturler, "Parameterization of
faceted surfaces for meshing using angle-based flattening", 2001) are stated for a disk there. They are local, so that
cones and any topology fit in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags, vstack

from ... import TriangleMesh
from ...base import FloatArray, IntArray, plural
from ...errors import CurvatureError
from ...geometry import corner_angles, halfedge_twins, handle_loops
from ...layout import fit_shapes, shapes_of_angles
from ...linalg import factorize
from ...mesh import NEXT, PREVIOUS
from ...stages import ConeSolution, Cut, Embedding, FlatMetric, SolveStatistics
from .shared import embedding_metric, failure_notes

# Smaller angles, radians, are rounded to 0 in needles; their logs and relative squares are to be finite.
LEAST_ANGLE = 1e-8
# ABF++: steps at most; what conditions may be off by in the end, radians and logs; and the largest change of an angle
# that another step would make: conditions are to hold exactly, while a minimum need not be found to the last digits.
STEPS, TOLERANCE, LAST_CHANGE = 100, 1e-9, 1e-6


#: Returns (3m,) angles, Newton steps, and whether they converged, from conditions and wanted angles.
Solve: TypeAlias = Callable[["AngleConditions", FloatArray], tuple[FloatArray, int, bool]]


def angle_based(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    solve: Solve,
    best_effort: bool = False,
    is_free: bool = False,
) -> FlatMetric:
    """Return the angle based flattening of a mesh.

    Args:
        mesh: connected.
        lengths: (m, 3) its side lengths.
        solution: cones and their curvatures.
        solve: `linear_angles`, or `nearest_angles`.
        best_effort: take angles that did not converge.
        is_free: cut first and prescribe nothing at cones and seams, as in 2008; the seams are a free boundary then.
    """

    def embed(cut: Cut) -> Embedding:
        """Return the least squares reconstruction, at the mesh's area.

        Raises:
            ConvergenceError: the solve ends short of its tolerance, unless `best_effort`.
            CurvatureError: a cone is too wide for its triangles.
        """
        notes: list[str] = []
        whole, curvature = mesh, solution.target
        if is_free:
            whole, curvature = cut.mesh, np.zeros(len(cut.mesh.vertices))
            if len(cut.seams):
                notes.append(
                    "The mesh was cut first: the angles of cones, and lengths along seams, were left free."
                )
        conditions = angle_conditions(whole, curvature)
        angles, steps, converged = solve(conditions, wanted_angles(whole, corner_angles(lengths), curvature))
        residual = conditions.residual(np.clip(angles, LEAST_ANGLE, np.pi - LEAST_ANGLE))
        if not converged:
            what = "angle based flattening did not converge: the conditions on angles are"
            notes += failure_notes(what, steps, residual, "", best_effort)
        shapes = shapes_of_angles(angles.reshape(-1, 3))
        broken = int(shapes.is_broken.sum())
        if broken:
            notes.append(f"{plural(broken, 'triangle')} got an angle below 0: method 'abf++' allows none.")
        statistics = SolveStatistics(newton_steps=steps, residual=residual, broken=broken)
        return Embedding(fit_shapes(cut.mesh, shapes, lengths), statistics, tuple(notes))

    return embedding_metric(mesh, lengths, solution, embed, holds_cones=not is_free)


def nearest_angles(conditions: AngleConditions, wanted: FloatArray) -> tuple[FloatArray, int, bool]:
    """Return the angles of a flat metric whose differences from those wanted have the least sum of relative squares.

    ABF++ (A. Sheffer, B. Levy, M. Mogilnitsky, A. Bogomyakov, "ABF++: fast and robust angle based flattening", 2005):
    Newton's method for sum w (x - wanted)^2 / 2, w = 1 / wanted^2, with Lagrange multipliers, each system reduced to
    the multipliers of vertices. Products of sines are taken by their logs here: that makes the second derivative of
    the Lagrangian diagonal with nothing neglected, and convergence quadratic where it stays positive.

    A step that would take angles more than half way to 0 or pi is shortened to that, and their weights grow. The
    Lagrangian has a saddle point and no minimum, so that a line search as in `linalg.newton` would have no measure.

    Args:
        conditions: to be fulfilled.
        wanted: (3m,) radians, positive and less than pi.

    Returns:
        (3m,) radians; Newton steps; and whether the angles are what was sought.
    """
    angles, weights = wanted.copy(), wanted**-2
    sums = len(conditions.totals)
    forces = np.zeros(sums + conditions.ratios.shape[0])
    residual = conditions.residual(angles)
    for count in range(STEPS + 1):
        # A part of the objective's own second derivative is kept at least, so that each step has a minimum.
        bend = -(conditions.ratios.T @ forces[sums:]) / np.sin(angles) ** 2
        step, pushed = least_change(
            conditions.slopes(angles),
            conditions.off(angles),
            excess_of(angles),
            np.maximum(weights + bend, 0.1 * weights),
            weights * (angles - wanted),
        )
        change = float(np.abs(step).max())
        converged = residual <= TOLERANCE and change <= LAST_CHANGE
        if converged or count == STEPS or not np.isfinite(change):
            break
        room = 0.5 * np.where(step < 0, angles, np.pi - angles)
        goes_far = np.abs(step) > room
        part = float((room[goes_far] / np.abs(step[goes_far])).min(initial=1.0))
        weights[goes_far] *= 2.0
        angles += part * step
        forces += part * (pushed - forces)
        residual = conditions.residual(angles)
    return angles, count, converged


def linear_angles(conditions: AngleConditions, wanted: FloatArray) -> tuple[FloatArray, int, bool]:
    """Return the angles that fulfil the conditions to first order with the least relative change.

    R. Zayer, B. Levy, H.-P. Seidel, "Linear angle based parameterization", 2007: the logarithm of the wheel condition
    is expanded about the wanted angles. With the sums around vertices and in triangles, which are linear, it makes a
    system A x = b in the errors x of these angles; with D, diagonal, of the angles themselves, the D^-1 x of least
    norm is D A^T (A D^2 A^T)^-1 b: one solve. The angles are not bound to be positive, and fulfil wheel
    conditions up to the square of the errors.

    Args:
        conditions: to be fulfilled.
        wanted: (3m,) radians, positive and less than pi.

    Returns:
        As `nearest_angles`.
    """
    off, slopes = conditions.off(wanted), conditions.slopes(wanted)
    change, _ = least_change(slopes, off, excess_of(wanted), wanted**-2, np.zeros_like(wanted))
    return wanted + change, 1, True


@dataclass(frozen=True, eq=False)
class AngleConditions:
    """What the (3m,) corner angles of a mesh have to fulfil, apart from summing to pi in triangles.

    A sine is the length of the side opposite, over the diameter of the triangle's circumcircle. So along a strip of
    triangles, log sines before and behind each edge that is crossed add up to what the size changes by; it must not
    change around a vertex (the wheel condition), a handle, or a hole. A cone makes no difference to that. Those around
    inner vertices, handles and all holes but one are independent and imply the others; without a boundary, one
    vertex follows from the rest, for angle sums (Gauss-Bonnet) and wheels alike.

    Attributes:
        sums: (k, 3m) the angles around each inner vertex, with 1.
        totals: (k,) what they sum to: 2 pi, or the angle of the cone.
        ratios: (l, 3m) of +1 and -1, of log sines that sum to zero.
    """

    sums: csr_matrix
    totals: FloatArray
    ratios: csr_matrix

    def off(self, angles: FloatArray) -> FloatArray:
        """Return (k + l,) by how much angles fail: radians, and logs of ratios of lengths."""
        return np.concatenate([self.sums @ angles - self.totals, self.ratios @ np.log(np.sin(angles))])

    def residual(self, angles: FloatArray) -> float:
        """Return the largest of what the conditions, those on triangles among them, are off by."""
        return float(np.abs(self.off(angles)).max(initial=np.abs(excess_of(angles)).max()))

    def slopes(self, angles: FloatArray) -> csr_matrix:
        """Return (k + l, 3m) the derivative of `off`."""
        return csr_matrix(vstack([self.sums, self.ratios @ diags(1 / np.tan(angles))]))


def excess_of(angles: FloatArray) -> FloatArray:
    """Return (m,) what triangles with (3m,) corner angles have in excess of half a turn."""
    return angles.reshape(-1, 3).sum(axis=1) - np.pi


def angle_conditions(mesh: TriangleMesh, curvature: FloatArray) -> AngleConditions:
    """Return the conditions for a flat metric with the given (n,) curvature inside; the boundary is free.

    Args:
        mesh: connected.
        curvature: radians; what it is on the boundary does not matter.
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
    """Return (k, 3m) +1 at the corner opposite each half-edge that a strip crosses, -1 at that opposite its twin."""
    crossed = np.concatenate([*strips, np.empty(0, dtype=np.int64)])
    rows = np.repeat(np.arange(len(strips)), [len(strip) for strip in strips])
    columns = np.concatenate([crossed, halfedge_twins(mesh)[crossed]])
    values = np.repeat([1.0, -1.0], len(crossed))
    return csr_matrix((values, (np.tile(rows, 2), columns)), shape=(len(strips), mesh.faces.size))


def wanted_angles(mesh: TriangleMesh, angles: FloatArray, curvature: FloatArray) -> FloatArray:
    """Return (3m,) the mesh's angles, scaled at each inner vertex so that they sum to what is wanted there.

    These are the optimal angles of angle based flattening (as in ABF++, Sheffer et al. 2005), with the angle of the
    cone for a full turn. Where one would get to half a turn, all around the vertex are made equal instead.

    Args:
        mesh: the mesh.
        angles: (m, 3) of its triangles, radians.
        curvature: (n,) wanted, radians.

    Raises:
        CurvatureError: a cone has an angle of half a turn and more for each of its triangles, or none.
    """
    at = mesh.faces.ravel()
    angles = np.maximum(angles, LEAST_ANGLE)
    count = np.bincount(at, minlength=len(mesh.vertices))
    total = np.bincount(at, angles.ravel(), len(mesh.vertices))
    wanted = np.where(mesh.is_boundary_vertex, total, 2 * np.pi - curvature)
    closed = np.flatnonzero(wanted <= LEAST_ANGLE)
    if len(closed):
        raise CurvatureError(
            f"{plural(len(closed), 'cone')} without an angle: no triangles make one of "
            f"{wanted[closed[0]] / np.pi:.4g} pi; ask for curvatures below 2 pi"
        )
    crowded = np.flatnonzero(wanted >= np.pi * count)
    if len(crowded):
        worst = crowded[0]
        raise CurvatureError(
            f"{plural(len(crowded), 'cone')} too wide for the triangles around: {count[worst]} of them cannot make an "
            f"angle of {wanted[worst] / np.pi:.4g} pi; choose others, or remesh"
        )
    scaled: FloatArray = angles.ravel() * (wanted / total)[at]
    too_wide = np.zeros(len(count), dtype=bool)
    too_wide[at[scaled >= np.pi]] = True
    return np.where(too_wide[at], (wanted / count)[at], scaled)


def least_change(
    slopes: csr_matrix, off: FloatArray, excess: FloatArray, stiffness: FloatArray, pull: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the x that minimises x.(stiffness x) / 2 + pull.x with slopes x = -off, and triangles rid of their excess.

    The conditions on triangles involve three angles each, so they are eliminated with these: what is left is one
    system in the multipliers of vertices, two for each inner one (the reduction of ABF++, Sheffer et al. 2005).
    Its matrix is made as a sum of squares, two of them for the two directions in which a triangle's angles can change.

    Args:
        slopes, off: (k, 3m) and (k,) the conditions.
        excess: (m,) of the sums of triangles.
        stiffness: (3m,) positive.
        pull: (3m,).

    Returns:
        (3m,) the change, and (k,) the Lagrange multipliers of the conditions.
    """
    i, j, k = stiffness.reshape(-1, 3).T
    pairs = i * j + j * k + k * i
    given = -(np.stack([j * k, k * i, i * j], axis=1) * (excess / pairs)[:, None]).ravel()
    one = np.stack([j + k, -k, -j], axis=1) / np.sqrt(pairs * (j + k))[:, None]
    two = np.stack([np.zeros(len(i)), np.ones(len(i)), -np.ones(len(i))], axis=1) / np.sqrt(j + k)[:, None]
    columns = np.arange(2 * len(i)).repeat(3)
    rows = np.tile(np.arange(len(stiffness)), 2)
    directions = csr_matrix((np.concatenate([one, two], axis=None), (rows, columns)))
    half = csr_matrix(slopes @ directions)
    matrix = csc_matrix(half @ half.T)
    matrix.sort_indices()
    factor = factorize(matrix)
    pulled = directions.T @ pull
    right = off + slopes @ given - half @ pulled
    forces = factor.solve(right)
    # Once more, for what rounding has left.
    forces += factor.solve(right - half @ (half.T @ forces))
    return given - directions @ (pulled + half.T @ forces), forces
