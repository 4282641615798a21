"""Turning the few inverted triangles of a flat metric over, by moving vertices on the flat surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, has_any
from ..base.compiled import compiled
from ..geometry.planar import heights, signed_angles
from ..geometry.straight import FlatTriangles
from .patches import DEGENERATE_HEIGHT, Patches

# Height over longest side that triangles are asked to get at least.
LEAST_HEIGHT = 0.1
# Rings of triangles around the bad ones that are let loose at most: 1, 2, 4, and so on until it works.
MAX_RINGS = 4
# Angles around a vertex that miss theirs do so by whole turns; what rounding makes of them is far less than this.
WINDING_ERROR = 1.0


@dataclass(frozen=True, eq=False)
class Untangled:
    """Flat triangles after untangling.

    Attributes:
        flat: the triangles; their frames and gluing are the ones before.
        moved: (k,) vertices that were moved.
        largest_move: how far a vertex was moved at most, relative to the mean length of the edges at the vertex.
        left: (j,) triangles that are inverted or degenerate still.
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
    rest: ComplexArray,
    max_rings: int = MAX_RINGS,
) -> Untangled:
    """Turn inverted and degenerate triangles over, moving as few vertices as possible.

    A vertex without curvature may move on a flat surface; its triangles' sides change with it and the surface
    stays what it is. So seams keep equal sides even where their vertices move. Each bad triangle is
    tried with small neighbourhoods first; vertices on seams move only if nothing else helps, and vertices on
    the boundary, whose shape changes with them, only after that.

    Triangles that are all positively oriented may still wind around a vertex more than once, if another one, with
    curvature or on the boundary, has that much less around it. They are rejected: their triangles stay inverted.

    The work is bounded by the size of the mesh.

    Args:
        flat: the triangles.
        faces: (m, 3) their vertices, before any cut.
        angles: (n,) the angle around each vertex on the flat surface, radians; NaN where it may be any.
        on_boundary: (n,) vertices of the boundary.
        stays: (n,) vertices that must not move, one mask after another: each is tried where those before left
            triangles inverted.
        rest: (m, 3) sides of the triangles as they should be.
        max_rings: rings of triangles around the inverted ones that are let loose at most.

    Notes:
        V. Garanzha et al., "Foldover-free maps in 50 lines of code", 2021: an energy that grows without
        bound as a triangle loses its area, with a regularisation that makes it finite beyond.
    """
    if not are_low(flat.sides, DEGENERATE_HEIGHT):
        return Untangled(flat, np.empty(0, dtype=np.int64), 0.0, np.empty(0, dtype=np.int64))
    state = _Untangling(flat, faces, angles, on_boundary, _thickened(rest))
    for stay in stays:
        rings = 1
        while rings <= max_rings:
            state.improve(rings, stay)
            rings *= 2
    changed = state.sides.ravel() if state.moves.any() else flat.sides
    return Untangled(
        replace(flat, sides=changed),
        np.flatnonzero(state.moves),
        float(state.moves.max(initial=0.0)),
        np.flatnonzero(state.is_bad),
    )


class _Untangling:
    """How far the triangles of a surface are untangled.

    Attributes:
        sides: (m, 3) sides of the triangles as they are.
        is_bad: (m,) True for those that are inverted or degenerate.
        moves: (n,) how far each vertex was moved, in units of the edges around it.
    """

    def __init__(
        self,
        flat: FlatTriangles,
        faces: IntArray,
        angles: FloatArray,
        on_boundary: BoolArray,
        rest: ComplexArray,
    ) -> None:
        self.rest = rest
        self.flat, self.faces, self.angles, self.on_boundary = flat, faces, angles, on_boundary
        self.sides, self.is_copied = flat.sides.reshape(-1, 3), False
        self.moves = np.zeros(len(angles))
        self.is_bad = np.empty(len(faces), dtype=bool)
        find_low(flat.sides, DEGENERATE_HEIGHT, self.is_bad)

    def improve(self, rings: int, stay: BoolArray) -> None:
        """Untangle what can be with so many rings around bad triangles let loose, but for vertices that stay."""
        movable = _neighbourhood(self.faces, np.flatnonzero(self.is_bad), rings, len(stay)) & ~stay
        if movable.any():
            patches = Patches(self.flat, self.faces, self.sides, movable, self.rest)
            self._accept(patches, patches.solve())

    def _accept(self, patches: Patches, shifts: ComplexArray) -> None:
        """Take over the patches that are positively oriented now and wind around no vertex."""
        result = patches.moved(shifts)
        is_positive = heights(result) > DEGENERATE_HEIGHT
        failed = np.zeros(patches.count, dtype=bool)
        failed[patches.face_patch[~is_positive]] = True
        trial = np.where(failed[patches.face_patch, None], patches.sides, result)
        winding = self._winding(patches, trial)
        winds = np.zeros(len(self.angles), dtype=bool)
        winds[winding] = True
        failed[patches.face_patch[winds[self.faces[patches.faces]].any(axis=1)]] = True
        good = ~failed[patches.face_patch]
        if not self.is_copied:
            self.sides, self.is_copied = self.sides.copy(), True
        self.sides[patches.faces[good]] = result[good]
        self.is_bad[patches.faces[good]] = False
        self.moves[patches.vertices] += np.where(failed[patches.patch], 0.0, np.abs(shifts))

    def _winding(self, patches: Patches, trial: ComplexArray) -> IntArray:
        """Return the vertices around which triangles would wind that do not now, with sides (f, 3) for the patches'."""
        near = np.zeros(len(self.angles), dtype=bool)
        near[self.faces[patches.faces]] = True
        rows = np.flatnonzero(has_any(near, self.faces))
        is_free = np.zeros(len(self.angles), dtype=bool)
        is_free[patches.vertices] = self.on_boundary[patches.vertices]
        before = self.sides[rows]
        after = before.copy()
        after[np.searchsorted(rows, patches.faces)] = trial
        now, then = (
            winding_vertices(sides, self.faces[rows], self.angles, is_free) for sides in (before, after)
        )
        # All that are far from the patches are among both.
        is_new = near
        is_new[now] = False
        return then[is_new[then]]


def winding_vertices(
    sides: ComplexArray, faces: IntArray, angles: FloatArray, is_free: BoolArray
) -> IntArray:
    """Return the vertices around which positively oriented triangles turn by more, or less, than the surface.

    Args:
        sides: (m, 3) of the triangles.
        faces: (m, 3) their vertices.
        angles: (n,) the angle around each vertex.
        is_free: (n,) vertices of the boundary around which there may be any angle of less than a turn.
    """
    is_bad = np.zeros(len(angles), dtype=bool)
    is_bad[faces[~(heights(sides) > DEGENERATE_HEIGHT)]] = True
    sums = np.bincount(faces.ravel(), signed_angles(sides).ravel(), len(angles))
    winds = np.abs(sums - angles) > WINDING_ERROR
    winds[is_free] = sums[is_free] >= np.maximum(2 * np.pi, angles[is_free] + WINDING_ERROR)
    return np.flatnonzero(~is_bad & winds)


def _neighbourhood(faces: IntArray, seeds: IntArray, rings: int, count: int) -> BoolArray:
    """Return (n,) True for the vertices of the seed triangles and of so many rings less one around them."""
    inside = np.zeros(count, dtype=bool)
    inside[faces[seeds]] = True
    for _ in range(rings - 1):
        inside[faces[has_any(inside, faces)]] = True
    return inside


def _thickened(rest: ComplexArray) -> ComplexArray:
    """Return the sides (m, 3) of positively oriented triangles, but not too thin."""
    f = np.arange(len(rest))
    longest = np.abs(rest).argmax(axis=1)
    base = np.abs(rest[f, longest])
    apex = -rest[f, (longest + 2) % 3] / rest[f, longest]
    apex = apex.real + 1j * np.maximum(apex.imag, LEAST_HEIGHT)
    wanted = np.empty_like(rest)
    wanted[f, longest] = base
    wanted[f, (longest + 1) % 3] = base * (apex - 1)
    wanted[f, (longest + 2) % 3] = -base * apex
    return wanted


@compiled
def is_low(sides: ComplexArray, base: int, least: float) -> bool:
    """Return whether a triangle, by its first side, is not higher than a share of its longest side, or is flipped."""
    doubled = sides[base].real * sides[base + 1].imag - sides[base].imag * sides[base + 1].real
    longest = 0.0
    for h in range(base, base + 3):
        longest = max(longest, sides[h].real ** 2 + sides[h].imag ** 2)
    return not doubled > least * longest


@compiled
def are_low(sides: ComplexArray, least: float) -> bool:
    """Return whether any triangle with sides (3m,) is not higher than a share of its longest side, or is flipped."""
    f = 0
    while f < len(sides) // 3 and not is_low(sides, 3 * f, least):
        f += 1
    return f < len(sides) // 3


@compiled
def find_low(sides: ComplexArray, least: float, found: BoolArray) -> None:
    """Fill in (m,) for each triangle what `are_low` returns for all."""
    for f in range(len(found)):
        found[f] = is_low(sides, 3 * f, least)
