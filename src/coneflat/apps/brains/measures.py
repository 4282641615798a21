"""The measures of a flat map in the field's terms (Fischl, Sereno, Dale, NeuroImage 9, 1999)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from ...base import FloatArray, IntArray, check_cancelled
from ...geometry import double_areas, edge_lengths, signed_double_areas
from ...io import UVMesh
from ...measures import Row
from ...mesh import sort_pairs
from ..uv_measures import UVMeasures, measure_mapped

#: Distances are measured up to this many mean edge lengths, as far as the rings of neighbours of other tools reach.
REACH = 7.0
#: Largest number of vertices from which distances are measured.
MAX_SOURCES = 2_000
#: Vertices from which distances are measured at once, which bounds memory.
SOURCES_AT_ONCE = 100
#: Names of the measures of flat maps only, as in the report.
FLAT_MEASURES = ("metric_distortion", "areal_distortion", "inverted")


@dataclass(frozen=True, eq=False)
class FlatMeasures:
    """Measures of a flat map.

    Attributes:
        uv: the measures of any UV map, among them QC and flips.
        metric: mean difference of distances in the plane and on the surface, per cent; see `metric_distortion`.
        areal: mean of |log2(flat area / area)| of triangles, weighted by area, at equal total area.
        inverted: number of inverted triangles.
    """

    uv: UVMeasures
    metric: float
    areal: float
    inverted: int

    def report(self) -> dict[str, Any]:
        """Return all measures as plain Python values, ready for JSON."""
        flat_measures = (self.metric, self.areal, self.inverted)
        return self.uv.report() | dict(zip(FLAT_MEASURES, flat_measures, strict=True))

    def rows(self) -> list[Row]:
        """Return the rows (name, value, meaning) of the table."""
        return [
            ("metric distortion", f"{self.metric:.2f} %", "mean difference of distances over their mean"),
            ("areal distortion", f"{self.areal:.3f}", "mean of |log2(flat area / area)|"),
            ("inverted", f"{self.inverted:,}", "triangles"),
        ]


def measure_flat(mapped: UVMesh, *, strict: bool = False) -> FlatMeasures:
    """Return the measures of a flat map.

    Raises:
        MeshError, MissingUVError: as of `measure_uv`.
    """
    measured = measure_mapped(mapped, strict=strict)
    mesh, corner_uv = measured.mesh, measured.corner_uv
    keys = np.column_stack([mesh.faces.reshape(-1), corner_uv.reshape(-1, 2)])
    points, faces = np.unique(keys, axis=0, return_inverse=True)
    faces = faces.reshape(-1, 3)
    positions = mesh.vertices[points[:, 0].astype(np.int64)]
    metric = metric_distortion(positions, faces, np.asarray(points[:, 1:], dtype=np.float64))
    areas = double_areas(edge_lengths(mesh.vertices, mesh.faces))
    return FlatMeasures(
        measured, metric, _areal(areas, np.abs(signed_double_areas(corner_uv))), measured.distortion.flipped
    )


def _areal(areas: FloatArray, flat: FloatArray) -> float:
    has_area = (areas > 0) & (flat > 0)
    ratio = np.log2(flat[has_area] / flat.sum() / areas[has_area] * areas.sum())
    return float(np.average(np.abs(ratio), weights=areas[has_area]))


def metric_distortion(vertices: FloatArray, faces: IntArray, flat: FloatArray) -> float:
    """Return the mean difference of distances in the plane and on the surface over the mean of the latter, per cent.

    Pairs are a vertex and all vertices within seven mean edge lengths. The flat map is scaled to the area of the
    surface. Paths on the surface follow edges and diagonals of pairs of triangles, and do not cross cuts.

    Args:
        vertices: (n, 3) positions, repeated along cuts.
        faces: (m, 3) triangles.
        flat: (n, 2) points of the flat map.
    """
    graph, mean = _graph(vertices, faces)
    sources = np.unique(faces)
    sources = sources[:: -(-len(sources) // MAX_SOURCES)]
    area = double_areas(edge_lengths(vertices, faces)).sum()
    flat = flat * np.sqrt(area / np.abs(signed_double_areas(flat[faces])).sum())
    errors = total = 0.0
    for begin in range(0, len(sources), SOURCES_AT_ONCE):
        check_cancelled()
        from_ = sources[begin : begin + SOURCES_AT_ONCE]
        reached = dijkstra(graph, directed=False, indices=from_, limit=REACH * mean)
        i, j = np.nonzero(np.isfinite(reached) & (reached > 0))
        on_surface = reached[i, j]
        errors += float(np.abs(np.linalg.norm(flat[from_[i]] - flat[j], axis=1) - on_surface).sum())
        total += float(on_surface.sum())
    return 100 * errors / total


def _graph(vertices: FloatArray, faces: IntArray) -> tuple[csr_matrix, float]:
    """Return the lengths of edges and of unfolded diagonals as a sparse matrix, and the mean length of an edge."""
    ends = faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    order, is_first = sort_pairs(ends[:, 0], ends[:, 1], len(vertices))
    apex, ends = faces.reshape(-1)[order], ends[order]
    edges = ends[is_first]
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    second = np.flatnonzero(~is_first)
    origin, end = vertices[ends[second]].transpose(1, 0, 2)
    base = np.linalg.norm(end - origin, axis=1)
    pairs = np.stack([apex[second - 1], apex[second]], axis=1)
    to = vertices[pairs] - origin[:, None]
    # Each triangle in the plane of the pair: along the common edge, and away from it.
    along = np.einsum("eix,ex->ei", to, end - origin) / base[:, None]
    away = np.sqrt(np.maximum(np.einsum("eix,eix->ei", to, to) - along**2, 0))
    crossing = (along * away[:, ::-1]).sum(axis=1) / away.sum(axis=1)
    inside = (crossing > 0) & (crossing < base)
    diagonals = np.hypot(along[:, 0] - along[:, 1], away.sum(axis=1))[inside]
    rows, columns = np.concatenate([edges, pairs[inside]]).T
    shape = (len(vertices), len(vertices))
    graph = coo_matrix((np.concatenate([lengths, diagonals]), (rows, columns)), shape)
    return graph.tocsr(), float(lengths.mean())
