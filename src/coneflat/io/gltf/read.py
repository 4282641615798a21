"""Reading glTF and GLB scenes as one mesh, with the way back to their parts.

Ours, since libraries give a scene's meshes without saying which corner became which, and a writer must know of each
triangle which node, mesh and primitive it came from.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...errors import EmptyMeshError
from ...mesh.check import weld
from ..mesh_file import MeshFile
from .data import GltfData, Item, numbers
from .references import check_references

DRACO = "KHR_draco_mesh_compression"
#: A scene may show its meshes so often that it has as many corners in all,
MOST_CORNERS = 10_000_000
#: or else as many for each byte of the file.
MOST_CORNERS_PER_BYTE = 8


class Mode(IntEnum):
    """How the vertices of a primitive make triangles."""

    TRIANGLES = 4
    STRIP = 5
    FAN = 6


class ScenePart(NamedTuple):
    """A primitive of triangles, as a node shows it.

    Attributes:
        node, mesh, primitive: which, the primitive within the mesh.
        corners: (c,) the primitive's vertex at each corner, three for each triangle, as they run in the scene.
        is_mirrored: triangles run the other way in the scene than in the primitive.
    """

    node: int
    mesh: int
    primitive: int
    corners: IntArray
    is_mirrored: bool


@dataclass(frozen=True, eq=False)
class GltfScene:
    """A glTF file, and which of its triangles are those of the mesh that was read.

    Attributes:
        data: the file.
        parts: whose corners are those of the mesh, one after the other.
        blocks: where the vertices of each node begin, and where the last end; only within a node may they be merged.
    """

    data: GltfData
    parts: tuple[ScenePart, ...]
    blocks: tuple[int, ...]


def parse_gltf(path: Path, content: bytes) -> MeshFile:
    """Return all triangle meshes of the scene as one, in scene coordinates.

    A mesh that several nodes show is there as often as it is shown. Lines and points are left out. What a skeleton or
    a morph target would move stays where it is without.

    Raises:
        EmptyMeshError: the scene shows no triangle.
        MeshFileError: the file is broken, or its data are compressed in a way that cannot be decoded.
    """
    reading = _Reading(GltfData(path, content))
    # What is not a number, or becomes none under a transform, is passed on.
    with np.errstate(all="ignore"):
        for node, matrix in shown_nodes(reading.data):
            mesh = reading.data.item("nodes", node).get("mesh")
            if mesh is not None:
                reading.add_mesh(node, mesh, matrix)
        check_references(reading.data)
        return reading.done()


class _Reading:
    """The parts of a scene, one after the other."""

    def __init__(self, data: GltfData) -> None:
        self.data = data
        self._most = max(MOST_CORNERS, MOST_CORNERS_PER_BYTE * data.total_bytes)
        self._parts: list[ScenePart] = []
        self._vertices: list[FloatArray] = [np.empty((0, 3))]
        self._corners: list[IntArray] = [np.empty(0, np.int64)]
        self._count = self._taken = 0
        self._blocks = [0]
        self._uvs, self._normals = _Rows(2), _Rows(3)

    def add_mesh(self, node: int, mesh: Any, matrix: FloatArray) -> None:
        """Add the triangles of a mesh that a node shows.

        Raises:
            MeshFileError: they are broken or compressed, or there are too many in all.
        """
        data = self.data
        linear = matrix[:3, :3]
        is_mirrored = bool(np.linalg.det(linear) < 0)
        # Of each array of positions, the first vertex and their number.
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
                # The specification turns the winding under a mirroring node (Section 3.7.4).
                corners = corners.reshape(-1, 3)[:, ::-1].reshape(-1)
            self._parts.append(ScenePart(node, mesh, index, corners, is_mirrored))
            self._corners.append(corners + first)
            self._uvs.add(data, attributes.get("TEXCOORD_0"), node, corners)
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
            scene=GltfScene(self.data, tuple(self._parts), tuple(self._blocks)),
        )

    def _check_copied(self, primitive: Item, count: int) -> None:
        """Refuse arrays that are there for some of the vertices only, or not at all."""
        data = self.data
        for each in (primitive["attributes"], *data.entry(primitive, "targets", list)):
            for name, index in each.items():
                if len(data.raw(index)) < count:
                    data.fail(f"a primitive has {name} for {len(data.raw(index))} of its {count} vertices")

    def _take(self, count: int) -> None:
        """Count the vertices or corners that a part adds, before it is added."""
        self._taken += count
        if self._taken > self._most:
            self.data.fail(
                f"its scene shows meshes so often that there are over {self._most:,} corners, many times what the "
                "file holds; write each mesh once"
            )

    def _refuse_packed(self, primitive: Item, position: Any) -> None:
        packed = DRACO in self.data.entry(primitive, "extensions", dict)
        item = self.data.item("accessors", position)
        if item.get("bufferView") is None and (packed or item.get("sparse") is None):
            save = f"are compressed ({DRACO}); save it without compression"
            self.data.fail(f"the positions of a mesh {save if packed else 'are not in the file'}")


class _Rows:
    """What the corners of all parts have of an attribute."""

    def __init__(self, columns: int) -> None:
        self._rows: list[FloatArray] = []
        self._corners: list[IntArray] = []
        self._known: dict[tuple[int, int], int] = {}
        self._count, self._columns = 0, columns

    def add(
        self, data: GltfData, index: Any, node: int, corners: IntArray, linear: FloatArray | None = None
    ) -> None:
        """Add the corners of a part; an accessor of None stands for none.

        linear: (3, 3) what the values are to be transformed by, the same for all parts of a node.
        """
        if index is None:
            self._corners.append(np.full(len(corners), -1))
            return
        if (node, index) not in self._known:
            rows = data.values(index, self._columns)
            self._rows.append(rows if linear is None else rows @ linear.T)
            self._known[node, index] = self._count
            self._count += len(rows)
        self._corners.append(corners + self._known[node, index])

    def numbered(self) -> tuple[FloatArray | None, IntArray | None]:
        """Return the different rows, and (c,) the row of each corner, -1 for none; None, None without any."""
        if not self._rows:
            return None, None
        rows = np.concatenate(self._rows)
        kept, number = weld(rows)
        return rows[kept], np.append(number, -1)[np.concatenate(self._corners)]


def _cofactors(linear: FloatArray) -> FloatArray:
    """Return what turns normals as a (3, 3) matrix turns positions: its inverse transpose times a positive number."""
    a, b, c = linear.T
    rows = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    return np.asarray(np.copysign(1.0, np.linalg.det(linear)) * rows)


def shown_nodes(data: GltfData) -> Iterator[tuple[int, FloatArray]]:
    """Yield the nodes of the scene that the file shows, depth first, each with its (4, 4) transform.

    A file without a scene shows all its nodes.

    Raises:
        MeshFileError: nodes are not trees, or their transforms no numbers.
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
    """Return (3 m,) the vertices of the triangles of a primitive that has `count` vertices; none of lines and points.

    Raises:
        MeshFileError: it names a vertex that it does not have.
    """
    mode = data.count(primitive, "mode", Mode.TRIANGLES)
    if mode not in list(Mode):
        return np.empty(0, np.int64)
    order = np.arange(count) if primitive.get("indices") is None else data.indices(primitive["indices"])
    if len(order) and order.max() >= count:
        data.fail(f"a face names vertex {order.max()}, but its primitive has {count} vertices, from 0 on")
    if mode == Mode.TRIANGLES:
        return order[: len(order) // 3 * 3]
    i = np.arange(max(len(order) - 2, 0))
    if mode == Mode.FAN:
        rows = [i + 1, i + 2, np.zeros_like(i)]
    else:
        rows = [i, i + 1 + i % 2, i + 2 - i % 2]
    triangles = order[np.stack(rows, axis=1)]
    # Strips are joined by triangles that use a vertex twice.
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
    """Return (4, 4) the transform of a node in that above it."""
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
