"""Strips and grid lines of quad meshes: what loop selection, edge rings and patches of a mesh depend on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import BoolArray, IntArray, mask_of
from ..mesh import label_components
from .quad_mesh import QuadMesh, opposite_sides


@dataclass(frozen=True, eq=False)
class Strips:
    """The strips of a mesh of p quads, each of which crosses quads from one side to the opposite one.

    Attributes:
        across: (p, 2) the strips of each quad: that through its sides 0 and 2, and that through its sides 1 and 3. They
            are the same where a strip crosses itself.
        lengths: (s,) number of quads of each strip; a quad in which it crosses itself counts twice.
    """

    across: IntArray
    lengths: IntArray


def find_strips(mesh: QuadMesh) -> Strips:
    """Return the strips of a quad mesh."""
    twin = opposite_sides(mesh.quads)
    side = np.arange(len(twin))
    edge = np.where(twin >= 0, np.minimum(side, twin), side).reshape(-1, 4)
    _, strip = label_components(len(twin), edge[:, :2].ravel(), edge[:, 2:].ravel())
    numbers, across = np.unique(strip[edge[:, :2]], return_inverse=True)
    across = across.reshape(-1, 2)
    return Strips(across, np.bincount(across.ravel(), minlength=len(numbers)))


def find_patches(mesh: QuadMesh) -> IntArray:
    """Return (p,) the patch of each quad after a cut along all grid lines from irregular vertices.

    The lines go on through each other, and end at irregular vertices and at the boundary. The patches are the faces of
    the base complex. They are rectangles, except on surfaces with parts that no such line bounds, as a torus without
    irregular vertices.
    """
    twin, starts = opposite_sides(mesh.quads), mesh.quads.ravel()
    is_cut, inner = _cut_sides(twin, starts, mesh.is_boundary_vertex), np.flatnonzero(twin >= 0)
    joined = inner[~is_cut[inner]]
    _, patch = label_components(len(mesh.quads), joined // 4, twin[joined] // 4)
    return patch


def _cut_sides(twin: IntArray, starts: IntArray, is_boundary: BoolArray) -> BoolArray:
    """Return (4p,) whether a grid line from an irregular vertex, or the boundary, is along each side of a quad."""
    leaving = np.bincount(starts, minlength=len(is_boundary))
    is_irregular = np.where(is_boundary, leaving != 2, leaving != 4)
    side = np.arange(len(twin))
    following = side - side % 4 + (side + 1) % 4
    ends = starts[following]
    # The next side along the line, across the side that leaves the quad at its end.
    passes = (twin >= 0) & (twin[following] >= 0) & ~is_irregular[ends] & ~is_boundary[ends]
    ahead = following[twin[following[passes]]]
    pairs = np.concatenate([[side[passes], ahead], [side[twin >= 0], twin[twin >= 0]]], axis=1)
    lines, line = label_components(len(twin), *pairs)
    from_irregular = line[(twin >= 0) & (is_irregular[starts] | is_irregular[ends])]
    return np.asarray((twin < 0) | mask_of(lines, from_irregular)[line])
