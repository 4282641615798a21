"""Areas at vertices, and the norm that goes with them."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..errors import OptionError
from .triangles import double_areas


def vertex_areas(faces: IntArray, lengths: FloatArray, vertex_count: int) -> FloatArray:
    """Return (n,) a third of the area of the triangles at each vertex."""
    thirds = np.repeat(double_areas(lengths) / 6, 3)
    return np.bincount(faces.ravel(), weights=thirds, minlength=vertex_count).astype(np.float64)


def area_distortion(log_scale: FloatArray, areas: FloatArray) -> float:
    """Return E, the standard deviation of the log scale by area: 0 for a map that scales all alike."""
    mean = np.average(log_scale, weights=areas)
    return float(np.sqrt(np.average((log_scale - mean) ** 2, weights=areas)))


def weighted_areas(areas: FloatArray, weights: FloatArray | None) -> FloatArray:
    """Return (n,) areas times weights, made to sum to 1."""
    if weights is None:
        return areas / areas.sum()
    if np.shape(weights) != areas.shape or not np.isfinite(weights).all() or (weights < 0).any():
        raise OptionError(f"importance weights must be {len(areas)} numbers that are finite and not negative")
    share = areas * weights
    if not share.sum() > 0:
        raise OptionError("importance weights are zero everywhere")
    return share / share.sum()
