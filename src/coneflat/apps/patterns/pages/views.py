"""Pictures of the model: its pieces in different colours, in place or moved apart, in perspective."""

from __future__ import annotations

from colorsys import hsv_to_rgb
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from ....base import FloatArray, IntArray
from ....geometry import fill_nearest, unit_vectors
from ...view import eye_direction, upward_axis
from ..pieces.cut_surface import CutSurface

# Directions from which the model may be seen, the first one preferred, and the size of the pictures that are compared.
EYES, TRIAL = ("front-right", "front-left", "back-right", "back-left"), (200, 200)
# Distance of the eye from the centre, in radii of the model.
EYE_DISTANCE = 4.0
# How far pieces are moved apart, in radii of the model.
EXPLOSION = 0.45
# Samples per pixel along each axis; brightness of a face that is seen edge-on, 1 for one that faces the eye.
SAMPLES, AMBIENT = 2, 0.62
# Colours of pieces: successive hues differ by the golden section; lines between pieces.
HUE_STEP, SATURATION, VALUE, BORDER = 0.618034, 0.38, 0.97, 0.25
# Radius of a circle within the visible part of a piece that its number needs, relative to the height of the picture.
MIN_VISIBLE = 0.012


@dataclass(frozen=True, eq=False)
class View:
    """A picture of the pieces.

    Attributes:
        pixels: (h, w, 3) colours from 0 to 255.
        numbers: pieces that are visible, with the place (2,) of their number, from 0 to 1 to the right and upward,
            and the radius of the circle that has room there, relative to the height.
    """

    pixels: NDArray[np.uint8]
    numbers: dict[int, tuple[FloatArray, float]]


def eye_and_up(surface: CutSurface, axis: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    """Return the direction to the eye that shows most pieces, obliquely from above, and the upward direction.

    axis: (3,) the upward direction of the model; None for the axis that probably points up.
    """
    mesh = surface.mesh
    name = upward_axis(mesh.vertices, mesh.faces) if axis is None else "xyz"[int(np.abs(axis).argmax())]
    upward = np.eye(3)["xyz".index(name)] if axis is None else np.asarray(axis, dtype=np.float64)
    upward = upward / np.linalg.norm(upward)
    eyes = unit_vectors(np.array([eye_direction(words, name) for words in EYES]))
    if axis is not None and axis["xyz".index(name)] < 0:
        eyes -= 2 * (eyes @ upward).clip(max=0)[:, None] * upward  # from above
    shown = [len(view_of(surface, TRIAL, eye, upward).numbers) for eye in eyes]
    return eyes[int(np.argmax(shown))], upward


def view_of(
    surface: CutSurface, size: tuple[int, int], eye: FloatArray, up: FloatArray, apart: bool = False
) -> View:
    """Return a picture of a cut surface.

    Args:
        surface: the surface.
        size: width and height in pixels.
        eye: (3,) unit vector to the eye.
        up: (3,) unit vector that points upward in the picture.
        apart: whether each piece is moved along its mean normal.
    """
    vertices, faces = _apart(surface, EXPLOSION) if apart else (surface.mesh.vertices, surface.mesh.faces)
    width, height = (SAMPLES * pixels for pixels in size)
    points = _projected(vertices, eye, up, width, height)
    depth, face = np.full((height, width), np.inf), np.full((height, width), -1, dtype=np.int64)
    fill_nearest(points, np.ascontiguousarray(faces, np.int64), depth, face)
    piece = np.where(face < 0, -1, surface.pieces[face])
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.abs(unit_vectors(normals) @ eye)
    colours = np.array([piece_colour(i) for i in range(int(surface.pieces.max()) + 1)])
    image = colours[piece] * (AMBIENT + (1 - AMBIENT) * facing[face])[..., None]
    image[piece < 0] = 1.0
    image[_is_border(piece)] = BORDER
    image = image.reshape(size[1], SAMPLES, size[0], SAMPLES, 3).mean(axis=(1, 3))
    return View(np.round(255 * image).astype(np.uint8), _numbers(piece))


def piece_colour(piece: int) -> tuple[float, float, float]:
    """Return the colour of a piece, from 0 to 1."""
    return hsv_to_rgb((0.08 + HUE_STEP * piece) % 1.0, SATURATION, VALUE)


def _apart(surface: CutSurface, distance: float) -> tuple[FloatArray, IntArray]:
    """Return the vertices (u, 3) and faces of the pieces, each moved along its mean normal."""
    mesh = surface.mesh
    radius = float(np.ptp(mesh.vertices, axis=0).max()) / 2
    corners = mesh.vertices[mesh.faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    count = int(surface.pieces.max()) + 1
    normals = np.zeros((count, 3))
    np.add.at(normals, surface.pieces, areas)
    moves = distance * radius * unit_vectors(normals)
    vertices = np.empty((len(surface.points), 3))
    vertices[surface.corners] = corners + moves[surface.pieces][:, None]
    return vertices, surface.corners


def _projected(vertices: FloatArray, eye: FloatArray, up: FloatArray, width: int, height: int) -> FloatArray:
    """Return (n, 3) the pixels of vertices, and their depth, which is linear across triangles in the picture."""
    right = np.cross(up, eye)
    if np.linalg.norm(right) < 1e-6:
        right = np.cross(np.roll(up, 1), eye)
    right = right / np.linalg.norm(right)
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    x, y, z = np.stack([right, np.cross(eye, right), eye]) @ (vertices - middle).T
    radius = float(np.sqrt(x**2 + y**2 + z**2).max())
    nearness = radius / (EYE_DISTANCE * radius - z)
    flat = np.stack([x * nearness, y * nearness], axis=1)
    low, extent = flat.min(axis=0), np.maximum(np.ptp(flat, axis=0), np.finfo(float).tiny)
    size = np.array([width, height])
    scale = float((0.94 * size / extent).min())
    columns, rows = ((flat - low - extent / 2) * scale).T
    return np.ascontiguousarray(np.stack([width / 2 + columns, height / 2 - rows, -nearness], axis=1))


def _is_border(piece: IntArray) -> NDArray[np.bool_]:
    """Return (h, w) the pixels beside one of another piece or of the background."""
    is_border = np.zeros(piece.shape, dtype=bool)
    differs = piece[:-1] != piece[1:]
    is_border[:-1] |= differs
    is_border[1:] |= differs
    differs = piece[:, :-1] != piece[:, 1:]
    is_border[:, :-1] |= differs
    is_border[:, 1:] |= differs
    return is_border & (piece >= 0)


def _numbers(piece: IntArray) -> dict[int, tuple[FloatArray, float]]:
    height, width = piece.shape
    numbers = {}
    for i in np.unique(piece[piece >= 0]).tolist():
        rows, columns = np.nonzero(piece == i)
        top, left = rows.min(), columns.min()
        part = np.pad(piece[top : rows.max() + 1, left : columns.max() + 1] == i, 1)
        distance = distance_transform_edt(part)
        row, column = np.unravel_index(int(distance.argmax()), part.shape)
        radius = float(distance.max()) / height
        if radius >= MIN_VISIBLE:
            place = np.array([(left + column - 0.5) / width, 1 - (top + row - 0.5) / height])
            numbers[i] = place, radius
    return numbers
