"""Writing binary glTF, by trimesh's exporter."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING, Any

import numpy as np

from .._arrays import FloatArray, IntArray
from .texture import Texture
from .uv_split import split_at_seams

if TYPE_CHECKING:
    from ..result import Flattening


def write_glb(result: Flattening, stream: IO[bytes], texture: Texture | None = None) -> None:
    """Write a result as GLB, with a two-sided material that is plain or has a texture.

    Every vertex has its UV as TEXCOORD_0 (whose v points down, as glTF has it), a normal of the uncut
    surface, and as _SOURCE_VERTEX the vertex of the input that it came from. All are 32-bit floats, the only
    type that glTF has for them: source vertices are exact up to 2^24.

    Args:
        result: what to write.
        stream: a binary file.
        texture: the image of the material; None for a light grey.
    """
    # trimesh takes about a second to import.
    import trimesh
    from trimesh.visual.material import PBRMaterial
    from trimesh.visual.texture import TextureVisuals

    split = split_at_seams(result)
    material = PBRMaterial(
        name="coneflat",
        baseColorFactor=[235, 235, 235, 255] if texture is None else [255, 255, 255, 255],
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

    def embed(buffers: dict[Any, bytes], tree: dict[str, Any]) -> None:
        # The exporter would encode the image anew, a JPEG with a loss.
        if texture is not None:
            tree["images"].append({"bufferView": len(buffers), "mimeType": texture.kind})
            tree["textures"].append({"source": 0})
            tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
            buffers["texture"] = texture.content + bytes(-len(texture.content) % 4)

    stream.write(scene.export(file_type="glb", include_normals=True, buffer_postprocessor=embed))


def _normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (n, 3) unit normals, each the mean of its triangles' by area; (0, 0, 1) where there is none."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    by_face = np.cross(b - a, c - a)
    total = np.stack(
        [np.bincount(faces.reshape(-1), np.repeat(by_face[:, k], 3), len(vertices)) for k in range(3)], axis=1
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    flat = length[:, 0] == 0
    normals = total / np.where(length == 0, 1, length)
    normals[flat] = (0, 0, 1)
    return np.asarray(normals)
