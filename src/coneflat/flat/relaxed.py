"""Layouts relaxed: the few triangles that cones bend too much, or all of them on the way from angles to areas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray, has_any, rows_of
from ..compiled import compiled
from ..errors import LengthError, SeamError
from ..geometry import double_areas, edge_lengths
from ..geometry.operators import LEAST_WEIGHT, area_distortion, at_unit_scale, vertex_areas, weighted_areas
from ..geometry.planar import signed_double_areas
from ..geometry.straight import place_triangles
from ..input.components import Component
from ..layout.relax import Relaxed, StretchEnergy, relax
from ..mesh import TriangleMesh, label_components
from ..options import Options
from ..threads import in_halves
from .base import LaidOut, laid_out_curvature, vertex_log_scale
from .methods import held_boundary

# Triangles with more quasi-conformal distortion than this are relaxed, with so many rings around them. Measured:
# freeing a twentieth of the vertices of a fine mesh and three quarters of a coarse one, the mean comes within 0.0025 of
# what it is with all free.
BENT, RINGS = 1.35, 3
# Part of the energy above the least that a further Newton step must promise to gain, and steps at most. Most take 6 to
# 10, those with triangles that are bent a thousandfold 20 to 30.
TOLERANCE, STEPS = 1e-2, 40
# Part of the mean area that every triangle counts more than its own: with none, slivers are bent without end, 60 to 1
# on a decimated face instead of 11; means rise by 0.0005.
BESIDES = 0.1
# Where a patch's mean or the worst triangle of all would be worse, the same is tried with this sharpness.
SHARP = 2.0


def relaxes(options: Options) -> bool:
    """Whether layouts are relaxed at all; those of other methods are what these have published."""
    # What is relaxed is as symmetric as the triangles, and sides that lie on each other must be alike.
    by_itself = options.polish == "auto" and options.mirrored != "overlap"
    wanted = by_itself or options.polish == "whole" or options.stretch > 0
    return options.method == "exact" and not options.refine and wanted


def relaxed(laid_out: LaidOut, part: Component, options: Options, tell: Callable[[str], None]) -> LaidOut:
    """Return a layout with less distortion, the same cones and the same seams; see `polish` and `stretch`.

    The boundary stays where its lengths or its shape are prescribed.

    Args:
        laid_out: the layout, of the component's mesh or of one in which edges were cut.
        part: the component.
        options: which `relaxes`.
        tell: called after each step with what is being done.
    """
    surface = _Surface(laid_out.mesh, part, laid_out)
    before = surface.ratios(laid_out)
    is_free = np.ones(len(surface.mesh.vertices), dtype=bool)
    is_free[: len(part.mesh.vertices)] = ~held_boundary(part.mesh, part.constraints, options)
    whole = options.stretch > 0 or options.polish == "whole"
    if not whole:
        is_free &= _around(surface.mesh, before > BENT) & ~surface.mesh.is_boundary_vertex

    def relaxed_by(layout: LaidOut, sharpness: float, is_free: BoolArray) -> LaidOut:
        if not is_free.any():
            return layout
        found: Relaxed = relax(
            surface.mesh,
            layout.points,
            layout.corners,
            StretchEnergy(options.stretch, sharpness),
            lengths=surface.lengths,
            weights=surface.weights,
            free=is_free,
            tolerance=TOLERANCE,
            steps=STEPS,
            progress=lambda step, _: tell(f"step {step}"),
        )
        return replace(layout, points=found.points)

    moved = laid_out
    try:
        if options.stretch:
            moved = relaxed_by(moved, 1.0, is_free)
        else:
            moved, is_lost = surface.without_losses(moved, relaxed_by(moved, 1.0, is_free), before, is_free)
            if is_lost.any():
                moved, _ = surface.without_losses(moved, relaxed_by(moved, SHARP, is_lost), before, is_lost)
    except (SeamError, LengthError) as error:  # a metric that did not converge, or a cut at a sliver
        return replace(laid_out, notes=(*laid_out.notes, f"Not relaxed: {error}.")) if whole else laid_out
    return surface.described(moved, before, is_free, options)


def mean_ratio(laid_out: LaidOut, part: Component) -> float:
    """Return the mean quasi-conformal distortion of a layout, by area."""
    surface = _Surface(laid_out.mesh, part, laid_out)
    return surface.mean(surface.ratios(laid_out))


@dataclass(frozen=True, eq=False)
class _Surface:
    """The triangles as they should be.

    Attributes:
        mesh: what is laid out: the component's mesh, or that with edges cut.
        part: the component.
        laid_out: a layout of it.
    """

    mesh: TriangleMesh
    part: Component
    laid_out: LaidOut

    @cached_property
    def lengths(self) -> FloatArray:
        """(m, 3) side lengths."""
        if self.mesh is self.part.mesh:
            return self.part.lengths
        return edge_lengths(self.mesh.vertices, self.mesh.faces)

    @cached_property
    def areas(self) -> FloatArray:
        """(m,) areas."""
        return double_areas(self.lengths) / 2

    @cached_property
    def weights(self) -> FloatArray:
        """(m,) what triangles count for their area."""
        least = np.finfo(np.float64).tiny
        besides: FloatArray = 1 + BESIDES * self.areas.mean() / np.maximum(self.areas, least)
        weights = self.part.constraints.weights
        if weights is None:
            return besides
        of_faces = np.maximum(at_unit_scale(weights), LEAST_WEIGHT)[self.part.mesh.faces].mean(axis=1)
        return besides * of_faces[self.laid_out.face_origin]

    def ratios(self, laid_out: LaidOut, chosen: IntArray | None = None) -> FloatArray:
        """Return (m,) ratios of singular values, infinite for triangles that are turned over or have no area.

        chosen: the triangles of interest, the others are infinite; None for all.
        """
        ratios = np.full(len(self.mesh.faces), np.inf)
        every = np.arange(len(ratios)) if chosen is None else chosen
        lengths = np.ascontiguousarray(self.lengths)

        def fill(start: int, stop: int) -> None:
            fill_ratios(lengths, laid_out.points, laid_out.corners, every[start:stop], ratios)

        in_halves(fill, len(every))
        return ratios

    def mean(self, ratios: FloatArray) -> float:
        """The mean ratio by area, over upright triangles."""
        upright = np.isfinite(ratios)
        return float(np.average(ratios[upright], weights=self.areas[upright])) if upright.any() else np.inf

    def without_losses(
        self, laid_out: LaidOut, moved: LaidOut, before: FloatArray, was_free: BoolArray
    ) -> tuple[LaidOut, BoolArray]:
        """Return the moved layout, but as it was where its mean or its worst triangle would be worse.

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
        gained = np.bincount(of_face, gain * self.areas[touched], count)
        worst = np.zeros(count)
        np.maximum.at(worst, of_face, after[touched])
        is_lost = ((gained < 0) | (worst > _largest(before)))[patch] & was_free
        back = np.zeros(len(moved.points), dtype=bool)
        back[moved.corners[is_lost[faces]]] = True
        return replace(moved, points=np.where(back[:, None], laid_out.points, moved.points)), is_lost

    def described(self, moved: LaidOut, before: FloatArray, was_free: BoolArray, options: Options) -> LaidOut:
        """Return the moved layout with the curvature and the scale that it has, and with what it was before."""
        mesh, given = self.mesh, self.part.mesh
        corners = rows_of(moved.points, moved.corners)
        # Where triangles were moved; elsewhere it is what it was.
        changed = np.zeros(len(mesh.vertices), dtype=bool)
        changed[mesh.faces[has_any(was_free, mesh.faces)]] = True
        curvature = np.where(changed, laid_out_curvature(mesh, corners, changed), moved.curvature)
        after = np.abs(signed_double_areas(corners)) / 2
        log_scale = np.where(was_free, vertex_log_scale(mesh, self.areas, after), moved.log_scale)
        count = len(given.vertices)
        areas = weighted_areas(
            vertex_areas(given.faces, self.part.lengths, count), self.part.constraints.weights
        )
        statistics = replace(
            moved.statistics,
            relaxed_vertices=int(was_free.sum()),
            qc_mean_unrelaxed=self.mean(before),
            qc_max_unrelaxed=_largest(before),
            area_distortion=area_distortion(log_scale[:count], areas),
        )
        is_open = mesh.is_boundary_vertex & (not options.prescribes_boundary)
        return replace(
            moved,
            curvature=curvature,
            # Where the boundary is free, what comes out is what was wanted.
            target=np.where(is_open, curvature, moved.target),
            log_scale=log_scale,
            statistics=statistics,
        )


@compiled
def fill_ratios(
    lengths: FloatArray, points: FloatArray, corners: IntArray, chosen: IntArray, ratios: FloatArray
) -> None:
    """Write the ratio of singular values of the maps of chosen triangles; infinite for those turned over.

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


def _largest(ratios: FloatArray) -> float:
    return float(ratios[np.isfinite(ratios)].max(initial=1.0))


def _around(mesh: TriangleMesh, is_bent: BoolArray) -> BoolArray:
    """Return (n,) True for the vertices of triangles and of the rings around them."""
    inside = np.zeros(len(mesh.vertices), dtype=bool)
    inside[mesh.faces[is_bent]] = True
    for _ in range(RINGS):
        inside[mesh.faces[has_any(inside, mesh.faces)]] = True
    return inside
