"""Least squares conformal maps (B. Levy, S. Petitjean, N. Ray, J. Maillot 2002)."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..conformal.energy import conformal_equations
from ..errors import MetricError
from ..layout.least_squares import far_pins, pinned_least_squares
from ..mesh import TriangleMesh


def least_squares_conformal(
    disk: TriangleMesh, lengths: FloatArray, pins: IntArray | None = None
) -> FloatArray:
    """Return (n, 2) the map of a disk that keeps shapes best, in the least squares sense, with two vertices pinned.

    It minimises the energy of Eq. 4 and 5 of the paper. Triangles may be turned over. The pins decide on
    more than place and size: scale varies with them.

    Args:
        disk: a topological disk.
        lengths: (m, 3) side lengths; every triangle has area.
        pins: (2,) the vertices that go to (0, 0) and (1, 0); by default two far apart.

    Raises:
        MetricError: there is no finite solution.
    """
    if pins is None:
        pins = far_pins(disk, lengths)
    z = pinned_least_squares(conformal_equations(disk, lengths), pins)
    if not np.isfinite(z).all():
        raise MetricError(f"the least squares conformal map of {len(disk.faces):,} triangles is not finite")
    return np.stack([z.real, z.imag], axis=1)
