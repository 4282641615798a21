"""Charts of mirror symmetric models, split alike on both sides and turned upright."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._arrays import ComplexArray, FloatArray, IntArray
from ..flat import LaidOut
from ..geometry.charts import point_seams
from ..geometry.mirror import mirrored_corners
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
) -> Layout | None:
    """Return a layout split so that nothing overlaps, on the right as on the left; None where that is not known.

    Args:
        mesh: the mesh, whose vertices are images of each other.
        whole: its layout as one disk.
        costs: (e,) of cuts and seams.
        areas: (m,) of the triangles in the plane.
        pairs: (k, 2) of triangles that overlap.
        symmetry: of mesh and cut.
    """
    is_left = symmetry.is_left
    if is_left is None or not symmetry.mirror.is_paired:
        return None
    source = mirrored_corners(mesh, symmetry.mirror.partner, is_left).reshape(-1, 3).max(axis=1) // 3
    if (source[~is_left] < 0).any():
        return None
    own = np.flatnonzero(is_left)
    # What overlaps on the right is split on the left, too.
    image = np.where(is_left, np.arange(len(is_left)), source)
    among = pairs[is_left[pairs[:, 0]] == is_left[pairs[:, 1]]]
    among = np.sort(np.searchsorted(own, image[among]), axis=1)
    among = np.unique(among[among[:, 0] != among[:, 1]], axis=0)
    sides = costs[mesh.halfedge_edges].reshape(-1, 3)[own].ravel()
    charts = split_overlaps(whole.points, whole.corners[own], sides, areas[own], among)
    if charts is None:
        return None
    chart = np.empty(len(is_left), dtype=np.int64)
    chart[own] = charts
    chart[~is_left] = chart[source[~is_left]] + charts.max() + 1
    chart = _joined_in_plane(mesh, whole, chart, pairs)
    if (chart[pairs[:, 0]] == chart[pairs[:, 1]]).any():
        return None
    return glue_charts(mesh, whole.split(chart), costs).numbered_anew()


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


def mirror_charts(one: LaidOut) -> ChartMirrors:
    """Return the mirror images of a component's charts."""
    chart = np.zeros(len(one.corners), dtype=np.int64) if one.chart is None else one.chart
    count = int(chart.max()) + 1
    found = no_mirrors(count)
    if one.symmetry is None or not one.symmetry.seams:
        return found
    partner = one.symmetry.symmetry.mirror.partner
    point, of_chart = _single_points(one, chart, len(partner))
    both = np.flatnonzero((point >= 0) & (point[partner] >= 0))
    here, there = of_chart[both], of_chart[partner[both]]
    table = np.zeros((count, count))
    np.add.at(table, (here, there), 1)
    places = one.points @ np.array([1, 1j])
    squares = 0.0
    for c in range(count):
        other = int(np.argmax(table[c]))
        if table[c, other] == 0 or table[c, other] < MOSTLY * table[c].sum():
            squares = np.inf
            continue
        some = both[(here == c) & (there == other)]
        z, image = places[point[some]], places[point[partner[some]]]
        z, image = z - z.mean(), image - image.mean()
        total = (image * z).sum()
        if not abs(total) > 0:
            squares = np.inf
            continue
        factor = total / abs(total)
        off = np.abs(image - factor * np.conj(z)) ** 2
        if off.mean() <= ALIKE**2 * np.abs(z).max() ** 2:
            found.partner[c], found.factor[c] = other, factor
            squares += float(off.sum())
        else:
            squares = np.inf
    return replace(found, off=float(np.sqrt(squares / max(len(both), 1) / one.area)))


def _single_points(one: LaidOut, chart: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Return (n,) the point of each vertex that has one only, -1 for others, and the chart that it is in."""
    vertex, corner = one.mesh.faces.ravel(), one.corners.ravel()
    low, high = np.full(len(one.mesh.vertices), len(one.points)), np.full(len(one.mesh.vertices), -1)
    np.minimum.at(low, vertex, corner)
    np.maximum.at(high, vertex, corner)
    of_chart = np.zeros(len(low), dtype=np.int64)
    of_chart[vertex] = np.repeat(chart, 3)
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
