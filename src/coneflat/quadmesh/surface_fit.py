"""Whether quads follow their surface: their area, distances in both directions, and sides that leap across gaps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import dijkstra

from ..base import BoolArray, FloatArray, IntArray, plural
from ..geometry import double_areas, edge_lengths
from ..geometry.nearest import Stars, slide_near, surface_distances
from .features import vertex_graph
from .quad_mesh import QuadMesh

# Bounds of the area of quads, relative to that of the surface. Quads have less area than a curved or rough surface: 300
# on a bunny 0.90 of it, 70 on a shaft 0.71, 20 on a shaft 0.43; so the least area is less for fewer quads than these.
MIN_AREA, QUADS_AT_MIN_AREA, MAX_AREA = 0.5, 100, 1.05
# Largest share of the area of the grid that boundaries cut and no quads replace.
MAX_SHARE_LEFT_OUT = 0.05
# Largest distance between quads and surface, in edges of the grid.
MAX_DISTANCE = 2.0
# A side leaps if the way between its ends on the surface is longer than the side by so many edges of the grid.
MAX_DETOUR = 4.0
# A point that slides along the surface to the other end of a side has arrived if it is so near, in edges of the grid.
ARRIVED = 0.25
# Rows of sample points of a triangle.
MAX_ROWS = 64
# Suspect sides whose ways are measured; of more, so many are.
MAX_MEASURED_SIDES = 500


@dataclass(frozen=True)
class SurfaceFit:
    """How well quads follow their surface.

    Attributes:
        quads: number of quads.
        area_ratio: their area over that of the surface, where no hole is filled.
        filled_ratio: their area over that of the surface with filled holes.
        distance_to, distance_from: largest distance from middles of quads to the surface, and from the surface to the
            quads, in edges of the grid: roots of the area of the surface over the number of quads.
        leaps: number of quads that leap to another part of the surface: their middle is far from it, or the way between
            two neighbouring corners on the surface is far longer than the side.
        share_left_out: share of the area of the grid that boundaries cut and no quads replace.
    """

    quads: int
    area_ratio: float
    filled_ratio: float
    distance_to: float
    distance_from: float
    leaps: int
    share_left_out: float

    @property
    def problems(self) -> tuple[str, ...]:
        """What is wrong with the quads, none if they follow the surface."""
        return tuple(self._problems())

    def _problems(self) -> Iterator[str]:
        if self.leaps:
            yield f"{plural(self.leaps, 'quad')} of {self.quads:,} leap to another part of the surface"
        least_area = MIN_AREA * min(1.0, self.quads / QUADS_AT_MIN_AREA)
        if not (self.area_ratio >= least_area and self.filled_ratio <= MAX_AREA):
            yield f"the area of the quads is {self.area_ratio:.3g} times that of the surface"
        if self.share_left_out > MAX_SHARE_LEFT_OUT:
            yield f"{100 * self.share_left_out:.0f} % of the area of the grid without quads, as boundaries cut them"
        if not self.distance_from < MAX_DISTANCE:
            yield f"the surface is up to {self.distance_from:.1f} edges away from the quads"
        if not self.distance_to < MAX_DISTANCE:
            yield f"the quads are up to {self.distance_to:.1f} edges away from the surface"


def fit_to_surface(quads: QuadMesh, filled_area: float = 0.0) -> SurfaceFit:
    """Return how well quads follow their surface.

    Args:
        quads: the quads, at least one, with vertices on their surface.
        filled_area: area of the holes of the surface that quads may cover.

    Notes:
        A point slides from one end of each side towards the other end, as in smoothing. Only where it does not arrive,
        the way along edges of the surface is measured by Dijkstra's algorithm. Edges of the surface at both ends do
        not count, because the ends need not be vertices.
    """
    surface = quads.surface
    area = _area(surface.vertices, surface.faces)
    edge = np.sqrt(max(area, np.finfo(float).tiny) / len(quads.quads))
    middles = quads.vertices[quads.quads].mean(axis=1)
    off = surface_distances(surface.vertices, surface.faces, middles) / edge
    # Components without area have no quads; a note says which others have none.
    labels = surface.components[1][surface.faces[:, 0]]
    has_quads = np.isin(labels, labels[quads.faces])
    samples = surface_samples(surface.vertices, surface.faces[has_quads], edge)
    missed = surface_distances(quads.vertices, quads.triangles, samples) / edge
    quads_area = _area(quads.vertices, quads.triangles)
    return SurfaceFit(
        quads=len(quads.quads),
        area_ratio=quads_area / area,
        filled_ratio=quads_area / (area + filled_area),
        distance_to=float(off.max()),
        distance_from=float(missed.max()),
        leaps=int(((off > MAX_DISTANCE) | _leaping_quads(quads, edge)).sum()),
        share_left_out=_share_left_out(quads),
    )


def _share_left_out(quads: QuadMesh) -> float:
    """Return the share of the area of the grid that boundaries cut; of degenerate quads there is a note."""
    return quads.area_left_out / (quads.area_left_out + len(quads.quads)) if quads.left_out else 0.0


def _area(vertices: FloatArray, triangles: IntArray) -> float:
    return float(double_areas(edge_lengths(vertices, triangles)).sum()) / 2


def _leaping_quads(quads: QuadMesh, edge: float) -> BoolArray:
    """Return (p,) whether the way between two neighbouring corners on the surface is far longer than the side.

    edge: that of the grid, in model units.
    """
    is_leap = np.zeros(len(quads.edges), dtype=bool)
    suspects = _unreached(quads, ARRIVED * edge)
    measured = suspects[:: max(1, -(-len(suspects) // MAX_MEASURED_SIDES))]
    is_leap[measured] = _detours(quads, measured, MAX_DETOUR * edge) > MAX_DETOUR * edge
    count = len(quads.vertices)
    keys = quads.edges[is_leap] @ [count, 1]
    ahead = np.roll(quads.quads, -1, axis=1)
    sides = np.minimum(quads.quads, ahead) * count + np.maximum(quads.quads, ahead)
    return np.asarray(np.isin(sides, keys).any(axis=1))


def _unreached(quads: QuadMesh, tolerance: float) -> IntArray:
    """Return the edges whose first vertex does not slide to within a tolerance of the second, nor conversely."""
    surface, edges = quads.surface, np.arange(len(quads.edges))
    stars = Stars.of(surface.vertices, surface.faces)
    for turn in (0, 1):
        start, end = quads.edges[edges, turn], quads.edges[edges, 1 - turn]
        faces, weights = quads.faces[start], quads.barycentric[start]
        slide_near(stars, quads.vertices[end], faces, weights)
        off = np.linalg.norm(stars.at(faces, weights) - quads.vertices[end], axis=1)
        edges = edges[off > tolerance]
    return edges


def _detours(quads: QuadMesh, edges: IntArray, longest: float) -> FloatArray:
    """Return (k,) by how much the way along the surface between the ends of edges is longer than the edge, at least.

    Infinite if it is longer by more than `longest`.
    """
    mesh, graph = quads.surface, vertex_graph(quads.surface)
    lengths = edge_lengths(mesh.vertices, mesh.faces).max(axis=1)
    first, second = quads.edges[edges].T
    corners = mesh.faces[quads.faces]
    nearest = corners[np.arange(len(corners)), quads.barycentric.argmax(axis=1)]
    side = np.linalg.norm(quads.vertices[first] - quads.vertices[second], axis=1)
    # The way along edges is longer than the shortest way, by at most a half in meshes without thin triangles.
    slack = 2 * (lengths[quads.faces[first]] + lengths[quads.faces[second]])
    detours = np.empty(len(edges))
    for k in range(len(edges)):
        limit = 1.5 * (side[k] + longest) + slack[k]
        ways = dijkstra(graph, directed=False, indices=nearest[first[k]], limit=limit)
        detours[k] = (ways[nearest[second[k]]] - slack[k]) / 1.5 - side[k]
    return detours


def surface_samples(vertices: FloatArray, faces: IntArray, spacing: float) -> FloatArray:
    """Return (s, 3) sample points of triangles: their vertices, and rows with a given spacing or `MAX_ROWS`."""
    longest = edge_lengths(vertices, faces).max(axis=1)
    rows = np.minimum(np.ceil(longest / spacing), MAX_ROWS).astype(np.int64)
    is_long = rows > 1
    return np.concatenate(
        [vertices[np.unique(faces)], samples_in_rows(vertices, faces[is_long], rows[is_long])]
    )


def samples_in_rows(vertices: FloatArray, faces: IntArray, rows: IntArray) -> FloatArray:
    """Return (s, 3) sample points of triangles, each in a number of rows (m,)."""
    parts = [np.empty((0, 3))]
    for count in np.unique(rows):
        i, j = np.indices((count, count)).reshape(2, -1)
        # Centroids of the small triangles with the orientation of the large one.
        u, v = ((x[i + j < count] + 1 / 3) / count for x in (i, j))
        corners = vertices[faces[rows == count]]
        parts.append(np.einsum("si,fix->fsx", np.stack([1 - u - v, u, v], axis=1), corners).reshape(-1, 3))
    return np.concatenate(parts)
