"""What a glTF scene shows: its triangle primitives, once for every node.

Ours, since a writer must know of each triangle which node, mesh and primitive it came from.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import FloatArray, IntArray
from .data import GltfData, numbers

TRIANGLES, STRIP, FAN = 4, 5, 6
DRACO = "KHR_draco_mesh_compression"


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


def shown_nodes(data: GltfData) -> Iterator[tuple[int, FloatArray]]:
    """Yield the nodes of the scene that the file shows, depth first, each with its (4, 4) transform.

    A file without a scene shows all its nodes.

    Raises:
        MeshFileError: nodes are no trees, or their transforms no numbers.
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
        stack += [(child, matrix) for child in reversed(data.entry(node, "children", list, []))]


def triangle_corners(data: GltfData, primitive: dict[str, Any], count: int) -> IntArray:
    """Return (3 m,) the vertices of the triangles of a primitive that has `count` vertices; none of lines and points.

    Raises:
        MeshFileError: it names a vertex that it does not have.
    """
    mode = data.count(primitive, "mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN):
        return np.empty(0, np.int64)
    order = np.arange(count) if primitive.get("indices") is None else data.indices(primitive["indices"])
    if len(order) and order.max() >= count:
        data.fail(f"a face names vertex {order.max()}, but its primitive has {count} vertices, from 0 on")
    if mode == TRIANGLES:
        return order[: len(order) // 3 * 3]
    i = np.arange(max(len(order) - 2, 0))
    if mode == FAN:
        rows = [i + 1, i + 2, np.zeros_like(i)]
    else:
        rows = [i, i + 1 + i % 2, i + 2 - i % 2]
    triangles = order[np.stack(rows, axis=1)]
    # Strips are joined by triangles that use a vertex twice.
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (c != a)].reshape(-1)


def _roots(data: GltfData) -> list[Any]:
    if data.tree.get("scenes"):
        return list(data.entry(data.item("scenes", data.tree.get("scene", 0)), "nodes", list, []))
    count = len(data.entry(data.tree, "nodes", list, []))
    children = {
        child
        for i in range(count)
        for child in data.entry(data.item("nodes", i), "children", list, [])
        if isinstance(child, int)
    }
    return [i for i in range(count) if i not in children]


def _local(data: GltfData, node: dict[str, Any]) -> FloatArray:
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
