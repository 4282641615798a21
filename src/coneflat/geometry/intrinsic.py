"""Intrinsic triangulations, whose edges can be flipped: half-edge arrays instead of faces.

After flips, two vertices can share several edges, an edge can end where it starts, and a triangle can be glued to
itself. Therefore a triangle is identified by its half-edges and not by its vertices. Half-edges are numbered as in
`coneflat.mesh.connectivity`: half-edge h = 3 f + i is the side of triangle f opposite corner i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, FloatArray, IntArray, as_floats, mask_of
from ..base.text import list_some, plural
from ..errors import ArrayShapeError, LengthError, NonFiniteError
from ..mesh.connectivity import TriangleMesh
from .triangles import double_areas, slacks

# Largest relative difference of the two lengths of an edge, and largest relative violation of the triangle inequality.
# Rounding errors of lengths that are computed twice are smaller, real errors are larger.
LENGTH_ROUNDING = 1e-9
# The area of a triangle needs a product of four lengths, which overflows beyond this length and underflows below its
# inverse.
MAX_LENGTH = 1e75


def check_lengths(
    mesh: TriangleMesh,
    lengths: ArrayLike,
    *,
    flat: bool = False,
    face_names: IntArray | None = None,
    vertex_names: IntArray | None = None,
) -> FloatArray:
    """Return checked (m, 3) side lengths, with the same bits on both sides of every edge.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths, column i opposite corner i.
        flat: accept triangles without area, which `mollify` opens.
        face_names, vertex_names: (m,), (n,) numbers of the input, for messages; None if they are those of the mesh.

    Raises:
        ArrayShapeError: the lengths are not numbers or not (m, 3), or `mesh` is not a TriangleMesh.
        NonFiniteError: a length is NaN or infinite.
        LengthError: a length is not positive, is so large or small that products overflow or underflow, differs
            between the two sides of an edge, or breaks the triangle inequality.
    """
    if not isinstance(mesh, TriangleMesh):
        raise ArrayShapeError(
            f"the mesh must be a TriangleMesh, as in check_mesh(vertices, faces).mesh, got a {type(mesh).__name__}"
        )
    values = as_lengths(lengths, len(mesh.faces))
    with np.errstate(all="ignore"):
        areas = double_areas(values)  # 0 or not finite for every invalid triangle
    # The second length of a boundary edge is that of any side, and not used.
    length_at_first, length_at_second = values.take(mesh.edge_halfedges).T
    is_inner = ~mesh.is_boundary_edge
    has_equal_sides = not (is_inner & (length_at_first != length_at_second)).any()
    if not flat and has_equal_sides and (areas > 0).all() and np.isfinite(areas).all():
        return values
    faces = np.arange(len(values)) if face_names is None else face_names
    _refuse_numbers(values, faces, flat)
    off = np.abs(length_at_first - length_at_second)
    longer = np.maximum(length_at_first, length_at_second)
    differ = np.flatnonzero(is_inner & (off > LENGTH_ROUNDING * longer))
    if len(differ):
        edges = mesh.edges[differ]
        names = edges if vertex_names is None else vertex_names[edges]
        first = differ[0]
        first_face, second_face = faces[mesh.edge_faces[first]]
        raise LengthError(
            f"{plural(len(differ), 'edge')} with different lengths on their two sides: "
            f"{list_some([f'{a}-{b}' for a, b in names[:6]], len(differ))}; edge {names[0, 0]}-{names[0, 1]} is "
            f"{length_at_first[first]:.9g} long in face {first_face} and {length_at_second[first]:.9g} in "
            f"face {second_face}"
        )
    if not has_equal_sides:
        values = values.copy()
        values.ravel()[mesh.edge_halfedges[is_inner, 1]] = length_at_first[is_inner]
    unit = np.ldexp(values, -np.frexp(values.max())[1])
    spare = slacks(unit).min(axis=1)
    is_broken = np.asarray(spare < -LENGTH_ROUNDING * unit.max(axis=1))
    _refuse_faces(is_broken, "that break the triangle inequality", values, faces)
    if not flat:
        is_flat = double_areas(unit) <= 0
        _refuse_faces(is_flat, "without area, which `coneflat.geometry.mollify` opens", values, faces)
    return values


def as_lengths(lengths: ArrayLike, count: int) -> FloatArray:
    """Return lengths as an (m, 3) float array for m = `count` triangles; raise ArrayShapeError for other arrays."""
    array = as_floats("lengths", lengths)
    if array.shape != (count, 3):
        raise ArrayShapeError(
            f"lengths must have the shape {(count, 3)}, a number for each side of each triangle, got {array.shape}"
        )
    return array


def _refuse_numbers(values: FloatArray, faces: IntArray, flat: bool) -> None:
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(bad):
        raise NonFiniteError(
            f"{plural(len(bad), 'face')} of {len(values):,} with lengths that are NaN or infinite: "
            f"{list_some(faces[bad])}"
        )
    _refuse_faces(values.min(axis=1) <= 0, "with lengths that are not positive", values, faces)
    smallest, largest = values.min(), values.max()
    # If flat triangles are accepted, lengths are scaled later, so only their ratio matters.
    if smallest / largest < 1 / MAX_LENGTH or not (
        flat or 1 / MAX_LENGTH <= smallest <= largest <= MAX_LENGTH
    ):
        raise LengthError(
            f"lengths from {smallest:.3g} to {largest:.3g} overflow or underflow when they are multiplied: scale them"
        )


def _refuse_faces(is_bad: BoolArray, defect: str, values: FloatArray, faces: IntArray) -> None:
    bad = np.flatnonzero(is_bad)
    if len(bad):
        a, b, c = values[bad[0]]
        raise LengthError(
            f"{plural(len(bad), 'face')} of {len(values):,} {defect}: {list_some(faces[bad])}; face {faces[bad[0]]} "
            f"has sides of {a:.9g}, {b:.9g} and {c:.9g}"
        )


@dataclass(eq=False)
class IntrinsicTriangulation:
    """A triangulated surface given by the gluing of triangles and edge lengths. Flips change its arrays in place.

    Attributes:
        twin: (3m,) the half-edge glued to each half-edge, -1 on the boundary.
        tail: (3m,) the start vertex of each half-edge.
        length: (3m,) length of each half-edge, model units; the same bits on both sides of an edge.
        vertex_count: number n of vertices.
    """

    twin: IntArray
    tail: IntArray
    length: FloatArray
    vertex_count: int

    @property
    def faces(self) -> IntArray:
        """(m, 3) the vertex at each corner."""
        return self.tail.reshape(-1, 3)[:, [2, 0, 1]]


def halfedge_twins(mesh: TriangleMesh) -> IntArray:
    """Return (3m,) the half-edge on the other side of each half-edge, -1 on the boundary."""
    sides = mesh.edge_halfedges
    twin = np.full(mesh.faces.size, -1, dtype=np.int64)
    inner = sides[sides[:, 1] >= 0]
    twin[inner[:, 0]] = inner[:, 1]
    twin[inner[:, 1]] = inner[:, 0]
    return twin


def intrinsic_triangulation(mesh: TriangleMesh, lengths: FloatArray) -> IntrinsicTriangulation:
    """Return the triangles of a mesh as an intrinsic triangulation.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths, model units.
    """
    twin = halfedge_twins(mesh)
    length = np.ascontiguousarray(lengths, dtype=np.float64).ravel().copy()
    lower = np.flatnonzero(twin > np.arange(len(twin)))
    length[twin[lower]] = length[lower]
    return IntrinsicTriangulation(twin, mesh.tails.copy(), length, len(mesh.vertices))


def double(triangulation: IntrinsicTriangulation) -> tuple[IntrinsicTriangulation, IntArray]:
    """Return a triangulation with boundary glued to its mirror image, and the original of each of its vertices.

    Triangles and vertices keep their numbers. Triangle m + f mirrors triangle f, with its sides 1 and 2 exchanged.
    Boundary vertices are their own images. Boundary edges become inner edges, which can be flipped, so an obtuse angle
    opposite a boundary edge no longer prevents a Delaunay triangulation.

    Returns:
        The double, and (n',) the vertex of the triangulation that each of its vertices is a copy of.
    """
    twin, tail, n = triangulation.twin, triangulation.tail, triangulation.vertex_count
    slots = np.arange(len(twin))
    head = tail[slots - slots % 3 + (slots + 1) % 3]
    mirror = len(twin) + slots - slots % 3 + np.array([0, 2, 1])[slots % 3]
    outer = twin < 0
    inside = ~mask_of(n, np.append(tail[outer], head[outer]))
    image = np.arange(n)
    image[inside] = n + np.arange(inside.sum())

    double_twin, double_tail = np.empty((2, 2 * len(twin)), np.int64)
    length = np.empty(2 * len(twin))
    double_twin[slots] = np.where(outer, mirror, twin)
    double_twin[mirror] = np.where(outer, slots, mirror[twin])
    double_tail[slots], double_tail[mirror] = tail, image[head]
    length[slots] = length[mirror] = triangulation.length
    original = np.concatenate([np.arange(n), np.flatnonzero(inside)])
    return IntrinsicTriangulation(double_twin, double_tail, length, len(original)), original
