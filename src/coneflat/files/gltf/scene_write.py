"""Writing GLB: the scene of the glTF file that a mesh was read from, with new UVs."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, unquote

import numpy as np
from numpy.typing import NDArray

from ..._arrays import FloatArray, IntArray
from ...errors import ConeflatError, MeshFileError
from ...text import plural
from ..obj_write import moved_path
from ..raw import read_bytes
from ..texture import Texture
from .data import COMPRESSED, GltfData
from .names import accessors_named, keys_of, view_owners, views_named
from .scene import DRACO, TRIANGLES, GltfScene, ScenePart

if TYPE_CHECKING:
    from ...result.flattening import Flattening

UV = "TEXCOORD_0"
MOST_BYTES = 2**32 - 1
#: What an array of some elements has of the whole one.
_KEPT = ("componentType", "type", "normalized", "name", "extras")
#: How files of images that glTF knows begin, and what they are called.
_IMAGES = {
    b"\x89PNG\r\n\x1a\n": "image/png",
    b"\xff\xd8\xff": "image/jpeg",
    b"RIFF": "image/webp",
    b"\xabKTX 20\xbb\r\n\x1a\n": "image/ktx2",
}


def scene_with_uvs(
    result: Flattening, scene: GltfScene, folder: Path, look: dict[str, Any] | None, texture: Texture | None
) -> tuple[dict[str, Any], list[bytes]]:
    """Return the JSON of a glTF scene with the UVs of a result, and its one buffer in pieces.

    Of each primitive, TEXCOORD_0 is new, and every vertex is there as often as it has different UVs; all its other
    attributes and morph targets are copied bit for bit. A mesh that several nodes show becomes one for each node.
    Images beside the file are taken into the buffer. All else stays as it is.

    Args:
        result: of a mesh that was read from the scene, with its `face_corners`.
        scene: what was read.
        folder: where the file will be, for paths of images that are not to be had.
        look: the material for what was flattened; None for the file's own.
        texture: its image.
    """
    writing = _Writing(scene.data, folder)
    writing.rewrite(result, scene.parts, look, texture)
    return writing.tree, writing.pieces


def scene_losses(result: Flattening) -> tuple[str, ...]:
    """Return what a GLB of a result does not keep of the glTF file that it was read from, one sentence each."""
    source = result.source
    if source is None or source.scene is None:
        return ()
    if result.face_corners is None:
        return (
            "The scene of the file is not kept, only the triangles that it shows: the refinement has new ones.",
        )
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


class _Writing:
    """A glTF tree on its way to one buffer, in which the numbers of all that stays are the same as before."""

    def __init__(self, data: GltfData, folder: Path) -> None:
        self._data, self._folder = data, folder
        self.tree = _copied(data.tree)
        self.pieces: list[bytes] = []
        self._length = 0
        self._free_accessors: list[int] = []
        self._free_views: list[int] = []

    def rewrite(
        self,
        result: Flattening,
        parts: tuple[ScenePart, ...],
        look: dict[str, Any] | None,
        texture: Texture | None,
    ) -> None:
        """Give all parts their new UVs."""
        targets = self._own_primitives(parts)
        old = [_copied(target) for target in targets]
        for target in targets:
            target["attributes"] = {}
            target.pop("indices", None)
            target.pop("targets", None)
            target.pop("mode", None)
            target.get("extensions", {}).pop(DRACO, None)
        self._keep_the_rest()
        self._embed_images()
        material = None if look is None else self._add_material(look, texture)
        starts = np.cumsum([0] + [len(part.corners) for part in parts])
        assert result.face_corners is not None
        owner = np.searchsorted(starts, result.face_corners[:, 0], side="right") - 1
        order = np.argsort(owner, kind="stable")
        cuts = np.searchsorted(owner[order], np.arange(1, len(parts)))
        for part, target, before, start, faces in zip(
            parts, targets, old, starts.tolist(), np.split(order, cuts), strict=False
        ):
            vertices = part.corners[result.face_corners[faces] - start]
            points = result.uv_faces[faces]
            if part.is_mirrored:
                vertices, points = vertices[:, ::-1], points[:, ::-1]
            self._fill(target, before, vertices, points, result.uv)
            if material is not None:
                target["material"] = material
        self._drop_empty(targets)
        self._forget_extensions()
        self.tree["buffers"] = [{"byteLength": self._length}]

    def _own_primitives(self, parts: tuple[ScenePart, ...]) -> list[dict[str, Any]]:
        """Return the primitive of each part, after a copy was made of meshes that another node has."""
        meshes, nodes = self.tree["meshes"], self.tree["nodes"]
        first_node: dict[int, int] = {}
        for part in parts:
            owner = first_node.setdefault(part.mesh, part.node)
            if owner != part.node and nodes[part.node]["mesh"] == part.mesh:
                nodes[part.node]["mesh"] = len(meshes)
                meshes.append(_copied(self._data.tree["meshes"][part.mesh]))
        return [meshes[nodes[part.node]["mesh"]]["primitives"][part.primitive] for part in parts]

    def _keep_the_rest(self) -> None:
        """Move what is still referred to into the new buffer, and find the numbers that have become free."""
        tree = self.tree
        accessors, views = set(accessors_named(tree)), set(views_named(tree))
        for i, accessor in enumerate(tree.get("accessors", [])):
            if i in accessors:
                views |= {one["bufferView"] for one in view_owners(accessor)}
            else:
                # What nothing names any more is as small as an accessor can be.
                tree["accessors"][i] = {"componentType": 5121, "count": 1, "type": "SCALAR"}
                self._free_accessors.append(i)
        for i, view in enumerate(tree.get("bufferViews", [])):
            if i in views:
                view["byteOffset"] = self._append(self._data.view(i).tobytes())
                view["buffer"] = 0
                for name in COMPRESSED:
                    view.get("extensions", {}).pop(name, None)
            else:
                tree["bufferViews"][i] = {"buffer": 0, "byteLength": 1}
                self._free_views.append(i)
        # Taken from the end, so that what is new stands in the order in which it is written.
        self._free_accessors.reverse()
        self._free_views.reverse()

    def _fill(
        self,
        target: dict[str, Any],
        before: dict[str, Any],
        vertices: IntArray,
        points: IntArray,
        uv: FloatArray,
    ) -> None:
        """Write the triangles of a primitive, whose corners have these of its vertices and these points."""
        if not len(vertices):
            return
        pairs, number = np.unique(vertices * len(uv) + points, return_inverse=True)
        own, point = np.divmod(pairs, len(uv))
        # v points down in glTF.
        flat = (uv[point] * [1, -1] + [0, 1]).astype("<f4")
        for name, index in before["attributes"].items():
            if name != UV:
                target["attributes"][name] = self._gathered(index, own, name == "POSITION")
        target["attributes"][UV] = self._add_array(flat, {"componentType": 5126, "type": "VEC2"})
        target["indices"] = self._add_array(
            number.astype("<u4").reshape(-1, 1), {"componentType": 5125, "type": "SCALAR"}, is_index=True
        )
        if "targets" in before:
            target["targets"] = [
                {name: self._gathered(index, own, name == "POSITION") for name, index in one.items()}
                for one in before["targets"]
            ]
        if before.get("mode", TRIANGLES) != TRIANGLES:
            target["mode"] = TRIANGLES

    def _gathered(self, index: int, own: IntArray, has_bounds: bool) -> int:
        """Return the number of an array of some elements of another one."""
        old = self._data.item("accessors", index)
        kind = self._data.accessor(index).kind
        rows = np.take(self._data.raw(index), own, axis=0)
        kept: dict[str, Any] = {key: old[key] for key in _KEPT if key in old}
        if has_bounds:
            values = rows.view(kind)
            kept |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self._add_array(rows, kept)

    def _add_array(self, rows: NDArray[Any], form: dict[str, Any], is_index: bool = False) -> int:
        """Return the number of a new accessor."""
        count, size = len(rows), rows.shape[1] * rows.itemsize
        content = np.ascontiguousarray(rows).view(np.uint8).reshape(count, size)
        view: dict[str, Any] = {"buffer": 0, "byteLength": 0, "target": 34963 if is_index else 34962}
        if size % 4 and not is_index:
            # Elements of vertices begin at multiples of four.
            content = np.pad(content, ((0, 0), (0, -size % 4)))
            view["byteStride"] = content.shape[1]
        view |= {"byteOffset": self._append(content.tobytes()), "byteLength": content.size}
        place = _placed(self.tree.setdefault("bufferViews", []), view, self._free_views)
        accessor = {"bufferView": place, "count": count, **form}
        return _placed(self.tree.setdefault("accessors", []), accessor, self._free_accessors)

    def _add_content(self, content: bytes) -> int:
        """Return the number of a new buffer view."""
        view = {"buffer": 0, "byteOffset": self._append(content), "byteLength": len(content)}
        return _placed(self.tree.setdefault("bufferViews", []), view, self._free_views)

    def _append(self, content: bytes) -> int:
        """Return where in the buffer some bytes are now."""
        start = self._length
        if start + len(content) > MOST_BYTES:
            raise MeshFileError(
                f"the scene of {self._data.path} takes more than the 4 GB that a GLB can have: choose .ply or .npz"
            )
        self.pieces.append(content + bytes(-len(content) % 4))
        self._length += len(self.pieces[-1])
        return start

    def _embed_images(self) -> None:
        """Take the files of images into the buffer; of those that cannot be read, make the paths fit."""
        for image in self.tree.get("images", []):
            uri = image.get("uri")
            if not isinstance(uri, str) or uri.startswith("data:") or "://" in uri:
                continue
            try:
                content = read_bytes(self._data.beside(uri))
            except ConeflatError:
                content = b""
            kind = next((kind for head, kind in _IMAGES.items() if content.startswith(head)), None)
            if kind is None:
                old, new = (os.path.realpath(place) for place in (self._data.path.parent, self._folder))
                image["uri"] = quote(moved_path(os.fsencode(unquote(uri)), old, new))
                continue
            del image["uri"]
            image |= {"bufferView": self._add_content(content), "mimeType": kind}

    def _add_material(self, look: dict[str, Any], texture: Texture | None) -> int:
        """Return the number of a new material, and of its image if it has one."""
        tree = self.tree
        if texture is not None:
            place = self._add_content(texture.content)
            image = _placed(
                tree.setdefault("images", []), {"bufferView": place, "mimeType": texture.kind}, []
            )
            number = _placed(tree.setdefault("textures", []), {"source": image}, [])
            look = _copied(look)
            look["pbrMetallicRoughness"]["baseColorTexture"] = {"index": number}
        return _placed(tree.setdefault("materials", []), look, [])

    def _drop_empty(self, targets: list[dict[str, Any]]) -> None:
        """Leave out primitives of which the repair left nothing, and meshes without any."""
        empty = {id(target) for target in targets if not target["attributes"]}
        if not empty:
            return
        for node in self.tree["nodes"]:
            mesh = self.tree["meshes"][node["mesh"]] if "mesh" in node else None
            if mesh is not None and all(id(one) in empty for one in mesh["primitives"]):
                del node["mesh"]
        for mesh in self.tree["meshes"]:
            left = [one for one in mesh["primitives"] if id(one) not in empty]
            mesh["primitives"] = left or [self._point()]

    def _point(self) -> dict[str, Any]:
        """Return a primitive of one point, for meshes that nothing shows: they must not be empty."""
        zero = {"componentType": 5126, "count": 1, "type": "VEC3", "min": [0.0] * 3, "max": [0.0] * 3}
        return {
            "attributes": {"POSITION": _placed(self.tree["accessors"], zero, self._free_accessors)},
            "mode": 0,
        }

    def _forget_extensions(self) -> None:
        """Take compressions that are no more from the lists of extensions."""
        used = set(keys_of(self.tree))
        for name in ("extensionsUsed", "extensionsRequired"):
            if name in self.tree:
                left = [one for one in self.tree[name] if one not in (DRACO, *COMPRESSED) or one in used]
                self.tree[name] = left
                if not left:
                    del self.tree[name]


def _copied(item: Any) -> Any:
    """Return a copy of a tree of JSON, however deep."""
    return json.loads(json.dumps(item))


def _placed(every: list[dict[str, Any]], new: dict[str, Any], free: list[int]) -> int:
    """Return the number under which something new is in a list: one that is free, or the next."""
    if free:
        place = free.pop()
        every[place] = new
        return place
    every.append(new)
    return len(every) - 1
