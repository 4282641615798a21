"""Seams that are mirror symmetric: a part within the plane of symmetry, and branches in pairs.

The curve along the plane parts the surface into two halves. Each is cut to a disk, from that curve, and the two are
joined again along one stretch of it: that is a disk. Of the stretches between the places where branches leave it, the
dearest is the one that is not cut.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..geometry.mirror import Mirror, mirrored_edges
from ..mesh import TriangleMesh, label_components
from .cut import open_along
from .find import find_seams

# What an edge on the mirror image of a seam costs of what it would, where meshes are not alike on both sides; and from
# how many mean edges off it on it costs all of it.
FOLLOWED, ASTRAY = 0.05, 3.0
# How many stretches are tried as the one that is not cut; on larger meshes, triangles, one.
GAPS, LARGE = 3, 50_000
# Relative: what is gained must be more than rounding makes.
LEAST_GAIN = 1e-6


Found = TypeVar("Found", IntArray, IntArray | None)


@dataclass(frozen=True, eq=False)
class _Half:
    """A side of the mesh, opened along the plane.

    Attributes:
        mesh: the side alone.
        vertices: (h,) the vertex of the whole of each.
        edges: (e,) likewise.
    """

    mesh: TriangleMesh
    vertices: IntArray
    edges: IntArray


@dataclass(frozen=True, eq=False)
class _Symmetric:
    """Symmetric seams.

    Attributes:
        along: the edges in the plane.
        branches: those on both sides.
        cost: of all.
    """

    along: IntArray
    branches: IntArray
    cost: float


def mirrored_seams(
    mesh: TriangleMesh,
    mirror: Mirror,
    is_left: BoolArray,
    cones: IntArray,
    edge_costs: FloatArray,
    is_avoided: BoolArray,
    forbidden: IntArray,
) -> IntArray | None:
    """Return the edges (k,) that cut a connected mesh to a disk, symmetrically; None where that is not possible.

    Args:
        mesh: the mesh.
        mirror: its plane of symmetry.
        is_left: (m,) the faces on the left of a curve along that plane.
        cones: (s,) vertices that the seams must reach.
        edge_costs, is_avoided, forbidden: see `find_seams`.

    Raises:
        SeamError: every set of such seams needs forbidden edges.
    """
    work = _Cutting(mesh, mirror, is_left, cones, edge_costs, is_avoided, forbidden)
    if not work.are_halves:
        return None
    tries = GAPS if len(mesh.faces) <= LARGE else 1
    starts = work.whole_curve(tries) + work.between_cones(tries)
    found = min((work.shortened(start) for start in starts), key=lambda each: each.cost)
    seams = np.concatenate([found.along, found.branches])
    return None if work.is_forbidden[seams].any() else np.sort(seams)


class _Cutting:
    """The search for symmetric seams; see `mirrored_seams`."""

    def __init__(
        self,
        mesh: TriangleMesh,
        mirror: Mirror,
        is_left: BoolArray,
        cones: IntArray,
        edge_costs: FloatArray,
        is_avoided: BoolArray,
        forbidden: IntArray,
    ) -> None:
        self.mesh, self.mirror, self.cones, self.costs = mesh, mirror, cones, edge_costs
        inside = np.flatnonzero(~mesh.is_boundary_edge)
        sides = is_left[mesh.edge_faces[inside]]
        self.curve = inside[sides[:, 0] != sides[:, 1]]
        opened = open_along(mesh, self.curve)
        parts = list(opened.mesh.split_components())
        self.are_halves = len(parts) == 2
        if not is_left[parts[0][2][0]]:
            parts.reverse()
        self.halves = [_half(mesh, part, opened.origin[own], faces) for part, own, faces in parts]
        self.image = mirrored_edges(mesh, mirror.partner)
        self.is_forbidden = _marked(len(mesh.edges), forbidden)
        # Seams without a mirror image, or with one that is forbidden, are none.
        self.are_images = bool(mirror.is_paired and mirror.own[mesh.edges[self.curve]].all())
        alone = (self.image < 0) & self.are_images
        self.is_dear = self.is_forbidden | (self.are_images & ~alone & self.is_forbidden[self.image])
        self.is_avoided = is_avoided | alone
        self.dear = np.where(self.is_dear, edge_costs + edge_costs.sum(), edge_costs)

    def whole_curve(self, tries: int) -> list[_Symmetric]:
        """Return seams along all of the plane but one of the dearest stretches, branches beginning where they like."""
        on_left = self._open(0, self.costs)
        branches = np.concatenate([on_left, self._mirrored(on_left, lambda costs: self._open(1, costs))])
        stretch = self._stretches(self.curve, branches)
        dearest = np.argsort(-np.bincount(stretch, self.dear[self.curve]), kind="stable")[:tries]
        return [self._seams(self.curve[stretch != gap], branches) for gap in dearest]

    def between_cones(self, tries: int) -> list[_Symmetric]:
        """Return seams along all of the plane but one of the dearest stretches between cones and boundaries there.

        Branches that would end on it end elsewhere.
        """
        if not self.is_simple:
            return []
        stretch = self._stretches(self.curve, self.curve[:0])
        dearest = np.argsort(-np.bincount(stretch, self.dear[self.curve]), kind="stable")[:tries]
        whole = _Symmetric(self.curve, self.curve[:0], np.inf)
        found = [self._without(whole, self.curve[stretch == gap]) for gap in dearest]
        return [each for each in found if each is not None]

    @cached_property
    def is_simple(self) -> bool:
        """Whether the halves are disks that meet in one curve."""
        mesh, ends = self.mesh, self.mesh.edges[self.curve]
        if mesh.genus() or mesh.boundary_loops[0] > 1:
            return False
        return len(np.unique(label_components(len(mesh.vertices), *ends.T)[1][ends[:, 0]])) == 1

    def shortened(self, found: _Symmetric) -> _Symmetric:
        """Return seams less of which runs in the plane, branches ending at the rest, as long as they get shorter."""
        while self.is_simple:
            tries = [self._without(found, stretch) for stretch in self._end_stretches(found)]
            best = min(
                (each for each in tries if each is not None), key=lambda each: each.cost, default=found
            )
            if not best.cost < found.cost * (1 - LEAST_GAIN):
                break
            found = best
        return found

    def _stretches(self, along: IntArray, branches: IntArray) -> IntArray:
        """Return the stretch, between cones, branches, boundaries and ends of the curve, that edges of it belong to."""
        mesh = self.mesh
        degree = np.bincount(mesh.edges[self.curve].ravel(), minlength=len(mesh.vertices))
        is_node = mesh.is_boundary_vertex | (degree > 2)
        is_node[self.cones] = True
        is_node[mesh.edges[branches]] = True
        return edge_stretches(mesh, along, is_node)

    def _end_stretches(self, found: _Symmetric) -> list[IntArray]:
        """Return the edges of the stretches of the curve that may be left out, one at a time: those at its ends."""
        mesh = self.mesh
        if not len(found.along):
            return []
        degree = np.bincount(mesh.edges[found.along].ravel(), minlength=len(mesh.vertices))
        is_end = (degree == 1) & ~mesh.is_boundary_vertex
        stretch = self._stretches(found.along, found.branches)
        last = np.unique(stretch[is_end[mesh.edges[found.along]].any(axis=1)])
        return [found.along[stretch == each] for each in last]

    def _without(self, found: _Symmetric, stretch: IntArray) -> _Symmetric | None:
        """Return seams without a stretch of the plane; None if that does not open the mesh."""
        mesh = self.mesh
        along = np.setdiff1d(found.along, stretch)
        closed = _marked(len(mesh.vertices), mesh.edges[self.curve].ravel())
        closed &= ~_marked(len(closed), mesh.edges[along].ravel()) & ~mesh.is_boundary_vertex
        is_tied = len(along) > 0 or bool(mesh.is_boundary_vertex.any())
        if not is_tied or closed[self.cones].any() or self.is_dear[along].any():
            return None
        on_left = self._open_beside(0, along, closed, self.costs)
        if on_left is None:
            return None
        on_right = self._mirrored(on_left, lambda costs: self._open_beside(1, along, closed, costs))
        if on_right is None:
            return None
        branches = np.concatenate([on_left, on_right])
        return self._seams(along, branches)

    def _open_beside(
        self, side: int, along: IntArray, closed: BoolArray, costs: FloatArray
    ) -> IntArray | None:
        """Return the edges of one side that connect its cones to what is cut along the plane, None if they cannot.

        closed: (n,) the vertices of the plane where no branch may end.
        """
        mesh = self.mesh
        half = self.halves[side]
        inside = _marked(len(mesh.vertices), half.vertices)
        is_open = np.asarray((inside & ~closed)[mesh.edges].all(axis=1))
        is_open[self.curve] = False
        on_curve = np.isin(self.cones, mesh.edges[self.curve])
        seams = find_seams(
            mesh,
            self.cones[inside[self.cones] & ~on_curve],
            costs,
            self.is_avoided | ~is_open,
            required=along,
            forbidden=np.flatnonzero(self.is_dear),
        )
        branches = np.setdiff1d(seams, along)
        return branches if is_open[branches].all() else None

    def _without_loose_ends(self, along: IntArray, branches: IntArray) -> IntArray:
        """Return the part of the curve that is needed: what ends nowhere is not."""
        mesh = self.mesh
        holds = mesh.is_boundary_vertex.copy()
        holds[self.cones] = True
        holds[mesh.edges[branches]] = True
        while len(along):
            ends = mesh.edges[along]
            degree = np.bincount(ends.ravel(), minlength=len(holds))
            loose = ((degree == 1) & ~holds)[ends].any(axis=1)
            if not loose.any():
                break
            along = along[~loose]
        return along

    def _seams(self, along: IntArray, branches: IntArray) -> _Symmetric:
        along = self._without_loose_ends(along, branches)
        return _Symmetric(along, branches, float(self.dear[along].sum() + self.dear[branches].sum()))

    def _open(self, side: int, costs: FloatArray) -> IntArray:
        """Return the edges that cut a half to a disk with its cones on the border."""
        half = self.halves[side]
        inner = np.isin(half.vertices, self.cones) & ~half.mesh.is_boundary_vertex
        dear = self.is_dear[half.edges] & ~half.mesh.is_boundary_edge
        avoided = self.is_avoided[half.edges]
        given = half.mesh, np.flatnonzero(inner), costs[half.edges], avoided
        return half.edges[find_seams(*given, forbidden=np.flatnonzero(dear))]

    def _mirrored(self, on_left: IntArray, find: Callable[[FloatArray], Found]) -> IntArray | Found:
        """Return the mirror image of seams, or what is found near it if edges have none."""
        image = self.image[on_left]
        if self.are_images and (image >= 0).all():
            return image
        return find(self.costs * _astray(self.mesh, self.mirror, on_left))


def _marked(count: int, some: IntArray) -> BoolArray:
    marked = np.zeros(count, dtype=bool)
    marked[some] = True
    return marked


def _half(mesh: TriangleMesh, part: TriangleMesh, vertices: IntArray, faces: IntArray) -> _Half:
    side = part.edge_halfedges[:, 0]
    return _Half(part, vertices, mesh.halfedge_edges[3 * faces[side // 3] + side % 3])


def _astray(mesh: TriangleMesh, mirror: Mirror, seams: IntArray) -> FloatArray:
    """Return (e,) what edges cost of what they would, less near the mirror image of seams."""
    from scipy.spatial import cKDTree

    if not len(seams):
        return np.ones(len(mesh.edges))
    ends = mesh.vertices[mesh.edges]
    path = np.concatenate([ends[seams, 0], ends[seams, 1], ends[seams].mean(axis=1)])
    images = path - 2 * np.outer(path @ mirror.normal - mirror.offset, mirror.normal)
    off = cKDTree(images).query(mesh.vertices)[0][mesh.edges].mean(axis=1)
    mean = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()
    return np.clip(off / (ASTRAY * mean), FOLLOWED, 1.0)


def edge_stretches(mesh: TriangleMesh, edges: IntArray, is_node: BoolArray) -> IntArray:
    """Return (k,) the stretch that each of some edges belongs to: those that meet at vertices that are no nodes."""
    ends, count = mesh.edges[edges], len(mesh.vertices)
    # Nodes fall apart: every edge has its own copies.
    own = count + np.arange(2 * len(edges)).reshape(-1, 2)
    ends = np.where(is_node[ends], own, ends)
    label = label_components(count + 2 * len(edges), ends[:, 0], ends[:, 1])[1]
    return np.unique(label[ends[:, 0]], return_inverse=True)[1].ravel()
