"""The binary form of glTF (GLB) while it is built: its JSON and its buffer.

Names and numbers are those of the glTF 2.0 specification (Khronos).
"""

from __future__ import annotations

import json
import struct
from collections import defaultdict, deque
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ...errors import MeshFileError
from ..texture import Texture
from .data import COMPRESSED, GltfData, Item
from .read import DRACO
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

    def add_material(self, texture: Texture, uv_set: int = 0) -> int:
        """Add a material with an image as its texture, by the UVs of a set, and return its index."""
        image = self.add("images", {"bufferView": self.add_view(texture.content), "mimeType": texture.kind})
        colour = {"index": self.add("textures", {"source": image})}
        colour |= {"texCoord": uv_set} if uv_set else {}
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
