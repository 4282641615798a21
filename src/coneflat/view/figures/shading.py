"""Light and surface colour of the covered pixels of a picture."""

from __future__ import annotations

import numpy as np

from ..._arrays import BoolArray, FloatArray
from ...geometry.normals import unit_vectors

KEY_LIGHT = (-0.45, 0.65, 0.62)
"""Towards the main light in camera axes (right, up, near): over the left shoulder, as in drawings."""

INNER_SIDE_DIM = 0.62
"""Brightness of the inner side of an open surface, so that it cannot be taken for the outer."""


def lambert(normals: FloatArray, axes: FloatArray) -> FloatArray:
    """Return the (k,) brightness of surface points under a key light, a head light and the sky.

    Args:
        normals: (k, 3) normals towards the eye, of any length, model axes.
        axes: (3, 3) the camera's axes.
    """
    seen = unit_vectors(normals) @ axes.T
    key = np.maximum(seen @ unit_vectors(np.array([KEY_LIGHT]))[0], 0.0)
    # At an outline the interpolated normal may point away from the eye though its face does not.
    return np.asarray(0.47 + 0.42 * key + 0.12 * np.maximum(seen[:, 2], 0.0) + 0.06 * seen[:, 1])


def checkerboard(uv: FloatArray, footprint: FloatArray, cell: float) -> FloatArray:
    """Return the (k, 1) share of light cells in each pixel, 0 to 1, of a board of square cells.

    The board is averaged over the pixel's footprint in closed form, so cells that shrink below a pixel
    fade to grey instead of flickering.

    Args:
        uv: (k, 2) point of each pixel's centre.
        footprint: (k, 2) how far u and v run across the pixel.
        cell: side of a cell in UV units.
    """
    low, high = (uv - footprint / 2) / cell, (uv + footprint / 2) / cell
    # Along one axis the board alternates +1 and -1; the integral of that is a triangle wave.
    mean = (_triangle_wave(high) - _triangle_wave(low)) / (high - low)
    return np.asarray(0.5 + 0.5 * mean.prod(axis=1, keepdims=True))


def uv_footprint(corners: FloatArray, corner_uv: FloatArray) -> FloatArray:
    """Return the (m, 2) run of u and v across one pixel in each triangle.

    Args:
        corners: (m, 3, 2) projected corners in pixels.
        corner_uv: (m, 3, 2) their UV points.
    """
    p, q = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    s, t = corner_uv[:, 1] - corner_uv[:, 0], corner_uv[:, 2] - corner_uv[:, 0]
    total = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    total = np.where(total == 0.0, np.inf, total)[:, None]
    along_x = (s * q[:, 1:] - t * p[:, 1:]) / total
    along_y = (t * p[:, :1] - s * q[:, :1]) / total
    return np.abs(along_x) + np.abs(along_y)


def downsample(image: FloatArray, covered: BoolArray, factor: int) -> FloatArray:
    """Return the (h, w, 4) RGBA picture from an image `factor` times as large, with soft outlines.

    Args:
        image: (factor h, factor w, 3) colours, black where it shows no model.
        covered: (factor h, factor w) where it shows the model; elsewhere the picture is transparent.
    """
    share = np.zeros((covered.shape[0] // factor, covered.shape[1] // factor))
    colour = np.zeros((*share.shape, 3))
    for i in range(factor):
        for j in range(factor):
            share += covered[i::factor, j::factor]
            colour += image[i::factor, j::factor]
    colour /= np.where(share > 0.0, share, 1.0)[..., None]
    return np.concatenate([np.clip(colour, 0.0, 1.0), share[..., None] / factor**2], axis=2)


def _triangle_wave(x: FloatArray) -> FloatArray:
    return np.asarray(1.0 - np.abs(np.mod(x, 2.0) - 1.0))
