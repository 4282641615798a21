"""Pictures of a triangle mesh: shaded, coloured by face or by a checkerboard, hidden parts hidden."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import BoolArray, FloatArray, IntArray
from .camera import Camera, fit_camera
from .raster import Coverage, barycentrics, rasterise
from .shading import INNER_SIDE_DIM, checkerboard, corner_normals, downsample, lambert, uv_footprint

SUPERSAMPLING = 2
"""Samples per pixel along each axis; two give smooth outlines at print resolution."""

PAINT = (0.86, 0.87, 0.89)
"""Colour of a surface that has none of its own: a light, slightly cool grey."""

DARK_CELL = (0.40, 0.53, 0.70)
"""What the dark cells of the checkerboard let through: blue, so that red and black marks stand out."""

DEPTH_TOLERANCE = 0.008
"""Share of the picture's longer side by which a point on the surface may lie behind the surface seen
at its pixel: seams run along edges, where a pixel's centre may be on a face that is a little nearer."""

SEGMENT_STEP = 2.0
"""Pixels between the places where the visibility of a line is tested."""


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

    def visible_points(self, points: ArrayLike) -> BoolArray:
        """Return for (k, 3) points on the surface whether nothing is in front of them."""
        projected = self.camera.enlarged(SUPERSAMPLING).project(points)
        height, width = self.coverage.face.shape
        column, row = np.floor(projected[:, 0]).astype(np.int64), np.floor(projected[:, 1]).astype(np.int64)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        seen = self.coverage.depth[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
        visible: BoolArray = inside & (projected[:, 2] <= seen + DEPTH_TOLERANCE * max(height, width))
        return visible

    def visible_segments(self, start: ArrayLike, stop: ArrayLike) -> FloatArray:
        """Return the visible pieces of surface segments, (p, 2, 2) in pixels of the image.

        Args:
            start, stop: (k, 3) end points of the segments, model units.
        """
        start, stop = np.asarray(start, dtype=np.float64), np.asarray(stop, dtype=np.float64)
        if not len(start):
            return np.empty((0, 2, 2))
        length = np.linalg.norm(stop - start, axis=1) * self.camera.scale
        pieces = np.maximum(np.ceil(length / SEGMENT_STEP), 1.0).astype(np.int64)
        owner = np.repeat(np.arange(len(start)), pieces)
        step = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        ends = []
        for offset in (0.0, 0.5, 1.0):
            share = ((step + offset) / pieces[owner])[:, None]
            ends.append((1.0 - share) * start[owner] + share * stop[owner])
        visible = self.visible_points(ends[1])
        return self.camera.project(np.stack([ends[0], ends[2]], axis=1)[visible])[..., :2]


def render_mesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    size: tuple[int, int] = (900, 900),
    eye: ArrayLike | None = None,
    up: str = "y",
    face_colors: ArrayLike | None = None,
    corner_uv: ArrayLike | None = None,
    cell: float | None = None,
    contrast: float = 1.0,
) -> MeshPicture:
    """Return a shaded picture of a mesh, in orthographic projection.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3) vertex indices.
        size: width and height in pixels.
        eye: (3,) direction from the model to the eye; default: three quarters from the front.
        up: the model's upward axis, "x", "y" or "z".
        face_colors: (m, 3) RGB of each face, 0 to 1; default: one light grey.
        corner_uv: (m, 3, 2) UV points; with `cell`, a checkerboard darkens the colours.
        cell: side of the checkerboard's cells in UV units.
        contrast: strength of light and shadow; at 0 every face has its plain colour.

    Raises:
        OptionError: `up` names no axis.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    faces = np.asarray(faces, dtype=np.int64)
    camera = fit_camera(vertices, size, eye, up)
    fine = camera.enlarged(SUPERSAMPLING)
    points = fine.project(vertices)
    coverage = rasterise(points, faces, fine.width, fine.height)
    weights = barycentrics(points, faces, coverage)
    seen = coverage.face[coverage.covered]

    colour = np.broadcast_to(np.array(PAINT), (len(seen), 3))
    if face_colors is not None:
        colour = np.asarray(face_colors, dtype=np.float64)[seen]
    if corner_uv is not None and cell is not None:
        colour = colour * _board(points, faces, np.asarray(corner_uv, dtype=np.float64), seen, weights, cell)
    normals = np.einsum("kc,kcd->kd", weights, corner_normals(vertices, faces)[seen])
    away = _runs_clockwise(points, faces)[seen]
    brightness = lambert(np.where(away[:, None], -normals, normals), camera.axes)
    # Faces may run either way; the side that most of the picture shows counts as the outer one.
    inner = ~away if np.count_nonzero(away) > len(away) / 2 else away
    brightness[inner] *= INNER_SIDE_DIM
    brightness = 1.0 + contrast * (brightness - 1.0)
    image = np.zeros((fine.height, fine.width, 3))
    image[coverage.covered] = colour * brightness[:, None]
    return MeshPicture(downsample(image, coverage.covered, SUPERSAMPLING), camera, coverage)


def _board(
    points: FloatArray,
    faces: IntArray,
    corner_uv: FloatArray,
    seen: IntArray,
    weights: FloatArray,
    cell: float,
) -> FloatArray:
    """Return the (k, 3) tint of a checkerboard at the covered pixels."""
    uv = np.einsum("kc,kcd->kd", weights, corner_uv[seen])
    # A footprint must be positive, or its mean is 0 / 0; this one is far below what a pixel shows.
    footprint = np.maximum(uv_footprint(points[faces, :2], corner_uv), 1e-6 * cell)[seen]
    light = checkerboard(uv, footprint, cell)
    return np.asarray(light + (1.0 - light) * np.array(DARK_CELL))


def _runs_clockwise(points: FloatArray, faces: IntArray) -> BoolArray:
    """Return (m,) which faces run clockwise in the picture: their normals point away from the eye."""
    p, q, r = np.moveaxis(points[faces, :2], 1, 0)
    cross = (q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0]
    return np.asarray(cross > 0.0)  # y runs downwards
