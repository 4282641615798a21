"""A GLB on its way: its JSON, and its one buffer in pieces.

Ours, since a scene that was read is written with all else under the numbers that it had. Names and numbers are those of
the glTF 2.0 specification (Khronos).
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

MOST_BYTES = 2**32 - 1
#: What a view holds, for the graphics card.
FOR_VERTICES, FOR_INDICES = 34962, 34963
MATERIAL: dict[str, Any] = {
    "name": "coneflat",
    "doubleSided": True,
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.92, 0.92, 0.92, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 0.7,
    },
}


class Glb:
    """What is to be written.

    Attributes:
        tree: the JSON.
    """

    def __init__(self, tree: dict[str, Any]) -> None:
        self.tree = tree
        self._pieces: list[bytes] = []
        self._length = 0
        self._free: defaultdict[str, deque[int]] = defaultdict(deque)

    def free(self, kind: str, number: int, stub: dict[str, Any]) -> None:
        """Let what is new have a number of a list, such as "accessors"; `stub` stands there until then."""
        self.tree[kind][number] = stub
        # Taken from the end, so that what is new stands in the order in which it is written.
        self._free[kind].appendleft(number)

    def add(self, kind: str, item: dict[str, Any]) -> int:
        """Put something new into a list, and return its number there: one that is free, or the next."""
        every = self.tree.setdefault(kind, [])
        if self._free[kind]:
            place = self._free[kind].pop()
            every[place] = item
            return place
        every.append(item)
        return len(every) - 1

    def append(self, content: bytes) -> int:
        """Return where in the buffer some bytes are now."""
        start = self._length
        self._pieces.append(content + bytes(-len(content) % 4))
        self._length += len(self._pieces[-1])
        return start

    def add_view(self, content: bytes, **more: int) -> int:
        """Return the number of a new buffer view."""
        view = {"buffer": 0, "byteOffset": self.append(content), "byteLength": len(content), **more}
        return self.add("bufferViews", view)

    def add_array(self, rows: NDArray[Any], form: dict[str, Any], target: int | None = None) -> int:
        """Return the number of a new accessor of (k, c) values, or of their bytes, with what else is said of it."""
        content = np.ascontiguousarray(rows).view(np.uint8).reshape(len(rows), -1)
        more = {} if target is None else {"target": target}
        if content.shape[1] % 4 and target == FOR_VERTICES:
            # Elements of vertices begin at multiples of four.
            content = np.pad(content, ((0, 0), (0, -content.shape[1] % 4)))
            more["byteStride"] = content.shape[1]
        view = self.add_view(content.tobytes(), **more)
        return self.add("accessors", {"bufferView": view, "componentType": 0, "count": len(rows)} | form)

    def add_material(self, texture: Texture) -> int:
        """Return the number of a new material that shows an image."""
        image = self.add("images", {"bufferView": self.add_view(texture.content), "mimeType": texture.kind})
        shown = {
            "baseColorFactor": [1.0] * 4,
            "baseColorTexture": {"index": self.add("textures", {"source": image})},
        }
        plain = MATERIAL["pbrMetallicRoughness"]
        return self.add("materials", MATERIAL | {"pbrMetallicRoughness": plain | shown})

    def write(self, stream: IO[bytes]) -> None:
        """Write the file.

        Raises:
            MeshFileError: it is larger than GLB can be.
        """
        self.tree["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(self.tree, separators=(",", ":")).encode("ascii")
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self._length
        if total > MOST_BYTES:
            raise MeshFileError(
                f"the result takes {total:,} bytes as GLB, which holds 4 GB at most: choose .ply or .npz"
            )
        stream.write(struct.pack("<4sII I4s", b"glTF", 2, total, len(text), b"JSON"))
        stream.write(text)
        stream.write(struct.pack("<I4s", self._length, b"BIN\0"))
        stream.writelines(self._pieces)


def bounds(values: NDArray[Any]) -> dict[str, Any]:
    """Return what an accessor of positions says of their box."""
    return {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
