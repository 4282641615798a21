"""Reading glTF and GLB scenes as one mesh, with the way back to their parts.

Ours, since libraries give a scene's meshes without saying which corner became which.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...errors import EmptyMeshError
from ...mesh.check import weld
from ..mesh_file import MeshFile
from ..raw import triangle_offsets
from .data import GltfData
from .names import check_references
from .scene import DRACO, GltfScene, ScenePart, shown_nodes, triangle_corners

#: A scene may show its meshes so often that it has as many corners in all,
MOST_CORNERS = 10_000_000
#: or else as many for each byte of the file.
MOST_CORNERS_PER_BYTE = 8


def parse_gltf(path: Path, content: bytes) -> MeshFile:
    """Return all triangle meshes of the scene as one, in scene coordinates.

    A mesh that several nodes show is there as often as it is shown. Lines and points are left out. What a skeleton or
    a morph target would move stays where it is without.

    Raises:
        EmptyMeshError: the scene shows no triangle.
        MeshFileError: the file is broken, or its data are compressed in a way that cannot be decoded.
    """
    reading = _Reading(GltfData(path, content))
    # What is no number, or becomes none under a transform, is passed on.
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
        self._count = self._corner_count = 0
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
        placed: dict[
            Any, tuple[int, int]
        ] = {}  # of each array of positions, the first vertex and their number
        for index, primitive in enumerate(data.entry(data.item("meshes", mesh), "primitives", list, [])):
            attributes = data.entry(primitive, "attributes", dict, {})
            position = attributes.get("POSITION")
            if position is None:
                continue
            self._refuse_packed(primitive, position)
            corners = triangle_corners(data, primitive, data.accessor(position).length)
            if not len(corners):
                continue
            if position not in placed:
                points = data.values(position, 3)
                self._take(len(points), 0)
                placed[position] = (self._count, len(points))
                self._vertices.append(points @ linear.T + matrix[:3, 3])
                self._count += len(points)
            first, count = placed[position]
            self._check_copied(primitive, count)
            self._take(0, len(corners))
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
            triangle_offsets(len(corners) // 3),
            texture=texture,
            # v points down in glTF.
            uv=None if uv is None else uv * [1, -1] + [0, 1],
            normals=normals,
            normal=normal,
            scene=GltfScene(self.data, tuple(self._parts), tuple(self._blocks)),
        )

    def _check_copied(self, primitive: dict[str, Any], count: int) -> None:
        """Refuse arrays that are there for some of the vertices only, or not at all."""
        data = self.data
        for each in (primitive["attributes"], *data.entry(primitive, "targets", list, [])):
            for name, index in each.items():
                if len(data.raw(index)) < count:
                    data.fail(f"a primitive has {name} for {len(data.raw(index))} of its {count} vertices")

    def _take(self, vertices: int, corners: int) -> None:
        """Count what a part adds, before it is added."""
        self._corner_count += corners + vertices
        if self._corner_count > self._most:
            self.data.fail(
                f"its scene shows meshes so often that there are over {self._most:,} corners, many times what the "
                "file holds; write each mesh once"
            )

    def _refuse_packed(self, primitive: dict[str, Any], position: Any) -> None:
        packed = DRACO in self.data.entry(primitive, "extensions", dict, {})
        item = self.data.item("accessors", position)
        if item.get("bufferView") is None and (packed or item.get("sparse") is None):
            how = (
                f"are compressed ({DRACO}); save it without compression" if packed else "are not in the file"
            )
            self.data.fail(f"the positions of a mesh {how}")


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
