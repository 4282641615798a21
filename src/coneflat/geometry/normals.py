"""How sharply a surface bends at its edges."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, dots
from ..mesh import TriangleMesh


def dihedral_angles(mesh: TriangleMesh) -> FloatArray:
    """Return (e,) the angle between the normals of the faces beside each edge, radians; 0 on the boundary.

    Where the faces run counterclockwise seen from outside, it is positive on ridges and negative in valleys.
    """
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    one, two = normals[mesh.edge_faces[:, 0]], normals[mesh.edge_faces[:, 1]]
    side = mesh.edge_halfedges[:, 0]
    along = mesh.vertices[mesh.heads[side]] - mesh.vertices[mesh.tails[side]]
    across = np.cross(one, two)
    angles = np.arctan2(np.sqrt(dots(across, across)), dots(one, two))
    return np.where(mesh.is_boundary_edge, 0.0, np.where(dots(across, along) < 0, -angles, angles))
