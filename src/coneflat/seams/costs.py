"""What edges cost as parts of seams: their lengths, and less where a seam does no harm."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import FloatArray
from ..base.defaults import MOST_PREFERENCE
from ..errors import OptionError
from ..geometry.operators import at_safe_scale
from ..geometry.triangles import dihedral_angles
from ..geometry.visibility import visible_share
from ..mesh.connectivity import TriangleMesh
from ..stages import SeamSpec

# Radians: edges that bend less are not creases, those that bend more are full ones. The studio draws cuts by the same
# numbers (`apps/studio/page/graph.js`; a test compares them).
SMOOTH, SHARP = np.radians(20), np.radians(60)
# What a full crease costs of its length, and, where hiding is 1, what can hardly be seen.
CHEAPEST = 0.1
# Of the largest: weights below count as this, so that seams do not wander about where they cost nothing.
LEAST_WEIGHT = 1e-3
# Rounds of averages over neighbours, that take the grain from what is seen of single vertices.
ROUNDS = 2


def edge_costs(
    mesh: TriangleMesh,
    lengths: FloatArray,
    *,
    creases: bool = False,
    hiding: float = 0.0,
    visibility: FloatArray | None = None,
    vertex_weights: ArrayLike | None = None,
    edge_weights: ArrayLike | None = None,
) -> FloatArray:
    """Return (e,) the costs of edges for `find_seams`: lengths times weights.

    Args:
        mesh: the mesh.
        lengths: (e,) of its edges, positive.
        creases: seams prefer sharp edges: one that bends by 60 degrees and more costs a tenth of its length.
        hiding: how much they prefer what is hidden, 0 to 10: at 1, what can hardly be seen costs a tenth, at 2 a
            hundredth.
        visibility: (n,) what can be seen of each vertex, 0 to 1; by default what `visible_share` finds.
        vertex_weights: (n,) of the user, 0 and up; an edge gets the mean of its ends.
        edge_weights: (e,) likewise.

    Raises:
        OptionError: a number makes no sense.
    """
    if not 0 <= hiding <= MOST_PREFERENCE:
        raise OptionError(f"hiding must be a number from 0 to {MOST_PREFERENCE:g}, not {hiding:g}")
    costs = np.array(lengths, dtype=np.float64)
    angles = dihedral_angles(mesh) if creases or hiding else np.zeros(len(costs))
    if creases:
        costs *= CHEAPEST ** np.clip((np.abs(angles) - SMOOTH) / (SHARP - SMOOTH), 0.0, 1.0)
    if hiding:
        share = visible_share(mesh.vertices, mesh.faces) if visibility is None else visibility
        costs *= CHEAPEST ** (hiding * _hidden(mesh, share, angles))
    if vertex_weights is not None:
        costs *= _checked(vertex_weights, len(mesh.vertices), "vertex")[mesh.edges].mean(axis=1)
    if edge_weights is not None:
        costs *= _checked(edge_weights, len(mesh.edges), "edge")
    return costs


def seam_costs(
    mesh: TriangleMesh, lengths: FloatArray, spec: SeamSpec, follows_sharp: bool = False
) -> FloatArray:
    """Return (e,) the cost of cutting each edge of a connected mesh, by what is asked of its seams.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths.
        spec: what is asked.
        follows_sharp: sharp edges are cheaper in any case.
    """
    return edge_costs(
        mesh,
        lengths.ravel()[mesh.edge_halfedges[:, 0]],
        creases=follows_sharp or spec.follows_sharp,
        hiding=spec.hiding,
        visibility=spec.visibility,
        vertex_weights=spec.weights,
    )


def _hidden(mesh: TriangleMesh, share: FloatArray, angles: FloatArray) -> FloatArray:
    """Return (e,) how well edges are hidden, 0 to 1: by what is around, and in the valleys that they are themselves."""
    degree = np.bincount(mesh.edges.ravel(), minlength=len(share))
    for _ in range(ROUNDS):
        around = np.bincount(mesh.edges.ravel(), share[mesh.edges[:, ::-1]].ravel(), minlength=len(share))
        share = (share + around / degree) / 2
    # The faces of a valley leave so much of the directions from which a flat place is seen.
    open_share = 1 + np.minimum(angles * _outside(mesh), 0.0) / np.pi
    hidden: FloatArray = 1 - share[mesh.edges].mean(axis=1) * open_share
    return hidden


def _outside(mesh: TriangleMesh) -> float:
    """Return 1 if the faces run counterclockwise seen from outside, -1 if from inside."""
    corners = mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0)
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return float(np.where(volume < 0, -1.0, 1.0))


def _checked(weights: ArrayLike, count: int, noun: str) -> FloatArray:
    """Return weights, one for each vertex or edge, all of them positive."""
    values = np.asarray(weights, dtype=np.float64)
    if values.shape != (count,):
        raise OptionError(f"{noun} weights of seams must be {count:,} numbers, not of shape {values.shape}")
    if not (np.isfinite(values).all() and values.min() >= 0 and values.max() > 0):
        raise OptionError(
            f"{noun} weights of seams must be finite, 0 and up, not all 0; they are {values.min():g} to "
            f"{values.max():g}"
        )
    values = at_safe_scale(values)
    return np.maximum(values, LEAST_WEIGHT * values.max())
