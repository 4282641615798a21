"""Discrete Ricci flow with inversive distance circle packings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import csc_matrix

from ... import TriangleMesh
from ...base import BoolArray, FloatArray, IntArray, plural
from ...geometry import (
    IntrinsicTriangulation,
    angle_defect,
    corner_angles,
    cotangents,
    double_areas,
    euclidean_diagonal,
    intrinsic_delaunay,
    is_broken,
    relink,
    slacks,
)
from ...linalg import Limits, Point, factorize, minimise
from ...mesh import NEXT, PREVIOUS
from ...metric import checked_target
from ...stages import ConeSolution, FlatMetric
from .shared import failure_notes, flat_metric

# Tolerance of curvature, radians; largest number of steps; rounding; halvings; largest change of a log radius.
LIMITS = Limits(1e-10, 200, goal=1e-13, halvings=30, largest_step=5.0)
# Rounding error of the sum of the slopes at an edge, relative to their terms.
NOISE = 1e-14


def ricci_flow(
    mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution, best_effort: bool = False
) -> FlatMetric:
    """Return the flat metric of a circle packing with the inversive distances of a packing on the input.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) side lengths, model units.
        solution: cones with their curvatures; radii on the boundary, which is free, do not change.
        best_effort: return a metric even if it did not converge.

    Raises:
        ConvergenceError: no metric was found, unless `best_effort`.
        CurvatureError: no metric has the curvatures.

    Notes:
        The Ricci energy (Jin, Kim, Gu 2007) is minimised by Newton's method, with inversive distances (Guo 2011, Luo
        2011). Without the flips of Bobenko and Lutz 2023, on the input's own triangles, a solution need not exist.

    References:
        M. Jin, J. Kim, X. Gu, "Discrete surface Ricci flow: theory and applications", 2007.
        R. Guo, "Local rigidity of inversive distance circle packing", 2011.
        F. Luo, "Rigidity of polyhedral surfaces III", 2011.
        A. Bobenko, C. Lutz, "Decorated discrete conformal maps and convex polyhedral cusps", 2023.
    """
    border = mesh.is_boundary_vertex
    target, pinned = checked_target(mesh, np.where(border, 0.0, solution.target), border)
    packing = Packing.of(mesh, lengths, target, border, pinned)
    start = packing.evaluate(np.where(border, 0.0, solution.log_scale))
    if not start.is_admissible:
        start = packing.evaluate(np.zeros(len(border)))
    found, steps = minimise(packing, start, LIMITS)
    state = packing.evaluate(found.variables)
    notes: tuple[str, ...] = ()
    if state.broken or not state.largest <= LIMITS.tolerance:
        broken = plural(state.broken, "triangle")
        what = f"the Ricci flow did not converge: {broken} broke the triangle inequality, the curvature is"
        notes = failure_notes(what, steps, state.largest, " rad", best_effort)
    flat, flips = packing.lengths(found.variables), np.concatenate(packing.flips)
    metric = flat_metric(mesh, lengths, solution, packing.triangulation, flat, found.variables, flips, steps)
    return replace(metric, notes=notes)


@dataclass(eq=False)
class State(Point):
    """The curvature for given radii, on the triangulation that is weighted Delaunay for them.

    Attributes:
        weights: (3m,) twice the derivative of the angle opposite each half-edge.
        broken: number of triangles that break the triangle inequality; with a boundary, whose edges cannot be flipped,
            such a state is inadmissible.
    """

    weights: FloatArray = field(default_factory=lambda: np.empty(0))
    broken: int = 0


@dataclass(eq=False)
class Packing:
    """The problem of log factors u for which circles of radii g_i exp(u_i) have the target curvature.

    Inversive distances are those of the input. K(u) - target is the gradient of the Ricci energy (Jin, Kim, Gu 2007),
    which is convex for disjoint circles (Guo 2011; Luo 2011). Its Hessian is the Laplacian with the weights h / l of
    the radical centres. With flips to weighted Delaunay that preserve the inversive distances, it has a minimum for all
    curvatures that satisfy Gauss-Bonnet (Bobenko, Lutz 2023).

    Attributes:
        triangulation: the triangulation, with inversive distances as lengths; flipped in place.
        radii: (n,) g, model units.
        target: (n,) curvature, radians; not used on the boundary.
        border: (n,) whether the radius is fixed.
        pinned: (n,) True for one vertex of a closed surface.
        flips: half-edges flipped so far.
        last: the state evaluated last, to which the triangulation belongs.
    """

    triangulation: IntrinsicTriangulation
    radii: FloatArray
    target: FloatArray
    border: BoolArray
    pinned: BoolArray
    flips: list[IntArray]
    last: State | None = None

    @classmethod
    def of(
        cls, mesh: TriangleMesh, lengths: FloatArray, target: FloatArray, border: BoolArray, pinned: BoolArray
    ) -> Packing:
        """Return circles on the input, flipped to Delaunay and weighted Delaunay; the surface does not change."""
        triangulation, flips = intrinsic_delaunay(mesh, lengths)
        radii = packed_radii(triangulation.length.reshape(-1, 3), triangulation.faces)
        more = flip_to_weighted_delaunay(triangulation, radii, has_lengths=True)
        triangulation.length = inversive_distances(triangulation, radii)
        return cls(triangulation, radii, target, border, pinned, [flips, more])

    def lengths(self, place: FloatArray) -> FloatArray:
        """Return (3m,) the lengths for u, bitwise equal on both sides of an edge."""
        one, two = ends_of(self.triangulation, self.radii * np.exp(place))
        return np.sqrt((one**2 + two**2) + 2 * self.triangulation.length * (one * two))

    def evaluate(self, place: FloatArray) -> State:
        """Return the state for u, after flips to weighted Delaunay."""
        triangulation = self.triangulation
        radii = self.radii * np.exp(place)
        flipped = flip_to_weighted_delaunay(triangulation, radii, has_lengths=False)
        if len(flipped):
            self.flips.append(flipped)
        sides = self.lengths(place).reshape(-1, 3)
        broken = is_broken(sides)
        curvature = angle_defect(triangulation.faces, corner_angles(sides), self.border)
        residual = np.where(self.border, 0.0, self.target - curvature)
        if self.pinned.any():
            residual -= residual.mean()  # 0 by Gauss-Bonnet, up to rounding
        weights = np.where(broken[:, None], 0.0, packing_weights(sides, radii[triangulation.faces])).ravel()
        is_admissible = not (self.border.any() and broken.any())
        self.last = State(place, residual, is_admissible, weights, int(broken.sum()))
        return self.last

    def direction(self, here: State, exactly: bool) -> tuple[FloatArray, bool]:
        """Return the Newton step; True, as it is exact."""
        state = here if here is self.last else self.evaluate(here.variables)
        count, tail = len(self.radii), self.triangulation.tail
        head = tail.reshape(-1, 3)[:, NEXT].ravel()
        half = state.weights / 2
        rows, columns = np.concatenate([tail, head, tail, head]), np.concatenate([tail, head, head, tail])
        laplacian = csc_matrix((np.concatenate([half, half, -half, -half]), (rows, columns)), (count, count))
        free = np.flatnonzero(~(self.border | self.pinned))
        matrix = csc_matrix(laplacian[free][:, free])
        matrix.sort_indices()
        step = np.zeros(count)
        step[free] = factorize(matrix).solve(state.residual[free])
        return step, True


def packed_radii(lengths: FloatArray, faces: IntArray) -> FloatArray:
    """Return (n,) radii of circles at the vertices, so that no two circles of a triangle overlap.

    A radius is the minimum over the triangles around the vertex of (l_ij + l_ki - l_jk) / 2, the radius in the packing
    of three tangent circles. So inversive distances are at least 1.
    """
    radii = np.full(int(faces.max()) + 1, np.inf)
    np.minimum.at(radii, faces.ravel(), slacks(lengths).ravel() / 2)
    return radii


def ends_of(triangulation: IntrinsicTriangulation, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (3m,) values at the tail and at the head of each half-edge."""
    at_tail = values[triangulation.tail]
    return at_tail, at_tail.reshape(-1, 3)[:, NEXT].ravel()


def inversive_distances(triangulation: IntrinsicTriangulation, radii: FloatArray) -> FloatArray:
    """Return (3m,) the inversive distances of circles whose centres have the edge lengths as distances."""
    one, two = ends_of(triangulation, radii)
    gap, both = triangulation.length - (one + two), triangulation.length + (one + two)
    return 1 + gap * both / (2 * (one * two))


def packing_weights(sides: FloatArray, radii: FloatArray) -> FloatArray:
    """Return (m, 3) twice the derivative of the angle at one end of each side by the log radius at the other end.

    The derivative of the angle at i by log g_j is h_k / l_k, where h_k is the height of the radical centre over the
    side between them (Guo 2011; D. Glickenstein 2011):

        2 h_k / l_k = cot a_k + (g_i^2 cot a_j + g_j^2 cot a_i) / l_k^2 - g_k^2 / (2 A)
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        cots, squares = cotangents(sides), radii**2
        crossed = squares[:, NEXT] * cots[:, PREVIOUS] + squares[:, PREVIOUS] * cots[:, NEXT]
        return cots + crossed / sides**2 - squares / double_areas(sides)[:, None]


def slopes(inversive: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (m, 3) the slope of each triangle along its sides, and (m, 3) a bound of its terms.

    An edge is weighted Delaunay if the sum of the slopes from both sides is not negative. If the triangle exists, the
    height of its radical centre over the side has the sign of the slope.

    Args:
        inversive: (m, 3) inversive distances of the circles at the ends of the sides.
        radii: (m, 3) radii of the circles at the corners.
    """
    c, jk, ik = inversive, inversive[:, NEXT], inversive[:, PREVIOUS]
    gi, gj, gk = radii[:, NEXT], radii[:, PREVIOUS], radii
    up = gk * ((gj + c * gi) * ik + (gi + c * gj) * jk)
    down = gi * gj * (c * c - 1)
    spread = c * c + ik * ik + jk * jk + 2 * c * ik * jk - 1
    size = np.sqrt(gi * gi + gj * gj + 2 * c * gi * gj) * gk * np.sqrt(spread)
    return (up - down) / size, (up + np.abs(down)) / size


def flip_to_weighted_delaunay(
    triangulation: IntrinsicTriangulation, radii: FloatArray, has_lengths: bool
) -> IntArray:
    """Flip a triangulation in place until it is weighted Delaunay, and return the flipped half-edges in order.

    Args:
        triangulation: updated in place.
        radii: (n,) radii of the circles at the vertices.
        has_lengths: flips preserve the metric of its lengths; else its lengths are inversive distances, which flips
            preserve (Bobenko, Lutz 2023).
    """
    twin, tail, length = triangulation.twin, triangulation.tail, triangulation.length
    flipped: list[int] = []
    for _ in range(500):  # limit of rounds, if edges still fail the condition by rounding
        inversive = inversive_distances(triangulation, radii) if has_lengths else length
        slope, size = (each.ravel() for each in slopes(inversive.reshape(-1, 3), radii[triangulation.faces]))
        sums = slope + slope[twin]
        fails = (twin > np.arange(len(twin))) & (sums < -NOISE * (size + size[twin]))
        bad = np.flatnonzero(fails & (twin // 3 != np.arange(len(twin)) // 3))
        if not len(bad):
            break
        # The worst edges are flipped first; quads flipped in one round have no triangle in common.
        is_new = np.zeros(len(twin) // 3, dtype=bool)
        for h in bad[np.argsort(sums[bad], kind="stable")].tolist():
            one, two = h // 3, int(twin[h]) // 3
            if is_new[one] or is_new[two]:
                continue
            is_new[one] = is_new[two] = True
            h1, h2 = 3 * one + (h + 1) % 3, 3 * one + (h + 2) % 3
            t = int(twin[h])
            t1, t2 = 3 * two + (t + 1) % 3, 3 * two + (t + 2) % 3
            other = euclidean_diagonal if has_lengths else other_inversive_distance
            sides = (float(length[side]) for side in (h, h2, h1, t1, t2))
            relink(twin, tail, length, h, other(*sides))
            flipped.append(h)
    return np.array(flipped, dtype=np.int64)


def other_inversive_distance(e: float, b: float, c: float, b2: float, c2: float) -> float:
    """Return the inversive distance along the other diagonal of the quad of two triangles at the edge e from u to v.

    b and b2 are the inversive distances of the apices from u, c and c2 those from v. e is above 1, because edges of
    tangent circles are never flipped.
    """
    across = b * b2 + c * c2 + e * (b * c2 + b2 * c)
    spread = [e * e + s * s + t * t + 2 * e * s * t - 1 for s, t in ((b, c), (b2, c2))]
    return float((across + np.sqrt(spread[0] * spread[1])) / (e * e - 1))
