"""An orthographic camera: from where a model is seen, and where its points are in the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ....base import FloatArray, shown
from ....errors import OptionError

SIDES = ("front", "back", "left", "right", "top", "bottom")
"""Words for directions; left and right are those of who stands in front of the model."""

Eye: TypeAlias = "str | ArrayLike"
"""Where the eye is, as seen from the model: (3,) a direction, or a side, or two such as "front-right"."""


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
    vertices: ArrayLike, size: tuple[int, int], eye: Eye = "front-right", up: str = "y", margin: float = 0.03
) -> Camera:
    """Return the camera at which the vertices just fill the picture.

    Args:
        vertices: (n, 3) positions.
        size: width and height in pixels.
        eye: direction from the model to the eye, see `eye_direction`.
        up: the model's upward axis, "x", "y" or "z".
        margin: share of the picture left free at each side.

    Raises:
        OptionError: `up` names no axis, or `eye` no direction.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    upward, near = _upward(up), eye_direction(eye, up)
    near = near / np.linalg.norm(near)
    right = np.cross(upward, near)
    if np.linalg.norm(right) < 1e-9:  # unit vectors: straight from above, any side is upward
        right = np.cross(np.roll(upward, 1), near)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(near, right), near])
    turned = vertices @ axes.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    extent = np.maximum(high - low, np.finfo(np.float64).tiny)
    width, height = size
    scale = (1.0 - 2.0 * margin) * min(width / extent[0], height / extent[1])
    return Camera(axes, (low + high) / 2 @ axes, float(scale), width, height)


def view_aspect(vertices: ArrayLike, eye: Eye = "front-right", up: str = "y") -> float:
    """Return the width of a view of the vertices over its height, at least 1/4 and at most 4.

    Raises:
        OptionError: `up` names no axis, or `eye` no direction.
    """
    camera = fit_camera(vertices, (1, 1), eye, up)
    width, height = np.ptp(camera.project(vertices), axis=0)[:2]
    return float(np.clip(width / max(height, np.finfo(np.float64).tiny), 0.25, 4.0))


def eye_direction(eye: Eye, up: str = "y") -> FloatArray:
    """Return the (3,) direction from the model to the eye.

    Args:
        eye: a direction in model axes; or a side, "front", "back", "left", "right", "top" or "bottom", seen straight
            on; or two of them, such as "front-right", for a three-quarter view that shows more of the first.
        up: the model's upward axis, "x", "y" or "z".

    Raises:
        OptionError: `up` names no axis, or `eye` no direction.
    """
    upward = _upward(up)
    if not isinstance(eye, str):
        direction = np.asarray(eye, dtype=np.float64)
        if direction.shape != (3,) or not np.isfinite(direction).all() or not direction.any():
            raise OptionError(f"a direction to the eye has three numbers, not all 0, unlike {eye!r}")
        return direction
    right = np.roll(upward, -1 if up == "y" else 1)
    front = np.cross(right, upward)
    sides = dict(zip(SIDES, (front, -front, -right, right, upward, -upward), strict=True))
    words = eye.split("-")
    if not all(word in sides for word in words) or len(words) > 2:
        raise OptionError(f"unknown eye {eye!r}: choose from {', '.join(SIDES)}, or two of them: front-right")
    if len(words) == 1:
        return sides[eye]
    # A view that shows three sides of a box, from above.
    one, two = (sides[word] for word in words)
    if one @ two:
        raise OptionError(f"no eye is {words[0]} and {words[1]} of a model")
    return np.asarray(0.75 * one + 0.55 * two + 0.38 * upward * (not (one + two) @ upward))


def _upward(up: str) -> FloatArray:
    if not isinstance(up, str) or up not in ("x", "y", "z"):  # arrays cannot be compared with words
        raise OptionError(f'the upward axis must be "x", "y" or "z", not {shown(up)}')
    axis: FloatArray = np.eye(3)["xyz".index(up)]
    return axis
