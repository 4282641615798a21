"""Relaxation of layouts: only of the triangles that cones distort strongly, or of all, from angles towards areas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, has_any, mask_of, rows_of
from ..base.notes import Unmet
from ..base.progress import report_detail, stage
from ..errors import LengthError, SeamError
from ..geometry import double_areas
from ..geometry.operators import MIN_WEIGHT, area_distortion, at_unit_scale, vertex_areas, weighted_areas
from ..geometry.planar import layout_curvature, qc_distortion, signed_double_areas, vertex_log_scale
from ..mesh.connectivity import joined_meshes, label_components, nearby
from ..stages import Layout, RelaxSpec
from .energies import StretchEnergy
from .relaxing import relax

# Triangles with more quasi-conformal distortion than this are relaxed, with this number of rings around them. Measured:
# with a twentieth of the vertices of a fine mesh and three quarters of a coarse one free, the mean comes within 0.0025
# of its value with all vertices free.
RELAXED_QC, RELAXED_RINGS = 1.35, 3
# The last Newton step is the first one whose predicted decrease is at most this fraction of the energy minus its lower
# bound. Most relaxations take 6 to 10 steps, those with triangles distorted by a factor of a thousand 20 to 30.
TOLERANCE = 1e-2
# Fraction of the mean area that is added to the weight of every triangle. Without it, slivers are distorted without
# bound, 60 to 1 on a decimated face instead of 11; with it, means rise by 0.0005.
MEAN_AREA_SHARE = 0.1
# Patches whose mean distortion would grow, or with a triangle worse than the worst of the layout before, are relaxed
# again with this sharpness.
RETRY_SHARPNESS = 2.0
# Relative changes below this value are not a deterioration: the patch may not have moved, or moved rigidly.
RELATIVE_TOLERANCE = 1e-9


@stage("relax")
def relax_layouts(
    layouts: Sequence[Layout],
    weights: Sequence[FloatArray | None],
    spec: RelaxSpec,
) -> list[Layout]:
    """Return layouts with less distortion, the same cones and the same seams, relaxed as one mesh.

    A boundary with prescribed lengths or shape does not move. A single layout whose seams do not have sides of equal
    lengths, so that these cannot be held, is returned unchanged, with a note if the relaxation of all triangles was
    requested.

    Args:
        layouts: layouts of connected meshes.
        weights: for each layout the (n,) importance of its vertices, or None.
        spec: the options for relaxing.

    Returns:
        The relaxed layouts, in the same order.

    Raises:
        MetricError: a relaxation found no finite step.
        SeamError, LengthError: the seams of one of several layouts cannot be held.
    """
    if spec.is_off or not layouts:
        return list(layouts)
    try:
        return _relaxed(LayoutGroup(layouts, weights), spec)
    except (SeamError, LengthError) as error:  # a metric that did not converge
        if len(layouts) > 1:
            raise
        return [layouts[0].with_notes(Unmet(f"Not relaxed: {error}.")) if spec.relaxes_all else layouts[0]]


def _relaxed(group: LayoutGroup, spec: RelaxSpec) -> list[Layout]:
    mesh, points = group.mesh, group.points
    before = group.ratios(points)
    is_free = group.is_free
    if not spec.relaxes_all:
        is_free = is_free & nearby(mesh.faces, before > RELAXED_QC, RELAXED_RINGS) & ~mesh.is_boundary_vertex

    def relaxed_by(start: FloatArray, sharpness: float, is_free: BoolArray) -> FloatArray:
        if not is_free.any():
            return start
        return relax(
            mesh,
            start,
            group.corners,
            StretchEnergy(spec.stretch, sharpness),
            lengths=group.lengths_as_laid_out,
            weights=group.weights,
            free=is_free,
            tolerance=TOLERANCE,
            progress=lambda step, _: report_detail(f"step {step}"),
        ).points

    if spec.stretch:
        points = relaxed_by(points, 1.0, is_free)
    else:
        points, is_lost = group.without_losses(points, relaxed_by(points, 1.0, is_free), before, is_free)
        if is_lost.any():
            points, _ = group.without_losses(
                points, relaxed_by(points, RETRY_SHARPNESS, is_lost), before, is_lost
            )
    relaxed = group.updated(points, is_free)
    freed = np.bincount(group.of_vertex[is_free], minlength=len(relaxed)).tolist()
    means, largest = group.means(before).tolist(), group.largest(before).tolist()
    return [
        replace(
            layout,
            statistics=replace(
                layout.statistics,
                relaxed_vertices=freed[i],
                qc_mean_unrelaxed=means[i],
                qc_max_unrelaxed=largest[i],
            ),
        )
        for i, layout in enumerate(relaxed)
    ]


class LayoutGroup:
    """Several layouts of connected meshes, concatenated into one.

    Attributes:
        layouts: the layouts.
        mesh: the union of their meshes.
        points, corners: the points (u, 2) and corners (m, 3) of all layouts.
        lengths: (m, 3) side lengths of the triangles on the surface.
        areas: (m,) their areas.
        of_vertex: (n,) the layout of each vertex.
    """

    def __init__(self, layouts: Sequence[Layout], weights: Sequence[FloatArray | None]) -> None:
        self.layouts, self._vertex_weights = layouts, weights
        meshes = [layout.mesh for layout in layouts]
        self._vertices = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
        self._faces = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])
        self._points = np.cumsum([0, *(len(layout.points) for layout in layouts)])
        self.mesh = joined_meshes(meshes)
        self.points = np.concatenate([layout.points for layout in layouts])
        self.corners = np.concatenate(
            [layout.corners + start for layout, start in zip(layouts, self._points, strict=False)]
        )
        self.lengths = np.concatenate([layout.lengths for layout in layouts])
        self.areas = double_areas(self.lengths) / 2
        self.of_vertex = np.arange(len(layouts)).repeat(np.diff(self._vertices))
        self._of_face = np.arange(len(layouts)).repeat(np.diff(self._faces))

    @property
    def is_free(self) -> BoolArray:
        """Return (n,) True for vertices that may move."""
        return ~np.concatenate([layout.is_fixed for layout in self.layouts])

    def _sums(self, values: FloatArray, at: BoolArray | slice = slice(None)) -> FloatArray:
        """Return the sum of (m,) values per face for each layout, over the faces `at`."""
        return np.bincount(self._of_face[at], values[at], len(self.layouts)).astype(np.float64)

    @cached_property
    def flat_areas(self) -> FloatArray:
        """(m,) the areas of the triangles in the plane."""
        return np.abs(np.concatenate([layout.flat_double_areas for layout in self.layouts])) / 2

    @cached_property
    def lengths_as_laid_out(self) -> FloatArray:
        """Return (m, 3) the side lengths scaled so that each mesh has the area of its layout and equal weight."""
        unit = np.sqrt(self._sums(self.flat_areas) / self._sums(self.areas))
        return np.asarray(self.lengths * unit[self._of_face, None])

    @cached_property
    def weights(self) -> FloatArray:
        """Return (m,) the weights of triangles relative to their area."""
        smallest_area = np.finfo(np.float64).tiny
        means = self._sums(self.areas) / np.diff(self._faces)
        weights: FloatArray = 1 + MEAN_AREA_SHARE * means[self._of_face] / np.maximum(
            self.areas, smallest_area
        )
        for layout, vertex_weights, start in zip(
            self.layouts, self._vertex_weights, self._faces, strict=False
        ):
            if vertex_weights is not None:
                at_vertices = np.maximum(at_unit_scale(vertex_weights), MIN_WEIGHT)
                of_faces = at_vertices[layout.mesh.faces].mean(axis=1)
                weights[start : start + len(of_faces)] *= of_faces
        return weights

    def ratios(self, points: FloatArray, chosen: IntArray | None = None) -> FloatArray:
        """Return (m,) ratios of singular values, infinite for triangles that are flipped or have no area.

        chosen: the triangles to compute, the others are set to infinity; None for all.
        """
        ratios = np.full(len(self.mesh.faces), np.inf)
        at = slice(None) if chosen is None else chosen
        ratios[at] = qc_distortion(self.lengths[at], rows_of(points, self.corners[at]))
        return ratios

    def means(self, ratios: FloatArray) -> FloatArray:
        """Return each layout's area-weighted mean ratio over positively oriented triangles; infinite without any."""
        is_positive = np.isfinite(ratios)
        areas = self._sums(self.areas, is_positive)
        sums = self._sums(np.where(is_positive, ratios, 0.0) * self.areas)
        return np.divide(sums, areas, out=np.full(len(areas), np.inf), where=areas > 0)

    def largest(self, ratios: FloatArray) -> FloatArray:
        """Return the largest finite ratio of each layout, or 1 without any."""
        largest: FloatArray = np.ones(len(self.layouts))
        np.maximum.at(largest, self._of_face, np.where(np.isfinite(ratios), ratios, 1.0))
        return largest

    def without_losses(
        self, points: FloatArray, moved: FloatArray, before: FloatArray, was_free: BoolArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return the moved points, without patches whose mean or worst distortion got worse, and a mask of these (n,).

        before: (m,) the ratios of the layout to compare with.
        """
        mesh, faces = self.mesh, self.mesh.faces
        inside = np.flatnonzero(was_free[mesh.edges[:, 0]] & was_free[mesh.edges[:, 1]])
        edges = rows_of(mesh.edges, inside)
        count, patch = label_components(len(mesh.vertices), edges[:, 0], edges[:, 1])
        touched = np.flatnonzero(has_any(was_free, faces) & np.isfinite(before))
        after = self.ratios(moved, touched)
        of_face = patch[faces[touched, np.argmax(was_free[faces[touched]], axis=1)]]
        gain = before[touched] - after[touched]
        areas = self.areas[touched]
        gained = np.bincount(of_face, gain * areas, count)
        threshold = -RELATIVE_TOLERANCE * np.bincount(of_face, before[touched] * areas, count)
        worst = np.zeros(count)
        np.maximum.at(worst, of_face, after[touched])
        is_worse = worst[patch] > (1 + RELATIVE_TOLERANCE) * self.largest(before)[self.of_vertex]
        is_lost = ((gained < threshold)[patch] | is_worse) & was_free
        back = mask_of(len(moved), self.corners[is_lost[faces]])
        return np.where(back[:, None], points, moved), is_lost

    def updated(self, points: FloatArray, was_free: BoolArray) -> list[Layout]:
        """Return the layouts with moved points and with updated curvature, target and log conformal factor."""
        mesh, corners = self.mesh, rows_of(points, self.corners)
        # Curvatures change only at vertices of moved triangles.
        changed = mask_of(len(mesh.vertices), mesh.faces[has_any(was_free, mesh.faces)])
        old = np.concatenate([layout.curvature for layout in self.layouts])
        curvature = np.where(changed, layout_curvature(mesh, corners, changed), old)
        # Areas are relative to those of each layout, as the threshold for zero area is.
        unit = self._sums(self.areas)[self._of_face]
        before, after = self.flat_areas, np.abs(signed_double_areas(corners)) / 2
        growth = np.log(self._sums(after) / self._sums(before)) / 2
        old = np.concatenate([layout.log_scale for layout in self.layouts])
        log_scale = np.where(was_free, vertex_log_scale(mesh, self.areas / unit, after / unit), old)
        layouts = []
        for i, layout in enumerate(self.layouts):
            vertices = slice(self._vertices[i], self._vertices[i + 1])
            areas = vertex_areas(layout.mesh.faces, layout.lengths, len(layout.mesh.vertices))
            share = weighted_areas(areas, self._vertex_weights[i])
            # The energy of angles does not depend on the scale: components keep their areas relative to each other. The
            # mean log conformal factor is hardly changed by the few huge triangles that untangling may leave.
            grown = share @ log_scale[vertices] if layout.statistics.untangled_vertices else growth[i]
            factor = 1.0 if layout.is_fixed.any() else np.exp(-grown)
            log_scale[vertices] += np.log(factor)
            reached = area_distortion(log_scale[vertices], share)
            layouts.append(
                replace(
                    layout,
                    points=factor * points[self._points[i] : self._points[i + 1]],
                    curvature=curvature[vertices],
                    # Where the curvature is not prescribed, the target is set to the resulting curvature.
                    target=np.where(layout.is_open, curvature[vertices], layout.target),
                    log_scale=log_scale[vertices],
                    statistics=replace(layout.statistics, area_distortion=reached),
                )
            )
        return layouts
