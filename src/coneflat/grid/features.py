"""Sharp edges of a surface, the curves that they make, and the angles of what lies between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..geometry import corner_angles
from ..geometry.normals import dihedral_angles
from ..mesh import TriangleMesh, label_components
from ..seams import CutMesh, open_along

# Quarter turns below the middle between one and two from which an angle counts as two: corners of an octagon are none,
# whatever rounding says.
LENIENT = 0.05


def sharp_edges(mesh: TriangleMesh, angle: float) -> IntArray:
    """Return the inner edges that bend by more than an angle, radians."""
    return np.flatnonzero(np.abs(dihedral_angles(mesh)) > angle)


def lengths_along(mesh: TriangleMesh, edges: IntArray) -> FloatArray:
    """Return (k,) the lengths of edges."""
    return np.linalg.norm(np.diff(mesh.vertices[mesh.edges[edges]], axis=1)[:, 0], axis=1)


def without_stubs(mesh: TriangleMesh, edges: IntArray, least: float) -> IntArray:
    """Return which of some edges (k,) are kept when stubs are dropped.

    A stub ends where no other one goes on, in less than two edges or before it is as long as is asked.
    """
    kept = np.arange(len(edges))
    lengths = lengths_along(mesh, edges)
    while True:
        chain, ends = feature_chains(mesh, edges[kept])
        count = int(chain.max(initial=-1)) + 1
        is_stub = np.zeros(count, dtype=bool)
        is_stub[chain[(ends == 1).any(axis=1)]] = True
        is_stub &= (np.bincount(chain, minlength=count) < 2) | (
            np.bincount(chain, lengths[kept], count) < least
        )
        if not is_stub.any():
            return kept
        kept = kept[~is_stub[chain]]


def patches_of(mesh: TriangleMesh, edges: IntArray) -> tuple[int, IntArray]:
    """Return into how many patches edges part a mesh, and (m,) that of each triangle."""
    glued = ~mesh.is_boundary_edge
    glued[edges] = False
    pairs = mesh.edge_faces[glued]
    return label_components(len(mesh.faces), pairs[:, 0], pairs[:, 1])


def dangling(mesh: TriangleMesh, edges: IntArray) -> IntArray:
    """Return which of some edges (k,) have the same patch on both sides."""
    _, patch = patches_of(mesh, edges)
    one, two = patch[mesh.edge_faces[edges]].T
    return np.flatnonzero(one == two)


def border_of(mesh: TriangleMesh, edges: IntArray, number: int) -> IntArray:
    """Return which of some edges (k,) part one patch from another one, those of the chain that does so the longest.

    Where none does, those that lie in it; empty if it has none of either.
    """
    _, patch = patches_of(mesh, edges)
    one, two = patch[mesh.edge_faces[edges]].T
    beside = (one == number) | (two == number)
    parting = np.flatnonzero(beside & (one != two))
    if not len(parting):
        return np.flatnonzero(beside)
    chain, _ = feature_chains(mesh, edges)
    lengths = lengths_along(mesh, edges)
    longest = int(np.argmax(np.bincount(chain[parting], lengths[parting])))
    return parting[chain[parting] == longest]


def feature_chains(mesh: TriangleMesh, edges: IntArray) -> tuple[IntArray, IntArray]:
    """Return (k,) the chain of each edge, between where other than two meet, and (k, 2) how many do at its ends.

    The boundary counts as three edges more.
    """
    ends = mesh.edges[edges]
    degree = np.bincount(ends.ravel(), minlength=len(mesh.vertices)) + 3 * mesh.is_boundary_vertex
    inner = degree[ends.ravel()] == 2
    order = np.argsort(ends.ravel()[inner], kind="stable")
    pairs = np.arange(len(edges)).repeat(2)[inner][order].reshape(-1, 2)
    _, chain = label_components(len(edges), pairs[:, 0], pairs[:, 1])
    return chain, degree[ends]


@dataclass(frozen=True, eq=False)
class Opened:
    """A mesh cut open along its features.

    Attributes:
        mesh: the mesh.
        edges: (k,) the features, inner edges.
        cut: the mesh cut open along them, with the vertex that each of its own comes from.
        quarters: (c,) the quarter turns that the angle at each vertex on the boundary of the open mesh is to have: at
            least one, two where it is straight; 0 inside.
    """

    mesh: TriangleMesh
    edges: IntArray
    cut: CutMesh
    quarters: IntArray

    @property
    def nodes(self) -> IntArray:
        """Vertices on features or the boundary that are to lie on grid points: where these meet, end or turn."""
        border = np.flatnonzero(self.quarters > 0)
        turns = np.zeros(len(self.mesh.vertices), dtype=bool)
        turns[self.cut.origin[border[self.quarters[border] != 2]]] = True
        copies = np.bincount(self.cut.origin[border], minlength=len(turns))
        inside = ~self.mesh.is_boundary_vertex
        turns |= np.where(inside, (copies != 2) & (copies > 0), copies > 1)
        return np.flatnonzero(turns)

    @property
    def irregular(self) -> IntArray:
        """The inner ones of them whose angles sum to other than four quarter turns."""
        total = np.bincount(self.cut.origin, self.quarters, len(self.mesh.vertices)).astype(np.int64)
        return np.flatnonzero((total > 0) & (total != 4) & ~self.mesh.is_boundary_vertex)

    @property
    def is_feature(self) -> BoolArray:
        """(e,) True for edges of the mesh that are features."""
        mask = np.zeros(len(self.mesh.edges), dtype=bool)
        mask[self.edges] = True
        return mask


def opened(mesh: TriangleMesh, edges: IntArray, lengths: FloatArray) -> Opened:
    """Return a mesh cut open along edges (k,), with angles rounded to quarter turns; lengths are (m, 3)."""
    cut = open_along(mesh, edges)
    angles = corner_angles(lengths)
    sums = np.bincount(cut.mesh.faces.ravel(), angles.ravel(), len(cut.origin)) / (np.pi / 2)
    rounded = np.maximum(np.rint(sums), 1).astype(np.int64)
    rounded[(rounded == 1) & (sums > 1.5 - LENIENT)] = 2
    return Opened(mesh, edges, cut, np.where(cut.mesh.is_boundary_vertex, rounded, 0))
