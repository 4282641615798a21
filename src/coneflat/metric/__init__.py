"""Flat metrics: the linear metric of the paper and the exact discrete conformal metric."""

from .exact import ExactMetric, exact_metric
from .find import find_metric, loop_rotations
from .linear import linear_flat_metric, scaled_lengths

__all__ = [
    "ExactMetric",
    "exact_metric",
    "find_metric",
    "linear_flat_metric",
    "loop_rotations",
    "scaled_lengths",
]
