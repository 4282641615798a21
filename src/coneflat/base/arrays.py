"""Names of the array types used in annotations, and arrays of users checked."""

from __future__ import annotations

from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArrayShapeError, EmptyMeshError, FaceIndexError, NonFiniteError
from .text import list_some, plural

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
Int32Array: TypeAlias = NDArray[np.int32]
ComplexArray: TypeAlias = NDArray[np.complex128]
BoolArray: TypeAlias = NDArray[np.bool_]
Numbers = TypeVar("Numbers", FloatArray, IntArray)


def dots(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the inner products of vectors along the last axis, several times as fast there as a sum of products."""
    products: FloatArray = np.einsum("...i,...i->...", one, other)
    return products


def rows_of(values: Numbers, places: IntArray) -> Numbers:
    """Return (*places, k) the rows of values (n, k) at places: what indexing does, in a tenth of the time."""
    rows: Numbers = values.take(places, axis=0)
    return rows


def has_any(mask: BoolArray, sets: IntArray) -> BoolArray:
    """Return (m,) whether any of the indices (m, k) of each set is in a mask; much faster than along the last axis."""
    found = np.zeros(len(sets), dtype=bool)
    for column in range(sets.shape[1]):
        found |= mask[sets[:, column]]
    return found


def unit_exponent(values: FloatArray) -> int:
    """Return the exponent of the least power of two that no value reaches: to divide by it rounds nothing.

    So scaled, squares and products of lengths are not extremes, whatever the unit.
    """
    return int(np.frexp(max(values.max(), -values.min()))[1])


def as_faces(faces: ArrayLike, vertex_count: int) -> IntArray:
    """Return (m, 3) vertex indices; raises ArrayShapeError, EmptyMeshError, or FaceIndexError with the bad ones."""
    try:
        array = np.asarray(faces)
        if array.dtype.kind not in "fiu" and array.size:
            raise TypeError(f"their type is {array.dtype}")
        with np.errstate(invalid="ignore"):
            triangles = np.ascontiguousarray(array, dtype=np.int64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArrayShapeError(f"faces must be an (m, 3) array of vertex indices: {error}") from error
    if triangles.size == 0:
        raise EmptyMeshError("the mesh has no faces")
    if triangles.ndim != 2 or triangles.shape[1] != 3:
        raise ArrayShapeError(f"faces must have the shape (m, 3), not {triangles.shape}")
    if array.dtype.kind == "f" and (triangles != array).any():
        raise ArrayShapeError("faces must hold integers, vertex indices from 0")
    if triangles.min() < 0 or triangles.max() >= vertex_count:
        bad = np.flatnonzero(((triangles < 0) | (triangles >= vertex_count)).any(axis=1))
        row = triangles[bad[0]]
        raise FaceIndexError(
            f"{plural(len(bad), 'face')} with a vertex index outside 0..{vertex_count - 1}: "
            f"{list_some(bad)}; face {bad[0]} is ({row[0]}, {row[1]}, {row[2]})"
        )
    return triangles


def require_finite(points: FloatArray, triangles: IntArray) -> None:
    """Raise NonFiniteError if a face has a vertex that is nowhere; vertices without a face do not matter."""
    is_finite = np.isfinite(points)
    if not is_finite.all():
        is_bad: BoolArray = np.any(~is_finite, axis=1)
        bad = np.unique(triangles[is_bad[triangles]])
        if len(bad):
            raise NonFiniteError(
                f"{plural(len(bad), 'vertex', 'vertices')} of {len(points):,} with NaN or infinite coordinates: "
                f"{list_some(bad)}; remove or mend them"
            )


def as_floats(name: str, values: ArrayLike) -> FloatArray:
    """Return an array of numbers; raises ArrayShapeError, with its name, if there is anything else in it."""
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "bfiuO":
            raise TypeError(f"their type is {array.dtype}")
        return np.asarray(array, dtype=np.float64, order="C")
    except (TypeError, ValueError, OverflowError) as error:
        raise ArrayShapeError(f"{name} must be an array of numbers: {error}") from error
