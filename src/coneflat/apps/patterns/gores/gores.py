"""Gores: strips of a surface from pole to pole, between half-planes through an axis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .... import TriangleMesh, unwrap
from ....base import FloatArray, IntArray, inner_calls, mask_of, plural
from ....errors import MeshError, MetricError
from ....geometry import double_areas, edge_lengths, unit_vectors
from ....mesh import tie_key
from ..pieces.cut_surface import CutSurface
from ..pieces.development import Development
from ..pieces.relaxing import least_strained
from ..units import percentage, text_of_direction
from .half_planes import AroundAxis

# Digits of radii and keys by which the vertex of the first half-plane is chosen: rounding errors are smaller.
DIGITS = 7

# Strain of gores around the upward axis, relative to that around another one, up to which the upward one is taken.
MUCH_LESS = 1.1
# Strain above which a note says so: cloth, paper and sheets are rarely stretched by more.
NOTED_STRAIN = 0.05
# Difference of the heights of the two ends of a strip, relative to the extent, up to which neither is the upper one.
LEVEL = 1e-6


def cut_gores(mesh: TriangleMesh, count: int, axis: FloatArray) -> Development:
    """Return a surface cut into strips between half-planes at equal angles around an axis.

    The axis goes through the centre of area. A half-plane goes through the vertex that is farthest from it. Triangles
    are divided where half-planes cross them; vertices near a half-plane slide onto it. Strips have the least strain
    that was found, and both sides of every seam are equally long; they stand along it.

    Args:
        mesh: a connected surface: a body of revolution or a similar one, closed or open.
        count: the number of strips, at least 2.
        axis: (3,) direction from pole to pole.

    Raises:
        MeshError: a strip between two half-planes is not a disk.
    """
    axis = np.asarray(axis, dtype=float)
    strips = _Strips.of(mesh, count, axis)
    sectors = strips.sector[strips.mesh.edge_faces]
    is_seam = ~strips.mesh.is_boundary_edge & (sectors[:, 0] != sectors[:, 1])
    closed = CutSurface(strips.mesh, strips.mesh.faces, np.zeros((len(strips.mesh.vertices), 2)))
    flat = closed.cut_along(np.flatnonzero(is_seam))
    _check_strips(flat, strips)
    flat = least_strained(_laid_out(flat))
    notes = tuple(_notes_on_strain(flat, strips))
    return Development(flat.with_points(_upright(flat, strips)), notes=notes)


def best_axis(mesh: TriangleMesh, count: int, upward: FloatArray) -> tuple[float, float, float]:
    """Return the axis of a surface around which gores have the least strain: a coordinate axis.

    Args:
        mesh: the surface.
        count: the number of strips.
        upward: (3,) the axis that is taken unless another one has much less strain.

    Raises:
        MeshError: there are no gores around any of them; the error is that of the upward one.
    """
    axes = sorted(
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), key=lambda axis: -abs(float(upward @ axis))
    )
    outcomes = [_largest_strain(mesh, count, axis) for axis in axes]
    strains = [outcome if isinstance(outcome, float) else np.inf for outcome in outcomes]
    if isinstance(outcomes[0], Exception) and min(strains) == np.inf:
        raise outcomes[0]
    return next(
        axis for axis, strain in zip(axes, strains, strict=True) if strain <= MUCH_LESS * min(strains)
    )


def _largest_strain(
    mesh: TriangleMesh, count: int, axis: tuple[float, float, float]
) -> float | MeshError | MetricError:
    """Return the largest strain of gores around an axis, or the error if there are none."""
    try:
        surface = cut_gores(mesh, count, np.array(axis)).surface
    except (MeshError, MetricError) as error:
        return error
    return float(np.abs(surface.edges.strains(surface.points)).max())


def _notes_on_strain(flat: CutSurface, strips: _Strips) -> Iterator[str]:
    """Yield a sentence if lengths change by more than most materials stretch."""
    strain = float(np.abs(flat.edges.strains(flat.points)).max())
    if strain > NOTED_STRAIN:
        yield (
            f"lengths of {strips.count} gores around the axis {text_of_direction(strips.axis)} change by up to "
            f"{percentage(strain)}: more gores, another axis, or kind cloth change them less"
        )


@dataclass(frozen=True, eq=False)
class _Strips:
    """A mesh divided along half-planes.

    Attributes:
        mesh: the divided mesh.
        around: the same in coordinates around the axis.
        sector: (m,) the sector of each triangle.
        count: the number of sectors.
        axis: (3,) direction of the axis.
    """

    mesh: TriangleMesh
    around: AroundAxis
    sector: IntArray
    count: int
    axis: FloatArray

    @classmethod
    def of(cls, mesh: TriangleMesh, count: int, axis: FloatArray) -> _Strips:
        areas = double_areas(edge_lengths(mesh.vertices, mesh.faces))
        origin = mesh.vertices.mean(axis=0)
        centre = origin + areas @ (mesh.vertices[mesh.faces] - origin).mean(axis=1) / areas.sum()
        frame = _frame(mesh, centre, unit_vectors(axis[None])[0])
        around = AroundAxis.of(mesh, centre, frame)
        for number in range(count):
            around = around.split_at(2 * np.pi * number / count, 2 * np.pi / count)
        vertices = centre + around.vertices @ frame
        turns = _turns(around.vertices[around.faces].mean(axis=1))
        return cls(
            TriangleMesh(vertices, around.faces),
            around,
            np.floor(turns * count).astype(int) % count,
            count,
            axis,
        )

    @property
    def requirement(self) -> str:
        """What surfaces must be like, and what to do otherwise, for errors."""
        return (
            f"gores need a surface around the axis, here {text_of_direction(self.axis)}, like a ball, a vase or a lamp "
            "shade; give another axis, or choose kind cloth"
        )

    def plane_of(self, edges: IntArray) -> IntArray:
        """Return (k,) the half-plane of each of given edges (k,) between two sectors."""
        middle = self.around.vertices[self.mesh.edges[edges]].mean(axis=1)
        return np.round(_turns(middle) * self.count).astype(int) % self.count


def _turns(places: FloatArray) -> FloatArray:
    """Return (k,) the angles of places (k, 3) around the third axis, in full turns."""
    return np.arctan2(places[:, 1], places[:, 0]) / (2 * np.pi)


def _frame(mesh: TriangleMesh, centre: FloatArray, axis: FloatArray) -> FloatArray:
    """Return axes as rows, the first one towards the vertex farthest from the axis, the last one along it."""
    places = mesh.vertices - centre
    across = places - (places @ axis)[:, None] * axis
    radii = np.linalg.norm(across, axis=1)
    key = np.round(tie_key(mesh.vertices), DIGITS)
    farthest = np.lexsort([key, np.round(radii / radii.max(), DIGITS)])[-1]
    right = across[farthest] / radii[farthest]
    return np.stack([right, np.cross(axis, right), axis])


def _check_strips(flat: CutSurface, strips: _Strips) -> None:
    """Raise MeshError if the strips are not disks, one in each sector."""
    pieces = TriangleMesh(np.zeros((len(flat.points), 3)), flat.corners)
    count = strips.count
    for number in range(count):
        faces = np.flatnonzero(strips.sector == number)
        parts = len(np.unique(flat.pieces[faces]))
        if parts != 1:
            raise MeshError(
                f"strip {number + 1} of {count} consists of {plural(parts, 'piece')} instead of one: "
                f"{strips.requirement}"
            )
        edges = pieces.halfedge_edges.reshape(-1, 3)[faces]
        euler = len(np.unique(flat.corners[faces])) - len(np.unique(edges)) + len(faces)
        if euler != 1:
            raise MeshError(
                f"strip {number + 1} of {count} is not a disk but has Euler characteristic {euler}: "
                f"{strips.requirement}"
            )


def _laid_out(flat: CutSurface) -> CutSurface:
    """Return the strips laid out without flipped triangles."""
    pieces = TriangleMesh(_opened_vertices(flat), flat.corners)
    with inner_calls():
        result = unwrap(pieces.vertices, pieces.faces, seams="none")
    laid = CutSurface.of(result)
    if len(laid.points) != len(flat.points) or len(laid.seams):
        raise MetricError("strips could not be laid out without further cuts: increase the number of gores")
    points = np.empty_like(flat.points)
    points[flat.corners] = laid.places
    return flat.with_points(points)


def _opened_vertices(flat: CutSurface) -> FloatArray:
    """Return (u, 3) the position of each point on the surface."""
    return flat.mesh.vertices[flat.vertex_of_point]


def _upright(flat: CutSurface, strips: _Strips) -> FloatArray:
    """Return the points with the centre line of each strip along y: between the middles of its two ends."""
    points = flat.points.copy()
    is_seam = mask_of(len(flat.mesh.edges), flat.seams)[flat.mesh.halfedge_edges]
    sides = np.flatnonzero(is_seam)
    plane = strips.plane_of(flat.mesh.halfedge_edges[sides])
    for number in range(strips.count):
        is_inside = strips.sector[sides // 3] == number
        seams = [
            _ends_of_path(flat, sides[is_inside & (plane == bound % strips.count)], strips)
            for bound in (number, number + 1)
        ]
        bottom, top = _middles(flat, seams, strips.around.vertices)
        direction = (top - bottom) / np.linalg.norm(top - bottom)
        across = np.array([direction[1], -direction[0]])
        strip = np.unique(flat.corners[strips.sector == number])
        moved = points[strip] - (bottom + top) / 2
        points[strip] = np.stack([moved @ across, moved @ direction], axis=1)
    return points


def _ends_of_path(flat: CutSurface, sides: IntArray, strips: _Strips) -> IntArray:
    """Return (2, 2) the vertex and the point at both ends of a path of half-edges."""
    corner = np.stack([3 * (sides // 3) + (sides + step) % 3 for step in (1, 2)])
    corners, counts = np.unique(flat.corners.ravel()[corner], return_counts=True)
    ends = corners[counts == 1]
    if len(ends) != 2:
        raise MeshError(
            f"a seam between two gores has {plural(len(ends), 'end')} instead of two: {strips.requirement}"
        )
    return np.stack([flat.vertex_of_point[ends], ends], axis=1)


def _middles(flat: CutSurface, seams: list[IntArray], places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the middles of the lower and of the upper end of a strip in the plane.

    Args:
        flat: the strips.
        seams: (2, 2) for each of both seams, the vertex and the point at its ends.
        places: (n, 3) positions of the vertices, the third coordinate upward.
    """
    left, right = seams
    straight, crossed = (
        np.linalg.norm(places[left[:, 0]] - places[order[:, 0]], axis=1).sum()
        for order in (right, right[::-1])
    )
    pairs = np.stack([left, right if straight <= crossed else right[::-1]], axis=1)
    heights = places[pairs[:, :, 0], 2].mean(axis=1)
    middles = flat.points[pairs[:, :, 1]].mean(axis=1)
    is_pole = pairs[:, 0, 0] == pairs[:, 1, 0]
    size = np.ptp(places, axis=0).max()
    is_level = abs(heights[1] - heights[0]) <= LEVEL * size
    is_reversed = bool(is_pole[0] and not is_pole[1]) if is_level else heights[0] > heights[1]
    return (middles[1], middles[0]) if is_reversed else (middles[0], middles[1])
