"""Flat charts as the corners of their triangles."""

from __future__ import annotations

import numpy as np


def as_complex(corners):
    return corners[..., 0] + 1j * corners[..., 1]


def star(points: int, inner: float, size: float, seed: int = 0):
    """A fan of triangles around the origin with an uneven rim."""
    angle = np.pi * np.arange(2 * points) / points
    radius = size * np.where(np.arange(2 * points) % 2, inner, 1.0)
    radius *= np.random.default_rng(seed).uniform(0.7, 1.0, 2 * points)
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return np.stack([np.zeros_like(rim), rim, np.roll(rim, -1, axis=0)], axis=1)


def letter_l(size: float):
    low = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    return size * np.concatenate([low, low + np.array([1, 0]), low + np.array([0, 1])]).astype(float)
