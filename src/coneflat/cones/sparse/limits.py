"""Bounds and sum of the curvatures of cones, and the smallest number of cones that satisfies them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.arrays import BoolArray, FloatArray, IntArray
from ...base.text import plural
from ...errors import CurvatureError, OptionError
from ...mesh.connectivity import TriangleMesh
from ..solution import TIE_TOLERANCE

# Largest number of cones searched for, in addition to the required ones: seams through more cones are useless.
MAX_SEARCHED = 200
# Cone angle per triangle around a cone, radians, up to which the triangles can realise it with straight sides. It is
# less than pi, since the angle cannot be distributed evenly over the triangles.
CONE_ANGLE_PER_TRIANGLE = 0.6 * np.pi
# On meshes with this number of vertices, a neighbouring vertex is as good for a cone. The corners at a cone, all
# widened by the same factor, must then not exceed this angle. Otherwise a triangle with straight sides may be unable to
# realise its corner, and the search has to be repeated, which takes 14% of the time on a horse of 97,000 triangles.
FINE_VERTICES, MAX_CORNER = 30_000, 0.95 * np.pi


def largest_cone_angles(mesh: TriangleMesh, widest: FloatArray) -> FloatArray:
    """Return (n,) the largest cone angle that the triangles at each vertex can realise, radians.

    Args:
        mesh: connected mesh.
        widest: (n,) largest corner angle at each vertex, divided by the angle sum there.
    """
    triangles = np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
    angles = CONE_ANGLE_PER_TRIANGLE * triangles + np.pi * mesh.is_boundary_vertex
    if len(angles) >= FINE_VERTICES:
        angles = np.minimum(angles, MAX_CORNER / widest)
    return angles.astype(np.float64)


@dataclass(frozen=True)
class Limits:
    """Bounds and sum of the curvatures of cones.

    Attributes:
        least, most: bounds of the curvature of each cone, radians.
        total: sum of the curvatures, radians; NaN on a mesh with boundary, which absorbs the remaining curvature.
    """

    lower: float
    upper: float
    total: float

    @classmethod
    def of_angles(
        cls,
        euler_characteristic: float | None,
        min_cone_angle: float,
        max_cone_angle: float | None,
        positive_only: bool,
    ) -> Limits:
        """Return the limits for bounds of the cone angles.

        Args:
            euler_characteristic: chi of a closed mesh; None for a mesh with boundary.
            min_cone_angle, max_cone_angle: radians; None for no upper bound.
            positive_only: allow positive curvatures only.

        Raises:
            OptionError: no angle satisfies the bounds.
            CurvatureError: cones of these angles cannot have the sum of curvatures of the surface.
        """
        if not 0 < min_cone_angle < math.inf:
            raise OptionError(f"the smallest cone angle must be positive, got {min_cone_angle:g} radians")
        if max_cone_angle is not None and not max_cone_angle > min_cone_angle:
            raise OptionError(
                f"the largest cone angle ({max_cone_angle:g} radians) must exceed the smallest ({min_cone_angle:g})"
            )
        lower = -math.inf if max_cone_angle is None else math.tau - max_cone_angle
        if positive_only:
            lower = max(lower, 0.0)
        upper = math.tau - min_cone_angle
        if positive_only and upper <= 0:
            raise OptionError("cones of positive curvature have angles below 2 pi: allow smaller angles")
        if euler_characteristic is None:
            return cls(lower, upper, math.nan)
        total = math.tau * euler_characteristic
        if (total > 0 and upper <= 0) or (total < 0 and lower >= 0):
            kind = "positive" if total < 0 else "negative"
            raise CurvatureError(
                f"a surface of Euler characteristic {euler_characteristic:g} has a total curvature of "
                f"{2 * euler_characteristic:g} pi, which cones of {kind} curvature alone cannot absorb"
            )
        return cls(lower, upper, total)

    @property
    def has_sum(self) -> bool:
        """Whether the sum of the curvatures is prescribed."""
        return not math.isnan(self.total)

    @property
    def fewest(self) -> int:
        """The smallest number of cones that can absorb the total curvature."""
        if not self.has_sum or abs(self.total) < TIE_TOLERANCE:
            return 0
        bound = self.upper if self.total > 0 else self.lower
        return math.ceil(self.total / bound - 1e-9) if math.isfinite(bound) else 1

    @property
    def largest(self) -> int | None:
        """The largest number of cones that the total curvature allows; None for any."""
        if self.has_sum and self.total > 0 and self.lower > 0:
            return int(self.total / self.lower + 1e-9)
        return None

    def text(self) -> str:
        """Return the bounds as text for a message."""
        if not math.isfinite(self.lower):
            return f"up to {self.upper / math.pi:.4g} pi"
        return f"{self.lower / math.pi:.4g} pi to {self.upper / math.pi:.4g} pi"

    def check_available(self, usable: BoolArray, required: IntArray) -> None:
        """Raise CurvatureError if cones at the usable (n,) and the required vertices cannot absorb the curvature."""
        if self.fewest > MAX_SEARCHED + len(required):
            raise CurvatureError(
                f"a total curvature of {self.total / np.pi:.4g} pi needs {self.fewest:,} cones or more within these "
                f"bounds, and the sparse search finds {MAX_SEARCHED} at most: allow other angles, or choose the "
                "greedy search (--cones greedy), which has no bounds"
            )
        available = np.count_nonzero(usable) + np.count_nonzero(~usable[required])
        if available < self.fewest:
            raise CurvatureError(
                f"cones are allowed at {plural(available, 'vertex', 'vertices')}, but {self.fewest} or more cones are "
                f"needed for a total curvature of {self.total / np.pi:.4g} pi"
            )

    def check_count(self, count: int, required: int) -> None:
        """Raise an error if `count` cones, of which `required` are given, cannot absorb the curvature."""
        if isinstance(count, bool) or count != int(count) or count < 0:
            raise OptionError(f"the number of cones must be an integer and not negative, got {count!r}")
        if count < required:
            raise CurvatureError(f"{plural(required, 'cone')} required, but only {count} allowed")
        if count < self.fewest:
            bound = self.upper if self.total > 0 else self.lower
            share = f" of at most {abs(bound) / np.pi:.4g} pi each" if np.isfinite(bound) else ""
            raise CurvatureError(
                f"{plural(count, 'cone')}{share} cannot absorb this surface's total curvature of "
                f"{self.total / np.pi:.4g} pi: {self.fewest} or more are needed"
            )
