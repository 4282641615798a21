"""Quad meshes on a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base import BoolArray, EntryPoint, FloatArray, IntArray, dots, mask_of, plural
from ..mesh import label_components, sort_pairs
from ..mesh.connectivity import TriangleMesh

if TYPE_CHECKING:
    from ..io.mesh_file import MeshFile
    from .integer_map import IntegerGrid

# Files and UVs are made of quad meshes, so their modules import this one.
_WRITE = EntryPoint[Path]("quadmesh.files:write_quads")
_READ = EntryPoint["QuadMesh"]("quadmesh.files:read_quads")
_UV = EntryPoint[FloatArray]("quadmesh.domains:quad_uv")


@dataclass(frozen=True, eq=False)
class QuadMesh:
    """A manifold quad mesh whose vertices lie on a triangle mesh.

    Attributes:
        vertices: (q, 3) positions on the surface; those of symmetric quads of a surface whose polygons are divided at
            other diagonals on both sides may be off it, by less than 0.1 edges of its triangles.
        quads: (p, 4) vertex indices, with the orientation of the surface.
        faces: (q,) the triangle of the surface that contains each vertex.
        barycentric: (q, 3) barycentric coordinates in this triangle.
        left_out: number of squares of the grid that the boundary of the surface cuts and no layer of quads replaces.
        area_left_out: area of the grid that quads do not cover, in squares, next to boundaries that are not on grid
            lines; negative if a quad covers a hole.
        surface: the triangle mesh.
        notes: notes on the computation and on problems, one sentence each.
        seconds: wall time of each stage; not stored in files.
        grid: the integer grid that the quads are extracted from, on a simpler mesh of a surface of many triangles,
            holes or components; not stored in files.
        source: the file that the surface was read from, of which an .obj keeps materials and groups; not stored.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> mesh = coneflat.quads(*square, quads=9)
        >>> len(mesh.quads), len(mesh.irregular), mesh.euler_characteristic
        (9, 0, 1)
        >>> mesh.barycentric.shape
        (16, 3)
    """

    vertices: FloatArray
    quads: IntArray
    faces: IntArray
    barycentric: FloatArray
    left_out: int
    area_left_out: float
    surface: TriangleMesh
    notes: tuple[str, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)
    grid: IntegerGrid | None = None
    source: MeshFile | None = None

    @cached_property
    def _edges(self) -> tuple[IntArray, IntArray]:
        """Edges as vertex pairs (e, 2), the smaller index first, and (e,) the number of quads at each."""
        tails, heads = self.quads.ravel(), np.roll(self.quads, -1, axis=1).ravel()
        order, first = sort_pairs(tails, heads, len(self.vertices))
        pairs = np.sort(np.stack([tails, heads], axis=1)[order[first]], axis=1)
        return pairs, np.diff(np.flatnonzero(np.append(first, True)))

    @property
    def edges(self) -> IntArray:
        """(e, 2) vertex pairs, the smaller index first."""
        return self._edges[0]

    @property
    def is_boundary_edge(self) -> BoolArray:
        """(e,) whether each edge has a single quad."""
        return self._edges[1] == 1

    @cached_property
    def is_boundary_vertex(self) -> BoolArray:
        """(q,) whether each vertex is on the boundary."""
        return mask_of(len(self.vertices), self.edges[self.is_boundary_edge])

    @cached_property
    def triangle_corners(self) -> IntArray:
        """(2p, 3) corners of quads, 4 q + i, of the two triangles on both sides of a diagonal of each quad.

        It is the shorter one, but that inside the quad if an angle is more than 180 degrees.
        """
        corners = self.vertices[self.quads]
        first_diagonal, second_diagonal = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        is_shorter = dots(first_diagonal, first_diagonal) <= dots(second_diagonal, second_diagonal)
        is_reflex = corner_jacobians(self.vertices, self.quads) < 0
        # A diagonal from a corner with such an angle is inside, the other one outside.
        first_inside, second_inside = ~is_reflex[:, 1::2].any(axis=1), ~is_reflex[:, ::2].any(axis=1)
        turn = np.where(np.where(first_inside == second_inside, is_shorter, first_inside), 0, 1)
        rolled = 4 * np.arange(len(self.quads))[:, None] + (np.arange(4) + turn[:, None]) % 4
        return rolled[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)

    @property
    def triangles(self) -> IntArray:
        """(2p, 3) vertex indices of the triangles of `triangle_corners`, two consecutive ones per quad."""
        return self.quads.ravel()[self.triangle_corners]

    @cached_property
    def valences(self) -> IntArray:
        """(q,) the number of edges at each vertex."""
        return np.bincount(self.edges.ravel(), minlength=len(self.vertices))

    @cached_property
    def uv(self) -> FloatArray:
        """(p, 4, 2) UVs of the corners of quads: squares of one size in disjoint rectangles, in the unit square."""
        return _UV(self)

    def without(self, is_left_out: BoolArray) -> QuadMesh:
        """Return a mesh without some quads, (p,); those that then touch only in a point get separate vertices there."""
        quads = self.quads[~is_left_out]
        count, fan = corner_fans(opposite_sides(quads))
        origin = np.empty(count, dtype=np.int64)
        origin[fan] = quads.ravel()
        return replace(
            self,
            vertices=self.vertices[origin],
            quads=fan.reshape(-1, 4),
            faces=self.faces[origin],
            barycentric=self.barycentric[origin],
        )

    def __repr__(self) -> str:
        irregular = plural(len(self.irregular), "irregular vertex", "irregular vertices")
        return f"<QuadMesh: {plural(len(self.quads), 'quad')}, {irregular}>"

    @property
    def irregular(self) -> IntArray:
        """(s,) the inner vertices whose valence is not 4."""
        return np.flatnonzero((self.valences != 4) & ~self.is_boundary_vertex)

    @property
    def euler_characteristic(self) -> int:
        """Vertices minus edges plus quads."""
        return len(self.vertices) - len(self.edges) + len(self.quads)

    @property
    def surface_euler(self) -> int:
        """Euler characteristic of the surface without unused vertices; equal to that of the quads if left_out is 0."""
        unused = len(self.surface.vertices) - len(np.unique(self.surface.faces))
        return self.surface.euler_characteristic - unused

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the mesh and return the path; see `write_quads`.

        The extension is .obj, .ply, .stl, .glb, .npz, .vtk, .vtu, .inp or .msh.

        Raises:
            UnknownFormatError: the extension is another one.
            OptionError: meshio, which writes the last four, is not installed.
            MeshFileError: the file cannot be written.
        """
        return _WRITE(path, self)

    @staticmethod
    def load(path: str | PathLike[str]) -> QuadMesh:
        """Return a quad mesh from an .npz file, with its surface.

        Raises:
            UnknownFormatError: the extension is not .npz.
            MeshFileError: the file does not exist, cannot be read, or does not contain a quad mesh.
        """
        return _READ(path)


def opposite_sides(quads: IntArray) -> IntArray:
    """Return (4p,) the opposite half-edge of each side, 4 q + i, of quads (p, 4); -1 on the boundary."""
    tails, heads = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    count = int(quads.max(initial=0)) + 1
    keys, back = tails * count + heads, heads * count + tails
    order = np.argsort(keys)
    at = np.minimum(np.searchsorted(keys[order], back), len(order) - 1)
    return np.where(keys[order[at]] == back, order[at], -1)


def corner_fans(opposite: IntArray) -> tuple[int, IntArray]:
    """Return the number of fans of quads around vertices, and (4p,) the fan of each corner.

    opposite: (4p,) the opposite half-edge of each side of the quads; -1 on the boundary.
    """
    after = np.roll(np.arange(len(opposite)).reshape(-1, 4), -1, axis=1).ravel()
    sides = np.flatnonzero(opposite >= 0)
    opposites = opposite[sides]
    ends = np.concatenate([sides, after[sides]]), np.concatenate([after[opposites], opposites])
    return label_components(len(opposite), *ends)


def degenerate_quads(quads: IntArray, edges: IntArray) -> BoolArray:
    """Return (p,) whether a quad has a vertex twice, or a side with the same vertices as another edge.

    Args:
        quads: (p, 4) vertex indices.
        edges: (p, 4) the edge of the side from each vertex to the next one.
    """
    ahead = np.roll(quads, -1, axis=1)
    key = np.minimum(quads, ahead) * (int(quads.max(initial=0)) + 1) + np.maximum(quads, ahead)
    _, first = np.unique(edges, return_index=True)
    keys, count = np.unique(key.ravel()[first], return_counts=True)
    is_twice = (np.diff(np.sort(quads, axis=1), axis=1) == 0).any(axis=1)
    return is_twice | np.isin(key, keys[count > 1]).any(axis=1)


def least_jacobians(points: FloatArray, quads: IntArray) -> FloatArray:
    """Return (p,) the least of the scaled Jacobians of each quad; see `corner_jacobians`."""
    return corner_jacobians(points, quads).min(axis=1)


def corner_jacobians(points: FloatArray, quads: IntArray) -> FloatArray:
    """Return (p, 4) the scaled Jacobians of quads: the signed sines of their angles, projected along their normals.

    The normal is the cross product of the diagonals. The value is 1 for a rectangle, and negative if a corner is
    flipped.
    """
    corners = points[quads]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.maximum(np.sqrt(dots(normal, normal)), np.finfo(float).tiny)[:, None]
    jacobians = np.empty((len(quads), 4))
    for i in range(4):
        a, b = corners[:, i - 1] - corners[:, i], corners[:, (i + 1) % 4] - corners[:, i]
        scale = np.maximum(np.sqrt(dots(a, a) * dots(b, b)), np.finfo(float).tiny)
        jacobians[:, i] = dots(np.cross(b, a), normal) / scale
    return jacobians
