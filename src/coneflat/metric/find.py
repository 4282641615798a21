"""The flat metric of a connected mesh; exact metrics whose rotations along loops are multiples of a quantum.

With the cones given, an exactly conformal metric has no freedom left, and its rotations along the handles are what
they are (Abel and Jacobi). For a quantum the conformal structure is changed: edge lengths, as little as can be.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..errors import ConvergenceError
from ..geometry import corner_angles, double_areas
from ..geometry.handles import Holonomy, curvature_by_log_lengths, edge_means, loop_holonomy, off_multiple
from ..geometry.straight import FlatTriangles
from ..geometry.triangles import slacks
from ..linalg import factorize
from ..mesh.connectivity import TriangleMesh
from ..stages import ConeSolution, FlatMetric, MetricSpec, Surface
from .boundary import prescribed_boundary, straight_boundary
from .linear import linear_flat_metric
from .solve import ExactChoices, exact_flat_metric

# Steps at most, and radians at which to stop; it takes six or so if the cones are well placed.
MAX_STEPS, TOLERANCE = 60, 1e-11
# Largest change of the log of a length in one step: from there on, what is least is found anew.
LARGEST_CHANGE = 0.2
# A step of less than this part of the whole is too little: triangles are as flat as can be.
MIN_FRACTION = 1e-3
# What scaling counts in the norm of a strain, relative to shear: next to nothing, for it can be undone conformally.
SCALING_WEIGHT = 1e-3
# Shear at cones turns loops best, for it amounts to moving the cones; but little room has to bear much of it then.
# In so many rings around them shear counts more by the factor by which scaling counts less.
CONE_RINGS = 3


def find_metric(surface: Surface, solution: ConeSolution, spec: MetricSpec) -> FlatMetric:
    """Return the flat metric of a connected mesh for its cones.

    Raises:
        ConvergenceError: the exact metric was not found.
        CurvatureError: no metric has the curvatures.
        MetricError: the linear metric overflows.
    """
    mesh, lengths, quantum = surface.mesh, surface.lengths, spec.quantum
    if spec.method == "linear":
        return linear_flat_metric(mesh, lengths, solution)
    choices = _exact_choices(surface, solution, spec)
    if quantum is not None:
        if not choices.is_held(mesh).any():
            holonomy = loop_holonomy(mesh, holes=True)
            try:
                if len(holonomy.loops) > 2 * mesh.genus():
                    return corrected_flat_metric(lengths, solution, choices, holonomy, quantum)
            except ConvergenceError:
                # Triangles cannot turn as far; handles alone may.
                pass
        if mesh.genus():
            return corrected_flat_metric(lengths, solution, choices, loop_holonomy(mesh), quantum)
    delaunay = surface.delaunay if surface.is_reused else surface.known_delaunay
    return exact_flat_metric(mesh, lengths, solution, choices, delaunay)


def loop_rotations(surface: Surface, spec: MetricSpec) -> Callable[[ConeSolution], FloatArray] | None:
    """Return a function of cones: the rotations of loops across the handles in their metric, radians.

    None for a linear metric, and on a mesh without handles.
    """
    if spec.method != "exact" or not surface.mesh.genus():
        return None
    holonomy, plain = loop_holonomy(surface.mesh), spec.plain()

    def rotations(solution: ConeSolution) -> FloatArray:
        triangles = find_metric(surface, solution, plain).triangles
        assert triangles is not None
        return holonomy.of_flat(triangles)

    return rotations


def _exact_choices(surface: Surface, solution: ConeSolution, spec: MetricSpec) -> ExactChoices:
    mesh, boundary = surface.mesh, None
    if spec.boundary == "straight":
        boundary = straight_boundary(mesh, solution.target)
    elif spec.boundary in ("disk", "polygon"):
        total = float(solution.curvatures.sum())
        corners = spec.corners.vertices, spec.corners.curvatures
        boundary = prescribed_boundary(mesh, surface.lengths, total, *corners, spec.names)
    return ExactChoices(
        scale_at_cones=spec.scale_at_cones,
        boundary=boundary,
        rigid=spec.keeps_length,
        keep_area=spec.keeps_area,
        accepts_failure=spec.accepts_failure,
        names=spec.names,
    )


def corrected_flat_metric(
    lengths: FloatArray, solution: ConeSolution, choices: ExactChoices, holonomy: Holonomy, quantum: float
) -> FlatMetric:
    """Return a flat metric with the cones of a solution whose loops turn by multiples of a quantum.

    For each loop there is a change of edge lengths that turns it and no other, with the least shear. Large changes are
    made in steps; the last ones, on the few rotations, are Broyden's.

    Args:
        lengths: (m, 3) side lengths.
        solution, choices: as for `exact_flat_metric`.
        turning: of the mesh's handles, and around its holes where the boundary is free.
        quantum: radians.

    Raises:
        ConvergenceError: the rotations did not get there.
    """
    mesh = holonomy.mesh
    given = lengths
    metric, triangles = _solve_metric(mesh, lengths, solution, choices)
    off = off_multiple(holonomy.of_flat(triangles), quantum)
    first = float(np.abs(off).max())
    fixed = choices.is_open(mesh)
    changes = None
    for _ in range(MAX_STEPS):
        if np.abs(off).max() <= TOLERANCE:
            change = float(np.abs(np.log(lengths / given)).max())
            note = (
                f"Rotations around holes and along handles were off by up to {first:.2g} rad; edge lengths were "
                f"changed by up to {100 * change:.2g}% to make them multiples of {quantum:.4g} rad (quantise)."
            )
            return replace(metric, notes=(*metric.notes, note))
        if changes is None:
            sides = np.abs(triangles.sides).reshape(-1, 3)
            changes = least_changes(holonomy, sides, shear_norm(mesh, lengths, solution.cones), fixed)
            inverse = np.eye(len(off))
        step = -inverse @ off
        fraction = min(1.0, LARGEST_CHANGE / np.abs(changes @ step).max())
        sheared = _sheared(mesh, lengths, fraction * (changes @ step))
        while fraction > MIN_FRACTION and not slacks(sheared).min() > 0:
            fraction /= 2
            sheared = _sheared(mesh, lengths, fraction * (changes @ step))
        if fraction <= MIN_FRACTION:
            break
        lengths = sheared
        solution = replace(solution, log_scale=metric.log_scale - np.log(metric.scale))
        metric, triangles = _solve_metric(mesh, lengths, solution, choices)
        before, off = off, off_multiple(holonomy.of_flat(triangles), quantum)
        if fraction < 1:
            changes = None
            continue
        gained = inverse @ (off - before)
        inverse += np.outer(step - gained, step @ inverse) / (step @ gained)
    raise ConvergenceError(
        f"rotations around holes and along handles did not get to multiples of {quantum / np.pi:.4g} pi: they are off "
        f"by {np.abs(off).max():.2g} rad; other cones (--distortion, --cone-count) may help"
    )


def _solve_metric(
    mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution, choices: ExactChoices
) -> tuple[FlatMetric, FlatTriangles]:
    metric = exact_flat_metric(mesh, lengths, solution, choices)
    assert metric.triangles is not None
    return metric, metric.triangles


def _sheared(mesh: TriangleMesh, lengths: FloatArray, change: FloatArray) -> FloatArray:
    return lengths * np.exp(change[mesh.halfedge_edges]).reshape(-1, 3)


def least_changes(holonomy: Holonomy, sides: FloatArray, norm: csc_matrix, fixed: BoolArray) -> FloatArray:
    """Return (e, l) changes of the logs of edge lengths, each of which turns one loop by a radian at first.

    Args:
        turning: of the loops.
        sides: (m, 3) lengths in the present flat metric.
        norm: (e, e) of the changes.
        fixed: (n,) vertices where conformal scaling is held, the others compensating what changes of curvature.
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
    result: FloatArray = smoothed @ np.linalg.inv(slopes.T @ smoothed)
    return result


def shear_norm(mesh: TriangleMesh, lengths: FloatArray, cones: IntArray) -> csc_matrix:
    """Return (e, e) the matrix of the area integral of the squared shear by the changes of the logs of edge lengths.

    In each triangle, sides of directions t change by m + a cos 2t + b sin 2t; (a, b) is the shear.
    """
    angles = corner_angles(lengths)
    # Directions of sides 0, 1, 2, walking around: each turns by the outer angle between them.
    directions = np.stack(
        [np.zeros(len(angles)), np.pi - angles[:, 2], 2 * np.pi - angles[:, 2] - angles[:, 0]], axis=1
    )
    harmonics = np.stack([np.ones_like(directions), np.cos(2 * directions), np.sin(2 * directions)], axis=2)
    parts = np.linalg.inv(harmonics)  # (m, 3, 3): from the changes of the sides to m, a, b
    near = np.zeros(len(mesh.vertices), dtype=bool)
    near[cones] = True
    for _ in range(CONE_RINGS - 1):
        near[mesh.edges[near[mesh.edges].any(axis=1)]] = True
    is_stiff = near[mesh.faces].any(axis=1)
    norms = (double_areas(lengths) * np.where(is_stiff, 1 / SCALING_WEIGHT, 1.0))[:, None] * [
        SCALING_WEIGHT,
        1.0,
        1.0,
    ]
    blocks = np.einsum("fki,fk,fkj->fij", parts, norms, parts)
    edges = mesh.halfedge_edges.reshape(-1, 3)
    rows, columns = np.repeat(edges, 3, axis=1), np.tile(edges, (1, 3))
    shape = (len(mesh.edges), len(mesh.edges))
    return csc_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
