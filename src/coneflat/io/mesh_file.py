"""A mesh as its file has it: polygons, and what must survive from reading to writing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..errors import EmptyMeshError, FaceIndexError, MeshFileError
from ..geometry.triangulate import triangulate
from ..mesh.polygons import COLOURS, first_bad_corner

if TYPE_CHECKING:
    from .gltf.read import GltfScene
    from .obj import ObjText


@dataclass(frozen=True, eq=False)
class MeshFile:
    """A mesh read from a file, with its polygons untouched.

    Attributes:
        path: where it came from.
        vertices: (n, 3) positions, model units.
        corners: (c,) vertex index of every polygon corner, polygon after polygon.
        offsets: (p + 1,) polygon i owns corners[offsets[i]:offsets[i + 1]].
        welded: how many vertices were merged because they lay at the same position.
        unwelded: (c,) what `corners` was before vertices were merged; None where none were.
        obj: the text of an OBJ file, from which the output keeps groups, materials and comments.
        properties: what the file says of every vertex besides its position, by name, each (n,): `quality` or
            `red` of a PLY file, say. Colours are 0 to 1.
        texture: (c,) a number for the UV point that the file gives every corner, -1 for those that it gives none;
            None if it gives none at all.
        uv: (u, 2) the UV points that `texture` numbers, v upwards, not checked: they may be NaN; None where the
            reader has none.
        normals: (k, 3) the normals that the file gives, of any length, in the directions of its positions.
        normal: (c,) index into `normals` of every corner, -1 where it has none; None where the file has none at all.
        scene: what else there is in a glTF file, which a GLB written keeps.

    Examples:
        >>> mesh = coneflat.read_mesh(coneflat.sample_path())
        >>> len(mesh.vertices), len(mesh.offsets) - 1, len(mesh.corners)  # vertices, polygons, corners
        (5300, 10600, 31800)
        >>> mesh.path.name, mesh.uv is None
        ('sample.obj', True)
    """

    path: Path
    vertices: FloatArray
    corners: IntArray
    offsets: IntArray
    welded: int = 0
    unwelded: IntArray | None = None
    obj: ObjText | None = None
    properties: Mapping[str, FloatArray] = field(default_factory=dict)
    texture: IntArray | None = None
    uv: FloatArray | None = None
    normals: FloatArray | None = None
    normal: IntArray | None = None
    scene: GltfScene | None = None

    @property
    def has_colours(self) -> bool:
        """Whether every vertex has a colour."""
        return all(name in self.properties for name in COLOURS)

    @cached_property
    def triangles(self) -> IntArray:
        """(m, 3) the polygons as triangles, which `flatten` takes in their place: quads and larger ones are split.

        Raises:
            DegenerateFaceError, FaceIndexError: a polygon has fewer than 3 corners, or a corner no vertex.
        """
        return triangulate(self.vertices, self.corners, self.offsets)[0]


def check_corners(path: Path, mesh: MeshFile) -> None:
    """Refuse a mesh without vertices or faces, with a face of fewer than 3 corners, or a bad index.

    Raises:
        EmptyMeshError, MeshFileError, FaceIndexError: respectively.
    """
    count = len(mesh.vertices)
    check_filled(path, count, len(mesh.offsets) - 1)
    sizes = np.diff(mesh.offsets)
    if sizes.min() < 3:
        i = int(np.argmax(sizes < 3))
        raise MeshFileError(f"{path}: face {i} has {sizes[i]} corners, but a face needs at least 3")
    c = first_bad_corner(mesh.corners, count)
    if c is not None:
        i = int(np.searchsorted(mesh.offsets, c, side="right")) - 1
        raise FaceIndexError(
            f"{path}: face {i} names vertex {mesh.corners[c]}, but there are {count} vertices, from 0 on"
        )


def check_filled(path: Path, vertices: int, faces: int) -> None:
    """Raise EmptyMeshError if a file has no vertices, or no faces."""
    for count, name in ((vertices, "vertices"), (faces, "faces")):
        if count <= 0:
            raise EmptyMeshError(f"{path} has no {name}")


def offsets_of(sizes: IntArray) -> IntArray:
    """Return (p + 1,) the offsets of polygons of (p,) sizes."""
    offsets = np.zeros(len(sizes) + 1, dtype=np.int64)
    np.cumsum(sizes, out=offsets[1:])
    return offsets
