"""Layouts relaxed: the few triangles that cones bend too much, or all of them on the way from angles to areas."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, has_any, rows_of
from ..base.compiled import compiled
from ..errors import LengthError, MetricError, SeamError
from ..geometry import double_areas
from ..geometry.operators import LEAST_WEIGHT, area_distortion, at_unit_scale, vertex_areas, weighted_areas
from ..geometry.planar import laid_out_curvature, signed_double_areas, vertex_log_scale
from ..geometry.straight import place_triangles
from ..mesh.connectivity import TriangleMesh, label_components
from ..stages import Layout, RelaxSpec
from .relax import StretchEnergy, relax

# Triangles with more quasi-conformal distortion than this are relaxed, with so many rings around them. Measured:
# freeing a twentieth of the vertices of a fine mesh and three quarters of a coarse one, the mean comes within 0.0025 of
# what it is with all free.
RELAXED_QC, RELAXED_RINGS = 1.35, 3
# Part of the energy above the least that a further Newton step must promise to gain. Most take 6 to 10 steps, those
# with triangles that are bent a thousandfold 20 to 30.
TOLERANCE = 1e-2
# Part of the mean area that every triangle counts more than its own: with none, slivers are bent without end, 60 to 1
# on a decimated face instead of 11; means rise by 0.0005.
MEAN_AREA_SHARE = 0.1
# Where a patch's mean or the worst triangle of all would be worse, the same is tried with this sharpness.
RETRY_SHARPNESS = 2.0
# What is worse by less than this part is not: nothing may have moved, or what has as a whole.
RELATIVE_TOLERANCE = 1e-9


def relax_layouts(
    layouts: Sequence[Layout],
    weights: Sequence[FloatArray | None],
    spec: RelaxSpec,
    tell: Callable[[str], None],
) -> list[Layout]:
    """Return layouts with less distortion, the same cones and the same seams, relaxed as one mesh.

    The boundary stays where its lengths or its shape are prescribed. A layout that cannot be relaxed stays as it is,
    with a note where relaxing all of it was asked for.

    Args:
        layouts: of connected meshes.
        weights: (n,) the importance of the vertices of each, or None.
        spec: what is asked.
        tell: called after each step with what is being done.
    """
    if spec.is_off or not layouts:
        return list(layouts)
    try:
        return _relaxed(LayoutGroup(layouts, weights), spec, tell)
    except (SeamError, LengthError, MetricError) as error:  # a metric that did not converge
        if len(layouts) > 1:
            return [
                relax_layouts([one], [own], spec, tell)[0] for one, own in zip(layouts, weights, strict=True)
            ]
        if isinstance(error, MetricError):
            raise
        return [layouts[0].with_notes(f"Not relaxed: {error}.") if spec.is_whole else layouts[0]]


def _relaxed(group: LayoutGroup, spec: RelaxSpec, tell: Callable[[str], None]) -> list[Layout]:
    mesh, points = group.mesh, group.points
    before = group.ratios(points)
    is_free = group.is_free
    if not spec.is_whole:
        is_free = is_free & _around(mesh, before > RELAXED_QC) & ~mesh.is_boundary_vertex

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
            progress=lambda step, _: tell(f"step {step}"),
        ).points

    if spec.stretch:
        points = relaxed_by(points, 1.0, is_free)
    else:
        points, is_lost = group.without_losses(points, relaxed_by(points, 1.0, is_free), before, is_free)
        if is_lost.any():
            points, _ = group.without_losses(
                points, relaxed_by(points, RETRY_SHARPNESS, is_lost), before, is_lost
            )
    found = group.described(points, is_free)
    freed = np.bincount(group.of_vertex[is_free], minlength=len(found)).tolist()
    means, largest = group.means(before).tolist(), group.largest(before).tolist()
    return [
        replace(
            one,
            statistics=replace(
                one.statistics,
                relaxed_vertices=freed[i],
                qc_mean_unrelaxed=means[i],
                qc_max_unrelaxed=largest[i],
            ),
        )
        for i, one in enumerate(found)
    ]


class LayoutGroup:
    """The triangles of several layouts as they should be, those of one after those of the other.

    Attributes:
        layouts: of each connected mesh.
        mesh: what is laid out.
        points, corners: of all layouts.
        lengths: (m, 3) side lengths.
        areas: (m,) areas.
        of_vertex: (n,) the layout of each vertex.
    """

    def __init__(self, layouts: Sequence[Layout], weights: Sequence[FloatArray | None]) -> None:
        self.layouts, self._given_weights = layouts, weights
        meshes = [one.mesh for one in layouts]
        self._vertices = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
        self._faces = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])
        self._points = np.cumsum([0, *(len(one.points) for one in layouts)])
        self.mesh = meshes[0] if len(meshes) == 1 else _joined(meshes, self._vertices)
        self.points = np.concatenate([one.points for one in layouts])
        self.corners = np.concatenate(
            [one.corners + start for one, start in zip(layouts, self._points, strict=False)]
        )
        self.lengths = np.concatenate([one.lengths for one in layouts])
        self.areas = double_areas(self.lengths) / 2
        self.of_vertex = np.arange(len(layouts)).repeat(np.diff(self._vertices))
        self._of_face = np.arange(len(layouts)).repeat(np.diff(self._faces))

    @property
    def is_free(self) -> BoolArray:
        """(n,) True but for vertices that must stay."""
        return ~np.concatenate([one.is_held for one in self.layouts])

    def _sums(self, values: FloatArray, at: BoolArray | slice = slice(None)) -> FloatArray:
        """Return the sum of values of faces of each component, over some faces."""
        return np.bincount(self._of_face[at], values[at], len(self.layouts)).astype(np.float64)

    @cached_property
    def lengths_as_laid_out(self) -> FloatArray:
        """(m, 3) side lengths at which each component has the area of its layout, so that all weigh the same."""
        laid_out = self._sums(np.abs(signed_double_areas(self.points[self.corners])))
        unit = np.sqrt(laid_out / (2 * self._sums(self.areas)))
        return np.asarray(self.lengths * unit[self._of_face, None])

    @cached_property
    def weights(self) -> FloatArray:
        """(m,) what triangles count for their area."""
        least = np.finfo(np.float64).tiny
        means = self._sums(self.areas) / np.diff(self._faces)
        weights: FloatArray = 1 + MEAN_AREA_SHARE * means[self._of_face] / np.maximum(self.areas, least)
        for one, own, start in zip(self.layouts, self._given_weights, self._faces, strict=False):
            if own is not None:
                at_vertices = np.maximum(at_unit_scale(own), LEAST_WEIGHT)
                of_faces = at_vertices[one.mesh.faces].mean(axis=1)
                weights[start : start + len(of_faces)] *= of_faces
        return weights

    def ratios(self, points: FloatArray, chosen: IntArray | None = None) -> FloatArray:
        """Return (m,) ratios of singular values, infinite for triangles that are flipped or have no area.

        chosen: the triangles of interest, the others are infinite; None for all.
        """
        ratios = np.full(len(self.mesh.faces), np.inf)
        every = np.arange(len(ratios)) if chosen is None else chosen
        fill_ratios(np.ascontiguousarray(self.lengths), points, self.corners, every, ratios)
        return ratios

    def means(self, ratios: FloatArray) -> FloatArray:
        """Return each component's mean ratio by area over positively oriented triangles; infinite without any."""
        is_positive = np.isfinite(ratios)
        areas = self._sums(self.areas, is_positive)
        sums = self._sums(np.where(is_positive, ratios, 0.0) * self.areas)
        return np.divide(sums, areas, out=np.full(len(areas), np.inf), where=areas > 0)

    def largest(self, ratios: FloatArray) -> FloatArray:
        """Return the largest finite ratio of each component, or 1."""
        largest: FloatArray = np.ones(len(self.layouts))
        np.maximum.at(largest, self._of_face, np.where(np.isfinite(ratios), ratios, 1.0))
        return largest

    def without_losses(
        self, points: FloatArray, moved: FloatArray, before: FloatArray, was_free: BoolArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return the moved points, but as they were where their mean or their worst triangle would be worse.

        The vertices there, (n,), too. before: (m,) the ratios of the layout that nothing may be worse than.
        """
        mesh, faces = self.mesh, self.mesh.faces
        inside = np.flatnonzero(was_free[mesh.edges[:, 0]] & was_free[mesh.edges[:, 1]])
        edges = rows_of(mesh.edges, inside)
        count, patch = label_components(len(mesh.vertices), edges[:, 0], edges[:, 1])
        touched = np.flatnonzero(has_any(was_free, faces) & np.isfinite(before))
        after = self.ratios(moved, touched)
        corner = np.argmax(was_free[faces[touched]], axis=1)
        of_face = patch[faces[touched, corner]]
        gain = before[touched] - after[touched]
        areas = self.areas[touched]
        gained = np.bincount(of_face, gain * areas, count)
        least = -RELATIVE_TOLERANCE * np.bincount(of_face, before[touched] * areas, count)
        worst = np.zeros(count)
        np.maximum.at(worst, of_face, after[touched])
        is_worse = worst[patch] > (1 + RELATIVE_TOLERANCE) * self.largest(before)[self.of_vertex]
        is_lost = ((gained < least)[patch] | is_worse) & was_free
        back = np.zeros(len(moved), dtype=bool)
        back[self.corners[is_lost[faces]]] = True
        return np.where(back[:, None], points, moved), is_lost

    def described(self, points: FloatArray, was_free: BoolArray) -> list[Layout]:
        """Return the layouts with moved points, with the curvature and the scale that they have, and had before."""
        mesh, corners = self.mesh, rows_of(points, self.corners)
        # Where triangles were moved; elsewhere it is what it was.
        changed = np.zeros(len(mesh.vertices), dtype=bool)
        changed[mesh.faces[has_any(was_free, mesh.faces)]] = True
        old = np.concatenate([one.curvature for one in self.layouts])
        curvature = np.where(changed, laid_out_curvature(mesh, corners, changed), old)
        # What counts as no area is so for each layout.
        unit = self._sums(self.areas)[self._of_face]
        before, after = (np.abs(signed_double_areas(p[self.corners])) / 2 for p in (self.points, points))
        # The energy of angles does not depend on the scale: components keep their areas relative to each other.
        factors = np.sqrt(self._sums(before) / self._sums(after))
        old = np.concatenate([one.log_scale for one in self.layouts])
        log_scale = np.where(was_free, vertex_log_scale(mesh, self.areas / unit, after / unit), old)
        found = []
        for i, one in enumerate(self.layouts):
            own = slice(self._vertices[i], self._vertices[i + 1])
            factor = 1.0 if one.is_held.any() else factors[i]
            log_scale[own] += np.log(factor)
            areas = vertex_areas(one.mesh.faces, one.lengths, len(one.mesh.vertices))
            reached = area_distortion(log_scale[own], weighted_areas(areas, self._given_weights[i]))
            found.append(
                replace(
                    one,
                    points=factor * points[self._points[i] : self._points[i + 1]],
                    curvature=curvature[own],
                    # Where the curvature is not prescribed, the target is what comes out.
                    target=np.where(one.is_open, curvature[own], one.target),
                    log_scale=log_scale[own],
                    statistics=replace(one.statistics, area_distortion=reached),
                )
            )
        return found


def _joined(meshes: Sequence[TriangleMesh], starts: IntArray) -> TriangleMesh:
    """Return meshes as one, the vertices of each from a number on."""
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return TriangleMesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


@compiled
def fill_ratios(
    lengths: FloatArray, points: FloatArray, corners: IntArray, chosen: IntArray, ratios: FloatArray
) -> None:
    """Write the ratio of singular values of the maps of chosen triangles; infinite for those flipped.

    Args:
        lengths: (m, 3) side lengths of the triangles as they should be.
        points: (u, 2) of the plane.
        corners: (m, 3) indices of points.
        chosen: triangles.
        ratios: (m,) filled at the chosen.
    """
    rest = np.empty(3, np.complex128)
    for f in chosen:
        ratios[f] = np.inf
        place_triangles(lengths[f], rest)
        x, y = points[corners[f, 0]]
        a, b = 0j, 0j
        for i in range(1, 3):
            place = complex(points[corners[f, i], 0] - x, points[corners[f, i], 1] - y)
            # Both times the area of the triangle at rest, which the ratio does not depend on.
            a += rest[i].conjugate() * place
            b += rest[i] * place
        one, two = abs(a), abs(b)
        has_area = (rest[0].conjugate() * rest[1]).imag != 0.0
        if has_area and one > two:
            ratios[f] = (one + two) / (one - two)


def _around(mesh: TriangleMesh, is_bent: BoolArray) -> BoolArray:
    """Return (n,) True for the vertices of triangles and of the rings around them."""
    inside = np.zeros(len(mesh.vertices), dtype=bool)
    inside[mesh.faces[is_bent]] = True
    for _ in range(RELAXED_RINGS):
        inside[mesh.faces[has_any(inside, mesh.faces)]] = True
    return inside
