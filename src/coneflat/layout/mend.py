"""The input's triangles cut where straight sides cannot keep them upright, and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..geometry.intrinsic import IntrinsicTriangulation, double, intrinsic_triangulation
from ..geometry.straight import FlatTriangles
from ..mesh import TriangleMesh, label_components
from .insert import FlatTriangulation, insert_edges
from .overlay import Overlay, count_crossings, trace_crossings
from .refine import Refinement, assemble_pieces, interpolate
from .subdivision import Pieces, find_pieces

if TYPE_CHECKING:
    from ..flat.exact.metric import ExactMetric


@dataclass(frozen=True, eq=False)
class Overlaid:
    """A mesh and a triangulation of its flat surface.

    Attributes:
        mesh: the mesh.
        log_scale: (n,) phi at the vertices of `source`.
        source: its own triangles, followed by their mirror image where there is one.
        original: (n,) the vertex of the mesh that each vertex of `source` is, or is a copy of.
        flat: the flat triangulation.
    """

    mesh: TriangleMesh
    log_scale: FloatArray
    source: IntrinsicTriangulation
    original: IntArray
    flat: FlatTriangulation

    @cached_property
    def whole(self) -> BoolArray:
        """(3m,) the half-edges of the mesh that are edges of the flat triangulation, too."""
        counts, first = count_crossings(self.source, self.flat.triangulation, self.flat.flips)
        whole = np.zeros(len(counts), dtype=bool)
        whole[first[counts < 0]] = True
        return whole[: self.mesh.faces.size]

    @property
    def is_whole_outside(self) -> bool:
        """Whether no edge of the boundary need be cut: what lies beyond it, along a marked seam, would not be."""
        sides = self.mesh.edge_halfedges[self.mesh.is_boundary_edge, 0]
        return bool(self.whole[sides].all())


def overlay_straight(mesh: TriangleMesh, metric: ExactMetric) -> Overlaid:
    """Return a mesh with a triangulation of a flat metric that has as many of its edges as there can be."""
    source = intrinsic_triangulation(mesh, np.ones((len(mesh.faces), 3)))
    original = np.arange(len(mesh.vertices))
    if metric.doubled:
        source, original = double(source)
    flat = insert_edges(source, metric.triangulation, metric.flips)
    return Overlaid(mesh, metric.log_scale[original], source, original, flat)


def mend(overlaid: Overlaid, straight: FlatTriangles, untangled: FlatTriangles) -> Refinement:
    """Return the mesh with those of its edges cut that bend around vertices, so that no triangle is turned over.

    They are cut where they cross the edges of the flat triangulation, and the new vertices lie on them. So the
    surface stays what it is.

    Args:
        overlaid: the mesh. Of a doubled surface the first half is cut.
        straight: its triangles on straight sides.
        untangled: the same after untangling, for which patches need no cut whose outlines are straight.

    Notes:
        Whatever places crossings have, as long as they follow each other along both edges in the right order, the
        pieces between are convex in the plane and in the input's triangles: the map is linear on the triangles of
        each. So no metric has to be kept on the way, and Euclidean flips do no harm, as they do in `refine`.
    """
    mesh, source, flat = overlaid.mesh, overlaid.source, overlaid.flat
    crossings = place_crossings(source, flat, overlaid.log_scale)
    ends = np.stack([source.tail[crossings.leaving], source.tail[source.twin[crossings.leaving]]], axis=1)
    positions = interpolate(mesh.vertices[overlaid.original], ends, crossings.on_leaving)
    pieces = find_pieces(source, flat.triangulation, flat.sides, crossings, positions)
    moved = _kept_moves(overlaid, straight, untangled)
    pieces = _with_moved(pieces, moved, mesh, untangled)
    log_scale = np.concatenate([overlaid.log_scale, crossings.log_scale])
    refined = assemble_pieces(mesh, source, crossings, positions, log_scale, pieces, flat.turns)
    return _turned(refined, moved)


def place_crossings(
    source: IntrinsicTriangulation, flat: FlatTriangulation, log_scale: FloatArray
) -> Overlay:
    """Return the crossings of the input's edges with those of a flat triangulation, evenly spaced along the latter.

    Along the input's edges they are spaced as along the polygons in the plane.

    Args:
        source: the input's triangles.
        flat: the flat triangulation.
        log_scale: (n,) phi, which is linear along the input's edges.
    """
    triangulation = flat.triangulation
    counts, first = count_crossings(source, triangulation, flat.flips)
    offset, number, crossed, leaving, _, _ = trace_crossings(source, triangulation, counts, first)
    lower = np.flatnonzero((counts > 0) & (np.arange(len(counts)) < triangulation.twin))
    edge = np.repeat(lower, counts[lower])
    part = np.empty(len(crossed))
    part[number] = (np.arange(len(edge)) - offset[edge] + 1) / (counts[edge] + 1)
    part = np.where(crossed < triangulation.twin[crossed], part, 1 - part)
    along = _along(flat, crossed, leaving, part)
    ends = np.stack([source.tail[leaving], source.tail[source.twin[leaving]]], axis=1)
    weights = np.stack([1 - along, along], axis=1)
    return Overlay(
        counts,
        first,
        offset,
        number,
        crossed,
        leaving,
        np.stack([1 - part, part], axis=1),
        weights,
        (weights * log_scale[ends]).sum(axis=1),
    )


def _along(flat: FlatTriangulation, crossed: IntArray, leaving: IntArray, part: FloatArray) -> FloatArray:
    """Return (x,) which part of an input edge's polygon in the plane lies before each crossing.

    crossed, leaving: (x,) see `Overlay`. part: (x,) where on the half-edge crossed.
    """
    sides = flat.sides.reshape(-1, 3)

    def place(halfedge: IntArray, part: FloatArray) -> ComplexArray:
        """Return points of half-edges in the frame of their triangles, from corner 0."""
        f, i = halfedge // 3, halfedge % 3
        start = np.where(i == 0, sides[f, 2], np.where(i == 1, -sides[f, 1], 0))
        corner: ComplexArray = start + part * sides[f, i]
        return corner

    def apex(halfedge: IntArray) -> ComplexArray:
        f, i = halfedge // 3, halfedge % 3
        corner: ComplexArray = np.where(i == 0, 0, np.where(i == 1, sides[f, 2], -sides[f, 1]))
        return corner

    if not len(crossed):
        return part
    opposite = flat.triangulation.twin[crossed]
    starts = np.flatnonzero(np.append(True, leaving[1:] != leaving[:-1]))
    last = np.append(starts[1:], len(crossed)) - 1
    here = place(crossed, part)
    before = np.append(0, place(opposite, 1 - part)[:-1])
    before[starts] = apex(crossed[starts])
    step = np.abs(here - before)
    rest = np.abs(place(opposite[last], 1 - part[last]) - apex(opposite[last]))
    total = np.add.reduceat(step, starts) + rest
    run = np.cumsum(step)
    count = last - starts + 1
    along: FloatArray = (run - np.repeat(run[starts] - step[starts], count)) / np.repeat(total, count)
    return along


def _kept_moves(overlaid: Overlaid, straight: FlatTriangles, untangled: FlatTriangles) -> BoolArray:
    """Return (m,) the triangles that untangling changed, in patches all around which edges are whole."""
    mesh, whole = overlaid.mesh, overlaid.whole
    changed = (straight.sides != untangled.sides).reshape(-1, 3).any(axis=1)
    faces, across = np.arange(len(straight.twin)) // 3, straight.twin // 3
    beside = (straight.twin >= 0) & changed[faces]
    inner = beside & changed[across]
    count, patch = label_components(len(mesh.faces), faces[inner], across[inner])
    outline = beside & ~changed[across]
    open_patch = np.zeros(count, dtype=bool)
    open_patch[patch[faces[outline & ~whole]]] = True
    kept: BoolArray = changed & ~open_patch[patch]
    return kept


def _with_moved(pieces: Pieces, moved: BoolArray, mesh: TriangleMesh, untangled: FlatTriangles) -> Pieces:
    """Return the pieces with some of the input's triangles whole, as untangling has made them."""
    is_moved = np.zeros(int(pieces.origin.max()) + 1, dtype=bool)
    is_moved[: len(moved)] = moved
    rest, faces = np.flatnonzero(~is_moved[pieces.origin]), np.flatnonzero(moved)
    halfedges = 3 * faces[:, None] + np.arange(3)
    blocks = {
        "origin": faces,
        "corners": mesh.faces[faces],
        "sides": untangled.sides[halfedges],
        "on_flat": np.full(halfedges.shape, -1),
        "on_input": halfedges,
    }
    joined = [np.concatenate([getattr(pieces, name)[rest], block]) for name, block in blocks.items()]
    order = np.argsort(joined[0], kind="stable")
    return Pieces(*(block[order] for block in joined))


def _turned(refined: Refinement, moved: BoolArray) -> Refinement:
    """Return the refinement with the turns between the frames of moved triangles and of others beside them."""
    flat = refined.flat
    halfedges = np.flatnonzero(flat.twin >= 0)
    is_moved = moved[refined.face_origin]
    halfedges = halfedges[is_moved[halfedges // 3] | is_moved[flat.twin[halfedges] // 3]]
    turns = flat.turns.copy()
    turn = -flat.sides[halfedges] * np.conj(flat.sides[flat.twin[halfedges]])
    turns[halfedges] = turn / np.abs(turn)
    return replace(refined, flat=replace(flat, turns=turns))
