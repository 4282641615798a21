"""Patches of a flat surface whose vertices are moved so that their triangles become positively oriented."""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import bsr_matrix

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, has_any
from ..base.jit import compiled
from ..errors import MetricError
from ..geometry.planar import map_factors
from ..geometry.straight import FlatTriangles
from ..linalg import SuperLUFactor
from ..linalg.newton import ARMIJO, HALVINGS
from ..mesh.connectivity import label_components
from .relax.elements import RELATIVE_RIDGE

# Ratio of height to longest side up to which a triangle is degenerate: coordinates in the plane are accurate to
# about 1e-12 of an edge, and a triangle must stay positively oriented when they are rounded.
DEGENERATE_HEIGHT = 1e-8
# A patch is finished when every triangle has this fraction of its target area.
TARGET_AREA_SHARE = 0.1
# Regularisation of the determinant: its floor, and its size relative to the worst determinant of the patch
# (Garanzha et al. 2021, Section 4).
MIN_REGULARISATION, RELATIVE_REGULARISATION = 1e-3, 0.2
# A patch is abandoned, and tried again with more surrounding triangles, after MAX_ROUNDS rounds of STEPS_PER_ROUND
# Newton steps, or if the distance to the goal has not shrunk by this factor in a round. Patches that succeed take 4
# steps at the median.
MAX_ROUNDS, STEPS_PER_ROUND, MIN_SHRINKING = 15, 4, 0.9


class Patches:
    """The triangles around movable vertices, as functions of the shifts of these vertices.

    The map of a triangle from its target shape to its current shape is z -> a z + b conj(z); a and b are linear in the
    shifts of its corners. Its determinant is |a|^2 - |b|^2.
    Shifts are in units of the mean length of the edges at the vertex.

    Attributes:
        vertices: (k,) the movable vertices.
        faces: (f,) triangles with a movable vertex.
        count: the number of patches, which have no movable vertex in common.
        patch, face_patch: (k,), (f,) the patch of each vertex and triangle.
    """

    def __init__(
        self,
        flat: FlatTriangles,
        faces: IntArray,
        sides: ComplexArray,
        movable: BoolArray,
        rest: ComplexArray,
    ) -> None:
        self.vertices = np.flatnonzero(movable)
        self.faces = np.flatnonzero(has_any(movable, faces))
        self.sides = sides[self.faces]
        local = np.full(len(movable), -1)
        local[self.vertices] = np.arange(len(self.vertices))
        self.corners = local[faces[self.faces]]
        is_loose = self.corners >= 0
        lengths = np.abs(self.sides)
        around = (lengths.sum(axis=1, keepdims=True) - lengths)[is_loose] / 2
        size = np.bincount(self.corners[is_loose], around) / np.bincount(self.corners[is_loose])
        frames = _corner_frames(flat, faces[self.faces], self.faces, movable)
        self.shift = np.where(is_loose, frames * size[self.corners], 0)
        rest = rest[self.faces]
        scale = np.sqrt((np.abs(self.sides) ** 2).sum(axis=1) / (np.abs(rest) ** 2).sum(axis=1))
        self._find_maps(rest * np.maximum(scale, scale.mean() * DEGENERATE_HEIGHT)[:, None])
        ends = self.corners[:, [1, 2, 0]].ravel(), self.corners[:, [2, 0, 1]].ravel()
        joined = (ends[0] >= 0) & (ends[1] >= 0)
        self.count, self.patch = label_components(len(self.vertices), ends[0][joined], ends[1][joined])
        self.face_patch = self.patch[self.corners.max(axis=1)]

    def _find_maps(self, wanted: ComplexArray) -> None:
        """Set the current a and b, and their derivatives with respect to the shifts of the corners."""
        found = []
        for factors in map_factors(wanted):
            # With corner 2 at 0, side 0 is minus the position of corner 1, and side 1 is that of corner 0.
            found.append(factors[:, 0] * self.sides[:, 1] - factors[:, 1] * self.sides[:, 0])
            found.append(factors * self.shift)
        self.a, self.a_of, self.b, self.b_of = found

    def solve(self) -> ComplexArray:
        """Return (k,) shifts that make the determinants positive, where this succeeds.

        Newton's method with the Hessian of each triangle projected to a positive semidefinite one. The steps of all
        patches are solved for in one system, but every patch has its own regularisation and step length, and stops as
        soon as it is finished or stuck. `linalg.newton` is not used because it has one of each for the whole system.
        """
        shifts = np.zeros(len(self.vertices), dtype=np.complex128)
        gap = TARGET_AREA_SHARE - self.worst(shifts)
        active = gap > 0
        for _ in range(MAX_ROUNDS):
            if not active.any():
                break
            equations = _Equations(self, active)
            for _ in range(STEPS_PER_ROUND):
                active &= self._step(equations, shifts, active)
            before, gap = gap, TARGET_AREA_SHARE - self.worst(shifts)
            active &= gap <= MIN_SHRINKING * before
        return shifts

    def _step(self, e: _Equations, shifts: ComplexArray, active: BoolArray) -> BoolArray:
        """Add a step to the shifts of active patches (count,); return the patches that improved and may continue."""
        worst = self.worst(shifts)
        a, b = self._maps_at(shifts)
        a, b = a[e.rows], b[e.rows]
        epsilon = np.hypot(MIN_REGULARISATION, RELATIVE_REGULARISATION * np.minimum(worst, 0.0))[e.face_patch]
        step, slope = e.newton_step(a, b, epsilon)
        slopes = np.bincount(self.patch, slope, self.count)
        a_step, b_step = self._changes(step)
        a_step, b_step = a_step[e.rows], b_step[e.rows]
        energy = np.empty(len(a))
        fill_energies(a, b, epsilon, energy)
        before = np.bincount(e.face_patch, energy, self.count)
        length = np.ones(self.count)
        for _ in range(HALVINGS):
            t = length[e.face_patch]
            fill_energies(a + t * a_step, b + t * b_step, epsilon, energy)
            after = np.bincount(e.face_patch, energy, self.count)
            gained = ~active | (after <= before + ARMIJO * length * slopes)
            if gained.all():
                break
            length[~gained] /= 2
        gained &= active & (worst < TARGET_AREA_SHARE)
        shifts += np.where(gained, length, 0.0)[self.patch] * step
        return gained

    def moved(self, shifts: ComplexArray) -> ComplexArray:
        """Return (f, 3) the sides of the triangles after their vertices are shifted."""
        moved = np.where(self.corners >= 0, self.shift * shifts[self.corners], 0)
        return self.sides + moved[:, [2, 0, 1]] - moved[:, [1, 2, 0]]

    def worst(self, shifts: ComplexArray) -> FloatArray:
        """Return (count,) the smallest determinant of each patch."""
        a, b = self._maps_at(shifts)
        worst = np.full(self.count, np.inf)
        np.minimum.at(worst, self.face_patch, np.abs(a) ** 2 - np.abs(b) ** 2)
        return worst

    def _maps_at(self, shifts: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        a, b = self._changes(shifts)
        return self.a + a, self.b + b

    def _changes(self, shifts: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        at = shifts[self.corners]
        return (self.a_of * at).sum(axis=1), (self.b_of * at).sum(axis=1)


class _Equations:
    """Newton's equations of some of the patches.

    Attributes:
        rows: (r,) indices of their triangles among those of all patches.
        face_patch: (r,) the patch of each.
    """

    def __init__(self, patches: Patches, active: BoolArray) -> None:
        self.rows = np.flatnonzero(active[patches.face_patch])
        self.face_patch = patches.face_patch[self.rows]
        self.vertices = np.flatnonzero(active[patches.patch])
        self.all = len(patches.vertices)
        local = np.full(self.all + 1, -1)
        local[self.vertices] = np.arange(len(self.vertices))
        self.corners = local[patches.corners[self.rows]]
        self.a_of, self.b_of = patches.a_of[self.rows], patches.b_of[self.rows]
        k = len(self.vertices)
        keys = self.corners[:, :, None] * k + self.corners[:, None, :]
        is_block = (self.corners[:, :, None] >= 0) & (self.corners[:, None, :] >= 0)
        blocks, slots = np.unique(keys[is_block], return_inverse=True)
        self.slots = np.full(keys.shape, -1)
        self.slots[is_block] = slots.ravel()
        self.columns = blocks % k
        self.starts = np.searchsorted(blocks // k, np.arange(k + 1))

    def newton_step(
        self, a: ComplexArray, b: ComplexArray, epsilon: FloatArray
    ) -> tuple[ComplexArray, FloatArray]:
        """Return the step of each vertex of all patches, and its contribution to the directional derivative."""
        k = len(self.vertices)
        gradient, values = np.zeros(2 * k), np.zeros(4 * len(self.columns))
        add_derivatives(a, b, epsilon, self.a_of, self.b_of, self.corners, self.slots, gradient, values)
        blocks = values.reshape(-1, 2, 2)
        matrix = bsr_matrix((blocks, self.columns, self.starts), shape=(2 * k, 2 * k)).tocsc()
        matrix.setdiag(matrix.diagonal() * (1 + RELATIVE_RIDGE) + RELATIVE_RIDGE * matrix.diagonal().max())
        try:
            found = SuperLUFactor(matrix).solve(-gradient)
        except MetricError:
            found = np.full(2 * k, np.nan)
        if not np.isfinite(found).all():
            found = np.zeros(2 * k)  # no step: all are stuck
        step, slope = np.zeros(self.all, dtype=np.complex128), np.zeros(self.all)
        step[self.vertices] = found[0::2] + 1j * found[1::2]
        slope[self.vertices] = (found * gradient).reshape(-1, 2).sum(axis=1)
        return step, slope


def _corner_frames(flat: FlatTriangles, faces: IntArray, rows: IntArray, movable: BoolArray) -> ComplexArray:
    """Return (f, 3) unit complex numbers that rotate a shift of a movable vertex to the frame of each triangle there.

    The corners of a vertex are visited by walking around it, beginning with the same corner for all triangles.

    faces, rows: (f, 3) the triangles that have a movable vertex, and (f,) their indices in ascending order.
    """
    tails = faces[:, [1, 2, 0]]
    frames = np.zeros(faces.shape, dtype=np.complex128)
    leaves = movable[tails]
    leaving, tails = (3 * rows[:, None] + np.arange(3))[leaves], tails[leaves]
    # The fan of a boundary vertex begins at a half-edge without twin; it is assigned last, to overwrite the others.
    order = np.argsort(flat.twin[leaving] < 0, kind="stable")
    first = np.full(len(movable), -1)
    first[tails[order]] = leaving[order]
    at = first[movable]
    start = at.copy()
    turn = np.ones(len(at), dtype=np.complex128)
    while len(at):
        frames[np.searchsorted(rows, at // 3), (at % 3 + 1) % 3] = turn
        over = flat.twin[at - at % 3 + (at + 2) % 3]
        on = (over >= 0) & (over != start)
        at, start = over[on], start[on]
        turn = turn[on] * flat.turns[at]
    return frames


@compiled
def fill_energies(a: ComplexArray, b: ComplexArray, epsilon: FloatArray, energies: FloatArray) -> None:
    """Fill in the energy of each triangle."""
    for f in range(len(a)):
        norm = a[f].real ** 2 + a[f].imag ** 2
        other = b[f].real ** 2 + b[f].imag ** 2
        det = norm - other
        root = math.hypot(epsilon[f], det)
        # p without cancellation where det is negative
        p = (det + root) / 2 if det > 0 else epsilon[f] ** 2 / (2 * (root - det))
        energies[f] = (norm + other + (1 + det**2) / 2) / p


@compiled
def add_derivatives(
    a: ComplexArray,
    b: ComplexArray,
    epsilon: FloatArray,
    a_of: ComplexArray,
    b_of: ComplexArray,
    corners: IntArray,
    slots: IntArray,
    gradient: FloatArray,
    values: FloatArray,
) -> None:
    """Add up the gradient with respect to the shifts of vertices, and the positive part of each triangle's Hessian.

    Args:
        a, b: (f,) the maps.
        epsilon: (f,) regularisation of the determinants, see `fill_energies`.
        a_of, b_of: (f, 3) their derivatives with respect to the shift of each corner, as complex factors.
        corners: (f, 3) the vertex that is shifted with a corner, -1 for none.
        slots: (f, 3, 3) the block of the matrix for each pair of corners.
        gradient: (2k,) derivatives by the real and the imaginary part of the shift of each vertex; added to.
        values: (4 blocks,) the entries of the two by two blocks, row by row; added to.
    """
    for f in range(len(a)):
        one, two = abs(a[f]), abs(b[f])
        det = one**2 - two**2
        root = math.hypot(epsilon[f], det)
        p = (det + root) / 2 if det > 0 else epsilon[f] ** 2 / (2 * (root - det))
        energy = (one**2 + two**2 + (1 + det**2) / 2) / p
        by_norm, by_det = 1 / p, det / p - energy / root
        mixed = -1 / (p * root)
        twice = 1 / p - det / (p * root) - by_det / root + energy * det / root**3
        along_a = a[f] / one if one > 0 else 1.0 + 0.0j
        along_b = b[f] / two if two > 0 else 1.0 + 0.0j
        slope_a, slope_b = 2 * (by_norm + by_det), 2 * (by_norm - by_det)
        # The Hessian block of the absolute values of a and b, and its positive part.
        first = slope_a + 8 * mixed * one**2 + 4 * twice * one**2
        last = slope_b - 8 * mixed * two**2 + 4 * twice * two**2
        cross = -4 * twice * one * two
        middle, half = (first + last) / 2, (first - last) / 2
        radius = math.hypot(half, cross)
        high, low = max(middle + radius, 0.0), max(middle - radius, 0.0)
        if radius > 0:
            first = (high + low) / 2 + (high - low) / 2 * half / radius
            last = (high + low) / 2 - (high - low) / 2 * half / radius
            cross = (high - low) / 2 * cross / radius
        else:
            first = last = high
            cross = 0.0
        turn_a, turn_b = max(slope_a, 0.0), max(slope_b, 0.0)
        for i in range(3):
            v = corners[f, i]
            if v < 0:
                continue
            # Components of the changes of a and b, parallel and perpendicular to them, for shifts by 1 and by 1j.
            p_i, q_i = a_of[f, i] * along_a.conjugate(), b_of[f, i] * along_b.conjugate()
            gradient[2 * v] += slope_a * one * p_i.real + slope_b * two * q_i.real
            gradient[2 * v + 1] -= slope_a * one * p_i.imag + slope_b * two * q_i.imag
            for j in range(3):
                if corners[f, j] < 0:
                    continue
                p_j, q_j = a_of[f, j] * along_a.conjugate(), b_of[f, j] * along_b.conjugate()
                place = 4 * slots[f, i, j]
                for s in range(2):
                    x, y = (p_i.real, p_i.imag) if s == 0 else (-p_i.imag, p_i.real)
                    z, w = (q_i.real, q_i.imag) if s == 0 else (-q_i.imag, q_i.real)
                    for t in range(2):
                        x2, y2 = (p_j.real, p_j.imag) if t == 0 else (-p_j.imag, p_j.real)
                        z2, w2 = (q_j.real, q_j.imag) if t == 0 else (-q_j.imag, q_j.real)
                        values[place + 2 * s + t] += (
                            first * x * x2
                            + last * z * z2
                            + cross * (x * z2 + z * x2)
                            + turn_a * y * y2
                            + turn_b * w * w2
                        )
