"""Areas at vertices, and the norm that goes with them."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from .triangles import double_areas


def vertex_areas(faces: IntArray, lengths: FloatArray, vertex_count: int) -> FloatArray:
    """Return (n,) a third of the area of the triangles at each vertex."""
    thirds = np.repeat(double_areas(lengths) / 6, 3)
    return np.bincount(faces.ravel(), weights=thirds, minlength=vertex_count).astype(np.float64)


def area_distortion(log_scale: FloatArray, areas: FloatArray) -> float:
    """Return E, the standard deviation of the log scale by area: 0 for a map that scales all alike."""
    mean = np.average(log_scale, weights=areas)
    return float(np.sqrt(np.average((log_scale - mean) ** 2, weights=areas)))
