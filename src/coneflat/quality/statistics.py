"""How a metric and its layout were found, in numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True)
class SolveStatistics:
    """How a metric and its layout were found.

    Attributes:
        newton_steps: steps of Newton's method.
        euclidean_flips: edges flipped to make the input Delaunay.
        ptolemy_flips: edges flipped during the solve.
        residual: largest curvature error of the metric where curvature was prescribed, radians.
        broken: triangles of the metric that break the triangle inequality.
        untangled_triangles: triangles that were inverted on their straight sides, and were turned over.
        untangled_vertices: vertices that were moved for this.
        untangled_move: how far one was moved at most, relative to the mean edge around them.
        relaxed_vertices: vertices that were free to move so that triangles are less distorted.
        qc_mean_unrelaxed, qc_max_unrelaxed: the mean and the largest quasi-conformal distortion before; NaN where
            nothing was to be relaxed, and of polygons in a file, which programs split into triangles of their own.
        refined_triangles: triangles that were added by the common subdivision.
        split_triangles: triangles that were added where straight sides left some inverted.
        area_distortion_linear: E of the linear model that the cones were chosen in: the standard deviation of
            the log scale, by area (and importance, where weights were given).
        area_distortion: E of the metric that was laid out.
    """

    newton_steps: int = 0
    euclidean_flips: int = 0
    ptolemy_flips: int = 0
    residual: float = 0.0
    broken: int = 0
    untangled_triangles: int = 0
    untangled_vertices: int = 0
    untangled_move: float = 0.0
    relaxed_vertices: int = 0
    qc_mean_unrelaxed: float = float("nan")
    qc_max_unrelaxed: float = float("nan")
    refined_triangles: int = 0
    split_triangles: int = 0
    area_distortion_linear: float = 0.0
    area_distortion: float = 0.0

    @classmethod
    def of_all(cls, parts: Sequence[SolveStatistics], areas: Sequence[float]) -> SolveStatistics:
        """Return the statistics of components together: counts add up, means and deviations combine by area."""
        values = {}
        for field in fields(cls):
            every = np.array([getattr(part, field.name) for part in parts])
            if field.name in _MAXIMA:
                values[field.name] = every.max().item()
            elif field.name in _MEANS:
                values[field.name] = float(np.average(every, weights=areas))
            elif field.name in _DEVIATIONS:
                values[field.name] = float(np.sqrt(np.average(every**2, weights=areas)))
            else:
                values[field.name] = every.sum().item()
        return cls(**values)


_MAXIMA = ("newton_steps", "residual", "untangled_move", "qc_max_unrelaxed")
_MEANS = ("qc_mean_unrelaxed",)
_DEVIATIONS = ("area_distortion_linear", "area_distortion")
