"""The conditions under which corner angles are those of a flat metric with cones.

Angle based flattening (A. Sheffer, E. de Sturler, "Parameterization of faceted surfaces for meshing using angle-based
flattening", 2001) states them for a disk. They are local, so that cones and any topology fit in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags, vstack

from ..._arrays import FloatArray, IntArray
from ...errors import CurvatureError
from ...geometry.handles import handle_loops
from ...geometry.intrinsic import halfedge_twins
from ...mesh import NEXT, PREVIOUS, TriangleMesh
from ...solver import Factor, factorize
from ...text import plural

# Smaller angles, radians, are rounded to 0 in needles; their logs and relative squares are to be finite.
LEAST_ANGLE = 1e-8


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
    excess: FloatArray = angles.reshape(-1, 3).sum(axis=1) - np.pi
    return excess


@dataclass(frozen=True, eq=False)
class FoundAngles:
    """The outcome of a solve.

    Attributes:
        angles: (3m,) radians.
        steps: Newton steps.
        converged: whether the angles are what was sought.
        residual: what the conditions are off by at most, radians and logs of ratios of lengths.
    """

    angles: FloatArray
    steps: int
    converged: bool
    residual: float


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
        angles: (m, 3) of the mesh.
        curvature: (n,) radians.

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


@dataclass(frozen=True, eq=False)
class AngleStep:
    """The least change of angles that fulfils linear conditions.

    Attributes:
        change: (3m,) radians.
        forces: (k,) Lagrange multipliers of the conditions.
        matrix, factor: of the system that was solved.
    """

    change: FloatArray
    forces: FloatArray
    matrix: csc_matrix
    factor: Factor


def least_change(
    slopes: csr_matrix,
    off: FloatArray,
    excess: FloatArray,
    stiffness: FloatArray,
    pull: FloatArray,
    before: AngleStep | None = None,
) -> AngleStep:
    """Return the x that minimises x.(stiffness x) / 2 + pull.x with slopes x = -off, and triangles rid of their excess.

    The conditions on triangles involve three angles each, so they are eliminated with these: what is left is one
    system in the multipliers of vertices, two for each inner one (the reduction of ABF++, Sheffer et al. 2005).
    Its matrix is made as a sum of squares, two of them for the two directions in which a triangle's angles can change.

    Args:
        slopes, off: (k, 3m) and (k,) the conditions.
        excess: (m,) of the sums of triangles.
        stiffness: (3m,) positive.
        pull: (3m,).
        before: the step before, whose factor is used up: its analysis serves again.
    """
    i, j, k = stiffness.reshape(-1, 3).T
    given = -(np.stack([j * k, k * i, i * j], axis=1) * (excess / _in_pairs(i, j, k))[:, None]).ravel()
    one = np.stack([j + k, -k, -j], axis=1) / np.sqrt(_in_pairs(i, j, k) * (j + k))[:, None]
    two = np.stack([np.zeros(len(i)), np.ones(len(i)), -np.ones(len(i))], axis=1) / np.sqrt(j + k)[:, None]
    rows = np.tile(np.arange(len(stiffness)), 2)
    columns = np.repeat(np.arange(2 * len(i)), 3)
    directions = csr_matrix(
        (np.concatenate([one, two], axis=None), (rows, columns)), (len(stiffness), 2 * len(i))
    )
    half = csr_matrix(slopes @ directions)
    matrix = csc_matrix(half @ half.T)
    matrix.sort_indices()
    if before is not None and np.array_equal(before.matrix.indices, matrix.indices):
        # The very same arrays tell the solver that the pattern is the same.
        matrix = csc_matrix((matrix.data, before.matrix.indices, before.matrix.indptr), shape=matrix.shape)
    factor = factorize(matrix, None if before is None else before.factor)
    pulled = directions.T @ pull
    right = off + slopes @ given - half @ pulled
    forces = factor.solve(right)
    # Once more, for what rounding has left.
    forces += factor.solve(right - half @ (half.T @ forces))
    return AngleStep(given - directions @ (pulled + half.T @ forces), forces, matrix, factor)


def _in_pairs(i: FloatArray, j: FloatArray, k: FloatArray) -> FloatArray:
    return i * j + j * k + k * i
