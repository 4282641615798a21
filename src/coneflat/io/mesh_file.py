"""A mesh as read from its file: polygons, and the data that is preserved from reading to writing."""

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
    """A mesh read from a file, with its polygons unchanged.

    Attributes:
        path: the file.
        vertices: (n, 3) positions, model units.
        corners: (c,) vertex index of every polygon corner, polygon after polygon.
        offsets: (p + 1,) polygon i has the corners corners[offsets[i]:offsets[i + 1]].
        welded: number of vertices that were merged because they had the same position.
        unwelded: (c,) the corners before vertices were merged; None if none were.
        obj: the text of an OBJ file, from which the output keeps groups, materials and comments.
        properties: further data of every vertex by name, each (n,), for example `quality` or `red` of a PLY file.
            Colours are 0 to 1.
        texture: (c,) index of the UV point of every corner, -1 for corners without one; None if no corner has one.
        uv: (u, 2) the UV points that `texture` refers to, v upwards, not validated: they may be NaN; None if the file
            has none.
        normals: (k, 3) the normals in the file, of any length, in the coordinate frame of the positions.
        normal: (c,) index into `normals` of every corner, -1 for corners without one; None if no corner has one.
        scene: the other data of a glTF file, which a written GLB keeps.
        images: names of the image files that a PLY file lists.
        image: (p,) index into `images` of every polygon, -1 for polygons without one; None if the file lists none.

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
    images: tuple[str, ...] = ()
    image: IntArray | None = None

    @property
    def has_colours(self) -> bool:
        """Return True if every vertex has a colour."""
        return all(name in self.properties for name in COLOURS)

    @cached_property
    def triangles(self) -> IntArray:
        """Return (m, 3) the polygons as triangles, as `flatten` uses them: quads and larger polygons are split.

        Raises:
            DegenerateFaceError, FaceIndexError: a polygon has fewer than 3 corners, or a corner has an invalid index.
        """
        return triangulate(self.vertices, self.corners, self.offsets)[0]


def check_corners(path: Path, mesh: MeshFile) -> None:
    """Raise an error for a mesh without vertices or faces, with a face of fewer than 3 corners, or with a bad index.

    Raises:
        EmptyMeshError: there are no vertices or no faces.
        MeshFileError: a face has fewer than 3 corners.
        FaceIndexError: a corner has an invalid vertex index.
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
            f"{path}: face {i} refers to vertex {mesh.corners[c]}, but there are {count} vertices, from 0"
        )


def check_filled(path: Path, vertices: int, faces: int) -> None:
    """Raise EmptyMeshError if a file has no vertices or no faces."""
    for count, name in ((vertices, "vertices"), (faces, "faces")):
        if count <= 0:
            raise EmptyMeshError(f"{path} has no {name}")


def offsets_of(sizes: IntArray) -> IntArray:
    """Return (p + 1,) the offsets of polygons with given sizes (p,)."""
    return np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)])
