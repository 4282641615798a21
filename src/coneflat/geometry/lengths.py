"""Side lengths that somebody gives, checked: whether they are a metric on a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, FloatArray, IntArray, as_floats
from ..base.text import list_some, plural
from ..errors import ArrayShapeError, LengthError, NonFiniteError
from ..mesh.connectivity import TriangleMesh
from .triangles import double_areas, slacks

# Relative: by how much the two sides of an edge may differ, and a side be longer than the two others together. Rounding
# makes less of lengths that were computed from either side, and what is wrong is off by more.
ROUNDING = 1e-9
# The area of a triangle goes through the product of four lengths, which is no number beyond this or below its inverse.
LARGEST = 1e75


def check_lengths(
    mesh: TriangleMesh,
    lengths: ArrayLike,
    *,
    flat: bool = False,
    face_names: IntArray | None = None,
    vertex_names: IntArray | None = None,
) -> FloatArray:
    """Return (m, 3) lengths as numbers, the same bits on both sides of every edge, if they are those of triangles.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths, column i opposite corner i.
        flat: accept triangles without area, which `mollify` opens.
        face_names, vertex_names: (m,), (n,) what the user calls each; None if he has no other numbers.

    Raises:
        ArrayShapeError: they are no numbers, or not (m, 3), or the mesh is none.
        NonFiniteError: some are NaN or infinite.
        LengthError: some are not positive, too large or small for numbers, differ between the sides of an edge, or
            break the triangle inequality.
    """
    if not isinstance(mesh, TriangleMesh):
        raise ArrayShapeError(
            f"the mesh must be a TriangleMesh, as in check_mesh(vertices, faces).mesh, not a {type(mesh).__name__}"
        )
    values = as_lengths(lengths, len(mesh.faces))
    with np.errstate(all="ignore"):
        areas = double_areas(values)  # 0 or not finite where anything is wrong with a triangle
    pairs = mesh.edge_halfedges[~mesh.is_boundary_edge]
    one, two = values.ravel()[pairs].T
    if not flat and np.array_equal(one, two) and (areas > 0).all() and np.isfinite(areas).all():
        return values
    faces = np.arange(len(values)) if face_names is None else face_names
    _refuse_numbers(values, faces, flat)
    differ = np.flatnonzero(np.abs(one - two) > ROUNDING * np.maximum(one, two))
    if len(differ):
        edges = mesh.edges[~mesh.is_boundary_edge][differ]
        names = edges if vertex_names is None else vertex_names[edges]
        first = differ[0]
        here, there = faces[pairs[first] // 3]
        raise LengthError(
            f"{plural(len(differ), 'edge')} with different lengths on their two sides: "
            f"{list_some([f'{a}-{b}' for a, b in names[:6]], len(differ))}; edge {names[0, 0]}-{names[0, 1]} is "
            f"{one[first]:.9g} long in face {here} and {two[first]:.9g} in face {there}"
        )
    if not np.array_equal(one, two):
        values = values.copy()
        values.ravel()[pairs[:, 1]] = one
    unit = np.ldexp(values, -np.frexp(values.max())[1])
    spare = slacks(unit).min(axis=1)
    is_broken = np.asarray(spare < -ROUNDING * unit.max(axis=1))
    _refuse_faces(is_broken, "that break the triangle inequality", values, faces)
    if not flat:
        is_flat = double_areas(unit) <= 0
        _refuse_faces(is_flat, "without area, which `coneflat.geometry.mollify` opens", values, faces)
    return values


def as_lengths(lengths: ArrayLike, count: int) -> FloatArray:
    """Return (m, 3) an array of numbers for m triangles; raises ArrayShapeError if it is none."""
    array = as_floats("lengths", lengths)
    if array.shape != (count, 3):
        raise ArrayShapeError(
            f"lengths must have the shape {(count, 3)}, a number for each side of each triangle, not {array.shape}"
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
    least, largest = values.min(), values.max()
    # What may be flat is solved for later, at a size of its own.
    if least / largest < 1 / LARGEST or not (flat or 1 / LARGEST <= least <= largest <= LARGEST):
        raise LengthError(
            f"lengths from {least:.3g} to {largest:.3g} are beyond numbers once they are multiplied: scale them"
        )


def _refuse_faces(is_bad: BoolArray, what: str, values: FloatArray, faces: IntArray) -> None:
    bad = np.flatnonzero(is_bad)
    if len(bad):
        a, b, c = values[bad[0]]
        raise LengthError(
            f"{plural(len(bad), 'face')} of {len(values):,} {what}: {list_some(faces[bad])}; face {faces[bad[0]]} has "
            f"sides of {a:.9g}, {b:.9g} and {c:.9g}"
        )
