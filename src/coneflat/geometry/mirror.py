"""Planes of mirror symmetry of a mesh, exact or nearly so."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray, dots
from ..mesh import TriangleMesh, end_corners
from .operators import vertex_areas
from .ties import own_axes, tie_key

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Points of a surface by which planes are compared; more only tell the same.
SAMPLES = 800
# Steps of fitting a plane to points and the points nearest to their mirror images; most come to rest after ten.
FIRST_STEPS, STEPS, FINISH = 4, 20, 6
# Relative to the size: planes are the same, and a fit is at rest, within so much.
SAME = 1e-6
# Farthest vertices, and how many of them on either end, that are taken for images of each other.
FARTHEST, RIVALS = 1e-3, 6
# Of the shortest edge around: how far the image of a vertex may be from the vertex that it is the image of.
# Nearly all are as near as that, and none is farther than this.
PAIRED, HARDLY, MOSTLY = 0.05, 0.45, 0.95
# Candidates that are fitted, the best before.
FITTED, FINISHED = 6, 3
# Roots of the largest area of a vertex by which an image may be farther from the next vertex than from the surface.
NEAR_VERTEX = 3.0
# Cosine of the angle by which a plane may be off the normal that was given, 10 degrees.
NEARLY = float(np.cos(np.radians(10)))
# Of the area off a plane of symmetry, what is on either side at least: a flat surface lies in its own plane.
HALF = 0.3


@dataclass(frozen=True, eq=False)
class Mirror:
    """A plane of mirror symmetry of a mesh, x with normal . x = offset.

    Attributes:
        normal: (3,) unit vector; it points to the left side.
        offset: the plane's distance from the origin, model units.
        height: (n,) distance of each vertex from the plane, negative on the right, over the square root of the area.
        partner: (n,) the vertex nearest to the mirror image of each.
        face_partner: (m,) the mirror image of each face where the mesh, not its shape alone, is symmetric; else None.
        is_paired: whether vertices are images of each other, two and two or on the plane, though edges may not be.
        deviation: how far the surface is from symmetric: the root mean square of the distance of mirrored vertices
            from it, over the square root of its area.
    """

    normal: FloatArray
    offset: float
    height: FloatArray
    partner: IntArray
    face_partner: IntArray | None
    is_paired: bool
    deviation: float

    @property
    def is_exact(self) -> bool:
        """Whether every face has a mirror image."""
        return self.face_partner is not None

    @property
    def own(self) -> BoolArray:
        """(n,) the vertices that are their own images."""
        return self.partner == np.arange(len(self.partner))


def find_mirror(
    mesh: TriangleMesh, lengths: FloatArray, tolerance: float, normal: FloatArray | None = None
) -> Mirror | None:
    """Return the plane about which a surface is symmetric, None if there is none.

    Candidates are the principal planes, and those between the vertices farthest from the centre. Each is fitted to
    points and what is nearest to their mirror images (iterated closest points), and the best is taken; of equally good
    ones, that which cuts the surface along the shortest curve.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, with which every triangle has area.
        tolerance: the largest deviation, as a share of the square root of the area; see `Mirror`.
        normal: (3,) of the plane, where that is known to some degrees.
    """
    from scipy.spatial import cKDTree

    areas = vertex_areas(mesh.faces, lengths, len(mesh.vertices))
    share, size = areas / areas.sum(), float(np.sqrt(areas.sum()))
    centre = share @ mesh.vertices
    points = (mesh.vertices - centre) / size
    tree = cKDTree(points)
    some = _sample(points)
    weights = share[some] / share[some].sum()
    given = [normal] if normal is not None else list(_candidates(points, share))
    normals = np.array(given) / np.linalg.norm(given, axis=1)[:, None]
    rough = [(_from_vertices(points, tree, some, weights, n, 0.0), (n, 0.0)) for n in normals]
    # Most candidates are soon seen to lead nowhere.
    for steps, kept in ((FIRST_STEPS, FITTED), (STEPS, FINISHED)):
        rough = sorted(rough, key=lambda each: each[0])[:kept]
        planes = [_fit(points, tree, some, weights, plane[0], steps, plane[1]) for _, plane in rough]
        rough = [(_from_vertices(points, tree, some, weights, *plane), plane) for plane in planes]
    longest = float(np.sqrt(areas.max()) / size)
    fits = []
    for off, plane in rough:
        if normal is not None and abs(plane[0] @ normals[0]) < NEARLY:
            off, plane = 0.0, (normals[0], 0.0)
        # A surface is nearer than its vertices, but not by more than a few edges.
        if off <= 1.5 * tolerance + NEAR_VERTEX * longest and _has_sides(points, share, *plane):
            fits.append((_deviation(mesh, points, tree, some, weights, *plane), plane))
    best = min((fit[0] for fit in fits), default=np.inf)
    # A sample tells no more than this.
    if not best <= 1.5 * tolerance:
        return None
    equal = [plane for deviation, plane in fits if deviation <= 1.05 * best + SAME]
    plane = min(equal, key=lambda each: round(_section_length(mesh, points, *each), 4))
    every = np.arange(len(points))
    if normal is None or plane[1]:
        plane = _fit(points, tree, every, share, plane[0], FINISH, plane[1])
    deviation = _deviation(mesh, points, tree, every, share, *plane)
    if deviation > tolerance:
        return None
    return _as_mirror(mesh, points, tree, _turned(points, share, *plane), deviation, centre, size)


def _as_mirror(
    mesh: TriangleMesh,
    points: FloatArray,
    tree: cKDTree,
    plane: tuple[FloatArray, float],
    deviation: float,
    centre: FloatArray,
    size: float,
) -> Mirror:
    normal, offset = plane
    distance, partner = tree.query(_mirrored(points, normal, offset))
    own, partner = np.arange(len(partner)), partner.astype(np.int64)
    ends = points[mesh.edges]
    shortest = np.full(len(points), np.inf)
    sides = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    np.minimum.at(shortest, mesh.edges.ravel(), np.repeat(sides, 2))
    is_near = distance <= PAIRED * shortest
    is_paired = (partner[partner] == own).all() and is_near.mean() > MOSTLY
    is_paired = bool(is_paired and (distance <= HARDLY * shortest).all())
    faces = _face_partner(mesh, partner) if is_paired else None
    if is_paired:
        normal, offset = _best_plane(points, points[partner], np.full(len(points), 1 / len(points)))
        if normal @ plane[0] < 0:
            normal, offset = -normal, -offset
    height = points @ normal - offset
    if is_paired:
        height[partner == own] = 0.0
    return Mirror(
        normal, float(offset * size + normal @ centre), height, partner, faces, is_paired, deviation
    )


def _face_partner(mesh: TriangleMesh, partner: IntArray) -> IntArray | None:
    """Return (m,) the mirror image of each face, None if one has none."""
    keys, images = np.sort(mesh.faces, axis=1), np.sort(partner[mesh.faces], axis=1)
    order, ranks = np.lexsort(keys.T[::-1]), np.lexsort(images.T[::-1])
    if not np.array_equal(keys[order], images[ranks]):
        return None
    found = np.empty(len(keys), dtype=np.int64)
    found[ranks] = order
    # A mirror image runs the other way around, or its faces would lie on each other.
    one = mesh.faces[found]
    same = np.stack([(one == partner[np.roll(mesh.faces, k, axis=1)]).all(axis=1) for k in range(3)])
    return None if same.any() else found


def _sample(points: FloatArray) -> IntArray:
    """Return some of the vertices, chosen by their distances from the centre."""
    if len(points) <= SAMPLES:
        return np.arange(len(points))
    order = np.argsort(dots(points, points), kind="stable")
    return order[np.linspace(0, len(order) - 1, SAMPLES).astype(np.int64)]


def _candidates(points: FloatArray, share: FloatArray) -> Iterator[FloatArray]:
    """Yield normals of planes through the centre of which one may be that of a symmetry."""
    yield from np.linalg.eigh((points * share[:, None]).T @ points)[1].T
    yield from own_axes(points)
    radius = np.sqrt(dots(points, points))
    far = np.flatnonzero(radius >= radius.max() * (1 - FARTHEST))
    first = far[np.argmax(tie_key(points)[far])]
    apart = points[far] - points[first]
    distance = np.sqrt(dots(apart, apart))
    order = np.argsort(distance, kind="stable")
    order = order[distance[order] > SAME]
    for i in np.unique(np.concatenate([order[:RIVALS], order[-RIVALS:]])):
        yield apart[i]


def _has_sides(points: FloatArray, share: FloatArray, normal: FloatArray, offset: float) -> bool:
    """Whether there is surface on both sides of a plane."""
    height = points @ normal - offset
    left, right = share[height > SAME].sum(), share[height < -SAME].sum()
    return bool(min(left, right) > HALF * (left + right))


def _mirrored(points: FloatArray, normal: FloatArray, offset: float) -> FloatArray:
    """Return (n, 3) the mirror images of points."""
    return points - 2 * np.outer(points @ normal - offset, normal)


def _rms(values: FloatArray, weights: FloatArray) -> float:
    return float(np.sqrt(weights @ values**2))


def _fit(
    points: FloatArray,
    tree: cKDTree,
    some: IntArray,
    weights: FloatArray,
    normal: FloatArray,
    steps: int,
    offset: float = 0.0,
) -> tuple[FloatArray, float]:
    """Return normal and offset of the plane that mirrors some points best to points near their images."""
    for _ in range(steps):
        nearest = tree.query(_mirrored(points[some], normal, offset))[1]
        fitted = _best_plane(points[some], points[nearest], weights)
        change = 1 - abs(fitted[0] @ normal)
        normal, offset, before = *fitted, offset
        if change < SAME**2 and abs(abs(offset) - abs(before)) < SAME:
            break
    return normal, offset


def _best_plane(points: FloatArray, images: FloatArray, weights: FloatArray) -> tuple[FloatArray, float]:
    """Return normal and offset of the plane by which points are mirrored nearest to images, in the mean square.

    The sum of squares is a constant plus 4 n C n, C the symmetric part of the covariance of points and images.
    """
    centre, other = weights @ points, weights @ images
    covariance = ((points - centre) * weights[:, None]).T @ (images - other)
    normal = np.linalg.eigh(covariance + covariance.T)[1][:, 0]
    return normal, float(normal @ (centre + other) / 2)


def _turned(
    points: FloatArray, share: FloatArray, normal: FloatArray, offset: float
) -> tuple[FloatArray, float]:
    """Return a plane whose normal points to the side that the shape itself, or else the first axis, tells."""
    height = points @ normal - offset
    skew = float(share @ height**3)
    axis = np.argmax(np.abs(normal) > 0.5 * np.abs(normal).max())
    sign = np.sign(skew) if abs(skew) > SAME else np.sign(normal[axis])
    return normal * sign, offset * sign


def _from_vertices(
    points: FloatArray, tree: cKDTree, some: IntArray, weights: FloatArray, normal: FloatArray, offset: float
) -> float:
    """Return the root mean square of the distance of mirrored points from the vertices next to them."""
    return _rms(tree.query(_mirrored(points[some], normal, offset))[0], weights)


def _deviation(
    mesh: TriangleMesh,
    points: FloatArray,
    tree: cKDTree,
    some: IntArray,
    weights: FloatArray,
    normal: FloatArray,
    offset: float,
) -> float:
    """Return the root mean square of the distance of mirrored points from the surface."""
    images = _mirrored(points[some], normal, offset)
    return _rms(distance_at(mesh, points, images, tree.query(images)[1]), weights)


def distance_at(mesh: TriangleMesh, points: FloatArray, queries: FloatArray, near: IntArray) -> FloatArray:
    """Return (q,) the distance of queries from the triangles around a vertex each.

    Args:
        mesh: the triangles.
        points: (n, 3) the vertices' positions.
        queries: (q, 3).
        near: (q,) the vertex nearest to each.
    """
    order = np.argsort(mesh.faces.ravel(), kind="stable")
    degree = np.bincount(mesh.faces.ravel(), minlength=len(points))
    start = np.cumsum(degree) - degree
    which = np.repeat(np.arange(len(near)), degree[near])
    begin = np.cumsum(degree[near]) - degree[near]
    triangle = order[start[near][which] + np.arange(len(which)) - begin[which]] // 3
    corners = points[mesh.faces[triangle]]
    query = queries[which]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inside = np.ones(len(which), dtype=bool)
    squares = np.full(len(which), np.inf)
    for i in range(3):
        tail, side = corners[:, i], corners[:, (i + 1) % 3] - corners[:, i]
        along = np.clip(dots(query - tail, side) / np.maximum(dots(side, side), 1e-300), 0.0, 1.0)
        off = query - tail - along[:, None] * side
        squares = np.minimum(squares, dots(off, off))
        inside &= dots(np.cross(normal, side), query - tail) >= 0
    above = dots(normal, query - corners[:, 0]) ** 2 / np.maximum(dots(normal, normal), 1e-300)
    found = np.full(len(near), np.inf)
    np.minimum.at(found, which, np.where(inside, np.minimum(above, squares), squares))
    return np.sqrt(found)


def _section_length(mesh: TriangleMesh, points: FloatArray, normal: FloatArray, offset: float) -> float:
    """Return the length of the curve in which a plane cuts the surface."""
    height = points @ normal - offset
    # What lies in the plane is taken for above it.
    above = (height > -SAME)[mesh.faces]
    crossed = above.any(axis=1) & ~above.all(axis=1)
    faces, above = mesh.faces[crossed], above[crossed]
    alone = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)
    apex = faces[np.arange(len(faces)), alone]
    ends = []
    for k in (1, 2):
        other = faces[np.arange(len(faces)), (alone + k) % 3]
        t = height[apex] / np.where(height[apex] == height[other], 1.0, height[apex] - height[other])
        ends.append(points[apex] + np.clip(t, 0, 1)[:, None] * (points[other] - points[apex]))
    return float(np.linalg.norm(ends[0] - ends[1], axis=1).sum())


def mirrored_edges(mesh: TriangleMesh, partner: IntArray) -> IntArray:
    """Return (e,) the mirror image of each edge, -1 where there is none."""
    size = len(mesh.vertices)
    keys = mesh.edges @ np.array([size, 1])
    wanted = np.sort(partner[mesh.edges], axis=1) @ np.array([size, 1])
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return np.where(keys[place] == wanted, place, -1)


def mirrored_corners(mesh: TriangleMesh, partner: IntArray, is_left: BoolArray) -> IntArray:
    """Return (3m,) for the corners of faces on the right those on the left that they are images of, -1 for others.

    Faces need no images of their own: where diagonals of quads run otherwise, a corner is that beside the same edge.
    """
    found = np.full(3 * len(mesh.faces), -1, dtype=np.int64)
    sides = np.flatnonzero(~np.repeat(is_left, 3))
    edge = mirrored_edges(mesh, partner)[mesh.halfedge_edges[sides]]
    pairs = mesh.edge_halfedges[edge]
    # A mirror image runs the other way.
    runs_back = mesh.tails[pairs] == partner[mesh.heads[sides]][:, None]
    on_left = (pairs >= 0) & is_left[pairs // 3] & (edge >= 0)[:, None] & runs_back
    known = on_left.any(axis=1)
    source = np.where(on_left[:, 0], pairs[:, 0], pairs[:, 1])[known]
    (tail, head), (from_tail, from_head) = end_corners(sides[known]), end_corners(source)
    found[tail] = from_head
    found[head] = from_tail
    return found
