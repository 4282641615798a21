"""An orthographic camera that fits a model into a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import FloatArray
from ..errors import OptionError

THREE_QUARTERS = (0.55, 0.38, 0.75)
"""The default eye as seen from the model: to the right, up and in front; shows three sides of a box."""


@dataclass(frozen=True, eq=False)
class Camera:
    """An orthographic view into a picture of `width` by `height` pixels.

    Attributes:
        axes: (3, 3) rows are unit vectors to the right, up, and from the model to the eye.
        centre: (3,) the point that lands in the middle of the picture, model units.
        scale: pixels per model unit.
        width, height: size of the picture in pixels.
    """

    axes: FloatArray
    centre: FloatArray
    scale: float
    width: int
    height: int

    def project(self, points: ArrayLike) -> FloatArray:
        """Return (..., 3): pixel x to the right, pixel y downwards, depth away from the eye, in pixels."""
        right, up, near = np.moveaxis((np.asarray(points) - self.centre) @ self.axes.T, -1, 0)
        x, y = self.width / 2 + self.scale * right, self.height / 2 - self.scale * up
        return np.stack([x, y, -self.scale * near], axis=-1)

    def enlarged(self, factor: int) -> Camera:
        """Return the same view in a picture of `factor` times the width and height."""
        return Camera(self.axes, self.centre, self.scale * factor, self.width * factor, self.height * factor)


def fit_camera(
    vertices: ArrayLike,
    size: tuple[int, int],
    eye: ArrayLike | None = None,
    up: str = "y",
    margin: float = 0.03,
) -> Camera:
    """Return the camera at which the vertices just fill the picture.

    Args:
        vertices: (n, 3) positions.
        size: width and height in pixels.
        eye: (3,) direction from the model to the eye; default: three quarters from the front.
        up: the model's upward axis, "x", "y" or "z".
        margin: share of the picture left free at each side.

    Raises:
        OptionError: `up` names no axis.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    axes = _axes(default_eye(up) if eye is None else np.asarray(eye, dtype=np.float64), _upward(up))
    turned = vertices @ axes.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    extent = np.maximum(high - low, np.finfo(np.float64).tiny)
    width, height = size
    scale = (1.0 - 2.0 * margin) * min(width / extent[0], height / extent[1])
    return Camera(axes, (low + high) / 2 @ axes, float(scale), width, height)


def default_eye(up: str = "y", behind: bool = False) -> FloatArray:
    """Return the (3,) direction to the eye of the three-quarter view from the front, or from behind.

    Raises:
        OptionError: `up` names no axis.
    """
    upward = _upward(up)
    side = np.roll(upward, -1 if up == "y" else 1)
    front = np.cross(side, upward)
    right, above, forward = THREE_QUARTERS
    turn = -1.0 if behind else 1.0
    return np.asarray(turn * right * side + above * upward + turn * forward * front)


def _upward(up: str) -> FloatArray:
    if up not in {"x", "y", "z"}:
        raise OptionError(f'the upward axis must be "x", "y" or "z", not {up!r}')
    axis: FloatArray = np.eye(3)["xyz".index(up)]
    return axis


def _axes(eye: FloatArray, upward: FloatArray) -> FloatArray:
    """Return the rows right, up and near; a view straight from above gets an arbitrary upward side."""
    near = eye / np.linalg.norm(eye)
    right = np.cross(upward, near)
    if np.linalg.norm(right) < 1e-9:  # unit vectors: the eye is on the upward axis
        right = np.cross(np.roll(upward, 1), near)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(near, right), near])
