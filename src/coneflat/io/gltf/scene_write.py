"""Writing the scene of the glTF file that a mesh was read from, with new UVs and all else as it was.

What stays keeps its number in the lists of the JSON, so that extensions, animations and skins that this package knows
nothing of go on naming what they named. That is why the file is not taken apart and built anew, as libraries do.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, unquote

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...base.text import plural
from ...errors import ConeflatError
from ..obj_write import moved_path
from ..raw import read_bytes
from ..texture import Texture, image_kind
from .data import COMPRESSED, GltfData
from .glb import FOR_INDICES, FOR_VERTICES, Glb, bounds
from .names import accessors_named, keys_of, view_owners, views_named
from .scene import DRACO, TRIANGLES, GltfScene, ScenePart

if TYPE_CHECKING:
    from ...result import Flattening

UV = "TEXCOORD_0"
#: What an array of some elements has of the whole one.
_KEPT = ("componentType", "type", "normalized", "name", "extras")


def scene_with_uvs(result: Flattening, scene: GltfScene, folder: Path, texture: Texture | None) -> Glb:
    """Return a glTF scene with the UVs of a result.

    Of each primitive, TEXCOORD_0 is new, and every vertex is there as often as it has different UVs; all its other
    attributes and morph targets are copied bit for bit. A mesh that several nodes show becomes one for each node.
    Images beside the file are taken into the buffer. All else stays as it is.

    Args:
        result: of a mesh that was read from the scene, with its `face_corners`.
        scene: what was read.
        folder: where the file will be, for paths of images that are not to be had.
        texture: for what was flattened, instead of the file's materials.
    """
    assert result.face_corners is not None
    data, glb = scene.data, Glb(_copied(scene.data.tree))
    targets = _own_primitives(glb.tree, scene)
    old = [_copied(target) for target in targets]
    for target in targets:
        target["attributes"] = {}
        for name in ("indices", "targets", "mode"):
            target.pop(name, None)
        target.get("extensions", {}).pop(DRACO, None)
    _keep_the_rest(glb, data)
    _embed_images(glb, data, folder)
    material = None if texture is None else glb.add_material(texture)
    parts, first = scene.parts, 0
    for part, target, before, faces in zip(
        parts, targets, old, _faces_of_parts(parts, result.face_corners), strict=True
    ):
        corners = part.corners[result.face_corners[faces] - first], result.uv_faces[faces]
        first += len(part.corners)
        if part.is_mirrored:
            corners = corners[0][:, ::-1], corners[1][:, ::-1]
        _fill(glb, data, target, before, corners, result.uv)
        if material is not None:
            target["material"] = material
    _drop_empty(glb, targets)
    _forget_extensions(glb.tree)
    return glb


def scene_losses(result: Flattening) -> tuple[str, ...]:
    """Return what a GLB of a result does not keep of the glTF file that it was read from, one sentence each."""
    source = result.source
    if source is None or source.scene is None or result.face_corners is None:
        return ()
    notes = []
    tree, parts = source.scene.data.tree, source.scene.parts
    dropped = sum(len(part.corners) for part in parts) // 3 - len(result.faces)
    if dropped:
        notes.append(f"Triangles that the repair dropped are not in the file: {dropped:,}.")
    shown = {(part.mesh, part.node) for part in parts}
    copies = len(shown) - len({mesh for mesh, _ in shown})
    if copies:
        notes.append(
            f"Meshes that several nodes show have UVs of their own for each: {copies:,} more of them."
        )
    materials = tree.get("materials", [])
    painted = {
        i
        for part in parts
        if isinstance(i := tree["meshes"][part.mesh]["primitives"][part.primitive].get("material"), int)
        and i < len(materials)
        and any(name.endswith("Texture") for name in keys_of(materials[i]))
    }
    if painted:
        notes.append(
            f"Textures are kept, but were made for the old UVs: those of {plural(len(painted), 'material')}."
        )
    return tuple(notes)


def _own_primitives(tree: dict[str, Any], scene: GltfScene) -> list[dict[str, Any]]:
    """Return the primitive of each part, after a copy was made of meshes that another node has."""
    meshes, nodes = tree["meshes"], tree["nodes"]
    first_node: dict[int, int] = {}
    for part in scene.parts:
        owner = first_node.setdefault(part.mesh, part.node)
        if owner != part.node and nodes[part.node]["mesh"] == part.mesh:
            nodes[part.node]["mesh"] = len(meshes)
            meshes.append(_copied(scene.data.tree["meshes"][part.mesh]))
    return [meshes[nodes[part.node]["mesh"]]["primitives"][part.primitive] for part in scene.parts]


def _faces_of_parts(parts: tuple[ScenePart, ...], face_corners: IntArray) -> list[IntArray]:
    """Return the triangles of a result that are each part's, whose corners the scene has one after the other."""
    starts = np.cumsum([0] + [len(part.corners) for part in parts])
    owner = np.searchsorted(starts, face_corners[:, 0], side="right") - 1
    order = np.argsort(owner, kind="stable")
    return np.split(order, np.searchsorted(owner[order], np.arange(1, len(parts))))


def _keep_the_rest(glb: Glb, data: GltfData) -> None:
    """Move what is still referred to into the new buffer, and free the numbers of all else."""
    tree = glb.tree
    accessors, views = set(accessors_named(tree)), set(views_named(tree))
    for i, accessor in enumerate(tree.get("accessors", [])):
        if i in accessors:
            views |= {one["bufferView"] for one in view_owners(accessor)}
        else:
            # What nothing names any more is as small as an accessor can be.
            glb.free("accessors", i, {"componentType": 5121, "count": 1, "type": "SCALAR"})
    for i, view in enumerate(tree.get("bufferViews", [])):
        if i in views:
            view["byteOffset"] = glb.append(data.view(i).tobytes())
            view["buffer"] = 0
            for name in COMPRESSED:
                view.get("extensions", {}).pop(name, None)
        else:
            glb.free("bufferViews", i, {"buffer": 0, "byteLength": 1})


def _fill(
    glb: Glb,
    data: GltfData,
    target: dict[str, Any],
    before: dict[str, Any],
    corners: tuple[IntArray, IntArray],
    uv: FloatArray,
) -> None:
    """Write the triangles of a primitive, whose corners are these of its vertices and these points of the plane."""
    vertices, points = corners
    if not len(vertices):
        return
    pairs, number = np.unique(vertices * len(uv) + points, return_inverse=True)
    own, point = np.divmod(pairs, len(uv))

    def gathered(arrays: dict[str, int]) -> dict[str, int]:
        return {
            name: _gathered(glb, data, index, own, name == "POSITION")
            for name, index in arrays.items()
            if name != UV
        }

    target["attributes"] = gathered(before["attributes"])
    # v points down in glTF.
    flat = (uv[point] * [1, -1] + [0, 1]).astype("<f4")
    target["attributes"][UV] = glb.add_array(flat, {"componentType": 5126, "type": "VEC2"}, FOR_VERTICES)
    target["indices"] = glb.add_array(
        number.astype("<u4").reshape(-1, 1), {"componentType": 5125, "type": "SCALAR"}, FOR_INDICES
    )
    if "targets" in before:
        target["targets"] = [gathered(one) for one in before["targets"]]
    if before.get("mode", TRIANGLES) != TRIANGLES:
        target["mode"] = TRIANGLES


def _gathered(glb: Glb, data: GltfData, index: int, own: IntArray, has_bounds: bool) -> int:
    """Return the number of an array of some elements of another one."""
    old = data.item("accessors", index)
    rows = np.take(data.raw(index), own, axis=0)
    kept: dict[str, Any] = {key: old[key] for key in _KEPT if key in old}
    if has_bounds:
        kept |= bounds(rows.view(data.accessor(index).kind))
    return glb.add_array(rows, kept, FOR_VERTICES)


def _embed_images(glb: Glb, data: GltfData, folder: Path) -> None:
    """Take the files of images into the buffer; of those that cannot be read, make the paths fit."""
    for image in glb.tree.get("images", []):
        uri = image.get("uri")
        if not isinstance(uri, str) or uri.startswith("data:") or "://" in uri:
            continue
        try:
            content = read_bytes(data.beside(uri))
        except ConeflatError:
            content = b""
        kind = image_kind(content)
        if kind is None or kind == "image/gif":  # glTF knows no GIF
            old, new = (os.path.realpath(place) for place in (data.path.parent, folder))
            image["uri"] = quote(moved_path(os.fsencode(unquote(uri)), old, new))
            continue
        del image["uri"]
        image |= {"bufferView": glb.add_view(content), "mimeType": kind}


def _drop_empty(glb: Glb, targets: list[dict[str, Any]]) -> None:
    """Leave out primitives of which the repair left nothing, and meshes without any."""
    empty = {id(target) for target in targets if not target["attributes"]}
    if not empty:
        return
    for node in glb.tree["nodes"]:
        mesh = glb.tree["meshes"][node["mesh"]] if "mesh" in node else None
        if mesh is not None and all(id(one) in empty for one in mesh["primitives"]):
            del node["mesh"]
    for mesh in glb.tree["meshes"]:
        left = [one for one in mesh["primitives"] if id(one) not in empty]
        if not left:
            # Meshes must not be empty, not even those that nothing shows: they get a point.
            zero = {"componentType": 5126, "count": 1, "type": "VEC3"} | bounds(np.zeros((1, 3)))
            left = [{"attributes": {"POSITION": glb.add("accessors", zero)}, "mode": 0}]
        mesh["primitives"] = left


def _forget_extensions(tree: dict[str, Any]) -> None:
    """Take compressions that are no more from the lists of extensions."""
    used = set(keys_of(tree))
    for name in ("extensionsUsed", "extensionsRequired"):
        left = [one for one in tree.pop(name, []) if one not in (DRACO, *COMPRESSED) or one in used]
        if left:
            tree[name] = left


def _copied(item: Any) -> Any:
    """Return a copy of a tree of JSON, however deep."""
    return json.loads(json.dumps(item))
