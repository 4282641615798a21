"""Layouts relaxed: the few triangles that cones bend too much, or all of them on the way from angles to areas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .._arrays import BoolArray, FloatArray
from ..errors import SeamError
from ..geometry import double_areas
from ..geometry.operators import LEAST_WEIGHT, area_distortion, at_unit_scale, vertex_areas, weighted_areas
from ..geometry.planar import signed_double_areas
from ..input.components import Component
from ..layout.relax import StretchEnergy, relax
from ..layout.relax.elements import map_factors
from ..layout.relax.relax import rest_sides
from ..mesh import TriangleMesh, label_components
from ..options import Options
from .base import LaidOut, laid_out_curvature, vertex_log_scale
from .methods import held_boundary

# Triangles with more quasi-conformal distortion than this are relaxed, with so many rings around them. Measured:
# freeing a twentieth of the vertices of a fine mesh and three quarters of a coarse one, the mean comes within 0.0025 of
# what it is with all free.
BENT, RINGS = 1.35, 3
# Part of what was gained that a further Newton step must promise, and steps at most: around single triangles, and of
# the whole mesh.
LOCAL, WHOLE = (1e-3, 12), (1e-4, 40)
# Part of the mean area that every triangle counts more than its own: with none, slivers are bent without end, 60 to 1
# on a decimated face instead of 11; means rise by 0.0005.
BESIDES = 0.1
# Where a patch's mean or the worst triangle of all would be worse, the same is tried with this sharpness.
SHARP = 2.0


def relaxed(laid_out: LaidOut, part: Component, options: Options, tell: Callable[[str], None]) -> LaidOut:
    """Return a layout with less distortion, the same cones and the same seams; see `polish` and `stretch`.

    The boundary stays where its lengths or its shape are prescribed.

    tell: called before each step with what is being done.
    """
    if not relaxes(options) or laid_out.mesh is not part.mesh:
        return laid_out
    before = _Maps.of(laid_out, part)
    is_free = ~held_boundary(part.mesh, part.constraints, options)
    whole = options.stretch > 0 or options.polish == "whole"
    if not whole:
        is_free &= _around(part.mesh, before.ratio > BENT)
    if not is_free.any():
        return _described(laid_out, laid_out, before, part, options, is_free)
    try:
        return _relaxed(laid_out, part, options, is_free, whole, before, tell)
    except SeamError as error:  # a metric that did not converge
        return replace(laid_out, notes=(*laid_out.notes, f"Not relaxed: {error}.")) if whole else laid_out


def _relaxed(
    laid_out: LaidOut,
    part: Component,
    options: Options,
    is_free: BoolArray,
    whole: bool,
    before: _Maps,
    tell: Callable[[str], None],
) -> LaidOut:
    moved, was_free = laid_out, is_free
    for sharpness in (1.0, SHARP):
        found = relax(
            part.mesh,
            moved.points,
            moved.corners,
            StretchEnergy(options.stretch, sharpness),
            lengths=part.lengths,
            weights=_face_weights(part, before),
            free=is_free,
            tolerance=(WHOLE if whole else LOCAL)[0],
            steps=(WHOLE if whole else LOCAL)[1],
            progress=lambda step, _: tell(f"step {step}"),
        )
        tried = replace(moved, points=found.points)
        if options.stretch:
            moved = tried
            break
        moved, is_free = _without_losses(moved, tried, before, part, is_free)
        if not is_free.any():
            break
    return _described(laid_out, moved, before, part, options, was_free)


def relaxes(options: Options) -> bool:
    """Whether layouts are relaxed at all; those of other methods are what these have published."""
    return (
        options.method == "exact" and not options.refine and (options.polish != "off" or options.stretch > 0)
    )


def _face_weights(part: Component, before: _Maps) -> FloatArray:
    """Return (m,) what triangles count for their area."""
    besides: FloatArray = 1 + BESIDES * before.areas.mean() / before.areas
    weights = part.constraints.weights
    if weights is None:
        return besides
    return besides * np.maximum(at_unit_scale(weights), LEAST_WEIGHT)[part.mesh.faces].mean(axis=1)


def mean_ratio(laid_out: LaidOut, part: Component) -> float:
    """Return the mean quasi-conformal distortion of a layout, by area."""
    return _Maps.of(laid_out, part).mean()


@dataclass(frozen=True, eq=False)
class _Maps:
    """How triangles are mapped: (m,) ratios of singular values, infinite where turned over; areas in space."""

    ratio: FloatArray
    areas: FloatArray

    @classmethod
    def of(cls, laid_out: LaidOut, part: Component) -> _Maps:
        along, across = map_factors(rest_sides(part.lengths))
        corners = laid_out.points[laid_out.corners]
        places = (corners - corners[:, :1]) @ np.array([1.0, 1j])
        one, two = np.abs((along * places).sum(axis=1)), np.abs((across * places).sum(axis=1))
        ratio = np.divide(one + two, one - two, out=np.full(len(one), np.inf), where=one > two)
        return cls(ratio, double_areas(part.lengths) / 2)

    def mean(self) -> float:
        """The mean ratio by area, over upright triangles."""
        upright = np.isfinite(self.ratio)
        return (
            float(np.average(self.ratio[upright], weights=self.areas[upright])) if upright.any() else np.inf
        )

    def largest(self) -> float:
        """The largest ratio of upright triangles."""
        return float(self.ratio[np.isfinite(self.ratio)].max(initial=1.0))


def _around(mesh: TriangleMesh, is_bent: BoolArray) -> BoolArray:
    """Return (n,) True for the vertices of triangles and of the rings around them."""
    inside = np.zeros(len(mesh.vertices), dtype=bool)
    inside[mesh.faces[is_bent]] = True
    for _ in range(RINGS):
        inside[mesh.faces[inside[mesh.faces].any(axis=1)]] = True
    return inside


def _without_losses(
    laid_out: LaidOut, moved: LaidOut, before: _Maps, part: Component, was_free: BoolArray
) -> tuple[LaidOut, BoolArray]:
    """Return the moved layout, but as it was around vertices where its mean or its worst triangle would be worse.

    These, (n,), too.
    """
    after = _Maps.of(moved, part)
    mesh, faces = part.mesh, part.mesh.faces
    edges = mesh.edges[was_free[mesh.edges].all(axis=1)]
    count, patch = label_components(len(mesh.vertices), edges[:, 0], edges[:, 1])
    touched = np.flatnonzero(was_free[faces].any(axis=1) & np.isfinite(before.ratio))
    corner = np.argmax(was_free[faces[touched]], axis=1)
    of_face = patch[faces[touched, corner]]
    gain = before.ratio[touched] - after.ratio[touched]
    gained = np.bincount(of_face, gain * before.areas[touched], count)
    worst = np.zeros(count)
    np.maximum.at(worst, of_face, after.ratio[touched])
    is_lost = (gained < 0) | (worst > before.largest())
    lost = is_lost[patch] & was_free
    back = np.zeros(len(moved.points), dtype=bool)
    back[moved.corners[lost[faces]]] = True
    return replace(moved, points=np.where(back[:, None], laid_out.points, moved.points)), lost


def _described(
    laid_out: LaidOut,
    moved: LaidOut,
    before: _Maps,
    part: Component,
    options: Options,
    was_free: BoolArray,
) -> LaidOut:
    """Return the moved layout with the curvature and the scale that it has, and with what it was before."""
    mesh = part.mesh
    corners = moved.points[moved.corners]
    curvature = laid_out_curvature(mesh, corners)
    after = np.abs(signed_double_areas(corners)) / 2
    log_scale = np.where(was_free, vertex_log_scale(mesh, before.areas, after), laid_out.log_scale)
    areas = weighted_areas(
        vertex_areas(mesh.faces, part.lengths, len(mesh.vertices)), part.constraints.weights
    )
    statistics = replace(
        laid_out.statistics,
        relaxed_vertices=int(was_free.sum()),
        qc_mean_unrelaxed=before.mean(),
        qc_max_unrelaxed=before.largest(),
        area_distortion=area_distortion(log_scale, areas),
    )
    is_open = mesh.is_boundary_vertex & (not options.prescribes_boundary)
    return replace(
        moved,
        curvature=curvature,
        # Where the boundary is free, what comes out is what was wanted.
        target=np.where(is_open, curvature, laid_out.target),
        log_scale=log_scale,
        statistics=statistics,
    )
