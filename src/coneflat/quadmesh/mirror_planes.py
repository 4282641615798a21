"""Planes of mirror symmetry of a surface, found in its positions; its triangles need not be symmetric."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from ..base import BoolArray, FloatArray, IntArray, mask_of
from ..geometry import double_areas, edge_lengths
from ..geometry.nearest import TriangleTree
from ..mesh import tie_key
from ..mesh.connectivity import TriangleMesh
from .features import lengths_along
from .surface_fit import MAX_ROWS, samples_in_rows

# Largest distance of points of a symmetric surface from its mirror image, relative to its size: files have six digits
# or more.
SAME_PLACE = 1e-6
# A plane is refined, and then checked, if the images of at least this share of at most so many vertices are nearer to
# the surface than this fraction of the mean edge length.
LEAST_SHARE, MAX_SAMPLES, NEAR_EDGES = 0.9, 256, 0.01
# Where all vertices have images, points of triangles may be so far from the surface, in mean edge lengths: on spot,
# whose quads are divided at other diagonals on both sides, 0.07.
DIAGONAL_EDGES = 0.1
# Sample points, about so many for the area of a surface, in triangles whose images are no triangles.
SAMPLES_OF_AREA = 4000
# Principal moments that differ by less, relative to the largest, determine no axes.
EQUAL_MOMENTS = 1e-3
# Largest number of vertices of a kind whose pairs are tried, and of such kinds.
MAX_VERTICES, MAX_KINDS = 12, 4
# Binary digits of the offset of a plane, relative to the size of the surface: rounding errors are smaller.
OFFSET_DIGITS = 36
# Points are on a plane if they are nearer, relative to the size of the surface.
ON_PLANE = 1e-9


@dataclass(frozen=True, eq=False)
class MirrorPlane:
    """A plane of symmetry.

    Attributes:
        normal: (3,) its unit normal.
        offset: its distance from the origin along the normal.
        size: the largest extent of the surface along an axis, in the same units.
    """

    normal: FloatArray
    offset: float
    size: float

    def heights(self, points: FloatArray) -> FloatArray:
        """Return (k,) the distances of points (k, 3) from the plane, positive on the side of the normal."""
        return np.asarray(points @ self.normal - self.offset)

    def contains(self, points: FloatArray) -> BoolArray:
        """Return (k,) whether points (k, 3) are on the plane."""
        return np.asarray(np.abs(self.heights(points)) <= ON_PLANE * self.size)

    def projected(self, points: FloatArray) -> FloatArray:
        """Return (k, 3) the nearest points of the plane."""
        return np.asarray(points - self.heights(points)[:, None] * self.normal)

    def reflected(self, points: FloatArray) -> FloatArray:
        """Return (k, 3) the mirror images of points."""
        return np.asarray(points - 2 * self.heights(points)[:, None] * self.normal)

    def scaled(self, exponent: int) -> MirrorPlane:
        """Return the plane of the surface multiplied by a power of two."""
        return MirrorPlane(
            self.normal, *(float(np.ldexp(length, exponent)) for length in (self.offset, self.size))
        )

    def __str__(self) -> str:
        normal = ", ".join(f"{x + 0.0:.3g}" for x in np.round(self.normal, 9))
        return f"the plane across ({normal}) at {self.offset:.3g}"


def symmetry_planes(mesh: TriangleMesh) -> Iterator[MirrorPlane]:
    """Yield the planes of symmetry of a surface among those across the axes, principal axes, and pairs of vertices."""
    size = float(np.ptp(mesh.vertices, axis=0).max())
    centre, moments, axes = _principal_axes(mesh)
    if not size > 0 or not np.isfinite(moments).all():
        return
    images = _Images(mesh, size)
    checked_normals = np.empty((0, 3))
    for normal in _normals(mesh, centre, moments, axes):
        if (np.abs(checked_normals @ normal) > 1 - SAME_PLACE).any():
            continue
        checked_normals = np.vstack([checked_normals, normal])
        heights = mesh.vertices @ normal
        offsets = float(centre @ normal), float(heights.min() + heights.max()) / 2
        # Both are on a plane of symmetry; on 106,000 triangles without one, this saves the search for nearest points.
        if abs(offsets[0] - offsets[1]) > 2 * images.reach:
            continue
        planes = [_plane(normal, offset, size) for offset in offsets]
        if (plane := images.symmetric_plane(planes)) is not None:
            yield plane


def _plane(normal: FloatArray, offset: float, size: float) -> MirrorPlane:
    """Return a plane whose offset is rounded, so that a plane through the origin up to rounding is one."""
    unit = float(np.ldexp(1.0, int(np.frexp(size)[1]) - OFFSET_DIGITS))
    return MirrorPlane(normal, round(offset / unit) * unit, size)


def _principal_axes(mesh: TriangleMesh) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (3,) the centre of the area of a surface, (3,) its principal moments, and (3, 3) its axes as rows."""
    areas = double_areas(edge_lengths(mesh.vertices, mesh.faces))
    shares = areas / max(float(areas.sum()), np.finfo(float).tiny)
    corners = mesh.vertices[mesh.faces]
    centre = shares @ corners.mean(axis=1)
    corners = corners - centre
    middles = corners.mean(axis=1)
    # The mean of x x^T over a triangle with corners a, b, c and centroid m: (a a^T + b b^T + c c^T + 9 m m^T) / 12.
    products = np.einsum("f,fix,fiy->xy", shares, corners, corners)
    products += 9 * np.einsum("f,fx,fy->xy", shares, middles, middles)
    moments, vectors = np.linalg.eigh(products / 12)
    return centre, moments, vectors.T


def _normals(
    mesh: TriangleMesh, centre: FloatArray, moments: FloatArray, axes: FloatArray
) -> Iterator[FloatArray]:
    """Yield unit normals of planes through the centre that may be planes of symmetry, each in one of two directions."""
    yield from np.eye(3)
    for axis in axes:
        yield axis * np.sign(axis[np.abs(axis).argmax()])
    if (np.diff(moments) > EQUAL_MOMENTS * moments[-1]).all():
        return
    # Axes are not determined, as of a cube or a gear. A plane exchanges vertices at the same distance from the centre
    # and with as many triangles. Of kinds with few vertices, those far from the centre are the most accurate.
    radii = np.linalg.norm(mesh.vertices - centre, axis=1)
    order = np.argsort(radii, kind="stable")
    ring = np.empty(len(order), dtype=np.int64)
    ring[order] = np.cumsum(np.diff(radii[order], prepend=0.0) > SAME_PLACE * radii.max())
    degree = np.bincount(mesh.faces.ravel(), minlength=len(radii))
    _, kind, counts = np.unique(np.stack([ring, degree]), axis=1, return_inverse=True, return_counts=True)
    kinds = np.flatnonzero((counts > 1) & (counts <= MAX_VERTICES))[::-1][:MAX_KINDS]
    key = tie_key(mesh.vertices)
    for number in kinds:
        alike = np.flatnonzero(kind.ravel() == number)
        for pair in combinations(alike[np.argsort(key[alike], kind="stable")], 2):
            across = np.diff(mesh.vertices[list(pair)], axis=0)[0]
            length = float(np.linalg.norm(across))
            if length > SAME_PLACE * radii.max():
                yield across * np.sign(across[np.abs(across).argmax()]) / length


def seam_edges(half: TriangleMesh, plane: MirrorPlane) -> IntArray:
    """Return the boundary edges of a half at which the other half begins."""
    return np.flatnonzero(half.is_boundary_edge & plane.contains(half.vertices)[half.edges].all(axis=1))


def on_seam(half: TriangleMesh, plane: MirrorPlane) -> BoolArray:
    """Return (n,) whether each vertex of a half is on the plane and not on the boundary of the whole surface."""
    is_seam, is_outer = _on_boundaries(half, plane)
    return is_seam & ~is_outer


def at_seam_ends(half: TriangleMesh, plane: MirrorPlane) -> BoolArray:
    """Return (n,) whether each vertex of a half is where the boundary of the whole surface meets the plane."""
    is_seam, is_outer = _on_boundaries(half, plane)
    return is_seam & is_outer


def _on_boundaries(half: TriangleMesh, plane: MirrorPlane) -> tuple[BoolArray, BoolArray]:
    """Return (n,) whether each vertex is on an edge of the seam, and on one of the boundary of the whole surface."""
    seam = seam_edges(half, plane)
    outer = np.setdiff1d(np.flatnonzero(half.is_boundary_edge), seam)
    count = len(half.vertices)
    return mask_of(count, half.edges[seam]), mask_of(count, half.edges[outer])


class _Images:
    """Mirror images of the points of a surface.

    Attributes:
        mesh: the surface.
        size: its largest extent along an axis.
        reach: a distance up to which images may be near the surface.
    """

    def __init__(self, mesh: TriangleMesh, size: float) -> None:
        self.mesh, self.size = mesh, size
        self._edge = float(lengths_along(mesh, np.arange(len(mesh.edges))).mean())
        self.reach = NEAR_EDGES * self._edge
        order = np.argsort(tie_key(mesh.vertices), kind="stable")
        self._samples = mesh.vertices[order[:: -(-len(order) // MAX_SAMPLES)]]

    @cached_property
    def _vertices(self) -> cKDTree:
        return cKDTree(self.mesh.vertices)

    @cached_property
    def _triangles(self) -> TriangleTree:
        return TriangleTree(self.mesh.vertices, self.mesh.faces)

    def symmetric_plane(self, planes: list[MirrorPlane]) -> MirrorPlane | None:
        """Return the first of some planes, or of refinements of these, that is a plane of symmetry, or None."""
        for plane in planes:
            if self.share_near(plane) >= LEAST_SHARE:
                for trial in (self.refined(plane), plane):
                    if self.is_symmetric(trial):
                        return trial
        return None

    def share_near(self, plane: MirrorPlane) -> float:
        """Return the share of samples whose images are near the surface."""
        return float((self._distances(plane.reflected(self._samples)) <= self.reach).mean())

    def refined(self, plane: MirrorPlane) -> MirrorPlane:
        """Return the plane that fits pairs of vertices, of which one is near the image of the other, best."""
        vertices = self.mesh.vertices
        gaps, images = self._vertices.query(plane.reflected(vertices), distance_upper_bound=self.reach)
        paired = np.flatnonzero(np.isfinite(gaps))
        across = vertices[paired] - vertices[images[paired]]
        if not (np.linalg.norm(across, axis=1) > self.reach).any():
            return plane
        normal = np.linalg.eigh(across.T @ across)[1][:, -1]
        normal = normal * np.sign(normal @ plane.normal)
        middles = (vertices[paired] + vertices[images[paired]]) / 2
        return _plane(normal, float((middles @ normal).mean()), self.size)

    def is_symmetric(self, plane: MirrorPlane) -> bool:
        """Return whether the images of the vertices, and of points of triangles, are on the surface.

        So are those of the boundary on the boundary, because a hole may be inside the image of a triangle. A triangle
        whose image is one needs no points. Where all vertices have images, only the diagonals of polygons differ, and
        these points may be near the surface.
        """
        mesh, tolerance = self.mesh, SAME_PLACE * self.size
        if not self._has_symmetric_boundary(plane):
            return False
        reflected = plane.reflected(mesh.vertices)
        _, image = self._vertices.query(reflected, distance_upper_bound=tolerance)
        has_image = image < len(image)
        is_paired = has_image[mesh.faces].all(axis=1)
        image_faces = np.sort(image[mesh.faces[is_paired]], axis=1)
        is_paired[is_paired] = _are_faces(image_faces, np.sort(mesh.faces, axis=1))
        if has_image.all():
            tolerance = DIAGONAL_EDGES * self._edge
        elif not (self._distances(reflected[~has_image]) <= tolerance).all():
            return False
        points = self._samples_of(reflected, mesh.faces[~is_paired])
        return not len(points) or bool((self._distances(points) <= tolerance).all())

    def _has_symmetric_boundary(self, plane: MirrorPlane) -> bool:
        """Return whether the images of the ends and middles of boundary edges are on boundary edges."""
        ends = self.mesh.edges[self.mesh.is_boundary_edge]
        if not len(ends):
            return True
        vertices = self.mesh.vertices
        points = np.concatenate([vertices[np.unique(ends)], vertices[ends].mean(axis=1)])
        images = plane.reflected(points)
        # Each edge is a triangle without area.
        faces = ends[:, [0, 1, 1]]
        on, weights = TriangleTree(vertices, faces).nearest(images)
        nearest = np.einsum("qi,qix->qx", weights, vertices[faces[on]])
        return bool((np.linalg.norm(nearest - images, axis=1) <= SAME_PLACE * self.size).all())

    def _samples_of(self, vertices: FloatArray, faces: IntArray) -> FloatArray:
        """Return (s, 3) corners of triangles, middles of their sides, and points inside, the more the larger they are.

        vertices: (n, 3) positions of the vertices of the surface.
        """
        corners = vertices[faces]
        on_sides = np.concatenate([corners, (corners + np.roll(corners, 1, axis=1)) / 2], axis=1)
        areas = double_areas(edge_lengths(vertices, self.mesh.faces)).sum()
        shares = double_areas(edge_lengths(vertices, faces)) / max(float(areas), np.finfo(float).tiny)
        rows = np.clip(np.ceil(np.sqrt(SAMPLES_OF_AREA * shares)), 1, MAX_ROWS).astype(np.int64)
        return np.concatenate([on_sides.reshape(-1, 3), samples_in_rows(vertices, faces, rows)])

    def _distances(self, points: FloatArray) -> FloatArray:
        faces, weights = self._triangles.nearest(points)
        nearest = np.einsum("qi,qix->qx", weights, self.mesh.vertices[self.mesh.faces[faces]])
        return np.asarray(np.linalg.norm(nearest - points, axis=1))


def _are_faces(rows: IntArray, faces: IntArray) -> BoolArray:
    """Return (k,) whether rows (k, 3) are among faces (m, 3), both with sorted vertices."""
    unique, number = np.unique(np.concatenate([faces, rows]), axis=0, return_inverse=True)
    present = np.zeros(len(unique), dtype=bool)
    number = number.ravel()
    present[number[: len(faces)]] = True
    return present[number[len(faces) :]]
