"""Pictures of a triangle mesh by an orthographic camera: shaded, coloured or checkered, hidden parts hidden."""

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
    """What a picture of h by w pixels sees; row 0 is at the top.

    Attributes:
        face: (h, w) the nearest face at the pixel's centre, -1 for the background.
        depth: (h, w) its depth there, infinite for the background.
    """

    face: IntArray
    depth: FloatArray

    @property
    def covered(self) -> BoolArray:
        """(h, w) whether the pixel shows a face."""
        return self.face >= 0


def rasterise(points: ArrayLike, faces: ArrayLike, width: int, height: int) -> Coverage:
    """Return the nearest face at every pixel centre.

    The spans of pixels are half open, so two triangles that share an edge leave neither a gap nor an
    overlap between them: the pixels of a tiled region are each counted once.

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
        """Take points (n, 2 or 3) of the picture and faces (m, 3)."""
        corners = points[faces, :2]
        p, q, r = np.moveaxis(corners, 1, 0)
        total = signed_double_areas(corners)
        # Faces whose normals point away from the eye, as y runs downwards.
        self.is_clockwise = total > 0.0
        total = np.where(total == 0.0, np.inf, total)[:, None]  # edge on, covered by rounding only
        # Per face once, per pixel a few products: pixels outnumber faces.
        turn = np.array([1.0, -1.0])
        self._slopes = np.hstack([(r - p)[:, ::-1] * turn, (p - q)[:, ::-1] * turn]) / total
        self._first = p

    def footprint(self, corner_uv: FloatArray) -> FloatArray:
        """Return the (m, 2) run of u and v across one pixel in each triangle; corner_uv: (m, 3, 2)."""
        sides, slopes = corner_uv[:, 1:] - corner_uv[:, :1], self._slopes.reshape(-1, 2, 2)
        return np.abs(np.einsum("mku,mkx->mxu", sides, slopes)).sum(axis=1)

    def of(self, face: IntArray, column: IntArray, row: IntArray) -> FloatArray:
        """Return the (k, 3) coordinates of the centres of pixels (k,) in faces (k,)."""
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
        axes: (3, 3) the camera's axes.
    """
    seen = unit_vectors(normals) @ axes.T
    # Over the left shoulder, as in drawings.
    key = np.maximum(seen @ unit_vectors(np.array([[-0.45, 0.65, 0.62]]))[0], 0.0)
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


def downsample(image: FloatArray, covered: BoolArray, factor: int) -> FloatArray:
    """Return the (h, w, 4) RGBA picture from an image `factor` times as large, with soft outlines.

    Args:
        image: (factor h, factor w, 3) colours, black where it shows no model.
        covered: (factor h, factor w) where it shows the model; elsewhere the picture is transparent.
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
"""Share of the picture's longer side by which a point on the surface may lie behind the surface seen
at its pixel: seams run along edges, where a pixel's centre may be on a face that is a little nearer."""


@dataclass(frozen=True, eq=False)
class MeshPicture:
    """A picture of a mesh, and what is needed to draw on it.

    Attributes:
        image: (h, w, 4) RGBA, transparent where there is no model; row 0 at the top.
        camera: maps model points to this image's pixels.
        coverage: what is seen at every sample.
    """

    image: FloatArray
    camera: Camera
    coverage: Coverage

    def visible_points(self, points: ArrayLike, reach: float = 0.0) -> BoolArray:
        """Return for (k, 3) points on the surface whether nothing is in front of them.

        reach: a point is visible, too, if nothing is in front of it so many pixels beside it.
        """
        projected = self.camera.enlarged(SUPERSAMPLING).project(points)
        height, width = self.coverage.face.shape
        tolerance = DEPTH_TOLERANCE * max(height, width)
        # A frame of background: beside the picture nothing is in front of anything.
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
        """Return surface segments cut where they vanish behind the model, and whether each piece is visible.

        Args:
            start, stop: (k, 3) end points of the segments, model units.

        Returns:
            (p, 2, 2) end points of the pieces in pixels of the image; (p,).
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

        # Lines along outlines may be seen from beside, about as far as they are wide, so that they do not flicker.
        visible = self.visible_points(point(0.5), 1.5)
        # Of steps in a row that are alike the first begins a piece and the last ends it.
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
        corner_uv: (m, 3, 2) UV points; with `cell`, a checkerboard takes the place of the colours.
        cell: side of the checkerboard's cells in UV units.
        contrast: strength of light and shadow; at 0 every face has its plain colour.
        margin: share of the picture left free at each side.

    Raises:
        OptionError: `up` names no axis, or `eye` no direction.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    faces = np.asarray(faces, dtype=np.int64)
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
    # About 60,000 samples are shaded at once: what caches hold. It does not change the picture.
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


_AtSamples: TypeAlias = Callable[[IntArray, FloatArray], FloatArray]
"""What gives a value to samples from their faces (k,) and barycentric coordinates (k, 3)."""


def _plain(colors: ArrayLike) -> _AtSamples:
    """Return what gives samples the colours of their faces, or the mix of those of the corners."""
    given = np.asarray(colors, dtype=np.float64)

    def paint(seen: IntArray, weights: FloatArray) -> FloatArray:
        colour = given[seen]
        return colour if colour.ndim == 2 else np.einsum("kc,kcd->kd", weights, colour)

    return paint


def _board(places: Barycentrics, corner_uv: FloatArray, cell: float) -> _AtSamples:
    """Return what gives samples the colours of a checkerboard."""
    # A footprint must be positive, or its mean is 0 / 0; this one is far below what a pixel shows.
    footprint = np.maximum(places.footprint(corner_uv), 1e-6 * cell)
    bright, dark = np.array(LIGHT_CELL), np.array(DARK_CELL)

    def paint(seen: IntArray, weights: FloatArray) -> FloatArray:
        uv = np.einsum("kc,kcd->kd", weights, corner_uv[seen])
        share = checkerboard(uv, footprint[seen], cell)
        return np.asarray(share * bright + (1.0 - share) * dark)

    return paint


def _light(
    vertices: FloatArray, faces: IntArray, away: BoolArray, coverage: Coverage, camera: Camera
) -> _AtSamples:
    """Return what gives samples their brightness; away: (m,) faces that run clockwise in the picture."""
    normals = np.where(away[:, None, None], -1.0, 1.0) * corner_normals(vertices, faces)
    # Faces may run either way; the side that most of the picture shows counts as the outer one.
    visible = np.bincount(coverage.face[coverage.covered], minlength=len(faces))
    inner = ~away if visible[away].sum() > visible.sum() / 2 else away

    def light(seen: IntArray, weights: FloatArray) -> FloatArray:
        normal = np.einsum("kc,kcd->kd", weights, normals[seen])
        return np.asarray(lambert(normal, camera.axes) * np.where(inner[seen], 0.62, 1.0))

    return light
