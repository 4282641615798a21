"""Rendering of a triangle mesh with an orthographic camera: shaded, coloured or checkered, without hidden parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ....base import BoolArray, FloatArray, IntArray
from ....geometry import corner_normals, fill_nearest, signed_double_areas, unit_vectors
from ....io import DARK_CELL, LIGHT_CELL
from .camera import Camera, Eye, fit_camera


@dataclass(frozen=True, eq=False)
class Coverage:
    """The visible faces in a picture of h by w pixels; row 0 is at the top.

    Attributes:
        face: (h, w) the nearest face at the pixel's centre, -1 for the background.
        depth: (h, w) its depth there, infinite for the background.
    """

    face: IntArray
    depth: FloatArray

    @property
    def covered(self) -> BoolArray:
        """Return (h, w) whether each pixel shows a face."""
        return self.face >= 0


def rasterise(points: ArrayLike, faces: ArrayLike, width: int, height: int) -> Coverage:
    """Return the nearest face at every pixel centre.

    The intervals of pixels are half open, so two triangles that share an edge leave neither a gap nor an overlap:
    each pixel of a tiled region is counted once.

    Args:
        points: (n, 3) pixel x to the right, pixel y downwards, and depth away from the eye. The
            centre of pixel (row j, column i) lies at (i + 0.5, j + 0.5).
        faces: (m, 3) vertex indices, of either orientation.
        width, height: size of the picture in pixels.
    """
    face = np.full((height, width), -1, dtype=np.int64)
    depth = np.full((height, width), np.inf)
    points, faces = np.ascontiguousarray(points, np.float64), np.ascontiguousarray(faces, np.int64)
    fill_nearest(points, faces, depth, face)
    return Coverage(face, depth)


class Barycentrics:
    """Barycentric coordinates in projected triangles."""

    def __init__(self, points: FloatArray, faces: IntArray) -> None:
        """Take (n, 2) or (n, 3) points of the picture and (m, 3) faces."""
        corners = points[faces, :2]
        p, q, r = np.moveaxis(corners, 1, 0)
        total = signed_double_areas(corners)
        # These faces have normals that point away from the eye, because y runs downwards.
        self.is_clockwise = total > 0.0
        total = np.where(total == 0.0, np.inf, total)[:, None]  # Edge-on faces cover pixels by rounding only.
        # Gradients are computed once per face, because there are more pixels than faces.
        turn = np.array([1.0, -1.0])
        self._slopes = np.hstack([(r - p)[:, ::-1] * turn, (p - q)[:, ::-1] * turn]) / total
        self._first = p

    def footprint(self, corner_uv: FloatArray) -> FloatArray:
        """Return the (m, 2) change of u and v across one pixel in each triangle; corner_uv: (m, 3, 2)."""
        sides, slopes = corner_uv[:, 1:] - corner_uv[:, :1], self._slopes.reshape(-1, 2, 2)
        return np.abs(np.einsum("mku,mkx->mxu", sides, slopes)).sum(axis=1)

    def of(self, face: IntArray, column: IntArray, row: IntArray) -> FloatArray:
        """Return the (k, 3) barycentric coordinates of the centres of (k,) pixels in (k,) faces."""
        slopes, first = self._slopes[face], self._first[face]
        x, y = column + 0.5 - first[:, 0], row + 0.5 - first[:, 1]
        weights = np.empty((len(face), 3))
        weights[:, 1] = slopes[:, 0] * x + slopes[:, 1] * y
        weights[:, 2] = slopes[:, 2] * x + slopes[:, 3] * y
        weights[:, 0] = 1.0 - weights[:, 1] - weights[:, 2]
        return weights


def lambert(normals: FloatArray, axes: FloatArray) -> FloatArray:
    """Return the (k,) brightness of surface points under a key light, a head light and the sky.

    Args:
        normals: (k, 3) normals towards the eye, of any length, model axes.
        axes: (3, 3) axes of the camera.
    """
    seen = unit_vectors(normals) @ axes.T
    # The key light is at the upper left, as in drawings.
    key = np.maximum(seen @ unit_vectors(np.array([[-0.45, 0.65, 0.62]]))[0], 0.0)
    # At an outline the interpolated normal may point away from the eye although its face does not.
    return np.asarray(0.47 + 0.42 * key + 0.12 * np.maximum(seen[:, 2], 0.0) + 0.06 * seen[:, 1])


def checkerboard(uv: FloatArray, footprint: FloatArray, cell: float) -> FloatArray:
    """Return the (k, 1) fraction of light cells in each pixel, 0 to 1, of a checkerboard.

    The board is averaged over the footprint of the pixel in closed form, so cells smaller than a pixel become grey
    and do not flicker.

    Args:
        uv: (k, 2) UV point at the centre of each pixel.
        footprint: (k, 2) change of u and v across the pixel.
        cell: side of a cell in UV units.
    """
    low, high = (uv - footprint / 2) / cell, (uv + footprint / 2) / cell
    # Along one axis the board alternates +1 and -1; the integral of that is a triangle wave.
    mean = (_triangle_wave(high) - _triangle_wave(low)) / (high - low)
    return np.asarray(0.5 + 0.5 * mean.prod(axis=1, keepdims=True))


def downsample(image: FloatArray, covered: BoolArray, factor: int) -> FloatArray:
    """Return the (h, w, 4) RGBA picture of an image `factor` times as large, with antialiased outlines.

    Args:
        image: (factor h, factor w, 3) colours, black outside the model.
        covered: (factor h, factor w) whether a sample shows the model; elsewhere the picture is transparent.
        factor: samples per pixel along each axis.
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


SUPERSAMPLING = 2
"""Samples per pixel along each axis; two give smooth outlines at print resolution."""

DEPTH_TOLERANCE = 0.008
"""Depth by which a visible point may lie behind the surface at its pixel, as a fraction of the longer side. Seams run
along edges, where the centre of a pixel may be on a face that is slightly nearer."""


@dataclass(frozen=True, eq=False)
class MeshPicture:
    """A picture of a mesh, with the data needed to draw on it.

    Attributes:
        image: (h, w, 4) RGBA, transparent where there is no model; row 0 at the top.
        camera: maps model points to the pixels of this image.
        coverage: the visible face at every sample.
    """

    image: FloatArray
    camera: Camera
    coverage: Coverage

    def visible_points(self, points: ArrayLike, reach: float = 0.0) -> BoolArray:
        """Return whether (k, 3) points on the surface are visible.

        reach: a point is also visible if the surface does not hide it at one of four places `reach` pixels away.
        """
        projected = self.camera.enlarged(SUPERSAMPLING).project(points)
        height, width = self.coverage.face.shape
        tolerance = DEPTH_TOLERANCE * max(height, width)
        # A frame of background is added, because nothing is hidden outside the picture.
        depth = np.pad(self.coverage.depth, 1, constant_values=np.inf)
        visible = np.zeros(len(projected), dtype=bool)
        for side in ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)) if reach else ((0, 0),):
            column, row = (
                np.floor(projected[:, :2] + SUPERSAMPLING * reach * np.array(side)).astype(np.int64).T
            )
            seen = depth[np.clip(row + 1, 0, height + 1), np.clip(column + 1, 0, width + 1)]
            visible |= projected[:, 2] <= seen + tolerance
        inside = (projected[:, :2] >= 0) & (projected[:, :2] < [width, height])
        return np.asarray(visible & inside.all(axis=1))

    def split_segments(self, start: ArrayLike, stop: ArrayLike) -> tuple[FloatArray, BoolArray]:
        """Return segments on the surface, split where they become hidden, and whether each piece is visible.

        Args:
            start, stop: (k, 3) end points of the segments, model units.

        Returns:
            (p, 2, 2) end points of the pieces in pixels of the image, and (p,) whether each is visible.
        """
        start, stop = np.asarray(start, dtype=np.float64), np.asarray(stop, dtype=np.float64)
        if not len(start):
            return np.empty((0, 2, 2)), np.empty(0, dtype=bool)
        length = np.linalg.norm(stop - start, axis=1) * self.camera.scale
        steps = np.maximum(np.ceil(length / 2.0), 1.0).astype(np.int64)
        owner = np.repeat(np.arange(len(start)), steps)
        step = np.arange(len(owner)) - np.repeat(np.cumsum(steps) - steps, steps)

        def point(offset: float) -> FloatArray:
            share = ((step + offset) / steps[owner])[:, None]
            return np.asarray((1.0 - share) * start[owner] + share * stop[owner])

        # Lines along outlines are tested within about their width, so that they are not interrupted.
        visible = self.visible_points(point(0.5), 1.5)
        # A piece consists of consecutive steps of one segment with the same visibility.
        change = np.flatnonzero((np.diff(owner) != 0) | np.diff(visible))
        first, last = np.append(0, change + 1), np.append(change, len(owner) - 1)
        pieces = np.stack([point(0.0)[first], point(1.0)[last]], axis=1)
        return self.camera.project(pieces)[..., :2], visible[first]


def render_mesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    size: tuple[int, int] = (900, 900),
    eye: Eye = "front-right",
    up: str = "y",
    colors: ArrayLike | None = None,
    corner_uv: ArrayLike | None = None,
    cell: float | None = None,
    contrast: float = 1.0,
    margin: float = 0.01,
) -> MeshPicture:
    """Return a shaded picture of a mesh, in orthographic projection.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3) vertex indices.
        size: width and height in pixels.
        eye: direction from the model to the eye, see `eye_direction`.
        up: the model's upward axis, "x", "y" or "z".
        colors: (m, 3) RGB of each face, or (m, 3, 3) of each triangle corner, 0 to 1; default: one light grey.
        corner_uv: (m, 3, 2) UV points; with `cell`, a checkerboard replaces the colours.
        cell: side of the cells of the checkerboard in UV units.
        contrast: strength of light and shadow; 0 for no shading.
        margin: fraction of the picture left free on each side.

    Raises:
        OptionError: `up` or `eye` is not valid.
    """
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64)
    camera = fit_camera(vertices[np.unique(faces)], size, eye, up, margin)
    fine = camera.enlarged(SUPERSAMPLING)
    points = fine.project(vertices)
    coverage = rasterise(points, faces, fine.width, fine.height)
    places = Barycentrics(points, faces)
    if corner_uv is not None and cell is not None:
        paint = _board(places, np.asarray(corner_uv, dtype=np.float64), cell)
    else:
        paint = _plain(np.broadcast_to(np.array(LIGHT_CELL), faces.shape) if colors is None else colors)
    light = _light(vertices, faces, places.is_clockwise, coverage, camera)
    strips = []
    # About 60,000 samples are shaded at once, which fit into caches. The picture does not depend on it.
    rows = SUPERSAMPLING * max(60_000 // SUPERSAMPLING // fine.width, 1)
    for top in range(0, fine.height, rows):
        face = coverage.face[top : top + rows]
        row, column = np.nonzero(face >= 0)
        seen = face[row, column]
        weights = places.of(seen, column, row + top)
        image = np.zeros((*face.shape, 3))
        shade = 1.0 + contrast * (light(seen, weights) - 1.0)
        image[row, column] = paint(seen, weights) * shade[:, None]
        strips.append(downsample(image, face >= 0, SUPERSAMPLING))
    return MeshPicture(np.concatenate(strips), camera, coverage)


_Shader: TypeAlias = Callable[[IntArray, FloatArray], FloatArray]
"""Function that returns values of samples from their (k,) faces and (k, 3) barycentric coordinates."""


def _plain(colors: ArrayLike) -> _Shader:
    """Return a function for the colours of samples: that of the face, or interpolated between its corners."""
    colours = np.asarray(colors, dtype=np.float64)

    def paint(seen: IntArray, weights: FloatArray) -> FloatArray:
        colour = colours[seen]
        return colour if colour.ndim == 2 else np.einsum("kc,kcd->kd", weights, colour)

    return paint


def _board(places: Barycentrics, corner_uv: FloatArray, cell: float) -> _Shader:
    """Return a function for the colours of samples on a checkerboard."""
    # A footprint must be positive, or its mean is 0 / 0; this minimum is not visible.
    footprint = np.maximum(places.footprint(corner_uv), 1e-6 * cell)
    bright, dark = np.array(LIGHT_CELL), np.array(DARK_CELL)

    def paint(seen: IntArray, weights: FloatArray) -> FloatArray:
        uv = np.einsum("kc,kcd->kd", weights, corner_uv[seen])
        share = checkerboard(uv, footprint[seen], cell)
        return np.asarray(share * bright + (1.0 - share) * dark)

    return paint


def _light(
    vertices: FloatArray, faces: IntArray, away: BoolArray, coverage: Coverage, camera: Camera
) -> _Shader:
    """Return a function for the brightness of samples; away: (m,) whether faces are clockwise in the picture."""
    normals = np.where(away[:, None, None], -1.0, 1.0) * corner_normals(vertices, faces)
    # Faces may have either orientation; the side that most of the picture shows is taken as the outside.
    visible = np.bincount(coverage.face[coverage.covered], minlength=len(faces))
    inner = ~away if visible[away].sum() > visible.sum() / 2 else away

    def light(seen: IntArray, weights: FloatArray) -> FloatArray:
        normal = np.einsum("kc,kcd->kd", weights, normals[seen])
        return np.asarray(lambert(normal, camera.axes) * np.where(inner[seen], 0.62, 1.0))

    return light
