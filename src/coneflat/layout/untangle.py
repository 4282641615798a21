"""Turning the few inverted triangles of a flat metric over, by moving vertices on the flat surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, hstack, identity, vstack
from scipy.sparse.linalg import splu

from .._arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..mesh import label_components
from .straighten import FlatTriangles

# Height over longest side up to which a triangle counts as degenerate: coordinates in the plane are good to
# about 1e-12 of an edge, and a triangle must stay upright when they are rounded.
DEGENERATE = 1e-8
# Height over longest side that a bad triangle is asked to get, and below which thin ones are helped.
WANTED_HEIGHT = 0.15
# A patch counts as done when every triangle has this part of the area it is asked to get.
ENOUGH = 0.02
# Rings of triangles around the bad ones that are let loose, one after another until it works: with seams held
# at first, then with their vertices loose, then with those of the boundary, too.
RINGS_BESIDE_SEAMS = (1, 2, 4)
RINGS = (1, 2, 4, 8)
# Regularisation of the determinant: its floor, and its size relative to the worst determinant of the patch
# (Garanzha et al. 2021, Section 4).
FLOOR, RELATIVE = 1e-3, 0.2
# Newton steps after which a patch is given up, to be tried again with more of its surroundings.
STEPS = 60
# Part of the slope that a step must gain at least, and halvings after which a patch is stuck.
ARMIJO, HALVINGS = 1e-4, 20
# Parts of the way found that are tried in the end, so that no vertex moves further than it need.
PARTS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)


@dataclass(frozen=True, eq=False)
class Untangled:
    """Flat triangles after untangling.

    Attributes:
        flat: the triangles; their frames and gluing are the ones before.
        moved: (k,) vertices that were moved.
        largest_move: the longest way, relative to the mean length of the edges at the vertex.
        left: (j,) triangles that are inverted or degenerate still.
    """

    flat: FlatTriangles
    moved: IntArray
    largest_move: float
    left: IntArray


def heights(sides: ComplexArray) -> FloatArray:
    """Return (m,) height over longest side of triangles with sides (m, 3); negative for inverted ones."""
    doubled = (np.conj(sides[:, 0]) * sides[:, 1]).imag
    ratio: FloatArray = doubled / (np.abs(sides) ** 2).max(axis=1)
    return ratio


def untangle(
    flat: FlatTriangles, faces: IntArray, pinned: BoolArray, on_seam: BoolArray, on_boundary: BoolArray
) -> Untangled:
    """Turn inverted and degenerate triangles over, moving as few vertices as possible.

    A vertex without curvature may move on a flat surface; its triangles' sides change with it and the surface
    stays what it is. So seams keep equal sides even where their vertices move. Each bad triangle is
    tried with small neighbourhoods first; vertices on seams move only if nothing else helps, and vertices on
    the boundary, whose shape changes with them, only after that.

    Args:
        flat: the triangles.
        faces: (m, 3) their vertices, before any cut.
        pinned: (n,) vertices that must stay: all inside that have curvature.
        on_seam: (n,) vertices that should stay.
        on_boundary: (n,) vertices of the boundary.

    Notes:
        V. Garanzha et al., "Foldover-free maps in 50 lines of code", 2021: an energy that grows without
        bound as a triangle loses its area, with a regularisation that makes it finite beyond.
    """
    sides = flat.sides.reshape(-1, 3).copy()
    start = sides.copy()
    stages = (
        (pinned | on_seam | on_boundary, RINGS_BESIDE_SEAMS),
        (pinned | on_boundary, RINGS),
        (pinned, RINGS),
    )
    moves = np.zeros(len(pinned))
    for stay, sizes in stages:
        for rings in sizes:
            bad = np.flatnonzero(~(heights(sides) > DEGENERATE))
            if len(bad) == 0:
                break
            movable = _neighbourhood(faces, bad, rings, len(pinned)) & ~stay
            if movable.any():
                _Patches(flat, faces, sides, movable).solve(sides, moves)
    left = np.flatnonzero(~(heights(sides) > DEGENERATE))
    changed = sides.ravel() if (sides != start).any() else flat.sides
    moved = np.flatnonzero(moves)
    return Untangled(replace(flat, sides=changed), moved, float(moves.max(initial=0.0)), left)


def _neighbourhood(faces: IntArray, seeds: IntArray, rings: int, count: int) -> BoolArray:
    """Return (n,) True for the vertices of the seed triangles and of so many rings less one around them."""
    inside = np.zeros(count, dtype=bool)
    inside[faces[seeds]] = True
    for _ in range(rings - 1):
        inside[faces[inside[faces].any(axis=1)]] = True
    return inside


class _Patches:
    """The triangles around movable vertices, as functions of how far these move.

    The map of a triangle from the shape it should have to the one it has is z -> a z + b conj(z); a and b are
    linear in the shifts of its corners. Its determinant is |a|^2 - |b|^2, its squared norm 2 (|a|^2 + |b|^2).
    Shifts are in units of the mean length of the edges at the vertex.
    """

    def __init__(self, flat: FlatTriangles, faces: IntArray, sides: ComplexArray, movable: BoolArray) -> None:
        self.vertices = np.flatnonzero(movable)
        self.faces = np.flatnonzero(movable[faces].any(axis=1))
        self.sides = sides[self.faces]
        local = np.full(len(movable), -1)
        local[self.vertices] = np.arange(len(self.vertices))
        self.corners = local[faces[self.faces]]
        is_loose = self.corners >= 0
        lengths = np.abs(self.sides)
        around = (lengths.sum(axis=1, keepdims=True) - lengths)[is_loose] / 2
        self.size = np.bincount(self.corners[is_loose], around) / np.bincount(self.corners[is_loose])
        frames = _corner_frames(flat, faces, movable)[self.faces]
        self.shift = np.where(is_loose, frames * self.size[self.corners], 0)
        self.a, self.b, self.a_of, self.b_of = self._maps(_wanted_shapes(self.sides))

    def _maps(self, wanted: ComplexArray) -> tuple[ComplexArray, ComplexArray, csr_matrix, csr_matrix]:
        """Return a and b as they are, and the matrices of their derivatives by the shifts."""
        r0, r1 = wanted[:, 0], wanted[:, 1]
        area = r0 * np.conj(r1) - np.conj(r0) * r1
        maps, matrices = [], []
        rows = np.repeat(np.arange(len(self.faces)), 3)
        is_loose = self.corners.ravel() >= 0
        for c0, c1 in ((np.conj(r1) / area, -np.conj(r0) / area), (-r1 / area, r0 / area)):
            maps.append(c0 * self.sides[:, 0] + c1 * self.sides[:, 1])
            # Side 0 runs from corner 1 to corner 2, side 1 from corner 2 to corner 0.
            entries = np.stack([c1, -c0, c0 - c1], axis=1) * self.shift
            place = rows[is_loose], self.corners.ravel()[is_loose]
            shape = len(self.faces), len(self.vertices)
            matrices.append(csr_matrix((entries.ravel()[is_loose], place), shape=shape))
        return maps[0], maps[1], matrices[0], matrices[1]

    def solve(self, sides: ComplexArray, moves: FloatArray) -> None:
        """Untangle; write the patches on which this succeeds to `sides`, add their shifts to `moves`."""
        ends = self.corners[:, [1, 2, 0]].ravel(), self.corners[:, [2, 0, 1]].ravel()
        joined = (ends[0] >= 0) & (ends[1] >= 0)
        count, patch = label_components(len(self.vertices), ends[0][joined], ends[1][joined])
        face_patch = patch[self.corners.max(axis=1)]
        shifts = self._minimize(count, patch, face_patch)
        moved = np.where(self.corners >= 0, self.shift * shifts[self.corners], 0)
        result = self.sides + moved[:, [2, 0, 1]] - moved[:, [1, 2, 0]]
        failed = np.zeros(count, dtype=bool)
        failed[face_patch[~(heights(result) > DEGENERATE)]] = True
        good = ~failed[face_patch]
        sides[self.faces[good]] = result[good]
        moves[self.vertices] += np.where(failed[patch], 0.0, np.abs(shifts))

    def _minimize(self, count: int, patch: IntArray, face_patch: IntArray) -> ComplexArray:
        """Return shifts (k,) that make the determinants positive, where this succeeds.

        Newton's method with the Hessian made positive triangle by triangle. Every patch has its own
        regularisation and step length, and rests as soon as it is done.
        """
        shifts = np.zeros(len(self.vertices), dtype=np.complex128)
        for _ in range(STEPS):
            worst = self._worst(shifts, count, face_patch)
            active = worst < ENOUGH
            if not active.any():
                break
            a, b = self.a + self.a_of @ shifts, self.b + self.b_of @ shifts
            epsilon = np.hypot(FLOOR, RELATIVE * np.minimum(worst, 0.0))[face_patch]
            energy, gradient, hessian = _energy(a, b, epsilon)
            step, slope = self._newton_step(gradient, hessian)
            step[~active[patch]] = 0.0
            slopes = np.bincount(patch, slope, count)
            before = np.bincount(face_patch, energy, count)
            length = np.ones(count)
            a_step, b_step = self.a_of @ step, self.b_of @ step
            for _ in range(HALVINGS):
                t = length[face_patch]
                trial = _energy(a + t * a_step, b + t * b_step, epsilon)[0]
                gained = np.bincount(face_patch, trial, count) <= before + ARMIJO * length * slopes
                if gained[active].all():
                    break
                length[~gained] /= 2
            length[~gained] = 0.0
            if not (length[active] > 0).any():
                break
            shifts += length[patch] * step
        return self._shorten(shifts, count, patch, face_patch)

    def _shorten(
        self, shifts: ComplexArray, count: int, patch: IntArray, face_patch: IntArray
    ) -> ComplexArray:
        """Return the shifts of each patch, cut down to the least part of them that is as good."""
        part = np.ones(count)
        wanted = np.minimum(self._worst(shifts, count, face_patch), ENOUGH)
        for fraction in PARTS:
            enough = self._worst(fraction * shifts, count, face_patch) >= wanted
            part[enough] = np.minimum(part[enough], fraction)
        shortened: ComplexArray = part[patch] * shifts
        return shortened

    def _worst(self, shifts: ComplexArray, count: int, face_patch: IntArray) -> FloatArray:
        """Return the least determinant of each patch."""
        a, b = self.a + self.a_of @ shifts, self.b + self.b_of @ shifts
        worst = np.full(count, np.inf)
        np.minimum.at(worst, face_patch, np.abs(a) ** 2 - np.abs(b) ** 2)
        return worst

    def _newton_step(self, gradient: FloatArray, hessian: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Return the step of each vertex, and what it adds to the slope of the energy along the step."""
        # The maps by (Re a, Im a, Re b, Im b) of each triangle, the shifts by (Re, Im) of all vertices.
        blocks = [
            hstack(row) for m in (self.a_of, self.b_of) for row in ([m.real, -m.imag], [m.imag, m.real])
        ]
        jacobian = csr_matrix(vstack(blocks))
        f = len(self.faces)
        index = np.arange(f)
        rows = (np.arange(4)[None, :, None] * f + index[:, None, None]) + np.zeros((1, 1, 4), dtype=np.int64)
        columns = np.swapaxes(rows, 1, 2)
        middle = csr_matrix((hessian.ravel(), (rows.ravel(), columns.ravel())), shape=(4 * f, 4 * f))
        force = -(jacobian.T @ gradient.T.ravel())
        matrix = csc_matrix(jacobian.T @ middle @ jacobian)
        ridge = 1e-10 * matrix.diagonal().max(initial=0.0)
        found = splu(matrix + ridge * identity(len(force), format="csc")).solve(force)
        k = len(self.vertices)
        slope: FloatArray = -(found * force)
        return found[:k] + 1j * found[k:], slope[:k] + slope[k:]


def _energy(
    a: ComplexArray, b: ComplexArray, epsilon: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return each triangle's energy, its gradient (f, 4) and a positive Hessian (f, 4, 4) by Re, Im of a, b.

    The energy is (norm^2 / 2 + (1 + det^2) / 2) / p with p = (det + root(epsilon^2 + det^2)) / 2.
    """
    maps = np.stack([a.real, a.imag, b.real, b.imag], axis=1)
    turned = maps * np.array([1.0, 1.0, -1.0, -1.0])
    det = (maps * turned).sum(axis=1)
    root = np.hypot(epsilon, det)
    # p without cancellation where det is negative
    p = np.where(det > 0, (det + root) / 2, epsilon**2 / (2 * (root - np.minimum(det, 0))))
    energy = ((maps**2).sum(axis=1) + (1 + det**2) / 2) / p
    by_norm, by_det = 1 / p, det / p - energy / root
    mixed = -1 / (p * root)
    twice = 1 / p - det / (p * root) - by_det / root + energy * det / root**3
    gradient = 2 * (by_norm[:, None] * maps + by_det[:, None] * turned)
    one, two = maps[:, :, None] * turned[:, None, :], turned[:, :, None] * turned[:, None, :]
    diagonal = 2 * by_norm[:, None] + 2 * by_det[:, None] * np.array([1.0, 1.0, -1.0, -1.0])
    hessian = diagonal[:, :, None] * np.eye(4)
    hessian += 4 * mixed[:, None, None] * (one + np.swapaxes(one, 1, 2)) + 4 * twice[:, None, None] * two
    values, vectors = np.linalg.eigh(hessian)
    positive = (vectors * np.maximum(values, 0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return energy, gradient, positive


def _wanted_shapes(sides: ComplexArray) -> ComplexArray:
    """Return the sides (f, 3) of the same triangles, but upright and not too thin."""
    f = np.arange(len(sides))
    longest = np.abs(sides).argmax(axis=1)
    base = np.abs(sides[f, longest])
    apex = -sides[f, (longest + 2) % 3] / sides[f, longest]
    apex = np.clip(apex.real, 0.0, 1.0) + 1j * np.maximum(apex.imag, WANTED_HEIGHT)
    wanted = np.empty_like(sides)
    wanted[f, longest] = base
    wanted[f, (longest + 1) % 3] = base * (apex - 1)
    wanted[f, (longest + 2) % 3] = -base * apex
    return wanted


def _corner_frames(flat: FlatTriangles, faces: IntArray, movable: BoolArray) -> ComplexArray:
    """Return (m, 3) unit numbers that take a shift of a movable vertex to the frame of the triangle there.

    All corners of a vertex are reached by turning around it from a first one, the same for all.
    """
    tails = faces[:, [1, 2, 0]].ravel()
    frames = np.zeros(faces.shape, dtype=np.complex128)
    leaving = np.flatnonzero(movable[tails])
    # Where the fan of a boundary vertex begins there is a half-edge without twin; it must come last to stay.
    leaving = leaving[np.argsort(flat.twin[leaving] < 0, kind="stable")]
    first = np.full(len(movable), -1)
    first[tails[leaving]] = leaving
    at = first[movable]
    start = at.copy()
    turn = np.ones(len(at), dtype=np.complex128)
    while len(at):
        frames[at // 3, (at % 3 + 1) % 3] = turn
        over = flat.twin[at - at % 3 + (at + 2) % 3]
        on = (over >= 0) & (over != start)
        at, start = over[on], start[on]
        turn = turn[on] * flat.turns[at]
    return frames
