"""Seams whose sides move independently: for inverted triangles that cannot be flipped otherwise, and for charts."""

from __future__ import annotations

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, mask_of, rows_of
from ..base.notes import Unmet
from ..base.progress import stage
from ..base.text import list_some, plural
from ..geometry import double_areas
from ..geometry.intrinsic import halfedge_twins
from ..geometry.operators import cotangent_laplacian
from ..geometry.planar import sides_between, signed_double_areas
from ..geometry.straight import FlatTriangles, rest_sides
from ..geometry.unfolding import unfold
from ..linalg import factorize
from ..mesh.connectivity import TriangleMesh
from ..mesh.holes import find_holes, with_fans
from ..stages import ConeSpec, Layout
from .energies import StretchEnergy
from .relaxed_layouts import LayoutGroup
from .relaxing import relax
from .untangling import MAX_RINGS, find_degenerate, untangle


@stage("relax")
def untangle_seams(layout: Layout, spec: ConeSpec, stretch: float, quantum: float | None) -> Layout:
    """Return a layout whose inverted triangles are positively oriented, while seams near them may become unequal.

    Points move in the plane, those on the two sides of a seam independently, and are relaxed there. The lengths of the
    sides and the angles around their vertices, including cones, may change. If triangles stay inverted, the chart is
    embedded again as a disk and relaxed. Vertices of a prescribed boundary do not move. Layouts whose seams rotate by
    multiples of a quantum are returned unchanged.

    Args:
        layout: a layout in one chart.
        spec: the weights and the names of the vertices.
        stretch: balance of the relaxation between angles, 0, and areas, 1.
        quantum: angle in radians of whose multiples the seam rotations are, in which case the layout is not changed;
            None for any rotation.

    Returns:
        The layout, with a note if triangles were flipped.

    See Also:
        untangled_disk: which moves the points.
    """
    sides = sides_between(rows_of(layout.points, layout.corners))
    was_bad = find_degenerate(sides)
    if quantum is not None or not was_bad.any():
        return layout
    disk = TriangleMesh(np.zeros((len(layout.points), 3)), layout.corners)
    vertex = np.empty(len(layout.points), dtype=np.int64)
    vertex[layout.corners] = layout.mesh.faces
    points, is_free, is_embedded = untangled_disk(
        disk, layout.points, layout.lengths, layout.is_fixed[vertex]
    )
    caveat = "no seam or cone is exact" if is_embedded else "the sides of seams near them are unequal"
    if not is_free.any():
        return layout
    group = LayoutGroup([layout], [spec.weights])
    points = relax(
        disk,
        points,
        disk.faces,
        StretchEnergy(stretch),
        lengths=group.lengths_as_laid_out,
        weights=group.weights,
        free=is_free,
    ).points
    was_free = mask_of(len(layout.mesh.vertices), vertex[is_free])
    untangled = group.updated(points, was_free)[0]
    flipped = np.flatnonzero(was_bad & ~find_degenerate(sides_between(points[disk.faces])))
    if not len(flipped):
        return layout
    where = list_some(f"vertex {name}" for name in np.unique(spec.names[layout.mesh.faces[flipped, 0]]))
    note = (
        f"{plural(len(flipped), 'triangle')} could not be untangled with matching seams, next to "
        f"{where}: they are positively oriented, but {caveat}."
    )
    return untangled.with_notes(Unmet(note))


def relaxed_disks(
    disks: TriangleMesh,
    points: FloatArray,
    lengths: FloatArray,
    of_face: IntArray,
    free: BoolArray | None = None,
    tolerance: float = 1e-3,
) -> FloatArray:
    """Return (c, 2) points of disks with the least symmetric Dirichlet energy, without flipping triangles.

    If triangles are flipped at the start, all points move, and the minimisation starts from an embedding.

    Args:
        disks: one or several disks as one mesh, which may have holes.
        points: (c, 2) the points at the start.
        lengths: (m, 3) side lengths of the triangles on the surface.
        of_face: (m,) the disk of each triangle.
        free: (c,) the points that move; None for all.
        tolerance: see `relax`.
    """
    if not (signed_double_areas(points[disks.faces]) > 0).all():
        points, free = embedded_disks(disks, of_face, double_areas(lengths) / 2), None
    energy = StretchEnergy(1.0)
    return relax(
        disks, points, disks.faces, energy, lengths=lengths, free=free, tolerance=tolerance, to_scale=True
    ).points


def untangled_disk(
    disk: TriangleMesh, points: FloatArray, lengths: FloatArray, fixed: BoolArray, may_wind: bool = False
) -> tuple[FloatArray, BoolArray, bool]:
    """Return points of a disk whose inverted triangles are positively oriented, except those that cannot be untangled.

    Args:
        disk: the disk, which may have holes; the angles at its borders are free.
        points: (c, 2) its points.
        lengths: (m, 3) side lengths of its triangles on the surface.
        fixed: (c,) points that do not move.
        may_wind: whether triangles may wind around inner vertices several times where nothing else untangles them; the
            disk is not embedded again then.

    Returns:
        (c, 2) points, (c,) those that moved, and whether the disk was embedded again.
    """
    # The angle at a vertex of a prescribed boundary is preserved if the adjacent seam edges do not move.
    border = disk.edges[disk.is_boundary_edge]
    is_near = fixed.copy()
    is_near[border[fixed[border].any(axis=1)]] = True
    sides, twins = sides_between(points[disk.faces]), halfedge_twins(disk)
    flat = FlatTriangles(sides.ravel(), np.ones(sides.size, dtype=np.complex128), twins)
    fixed_input = disk.is_boundary_vertex, (is_near, fixed), rest_sides(lengths)
    angles = np.where(disk.is_boundary_vertex, np.nan, 2 * np.pi)
    # More rings rarely help if triangles may wind, and take half of the time on small CAD parts.
    rings = MAX_RINGS // 2 if may_wind else 2 * MAX_RINGS
    untangled = untangle(flat, disk.faces, angles, *fixed_input, rings)
    if may_wind:
        untangled = untangle(untangled.flat, disk.faces, np.full_like(angles, np.nan), *fixed_input, rings)
    places, moved = unfold(untangled.flat, disk.faces), mask_of(len(points), untangled.moved)
    if len(untangled.left) and not (may_wind or fixed.any()) and disk.components[0] == 1:
        areas = np.abs(signed_double_areas(places[disk.faces])) / 2
        embedded = embedded_disks(disk, np.zeros(len(areas), dtype=np.int64), areas)
        if not find_degenerate(sides_between(embedded[disk.faces])).any():
            return embedded, ~fixed, True
    return places, moved, False


def embedded_disks(disks: TriangleMesh, of_face: IntArray, areas: FloatArray) -> FloatArray:
    """Return (c, 2) points of disks by Tutte's embedding: borders on circles, inner points at neighbour means.

    Holes are filled, so that their borders are inside.

    Args:
        disks: one or several disks as one mesh, which may have holes.
        of_face: (m,) the disk of each triangle.
        areas: (m,) areas of the triangles; each disk gets the area of its triangles.

    Notes:
        W. T. Tutte, "How to draw a graph", 1963: with every inner point at the mean of its neighbours and the border on
        a convex curve no triangle is inverted. A layout relaxed from this embedding is much worse than one relaxed from
        a layout of a flat metric.
    """
    count, of = len(disks.vertices), np.zeros(len(disks.vertices), dtype=np.int64)
    of[disks.faces] = of_face[:, None]
    holes = find_holes(disks, np.ones(disks.faces.shape))
    filled = with_fans(disks, [disks.tails[hole] for hole in holes])
    points = np.zeros((len(filled.vertices), 2))
    for walk in filled.boundary_walks():
        turn = 2 * np.pi * np.arange(len(walk)) / len(walk)
        points[filled.tails[walk]] = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    inside = np.flatnonzero(~filled.is_boundary_vertex)
    if len(inside):
        rows = cotangent_laplacian(filled.faces, np.ones(filled.faces.shape), len(points))[inside]
        points[inside] = factorize(rows[:, inside]).solve(-(rows @ points))
    points = points[:count]
    flat = np.bincount(of_face, np.abs(signed_double_areas(points[disks.faces])) / 2)
    scale = np.sqrt(np.bincount(of_face, areas) / np.maximum(flat, np.finfo(float).tiny))
    return np.asarray(scale[of, None] * points)
