"""Pictures of a triangle mesh: shaded, coloured by face or by a checkerboard, hidden parts hidden."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import BoolArray, FloatArray, IntArray
from ...geometry.normals import corner_normals
from ...quality.checker import DARK_CELL, LIGHT_CELL
from .camera import Camera, Eye, fit_camera
from .raster import Barycentrics, Coverage, rasterise
from .shading import INNER_SIDE_DIM, checkerboard, downsample, lambert, uv_footprint

SUPERSAMPLING = 2
"""Samples per pixel along each axis; two give smooth outlines at print resolution."""

DEPTH_TOLERANCE = 0.008
"""Share of the picture's longer side by which a point on the surface may lie behind the surface seen
at its pixel: seams run along edges, where a pixel's centre may be on a face that is a little nearer."""

SAMPLES_PER_STRIP = 60_000
"""About how many samples are shaded at once: what caches hold. It does not change the picture."""

LINE_REACH = 1.5
"""Pixels beside a line that may show it: about its width, so that lines along outlines do not flicker."""

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
        steps = np.maximum(np.ceil(length / SEGMENT_STEP), 1.0).astype(np.int64)
        owner = np.repeat(np.arange(len(start)), steps)
        step = np.arange(len(owner)) - np.repeat(np.cumsum(steps) - steps, steps)

        def point(offset: float) -> FloatArray:
            share = ((step + offset) / steps[owner])[:, None]
            return np.asarray((1.0 - share) * start[owner] + share * stop[owner])

        visible = self.visible_points(point(0.5), LINE_REACH)
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
        eye: direction from the model to the eye, see `camera.eye_direction`.
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
    if corner_uv is not None and cell is not None:
        paint = _board(points, faces, np.asarray(corner_uv, dtype=np.float64), cell)
    else:
        paint = _plain(np.broadcast_to(np.array(LIGHT_CELL), faces.shape) if colors is None else colors)
    light = _light(vertices, faces, points, coverage, camera, contrast)
    places = Barycentrics(points, faces)
    strips = []
    rows = SUPERSAMPLING * max(SAMPLES_PER_STRIP // SUPERSAMPLING // fine.width, 1)
    for top in range(0, fine.height, rows):
        face = coverage.face[top : top + rows]
        row, column = np.nonzero(face >= 0)
        seen = face[row, column]
        weights = places.of(seen, column, row + top)
        image = np.zeros((*face.shape, 3))
        image[row, column] = paint(seen, weights) * light(seen, weights)[:, None]
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


def _board(points: FloatArray, faces: IntArray, corner_uv: FloatArray, cell: float) -> _AtSamples:
    """Return what gives samples the colours of a checkerboard."""
    # A footprint must be positive, or its mean is 0 / 0; this one is far below what a pixel shows.
    footprint = np.maximum(uv_footprint(points[faces, :2], corner_uv), 1e-6 * cell)
    bright, dark = np.array(LIGHT_CELL), np.array(DARK_CELL)

    def paint(seen: IntArray, weights: FloatArray) -> FloatArray:
        uv = np.einsum("kc,kcd->kd", weights, corner_uv[seen])
        share = checkerboard(uv, footprint[seen], cell)
        return np.asarray(share * bright + (1.0 - share) * dark)

    return paint


def _light(
    vertices: FloatArray,
    faces: IntArray,
    points: FloatArray,
    coverage: Coverage,
    camera: Camera,
    contrast: float,
) -> _AtSamples:
    """Return what gives samples their brightness."""
    away = _runs_clockwise(points, faces)
    normals = np.where(away[:, None, None], -1.0, 1.0) * corner_normals(vertices, faces)
    # Faces may run either way; the side that most of the picture shows counts as the outer one.
    visible = np.bincount(coverage.face[coverage.covered], minlength=len(faces))
    inner = ~away if visible[away].sum() > visible.sum() / 2 else away

    def light(seen: IntArray, weights: FloatArray) -> FloatArray:
        normal = np.einsum("kc,kcd->kd", weights, normals[seen])
        brightness = lambert(normal, camera.axes) * np.where(inner[seen], INNER_SIDE_DIM, 1.0)
        return np.asarray(1.0 + contrast * (brightness - 1.0))

    return light


def _runs_clockwise(points: FloatArray, faces: IntArray) -> BoolArray:
    """Return (m,) which faces run clockwise in the picture: their normals point away from the eye."""
    p, q, r = np.moveaxis(points[faces, :2], 1, 0)
    cross = (q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0]
    return np.asarray(cross > 0.0)  # y runs downwards
