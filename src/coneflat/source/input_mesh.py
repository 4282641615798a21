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
