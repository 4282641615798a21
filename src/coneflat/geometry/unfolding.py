"""Unfolding a flat metric into the plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, as_faces
from ..base.jit import compiled
from ..errors import ArrayShapeError
from ..mesh.connectivity import NEXT, PREVIOUS, end_corners
from .planar import as_pairs
from .straight import FlatTriangles

# Number of iterations that distribute the gaps; each costs as much as half a breadth-first search.
SWEEPS = 10
# Minimum length of a side in weights, as a fraction of the longest side: the relative gap at a side of length zero is
# not defined.
NO_LENGTH = 1e-12


def unfold(flat: FlatTriangles, corners: ArrayLike) -> FloatArray:
    """Return (u, 2) the positions in the plane of the points of a flat mesh, cut into charts, in linear time.

    Args:
        flat: the m triangles, in any unit: `ExactMetric.straight` has those of an exact metric, `flat_triangles` those
            of other lengths. Vertices off the cut should have no curvature; otherwise there are gaps, which are
            distributed.
        corners: (m, 3) the points at the triangles' corners, from 0, for example `cut_open(mesh, seams).mesh.faces`.
            The mesh is cut along the sides whose ends have different points in the two triangles. Points without a
            triangle are at 0.

    Raises:
        ArrayShapeError, FaceIndexError: `corners` does not fit the triangles.

    Notes:
        Every point has one position, and every chart is placed separately, its first triangle at the origin.

        The border is laid out first: its sides are joined with their given lengths, rotated from one to the
        next by the angles of the triangles between them, and the rounding error that keeps the loop open is
        distributed over all of it. Both sides of a seam are therefore equal up to the last digits for any mesh
        size. Then the interior is laid out breadth first from the whole border, and the gaps where fronts meet
        are distributed by a few steps of conjugate gradients.

        Measured, largest relative error of a seam edge and of any edge, 20 cones (the rounding of a coordinate
        amounts to 1e-12 to 2e-11 of the shortest seam edges):

        | | 28,576 triangles | 457,216 | 1,551,456 |
        | --- | --- | --- | --- |
        | breadth first from one triangle | 6e-12, 1e-11 | 4e-10, 6e-9 | |
        | the same, then least squares (a factorization) | 3e-13, 3e-13 | 1e-11, 1e-11 | |
        | border first, no gradient steps | 1e-13, 1e-11 | 8e-13, 8e-10 | 1e-11, 2e-8 |
        | border first, 10 steps | 1e-13, 7e-13 | 8e-13, 7e-11 | 1e-11, 3e-9 |
        | border first, 100 steps | 1e-13, 8e-13 | 8e-13, 2e-11 | 1e-11, 2e-10 |
    """
    faces = as_faces(corners, len(flat.twin))
    if faces.size != len(flat.twin):
        raise ArrayShapeError(
            f"corners must have the shape {(len(flat.twin) // 3, 3)}, a point for each corner of the flat triangles, "
            f"got {faces.shape}"
        )
    corner = faces.ravel()
    start, end = faces[:, NEXT].ravel(), faces[:, PREVIOUS].ravel()
    # On the boundary, or where the points differ from those of the twin.
    cut = (flat.twin < 0) | (start != end[flat.twin]) | (end != start[flat.twin])
    m, count = len(faces), int(corner.max()) + 1
    frame, points = np.ones(m, dtype=np.complex128), np.zeros(count, dtype=np.complex128)
    placed, reached = np.zeros(count, dtype=np.bool_), np.zeros(m, dtype=np.bool_)
    queue = np.empty(m, dtype=np.int64)
    arrays = (flat.twin, cut, flat.sides, flat.turns, corner, queue)

    on_cut = np.flatnonzero(cut)
    pinned = np.zeros(count, dtype=np.bool_)
    while (seeds := on_cut[~reached[on_cut // 3]]).size:
        border, frames = _border(flat, cut, int(seeds[0]))
        tails = corner[end_corners(border)[0]]
        points[tails] = closed_chain(frames * flat.sides[border])
        placed[tails] = pinned[tails] = True
        along, first = np.unique(border // 3, return_index=True)
        frame[along] = frames[first]
        reached[along] = True
        queue[: len(along)] = along
        spread(*arrays, len(along), reached, frame, placed, points)
    while not reached.all():  # charts without a border
        seed = int(reached.argmin())
        reached[seed] = placed[corner[3 * seed]] = pinned[corner[3 * seed]] = True
        queue[0] = seed
        spread(*arrays, 1, reached, frame, placed, points)
    _close_gaps(flat.sides, corner, frame, points, pinned)
    return as_pairs(points)


def unfold_from(flat: FlatTriangles, corners: IntArray, seeds: IntArray) -> FloatArray:
    """Return (u, 2) the positions in the plane of the points of small flat meshes without a cut, breadth first.

    Args:
        flat: the m triangles of all meshes.
        corners: (m, 3) the points at the triangles' corners.
        seeds: a triangle of each mesh, whose first corner is placed at the origin.
    """
    corner, count = corners.ravel(), int(corners.max()) + 1
    frame, points = np.ones(len(corners), dtype=np.complex128), np.zeros(count, dtype=np.complex128)
    placed, reached = np.zeros(count, dtype=np.bool_), np.zeros(len(corners), dtype=np.bool_)
    queue = np.empty(len(corners), dtype=np.int64)
    queue[: len(seeds)] = seeds
    reached[seeds] = placed[corners[seeds, 0]] = True
    arrays = (flat.twin, flat.twin < 0, flat.sides, flat.turns, corner, queue)
    spread(*arrays, len(seeds), reached, frame, placed, points)
    return as_pairs(points)


def _border(flat: FlatTriangles, cut: BoolArray, start: int) -> tuple[IntArray, ComplexArray]:
    """Return the border loop through a half-edge, and frames of its triangles in which the directions close up."""
    size = int(cut.sum())
    border, frames = np.empty(size, dtype=np.int64), np.empty(size + 1, dtype=np.complex128)
    count = walk_border(flat.twin, cut, flat.turns, start, border, frames)
    border, excess, frames = border[:count], np.angle(frames[count]), frames[:count]
    frames = frames * np.exp(-1j * excess * np.arange(count) / count)
    return border, frames


def closed_chain(steps: ComplexArray) -> ComplexArray:
    """Return (k,) the corners of a closed polygon whose sides are given steps (k,), with their closing gap distributed.

    Args:
        steps: (k,) complex side vectors, whose sum is almost zero.
    """
    path = np.cumsum(np.abs(steps))
    ends = np.cumsum(steps)
    ends -= ends[-1] * (path / path[-1])
    return np.concatenate([np.zeros(1, dtype=np.complex128), ends[:-1]])


def _close_gaps(
    sides: ComplexArray, corner: IntArray, frame: ComplexArray, points: ComplexArray, pinned: BoolArray
) -> None:
    """Move the points that are not pinned, in place, to distribute the gaps in the layout.

    Conjugate gradients on the sum of the squared relative gaps, preconditioned by the diagonal. The gaps are
    jumps along lines where fronts have met; k iterations distribute a jump over about k triangles. SciPy's version
    would divide by zero if no gap is left, as on small charts.
    """
    squares = sides.real**2 + sides.imag**2
    weight = 1 / np.maximum(squares, NO_LENGTH**2 * squares.max())
    weight_0, weight_1, weight_2 = weight.reshape(-1, 3).T
    around = np.stack([weight_1 + weight_2, weight_2 + weight_0, weight_0 + weight_1], axis=1)
    diagonal = np.bincount(corner, around.ravel(), len(points))
    damping = np.divide(1.0, diagonal, out=np.zeros(len(points)), where=~pinned & (diagonal > 0))
    residual, pull = np.empty_like(points), np.empty_like(points)
    gap_forces(corner, sides, weight, frame, points, residual)
    shift = np.zeros_like(points)
    direction = damping * residual
    product = float(np.vdot(residual, direction).real)
    for _ in range(SWEEPS):
        apply_stiffness(corner, weight, direction, pull)
        steepness = float(np.vdot(direction, pull).real)
        # Products of smaller numbers would be zero, as is the stiffness of a translation, which rounding may leave.
        if min(product, steepness) <= np.finfo(float).tiny ** 0.5:
            break
        shift += product / steepness * direction
        residual -= product / steepness * pull
        before, product = product, float(np.vdot(residual, damping * residual).real)
        direction = damping * residual + (product / before) * direction
    points += shift


@compiled
def walk_border(
    twin: IntArray, cut: BoolArray, turns: ComplexArray, start: int, border: IntArray, frames: ComplexArray
) -> int:
    """Fill in the half-edges of a border loop, in order, and the frames of their triangles; return its length n.

    The walk starts in the frame of the first triangle and transports it around each vertex through the fan of
    triangles inside. frames[n] is the first frame after transport around the whole loop.
    """
    count = 0
    h = start
    frame = 1.0 + 0.0j
    while True:
        border[count] = h
        frames[count] = frame
        count += 1
        h = h - h % 3 + (h + 1) % 3
        while twin[h] >= 0 and not cut[h]:
            frame *= turns[h]
            frame /= abs(frame)
            h = twin[h]
            h = h - h % 3 + (h + 1) % 3
        if h == start:
            frames[count] = frame
            return count


@compiled
def spread(
    twin: IntArray,
    cut: BoolArray,
    sides: ComplexArray,
    turns: ComplexArray,
    corner: IntArray,
    queue: IntArray,
    last: int,
    reached: BoolArray,
    frame: ComplexArray,
    placed: BoolArray,
    points: ComplexArray,
) -> None:
    """Lay out, breadth first, all triangles that can be reached from the first `last` ones in the queue.

    corner: (3m,) vertex of the cut mesh at each corner. Triangles in the queue are marked as reached and have frames
    and at least one placed corner.
    """
    first = 0
    while first < last:
        f = queue[first]
        first += 1
        i, j, k = corner[3 * f], corner[3 * f + 1], corner[3 * f + 2]
        if not (placed[i] and placed[j] and placed[k]):
            # Side h runs from corner h + 1 to corner h + 2; the second round closes the gaps of the first.
            for step in range(6):
                start, end = corner[3 * f + (step + 1) % 3], corner[3 * f + (step + 2) % 3]
                if placed[start] and not placed[end]:
                    points[end] = points[start] + frame[f] * sides[3 * f + step % 3]
                    placed[end] = True
        for h in range(3 * f, 3 * f + 3):
            t = twin[h]
            if t >= 0 and not cut[h] and not reached[t // 3]:
                turned = frame[f] * turns[h]
                size = abs(turned)
                frame[t // 3] = complex(turned.real / size, turned.imag / size)
                reached[t // 3] = True
                queue[last] = t // 3
                last += 1


@compiled
def gap_forces(
    corner: IntArray,
    sides: ComplexArray,
    weight: FloatArray,
    frame: ComplexArray,
    points: ComplexArray,
    force: ComplexArray,
) -> None:
    """Fill in for each vertex the weighted sum of the gaps between its position and those given by adjacent sides.

    The weights are inverse squared lengths of sides, so that gaps are relative.
    """
    force[:] = 0.0
    for base in range(0, len(sides), 3):
        for x in range(3):
            start, end, w = corner[base + (x + 1) % 3], corner[base + (x + 2) % 3], weight[base + x]
            gap = frame[base // 3] * sides[base + x] - (points[end] - points[start])
            gap = complex(gap.real * w, gap.imag * w)  # w * gap would need twice the products
            force[end] += gap
            force[start] -= gap


@compiled
def apply_stiffness(corner: IntArray, weight: FloatArray, shift: ComplexArray, force: ComplexArray) -> None:
    """Fill in the force at each vertex that springs along the sides exert against a shift of the vertices."""
    force[:] = 0.0
    for h in range(0, len(weight), 3):
        i, j, k = corner[h], corner[h + 1], corner[h + 2]
        a, b, c = shift[i], shift[j], shift[k]
        # Real and imaginary parts separately: real times complex would be computed with twice the products.
        weight_0, weight_1, weight_2 = weight[h], weight[h + 1], weight[h + 2]
        x, y, z = weight_0 * (c.real - b.real), weight_1 * (a.real - c.real), weight_2 * (b.real - a.real)
        u, v, w = weight_0 * (c.imag - b.imag), weight_1 * (a.imag - c.imag), weight_2 * (b.imag - a.imag)
        force[i] += complex(y - z, v - w)
        force[j] += complex(z - x, w - u)
        force[k] += complex(x - y, u - v)
