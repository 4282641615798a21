"""Minimisation of the distortion of a layout while both sides of seams stay rigid copies with the same rotations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import (
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    as_faces,
    as_floats,
    has_any,
    mask_of,
    require_finite,
    rows_of,
)
from ..base.text import plural
from ..errors import ArrayShapeError, ConvergenceError, OptionError
from ..geometry import double_areas, edge_lengths
from ..geometry.intrinsic import check_lengths
from ..geometry.planar import as_complex, as_pairs, heights, sides_between, signed_double_areas
from ..geometry.straight import rest_sides
from ..mesh.connectivity import TriangleMesh
from .elements import Elements
from .energies import Energy, StretchEnergy
from .motions import close_seams, find_motions
from .newton import RELATIVE_ROUNDING, Problem, descend
from .restrictions import PointConstraints, check_constraints, find_restrictions

# The last step is the first one whose predicted decrease is at most this fraction of the energy minus its lower bound;
# and the maximum number of steps.
TOLERANCE, STEPS = 1e-3, 100


@dataclass(frozen=True, eq=False)
class Relaxed:
    """A relaxed layout.

    Attributes:
        points: (u, 2) positions in the plane.
        energy_before, energy: weighted mean energy of the triangles that could move, at the start and at the end.
        steps: number of Newton steps.
        moved: (n,) True for vertices that could move.
    """

    points: FloatArray
    energy_before: float
    energy: float
    steps: int
    moved: BoolArray


def relax(
    mesh: TriangleMesh,
    points: ArrayLike,
    corners: ArrayLike,
    energy: Energy | None = None,
    constraints: PointConstraints | None = None,
    *,
    lengths: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    free: ArrayLike | None = None,
    to_scale: bool = False,
    tolerance: float = TOLERANCE,
    steps: int = STEPS,
    progress: Callable[[int, float], bool | None] | None = None,
) -> Relaxed:
    """Return a layout with less distortion and the same seams, without flipping any triangle.

    A seam is an edge whose two triangles have different points; one side is a rigid copy of the other.
    The rotations of seams are preserved and their translations may change, so cones keep their angles and the two sides
    of every seam stay equal: the result is again a layout of a flat metric with the same cones.

    Args:
        mesh: the mesh.
        points: (u, 2) positions in the plane. Triangles that are flipped there, or have no area up to
            rounding, do not move.
        corners: (m, 3) the point at each triangle corner, from 0.
        energy: the energy of a triangle per area; None for its angle distortion, `StretchEnergy(0)`.
        constraints: constraints on points; None for none.
        lengths: (m, 3) target side lengths of the triangles, column i opposite corner i; None for those of the mesh.
        weights: (m,) weights of the triangles in addition to their areas; None for equal weights.
        free: (n,) True for vertices that may move; None for all.
        to_scale: whether the lengths are those to reach; else they are scaled to the area of the given layout.
        tolerance: the last step is the first one whose predicted decrease is at most this fraction of the energy minus
            its lower bound.
        steps: maximum number of Newton steps.
        progress: called after each step with its number and the energy; if it returns True, the iteration ends with
            the current result, or with an error if constraints do not hold yet.

    Returns:
        The relaxed layout.

    Raises:
        ArrayShapeError, FaceIndexError, NonFiniteError: arrays do not match the mesh, or are not finite.
        LengthError: the lengths are not a metric.
        OptionError: the constraints are invalid, or contradict each other.
        SeamError: the two sides of a seam are not rigid copies of each other.
        ConvergenceError: no way was found to satisfy the constraints without flipping a triangle.
        MetricError: the computation found no finite result.

    Notes:
        Newton's method with each triangle's Hessian projected to a positive semidefinite one in closed form (Smith, de
        Goes, Kim, "Analytic eigensystems for isotropic distortion energies", 2019), with steps that flip no triangle
        (Smith and Schaefer, "Bijective parameterization with free boundaries", 2015). Seams are not added as
        constraints but eliminated, so the system is symmetric positive definite, with one sparsity pattern for all
        steps.
    """
    if not 0 <= tolerance < 1 or steps < 0:
        raise OptionError(f"tolerance must be from 0 to 1 and steps from 0, got {tolerance!r} and {steps!r}")
    constraints = PointConstraints() if constraints is None else constraints
    places, corner = _checked_layout(mesh, points, corners)
    sides = edge_lengths(mesh.vertices, mesh.faces) if lengths is None else check_lengths(mesh, lengths)
    checked = check_constraints(constraints, places)
    areas = double_areas(sides) / 2
    share = areas * _weights(weights, len(mesh.faces))
    flat = rows_of(places, corner)
    shapes, is_free = _movable(mesh, flat, sides, areas, _flags(free, len(mesh.vertices)))
    unmoved = Relaxed(places, 0.0, 0.0, 0, is_free)
    if not is_free.any():
        return unmoved
    area = np.abs(signed_double_areas(flat)).sum() / 2
    unit = 1.0 if to_scale else float(np.sqrt(area / areas.sum()))
    z = as_complex(places)
    restrictions = find_restrictions(mesh, corner, z, is_free, checked)
    motions = find_motions(z, restrictions)
    elements = Elements.of(motions, corner, shapes, unit, share)
    if not elements.count and not motions.has_offset:
        return unmoved
    problem = Problem(motions, elements, StretchEnergy() if energy is None else energy)
    descent = descend(z, problem, tolerance, steps, progress, constraints.stride)
    if descent.remaining:
        raise ConvergenceError(
            f"constraints are only {1 - descent.remaining:.1%} satisfied after {plural(descent.steps, 'step')}: "
            "they cannot be met without flipping triangles"
        )
    total = float(elements.weight.sum())
    moved = as_pairs(close_seams(descent.points, restrictions))
    return Relaxed(moved, descent.before / total, descent.after / total, descent.steps, is_free)


def _checked_layout(mesh: TriangleMesh, points: ArrayLike, corners: ArrayLike) -> tuple[FloatArray, IntArray]:
    """Return validated points (u, 2) and corners (m, 3)."""
    places = as_floats("points", points)
    if places.ndim != 2 or places.shape[1] != 2:
        raise ArrayShapeError(f"points must have the shape (u, 2), got {places.shape}")
    corner = as_faces(corners, len(places))
    if corner.shape != mesh.faces.shape:
        raise ArrayShapeError(
            f"corners must have the shape {mesh.faces.shape} of the faces, got {corner.shape}"
        )
    require_finite(places, corner)
    return places, corner


def _movable(
    mesh: TriangleMesh, corners: FloatArray, lengths: FloatArray, areas: FloatArray, is_free: BoolArray
) -> tuple[ComplexArray, BoolArray]:
    """Return target shapes and (n,) the vertices that move: the free ones without flipped or degenerate triangles.

    Args:
        mesh: the mesh.
        corners: (m, 3, 2) the corners of the triangles in the plane.
        lengths, areas: (m, 3), (m,) their target side lengths and areas.
        is_free: (n,) True for vertices that may move.

    Returns:
        (m, 3) sides of the triangles with free vertices, which are usually few, in their target shapes; and a mask.
    """
    candidates = np.flatnonzero(has_any(is_free, mesh.faces))
    shapes = np.empty(lengths.shape, dtype=np.complex128)
    shapes[candidates] = candidate_shapes = rest_sides(lengths[candidates])
    height = np.minimum(heights(candidate_shapes), heights(sides_between(corners[candidates])))
    is_degenerate = (height <= RELATIVE_ROUNDING) | (areas[candidates] <= 0)
    return shapes, is_free & ~mask_of(len(is_free), mesh.faces[candidates[is_degenerate]])


def _flags(free: ArrayLike | None, count: int) -> BoolArray:
    if free is None:
        return np.ones(count, dtype=bool)
    flags = np.asarray(free)
    if flags.dtype != bool or flags.shape != (count,):
        raise ArrayShapeError(
            f"free must be {count:,} flags, one for each vertex, got {flags.dtype} of shape {flags.shape}"
        )
    return flags.copy()


def _weights(weights: ArrayLike | None, count: int) -> FloatArray:
    if weights is None:
        return np.ones(count)
    values = as_floats("weights", weights)
    if values.shape != (count,):
        raise ArrayShapeError(f"weights must have the shape ({count},), got {values.shape}")
    if not (np.isfinite(values) & (values > 0)).all():
        raise OptionError(f"weights must be positive: {int((~(values > 0)).sum())} of {count:,} are not")
    return values
