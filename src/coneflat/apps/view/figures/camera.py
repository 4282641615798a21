"""Orthographic cameras, which map points of a model to pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ....base import FloatArray, short_repr
from ....errors import OptionError

SIDES = ("front", "back", "left", "right", "top", "bottom")
"""Names of directions; left and right are as seen by a viewer in front of the model."""

Eye: TypeAlias = "str | ArrayLike"
"""Direction from the model to the eye: a (3,) vector, the name of a side, or two names such as "front-right"."""


@dataclass(frozen=True, eq=False)
class Camera:
    """An orthographic view into a picture of `width` by `height` pixels.

    Attributes:
        axes: (3, 3) rows are unit vectors to the right, up, and from the model to the eye.
        centre: (3,) the point in the middle of the picture, model units.
        scale: pixels per model unit.
        width, height: size of the picture in pixels.
    """

    axes: FloatArray
    centre: FloatArray
    scale: float
    width: int
    height: int

    def project(self, points: ArrayLike) -> FloatArray:
        """Return (..., 3) pixel coordinates of points: x to the right, y downwards, depth away from the eye."""
        right, up, depth = np.moveaxis((np.asarray(points) - self.centre) @ self.axes.T, -1, 0)
        x, y = self.width / 2 + self.scale * right, self.height / 2 - self.scale * up
        return np.stack([x, y, -self.scale * depth], axis=-1)

    def enlarged(self, factor: int) -> Camera:
        """Return the same view in a picture of `factor` times the width and height."""
        return Camera(self.axes, self.centre, self.scale * factor, self.width * factor, self.height * factor)


def fit_camera(
    vertices: ArrayLike, size: tuple[int, int], eye: Eye = "front-right", up: str = "y", margin: float = 0.03
) -> Camera:
    """Return the camera for which the vertices fill the picture.

    Args:
        vertices: (n, 3) positions.
        size: width and height in pixels.
        eye: direction from the model to the eye, see `eye_direction`.
        up: the model's upward axis, "x", "y" or "z".
        margin: fraction of the picture left free on each side.

    Raises:
        OptionError: `up` or `eye` is not valid.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    upward, backward = _upward(up), eye_direction(eye, up)
    backward = backward / np.linalg.norm(backward)
    right = np.cross(upward, backward)
    if np.linalg.norm(right) < 1e-9:  # From above or below, another axis points up.
        right = np.cross(np.roll(upward, 1), backward)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(backward, right), backward])
    rotated = vertices @ axes.T
    low, high = rotated.min(axis=0), rotated.max(axis=0)
    extent = np.maximum(high - low, np.finfo(np.float64).tiny)
    width, height = size
    scale = (1.0 - 2.0 * margin) * min(width / extent[0], height / extent[1])
    return Camera(axes, (low + high) / 2 @ axes, float(scale), width, height)


def view_aspect(vertices: ArrayLike, eye: Eye = "front-right", up: str = "y") -> float:
    """Return the ratio of width to height of a view of the vertices, clamped to 1/4 to 4.

    Raises:
        OptionError: `up` or `eye` is not valid.
    """
    camera = fit_camera(vertices, (1, 1), eye, up)
    width, height = np.ptp(camera.project(vertices), axis=0)[:2]
    return float(np.clip(width / max(height, np.finfo(np.float64).tiny), 0.25, 4.0))


def eye_direction(eye: Eye, up: str = "y") -> FloatArray:
    """Return the (3,) direction from the model to the eye.

    Args:
        eye: a vector in model axes; or a side, "front", "back", "left", "right", "top" or "bottom"; or two of them,
            such as "front-right", for a three-quarter view that shows more of the first.
        up: the model's upward axis, "x", "y" or "z".

    Raises:
        OptionError: `up` or `eye` is not valid.
    """
    upward = _upward(up)
    if not isinstance(eye, str):
        direction = np.asarray(eye, dtype=np.float64)
        if direction.shape != (3,) or not np.isfinite(direction).all() or not direction.any():
            raise OptionError(f"the direction to the eye must be three numbers, not all 0, got {eye!r}")
        return direction
    right = np.roll(upward, -1 if up == "y" else 1)
    front = np.cross(right, upward)
    sides = dict(zip(SIDES, (front, -front, -right, right, upward, -upward), strict=True))
    words = eye.split("-")
    if not all(word in sides for word in words) or len(words) > 2:
        raise OptionError(f"unknown eye {eye!r}: choose from {', '.join(SIDES)}, or two of them: front-right")
    if len(words) == 1:
        return sides[eye]
    # The view shows three sides of a box, one of them the top.
    first, second = (sides[word] for word in words)
    if first @ second:
        raise OptionError(f"unknown eye {eye!r}: {words[0]} and {words[1]} cannot be combined")
    return np.asarray(0.75 * first + 0.55 * second + 0.38 * upward * (not (first + second) @ upward))


def _upward(up: str) -> FloatArray:
    if not isinstance(up, str) or up not in ("x", "y", "z"):  # Arrays cannot be compared with strings.
        raise OptionError(f'the upward axis must be "x", "y" or "z", got {short_repr(up)}')
    return np.eye(3)["xyz".index(up)]
