"""Patches of a flat surface whose vertices are moved so that their triangles become positively oriented."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, has_any
from ..errors import MetricError
from ..geometry.straight import FlatTriangles
from ..linalg import SuperLUFactor
from ..linalg.newton import ARMIJO, HALVINGS
from .elements import RELATIVE_RIDGE, Elements, Maps
from .energies import UntanglingEnergy
from .motions import Motions

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
        elements: these triangles; the unknowns are the real and the imaginary part of the shift of each vertex.
        count: the number of patches, which have no movable vertex in common.
        patch, face_patch: (k,), (f,) the patch of each vertex and triangle.
    """

    def __init__(
        self,
        flat: FlatTriangles,
        faces: IntArray,
        sides: ComplexArray,
        movable: BoolArray,
        target_shapes: ComplexArray,
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
        target_shapes = target_shapes[self.faces]
        scale = np.sqrt((np.abs(self.sides) ** 2).sum(axis=1) / (np.abs(target_shapes) ** 2).sum(axis=1))
        target_shapes = target_shapes * np.maximum(scale, scale.mean() * DEGENERATE_HEIGHT)[:, None]
        # Every corner is a point, as each triangle has its own frame: corner 2 is at 0.
        places = np.stack([self.sides[:, 1], -self.sides[:, 0], np.zeros(len(target_shapes))], axis=1)
        self._points = places.ravel()
        start = np.concatenate([[0], np.cumsum(2 * is_loose.ravel())])
        unknown = 2 * self.corners[is_loose].repeat(2) + np.tile([0, 1], int(is_loose.sum()))
        coefficient = np.stack([self.shift[is_loose], 1j * self.shift[is_loose]], axis=1).ravel()
        shape = self.corners.size, 2 * len(self.vertices) + 1
        motions = Motions(csr_matrix((coefficient, unknown, start), shape=shape))
        corners = np.arange(self.corners.size).reshape(-1, 3)
        self.elements = Elements(motions, corners, target_shapes, 1.0, np.ones(len(target_shapes)))
        self.count, self.patch = self.elements.parts, self.elements.unknown_part[::2]
        self.face_patch = self.elements.part

    def solve(self) -> ComplexArray:
        """Return (k,) shifts that make the determinants positive, where this succeeds.

        Newton's method with the Hessian of each triangle projected to a positive semidefinite one. The steps of all
        patches are solved for in one system, but every patch has its own regularisation and step length, and stops as
        soon as it is finished or stuck. `linalg.newton` is not used because it has one of each for the whole system.
        """
        shifts = np.zeros(self.elements.count)
        gap = TARGET_AREA_SHARE - _worst(self.elements, self._maps_at(self.elements, shifts))
        active = gap > 0
        for _ in range(MAX_ROUNDS):
            if not active.any():
                break
            active_elements, unknowns = self.elements.of_parts(active)
            chosen, active_shifts, goes_on = (
                np.flatnonzero(active),
                shifts[unknowns],
                np.ones(active_elements.parts, dtype=bool),
            )
            for _ in range(STEPS_PER_ROUND):
                goes_on &= self._step(active_elements, active_shifts, goes_on)
            shifts[unknowns], before = active_shifts, gap[chosen]
            gap[chosen] = TARGET_AREA_SHARE - _worst(
                active_elements, self._maps_at(active_elements, active_shifts)
            )
            active[chosen] = goes_on & (gap[chosen] <= MIN_SHRINKING * before)
        return shifts[0::2] + 1j * shifts[1::2]

    def _step(self, elements: Elements, shifts: FloatArray, active: BoolArray) -> BoolArray:
        """Add a step to the unknowns of active parts, in place; return the parts that improved and may continue."""
        maps = self._maps_at(elements, shifts)
        worst = _worst(elements, maps)
        epsilon = np.hypot(MIN_REGULARISATION, RELATIVE_REGULARISATION * np.minimum(worst, 0.0))
        energy = UntanglingEnergy(epsilon[elements.part])
        gradient, _, matrix = elements.newton_system(energy, maps, 0.0)
        matrix.setdiag(matrix.diagonal() + RELATIVE_RIDGE * matrix.diagonal().max())
        try:
            step = SuperLUFactor(matrix).solve(-gradient)
        except MetricError:
            step = np.full(len(gradient), np.nan)
        if not np.isfinite(step).all():
            return np.zeros(elements.parts, dtype=bool)  # all are stuck
        slopes = np.bincount(elements.unknown_part, gradient * step, elements.parts)
        change = elements.change(np.append(step, 0.0))
        before = np.bincount(elements.part, elements.energies(energy, maps), elements.parts)
        length = np.ones(elements.parts)
        for _ in range(HALVINGS):
            trial = maps.plus(length[elements.part], change)
            after = np.bincount(elements.part, elements.energies(energy, trial), elements.parts)
            gained = ~active | (after <= before + ARMIJO * length * slopes)
            if gained.all():
                break
            length[~gained] /= 2
        gained &= active & (worst < TARGET_AREA_SHARE)
        shifts += np.where(gained, length, 0.0)[elements.unknown_part] * step
        return gained

    def _maps_at(self, elements: Elements, shifts: FloatArray) -> Maps:
        """Return the maps of some of the triangles for given shifts of their vertices, as real unknowns."""
        change = elements.change(np.append(shifts, 0.0))
        return elements.maps(self._points).plus(np.ones(len(elements.faces)), change)

    def moved(self, shifts: ComplexArray) -> ComplexArray:
        """Return (f, 3) the sides of the triangles after their vertices are shifted."""
        moved = np.where(self.corners >= 0, self.shift * shifts[self.corners], 0)
        return self.sides + moved[:, [2, 0, 1]] - moved[:, [1, 2, 0]]


def _worst(elements: Elements, maps: Maps) -> FloatArray:
    """Return (parts,) the smallest determinant of each part."""
    worst = np.full(elements.parts, np.inf)
    np.minimum.at(worst, elements.part, np.abs(maps.a) ** 2 - np.abs(maps.b) ** 2)
    return worst


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
