"""Means and quantiles of weighted values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.arrays import FloatArray


def weighted_mean(values: FloatArray, weights: FloatArray) -> float:
    """Return the weighted mean of values; NaN if there is no weight."""
    total = float(weights.sum())
    return float((values * weights).sum() / total) if total > 0 else float("nan")


def quantile(values: FloatArray, weights: FloatArray, fraction: float) -> float:
    """Return the weighted quantile of values for a fraction from 0 to 1; NaN for empty arrays."""
    return quantiles(values, weights, (fraction,))[0]


def quantiles(values: FloatArray, weights: FloatArray, fractions: Sequence[float]) -> list[float]:
    """Return the weighted quantiles of values for several fractions, see `quantile`."""
    if not len(values):
        return [float("nan")] * len(fractions)
    order = np.argsort(values)
    cumulated = np.cumsum(weights[order])
    places = np.searchsorted(cumulated, np.array(fractions) * cumulated[-1])
    return values[order[places]].tolist()
