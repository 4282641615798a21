"""Layouts in units of a grid: their sides, charts and nodes."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import csr_matrix

from ..base import BoolArray, ComplexArray, FloatArray, IntArray, mask_of
from ..geometry import (
    as_pairs,
    quarters_around,
    signed_double_areas,
)
from ..linalg import MultiGraph
from ..mesh import NEXT, PREVIOUS, label_components, label_faces, point_vertices
from ..mesh.connectivity import TriangleMesh
from ..optimise import SeamChains, find_chains


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
    """

    mesh: TriangleMesh
    lengths: FloatArray
    corners: IntArray
    points: ComplexArray
    cones: IntArray
    sides: Sides
    size: float

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


def with_sides(layout: GridLayout) -> GridLayout:
    """Return a layout with all sides of its boundary on lines, along the nearest axes."""
    return replace(layout, sides=find_sides(layout, np.ones(len(layout.points), dtype=bool)))


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
