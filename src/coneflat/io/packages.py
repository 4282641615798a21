"""Conversion of arrays, files and meshes of other packages to input meshes, and of results to meshes of other packages.

Other packages are imported only when they are needed.
"""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import as_array, as_floats
from ..errors import ArrayShapeError
from ..geometry.triangulate import triangulate
from ..result import Flattening
from ..source.input_mesh import InputMesh
from .files import imported
from .mesh_file import MeshFile, offsets_of
from .read import read_mesh
from .split import split_at_seams


def as_input(mesh: Any, faces: ArrayLike | None = None) -> InputMesh:
    """Return the input mesh for any of the supported types of meshes.

    Args:
        mesh: vertices (n, 3) if `faces` is given; otherwise a path, a `MeshFile`, a pair (vertices, faces), or
            an object like those of trimesh (`vertices`, `faces`), meshio (`points`, `cells`) or pyvista
            (`points`, `faces`).
        faces: (m, 3) vertex indices.

    Raises:
        ArrayShapeError: `mesh` has another type, or `faces` is given in addition to a mesh or file.
        MeshFileError: the file cannot be read; see `read_mesh` for further errors.
    """
    if faces is not None:
        if isinstance(mesh, (str, PathLike)) or hasattr(mesh, "faces"):
            raise ArrayShapeError(
                "a mesh or file already has faces: leave out faces, or give vertices (n, 3)"
            )
        return _from_arrays(mesh, faces)
    if isinstance(mesh, (str, PathLike)):
        mesh = read_mesh(mesh)
    if isinstance(mesh, MeshFile):
        triangles, corners = triangulate(mesh.vertices, mesh.corners, mesh.offsets)
        return InputMesh(mesh.vertices, triangles, mesh, corners)
    if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
        return _from_arrays(mesh[0], mesh[1])
    if hasattr(mesh, "points") and hasattr(mesh, "cells") and not hasattr(mesh, "n_points"):
        return _from_meshio(mesh)
    if hasattr(mesh, "points") and hasattr(mesh, "faces"):
        return _from_pyvista(mesh)
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return _from_arrays(mesh.vertices, mesh.faces)
    raise ArrayShapeError(
        f"cannot read a mesh from {type(mesh).__name__}: give vertices and faces, a file's path, or a mesh of "
        "trimesh, meshio or pyvista (for pyvista, a surface: extract_surface())"
    )


def _from_arrays(vertices: ArrayLike, faces: ArrayLike) -> InputMesh:
    return InputMesh(as_array("vertices", vertices), as_array("faces", faces))


def _from_meshio(mesh: Any) -> InputMesh:
    surface_blocks = [block for block in mesh.cells if block.type in ("triangle", "quad", "polygon")]
    if not surface_blocks:
        kinds = ", ".join(sorted({str(block.type) for block in mesh.cells})) or "none"
        raise ArrayShapeError(f"the mesh has no triangles, quads or polygons; its cells are: {kinds}")
    return _from_polygons(
        mesh.points, [row for block in surface_blocks for row in np.asarray(block.data).tolist()]
    )


def _from_pyvista(mesh: Any) -> InputMesh:
    padded = as_array("faces", mesh.faces)
    if padded.ndim == 2:  # not padded: rows of equal size
        return _from_arrays(mesh.points, padded)
    if padded.size and padded.size % 4 == 0 and (padded[::4] == 3).all():
        return _from_arrays(mesh.points, padded.reshape(-1, 4)[:, 1:])
    polygons, position = [], 0
    while position < padded.size:
        size = int(padded[position])
        end = position + 1 + size
        if size < 1 or end > padded.size:
            raise ArrayShapeError(
                f"the flat array of faces is invalid at {position}: a face of {size} corners, but "
                f"{padded.size - position - 1} numbers are left"
            )
        polygons.append(padded[position + 1 : end].tolist())
        position = end
    return _from_polygons(mesh.points, polygons)


def _from_polygons(points: ArrayLike, polygons: list[list[int]]) -> InputMesh:
    vertices = as_floats("points", points)
    if vertices.ndim == 2 and vertices.shape[1] == 2:  # planar meshes
        vertices = np.column_stack([vertices, np.zeros(len(vertices))])
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ArrayShapeError(f"points must have the shape (n, 3), got {vertices.shape}")
    offsets = offsets_of(np.array([len(polygon) for polygon in polygons], dtype=np.int64))
    corners = np.array([v for polygon in polygons for v in polygon], dtype=np.int64)
    return InputMesh(vertices, triangulate(vertices, corners, offsets)[0])


def to_trimesh(result: Flattening) -> Any:
    """Return a `trimesh.Trimesh`; see `Flattening.to_trimesh`."""
    trimesh = imported("trimesh", "meshes of trimesh need trimesh", "trimesh")
    split = split_at_seams(result)
    return trimesh.Trimesh(
        split.vertices,
        split.faces,
        visual=trimesh.visual.TextureVisuals(uv=split.uv),
        vertex_attributes={"vertex": split.vertex.astype(np.uint32)},  # the integers of glTF
        face_attributes={"chart": result.seam_data.face_chart},
        process=False,
    )


def to_pyvista(result: Flattening) -> Any:
    """Return a `pyvista.PolyData`; see `Flattening.to_pyvista`."""
    pyvista = imported("pyvista", "meshes of PyVista need PyVista", "pyvista")
    split = split_at_seams(result)
    # Each triangle is preceded by its number of corners.
    padded = np.insert(split.faces, 0, 3, axis=1)
    mesh = pyvista.PolyData(split.vertices, padded.ravel())
    mesh.point_data["vertex"] = split.vertex
    mesh.cell_data["chart"] = result.seam_data.face_chart
    # VTK's writer of PLY crashes at 64-bit texture coordinates.
    mesh.active_texture_coordinates = split.uv.astype(np.float32)
    return mesh


def to_meshio(result: Flattening) -> Any:
    """Return a `meshio.Mesh`; see `Flattening.to_meshio`."""
    meshio = imported("meshio", "meshes of meshio need meshio", "meshio")
    split = split_at_seams(result)
    return meshio.Mesh(
        split.vertices,
        [("triangle", split.faces)],
        # The name that meshio uses to read and write UVs.
        point_data={"obj:vt": split.uv, "vertex": split.vertex},
        cell_data={"chart": [result.seam_data.face_chart]},
    )
