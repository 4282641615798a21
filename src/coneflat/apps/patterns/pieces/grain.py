"""Pieces rotated so that their grain points up."""

from __future__ import annotations

import numpy as np

from ....base import FloatArray
from ....geometry import rotated_up, signed_double_areas
from .cut_surface import CutSurface


def grain_up(surface: CutSurface, axis: FloatArray) -> CutSurface:
    """Return a cut surface with each piece rotated so that a direction of the surface points up.

    Args:
        surface: the surface.
        axis: (3,) the direction.
    """
    points = surface.points.copy()
    areas = np.abs(signed_double_areas(surface.places))
    weights = np.bincount(surface.corners.ravel(), np.repeat(areas, 3), len(points)).astype(np.float64)
    for members in surface.points_of_pieces:
        positions = surface.mesh.vertices[surface.vertex_of_point[members]]
        points[members] = rotated_up(points[members], positions, np.asarray(axis), weights[members])
    return surface.with_points(points)
