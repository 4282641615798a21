"""Writing of a result as binary glTF: as one mesh, or in the scene that its mesh was read from."""

from __future__ import annotations

from pathlib import Path
from typing import IO, Any

from numpy.typing import NDArray

from ...base.arrays import FloatArray
from ...geometry.triangles import vertex_normals
from ...result import Flattening
from ..attributes import ALPHA, VERTEX_COLOURS, Attribute
from ..colours import linear_colours, stored_shades
from ..mesh_file import MeshFile
from ..split import SplitMesh, input_vertices, shading_normals, source_normals, source_uv, split_at_seams
from ..texture import Texture
from .data import Item
from .glb import FOR_VERTICES, MATERIAL, Glb, bounds
from .positions import local_positions
from .scene import UV_SETS, scene_losses, scene_with_uvs


def write_glb(
    result: Flattening, stream: IO[bytes], texture: Texture | None, folder: Path, uv_set: int = 0
) -> None:
    """Write a result as GLB.

    For a mesh that was read from a glTF scene, the scene is written with new UVs. Otherwise the file has one mesh, with
    a two-sided material that is plain or has a texture. Every vertex has its UV as TEXCOORD_0 (with v pointing down, as
    glTF defines it), the input's normal or else that of the uncut surface, its colour as COLOR_0 if the input has
    colours and there is no texture, and its vertex in the input as _SOURCE_VERTEX. All these except colours are 32-bit
    floats, the only type that glTF has for them: source vertices are exact up to 2^24. Positions of a model far from
    the origin are relative to its node, whose translation is in doubles. With the UV set 1, the UVs are TEXCOORD_1, and
    TEXCOORD_0 are the UVs of the input, or else the same ones, as sets are numbered without gaps.

    Args:
        result: the result to write.
        stream: a binary file.
        texture: the image of the material; None for a light grey, or the scene's own materials.
        folder: folder of the file, for relative paths of images that cannot be read.
        uv_set: the number of the UV set that is written, 0 or 1.

    Raises:
        MeshFileError: the file would be larger than GLB permits.
    """
    scene = None if result.source is None or result.face_corners is None else result.source.scene
    if scene is None:
        glb = _one_mesh(result, texture, uv_set)
    else:
        glb = scene_with_uvs(result, scene, folder, texture, uv_set)
    glb.write(stream)


def _one_mesh(result: Flattening, texture: Texture | None, uv_set: int) -> Glb:
    """Return a scene with one mesh."""
    split = split_at_seams(result, source_normals(result), source_uv(result) if uv_set else None)
    normals = split.normals
    if normals is None:
        normals = shading_normals(vertex_normals(result.vertices, result.faces))[split.vertex]
    places, colours = local_positions(split.vertices), _colours(result, texture)
    primitive: Item = {"attributes": {}, "indices": 0, "material": 0}
    glb = Glb(
        {
            "asset": {"version": "2.0", "generator": "coneflat"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "flattened"} | places.node],
            "meshes": [{"name": "flattened", "primitives": [primitive]}],
        }
        | {name: [] for name in ("materials", "accessors", "bufferViews", "buffers")}
    )
    glb.add_array(split.faces.reshape(-1, 1).astype("<u4"), {"componentType": 5125, "type": "SCALAR"})
    arrays: dict[str, NDArray[Any]] = {"POSITION": places.local, "NORMAL": normals}
    arrays |= _uv_arrays(split, uv_set) | {"_SOURCE_VERTEX": split.origin.reshape(-1, 1)}
    for name, values in arrays.items():
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}[values.shape[1]]
        stored = values.astype("<f4")
        form = {"componentType": 5126, "type": kind} | (bounds(stored) if name == "POSITION" else {})
        primitive["attributes"][name] = glb.add_array(stored, form)
    if colours is not None:
        # 16 bits keep all of the 256 steps of sRGB.
        stored = stored_shades(colours[split.vertex], "<u2")
        form = {"componentType": 5123, "type": "VEC4", "normalized": True}
        primitive["attributes"]["COLOR_0"] = glb.add_array(stored, form, FOR_VERTICES)
    if texture is None:
        glb.add("materials", MATERIAL if colours is None else _white_material())
    else:
        glb.add_material(texture, uv_set)
    return glb


def _uv_arrays(split: SplitMesh, uv_set: int) -> dict[str, FloatArray]:
    """Return (k, 2) the UVs of each set that is written, v downwards."""
    first = split.uv if split.texture_uv is None else split.texture_uv
    uv_of_sets = [first, split.uv] if uv_set else [split.uv]
    return {name: uv * [1, -1] + [0, 1] for name, uv in zip(UV_SETS, uv_of_sets, strict=False)}


def glb_changes(result: Flattening, has_texture: bool = False, uv_set: int = 0) -> tuple[str, ...]:
    """Return notes on data of the source file that a GLB of a result changes, one sentence each.

    Args:
        result: the result.
        has_texture: whether a texture replaces the materials of its triangles.
        uv_set: the number of the UV set that is written.
    """
    if result.source is not None and result.source.scene is not None:
        return scene_losses(result, has_texture, uv_set)
    if not uv_set:
        return ()
    of_textures = source_uv(result)
    if of_textures is None:
        return ("The input has no UVs: both UV sets of the file are the new ones.",)
    if of_textures.is_missing is None:
        return ()
    return (f"{UV_SETS[0]} is (0, 0) at {int(of_textures.is_missing.sum()):,} triangle corners without UVs.",)


def _colours(result: Flattening, texture: Texture | None) -> FloatArray | None:
    """Return (r, 4) the linear colours of the vertices of a result, if its input has them and no texture hides them."""
    if texture is not None or result.source is None or result.face_corners is None:
        return None
    colours = linear_colours(result.source)
    return None if colours is None else colours[input_vertices(result)]


def _white_material() -> Item:
    """Return the material of a mesh with colours, which multiplies them."""
    plain = MATERIAL["pbrMetallicRoughness"] | {"baseColorFactor": [1.0] * 4}
    return MATERIAL | {"pbrMetallicRoughness": plain}


def kept_in_glb(source: MeshFile) -> set[Attribute]:
    """Return the attributes of a source file that `write_glb` keeps: those of a scene, or colours of vertices."""
    if source.scene is not None:
        return set(source.attributes)
    return {VERTEX_COLOURS, ALPHA} if source.has_colours else set()
