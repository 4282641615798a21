"""What the methods return: a surface cut and laid out in the plane, with its folds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ....base import FloatArray, IntArray
from ....geometry import dihedral_angles
from ....mesh import NEXT, PREVIOUS
from .cut_surface import CutSurface

# Smallest dihedral angle of a fold, radians: smaller ones are noise of the coordinates, and no one sees them.
MIN_FOLD_ANGLE = 1e-3


@dataclass(frozen=True, eq=False)
class Development:
    """A surface developed into the plane.

    Attributes:
        surface: the pieces, each anywhere.
        folds: (f, 2) points of fold lines.
        fold_angles: (f,) their dihedral angles in radians, positive for mountain folds seen from outside.
        notes: what could not be met, one sentence each.
    """

    surface: CutSurface
    folds: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    fold_angles: FloatArray = field(default_factory=lambda: np.empty(0))
    notes: tuple[str, ...] = ()


def find_folds(surface: CutSurface) -> tuple[IntArray, FloatArray]:
    """Return (f, 2) the points of the fold lines inside pieces, and (f,) their dihedral angles.

    The dihedral angle is that between the normals, radians: positive for a mountain seen from outside, else negative.
    """
    mesh = surface.mesh
    angles = dihedral_angles(mesh)
    is_fold = np.abs(angles) > MIN_FOLD_ANGLE
    is_fold[surface.seams] = False
    edges = np.flatnonzero(is_fold)
    triangle, corner = np.divmod(mesh.edge_halfedges[edges, 0], 3)
    points = [surface.corners[triangle, following[corner]] for following in (NEXT, PREVIOUS)]
    return np.stack(points, axis=1), angles[edges]
