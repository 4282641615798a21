"""Writing binary glTF."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from numpy.typing import NDArray

from ...errors import MeshFileError
from ...geometry.normals import vertex_normals
from ..normals import shading_normals, source_normals
from ..texture import Texture
from ..uv_split import split_at_seams
from .scene_write import MOST_BYTES, scene_with_uvs

if TYPE_CHECKING:
    from ...result.flattening import Flattening

# Names and numbers of the glTF 2.0 specification.
_COMPONENTS = {"f4": 5126, "u4": 5125}
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}
_MATERIAL: dict[str, Any] = {
    "name": "coneflat",
    "doubleSided": True,
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.92, 0.92, 0.92, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 0.7,
    },
}


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
        tree, pieces = _one_mesh(result, texture)
    else:
        look = None if texture is None else _look()
        tree, pieces = scene_with_uvs(result, scene, Path() if folder is None else folder, look, texture)
    header = _as_text(tree)
    size = sum(map(len, pieces))
    total = 12 + 8 + len(header) + 8 + size
    if total > MOST_BYTES:
        raise MeshFileError(
            f"the result takes {total:,} bytes as GLB, which holds 4 GB at most: choose .ply or .npz"
        )
    stream.write(struct.pack("<4sII I4s", b"glTF", 2, total, len(header), b"JSON"))
    stream.write(header)
    stream.write(struct.pack("<I4s", size, b"BIN\0"))
    stream.writelines(pieces)


def _one_mesh(result: Flattening, texture: Texture | None) -> tuple[dict[str, Any], list[bytes]]:
    """Return the JSON of a scene of one mesh, and its buffer in pieces."""
    split = split_at_seams(result, source_normals(result))
    normals = split.normals
    if normals is None:
        normals = shading_normals(vertex_normals(result.vertices, result.faces))[split.own]
    arrays: list[NDArray[Any]] = [split.faces.reshape(-1).astype("<u4")]
    attributes = {
        "POSITION": split.vertices,
        "NORMAL": normals,
        "TEXCOORD_0": split.uv * [1, -1] + [0, 1],
        "_SOURCE_VERTEX": split.origin,
    }
    arrays += [values.astype("<f4") for values in attributes.values()]
    tree = _scene(arrays, list(attributes))
    pieces = [array.tobytes() for array in arrays]
    if texture is not None:
        image = texture.content + bytes(-len(texture.content) % 4)
        _add_image(tree, len(image), texture)
        pieces.append(image)
    return tree, pieces


def _scene(arrays: list[NDArray[Any]], names: list[str]) -> dict[str, Any]:
    """Return the JSON tree of a scene of one mesh: the first of its arrays are the triangles, the second positions."""
    lengths = [array.nbytes for array in arrays]
    accessors: list[dict[str, Any]] = [
        {
            "bufferView": i,
            "componentType": _COMPONENTS[array.dtype.str[1:]],
            "count": len(array),
            "type": _SHAPES[array.size // len(array)],
        }
        for i, array in enumerate(arrays)
    ]
    accessors[1] |= {"min": arrays[1].min(axis=0).tolist(), "max": arrays[1].max(axis=0).tolist()}
    attributes = {name: i + 1 for i, name in enumerate(names)}
    return {
        "asset": {"version": "2.0", "generator": "coneflat"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "flattened"}],
        "meshes": [
            {"name": "flattened", "primitives": [{"attributes": attributes, "indices": 0, "material": 0}]}
        ],
        "materials": [_MATERIAL],
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": sum(lengths[:i]), "byteLength": length}
            for i, length in enumerate(lengths)
        ],
        "buffers": [{"byteLength": sum(lengths)}],
    }


def _add_image(tree: dict[str, Any], size: int, texture: Texture) -> None:
    """Give the material an image, that comes behind all else in the buffer."""
    start = tree["buffers"][0]["byteLength"]
    tree["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": size})
    tree["buffers"][0]["byteLength"] = start + size
    tree["images"] = [{"bufferView": len(tree["bufferViews"]) - 1, "mimeType": texture.kind}]
    tree["textures"] = [{"source": 0}]
    tree["materials"] = [_look()]


def _look() -> dict[str, Any]:
    """Return a material that shows an image, number 0 of the textures."""
    shown = {"baseColorFactor": [1.0] * 4, "baseColorTexture": {"index": 0}}
    return _MATERIAL | {"pbrMetallicRoughness": _MATERIAL["pbrMetallicRoughness"] | shown}


def _as_text(tree: dict[str, Any]) -> bytes:
    """Return JSON, filled up with blanks to a multiple of 4."""
    text = json.dumps(tree, separators=(",", ":")).encode("ascii")
    return text + b" " * (-len(text) % 4)
