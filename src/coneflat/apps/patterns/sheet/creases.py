"""Creases: straight folds between two flat parts of a sheet, from border to border."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....base import BoolArray, FloatArray, IntArray, mask_of
from ....geometry import dihedral_angles
from ....mesh import label_components
from ..pieces.cut_surface import CutSurface
from ..pieces.development import MIN_FOLD_ANGLE

# Largest sine of the angle between rulings that count as parallel.
PARALLEL = 1e-3


@dataclass(frozen=True, eq=False)
class Crease:
    """A straight fold between two flat parts.

    Attributes:
        piece: the piece.
        parts: the two flat parts.
        line: (2, 2) its ends in the plane.
        angle: the dihedral angle, positive for a mountain.
    """

    piece: int
    parts: tuple[int, int]
    line: FloatArray
    angle: float

    @property
    def middle(self) -> FloatArray:
        """(2,) its middle."""
        return self.line.mean(axis=0)

    @property
    def direction(self) -> FloatArray:
        """(2,) a unit vector along it."""
        along = self.line[1] - self.line[0]
        return along / np.linalg.norm(along)

    def is_parallel_to(self, crease: Crease) -> bool:
        """Return whether another crease has the same direction."""
        a, b = self.direction, crease.direction
        return bool(abs(a[0] * b[1] - a[1] * b[0]) <= PARALLEL)

    def is_beside(self, crease: Crease) -> bool:
        """Return whether another crease runs along this one, on one side of it, for a part of its length."""
        stations = [np.sort(line @ self.direction) for line in (self.line, crease.line)]
        overlap = min(ends[1] for ends in stations) - max(ends[0] for ends in stations)
        length = float(np.linalg.norm(self.line[1] - self.line[0]))
        return bool(overlap > 0 and self.distance_to(crease) > PARALLEL * length)

    def distance_to(self, crease: Crease) -> float:
        """Return the distance of the middle of another crease from the line of this one."""
        a, b = self.direction, crease.middle - self.middle
        return float(abs(a[0] * b[1] - a[1] * b[0]))


def folds_and_parts(surface: CutSurface) -> tuple[IntArray, IntArray]:
    """Return the folds (k,) inside the pieces, and (m,) the flat part of each triangle between them."""
    mesh = surface.mesh
    is_inside = ~mesh.is_boundary_edge & ~mask_of(len(mesh.edges), surface.seams)
    is_flat = is_inside & (np.abs(dihedral_angles(mesh)) <= MIN_FOLD_ANGLE)
    _, part = label_components(len(mesh.faces), *mesh.edge_faces[is_flat].T)
    return np.flatnonzero(is_inside & ~is_flat), part


def find_creases(surface: CutSurface) -> list[Crease]:
    """Return the straight folds that run from border to border."""
    mesh = surface.mesh
    angles = dihedral_angles(mesh)
    edges, part = folds_and_parts(surface)
    pairs = np.sort(part[mesh.edge_faces[edges]], axis=1)
    edges, pairs = edges[pairs[:, 0] != pairs[:, 1]], pairs[pairs[:, 0] != pairs[:, 1]]
    order = np.lexsort([edges, pairs[:, 1], pairs[:, 0]])
    edges, pairs = edges[order], pairs[order]
    if not len(edges):
        return []
    starts = np.flatnonzero(np.r_[True, (pairs[1:] != pairs[:-1]).any(axis=1)])
    is_border = surface.is_border_vertex
    creases = []
    for group, pair in zip(np.split(edges, starts[1:]), pairs[starts].tolist(), strict=True):
        crease = _crease(surface, group, (pair[0], pair[1]), angles[group], is_border)
        if crease is not None:
            creases.append(crease)
    return creases


def _crease(
    surface: CutSurface, edges: IntArray, parts: tuple[int, int], angles: FloatArray, is_border: BoolArray
) -> Crease | None:
    """Return the crease that consists of given edges; None if it is not straight or does not reach the border."""
    mesh = surface.mesh
    triangle, corner = np.divmod(mesh.edge_halfedges[edges, 0], 3)
    corners = np.stack([(corner + 1) % 3, (corner + 2) % 3], axis=1)
    places = surface.points[surface.corners[triangle[:, None], corners]].reshape(-1, 2)
    vertices = mesh.faces[triangle[:, None], corners].ravel()
    longest = np.linalg.norm(places[1::2] - places[::2], axis=1).argmax()
    along = places[2 * longest + 1] - places[2 * longest]
    along /= np.linalg.norm(along)
    stations = places @ along
    first, last = stations.argmin(), stations.argmax()
    line = places[[first, last]]
    across = (places - line[0]) @ np.array([-along[1], along[0]])
    length = stations[last] - stations[first]
    if np.abs(across).max() > PARALLEL * length or not is_border[vertices[[first, last]]].all():
        return None
    return Crease(int(surface.pieces[triangle[0]]), parts, line, float(np.median(angles)))
