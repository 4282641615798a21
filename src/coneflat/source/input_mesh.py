"""The triangles that a user gives, and the polygons that they are parts of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, IntArray
from ..geometry.triangulate import is_polygon_side

if TYPE_CHECKING:
    from ..io.mesh_file import MeshFile


from dataclasses import replace
from typing import TypeVar

from ..base.arrays import FloatArray, unit_exponent
from ..errors import NonFiniteError
from ..geometry.intrinsic import as_lengths, check_lengths
from ..mesh.check import CheckedMesh

# Size of a mesh of which texels per unit of length, and their like, are numbers.
SMALLEST = 1e-300
Values = TypeVar("Values", IntArray, BoolArray, FloatArray)


@dataclass(frozen=True, eq=False)
class InputMesh:
    """Triangles to flatten, and the polygons they are parts of.

    Attributes:
        vertices, faces: as given; not checked.
        source: the file they came from, if any.
        face_corners: (m, 3) polygon corner of `source` at each triangle corner, if there is a source.
    """

    vertices: ArrayLike
    faces: ArrayLike
    source: MeshFile | None = None
    face_corners: IntArray | None = None

    def is_side(self) -> BoolArray:
        """Return (m, 3) True where the side opposite a corner is a side of the input's polygon, too."""
        if self.source is None or self.face_corners is None:
            return np.ones(np.shape(self.faces), dtype=bool)
        # is_polygon_side speaks of the side from corner k to k + 1, which is opposite corner k + 2.
        sides: BoolArray = is_polygon_side(self.face_corners, self.source.offsets)[:, [1, 2, 0]]
        return sides

    def corner_texture(self) -> IntArray | None:
        """Return (m, 3) what tells apart the UVs that a triangle's corners have in the input; None without UVs."""
        if self.source is None or self.source.texture is None or self.face_corners is None:
            return None
        texture, uv = self.source.texture, self.source.uv
        if uv is not None:
            # Points at the same place are one, though many programs write one for every corner.
            different = np.unique(uv + 0.0, axis=0, return_inverse=True)[1].reshape(-1)
            texture = np.where(texture < 0, texture, different[texture])
        return texture[self.face_corners]


def result_numbering(checked: CheckedMesh, input_count: int) -> tuple[IntArray, IntArray]:
    """Number the checked mesh's vertices as the input does; those that a repair added come after them.

    Returns:
        (n,) the number of each vertex of the checked mesh, and (r,) the input vertex of each number.
    """
    origin = checked.vertex_origin
    is_added = np.zeros(len(origin), dtype=bool)
    is_added[1:] = origin[1:] == origin[:-1]
    number = origin.copy()
    number[is_added] = input_count + np.arange(int(is_added.sum()))
    return number, np.concatenate([np.arange(input_count), origin[is_added]])


def at_unit_size(checked: CheckedMesh) -> CheckedMesh:
    """Return the mesh scaled by a power of two, which rounds nothing, so that squares of lengths are not extremes.

    Raises:
        NonFiniteError: it is so small that UV units per unit of length are beyond numbers.
    """
    size = float(np.abs(checked.mesh.vertices).max())
    if size < SMALLEST:
        raise NonFiniteError(f"positions of at most {size:.3g} are below double precision: scale the mesh")
    exponent = -unit_exponent(checked.mesh.vertices)
    mesh = checked.mesh.moved_to(np.ldexp(checked.mesh.vertices, exponent))
    return replace(checked, mesh=mesh, exponent=exponent)


def turn_corners(checked: CheckedMesh, per_corner: Values) -> Values:
    """Bring values at the input's triangle corners (m, 3) to the faces of the checked mesh."""
    values = per_corner[checked.face_origin]
    return np.where(checked.is_turned[:, None], values[:, [0, 2, 1]], values)


def lengths_of_input(checked: CheckedMesh, lengths: ArrayLike, face_count: int) -> FloatArray:
    """Bring a metric that the user gives to the checked mesh: (m, 3) side lengths there, at its size.

    Faces that a repair dropped do not matter, nor that both sides agree where it separated them. Triangles may be flat,
    as `mollify` is to open them.

    Args:
        checked: the mesh.
        lengths: (f, 3) for the input's faces, column i opposite corner i, model units.
        face_count: f.

    Raises:
        ArrayShapeError, NonFiniteError, LengthError: they are not a metric; by the input's numbers.
    """
    values = turn_corners(checked, as_lengths(lengths, face_count))
    names = {"face_names": checked.face_origin, "vertex_names": checked.vertex_origin}
    return np.ldexp(check_lengths(checked.mesh, values, flat=True, **names), checked.exponent)
