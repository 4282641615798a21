"""A mesh as read from its file: polygons, and the data that is preserved from reading to writing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import FloatArray, IntArray
from ..errors import EmptyMeshError, FaceIndexError
from ..geometry.triangulate import triangulate
from ..mesh.polygons import COLOURS, first_bad_corner
from .attributes import Attribute

if TYPE_CHECKING:
    from .gltf.read import GltfScene
    from .obj import ObjText
    from .ply.header import PlyHeader

#: Corners of a face at least; files may have faces with fewer.
MIN_CORNERS = 3


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
        face_properties: further data of every polygon by name, each (p,), in the type of the file.
        texture: (c,) index of the UV point of every corner, -1 for corners without one; None if no corner has one.
        uv: (u, 2) the UV points that `texture` refers to, v upwards, not validated: they may be NaN; None if the file
            has none.
        normals: (k, 3) the normals in the file, of any length, in the coordinate frame of the positions.
        normal: (c,) index into `normals` of every corner, -1 for corners without one; None if no corner has one.
        scene: the other data of a glTF file, which a written GLB keeps.
        ply: the types of the properties of a PLY file, and its comments.
        attributes: the data that the file has in addition to positions, faces, UVs and normals. A note on a written
            file lists those that it does not keep.
        merged_properties: names of the vertex properties in which vertices differ that were merged.
        short_faces: number of faces with fewer than three corners, which are left out.

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
    ply: PlyHeader | None = None
    face_properties: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    attributes: tuple[Attribute, ...] = ()
    merged_properties: tuple[str, ...] = ()
    short_faces: int = 0

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
    """Raise an error for a mesh without vertices or faces, or with a bad index.

    Raises:
        EmptyMeshError: there are no vertices, or no faces with three corners or more.
        FaceIndexError: a corner has an invalid vertex index.
    """
    count = len(mesh.vertices)
    check_filled(path, count, len(mesh.offsets) - 1)
    c = first_bad_corner(mesh.corners, count)
    if c is not None:
        i = int(np.searchsorted(mesh.offsets, c, side="right")) - 1
        raise FaceIndexError(
            f"{path}: face {i} refers to vertex {mesh.corners[c]}, but there are {count} vertices, from 0"
        )


def without_short_faces(mesh: MeshFile) -> MeshFile:
    """Return a mesh without its faces of fewer than three corners, which have no triangles."""
    sizes = np.diff(mesh.offsets)
    is_whole = sizes >= MIN_CORNERS
    if is_whole.all():
        return mesh
    at_corner = np.repeat(is_whole, sizes)

    def chosen(per_corner: IntArray | None) -> IntArray | None:
        return None if per_corner is None else per_corner[at_corner]

    return replace(
        mesh,
        corners=mesh.corners[at_corner],
        offsets=offsets_of(sizes[is_whole]),
        texture=chosen(mesh.texture),
        normal=chosen(mesh.normal),
        obj=None if mesh.obj is None else mesh.obj.without_polygons(~is_whole),
        face_properties={name: values[is_whole] for name, values in mesh.face_properties.items()},
        short_faces=int(np.count_nonzero(~is_whole)),
    )


def differing_properties(mesh: MeshFile, replaced_by: IntArray) -> tuple[str, ...]:
    """Return the names of the vertex properties in which vertices differ from those that replace them.

    replaced_by: (n,) the vertex that is used for each vertex.
    """
    return tuple(
        name
        for name, values in mesh.properties.items()
        if not np.array_equal(values, values[replaced_by], equal_nan=True)
    )


def check_filled(path: Path, vertices: int, faces: int) -> None:
    """Raise EmptyMeshError if a file has no vertices or no faces."""
    for count, name in ((vertices, "vertices"), (faces, "faces of three corners or more")):
        if count <= 0:
            raise EmptyMeshError(f"{path} has no {name}")


def offsets_of(sizes: IntArray) -> IntArray:
    """Return (p + 1,) the offsets of polygons with given sizes (p,)."""
    return np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)])
