"""What restricts the motions of a layout's points: seams, as chains with a rigid motion each, and constraints."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..base.text import plural
from ..errors import OptionError, SeamError
from ..mesh.charts import both_sides, point_seams, point_vertices
from ..mesh.connectivity import TriangleMesh, label_components

# Largest change, in radians, of the rotation of a seam at a vertex that is not a cone. Cones have curvatures of at
# least 1e-4; the shortest edge lengths in the plane are accurate to 1e-9.
ROTATION_TOLERANCE = 1e-5
# Largest difference of the two lengths of a seam edge, relative to its length.
RIGID_TOLERANCE = 1e-4


@dataclass(frozen=True, eq=False)
class Lines:
    """Points that are constrained to lines.

    Attributes:
        points: (q,) point indices; a point on two lines is listed twice.
        line: (q,) the line of each point, from 0.
        directions: (l, 2) directions of the lines, of any length.
        offsets: (l,) position of each line: the dot product of its points with its unit normal, which is the direction
            rotated to the left by a quarter turn. NaN for a line that may move sideways. None: every line passes
            through its first point.
    """

    points: ArrayLike
    line: ArrayLike
    directions: ArrayLike
    offsets: ArrayLike | None = None


@dataclass(frozen=True, eq=False)
class PointConstraints:
    """Constraints on points; they need not hold at the start, but hold after relaxation.

    Attributes:
        pinned: (p,) indices of pinned points.
        places: (p, 2) final positions of the pinned points; None for their current positions.
        lines: points on lines; None for none.
        tied: (q,) half-edges of seams with prescribed translations.
        translations: (q, 2) the final translation of each tied half-edge: a point in the frame of its own triangle is
            the corresponding point in the frame of the opposite triangle, rotated by the seam's rotation, plus this.
        stride: largest fraction of the distance to the constraints per step; where lines turn, long steps fold them.
    """

    pinned: ArrayLike = ()
    places: ArrayLike | None = None
    lines: Lines | None = None
    tied: ArrayLike = ()
    translations: ArrayLike = ()
    stride: float = 1.0


@dataclass(frozen=True, eq=False)
class CheckedConstraints:
    """Validated constraints as arrays, with places and offsets filled in, and with unit directions."""

    pinned: IntArray
    places: FloatArray
    on_line: IntArray
    line: IntArray
    directions: FloatArray
    offsets: FloatArray
    tied: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    translations: FloatArray = field(default_factory=lambda: np.empty((0, 2)))


@dataclass(frozen=True, eq=False)
class SeamChains:
    """The seams of a layout, as k edges in c chains.

    Attributes:
        edges: (k,) edge indices in the mesh.
        vertices: (k, 2) the two end vertices of each edge.
        left, right: (k, 2) the points at its ends on the left and on the right side.
        halfedges: (k, 2) the half-edges of the triangles on the left and on the right side.
        chain: (k,) the chain of each edge.
        rotation: (c,) unit complex numbers that rotate the left side of a chain parallel to the right side.
        is_node: (n,) True for vertices where chains end: cones, branch points, boundary vertices, and requested nodes.
    """

    edges: IntArray
    vertices: IntArray
    left: IntArray
    right: IntArray
    halfedges: IntArray
    chain: IntArray
    rotation: ComplexArray
    is_node: BoolArray


@dataclass(frozen=True, eq=False)
class Restrictions:
    """What restricts the motions of points.

    Attributes:
        vertex: (u,) the vertex of each point.
        is_free: (u,) True for points that may move; the translation of a seam that contains others is fixed.
        chains: the seams, across which rotations are preserved.
        constraints: further constraints.
    """

    vertex: IntArray
    is_free: BoolArray
    chains: SeamChains
    constraints: CheckedConstraints


def find_restrictions(
    mesh: TriangleMesh,
    corners: IntArray,
    points: ComplexArray,
    is_free: BoolArray,
    constraints: CheckedConstraints,
) -> Restrictions:
    """Return what restricts the motions of a layout's points.

    Args:
        mesh: the mesh.
        corners: (m, 3) the point at each triangle corner.
        points: (u,) positions in the plane as complex numbers.
        is_free: (n,) True for vertices that may move.
        constraints: constraints on points.

    Raises:
        SeamError: the sides of a seam are not rigid copies of each other.
    """
    vertex = point_vertices(mesh.faces, corners, len(points))
    chains = constrained_chains(mesh, corners, points, vertex, constraints)
    return Restrictions(vertex, is_free[vertex], chains, constraints)


def constrained_chains(
    mesh: TriangleMesh, corners: IntArray, points: ComplexArray, vertex: IntArray, c: CheckedConstraints
) -> SeamChains:
    """Return the seams, with nodes at constrained points.

    A point on a single line needs no node if it is a left point within a seam.
    """
    if not len(c.on_line):
        return find_chains(mesh, corners, points, vertex[c.pinned])
    on, times = np.unique(c.on_line, return_counts=True)
    nodes = np.concatenate([vertex[c.pinned], vertex[on[times > 1]]])
    chains = find_chains(mesh, corners, points, nodes)
    inside = ~chains.is_node[chains.vertices]
    if not np.isin(on, chains.right[inside]).any():
        return chains
    return find_chains(mesh, corners, points, np.concatenate([nodes, vertex[on]]))


def find_chains(
    mesh: TriangleMesh,
    corners: IntArray,
    points: ComplexArray,
    nodes: IntArray,
) -> SeamChains:
    """Return the chains of the edges whose sides have different points.

    Args:
        mesh: the mesh.
        corners: (m, 3) the point at each triangle corner.
        points: (u,) positions in the plane as complex numbers.
        nodes: additional vertices at which chains end.

    Raises:
        SeamError: the sides of a seam are not rigid copies of each other.
    """
    edges = point_seams(mesh, corners)
    h, t = mesh.edge_halfedges[edges].T
    vertices = np.stack(mesh.ends_of(h), axis=1)
    sides = np.stack(both_sides(mesh, edges, corners))
    first_vectors, second_vectors = (points[side[:, 1]] - points[side[:, 0]] for side in sides)
    _check_rigid(edges, vertices, first_vectors, second_vectors)
    turns = second_vectors * np.conj(first_vectors)
    turns /= np.abs(turns)
    is_node = np.bincount(vertices.ravel(), minlength=len(mesh.vertices)) != 2
    is_node |= mesh.is_boundary_vertex
    is_node[nodes] = True
    is_node[_rotating(vertices, sides, turns, is_node)] = True
    first, second = _strands(vertices, sides, is_node)
    swapped = second < first
    left = np.where(swapped[:, None], sides[1], sides[0])
    right = np.where(swapped[:, None], sides[0], sides[1])
    halfedges = np.where(swapped[:, None], np.stack([t, h], axis=1), np.stack([h, t], axis=1))
    _, chain = np.unique(np.minimum(first, second), return_inverse=True)
    chain = chain.ravel()
    total = np.zeros(int(chain.max(initial=-1)) + 1, dtype=np.complex128)
    np.add.at(
        total,
        chain,
        np.where(swapped, second_vectors * np.conj(first_vectors), 0).conj()
        + np.where(swapped, 0, second_vectors * np.conj(first_vectors)),
    )
    return SeamChains(edges, vertices, left, right, halfedges, chain, total / np.abs(total), is_node)


def _strands(vertices: IntArray, sides: IntArray, is_node: BoolArray) -> tuple[IntArray, IntArray]:
    """Return (k,), (k,) the strands of each edge's first and second side: sides connected at vertices without node."""
    count = len(vertices)
    # First sides are numbered from 0, second sides from `count`.
    point = sides.reshape(-1, 2).ravel()
    side = np.arange(2 * count).repeat(2)
    regular = ~is_node[np.concatenate([vertices, vertices]).ravel()]
    point, side = point[regular], side[regular]
    order = np.argsort(point, kind="stable")
    point, side = point[order], side[order]
    meet = np.flatnonzero(point[1:] == point[:-1])
    _, label = label_components(2 * count, side[meet], side[meet + 1])
    return label[:count], label[count:]


def _rotating(vertices: IntArray, sides: IntArray, turns: ComplexArray, is_node: BoolArray) -> IntArray:
    """Return the vertices between two seam edges at which the rotation changes."""
    ends = vertices.ravel()
    edge = np.arange(len(vertices)).repeat(2)
    is_inner = ~is_node[ends]
    ends, edge, point = ends[is_inner], edge[is_inner], sides[0].ravel()[is_inner]
    order = np.argsort(ends, kind="stable").reshape(-1, 2)
    edge, point = edge[order], point[order]
    # The first sides of both edges are on the same side of the seam if they share a point.
    next_turns = np.where(point[:, 0] == point[:, 1], turns[edge[:, 1]], np.conj(turns[edge[:, 1]]))
    return ends[order[np.abs(next_turns - turns[edge[:, 0]]) > ROTATION_TOLERANCE, 0]]


def _check_rigid(
    edges: IntArray, vertices: IntArray, first_vectors: ComplexArray, second_vectors: ComplexArray
) -> None:
    lengths: FloatArray = np.abs(first_vectors)
    if not (lengths > 0).all():
        raise SeamError(f"{int((~(lengths > 0)).sum())} seam edges have no length in the plane")
    off = np.abs(np.abs(second_vectors) / lengths - 1)
    if (off > RIGID_TOLERANCE).any():
        worst = int(off.argmax())
        pair = "-".join(str(v) for v in vertices[worst].tolist())
        raise SeamError(
            f"the sides of {int((off > RIGID_TOLERANCE).sum())} of {len(edges)} seam edges are not copies of each "
            f"other: those of edge {pair} differ by {off[worst]:.2g} of their length"
        )


def check_constraints(constraints: PointConstraints, points: FloatArray) -> CheckedConstraints:
    """Return validated constraints on (u, 2) points.

    Raises:
        OptionError: shapes do not match, indices are out of range, or numbers are not finite.
    """
    pinned = _indices(constraints.pinned, len(points), "pinned")
    if len(np.unique(pinned)) < len(pinned):
        raise OptionError(f"pinned has {plural(len(pinned) - len(np.unique(pinned)), 'point')} twice")
    places = points[pinned] if constraints.places is None else _floats(constraints.places, "places")
    if places.shape != (len(pinned), 2):
        raise OptionError(
            f"places must have shape {(len(pinned), 2)}, one for each pinned point, got {places.shape}"
        )
    tied = np.asarray(constraints.tied, dtype=np.int64).ravel()
    translations = _floats(constraints.translations, "translations").reshape(-1, 2)
    if len(tied) != len(translations):
        raise OptionError(
            f"{plural(len(tied), 'half-edge')} tied, but {plural(len(translations), 'translation')} given for them"
        )
    on_line, line, directions, offsets = _checked_lines(constraints.lines, points)
    return CheckedConstraints(pinned, places, on_line, line, directions, offsets, tied, translations)


def _checked_lines(
    lines: Lines | None, points: FloatArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return the points on lines, the line of each, unit directions and offsets, as in `CheckedConstraints`."""
    if lines is None:
        none = np.empty(0, dtype=np.int64)
        return none, none, np.empty((0, 2)), np.empty(0)
    on_line = _indices(lines.points, len(points), "points of lines")
    directions = _floats(lines.directions, "directions of lines").reshape(-1, 2)
    line = _indices(lines.line, len(directions), "line")
    if len(line) != len(on_line):
        raise OptionError(
            f"{plural(len(on_line), 'point')} of lines, but {plural(len(line), 'line')} given for them"
        )
    size = np.hypot(*directions.T)
    if not (size > 0).all():
        raise OptionError(f"{plural(int((size == 0).sum()), 'line')} with the direction (0, 0)")
    directions = directions / size[:, None]
    if lines.offsets is None:
        offsets = np.full(len(directions), np.nan)
        first, at = np.unique(line, return_index=True)
        offsets[first] = _across(directions[first], points[on_line[at]])
    else:
        offsets = np.asarray(lines.offsets, dtype=np.float64)
        if offsets.shape != (len(directions),) or np.isinf(offsets).any():
            raise OptionError(
                f"offsets of lines must be {plural(len(directions), 'number')}, or NaN, got shape {offsets.shape}"
            )
    return on_line, line, directions, offsets


def _across(directions: FloatArray, places: FloatArray) -> FloatArray:
    return directions[:, 0] * places[:, 1] - directions[:, 1] * places[:, 0]


def _indices(value: ArrayLike, count: int, name: str) -> IntArray:
    indices: Any = np.asarray(value)
    if indices.size == 0:
        return np.empty(0, dtype=np.int64)
    if indices.ndim != 1 or indices.dtype.kind not in "iu":
        raise OptionError(f"{name} must be a list of indices, got {indices.dtype} of shape {indices.shape}")
    if indices.min() < 0 or indices.max() >= count:
        raise OptionError(
            f"{name} must be below {count}, got indices from {indices.min()} to {indices.max()}"
        )
    return indices.astype(np.int64)


def _floats(value: ArrayLike, name: str) -> FloatArray:
    numbers = np.asarray(value, dtype=np.float64)
    if not np.isfinite(numbers).all():
        raise OptionError(
            f"{name} must be finite: {plural(int((~np.isfinite(numbers)).sum()), 'number')} not"
        )
    return numbers
