"""The exact discrete conformal metric with prescribed curvatures."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, FloatArray, IntArray, as_floats, mask_of
from ..base.text import list_some, plural
from ..errors import ArrayShapeError, CurvatureError, NonFiniteError
from ..geometry.delaunay import euclidean_suspects, make_delaunay
from ..geometry.intrinsic import IntrinsicTriangulation, check_lengths, double, intrinsic_triangulation
from ..geometry.straight import FlatTriangles, straight_triangles
from ..geometry.triangles import double_areas
from ..mesh.connectivity import TriangleMesh
from ..stages import LaplacianInverse
from .conformal import ConformalProblem, State, find_scale

# Largest error of the Gauss-Bonnet sum of prescribed curvatures, radians; typed decimals are more accurate.
SUM_TOLERANCE = 1e-8
# Largest range of an initial phi. Lengths that differ by a larger factor than exp(100) are beyond any use, and Newton's
# method needs many steps to return from there.
MAX_RANGE = 100.0


@dataclass(frozen=True, eq=False)
class ExactMetric:
    """A metric of prescribed curvature, discretely conformal to the input.

    Attributes:
        log_scale: (n,) phi.
        curvature: (n,) curvature of the metric, radians.
        triangulation: the triangulation of the metric, Delaunay in it, with its flat lengths in model units times
            exp(phi).
        flips: half-edges flipped to get from the triangles of the input to the triangulation, in order.
        euclidean_flips: number of flips that made the input Delaunay; the others occurred during the solve.
        steps: number of Newton steps.
        residual: largest curvature error, radians, over the vertices with a target.
        worst_vertex: the vertex of the largest error.
        converged: whether the residual is within the tolerance and every triangle has area.
        doubled: whether the triangulation is that of the surface glued to its mirror image; its first m triangles
            are those of the input.
    """

    log_scale: FloatArray
    curvature: FloatArray
    triangulation: IntrinsicTriangulation
    flips: IntArray
    euclidean_flips: int
    steps: int
    residual: float
    worst_vertex: int
    converged: bool
    doubled: bool

    @property
    def ptolemy_flips(self) -> int:
        """The number of flips during the solve."""
        return len(self.flips) - self.euclidean_flips

    def straight(self) -> FlatTriangles:
        """Return the m triangles of the input with straight sides in the metric, which `unfold` lays out."""
        count = len(self.triangulation.twin) // 3
        return straight_triangles(self.triangulation, self.flips, count // 2 if self.doubled else count)


def exact_metric(
    mesh: TriangleMesh,
    lengths: ArrayLike,
    target: ArrayLike,
    *,
    fixed: ArrayLike | None = None,
    fixed_log_scale: ArrayLike = 0.0,
    start: ArrayLike | None = None,
    preconditioner: LaplacianInverse | None = None,
    tolerance: float = 1e-10,
    delaunay: bool = True,
    flipped: tuple[IntrinsicTriangulation, IntArray] | None = None,
    max_steps: int = 200,
    doubled: bool = False,
) -> ExactMetric:
    """Return the metric l_ij exp((phi_i + phi_j) / 2) whose curvature is the target.

    Args:
        mesh: the mesh, such as `check_mesh(vertices, faces).mesh`.
        lengths: (m, 3) side lengths, column i opposite corner i, model units: those of `edge_lengths`, or any others
            whose triangles have area.
        target: (n,) curvature in radians, or one number for all vertices; not used at fixed vertices.
        fixed: (n,) True for vertices whose phi is prescribed and whose curvature is computed: cones with phi = 0, or a
            free boundary. None: all curvatures are prescribed, and phi, which is then unique up to a constant, is
            chosen to preserve the total area.
        fixed_log_scale: (n,) or one number, phi at the fixed vertices.
        start: (n,) initial phi; the linear solution is a good choice.
        preconditioner: a factorized Laplacian of the mesh, zero at the fixed vertices, if there is one; it saves
            factorizations.
        tolerance: curvature error, radians, that counts as converged. The solve continues below it, as far as
            rounding permits.
        delaunay: flip the input to its intrinsic Delaunay triangulation first. If False, the conformal class is that
            of the triangles of the input. On Delaunay meshes both are the same.
        flipped: this triangulation and the flipped half-edges, from `intrinsic_delaunay`, if known.
        max_steps: Newton steps after which the best metric so far is returned; counted from 0 again if the surface
            is doubled.
        doubled: glue the surface to its mirror image at once, as if the solution without it had broken triangles.

    Raises:
        ArrayShapeError, NonFiniteError: arrays do not fit the mesh, or lengths are not finite.
        LengthError: a triangle has no area, or the two sides of an edge have different lengths.
        CurvatureError: a target is 2 pi or more at an inner vertex, or pi or more on the boundary, or the targets of
            a component without fixed vertices do not sum to 2 pi times its Euler characteristic.

    Notes:
        The curvature K(phi) minus the target is the gradient of a convex energy (Springborn, Schroeder, Pinkall 2008,
        Eq. 7), whose Hessian is the cotangent Laplacian of the scaled metric. Newton's method starts from the linear
        solution, which is its first step on a Delaunay mesh: L phi = target - K.

        After each step the triangulation is flipped to Delaunay in the scaled metric; Ptolemy flips do not change the
        conformal class (Springborn 2019; Gillespie, Springborn, Crane 2021). With flips, a metric exists for every
        target that passes the checks. On surfaces with a boundary, the theorem requires that boundary edges can be
        flipped, too. If the solution has triangles that break the triangle inequality there, the surface is glued to
        its mirror image and solved again.

    References:
        B. Springborn, P. Schroeder, U. Pinkall, "Conformal equivalence of triangle meshes", 2008.
        B. Springborn, "Ideal hyperbolic polyhedra and discrete uniformization", 2019.
        M. Gillespie, B. Springborn, K. Crane, "Discrete conformal equivalence of polyhedral surfaces", 2021.

    See Also:
        find_metric: the metric of a component for its cones, with boundary conditions.
        linear_flat_metric: the paper's metric, the first step of this method.
        unfold: lays out the triangles of `ExactMetric.straight`.
    """
    conditions, initial = _checked_conditions(mesh, lengths, target, fixed, fixed_log_scale, start)
    settings = _Settings(tolerance, max_steps, delaunay, flipped, preconditioner)
    attempt = _attempted(conditions, initial, settings, doubled)
    steps = attempt.steps
    if not attempt.is_solved and mesh.is_boundary_vertex.any() and not doubled:
        attempt = _attempted(conditions, initial, settings, doubled=True)
        steps += attempt.steps
    zero = np.where(conditions.fixed, initial, 0.0)
    if not attempt.is_solved and (initial != zero).any():
        # An initial phi may be so far off, for example on a surface of many spikes, that triangles there vanish. With
        # phi = 0 they are those of the input.
        from_zero = _attempted(conditions, zero, settings, attempt.doubled)
        steps += from_zero.steps
        attempt = from_zero if from_zero.state.largest < attempt.state.largest else attempt
    return _resulting_metric(conditions, attempt, steps)


@dataclass(frozen=True, eq=False)
class _Conditions:
    """What a metric of a mesh with n vertices and m faces must satisfy.

    Attributes:
        mesh: the mesh.
        lengths: (m, 3) side lengths that it is discretely conformal to.
        target: (n,) curvature, radians; not used at fixed vertices.
        fixed: (n,) vertices whose phi is prescribed.
        pinned: (n,) one vertex of each component without fixed ones.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    target: FloatArray
    fixed: BoolArray
    pinned: BoolArray

    @property
    def copies(self) -> FloatArray:
        """(n,) the number of angle sums of a vertex that add up in the double of the surface: 2 on the boundary."""
        return np.where(self.mesh.is_boundary_vertex, 2.0, 1.0)

    def problem(
        self, triangulation: IntrinsicTriangulation, preconditioner: LaplacianInverse | None
    ) -> ConformalProblem:
        """Return the problem on a triangulation of the surface."""
        flat_angle = np.where(self.mesh.is_boundary_vertex, np.pi, 2 * np.pi)
        return ConformalProblem(
            triangulation, flat_angle, self.target, self.fixed, self.pinned, preconditioner
        )

    def doubled_problem(self, triangulation: IntrinsicTriangulation, original: IntArray) -> ConformalProblem:
        """Return the problem on the double of the surface, whose vertices are copies of the `original` ones."""
        pinned = np.concatenate([self.pinned, np.zeros(len(original) - len(self.pinned), dtype=bool)])
        flat_angle, target = np.full(len(original), 2 * np.pi), (self.copies * self.target)[original]
        return ConformalProblem(triangulation, flat_angle, target, self.fixed[original], pinned)


class _Settings(NamedTuple):
    """How a metric is solved for; see `exact_metric`."""

    tolerance: float
    max_steps: int
    delaunay: bool
    flipped: tuple[IntrinsicTriangulation, IntArray] | None
    preconditioner: LaplacianInverse | None


@dataclass(frozen=True, eq=False)
class _Attempt:
    """The result of one solve, on the surface or on its double.

    Attributes:
        problem: the problem with the triangulation of the state.
        state: the state with the smallest residual.
        original: the vertex of the mesh that each vertex of the problem is a copy of.
        steps: number of Newton steps.
        tolerance: curvature error that counts as converged, radians.
        delaunay: whether the first flips of the problem made the input Delaunay.
        doubled: whether the surface was glued to its mirror image.
    """

    problem: ConformalProblem
    state: State
    original: IntArray
    steps: int
    tolerance: float
    delaunay: bool
    doubled: bool

    @property
    def is_solved(self) -> bool:
        """Whether the residual is within the tolerance, or within the rounding errors at needles."""
        state = self.state
        if state.broken:
            return False
        return state.largest <= self.tolerance or state.largest <= self.problem.rounding_error(state)


def _attempted(conditions: _Conditions, initial: FloatArray, settings: _Settings, doubled: bool) -> _Attempt:
    """Return the solve that starts from an initial phi (n,)."""
    original = np.arange(len(initial))
    flipped = settings.flipped if settings.delaunay and not doubled else None
    if flipped is None:
        triangulation = intrinsic_triangulation(conditions.mesh, conditions.lengths)
    else:
        triangulation = deepcopy(flipped[0])
    if doubled:
        triangulation, original = double(triangulation)
        problem = conditions.doubled_problem(triangulation, original)
    else:
        problem = conditions.problem(triangulation, settings.preconditioner)
    if settings.delaunay:
        if flipped is None:
            problem.records.append(make_delaunay(triangulation, suspects=euclidean_suspects(triangulation)))
        else:
            problem.records.append(flipped[1])
    state, steps = find_scale(problem, initial[original], settings.tolerance, settings.max_steps)
    return _Attempt(problem, state, original, steps, settings.tolerance, settings.delaunay, doubled)


def _resulting_metric(conditions: _Conditions, attempt: _Attempt, steps: int) -> ExactMetric:
    """Return the metric of an attempt, with the area of the input where phi is unique up to a constant."""
    problem, state, n = attempt.problem, attempt.state, len(conditions.fixed)
    log_scale, curvature = state.variables, state.curvature[:n]
    if attempt.doubled:
        curvature = curvature / conditions.copies
    if conditions.pinned.any():
        log_scale = _keep_area(conditions.mesh, conditions.lengths, problem, log_scale, attempt.original)
    triangulation, records = problem.triangulation, problem.records
    triangulation.length = problem.flat_lengths(log_scale)
    return ExactMetric(
        log_scale=log_scale[:n],
        curvature=curvature,
        triangulation=triangulation,
        flips=np.concatenate(records) if records else np.empty(0, dtype=np.int64),
        euclidean_flips=len(records[0]) if attempt.delaunay else 0,
        steps=steps,
        residual=state.largest,
        worst_vertex=int(np.abs(state.residual[:n]).argmax()),
        converged=attempt.is_solved,
        doubled=attempt.doubled,
    )


def _checked_conditions(
    mesh: TriangleMesh,
    lengths: ArrayLike,
    target: ArrayLike,
    fixed: ArrayLike | None,
    fixed_log_scale: ArrayLike,
    start: ArrayLike | None,
) -> tuple[_Conditions, FloatArray]:
    """Return validated arguments of `exact_metric`, and (n,) the initial phi."""
    lengths, n = check_lengths(mesh, lengths), len(mesh.vertices)
    is_fixed = np.zeros(n, dtype=bool) if fixed is None else _per_vertex("fixed", fixed, n).astype(bool)
    corrected, pinned = checked_target(mesh, _per_vertex("target", target, n), is_fixed)
    initial = np.zeros(n) if start is None else _per_vertex("start", start, n).copy()
    initial[is_fixed] = _per_vertex("fixed_log_scale", fixed_log_scale, n)[is_fixed]
    bad = np.flatnonzero(is_fixed & ~np.isfinite(initial))
    if len(bad):
        raise NonFiniteError(f"fixed_log_scale is NaN or infinite at {_at(bad)}")
    if not np.ptp(initial) <= MAX_RANGE:
        initial = np.where(is_fixed, initial, 0.0)
    return _Conditions(mesh, lengths, corrected, is_fixed, pinned), initial


def _per_vertex(name: str, values: ArrayLike, count: int) -> FloatArray:
    """Return (n,) values from an array or from one number for all; raise ArrayShapeError for other shapes."""
    array = as_floats(name, values)
    if array.shape not in ((), (count,)):
        raise ArrayShapeError(
            f"{name} must have the shape {(count,)}, a number for each vertex, got {array.shape}"
        )
    return np.broadcast_to(array, (count,))


def _at(vertices: IntArray) -> str:
    return f"{plural(len(vertices), 'vertex', 'vertices')}: {list_some(vertices)}"


def _keep_area(
    mesh: TriangleMesh,
    lengths: FloatArray,
    problem: ConformalProblem,
    log_scale: FloatArray,
    original: IntArray,
) -> FloatArray:
    """Return phi, shifted by a constant on each component without fixed vertices so that its area is preserved.

    original: (n,) the vertex of the mesh that each vertex of the problem is a copy of.
    """
    count, labels = mesh.components
    component = labels[original]
    free = ~mask_of(count, component[problem.fixed])
    centre = np.full(count, -np.inf)
    np.maximum.at(centre, component, log_scale)
    log_scale = log_scale - np.where(free, centre, 0.0)[component]
    metric = problem.flat_lengths(log_scale).reshape(-1, 3)
    before = np.bincount(labels[mesh.faces[:, 0]], weights=double_areas(lengths), minlength=count)
    after = np.bincount(
        component[problem.triangulation.tail[::3]], weights=double_areas(metric), minlength=count
    )
    copies = len(metric) / len(lengths)  # 2 if the surface was doubled
    # If the area has vanished, the metric is rejected later, and any shift will do.
    is_left = np.isfinite(after) & (after > 0)
    shift = np.log(copies * before / np.where(is_left, after, copies * before)) / 2
    return log_scale + np.where(free, shift, 0.0)[component]


def checked_target(mesh: TriangleMesh, target: FloatArray, fixed: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Return a target that satisfies Gauss-Bonnet up to rounding, and one pinned vertex per component if needed.

    Args:
        mesh: the mesh.
        target: (n,) curvature, radians; not used at fixed vertices.
        fixed: (n,) vertices whose log conformal factor is given.

    Returns:
        (n,) the corrected target, and (n,) True at one vertex of each component without fixed vertices.

    Raises:
        CurvatureError: a target is NaN, infinite or too large, or the targets of a component without fixed vertices
            do not have the required sum.
    """
    bad = np.flatnonzero(~fixed & ~np.isfinite(target))
    if len(bad):
        raise CurvatureError(f"the target curvature is NaN or infinite at {_at(bad)}")
    on_boundary = mesh.is_boundary_vertex
    for where, limit, name, place in (
        (~on_boundary, 2 * np.pi, "2 pi", "inside"),
        (on_boundary, np.pi, "pi", "on the boundary"),
    ):
        bad = np.flatnonzero(where & ~fixed & ~(target < limit * (1 - 1e-12)))
        if len(bad):
            worst = bad[np.argmax(target[bad])]
            raise CurvatureError(
                f"no metric has a curvature of {name} or more {place}: the target of vertex {worst} is "
                f"{target[worst] / np.pi:.6g} pi ({len(bad)} such vertices); choose smaller targets"
            )
    pinned = np.zeros(len(target), dtype=bool)
    count, component = mesh.components
    target = target.copy()
    has_fixed = mask_of(count, component[fixed])
    for label in np.flatnonzero(~has_fixed):
        inside = component == label
        faces = int(inside[mesh.faces[:, 0]].sum())
        edges = int(inside[mesh.edges[:, 0]].sum())
        vertices = int(inside.sum())
        euler = vertices - edges + faces
        excess = float(target[inside].sum()) - 2 * np.pi * euler
        if not abs(excess) <= SUM_TOLERANCE:
            raise CurvatureError(
                f"curvatures must sum to 2 pi times the Euler characteristic, {2 * euler} pi, but the input "
                f"sums to {target[inside].sum() / np.pi:.9g} pi; change one cone by {-excess / np.pi:.6g} pi"
            )
        target[inside] -= excess / vertices
        pinned[np.flatnonzero(inside)[0]] = True
    return target, pinned
