"""The fewest cones for the area distortion allowed.

In the linear model phi = phi_0 + sum_s k_s g_s with the Green's functions g_s of the cones, so choosing cones for a
small norm of phi is sparse approximation. The literature goes from relaxations (Y. Soliman, D. Slepcev, K. Crane,
"Optimal cone singularities for conformal flattening", 2018) to moving given cones (M. Li, Q. Fang, Z. Zhang, L. Liu,
X.-M. Fu, "Efficient cone singularity construction for conformal parameterizations", 2023). Here positions are
exchanged, as in subset selection, on a dense coarse model, where that costs next to nothing, and finished with exact
energies.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import BoolArray, FloatArray, IntArray
from ..errors import CurvatureError, OptionError
from ..geometry.operators import weighted_areas
from ..text import list_some, plural
from .cone_search import ConeSearch
from .dense_model import Limits
from .solution import FULL_TURN, ConeSolution


@dataclass(frozen=True)
class PursuedCones:
    """What a search for cones found.

    Attributes:
        solution: the cones.
        distortion: E of the linear model.
    """

    solution: ConeSolution
    distortion: float


def open_search(
    laplacian: csc_matrix,
    curvature: FloatArray,
    areas: FloatArray,
    is_boundary: BoolArray,
    euler_characteristic: int,
    *,
    tie_key: FloatArray | None = None,
    min_cone_angle: float = math.pi / 2,
    max_cone_angle: float | None = 4 * math.pi,
    positive_only: bool = False,
    weights: FloatArray | None = None,
    required: Iterable[int] = (),
    allowed: BoolArray | None = None,
    room: FloatArray | None = None,
) -> ConeSearch:
    """Return a search for the cones of a connected mesh, which answers several questions with one factorization.

    The distortion E is the area-weighted standard deviation of the linear log scale. A boundary is held at phi = 0
    and takes what the cones leave.

    Args:
        laplacian: (n, n) cotangent Laplacian.
        curvature: (n,) angle defect, radians.
        areas: (n,) vertex areas, any unit.
        is_boundary: (n,) mask of the vertices that take curvature without being cones. Without any, the mesh
            counts as closed.
        euler_characteristic: chi of the mesh.
        tie_key: (n,) breaks ties, the lowest first; None: areas and curvatures do.
        min_cone_angle, max_cone_angle: bounds of the cones' angles 2 pi - k, radians.
        positive_only: no cones of negative curvature (angles above 2 pi).
        weights: (n,) importance of each vertex, 1 where nothing is said.
        required: vertices that are cones in any case.
        allowed: (n,) mask of the other vertices that may be cones; None: all.
        room: (n,) the widest angle of a cone at each vertex, radians; None: as far as `max_cone_angle` goes.

    Raises:
        OptionError: an option makes no sense.
        CurvatureError: no curvatures within the bounds have the sum that the surface needs.
    """
    limits = curvature_limits(
        None if is_boundary.any() else euler_characteristic, min_cone_angle, max_cone_angle, positive_only
    )
    usable = ~is_boundary if allowed is None else ~is_boundary & allowed
    cones = required_vertices(required, is_boundary)
    order = np.lexsort((curvature, areas)) if tie_key is None else np.argsort(tie_key, kind="stable")
    share = weighted_areas(areas, weights)
    return ConeSearch(laplacian, curvature, share, is_boundary, order, limits, cones, usable, room)


def pursue(
    search: ConeSearch, *, distortion: float = 0.2, count: int | None = None, most: int | None = None
) -> PursuedCones:
    """Find the fewest cones with an area distortion of at most `distortion`, or the best `count` of them.

    Where the fewest are more than `most`, the best of so many or fewer.

    Raises:
        OptionError: the distortion or the number makes no sense.
        CurvatureError: so many cones cannot carry the curvature.
    """
    if count is None:
        if not 0 < distortion < math.inf:
            raise OptionError(f"the distortion allowed must be a positive number, not {distortion:g}")
        if most is not None:
            check_count(most, search)
        energy, members = search.fewest(distortion, most)
    else:
        check_count(count, search)
        energy, members = search.of_count(count)
    return PursuedCones(search.solution(members), energy)


def check_count(count: int, search: ConeSearch) -> None:
    """Raise an error if so many cones cannot do."""
    limits, fixed = search.limits, len(search.coarse.fixed)
    if isinstance(count, bool) or count != int(count) or count < 0:
        raise OptionError(f"the number of cones must be a whole number and not negative, not {count!r}")
    if count < fixed:
        raise CurvatureError(f"{plural(fixed, 'cone')} required, but only {count} allowed")
    if count < limits.fewest:
        bound = limits.most if limits.total > 0 else limits.least
        each = f" of at most {abs(bound) / np.pi:.4g} pi each" if np.isfinite(bound) else ""
        raise CurvatureError(
            f"{plural(count, 'cone')}{each} cannot carry this surface's total curvature of "
            f"{limits.total / np.pi:.4g} pi: {limits.fewest} or more are needed"
        )


def curvature_limits(
    euler_characteristic: int | None,
    min_cone_angle: float,
    max_cone_angle: float | None,
    positive_only: bool,
) -> Limits:
    """Return the bounds of curvatures; no Euler characteristic is given for a mesh with a boundary.

    Raises:
        OptionError: the angles leave nothing.
        CurvatureError: cones of these angles cannot have the sum of curvatures of the surface.
    """
    if not 0 < min_cone_angle < math.inf:
        raise OptionError(f"the smallest cone angle must be positive, not {min_cone_angle:g} radians")
    if max_cone_angle is not None and not max_cone_angle > min_cone_angle:
        raise OptionError(
            f"the largest cone angle ({max_cone_angle:g} radians) must exceed the smallest ({min_cone_angle:g})"
        )
    least = -math.inf if max_cone_angle is None else FULL_TURN - max_cone_angle
    if positive_only:
        least = max(least, 0.0)
    most = FULL_TURN - min_cone_angle
    if positive_only and most <= 0:
        raise OptionError("cones of positive curvature only have angles below 2 pi: allow smaller angles")
    if euler_characteristic is None:
        return Limits(least, most, math.nan)
    total = FULL_TURN * euler_characteristic
    if (total > 0 and most <= 0) or (total < 0 and least >= 0):
        kind = "positive" if total < 0 else "negative"
        raise CurvatureError(
            f"a surface of Euler characteristic {euler_characteristic} has a total curvature of "
            f"{2 * euler_characteristic} pi, which cones of {kind} curvature alone cannot carry"
        )
    return Limits(least, most, total)


def required_vertices(required: Iterable[int], is_boundary: BoolArray) -> IntArray:
    """Return the required cones as an array, checked."""
    cones = np.array(list(required), dtype=np.int64)
    bad = cones[(cones < 0) | (cones >= len(is_boundary))]
    if len(bad):
        raise OptionError(f"required cones are no vertices of the mesh: {list_some(bad)}")
    if len(np.unique(cones)) < len(cones):
        raise OptionError("a required cone is given twice")
    if is_boundary[cones].any():
        raise OptionError(f"required cones lie on the boundary: {list_some(cones[is_boundary[cones]])}")
    return cones
