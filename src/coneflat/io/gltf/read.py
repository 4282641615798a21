"""Reading of glTF and GLB scenes as one mesh, with a mapping back to their parts.

This package has its own reader, because libraries do not report the correspondence of corners, and the writer must know
the node, mesh and primitive of each triangle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...errors import EmptyMeshError
from ...mesh.check import weld
from ..attributes import MATERIALS, Attribute
from ..mesh_file import MeshFile
from .data import COMPRESSED, GltfData, Item, numbers
from .references import check_references, keys_of

DRACO = "KHR_draco_mesh_compression"
#: Attributes that are the mesh itself, or the numbers that this package wrote for an earlier one.
_MESH = ("POSITION", "NORMAL", "TEXCOORD_0", "_SOURCE_VERTEX")
#: Maximum number of corners of a scene, counting meshes as often as nodes show them,
MAX_CORNERS = 10_000_000
#: or per byte of the file, whichever is larger.
MAX_CORNERS_PER_BYTE = 8


class Mode(IntEnum):
    """The mode in which the vertices of a primitive form triangles."""

    TRIANGLES = 4
    STRIP = 5
    FAN = 6


class ScenePart(NamedTuple):
    """A primitive of triangles in a node.

    Attributes:
        node, mesh, primitive: their indices, that of the primitive within the mesh.
        corners: (c,) the primitive's vertex at each corner, three for each triangle, with the orientation in the scene.
        is_mirrored: whether triangles have the opposite orientation in the scene and in the primitive.
    """

    node: int
    mesh: int
    primitive: int
    corners: IntArray
    is_mirrored: bool


@dataclass(frozen=True, eq=False)
class GltfScene:
    """A glTF file, and the correspondence of its triangles to those of the mesh that was read.

    Attributes:
        data: the file.
        parts: the parts whose concatenated corners are those of the mesh.
        blocks: start of the vertices of each node, and the end of the last; vertices may be merged only within a node.
    """

    data: GltfData
    parts: tuple[ScenePart, ...]
    blocks: tuple[int, ...]


def is_glb(content: bytes) -> bool:
    """Return True if a file begins as GLB files do."""
    return content.startswith(b"glTF")


def is_gltf(content: bytes) -> bool:
    """Return True if a file begins as an object of JSON."""
    return content[:512].removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"{")


def parse_gltf(path: Path, content: bytes, uv_set: int = 0) -> MeshFile:
    """Return all triangle meshes of the scene as one, in scene coordinates.

    A mesh is repeated for each node that shows it. Lines and points are left out. Skeletons and morph targets are not
    applied. uv_set: the number of the UVs, TEXCOORD_0 for 0.

    Raises:
        EmptyMeshError: the scene shows no triangle.
        MeshFileError: the file is invalid, or its data are compressed in a way that cannot be decoded.
    """
    reading = _Reading(GltfData(path, content), uv_set)
    # NaN coordinates, in the file or after a transform, are not rejected here.
    with np.errstate(all="ignore"):
        for node, matrix in shown_nodes(reading.data):
            mesh = reading.data.item("nodes", node).get("mesh")
            if mesh is not None:
                reading.add_mesh(node, mesh, matrix)
        check_references(reading.data)
        return reading.done()


class _Reading:
    """The state of reading a scene, whose parts are added one after the other."""

    def __init__(self, data: GltfData, uv_set: int) -> None:
        self.data = data
        self._uv_name = f"TEXCOORD_{uv_set}"
        self._max_corners = max(MAX_CORNERS, MAX_CORNERS_PER_BYTE * data.total_bytes)
        self._parts: list[ScenePart] = []
        self._vertices: list[FloatArray] = [np.empty((0, 3))]
        self._corners: list[IntArray] = [np.empty(0, np.int64)]
        self._count = self._taken = 0
        self._blocks = [0]
        self._uvs, self._normals = _Rows(2), _Rows(3)

    def add_mesh(self, node: int, mesh: Any, matrix: FloatArray) -> None:
        """Add the triangles of a mesh that a node shows.

        Raises:
            MeshFileError: they are invalid or compressed, or the scene has too many.
        """
        data = self.data
        linear = matrix[:3, :3]
        is_mirrored = bool(np.linalg.det(linear) < 0)
        # For each array of positions, the first vertex and the number of vertices.
        placed: dict[Any, tuple[int, int]] = {}
        for index, primitive in enumerate(data.entry(data.item("meshes", mesh), "primitives", list)):
            attributes = data.entry(primitive, "attributes", dict)
            position = attributes.get("POSITION")
            if position is None:
                continue
            self._refuse_packed(primitive, position)
            corners = triangle_corners(data, primitive, data.accessor(position).length)
            if not len(corners):
                continue
            if position not in placed:
                points = data.values(position, 3)
                self._take(len(points))
                placed[position] = (self._count, len(points))
                self._vertices.append(points @ linear.T + matrix[:3, 3])
                self._count += len(points)
            first, count = placed[position]
            self._check_copied(primitive, count)
            self._take(len(corners))
            if is_mirrored:
                # A mirroring node reverses the orientation of triangles (Section 3.7.4 of the specification).
                corners = corners.reshape(-1, 3)[:, ::-1].reshape(-1)
            self._parts.append(ScenePart(node, mesh, index, corners, is_mirrored))
            self._corners.append(corners + first)
            self._uvs.add(data, attributes.get(self._uv_name), node, corners)
            self._normals.add(data, attributes.get("NORMAL"), node, corners, _cofactors(linear))
        if self._count > self._blocks[-1]:
            self._blocks.append(self._count)

    def done(self) -> MeshFile:
        """Return the mesh.

        Raises:
            EmptyMeshError: there is no triangle.
        """
        corners = np.concatenate(self._corners)
        if not len(corners):
            raise EmptyMeshError(f"{self.data.path} has no faces: its scene shows no triangle")
        uv, texture = self._uvs.numbered()
        normals, normal = self._normals.numbered()
        return MeshFile(
            self.data.path,
            np.concatenate(self._vertices),
            corners,
            np.arange(0, len(corners) + 1, 3),
            texture=texture,
            # v points down in glTF.
            uv=None if uv is None else uv * [1, -1] + [0, 1],
            normals=normals,
            normal=normal,
            attributes=_attributes(self.data, self._parts),
            scene=GltfScene(self.data, tuple(self._parts), tuple(self._blocks)),
        )

    def _check_copied(self, primitive: Item, count: int) -> None:
        """Raise an error for attribute arrays with fewer entries than the primitive has vertices."""
        data = self.data
        for arrays in (primitive["attributes"], *data.entry(primitive, "targets", list)):
            for name, index in arrays.items():
                if len(data.raw(index)) < count:
                    data.fail(f"a primitive has {name} for {len(data.raw(index))} of its {count} vertices")

    def _take(self, count: int) -> None:
        """Count the vertices or corners of a part before it is added; raise an error if there are too many."""
        self._taken += count
        if self._taken > self._max_corners:
            self.data.fail(
                f"its scene repeats meshes so often that there are over {self._max_corners:,} corners, many times "
                "those in the file; write each mesh once"
            )

    def _refuse_packed(self, primitive: Item, position: Any) -> None:
        packed = DRACO in self.data.entry(primitive, "extensions", dict)
        item = self.data.item("accessors", position)
        if item.get("bufferView") is None and (packed or item.get("sparse") is None):
            save = f"are compressed ({DRACO}); save it without compression"
            self.data.fail(f"the positions of a mesh {save if packed else 'are not in the file'}")


def _attributes(data: GltfData, parts: Sequence[ScenePart]) -> tuple[Attribute, ...]:
    """Return the data of a scene in addition to its mesh."""
    tree = data.tree
    primitives = [tree["meshes"][part.mesh]["primitives"][part.primitive] for part in parts]
    file_primitives = [primitive for mesh in tree["meshes"] for primitive in mesh["primitives"]]
    names = dict.fromkeys(name for primitive in primitives for name in primitive["attributes"])
    attributes = [Attribute("vertex attributes", name) for name in names if name not in _MESH]
    attributes += [Attribute("morph targets")] * any(primitive.get("targets") for primitive in primitives)
    attributes += [MATERIALS] * any("material" in primitive for primitive in primitives)
    attributes += [Attribute("textures")] * bool(tree.get("textures"))
    attributes += [Attribute("nodes")] * (len(tree.get("nodes", [])) > 1)
    attributes += [Attribute(name) for name in ("skins", "animations", "cameras") if tree.get(name)]
    modes = {primitive.get("mode", Mode.TRIANGLES) for primitive in file_primitives}
    attributes += [Attribute("lines and points")] * bool(modes - set(Mode))
    shown_meshes = {part.mesh for part in parts}
    attributes += [Attribute("hidden meshes")] * (len(shown_meshes) < len(tree["meshes"]))
    extensions = (name for name in tree.get("extensionsUsed", []) if name not in (DRACO, *COMPRESSED))
    attributes += [Attribute("extensions", str(name)) for name in extensions]
    return (*attributes, *([Attribute("extras")] if "extras" in set(keys_of(tree)) else []))


class _Rows:
    """The values of an attribute at the corners of all parts."""

    def __init__(self, columns: int) -> None:
        self._rows: list[FloatArray] = []
        self._corners: list[IntArray] = []
        self._starts: dict[tuple[int, int], int] = {}
        self._count, self._columns = 0, columns

    def add(
        self, data: GltfData, index: Any, node: int, corners: IntArray, linear: FloatArray | None = None
    ) -> None:
        """Add the corners of a part; an accessor of None means that the part does not have the attribute.

        linear: (3, 3) transform of the values, equal for all parts of a node.
        """
        if index is None:
            self._corners.append(np.full(len(corners), -1))
            return
        if (node, index) not in self._starts:
            rows = data.values(index, self._columns)
            self._rows.append(rows if linear is None else rows @ linear.T)
            self._starts[node, index] = self._count
            self._count += len(rows)
        self._corners.append(corners + self._starts[node, index])

    def numbered(self) -> tuple[FloatArray | None, IntArray | None]:
        """Return the distinct rows, and (c,) the row of each corner, -1 for none; None, None without any."""
        if not self._rows:
            return None, None
        rows = np.concatenate(self._rows)
        distinct, number = weld(rows)
        return rows[distinct], np.append(number, -1)[np.concatenate(self._corners)]


def _cofactors(linear: FloatArray) -> FloatArray:
    """Return (3, 3) the normal transform of a linear map: its inverse transpose, up to a positive factor."""
    a, b, c = linear.T
    rows = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    return np.asarray(np.copysign(1.0, np.linalg.det(linear)) * rows)


def shown_nodes(data: GltfData) -> Iterator[tuple[int, FloatArray]]:
    """Yield the nodes of the default scene, depth first, each with its (4, 4) transform.

    For a file without scenes, all nodes are yielded.

    Raises:
        MeshFileError: nodes do not form trees, or their transforms are not numbers.
    """
    seen: set[int] = set()
    stack = [(node, np.eye(4)) for node in reversed(_roots(data))]
    while stack:
        index, above = stack.pop()
        node = data.item("nodes", index)
        if index in seen:
            data.fail(f"node {index} is reached twice: nodes must form trees")
        seen.add(index)
        matrix = above @ _local(data, node)
        yield index, matrix
        stack += [(child, matrix) for child in reversed(data.entry(node, "children", list))]


def triangle_corners(data: GltfData, primitive: Item, count: int) -> IntArray:
    """Return (3 m,) the vertices of the triangles of a primitive with `count` vertices; empty for lines and points.

    Raises:
        MeshFileError: it refers to a vertex that does not exist.
    """
    mode = data.count(primitive, "mode", Mode.TRIANGLES)
    if mode not in list(Mode):
        return np.empty(0, np.int64)
    order = np.arange(count) if primitive.get("indices") is None else data.indices(primitive["indices"])
    if len(order) and order.max() >= count:
        data.fail(f"a face refers to vertex {order.max()}, but its primitive has {count} vertices, from 0")
    if mode == Mode.TRIANGLES:
        return order[: len(order) // 3 * 3]
    i = np.arange(max(len(order) - 2, 0))
    if mode == Mode.FAN:
        rows = [i + 1, i + 2, np.zeros_like(i)]
    else:
        rows = [i, i + 1 + i % 2, i + 2 - i % 2]
    triangles = order[np.stack(rows, axis=1)]
    # Strips are connected by degenerate triangles, which are removed.
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (c != a)].reshape(-1)


def _roots(data: GltfData) -> list[Any]:
    if data.tree.get("scenes"):
        return list(data.entry(data.item("scenes", data.tree.get("scene", 0)), "nodes", list))
    nodes = list(data.items("nodes"))
    named = (child for node in nodes for child in data.entry(node, "children", list))
    children = {child for child in named if isinstance(child, int)}
    return [i for i in range(len(nodes)) if i not in children]


def _local(data: GltfData, node: Item) -> FloatArray:
    """Return (4, 4) the transform of a node relative to its parent."""
    if "matrix" in node:
        return numbers(data, node, "matrix", [0.0] * 16).reshape(4, 4).T
    x, y, z, w = numbers(data, node, "rotation", [0.0, 0.0, 0.0, 1.0]).tolist()
    matrix: FloatArray = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= numbers(data, node, "scale", [1.0, 1.0, 1.0])
    matrix[:3, 3] = numbers(data, node, "translation", [0.0, 0.0, 0.0])
    return matrix
