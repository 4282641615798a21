"""Meshes from arrays, files and the mesh classes of other packages."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import BoolArray, IntArray
from ..errors import ArrayShapeError
from .mesh_file import MeshFile
from .triangulate import is_polygon_side, triangulate


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


def as_input(mesh: Any, faces: ArrayLike | None = None) -> InputMesh:
    """Return the triangles of whatever the user has.

    Args:
        mesh: vertices (n, 3) if `faces` is given; else a path, a `MeshFile`, a pair (vertices, faces), or
            an object like those of trimesh (`vertices`, `faces`), meshio (`points`, `cells`) or pyvista
            (`points`, `faces`).
        faces: (m, 3) vertex indices.

    Raises:
        ArrayShapeError: it is none of these.
    """
    if faces is not None:
        return InputMesh(mesh, faces)
    if isinstance(mesh, (str, PathLike)):
        from ..files import read_mesh

        mesh = read_mesh(mesh)
    if isinstance(mesh, MeshFile):
        triangles, corners = triangulate(mesh.vertices, mesh.corners, mesh.offsets)
        return InputMesh(mesh.vertices, triangles, mesh, corners)
    if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
        return InputMesh(mesh[0], mesh[1])
    if hasattr(mesh, "points") and hasattr(mesh, "cells") and not hasattr(mesh, "n_points"):
        return _from_meshio(mesh)
    if hasattr(mesh, "points") and hasattr(mesh, "faces"):
        return _from_pyvista(mesh)
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return InputMesh(mesh.vertices, mesh.faces)
    raise ArrayShapeError(
        f"cannot read a mesh from {type(mesh).__name__}: give vertices and faces, a file's path, or a mesh of "
        "trimesh, meshio or pyvista (for pyvista, a surface: extract_surface())"
    )


def _from_meshio(mesh: Any) -> InputMesh:
    surfaces = [
        np.asarray(block.data) for block in mesh.cells if block.type in ("triangle", "quad", "polygon")
    ]
    if not surfaces:
        kinds = ", ".join(sorted({str(block.type) for block in mesh.cells})) or "none"
        raise ArrayShapeError(f"the mesh has no triangles, quads or polygons; its cells are: {kinds}")
    return _from_polygons(mesh.points, [row for block in surfaces for row in block.tolist()])


def _from_pyvista(mesh: Any) -> InputMesh:
    padded = np.asarray(mesh.faces)
    if padded.ndim == 2:  # not padded: rows of one size
        return InputMesh(mesh.points, padded)
    if padded.size and padded.size % 4 == 0 and (padded[::4] == 3).all():
        return InputMesh(mesh.points, padded.reshape(-1, 4)[:, 1:])
    polygons = []
    position = 0
    while position < padded.size:
        size = int(padded[position])
        end = position + 1 + size
        if size < 1 or end > padded.size:
            raise ArrayShapeError(
                f"the flat array of faces is broken at {position}: a face of {size} corners with "
                f"{padded.size - position - 1} numbers left"
            )
        polygons.append(padded[position + 1 : end].tolist())
        position = end
    return _from_polygons(mesh.points, polygons)


def _from_polygons(points: ArrayLike, polygons: list[list[int]]) -> InputMesh:
    vertices = np.asarray(points, dtype=np.float64)
    if vertices.ndim == 2 and vertices.shape[1] == 2:  # meshes of the plane
        vertices = np.column_stack([vertices, np.zeros(len(vertices))])
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ArrayShapeError(f"points must have the shape (n, 3), not {vertices.shape}")
    offsets = np.concatenate([[0], np.cumsum([len(polygon) for polygon in polygons])]).astype(np.int64)
    corners = np.array([v for polygon in polygons for v in polygon], dtype=np.int64)
    return InputMesh(vertices, triangulate(vertices, corners, offsets)[0])
