"""The straight sides of a chart: parts of its border between corners, as an artist expects them to be straight.

On hard surfaces, seams run along sharp edges and straight chains of edges. Distortion bends them a little in the plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..atlas import border_curves
from ..base import BoolArray, ComplexArray, FloatArray, IntArray
from ..geometry import as_complex, as_pairs, corner_angles
from ..mesh.connectivity import TriangleMesh
from ..optimise import Lines
from ..stages import Layout

# A border has a corner where it turns by more than this on the surface, in radians.
CORNER = np.radians(10)
# Smallest length of a side, relative to the border of its chart, and of all straight sides together.
MIN_SIDE, MIN_SHARE = 0.05, 0.25
# Largest distance of a chain of edges from the line between its ends, relative to its length, on the surface and in
# the plane.
MAX_STRAY, MAX_BEND = 0.01, 0.1
# Sides whose directions differ by less than this, modulo quarter turns, become parallel or perpendicular; radians.
SAME_DIRECTION = np.radians(10)
# Sides of a strip turn at its corners by a right angle up to this, in radians, and bend by less than this fraction.
MAX_OFF_SQUARE, MAX_STRIP_BEND = np.radians(35), 0.1


@dataclass(frozen=True, eq=False)
class Side:
    """A part of a chart's border between two corners.

    Attributes:
        points: (k,) its points, in order.
        vector: from its first point to its last one, in the plane.
        bend: largest distance of its points from the line between its ends, relative to its length.
        is_hard: whether it follows a straight chain of edges or sharp edges.
    """

    points: IntArray
    vector: complex
    bend: float
    is_hard: bool


@dataclass(frozen=True, eq=False)
class Border:
    """The border of a chart.

    Attributes:
        length: its length.
        is_rectangle: whether it is one curve with four corners that are nearly right angles, and nearly straight sides.
        sides: its long sides; the sides of a rectangle are in order.
    """

    length: float
    is_rectangle: bool
    sides: list[Side]

    @property
    def bend(self) -> float:
        """The largest bend of its sides."""
        return max((side.bend for side in self.sides), default=0.0)


def find_border(layout: Layout, chart: Layout, faces: IntArray, is_sharp: BoolArray) -> Border:
    """Return the border of a chart with its long sides.

    Args:
        layout: a layout.
        chart: one of its charts, on a mesh of its own, see `as_one_chart`.
        faces: (k,) its triangles.
        is_sharp: (e,) whether the edges of the layout's mesh are sharp.
    """
    halfedges, ends, first = _ordered_border(chart.mesh)
    angles = np.bincount(chart.mesh.faces.ravel(), corner_angles(chart.lengths).ravel(), len(chart.points))
    turns = (np.pi - angles[ends[:, 0]]).astype(np.float64)
    places = as_complex(chart.points)
    chains = list[IntArray]()
    for begin, end in zip(first[:-1].tolist(), first[1:].tolist(), strict=True):
        chains += _chains(np.arange(begin, end), turns, bool(ends[begin, 0] == ends[end - 1, 1]))
    is_rectangle = len(chains) == 4 and len(first) == 2 and _is_square(turns, chains)
    lengths = np.abs(places[ends[:, 1]] - places[ends[:, 0]])
    border = float(lengths.sum())
    if not is_rectangle:
        chains = [chain for chain in chains if len(chain) > 1 and lengths[chain].sum() >= MIN_SIDE * border]
    mesh, on_mesh = layout.mesh, 3 * faces[halfedges // 3] + halfedges % 3
    starts, heads = mesh.ends_of(on_mesh)
    is_border_sharp = is_sharp[mesh.halfedge_edges[on_mesh]]
    edges = _SurfaceEdges(mesh.vertices[starts], mesh.vertices[heads], turns, is_border_sharp)
    sides = [_side(chain, np.append(ends[chain, 0], ends[chain[-1], 1]), places, edges) for chain in chains]
    return Border(border, is_rectangle and all(side.bend < MAX_STRIP_BEND for side in sides), sides)


def _ordered_border(mesh: TriangleMesh) -> tuple[IntArray, IntArray, IntArray]:
    """Return (b,) the half-edges of the border of a mesh in order, (b, 2) their ends, and where each curve begins."""
    halfedges = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    ends = np.stack(mesh.ends_of(halfedges), axis=1)
    order, first = border_curves(ends, len(mesh.vertices))
    return halfedges[order], ends[order], first


def _chains(curve: IntArray, turns: FloatArray, is_closed: bool) -> list[IntArray]:
    """Return the chains of a curve between its corners, of which a closed one may have none.

    Args:
        curve: (k,) its border edges in order.
        turns: (b,) the turn on the surface at the start of each border edge.
        is_closed: whether it ends where it begins.
    """
    at = np.flatnonzero(np.abs(turns[curve]) > CORNER)
    if not is_closed:
        return np.split(curve, at[at > 0])
    return np.split(np.roll(curve, -at[0]), at[1:] - at[0]) if len(at) else []


def _is_square(turns: FloatArray, chains: list[IntArray]) -> bool:
    """Return whether all chains start with a turn to the left by about a right angle."""
    at_corners = np.array([turns[chain[0]] for chain in chains])
    return bool((np.abs(at_corners - np.pi / 2) < MAX_OFF_SQUARE).all())


def _side(chain: IntArray, points: IntArray, places: ComplexArray, edges: _SurfaceEdges) -> Side:
    """Return the side that consists of a chain (k,) of border edges with points (k + 1,)."""
    curve = places[points]
    return Side(points, complex(curve[-1] - curve[0]), _bend(curve), edges.is_hard(chain))


def _bend(curve: ComplexArray) -> float:
    """Return the largest distance of points (k,) from the line between the ends, relative to its length."""
    along = curve - curve[0]
    across = np.abs((along * np.conj(along[-1])).imag).max()
    return float(across) / max(abs(complex(along[-1])) ** 2, 1e-300)


@dataclass(frozen=True, eq=False)
class _SurfaceEdges:
    """The border edges of a chart on the surface.

    Attributes:
        starts, ends: (b, 3) their ends.
        turns: (b,) the turn of the border at their starts, radians: what its angle on the surface lacks to pi.
        is_sharp: (b,) whether they are sharp.
    """

    starts: FloatArray
    ends: FloatArray
    turns: FloatArray
    is_sharp: BoolArray

    def is_hard(self, chain: IntArray) -> bool:
        """Return whether a chain of border edges (k,) is straight, or sharp and straight on the surface."""
        return self._is_straight(chain) or (bool(self.is_sharp[chain].all()) and self._is_geodesic(chain))

    def _is_geodesic(self, chain: IntArray) -> bool:
        """Return whether a chain of border edges (k,) is straight if the surface along it is laid into the plane."""
        lengths = np.linalg.norm(self.ends[chain] - self.starts[chain], axis=1)
        steps = lengths * np.exp(1j * np.append(0.0, np.cumsum(self.turns[chain[1:]])))
        return _bend(np.append(0.0, np.cumsum(steps))) <= MAX_STRAY

    def _is_straight(self, chain: IntArray) -> bool:
        """Return whether a chain of border edges (k,) is straight."""
        offsets = np.append(self.starts[chain], self.ends[chain[-1:]], axis=0) - self.starts[chain[0]]
        length = float(np.linalg.norm(offsets[-1]))
        strays = np.linalg.norm(np.cross(offsets, offsets[-1]), axis=1)
        return length > 0 and bool((strays <= MAX_STRAY * length * length).all())


@dataclass(frozen=True, eq=False)
class StraightSides:
    """Sides that become straight.

    Attributes:
        sides: the s sides.
        directions: (s,) the direction of each, a unit vector.
    """

    sides: list[Side]
    directions: ComplexArray

    @property
    def lines(self) -> Lines:
        """The lines of the sides, which may move sideways."""
        line = np.arange(len(self.sides)).repeat([len(side.points) for side in self.sides])
        points = np.concatenate([side.points for side in self.sides])
        return Lines(points, line, as_pairs(self.directions), np.full(len(self.sides), np.nan))

    def largest_stray(self, points: FloatArray) -> float:
        """Return the largest distance between points (c, 2) of a side across its direction, relative to its length."""
        places, strays = as_complex(points), [0.0]
        for side, direction in zip(self.sides, self.directions.tolist(), strict=True):
            along = places[side.points] * direction.conjugate()
            strays.append(float(np.ptp(along.imag) / max(np.ptp(along.real), np.finfo(float).tiny)))
        return max(strays)


def rectangle_sides(border: Border) -> StraightSides:
    """Return the four sides of a border that becomes a rectangle."""
    turned = [side.vector * (-1j) ** k for k, side in enumerate(border.sides)]
    first = np.exp(1j * np.angle(sum(turned)))
    return StraightSides(border.sides, np.array([first * 1j**k for k in range(4)]))


def hard_sides(border: Border) -> list[Side]:
    """Return the hard sides that are nearly straight in the plane; none if they are a small part of the border."""
    sides = [side for side in border.sides if side.is_hard and side.bend < MAX_BEND]
    return sides if sum(abs(side.vector) for side in sides) >= MIN_SHARE * border.length else []


def parallel_sides(sides: list[Side]) -> StraightSides:
    """Return sides, of which those that are nearly parallel or perpendicular to most others are exactly so."""
    vectors = np.array([side.vector for side in sides])
    fourth, lengths = (vectors / np.abs(vectors)) ** 4, np.abs(vectors)
    is_alike = np.abs(np.angle(fourth[:, None] / fourth)) / 4 < SAME_DIRECTION
    is_parallel = is_alike[(is_alike @ lengths).argmax()]
    main = np.exp(0.25j * np.angle((lengths * fourth)[is_parallel].sum()))
    quarters = np.round(np.angle(vectors / main) / (np.pi / 2))
    return StraightSides(sides, np.where(is_parallel, main * 1j**quarters, vectors / lengths))
