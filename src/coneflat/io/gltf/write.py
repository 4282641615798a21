"""Writing of binary glTF: one mesh, or the scene that the mesh was read from, with new UVs and otherwise unchanged.

Objects keep their indices in the lists of the JSON, so that references from unknown extensions, animations and skins
stay valid. For this reason the file is modified and not rebuilt, as libraries do. Names and numbers are those of the
glTF 2.0 specification (Khronos).
"""

from __future__ import annotations

import json
import os
import struct
from collections import defaultdict, deque
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import IO, Any
from urllib.parse import quote, unquote

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import FloatArray, IntArray
from ...base.text import list_some, plural, printable
from ...errors import ConeflatError, MeshFileError
from ...geometry.triangles import vertex_normals
from ...result import Flattening
from ..attributes import ALPHA, MAX_NAME, VERTEX_COLOURS, Attribute, old_textures
from ..colours import linear_colours, stored_shades
from ..files import moved_path, read_bytes
from ..mesh_file import MeshFile
from ..split import distinct_pairs, input_vertices, shading_normals, source_normals, split_at_seams
from ..texture import Texture, image_kind
from .data import COMPRESSED, GltfData, Item
from .positions import local_positions
from .read import DRACO, GltfScene, Mode, ScenePart
from .references import accessors_of_arrays, keys_of, numbers_in_extensions, view_owners, views_of_images

#: Targets of buffer views, for the graphics card.
FOR_VERTICES, FOR_INDICES = 34962, 34963
MATERIAL: Item = {
    "name": "coneflat",
    "doubleSided": True,
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.92, 0.92, 0.92, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 0.7,
    },
}
#: It equals that of primitives without a material, by the specification.
DEFAULT_MATERIAL: Item = {"name": "default"}
UV, COLOUR = "TEXCOORD_0", "COLOR_0"
#: Keys of an accessor that are copied to the accessor of a subset of its elements.
_COPIED_FIELDS = ("componentType", "type", "normalized", "name", "extras")


class Glb:
    """The content of a GLB file while it is built.

    Attributes:
        tree: the JSON.
    """

    def __init__(self, tree: Item) -> None:
        self.tree = tree
        self._pieces: list[bytes] = []
        self._length = 0
        self._free: defaultdict[str, deque[int]] = defaultdict(deque)

    def release(self, kind: str, number: int, stub: Item) -> None:
        """Release an index of a list, such as "accessors", for new objects; `stub` is a placeholder until then."""
        self.tree[kind][number] = stub
        # Indices are taken from the end, so that new objects are in the order in which they are written.
        self._free[kind].appendleft(number)

    def add(self, kind: str, item: Item) -> int:
        """Add an object to a list, and return its index: a released one, or the next."""
        every = self.tree.setdefault(kind, [])
        place = self._free[kind].pop() if self._free[kind] else len(every)
        every[place : place + 1] = [item]
        return place

    def append(self, content: bytes) -> int:
        """Append bytes to the buffer, and return their position."""
        start = self._length
        self._pieces.append(content + bytes(-len(content) % 4))
        self._length += len(self._pieces[-1])
        return start

    def add_view(self, content: bytes, **properties: int) -> int:
        """Add a buffer view, and return its index."""
        view = {"buffer": 0, "byteOffset": self.append(content), "byteLength": len(content), **properties}
        return self.add("bufferViews", view)

    def add_array(self, rows: NDArray[Any], form: Item, target: int | None = None) -> int:
        """Add an accessor of (k, c) values, or of their bytes, with further keys, and return its index."""
        content = np.ascontiguousarray(rows).view(np.uint8).reshape(len(rows), -1)
        properties = {} if target is None else {"target": target}
        if content.shape[1] % 4 and target == FOR_VERTICES:
            # Vertex attributes must be aligned to multiples of four bytes.
            content = np.pad(content, ((0, 0), (0, -content.shape[1] % 4)))
            properties["byteStride"] = content.shape[1]
        view = self.add_view(content.tobytes(), **properties)
        return self.add("accessors", {"bufferView": view, "componentType": 0, "count": len(rows)} | form)

    def add_material(self, texture: Texture) -> int:
        """Add a material with an image as its texture, and return its index."""
        image = self.add("images", {"bufferView": self.add_view(texture.content), "mimeType": texture.kind})
        colour = {"index": self.add("textures", {"source": image})}
        shown = {"baseColorFactor": [1.0] * 4, "baseColorTexture": colour}
        plain = MATERIAL["pbrMetallicRoughness"]
        return self.add("materials", MATERIAL | {"pbrMetallicRoughness": plain | shown})

    def copy_arrays(self, data: GltfData) -> None:
        """Copy the arrays of a scene that the tree refers to into the buffer, and release the indices of all others."""
        tree = self.tree
        maybe = set(numbers_in_extensions(tree))
        accessors, views = maybe.union(accessors_of_arrays(tree)), maybe.union(views_of_images(tree))
        for i, accessor in enumerate(tree.get("accessors", [])):
            if i in accessors:
                views |= {item["bufferView"] for item in view_owners(accessor)}
            else:
                # The placeholder is the smallest possible accessor.
                self.release("accessors", i, {"componentType": 5121, "count": 1, "type": "SCALAR"})
        for i, view in enumerate(tree.get("bufferViews", [])):
            if i in views:
                view["byteOffset"] = self.append(data.view(i).tobytes())
                view["buffer"] = 0
                for name in COMPRESSED:
                    view.get("extensions", {}).pop(name, None)
            else:
                self.release("bufferViews", i, {"buffer": 0, "byteLength": 1})
        names = set(keys_of(tree))
        for name in ("extensionsUsed", "extensionsRequired"):
            removed = {DRACO, *COMPRESSED} - names
            left = [extension for extension in tree.pop(name, []) if extension not in removed]
            if left:
                tree[name] = left

    def write(self, stream: IO[bytes]) -> None:
        """Write the file.

        Raises:
            MeshFileError: it is larger than GLB can be.
        """
        self.tree["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(self.tree, separators=(",", ":")).encode("ascii")
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self._length
        if total >= 2**32:
            raise MeshFileError(
                f"the result takes {total:,} bytes as GLB, which is limited to 4 GB: choose .ply or .npz"
            )
        stream.write(struct.pack("<4sII I4s", b"glTF", 2, total, len(text), b"JSON"))
        stream.write(text)
        stream.write(struct.pack("<I4s", self._length, b"BIN\0"))
        stream.writelines(self._pieces)


def bounds(values: NDArray[Any]) -> Item:
    """Return the minimum and maximum of (k, c) positions, as an accessor needs them."""
    return {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}


def write_glb(result: Flattening, stream: IO[bytes], texture: Texture | None, folder: Path) -> None:
    """Write a result as GLB.

    For a mesh that was read from a glTF scene, the scene is written with new UVs. Otherwise the file has one mesh, with
    a two-sided material that is plain or has a texture. Every vertex has its UV as TEXCOORD_0 (with v pointing down, as
    glTF defines it), the input's normal or else that of the uncut surface, its colour as COLOR_0 if the input has
    colours and there is no texture, and its vertex in the input as _SOURCE_VERTEX. All these except colours are 32-bit
    floats, the only type that glTF has for them: source vertices are exact up to 2^24. Positions of a model far from
    the origin are relative to its node, whose translation is in doubles.

    Args:
        result: the result to write.
        stream: a binary file.
        texture: the image of the material; None for a light grey, or the scene's own materials.
        folder: folder of the file, for relative paths of images that cannot be read.

    Raises:
        MeshFileError: the file would be larger than GLB permits.
    """
    scene = None if result.source is None or result.face_corners is None else result.source.scene
    glb = _one_mesh(result, texture) if scene is None else scene_with_uvs(result, scene, folder, texture)
    glb.write(stream)


def _one_mesh(result: Flattening, texture: Texture | None) -> Glb:
    """Return a scene with one mesh."""
    split = split_at_seams(result, source_normals(result))
    normals = split.normals
    if normals is None:
        normals = shading_normals(vertex_normals(result.vertices, result.faces))[split.vertex]
    places, colours = local_positions(split.vertices), None
    if texture is None and result.source is not None and result.face_corners is not None:
        colours = linear_colours(result.source)
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
    for name, kind, values in (
        ("POSITION", "VEC3", places.local),
        ("NORMAL", "VEC3", normals),
        ("TEXCOORD_0", "VEC2", split.uv * [1, -1] + [0, 1]),
        ("_SOURCE_VERTEX", "SCALAR", split.origin.reshape(-1, 1)),
    ):
        stored = values.astype("<f4")
        form = {"componentType": 5126, "type": kind} | (bounds(stored) if name == "POSITION" else {})
        primitive["attributes"][name] = glb.add_array(stored, form)
    if colours is not None:
        # 16 bits keep all of the 256 steps of sRGB.
        stored = stored_shades(colours[input_vertices(result)[split.vertex]], "<u2")
        form = {"componentType": 5123, "type": "VEC4", "normalized": True}
        primitive["attributes"][COLOUR] = glb.add_array(stored, form, FOR_VERTICES)
        # The material multiplies the colours.
        plain = MATERIAL["pbrMetallicRoughness"] | {"baseColorFactor": [1.0] * 4}
        glb.add("materials", MATERIAL | {"pbrMetallicRoughness": plain})
    elif texture is None:
        glb.add("materials", MATERIAL)
    else:
        glb.add_material(texture)
    return glb


def kept_in_glb(source: MeshFile) -> set[Attribute]:
    """Return the attributes of a source file that `write_glb` keeps: those of a scene, or colours of vertices."""
    if source.scene is not None:
        return set(source.attributes)
    return {VERTEX_COLOURS, ALPHA} if source.has_colours else set()


def scene_with_uvs(result: Flattening, scene: GltfScene, folder: Path, texture: Texture | None) -> Glb:
    """Return a glTF scene with the UVs of a result.

    In each primitive, TEXCOORD_0 is new, and every vertex is repeated for each of its UVs; all other attributes and
    morph targets are copied bit for bit, except tangents of the old UVs, which are those of the normal map. A mesh
    that several nodes show is copied for each node. Image files are embedded in the buffer. All other data is
    unchanged.

    Args:
        result: the result for a mesh that was read from the scene, with its `face_corners`.
        scene: the scene that was read.
        folder: folder of the file, for relative paths of images that cannot be read.
        texture: texture of the flattened parts, instead of the file's materials.
    """
    assert result.face_corners is not None
    data, glb = scene.data, Glb(deepcopy(scene.data.tree))
    targets = _own_primitives(glb.tree, scene)
    old = [deepcopy(target) for target in targets]
    for target in targets:
        target["attributes"] = {}
        for name in ("indices", "targets", "mode"):
            target.pop(name, None)
        target.get("extensions", {}).pop(DRACO, None)
    glb.copy_arrays(data)
    _embed_images(glb, data, folder)
    # Readers such as trimesh return the UVs of primitives that have a material only.
    if texture is not None:
        material = glb.add_material(texture)
    elif not all("material" in target for target in targets):
        material = glb.add("materials", DEFAULT_MATERIAL)
    owned, first = _faces_of_parts(scene.parts, result.face_corners), 0
    for part, target, before, faces in zip(scene.parts, targets, old, owned, strict=True):
        vertices, points = part.corners[result.face_corners[faces] - first], result.uv_faces[faces]
        first += len(part.corners)
        if part.is_mirrored:
            vertices, points = vertices[:, ::-1], points[:, ::-1]
        if len(vertices):
            _fill(glb, data, target, before, vertices.reshape(-1), points.reshape(-1), result.uv)
        if texture is not None or "material" not in target:
            target["material"] = material
    _drop_empty(glb, targets)
    return glb


def scene_losses(result: Flattening, has_texture: bool = False) -> tuple[str, ...]:
    """Return notes on data of the source glTF file that a GLB of a result changes, one sentence each.

    Args:
        result: the result.
        has_texture: whether a texture replaces the materials of its triangles.
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
    if any("TANGENT" in item["attributes"] and "TANGENT" in _replaced(data, item) for item in primitives):
        notes.append("Tangents of the old UVs are not in the file: viewers compute them from the new ones.")
    notes += _image_notes(data)
    painted = _painted_materials(data.tree, primitives)
    if painted and not has_texture:
        notes.append(old_textures(plural(painted, "material")))
    return tuple(notes)


def _image_notes(data: GltfData) -> list[str]:
    """Return a note on image files of a scene that cannot be embedded, if there are any."""
    unread_images = [
        printable(image["uri"])[:MAX_NAME]
        for image in image_files(data.tree)
        if not _content_of(data, image["uri"])
    ]
    if not unread_images:
        return []
    return [
        f"{plural(len(unread_images), 'image file is', 'image files are')} not embedded, because nothing can be "
        f"read there, or because it is outside the folder of the scene: {list_some(unread_images)}."
    ]


def _painted_materials(tree: Item, primitives: list[Item]) -> int:
    """Return the number of materials of primitives that have textures."""
    materials = {primitive["material"] for primitive in primitives if "material" in primitive}
    return sum(any(name.endswith("Texture") for name in keys_of(tree["materials"][i])) for i in materials)


def _own_primitives(tree: Item, scene: GltfScene) -> list[Item]:
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
    glb: Glb, data: GltfData, target: Item, before: Item, vertices: IntArray, points: IntArray, uv: FloatArray
) -> None:
    """Write the triangles of a primitive, with its vertex and the point in the plane of every corner."""
    vertex, point, number = distinct_pairs(vertices, points, len(uv))
    replaced = _replaced(data, before)

    def gathered(arrays: dict[str, int]) -> dict[str, int]:
        copied = ((name, index) for name, index in arrays.items() if name not in replaced)
        return {name: _gathered(glb, data, index, vertex, name == "POSITION") for name, index in copied}

    target["attributes"] = gathered(before["attributes"])
    # v points down in glTF.
    flat = (uv[point] * [1, -1] + [0, 1]).astype("<f4")
    target["attributes"][UV] = glb.add_array(flat, {"componentType": 5126, "type": "VEC2"}, FOR_VERTICES)
    corners = number.astype("<u4").reshape(-1, 1)
    target["indices"] = glb.add_array(corners, {"componentType": 5125, "type": "SCALAR"}, FOR_INDICES)
    if "targets" in before:
        target["targets"] = [gathered(arrays) for arrays in before["targets"]]
    if before.get("mode", Mode.TRIANGLES) != Mode.TRIANGLES:
        target["mode"] = Mode.TRIANGLES.value


def _replaced(data: GltfData, primitive: Item) -> tuple[str, ...]:
    """Return the attributes that new UVs replace: also tangents, unless their normal map has other UVs."""
    material = data.item("materials", primitive["material"]) if "material" in primitive else {}
    return (UV,) if data.uv_set(data.entry(material, "normalTexture", dict)) else (UV, "TANGENT")


def _gathered(glb: Glb, data: GltfData, index: int, elements: IntArray, has_bounds: bool) -> int:
    """Add an array with some elements of another one, and return its index."""
    old = data.item("accessors", index)
    rows = np.take(data.raw(index), elements, axis=0)
    form: Item = {key: old[key] for key in _COPIED_FIELDS if key in old}
    if has_bounds:
        form |= bounds(rows.view(data.accessor(index).kind))
    return glb.add_array(rows, form, FOR_VERTICES)


def _embed_images(glb: Glb, data: GltfData, folder: Path) -> None:
    """Embed image files in the buffer; for those that cannot be read, rewrite the relative paths."""
    for image in image_files(glb.tree):
        uri = image["uri"]
        content = _content_of(data, uri)
        kind = image_kind(content)
        if kind is None or kind == "image/gif":  # glTF does not support GIF
            source, target = (os.path.realpath(place) for place in (data.path.parent, folder))
            image["uri"] = quote(moved_path(os.fsencode(unquote(uri)), source, target))
            continue
        del image["uri"]
        image |= {"bufferView": glb.add_view(content), "mimeType": kind}


def image_files(tree: Item) -> Iterator[Item]:
    """Yield the images of a scene that are files of their own."""
    for image in tree.get("images", []):
        uri = image.get("uri")
        if isinstance(uri, str) and not uri.startswith("data:") and "://" not in uri:
            yield image


def _content_of(data: GltfData, uri: str) -> bytes:
    """Return the content of an image file; empty if it cannot be read, or is outside the folder of the scene."""
    try:
        return read_bytes(data.resolve(uri))
    except ConeflatError:
        return b""


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
