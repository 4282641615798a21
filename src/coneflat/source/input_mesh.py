"""The input triangles, and the polygons that contain them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, FloatArray, IntArray, unit_exponent
from ..errors import DegenerateFaceError, NonFiniteError
from ..geometry.intrinsic import as_lengths, check_lengths
from ..geometry.triangulate import is_polygon_side
from ..mesh.check import CheckedMesh

if TYPE_CHECKING:
    from ..io.mesh_file import MeshFile

# Smallest size of a mesh for which texels per unit of length, and similar ratios, are finite.
MIN_COORDINATE = 1e-300
Values = TypeVar("Values", IntArray, BoolArray, FloatArray)


@dataclass(frozen=True, eq=False)
class InputMesh:
    """Triangles to flatten, and the polygons that contain them.

    Attributes:
        vertices, faces: as given, unchecked.
        source: the file that they were read from, if any.
        face_corners: (m, 3) polygon corner of `source` at each triangle corner, if there is a source.
    """

    vertices: ArrayLike
    faces: ArrayLike
    source: MeshFile | None = None
    face_corners: IntArray | None = None

    def is_side(self) -> BoolArray:
        """Return (m, 3) whether the side opposite each corner is also a side of the input's polygon."""
        if self.source is None or self.face_corners is None:
            return np.ones(np.shape(self.faces), dtype=bool)
        # Column k of is_polygon_side is the side from corner k to k + 1, which is opposite corner k + 2.
        return is_polygon_side(self.face_corners, self.source.offsets)[:, [1, 2, 0]]

    def corner_texture(self) -> IntArray | None:
        """Return (m, 3) indices that are equal where triangle corners have the same input UV; None without UVs."""
        if self.source is None or self.source.texture is None or self.face_corners is None:
            return None
        texture, uv = self.source.texture, self.source.uv
        if uv is not None:
            # Points with equal coordinates count as one, because many programs write one point per corner.
            different = np.unique(uv + 0.0, axis=0, return_inverse=True)[1].reshape(-1)
            texture = np.where(texture < 0, texture, different[texture])
        return texture[self.face_corners]


def result_numbering(checked: CheckedMesh, input_count: int) -> tuple[IntArray, IntArray]:
    """Return the numbering of the result's vertices: those of the input, then those that a repair added.

    Returns:
        (n,) the index in the result of each vertex of the checked mesh, and (r,) the input vertex of each index.
    """
    origin = checked.vertex_origin
    is_added = np.zeros(len(origin), dtype=bool)
    is_added[1:] = origin[1:] == origin[:-1]
    number = origin.copy()
    number[is_added] = input_count + np.arange(int(is_added.sum()))
    return number, np.concatenate([np.arange(input_count), origin[is_added]])


def at_unit_size(checked: CheckedMesh) -> CheckedMesh:
    """Return the mesh scaled to about unit size by a power of two.

    This is exact, and avoids underflow and overflow of squared lengths.

    Raises:
        DegenerateFaceError: all vertices are at 0.
        NonFiniteError: the mesh is so small that UV units per unit of length are not finite.
    """
    size = float(np.abs(checked.mesh.vertices).max())
    if not size:
        raise DegenerateFaceError("the mesh has no area: all its vertices are at 0")
    if size < MIN_COORDINATE:
        raise NonFiniteError(f"coordinates of at most {size:.3g} are too small: scale the mesh")
    exponent = -unit_exponent(checked.mesh.vertices)
    mesh = checked.mesh.moved_to(np.ldexp(checked.mesh.vertices, exponent))
    return replace(checked, mesh=mesh, exponent=exponent)


def reorder_corners(checked: CheckedMesh, per_corner: Values) -> Values:
    """Return values (m, 3) at triangle corners of the input, rearranged for the faces of the checked mesh."""
    values = per_corner[checked.face_origin]
    return np.where(checked.is_flipped[:, None], values[:, [0, 2, 1]], values)


def lengths_of_input(checked: CheckedMesh, lengths: ArrayLike, face_count: int) -> FloatArray:
    """Return (m, 3) the side lengths given by the user, for the checked mesh and at its size.

    Faces that a repair removed are ignored, and the two sides of an edge that it separated may differ. Triangles may be
    degenerate, because `mollify` opens them later.

    Args:
        checked: the mesh.
        lengths: (f, 3) for the input's faces, column i opposite corner i, model units.
        face_count: f.

    Raises:
        ArrayShapeError, NonFiniteError, LengthError: the lengths are not a metric; messages use the input's indices.
    """
    values = reorder_corners(checked, as_lengths(lengths, face_count))
    names = {"face_names": checked.face_origin, "vertex_names": checked.vertex_origin}
    return np.ldexp(check_lengths(checked.mesh, values, flat=True, **names), checked.exponent)
