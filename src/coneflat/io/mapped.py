"""Meshes with existing UVs, from files, results and arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, FloatArray, IntArray, as_faces, as_floats
from ..base.text import short_repr
from ..errors import ArrayShapeError, MissingUVError, OptionError
from ..mesh.check import short_faces_note
from ..mesh.polygons import fan_corners, polygon_of
from ..result import Flattening
from .join import Joined
from .materials import image_numbers
from .mesh_file import MeshFile
from .npz import read_flattening
from .packages import as_input
from .read import read_joined


@dataclass(frozen=True, eq=False)
class UVMesh:
    """Triangles with the UVs of their corners, some of which may be missing.

    Attributes:
        vertices: (n, 3) positions.
        faces: (m, 3) triangles; polygons are split into fans from the first corner, as in other programs.
        corner_uv: (m, 3, 2) UVs, v upwards; NaN where missing.
        polygons: number of polygons that the triangles are from.
        without, not_finite: number of polygon corners without UV, and with a UV that is NaN or infinite.
        notes: changes made on reading, one sentence each.
        source: the file, if any.
        texture: (m,) the number of the image that each triangle's material has; None if it is the same for all.
        texture_notes: notes on materials whose image is not known.
        face_corners: (m, 3) the polygon corner of `source` at each triangle corner, if it was read from a file.
    """

    vertices: FloatArray
    faces: IntArray
    corner_uv: FloatArray
    polygons: int
    without: int
    not_finite: int
    notes: tuple[str, ...] = ()
    source: MeshFile | None = None
    texture: IntArray | None = None
    texture_notes: tuple[str, ...] = ()
    face_corners: IntArray | None = None

    @property
    def has_uv(self) -> BoolArray:
        """Return (m,) True for triangles whose corners all have finite UVs."""
        return np.asarray(np.isfinite(self.corner_uv).all(axis=(1, 2)))


def as_uv_mesh(
    mesh: Any,
    faces: ArrayLike | None = None,
    corner_uv: ArrayLike | None = None,
    weld: bool | None = None,
    uv_set: int = 0,
) -> UVMesh:
    """Return the triangles and UVs of a mesh in any of the forms that `measure_uv` accepts.

    Args:
        mesh: a path, a `MeshFile`, a result, or (n, 3) vertices if `faces` is given.
        faces: (m, 3) vertex indices.
        corner_uv: (m, 3, 2) UVs; needed with `faces`.
        weld: as of `read_joined`, for a path.
        uv_set: the number of the UVs, for the path of a glTF. All charts of a set other than the first are taken to be
            in one texture, as those of a lightmap.

    Raises:
        OptionError: `uv_set` is given without a path, or is not an integer from 0 on.
        ArrayShapeError: `mesh` has another type, or an array has the wrong shape.
        MissingUVError: there are no UVs.
    """
    is_path = faces is None and isinstance(mesh, (str, PathLike))
    is_result = is_path and Path(mesh).suffix.lower() == ".npz"
    if uv_set and (is_result or not is_path):
        raise OptionError(f"uv_set {short_repr(uv_set)} applies to mesh files only: leave it out")
    if faces is not None:
        return _of_arrays(mesh, faces, corner_uv)
    if is_path:
        if is_result:
            return _of_result(read_flattening(mesh))
        mapped = uv_mesh_of(read_joined(mesh, weld, uv_set))
        return replace(mapped, texture=None, texture_notes=()) if uv_set else mapped
    if isinstance(mesh, MeshFile):
        return uv_mesh_of(Joined(mesh, np.arange(len(mesh.vertices))))
    if hasattr(mesh, "uv_faces") and hasattr(mesh, "uv"):
        return _of_result(mesh)
    raise ArrayShapeError(
        f"cannot read UVs from {type(mesh).__name__}: give a file's path, a result, or vertices, faces and corner_uv"
    )


def uv_mesh_of(joined: Joined) -> UVMesh:
    """Return the triangles of a file, polygons as fans, with the UVs of their corners.

    Raises:
        MissingUVError: the file has no UVs.
    """
    mesh = joined.mesh
    if mesh.texture is None or mesh.uv is None or not has_uv(mesh):
        raise MissingUVError(
            f"{mesh.path} has no UV coordinates: `coneflat flatten` computes them"
            if mesh.texture is None or mesh.uv is not None
            else f"{mesh.path} refers to UV coordinates, but does not contain them"
        )
    points = np.append(mesh.uv, [[np.nan, np.nan]], axis=0)
    texture = np.where(mesh.texture < 0, len(mesh.uv), mesh.texture)
    fans = fan_corners(mesh.offsets)
    missing = texture == len(mesh.uv)
    images, texture_notes = image_numbers(mesh)
    return UVMesh(
        vertices=mesh.vertices,
        faces=mesh.corners[fans],
        corner_uv=points[texture[fans]],
        polygons=len(mesh.offsets) - 1,
        without=int(np.count_nonzero(missing)),
        not_finite=int(np.count_nonzero(~np.isfinite(points[texture]).all(axis=1) & ~missing)),
        notes=(*joined.notes(), *([short_faces_note(mesh.short_faces)] if mesh.short_faces else [])),
        source=mesh,
        texture=images[polygon_of(fans, mesh.offsets)] if images.any() else None,
        texture_notes=texture_notes,
        face_corners=fans,
    )


def has_uv(mesh: MeshFile) -> bool:
    """Return True if any corner of a file has a UV."""
    return mesh.uv is not None and mesh.texture is not None and bool((mesh.texture >= 0).any())


def _of_result(result: Flattening) -> UVMesh:
    faces = result.faces
    return UVMesh(result.vertices, faces, result.corner_uv, len(faces), 0, 0, source=result.source)


def _of_arrays(vertices: ArrayLike, faces: ArrayLike, corner_uv: ArrayLike | None) -> UVMesh:
    surface = as_input(vertices, faces)
    points = np.atleast_1d(as_floats("vertices", surface.vertices))
    triangles = as_faces(surface.faces, len(points))
    if corner_uv is None:
        raise MissingUVError("vertices and faces alone have no UV coordinates: give corner_uv as well")
    uv = as_floats("corner_uv", corner_uv)
    if uv.shape != (*triangles.shape, 2):
        raise ArrayShapeError(f"corner_uv must have the shape {(*triangles.shape, 2)}, got {uv.shape}")
    without = np.isnan(uv).all(axis=2)
    broken = ~np.isfinite(uv).all(axis=2) & ~without
    return UVMesh(points, triangles, uv, len(triangles), int(without.sum()), int(broken.sum()))
