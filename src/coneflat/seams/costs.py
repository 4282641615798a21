"""Costs of edges as parts of seams: their lengths, reduced at creases and where seams are hidden."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import FloatArray
from ..base.defaults import MAX_PREFERENCE
from ..errors import OptionError
from ..geometry.operators import at_safe_scale
from ..geometry.triangles import dihedral_angles
from ..geometry.visibility import visible_share
from ..mesh.connectivity import TriangleMesh
from ..stages import SeamSpec

# Dihedral angles in radians. Edges below SMOOTH are not creases, edges above SHARP are full creases. The studio draws
# cuts by the same numbers (`apps/studio/page/graph.js`; a test compares them).
SMOOTH, SHARP = np.radians(20), np.radians(60)
# Cost factor of a full crease, and, if hiding is 1, of an edge that is almost invisible.
CHEAPEST = 0.1
# Minimum weight relative to the largest. It avoids detours of seams in regions of cost zero.
MIN_WEIGHT = 1e-3
# Number of averages over neighbours, which remove noise from the visibility of single vertices.
SMOOTHING_ROUNDS = 2


def edge_costs(
    mesh: TriangleMesh,
    lengths: FloatArray,
    *,
    creases: float = 0.0,
    hiding: float = 0.0,
    visibility: FloatArray | None = None,
    vertex_weights: ArrayLike | None = None,
) -> FloatArray:
    """Return (e,) the costs of edges for `find_seams`: lengths times weights.

    Args:
        mesh: the mesh.
        lengths: (e,) lengths of its edges, positive.
        creases: preference for sharp edges, 0 to 1: at 1, an edge with a dihedral angle of 60 degrees or more costs a
            tenth of its length.
        hiding: preference for hidden edges, 0 to 10: at 1, an almost invisible edge costs a tenth, at 2 a hundredth.
        visibility: (n,) visible fraction of each vertex, 0 to 1; by default the result of `visible_share`.
        vertex_weights: (n,) weights, not negative; an edge gets the mean of its two ends.

    Raises:
        OptionError: `hiding` is out of range, or weights are negative, not finite, all 0 or of the wrong shape.
    """
    if not 0 <= hiding <= MAX_PREFERENCE:
        raise OptionError(f"hiding must be a number from 0 to {MAX_PREFERENCE:g}, got {hiding:g}")
    costs = np.array(lengths, dtype=np.float64)
    angles = dihedral_angles(mesh) if creases or hiding else np.zeros(len(costs))
    if creases:
        costs *= CHEAPEST ** (creases * np.clip((np.abs(angles) - SMOOTH) / (SHARP - SMOOTH), 0.0, 1.0))
    if hiding:
        share = visible_share(mesh.vertices, mesh.faces) if visibility is None else visibility
        costs *= CHEAPEST ** (hiding * _hidden(mesh, share, angles))
    if vertex_weights is not None:
        costs *= _checked(vertex_weights, len(mesh.vertices))[mesh.edges].mean(axis=1)
    return costs


def seam_costs(
    mesh: TriangleMesh, lengths: FloatArray, spec: SeamSpec, follows_sharp: bool = False
) -> FloatArray:
    """Return (e,) the cost of cutting each edge of a connected mesh, by the options for its seams.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths.
        spec: the options for seams.
        follows_sharp: True makes sharp edges cheaper, whatever `spec` says.

    Raises:
        OptionError: as of `edge_costs`.
    """
    return edge_costs(
        mesh,
        lengths.ravel()[mesh.edge_halfedges[:, 0]],
        creases=1.0 if follows_sharp else spec.creases,
        hiding=spec.hiding,
        visibility=spec.visibility,
        vertex_weights=spec.weights,
    )


def _hidden(mesh: TriangleMesh, share: FloatArray, angles: FloatArray) -> FloatArray:
    """Return (e,) how well edges are hidden, 0 to 1: by the surrounding surface, and as the bottom of a valley."""
    degree = np.bincount(mesh.edges.ravel(), minlength=len(share))
    for _ in range(SMOOTHING_ROUNDS):
        around = np.bincount(mesh.edges.ravel(), share[mesh.edges[:, ::-1]].ravel(), minlength=len(share))
        share = (share + around / degree) / 2
    # Fraction of the directions from which a flat surface is visible that the two faces of a valley leave open.
    open_share = 1 + np.minimum(angles * _orientation_sign(mesh), 0.0) / np.pi
    return 1 - share[mesh.edges].mean(axis=1) * open_share


def _orientation_sign(mesh: TriangleMesh) -> float:
    """Return 1 if the faces are counterclockwise seen from outside, -1 if clockwise."""
    corners = mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0)
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return float(np.where(volume < 0, -1.0, 1.0))


def _checked(weights: ArrayLike, count: int) -> FloatArray:
    """Return validated weights, one for each vertex, raised to a positive minimum."""
    values = np.asarray(weights, dtype=np.float64)
    if values.shape != (count,):
        raise OptionError(f"vertex weights of seams must be {count:,} numbers, got shape {values.shape}")
    if not (np.isfinite(values).all() and values.min() >= 0 and values.max() > 0):
        raise OptionError(
            f"vertex weights of seams must be finite, not negative and not all 0, got {values.min():g} to "
            f"{values.max():g}"
        )
    values = at_safe_scale(values)
    return np.maximum(values, MIN_WEIGHT * values.max())
