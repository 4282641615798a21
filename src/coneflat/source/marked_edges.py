"""Edges that the user marks as seams, and edges that must not be cut."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import BoolArray, IntArray, mask_of
from ..base.text import list_some, plural
from ..errors import OptionError, SeamError
from ..geometry.triangles import dihedral_angles
from ..mesh.charts import point_seams
from ..mesh.check import CheckedMesh
from ..mesh.connectivity import TriangleMesh, label_components
from ..mesh.ties import tie_key
from ..options import Options
from .input_mesh import InputMesh, reorder_corners

# Contribution of a vertex's tie-breaking key to the size of a region.
TIE_BREAK = 1e-6


def marked_edges(
    checked: CheckedMesh, options: Options, input_mesh: InputMesh, forbidden: BoolArray
) -> BoolArray:
    """Return (e,) whether each edge is an inner edge marked as a seam: named, sharp, or a seam of the input's UVs.

    Args:
        checked: the mesh with e edges.
        options: the options.
        input_mesh: the input.
        forbidden: (e,) edges that must not be cut, even if they are sharp.

    Raises:
        OptionError: a pair of vertices is not an edge; the input has no UVs.
        SeamError: a named edge is forbidden.
    """
    mesh = checked.mesh
    marked = np.zeros(len(mesh.edges), dtype=bool)
    word, pairs = _word_and_pairs(options.seams)
    if word is not None:
        marked |= _seams_of_input(checked, input_mesh)
    if options.sharp_angle is not None:
        marked |= np.abs(dihedral_angles(mesh)) > options.sharp_angle
    marked &= ~forbidden
    if pairs is not None:
        named = named_edges(checked, pairs)
        contradictory = named[forbidden[named]]
        if len(contradictory):
            tail, head = checked.vertex_origin[mesh.edges[contradictory[0]]]
            raise SeamError(
                f"{plural(len(contradictory), 'edge')} given both as seams and as no_seams: the first is {tail}-{head}"
            )
        marked[named] = True
    return marked & ~mesh.is_boundary_edge


def _word_and_pairs(seams: Any) -> tuple[str | None, IntArray | None]:
    """Return the word and the pairs of vertices in the option `seams`, each None if missing."""
    if isinstance(seams, tuple):
        return seams
    return (seams, None) if isinstance(seams, str) else (None, seams)


def effective_marks(mesh: TriangleMesh, marked: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the marked edges that cut the mesh, and the isolated ones, which do not.

    Cutting a single edge splits neither of its ends, unless one is on the boundary or on another marked edge.

    marked: (e,) inner edges.
    """
    at = np.bincount(mesh.edges[marked].ravel(), minlength=len(mesh.vertices))
    is_split = (at > 1) | mesh.is_boundary_vertex
    cuts = is_split[mesh.edges].any(axis=1)
    return np.flatnonzero(marked & cuts), np.flatnonzero(marked & ~cuts)


def named_edges(checked: CheckedMesh, pairs: IntArray) -> IntArray:
    """Return the indices of the edges between pairs (k, 2) of the input's vertices.

    Raises:
        OptionError: a pair of vertices is not an edge.
    """
    origin = checked.vertex_origin
    bound = int(origin.max()) + 1
    ends = np.sort(origin[checked.mesh.edges], axis=1)
    keys = ends[:, 0] * bound + ends[:, 1]
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    named_keys = np.where((low >= 0) & (high < bound), low * bound + high, -1)
    missing = np.flatnonzero(~np.isin(named_keys, keys))
    if len(missing):
        names = [f"{a}-{b}" for a, b in pairs[missing[:5]].tolist()]
        raise OptionError(
            f"{plural(len(missing), 'seam')} of {len(pairs):,} between vertices that no edge connects: "
            f"{list_some(names, len(missing))}"
        )
    return np.flatnonzero(np.isin(keys, named_keys))


def forbidden_edges(checked: CheckedMesh, options: Options, count: int) -> BoolArray:
    """Return (e,) whether each edge is forbidden by `no_seams`; if this has vertices, edges between two of them are.

    Args:
        checked: the mesh with e edges.
        options: the options.
        count: number of the input's vertices.

    Raises:
        OptionError: a vertex or an edge does not exist.
    """
    named = np.asarray(() if options.no_seams is None else options.no_seams, dtype=np.int64)
    if named.ndim == 2:
        return mask_of(len(checked.mesh.edges), named_edges(checked, named))
    invalid = named[(named < 0) | (named >= count)]
    if len(invalid):
        raise OptionError(f"no_seams: {invalid[0]} is not a vertex: indices are from 0 to {count - 1}")
    inside = mask_of(count, named)
    ends: BoolArray = inside[checked.vertex_origin][checked.mesh.edges]
    return ends[:, 0] & ends[:, 1]


def unreachable(mesh: TriangleMesh, is_forbidden: BoolArray) -> IntArray:
    """Return the vertices of a connected mesh that no seam can reach from its largest region of allowed edges.

    With a boundary, that region must touch it. If all edges are forbidden, the result is empty, because then the error
    is about the seams and not about the cones.

    is_forbidden: (m, 3) sides that must not be cut.
    """
    is_blocked = is_forbidden.ravel()[mesh.edge_halfedges[:, 0]] & ~mesh.is_boundary_edge
    allowed = mesh.edges[~is_blocked]
    if not len(allowed):
        return np.empty(0, dtype=np.int64)
    number, label = label_components(len(mesh.vertices), allowed[:, 0], allowed[:, 1])
    # Among regions of equal size, the choice must not depend on the numbering.
    sizes = np.bincount(label, weights=1 + TIE_BREAK * tie_key(mesh.vertices), minlength=number)
    if mesh.is_boundary_vertex.any():
        sizes[np.bincount(label[mesh.is_boundary_vertex], minlength=number) == 0] = 0
    return np.flatnonzero(label != np.argmax(sizes))


def _seams_of_input(checked: CheckedMesh, input_mesh: InputMesh) -> BoolArray:
    """Return (e,) whether the two sides of each edge have different UVs in the input's file."""
    texture = input_mesh.corner_texture()
    if texture is None:
        raise OptionError("the input has no UV coordinates, so it has no seams to use")
    mesh = checked.mesh
    return mask_of(len(mesh.edges), point_seams(mesh, reorder_corners(checked, texture)))
