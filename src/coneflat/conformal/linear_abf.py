"""Linear angle based flattening."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray
from .angle_conditions import AngleConditions, FoundAngles, excess_of, least_change

# Radians that an angle counts as at least, where the log of its sine is wanted.
TINY = 1e-9


def linear_angles(conditions: AngleConditions, wanted: FloatArray) -> FoundAngles:
    """Return the angles that fulfil the conditions to first order with the least relative change.

    R. Zayer, B. Levy, H.-P. Seidel, "Linear angle based parameterization", 2007: the logarithm of the wheel condition
    is expanded about the wanted angles. With the sums around vertices and in triangles, which are linear, it makes a
    system A x = b in the errors x of these angles; with D, diagonal, of the angles themselves, the D^-1 x of least
    norm is D A^T (A D^2 A^T)^-1 b: one solve. The angles are not bound to be positive, and fulfil wheel
    conditions up to the square of the errors.

    Args:
        conditions: to be fulfilled.
        wanted: (3m,) radians, positive and less than pi.
    """
    off, slopes = conditions.off(wanted), conditions.slopes(wanted)
    step = least_change(slopes, off, excess_of(wanted), wanted**-2, np.zeros_like(wanted))
    angles = wanted + step.change
    return FoundAngles(angles, 1, True, conditions.residual(np.clip(angles, TINY, np.pi - TINY)))
