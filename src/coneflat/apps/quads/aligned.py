"""A flattening's layout made ready for a grid: charts turned to each other, along the creases, and at its scale."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ... import Flattening, TriangleMesh
from ...base import BoolArray, ComplexArray, FloatArray, IntArray
from ...errors import GridError
from ...geometry import as_complex, double_areas, edge_lengths, mollify, signed_double_areas
from ...layout import SeamChains, find_chains, rest_sides
from ...mesh import NEXT, PREVIOUS, point_vertices
from .sides import Sides, find_sides, side_angles
from .transitions import charts_of, first_points, joining_chains


@dataclass(frozen=True, eq=False)
class Layout:
    """A layout in units of a grid.

    Attributes:
        mesh: of all components.
        lengths: (m, 3) side lengths of its triangles in model units, column i opposite corner i.
        corners: (m, 3) the point at each triangle corner.
        points: (u,) of the plane.
        cones: (s,) vertices, inside the surface.
        sides: straight ones of the boundary, along the axes.
        size: of a square of the grid, in model units.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    corners: IntArray
    points: ComplexArray
    cones: IntArray
    sides: Sides
    size: float

    @property
    def whole(self) -> IntArray:
        """Vertices that are to lie on grid points: cones, and corners of straight sides."""
        return np.concatenate([self.cones, self.sides.corners])


def aligned(result: Flattening, quads: float | None, size: float | None) -> Layout:
    """Return the layout of a flattening, turned so that the grid follows creases, bends and boundaries.

    Args:
        result: with quantised cones.
        quads: unit squares that it is to cover.
        size: of a square in model units, instead.

    Raises:
        GridError: triangles are turned over.
        SeamError: the sides of a seam are no rigid copies of each other.
    """
    mesh = TriangleMesh(result.vertices, result.faces)
    own = edge_lengths(mesh.vertices, mesh.faces) if result.lengths is None else result.lengths
    lengths, _ = mollify(own)
    flat = signed_double_areas(result.corner_uv)
    if not (flat > 0).all():
        raise GridError(
            f"{int((flat <= 0).sum())} of {len(flat):,} triangles of the layout are turned over or have no area"
        )
    area = float(double_areas(lengths).sum()) / 2
    if size is None:
        assert quads is not None
        size = float(np.sqrt(area / quads))
    scale = np.sqrt(area / size**2 / (flat.sum() / 2))
    points = scale * as_complex(result.uv)
    cones = np.asarray(result.cones, dtype=np.int64)
    cones = cones[~mesh.is_boundary_vertex[cones]]
    layout = Layout(mesh, lengths, result.uv_faces, points, cones, Sides(), size)
    return _turned(layout)


def _turned(layout: Layout) -> Layout:
    """Return the layout with charts joined at some seams, along its creases, a cone of each component at the origin."""
    mesh, corners = layout.mesh, layout.corners
    chains = find_chains(mesh, corners, layout.points, layout.cones)
    points, of_point = joined_charts(corners, layout.points, chains)
    is_straight, angles = side_angles(mesh, corners, points, of_point)
    angles = np.where(is_straight, angles, _crease_angles(layout, points, of_point))
    points *= np.exp(-1j * angles)[of_point]
    turned = replace(layout, points=points, sides=find_sides(mesh, corners, points, is_straight[of_point]))
    return replace(turned, points=points - origins(turned, of_point)[of_point])


def joined_charts(
    corners: IntArray, points: ComplexArray, chains: SeamChains
) -> tuple[ComplexArray, IntArray]:
    """Return (u,) points with charts moved to each other, so that none of `joining_chains` moves a point.

    And (u,) the component of each point.
    """
    points = points.copy()
    chart, component = charts_of(corners, len(points), chains)
    _, firsts = np.unique(chains.chain, return_index=True)
    done = np.zeros(len(component), dtype=bool)
    done[np.unique(component, return_index=True)[1]] = True
    left_over = joining_chains(chains, chart).tolist()
    while left_over:
        later = []
        for chain in left_over:
            k = firsts[chain]
            sides = chains.left[k], chains.right[k]
            if done[chart[sides[0][0]]] == done[chart[sides[1][0]]]:
                later.append(chain)
                continue
            still, moving = sides if done[chart[sides[0][0]]] else sides[::-1]
            factor = np.diff(points[still])[0] / np.diff(points[moving])[0]
            with_it = chart == chart[moving[0]]
            points[with_it] = factor / abs(factor) * (points[with_it] - points[moving[0]]) + points[still[0]]
            done[chart[moving[0]]] = True
        left_over = later
    return points, component[chart]


def origins(layout: Layout, component: IntArray) -> ComplexArray:
    """Return (c,) the place of the first cone or corner of each component, or else of the first point on a side."""
    vertex = point_vertices(layout.mesh.faces, layout.corners, len(layout.points))
    at = np.concatenate([first_points(vertex)[layout.whole], layout.sides.points])[::-1]
    origins = np.zeros(int(component.max(initial=-1)) + 1, dtype=np.complex128)
    origins[component[at]] = layout.points[at]  # the first one stays, as the last to be written
    return origins


def _crease_angles(layout: Layout, points: ComplexArray, of_point: IntArray) -> FloatArray:
    """Return the angle of each component that most of its bending is along, up to quarter turns.

    An edge counts for the curvature it carries, its length times its dihedral angle (Cohen-Steiner and Morvan 2003),
    one on the boundary as a right angle.
    """
    mesh = layout.mesh
    starts, ends = layout.corners[:, NEXT].ravel(), layout.corners[:, PREVIOUS].ravel()
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    one, two = mesh.edge_halfedges.T
    first, second = normals[one // 3], normals[np.maximum(two, 0) // 3]
    bend = np.arctan2(np.linalg.norm(np.cross(first, second), axis=1), (first * second).sum(axis=1))
    bend[two < 0] = np.pi / 2
    side = points[ends[one]] - points[starts[one]]
    length = layout.lengths.ravel()[one]
    fourth = length * bend * (side / np.abs(side)) ** 4
    label, count = of_point[starts[one]], int(of_point.max(initial=-1)) + 1
    sums = np.bincount(label, fourth.real, count) + 1j * np.bincount(label, fourth.imag, count)
    angles: FloatArray = np.angle(sums) / 4
    return angles


# Triangles that one with given sides split falls apart into, by their corners: 0 to 2 its own, 3 + i the middle of the
# side opposite corner i. The sides split are the bits of the index.
PIECES: tuple[tuple[tuple[int, int, int], ...], ...] = (
    ((0, 1, 2),),
    ((0, 1, 3), (0, 3, 2)),
    ((1, 2, 4), (1, 4, 0)),
    ((4, 3, 2), (0, 1, 3), (0, 3, 4)),
    ((2, 0, 5), (2, 5, 1)),
    ((5, 1, 3), (2, 0, 5), (2, 5, 3)),
    ((0, 5, 4), (1, 2, 4), (1, 4, 5)),
    ((0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5)),
)


def between_whole(layout: Layout) -> BoolArray:
    """Return (e,) the edges between two vertices that are to lie on grid points.

    A triangle of three such has no place where these come to lie in a row.
    """
    is_whole = np.zeros(len(layout.mesh.vertices), dtype=bool)
    is_whole[layout.whole] = True
    return np.asarray(is_whole[layout.mesh.edges].all(axis=1))


def split_edges(layout: Layout, is_split: BoolArray) -> Layout:
    """Return a layout of the same surface with edges split in the middle; is_split: (e,)."""
    mesh, corners, points = layout.mesh, layout.corners, layout.points
    edge_of = mesh.halfedge_edges.reshape(-1, 3)
    number = np.full(len(mesh.edges), -1)
    number[is_split] = len(mesh.vertices) + np.arange(int(is_split.sum()))
    middle = mesh.vertices[mesh.edges[is_split]].mean(axis=1)
    own, pairs = _middle_points(corners, is_split[edge_of], len(points))
    origin, piece = _pieces((is_split[edge_of] * [1, 2, 4]).sum(axis=1))
    faces, new_corners = (
        np.take_along_axis(np.concatenate(both, axis=1)[origin], piece, axis=1)
        for both in ((mesh.faces, number[edge_of]), (corners, own))
    )
    places = np.take_along_axis(_six_places(layout.lengths)[origin], piece, axis=1)
    whole_mesh = TriangleMesh(np.concatenate([mesh.vertices, middle]), faces)
    lengths: FloatArray = np.abs(places[:, PREVIOUS] - places[:, NEXT])
    new_points = np.concatenate([points, points[pairs].mean(axis=1)])
    split = replace(layout, mesh=whole_mesh, lengths=lengths, corners=new_corners, points=new_points)
    return replace(split, sides=find_sides(whole_mesh, new_corners, new_points, _is_straight(split)))


def _pieces(kind: IntArray) -> tuple[IntArray, IntArray]:
    """Return (t,) the triangle of each piece, in order, and (t, 3) its corners; kind: (m,) the sides split."""
    origin, corners = [], []
    for which, pieces in enumerate(PIECES):
        at = np.flatnonzero(kind == which)
        for piece in pieces:
            origin.append(at)
            corners.append(np.tile(piece, (len(at), 1)))
    all_of = np.concatenate(origin)
    order = np.argsort(all_of, kind="stable")
    return all_of[order], np.concatenate(corners)[order]


def _middle_points(corners: IntArray, is_split: BoolArray, count: int) -> tuple[IntArray, IntArray]:
    """Return (m, 3) the point in the middle of each side that is split, from `count`, and (k, 2) between which."""
    ends = np.sort(np.stack([corners[:, NEXT], corners[:, PREVIOUS]], axis=-1), axis=-1)
    pairs, index = np.unique(ends[is_split], axis=0, return_inverse=True)
    own = np.full(corners.shape, -1)
    own[is_split] = count + index.ravel()
    return own, pairs


def _six_places(lengths: FloatArray) -> ComplexArray:
    """Return (m, 6) corners of triangles with given sides, and the middles of these, in the plane."""
    sides = rest_sides(lengths)
    places = np.stack([np.zeros(len(sides)), sides[:, 2], -sides[:, 1]], axis=1)
    middles = (places[:, NEXT] + places[:, PREVIOUS]) / 2
    return np.concatenate([places, middles], axis=1)


def _is_straight(layout: Layout) -> BoolArray:
    """Return (u,) the points of components whose boundary has straight sides."""
    count = len(layout.points)
    chains = find_chains(layout.mesh, layout.corners, layout.points, layout.cones)
    chart, component = charts_of(layout.corners, count, chains)
    of_point = component[chart]
    known = layout.sides.points
    return np.isin(of_point, of_point[known])
