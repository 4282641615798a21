"""The paper's metric: a linear system for the log scale, an edge integral for the lengths."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..mesh import NEXT, PREVIOUS


def scaled_lengths(
    lengths: FloatArray, faces: IntArray, log_scale: FloatArray, rule: str = "integral"
) -> FloatArray:
    """Return (m, 3) side lengths after conformal scaling.

    Args:
        lengths: (m, 3) side lengths, model units.
        faces: (m, 3) vertex indices.
        log_scale: (n,) log conformal factor phi.
        rule: "integral" scales a side by the mean of exp(phi) along it, phi being linear there (Section
            2.3 of the paper); "mean" by exp of the mean of phi, which is the conformal equivalence of
            Springborn, Schroeder and Pinkall 2008.
    """
    tail, head = log_scale[faces[:, NEXT]], log_scale[faces[:, PREVIOUS]]
    scaled: FloatArray = lengths * np.exp((tail + head) / 2)
    if rule == "integral":
        # (e^b - e^a) / (b - a) = e^((a + b) / 2) sinh(d) / d with d = (b - a) / 2: no cancellation.
        scaled *= _sinhc((head - tail) / 2)
    return scaled


def _sinhc(x: FloatArray) -> FloatArray:
    """Return sinh(x) / x."""
    small = np.abs(x) < 1e-3  # the next term of the series is below 1e-16 there
    safe = np.where(small, 1.0, x)
    result: FloatArray = np.where(small, 1 + x**2 / 6 * (1 + x**2 / 20), np.sinh(safe) / safe)
    return result
