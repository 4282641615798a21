"""Triangles divided along half-planes through an axis."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .... import TriangleMesh
from ....base import BoolArray, FloatArray, IntArray
from ..pieces.cut_surface import lengths_of_edges
from .snapping import slid_to_axis, slid_to_crossings

# Distance from the axis or a half-plane up to which vertices lie on it, relative to the longest edge at the vertex.
ON_PLANE = 1e-5


@dataclass(frozen=True, eq=False)
class AroundAxis:
    """A mesh in coordinates whose third axis is an axis of rotation.

    Attributes:
        vertices: (n, 3) positions: x and y across the axis.
        faces: (m, 3) triangles.
        is_pole: (n,) vertices on the axis.
        is_fixed: (n,) vertices on the axis, or on a half-plane along which the surface is divided.
        longest: (n,) length of the longest edge at each vertex.
    """

    vertices: FloatArray
    faces: IntArray
    is_pole: BoolArray
    is_fixed: BoolArray
    longest: FloatArray

    @classmethod
    def of(cls, mesh: TriangleMesh, centre: FloatArray, frame: FloatArray) -> AroundAxis:
        """Return a mesh with vertices where the axis meets it: vertices that slide there, or new ones.

        Args:
            mesh: the mesh.
            centre: (3,) a point of the axis.
            frame: (3, 3) orthonormal axes as rows, right-handed, the last one along the axis.
        """
        vertices = (mesh.vertices - centre) @ frame.T
        lengths = lengths_of_edges(mesh)
        longest = np.zeros(len(vertices))
        np.maximum.at(longest, mesh.edges.ravel(), np.repeat(lengths, 2))
        vertices = slid_to_axis(TriangleMesh(vertices, mesh.faces), longest)
        is_pole = np.hypot(vertices[:, 0], vertices[:, 1]) <= ON_PLANE * longest
        surface = cls(vertices, mesh.faces, is_pole, is_pole, longest)
        return surface._with_poles_on_edges()._with_poles_inside()

    @property
    def tolerance(self) -> FloatArray:
        """(n,) distance up to which a vertex lies on the axis or a half-plane."""
        return ON_PLANE * self.longest

    @property
    def radii(self) -> FloatArray:
        """(n,) distances from the axis."""
        return np.hypot(self.vertices[:, 0], self.vertices[:, 1])

    def _with_poles_on_edges(self) -> AroundAxis:
        """Return the surface with a vertex on each edge that meets the axis."""
        edges = TriangleMesh(self.vertices, self.faces).edges
        flat = self.vertices[edges][:, :, :2]
        along = flat[:, 1] - flat[:, 0]
        squares = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
        share = -(flat[:, 0] * along).sum(axis=1) / squares
        distance = np.abs(flat[:, 0, 0] * flat[:, 1, 1] - flat[:, 0, 1] * flat[:, 1, 0]) / np.sqrt(squares)
        is_met = (distance <= self.tolerance[edges].min(axis=1)) & (share > 0) & (share < 1)
        is_met &= ~self.is_pole[edges].any(axis=1)
        return self._split(is_met, share, True)

    def _with_poles_inside(self) -> AroundAxis:
        """Return the surface with a vertex inside each triangle that meets the axis inside."""
        x, y = self.vertices[self.faces][:, :, 0], self.vertices[self.faces][:, :, 1]
        opposite = np.stack(
            [x[:, (i + 1) % 3] * y[:, (i + 2) % 3] - x[:, (i + 2) % 3] * y[:, (i + 1) % 3] for i in range(3)],
            1,
        )
        is_met = ((opposite > 0).all(axis=1) | (opposite < 0).all(axis=1)) & ~self.is_pole[self.faces].any(
            axis=1
        )
        met = np.flatnonzero(is_met)
        weights = opposite[met] / opposite[met].sum(axis=1, keepdims=True)
        places = (weights[:, :, None] * self.vertices[self.faces[met]]).sum(axis=1)
        poles = len(self.vertices) + np.arange(len(met))
        a, b, c = self.faces[met].T
        fans = [np.stack(triangle, axis=1) for triangle in ((a, b, poles), (b, c, poles), (c, a, poles))]
        surface = self._with_vertices(places, self.longest[self.faces[met]].max(axis=1, initial=0.0), True)
        return replace(surface, faces=np.concatenate([self.faces[~is_met], *fans]))

    def _with_vertices(self, places: FloatArray, longest: FloatArray, are_poles: bool) -> AroundAxis:
        return replace(
            self,
            vertices=np.concatenate([self.vertices, places]),
            is_pole=np.concatenate([self.is_pole, np.full(len(places), are_poles)]),
            is_fixed=np.concatenate([self.is_fixed, np.full(len(places), True)]),
            longest=np.concatenate([self.longest, longest]),
        )

    def split_at(self, angle: float, spacing: float) -> AroundAxis:
        """Return the surface with all triangles divided that the half-plane at an angle from the first axis crosses.

        Vertices near it slide onto it, unless the next half-plane, at an angle of `spacing`, is nearer: edges
        beside the axis reach across several.
        """
        mesh = TriangleMesh(self.vertices, self.faces)
        crossings = self._crossings(mesh, angle)
        turns = np.arctan2(self.vertices[:, 1], self.vertices[:, 0]) - angle
        is_remote = np.abs(np.remainder(turns + np.pi, 2 * np.pi) - np.pi) > spacing / 2
        vertices = slid_to_crossings(mesh, *crossings, self.is_fixed | is_remote, self.longest)
        is_moved = (vertices != self.vertices).any(axis=1)
        surface = replace(self, vertices=vertices, is_fixed=self.is_fixed | is_moved)
        return surface._split(*surface._crossings(TriangleMesh(vertices, self.faces), angle), False)

    def _crossings(self, mesh: TriangleMesh, angle: float) -> tuple[BoolArray, FloatArray]:
        """Return (e,) the edges that a half-plane crosses, and where, from their first to their second vertex."""
        across = self.vertices[:, 1] * np.cos(angle) - self.vertices[:, 0] * np.sin(angle)
        outward = self.vertices[:, 0] * np.cos(angle) + self.vertices[:, 1] * np.sin(angle)
        across = np.where(self.is_pole | (np.abs(across) <= self.tolerance), 0.0, across)
        first, second = across[mesh.edges].T
        is_crossed = first * second < 0
        share = np.where(is_crossed, first / np.where(is_crossed, first - second, 1.0), 0.0)
        is_crossed &= outward[mesh.edges[:, 0]] * (1 - share) + outward[mesh.edges[:, 1]] * share > 0
        return is_crossed, share

    def _split(self, is_split: BoolArray, share: FloatArray, are_poles: bool) -> AroundAxis:
        """Return the surface with a vertex on each of some edges, at a share of its length, none, one or two a face."""
        if not is_split.any():
            return self
        mesh = TriangleMesh(self.vertices, self.faces)
        edges = mesh.edges[is_split]
        part = share[is_split, None]
        places = self.vertices[edges[:, 0]] * (1 - part) + self.vertices[edges[:, 1]] * part
        if are_poles:
            places[:, :2] = 0.0
        surface = self._with_vertices(places, self.longest[edges].max(axis=1), are_poles)
        middle = np.full(len(mesh.edges), -1)
        middle[is_split] = len(self.vertices) + np.arange(len(edges))
        return replace(
            surface, faces=_divided(surface.vertices, self.faces, middle[mesh.halfedge_edges.reshape(-1, 3)])
        )


def _divided(vertices: FloatArray, faces: IntArray, middle: IntArray) -> IntArray:
    """Return the triangles after division at vertices on their sides.

    Args:
        vertices: (n, 3) all vertices.
        faces: (m, 3) triangles.
        middle: (m, 3) the vertex on the side opposite each corner, -1 for none; two sides at most have one.
    """
    count = (middle >= 0).sum(axis=1)
    undivided, single, double = (np.flatnonzero(count == number) for number in range(3))
    # Corner a is opposite the side with the vertex p.
    corner = (middle[single] >= 0).argmax(axis=1)
    a, b, c = (faces[single, (corner + i) % 3] for i in range(3))
    p = middle[single, corner]
    halves = [np.stack([a, b, p], axis=1), np.stack([a, p, c], axis=1)]
    # Corner a is opposite the side without a vertex: p is on c a, q on a b.
    corner = (middle[double] < 0).argmax(axis=1)
    a, b, c = (faces[double, (corner + i) % 3] for i in range(3))
    p, q = middle[double, (corner + 1) % 3], middle[double, (corner + 2) % 3]
    to_b, to_c = (np.linalg.norm(vertices[x] - vertices[y], axis=1) for x, y in ((p, b), (q, c)))
    is_b = (to_b < to_c)[:, None]
    thirds = [
        np.stack([a, q, p], axis=1),
        np.where(is_b, np.stack([q, b, p], axis=1), np.stack([q, b, c], axis=1)),
        np.where(is_b, np.stack([b, c, p], axis=1), np.stack([q, c, p], axis=1)),
    ]
    return np.concatenate([faces[undivided], *halves, *thirds])
