"""The conformal energy of maps to the plane: how far they are from keeping angles."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from .._arrays import FloatArray
from ..errors import MetricError
from ..geometry import corner_angles, double_areas
from ..mesh import TriangleMesh
from ..text import plural


def conformal_equations(mesh: TriangleMesh, lengths: FloatArray) -> csr_matrix:
    """Return the complex (m, n) matrix C that vanishes on maps z to the plane that are similarities on triangles.

    |C z|^2 is the least squares energy of Levy et al. 2002 (Eq. 4): the rows are the sides opposite the corners, as
    complex numbers in a frame of the triangle, over the root of its area. It is scaled so that it equals z^H L_C z,
    twice the Dirichlet energy less the area (Mullen et al. 2008, Section 2.2).

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths; every triangle has area.

    Raises:
        MetricError: one has none.
    """
    areas = double_areas(lengths)
    if not (areas > 0).all():
        raise MetricError(
            f"{int((~(areas > 0)).sum())} of {plural(len(areas), 'triangle')} without area have no conformal energy"
        )
    angles = corner_angles(lengths)
    # Walking around a triangle, one turns by the outer angles: side 0 runs ahead, from corner 1 to 2.
    directions = np.stack([np.zeros(len(angles)), np.pi - angles[:, 2], np.pi + angles[:, 1]], axis=1)
    sides = lengths * np.exp(1j * directions) / np.sqrt(2 * areas)[:, None]
    rows = np.repeat(np.arange(len(sides)), 3)
    return csr_matrix((sides.ravel(), (rows, mesh.faces.ravel())), shape=(len(sides), len(mesh.vertices)))
