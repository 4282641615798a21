"""Turning the few inverted triangles of a flat metric over, by moving vertices on the flat surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .._arrays import BoolArray, ComplexArray, FloatArray, IntArray, has_any
from ..compiled import compiled
from ..geometry.planar import heights, signed_angles
from ..geometry.straight import FlatTriangles
from .patches import DEGENERATE, Patches

# Height over longest side that a bad triangle is asked to get at least, and those that others are, one after another:
# where all are thin, as on a stretched surface, they cannot be helped much.
WANTED_HEIGHT, LEAST_HEIGHTS = 0.15, (0.05, 0.15)
# Rings of triangles around the bad ones that are let loose, one after another until it works: with seams held
# at first, then with their vertices loose, then with those of the boundary, too.
RINGS_BESIDE_SEAMS = (1, 2, 4)
RINGS = (1, 2, 4, 8)
# How often the same is tried again without the triangles around vertices where it wound.
RETRIES = 4
# How many times the derivatives of as many triangles as the mesh has, or as this, may be computed in all.
WORK, LEAST_WORK = 20, 5000
# Angles around a vertex that miss theirs do so by whole turns; what rounding makes of them is far less than this.
WINDS = 1.0


@dataclass(frozen=True, eq=False)
class Untangled:
    """Flat triangles after untangling.

    Attributes:
        flat: the triangles; their frames and gluing are the ones before.
        moved: (k,) vertices that were moved.
        largest_move: how far a vertex was moved at most, relative to the mean length of the edges at the vertex.
        left: (j,) triangles that are inverted or degenerate still.
        work: the number of times that a triangle's derivatives were computed.
    """

    flat: FlatTriangles
    moved: IntArray
    largest_move: float
    left: IntArray
    work: int


def untangle(
    flat: FlatTriangles,
    faces: IntArray,
    angles: FloatArray,
    pinned: BoolArray,
    on_seam: BoolArray,
    on_boundary: BoolArray,
    whole: BoolArray | None = None,
) -> Untangled:
    """Turn inverted and degenerate triangles over, moving as few vertices as possible.

    A vertex without curvature may move on a flat surface; its triangles' sides change with it and the surface
    stays what it is. So seams keep equal sides even where their vertices move. Each bad triangle is
    tried with small neighbourhoods first; vertices on seams move only if nothing else helps, and vertices on
    the boundary, whose shape changes with them, only after that.

    Triangles that are all upright may still wind around a vertex more than once, if another one, with curvature or on
    the boundary, has that much less around it. Such patches are not accepted: rather, triangles stay inverted.

    The work is bounded by the size of the mesh.

    Args:
        flat: the triangles.
        faces: (m, 3) their vertices, before any cut.
        angles: (n,) the angle around each vertex on the flat surface, radians.
        pinned: (n,) vertices that must stay: all that have curvature inside, and those of the boundary that
            must keep their curvature or the lengths between them.
        on_seam: (n,) vertices that should stay.
        on_boundary: (n,) vertices of the boundary.
        whole: (3m,) half-edges that need no cut. Triangles beside others count as bad, and are left as they were
            unless all that are in their patch can be made upright and those around are whole. None for all.

    Notes:
        V. Garanzha et al., "Foldover-free maps in 50 lines of code", 2021: an energy that grows without
        bound as a triangle loses its area, with a regularisation that makes it finite beyond.
    """
    if whole is None and not are_low(flat.sides, DEGENERATE):
        return Untangled(flat, np.empty(0, dtype=np.int64), 0.0, np.empty(0, dtype=np.int64), 0)
    state = _Untangling(flat, faces, angles, on_boundary, whole)
    for stay, sizes in (
        (pinned | on_seam | on_boundary, RINGS_BESIDE_SEAMS),
        (pinned | on_boundary, RINGS),
        (pinned, RINGS),
    ):
        for rings in sizes:
            for least in LEAST_HEIGHTS:
                state.improve(rings, least, stay)
    changed = state.sides.ravel() if state.moves.any() else flat.sides
    return Untangled(
        replace(flat, sides=changed),
        np.flatnonzero(state.moves),
        float(state.moves.max(initial=0.0)),
        np.flatnonzero(state.is_bad),
        state.work,
    )


class _Untangling:
    """How far the triangles of a surface are untangled.

    Attributes:
        sides: (m, 3) sides of the triangles as they are.
        is_bad: (m,) True for those that are inverted or degenerate.
        moves: (n,) how far each vertex was moved, in units of the edges around it.
        work: the number of times that a triangle's derivatives were computed.
    """

    def __init__(
        self,
        flat: FlatTriangles,
        faces: IntArray,
        angles: FloatArray,
        on_boundary: BoolArray,
        whole: BoolArray | None,
    ) -> None:
        self.flat, self.faces, self.angles, self.on_boundary = flat, faces, angles, on_boundary
        self.sides, self.is_own = flat.sides.reshape(-1, 3), False
        self.moves = np.zeros(len(angles))
        self.work, self.most_work = 0, WORK * max(len(faces), LEAST_WORK)
        self.is_bad = np.empty(len(faces), dtype=bool)
        find_low(flat.sides, DEGENERATE, self.is_bad)
        self.cut = None if whole is None else ~whole.reshape(-1, 3)
        if self.cut is not None:
            self.is_bad |= self.cut.any(axis=1)
        self._failed: set[bytes] = set()

    def improve(self, rings: int, least: float, stay: BoolArray) -> None:
        """Untangle what can be with so many rings around bad triangles let loose, but for vertices that stay.

        least: height over longest side that upright triangles are asked to get at least.
        """
        if not self.is_bad.any():
            return
        faces = self.faces
        spared = np.zeros(len(stay), dtype=bool)
        for _ in range(1 + RETRIES):
            seeds = np.flatnonzero(self.is_bad & ~spared[faces].all(axis=1))
            movable = _neighbourhood(faces, seeds, rings, len(stay)) & ~stay & ~spared
            patches = self._patches(movable, least)
            if patches is None:
                return
            winding = self._accept(patches, patches.solve(self.most_work - self.work))
            self.work += patches.work
            if len(winding) == 0:
                return
            around = np.zeros(len(stay), dtype=bool)
            around[winding] = True
            spared[faces[has_any(around, faces)]] = True

    def _patches(self, movable: BoolArray, least: float) -> Patches | None:
        """Return the patches of movable vertices, without those that have failed as they are; None if none are left."""
        wanted = partial(_wanted_shapes, least=least)
        while movable.any() and self.work < self.most_work:
            patches = Patches(self.flat, self.faces, self.sides, movable, wanted)
            again = np.array([key in self._failed for key in patches.fingerprints()])
            if not again.any():
                return patches
            movable = movable.copy()
            movable[patches.vertices[again[patches.patch]]] = False
        return None

    def _accept(self, patches: Patches, shifts: ComplexArray) -> IntArray:
        """Take over the patches that are upright now and wind around no vertex; return the vertices where they do."""
        result = patches.moved(shifts)
        is_upright = heights(result) > DEGENERATE
        failed = np.zeros(patches.count, dtype=bool)
        failed[patches.face_patch[~is_upright]] = True
        if self.cut is not None:
            failed[patches.face_patch[self._is_open(patches)]] = True
        trial = np.where(failed[patches.face_patch, None], patches.sides, result)
        winding = self._winding(patches, trial)
        winds = np.zeros(len(self.angles), dtype=bool)
        winds[winding] = True
        failed[patches.face_patch[winds[self.faces[patches.faces]].any(axis=1)]] = True
        self._failed.update(key for key, one in zip(patches.fingerprints(), failed, strict=True) if one)
        good = ~failed[patches.face_patch]
        if not self.is_own:
            self.sides, self.is_own = self.sides.copy(), True
        self.sides[patches.faces[good]] = result[good]
        self.is_bad[patches.faces[good]] = False
        self.moves[patches.vertices] += np.where(failed[patches.patch], 0.0, np.abs(shifts))
        return winding

    def _is_open(self, patches: Patches) -> BoolArray:
        """Return (f,) the triangles of patches beside which one outside is bad, across an edge that needs a cut."""
        assert self.cut is not None
        label = np.full(len(self.faces), -1)
        label[patches.faces] = patches.face_patch
        across = self.flat.twin.reshape(-1, 3)[patches.faces]
        beyond = across // 3
        outside = (across >= 0) & (label[beyond] != patches.face_patch[:, None]) & self.is_bad[beyond]
        is_open: BoolArray = (outside & self.cut[patches.faces]).any(axis=1)
        return is_open

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
    """Return the vertices among upright triangles around which these turn by more, or less, than the surface does.

    Args:
        sides: (m, 3) of the triangles.
        faces: (m, 3) their vertices.
        angles: (n,) the angle around each vertex.
        is_free: (n,) vertices of the boundary around which there may be any angle of less than a turn.
    """
    is_bad = np.zeros(len(angles), dtype=bool)
    is_bad[faces[~(heights(sides) > DEGENERATE)]] = True
    sums = np.bincount(faces.ravel(), signed_angles(sides).ravel(), len(angles))
    winds = np.abs(sums - angles) > WINDS
    winds[is_free] = sums[is_free] >= np.maximum(2 * np.pi, angles[is_free] + WINDS)
    return np.flatnonzero(~is_bad & winds)


def _neighbourhood(faces: IntArray, seeds: IntArray, rings: int, count: int) -> BoolArray:
    """Return (n,) True for the vertices of the seed triangles and of so many rings less one around them."""
    inside = np.zeros(count, dtype=bool)
    inside[faces[seeds]] = True
    for _ in range(rings - 1):
        inside[faces[has_any(inside, faces)]] = True
    return inside


def _wanted_shapes(sides: ComplexArray, least: float) -> ComplexArray:
    """Return the sides (f, 3) of the same triangles, but upright, by reflection, and not too thin."""
    f = np.arange(len(sides))
    longest = np.abs(sides).argmax(axis=1)
    base = np.abs(sides[f, longest])
    base[base == 0] = base.mean()
    apex = -sides[f, (longest + 2) % 3] / np.where(sides[f, longest] == 0, 1.0, sides[f, longest])
    height = np.maximum(np.abs(apex.imag), np.where(apex.imag > DEGENERATE, least, WANTED_HEIGHT))
    apex = np.clip(apex.real, 0.0, 1.0) + 1j * height
    wanted = np.empty_like(sides)
    wanted[f, longest] = base
    wanted[f, (longest + 1) % 3] = base * (apex - 1)
    wanted[f, (longest + 2) % 3] = -base * apex
    return wanted


@compiled
def is_low(sides: ComplexArray, base: int, least: float) -> bool:
    """Return whether a triangle, by its first side, is not higher than a share of its longest side, or upside down."""
    doubled = sides[base].real * sides[base + 1].imag - sides[base].imag * sides[base + 1].real
    longest = 0.0
    for h in range(base, base + 3):
        longest = max(longest, sides[h].real ** 2 + sides[h].imag ** 2)
    return not doubled > least * longest


@compiled
def are_low(sides: ComplexArray, least: float) -> bool:
    """Return whether any triangle with sides (3m,) is not higher than a share of its longest side, or upside down."""
    f = 0
    while f < len(sides) // 3 and not is_low(sides, 3 * f, least):
        f += 1
    return f < len(sides) // 3


@compiled
def find_low(sides: ComplexArray, least: float, found: BoolArray) -> None:
    """Fill in (m,) for each triangle what `are_low` returns for all."""
    for f in range(len(found)):
        found[f] = is_low(sides, 3 * f, least)
