"""Where the vertices of choices are on a mesh: projects store it, so that choices outlive changes of the mesh."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import numpy as np

from ... import MeshFile
from ...base import FloatArray, IntArray

#: Positions are stored as differences to one of them, so that single precision suffices far from the origin.
_STORED = np.dtype("<f4")


@dataclass(frozen=True, eq=False)
class Places:
    """The positions of the vertices of choices, and the connectivity of their mesh.

    Attributes:
        connectivity: see `connectivity_hash`.
        points: (k, 3) positions of the vertices of the choices, ascending by vertex.
    """

    connectivity: str
    points: FloatArray

    def as_plain(self) -> dict[str, Any]:
        """Return the places as values for JSON."""
        origin = self.points[0] if len(self.points) else np.zeros(3)
        offsets = (self.points - origin).astype(_STORED).tobytes()
        return {
            "connectivity": self.connectivity,
            "origin": origin.tolist(),
            "offsets": base64.b64encode(offsets).decode("ascii"),
        }

    @classmethod
    def from_plain(cls, plain: Any, count: int) -> Places | None:
        """Return the places of `count` vertices in values from JSON; None if they are not valid, or not as many."""
        try:
            origin = np.array([float(value) for value in plain["origin"]])
            offsets = np.frombuffer(base64.b64decode(plain["offsets"], validate=True), _STORED)
            points = origin + offsets.reshape(count, 3).astype(np.float64)
            return cls(str(plain["connectivity"]), points) if np.isfinite(points).all() else None
        except (KeyError, TypeError, ValueError, binascii.Error):
            return None


@dataclass(frozen=True, eq=False)
class Shape:
    """The vertices of a mesh file, and its connectivity.

    Attributes:
        connectivity: see `connectivity_hash`.
        positions: (n, 3) positions of the vertices.
    """

    connectivity: str
    positions: FloatArray

    def places(self, vertices: IntArray) -> Places | None:
        """Return the places of vertices; None if the mesh does not have them."""
        if len(vertices) and vertices[-1] >= len(self.positions):
            return None
        return Places(self.connectivity, self.positions[vertices])


def shape_of(mesh: MeshFile) -> Shape:
    """Return the shape of a mesh that was read."""
    return Shape(connectivity_hash(len(mesh.vertices), file_edges(mesh)), np.asarray(mesh.vertices))


def file_edges(mesh: MeshFile) -> IntArray:
    """Return (e, 2) the edges of the polygons of a file, without repetition, each with the lower vertex first."""
    following = np.arange(1, len(mesh.corners) + 1)
    following[mesh.offsets[1:] - 1] = mesh.offsets[:-1]
    ends = np.sort(np.column_stack([mesh.corners, mesh.corners[following]]), axis=1)
    count = len(mesh.vertices)
    return np.column_stack(np.divmod(np.unique(ends[:, 0] * count + ends[:, 1]), count))


def connectivity_hash(count: int, edges: IntArray) -> str:
    """Return a hash of a number of vertices and the edges between them; the order of the faces does not change it."""
    return sha256(np.array(count, "<i8").tobytes() + edges.astype("<i8").tobytes()).hexdigest()


def shape_message(shape: Shape, of: str) -> tuple[Mapping[str, str], bytes]:
    """Return a shape as a message between processes; of: the SHA-256 of its file."""
    positions = np.ascontiguousarray(shape.positions, dtype="<f8")
    return {"sha256": of, "connectivity": shape.connectivity}, positions.tobytes()


def shape_received(head: Mapping[str, str], body: bytes) -> Shape:
    """Return the shape in a message of `shape_message`."""
    return Shape(head["connectivity"], np.frombuffer(body, "<f8").reshape(-1, 3))
