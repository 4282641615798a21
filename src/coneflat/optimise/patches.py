"""Patches of a flat surface whose vertices are moved so that their triangles become positively oriented."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, has_any
from ..errors import MetricError
from ..geometry.straight import FlatTriangles
from .elements import Elements
from .energies import UntanglingEnergy
from .motions import Motions
from .newton import Problem, descend

# Ratio of height to longest side up to which a triangle is degenerate: coordinates in the plane are accurate to
# about 1e-12 of an edge, and a triangle must stay positively oriented when they are rounded.
DEGENERATE_HEIGHT = 1e-8
# A patch is finished when every triangle has this fraction of its target area.
TARGET_AREA_SHARE = 0.1
# Regularisation of the determinant: its floor, and its size relative to the worst determinant of the patch
# (Garanzha et al. 2021, Section 4).
MIN_REGULARISATION, RELATIVE_REGULARISATION = 1e-3, 0.2
# Added to the diagonal of the Hessian, relative to its largest entry.
DAMPING = 1e-10
# A patch is abandoned, and tried again with more surrounding triangles, after MAX_STEPS steps of Newton's method, or if
# the distance to the goal has not shrunk by this factor in TRIAL_STEPS steps. Patches that succeed take 4 steps at the
# median.
MAX_STEPS, TRIAL_STEPS, MIN_SHRINKING = 60, 4, 0.9


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
        self._motions = Motions(csr_matrix((coefficient, unknown, start), shape=shape))
        corners = np.arange(self.corners.size).reshape(-1, 3)
        self.elements = Elements(self._motions, corners, target_shapes, 1.0, np.ones(len(target_shapes)))
        self.count, self.patch = self.elements.parts, self.elements.unknown_part[::2]
        self.face_patch = self.elements.part

    def solve(self) -> ComplexArray:
        """Return (k,) shifts that make the determinants positive, where this succeeds.

        Every patch ends as soon as it is finished or stuck.

        Notes:
            V. Garanzha et al., "Foldover-free maps in 50 lines of code", 2021, Section 4: one step of Newton's method
            for each regularisation, which decreases with the worst determinant of the patch.
        """
        elements, points, shifts = self.elements, self._points, np.zeros(self.elements.count + 1)
        missing, missing_before = self._missing(elements, points), np.full(elements.parts, np.inf)
        for step in range(MAX_STEPS):
            goes_on = missing > 0
            if step % TRIAL_STEPS == 0:
                goes_on &= missing <= MIN_SHRINKING * missing_before
                missing_before = missing
            if not goes_on.any():
                break
            if not goes_on.all():
                elements = elements.of_parts(goes_on)
                missing, missing_before = missing[goes_on], missing_before[goes_on]
            negative = np.minimum(TARGET_AREA_SHARE - missing, 0.0)
            epsilon = np.hypot(MIN_REGULARISATION, RELATIVE_REGULARISATION * negative)
            energy = UntanglingEnergy(epsilon[elements.part])
            try:
                descent = descend(
                    points, Problem(self._motions, elements, energy, DAMPING), tolerance=0.0, steps=1
                )
            except MetricError:  # a singular Hessian
                break
            points, shifts = descent.points, shifts + descent.step
            missing = self._missing(elements, points)
        return shifts[0:-1:2] + 1j * shifts[1:-1:2]

    def _missing(self, elements: Elements, points: ComplexArray) -> FloatArray:
        """Return (parts,) how much the smallest determinant of each part is below its goal."""
        maps, worst = elements.maps(points), np.full(elements.parts, np.inf)
        np.minimum.at(worst, elements.part, np.abs(maps.a) ** 2 - np.abs(maps.b) ** 2)
        return TARGET_AREA_SHARE - worst

    def moved(self, shifts: ComplexArray) -> ComplexArray:
        """Return (f, 3) the sides of the triangles after their vertices are shifted."""
        moved = np.where(self.corners >= 0, self.shift * shifts[self.corners], 0)
        return self.sides + moved[:, [2, 0, 1]] - moved[:, [1, 2, 0]]


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
