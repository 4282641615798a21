"""Charts of mirror symmetric models, split alike on both sides and turned upright."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._arrays import ComplexArray, FloatArray, IntArray
from ..flat import LaidOut
from ..geometry.charts import point_seams
from ..geometry.mirror import mirrored_corners, mirrored_edges
from ..geometry.planar import signed_double_areas
from ..input.symmetry import Symmetry
from ..mesh import TriangleMesh
from .chart_seams import Layout
from .glue import glue_charts
from .split import split_overlaps

# Part of the vertices of a chart whose images are to be in another for that to be its mirror image.
MOSTLY = 0.6
# The largest root mean square by which a chart may be off the mirror image of another, over the root of its area.
ALIKE = 0.05


def split_alike(
    mesh: TriangleMesh,
    whole: Layout,
    costs: FloatArray,
    areas: FloatArray,
    pairs: IntArray,
    symmetry: Symmetry,
    least: float = 0.0,
) -> Layout | None:
    """Return a layout split so that nothing overlaps, on the right as on the left; None where that is not known.

    Args:
        mesh: the mesh, whose vertices are images of each other.
        whole: its layout as one disk.
        costs: (e,) of cuts and seams.
        areas: (m,) of the triangles in the plane.
        pairs: (k, 2) of triangles that overlap.
        symmetry: of mesh and cut.
        least: the area that a chart should have at least.
    """
    is_left = symmetry.is_left
    if is_left is None or not symmetry.is_alike:
        return None
    image = mirrored_corners(mesh, symmetry.mirror.partner, is_left).reshape(-1, 3) // 3
    if (image[~is_left] < 0).any():
        return None
    image[is_left] = np.flatnonzero(is_left)[:, None]
    own, source = np.flatnonzero(is_left), image.max(axis=1)
    sides = costs[mesh.halfedge_edges].reshape(-1, 3)[own].ravel()
    # What overlaps on the right is split on the left, too; where diagonals run otherwise, both halves of the quads.
    apart = image[pairs[is_left[pairs[:, 0]] == is_left[pairs[:, 1]]]]
    apart = np.stack([np.repeat(apart[:, 0], 3, axis=1), np.tile(apart[:, 1], 3)], axis=-1).reshape(-1, 2)
    apart = np.sort(np.searchsorted(own, apart), axis=1)
    apart = np.unique(apart[apart[:, 0] != apart[:, 1]], axis=0)
    charts = split_overlaps(whole.points, whole.corners[own], sides, areas[own], apart, least)
    if charts is None:
        return None
    chart = charts[np.searchsorted(own, source)] + np.where(is_left, 0, charts.max() + 1)
    chart = _joined_in_plane(mesh, whole, chart, pairs)
    if (chart[pairs[:, 0]] == chart[pairs[:, 1]]).any():
        return None
    image = mirrored_edges(mesh, symmetry.mirror.partner)
    return glue_charts(mesh, whole.split(chart), costs, image).numbered_anew()


def _joined_in_plane(mesh: TriangleMesh, whole: Layout, chart: IntArray, pairs: IntArray) -> IntArray:
    """Return charts, those joined that meet where the plane of symmetry is not cut, if they do not overlap."""
    inside = np.flatnonzero(~mesh.is_boundary_edge)
    sides = chart[mesh.edge_faces[inside]]
    apart = point_seams(mesh, whole.corners)
    meet = np.sort(
        sides[~np.isin(inside, apart) & (np.abs(sides[:, 0] - sides[:, 1]) == (chart.max() + 1) // 2)]
    )
    over = np.sort(chart[pairs], axis=1)
    size = int(chart.max()) + 1
    meet = meet[~np.isin(meet @ [size, 1], over @ [size, 1])]
    joined = np.arange(size)
    joined[meet[:, 1]] = meet[:, 0]
    return np.unique(joined[chart], return_inverse=True)[1].ravel()


@dataclass(frozen=True, eq=False)
class ChartMirrors:
    """Which charts are mirror images of each other, by z' = factor * conj(z) + shift.

    Attributes:
        partner: (k,) the chart that each is the image of, itself if it is symmetric; -1 for none.
        factor: (k,) of modulus 1.
        off: the root mean square by which vertices are off, over the root of the area; infinite where a chart has no
            partner, NaN if no symmetry was used.
    """

    partner: IntArray
    factor: ComplexArray
    off: float


def no_mirrors(count: int) -> ChartMirrors:
    """Return what there is to say of so many charts without a symmetry."""
    return ChartMirrors(np.full(count, -1), np.ones(count, dtype=np.complex128), np.nan)


def mirrors_of(one: LaidOut) -> ChartMirrors:
    """Return the mirror images of a component's charts."""
    chart = np.zeros(len(one.corners), dtype=np.int64) if one.chart is None else one.chart
    if one.symmetry is None or not one.symmetry.seams or one.lies_on is not None:
        return no_mirrors(int(chart.max()) + 1)
    layout = Layout(one.points, one.corners, chart)
    return mirror_charts(one.mesh, layout, one.symmetry.symmetry.mirror.partner)


def mirror_charts(mesh: TriangleMesh, layout: Layout, partner: IntArray) -> ChartMirrors:
    """Return which charts of a layout are mirror images of each other.

    partner: (n,) the mirror image of each vertex; a refinement has more vertices, of which nothing is known.
    """
    count = int(layout.chart.max()) + 1
    found = no_mirrors(count)
    point, of_chart = _single_points(mesh, layout, len(partner))
    both = np.flatnonzero((point >= 0) & (point[partner] >= 0))
    here, there = of_chart[both], of_chart[partner[both]]
    table = np.bincount(here * count + there, minlength=count * count).reshape(count, count)
    squares = 0.0
    for c, other in enumerate(np.argmax(table, axis=1).tolist()):
        some = both[(here == c) & (there == other)]
        z, image = layout.places[point[some]], layout.places[point[partner[some]]]
        factor, off = _reflection(z, image)
        is_image = len(some) > MOSTLY * table[c].sum() and off <= ALIKE * np.abs(z - z.mean()).max()
        squares += len(some) * off**2 if is_image else np.inf
        if is_image:
            found.partner[c], found.factor[c] = other, factor
    area = float(np.abs(signed_double_areas(layout.points[layout.corners])).sum()) / 2
    return replace(found, off=float(np.sqrt(squares / max(len(both), 1) / area)))


def _reflection(points: ComplexArray, images: ComplexArray) -> tuple[complex, float]:
    """Return the factor, of modulus 1, of the reflection that brings points next to images, and how far off it is."""
    if not len(points):
        return 1.0, np.inf
    points, images = points - points.mean(), images - images.mean()
    total = (images * points).sum()
    factor = total / abs(total) if abs(total) > 0 else 1.0
    return factor, float(np.sqrt(np.mean(np.abs(images - factor * np.conj(points)) ** 2)))


def _single_points(mesh: TriangleMesh, layout: Layout, count: int) -> tuple[IntArray, IntArray]:
    """Return (n,) the point of each vertex that has one only, -1 for others, and the chart that it is in."""
    vertex, corner = mesh.faces.ravel(), layout.corners.ravel()
    low, high = np.full(len(mesh.vertices), len(layout.points)), np.full(len(mesh.vertices), -1)
    np.minimum.at(low, vertex, corner)
    np.maximum.at(high, vertex, corner)
    of_chart = np.zeros(len(low), dtype=np.int64)
    of_chart[vertex] = np.repeat(layout.chart, 3)
    return np.where(low == high, low, -1)[:count], of_chart[:count]


def upright_angles(
    mirrors: Sequence[ChartMirrors], angles: FloatArray, rise: ComplexArray | None
) -> FloatArray:
    """Return (k,) angles by which charts are turned so that axes of symmetry stand upright, and pairs lie mirrored.

    Args:
        mirrors: of the components, one after the other.
        angles: (k,) by which charts would be turned otherwise.
        rise: (k,) the mean direction of up in each chart, or None.
    """
    angles = angles.copy()
    first = 0
    for each in mirrors:
        for c, other in enumerate(each.partner.tolist()):
            at = first + c
            if other == c:
                # Of the two ways an axis can stand, that which is nearer.
                upright = np.pi / 2 - np.angle(each.factor[c]) / 2
                wanted = angles[at] if rise is None else np.pi / 2 - np.angle(rise[at])
                angles[at] = upright + np.pi * np.round((wanted - upright) / np.pi)
            elif 0 <= other < c and each.partner[other] == c:
                before = angles[first + other]
                angles[at] = np.angle(-np.exp(-1j * before) / each.factor[other])
        first += len(each.partner)
    return angles
