"""Writing binary glTF, by trimesh's exporter."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING

import numpy as np

from .._arrays import FloatArray, IntArray
from .uv_split import split_at_seams

if TYPE_CHECKING:
    from ..result import Flattening


def write_glb(result: Flattening, stream: IO[bytes]) -> None:
    """Write a result as GLB, with a plain two-sided material.

    Every vertex has its UV as TEXCOORD_0 (whose v points down, as glTF has it), a normal of the uncut
    surface, and as _SOURCE_VERTEX the vertex of the input that it came from. All are 32-bit floats, the only
    type that glTF has for them: source vertices are exact up to 2^24.

    Args:
        result: what to write.
        stream: a binary file.
    """
    # trimesh takes about a second to import.
    import trimesh
    from trimesh.visual.material import PBRMaterial
    from trimesh.visual.texture import TextureVisuals

    split = split_at_seams(result)
    material = PBRMaterial(
        name="coneflat",
        baseColorFactor=[235, 235, 235, 255],
        metallicFactor=0.0,
        roughnessFactor=0.7,
        doubleSided=True,
    )
    mesh = trimesh.Trimesh(
        vertices=split.vertices,
        faces=split.faces,
        vertex_normals=_normals(result.vertices, result.faces)[split.own],
        visual=TextureVisuals(uv=split.uv, material=material),
        process=False,
        validate=False,
    )
    mesh.vertex_attributes["_SOURCE_VERTEX"] = split.origin.astype(np.float32)
    scene = trimesh.Scene({"flattened": mesh})
    stream.write(scene.export(file_type="glb", include_normals=True))


def _normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (n, 3) unit normals, each the mean of its triangles' by area; (0, 0, 1) where there is none."""
    a, b, c = (np.take(vertices, faces[:, k], axis=0) for k in range(3))
    by_face = np.cross(b - a, c - a)
    total = np.stack(
        [np.bincount(faces.reshape(-1), np.repeat(by_face[:, k], 3), len(vertices)) for k in range(3)], axis=1
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    flat = length[:, 0] == 0
    normals = total / np.where(length == 0, 1, length)
    normals[flat] = (0, 0, 1)
    return np.asarray(normals)
