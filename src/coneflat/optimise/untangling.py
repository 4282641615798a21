"""Untangling: the few inverted triangles of a flat metric are turned back by moving vertices on the flat surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, has_any, mask_of
from ..errors import MetricError
from ..geometry.planar import heights, signed_angles
from ..geometry.straight import FlatTriangles
from ..mesh.connectivity import nearby
from .elements import Elements
from .energies import UntanglingEnergy
from .motions import Motions
from .newton import Problem, descend

# Minimum ratio of height to longest side of the target shapes.
MIN_HEIGHT = 0.1
# Maximum number of rings of triangles around the bad ones whose vertices may move; 1, 2, 4, and so on are tried.
MAX_RINGS = 4
# Wrong angle sums around a vertex differ by full turns; rounding errors of the sums are far below this value.
WINDING_ERROR = 1.0
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


@dataclass(frozen=True, eq=False)
class Untangled:
    """Flat triangles after untangling.

    Attributes:
        flat: the triangles; their frames and adjacency are unchanged.
        moved: (k,) vertices that were moved.
        largest_move: largest shift of a vertex, relative to the mean length of the edges at the vertex.
        left: (j,) triangles that are still inverted or degenerate.
    """

    flat: FlatTriangles
    moved: IntArray
    largest_move: float
    left: IntArray


def untangle(
    flat: FlatTriangles,
    faces: IntArray,
    angles: FloatArray,
    on_boundary: BoolArray,
    stays: Sequence[BoolArray],
    target_shapes: ComplexArray,
    max_rings: int = MAX_RINGS,
) -> Untangled:
    """Return flat triangles whose inverted and degenerate triangles are flipped by moving as few vertices as possible.

    A vertex without curvature may move on a flat surface: the sides of its triangles change, but the surface does not.
    Seams therefore keep equal sides even where their vertices move. For each bad triangle small neighbourhoods are
    tried first. Vertices on seams move only if this fails, and vertices on the boundary, whose shape they change, only
    after that.

    Triangles that are all positively oriented may still wind around a vertex more than once, if the angle sum around
    another vertex, with curvature or on the boundary, is smaller by the same amount. Such results are rejected, and
    their triangles stay inverted.

    The work is bounded by the size of the mesh.

    Args:
        flat: the triangles.
        faces: (m, 3) their vertices, before any cut.
        angles: (n,) the angle around each vertex on the flat surface, radians; NaN where any angle is allowed.
        on_boundary: (n,) True for vertices of the boundary.
        stays: masks (n,) of vertices that must not move; each is used where the ones before left inverted triangles.
        target_shapes: (m, 3) sides of the triangles in their target shapes.
        max_rings: maximum number of rings of triangles around the inverted ones whose vertices may move.

    Notes:
        V. Garanzha et al., "Foldover-free maps in 50 lines of code", 2021: an energy that grows without
        bound as the area of a triangle goes to zero, with a regularisation that makes it finite for inverted ones.
    """
    if not find_degenerate(flat.sides.reshape(-1, 3)).any():
        return Untangled(flat, np.empty(0, dtype=np.int64), 0.0, np.empty(0, dtype=np.int64))
    state = _Untangling(flat, faces, angles, on_boundary, _thickened(target_shapes))
    for stay in stays:
        rings = 1
        while rings <= max_rings:
            state.improve(rings, stay)
            rings *= 2
    return Untangled(
        replace(flat, sides=state.sides.ravel()),
        np.flatnonzero(state.moves),
        float(state.moves.max(initial=0.0)),
        np.flatnonzero(state.is_bad),
    )


@dataclass(eq=False)
class _Untangling:
    """The state of untangling the triangles of a surface.

    Attributes:
        flat, faces, angles, on_boundary, target_shapes: see `untangle`; the target shapes are not thin.
        sides: (m, 3) current sides of the triangles.
        is_bad: (m,) True for triangles that are inverted or degenerate.
        moves: (n,) distance by which each vertex was moved, relative to the mean length of the edges around it.
    """

    flat: FlatTriangles
    faces: IntArray
    angles: FloatArray
    on_boundary: BoolArray
    target_shapes: ComplexArray

    def __post_init__(self) -> None:
        self.sides = self.flat.sides.reshape(-1, 3).copy()
        self.moves = np.zeros(len(self.angles))
        self.is_bad = find_degenerate(self.sides)

    def improve(self, rings: int, stay: BoolArray) -> None:
        """Untangle bad triangles by moving the vertices in a number of rings around them, except those in `stay`."""
        movable = nearby(self.faces, self.is_bad, rings - 1) & ~stay
        if movable.any():
            patches = Patches(self.flat, self.faces, self.sides, movable, self.target_shapes)
            self._accept(patches, patches.solve())

    def _accept(self, patches: Patches, shifts: ComplexArray) -> None:
        """Accept the patches whose triangles are now positively oriented and wind around every vertex once."""
        result = patches.moved(shifts)
        failed = mask_of(patches.count, patches.face_patch[find_degenerate(result)])
        trial = np.where(failed[patches.face_patch, None], patches.sides, result)
        winds = mask_of(len(self.angles), self._winding(patches, trial))
        failed[patches.face_patch[winds[self.faces[patches.faces]].any(axis=1)]] = True
        good = ~failed[patches.face_patch]
        self.sides[patches.faces[good]] = result[good]
        self.is_bad[patches.faces[good]] = False
        self.moves[patches.vertices] += np.where(failed[patches.patch], 0.0, np.abs(shifts))

    def _winding(self, patches: Patches, trial: ComplexArray) -> IntArray:
        """Return the vertices with a wrong angle sum only after the patches' triangles get the trial sides (f, 3)."""
        is_adjacent = mask_of(len(self.angles), self.faces[patches.faces])
        rows = np.flatnonzero(has_any(is_adjacent, self.faces))
        is_free = np.zeros(len(self.angles), dtype=bool)
        is_free[patches.vertices] = self.on_boundary[patches.vertices]
        before = self.sides[rows]
        after = before.copy()
        after[np.searchsorted(rows, patches.faces)] = trial
        wrong_before, wrong_after = (
            winding_vertices(sides, self.faces[rows], self.angles, is_free) for sides in (before, after)
        )
        # Vertices far from the patches are in both sets.
        was_right = is_adjacent.copy()
        was_right[wrong_before] = False
        return wrong_after[was_right[wrong_after]]


def winding_vertices(
    sides: ComplexArray, faces: IntArray, angles: FloatArray, is_free: BoolArray
) -> IntArray:
    """Return the vertices whose angle sum over positively oriented triangles differs from that of the surface.

    Args:
        sides: (m, 3) sides of the triangles.
        faces: (m, 3) their vertices.
        angles: (n,) the angle around each vertex, radians.
        is_free: (n,) True for boundary vertices at which any angle of less than a full turn is allowed.
    """
    is_bad = mask_of(len(angles), faces[find_degenerate(sides)])
    sums = np.bincount(faces.ravel(), signed_angles(sides).ravel(), len(angles))
    winds = np.abs(sums - angles) > WINDING_ERROR
    winds[is_free] = sums[is_free] >= np.maximum(2 * np.pi, angles[is_free] + WINDING_ERROR)
    return np.flatnonzero(~is_bad & winds)


def _thickened(target_shapes: ComplexArray) -> ComplexArray:
    """Return (m, 3) the sides of triangles with their heights raised to `MIN_HEIGHT` times the longest side."""
    f = np.arange(len(target_shapes))
    longest = np.abs(target_shapes).argmax(axis=1)
    base = np.abs(target_shapes[f, longest])
    apex = -target_shapes[f, (longest + 2) % 3] / target_shapes[f, longest]
    apex = apex.real + 1j * np.maximum(apex.imag, MIN_HEIGHT)
    thickened = np.empty_like(target_shapes)
    thickened[f, longest] = base
    thickened[f, (longest + 1) % 3] = base * (apex - 1)
    thickened[f, (longest + 2) % 3] = -base * apex
    return thickened


def find_degenerate(sides: ComplexArray) -> BoolArray:
    """Return (m,) True for triangles with sides (m, 3) that are flipped or have almost no height over a side."""
    return ~(heights(sides) > DEGENERATE_HEIGHT)


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
        self.elements = Elements.of(self._motions, corners, target_shapes, 1.0, np.ones(len(target_shapes)))
        self.count, self.patch = self.elements.parts, self.elements.unknown_part[::2]
        self.face_patch = self.elements.part

    def solve(self) -> ComplexArray:
        """Return (k,) shifts that make the determinants positive, where this succeeds.

        Every patch ends as soon as it is finished or stuck.
        """
        shifts = self._descended(self.elements, self._points)
        return shifts[0:-1:2] + 1j * shifts[1:-1:2]

    def _descended(self, elements: Elements, points: ComplexArray) -> FloatArray:
        """Return (2k + 1,) the change of all unknowns and the offset that untangles the patches of elements.

        A patch with a singular Hessian ends alone: the elements are halved until it is found.

        Notes:
            V. Garanzha et al., "Foldover-free maps in 50 lines of code", 2021, Section 4: one step of Newton's method
            for each regularisation, which decreases with the worst determinant of the patch.
        """
        shifts = np.zeros(self.elements.count + 1)
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
            problem = Problem(self._motions, elements, energy, DAMPING)
            try:
                descent = descend(points, problem, tolerance=0.0, steps=1)
            except MetricError:  # the Hessian of a patch is singular
                if elements.parts == 1:
                    break
                is_first = np.arange(elements.parts) < elements.parts // 2
                halves = elements.of_parts(is_first), elements.of_parts(~is_first)
                return shifts + sum(self._descended(half, points) for half in halves)
            points, shifts = descent.points, shifts + descent.step
            missing = self._missing(elements, points)
        return shifts

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
