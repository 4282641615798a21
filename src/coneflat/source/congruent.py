"""Congruent meshes whose vertices and faces are numbered differently: which corner of one is which of the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..geometry import double_areas, edge_lengths
from ..mesh.connectivity import TriangleMesh

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Largest number of faces of a mesh, for each order of their corners, that are compared with one of the other mesh.
# More have the same shape and place only on symmetric meshes, where most of them fit.
MAX_CANDIDATES = 32
# Largest difference of congruent meshes, however much their positions are rounded: of positions, relative to the
# largest distance from the centre; of sides, the root mean square of the relative differences.
SAME_SHAPE = 1e-3


@dataclass(frozen=True, eq=False)
class Congruence:
    """A congruence of two meshes.

    Attributes:
        corners: (3m,) the corner of the first mesh that each corner of the second one is, as indices into all corners.
        is_mirrored: whether the second mesh is a mirror image.
    """

    corners: IntArray
    is_mirrored: bool


def congruence(
    first: TriangleMesh,
    second: TriangleMesh,
    rounding: float,
    labels: tuple[IntArray, IntArray] | None = None,
) -> Congruence | None:
    """Return a congruence of two meshes, a mirror image only if there is no other; None if there is none.

    A face of one that is unlike most others is laid onto the faces of the other that it fits.

    Args:
        first, second: two meshes.
        rounding: rounding errors of both meshes, relative to the largest coordinates; see `position_tolerance`.
        labels: (3m,) for each mesh, values of the corners that are the same for corresponding ones; None for no such.
    """
    if first.vertices.shape != second.vertices.shape or first.faces.shape != second.faces.shape:
        return None
    tolerance = position_tolerance(first, second, rounding)
    points, images = (mesh.vertices - mesh.vertices.mean(axis=0) for mesh in (first, second))
    radii, image_radii = (np.linalg.norm(centred, axis=1) for centred in (points, images))
    if not np.allclose(np.sort(radii), np.sort(image_radii), rtol=0, atol=tolerance):
        return None
    from scipy.spatial import cKDTree

    tree = cKDTree(images)
    trials = list(_fitting_corners(first.faces, second.faces, points, images, tolerance))
    for sign in (1.0, -1.0):
        for corners, image_corners in trials:
            turn = best_orthogonal(points[corners], images[image_corners], sign)
            vertex = _nearest(points @ turn, tree)
            if vertex is None:
                continue
            turn = best_orthogonal(points, images[vertex], sign)
            if np.abs(points @ turn - images[vertex]).max() <= tolerance:
                matched = _matched_corners(vertex[first.faces], second.faces, sign < 0)
                if matched is not None and _is_same(first, second, matched, labels):
                    return Congruence(matched, sign < 0)
    return None


def position_tolerance(first: TriangleMesh, second: TriangleMesh, rounding: float) -> float:
    """Return the largest distance of the vertices of a mesh from those of a congruent one, after a rotation.

    It is that of the rounding errors of both; a small mesh far from the origin, of which rounding leaves no shape, is
    congruent to no other.

    Args:
        first, second: two meshes.
        rounding: rounding errors of their positions, relative to the largest coordinates.
    """
    reach = max(float(np.abs(mesh.vertices).max()) for mesh in (first, second))
    centred = first.vertices - first.vertices.mean(axis=0)
    radius = float(np.linalg.norm(centred, axis=1).max())
    return min(2 * rounding * reach, SAME_SHAPE * radius)


def _is_same(
    first: TriangleMesh, second: TriangleMesh, corners: IntArray, labels: tuple[IntArray, IntArray] | None
) -> bool:
    """Return whether corresponding corners have the same labels and opposite sides; arguments as of `congruence`."""
    is_labelled = labels is None or np.array_equal(labels[0][corners], labels[1])
    return is_labelled and has_same_sides(first, second, corners)


def has_same_sides(first: TriangleMesh, second: TriangleMesh, corners: IntArray) -> bool:
    """Return whether the sides of two meshes have the same lengths, in the mean over the area.

    Args:
        first, second: two meshes.
        corners: (3m,) the corner of the first mesh that each corner of the second one is.
    """
    lengths = edge_lengths(second.vertices, second.faces)
    partners = edge_lengths(first.vertices, first.faces).ravel()[corners].reshape(-1, 3)
    longer = np.maximum(np.maximum(lengths, partners), np.finfo(float).tiny)
    squares = (((lengths - partners) / longer) ** 2).mean(axis=1)
    areas = double_areas(lengths)
    return bool((areas * squares).sum() <= SAME_SHAPE**2 * areas.sum())


def _fitting_corners(
    faces: IntArray, image_faces: IntArray, points: FloatArray, images: FloatArray, tolerance: float
) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield the corners (3,) of a face and those of a face of the other mesh with the same sides and place.

    Args:
        faces, image_faces: (m, 3) the faces of both meshes.
        points, images: (n, 3) their vertices, relative to the centres.
        tolerance: largest difference of lengths that are equal.
    """
    shapes = _shapes(points[faces])
    kinds = np.round(np.sort(shapes.reshape(-1, 2, 3), axis=2).reshape(-1, 6) / max(8 * tolerance, 1e-300))
    _, kind, counts = np.unique(kinds, axis=0, return_inverse=True, return_counts=True)
    # Among the rarest faces, a large one far from the centre is the most accurate.
    is_rarest = counts[kind.ravel()] == counts.min()
    chosen = int(np.where(is_rarest, shapes.sum(axis=1), -1.0).argmax())
    candidates = list[IntArray]()
    for order in permutations(range(3)):
        image_corners = image_faces[:, order]
        off = np.abs(_shapes(images[image_corners]) - shapes[chosen]).max(axis=1)
        candidates += list(image_corners[off <= 2 * tolerance][:MAX_CANDIDATES])
    for image_corners in candidates:
        yield faces[chosen], image_corners


def _shapes(corners: FloatArray) -> FloatArray:
    """Return (m, 6) the distances of corners (m, 3, 3) from the centre, and the lengths of the opposite sides."""
    sides = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]
    return np.linalg.norm(np.concatenate([corners, sides], axis=1), axis=2)


def best_orthogonal(points: FloatArray, images: FloatArray, sign: float) -> FloatArray:
    """Return the (3, 3) orthogonal matrix with a determinant of a sign that maps points (k, 3) best to their images.

    References:
        W. Kabsch, "A solution for the best rotation to relate two sets of vectors", 1976.
    """
    left, _, right = np.linalg.svd(points.T @ images)
    handed = np.array([1.0, 1.0, sign * np.sign(np.linalg.det(left @ right))])
    return np.asarray((left * handed) @ right)


def _nearest(points: FloatArray, tree: cKDTree) -> IntArray | None:
    """Return (n,) the nearest points in a tree, None if two points have the same one."""
    vertex = np.asarray(tree.query(points)[1], dtype=np.int64)
    return vertex if len(np.unique(vertex)) == len(vertex) else None


def _matched_corners(faces: IntArray, image_faces: IntArray, is_reversed: bool) -> IntArray | None:
    """Return (3m,) for each corner of faces the same corner of the others; None if the faces are not the same.

    Args:
        faces, image_faces: (m, 3) faces of the same vertices.
        is_reversed: whether they have the opposite orientation.
    """
    orders, rows = list[IntArray](), list[IntArray]()
    for corners, step in ((faces, -1 if is_reversed else 1), (image_faces, 1)):
        # The corners of each face in order, from the one with the smallest vertex.
        within = (corners.argmin(axis=1)[:, None] + step * np.arange(3)) % 3
        sorted_corners = np.take_along_axis(corners, within, axis=1)
        order = np.lexsort(sorted_corners.T[::-1])
        rows.append(sorted_corners[order])
        orders.append((3 * order[:, None] + within[order]).ravel())
    if not np.array_equal(rows[0], rows[1]):
        return None
    matched = np.empty_like(orders[0])
    matched[orders[1]] = orders[0]
    return matched
