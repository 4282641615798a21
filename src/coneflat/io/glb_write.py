"""Writing binary glTF."""

from __future__ import annotations

import json
import struct
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshFileError
from .normals import corner_normals, vertex_normals
from .texture import Texture
from .uv_split import split_at_seams

if TYPE_CHECKING:
    from ..result import Flattening

# Names and numbers of the glTF 2.0 specification.
_COMPONENTS = {"f4": 5126, "u4": 5125}
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}
_MOST_BYTES = 2**32 - 1
_MATERIAL: dict[str, Any] = {
    "name": "coneflat",
    "doubleSided": True,
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.92, 0.92, 0.92, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 0.7,
    },
}


def write_glb(result: Flattening, stream: IO[bytes], texture: Texture | None = None) -> None:
    """Write a result as GLB, with a two-sided material that is plain or has a texture.

    Every vertex has its UV as TEXCOORD_0 (whose v points down, as glTF has it), the input's normal or else one of
    the uncut surface, and as _SOURCE_VERTEX the vertex of the input that it came from. All are 32-bit floats, the
    only type that glTF has for them: source vertices are exact up to 2^24.

    Args:
        result: what to write.
        stream: a binary file.
        texture: the image of the material; None for a light grey.

    Raises:
        MeshFileError: it is larger than GLB can be.
    """
    split = split_at_seams(result, corner_normals(result))
    normals = (
        vertex_normals(result.vertices, result.faces)[split.own] if split.normals is None else split.normals
    )
    arrays: list[NDArray[Any]] = [split.faces.reshape(-1).astype("<u4")]
    attributes = {
        "POSITION": split.vertices,
        "NORMAL": normals,
        "TEXCOORD_0": split.uv * [1, -1] + [0, 1],
        "_SOURCE_VERTEX": split.origin,
    }
    arrays += [values.astype("<f4") for values in attributes.values()]
    tree = _scene(arrays, list(attributes))
    if texture is not None:
        image = texture.content + bytes(-len(texture.content) % 4)
        _add_image(tree, len(image), texture.kind)
        arrays.append(np.frombuffer(image, dtype=np.uint8))
    header = _as_text(tree)
    size = sum(array.nbytes for array in arrays)
    total = 12 + 8 + len(header) + 8 + size
    if total > _MOST_BYTES:
        raise MeshFileError(
            f"the result takes {total:,} bytes as GLB, which holds 4 GB at most: choose .ply or .npz"
        )
    stream.write(struct.pack("<4sII I4s", b"glTF", 2, total, len(header), b"JSON"))
    stream.write(header)
    stream.write(struct.pack("<I4s", size, b"BIN\0"))
    for array in arrays:
        stream.write(array.data)


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


def _add_image(tree: dict[str, Any], size: int, kind: str) -> None:
    """Give the material an image, that comes behind all else in the buffer."""
    start = tree["buffers"][0]["byteLength"]
    tree["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": size})
    tree["buffers"][0]["byteLength"] = start + size
    tree["images"] = [{"bufferView": len(tree["bufferViews"]) - 1, "mimeType": kind}]
    tree["textures"] = [{"source": 0}]
    look = _MATERIAL["pbrMetallicRoughness"] | {
        "baseColorFactor": [1.0] * 4,
        "baseColorTexture": {"index": 0},
    }
    tree["materials"] = [_MATERIAL | {"pbrMetallicRoughness": look}]


def _as_text(tree: dict[str, Any]) -> bytes:
    """Return JSON, filled up with blanks to a multiple of 4."""
    text = json.dumps(tree, separators=(",", ":")).encode("ascii")
    return text + b" " * (-len(text) % 4)
