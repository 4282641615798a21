"""Writing binary glTF: one mesh, or the scene that the mesh was read from."""

from __future__ import annotations

from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from ...geometry.triangles import vertex_normals
from ..normals import shading_normals, source_normals
from ..texture import Texture
from ..uv_split import split_at_seams
from .glb import MATERIAL, Glb, bounds
from .scene_write import scene_with_uvs

if TYPE_CHECKING:
    from ...result import Flattening


def write_glb(
    result: Flattening, stream: IO[bytes], texture: Texture | None = None, folder: Path | None = None
) -> None:
    """Write a result as GLB.

    Of a mesh that was read from a glTF scene, that is the scene with new UVs. Else it has one mesh, with a two-sided
    material that is plain or has a texture. Every vertex has its UV as TEXCOORD_0 (whose v points down, as glTF has
    it), the input's normal or else one of the uncut surface, and as _SOURCE_VERTEX the vertex of the input that it
    came from. All are 32-bit floats, the only type that glTF has for them: source vertices are exact up to 2^24.

    Args:
        result: what to write.
        stream: a binary file.
        texture: the image of the material; None for a light grey, or the scene's own materials.
        folder: where the file will be, for paths of images that are not to be had; by default the current one.

    Raises:
        MeshFileError: it is larger than GLB can be.
    """
    scene = None if result.source is None or result.face_corners is None else result.source.scene
    if scene is None:
        glb = _one_mesh(result, texture)
    else:
        glb = scene_with_uvs(result, scene, Path() if folder is None else folder, texture)
    glb.write(stream)


def _one_mesh(result: Flattening, texture: Texture | None) -> Glb:
    """Return a scene of one mesh."""
    split = split_at_seams(result, source_normals(result))
    normals = split.normals
    if normals is None:
        normals = shading_normals(vertex_normals(result.vertices, result.faces))[split.own]
    primitive: dict[str, Any] = {"attributes": {}, "indices": 0, "material": 0}
    glb = Glb(
        {
            "asset": {"version": "2.0", "generator": "coneflat"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "flattened"}],
            "meshes": [{"name": "flattened", "primitives": [primitive]}],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
            "buffers": [],
        }
    )
    glb.add_array(split.faces.reshape(-1, 1).astype("<u4"), {"componentType": 5125, "type": "SCALAR"})
    for name, kind, values in (
        ("POSITION", "VEC3", split.vertices),
        ("NORMAL", "VEC3", normals),
        ("TEXCOORD_0", "VEC2", split.uv * [1, -1] + [0, 1]),
        ("_SOURCE_VERTEX", "SCALAR", split.origin.reshape(-1, 1)),
    ):
        stored = values.astype("<f4")
        form = {"componentType": 5126, "type": kind} | (bounds(stored) if name == "POSITION" else {})
        primitive["attributes"][name] = glb.add_array(stored, form)
    if texture is None:
        glb.add("materials", MATERIAL)
    else:
        glb.add_material(texture)
    return glb
