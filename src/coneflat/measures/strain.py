"""Strain of a map: the relative changes of the lengths of edges."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.jit import compiled


class Strain(NamedTuple):
    """Relative changes of the lengths of edges.

    Attributes:
        of_triangles: (m,) that of the side of each triangle that changes most, at the scale that keeps the total length
            of all edges; NaN for triangles without area on the model.
        mean: the mean absolute value of edges at this scale, weighted by length.
        largest: the largest absolute value, at the scale where it is least.

    Notes:
        An edge inside a chart counts once, and so does each side of a seam. The scale of the largest one is that of the
        two extremes; where few edges are far off, all others would seem to be strained at it.
    """

    of_triangles: FloatArray
    mean: float
    largest: float


def strain_of(
    vertices: FloatArray, faces: IntArray, corner_uv: FloatArray, is_chosen: BoolArray, is_inner: BoolArray
) -> Strain:
    """Return the strain of a map.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3) triangles.
        corner_uv: (m, 3, 2) the UV point of every triangle corner.
        is_chosen: (m,) triangles that have area on the model.
        is_inner: (3m,) half-edges inside charts, of which each edge has two.
    """
    lengths, ratios = side_ratios(vertices, faces, np.ascontiguousarray(corner_uv, dtype=np.float64))
    ratios[~is_chosen] = np.nan
    is_known = np.isfinite(ratios)
    weights = np.where(is_known, lengths * np.where(is_inner.reshape(-1, 3), 0.5, 1.0), 0.0)
    mean_ratio = float(np.average(ratios[is_known], weights=weights[is_known])) if weights.any() else 0.0
    if not mean_ratio > 0:
        return Strain(np.full(len(faces), np.nan), float("nan"), float("nan"))
    sides = ratios / mean_ratio - 1
    mean = float(np.average(np.abs(sides[is_known]), weights=weights[is_known]))
    low, high = np.nanmin(sides) + 1, np.nanmax(sides) + 1
    return Strain(_largest_of_sides(sides), mean, float((high - low) / (high + low)))


def _largest_of_sides(sides: FloatArray) -> FloatArray:
    """Return (m,) of the numbers (m, 3) of the sides of each triangle the one of largest absolute value, or NaN."""
    amounts = np.where(np.isfinite(sides), np.abs(sides), -1.0)
    place = amounts.argmax(axis=1)[:, None]
    chosen = np.take_along_axis(sides, place, axis=1)[:, 0]
    return np.where(amounts.max(axis=1) >= 0, chosen, np.nan)


@compiled
def side_ratios(
    vertices: FloatArray, faces: IntArray, corner_uv: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return (m, 3) the lengths of the sides of triangles, and their lengths in the plane divided by these.

    Column i is opposite corner i; the ratio of a side without length is NaN.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3).
        corner_uv: (m, 3, 2).
    """
    lengths, ratios = np.empty((len(faces), 3)), np.empty((len(faces), 3))
    for f in range(len(faces)):
        for i in range(3):
            begin, end = (i + 1) % 3, (i + 2) % 3
            square = 0.0
            for x in range(3):
                square += (vertices[faces[f, end], x] - vertices[faces[f, begin], x]) ** 2
            lengths[f, i] = math.sqrt(square)
            flat = math.hypot(
                corner_uv[f, end, 0] - corner_uv[f, begin, 0], corner_uv[f, end, 1] - corner_uv[f, begin, 1]
            )
            ratios[f, i] = flat / lengths[f, i] if lengths[f, i] > 0.0 else np.nan
    return lengths, ratios
