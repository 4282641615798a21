"""Points and triangles in the plane; triangles may be flipped. Column i of sides is the side opposite corner i."""

from __future__ import annotations

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, has_any
from ..mesh.connectivity import NEXT, PREVIOUS, TriangleMesh
from .straight import rest_sides
from .triangles import cotangents, double_areas

# Height divided by longest side below which a triangle counts as degenerate, neither positively oriented nor flipped:
# coordinates are accurate to about 1e-12 of an edge.
FLAT_HEIGHT = 1e-10
# Smallest area, relative to the mean, of which a logarithm is taken; smaller areas are replaced by it.
MIN_AREA = 1e-12


def as_complex(places: FloatArray) -> ComplexArray:
    """Return complex points x + i y from (..., 2) coordinates of any shape."""
    return places[..., 0] + 1j * places[..., 1]


def as_pairs(points: ComplexArray) -> FloatArray:
    """Return (..., 2) coordinates of complex points x + i y of any shape."""
    return np.stack([points.real, points.imag], axis=-1)


def signed_double_areas(corners: FloatArray) -> FloatArray:
    """Return (m,) twice the area of triangles with corners (m, 3, 2), negative for clockwise ones."""
    x, y = corners[..., 0], corners[..., 1]  # NumPy is slow at arrays of pairs
    with np.errstate(over="ignore", invalid="ignore"):
        areas: FloatArray = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (y[:, 1] - y[:, 0]) * (
            x[:, 2] - x[:, 0]
        )
    return areas


def bounds(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (m, 2) the smallest and (m, 2) the largest coordinates of triangles with corners (m, 3, 2)."""
    low, high = np.empty((2, len(corners), 2))
    for x in range(2):  # NumPy is slow at extrema along short axes
        first, second, third = corners[:, :, x].T
        low[:, x] = np.minimum(np.minimum(first, second), third)
        high[:, x] = np.maximum(np.maximum(first, second), third)
    return low, high


def enclosing_box(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (2,) the smallest and (2,) the largest coordinates of boxes from `low` to `high` (k, 2)."""
    # NumPy is slow at extrema of pairs.
    return np.array([x.min() for x in low.T]), np.array([x.max() for x in high.T])


def signed_angles(sides: ComplexArray) -> FloatArray:
    """Return (m, 3) the corner angles, radians, of triangles with sides (m, 3); negative for flipped triangles."""
    angles = np.empty(sides.shape)
    for i in range(3):  # column by column, as NumPy is slow at indexing columns
        angles[:, i] = np.angle(-sides[:, NEXT[i]] * np.conj(sides[:, PREVIOUS[i]]))
    return angles


def heights(sides: ComplexArray) -> FloatArray:
    """Return (m,) the height divided by the longest side of triangles with sides (m, 3); negative for flipped ones."""
    doubled = (np.conj(sides[:, 0]) * sides[:, 1]).imag
    squares = sides.real**2 + sides.imag**2
    longest = np.maximum(np.maximum(squares[:, 0], squares[:, 1]), squares[:, 2])
    return doubled / np.maximum(longest, np.finfo(np.float64).tiny)


def sides_between(corners: FloatArray) -> ComplexArray:
    """Return (m, 3) the sides, as complex numbers, of triangles with corners (m, 3, 2)."""
    points = np.ascontiguousarray(corners).view(np.complex128)[..., 0]  # NumPy is slow at arrays of pairs
    sides = np.empty(points.shape, dtype=np.complex128)
    for i in range(3):
        np.subtract(points[:, PREVIOUS[i]], points[:, NEXT[i]], out=sides[:, i])
    return sides


def map_factors(shapes: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return (m, 3) and (m, 3) the derivatives of a and b in the map z -> a z + b conj(z) by the corner positions.

    The map takes each triangle from its rest shape to the plane. Its singular values are |a| + |b| and
    |a| - |b|. For triangles without area the result is NaN or infinite.

    Args:
        shapes: (m, 3) sides of the triangles before the map, as complex numbers.
    """
    r0, r1 = shapes[:, 0], shapes[:, 1]
    area = r0 * np.conj(r1) - np.conj(r0) * r1
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = (np.conj(r1) / area, -np.conj(r0) / area), (-r1 / area, r0 / area)
        # Side 0 runs from corner 1 to corner 2, side 1 from corner 2 to corner 0.
        by_a, by_b = (np.stack([c1, -c0, c0 - c1], axis=1) for c0, c1 in sides)
    return by_a, by_b


def layout_curvature(mesh: TriangleMesh, corners: FloatArray, at: BoolArray | None = None) -> FloatArray:
    """Return (n,) the curvature of a layout with corners (m, 3, 2): 2 pi, or pi on the boundary, minus the angles.

    The angles of flipped triangles are negative. If the triangles around a vertex wind around it twice, the curvature
    includes this: it is 2 pi less than with one turn.

    Args:
        mesh: the mesh.
        corners: (m, 3, 2) corners of the triangles in the plane.
        at: (n,) True at the vertices where the curvature is needed, which saves time; None: all. It is undefined at the
            others.
    """
    chosen = np.arange(len(mesh.faces)) if at is None else np.flatnonzero(has_any(at, mesh.faces))
    sides = sides_between(corners[chosen])
    angles = signed_angles(sides)
    angles = np.where((np.abs(heights(sides)) < FLAT_HEIGHT)[:, None], np.abs(angles), angles)
    sums = np.bincount(mesh.faces[chosen].ravel(), angles.ravel(), len(mesh.vertices))
    return np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi) - sums


def vertex_log_scale(mesh: TriangleMesh, before: FloatArray, after: FloatArray) -> FloatArray:
    """Return (n,) half the log of the ratio of the areas around each vertex, from triangle areas `before` and `after`.

    Args:
        mesh: triangle mesh with n vertices and m faces.
        before, after: (m,) areas, in any unit.
    """
    corner, count = mesh.faces.ravel(), len(mesh.vertices)
    around = [np.bincount(corner, np.repeat(areas, 3), count) for areas in (before, after)]
    area_before, area_after = (np.maximum(areas, MIN_AREA * areas.mean()) for areas in around)
    return np.log(area_after / area_before) / 2


def qc_distortion(lengths: FloatArray, places: FloatArray) -> FloatArray:
    """Return (m,) ratios of the singular values of triangles' maps, infinite if flipped or without area.

    Args:
        lengths: (m, 3) side lengths on the surface.
        places: (m, 3, 2) corners in the plane.
    """
    # The map z -> a z + b conj(z) has the singular values |a| + |b| and |a| - |b|. Both are multiplied by the same
    # number here, which is 0 for triangles without area on the surface.
    shapes, sides = rest_sides(lengths), sides_between(places)
    a = np.conj(shapes[:, 1]) * sides[:, 0] - np.conj(shapes[:, 0]) * sides[:, 1]
    b = shapes[:, 0] * sides[:, 1] - shapes[:, 1] * sides[:, 0]
    size_a, size_b = np.abs(a), np.abs(b)
    return np.divide(
        size_a + size_b, size_a - size_b, out=np.full(len(lengths), np.inf), where=size_a > size_b
    )


def triangle_energies(lengths: FloatArray, places: FloatArray) -> FloatArray:
    """Return (m,) the symmetric Dirichlet energy of each triangle, multiplied by its area.

    Args:
        lengths: (m, 3) its side lengths on the surface.
        places: (m, 3, 2) its corners in the plane.
    """
    dirichlet, of_inverse = dirichlet_energies(lengths, places)
    return dirichlet + of_inverse


def mean_energy(lengths: FloatArray, places: FloatArray) -> float:
    """Return the mean symmetric Dirichlet energy of triangles by area, in the plane scaled as a whole to its minimum.

    Args:
        lengths, places: as of `triangle_energies`.
    """
    dirichlet, of_inverse = dirichlet_energies(lengths, places)
    return float(2 * np.sqrt(dirichlet.sum() * of_inverse.sum()) / (double_areas(lengths).sum() / 2))


def dirichlet_energies(lengths: FloatArray, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (m,) the Dirichlet energy of each triangle's map and (m,) of its inverse, multiplied by the area.

    These are the sums of the squares of the singular values and of their inverses.
    """
    sides = places[:, [2, 0, 1]] - places[:, [1, 2, 0]]
    areas = double_areas(lengths) / 2
    dirichlet = (cotangents(lengths) * (sides**2).sum(axis=2)).sum(axis=1) / 2
    # Flipped triangles count as compressed to nearly nothing.
    ratio = np.maximum(signed_double_areas(places) / (2 * areas), 1e-100)
    return dirichlet, dirichlet * ratio**-2


def complex_sums(labels: IntArray, values: ComplexArray, count: int) -> ComplexArray:
    """Return (count,) the sum of the values (k,) that have each label (k,)."""
    return np.bincount(labels, values.real, count) + 1j * np.bincount(labels, values.imag, count)
