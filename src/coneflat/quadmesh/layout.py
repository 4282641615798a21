"""Layouts in units of a grid: straight sides, alignment of charts with each other and with creases, edge splits."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import csr_matrix

from ..base import BoolArray, ComplexArray, FloatArray, IntArray, mask_of
from ..errors import GridError
from ..geometry import (
    as_complex,
    as_pairs,
    corner_angles,
    double_areas,
    edge_lengths,
    mollify,
    sides_between,
    signed_angles,
    signed_double_areas,
)
from ..linalg import MultiGraph
from ..mesh import NEXT, PREVIOUS, label_components, label_faces, point_vertices
from ..mesh.connectivity import TriangleMesh
from ..optimise import SeamChains, find_chains, rest_sides
from ..result import Flattening
from .cross_field import SHARP_ANGLE, complex_sums, halfedge_angles, preferred_directions
from .features import split_longest
from .limits import NO_LIMIT, SquareLimit
from .options import GRID_TOLERANCE


def _none() -> IntArray:
    return np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Sides:
    """Straight sides of a boundary, without seams or corners inside a side.

    Attributes:
        corners: (k,) vertices where sides meet at an angle.
        points: (q,) points on sides, including their ends; a point on two sides occurs twice.
        side: (q,) the side of each.
        axis: (l,) the common coordinate of the points of each side: 0 for x, 1 for y.
    """

    corners: IntArray = field(default_factory=_none)
    points: IntArray = field(default_factory=_none)
    side: IntArray = field(default_factory=_none)
    axis: IntArray = field(default_factory=_none)

    @property
    def directions(self) -> FloatArray:
        """(l, 2) unit vectors along the sides."""
        return np.eye(2)[1 - self.axis]


@dataclass(frozen=True, eq=False)
class GridLayout:
    """A layout in units of a grid.

    Attributes:
        mesh: the mesh with all components.
        lengths: (m, 3) side lengths of its triangles in model units, column i opposite corner i.
        corners: (m, 3) the point at each triangle corner.
        points: (u,) points in the plane.
        cones: (s,) inner vertices.
        sides: straight sides of the boundary, along the axes.
        size: edge length of a square of the grid in model units.
        limit: largest number of squares of a grid near this layout.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    corners: IntArray
    points: ComplexArray
    cones: IntArray
    sides: Sides
    size: float
    limit: SquareLimit = NO_LIMIT

    @property
    def nodes(self) -> IntArray:
        """Vertices that must lie on grid points: cones, and corners of straight sides."""
        return np.concatenate([self.cones, self.sides.corners])

    @property
    def node_quarters(self) -> IntArray:
        """The angles at these vertices in quarter turns."""
        z = self.points[self.corners]
        return quarters_around(self.mesh, z[:, PREVIOUS] - z[:, NEXT])[self.nodes]

    @property
    def vertex(self) -> IntArray:
        """(u,) the vertex of the mesh for each point."""
        return point_vertices(self.mesh.faces, self.corners, len(self.points))

    @property
    def ends(self) -> tuple[IntArray, IntArray]:
        """(3m,), (3m,) the points at the start and at the end of each half-edge."""
        return self.corners[:, NEXT].ravel(), self.corners[:, PREVIOUS].ravel()

    @property
    def border(self) -> IntArray:
        """The half-edges of the boundary."""
        return self.mesh.edge_halfedges[self.mesh.is_boundary_edge, 0]

    @property
    def area(self) -> float:
        """The area of the layout in squares."""
        return float(self.double_areas().sum()) / 2

    def graph(self, is_used: BoolArray | slice = slice(None)) -> csr_matrix:
        """Return (n, n) the lengths of edges between vertices in the plane, of some half-edges (3m,) or all."""
        mesh, (starts, ends) = self.mesh, self.ends
        lengths = np.abs(self.points[ends] - self.points[starts])[is_used]
        at = mesh.tails[is_used], mesh.heads[is_used]
        halfedges = csr_matrix((lengths, at), shape=(len(mesh.vertices),) * 2)
        return halfedges.maximum(halfedges.T)

    def double_areas(self) -> FloatArray:
        """Return (m,) twice the signed areas of triangles in the plane, negative for flipped ones."""
        return signed_double_areas(as_pairs(self.points)[self.corners])

    def scaled(self, factor: float) -> GridLayout:
        """Return the layout with the number of squares multiplied by a factor."""
        times = float(np.sqrt(factor))
        return replace(self, points=times * self.points, size=self.size / times)

    def chains(self) -> SeamChains:
        """Return the seams as chains between vertices that must lie on grid points; see `find_chains`."""
        return find_chains(self.mesh, self.corners, self.points, self.nodes)


def aligned(result: Flattening, size: float, sharp_angle: float = SHARP_ANGLE) -> GridLayout:
    """Return the layout of a flattening, rotated so that the grid is aligned with creases and boundaries.

    Charts are joined at some seams, and a cone of each component is at the origin.

    Args:
        result: a flattening with quantised cones.
        size: edge length of a square in model units.
        sharp_angle: dihedral angle of edges that are creases, radians.

    Raises:
        GridError: triangles are flipped.
        SeamError: the sides of a seam are not congruent.
    """
    mesh = TriangleMesh(result.vertices, result.faces)
    largest = float(np.abs(result.vertices).max())
    if not 1e-60 < largest < 1e60:
        raise GridError(f"the largest coordinate is {largest:.3g}, out of range for quads: scale the mesh")
    side_lengths = edge_lengths(mesh.vertices, mesh.faces) if result.lengths is None else result.lengths
    lengths, _ = mollify(side_lengths, mesh)
    flat, bad = signed_double_areas(result.corner_uv), int((~has_area(result)).sum())
    if bad:
        raise GridError(f"{bad} of {len(flat):,} triangles of the layout are flipped or have no area")
    area = float(double_areas(lengths).sum()) / 2
    scale = np.sqrt(area / size**2 / (flat.sum() / 2))
    points = scale * as_complex(result.uv)
    cones = np.setdiff1d(result.cones, np.flatnonzero(mesh.is_boundary_vertex))
    apart = GridLayout(mesh, lengths, result.uv_faces, points, cones, Sides(), size)
    layout, component = joined_charts(apart)
    is_straight, angles = _side_angles(layout, component)
    angles = np.where(is_straight, angles, _preferred_angles(layout, component, sharp_angle))
    layout = replace(layout, points=layout.points * np.exp(-1j * angles)[component])
    return at_origin(replace(layout, sides=find_sides(layout, is_straight[component])), component)


def has_area(result: Flattening) -> BoolArray:
    """Return (m,) whether triangles of a flattening have an area and are not flipped."""
    flat, sides = signed_double_areas(result.corner_uv), np.abs(sides_between(result.corner_uv))
    return flat > GRID_TOLERANCE**2 * sides.max(axis=1) ** 2


def joined_charts(layout: GridLayout) -> tuple[GridLayout, IntArray]:
    """Return a layout with the charts of each component joined, and (u,) the component of each point.

    The motion across each of the chains that `joining_chains` returns becomes the identity.
    """
    chains, points = layout.chains(), layout.points.copy()
    chart, component = charts_of(layout, chains)
    _, firsts = np.unique(chains.chain, return_index=True)
    done = mask_of(int(chart.max(initial=-1)) + 1, chart[np.unique(component, return_index=True)[1]])
    left_over = deque(firsts[joining_chains(chains, chart)].tolist())
    while left_over:
        k = left_over.popleft()
        still, moving = chains.left[k], chains.right[k]
        if done[chart[moving[0]]]:
            still, moving = moving, still
        if not done[chart[still[0]]]:
            left_over.append(k)  # until the chart on one of its sides is in place
            continue
        factor = np.diff(points[still])[0] / np.diff(points[moving])[0]
        with_it = chart == chart[moving[0]]
        points[with_it] = factor / abs(factor) * (points[with_it] - points[moving[0]]) + points[still[0]]
        done[chart[moving[0]]] = True
    return replace(layout, points=points), component


def at_origin(layout: GridLayout, component: IntArray) -> GridLayout:
    """Return a layout with the first cone or corner of each component, or the first point on a side, at the origin."""
    at = np.concatenate([first_points(layout.vertex)[layout.nodes], layout.sides.points])[::-1]
    origins = np.zeros(int(component.max(initial=-1)) + 1, dtype=np.complex128)
    origins[component[at]] = layout.points[at]  # in reverse order, so that the first point is written last
    return replace(layout, points=layout.points - origins[component])


def _preferred_angles(layout: GridLayout, component: IntArray, sharp_angle: float) -> FloatArray:
    """Return (c,) the rotation of each component up to quarter turns at which it follows preferred directions best."""
    mesh, (starts, ends) = layout.mesh, layout.ends
    preferred = preferred_directions(mesh, sharp_angle).combined
    # A triangle rotates as its half-edges do on average.
    directions_before = layout.lengths.ravel() * np.exp(1j * halfedge_angles(corner_angles(layout.lengths)))
    turned = (
        ((layout.points[ends] - layout.points[starts]) * directions_before.conj()).reshape(-1, 3).sum(axis=1)
    )
    return _directions(
        np.abs(preferred), turned * np.exp(0.25j * np.angle(preferred)), component, component[starts[::3]]
    )


def _side_angles(layout: GridLayout, component: IntArray) -> tuple[BoolArray, FloatArray]:
    """Return (c,) whether the boundary of each component consists of sides at right angles, and (c,) their direction.

    component: (u,) the component of each point.
    """
    starts, ends = (points[layout.border] for points in layout.ends)
    vector, label = layout.points[ends] - layout.points[starts], component[starts]
    angles = _directions(np.abs(vector), vector, component, label)
    off = np.zeros(len(angles))
    np.maximum.at(off, label, np.abs(np.angle((vector * np.exp(-1j * angles[label])) ** 4) / 4))
    return (np.bincount(label, minlength=len(angles)) > 0) & (off <= GRID_TOLERANCE), angles


def _directions(
    weights: FloatArray, vectors: ComplexArray, component: IntArray, label: IntArray
) -> FloatArray:
    """Return (c,) the mean direction of weighted vectors up to quarter turns; `label` is the component of each."""
    fourth = weights * (vectors / np.abs(vectors)) ** 4
    return np.angle(complex_sums(label, fourth, int(component.max(initial=-1)) + 1)) / 4


def find_sides(layout: GridLayout, is_straight: BoolArray) -> Sides:
    """Return the straight sides of a layout, along the axes; `is_straight` (u,) marks points of such components."""
    mesh, points, border = layout.mesh, layout.points, layout.border
    starts, ends = (points_of[border] for points_of in layout.ends)
    on_straight = is_straight[starts]
    border, starts, ends = border[on_straight], starts[on_straight], ends[on_straight]
    if not len(border):
        return Sides()
    quarter = np.rint(np.angle(points[ends] - points[starts]) / (np.pi / 2)).astype(np.int64) % 4
    leaving = np.full(len(points), -1)
    leaving[starts] = np.arange(len(border))
    after = leaving[ends]
    goes_on = (after >= 0) & (quarter[after] == quarter)
    count, side = label_components(len(border), np.flatnonzero(goes_on), after[goes_on])
    axis = np.zeros(count, dtype=np.int64)
    axis[side] = 1 - quarter % 2
    incidences = np.unique(np.stack([np.concatenate([starts, ends]), np.tile(side, 2)], axis=1), axis=0)
    z = points[layout.corners]
    quarters = quarters_around(mesh, z[:, PREVIOUS] - z[:, NEXT])
    at = np.unique(np.concatenate([mesh.tails[border], mesh.heads[border]]))
    return Sides(at[quarters[at] != 2], incidences[:, 0], incidences[:, 1], axis)


def quarters_around(mesh: TriangleMesh, sides: ComplexArray) -> IntArray:
    """Return (n,) the angle around each vertex in quarter turns, rounded; `sides` (m, 3) are those in the plane."""
    angles = signed_angles(sides)
    sums = np.bincount(mesh.faces.ravel(), angles.ravel(), len(mesh.vertices))
    return np.rint(sums / (np.pi / 2)).astype(np.int64)


def charts_of(layout: GridLayout, chains: SeamChains) -> tuple[IntArray, IntArray]:
    """Return (u,) the chart of each point, and (u,) its component."""
    count = len(layout.points)
    charts, chart = label_faces(layout.corners, count)
    of_point = np.zeros(count, dtype=np.int64)
    of_point[layout.corners.ravel()] = chart.repeat(3)
    _, component = label_components(charts, of_point[chains.left[:, 0]], of_point[chains.right[:, 0]])
    return of_point, component[of_point]


def joining_chains(chains: SeamChains, chart: IntArray) -> IntArray:
    """Return the chains of a spanning forest of the charts, connected by seams; `chart` (u,) is that of each point."""
    _, firsts = np.unique(chains.chain, return_index=True)
    ends = chart[np.stack([chains.left[firsts, 0], chains.right[firsts, 0]], axis=1)]
    # Of edges of equal cost, a minimum spanning forest has the first ones.
    return MultiGraph(int(chart.max(initial=-1)) + 1, ends, np.zeros(len(ends))).minimum_spanning_tree()


def first_points(vertex: IntArray) -> IntArray:
    """Return (n,) the first point of each vertex; `vertex` (u,) is the vertex of each point."""
    first = np.zeros(int(vertex.max(initial=-1)) + 1, dtype=np.int64)
    first[vertex[::-1]] = np.arange(len(vertex))[::-1]
    return first


def split_edges(layout: GridLayout, is_split: BoolArray) -> GridLayout:
    """Return a layout of the same surface with the edges `is_split` (e,) split at their midpoints."""
    points = layout.points
    mesh, origin, piece = split_longest(layout.mesh, is_split, layout.lengths)
    middles, pairs = _middle_points(layout, is_split)
    six = np.concatenate([layout.corners, middles], axis=1)
    corners, places = (
        np.take_along_axis(six_of[origin], piece, axis=1) for six_of in (six, _six_places(layout.lengths))
    )
    lengths: FloatArray = np.abs(places[:, PREVIOUS] - places[:, NEXT])
    points = np.concatenate([points, points[pairs].mean(axis=1)])
    # The order of edges along the seams changes, so charts may be joined at other chains.
    split, component = joined_charts(
        replace(layout, mesh=mesh, lengths=lengths, corners=corners, points=points)
    )
    # Components whose boundary has straight sides still have them.
    sides = find_sides(split, np.isin(component, component[layout.sides.points]))
    return at_origin(replace(split, sides=sides), component)


def _middle_points(layout: GridLayout, is_split: BoolArray) -> tuple[IntArray, IntArray]:
    """Return (m, 3) the midpoints of split sides, numbered after the points, and (k, 2) the end points of the sides."""
    sides = np.flatnonzero(is_split[layout.mesh.halfedge_edges])
    ends = np.sort(np.stack(layout.ends, axis=1)[sides], axis=1)
    pairs, index = np.unique(ends, axis=0, return_inverse=True)
    middles = np.full(layout.corners.size, -1)
    middles[sides] = len(layout.points) + index.ravel()
    return middles.reshape(-1, 3), pairs


def _six_places(lengths: FloatArray) -> ComplexArray:
    """Return (m, 6) the corners of triangles with given side lengths in the plane, and the midpoints of their sides."""
    sides = rest_sides(lengths)
    places = np.stack([np.zeros(len(sides)), sides[:, 2], -sides[:, 1]], axis=1)
    middles = (places[:, NEXT] + places[:, PREVIOUS]) / 2
    return np.concatenate([places, middles], axis=1)
