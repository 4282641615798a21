"""Untangling: the few inverted triangles of a flat metric are turned back by moving vertices on the flat surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, has_any, mask_of
from ..geometry.planar import heights, signed_angles
from ..geometry.straight import FlatTriangles
from ..mesh.connectivity import nearby
from .patches import DEGENERATE_HEIGHT, Patches

# Minimum ratio of height to longest side of the target shapes.
MIN_HEIGHT = 0.1
# Maximum number of rings of triangles around the bad ones whose vertices may move; 1, 2, 4, and so on are tried.
MAX_RINGS = 4
# Wrong angle sums around a vertex differ by full turns; rounding errors of the sums are far below this value.
WINDING_ERROR = 1.0


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
