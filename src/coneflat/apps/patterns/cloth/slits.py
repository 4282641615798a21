"""Slits from the seams of a cut surface, until no edge is strained by more than a material allows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .... import TriangleMesh
from ....base import BoolArray, FloatArray, IntArray, begin_step, has_any, mask_of
from ....geometry import angle_defect, corner_angles, edge_lengths
from ....linalg import MultiGraph
from ....mesh import label_components, nearby
from ..pieces.cut_surface import CutSurface
from ..pieces.relaxing import EVEN, SMALLEST, closed_seams, excess, relaxed
from ..pieces.separation import without_overlaps
from ..pieces.strain import Stretch

# Rings of triangles around new cuts whose points move.
RINGS = 16
# Vertices at the tips of slits of the same round are more edges than this apart.
TIP_DISTANCE = 16


def slit_until_within(surface: CutSurface, stretch: Stretch) -> CutSurface:
    """Return a cut surface with slits from its seams, until its strain is within the bound and nothing overlaps."""
    return Slitting.of(surface, stretch).until_within()


@dataclass(frozen=True, eq=False)
class Slitting:
    """A cut surface that gets slits.

    Slits end where the strain is concentrated if it is only moderately even: the more even it is, the more edges have
    the largest one.

    Attributes:
        even: the layout in which strain is moderately even.
        flat: the layout with the smallest largest strain.
        stretch: what the material allows.
    """

    even: CutSurface
    flat: CutSurface
    stretch: Stretch

    @classmethod
    def of(cls, surface: CutSurface, stretch: Stretch) -> Slitting:
        """Return the layouts of a surface without slits."""
        even = relaxed(surface, stretch, EVEN)
        return cls(even, relaxed(even, stretch, SMALLEST), stretch)

    @property
    def strained_share(self) -> float:
        """The fraction of edges that are strained beyond the bound."""
        return float((excess(self.flat, self.stretch) > 0).mean())

    def until_within(self, max_length: float = np.inf) -> CutSurface:
        """Return the surface with slits until its strain is within the bound, and nothing overlaps.

        It is also returned once its seams are longer than `max_length`.

        Every round cuts more edges. The strain remains beyond the bound only if triangles that are cut apart could not
        be laid out.
        """
        slitting, seam_count = self, -1
        while len(slitting.flat.seams) > seam_count and slitting.flat.seam_length <= max_length:
            begin_step()
            seam_count = len(slitting.flat.seams)
            surface = slitting.flat
            beyond = excess(surface, self.stretch)
            if not beyond.any():
                separated = without_overlaps(surface)
                if separated is not surface:
                    slitting = slitting._separated(separated)
                    continue
                surface = closed_seams(surface)
                beyond = excess(surface, self.stretch)
                if not beyond.any():
                    return surface
            slitting = slitting._with_slits(beyond > 0)
        return closed_seams(without_overlaps(slitting.flat))

    def _with_slits(self, remains: BoolArray) -> Slitting:
        """Return the surface with slits to regions of flat edges whose strain remains too large, (k,) True."""
        slits = _slits(self.even, excess(self.even, self.stretch), remains)
        seams = np.union1d(self.even.seams, slits)
        return self._relaxed_near(self.even.cut_along(seams), self.flat.cut_along(seams), slits)

    def _separated(self, separated: CutSurface) -> Slitting:
        """Return the layouts of the surface with the seams that separate its overlaps."""
        even = self.even.cut_along(separated.seams, separated.places)
        return self._relaxed_near(even, even, np.setdiff1d(separated.seams, self.flat.seams))

    def _relaxed_near(self, even: CutSurface, flat: CutSurface, cuts: IntArray) -> Slitting:
        """Return layouts relaxed around new cuts (k,), edges of the mesh."""
        is_cut = mask_of(len(even.mesh.vertices), even.mesh.edges[cuts])
        is_free = nearby(even.corners, has_any(is_cut, even.mesh.faces), RINGS)
        even = relaxed(even, self.stretch, EVEN[-1:], is_free)
        exponents = (*EVEN[-1:], *SMALLEST)
        return Slitting(
            even, relaxed(flat, self.stretch, exponents, is_free, until_within=True), self.stretch
        )


def _slits(surface: CutSurface, beyond: FloatArray, remains: BoolArray) -> IntArray:
    """Return the edges of new cuts: from the worst vertices of strained regions to the nearest seam or border.

    A region in and beside which all vertices are on seams or borders is divided at its most strained edge.

    Args:
        surface: the surface.
        beyond: (k,) the excess of the strain of its edges.
        remains: (k,) edges whose strain remains too large if the largest strain is minimised. Only regions with such
            edges count.
    """
    mesh, count = surface.mesh, len(surface.mesh.vertices)
    ends = mesh.edges[surface.edges.edges]
    score = np.asarray(np.bincount(ends.ravel(), np.repeat(beyond, 2), count), dtype=np.float64)
    is_needed = mask_of(count, ends[remains])
    is_strained = (score > 0) | is_needed
    inside = mesh.edges[is_strained[mesh.edges].all(axis=1)]
    _, region = label_components(count, inside[:, 0], inside[:, 1])
    curvature = _curvature(mesh)
    tips, chords = list[IntArray](), list[int]()
    for members in _groups(region, is_strained):
        if not is_needed[members].any():
            continue
        weight = score * curvature
        inner = members[~surface.is_border_vertex[members]]
        if not len(inner):
            weight, inner = curvature, _inner_neighbours(mesh, surface.is_border_vertex, members)
        if len(inner):
            tips.append(_peaks(mesh, weight, inner))
        else:
            chords += _chord(surface, score, members)
    paths = _paths(surface, np.concatenate([*tips, np.empty(0, dtype=np.int64)]))
    return np.union1d(paths, np.array(chords, dtype=np.int64))


def _curvature(mesh: TriangleMesh) -> FloatArray:
    angles = corner_angles(edge_lengths(mesh.vertices, mesh.faces))
    return np.abs(angle_defect(mesh.faces, angles, mesh.is_boundary_vertex))


def _peaks(mesh: TriangleMesh, weight: FloatArray, vertices: IntArray) -> IntArray:
    """Return the vertices whose weight is the largest within some distance, among some of them."""
    largest = np.zeros(len(weight))
    largest[vertices] = weight[vertices]
    for _ in range(TIP_DISTANCE):
        around = largest[mesh.edges].max(axis=1)
        np.maximum.at(largest, mesh.edges.ravel(), np.repeat(around, 2))
    is_peak = (weight[vertices] > 0) & (weight[vertices] == largest[vertices])
    return vertices[is_peak] if is_peak.any() else vertices[[np.argmax(weight[vertices])]]


def _chord(surface: CutSurface, score: FloatArray, vertices: IntArray) -> list[int]:
    """Return an edge inside a piece with the most strained ends of those at some vertices, if there is one."""
    mesh = surface.mesh
    is_inside = ~mesh.is_boundary_edge
    is_inside[surface.seams] = False
    is_given = mask_of(len(mesh.vertices), vertices)
    edges = np.flatnonzero(is_inside & is_given[mesh.edges].any(axis=1))
    return edges[[np.argmax(score[mesh.edges[edges]].sum(axis=1))]].tolist() if len(edges) else []


def _groups(label: IntArray, chosen: BoolArray) -> list[IntArray]:
    """Return the chosen items of each label."""
    items = np.flatnonzero(chosen)
    items = items[np.argsort(label[items], kind="stable")]
    return np.split(items, np.flatnonzero(np.diff(label[items])) + 1)


def _inner_neighbours(mesh: TriangleMesh, is_border: BoolArray, vertices: IntArray) -> IntArray:
    """Return the neighbours of vertices that are not on seams."""
    is_given = mask_of(len(mesh.vertices), vertices)
    ends = np.unique(mesh.edges[is_given[mesh.edges].any(axis=1)])
    return ends[~is_border[ends]]


def _paths(surface: CutSurface, tips: IntArray) -> IntArray:
    """Return the edges on the way from the tips to the nearest seam or border."""
    mesh = surface.mesh
    graph = MultiGraph(len(mesh.vertices), mesh.edges, surface.edge_lengths, mesh.incident_edges)
    paths = graph.shortest_paths(np.flatnonzero(surface.is_border_vertex))
    return paths.edge[paths.nodes_to(tips)]
