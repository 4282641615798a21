"""The glTF scene that a mesh was read from, with new UVs and otherwise unchanged.

Objects keep their indices in the lists of the JSON, so that references from unknown extensions, animations and skins
stay valid. For this reason the scene is modified and not rebuilt, as libraries do.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...base.text import plural
from ...result import Flattening
from ..attributes import old_textures
from ..split import distinct_pairs
from ..texture import Texture
from .data import GltfData, Item
from .glb import DEFAULT_MATERIAL, FOR_INDICES, FOR_VERTICES, Glb, bounds
from .images import embed_images, image_notes
from .read import DRACO, GltfScene, Mode, ScenePart
from .references import entries_of

#: The UV sets of a file that results are written to: those of textures, and those of a lightmap.
UV_SETS = ("TEXCOORD_0", "TEXCOORD_1")
#: Keys of an accessor that are copied to the accessor of a subset of its elements.
_COPIED_FIELDS = ("componentType", "type", "normalized", "name", "extras")


def scene_with_uvs(
    result: Flattening, scene: GltfScene, folder: Path, texture: Texture | None, uv_set: int = 0
) -> Glb:
    """Return a glTF scene with the UVs of a result.

    In each primitive, one UV set is new, and every vertex is repeated for each of its UVs; all other attributes and
    morph targets are copied bit for bit, except tangents of the old UVs, which are those of the normal map. The first
    set is also new where there is none, as sets are numbered without gaps. A mesh that several nodes show is copied
    for each node. Image files are embedded in the buffer. All other data is unchanged.

    Args:
        result: the result for a mesh that was read from the scene, with its `face_corners`.
        scene: the scene that was read.
        folder: folder of the file, for relative paths of images that cannot be read.
        texture: texture of the flattened parts, instead of the file's materials.
        uv_set: the number of the new UV set, 0 or 1.
    """
    assert result.face_corners is not None
    data, glb = scene.data, Glb(deepcopy(scene.data.tree))
    targets = _separate_primitives(glb.tree, scene)
    old = [deepcopy(target) for target in targets]
    for target in targets:
        target["attributes"] = {}
        for name in ("indices", "targets", "mode"):
            target.pop(name, None)
        target.get("extensions", {}).pop(DRACO, None)
    glb.copy_arrays(data)
    embed_images(glb, data, folder)
    # Readers such as trimesh return the UVs of primitives that have a material only.
    if texture is not None:
        material = glb.add_material(texture, uv_set)
    elif not all("material" in target for target in targets):
        material = glb.add("materials", DEFAULT_MATERIAL)
    owned, first = _faces_of_parts(scene.parts, result.face_corners), 0
    for part, target, before, faces in zip(scene.parts, targets, old, owned, strict=True):
        vertices, points = part.corners[result.face_corners[faces] - first], result.uv_faces[faces]
        first += len(part.corners)
        if part.is_mirrored:
            vertices, points = vertices[:, ::-1], points[:, ::-1]
        if len(vertices):
            corners = vertices.reshape(-1), points.reshape(-1)
            _fill(glb, data, target, before, *corners, result.uv, uv_set)
        if texture is not None or "material" not in target:
            target["material"] = material
    _drop_empty(glb, targets)
    return glb


def _separate_primitives(tree: Item, scene: GltfScene) -> list[Item]:
    """Return the primitive of each part, after meshes that several nodes show are copied."""
    meshes, nodes = tree["meshes"], tree["nodes"]
    first_node: dict[int, int] = {}
    for part in scene.parts:
        owner = first_node.setdefault(part.mesh, part.node)
        if owner != part.node and nodes[part.node]["mesh"] == part.mesh:
            nodes[part.node]["mesh"] = len(meshes)
            meshes.append(deepcopy(scene.data.tree["meshes"][part.mesh]))
    return [meshes[nodes[part.node]["mesh"]]["primitives"][part.primitive] for part in scene.parts]


def _faces_of_parts(parts: tuple[ScenePart, ...], face_corners: IntArray) -> list[IntArray]:
    """Return for each part of the scene the triangles of a result, whose corners are in the order of parts."""
    starts = np.cumsum([0] + [len(part.corners) for part in parts])
    owner = np.searchsorted(starts, face_corners[:, 0], side="right") - 1
    order = np.argsort(owner, kind="stable")
    return np.split(order, np.searchsorted(owner[order], np.arange(1, len(parts))))


def _fill(
    glb: Glb,
    data: GltfData,
    target: Item,
    before: Item,
    vertices: IntArray,
    points: IntArray,
    uv: FloatArray,
    uv_set: int,
) -> None:
    """Write the triangles of a primitive, with its vertex and the point in the plane of every corner."""
    vertex, point, number = distinct_pairs(vertices, points, len(uv))
    replaced = _replaced(data, before, uv_set)

    def gathered(arrays: dict[str, int]) -> dict[str, int]:
        copied = ((name, index) for name, index in arrays.items() if name not in replaced)
        return {name: _gathered(glb, data, index, vertex, name == "POSITION") for name, index in copied}

    target["attributes"] = gathered(before["attributes"])
    # v points down in glTF.
    flat = (uv[point] * [1, -1] + [0, 1]).astype("<f4")
    array = glb.add_array(flat, {"componentType": 5126, "type": "VEC2"}, FOR_VERTICES)
    target["attributes"][UV_SETS[uv_set]] = array
    target["attributes"].setdefault(UV_SETS[0], array)
    corners = number.astype("<u4").reshape(-1, 1)
    target["indices"] = glb.add_array(corners, {"componentType": 5125, "type": "SCALAR"}, FOR_INDICES)
    if "targets" in before:
        target["targets"] = [gathered(arrays) for arrays in before["targets"]]
    if before.get("mode", Mode.TRIANGLES) != Mode.TRIANGLES:
        target["mode"] = Mode.TRIANGLES.value


def _replaced(data: GltfData, primitive: Item, uv_set: int) -> tuple[str, ...]:
    """Return the attributes that new UVs replace: also tangents, unless their normal map has other UVs."""
    material = data.item("materials", primitive["material"]) if "material" in primitive else {}
    is_of_normal_map = data.uv_set(data.entry(material, "normalTexture", dict)) == uv_set
    return (UV_SETS[uv_set], "TANGENT") if is_of_normal_map else (UV_SETS[uv_set],)


def _gathered(glb: Glb, data: GltfData, index: int, elements: IntArray, has_bounds: bool) -> int:
    """Add an array with some elements of another one, and return its index."""
    old = data.item("accessors", index)
    rows = np.take(data.raw(index), elements, axis=0)
    form: Item = {key: old[key] for key in _COPIED_FIELDS if key in old}
    if has_bounds:
        form |= bounds(rows.view(data.accessor(index).kind))
    return glb.add_array(rows, form, FOR_VERTICES)


def _drop_empty(glb: Glb, targets: list[Item]) -> None:
    """Remove primitives without remaining triangles after the repair, and meshes without primitives."""
    empty = {id(target) for target in targets if not target["attributes"]}
    if not empty:
        return
    for node in glb.tree["nodes"]:
        mesh = glb.tree["meshes"][node["mesh"]] if "mesh" in node else None
        if mesh is not None and all(id(primitive) in empty for primitive in mesh["primitives"]):
            del node["mesh"]
    for mesh in glb.tree["meshes"]:
        left = [primitive for primitive in mesh["primitives"] if id(primitive) not in empty]
        if not left:
            # Meshes must not be empty, even if no node shows them: they get a point.
            zero = {"componentType": 5126, "count": 1, "type": "VEC3"} | bounds(np.zeros((1, 3)))
            left = [{"attributes": {"POSITION": glb.add("accessors", zero)}, "mode": 0}]
        mesh["primitives"] = left


def scene_losses(result: Flattening, has_texture: bool = False, uv_set: int = 0) -> tuple[str, ...]:
    """Return notes on data of the source glTF file that a GLB of a result changes, one sentence each.

    Args:
        result: the result.
        has_texture: whether a texture replaces the materials of its triangles.
        uv_set: the number of the new UV set.
    """
    source = result.source
    if source is None or source.scene is None or result.face_corners is None:
        return ()
    data, parts = source.scene.data, source.scene.parts
    notes = []
    dropped = sum(len(part.corners) for part in parts) // 3 - len(result.faces)
    if dropped:
        notes.append(f"Triangles that the repair dropped are not in the file: {dropped:,}.")
    shown = {(part.mesh, part.node) for part in parts}
    copies = len(shown) - len({mesh for mesh, _ in shown})
    if copies:
        notes.append(
            f"Meshes of several nodes were copied, to have UVs for each node: {plural(copies, 'copy', 'copies')}."
        )
    primitives = [data.tree["meshes"][part.mesh]["primitives"][part.primitive] for part in parts]
    bare = sum("material" not in primitive for primitive in primitives)
    if bare and not has_texture:
        notes.append(
            f"{plural(bare, 'primitive')} without a material got the default material of glTF, because some programs "
            "read no UVs without one."
        )
    notes += _uv_set_notes(primitives) if uv_set else ()
    if any("TANGENT" in {*item["attributes"]} & {*_replaced(data, item, uv_set)} for item in primitives):
        notes.append("Tangents of the old UVs are not in the file: viewers compute them from the new ones.")
    notes += image_notes(data)
    painted = _painted_materials(data, primitives, uv_set)
    if painted and not has_texture:
        owner = plural(painted, "material")
        outdated = f"The textures of {owner} are kept, but use {UV_SETS[1]}, which is replaced."
        notes.append(outdated if uv_set else old_textures(owner))
    return tuple(notes)


def _uv_set_notes(primitives: list[Item]) -> Iterator[str]:
    """Yield notes on a new second UV set of primitives: on the one it replaces, and on first sets that are missing."""
    replaced = sum(UV_SETS[1] in primitive["attributes"] for primitive in primitives)
    if replaced:
        yield f"{UV_SETS[1]} of {plural(replaced, 'primitive')} is replaced."
    missing = sum(UV_SETS[0] not in primitive["attributes"] for primitive in primitives)
    if missing:
        yield f"{plural(missing, 'primitive')} without UVs got the new ones as {UV_SETS[0]}, too."


def _painted_materials(data: GltfData, primitives: list[Item], uv_set: int) -> int:
    """Return the number of materials of primitives that have textures with a UV set."""
    materials = {primitive["material"] for primitive in primitives if "material" in primitive}
    return sum(uv_set in _uv_sets_of(data, data.item("materials", i)) for i in materials)


def _uv_sets_of(data: GltfData, material: Item) -> set[int]:
    """Return the numbers of the UV sets of a material's textures, those of its extensions among them."""
    slots = (value for name, value in entries_of(material) if name.endswith("Texture"))
    return {data.uv_set(slot) for slot in slots if isinstance(slot, dict)}
