"""The JSON and the arrays of glTF 2.0 files; references and sizes are validated before memory is allocated.

This package has its own reader, because no library keeps all data that a written GLB must reproduce, or validates sizes
before allocation. Names and numbers are those of the specification (Khronos, glTF 2.0, Sections 3.6, 4.4).
"""

from __future__ import annotations

import base64
import binascii
import json
import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeAlias
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import FloatArray, IntArray
from ...errors import ConeflatError, MeshFileError
from ..files import inner_path, read_bytes

#: An object of the JSON.
Item: TypeAlias = dict[str, Any]
#: (k, b) the bytes of the elements of an array.
ByteRows: TypeAlias = NDArray[np.uint8]
#: The numeric types by component type.
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
#: Rows and columns of an element.
SHAPES = {
    "SCALAR": (1, 1), "VEC2": (2, 1), "VEC3": (3, 1), "VEC4": (4, 1), "MAT2": (2, 2), "MAT3": (3, 3), "MAT4": (4, 4),
}  # fmt: skip
COMPRESSED = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_HEADER = struct.Struct("<4sII")
_CHUNK = struct.Struct("<I4s")


class Accessor(NamedTuple):
    """The type and size of an array from the JSON, validated except for its position in the buffer."""

    kind: np.dtype[Any]
    rows: int
    columns: int
    length: int

    @property
    def item_bytes(self) -> int:
        """Return the bytes of an element; columns of matrices begin at multiples of four."""
        column = self.rows * self.kind.itemsize
        return column if self.columns == 1 else self.columns * (column + -column % 4)


class GltfData:
    """The JSON tree of a glTF file, and the arrays that it refers to.

    Attributes:
        path: the file.
        tree: the JSON.
    """

    def __init__(self, path: Path, content: bytes) -> None:
        """Open a .gltf or .glb file.

        Raises:
            MeshFileError: it is not a glTF file, is truncated, or refers to a missing buffer.
        """
        self.path = path
        text, binary = _chunks(path, content) if content[:4] == b"glTF" else (content, None)
        try:
            tree = json.loads(text.decode("utf-8-sig"))
        except RecursionError as error:
            raise MeshFileError(f"{path}: its JSON is nested too deeply") from error
        except ValueError as error:
            raise MeshFileError(f"{path} is not a readable glTF file: invalid JSON: {error}") from error
        if not isinstance(tree, dict):
            raise MeshFileError(f"{path} is not a glTF file: its JSON is not an object")
        self.tree: Item = tree
        version = str(self.entry(tree, "asset", dict).get("version", "2.0"))
        if not version.startswith("2."):
            raise MeshFileError(f"{path} is glTF of version {version[:20]}; convert it to version 2.0")
        self._buffers = self._find_buffers(binary)
        sizes = {id(buffer): len(buffer) for buffer in self._buffers if buffer is not None}
        self.total_bytes = len(content) + sum(sizes.values())
        self._refuse_compressed()
        self._check_names()

    def _check_names(self) -> None:
        """Raise an error for names that are not strings: a written GLB keeps them, and other programs reject them."""
        for kind, items in self.tree.items():
            for i, item in enumerate(items if isinstance(items, list) else ()):
                if isinstance(item, dict) and not isinstance(item.get("name", ""), str):
                    self.fail(f"the name of {kind[:40]} {i} is {item['name']!r:.40}, not a string")

    def fail(self, reason: str) -> NoReturn:
        """Raise an error about the file.

        Raises:
            MeshFileError: always.
        """
        raise MeshFileError(f"{self.path}: {reason}")

    def entry(self, item: Item, name: str, kind: type[Any]) -> Any:
        """Return the list or object with a name in an object, or an empty one; raise an error for another type."""
        value = item.get(name, kind()) if isinstance(item, dict) else None
        if not isinstance(value, kind):
            self.fail(f"{name!r} is not {'a list' if kind is list else 'an object'}")
        return value

    def item(self, name: str, index: Any) -> Item:
        """Return an object of one of the tree's lists, such as "meshes"."""
        every = self.entry(self.tree, name, list)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(every):
            self.fail(f"{str(index)[:20]} is not one of its {len(every)} {name}")
        if not isinstance(every[index], dict):
            self.fail(f"entry {index} of its {name} is not an object")
        return Item(every[index])

    def items(self, name: str) -> Iterator[Item]:
        """Yield the objects of one of the tree's lists."""
        return (self.item(name, i) for i in range(len(self.entry(self.tree, name, list))))

    def view(self, index: Any) -> memoryview:
        """Return the bytes of a buffer view."""
        view = self.item("bufferViews", index)
        buffer = self._buffer_of(view)
        start, length = self.count(view, "byteOffset", 0), self.count(view, "byteLength")
        if buffer is None:
            self.fail(f"buffer view {index} has no data")
        if start + length > len(buffer):
            self.fail(
                f"buffer view {index} ends at {start + length:,} of the {len(buffer):,} bytes of its buffer"
            )
        return memoryview(buffer)[start : start + length]

    def accessor(self, index: Any) -> Accessor:
        """Return the type and size of an accessor's array."""
        item = self.item("accessors", index)
        kind = COMPONENTS.get(self.count(item, "componentType"))
        shape = SHAPES.get(str(item.get("type")))
        if kind is None or shape is None:
            self.fail(f"accessor {index} has an unknown type")
        return Accessor(np.dtype(kind), *shape, self.count(item, "count"))

    def raw(self, index: Any) -> ByteRows:
        """Return (count, b) the bytes of each element of an array.

        Raises:
            MeshFileError: it ends outside its buffer, or has more elements than the file has bytes.
        """
        item, form = self.item("accessors", index), self.accessor(index)
        if form.length > self.total_bytes:
            self.fail(f"accessor {index} has {form.length:,} elements, more than the file has bytes")
        if item.get("bufferView") is None:
            rows = np.zeros((form.length, form.item_bytes), np.uint8)
        else:
            stride = self.item("bufferViews", item["bufferView"]).get("byteStride")
            rows = self._rows(index, item, form.length, form.item_bytes, stride)
        sparse = item.get("sparse")
        if sparse is not None:
            rows = self._with_sparse(index, self.entry(item, "sparse", dict), rows)
        return rows

    def values(self, index: Any, columns: int) -> FloatArray:
        """Return (count, columns) an array of vectors as doubles; normalized integers are converted to fractions.

        Raises:
            MeshFileError: as of `raw`; or it has another number of columns.
        """
        form = self.accessor(index)
        if form.columns != 1 or form.rows != columns:
            self.fail(f"accessor {index} has {form.rows * form.columns} numbers per element, not {columns}")
        numbers = np.ascontiguousarray(self.raw(index)).view(form.kind).astype(np.float64)
        if self.item("accessors", index).get("normalized") and form.kind.kind in "iu":
            numbers = np.maximum(numbers / np.iinfo(form.kind).max, -1.0)
        return numbers

    def indices(self, index: Any) -> IntArray:
        """Return (count,) an array of indices."""
        form = self.accessor(index)
        if form.kind.kind != "u" or form.rows * form.columns != 1:
            self.fail(f"accessor {index} does not contain indices")
        return np.ascontiguousarray(self.raw(index)).view(form.kind).reshape(-1).astype(np.int64)

    def count(self, item: Item, name: str, default: int | None = None) -> int:
        """Return the integer, 0 or more, with a name in an object."""
        value = item.get(name, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            self.fail(f"{name!r} is {str(value)[:20]}, not an integer from 0")
        return value

    def uv_set(self, slot: Item) -> int:
        """Return the number of the UVs that a property of a material, such as "normalTexture", refers to."""
        extensions = self.entry(slot, "extensions", dict)
        return self.count(slot | self.entry(extensions, "KHR_texture_transform", dict), "texCoord", 0)

    def resolve(self, uri: str) -> Path:
        """Return the path of a URI that is relative to this file.

        Raises:
            MeshFileError: it is outside the folder of this file.
        """
        return inner_path(self.path.parent, unquote(uri))

    def _rows(self, index: Any, item: Item, count: int, size: int, stride: int | None = None) -> ByteRows:
        """Return (count, size) bytes of the buffer view that an accessor, or a part of it, refers to."""
        data = self.view(item.get("bufferView"))
        start = self.count(item, "byteOffset", 0)
        step = size if stride is None else self.count({"byteStride": stride}, "byteStride")
        if step < size:
            self.fail(f"the elements of accessor {index} overlap: byteStride is {step}")
        end = start + step * (count - 1) + size if count else start
        if end > len(data):
            self.fail(f"accessor {index} ends at {end:,} of the {len(data):,} bytes of its buffer view")
        return np.ndarray((count, size), np.uint8, data, start, (step, 1))

    def _with_sparse(self, index: Any, sparse: Item, rows: ByteRows) -> ByteRows:
        """Return an array with the elements replaced that the sparse accessor lists."""
        count = self.count(sparse, "count")
        indices, values = self.entry(sparse, "indices", dict), self.entry(sparse, "values", dict)
        form = COMPONENTS.get(self.count(indices, "componentType"))
        if form is None or form[1] != "u":
            self.fail(f"the sparse indices of accessor {index} have an unknown type")
        width = np.dtype(form).itemsize
        places = np.ascontiguousarray(self._rows(index, indices, count, width)).view(form).reshape(-1)
        if len(places) and places.max() >= len(rows):
            self.fail(f"accessor {index} replaces element {places.max()} of {len(rows)}")
        rows = rows.copy()
        rows[places] = self._rows(index, values, count, rows.shape[1])
        return rows

    def _find_buffers(self, binary: bytes | None) -> list[bytes | None]:
        """Return the content of each buffer; None for a placeholder of compressed data."""
        contents: dict[Path, bytes] = {}
        buffers: list[bytes | None] = []
        for i, item in enumerate(self.items("buffers")):
            uri, length = item.get("uri"), self.count(item, "byteLength")
            if uri is None:
                buffer = binary if i == 0 else None
            elif not isinstance(uri, str):
                self.fail(f"the URI of buffer {i} is not a string")
            elif uri.startswith("data:"):
                buffer = self.decoded(uri, f"buffer {i}")
            elif "://" in uri:
                self.fail(f"buffer {i} is at {uri[:60]!r}, but remote files are not loaded")
            else:
                try:
                    path = self.resolve(uri)
                    buffer = contents[path] = contents[path] if path in contents else read_bytes(path)
                except ConeflatError as error:
                    raise MeshFileError(f"{self.path}: buffer {i} cannot be read: {error}") from error
            if buffer is not None and len(buffer) < length:
                self.fail(f"buffer {i} has {len(buffer):,} of the {length:,} bytes it should have")
            buffers.append(buffer)
        return buffers

    def decoded(self, uri: str, owner: str) -> bytes:
        """Return the decoded content of a data URI."""
        head, comma, body = uri.partition(",")
        try:
            if not comma:
                raise ValueError("no comma")
            return base64.b64decode(unquote(body)) if head.endswith(";base64") else unquote_to_bytes(body)
        except (binascii.Error, ValueError) as error:
            raise MeshFileError(f"{self.path}: the data URI of {owner} is invalid: {error}") from error

    def _buffer_of(self, view: Item) -> bytes | None:
        self.item("buffers", view.get("buffer"))
        return self._buffers[view["buffer"]]

    def _refuse_compressed(self) -> None:
        """Raise an error for buffer views that have only compressed data."""
        for view in self.items("bufferViews"):
            extensions = self.entry(view, "extensions", dict)
            for name in COMPRESSED:
                if extensions.get(name) is not None and self._buffer_of(view) is None:
                    self.fail(f"its data are compressed ({name}); save it without compression")


def numbers(data: GltfData, item: Item, name: str, default: list[float]) -> FloatArray:
    """Return (k,) a list of finite numbers, of the same length as the default."""
    values = item.get(name, default)
    count = len(values) if isinstance(values, list) else -1
    if count != len(default) or not all(isinstance(v, (int, float)) and math.isfinite(v) for v in values):
        data.fail(f"the {name} of a node must be {len(default)} finite numbers")
    return np.array(values, dtype=np.float64)


def _chunks(path: Path, content: bytes) -> tuple[bytes, bytes | None]:
    """Return the JSON and the binary chunk of a GLB file."""
    if len(content) < _HEADER.size + _CHUNK.size:
        raise MeshFileError(f"{path} ends within its header")
    _, version, total = _HEADER.unpack_from(content)
    if version != 2:
        raise MeshFileError(f"{path} is GLB of version {version}; convert it to version 2")
    if total > len(content):
        raise MeshFileError(
            f"{path} is truncated: it has {len(content):,} of the {total:,} bytes that its header declares"
        )
    chunks: dict[bytes, bytes] = {}
    place = _HEADER.size
    while place + _CHUNK.size <= total:
        length, kind = _CHUNK.unpack_from(content, place)
        place += _CHUNK.size
        if place + length > total:
            raise MeshFileError(f"{path} ends within one of its chunks")
        chunks.setdefault(kind, content[place : place + length])
        place += length
    if b"JSON" not in chunks:
        raise MeshFileError(f"{path} is not a readable GLB file: it has no JSON chunk")
    return chunks[b"JSON"], chunks.get(b"BIN\0")
