"""Smoothing of quad meshes by moving vertices on the surface, and improvement of the worst quads vertex by vertex."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..base import BoolArray, FloatArray, IntArray, dots, mask_of
from ..geometry.nearest import Stars, slide_near
from ..options import declarations
from .cross_field import SHARP_ANGLE
from .features import edge_indices, sharp_edges
from .options import QuadOptions
from .quad_mesh import QuadMesh, least_jacobians

# Least scaled Jacobian: no quad falls below it, and quads that are below it do not get worse.
MIN_JACOBIAN = 0.5


@dataclass(frozen=True, eq=False)
class MovingQuads:
    """Quads whose vertices move on their surface.

    Attributes:
        mesh: the quads; positions, triangles and barycentric coordinates of vertices are updated in place, so that
            what it computes from them is right only after all moves.
        stars: the surface, with the triangles around each vertex.
        settled: (q,) whether no position near each vertex was better, and no vertex of a quad around it has moved
            since; updated in place.
    """

    mesh: QuadMesh
    stars: Stars
    settled: BoolArray

    @classmethod
    def of(cls, quads: QuadMesh) -> MovingQuads:
        """Return a copy of a mesh to move."""
        points, faces, weights = quads.vertices.copy(), quads.faces.copy(), quads.barycentric.copy()
        mesh = replace(quads, vertices=points, faces=faces, barycentric=weights)
        stars = Stars.of(quads.surface.vertices, quads.surface.faces)
        return cls(mesh, stars, np.zeros(len(points), dtype=bool))

    def improve_worst(self, movable: BoolArray, below: float = 0.2) -> None:
        """Move vertices of bad quads to maximize the least scaled Jacobian of the quads around each.

        The least scaled Jacobian around a vertex never decreases, and no positively oriented quad is flipped.

        Args:
            movable: (q,) whether each vertex may move.
            below: bound of the scaled Jacobian, below which a quad is bad.
        """
        points, quads = self.mesh.vertices, self.mesh.quads
        _, _, start, star = Stars.of(points, quads)
        for _ in range(8):
            jacobians = least_jacobians(points, quads)
            bad = np.flatnonzero(jacobians < below)
            worst_first = quads[bad[np.argsort(jacobians[bad], kind="stable")]].ravel()
            candidates = worst_first[np.sort(np.unique(worst_first, return_index=True)[1])]
            queue = candidates[movable[candidates] & ~self.settled[candidates]].tolist()
            if not queue:
                return
            while queue:
                # Vertices without a common quad move at once, the others later.
                moves, later, taken = list[int](), list[int](), set[int]()
                for v in queue:
                    if taken.isdisjoint(around := star[start[v] : start[v + 1]].tolist()):
                        moves.append(v)
                        taken.update(around)
                    else:
                        later.append(v)
                self._improve(np.array(moves))
                queue = later

    def untangle(self) -> None:
        """Move vertices around flipped quads, and in up to five rings around these, until no quad is flipped.

        It may fail. Vertices on sharp edges move too, because a flipped quad is worse than a sharp edge that is not
        followed. Those on the boundary do not move.
        """
        quads = self.mesh.quads
        for rings in range(6):
            is_flipped = least_jacobians(self.mesh.vertices, quads) <= 0
            if not is_flipped.any():
                return
            movable = mask_of(len(self.mesh.vertices), quads[is_flipped])
            for _ in range(rings):
                movable[quads[movable[quads].any(axis=1)]] = True
            self.improve_worst(movable & ~self.mesh.is_boundary_vertex, 0.2 + 0.12 * rings)

    def _improve(self, moves: IntArray) -> None:
        """Move vertices (k,) without a common quad to the best of several trial positions, if better than their own."""
        mesh, stars, quads = self.mesh, self.stars, self.mesh.quads
        points, faces, barycentric = mesh.vertices, mesh.faces, mesh.barycentric
        number = np.full(len(points), -1)
        number[moves] = np.arange(len(moves))
        owner = number[quads].max(axis=1)
        around = np.argsort(owner, kind="stable")[-int((owner >= 0).sum()) :]
        around, owner = quads[around], owner[around]
        sides = np.linalg.norm(points[np.roll(around, -1, axis=1)] - points[around], axis=2).mean(axis=1)
        length = np.bincount(owner, sides) / np.bincount(owner)
        turns = np.exp(2j * np.pi * np.arange(12) / 12).view(float).reshape(12, 2)
        circle = turns @ stars.axes(faces[moves])
        offsets = np.einsum("k,r,kax->krax", length, [0.5, 0.25, 0.1, 0.04], circle)
        count = offsets[0].size // 3
        on, weights = faces[moves].repeat(count), barycentric[moves].repeat(count, axis=0)
        slide_near(stars, (points[moves][:, None, None] + offsets).reshape(-1, 3), on, weights)
        # The quads around the vertices for each trial position; the last is the current one.
        places = stars.at(on, weights).reshape(len(moves), count, 3)
        trials = np.concatenate([places, points[moves][:, None]], axis=1)
        moves_there = (around == moves[owner][:, None])[:, None, :, None]
        corners = np.where(moves_there, trials[owner][:, :, None], points[around][:, None])
        numbers = np.arange(corners.size // 3).reshape(-1, 4)
        jacobians = least_jacobians(corners.reshape(-1, 3), numbers).reshape(len(around), -1)
        first = np.flatnonzero(np.diff(owner, prepend=-1))
        inverts = np.logical_or.reduceat((jacobians <= 0) & (jacobians[:, -1:] > 0), first)
        worst = np.where(inverts, -np.inf, np.minimum.reduceat(jacobians, first))
        best = worst[:, :-1].argmax(axis=1)
        improved = np.flatnonzero(worst[np.arange(len(moves)), best] > worst[:, -1])
        v, chosen = moves[improved], improved * count + best[improved]
        points[v], faces[v], barycentric[v] = trials[improved, best[improved]], on[chosen], weights[chosen]
        self.settled[moves] = True
        self.settled[quads[mask_of(len(points), v)[quads].any(axis=1)]] = False


def smooth_quads(quads: QuadMesh, rounds: int = QuadOptions.smooth, features: ArrayLike = ()) -> QuadMesh:
    """Return a smoothed quad mesh: quads are closer to squares, and vertices remain on the surface.

    Each quad is projected to the nearest square. Each vertex moves to the mean of its projected positions, and from
    there to the nearest point of the surface nearby. The corners of a quad do not move if its scaled Jacobian would
    become too low. Finally, bad quads are improved by moving single vertices. Vertices on the boundary do not move.
    Those on edges of the surface with a dihedral angle above 35 degrees, and on features, move only near flipped quads.

    Args:
        quads: the quad mesh.
        rounds: number of rounds.
        features: (f, 2) vertices of further edges of the surface.

    Raises:
        OptionError: the number of rounds is not an integer, 0 or more.

    References:
        S. Bouaziz, M. Deuss, Y. Schwartzburg, T. Weise, M. Pauly, "Shape-Up: shaping discrete geometry with
        projections", 2012, Section 4.
    """
    rounds = declarations(QuadOptions)["smooth"].kind.parse("rounds", rounds)
    moving, ends = MovingQuads.of(quads), np.asarray(features, dtype=np.int64).reshape(-1, 2)
    mesh, stars = moving.mesh, moving.stars
    points, faces, barycentric = mesh.vertices, mesh.faces, mesh.barycentric
    movable = ~(quads.is_boundary_vertex | is_on_feature(quads, ends))
    for _ in range(rounds):
        targets = square_corners(points, quads.quads)[movable]
        on, weights, moved = faces[movable], barycentric[movable], points.copy()
        slide_near(stars, targets, on, weights)
        moved[movable] = stars.at(on, weights)
        gone = movable & ~blocked(points, moved, quads.quads)
        points[gone], faces[gone], barycentric[gone] = moved[gone], on[gone[movable]], weights[gone[movable]]
    if rounds:
        moving.improve_worst(movable)
        moving.untangle()
    return mesh


def square_corners(points: FloatArray, quads: IntArray) -> FloatArray:
    """Return (q, 3) the mean position of each vertex in the squares nearest to its quads.

    Corner k of a square with centre c is c + J^k z, where J is the quarter turn in the plane of the quad. The nearest
    square has the mean of J^-k (p_k - c) as z.
    """
    corners = points[quads]
    centre = corners.mean(axis=1)
    u, w = corners[:, 0] - corners[:, 2], corners[:, 1] - corners[:, 3]
    normal = np.cross(u, w)
    normal /= np.maximum(np.sqrt(dots(normal, normal)), np.finfo(float).tiny)[:, None]
    z = (u - np.cross(normal, w)) / 4
    rotated = np.cross(normal, z)
    targets = centre[:, None] + np.stack([z, rotated, -z, -rotated], axis=1)
    at = quads.ravel()
    sums = [np.bincount(at, targets[..., x].ravel(), len(points)) for x in range(3)]
    return np.stack(sums, axis=1) / np.maximum(np.bincount(at, minlength=len(points)), 1)[:, None]


def blocked(before: FloatArray, moved: FloatArray, quads: IntArray) -> BoolArray:
    """Return (q,) whether each vertex must not move, so that no quad gets worse than MIN_JACOBIAN and than before."""
    stays = np.zeros(len(before), dtype=bool)
    bound = np.minimum(least_jacobians(before, quads), MIN_JACOBIAN)
    while True:
        bad = least_jacobians(np.where(stays[:, None], before, moved), quads) < bound
        bad &= ~stays[quads].all(axis=1)
        if not bad.any():
            return stays
        stays[quads[bad]] = True


def is_on_feature(quads: QuadMesh, features: IntArray) -> BoolArray:
    """Return (q,) whether each vertex is on a sharp edge of the surface or on a feature (f, 2)."""
    mesh = quads.surface
    sharp = mask_of(len(mesh.edges), sharp_edges(mesh, SHARP_ANGLE))
    sharp[edge_indices(mesh, features)] = True
    has_sharp = mask_of(len(mesh.vertices), mesh.edges[sharp])
    zero, edges = quads.barycentric <= 0, mesh.halfedge_edges.reshape(-1, 3)[quads.faces]
    at_corner = has_sharp[mesh.faces[quads.faces]] & ~zero & (zero.sum(axis=1) == 2)[:, None]
    return ((zero & sharp[edges]) | at_corner).any(axis=1)
