"""Seams as wholes, and names of the charts and seams of a page, such as those of a pattern."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from ....base import FloatArray, IntArray
from ....mesh import end_corners


@dataclass(frozen=True, eq=False)
class FoldLines:
    """Lines along which the pieces of a layout are folded.

    Attributes:
        places: (f, 2, 3) their ends on the model.
        uv: (f, 2, 2) their ends in the layout.
        is_mountain: (f,) whether they are folded away from the eye, not towards it.
    """

    places: FloatArray
    uv: FloatArray
    is_mountain: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PageParts:
    """Names and numbers of the pieces of a layout, which a page shows instead of its charts.

    Attributes:
        pieces: (m,) the piece of each triangle, from 0; their numbers on the page begin with 1.
        anchors: of each piece, a triangle in the middle, on which its number is shown.
        seams: (k,) the seam of each seam edge, in the order of the edges of the mesh.
        seam_texts: what is said of each seam, such as its length.
        names: what is written at seams: a name of each seam, or of each of its parts.
        edge_names: (k,) the name of each seam edge, an index into `names`.
        strain: (m,) relative change of the length of the side of each triangle that changes most, at true scale.
        strain_title: what these are, for the colour scale.
        folds: lines along which the pieces are folded.
    """

    pieces: IntArray
    anchors: IntArray
    seams: IntArray
    seam_texts: Sequence[str]
    names: Sequence[str]
    edge_names: IntArray
    strain: FloatArray
    strain_title: str
    folds: FoldLines


def seam_numbers(outline: IntArray, seam_edges: int, faces: IntArray) -> IntArray:
    """Return (k,) the seam of each of k seam edges, numbered from 0 by their first edges.

    Seam edges are of one seam if they follow each other on both sides.

    Args:
        outline: half-edges, of which the first 2 k are the two sides of each seam edge, as in `Content`.
        seam_edges: k.
        faces: (m, 3) the point of the layout at each corner.
    """
    points = faces.reshape(-1)
    start, end = (points[corner].reshape(-1, 2) for corner in end_corners(outline[: 2 * seam_edges]))
    # At each end of a seam edge are a point of one side and a point of the other, which runs in the other direction.
    meeting = np.concatenate(
        [np.stack([start[:, 0], end[:, 1]], axis=1), np.stack([end[:, 0], start[:, 1]], axis=1)]
    )
    _, node = np.unique(np.sort(meeting, axis=1), axis=0, return_inverse=True)
    edge = np.tile(np.arange(seam_edges), 2)
    node = seam_edges + node.reshape(-1)
    size = 2 * len(node) + seam_edges
    graph = csr_matrix((np.ones(len(edge), dtype=np.int8), (edge, node)), shape=(size, size))
    label = connected_components(graph, directed=False)[1][:seam_edges]
    _, first, number = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number.reshape(-1)]
